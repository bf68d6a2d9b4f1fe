"""RPC calls: which response belongs to which request (docs/pairing.md, RPC level).

Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
carries is `records`' business; what it means for the parameter channel is `ds47.pairing`'s.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ds47.capture import Frame
from ds47.profinet.headers import DatagramKey, conversation_key, datagram_key
from ds47.profinet.rpc import Pdu, from_frame
from ds47.spec.semantics import Limits


class Call:
    """One RPC call; `context` is for the layer above.

    It is made of its PDUs, or of the frames that hold them (`ds47.usual`): then the PDUs are made
    when somebody asks.
    """

    __slots__ = (
        "_request", "_response", "answer", "answered", "asked", "context", "expected", "in_part",
        "time_ns", "usual",
    )  # fmt: skip

    def __init__(self, request: Pdu | None, asked: Frame | None, usual: Any, time_ns: int) -> None:
        """Either `request` or the frame `asked` is given; `usual` is for whoever gives the frame."""
        self._request = request
        self._response: Pdu | None = None
        self.asked = asked
        self.answer: Frame | None = None
        """That of the response, where the call is made of frames."""
        self.answered = False
        """Whether there was a response, or a fault."""
        self.in_part = False
        """Whether fragments of a response were seen."""
        self.usual = usual
        self.expected: Any = None
        """Of a Read that is made of frames: the job whose response it fetches, as far as that was known."""
        self.time_ns = time_ns
        """Of the request."""
        self.context: Any = None

    @property
    def request(self) -> Pdu:
        """The request."""
        if self._request is None:
            assert self.asked is not None
            self._request = from_frame(self.asked)
        assert self._request is not None
        return self._request

    @property
    def response(self) -> Pdu | None:
        """The response or the fault, None as long as there is none."""
        if self._response is None and self.answer is not None:
            self._response = from_frame(self.answer)
        return self._response

    @response.setter
    def response(self, response: Pdu) -> None:
        self._response = response
        self.answered = True


@dataclass(slots=True, init=False)
class Activity:
    """The calls of one RPC activity by their sequence number; the oldest request first."""

    newest: int
    """Number of the newest call."""
    calls: dict[int, Call]
    quiet_until: int
    """Up to this time no call is old, and `CallTracker.expire` would do nothing while there are no
    more than `usual_calls`; -1 where that is not known."""
    newest_ns: int
    ordered: bool
    """Whether the requests came in the order of their times."""

    def __init__(self, newest: int) -> None:
        self.newest = newest
        self.calls = {}
        self.quiet_until = -1
        self.newest_ns = 0
        self.ordered = True

    def begin(self, seq: int, call: Call) -> None:
        """One more call, with a number that none has."""
        self.newest = seq
        self.calls[seq] = call
        if call.time_ns < self.newest_ns:
            self.ordered, self.quiet_until = False, -1
        self.newest_ns = call.time_ns


@dataclass(slots=True, init=False)
class Handlers:
    """What the layer above wants to hear. Each is called at most once for one event of one call."""

    request: Callable[[Call], None]
    response: Callable[[Call], None]
    orphan_response: Callable[[Pdu, bool], None]
    """With whether it is certain that its request is not in the capture."""
    retransmission: Callable[[Call, Pdu], None]
    fault: Callable[[Call, Pdu], None]
    lost: Callable[[Call], None]
    pushed_out: Callable[[Call, str], None]
    """A call without a response that was given up for the limit of this name: one may still come."""

    def __init__(
        self,
        request: Callable[[Call], None],
        response: Callable[[Call], None],
        orphan_response: Callable[[Pdu, bool], None],
        retransmission: Callable[[Call, Pdu], None],
        fault: Callable[[Call, Pdu], None],
        lost: Callable[[Call], None],
        pushed_out: Callable[[Call, str], None],
    ) -> None:
        self.request = request
        self.response = response
        self.orphan_response = orphan_response
        self.retransmission = retransmission
        self.fault = fault
        self.lost = lost
        self.pushed_out = pushed_out


class CallTracker:
    """Feeds on whole RPC messages in the order of the capture.

    Memory is bounded by `Limits`; a call without response is reported as lost when it expires or at
    `finish`, and as pushed out when there are too many.
    """

    def __init__(self, limits: Limits, handlers: Handlers) -> None:
        self._limits = limits
        self._handlers = handlers
        self.usual_calls = min(2 * limits.answered_calls, limits.calls)
        self.activities: OrderedDict[tuple[str, bytes], Activity] = OrderedDict()
        """By client and activity UUID; the one that spoke last comes last."""
        self._most_datagrams = limits.datagrams
        self.datagrams: dict[DatagramKey, int] = {}
        """The latest, and when they came."""
        self._begun: OrderedDict[tuple[str, bytes, int], None] = OrderedDict()
        """Requests of which fragments were seen, as far as is known."""
        self._order: deque[DatagramKey] = deque()
        """The same, the oldest first; an `OrderedDict` costs twice as much, and here every frame comes by."""
        self.counts = dict.fromkeys(
            ("requests", "responses", "faults", "rejects", "pings", "working", "others",
             "copies", "retransmissions", "unanswered"), 0,
        )  # fmt: skip

    def is_copy(self, pdu: Pdu) -> bool:
        """Whether the same datagram with the same IP id was here within the copy window."""
        conversation = conversation_key(pdu.source, pdu.destination, pdu.activity, pdu.ptype)
        key = datagram_key(conversation, pdu.ip_id, pdu.fragment, pdu.seq, pdu.body)
        return self.seen(key, pdu.time_ns)

    def seen(self, key: DatagramKey, time_ns: int) -> bool:
        """`is_copy` of what makes a datagram what it is: see there."""
        datagrams = self.datagrams
        if key not in datagrams:
            self.remember(key, time_ns)
            return False
        if self.is_known_copy(key, time_ns):
            return True
        datagrams[key] = time_ns
        self._order.remove(key)
        self._order.append(key)
        return False

    def is_known_copy(self, key: DatagramKey, time_ns: int) -> bool:
        """`seen`, where the key is one of `datagrams`; if it is no copy, that is not remembered."""
        copy = abs(time_ns - self.datagrams[key]) <= self._limits.copy_ns
        self.counts["copies"] += copy
        return copy

    def remember(self, key: DatagramKey, time_ns: int) -> None:
        """`seen`, where the key is none of `datagrams`."""
        datagrams, order = self.datagrams, self._order
        datagrams[key] = time_ns
        order.append(key)
        if len(datagrams) > self._most_datagrams:
            del datagrams[order.popleft()]

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
        elif pdu.ptype == 2 and (activity := self.activities.get(key)) is not None:
            call = activity.calls.get(pdu.seq)
            if call is not None:
                call.in_part = True

    def open_call(self, pdu: Pdu) -> Call | None:
        """The call without a response to which a part of one belongs; None for none."""
        activity = self.activities.get((pdu.client, pdu.activity)) if pdu.ptype == 2 else None
        call = activity.calls.get(pdu.seq) if activity is not None else None
        return None if call is None or call.answered else call

    def finish(self) -> None:
        """The capture is over: every open call is lost."""
        while self.activities:
            for call in self.activities.popitem(last=False)[1].calls.values():
                if not call.answered:
                    self._lose(call)

    def _request(self, pdu: Pdu) -> None:
        self.counts["requests"] += 1
        key = (pdu.client, pdu.activity)
        activity = self.activities.get(key)
        if activity is None:
            activity = self.activities[key] = Activity(pdu.seq)
            self._make_room()
        self.activities.move_to_end(key)
        calls, seq = activity.calls, pdu.seq
        if calls:
            self.expire(activity, pdu.time_ns)
        call = calls.get(seq)
        if call is not None:
            if self._is_retransmission(activity, call, pdu):
                self.counts["retransmissions"] += 1
                self._handlers.retransmission(call, pdu)
                return
            if not call.answered:
                self._lose(call)
            del calls[seq]  # the new one goes to the end
        call = Call(pdu, None, None, pdu.time_ns)
        activity.begin(seq, call)
        self._handlers.request(call)

    def _is_retransmission(self, activity: Activity, call: Call, pdu: Pdu) -> bool:
        if call.request.opnum != pdu.opnum or call.request.body != pdu.body:
            return False
        response = call.response
        if response is None:
            return True
        soon = pdu.time_ns - response.time_ns <= self._limits.retransmission_ns
        return soon and activity.newest == pdu.seq

    def _response(self, pdu: Pdu) -> None:
        activity = self.activities.get((pdu.client, pdu.activity))
        call = None
        if activity is not None:
            if activity.calls:
                self.expire(activity, pdu.time_ns)
            call = activity.calls.get(pdu.seq)
        if call is None:
            begun = (pdu.client, pdu.activity, pdu.seq) in self._begun
            self._handlers.orphan_response(pdu, not begun)
            return
        before = call.response
        if before is None:
            call.response = pdu
            self._handlers.response(call)
        elif before.body != pdu.body:
            self._handlers.orphan_response(pdu, True)

    def _fault(self, pdu: Pdu) -> None:
        activity = self.activities.get((pdu.client, pdu.activity))
        call = activity.calls.get(pdu.seq) if activity else None
        if call is not None and not call.answered:
            call.response = pdu
            self._handlers.fault(call, pdu)

    def is_overdue(self, activity: Activity, now: int) -> bool:
        """Whether `expire` would give a call up that has no response."""
        calls, limit = activity.calls, self._limits.call_expiry_ns
        if len(calls) > self._limits.calls:
            return True
        if not calls:
            return False
        until = next(iter(calls.values())).time_ns + limit
        if activity.ordered:  # then no other call is older, now or later
            activity.quiet_until = until
            if now <= until:
                return False
        return any(not call.answered and now - call.time_ns > limit for call in calls.values())

    def expire(self, activity: Activity, now: int) -> None:
        """Gives up calls without response that are too old, and forgets old calls."""
        limit = self._limits.call_expiry_ns
        calls = activity.calls
        oldest: Call = next(iter(calls.values()))
        if len(calls) <= self.usual_calls and now - oldest.time_ns <= limit:
            return  # nothing is old or too much: the usual case, on the way of every call
        if now > activity.quiet_until:
            for seq in [
                seq for seq, call in calls.items()
                if not call.answered and now - call.time_ns > limit
            ]:  # fmt: skip
                self._lose(calls.pop(seq))
        answered = [seq for seq, call in calls.items() if call.answered]
        for seq in answered[: -self._limits.answered_calls]:
            del calls[seq]
        while len(calls) > self._limits.calls:
            call = calls.pop(next(iter(calls)))
            if not call.answered:
                self._handlers.pushed_out(call, "calls")

    def _make_room(self) -> None:
        while len(self.activities) > self._limits.activities:
            for call in self.activities.popitem(last=False)[1].calls.values():
                if not call.answered:
                    self._handlers.pushed_out(call, "activities")

    def _lose(self, call: Call) -> None:
        self.counts["unanswered"] += 1
        self._handlers.lost(call)
