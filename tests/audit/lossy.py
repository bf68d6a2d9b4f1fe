"""Random conversations over a wire that loses, doubles and delays datagrams, recorded near the controllers and near the drive.

Clients repeat a call until it is answered, or ask once; the drive answers a repeated call from its cache, or executes it
again. What they did and got is the truth, whatever either recording shows (`told`): not what was recorded.
"""

from __future__ import annotations

import heapq
import json
import struct
from collections.abc import Callable, Generator, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from random import Random
from typing import Any
from uuid import UUID

from tests.audit import drive as drives
from tests.audit.conversations import MS, START_NS, Requests, Tape, seldom
from tests.audit.drive import NOT_READY, Drive

from ds47.lab import wire
from ds47.lab.ether import Host

BUSY, SHORT, REFUSED = 0xDF80B500, 0xDE80B100, 0xDF80B700
INDICES = ((0xB02E, 0), (0xB02F, 0), (47, 0x3A00))
REPEATED_MS, TRIES = 100, 8
PROGRAM = Generator["Asked | float", "Answer | None", None]


@dataclass(frozen=True)
class Plan:
    """What the wire does, and who speaks over it. All else comes by chance: from the whole plan, with `seed`."""

    seed: int
    lost: float
    """Share of the datagrams that the wire loses,"""
    double: float
    """that it delivers twice,"""
    late: float
    """and that it delays,"""
    delay: int
    """by at most so many ms."""
    mtu: int | None
    """Bytes of an IP fragment's data; None where all fit."""
    repeats: bool
    """Whether clients repeat a call until it is answered."""
    cache: bool
    """Whether the drive answers a repeated call as before; else it executes it again."""
    keeps: bool
    """Whether a response can be read again."""
    short: float
    """Share of the Reads that leave too little room."""
    clients: int
    jobs: int
    waits: int = REPEATED_MS
    """How many ms a client that asks once waits for its answer."""

    def text(self) -> str:
        """As JSON: what `python -m tests.audit --plan` takes. Without what was not there in older plans."""
        known = asdict(self)
        if self.waits == REPEATED_MS:
            del known["waits"]
        return json.dumps(known)


def plan(known: dict[str, Any]) -> Plan:
    """A plan from what its JSON says."""
    return Plan(**known)


def planned(random: Random) -> Plan:
    """A plan of any kind. A client that asks once gets no answer behind its next call: who has it then nobody knows."""
    repeats = random.random() < 0.7
    waits = REPEATED_MS if repeats else random.choice((REPEATED_MS, 1_000, 5_000))
    return Plan(
        seed=random.getrandbits(24),
        lost=random.choice((0.0, 0.02, 0.05, 0.15)),
        double=random.choice((0.0, 0.03, 0.1)),
        late=random.choice((0.0, 0.05, 0.1, 0.3)),
        delay=random.choice((30, 60, 300) if repeats or waits > REPEATED_MS else (10, 25)),
        mtu=seldom(random, 128, None),
        repeats=repeats,
        cache=random.random() < 0.6,
        keeps=random.random() < 0.5,
        short=seldom(random, 0.3, 0.0),
        clients=random.randint(1, 2),
        jobs=random.randint(3, 20),
        waits=waits,
    )


@dataclass(frozen=True)
class Answer:
    """What a drive says to a record call."""

    status: int
    data: bytes = b""
    to: bytes | None = None
    """The request that the data is the response to."""


@dataclass
class Asked:
    """One call of a client."""

    sequence: int
    operation: int
    at: wire.RecordId
    data: bytes = b""
    """What is written."""
    room: int = 4096
    """How many bytes a Read leaves for the record."""
    got: Answer | None = None
    """What the client got."""
    said: list[Answer] = field(default_factory=list)
    """What the drive said to it, in its order."""


@dataclass
class Job:
    """A Write and the Reads for it, as the client sees them."""

    client: str
    write: Asked
    reads: list[Asked] = field(default_factory=list)

    @property
    def calls(self) -> list[Asked]:
        return [self.write, *self.reads]

    @property
    def sure(self) -> bool:
        """Whether the client got an answer to each call."""
        return all(each.got is not None for each in self.calls)

    @property
    def response(self) -> bytes | None:
        """What was read of it, without what came too short."""
        there = (each.got.data for each in self.reads if each.got and not each.got.status)
        return next(there, None)

    @property
    def known(self) -> list[int]:
        """What its Reads were answered."""
        return [each.got.status for each in self.reads if each.got]

    @property
    def ended_short(self) -> bool:
        """Whether its response was longer than what its Reads asked for, and none brought it."""
        return self.response is None and SHORT in self.known

    @property
    def polls(self) -> int:
        """Reads that left it open: it was not ready, or longer than what they asked for, but for the one that ended it."""
        return sum(each in (NOT_READY, SHORT) for each in self.known) - self.ended_short


Label = tuple[str, int, bool]
"""Of a frame: the client, the number of its call, and whether it holds a request."""


class Tap(Tape):
    """One of the two ends: what is recorded there, and of which call each frame is."""

    def __init__(self, random: Random) -> None:
        super().__init__(random)
        self.labels: list[Label] = []
        self.whole: set[Label] = set()
        """Calls of which a whole datagram was there."""

    def saw(self, now: int, frame: bytes, label: Label) -> None:
        self.shots.append((now, frame, len(frame)))
        self.labels.append(label)


class World:
    """Time, the wire between the two taps, and what happens next."""

    def __init__(self, plan: Plan) -> None:
        self.plan, self.random = plan, Random(plan.text())
        self.near, self.far = Tap(self.random), Tap(self.random)
        self.now, self._number, self._order = START_NS, 0x2000, 0
        self._queue: list[tuple[int, int, Callable[[], None]]] = []

    def later(self, ms: float, what: Callable[[], None]) -> None:
        self._order += 1
        heapq.heappush(self._queue, (self.now + int(ms * MS), self._order, what))

    def run(self) -> None:
        while self._queue:
            self.now, _, what = heapq.heappop(self._queue)
            what()

    def send(
        self, source: Host, target: Host, payload: bytes, label: Label, then: Callable[[], None]
    ) -> None:
        """A datagram, or its fragments one by one, from one tap to the other; `then` is what arriving does."""
        here, there = (self.near, self.far) if label[2] else (self.far, self.near)
        self._number = (self._number + 1) & 0xFFFF
        here.whole.add(label)
        frames = list(_frames(source, target, payload, self._number, self.plan.mtu))
        open_ones: set[int] = set()
        for number, frame in enumerate(frames):
            here.saw(self.now, frame, label)
            for ms in self._times():
                there_now = partial(
                    self._arrive, there, frame, label, open_ones, number, len(frames), then
                )
                self.later(ms, there_now)

    def _times(self) -> Iterator[float]:
        """When a frame comes out of the wire, in ms: never, once or twice."""
        plan, random = self.plan, self.random
        if random.random() < plan.lost:
            return
        late = random.uniform(0, plan.delay) if random.random() < plan.late else 0
        yield (first := random.uniform(0.1, 0.4) + late)
        if random.random() < plan.double:
            yield first + random.uniform(0.3, plan.delay)

    def _arrive(
        self, there: Tap, frame: bytes, label: Label, seen: set[int], number: int, of: int,
        then: Callable[[], None],
    ) -> None:  # fmt: skip
        there.saw(self.now, frame, label)
        seen.add(number)
        if len(seen) == of:
            seen.clear()
            there.whole.add(label)
            then()


def _frames(
    source: Host, target: Host, payload: bytes, number: int, mtu: int | None
) -> Iterator[bytes]:
    macs = bytes.fromhex(target.mac.replace(":", "") + source.mac.replace(":", ""))
    ips = bytes(map(int, source.ip.split("."))) + bytes(map(int, target.ip.split(".")))
    data = struct.pack(">HHHH", source.port, target.port, 8 + len(payload), 0) + payload
    size = mtu or len(data)
    for start in range(0, len(data), size):
        piece = data[start : start + size]
        offset = start // 8 | (0x2000 if start + size < len(data) else 0)
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(piece), number, offset, 64, 17, 0)
        yield macs + b"\x08\x00" + head + ips + piece


class Device:
    """The drive, and one place for a response on each channel."""

    def __init__(self, world: World, drive: Drive) -> None:
        self.world, self.drive = world, drive
        self.held: dict[wire.RecordId, tuple[int, Answer]] = {}
        """When the response of a channel is ready, and what it is."""
        self.latest: dict[str, tuple[int, Answer]] = {}

    def got(self, client: Client, asked: Asked) -> None:
        """A request came, perhaps once more."""
        plan, (newest, known) = self.world.plan, self.latest.get(client.host.ip, (-1, None))
        if plan.cache and asked.sequence < newest:
            return
        if not (plan.cache and asked.sequence == newest and known):
            known = self._answer(asked)
            self.latest[client.host.ip] = asked.sequence, known
        asked.said.append(known)
        self.world.later(self.world.random.uniform(0.3, 3), partial(client.answer, asked, known))

    def _answer(self, asked: Asked) -> Answer:
        world, at = self.world, asked.at
        if asked.operation in (wire.CONNECT, wire.RELEASE):
            return Answer(0)
        if asked.operation == wire.WRITE:
            if at in self.held and self.held[at][0] > world.now:
                return Answer(BUSY)
            answer = self.drive.answer(at.slot, at.index, asked.data)
            if answer is None:
                return Answer(REFUSED)
            ready = world.now + int(world.random.choice((0, 5, 30)) * MS)
            self.held[at] = ready, Answer(0, answer, asked.data)
            return Answer(0)
        ready, held = self.held.get(at, (0, None))
        if held is None or ready > world.now:
            return Answer(NOT_READY)
        if len(held.data) > asked.room:
            return Answer(SHORT)
        if not world.plan.keeps:
            del self.held[at]
        return held


class Client(Requests):
    """One controller: its jobs one after the other, each call until it is answered or given up."""

    def __init__(self, world: World, number: int, device: Device) -> None:
        self.world, self.random, self.device = world, world.random, device
        self.drive, self.reference = device.drive, self.random.randint(0, 250)
        self.constant, self.newest = self.random.random() < 0.2, {}
        self.host = Host(f"192.168.133.{2 + number}", f"00:1c:06:00:00:{number:02x}", port=49152)
        self.peer = Host(self.drive.ip, "00:1f:f8:00:00:33", vendor_id=self.drive.vendor)
        self.ar = UUID(int=self.random.getrandbits(128))
        self.order: wire.Order = self.random.choice(("<", ">"))
        self.sequence, self.open = 0, None
        self.jobs: list[Job] = []
        self.program = self._program()
        world.later(self.random.uniform(0, 20), self.go_on)

    # What comes in and goes out

    def go_on(self, answer: Answer | None = None) -> None:
        """The program runs to its next call or pause."""
        try:
            step = next(self.program) if answer is None else self.program.send(answer)
        except StopIteration:
            return
        if isinstance(step, float):
            self.world.later(step, self.go_on)
        else:
            self.open = step
            self._ask(step, TRIES if self.world.plan.repeats else 1)

    def _ask(self, asked: Asked, tries: int) -> None:
        if self.open is not asked:
            return
        if not tries:
            self.open = None
            self.go_on()
            return
        payload = self._pdu(wire.REQUEST, asked, wire.request_body(self.order, self._asks(asked)))
        label = self.host.ip, asked.sequence, True
        self.world.send(self.host, self.peer, payload, label, partial(self.device.got, self, asked))
        pause = REPEATED_MS if self.world.plan.repeats else self.world.plan.waits
        self.world.later(pause, partial(self._ask, asked, tries - 1))

    def answer(self, asked: Asked, answer: Answer) -> None:
        """The drive's datagram to this client."""
        body = wire.response_body(self.order, answer.status, self._says(asked, answer))
        payload = self._pdu(wire.RESPONSE, asked, body)
        label = self.host.ip, asked.sequence, False
        self.world.send(self.peer, self.host, payload, label, partial(self._got, asked, answer))

    def _got(self, asked: Asked, answer: Answer) -> None:
        if self.open is asked:
            self.open, asked.got = None, answer
            self.go_on(answer)

    def _pdu(self, kind: int, asked: Asked, body: bytes) -> bytes:
        target = wire.object_uuid(0x0501, self.drive.vendor)
        activity = UUID(int=self.ar.int ^ (1 << 96))
        call = wire.Call(activity, asked.sequence, asked.operation, target)
        return wire.pdu(kind, self.order, call, body)

    def _asks(self, asked: Asked) -> bytes:
        if asked.operation == wire.CONNECT:
            return wire.ar_request(self.ar, self.host, "plc")
        if asked.operation == wire.RELEASE:
            return wire.release_request(self.ar)
        if asked.operation == wire.WRITE:
            return wire.write_request(asked.sequence, asked.at, asked.data)
        return wire.read_request(asked.sequence, asked.at, asked.room)

    def _says(self, asked: Asked, answer: Answer) -> bytes:
        if asked.operation == wire.CONNECT:
            return wire.ar_response(self.ar, self.peer)
        if asked.operation == wire.RELEASE:
            return wire.release_response(self.ar)
        if asked.operation == wire.WRITE:
            return wire.write_response(asked.sequence, asked.at, 0, answer.status)
        return wire.read_response(asked.sequence, asked.at, answer.data)

    # What it does

    def _call(
        self, operation: int, at: wire.RecordId, data: bytes = b"", room: int = 4096
    ) -> Asked:
        self.sequence += 1
        return Asked(self.sequence, operation, at, data, room)

    def _program(self) -> PROGRAM:
        random = self.random
        places = [
            wire.RecordId(self.ar, random.choice((1, 2)), 1, index, api)
            for index, api in random.sample(INDICES, random.randint(1, 3))
        ]
        yield self._call(wire.CONNECT, places[0])
        for _ in range(self.world.plan.jobs):
            at = random.choice(places)
            data = self.request(at)
            for _ in range(4):
                if not (yield from self._job(at, data)):
                    break
            yield float(random.choice((1, 5, 20, 60)))
        yield self._call(wire.RELEASE, places[0])

    def _job(self, at: wire.RecordId, data: bytes) -> Generator[Asked | float, Answer | None, bool]:
        """A Write, and Reads until one brings the response; says whether to try that again."""
        random = self.random
        job = Job(self.host.ip, self._call(wire.WRITE, at, data))
        self.jobs.append(job)
        got = yield job.write
        if got is None and (way := random.choice(("again", "read", "no more"))) != "read":
            return way == "again"
        if got is not None and got.status:
            yield 15.0
            return got.status == BUSY
        yield float(random.choice((1, 6, 12)))
        for _ in range(12):
            room = random.randint(4, 8) if random.random() < self.world.plan.short else 4096
            read = self._call(wire.READ, at, room=room)
            job.reads.append(read)
            got = yield read
            if got is None and random.random() < 0.5:
                return random.random() < 0.5
            if got is not None and got.status == SHORT:
                job.reads.append(read := self._call(wire.READ, at))
                got = yield read
            if got is not None and not got.status:
                return False
            yield 10.0
        return False


@dataclass
class Conversation:
    """What went over the wire, as it was recorded at its two ends."""

    plan: Plan
    near: Tap
    far: Tap
    jobs: list[Job]
    drives: dict[str, Drive]

    @property
    def tape(self) -> Tap:
        """The one near the controllers."""
        return self.near

    @property
    def tapes(self) -> tuple[Tap, Tap]:
        return self.near, self.far


def play(plan: Plan) -> Conversation:
    """The conversation of a plan, always the same."""
    world = World(plan)
    device = Device(world, drives.make(world.random, "192.168.133.33"))
    clients = [Client(world, number, device) for number in range(plan.clients)]
    world.run()
    jobs = [job for each in clients for job in each.jobs]
    return Conversation(plan, world.near, world.far, jobs, {device.drive.ip: device.drive})
