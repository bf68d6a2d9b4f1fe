"""What the drives do otherwise in the second of two captures, the worst first.

The facts of a `Difference` put together by drive object: what fails now, faults, what became slower, other
values. What differs at all is decided in `ds47.regression.difference`, and worded in `difference_report`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

from ds47 import spec
from ds47.regression import difference
from ds47.regression.elements import VALUE
from ds47.regression.places import Place

KINDS: Final = {
    "change-fails": ("bad", "diff_change_fails"),
    "read-fails": ("bad", "diff_read_fails"),  # brought a value in A
    "faults": ("bad", "diff_faults"),  # the status word says one more often
    "more-fail": ("bad", "diff_more_fail"),  # than chance explains
    "slower": ("warn", "diff_is_slower"),
    "values": ("warn", "diff_other_values"),  # the last ones that were read
    "last-values": ("warn", "diff_other_last"),  # read or written, where only these are compared
    "written": ("none", "diff_other_written"),  # what the controllers do, not the drive
    "errors": ("warn", "diff_other_errors"),  # the same request fails in both, with other errors
    "change-works": ("good", "diff_change_works"),
    "read-works": ("good", "diff_read_works"),
    "fewer-faults": ("good", "diff_faults"),
    "fewer-fail": ("good", "diff_fewer_fail"),
    "quicker": ("good", "diff_is_quicker"),
    "changing": ("none", "diff_changing"),  # values that the drive changes by itself
}
"""The kinds of conclusions, the worst first: the level of each, and what it says."""
_RANKS: Final = {kind: rank for rank, kind in enumerate(KINDS)}


class Conclusion(NamedTuple):
    """One thing that is otherwise in B.

    `place` is the drive object, or the device alone. It is about `rows` (all reads or all changes),
    about `faults` or about a `latency`.
    """

    kind: str
    place: Place
    rows: tuple[difference.ElementDifference, ...] = ()
    faults: difference.Faults | None = None
    latency: difference.LatencyDifference | None = None

    @property
    def level(self) -> str:
        """How bad it is: "bad", "warn", "good", or "none" where it says nothing about the drive."""
        return KINDS[self.kind][0]


def conclusions(found: difference.Difference) -> list[Conclusion]:
    """What is otherwise, the worst first; of one kind what concerns more elements first."""
    all_ = [*_of_rows(found), *_of_faults(found), *_of_latencies(found)]
    return sorted(all_, key=lambda each: (_RANKS[each.kind], -len(each.rows), each.place.sort_key))


def _of_rows(found: difference.Difference) -> Iterator[Conclusion]:
    together: dict[tuple[str, Place, str], list[difference.ElementDifference]] = {}
    for row in found.of(difference.DIFFERENT):
        together.setdefault((kind_of(row), row.element.place, row.operation), []).append(row)
    for (kind, place, _), rows in together.items():
        yield Conclusion(kind, place, tuple(rows))


def _of_faults(found: difference.Difference) -> Iterator[Conclusion]:
    for each in found.faults:
        if each.a != each.b:
            kind = "faults" if each.b > each.a else "fewer-faults"
            yield Conclusion(kind, Place(each.device), faults=each)


def _of_latencies(found: difference.Difference) -> Iterator[Conclusion]:
    for each in found.latencies:
        if each.significant:
            yield Conclusion(
                "slower" if each.is_slower else "quicker", Place(each.device), latency=each
            )


def kind_of(row: difference.ElementDifference) -> str:
    """The kind of a row that is different: that of the worst that any of its requests shows."""
    assert row.a is not None
    assert row.b is not None
    kinds = {
        _of_pair(pair, row.operation)
        for pair in difference.shared_requests(row.a, row.b)
        if difference.turned(pair)
    }
    if not difference.equal_last(row.a, row.b):
        kinds.add(_of_values(row))
    return min(kinds, key=_RANKS.__getitem__)


def _of_pair(pair: difference.Pair, operation: str) -> str:
    """The kind of a request with a changed outcome."""
    one, other = pair
    if one[VALUE] and other[VALUE]:
        assert difference.fails_otherwise(pair)
        worse = other[VALUE] * one.total() < one[VALUE] * other.total()
        return "more-fail" if worse else "fewer-fail"
    if one[VALUE]:
        return "read-fails" if operation == "read" else "change-fails"
    if other[VALUE]:
        return "read-works" if operation == "read" else "change-works"
    return "errors"


def _of_values(row: difference.ElementDifference) -> str:
    if row.operation == "change":
        return "written"
    if spec.is_changing(row.element.pnu, row.name):
        return "changing"
    return "last-values" if row.operation == difference.LAST else "values"


def failures(row: difference.ElementDifference, kind: str) -> list[object]:
    """The errors of the requests that a conclusion of this kind is about: in A where they work in B, else in B.

    Error numbers first, then the STATUS words of record calls, then None for a negative response without a number.
    """
    side = 0 if kind in ("read-works", "change-works") else 1
    found = {each for pair in _turned(row, kind) for each in pair[side]} - {VALUE}
    return sorted(found, key=lambda each: (each is None, isinstance(each, str), each))


def shares(row: difference.ElementDifference) -> tuple[tuple[int, int], ...]:
    """Of the requests that fail more often in one capture: failures and requests, in A and in B."""
    pairs = [*_turned(row, "more-fail"), *_turned(row, "fewer-fail")]
    sides = zip(*pairs, strict=True)
    return tuple(
        (sum(each.total() - each[VALUE] for each in side), sum(each.total() for each in side))
        for side in sides
    )


def _turned(row: difference.ElementDifference, kind: str) -> list[difference.Pair]:
    """The requests of a row that are of this kind."""
    assert row.a is not None
    assert row.b is not None
    pairs = difference.shared_requests(row.a, row.b)
    return [
        pair for pair in pairs if difference.turned(pair) and _of_pair(pair, row.operation) == kind
    ]
