"""What is known of one memory of a partner: who wrote what, and which bytes have uncaptured writers.

Bounded: of what is long over only the last values are kept. What is of one moment is decided in `consistency`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ds47.s7.consistency import NEVER, ItemAccess, Question, span

MOST_LOST = 16
"""Writes without an answer that are remembered by themselves."""
MOST_BYTES = 1 << 17
"""Bytes that are remembered so: of accesses, and of reads."""


class MixedBytes(NamedTuple):
    """Two bytes of what was read that never were in the memory together, and a write that says so."""

    first: int
    second: int
    write: ItemAccess


class MemoryImage:
    """The known values of bytes."""

    def __init__(self) -> None:
        self.known = 0
        """Bit n: whether the value of byte n is known."""
        self._values = bytearray()

    def copy(self) -> MemoryImage:
        """The same, to change."""
        other = MemoryImage()
        other.known, other._values = self.known, self._values[:]
        return other

    def put(self, access: ItemAccess) -> None:
        """From now on the bytes have these values."""
        if len(self._values) < access.end:
            self._values.extend(bytes(access.end - len(self._values)))
        self._values[access.start : access.end] = access.data
        self.known |= span(access.start, access.end)

    def forget(self, mask: int) -> None:
        """The values of these bytes are not known."""
        self.known &= ~mask

    def same(self, access: ItemAccess) -> bool:
        """Whether what was read is what was known."""
        if self._values[access.start : access.end] != access.data:
            return False
        mask = span(access.start, access.end)
        return self.known & mask == mask

    def others(self, access: ItemAccess, but: int) -> list[int]:
        """Bytes that are known, and were read with another value; those of a mask do not count."""
        counts = self.known & span(access.start, access.end) & ~but
        if not counts:
            return []
        there = bytes(self._values[access.start : access.end])
        both = enumerate(zip(there, access.data, strict=False), access.start)
        return [at for at, (old, new) in both if old != new and counts >> at & 1]

    def within(self, start: int, end: int) -> dict[int, int]:
        """The bytes from one up to another that are known."""
        known = (self.known & span(start, end)) >> start
        there = bytes(self._values[start:end])
        return {start + n: byte for n, byte in enumerate(there) if known >> n & 1}


class Memory:
    """One area, or one data block, of a partner. `most`: accesses that are kept by themselves."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._before, self._latest = MemoryImage(), MemoryImage()
        self._history: list[ItemAccess] = []
        self._open: dict[int, ItemAccess] = {}
        self._lost: list[ItemAccess] = []
        self._reads: deque[ItemAccess] = deque()
        self._read_bytes = 0
        self._bytes = 0
        """Of the history."""
        self._written = -NEVER
        """When the last write that was answered was over."""
        self._since = -1
        """All accesses that may have been in force after this time are known."""
        self.foreign = 0
        """Bit n: byte n had a value that no captured write explains, so it has another writer."""

    def sent(self, write: ItemAccess) -> None:
        """A write was asked for: it may come into force at any time."""
        self._open[write.order] = write

    def gave_up(self, write: ItemAccess) -> None:
        """A write has no answer: it may still come into force."""
        if self._open.pop(write.order, None) is None:
            return
        self._lost.append(write)
        if len(self._lost) > MOST_LOST or sum(len(each.data) for each in self._lost) > MOST_BYTES:
            oldest = self._lost.pop(0)
            self.foreign |= span(oldest.start, oldest.end)

    def written(self, write: ItemAccess) -> None:
        """A write was answered."""
        self._open.pop(write.order, None)
        if write.asked_ns <= self._since:
            self.forget(write.until)
            return
        self._keep(write)
        if write.sure and write.known:
            self._latest.put(write)
        else:
            self._latest.forget(span(write.start, write.end))

    def read(self, read: ItemAccess) -> None:
        """Bytes were read; what says nothing new does not count as evidence."""
        self._reads.append(read)
        self._read_bytes += len(read.data)
        while len(self._reads) > self._most or self._read_bytes > MOST_BYTES:
            self._read_bytes -= len(self._reads.popleft().data)
        if self._latest.same(read):
            return
        self._unexplained(read)
        self._latest.put(read)
        if read.asked_ns > self._since:
            self._keep(read)

    def forget(self, time_ns: int) -> None:
        """Until now an uncaptured station may have written the memory."""
        self._since = max(self._since, time_ns)
        self._before, self._latest = MemoryImage(), MemoryImage()
        self._history.clear()
        self._reads.clear()
        self._bytes = self._read_bytes = 0

    def writes(self) -> Iterator[ItemAccess]:
        """The latest writes that were answered."""
        return (each for each in self._history if each.write)

    def reads(self, whole: ItemAccess) -> list[ItemAccess]:
        """The latest reads that met a write."""
        return [each for each in self._reads if each.meets(whole)]

    def unread(self, read: ItemAccess) -> Iterator[ItemAccess]:
        """Writes that a read should return, as no later write is known, and that no read has met before."""
        there = [each for each in (*self._all(), *self._reads) if _share(each, read)]
        for write in self.writes():
            later = [each for each in there if each.until >= write.asked_ns and each is not write]
            if (
                write.sure and write.known and write.until < read.asked_ns and _share(write, read)
                and not any(_share(each, write) for each in later)
            ):  # fmt: skip
                yield write

    def is_quiet(self, parts: Sequence[ItemAccess]) -> bool:
        """Whether no write can have come into force while these were read, as the writes are."""
        if self._open or self._lost:
            return False
        begin = parts[0].asked_ns if len(parts) == 1 else min(each.asked_ns for each in parts)
        return self._written < begin

    def mixed(
        self,
        parts: Sequence[ItemAccess],
        instead: Sequence[ItemAccess] = (),
        whole: ItemAccess | None = None,
    ) -> MixedBytes | None:
        """What was read, if it never was in the memory at one moment; None where it may have been.

        Args:
            parts: of one read.
            instead: the parts of a write that wants to be one,
            whole: and the write as one.
        """
        one = [] if whole is None else [whole]
        begin = min(each.asked_ns for each in (*parts, *one))
        left_out = {each.order for each in (*parts, *instead)}
        writes = [each for each in self._all() if each.write and each.order not in left_out]
        if begin <= self._since or not any(_between(each, parts) for each in (*writes, *one)):
            return None
        before, later = self._settled(begin)
        others = [*(each for each in later if each.order not in left_out), *one]
        start, end = min(each.start for each in parts), max(each.end for each in parts)
        question = Question(parts, others, before.within(start, end), self.foreign)
        two = question.mixed()
        if two is None:
            return None
        meant = [
            each for each in others
            if each.write and each.asked_ns <= question.end and each.until >= question.begin
            and any(each.start <= at < each.end for at in two)
        ]  # fmt: skip
        if not meant:
            return None
        return MixedBytes(*two, min(meant, key=lambda each: (not each.sure, each.asked_ns)))

    def _unexplained(self, read: ItemAccess) -> None:
        """Marks the bytes of a read with values that no captured write explains."""
        differ = self._latest.others(read, self.foreign)
        if not differ:
            return
        before, later = self._settled(read.asked_ns)
        others = [each for each in later if _share(each, read)]
        known = before.within(read.start, read.end)
        question = Question([read], others, known)
        for at in differ:
            value = read.data[at - read.start]
            if not (_explains(at, value, others, known) and question.byte(at)):
                self.foreign |= 1 << at

    def _settled(self, time_ns: int) -> tuple[MemoryImage, list[ItemAccess]]:
        """What is known from before a time, and everything that may have been in force later."""
        self._history.sort(key=lambda each: each.asked_ns)
        cut = self._cut(len(self._history), time_ns)
        before = self._before.copy()
        _come_over(before, self._history[:cut])
        return before, [*self._history[cut:], *self._open.values(), *self._lost]

    def _all(self) -> Iterator[ItemAccess]:
        """Everything that is kept by itself."""
        yield from self._history
        yield from self._open.values()
        yield from self._lost

    def _keep(self, access: ItemAccess) -> None:
        if access.write and access.until > self._written:
            self._written = access.until
        self._history.append(access)
        self._bytes += len(access.data)
        if len(self._history) > self._most or self._bytes > MOST_BYTES:
            self._fold()

    def _fold(self) -> None:
        """Keeps only the values of what was over before everything else began."""
        self._history.sort(key=lambda each: each.asked_ns)
        cut = self._cut(len(self._history) - min(self._most, len(self._history)) // 2)
        if cut:
            over, self._history = self._history[:cut], self._history[cut:]
            self._bytes -= sum(len(each.data) for each in over)
            _come_over(self._before, over)
            self._since = max(self._since, *[each.until for each in over])
        elif len(self._history) > 4 * self._most or self._bytes > 4 * MOST_BYTES:
            self.forget(max(each.answered_ns or 0 for each in self._history))

    def _cut(self, most: int, time_ns: int = NEVER) -> int:
        """How many of the oldest accesses, which are sorted, were over before a time and all others began.

        Args:
            most: at the most.
            time_ns: that time.
        """
        begins = min([time_ns, *[each.asked_ns for each in self._open.values()]])
        history, latest, found = self._history, -NEVER, 0
        for n, each in enumerate(history[:most], 1):
            if each.until > latest:
                latest = each.until
            if latest >= begins:
                break
            if n == len(history) or latest < history[n].asked_ns:
                found = n
        return found


def _come_over(image: MemoryImage, accesses: Sequence[ItemAccess]) -> None:
    """Accesses, in the order of their requests, that are over: what they leave, as far as that is certain."""
    unknown = 0
    for n, each in enumerate(accesses):
        if each.write and not (each.sure and each.known):
            unknown |= span(each.start, each.end)
        for later in range(n + 1, len(accesses)):
            other = accesses[later]
            if other.asked_ns > each.until:
                break
            if (each.write or other.write) and each.meets(other):
                unknown |= span(max(each.start, other.start), min(each.end, other.end))
    for each in sorted(accesses, key=lambda each: each.until):
        image.put(each)
    image.forget(unknown)


def _explains(at: int, value: int, others: Sequence[ItemAccess], before: Mapping[int, int]) -> bool:
    """Whether a byte was written, and its value is known from more than the read itself."""
    there = [each for each in others if each.start <= at < each.end]
    if not any(each.write for each in there):
        return False
    return before.get(at) == value or any(
        not each.known or each.data[at - each.start] == value for each in there
    )


def _share(one: ItemAccess, other: ItemAccess) -> bool:
    """Whether both have bytes in common."""
    return one.start < other.end and other.start < one.end


def _between(write: ItemAccess, parts: Sequence[ItemAccess]) -> bool:
    """Whether a write of any of the bytes was under way while they were read."""
    begin = min(each.asked_ns for each in parts)
    end = max(each.until for each in parts)
    if write.asked_ns > end or write.until < begin:
        return False
    return any(_share(write, each) for each in parts)
