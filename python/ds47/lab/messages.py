"""Scenarios: messages that are wrong in themselves, one per rule about the format (DS3xx).

A table, because they differ in bytes only. All on index 0xB02F, which is ours whatever it carries.
"""

from __future__ import annotations

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.scenario import Book

BOOK = Book("message")

BAD_HEADER = 0xDF80B700
READ = "01010101 1001 0015 0000"
TEN = "01010101 0801 41200000"


_FORTY_ADDRESSES = "".join(f"1001{1000 + n:04x}0000" for n in range(40))


def _play(client: Client, request: str, response: str | None = None) -> None:
    """A request with its response; without a response the Write is refused."""
    at = client.at(index=0xB02F)
    if response is None:
        client.write(bytes.fromhex(request), status=BAD_HEADER, at=at)
    else:
        client.exchange(bytes.fromhex(request), bytes.fromhex(response), at=at)


ROWS = (
    ("reference-zero", "Request reference 0", "", "read ok, DS301", "00010101 1001 0015 0000",
     "00010101 0801 41200000"),
    ("request-id", "Unknown request ID, answered with 0x80", "", "unknown error, DS302 DS410 DS418",
     "01070101 1001 0015 0000", "01800101 4402 0021 0000"),
    ("count-zero", "No parameters", "", "read refused, DS203 DS303", "01010100"),
    ("count-high", "Forty parameters in one request", "", "read refused, DS203 DS304",
     "01010128" + _FORTY_ADDRESSES),
    ("attribute", "Attribute 0x50", "", "read ok, DS305", "01010101 5001 0015 0000", TEN),
    ("pnu-zero", "Parameter number 0", "", "read error, DS306 DS410 DS701", "01010101 1001 0000 0000",
     "01810101 4402 0000 0000"),
    ("elements-high", "255 elements", "", "read error, DS307 DS410 DS713", "01010101 10ff 0b56 0000",
     "01810101 4402 0015 0000"),
    ("subindex-overflow", "Two elements from subindex 65535", "", "read error, DS308 DS410 DS717",
     "01010101 1002 0b56 ffff", "01810101 4402 0003 ffff"),
    ("format-request", "A change in format 0x60", "", "change error, DS309 DS410 DS701",
     "01020101 1001 0b54 0000 6001 41300000", "01820101 4402 0017 0000"),
    ("format-response", "A response in format 0x7f", "", "read ok, DS309", READ, "01010101 7f01 41200000"),
    ("value-count", "Two values for one element", "", "change error, DS310 DS410 DS717",
     "01020101 1001 0b54 0000 0802 41300000 41300000", "01820101 4402 0018 0000"),
    ("pad-missing", "An odd block at the end without its pad byte", "", "change ok, DS311 DS721",
     "01020101 1001 03e8 0000 0501 07", "01020101"),
    ("pad-not-zero", "A pad byte of 0xff", "", "read ok, DS312", READ, "01010101 0501 07ff"),
    ("left-over", "Old bytes behind the request", "", "read ok, DS313", READ + "1001 001b 0000", TEN),
    ("left-over-zeros", "Zeros behind the response", "", "read ok, DS314", READ, TEN + "00" * 30),
    ("missing-request", "WRREC with LEN 8 for a request of 10 bytes", "", "read refused, DS203 DS315 DS711",
     READ[:-5]),
    ("missing-response", "A response that ends inside its value", "", "read error, DS315", READ, TEN[:-4]),
    ("size-ambiguous", "Format 0x21 with two bytes: N2 of the older profile", "", "read ok, DS317", READ,
     "01010101 2101 4000"),
    ("error-words", "An error block of three words", "", "read error, DS318 DS410 DS701", READ,
     "01810101 4403 0000 0000 1234"),
    ("error-no-words", "An error block without words", "", "read error, DS318 DS410 DS701", READ,
     "01810101 4400"),
    ("response-id", "Response ID 0x05", "", "read mismatch, DS319 DS405", READ, "01050101 0801 41200000"),
)  # fmt: skip
"""Name, title, what it shows, what it expects, the request, and the response if there is one."""

BOOK.scenes(_play, *ROWS)


@BOOK.scene(
    "a Write whose record is empty, on an index that is always ours",
    "unknown refused, DS203 DS315 DS711",
)
def empty(client: Client) -> None:
    """A request of no bytes."""
    client.write(b"", status=BAD_HEADER, at=client.at(index=0xB02F))


@BOOK.scene(
    "the drive says in r0974[0] that it takes 240 bytes, then gets a change of 412",
    "read ok, change ok, DS316 DS721",
)
def long(client: Client) -> None:
    """A message longer than the drive says it takes."""
    longest = message.address(974, 0, 3)
    client.exchange(message.read(1, 1, longest), message.answer(1, 1, 1, message.word(240, 39, 0)))
    array = (message.address(2902, 0, 100), message.real(*range(100)))
    client.exchange(message.change(2, 1, array), message.changed(2, 1))


@BOOK.scene("request IDs 0x51 and 0x42 of a VLT", "2 vendor ok")
def vendor(client: Client) -> None:
    """Vendor requests of the standard shape."""
    at = message.address(1200)
    client.exchange(
        message.header(1, 0x51, 0, 1) + at,
        message.answer(1, 0x51, 0, message.block(0x43, "I", 3000)),
    )
    client.exchange(
        message.header(2, 0x42, 0, 1) + at + message.word(2900), message.header(2, 0x42, 0, 1)
    )
