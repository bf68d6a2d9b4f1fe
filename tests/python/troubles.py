"""Conversations to which something rare happened, for the tests of both implementations.

The clock of the capturing computer is set back; a message comes in fragments that the snap length cut, or of
which the end was lost. The values are their own numbers, so that a wrong place shows.
"""

from __future__ import annotations

import io
from collections.abc import Callable

from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import Stage

PNU, COUNT = 100, 120
"""What is read, and how many values of it."""


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


ALL: tuple[Callable[[], bytes], ...] = (
    clock_back_with_lost_answers,
    clock_back_with_ip_fragments,
    cut_rpc_fragments,
    old_rpc_fragments,
)
