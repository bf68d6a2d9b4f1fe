"""What recordings that are text have in common: their encoding, their lines, and those that could not be read.

Not here: what a line says (bus_log.py, hex_dump.py).
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator
from itertools import chain

from .stream import Window

LOOKED_AT = 1 << 16
"""Bytes at the beginning that have to show what a recording is."""
_LONGEST = 1 << 20
"""Characters of a line; a longer one is read as several."""
_LISTED = 5
"""The most unreadable lines that are listed by number."""
_SHOWN = 80
"""Characters of one that are shown."""
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CONTROL = bytes(set(range(0x20)) - set(b"\t\n\r\f\x1b"))
"""Characters that no text has."""


class UnreadLines:
    """Lines that could not be read."""

    def __init__(self) -> None:
        self.count = 0
        self._first: list[tuple[int, str]] = []

    def add(self, number: int, line: str) -> None:
        """One more, by its number from 1."""
        self.count += 1
        if len(self._first) < _LISTED:
            self._first.append((number, line.strip()[:_SHOWN]))

    def text(self) -> str | None:
        """One line for a person; None where all was read."""
        if not self.count:
            return None
        (number, line), *more = self._first
        text = f"line {number} cannot be read: {line!r}"
        if self.count > 1:
            numbers = ", ".join(str(each) for each, _ in more)
            rest = self.count - len(self._first)
            text += f"; nor can line{'s' * (len(more) > 1)} {numbers}"
            text += f" and {rest} more" if rest else ""
        return text


def encoding(head: bytes) -> str | None:
    """The encoding of a text by its first bytes; None for what is no text."""
    for mark, name in _MARKS:
        if head.startswith(mark):
            return name
    if head.translate(None, _CONTROL) != head:
        return None
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def chunks(window: Window) -> Iterator[bytes]:
    """The bytes of a window from its beginning on, as they come."""
    while window.end:
        yield bytes(window.view[: window.end])
        window.more(window.end, 1)


def batches(pieces: Iterable[bytes], name: str) -> Iterator[list[str]]:
    """The lines of a text in this encoding, as many as each piece makes whole; one that is too long in parts."""
    decoder, rest = codecs.getincrementaldecoder(name)("replace"), ""
    for piece in pieces:
        *whole, rest = (rest + decoder.decode(piece)).split("\n")
        if len(rest) > _LONGEST:
            whole.append(rest)
            rest = ""
        yield whole
    rest += decoder.decode(b"", final=True)
    if rest:
        yield [rest]


def lines(pieces: Iterable[bytes], name: str) -> Iterator[str]:
    """The lines of a text in this encoding."""
    return chain.from_iterable(batches(pieces, name))
