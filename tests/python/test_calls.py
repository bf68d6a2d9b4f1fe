"""RPC calls: copies, retransmissions, reused numbers and what never gets an answer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest
from talk import pdus

from ds47.lab import wire
from ds47.lab.client import CHANNEL, Client
from ds47.profinet.calls import Became, CallTracker
from ds47.profinet.rpc import Pdu
from ds47.spec.semantics import Limits, limits

SECOND = 1_000_000_000
LIMITS = limits()


@dataclass
class Heard:
    """A tracker and what it told, as (event, seq, frame)."""

    bounds: Limits = LIMITS
    events: list[tuple[str, int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.tracker = CallTracker(self.bounds)

    def feed(self, *sequence: Pdu) -> Heard:
        for pdu in sequence:
            self._note(self.tracker.take(pdu))
        return self

    def finish(self) -> None:
        self._note(self.tracker.finish())

    def _note(self, told: list[Became]) -> None:
        for what, call, pdu in told:
            about = pdu or (call and call.request)
            assert about is not None
            of_call = call is not None and what in ("answered", "late")
            self.events.append((what, about.seq, call.frame if of_call else about.frame))

    @property
    def names(self) -> list[str]:
        return [event for event, _, _ in self.events]


def calls(count: int = 1, **settings: object) -> list[Pdu]:
    """Read requests and their responses in turn, 1 ms apart."""

    def talk(client: Client) -> None:
        for number in range(count):
            client.read(bytes((number,)))

    return pdus(talk, **settings)


def other(pdu: Pdu, **changes: object) -> Pdu:
    """Another datagram."""
    return replace(pdu, mark=hash((pdu.mark, *changes.items())), **changes)  # type: ignore[arg-type]


def later(pdu: Pdu, nanoseconds: int, **changes: object) -> Pdu:
    moved = {"time_ns": pdu.time_ns + nanoseconds, "frame": pdu.frame + 100, "ip_id": pdu.ip_id + 1}
    return other(pdu, **(moved | changes))


def test_a_call_and_its_response() -> None:
    heard = Heard().feed(*calls(2))
    heard.finish()
    assert heard.events == [
        ("asked", 0, 1), ("answered", 0, 1), ("asked", 1, 3), ("answered", 1, 3),
    ]  # fmt: skip
    counts = heard.tracker.counts
    assert (counts["requests"], counts["responses"], counts["unanswered"]) == (2, 2, 0)


def test_a_copy_has_the_ip_id() -> None:
    request = calls()[0]
    for again, copy in (
        (replace(request, time_ns=request.time_ns + 28_000_000), True),
        (replace(request, time_ns=request.time_ns + 90 * SECOND), True),  # the file holds it twice
        (replace(request, time_ns=request.time_ns - SECOND), True),
        (replace(request, mark=request.mark + 1), False),
    ):
        tracker = Heard().tracker
        assert tracker.take(request)
        assert (not tracker.take(again)) == copy
        assert tracker.counts["copies"] == copy


def test_without_an_ip_id_a_copy_comes_at_once() -> None:
    request = replace(calls()[0], ip_id=0)
    for passed, copy in (
        (LIMITS.copy_ns, True),
        (-LIMITS.copy_ns, True),
        (LIMITS.copy_ns + 1, False),
    ):
        tracker = Heard().tracker
        assert tracker.take(request)
        again = replace(request, time_ns=request.time_ns + passed)
        assert (not tracker.take(again)) == copy


def test_copies_are_looked_for_among_the_latest_datagrams():
    request = calls()[0]
    most = LIMITS.datagrams
    tracker = Heard().tracker
    for ip_id in range(2 * most):
        assert tracker.take(other(request, ip_id=ip_id))
    for ip_id, copy in ((0, False), (most - 1, False), (most, True), (2 * most - 1, True)):
        assert (not tracker.take(other(request, ip_id=ip_id))) == copy


def test_a_retransmission_of_an_unanswered_call_at_any_time_before_it_expires() -> None:
    request, response = calls()
    again = later(request, 30 * SECOND)
    heard = Heard().feed(request, again, later(response, 30 * SECOND))
    assert heard.events == [("asked", 0, 1), ("again", 0, 101), ("answered", 0, 1)]
    assert heard.tracker.counts["retransmissions"] == 1


@pytest.mark.parametrize(
    ("delay", "event"),
    [(0, "again"), (LIMITS.call_expiry_ns, "again"),
     (LIMITS.call_expiry_ns + 1, "asked")],
)  # fmt: skip
def test_an_identical_request_after_the_answer(delay: int, event: str) -> None:
    request, response = calls()
    again = other(request, frame=9, time_ns=response.time_ns + delay)
    heard = Heard().feed(request, response, again)
    assert heard.names == ["asked", "answered", event]


def test_an_identical_request_after_another_number_is_a_retransmission() -> None:
    """A datagram that the network doubled or delayed comes behind the next calls of its client."""
    request, response, other, _ = calls(2)
    heard = Heard().feed(request, response, other, later(request, SECOND))
    assert heard.names == ["asked", "answered", "asked", "again"]


def test_each_repetition_gives_a_client_time_for_the_next_one() -> None:
    request, response = calls()
    often = [later(request, number * LIMITS.call_expiry_ns) for number in (1, 2, 3)]
    assert Heard().feed(request, *often).names == ["asked", *["again"] * 3]
    after = Heard().feed(request, response, *often)
    assert after.names == ["asked", "answered", *["again"] * 3]


@pytest.mark.parametrize("answered", [True, False])
def test_an_identical_request_from_another_port_or_behind_a_connect_is_a_new_call(
    answered: bool,
) -> None:
    request, response = calls()
    first = [request, response] if answered else [request]
    over = [] if answered else ["lost"]
    names = ["asked", "answered"] if answered else ["asked"]
    other_port = Heard().feed(*first, later(request, SECOND, port=request.port + 1))
    assert other_port.names == [*names, *over, "asked"]
    connect = later(request, SECOND, opnum=wire.CONNECT, activity=bytes(16))
    again = later(request, 2 * SECOND, frame=request.frame + 200)
    assert Heard().feed(*first, connect, again).names == [*names, "asked", *over, "asked"]
    elsewhere = replace(connect, server="192.168.133.9")
    assert Heard().feed(*first, elsewhere, again).names[-1] == "again"
    assert Heard().feed(connect, later(connect, SECOND)).names == ["asked", "again"]


def test_a_client_that_uses_a_number_for_another_call_counts_anew() -> None:
    first, _, second, answer = calls(2)
    other = later(first, SECOND, body=b"other")
    heard = Heard().feed(first, second, answer, other, later(second, 2 * SECOND, frame=300))
    assert heard.names == ["asked", "asked", "answered", "lost", "asked", "asked"]


def test_another_body_under_an_unanswered_number_is_a_new_call() -> None:
    request, response = calls()
    reused = later(request, SECOND, body=request.body + b"\0")
    heard = Heard().feed(request, reused, later(response, SECOND))
    assert heard.events == [("asked", 0, 1), ("lost", 0, 1), ("asked", 0, 101),
                            ("answered", 0, 101)]  # fmt: skip
    assert heard.tracker.counts["unanswered"] == 1


def test_another_operation_under_an_answered_number_is_a_new_call() -> None:
    request, response = calls()
    heard = Heard().feed(request, response, later(request, SECOND, opnum=wire.WRITE))
    assert heard.names == ["asked", "answered", "asked"]


@pytest.mark.parametrize(("over", "last"), [(0, ["answered"]), (1, ["lost", "unasked"])])
def test_a_response_after_the_expiry_finds_nothing(over: int, last: list[str]) -> None:
    request, response = calls()
    late = replace(response, time_ns=request.time_ns + LIMITS.call_expiry_ns + over)
    heard = Heard().feed(request, late)
    heard.finish()
    assert heard.names == ["asked", *last]


def test_the_next_request_makes_an_old_one_expire() -> None:
    first, _, second, _ = calls(2)
    heard = Heard().feed(first, later(second, LIMITS.call_expiry_ns))
    assert heard.names == ["asked", "lost", "asked"]


def test_a_late_second_response_is_none_to_another_call() -> None:
    talk = calls(30)
    heard = Heard().feed(*talk, later(talk[1], SECOND))
    assert heard.names == ["asked", "answered"] * 30


def test_answered_calls_are_remembered_as_long_as_they_may_be_repeated() -> None:
    talk = calls(3)
    other = [later(each, SECOND, body=b"other") for each in talk[1::2]]
    few = Heard(LIMITS.but(answered_calls=2)).feed(*talk, *other)
    assert few.events[6:] == [("twice", 1, 104), ("twice", 2, 106)], (
        "of a forgotten one the number is known"
    )
    gone = replace(other[0], seq=9, mark=0)
    assert few.feed(gone).names[8:] == ["unasked"]
    assert few.feed(replace(gone, activity=bytes(16), mark=1)).names[9:] == ["unasked"]
    first, answer, second, last = calls(2)
    late = [later(each, LIMITS.call_expiry_ns + 2_000_000) for each in (second, last, answer)]
    assert Heard().feed(first, answer, *late).names[4:] == ["unasked"]


def test_a_second_response() -> None:
    request, response = calls()
    heard = Heard().feed(request, response, later(response, SECOND, body=b"other"))
    assert heard.events[2:] == [("twice", 0, 102)], "it belongs to no other call (P81)"
    assert heard.tracker.counts["responses"] == 2


def test_a_response_that_comes_again_without_its_request_hides_what_was_asked() -> None:
    request, response = calls()
    other = later(response, SECOND, body=b"other")
    assert Heard().feed(request, response, later(response, 2), other).names == [
        "asked",
        "answered",
    ]
    asked = Heard().feed(request, response, later(request, 1), later(response, 2), other)
    assert asked.names == ["asked", "answered", "again", "twice"]


@pytest.mark.parametrize(("passed", "again"), [(2_000_000, 1), (0, 0)])
def test_a_request_that_the_wire_doubled_was_there_twice(passed: int, again: int) -> None:
    """Not so where a mirror port did: then its client sent it once, and the device has it once."""
    request, response = calls()
    talk = Heard().feed(request)
    copy = replace(request, time_ns=request.time_ns + passed, frame=999)
    assert not talk.tracker.take(copy)
    assert talk.tracker.open_call(response).again == 999 * again
    assert talk.feed(response).names == ["asked", "answered"]


def test_a_second_response_that_is_a_fault() -> None:
    request, response = calls()
    fault = replace(response, ptype=wire.FAULT, body=b"\x03\x00\x01\x1c")
    assert Heard().feed(request, response, later(fault, 1)).names == [
        "asked", "answered", "twice",
    ]  # fmt: skip


def test_an_answer_to_a_number_that_counts_anew_is_no_second_one() -> None:
    request, response = calls()
    for between in ([], [later(request, 2, body=b"new"), later(response, 3, body=b"old")]):
        late = later(response, LIMITS.call_expiry_ns + SECOND, body=b"other")
        names = Heard().feed(request, response, *between, late).names
        assert names[-1] == "unasked"


def test_a_response_without_its_request() -> None:
    _, response = calls()
    assert Heard().feed(response).events == [("unasked", 0, 2)]


def test_activities_do_not_mix() -> None:
    request, response = calls()
    for change in ({"activity": bytes(16)}, {"client": "192.168.133.9"}, {"seq": 5}):
        heard = Heard().feed(request, replace(response, **change))  # type: ignore[arg-type]
        assert heard.names == ["asked", "unasked"]


@pytest.mark.parametrize(("kind", "count"), [(wire.FAULT, "faults"), (wire.REJECT, "rejects")])
def test_a_fault_answers_a_call_once(kind: int, count: str) -> None:
    request, response = calls()
    fault = replace(response, ptype=kind, body=b"\x03\x00\x01\x1c")
    heard = Heard().feed(request, fault, later(fault, 1))
    heard.finish()
    assert heard.events == [("asked", 0, 1), ("failed", 0, 2)]
    assert heard.tracker.counts[count] == 2
    assert Heard().feed(fault).events == []


def test_other_types_are_counted_only() -> None:
    request = calls()[0]
    kinds = (wire.PING, wire.WORKING, 5, 7, 10)
    heard = Heard().feed(*[other(request, ptype=kind) for kind in kinds])
    counts = heard.tracker.counts
    assert heard.events == []
    assert (counts["pings"], counts["working"], counts["others"]) == (1, 1, 3)


def test_finish_loses_every_open_call_once() -> None:
    first, _, second, answer = calls(2)
    heard = Heard().feed(first, second, answer)
    heard.finish()
    heard.finish()
    assert heard.names == ["asked", "asked", "answered", "lost"]
    assert heard.events[-1] == ("lost", 0, 1)


def test_open_calls_of_an_activity_are_bounded() -> None:
    requests = calls(5)[::2]
    heard = Heard(LIMITS.but(calls=2)).feed(*requests)
    heard.finish()
    assert [seq for event, seq, _ in heard.events if event == "pushed_out"] == [0, 1]
    assert [seq for event, seq, _ in heard.events if event == "lost"] == [2, 3, 4]
    assert len(heard.events) == 10
    assert heard.tracker.counts["unanswered"] == 3


def test_once_the_clock_was_set_back_a_call_expires_by_its_own_time() -> None:
    """It is older than the activity is by its first request."""
    talk, back = calls(3), 90 * SECOND
    talk[2:] = [later(each, -back) for each in talk[2:]]
    talk[4] = later(talk[4], LIMITS.call_expiry_ns)
    heard = Heard().feed(*talk[:3], talk[4])
    assert heard.names == ["asked", "answered", "asked", "lost", "asked"]


def test_what_a_client_went_on_from_is_lost_for_no_limit() -> None:
    """It got the response to a later call; that an earlier one comes too late is no response without a request."""
    talk = calls(6)
    requests, answers = talk[::2], talk[1::2]
    heard = Heard(LIMITS.but(calls=2)).feed(*requests[:2], answers[1], *requests[2:5], answers[0])
    assert heard.events == [
        ("asked", 0, 1), ("asked", 1, 3), ("answered", 1, 3), ("asked", 2, 5), ("asked", 3, 7),
        ("lost", 0, 1), ("asked", 4, 9), ("pushed_out", 2, 5), ("unasked", 0, 2),
    ]  # fmt: skip
    assert heard.tracker._completeness.newest("192.168.133.33") == 1, (
        "nothing is missing but its response"
    )


def test_activities_are_bounded_and_the_one_that_spoke_last_stays() -> None:
    request = calls()[0]
    one, two, three = (other(request, activity=bytes([n]) * 16, seq=n) for n in (1, 2, 3))
    heard = Heard(LIMITS.but(activities=2)).feed(one, two, later(one, 1), three)
    assert heard.names == ["asked", "asked", "again", "pushed_out", "asked"]
    assert heard.events[3][1] == 2
    copy = replace(two, time_ns=two.time_ns + SECOND)
    assert heard.feed(copy).names[5:] == [], "of one that is forgotten, too, a copy is no call"


def test_the_oldest_connect_is_forgotten_beyond_the_limit() -> None:
    first = calls()
    connect = later(first[0], SECOND, opnum=wire.CONNECT, activity=bytes(16))
    others = [
        other(connect, client=f"10.0.0.{number}", activity=bytes((number,)) * 16)
        for number in range(1, 4)
    ]
    again = later(first[0], 2 * SECOND)
    for more, names in ((others[:1], ["asked"]), (others, ["again"])):
        heard = Heard(LIMITS.but(activities=2)).feed(*first, connect, *more)
        assert heard.feed(again).names[-1:] == names


def test_of_calls_with_a_response_only_a_connect_keeps_its_request() -> None:
    tracker = CallTracker(LIMITS)
    kept = []
    for pdu in pdus(lambda client: (client.connect("plc"), client.read(b"data"))):
        kept += [call.request for what, call, _ in tracker.take(pdu) if what == "answered"]
    assert [request and request.opnum for request in kept] == [wire.CONNECT, None]


def test_the_context_of_the_layer_above_stays_with_the_call() -> None:
    got: list[object] = []
    tracker = CallTracker(LIMITS)
    for pdu in pdus(lambda client: client.read(b"data", client.at(index=CHANNEL.index))):
        for what, call, _ in tracker.take(pdu):
            assert call is not None
            if what == "asked":
                call.context = ["mine"]
            else:
                got.append(call.context)
    assert got == [["mine"]]
