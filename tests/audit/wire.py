"""Frames, RPC calls and records of a capture file: read anew, for one file, all in memory.

Knows pcap and pcapng, Ethernet with tags, cooked and bare IPv4, IP and RPC fragments, both byte orders.
"""

from __future__ import annotations

import gzip
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from uuid import UUID

REQUEST, PING, RESPONSE, FAULT, WORKING, REJECT = 0, 1, 2, 3, 4, 6
OPERATIONS = ("Connect", "Release", "Read", "Write", "Control", "ReadImplicit")
CONNECT, RELEASE, READ, WRITE, CONTROL, IMPLICIT = range(6)
PARTS = ("1", "2", "3", "4")
"""dea00001 to dea00004: the interfaces of PROFINET."""
MAPPER = "e1af8308-5d1f-11c9-91a4-08002b14a0fa"
WRITE_MULTIPLE = 0xE040
PORT = (34964).to_bytes(2)
BLOCK = 64
HEAD, STATUS_END = 40, 48
"""Of a block: where its place and the length of its record end, and of the one of an answer its status."""
COPY_NS, CALL_NS = 1_000_000, 60_000_000_000
ETHERNET, SLL, SLL2 = 1, 113, 276
HEADS = {ETHERNET: (12, 14, 6), SLL: (14, 16, 6), SLL2: (0, 20, 12)}
"""Of link types: where the EtherType stands, where the payload begins without tags, and where its sender stands."""
TAGS = (b"\x81\x00", b"\x88\xa8", b"\x91\x00", b"\x92\x00")
IPV4, PROFINET = b"\x08\x00", b"\x88\x92"


@dataclass
class Frame:
    """A captured frame."""

    number: int
    time_ns: int
    data: bytes
    length: int
    """On the wire."""
    link: int

    @property
    def cut(self) -> bool:
        return len(self.data) < self.length


class Rt(NamedTuple):
    """A frame of PROFINET RT: DCP or cyclic data."""

    frame: Frame
    sender: str
    receiver: str
    """MAC addresses; empty where a cooked header does not say it."""
    frame_id: int
    data: bytes
    """Behind the frame id."""

    def is_of(self, sender: str, receiver: str, frame_id: int) -> bool:
        """Whether it is one of these; who receives it a cooked header does not say."""
        known = self.sender, self.receiver or receiver, self.frame_id
        return known == (sender, receiver, frame_id)


@dataclass
class Pdu:
    """A whole RPC PDU, in the frame that completes it."""

    frame: int
    time_ns: int
    source: str
    target: str
    kind: int
    order: str
    activity: UUID
    sequence: int
    operation: int
    body: bytes
    frames: list[int]
    datagram: int
    """IP identification."""
    cut: bool
    object: UUID
    port: int = 0
    """UDP port of the source."""
    boot: bytes = b""
    """When the server started, as it says itself."""

    @property
    def client(self) -> str:
        return self.source if self.kind in (REQUEST, PING) else self.target

    @property
    def server(self) -> str:
        return self.target if self.kind in (REQUEST, PING) else self.source

    @property
    def key(self) -> tuple[str, UUID, int]:
        return self.client, self.activity, self.sequence


@dataclass
class Call:
    """A request and what came back. `again`: frames in which the request was seen once more."""

    request: Pdu
    response: Pdu | None = None
    others: list[Pdu] = field(default_factory=list)
    """What answers it once more, with other bytes."""
    again: list[int] = field(default_factory=list)
    copies: list[int] = field(default_factory=list)
    repeated: list[int] = field(default_factory=list)
    """Frames in which its response was seen once more, with the same bytes."""
    newest_ns: int = 0
    """When its last datagram was seen."""


@dataclass
class Record:
    """One record inside a call."""

    write: bool
    implicit: bool
    controller: str
    device: str
    ar: UUID
    api: int
    slot: int
    subslot: int
    index: int
    call: Call
    asked: int
    """Frame of the request."""
    answered: int | None
    data: bytes
    """What was written or read."""
    stated: int
    """Length in the record's own header."""
    wanted: int
    """Of a Read: the length it asks for."""
    status: int | None
    nested: bool = False
    untold: bool = False
    """Whether the capture cut the answer off before it says what became of it."""

    @property
    def short(self) -> bool:
        """Whether the capture has not all of its data."""
        pdu = self.call.request if self.write else self.call.response
        return pdu is not None and pdu.cut and len(self.data) < self.stated

    @property
    def channel(self) -> tuple[object, ...]:
        """Who asks whom where."""
        return self.controller, self.device, self.ar, self.api, self.slot, self.subslot, self.index


@dataclass
class Capture:
    """All that was read of a file."""

    frames: list[Frame] = field(default_factory=list)
    pdus: list[Pdu] = field(default_factory=list)
    copies: set[int] = field(default_factory=set)
    """Frames of PDUs that are copies of others."""
    calls: list[Call] = field(default_factory=list)
    strays: list[Pdu] = field(default_factory=list)
    """Responses without a request."""
    records: list[Record] = field(default_factory=list)
    pieces: dict[tuple[object, ...], list[int]] = field(default_factory=dict)
    """Fragments of what never became whole, of IP and RPC: the frames they came in."""
    fragments: dict[tuple[object, ...], list[int]] = field(default_factory=dict)
    """Of IP all frames they came in, those that came again, too."""
    begun: dict[tuple[object, ...], tuple[int, tuple[UUID, int] | None]] = field(
        default_factory=dict
    )
    """Of those of IP whose first fragment is there: its frame, and activity and sequence number if it has them."""
    lately: dict[tuple[object, ...], int] = field(default_factory=dict)
    """Datagrams with a fragment of RPC, and when they came: the same soon after is a copy of the capture."""
    numbers: list[tuple[int, str, str, UUID, int]] = field(default_factory=list)
    """Of each request, also of one to the endpoint mapper: frame, client, server, activity and sequence number."""
    torn: dict[tuple[object, ...], int] = field(default_factory=dict)
    """RPC fragments that the capture cut: what stands behind them is not known."""
    headless: set[int] = field(default_factory=set)
    """Frames of RPC that the capture cut before its header ends."""
    line: Any = None
    """Of PROFIBUS (`dp.Line`)."""

    @cached_property
    def rt(self) -> list[Rt]:
        """The frames of PROFINET RT."""
        found = []
        for each in self.frames:
            kind, data = payload(each)
            if kind == PROFINET and len(data) >= 2:
                to = each.data[:6].hex(":") if each.link == ETHERNET else ""
                found.append(
                    Rt(each, sender(each).hex(":"), to, int.from_bytes(data[:2]), data[2:])
                )
        return found

    def frame(self, number: int) -> Frame | None:
        """The frame with this number."""
        return self.frames[number - 1] if 0 < number <= len(self.frames) else None

    def at(self, frame: int) -> list[Pdu]:
        """The PDUs that one frame completes."""
        return [each for each in self.pdus if each.frame == frame]


# Files


def frames(path: Path) -> list[Frame]:
    """The frames of a pcap or pcapng file, gzipped or not; up to where it breaks off."""
    data = path.read_bytes()
    if data[:2] == b"\x1f\x8b":
        data = gzip.decompress(data)
    found = list(_pcapng(data)) if data[:4] == b"\x0a\x0d\x0d\x0a" else list(_pcap(data))
    return [Frame(number, *each) for number, each in enumerate(found, start=1)]


def _pcap(data: bytes) -> Iterator[tuple[int, bytes, int, int]]:
    magic = data[:4]
    order = "<" if magic in (b"\xd4\xc3\xb2\xa1", b"\x4d\x3c\xb2\xa1") else ">"
    unit = 1 if magic in (b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d") else 1000
    if len(data) < 24:
        return
    (link,) = struct.unpack_from(order + "I", data, 20)
    at = 24
    while at + 16 <= len(data):
        seconds, part, kept, length = struct.unpack_from(order + "4I", data, at)
        if at + 16 + kept > len(data):
            return
        yield seconds * 10**9 + part * unit, data[at + 16 : at + 16 + kept], length, link & 0xFFFF
        at += 16 + kept


def _pcapng(data: bytes) -> Iterator[tuple[int, bytes, int, int]]:
    at, order = 0, "<"
    interfaces: list[tuple[int, int]] = []
    while at + 12 <= len(data):
        if data[at : at + 4] == b"\x0a\x0d\x0d\x0a":
            order = "<" if data[at + 8 : at + 12] == b"\x4d\x3c\x2b\x1a" else ">"
            interfaces = []
        kind, size = struct.unpack_from(order + "II", data, at)
        if size < 12 or at + size > len(data):
            return
        body = data[at + 8 : at + size - 4]
        if kind == 1:
            (link,) = struct.unpack_from(order + "H", body)
            interfaces.append((link, _resolution(body[8:], order)))
        elif kind == 6:
            number, high, low, kept, length = struct.unpack_from(order + "5I", body)
            link, unit = interfaces[number]
            yield ((high << 32) + low) * 10**9 // unit, body[20 : 20 + kept], length, link
        at += size


def _resolution(options: bytes, order: str) -> int:
    """Units in a second."""
    at = 0
    while at + 4 <= len(options):
        kind, size = struct.unpack_from(order + "HH", options, at)
        if kind == 9:
            value: int = options[at + 4]
            return int(2 ** (value & 0x7F)) if value & 0x80 else int(10**value)
        if kind == 0:
            break
        at += 4 + (size + 3) // 4 * 4
    return 10**6


# Below RPC


def payload(frame: Frame) -> tuple[bytes, bytes]:
    """EtherType of what a frame carries behind its link header and VLAN tags, and the bytes of it."""
    if frame.link in (101, 228):
        return IPV4, frame.data
    at, start, _ = HEADS.get(frame.link, (0, 0, 0))
    kind = frame.data[at : at + 2] if start else b""
    while kind in TAGS:
        kind, start = frame.data[start + 2 : start + 4], start + 4
    return kind, frame.data[start:]


def ip_packet(frame: Frame) -> bytes:
    """The IPv4 packet of a frame, empty where there is none."""
    kind, packet = payload(frame)
    return packet if kind == IPV4 else b""


def sender(frame: Frame) -> bytes:
    """Its MAC address, empty where the link has none."""
    at = HEADS.get(frame.link, (0, 0, 0))[2]
    return frame.data[at : at + 6] if at else b""


@dataclass
class _Datagram:
    source: str
    target: str
    number: int
    payload: bytes
    frames: list[int]
    cut: bool


class _Whole:
    """Puts the fragments of IP together."""

    def __init__(self, capture: Capture) -> None:
        self._parts: dict[tuple[object, ...], dict[int, tuple[bytes, bool, int, int]]] = {}
        self._capture = capture

    def add(self, frame: Frame, packet: bytes) -> _Datagram | None:
        head = (packet[0] & 15) * 4
        size, number, flags = struct.unpack_from(">HHH", packet, 2)
        source, target = (".".join(map(str, packet[at : at + 4])) for at in (12, 16))
        payload = packet[head : max(size, head)]
        cut = len(packet) < size
        start, more = (flags & 0x1FFF) * 8, bool(flags & 0x2000)
        if not start and not more:
            return _Datagram(source, target, number, payload, [frame.number], cut)
        key = ("IP", source, target, number)
        parts = self._parts.setdefault(key, {})
        parts[start] = payload, more, frame.number, size - head
        self._capture.fragments.setdefault(key, []).append(frame.number)
        self._capture.pieces[key] = sorted(part[2] for part in parts.values())
        if not start:
            self._capture.begun[key] = frame.number, _call_of(payload[8:])
        data, end, whole = b"", 0, True
        for at in sorted(parts):
            if at != end:
                return None
            data += parts[at][0] if whole else b""  # up to the first that is cut
            end += parts[at][3]
            whole = len(data) == end
            if not parts[at][1]:
                del self._parts[key]
                seen = self._capture.pieces.pop(key)
                return _Datagram(source, target, number, data, seen, not whole)
        return None


def _call_of(data: bytes) -> tuple[UUID, int] | None:
    """Activity and sequence number in the header of a PDU, as far as it is there."""
    if len(data) < 68:
        return None
    order, raw = ("<" if data[4] >> 4 == 1 else ">"), data[40:56]
    activity = UUID(bytes_le=raw) if order == "<" else UUID(bytes=raw)
    return activity, struct.unpack_from(order + "I", data, 64)[0]


def read(path: Path) -> Capture:
    """Reads a capture file."""
    capture = Capture(frames(path))
    whole = _Whole(capture)
    halves: dict[tuple[object, ...], dict[int, tuple[bytes, int]]] = {}
    for frame in capture.frames:
        packet = ip_packet(frame)
        if len(packet) < 21 or packet[0] >> 4 != 4 or packet[9] != 17:
            continue
        datagram = whole.add(frame, packet)
        if datagram is not None and datagram.cut and _is_headless(datagram.payload):
            capture.headless |= {at for at in datagram.frames if capture.frames[at - 1].cut}
        if datagram is not None and len(datagram.payload) >= 88:
            pdu = _pdu(frame, datagram, halves, capture)
            if pdu is not None:
                capture.pdus.append(pdu)
                number = pdu.frame, pdu.source, pdu.target, pdu.activity, pdu.sequence
                capture.numbers += [number][: pdu.kind == REQUEST]
    _calls(capture)
    for call in capture.calls:
        capture.records += _records(call)
    for pdu in capture.strays:
        capture.records += _unasked(pdu)
    return capture


def _is_headless(payload: bytes) -> bool:
    """Whether a UDP packet ends before the header of RPC does, which is one of PROFINET as far as it shows."""
    if len(payload) >= 88 or payload[8:9] not in (b"", b"\4"):
        return False
    shown = payload[32:48]
    ours = [UUID(f"dea0000{part}-6c97-11d1-8271-00a02442df7d") for part in PARTS]
    if len(shown) == 16:  # which operation it is, is cut off
        ours.append(UUID(MAPPER))
    if shown:
        return any(one.startswith(shown) for each in ours for one in (each.bytes, each.bytes_le))
    return PORT in (payload[:2], payload[2:4])


def _pdu(
    frame: Frame, datagram: _Datagram, halves: dict[tuple[object, ...], dict[int, tuple[bytes, int]]],
    capture: Capture,
) -> Pdu | None:  # fmt: skip
    data = datagram.payload[8:]
    order = "<" if data[4] >> 4 == 1 else ">"

    def uuid(at: int) -> UUID:
        raw = data[at : at + 16]
        return UUID(bytes_le=raw) if order == "<" else UUID(bytes=raw)

    interface = str(uuid(24))
    ours = interface[:7] == "dea0000" and interface[7] in PARTS and interface[9:13] == "6c97"
    if data[0] != 4 or not (ours or interface == MAPPER):
        return None
    sequence, operation = struct.unpack_from(order + "IH", data, 64)
    if not ours:
        number = frame.number, datagram.source, datagram.target, uuid(40), sequence
        capture.numbers += [number][: data[1] == REQUEST]
        return None
    size, number = struct.unpack_from(order + "HH", data, 74)
    body = data[80 : 80 + size]
    pdu = Pdu(
        frame.number, frame.time_ns, datagram.source, datagram.target, data[1], order, uuid(40),
        sequence, operation, body, datagram.frames, datagram.number, datagram.cut, uuid(8),
        int.from_bytes(datagram.payload[:2], "big"), data[56:60],
    )  # fmt: skip
    if not data[2] & 0x04 or data[1] not in (REQUEST, RESPONSE):
        return pdu
    sent = (pdu.source, pdu.target, datagram.number, datagram.payload)
    before = capture.lately.get(sent)
    capture.lately[sent] = frame.time_ns
    if before is not None and (datagram.number or abs(frame.time_ns - before) <= COPY_NS):
        return None
    key = ("RPC", pdu.source, pdu.target, pdu.activity, sequence, data[1])
    parts = halves.setdefault(key, {})
    if number == 0 and 0 in parts and parts[0][0] != body:
        capture.pieces[(*key, frame.number)] = sorted({at for _, at in parts.values()})
        parts.clear()
    parts.setdefault(number, (body, frame.number))
    if datagram.cut:
        capture.torn.setdefault(key, number)
    if data[2] & 0x02:
        parts[-1] = b"", number
    capture.pieces[key] = sorted({at for part, (_, at) in parts.items() if part >= 0})
    last = parts.get(-1)
    if last is None or set(range(last[1] + 1)) - set(parts):
        return None
    torn = capture.torn.pop(key, None)
    pdu.cut = torn is not None
    pdu.body = b"".join(parts[part][0] for part in range((last[1] if torn is None else torn) + 1))
    pdu.frames = capture.pieces.pop(key)
    del halves[key]
    return pdu


# Calls and records


def _calls(capture: Capture) -> None:
    newest: dict[tuple[str, UUID, int], Call] = {}
    anew: dict[tuple[str, UUID] | tuple[str, str], int] = {}
    seen: dict[tuple[object, ...], int] = {}
    for pdu in capture.pdus:
        same = pdu.datagram, pdu.body, pdu.key, pdu.kind, pdu.source, pdu.port, pdu.boot
        before, seen[same] = seen.get(same), pdu.time_ns
        known = newest.get(pdu.key)
        if before is not None and (pdu.datagram or abs(pdu.time_ns - before) <= COPY_NS):
            capture.copies.add(pdu.frame)
            if known is not None and pdu.kind == REQUEST:
                known.copies.append(pdu.frame)
            elif known is not None and known.response and known.response.body == pdu.body:
                known.repeated.append(pdu.frame)
            continue
        begun = max(anew.get(each, 0) for each in (pdu.key[:2], (pdu.client, pdu.server)))
        over = known is not None and (
            known.request.frame < begun or pdu.time_ns - known.newest_ns > CALL_NS
        )
        if pdu.kind == REQUEST:
            if known is not None and not over and _is_again(known, pdu):
                known.again.append(pdu.frame)
                known.newest_ns = pdu.time_ns
                continue
            if known is not None:  # its client counts anew
                anew[pdu.key[:2]] = pdu.frame
            if pdu.operation == CONNECT:
                anew[pdu.source, pdu.target] = pdu.frame
            newest[pdu.key] = call = Call(pdu, newest_ns=pdu.time_ns)
            capture.calls.append(call)
            early = [each for each in capture.strays if _is_early(each, pdu)]
            if early:  # frames out of order: by their times it came later
                call.response = early[-1]
                capture.strays.remove(early[-1])
        elif pdu.kind in (RESPONSE, FAULT, REJECT):
            _answered(capture, known, pdu, over)


def _answered(capture: Capture, call: Call | None, pdu: Pdu, over: bool) -> None:
    """A response or fault; `over`: the number of the call may stand for another one."""
    if call is None or (over and call.response is not None):
        capture.strays.append(pdu)
    elif call.response is None:
        call.response = pdu
        call.newest_ns = max(call.newest_ns, pdu.time_ns)
    elif call.response.body == pdu.body:
        call.repeated.append(pdu.frame)
    else:
        call.others.append(pdu)


def _is_early(stray: Pdu, request: Pdu) -> bool:
    return stray.key == request.key and 0 <= stray.time_ns - request.time_ns <= CALL_NS


def _is_again(call: Call, pdu: Pdu) -> bool:
    """Whether a number that was there before asks for the same."""
    asked = call.request
    return (asked.operation, asked.body, asked.port) == (pdu.operation, pdu.body, pdu.port)


def _records(call: Call) -> Iterator[Record]:
    request = call.request
    if request.operation not in (READ, WRITE, IMPLICIT):
        return
    if len(request.body) < 20 + HEAD:
        if call.response is not None:  # the capture cut the request
            yield from _unasked(call.response)
        return
    blocks, answer = request.body[20:], call.response
    status, answers = None, b""
    if answer is not None and answer.kind == RESPONSE and len(answer.body) >= 4:
        (status,) = struct.unpack_from(answer.order + "I", answer.body)
        answers = answer.body[20:]
    for number, (block, data) in enumerate(_written(blocks, request.operation == WRITE)):
        ar = UUID(bytes=block[8:24])
        api, slot, subslot, _, index, stated = struct.unpack_from(">IHHHHI", block, 24)
        write = request.operation == WRITE
        inner = answers
        torn = answer is not None and answer.kind == RESPONSE and answer.cut and not status
        if write and status == 0 and index != WRITE_MULTIPLE and _is_multiple(blocks):
            inner = answers[BLOCK * (number + 1) :]
        found, length, untold = status, 0, torn and len(inner) < (STATUS_END if write else HEAD)
        if len(inner) >= HEAD:
            (length,) = struct.unpack_from(">I", inner, 36)
        if write and len(inner) >= STATUS_END:
            found = struct.unpack_from(">I", inner, 44)[0] or status
        elif write and (inner is not answers or untold):
            found = None
        got = inner[BLOCK : BLOCK + length]
        yield Record(
            write, request.operation == IMPLICIT, request.source, request.target, ar, api, slot,
            subslot, index, call, request.frame, answer.frame if answer else None,
            data if write else got, stated if write else length, 0 if write else stated, found,
            nested=write and index == WRITE_MULTIPLE and _is_multiple(blocks), untold=untold,
        )  # fmt: skip


def _unasked(pdu: Pdu) -> Iterator[Record]:
    """The records of a response whose request the capture does not have: their own headers say where they belong."""
    if pdu.operation not in (READ, WRITE, IMPLICIT) or pdu.kind != RESPONSE:
        return
    blocks, write = pdu.body[20:], pdu.operation == WRITE
    many = write and _is_multiple(blocks)
    heads = (
        [blocks[at : at + BLOCK] for at in range(BLOCK, len(blocks), BLOCK)] if many else [blocks]
    )
    for block in heads:
        if len(block) < HEAD:
            continue
        ar = UUID(bytes=block[8:24])
        api, slot, subslot, _, index, stated = struct.unpack_from(">IHHHHI", block, 24)
        (status,) = struct.unpack_from(pdu.order + "I", pdu.body)
        untold = write and pdu.cut and not status and len(block) < STATUS_END
        if many and not untold:
            status = struct.unpack_from(">I", block, 44)[0] or status
        yield Record(
            write, pdu.operation == IMPLICIT, pdu.target, pdu.source, ar, api, slot, subslot, index,
            Call(pdu, pdu), 0, pdu.frame, b"" if write else block[BLOCK : BLOCK + stated], stated, 0,
            None if untold else status, untold=untold,
        )  # fmt: skip


def is_placeless(pdu: Pdu) -> bool:
    """Whether a call is cut before its place ends, or is one of several records."""
    return len(pdu.body) < 20 + HEAD or _is_multiple(pdu.body[20:])


def _is_multiple(blocks: bytes) -> bool:
    return len(blocks) >= HEAD and blocks[34:36] == b"\xe0\x40"


def _written(blocks: bytes, write: bool) -> Iterator[tuple[bytes, bytes]]:
    if not write or not _is_multiple(blocks):
        yield blocks[:BLOCK], blocks[BLOCK : BLOCK + int.from_bytes(blocks[36:40])]
        return
    at = BLOCK
    while at + HEAD <= len(blocks):
        size = int.from_bytes(blocks[at + 36 : at + 40])
        yield blocks[at : at + BLOCK], blocks[at + BLOCK : at + BLOCK + size]
        at += BLOCK + size
        at += -(at) % 4
