"""Scenarios: causes (DS7xx) that only the whole capture shows: habits, and what is missing. See `diagnoses`."""

from __future__ import annotations

from uuid import UUID

from ds47.lab import message
from ds47.lab.client import Client, controller, drive
from ds47.lab.diagnoses import (
    CYCLE,
    LOCAL,
    ORPHAN,
    UNANSWERED,
    ask,
    fixed,
    polls,
    read,
    save,
    speed,
    two_controllers,
)
from ds47.lab.ether import Host
from ds47.lab.scenario import OK_CHANGE, OK_READ, Book
from ds47.lab.stage import Stage
from ds47.lab.wire import Channel

BOOK = Book("diagnosis")

# Not saved (DS721)


@BOOK.scene(
    "lost-at-power-off",
    "two changes, and no p0971 or p0977 until the end of the capture",
    OK_CHANGE,
    OK_CHANGE,
    rules="DS721",
)
def lost_at_power_off(stage: Stage) -> None:
    """Changes that stay in RAM."""
    client = Client(stage)
    for reference, value in ((1, 25.0), (2, 30.0)):
        client.exchange(fixed(reference, value), message.changed(reference, 1))
        stage.wait(CYCLE)


@BOOK.scene(
    "lost-at-power-off-not",
    "the same two changes, then p0977 = 1",
    *[OK_CHANGE] * 3,
)
def lost_at_power_off_not(stage: Stage) -> None:
    """Changes that are copied to ROM."""
    lost_at_power_off(stage)
    client = Client(stage, sequence=4)
    save(client, 3)


@BOOK.scene(
    "lost-at-power-off-order-not",
    "a change at slot 2, then p0977 = 1 at slot 1, and the program goes on reading there",
    OK_CHANGE,
    OK_CHANGE,
    OK_READ,
)
def lost_at_power_off_order_not(stage: Stage) -> None:
    """Changes at one submodule, copied to ROM at another."""
    client = Client(stage)
    client.exchange(fixed(1, 25.0), message.changed(1, 1), at=client.at(slot=2))
    save(client, 2)
    ask(client, 3)


# The same change again and again (DS723)


def _changes(stage: Stage, values: list[float]) -> None:
    """A change every 100 ms, then the copy to ROM."""
    client = Client(stage)
    for reference, value in enumerate(values, start=1):
        client.exchange(fixed(reference, value), message.changed(reference, 1))
        stage.wait(96)
    save(client, len(values) + 1)


@BOOK.scene(
    "request-held",
    "P2900 := 25.0, eight times, every 100 ms: REQ of WRREC stays TRUE",
    *[OK_CHANGE] * 9,
    rules="DS723",
)
def request_held(stage: Stage) -> None:
    """The same change again and again."""
    _changes(stage, [25.0] * 8)


@BOOK.scene(
    "request-held-not",
    "eight changes at the same period, each with a value of its own: a ramp",
    *[OK_CHANGE] * 9,
)
def request_held_not(stage: Stage) -> None:
    """Changes of a value that moves."""
    _changes(stage, [25.0 + number for number in range(8)])


# Polls without a pause (DS724)


def _asked(stage: Stage, jobs: int, count: int, pause: float) -> None:
    """Reads of r0021, each polled `count` times with a pause between."""
    client = Client(stage)
    for reference in range(1, jobs + 1):
        client.write(read(reference))
        polls(client, count, pause)
        client.read(speed(reference, 1500.0 + reference))
        stage.wait(CYCLE)


@BOOK.scene(
    "polling-storm",
    "three reads in a row, RDREC in every cycle of 2 ms: twelve polls each",
    *[OK_READ] * 3,
    rules="DS204 DS724",
)
def polling_storm(stage: Stage) -> None:
    """A Read in every cycle."""
    _asked(stage, 3, 12, 0)


@BOOK.scene(
    "polling-storm-not",
    "the same drive, as slow as before, asked every 12 ms: two polls each",
    *[OK_READ] * 3,
)
def polling_storm_not(stage: Stage) -> None:
    """Reads with a pause."""
    _asked(stage, 3, 2, CYCLE)


@BOOK.scene(
    "polling-storm-one",
    "one read, polled 120 times in 240 ms",
    OK_READ,
    rules="DS204 DS724",
)
def polling_storm_one(stage: Stage) -> None:
    """More than a hundred Reads for one response."""
    _asked(stage, 1, 120, 0)


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


def _heard_from(stage: Stage, speaker: str) -> None:
    client = Client(_OneWay(stage, speaker), channel=Channel(UUID(int=1), index=LOCAL))
    for reference in (1, 2, 3):
        ask(client, reference, 1500.0 + reference)


@BOOK.scene(
    "half-captured",
    "a mirror port that carries what the controller sends and nothing else",
    *[UNANSWERED] * 3,
    rules="DS101 DS401 DS725",
)
def half_captured(stage: Stage) -> None:
    """Requests only."""
    _heard_from(stage, controller().ip)


@BOOK.scene(
    "half-captured-responses",
    "a mirror port that carries what the drive sends and nothing else",
    *[ORPHAN] * 3,
    rules="DS102 DS403 DS725",
)
def half_captured_responses(stage: Stage) -> None:
    """Responses only."""
    _heard_from(stage, drive().ip)


@BOOK.scene(
    "half-captured-reads",
    "Reads of two controllers' responses, and no Write of anybody",
    ORPHAN,
    ORPHAN,
    rules="DS403 DS725",
)
def half_captured_reads(stage: Stage) -> None:
    """Reads without any Write."""
    for reference, client in enumerate(two_controllers(stage), start=1):
        client.read(speed(reference), at=client.at(index=LOCAL))
        stage.wait(CYCLE)


@BOOK.scene(
    "half-captured-cut",
    "the capture keeps 230 bytes of each frame: of ten values of an array four are there",
    OK_READ,
    rules="DS106 DS725",
)
def half_captured_cut(stage: Stage) -> None:
    """Frames cut by the snap length: the values."""
    _ten_values(stage, 230)


@BOOK.scene(
    "half-captured-cut-not",
    "the capture keeps 260 bytes of each frame, and none is longer",
    OK_READ,
)
def half_captured_cut_not(stage: Stage) -> None:
    """A snap length that cuts nothing."""
    _ten_values(stage, 260)


@BOOK.scene(
    "half-captured-cut-short",
    "the capture keeps 128 bytes of each frame: no record is left of any of them",
    rules="DS725",
)
def half_captured_cut_short(stage: Stage) -> None:
    """Frames cut by the snap length: all that matters."""
    _ten_values(stage, 128)


def _ten_values(stage: Stage, snap: int) -> None:
    stage.snap = snap
    answer = message.answer(1, 1, 1, message.real(*range(10)))
    Client(stage).exchange(read(1, message.address(2902, 0, 10)), answer)


@BOOK.scene(
    "half-captured-dropped",
    "the capturing machine says that it lost 14 frames, among them those of a Read",
    OK_READ,
    UNANSWERED,
    OK_READ,
    rules="DS401 DS725",
)
def half_captured_dropped(stage: Stage) -> None:
    """Frames lost while capturing."""
    _with_a_gap(stage, dropped=14)


@BOOK.scene(
    "half-captured-dropped-not",
    "the same Read is missing, but the capture says that it lost nothing: nobody read",
    OK_READ,
    UNANSWERED,
    OK_READ,
    rules="DS401",
)
def half_captured_dropped_not(stage: Stage) -> None:
    """A Read that never was."""
    _with_a_gap(stage, dropped=0)


def _with_a_gap(stage: Stage, dropped: int) -> None:
    client = Client(stage)
    ask(client, 1)
    client.write(read(2))
    stage.deaf = True
    client.read(speed(2))
    stage.deaf = False
    other = client.at(slot=2)
    ask(client, 3, at=other)
    stage.dropped = dropped


@BOOK.scene(
    "half-captured-not",
    "the capture starts inside a transaction: one response without request, then whole conversations",
    ORPHAN,
    OK_READ,
    OK_READ,
    rules="DS403",
)
def half_captured_not(stage: Stage) -> None:
    """A capture that starts between Write and Read."""
    client = Client(stage)
    stage.deaf = True
    client.write(read(1))
    stage.deaf = False
    client.read(speed(1))
    for reference in (2, 3):
        stage.wait(100)
        ask(client, reference, 1480.0)
