"""The bytes of a DS47 message, walked block by block: header, addresses, value blocks. Nothing is judged here."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

SIZES = {
    0x01: 1, 0x02: 1, 0x03: 2, 0x04: 4, 0x05: 1, 0x06: 2, 0x07: 4, 0x08: 4, 0x09: 1, 0x0A: 1, 0x0B: 7,
    0x0C: 6, 0x0D: 4, 0x0E: 1, 0x0F: 8, 0x10: 12, 0x11: 7, 0x15: 8, 0x16: 1, 0x17: 2, 0x18: 4, 0x19: 1, 0x1A: 2, 0x1B: 4, 0x1C: 8, 0x1D: 16,
    0x1E: 1, 0x1F: 2, 0x20: 4, 0x21: 8, 0x22: 16, 0x23: 1, 0x24: 2, 0x32: 7, 0x33: 8, 0x34: 4, 0x35: 6, 0x36: 4, 0x37: 8, 0x38: 8,
    0x39: 8, 0x3A: 8, 0x3B: 8, 0x40: 0, 0x41: 1, 0x42: 2, 0x43: 4, 0x44: 2, 0x65: 5, 0x66: 2, 0x67: 3,
    0x68: 2, 0x69: 2, 0x6A: 1, 0x6B: 1, 0x6E: 4, 0x6F: 5, 0x70: 6, 0x71: 2, 0x72: 4, 0x73: 2, 0x74: 2, 0x75: 2,
    0x76: 2, 0x77: 4, 0x78: 2, 0x79: 2, 0x7A: 4, 0x7B: 2, 0x7C: 4,
}  # fmt: skip
"""Bytes per value of the formats that have one size; what is not here ends the walk."""
TWO_SIZES: tuple[dict[int, int], ...] = (
    {}, {0x0D: 6},
    {0x21: 2, 0x22: 4, 0x23: 2, 0x24: 2, 0x25: 2, 0x26: 2, 0x27: 4, 0x28: 2, 0x29: 2, 0x2A: 4, 0x2B: 2, 0x2C: 4},
)  # fmt: skip
"""Other sizes of formats that have two: of the walks with them the first that comes out even counts."""
UNDECIDED: dict[int, int | None] = {code: None for other in TWO_SIZES for code in other}
"""The same where nobody knows whether it comes out even: they end the walk."""
LETTERS = {
    0x01: "B", 0x02: "b", 0x03: "h", 0x04: "i", 0x05: "B", 0x06: "H", 0x07: "I", 0x08: "f", 0x0F: "d",
    0x37: "q", 0x38: "Q", 0x41: "B", 0x42: "H", 0x43: "I", 0x71: "h", 0x72: "i", 0x73: "H",
}  # fmt: skip
"""`struct` letters of the formats whose values are compared with those of the report."""
NAMES = {
    "Boolean": 0x01, "Integer8": 0x02, "Integer16": 0x03, "Integer32": 0x04, "Unsigned8": 0x05,
    "Unsigned16": 0x06, "Unsigned32": 0x07, "Float32": 0x08, "VisibleString": 0x09, "OctetString": 0x0A,
    "TimeOfDay": 0x0C, "Float64": 0x0F, "Integer64": 0x37, "Unsigned64": 0x38, "Zero": 0x40, "Byte": 0x41,
    "Word": 0x42, "DoubleWord": 0x43, "Error": 0x44, "N2": 0x71, "N4": 0x72, "V2": 0x73,
}  # fmt: skip
STRINGS = (0x09, 0x0A, 0x0E, 0x6B)
"""Formats of which a block is one value."""
Sizes = Mapping[int, int | None]
CHANGE = 0x02
CHANGES = (CHANGE, 0x42, 0x52)
READS = (0x01, 0x51)
NEGATIVE = (0x80, 0x81, 0x82, 0xC2, 0xD1, 0xD2)
"""With those of `READS` the response IDs behind which value blocks stand."""
MAKERS = (0x40, 0xC0, 0x41, 0x42, 0xC2, 0x51, 0xD1, 0x52, 0xD2)
"""IDs of makers' own services, of requests and of responses."""
KNOWN = (*CHANGES, *READS, *NEGATIVE)
VALUE, DESCRIPTION = 0x10, 0x20
ERROR = 0x44
ZERO = 0x40


@dataclass
class Address:
    """One parameter address of a request."""

    attribute: int
    elements: int
    pnu: int
    subindex: int
    offset: int


@dataclass
class Block:
    """One value block. `words` are those of an error block."""

    format: int
    count: int
    raw: bytes
    offset: int
    size: int
    """Bytes per value."""
    words: list[int] = field(default_factory=list)

    @property
    def failed(self) -> bool:
        """Whether it is an error block."""
        return self.format == ERROR

    @property
    def code(self) -> int | None:
        """The error number: the whole first word."""
        return self.words[0] if self.failed and self.words else None

    @property
    def info(self) -> int | None:
        """The second error word."""
        return self.words[1] if self.failed and len(self.words) > 1 else None

    def elements(self) -> list[bytes]:
        """The bytes of each value."""
        if not self.size or self.failed:
            return []
        return [self.raw[at : at + self.size] for at in range(0, len(self.raw), self.size)]

    def values(self) -> list[float | int] | None:
        """The values as numbers, None for formats that are not compared."""
        letter = LETTERS.get(self.format)
        if letter is None or len(self.raw) % struct.calcsize(letter):
            return None
        return [each for (each,) in struct.iter_unpack(">" + letter, self.raw)]


@dataclass
class Message:
    """What was walked. `missing`: bytes lacking at the end; `unknown`: a format without a size ended the walk."""

    data: bytes
    addresses: list[Address] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    rest: bytes = b""
    missing: int = 0
    unknown: int | None = None
    pads: list[tuple[int, int | None]] = field(default_factory=list)
    """Offset and value of each pad byte; None where it is not there."""
    asked_for: bool = False
    """Whether it is a request."""

    @property
    def reference(self) -> int | None:
        return self.data[0] if self.data else None

    @property
    def id(self) -> int | None:
        return self.data[1] if len(self.data) > 1 else None

    @property
    def axis(self) -> int | None:
        return self.data[2] if len(self.data) > 2 else None

    @property
    def count(self) -> int | None:
        return self.data[3] if len(self.data) > 3 else None

    @property
    def sound(self) -> bool:
        """Whether it was walked to its end and nothing but zeros is left."""
        return len(self.data) >= 4 and not self.missing and self.unknown is None

    @property
    def changes(self) -> bool:
        return self.id in CHANGES


def request(data: bytes, *, cut: bool = False) -> Message:
    """Walks a request; of one that the capture cut up to what its end would have to tell."""
    if cut:
        return _request(data, UNDECIDED)
    return _first_even([_request(data, other) for other in TWO_SIZES])


def response(data: bytes, *, cut: bool = False) -> Message:
    """Walks a response; the same."""
    if cut:
        return _response(data, UNDECIDED)
    return _first_even([_response(data, other) for other in TWO_SIZES])


def _first_even(walks: list[Message]) -> Message:
    return next((each for each in walks if each.sound and not any(each.rest)), walks[0])


def _request(data: bytes, other: Sizes) -> Message:
    found = Message(data, asked_for=True)
    if len(data) < 4:
        found.missing = 4 - len(data)
        return found
    at = 4
    for _ in range(data[3]):
        if at + 6 > len(data):
            found.missing = 4 + 6 * data[3] - len(data)
            return found
        found.addresses.append(Address(*struct.unpack_from(">BBHH", data, at), at))
        at += 6
    known = found.id in CHANGES or found.id in READS
    _blocks(found, at, data[3] if not known or found.changes else 0, other)
    if known or (found.sound and not any(found.rest)):
        return found
    return Message(data, found.addresses, rest=data[at:], asked_for=True)


def _response(data: bytes, other: Sizes) -> Message:
    found = Message(data)
    if len(data) < 4:
        found.missing = 4 - len(data)
        return found
    if found.id in CHANGES:
        found.rest = data[4:]
        return found
    _blocks(found, 4, data[3], other)
    if found.id in NEGATIVE or found.id in READS or (found.sound and not any(found.rest)):
        return found
    return Message(data, rest=data[4:])  # an unknown ID: nobody knows what stands behind it


def _blocks(found: Message, at: int, count: int, other: Sizes) -> None:
    data = found.data
    for _ in range(count):
        if found.id == 0x80 and at == len(data):
            break
        if at + 2 > len(data):
            found.missing = at + 2 - len(data)
            return
        size = other.get(data[at], SIZES.get(data[at]))
        if size is None:
            found.unknown = at
            found.rest = data[at:]
            return
        length = size * data[at + 1]
        raw = data[at + 2 : at + 2 + length]
        block = Block(data[at], data[at + 1], raw, at, size)
        if block.failed:
            block.words = [word for (word,) in struct.iter_unpack(">H", raw[: len(raw) & ~1])]
        found.blocks.append(block)
        if len(raw) < length:
            found.missing = length - len(raw)
            return
        at += 2 + length
        if length % 2:
            if other is UNDECIDED and any(data[at : at + 1]):
                found.unknown, found.rest = at, data[at:]
                return
            found.pads.append((at, data[at] if at < len(data) else None))
            at += 1
    found.rest = data[at:]
