"""Conversations of S7 by chance (seeded): what is made of them is in test_s7_by_chance.py.

Clients that read and write the same memories of some servers, in parts, at once, refused and unanswered; BSEND and
USEND; with segments that are lost, doubled, late and out of order, and clocks that jump.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache

import s7_segments as s7

from ds47.analysis import AnalysisOptions
from ds47.s7.choices import Choices

SCENES = 60
MS = 1_000_000
CHOICES = Choices(
    ports=(1102,), blocks=(("", 32),), cpus=(("10.0.0.2", "s7-300-old"),), readback=True
)
"""For every other scene."""


@dataclass
class Line(s7.Talk):
    """A connection that notes in which order all of them speak."""

    number: int = 0
    turns: list[int] = field(default_factory=list)

    def add(self, up: bool, data: bytes, flags: int = s7.PSH | s7.ACK) -> s7.Talk:
        self.turns.append(self.number)
        return super().add(up, data, flags)


@dataclass
class Player:
    """A client with its connection to a server, and what it knows of its own jobs."""

    talk: Line
    chance: random.Random
    pdu: int
    memory: bytearray
    """That of the server, which all of its clients share."""
    calm: bool = False
    """Whether all goes well, so that what was written is known."""
    reference: int = 0
    late: list[tuple[int, bytes]] = field(default_factory=list)
    """Answers that are still to come, and at which step."""
    fellows: list[Player] = field(default_factory=list)
    """Clients of the same server, the player among them."""

    def step(self, now: int) -> None:
        """What the client does now."""
        chance = self.chance
        while self.late and self.late[0][0] <= now:
            self.talk.say(False, s7.dt(self.late.pop(0)[1]))
        todo = (
            self.get,
            self.get,
            self.put,
            self.put,
            self.several,
            self.split,
            self.other,
            self.other,
        )
        chance.choice((self.get, self.put, self.split, self.split) if self.calm else todo)()

    def ask(self, request: bytes, answer: bytes, now: int = 0) -> None:
        """A job, with its answer at once, later, or never."""
        fate = 0.0 if self.calm else self.chance.random()
        self.talk.say(True, s7.dt(request, self.chance.choice((1, 1, 1, 2))))
        if fate < 0.7:
            self.talk.say(False, s7.dt(answer))
        elif fate < 0.9:
            self.late.append((len(self.talk.shots) + self.chance.randrange(8), answer))

    def next(self) -> int:
        self.reference = (self.reference + self.chance.choice((0, 1, 1, 1, 0x100))) & 0xFFFF
        return self.reference

    def area(self) -> tuple[int, int]:
        """Where, and how many bytes."""
        start = self.chance.choice((0, 0, 8, 30, 64))
        return start, self.chance.choice((1, 2, 4, 16, 32, 40))

    def answer(self, code: int, write: bool, *values: bytes) -> bytes:
        reference, chance = self.reference, self.chance
        if chance.random() < 0.05 and not self.calm:
            function = bytes((5 if write else 4, 0))
            return s7.answer(reference, function, error=chance.choice((0x8104, 0x8500, 0xD401)))
        if write:
            return s7.taken(reference, *(code for _ in values or (0,)))
        entries = [s7.entry(each) if code == 0xFF else s7.entry(b"", code) for each in values]
        return s7.got(reference, *entries)

    def code(self) -> int:
        return self.chance.choice((0xFF,) * 12 + (() if self.calm else (0x0A, 5, 3)))

    def stored(self, start: int, count: int) -> bytes:
        """What a read finds; seldom something that nobody wrote."""
        found = bytearray(self.memory[start : start + count])
        if self.chance.random() < 0.1 and not self.calm:
            found[self.chance.randrange(count)] ^= 1
        return bytes(found)

    def get(self) -> None:
        start, count = self.area()
        request = s7.get(self.next(), s7.item(1, 8 * start, count))
        self.ask(request, self.answer(self.code(), False, self.stored(start, count)))

    def put(self) -> None:
        start, count = self.area()
        value, code = self.chance.randbytes(count), self.code()
        area = 0x84 if self.calm else self.chance.choice((0x84, 0x84, 0x84, 0x85, 0x83, 0x82))
        where = s7.item(1, 8 * start, count, area)
        if self.chance.random() < 0.1 and not self.calm:
            where = s7.item(1, 8 * start + 3, 1, size=1)
            value = b"\1"
        if code == 0xFF and area == 0x84 and (self.calm or self.chance.random() < 0.9):
            self.memory[start : start + len(value)] = value
        self.ask(s7.put(self.next(), where, value), self.answer(code, True))

    def several(self) -> None:
        """Several items in one job."""
        areas = [self.area() for _ in range(self.chance.randrange(2, 6))]
        request = s7.get(self.next(), *(s7.item(1, 8 * start, count) for start, count in areas))
        values = [self.stored(start, count) for start, count in areas]
        self.ask(request, self.answer(self.code(), False, *values))

    def split(self) -> None:
        """An area in parts, read or written."""
        write, at = self.chance.random() < 0.5, 0
        most = (
            self.pdu
            - (28 if write else 18)
            + (0 if self.calm else self.chance.choice((0,) * 9 + (40,)))
        )
        for count in (most, self.chance.choice((most, 20))):
            where = s7.item(1, 8 * at, count)
            if write:
                value = self.chance.randbytes(count)
                self.memory[at : at + count] = value
                self.ask(s7.put(self.next(), where, value), self.answer(0xFF, True))
            else:
                answer = self.answer(0xFF, False, bytes(self.memory[at : at + count]))
                self.ask(s7.get(self.next(), where), answer)
            at += count
            if self.chance.random() < 0.6:
                self.chance.choice(self.fellows).border(at)

    def border(self, at: int) -> None:
        """A write, or a read, of bytes around a place at once."""
        start, count = max(0, at - 8), 16
        if self.chance.random() < 0.3:
            where = s7.item(1, 8 * start, count)
            self.ask(
                s7.get(self.next(), where),
                s7.got(self.reference, s7.entry(self.stored(start, count))),
            )
            return
        value = self.chance.randbytes(count)
        self.memory[start : start + count] = value
        request = s7.put(self.next(), s7.item(1, 8 * start, count), value)
        self.talk.say(True, s7.dt(request)).say(False, s7.dt(s7.taken(self.reference, 0xFF)))

    def other(self) -> None:
        """BSEND, USEND, a job of the server, cyclic services, an SZL, another setup, S7CommPlus."""
        chance, reference, r_id = self.chance, self.next(), self.chance.choice((1, 2))
        kind = chance.randrange(9)
        if kind < 3:
            parts = chance.choice((1, 2, 3))
            for number in range(parts):
                data = s7.bsend(
                    reference + number, r_id, chance.randbytes(20), sequence=0 if number == 0 else 7,
                    number=number, last=number == parts - 1 and chance.random() < 0.9,
                    total=20 * parts if chance.random() < 0.9 else 5,
                )  # fmt: skip
                told = s7.received(reference + number, 7, chance.choice((0,) * 9 + (0x8500,)))
                self.ask(data, told)
        elif kind < 5:
            areas = [s7.entry(chance.randbytes(chance.choice((10, 10, 12))), 0) for _ in range(2)]
            front = struct.pack(">I", r_id)
            content = b"\xff\x09" + struct.pack(">H", len(areas)) + s7.filled(*areas)
            self.talk.say(
                True, s7.dt(s7.header(7, reference, b"\0\1\x12\6\x13\0" + front, content))
            )
        elif kind == 5:
            self.talk.say(False, s7.dt(s7.get(reference, s7.item(1, 0, 4))))
            self.talk.say(True, s7.dt(s7.got(reference, s7.entry(b"abcd"))))
        elif kind == 6:
            self.szl(reference)
        elif kind == 7 and chance.random() < 0.2:
            self.talk.say(chance.random() < 0.5, s7.dt(b"\x72\1\0\5hello"))
        elif kind == 8 and chance.random() < 0.2:
            self.ask(s7.setup(reference), s7.agreed(reference, pdu=self.pdu))

    def szl(self, reference: int) -> None:
        """What a CPU says of itself, or a push of cyclic services."""
        order = b"6ES7 315-1AF03-0AB0 ".ljust(20)
        rows = (
            struct.pack(">HHHHH", 0x11, 0, 28, 1, 1) + order + bytes(6),
            struct.pack(">HHHH", 0x131, 3, 40, 1) + struct.pack(">HIH", 3, 0, 240) + bytes(32),
        )
        group = self.chance.choice((0x84, 0x84, 0x02))
        content = self.chance.choice(rows)
        data = b"\xff\x09" + struct.pack(">H", len(content)) + content
        parameter = bytes((0, 1, 0x12, 8, 0x12, group, 1, 1, 0, 0, 0, 0))
        self.talk.say(False, s7.dt(s7.header(7, reference, parameter, data)))


def players(chance: random.Random, calm: bool) -> list[Player]:
    """Some clients of one or two servers."""
    memories: dict[str, bytearray] = {}
    found: list[Player] = []
    turns: list[int] = []
    for number in range(chance.randrange(1, 5)):
        server = (
            chance.choice(("10.0.0.2", "10.0.0.2", "10.0.0.3")),
            chance.choice((102, 102, 1102)),
        )
        client = (f"10.0.1.{chance.choice((1, 1, 2))}", 49152 + number)
        memory = memories.setdefault(server[0], bytearray(chance.randbytes(1000)))
        pdu = chance.choice((240, 480))
        talk = Line(
            client, server, [], chance.choice((1000, 0xFFFFFFF0)), number=number, turns=turns
        )
        if calm or chance.random() < 0.85:
            talk.opened(pdu=pdu if calm or chance.random() < 0.9 else None)
        elif chance.random() < 0.5:
            talk.add(True, b"", s7.SYN)
            talk.say(True, s7.connect(server="0302"))
            if chance.random() < 0.7:
                talk.add(False, b"", s7.RST)
        found.append(Player(talk, chance, pdu, memory, calm))
    for each in found:
        each.fellows = [other for other in found if other.memory is each.memory]
    return found


def disturbed(shots: list[s7.Shot], chance: random.Random) -> list[s7.Shot]:
    """Segments of a connection, some lost, doubled, late, out of order, or damaged."""
    much = chance.choice((0, 0, 0, 0.02, 0.1))
    found: list[s7.Shot] = []
    for each in shots:
        fate = chance.randrange(5) if chance.random() < much else None
        if fate == 0:
            continue
        if fate == 1 and found:
            found.insert(len(found) - 1, each)
        elif fate == 2:
            found += [each, each]
        elif fate == 3 and each.data:
            at = chance.randrange(len(each.data))
            changed = each.data[:at] + chance.randbytes(1) + each.data[at + 1 :]
            found.append(replace(each, data=changed))
        else:
            found.append(each)
    return found


def scene(seed: int) -> Iterator[tuple[int, bytes]]:
    """Times and frames of clients and servers."""
    chance = random.Random(seed)
    calm = seed % 3 == 0
    open_now = players(chance, calm)
    for now in range(chance.randrange(10, 60)):
        chance.choice(open_now).step(now)
    for own in open_now:
        if chance.random() < 0.5:
            own.talk.closed()
    queues = [each.talk.shots if calm else disturbed(each.talk.shots, chance) for each in open_now]
    turns, time_ns = open_now[0].talk.turns, 0
    for turn in (*turns, *(n for n, queue in enumerate(queues) for _ in queue)):
        many = 1 if calm else chance.choice((1, 1, 1, 2))
        for shot in queues[turn][:many]:
            time_ns += chance.choice(
                (10_000, MS, 3 * MS, 400 * MS) if calm or chance.random() < 0.95 else (11_000 * MS,)
            )
            if chance.random() < 0.003:
                time_ns = max(0, time_ns - chance.choice((MS, 5_000 * MS)))
            yield time_ns, open_now[turn].talk.frame(shot)
        del queues[turn][:many]


def content(seed: int) -> bytes:
    """A scene as a capture with nanoseconds."""
    found = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1)]
    for time_ns, data in scene(seed):
        seconds, nanoseconds = divmod(time_ns, 10**9)
        found += [struct.pack("<4I", 1000 + seconds, nanoseconds, len(data), len(data)), data]
    return b"".join(found)


@cache
def scenes() -> list[tuple[bytes, AnalysisOptions]]:
    """Captures, each with the choices for it."""
    chosen = (AnalysisOptions(), AnalysisOptions(s7=CHOICES))
    return [(content(seed), chosen[seed % 2]) for seed in range(SCENES)]
