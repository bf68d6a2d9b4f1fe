"""Scenarios: causes (DS7xx) that the place of a call betrays, and its connection. See `diagnoses`."""

from __future__ import annotations

from uuid import UUID

from ds47.lab import message
from ds47.lab.client import Client, drive
from ds47.lab.diagnoses import (
    CONFUSED,
    CYCLE,
    DF_ACCESS,
    DF_INDEX,
    DF_SLOT,
    GLOBAL,
    LOCAL,
    LONG,
    ask,
    polls,
    read,
    speed,
)
from ds47.lab.scenario import Book

BOOK = Book("diagnosis")

# Asked at one submodule, read at another (DS706)


@BOOK.scene(
    "WRREC has the hardware identifier of slot 1.1, RDREC that of 1.2: the drive has nothing there",
    "read unanswered, DS206 DS401 DS706",
)
def request_here_read_there(client: Client) -> None:
    """Two hardware identifiers: the Read is refused."""
    client.connect("plc-1")
    client.write(read(1))
    client.wait(CYCLE)
    polls(client, 3, at=client.at(subslot=2))
    client.wait(LONG)
    polls(client, 1, at=client.at(subslot=2))


@BOOK.scene("the same polls at the submodule that was asked, and the response at last", "read ok")
def request_here_read_there_not(client: Client) -> None:
    """One hardware identifier for both blocks."""
    client.write(read(1))
    client.wait(CYCLE)
    polls(client, 3)
    client.read(speed(1))


@BOOK.scene(
    "asked at slot 1.1, answered at 1.2: a drive with one channel for all its submodules",
    "read unanswered, read orphan, read ok, DS401 DS403 DS706",
)
def request_here_read_there_answered(client: Client) -> None:
    """Two hardware identifiers: the Read is answered."""
    client.write(read(1))
    client.wait(CYCLE)
    client.read(speed(1), at=client.at(subslot=2))
    client.wait(LONG)
    ask(client, 2, at=client.at(slot=2))


# 16#47 is not 47 (DS707)


@BOOK.scene("INDEX := 16#47: the drive has no record 71 and says so", "DS707")
def wrong_record_index(client: Client) -> None:
    """A request on record 71."""
    for reference in (1, 2):
        client.write(read(reference), status=DF_INDEX, at=client.at(index=CONFUSED))
        client.wait(500)


@BOOK.scene("record 71 refused as well, but what it holds is no parameter request")
def wrong_record_index_not(client: Client) -> None:
    """Another record with the number 71."""
    for number in (1, 2):
        recipe = bytes((number, 0, 0, 25)) + b"recipe"
        client.write(recipe, status=DF_INDEX, at=client.at(index=CONFUSED))
        client.wait(500)


@BOOK.scene("a digit off: 16#B02D instead of 16#B02E, refused", "read ok, DS707")
def wrong_record_index_other(client: Client) -> None:
    """A request on record 0xB02D, then on 0xB02E."""
    client.write(read(1), status=DF_INDEX, at=client.at(index=LOCAL - 1))
    client.wait(500)
    ask(client, 2, at=client.at(index=LOCAL))


@BOOK.scene(
    "record 0xB02D is accepted: the device has one of that number, whatever it means there",
    "read ok",
)
def wrong_record_index_other_not(client: Client) -> None:
    """A record of the maker that looks like a request."""
    client.write(read(1), at=client.at(index=LOCAL - 1))
    client.wait(500)
    ask(client, 2, at=client.at(index=LOCAL))


# Another slot (DS708)


@BOOK.scene(
    "slot 5 is refused with DF80B200, slot 1 of the same drive answers",
    "read refused, read ok, DS203 DS708",
)
def wrong_slot(client: Client) -> None:
    """The hardware identifier of a slot that is not there."""
    client.write(read(1), status=DF_SLOT, at=client.at(slot=5))
    client.wait(100)
    ask(client, 2)


@BOOK.scene(
    "slot 5 is refused, and no other was asked: the capture does not know a better one",
    "2 read refused, DS203",
)
def wrong_slot_not(client: Client) -> None:
    """A slot that is not there, and no other."""
    for reference in (1, 2):
        client.write(read(reference), status=DF_SLOT, at=client.at(slot=5))
        client.wait(100)


@BOOK.scene(
    "the diagnostic address of slot 0: DF80B600; slot 1 of the same drive answers",
    "read refused, read ok, DS203 DS708",
)
def wrong_slot_denied(client: Client) -> None:
    """The station's own submodule instead of the drive's."""
    client.write(read(1), status=DF_ACCESS, at=client.at(slot=0))
    client.wait(100)
    ask(client, 2)


@BOOK.scene(
    "slot 5 of one drive is refused, slot 1 of another one answers: that says nothing of the first",
    "read refused, read ok, DS203",
)
def wrong_slot_other_drive_not(client: Client) -> None:
    """A slot that is not there, and another drive that answers."""
    client.write(read(1), status=DF_SLOT, at=client.at(slot=5))
    client.wait(100)
    other = Client(
        client.stage, device=drive(2), channel=client.at(ar=UUID(int=2)), activity=UUID(int=2)
    )
    ask(other, 1)


# The axis byte that nobody looks at (DS710)


def _two_axes(client: Client, index: int) -> None:
    """DO 1 and DO 2 asked at the same submodule."""
    for axis in (1, 2):
        client.exchange(
            read(axis, axis=axis), speed(axis, 1500.0, axis), at=client.at(slot=2, index=index)
        )
        client.wait(CYCLE)


BOOK.scenes(
    _two_axes,
    ("axis-byte-ignored", "Two axis numbers on the local access point",
     "axes 1 and 2 asked through 0xB02E of slot 2: both times the same drive object answers",
     "2 read ok, DS710", LOCAL),
    ("axis-byte-ignored-not", "Two axis numbers on the global access point",
     "the same through 0xB02F, where the axis byte counts", "2 read ok", GLOBAL),
)  # fmt: skip


# The connection ends inside a job (DS722)


@BOOK.scene("the controller releases the AR while the drive works", "read unanswered, DS401 DS722")
def connection_lost(client: Client) -> None:
    """Release inside a job."""
    client.connect("plc-1")
    client.write(read(1))
    polls(client, 2)
    client.release()


@BOOK.scene("the response is read, then the AR is released", "read ok")
def connection_lost_not(client: Client) -> None:
    """Release after the job."""
    client.connect("plc-1")
    client.write(read(1))
    polls(client, 2)
    client.read(speed(1))
    client.release()


@BOOK.scene(
    "a change whose response nobody reads (WRREC only), and a minute later the AR is released",
    "change unanswered, DS402",
)
def connection_lost_unread_not(client: Client) -> None:
    """Release long after a change."""
    client.connect("plc-1")
    client.write(message.change(1, 1, (message.address(977), message.word(1))))
    client.wait(60_000)
    client.release()


def _restart(client: Client, read_before: bool) -> None:
    """The drive restarts; the controller sets up a new AR, under another UUID, and asks again."""
    client.connect("plc-1")
    client.write(read(1))
    if read_before:
        client.read(speed(1))
    client.wait(3000)
    client.channel = client.at(ar=UUID("47474747-0003-4000-8000-000000000003"))
    client.connect("plc-1")
    ask(client, 2)


BOOK.scenes(
    _restart,
    ("connection-lost-restart", "A new Connect inside a job",
     "no Release: a new Connect 3 s after the request, the drive was restarted",
     "read unanswered, read ok, DS401 DS722", False),
    ("connection-lost-restart-not", "A new Connect between two jobs",
     "the same restart, but the response was read before", "2 read ok", True),
)  # fmt: skip
