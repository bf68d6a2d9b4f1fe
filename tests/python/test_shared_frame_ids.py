"""Frames of one sender and frame id that are not of one relation: two controllers, or two recordings in one file.

The receiver tells two controllers apart. Two recordings of one machine nobody can tell apart: DS515, and nothing
is said that rests on both. Lua has to say the same.
"""

from __future__ import annotations

import io
import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from uuid import UUID

import pytest
from test_cyclic_scenes import SCENES
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.cyclic.closeup import closeup
from ds47.cyclic.sequences import Sequences
from ds47.lab import captured
from ds47.lab.client import Client, controller
from ds47.lab.cyclic import PKW, PZD, Cyclic
from ds47.lab.cyclic_scenes import parameters
from ds47.lab.drive import LabDrive
from ds47.lab.machine import IDLE, OFF, ON, Machine
from ds47.lab.stage import Shot, Stage
from ds47.model import CaptureResult

MS = 1_000_000
CYCLIC = b"\x88\x92"
PAIRS = (
    ("start-and-stop", "less-slow-response"), ("saved-often", "slow-response"), ("fault", "start-and-stop"),
    ("every-event", "same-read"), ("change-in-operation", "saved-seldom"),
)  # fmt: skip
LATER = (0, 1 * MS, 5 * MS, 300 * MS, 1_001 * MS)
READ = bytes.fromhex("143a000000000000")


def merged(one: str, other: str, later_ns: int, *, whole: bool) -> bytes:
    """Two scenes in one file, the other one without its Connect unless it is whole."""
    shots = [*SCENES[one].play().shots]
    for shot in SCENES[other].play().shots:
        if whole or shot.data[12:14] == CYCLIC:
            shots.append(replace(shot, time_ns=shot.time_ns + later_ns))
    stage = Stage()
    stage.shots = sorted(shots, key=lambda shot: shot.time_ns)
    return captured(stage)


def result(content: bytes) -> CaptureResult:
    return analyze(io.BytesIO(content))


def rules(found: CaptureResult) -> set[str]:
    return {each.rule for each in found.findings}


def each_way(*, quick: bool) -> list[tuple[tuple[str, str], int, bool]]:
    """Pair, offset, and whether the other one has its Connect."""
    ways = [(pair, later, whole) for pair in PAIRS for later in LATER for whole in (True, False)]
    return [way for way in ways if (way[1:] == (LATER[3], False)) == quick]


QUICK, SLOW = (
    each_way(quick=True),
    [pytest.param(*way, marks=pytest.mark.slow) for way in each_way(quick=False)],
)


@pytest.mark.parametrize(("pair", "later_ns", "whole"), [*QUICK, *SLOW])
def test_two_recordings_in_one_file(
    pair: tuple[str, str], later_ns: int, whole: bool, tmp_path: Path
) -> None:
    content = merged(*pair, later_ns, whole=whole)
    found, alone = result(content), result(captured(SCENES[pair[0]].play()))
    (told,) = (each for each in found.findings if each.rule == "DS515")
    assert rules(found) <= {"DS515"} | rules(alone)
    assert {each.state for each in found.transactions} <= {"ok", "error"}
    assert all(each.frames.read_response <= told.frame for each in found.transactions)
    assert all(event.frame < told.frame for each in found.timelines for event in each.events)
    path = tmp_path / "merged.pcapng"
    path.write_bytes(content)
    assert [str(each) for each in run.audit(path)] == []


@pytest.mark.parametrize("name", ["start-and-stop", "saved-often", "every-event"])
def test_a_recording_twice_in_one_file_says_what_it_says_once(name: str) -> None:
    twice, once = (
        result(merged(name, name, 20_000, whole=False)),
        result(captured(SCENES[name].play())),
    )
    assert rules(twice) == rules(once)
    assert len(twice.transactions) == len(once.transactions)
    assert [len(each.events) for each in twice.timelines] == [
        len(each.events) for each in once.timelines
    ]


def two_controllers(*numbers: int) -> bytes:
    """A device with a drive for each of two controllers, whose inputs have one frame id; only these are heard."""
    stage = Stage()
    machines = []
    for number in (1, 2):
        channel = Client(stage).at(ar=UUID(int=number))
        activity = UUID(int=0x100 + number)
        client = Client(stage, host=controller(number), channel=channel, activity=activity)
        modules = (replace(PKW, slot=number + 1), replace(PZD, slot=number + 1))
        line = Cyclic(client, modules, given=0x8002 + number, reduction=16)
        machines.append(Machine(line, LabDrive(cells=parameters())).connect())
    one, other = machines
    one.control(ON)
    other.control(OFF)
    for number in range(120):
        begun = stage.now_ns
        one.cycle()
        stage.now_ns = begun + 3 * MS
        other.ask(READ if number % 20 < 10 else IDLE, cycles=1)
        stage.now_ns = begun + 16 * MS
    stage.shots = [shot for shot in stage.shots if any(hears(shot, number) for number in numbers)]
    return captured(stage)


def hears(shot: Shot, number: int) -> bool:
    return bytes.fromhex(controller(number).mac.replace(":", "")) in (
        shot.data[:6],
        shot.data[6:12],
    )


def said(found: CaptureResult, controllers: Iterator[str] | tuple[str, ...]) -> list[object]:
    """What was found of some controllers, without numbers of frames."""
    relations = [each for each in found.relations if each.controller in controllers]
    return [
        [(each.channel, each.slot, each.certainty) for each in relations],
        [
            (each.operation, each.state, each.slot, each.start_ns, each.duration_ns)
            for each in found.transactions if each.controller in controllers
        ],
        [
            [(event.name, event.time_ns, event.state) for event in each.events] for each in found.timelines
            if found.relations[each.relation - 1].controller in controllers
        ],
    ]  # fmt: skip


def test_two_controllers_with_one_frame_id_are_two(tmp_path: Path) -> None:
    both = result(two_controllers(1, 2))
    assert len({each.input.frame_id for each in both.relations}) == 1
    assert len(both.relations) == 4
    for number in (1, 2):
        own = (controller(number).ip,)
        assert said(both, own) == said(result(two_controllers(number)), own)
    assert len([each for each in both.transactions if each.state == "ok"]) == 6
    assert "DS515" not in rules(both)
    path = tmp_path / "two.pcapng"
    path.write_bytes(two_controllers(1, 2))
    assert [str(each) for each in run.audit(path)] == []
    relation = both.relations[both.timelines[0].relation - 1]
    seen = closeup(str(path), relation, 100, 10**9)
    assert len({each.frame for each in seen if each.by_controller}) == pytest.approx(
        len(seen) / 2, abs=1
    )
    apart = [b.time_ns - a.time_ns for a, b in pairwise(e for e in seen if not e.by_controller)]
    assert set(apart) == {16 * MS}


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [
        Source(f"{one}+{other} {later} {whole}", merged(one, other, later, whole=whole), False)
        for one, other in PAIRS for later in LATER for whole in (True, False)
    ]  # fmt: skip
    compare(
        version, "en", [*sources, Source("two controllers", two_controllers(1, 2), False)], tmp_path
    )


# The counters alone

Counted = tuple[int, int]
"""A counter, and the time in ns."""


def stream(dice: random.Random, count: int = 400, cycle: int = 128) -> list[Counted]:
    """Frames of one sender from some moment on."""
    counter, time_ns = dice.randrange(1 << 16), dice.randrange(10**9)
    return [
        ((counter + number * cycle) % (1 << 16), time_ns + number * cycle * 31_250)
        for number in range(count)
    ]


def lost(frames: list[Counted], dice: random.Random) -> list[Counted]:
    return [each for each in frames if dice.random() < 0.5]


def late(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """Times of a capture point that looks every ten milliseconds."""
    return [(counter, -(-time_ns // (10 * MS)) * 10 * MS) for counter, time_ns in frames]


def uneven(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """A sender that counts the time at which it sends."""
    drift = [dice.randint(-20, 20) for _ in frames]
    return [
        ((counter + off) % (1 << 16), time_ns + off * 31_250)
        for (counter, time_ns), off in zip(frames, drift, strict=True)
    ]


def swapped(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """Frames out of order, with the times of their places: some of them."""
    counters = [counter for counter, _ in frames]
    for at in range(0, len(frames) - 1, 2):
        if dice.random() < 0.12:
            counters[at : at + 2] = reversed(counters[at : at + 2])
    return [(counter, time_ns) for counter, (_, time_ns) in zip(counters, frames, strict=True)]


def shuffled(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """Frames out of order, with their own times."""
    return sorted(frames, key=lambda each: each[1] + dice.randrange(40) * MS)


def again(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """The sender starts again, and again."""
    found = list(frames)
    for _ in range(4):
        found += [
            (c, found[-1][1] + 5 * MS + number * 4 * MS)
            for number, (c, _) in enumerate(stream(dice, 50))
        ]
    return found


def idle(frames: list[Counted], dice: random.Random) -> list[Counted]:
    """Counters that do not count."""
    return [(0, time_ns) for _, time_ns in frames]


def wild(frames: list[Counted], dice: random.Random) -> list[Counted]:
    return [(dice.randrange(1 << 16), time_ns) for _, time_ns in frames]


def set_back(frames: list[Counted], dice: random.Random) -> list[Counted]:
    half = len(frames) // 2
    return [
        *frames[:half],
        *((counter, time_ns - 5_000 * MS) for counter, time_ns in frames[half:]),
    ]


def proven(frames: list[Counted], cycle: int = 128) -> int | None:
    """With which frame several sequences are proven."""
    counted = Sequences(cycle * 31_250)
    for number, (counter, time_ns) in enumerate(frames):
        if counted.are_several(counter, time_ns, number.to_bytes(4), number):
            return number
    return None


ONE = (lost, late, uneven, swapped, shuffled, again, idle, wild, set_back)


@pytest.mark.parametrize("what", ONE, ids=lambda what: what.__name__)
def test_one_sequence_is_one(what: object) -> None:
    for seed in range(60):
        dice = random.Random(seed)
        cycle = dice.choice((32, 64, 128, 1024))
        assert proven(what(stream(dice, cycle=cycle), dice), cycle) is None, seed  # type: ignore[operator]


def test_two_sequences_are_two() -> None:
    for seed in range(200):
        dice = random.Random(seed)
        one, other = stream(dice), stream(dice)
        shift = one[0][1] - other[0][1] + dice.randrange(1, 4 * MS)
        frames = [*one, *((counter, time_ns + shift) for counter, time_ns in other)]
        found = proven(sorted(frames, key=lambda each: each[1]))
        assert found is not None, seed
        assert found < 30, seed
