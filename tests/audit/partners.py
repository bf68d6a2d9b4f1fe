"""Random conversations of S7 with CPUs and drives, over a wire that doubles segments, and what was done in them.

A drive answers with its parameters, each by itself; a CPU has bytes that lie beside each other. What the clients
asked and got is the truth (`told`): whose elements they are, and what must not be said of a drive.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from random import Random
from typing import Any

from tests.audit import run
from tests.audit.conversations import seldom
from tests.audit.reading import Complaint, Reading, read

from ds47.lab import captured
from ds47.lab.s7 import Asked, Cpu, DriveCpu, Link, station
from ds47.lab.s7_wire import DONE, Var, db
from ds47.lab.stage import Shot, Stage

OF_BYTES = {"DS905", "DS907", "DS916"}
"""Rules about bytes that lie beside each other: nothing of a drive is so."""
KNOWN = (1120, 1121, 1082, 2900, 2000, 945, 947, 304)
"""Parameters that every SINAMICS has,"""
UNKNOWN = (29999, 31000)
"""and numbers that are none."""
PROOFS = {"order", "values"}


@dataclass(frozen=True)
class Plan:
    """What the wire does, and which servers there are. All else comes by chance: from the whole plan."""

    seed: int
    twice: float
    """Share of the segments that are sent again,"""
    late: float
    """and that stand behind the next one."""
    tpdu: int | None
    """Bytes of a COTP DT."""
    servers: tuple[tuple[str, int, bool], ...]
    """Of each: "drive" or "cpu", the slot in its TSAP, and whether it is asked for its order number first."""
    clients: int
    jobs: int

    def text(self) -> str:
        """As JSON: what `python -m tests.audit --plan` takes."""
        return json.dumps(asdict(self))


def plan(known: dict[str, Any]) -> Plan:
    """A plan from what its JSON says."""
    return Plan(**{**known, "servers": tuple(tuple(each) for each in known["servers"])})


def planned(random: Random) -> Plan:
    """A plan of any kind."""
    kinds = [random.choice(("drive", "drive", "cpu")) for _ in range(random.randint(1, 3))]
    return Plan(
        seed=random.getrandbits(24),
        twice=random.choice((0.0, 0.0, 0.05)),
        late=random.choice((0.0, 0.0, 0.05)),
        tpdu=seldom(random, random.choice((20, 60)), None),
        servers=tuple(
            (
                kind,
                seldom(random, 2 * (kind == "drive"), 2 * (kind == "cpu")),
                random.random() < 0.3,
            )
            for kind in kinds
        ),
        clients=random.randint(1, 3),
        jobs=random.randint(2, 15),
    )


@dataclass
class Done:
    """A job, and for each of its variables the return code and the bytes."""

    link: Link
    asked: Asked
    results: list[tuple[int, bytes]]


@dataclass
class Tape:
    """What the capture point saw."""

    stage: Stage

    @property
    def shots(self) -> list[Shot]:
        return self.stage.shots

    def write(self, path: Path) -> None:
        path.write_bytes(captured(self.stage))


@dataclass
class Conversation:
    """A capture, its servers, and what was done."""

    plan: Plan
    tape: Tape
    drives: set[str]
    """IP addresses."""
    shown: set[str]
    """Those of drives that somebody asked for their order number."""
    done: list[Done] = field(default_factory=list)


def play(plan: Plan) -> Conversation:
    """The conversation of a plan, always the same."""
    random, stage = Random(plan.text()), Stage()
    servers = [_server(random, stage, number, each) for number, each in enumerate(plan.servers)]
    drives = {each.host.ip for each in servers if isinstance(each, DriveCpu)}
    pairs = list(zip(plan.servers, servers, strict=True))
    shown = {server.host.ip for (_, _, asks), server in pairs if asks}
    made = Conversation(plan, Tape(stage), drives, drives & shown)
    links = []
    for (_, _, asks), server in pairs:
        for number in range(plan.clients):
            link = server.link(20 + number)
            link.tpdu = plan.tpdu
            link.open(random.choice((240, 480)))
            if asks and not number:
                _order(link, isinstance(server, DriveCpu))
            links.append(link)
    for _ in range(plan.jobs * len(links)):
        _job(random, random.choice(links), made)
        stage.wait(random.choice((0, 1, 5, 400)))
    for link in links:
        if random.random() < 0.7:
            link.close()
    stage.shots[:] = list(_on_the_wire(random, plan, stage.shots))
    return made


def _server(random: Random, stage: Stage, number: int, kind: tuple[str, int, bool]) -> Cpu:
    host, tsap = station(1 + number), bytes((3, kind[1]))
    if kind[0] == "cpu":
        return Cpu(stage, host, tsap=tsap)
    objects = random.choice(((0,), (1, 2), (1, 2, 3)))
    elements = {
        (pnu, 1024 * each + index): _value(random, random.choice((2, 4, 4)))
        for pnu in random.sample(KNOWN, 4) for each in objects for index in range(3)
    }  # fmt: skip
    return DriveCpu(stage, host, tsap=tsap, elements=elements)


def _value(random: Random, size: int) -> bytes:
    return random.choice((struct.pack(">f", 12.5), random.randbytes(4), bytes((1, 2, 3, 4))))[:size]


def _order(link: Link, drive: bool) -> None:
    order = b"6SL3 244-0BB13-1FA0" if drive else b"6ES7 315-2EH14-0AB0"
    link.szl(0x111, 1, struct.pack(">H20sHHH", 1, order.ljust(20), 0, 0, 0))


# Jobs


def _job(random: Random, link: Link, made: Conversation) -> None:
    """A read or a write of some variables, and its answer."""
    server = link.cpu
    one = _element if isinstance(server, DriveCpu) else _bytes
    variables = [one(random, server, made) for _ in range(random.choice((1, 1, 1, 2, 4)))]
    if random.random() < 0.6:
        asked = link.ask_get(*variables)
        results = [server.read(each) for each in variables]
        link.answer(asked)
    else:
        variables = list({each.db: each for each in variables}.values())[:2]  # none lies on another
        data = [_value(random, each.size).ljust(each.size, b"\7") for each in variables]
        asked = link.ask_put(*zip(variables, data, strict=True))
        link.answer(asked)
        results = [(_code(server, each), new) for each, new in zip(variables, data, strict=True)]
    made.done.append(Done(link, asked, results))
    if one is _bytes and random.random() < 0.1:  # the program of the CPU takes something back
        server.write(variables[0], bytes(variables[0].size))


def _code(server: Cpu, variable: Var) -> int:
    return server.read(variable)[0]


def _element(random: Random, server: Cpu, made: Conversation) -> Var:
    """A parameter of a drive; seldom one that it has not, or with another length."""
    assert isinstance(server, DriveCpu)
    chance = random.random()
    (number, start), value = random.choice(list(server.elements.items()))
    if chance < 0.03:
        return db(random.choice(UNKNOWN), start, 4)
    if chance < 0.06:
        return db(number, start, 5)
    return db(number, start, len(value))


def _bytes(random: Random, _: Cpu, __: Conversation) -> Var:
    """Bytes of a CPU, which may lie on each other, in blocks that may have the number of a parameter."""
    number = random.choice((1, 5, 1120, 2000))
    return db(number, random.choice((0, 1, 2, 4, 100, 1024, 1025)), random.choice((1, 2, 4, 4, 30)))


# The wire


def _on_the_wire(random: Random, plan: Plan, shots: list[Shot]) -> Iterator[Shot]:
    """Some segments are sent again behind the next frame, and some overtaken by the next one of their stream."""
    again: Shot | None = None
    shots = list(shots)
    for at, shot in enumerate(shots):
        after = shots[at + 1] if at + 1 < len(shots) else shot
        if _stream(after) == _stream(shot) and random.random() < plan.late:
            shots[at : at + 2] = (
                replace(after, time_ns=shot.time_ns),
                replace(shot, time_ns=after.time_ns),
            )
        yield shots[at]
        if again is not None:
            yield replace(again, time_ns=shot.time_ns + 10_000)
        again = shots[at] if random.random() < plan.twice else None


def _stream(shot: Shot) -> bytes:
    """Addresses and ports, in one direction."""
    return shot.data[26:38]


# What is told


def of(made: Conversation, folder: Path) -> Iterator[Complaint]:
    """What is not so in the report."""
    path = folder / "partners.pcapng"
    made.tape.write(path)
    item = read(path, page=False)
    yield from run.complaints(item, {})
    yield from told(made, item)


def told(made: Conversation, item: Reading) -> Iterator[Complaint]:
    """Each job is one transaction with its variables; those of a drive are elements of parameters."""
    proofs = {}
    for each in item.plain["connections"]:
        proof = (each.get("drive") or {}).get("proof")
        proofs[each["server"]] = proof
        if each["server"] not in made.drives and proof in PROOFS:
            yield Complaint("partner", each["server"], f"is no drive, whatever its {proof} say")
        if each["server"] in made.shown and proof is None:
            yield Complaint("partner", each["server"], "is a drive")
    for finding in item.findings:
        ends = {finding.args.get("device"), finding.args.get("controller")}
        if finding.rule in OF_BYTES and any(proofs.get(ip) for ip in ends & made.drives):
            yield Complaint(
                finding.rule, f"frame {finding.frame}", f"of a drive: {finding.message}"
            )
    yield from _jobs(made, item, proofs)


def _jobs(made: Conversation, item: Reading, proofs: dict[str, str | None]) -> Iterator[Complaint]:
    ports = {each["id"]: each["client_port"] for each in item.plain["connections"]}
    found: dict[tuple[str, int, int], list[dict[str, Any]]] = {}
    for plain in (each.plain for each in item.deals):
        key = plain["device"], ports[plain["connection"]], plain["request_reference"]
        found.setdefault(key, []).append(plain)
    for done in made.done:
        key = done.link.cpu.host.ip, done.link.port, done.asked.reference
        same, where = found.pop(key, []), f"job {key[2]} of port {key[1]} of {key[0]}"
        if len(same) != 1:
            yield Complaint("partner", where, f"are {len(same)} transactions")
        for plain in same:
            for text in _job_told(done, plain, proofs.get(done.link.cpu.host.ip) in PROOFS):
                yield Complaint("partner", where, text)
    for key in found:
        yield Complaint("partner", f"job {key}", "was not asked")


def _job_told(done: Done, plain: dict[str, Any], proven: bool) -> Iterator[str]:
    items = plain["items"]
    if [(each["db"], each["start"], each["length"]) for each in items] != [
        (each.db, each.start, each.size) for each in done.asked.variables
    ]:
        yield f"has other items: {items}"
        return
    for each, variable, (code, data) in zip(items, done.asked.variables, done.results, strict=True):
        if each["code"] != code or (code == DONE and each["value"] != data.hex()):
            yield f"{each['address']} is {code:#x} {data.hex()}"
        element = each.get("parameter") if code == DONE else None
        if proven and code == DONE and element is None:
            yield f"{each['address']} is an element of a drive"
        if element is not None and not proven:
            yield f"{each['address']} is no element"
        if element is not None:
            place = each["drive_object"], element["pnu"], element["subindex"]
            if place != (variable.start // 1024, variable.db, variable.start % 1024):
                yield f"{each['address']} is not {place}"
