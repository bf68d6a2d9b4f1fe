"""Which faults stopped a drive that ran (DS520): what is just one, and what is just none; both implementations."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.lab import captured
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, Cyclic
from ds47.lab.cyclic_scenes import SPEED
from ds47.lab.stage import Stage
from ds47.report.verdict import VerdictCounts, verdict
from ds47.report.zones import zone

OFF, ON, JOG, NO_ENABLE, ACKNOWLEDGE = 0x047E, 0x047F, 0x057E, 0x0477, 0x04FE
IGNORED = 0x007F
"""ON without bit 10: the drive goes on with the word before."""
READY, SWITCHED_ON, RUNS, FAULT = 0xFB31, 0xFB33, 0xFB37, 0xFB78
LOCAL, OFF2 = 0xF937, 0xFB60
NEITHER, ITS, CONTROLLERS, BOTH = (), (INPUT,), (OUTPUT,), (INPUT, OUTPUT)
"""Whose data is not valid."""
CYCLE_MS = 8
Step = tuple[int, int, int] | tuple[int, int, int, tuple[int, ...]]


def played(*steps: Step, vendor_id: int = 0x002A) -> bytes:
    """Control and status word, each for so many cycles; at last the fault is acknowledged."""
    stage = Stage()
    line = Cyclic(Client(stage, device=drive(vendor_id=vendor_id)), (SPEED,), reduction=CYCLE_MS)
    line.connect()
    begin = ((OFF, READY, 10), (ON, READY, 2), (ON, RUNS, 20))
    for stw1, zsw1, cycles, *bad in (*begin, *steps, (ACKNOWLEDGE, FAULT, 1), (OFF, READY, 9)):
        line.iops = dict.fromkeys((INPUT, OUTPUT), GOOD) | dict.fromkeys(bad[0] if bad else (), BAD)
        line.say(SPEED, OUTPUT, struct.pack(">HH", stw1, 0))
        line.say(SPEED, INPUT, struct.pack(">HH", zsw1, 0))
        line.cycle(cycles)
    return captured(stage)


TRIP = ["DS520"]
CASES: dict[str, tuple[bytes, list[str]]] = {
    "at once": (played((ON, FAULT, 9)), TRIP),
    "a cycle later": (played((ON, SWITCHED_ON, 1), (ON, FAULT, 9)), TRIP),
    "not even ready for a cycle": (played((ON, READY, 1), (ON, FAULT, 9)), TRIP),
    "a second later": (played((ON, SWITCHED_ON, 125), (ON, FAULT, 9)), TRIP),
    "more than a second later": (played((ON, SWITCHED_ON, 126), (ON, FAULT, 9)), []),
    "after OFF1": (played((OFF, RUNS, 2), (OFF, READY, 1), (OFF, FAULT, 9)), []),
    "on the ramp of OFF1": (played((OFF, RUNS, 2), (OFF, FAULT, 9)), TRIP),
    "OFF1, and ON again": (played((OFF, RUNS, 1), (OFF, READY, 1), (ON, READY, 1), (ON, FAULT, 9)), []),
    "OFF1 behind that": (played((ON, SWITCHED_ON, 1), (OFF, SWITCHED_ON, 1), (OFF, FAULT, 9)), []),
    "no longer enabled": (played((NO_ENABLE, SWITCHED_ON, 2), (ON, FAULT, 9)), []),
    "by jog": (played((JOG, RUNS, 9), (JOG, SWITCHED_ON, 1), (JOG, FAULT, 9)), TRIP),
    "jog ended": (played((JOG, RUNS, 9), (OFF, SWITCHED_ON, 1), (OFF, FAULT, 9)), []),
    "OFF1 that it ignores": (played((IGNORED, RUNS, 2), (IGNORED, READY, 1), (IGNORED, FAULT, 9)), TRIP),
    "switched off at the drive": (played((ON, OFF2, 1), (ON, FAULT, 9)), ["DS529"]),
    "controlled at the drive": (
        played((ON, LOCAL, 2), (ON, LOCAL & ~4, 1), (ON, LOCAL & ~6 | 8, 9)), ["DS527"],
    ),
    "its data not valid meanwhile": (played((ON, FAULT, 9, ITS), (ON, FAULT, 9)), TRIP),
    "and for long": (played((ON, FAULT, 999, ITS), (ON, FAULT, 9)), TRIP),
    "and OFF1": (played((OFF, FAULT, 9, ITS), (ON, FAULT, 9)), []),
    "and stopped": (played((ON, READY, 9, ITS), (ON, READY, 9), (ON, FAULT, 9)), TRIP),
    "and stopped long ago": (played((ON, READY, 120, ITS), (ON, READY, 9), (ON, FAULT, 9)), []),
    "nobody's data valid": (played((ON, RUNS, 2, ITS), (ON, FAULT, 9, BOTH), (ON, FAULT, 9)), TRIP),
    "the controller's data not valid": (played((ON, FAULT, 9, CONTROLLERS), (ON, FAULT, 9)), ["DS528"]),
    "then both": (
        played((ON, RUNS, 1, CONTROLLERS), (ON, RUNS, 9, BOTH), (ON, FAULT, 9, CONTROLLERS)), ["DS528"],
    ),
    "not valid, without control": (
        played((IGNORED, RUNS, 9), (IGNORED, FAULT, 9, CONTROLLERS), (ON, FAULT, 9)), TRIP,
    ),
    "valid again": (
        played((ON, RUNS, 9, CONTROLLERS), (ON, RUNS, 9), (ON, SWITCHED_ON, 1), (ON, FAULT, 9)),
        ["DS528", *TRIP],
    ),
    "at standstill": (played((OFF, READY, 200), (OFF, FAULT, 9)), []),
    "at standstill, not valid": (played((OFF, READY, 200), (ON, FAULT, 9, ITS), (ON, FAULT, 9)), []),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_what_a_trip_is(name: str, tmp_path: Path) -> None:
    content, rules = CASES[name]
    found = analyze(io.BytesIO(content)).findings
    assert sorted({each.rule for each in found}) == sorted(set(rules))
    path = tmp_path / "trip.pcapng"
    path.write_bytes(content)
    assert [str(each) for each in run.audit(path)] == []


@pytest.mark.parametrize("name", [name for name, (_, rules) in CASES.items() if rules == TRIP])
def test_a_drive_that_tripped_is_not_ok(name: str) -> None:
    assert verdict(VerdictCounts.of(analyze(io.BytesIO(CASES[name][0])))).en.startswith("NOT OK")


def test_the_headline_says_that_a_fault_is_over() -> None:
    result = analyze(io.BytesIO(CASES["at once"][0]))
    head = "192.168.133.33 slot 2 had a fault while running"
    said = verdict(VerdictCounts.of(result))
    assert said.en == f"NOT OK: {head}, until 08:00:00.338"
    assert said.zh.endswith("运行中出现故障，直到 08:00:00.338")
    there = VerdictCounts.of(result, zone("+01:00"))
    assert verdict(there).en == f"NOT OK: {head}, until 09:00:00.338"
    events = result.timelines[0].events
    while events[-1].name != "fault":
        events.pop()
    assert verdict(VerdictCounts.of(result)).en == f"NOT OK: {head}, with no end in this capture"
    result.timelines[0].events_left_out = 1  # one of them may be its end
    assert verdict(VerdictCounts.of(result)).en == f"NOT OK: {head}"


def test_nor_one_of_another_maker() -> None:
    steps = (ON, READY, 1), (ON, FAULT, 9)
    told = analyze(io.BytesIO(played(*steps, vendor_id=0x0493)))
    assert [(each.rule, each.severity) for each in told.findings] == [("DS520", "note")]
    assert verdict(VerdictCounts.of(told)).en.startswith("WARNING")


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    compare(
        version, "en", [Source(name, each, False) for name, (each, _) in CASES.items()], tmp_path
    )
