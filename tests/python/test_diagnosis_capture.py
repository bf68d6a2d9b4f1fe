"""Diagnoses of the whole capture (diagnosis/capture): DS703, DS706 to DS708, DS710, DS721, DS725.

Jobs are made by hand, each with the frames that it has; the sentences are those of docs/diagnoses.md.
"""

from __future__ import annotations

from typing import Any

import pytest
from talk import job

from ds47.acyclic.judge import is_mismatch
from ds47.acyclic.pairing import STATUS_NOT_READY, Job
from ds47.diagnosis import capture
from ds47.diagnosis.capture import WholeCapture
from ds47.lab import message
from ds47.profidrive import decode_request, decode_response, drive_objects
from ds47.profinet.completeness import Completeness, Missing, Numbers
from ds47.profinet.records import Half, Peer, Record
from ds47.profinet.rpc import Pdu
from ds47.spec.semantics import known

SPEED, FIXED, TEN = message.address(21), message.address(2900), message.real(10.0)
READ, CHANGE = message.read(1, 1, SPEED), message.change(1, 1, (FIXED, TEN))
ANSWER = message.answer(1, 1, 1, TEN)
HERE, THERE, LOCAL = (1, 1, 47), (1, 2, 47), (2, 1, 0xB02E)
BEGINS = Missing("begins")
NO_SLOT, DENIED, LOCKED = 0xDF80B200, 0xDF80B600, 0xDF80C200
Place = tuple[int, int, int]
Told = tuple[str, int, dict[str, Any]]


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memories of two entries, of two stations two things each."""
    facts = known().but(history=2, of_pair=2)
    for room in (capture, drive_objects):
        monkeypatch.setattr(room, "known", lambda: facts)


class Whole:
    """A capture of which one thing after the other is told."""

    def __init__(self, *jobs: Job, lacks: Completeness | None = None) -> None:
        self.capture = WholeCapture(lacks)
        self.jobs(*jobs)

    def jobs(self, *jobs: Job) -> Whole:
        for each in jobs:
            self.capture.asked(each)
            self.capture.closed(each)
        return self

    def idle(
        self, frame: int, at: Place = THERE, status: int | None = STATUS_NOT_READY,
        device: str = "d", controller: str = "c", ar: bytes | None = bytes(range(16)),
        missing: Missing | None = None,
    ) -> Whole:  # fmt: skip
        """A Read without record, on a channel that has no request; without an AR a ReadImplicit."""
        record = Record(False, ar is None, ar or bytes(16), 0, *at, 0)
        record.response = Half(frame, frame, status=status)
        self.capture.nothing_to_read(record.of(Peer(controller, device, 0x2A, 0x501)), missing)
        return self

    def foreign(
        self, frame: int, index: int, data: bytes | None = READ, status: int | None = LOCKED,
        answered: bool = True, device: str = "d",
    ) -> Whole:  # fmt: skip
        """A Write that is no transaction."""
        record = Record(True, False, bytes(16), 0, 1, 1, index, 0)
        record.request = None if data is None else Half(frame, frame, data)
        record.response = Half(frame + 1, frame + 1, status=status) if answered else None
        self.capture.foreign(record.of(Peer("c", device, 0x2A, 0x501)))
        return self

    def end(self, *, gaps: bool = False, dropped: int | None = None) -> list[Told]:
        found = self.capture.finish(dropped, gaps)
        return [(each.rule, each.frame, each.args) for each in found]

    def of(self, rule: str, **more: Any) -> list[Told]:
        return [each for each in self.end(**more) if each[0] == rule]


def place(at: Place) -> dict[str, int]:
    return dict(zip(("slot", "subslot", "index"), at, strict=True))


def of_api(api: int, *args: Any, **more: Any) -> Job:
    made = job(*args, **more)
    made.record.api = api
    return made


def refused(asked: bytes, status: int, frame: int = 1, at: Place = HERE, **more: Any) -> Job:
    return job(asked, frame=frame, at=at, write_response=Half(frame + 1, 1, status=status), **more)


# Requests here, Reads there (DS706)


def there(read: int, request: int = 1, other: Place = THERE) -> Told:
    return (
        "DS706", read,
        {"device": "d", "request": request, "frame": read, "place": place(HERE),
         "other": place(other)},
    )  # fmt: skip


def test_a_request_here_and_a_read_for_nothing_there() -> None:
    assert Whole(job(READ)).idle(4).end() == [there(4)]


def test_a_request_here_and_its_response_there() -> None:
    assert Whole(job(READ), job(None, ANSWER, frame=5, at=THERE)).end() == [there(8)]


def test_before_the_capture_something_may_have_been_asked_there() -> None:
    """One Read proves nothing then; that the next response is looked for there, too, does."""
    two = job(READ, superseded_by=10), job(READ, frame=10)
    assert Whole(two[0]).idle(4, missing=BEGINS).of("DS706") == []
    assert Whole(*two).idle(4, missing=BEGINS).of("DS706") == []
    assert Whole(*two).idle(4, missing=BEGINS).idle(8, missing=BEGINS).of("DS706") == []
    assert Whole(*two).idle(4, missing=BEGINS).idle(14, missing=BEGINS).of("DS706") == [there(4)]
    other = Whole(*two).idle(4, missing=BEGINS).idle(14, (3, 1, 47), missing=BEGINS)
    assert other.of("DS706") == []


def test_another_program_reads_for_itself() -> None:
    assert Whole(job(READ)).idle(4, ar=bytes(16)).of("DS706") == []
    assert Whole(job(READ)).idle(4, ar=None).of("DS706") == [there(4)]


@pytest.mark.parametrize(
    "answer", [message.answer(2, 1, 1, TEN), message.answer(1, 1, 2, TEN), b""]
)
def test_the_response_there_is_that_of_the_request(answer: bytes) -> None:
    assert Whole(job(READ), job(None, answer, frame=5, at=THERE)).of("DS706") == []


def test_the_response_is_looked_for_before_reads_for_nothing() -> None:
    told = Whole(job(READ), job(None, ANSWER, frame=5, at=(3, 1, 47))).idle(4).end()
    assert told == [there(8, other=(3, 1, 47)), ("DS703", 4, {"count": 1, "device": "d"})]


def test_what_was_refused_or_read_is_not_open() -> None:
    for case in (refused(READ, LOCKED), job(READ, ANSWER), job(READ, write_refused=True)):
        assert Whole(case).idle(6).of("DS706") == []


def test_reads_before_the_request_or_after_the_next_one_are_not_for_it() -> None:
    assert Whole(job(READ, frame=10)).idle(4).of("DS706") == []
    assert Whole(job(READ, superseded_by=5)).idle(6).of("DS706") == []
    assert Whole(job(READ, superseded_by=5)).idle(4).of("DS706") == [there(4)]
    late = Whole(job(READ, frame=10)).idle(4).idle(14, (3, 1, 47))
    assert late.of("DS706") == [there(14, 10, (3, 1, 47))]


@pytest.mark.parametrize("at", [HERE, THERE])
def test_a_read_where_something_is_asked_may_be_for_that(at: Place) -> None:
    """Also where the request was seen by its response only."""
    assert Whole(job(READ), job(READ, ANSWER, frame=20, at=at)).idle(4, at).of("DS706") == []
    if at == THERE:
        unseen = Whole(job(READ)).idle(4)
        unseen.capture.foreign(Record(True, False, b"", 0, *at, 0).of(Peer("c", "d", 0x2A, 0x501)))
        assert unseen.of("DS706") == []


def test_another_api_is_no_other_place_as_none_is_told() -> None:
    assert Whole(of_api(0x3A00, READ)).idle(4, HERE).of("DS706") == []


def test_where_frames_are_missing_the_request_may_be_among_them() -> None:
    assert Whole(job(READ)).idle(4).end(gaps=True) == [("DS703", 4, {"count": 1, "device": "d"})]


def test_each_place_is_told_once() -> None:
    """Two requests here; the Reads at one place there belong to the first of them."""
    two = Whole(job(READ, superseded_by=10), job(READ, frame=10)).idle(4).idle(14)
    assert two.end() == [there(4)]
    more = Whole(job(READ, superseded_by=10), job(READ, frame=10)).idle(4).idle(14, (3, 1, 47))
    assert more.end() == [there(4), there(14, 10, (3, 1, 47))]


def test_other_stations_read_for_something_else() -> None:
    assert Whole(job(READ)).idle(4, controller="e").of("DS706") == []
    assert Whole(job(READ)).idle(4, device="e").of("DS706") == []


def test_of_requests_and_reads_the_first_ones_are_kept(small: None) -> None:
    opened = [job(READ, frame=10 * number, superseded_by=10 * number + 10) for number in (1, 2, 3)]
    assert Whole(*opened).idle(25).of("DS706") == [there(25, 20)]
    assert Whole(*opened).idle(35).of("DS706") == []
    reads = Whole(job(READ, frame=10)).idle(1).idle(2, (3, 1, 47)).idle(14, (4, 1, 47))
    assert reads.of("DS706") == []


# Reads for nothing (DS703)


def test_reads_for_nothing_are_counted_for_each_device() -> None:
    whole = Whole(job(READ, ANSWER)).idle(9).idle(7).idle(8, controller="e").idle(5, device="x")
    assert whole.end() == [
        ("DS703", 7, {"count": 3, "device": "d"}), ("DS703", 5, {"count": 1, "device": "x"}),
    ]  # fmt: skip


def test_other_refused_reads_are_no_reads_for_nothing() -> None:
    assert Whole(job(READ, ANSWER)).idle(9, status=LOCKED).idle(9, status=None).end() == []
    record = Record(False, False, bytes(16), 0, *HERE, 0)
    whole = Whole(job(READ, ANSWER))
    whole.capture.nothing_to_read(record.of(Peer("c", "d", 0x2A, 0x501)), None)
    assert whole.end() == []


def test_one_station_that_is_not_explained_leaves_the_device_unexplained() -> None:
    told = Whole(job(READ)).idle(4).idle(5, controller="e").end()
    assert told == [there(4), ("DS703", 4, {"count": 2, "device": "d"})]


def test_of_more_reads_than_are_kept_not_each_is_explained(small: None) -> None:
    assert Whole(job(READ)).idle(4).of("DS703") == []
    assert Whole(job(READ)).idle(4).idle(5).of("DS703") == [
        ("DS703", 4, {"count": 2, "device": "d"})
    ]


def test_the_oldest_device_is_forgotten_first(small: None) -> None:
    whole = Whole(job(READ, ANSWER)).idle(4, device="x").idle(5, device="y")
    assert [args["device"] for _, _, args in whole.end()] == ["x", "y"]
    assert [args["device"] for _, _, args in whole.idle(6, device="z").end()] == ["y", "z"]


# Another record index (DS707)


def test_a_request_to_another_index_is_told_once_for_each_device_and_index() -> None:
    whole = Whole(job(READ, ANSWER)).foreign(9, 100).foreign(5, 100).foreign(7, 101)
    args = {"index": 100, "device": "d", "status": "DF80C200"}
    assert whole.end() == [("DS707", 5, args), ("DS707", 7, {**args, "index": 101})]


@pytest.mark.parametrize(
    ("index", "more", "told"),
    [
        (100, {}, True),
        (100, {"status": 0}, False),  # who accepts it has another use for it
        (71, {"status": 0}, True),  # 16#47 typed for 47
        (71, {"status": None}, True),
        (100, {"answered": False}, False),
        (100, {"data": READ + b"\0\1"}, False),  # that is no request
        (100, {"data": message.read(0, 1, SPEED)}, False),
        (100, {"data": b"\1"}, False),
        (100, {"data": message.read(1, 1, *[SPEED] * 39)}, True),  # 238 bytes
        (
            100,
            {"data": message.change(1, 1, *[(FIXED, TEN)] * 19, (FIXED, message.word(1)))},
            False,
        ),
    ],
)
def test_what_looks_like_a_request_was_meant_for_the_channel(
    index: int, more: dict[str, Any], told: bool
) -> None:
    assert len(Whole(job(READ, ANSWER)).foreign(5, index, **more).of("DS707")) == told


@pytest.mark.parametrize(("values", "told"), [(228, True), (229, False)])
def test_a_channel_takes_240_bytes(values: int, told: bool) -> None:
    """4 + 6 + 2 bytes before so many single ones, and a pad."""
    block = message.raw_block(5, values, bytes(values))
    data = message.change(1, 1, (message.address(2900, 0, values), block))
    whole = Whole(job(READ, ANSWER)).foreign(5, 100, data)
    assert len(whole.of("DS707")) == told


# The slot (DS708)


def away(frame: int, status: str = "DF80B200", at: Place = THERE, other: Place = HERE) -> Told:
    return (
        "DS708", frame,
        {"device": "d", "place": place(at), "status": status, "other": place(other)},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("status", "told"),
    [
        (0xDF80B200, "DF80B200"), (0xDE80B200, "DE80B200"), (0xDF80B201, "DF80B201"),
        (0xDF80B600, "DF80B600"), (0xDF80B601, "DF80B601"), (0xDE80B600, None), (LOCKED, None),
    ],
)  # fmt: skip
def test_a_place_that_turns_requests_away_while_another_answers(
    status: int, told: str | None
) -> None:
    whole = Whole(refused(READ, status, 5, THERE), job(READ, ANSWER))
    assert whole.end() == ([] if told is None else [away(6, told)])
    idle = Whole(job(READ, ANSWER)).idle(9, status=status)
    assert idle.end() == ([] if told is None else [away(9, told)])


def test_a_read_that_is_turned_away_counts_too() -> None:
    case = job(READ, at=THERE, write_response=None, read_response=Half(4, 4, status=NO_SLOT))
    assert Whole(case, job(READ, ANSWER, frame=9)).end() == [away(4)]


def test_the_first_frame_and_its_status_are_told() -> None:
    """Transactions are not closed in the order of their frames."""
    cases = [
        refused(READ, DENIED, 15, THERE), refused(READ, NO_SLOT, 5, THERE),
        refused(READ, DENIED, 25, THERE), job(READ, ANSWER),
    ]  # fmt: skip
    assert Whole(*cases).end() == [away(6)]


def test_a_place_that_accepts_is_the_right_one() -> None:
    answers = job(READ, ANSWER, frame=20)
    accepted = job(READ, frame=30, at=THERE)
    read_only = job(None, ANSWER, frame=30, at=THERE)
    for takes in (accepted, read_only, of_api(0x3A00, READ, ANSWER, frame=30, at=THERE)):
        assert Whole(refused(READ, NO_SLOT, 5, THERE), takes, answers).of("DS708") == []
    nothing = job(READ, frame=30, at=THERE, write_response=None)
    for takes in (nothing, job(READ, b"", frame=30, at=THERE, write_response=None)):
        assert Whole(refused(READ, NO_SLOT, 5, THERE), takes, answers).of("DS708") == [away(6)]


@pytest.mark.parametrize(("status", "wrong"), [(0, False), (LOCKED, True), (None, True)])
def test_a_write_that_is_accepted_counts_though_its_request_is_not_in_the_capture(
    status: int | None, wrong: bool
) -> None:
    whole = Whole(refused(READ, NO_SLOT, 5, (1, 1, 100)), job(READ, ANSWER, at=THERE, frame=20))
    whole.foreign(30, 100, None, status)
    assert bool(whole.of("DS708")) is wrong


def test_only_a_place_that_answered_is_another_one() -> None:
    no = refused(READ, NO_SLOT, 5, THERE)
    assert Whole(no).end() == []
    assert Whole(no, job(READ, b"")).of("DS708") == []
    assert Whole(no, job(READ)).of("DS708") == []
    assert Whole(no, job(READ, ANSWER, device="e")).of("DS708") == []
    assert Whole(no, job(READ, ANSWER, at=(1, 2, 0xB02F))).of("DS708") == []  # the same subslot
    both = Whole(no, job(READ, ANSWER, at=(2, 2, 47)), job(READ, ANSWER, frame=20))
    assert both.of("DS708") == [away(6, other=(2, 2, 47))]
    assert Whole(no, job(READ, ANSWER, at=(2, 2, 47))).of("DS708") == [away(6, other=(2, 2, 47))]


def test_the_index_that_answered_first_is_named() -> None:
    first = job(READ, ANSWER, at=(1, 1, 0xB02F))
    whole = Whole(refused(READ, NO_SLOT, 5, THERE), first, job(READ, ANSWER, frame=20))
    assert whole.of("DS708") == [away(6, other=(1, 1, 0xB02F))]


# The axis byte (DS710)


def under(axis: int, frame: int, *blocks: bytes, at: Place = LOCAL, identifier: int = 1) -> Job:
    answer = message.answer(1, identifier, axis, *(blocks or (TEN,)))
    return job(message.read(1, axis, SPEED), answer, frame=frame, at=at)


def test_two_axes_that_answer_under_local_access_are_ignored_ones() -> None:
    told = Whole(under(3, 11), under(2, 1), under(3, 21), under(2, 31)).end()
    assert told == [("DS710", 14, {"axes": [2, 3], "device": "d", "place": place(LOCAL)})]


@pytest.mark.parametrize(
    "others",
    [
        [under(2, 11)],
        [under(0, 11)],  # axis 0 names no drive object
        [under(3, 11, message.error(0x19), identifier=0x81)],  # there is none of that number
        [under(3, 11, TEN, message.error(0x19), identifier=0x81)],
        [under(3, 11, at=(3, 1, 0xB02E))],
        [under(3, 11, at=HERE)],  # here the axis byte counts
        [job(message.read(1, 3, SPEED), frame=11, at=LOCAL)],
        [job(message.read(1, 3, SPEED), b"", frame=11, at=LOCAL)],
    ],
)
def test_one_axis_under_local_access_is_none_that_is_ignored(others: list[Job]) -> None:
    assert Whole(under(2, 1), *others).of("DS710") == []


@pytest.mark.parametrize("axis", [2, 9])
@pytest.mark.parametrize("frame", [0, 41])
def test_where_an_axis_does_not_exist_the_axis_counts(axis: int, frame: int) -> None:
    missing = under(axis, frame + 1, message.error(0x19), identifier=0x81)
    jobs = [under(2, 11), under(3, 21)]
    jobs.insert(0 if frame < 10 else 2, missing)
    assert Whole(*jobs).of("DS710") == []


def test_another_error_is_a_response_of_the_axis() -> None:
    told = Whole(under(2, 1), under(3, 11, message.error(0x01), identifier=0x81)).of("DS710")
    assert [args["axes"] for _, _, args in told] == [[2, 3]]


# Changes that are not saved (DS721)

SAVE_ALL, SAVE = (message.address(977), message.word(1)), (message.address(971), message.word(1))
VOLATILE = (message.address(944), message.word(1))
GOOD = message.changed(1, 1)


def changes(
    frame: int, *pairs: tuple[bytes, bytes], answer: bytes | None = GOOD, axis: int = 1, **more: Any
) -> Job:
    answer = message.changed(1, axis) if answer == GOOD else answer
    return job(message.change(1, axis, *(pairs or ((FIXED, TEN),))), answer, frame=frame, **more)


def unsaved(*cases: Job) -> tuple[int, int, int, int, int, str, str] | None:
    """Count, those whose outcome is unknown, drive objects, first and last frame; the two cases."""
    told = Whole(*cases).of("DS721")
    if not told:
        return None
    ((_, frame, args),) = told
    assert args["device"] == "d"
    names = ("count", "unknown", "targets")
    count, unknown, targets = (args[name] for name in names)
    return count, unknown, targets, frame, args["last"], args["case"], args["more"]


def test_changes_that_no_save_follows_are_lost() -> None:
    assert unsaved(changes(1), changes(5)) == (2, 0, 1, 1, 5, "unsaved_object", "all_known")
    two = (2, 0, 2, 1, 5, "unsaved_targets", "all_known")
    assert unsaved(changes(1), changes(5, axis=2)) == two


def test_a_save_saves_its_drive_object_or_all() -> None:
    assert unsaved(changes(1), changes(5, SAVE)) is None
    assert unsaved(changes(1), changes(5, SAVE_ALL, axis=2)) is None
    left = (1, 0, 1, 1, 1, "unsaved_object", "all_known")
    assert unsaved(changes(1), changes(5, SAVE, axis=2)) == left
    assert unsaved(changes(5, SAVE), changes(1)) is None
    assert unsaved(changes(1, SAVE), changes(5)) == (1, 0, 1, 5, 5, "unsaved_object", "all_known")


def test_in_one_request_the_save_saves_what_stands_before_it() -> None:
    both_done = changes(1, (FIXED, TEN), SAVE)
    assert unsaved(both_done) is None
    assert unsaved(both_done, changes(11)) == (1, 0, 1, 11, 11, "unsaved_object", "all_known")
    assert unsaved(changes(1, SAVE, (FIXED, TEN))) is not None
    both = message.answer(1, 0x82, 1, message.done(), message.error(0x11))
    assert unsaved(changes(1, (FIXED, TEN), SAVE, answer=both)) is not None


def test_a_save_that_may_have_failed_leaves_it_unknown() -> None:
    known_one = unsaved(changes(1), changes(5, SAVE, answer=None))
    assert known_one is None or known_one[1] == known_one[0]
    assert unsaved(changes(1, (FIXED, TEN), SAVE, answer=None)) == unsaved(
        changes(1, (FIXED, TEN), answer=None)
    )


@pytest.mark.parametrize(
    ("case", "lost"),
    [
        (changes(1), True),
        (changes(1, VOLATILE), False),
        (changes(1, (message.address(5123), TEN)), True),
        (changes(1, answer=message.answer(1, 0x82, 1, message.error(0x11))), False),
        (changes(1, answer=message.header(1, 0x80, 1, 0)), False),  # the drive knows no changes
        (changes(1, write_response=Half(2, 2, status=LOCKED)), False),
        (job(READ, ANSWER), False),
    ],
)
def test_what_was_not_changed_is_not_lost(case: Job, lost: bool) -> None:
    seen = changes(11)
    told = unsaved(case, seen)
    assert told is not None
    assert told[:2] == (1 + lost, 0)


def test_of_several_parameters_those_count_that_were_changed() -> None:
    pairs = ((FIXED, TEN), (message.address(2901), TEN))
    half = message.answer(1, 0x82, 1, message.done(), message.error(0x11))
    assert unsaved(changes(1, *pairs, answer=half)) == (
        1,
        0,
        1,
        1,
        1,
        "unsaved_object",
        "all_known",
    )
    none = message.answer(1, 0x82, 1, message.error(0x11), message.error(0x11))
    assert unsaved(changes(1, *pairs, answer=none)) is None


def cut(frame: int, shown: int, answer: bytes | None, *pairs: tuple[bytes, bytes]) -> Job:
    """A change of which the capture has the first bytes alone."""
    data = message.change(1, 1, *(pairs or ((FIXED, TEN), SAVE_ALL)))
    made = job(data, answer, frame=frame)
    made.write_request = Half(
        frame, frame, data[:shown], len(data), len(data) - shown, cut=shown < len(data)
    )
    made.message = decode_request(data[:shown], cut=True)
    made.response = None if answer is None else decode_response(answer, made.message)
    made.stray = is_mismatch(made)
    return made


REFUSED = message.answer(1, 0x82, 1, message.done(), message.error(0x11))
HALF_DONE = message.answer(1, 0x82, 1, message.error(0x11), message.done())
DONE = message.changed(1, 1, 2)


@pytest.mark.parametrize(
    ("shown", "answer"),
    [(15, DONE), (10, DONE), (10, None), (10, HALF_DONE), (10, HALF_DONE[:8]), (4, DONE), (1, DONE), (0, None)],
)  # fmt: skip
def test_what_the_capture_cut_off_a_change_may_be_a_save(shown: int, answer: bytes | None) -> None:
    assert unsaved(changes(1), cut(5, shown, answer)) is None
    assert unsaved(cut(1, shown, answer), changes(5)) == (
        1, 1, 1, 5, 5, "unsaved_object", "some_unknown",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("shown", "answer"),
    [(10, REFUSED), (16, HALF_DONE), (10, message.header(1, 0x80, 1, 0)), (1, message.answer(1, 1, 1, TEN))],
)  # fmt: skip
def test_what_was_cut_off_and_not_changed_saves_nothing(shown: int, answer: bytes) -> None:
    """Refused, there after all, or of a read."""
    other = (FIXED, TEN), (message.address(2901), TEN)
    told = unsaved(changes(1), cut(5, shown, answer, *other))
    assert told is not None
    assert told[6] == "all_known"


def test_a_change_at_index_47_that_nothing_proves_may_be_a_save() -> None:
    whole = Whole(changes(1), changes(11, device="e"))
    whole.foreign(5, 47, CHANGE[:10], status=0)
    whole.foreign(15, 47, CHANGE[:10], device="e")
    assert [args["device"] for _, _, args in whole.of("DS721")] == ["e"]


@pytest.mark.parametrize(
    "answer",
    [None, message.answer(2, 2, 1), message.answer(1, 0x82, 1), message.header(1, 1, 1, 1)],
)
def test_whether_a_change_succeeded_may_be_unknown(answer: bytes | None) -> None:
    """Not read, the response to another request, or one that does not say it."""
    expected = (2, 1, 1, 1, 11, "unsaved_object", "some_unknown")
    told = unsaved(changes(1), changes(11, answer=answer))
    assert told is not None
    assert (told[0], told[6]) in {(1, "some_unknown"), (expected[0], "some_unknown")}


def test_a_response_to_a_change_that_was_not_captured_may_be_that_of_a_save() -> None:
    first = changes(1)
    for identifier in (0x02, 0x82):
        told = Whole(first, job(None, message.header(1, identifier, 1, 1), frame=11)).of("DS721")
        assert told == []
    for other in (
        job(None, ANSWER, frame=11),
        job(None, b"", frame=11),
        job(None, GOOD, frame=11, repeats=4),
    ):
        assert len(Whole(first, other).of("DS721")) == 1


def test_devices_are_told_apart() -> None:
    told = Whole(changes(1), changes(5, device="e"), changes(9, SAVE)).of("DS721")
    assert [args["device"] for _, _, args in told] == ["e"]


# Polling storms and held requests are those of `repetition`


def polls(count: int, frame: int = 1, at: Place = HERE) -> Job:
    each = [(Half(9, 9), Half(10, 10, status=STATUS_NOT_READY))] * count
    return job(READ, ANSWER, frame=frame, at=at, polls=each)


def test_polls_are_told_and_a_transaction_without_any_ends_a_storm() -> None:
    assert len(Whole(polls(10), polls(10), polls(10)).of("DS724")) == 1
    assert Whole(polls(10), polls(10), job(READ, ANSWER), polls(10)).of("DS724") == []


def test_requests_that_are_held_are_changes() -> None:
    held = [changes(100 * number) for number in range(1, 6)]
    assert [args["count"] for _, _, args in Whole(*held).of("DS723")] == [5]
    assert Whole(*[job(READ, ANSWER, frame=100 * number) for number in range(1, 6)]).end() == []


# What the capture does not have (DS725)


PAIR = {"controller": "c", "device": "d"}


def half(frame: int, what: str, **args: Any) -> Told:
    return "DS725", frame, {"what": what, **args}


def said(frame: int, seq: int = 0, *, answered: bool = False, opnum: int = 3) -> Pdu:
    """A request of the controller, or the response to one."""
    hosts = ("d", "c", 7, 34964, None) if answered else ("c", "d", 7, 49152, None)
    body = (b"", 0, frame, frame, *hosts, "c", "d")
    return Pdu(2 if answered else 0, True, bytes(16), bytes(16), seq, opnum, 0, True, False, *body)


def asked(*numbers: int) -> tuple[Completeness, Numbers]:
    """A controller that asks with these numbers, in the frames 1, 2 and so on."""
    lacks, first = Completeness(8), said(1, numbers[0])
    counted = Numbers(first)
    lacks.began(first, counted)
    for frame, number in enumerate(numbers[1:], 2):
        counted.add(said(frame, number))
    return lacks, counted


def test_dropped_and_cut_frames_are_counted() -> None:
    whole = Whole()
    for frame in (9, 7, 8):
        whole.capture.cut((frame, 140, 300))
    cut = half(7, "cut", count=3, bytes=140)
    assert whole.end(dropped=14) == [half(1, "dropped", count=14), cut]
    for size in (96, 140):
        whole.capture.cut((10, size, 300))
    assert whole.end()[0][2]["bytes"] is None
    assert Whole(job(READ, ANSWER)).end(dropped=0) == []


def test_one_direction_alone_is_told_with_the_first_frame() -> None:
    jobs = [job(READ, frame=frame, write_response=None) for frame in (3, 5)]
    lacks, numbers = asked(0, 1)
    assert Whole(*jobs, lacks=lacks).end() == [half(3, "only_requests", count=2, **PAIR)]
    numbers.waited = 1
    assert Whole(*jobs, lacks=lacks).end() == []
    alone = Completeness(8)
    alone.unasked(said(3, answered=True))
    answers = Whole(job(None, ANSWER, frame=3), lacks=alone)
    assert answers.end() == [half(6, "only_responses", count=1, **PAIR)]
    assert Whole(lacks=lacks).end() == []


def test_the_response_to_a_call_of_the_device_is_none_of_the_device() -> None:
    """That of the controller to ApplicationReady; the call itself is something that the device said."""
    ready = said(1, answered=True, opnum=4)
    ready.client, ready.server = "d", "c"
    for before in (True, False):
        lacks = Completeness(8)
        if before:
            lacks.unasked(ready)
        first = said(3)
        lacks.began(first, Numbers(first))
        if not before:
            lacks.unasked(ready)
        whole = Whole(job(READ, frame=3, write_response=None), lacks=lacks)
        assert [args["what"] for _, _, args in whole.end()] == ["only_requests"]
        lacks.began(ready, Numbers(ready))
        assert whole.end() == []


def test_numbers_that_are_missing_are_named() -> None:
    lacks, numbers = asked(5, 6, 8, 9, 12)
    numbers.waited = 1
    told = half(3, "gaps", numbers="7, 10..11", **PAIR)
    assert Whole(job(READ, ANSWER), lacks=lacks).end() == [told]
    numbers.add(said(6, 7))
    told = half(5, "gaps", numbers="10..11", **PAIR)
    assert Whole(job(READ, ANSWER), lacks=lacks).end() == [told]


def test_calls_with_one_half_are_counted() -> None:
    lacks, numbers = asked(5, 6)
    numbers.waited = 1
    lacks.lost(said(2, 6), went_on=False)
    assert Whole(job(READ, ANSWER), lacks=lacks).end() == []  # it was the last one
    lacks.lost(said(1, 5), went_on=True)
    lacks.unasked(said(9, 4, answered=True, opnum=2))
    told = half(1, "half_calls", count=2, **PAIR)
    assert Whole(job(READ, ANSWER), lacks=lacks).end() == [told]


def test_a_response_before_its_request_is_a_matter_of_the_order() -> None:
    lacks, numbers = asked(5, 6)
    numbers.waited = 1
    lacks.unasked(said(9, 7, answered=True))
    lacks.asked_after_all(said(9, 7, answered=True))
    told = half(9, "disorder", count=1)
    assert Whole(job(READ, ANSWER), lacks=lacks).end() == [told]


def test_small_steps_of_the_time_are_a_matter_of_the_order() -> None:
    whole = Whole(job(READ, ANSWER))
    for frame, milliseconds in ((9, 0.5), (7, 999.0), (5, 1000.0)):
        whole.capture.steps_back(frame, milliseconds)
    assert whole.end() == [half(7, "disorder", count=2)]


def test_reads_alone_are_told() -> None:
    reads = Whole(job(None, ANSWER, frame=3), job(None, ANSWER, frame=13))
    assert reads.end() == [half(6, "no_write", count=2, **PAIR)]
    begun = half(6, "file_begins", count=2, **PAIR)  # a request before them is not there
    assert reads.jobs(job(READ, ANSWER, frame=20)).end() == [begun]
    assert Whole().end() == []


def test_what_was_asked_before_the_first_request_lies_before_the_begin() -> None:
    begun = half(6, "file_begins", count=1, **PAIR)
    late = job(None, ANSWER, frame=13)
    assert Whole(job(None, ANSWER, frame=3), job(READ, ANSWER, frame=9), late).end() == [begun]
    assert Whole(job(READ, ANSWER, frame=9), late).end() == []
    assert Whole(job(READ, ANSWER, frame=9)).idle(4, missing=BEGINS).end() == [
        half(4, "file_begins", count=1, **PAIR)
    ]
    assert Whole(job(READ, ANSWER, frame=9)).idle(4, missing=Missing("requests")).end() == []
    alone = job(None, ANSWER, frame=3)
    alone.previous = 1
    assert Whole(alone, job(READ, ANSWER, frame=9)).end() == []


def test_where_more_is_missing_or_out_of_order_it_need_not_lie_before_the_begin() -> None:
    jobs = job(None, ANSWER, frame=3), job(READ, ANSWER, frame=9)
    lacks, numbers = asked(5, 7)
    numbers.waited = 1
    assert [args["what"] for _, _, args in Whole(*jobs, lacks=lacks).end()] == ["gaps"]
    whole = Whole(*jobs)
    whole.capture.steps_back(5, 0.5)
    assert [args["what"] for _, _, args in whole.end()] == ["disorder"]
    at_another_place = Whole(job(READ, frame=1), job(None, ANSWER, frame=3, at=THERE))
    assert [rule for rule, _, _ in at_another_place.end()] == ["DS706"]


def open_job(frame: int, missing: Missing) -> Job:
    made = job(READ, frame=frame)
    made.missing = missing
    return made


def test_a_response_that_may_lie_behind_the_end() -> None:
    ends = Missing("ends")
    lacks, numbers = asked(5, 6)
    numbers.waited = 1
    whole = Whole(open_job(5, ends), open_job(3, ends), lacks=lacks)
    assert whole.end() == whole.end() == [half(3, "file_ends", count=2, **PAIR)]
    assert Whole(open_job(3, Missing("halves")), lacks=lacks).end() == []
    whole.capture.cut((10, 96, 300))  # the response may be what was cut
    assert [args["what"] for _, _, args in whole.end()] == ["cut"]
    alone = Whole(open_job(3, ends), lacks=asked(5, 6)[0])
    assert [args["what"] for _, _, args in alone.end()] == ["only_requests"]


@pytest.mark.parametrize("what", ["write_answer", "read_answer"])
def test_the_last_call_alone_may_have_its_response_behind_the_end(what: str) -> None:
    lacks, numbers = asked(5, 6)
    numbers.waited = 1
    last, other = open_job(2, Missing(what, 2)), open_job(1, Missing(what, 1))
    assert Whole(last, lacks=lacks).end() == [half(2, "file_ends", count=1, **PAIR)]
    assert Whole(other, lacks=lacks).end() == []
    both = Whole(open_job(1, Missing("ends")), last, lacks=lacks)
    assert both.end() == [half(1, "file_ends", count=2, **PAIR)]


# Memory is bounded


def test_only_so_many_indices_are_remembered(small: None) -> None:
    whole = Whole(job(READ, ANSWER)).foreign(5, 100).foreign(7, 101)
    assert [frame for _, frame, _ in whole.of("DS707")] == [5, 7]
    assert [frame for _, frame, _ in whole.foreign(9, 102).of("DS707")] == [7, 9]


def test_a_place_whose_request_is_open_is_not_elsewhere_though_that_is_forgotten(
    small: None,
) -> None:
    others = [job(READ, ANSWER, frame=20 * slot, at=(slot, 1, 47)) for slot in (5, 6)]
    assert Whole(job(READ), *others).idle(4, HERE).of("DS706") == []


def test_a_change_that_failed_takes_no_room(small: None) -> None:
    refusal = message.answer(1, 0x82, 1, message.error(0x11))
    cases = [changes(1, device="x"), changes(5, device="y"), changes(9, device="z", answer=refusal)]
    assert [args["device"] for _, _, args in Whole(*cases).of("DS721")] == ["x", "y"]
