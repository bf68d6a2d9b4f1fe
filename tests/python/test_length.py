"""Lengths of requests and responses (diagnosis/length): LEN (DS711), MLEN (DS712), the longest message (DS713).

The bytes are counted by hand, as docs/protocol.md A.1 to A.7 lays them out: 4 of the header, 6 of an address,
2 before the values of a block, which end at an even byte.
"""

from __future__ import annotations

from typing import Any

import pytest
from talk import job

from ds47.acyclic.pairing import STATUS_NOT_READY, STATUS_SHORT, Job
from ds47.diagnosis import length
from ds47.findings.remark import Remark
from ds47.lab import message
from ds47.profinet.records import Half

SPEED, FIXED, OTHER = message.address(21), message.address(2900), message.address(2901)
TEN, BYTE, BYTES = message.real(10.0), message.block(5, "B", 7), message.block(5, "B", 1, 2, 3)
ARRAY = message.address(2902, 0, 4)
LOCKED = 0xDF80C200


def sizes(pnu: int) -> int | None:
    return {2902: 4, 21: 1}.get(pnu)


# The request (DS711)


def too_short(asked: bytes, *errors: int) -> list[Remark]:
    return list(length.request_too_short(job(asked), errors))


def facts(asked: bytes) -> tuple[int, int, int | None]:
    """What it has, what it needs, and the number of parameters that it would fit."""
    (told,) = too_short(asked)
    assert (told.rule, told.frame, told.offset) == ("DS711", 1, len(asked))
    assert told.args["case"] == ("length_short" if told.args["fits"] is None else "length_or_count")
    return told.args["have"], told.args["need"], told.args["fits"]


@pytest.mark.parametrize(
    ("asked", "end", "need"),
    [
        (message.read(1, 1, SPEED, FIXED), 5, 16),
        (message.read(1, 1, SPEED, FIXED), 15, 16),
        (message.read(1, 1, SPEED), 3, 10),  # the number of parameters is not there: one at least
        (message.change(1, 1, (FIXED, TEN)), 9, 14),  # no format: one byte, and its pad
        (message.change(1, 1, (FIXED, TEN)), 10, 14),
        (message.change(1, 1, (FIXED, TEN)), 11, 14),
        (message.change(1, 1, (FIXED, TEN)), 12, 16),
        (message.change(1, 1, (FIXED, TEN)), 15, 16),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 15, 24),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 17, 24),
        (
            b"\1\x52" + message.change(1, 1, (FIXED, TEN), (OTHER, TEN))[2:],
            10,
            24,
        ),  # a maker's change
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 18, 26),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 21, 26),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 22, 26),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 23, 26),
        (message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 24, 28),
        (message.change(1, 1, (FIXED, BYTES), (OTHER, TEN)), 19, 26),  # with the pad between them
        (message.change(1, 1, (FIXED, BYTES), (OTHER, TEN)), 21, 26),
        (message.change(1, 1, (FIXED, BYTES)), 13, 15),  # at the end a drive does without it
        (message.change(1, 1, (FIXED, message.error(1, 2)), (OTHER, TEN)), 20, 26),
        (message.change(1, 1, (FIXED, message.error(1, 2)), (OTHER, TEN)), 22, 26),
    ],
)
def test_a_request_needs_what_it_says_itself_and_the_least_of_what_is_not_there(
    asked: bytes, end: int, need: int
) -> None:
    (told,) = too_short(asked[:end])
    assert (told.rule, told.frame, told.offset) == ("DS711", 1, end)
    assert (told.args["have"], told.args["need"]) == (end, need)
    assert told.args["count"] == (asked[3] if end > 3 else 1)


@pytest.mark.parametrize(
    ("count", "asked", "fits"),
    [
        (3, message.read(1, 1, SPEED, FIXED), 2),
        (2, message.read(1, 1, SPEED), 1),
        (3, message.read(1, 1, SPEED, FIXED)[:15], None),
        (3, message.change(1, 1, (FIXED, TEN), (OTHER, TEN)), 2),
        (2, message.change(1, 1, (FIXED, TEN)), 1),
        (9, message.read(1, 1, SPEED, FIXED, OTHER, ARRAY), 4),
        (3, message.read(0, 1, SPEED, FIXED), None),  # reference 0 is wrong, whatever the number
    ],
)
def test_a_request_that_is_as_long_as_one_for_fewer_parameters(
    count: int, asked: bytes, fits: int | None
) -> None:
    assert facts(asked[:3] + bytes((count,)) + asked[4:])[2] == fits


def test_an_address_is_not_taken_for_a_value() -> None:
    """Behind the first address two more look like a value of format 0x10 that has 8 bytes."""
    addresses = [message.address(pnu) for pnu in (1120, 971, 100)]
    asked = message.header(1, 2, 1, 3) + b"".join(addresses) + bytes((0x37, 1))
    assert facts(asked) == (24, 40, None)


@pytest.mark.parametrize("code", [0x02, 0x05, 0x17])
def test_who_refuses_the_type_of_a_value_has_read_it(code: int) -> None:
    asked = message.change(1, 1, (FIXED, TEN))[:14]
    assert too_short(asked, code) == too_short(asked, 0x11, code) == []
    assert [each.rule for each in too_short(asked, 0x11)] == ["DS711"]


def test_nothing_is_said_of_a_request_that_is_whole_or_not_in_the_capture() -> None:
    assert too_short(message.change(1, 1, (FIXED, TEN))) == []
    assert list(length.request_too_short(job(None), [])) == []
    cut = job(message.change(1, 1, (FIXED, TEN))[:14])
    assert cut.record.request is not None
    cut.record.request.missing = 2
    assert list(length.request_too_short(cut, [])) == []


# The response and MLEN (DS712)


def read_with(stated: int, asked: bytes | None, answer: bytes, **more: Any) -> Job:
    case = job(asked, answer)
    assert case.read_request is not None
    assert case.read_response is not None
    case.read_request.stated = stated
    for name, value in more.items():
        setattr(case.read_response, name, value)
    return case


def mlen(case: Job) -> dict[str, int] | None:
    told = list(length.answer_cut(case, sizes))
    assert [(each.rule, each.frame) for each in told] == [("DS712", 4)] * len(told)
    return told[0].args if told else None


REALS = message.answer(1, 1, 1, message.real(1.0, 2.0, 3.0, 4.0))
READ_ARRAY = message.read(1, 1, ARRAY)
TWO = message.read(1, 1, message.address(5, 0, 3), message.address(2902))
TWO_FOUND = message.answer(1, 1, 1, BYTES, TEN)


@pytest.mark.parametrize(
    ("asked", "answer", "stated", "need", "whole"),
    [
        (READ_ARRAY, REALS, 10, 22, None),
        (READ_ARRAY, REALS, 21, 22, None),
        (READ_ARRAY, REALS, 22, None, None),
        (READ_ARRAY, REALS, 5, 6, 22),  # the format and the number are not both there
        (TWO, TWO_FOUND, 9, 12, 16),  # the pad before the next block, and its first two bytes
        (TWO, TWO_FOUND, 10, 12, 16),
        (TWO, TWO_FOUND, 7, 9, 16),  # the first one says its format
    ],
)
def test_a_response_that_ends_at_mlen_was_cut(
    asked: bytes, answer: bytes, stated: int, need: int | None, whole: int | None
) -> None:
    expected = None if need is None else {"asked": stated, "need": need}
    if expected is not None and whole is not None:
        expected |= {"more": "mlen_whole", "whole": whole}  # type: ignore[dict-item]
    assert mlen(read_with(stated, asked, answer[:stated])) == expected


def test_of_the_response_to_another_request_nobody_knows_what_all_of_it_has() -> None:
    case = read_with(10, READ_ARRAY, REALS[:10])
    assert mlen(case) == {"asked": 10, "need": 22}
    asked = message.read(1, 1, ARRAY, ARRAY)
    assert mlen(read_with(10, asked, REALS[:10])) == {
        "asked": 10, "need": 22, "more": "mlen_whole", "whole": 40,
    }  # fmt: skip
    case = read_with(10, asked, REALS[:10])
    case.stray = True
    assert mlen(case) == {"asked": 10, "need": 22}


def test_a_response_that_ends_elsewhere_was_not_cut_to_mlen() -> None:
    assert mlen(read_with(12, READ_ARRAY, REALS[:10])) is None
    assert mlen(read_with(8, READ_ARRAY, REALS[:10])) is None
    assert mlen(read_with(10, READ_ARRAY, REALS[:10], missing=12)) is None  # the capture cut it
    assert mlen(read_with(0, READ_ARRAY, REALS[:10])) is None  # MLEN was not captured


def test_a_read_that_is_refused_says_nothing_of_mlen() -> None:
    assert mlen(read_with(5, READ_ARRAY, b"", status=STATUS_SHORT)) is None
    assert mlen(read_with(5, READ_ARRAY, b"", status=0)) is None
    assert mlen(read_with(5, None, b"", status=LOCKED)) is None
    unseen = read_with(10, READ_ARRAY, REALS[:10])
    unseen.read_request = None
    assert mlen(unseen) is None
    assert mlen(job(READ_ARRAY)) is None


def short(
    *stated: int | None, status: int = STATUS_SHORT, answer: bytes = REALS, missing: int = 0
) -> list[dict[str, int]]:
    """What is said of Reads for so many bytes that were refused before a record came."""
    case = job(READ_ARRAY, answer)
    if case.read_response is not None:
        case.read_response.missing = missing
    for number, asked in enumerate(stated):
        request = None if asked is None else Half(10 + number, 0, b"", asked)
        case.polls.append((request, Half(20 + number, 0, b"", status=status)))
    told = list(length.read_too_short(case))
    assert all((each.rule, each.frame // 10) == ("DS712", 2) for each in told)
    return [each.args for each in told]


def test_a_read_that_was_refused_for_its_length_was_too_short_for_the_record_that_came() -> None:
    assert short(10, 21) == [{"asked": 10, "need": 22}, {"asked": 21, "need": 22}]
    assert short(21, answer=REALS[:10], missing=12) == [{"asked": 21, "need": 22}]
    assert short(22, 240) == short(None, 0) == short() == []
    assert short(10, status=STATUS_NOT_READY) == short(10, answer=b"") == []


def refused(
    stated: int, request: bytes | None, status: int = STATUS_SHORT
) -> dict[str, Any] | None:
    """What is said of a Read for so many bytes that is refused, and is the last one."""
    told = list(length.read_refused(read_with(stated, request, b"", status=status), sizes))
    return told[0].args if told else None


def test_a_request_says_what_mlen_it_needs_where_no_record_came() -> None:
    wanted = {"asked": 10, "need": 22, "more": "mlen_request"}
    assert refused(10, READ_ARRAY) == wanted
    assert refused(21, READ_ARRAY) == wanted | {"asked": 21}
    assert refused(10, message.read(1, 1, ARRAY, message.address(945, 0, 8))) == wanted | {
        "need": 32
    }
    assert refused(22, READ_ARRAY) is None  # it has another reason
    assert refused(0, READ_ARRAY) is None  # MLEN was not captured
    assert refused(10, READ_ARRAY, LOCKED) is None
    assert refused(10, None) is None
    change = message.change(1, 1, (message.address(2902), message.real(1.0)))
    assert refused(2, change) is None


# More than one response carries (DS713)


def room(
    case: Job, stated: int | None = None, longest: int = 0
) -> tuple[dict[str, Any], bytes | None] | None:
    told = list(length.answer_too_long(case, stated, longest, sizes, sizes))
    if not told:
        return None
    (remark,) = told
    assert (remark.rule, remark.frame) == ("DS713", 4)
    corrected = remark.corrected
    assert not callable(corrected)
    args = {key: value for key, value in remark.args.items() if key not in ROOM}
    return args, corrected


ROOM = ("fit", "fits", "most")


def arrays(count: int) -> bytes:
    """A request for so many blocks of 40 Float32, of 162 bytes each."""
    return message.read(1, 1, *[message.address(2902, number, 40) for number in range(count)])


FORTY = message.real(*range(40))


def test_a_parameter_that_was_too_long_is_named_and_the_others_are_offered() -> None:
    found = message.answer(1, 0x81, 1, FORTY, message.error(0x15), message.error(0x15))
    case = job(arrays(3), found)
    assert room(case, None, 300) == (
        {"parameters": 3, "number": 1, "what": "too_long", "pnu": 2902, "subindex": 1,
         "room": "room_seen", "limit": 300},
        arrays(1),
    )  # fmt: skip
    first = job(arrays(2), message.answer(1, 0x81, 1, message.error(0x15), FORTY))
    assert room(first) == (
        {"parameters": 2, "number": 1, "what": "too_long", "pnu": 2902, "subindex": 0,
         "room": "room_seen", "limit": 172},
        message.read(1, 1, message.address(2902, 1, 40)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("case", "stated", "said"),
    [
        (job(arrays(3), message.answer(1, 1, 1, FORTY)), None, ("fit_parameters", 1, 240)),
        (job(arrays(3), message.answer(1, 1, 1, FORTY, FORTY)), 330, ("fit_parameters", 2, 330)),
        (job(arrays(1), message.answer(1, 0x81, 1, message.error(0x15))), 100, ("fit_elements", 23, 100)),
    ],
)  # fmt: skip
def test_how_much_has_room_is_counted(
    case: Job, stated: int | None, said: tuple[str, int, int]
) -> None:
    (remark,) = length.answer_too_long(case, stated, 0, sizes, sizes)
    assert tuple(remark.args[key] for key in ROOM) == said


def unread(pnu: int) -> int | None:
    """Nothing was read before."""
    return None


@pytest.mark.parametrize(
    ("case", "said"),
    [
        (job(arrays(3), message.answer(1, 1, 1, FORTY)), ("fit_parameters", 1, 240)),
        (job(arrays(1), message.answer(1, 0x81, 1, message.error(0x15))), (None, None, None)),
        (
            job(arrays(2), message.answer(1, 0x81, 1, message.error(0x15), FORTY)),
            ("fit_parameters", 1, 240),
        ),
    ],
)
def test_only_what_was_read_says_how_much_has_room(
    case: Job, said: tuple[str | None, int | None, int | None]
) -> None:
    """The response itself shows it, too; what a list says of a parameter does not count."""
    (remark,) = length.answer_too_long(case, None, 0, sizes, unread)
    assert tuple(remark.args[key] for key in ROOM) == said


def test_nothing_is_offered_where_no_parameter_had_a_value() -> None:
    told = room(job(arrays(1), message.answer(1, 0x81, 1, message.error(0x15))))
    assert told is not None
    assert (told[0]["number"], told[1]) == (0, None)


def test_parameters_that_were_left_out_for_want_of_room() -> None:
    """The response has 4 + 162 bytes; with another block it would have 328."""
    case = job(arrays(2), message.answer(1, 1, 1, FORTY))
    expected = {"parameters": 2, "number": 1, "what": "left_out", "pnu": 2902, "subindex": 1}
    assert room(case) == ({**expected, "room": "room_seen", "limit": 166}, arrays(1))
    assert room(case, 200) == ({**expected, "room": "room_stated", "limit": 200}, arrays(1))
    assert room(case, 166, 166) == ({**expected, "room": "room_stated", "limit": 166}, arrays(1))
    # What the device says of itself is not so where it has sent more.
    assert room(case, 160) == ({**expected, "room": "room_seen", "limit": 166}, arrays(1))
    assert room(case, 200, 201) == ({**expected, "room": "room_seen", "limit": 201}, arrays(1))


@pytest.mark.parametrize(
    ("stated", "longest", "told"),
    [(327, 0, True), (328, 0, False), (None, 327, True), (None, 328, False)],
)
def test_what_would_have_had_room_was_not_left_out_for_want_of_it(
    stated: int | None, longest: int, told: bool
) -> None:
    case = job(arrays(2), message.answer(1, 1, 1, FORTY))
    assert (room(case, stated, longest) is not None) is told


@pytest.mark.parametrize(("elements", "told"), [(18, False), (19, True)])
def test_every_device_has_room_for_240_bytes(elements: int, told: bool) -> None:
    """4 + 162 bytes are there, the other block has 2 and 4 for each element: 74, or 78."""
    asked = message.read(1, 1, message.address(2902, 0, 40), message.address(2902, 0, elements))
    assert (room(job(asked, message.answer(1, 1, 1, FORTY))) is not None) is told


@pytest.mark.parametrize(
    "found",
    [
        message.answer(1, 1, 1, FORTY, FORTY),  # all are there
        message.answer(1, 0x81, 1, FORTY, message.error(0x11)),
        message.answer(1, 0x81, 1, message.error(0x11)),  # a refusal may end the response
        message.answer(1, 1, 1, FORTY, FORTY, message.error(0x15)),  # of nothing that was asked
    ],
)
def test_where_room_is_not_what_was_missing(found: bytes) -> None:
    assert room(job(arrays(2), found)) is None


def test_what_is_not_a_read_or_not_whole_had_room() -> None:
    short = message.answer(1, 1, 1, FORTY)
    cut = job(arrays(2), short)
    assert cut.read_response is not None
    cut.read_response.missing = 9
    assert room(cut) is None
    assert room(job(arrays(2), b"")) is None
    assert room(job(arrays(2))) is None
    assert room(job(None, short)) is None
    change = message.change(1, 1, (FIXED, TEN), (OTHER, TEN))
    assert room(job(change, message.answer(1, 0x82, 1, message.error(0x15), TEN))) is None
