"""Judgement: what fits, whose time it was, and what is remembered of written values."""

from __future__ import annotations

import pytest
from talk import job

from ds47.lab import message
from ds47.pairing import Job
from ds47.profinet.records import Half
from ds47.rules import Judge, Remark, drive_time_ns, family_fits, is_mismatch
from ds47.spec.semantics import limits

LIMITS = limits()
MS = 1_000_000
RAMP, SPEED = message.address(1120), message.address(1121)
READ = message.read(1, 1, RAMP)
TEN, NINE = message.real(10.0), message.real(9.5)


def judge() -> Judge:
    return Judge(LIMITS, LIMITS.slow_ns)


def rules(remarks: list[Remark]) -> list[str]:
    return [remark.rule for remark in remarks]


def change(value: bytes = TEN, where: bytes = RAMP, answer: bytes | None = None, **more) -> Job:  # type: ignore[no-untyped-def]
    asked = message.change(1, 1, (where, value))
    return job(asked, message.changed(1, 1) if answer is None else answer, **more)


@pytest.mark.parametrize(
    ("asked", "got", "fits"),
    [(1, 1, True), (1, 0x81, True), (1, 2, False), (1, 0x82, False), (2, 2, True), (2, 0x82, True),
     (2, 1, False), (1, 0x80, True), (0x33, 0x33, True), (0x33, 0xB3, True), (0x33, 0x80, True),
     (0x33, 1, False)],
)  # fmt: skip
def test_family_fits(asked: int, got: int, fits: bool) -> None:
    assert family_fits(asked, got) == fits


@pytest.mark.parametrize(
    ("answer", "stray"),
    [
        (message.answer(1, 1, 1, TEN), False),
        (message.answer(1, 0x81, 1, message.error(0)), False),
        (message.answer(1, 0x80, 1, message.error(0x21)), False),
        (message.answer(2, 1, 1, TEN), True),
        (message.answer(1, 1, 2, TEN), True),
        (message.changed(1, 1), True),
        (message.answer(1, 1, 1, TEN, TEN), True),
        (message.answer(1, 1, 1), False),  # fewer blocks than addresses
        (b"\1", True),  # no whole header
    ],
    ids=["ok", "error", "0x80", "reference", "axis", "id", "more blocks", "fewer blocks", "cut"],
)
def test_is_mismatch(answer: bytes, stray: bool) -> None:
    assert is_mismatch(job(READ, answer)) == stray


def test_no_mismatch_without_a_pair() -> None:
    assert not is_mismatch(job(READ))
    assert not is_mismatch(job(None, message.answer(1, 1, 1, TEN)))


def test_the_drives_time_leaves_out_the_pause_of_the_program() -> None:
    one = job(READ, message.answer(1, 1, 1, TEN))
    assert drive_time_ns(one) == 2 * MS  # 3 ms from Write to response, 1 ms before the Read
    one.polls = [(Half(2, 2_500_000), Half(2, 2_600_000))]
    assert drive_time_ns(one) == 2_500_000  # the first Read was the poll
    one.write_response = None
    assert drive_time_ns(one) is None  # when the Write was accepted is not known
    assert drive_time_ns(job(READ)) is None
    assert drive_time_ns(job(None, message.answer(1, 1, 1, TEN))) is None


def test_a_read_before_the_write_response_is_no_negative_pause() -> None:
    one = job(READ, message.answer(1, 1, 1, TEN), write_response=Half(9, 900 * MS, status=0))
    assert drive_time_ns(one) == 3 * MS


@pytest.mark.parametrize(("over", "found"), [(0, []), (1, ["DS416"])])
def test_slow_begins_behind_the_limit(over: int, found: list[str]) -> None:
    one = job(READ, message.answer(1, 1, 1, TEN))
    assert one.read_response is not None
    one.read_response.time_ns = 2 * MS + LIMITS.slow_ns + over
    assert rules(judge().answered(one)) == found


def test_longer_than_the_device_says_in_974() -> None:
    court = judge()
    longest = job(message.read(1, 1, message.address(974)), message.answer(1, 1, 1, message.word(16)))  # fmt: skip
    court.answered(longest)
    long = message.read(3, 1, RAMP, SPEED, RAMP)
    (remark,) = court.unanswered(job(long, superseded_by=7), dropped=False)[:1]
    assert (remark.rule, remark.frame) == ("DS316", 1)
    assert remark.args == {"length": 22, "limit": 16}
    assert "DS316" not in rules(
        court.unanswered(job(long, device="other", superseded_by=7), dropped=False)
    )
    assert "DS316" not in rules(
        court.unanswered(job(message.read(3, 1, RAMP, SPEED)), dropped=False)
    )


def test_974_in_a_stray_response_teaches_nothing() -> None:
    court = judge()
    court.answered(
        job(message.read(1, 1, message.address(974)), message.answer(2, 1, 1, message.word(16)))
    )
    assert "DS316" not in rules(
        court.unanswered(job(message.read(3, 1, RAMP, SPEED, RAMP)), dropped=False)
    )


@pytest.mark.parametrize(
    ("one", "rule"),
    [
        (job(READ), "DS401"),
        (change(answer=b"", read_response=None), "DS402"),
        (job(READ, superseded_by=9), "DS413"),
        (change(answer=b"", read_response=None, superseded_by=9), "DS414"),
    ],
)
def test_without_response(one: Job, rule: str) -> None:
    assert rules(judge().unanswered(one, dropped=False)) == [rule]


def test_the_same_reference_again() -> None:
    one = job(READ, message.answer(1, 1, 1, TEN), previous_reference=1)
    assert rules(judge().answered(one)) == ["DS415"]
