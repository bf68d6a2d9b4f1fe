"""What happens to a record that may be ours; once it is known to be ours, the jobs hear of it.

Stands between those who know how a record travels (`record_calls` for RPC, `ms1_calls` for PROFIBUS) and the
jobs (`pairing`). Holds back what is not known to be ours yet (`index47`), decodes a request once, and says where
the length of a record or the order of the capture is wrong (DS106, DS107, DS202). Compares nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

from ds47.acyclic.index47 import ALWAYS, SHARED_INDEX, ArKey, Index47, Place, is_question
from ds47.acyclic.pairing import Job, Pairing, Peer
from ds47.findings.remark import Remark
from ds47.profidrive import Options, Request, decode_request
from ds47.profinet.ip import Cut
from ds47.profinet.records import Half, Record

_MOST_SHARED: Final = 4_096
"""Decoded requests that are kept to be used again,"""
_LONGEST_SHARED: Final = 512
"""and how many bytes each of them may have."""

Jobs = dict[int, Job]
"""By the position of its record the job of a Write, and the one whose response a Read was to fetch."""


class RecordEvents:
    """Tells the pairing what happens to records, once they are known to be ours.

    Args:
        index47: which records are ours.
        pairing: hears of every Write and Read that is ours.
        codec: dialects of the messages.
        remark: takes the findings.
    """

    def __init__(
        self, index47: Index47, pairing: Pairing, codec: Options, remark: Callable[[Remark], None]
    ) -> None:
        self._index47 = index47
        self._pairing = pairing
        self._codec = codec
        self._remark = remark
        self.newest_ns: int | None = None
        """The time of the newest frame of a call that is ours,"""
        self.newest_frame = 0
        """and its number."""
        self._requests: dict[bytes, Request] = {}
        self.counts: dict[int, dict[str, int]] = {}
        """Record requests by index: {"read": n, "write": n}."""

    def concerns(self, index: int) -> bool:
        """Whether a record of this index can be ours at all."""
        return self._index47.concerns(index)

    def count(self, index: int, *, write: bool) -> None:
        """A record request, ours or not."""
        counts = self.counts.get(index)
        if counts is None:
            counts = self.counts[index] = {"read": 0, "write": 0}
        counts["write" if write else "read"] += 1

    def pass_on(
        self, peer: Peer, record: Record, event: Callable[[], Any], *, proves: bool = False
    ) -> None:
        """Runs an event about a record now, or once its AR has proved itself; `proves`: it does that."""
        ar, index = _ar(peer, record), record.index
        if not (proves or self._index47.passes(ar, index)):
            proves = self._index47.is_of_drive(peer.device, _place(record))
        self._index47.pass_on(ar, index, event, proves=proves)

    def about(self, peer: Peer, record: Record, remark: Remark) -> None:
        """A finding about a record that is ours, or will turn out to be."""
        self.pass_on(peer, record, partial(self._remark, remark))

    def about_job(self, peer: Peer, record: Record, remark: Remark, jobs: Jobs) -> None:
        """The same, about the job that the record belongs to, where there is one then."""
        self.pass_on(peer, record, partial(self._job_remark, remark, record, jobs))

    def asked(self, peer: Peer, record: Record, cut: Cut | None, jobs: Jobs) -> None:
        """A request.

        Args:
            peer: who asks whom.
            record: with its request; its index concerns us.
            cut: where the capture cut the message; None where it did not.
            jobs: takes the job.
        """
        half = record.request
        assert half is not None
        if half.missing:
            self._length(peer, record, half, cut)
        ar = _ar(peer, record)
        passes = self._index47.passes(ar, record.index)
        if not record.write:
            if passes:
                self._read_asked(peer, record, half, jobs)
            else:
                self.pass_on(peer, record, partial(self._read_asked, peer, record, half, jobs))
                self._index47.heard(ar, half.frame, asks=True)
            return
        message = self.decoded(half.data)
        if passes:
            self._write(peer, record, half, jobs, message)
        else:
            event = partial(self._write, peer, record, half, jobs, message)
            self.pass_on(peer, record, event, proves=is_question(message))
            self._index47.heard(ar, half.frame, asks=True)
            self._index47.asked(ar, _place(record), message, half.data)

    def answered(self, peer: Peer, record: Record, cut: Cut | None, jobs: Jobs) -> None:
        """The response to a request; arguments as for `asked`."""
        half = record.response
        assert half is not None
        if not record.write:
            self._read_answered(peer, record, half, cut, jobs)
        elif self._index47.passes(_ar(peer, record), record.index):
            self._write_answered(record, half, jobs)
        else:
            self.pass_on(peer, record, partial(self._write_answered, record, half, jobs))

    def unasked(self, peer: Peer, record: Record, cut: Cut | None) -> None:
        """A response without its request."""
        half = record.response
        assert half is not None
        if record.write:
            self.pass_on(peer, record, partial(self._pairing.write_unasked, peer, record))
        else:
            self._read_answered(peer, record, half, cut, {})
        if record.index == SHARED_INDEX:
            self._index47.heard(_ar(peer, record), half.frame, asks=False)

    def asked_late(self, peer: Peer, record: Record, answer: int) -> None:
        """The request of a Read whose response was in an earlier frame, with that frame."""
        self.pass_on(peer, record, partial(self._pairing.read_asked_late, peer, record, answer))
        if record.index == SHARED_INDEX:
            self._index47.heard(_ar(peer, record), answer, asks=True)

    def not_unasked(self, peer: Peer, record: Record) -> None:
        """A response was no one without its request: that came late, and is told next."""
        if record.index == SHARED_INDEX:
            self._index47.unheard(_ar(peer, record))

    def failed(self, peer: Peer, record: Record, half: Half, jobs: Jobs) -> None:
        """A request that was turned away before anybody looked at its record."""
        if record.write:
            event = partial(self._write_failed, record, half, jobs)
        else:
            event = partial(_fetched, record, jobs)
        self.pass_on(peer, record, event)

    def sent_again(self, peer: Peer, record: Record, jobs: Jobs, waits_ns: int) -> None:
        """A request whose client had no response, and until when it waits for one at least."""
        self.pass_on(peer, record, partial(self._insisted, record, jobs, waits_ns))

    def answered_twice(self, peer: Peer, record: Record, jobs: Jobs) -> None:
        """A request with two responses: which of them its client has is not known."""
        self.pass_on(peer, record, partial(self._answered_twice, record, jobs))

    def lost(self, peer: Peer, record: Record) -> None:
        """A request whose response does not come any more."""
        if not record.write:
            self.pass_on(peer, record, partial(self._pairing.read_lost, peer, record))

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

    def finish(self) -> None:
        """The capture is over: what still waits is not known to be ours (DS209)."""
        for device, (first, records, asks) in self._index47.unproven():
            what = "unproven_calls" if asks else "unproven_responses"
            args = {"device": device, "count": records, "what": what}
            self._remark(Remark("DS209", first, args))

    # What happens once it is ours

    def _read_asked(self, peer: Peer, record: Record, half: Half, jobs: Jobs) -> None:
        self._clock(half)
        job = self._pairing.expected(peer, record)
        if job is not None:
            jobs[record.position] = job
            job.fetching.append(half)

    def _write(self, peer: Peer, record: Record, half: Half, jobs: Jobs, message: Request) -> None:
        self._clock(half)
        jobs[record.position] = self._pairing.write_request(peer, record, message)

    def _write_answered(self, record: Record, half: Half, jobs: Jobs) -> None:
        self._clock(half)
        job = jobs.get(record.position)
        if job is not None:
            self._pairing.write_response(job, half)

    def _write_failed(self, record: Record, half: Half, jobs: Jobs) -> None:
        job = jobs.get(record.position)
        if job is not None:
            self._pairing.write_response(job, half, fault=True)

    def _insisted(self, record: Record, jobs: Jobs, waits_ns: int) -> None:
        job = jobs.get(record.position)
        if job is not None:
            job.insisted = waits_ns

    def _answered_twice(self, record: Record, jobs: Jobs) -> None:
        job, asked = jobs.get(record.position), record.request
        if job is not None and asked is not None:
            job.twice = asked.frame

    def _read_answered(
        self, peer: Peer, record: Record, half: Half, cut: Cut | None, jobs: Jobs
    ) -> None:
        if half.missing:
            self._length(peer, record, half, cut)
        if self._index47.passes(_ar(peer, record), record.index):
            self._read(peer, record, half, jobs)
            return
        proves = bool(half.data and not half.missing) and (
            self._index47.answers(_ar(peer, record), _place(record), half.data, self._codec)
            or self._pairing.is_again(peer, record)
        )
        self.pass_on(peer, record, partial(self._read, peer, record, half, jobs), proves=proves)

    def _read(self, peer: Peer, record: Record, half: Half, jobs: Jobs) -> None:
        self._clock(half)
        _fetched(record, jobs)
        if record.index in ALWAYS and half.data:
            self._index47.responded(peer.device, _place(record), half.data, self._codec)
        self._pairing.read_response(peer, record)

    def _job_remark(self, remark: Remark, record: Record, jobs: Jobs) -> None:
        remark.job = jobs.get(record.position)
        self._remark(remark)

    # Small things

    def _length(self, peer: Peer, record: Record, half: Half, cut: Cut | None) -> None:
        if cut is not None:
            half.cut = True
            frame, captured, original = cut
            args = {
                "captured": captured, "original": original, "length": half.stated,
                "completed": half.frame,
            }  # fmt: skip
            self.about(peer, record, Remark("DS106", frame, args))
        else:
            args = {"stated": half.stated, "present": len(half.data)}
            self.about(peer, record, Remark("DS202", half.frame, args))

    def _clock(self, half: Half) -> None:
        newest, before = self.newest_ns, self.newest_frame
        if half.frame < before:  # that of an AR that proved itself late
            return
        if newest is not None and half.time_ns < newest:
            args = {"milliseconds": (newest - half.time_ns) / 1e6, "first": before}
            self._remark(Remark("DS107", half.frame, args))
        self.newest_ns, self.newest_frame = half.time_ns, half.frame


def _fetched(record: Record, jobs: Jobs) -> None:
    """A Read is over, to whomever its response goes."""
    job = jobs.get(record.position)
    if job is not None and record.request in job.fetching:
        job.fetching.remove(record.request)


def _ar(peer: Peer, record: Record) -> ArKey:
    return peer.controller, peer.device, record.ar


def _place(record: Record) -> Place:
    return record.api, record.slot, record.subslot
