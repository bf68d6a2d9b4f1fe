"""RPC calls: which response belongs to which request (docs/pairing.md, RPC level).

Tells copies, retransmissions and reused numbers apart and hands each call on exactly once. What a call
carries is `records`' business; what it means for the parameter channel is `ds47.pairing`'s.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ds47.profinet.rpc import Pdu
from ds47.spec.semantics import Limits


@dataclass(slots=True, init=False)
class Call:
    """One RPC call; `context` is for the layer above."""

    request: Pdu
    response: Pdu | None
    context: Any

    def __init__(
        self,
        request: Pdu,
        response: Pdu | None = None,
        context: Any = None,
    ) -> None:
        self.request = request
        self.response = response
        self.context = context


@dataclass(slots=True, init=False)
class _Activity:
    newest: int
    calls: OrderedDict[int, Call]

    def __init__(
        self,
        newest: int,
        calls: OrderedDict[int, Call] | None = None,
    ) -> None:
        self.newest = newest
        self.calls = OrderedDict() if calls is None else calls


@dataclass(slots=True, init=False)
class Handlers:
    """What the layer above wants to hear. Each is called at most once for one event of one call."""

    request: Callable[[Call], None]
    response: Callable[[Call], None]
    orphan_response: Callable[[Pdu], None]
    retransmission: Callable[[Call, Pdu], None]
    fault: Callable[[Call, Pdu], None]
    lost: Callable[[Call], None]

    def __init__(
        self,
        request: Callable[[Call], None],
        response: Callable[[Call], None],
        orphan_response: Callable[[Pdu], None],
        retransmission: Callable[[Call, Pdu], None],
        fault: Callable[[Call, Pdu], None],
        lost: Callable[[Call], None],
    ) -> None:
        self.request = request
        self.response = response
        self.orphan_response = orphan_response
        self.retransmission = retransmission
        self.fault = fault
        self.lost = lost


class CallTracker:
    """Feeds on whole RPC messages in the order of the capture.

    Memory is bounded by `Limits`; a call without response is reported as lost when it expires, when
    it is pushed out, or at `finish`.
    """

    def __init__(self, limits: Limits, handlers: Handlers) -> None:
        self._limits = limits
        self._handlers = handlers
        self._usual_calls = min(2 * limits.answered_calls, limits.calls)
        self._activities: OrderedDict[tuple[str, bytes], _Activity] = OrderedDict()
        self._datagrams: OrderedDict[tuple[str, str, int, int, int], int] = OrderedDict()
        self.counts = dict.fromkeys(
            ("requests", "responses", "faults", "rejects", "pings", "working", "others",
             "copies", "retransmissions", "unanswered"), 0,
        )  # fmt: skip

    def is_copy(self, pdu: Pdu) -> bool:
        """Whether the same datagram with the same IP id was here within the copy window."""
        datagrams = self._datagrams
        key = (pdu.source, pdu.destination, pdu.ip_id, pdu.ptype << 16 | pdu.fragment,
               hash((pdu.activity, pdu.seq, pdu.body)))  # fmt: skip
        before = datagrams.get(key)
        datagrams[key] = pdu.time_ns
        if before is None:
            if len(datagrams) > self._limits.datagrams:
                datagrams.popitem(last=False)
        elif abs(pdu.time_ns - before) <= self._limits.copy_ns:
            datagrams[key] = before
            self.counts["copies"] += 1
            return True
        else:
            datagrams.move_to_end(key)
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

    def finish(self) -> None:
        """The capture is over: every open call is lost."""
        while self._activities:
            self._drop(self._activities.popitem(last=False)[1])

    def _request(self, pdu: Pdu) -> None:
        self.counts["requests"] += 1
        key = (pdu.client, pdu.activity)
        activity = self._activities.get(key)
        if activity is None:
            activity = self._activities[key] = _Activity(pdu.seq)
            self._make_room()
        self._activities.move_to_end(key)
        calls, seq = activity.calls, pdu.seq
        if calls:
            self._expire(activity, pdu.time_ns)
        call = calls.get(seq)
        if call is not None:
            if self._is_retransmission(activity, call, pdu):
                self.counts["retransmissions"] += 1
                self._handlers.retransmission(call, pdu)
                return
            if call.response is None:
                self._lose(call)
            del calls[seq]  # the new one goes to the end
        activity.newest = seq
        call = calls[seq] = Call(pdu)
        self._handlers.request(call)

    def _is_retransmission(self, activity: _Activity, call: Call, pdu: Pdu) -> bool:
        if call.request.opnum != pdu.opnum or call.request.body != pdu.body:
            return False
        if call.response is None:
            return True
        soon = pdu.time_ns - call.response.time_ns <= self._limits.retransmission_ns
        return soon and activity.newest == pdu.seq

    def _response(self, pdu: Pdu) -> None:
        activity = self._activities.get((pdu.client, pdu.activity))
        call = None
        if activity is not None:
            if activity.calls:
                self._expire(activity, pdu.time_ns)
            call = activity.calls.get(pdu.seq)
        if call is None:
            self._handlers.orphan_response(pdu)
        elif call.response is None:
            call.response = pdu
            self._handlers.response(call)
        elif call.response.body != pdu.body:
            self._handlers.orphan_response(pdu)

    def _fault(self, pdu: Pdu) -> None:
        activity = self._activities.get((pdu.client, pdu.activity))
        call = activity.calls.get(pdu.seq) if activity else None
        if call is not None and call.response is None:
            call.response = pdu
            self._handlers.fault(call, pdu)

    def _expire(self, activity: _Activity, now: int) -> None:
        limit = self._limits.call_expiry_ns
        calls = activity.calls
        oldest: Call = next(iter(calls.values()))
        if len(calls) <= self._usual_calls and now - oldest.request.time_ns <= limit:
            return  # nothing is old or too much: the usual case, on the way of every call
        answered: list[int] = []
        expired: list[int] = []
        for seq, call in calls.items():
            if call.response is not None:
                answered.append(seq)
            elif now - call.request.time_ns > limit:
                expired.append(seq)
        for seq in expired:
            self._lose(calls.pop(seq))
        for seq in answered[: -self._limits.answered_calls]:
            del calls[seq]
        while len(calls) > self._limits.calls:
            _seq, call = calls.popitem(last=False)
            if call.response is None:
                self._lose(call)

    def _make_room(self) -> None:
        while len(self._activities) > self._limits.activities:
            self._drop(self._activities.popitem(last=False)[1])

    def _drop(self, activity: _Activity) -> None:
        for call in activity.calls.values():
            if call.response is None:
                self._lose(call)

    def _lose(self, call: Call) -> None:
        self.counts["unanswered"] += 1
        self._handlers.lost(call)
