"""What is said of a drive rests on its words as long as they stand: valid, and of the channel that is at work.

Cases that conversations by chance brought up (`tests.audit.machines`); the auditor and Lua have to agree.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.lab import captured, message
from ds47.lab.client import Client
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, Cyclic
from ds47.lab.cyclic_scenes import machine
from ds47.lab.machine import ON, Machine
from ds47.lab.stage import Stage

It = Machine[Cyclic]
BLOCKED = ON & ~0x40
REFUSED = message.answer(1, 0x82, 2, message.error(0x6B))
READ = b"\x13\xe7" + bytes(6)
"""A request for p0999, which the drive has not."""
ASKED = message.change(1, 2, (message.address(50076), message.word(1)))


def refused(it: It) -> None:
    """A change is not accepted, for a reason that the state of the drive may be."""
    client = it.line.client
    client.exchange(ASKED, REFUSED, client.at(slot=2, subslot=1))


def running(it: It) -> None:
    refused(it.start())


def invalid(it: It) -> None:
    it.start().line.iops[INPUT] = BAD
    refused(it.run(0.2))


def valid_again(it: It) -> None:
    it.start().line.iops[INPUT] = BAD
    it.run(0.2).line.iops[INPUT] = GOOD
    refused(it.run(0.2))


def connected_anew(it: It) -> None:
    """The new channel shows nothing of a drive."""
    it.start().connect()
    refused(it)


def setpoint_that_stands(it: It) -> None:
    """It moves while it is blocked, shortly; then the data of the drive is not valid for a while."""
    it.start(30).control(BLOCKED)
    for percent in range(30, 60):
        it.setpoint(percent).cycle()
    it.line.iops[INPUT] = BAD
    it.run(0.2).line.iops[INPUT] = GOOD
    it.run(3)


def setpoint_that_moves(it: It) -> None:
    it.start(30).control(BLOCKED).line.iops[INPUT] = BAD
    it.run(0.2).line.iops[INPUT] = GOOD
    for percent in range(30, 60):
        it.setpoint(percent).run(0.1)


def request_that_was_refused(it: It) -> None:
    """While the data of the controller was not valid; the drive goes on saying so."""
    it.start().line.iops[OUTPUT] = BAD
    it.ask(READ, 9).line.iops[OUTPUT] = GOOD
    it.ask(READ, 60)


def request_that_is_ignored(it: It) -> None:
    it.drive.pause = 999
    it.start().ask(READ, 700)


def ask(it: It) -> None:
    it.start().ask(READ, 8)


def clock_set_back(it: It) -> None:
    it.start().ask(READ, 2)
    it.line.client.wait(-5000)
    it.ask(READ)


CASES: dict[Callable[[It], None], list[str]] = {
    running: ["DS530"], invalid: [], valid_again: ["DS530"], connected_anew: [], setpoint_that_stands: [],
    setpoint_that_moves: ["DS525"], request_that_was_refused: [], request_that_is_ignored: ["DS514"],
    clock_set_back: [],
}  # fmt: skip
OF_WORDS = ("DS514", "DS525", "DS530", "DS531")


def played(case: Callable[[It], None], *, swapped: bool = False) -> bytes:
    """`swapped`: the response to the Connect stands before its request."""
    stage = Stage()
    case(machine(Client(stage)))
    if swapped:
        stage.shots[:2] = reversed(stage.shots[:2])
    return captured(stage)


@pytest.mark.parametrize("case", CASES)
def test_what_is_said(case: Callable[[It], None], tmp_path: Path) -> None:
    content = played(case)
    found: list[Any] = analyze(io.BytesIO(content)).findings
    assert [each.rule for each in found if each.rule in OF_WORDS] == CASES[case]
    path = tmp_path / "case.pcapng"
    path.write_bytes(content)
    assert [str(each) for each in run.audit(path)] == []


def test_cycles_are_not_counted_where_the_clock_was_set_back() -> None:
    told, true = (analyze(io.BytesIO(played(each))) for each in (clock_set_back, ask))
    assert [(each.state, each.cycles) for each in true.transactions] == [("error", 4)]
    assert [(each.state, each.cycles) for each in told.transactions] == [("error", None)]


def test_a_connect_whose_frames_are_out_of_order() -> None:
    told, true = (analyze(io.BytesIO(played(running, swapped=each))) for each in (True, False))
    events = [[(each.name, each.frame) for each in it.timelines[0].events] for it in (told, true)]
    assert events[0] == events[1]


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [Source(each.__name__, played(each), False) for each in CASES]
    sources.append(Source("swapped", played(running, swapped=True), False))
    compare(version, "en", sources, tmp_path)
