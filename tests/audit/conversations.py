"""Random conversations: several controllers with one or two drives, and all that goes wrong on the way.

Hypothesis plans a conversation (`plans`): how many controllers and drives, what they use, what the capture loses. One plan makes
one capture, always the same. Bytes of RPC and records come from the lab's writer; who says what is decided here.
Programs of several controllers are mixed frame by frame.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from random import Random
from typing import Any, TypeVar
from uuid import UUID

from tests.audit import drive as drives
from tests.audit.drive import NOT_READY, Drive

from ds47.lab import wire
from ds47.lab.ether import Host

START_NS = 1_767_254_400_000_000_000
MS = 1_000_000
STATUSES = (0xDF80B500, 0xDF80B700, 0xDF80B200, 0xDF80B000, 0xDF80B100, 0xDF80B600, 0xDF80C200)
READ_STATUSES = (0xDE80B000, 0xDE80B200, 0xDE80B600, 0xDE80B700, 0xDE80C200)
INDICES = (47, 47, 0xB02E, 0xB02F)

_T = TypeVar("_T")
Steps = Iterator[None]
"""A program: each step sends one frame, or lets time pass."""


@dataclass
class Tape:
    """What the capture point saw."""

    random: Random
    snap: int | None = None
    now: int = START_NS
    shots: list[tuple[int, bytes, int]] = field(default_factory=list)
    number: int = 0x4700
    loss: float = 0.0
    copies: float = 0.0

    def wait(self, ms: float) -> None:
        """Time passes; a negative number sets the clock back."""
        self.now += int(ms * MS)

    def send(self, source: Host, target: Host, payload: bytes, ports: tuple[int, int]) -> None:
        """A datagram goes past: lost by the capture, seen once or seen twice."""
        self.number = (self.number + 1) & 0xFFFF
        data = _frame(source, target, ports, payload, self.number)
        self.now += self.random.randint(100_000, 2_000_000)
        if self.random.random() < self.loss:
            return
        kept = data if self.snap is None else data[: self.snap]
        self.shots.append((self.now, kept, len(data)))
        if self.random.random() < self.copies:
            self.shots.append((self.now + 20_000, kept, len(data)))

    def write(self, path: Path) -> None:
        """As a pcap file with nanoseconds."""
        parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, 1)]
        for time, data, length in self.shots:
            parts.append(struct.pack("<4I", time // 10**9, time % 10**9, len(data), length) + data)
        path.write_bytes(b"".join(parts))


def _frame(
    source: Host, target: Host, ports: tuple[int, int], payload: bytes, number: int
) -> bytes:
    macs = bytes.fromhex(target.mac.replace(":", "") + source.mac.replace(":", ""))
    ips = bytes(map(int, source.ip.split("."))) + bytes(map(int, target.ip.split(".")))
    head = struct.pack(">BBHHHBBH", 0x45, 0, 28 + len(payload), number, 0, 64, 17, 0)
    udp = struct.pack(">HHHH", *ports, 8 + len(payload), 0)
    return macs + b"\x08\x00" + head + ips + udp + payload


class Requests:
    """What somebody asks of a drive, and how its answers may be bent."""

    random: Random
    drive: Drive
    reference: int
    constant: bool
    """Whether the request reference never changes."""
    newest: dict[wire.RecordId, bytes]
    """The last answer of each channel."""

    def bent(self, answer: bytes) -> bytes:
        """The response, now and then with a fault of the drive, or an old one."""
        random = self.random
        if random.random() > 0.07 or len(answer) < 4:
            return answer
        way = random.randrange(7)
        head = bytearray(answer)
        if way < 3:
            head[way] = (head[way] + 1) & 0xFF
        elif way == 3:
            head[3] = (head[3] + 1) & 0xFF
        elif way == 4:
            head[1] ^= 0x80
        elif way == 5 and self.newest:
            return random.choice(list(self.newest.values()))
        else:
            return bytes(head[: random.randint(1, len(head))])
        return bytes(head)

    def request(self, at: wire.RecordId, change: bool | None = None) -> bytes:
        """A request, right or wrong."""
        random = self.random
        if not self.constant:
            self.reference = self.reference % 255 + 1
        reference = 0 if random.random() < 0.01 else max(1, self.reference)
        change = random.random() < 0.45 if change is None else change
        known = list(self.drive.objects)
        axis = random.choice((*known * 3, 0, 0, 9))
        number = self.drive.object(at.slot, at.index, axis)
        found = self.drive.objects[number if number is not None else known[0]]
        count = 1 if self.drive.single else random.choice((1, 1, 1, 2, 3, 6))
        addresses, blocks = [], []
        for _ in range(count):
            address, block = self._one(found, change)
            addresses.append(address)
            blocks.append(block)
        data = bytes((reference, 2 if change else 1, axis, count)) + b"".join(addresses)
        data += b"".join(blocks) if change else b""
        return self._spoilt(data)

    def _one(self, found: dict[int, drives.Parameter], change: bool) -> tuple[bytes, bytes]:
        random = self.random
        pnu = random.choice(
            (*list(found)[:6] * 3, *drives.NUMBERS, *drives.SPECIAL, 974, 975, 6543)
        )
        known = found.get(pnu)
        subindex = random.choice((0, 0, 0, 1, 2, 7)) if known and known.array else 0
        if pnu == 975:
            subindex = 7
        elements = random.choice((1, 1, 1, 0, 2)) if known and known.array else 1
        if random.random() < 0.03:
            subindex, elements = random.choice(((1, 1), (0, 2), (65535, 3), (0, 235)))
        attribute = 0x10 if change else random.choice((0x10,) * 12 + (0x20, 0x20, 0x30, 0x40))
        if attribute == 0x20 and random.random() < 0.7:
            subindex = 0
        code = known.format if known else 0x06
        if random.random() < 0.12:
            code = random.choice((0x03, 0x06, 0x08, 0x42, 0x43, 0x41))
        values = [drives.bits(random, code) for _ in range(max(1, min(elements, 5)))]
        if random.random() < 0.04:
            values.append(drives.bits(random, code))
        raw = b"".join(values)
        block = bytes((code, len(values))) + raw + bytes(len(raw) % 2)
        return struct.pack(">BBHH", attribute, elements & 0xFF, pnu, subindex), block

    def _spoilt(self, data: bytes) -> bytes:
        random = self.random
        chance = random.random()
        if chance > 0.06:
            return data
        if chance < 0.01:
            return data[: random.randint(1, len(data) - 1)]
        if chance < 0.02:
            return data + random.choice((bytes(2), b"\x12\x34"))
        if chance < 0.03 and len(data) % 2 == 0:
            return b"".join(data[at : at + 2][::-1] for at in range(0, len(data), 2))
        if chance < 0.04:
            return bytes((data[0], random.choice((0, 3, 0x51, 0x7F)))) + data[2:]
        if chance < 0.05:
            return data[:3] + bytes((random.choice((0, data[3] + 1)),)) + data[4:]
        return bytes(each for byte in data for each in (byte, 0))


@dataclass
class User(Requests):
    """One controller's AR with one drive."""

    tape: Tape
    random: Random
    host: Host
    device: Host
    drive: Drive
    ar: UUID
    order: wire.Order
    answers: wire.Order
    sequence: int = 0
    reference: int = 0
    constant: bool = False
    piece: int | None = None
    """Bytes of an RPC fragment; None where nothing is fragmented."""
    pending: dict[wire.RecordId, bytes] = field(default_factory=dict)
    """What the drive holds for a channel."""
    newest: dict[wire.RecordId, bytes] = field(default_factory=dict)

    @property
    def activity(self) -> UUID:
        return UUID(int=self.ar.int ^ (1 << 96))

    # Calls

    def _call(self, operation: int) -> wire.Call:
        call = wire.Call(
            self.activity, self.sequence, operation, wire.object_uuid(0x0501, self.drive.vendor)
        )
        self.sequence += 1
        return call

    def _ask(self, call: wire.Call, blocks: bytes) -> None:
        body = wire.request_body(self.order, blocks)
        ports = self.host.port, self.device.port
        for part in wire.pdus(wire.REQUEST, self.order, call, body, self.piece):
            self.tape.send(self.host, self.device, part, ports)

    def _tell(self, call: wire.Call, status: int, blocks: bytes, kind: int = wire.RESPONSE) -> None:
        body = wire.response_body(self.answers, status, blocks)
        if kind != wire.RESPONSE:
            body = struct.pack(self.answers + "I", status)
        ports = self.device.port, self.host.port
        for part in wire.pdus(kind, self.answers, call, body, self.piece):
            self.tape.send(self.device, self.host, part, ports)

    def write(self, at: wire.RecordId, data: bytes, status: int = 0) -> Steps:
        """A Write, its response, and now and then the request once more, or a fault."""
        call = self._call(wire.WRITE)
        blocks = wire.write_request(call.sequence, at, data)
        self._ask(call, blocks)
        yield
        if self.random.random() < 0.03:
            self.tape.wait(self.random.choice((2, 500)))
            self._ask(call, blocks)
            yield
        if self.random.random() < 0.02:
            kind = self.random.choice((wire.FAULT, wire.REJECT))
            self._tell(call, 0x1C010003, b"", kind)
            yield
            return
        answer = self.drive.answer(at.slot, at.index, data) if not status else None
        if not status and answer is None:
            status = self.random.choice((0xDF80B700, 0xDF80B100))
        self._tell(call, status, wire.write_response(call.sequence, at, 0, status))
        if not status and answer is not None:
            self.pending[at] = answer
        yield

    def store(self, at: wire.RecordId, data: bytes) -> Steps:
        """A Write that the device takes as a value."""
        call = self._call(wire.WRITE)
        self._ask(call, wire.write_request(call.sequence, at, data))
        yield
        self._tell(call, 0, wire.write_response(call.sequence, at, 0, 0))
        yield

    def read(
        self, at: wire.RecordId, data: bytes, status: int = 0, operation: int = wire.READ,
        maximum: int = 4096,
    ) -> Steps:  # fmt: skip
        """A Read and its response."""
        call = self._call(operation)
        self._ask(call, wire.read_request(call.sequence, at, maximum))
        yield
        if self.random.random() < 0.02:
            self._tell(call, 0x1C010003, b"", wire.REJECT)
            yield
            return
        blocks = wire.read_response(call.sequence, at, b"" if status else data[:maximum])
        self._tell(call, status, b"" if status and self.random.random() < 0.3 else blocks)
        yield

    # Programs

    def job(self, at: wire.RecordId, data: bytes | None = None) -> Steps:
        """WRREC, pause, RDREC until it is valid; in most ways in which that can go."""
        random, tape = self.random, self.tape
        data = self.request(at) if data is None else data
        refused = random.choice(STATUSES) if random.random() < 0.06 else 0
        yield from self.write(at, data, refused)
        tape.wait(random.choice((1, 3, 12)))
        if random.random() < (0.5 if refused else 0.08):
            return  # nobody fetches the response
        for _ in range(random.choice((0, 0, 0, 1, 3, 12))):
            yield from self.read(at, b"", NOT_READY)
            tape.wait(random.choice((2, 10, 10, 90)))
        if random.random() < 0.03:
            yield from self.read(at, b"", random.choice(READ_STATUSES))
            return
        if random.random() < 0.03:
            yield from self.read(at, b"")
        if random.random() < 0.02:
            tape.wait(1500)
        held = self.pending.pop(at, None)
        answer = self.bent(held) if held else self.newest.get(at, b"")
        if not answer:
            yield from self.read(at, b"", NOT_READY)
            return
        self.newest[at] = answer
        yield from self.read(
            at, answer, maximum=random.choice((4096,) * 9 + (max(1, len(answer) - 2),))
        )
        if random.random() < 0.08:
            again = random.choice((wire.READ, wire.READ, wire.READ_IMPLICIT))
            where = at
            if again == wire.READ_IMPLICIT:
                where = wire.RecordId(wire.NIL, at.slot, at.subslot, at.index, at.api)
            yield from self.read(where, answer, operation=again)

    def hold(self, at: wire.RecordId) -> Steps:
        """The same change again and again."""
        data = self.request(at, change=True)
        for _ in range(self.random.randint(4, 8)):
            yield from self.job(at, data)
            self.tape.wait(100)

    def multiple(self, at: wire.RecordId) -> Steps:
        """IODWriteMultiple of two requests, each read on its own."""
        places = [at, wire.RecordId(at.ar, 3 - at.slot, at.subslot, at.index, at.api)]
        asked = [self.request(place) for place in places]
        if self.tape.snap is not None:
            return  # what the capture cuts of it nobody can tell
        call = self._call(wire.WRITE)
        outer = wire.RecordId(at.ar, 0xFFFF, 0xFFFF, wire.WRITE_MULTIPLE, 0xFFFFFFFF)
        inner = [
            wire.write_request(n, p, d) for n, (p, d) in enumerate(zip(places, asked, strict=True))
        ]
        body = wire.padded(inner)
        self._ask(call, wire.write_request(call.sequence, outer, body))
        yield
        told = []
        for number, (place, data) in enumerate(zip(places, asked, strict=True)):
            answer = self.drive.answer(place.slot, place.index, data)
            told.append(wire.write_response(number, place, 0, 0 if answer else 0xDF80B700))
            if answer:
                self.pending[place] = answer
        self._tell(
            call, 0, wire.write_response(call.sequence, outer, len(body), 0) + b"".join(told)
        )
        yield
        for place in places:
            if place in self.pending:
                yield from self.read(place, self.pending.pop(place))

    def connect(self, _at: wire.RecordId) -> Steps:
        """The AR is given up, or set up anew."""
        random = self.random
        if random.random() < 0.6:
            call = self._call(wire.RELEASE)
            self._ask(call, wire.release_request(self.ar))
            yield
            self._tell(call, 0, wire.release_response(self.ar))
            self.pending.clear()
            self.newest.clear()
            yield
        call = self._call(wire.CONNECT)
        self._ask(call, wire.ar_request(self.ar, self.host, "plc"))
        yield
        self._tell(call, 0, wire.ar_response(self.ar, self.device))
        yield

    def idle_read(self, at: wire.RecordId) -> Steps:
        """A Read that no request stands behind."""
        yield from self.read(at, b"", NOT_READY)


@dataclass
class Conversation:
    """A capture and the drives that spoke in it."""

    tape: Tape
    drives: dict[str, Drive]


@dataclass(frozen=True)
class Part:
    """One controller's program: the drive that it talks to, and how."""

    drive: int
    order: wire.Order
    answers_alike: bool
    """Whether the drive answers in the byte order that it was asked in."""
    constant: bool
    """Whether the request reference never changes."""
    reference: int
    pieces: bool
    """Whether RPC messages are fragmented."""
    places: int
    """Access points that it uses."""
    jobs: int


@dataclass(frozen=True)
class Plan:
    """What a conversation is made of. What is said in it comes by chance: from the whole plan, with `seed`."""

    seed: int
    drives: int
    loss: float
    """Share of the frames that the capture lost."""
    copies: float
    """Share of the frames that it has twice."""
    snap: int | None
    parts: tuple[Part, ...]
    stores: int = 0
    """Devices that are no drives, and keep values at index 47;"""
    echoes: int = 0
    """and those that keep what looks like requests, where the capture has all that was written."""

    def text(self) -> str:
        """As JSON: what `python -m tests.audit --plan` takes. Without stores it is as it was before there were any."""
        known = asdict(self)
        return json.dumps({k: v for k, v in known.items() if v or k not in ("stores", "echoes")})


def plan(known: dict[str, Any]) -> Plan:
    """A plan from what its JSON says."""
    return Plan(**{**known, "parts": tuple(Part(**each) for each in known["parts"])})


def seldom(random: Random, rare: _T, usual: _T) -> _T:
    """One of ten times something else than the usual."""
    return rare if random.random() < 0.1 else usual


def planned(random: Random) -> Plan:
    """A plan of any kind; the simplest has one program with two jobs."""
    parts = [
        Part(
            drive=random.randint(0, 1),
            order=random.choice("<>"),
            answers_alike=seldom(random, False, True),
            constant=random.random() < 0.5,
            reference=random.randint(0, 250),
            pieces=seldom(random, True, False),
            places=random.randint(1, 3),
            jobs=random.randint(2, 14),
        )
        for _ in range(random.randint(1, 3))
    ]
    return Plan(
        seed=random.getrandbits(24),
        drives=random.randint(1, 2),
        loss=seldom(random, random.choice((0.02, 0.1)), 0.0),
        copies=seldom(random, 0.5, 0.0),
        snap=seldom(random, random.randint(208, 300), None),
        parts=tuple(parts),
        stores=seldom(random, random.randint(1, 2), 0),
        echoes=seldom(random, random.randint(1, 2), 0),
    )


def play(plan: Plan) -> Conversation:
    """The conversation of a plan, always the same."""
    random = Random(plan.text())
    tape = Tape(random, plan.snap, loss=plan.loss, copies=plan.copies)
    known = [drives.make(random, f"192.168.133.{33 + n}") for n in range(plan.drives)]
    running = [
        _program(random, _user(random, tape, number, part, known[part.drive % len(known)]), part)
        for number, part in enumerate(plan.parts)
    ]
    running += [_store(random, tape, number) for number in range(plan.stores)]
    for number in range(0 if plan.loss else plan.echoes):
        running += _echoes(random, tape, number)
    while running:
        each = random.choice(running)
        for _ in range(random.choice((1, 2, 8, 40))):
            if next(each, "over") == "over":
                running.remove(each)
                break
    return Conversation(tape, {each.ip: each for each in known})


def _user(random: Random, tape: Tape, number: int, part: Part, drive: Drive) -> User:
    host = Host(
        f"192.168.133.{2 + number % 2}", f"00:1c:06:00:00:{number:02x}", port=49152 + number
    )
    device = Host(drive.ip, f"00:1f:f8:00:00:{drive.ip[-2:]}", vendor_id=drive.vendor)
    answers: wire.Order = part.order if part.answers_alike else ">" if part.order == "<" else "<"
    ar = UUID(int=random.getrandbits(128))
    user = User(tape, random, host, device, drive, ar, part.order, answers)
    user.constant, user.reference = part.constant, part.reference
    user.piece = 100 if part.pieces and tape.snap is None else None
    return user


def _store(random: Random, tape: Tape, number: int) -> Steps:
    """A device that is no drive: a value at index 47 is written and read, or moves by itself."""
    part = Part(0, random.choice("<>"), True, False, 0, False, 1, 0)
    device = Drive(f"192.168.133.{90 + number}", random.choice((0x0493, 0x0109, 0x001A)))
    user = _user(random, tape, 40 + number, part, device)
    at = wire.RecordId(user.ar, random.choice((0, 1, 2)), 1, 47, 0)
    value = struct.pack(">f", 1.0)
    for _ in range(random.randint(4, 30)):
        way = random.random()
        if way < 0.4:
            value = random.choice(
                (struct.pack(">f", random.uniform(-2000, 2000)), struct.pack(">i", random.randint(-(10**6), 10**6)),
                 random.randbytes(random.choice((1, 2, 4, 8, 20))))
            )  # fmt: skip
            yield from user.store(at, value)
        elif way < 0.5:
            value = random.randbytes(4)  # it moves
        else:
            yield from user.read(at, value)
        tape.wait(random.choice((1, 10, 50)))


def _echoes(random: Random, tape: Tape, number: int) -> list[Steps]:
    """A device that is no drive: each place has what was written there last, by one program or several."""
    part = Part(0, random.choice("<>"), True, False, 0, False, 1, 0)
    device = drives.make(random, f"192.168.133.{80 + number}")
    kept: dict[int, bytes] = {}
    users = [
        _user(random, tape, 60 + 2 * number + each, part, device)
        for each in range(random.choice((1, 1, 2)))
    ]
    return [_echo(random, tape, user, kept) for user in users]


def _echo(random: Random, tape: Tape, user: User, kept: dict[int, bytes]) -> Steps:
    for _ in range(random.randint(2, 12)):
        slot = random.choice((0, 1, 1, 1, 2))
        at = wire.RecordId(user.ar, slot, 1, 47, 0)
        if random.random() < 0.5 or slot not in kept:
            value = random.choice((user.request(at), user.request(at), random.randbytes(8)))
            kept[slot] = value
            yield from user.store(at, value)
        else:
            yield from user.read(at, kept[slot])
        tape.wait(random.choice((1, 10, 50)))
    for slot in [*kept, *kept]:  # of what is never read nobody knows that it is none
        yield from user.read(wire.RecordId(user.ar, slot, 1, 47, 0), kept[slot])


def _program(random: Random, user: User, part: Part) -> Steps:
    """Some jobs, one after the other; between them what else programs do."""
    places = [
        wire.RecordId(
            user.ar, random.choice((1, 2)), 1, random.choice(INDICES), random.choice((0, 0, 0x3A00))
        )
        for _ in range(part.places)
    ]  # fmt: skip
    others: list[Callable[[wire.RecordId], Steps]]
    others = [user.hold, user.multiple, user.connect, user.idle_read]
    for _ in range(part.jobs):
        at = random.choice(places)
        do = random.choice(others) if random.random() < 0.1 else user.job
        yield from do(at)
        pause = random.choice((1, 20, 20, 100, -30 if random.random() < 0.05 else 5))
        if do == user.connect:
            pause = abs(pause)  # no AR is used before it is there
        user.tape.wait(pause)
