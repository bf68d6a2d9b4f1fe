"""Which record calls are ours (docs/pairing.md, "Which records are ours").

Records of 0xB02E, 0xB02F and the indices that a user names are always ours. Index 47 belongs to the maker of the
module, and other devices than drives keep values there. So events at index 47 wait here until their AR proves
that it uses the parameter channel. Then all of them go on, in their order.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterator, Sequence
from typing import Any

from ds47.profidrive import Options, Request, decode_response
from ds47.profidrive.parameter import kind_fits
from ds47.profinet.records import Record
from ds47.spec.layouts import RECORD_PROFIDRIVE_API

ALWAYS = frozenset({0xB02E, 0xB02F})
SHARED_INDEX = 47

ArKey = tuple[str, str, bytes]
"""Controller, device, AR UUID (nil for ReadImplicit)."""
Place = tuple[int, int, int]
"""API, slot, subslot."""
Event = Any
"""What waits: any plain data."""

NEGATIVE = 0x80
"""Response ids from here on mean that a request failed."""
_HEADER = 4
"""Bytes that a request and its response may have in common."""
_SENT = 4
"""How many Writes of a place to compare with a Read: the newest may be refused or still pending."""
_ADDRESSLESS = frozenset({"DS305", "DS306"})
"""Unknown attribute, PNU 0."""


def is_question(request: Request) -> bool:
    """Whether a request is a question (P20): it decodes to its end, with known attributes and no PNU 0."""
    return request.shaped and not any(flaw.rule in _ADDRESSLESS for flaw in request.flaws)


def _is_echo(sent: bytes, data: bytes) -> bool:
    """Whether a Read returns what was written, perhaps with another length: it agrees beyond the header."""
    both = min(len(sent), len(data))
    return data == sent or (both > _HEADER and data[:both] == sent[:both])


class _Waiting:
    """The waiting events of one AR."""

    __slots__ = ("asked", "asks", "cut", "events", "first", "question", "records", "stores")

    def __init__(self, most: int) -> None:
        self.events: deque[Event] = deque(maxlen=most)
        self.asked: OrderedDict[Place, Request] = OrderedDict()
        """The newest Write of each place."""
        self.question = False
        """Whether the AR has sent a question: its events went on already, and also wait here."""
        self.stores = False
        """Whether the AR wrote to a store: then a question proves nothing."""
        self.first = 0
        """The frame of the first record."""
        self.records = 0
        """The number of records: requests, and responses without their request."""
        self.asks = False
        """Whether there was a request."""
        self.cut: Record | None = None
        """The newest Write that may be a change, but for what the capture cut off."""


class Index47:
    """Holds events of index 47 back until their AR has proved itself.

    Args:
        extra: further record indices that are always ours.
        waiting: how many events of one AR, and how many ARs, may wait; the oldest is dropped first.
        waiting_ars: all ARs together may have this many times `waiting` events.
        proven: how many proven ARs to remember; the least recent one is forgotten first.
        outcomes: gets "questions" when an AR sends a question, and "proven" when that AR is proved; "foreign" of a
            Write that the capture cut, and that may have been a change.
    """

    def __init__(
        self,
        extra: frozenset[int],
        waiting: int,
        waiting_ars: int = 16,
        proven: int = 65_536,
        outcomes: list[Any] | None = None,
    ) -> None:
        self._outcomes = [] if outcomes is None else outcomes
        self.always = ALWAYS | extra
        """The indices that are always ours."""
        self.concerned = self.always | {SHARED_INDEX}
        """The indices that can be ours."""
        self._waiting = waiting
        self._most_events = waiting * waiting_ars
        self._most_open = proven
        self.open: OrderedDict[ArKey, None] = OrderedDict()
        """The proven ARs; the one with the newest event is last."""
        self._held: OrderedDict[ArKey, _Waiting] = OrderedDict()
        self._events = 0
        self.drives: OrderedDict[tuple[str, Place], bool] = OrderedDict()
        """Submodules: True, if they have responded at 0xB02E or 0xB02F; False, if they are a store at 47."""
        self._sent: OrderedDict[tuple[str, Place], deque[bytes]] = OrderedDict()
        """The bytes of the newest Writes to a place, from any AR that waits."""
        self._unproven: OrderedDict[str, tuple[int, int, bool]] = OrderedDict()
        """Device -> first frame, number of records, whether there was a request: for ARs that no longer wait."""

    def waits(self, device: str) -> bool:
        """Whether events of a device wait: they may include a change of a parameter."""
        return any(ar[1] == device and not held.question for ar, held in self._held.items())

    def passes(self, ar: ArKey, index: int) -> bool:
        """Whether an event may go on now. Notes that the AR is in use."""
        if ar in self.open:
            self.open.move_to_end(ar)
            return True
        return index in self.always

    def pass_on(
        self, ar: ArKey, event: Event, *, proves: bool = False, asks: bool = False
    ) -> Sequence[Event]:
        """Takes an event that does not pass. Returns the events that go on now.

        The event waits; or it `proves` its AR, and goes on after those that waited. `asks`: it is a question. Then
        the events go on, but also stay here: a Read may show a store.
        """
        if proves:
            return [*self._prove(ar), event]
        if ar not in self._held:
            self._held[ar] = _Waiting(self._waiting)
        held, before = self._held[ar], list[Event]()
        if asks and not (held.question or held.stores):
            held.question, before = True, list(held.events)
            self._outcomes.append(("questions", ar, None))
        goes_on = held.question
        self.follow(ar, event)
        return [*before, event] if goes_on else ()

    def follow(self, ar: ArKey, event: Event) -> None:
        """Lets an event wait behind the others of its AR; drops it if none waits."""
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
        """A record was read at 0xB02E or 0xB02F: if it looks like a response, the submodule is a drive's."""
        if decode_response(data, None, codec).shaped:
            self._put(device, place, drive=True)

    def _put(self, device: str, place: Place, *, drive: bool) -> None:
        self.drives[device, place] = drive
        if len(self.drives) > self._most_open:
            self.drives.popitem(last=False)

    def is_of_drive(self, device: str, place: Place) -> bool:
        """Whether a place is a drive's: it is in the API of PROFIdrive, or has responded."""
        there = RECORD_PROFIDRIVE_API, *place[1:]
        return place == there or any(self.drives.get((device, each)) for each in (place, there))

    def heard(self, ar: ArKey, frame: int, *, asks: bool) -> None:
        """Counts a record that waits: a request, or a response without one."""
        held = self._held.get(ar)
        if held is not None:
            held.first = held.first or frame
            held.records += 1
            held.asks |= asks

    def unheard(self, ar: ArKey) -> None:
        """A counted response has a request after all, which is counted next."""
        held = self._held.get(ar)
        if held is not None:
            held.records -= 1

    def asked(self, record: Record, request: Request) -> None:
        """A Write waits: a matching response will prove that it is a parameter request."""
        ar, place, half = record.relation, record.place, record.request
        held = self._held.get(ar)
        if held is None or half is None:
            return
        if half.cut and (request.operation == "change" or request.request_id is None):
            held.cut = record
        held.asked.pop(place, None)
        held.asked[place] = request
        if len(held.asked) > self._waiting:
            held.asked.popitem(last=False)
        spot = ar[1], place
        held.stores |= self.drives.get(spot) is False
        self._sent.setdefault(spot, deque(maxlen=_SENT)).append(half.data)
        if len(self._sent) > self._waiting:
            self._sent.popitem(last=False)

    def is_question_here(self, device: str, place: Place, request: Request) -> bool:
        """Whether a Write is a question, and its place is not known as a store."""
        return is_question(request) and self.drives.get((device, place)) is not False

    def echoed(self, ar: ArKey, place: Place, data: bytes) -> Sequence[ArKey] | None:
        """A Read brought a record. If that only returns what was written: ARs with a question (P20), else None.

        It does not matter who wrote: all share one store. From now on a question proves no AR that wrote there.
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
        """Whether a record that is no echo is the response to the waiting Write (P20)."""
        held = self._held.get(ar)
        request = held.asked.get(place) if held is not None else None
        if request is None:
            return False
        unknown = request.operation == "unknown" or not request.addresses
        if unknown or not kind_fits(request, data):
            return False
        response = decode_response(data, request, codec)
        refuses = data[1] >= NEGATIVE  # the reason may be that bytes are missing
        return (
            response.request_reference == request.request_reference
            and response.shaped
            and (refuses or request.shaped)
        )

    def unproven(self) -> Iterator[tuple[str, tuple[int, int, bool]]]:
        """Each device without a proven AR: the first frame, the number of records, whether there was a request."""
        questions = [ar for ar, held in self._held.items() if held.question]
        for ar in questions:
            self._prove(ar)
        for ar, held in self._held.items():
            self._leave(ar, held)
        drives = {ar[1] for ar in (*self.open, *questions)}
        yield from (each for each in self._unproven.items() if each[0] not in drives)

    def _leave(self, ar: ArKey, held: _Waiting) -> None:
        """The events of an AR do not wait any longer, and are not ours."""
        if held.cut is not None:
            self._outcomes.append(("foreign", held.cut, None))
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
        if held.question:  # they went on already
            self._outcomes.append(("proven", ar, None))
            return ()
        return held.events
