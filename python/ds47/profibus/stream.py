"""Frames among bytes that have no borders: a serial dump, a line with several frames (docs/profibus.md 1).

A frame counts where check byte and end byte prove it. Tokens and SC prove nothing: they count behind a frame, or
where nothing but such ones stands between them and one. A wrong byte costs the frame that it is in. Times, and
what a frame says, are not here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ds47.profibus.telegram import (
    END,
    SC,
    SD1,
    SD2,
    SD3,
    SD4,
    START,
    Telegram,
    check_byte,
    decode,
    size,
)
from ds47.spec import profibus
from ds47.spec.words import Flaw

_AHEAD = 1024
"""Bytes behind a frame that may decide what it is; all that is looked at from one place is shorter."""
_CHAIN = 256
"""Bytes of tokens and SC in a row that are as good as a proved frame: a line has them for long when it is idle."""
_MOST_LOST = 4096
"""The most bytes without a frame in one piece."""
_KNOWN_TOKENS = 1024


@dataclass(frozen=True, slots=True)
class LinePiece:
    """A frame, or bytes that are none: then `telegram` has flaws. `offset` counts from the first byte of all."""

    offset: int
    telegram: Telegram


class TelegramReader:
    """Takes bytes as they come, and gives their frames.

    `border`: whether a frame begins with the first byte; a recording that someone started does not know.
    """

    def __init__(self, border: bool = True) -> None:
        self._buffer = b""
        self._start = 0
        self._border = border
        self._lost = b""
        self._tokens: set[bytes] = set()
        self._blind: set[int] = set()
        """Offsets of tokens and SC that were followed and lead to no frame."""

    def feed(self, data: bytes) -> Iterator[LinePiece]:
        """The frames that further bytes make certain, in their order."""
        self._buffer += data
        yield from self._pieces(_AHEAD)

    def finish(self) -> Iterator[LinePiece]:
        """The rest: nothing comes any more."""
        yield from self._pieces(0)
        yield from self._give_up(self._start)

    def _pieces(self, ahead: int) -> Iterator[LinePiece]:
        data, at = self._buffer, 0
        while at < len(data) - ahead:
            length = self._length(data, at)
            if not length:
                self._lost += data[at : at + 1]
                at, self._border = at + 1, False
                if len(self._lost) >= _MOST_LOST:
                    yield from self._give_up(self._start + at)
                continue
            yield from self._give_up(self._start + at)
            item = decode(data[at : at + length])
            if item.kind == SD4 and not item.flaws and len(self._tokens) < _KNOWN_TOKENS:
                self._tokens.add(item.data[1:])
            yield LinePiece(self._start + at, item)
            at, self._border = at + length, True
        self._buffer, self._start = data[at:], self._start + at

    def _give_up(self, end: int) -> Iterator[LinePiece]:
        """What stood before `end` and is no frame."""
        if self._lost:
            data, self._lost = self._lost, b""
            self._blind.clear()
            item = decode(data)
            if not item.flaws:
                unproved = (Flaw("unproved", 0),)
                item = Telegram(item.front, item.data, item.du, item.fcs, unproved)
            yield LinePiece(end - len(data), item)

    def _length(self, data: bytes, at: int) -> int:
        """The bytes of the frame that begins here, damaged or not; 0 for none."""
        if whole := _proved(data, at):
            return whole
        if not self._border:
            return _unproved(data, at) if self._leads_to_a_frame(data, at) else 0
        return self._other_start(data, at) or self._bare(data, at) or _damaged(data, at)

    def _leads_to_a_frame(self, data: bytes, at: int) -> bool:
        """Whether tokens and SC alone stand between here and a proved frame, the end, or _CHAIN bytes of them."""
        end, passed = min(len(data), at + _CHAIN), set[int]()
        while at < end and not _proved(data, at):
            length = _unproved(data, at)
            if not length or self._start + at in self._blind:
                self._blind |= passed
                return False
            passed.add(self._start + at)
            at += length
        return True

    def _bare(self, data: bytes, at: int) -> int:
        """A token or SC that stands at a border; not where a proved frame begins inside it."""
        length = _unproved(data, at)
        return 0 if any(_proved(data, at + step) for step in range(1, length)) else length

    def _other_start(self, data: bytes, at: int) -> int:
        """A frame with a wrong start byte: the right one makes all of it valid."""
        if _begins(data, at + (_unproved(data, at) or 1)) and data[at] in _starts():
            return 0
        for kind in (SD2, SD1, SD3):
            if whole := _proved(data, at, kind):
                return whole
        token = data[at + 1 : at + 3]
        known = token in self._tokens and data[at] != _code(SD4)
        return 3 if known and _begins(data, at + 3) and not _proved(data, at + 1) else 0


def split(data: bytes, border: bool = True) -> list[LinePiece]:
    """The frames of bytes that are all there, and what stands between them (docs/profibus.md 1).

    Args:
        data: any bytes.
        border: whether a frame begins with the first one.
    """
    reader = TelegramReader(border)
    return [*reader.feed(data), *reader.finish()]


def _starts() -> frozenset[int]:
    return frozenset(profibus.codes("start"))


def _code(kind: str) -> int:
    return next(row.code for row in profibus.codes("start").values() if row.id == kind)


def _begins(data: bytes, at: int) -> bool:
    """Whether a frame may begin here; the end of all bytes is as good."""
    return at >= len(data) or data[at] in _starts()


def _proved(data: bytes, at: int, kind: str | None = None) -> int:
    """The bytes of the frame that begins here, where check byte and end byte are right; else 0.

    Args:
        data: all bytes.
        at: where the frame begins.
        kind: what to take its first byte for; None takes it as it is.
    """
    first = data[at : at + 1] if kind is None else bytes((_code(kind),))
    head = first + data[at + 1 : at + 4]
    whole = size(head)
    if whole is None or head[0] in (_code(SD4), _code(SC)) or at + whole > len(data):
        return 0
    content = data[at + (4 if head[0] == START else 1) : at + whole - 2]
    right = data[at + whole - 2] == check_byte(content) and data[at + whole - 1] == END
    return whole if right else 0


def _unproved(data: bytes, at: int) -> int:
    """The bytes of a token or SC that begins here; else 0."""
    whole = size(data[at : at + 1]) if data[at : at + 1] != b"\x68" else None
    bare = whole is not None and data[at] in (_code(SD4), _code(SC))
    return whole if bare and whole is not None and at + whole <= len(data) else 0


def _damaged(data: bytes, at: int) -> int:
    """The certain length of a frame with a wrong byte; 0 if it is not certain.

    One of check byte and end byte is right, or with one of two length bytes that differ both are.
    """
    head = data[at : at + 4]
    whole = size(head)
    if whole is None:
        return _by_one_length(data, at)
    if at + whole > len(data) or _unproved(data, at):
        return 0
    content = data[at + (4 if head[0] == START else 1) : at + whole - 2]
    summed = data[at + whole - 2] == check_byte(content)
    ended = data[at + whole - 1] == END
    return whole if (summed or ended) and not _crossed(data, at, whole) else 0


def _by_one_length(data: bytes, at: int) -> int:
    if data[at] != START or len(data) < at + 4:
        return 0
    for length in dict.fromkeys(data[at + 1 : at + 3]):
        content = data[at + 4 : at + 4 + length]
        trailer = bytes((check_byte(content), END))
        if length >= profibus.lengths()[0] and data[at + 4 + length :][:2] == trailer:
            return length + 6
    return 0


def _crossed(data: bytes, at: int, whole: int) -> bool:
    """Whether a proved frame begins inside these bytes and ends behind them."""
    return any(step + _proved(data, at + step) > whole for step in range(1, whole))
