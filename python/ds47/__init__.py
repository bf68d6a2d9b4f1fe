"""ds47: the PROFIdrive parameter channel (record 47, 0xB02E, 0xB02F) of PROFINET captures as transactions.

    import ds47

    for transaction in ds47.analyze("machine.pcapng"):
        print(transaction.state, transaction.duration_ms, transaction.parameters)

The names in `__all__` are the library; docs/python.md tells what they promise. They are loaded when they are
asked for: the command asks for none of them.
"""

from __future__ import annotations

from ds47.version import __version__

# Type checkers know the name; to import `typing` for it takes longer than all of this.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from ds47.capture import CaptureError
    from ds47.library.message import (
        Message,
        MessageFinding,
        decode_request,
        decode_response,
        encode,
    )
    from ds47.library.result import Access, Element, LastValue, Result, analyze
    from ds47.model import (
        CaptureFile,
        Device,
        Diagnosis,
        Finding,
        Frames,
        Parameter,
        ParameterError,
        Transaction,
    )
    from ds47.profidrive import Options
    from ds47.spec.raised import Error
    from ds47.wireshark.tshark import NotReadyError

__all__ = [
    "Access", "CaptureError", "CaptureFile", "Device", "Diagnosis", "Element", "Error", "Finding", "Frames",
    "LastValue", "Message", "MessageFinding", "NotReadyError", "Options", "Parameter", "ParameterError", "Result",
    "Transaction", "__version__", "analyze", "decode_request", "decode_response", "encode",
]  # fmt: skip

_ROOMS = {
    "ds47.capture": ("CaptureError",),
    "ds47.spec.raised": ("Error",),
    "ds47.library.message": (
        "Message", "MessageFinding", "decode_request", "decode_response", "encode",
    ),
    "ds47.library.result": ("Access", "Element", "LastValue", "Result", "analyze"),
    "ds47.model": (
        "CaptureFile", "Device", "Diagnosis", "Finding", "Frames", "Parameter", "ParameterError",
        "Transaction",
    ),
    "ds47.profidrive": ("Options",),
    "ds47.wireshark.tshark": ("NotReadyError",),
}  # fmt: skip


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for room, names in _ROOMS.items():
        if name in names:
            globals()[name] = found = getattr(import_module(room), name)
            from ds47.library.docstrings import restore

            restore()
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
