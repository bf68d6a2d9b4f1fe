"""Three stories of a controller and a drive: cyclic frames and what is read and changed meanwhile.

They are captures, and pictures of the documentation. Each rule by itself is in `cyclic_scenes`.
"""

from __future__ import annotations

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.cyclic import Cyclic, LabModule
from ds47.lab.drive import LabDrive
from ds47.lab.machine import OFF, ON, Machine
from ds47.lab.scenario import Book

BOOK = Book("cyclic")
TELEGRAM_1 = LabModule(2, 2, 4)
_IN_OPERATION = 0x6B


def _machine(client: Client, drive: LabDrive, reduction: int) -> Machine[Cyclic]:
    """Telegram 1, with the parameter channel in the same slot."""
    client.channel = client.at(slot=2, subslot=1)
    return Machine(Cyclic(client, (TELEGRAM_1,), reduction=reduction), drive).connect()


@BOOK.scene(
    "p50076 is not changed while the drive runs (0x6B), and is after OFF1",
    "change error, change ok, DS410 DS530 DS719 DS721",
)
def changed_after_off1(client: Client) -> None:
    """A change that is accepted only at standstill."""
    it = _machine(client, LabDrive(up_s=4, down_s=4), 32).control(OFF)
    it.run(0.5).setpoint(80).control(ON)
    it.until(lambda drive: drive.actual >= 79.9).run(1)
    asked = message.change(1, 2, (message.address(50076), message.word(1)))
    refused = message.answer(1, 0x82, 2, message.error(_IN_OPERATION))
    client.exchange(asked, refused)
    it.run(1).control(OFF).until(lambda drive: drive.state == "S2").run(0.5)
    asked = message.change(2, 2, (message.address(50076), message.word(1)))
    client.exchange(asked, message.changed(2, 2))
    it.run(1)


@BOOK.scene(
    "p50304 is changed from 10 to 100 s: OFF1 takes 10 s before, and 99 s after",
    "read ok, change ok, DS721",
)
def longer_ramp(client: Client) -> None:
    """The ramp-down time is changed, and the drive takes ten times as long to stop."""
    drive = LabDrive(up_s=5, down_s=10)
    it = _machine(client, drive, 128).control(OFF).run(0.5).setpoint(99).control(ON)
    it.until(lambda drive: drive.actual >= 98.9).run(1)
    it.control(OFF).until(lambda drive: drive.state == "S2").run(1)
    client.exchange(
        message.read(1, 2, message.address(50304)), message.answer(1, 1, 2, message.real(10.0))
    )
    asked = message.change(2, 2, (message.address(50304), message.real(100.0)))
    client.exchange(asked, message.changed(2, 2))
    drive.down_s = 100
    it.run(1).control(ON).until(lambda drive: drive.actual >= 98.9).run(1)
    it.control(OFF).until(lambda drive: drive.state == "S2").run(1)


@BOOK.scene(
    "16#047F stands from the first frame on; 16#047E, 16#047F: it runs 1.2 s later", "DS523"
)
def does_not_start(client: Client) -> None:
    """A drive that does not start, because ON is no edge."""
    drive = LabDrive(up_s=3, excite_s=1.2)
    it = (
        _machine(client, drive, 16)
        .setpoint(60)
        .control(ON)
        .run(5)
        .control(OFF)
        .run(0.5)
        .control(ON)
    )
    it.until(lambda drive: drive.actual >= 59.9).run(1)
