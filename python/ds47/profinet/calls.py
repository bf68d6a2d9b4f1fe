"""RPC calls: which response belongs to which request (docs/pairing.md, RPC level).

Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
carries is `records`' business; what it means for the parameter channel is `ds47.acyclic.pairing`'s.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ds47.profinet.completeness import Completeness, Numbers
from ds47.profinet.rpc import Pdu
from ds47.spec.semantics import Limits


@dataclass(slots=True, eq=False, init=False)
class Call:
    """One RPC call; `context` is for the layer above."""

    request: Pdu
    response: Pdu | None
    """The response or the fault; None as long as there is none."""
    in_part: bool
    """Whether fragments of a response were seen."""
    sent_ns: int
    """When the request was sent last."""
    context: Any

    def __init__(self, request: Pdu) -> None:
        self.request = request
        self.response = None
        self.in_part = False
        self.sent_ns = request.time_ns
        self.context = None


@dataclass(slots=True, init=False)
class Activity:
    """The calls of one RPC activity by their sequence number; the oldest request first."""

    newest: int
    """Number of the newest call."""
    calls: dict[int, Call]
    server: str
    """Which of its servers was called last."""
    numbers: Numbers

    def __init__(self, pdu: Pdu) -> None:
        self.newest = pdu.seq
        self.calls = {}
        self.server = ""
        self.numbers = Numbers(pdu)


@dataclass(slots=True)
class Handlers:
    """What the layer above wants to hear. Each is called at most once for one event of one call."""

    request: Callable[[Call], None]
    response: Callable[[Call], None]
    orphan_response: Callable[[Pdu, bool], None]
    """With whether it is certain that its request is not in the capture."""
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
        self._handlers = handlers
        self._completeness = completeness or Completeness(limits.activities)
        self._early: OrderedDict[tuple[str, bytes, int], Pdu] = OrderedDict()
        """The newest responses without a request."""
        self._many_calls = min(2 * limits.answered_calls, limits.calls)
        """Up to so many of one activity nothing is forgotten."""
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
        """Whether the same datagram with the same IP id was here within the copy window."""
        key: _DatagramKey = hash(
            (
                pdu.source,
                pdu.destination,
                pdu.activity,
                pdu.ptype,
                pdu.ip_id,
                pdu.fragment,
                pdu.seq,
                pdu.body,
            )
        )
        recent, now = self._recent, pdu.time_ns
        before = recent.get(key)
        if before is None:
            before = self._earlier.get(key)
        if before is not None and abs(now - before) <= self._limits.copy_ns:
            self.counts["copies"] += 1
            return True
        recent[key] = now
        if len(recent) >= self._most_datagrams:
            self._earlier, self._recent = recent, {}
        return False

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
        call = activity.calls.get(pdu.seq) if activity is not None else None
        return None if call is None or call.response is not None else call

    def finish(self) -> None:
        """The capture is over: every open call is lost."""
        while self._activities:
            activity = self._activities.popitem(last=False)[1]
            for call in activity.calls.values():
                if call.response is None:
                    self._lose(call, activity.numbers)

    def _request(self, pdu: Pdu) -> None:
        self.counts["requests"] += 1
        activity, seq = self._activity(pdu), pdu.seq
        calls = activity.calls
        if calls:
            self._expire(activity, pdu.time_ns)
        call = calls.get(seq)
        if call is not None:
            if self._is_retransmission(activity, call, pdu):
                self.counts["retransmissions"] += 1
                self._handlers.retransmission(call, pdu)
                call.sent_ns = pdu.time_ns
                return
            if call.response is None:
                self._lose(call, activity.numbers)
            del calls[seq]  # the new one goes to the end
        before = calls.get(activity.newest)
        if before is not None and before.response is None:
            self._completeness.went_on(before.request, pdu)
        activity.numbers.add(pdu)
        call = calls[seq] = Call(pdu)
        activity.newest = seq
        early = self._early.pop((pdu.client, pdu.activity, seq), None) if self._early else None
        if early is None or not 0 <= early.time_ns - pdu.time_ns <= self._limits.call_expiry_ns:
            self._handlers.request(call)
            return
        call.response = early
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

    def _is_retransmission(self, activity: Activity, call: Call, pdu: Pdu) -> bool:
        if call.request.opnum != pdu.opnum or call.request.body != pdu.body:
            return False
        response = call.response
        if response is None:
            return True
        soon = pdu.time_ns - response.time_ns <= self._limits.retransmission_ns
        return soon and activity.newest == pdu.seq

    def _response(self, pdu: Pdu) -> None:
        activity = self._activities.get((pdu.client, pdu.activity))
        call = None
        if activity is not None:
            if activity.calls:
                self._expire(activity, pdu.time_ns)
            call = activity.calls.get(pdu.seq)
        if call is None or activity is None:
            self._handlers.orphan_response(pdu, self._unasked(pdu))
            return
        before = call.response
        if before is None:
            call.response, activity.numbers.heard = pdu, True
            self._handlers.response(call)
        elif before.body != pdu.body:
            self._handlers.orphan_response(pdu, True)

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
        if activity is None or call is None:
            self._unasked(pdu)
        elif call.response is None:
            call.response, activity.numbers.heard = pdu, True
            self._handlers.fault(call, pdu)

    def _expire(self, activity: Activity, now: int) -> None:
        """Gives up calls without response that are too old, and forgets old calls."""
        limit = self._limits.call_expiry_ns
        calls = activity.calls
        oldest: Call = next(iter(calls.values()))
        if len(calls) <= self._many_calls and now - oldest.request.time_ns <= limit:
            return  # nothing is old or too much: so it is nearly always, and every call comes by here
        for seq in [
            seq for seq, call in calls.items()
            if call.response is None and now - call.request.time_ns > limit
        ]:  # fmt: skip
            call = calls.pop(seq)
            self._give_up(call)
            self._lose(call, activity.numbers)
        answered = [seq for seq, call in calls.items() if call.response is not None]
        for seq in answered[: -self._limits.answered_calls]:
            del calls[seq]
        while len(calls) > self._limits.calls:
            call = calls.pop(next(iter(calls)))
            if call.response is None:
                self._handlers.pushed_out(call, "calls")

    def _give_up(self, call: Call) -> None:
        asked = call.request
        self._given_up[asked.client, asked.activity, asked.seq] = None
        if len(self._given_up) > self._limits.calls:
            self._given_up.popitem(last=False)

    def _make_room(self) -> None:
        while len(self._activities) > self._limits.activities:
            for call in self._activities.popitem(last=False)[1].calls.values():
                if call.response is None:
                    self._handlers.pushed_out(call, "activities")

    def _lose(self, call: Call, numbers: Numbers) -> None:
        self._completeness.lost(call.request, numbers)
        self.counts["unanswered"] += 1
        self._handlers.lost(call)
