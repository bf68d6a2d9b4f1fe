"""What the order of frames says of one transaction (diagnosis/order): DS702, DS704, DS705, DS722.

The frames are typed by hand; the sentences are those of docs/diagnoses.md.
"""

from __future__ import annotations

from typing import Any
from uuid import UUID

import pytest
from talk import job

from ds47.acyclic.pairing import STATUS_IN_USE, STATUS_NOT_READY, Job, Peer
from ds47.diagnosis import order
from ds47.lab import message
from ds47.profinet.records import Half

SPEED, FIXED, TEN = message.address(21), message.address(2900), message.real(10.0)
READ, CHANGE = message.read(1, 1, SPEED), message.change(1, 1, (FIXED, TEN))
ANSWER = message.answer(1, 1, 1, TEN)


def at(frame: int, status: int | None = None) -> Half:
    return Half(frame, frame * 1_000_000, status=status)


def said(case: Job) -> list[tuple[str, int, dict[str, Any]]]:
    return [(each.rule, each.frame, each.args) for each in order.of(case)]


# Too early (DS702)


@pytest.mark.parametrize(
    ("reads", "told"),
    [
        ([at(3)], None),
        ([at(1)], 1),
        ([at(1), at(5)], 1),  # the first one counts,
        ([at(3), at(1)], None),
        ([None, at(1)], 1),  # as far as it was captured
        ([None, at(3), at(1)], None),
    ],
)
def test_a_read_before_the_response_of_the_write_is_too_early(
    reads: list[Half | None], told: int | None
) -> None:
    polls = [(read, at(9, STATUS_NOT_READY)) for read in reads[:-1]]
    case = job(READ, ANSWER, write_response=at(2, 0), polls=polls, read_request=reads[-1])
    expected = [] if told is None else [("DS702", told, {"frame": told, "by": 2})]
    assert said(case) == expected


def test_a_read_that_was_sent_before_the_write_by_its_time_is_not_too_early() -> None:
    early = Half(1, 999_999)
    assert said(job(READ, ANSWER, write_response=at(2, 0), read_request=early)) == []


@pytest.mark.parametrize("answer", [None, at(2), at(2, 0xDF80C200)])
def test_no_read_is_too_early_for_a_write_that_was_not_accepted(answer: Half | None) -> None:
    assert said(job(READ, ANSWER, write_response=answer, read_request=at(1))) == []


# An old response (DS704)


def test_a_response_that_is_read_once_more_names_both_frames() -> None:
    rereads = [(at(5), at(6)), (at(7), at(8))]
    (told,) = said(job(READ, ANSWER, rereads=rereads, reread_cause="again_here"))
    args = {"case": "again_here", "frame": 6, "first": 4, "write": None}
    assert told == ("DS704", 6, args)


def test_an_old_response_after_a_refused_write_names_that_write() -> None:
    (told,) = said(job(READ, ANSWER, frame=5, repeats=4, write_response=at(6, 0xDF80C200)))
    args = {"case": "again_after_refusal", "frame": 8, "first": 4, "write": 5}
    assert told == ("DS704", 8, args)


def test_an_old_response_that_nobody_asked_for_names_no_write() -> None:
    (told,) = said(job(None, ANSWER, frame=5, repeats=4))
    assert told == (
        "DS704", 8, {"case": "again_without_ar", "frame": 8, "first": 4, "write": None},
    )  # fmt: skip


# Two users (DS705)


def of_user(asked: bytes, controller: str = "c", ar: int = 0, **more: Any) -> Job:
    case = job(asked, **more)
    case.peer = Peer(controller, "d", 0x002A, 0x0501)
    case.key = (*case.key[:2], ar.to_bytes(16, "big"), *case.key[3:])
    return case


OTHER = message.read(2, 1, FIXED)


@pytest.mark.parametrize(
    ("asked", "later", "told"),
    [
        (READ, OTHER, True),
        (READ, message.read(2, 1, SPEED), False),  # the same question: one user who does not wait
        (READ, message.read(1, 2, SPEED), True),
        (CHANGE, OTHER, False),  # many programs never read what a change is answered
    ],
)
def test_a_read_that_another_request_displaces_has_two_users(
    asked: bytes, later: bytes, told: bool
) -> None:
    came = of_user(later, "e", frame=7)
    case = of_user(asked, superseding=came, superseded_by=7)
    assert said(case) == [("DS705", 7, {
        "case": "two_stations", "controller": "e", "ar": None, "frame": 7,
        "other": "c", "other_ar": None, "first": 1,
    })] * told  # fmt: skip


@pytest.mark.parametrize(
    ("controller", "ar", "case"),
    [("e", 0, "two_stations"), ("c", 1, "two_ars"), ("c", 0, "one_station")],
)
def test_a_write_that_is_turned_away_names_whose_request_was_open(
    controller: str, ar: int, case: str
) -> None:
    held = of_user(OTHER, controller, ar)
    turned = of_user(CHANGE, frame=7, rival=held, write_response=at(8, STATUS_IN_USE))
    assert said(turned) == [("DS705", 7, {
        "case": case, "controller": "c", "ar": None, "frame": 7,
        "other": controller, "other_ar": str(UUID(int=ar)) if ar else None, "first": 1,
    })]  # fmt: skip


def test_who_else_asked_may_not_be_in_the_capture() -> None:
    turned = of_user(CHANGE, frame=7, write_response=at(8, STATUS_IN_USE))
    assert said(turned) == []  # what was open may be missing, too
    turned.alone = True
    assert said(turned) == [("DS705", 7, {
        "case": "unseen_user", "controller": "c", "ar": None, "frame": 7,
        "other": None, "other_ar": None, "first": None,
    })]  # fmt: skip


def test_another_status_says_nothing_of_another_user() -> None:
    held = of_user(OTHER, "e")
    assert said(of_user(CHANGE, rival=held, write_response=at(8, 0xDF80C200))) == []


# The connection ended (DS722)


@pytest.mark.parametrize(
    ("asked", "more", "told"),
    [
        (READ, {}, True),
        (CHANGE, {}, False),  # many programs never read what a change is answered,
        (CHANGE, {"polls": [(at(3), at(4, STATUS_NOT_READY))]}, True),  # but this one waited for it
        (CHANGE, {"empty_reads": [at(4)]}, True),
        (CHANGE, {"read_request": at(3)}, True),
        (READ, {"read_response": at(4, 0)}, False),
        (READ, {"write_response": at(2, 0xDF80C200), "write_refused": True}, False),
        (READ, {"write_refused": True}, False),
        (READ, {"ended": None}, False),
    ],
)
def test_what_was_open_and_waited_for_when_the_connection_ended_is_lost(
    asked: bytes, more: dict[str, Any], told: bool
) -> None:
    assert said(job(asked, **{"ended": 9, **more})) == [("DS722", 1, {"frame": 9})] * told


def test_no_request_was_open_where_none_was_captured() -> None:
    assert said(job(None, read_request=at(3), ended=9)) == []
