"""Record calls to DS47 events: what an RPC call carries, whether it is ours, and where it goes.

Sits between the RPC calls (`profinet.calls`) and the jobs (`pairing`), and reports what is wrong with
the transport of a record call (DS1xx, DS202, DS208). Decodes a message once; compares nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, Final

from ds47.acyclic.index47 import SHARED_INDEX, ArKey, Index47
from ds47.acyclic.pairing import Job, Pairing, Peer
from ds47.findings.remark import Remark
from ds47.profidrive import Options, Request, decode_request, decode_response
from ds47.profinet import rpc
from ds47.profinet.calls import Call, Handlers
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

_MOST_SHARED: Final = 4_096
"""Decoded requests that are kept to be used again,"""
_LONGEST_SHARED: Final = 512
"""and how many bytes each of them may have."""


@dataclass(slots=True, init=False)
class _Context:
    """What an RPC call carries: its record calls, and by their position the jobs they belong to.

    That is the job of a Write, and the one whose response a Read was to fetch.
    """

    body: RequestBody
    jobs: dict[int, Job]
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
        index47: which records are ours.
        pairing: hears of every Write and Read that is ours.
        codec: dialects of the messages.
        remark: takes the transport findings.
        foreign: hears of every answered Write to an index that cannot be ours, or without its request.
        connected: hears of every answered Connect.
        limits: the numbers of spec/limits.toml.
    """

    def __init__(
        self,
        index47: Index47,
        pairing: Pairing,
        codec: Options,
        remark: Callable[[Remark], None],
        foreign: Callable[[Peer, Record], None],
        connected: Callable[[rpc.Pdu, rpc.Pdu], None],
        limits: Limits,
    ) -> None:
        self._limits = limits
        self._index47 = index47
        self._pairing = pairing
        self._codec = codec
        self._remark = remark
        self._foreign = foreign
        self._connected = connected
        self.newest_ns: int | None = None
        """The time of the newest frame of a call that is ours,"""
        self.newest_frame = 0
        """and its number."""
        self._requests: dict[bytes, Request] = {}
        self.counts: dict[int, dict[str, int]] = {}
        """Record requests by index: {"read": n, "write": n}."""
        self._forgot_requests = False
        """Whether a limit pushed out a request whose response may still come."""
        self._pushed_out: dict[str, _PushedOut] = {}
        """By the name of the limit."""

    def handlers(self) -> Handlers:
        """What to give to the `CallTracker`."""
        return Handlers(
            self._request, self._response, self._orphan_response, self._retransmission,
            self._fault, self._lost, self._call_pushed_out,
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
            self._pass(pdu, record, partial(self.pushed_out, limit, pdu.frame))
            self._forgot_requests |= pdu.ptype == 0
        else:
            remark = Remark("DS105", pdu.frame, {"have": have, "kind": kind})
            context = _context(call) if call is not None and not record.write else None
            if context is None:
                self._about(pdu, record, remark)
            else:
                self._pass(pdu, record, partial(self._call_remark, remark, record, context))

    def first_record(self, pdu: rpc.Pdu) -> Record | None:
        """The first record in the beginning of a message; None where that tells of none that can be ours."""
        if pdu.fragment or pdu.ptype not in (0, 2):
            return None
        records = parse_request(pdu).records if pdu.ptype == 0 else parse_response(pdu)[1]
        return records[0] if records and self._index47.concerns(records[0].index) else None

    def _asked_by(self, call: Call | None) -> Record | None:
        """The first record that a call asks for and that can be ours; None for none."""
        context = None if call is None else _context(call)
        records = [] if context is None else context.body.records
        return next((each for each in records if self._index47.concerns(each.index)), None)

    # Requests

    def _request(self, call: Call) -> None:
        pdu = call.request
        if pdu.opnum == RPC_RELEASE and (ar := released_ar(pdu)):
            over = partial(self._pairing.release, pdu.client, pdu.server, ar, pdu.frame)
            over()
            self._index47.follow((pdu.client, pdu.server, ar), partial(over, SHARED_INDEX))
        if pdu.opnum == RPC_CONNECT:
            ar, only = connected_ar(pdu), is_only_ar(pdu)
            self._pairing.connected(pdu.client, pdu.server, pdu.frame, ar, only=only)
        if pdu.opnum not in _OPERATIONS:
            return
        body = parse_request(pdu)
        context = call.context = _Context(body, peer(pdu))
        if body.multiple:
            self._count(RECORD_WRITE_MULTIPLE, write=True)
        pairing = self._pairing
        for record in body.records:
            self._count(record.index, write=record.write)
            pairing.goes_on(pdu.client, pdu.server, record.ar)
        if body.nested:
            self._remark(Remark("DS208", pdu.frame))
        for record in body.records:
            if self._index47.concerns(record.index):
                self._record_request(pdu, record, context)

    def _record_request(self, pdu: rpc.Pdu, record: Record, context: _Context) -> None:
        half = record.request
        assert half is not None
        if half.missing:
            self._length(pdu, record, half)
        passes = self._index47.passes((pdu.client, pdu.server, record.ar), record.index)
        if not record.write:
            if passes:
                self._read_asked(pdu, record, context)
            else:
                self._pass(pdu, record, partial(self._read_asked, pdu, record, context))
            return
        message = self.decoded(half.data)
        if passes:
            self._write(pdu, record, context, message)
        else:
            event = partial(self._write, pdu, record, context, message)
            self._pass(pdu, record, event, shaped=message.shaped)

    def _read_asked(self, pdu: rpc.Pdu, record: Record, context: _Context) -> None:
        self._clock(pdu)
        job = self._pairing.expected(context.peer, record)
        if job is not None:
            context.jobs[record.position] = job

    def _write(self, pdu: rpc.Pdu, record: Record, context: _Context, message: Request) -> None:
        self._clock(pdu)
        context.jobs[record.position] = self._pairing.write_request(context.peer, record, message)

    def decoded(self, data: bytes) -> Request:
        """The request; the same question is asked again and again, often with a reference that counts.

        So the messages that differ in nothing else share their addresses and blocks, which nobody
        changes.
        """
        if not data or not data[0]:  # reference 0 is a flaw
            return decode_request(data, self._codec)
        known = self._requests.get(data[1:])
        if known is None:
            known = decode_request(data, self._codec)
            if len(data) <= _LONGEST_SHARED:
                if len(self._requests) >= _MOST_SHARED:
                    self._requests.clear()
                self._requests[data[1:]] = known
        return known.asked_as(data[0])

    def _retransmission(self, call: Call, pdu: rpc.Pdu) -> None:
        args = {"operation": _OPERATIONS.get(pdu.opnum, "?"), "first": call.request.frame}
        self._about_call(call, Remark("DS103", pdu.frame, args))

    def _lost(self, call: Call) -> None:
        context = _context(call)
        if context is None:
            return
        if not call.in_part:  # DS105 says what there is
            operation = _OPERATIONS[call.request.opnum]
            self._about_call(call, Remark("DS101", call.request.frame, {"operation": operation}))
        self._reads_lost(call, context)

    def _call_pushed_out(self, call: Call, limit: str) -> None:
        context = _context(call)
        if context is None:
            return
        pdu = call.request
        for record in context.body.records:
            if self._index47.concerns(record.index):
                self._forgot_requests = True
                self._pass(pdu, record, partial(self.pushed_out, limit, pdu.frame))
                break
        self._reads_lost(call, context)

    def _reads_lost(self, call: Call, context: _Context) -> None:
        for record in context.body.records:
            if not record.write and self._index47.concerns(record.index):
                event = partial(self._pairing.read_lost, peer(call.request), record)
                self._pass(call.request, record, event)

    # Responses

    def _response(self, call: Call) -> None:
        pdu, context = call.response, _context(call)
        if pdu is not None and pdu.opnum == RPC_CONNECT:
            self._connected(call.request, pdu)
        if pdu is None or context is None:
            return
        status, answers = parse_response(pdu)
        for number, record in enumerate(context.body.records):
            ours = self._index47.concerns(record.index)
            if not ours and not record.write:
                continue
            half = answers[number].response if number < len(answers) else None
            if half is None:  # no block of its own: the status of the NDR header counts
                half = Half(pdu.frame, pdu.time_ns, status=status)
            record.response = half
            if not ours:
                self._foreign(peer(pdu), record)
                continue
            if half.status is None:
                event = partial(self._call_remark, Remark("DS108", pdu.frame), record, context)
                self._pass(pdu, record, event)
            if not record.write:
                self._read_answered(pdu, record, half)
            elif self._index47.passes((pdu.client, pdu.server, record.ar), record.index):
                self._write_answered(pdu, record, context)
            else:
                self._pass(pdu, record, partial(self._write_answered, pdu, record, context))

    def _write_answered(self, pdu: rpc.Pdu, record: Record, context: _Context) -> None:
        self._clock(pdu)
        job = context.jobs.get(record.position)
        if job is not None:
            self._pairing.write_response(job, record.response)

    def _read_answered(self, pdu: rpc.Pdu, record: Record, half: Half) -> None:
        if half.missing:
            self._length(pdu, record, half)
        if self._index47.passes((pdu.client, pdu.server, record.ar), record.index):
            self._read(pdu, record)
            return
        shaped = False
        if half.data and not half.missing:
            shaped = decode_response(half.data, None, self._codec).shaped
            shaped = shaped or self._pairing.is_again(peer(pdu), record)
        self._pass(pdu, record, partial(self._read, pdu, record), shaped=shaped)

    def _read(self, pdu: rpc.Pdu, record: Record) -> None:
        self._clock(pdu)
        self._pairing.read_response(peer(pdu), record)

    def _orphan_response(self, pdu: rpc.Pdu, certain: bool) -> None:
        if pdu.opnum not in _OPERATIONS:
            return
        for record in parse_response(pdu)[1]:
            if not self._index47.concerns(record.index) or record.response is None:
                continue
            if certain and not self._forgot_requests:
                args = {"operation": _OPERATIONS[pdu.opnum]}
                self._about(pdu, record, Remark("DS102", pdu.frame, args))
            if record.write:
                self._foreign(peer(pdu), record)
                self._pass(pdu, record, partial(self._pairing.write_unasked, peer(pdu), record))
            else:
                self._read_answered(pdu, record, record.response)

    def _fault(self, call: Call, pdu: rpc.Pdu) -> None:
        code = int.from_bytes(pdu.body[:4], "little" if pdu.little else "big")
        args = {"kind": rpc.PTYPES[pdu.ptype], "fault": code}
        self._about_call(call, Remark("DS104", pdu.frame, args))
        context = _context(call)
        if context is None:
            return
        for record in context.body.records:
            if record.write and self._index47.concerns(record.index):
                self._pass(pdu, record, partial(self._write_failed, pdu, record, context))

    def _write_failed(self, pdu: rpc.Pdu, record: Record, context: _Context) -> None:
        job = context.jobs.get(record.position)
        if job is not None:
            self._pairing.write_response(job, Half(pdu.frame, pdu.time_ns), fault=True)

    # Findings and small things

    def _length(self, pdu: rpc.Pdu, record: Record, half: Half) -> None:
        if pdu.missing and pdu.cut is not None:
            half.cut = True
            frame, captured, original = pdu.cut
            args = {
                "captured": captured, "original": original, "length": half.stated,
                "completed": half.frame,
            }  # fmt: skip
            self._about(pdu, record, Remark("DS106", frame, args))
        else:
            args = {"stated": half.stated, "present": len(half.data)}
            self._about(pdu, record, Remark("DS202", half.frame, args))

    def _clock(self, pdu: rpc.Pdu) -> None:
        newest, before = self.newest_ns, self.newest_frame
        if pdu.frame < before:  # that of an AR that proved itself late
            return
        if newest is not None and pdu.time_ns < newest:
            args = {"milliseconds": (newest - pdu.time_ns) / 1e6, "first": before}
            self._remark(Remark("DS107", pdu.frame, args))
        self.newest_ns, self.newest_frame = pdu.time_ns, pdu.frame

    def _about_call(self, call: Call, remark: Remark) -> None:
        """A finding about an RPC call: once, and with the first job that it carries."""
        context = _context(call)
        if context is None:
            return
        for record in context.body.records:
            if self._index47.concerns(record.index):
                self._pass(
                    call.request, record, partial(self._call_remark, remark, record, context)
                )
                return

    def _call_remark(self, remark: Remark, record: Record, context: _Context) -> None:
        remark.job = context.jobs.get(record.position)
        self._remark(remark)

    def _about(self, pdu: rpc.Pdu, record: Record, remark: Remark) -> None:
        """A finding about a record that is ours, or will turn out to be."""
        self._pass(pdu, record, partial(self._remark, remark))

    def _pass(
        self, pdu: rpc.Pdu, record: Record, event: Callable[[], Any], *, shaped: bool = False
    ) -> None:
        self._index47.pass_on(_ar(pdu, record), record.index, event, shaped=shaped)

    def _count(self, index: int, *, write: bool) -> None:
        counts = self.counts.get(index)
        if counts is None:
            counts = self.counts[index] = {"read": 0, "write": 0}
        counts["write" if write else "read"] += 1


def _context(call: Call) -> _Context | None:
    """What the call carries; None where it carries no records."""
    context = call.context
    return context if isinstance(context, _Context) else None


def _ar(pdu: rpc.Pdu, record: Record) -> ArKey:
    return pdu.client, pdu.server, record.ar


@lru_cache(maxsize=4096)
def _who(client: str, server: str, object_uuid: bytes) -> Peer:
    identity = rpc.device_identity(object_uuid) or (None, None)
    return Peer(client, server, *identity)


def peer(pdu: rpc.Pdu) -> Peer:
    """Who talks to whom, by the addresses and the object UUID."""
    return _who(pdu.client, pdu.server, pdu.object_uuid)
