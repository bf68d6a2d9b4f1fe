"""Judgement: what fits, whose time it was, and what is remembered of written values."""

from __future__ import annotations

import pytest
from talk import job

from ds47.acyclic.judge import Judge, Seen, asker, drive_time_ns, is_mismatch
from ds47.acyclic.pairing import Job
from ds47.findings.remark import Remark
from ds47.lab import message
from ds47.lab.client import BUSY
from ds47.profidrive import decode_request, decode_response
from ds47.profidrive.parameter import family_fits, kind_fits
from ds47.profinet.completeness import Missing
from ds47.profinet.records import Half
from ds47.spec.semantics import limits

LIMITS = limits()
MS = 1_000_000
RAMP, SPEED = message.address(1120), message.address(1121)
READ = message.read(1, 1, RAMP)
TEN, NINE = message.real(10.0), message.real(9.5)


def judge() -> Judge:
    return Judge(LIMITS, LIMITS.slow_ns, lambda *_: False)


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
    ("asked", "data", "fits"),
    [
        (
            READ,
            message.answer(7, 0x81, 1, message.error(0)),
            True,
        ),  # the reference is no part of it
        (READ, message.answer(1, 0x81, 9, message.error(0)), False),
        (READ, message.answer(1, 0x80, 1, message.error(0x21)), True),
        (READ, message.changed(1, 1), False),
        (READ, message.answer(1, 1, 1, TEN, TEN), False),
        (READ, b"\1\1\1", None),
        (READ[:3], message.answer(1, 1, 1, TEN), None),
    ],
    ids=["negative", "axis", "0x80", "family", "count", "no header", "no header asked"],
)
def test_kind_fits(asked: bytes, data: bytes, fits: bool | None) -> None:
    assert kind_fits(decode_request(asked), data) is fits


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


def test_a_request_that_ends_before_its_id_has_no_response_that_fits() -> None:
    assert is_mismatch(job(b"\1", b"\1\1"))


def cut(asked: bytes, answer: bytes, *, request: bool = False, response: bool = False) -> Job:
    """The capture cut off the end of the request, or of the response."""
    one = job(asked, answer)
    for half, is_cut in ((one.write_request, request), (one.read_response, response)):
        assert half is not None
        half.cut, half.missing = is_cut, 20 * is_cut
    one.message = decode_request(asked, cut=request)
    one.response = decode_response(answer, one.message, cut=response) if answer else None
    return one


@pytest.mark.parametrize(
    ("asked", "answer", "stray"),
    [(b"", b"\1", False), (b"\1", b"\1\1", False), (b"\1", b"\2\1", True), (READ[:2], b"\1\x81", False),
     (READ[:2], b"\1\2", True), (READ[:3], b"\1\1\1", False), (READ[:3], b"\1\1\2", True),
     (READ[:3], message.answer(1, 1, 1, TEN), False), (READ[:4], message.answer(1, 1, 1, TEN, TEN), True)],
)  # fmt: skip
def test_what_the_capture_cut_off_of_a_header_speaks_against_nothing(
    asked: bytes, answer: bytes, stray: bool
) -> None:
    assert is_mismatch(cut(asked, answer, request=True, response=True)) == stray


def test_only_that_of_which_the_capture_lacks_it() -> None:
    assert is_mismatch(cut(READ, b"\1", request=True))
    assert is_mismatch(cut(b"\1", b"\1\1", response=True))


@pytest.mark.parametrize(
    ("words", "found"), [(2, ["DS410"]), (4, ["DS410"]), (3, ["DS410"]), (1, []), (0, [])]
)
def test_an_error_number_that_is_cut_off_is_none(words: int, found: list[str]) -> None:
    answer = message.answer(1, 0x81, 1, message.error(2))[: 6 + words]
    assert rules(judge().answered(cut(READ, answer, response=True))) == found
    sent = message.answer(1, 0x81, 1, message.raw_block(0x44, 0, b""))
    assert rules(judge().answered(job(READ, sent))) == ["DS318", "DS410"], "it was sent without one"


def test_a_transaction_whose_record_is_cut_off_says_so() -> None:
    one = cut(READ, b"\1", response=True)
    one.missing = Missing("cut_off", 4)
    (remark,) = judge().answered(one)
    assert (remark.rule, remark.frame, remark.args["what"]) == ("DS110", 1, "cut_off")


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
    orphan = job(None, message.answer(1, 1, 1, TEN))
    assert drive_time_ns(orphan) is None
    orphan.write_response = Half(2, 2 * MS, status=0)
    assert drive_time_ns(orphan) is None  # of a Write that is not its own


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


def only(remarks: list[Remark], rule: str) -> Remark:
    """The one remark of a rule."""
    (found,) = [remark for remark in remarks if remark.rule == rule]
    return found


def orphan(*, implicit: bool, repeats: int | None = None, **more: object) -> Job:
    one = job(None, message.answer(1, 0x81, 1, message.error(0)), repeats=repeats, **more)  # type: ignore[arg-type]
    one.record.implicit = implicit
    return one


@pytest.mark.parametrize(
    ("one", "case", "found"),
    [
        (orphan(implicit=False), "unasked", ["DS403", "DS410"]),
        (orphan(implicit=False, previous=2), "unasked_behind", ["DS403", "DS410"]),
        (orphan(implicit=True), "unasked_without_ar", ["DS403", "DS410"]),
        (orphan(implicit=True, repeats=4), "unasked_again", ["DS403"]),
        (orphan(implicit=False, certain=False), None, ["DS410"]),
    ],
    ids=["unasked", "behind", "without AR", "again", "perhaps pushed out"],
)
def test_a_response_without_a_request_says_how_it_comes_to_stand_alone(
    one: Job, case: str | None, found: list[str]
) -> None:
    remarks = judge().answered(one)
    assert rules(remarks) == found
    if case is not None:
        assert only(remarks, "DS403").args == {"case": case} | (
            {"first": 2} if case == "unasked_behind" else {}
        )


def test_the_errors_of_a_response_with_a_request_are_told_though_it_was_read_before() -> None:
    one = job(READ, message.answer(1, 0x81, 1, message.error(2, 7)), repeats=4)
    remark = only(judge().answered(one), "DS410")
    expected = {
        "pnu": 1120,
        "subindex": 0,
        "code": 2,
        "info": 7,
        "vendor_id": 0x002A,
        "family": "sinamics",
    }
    assert (remark.args, remark.offset) == (expected, 4)


def many(count: int, answered: bool) -> Job:
    words = [message.real(number) for number in range(count)]
    asked = message.read(1, 1, *(message.address(2000 + number) for number in range(count)))
    return job(asked, message.answer(1, 1, 1, *words) if answered else None)


def test_a_number_of_parameters_that_the_device_takes_is_not_too_many() -> None:
    court = judge()
    assert "DS304" not in rules(court.unanswered(many(39, False), dropped=False))
    assert only(court.unanswered(many(40, False), dropped=False), "DS304").args == {
        "count": 40,
        "limit": 39,
    }
    assert "DS304" not in rules(court.answered(many(40, True)))  # it answers all of them


def test_974_says_how_many_parameters_the_device_takes() -> None:
    court = judge()
    asked = message.read(1, 1, message.address(974, 0, 3))
    court.answered(job(asked, message.answer(1, 1, 1, message.word(2000, 41, 7))))
    assert "DS304" not in rules(court.unanswered(many(41, False), dropped=False))
    remark = only(court.unanswered(many(42, False), dropped=False), "DS304")
    assert remark.args == {"count": 42, "limit": 41}


def test_974_from_1_on_says_how_many_parameters_and_no_length() -> None:
    court = judge()
    asked = message.read(1, 1, message.address(974, 1, 2))
    court.answered(job(asked, message.answer(1, 1, 1, message.word(41, 7))))
    assert rules(court.unanswered(many(41, False), dropped=False)) == ["DS401"]
    assert only(court.unanswered(many(42, False), dropped=False), "DS304").args["limit"] == 41


@pytest.mark.parametrize("value", [0, -1])
def test_974_without_a_number_teaches_nothing(value: int) -> None:
    court = judge()
    answer = message.answer(1, 1, 1, message.block(0x03, "h", value))
    court.answered(job(message.read(1, 1, message.address(974)), answer))
    assert rules(court.unanswered(job(READ), dropped=False)) == ["DS401"]


def test_974_in_the_answer_to_no_read_teaches_nothing() -> None:
    """Of a request with an unknown id nobody knows what its values are."""
    court = judge()
    asked = message.answer(1, 0x05, 2, RAMP, message.address(974))
    answer = message.answer(1, 0x85, 2, message.error(0), message.word(1))
    assert "DS410" in rules(court.answered(job(asked, answer)))
    assert rules(court.unanswered(job(READ), dropped=False)) == ["DS401"]


@pytest.mark.parametrize("lacking", [0, 20])
def test_the_length_of_a_change_that_the_capture_cut_off_is_no_other_one(lacking: int) -> None:
    court = judge()
    court.answered(change(TEN + TEN, answer=message.answer(1, 0x82, 1, message.error(0x18))))
    one = change(TEN)
    assert one.write_request is not None
    one.write_request.missing = lacking
    assert rules(court.answered(one)).count("DS419") == (not lacking)


def test_one_of_several_parameters_may_have_the_wrong_number_of_values() -> None:
    court = judge()
    two = message.change(1, 1, (SPEED, TEN), (RAMP, TEN + TEN))
    court.answered(job(two, message.answer(1, 0x82, 1, message.error(0x11), message.error(0x18))))
    accepted = job(two[: -len(TEN)], message.changed(1, 1, 2))
    assert rules(court.answered(accepted)) == ["DS419"]


def test_a_response_that_is_cut_before_its_id_tells_no_other_length() -> None:
    court = judge()
    court.answered(change(TEN + TEN, answer=message.answer(1, 0x82, 1, message.error(0x18))))
    one = change(TEN)
    assert one.read_response is not None
    one.read_response.cut, one.read_response.data = True, b"\x01"
    one.response = decode_response(b"\x01", one.message, cut=True)
    court.answered(one)
    assert "DS419" in rules(court.answered(change(TEN)))


def known(court: Judge, *, longest: int = 240, axis: int = -1) -> Job:
    """A usual job; what its response shows is known already."""
    one, way = job(READ, message.answer(1, 1, 1, TEN)), (1, 1, axis)
    court.shown.ways[asker(one, 1)] = 1, way
    court.shown.longest["d"] = longest
    court.shown.axes["d"] = frozenset((1,))
    court.shown.formats["d", way, 1120] = Seen(8, 1)
    assert court.answered(one) == court.closed(one) == []
    return one


def test_the_longest_response_of_a_device_shows_something_new() -> None:
    assert known(judge()).shows_nothing_new
    assert known(judge(), longest=10).shows_nothing_new
    assert not known(judge(), longest=9).shows_nothing_new


def test_an_axis_that_has_not_answered_yet_shows_something_new() -> None:
    assert known(judge(), axis=1).shows_nothing_new
    assert not known(judge(), axis=2).shows_nothing_new


def test_what_a_device_says_about_itself_is_never_usual() -> None:
    telegram = job(
        message.read(1, 1, message.address(922)), message.answer(1, 1, 1, message.word(1))
    )
    assert judge().answered(telegram) == []
    assert not telegram.usual


def test_974_may_say_1() -> None:
    court = judge()
    answer = message.answer(1, 1, 1, message.word(1))
    court.answered(job(message.read(1, 1, message.address(974)), answer))
    assert only(court.unanswered(job(READ), dropped=False), "DS316").args["limit"] == 1


def test_974_as_a_real_is_no_length() -> None:
    court = judge()
    answer = message.answer(1, 1, 1, message.real(1.0))
    court.answered(job(message.read(1, 1, message.address(974)), answer))
    assert rules(court.unanswered(job(READ), dropped=False)) == ["DS401"]


def test_as_long_as_the_device_takes_is_not_too_long() -> None:
    court = judge()
    answer = message.answer(1, 1, 1, message.word(len(READ)))
    court.answered(job(message.read(1, 1, message.address(974)), answer))
    assert rules(court.unanswered(job(READ), dropped=False)) == ["DS401"]
    too_long = only(court.unanswered(job(READ + b"\0"), dropped=False), "DS316")
    assert too_long.offset == 0


def test_the_devices_whose_longest_message_is_known_are_bounded() -> None:
    court = Judge(LIMITS.but(longest_messages=2), LIMITS.slow_ns, lambda *_: False)
    asked = message.read(1, 1, message.address(974))
    for device in ("first", "second", "first", "third"):
        court.answered(job(asked, message.answer(1, 1, 1, message.word(1)), device=device))
    told = {
        device: "DS316" in rules(court.unanswered(job(READ, device=device), dropped=False))
        for device in ("first", "second", "third")
    }
    assert told == {"first": True, "second": False, "third": True}


@pytest.mark.parametrize(
    ("elements", "got", "rule"),
    [(1, 1, None), (2, 1, "DS408"), (1, 2, "DS409"), (3, 2, "DS408"), (0, 1, None), (0, 2, None),
     (0, 0, "DS408"), (0, 3, None)],
)  # fmt: skip
def test_as_many_values_as_were_asked_for(elements: int, got: int, rule: str | None) -> None:
    asked = message.read(1, 1, message.address(2000, 0, elements))
    block = message.block(message.UNSIGNED16, "H", *range(got))
    found = [
        remark
        for remark in judge().answered(job(asked, message.answer(1, 1, 1, block)))
        if remark.rule in ("DS408", "DS409")
    ]
    assert rules(found) == ([] if rule is None else [rule])
    for remark in found:
        assert remark.args == {
            "asked": elements or 1, "got": got, "pnu": 2000, "family": "sinamics",
        }  # fmt: skip
        assert remark.offset == 4


def test_the_number_of_values_of_a_text_is_its_own() -> None:
    asked = message.read(1, 1, message.address(2000, 0, 1, attribute=message.TEXT))
    answer = message.answer(1, 1, 1, message.block(0x09, "B", *b"speed."))
    assert rules(judge().answered(job(asked, answer))) == []


@pytest.mark.parametrize("seen", [b"\1", b"\1\1", b"\1\1\1"])
def test_of_a_header_only_what_is_there_is_compared(seen: bytes) -> None:
    assert rules(judge().answered(job(READ, seen))) == ["DS315"]


def test_of_a_request_header_only_what_is_there_is_compared() -> None:
    found = rules(judge().answered(job(b"\1", message.answer(1, 1, 1, TEN))))
    assert not {"DS404", "DS405", "DS406", "DS407"} & set(found)


@pytest.mark.parametrize(
    ("answer", "rule", "args"),
    [
        (message.answer(2, 1, 1, TEN), "DS404", {"sent": 1, "got": 2}),
        (message.answer(1, 2, 1), "DS405", {"sent": 1, "got": 2}),
        (message.answer(1, 1, 3, TEN), "DS406", {"sent": 1, "got": 3}),
        (message.answer(1, 1, 1, TEN, TEN), "DS407", {"sent": 1, "got": 2}),
        (message.answer(1, 0x80, 1, message.error(0x21)), "DS418", {"id": 1}),
    ],
)
def test_a_response_that_is_not_the_mirror_of_its_request(
    answer: bytes, rule: str, args: dict[str, int]
) -> None:
    assert only(judge().answered(job(READ, answer)), rule).args == args


def polled(*times: tuple[int | None, int]) -> Job:
    """A read whose polls were asked and refused at these times, in nanoseconds; read at 4 ms."""
    polls = [
        (None if one is None else Half(3, one), Half(3, two, status=BUSY)) for one, two in times
    ]
    return job(READ, message.answer(1, 1, 1, TEN), polls=polls)


def test_polling_begins_with_the_first_request_that_is_there() -> None:
    limit = LIMITS.polling_ns
    at = 4 * MS - limit
    assert "DS205" not in rules(judge().answered(polled((at, at + 5), (at + 6, at + 7))))
    remark = only(judge().answered(polled((at - 1, at + 5), (at + 6, at + 7))), "DS205")
    assert remark.args == {"milliseconds": (limit + 1) / 1e6, "limit": 1000}
    assert "DS205" in rules(judge().answered(polled((None, at - 1))))
    assert "DS205" not in rules(judge().answered(polled((None, at))))


def test_as_many_polls_as_the_limit_are_a_note() -> None:
    times = [(MS, MS)] * LIMITS.polls
    assert only(judge().answered(polled(*times)), "DS204").args == {"count": LIMITS.polls}
    assert "DS204" not in rules(judge().answered(polled(*times[1:])))


def test_slow_is_told_in_milliseconds_and_only_of_a_response() -> None:
    one = job(READ, message.answer(1, 1, 1, TEN))
    assert one.read_response is not None
    one.read_response.time_ns = 2 * MS + LIMITS.slow_ns + MS
    remark = only(judge().answered(one), "DS416")
    assert remark.args == {"milliseconds": 1001.0, "limit": 1000}
    one.read_response.data, one.response = b"", None
    assert rules(judge().answered(one)) == []


def test_what_a_poll_without_its_request_says_of_the_drives_time() -> None:
    one = polled((None, MS))
    assert drive_time_ns(one) is None


@pytest.mark.parametrize(
    ("reason", "told"), [("", None), ("end", "end")], ids=["no reason", "reason"]
)
def test_why_there_is_no_response(reason: str, told: str | None) -> None:
    (remark,) = judge().unanswered(job(READ, reason=reason), dropped=True)
    assert remark.args == {"reason": told, "dropped": True}


def test_of_what_a_limit_pushed_out_no_response_is_missed() -> None:
    assert judge().unanswered(job(READ, limit="channels"), dropped=False) == []


def test_a_displaced_request_names_both_frames() -> None:
    (remark,) = judge().unanswered(job(READ, superseded_by=9), dropped=False)
    assert (remark.frame, remark.args) == (9, {"request": 1, "by": 9})


def test_the_same_reference_names_the_frame_before() -> None:
    one = job(READ, message.answer(1, 1, 1, TEN), previous_reference=1, previous=7)
    (remark,) = judge().answered(one)
    assert (remark.frame, remark.args) == (1, {"reference": 1, "first": 7})
    one.previous_reference = 2
    assert judge().answered(one) == []


def test_refusals_and_empty_reads_stand_at_their_frames() -> None:
    one = job(READ, read_response=Half(4, 4, status=0xDE80B700), empty_reads=[Half(3, 3)])
    found = judge().answered(one)
    assert [(remark.rule, remark.frame) for remark in found] == [("DS201", 4), ("DS207", 3)]
    assert found[0].args == {"status": "DE80B700"}
    assert judge().closed(one) == []
    one.write_response = Half(2, 2, status=0xDF80B500)
    (remark,) = judge().closed(one)
    assert (remark.rule, remark.frame, remark.job) == ("DS203", 2, one)


@pytest.mark.parametrize(("cut", "found"), [(False, ["DS315"]), (True, [])])
def test_what_the_capture_cut_off_is_no_fault_of_the_message(cut: bool, found: list[str]) -> None:
    one = job(READ, message.answer(1, 1, 1, TEN)[:-2])
    assert one.read_response is not None
    one.read_response.cut = cut
    assert rules(judge().answered(one)) == found


def test_974_that_says_no_parameters_leaves_the_usual_number() -> None:
    court = judge()
    asked = message.read(1, 1, message.address(974, 0, 2))
    court.answered(job(asked, message.answer(1, 1, 1, message.word(2000, 0))))
    remark = only(court.unanswered(many(40, False), dropped=False), "DS304")
    assert remark.args == {"count": 40, "limit": 39}
