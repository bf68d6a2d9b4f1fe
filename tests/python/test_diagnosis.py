"""What `Diagnoses` remembers of a device, and offers instead (diagnosis/__init__).

Each conversation is made of jobs; frames count on, four for each of them. What must be said is typed by hand.
"""

from __future__ import annotations

from itertools import count
from typing import Any

import pytest
from talk import job

from ds47 import diagnosis
from ds47.acyclic.judge import Judge
from ds47.diagnosis import Diagnoses
from ds47.findings.remark import Remark
from ds47.lab import message
from ds47.profidrive import Options
from ds47.profidrive.formats import is_unlikely
from ds47.profidrive.model import Block
from ds47.profinet.records import Half
from ds47.spec.semantics import known, limits

FIXED, SPEED, OTHER = message.address(2900), message.address(21), message.address(2901)
TEN, BITS, WORD = message.real(10.0), message.block(0x07, "I", 0x41200000), message.word(10)
LOCAL = (1, 1, 0xB02E)
FORMAT, NO_OBJECT, NO_ARRAY, NO_SUBINDEX = 0x05, 0x19, 0x04, 0x03


class Talk:
    """What one program asks one device, and what it gets."""

    def __init__(self) -> None:
        self.diagnoses = Diagnoses(Options())
        self.frames = count(1, 4)

    def closed(self, asked: bytes, answer: bytes | None, **more: Any) -> list[Remark]:
        return self.diagnoses.closed(job(asked, answer, frame=next(self.frames), **more))

    def read(
        self, where: bytes, found: bytes = TEN, axis: int = 1, identifier: int = 1, **more: Any
    ) -> list[Remark]:
        answer = message.answer(1, identifier, axis, found)
        return self.closed(message.read(1, axis, where), answer, **more)

    def refused(self, asked: bytes, *codes: int, **more: Any) -> list[Remark]:
        """A response with these error numbers; 0 for a parameter of a change that was done, or a value read."""
        good = message.done() if asked[1] == 2 else TEN
        blocks = [message.error(code) if code else good for code in codes]
        return self.closed(
            asked, message.answer(asked[0], asked[1] | 0x80, asked[2], *blocks), **more
        )


def change(*pairs: tuple[bytes, bytes], axis: int = 1) -> bytes:
    return message.change(1, axis, *pairs)


def only(told: list[Remark], rule: str) -> Remark:
    (remark,) = told
    assert remark.rule == rule
    return remark


def offered(remark: Remark) -> bytes | None:
    """What is offered instead when the capture is over."""
    given = remark.corrected
    return given() if callable(given) else given


# Values that nobody means


@pytest.mark.parametrize(
    ("code", "values", "unlikely"),
    [
        (0x08, [0.0], False),
        (0x08, [2.0**-126], False),
        (0x08, [-(2.0**-126)], False),
        (0x08, [2.0**-127], True),
        (0x08, [1e30], False),
        (0x08, [-1.1e30], True),
        (0x08, ["NaN"], True),
        (0x08, [0.0, 1.0, 1e-45], True),
        (0x0F, [2.0**-1022], False),
        (0x0F, [2.0**-127], False),
        (0x0F, [5e-324], True),
        (0x07, [4_000_000_000], False),
    ],
)
def test_a_value_that_nobody_means(code: int, values: list[Any], unlikely: bool) -> None:
    assert is_unlikely(Block(code, len(values), values, None, None, b"")) is unlikely


# About formats (DS714)


def test_a_format_that_was_read_is_the_right_one_and_the_corrected_request_has_it() -> None:
    talk = Talk()
    talk.read(FIXED)
    talk.read(FIXED)
    told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
    assert (told.frame, told.job is not None) == (9, True)
    assert (told.args["case"], told.args["seen"], told.args["code"]) == ("format_read", 4, FORMAT)
    assert (told.args["better_code"], told.args["bits"]) == (0x08, "bits_same")
    assert offered(told) == change((FIXED, TEN))


def test_the_corrected_request_leaves_out_what_was_refused_though_the_number_is_cut_off() -> None:
    talk = Talk()
    talk.read(FIXED)
    asked = change((FIXED, BITS), (OTHER, WORD))
    answer = message.answer(1, 0x82, 1, message.error(FORMAT), bytes.fromhex("440200"))
    told = only(talk.closed(asked, answer), "DS714")
    assert offered(told) == change((FIXED, TEN))


def test_a_format_of_the_list_is_told_as_such_and_nothing_is_offered() -> None:
    told = only(Talk().refused(change((FIXED, BITS)), FORMAT), "DS714")
    assert (told.args["case"], told.args["seen"], offered(told)) == ("format_listed", None, None)


def test_what_was_read_another_way_is_no_proof() -> None:
    for more in ({"axis": 2}, {"at": (1, 2, 47)}, {"at": LOCAL}, {"device": "e"}):
        talk = Talk()
        talk.read(FIXED, **more)
        told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
        assert (told.args["seen"], offered(told)) == (None, None)


def test_what_was_read_in_another_format_speaks_against_the_list() -> None:
    talk = Talk()
    talk.read(FIXED, message.block(0x07, "I", 1), axis=2)
    assert [each.rule for each in talk.refused(change((FIXED, BITS)), FORMAT)] == ["DS701"]
    several = Talk()
    several.read(FIXED, axis=2)
    several.read(FIXED, WORD, axis=3)
    several.read(FIXED, axis=4)
    assert [each.rule for each in several.refused(change((FIXED, BITS)), FORMAT)] == ["DS701"]


def test_the_newest_format_of_a_parameter_counts() -> None:
    talk = Talk()
    talk.read(FIXED, WORD)
    talk.read(FIXED, TEN)
    told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
    assert (told.args["seen"], offered(told)) == (8, change((FIXED, TEN)))


def test_nothing_is_learnt_from_what_is_no_value_of_this_parameter() -> None:
    text = message.address(2900, 0, 1, message.TEXT)
    for say in (
        lambda talk: talk.read(text),
        lambda talk: talk.refused(message.read(1, 1, FIXED), 0x11),
        lambda talk: talk.closed(message.read(1, 1, FIXED), message.answer(2, 1, 1, TEN)),
        lambda talk: talk.closed(message.read(1, 1, FIXED), message.answer(1, 3, 1, TEN)),
        lambda talk: talk.closed(message.read(1, 1, FIXED), None),
        lambda talk: talk.closed(change((FIXED, TEN)), message.changed(1, 1)),
        lambda talk: talk.refused(change((FIXED, TEN), (OTHER, TEN)), 0, 0x11),
    ):
        talk = Talk()
        say(talk)
        told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
        assert told.args["seen"] is None


def test_a_value_beside_a_refused_one_is_learnt() -> None:
    talk = Talk()
    talk.refused(message.read(1, 1, SPEED, FIXED), 0x11, 0)
    assert only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714").args["seen"] == 4


def test_of_several_values_those_are_offered_that_are_proven() -> None:
    both = change((FIXED, BITS), (OTHER, BITS))
    talk = Talk()
    talk.read(FIXED)
    first, second = talk.refused(both, FORMAT, FORMAT)
    assert (first.args["pnu"], offered(first)) == (2900, change((FIXED, TEN)))
    assert (second.args["pnu"], offered(second)) == (2901, None)
    talk = Talk()
    talk.read(FIXED)
    talk.read(OTHER)
    assert {offered(each) for each in talk.refused(both, FORMAT, FORMAT)} == {
        change((FIXED, TEN), (OTHER, TEN))
    }


def test_a_parameter_that_was_refused_for_something_else_is_left_out() -> None:
    talk = Talk()
    talk.read(FIXED)
    told = talk.refused(change((FIXED, BITS), (message.address(304), TEN)), FORMAT, 0x11)
    assert [each.rule for each in told] == ["DS714", "DS719"]
    assert offered(told[0]) == change((FIXED, TEN))


def test_a_parameter_that_has_no_response_is_left_out() -> None:
    """Nobody knows whether its value was taken as it was sent."""
    talk = Talk()
    talk.read(FIXED)
    told = talk.refused(change((FIXED, BITS), (message.address(304), TEN)), FORMAT)
    assert offered(told[0]) == change((FIXED, TEN))


def test_what_would_be_offered_was_refused_before_or_is_later() -> None:
    talk = Talk()
    talk.read(FIXED)
    told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
    assert offered(told) == change((FIXED, TEN))
    talk.refused(change((FIXED, TEN)), 0x11)
    assert offered(told) is None


def test_a_request_of_which_the_end_was_not_captured_is_not_repaired() -> None:
    case = job(change((FIXED, BITS)), message.answer(1, 0x82, 1, message.error(FORMAT)))
    assert case.record.request is not None
    case.record.request.missing = 1
    told = Diagnoses(Options()).closed(case)
    assert [each.rule for each in told] == ["DS701"]


def test_a_correction_for_a_drive_object_that_is_missing_later_is_not_offered() -> None:
    talk, local = Talk(), Talk()
    talk.read(FIXED)
    local.read(FIXED, at=LOCAL)
    here = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
    there = only(local.refused(change((FIXED, BITS)), FORMAT, at=LOCAL), "DS714")
    for each in (talk, local):
        each.refused(message.read(1, 1, SPEED), NO_OBJECT)
    assert offered(here) is None
    assert offered(there) == change((FIXED, TEN))  # there the slot decides


# Of whom the list of parameters speaks


@pytest.mark.parametrize(
    ("vendor", "told"),
    [
        (0x002A, ("DS714", "format_listed")),
        (0x0099, ("DS714", "format_bits")),
        (None, ("DS714", "format_bits")),
    ],
)
def test_the_list_speaks_of_drives_of_its_maker(vendor: int | None, told: tuple[str, str]) -> None:
    found = Talk().refused(change((FIXED, BITS)), FORMAT, vendor=vendor)
    assert [(each.rule, each.args.get("case")) for each in found] == [told]


def test_the_list_speaks_of_profile_parameters_of_every_maker() -> None:
    """P0930 is Unsigned16 by the profile, whoever made the drive."""
    told = Talk().refused(
        change((message.address(930), message.block(0x03, "h", 5))), FORMAT, vendor=0x0099
    )
    assert [(each.rule, each.args.get("case")) for each in told] == [("DS714", "format_listed")]


# A request that was meant in another way (DS715, DS716)


def swapped(request: bytes) -> bytes:
    return b"".join(request[at : at + 2][::-1] for at in range(0, len(request), 2))


def test_a_repaired_read_is_offered() -> None:
    asked = message.read(4, 1, message.address(2902, 2, 4))
    told = only(Talk().closed(swapped(asked), None), "DS715")
    assert (told.frame, offered(told)) == (1, asked)


def test_a_repaired_change_is_offered_where_its_formats_are_proven() -> None:
    asked = change((FIXED, TEN), (OTHER, TEN))
    assert offered(only(Talk().closed(swapped(asked), None), "DS715")) is None
    talk = Talk()
    talk.read(FIXED)
    assert offered(only(talk.closed(swapped(asked), None), "DS715")) is None
    talk.read(OTHER)
    assert offered(only(talk.closed(swapped(asked), None), "DS715")) == asked


def test_turned_values_are_told_of_a_change_that_was_accepted() -> None:
    """10.0 with its bytes in the other order is denormal; which of both was meant nobody knows."""
    asked = change((FIXED, b"\x08\x01" + TEN[:1:-1]))
    talk = Talk()
    talk.read(FIXED)
    told = only(talk.closed(asked, message.changed(1, 1)), "DS715")
    assert (told.args["what"], offered(told)) == ("values", None)


def test_a_change_that_must_never_be_sent_on_advice_is_not_offered() -> None:
    asked = change((message.address(9350), TEN))
    talk = Talk()
    talk.read(message.address(9350))
    told = talk.closed(swapped(asked), None)
    assert [offered(each) for each in told] == [None] * len(told)


# About arrays (DS717)


def test_the_address_of_a_parameter_that_is_no_array_is_offered_without_its_index() -> None:
    told = only(Talk().refused(message.read(1, 1, message.address(2900, 3)), NO_ARRAY), "DS717")
    assert offered(told) == message.read(1, 1, FIXED)
    talk = Talk()
    asked = change((message.address(2900, 3), TEN))
    assert offered(only(talk.refused(asked, NO_ARRAY), "DS717")) is None
    talk.read(FIXED)
    assert offered(only(talk.refused(asked, NO_ARRAY), "DS717")) == change((FIXED, TEN))
    wrong = Talk()
    wrong.read(FIXED, WORD)
    told = wrong.refused(asked, NO_ARRAY)[0]
    assert offered(told) is None


def test_a_request_that_ends_before_its_value_has_no_correction() -> None:
    talk = Talk()
    talk.read(FIXED)
    both = change((message.address(2900, 3), TEN), (message.address(2900, 4), TEN))
    told = talk.refused(both[:-6], NO_ARRAY, NO_ARRAY)
    assert [(each.rule, offered(each)) for each in told if each.rule == "DS717"] == [
        ("DS717", None), ("DS717", None),
    ]  # fmt: skip


def test_other_errors_of_the_index_offer_nothing() -> None:
    told = only(Talk().refused(message.read(1, 1, message.address(2900, 3)), NO_SUBINDEX), "DS717")
    assert offered(told) is None


# Another drive object (DS709)


def missing(talk: Talk, where: bytes = SPEED, **more: Any) -> Remark:
    """Drive object 9 is none of the device."""
    asked = message.read(1, 9, where) if more.pop("read", True) else change((where, TEN), axis=9)
    return only(talk.refused(asked, NO_OBJECT, **more), "DS709")


def test_the_only_drive_object_that_read_it_is_offered() -> None:
    talk = Talk()
    told = missing(talk)
    assert offered(told) is None
    talk.read(SPEED, axis=2)
    assert offered(told) == message.read(1, 2, SPEED)
    talk.read(FIXED, axis=3)
    assert offered(told) is None


def test_a_drive_object_of_which_another_parameter_was_read_is_not_offered() -> None:
    talk = Talk()
    talk.read(FIXED, axis=2)
    assert offered(missing(talk)) is None
    talk.read(SPEED, axis=2)
    both = message.read(1, 9, SPEED, FIXED)
    assert offered(only(talk.refused(both, NO_OBJECT, NO_OBJECT), "DS709")) == message.read(
        1, 2, SPEED, FIXED
    )
    more = message.read(1, 9, SPEED, OTHER)
    assert offered(only(talk.refused(more, NO_OBJECT, NO_OBJECT), "DS709")) is None


def test_only_values_that_were_read_are_offered() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    assert offered(missing(talk, message.address(21, 0, 1, message.TEXT))) is None


def test_axis_0_is_no_drive_object_and_a_slot_is_none_by_number() -> None:
    talk = Talk()
    talk.read(SPEED, axis=0)
    assert offered(missing(talk)) is None
    local = Talk()
    local.read(SPEED, axis=2, at=LOCAL)
    assert offered(missing(local)) is None
    there = Talk()
    there.read(SPEED, axis=2, at=(2, 1, 47))
    assert offered(missing(there)) is None
    asked = Talk()
    asked.read(SPEED, axis=2)
    told = missing(asked, at=LOCAL)
    assert offered(told) is None


def test_neither_a_slot_nor_a_request_that_is_not_known_shows_another_drive_object() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    talk.read(SPEED, axis=5, at=LOCAL)
    talk.closed(message.read(1, 3, SPEED), message.header(1, 0x80, 3, 0))
    assert offered(missing(talk)) == message.read(1, 2, SPEED)


def test_a_change_never_goes_to_another_drive_object() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    assert offered(missing(talk, read=False)) is None


def test_a_drive_object_that_was_refused_as_missing_is_not_offered() -> None:
    """It answered once, and later there was none of that number."""
    talk = Talk()
    talk.read(SPEED, axis=2)
    told = missing(talk)
    talk.refused(message.read(1, 2, FIXED), NO_OBJECT)
    assert offered(told) is None
    talk.read(SPEED, axis=3)
    assert offered(told) == message.read(1, 3, SPEED)


def test_other_devices_are_others() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2, device="e")
    assert offered(missing(talk)) is None


def test_what_stands_behind_the_request_is_left_out() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    asked = message.read(1, 9, SPEED) + b"\x12\x34"
    assert offered(only(talk.refused(asked, NO_OBJECT), "DS709")) == message.read(1, 2, SPEED)
    zeros = message.read(1, 9, SPEED) + b"\0\0"
    assert offered(only(talk.refused(zeros, NO_OBJECT), "DS709")) in {
        message.read(1, 2, SPEED), message.read(1, 2, SPEED) + b"\0\0",
    }  # fmt: skip


def test_what_that_drive_object_refused_is_not_offered() -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    told = missing(talk)
    talk.refused(message.read(1, 2, SPEED), 0x11)
    assert offered(told) is None


def test_subindices_behind_the_end_of_an_array_are_not_offered() -> None:
    """p2902[0] was read; p2902[4] there is none, so p2902[3] may be, and p2902[5] is none."""
    array = [message.address(2902, number) for number in range(8)]
    talk = Talk()
    talk.read(array[0], axis=2)
    told = {number: missing(talk, array[number]) for number in (3, 5)}
    near = missing(talk, array[4])
    assert offered(told[5]) == message.read(1, 2, array[5])
    talk.refused(message.read(1, 2, array[6]), NO_SUBINDEX)
    talk.refused(message.read(1, 2, array[4]), NO_SUBINDEX)
    talk.refused(message.read(1, 2, array[7]), NO_SUBINDEX)
    assert offered(told[5]) is None
    assert offered(near) is None
    assert offered(told[3]) == message.read(1, 2, array[3])


def test_what_ends_where_a_refused_range_ended_is_behind_the_end() -> None:
    talk = Talk()
    talk.read(message.address(2902), axis=2)
    told = missing(talk, message.address(2902, 4))
    talk.refused(message.read(1, 2, message.address(2902, 3, 2)), NO_SUBINDEX)
    assert offered(told) is None


@pytest.mark.parametrize("part", [False, True])
def test_the_response_to_a_change_shows_that_there_is_the_drive_object(part: bool) -> None:
    talk = Talk()
    talk.read(SPEED, axis=2)
    told = missing(talk)
    asked = change((FIXED, TEN), (OTHER, TEN), axis=3)
    if part:
        talk.refused(asked, 0, 0x11)
    else:
        talk.closed(asked, message.changed(1, 3, 2))
    assert offered(told) is None  # of two drive objects none is chosen


# About lengths (DS712, DS713)


def test_the_longest_response_of_the_device_is_room_that_it_has() -> None:
    asked = message.read(1, 1, *[message.address(2902, 0, 40)] * 2)
    forty = message.real(*range(40))
    talk = Talk()
    told = only(talk.closed(asked, message.answer(1, 1, 1, forty)), "DS713")
    assert (told.args["room"], told.args["limit"]) == ("room_seen", 166)
    assert offered(told) == message.read(1, 1, message.address(2902, 0, 40))
    fifty = message.read(1, 1, message.address(2903, 0, 75))
    talk.closed(fifty, message.answer(1, 1, 1, message.real(*range(75))))
    talk.read(FIXED)
    told = only(talk.closed(asked, message.answer(1, 1, 1, forty)), "DS713")
    assert told.args["limit"] == 306
    assert talk.closed(asked, message.answer(1, 1, 1, forty), device="e")[0].args["limit"] == 166


@pytest.mark.parametrize(
    ("address", "found", "limit"),
    [
        (message.address(974), message.word(200), 200),
        (message.address(974, 0, 2), message.word(200, 3), 200),
        (message.address(974, 1), message.word(200), None),
        (message.address(974), message.word(0), None),
        (message.address(974), message.real(200.5), None),
        (message.address(975), message.word(200), None),
    ],
)
def test_r0974_is_the_longest_message_of_the_device(
    address: bytes, found: bytes, limit: int | None
) -> None:
    talk = Talk()
    for value in (message.word(190) if limit else found, found):
        talk.read(address, value)
    asked = message.read(1, 1, *[message.address(2902, 0, 40)] * 2)
    told = only(talk.closed(asked, message.answer(1, 1, 1, message.real(*range(40)))), "DS713")
    expected = ("room_seen", 166) if limit is None else ("room_stated", limit)
    assert (told.args["room"], told.args["limit"]) == expected


def test_room_is_counted_by_what_was_read_not_by_the_list() -> None:
    """r2902 is a Float32 by the list of parameters; on this drive nobody has seen that."""
    talk, asked = Talk(), message.read(1, 1, message.address(2902, 0, 255))
    refused = message.answer(1, 0x81, 1, message.error(0x15))
    for fits in (None, 58):
        told = only(talk.closed(asked, refused), "DS713")
        assert told.args["fits"] == fits
        talk.read(message.address(2902))


def test_a_limit_of_0_is_none() -> None:
    talk = Talk()
    talk.read(message.address(974), message.word(200))
    talk.read(message.address(974), message.word(0))
    asked = message.read(1, 1, *[message.address(2902, 0, 40)] * 2)
    told = only(talk.closed(asked, message.answer(1, 1, 1, message.real(*range(40)))), "DS713")
    assert told.args["limit"] == 200


# What is looked at


def test_a_usual_transaction_says_nothing() -> None:
    talk = Talk()
    assert talk.read(FIXED) == []
    assert talk.closed(change((FIXED, TEN)), message.changed(1, 1)) == []
    assert talk.closed(change((FIXED, message.real(1e31))), message.changed(1, 1)) == []


def test_a_request_that_ends_too_soon_is_told_though_the_drive_accepted_it() -> None:
    asked = change((FIXED, TEN))[:-2]
    assert [each.rule for each in Talk().closed(asked, message.changed(1, 1))] == ["DS711"]


def test_nothing_is_said_of_a_response_whose_request_was_not_captured() -> None:
    case = job(None, message.answer(1, 1, 1, TEN))
    assert Diagnoses(Options()).closed(case) == []


def test_the_order_of_frames_comes_before_the_cause() -> None:
    talk = Talk()
    case = job(message.read(1, 1, FIXED), message.answer(1, 0x81, 1, message.error(0x11)))
    case.rereads, case.reread_cause = [(None, case.read_response)], "again"  # type: ignore[list-item]
    assert [each.rule for each in talk.diagnoses.closed(case)][:1] == ["DS704"]


# Memory is bounded


def test_the_oldest_format_is_forgotten_first(monkeypatch: pytest.MonkeyPatch) -> None:
    facts = known().but(history=2)
    monkeypatch.setattr(diagnosis, "known", lambda: facts)
    monkeypatch.setattr("ds47.profidrive.drive_objects.known", lambda: facts)
    talk = Talk()
    for where in (FIXED, OTHER, SPEED):
        talk.read(where)
    told = only(talk.refused(change((FIXED, BITS)), FORMAT), "DS714")
    assert told.args["seen"] is None
    told = only(talk.refused(change((OTHER, BITS)), FORMAT), "DS714")
    assert told.args["seen"] == 8


# What is known already

AGAIN, SAME = message.read(2, 1, FIXED), message.answer(2, 1, 1, TEN)


@pytest.mark.parametrize(
    ("asked", "answer", "more", "known"),
    [
        (AGAIN, SAME, {}, True),
        (AGAIN, SAME, {"at": LOCAL}, False),
        (AGAIN, SAME, {"rereads": [(None, Half(9, 9))]}, False),
        (AGAIN, message.answer(2, 1, 1, BITS), {}, False),
        (message.read(2, 2, FIXED), message.answer(2, 1, 2, TEN), {}, False),
        (message.read(2, 1, OTHER), SAME, {}, False),
        (AGAIN, message.answer(2, 0x81, 1, message.error(0)), {}, False),
        (change((FIXED, TEN)), message.changed(1, 1), {}, False),
    ],
    ids=["the same", "place", "reread", "format", "axis", "parameter", "error", "change"],
)
def test_a_read_that_shows_nothing_new_is_known(
    asked: bytes, answer: bytes, more: dict[str, Any], known: bool
) -> None:
    judge = Judge(limits(), limits().slow_ns, lambda *_: False)
    diagnoses = Diagnoses(Options(), None, judge.shown)
    first = job(message.read(1, 1, FIXED), message.answer(1, 1, 1, TEN))
    later = job(asked, answer, frame=5, **more)
    for each in (first, later):
        for hear in (judge.answered, judge.closed, diagnoses.closed, diagnoses.over):
            hear(each)
    assert (first.shows_nothing_new, later.shows_nothing_new) == (False, known)
