"""Hex dumps of packets as captures: what `tshark -x` and `tcpdump -x` print, and text2pcap reads.

Lives here: telling them from anything else by content, and which link type the bytes have. The packets become a
pcap in memory, piece by piece, so all else is as with a file of that format. Not here: what a row is
(hex_rows.py). Reference: docs/offline.md.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final

from ds47.profibus import PROFIBUS_DL
from ds47.profibus.stream import split
from ds47.profibus.telegram import decode

from . import text
from .frame import Frame, WholeFrame
from .hex_rows import Packet, Packets
from .kinds import ETHER_TYPES
from .pcap import PcapReader
from .scan import ETHERNET, IPV4, MAX_FRAME, RAW, SLL, SLL2, Watch, network_layer
from .stream import Window

_LINKS: Final = (ETHERNET, RAW, SLL, SLL2)
_FILE: Final = struct.Struct("<IHHiIII")
_RECORD: Final = struct.Struct("<IIII")
_NANOSECONDS: Final = 0xA1B23C4D
_SEVERAL: Final = 2
"""Frames of PROFIBUS that make bytes without borders a recording."""
_LEAST_IPV4: Final = 20


class HexDumpReader:
    """Frames of a hex dump, in order; as `PcapReader`. `timed` says whether the text has times."""

    dropped: int | None = None
    """No dump says that."""

    def __init__(self, window: Window, encoding: str, link_type: int, timed: bool) -> None:
        self._window = window
        self._pcap = _Pcap(window, encoding, link_type)
        self._reader = PcapReader(Window(self._pcap))
        self.timed = timed
        self.problem: str | None = None

    def read(self) -> Iterator[list[Frame]]:
        """Yield the frames that may matter, some at once; `problem` says which lines are lost."""
        yield from self._reader.read()
        self._end()

    def everything(self, wanted: Callable[[int], bool]) -> Iterator[WholeFrame]:
        """Yield the frames of these numbers as a capture would have them; `problem` as `read`."""
        yield from self._reader.everything(wanted)
        self._end()

    def _end(self) -> None:
        self.problem = self._window.broken or self._pcap.packets.unread.text()

    def watch(self, watches: Sequence[Watch]) -> None:
        """As `PcapReader`."""
        self._reader.watch(watches)

    def tcp(self, ports: Iterable[int]) -> None:
        """As `PcapReader`."""
        self._reader.tcp(ports)

    @property
    def frames(self) -> int:
        """Frames passed so far."""
        return self._reader.frames

    @property
    def first_ns(self) -> int | None:
        """Time of the first frame, None without times."""
        return self._reader.first_ns if self.timed else None

    @property
    def last_ns(self) -> int | None:
        """Time of the last frame that was passed, None without times."""
        return self._reader.last_ns if self.timed else None

    def close(self) -> None:
        """Let go of the file, and of what was read of it."""
        self._reader.close()
        self._window.close()


class _Pcap:
    """The packets of a dump as a pcap: a layer of the stream."""

    def __init__(self, window: Window, encoding: str, link_type: int) -> None:
        self.packets = Packets()
        self._link_type = link_type
        self._time_ns = 0
        self._pieces = self._made(window, encoding)
        self._left = b""

    def readinto(self, room: memoryview, /) -> int:
        """Fill the beginning of `room`; how many bytes, 0 at the end."""
        while not self._left:
            piece = next(self._pieces, None)
            if piece is None:
                return 0
            self._left = piece
        count = min(len(room), len(self._left))
        room[:count] = self._left[:count]
        self._left = self._left[count:]
        return count

    def _made(self, window: Window, encoding: str) -> Iterator[bytes]:
        """The header, and the records that each piece of the text makes whole."""
        yield _FILE.pack(_NANOSECONDS, 2, 4, 0, 0, MAX_FRAME, self._link_type)
        for lines in text.batches(text.chunks(window), encoding):
            yield b"".join(self._records(self.packets.take(lines)))
        yield b"".join(self._records(self.packets.finish()))

    def _records(self, packets: Iterable[Packet]) -> Iterator[bytes]:
        for packet in packets:
            if packet.time_ns is not None:
                self._time_ns = packet.time_ns
            when = divmod(self._time_ns, 1_000_000_000)
            data = bytes(packet.data)
            parts = _telegrams(data) if self._link_type == PROFIBUS_DL else []
            if len(parts) < _SEVERAL:
                yield _RECORD.pack(*when, len(data), packet.original_length) + data
                continue
            for part in parts:
                yield _RECORD.pack(*when, len(part), len(part)) + part


def recognised(window: Window) -> HexDumpReader | None:
    """The reader of what stands in a window; None where it is no dump of frames."""
    head = bytes(window.view[: min(text.LOOKED_AT, window.end)])
    encoding = text.encoding(head)
    if encoding is None:
        return None
    packets = Packets()
    found = [*packets.take(text.lines([head], encoding)), *packets.finish()]
    link_type = _link_type([bytes(each.data) for each in found])
    if link_type is None or packets.unread.count > packets.rows:
        return None
    return HexDumpReader(window, encoding, link_type, packets.timed)


def _link_type(packets: Sequence[bytes]) -> int | None:
    """What the bytes begin with, if any of them show it."""
    if any(decode(each).proved for each in packets if each):
        return PROFIBUS_DL
    for link_type in _LINKS:
        if any(_is_ipv4(each, link_type) for each in packets):
            return link_type
    for link_type in (ETHERNET, SLL, SLL2):
        if any(network_layer(each, 0, len(each), link_type)[0] in ETHER_TYPES for each in packets):
            return link_type
    return PROFIBUS_DL if any(len(_telegrams(each)) >= _SEVERAL for each in packets) else None


def _is_ipv4(data: bytes, link_type: int) -> bool:
    """Whether a header of IPv4 with the right checksum, or none, stands where this link type has it."""
    kind, at = network_layer(data, 0, len(data), link_type)
    if kind != IPV4 or at + _LEAST_IPV4 > len(data):
        return False
    header = data[at : at + (data[at] & 15) * 4]
    if data[at] >> 4 != 4 or len(header) < _LEAST_IPV4:
        return False
    total = sum(int.from_bytes(header[each : each + 2]) for each in range(0, len(header), 2))
    return not any(header[10:12]) or total % 0xFFFF == 0


def _telegrams(data: bytes) -> list[bytes]:
    """The frames of PROFIBUS in bytes without borders; none where fewer than _SEVERAL are proved."""
    pieces = split(data)
    proved = sum(each.telegram.proved for each in pieces)
    return [each.telegram.data for each in pieces] if proved >= _SEVERAL else []
