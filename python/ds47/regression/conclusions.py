"""What the drives do otherwise in the second of two captures, the worst first.

The facts of a `Difference` put together by drive object: what fails now, faults, what became slower, other
values. What differs at all is decided in `ds47.regression.difference`, and worded in `difference_report`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from ds47 import spec
from ds47.regression.difference import (
    DIFFERENT,
    LAST,
    Difference,
    ElementDifference,
    Faults,
    LatencyDifference,
    Pair,
    equal_last,
    fails_otherwise,
    shared_requests,
    turned,
)
from ds47.regression.elements import VALUE
from ds47.regression.places import Place

CHANGE_FAILS: Final = "change-fails"
READ_FAILS: Final = "read-fails"
"""A read that brought a value in A fails in B; the same of a change that was accepted."""
FAULTS: Final = "faults"
"""The status word says a fault more often."""
MORE_FAIL: Final = "more-fail"
"""The same request fails more often than chance explains."""
SLOWER: Final = "slower"
VALUES: Final = "values"
"""The last values that were read differ."""
WRITTEN: Final = "written"
"""The last accepted values differ: what the controllers do, not the drive."""
LAST_VALUES: Final = "last-values"
"""The last values differ, read or written, where only these are compared."""
ERRORS: Final = "errors"
"""The same request fails in both, with other errors."""
CHANGE_WORKS: Final = "change-works"
READ_WORKS: Final = "read-works"
FEWER_FAULTS: Final = "fewer-faults"
FEWER_FAIL: Final = "fewer-fail"
QUICKER: Final = "quicker"
CHANGING: Final = "changing"
"""Other values of parameters that the drive changes by itself."""

KINDS: Final = (
    CHANGE_FAILS, READ_FAILS, FAULTS, MORE_FAIL, SLOWER, VALUES, LAST_VALUES, WRITTEN, ERRORS,
    CHANGE_WORKS, READ_WORKS, FEWER_FAULTS, FEWER_FAIL, QUICKER, CHANGING,
)  # fmt: skip
"""The worst first, and last what is no change of anything."""
_BAD: Final = frozenset({CHANGE_FAILS, READ_FAILS, FAULTS, MORE_FAIL})
_GOOD: Final = frozenset({CHANGE_WORKS, READ_WORKS, FEWER_FAULTS, FEWER_FAIL, QUICKER})
_NEITHER: Final = frozenset({CHANGING, WRITTEN})


class Conclusion(NamedTuple):
    """One thing that is otherwise in B.

    `place` is the drive object, or the device alone. It is about `rows` (all reads or all changes),
    about `faults` or about a `latency`.
    """

    kind: str
    place: Place
    rows: tuple[ElementDifference, ...] = ()
    faults: Faults | None = None
    latency: LatencyDifference | None = None

    @property
    def level(self) -> str:
        """How bad it is: "bad", "warn", "good", or "none" where it says nothing about the drive."""
        if self.kind in _NEITHER:
            return "none"
        return "bad" if self.kind in _BAD else "good" if self.kind in _GOOD else "warn"


def conclusions(found: Difference) -> list[Conclusion]:
    """What is otherwise, the worst first; of one kind what concerns more elements first."""
    all_ = [*_of_rows(found), *_of_faults(found), *_of_latencies(found)]
    return sorted(
        all_, key=lambda each: (KINDS.index(each.kind), -len(each.rows), each.place.sort_key)
    )


def _of_rows(found: Difference) -> Iterator[Conclusion]:
    together: dict[tuple[str, Place, str], list[ElementDifference]] = {}
    for row in found.of(DIFFERENT):
        together.setdefault((kind_of(row), row.element.place, row.operation), []).append(row)
    for (kind, place, _), rows in together.items():
        yield Conclusion(kind, place, tuple(rows))


def _of_faults(found: Difference) -> Iterator[Conclusion]:
    for each in found.faults:
        if each.a != each.b:
            kind = FAULTS if each.b > each.a else FEWER_FAULTS
            yield Conclusion(kind, Place(each.device), faults=each)


def _of_latencies(found: Difference) -> Iterator[Conclusion]:
    for each in found.latencies:
        if each.significant:
            yield Conclusion(
                SLOWER if each.is_slower else QUICKER, Place(each.device), latency=each
            )


def kind_of(row: ElementDifference) -> str:
    """The kind of a row that is different: that of the worst that any of its requests shows."""
    assert row.a is not None
    assert row.b is not None
    kinds = {
        _of_pair(pair, row.operation) for pair in shared_requests(row.a, row.b) if turned(pair)
    }
    if not equal_last(row.a, row.b):
        kinds.add(_of_values(row))
    return min(kinds, key=KINDS.index)


def _of_pair(pair: Pair, operation: str) -> str:
    """The kind of a request with a changed outcome."""
    one, other = pair
    if one[VALUE] and other[VALUE]:
        assert fails_otherwise(pair)
        worse = other[VALUE] * one.total() < one[VALUE] * other.total()
        return MORE_FAIL if worse else FEWER_FAIL
    if one[VALUE]:
        return READ_FAILS if operation == "read" else CHANGE_FAILS
    if other[VALUE]:
        return READ_WORKS if operation == "read" else CHANGE_WORKS
    return ERRORS


def _of_values(row: ElementDifference) -> str:
    if row.operation == "change":
        return WRITTEN
    if spec.is_changing(row.element.pnu, row.name):
        return CHANGING
    return LAST_VALUES if row.operation == LAST else VALUES


def failures(row: ElementDifference, kind: str) -> list[object]:
    """The errors of the requests that a conclusion of this kind is about: in A where they work in B, else in B.

    Error numbers first, then the STATUS words of record calls, then None for a negative response without a number.
    """
    side = 0 if kind in (READ_WORKS, CHANGE_WORKS) else 1
    found = {each for pair in _turned(row, kind) for each in pair[side]} - {VALUE}
    return sorted(found, key=lambda each: (each is None, isinstance(each, str), each))


def shares(row: ElementDifference) -> tuple[tuple[int, int], ...]:
    """Of the requests that fail more often in one capture: failures and requests, in A and in B."""
    pairs = [*_turned(row, MORE_FAIL), *_turned(row, FEWER_FAIL)]
    sides = zip(*pairs, strict=True)
    return tuple(
        (sum(each.total() - each[VALUE] for each in side), sum(each.total() for each in side))
        for side in sides
    )


def _turned(row: ElementDifference, kind: str) -> list[Pair]:
    """The requests of a row that are of this kind."""
    assert row.a is not None
    assert row.b is not None
    pairs = shared_requests(row.a, row.b)
    return [pair for pair in pairs if turned(pair) and _of_pair(pair, row.operation) == kind]
