"""Opening a capture of any supported kind.

Lives here: `open_capture` and `Capture`, which choose the format by content. Not here: the formats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from . import pcap, pcapng
from .closing import Closing
from .errors import CaptureError
from .frame import Frame, WholeFrame
from .scan import Watch
from .stream import Stream, Window

if TYPE_CHECKING:
    from .bus_log import BusLogReader
    from .hex_dump import HexDumpReader


_SHORT = 1 << 20
"""Bytes of a capture that is searched as a whole."""


class Capture(Closing):
    """An opened capture: a context manager, and an iterable of the frames that may matter.

    * `path`: as given, or "-" for stdin.
    * `frames`: frames passed so far, the irrelevant ones included; all of them at the end.
    * `first_ns`: time of the first frame, None before it.
    * `last_ns`: time of the last frame passed so far (in steps of some hundred frames); at the end the very last.
    * `complete`: True once the end was reached without a problem.
    * `problem`: one line when reading stopped early; offsets are those of the uncompressed bytes.
    * `dropped`: frames that the capturing machine lost (pcapng statistics), None if it does not say.

    It is read once: a second iteration goes on where the first one stopped.
    """

    def __init__(self, stream: Stream) -> None:
        self.path = stream.name
        self._stream = stream
        self._ended = False
        self._window = window = Window(stream)
        window.more(0, 4)
        head = bytes(window.view[: min(4, window.end)])
        self._reader: pcap.PcapReader | pcapng.PcapngReader | HexDumpReader | BusLogReader
        if pcap.recognised(head):
            self._reader = pcap.PcapReader(window)
        elif pcapng.recognised(head):
            self._reader = pcapng.PcapngReader(window)
        elif recording := _recording(window):
            self._reader = recording
        else:
            raise CaptureError(_not_a_capture(head, window.broken))
        self._frames = chain.from_iterable(self._read())

    def __iter__(self) -> Iterator[Frame]:
        return self._frames

    def _read(self) -> Iterator[list[Frame]]:
        # not compiled, on purpose: here the interpreter reacts at every batch to Ctrl-C, and lets the thread that
        # reads ahead run; the compiled code on both sides does neither
        yield from self._reader.read()
        self._ended = True

    def watch(self, watches: Sequence[Watch]) -> None:
        """From the next frame on, exactly these cyclic frames matter too."""
        self._reader.watch(watches)

    def tcp(self, ports: Iterable[int]) -> None:
        """From the next frame on, frames of exactly these TCP ports matter too."""
        self._reader.tcp(ports)

    def lacks(self, mark: bytes) -> bool:
        """Whether these bytes stand nowhere in a short binary capture. Ask before anything of it is read.

        So nobody has to walk over all its frames for something that none of them has.
        """
        if not isinstance(self._reader, pcap.PcapReader | pcapng.PcapngReader):
            return False
        window = self._window
        return not window.more(0, _SHORT) and window.data.find(mark, 0, window.end) < 0

    def everything(self, wanted: Callable[[int], bool] = lambda _: True) -> Iterator[WholeFrame]:
        """Every frame as it is in the file, or the `wanted` ones by number; use this instead of iterating."""
        yield from self._reader.everything(wanted)
        self._ended = True

    @property
    def frames(self) -> int:
        """Frames passed so far, some hundred at once."""
        return self._reader.frames

    @property
    def first_ns(self) -> int | None:
        """Time of the first frame, the irrelevant ones included."""
        return self._reader.first_ns if self.frames else None

    @property
    def last_ns(self) -> int | None:
        """Time of the last frame that was passed, the irrelevant ones included."""
        return self._reader.last_ns if self.frames else None

    @property
    def problem(self) -> str | None:
        """Why reading stopped before the end, or None."""
        return self._reader.problem

    @property
    def complete(self) -> bool:
        """True when everything was read."""
        return self._ended and self.problem is None

    @property
    def dropped(self) -> int | None:
        """Frames lost while capturing, or None."""
        return self._reader.dropped

    @property
    def timed(self) -> bool:
        """Whether frames have times; a text may have none."""
        return self._reader.timed

    @property
    def excerpt(self) -> bool:
        """Whether `ds47 export` wrote it: frames between its own were left out on purpose."""
        return isinstance(self._reader, pcapng.PcapngReader) and self._reader.excerpt

    @property
    def gaps(self) -> bool:
        """Whether frames are missing between two others."""
        return bool(self.dropped)

    def close(self) -> None:
        """Close the file, if `open_capture` opened it."""
        self._reader.close()
        self._stream.close()


def _recording(window: Window) -> HexDumpReader | BusLogReader | None:
    """The reader of a text or of bytes of PROFIBUS; few captures are one, so what knows them is read only here.

    Nothing more of the stream is read: who feeds a pipe may wait.
    """
    from . import bus_log, hex_dump

    return hex_dump.recognised(window) or bus_log.recognised(window)


def _not_a_capture(head: bytes, broken: str | None) -> str:
    if broken:
        return broken
    if not head:
        return "the file is empty"
    kind = next((kind for start, kind in _OTHERS.items() if head.startswith(start)), None)
    if kind is None:
        kind = f"it begins with {head.hex(' ')}"
        if head.isascii() and head.decode().isprintable():
            kind = "it is text, but not a hex dump of frames or a log of PROFIBUS"
    return (
        f"not a capture: {kind}. Try: pcap or pcapng (.gz, .zst), "
        "a hex dump of frames, or a recording of PROFIBUS"
    )


_OTHERS = {
    b"\x89PNG": "it is a PNG picture",
    b"\xff\xd8\xff": "it is a JPEG picture",
    b"PK\x03\x04": "it is a ZIP file or a workbook: unpack it first",
    b"%PDF": "it is a PDF",
    b"Rar!": "it is a RAR file: unpack it first",
    b"7z\xbc\xaf": "it is a 7z file: unpack it first",
    b"\x7fELF": "it is a program",
    b"MZ": "it is a program",
    b"BZh": "it is packed with bzip2: unpack it first",
    b"\xfd7zX": "it is packed with xz: unpack it first",
}
"""What people take for a capture, by the first bytes."""


def holds_capture(path: str | Path) -> bool:
    """Whether a file begins as a capture does, compressed or not; what follows may be damaged.

    Raises CaptureError where the file cannot be opened, or nothing here unpacks it.
    """
    stream = Stream(path)
    try:
        window = Window(stream)
        window.more(0, 4)
        head = bytes(window.view[: min(4, window.end)])
        capture = pcap.recognised(head) or pcapng.recognised(head)
        return capture or _recording(window) is not None
    finally:
        stream.close()


def open_capture(source: str | Path | BinaryIO, *, name: str | None = None) -> Capture:
    """Open a capture: a path, "-" for stdin, or a binary file object (which stays open).

    pcap, pcapng, hex dumps, recordings of PROFIBUS, gzip and zstd are recognised by content. `name` is
    shown instead of the path. Raises CaptureError when nothing can be read at all.
    """
    stream = Stream(source, name)
    try:
        return Capture(stream)
    except CaptureError as error:
        stream.close()
        raise CaptureError(f"{stream.name}: {error.message}") from error
