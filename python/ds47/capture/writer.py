"""Writing frames as pcapng.

Lives here: one section, one interface, Enhanced Packet Blocks with an optional comment. Not here:
reading. What is written depends on the arguments only, so equal calls give equal files.
"""

from __future__ import annotations

import struct
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from .pcapng import BYTE_ORDER_MAGIC, INTERFACE, SECTION
from .scan import ENHANCED_PACKET, ETHERNET


class PcapngWriter:
    """Write a little-endian pcapng file; a context manager.

    `target` is a path (created or replaced; OSError when that fails) or a binary file object,
    which stays open. `link_type` is a LINKTYPE_ number. Without `nanosecond` times are cut to
    microseconds.
    """

    def __init__(
        self, target: str | Path | BinaryIO, link_type: int = ETHERNET, nanosecond: bool = True
    ) -> None:
        self._owned = isinstance(target, str | Path)
        self._file = Path(target).open("wb") if isinstance(target, str | Path) else target
        self._unit = 1 if nanosecond else 1000
        section = struct.pack("<IHHq", BYTE_ORDER_MAGIC, 1, 0, -1)
        resolution = _option(9, bytes([9 if nanosecond else 6])) + _option(0, b"")
        self._block(SECTION, section)
        self._block(INTERFACE, struct.pack("<HHI", link_type, 0, 0) + resolution)

    def write(
        self,
        time_ns: int,
        data: bytes,
        original_length: int | None = None,
        comment: str | None = None,
    ) -> None:
        """Append a frame captured `time_ns` nanoseconds after 1970 (from 0 up).

        `original_length` is its length on the wire where `data` is only the beginning. Raises
        ValueError for a time that the format cannot hold.
        """
        stamp = time_ns // self._unit
        if not 0 <= stamp < 1 << 64:
            raise ValueError(f"time_ns {time_ns} does not fit a pcapng timestamp")
        length = len(data) if original_length is None else original_length
        header = struct.pack("<5I", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(data), length)
        options = _option(1, comment.encode()) + _option(0, b"") if comment else b""
        self._block(ENHANCED_PACKET, header + _padded(data) + options)

    def _block(self, kind: int, body: bytes) -> None:
        total = len(body) + 12
        self._file.write(struct.pack("<2I", kind, total) + body + struct.pack("<I", total))

    def close(self) -> None:
        """Flush, and close the file if this object opened it."""
        if self._owned:
            self._file.close()
        else:
            self._file.flush()

    def __enter__(self) -> PcapngWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + _padded(value)
