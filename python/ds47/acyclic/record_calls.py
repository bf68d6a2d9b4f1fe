"""RPC calls to the records in them: passes the request and the response of each record to `record_events`.

Takes RPC calls from `profinet.calls`. Reports what is wrong with the transport of a record call (DS1xx, DS208).
Knows the address of a record, not its content.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final

from ds47.acyclic.pairing import Moment, Outcome, Pairing
from ds47.acyclic.record_events import RecordEvents
from ds47.findings.remark import Remark
from ds47.profinet import rpc
from ds47.profinet.calls import RpcCall, What
from ds47.profinet.completeness import Completeness
from ds47.profinet.records import (
    Half,
    Peer,
    Record,
    connected_ar,
    is_only_ar,
    parse_answers,
    parse_request,
    parse_response,
    released_ar,
    without_block,
)
from ds47.spec.layouts import (
    RECORD_WRITE_MULTIPLE,
    RPC_CONNECT,
    RPC_READ,
    RPC_READ_IMPLICIT,
    RPC_RELEASE,
    RPC_WRITE,
)
from ds47.spec.semantics import Limits

OPERATIONS: Final = {RPC_READ: "Read", RPC_WRITE: "Write", RPC_READ_IMPLICIT: "ReadImplicit"}
_OF_REQUESTS: Final = ("calls", "activities", "pending_writes", "unanswered_writes")
"""Limits that push out requests: then only their responses may still come."""


class RecordCalls:
    """Takes what happens to calls (`profinet.calls.Became`).

    Args:
        events: hears of every record that may be ours.
        pairing: hears when a connection begins.
        outcomes: gets the transport findings, foreign Writes, and what a Connect sets up.
        completeness: hears of calls with an unknown place, because the capture cut them.
        limits: the numbers of spec/limits.toml.
        vendor: IP address -> vendor id, for devices whose calls do not say it; None: unknown.
    """

    def __init__(
        self,
        events: RecordEvents,
        pairing: Pairing,
        outcomes: list[Outcome],
        completeness: Completeness,
        limits: Limits,
        vendor: Callable[[str], int | None] | None = None,
    ) -> None:
        self._who = _who if vendor is None else lambda *about: _named(_who(*about), vendor)
        """The peer, from the addresses and the object UUID, with the vendor of the device."""
        self._limits = limits
        self._events = events
        self._concerned = events.concerned
        self._pairing = pairing
        self._outcomes = outcomes
        self._completeness = completeness
        self._forgot_requests = False
        """Whether a limit pushed out a request, so that its response may still come."""
        self._newest = 0
        """The frame of the newest response that concerns us."""
        self._alone: OrderedDict[int, list[Remark]] = OrderedDict()
        """Frame -> DS102, for the newest responses without a request."""
        self._connections: dict[tuple[str, str], rpc.Pdu] = {}
        """Client and server -> the request that begins or ends an AR, until its response or their next request."""
        self.handlers: dict[What, Callable[[Any, Any], None]] = {
            "asked": self._asked, "answered": self._answered, "failed": self._failed,
            "again": self._again, "late": self._late, "twice": self._twice,
            "unasked": lambda before, pdu: self._unasked(pdu, before, certain=True),
            "unasked_in_part": lambda before, pdu: self._unasked(pdu, before, certain=False),
            "lost": self._lost, "pushed_out": self._lost,
            "incomplete": lambda call, pdu: self.incomplete(pdu, "RPC", call),
        }  # fmt: skip
        """What happened to a call (`profinet.calls.Became`) -> what takes the call and its message."""

    def finish(self) -> None:
        """The capture is over: reports each limit that pushed something out, once (DS109).

        Not if it only pushed out requests, and no response came since: then nothing was lost.
        """
        for name, (frame, count) in self._events.pushed_out.items():
            if name in _OF_REQUESTS and self._newest < frame:
                continue
            args = {"limit": name, "most": getattr(self._limits, name), "count": count}
            self._outcomes.append(("remark", Remark("DS109", frame, args), None))

    def incomplete(self, given_up: rpc.GivenUp, kind: str, call: RpcCall | None = None) -> None:
        """A message was given up before all its fragments were there.

        Args:
            given_up: its first fragment, or the first one seen, and why.
            kind: "RPC" or "IP".
            call: the call that it answers, if known.
        """
        pdu, have, limit = given_up
        asked = next((each for each in call.context if each.may_be_ours), None) if call else None
        record = self._first_record(pdu) or asked
        if record is None:
            return
        if asked is not None and not record.write:
            record = asked
        if limit:
            self._events.pass_on(record, "pushed_out", (limit, pdu.frame))
            self._forgot_requests |= pdu.ptype == 0
        else:
            remark = Remark("DS105", pdu.frame, {"have": have, "kind": kind})
            self._events.pass_on(record, "remark" if record.write else "about", remark)

    def _first_record(self, pdu: rpc.Pdu) -> Record | None:
        """The first record in the beginning of a message; None if it shows none that can be ours."""
        if pdu.fragment or pdu.ptype not in (0, 2):
            return None
        peer = self._who(pdu.client, pdu.server, pdu.object_uuid)
        if pdu.ptype == 0:
            records = parse_request(pdu, peer, self._concerned)[0]
        else:
            records = parse_response(pdu, peer, self._concerned)[1]
        return records[0] if records and records[0].may_be_ours else None

    # Requests

    def _asked(self, call: RpcCall, pdu: rpc.Pdu) -> None:
        if self._connections:
            self._goes_on(pdu)
        if pdu.opnum not in OPERATIONS:
            self._wait(pdu)
            return
        events = self._events
        peer = self._who(pdu.client, pdu.server, pdu.object_uuid)
        records, multiple = parse_request(pdu, peer, self._concerned)
        if multiple or not records:
            self._several(pdu, records, multiple)
        call.context = records
        for record in records:
            events.requests[record.index, record.write] += 1
            if self._pairing.replaced:
                self._pairing.goes_on(*record.relation)
            if record.may_be_ours:
                events.asked(record, pdu.cut)

    def _several(self, pdu: rpc.Pdu, records: list[Record], multiple: bool) -> None:
        """A request with more or less than one record: an IODWriteMultiple, or one that does not parse."""
        if pdu.missing:
            self._completeness.cut(pdu)
        if multiple:
            self._events.requests[RECORD_WRITE_MULTIPLE, True] += 1
        if any(each.index == RECORD_WRITE_MULTIPLE for each in records):
            self._outcomes.append(("remark", Remark("DS208", pdu.frame), None))

    def _late(self, call: RpcCall, answer: rpc.Pdu) -> None:
        """The request came after its response, which was already reported as one without a request."""
        pdu = call.request
        assert pdu is not None
        for alone in self._alone.pop(answer.frame, ()):
            alone.withdrawn = True
        peer = self._who(pdu.client, pdu.server, pdu.object_uuid)
        answers = parse_response(answer, peer, self._concerned)[1]
        for record in answers:
            if record.may_be_ours:
                self._events.not_unasked(record)
        if pdu.opnum not in (RPC_READ, RPC_READ_IMPLICIT) or not answers:
            self._asked(call, pdu)
            self._answered(call, answer)
            return
        for record in parse_request(pdu, peer, self._concerned)[0]:
            self._events.requests[record.index, False] += 1
            if record.may_be_ours:
                self._events.asked_late(record, answer.frame)

    def _again(self, call: RpcCall, pdu: rpc.Pdu) -> None:
        self._goes_on(pdu)
        args = {"operation": OPERATIONS.get(pdu.opnum, "?"), "first": call.frame}
        self._about_call(call, Remark("DS103", pdu.frame, args))

    def _lost(self, call: RpcCall, _: None) -> None:
        pdu, first = call.request, next((each for each in call.context if each.may_be_ours), None)
        if pdu is not None and first is not None:
            if call.limit:
                self._forgot_requests = True
                self._events.pass_on(first, "pushed_out", (call.limit, pdu.frame))
            elif not call.in_part:  # DS105 says what there is
                args = {"operation": OPERATIONS[call.opnum]}
                self._events.pass_on(first, "about", Remark("DS101", pdu.frame, args))
        for record in call.context:
            if record.may_be_ours and not record.write:
                self._events.pass_on(record, "read_lost")

    def _wait(self, pdu: rpc.Pdu) -> None:
        """A request that begins or ends an AR waits for its response; beyond a limit the oldest stops waiting."""
        key = pdu.client, pdu.server
        if key in self._connections:
            self._connection(pdu)  # sent before the one that waits
        elif pdu.opnum in (RPC_CONNECT, RPC_RELEASE):
            self._connections[key] = pdu
        if len(self._connections) > self._limits.activities:
            oldest = next(iter(self._connections))
            self._connection(self._connections.pop(oldest))

    def _goes_on(self, pdu: rpc.Pdu) -> None:
        """A connection begins or ends with the response, or with the next request of its client.

        Responses to earlier requests may come in between, out of order (P79). Without either, nothing changes.
        """
        begun = self._connections.get((pdu.client, pdu.server))
        if begun is not None and (pdu.ptype != 0 or pdu.time_ns >= begun.time_ns):
            del self._connections[pdu.client, pdu.server]
            self._connection(begun)

    def _connection(self, pdu: rpc.Pdu) -> None:
        """An AR begins or ends, as the request says, or as a response without a request says."""
        at = Moment(pdu.frame, pdu.time_ns)
        if pdu.opnum == RPC_RELEASE and (ar := released_ar(pdu)):
            self._events.released((pdu.client, pdu.server, ar), at)
        elif pdu.opnum == RPC_CONNECT:
            ar, only = connected_ar(pdu), is_only_ar(pdu)
            self._pairing.connected(pdu.client, pdu.server, at, ar, only=only)

    # Responses

    def _answered(self, call: RpcCall, pdu: rpc.Pdu) -> None:
        if pdu.opnum not in OPERATIONS:
            self._goes_on(pdu)
            if call.opnum == RPC_CONNECT and call.request is not None:
                self._outcomes.append(("set_up", call.request, pdu))
        if not call.context:
            return
        status, answers = parse_answers(pdu)
        for number, record in enumerate(call.context):
            may_be_ours = record.may_be_ours
            if not may_be_ours and not record.write:
                continue
            there = number < len(answers)
            half = answers[number][0] if there else without_block(pdu, status, write=record.write)
            record.response = half
            if not may_be_ours:
                self._outcomes.append(("foreign", record, None))
                continue
            self._newest = pdu.frame
            if half.status is None and not half.cut:
                self._events.pass_on(record, "about", Remark("DS108", pdu.frame))
            self._events.answered(record, pdu.cut)

    def _unasked(self, pdu: rpc.Pdu, before: int, *, certain: bool) -> None:
        if pdu.opnum not in OPERATIONS:
            self._goes_on(pdu)
            self._connection(pdu)
            return
        peer = self._who(pdu.client, pdu.server, pdu.object_uuid)
        records = parse_response(pdu, peer, self._concerned)[1]
        if not records:
            self._completeness.cut(pdu)
        for record in records:
            if not record.may_be_ours:
                continue
            self._newest, record.asked_before = pdu.frame, before
            if certain and not self._forgot_requests:
                args = {"operation": OPERATIONS[pdu.opnum]}
                remark = Remark("DS102", pdu.frame, args)
                self._alone.setdefault(pdu.frame, []).append(remark)
                if len(self._alone) > self._limits.calls:
                    self._alone.popitem(last=False)
                self._events.pass_on(record, "about", remark)
            if record.write:
                self._outcomes.append(("foreign", record, None))
            self._events.unasked(record, pdu.cut)

    def _twice(self, call: RpcCall, pdu: rpc.Pdu) -> None:
        args = {
            "operation": OPERATIONS.get(pdu.opnum, "?"),
            "first": call.response_frame,
            "has": "has_either" if call.again else "has_first",
        }
        self._about_call(call, Remark("DS111", pdu.frame, args))
        # What the second response brought, the device may have given away: a Read finds nothing more.
        reads = pdu.opnum in (RPC_READ, RPC_READ_IMPLICIT)
        for record in call.context if call.again or reads else ():
            if record.may_be_ours:
                self._events.pass_on(record, "answered_twice")

    def _failed(self, call: RpcCall, pdu: rpc.Pdu) -> None:
        code = int.from_bytes(pdu.body[:4], "little" if pdu.little else "big")
        args = {"kind": rpc.PTYPES[pdu.ptype], "fault": code}
        self._about_call(call, Remark("DS104", pdu.frame, args))
        if call.opnum not in OPERATIONS:
            self._goes_on(pdu)
            return
        for record in call.context:
            if record.may_be_ours:
                what = "write_failed" if record.write else "read_over"
                self._events.pass_on(record, what, Half(pdu.frame, pdu.time_ns))

    # Findings

    def _about_call(self, call: RpcCall, remark: Remark) -> None:
        """A finding about an RPC call: once, and with the first job that it carries."""
        for record in call.context:
            if record.may_be_ours:
                self._events.pass_on(record, "about", remark)
                return


@lru_cache(maxsize=4096)
def _who(client: str, server: str, object_uuid: bytes) -> Peer:
    identity = rpc.device_identity(object_uuid) or (None, None)
    return Peer(client, server, *identity)


def _named(peer: Peer, vendor: Callable[[str], int | None]) -> Peer:
    """The peer with the vendor of the device, also if its calls do not say it."""
    return peer if peer.vendor_id is not None else peer._replace(vendor_id=vendor(peer.device))
