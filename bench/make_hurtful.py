"""Captures of conversations that want memory and time: each repeats what never ends, or is never the same.

What is said comes from the lab, as in make_dense; the rest is packed here, because scapy would take minutes for
what takes seconds. Same arguments, same bytes. A plain pcap. Needs the package.
"""

from __future__ import annotations

import argparse
import random
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count, cycle
from pathlib import Path
from uuid import UUID

from make_dense import ACTIVITY_NUMBERS, AR_NUMBERS, QuickStage

from ds47.lab import fdl, message, s7_wire, wire
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import Cyclic
from ds47.lab.ether import Host
from ds47.lab.master import FAULTY, Master
from ds47.lab.s7 import PORT, Cpu, Link
from ds47.lab.s7_wire import db
from ds47.lab.stage import Stage

FRAMES = 20_000
Kind = Callable[[Stage], Iterator[object]]
"""Says its next sentence on the stage whenever it is asked for one."""
KINDS: dict[str, tuple[Kind, int]] = {}
"""Name -> what is said, and the link type."""
FLAGS = {"S": 2, "SA": 18, "A": 16, "PA": 24, "FA": 17}
ASKED, ANSWERED = message.read(1, 1, message.address(21)), message.answer(1, 1, 1, message.word(7))


def kind(said: Kind) -> Kind:
    """One of Ethernet."""
    KINDS[said.__name__] = said, 1
    return said


def bus(said: Callable[[Master], Iterator[object]]) -> Callable[[Master], Iterator[object]]:
    """One of PROFIBUS."""
    KINDS[said.__name__] = lambda stage: said(Master(stage)), fdl.PROFIBUS_DL
    return said


# Record calls


def own(stage: Stage, number: int) -> Client:
    """A client with an AR and an activity of its own."""
    channel = wire.RecordId(UUID(int=AR_NUMBERS + number))
    return Client(stage, channel=channel, activity=UUID(int=ACTIVITY_NUMBERS + number))


def device(number: int) -> Host:
    """Device n of very many."""
    ip = ".".join(map(str, (10 << 24 | number + 1).to_bytes(4)))
    mac = (0x02 << 40 | number).to_bytes(6).hex(":")
    return replace(drive(), ip=ip, mac=mac)


@kind
def unanswered(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    while True:
        yield client.ask_write(ASKED)


@kind
def activities(stage: Stage) -> Iterator[object]:
    for number in count():
        yield replace(Client(stage), activity=UUID(int=ACTIVITY_NUMBERS + number)).ask_write(ASKED)


@kind
def orphans(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    while True:
        yield client.accept_write(client.call(wire.WRITE), ASKED)


@kind
def channels(stage: Stage) -> Iterator[object]:
    for number in count():
        yield own(stage, number).exchange(ASKED, ANSWERED)


@kind
def devices(stage: Stage) -> Iterator[object]:
    for number in count():
        yield replace(own(stage, number), device=device(number)).exchange(ASKED, ANSWERED)


@kind
def connects(stage: Stage) -> Iterator[object]:
    for number in count():
        yield own(stage, number).connect(f"plc-{number}")


@kind
def never_read(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    while True:
        yield client.write(ASKED)


@kind
def polled(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    client.write(ASKED)
    while True:
        yield client.poll()


@kind
def writes_refused(stage: Stage) -> Iterator[object]:
    for number in count():
        yield own(stage, number % 4096).write(ASKED, status=0xDF80B500)


@kind
def parameters_refused(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    for number in count():
        asked = message.read(1, 1, message.address(number % 65535 + 1, number // 65535))
        yield client.exchange(asked, message.answer(1, 0x81, 1, message.error(0)))


@kind
def torn_messages(stage: Stage) -> Iterator[object]:
    client = Client(stage, fragment=8)
    while True:
        client.ask_write(ASKED)
        for _ in range(len(stage.shots) - 1):
            stage.lose()
        yield


@kind
def torn_datagrams(stage: Stage) -> Iterator[object]:
    client = Client(stage)
    while True:
        client.ask_write(ASKED)
        shot = stage.shots.pop()
        head = bytearray(shot.data)
        head[20] |= 0x20  # more fragments
        yield stage.shots.append(replace(shot, data=bytes(head)))


@kind
def garbage(stage: Stage) -> Iterator[object]:
    chance, client = random.Random(47), Client(stage)
    while True:
        call, body = client.call(chance.randrange(6)), chance.randbytes(chance.randrange(200))
        pdu = wire.pdu(chance.choice((wire.REQUEST, wire.RESPONSE)), "<", call, body)
        yield stage.send(client.host, client.device, pdu)


# Cyclic data


def cyclic(stage: Stage, words: Iterator[tuple[bytes, bytes]]) -> Iterator[object]:
    """PPO1 in both directions."""
    line = Cyclic(Client(stage))
    line.connect()
    macs = [wire.mac_bytes(each) for each in (line.client.device, line.client.host)]
    for number, (out, back) in enumerate(words):
        ticks = struct.pack(">HBB", number * 128 & 0xFFFF, 0x35, 0)
        for (to, of), frame_id, data in ((macs, 0x8002, out), (macs[::-1], 0x8001, back)):
            head = to + of + struct.pack(">HH", 0x8892, frame_id)
            status = data[:8] + b"\x80" + data[8:] + b"\x80"
            stage.frame(head + status.ljust(line.length, b"\x80") + ticks)
        yield


@kind
def pkw_never_answered(stage: Stage) -> Iterator[object]:
    stands = bytes.fromhex("047efb31")
    asked = (struct.pack(">HHI", 0x1000 | n // 4 % 2000, n // 8000, 0) for n in count())
    return cyclic(stage, ((each + stands, bytes(8) + stands) for each in asked))


@kind
def pkw_refused(stage: Stage) -> Iterator[object]:
    places = ((n // 4 % 2000, n // 8000 & 0xFFFF) for n in count())
    words = struct.Struct(">HHII")
    return cyclic(
        stage,
        (
            (
                words.pack(0x1000 | pnu, sub, 0, 0x047E0000),
                words.pack(0x7000 | pnu, sub, 0, 0xFB310000),
            )
            for pnu, sub in places
        ),
    )


@kind
def pzd_trips(stage: Stage) -> Iterator[object]:
    states = cycle((0x047EFB31, 0x047FFB31, 0x047FFB37, 0x047FFB38))
    words = (bytes(8) + each.to_bytes(4) for each in states)
    return cyclic(
        stage, ((each[:10] + bytes(2), bytes(8) + each[10:] + bytes(2)) for each in words)
    )


# S7


class QuickLink(Link):
    """A connection that packs TCP, IP and Ethernet itself."""

    def segment(
        self, from_client: bool, payload: bytes = b"", flags: str = "PA", back: int = 0
    ) -> None:
        """A segment goes past."""
        ends = [(self.client, self.port), (self.cpu.host, PORT)][:: 1 if from_client else -1]
        ports = [port for _, port in ends]
        at = self.sequence[from_client] - back, self.sequence[not from_client]
        numbers = [each & 0xFFFFFFFF for each in at]
        tcp = struct.pack(">HHIIBBHHH", *ports, *numbers, 0x50, FLAGS[flags], 8192, 0, 0)
        size = 20 + len(tcp) + len(payload)
        number = next(ends[0][0].identification) & 0xFFFF
        ip = struct.pack(">BBHHHBBH", 0x45, 0, size, number, 0x4000, 64, 6, 0)
        places = b"".join(bytes(map(int, each.ip.split("."))) for each, _ in ends)
        macs = b"".join(wire.mac_bytes(each) for each, _ in reversed(ends))
        self.cpu.stage.frame(macs + b"\x08\x00" + ip + places + tcp + payload)
        if not back:
            self.sequence[from_client] += len(payload) + ("S" in flags or "F" in flags)


def link(cpu: Cpu, number: int = 0) -> QuickLink:
    """Connection n of very many, open."""
    made = QuickLink(cpu, device(number // 50_000), 10_000 + number % 50_000)
    made.open()
    return made


def answered(each: Link, variables: tuple[s7_wire.Var, ...], code: int = s7_wire.DONE) -> None:
    """A read with an answer that costs no memory of the CPU."""
    asked = each.ask_get(*variables)
    parts = [(code, bytes(one.size) if code == s7_wire.DONE else b"") for one in variables]
    parameter = bytes((s7_wire.READ, len(variables)))
    each.say(False, s7_wire.ANSWER, asked.reference, parameter, s7_wire.values(parts))


@kind
def s7_open(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count():
        yield one.ask_get(db(1, number % 1000, 2))


@kind
def s7_open_on_500(stage: Stage) -> Iterator[object]:
    cpu = Cpu(stage)
    for each in cycle([link(cpu, number) for number in range(500)]):
        yield each.ask_get(db(1, 0, 2))


@kind
def s7_orphans(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    while True:
        data = s7_wire.values([(s7_wire.DONE, bytes(2))])
        yield one.say(False, s7_wire.ANSWER, one.next(), b"\x04\x01", data)


@kind
def s7_connections(stage: Stage) -> Iterator[object]:
    cpu = Cpu(stage)
    for number in count():
        yield answered(link(cpu, number), (db(1, 0, 2),))


@kind
def s7_refused(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count():
        yield answered(one, (db(number // 1000 + 1, number % 1000 * 2, 2),), s7_wire.MISSING)


@kind
def s7_areas_in_parts(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count():
        yield answered(one, (db(number // 300 + 1, number % 300 * 200, 200),))


@kind
def s7_900_writers(stage: Stage) -> Iterator[object]:
    cpu = Cpu(stage)
    for number, each in enumerate(cycle([link(cpu, number) for number in range(900)])):
        yield each.put((db(1, 0, 4), number.to_bytes(4)))


@kind
def s7_18_items(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count():
        yield answered(one, tuple(db(number % 500 + 1, at * 50, 2) for at in range(18)))


@kind
def s7_sends(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count():
        yield one.send(number, bytes(100), ended=False, total=60_000)


@kind
def s7_hole(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    one.sequence[True] += 100
    while True:
        yield one.ask_get(db(1, 0, 2))


@kind
def s7_from_the_back(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    for number in count(1):
        yield one.segment(True, bytes(20), back=-(1 << 29) + 20 * number)


@kind
def s7_long_tpkt(stage: Stage) -> Iterator[object]:
    cpu = Cpu(stage)
    for number, each in enumerate(cycle([link(cpu, number) for number in range(1000)])):
        yield each.segment(True, (b"\x03\x00\xff\xff" if number < 1000 else b"") + bytes(60))


@kind
def s7_cotp_without_end(stage: Stage) -> Iterator[object]:
    one = link(Cpu(stage))
    while True:
        yield one.segment(True, s7_wire.data(bytes(40), last=False))


@kind
def s7_syns(stage: Stage) -> Iterator[object]:
    cpu = Cpu(stage)
    for number in count():
        yield QuickLink(cpu, device(number // 50_000), 10_000 + number % 50_000).segment(
            True, flags="S"
        )


# PROFIBUS


@bus
def bus_never_answered(master: Master) -> Iterator[object]:
    for number in count():
        station, slot = number % 120 + 3, number // 120 % 255
        master.restart(station)
        yield master.record(station, (bytes((0x5F, slot, 47, len(ASKED))) + ASKED).hex())


@bus
def bus_diagnosis(master: Master) -> Iterator[object]:
    for number in count():
        yield master.diagnose(number % 120 + 3, FAULTY[:-8] + f"{number & 0xFFFFFFFF:08x}")


@bus
def bus_data(master: Master) -> Iterator[object]:
    master.start(3)
    for number in count():
        yield master.exchange(3, f"{number:024x}", f"{number:024x}")


@bus
def bus_tokens(master: Master) -> Iterator[object]:
    for number in count():
        yield master.put(fdl.token(number % 126, (number * 7) % 126))


@bus
def bus_garbage(master: Master) -> Iterator[object]:
    chance = random.Random(47)
    while True:
        yield master.put(chance.randbytes(chance.randrange(1, 60)))


@bus
def bus_configurations(master: Master) -> Iterator[object]:
    for number in count():
        master.ask(number % 120 + 3, f"{number & 0xFFFFFFFF:08x}f3f1", fdl.CONFIGURATION)
        yield master.short()


@bus
def bus_requests_lost(master: Master) -> Iterator[object]:
    for number in count():
        master.ask(number % 120 + 3, f"{number & 0xFFFFFFFF:024x}")
        yield master.restart(number % 120 + 3)


def write(path: Path, name: str, frames: int) -> None:
    """Write a pcap of so many frames."""
    said, link_type = KINDS[name]
    stage = QuickStage(gap_ns=1_000_000)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as out:
        out.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262_144, link_type))
        for _ in said(stage):
            for shot in stage.shots[:frames]:
                seconds, part = divmod(shot.time_ns, 10**9)
                size = len(shot.data)
                out.write(struct.pack("<IIII", seconds, part, size, size) + shot.data)
            frames -= len(stage.shots)
            stage.shots.clear()
            if frames <= 0:
                return


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--kind", choices=KINDS, required=True)
    parser.add_argument("--frames", type=int, default=FRAMES)
    arguments = parser.parse_args()
    write(arguments.path, arguments.kind, arguments.frames)


if __name__ == "__main__":
    main()
