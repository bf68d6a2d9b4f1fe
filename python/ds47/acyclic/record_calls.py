"""RPC calls to the records in them: what is asked and answered of each goes on to `record_events`.

Sits between the RPC calls (`profinet.calls`) and those, and reports what is wrong with the transport of a record
call (DS1xx, DS208). Knows of a record where it goes, and nothing of what it holds.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Final

from ds47.acyclic.index47 import SHARED_INDEX, Index47
from ds47.acyclic.pairing import Moment, Pairing, Peer
from ds47.acyclic.record_events import Jobs, RecordEvents
from ds47.findings.remark import Remark
from ds47.profinet import rpc
from ds47.profinet.calls import Call, Handlers
from ds47.profinet.completeness import Completeness
from ds47.profinet.ip import Cut
from ds47.profinet.records import (
    Half,
    Record,
    RequestBody,
    connected_ar,
    is_only_ar,
    parse_request,
    parse_response,
    released_ar,
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

_OPERATIONS: Final = {RPC_READ: "Read", RPC_WRITE: "Write", RPC_READ_IMPLICIT: "ReadImplicit"}


@dataclass(slots=True, init=False)
class _Context:
    """What an RPC call carries: its record calls, and the jobs they belong to."""

    body: RequestBody
    jobs: Jobs
    peer: Peer

    def __init__(self, body: RequestBody, peer: Peer) -> None:
        self.body = body
        self.jobs = {}
        self.peer = peer


@dataclass(slots=True)
class _PushedOut:
    """What one limit pushed out: where the first of it began, and how much."""

    frame: int
    count: int = 0


class RecordCalls:
    """The handlers of a `CallTracker`.

    Args:
        events: hears of every record that may be ours.
        index47: which records are ours.
        pairing: hears of connections that begin and end.
        remark: takes the transport findings.
        foreign: hears of every answered Write to an index that cannot be ours, or without its request.
        connected: hears of every answered Connect.
        completeness: hears of Writes of which the capture cut off where they go.
        limits: the numbers of spec/limits.toml.
        vendor: gives the vendor id of the device at an IP address whose calls do not say it; None: nobody does.
    """

    def __init__(
        self,
        events: RecordEvents,
        index47: Index47,
        pairing: Pairing,
        remark: Callable[[Remark], None],
        foreign: Callable[[Peer, Record], None],
        connected: Callable[[rpc.Pdu, rpc.Pdu], None],
        completeness: Completeness,
        limits: Limits,
        vendor: Callable[[str], int | None] | None = None,
    ) -> None:
        self._vendor = vendor
        self._limits = limits
        self._events = events
        self._index47 = index47
        self._pairing = pairing
        self._remark = remark
        self._foreign = foreign
        self._connected = connected
        self._completeness = completeness
        self._forgot_requests = False
        """Whether a limit pushed out a request whose response may still come."""
        self._pushed_out: dict[str, _PushedOut] = {}
        """By the name of the limit."""
        self._alone: OrderedDict[int, list[Remark]] = OrderedDict()
        """The newest responses without a request (DS102), by their frames."""
        self._connections: dict[tuple[str, str], rpc.Pdu] = {}
        """Of client and server the request that begins or ends an AR, until its response or the next request."""

    def handlers(self) -> Handlers:
        """What to give to the `CallTracker`."""
        return Handlers(
            self._request, self._response, self._orphan_response, self._second_response,
            self._late_request, self._retransmission, self._fault, self._lost, self._call_pushed_out,
        )  # fmt: skip

    def finish(self) -> None:
        """The capture is over: tells of each limit that pushed something out, once."""
        for name, pushed in self._pushed_out.items():
            most = getattr(self._limits, name)
            args = {"limit": name, "most": most, "count": pushed.count}
            self._remark(Remark("DS109", pushed.frame, args))

    def pushed_out(self, limit: str, frame: int) -> None:
        """A limit pushed out something of ours that began in this frame."""
        pushed = self._pushed_out.get(limit)
        if pushed is None:
            pushed = self._pushed_out[limit] = _PushedOut(frame)
        pushed.count += 1

    def incomplete(
        self, pdu: rpc.Pdu, have: int, kind: str, limit: str = "", call: Call | None = None
    ) -> None:
        """A message whose fragments did not become whole.

        Args:
            pdu: its beginning, or the first that was seen of it.
            have: number of its fragments.
            kind: "RPC" or "IP".
            limit: name of the limit that pushed it out: the others may have come later.
            call: the call that it answers, as far as that is known.
        """
        record = self.first_record(pdu) or self._asked_by(call)
        if record is None:
            return
        if limit:
            self._pushed_out_with(pdu, record, limit)
            self._forgot_requests |= pdu.ptype == 0
        else:
            remark = Remark("DS105", pdu.frame, {"have": have, "kind": kind})
            context = _context(call) if call is not None and not record.write else None
            if context is None:
                self._events.about(self._peer(pdu), record, remark)
            else:
                self._events.about_job(self._peer(pdu), record, remark, context.jobs)

    def first_record(self, pdu: rpc.Pdu) -> Record | None:
        """The first record in the beginning of a message; None where that tells of none that can be ours."""
        if pdu.fragment or pdu.ptype not in (0, 2):
            return None
        records = parse_request(pdu).records if pdu.ptype == 0 else parse_response(pdu)[1]
        return records[0] if records and self._events.concerns(records[0].index) else None

    def _asked_by(self, call: Call | None) -> Record | None:
        """The first record that a call asks for and that can be ours; None for none."""
        context = None if call is None else _context(call)
        records = [] if context is None else context.body.records
        return next((each for each in records if self._events.concerns(each.index)), None)

    # Requests

    def _request(self, call: Call) -> None:
        pdu = call.request
        self._goes_on(pdu)
        if pdu.opnum not in _OPERATIONS:
            self._wait(pdu)
            return
        body = parse_request(pdu)
        context = call.context = _Context(body, self._peer(pdu))
        if pdu.missing and pdu.opnum == RPC_WRITE and (body.multiple or not body.records):
            self._completeness.cut(pdu)
        if body.multiple:
            self._events.count(RECORD_WRITE_MULTIPLE, write=True)
        pairing = self._pairing
        for record in body.records:
            self._events.count(record.index, write=record.write)
            pairing.goes_on(pdu.client, pdu.server, record.ar)
        if body.nested:
            self._remark(Remark("DS208", pdu.frame))
        for record in body.records:
            if self._events.concerns(record.index):
                self._events.asked(context.peer, record, _cut(pdu), context.jobs)

    def _late_request(self, call: Call) -> None:
        """The request of a response that was heard of already, as one without its request."""
        pdu, answer = call.request, call.response
        assert answer is not None
        for alone in self._alone.pop(answer.frame, ()):
            alone.withdrawn = True
        answers = parse_response(answer)[1]
        for record in answers:
            if self._events.concerns(record.index):
                self._events.not_unasked(self._peer(pdu), record)
        if pdu.opnum not in (RPC_READ, RPC_READ_IMPLICIT) or not answers:
            self._request(call)
            self._response(call)
            return
        for record in parse_request(pdu).records:
            self._events.count(record.index, write=False)
            if self._events.concerns(record.index):
                self._events.asked_late(self._peer(pdu), record, answer.frame)

    def _retransmission(self, call: Call, pdu: rpc.Pdu) -> None:
        self._goes_on(pdu)
        args = {"operation": _OPERATIONS.get(pdu.opnum, "?"), "first": call.request.frame}
        self._about_call(call, Remark("DS103", pdu.frame, args))
        context = _context(call)
        if context is None or call.response is not None:
            return
        half_ns = (pdu.time_ns - call.sent_ns) // 2  # timers are not exact
        waits_ns = pdu.time_ns + max(half_ns, self._limits.resend_ns)
        for record in context.body.records:
            if self._events.concerns(record.index):
                self._events.sent_again(self._peer(pdu), record, context.jobs, waits_ns)

    def _lost(self, call: Call) -> None:
        context = _context(call)
        if context is None:
            return
        if not call.in_part:  # DS105 says what there is
            operation = _OPERATIONS[call.request.opnum]
            self._about_call(call, Remark("DS101", call.request.frame, {"operation": operation}))
        self._reads_lost(context)

    def _call_pushed_out(self, call: Call, limit: str) -> None:
        context = _context(call)
        if context is None:
            return
        pdu = call.request
        for record in context.body.records:
            if self._events.concerns(record.index):
                self._forgot_requests = True
                self._pushed_out_with(pdu, record, limit)
                break
        self._reads_lost(context)

    def _reads_lost(self, context: _Context) -> None:
        for record in context.body.records:
            if self._events.concerns(record.index):
                self._events.lost(context.peer, record)

    def _wait(self, pdu: rpc.Pdu) -> None:
        """A request that begins or ends an AR waits; of more than a limit the oldest does no more."""
        key = pdu.client, pdu.server
        if key in self._connections:
            self._connection(pdu)  # sent before the one that waits
        elif pdu.opnum in (RPC_CONNECT, RPC_RELEASE):
            self._connections[key] = pdu
        if len(self._connections) > self._limits.activities:
            oldest = next(iter(self._connections))
            self._connection(self._connections.pop(oldest))

    def _goes_on(self, pdu: rpc.Pdu) -> None:
        """A connection begins or ends with its response, or when its client asks for something else after it.

        Between the two may stand the responses to requests that came before it, which are out of order in the
        capture (P79). One of which neither is there changes nothing.
        """
        begun = self._connections.get((pdu.client, pdu.server)) if self._connections else None
        if begun is not None and (pdu.ptype != 0 or pdu.time_ns >= begun.time_ns):
            del self._connections[pdu.client, pdu.server]
            self._connection(begun)

    def _connection(self, pdu: rpc.Pdu) -> None:
        """An AR begins or ends, as its request says; or a response whose request is missing."""
        at = Moment(pdu.frame, pdu.time_ns)
        if pdu.opnum == RPC_RELEASE and (ar := released_ar(pdu)):
            over = partial(self._pairing.release, pdu.client, pdu.server, ar, at)
            over()
            self._index47.follow((pdu.client, pdu.server, ar), partial(over, SHARED_INDEX))
        elif pdu.opnum == RPC_CONNECT:
            ar, only = connected_ar(pdu), is_only_ar(pdu)
            self._pairing.connected(pdu.client, pdu.server, at, ar, only=only)

    # Responses

    def _response(self, call: Call) -> None:
        pdu, context = call.response, _context(call)
        if pdu is not None and pdu.opnum not in _OPERATIONS:
            self._goes_on(pdu)
            if pdu.opnum == RPC_CONNECT:
                self._connected(call.request, pdu)
        if pdu is None or context is None:
            return
        status, answers = parse_response(pdu)
        for number, record in enumerate(context.body.records):
            ours = self._events.concerns(record.index)
            if not ours and not record.write:
                continue
            half = answers[number].response if number < len(answers) else None
            if half is None:  # no block of its own: the status of the NDR header counts
                half = Half(pdu.frame, pdu.time_ns, status=status)
            record.response = half
            if not ours:
                self._foreign(self._peer(pdu), record)
                continue
            if half.status is None:
                remark = Remark("DS108", pdu.frame)
                self._events.about_job(self._peer(pdu), record, remark, context.jobs)
            self._events.answered(self._peer(pdu), record, _cut(pdu), context.jobs)

    def _orphan_response(self, pdu: rpc.Pdu, certain: bool) -> None:
        if pdu.opnum not in _OPERATIONS:
            self._goes_on(pdu)
            self._connection(pdu)
            return
        records = parse_response(pdu)[1]
        if not records:
            self._completeness.cut(pdu)
        for record in records:
            if not self._events.concerns(record.index) or record.response is None:
                continue
            if certain and not self._forgot_requests:
                args = {"operation": _OPERATIONS[pdu.opnum]}
                remark = Remark("DS102", pdu.frame, args)
                self._alone.setdefault(pdu.frame, []).append(remark)
                if len(self._alone) > self._limits.calls:
                    self._alone.popitem(last=False)
                self._events.about(self._peer(pdu), record, remark)
            if record.write:
                self._foreign(self._peer(pdu), record)
            self._events.unasked(self._peer(pdu), record, _cut(pdu))

    def _second_response(self, call: Call, pdu: rpc.Pdu) -> None:
        assert call.response is not None
        args = {
            "operation": _OPERATIONS.get(pdu.opnum, "?"),
            "first": call.response.frame,
            "has": "has_either" if call.again else "has_first",
        }
        self._about_call(call, Remark("DS111", pdu.frame, args))
        context = _context(call)
        if context is None or not call.again:
            return
        for record in context.body.records:
            if self._events.concerns(record.index):
                self._events.answered_twice(self._peer(pdu), record, context.jobs)

    def _fault(self, call: Call, pdu: rpc.Pdu) -> None:
        code = int.from_bytes(pdu.body[:4], "little" if pdu.little else "big")
        args = {"kind": rpc.PTYPES[pdu.ptype], "fault": code}
        self._about_call(call, Remark("DS104", pdu.frame, args))
        context = _context(call)
        if context is None:
            self._goes_on(pdu)
            return
        for record in context.body.records:
            if self._events.concerns(record.index):
                half = Half(pdu.frame, pdu.time_ns)
                self._events.failed(self._peer(pdu), record, half, context.jobs)

    def _peer(self, pdu: rpc.Pdu) -> Peer:
        """Who talks to whom, by the addresses and the object UUID, and whose the device is."""
        found = _who(pdu.client, pdu.server, pdu.object_uuid)
        if found.vendor_id is None and self._vendor is not None:
            return found._replace(vendor_id=self._vendor(found.device))
        return found

    # Findings

    def _about_call(self, call: Call, remark: Remark) -> None:
        """A finding about an RPC call: once, and with the first job that it carries."""
        context = _context(call)
        if context is None:
            return
        for record in context.body.records:
            if self._events.concerns(record.index):
                self._events.about_job(context.peer, record, remark, context.jobs)
                return

    def _pushed_out_with(self, pdu: rpc.Pdu, record: Record, limit: str) -> None:
        self._events.pass_on(self._peer(pdu), record, partial(self.pushed_out, limit, pdu.frame))


def _context(call: Call) -> _Context | None:
    """What the call carries; None where it carries no records."""
    context = call.context
    return context if isinstance(context, _Context) else None


def _cut(pdu: rpc.Pdu) -> Cut | None:
    """Where the capture cut the message; None where it did not."""
    return pdu.cut if pdu.missing else None


@lru_cache(maxsize=4096)
def _who(client: str, server: str, object_uuid: bytes) -> Peer:
    identity = rpc.device_identity(object_uuid) or (None, None)
    return Peer(client, server, *identity)
