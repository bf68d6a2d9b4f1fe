"""Recordings of PROFIBUS that are no capture files: logs as text, and bytes as a serial port gave them.

Lives here: telling them from anything else by content, and giving their frames as those of a capture. Not here:
what a line or a frame is (`ds47.profibus.listing`, `stream`). Reference: docs/profibus.md 1 and 5.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice

from ds47.profibus import PROFIBUS_DL, listing
from ds47.profibus.stream import TelegramReader, split
from ds47.profibus.telegram import Telegram

from . import text
from .frame import Frame, Interface, WholeFrame
from .scan import Watch
from .stream import Window

_PROOFS = 2
"""Frames without a flaw that make bytes a recording; of a text one is enough."""
_BATCH = 256
Entry = tuple[int | None, Telegram]
"""A frame, and its time by the log's own clock, in nanoseconds."""


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
        self._unread = text.UnreadLines()
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
        for each in listing.read(text.lines(text.chunks(self._window), self._encoding)):
            if isinstance(each, listing.Unread):
                self._unread.add(each.line, each.text)
            else:
                yield each.time_ns, each.telegram

    def _recorded(self) -> Iterator[Entry]:
        reader = TelegramReader(border=False)
        for chunk in text.chunks(self._window):
            for piece in reader.feed(chunk):
                yield None, piece.telegram
        for piece in reader.finish():
            yield None, piece.telegram


def recognised(window: Window) -> BusLogReader | None:
    """The reader of what stands in a window; None where it is no recording of PROFIBUS."""
    head = bytes(window.view[: min(text.LOOKED_AT, window.end)])
    encoding = text.encoding(head)
    if encoding is not None:
        lines = text.lines([head], encoding)
        found = (each for each in listing.read(lines) if isinstance(each, listing.LogEntry))
        return (
            BusLogReader(window, encoding) if any(each.telegram.proved for each in found) else None
        )
    proofs = sum(piece.telegram.proved for piece in split(head, border=False))
    return BusLogReader(window, None) if proofs >= _PROOFS else None
