"""Which record calls are ours (docs/pairing.md, "Which records are ours").

0xB02E, 0xB02F and the indices a user names always are. Index 47 belongs to whoever made the module, and devices
that are no drives keep values there: what comes on it waits here until that AR proves to use the parameter
channel; then all of it, in its order, goes on.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterator, Sequence
from typing import Any

from ds47.profidrive import Options, Request, decode_response
from ds47.profidrive.family import kind_fits
from ds47.spec.layouts import RECORD_PROFIDRIVE_API

ALWAYS = frozenset({0xB02E, 0xB02F})
SHARED_INDEX = 47

ArKey = tuple[str, str, bytes]
"""Controller, device, AR UUID (nil for ReadImplicit)."""
Place = tuple[int, int, int]
"""API, slot, subslot."""
Event = Any
"""What waits: plain data, of which nothing is known here."""

NEGATIVE = 0x80
"""The response ids from here on are those of requests that were not done."""
_ADDRESSLESS = frozenset({"DS305", "DS306"})
"""Unknown attribute, PNU 0."""


def is_question(request: Request) -> bool:
    """Whether a request is one by itself (P20): it decodes to its end, with known attributes and PNUs."""
    return request.shaped and not any(flaw.rule in _ADDRESSLESS for flaw in request.flaws)


class _Waiting:
    """What waits of one AR."""

    __slots__ = ("asked", "asks", "events", "first", "records")

    def __init__(self, most: int) -> None:
        self.events: deque[Event] = deque(maxlen=most)
        self.asked: OrderedDict[Place, tuple[Request, bytes]] = OrderedDict()
        """The newest Write of each place, if it can be a request."""
        self.first = 0
        """The frame of the first record,"""
        self.records = 0
        """how many there were (requests, and responses without their request),"""
        self.asks = False
        """and whether there was a request."""


class Index47:
    """Holds events of index 47 back until their AR has proved itself.

    Args:
        extra: record indices that are ours whatever they hold.
        waiting: how many events of one AR, and how many ARs, may wait; the oldest goes first.
        waiting_ars: how many times as many events may wait of all ARs together.
        proven: how many ARs that have proved themselves are remembered; the one that spoke last goes
            last.
    """

    def __init__(
        self, extra: frozenset[int], waiting: int, waiting_ars: int = 16, proven: int = 65_536
    ) -> None:
        self._always = ALWAYS | extra
        self.concerned = self._always | {SHARED_INDEX}
        """The indices of which a record can be ours at all."""
        self._waiting = waiting
        self._most_events = waiting * waiting_ars
        self._most_open = proven
        self.open: OrderedDict[ArKey, None] = OrderedDict()
        """The ARs that have proved themselves; the one that spoke last comes last."""
        self._held: OrderedDict[ArKey, _Waiting] = OrderedDict()
        self._events = 0
        self._drives: OrderedDict[tuple[str, Place], None] = OrderedDict()
        """Submodules that have responded at 0xB02E or 0xB02F."""
        self._unproven: OrderedDict[str, tuple[int, int, bool]] = OrderedDict()
        """Of ARs that do not wait any more, by device: the first frame, how many records, and whether any asks."""

    def waits(self, device: str) -> bool:
        """Whether anything waits that was asked of a device, perhaps a change of a parameter."""
        return any(ar[1] == device for ar in self._held)

    def passes(self, ar: ArKey, index: int) -> bool:
        """Whether an event may go on now; the AR has spoken then."""
        if ar in self.open:
            self.open.move_to_end(ar)
            return True
        return index in self._always

    def pass_on(self, ar: ArKey, event: Event, *, proves: bool = False) -> Sequence[Event]:
        """Of an event that does not pass: it waits; or it proves its AR, and goes on behind those that waited."""
        if proves:
            return [*self._prove(ar), event]
        if ar not in self._held:
            self._held[ar] = _Waiting(self._waiting)
        self.follow(ar, event)
        return ()

    def follow(self, ar: ArKey, event: Event) -> None:
        """Lets an event wait behind those that wait for an AR; where none does, it is not needed."""
        held = self._held.get(ar)
        if held is None:
            return
        self._events += len(held.events) < self._waiting
        held.events.append(event)
        while len(self._held) > self._waiting or self._events > self._most_events:
            oldest, gone = self._held.popitem(last=False)
            self._events -= len(gone.events)
            self._leave(oldest, gone)

    def responded(self, device: str, place: Place, data: bytes, codec: Options) -> None:
        """A record was read at 0xB02E or 0xB02F: with the shape of a response its submodule is that of a drive."""
        if (device, place) in self._drives or not decode_response(data, None, codec).shaped:
            return
        self._drives[device, place] = None
        if len(self._drives) > self._most_open:
            self._drives.popitem(last=False)

    def is_of_drive(self, device: str, place: Place) -> bool:
        """Whether a place is that of a drive, whoever asks there: under the API of PROFIdrive, or it responded."""
        there = RECORD_PROFIDRIVE_API, *place[1:]
        return place == there or (device, place) in self._drives or (device, there) in self._drives

    def heard(self, ar: ArKey, frame: int, *, asks: bool) -> None:
        """A record waits now: a request, or a response without one."""
        held = self._held.get(ar)
        if held is not None:
            held.first = held.first or frame
            held.records += 1
            held.asks |= asks

    def unheard(self, ar: ArKey) -> None:
        """A response that was heard has a request after all, which is heard next."""
        held = self._held.get(ar)
        if held is not None:
            held.records -= 1

    def asked(self, ar: ArKey, place: Place, request: Request, data: bytes) -> None:
        """A Write waits that may be a request: a response that mirrors it is to prove it."""
        held = self._held.get(ar)
        if held is None:
            return
        held.asked.pop(place, None)
        if request.operation != "unknown" and request.addresses:
            held.asked[place] = request, data
            if len(held.asked) > self._waiting:
                held.asked.popitem(last=False)

    def answers(self, ar: ArKey, place: Place, data: bytes, codec: Options) -> bool:
        """Whether a record is the response to the Write that waits, and not the same bytes once more (P20)."""
        held = self._held.get(ar)
        request, sent = held.asked.get(place, (None, b"")) if held is not None else (None, b"")
        if request is None or data == sent or not kind_fits(request, data):
            return False
        response = decode_response(data, request, codec)
        refuses = data[1] >= NEGATIVE  # it may be what lacks bytes that is refused
        return (
            response.request_reference == request.request_reference
            and response.shaped
            and (refuses or request.shaped)
        )

    def unproven(self) -> Iterator[tuple[str, tuple[int, int, bool]]]:
        """Each device of which no AR has proved itself: the first frame, how many records, whether any asks."""
        for ar, held in self._held.items():
            self._leave(ar, held)
        drives = {ar[1] for ar in self.open}
        yield from (each for each in self._unproven.items() if each[0] not in drives)

    def _leave(self, ar: ArKey, held: _Waiting) -> None:
        """What waits of an AR will not be ours."""
        if not held.records:
            return
        first, records, asks = self._unproven.get(ar[1], (held.first, 0, False))
        told = min(first, held.first), records + held.records, asks or held.asks
        self._unproven[ar[1]] = told
        if len(self._unproven) > self._most_open:
            self._unproven.popitem(last=False)

    def _prove(self, ar: ArKey) -> Sequence[Event]:
        self.open[ar] = None
        while len(self.open) > self._most_open:
            self.open.popitem(last=False)
        held = self._held.pop(ar, None)
        if held is None:
            return ()
        self._events -= len(held.events)
        return held.events
