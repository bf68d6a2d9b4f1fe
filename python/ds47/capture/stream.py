"""Bytes in order: opening a source, taking off compression, a sliding window over the rest.

Lives here: plain files, stdin and file objects; gzip and zstd, recognised by content; `Window`, the
buffer that the scan walks over. Not here: what the bytes mean (pcap.py, pcapng.py), the thread that
reads large plain files (ahead.py).

Files are read, not mapped: a mapped file that somebody truncates kills the process, mapped pages
count as memory of the process, and reading into the same buffer again and again is as fast.
"""

from __future__ import annotations

import importlib
import io
import os
import stat
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Protocol, cast

from .errors import CaptureError
from .remote import open_bytes
from .scan import PADDING

CHUNK = 1 << 18  # fits the second-level cache; larger is slower

_GZIP = b"\x1f\x8b"
_ZSTD = b"\x28\xb5\x2f\xfd"
_PORTION = 1 << 12
_PLENTY, _RATIO = 64 << 20, 500
"""So many bytes may come of anything, then so many of each packed one: times and counters change."""
_EMPTY = 1000
"""Members without content in a row."""


class DamagedError(Exception):
    """The compressed data or the medium fails in the middle. Becomes `Capture.problem`."""


class Reader(Protocol):
    """What a layer of the stream offers to the next one."""

    def readinto(self, room: memoryview, /) -> int:
        """Fill the beginning of `room`; how many bytes, 0 at the end. Raises DamagedError."""
        ...


def _put(piece: bytes, room: memoryview) -> int:
    room[: len(piece)] = piece
    return len(piece)


class _Decoder(Protocol):
    """The part of the zstd and (adapted) zlib decompressors that is used here."""

    @property
    def eof(self) -> bool: ...
    @property
    def needs_input(self) -> bool: ...
    @property
    def unused_data(self) -> bytes: ...
    def decompress(self, data: bytes, max_length: int = ..., /) -> bytes: ...


class _Raw:
    """A binary file object behind a few bytes that were already taken from it."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        # read1 hands out what a pipe has now; read would wait for a whole chunk
        self._read = getattr(file, "read1", file.read)
        self._into: Callable[[memoryview], int | None] | None
        self.head = b""
        while len(self.head) < 4:
            piece = self._take(CHUNK)
            if not piece:
                break
            self.head += piece
        self._left = self.head
        self._into = getattr(file, "readinto1", None)
        if isinstance(file, io.RawIOBase):
            self._into = file.readinto

    def readinto(self, room: memoryview, /) -> int:
        """Fill the beginning of `room`; how many bytes, 0 at the end. Raises DamagedError."""
        if self._left or self._into is None:
            return _put(self.read(len(room)), room)
        try:
            return self._into(room) or 0
        except (OSError, ValueError) as error:
            raise DamagedError(f"reading failed: {error}") from error

    def large_file(self, least: int) -> int | None:
        """As `Stream.large_file`."""
        if self._left or not isinstance(self._file, io.FileIO):
            return None
        try:
            descriptor = self._file.fileno()
            about = os.fstat(descriptor)
            left = about.st_size - self._file.tell()
        except (OSError, ValueError):  # reading it will say why
            return None
        return descriptor if stat.S_ISREG(about.st_mode) and left >= least else None

    def _take(self, size: int) -> bytes:
        try:
            return bytes(self._read(size) or b"")
        except (OSError, ValueError) as error:
            raise DamagedError(f"reading failed: {error}") from error

    def read(self, size: int, /) -> bytes:
        if self._left:
            piece, self._left = self._left[:size], self._left[size:]
            return piece
        return self._take(size)


class _Gzip:
    """zlib's decompressor with the interface of the others: it keeps its own unread input."""

    def __init__(self) -> None:
        self._zlib = zlib.decompressobj(wbits=31)

    @property
    def eof(self) -> bool:
        return self._zlib.eof

    @property
    def needs_input(self) -> bool:
        return not self._zlib.unconsumed_tail

    @property
    def unused_data(self) -> bytes:
        return self._zlib.unused_data

    def decompress(self, data: bytes, max_length: int = 0, /) -> bytes:
        return self._zlib.decompress(self._zlib.unconsumed_tail + data, max_length)


def _zstd_decoder() -> _Decoder:
    """Return a zstd decompressor. Raises CaptureError where none is installed."""
    for name in ("compression.zstd", "backports.zstd"):
        try:
            decoder: _Decoder = importlib.import_module(name).ZstdDecompressor()
        except ImportError:
            continue
        return decoder
    raise CaptureError(
        "this capture is zstd-compressed and no decompressor is installed: "
        "install the Python package backports.zstd, or unpack it with `zstd -d` first"
    )


class _Decompressed:
    """The plain bytes of a compressed stream, in bounded pieces, over any number of members.

    What is made to hurt is damage: more than `_RATIO` times what was packed, or members without content.
    """

    def __init__(self, source: _Raw, magic: bytes) -> None:
        self._source = source
        self._magic = magic
        self._name = "gzip" if magic == _GZIP else "zstd"
        self._decoder = self._new()
        self._input, self._at, self._portion = b"", 0, _PORTION
        self._seen = self._given = self._empty = 0

    def _new(self) -> _Decoder:
        return _Gzip() if self._magic == _GZIP else _zstd_decoder()

    def readinto(self, room: memoryview, /) -> int:
        return _put(self._piece(len(room)), room)

    def _piece(self, size: int) -> bytes:
        while True:
            if self._decoder.eof and not self._next_member():
                return b""
            data = b""
            if self._decoder.needs_input:
                data = self._feed()
                if not data and self._seen:
                    raise DamagedError(f"the {self._name} data is cut off after {self._seen} bytes")
            piece = self._decode(data, size)
            if piece:
                self._empty = 0
                self._count(len(piece))
                return piece

    def _feed(self) -> bytes:
        """Input for the decoder: little at the beginning of a member, as what it leaves over is copied."""
        if self._at == len(self._input):
            self._input, self._at = self._source.read(CHUNK), 0
        data = self._input[self._at : self._at + self._portion]
        self._portion = min(4 * self._portion, CHUNK)
        self._at += len(data)
        self._seen += len(data)
        return data

    def _give_back(self, rest: bytes) -> None:
        """Takes back the end of what was fed."""
        if len(rest) > self._at:  # some of it came before this input
            self._input, self._at = rest + self._input[self._at :], len(rest)
        self._at -= len(rest)
        self._seen -= len(rest)

    def _count(self, size: int) -> None:
        self._given += size
        if self._given > max(_PLENTY, _RATIO * self._seen):
            raise DamagedError(
                f"the {self._name} data unpacks to more than {_RATIO} times its size, which no recording does; "
                f"the first {self._given} bytes are read. If it is one, unpack it first"
            )

    def _decode(self, data: bytes, size: int) -> bytes:
        try:
            return self._decoder.decompress(data, size)
        except Exception as error:  # zlib.error and the ZstdError of either zstd module
            text = f"the {self._name} data is damaged within its first {self._seen} bytes: {error}"
            raise DamagedError(" ".join(text.split())) from error

    def _next_member(self) -> bool:
        """Start the member that follows; False at the end. Zeros in between are padding."""
        self._give_back(self._decoder.unused_data)
        self._portion, rest = _PORTION, b""
        while len(rest) < len(self._magic) and (more := self._feed()):
            rest = (rest + more).lstrip(b"\0")
        if not rest:
            return False
        if not rest.startswith(self._magic):
            raise DamagedError(f"bytes that are not {self._name} follow the {self._name} data")
        self._empty += 1
        if self._empty > _EMPTY:
            raise DamagedError(
                f"the {self._name} data has more than {_EMPTY} members without content in a row"
            )
        self._give_back(rest)
        self._decoder, self._portion = self._new(), _PORTION
        return True


class Stream:
    """An opened source: `readinto()` gives the bytes of the capture, compressed or not.

    Raises CaptureError when the source cannot be opened.
    """

    def __init__(self, source: str | Path | BinaryIO, name: str | None = None) -> None:
        self._owned: BinaryIO | None = None
        self.name = name or self._name_of(source)
        file = self._open(source)
        try:
            self._raw = raw = _Raw(file)
            self._reader: Reader = raw
            for magic in (_GZIP, _ZSTD):
                if raw.head.startswith(magic):
                    self._reader = _Decompressed(raw, magic)
        except DamagedError as error:
            self.close()
            raise CaptureError(f"{self.name}: {error}") from error
        except CaptureError as error:
            self.close()
            raise CaptureError(f"{self.name}: {error.message}") from error

    def _open(self, source: str | Path | BinaryIO) -> BinaryIO:
        if not isinstance(source, str | Path):
            return source
        if str(source) == "-":
            return sys.stdin.buffer
        try:
            self._owned = cast(BinaryIO, open_bytes(source))
        except OSError as error:
            reason = error.strerror or str(error)
            raise CaptureError(f"{self.name}: cannot be opened: {reason}") from error
        except ValueError as error:  # a NUL in the name
            raise CaptureError(f"{self.name!r}: cannot be opened: {error}") from error
        assert self._owned is not None
        return self._owned

    @staticmethod
    def _name_of(source: str | Path | BinaryIO) -> str:
        if isinstance(source, str | Path):
            return os.fspath(source)
        name = getattr(source, "name", None)
        return name if isinstance(name, str) else "<stream>"

    def readinto(self, room: memoryview, /) -> int:
        """Fill the beginning of `room`; how many bytes, 0 at the end. Raises DamagedError."""
        return self._reader.readinto(room)

    def large_file(self, least: int) -> int | None:
        """The descriptor, if this is a plain file with at least so many bytes left.

        A reader of the descriptor begins where this stands; this goes on where the reader ends.
        """
        return self._raw.large_file(least) if self._reader is self._raw else None

    def close(self) -> None:
        """Close the file if this object opened it."""
        if self._owned is not None:
            self._owned.close()


class Window:
    """The part of a stream that is in memory: `data[0:end]`, with PADDING bytes of anything behind it.

    `view` is a memoryview of `data`; `base` is the offset of data[0] in the (decompressed) capture;
    `broken` is the text of a failure of the stream, after which there is no more data.
    """

    def __init__(self, stream: Reader) -> None:
        self._stream = stream
        self.data = bytearray(CHUNK + PADDING)
        self.view = memoryview(self.data)
        self.end = 0
        self.base = 0
        self.broken: str | None = None

    def close(self) -> None:
        """Frees the buffer: a finished analysis may keep the window alive for a while, in a reference cycle."""
        self.data = bytearray(PADDING)
        self.view, self.end = memoryview(self.data), 0

    def large_file(self, least: int) -> int | None:
        """As `Stream.large_file`."""
        stream = self._stream
        return stream.large_file(least) if isinstance(stream, Stream) else None

    def take_over(self, end: int, passed: int) -> None:
        """The caller has read into `data`: it ends there now, and so many bytes before it are gone."""
        self.end = end
        self.base += passed

    def more(self, start: int, need: int) -> bool:
        """Drop what lies before `start`; have at least `need` bytes after it, if the stream does.

        data[start] becomes data[0]. False when the stream ends before `need` bytes.
        """
        kept = self.view[start : self.end]
        have = len(kept)
        self.base += start
        if need + PADDING > len(self.data):
            self.data = bytearray(need + PADDING)
            self.view = memoryview(self.data)
        self.view[:have] = kept
        room = self.view[:-PADDING]
        try:
            while have < need and (count := self._stream.readinto(room[have:])):
                have += count
        except DamagedError as error:
            self.broken = str(error)
        self.end = have
        return have >= need
