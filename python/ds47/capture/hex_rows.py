"""Packets of a hex dump that is text: which lines are rows of one, and what the words above it say.

    0000  00 1f f8 00 00 01 00 1c 06 00 00 01 08 00 45 00   ..............E.      `tshark -x`: bytes and their text
    0x0000:  4500 00e4 4700 0000 4011 a794 c0a8 8502  E...G...@.......            `tcpdump -X`: two bytes a group
    000000 00 0e b6 00 00 02 00 0e b6 00 00 01 08 00 45 00 ......                  what text2pcap reads

Offset 0 begins a packet; a row whose offset counts the bytes before it goes on with it. Other lines are words.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from ds47.profibus import listing

from .scan import MAX_FRAME
from .text import UnreadLines

_AROUND: Final = " \t\r\n>"
"""Blanks, and the signs of a quotation."""
_ROW: Final = re.compile(rf"[{_AROUND}]*(?:0x)?([0-9A-Fa-f]{{4,8}}):?(?:[ \t]+|$)(.*)", re.DOTALL)
"""An offset and the rest."""
_GROUP: Final = r"(?:[0-9A-Fa-f]{2})+(?=[\s|]|$)"
_GROUPS: Final = re.compile(rf"{_GROUP}(?:[ \t]{{1,2}}{_GROUP})*")
_DIGITS: Final = re.compile(r"\S+")
_BITS: Final = re.compile(r"\s*[01.]{4}(?: [01.]{4})* = ")
"""A field of bits, as `tshark -V` shows it."""
_SOURCE: Final = re.compile(r"(\S.*) \(\d+ bytes?\):")
"""Wireshark's name above bytes where a packet has several: `Frame (60 bytes):`, `Reassembled TCP (99 bytes):`."""
_FRAME: Final = "Frame"
_SIZES: Final = re.compile(r"(\d{1,9}) bytes on wire[^,]{0,40}, (\d{1,9}) bytes captured")
_EPOCH: Final = re.compile(r"\s*Epoch (?:Arrival )?Time: (?=\d)")
_BEFORE_TIME: Final = re.compile(r"\s*(?:\d+\s+(?=\d)|[IO]\s+)?")
"""The number of a packet in Wireshark's list, or the direction for text2pcap."""
_HALF: Final = 8
"""Bytes behind which some leave two blanks."""
_WITH_TEXT: Final = 256
"""Bytes of a row; longer ones have no text beside them."""
_PRINTED: Final = {code: "." for code in range(256) if not 0x20 <= code < 0x7F}
_WITHOUT_BLANK: Final = {**_PRINTED, 0x20: "."}
"""How bytes look as text; tcpdump prints no blank."""
_MOST_NS: Final = (1 << 32) * 1_000_000_000


class _Row(NamedTuple):
    """A line with an offset."""

    number: int
    line: str
    offset: int
    groups: str
    """The digits that stand behind the offset,"""
    beside: str
    """and what stands behind these."""
    data: bytes
    """Their bytes; text beside them may look like some."""


@dataclass(slots=True)
class _Above:
    """What the words above a packet say of it."""

    time_ns: int | None = None
    epoch: bool = False
    """Whether the time is certain."""
    on_wire: int = 0
    captured: int = 0
    framed: bool = False
    """Whether its bytes are called a frame,"""
    other: bool = False
    """or what Wireshark made of the one before."""

    def read(self, line: str) -> None:
        """One more line."""
        if found := _EPOCH.match(line):
            self._time(line[found.end() :], True)
        elif found := _SIZES.search(line):
            self.on_wire, self.captured = (min(int(each), MAX_FRAME) for each in found.groups())
        elif self.time_ns is None:
            self._time(line[_BEFORE_TIME.match(line).end() :], False)  # type: ignore[union-attr]

    def _time(self, text: str, epoch: bool) -> None:
        time_ns = None if self.epoch else listing.front(text)[0]
        if time_ns is not None and time_ns < _MOST_NS:
            self.time_ns, self.epoch = time_ns, epoch


@dataclass(slots=True)
class Packet:
    """A packet, or what of it was read so far."""

    above: _Above
    data: bytearray = field(default_factory=bytearray)
    row: _Row | None = None
    """The newest row; the offset behind it counts its bytes."""
    width: int = 0
    """The most bytes of a row."""
    end: int = 0
    """How long it is at least, where rows of it are lost."""

    @property
    def time_ns(self) -> int | None:
        """By the clock of whoever made the text: since 1970, since midnight, or since the first packet."""
        return self.above.time_ns

    @property
    def original_length(self) -> int:
        """Its bytes on the wire, as far as the text shows them."""
        return max(len(self.data), self.end, self.above.on_wire)


class Packets:
    """Takes the lines of a dump and gives its packets.

    `unread` are the lines that are lost, `rows` counts those that are not; `timed` says whether there are times.
    """

    def __init__(self) -> None:
        self.unread = UnreadLines()
        self.rows = 0
        self.timed = False
        self._number = 0
        self._packet: Packet | None = None
        self._above = _Above()
        self._behind_row = False

    def take(self, lines: Iterable[str]) -> Iterator[Packet]:
        """The packets that further lines make whole."""
        for line in lines:
            self._number += 1
            row = self._row(line)
            if row is None:
                self._words(line.strip(_AROUND))
                continue
            if row.offset == 0:
                yield from self.finish()
                self._packet = Packet(self._above, row=row)
            elif not self._goes_on(row):
                self.unread.add(row.number, row.line)
                continue
            self.rows += 1
            self._above, self._behind_row = _Above(), True

    def finish(self) -> Iterator[Packet]:
        """The packet of which no more lines come."""
        packet, self._packet = self._packet, None
        if packet is None:
            return
        if (last := packet.row) is not None:
            packet.data += _last(last, packet.width)
            if (
                not packet.end
                and len(packet.data) < packet.above.captured
                and not packet.above.other
            ):
                self.unread.add(last.number, last.line)
        if not packet.above.other:
            self.timed |= packet.time_ns is not None
            yield packet

    def _row(self, line: str) -> _Row | None:
        found = _ROW.match(line)
        if found is None or (" = " in line and _BITS.match(line)):
            return None
        offset, rest = int(found[1], 16), found[2].rstrip()
        groups = _GROUPS.match(rest)
        if groups is None:  # an offset alone ends a packet
            last = None if self._packet is None or rest else self._packet.row
            ends = last is not None and 0 < offset - last.offset <= len(last.data)
            return _Row(self._number, line, offset, "", "", b"") if ends else None
        data, beside = bytes.fromhex(groups[0]), rest[groups.end() :]
        return _Row(self._number, line, offset, groups[0], beside, data[:MAX_FRAME])

    def _goes_on(self, row: _Row) -> bool:
        """Whether a row belongs to the packet; if not, the packet ends before it."""
        packet = self._packet
        if packet is None:
            return False
        last = packet.row
        size = 0 if last is None else row.offset - last.offset
        if (
            last is not None
            and 0 < size <= len(last.data)
            and row.offset + len(row.data) <= MAX_FRAME
        ):
            packet.data += last.data[:size]
            packet.width = max(packet.width, size)
            packet.row = row if row.data else None
            return True
        if last is not None:
            if len(last.data) < packet.width:
                self.unread.add(last.number, last.line)
            packet.data += _last(last, packet.width)
            packet.row = None
        packet.end = min(max(packet.end, row.offset + len(row.data)), MAX_FRAME)
        return False

    def _words(self, line: str) -> None:
        behind_row, self._behind_row = self._behind_row, False
        if not line or line.startswith("#"):
            return
        source = _SOURCE.fullmatch(line)
        if source is None:
            self._above.read(line)
            return
        before = self._packet.above if behind_row and self._packet else None
        self._above.framed = source[1] == _FRAME
        self._above.other = (
            not self._above.framed and before is not None and (before.framed or before.other)
        )


def _last(row: _Row, width: int) -> bytes:
    """The bytes of a row behind which no offset counts them: without their text, which may look like some."""
    if len(row.data) > _WITH_TEXT:
        return row.data
    data, end = bytearray(), 0
    for group in _DIGITS.finditer(row.groups):
        beside = (row.groups[end:] + row.beside).strip()
        apart = group.start() - end > 1 and len(data) != _HALF
        if data and (apart or _spells(beside, data)):
            break
        data += bytes.fromhex(group[0])
        end = group.end()
    return bytes(data[: width or None])


def _spells(beside: str, data: bytearray) -> bool:
    """Whether this is what dumps print beside such bytes."""
    plain = data.decode("latin-1")
    forms = (plain.translate(_PRINTED), plain.translate(_WITHOUT_BLANK))
    return any(beside in (form.strip(), f"|{form}|") for form in forms)
