"""Pairing: every row of spec/pairing.toml by the calls that cause it, and to whom a Read belongs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any
from uuid import UUID

import pytest
from talk import request

from ds47.acyclic.pairing import STATUS_SHORT, Job, Moment, Outcome, Pairing
from ds47.lab import message
from ds47.lab.client import BUSY, CONTROLLER_AR
from ds47.profinet.completeness import Completeness, Missing
from ds47.profinet.records import Half, Peer, Record
from ds47.spec.semantics import Limits, limits, phases

PEER = Peer("192.168.133.2", "192.168.133.33", 0x002A, 0x0501)
LIMITS = limits()
REFUSED = 0xDF80B500
ROWS = [(phase, event) for phase, events in phases().items() for event in events]


@dataclass
class Channel:
    """A pairing, its clock, and its outcomes."""

    bounds: Limits = LIMITS
    now: int = 0
    outcomes: list[Outcome] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.pairing = Pairing(self.bounds, self.outcomes)

    def heard(self, what: str) -> list[Any]:
        """The subjects of these outcomes, up to now."""
        return [about for each, about, _ in self.outcomes if each == what]

    @property
    def answered(self) -> list[Job]:
        return self.heard("answered")

    @property
    def closed(self) -> list[Job]:
        return self.heard("closed")

    @property
    def nothing(self) -> list[Record]:
        return self.heard("nothing")

    def half(self, data: bytes = b"", status: int | None = None) -> Half:
        self.now += 1
        return Half(self.now, self.now, data, len(data), status=status)

    def record(self, write: bool, ar: UUID = CONTROLLER_AR, slot: int = 1) -> Record:
        return Record(write, False, ar.bytes, 0, slot, 1, 47, 0, peer=PEER, may_be_ours=True)

    def ask(self, reference: int = 1, slot: int = 1) -> Job:
        data = message.read(reference, 1, message.address(21))
        record = self.record(True, slot=slot)
        record.request = self.half(data)
        return self.pairing.write_request(record, request(data))

    def written(self, job: Job, status: int | None = 0, fault: bool = False) -> None:
        self.pairing.write_response(job, self.half(status=status), fault=fault)

    def open(self, reference: int = 1, slot: int = 1) -> Job:
        job = self.ask(reference, slot)
        self.written(job)
        return job

    def read(
        self, data: bytes = b"", status: int | None = 0, slot: int = 1, missing: int = 0
    ) -> Job | None:
        """`missing`: so many bytes of the record the capture cut off."""
        record = self.record(False, slot=slot)
        record.request, record.response = self.half(), self.half(data, status)
        record.response.missing, record.response.cut = missing, missing > 0
        return self.pairing.read_response(record)

    def bring(self, reference: int = 1, value: float = 1.0) -> Job | None:
        return self.read(message.answer(reference, 1, 1, message.real(value)))


def in_phase(channel: Channel, phase: str) -> Job:
    job = channel.ask()
    if phase == "open":
        channel.written(job)
    elif phase == "refused":
        channel.written(job, REFUSED)
    elif phase == "answered":
        channel.bring()
    assert job.phase == phase
    return job


def cause(channel: Channel, job: Job, event: str) -> None:
    if event == "write_accepted":
        channel.written(job)
    elif event == "write_refused":
        channel.written(job, REFUSED)
    elif event in ("read_record", "reread"):
        channel.bring()
    elif event == "read_poll":
        channel.read(status=BUSY)
    elif event == "read_short":
        channel.read(status=STATUS_SHORT)
    elif event == "read_refused":
        channel.read(status=0xDE80B600)
    elif event == "read_empty":
        channel.read()
    elif event == "read_cut":
        channel.read(missing=20)
    elif event == "displaced":
        channel.open(2)
    else:
        channel.pairing.finish()


@pytest.mark.parametrize(("behind", "reason"), [(3, "release"), (5, "")])
def test_a_connect_ends_what_was_asked_before_it(behind: int, reason: str) -> None:
    """Of an AR that proves itself late the Connects are known first: this one may lie behind the next Write."""
    channel = Channel()
    job = channel.open()
    at = Moment(behind, behind)
    channel.pairing.connected(PEER.controller, PEER.device, at, CONTROLLER_AR.bytes)
    channel.now = 3
    newer = channel.open(2)
    asked = newer.write_request
    assert asked is not None
    assert asked.frame == 4
    assert (job.reason, job.superseded_by) == (reason, None if reason else 4)


def test_a_write_without_its_response_may_have_displaced_what_a_connect_ended() -> None:
    channel = Channel()
    job = channel.open()
    channel.ask(2)
    channel.now += 1
    at = Moment(channel.now, channel.now)
    channel.pairing.connected(PEER.controller, PEER.device, at, CONTROLLER_AR.bytes)
    channel.open(3)
    assert (job.missing and job.missing.what, job.superseded_by) == ("later", None)


@pytest.mark.parametrize(("lost", "what"), [(0, "ends"), (99, "line")])
def test_of_a_station_is_missing_what_its_line_shows(lost: int, what: str) -> None:
    """PROFIBUS has no calls: a Write without its answer was polled, and its answer may come yet."""
    outcomes: list[Outcome] = []
    pairing = Pairing(LIMITS, outcomes, Completeness(16, lambda _: lost))
    data = message.read(1, 1, message.address(21))
    half = Half(1, 1, data, len(data))
    peer = Peer("dp1", "dp3", station=3)
    record = Record(True, False, bytes(16), -1, 1, 0, 47, 0, half, None, peer, may_be_ours=True)
    job = pairing.write_request(record, request(data))
    pairing.finish()
    assert job.missing is not None
    assert job.missing.what == what


@pytest.mark.parametrize(("reads", "what"), [(False, "ends"), (True, "unseen")])
def test_of_a_station_that_was_read_behind_a_write_its_answer_comes_no_more(
    reads: bool, what: str
) -> None:
    """The record is that of the request before it; at the end of the capture nothing more is due."""
    channel, peer = Channel(), Peer("dp1", "dp3", station=3)
    jobs = []
    for reference in (1, 2):
        data = message.read(reference, 1, message.address(21))
        record = channel.record(True)
        record.request = channel.half(data)
        jobs.append(channel.pairing.write_request(record.of(peer), request(data)))
    channel.written(jobs[0])
    if reads:
        record = channel.record(False)
        answer = message.answer(1, 1, 1, message.real(1.0))
        record.request, record.response = channel.half(), channel.half(answer, 0)
        assert channel.pairing.read_response(record.of(peer)) is jobs[0]
    channel.pairing.finish()
    assert jobs[1].missing is not None
    assert jobs[1].missing.what == what


def test_a_refusal_as_too_short_is_not_the_end_where_the_record_may_have_come() -> None:
    """The Read behind it brings a record of which nobody knows whose it is."""
    channel = Channel()
    job = channel.open()
    channel.read(status=STATUS_SHORT)
    newer = channel.ask(2)
    assert newer is not None
    found = channel.read(message.answer(2, 1, 1, message.real(1.0)))
    assert (found, job.read_response) != (job, None)


@pytest.mark.parametrize(("phase", "event"), ROWS)
def test_every_row_of_the_table(phase: str, event: str) -> None:
    channel = Channel()
    channel.now += 1  # nothing was asked before the capture
    at = Moment(channel.now, channel.now)
    channel.pairing.connected(PEER.controller, PEER.device, at, CONTROLLER_AR.bytes)
    job = in_phase(channel, phase)
    cause(channel, job, event)
    ended = phases()[phase][event] == "answered" and event in ("read_refused", "read_cut")
    assert job.phase == ("closed" if ended else phases()[phase][event])
    assert channel.closed.count(job) == (job.phase == "closed")
    channel.pairing.finish()
    assert channel.closed.count(job) == 1


EVENTS = sorted({event for _, event in ROWS})


@pytest.mark.parametrize("event", EVENTS)
@pytest.mark.parametrize("phase", [*phases(), "closed"])
def test_what_the_table_does_not_list_is_an_error(phase: str, event: str) -> None:
    channel = Channel()
    job = channel.ask()
    job.phase = phase
    if event in phases().get(phase, {}):
        channel.pairing._end(job, event)
        assert job.phase == phases()[phase][event]
    else:
        with pytest.raises(KeyError):
            channel.pairing._end(job, event)


def test_the_life_of_a_read() -> None:
    channel = Channel()
    job = channel.open()
    assert channel.read(status=BUSY) is job
    assert channel.read() is job
    assert channel.bring() is job
    assert channel.answered == [job]
    assert channel.closed == []
    assert channel.bring() is job
    channel.pairing.finish()
    assert (len(job.polls), len(job.empty_reads), len(job.rereads)) == (1, 1, 1)
    assert (channel.answered, channel.closed) == ([job], [job])


def test_of_many_polls_the_first_and_the_newest_are_kept() -> None:
    channel = Channel(LIMITS.but(reads=3))
    job = channel.open()
    frames = []
    for _ in range(5):
        channel.read(status=BUSY)
        frames.append(channel.now)
    assert [answer.frame for _, answer in job.polls] == [*frames[:2], frames[-1]]


def test_a_read_before_the_write_response_only_presumes_acceptance() -> None:
    channel = Channel()
    job = channel.ask()
    channel.bring()
    assert (job.phase, job.write_response) == ("answered", None)
    channel.written(job)
    assert job.phase == "answered"
    assert job.write_response is not None


def test_an_accepted_write_displaces_the_open_one() -> None:
    channel = Channel()
    first, second = channel.open(1), channel.open(2)
    assert second.write_request is not None
    assert first.superseded_by == second.write_request.frame
    assert (channel.closed, second.previous_reference) == ([first], 1)


def test_a_refused_write_displaces_nothing() -> None:
    channel = Channel()
    first, second = channel.open(1), channel.ask(2)
    channel.written(second, REFUSED)
    assert channel.bring(1) is first
    assert channel.closed == [second]


def test_a_fault_refuses() -> None:
    channel = Channel()
    job = channel.ask()
    channel.written(job, None, fault=True)
    assert (job.phase, job.write_refused) == ("refused", True)


def test_a_write_response_without_status_changes_nothing() -> None:
    channel = Channel()
    job = channel.ask()
    channel.written(job, None)
    assert job.phase == "asked"


def test_a_read_finds_the_job_of_its_reference_among_unanswered_writes() -> None:
    channel = Channel()
    first, second = channel.ask(1), channel.ask(2)
    assert channel.bring(1) is first
    assert channel.bring(2) is second


def test_an_orphan_and_nothing_to_read() -> None:
    channel = Channel()
    assert channel.read(status=BUSY) is None
    assert channel.read() is None
    assert len(channel.nothing) == 2
    orphan = channel.bring()
    assert orphan is not None
    assert (orphan.message, orphan.write_request, orphan.reference) == (None, None, None)
    assert channel.answered == [orphan]


def test_channels_do_not_mix() -> None:
    channel = Channel()
    job = channel.open(slot=2)
    assert channel.bring() is not job
    assert job.phase == "open"


def sent_read(channel: Channel) -> Record:
    record = channel.record(False)
    record.request = channel.half()
    channel.pairing.read_request(record)
    return record


def test_of_the_reads_that_brought_nothing_a_job_has_the_first() -> None:
    channel = Channel()
    job = channel.open()
    first, second = sent_read(channel), sent_read(channel)
    for each in (second, first):
        channel.pairing.read_lost(each)
        assert job.read_request is first.request
    channel.pairing.read_lost(channel.record(False, slot=9))


def test_a_lost_read_belongs_to_no_request_that_came_after_it() -> None:
    """Nor to one that came before and was not the one that waited."""
    channel = Channel()
    early = sent_read(channel)
    job = channel.open()
    late = sent_read(channel)
    newer = channel.open()
    for each in (early, late):
        channel.pairing.read_lost(each)
    assert (job.read_request, newer.read_request) == (late.request, None)


@pytest.mark.parametrize("end", ["release", "expired", "end"])
def test_the_reason_of_a_job_without_response(end: str) -> None:
    channel = Channel()
    job = channel.open()
    if end == "release":
        channel.pairing.release("192.168.133.9", PEER.device, CONTROLLER_AR.bytes)
        assert job.phase == "open"
        channel.pairing.release(PEER.controller, PEER.device, CONTROLLER_AR.bytes)
    elif end == "expired":
        channel.now += LIMITS.transaction_expiry_ns + 1
        channel.open(2, slot=2)  # of another channel: time passes for all
    else:
        channel.pairing.finish()
    assert (channel.closed, job.reason, job.phase) == ([job], end, "closed")


def test_pending_writes_and_channels_are_bounded() -> None:
    channel = Channel(LIMITS.but(pending_writes=2, channels=2))
    first, *rest = [channel.ask(n) for n in (1, 2, 3)]
    assert channel.closed == [first]
    channel.open(4, slot=2)
    channel.open(5, slot=3)
    assert channel.closed == [first, *rest]


def test_unanswered_writes_of_all_channels_are_bounded() -> None:
    """The oldest goes, whichever channel it is on; those that were answered, or ended, do not count."""
    channel = Channel(LIMITS.but(unanswered_writes=2))
    oldest = channel.ask(1)
    for number in range(2, 9):
        channel.written(channel.ask(number, slot=2))
    accepted = list(channel.closed)
    other = channel.ask(10, slot=3)
    assert channel.closed == accepted
    newest = channel.ask(11, slot=4)
    assert channel.closed == [*accepted, oldest]
    assert (oldest.limit, other.phase, newest.phase) == ("unanswered_writes", "asked", "asked")
    channel.pairing.finish()
    assert not channel.pairing._unanswered


@pytest.mark.parametrize(
    ("missing", "own"), [(None, True), (Missing("calls", 2, 9, "5..9"), False)]
)
def test_a_record_is_for_a_refused_write_if_nothing_is_missing_behind_that(
    missing: Missing | None, own: bool
) -> None:
    """It mirrors the request: its reference never changes, and 0x80 answers any request."""
    channel = Channel()
    channel.pairing._missing_after = lambda *_, **__: missing
    job = channel.ask(reference=229)
    channel.written(job, status=0xDF80B600)
    assert (channel.bring(reference=229) is job) is own


def test_a_record_is_not_for_a_refused_write_where_the_open_request_was_set_aside() -> None:
    """A Read of the first one has no answer: whether it is over nobody knows, so the record may be its own."""
    channel = Channel()
    channel.open(reference=9)
    channel.bring(reference=9)
    channel.open(reference=1)
    read = channel.record(False)
    read.request = channel.half()
    channel.pairing.read_request(read)
    refused = channel.ask(reference=2)
    channel.written(refused, status=REFUSED)
    channel.read(status=BUSY)
    orphan = channel.bring(reference=1)
    assert orphan is not None
    assert orphan is not refused
    assert orphan.message is None
