"""What a refused parameter says (diagnosis/refusal): its rule, the requests it speaks against."""

from __future__ import annotations

from typing import Any

import pytest
from talk import job

from ds47.acyclic.pairing import Job
from ds47.diagnosis.refusal import end, not_seen, of, refusals, sign, signs, without_index
from ds47.lab import message
from ds47.profidrive import Address, decode_request

FIXED, TEN = message.address(2900), message.real(10.0)


def refused(asked: bytes, *blocks: bytes) -> Job:
    """A request with a negative response."""
    return job(asked, message.answer(1, asked[1] | 0x80, 1, *blocks))


def rules_of(case: Job) -> list[str]:
    return [remark.rule for _, remark in of(case, refusals(case))]


# Index and count (DS717): an address that has neither is not refused for them


@pytest.mark.parametrize(
    ("code", "pnu", "subindex", "elements", "told"),
    [
        (0x04, 2900, 0, 1, True),
        (0x18, 2900, 0, 1, True),
        (0x03, 2900, 0, 1, False),
        (0x03, 2900, 1, 1, True),
        (0x03, 2900, 0, 2, True),
        (0x03, 0, 1, 1, True),
        (0x16, 2900, 0, 1, False),
        (0x16, 2900, 1, 1, True),
        (0x16, 2900, 0, 2, True),
        (0x16, 0, 1, 2, False),
    ],
)
def test_index_and_count_are_blamed_only_where_the_address_has_them(
    code: int, pnu: int, subindex: int, elements: int, told: bool
) -> None:
    asked = message.read(1, 1, message.address(pnu, subindex, elements))
    assert rules_of(refused(asked, message.error(code))) == ["DS717"] * told


@pytest.mark.parametrize(
    ("elements", "values", "behind", "case", "have", "need"),
    [
        (1, 1, 20, "record_longer", 36, 16), (0, 1, 1, "record_longer", 17, 16),
        (1, 1, 0, "counts_agree", None, None), (0, 1, 0, "counts_agree", None, None),
        (2, 1, 20, "counts", None, None), (1, 2, 0, "counts", None, None),
    ],
)  # fmt: skip
def test_counts_that_agree_leave_the_length(
    elements: int, values: int, behind: int, case: str, have: int | None, need: int | None
) -> None:
    pair = message.address(2900, 0, elements), message.real(*[10.0] * values)
    asked = message.change(1, 1, pair) + bytes(behind)
    one = refused(asked, message.error(0x18))
    ((_, remark),) = of(one, refusals(one))
    told = [remark.args[name] for name in ("case", "have", "need")]
    assert (remark.rule, told) == ("DS717", [case, have, need])


def test_only_0x18_is_about_the_counts() -> None:
    asked = message.change(1, 1, (message.address(2900, 1), message.real(10.0))) + bytes(20)
    one = refused(asked, message.error(0x04))
    ((_, remark),) = of(one, refusals(one))
    assert (remark.rule, remark.args["case"]) == ("DS717", "counts")


@pytest.mark.parametrize(
    ("value", "source"), [(0, None), (0xFFFF, None), (0x1_0000, 1), (0x34_0000, 52)]
)
def test_a_connector_names_its_source_in_the_upper_word(value: int, source: int | None) -> None:
    asked = message.change(1, 1, (message.address(1070), message.block(0x07, "I", value)))
    case = refused(asked, message.error(0x83))
    ((_, remark),) = of(case, refusals(case))
    assert (remark.rule, remark.args["source"]) == ("DS720", source)


# What a refusal says of further requests


def speaks_against(code: int, asked: bytes, other: bytes) -> bool:
    case = refused(asked, message.error(code))
    (first,) = refusals(case)
    assert case.message is not None
    assert case.response is not None
    said = sign("d", case.message, case.response, first)
    return said in set(signs("d", decode_request(other)))


READ, ELSEWHERE = message.read(1, 1, FIXED), message.read(1, 1, message.address(2900, 3))
CHANGE = message.change(1, 1, (FIXED, TEN))
OTHER_VALUE = message.change(1, 1, (FIXED, message.real(11.0)))
ANOTHER = message.read(1, 1, message.address(2901))


@pytest.mark.parametrize(
    ("code", "asked", "against", "not_against"),
    [
        (0x00, READ, (READ, ELSEWHERE, CHANGE), (ANOTHER,)),
        (0x6B, CHANGE, (CHANGE, OTHER_VALUE), (READ, ANOTHER)),
        (0x6B, READ, (READ, ELSEWHERE), (CHANGE, ANOTHER)),
        (0x16, READ, (READ,), (ELSEWHERE, CHANGE, ANOTHER)),
        (0x05, CHANGE, (CHANGE,), (OTHER_VALUE, READ)),
        (0x18, CHANGE, (CHANGE,), (OTHER_VALUE, READ)),
    ],
)
def test_a_refusal_speaks_against_what_it_is_about(
    code: int, asked: bytes, against: tuple[bytes, ...], not_against: tuple[bytes, ...]
) -> None:
    assert all(speaks_against(code, asked, other) for other in against)
    assert not any(speaks_against(code, asked, other) for other in not_against)


def test_a_parameter_without_description_may_have_a_value_and_a_text() -> None:
    def asked(attribute: int, subindex: int = 0, elements: int = 1) -> bytes:
        return message.read(1, 1, message.address(2900, subindex, elements, attribute))

    description = asked(message.DESCRIPTION)
    assert speaks_against(0x09, description, asked(message.DESCRIPTION, 3, 2))
    assert not speaks_against(0x09, description, READ)
    assert not speaks_against(0x09, description, asked(0x30))


@pytest.mark.parametrize("code", [0x19, 0x15])
def test_what_is_not_about_the_parameter_speaks_against_no_request(code: int) -> None:
    case = refused(READ, message.error(code))
    assert case.message is not None
    assert case.response is not None
    (first,) = refusals(case)
    assert sign("d", case.message, case.response, first) is None


def test_no_element_means_one() -> None:
    assert [end(Address(0x10, elements, 2900, 3, 4)) for elements in (0, 1, 2)] == [4, 4, 5]


# The request for a parameter that is no array


def simple(asked: bytes, *blocks: bytes, number: int = 0) -> bytes | None:
    case = refused(asked, *blocks)
    return without_index(case, number)


def test_the_simple_request_has_index_0_and_one_element_and_is_alone_if_others_failed() -> None:
    both = message.read(1, 1, message.address(2900, 3), message.address(21))
    fixed = message.read(1, 1, FIXED)
    assert simple(both, message.error(4), TEN) == message.read(1, 1, FIXED, message.address(21))
    assert simple(both, message.error(4), message.error(0x6B)) == fixed
    assert simple(both, message.error(4)) == fixed, "the response says nothing of the other"
    cut = bytes.fromhex("4402")
    assert simple(both, message.error(4), cut) == fixed, "the number of the other error is cut off"
    assert simple(message.read(1, 1, message.address(2900, 3)) + b"\1", message.error(4)) == fixed


def test_without_the_request_or_with_a_text_there_is_no_simple_request() -> None:
    """Of a text no part is meant, be it one character."""
    unseen = job(None, message.answer(1, 0x81, 1, message.error(4)))
    assert without_index(unseen, 0) is None
    text = message.change(1, 1, (message.address(2900, 3), bytes((0x09, 1)) + b"A\0"))
    assert simple(text, message.error(4)) is None


# A refusal that no status tells of (DS701)


def told_of_status_zero(case: Job) -> list[dict[str, Any]]:
    return [remark.args for remark in not_seen(case)]


def test_a_refusal_under_status_zero_is_told_once() -> None:
    """Of a response whose request the capture does not show, too, but not of one that is read again."""
    no = message.answer(1, 0x81, 1, message.error(0x6B))
    usual = {
        "id": 0x81,
        "code": 0x6B,
        "among": False,
        "vendor_id": 0x2A,
        "case": "status_zero",
        "polls": 0,
        "asked": 1,
    }
    assert told_of_status_zero(job(READ, no)) == [usual]
    assert told_of_status_zero(job(None, no)) == [usual | {"asked": None}]
    assert told_of_status_zero(job(None, no, repeats=2)) == []
    assert told_of_status_zero(job(READ, no, repeats=2)) == [usual]


def test_a_positive_response_is_no_refusal_whatever_stands_in_it() -> None:
    assert told_of_status_zero(job(READ, message.answer(1, 0x01, 1, message.error(0x6B)))) == []


def test_of_several_values_it_is_not_known_which_is_meant() -> None:
    where = message.address(2900, 3, 2)
    assert simple(message.change(1, 1, (where, message.real(1.0, 2.0))), message.error(4)) is None
    one = message.change(1, 1, (message.address(2900, 3), TEN))
    assert simple(one, message.error(4)) == CHANGE
