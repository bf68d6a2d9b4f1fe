"""The bytes of a channel in cyclic frames, frame by frame: of PROFINET, or of data exchange on PROFIBUS."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from tests.audit import dp
from tests.audit.reading import Finding, Reading

TYPE = b"\x88\x92"
TICKS, COUNTERS = 32, 0x1_0000
"""Of the cycle counter, in a millisecond and in all."""


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
    for frame in reading.capture.frames:
        at = 12 if frame.data[12:14] == TYPE else 16
        head = TYPE + way["frame_id"].to_bytes(2)
        macs = frame.data[:6].hex(":"), frame.data[6:12].hex(":")
        if macs == (other["mac"], way["mac"]) and frame.data[at : at + 4] == head:
            start = at + 4 + way["offset"]
            end = start + way["length"]
            good = bool(frame.data[end] & 0x80)
            if relation["channel"] == "pzd":
                good = good and bool(frame.data[-2] & 0x04)
            yield Part(frame.number, frame.time_ns, frame.data[start:end], good)


def _exchanged(line: dp.Line, relation: dict[str, Any], side: str) -> Iterator[Part]:
    """Data exchange has no states: data of the right length is valid, and no other counts."""
    way = relation[side]
    for turn in dp.exchanges(line, relation["controller"], relation["device"]):
        heard = turn.asked if side == "output" else turn.answer
        if heard is None or len(heard.du) < way["offset"] + way["length"]:
            continue
        data = heard.du[way["offset"] : way["offset"] + way["length"]]
        yield Part(heard.number, heard.time_ns, data, True)


def of_mixed(finding: Finding, reading: Reading) -> Iterator[str]:
    """DS515: up to this frame counters of its sender and frame id go back, or on by less than half a cycle."""
    args, newest = finding.args, reading.capture.frames[finding.frame - 1].data
    sides = [
        (each, each[side]) for each in reading.plain.get("relations", ()) for side in ("output", "input")
        if each["device"] == args["device"]
        and (each[side]["mac"], each[side]["frame_id"]) == (args["sender"], args["frame_id"])
    ]  # fmt: skip
    at = 12 if newest[12:14] == TYPE else 16
    head = bytes.fromhex(args["sender"].replace(":", "")), TYPE + args["frame_id"].to_bytes(2)
    if not sides or (newest[6:12], newest[at : at + 4]) != head:
        yield "no relation of this device has such frames"
        return
    counters = [
        int.from_bytes(each.data[-4:-2]) for each in reading.capture.frames[: finding.frame]
        if (each.data[:12], each.data[at : at + 4]) == (newest[:12], newest[at : at + 4])
    ]  # fmt: skip
    steps = [(after - before) % COUNTERS for before, after in pairwise(counters[-20:])]
    least = sides[0][0]["cycle_ms"] * TICKS / 2
    if sum(step < least or step > COUNTERS / 2 for step in steps) < 2:
        yield "the counters go on by a cycle each"
