"""What MLEN a request needs, on PROFIBUS: where the Read is cut to it, or refused for it (DS712)."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.lab import captured, message
from ds47.lab.master import SET_PRM, Master, Way
from ds47.report.sentences import message as sentence

WAY = Way(3)
SHORT = "de80b100"
REALS, FAULTS = message.address(2902, 2, 4), message.address(945, 0, 8)
FOUR, EIGHT = message.real(10.0, 20.0, 50.0, 100.0), message.block(0x06, "H", *[1355] * 8)


def master(ident: str = "80e5") -> Master:
    """A line with a started drive, of SINAMICS unless another ident number is given."""
    made = Master()
    made.start(WAY.station, SET_PRM[:8] + ident + SET_PRM[12:])
    return made


def asked(line: Master, reference: int, *places: bytes) -> None:
    line.write(WAY, message.read(reference, 1, *places))


def cut(line: Master) -> None:
    asked(line, 1, REALS)
    line.read(WAY, message.answer(1, 1, 1, FOUR)[:10], most=10)


def cut_behind(line: Master) -> None:
    """The second array was read before: its size is known."""
    line.parameters(WAY, message.read(1, 1, FAULTS), message.answer(1, 1, 1, EIGHT))
    asked(line, 2, REALS, FAULTS)
    line.read(WAY, message.answer(2, 1, 1, FOUR, EIGHT)[:10], most=10)


def later(line: Master) -> None:
    """Refused for its length, and one with 240 brings the record."""
    asked(line, 1, REALS)
    line.read(WAY, refused=SHORT, most=10)
    line.read(WAY, message.answer(1, 1, 1, FOUR))


def alone(line: Master) -> None:
    """Refused for its length, again and again."""
    for reference in (1, 2):
        asked(line, reference, REALS, FAULTS)
        line.read(WAY, refused=SHORT, most=10)


def long_enough(line: Master) -> None:
    asked(line, 1, REALS, FAULTS)
    line.read(WAY, refused=SHORT, most=40)


Story = Callable[[Master], None]
NEEDS = "The Read asks for at most 10 bytes, but the response needs at least "
SAID: dict[tuple[Story, str], list[str]] = {
    (cut, "80e5"): [NEEDS + "22"],
    (cut_behind, "80e5"): [NEEDS + "22; with all values it has 40"],
    (later, "80e5"): [NEEDS + "22"],
    (alone, "80e5"): [NEEDS + "40 with all values of its request"] * 2,
    (alone, "4711"): [NEEDS + "28 with all values of its request"]
    * 2,  # of r2902 no list says the type
    (long_enough, "80e5"): [],
}


def played(story: Story, ident: str) -> bytes:
    line = master(ident)
    story(line)
    return captured(line.stage)


@pytest.mark.parametrize(("story", "ident"), SAID)
def test_what_mlen_a_request_needs(story: Story, ident: str, tmp_path: Path) -> None:
    data = played(story, ident)
    found = [each for each in analyze(io.BytesIO(data)).findings if each.rule == "DS712"]
    assert [sentence(each) for each in found] == SAID[story, ident]
    path = tmp_path / "read.pcapng"
    path.write_bytes(data)
    assert run.audit(path) == []


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_lua_says_the_same(lang: str, tmp_path: Path) -> None:
    sources = [
        Source(f"{each.__name__}-{ident}", played(each, ident), False) for each, ident in SAID
    ]
    compare(VERSIONS[-1], lang, sources, tmp_path)
