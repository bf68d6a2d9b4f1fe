"""Usual transactions as lines of JSON, without decoding what was decoded before.

A program asks the same parameters again and again, and the answers differ in nothing but the values.
Of the first such pair of messages about which there was nothing to say (decoded and judged with care,
`ds47.analysis`) the shape is kept: every byte that is no value, and for each value block its codec and its
text up to the values. A pair that has the same bytes in these places differs in no other way, because
no rule and no diagnosis looks at the values alone; `Judge.is_plain` says when a rule looks at more than
the pair.

What a line looks like stands in `ds47.report.json`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from json.encoder import encode_basestring as _quoted

from ds47.capture import Frame
from ds47.model import Line, Transaction
from ds47.pairing import Alike, Job, Place, UsualJob
from ds47.profidrive import Block, Options
from ds47.profidrive.formats import Codec
from ds47.profidrive.parameter import sound_codecs
from ds47.profinet.records import NIL_UUID
from ds47.report import json
from ds47.report.json import SECOND_NS, list_text, timestamp
from ds47.rules import Judge
from ds47.transactions import build, uuid_text
from ds47.usual import Lines

_MOST_SHAPES = 4_096
_FRACTION = len("000000000Z")
_HEADER = 4
"""Bytes of a message in front of its addresses or blocks."""


@dataclass(slots=True, eq=False, init=False)
class _Mask:
    """A message of which some bytes are values and all others are always the same.

    `unpack` takes it apart: the reference left out, then bytes that are no value and values in turn.
    """

    unpack: Callable[[bytes], tuple[bytes, ...]]
    fixed: tuple[bytes, ...]

    def __init__(self, data: bytes, blocks: list[Block]) -> None:
        layout, at = "x", 1
        for block in blocks:
            start = block.offset + 2
            layout += f"{start - at}s{len(block.raw)}s"
            at = start + len(block.raw)
        self.unpack = struct.Struct(f"{layout}{len(data) - at}s").unpack
        self.fixed = self.unpack(data)[::2]


@dataclass(slots=True, eq=False, init=False)
class _Values:
    """A value block of a shape, and what was last read from it: many values change seldom."""

    head: str
    """The text up to the values, from those of the block before."""
    after: str
    """What always stands behind them."""
    count: int
    codec: Codec
    write: Callable[[bytes], str] | None
    """The short way to the text of the values."""
    raw: bytes
    text: str

    def __init__(self, head: str, block: Block, codec: Codec) -> None:
        self.head = f'{head}, "values": ['
        self.after = '], "scaled": null, "error": null}'
        if codec.scale is not None:
            self.after = ', "error": null}'
        self.count = block.value_count
        self.codec = codec
        self.write = codec.text(self.count) if codec.text is not None and self.count else None
        self.raw = b""
        self.text = ""

    def read(self, raw: bytes) -> str:
        """The text of these values, and of what they are scaled."""
        if raw == self.raw and self.text:
            return self.text
        write = self.write
        shown = write(raw) if write is not None else "'"
        if "'" in shown:  # no short way, or words: a value that is not finite
            codec = self.codec
            values = codec.decode(raw, self.count)
            shown = list_text(values)[1:-1]
            if codec.scale is not None:
                shown = f'{shown}], "scaled": {list_text(codec.scale(values, raw))}'
        self.raw, self.text = raw, shown
        return shown


@dataclass(slots=True, eq=False, init=False)
class _Shape:
    """A usual question with its usual answer, which has the values, and how to write them."""

    alike: Alike
    values: _Mask
    question: bytes
    """Without its reference."""
    blocks: list[_Values]
    end: str
    """Of the text, behind the last values."""
    reads: frozenset[int]

    def __init__(
        self,
        values: _Mask,
        question: bytes,
        blocks: list[_Values],
        pnus: tuple[int, ...],
    ) -> None:
        self.alike = Alike(pnus)
        self.values = values
        self.question = question
        self.blocks = blocks
        self.end = f"{blocks[-1].after}]"
        self.reads = frozenset(pnus)


class JsonLines(Lines):
    """Lines of `ds47.report.json`; `codec` are the dialects of the analysis."""

    def __init__(self, codec: Options) -> None:
        self._codecs = sound_codecs(codec.legacy_g120_formats, codec.profile_v3_types)
        self._shapes: dict[tuple[bytes, int, int, int | None], _Shape] = {}
        self._second_ns = 0
        self._second = ""
        """The second of the last line, in text up to the decimal point."""

    def answered(
        self, job: UsualJob, read: Frame, frame: Frame, answer: bytes, judge: Judge
    ) -> bool:
        data, accepted = job.data, job.accepted
        shape = self._shapes.get(_key(job, answer))
        if shape is None or accepted is None:
            return False
        parts = shape.values.unpack(answer)
        if data[1:] != shape.question or parts[::2] != shape.values.fixed:
            return False
        if not judge.is_plain(job, accepted, read, frame, shape.reads):
            return False
        texts: list[str] = []
        at = 1
        for each in shape.blocks:
            texts.append(each.head)
            texts.append(each.read(parts[at]))
            at += 2
        texts.append(shape.end)
        job.alike = shape.alike
        job.texts = texts
        return True

    def learn(self, usual: UsualJob, job: Job, lang: str) -> None:
        request, response, half = job.message, job.response, job.read_response
        if request is None or response is None or half is None:
            return
        transaction = build(job, lang)
        found = response.blocks
        if transaction.state != "ok" or transaction.operation != "read" or not found:
            return
        blocks: list[_Values] = []
        for block, about in zip(found, transaction.parameters, strict=True):
            sound = self._codecs[block.format]
            if sound is None:
                return
            before = f"{blocks[-1].after}, " if blocks else ""
            blocks.append(_Values(before + json.parameter_head(about), block, sound[1]))
        if len(self._shapes) >= _MOST_SHAPES:
            self._shapes.clear()
        pnus = tuple([each.pnu for each in request.addresses])
        shape = _Shape(_Mask(half.data, found), usual.data[1:], blocks, pnus)
        self._shapes[_key(usual, half.data)] = shape

    def usual(self, job: UsualJob) -> Line:
        asked, accepted, read, answered = job.asked, job.accepted, job.read, job.answered
        assert job.alike is not None
        assert accepted is not None
        assert read is not None
        assert answered is not None
        place = job.place
        head = place.head
        if head is None:
            head = place.head = _head(place)
        return Line(
            asked.number,
            0,
            head,
            f'{job.data[0]}, "axis": {job.data[2]}, '
            f'"frames": {{"write_request": {asked.number}, '
            f'"write_response": {accepted.number}, "read_request": {read.number}, '
            f'"read_response": {answered.number}, "polls": [], "rereads": []}}, '
            f'"start": "{self._start(asked.time_ns)}", '
            f'"duration_ms": {(answered.time_ns - asked.time_ns) / 1_000_000}, '
            f'"bytes": {{"request": "{job.data.hex()}", "response": "{job.answer.hex()}"}}, '
            '"status": {"write": "00000000", "read": "00000000"}, '
            '"parameters": [',
            job.texts,
        )

    def _start(self, time_ns: int) -> str:
        """`timestamp`, most often in the same second as the last time."""
        since = time_ns - self._second_ns
        if not 0 <= since < SECOND_NS or not self._second:
            since = time_ns % SECOND_NS
            self._second_ns = time_ns - since
            self._second = timestamp(time_ns)[:-_FRACTION]
        return f"{self._second}{str(since + SECOND_NS)[1:]}Z"

    def line(self, transaction: Transaction) -> Line:
        first = transaction.frames.first()
        return Line(first, transaction.position, "", json.transaction_text(transaction), [])


def _key(job: UsualJob, answer: bytes) -> tuple[bytes, int, int, int | None]:
    """What tells the shapes apart: the question without values, the lengths, and whose error numbers apply."""
    data = job.data
    question = data[1 : _HEADER + 6 * data[3]] if len(data) > _HEADER else data
    return question, len(data), len(answer), job.place.peer.vendor_id


def _head(place: Place) -> str:
    """What a line says up to the request reference."""
    peer = place.peer
    ar = "null" if place.ar == NIL_UUID else f'"{uuid_text(place.ar)}"'
    return (
        '"operation": "read", "state": "ok", '
        f'"controller": {_quoted(peer.controller)}, "device": {_quoted(peer.device)}, "ar": {ar}, '
        f'"api": {place.api}, "slot": {place.slot}, "subslot": {place.subslot}, '
        f'"index": {place.index}, "request_reference": '
    )
