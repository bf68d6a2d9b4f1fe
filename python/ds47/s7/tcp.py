"""TCP segments to the bytes of each direction, in their order (docs/s7.md 2).

Copies and retransmissions are left out, and what comes too early waits, within bounds. What is lost is known as
such when the other side has acknowledged it and more is there: nobody will send it again. What those bytes are is
`tpkt`. Fragments of IP are not put together: TCP of a PLC has none.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ds47.s7.model import At, End

FIN, SYN, RST, ACK = 1, 2, 4, 16
WINDOW = 1 << 16
"""Bytes of a direction that may wait, and how far behind what was seen first something may still come."""
MOST_WAITING = 256
"""Segments of a direction that may wait."""
_HOLES = 8
"""Lost ranges of a direction that are remembered: late bytes belong there."""
_JUMP = 1 << 24
"""So far away are the sequence numbers of another connection."""
_OVERHEAD = 128
_HEADER = struct.Struct(">HHIIBB6x")


class Segment(NamedTuple):
    """A TCP segment; `length` counts the bytes that were sent, of which the capture may lack the last ones."""

    source: End
    destination: End
    sequence: int
    acknowledge: int
    flags: int
    data: bytes
    length: int


def parse(source: str, destination: str, payload: bytes, missing: int) -> Segment | None:
    """The segment in the payload of an IP packet of which so many bytes are missing; None where it is none."""
    if len(payload) < _HEADER.size:
        return None
    from_port, to_port, sequence, acknowledge, offset, flags = _HEADER.unpack_from(payload)
    begin = (offset >> 4) * 4
    if begin < _HEADER.size or begin > len(payload) + missing:
        return None
    data = payload[begin:]
    length = max(0, len(payload) + missing - begin)
    return Segment(
        End(source, from_port),
        End(destination, to_port),
        sequence,
        acknowledge,
        flags,
        data,
        length,
    )


class Piece(NamedTuple):
    """Bytes in order. `lost` are those that are missing before it; a `late` piece belongs in such a place."""

    data: bytes
    at: At
    lost: int = 0
    late: bool = False


def distance(one: int, other: int) -> int:
    """How far a sequence number is behind another one; negative where it is before it."""
    return ((one - other + 0x8000_0000) & 0xFFFF_FFFF) - 0x8000_0000


@dataclass(slots=True, eq=False)
class Direction:
    """What one end sends; places are bytes from the first one that was seen."""

    first: int | None = None
    """Sequence number of the first byte; None before it was seen."""
    next: int = 0
    """That of the byte which comes next,"""
    place: int = 0
    """and its place."""
    fin: int | None = None
    """Sequence number of the end."""
    waiting: list[tuple[int, bytes, At]] = field(default_factory=list)
    """Place, bytes and frame of what came too early, in order."""
    held: int = 0
    """Bytes that this takes."""
    holes: list[tuple[int, int]] = field(default_factory=list)
    """Places of what was lost, from and up to."""

    def begin(self, sequence: int, seen: bool) -> None:
        """The first byte has this number; `seen`: the beginning of the connection is in the capture."""
        self.first = self.next = sequence
        if not seen:
            self.holes.append((-WINDOW, 0))

    def feed(self, sequence: int, data: bytes, at: At) -> Iterator[Piece]:
        """Bytes of a segment; gives what is in order now."""
        early = distance(sequence, self.next)
        if early < 0:
            yield from self._late(self.place + early, data, at)
            data, early = data[-early:], 0
        if not data:
            return
        if early > 0:
            self._wait(self.place + early, data, at)
            if self.held > WINDOW or len(self.waiting) > MOST_WAITING:
                yield from self.give_up()
            return
        self._pass(len(data))
        yield Piece(data, at)
        yield from self._drain(0)

    def acknowledged(self, number: int) -> Iterator[Piece]:
        """The other side has everything before this number: what is missing there will not come any more."""
        while self.waiting and distance(number, self.next) > 0:
            yield from self.give_up()

    def give_up(self) -> Iterator[Piece]:
        """What is missing before the first bytes that wait is lost."""
        if self.waiting:
            have, begin = self.place, self.waiting[0][0]
            self.holes = [*self.holes[1 - _HOLES :], (have, begin)]
            self._pass(begin - have)
            yield from self._drain(begin - have)

    def _pass(self, count: int) -> None:
        self.next = (self.next + count) & 0xFFFF_FFFF
        self.place += count

    def _wait(self, begin: int, data: bytes, at: At) -> None:
        index = len(self.waiting)
        while index and self.waiting[index - 1][0] > begin:
            index -= 1
        before = self.waiting[index - 1] if index else None
        if before is None or before[0] != begin or len(before[1]) < len(data):
            self.waiting.insert(index, (begin, data, at))
            self.held += len(data) + _OVERHEAD

    def _drain(self, lost: int) -> Iterator[Piece]:
        """What waited and is in order now; before the first of it so many bytes are missing."""
        while self.waiting and self.waiting[0][0] <= self.place:
            begin, data, at = self.waiting.pop(0)
            self.held -= len(data) + _OVERHEAD
            fresh = data[self.place - begin :]
            if fresh:
                self._pass(len(fresh))
                yield Piece(fresh, at, lost)
                lost = 0

    def _late(self, begin: int, data: bytes, at: At) -> Iterator[Piece]:
        """What was lost comes after all: once."""
        for number, (left, right) in enumerate(self.holes):
            first, last = max(begin, left), min(begin + len(data), right)
            if first < last:
                rest = [part for part in ((left, first), (last, right)) if part[0] < part[1]]
                self.holes[number : number + 1] = rest
                yield Piece(data[first - begin : last - begin], at, late=True)
                return


@dataclass(slots=True, eq=False)
class Talk:
    """A TCP connection: client, server, and what each sends. `owner` is whatever the listener keeps of it."""

    client: End
    server: End
    begun: bool
    forward: Direction = field(default_factory=Direction)
    backward: Direction = field(default_factory=Direction)
    over: bool = False
    reset: bool = False
    owner: Any = None
    kept: int = 0
    """Bytes that the listener keeps of it, as he says."""

    @property
    def held(self) -> int:
        """Bytes that it takes."""
        return self.forward.held + self.backward.held + self.kept

    def of(self, from_client: bool) -> Direction:
        """What one end sends."""
        return self.forward if from_client else self.backward


Take = Callable[[Talk, bool, Piece], None]
Over = Callable[[Talk, bool, At], None]


class Streams:
    """All connections of the ports that are wanted.

    Args:
        ports: of servers.
        take: is given each piece, and whether the client sent it.
        over: is told of a connection that is over, and whether by a RST of the server.
        most: how many connections are followed at once; of more, the one that was silent for longest is over.
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
        self._talks: OrderedDict[tuple[End, End], Talk] = OrderedDict()
        self._held = 0
        self._now = At(0, 0)

    def feed(self, segment: Segment, at: At) -> None:
        """The next segment of the capture."""
        if not {segment.source.port, segment.destination.port} & self._ports:
            return
        self._now = at
        talk = self._talk(segment)
        before = talk.held
        from_client = segment.source == talk.client
        if segment.flags & RST:
            self._close(talk, reset=True, by_server=not from_client)
        elif not talk.over:
            self._segment(talk, from_client, segment, at)
        self._held += talk.held - before
        self._bound()

    def finish(self) -> None:
        """Nothing more comes."""
        for talk in list(self._talks.values()):
            self._close(talk, reset=False)
        self._talks.clear()

    def _segment(self, talk: Talk, from_client: bool, segment: Segment, at: At) -> None:
        own, other = talk.of(from_client), talk.of(not from_client)
        sequence = segment.sequence
        if segment.flags & SYN:
            sequence = (sequence + 1) & 0xFFFF_FFFF
            if own.first is None:
                own.begin(sequence, seen=True)
            elif own.first == sequence:
                own.holes = [hole for hole in own.holes if hole[0] >= 0]
        elif own.first is None and segment.data:
            own.begin(sequence, seen=talk.begun)
        if segment.flags & ACK:
            for piece in other.acknowledged(segment.acknowledge):
                self._take(talk, not from_client, piece)
        if segment.data:
            for piece in own.feed(sequence, segment.data, at):
                self._take(talk, from_client, piece)
        if segment.flags & FIN:
            own.fin = (sequence + segment.length) & 0xFFFF_FFFF
        if _ended(own) and _ended(other):
            self._close(talk, reset=False)

    def _talk(self, segment: Segment) -> Talk:
        """The connection of a segment: the one of these ends, or a new one."""
        key = min(segment.source, segment.destination), max(segment.source, segment.destination)
        talk = self._talks.get(key)
        if talk is not None and self._is_new(talk, segment):
            self._held -= talk.held
            self._close(talk, reset=False)
            talk = None
        if talk is None:
            talk = self._begin(segment)
            self._talks[key] = talk
        self._talks.move_to_end(key)
        return talk

    def _begin(self, segment: Segment) -> Talk:
        answers = segment.flags & SYN and segment.flags & ACK
        source, destination = segment.source, segment.destination
        served = destination.port in self._ports
        if served and (not answers or source.port not in self._ports):
            return Talk(source, destination, bool(segment.flags & SYN))
        return Talk(destination, source, bool(segment.flags & SYN))

    def _is_new(self, talk: Talk, segment: Segment) -> bool:
        """Whether a segment of the same two ends belongs to another connection than the one before."""
        own = talk.of(segment.source == talk.client)
        if segment.flags & RST:
            return False
        if segment.flags & SYN:
            if talk.reset and not segment.flags & ACK:  # tried again, with the same number
                return True
            return own.first not in (None, (segment.sequence + 1) & 0xFFFF_FFFF)
        far = abs(distance(segment.sequence, own.next)) > _JUMP
        return far and bool(segment.data) and own.first is not None

    def _close(self, talk: Talk, reset: bool, by_server: bool = False) -> None:
        if talk.over:
            return
        for from_client in (True, False):
            own = talk.of(from_client)
            while own.waiting:
                for piece in own.give_up():
                    self._take(talk, from_client, piece)
        talk.over, talk.reset = True, reset
        self._over(talk, by_server, self._now)

    def _bound(self) -> None:
        while len(self._talks) > self._most or self._held > self._most_bytes:
            _, talk = self._talks.popitem(last=False)
            self._held -= talk.held
            self._close(talk, reset=False)


def _ended(way: Direction) -> bool:
    """Whether one end has sent its FIN, and everything before it is there."""
    return way.fin is not None and (way.first is None or distance(way.fin, way.next) <= 0)
