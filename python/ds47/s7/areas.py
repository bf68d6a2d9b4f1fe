"""What jobs read and write: bytes of memories, and areas that are split over jobs (docs/s7.md 6).

What happened to these bytes is known by `memory`; whether a split area is whole is decided in `consistency`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, NamedTuple

from ds47.s7 import model
from ds47.s7.addresses import text
from ds47.s7.consistency import ItemAccess
from ds47.spec import s7

BITS = 0x83
INSTANCE = 0x85
TOO_LONG = 0x8500
"""Error class and code of a job whose PDU, or that of its answer, is too long."""
MEMORIES = (BITS, model.DB, INSTANCE)
"""Areas that keep what is written; the process image and the peripherals do not."""
MOST = 1 << 16
"""Bytes of a memory: addresses behind it are looked at no more."""
FULL = 90
"""Percent of the room of its PDU from which a job is a part of a larger area."""
WIDEST = 8
"""Bytes of the longest elementary data type: a longer piece is no single variable."""
EVEN = 3
"""Jobs of one length behind each other, the last one perhaps shorter, from which they are parts of one."""


def byte_text(area: int, db: int, at: int) -> str:
    """One byte as text: DB1.DBB7."""
    return text(model.S7Address(area, db, 8 * at, 8, 1))


def joined(addresses: Sequence[model.S7Address]) -> model.S7Address:
    """One address for consecutive areas, each beginning where the previous one ends."""
    first = addresses[0]
    if first.area in model.ELEMENTS:
        return model.S7Address(
            first.area, first.db, first.start, first.size, sum(a.count for a in addresses)
        )
    return model.S7Address(
        first.area, first.db, first.start, 8, sum(each.length for each in addresses)
    )


# Accesses


def numbered(area: int) -> int:
    """Instance data blocks are data blocks."""
    return model.DB if area == INSTANCE else area


def is_clear(job: model.S7Job) -> bool:
    """Whether it is known which bytes a PUT writes."""
    return all(
        each.address is not None and each.address.size > 0
        and (each.value is not None or each.address.area not in MEMORIES)
        for each in job.items
    )  # fmt: skip


def accesses(job: model.S7Job, first: int) -> list[ItemAccess]:
    """What a GET or PUT with a request does to memories that keep what is written.

    Args:
        job: with its answer, or still without one.
        first: the number of the first access.
    """
    found: list[ItemAccess] = []
    for number, item in enumerate(job.items, first):
        address = item.address
        if address is not None and address.area in MEMORIES and address.size:
            access = _access(job, item, address, number)
            if access is not None:
                found.append(access)
    return found


def _access(
    job: model.S7Job, item: model.S7Item, address: model.S7Address, number: int
) -> ItemAccess | None:
    write, done = job.operation == model.PUT, item.code == model.DONE and job.answered is not None
    whole = address.size >= 8 and address.start % 8 == 0
    if job.asked is None or item.value is None or not (write or (done and whole)):
        return None
    start, end = address.start // 8, (address.end + 7) // 8
    data = item.value
    if end > MOST:
        return None
    if not whole or len(data) != end - start:
        if not write:
            return None
        data, whole = bytes(end - start), False
    answer = job.answered
    return ItemAccess(
        number, job.connection.number, write, numbered(address.area), address.db, start, data,
        job.asked.time_ns, answer.time_ns if answer else None, job.asked.frame,
        answer.frame if answer else None, done, whole,
    )  # fmt: skip


# Areas that are split


class AreaPart(NamedTuple):
    """A job that is a part of a larger area."""

    job: model.S7Job
    first: int
    """The number of its first access."""


@dataclass(slots=True, eq=False)
class SplitArea:
    """An area that was read or written by several jobs, one after the other."""

    parts: list[AreaPart]

    @property
    def address(self) -> model.S7Address:
        """All of it."""
        return joined([each for part in self.parts if (each := self._item(part).address)])

    def accesses(self) -> list[ItemAccess]:
        """What its parts do to a memory; not of each there is one."""
        found = []
        for part in self.parts:
            item = self._item(part)
            number = part.first + part.job.items.index(item)
            found += [each for each in accesses(part.job, part.first) if each.order == number]
        return found

    def _item(self, part: AreaPart) -> model.S7Item:
        """The item of a part that belongs to the area: the one at its border."""
        return part.job.items[-1 if part is self.parts[0] else 0]


class Splits:
    """Finds areas that one side of a connection splits over jobs.

    Args:
        most_ns: from the answer of a part to the request of the next at the most.
        most: parts of an area at the most.
    """

    def __init__(self, most_ns: int, most: int) -> None:
        self._most_ns, self._most = most_ns, most
        self._parts: list[AreaPart] = []
        self._halves = False
        """Whether these are two halves, both asked for before one was there."""

    def asked(self, part: AreaPart) -> SplitArea | None:
        """A GET or PUT was asked for; gives the area that is complete by that."""
        before = self._parts
        if before and len(before) < self._most and self._continues(part.job):
            before.append(part)
            return None
        if len(before) == 1 and _are_halves(before[0].job, part.job):
            self._parts, self._halves = sorted((*before, part), key=_start), True
            return None
        found = self.finish()
        self._parts = [part]
        return found

    def over(self, job: model.S7Job) -> SplitArea | None:
        """A job is over; returns its area if it is the last part, as it does not fill its PDU."""
        parts = self._parts
        if not any(each.job is job for each in parts):
            return None
        if self._halves:
            return None if any(each.job.phase == "open" for each in parts) else self.finish()
        if parts[-1].job is not job or (job.state == model.OK and (fills(job) or _are_even(parts))):
            return None
        return self.finish()

    def finish(self) -> SplitArea | None:
        """Nothing more comes."""
        parts, self._parts = self._parts, []
        halves, self._halves = self._halves, False
        if len(parts) < 2 or any(each.job.state != model.OK for each in parts):
            return None
        full = all(fills(each.job) for each in parts[:-1])
        return SplitArea(parts) if halves or full or len(parts) >= EVEN else None

    def _continues(self, job: model.S7Job) -> bool:
        """Whether a job begins where the one before ends, and that one filled its PDU, or all have one length."""
        last = self._parts[-1].job
        if self._halves or job.operation != last.operation or not job.items or not last.items:
            return False
        before, behind = last.items[-1].address, job.items[0].address
        if before is None or behind is None or before.end != behind.start:
            return False
        even = behind.length <= before.length and len(job.items) == 1 and _are_even(self._parts)
        if not (fills(last) or (even and last.answered is not None)):
            return False
        unsettled = last.state in (model.UNANSWERED, model.INCOMPLETE) and last.phase == "open"
        if last.state != model.OK and not unsettled:
            return False
        if len(self._parts) > 1 and len(last.items) > 1:
            return False
        since = last.answered or last.asked
        if since is None or job.asked is None or job.asked.time_ns - since.time_ns > self._most_ns:
            return False
        if not before.size:
            return False
        if behind.area not in model.ELEMENTS and behind.end > 8 * MOST:
            return False
        return before.area == behind.area and before.db == behind.db


def _are_even(parts: Sequence[AreaPart]) -> bool:
    """Whether all parts have one item of one length, which is no single variable."""
    lengths = {
        each.address.length if each.address is not None else 0
        for part in parts for each in part.job.items
    }  # fmt: skip
    single = all(len(part.job.items) == 1 for part in parts)
    return single and len(lengths) == 1 and min(lengths) > WIDEST


def _start(part: AreaPart) -> int:
    address = part.job.items[0].address
    return 0 if address is None else address.start


def _are_halves(one: model.S7Job, two: model.S7Job) -> bool:
    """Whether two jobs, the first of them still open, are for two halves of an area: equal but for one byte."""
    if one.phase != "open" or one.operation != two.operation:
        return False
    if len(one.items) != 1 or len(two.items) != 1:
        return False
    a, b = one.items[0].address, two.items[0].address
    if a is None or b is None or (a.area, a.db) != (b.area, b.db) or a.area in model.ELEMENTS:
        return False
    if min(a.length, b.length) <= WIDEST:
        return False
    return abs(a.length - b.length) <= 1 and (a.end == b.start or b.end == a.start)


def fills(job: model.S7Job) -> bool:
    """Whether a job has so much data that its PDU has no room for more; never without the setup."""
    length, items, size = job.connection.pdu_length, job.items, 0
    if length is None or job.operation not in (model.GET, model.PUT) or not items:
        return False
    for each in items:
        if each.address is not None:
            size += each.address.length
    room = s7.room(job.operation, length, len(items))
    return room > 0 and 100 * size >= FULL * room


def too_long(job: model.S7Job) -> dict[str, Any]:
    """Why a job, or its answer, has no room in a PDU, and what of it has (docs/s7.md 3).

    Returns:
        Nothing where it has room, nobody knows the lengths, or it was refused for something else. Else `sum`: what
        it is, a key of diagnoses.toml;
        `needs`: the bytes of that PDU; `agreed`: how many it may have; `room`: of one item the bytes that fit, of
        several how many of the first ones do; `jobs`: in how many jobs that is done.
    """
    agreed, sizes = (
        job.connection.pdu_length,
        [each.address.length for each in job.items if each.address],
    )
    if job.error != TOO_LONG or agreed is None or len(sizes) < max(1, len(job.items)):
        return {}
    filled = [size + size % 2 for size in sizes]
    needs = [
        agreed - s7.room(job.operation, agreed, count) + before + size
        for count, (before, size) in enumerate(
            zip([0, *accumulate(filled)], sizes, strict=False), 1
        )
    ]
    one = s7.room(job.operation, agreed)  # bytes of a single item
    if needs[-1] <= agreed or one <= 0:
        return {}
    args = {"needs": needs[-1], "agreed": agreed}
    if len(sizes) == 1:
        return args | {"sum": f"{job.operation}_bytes", "room": one, "jobs": -(-sizes[0] // one)}
    return args | {"sum": f"{job.operation}_items", "room": sum(each <= agreed for each in needs)}
