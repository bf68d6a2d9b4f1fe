"""Findings about cyclic channels at their limits: what is just within, and just beyond; both implementations.

Scenes here are not those of the lab, which are well away from a limit. Habits as such: the limits that no
capture of a sensible length reaches.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare

from ds47.analysis import analyze
from ds47.cyclic.habits import Habits
from ds47.cyclic.handshake import CycleMoment, PkwJob, Sight
from ds47.lab import captured
from ds47.lab.client import Client
from ds47.lab.cyclic import PKW, PZD, Cyclic, LabModule
from ds47.lab.cyclic_scenes import parameters
from ds47.lab.cyclic_stories import BOOK
from ds47.lab.drive import LabDrive
from ds47.lab.machine import IDLE, OFF, ON, Machine
from ds47.lab.stage import Stage
from ds47.model import Finding
from ds47.spec.semantics import limits

Scene = Callable[[Machine[Cyclic]], object]
READ_304, CHANGE_304 = bytes.fromhex("1130000000000000"), bytes.fromhex("2130000000000032")
TENTH = 1638
"""Of 16384, which is 100 %: the greatest distance that is not more than 10 %."""


class Unwilling(LabDrive):
    """A drive that refuses whatever is asked, because of its state."""

    def _respond(self, request: bytes) -> bytes:
        return self._refuse(request, 17) if request != IDLE else request


def played(scene: Scene, *modules: LabModule, drive: type[LabDrive] = LabDrive) -> bytes:
    """The capture of a drive with these modules, those of telegram 353 where none are named."""
    stage = Stage()
    line = Cyclic(Client(stage), modules or (PKW, PZD), reduction=16)
    scene(Machine(line, drive(cells=parameters())).connect())
    return captured(stage)


def reads(count: int) -> bytes:
    """So many reads of one parameter, and fewer of another."""

    def scene(it: Machine[Cyclic]) -> None:
        it.start().read(700)
        for _ in range(count):
            it.read(1082)

    return played(scene)


def away(raw: int) -> bytes:
    """The motor is blocked at 0, and six seconds long the setpoint is so far away."""

    def scene(it: Machine[Cyclic]) -> None:
        it.drive.blocked = True
        it.control(OFF).run(0.1).control(ON).run(0.5)
        it.raw = raw
        it.run(6)

    return played(scene)


def slow(*pauses: int) -> bytes:
    """Reads that are answered after so many cycles of 16 ms."""

    def scene(it: Machine[Cyclic]) -> None:
        it.start()
        for pause in pauses:
            it.drive.pause = pause
            it.read(700, cycles=pause + 10)
            it.drive.pause = 3
            it.ask(IDLE)

    return played(scene)


def refused_read(it: Machine[Cyclic]) -> None:
    """A read is refused because of the state of a drive that runs."""
    it.start().ask(READ_304).ask(IDLE)


def refused_change(it: Machine[Cyclic]) -> None:
    """A change is."""
    it.start().ask(CHANGE_304).ask(IDLE)


def stopped_meanwhile(it: Machine[Cyclic]) -> None:
    """The drive runs when the change is asked for, and does not when it is refused."""
    it.start()
    it.drive.pause, it.drive.cells[304, 0].refused = 20, 17
    it.ask(CHANGE_304, 10).control(0x047C).ask(CHANGE_304, 20).ask(IDLE)


SCENES: dict[str, tuple[bytes, list[str]]] = {
    "100 reads": (reads(100), []),
    "101 reads": (reads(101), ["DS509"]),
    "a tenth away": (away(TENTH), ["DS512"]),
    "more than a tenth away": (away(TENTH + 1), ["DS512", "DS526"]),
    "slow, and slower before": (slow(100, 70), ["DS511"]),
    "slow, and slower behind": (slow(70, 100), ["DS511"]),
    "a read": (played(refused_read, drive=Unwilling), ["DS501"]),
    "a change": (played(refused_change, drive=Unwilling), ["DS501", "DS530"]),
    "stopped meanwhile": (played(stopped_meanwhile), ["DS501"]),
}


def findings(name: str) -> list[Finding]:
    return analyze(io.BytesIO(SCENES[name][0])).findings


@pytest.mark.parametrize("name", SCENES)
def test_just_within_and_just_beyond(name: str) -> None:
    assert sorted(each.rule for each in findings(name)) == SCENES[name][1]


@pytest.mark.parametrize("name", ["slow, and slower before", "slow, and slower behind"])
def test_the_slowest_response_is_named(name: str) -> None:
    (found,) = findings(name)
    assert (found.args["count"], found.args["slowest"]) == (2, 1616.1)


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_has_the_same_limits(version: str, tmp_path: Path) -> None:
    """And the stories, in which changes by records are explained, too."""
    sources = [Source(name, content, False) for name, (content, _) in SCENES.items()]
    sources += [Source(each.name, captured(each.play()), False) for each in BOOK.scenarios]
    compare(version, "en", sources, tmp_path)


@pytest.mark.parametrize(("words", "rule"), [("d", "DS508"), ("1", "DS509")])
def test_parameters_that_are_remembered_are_bounded(words: str, rule: str) -> None:
    """Those that were saved and those that were read, together."""
    bounds = limits().but(written_values=2, pkw_saved=3, pkw_reads=3)
    habits = Habits({}, bounds, "cyclic")
    for number in range(4 * 4):
        data = bytes.fromhex(f"{words}00{number % 4}000000000000")
        sight = Sight(data, CycleMoment(number, number, number))
        assert list(habits.take(PkwJob(sight, None, True))) == []
    told = [each.args["pnu"] for each in habits.finish()]
    assert told == {"DS508": [0, 1], "DS509": [0]}[rule]
