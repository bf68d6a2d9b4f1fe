"""What jobs read and write: bytes of memories, and areas that are split over jobs (docs/s7.md 6).

What happened to these bytes is known by `memory`; whether a split area is whole is decided in `consistency`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ds47.s7.addresses import text
from ds47.s7.consistency import Access
from ds47.s7.model import (
    DB,
    DONE,
    ELEMENTS,
    GET,
    INCOMPLETE,
    OK,
    PUT,
    UNANSWERED,
    Address,
    Item,
    Job,
)
from ds47.spec import s7

BITS = 0x83
INSTANCE = 0x85
MEMORIES = (BITS, DB, INSTANCE)
"""Areas that keep what is written; the process image and the peripherals do not."""
MOST = 1 << 16
"""Bytes of a memory: addresses behind it are looked at no more."""
FULL = 90
"""Percent of the room of its PDU from which a job is a part of a larger area."""


def byte_text(area: int, db: int, at: int) -> str:
    """One byte as text: DB1.DBB7."""
    return text(Address(area, db, 8 * at, 8, 1))


def joined(addresses: Sequence[Address]) -> Address:
    """One address for areas of which each begins where the one before ends."""
    first = addresses[0]
    if first.area in ELEMENTS:
        return Address(
            first.area, first.db, first.start, first.size, sum(a.count for a in addresses)
        )
    return Address(first.area, first.db, first.start, 8, sum(each.length for each in addresses))


# Accesses


def numbered(area: int) -> int:
    """Instance data blocks are data blocks."""
    return DB if area == INSTANCE else area


def is_clear(job: Job) -> bool:
    """Whether it is known which bytes a PUT writes."""
    return all(
        each.address is not None and each.address.size > 0
        and (each.value is not None or each.address.area not in MEMORIES)
        for each in job.items
    )  # fmt: skip


def accesses(job: Job, first: int) -> list[Access]:
    """What a GET or PUT with a request does to memories that keep what is written.

    Args:
        job: with its answer, or still without one.
        first: the number of the first access.
    """
    found: list[Access] = []
    for number, item in enumerate(job.items, first):
        address = item.address
        if address is not None and address.area in MEMORIES and address.size:
            access = _access(job, item, address, number)
            if access is not None:
                found.append(access)
    return found


def _access(job: Job, item: Item, address: Address, number: int) -> Access | None:
    write, done = job.operation == PUT, item.code == DONE and job.answered is not None
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
    return Access(
        number, job.connection.number, write, numbered(address.area), address.db, start, data,
        job.asked.time_ns, answer.time_ns if answer else None, job.asked.frame,
        answer.frame if answer else None, done, whole,
    )  # fmt: skip


# Areas that are split


class Part(NamedTuple):
    """A job that is a part of a larger area."""

    job: Job
    first: int
    """The number of its first access."""


@dataclass(slots=True, eq=False)
class Whole:
    """An area that was read or written by several jobs, one after the other."""

    parts: list[Part]

    @property
    def address(self) -> Address:
        """All of it."""
        return joined([each for part in self.parts if (each := self._item(part).address)])

    def accesses(self) -> list[Access]:
        """What its parts do to a memory; not of each there is one."""
        found = []
        for part in self.parts:
            item = self._item(part)
            number = part.first + part.job.items.index(item)
            found += [each for each in accesses(part.job, part.first) if each.order == number]
        return found

    def _item(self, part: Part) -> Item:
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
        self._parts: list[Part] = []

    def asked(self, part: Part) -> Whole | None:
        """A GET or PUT was asked for; gives the area that is complete by that."""
        before = self._parts
        if before and len(before) < self._most and self._continues(part.job):
            before.append(part)
            return None
        self._parts = [part]
        return _whole(before)

    def over(self, job: Job) -> Whole | None:
        """A job is over; gives the area of which it is the last part, as it does not fill its PDU."""
        if not self._parts or self._parts[-1].job is not job or (job.state == OK and fills(job)):
            return None
        return self.finish()

    def finish(self) -> Whole | None:
        """Nothing more comes."""
        parts, self._parts = self._parts, []
        return _whole(parts)

    def _continues(self, job: Job) -> bool:
        """Whether a job begins where the one before ends, and that one filled its PDU."""
        last = self._parts[-1].job
        if job.operation != last.operation or not job.items or not last.items:
            return False
        before, behind = last.items[-1].address, job.items[0].address
        if before is None or behind is None or before.end != behind.start or not fills(last):
            return False
        unsettled = last.state in (UNANSWERED, INCOMPLETE) and last.phase == "open"
        if last.state != OK and not unsettled:
            return False
        if len(self._parts) > 1 and len(last.items) > 1:
            return False
        since = last.answered or last.asked
        if since is None or job.asked is None or job.asked.time_ns - since.time_ns > self._most_ns:
            return False
        if not before.size:
            return False
        if behind.area not in ELEMENTS and behind.end > 8 * MOST:
            return False
        return before.area == behind.area and before.db == behind.db


def fills(job: Job) -> bool:
    """Whether a job has so much data that its PDU has no room for more; never without the setup."""
    length, items, size = job.connection.pdu_length, job.items, 0
    if length is None or job.operation not in (GET, PUT) or not items:
        return False
    for each in items:
        if each.address is not None:
            size += each.address.length
    room = s7.room(job.operation, length, len(items))
    return room > 0 and 100 * size >= FULL * room


def _whole(parts: list[Part]) -> Whole | None:
    return Whole(parts) if len(parts) > 1 and all(each.job.state == OK for each in parts) else None
