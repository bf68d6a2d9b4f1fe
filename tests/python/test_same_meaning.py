"""Stored captures say the same whatever is around their frames, however TCP is cut, and if it is sent again.

Wrapped are all captures of Ethernet, in the ways of test_cyclic_wrapped.py; of S7 the segments are changed, too.
"""

from __future__ import annotations

import io
import random
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from test_cyclic_wrapped import WAYS, wrapped

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Frame, open_capture
from ds47.capture.scan import ETHERNET
from ds47.capture.writer import PcapngWriter

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
RECORDS = sorted(
    path for path in CAPTURES.glob("*.pcapng") if not path.name.startswith(("s7-", "profibus-"))
)
SEGMENTS = sorted([*CAPTURES.glob("s7-*.pcapng"), *(CAPTURES / "s7-stacks").glob("*.pcapng")])
DROPPED = "diagnosis-half-captured-dropped"
"""What the recorder lost stands beside the frames of this one."""
OPTIONS = AnalysisOptions(channels=("ds47", "pkw", "pzd", "s7"))
IP, SYN_FIN_RST = 14, 7


def frames_of(path: Path) -> list[Frame]:
    with open_capture(path) as capture:
        return list(capture.everything())


def told(source: bytes | Path) -> dict[str, Any]:
    """What must not change: all but numbers of frames and what they are cut into."""
    result = analyze(io.BytesIO(source) if isinstance(source, bytes) else source, OPTIONS)
    return {
        "transactions": [
            (
                each.channel, each.operation, each.state, each.request, each.response, each.duration_ns,
                each.items, [(item.pnu, item.values) for item in each.parameters],
            )
            for each in result.transactions
        ],
        "findings": sorted((each.rule, each.transaction or 0) for each in result.findings),
        "events": [(each.name, each.time_ns) for line in result.timelines for each in line.events],
        "relations": [(each.device, each.channel, each.certainty) for each in result.relations],
    }  # fmt: skip


def plain(frame: Frame) -> bool:
    """Whether it is whole, of Ethernet and no fragment: others would not say the same in other parts."""
    fragment = frame.data[12:14] == b"\x08\x00" and int.from_bytes(frame.data[20:22]) & 0x3FFF
    whole = frame.original_length == len(frame.data)
    return whole and frame.link_type == ETHERNET and not fragment


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_what_is_around_the_frames(way: str) -> None:
    paths = [path for path in RECORDS if path.stem != DROPPED and all(map(plain, frames_of(path)))]
    assert len(paths) > 150
    differs = [path.stem for path in paths if told(wrapped(path.read_bytes(), way)) != told(path)]
    assert differs == []


# Segments of TCP

Change = Callable[[bytes, random.Random], Iterator[bytes]]


def parts(data: bytes) -> tuple[bytearray, bytes] | None:
    """The headers and the payload of a segment with one; None for all other frames."""
    if data[12:14] != b"\x08\x00" or data[23] != 6:
        return None
    tcp = IP + 4 * (data[IP] & 15)
    begin, end = tcp + (data[tcp + 12] >> 4) * 4, IP + int.from_bytes(data[IP + 2 : IP + 4])
    return (bytearray(data[:begin]), data[begin:end]) if end > begin else None


def moved(head: bytearray, by: int, length: int) -> bytes:
    """Headers of a part that begins so many bytes behind."""
    found, tcp = bytearray(head), IP + 4 * (head[IP] & 15)
    (sequence,) = struct.unpack_from(">I", head, tcp + 4)
    struct.pack_into(">I", found, tcp + 4, (sequence + by) & 0xFFFFFFFF)
    struct.pack_into(">H", found, IP + 2, len(head) - IP + length)
    return bytes(found)


def cut(data: bytes, chance: random.Random) -> Iterator[bytes]:
    """The same bytes in some segments, many of them short; not in so many that no window would hold them."""
    found = parts(data)
    if found is None:
        yield data
        return
    head, body = found
    at = 0
    while at < len(body):
        many = max(chance.choice((1, 3, 7, 40)), len(body) // 20)
        part = body[at : at + many]
        yield moved(head, at, len(part)) + part
        at += many


def sent_again(data: bytes, chance: random.Random) -> Iterator[bytes]:
    """Each segment with data twice, the second time cut off in front or behind."""
    yield data
    found = parts(data)
    if found is not None:
        head, body = found
        first, last = sorted((chance.randrange(len(body) + 1), chance.randrange(len(body) + 1)))
        yield moved(head, first, last - first) + body[first:last]


def cut_and_sent_again(data: bytes, chance: random.Random) -> Iterator[bytes]:
    for each in cut(data, chance):
        yield from sent_again(each, chance)


def out_of_order(data: bytes, chance: random.Random) -> Iterator[bytes]:
    """The parts of a segment in another order."""
    found = list(cut(data, chance))
    chance.shuffle(found)
    yield from found


def wrapping(data: bytes, chance: random.Random) -> Iterator[bytes]:
    """Sequence numbers that pass 2^32 within the first bytes of each direction, whichever they began with."""
    if data[12:14] != b"\x08\x00" or data[23] != 6:
        yield data
        return
    tcp = IP + 4 * (data[IP] & 15)
    source, target, sequence, answered = struct.unpack_from(">HHII", data, tcp)
    own, other = (_FIRST.get(key, 0) for key in ((source, target), (target, source)))
    found = bytearray(data)
    shift = 0xFFFFFFF0
    struct.pack_into(">I", found, tcp + 4, (sequence - own + shift) & 0xFFFFFFFF)
    if data[tcp + 13] & 16:
        struct.pack_into(">I", found, tcp + 8, (answered - other + shift) & 0xFFFFFFFF)
    yield bytes(found)


_FIRST: dict[tuple[int, int], int] = {}
"""Ports -> the first sequence number between them, in the capture that is changed."""


def changed(path: Path, change: Change) -> bytes:
    chance, target, frames = random.Random(path.name), io.BytesIO(), frames_of(path)
    _FIRST.clear()
    for frame in frames:
        if frame.data[12:14] == b"\x08\x00" and frame.data[23] == 6:
            tcp = IP + 4 * (frame.data[IP] & 15)
            source, goal, sequence = struct.unpack_from(">HHI", frame.data, tcp)
            _FIRST.setdefault((source, goal), sequence)
    with PcapngWriter(target, ETHERNET) as writer:
        for frame in frames:
            whole = frame.original_length == len(frame.data)
            for data in change(frame.data, chance) if whole else (frame.data,):
                writer.write(
                    frame.time_ns, data, max(len(data), 0 if whole else frame.original_length)
                )
    return target.getvalue()


CHANGES = (cut, sent_again, cut_and_sent_again, out_of_order, wrapping)


def test_a_part_that_is_lost_is_noticed() -> None:
    def lossy(data: bytes, chance: random.Random) -> Iterator[bytes]:
        found = list(cut(data, chance))
        yield from found[:-1] if len(found) > 2 else found

    path = CAPTURES / "s7-figure-1.pcapng"
    assert told(changed(path, lossy)) != told(path)


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: change.__name__)
def test_how_segments_are_cut_and_sent(change: Change) -> None:
    assert len(SEGMENTS) > 20
    differs = [path.stem for path in SEGMENTS if told(changed(path, change)) != told(path)]
    assert differs == []
