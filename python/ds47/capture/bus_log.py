"""Recordings of PROFIBUS that are no capture files: logs as text, and bytes as a serial port gave them.

Lives here: telling them from anything else by content, and giving their frames as those of a capture. Not here:
what a line or a frame is (`ds47.profibus.listing`, `stream`). Reference: docs/profibus.md 1 and 5.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from ds47.profibus import PROFIBUS_DL, listing
from ds47.profibus.stream import TelegramReader, split
from ds47.profibus.telegram import SD1, SD2, SD3, Telegram

from .frame import Frame, Interface, WholeFrame
from .scan import Watch
from .stream import Window

_LOOKED_AT = 1 << 16
"""Bytes at the beginning that have to show what it is,"""
_LINES = 200
"""and lines."""
_PROOFS = 2
"""Frames without a flaw that make bytes a recording; of a text one is enough."""
_LONGEST = 1 << 20
"""Characters of a line; a longer one is read as several."""
_BATCH = 256
_LISTED = 5
"""The most unreadable lines that are listed by number."""
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CONTROL = bytes(set(range(0x20)) - set(b"\t\n\r\f\x1b"))
"""Characters that no text has."""

Entry = tuple[int | None, Telegram]
"""A frame, and its time by the log's own clock, in nanoseconds."""


@dataclass(slots=True)
class _Unread:
    """Lines that could not be read."""

    count: int = 0
    first: list[listing.Unread] = field(default_factory=list)

    def add(self, line: listing.Unread) -> None:
        self.count += 1
        if len(self.first) < _LISTED:
            self.first.append(line)

    def text(self) -> str | None:
        """One line for a person; None where all was read."""
        if not self.count:
            return None
        one, *more = self.first
        text = f"line {one.line} cannot be read: {one.text!r}"
        if self.count > 1:
            numbers = ", ".join(str(each.line) for each in more)
            rest = self.count - len(self.first)
            text += f"; nor can line{'s' * (len(more) > 1)} {numbers}"
            text += f" and {rest} more" if rest else ""
        return text


class BusLogReader:
    """Frames of a recording, in order; as `PcapReader`.

    `timed` says whether the recording has times. A frame without one has that of the frame before it, or 0.
    """

    dropped: int | None = None
    """No such recording says that."""

    def __init__(self, window: Window, encoding: str | None) -> None:
        """`encoding` is that of a text; None for bytes."""
        self._window = window
        self._encoding = encoding
        self._interface = Interface(PROFIBUS_DL, 0)
        self._unread = _Unread()
        self.frames = 0
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self.timed = False
        self.problem: str | None = None

    def read(self) -> Iterator[list[Frame]]:
        """Yield the frames, some at once; sets `problem` where lines cannot be read, or the file fails."""
        frames = self._frames()
        while batch := list(islice(frames, _BATCH)):
            yield batch

    def everything(self, wanted: Callable[[int], bool]) -> Iterator[WholeFrame]:
        """Yield the frames of these numbers as a capture would have them; `problem` as `read`."""
        for frame in self._frames():
            if wanted(frame.number):
                yield WholeFrame(
                    frame.number, frame.time_ns, self._interface, frame.data, len(frame.data)
                )

    def watch(self, watches: Sequence[Watch]) -> None:
        """There are no cyclic frames of PROFINET."""

    def tcp(self, ports: Iterable[int]) -> None:
        """Nor is there TCP."""

    def close(self) -> None:
        """Nothing is held here."""

    def _frames(self) -> Iterator[Frame]:
        now = 0
        for time_ns, item in self._entries():
            if time_ns is not None:
                now, self.timed = time_ns, True
                self.last_ns = time_ns
            if not self.frames:
                self.first_ns = time_ns
            self.frames += 1
            yield Frame(self.frames, now, PROFIBUS_DL, item.data, len(item.data))
        self.problem = self._window.broken or self._unread.text()

    def _entries(self) -> Iterator[Entry]:
        if self._encoding is None:
            yield from self._recorded()
            return
        for each in listing.read(_lines(self._chunks(), self._encoding)):
            if isinstance(each, listing.Unread):
                self._unread.add(each)
            else:
                yield each.time_ns, each.telegram

    def _recorded(self) -> Iterator[Entry]:
        reader = TelegramReader(border=False)
        for chunk in self._chunks():
            for piece in reader.feed(chunk):
                yield None, piece.telegram
        for piece in reader.finish():
            yield None, piece.telegram

    def _chunks(self) -> Iterator[bytes]:
        window = self._window
        while window.end:
            yield bytes(window.view[: window.end])
            window.more(window.end, 1)


def _lines(chunks: Iterable[bytes], encoding: str) -> Iterator[str]:
    """The lines of a text; one that is too long is given in parts."""
    decoder, rest = codecs.getincrementaldecoder(encoding)("replace"), ""
    for chunk in chunks:
        *whole, rest = (rest + decoder.decode(chunk)).split("\n")
        yield from whole
        if len(rest) > _LONGEST:
            yield rest
            rest = ""
    rest += decoder.decode(b"", final=True)
    if rest:
        yield rest


def recognised(window: Window) -> BusLogReader | None:
    """The reader of what stands in a window; None where it is no recording of PROFIBUS.

    Nothing more is read: who feeds a pipe may wait.
    """
    head = bytes(window.view[: min(_LOOKED_AT, window.end)])
    encoding = _text(head)
    if encoding is not None:
        lines = islice(_lines([head], encoding), _LINES)
        found = (each for each in listing.read(lines) if isinstance(each, listing.LogEntry))
        return BusLogReader(window, encoding) if any(map(_proves, _telegrams(found))) else None
    proofs = sum(_proves(piece.telegram) for piece in split(head, border=False))
    return BusLogReader(window, None) if proofs >= _PROOFS else None


def _telegrams(found: Iterable[listing.LogEntry]) -> Iterator[Telegram]:
    return (each.telegram for each in found)


def _proves(item: Telegram) -> bool:
    """Whether a frame has check byte and end byte, and both are right."""
    return item.kind in (SD1, SD2, SD3) and not item.flaws


def _text(head: bytes) -> str | None:
    """The encoding of a text; None for bytes."""
    for mark, encoding in _MARKS:
        if head.startswith(mark):
            return encoding
    if head.translate(None, _CONTROL) != head:
        return None
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"
