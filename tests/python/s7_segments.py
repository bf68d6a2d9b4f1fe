"""S7 communication byte by byte, for the tests of ds47.s7: PDUs, TPKT, segments of TCP, captures."""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass, field, replace

from frames import MACS, pcap

from ds47.analysis import Analysis, AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.model import CaptureResult

CLIENT, SERVER = ("10.0.0.1", 49152), ("10.0.0.2", 102)
FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
_MASK = 0xFFFF_FFFF


def item(db: int, start: int, count: int, area: int = 0x84, size: int = 2) -> bytes:
    """An address S7ANY; `start` counts bits."""
    return bytes((0x12, 0x0A, 0x10, size)) + struct.pack(">HHI", count, db, area << 24 | start)


def header(kind: int, reference: int, parameter: bytes, data: bytes, error: int = 0) -> bytes:
    head = struct.pack(">BBHHHH", 0x32, kind, 0, reference, len(parameter), len(data))
    return head + (struct.pack(">H", error) if kind in (2, 3) else b"") + parameter + data


def job(reference: int, parameter: bytes, data: bytes = b"") -> bytes:
    return header(1, reference, parameter, data)


def answer(reference: int, parameter: bytes, data: bytes = b"", error: int = 0) -> bytes:
    return header(3, reference, parameter, data, error)


def get(reference: int, *items: bytes) -> bytes:
    return job(reference, bytes((4, len(items))) + b"".join(items))


def entry(value: bytes, code: int = 0xFF, size: int = 4) -> bytes:
    """An entry of data, without fill byte."""
    length = len(value) * (8 if size in (4, 5) else 1)
    return struct.pack(">BBH", code, size, length) + value


def filled(*entries: bytes) -> bytes:
    """Entries one behind the other: all but the last one have even lengths."""
    *first, last = entries
    return b"".join(each + bytes(len(each) % 2) for each in first) + last


def got(reference: int, *entries: bytes) -> bytes:
    return answer(reference, bytes((4, len(entries))), filled(*entries))


def put(reference: int, where: bytes, value: bytes) -> bytes:
    return job(reference, b"\5\1" + where, entry(value, 0))


def taken(reference: int, *codes: int) -> bytes:
    return answer(reference, bytes((5, len(codes))), bytes(codes))


def setup(reference: int = 0, pdu: int = 240, parallel: int = 1) -> bytes:
    return job(reference, struct.pack(">BBHHH", 0xF0, 0, parallel, parallel, pdu))


def agreed(reference: int = 0, pdu: int = 240, parallel: int = 1) -> bytes:
    return answer(reference, struct.pack(">BBHHH", 0xF0, 0, parallel, parallel, pdu))


def bsend(
    reference: int, r_id: int, data: bytes, *, sequence: int = 0, number: int = 0, last: bool = True,
    total: int | None = None,
) -> bytes:  # fmt: skip
    parameter = struct.pack(
        ">BBBBBBBBBBH", 0, 1, 0x12, 8, 0x12, 0x46, 1, sequence, number, not last, 0
    )
    front = struct.pack(">BBBBI", 0x12, 6, 0x13, 0, r_id)
    if sequence == 0:
        front += struct.pack(">H", len(data) if total is None else total)
    return header(
        7, reference, parameter, b"\xff\x09" + struct.pack(">H", len(front + data)) + front + data
    )


def received(reference: int, sequence: int, error: int = 0) -> bytes:
    parameter = struct.pack(">BBBBBBBBBBH", 0, 1, 0x12, 8, 0x12, 0x86, 1, sequence, 0, 0, error)
    return header(7, reference, parameter, b"\x0a\0\0\0")


def tpkt(cotp: bytes) -> bytes:
    return struct.pack(">BBH", 3, 0, 4 + len(cotp)) + cotp


def dt(pdu: bytes, parts: int = 1) -> bytes:
    """A PDU in so many TPDUs."""
    size = -(-len(pdu) // parts)
    cut = [pdu[at : at + size] for at in range(0, len(pdu), size)]
    return b"".join(
        tpkt(b"\x02\xf0" + (b"\x80" if each is cut[-1] else b"\0") + each) for each in cut
    )


def connect(code: int = 0xE0, client: str = "0100", server: str = "0102") -> bytes:
    calling, called = bytes.fromhex(client), bytes.fromhex(server)
    tail = (
        b"\xc0\x01\x0a\xc1"
        + bytes((len(calling),))
        + calling
        + b"\xc2"
        + bytes((len(called),))
        + called
    )
    body = bytes((code, 0, 0, 0, 1, 0)) + tail
    return tpkt(bytes((len(body),)) + body)


@dataclass
class Shot:
    """A segment."""

    up: bool
    sequence: int
    acknowledge: int
    flags: int
    data: bytes = b""
    time_ns: int = 0


@dataclass
class Talk:
    """A TCP connection: what is said becomes segments, in their order."""

    client: tuple[str, int] = CLIENT
    server: tuple[str, int] = SERVER
    shots: list[Shot] = field(default_factory=list)
    up: int = 1000
    down: int = 0xFFFF_FF00
    """Sequence numbers: those of the server run over soon."""

    def opened(self, *, cotp: bool = True, pdu: int | None = 240) -> Talk:
        """SYN, CR and CC, setup."""
        self.add(True, b"", SYN)
        self.add(False, b"", SYN | ACK)
        self.add(True, b"", ACK)
        if cotp:
            self.say(True, connect()).say(False, connect(0xD0))
        if pdu is not None:
            self.say(True, dt(setup(pdu=pdu))).say(False, dt(agreed(pdu=pdu)))
        return self

    def add(self, up: bool, data: bytes, flags: int = PSH | ACK) -> Talk:
        """One segment."""
        own, other = (self.up, self.down) if up else (self.down, self.up)
        step = len(data) + bool(flags & (SYN | FIN))
        self.shots.append(Shot(up, own, other, flags, data, len(self.shots) * 1_000_000))
        if up:
            self.up = (self.up + step) & _MASK
        else:
            self.down = (self.down + step) & _MASK
        return self

    def say(self, up: bool, data: bytes) -> Talk:
        """Data in one segment."""
        return self.add(up, data)

    def ask(self, pdu: bytes, told: bytes | None = None) -> Talk:
        """A PDU of the client, and what the server says to it."""
        self.say(True, dt(pdu))
        return self if told is None else self.say(False, dt(told))

    def closed(self) -> Talk:
        self.add(True, b"", FIN | ACK)
        self.add(False, b"", FIN | ACK)
        return self.add(True, b"", ACK)

    def frame(self, shot: Shot) -> bytes:
        """A segment as a frame."""
        source, destination = (self.client, self.server) if shot.up else (self.server, self.client)
        tcp = struct.pack(
            ">HHIIBBHHH", source[1], destination[1], shot.sequence, shot.acknowledge, 0x50, shot.flags,
            8192, 0, 0,
        ) + shot.data  # fmt: skip
        addresses = b"".join(bytes(map(int, each[0].split("."))) for each in (source, destination))
        head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 7, 0, 64, 6, 0) + addresses
        return (MACS + b"\x08\0" + head + tcp).ljust(60, b"\0")

    def frames(self) -> list[bytes]:
        return [self.frame(each) for each in self.shots]

    def cut(self, sizes: list[int]) -> Talk:
        """The same with the data in pieces of these sizes, again and again."""
        cut = replace(self, shots=[])
        number = 0
        for shot in self.shots:
            at = 0
            while at < len(shot.data) or at == 0:
                size = sizes[number % len(sizes)]
                number += 1
                part = shot.data[at : at + size]
                place = (shot.sequence + at) & _MASK
                cut.shots.append(replace(shot, sequence=place, data=part))
                at += size
        return cut


def capture(*talks: Talk, apart_s: int = 1) -> bytes:
    """A capture file with the frames of connections, one connection behind the other."""
    return pcap([frame for talk in talks for frame in talk.frames()], apart_s=apart_s)


def result(data: bytes, options: AnalysisOptions | None = None) -> CaptureResult:
    """The analysis of a capture, which handed out one by one says the same."""
    options = options or AnalysisOptions()
    whole = analyze(io.BytesIO(data), options)
    handed: list[tuple[str, str, tuple[int, ...]]] = []
    with open_capture(io.BytesIO(data)) as opened:
        Analysis(
            options,
            lambda item, _: handed.append((item.operation, item.state, tuple(item.frames.all()))),
        ).run(opened)
    alike = [(each.operation, each.state, tuple(each.frames.all())) for each in whole.transactions]
    assert sorted(handed) == sorted(alike)
    return whole
