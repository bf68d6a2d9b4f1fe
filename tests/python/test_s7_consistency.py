"""What was read, and when it was in the memory: the decision against all orders, and the cases of docs/s7.md 6."""

from __future__ import annotations

import itertools
from time import monotonic
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.audit.s7_moment import Happened, was_there

from ds47.s7.consistency import ItemAccess, Question

DB1 = (0x84, 1)


def access(
    write: bool, start: int, data: bytes | list[int], asked: int, answered: int | None, **more: Any
) -> ItemAccess:
    access.count += 1  # type: ignore[attr-defined]
    number: int = access.count  # type: ignore[attr-defined]
    more = {"sure": answered is not None} | more
    return ItemAccess(
        number, number, write, *DB1, start, bytes(data), asked, answered, number, number, **more
    )


access.count = 0  # type: ignore[attr-defined]


def put(
    start: int, data: bytes | list[int], asked: int, answered: int | None, **more: Any
) -> ItemAccess:
    return access(True, start, data, asked, answered, **more)


def get(start: int, data: bytes | list[int], asked: int, answered: int) -> ItemAccess:
    return access(False, start, data, asked, answered)


def naive(read: list[ItemAccess], others: list[ItemAccess], before: dict[int, int]) -> bool:
    """The same question in the words of the auditor."""
    happened = [
        Happened(
            each.asked_ns, each.answered_ns,
            {at: byte if each.known else None for at, byte in enumerate(each.data, each.start)},
            each.write, not each.sure,
        )
        for each in others
    ]  # fmt: skip
    values = {at: byte for each in read for at, byte in enumerate(each.data, each.start)}
    begin = min(each.asked_ns for each in read)
    end = max(each.answered_ns or 0 for each in read)
    return was_there(values, begin, end, happened, before)


def held(read: list[ItemAccess], others: list[ItemAccess], before: dict[int, int]) -> bool:
    question = Question(read, others, before)
    return question.held(question.all)


# Against all orders


TIMES = st.integers(0, 9)
BYTES = st.integers(0, 2)


@st.composite
def accesses(draw: st.DrawFn, write: bool, length: int = 3) -> ItemAccess:
    start = draw(st.integers(0, length - 1))
    data = draw(st.lists(BYTES, min_size=1, max_size=length - start))
    asked = draw(TIMES)
    answered = (
        draw(st.one_of(st.none(), st.integers(asked, 10)))
        if write
        else draw(st.integers(asked, 10))
    )
    sure = answered is not None and (not write or draw(st.integers(0, 4)) > 0)
    known = not write or draw(st.integers(0, 5)) > 0
    return access(write, start, data, asked, answered, sure=sure, known=known)


@st.composite
def parts(draw: st.DrawFn) -> list[ItemAccess]:
    """A read of three bytes in one, two or three jobs, one after the other or not."""
    data = draw(st.lists(BYTES, min_size=3, max_size=3))
    cuts = draw(st.sampled_from([[0, 3], [0, 1, 3], [0, 2, 3], [0, 1, 2, 3]]))
    found = []
    for first, end in itertools.pairwise(cuts):
        asked = draw(TIMES)
        found.append(get(first, data[first:end], asked, draw(st.integers(asked, 10))))
    return found


@pytest.mark.slow
@settings(max_examples=600, deadline=None)
@given(
    parts(),
    st.lists(accesses(True), max_size=4),
    st.lists(accesses(False, 2), max_size=1),
    st.dictionaries(st.integers(0, 2), BYTES),
)
def test_all_orders_say_the_same(
    read: list[ItemAccess],
    writes: list[ItemAccess],
    reads: list[ItemAccess],
    before: dict[int, int],
) -> None:
    others = [*writes, *reads]
    pieces = sum(len(each.data) for each in others)
    if pieces > 6:
        others = others[:2]
    assert held(read, others, before) is naive(read, others, before)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(parts(), st.lists(accesses(True), max_size=3), st.dictionaries(st.integers(0, 2), BYTES))
def test_two_bytes_are_enough_to_tell(
    read: list[ItemAccess], writes: list[ItemAccess], before: dict[int, int]
) -> None:
    """What is named is true by itself, and nothing is named where all may have been there."""
    alone = Question(read, writes, before)
    ignore = sum(1 << at for at in range(3) if not alone.byte(at))
    two = Question(read, writes, before, ignore).mixed()
    if two is None:
        return
    assert not held(read, writes, before)
    values = {at: byte for each in read for at, byte in enumerate(each.data, each.start)}
    begin, end = min(e.asked_ns for e in read), max(e.answered_ns or 0 for e in read)
    happened = [
        Happened(
            e.asked_ns, e.answered_ns,
            {at: byte if e.known else None for at, byte in enumerate(e.data, e.start)}, True, not e.sure,
        )
        for e in writes
    ]  # fmt: skip
    only = {at: values[at] for at in two}
    assert not was_there(only, begin, end, happened, before)
    for at in two:
        assert was_there({at: values[at]}, begin, end, happened, before)


@pytest.mark.parametrize("ignored", [0, 1 << 5])
def test_bytes_that_are_ignored_prove_nothing(ignored: int) -> None:
    read = [get(0, [1] * 5, 0, 1), get(5, [2] * 5, 10, 11)]
    writes = [put(0, [2] * 6, 4, 5)]
    two = Question(read, writes, {5: 1}, ignored).mixed()
    assert (two is None) is bool(ignored)
    assert two in (None, (4, 5))


def test_what_would_take_too_long_counts_as_whole() -> None:
    """Two hundred writes at once, each of all bytes, and none of them as read."""
    length = 2_000
    read = [get(0, [1] * length, 0, 1_000), get(length, [2] * length, 2_000, 3_000)]
    writes = [put(0, [n % 50 + 3] * 2 * length, n, 2_500 + n) for n in range(200)]
    began = monotonic()
    question = Question(read, writes, {})
    assert question.mixed() is None
    assert monotonic() - began < 5
