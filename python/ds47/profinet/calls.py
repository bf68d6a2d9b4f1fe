"""RPC calls: which response belongs to which request (docs/pairing.md, RPC level).

Drops copies, joins fragments, tells retransmissions and reused numbers apart. Gives each call exactly once.
`records` parses what a call carries. `acyclic` knows what it means for the parameter channel.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

from ds47.profinet.completeness import Completeness, Numbers
from ds47.profinet.rpc import NO_OPERATION, Fragments, GivenUp, Pdu
from ds47.profinet.stations import Stations
from ds47.spec.layouts import RPC_CONNECT, RPC_READ, RPC_READ_IMPLICIT
from ds47.spec.plain import Plain
from ds47.spec.semantics import Limits


@dataclass(slots=True, eq=False, init=False, repr=False)
class RpcCall:
    """One RPC call."""

    request: Pdu | None
    """None after its response, except for a Connect: many calls are remembered."""
    frame: int
    """The frame of the request."""
    opnum: int
    """Its operation."""
    port: int
    """The UDP port of its client."""
    request_hash: int
    """A hash of the body of the request: repetitions have the same."""
    response_frame: int
    """The frame of the response or the fault; 0 for none so far."""
    response_ns: int
    """The time of that frame."""
    response_hash: int
    """A hash of its body."""
    in_part: bool
    """Whether fragments of a response were seen."""
    sent_ns: int
    """When the request was last sent."""
    heard_ns: int
    """When it was last sent or answered."""
    again: int
    """The last frame in which the request came again, except by a mirror port; 0 for none."""
    limit: str
    """The limit (spec/limits.toml) that gave it up without a response; "" for none."""
    context: Sequence[Any]
    """The records that it carries; the layer above sets them."""

    def __init__(self, request: Pdu) -> None:
        self.request, self.frame, self.opnum = request, request.frame, request.opnum
        self.port, self.request_hash = request.port, hash(request.body)
        self.response_frame = self.response_ns = self.response_hash = 0
        self.in_part = False
        self.limit = ""
        self.sent_ns = self.heard_ns = request.time_ns
        self.again = 0
        self.context = ()


@dataclass(slots=True, init=False, repr=False, eq=False)
class Activity(Plain):
    """The open calls of one RPC activity."""

    calls: dict[int, RpcCall]
    """Calls without a response, by sequence number; the oldest request first."""
    oldest_ns: int
    """None of them was sent before that time."""
    server: str
    """The server that it called last."""
    numbers: Numbers
    anew: int
    """The frame that used a number for another call: the client counts anew from there. 0 for none."""
    doubled: int
    """The frame of a response that came again, although its request did not: one is missing. 0 for none."""

    def __init__(self, pdu: Pdu) -> None:
        self.anew = self.doubled = 0
        self.calls = {}
        self.oldest_ns = pdu.time_ns
        self.server = ""
        self.numbers = Numbers(pdu)


What = Literal[
    "asked", "answered", "failed", "again", "late", "twice", "unasked", "unasked_in_part", "lost", "pushed_out",
    "incomplete",
]  # fmt: skip
Became = tuple[What, Any, Any]
"""What happened to a call (`RpcCall` or None), and the message that shows it (`Pdu` or None):

    asked             a new request
    answered, failed  its response; its fault or reject
    again             its request was repeated
    late              its request came after its response: the message is the response
    twice             a second response with other bytes: it belongs to no other call
    unasked           a response without its request in the capture; instead of the call the frame before which the
                      request was sent, 0 if that is unknown
    unasked_in_part   the same, but the capture may have fragments of the request
    lost              its response did not come in time
    pushed_out        a limit gave it up: its response may still come
    incomplete        a message without all its fragments (`GivenUp`), and the open call that it answers
"""


_T = TypeVar("_T")
_Key = tuple[str, bytes, int]
"""Client, activity, number."""


class CallTracker:
    """Takes PDUs in the order of the capture.

    Memory is bounded by `Limits`. A call without a response is lost when it expires or at `finish`, and pushed
    out when there are too many. `completeness` hears what is missing, `stations` every message that may name one.
    """

    def __init__(
        self,
        limits: Limits,
        completeness: Completeness | None = None,
        stations: Stations | None = None,
    ) -> None:
        self._limits = limits
        self._expiry_ns, self._most = limits.call_expiry_ns, limits.calls
        self._completeness = completeness or Completeness(limits.activities)
        self._stations = stations or Stations(limits.stations)
        self._early: OrderedDict[_Key, Pdu] = OrderedDict()
        """The newest responses without a request."""
        self._answered: OrderedDict[_Key, RpcCall] = OrderedDict()
        """Answered calls that may still be repeated; the one with the newest message is last."""
        self._due_ns = 0
        """None of them is too old before that time."""
        self._forgot = False
        """Whether some were forgotten because there were too many."""
        self._connects: OrderedDict[tuple[str, str], int] = OrderedDict()
        """Client and server -> the frame of the newest Connect."""
        self._activities: OrderedDict[tuple[str, bytes], Activity] = OrderedDict()
        """By client and activity UUID; the one with the newest request is last."""
        self._fragments = Fragments(
            limits.fragment_expiry_ns, limits.rpc_messages, limits.rpc_fragments,
            limits.fragment_bytes,
        )  # fmt: skip
        self._most_datagrams = limits.datagrams
        self._recent: dict[int, int] = {}
        """The newest datagrams: `Pdu.mark` -> time. When there are enough, they become the earlier ones."""
        self._earlier: dict[int, int] = {}
        """The datagrams before them."""
        self._given_up: OrderedDict[_Key, None] = OrderedDict()
        """The newest requests without a response in time."""
        self._begun: OrderedDict[_Key, None] = OrderedDict()
        """Incomplete requests: only fragments were seen."""
        self.counts = dict.fromkeys(
            ("requests", "responses", "faults", "rejects", "pings", "working", "others",
             "copies", "retransmissions", "unanswered"), 0,
        )  # fmt: skip

    def take(self, pdu: Pdu) -> Sequence[Became]:
        """Takes the next PDU. Returns what happened to calls, in order.

        Nothing happens for a copy: the same datagram with the same IP id came twice, or is in the file twice.
        An IP id of 0 says nothing. Then it is a copy only within the copy window.
        """
        told: list[Became] = []
        if pdu.opnum == NO_OPERATION:
            if pdu.ptype == 0:
                # calls of the endpoint mapper share the sequence numbers
                self._activity(pdu, told).numbers.add(pdu)
                self._activities.move_to_end((pdu.client, pdu.activity))
            return told
        recent, mark, now = self._recent, pdu.mark, pdu.time_ns
        before = recent.get(mark)
        if before is None:
            before = self._earlier.get(mark)
        if before is not None and (pdu.ip_id or abs(now - before) <= self._limits.copy_ns):
            self.counts["copies"] += 1
            if now - before > self._limits.copy_ns:
                self._came_again(pdu)
            return told
        recent[mark] = now
        if len(recent) >= self._most_datagrams:
            self._earlier, self._recent = recent, {}
        whole = self._joined(pdu, told) if pdu.fragmented else pdu
        if whole is None:
            return told
        ptype = whole.ptype
        if ptype == 0:
            self._request(whole, told)
        elif ptype == 2:
            self._response(whole, told)
        elif ptype in (3, 6):
            self._fault(whole, told)
        else:
            self.counts[{1: "pings", 4: "working"}.get(ptype, "others")] += 1
        return told

    def _came_again(self, pdu: Pdu) -> None:
        """The wire doubled a message. A device that does not remember its responses executes a request again."""
        if pdu.ptype != 0:
            self._completeness.doubled(pdu)
            return
        activity = self._activities.get((pdu.client, pdu.activity))
        call = self._answered.get((pdu.client, pdu.activity, pdu.seq))
        if call is None and activity is not None:
            call = activity.calls.get(pdu.seq)
        if call is not None:
            call.again = pdu.frame

    def _joined(self, pdu: Pdu, told: list[Became]) -> Pdu | None:
        """The message that an RPC fragment completes; None if it completes none."""
        fragments = self._fragments
        whole = fragments.feed(pdu)
        if fragments.given_up:
            told += [("incomplete", self.open_call(each.pdu), each) for each in fragments.given_up]
            fragments.given_up = []
        if whole is None:
            self.take_fragment(pdu)
        return whole

    def take_fragment(self, pdu: Pdu) -> None:
        """Takes a fragment that completes no message: its request or response is not entirely missing."""
        if pdu.ptype == 0:
            begun = self._begun
            begun[pdu.client, pdu.activity, pdu.seq] = None
            if len(begun) > self._limits.rpc_messages:
                begun.popitem(last=False)
        elif (call := self.open_call(pdu)) is not None:
            call.in_part = True

    def open_call(self, pdu: Pdu) -> RpcCall | None:
        """The open call that a part of a response belongs to; None if there is none."""
        activity = self._activities.get((pdu.client, pdu.activity)) if pdu.ptype == 2 else None
        return activity.calls.get(pdu.seq) if activity is not None else None

    def finish(self) -> list[Became]:
        """The capture is over: gives up incomplete messages, and every open call is lost."""
        told: list[Became] = [
            ("incomplete", self.open_call(pdu), GivenUp(pdu, have, ""))
            for pdu, have in self._fragments.unfinished()
        ]
        while self._activities:
            activity = self._activities.popitem(last=False)[1]
            for seq, call in activity.calls.items():
                self._lose(call, told, went_on=seq < activity.numbers.highest, ended=True)
        return told

    def _request(self, pdu: Pdu, told: list[Became]) -> None:
        self.counts["requests"] += 1
        if pdu.opnum == RPC_CONNECT:
            self._stations.message(pdu)
        activity, seq = self._activities.get((pdu.client, pdu.activity)), pdu.seq
        if activity is None or activity.server is not pdu.server:
            activity = self._activity(pdu, told)
        self._activities.move_to_end((pdu.client, pdu.activity))
        key, calls, numbers = (pdu.client, pdu.activity, seq), activity.calls, activity.numbers
        if calls and (
            pdu.time_ns - activity.oldest_ns > self._expiry_ns or len(calls) > self._most
        ):
            self._expire(activity, pdu, told)
        call = calls.get(seq) or self._answered.get(key)
        if call is not None:
            same = call.request_hash == hash(pdu.body) and call.port == pdu.port
            if same and call.opnum == pdu.opnum and not self._is_over(activity, call, pdu):
                self._repeated(activity, call, pdu)
                told.append(("again", call, pdu))
                return
            activity.anew, numbers.answered = pdu.frame, -1
            if not call.response_frame:
                self._lose(call, told, went_on=True)
                del calls[seq]  # the new one goes to the end
        if seq <= numbers.highest and (numbers.is_late(pdu) or seq < numbers.answered):
            self._completeness.disordered(pdu)
        if pdu.opnum == RPC_CONNECT:
            self._connected(pdu)
        early = self._early.pop(key, None) if self._early else None
        if seq == numbers.highest + 1:
            numbers.highest, numbers.newest = seq, pdu
        else:
            numbers.add(pdu, renewed=early is None)
        if not calls or pdu.time_ns < activity.oldest_ns:
            activity.oldest_ns = pdu.time_ns
        call = calls[seq] = RpcCall(pdu)
        if early is None:
            told.append(("asked", call, pdu))
        else:
            self._request_after_response(early, activity, call, pdu, told)

    def _request_after_response(
        self, early: Pdu, activity: Activity, call: RpcCall, pdu: Pdu, told: list[Became]
    ) -> None:
        """A request comes after a response with its number: both may be one call."""
        if 0 <= early.time_ns - pdu.time_ns <= self._expiry_ns:
            if early.ptype == 2:
                told.append(("late", call, early))
            else:
                told += (("asked", call, pdu), ("failed", call, early))
            self._answer(activity, call, early)
            call.request = pdu  # it was not read before
            self._completeness.asked_after_all(early)
        elif self._was_read(pdu, early):
            self._answer(activity, call, early)
            self._repeated(activity, call, pdu)
            told.append(("again", call, pdu))
        else:
            told.append(("asked", call, pdu))

    def _was_read(self, pdu: Pdu, early: Pdu) -> bool:
        """Whether a Read is repeated, its first request is missing, and its response was captured before."""
        reads = pdu.opnum in (RPC_READ, RPC_READ_IMPLICIT) and early.opnum == pdu.opnum
        reads = reads and not self._is_begun_since(pdu, early.frame)
        return reads and 0 < pdu.time_ns - early.time_ns <= self._expiry_ns

    def _repeated(self, activity: Activity, call: RpcCall, pdu: Pdu) -> None:
        self.counts["retransmissions"] += 1
        call.sent_ns = pdu.time_ns
        call.again = pdu.frame
        if not call.response_frame:
            call.heard_ns = pdu.time_ns
            activity.oldest_ns = min(activity.oldest_ns, pdu.time_ns)
        else:
            call.heard_ns = max(pdu.time_ns, call.response_ns)
            self._answered.move_to_end((pdu.client, pdu.activity, pdu.seq))
            self._due_ns = 0

    def _activity(self, pdu: Pdu, told: list[Became]) -> Activity:
        """The activity of a PDU; a new one begins here, and so does a change of its server."""
        key = (pdu.client, pdu.activity)
        activity = self._activities.get(key)
        if activity is None:
            activity = self._activities[key] = Activity(pdu)
            self._make_room(told)
        if activity.server is not pdu.server:  # equal texts may be two objects: no harm
            activity.server = pdu.server
            self._completeness.began(pdu, activity.numbers)
        return activity

    def _connected(self, pdu: Pdu) -> None:
        pair = pdu.client, pdu.server
        self._connects[pair] = pdu.frame
        self._connects.move_to_end(pair)
        if len(self._connects) > self._limits.activities:
            self._connects.popitem(last=False)

    def _is_over(self, activity: Activity | None, call: RpcCall, pdu: Pdu) -> bool:
        """Whether the number of a call may now belong to another one: its client no longer repeats it."""
        return self._is_begun_since(pdu, call.frame) or self._is_used_anew(activity, call, pdu)

    def _is_begun_since(self, pdu: Pdu, frame: int) -> bool:
        """Whether there is a Connect of its client to its server after a frame."""
        return self._connects.get((pdu.client, pdu.server), 0) > frame

    def _is_used_anew(self, activity: Activity | None, call: RpcCall, pdu: Pdu) -> bool:
        """Whether the number of a call may now belong to another one, even with the same bytes."""
        anew = activity is not None and activity.anew > call.frame
        return anew or pdu.time_ns - call.heard_ns > self._expiry_ns

    def _response(self, pdu: Pdu, told: list[Became]) -> None:
        self.counts["responses"] += 1
        if pdu.source not in self._stations.known or pdu.opnum == RPC_CONNECT:
            self._stations.message(pdu)
        activity = self._activities.get((pdu.client, pdu.activity))
        call = None
        if activity is not None and (calls := activity.calls):
            if pdu.time_ns - activity.oldest_ns > self._expiry_ns or len(calls) > self._most:
                self._expire(activity, pdu, told)
            call = calls.get(pdu.seq)
        if call is not None and activity is not None:
            self._answer(activity, call, pdu)
            told.append(("answered", call, pdu))
        elif not self._answers_again(activity, pdu, told):
            before = 0 if activity is None else activity.numbers.sent_before(pdu.seq)
            told.append(("unasked" if self._unasked(pdu) else "unasked_in_part", before, pdu))

    def _answers_again(self, activity: Activity | None, pdu: Pdu, told: list[Became]) -> bool:
        """Whether a response or fault is a second one of a call. Adds "twice" if its bytes differ."""
        key = pdu.client, pdu.activity, pdu.seq
        call = self._answered.get(key)
        early = self._early.get(key) if call is None and activity is not None else None
        if early is not None:  # of the same call, but its request is missing
            return pdu.time_ns - early.time_ns <= self._expiry_ns
        if call is None:  # of a forgotten call only the number is known
            known = self._forgot and key not in self._given_up
            return known and activity is not None and activity.numbers.has(pdu.seq)
        if self._is_used_anew(activity, call, pdu):
            return False
        if call.response_hash == hash(pdu.body):  # late, even after a Connect
            self._completeness.doubled(pdu)
            if activity is not None and not call.again:
                activity.doubled = pdu.frame
        elif self._is_over(activity, call, pdu):
            return False
        elif activity is None or activity.doubled < call.frame:
            told.append(("twice", call, pdu))
        return True

    def _answer(self, activity: Activity, call: RpcCall, pdu: Pdu) -> None:
        """A call is answered: it is remembered as long as its client may repeat it."""
        if call.opnum != RPC_CONNECT:
            call.request = None
        seq, now, numbers, answered = pdu.seq, pdu.time_ns, activity.numbers, self._answered
        call.response_frame, call.response_ns, call.response_hash = pdu.frame, now, hash(pdu.body)
        if seq < numbers.highest:
            numbers.ahead += 1
        else:
            numbers.waited += 1
        if seq > numbers.answered:
            if -1 < numbers.answered < seq - 1:
                numbers.passed = True
            numbers.answered = seq
        elif seq < numbers.answered and numbers.is_late(pdu):
            self._completeness.disordered(pdu)
        call.heard_ns = max(call.sent_ns, now)
        del activity.calls[seq]
        key = pdu.client, pdu.activity, seq
        if key in answered:
            self._due_ns = 0
        answered[key] = call
        answered.move_to_end(key)
        if now > self._due_ns:
            self._forget(now - self._expiry_ns)
        if len(answered) > self._limits.answered_calls:
            answered.popitem(last=False)
            oldest = next(iter(answered.values()))  # not by time, if the clock was set back
            self._forgot, self._due_ns = True, min(self._due_ns, oldest.heard_ns + self._expiry_ns)

    def _forget(self, since_ns: int) -> None:
        """Forgets the answered calls without a message since then."""
        answered = self._answered
        while (oldest := next(iter(answered.values()))).heard_ns < since_ns:
            answered.popitem(last=False)
        self._due_ns = oldest.heard_ns + self._expiry_ns

    def _unasked(self, pdu: Pdu) -> bool:
        """Notes a response or fault without its request. Returns whether no part of the request was captured."""
        key = pdu.client, pdu.activity, pdu.seq
        begun = key in self._begun
        if key not in self._given_up:
            self._put(self._early, key, pdu)
            activity = self._activities.get(key[:2])
            numbers = None if activity is None else activity.numbers
            if numbers is not None and not numbers.fills(pdu.seq) and pdu.seq > numbers.highest:
                numbers.add(pdu)
            self._completeness.unasked(pdu)
        return not begun

    def _fault(self, pdu: Pdu, told: list[Became]) -> None:
        self.counts["faults" if pdu.ptype == 3 else "rejects"] += 1
        activity = self._activities.get((pdu.client, pdu.activity))
        call = activity.calls.get(pdu.seq) if activity else None
        if activity is not None and call is not None:
            self._answer(activity, call, pdu)
            told.append(("failed", call, pdu))
        elif not self._answers_again(activity, pdu, told):
            self._unasked(pdu)

    def _expire(self, activity: Activity, pdu: Pdu, told: list[Became]) -> None:
        """Gives up calls without response that are too old, or too many."""
        calls, highest = activity.calls, max(activity.numbers.highest, pdu.seq)
        since = pdu.time_ns - self._expiry_ns
        for seq in [seq for seq, call in calls.items() if call.sent_ns < since]:
            call = calls.pop(seq)
            self._put(self._given_up, (pdu.client, pdu.activity, seq), None)
            self._lose(call, told, went_on=seq < highest)
        activity.oldest_ns = min((call.sent_ns for call in calls.values()), default=pdu.time_ns)
        while len(calls) > self._limits.calls:
            seq = next(iter(calls))
            call = calls.pop(seq)
            if seq < activity.numbers.answered:
                self._put(self._given_up, (pdu.client, pdu.activity, seq), None)
                self._lose(call, told, went_on=True)
            else:
                _push_out(call, "calls", told)

    def _put(self, memory: OrderedDict[_Key, _T], key: _Key, value: _T) -> None:
        """Remembers something about a call; beyond the limit the oldest is forgotten."""
        memory[key] = value
        if len(memory) > self._limits.calls:
            memory.popitem(last=False)

    def _make_room(self, told: list[Became]) -> None:
        while len(self._activities) > self._limits.activities:
            for call in self._activities.popitem(last=False)[1].calls.values():
                _push_out(call, "activities", told)

    def _lose(
        self, call: RpcCall, told: list[Became], *, went_on: bool, ended: bool = False
    ) -> None:
        if call.request is not None:
            self._completeness.lost(call.request, went_on=went_on, ended=ended)
        self.counts["unanswered"] += 1
        told.append(("lost", call, None))


def _push_out(call: RpcCall, limit: str, told: list[Became]) -> None:
    call.limit = limit
    told.append(("pushed_out", call, None))
