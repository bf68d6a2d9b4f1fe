"""The bytes of a channel in cyclic frames, frame by frame: of PROFINET, or of data exchange on PROFIBUS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from tests.audit import dp
from tests.audit.reading import Reading

TYPE = b"\x88\x92"


class Part(NamedTuple):
    """What one side says in a frame; `good` where the states beside it say that it is valid."""

    frame: int
    time_ns: int
    data: bytes
    good: bool


def parts(reading: Reading, relation: dict[str, Any], side: str) -> Iterator[Part]:
    """Everything that a side of a relation says in a capture, also before the relation was set up."""
    way = relation[side]
    if reading.line is not None:
        yield from _exchanged(reading.line, relation, side)
        return
    for frame in reading.capture.frames:
        at = 12 if frame.data[12:14] == TYPE else 16
        head = TYPE + way["frame_id"].to_bytes(2)
        if frame.data[6:12].hex(":") == way["mac"] and frame.data[at : at + 4] == head:
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
