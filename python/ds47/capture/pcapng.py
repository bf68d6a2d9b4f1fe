"""The pcapng format: sections of either byte order, interfaces, three kinds of packet blocks.

Lives here: blocks and options, what a timestamp means, what is wrong where the scan stops. Not
here: the walk over Enhanced Packet Blocks (scan.py), compression and stdin (stream.py).
Format: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-03.html
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

from .errors import CaptureError
from .frame import Frame, Interface, WholeFrame
from .scan import ENHANCED_PACKET, MAX_FRAME, ByteOrder, Found, PcapngScan, relevant
from .stream import Window
from .walk import Walk

SECTION = 0x0A0D0D0A
INTERFACE, PACKET, SIMPLE_PACKET, STATISTICS = 1, 2, 3, 5
CUSTOM, CUSTOM_NO_COPY, JOURNAL = 0x0BAD, 0x40000BAD, 9
BYTE_ORDER_MAGIC = 0x1A2B3C4D

COMMENT, FLAGS, APPLICATION, TIME_RESOLUTION, TIME_OFFSET = 1, 2, 4, 9, 14
OURS = "ds47 "
"""How the name of the program begins that stands in the section header of an export."""
_TEXTS = (1, 2, 3, 11, 12, 15)
"""Options of an interface that say something to a person: comment, name, description, filter, OS, hardware."""

MAX_BLOCK = 1 << 24  # Wireshark's limit, in bytes

_STRETCH = 20  # bits of a timestamp that change often
_IN_STRETCH = (1 << _STRETCH) - 1

# Blocks that carry no packet and yet are lines of Wireshark's packet list
_COUNTED = frozenset((CUSTOM, CUSTOM_NO_COPY, JOURNAL, 0x204, 0x208, 0x210, 0x215, 0x216, 0x221))

_FIXED_PART = {SECTION: 16, INTERFACE: 8, PACKET: 20, SIMPLE_PACKET: 4, STATISTICS: 12,
               ENHANCED_PACKET: 20}  # fmt: skip


class _BrokenBlockError(Exception):
    """The block in front of the scan cannot be read. The text says what is wrong with it."""


def recognised(head: bytes) -> bool:
    """True when `head`, the first 4 bytes of a file, opens a pcapng section."""
    return head[:4] == b"\x0a\x0d\x0d\x0a"


class PcapngReader(Walk):
    """Frames of one pcapng file that may matter, in order.

    `frames` counts all frames as Wireshark does; `problem` is one line when the file is damaged;
    `dropped` sums up the frames that interface statistics call lost (isb_ifdrop, isb_osdrop), None
    without such counters. Raises CaptureError when the first section header cannot be read.
    """

    def __init__(self, window: Window) -> None:
        scan = PcapngScan()
        super().__init__(window, scan)
        self._begin_section = scan.section
        self._interfaces: list[Interface] = []
        self._wanted: Callable[[int], bool] | None = None
        self._last_ns = 0
        self.excerpt = False
        """Whether `ds47 export` wrote all its sections."""
        self._lost_before: int | None = None
        self._lost: dict[int, dict[int, int]] = {}
        self._set_order("little")
        try:
            if self._block() is None:
                raise _BrokenBlockError("the file is empty")
        except _BrokenBlockError as error:
            raise CaptureError(f"the pcapng section header cannot be read: {error}") from error

    @property
    def dropped(self) -> int | None:
        """Frames that the capturing machine lost, if the file says so."""
        if not self._lost:
            return self._lost_before
        lost = sum(sum(counters.values()) for counters in self._lost.values())
        return lost + (self._lost_before or 0)

    def read(self) -> Iterator[list[Frame]]:
        """Yield the frames that may matter, some at once; sets `problem` when it must stop early."""
        scan = self._scan
        with self._up_to_damage():
            while True:
                # the first one goes the long way, which tells its time whatever it holds
                if before := scan.frames:
                    for found in self._batches:
                        yield self._enhanced(found)
                    if scan.frames > before:
                        about = self._interfaces[scan.interface]
                        self.last_ns = about.time_ns(scan.high, scan.low)
                self.frames = scan.frames
                frame = self._block()
                self.frames = scan.frames
                if frame is None:
                    return
                if frame is not True:
                    self._last_ns = frame.time_ns
                    yield [frame]

    def everything(self, wanted: Callable[[int], bool]) -> Iterator[WholeFrame]:
        """Yield the frames of these numbers with all that the file says of them; `problem` as `read`."""
        self._wanted = wanted
        with self._up_to_damage():
            while (frame := self._block()) is not None:
                if isinstance(frame, WholeFrame):
                    yield frame
            self.frames = self._scan.frames

    @contextmanager
    def _up_to_damage(self) -> Iterator[None]:
        """Says in `problem` what ends the reading early."""
        try:
            yield
        except _BrokenBlockError as error:
            broken = self._window.broken or f"damaged at byte {self._offset}: {error}"
            self.problem = broken + "; only the frames before it are reported"

    def _enhanced(self, found: list[Found]) -> list[Frame]:
        """Enhanced Packet Blocks, as the scan found them, as frames."""
        interfaces, frames = self._interfaces, []
        stretch, of, units_before = -1, -1, 0
        for number, interface, high, low, original, data in found:
            about = interfaces[interface]
            # `time_ns` in two parts: where this is compiled products of large numbers are slow
            ticks = high << 32 | low
            if ticks >> _STRETCH != stretch or interface != of:
                stretch, of = ticks >> _STRETCH, interface
                units_before = (stretch << _STRETCH) * about.numerator
            units = units_before + (ticks & _IN_STRETCH) * about.numerator
            if about.denominator != 1:
                units //= about.denominator
            time_ns = units + about.offset_ns
            frames.append(Frame(number, time_ns, about.link_type, data, original))
        if frames:
            self.frames, self._last_ns = frames[-1].number, frames[-1].time_ns
        return frames

    def _set_order(self, order: ByteOrder) -> None:
        self._order: ByteOrder = order
        self._sign = "<" if order == "little" else ">"
        self._word = struct.Struct(self._sign + "I")
        self._begin_section(order)

    # -- any block, one at a time ---------------------------------------------------------------

    def _block(self) -> Frame | Literal[True] | None:
        """Take the block in front of the scan. None at the end; a frame that may matter; True.

        Raises _BrokenBlockError, with the scan still in front of the block.
        """
        scan, window = self._scan, self._window
        if not self._have(12):
            if not self._left and not window.broken:
                return None
            raise _BrokenBlockError(f"a block header needs 12 bytes and {self._left} are left")
        kind, total = self._head()
        if not self._have(total):
            raise _BrokenBlockError(
                f"block type {kind:#x} needs {total} bytes and {self._left} are left"
            )
        data, start, end = window.view, scan.position, scan.position + total
        if data[start + 4 : start + 8] != data[end - 4 : end]:
            raise _BrokenBlockError(f"block type {kind:#x} gives its length twice, and differently")
        frame = self._dispatch(kind, data[start + 8 : end - 4].tobytes())
        scan.position = end
        return frame if frame is not None else True

    def _head(self) -> tuple[int, int]:
        """Return type and length of the block at the scan, a section's byte order applied."""
        data, at = self._window.data, self._scan.position
        if data[at : at + 4] == SECTION.to_bytes(4, "big"):
            self._set_order(self._section_order(bytes(data[at + 8 : at + 12])))
        kind, total = struct.unpack_from(self._sign + "2I", data, at)
        least = 12 + _FIXED_PART.get(kind, 0)
        if total < least or total % 4:
            reason = "not a multiple of 4" if total % 4 else f"it needs at least {least}"
            raise _BrokenBlockError(f"block type {kind:#x} claims {total} bytes: {reason}")
        if total > MAX_BLOCK:
            raise _BrokenBlockError(
                f"block type {kind:#x} claims {total} bytes, more than {MAX_BLOCK}"
            )
        return kind, total

    @staticmethod
    def _section_order(magic: bytes) -> ByteOrder:
        orders: tuple[ByteOrder, ByteOrder] = ("little", "big")
        for order in orders:
            if int.from_bytes(magic, order) == BYTE_ORDER_MAGIC:
                return order
        raise _BrokenBlockError(f"the byte-order magic of the section is {magic.hex()}")

    def _dispatch(self, kind: int, body: bytes) -> Frame | None:
        blocks: dict[int, Callable[[bytes], Frame | None]] = {
            SECTION: self._on_section,
            INTERFACE: self._on_interface,
            ENHANCED_PACKET: self._on_enhanced,
            PACKET: self._on_packet,
            SIMPLE_PACKET: self._on_simple,
            STATISTICS: self._on_statistics,
        }
        if kind in blocks:
            return blocks[kind](body)
        if kind in _COUNTED:
            self._scan.frames += 1
        return None

    # -- one method per block type; `body` is without type and lengths --------------------------

    def _on_section(self, body: bytes) -> None:
        (major,) = struct.unpack_from(self._sign + "H", body, 4)
        if major != 1:
            raise _BrokenBlockError(f"the section has version {major}, only 1 is known")
        wrote = dict(self._options(body, 16)).get(APPLICATION, b"")
        self.excerpt = wrote.startswith(OURS.encode()) and (self.excerpt or not self.frames)
        self._lost_before = self.dropped
        self._lost = {}
        self._interfaces = []
        self._scan.links = []

    def _on_interface(self, body: bytes) -> None:
        link_type, _, snap_length = struct.unpack_from(self._sign + "HHI", body)
        about = Interface(link_type, snap_length)
        for code, value in self._options(body, 8):
            if code == TIME_RESOLUTION and len(value) >= 1:
                about.resolution(value[0])
            elif code == TIME_OFFSET and len(value) >= 8:
                (seconds,) = struct.unpack_from(self._sign + "q", value)
                about.offset_ns = seconds * 1_000_000_000
            elif code in _TEXTS:
                about.options.append((code, value))
        self._scan.links.append(link_type)
        self._interfaces.append(about)

    def _on_enhanced(self, body: bytes) -> Frame | None:
        """Also where the fast loop stops: what it did not like is named here."""
        interface, high, low, captured, original = struct.unpack_from(self._sign + "5I", body)
        return self._packet(interface, high, low, captured, original, body[20:])

    def _on_packet(self, body: bytes) -> Frame | None:
        """The obsolete Packet Block: as the enhanced one, with a drop counter."""
        interface, _, high, low, captured, original = struct.unpack_from(self._sign + "2H4I", body)
        return self._packet(interface, high, low, captured, original, body[20:])

    def _packet(
        self, interface: int, high: int, low: int, captured: int, original: int, rest: bytes
    ) -> Frame | None:
        about = self._interface(interface)
        if captured > min(len(rest), MAX_FRAME):
            raise _BrokenBlockError(
                f"frame {self.frames + 1} claims {captured} captured bytes, "
                f"{min(len(rest), MAX_FRAME)} are possible"
            )
        self.last_ns = about.time_ns(high, low)
        frame = self._frame(about, self.last_ns, rest[:captured], original)
        if isinstance(frame, WholeFrame):
            self._said(frame, rest, captured + -captured % 4)
        return frame

    def _said(self, frame: WholeFrame, rest: bytes, at: int) -> None:
        """Reads the options of a frame: comments and flags."""
        for code, value in self._options(rest, at):
            if code == COMMENT:
                frame.comments.append(value.decode("utf-8", errors="replace"))
            elif code == FLAGS and len(value) == 4:
                (frame.flags,) = self._word.unpack(value)

    def _on_simple(self, body: bytes) -> Frame | None:
        """Belongs to interface 0, and the snap length says how much of it is there."""
        about = self._interface(0)
        (original,) = self._word.unpack_from(body)
        captured = min(original, about.snap_length or original)
        if captured > min(len(body) - 4, MAX_FRAME):
            raise _BrokenBlockError(
                f"frame {self.frames + 1} claims {captured} bytes and {len(body) - 4} are there"
            )
        return self._frame(about, self._last_ns, body[4 : 4 + captured], original)

    def _frame(self, about: Interface, time_ns: int, data: bytes, original: int) -> Frame | None:
        self._scan.frames += 1
        self.frames = self._scan.frames
        if self.first_ns is None:
            self.first_ns = time_ns
        if self._wanted is not None:
            self._last_ns = time_ns
            if not self._wanted(self.frames):
                return None
            return WholeFrame(self.frames, time_ns, about, data, original)
        wanted = relevant(data, 0, len(data), about.link_type, original, self._scan.ports)
        if not wanted and not self._scan.is_due(data, about.link_type):
            return None
        return Frame(self.frames, time_ns, about.link_type, data, original)

    def _interface(self, number: int) -> Interface:
        if number >= len(self._interfaces):
            raise _BrokenBlockError(
                f"frame {self.frames + 1} is of interface {number}, "
                f"the section describes {len(self._interfaces)}"
            )
        return self._interfaces[number]

    def _on_statistics(self, body: bytes) -> None:
        """Counters run from the start of the capture, so that the last block of each counts."""
        (interface,) = self._word.unpack_from(body)
        if interface >= len(self._interfaces):
            return
        counters = {
            code: int.from_bytes(value[:8], self._order)
            for code, value in self._options(body, 12)
            if code in (5, 7) and len(value) >= 8  # isb_ifdrop, isb_osdrop
        }
        if counters:
            self._lost.setdefault(interface, {}).update(counters)

    def _options(self, body: bytes, at: int) -> Iterator[tuple[int, bytes]]:
        """Yield (code, value) up to the end; options that leave the block are not ours to judge."""
        while at + 4 <= len(body):
            code, length = struct.unpack_from(self._sign + "HH", body, at)
            if code == 0 or at + 4 + length > len(body):
                return
            yield code, body[at + 4 : at + 4 + length]
            at += 4 + (length + 3) // 4 * 4
