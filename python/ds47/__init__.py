"""ds47: the PROFIdrive parameter channel (record 47, 0xB02E, 0xB02F) of PROFINET captures as transactions.

    import ds47

    for transaction in ds47.analyze("machine.pcapng"):
        print(transaction.state, transaction.duration_ms, transaction.parameters)

The names in `__all__` are the library; docs/python.md says what they promise. Each is loaded on first use: the
command line needs none of them.
"""

from __future__ import annotations

from ds47.version import __version__

# Type checkers know this name; importing `typing` for it would take longer than all of this module.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from ds47.capture import CaptureError
    from ds47.library.captures import analyze, analyze_frames, analyze_many
    from ds47.library.choices import Choices, Engine
    from ds47.library.message import (
        Message,
        MessageFinding,
        decode_request,
        decode_response,
        encode,
    )
    from ds47.library.result import Access, Element, LastValue, Result
    from ds47.library.watching import Seen, watch
    from ds47.model import (
        CaptureFile,
        Channel,
        Device,
        Diagnosis,
        Finding,
        Frames,
        Parameter,
        ParameterError,
        State,
        Transaction,
    )
    from ds47.profidrive import Options
    from ds47.spec import Operation, Severity
    from ds47.spec.raised import Error
    from ds47.wireshark.tshark import NotReadyError

__all__ = [
    "Access", "CaptureError", "CaptureFile", "Channel", "Choices", "Device", "Diagnosis", "Element", "Engine",
    "Error", "Finding", "Frames", "LastValue", "Message", "MessageFinding", "NotReadyError", "Operation",
    "Options", "Parameter", "ParameterError", "Result", "Seen", "Severity", "State", "Transaction",
    "__version__", "analyze", "analyze_frames", "analyze_many", "decode_request", "decode_response", "encode",
    "watch",
]  # fmt: skip

_ROOMS = {
    "ds47.capture": ("CaptureError",),
    "ds47.spec.raised": ("Error",),
    "ds47.library.captures": ("analyze", "analyze_frames", "analyze_many"),
    "ds47.library.choices": ("Choices", "Engine"),
    "ds47.library.message": (
        "Message", "MessageFinding", "decode_request", "decode_response", "encode",
    ),
    "ds47.library.result": ("Access", "Element", "LastValue", "Result"),
    "ds47.library.watching": ("Seen", "watch"),
    "ds47.model": (
        "CaptureFile", "Channel", "Device", "Diagnosis", "Finding", "Frames", "Parameter", "ParameterError",
        "State", "Transaction",
    ),
    "ds47.profidrive": ("Options",),
    "ds47.spec": ("Operation", "Severity"),
    "ds47.wireshark.tshark": ("NotReadyError",),
}  # fmt: skip


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for room, names in _ROOMS.items():
        if name in names:
            globals()[name] = found = getattr(import_module(room), name)
            from ds47.library.docstrings import restore
            from ds47.report.shown import switch_on

            restore()
            switch_on()
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
