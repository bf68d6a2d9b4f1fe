"""Captures of S7 communication made by hand, byte by byte: stations, a server, and whatever one says to the other.

Knows nothing of what ds47 makes of it.
"""

from __future__ import annotations

import struct
from pathlib import Path

from ds47.capture.writer import PcapngWriter

JOB, ACK, ANSWER, USER = 1, 2, 3, 7
READ, WRITE = b"\x04", b"\x05"
DONE = 0xFF
SERVER = "10.0.0.100"


class Tape:
    """What was captured."""

    def __init__(self) -> None:
        self.shots: list[tuple[int, bytes]] = []
        self.now_ns = 1_767_254_400_000_000_000

    def put(self, data: bytes) -> int:
        """A frame; its number."""
        self.shots.append((self.now_ns, data))
        self.now_ns += 1_000_000
        return len(self.shots)

    def write(self, path: Path) -> Path:
        with PcapngWriter(path, link_type=1) as writer:
            for time_ns, data in self.shots:
                writer.write(time_ns, data)
        return path


class Talk:
    """A connection of station n to the server."""

    def __init__(self, tape: Tape, station: int = 1, port: int = 50_000) -> None:
        self.tape = tape
        self.client, self.port = f"10.0.0.{station}", port + station
        self.numbers = {True: 1_000, False: 9_000}
        self.reference = 0

    def segment(self, by_client: bool, payload: bytes = b"", flags: int = 0x18) -> int:
        ends = [(self.client, self.port), (SERVER, 102)]
        (source, source_port), (target, target_port) = ends if by_client else ends[::-1]
        tcp = struct.pack(
            ">HHIIBBHHH", source_port, target_port, self.numbers[by_client],
            self.numbers[not by_client], 5 << 4, flags, 8192, 0, 0,
        )  # fmt: skip
        self.numbers[by_client] += len(payload) + (flags & 3 > 0)
        addresses = b"".join(bytes(map(int, each.split("."))) for each in (source, target))
        size = 20 + len(tcp) + len(payload)
        head = struct.pack(">BBHHHBBH", 0x45, 0, size, 1, 0, 64, 6, 0) + addresses
        macs = (b"\2\0\0\0\0\1", b"\2\0\0\0\0\2")
        return self.tape.put(b"".join(macs) + b"\x08\x00" + head + tcp + payload)

    def tpkt(self, by_client: bool, payload: bytes) -> int:
        return self.segment(by_client, struct.pack(">BBH", 3, 0, len(payload) + 4) + payload)

    def say(
        self,
        by_client: bool,
        kind: int,
        parameter: bytes,
        content: bytes = b"",
        *,
        reference: int | None = None,
        error: int = 0,
    ) -> int:
        """A PDU; its reference is a new one where the client asks."""
        if reference is None:
            self.reference += 1
            reference = self.reference
        head = struct.pack(">BBHHHH", 0x32, kind, 0, reference, len(parameter), len(content))
        if kind in (ACK, ANSWER):
            head += struct.pack(">H", error)
        return self.tpkt(by_client, b"\2\xf0\x80" + head + parameter + content)

    # Connections

    def dial(self, slot: int = 2) -> Talk:
        self.segment(True, flags=2)
        self.segment(False, flags=18)
        ends = b"\xc0\1\x0a\xc1\2\1\0\xc2\2\3" + bytes((slot,))
        self.tpkt(True, bytes((6 + len(ends), 0xE0, 0, 0, 0, 1, 0)) + ends)
        return self

    def confirm(self) -> Talk:
        self.tpkt(False, b"\x06\xd0\0\1\0\2\0")
        return self

    def open(self, pdu: int = 480, parallel: int = 1, slot: int = 2) -> Talk:
        self.dial(slot).confirm()
        setup = struct.pack(">BBHHH", 0xF0, 0, parallel, parallel, pdu)
        self.say(True, JOB, setup)
        self.say(False, ANSWER, setup, reference=self.reference)
        return self

    def close(self) -> None:
        self.segment(True, flags=17)
        self.segment(False, flags=17)

    # Jobs: (number of the data block, first byte, bytes)

    def ask(self, *items: tuple[int, int, int], data: bytes | None = None) -> int:
        """The request of a read, or of a write of one item; the reference."""
        parameter = (READ if data is None else WRITE) + bytes((len(items),))
        for number, start, size in items:
            place = 0x84 << 24 | start * 8
            parameter += b"\x12\x0a\x10\2" + struct.pack(">HHI", size, number, place)
        content = b"" if data is None else struct.pack(">BBH", 0, 4, 8 * len(data)) + data
        self.say(True, JOB, parameter, content)
        return self.reference

    def bring(self, *values: bytes | int, reference: int | None = None) -> int:
        """The answer to a read: bytes, or the code of what failed."""
        content = b""
        for n, each in enumerate(values, 1):
            if isinstance(each, int):
                content += bytes((each, 0, 0, 0))
                continue
            fill = bytes(len(each) % 2 if n < len(values) else 0)
            content += struct.pack(">BBH", DONE, 4, 8 * len(each)) + each + fill
        parameter = READ + bytes((len(values),))
        return self.say(
            False, ANSWER, parameter, content, reference=reference or self.reference
        )  # fmt: skip

    def take(self, *codes: int, reference: int | None = None) -> int:
        """The answer to a write."""
        parameter = WRITE + bytes((len(codes),))
        return self.say(
            False, ANSWER, parameter, bytes(codes), reference=reference or self.reference
        )

    def get(self, number: int, start: int, value: bytes) -> Talk:
        self.ask((number, start, len(value)))
        self.bring(value)
        return self

    def put(self, number: int, start: int, value: bytes) -> Talk:
        self.ask((number, start, len(value)), data=value)
        self.take(DONE)
        return self

    # Programs

    def segment_of(
        self, r_id: int, data: bytes, sequence: int, last: bool, total: int | None
    ) -> int:
        """A part of a BSEND; the reference."""
        parameter = bytes((0, 1, 0x12, 8, 0x12, 0x46, 1, sequence, 0, not last, 0, 0))
        body = struct.pack(">BBBBI", 0x12, 6, 0x13, 0, r_id)
        body += (b"" if total is None else struct.pack(">H", total)) + data
        self.say(True, USER, parameter, struct.pack(">BBH", DONE, 9, len(body)) + body)
        return self.reference

    def acknowledge(self, reference: int, sequence: int = 5, error: int = 0) -> int:
        parameter = bytes((0, 1, 0x12, 8, 0x12, 0x86, 1, sequence, 0, 0)) + struct.pack(">H", error)
        return self.say(False, USER, parameter, b"\x0a\0\0\0", reference=reference)

    def szl(self, number: int, index: int, entry: bytes) -> int:
        """The client reads a part of the system status list: an entry, whose index it begins with."""
        ask = struct.pack(">BBHHH", DONE, 9, 4, number, index)
        self.say(True, USER, b"\0\1\x12\4\x11\x44\1\0", ask)
        told = struct.pack(">4H", number, index, len(entry), 1) + entry
        content = struct.pack(">BBH", DONE, 9, len(told)) + told
        parameter = b"\0\1\x12\x08\x12\x84\1\1\0\0\0\0"
        return self.say(False, USER, parameter, content, reference=self.reference)

    def usend(self, r_id: int, *areas: bytes) -> int:
        parameter = struct.pack(">BBBBBBI", 0, 1, 0x12, 6, 0x13, 0, r_id)
        body = b"".join(
            struct.pack(">BBH", 0, 4, 8 * len(each)) + each + bytes(len(each) % 2) for each in areas
        )
        return self.say(True, USER, parameter, struct.pack(">BBH", DONE, 9, len(areas)) + body)
