"""The bytes of a channel in cyclic frames, frame by frame: of PROFINET, or of data exchange on PROFIBUS."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from tests.audit import dp
from tests.audit.reading import Finding, Reading

TICKS, COUNTERS = 32, 0x1_0000
"""Of the cycle counter, in a millisecond and in all."""


DISORDER_NS = 1_000_000_000
"""By more than this nobody disorders frames: the clock was set."""


class Part(NamedTuple):
    """What one side says in a frame; `good` where the states beside it say that it is valid."""

    frame: int
    time_ns: int
    data: bytes
    good: bool


def parts(reading: Reading, relation: dict[str, Any], side: str) -> Iterator[Part]:
    """Everything that a side of a relation says in a capture, also before the relation was set up."""
    way, other = relation[side], relation["input" if side == "output" else "output"]
    if reading.line is not None:
        yield from _exchanged(reading.line, relation, side)
        return
    gone = set(late(reading))  # what they say is no news
    for each in reading.capture.rt:
        if each.frame.number in gone:
            continue
        if each.is_of(way["mac"], other["mac"], way["frame_id"]) and not each.frame.cut:
            end = way["offset"] + way["length"]
            good = bool(each.data[end] & 0x80 and each.data[-2] & 0x04)
            data = each.data[way["offset"] : end]
            yield Part(each.frame.number, each.frame.time_ns, data, good)


def _exchanged(line: dp.Line, relation: dict[str, Any], side: str) -> Iterator[Part]:
    """Data exchange has no states: data of the right length is valid, and no other counts."""
    way = relation[side]
    for turn in dp.exchanges(line, relation["controller"], relation["device"]):
        heard = turn.asked if side == "output" else turn.answer
        if heard is None or len(heard.du) < way["offset"] + way["length"]:
            continue
        data = heard.du[way["offset"] : way["offset"] + way["length"]]
        yield Part(heard.number, heard.time_ns, data, True)


def late(reading: Reading) -> list[int]:
    """Cyclic frames whose times lie shortly before that of an earlier one of the same sender, id and receiver."""
    newest: dict[tuple[str, str, int], int] = {}
    found = []
    for each in reading.capture.rt:
        key, time_ns = (each.sender, each.receiver, each.frame_id), each.frame.time_ns
        if 0 < newest.get(key, 0) - time_ns < DISORDER_NS:
            found.append(each.frame.number)
        else:
            newest[key] = time_ns
    return found


def of_mixed(finding: Finding, reading: Reading) -> Iterator[str]:
    """DS515: up to this frame counters of its sender and frame id go back, or on by less than half a cycle."""
    args = finding.args
    key = args["sender"], args["frame_id"]
    sides = [
        each for each in reading.plain.get("relations", ()) for side in ("output", "input")
        if each["device"] == args["device"] and (each[side]["mac"], each[side]["frame_id"]) == key
    ]  # fmt: skip
    there = [
        each for each in reading.capture.rt
        if each.frame.number <= finding.frame and (each.sender, each.frame_id) == key
    ]  # fmt: skip
    if not sides or not there or there[-1].frame.number != finding.frame:
        yield "no relation of this device has such frames"
        return
    counters = [
        int.from_bytes(each.data[-4:-2]) for each in there if each.receiver == there[-1].receiver
    ]
    steps = [(after - before) % COUNTERS for before, after in pairwise(counters[-20:])]
    least = sides[0]["cycle_ms"] * TICKS / 2
    if sum(step < least or step > COUNTERS / 2 for step in steps) < 2:
        yield "the counters go on by a cycle each"


def _moments(reading: Reading, relation: dict[str, Any]) -> Iterator[tuple[int, int]]:
    """Frame and time of everything that both sides say, data exchange without data, too."""
    if reading.line is None:
        for side in ("output", "input"):
            yield from (part[:2] for part in parts(reading, relation, side))
        return
    for turn in dp.exchanges(reading.line, relation["controller"], relation["device"]):
        yield from ((each.number, each.time_ns) for each in (turn.asked, turn.answer) if each)


def pauses(reading: Reading, pair: tuple[str, str]) -> list[tuple[int, int]]:
    """The frames between which nothing of a controller and a drive came for longer than a cycle and a half.

    Where no Connect tells the cycle, for longer than three times what most take.
    """
    found = set[tuple[int, int]]()
    for relation in reading.plain["relations"]:
        if (relation["controller"], relation["device"]) != pair:
            continue
        there = sorted(_moments(reading, relation))
        gaps = [two[1] - one[1] for one, two in pairwise(there)]
        usual = (
            (relation["cycle_ms"] or 0) * 1.5e6 or 3 * sorted(gaps)[len(gaps) // 2] if gaps else 0
        )
        found |= {(one[0], two[0]) for one, two in pairwise(there) if two[1] - one[1] > usual}
    return sorted(found)
