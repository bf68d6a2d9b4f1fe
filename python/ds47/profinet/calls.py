"""RPC calls: which response belongs to which request (docs/pairing.md, RPC level).

Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
carries is `records`' business; what it means for the parameter channel is `ds47.acyclic.pairing`'s.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ds47.profinet.completeness import Completeness, Numbers
from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import RPC_CONNECT
from ds47.spec.semantics import Limits


@dataclass(slots=True, eq=False, init=False)
class Call:
    """One RPC call; `context` is what it carries, for the layer above."""

    request: Pdu
    response: Pdu | None
    """The response or the fault; None as long as there is none."""
    in_part: bool
    """Whether fragments of a response were seen."""
    sent_ns: int
    """When the request was sent last,"""
    heard_ns: int
    """and when it was sent or answered last."""
    again: int
    """The last frame in which the request came again, other than by a mirror port; 0 for none."""
    context: Sequence[Any]

    def __init__(self, request: Pdu) -> None:
        self.request = request
        self.response = None
        self.in_part = False
        self.sent_ns = self.heard_ns = request.time_ns
        self.again = 0
        self.context = ()


@dataclass(slots=True, init=False)
class Activity:
    """The open calls of one RPC activity by their sequence number; the oldest request first."""

    newest: int
    """Number of the newest call."""
    calls: dict[int, Call]
    """Those without a response."""
    oldest_ns: int
    """None of them was sent before that."""
    server: str
    """Which of its servers was called last."""
    numbers: Numbers
    anew: int
    """The frame in which a number was there for another call: since then its client counts anew. 0 for none."""
    doubled: int
    """The frame of a response that came again, though no request did: one is missing. 0 for none."""

    def __init__(self, pdu: Pdu) -> None:
        self.newest = pdu.seq
        self.anew = self.doubled = 0
        self.calls = {}
        self.oldest_ns = pdu.time_ns
        self.server = ""
        self.numbers = Numbers(pdu)


@dataclass(slots=True)
class Handlers:
    """What the layer above wants to hear. Each is called at most once for one event of one call."""

    request: Callable[[Call], None]
    response: Callable[[Call], None]
    orphan_response: Callable[[Pdu, bool], None]
    """With whether it is certain that its request is not in the capture."""
    second_response: Callable[[Call, Pdu], None]
    """One with other bytes to a call that was answered: it belongs to no other call."""
    late_request: Callable[[Call], None]
    """The request of such a response, which comes behind it in the capture and before it by their times."""
    retransmission: Callable[[Call, Pdu], None]
    fault: Callable[[Call, Pdu], None]
    lost: Callable[[Call], None]
    pushed_out: Callable[[Call, str], None]
    """A call without a response that was given up for the limit of this name: one may still come."""


_DatagramKey = object
"""A hash of all that two copies of a datagram have in common. Not called an `int`: it is no number, and
compiled it would be unpacked and packed for each use."""


class CallTracker:
    """Feeds on whole RPC messages in the order of the capture.

    Memory is bounded by `Limits`; a call without response is reported as lost when it expires or at
    `finish`, and as pushed out when there are too many. What is missing is told to `completeness`.
    """

    def __init__(
        self, limits: Limits, handlers: Handlers, completeness: Completeness | None = None
    ) -> None:
        self._limits = limits
        self._expiry_ns, self._most = limits.call_expiry_ns, limits.calls
        self._handlers = handlers
        self._completeness = completeness or Completeness(limits.activities)
        self._early: OrderedDict[tuple[str, bytes, int], Pdu] = OrderedDict()
        """The newest responses without a request."""
        self._answered: OrderedDict[tuple[str, bytes, int], Call] = OrderedDict()
        """Calls with a response that may still be repeated; the one that was heard of last comes last."""
        self._connects: OrderedDict[tuple[str, str], int] = OrderedDict()
        """Of client and server the frame of the newest Connect."""
        self._activities: OrderedDict[tuple[str, bytes], Activity] = OrderedDict()
        """By client and activity UUID; the one that spoke last comes last."""
        self._most_datagrams = limits.datagrams
        self._recent: dict[_DatagramKey, int] = {}
        """The newest ones, and when they came; when they are enough, all that came before them is forgotten."""
        self._earlier: dict[_DatagramKey, int] = {}
        """Those before them."""
        self._given_up: OrderedDict[tuple[str, bytes, int], None] = OrderedDict()
        """The newest requests whose responses did not come in time."""
        self._begun: OrderedDict[tuple[str, bytes, int], None] = OrderedDict()
        """Requests of which fragments were seen, as far as is known."""
        self.counts = dict.fromkeys(
            ("requests", "responses", "faults", "rejects", "pings", "working", "others",
             "copies", "retransmissions", "unanswered"), 0,
        )  # fmt: skip

    def is_copy(self, pdu: Pdu) -> bool:
        """Whether the same datagram with the same IP id was here: it came twice, or the file holds it twice.

        An IP id of 0 is none. Then it is a copy only within the copy window.
        """
        key: _DatagramKey = hash(
            (
                pdu.source,
                pdu.destination,
                pdu.activity,
                pdu.ptype,
                pdu.ip_id,
                pdu.port,
                pdu.boot,
                pdu.fragment,
                pdu.seq,
                pdu.body,
            )
        )
        recent, now = self._recent, pdu.time_ns
        before = recent.get(key)
        if before is None:
            before = self._earlier.get(key)
        if before is not None and (pdu.ip_id or abs(now - before) <= self._limits.copy_ns):
            self.counts["copies"] += 1
            if pdu.ptype == 0 and now - before > self._limits.copy_ns:
                self._came_again(pdu)
            return True
        recent[key] = now
        if len(recent) >= self._most_datagrams:
            self._earlier, self._recent = recent, {}
        return False

    def _came_again(self, pdu: Pdu) -> None:
        """The wire doubled a request: a device without a memory of its responses executes it once more."""
        activity = self._activities.get((pdu.client, pdu.activity))
        call = self._answered.get((pdu.client, pdu.activity, pdu.seq))
        if call is None and activity is not None:
            call = activity.calls.get(pdu.seq)
        if call is not None:
            call.again = pdu.frame

    def feed(self, pdu: Pdu) -> None:
        """Takes one whole message (not a copy, see `is_copy`)."""
        if pdu.ptype == 0:
            self._request(pdu)
        elif pdu.ptype == 2:
            self.counts["responses"] += 1
            self._response(pdu)
        elif pdu.ptype in (3, 6):
            self.counts["faults" if pdu.ptype == 3 else "rejects"] += 1
            self._fault(pdu)
        else:
            self.counts[{1: "pings", 4: "working"}.get(pdu.ptype, "others")] += 1

    def begun(self, pdu: Pdu) -> None:
        """Takes a fragment that completes no message: its call is not without request or response."""
        key = (pdu.client, pdu.activity)
        if pdu.ptype == 0:
            begun = self._begun
            begun[*key, pdu.seq] = None
            if len(begun) > self._limits.rpc_messages:
                begun.popitem(last=False)
        elif pdu.ptype == 2 and (activity := self._activities.get(key)) is not None:
            call = activity.calls.get(pdu.seq)
            if call is not None:
                call.in_part = True

    def open_call(self, pdu: Pdu) -> Call | None:
        """The call without a response to which a part of one belongs; None for none."""
        activity = self._activities.get((pdu.client, pdu.activity)) if pdu.ptype == 2 else None
        return activity.calls.get(pdu.seq) if activity is not None else None

    def finish(self) -> None:
        """The capture is over: every open call is lost."""
        while self._activities:
            activity = self._activities.popitem(last=False)[1]
            for call in activity.calls.values():
                self._lose(call, went_on=call.request.seq < activity.numbers.highest)

    def _request(self, pdu: Pdu) -> None:
        self.counts["requests"] += 1
        activity, seq = self._activity(pdu), pdu.seq
        key, calls = (pdu.client, pdu.activity, seq), activity.calls
        if pdu.time_ns - activity.oldest_ns > self._expiry_ns or len(calls) > self._most:
            self._expire(activity, pdu)
        call = calls.get(seq) or self._answered.get(key)
        if call is not None:
            if self._is_retransmission(activity, call, pdu):
                self.counts["retransmissions"] += 1
                self._handlers.retransmission(call, pdu)
                call.sent_ns, call.again = pdu.time_ns, pdu.frame
                if call.response is None:
                    call.heard_ns = pdu.time_ns
                    activity.oldest_ns = min(activity.oldest_ns, pdu.time_ns)
                else:
                    call.heard_ns = max(pdu.time_ns, call.response.time_ns)
                    self._answered.move_to_end(key)
                return
            activity.anew = pdu.frame
            if call.response is None:
                self._lose(call, went_on=True)
                del calls[seq]  # the new one goes to the end
        if pdu.opnum == RPC_CONNECT:
            self._connected(pdu)
        before = calls.get(activity.newest)
        if before is not None:
            self._completeness.went_on(before.request, pdu)
        early = self._early.pop(key, None) if self._early else None
        late = early is not None and 0 <= early.time_ns - pdu.time_ns <= self._limits.call_expiry_ns
        activity.numbers.add(pdu, renewed=not late)
        if not calls or pdu.time_ns < activity.oldest_ns:
            activity.oldest_ns = pdu.time_ns
        call = calls[seq] = Call(pdu)
        activity.newest = seq
        if early is None or not late:
            self._handlers.request(call)
            return
        self._answer(activity, call, early)
        self._completeness.asked_after_all(early)
        if early.ptype == 2:
            self._handlers.late_request(call)
        else:
            self._handlers.request(call)
            self._handlers.fault(call, early)

    def _activity(self, pdu: Pdu) -> Activity:
        key = (pdu.client, pdu.activity)
        activity = self._activities.get(key)
        if activity is None:
            activity = self._activities[key] = Activity(pdu)
            self._make_room()
        self._activities.move_to_end(key)
        if activity.server is not pdu.server:  # the same text may stand there twice: no harm
            activity.server = pdu.server
            self._completeness.began(pdu, activity.numbers)
        return activity

    def passes(self, pdu: Pdu) -> None:
        """Takes a call that is none of PROFINET: only its number counts."""
        self._activity(pdu).numbers.add(pdu)

    def _connected(self, pdu: Pdu) -> None:
        pair = pdu.client, pdu.server
        self._connects[pair] = pdu.frame
        self._connects.move_to_end(pair)
        if len(self._connects) > self._limits.activities:
            self._connects.popitem(last=False)

    def _is_retransmission(self, activity: Activity, call: Call, pdu: Pdu) -> bool:
        """Whether a number that was there before is the same call."""
        asked = call.request
        same = asked.opnum == pdu.opnum and asked.body == pdu.body and asked.port == pdu.port
        return same and not self._is_over(activity, call, pdu)

    def _is_over(self, activity: Activity | None, call: Call, pdu: Pdu) -> bool:
        """Whether the number of a call may stand for another one: its client repeats it no more."""
        anew = 0 if activity is None else activity.anew
        begun = max(anew, self._connects.get((pdu.client, pdu.server), 0))
        old = pdu.time_ns - call.heard_ns > self._expiry_ns
        return old or begun > call.request.frame

    def _response(self, pdu: Pdu) -> None:
        activity = self._activities.get((pdu.client, pdu.activity))
        call = None
        if activity is not None and (calls := activity.calls):
            if pdu.time_ns - activity.oldest_ns > self._expiry_ns or len(calls) > self._most:
                self._expire(activity, pdu)
            call = calls.get(pdu.seq)
        if call is not None and activity is not None:
            self._answer(activity, call, pdu)
            self._handlers.response(call)
        elif not self._answers_again(activity, pdu):
            self._handlers.orphan_response(pdu, self._unasked(pdu))

    def _answers_again(self, activity: Activity | None, pdu: Pdu) -> bool:
        """Whether a response or fault is a second one of a call; tells of it where it is another one."""
        call = self._answered.get((pdu.client, pdu.activity, pdu.seq))
        if call is None or call.response is None or self._is_over(activity, call, pdu):
            return False
        if call.response.body == pdu.body:
            if activity is not None and not call.again:
                activity.doubled = pdu.frame
        elif activity is None or activity.doubled < call.request.frame:
            self._handlers.second_response(call, pdu)
        return True

    def _answer(self, activity: Activity, call: Call, pdu: Pdu) -> None:
        """A call is answered: it is remembered as long as its client may repeat it."""
        call.response, activity.numbers.heard = pdu, True
        call.heard_ns = max(call.sent_ns, pdu.time_ns)
        del activity.calls[pdu.seq]
        answered = self._answered
        key = pdu.client, pdu.activity, pdu.seq
        answered[key] = call
        answered.move_to_end(key)
        most, since = self._limits.answered_calls, pdu.time_ns - self._expiry_ns
        while len(answered) > most or next(iter(answered.values())).heard_ns < since:
            answered.popitem(last=False)

    def _unasked(self, pdu: Pdu) -> bool:
        """Hears of a response or fault without its request; whether that certainly is not in the capture."""
        key = pdu.client, pdu.activity, pdu.seq
        begun = key in self._begun
        if key not in self._given_up:
            self._early[key] = pdu
            if len(self._early) > self._limits.calls:
                self._early.popitem(last=False)
            activity = self._activities.get(key[:2])
            if activity is not None and pdu.seq > activity.numbers.highest:
                activity.numbers.add(pdu)
            self._completeness.unasked(pdu)
        return not begun

    def _fault(self, pdu: Pdu) -> None:
        activity = self._activities.get((pdu.client, pdu.activity))
        call = activity.calls.get(pdu.seq) if activity else None
        if activity is not None and call is not None:
            self._answer(activity, call, pdu)
            self._handlers.fault(call, pdu)
        elif not self._answers_again(activity, pdu):
            self._unasked(pdu)

    def _expire(self, activity: Activity, pdu: Pdu) -> None:
        """Gives up calls without response that are too old, or too many."""
        calls, highest = activity.calls, max(activity.numbers.highest, pdu.seq)
        since = pdu.time_ns - self._expiry_ns
        for seq in [seq for seq, call in calls.items() if call.sent_ns < since]:
            call = calls.pop(seq)
            self._give_up(call)
            self._lose(call, went_on=seq < highest)
        activity.oldest_ns = min((call.sent_ns for call in calls.values()), default=pdu.time_ns)
        while len(calls) > self._limits.calls:
            self._handlers.pushed_out(calls.pop(next(iter(calls))), "calls")

    def _give_up(self, call: Call) -> None:
        asked = call.request
        self._given_up[asked.client, asked.activity, asked.seq] = None
        if len(self._given_up) > self._limits.calls:
            self._given_up.popitem(last=False)

    def _make_room(self) -> None:
        while len(self._activities) > self._limits.activities:
            for call in self._activities.popitem(last=False)[1].calls.values():
                self._handlers.pushed_out(call, "activities")

    def _lose(self, call: Call, *, went_on: bool) -> None:
        self._completeness.lost(call.request, went_on=went_on)
        self.counts["unanswered"] += 1
        self._handlers.lost(call)
