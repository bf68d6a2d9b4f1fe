"""A capture of one program that asks one drive, by hand: the benchmark's second opinion.

Shares no code with the lab and the package, so that nothing is quick only because our own generator
writes it. One AR without its Connect, one RPC activity; Write and Read of a request for several
parameters, then the same request again with the next reference. Every eighth request is a change.
Same arguments, same bytes. A plain pcap.
"""

from __future__ import annotations

import argparse
import random
import struct
from collections.abc import Iterator
from pathlib import Path

FRAMES = 100_000
FRAMES_PER_TRANSACTION = 4
GAP_NS = 2_500_000
CHANGE_EVERY = 8
INDEX = 47

START = 1_750_000_000
AR = bytes.fromhex("5a5a000112344abc8def00c0ffee0001")
ACTIVITY = bytes.fromhex("0102030405060708090a0b0c0d0e0f10")
OBJECT = bytes.fromhex("0000a0de976cd11182710001 0301002a")  # little-endian, as the interface
INTERFACE = bytes.fromhex("0100a0de976cd111827100a02442df7d")
CONTROLLER, DRIVE = bytes.fromhex("0a010101"), bytes.fromhex("0a010121")
CONTROLLER_MAC, DRIVE_MAC = bytes.fromhex("020000000001"), bytes.fromhex("020000000021")
PORT = 34964

READ, WRITE = 2, 3
REQUEST, RESPONSE = 0, 2
FLAGS = {REQUEST: 0x20, RESPONSE: 0x0A}

WORD, FLOAT = 0x42, 0x08
PARAMETERS = ((21, FLOAT), (27, FLOAT), (68, FLOAT), (2, WORD), (722, WORD))
CHANGED = ((1120, FLOAT), (1121, FLOAT))


def request(reference: int, identifier: int, pnus: list[int]) -> bytes:
    """Header and addresses of one value each."""
    head = struct.pack(">BBBB", reference, identifier, 1, len(pnus))
    return head + b"".join(struct.pack(">BBHH", 0x10, 1, pnu, 0) for pnu in pnus)


def values(formats: list[int], chance: random.Random) -> bytes:
    """A block for each format."""
    return b"".join(
        struct.pack(">BBf", FLOAT, 1, chance.uniform(0, 3000))
        if code == FLOAT
        else struct.pack(">BBH", WORD, 1, chance.randrange(65536))
        for code in formats
    )


def exchange(number: int, chance: random.Random) -> tuple[bytes, bytes]:
    """The data of a Write and of the Read that fetches its response."""
    reference = number % 255 + 1
    change = number % CHANGE_EVERY == CHANGE_EVERY - 1
    pnus, formats = zip(*(CHANGED if change else PARAMETERS), strict=True)
    asked, held = request(reference, 2 if change else 1, list(pnus)), values(list(formats), chance)
    if change:
        return asked + held, bytes((reference, 2, 1, len(pnus)))
    return asked, bytes((reference, 1, 1, len(pnus))) + held


def block(kind: int, sequence: int, index: int, length: int, tail: bytes) -> bytes:
    """The header of a record, 64 bytes."""
    head = struct.pack(">HHBBH", kind, 60, 1, 0, sequence & 0xFFFF)
    place = struct.pack(">IHHHHI", 0, 1, 1, 0, index, length)
    return (head + AR + place + tail).ljust(64, b"\0")


def pdu(kind: int, opnum: int, sequence: int, first: int, body: bytes) -> bytes:
    """A connectionless RPC message; `first` begins the NDR header: a size, or the status."""
    arguments = struct.pack("<5I", first, len(body), 4096, 0, len(body)) + body
    head = struct.pack("<BBBB", 4, kind, FLAGS[kind], 0) + bytes((0x10, 0, 0, 0))
    tail = struct.pack(
        "<IIIHHHHHBB", 0, 1, sequence, opnum, 0xFFFF, 0xFFFF, len(arguments), 0, 0, 0
    )
    return head + OBJECT + INTERFACE + ACTIVITY + tail + arguments


def frame(number: int, to_drive: bool, payload: bytes) -> bytes:
    """Ethernet, IPv4 and UDP around it; no checksum of UDP."""
    addresses = (CONTROLLER + DRIVE) if to_drive else (DRIVE + CONTROLLER)
    macs = (DRIVE_MAC + CONTROLLER_MAC) if to_drive else (CONTROLLER_MAC + DRIVE_MAC)
    udp = struct.pack(">HHHH", PORT, PORT, 8 + len(payload), 0) + payload
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(udp), number & 0xFFFF, 0, 64, 17, 0)
    total = sum(struct.unpack(">10H", head + addresses))
    total = (total & 0xFFFF) + (total >> 16)
    checksum = ~((total & 0xFFFF) + (total >> 16)) & 0xFFFF
    return macs + b"\x08\x00" + head[:10] + struct.pack(">H", checksum) + addresses + udp


def payloads(count: int, index: int) -> Iterator[tuple[bool, bytes]]:
    """Whether it goes to the drive, and the RPC message, for each frame of so many exchanges."""
    chance = random.Random(11)
    for number in range(count):
        asked, answered = exchange(number, chance)
        call = 2 * number
        write = block(0x0008, call, index, len(asked), b"")
        yield True, pdu(REQUEST, WRITE, call, 4096, write + asked)
        written = block(0x8008, call, index, len(asked), b"")
        yield False, pdu(RESPONSE, WRITE, call, 0, written)
        read = block(0x0009, call + 1, index, 240, b"")
        yield True, pdu(REQUEST, READ, call + 1, 4096, read)
        fetched = block(0x8009, call + 1, index, len(answered), b"")
        yield False, pdu(RESPONSE, READ, call + 1, 0, fetched + answered)


def write(path: Path, frames: int = FRAMES, index: int = INDEX) -> int:
    """Write a pcap of `frames` record frames (a multiple of four); their number."""
    path.parent.mkdir(parents=True, exist_ok=True)
    written = 0
    with path.open("wb") as file:
        file.write(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 262_144, 1))
        for to_drive, payload in payloads(frames // FRAMES_PER_TRANSACTION, index):
            data = frame(written, to_drive, payload)
            time_ns = written * GAP_NS
            second, part = START + time_ns // 10**9, time_ns % 10**9
            file.write(struct.pack("<IIII", second, part, len(data), len(data)) + data)
            written += 1
    return written


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--frames", type=int, default=FRAMES, help="record frames")
    parser.add_argument(
        "--index", type=lambda text: int(text, 0), default=INDEX, help="47 or 0xB02F (default 47)"
    )
    arguments = parser.parse_args()
    print(f"{arguments.path}: {write(arguments.path, arguments.frames, arguments.index)} frames")


if __name__ == "__main__":
    main()
