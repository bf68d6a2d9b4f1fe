"""Findings about S7 at their limits, in captures made by hand: just within, and just beyond.

What is kept has its limits in frames here, too: so many partners, so many areas in parts.
"""

from __future__ import annotations

import io
from collections.abc import Callable

import pytest
import s7_segments as s7
from s7_talk import DONE, Talk, Tape

from ds47.analysis import analyze
from ds47.capture.writer import PcapngWriter
from ds47.model import Finding
from ds47.spec.semantics import limits

PDU = 240
READ, WRITE = PDU - 18, PDU - 28
"""Bytes that a read and a write of one item have room for."""
REST = 20
RECENT = 8
"""Areas read in parts that are remembered of one memory."""


def usend(size: int, lacks: int = 0) -> bytes:
    """A USEND of one area, at the end of which so many bytes are missing."""
    content = b"\xff\x09\0\1" + s7.entry(bytes(size), 0)
    content = content[: len(content) - lacks]
    return s7.header(7, 0, b"\0\1\x12\6\x13\0\0\0\0\1", content)


def taped(play: Callable[[Tape], None]) -> bytes:
    """The capture of what is said, a frame each millisecond."""
    tape, target = Tape(), io.BytesIO()
    play(tape)
    with PcapngWriter(target, link_type=1) as writer:
        for time_ns, data in tape.shots:
            writer.write(time_ns, data)
    return target.getvalue()


def same_bytes(tape: Tape) -> None:
    """Two stations write areas that overlap, and the bytes that both write are alike."""
    one, two = (Talk(tape, station).open() for station in (1, 2))
    one.put(1, 0, b"\1\2\3\4")
    two.put(1, 2, b"\3\4\5\6")
    one.put(3, 5, b"\1\2\3")
    two.put(3, 6, b"\2\3")


def other_bytes(tape: Tape) -> None:
    """The second of them is not."""
    one, two = (Talk(tape, station).open() for station in (1, 2))
    one.put(2, 4, b"\1\2\3\4")
    two.put(2, 5, b"\2\7\4")


def never_last(tape: Tape) -> None:
    """All bytes of a BSEND are there, and its last segment does not say that it is the last."""
    talk = Talk(tape).open()
    talk.tpkt(True, b"\2\xf0\x80" + s7.bsend(7, 9, bytes(20), last=False))
    talk.tpkt(False, b"\2\xf0\x80" + s7.received(7, 5))
    talk.close()


def closed_beside(tape: Tape) -> None:
    """A connection ends, and another one keeps what it knows: the areas of a USEND change."""
    one, two = (Talk(tape, station).open() for station in (1, 2))
    for talk, size in ((one, 10), (two, 10), (two, 12)):
        if size == 12:
            one.close()
        talk.tpkt(True, b"\2\xf0\x80" + usend(size))


def cut_areas(tape: Tape) -> None:
    """The second USEND lacks its end: how long its area was meant to be is said, and not how long it is."""
    talk = Talk(tape).open()
    for size, lacks in ((10, 0), (12, 3), (10, 0)):
        talk.tpkt(True, b"\2\xf0\x80" + usend(size, lacks))


def read_between(count: int) -> Callable[[Tape], None]:
    """An area is written in parts, and so many times read in parts between them, with the same border.

    The first of these reads shows a moment between; the others find what the one before found. The last one is
    known to be over only behind the write.
    """

    def play(tape: Tape) -> None:
        writer, reader = (Talk(tape, station).open(pdu=PDU) for station in (1, 2))
        for value in (b"\1", b"\2"):
            writer.put(1, READ - WRITE, value * WRITE)
            for _ in range(count if value == b"\2" else 0):
                front = b"\0" * (READ - WRITE) + value * WRITE
                reader.get(1, 0, front).get(1, READ, b"\1" * REST)
            writer.put(1, READ, value * REST)
        writer.close()
        reader.close()

    return play


def partners(others: int) -> bytes:
    """A station writes to a server, sends something to so many others, and another station writes other values."""
    frames = []
    for number in range(others + 2):
        between = 0 < number <= others
        server = f"10.1.{number >> 8}.{number & 255}" if between else "10.0.0.2"
        talk = s7.Talk((f"10.0.0.{202 if number > others else 201}", 1024 + number), (server, 102))
        write = s7.put(1, s7.item(1, 0, 1), bytes((number > others,)))
        told = (usend(1), None) if between else (write, s7.taken(1, DONE))
        frames += talk.opened().ask(*told).frames()
    return frames_at_once(frames)


def writers_apart(after_ns: int) -> bytes:
    """A station writes, and so long after that was taken another one writes other values."""
    write = (s7.put(1, s7.item(1, 0, 1), bytes((value,))) for value in (1, 2))
    talks = [s7.Talk((f"10.0.0.{200 + n}", 1024 + n), ("10.0.0.2", 102)) for n in (1, 2)]
    one, two = (
        talk.opened().ask(each, s7.taken(1, DONE)).frames()
        for talk, each in zip(talks, write, strict=True)
    )
    second = 1_767_254_400_000_000_000 + after_ns  # its request is the last frame but one
    target = io.BytesIO()
    with PcapngWriter(target, link_type=1) as writer:
        for back, data in zip(range(len(one) - 1, -1, -1), one, strict=True):
            writer.write(second - after_ns - 1000 * back, data)
        for back, data in zip(range(len(two) - 2, -2, -1), two, strict=True):
            writer.write(second - 1000 * back, data)
    return target.getvalue()


def frames_at_once(frames: list[bytes]) -> bytes:
    """The frames as one capture, a tenth of a millisecond apart: it is only their order that matters."""
    target = io.BytesIO()
    with PcapngWriter(target, link_type=1) as writer:
        for number, data in enumerate(frames):
            writer.write(1_767_254_400_000_000_000 + 100_000 * number, data)
    return target.getvalue()


MOST, APART = limits().s7_memories, limits().s7_writers_ns
SCENES: dict[str, tuple[bytes, list[str]]] = {
    "the same bytes": (taped(same_bytes), []),
    "other bytes": (taped(other_bytes), ["DS907"]),
    "never the last segment": (taped(never_last), ["DS910"]),
    "areas without their end": (taped(cut_areas), []),
    "closed beside": (taped(closed_beside), ["DS913"]),
    "as many reads as are remembered": (taped(read_between(RECENT)), ["DS904", "DS904", "DS905"]),
    "one read more": (taped(read_between(RECENT + 1)), ["DS904", "DS904"]),
    "as many partners as are kept": (partners(MOST - 1), ["DS907"]),
    "one partner more": (partners(MOST), []),
    "another writer within the time": (writers_apart(APART), ["DS907"]),
    "another writer behind it": (writers_apart(APART + 1), []),
}


def findings(name: str) -> list[Finding]:
    found = analyze(io.BytesIO(SCENES[name][0])).findings
    return sorted(found, key=lambda each: each.rule)


@pytest.mark.parametrize("name", SCENES)
def test_just_within_and_just_beyond(name: str) -> None:
    assert [each.rule for each in findings(name)] == SCENES[name][1]


def test_the_byte_in_which_two_writers_differ_is_named() -> None:
    (found,) = findings("other bytes")
    assert found.args["byte"] == "DB2.DBB6"


def test_what_was_not_said_to_be_the_last_segment_is_open() -> None:
    (found,) = findings("never the last segment")
    assert (found.args["case"], found.args["size"], found.args["total"]) == ("bsend_open", 20, 20)


def test_the_first_read_between_the_parts_of_a_write_is_the_one_that_mixes() -> None:
    """It is the oldest one, so that it is the first that is forgotten."""
    *splits, mixed = findings("as many reads as are remembered")
    (reads,) = [each for each in splits if each.args["operation"] == "GET"]
    assert mixed.args["frames"][2:6] == reads.frames[:4]
