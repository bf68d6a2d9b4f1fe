"""A capture that is nothing but record calls: many parameter reads and changes at once.

Sixteen devices are asked in turn by one controller, each over an AR and an RPC activity of its own
with a counting sequence number, so that transactions overlap as they do in a plant. Four frames
each: Write request, Write response, Read request, Read response. Same arguments, same bytes.

Calls and messages come from the lab; only the headers below RPC are packed here, because scapy
would take minutes for what takes seconds.
Needs the package: `python bench/make_dense.py bench/data/dense.pcapng --frames 200000`.
"""

from __future__ import annotations

import argparse
import random
import socket
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from uuid import UUID

from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client, drive
from ds47.lab.ether import Host
from ds47.lab.stage import Shot, Stage
from ds47.lab.wire import RecordId

FRAMES = 200_000
FRAMES_PER_TRANSACTION = 4
DEVICES = 16
GAP_NS = 200_000
"""A frame every 0.2 ms; a transaction of one device takes about 10 ms."""

AR_NUMBERS = 0x4747_4747_0001_4000_8000_0000_0000_0000
ACTIVITY_NUMBERS = 0x1F2E_3D4C_5B6A_11F0_8A47_0000_0A0B_0000
INDICES = (47, 0xB02E, 0xB02F)
ETHERTYPE_IP = 0x0800

Exchange = tuple[bytes, bytes]
"""A request and its response."""
Values = random.Random


class QuickStage(Stage):
    """A stage that packs Ethernet, IPv4 and UDP itself; no VLAN, no fragments."""

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        """A UDP datagram without checksum goes past; ports are (source, target)."""
        pair = ports or (source.port, target.port)
        udp = struct.pack(">HHHH", *pair, 8 + len(payload), 0) + payload
        number = next(source.identification) & 0xFFFF
        head = struct.pack(">BBHHHBB", 0x45, 0, 20 + len(udp), number, 0, 64, 17)
        places = socket.inet_aton(source.ip) + socket.inet_aton(target.ip)
        ip = head + _checksum(head + places) + places
        macs = bytes.fromhex((target.mac + source.mac).replace(":", ""))
        data = macs + ETHERTYPE_IP.to_bytes(2, "big") + ip + udp
        data = data.ljust(60, b"\0")
        self.shots.append(Shot(self.now_ns, data, len(data)))
        self.now_ns += self.gap_ns


def _checksum(header: bytes) -> bytes:
    total = sum(struct.unpack(f">{len(header) // 2}H", header))
    total = (total & 0xFFFF) + (total >> 16)
    return (~((total & 0xFFFF) + (total >> 16)) & 0xFFFF).to_bytes(2, "big")


def one_float(reference: int, axis: int, values: Values) -> Exchange:
    """One Float32: the most common question."""
    asked = message.address(values.choice((21, 27, 68, 50303)))
    found = message.real(round(values.uniform(-1500, 1500), 1))
    return message.read(reference, axis, asked), message.answer(reference, 1, axis, found)


def several(reference: int, axis: int, values: Values) -> Exchange:
    """Six parameters of several formats.

    The one with an odd number of bytes comes last: elsewhere its pad byte throws Wireshark's own
    dissector off, and a [Malformed Packet] costs it time that is not ours to compare with.
    """
    asked = [message.address(pnu) for pnu in (2, 21, 722, 2131, 35, 1000)]
    found = (
        message.word(values.randrange(100)),
        message.real(values.uniform(0, 3000)),
        message.block(0x43, "I", values.randrange(1 << 32)),
        message.word(values.randrange(0xFFFF)),
        message.block(0x04, "i", values.randrange(-(1 << 31), 1 << 31)),
        message.block(message.UNSIGNED8, "B", values.randrange(256)),
    )
    return message.read(reference, axis, *asked), message.answer(reference, 1, axis, *found)


def array(reference: int, axis: int, values: Values) -> Exchange:
    """Eight elements of a list of numbers (fault buffer)."""
    asked = message.address(945, 0, 8)
    found = message.word(*(values.randrange(40_000) for _ in range(8)))
    return message.read(reference, axis, asked), message.answer(reference, 1, axis, found)


def change(reference: int, axis: int, values: Values) -> Exchange:
    """Two parameters are changed."""
    pairs = (
        (message.address(1120), message.real(round(values.uniform(0, 10), 2))),
        (message.address(1121), message.real(round(values.uniform(0, 10), 2))),
    )
    return message.change(reference, axis, *pairs), message.changed(reference, axis, len(pairs))


def partial(reference: int, axis: int, values: Values) -> Exchange:
    """Three parameters, the last of which the drive does not have."""
    asked = [message.address(pnu) for pnu in (21, 27, 60_000)]
    found = (message.real(values.random()), message.real(values.random()), message.error(0))
    return message.read(reference, axis, *asked), message.answer(reference, 0x81, axis, *found)


KINDS: Sequence[Callable[[int, int, Values], Exchange]] = (
    *(one_float, several, one_float, array, change) * 6,
    partial,
)
"""What is asked, in turn; one exchange in 31 has an error."""


@dataclass(slots=True)
class Conversation:
    """One device and what it was asked last."""

    client: Client
    axis: int
    reference: int = 0

    def exchange(self, number: int, values: Values) -> Exchange:
        """The next request and its response; references run from 1 to 255."""
        self.reference = self.reference % 255 + 1
        return KINDS[number % len(KINDS)](self.reference, self.axis, values)


def conversations(stage: Stage) -> list[Conversation]:
    """The controller's conversations, a device and an AR each."""
    made = []
    for number in range(1, DEVICES + 1):
        channel = RecordId(
            UUID(int=AR_NUMBERS + number),
            slot=number % 4 + 1,
            index=INDICES[number % len(INDICES)],
        )
        activity = UUID(int=ACTIVITY_NUMBERS + number)
        client = Client(stage, device=drive(number), channel=channel, activity=activity)
        # One controller: all its frames count in one IP identification.
        client.host = made[0].client.host if made else client.host
        made.append(Conversation(client, axis=number % 3 + 1))
    return made


def shots(transactions: int) -> Iterator[Shot]:
    """The frames of so many transactions, in rounds of one per device."""
    stage = QuickStage(gap_ns=GAP_NS)
    talks = conversations(stage)
    values = random.Random(47)
    for start in range(0, transactions, DEVICES):
        turn = talks[: transactions - start]
        asked = [talk.exchange(start + place, values) for place, talk in enumerate(turn)]
        steps = list(zip([talk.client for talk in turn], asked, strict=True))
        writes = [client.ask_write(request) for client, (request, _) in steps]
        for (client, (request, _)), call in zip(steps, writes, strict=True):
            client.accept_write(call, request)
        reads = [client.ask_read() for client, _ in steps]
        for (client, (_, response)), call in zip(steps, reads, strict=True):
            client.accept_read(call, response)
        yield from stage.shots
        stage.shots.clear()


def write(path: Path, frames: int = FRAMES) -> int:
    """Write a pcapng of `frames` record frames (a multiple of four); their number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with PcapngWriter(path) as file:
        for shot in shots(frames // FRAMES_PER_TRANSACTION):
            file.write(shot.time_ns, shot.data)
            written += 1
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--frames", type=int, default=FRAMES, help="record frames")
    arguments = parser.parse_args()
    print(f"{arguments.path}: {write(arguments.path, arguments.frames)} frames")


if __name__ == "__main__":
    main()
