"""Frames of a line to exchanges, and MS1 to the record calls that the pairing takes (docs/profibus.md 6)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.acyclic.pairing import Job, Outcome, Pairing
from ds47.acyclic.services import MOST_OPEN, MOST_POLLS, Became, ServiceCall, ServiceTracker
from ds47.profibus import telegram
from ds47.profibus.line import MOST_RETRIES, Exchange, Line, LineFrame
from ds47.profidrive import decode_request, decode_response
from ds47.profidrive.model import Options
from ds47.profinet.records import Peer, Record
from ds47.spec.semantics import limits

MS = 1_000_000
SHORT = b"\xe5"
ASKED, GIVEN = "030102011001c47f0000", "03010201080141200000"
"""A DS47 request for one parameter, and its response."""
WRITE, READ = "5f002f0a" + ASKED, "5e002ff0"
NOT_READY = "de80b500"


class Talk:
    """A master and its slave: each request toggles the frame count bit."""

    def __init__(self, station: int = 3, sap: int = 51, master: int = 2) -> None:
        self.frames: list[bytes] = []
        self._station, self._sap, self._master, self._fcb = station, sap, master, True

    def ask(self, du: str, repeated: bool = False) -> Talk:
        """A request of the master, or the same frame count bit again."""
        self._fcb ^= not repeated
        fc = 0x7D if self._fcb else 0x5D
        own = 51 if self._sap == 51 else 50
        data = telegram.encode(self._station, self._master, fc, bytes.fromhex(du), self._sap, own)
        self.frames.append(data)
        return self

    def skip(self) -> Talk:
        """A request that was not recorded, nor its answer."""
        self._fcb = not self._fcb
        return self

    def answer(self, du: str | None = None, fc: int = 0x08) -> Talk:
        """What the slave says with data; a short acknowledgement without."""
        own = 51 if self._sap == 51 else 50
        bare = fc in (1, 2, 3, 9)
        data = b"" if du is None else bytes.fromhex(du)
        saps = (None, None) if bare else (own, self._sap)
        with_data = telegram.encode(self._master, self._station, fc, data, *saps)
        self.frames.append(SHORT if du is None and not bare else with_data)
        return self

    def add(self, *frames: bytes) -> Talk:
        self.frames += frames
        return self


def exchanges(frames: Iterable[bytes], line: Line | None = None) -> list[Exchange]:
    line, found = line or Line(), []
    for number, data in enumerate(frames, start=1):
        found += line.take(LineFrame(number, number * MS, telegram.decode(data)))
    return [*found, *line.finish()]


def services(frames: Iterable[bytes]) -> list[Became]:
    tracker = ServiceTracker()
    told = [became for exchange in exchanges(frames) for became in tracker.take(exchange)]
    return told + tracker.finish()


class Heard:
    """Everything that is told of calls."""

    def __init__(self, frames: Iterable[bytes]) -> None:
        self.events: list[tuple[str, int]] = []
        self.calls: list[ServiceCall] = []
        self.unasked: list[ServiceCall] = []
        for what, call in services(frames):
            if what == "unasked":
                self.unasked.append(call)
                continue
            if what == "asked":
                self.calls.append(call)
            self.events.append((what, self.calls.index(call)))


# The line


def test_an_answer_belongs_to_the_request_before_it() -> None:
    status, known = telegram.encode(3, 2, 0x49), telegram.encode(2, 3, 0x00)
    (found,) = exchanges([status, known])
    assert (found.request.frame, found.answer and found.answer.frame) == (1, 2)
    assert (found.retries, found.again, found.silent) == ([], False, False)


def test_no_answer_and_retries() -> None:
    talk = Talk().ask(WRITE).ask(WRITE, repeated=True).ask(WRITE, repeated=True).answer().ask("")
    first, second = exchanges(talk.frames)
    assert (len(first.retries), first.answer and first.answer.frame) == (2, 4)
    assert (second.request.frame, second.answer) == (5, None)


def test_a_request_that_comes_again_after_its_answer() -> None:
    talk = (
        Talk().ask("").answer(NOT_READY).ask("", repeated=True).answer(NOT_READY).ask("").answer()
    )
    assert [each.again for each in exchanges(talk.frames)] == [False, True, False]


@pytest.mark.parametrize(("between", "retried"), [((), [1]), ((b"\xdc\x02\x02",), [0, 0])])
def test_a_first_request_is_repeated_at_once_or_not_at_all(
    between: tuple[bytes, ...], retried: list[int]
) -> None:
    first = telegram.encode(3, 2, 0x6D, b"", 60, 62)
    found = exchanges([first, *between, first, telegram.encode(2, 3, 0x08, b"", 62, 60)])
    assert [each.retried for each in found] == retried


def test_a_request_behind_one_that_was_not_seen_repeats_none() -> None:
    talk = Talk().ask("").answer().ask("").answer().ask("").answer()
    for at, replaced in ((2, b"\x10"), (2, b"\xdc\x02\x02")):
        line, frames = Line(), list(talk.frames)
        frames[at] = replaced
        assert [each.again for each in exchanges(frames, line)] == [False, False]
        assert line.stray == 1
    talk = Talk().ask("").answer("").ask("").answer("").ask("").answer()
    assert [each.again for each in exchanges([*talk.frames[:2], *talk.frames[3:]])] == [False] * 2


def test_an_answer_of_another_station_ends_no_retries() -> None:
    other = telegram.encode(2, 4, 0x08, b"", 51, 51)
    wrong_sap = telegram.encode(2, 3, 0x08, b"", 51, 50)
    talk = Talk().ask(WRITE).add(other, wrong_sap).ask(WRITE, repeated=True).answer()
    (found,) = exchanges(talk.frames)
    assert (found.retried, found.answer and found.answer.frame) == (1, 5)


def test_retries_without_end_are_counted() -> None:
    talk = Talk().ask(WRITE)
    for _ in range(MOST_RETRIES + 3):
        talk.ask(WRITE, repeated=True)
    (found,) = exchanges(talk.frames)
    assert (found.retried, len(found.retries)) == (MOST_RETRIES + 3, MOST_RETRIES)
    assert [each.frame for each in found.retries][:2] == [2, 3]


def test_what_nobody_answers_is_over_at_once() -> None:
    control = telegram.encode(127, 2, 0x46, b"\x20\x00", 58, 62)
    line = Line()
    assert [each.silent for each in exchanges([control, control], line)] == [True, True]


def test_a_request_is_repeated_behind_a_broadcast() -> None:
    """The master sends it before the retry: the request has its answer, and is none without."""
    control = telegram.encode(127, 2, 0x46, b"\x20\x00", 58, 62)
    talk = Talk().ask(WRITE).add(control).ask(WRITE, repeated=True).answer()
    broadcast, found = exchanges(talk.frames)
    assert (broadcast.silent, broadcast.request.frame) == (True, 2)
    assert (found.request.frame, found.retried, found.answer and found.answer.frame) == (1, 1, 4)
    last, first = exchanges(Talk().ask(WRITE).add(control).ask("").frames)[:2]
    assert (last.silent, first.answer, first.unfinished) == (True, None, False)


def test_what_is_counted() -> None:
    line, good = Line(), telegram.encode(2, 3, 0x00)
    damaged = good[:-1] + b"\x17"
    assert exchanges([b"\xdc\x02\x02", good, damaged, SHORT, b"\xdc\x02\x02"], line) == []
    assert (line.tokens, line.damaged, line.stray) == (2, 1, 2)


def test_an_answer_of_another_station_is_stray() -> None:
    line = Line()
    (found,) = exchanges([telegram.encode(3, 2, 0x49), telegram.encode(2, 4, 0x00)], line)
    assert (found.answer, line.stray) == (None, 1)


# Calls


def test_a_write_is_polled_until_it_is_answered() -> None:
    heard = Heard(Talk().ask(WRITE).answer().ask("").answer("").ask("").answer("5f002f0a").frames)
    assert heard.events == [("asked", 0), ("answered", 0)]
    (call,) = heard.calls
    assert (call.master, call.station, call.sap, len(call.polls)) == (2, 3, 51, 2)
    record = call.record
    assert (record.write, record.slot, record.index) == (True, 0, 47)
    assert record.request is not None
    assert record.response is not None
    assert (record.request.data.hex(), record.request.stated, record.request.missing) == (
        ASKED,
        10,
        0,
    )
    assert (record.response.frame, record.response.status, record.response.missing) == (6, 0, 0)


def test_a_read_and_a_refusal() -> None:
    talk = Talk().ask(READ).answer().ask("").answer(NOT_READY)
    talk.ask(READ).answer().ask("").answer("5e002f0a" + GIVEN)
    first, second = (call.record for call in Heard(talk.frames).calls)
    assert first.response is not None
    assert second.response is not None
    assert (first.response.status, first.response.data) == (0xDE80B500, b"")
    assert (second.response.status, second.response.data.hex()) == (0, GIVEN)
    assert second.request is not None
    assert (second.request.status, second.request.stated, second.request.missing) == (None, 240, 0)


@pytest.mark.parametrize("refusal", [{"du": NOT_READY}, {"fc": 3}])
@pytest.mark.parametrize("missing", [True, False])
def test_a_refusal_behind_a_hole_is_nobodys(refusal: dict[str, Any], missing: bool) -> None:
    """It names no place: the request that it refuses may be the one that is missing."""
    talk = Talk().ask(READ).answer()
    if missing:
        talk.skip()
    heard = Heard(talk.ask("").answer(**refusal).frames)
    end = "lost" if missing else "answered" if "du" in refusal else "failed"
    assert (heard.events, heard.unasked) == ([("asked", 0), (end, 0)], [])
    talk = Talk().ask(WRITE).answer().skip().ask(READ).answer().ask("").answer(NOT_READY)
    assert Heard(talk.frames).events[-1] == ("answered", 1)  # the hole is before its request


def test_a_request_that_comes_again_is_one_call() -> None:
    talk = Talk().ask(WRITE).answer().ask(WRITE, repeated=True).answer().ask("").answer("5f002f0a")
    assert Heard(talk.frames).events == [("asked", 0), ("answered", 0)]
    talk = (
        Talk()
        .ask(WRITE)
        .answer()
        .ask("")
        .answer("5f002f0a")
        .ask("", repeated=True)
        .answer("5f002f0a")
    )
    heard = Heard(talk.frames)
    assert (heard.events, heard.unasked) == ([("asked", 0), ("answered", 0)], [])


def test_a_sap_that_is_not_enabled() -> None:
    heard = Heard(Talk().ask(WRITE).answer(fc=3).frames)
    assert (heard.events, heard.calls[0].fault) == ([("asked", 0), ("failed", 0)], 3)


def test_a_call_without_an_answer() -> None:
    heard = Heard(Talk().ask(WRITE).answer().ask(READ).answer().ask("").answer(fc=9).frames)
    assert heard.events == [("asked", 0), ("lost", 0), ("asked", 1), ("lost", 1)]


def test_an_answer_without_its_request() -> None:
    (call,) = Heard(Talk().ask("").answer("5f002f0a").frames).unasked
    assert (call.master, call.station, call.sap, call.record.index) == (2, 3, 51, 47)
    assert call.record.write


def test_an_answer_of_another_record_is_none_of_the_open_call() -> None:
    heard = Heard(Talk().ask(READ).answer().ask("").answer("5e01300401020304").frames)
    assert heard.events == [("asked", 0), ("lost", 0)]
    (call,) = heard.unasked
    assert (call.record.slot, call.record.index) == (1, 0x30)


def test_an_abort_ends_a_call() -> None:
    heard = Heard(Talk(sap=7).ask(READ).answer().ask("").answer("58000000").frames)
    assert heard.events == [("asked", 0), ("lost", 0)]
    assert heard.calls[0].sap == 7


def test_idle_of_a_connection_says_nothing_of_a_call() -> None:
    talk = Talk(sap=7).ask(READ).answer().ask("48").answer("48").ask("").answer("48")
    heard = Heard(talk.ask("").answer("5e002f0a" + GIVEN).frames)
    assert (heard.events, heard.unasked) == ([("asked", 0), ("answered", 0)], [])
    assert len(heard.calls[0].polls) == 3


def test_polls_without_end_are_counted() -> None:
    talk = Talk().ask(READ).answer()
    for _ in range(MOST_POLLS + 3):
        talk.ask("").answer()
    (call,) = Heard(talk.frames).calls
    assert (call.polled, len(call.polls)) == (MOST_POLLS + 4, MOST_POLLS)
    assert [each.request.frame for each in call.polls][:2] == [1, 3]


def test_of_too_many_calls_the_oldest_is_given_up() -> None:
    talks = [Talk(station, sap) for sap in range(9) for station in range(3, 127)]
    frames = [frame for talk in talks for frame in talk.ask(READ).answer().frames]
    lost = [number for name, number in Heard(frames).events if name == "lost"]
    assert lost == list(range(len(talks)))
    heard = Heard([*frames, *talks[-1].ask("").answer("5e002f0a" + GIVEN).frames[2:]])
    assert heard.events.index(("lost", 0)) == MOST_OPEN + 1
    assert ("answered", len(talks) - 1) in heard.events


def test_what_a_half_carries() -> None:
    talk = Talk().ask("5f002f02aabb").answer("5f002f02cc").ask("5e002ff0aa").answer("5e002f02bbcc")
    write, read = (call.record for call in Heard(talk.frames).calls)
    halves = (write.request, write.response, read.request, read.response)
    assert [half and (half.data.hex(), half.stated, half.missing) for half in halves] == [
        ("aabb", 2, 0), ("", 0, 0), ("", 240, 0), ("bbcc", 2, 0),
    ]  # fmt: skip


def test_a_length_that_promises_more() -> None:
    talk = Talk().ask("5f002f14" + ASKED).answer()
    (call,) = Heard(talk.frames).calls
    assert call.record.request is not None
    assert (call.record.request.stated, call.record.request.missing) == (20, 10)


@given(st.lists(st.sampled_from([
    *Talk().ask(WRITE).ask(READ).ask("").ask("").ask("99").answer().answer("").answer(NOT_READY)
    .answer("5f002f0a").answer("5e").answer(fc=3).answer(fc=9).frames, b"\xdc\x02\x02", b"\x10",
]), max_size=30))  # fmt: skip
def test_every_call_ends_once(frames: list[bytes]) -> None:
    heard = Heard(frames)
    for number in range(len(heard.calls)):
        first, last = (name for name, each in heard.events if each == number)
        assert first == "asked"
        assert last in ("answered", "failed", "lost")


# The pairing takes them


def paired(frames: Iterable[bytes]) -> list[Job]:
    """The jobs that the pairing makes of the calls."""
    jobs: dict[int, Job] = {}
    outcomes: list[Outcome] = []
    pairing = Pairing(limits(), outcomes)

    def access(call: ServiceCall) -> Record:
        who = Peer(str(call.master), str(call.station), station=call.station)
        return call.record.of(who)

    def asked(call: ServiceCall) -> None:
        half = call.record.request
        assert half is not None
        if call.record.write:
            message = decode_request(half.data, Options())
            jobs[id(call)] = pairing.write_request(access(call), message)
        else:
            pairing.read_request(access(call))

    def answered(call: ServiceCall) -> None:
        if call.record.write:
            pairing.write_response(jobs[id(call)], call.record.response)
        else:
            pairing.read_response(access(call))

    for what, call in services(frames):
        if what == "asked":
            asked(call)
        elif what == "answered":
            answered(call)
    pairing.finish()
    return [about for what, about, _ in outcomes if what == "closed"]


def test_one_transaction_with_its_polls() -> None:
    talk = Talk().ask(WRITE).answer().ask("").answer("5f002f0a")
    for _ in range(2):
        talk.ask(READ).answer().ask("").answer(NOT_READY)
    talk.ask(READ).answer().ask("").answer("5e002f0a" + GIVEN)
    (job,) = paired(talk.frames)
    assert (len(job.polls), job.reference) == (2, 3)
    assert job.read_response is not None
    assert (job.read_response.data.hex(), job.read_response.frame) == (GIVEN, len(talk.frames))
    response = decode_response(job.read_response.data, job.message, Options())
    assert response.axis == 2


@pytest.mark.parametrize("status", ["df80b000", "df80b500", "df80b0", "df80", "df"])
def test_a_refused_write_is_refused(status: str) -> None:
    (job,) = paired(Talk().ask(WRITE).answer().ask("").answer(status).frames)
    assert (job.write_refused, job.read_response) == (True, None)


def test_two_stations_are_two_channels() -> None:
    first, second = (Talk(station) for station in (3, 4))
    for talk in (first, second):
        talk.ask(WRITE).answer().ask("").answer("5f002f0a").ask(READ).answer("5e002f0a" + GIVEN)
    jobs = paired([frame for pair in zip(
        [first.frames[at : at + 2] for at in range(0, 6, 2)],
        [second.frames[at : at + 2] for at in range(0, 6, 2)], strict=True,
    ) for both in pair for frame in both])  # fmt: skip
    assert [job.peer.device for job in jobs] == ["3", "4"]
    assert all(job.read_response is not None for job in jobs)


def test_what_a_refused_write_did_not_ask_for() -> None:
    """It may be for a request before the begin of the capture, until one ended in it (docs/pairing.md, P77)."""
    write, read = Talk().ask(WRITE).answer().ask("").answer("5f002f0a"), "5e002f0a"
    got = write.ask(READ).answer(read + GIVEN).frames
    other = "04" + GIVEN[2:]
    refused = Talk().ask("5f002f0a04" + ASKED[2:]).answer().ask("").answer("df80b000")
    (first, orphan) = paired(refused.ask(READ).answer(read + GIVEN).frames)
    assert (first.write_refused, first.read_response, orphan.message) == (True, None, None)
    mirrored = refused.frames[:4] + refused.ask(READ).answer(read + other).frames[-2:]
    (first, orphan) = paired(mirrored)  # a program may give each request the same reference
    assert (first.write_refused, first.read_response, orphan.message) == (True, None, None)
    (_, job) = paired(got + mirrored)
    assert job.read_response is not None
    assert job.write_refused
    (_, job) = paired(
        got + refused.frames[:4] + write.ask(READ).answer(read + "05" + GIVEN[2:]).frames[-2:]
    )
    assert job.read_response is not None
    assert job.write_refused
