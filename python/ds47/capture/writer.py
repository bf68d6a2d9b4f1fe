"""Writing frames as pcapng.

Lives here: one section, any number of interfaces, Enhanced Packet Blocks with optional comments. Not
here: reading. What is written depends on the arguments only, so equal calls give equal files.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from .closing import Closing
from .pcapng import (
    APPLICATION,
    BYTE_ORDER_MAGIC,
    COMMENT,
    FLAGS,
    INTERFACE,
    SECTION,
    TIME_RESOLUTION,
)
from .scan import ENHANCED_PACKET, ETHERNET

LAST_NS = (1 << 64) - 1
"""The last time that a file of nanoseconds can hold, in 2554; the first is 1970."""
_LONGEST = 0xFFFC
"""Bytes of an option: its length is a 16-bit number, and it is padded to four."""


def nearest(time_ns: int) -> int:
    """The nearest time that a file of nanoseconds can hold."""
    return min(max(time_ns, 0), LAST_NS)


class PcapngWriter(Closing):
    """Write a little-endian pcapng file; a context manager.

    `target` is a path (created or replaced; OSError when that fails) or a binary file object,
    which stays open. `link_type` is the LINKTYPE_ number of the first interface; None makes none, and
    `add_interface` has to come before the first frame. Without `nanosecond` times are cut to
    microseconds. `application` names the program that writes.
    """

    def __init__(
        self,
        target: str | Path | BinaryIO,
        link_type: int | None = ETHERNET,
        nanosecond: bool = True,
        application: str | None = None,
    ) -> None:
        self._owned = isinstance(target, str | Path)
        self._file = Path(target).open("wb") if isinstance(target, str | Path) else target
        self._unit = 1 if nanosecond else 1000
        self._interfaces = 0
        section = struct.pack("<IHHq", BYTE_ORDER_MAGIC, 1, 0, -1)
        if application:
            section += _options([(APPLICATION, application.encode())])
        self._block(SECTION, section)
        if link_type is not None:
            self.add_interface(link_type)

    def add_interface(
        self, link_type: int, snap_length: int = 0, options: Sequence[tuple[int, bytes]] = ()
    ) -> int:
        """Describe one more interface; its number for `write`.

        `options` are (code, value) of the Interface Description Block, without if_tsresol, which this
        writer decides.
        """
        resolution = (TIME_RESOLUTION, bytes([9 if self._unit == 1 else 6]))
        head = struct.pack("<HHI", link_type, 0, snap_length)
        self._block(INTERFACE, head + _options([*options, resolution]))
        self._interfaces += 1
        return self._interfaces - 1

    def write(
        self,
        time_ns: int,
        data: bytes,
        original_length: int | None = None,
        comment: str | None = None,
        *,
        interface: int = 0,
        comments: Sequence[str] = (),
        flags: int | None = None,
    ) -> None:
        """Append a frame captured `time_ns` nanoseconds after 1970 (from 0 up).

        `original_length` is its length on the wire where `data` is only the beginning. `comments` are
        further packet comments, `flags` is epb_flags. Raises ValueError for a time that the format
        cannot hold, and for an interface that was not described.
        """
        stamp = time_ns // self._unit
        if not 0 <= stamp <= LAST_NS:
            raise ValueError(f"time_ns {time_ns} does not fit a pcapng timestamp")
        if not 0 <= interface < self._interfaces:
            raise ValueError(f"there is no interface {interface}")
        length = len(data) if original_length is None else original_length
        header = struct.pack("<5I", interface, stamp >> 32, stamp & 0xFFFFFFFF, len(data), length)
        texts = [comment, *comments] if comment else comments
        options = [(COMMENT, _cut(text)) for text in texts if text]
        if flags is not None:
            options.append((FLAGS, struct.pack("<I", flags)))
        tail = _options(options) if options else b""
        self._block(ENHANCED_PACKET, header + _padded(data) + tail)

    @staticmethod
    def wrote(head: bytes, application: str) -> bool:
        """Whether a file that begins with `head` was written here, by a program with this name prefix."""
        kind, magic = struct.unpack_from("<I4xI", head) if len(head) >= 28 else (0, 0)
        (code,) = struct.unpack_from("<H", head, 24) if kind == SECTION else (0,)
        return (
            magic == BYTE_ORDER_MAGIC
            and code == APPLICATION
            and head[28:].startswith(application.encode())
        )

    @staticmethod
    def is_cut(comment: str) -> bool:
        """Whether a comment was longer than an option may be, and lost its end."""
        return len(comment.encode()) > _LONGEST - 4

    def _block(self, kind: int, body: bytes) -> None:
        total = len(body) + 12
        self._file.write(struct.pack("<2I", kind, total) + body + struct.pack("<I", total))

    def close(self) -> None:
        """Flush, and close the file if this object opened it."""
        if self._owned:
            self._file.close()
        else:
            self._file.flush()


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _cut(text: str) -> bytes:
    """The text in UTF-8, cut where an option ends, and never inside a character."""
    data = text.encode("utf-8", errors="backslashreplace")
    return data[:_LONGEST].decode("utf-8", errors="ignore").encode()


def _options(options: Sequence[tuple[int, bytes]]) -> bytes:
    """The options and the end of them."""
    return b"".join(
        struct.pack("<HH", code, len(value)) + _padded(value)
        for code, value in [*options, (0, b"")]
    )
