"""Scenarios: requests and responses, each whole in itself, that do not fit each other (DS4xx)."""

from __future__ import annotations

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.scenario import Book

BOOK = Book("conversation")

SPEED, CURRENT, RAMP = message.address(21), message.address(27), message.address(1120)
ARRAY = message.address(2902, 0, 4)
READ = message.read(1, 1, SPEED)
BOTH = message.read(1, 1, SPEED, CURRENT)
CHANGE = message.change(1, 1, (RAMP, message.real(10.0)))
CHANGE_BOTH = message.change(
    1, 1, (RAMP, message.real(10.0)), (message.address(1121), message.real(5.0))
)
TEN, FIVE = message.real(10.0), message.real(5.0)
ANSWER = message.answer(1, 1, 1, TEN)
NO_PARAMETER, LIMIT, NOT_NOW = 0x00, 0x02, 0x6B

BOOK.scenes(
    Client.exchange,
    ("wrong-reference", "The response mirrors another reference", "", "read mismatch, DS404", READ,
     message.answer(2, 1, 1, TEN)),
    ("wrong-id", "A read answered as a change", "", "read mismatch, DS405", READ, message.changed(1, 1)),
    ("wrong-axis", "The response mirrors another DO", "", "read mismatch, DS406", READ,
     message.answer(1, 1, 2, TEN)),
    ("fewer-parameters", "Two parameters asked for, one answered", "", "read partial, DS407", BOTH,
     message.answer(1, 1, 1, TEN)),
    ("fewer-values", "Four elements asked for, two answered", "", "read ok, DS408",
     message.read(1, 1, ARRAY), message.answer(1, 1, 1, message.real(1.0, 2.0))),
    ("more-values", "One element asked for, five answered", "", "read ok, DS409",
     message.read(1, 1, message.address(964)), message.answer(1, 1, 1, message.word(1, 2, 3, 4, 5))),
    ("more-parameters", "One parameter asked for, two answered", "", "read mismatch, DS407", READ,
     message.answer(1, 1, 1, TEN, FIVE)),
    ("error", "A read of a parameter that does not exist", "", "read error, DS410 DS701", READ,
     message.answer(1, 0x81, 1, message.error(NO_PARAMETER))),
    ("error-one-word", "An error block without additional information", "", "read error, DS410 DS701", READ,
     message.answer(1, 0x81, 1, message.error(NO_PARAMETER, None))),
    ("partial-read", "One of two parameters failed", "", "read partial, DS410 DS701", BOTH,
     message.answer(1, 0x81, 1, TEN, message.error(NO_PARAMETER))),
    ("partial-change", "One of two changes failed", "", "change partial, DS410 DS719 DS721", CHANGE_BOTH,
     message.answer(1, 0x82, 1, message.done(), message.error(NOT_NOW))),
    ("error-change", "Both changes failed", "", "change error, DS410 DS719", CHANGE_BOTH,
     message.answer(1, 0x82, 1, message.error(LIMIT, 0), message.error(NOT_NOW))),
    ("positive-with-error", "A positive response with an error inside", "", "read partial, DS410 DS411",
     BOTH, message.answer(1, 1, 1, TEN, message.error(NO_PARAMETER))),
    ("negative-without-error", "A negative response without an error inside", "", "read error, DS412", READ,
     message.answer(1, 0x81, 1, TEN)),
    ("not-supported", "Response ID 0x80: only single access", "", "read error, DS410 DS418", READ,
     message.answer(1, 0x80, 1, message.error(0x21))),
)  # fmt: skip


def _goes_on(client: Client) -> None:
    """The capture does not end before it is clear that nobody reads: 12 s later the same client reads I&M0."""
    client.wait(12_000)
    client.read(bytes(54), at=client.at(index=0xAFF0))


@BOOK.scene("RDREC is never started", "read unanswered, DS401")
def read_unanswered(client: Client) -> None:
    """A read without a fetched response."""
    client.write(READ)
    _goes_on(client)


@BOOK.scene("WRREC only, as many programs do", "change unanswered, DS402")
def change_unread(client: Client) -> None:
    """A change whose response nobody fetches."""
    client.write(CHANGE)
    _goes_on(client)


@BOOK.scene("the Write request was not captured", "read orphan, DS403 DS725")
def orphan(client: Client) -> None:
    """A response without its request."""
    client.read(ANSWER, at=client.at(index=0xB02F))


@BOOK.scene(
    "a new request before the response of the first was fetched",
    "read superseded, read ok, DS413 DS705",
)
def superseded_read(client: Client) -> None:
    """A read displaced by a new request."""
    client.write(READ)
    client.exchange(message.read(2, 1, CURRENT), message.answer(2, 1, 1, FIVE))


@BOOK.scene(
    "changes one after another, responses never fetched but the last",
    "2 change superseded, change ok, DS414 DS721",
)
def superseded_change(client: Client) -> None:
    """Changes without reading the responses."""
    client.write(CHANGE)
    client.write(message.change(2, 1, (RAMP, message.real(11.0))))
    client.exchange(message.change(3, 1, (RAMP, message.real(12.0))), message.changed(3, 1))


@BOOK.scene("the response is fetched 30 s after the Write", "read ok")
def late_read(client: Client) -> None:
    """A late read."""
    client.write(READ)
    client.wait(30_000)
    client.read(ANSWER)


@BOOK.scene("the drive holds back its Read response for 1.5 s", "read ok, DS416")
def slow(client: Client) -> None:
    """A slow drive."""
    client.write(READ)
    call = client.ask_read()
    client.wait(1500)
    client.accept_read(call, ANSWER)


@BOOK.scene("10.0 was written, 9.5 is read back", "change ok, read ok, DS417 DS721")
def read_back(client: Client) -> None:
    """A value that reads back differently."""
    client.exchange(CHANGE, message.changed(1, 1))
    client.exchange(message.read(2, 1, RAMP), message.answer(2, 1, 1, message.real(9.5)))


@BOOK.scene("10.0 was written and is read back", "change ok, read ok, DS721")
def read_back_equal(client: Client) -> None:
    """A value that reads back as written."""
    client.exchange(CHANGE, message.changed(1, 1))
    client.exchange(message.read(2, 1, RAMP), message.answer(2, 1, 1, TEN))


@BOOK.scene("three requests with reference 1", "3 read ok, DS415")
def constant_reference(client: Client) -> None:
    """The reference never changes."""
    for _ in range(3):
        client.exchange(READ, ANSWER)
        client.wait(100)


@BOOK.scene(
    "two program parts on one channel: the second Read finds the response of the first",
    "read superseded, read mismatch, DS404 DS413 DS705",
)
def other_response(client: Client) -> None:
    """The response of another request."""
    client.write(READ)
    client.write(message.read(2, 1, CURRENT))
    client.read(ANSWER)


@BOOK.scene("the AR is released while the drive works", "read unanswered, DS401 DS722")
def released(client: Client) -> None:
    """Release of the AR inside a job."""
    client.write(READ)
    client.poll()
    client.release()


@BOOK.scene(
    "a change in a buffer of 36 bytes, refused with 0x18, then with LEN 16, accepted",
    "change error, change ok, DS314 DS410 DS419 DS717 DS721",
)
def accepted_with_other_length(client: Client) -> None:
    """A drive that wants the record exactly as long as its message."""
    pair = message.address(1120), message.real(10.0)
    refused = message.answer(1, 0x82, 1, message.error(0x18))
    client.exchange(message.change(1, 1, pair) + bytes(20), refused)
    client.exchange(message.change(2, 1, pair), message.changed(2, 1))
