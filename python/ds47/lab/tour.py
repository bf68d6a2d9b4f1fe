"""Scenario: an afternoon at a machine in ten transactions, for the first look at a report."""

from __future__ import annotations

from ds47.lab import ether, message
from ds47.lab.client import Client
from ds47.lab.naming import DCP, dcp_identify
from ds47.lab.scenario import Book

BOOK = Book("tour")

DO = 2
RAMP_UP, RAMP_DOWN = message.address(50303, 0, 1), message.address(50304, 0, 1)
FAULTS = message.address(945, 0, 4)
REFUSED_WHILE_BUSY = 0xDF80B500
LOCKED = 0x6B
IDENTIFICATION = 0xAFF0
"""I&M0: none of our calls, but the capture goes on with it."""


@BOOK.scene(
    "reads, changes, polls, refusals and an answer nobody fetched, as a report shows them",
    "read ok, change ok, 2 read ok, change refused, change error, read partial, change unanswered, "
    "DS203 DS402 DS410 DS417 DS701 DS705 DS719 DS721",
)
def machine(client: Client) -> None:
    """Commissioning of a DC drive: what works, what is refused, what is forgotten."""
    drive = client.device
    client.stage.frame(
        ether.bare(drive.mac, client.host.mac, DCP, dcp_identify(drive, "press-1-drive"))
    )
    ten, hundred = message.real(10.0), message.real(100.0)

    client.exchange(message.read(1, DO, RAMP_UP), message.answer(1, 1, DO, ten))
    client.wait(250)
    client.exchange(message.change(2, DO, (RAMP_DOWN, hundred)), message.changed(2, DO), polls=2)
    client.wait(100)
    client.exchange(message.read(3, DO, RAMP_DOWN), message.answer(3, 1, DO, message.real(60.0)))
    client.wait(400)
    faults = message.word(7900, 30002, 0, 0)
    client.write(message.read(4, DO, FAULTS))
    client.poll()
    client.write(message.change(5, DO, (RAMP_UP, ten)), status=REFUSED_WHILE_BUSY)
    client.read(message.answer(4, 1, DO, faults))
    client.wait(400)
    locked = message.answer(6, 0x82, DO, message.error(LOCKED))
    client.exchange(message.change(6, DO, (message.address(50076, 1, 1), hundred)), locked)
    client.wait(150)
    mixed = message.answer(7, 0x81, DO, ten, message.error(0x00, 0))
    client.exchange(message.read(7, DO, RAMP_UP, message.address(50999)), mixed)
    client.wait(150)
    client.write(message.change(8, DO, (RAMP_UP, ten)))
    client.wait(12_000)
    client.read(bytes(54), at=client.at(index=IDENTIFICATION))
