"""Random lines of PROFIBUS: masters and stations, and all that goes wrong between them and in the recording.

Hypothesis plans a line (`plans`), as `conversations` does it for PROFINET; one plan makes one capture. Frames are
built byte by byte: no encoder of `ds47` has a part in it. Who says what is decided here, what it means is not.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from random import Random

from tests.audit import drive as drives
from tests.audit.conversations import START_NS, Requests, seldom
from tests.audit.drive import Drive

from ds47.lab import wire

US = 1_000
SHORT = b"\xe5"
LINK, OWN = 257, 147
DIAGNOSIS, PARAMETERS, CONFIGURATION, GET_CONFIGURATION, CONTROL = 60, 61, 62, 59, 58
MS1 = 51
RS = 3
REFUSED = (0xB000, 0xB200, 0xB600, 0xB700, 0xC200, 0xB100)
CONFIGURATIONS = (
    "f3f1", "f3f1", "f3f1", "73f1", "f3f5", "f1", "f5", "f3f9", "00f3f1", "c0c7c7f1", "71f1", "c0c3c3c1c1",
    "13", "2f1f", "e1d1", "f0f0", "43c001", "c2",
)  # fmt: skip
"""Chk_Cfg: PPO1 to PPO5, with PKW that is consistent or not, in special identifiers, with empty slots; and others."""

Steps = Iterator[None]
"""A program: each step is one turn of a master, with its answer."""


def frame(to: int, of: int, fc: int, du: bytes = b"", saps: tuple[int, int] | None = None) -> bytes:
    """SD1 without data, else SD2."""
    more = 0x80 if saps else 0
    body = bytes((to | more, of | more, fc)) + bytes(saps or ()) + du
    end = bytes((sum(body) & 0xFF, 0x16))
    if len(body) == 3:
        return b"\x10" + body + end
    return bytes((0x68, len(body), len(body), 0x68)) + body + end


@dataclass
class Tape:
    """What the recorder saw."""

    random: Random
    plan: Plan
    now: int = START_NS
    shots: list[tuple[int, bytes, int]] = field(default_factory=list)
    sent: int = 0

    def put(self, data: bytes) -> None:
        """A frame goes past: lost by the recorder, misread, cut, seen once or twice."""
        random, plan = self.random, self.plan
        self.now += random.choice((20, 60, 100, 300)) * US
        self.sent += 1
        if self.sent <= plan.late or (not plan.doubled and random.random() < plan.loss):
            return
        if not plan.doubled and random.random() < plan.noise:
            data = spoilt(data, random)
        kept = data if plan.snap is None else data[: plan.snap]
        self.shots.append((self.now, kept, len(data)))
        if plan.doubled:
            self.shots.append((self.now + 3 * US, kept, len(data)))

    def wait(self, microseconds: float) -> None:
        """Time passes; a negative number sets the clock back."""
        self.now += int(microseconds * US)

    def write(self, path: Path) -> None:
        """As a pcap file with nanoseconds."""
        parts = [struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, self.plan.link)]
        for time, data, length in self.shots:
            parts.append(struct.pack("<4I", time // 10**9, time % 10**9, len(data), length) + data)
        path.write_bytes(b"".join(parts))


def spoilt(data: bytes, random: Random) -> bytes:
    """One byte is another one, or the end is missing, or there is too much."""
    way = random.random()
    if way < 0.1:
        return data[: random.randrange(len(data))] or b"\x00"
    if way < 0.2:
        return data + bytes((random.randrange(256),))
    at = random.randrange(len(data))
    return data[:at] + bytes((data[at] ^ 1 << random.randrange(8),)) + data[at + 1 :]


# Stations


@dataclass
class Slave(Requests):
    """A station with its drive, and what it holds for whom."""

    plan: Part
    address: int
    random: Random
    drive: Drive
    dpv1: bool = False
    set_up: bool = False
    configured: bytes = b""
    wants: int = 0
    """In how many answers it still asks for Slave_Diag."""
    reference: int = 0
    constant: bool = False
    newest: dict[wire.RecordId, bytes] = field(default_factory=dict)
    pending: dict[wire.RecordId, bytes] = field(default_factory=dict)
    held: dict[tuple[int, int], list[bytes]] = field(default_factory=dict)
    """What it answers to the next polls of a service, by master and SAP; empty ones first."""
    pkw: Pkw | None = None
    echoed: bool = False
    """Whether it has shown that it is no drive."""

    def lengths(self) -> tuple[int, int]:
        """Bytes out and in, as its configuration has them."""
        known = {
            "13": (0, 4), "2f1f": (16, 16), "e1d1": (4, 4), "f0f0": (4, 4), "43c001": (2, 0), "c2": (0, 0),
            "c0c7c7f1": (12, 12), "c0c3c3c1c1": (6, 6),
        }  # fmt: skip
        code = self.plan.configuration
        if code in known:
            return known[code]
        total = sum((each & 15) * 2 + 2 for each in bytes.fromhex(code) if each)
        return total, total

    def answer(self, master: int, saps: tuple[int, int] | None, du: bytes) -> bytes:
        """The frame with which it answers."""
        if saps is None:
            return self._exchange(master, du)
        service, own = saps
        back = (own, service)
        if service == DIAGNOSIS:
            return frame(master, self.address, 8, self._diagnosis(master), back)
        if service == PARAMETERS:
            if self.random.random() < 0.04:
                return frame(master, self.address, self.random.choice((1, 2, 3)))
            self.dpv1 = len(du) > 7 and bool(du[7] & 0x80)
            self.set_up, self.configured, self.held = True, b"", {}
            return SHORT
        if service == CONFIGURATION:
            if self.random.random() < 0.02:
                return frame(master, self.address, RS)
            self.configured = du
            return SHORT
        if service == GET_CONFIGURATION:
            return frame(master, self.address, 8, bytes.fromhex(self.plan.configuration), back)
        if (service == MS1 and own == MS1 and self.dpv1) or (
            own == 50 and service == self.plan.ms2
        ):
            return self._service(master, back, du)
        return frame(master, self.address, RS, b"", None)

    def _diagnosis(self, master: int) -> bytes:
        self.wants = 0
        first = self.random.choice((0,) * 8 + (0x40, 0x04, 0x44)) if self.set_up else 2
        owner = self.random.choice((master,) * 8 + (5, 255)) if self.set_up else 255
        ident = self.random.choice((self.plan.ident,) * 9 + (0x1234,))
        told = bytes((first, 0x0C if self.set_up else 5, 0, owner)) + struct.pack(">H", ident)
        if self.random.random() < 0.3:
            told = bytes((told[0] | 8,)) + told[1:] + self.random.choice(
                (b"\x06\x81\x00\x00\xab\x12", b"\x42\x01", b"\x81\x11\x22\xc3", b"\x05\x01")
            )  # fmt: skip
        return told[: self.random.randrange(1, 6)] if self.random.random() < 0.02 else told

    def _exchange(self, master: int, outputs: bytes) -> bytes:
        if not (self.set_up and self.configured):
            return frame(master, self.address, RS)
        length = self.lengths()[1]
        if not length:
            return SHORT
        data = self.pkw.answer(outputs, length) if self.pkw else bytes(length)
        if self.random.random() < 0.005:
            data = data[:-2] or bytes(2)
        if not self.wants and self.random.random() < 0.02:
            self.wants = self.random.choice((1, 3, 14))
        self.wants = max(0, self.wants - 1)
        code = self.random.choice((8, 8, 8, 12)) + (2 if self.wants else 0)
        return frame(master, self.address, 13 if code == 14 else code, data)

    def _service(self, master: int, back: tuple[int, int], du: bytes) -> bytes:
        key = (master, back[1])
        if self.random.random() < 0.01 and not self.plan.store:
            self.held.pop(key, None)
            return frame(master, self.address, self.random.choice((1, 2)))
        if du and du[0] != 0x48:
            slow = self.random.choice((0, 1, 1, 3) if self.random.random() < 0.98 else (120,))
            self.held[key] = [b""] * slow + [self._told(du)]
        if not self.held.get(key):
            return frame(master, self.address, 9, b"", None)
        told = self.held[key].pop(0)
        if told:
            self.echoed |= self.plan.store and told[::2][:2] == b"\x5e\x2f" and len(told) > 4
            return frame(master, self.address, 8, told, back)
        return self.random.choice(
            (SHORT, frame(master, self.address, 9), frame(master, self.address, 8, b"", back))
        )

    def _told(self, du: bytes) -> bytes:
        """What a DS_Read or DS_Write brings."""
        random = self.random
        if len(du) < 4 or du[0] not in (0x5E, 0x5F):
            return bytes((du[0] | 0x80, 0x80, 0xA9, 0))
        at = place(du[1], du[2])
        if self.plan.store and du[2] == 47:
            if du[0] == 0x5F:
                self.newest[at] = du[4:]
                return du[:4]
            kept = self.newest.get(at, b"")
            return bytes((0x5E, du[1], 47, len(kept))) + kept
        if random.random() < 0.03:
            told = bytes((du[0] | 0x80, 0x80)) + struct.pack(">H", random.choice(REFUSED))
            return told[: random.choice((4, 4, 4, 3, 2))]
        if du[2] != 47:
            if du[0] == 0x5F:
                return du[:4]
            return bytes((0xDE, 0x80, 0xB0, 0)) if du[2] > 200 else du[:3] + b"\x04abcd"
        if du[0] == 0x5F:
            answer = self.drive.answer(du[1], 47, du[4:]) if len(du) - 4 == du[3] else None
            if answer is None:
                return bytes((0xDF, 0x80, 0xB7, 0))
            self.pending[at] = answer
            return du[:4]
        if at in self.pending and random.random() < 0.4:
            return bytes((0xDE, 0x80, 0xB5, 0))
        held = self.pending.pop(at, None)
        answer = self.bent(held) if held else self.newest.get(at, b"")
        if held is None and random.random() < 0.9:
            return bytes((0xDE, 0x80, 0xB5, 0))
        self.newest[at] = answer
        return bytes((0x5E, du[1], 47, len(answer))) + answer[: random.choice((240,) * 20 + (2,))]


def place(slot: int, index: int) -> wire.RecordId:
    return wire.RecordId(wire.NIL, slot, 1, index, 0)


@dataclass
class Pkw:
    """PKW of a station, and control and status word: what it answers, some cycles later."""

    random: Random
    parts: tuple[int, int]
    """Where PKW and PZD begin; -1 for none."""
    asked: bytes = bytes(8)
    told: bytes = bytes(8)
    later: int = 0
    zsw: int = 0x0231
    speed: int = 0

    def answer(self, outputs: bytes, length: int) -> bytes:
        inputs = bytearray(length)
        pkw, pzd = self.parts
        if pkw >= 0 and len(outputs) >= pkw + 8 and length >= pkw + 8:
            inputs[pkw : pkw + 8] = self._pkw(outputs[pkw : pkw + 8])
        if pzd >= 0 and len(outputs) >= pzd + 4 and length >= pzd + 4:
            inputs[pzd : pzd + 4] = self._pzd(*struct.unpack_from(">HH", outputs, pzd))
        return bytes(inputs)

    def _pkw(self, words: bytes) -> bytes:
        if words != self.asked:
            self.asked, self.later = words, self.random.choice((0, 1, 3))
        if self.later:
            self.later -= 1
            return self.told
        ak = words[0] >> 4
        code = {0: 0, 1: 1, 2: 1, 3: 2, 6: 4, 7: 4, 8: 5}.get(ak, 7)
        number = int.from_bytes(words[:2]) & 0x7FF
        if code and number % 7 == 0:
            code = 7 if number % 2 else 8
        value = {7: bytes((0, 0, 0, number % 30)), 8: bytes(4), 0: bytes(4)}.get(code, words[4:])
        if ak in (1, 6):
            value = struct.pack(">HH", 0, number)
        self.told = bytes((code << 4 | words[0] & 0x0F, *words[1:4])) + value if ak else bytes(8)
        return self.told

    def _pzd(self, stw: int, setpoint: int) -> bytes:
        if stw & 0x400:
            fault = self.zsw & 8 or 8 * (self.random.random() < 0.003)
            if stw & 0x80:
                fault = 0
            ready = (stw & 0x07) == 7 and not fault
            runs = ready and stw & 8
            self.zsw = (
                0x0230
                | fault
                | (1 if stw & 6 == 6 else 0x40)
                | (2 if ready else 0)
                | (4 if runs else 0)
            )
            self.speed = setpoint if runs else 0
        return struct.pack(">HH", self.zsw, self.speed)


# Masters


@dataclass
class Master:
    """A station that asks: its frame count bits, and what it sends to whom."""

    tape: Tape
    random: Random
    address: int
    trouble: float
    fcb: dict[int, int] = field(default_factory=dict)

    def turn(
        self, slave: Slave, du: bytes = b"", saps: tuple[int, int] | None = None, low: bool = False
    ) -> None:
        """A request until it is answered: retries, and damaged answers on the way."""
        to, code = slave.address, 0x4C if low else 0x4D
        bit = self.fcb.get(to)
        fc = code | (0x20 if bit is None else 0x10 | bit << 5)
        asked, told = frame(to, self.address, fc, du, saps), b""
        for _ in range(self.random.choice((2, 4, 18 if self.random.random() < 0.1 else 3))):
            self.tape.put(asked)
            way = self.random.random() / self.trouble if self.trouble else 1
            if way < 0.5:  # it does not arrive
                self.tape.wait(400)
                continue
            told = told or slave.answer(self.address, saps, du)
            if way < 0.8:  # its answer does not
                self.tape.put(spoilt(told, self.random))
                continue
            self.tape.put(told)
            if (
                way < 1 and bit is not None and not self.tape.plan.doubled
            ):  # the master did not understand it
                continue
            self.fcb[to] = 0 if bit is None else 1 - bit
            return
        self.fcb.pop(to, None)

    def say(self, data: bytes) -> None:
        """What nobody answers."""
        self.tape.put(data)

    # Programs

    def start(self, slave: Slave) -> Steps:
        """Slave_Diag, Set_Prm, Chk_Cfg, Slave_Diag."""
        random, part = self.random, slave.plan
        first = random.choice((0xB8, 0xB8, 0xB8, 0x98, 0xB0, 0x38))
        du = bytes((first, 0x1E, 1, 0x0B)) + struct.pack(">H", part.ident) + b"\0"
        du += (
            bytes((0xC0 if part.dpv1 else random.choice((0, 4)), 0, 0))
            if random.random() < 0.9
            else b""
        )
        self.turn(slave, b"", (DIAGNOSIS, 62))
        yield
        self.turn(slave, du, (PARAMETERS, 62))
        yield
        self.turn(slave, bytes.fromhex(part.configuration), (CONFIGURATION, 62))
        yield
        self.turn(slave, b"", (DIAGNOSIS, 62))
        yield

    def exchange(self, slave: Slave, count: int) -> Steps:
        """Data exchange, one after the other."""
        random = self.random
        length = slave.lengths()[0]
        pkw, pzd = slave.pkw.parts if slave.pkw else (-1, -1)
        data = bytearray(length)
        for _ in range(count):
            if pkw >= 0 and random.random() < 0.25:
                ak, pnu = (
                    random.choice((0, 1, 1, 2, 3, 6, 7)),
                    random.choice((12, 700, 918, 947, 964, 22)),
                )
                data[pkw : pkw + 8] = struct.pack(
                    ">HHI", ak << 12 | pnu, random.choice((0, 0x100)), random.choice((0, 1, 99))
                )
            if pzd >= 0 and random.random() < 0.15:
                stw = random.choice((0x47E, 0x47F, 0x47F, 0x4FF, 0x000, 0x77F, 0x47D, 0x47F))
                data[pzd : pzd + 4] = struct.pack(">HH", stw, random.choice((0, 4000, 8000)))
            out = b"" if random.random() < 0.01 else bytes(data)
            self.turn(slave, out[:-1] if random.random() < 0.003 else out, low=slave.plan.low)
            yield
            if slave.wants and random.random() < 0.5:
                self.turn(slave, b"", (DIAGNOSIS, 62))
                yield

    def service(self, slave: Slave, du: bytes) -> Steps:
        """A DS_Read or DS_Write, polled until it is there, or for as long as somebody has patience."""
        saps = (MS1, MS1) if slave.plan.ms2 is None else (slave.plan.ms2, 50)
        key = (self.address, saps[0])
        self.turn(slave, du, saps)
        yield
        for _ in range(self.random.choice((200,) * 20 + (1,))):
            if not slave.held.get(key):
                return
            idle = b"\x48" if saps[1] == 50 and self.random.random() < 0.5 else b""
            self.turn(slave, idle, saps)
            yield

    def job(self, slave: Slave) -> Steps:
        """A request of DS47 and its response, in most ways in which that can go."""
        random = self.random
        slot = random.choice((0, 1, 1, 2))
        data = slave.request(place(slot, 47))[:240]
        length = len(data) + (1 if random.random() < 0.02 else 0)
        yield from self.service(slave, bytes((0x5F, slot, 47, length)) + data)
        for _ in range(random.choice((1, 1, 1, 2, 4, 0))):
            self.tape.wait(random.choice((100, 2000, 20_000)))
            yield from self.service(slave, bytes((0x5E, slot, 47, random.choice((240, 240, 100)))))

    def other(self, slave: Slave) -> Steps:
        """What else is on a line."""
        random = self.random
        some: list[Callable[[], None]] = [
            lambda: self.turn(slave, b"", (GET_CONFIGURATION, 62)),
            lambda: self.turn(slave, b"", (random.choice((20, 53, 56)), 62)),
            lambda: self.say(
                frame(127, self.address, 0x46, bytes((random.choice((0, 2, 8)), 0)), (CONTROL, 62))
            ),
            lambda: self.say(frame(random.choice((77, slave.address)), self.address, 0x49)),
            lambda: self.say(bytes((0xDC, self.address, self.address))),
            lambda: self.turn(slave, b"", (DIAGNOSIS, 62)),
            lambda: self.say(frame(self.address, slave.address, 8, b"\0\0")),
            lambda: self.say(b"\xe5"),
        ]
        if random.random() < 0.4:
            index = random.choice((1, 48, 255))
            head = bytes((random.choice((0x5E, 0x5F)), 1, index, 4))
            yield from self.service(slave, head + (b"abcd" if head[0] == 0x5F else b""))
        else:
            random.choice(some)()
            yield


# Plans


@dataclass(frozen=True)
class Part:
    """One station, and how a master talks to it."""

    master: int
    configuration: str
    dpv1: bool
    ms2: int | None
    """The SAP at which it has records by MS2; None for MS1."""
    low: bool
    """Whether data exchange has low priority."""
    ident: int
    constant: bool
    cyclic: bool
    """Whether words change in its data."""
    jobs: int
    store: bool = False
    """Whether it is no drive, and keeps what is written to index 47."""


@dataclass(frozen=True)
class Plan:
    """What a line is made of. What is said on it comes by chance: from the whole plan, with `seed`."""

    seed: int
    link: int
    late: int
    """So many frames were over when the recording began."""
    loss: float
    noise: float
    """Shares of the frames that the recorder lost, and misread."""
    trouble: float
    """Share of the turns in which something is wrong on the line itself."""
    doubled: bool
    """Whether the recording has each frame twice."""
    snap: int | None
    back: bool
    """Whether the clock of the recorder is set back now and then."""
    stations: tuple[Part, ...]

    def text(self) -> str:
        """As JSON: what `python -m tests.audit --plan` takes. Without stores it is as it was before there were any."""
        known = asdict(self)
        known["stations"] = [
            {k: v for k, v in each.items() if v or k != "store"} for each in known["stations"]
        ]
        return json.dumps(known)


def plan(known: dict[str, object]) -> Plan:
    """A plan from what its JSON says."""
    parts = known["stations"]
    assert isinstance(parts, list)
    return Plan(**{**known, "stations": tuple(Part(**each) for each in parts)})  # type: ignore[arg-type]


def planned(random: Random) -> Plan:
    """A plan of any kind; the simplest has one station with PPO1."""
    parts = [
        Part(
            master=random.randint(0, 1),
            configuration=random.choice(CONFIGURATIONS),
            dpv1=seldom(random, False, True),
            ms2=seldom(random, 12, None),
            low=random.random() < 0.5,
            ident=random.choice((0x80B5, 0x8045, 0x0001)),
            constant=random.random() < 0.5,
            cyclic=random.random() < 0.5,
            jobs=random.randint(1, 10),
        )
        for _ in range(random.randint(1, 3))
    ]
    known = Plan(
        seed=random.getrandbits(24),
        link=seldom(random, OWN, LINK),
        late=seldom(random, random.randint(1, 120), 0),
        loss=seldom(random, random.choice((0.01, 0.05)), 0.0),
        noise=seldom(random, random.choice((0.01, 0.05)), 0.0),
        trouble=random.choice((0.0, 0.0, 0.02, 0.1)),
        doubled=seldom(random, True, False),
        snap=seldom(random, random.choice((10, 16, 40)), None),
        back=seldom(random, True, False),
        stations=tuple(parts),
    )
    if known.late or known.loss or known.noise or known.snap:
        return known  # what a store has may have been written in a frame that is missing
    return replace(
        known,
        stations=tuple(
            replace(each, store=True, dpv1=True) if seldom(random, True, False) else each
            for each in parts
        ),
    )


@dataclass
class Conversation:
    """A capture and the drives that spoke in it."""

    tape: Tape
    drives: dict[str, Drive]


def play(plan: Plan) -> Conversation:
    """The line of a plan, always the same."""
    random = Random(plan.text())
    tape = Tape(random, plan)
    masters = [Master(tape, random, address, plan.trouble) for address in (2, 1)]
    slaves = [_slave(random, 3 + number, part) for number, part in enumerate(plan.stations)]
    running = [_program(random, masters[each.plan.master], each) for each in slaves]
    while running:
        each = random.choice(running)
        for _ in range(random.choice((1, 2, 8))):
            if next(each, "over") == "over":
                running.remove(each)
                break
        if random.random() < 0.2:
            holder = random.choice(masters)
            tape.put(bytes((0xDC, random.choice((1, 2)), holder.address)))
        if plan.back and random.random() < 0.03:
            tape.wait(-5000)
    return Conversation(tape, {each.drive.ip: each.drive for each in slaves if not each.echoed})


def _slave(random: Random, address: int, part: Part) -> Slave:
    drive = drives.make(random, f"dp{address}")
    slave = Slave(part, address, random, drive)
    slave.constant, slave.reference = part.constant, random.randint(0, 250)
    offsets = {"f3f1": (0, 8), "73f1": (0, 8), "f3f5": (0, 8), "f1": (-1, 0), "f5": (-1, 0), "f3f9": (0, 8),
               "00f3f1": (0, 8), "c0c7c7f1": (0, 8)}  # fmt: skip
    if part.cyclic and part.configuration in offsets and not part.store:
        slave.pkw = Pkw(random, offsets[part.configuration])
    return slave


def _program(random: Random, master: Master, slave: Slave) -> Steps:
    """A start-up, data exchange, and between them some jobs."""
    yield from master.start(slave)
    for _ in range(slave.plan.jobs):
        yield from master.exchange(slave, random.choice((1, 5, 20)))
        chance = random.random()
        if chance < 0.1:
            yield from master.start(slave)
        elif chance < 0.4:
            yield from master.other(slave)
        else:
            yield from master.job(slave)
        master.tape.wait(random.choice((100, 5000, 2_000_000 if random.random() < 0.03 else 500)))
    for at in 3 * list(slave.newest) if slave.plan.store else ():
        yield from master.service(
            slave, bytes((0x5E, at.slot, 47, 240))
        )  # else nobody knows that it is none
