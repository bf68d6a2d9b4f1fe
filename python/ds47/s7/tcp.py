"""TCP segments to the bytes of each direction, in their order (docs/s7.md 2).

Copies and retransmissions are left out, and what comes too early waits, within bounds. What is lost is known as
such when the other side has acknowledged it and more is there: nobody will send it again. What acknowledges bytes
that were not seen yet waits a little: neighbours may have changed places in the capture. What the bytes are is
`tpkt`. Fragments of IP are not put together: TCP of a PLC has none.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from ds47.capture import Frame
from ds47.capture.scan import ETHERNET, IPV4
from ds47.profinet import ip
from ds47.s7.model import At, Cut, End

FIN, SYN, RST, ACK = 1, 2, 4, 16
WINDOW = 1 << 16
"""Bytes of a direction that may wait, and how far behind what was seen first something may still come."""
MOST_WAITING = 256
"""Segments of a direction that may wait."""
_AHEAD = 8
"""Segments of a connection that wait for what they acknowledge."""
_HOLES = 8
"""Lost ranges of a direction that are remembered: late bytes belong there."""
_JUMP = 1 << 24
"""So far away are the sequence numbers of another connection."""
_OVERHEAD = 128
_HEADER: Final = struct.Struct(">HHIIBB6x")
_LOWER: Final = struct.Struct(">12xHBxHxxHxBxx12sIIBB6x")
"""Of a frame without tag and IP option: EtherType, version, length, flags, protocol, ends, then as _HEADER."""
_TCP_START: Final = 34
_PORTS: Final = struct.Struct(">HH")

Ends = tuple[End, End]
"""Both ends of a connection, the lesser one first."""


@dataclass(slots=True, init=False)
class TcpSegment:
    """A TCP segment; `length` counts the sent bytes; the capture may lack the last ones."""

    source: End
    destination: End
    ends: Ends
    """What all segments of a connection have in common."""
    sequence: int
    acknowledge: int
    flags: int
    data: bytes
    length: int
    cut: int
    """Bytes of its frame in the capture, where that was cut; else 0."""

    def __init__(
        self,
        source: End,
        destination: End,
        ends: Ends,
        sequence: int,
        acknowledge: int,
        flags: int,
        data: bytes,
        length: int,
        cut: int = 0,
    ) -> None:
        self.source = source
        self.destination = destination
        self.ends = ends
        self.sequence = sequence
        self.acknowledge = acknowledge
        self.flags = flags
        self.data = data
        self.length = length
        self.cut = cut


def parse(
    source: str, destination: str, payload: bytes, missing: int, captured: int = 0
) -> TcpSegment | None:
    """The segment in the payload of an IP packet with so many missing bytes; None if it is none.

    `captured`: bytes that the capture has of its frame, if that was cut.
    """
    if len(payload) < _HEADER.size:
        return None
    from_port, to_port, sequence, acknowledge, offset, flags = _HEADER.unpack_from(payload)
    begin = (offset >> 4) * 4
    if begin < _HEADER.size or begin > len(payload) + missing:
        return None
    one, other = End(source, from_port), End(destination, to_port)
    ends = min(one, other), max(one, other)
    length = len(payload) + missing - begin
    data, cut = payload[begin:], captured if missing else 0
    return TcpSegment(one, other, ends, sequence, acknowledge, flags, data, length, cut)


def from_frame(frame: Frame) -> TcpSegment | None:
    """The segment of a frame as nearly all are: Ethernet without tag, IPv4 without option.

    None for every other frame: `link.dissect` and `parse` take those, and would give the same.
    """
    data = frame.data
    if frame.link_type != ETHERNET or len(data) < _LOWER.size:
        return None
    (kind, version, total, fragment, protocol, both, sequence, acknowledge, offset, flags,
     ) = _LOWER.unpack_from(data)  # fmt: skip
    begin, end = _TCP_START + (offset >> 4) * 4, total + 14 if total else len(data)
    if (
        kind != IPV4
        or version != 0x45
        or fragment & 0x3FFF
        or protocol != ip.TCP
        or not _LOWER.size <= begin <= end
    ):
        return None
    known = _ENDS.get(both)
    source, destination, ends = known if known is not None else _ends(both)
    cut = len(data) if end > len(data) < frame.original_length else 0
    return TcpSegment(
        source, destination, ends, sequence, acknowledge, flags, data[begin:end], end - begin, cut
    )


_ENDS: Final[dict[bytes, tuple[End, End, Ends]]] = {}
"""What the frames of a capture say again and again; forgotten when it grows too much."""
_MOST_KNOWN: Final = 4096


def _ends(both: bytes) -> tuple[End, End, Ends]:
    """Source, destination, and both of them, of two IP addresses and two ports; remembered."""
    if len(_ENDS) >= _MOST_KNOWN:
        _ENDS.clear()
    from_port, to_port = _PORTS.unpack_from(both, 8)
    one, other = End(ip.address(both[:4]), from_port), End(ip.address(both[4:8]), to_port)
    found = _ENDS[both] = one, other, (min(one, other), max(one, other))
    return found


@dataclass(slots=True, init=False)
class TcpPiece:
    """Bytes in order. `lost` counts the missing bytes before it; a `late` piece fills such a gap."""

    data: bytes
    at: At
    lost: int
    late: bool

    def __init__(self, data: bytes, at: At, lost: int = 0, late: bool = False) -> None:
        self.data = data
        self.at = at
        self.lost = lost
        self.late = late


def distance(one: int, other: int) -> int:
    """How far a sequence number is behind another one; negative where it is before it."""
    return ((one - other + 0x8000_0000) & 0xFFFF_FFFF) - 0x8000_0000


@dataclass(slots=True, init=False, eq=False)
class Direction:
    """What one end sends; positions count bytes from the first one seen."""

    first: int | None
    """Sequence number of the first byte; None before it was seen."""
    next: int
    """That of the byte which comes next,"""
    position: int
    """and its position."""
    fin: int | None
    """Sequence number of the end."""
    waiting: list[tuple[int, bytes, At]]
    """Position, bytes and frame of what came too early, in order."""
    held: int
    """Bytes that this takes."""
    holes: list[tuple[int, int]]
    """Positions of lost bytes, first and end."""
    lost: bool
    """Whether anything was."""
    acknowledged_first: int | None
    """What the other end said to have at first,"""
    acknowledged_last: int | None
    """and at last."""

    def __init__(self) -> None:
        self.first = self.fin = self.acknowledged_first = self.acknowledged_last = None
        self.next = self.position = self.held = 0
        self.waiting = []
        self.holes = []
        self.lost = False

    def begin(self, sequence: int, seen: bool) -> None:
        """The first byte has this number; `seen`: the beginning of the connection is in the capture."""
        self.first = self.next = sequence
        if not seen:
            self.holes.append((-WINDOW, 0))

    def feed(self, sequence: int, data: bytes, at: At) -> list[TcpPiece]:
        """Bytes of a segment; gives what is in order now."""
        found: list[TcpPiece] = []
        early = distance(sequence, self.next) if sequence != self.next else 0
        if early < 0:
            found += self._late(self.position + early, data, at)
            data, early = data[-early:], 0
        if early > 0 and data:
            self._wait(self.position + early, data, at)
            if self.held > WINDOW or len(self.waiting) > MOST_WAITING:
                found += self.give_up()
        elif data:
            self._pass(len(data))
            found.append(TcpPiece(data, at))
            if self.waiting:
                found += self._drain(0)
        return found

    def cut(self, sequence: int, count: int, at: At) -> list[TcpPiece]:
        """So many bytes from a number on were sent, and the capture cut them off."""
        if self.first is None or sequence != self.next:
            return []
        self.holes = [*self.holes[1 - _HOLES :], (self.position, self.position + count)]
        self.lost = True
        self._pass(count)
        return [TcpPiece(b"", at, count), *self._drain(0)]

    def ahead(self, number: int) -> bool:
        """Whether bytes before this number were not seen; the last one may be that of a FIN."""
        return self.first is not None and distance(number, self.next) > 1

    def lacks(self, begun: bool) -> bool:
        """Whether the capture lacks what this end has sent last, or all of it.

        `begun`: the connection begins in the capture.
        """
        last = self.acknowledged_last
        if last is None:
            return False
        return (
            self.ahead(last) if self.first is not None else begun or last != self.acknowledged_first
        )

    def acknowledged(self, number: int) -> list[TcpPiece]:
        """The other side has everything before this number: what is missing there will not come any more."""
        found: list[TcpPiece] = []
        last = self.acknowledged_last
        if last is None:
            self.acknowledged_first = self.acknowledged_last = number
        elif number != last and distance(number, last) > 0:
            self.acknowledged_last = number
        while self.waiting and distance(number, self.next) > 0:
            found += self.give_up()
        return found

    def give_up(self) -> list[TcpPiece]:
        """What is missing before the first bytes that wait is lost."""
        if not self.waiting:
            return []
        have, begin = self.position, self.waiting[0][0]
        self.holes = [*self.holes[1 - _HOLES :], (have, begin)]
        self.lost = True
        self._pass(begin - have)
        return self._drain(begin - have)

    def _pass(self, count: int) -> None:
        self.next = (self.next + count) & 0xFFFF_FFFF
        self.position += count

    def _wait(self, begin: int, data: bytes, at: At) -> None:
        index = len(self.waiting)
        while index and self.waiting[index - 1][0] > begin:
            index -= 1
        before = self.waiting[index - 1] if index else None
        if before is None or before[0] != begin or len(before[1]) < len(data):
            self.waiting.insert(index, (begin, data, at))
            self.held += len(data) + _OVERHEAD

    def _drain(self, lost: int) -> list[TcpPiece]:
        """What waited and is in order now; before the first of it so many bytes are missing."""
        found: list[TcpPiece] = []
        while self.waiting and self.waiting[0][0] <= self.position:
            begin, data, at = self.waiting.pop(0)
            self.held -= len(data) + _OVERHEAD
            fresh = data[self.position - begin :]
            if fresh:
                self._pass(len(fresh))
                found.append(TcpPiece(fresh, at, lost))
                lost = 0
        return found

    def _late(self, begin: int, data: bytes, at: At) -> list[TcpPiece]:
        """What was lost comes after all: once."""
        for number, (left, right) in enumerate(self.holes):
            first, last = max(begin, left), min(begin + len(data), right)
            if first < last:
                rest = [part for part in ((left, first), (last, right)) if part[0] < part[1]]
                self.holes[number : number + 1] = rest
                return [TcpPiece(data[first - begin : last - begin], at, late=True)]
        return []


@dataclass(slots=True, init=False, eq=False)
class Talk:
    """A TCP connection: client, server, and what each sends. `owner` is whatever the listener keeps of it."""

    client: End
    server: End
    begun: bool
    forward: Direction
    backward: Direction
    over: bool
    reset: bool
    owner: Any
    kept: int
    """Bytes that the listener keeps of it, as he says,"""
    held: int
    """and those of both directions with them, as they were counted last."""
    early: list[tuple[TcpSegment, At]]
    """Segments that acknowledge what was not seen yet."""
    open_ended: bool
    """Whether the capture ends, or there is no more room, before the connection does."""
    cut: Cut | None
    """Frames of it that the capture cut."""

    def __init__(self, client: End, server: End, begun: bool) -> None:
        self.client = client
        self.server = server
        self.begun = begun
        self.forward = Direction()
        self.backward = Direction()
        self.over = self.reset = False
        self.owner = None
        self.kept = self.held = 0
        self.early = []
        self.open_ended = False
        self.cut = None

    def count_cut(self, segment: TcpSegment, at: At) -> None:
        """Bytes of a segment are not there: because its frame was cut, or for another reason."""
        if segment.cut:
            first, frames, most = self.cut or Cut(at.frame, 0, 0)
            self.cut = Cut(first, frames + 1, max(most, segment.cut))

    def lacks(self, from_client: bool) -> bool:
        """Whether the capture lacks what one end has sent last, or all of it."""
        return self.of(from_client).lacks(self.begun)

    def silent(self) -> bool | None:
        """Of which end the capture has no byte though it sent some: whether of the client. None: of none."""
        for from_client in (True, False):
            if not self.of(from_client).position and self.lacks(from_client):
                return from_client
        return None

    def of(self, from_client: bool) -> Direction:
        """What one end sends."""
        return self.forward if from_client else self.backward


Take = Callable[[Talk, bool, TcpPiece], None]
Over = Callable[[Talk, bool, At], None]


class Streams:
    """All connections of the ports that are wanted.

    Args:
        ports: of servers.
        take: gets each piece, and whether the client sent it.
        over: gets each finished connection, and whether a RST of the server ended it.
        most: how many connections are followed at once; beyond that, the longest silent one is over.
        most_bytes: how many bytes of all of them may wait.
    """

    def __init__(
        self, ports: frozenset[int], take: Take, over: Over, most: int, most_bytes: int
    ) -> None:
        self._ports = ports
        self._take = take
        self._over = over
        self._most = most
        self._most_bytes = most_bytes
        self._talks: OrderedDict[Ends, Talk] = OrderedDict()
        self._held = 0
        self._now = At(0, 0)

    def feed(self, segment: TcpSegment, at: At) -> None:
        """The next segment of the capture."""
        talk = self._talks.get(segment.ends)
        if talk is None and not {segment.source.port, segment.destination.port} & self._ports:
            return
        self._now = at
        if talk is None or self._is_new(talk, segment):
            talk = self._begin(segment, talk)
        self._talks.move_to_end(segment.ends)
        from_client = segment.source == talk.client
        if segment.flags & RST:
            self._close(talk, reset=True, by_server=not from_client)
        elif not talk.over:
            self._in_order(talk, from_client, segment, at)
        held = talk.forward.held + talk.backward.held + talk.kept
        self._held += held - talk.held
        talk.held = held
        while len(self._talks) > self._most or self._held > self._most_bytes:
            self._push_out()

    def finish(self) -> None:
        """Nothing more comes."""
        for talk in list(self._talks.values()):
            talk.open_ended = True
            self._close(talk, reset=False)
        self._talks.clear()

    def _in_order(self, talk: Talk, from_client: bool, segment: TcpSegment, at: At) -> None:
        """A segment, or what it acknowledges first, where that comes behind it in the capture."""
        other = talk.backward if from_client else talk.forward
        number = segment.acknowledge
        if segment.flags & ACK and number != other.next and other.ahead(number):
            talk.early.append((segment, at))
            if len(talk.early) <= _AHEAD:
                return
            segment, at = talk.early.pop(0)
        self._segment(talk, segment.source == talk.client, segment, at)
        early, talk.early = talk.early, []
        for each, its_at in early:
            if not talk.over:
                self._in_order(talk, each.source == talk.client, each, its_at)

    def _segment(self, talk: Talk, from_client: bool, segment: TcpSegment, at: At) -> None:
        own, other = talk.forward, talk.backward
        if not from_client:
            own, other = other, own
        sequence, flags, data = segment.sequence, segment.flags, segment.data
        if flags & SYN:
            sequence = (sequence + 1) & 0xFFFF_FFFF
            if own.first is None:
                own.begin(sequence, seen=True)
            elif own.first == sequence:
                own.holes = [hole for hole in own.holes if hole[0] >= 0]
        elif own.first is None and data:
            own.begin(sequence, seen=talk.begun)
        if flags & ACK:
            for piece in other.acknowledged(segment.acknowledge):
                self._take(talk, not from_client, piece)
        pieces = own.feed(sequence, data, at) if data else []
        if segment.length > len(data):
            talk.count_cut(segment, at)
            pieces += own.cut((sequence + len(data)) & 0xFFFF_FFFF, segment.length - len(data), at)
        for piece in pieces:
            self._take(talk, from_client, piece)
        if flags & FIN:
            own.fin = (sequence + segment.length) & 0xFFFF_FFFF
        if own.fin is not None and _ended(own) and _ended(other):
            self._close(talk, reset=False)

    def _begin(self, segment: TcpSegment, before: Talk | None) -> Talk:
        """A new connection of the ends of a segment, and the end of the one before it."""
        if before is not None:
            self._held -= before.held
            self._close(before, reset=False)
        answers = segment.flags & SYN and segment.flags & ACK
        source, destination = segment.source, segment.destination
        if destination.port not in self._ports or (answers and source.port in self._ports):
            source, destination = destination, source
        talk = self._talks[segment.ends] = Talk(source, destination, bool(segment.flags & SYN))
        return talk

    def _is_new(self, talk: Talk, segment: TcpSegment) -> bool:
        """Whether a segment of the same two ends belongs to another connection than the one before."""
        own, flags = talk.of(segment.source == talk.client), segment.flags
        if flags & RST:
            return False
        if flags & SYN:
            if talk.reset and not flags & ACK:  # tried again, with the same number
                return True
            return own.first not in (None, (segment.sequence + 1) & 0xFFFF_FFFF)
        if segment.sequence == own.next or own.first is None:
            return False
        return abs(distance(segment.sequence, own.next)) > _JUMP and bool(segment.data)

    def _close(self, talk: Talk, reset: bool, by_server: bool = False) -> None:
        if talk.over or self._flushed(talk):
            return
        for from_client in (True, False):
            own = talk.of(from_client)
            while own.waiting:
                for piece in own.give_up():
                    self._take(talk, from_client, piece)
        talk.over, talk.reset = True, reset
        self._over(talk, by_server, self._now)

    def _flushed(self, talk: Talk) -> bool:
        """What waits for what it acknowledges waits no more; whether its FIN ends the connection."""
        early, talk.early = talk.early, []
        for segment, at in early:
            if not talk.over:
                self._segment(talk, segment.source == talk.client, segment, at)
        return talk.over

    def _push_out(self) -> None:
        """The connection that was silent for longest is over."""
        _, talk = self._talks.popitem(last=False)
        self._held -= talk.held
        talk.open_ended = True
        self._close(talk, reset=False)


def _ended(way: Direction) -> bool:
    """Whether one end has sent its FIN, and everything before it is there."""
    return way.fin is not None and (way.first is None or distance(way.fin, way.next) <= 0)
