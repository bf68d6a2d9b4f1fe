"""Conversations to which something rare happened, for the tests of both implementations.

The clock of the capturing computer is set back; a message comes in fragments that the snap length cut, or of
which the end was lost. The values are their own numbers, so that a wrong place shows.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from ipaddress import IPv4Address
from uuid import UUID

from frames import ethernet, udp

from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.ether import Host
from ds47.lab.stage import Stage

PNU, COUNT = 100, 120
"""What is read, and how many values of it."""
AT_ONCE = 2_100
"""Calls at once: more than the limit `activities`."""
DECADES = 1_767_254_400 * 10**9 + 123_456_789
"""Nanoseconds from 1970 to 2026."""
QUARTER = 105 * 86_400 * 10**9 + 1
"""A little more than a double holds exactly."""


def request(reference: int) -> bytes:
    return message.read(reference, 1, message.address(PNU, 0, COUNT))


def answer(reference: int, first: int) -> bytes:
    return message.answer(reference, 1, 1, message.block(0x06, "H", *range(first, first + COUNT)))


def ask(client: Client, number: int) -> None:
    reference = number % 255 + 1
    client.exchange(request(reference), answer(reference, number))


def _written(stage: Stage) -> bytes:
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, shot.original_length)
    return target.getvalue()


def clock_back_with_lost_answers() -> bytes:
    """Two minutes back; the answers before and some behind that are lost."""
    stage = Stage()
    client = Client(stage)
    for number in range(320):
        if number == 20:
            stage.wait(-120_000)
        ask(client, number)
        if number in (19, 25, 80, 81, 140):
            del stage.shots[-1]
        stage.wait(1000)
    return _written(stage)


def clock_back_with_ip_fragments() -> bytes:
    """An hour back, in a conversation of fragmented datagrams."""
    stage = Stage(mtu=300)
    client = Client(stage)
    for number in range(23):
        if number == 3:
            stage.wait(-3_600_000)
        ask(client, number)
    return _written(stage)


def cut_rpc_fragments() -> bytes:
    """Of each RPC fragment the end is missing."""
    stage = Stage()
    client = Client(stage)
    client.fragment = 200
    stage.snap = 290
    ask(client, 0)
    return _written(stage)


def old_rpc_fragments() -> bytes:
    """The last fragment of an answer is lost; ten minutes later its activity and numbers come again."""
    stage = Stage()
    client = Client(stage)
    for first in (1000, 5000):
        client.sequence, client.fragment = 0, None
        client.write(request(1))
        call = client.ask_read()
        client.fragment = 150
        client.accept_read(call, answer(1, first))
        if first == 1000:
            del stage.shots[-1]
        stage.wait(600_000)
    return _written(stage)


@dataclass(slots=True)
class Quick(Stage):
    """A stage for thousands of frames: without scapy."""

    sent: list[tuple[int, bytes]] = field(default_factory=list)
    first: int | None = None
    """Only so many bytes of each datagram are sent, as its first fragment."""
    ip_id: int = 0

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        """A UDP datagram goes past; ports are (source, target)."""
        whole = udp(payload, ports or (source.port, target.port))
        data = whole if self.first is None else whole[: self.first]
        more = 0x2000 if self.first is not None else 0
        self.ip_id = self.ip_id % 65_535 + 1
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(data), self.ip_id, more, 64, 17, 0)
        hosts = IPv4Address(source.ip).packed + IPv4Address(target.ip).packed
        if not self.deaf:
            self.sent.append((self.now_ns, ethernet(0x0800, head + hosts + data)))
        self.now_ns += self.gap_ns

    def written(self) -> bytes:
        """The capture."""
        target = io.BytesIO()
        with PcapngWriter(target) as writer:
            for time_ns, data in self.sent:
                writer.write(time_ns, data)
        return target.getvalue()


def _askers(stage: Stage, number: int) -> list[tuple[Client, bytes]]:
    """Clients with an RPC activity and a slot of their own, and what each asks."""
    clients = []
    for each in range(number):
        client = Client(stage, activity=UUID(int=each + 1))
        client.channel = client.at(slot=each + 1)
        clients.append((client, message.read(each % 255 + 1, 1, message.address(PNU))))
    return clients


def calls_at_once() -> bytes:
    """More Writes than RPC activities are kept, then the responses to all of them."""
    stage = Quick()
    calls = [(client, client.ask_write(data), data) for client, data in _askers(stage, AT_ONCE)]
    for client, call, data in calls:
        client.accept_write(call, data)
    return stage.written()


def writes_at_once() -> bytes:
    """More Writes on one channel, and in one RPC activity, than are kept; then their responses and a Read."""
    stage = Quick()
    client = Client(stage)
    calls = [(client.ask_write(data), data) for data in map(request, range(1, 101))]
    for call, data in calls:
        client.accept_write(call, data)
    client.read(answer(1, 0))
    client.read(answer(2, 0))
    return stage.written()


def requests_alone() -> bytes:
    """More Writes of one channel, and in more RPC activities, than are kept, and nothing that answers them."""
    stage = Quick()
    client = Client(stage)
    for data in map(request, range(1, 101)):
        client.ask_write(data)
    for each, data in _askers(stage, AT_ONCE):
        each.ask_write(data)
    return stage.written()


def ip_fragments_at_once() -> bytes:
    """The beginnings of more IP datagrams than are kept, behind a transaction that shows whose they are."""
    stage = Quick()
    ask(Client(stage), 1)
    stage.first = 240
    for client, _ in _askers(stage, 300):
        client.ask_write(request(1))
    return stage.written()


def rpc_fragments_at_once() -> bytes:
    """The beginnings of more RPC messages than are kept, then what answers them."""
    stage = Quick()
    ask(Client(stage), 1)
    calls = []
    for client, data in _askers(stage, 1100):
        client.fragment = 92
        calls.append((client, client.ask_write(data), data))
        del stage.sent[-1]
        client.fragment = None
    for client, call, data in calls:
        client.accept_write(call, data)
    return stage.written()


def fragments_one_after_the_other() -> bytes:
    """The beginnings of 400 IP datagrams, each given up before the next one comes."""
    stage = Quick()
    ask(Client(stage), 1)
    stage.first = 240
    for client, _ in _askers(stage, 400):
        client.ask_write(request(1))
        stage.wait(40_000)
    return stage.written()


def clock_set_by_decades() -> bytes:
    """The clock begins in 1970, is set to 2026 and back again; there are fragments, polls and lost answers."""
    stage = Quick(now_ns=5 * 10**9 + 7)
    client = Client(stage)
    for number in range(24):
        client.fragment = 200 if number % 3 == 0 else None
        client.write(request(number + 1))
        if number % 4 == 1:
            client.poll()
        if number % 5 == 2:
            stage.wait(2500)
        client.read(answer(number + 1, number))
        if number % 7 == 3:
            del stage.sent[-1]
        stage.now_ns += 700_000_001 * (number + 1)
        if number in (5, 11, 17):
            stage.now_ns += (-1 if number == 11 else 1) * DECADES
        elif number == 20:
            stage.now_ns += QUARTER
    return stage.written()


ALL: tuple[Callable[[], bytes], ...] = (
    clock_back_with_lost_answers,
    clock_back_with_ip_fragments,
    cut_rpc_fragments,
    old_rpc_fragments,
    calls_at_once,
    writes_at_once,
    requests_alone,
    ip_fragments_at_once,
    rpc_fragments_at_once,
    fragments_one_after_the_other,
    clock_set_by_decades,
)
