"""Whether what was read was in the memory at one moment, as the captured writes make it (docs/s7.md 6).

A pure decision on accesses to one memory; which ones matter is known by `memory`, and nothing is kept here.
What is decided is conservative: where it is open what a write did, and when, the data counts as whole.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

NEVER: Final = 1 << 128
"""Nanoseconds that no capture has: when what was not answered is over."""
MOST_STEPS = 20_000
"""Events that are looked at to answer one question; where more would have to be, the data counts as whole."""
_MASK = 4_096
"""Bits of a mask that count as one step."""


@dataclass(slots=True, init=False, eq=False)
class ItemAccess:
    """An item of a GET or PUT; it takes effect at some moment from `asked_ns` to `answered_ns`, both included.

    Nobody changes one.
    """

    order: int
    """Tells accesses apart."""
    connection: int
    write: bool
    area: int
    db: int
    start: int
    """The first byte."""
    data: bytes
    """What was read or is written."""
    asked_ns: int
    answered_ns: int | None
    """None where the answer was not seen: the write may come into force at any later time."""
    request: int
    """The frame that completes the request,"""
    response: int | None
    """and that of the answer."""
    sure: bool
    """False for a write that may never have come into force: refused, or without an answer."""
    known: bool
    """False where only some bits of the bytes are written: they may then have any value."""
    end: int = field(repr=False)
    """The first byte behind it."""
    until: int = field(repr=False)
    """The last moment at which it takes effect."""

    def __init__(
        self,
        order: int,
        connection: int,
        write: bool,
        area: int,
        db: int,
        start: int,
        data: bytes,
        asked_ns: int,
        answered_ns: int | None,
        request: int,
        response: int | None,
        sure: bool = True,
        known: bool = True,
    ) -> None:
        self.order = order
        self.connection = connection
        self.write = write
        self.area = area
        self.db = db
        self.start = start
        self.data = data
        self.asked_ns = asked_ns
        self.answered_ns = answered_ns
        self.request = request
        self.response = response
        self.sure = sure
        self.known = known
        self.end = start + len(data)
        self.until = NEVER if answered_ns is None else answered_ns

    def meets(self, other: ItemAccess) -> bool:
        """Whether both have bytes in common, and it is open which of them was first."""
        if self.start >= other.end or other.start >= self.end:
            return False
        return self.asked_ns <= other.until and other.asked_ns <= self.until


@dataclass(slots=True, eq=False)
class _Event:
    """An access as the decision sees it: bit n of a mask is byte n of what was read."""

    asked: int
    answered: int
    sure: bool
    whole: bool
    """Whether all its bytes take effect at once; else each at a moment of its own."""
    cover: int
    wrong: int
    """Bytes to which it gives another value than was read."""


class Question:
    """What was read, and everything else that happened to the same memory.

    A write takes effect as a whole unless another one that it meets may come between; reads give evidence of
    single bytes: that each had its value at some moment.

    Args:
        read: the parts of what was read, or of what was read in one job.
        others: writes, and further reads, from the beginning of the first part on. What may have come into force
            earlier and is not among them is in `before`.
        before: bytes whose values are known from then.
        ignore: bit n: byte n is left out, because an uncaptured station writes it.
    """

    def __init__(
        self,
        read: Sequence[ItemAccess],
        others: Sequence[ItemAccess],
        before: Mapping[int, int],
        ignore: int = 0,
    ) -> None:
        self.begin = min(each.asked_ns for each in read)
        self.end = max(each.until for each in read)
        self._start = min(each.start for each in read)
        self._values = bytearray(max(each.end for each in read) - self._start)
        for each in read:
            self._values[each.start - self._start : each.end - self._start] = each.data
        self.all = 0
        for each in read:
            self.all |= span(each.start - self._start, each.end - self._start)
        self.all &= ~(ignore >> self._start)
        self._before = self._mask(
            at for at, byte in before.items()
            if self._has(at) and self._values[at - self._start] != byte
        )  # fmt: skip
        apart = _apart([each for each in others if each.write])
        self._events = [
            event
            for each in others
            if each.asked_ns <= self.end and (event := self._event(each, apart)).cover
        ]
        self._steps = MOST_STEPS
        self._each = 1 + len(self._values) // _MASK
        times = {time for each in self._events for time in (each.asked, each.answered)}
        self._moments = sorted({self.begin, *(t for t in times if self.begin <= t <= self.end)})

    def mixed(self) -> tuple[int, int] | None:
        """Two bytes that never had these values at the same time; None if there may be such a moment."""
        if self.held(self.all):
            return None
        bytes_left = _fewest(self.all, self.held)
        if len(bytes_left) != 2:
            return None
        return self._start + bytes_left[0], self._start + bytes_left[1]

    def held(self, wanted: int) -> bool:
        """Whether there may have been a moment at which all these bytes had the values that were read."""
        return any(self._possible(moment, wanted) for moment in self._moments)

    def byte(self, at: int) -> bool:
        """The same of one byte."""
        return self.held(1 << at - self._start)

    def _has(self, at: int) -> bool:
        return 0 <= at - self._start < len(self._values)

    def _mask(self, offsets: Iterable[int]) -> int:
        mask = 0
        for at in offsets:
            if self._has(at):
                mask |= 1 << at - self._start
        return mask

    def _event(self, access: ItemAccess, apart: Collection[int]) -> _Event:
        whole = access.write and access.order not in apart
        first = max(access.start, self._start)
        end = min(access.end, self._start + len(self._values))
        cover = span(first - self._start, end - self._start) & self.all if first < end else 0
        wrong = 0
        if cover and access.known:
            given = access.data[first - access.start : end - access.start]
            there = self._values[first - self._start : end - self._start]
            if given != there:
                differ = (n for n, (a, b) in enumerate(zip(given, there, strict=True)) if a != b)
                wrong = self._mask(first + n for n in differ) & cover
        return _Event(access.asked_ns, access.until, access.sure, whole, cover, wrong)

    def _possible(self, moment: int, wanted: int) -> bool:
        """Whether the events before a moment have an order after which the wanted bytes are as they were read.

        The order is built from its end: whatever may be the last event, and changes none of the bytes that are
        still wanted, is the last one, and its bytes are wanted no more. Of several the one whose answer came last
        is taken: it excludes the fewest.
        """
        left = {
            n: each.cover & wanted for n, each in enumerate(self._events)
            if each.asked <= moment and each.cover & wanted
        }  # fmt: skip
        must = {n for n in left if self._events[n].sure and self._events[n].answered < moment}
        earliest = NEVER
        while must or wanted & self._before:
            latest = max((self._events[n].asked for n in must), default=-NEVER)
            last = self._last(left, wanted, latest, earliest)
            self._steps -= self._each * (1 + len(left))
            if self._steps < 0:
                return True
            if last is None:
                return False
            n, taken = last
            earliest = min(earliest, self._events[n].answered)
            wanted &= ~taken
            left[n] &= ~taken
            if not left[n]:
                del left[n]
                must.discard(n)
        return True

    def _last(
        self, left: Mapping[int, int], wanted: int, latest: int, earliest: int
    ) -> tuple[int, int] | None:
        """An event that may be the last one of those left, and its bytes that may."""
        best: tuple[int, int] | None = None
        for n, cover in left.items():
            event = self._events[n]
            if event.answered < latest or event.asked > earliest:
                continue
            wrong = event.wrong & wanted & cover
            taken = cover & ~wrong
            if not taken or (event.whole and wrong):
                continue
            if best is None or event.answered > self._events[best[0]].answered:
                best = n, taken
        return best


def _apart(writes: Sequence[ItemAccess]) -> set[int]:
    """The numbers of writes that meet another one: their bytes may take effect one by one."""
    ordered = sorted(writes, key=lambda each: each.asked_ns)
    found: set[int] = set()
    for n, each in enumerate(ordered):
        for other in ordered[n + 1 :]:
            if other.asked_ns > each.until:
                break
            if each.meets(other):
                found |= {each.order, other.order}
    return found


def span(first: int, end: int) -> int:
    """A mask of the bytes from one up to another."""
    return (1 << end) - (1 << first)


def _fewest(mask: int, held: Callable[[int], bool]) -> list[int]:
    """Bits of a mask of which `held` says no, as it does of the mask, and of which none can be left out."""
    bits = [n for n in range(mask.bit_length()) if mask >> n & 1]
    size = len(bits)
    while size:
        at = 0
        while at < len(bits):
            rest = bits[:at] + bits[at + size :]
            if held(sum(1 << n for n in rest)):
                at += size
            else:
                bits = rest
        size //= 2
    return bits
