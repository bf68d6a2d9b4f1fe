"""What a program does again and again (diagnosis/repetition): REQ held (DS723), polling storms (DS724).

The moments are typed by hand; the numbers are those of spec/diagnoses.toml.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate
from typing import Any

import pytest
from talk import job

from ds47.acyclic.pairing import STATUS_NOT_READY, Job
from ds47.diagnosis import repetition
from ds47.diagnosis.repetition import Repetition
from ds47.lab import message
from ds47.profinet.records import Half
from ds47.spec.semantics import known

MS = 1_000_000
HERE, THERE = (0, 1, 1, 47), (0, 2, 1, 47)
PLACE = {"slot": 1, "subslot": 1, "index": 47}
FIXED = message.address(2900)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memories of two entries."""
    facts = known().but(history=2)
    monkeypatch.setattr(repetition, "known", lambda: facts)


def half(time_ns: int, frame: int = 1, data: bytes = b"", status: int | None = None) -> Half:
    return Half(frame, time_ns, data, len(data), status=status)


# REQ held (DS723)


def change(time_ns: int, frame: int, value: float = 10.0, reference: int = 1) -> Job:
    made = job(message.change(reference, 1, (FIXED, message.real(value))))
    assert made.record.request is not None
    made.record.request.time_ns, made.record.request.frame = time_ns, frame
    return made


def held(gaps: Iterable[int], found: Repetition | None = None, **more: Any) -> Repetition:
    """The same change, these nanoseconds apart; the references go on."""
    found = found or Repetition()
    place = more.pop("place", HERE)
    for number, moment in enumerate(accumulate(gaps, initial=5_000 * MS)):
        found.asked(change(moment, 10 + number, reference=number % 255, **more), place)
    return found


def told(found: Repetition) -> list[tuple[str, int, dict[str, Any]]]:
    return [(each.rule, each.frame, each.args) for each in found.finish()]


def periods(found: Repetition) -> list[float]:
    return [args["period"] for _, _, args in told(found)]


def test_the_same_change_five_times_at_one_period_is_told_with_its_place() -> None:
    expected = {"count": 5, "device": "d", "period": 100.0, "place": PLACE}
    assert told(held([100 * MS] * 4)) == [("DS723", 10, expected)]
    assert told(held([100 * MS] * 3)) == []


@pytest.mark.parametrize(
    ("gaps", "period"),
    [
        ([80, 100, 101, 120], 100.0),  # the lower one of two in the middle
        ([96, 98, 101, 103, 105], 101.0),
        ([105, 96, 103, 98, 101], 101.0),
        ([100, 100, 100, 120], 100.0),  # a fifth more or less is the same period
        ([100, 100, 100, 80], 100.0),
        ([100, 100, 100, 121], None),
        ([100, 100, 100, 79], None),
        ([10_000] * 4, 10_000.0),
        ([10_001] * 4, None),  # refreshed on purpose
        ([0] * 4, None),  # sent at once, that is no period
    ],
)
def test_a_period_is_fixed_if_all_are_near_the_middle_one(
    gaps: list[int], period: float | None
) -> None:
    assert periods(held([gap * MS for gap in gaps])) == ([] if period is None else [period])


@pytest.mark.parametrize(
    ("gaps", "period"),
    [
        ([1] * 4, 1 / MS),
        ([10_000 * MS + 1] * 4, None),
        ([100 * MS] * 3 + [120 * MS + 1], None),
        ([100 * MS] * 3 + [80 * MS - 1], None),
    ],
)
def test_periods_are_told_apart_to_the_nanosecond(gaps: list[int], period: float | None) -> None:
    assert periods(held(gaps)) == ([] if period is None else [period])


def test_of_a_long_run_the_first_256_periods_decide() -> None:
    late = [900 * MS]
    assert [args["count"] for _, _, args in told(held([100 * MS] * 256 + late))] == [258]
    assert told(held([100 * MS] * 255 + late + [100 * MS] * 9)) == []


def test_another_change_ends_the_run() -> None:
    found = held([100 * MS] * 5)
    found.asked(change(9_000 * MS, 50, 11.0), HERE)
    held([200 * MS] * 6, found)
    held([100 * MS] * 3, found, value=12.0)
    assert [(frame, args["count"], args["period"]) for _, frame, args in told(found)] == [
        (10, 6, 100.0), (10, 7, 200.0),
    ]  # fmt: skip


def test_what_is_written_elsewhere_does_not_end_the_run() -> None:
    found = Repetition()
    for number in range(5):
        moment = number * 100 * MS
        found.asked(change(moment, 10 + number), HERE)
        found.asked(change(moment + MS, 20 + number, float(number)), THERE)
    assert [(frame, args["place"]["slot"]) for _, frame, args in told(found)] == [(10, 1)]


def test_a_channel_that_is_forgotten_is_told_before(small: None) -> None:
    """Of three channels, two are remembered; the oldest goes on after that as a new one."""
    found = held([100 * MS] * 4)
    for slot in (2, 3):
        held([100 * MS] * 3, found, place=(0, slot, 1, 47))
    held([100 * MS] * 3, found)
    assert [args["place"]["slot"] for _, _, args in told(found)] == [1]


def test_as_many_channels_as_there_is_room_for_are_remembered(small: None) -> None:
    found = held([100 * MS] * 3)
    held([100 * MS] * 3, found, place=THERE)
    found.asked(change(5_400 * MS, 30), HERE)
    assert [args["count"] for _, _, args in told(found)] == [5]


def test_no_more_is_told_than_there_is_room_for(small: None) -> None:
    found = Repetition()
    for slot in range(1, 5):
        held([100 * MS] * 4, found, place=(0, slot, 1, 47))
    assert [args["place"]["slot"] for _, _, args in told(found)] == [1, 2]


# Polling storms (DS724)

READ, ANSWER = message.read(1, 1, FIXED), message.answer(1, 1, 1, message.real(10.0))


def polled(
    count: int, *, asked: int | None = 0, first: int = 10, gap: int = 2, answered: bool = True,
    requests: bool = True,
) -> Job:  # fmt: skip
    """Asked, polled so often from `first` on (ms), and then answered after one gap more; each frame is its ms."""

    def reads(number: int) -> tuple[Half | None, Half]:
        moment = first + gap * number
        response = half(moment * MS + MS, moment + 1, status=STATUS_NOT_READY)
        return half(moment * MS, moment) if requests else None, response

    made = job(None if asked is None else READ)
    if made.record.request is not None and asked is not None:
        made.record.request.time_ns = asked * MS
    made.polls = [reads(number) for number in range(count)]
    if answered:
        made.read_request, made.read_response = reads(count)
    return made


def storm(*cases: Job) -> list[tuple[str, int, dict[str, Any]]]:
    found = Repetition()
    for case in cases:
        found.closed(case, HERE)
    return told(found)


def test_three_transactions_in_a_row_of_ten_polls_are_a_storm() -> None:
    cases = [polled(10, asked=number * 100, first=10 + number * 100) for number in range(3)]
    expected = {"count": 30, "device": "d", "period": 2.0, "time": 31.0}
    assert storm(*cases) == [("DS724", 10, expected)]
    assert storm(*cases[:2]) == []
    assert storm(*cases[:2], polled(9), cases[2]) == []
    assert storm(*cases, polled(9)) == [("DS724", 10, expected)]


def test_one_transaction_of_a_hundred_polls_is_a_storm() -> None:
    expected = {"count": 100, "device": "d", "period": 2.0, "time": 211.0}
    assert storm(polled(100)) == [("DS724", 10, expected)]
    assert storm(polled(99)) == []
    assert storm(polled(100), polled(10))[0][2]["count"] == 110


@pytest.mark.parametrize(
    ("case", "frame", "time"),
    [
        (polled(100, answered=False), 10, 209.0),  # up to the last poll
        (polled(100, requests=False), 11, 211.0),
        (
            polled(100, asked=None),
            10,
            201.0,
        ),  # from the first poll, if its request was not captured
        (polled(100, asked=None, requests=False), 11, 200.0),
    ],
)
def test_the_time_goes_from_the_request_to_the_last_response(
    case: Job, frame: int, time: float
) -> None:
    expected = {"count": 100, "device": "d", "period": 2.0, "time": time}
    assert storm(case) == [("DS724", frame, expected)]


def test_periods_between_transactions_do_not_count() -> None:
    """Reads 2 ms apart, and later ones 4 ms apart: 100 gaps of each, 3 ms in the middle."""
    far = polled(100, asked=50_000, first=50_000, gap=4)
    assert storm(polled(100), far)[0][2]["period"] == 3.0


def test_the_read_that_brings_the_response_is_one_of_them() -> None:
    """99 gaps of 2 ms, and the last one of 102 ms."""
    case = polled(100)
    case.read_request, case.read_response = half(310 * MS, 310), half(311 * MS, 311)
    assert storm(case)[0][2]["period"] == 3.0


def test_a_clock_that_was_set_back_makes_no_time_negative() -> None:
    assert storm(polled(100, asked=900, gap=-2, first=500))[0][2] == {
        "count": 100, "device": "d", "period": 0.0, "time": 0.0,
    }  # fmt: skip


def test_each_channel_has_its_own_storm() -> None:
    found = Repetition()
    for place in (HERE, THERE, HERE, THERE, HERE):
        found.closed(polled(10), place)
    assert [args["count"] for _, _, args in told(found)] == [30]


def test_a_storm_that_is_forgotten_is_told_before(small: None) -> None:
    found = Repetition()
    found.closed(polled(100), HERE)
    for slot in (2, 3):
        found.closed(polled(10), (0, slot, 1, 47))
    found.closed(polled(10), HERE)
    assert [args["count"] for _, _, args in told(found)] == [100]


def test_as_many_storms_as_there_is_room_for_are_remembered(small: None) -> None:
    found = Repetition()
    for place in (HERE, THERE, HERE, THERE, HERE):
        found.closed(polled(10), place)
    assert [args["count"] for _, _, args in told(found)] == [30]


def test_no_more_storms_are_told_than_there_is_room_for(small: None) -> None:
    found = Repetition()
    for slot in range(1, 5):
        found.closed(polled(100), (0, slot, 1, 47))
    assert len(told(found)) == 2
