"""What is said of cyclic channels is true: requests in halves, requests without an edge, and without a drive.

Captures of others in ../shared say what is expected of them in their README; the rest is made by the lab.
"""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from test_profibus_ppo import on_profibus

import ds47
from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.lab import captured
from ds47.lab.client import Client
from ds47.lab.cyclic import Cyclic
from ds47.lab.cyclic_scenes import parameters
from ds47.lab.drive import Drive
from ds47.lab.machine import IDLE, OFF, Machine
from ds47.lab.stage import Stage
from ds47.model import CaptureResult

SENTENCES = Path(__file__).resolve().parents[3] / "shared" / "captures" / "sentences"
READ, HALF, WHOLE = (
    bytes.fromhex(each) for each in ("143a000000000000", "343a000000000000", "343a000042200000")
)


def of_others(name: str) -> CaptureResult:
    path = SENTENCES / name
    if not path.exists():
        pytest.skip("../shared is not there")
    return analyze(path)


def told(result: CaptureResult) -> tuple[list[str], list[str]]:
    """States of transactions, and rules."""
    return [each.state for each in result.transactions], [each.rule for each in result.findings]


def test_a_half_change_of_others_is_one() -> None:
    assert told(of_others("ppo1-half-change.pcap")) == (["ok", "ok"], ["DS506"])


def test_a_request_of_others_that_stands_from_the_first_exchange_on() -> None:
    assert told(of_others("ppo1-asked-from-first-exchange.pcap")) == (["ok"], [])


def talk(*asked: tuple[bytes, int], pause: int = 3) -> bytes:
    """Requests, each for so many cycles, to a drive that stands."""
    stage = Stage()
    machine = Machine(Cyclic(Client(stage), reduction=4), Drive(cells=parameters(), pause=pause))
    machine.connect().control(OFF)
    for words, cycles in asked:
        machine.ask(words, cycles)
    return captured(stage)


def by_name(content: bytes, ways: tuple[str, ...] = ("output", "input")) -> CaptureResult:
    """Without the Connect, and with these directions: its channels named by hand."""
    whole = analyze(io.BytesIO(content))
    sides = [(each.channel, each.output, each.input) for each in whole.relations]
    names = [
        f"{s.mac}@{s.frame_id:04x}:{s.offset}:{channel}" for channel, *two in sides for s in two
    ]
    kept = [getattr(each, way).mac for each in whole.relations for way in ways]
    target = io.BytesIO()
    with open_capture(io.BytesIO(content)) as source, PcapngWriter(target) as writer:
        for frame in source.everything():
            if frame.data[12:14] == b"\x88\x92" and frame.data[6:12].hex(":") in kept:
                writer.write(frame.time_ns, frame.data)
    target.seek(0)
    return analyze(
        target, ds47.analysis.AnalysisOptions(cyclic=tuple(map(ds47.cyclic.named.parse, names)))
    )


IN_HALVES = ((IDLE, 20), (READ, 9), (HALF, 1), (WHOLE, 9), (IDLE, 5))
REPLACED = ((IDLE, 20), (READ, 9), (HALF, 2), (WHOLE, 9), (IDLE, 5))


@pytest.mark.parametrize("how", ["connect", "profibus", "named"])
def test_halves_are_a_cycle_apart_wherever_the_words_lie(how: str) -> None:
    def result(content: bytes) -> CaptureResult:
        if how == "profibus":
            bus = on_profibus(content)
            assert bus is not None
            return analyze(io.BytesIO(bus))
        return by_name(content) if how == "named" else analyze(io.BytesIO(content))

    assert told(result(talk(*IN_HALVES))) == (["ok", "ok"], ["DS506"])
    assert told(result(talk(*REPLACED))) == (["ok", "superseded", "ok"], ["DS504"])


def test_what_stands_in_the_first_exchange_is_asked_there() -> None:
    for pause, state in ((6, "ok"), (10_000, "unanswered")):
        bus = on_profibus(talk((READ, 40), pause=pause))
        assert bus is not None
        assert told(analyze(io.BytesIO(bus))) == ([state], [])


def test_of_one_direction_nothing_is_said_of_responses() -> None:
    content = talk((IDLE, 20), (READ, 9), (WHOLE, 9), (IDLE, 20))
    assert told(by_name(content)) == (["ok", "ok"], [])
    assert told(by_name(content, ("output",))) == (["superseded", "unanswered"], [])
