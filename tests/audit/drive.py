"""A simulated drive with a mind of its own: drive objects, parameters with formats, limits and errors.

It answers any request by the profile's rules, so that it can be asked again: would it take this?
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from random import Random

from tests.audit import message
from tests.audit.memory import LOCAL

SIZES = {1: (0x41, 0x02, 0x05), 2: (0x42, 0x03, 0x06), 4: (0x43, 0x04, 0x07, 0x08)}
FORMATS = (0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x0F, 0x37, 0x71)
NUMBERS = (21, 100, 1082, 1120, 1121, 2900, 2902, 40005)
SPECIAL = (10, 15, 340, 970, 971, 976, 977)
NOT_READY = 0xDE80B500


@dataclass
class Parameter:
    """One parameter of a drive object."""

    format: int
    values: list[bytes]
    array: bool = False
    refuses: int | None = None
    """The error number with which every change is answered."""
    most: float | None = None
    stubborn: bool = False
    """Whether it keeps another value than the one written, and says nothing."""

    @property
    def size(self) -> int:
        return message.SIZES[self.format]


@dataclass
class Drive:
    """A device: its drive objects by number, which slot reaches which of them, and whether the axis counts."""

    ip: str
    vendor: int
    objects: dict[int, dict[int, Parameter]] = field(default_factory=dict)
    slots: dict[int, int] = field(default_factory=dict)
    heeds: bool = True
    longest: int = 240
    single: bool = False
    """Whether it knows only requests for one parameter, and answers others with 0x80."""

    def object(self, slot: int, index: int, axis: int) -> int | None:
        """The drive object that is reached; None where there is none."""
        own = self.slots.get(slot)
        if index == LOCAL or not self.heeds or axis == 0:
            return own
        return axis if axis in self.objects else None

    def answer(self, slot: int, index: int, data: bytes) -> bytes | None:
        """The response to a request, None where the Write itself would be refused."""
        asked = message.request(data)
        if len(data) < 4 or asked.count == 0 or asked.missing or asked.unknown is not None:
            return None
        if asked.id not in (1, 2):
            return bytes((data[0], 0x80, data[2], 1)) + _error(0x21, 0)
        if asked.id == 2 and len(asked.blocks) < len(asked.addresses):
            return None
        number = self.object(slot, index, data[2])
        blocks = []
        for place, address in enumerate(asked.addresses):
            value = asked.blocks[place] if asked.id == 2 else None
            if number is None:
                blocks.append(_error(0x19, 0))
            elif value is None:
                blocks.append(self._read(self.objects[number], address))
            else:
                blocks.append(self._change(self.objects[number], address, value))
        failed = any(block[0] == message.ERROR for block in blocks)
        if asked.id == 2 and not failed:
            return bytes((data[0], 2, data[2], data[3]))
        if asked.id == 1:
            blocks = self._fit(blocks)
            failed = any(block[0] == message.ERROR for block in blocks)
        head = bytes((data[0], asked.id | (0x80 if failed else 0), data[2], len(blocks)))
        return head + b"".join(blocks)

    def _fit(self, blocks: list[bytes]) -> list[bytes]:
        """What does not find room is answered with 0x15."""
        room, kept = self.longest - 4, []
        for block in blocks:
            kept.append(block if len(block) <= room else _error(0x15, 0))
            room -= len(kept[-1])
        return kept

    def _read(self, found: dict[int, Parameter], address: message.Address) -> bytes:
        known = found.get(address.pnu)
        if known is None:
            return _error(0x00, 0)
        if address.attribute == 0x30:
            return _error(0x0F, 0)
        if address.attribute == message.DESCRIPTION:
            return _described(address, known.format)
        if address.attribute != message.VALUE:
            return _error(0x16, 0)
        wrong = _wrong_place(known, address)
        if wrong is not None:
            return _error(wrong, address.subindex if wrong == 3 else 0)
        count = max(1, address.elements)
        return _block(known.format, known.values[address.subindex : address.subindex + count])

    def _change(
        self, found: dict[int, Parameter], address: message.Address, value: message.Block
    ) -> bytes:
        known = found.get(address.pnu)
        if known is None:
            return _error(0x00, 0)
        wrong = _wrong_place(known, address)
        if wrong is not None:
            return _error(wrong, address.subindex if wrong == 3 else 0)
        if value.count != max(1, address.elements):
            return _error(0x18, 0)
        if value.format != known.format and value.format not in SIZES.get(known.size, ())[:1]:
            return _error(0x05 if value.size == known.size else 0x17, 0)
        if known.refuses is not None:
            return _error(known.refuses, address.subindex)
        numbers = message.Block(known.format, value.count, value.raw, 0, known.size).values() or []
        if known.most is not None and any(not abs(each) <= known.most for each in numbers):
            return _error(0x02, address.subindex)
        for at, bits in enumerate(value.elements(), address.subindex):
            known.values[at] = bits[:-1] + bytes((bits[-1] ^ 1,)) if known.stubborn else bits
        return bytes((message.ZERO, 0))


def _wrong_place(known: Parameter, address: message.Address) -> int | None:
    if not known.array and (address.subindex or address.elements > 1):
        return 0x04
    if address.subindex + max(1, address.elements) > len(known.values):
        return 0x03
    return None


def _described(address: message.Address, code: int) -> bytes:
    """All of a description, or its name: every third parameter has none. Times in steps of 10 ms, if they are whole."""
    if not address.pnu % 3:
        return _error(0x09, 0)
    name = f"Parameter {address.pnu}".encode().ljust(16)
    head = struct.pack(
        ">HHfBb4x", code, 0, 1.0, 4 if address.pnu % 2 else 0, -2 if address.pnu % 2 else 0
    )
    parts = {0: (0x0A, head + name + bytes(16)), 1: (0x42, head[:2]), 6: (0x09, name)}
    if address.subindex not in parts:
        return _error(0x03, address.subindex)
    kind, raw = parts[address.subindex]
    return bytes((kind, len(raw) // message.SIZES[kind])) + raw


def _error(code: int, info: int) -> bytes:
    return struct.pack(">BBHH", message.ERROR, 2, code, info)


def _block(code: int, values: list[bytes]) -> bytes:
    raw = b"".join(values)
    return bytes((code, len(values))) + raw + bytes(len(raw) % 2)


def bits(random: Random, code: int) -> bytes:
    """A value that somebody may have typed, under a format."""
    letter = message.LETTERS[code]
    if letter in "fd":
        return struct.pack(">" + letter, random.choice((0.0, 1.0, 9.5, 10.0, -2.5, 1500.0, 344.15)))
    if letter in "bhiq":
        return struct.pack(">" + letter, random.choice((0, 1, -1, 7, 100, -100)))
    return struct.pack(">" + letter, random.choice((0, 1, 2, 7, 100, 200)))


def make(random: Random, ip: str) -> Drive:
    """A drive of one to three drive objects."""
    vendor = random.choice((0x002A, 0x002A, 0x0493, 0x001A, 0x010A))
    made = Drive(ip, vendor, heeds=random.random() < 0.7, single=random.random() < 0.05)
    made.longest = random.choice((240, 240, 240, 60, 600))
    numbers = random.sample((1, 2, 3, 5), random.randint(1, 3))
    for number in numbers:
        made.objects[number] = {pnu: _parameter(random) for pnu in NUMBERS if random.random() < 0.9}
        for pnu in SPECIAL:
            made.objects[number][pnu] = Parameter(0x06, [bytes(2)], most=None)
        ids = [bytes(2)] * 7 + [struct.pack(">H", number)]
        made.objects[number][975] = Parameter(0x06, ids, True, 0x01)
        limits = [struct.pack(">H", made.longest), b"\0\x27", b"\0\x64"]
        made.objects[number][974] = Parameter(0x06, limits, True, 0x01)
    for slot in (1, 2):
        made.slots[slot] = random.choice(numbers)
    return made


def _parameter(random: Random) -> Parameter:
    code, array = random.choice(FORMATS), random.random() < 0.4
    values = [bits(random, code) for _ in range(random.randint(2, 5) if array else 1)]
    refuses = None
    if random.random() < 0.3:
        refuses = random.choice(
            (
                0x01,
                0x06,
                0x0B,
                0x11,
                0x14,
                0x6B,
                0x6E,
                0x70,
                0x83,
                0x84,
                *range(0x19),
                *range(0x1A, 256),
            )
        )
    most = 1000.0 if random.random() < 0.4 else None
    return Parameter(code, values, array, refuses, most, random.random() < 0.12)
