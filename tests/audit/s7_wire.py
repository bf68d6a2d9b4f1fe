"""S7 communication of a capture, read anew: TCP in the order of its numbers, TPKT, COTP, PDUs, jobs, BSEND, USEND.

Bytes that no frame of the capture has are left out where a TPKT begins behind them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from tests.audit import wire
from tests.audit.wire import Frame

PORT = 102
CR, CC, DR, DT = 0xE0, 0xD0, 0x80, 0xF0
JOB, ACK, ANSWER, USER = 1, 2, 3, 7
READ, WRITE, SETUP = 4, 5, 0xF0
BITS = {1: 1, 2: 8, 3: 8, 4: 16, 5: 16, 6: 32, 7: 32, 8: 32, 0x1C: 16, 0x1D: 16}
NOWHERE = 0
"""The area of an item of an answer without its job."""
LETTERS = {1: "X", 2: "B", 3: "B", 4: "W", 5: "W", 6: "D", 7: "D", 8: "D"}
AREAS = {0x80: "P", 0x81: "I", 0x82: "Q", 0x83: "M", 0x84: "DB", 0x85: "DI", 0x1C: "C", 0x1D: "T"}


@dataclass
class Item:
    """A variable of a job; `start` counts bits, of timers and counters elements."""

    area: int
    db: int
    start: int
    kind: int
    count: int
    code: int | None = None
    data: bytes | None = None

    @property
    def elements(self) -> bool:
        return self.area in (0x1C, 0x1D)

    @property
    def size(self) -> int:
        """Bytes."""
        return (self.count * BITS.get(self.kind, 8) + 7) // 8

    @property
    def end(self) -> int:
        return self.start + self.count * (1 if self.elements else BITS.get(self.kind, 8))

    def text(self) -> str:
        """As a program of a PLC writes it."""
        letter = AREAS[self.area]
        if self.elements:
            return f"{letter}{self.start}" + (
                f"..{self.start + self.count - 1}" if self.count > 1 else ""
            )
        front = f"{letter}{self.db}.{letter}" if letter in ("DB", "DI") else letter
        byte, bit = divmod(self.start, 8)
        if self.count == 1 and self.kind == 1:
            return f"{front}{'X' if '.' in front else ''}{byte}.{bit}"
        if self.count == 1:
            return f"{front}{LETTERS[self.kind]}{byte}"
        return f"{front}B{byte}..{byte + self.size - 1}"


@dataclass
class Job:
    """A read or write."""

    line: Line
    by_client: bool
    write: bool
    reference: int
    asked: Frame
    items: list[Item]
    answered: Frame | None = None
    error: int = 0
    groups: list[int] = field(default_factory=list)
    """Of each address of the request, how many variables it names."""

    def bring(self, values: list[tuple[int, bytes]]) -> None:
        """Codes and bytes of the answer: of each variable, or of each address."""
        if len(values) != len(self.items) and len(values) == len(self.groups):
            rest, single = list(self.items), []
            for number, (code, data) in zip(self.groups, values, strict=True):
                some, rest = rest[:number], rest[number:]
                for item in some:
                    single.append((code, data[: item.size]))
                    data = data[item.size :]
            values = single
        for item, (code, data) in zip(self.items, values, strict=False):
            item.code, item.data = code, data if code == 0xFF else None

    @property
    def good(self) -> bool:
        return (
            self.answered is not None and not self.error and all(i.code == 0xFF for i in self.items)
        )

    @property
    def name(self) -> str:
        return "PUT" if self.write else "GET"

    @property
    def area(self) -> str:
        """What it names, four variables at the most."""
        return listed(self.items)


def listed(items: list[Item]) -> str:
    if items and all(each.area == NOWHERE for each in items):
        return f"{len(items)} x unknown address"
    texts = [each.text() for each in items]
    return ", ".join([*texts[:4], "..."] if len(texts) > 4 else texts) or "?"


@dataclass
class Part:
    """A segment of a BSEND."""

    frame: Frame
    by_client: bool
    reference: int
    sequence: int
    last: bool
    r_id: int
    total: int | None
    size: int
    answered: Frame | None = None
    assigned: int | None = None
    error: int = 0


@dataclass
class Sent:
    """A USEND."""

    frame: Frame
    by_client: bool
    r_id: int
    sizes: list[int]


@dataclass
class Line:
    """A TCP connection."""

    client: tuple[str, int]
    server: tuple[str, int]
    cr: Frame | None = None
    cc: Frame | None = None
    dr: Frame | None = None
    reason: int = 0
    """Of DR."""
    reset: Frame | None = None
    refused: Frame | None = None
    """The answer that refuses the setup,"""
    refusal: int = 0
    """and its class and code."""
    tsap: bytes | None = None
    length: int | None = None
    parallel: int | None = None
    setup: Frame | None = None
    lacks: bool = False
    jobs: list[Job] = field(default_factory=list)
    orphans: list[Job] = field(default_factory=list)
    """Answers without a job."""
    pdus: list[tuple[Frame, bool, int]] = field(default_factory=list)
    """Frame, who sends, bytes."""
    parts: list[Part] = field(default_factory=list)
    sent: list[Sent] = field(default_factory=list)
    said: list[tuple[int, int | str]] = field(default_factory=list)
    """Frames in which the server says how many bytes it reads consistently, or its order number."""
    others: int = 0


class _Way:
    """One direction of a connection."""

    def __init__(self, there: list[tuple[int, int]]) -> None:
        self.there = there
        """Where all segments of the capture begin, and how long they are."""
        self.next: int | None = None
        self.early: dict[int, bytes] = {}
        self.bytes = b""
        self.part = b""

    def take(self, number: int, data: bytes, opens: bool) -> None:
        if opens:
            self.next = (number + 1) & 0xFFFFFFFF
            return
        if self.next is None:
            self.next = number
        self.early[number] = data
        while True:
            for begin in list(self.early):
                behind = (self.next - begin) & 0xFFFFFFFF
                if behind < 1 << 31:
                    piece = self.early.pop(begin)[behind:]
                    self.bytes += piece
                    self.next = (self.next + len(piece)) & 0xFFFFFFFF
                    break
            else:
                if not self.early or self.bytes or self._comes(self.next):
                    return
                self.next = min(self.early, key=lambda n: (n - (self.next or 0)) & 0xFFFFFFFF)

    def _comes(self, number: int) -> bool:
        return any((number - begin) & 0xFFFFFFFF < size for begin, size in self.there)


def read(frames: list[Frame], ports: tuple[int, ...] = (PORT,)) -> list[Line]:
    """All connections, in the order of their first frames."""
    open_lines: dict[frozenset[tuple[str, int]], tuple[Line, dict[bool, _Way]]] = {}
    found: list[Line] = []
    segments = [each for frame in frames for each in _segments(frame, ports)]
    there: dict[tuple[str, int], list[tuple[int, int]]] = {}
    for _, source, _, number, _, data in segments:
        there.setdefault(source, []).append((number, len(data)))
    for frame, source, target, number, flags, data in segments:
        key = frozenset((source, target))
        opens = bool(flags & 2)
        if key not in open_lines or (opens and not flags & 16):
            client, server = (target, source) if source[1] in ports else (source, target)
            made = Line(client, server)
            found.append(made)
            both = _Way(there.get(client, [])), _Way(there.get(server, []))
            open_lines[key] = made, dict(zip((True, False), both, strict=True))
        line, ways = open_lines[key]
        by_client = source == line.client
        if flags & 4:
            line.reset = line.reset or frame
        if data or opens:
            ways[by_client].take(number, data, opens)
            for payload in _tpkts(ways[by_client]):
                _cotp(line, ways[by_client], by_client, frame, payload)
    for line, ways in open_lines.values():
        line.lacks = any(way.early or way.bytes for way in ways.values())
    return [each for each in found if each.cr or each.reset or each.pdus]


_End = tuple[str, int]


def ends(frame: Frame) -> set[str]:
    """The two IP addresses of a segment of S7."""
    return {end[0] for segment in _segments(frame, (PORT,)) for end in segment[1:3]}


def _segments(
    frame: Frame, ports: tuple[int, ...]
) -> Iterator[tuple[Frame, _End, _End, int, int, bytes]]:
    """The segment of TCP in a frame: from where, where to, number, flags, bytes."""
    packet = _ip(frame)
    if len(packet) < 40 or packet[0] >> 4 != 4 or packet[9] != 6:
        return
    head = (packet[0] & 15) * 4
    whole = packet[head : struct.unpack_from(">H", packet, 2)[0]]
    source_port, target_port, number = struct.unpack_from(">HHI", whole)
    if {source_port, target_port} & set(ports):
        ends = [".".join(map(str, packet[at : at + 4])) for at in (12, 16)]
        source, target = (ends[0], source_port), (ends[1], target_port)
        yield frame, source, target, number, whole[13], whole[(whole[12] >> 4) * 4 :]


def ways(frames: list[Frame]) -> Iterator[tuple[_End, _End, dict[bool, Way]]]:
    """Client and server of each connection, and what the capture has of the bytes of both (True: of the client)."""
    found: dict[tuple[_End, _End], dict[bool, Way]] = {}
    for frame in frames:
        for _, source, target, number, flags, data in _segments(frame, (PORT,)):
            up = target[1] == PORT
            ends = (source, target) if up else (target, source)
            both = found.setdefault(ends, {True: Way(), False: Way()})
            if flags & 2:
                both[up].start = (number + 1) & 0xFFFFFFFF
                both[not up].opens = True
            if data:
                both[up].pieces.append((number, len(data)))
            if flags & 16:
                packet = _ip(frame)
                head = (packet[0] & 15) * 4
                both[not up].has.append(int.from_bytes(packet[head + 8 : head + 12]))
    for (client, server), both in found.items():
        yield client, server, both


@dataclass
class Way:
    """The bytes that one end of a connection sends, as far as the capture shows them."""

    pieces: list[tuple[int, int]] = field(default_factory=list)
    """The number of the first one, and how many."""
    has: list[int] = field(default_factory=list)
    """What the other end says to have."""
    start: int | None = None
    """The number of the first byte, where its SYN is in the capture."""
    opens: bool = False
    """Whether the SYN of the other end is."""

    @property
    def silent(self) -> bool:
        """Whether there is none, and the other end has some."""
        return not self.pieces and self.lacks

    @property
    def lacks(self) -> bool:
        """Whether some are missing before others, or before what the other end has."""
        if not self.pieces and self.start is None:
            return len(set(self.has)) > (0 if self.opens else 1)
        middle = 1 << 31
        first = self.pieces[0][0] if self.start is None else self.start

        def place(number: int) -> int:
            return (number - first + middle) & 0xFFFFFFFF

        there = min([middle, *(place(number) for number, _ in self.pieces)])
        for number, size in sorted(self.pieces, key=lambda each: place(each[0])):
            if place(number) > there:
                return True
            there = max(there, place(number) + size)
        return max(map(place, self.has), default=0) > there + 1


def _ip(frame: Frame) -> bytes:
    return frame.data[4:] if frame.link == 0 else wire.ip_packet(frame)


def _tpkts(way: _Way) -> Iterator[bytes]:
    while len(way.bytes) >= 4:
        size = int.from_bytes(way.bytes[2:4])
        if way.bytes[0] != 3 or size < 5 or len(way.bytes) < size:
            return
        payload, way.bytes = way.bytes[4:size], way.bytes[size:]
        yield payload


def _cotp(line: Line, way: _Way, by_client: bool, frame: Frame, payload: bytes) -> None:
    head, kind = payload[0], payload[1] & 0xF0
    if payload[1] == DR:
        line.dr, line.reason = frame, payload[6]
    elif kind == CR:
        line.cr = frame
        at = 7
        while at + 2 <= head + 1:
            if payload[at] == 0xC2:
                line.tsap = payload[at + 2 : at + 2 + payload[at + 1]]
            at += 2 + payload[at + 1]
    elif kind == CC:
        line.cc = frame
    elif kind == DT:
        way.part += payload[head + 1 :]
        if payload[2] & 0x80:
            data, way.part = way.part, b""
            if data[:1] == b"\x32":
                _pdu(line, by_client, frame, data)
            elif data:
                line.others += 1


def _pdu(line: Line, by_client: bool, frame: Frame, data: bytes) -> None:
    kind, reference, first, second = struct.unpack_from(">xBxxHHH", data)
    line.pdus.append((frame, by_client, (12 if kind in (ACK, ANSWER) else 10) + first + second))
    error = int.from_bytes(data[10:12]) if kind in (ACK, ANSWER) else 0
    head = 12 if kind in (ACK, ANSWER) else 10
    parameter, content = data[head : head + first], data[head + first : head + first + second]
    if kind == JOB and parameter[:1] in (bytes((READ,)), bytes((WRITE,))):
        _ask(line, by_client, frame, reference, parameter, content)
    elif kind in (ACK, ANSWER):
        _answer(line, by_client, frame, reference, error, parameter, content)
    elif kind == USER:
        _user(line, by_client, frame, reference, parameter, content)


def _ask(
    line: Line, by_client: bool, frame: Frame, reference: int, parameter: bytes, content: bytes
) -> None:
    items: list[Item] = []
    groups, at = [], 2
    for _ in range(parameter[1] if len(parameter) > 1 else 0):
        size, before = parameter[at + 1], len(items)
        if parameter[at + 2] == 0x10:
            kind, count, db, place = struct.unpack_from(">BHHI", parameter, at + 3)
            items.append(Item(place >> 24, db, place & 0xFFFFFF, kind, count))
        elif parameter[at + 2] == 0xB0:
            for n in range(parameter[at + 3]):
                count, db, start = struct.unpack_from(">BHH", parameter, at + 4 + 5 * n)
                items.append(Item(0x84, db, 8 * start, 2, count))
        groups.append(len(items) - before)
        at += 2 + size
    write = parameter[0] == WRITE
    if write:
        for item, (_, data) in zip(items, _values(content), strict=False):
            item.data = data
    line.jobs.append(Job(line, by_client, write, reference, frame, items, groups=groups))


def _answer(
    line: Line, by_client: bool, frame: Frame, reference: int, error: int, parameter: bytes, content: bytes
) -> None:  # fmt: skip
    for job in reversed(line.jobs):
        if job.reference != reference or job.by_client is by_client:
            continue
        if job.answered is None:
            job.answered, job.error = frame, error
            if error:
                return
            if job.write:
                for item, code in zip(job.items, content, strict=False):
                    item.code = code
            else:
                job.bring(list(_values(content)))
        return
    if parameter[:1] in (bytes((READ,)), bytes((WRITE,))):
        write = parameter[0] == WRITE
        told = (
            [(code, b"") for code in content[: parameter[1]]] if write else list(_values(content))
        )
        items = [Item(NOWHERE, 0, 0, 2, len(data), code, data) for code, data in told]
        line.orphans.append(Job(line, not by_client, write, reference, frame, items, frame, error))
    elif parameter[:1] == bytes((SETUP,)):
        line.parallel, _, line.length = struct.unpack_from(">HHH", parameter, 2)
        line.setup = frame
    elif error and line.setup is None:
        line.refused, line.refusal = frame, error


def _values(content: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(content):
        code, kind, length = struct.unpack_from(">BBH", content, at)
        size = (length + 7) // 8 if kind in (3, 4, 5) else length
        if code not in (0, 0xFF):
            size = 0
        if kind == 3:
            size = length
        yield code, content[at + 4 : at + 4 + size]
        at += 4 + size + size % 2


def _user(
    line: Line, by_client: bool, frame: Frame, reference: int, parameter: bytes, content: bytes
) -> None:
    if parameter[:6] == b"\0\1\x12\6\x13\0":
        sizes, at = [], 4
        for _ in range(int.from_bytes(content[2:4])):
            size = int.from_bytes(content[at + 2 : at + 4])
            size = size if content[at + 1] > 5 else size // 8
            sizes.append(size)
            at += 4 + size + size % 2
        line.sent.append(Sent(frame, by_client, int.from_bytes(parameter[6:10]), sizes))
    elif parameter[5:7] == b"\x46\1":
        first = not parameter[7]
        total = int.from_bytes(content[12:14]) if first else None
        size = len(content) - (14 if first else 12)
        line.parts.append(
            Part(
                frame, by_client, reference, parameter[7], not parameter[9],
                int.from_bytes(content[8:12]), total, size,
            )
        )  # fmt: skip
    elif parameter[5:7] == b"\x86\1":
        for part in reversed(line.parts):
            if part.reference == reference and part.by_client is not by_client:
                part.answered, part.assigned = frame, parameter[7]
                part.error = int.from_bytes(parameter[10:12])
                return
    else:
        line.others += 1
        if parameter[5:7] == b"\x84\1" and content[:1] == b"\xff":
            line.said += [(frame.number, each) for each in _szl(content[4:])]


def _szl(content: bytes) -> Iterator[int | str]:
    """What an answer to the reading of an SZL says of the size of a block."""
    number, index, size, count = struct.unpack_from(">4H", content)
    for at in range(8, 8 + size * count, size):
        entry = content[at : at + size]
        if (number, index) == (0x0131, 3) and entry[:2] == b"\0\3":
            yield int.from_bytes(entry[6:8])
        if number in (0x0011, 0x0111) and entry[:2] == b"\0\1":
            yield entry[2:22].rstrip(b"\0 ").decode("ascii")
