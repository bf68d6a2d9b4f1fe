"""Pairing on the DS47 level: Writes and Reads of one channel to jobs (docs/pairing.md).

A job is a transaction in the making. Its life is the table `spec/pairing.toml`; the only thing decided
here is to which job a record call belongs. Nothing is decoded beyond what a caller hands in, and nothing
is judged: `ds47.rules` does that when `answered` and `closed` are called.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeVar

from ds47.profidrive import Request, Response
from ds47.profinet.records import Half, Record
from ds47.spec.semantics import Limits, phases

STATUS_NOT_READY: Final = 0xDE80B500
"""State conflict on a Read: the response is not ready, read again (docs/protocol.md E.1)."""
STATUS_IN_USE: Final = 0xDF80B500
"""State conflict on a Write: the device still works on another request."""


_T = TypeVar("_T")


class Peer(NamedTuple):
    """Who talks to whom, and what is known of the device."""

    controller: str
    device: str
    vendor_id: int | None = None
    device_id: int | None = None


ChannelKey = tuple[str, str, bytes, int, int, int, int]
"""A DS47 channel (docs/pairing.md, record level): controller, device, AR, API, slot, subslot, index."""


@dataclass(slots=True, eq=False, init=False)
class Job:
    """A transaction in the making: the halves of its record calls and what pairing learnt of it."""

    peer: Peer
    record: Record
    message: Request | None
    phase: str
    write_response: Half | None
    write_fault: bool
    read_request: Half | None
    read_response: Half | None
    polls: list[tuple[Half | None, Half]]
    rereads: list[tuple[Half | None, Half]]
    empty_reads: list[Half]
    response: Response | None
    """Decoded by whoever is told of the answer."""
    previous_reference: int | None
    superseded_by: int | None
    reason: str
    accepted: bool
    order: int
    superseding: Job | None
    """The request that displaced this one."""
    rival: Job | None
    """Whose request was open when this one was turned away as in conflict with another."""
    repeats: int | None
    """Frame of an earlier answer that was read once more where a new one was due."""
    ended: int | None
    """Frame that ended the connection while the request was open."""

    def __init__(
        self,
        peer: Peer,
        record: Record,
        message: Request | None,
        phase: str = "asked",
        write_response: Half | None = None,
        write_fault: bool = False,
        read_request: Half | None = None,
        read_response: Half | None = None,
        polls: list[tuple[Half | None, Half]] | None = None,
        rereads: list[tuple[Half | None, Half]] | None = None,
        empty_reads: list[Half] | None = None,
        response: Response | None = None,
        previous_reference: int | None = None,
        superseded_by: int | None = None,
        reason: str = "",
        accepted: bool = False,
        order: int = 0,
    ) -> None:
        self.peer = peer
        self.record = record
        self.message = message
        self.phase = phase
        self.write_response = write_response
        self.write_fault = write_fault
        self.read_request = read_request
        self.read_response = read_response
        self.polls = [] if polls is None else polls
        self.rereads = [] if rereads is None else rereads
        self.empty_reads = [] if empty_reads is None else empty_reads
        self.response = response
        self.previous_reference = previous_reference
        self.superseded_by = superseded_by
        self.reason = reason
        self.accepted = accepted
        self.order = order
        self.superseding = None
        self.rival = None
        self.repeats = None
        self.ended = None

    @property
    def write_request(self) -> Half | None:
        """The request of the Write that asked; None for an orphan."""
        return self.record.request if self.message is not None else None

    @property
    def write_refused(self) -> bool:
        """Whether the Write was answered with a negative status or an RPC fault."""
        return self.write_fault or bool(self.write_response and self.write_response.status)

    @property
    def reference(self) -> int | None:
        """The request reference that was sent."""
        return self.message.request_reference if self.message else None


@dataclass(slots=True, init=False)
class _Channel:
    touched: int
    asked: list[Job]
    open: Job | None
    refused: Job | None
    last: Job | None
    reference: int | None

    def __init__(
        self,
        touched: int,
        asked: list[Job] | None = None,
        open: Job | None = None,  # noqa: A002
        refused: Job | None = None,
        last: Job | None = None,
        reference: int | None = None,
    ) -> None:
        self.touched = touched
        self.asked = [] if asked is None else asked
        self.open = open
        self.refused = refused
        self.last = last
        self.reference = reference

    def jobs(self) -> list[Job]:
        return [job for job in (self.last, self.refused, self.open) if job] + self.asked


class Pairing:
    """Takes record calls in the order of the capture and keeps the jobs of every channel.

    Args:
        limits: the numbers of spec/limits.toml.
        answered: called once when a job has its response, in the order of the capture.
        closed: called once when nothing more can come.
        nothing_to_read: called for a Read without record on a channel that has no request.
        refused: called when a Write is refused: what comes after that is seldom of interest.
    """

    def __init__(
        self,
        limits: Limits,
        answered: Callable[[Job], None],
        closed: Callable[[Job], None],
        nothing_to_read: Callable[[Peer, Record], None],
        refused: Callable[[Job], None] | None = None,
    ) -> None:
        self._limits = limits
        self._tell_refused = refused
        self._answered = answered
        self._closed = closed
        self._nothing_to_read = nothing_to_read
        self._table = phases()
        self._channels: OrderedDict[ChannelKey, _Channel] = OrderedDict()
        self._of_ar: dict[tuple[str, str, bytes], dict[ChannelKey, None]] = {}
        self._newest: OrderedDict[tuple[str, int, int, int, int], Job] = OrderedDict()
        """The newest accepted request of a place, whoever asked."""
        self._connects: OrderedDict[tuple[str, str], int] = OrderedDict()
        """The newest Connect between two stations, by its frame."""
        self._count = 0

    def write_request(self, peer: Peer, record: Record, message: Request) -> Job:
        """A Write that asks for something. Returns the job, for `write_response`."""
        assert record.request is not None
        channel = self._channel(peer, record, record.request.time_ns)
        job = self._job(peer, record, message)
        job.previous_reference, channel.reference = channel.reference, message.request_reference
        channel.asked.append(job)
        if len(channel.asked) > self._limits.pending_writes:
            self._lose(channel.asked.pop(0), "expired")
        return job

    def write_response(self, job: Job, response: Half | None, *, fault: bool = False) -> None:
        """The answer to a Write: accepted (status 0), refused (any other status, or an RPC fault)."""
        job.write_response = response
        job.write_fault = fault
        status = response.status if response else None
        if job.phase == "closed" or (status is None and not fault):
            return
        channel = self._channels.get(_key(job.peer, job.record))
        if channel is None:
            return
        if status == 0 and not fault:
            self._accept(channel, job)
        else:
            self._refuse(channel, job)
            if self._tell_refused is not None and job.phase == "refused":
                self._tell_refused(job)

    def read_response(self, peer: Peer, record: Record) -> Job | None:
        """The answer to a Read. Returns the job it went to, None where there is none."""
        half = record.response
        assert half is not None
        channel = self._channel(peer, record, half.time_ns)
        event = _read_event(half)
        job = self._addressee(channel, event, half.data)
        if channel.refused is not None and channel.refused is not job:
            self._lose(channel.refused, "")
            channel.refused = None
        if job is not None:
            self._read(channel, job, event, record)
            return job
        if event != "read_record":
            self._nothing_to_read(peer, record)
            return None
        if channel.last is not None and _bytes(channel.last) == half.data:
            self._step(channel.last, "reread")
            self._keep(channel.last.rereads, (record.request, half))
            return channel.last
        job = self._job(peer, record, None)
        job.phase = "open"
        self._read(channel, job, event, record)
        return job

    def read_lost(self, peer: Peer, record: Record) -> Job | None:
        """A Read that never got its RPC response."""
        channel = self._channels.get(_key(peer, record))
        job = channel and (channel.open or channel.refused)
        if job and job.read_request is None:
            job.read_request = record.request
        return job or None

    def release(self, controller: str, device: str, ar: bytes, frame: int | None = None) -> None:
        """The AR is over: what is open on its channels stays unanswered."""
        for key in list(self._of_ar.get((controller, device, ar), ())):
            self._close_channel(key, "release", frame)

    def connected(self, controller: str, device: str, frame: int) -> None:
        """A new AR between the two: requests that are open now have lost their connection."""
        connects = self._connects
        connects[controller, device] = frame
        connects.move_to_end((controller, device))
        if len(connects) > self._limits.channels:
            connects.popitem(last=False)

    def finish(self) -> None:
        """The capture is over."""
        while self._channels:
            self._close_channel(next(iter(self._channels)), "end")

    def _job(self, peer: Peer, record: Record, message: Request | None) -> Job:
        self._count += 1
        return Job(peer, record, message, order=self._count)

    def _channel(self, peer: Peer, record: Record, now: int) -> _Channel:
        key = _key(peer, record)
        channel = self._channels.get(key)
        channels, expiry = self._channels, self._limits.transaction_expiry_ns
        if channel is not None and now - channel.touched > expiry:
            self._close_channel(key, "expired")
            channel = None
        if channel is None:
            channel = channels[key] = _Channel(now)
            self._of_ar.setdefault(key[:3], {})[key] = None
        channel.touched = now
        channels.move_to_end(key)
        while True:
            oldest: _Channel = next(iter(channels.values()))
            if oldest is channel or (
                now - oldest.touched <= expiry and len(channels) <= self._limits.channels
            ):
                return channel
            self._close_channel(next(iter(channels)), "expired")

    def _accept(self, channel: _Channel, job: Job) -> None:
        """An accepted Write opens; it displaces what was open and ends the grace of a refused one."""
        job.accepted = True
        if job.phase == "asked":
            channel.asked.remove(job)
            if channel.open is not None:
                channel.open.superseded_by = (
                    job.record.request.frame if job.record.request else None
                )
                channel.open.superseding = job
                self._end(channel.open, "displaced")
            if channel.refused is not None:
                self._lose(channel.refused, "")
                channel.refused = None
            channel.open = job
            self._remember(job)
        self._step(job, "write_accepted")

    def _remember(self, job: Job) -> None:
        place = _place(job)
        self._newest[place] = job
        self._newest.move_to_end(place)
        if len(self._newest) > self._limits.channels:
            self._newest.popitem(last=False)

    def _refuse(self, channel: _Channel, job: Job) -> None:
        before = job.phase
        half = job.write_response
        if half is not None and half.status == STATUS_IN_USE:
            newest = self._newest.get(_place(job))
            if newest is not None and newest is not job and newest.phase == "open":
                job.rival = newest
        self._step(job, "write_refused")
        if before == "answered":
            return
        if before == "asked":
            channel.asked.remove(job)
        else:
            channel.open = None
        if channel.refused is not None:
            self._lose(channel.refused, "")
        channel.refused = job

    def _addressee(self, channel: _Channel, event: str, data: bytes) -> Job | None:
        """The job a Read answers; a Write whose response was not seen counts when the answer fits."""
        reference = data[0] if data else None
        if event == "read_record":
            for job in ([channel.open] if channel.open else []) + channel.asked[::-1]:
                if job.reference == reference:
                    return job
        if channel.open is not None:
            return channel.open
        if channel.asked:
            old_answer = event == "read_record" and _bytes(channel.last) == data
            return None if old_answer else channel.asked[-1]
        return channel.refused

    def _read(self, channel: _Channel, job: Job, event: str, record: Record) -> None:
        half = record.response
        assert half is not None
        if event == "read_record" and job.phase in ("asked", "refused"):
            _compare(channel.last, job, half)
        if job.phase == "asked":
            self._accept(channel, job)
            job.accepted = False  # only presumed: the Write response is missing in the capture
        self._step(job, event)
        if event == "read_poll":
            self._keep(job.polls, (record.request, half))
        elif event == "read_empty":
            if half.status is not None:
                self._keep(job.empty_reads, half)
        else:
            job.read_request, job.read_response = record.request, half
            if channel.open is job:
                channel.open = None
            if channel.refused is job:
                channel.refused = None
            self._answered(job)
            if not half.data:
                self._lose(job, "")
                return
            if channel.last is not None:
                self._lose(channel.last, "")
            channel.last = job

    def _keep(self, reads: list[_T], read: _T) -> None:
        """The reads of one transaction: of more than `Limits.reads` the first and the newest are kept."""
        if len(reads) >= self._limits.reads:
            reads.pop()
        reads.append(read)

    def _step(self, job: Job, event: str) -> None:
        job.phase = self._table[job.phase][event]

    def _lose(self, job: Job, reason: str) -> None:
        job.reason = reason
        asked = job.write_request
        if asked is not None and job.ended is None and job.read_response is None:
            connect = self._connects.get((job.peer.controller, job.peer.device))
            if connect is not None and connect > asked.frame:
                job.ended = connect
        self._end(job, "lost")

    def _end(self, job: Job, event: str) -> None:
        self._step(job, event)
        self._closed(job)
        job.superseding = job.rival = None  # or each would keep the next one alive

    def _close_channel(self, key: ChannelKey, reason: str, frame: int | None = None) -> None:
        siblings = self._of_ar[key[:3]]
        del siblings[key]
        if not siblings:
            del self._of_ar[key[:3]]
        for job in self._channels.pop(key).jobs():
            job.ended = frame
            self._lose(job, reason)


def _key(peer: Peer, record: Record) -> ChannelKey:
    return (
        peer.controller,
        peer.device,
        record.ar,
        record.api,
        record.slot,
        record.subslot,
        record.index,
    )


def _place(job: Job) -> tuple[str, int, int, int, int]:
    record = job.record
    return (job.peer.device, record.api, record.slot, record.subslot, record.index)


def _compare(last: Job | None, job: Job, half: Half) -> None:
    """Whether a request that failed, or another one than before, is answered as the last one was."""
    if last is None or last.read_response is None or last.read_response.data != half.data:
        return
    asked, before = job.write_request, last.write_request
    if job.phase == "asked" and (not asked or not before or asked.data[1:] == before.data[1:]):
        return  # the same question may well have the same answer
    job.repeats = last.read_response.frame


def _read_event(half: Half) -> str:
    if half.status == STATUS_NOT_READY:
        return "read_poll"
    if half.status:
        return "read_refused"
    return "read_record" if half.data else "read_empty"


def _bytes(job: Job | None) -> bytes | None:
    return job.read_response.data if job and job.read_response else None
