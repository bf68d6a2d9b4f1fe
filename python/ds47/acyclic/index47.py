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
from ds47.profidrive.parameter import kind_fits
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
_HEADER = 4
"""Bytes of a message that a request and its response may have in common."""
_SENT = 4
"""Writes of a place that a Read of it may bring: the newest may be refused, or under way."""
_ADDRESSLESS = frozenset({"DS305", "DS306"})
"""Unknown attribute, PNU 0."""


def is_question(request: Request) -> bool:
    """Whether a request is one by itself (P20): it decodes to its end, with known attributes and PNUs."""
    return request.shaped and not any(flaw.rule in _ADDRESSLESS for flaw in request.flaws)


def _is_echo(sent: bytes, data: bytes) -> bool:
    """Whether a record is what was written once more, of another length too; behind its header no response is."""
    both = min(len(sent), len(data))
    return data == sent or (both > _HEADER and data[:both] == sent[:both])


class _Waiting:
    """What waits of one AR."""

    __slots__ = ("asked", "asks", "events", "first", "question", "records", "stores")

    def __init__(self, most: int) -> None:
        self.events: deque[Event] = deque(maxlen=most)
        self.asked: OrderedDict[Place, Request] = OrderedDict()
        """The newest Write of each place."""
        self.question = False
        """Whether a question proves the AR, as far as nothing was read: what waits here happened, too,"""
        self.stores = False
        """and whether it wrote to a store, where none does."""
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
        told: is told of an AR that has a question ("questions"), and when more than that proves it ("proven").
    """

    def __init__(
        self,
        extra: frozenset[int],
        waiting: int,
        waiting_ars: int = 16,
        proven: int = 65_536,
        told: list[Any] | None = None,
    ) -> None:
        self._told = [] if told is None else told
        self.always = ALWAYS | extra
        """The indices that are ours whatever they hold."""
        self.concerned = self.always | {SHARED_INDEX}
        """The indices of which a record can be ours at all."""
        self._waiting = waiting
        self._most_events = waiting * waiting_ars
        self._most_open = proven
        self.open: OrderedDict[ArKey, None] = OrderedDict()
        """The ARs that have proved themselves; the one that spoke last comes last."""
        self._held: OrderedDict[ArKey, _Waiting] = OrderedDict()
        self._events = 0
        self.drives: OrderedDict[tuple[str, Place], bool] = OrderedDict()
        """Submodules that have responded at 0xB02E or 0xB02F; False: that are a store at 47."""
        self._sent: OrderedDict[tuple[str, Place], deque[bytes]] = OrderedDict()
        """The bytes of the newest Writes of a place, whoever waits that wrote them."""
        self._unproven: OrderedDict[str, tuple[int, int, bool]] = OrderedDict()
        """Of ARs that do not wait any more, by device: the first frame, how many records, and whether any asks."""

    def waits(self, device: str) -> bool:
        """Whether anything waits that was asked of a device, perhaps a change of a parameter."""
        return any(ar[1] == device and not held.question for ar, held in self._held.items())

    def passes(self, ar: ArKey, index: int) -> bool:
        """Whether an event may go on now; the AR has spoken then."""
        if ar in self.open:
            self.open.move_to_end(ar)
            return True
        return index in self.always

    def pass_on(
        self, ar: ArKey, event: Event, *, proves: bool = False, asks: bool = False
    ) -> Sequence[Event]:
        """Of an event that does not pass: it waits; or it proves its AR, and goes on behind those that waited.

        `asks`: it is a question. That proves its AR until a Read shows a store; so what goes on waits, too.
        """
        if proves:
            return [*self._prove(ar), event]
        if ar not in self._held:
            self._held[ar] = _Waiting(self._waiting)
        held, before = self._held[ar], list[Event]()
        if asks and not (held.question or held.stores):
            held.question, before = True, list(held.events)
            self._told.append(("questions", ar, None))
        goes_on = held.question
        self.follow(ar, event)
        return [*before, event] if goes_on else ()

    def follow(self, ar: ArKey, event: Event) -> None:
        """Lets an event wait behind those that wait for an AR; where none does, it is not needed."""
        held = self._held.get(ar)
        if held is None:
            return
        if held.question and len(held.events) == self._waiting:
            self._prove(ar)  # it need not wait any longer
            return
        self._events += len(held.events) < self._waiting
        held.events.append(event)
        while len(self._held) > self._waiting or self._events > self._most_events:
            oldest = next(iter(self._held))
            if self._held[oldest].question:
                self._prove(oldest)
                continue
            gone = self._held.pop(oldest)
            self._events -= len(gone.events)
            self._leave(oldest, gone)

    def responded(self, device: str, place: Place, data: bytes, codec: Options) -> None:
        """A record was read at 0xB02E or 0xB02F: with the shape of a response its submodule is that of a drive."""
        if decode_response(data, None, codec).shaped:
            self._put(device, place, drive=True)

    def _put(self, device: str, place: Place, *, drive: bool) -> None:
        self.drives[device, place] = drive
        if len(self.drives) > self._most_open:
            self.drives.popitem(last=False)

    def is_of_drive(self, device: str, place: Place) -> bool:
        """Whether a place is that of a drive, whoever asks there: under the API of PROFIdrive, or it responded."""
        there = RECORD_PROFIDRIVE_API, *place[1:]
        return place == there or any(self.drives.get((device, each)) for each in (place, there))

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
        """A Write waits: a response that mirrors it is to prove that it is a request."""
        held = self._held.get(ar)
        if held is None:
            return
        held.asked.pop(place, None)
        held.asked[place] = request
        if len(held.asked) > self._waiting:
            held.asked.popitem(last=False)
        spot = ar[1], place
        held.stores |= self.drives.get(spot) is False
        self._sent.setdefault(spot, deque(maxlen=_SENT)).append(data)
        if len(self._sent) > self._waiting:
            self._sent.popitem(last=False)

    def asks(self, device: str, place: Place, request: Request) -> bool:
        """Whether a Write is a question, as far as its place is no store."""
        return is_question(request) and self.drives.get((device, place)) is not False

    def echoed(self, ar: ArKey, place: Place, data: bytes) -> Sequence[ArKey] | None:
        """A Read brought a record: if it is what was written once more, the ARs that a question proved (P20).

        Whoever wrote: a store has one for all. A question proves none of those who wrote there any more.
        """
        device, spot = ar[1], (ar[1], place)
        if not any(_is_echo(sent, data) for sent in self._sent.get(spot, ())):
            return None
        known, gone = self.drives.get(spot) is False, list[ArKey]()
        self._put(*spot, drive=False)
        for each in [ar] if known else list(self._held):
            held = self._held.get(each)
            if held is not None and each[1] == device and place in held.asked:
                if held.question:
                    gone.append(each)
                held.stores, held.question = True, False
        return gone

    def answers(self, ar: ArKey, place: Place, data: bytes, codec: Options) -> bool:
        """Whether a record that is no echo is the response to the Write that waits (P20)."""
        held = self._held.get(ar)
        request = held.asked.get(place) if held is not None else None
        if request is None:
            return False
        unknown = request.operation == "unknown" or not request.addresses
        if unknown or not kind_fits(request, data):
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
        questions = [ar for ar, held in self._held.items() if held.question]
        for ar in questions:
            self._prove(ar)
        for ar, held in self._held.items():
            self._leave(ar, held)
        drives = {ar[1] for ar in (*self.open, *questions)}
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
        if held.question:  # they went on
            self._told.append(("proven", ar, None))
            return ()
        return held.events
