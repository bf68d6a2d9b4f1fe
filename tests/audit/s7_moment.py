"""Was there a moment at which a memory held what was read? All orders are tried, one after the other.

Knows nothing of how the analyzer decides that (docs/s7.md 6 has the question).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

ANY = None
"""The value of a byte that may have any."""


@dataclass(frozen=True)
class Happened:
    """Something that gives bytes their values at one moment between two times."""

    first: int
    last: int | None
    """None where it may still come."""
    bytes: Mapping[int, int | None]
    write: bool = True
    maybe: bool = False
    """Whether it may not have happened at all."""


def was_there(
    read: Mapping[int, int],
    begin: int,
    end: int,
    happened: Sequence[Happened],
    before: Mapping[int, int],
) -> bool:
    """Whether the memory may have held all that was read, at a moment between two times."""
    parts = [part for each in happened for part in _parts(each, happened)]
    sure = [each for each in parts if not each.maybe]
    maybe = [each for each in parts if each.maybe]
    return any(
        _in_an_order([*sure, *some], read, begin, end, before)
        for count in range(len(maybe) + 1)
        for some in combinations(maybe, count)
    )


def _parts(each: Happened, happened: Sequence[Happened]) -> Iterator[Happened]:
    """A write stays whole if no other one that has bytes of it was under way at the same time."""
    others = [other for other in happened if other is not each and other.write]
    if each.write and not any(
        each.bytes.keys() & other.bytes.keys()
        and (other.last is None or each.first <= other.last)
        and (each.last is None or other.first <= each.last)
        for other in others
    ):
        yield each
        return
    for at, value in each.bytes.items():
        yield Happened(each.first, each.last, {at: value}, each.write, each.maybe)


def _in_an_order(
    parts: list[Happened], read: Mapping[int, int], begin: int, end: int, before: Mapping[int, int]
) -> bool:
    look = Happened(begin, end, {})
    return any(
        _fits(order) and _seen(order, look, read, before) for order in permutations([*parts, look])
    )


def _fits(order: Sequence[Happened]) -> bool:
    """Whether times can be given to things in this order, each between its two."""
    now = order[0].first
    for each in order:
        now = max(now, each.first)
        if each.last is not None and now > each.last:
            return False
    return True


def _seen(
    order: Sequence[Happened], look: Happened, read: Mapping[int, int], before: Mapping[int, int]
) -> bool:
    memory: dict[int, int | None] = dict(before)
    for each in order:
        if each is look:
            return all(memory.get(at, ANY) in (ANY, value) for at, value in read.items())
        memory.update(each.bytes)
    return False
