"""A capture of one client that polls a server by S7 communication, by hand.

Shares no code with the lab and the package, so that nothing is quick only because our own generator
writes it. One connection with its setup, PDU 480; then jobs, one after the other: a GET of 100 bytes of a
data block, and every eighth a PUT of 16 bytes to another one. Same arguments, same bytes. A plain pcap.
"""

from __future__ import annotations

import argparse
import struct
from collections.abc import Iterator
from pathlib import Path

FRAMES = 100_000
GAP_US = 5_000
ANSWER_US = 1_200
PUT_EVERY = 8
START = 1_750_000_000

CLIENT, SERVER = bytes.fromhex("0a020105"), bytes.fromhex("0a020101")
CLIENT_MAC, SERVER_MAC = bytes.fromhex("020000000005"), bytes.fromhex("020000000001")
PORTS = 49_512, 102
SYN, ACK, PSH = 2, 16, 8

CONNECT = bytes.fromhex("0300001611e00000000100c0010ac1020100c2020102")
CONFIRM = bytes.fromhex("0300001611d00001000100c0010ac1020100c2020102")
GET, PUT = 4, 5
READ_BYTES, WRITTEN_BYTES = 100, 16


def pdu(kind: int, reference: int, parameter: bytes, data: bytes = b"") -> bytes:
    """TPKT, COTP DT and an S7 PDU: 1 is a job, 3 its answer."""
    head = struct.pack(">BBHHHH", 0x32, kind, 0, reference, len(parameter), len(data))
    if kind == 3:
        head += b"\0\0"
    body = b"\x02\xf0\x80" + head + parameter + data
    return struct.pack(">BBH", 3, 0, len(body) + 4) + body


def item(function: int, block: int, length: int) -> bytes:
    """The parameter of a job with one area of bytes."""
    return bytes((function, 1, 0x12, 0x0A, 0x10, 2)) + struct.pack(
        ">HHBBH", length, block, 0x84, 0, 0
    )


def value(length: int, number: int) -> bytes:
    """A return code, the kind, the length in bits, and bytes that change."""
    return struct.pack(">BBH", 0xFF, 4, length * 8) + (number & 0xFFFF).to_bytes(2) * (length // 2)


def job(number: int) -> tuple[bytes, bytes]:
    """A job and its answer."""
    reference = number & 0xFFFF
    if number % PUT_EVERY == PUT_EVERY - 1:
        data = b"\0" + value(WRITTEN_BYTES, number)[1:]
        return pdu(1, reference, item(PUT, 2, WRITTEN_BYTES), data), pdu(
            3, reference, b"\x05\x01", b"\xff"
        )
    answer = pdu(3, reference, b"\x04\x01", value(READ_BYTES, number))
    return pdu(1, reference, item(GET, 1, READ_BYTES)), answer


def segment(from_client: bool, numbers: list[int], data: bytes, flags: int, count: int) -> bytes:
    """An Ethernet frame with a TCP segment; `numbers` are the next ones of client and server."""
    own, other = (0, 1) if from_client else (1, 0)
    tcp = struct.pack(
        ">HHIIBBHHH",
        PORTS[own],
        PORTS[other],
        numbers[own],
        numbers[other],
        0x50,
        flags,
        8192,
        0,
        0,
    )
    numbers[own] = (numbers[own] + len(data) + (flags & SYN > 0)) & 0xFFFFFFFF
    size = 20 + len(tcp) + len(data)
    hosts = (CLIENT, SERVER) if from_client else (SERVER, CLIENT)
    ip = struct.pack(">BBHHHBBH", 0x45, 0, size, count & 0xFFFF, 0x4000, 64, 6, 0) + b"".join(hosts)
    macs = (SERVER_MAC, CLIENT_MAC) if from_client else (CLIENT_MAC, SERVER_MAC)
    return b"".join(macs) + b"\x08\x00" + ip + tcp + data


def line(frames: int) -> Iterator[tuple[int, bytes]]:
    """Microseconds and bytes of each frame."""
    numbers = [1_000_000, 9_000_000]
    setup = bytes.fromhex("f0000001000101e0")
    opening = [
        (True, b"", SYN), (False, b"", SYN | ACK), (True, CONNECT, ACK | PSH), (False, CONFIRM, ACK | PSH),
        (True, pdu(1, 0, setup), ACK | PSH), (False, pdu(3, 0, setup), ACK | PSH),
    ]  # fmt: skip
    for count, (from_client, data, flags) in enumerate(opening):
        yield count * 100, segment(from_client, numbers, data, flags, count)
    for number in range(1, (frames - len(opening)) // 2 + 1):
        asked, answered = job(number)
        now, count = number * GAP_US, len(opening) + 2 * number
        yield now, segment(True, numbers, asked, ACK | PSH, count)
        yield now + ANSWER_US, segment(False, numbers, answered, ACK | PSH, count + 1)


def write(path: Path, frames: int = FRAMES) -> None:
    """Write a pcap of so many frames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as out:
        out.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 1))
        for now, data in line(frames):
            seconds, rest = divmod(now, 1_000_000)
            out.write(struct.pack("<IIII", START + seconds, rest, len(data), len(data)) + data)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("path", type=Path)
    parser.add_argument("--frames", type=int, default=FRAMES)
    arguments = parser.parse_args()
    write(arguments.path, arguments.frames)


if __name__ == "__main__":
    main()
