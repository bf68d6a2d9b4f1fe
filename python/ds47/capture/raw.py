"""Every frame of a capture as it stands in the file, for who copies frames.

Lives here: a plain walk over pcap and pcapng that keeps what the analysis has no use for: the
interface, the snap length, the comments. Not here: the analysis' own way, which leaves out at once
what is none of its business (pcap.py, pcapng.py, scan.py); frame numbers are the same.

Damage ends the walk without a word: whoever copies has read the capture before, and was told.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from . import pcap, pcapng
from .errors import CaptureError
from .pcapng import (
    BYTE_ORDER_MAGIC,
    INTERFACE,
    MAX_BLOCK,
    PACKET,
    SECTION,
    SIMPLE_PACKET,
)
from .scan import ENHANCED_PACKET, MAX_FRAME
from .stream import Stream, Window

_COMMENT, _FLAGS, _TIME_RESOLUTION, _TIME_OFFSET = 1, 2, 9, 14
_PCAP = {0xA1B2C3D4: (1000, 16), 0xA1B23C4D: (1, 16), 0xA1B2CD34: (1000, 24)}
"""Magic number -> nanoseconds of one unit of the fraction, bytes of a record header."""
_TEXTS = (1, 2, 3, 11, 12, 15)
"""Options of an interface that say something to a person: comment, name, description, filter, OS, hardware."""


@dataclass(slots=True, eq=False)
class Interface:
    """What the file says of an interface; `options` are those for a person, as (code, value)."""

    link_type: int
    snap_length: int
    options: list[tuple[int, bytes]] = field(default_factory=list)
    numerator: int = 1000
    denominator: int = 1
    offset_ns: int = 0

    def time_ns(self, high: int, low: int) -> int:
        """A timestamp in nanoseconds since 1970."""
        return (high << 32 | low) * self.numerator // self.denominator + self.offset_ns


@dataclass(slots=True)
class RawFrame:
    """A frame and what the file says about it. `comments` are packet comments, `flags` is epb_flags."""

    number: int
    time_ns: int
    interface: Interface
    data: bytes
    original_length: int
    comments: tuple[str, ...] = ()
    flags: int | None = None


def raw_frames(
    source: str | Path | BinaryIO, wanted: Callable[[int], bool] | None = None
) -> Iterator[RawFrame]:
    """The frames of a capture whose number is `wanted` (None: all), in the order of the file.

    Raises CaptureError where it cannot be opened or is no capture.
    """
    stream = Stream(source)
    try:
        window = Window(stream)
        window.more(0, 24)
        head = bytes(window.data[: min(4, window.end)])
        walk = _Walk(window, wanted or (lambda _: True))
        if pcap.recognised(head):
            yield from walk.pcap()
        elif pcapng.recognised(head):
            yield from walk.pcapng()
        else:
            raise CaptureError(f"{stream.name}: not a capture")
    finally:
        stream.close()


class _Walk:
    """One walk; `_at` is where the next record or block begins in the window."""

    def __init__(self, window: Window, wanted: Callable[[int], bool]) -> None:
        self._window = window
        self._wanted = wanted
        self._at = 0
        self._number = 0
        self._sign = "<"
        self._interfaces: list[Interface] = []
        self._last_ns = 0

    def _have(self, need: int) -> bool:
        if self._window.end - self._at >= need:
            return True
        whole = self._window.more(self._at, need)
        self._at = 0
        return whole

    def _take(self, start: int, size: int) -> bytes:
        at = self._at + start
        return bytes(self._window.data[at : at + size])

    # pcap

    def pcap(self) -> Iterator[RawFrame]:
        head = self._take(0, 24)
        self._sign = "<" if int.from_bytes(head[:4], "little") in _PCAP else ">"
        magic, snap, link = struct.unpack(self._sign + "I12x2I", head)
        unit, header = _PCAP[magic]
        interface = Interface(link & 0x03FFFFFF, snap)
        record = struct.Struct(self._sign + "4I")
        self._at = 24
        while self._have(header):
            seconds, fraction, captured, original = record.unpack(self._take(0, 16))
            if captured > MAX_FRAME or not self._have(header + captured):
                return
            self._number += 1
            if self._wanted(self._number):
                time_ns = seconds * 1_000_000_000 + fraction * unit
                data = self._take(header, captured)
                yield RawFrame(self._number, time_ns, interface, data, original)
            self._at += header + captured

    # pcapng

    def pcapng(self) -> Iterator[RawFrame]:
        while self._have(12):
            if self._take(0, 4) == SECTION.to_bytes(4, "big"):
                magic = int.from_bytes(self._take(8, 4), "little")
                self._sign = "<" if magic == BYTE_ORDER_MAGIC else ">"
                self._interfaces = []
            kind, total = struct.unpack(self._sign + "2I", self._take(0, 8))
            if total < 12 or total % 4 or total > MAX_BLOCK or not self._have(total):
                return
            if kind == INTERFACE:
                self._on_interface(self._take(8, total - 12))
            elif kind in (ENHANCED_PACKET, PACKET, SIMPLE_PACKET):
                self._number += 1
                frame = self._packet(kind, total)
                if frame is None:
                    return
                self._last_ns = frame.time_ns
                if self._wanted(self._number):
                    yield self._whole(frame, kind, total)
            elif kind in pcapng._COUNTED:
                self._number += 1
            self._at += total

    def _on_interface(self, body: bytes) -> None:
        if len(body) < 8:
            return
        link_type, snap = struct.unpack_from(self._sign + "H2xI", body)
        about = Interface(link_type, snap)
        for code, value in self._options(body, 8):
            if code == _TIME_RESOLUTION and value:
                power = value[0] & 0x7F
                units: int = 2**power if value[0] & 0x80 else 10**power
                about.numerator, about.denominator = 1_000_000_000, units
            elif code == _TIME_OFFSET and len(value) >= 8:
                (seconds,) = struct.unpack_from(self._sign + "q", value)
                about.offset_ns = seconds * 1_000_000_000
            elif code in _TEXTS:
                about.options.append((code, value))
        self._interfaces.append(about)

    def _packet(self, kind: int, total: int) -> RawFrame | None:
        """What the head of a packet block says; None where it contradicts itself. No data yet."""
        head = self._take(8, 20)
        if kind == SIMPLE_PACKET:
            if not self._interfaces:
                return None
            (original,) = struct.unpack_from(self._sign + "I", head)
            return RawFrame(self._number, self._last_ns, self._interfaces[0], b"", original)
        layout = "5I" if kind == ENHANCED_PACKET else "H2x4I"
        number, high, low, captured, original = struct.unpack_from(self._sign + layout, head)
        if number >= len(self._interfaces) or captured > min(total - 32, MAX_FRAME):
            return None
        interface = self._interfaces[number]
        return RawFrame(self._number, interface.time_ns(high, low), interface, b"", original)

    def _whole(self, frame: RawFrame, kind: int, total: int) -> RawFrame:
        """The frame with its bytes and options."""
        if kind == SIMPLE_PACKET:
            snap = frame.interface.snap_length or frame.original_length
            frame.data = self._take(12, min(frame.original_length, snap, total - 16))
            return frame
        (captured,) = struct.unpack(self._sign + "I", self._take(20, 4))
        frame.data = self._take(28, captured)
        comments = []
        rest = self._take(28, total - 32)
        for code, value in self._options(rest, captured + -captured % 4):
            if code == _COMMENT:
                comments.append(value.decode("utf-8", errors="replace"))
            elif code == _FLAGS and len(value) == 4:
                (frame.flags,) = struct.unpack(self._sign + "I", value)
        frame.comments = tuple(comments)
        return frame

    def _options(self, body: bytes, at: int) -> Iterator[tuple[int, bytes]]:
        while at + 4 <= len(body):
            code, length = struct.unpack_from(self._sign + "HH", body, at)
            if code == 0 or at + 4 + length > len(body):
                return
            yield code, body[at + 4 : at + 4 + length]
            at += 4 + (length + 3) // 4 * 4
