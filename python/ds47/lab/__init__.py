"""The lab: a simulated controller and drive that write captures.

Here are the list of scenarios and how one becomes a file. What happens in them is in the modules
`seeds`, `formats`, `transport`, `records`, `messages`, `conversation`, `naming`, `tour` and (causes, DS7xx)
the `diagnoses`; who talks is `client`, how it is carried `stage`, and its bytes come from `wire`, `message`
and `ether`.
Needs scapy, but only when a capture is made.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import MappingProxyType

from ds47.lab.scenario import Expect, Scenario
from ds47.lab.stage import Stage

__all__ = ["Expect", "Scenario", "scenarios", "write"]

BOOKS = (
    "conversation", "cyclic_stories", "diagnoses", "diagnoses_bytes", "diagnoses_places", "diagnoses_refused",
    "diagnoses_whole", "formats", "messages", "naming", "records", "s7_stories", "seeds", "tour", "transport",
)  # fmt: skip
"""The modules with scenarios."""
_INTERFACE_STATISTICS, _ISB_IFDROP = 5, 5


@cache
def scenarios() -> Mapping[str, Scenario]:
    """Every scenario by its name, in the order of the names."""
    modules = (import_module(f"ds47.lab.{name}") for name in BOOKS)
    every = [scenario for module in modules for scenario in module.BOOK.scenarios]
    names = {scenario.name: scenario for scenario in every}
    if len(names) != len(every):
        raise ValueError("two scenarios have the same name")
    return MappingProxyType(dict(sorted(names.items())))


def write(name: str, path: str | Path) -> Stage:
    """Write the capture of a scenario as pcapng; the stage on which it was played.

    The same scenario gives the same bytes every time.

    Raises KeyError for an unknown name, OSError where the file cannot be written.
    """
    from ds47.capture.writer import PcapngWriter

    stage = scenarios()[name].play()
    with PcapngWriter(path, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    if stage.dropped is not None:
        with Path(path).open("ab") as file:
            file.write(_statistics(stage.dropped))
    return stage


def _statistics(dropped: int) -> bytes:
    """The pcapng Interface Statistics Block of interface 0 with isb_ifdrop, and no time."""
    options = struct.pack("<HHQHH", _ISB_IFDROP, 8, dropped, 0, 0)
    body = struct.pack("<3I", 0, 0, 0) + options
    length = len(body) + 12
    return struct.pack("<2I", _INTERFACE_STATISTICS, length) + body + struct.pack("<I", length)
