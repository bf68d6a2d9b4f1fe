"""Transactions: which state wins, which values and frames a finished job shows."""

from __future__ import annotations

from collections import Counter

import pytest
from talk import job

from ds47.acyclic.pairing import Job
from ds47.acyclic.transactions import build, summarise
from ds47.lab import message
from ds47.profinet.records import NIL_UUID, Half
from ds47.report.sentences import name
from ds47.spec import error_text, parameter

RAMP, SPEED = message.address(1120, 3), message.address(1121)
READ, BOTH = message.read(1, 1, RAMP), message.read(1, 1, RAMP, SPEED)
TEN, BAD = message.real(10.0), message.error(0)
ANSWER, STRAY = message.answer(1, 1, 1, TEN), message.answer(2, 1, 1, TEN)
CHANGE = message.change(1, 1, (RAMP, TEN))
REFUSED = Half(2, 2, status=0xDF80B500)


@pytest.mark.parametrize(
    ("made", "state"),
    [
        (job(READ, ANSWER), "ok"),
        (job(BOTH, message.answer(1, 0x81, 1, TEN, BAD)), "partial"),
        (job(BOTH, message.answer(1, 1, 1, TEN)), "partial"),
        (job(READ, message.answer(1, 0x81, 1, BAD)), "error"),
        (job(READ, message.answer(1, 0x81, 1, TEN)), "error"),
        (job(CHANGE, message.answer(1, 0x82, 1, message.done())), "error"),
        (job(READ, ANSWER[:-1]), "error"),
        (job(BOTH, message.answer(1, 1, 1, TEN, TEN)[:-1]), "partial"),
        (job(READ, message.answer(1, 0x80, 1, BAD)), "error"),
        (job(BOTH, message.answer(1, 0x80, 1, TEN, BAD)), "error"),
        (job(CHANGE, message.changed(1, 1)), "ok"),
        (job(CHANGE, message.answer(1, 0x82, 1, BAD)), "error"),
        (job(READ, STRAY), "mismatch"),
        (job(READ), "unanswered"),
        (job(READ, superseded_by=9), "superseded"),
        (job(READ, ANSWER, superseded_by=9), "ok"),
        (job(READ, write_response=REFUSED), "refused"),
        (job(READ, write_refused=True), "refused"),
        (job(READ, read_response=Half(4, 4, status=0xDE80B600)), "refused"),
        (job(READ, STRAY, write_response=REFUSED), "refused"),
        (job(READ, write_response=REFUSED, superseded_by=9), "refused"),
        (job(None, ANSWER), "orphan"),
        (job(None, ANSWER, write_response=REFUSED), "orphan"),
    ],
)
def test_the_first_state_that_applies(made: Job, state: str) -> None:
    assert build(made).state == state


def test_a_transaction_of_its_job() -> None:
    made = job(READ, ANSWER, polls=[(None, Half(8, 8))], rereads=[(Half(9, 9), Half(10, 10))])
    found = build(made)
    assert (found.operation, found.controller, found.device) == ("read", "c", "d")
    assert found.ar == "00010203-0405-0607-0809-0a0b0c0d0e0f"
    assert (found.request, found.response) == (READ, ANSWER)
    assert [(each.pnu, each.unit, each.values) for each in found.parameters] == [
        (1120, "s", [10.0])
    ]
    assert (found.start_ns, found.duration_ns) == (1_000_000, 3_000_000)
    assert (found.write_status, found.read_status) == (0, 0)
    assert found.frames.all() == [1, 2, 3, 4, 8, 9, 10]
    assert (found.frames.polls, found.frames.rereads) == ([(None, 8)], [(9, 10)])


def test_no_ar_and_no_duration() -> None:
    made = job(READ)
    made.record.ar = NIL_UUID
    found = build(made)
    assert (found.ar, found.duration_ns, found.response, found.read_status) == (None,) * 4


def test_an_orphan_shows_what_its_response_says() -> None:
    found = build(job(None, message.answer(7, 0x81, 3, BAD)))
    assert (found.operation, found.request_reference, found.axis) == ("read", 7, 3)
    (parameter,) = found.parameters
    assert (parameter.pnu, parameter.error and parameter.error.code) == (None, 0)
    assert build(job(None, message.answer(7, 0x33, 3, TEN))).operation == "unknown"


def test_a_mismatch_keeps_its_values_under_no_number() -> None:
    (read,) = build(job(READ, STRAY)).parameters
    assert (read.pnu, read.subindex, read.attribute, read.element_count) == (None,) * 4
    assert (read.name, read.values, read.format) == (None, [10.0], "Float32")


def test_a_stray_answer_to_a_change_leaves_what_was_sent() -> None:
    (change,) = build(job(CHANGE, message.changed(2, 1))).parameters
    assert (change.pnu, change.values) == (None, [10.0])


def test_values_and_errors_stand_at_their_parameters() -> None:
    one, two = build(job(BOTH, message.answer(1, 0x81, 1, BAD, TEN))).parameters
    assert (one.pnu, one.subindex, one.values) == (1120, 3, [])
    assert one.error is not None
    assert (one.error.code, one.error.info) == (0, 0)
    assert (two.pnu, two.values, two.error) == (1121, [10.0], None)
    change = build(job(CHANGE, message.answer(1, 0x82, 1, BAD))).parameters[0]
    assert change.error is not None
    assert change.values == [10.0]  # what was sent, and what came of it


def test_an_error_has_the_text_of_its_number_and_none_without_one() -> None:
    numbered, empty = (
        build(job(READ, message.answer(1, 0x81, 1, each))).parameters[0].error
        for each in (message.error(0x6B), message.block(0x44, "H"))
    )
    assert numbered is not None
    assert (numbered.code, numbered.text) == (0x6B, error_text(0x6B, vendor_id=42))
    assert numbered.text
    assert empty is not None
    assert (empty.code, empty.text) == (None, "")


def test_parameters_without_an_answer_are_named() -> None:
    assert [p.pnu for p in build(job(BOTH)).parameters] == [1120, 1121]
    assert [p.pnu for p in build(job(BOTH, ANSWER)).parameters] == [1120, 1121]


def test_names_of_a_vendor_are_for_its_drives() -> None:
    asked = message.read(1, 1, message.address(10), message.address(964))
    names = [[p.name is not None for p in build(job(asked, vendor=v)).parameters] for v in (42, 9)]
    assert names == [[True, True], [False, True]]


def test_summary() -> None:
    ended = [build(made) for made in (job(READ), job(READ, ANSWER), job(CHANGE))]
    summary = summarise(Counter((each.state, each.operation) for each in ended))
    assert list(summary) == ["transactions", "unanswered", "read", "ok", "change"]
    assert summary == {"transactions": 3, "unanswered": 2, "ok": 1, "read": 2, "change": 1}


def test_names_are_in_the_language_that_was_asked_for() -> None:
    (made,) = build(job(message.read(1, 1, message.address(964)))).parameters
    row = parameter(964)
    assert row is not None
    assert row.name_zh
    assert row.name_zh != row.name_en
    assert [made.name, *(name(made, lang) for lang in ("en", "zh"))] == [
        row.name_en,
        row.name_en,
        row.name_zh,
    ]
