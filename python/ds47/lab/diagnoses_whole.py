"""Scenarios: causes (DS7xx) that only the whole capture shows: habits, and what is missing. See `diagnoses`."""

from __future__ import annotations

from uuid import UUID

from ds47.lab import message
from ds47.lab.client import Client, controller, drive
from ds47.lab.diagnoses import (
    CYCLE,
    LOCAL,
    LONG,
    ask,
    fixed,
    polls,
    read,
    save,
    second_controller,
    speed,
)
from ds47.lab.ether import Host
from ds47.lab.scenario import Book
from ds47.lab.stage import Stage
from ds47.lab.wire import RecordId

BOOK = Book("diagnosis")

# Not saved (DS721)


@BOOK.scene("two changes, and no p0971 or p0977 until the end of the capture", "2 change ok, DS721")
def lost_at_power_off(client: Client) -> None:
    """Changes that stay in RAM."""
    for reference, value in ((1, 25.0), (2, 30.0)):
        client.exchange(fixed(reference, value), message.changed(reference, 1))
        client.wait(CYCLE)


@BOOK.scene("the same two changes, then p0977 = 1", "3 change ok")
def lost_at_power_off_not(client: Client) -> None:
    """Changes that are copied to ROM."""
    lost_at_power_off(client)
    save(Client(client.stage, sequence=4), 3)


@BOOK.scene(
    "a change at slot 2, then p0977 = 1 at slot 1, and the program goes on reading there",
    "2 change ok, read ok",
)
def lost_at_power_off_order_not(client: Client) -> None:
    """Changes at one submodule, copied to ROM at another."""
    client.exchange(fixed(1, 25.0), message.changed(1, 1), at=client.at(slot=2))
    save(client, 2)
    ask(client, 3)


# The same change again and again (DS723)


def _changes(client: Client, values: list[float]) -> None:
    """A change every 100 ms, then the copy to ROM."""
    for reference, value in enumerate(values, start=1):
        client.exchange(fixed(reference, value), message.changed(reference, 1))
        client.wait(96)
    save(client, len(values) + 1)


BOOK.scenes(
    _changes,
    ("request-held", "The same change again and again",
     "P2900 := 25.0, eight times, every 100 ms: REQ of WRREC stays TRUE", "9 change ok, DS723",
     [25.0] * 8),
    ("request-held-not", "Changes of a value that moves",
     "eight changes at the same period, each with a value of its own: a ramp", "9 change ok",
     [25.0 + number for number in range(8)]),
)  # fmt: skip


# Polls without a pause (DS724)


def _asked(client: Client, jobs: int, count: int, pause: float) -> None:
    """Reads of r0021, each polled `count` times with a pause between."""
    for reference in range(1, jobs + 1):
        client.write(read(reference))
        polls(client, count, pause)
        client.read(speed(reference, 1500.0 + reference))
        client.wait(CYCLE)


BOOK.scenes(
    _asked,
    ("polling-storm", "A Read in every cycle",
     "three reads in a row, RDREC in every cycle of 2 ms: twelve polls each", "3 read ok, DS204 DS724",
     3, 12, 0),
    ("polling-storm-not", "Reads with a pause",
     "the same drive, as slow as before, asked every 12 ms: two polls each", "3 read ok", 3, 2, CYCLE),
    ("polling-storm-one", "More than a hundred Reads for one response",
     "one read, polled 120 times in 240 ms", "read ok, DS204 DS724", 1, 120, 0),
)  # fmt: skip


# A part of the conversation (DS725)


class _OneWay(Stage):
    """A capture point that hears one station only."""

    def __init__(self, stage: Stage, speaker: str) -> None:
        super().__init__(shots=stage.shots)
        self.speaker = speaker

    def send(
        self,
        source: Host,
        target: Host,
        payload: bytes,
        ports: tuple[int, int] | None = None,
    ) -> None:
        self.deaf = source.ip != self.speaker
        super().send(source, target, payload, ports)


def _heard_from(client: Client, speaker: str) -> None:
    client.stage = _OneWay(client.stage, speaker)
    client.channel = RecordId(UUID(int=1), index=LOCAL)
    for reference in (1, 2, 3):
        ask(client, reference, 1500.0 + reference)


BOOK.scenes(
    _heard_from,
    ("half-captured", "Requests only",
     "a mirror port that carries what the controller sends and nothing else",
     "3 read incomplete, DS101 DS110 DS725", controller().ip),
    ("half-captured-responses", "Responses only",
     "a mirror port that carries what the drive sends and nothing else",
     "3 read orphan, DS102 DS403 DS725", drive().ip),
)  # fmt: skip


@BOOK.scene(
    "Reads of two controllers' responses, and no Write of anybody", "2 read orphan, DS403 DS725"
)
def half_captured_reads(client: Client) -> None:
    """Reads without any Write."""
    for reference, each in enumerate((client, second_controller(client)), start=1):
        each.read(speed(reference), at=each.at(index=LOCAL))
        client.wait(CYCLE)


@BOOK.scene(
    "the capture keeps 230 bytes of each frame: of ten values of an array four are there",
    "read ok, DS106 DS725",
)
def half_captured_cut(client: Client) -> None:
    """Frames cut by the snap length: the values."""
    _ten_values(client, 230)


@BOOK.scene("the capture keeps 260 bytes of each frame, and none is longer", "read ok")
def half_captured_cut_not(client: Client) -> None:
    """A snap length that cuts nothing."""
    _ten_values(client, 260)


@BOOK.scene("the capture keeps 128 bytes of each frame: no record is left of any of them", "DS725")
def half_captured_cut_short(client: Client) -> None:
    """Frames cut by the snap length: all that matters."""
    _ten_values(client, 128)


def _ten_values(client: Client, snap: int) -> None:
    client.stage.snap = snap
    answer = message.answer(1, 1, 1, message.real(*range(10)))
    client.exchange(read(1, message.address(2902, 0, 10)), answer)


@BOOK.scene(
    "the capturing machine says that it lost 14 frames, among them those of a Read",
    "read ok, read incomplete, read ok, DS110 DS725",
)
def half_captured_dropped(client: Client) -> None:
    """Frames lost while capturing."""
    ask(client, 1)
    client.write(read(2))
    client.stage.deaf = True
    client.read(speed(2))
    client.stage.deaf = False
    ask(client, 3, at=client.at(slot=2))
    client.stage.dropped = 14


@BOOK.scene(
    "no Read at all, and no call is missing by its number: nobody read",
    "read ok, read unanswered, read ok, DS401",
)
def half_captured_dropped_not(client: Client) -> None:
    """A Read that never was."""
    ask(client, 1)
    client.write(read(2))
    client.wait(LONG)
    ask(client, 3, at=client.at(slot=2))
    client.stage.dropped = 0


@BOOK.scene(
    "the capture starts behind a transaction and ends behind another one: whole conversations",
    "2 read ok",
)
def half_captured_not(client: Client) -> None:
    """A capture that starts and ends between transactions."""
    client.stage.deaf = True
    ask(client, 1)
    client.stage.deaf = False
    for reference in (2, 3):
        client.wait(100)
        ask(client, reference, 1480.0)
