"""The lab: a simulated controller and drive that write captures.

Lives here: the list of scenarios, and how one becomes a file. The scenarios are in the modules
`seeds`, `formats`, `transport`, `records`, `messages`, `conversation`, `naming`, `tour`, `diagnoses*` (causes,
DS7xx), and in the stories and scenes of cyclic frames and PROFIBUS. `client` talks on PROFINET, `master` on
PROFIBUS. `stage` carries what they say; `wire`, `message`, `ether` and `fdl` make its bytes. `drive` is a drive
in cyclic frames, `machine` its program; `cyclic` and `ppo` carry both.
Needs scapy, but only to write a capture of Ethernet.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from types import MappingProxyType

from ds47.lab.scenario import Expect, Scenario
from ds47.lab.stage import Shot, Stage

__all__ = ["Expect", "Scenario", "captured", "everything", "scenarios", "write", "write_log"]

BOOKS = (
    "conversation", "cyclic_stories", "diagnoses", "diagnoses_bytes", "diagnoses_places", "diagnoses_refused",
    "diagnoses_whole", "formats", "messages", "naming", "profibus_stories", "records", "s7_stories", "seeds",
    "tour", "transport",
)  # fmt: skip
"""The modules with stored scenarios."""
RULE_BOOKS = ("cyclic_scenes", "profibus_scenes")
"""Modules that show one rule at a time: `ds47 lab` writes their scenarios, and tests play them."""
_INTERFACE_STATISTICS, _ISB_IFDROP = 5, 5


def scenarios() -> Mapping[str, Scenario]:
    """Every stored scenario by name, sorted."""
    return _of(BOOKS)


def everything() -> Mapping[str, Scenario]:
    """The same, with the scenarios of RULE_BOOKS."""
    return _of(BOOKS + RULE_BOOKS)


@cache
def _of(books: tuple[str, ...]) -> Mapping[str, Scenario]:
    modules = (import_module(f"ds47.lab.{name}") for name in books)
    every = [scenario for module in modules for scenario in module.BOOK.scenarios]
    names = {scenario.name: scenario for scenario in every}
    if len(names) != len(every):
        raise ValueError("two scenarios have the same name")
    return MappingProxyType(dict(sorted(names.items())))


def write(name: str, path: str | Path) -> Stage:
    """Write the capture of a scenario as pcapng; returns the stage that played it.

    The same scenario gives the same bytes every time.

    Raises KeyError for an unknown name, OSError if the file cannot be written.
    """
    stage = everything()[name].play()
    Path(path).write_bytes(captured(stage))
    return stage


def captured(stage: Stage) -> bytes:
    """The frames of a stage as pcapng."""
    from ds47.capture.writer import PcapngWriter

    target = BytesIO()
    with PcapngWriter(target, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    dropped = b"" if stage.dropped is None else _statistics(stage.dropped)
    return target.getvalue() + dropped


def write_log(name: str, path: str | Path) -> Stage:
    """Write the frames of a PROFIBUS scenario as a log, one line each; returns the stage that played it.

    Raises KeyError for an unknown name, OSError if the file cannot be written.
    """
    scenario = everything()[name]
    stage = scenario.play()
    lines = [f"# {scenario.title}", *map(_line, stage.shots)]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
    return stage


def _line(shot: Shot) -> str:
    """`2026-01-01 08:00:00.000100 E5`."""
    seconds, rest = divmod(shot.time_ns, 10**9)
    time = datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S")
    return f"{time}.{rest // 1000:06} {shot.data.hex(' ').upper()}"


def _statistics(dropped: int) -> bytes:
    """The pcapng Interface Statistics Block of interface 0 with isb_ifdrop, and no time."""
    options = struct.pack("<HHQHH", _ISB_IFDROP, 8, dropped, 0, 0)
    body = struct.pack("<3I", 0, 0, 0) + options
    length = len(body) + 12
    return struct.pack("<2I", _INTERFACE_STATISTICS, length) + body + struct.pack("<I", length)
