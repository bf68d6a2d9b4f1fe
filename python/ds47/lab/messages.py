"""Scenarios: messages that are wrong in themselves, one per rule about the format (DS3xx).

A table, because they differ in bytes only. All on index 0xB02F, which is ours whatever it carries.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.scenario import Book

BOOK = Book("message")

BAD_HEADER = 0xDF80B700
READ = "01010101 1001 0015 0000"
TEN = "01010101 0801 41200000"


@dataclass(frozen=True, slots=True)
class PrintedExample:
    """One request with its response in hex; without a response the Write is refused."""

    name: str
    title: str
    rules: str
    expect: str
    request: str
    response: str | None = None


_FORTY_ADDRESSES = "".join(f"1001{1000 + n:04x}0000" for n in range(40))

ROWS = (
    PrintedExample("reference-zero", "Request reference 0", "DS301", "read ok",
        "00010101 1001 0015 0000", "00010101 0801 41200000"),
    PrintedExample("request-id", "Unknown request ID, answered with 0x80", "DS302 DS410 DS418",
        "unknown error",
        "01070101 1001 0015 0000", "01800101 4402 0021 0000"),
    PrintedExample("count-zero", "No parameters", "DS203 DS303", "read refused", "01010100"),
    PrintedExample("count-high", "Forty parameters in one request", "DS203 DS304", "read refused",
        "01010128" + _FORTY_ADDRESSES),
    PrintedExample("attribute", "Attribute 0x50", "DS305", "read ok", "01010101 5001 0015 0000", TEN),
    PrintedExample("pnu-zero", "Parameter number 0", "DS306 DS410 DS701", "read error",
        "01010101 1001 0000 0000", "01810101 4402 0000 0000"),
    PrintedExample("elements-high", "255 elements", "DS307 DS410 DS713", "read error",
        "01010101 10ff 0b56 0000", "01810101 4402 0015 0000"),
    PrintedExample("subindex-overflow", "Two elements from subindex 65535", "DS308 DS410 DS717", "read error",
        "01010101 1002 0b56 ffff", "01810101 4402 0003 ffff"),
    PrintedExample("format-request", "A change in format 0x60", "DS309 DS410 DS701", "change error",
        "01020101 1001 0b54 0000 6001 41300000", "01820101 4402 0017 0000"),
    PrintedExample("format-response", "A response in format 0x7f", "DS309", "read ok",
        READ, "01010101 7f01 41200000"),
    PrintedExample("value-count", "Two values for one element", "DS310 DS410 DS717", "change error",
        "01020101 1001 0b54 0000 0802 41300000 41300000", "01820101 4402 0018 0000"),
    PrintedExample("pad-missing", "An odd block at the end without its pad byte", "DS311 DS721", "change ok",
        "01020101 1001 03e8 0000 0501 07", "01020101"),
    PrintedExample("pad-not-zero", "A pad byte of 0xff", "DS312", "read ok", READ, "01010101 0501 07ff"),
    PrintedExample("left-over", "Old bytes behind the request", "DS313", "read ok",
        READ + "1001 001b 0000", TEN),
    PrintedExample("left-over-zeros", "Zeros behind the response", "DS314", "read ok",
        READ, TEN + "00" * 30),
    PrintedExample("missing-request", "WRREC with LEN 8 for a request of 10 bytes", "DS203 DS315 DS711",
        "read refused", READ[:-5]),
    PrintedExample("missing-response", "A response that ends inside its value", "DS315", "read error",
        READ, TEN[:-4]),
    PrintedExample("size-ambiguous", "Format 0x21 with two bytes: N2 of the older profile", "DS317",
        "read ok",
        READ, "01010101 2101 4000"),
    PrintedExample("error-words", "An error block of three words", "DS318 DS410 DS701", "read error",
        READ, "01810101 4403 0000 0000 1234"),
    PrintedExample("error-no-words", "An error block without words", "DS318 DS410 DS701", "read error",
        READ, "01810101 4400"),
    PrintedExample("response-id", "Response ID 0x05", "DS319 DS405", "read mismatch",
        READ, "01050101 0801 41200000"),
)  # fmt: skip


def _play(row: PrintedExample, client: Client) -> None:
    at = client.at(index=0xB02F)
    if row.response is None:
        client.write(bytes.fromhex(row.request), status=BAD_HEADER, at=at)
    else:
        client.exchange(bytes.fromhex(row.request), bytes.fromhex(row.response), at=at)


for _row in ROWS:
    _shows = f"{_row.rules.replace(' ', ', ')} and no other finding"
    BOOK.add(_row.name, _row.title, _shows, partial(_play, _row), [_row.expect], _row.rules)


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
