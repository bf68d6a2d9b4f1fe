"""Scenarios: every format of a value that has a known size, read and changed."""

from __future__ import annotations

from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.scenario import Book

BOOK = Book("format")

EXAMPLES: tuple[tuple[int, int, str], ...] = (
    (0x01, 1, "01"),
    (0x02, 2, "80 7f"),
    (0x02, 3, "80 ff 7f"),
    (0x03, 2, "8000 7fff"),
    (0x04, 2, "80000000 7fffffff"),
    (0x05, 1, "ff"),
    (0x05, 2, "00 ff"),
    (0x06, 1, "ffff"),
    (0x07, 1, "ffffffff"),
    (0x08, 4, "3dcccccd 7f7fffff 7f800000 7fc00000"),
    (0x09, 5, "4d6f746f72"),
    (0x0A, 4, "00 2a ff 47"),
    (0x0C, 1, "0036ee80 3bf7"),
    (0x0D, 1, "000003e8"),
    (0x0E, 2, "a5 5a"),
    (0x0F, 1, "3fb999999999999a"),
    (0x16, 1, "a5"),
    (0x17, 1, "a55a"),
    (0x18, 1, "a55a0ff0"),
    (0x19, 1, "41"),
    (0x1A, 1, "4142"),
    (0x1B, 1, "41424344"),
    (0x1C, 1, "4142434445464748"),
    (0x1D, 1, "4142434445464748494a4b4c4d4e4f50"),
    (0x32, 1, "c350 1e 0c 35 0b 1a"),
    (0x34, 1, "0036ee80"),
    (0x35, 1, "000003e8 0002"),
    (0x36, 1, "000003e8"),
    (0x37, 1, "8000000000000000"),
    (0x38, 1, "ffffffffffffffff"),
    (0x39, 1, "a55a0ff0a55a0ff0"),
    (0x3A, 1, "83aa7e8000000000"),
    (0x3B, 1, "0000000100000000"),
    (0x41, 3, "01 02 03"),
    (0x42, 1, "047e"),
    (0x43, 1, "12345678"),
    (0x65, 1, "41200000 80"),
    (0x66, 1, "01 80"),
    (0x67, 1, "0102 80"),
    (0x68, 1, "0102"),
    (0x69, 1, "ff02"),
    (0x6A, 1, "81"),
    (0x6E, 1, "00010203"),
    (0x6F, 1, "0001020304"),
    (0x70, 1, "000102030405"),
    (0x71, 2, "4000 c000"),
    (0x72, 2, "40000000 c0000000"),
    (0x73, 1, "a55a"),
    (0x74, 1, "1234"),
    (0x75, 1, "2000"),
    (0x76, 1, "000a"),
    (0x77, 1, "0000000a"),
    (0x78, 1, "4000"),
    (0x79, 1, "0080"),
    (0x7A, 1, "00002710"),
    (0x7B, 1, "4000"),
    (0x7C, 1, "00004000"),
)
"""(format, number of values, values in hex); PNU n of the scenarios is 1000 + row."""


@BOOK.scene("true values of every type", f"{len(EXAMPLES)} read ok")
def read(client: Client) -> None:
    """Every format, read."""
    for row, (code, count, data) in enumerate(EXAMPLES):
        address = message.address(1000 + row, elements=count)
        block = message.raw_block(code, count, bytes.fromhex(data))
        client.exchange(message.read(row + 1, 1, address), message.answer(row + 1, 1, 1, block))


@BOOK.scene("a value block of every type in a change request", f"{len(EXAMPLES)} change ok, DS721")
def change(client: Client) -> None:
    """Every format, written."""
    for row, (code, count, data) in enumerate(EXAMPLES):
        address = message.address(1000 + row, elements=count)
        block = message.raw_block(code, count, bytes.fromhex(data))
        request = message.change(row + 1, 1, (address, block))
        client.exchange(request, message.changed(row + 1, 1))


@BOOK.scene("one pad byte after each block of odd length", "read ok")
def mixed(client: Client) -> None:
    """Odd and even value blocks in one response."""
    # Without the pad byte everything behind an odd one shifts.
    chosen = [row for row in EXAMPLES if row[0] in (0x01, 0x05, 0x09, 0x02, 0x08, 0x41, 0x37)]
    addresses = [message.address(1000 + n, elements=row[1]) for n, row in enumerate(chosen)]
    blocks = [message.raw_block(code, count, bytes.fromhex(data)) for code, count, data in chosen]
    client.exchange(message.read(1, 1, *addresses), message.answer(1, 1, 1, *blocks))


@BOOK.scene(
    "attributes 0x20 and 0x30: one element, the name, the whole description, a text array",
    "4 read ok",
)
def description(client: Client) -> None:
    """Parameter description and text."""
    whole = bytes.fromhex("8106 0000 3f800000 00 00 00000000") + b"Speed setpoint  "
    whole += bytes.fromhex("00000000 0000ffff 0000 0000 07d0 800e")
    about, text = message.DESCRIPTION, message.TEXT
    for reference, (address, block) in enumerate(
        (
            (message.address(922, 1, 1, about), message.raw_block(0x42, 1, b"\x81\x06")),
            (message.address(922, 6, 1, about), message.raw_block(0x41, 16, b"Telegram".ljust(16))),
            (message.address(922, 0, 1, about), message.raw_block(0x0A, 46, whole)),
            (message.address(922, 0, 2, text), message.raw_block(0x41, 32, b"Standard".ljust(32))),
        ),
        start=1,
    ):
        client.exchange(message.read(reference, 1, address), message.answer(reference, 1, 1, block))


@BOOK.scene(
    "drive object 2 describes two parameters: from then on its values have a name, a unit and a physical value, "
    "and a change in another type is known to be one; drive object 3 has described nothing",
    "5 read ok, change error, change ok, DS410 DS714 DS721",
)
def described(client: Client) -> None:
    """Names, units and types from a drive."""
    up, down = message.address(1120), message.address(1121)
    for reference, axis, where, block in (
        (1, 2, up, message.word(1000)),
        (2, 2, _about(1120), _time("Ramp-up time")),
        (3, 2, up, message.word(1000)),
        (4, 3, up, message.word(500)),
        (5, 2, _about(1121), _time("Ramp-down time")),
    ):
        client.exchange(
            message.read(reference, axis, where), message.answer(reference, 1, axis, block)
        )
    refused = message.answer(6, 0x82, 2, message.error(0x05))
    client.exchange(message.change(6, 2, (down, message.real(1500))), refused)
    client.exchange(message.change(7, 2, (down, message.word(1500))), message.changed(7, 2))


def _about(pnu: int) -> bytes:
    """The address of a whole description."""
    return message.address(pnu, 0, 1, message.DESCRIPTION)


def _time(name: str) -> bytes:
    """The description of a time in steps of 10 ms: Unsigned16, 0 to 65000."""
    head = bytes.fromhex("0006 0000 3f800000 04 fe 00000000")
    limits = bytes.fromhex("00000000 0000fde8 0000 0000 0000 0000")
    return message.raw_block(0x0A, 46, head + name.encode().ljust(16) + limits)
