"""Random machines: a controller and drives in cyclic frames of PROFINET, under any link header and VLAN tags.

Each drive is switched and watched by PZD, asked by PKW and by records. Whatever is around the frames, the report has
to say what it says of the same ones on plain Ethernet (`told`).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path
from random import Random
from uuid import UUID

from tests.audit import run
from tests.audit.conversations import seldom
from tests.audit.reading import Complaint, Reading, read
from tests.audit.wire import ETHERNET, SLL, SLL2

from ds47.lab import captured, message
from ds47.lab.client import Client, controller, drive
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic, LabModule
from ds47.lab.cyclic_scenes import parameters
from ds47.lab.drive import LabDrive
from ds47.lab.machine import ACKNOWLEDGE, IDLE, OFF, ON, Machine
from ds47.lab.stage import MILLISECOND, Shot, Stage
from ds47.lab.wire import RecordId

TELEGRAMS = {
    "1": (LabModule(2, 2, 4),), "352": (LabModule(2, 2, 12),), "353": (PKW, PZD), "354": (PKW, LabModule(2, 3, 12)),
}  # fmt: skip
CONTROL = 0x0400
WORDS = (
    OFF, OFF, ON, ON, ON & ~CONTROL, OFF & ~CONTROL, 0, 0x047D, 0x047B, 0x0477, 0x046F, 0x045F, 0x043F, 0x0C7F, 0x057E,
)  # fmt: skip
AT_THE_DRIVE = ("enabled", "off2", "off3", "local", "alarm", "blocked", "echo_zero")
"""What somebody may turn round there."""
VALID, INVALID = 0x35, 0x31
"""Status of a frame."""


@dataclass(frozen=True)
class Plan:
    """What is around the frames, and which drives there are. All else comes by chance: from the whole plan."""

    seed: int
    link: int
    tags: tuple[int, ...]
    """EtherTypes of the VLAN tags."""
    drives: tuple[str, ...]
    """Of each its telegram."""
    cycle: int
    """Milliseconds."""
    steps: int

    def text(self) -> str:
        """As JSON: what `python -m tests.audit --plan` takes."""
        return json.dumps(asdict(self))


def plan(known: dict[str, object]) -> Plan:
    """A plan from what its JSON says."""
    lists = {key: tuple(value) for key, value in known.items() if isinstance(value, list)}
    return Plan(**{**known, **lists})  # type: ignore[arg-type]


def planned(random: Random) -> Plan:
    """A plan of any kind."""
    return Plan(
        seed=random.getrandbits(24),
        link=random.choice((ETHERNET, SLL, SLL2)),
        tags=random.choice(((), (0x8100,), (0x88A8, 0x8100), (0x9100, 0x9200, 0x8100))),
        drives=tuple(random.choices(tuple(TELEGRAMS), k=random.choice((1, 1, 2)))),
        cycle=random.choice((16, 64, 128)),
        steps=random.randint(2, 20),
    )


@dataclass
class Tape:
    """What the capture point saw, and how it wraps that."""

    stage: Stage
    """On plain Ethernet."""
    plan: Plan

    @property
    def shots(self) -> list[Shot]:
        whole = ((each.time_ns, wrapped(each.data, self.plan)) for each in self.stage.shots)
        return [Shot(time_ns, data, len(data)) for time_ns, data in whole]

    def write(self, path: Path) -> None:
        path.write_bytes(captured(Stage(link=self.plan.link, shots=self.shots)))


def wrapped(data: bytes, plan: Plan) -> bytes:
    """An Ethernet frame with the tags of a plan and under its link header."""
    behind = b"".join(each.to_bytes(2) + b"\xc0\x05" for each in plan.tags) + data[12:]
    if plan.link == SLL:
        return b"\0\0\0\1\0\6" + data[6:12] + b"\0\0" + behind
    if plan.link == SLL2:
        return behind[:2] + bytes(6) + b"\0\1\0\6" + data[6:12] + b"\0\0" + behind[2:]
    return data[:12] + behind


@dataclass
class Conversation:
    """A capture, and the machines in it."""

    tape: Tape
    machines: list[Machine[Cyclic]]

    def go(self, cycles: int) -> None:
        """So many cycles go by: of each machine two frames, all behind each other."""
        stage = self.tape.stage
        for _ in range(cycles):
            begun = stage.now_ns
            for number, each in enumerate(self.machines):
                stage.now_ns = begun + number * MILLISECOND
                each.cycle()
            stage.now_ns = begun + self.tape.plan.cycle * MILLISECOND


def play(plan: Plan) -> Conversation:
    """The conversation of a plan, always the same."""
    random, stage = Random(plan.text()), Stage()
    machines = [_machine(random, stage, plan, number) for number in range(len(plan.drives))]
    made = Conversation(Tape(stage, plan), machines)
    made.go(random.choice((1, 5)))
    for _ in range(plan.steps):
        it = random.choice(machines)
        random.choice(ACTS)(random, it, made)
        made.go(random.choice((1, 3, 10, 30, 100)))
    return made


def _machine(random: Random, stage: Stage, plan: Plan, number: int) -> Machine[Cyclic]:
    """On Ethernet all drives have the same frame ids: the receiver tells them apart, of whom a cooked header has none."""
    device = drive(1 + number, vendor_id=seldom(random, 0x0493, 0x002A))
    channel, activity = RecordId(UUID(int=1 + number), 2, 1), UUID(int=0x100 + number)
    client = Client(stage, controller(), device, channel=channel, activity=activity)
    first = 0x8001 + (0 if plan.link == ETHERNET else 2 * number)
    modules = TELEGRAMS[plan.drives[number]]
    line = Cyclic(client, modules, (first, 0xFFFF), given=first + 1, reduction=plan.cycle)
    moved = LabDrive(
        up_s=random.choice((0.5, 4)),
        down_s=random.choice((0.5, 4)),
        excite_s=random.choice((0, 0, 1.2)),
        pause=random.choice((0, 3, 3, 20, 10_000)),
        cells=parameters(),
    )
    return Machine(line, moved).connect()


# What happens


def _control(random: Random, it: Machine[Cyclic], _: Conversation) -> None:
    it.control(random.choice(WORDS))


def _setpoint(random: Random, it: Machine[Cyclic], _: Conversation) -> None:
    it.setpoint(random.choice((0, 0.1, 30, 80, -50)))


def _start(random: Random, it: Machine[Cyclic], made: Conversation) -> None:
    it.control(OFF).setpoint(random.choice((30, 80)))
    made.go(3)
    it.control(ON)


def _trip(random: Random, it: Machine[Cyclic], made: Conversation) -> None:
    """A fault, and somebody acknowledges it, which may not help."""
    it.drive.fault, it.drive.cleared = random.choice((30002, 7860)), random.random() < 0.6
    made.go(random.choice((2, 30)))
    it.control(random.choice((ACKNOWLEDGE, ACKNOWLEDGE, ACKNOWLEDGE & ~CONTROL)))


def _happen(random: Random, it: Machine[Cyclic], _: Conversation) -> None:
    """Somebody does something at the drive."""
    name = random.choice(AT_THE_DRIVE)
    setattr(it.drive, name, not getattr(it.drive, name))


def _spoil(random: Random, it: Machine[Cyclic], made: Conversation) -> None:
    """Data is invalid for a while, or the AR is set up anew."""
    if random.random() < 0.2:
        it.connect()
        return
    it.line.iops[random.choice((INPUT, OUTPUT))] = BAD
    it.line.status = random.choice((VALID, VALID, INVALID))
    made.go(random.choice((1, 5, 40)))
    if random.random() < 0.7:
        it.line.iops, it.line.status = {INPUT: GOOD, OUTPUT: GOOD}, VALID


def _ask(random: Random, it: Machine[Cyclic], made: Conversation) -> None:
    """A request of PKW, right or wrong, held for some cycles, now and then again and again."""
    pnu, subindex = random.choice((*it.drive.cells, (2010, 2), (29, 0)))
    ak, value = random.choice((1, 1, 1, 6, 2, 3, 8, 13)), bytes(4)
    if ak not in (1, 6):
        value = random.choice((b"\0\0\0\x05", b"\0\0\0\x14", struct.pack(">f", 12.5)))
    index = bytes((subindex, 0x80 * (pnu >= 2000)))
    head = (ak << 12 | pnu % 2000).to_bytes(2) + seldom(random, index[::-1], index)
    held = random.choice((1, 6, 6, 6, 40))
    for _ in range(random.choices((1, 12, 110), (60, 4, 1))[0]):
        if seldom(random, True, False):  # in two parts
            it.words = head + it.words[4:]
            made.go(1)
        it.words = head + value
        made.go(held)
        it.words = seldom(random, it.words, IDLE)
        made.go(random.choice((1, 5)))


def _record(random: Random, it: Machine[Cyclic], _: Conversation) -> None:
    """A change by a record, accepted or not."""
    asked = message.change(1, 2, (message.address(50076), message.word(1)))
    refused = (message.answer(1, 0x82, 2, message.error(each)) for each in (0x11, 0x6B, 0x71))
    it.line.client.exchange(asked, random.choice((message.changed(1, 2), *refused)))


ACTS = (_start, _start, _control, _setpoint, _happen, _trip, _ask, _ask, _record, _spoil)


# What is told


def of(made: Conversation, folder: Path) -> Iterator[Complaint]:
    """What is not so in the report."""
    path, bare = folder / "wrapped.pcapng", folder / "bare.pcapng"
    made.tape.write(path)
    bare.write_bytes(captured(made.tape.stage))
    item = read(path, page=False)
    yield from run.complaints(item, {})
    yield from told(item, read(bare, text=False, page=False))


def told(item: Reading, bare: Reading) -> Iterator[Complaint]:
    """Of what is wrapped the same is said as of what is not."""
    for key in ("transactions", "findings", "relations", "timelines"):
        for mine, true in zip_longest(item.plain.get(key, ()), bare.plain.get(key, ())):
            if mine != true:
                yield Complaint("wrapped", key, f"{mine} is {true} on plain Ethernet")
