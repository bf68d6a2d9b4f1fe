"""Pairing on the DS47 level: Writes and Reads of one channel to jobs (docs/pairing.md).

A job is a transaction in the making. Its life is the table `spec/pairing.toml`. This module only decides which
job a record call belongs to. It decodes nothing and judges nothing: it appends the outcome of each job to a
list (`Outcome`), and the caller processes that list.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final, Literal, NamedTuple, TypeVar

from ds47.profidrive import Request, Response
from ds47.profidrive.dictionary import Meaning
from ds47.profidrive.parameter import kind_fits
from ds47.profinet.completeness import Completeness, Missing
from ds47.profinet.records import NIL_UUID, NO_API, ChannelKey, Half, Peer, Record
from ds47.spec.plain import Plain
from ds47.spec.semantics import Limits, phases

STATUS_NOT_READY: Final = 0xDE80B500
"""State conflict on a Read: the response is not ready, read again (docs/protocol.md E.1)."""
STATUS_SHORT: Final = 0xDE80B100
"""Length error on a Read: the response is longer than the Read allows (docs/protocol.md E.1)."""
STATUS_IN_USE: Final = 0xDF80B500
"""State conflict on a Write: the device is still working on another request."""


_KIND_END: Final = 2
"""Bytes of a message up to the end of its ID."""

_T = TypeVar("_T")
_K = TypeVar("_K")


class Moment(NamedTuple):
    """A frame and its time."""

    frame: int
    time_ns: int


_NEVER: Final = Moment(0, 0)
_UNSURE: Final = 2**63
"""A frame that no capture has."""
_FORGOTTEN: Final = Record(False, False, NIL_UUID, NO_API, 0, 0, 0, 0)
_ENDS: Final = {"end": "ends", "expired": "unseen", "later": "later", "unseen": "unseen"}
"""Why a request is over without its response -> the key of what the capture lacks."""


@dataclass(slots=True, eq=False, init=False, repr=False)
class Job:
    """A transaction in the making: the halves of its record calls, and what pairing has found out about it."""

    peer: Peer
    record: Record
    key: ChannelKey
    """Its channel."""
    message: Request | None
    reference: int | None
    """The request reference."""
    write_request: Half | None
    """The Write request; None for an orphan."""
    phase: str
    write_response: Half | None
    write_refused: bool
    """Whether the Write was answered with a negative status or an RPC fault."""
    read_request: Half | None
    read_response: Half | None
    polls: list[tuple[Half | None, Half]]
    """Reads that left the job open: not ready yet, or too short for the response."""
    rereads: list[tuple[Half | None, Half]]
    empty_reads: list[Half]
    response: Response | None
    """The decoded response; `Analysis` sets it."""
    stray: bool
    """Whether the response cannot belong to the request. The judge sets it,"""
    usual: bool
    """and this: a complete response that succeeded, and no finding about it."""
    shows_nothing_new: bool
    """Whether it shows nothing new apart from its values."""
    previous_reference: int | None
    previous: int | None
    """Frame of the previous captured request on its channel."""
    uncounted: bool
    """Whether it is the first on its channel, and another channel of its AR has just used its reference."""
    superseded_by: int | None
    reason: str
    order: int
    superseding: Job | None
    """The request that displaced this one."""
    rival: Job | None
    """The job that was open when this Write was refused with a state conflict (STATUS_IN_USE)."""
    alone: bool
    """Whether this Write was refused with a state conflict although no request was open."""
    refused_behind: Job | None
    """A newer Write that was refused before the first Read: the Read may be for that one."""
    repeats: int | None
    """Frame of an earlier response that came again instead of a new one."""
    reread_cause: str
    """What led to the first re-read: a key of diagnoses.toml."""
    between: Job | None
    """The unanswered Write before the first re-read: the re-read may be for that Write."""
    ended: int | None
    """Frame that ended the connection while the request was open."""
    fetching: list[Half]
    """Its Reads that have no response yet."""
    read_before: bool
    """Whether a missing or incomplete Read may have fetched the response earlier."""
    doubled_frame: int
    """Frame of one of its calls with two responses: the client may have got either. 0 for none."""
    hasty: bool
    """Whether its Read came before its Write response, although its client usually waits for each response."""
    cut_frame: int
    """Frame that the capture cut off before the request, or the outcome of a call, is known; 0 for none."""
    rewritten_frame: int
    """Frame of an accepted Write with the same request, sent while this one had no response; 0 for none."""
    crossed: tuple[int, int] | None
    """Frames of two Writes, including this one, with their responses in reverse order (P27)."""
    missing: Missing | None
    """What the capture lacks, so that nobody knows the outcome."""
    limit: str
    """Name of the limit that pushed it out (spec/limits.toml): a response may still come. "" for none."""
    passed_over: bool
    """Whether it turned out, while this Write waited for its response, that no request is open (P28)."""
    contested: bool
    """Whether a record that went to an older request may be the response to this one (P72)."""
    over: bool
    """Whether its transaction was handed out."""
    certain: bool
    """False for an orphan if a limit may have pushed out its request."""
    meanings: Sequence[Meaning | None]
    """What the drive has said about each parameter, in their order; empty if it has said nothing."""

    def __init__(
        self,
        record: Record,
        message: Request | None,
        phase: str = "asked",
        write_response: Half | None = None,
        write_refused: bool = False,
        read_request: Half | None = None,
        read_response: Half | None = None,
        polls: list[tuple[Half | None, Half]] | None = None,
        rereads: list[tuple[Half | None, Half]] | None = None,
        empty_reads: list[Half] | None = None,
        response: Response | None = None,
        previous_reference: int | None = None,
        previous: int | None = None,
        superseded_by: int | None = None,
        reason: str = "",
        order: int = 0,
    ) -> None:
        self.peer, self.record, self.key = record.peer, record, record.channel
        self.message = message
        self.reference = None if message is None else message.request_reference
        self.write_request = None if message is None else record.request
        self.phase = phase
        self.write_response = write_response
        self.write_refused = write_refused
        self.read_request = read_request
        self.read_response = read_response
        self.polls = [] if polls is None else polls
        self.rereads = [] if rereads is None else rereads
        self.empty_reads = [] if empty_reads is None else empty_reads
        self.response = response
        self.stray = self.usual = self.shows_nothing_new = False
        self.previous_reference = previous_reference
        self.previous = previous
        self.uncounted = False
        self.superseded_by = superseded_by
        self.reason = reason
        self.order = order
        self.superseding = None
        self.rival = self.refused_behind = None
        self.alone = self.hasty = False
        self.repeats = None
        self.reread_cause = ""
        self.between = None
        self.ended = None
        self.fetching = []
        self.read_before = False
        self.doubled_frame = self.cut_frame = self.rewritten_frame = 0
        self.crossed = None
        self.missing = None
        self.limit = ""
        self.passed_over = False
        self.contested = False
        self.over, self.certain = False, True
        self.meanings = ()

    def forget(self) -> None:
        """Drops the references to other objects, once the transaction is handed out.

        Otherwise each job would keep the next one alive, and each remembered call its job. Job and record refer to
        each other: without this they would stay until the garbage collector runs.
        """
        self.over, self.record = True, _FORGOTTEN
        self.superseding = self.rival = self.refused_behind = self.between = self.response = None

    @property
    def device(self) -> str:
        """IP address of the device."""
        return self.peer.device

    @property
    def write_told(self) -> bool:
        """Whether the capture shows the answer to the Write."""
        return self.write_response is not None and not self.write_response.cut_before_status

    @property
    def not_ready(self) -> list[tuple[Half | None, Half]]:
        """The Reads that came before the response was ready."""
        return [read for read in self.polls if read[1].status == STATUS_NOT_READY]

    @property
    def too_short(self) -> list[tuple[Half | None, Half]]:
        """The Reads that asked for fewer bytes than the response has."""
        return [read for read in self.polls if read[1].status == STATUS_SHORT]


@dataclass(slots=True, init=False, repr=False, eq=False)
class Channel(Plain):
    """The jobs of a channel."""

    touched: int
    """Time of its last message."""
    spot: tuple[str, int, int, int, int]
    """Its place on the device, for any controller and AR."""
    asked: list[Job]
    open: Job | None
    refused: Job | None
    last: Job | None
    reference: int | None
    written_frame: int | None
    """The frame of the newest Write; `reference` is its request reference."""
    accepted: int
    """The `Job.order` of the newest accepted Write."""
    heard_frame: int
    """The frame of the newest record that was read; 0 for none."""
    unasked_frame: int
    """The frame of the newest Write response without a captured request; 0 for none."""
    unseen_frame: int
    """The same, but only for an accepted Write: it displaced what was open."""
    ended_frame: int
    """The frame of the newest Read response that ended a known request, or found none open; 0 for neither."""
    sought_frame: int
    """The frame of the request of that Read, or of its response if the request is missing."""
    aside: Missing | None
    """Why the open request was set aside: a record may be the response to it; None once another was accepted."""

    def __init__(
        self,
        touched: int,
        spot: tuple[str, int, int, int, int],
        asked: list[Job] | None = None,
        open: Job | None = None,  # noqa: A002
        refused: Job | None = None,
        last: Job | None = None,
        reference: int | None = None,
    ) -> None:
        self.touched, self.spot = touched, spot
        self.asked = [] if asked is None else asked
        self.open = open
        self.refused = refused
        self.last = last
        self.reference = reference
        self.written_frame = None
        self.accepted = 0
        self.heard_frame = 0
        self.unasked_frame = self.unseen_frame = 0
        self.ended_frame = self.sought_frame = 0
        self.aside = None

    def pass_over(self) -> None:
        """No request is open: a Read no longer counts as the answer to a Write that waits for its response."""
        for job in self.asked:
            job.passed_over = True

    def waiting(self) -> Job | None:
        """The newest unanswered Write, if a Read may be for it: no later one was accepted."""
        newest = self.asked[-1] if self.asked else None
        if newest is None or newest.passed_over:
            return None
        return newest if newest.order > self.accepted else None

    def is_free(self) -> bool:
        """Whether no Write is unanswered, open or refused."""
        return not (self.asked or self.open or self.refused)

    def jobs(self) -> list[Job]:
        """All jobs of the channel."""
        return [job for job in (self.last, self.refused, self.open) if job] + self.asked


What = Literal[
    "asked", "refused", "answered", "closed", "nothing", "connected", "remark", "foreign", "set_up",
    "questions", "proven", "no_drive",
]  # fmt: skip
Outcome = tuple[What, Any, Any]
"""What happened, its subject, and one more object; in the order of the capture:

    asked       a job: its Write asks for a change
    refused     a job: its Write was refused
    answered    a job: it has its response; once
    closed      a job: nothing more can come; once. The receiver calls `Job.forget`
    nothing     a Read that brought no record, with no request open; what may be missing, or None
    connected   the device of a Connect, or a PROFIBUS station that got its parameters; the frame
    remark      a finding of a step (`ds47.findings.remark`); the record that it is about, or None
    foreign     an answered Write that is not ours, or has no request in the capture
    set_up      the request of a Connect; its response
    questions   an AR that has sent a question at index 47; whether it is one of DS47 is open until
    proven      it has proved itself, or
    no_drive    it has not: then everything about it since `questions` is dropped
"""


class Pairing:
    """Takes record calls in the order of the capture and keeps the jobs of every channel.

    Args:
        limits: the numbers of spec/limits.toml.
        outcomes: gets what happened to jobs.
        completeness: knows what the capture lacks; None: it lacks nothing.
    """

    def __init__(
        self, limits: Limits, outcomes: list[Outcome], completeness: Completeness | None = None
    ) -> None:
        self._limits = limits
        self._completeness = completeness
        self._missing_after: Callable[..., Missing | None] = (
            completeness.missing_after if completeness is not None else lambda *_, **__: None
        )
        self._sure: Mapping[tuple[str, str], int] = (
            completeness.sure if completeness is not None else {}
        )
        self._outcomes = outcomes
        self._table = phases()
        self.channels: OrderedDict[ChannelKey, Channel] = OrderedDict()
        self._of_ar: dict[tuple[str, str, bytes], dict[ChannelKey, None]] = {}
        self._of_place: dict[tuple[str, int, int, int, int], dict[ChannelKey, None]] = {}
        """The channels of each place, for any controller and AR; the newest is the last."""
        self._unanswered: OrderedDict[int, Job] = OrderedDict()
        """The Writes in `asked` of all channels, by their order."""
        self._pushed_out = False
        """Whether a limit pushed out requests whose responses may still come."""
        self._delivered: OrderedDict[tuple[str, int, int, int, int], Job] = OrderedDict()
        """The newest accepted request of each place that got its response, for any controller and AR."""
        self._connects: OrderedDict[tuple[str, str, bytes], Moment] = OrderedDict()
        """The newest Connect of each AR."""
        self._started: OrderedDict[str, Moment] = OrderedDict()
        """When a PROFIBUS station last got its parameters: no request is open from before that."""
        self._connected: OrderedDict[tuple[str, str], bytes] = OrderedDict()
        """The AR of cyclic data that two stations set up last and have not released."""
        self.replaced: dict[tuple[str, str, bytes], Moment] = {}
        """ARs with open requests that a Connect seems to have replaced; a message on one takes it out."""
        self._count = 0
        self._newest_ns: int | None = None
        self._due_ns = 0
        """No channel expires before that time,"""
        self._touched_ns = 0
        self._set_back = False
        """unless the clock was set back."""

    def write_request(self, record: Record, message: Request) -> Job:
        """Takes a Write request. Returns its job, for `write_response`."""
        asked = record.request
        assert asked is not None
        channel = self._channel(record, asked.time_ns)
        self._count += 1
        job = Job(record, message, order=self._count)
        if asked.cut and message.request_id is None:
            job.cut_frame = asked.frame
        before = job.previous = channel.written_frame
        missing = None
        if before is not None and before < self._sure.get(record.peer[:2], _UNSURE):
            missing = self._missing_after(record.peer, before)
        if missing is None or missing.what == "one_direction":
            job.previous_reference = channel.reference
        if before is None:
            others = self._of_ar[record.relation]
            last = (self.channels[each].reference for each in others)
            job.uncounted = message.request_reference in last
        channel.reference, channel.written_frame = message.request_reference, asked.frame
        channel.asked.append(job)
        self._unanswered[job.order] = job
        if message.operation == "change":
            self._outcomes.append(("asked", job, None))
        if len(channel.asked) > self._limits.pending_writes:
            self._push_out_asked(channel.asked[0], "pending_writes")
        if len(self._unanswered) > self._limits.unanswered_writes:
            self._push_out_asked(next(iter(self._unanswered.values())), "unanswered_writes")
        return job

    def write_response(self, job: Job, response: Half | None, *, fault: bool = False) -> None:
        """The answer to a Write: accepted (status 0), refused (any other status, or an RPC fault)."""
        channel = self.channels.get(job.key)
        opened = channel.open if channel is not None else None
        if (
            response is not None
            and (opened or job.fetching or job.polls or job.read_request)
            and _is_read_before(opened, job, response)
        ):
            job.hasty = self._waits(job.peer)
        if job.hasty and (fault or (response is not None and response.status)):
            job.doubled_frame = job.write_request.frame if job.write_request else 0
            return  # the client got another response before, and the device has executed the call twice
        status = response.status if response else None
        job.write_response, job.write_refused = response, fault or bool(status)
        if response is not None and response.cut and response.cut_before_status:
            job.cut_frame = response.frame
        if channel is None or job.phase == "closed" or (status is None and not fault):
            return
        if self.replaced:
            self.goes_on(*job.key[:3])
        if status == 0 and not fault:
            if not _cross(channel, job):
                self._accept(channel, job)
        else:
            self._refuse(channel, job)
            if job.phase == "refused":
                self._outcomes.append(("refused", job, None))

    def _waits(self, peer: Peer) -> bool:
        """Whether the client usually waits, so that a response after its next call is a second copy."""
        known = self._completeness
        return known is not None and known.waits(peer.controller, peer.device)

    def write_unasked(self, record: Record) -> None:
        """The answer to a Write without its request in the capture.

        The Write came after the refused one of its channel: no Read is for that one any more. If it was accepted,
        its request is unknown: any later record may be its response, even with the bytes of an earlier one.
        """
        half = record.response
        if half is None:
            return
        channel = self._channel(record, half.time_ns)
        channel.unasked_frame = half.frame
        given_up = half.time_ns - self._limits.call_expiry_ns
        asked = (job.record.request for job in channel.asked)
        if any(each is not None and each.time_ns < given_up for each in asked):
            return  # the request is in the capture, but its call was given up before
        if channel.refused is not None:
            self._close(channel.refused, "")
            channel.refused = None
        if half.status != 0 and not half.cut_before_status:
            return
        channel.unseen_frame = half.frame
        channel.pass_over()
        self._forget_last(channel)

    def _forget_last(self, channel: Channel) -> None:
        """Closes the last answered job: a missing one came after it, or the next record may be for either."""
        if channel.last is not None:
            self._close(channel.last, "")
            channel.last = None

    def read_response(self, record: Record) -> Job | None:
        """The answer to a Read. Returns the job that gets it, None if none does."""
        half = record.response
        assert half is not None
        self.read_over(record)
        channel = self._channel(record, half.time_ns)
        event = _read_event(half)
        if event in ("read_record", "read_cut"):
            channel.heard_frame = half.frame
        job = self._addressee(channel, event, record)
        if job is not None and channel.refused is not None:
            job = self._sought(channel, job, event, record)
        late = job is not None and _is_later(job, record)  # the request of the Read is over
        if channel.refused is not None:
            self._leave_refused(channel, None if late else job)
        if job is None or late:
            return self._of_nobody(record, channel, event, None, late=late)
        missing = None
        if event not in ("read_poll", "read_empty"):
            missing = self._of_another(channel, job, record)
        if missing is None:
            self._read(channel, job, event, record)
            return job
        self._set_aside(channel, job, missing)
        other = channel.open
        if other is not None:  # whichever job the record is for, it ends the open one
            is_later = job.order > other.order
            lacks = None if is_later else self._of_another(channel, other, record) or missing
            self._set_aside(channel, other, lacks or Missing("later"))
        return self._of_nobody(record, channel, event, missing, late=False)

    def _of_nobody(
        self, record: Record, channel: Channel, event: str, missing: Missing | None, *, late: bool
    ) -> Job | None:
        """The answer to a Read that belongs to no job, as far as the capture shows.

        `missing`: why the job is unknown; `late`: the job that the Read was for is over.
        """
        half = record.response
        assert half is not None
        if event not in ("read_record", "read_cut"):
            if not late:
                self._nothing(record, channel, missing)
            return None
        read = self._last_response(record, channel)
        first = self._first_of(record, read) if missing is None else None
        if read is not None and first is not None and read.phase != "closed":
            self._reread(channel, read, record)
            return read
        if not (late or event == "read_cut" or _is_last(channel, half)):
            channel.pass_over()
        return self._orphan(record, channel, first.frame if first is not None else None)

    def _first_of(self, record: Record, read: Job | None) -> Half | None:
        """The last response, if the record repeats it and no request can be missing since its Read."""
        first, half = None if read is None else read.read_response, record.response
        if read is None or first is None or half is None or not _is_same(first, half):
            return None
        asked = None if record.implicit else read.read_request
        since = (asked or first).frame  # frames may be out of order
        return first if self._missing_after(record.peer, since) is None else None

    def read_cut_before_status(self, record: Record) -> None:
        """The answer to a Read, cut off by the capture before its record: it counts as missing (P73)."""
        job, half = record.job, record.response
        assert half is not None
        self._channel(record, half.time_ns)
        if job is not None and not job.over:
            job.cut_frame = half.frame

    def _leave_refused(self, channel: Channel, job: Job | None) -> None:
        """The Read was not for the refused Write: no later Read is either."""
        refused = channel.refused
        if refused is None or refused is job:
            return
        if job is not None and refused.order > job.order:
            job.refused_behind = refused
        self._close(refused, "")
        channel.refused = None

    def _orphan(self, record: Record, channel: Channel, repeats: int | None) -> Job:
        """A record without a known request; `repeats`: the frame that had its bytes before."""
        job = Job(record, None, order=self.number())
        job.phase, job.certain, job.previous = "open", not self._pushed_out, channel.written_frame
        job.repeats = repeats
        half = record.response
        assert half is not None
        self._read(channel, job, _read_event(half), record)
        return job

    # What is not in the capture (P73)

    def may_lack(self, peer: Peer, frame: int) -> bool:
        """Whether a call of a controller to a device may be missing after a frame."""
        return self._missing_after(peer, frame) is not None

    def _lacks(self, job: Job, reason: str) -> Missing | None:
        """What the capture lacks, so that nobody knows whether the response of a job came."""
        asked = job.write_request
        if asked is None or job.read_response is not None or job.write_refused:
            return None
        found = self._lacks_calls(job, asked)
        if found is not None or job.limit:
            return found
        if reason in ("end", "expired") and (job.ended or not self._ends_soon(job.peer, asked)):
            return None
        what = _ENDS.get(reason)
        return None if what is None else Missing(what)

    def _lacks_calls(self, job: Job, asked: Half) -> Missing | None:
        """Which call of a job, or which half of one, may be missing. PROFIBUS has no calls."""
        if job.peer.station is not None:
            return self._missing_after(job.peer, asked.frame)
        if job.rewritten_frame:
            return Missing("written_again", asked.frame, job.rewritten_frame)
        if job.crossed:
            return Missing("crossed", *job.crossed)
        if job.doubled_frame:
            return Missing("twice", job.doubled_frame)
        if job.cut_frame:
            return Missing("cut_off", job.cut_frame)
        if job.fetching and not job.limit:
            return Missing("read_answer", job.fetching[0].frame)
        found = self._missing_after(job.peer, asked.frame)
        if found is None and not job.limit and not job.write_told:
            return _unanswered(job, asked)
        return found

    def _ends_soon(self, peer: Peer, asked: Half) -> bool:
        """Whether the controller's calls end so soon after a request that its Read may still come."""
        newest_ns = self._newest_ns
        if peer.station is None and self._completeness is not None:
            newest_ns = self._completeness.spoke_ns(peer.controller, peer.device)
        return newest_ns is None or newest_ns - asked.time_ns < self._limits.unread_ns

    def _of_another(self, channel: Channel, job: Job, record: Record) -> Missing | None:
        """Why a record, or a refused Read, may belong to another Write than that of the job; None: it does not.

        A record with the reference of the request does not belong to a missing Write, if the program counts its
        references: otherwise no request in a filtered capture would get its response. A missing Write that was
        accepted on this channel is an exception. The record may be for a repetition of the same request.
        """
        asked, half = job.write_request, record.response
        assert half is not None
        if asked is None:
            return None
        if job.peer.station is not None:
            return self._of_another_on_line(channel, job, asked, record)
        fits, other = _mirrors(job, half), channel.open not in (None, job)
        rival = job.refused_behind is not None and _mirrors(job.refused_behind, half)
        brought = bool(half.data) or (half.cut and job.write_response is None)
        if brought and (rival or not (fits or other)) and not job.write_told:
            return _unanswered(job, asked)
        read = record.request.frame if record.request is not None else half.frame
        if (half.data or half.cut) and job.fetching and job.fetching[0].frame < read:
            doubtful = not fits or (_is_last(channel, half) and not _counts(job, record))
            if doubtful:
                return Missing("read_answer", job.fetching[0].frame)
        if not fits and self._is_newer_again(channel, job, half):
            # A device that executes a Read once more has the newest response.
            return Missing("read_answer", read)
        if channel.asked and _may_be_newer(channel, job, record):
            return Missing("later")
        unknown = not (half.data or job.write_told)  # nobody knows whether its Write was accepted
        since = asked.frame
        if (unknown or job is channel.refused) and half.status != STATUS_SHORT:
            since = self._idle_since(job.key, channel, record.request or half)
        found = self._requests_missing_after(job.peer, channel, since, ordered=fits)
        if found is None and job is channel.refused and half.data and not fits:
            # it may mirror a request that was set aside, or one before a Connect
            found = channel.aside or self._missing_after(job.peer, 0)
        if unknown and found is not None:  # at least its own Write response is missing
            lacks = self._requests_missing_after(job.peer, channel, asked.frame, ordered=fits)
            return lacks or _unanswered(job, asked)
        if found is None or not half.data or channel.unseen_frame > since:
            return found
        return self._unless_sure(job, asked, record, found, fits=fits)

    def _is_newer_again(self, channel: Channel, job: Job, half: Half) -> bool:
        """Whether a record repeats the last one of its channel, which answered a newer request than that of a job.

        If the wire doubles calls, the record may also be that of another channel: their indices share one buffer.
        """
        key = job.key[:3]
        others = (self.channels[each] for each in self._of_ar[key]) if self._waits(job.peer) else ()
        return any(
            _is_last(each, half) and each.last is not None and each.last.order > job.order
            for each in (channel, *others)
        )

    def _unless_sure(
        self, job: Job, asked: Half, record: Record, found: Missing, *, fits: bool
    ) -> Missing | None:
        """What may be missing, unless a record that `fits` is surely that of a job all the same."""
        half, lacks = record.response, None
        assert half is not None
        # A record that is too short for its kind is not sure.
        sure = fits and _is_of_kind(job, half) is True
        first = found.what == "begins" and (fits if not job.write_refused else sure)
        if first and job.write_refused:  # a Write may be missing behind the refused one
            lacks = self._missing_after(job.peer, asked.frame, ordered=fits)
        if (first and lacks is None) or (sure and _counts(job, record)):
            return None
        return lacks or found

    def _of_another_on_line(
        self, channel: Channel, job: Job, asked: Half, record: Record
    ) -> Missing | None:
        """The same on PROFIBUS, where only the line shows the requests to a station."""
        half, since = record.response, asked.frame
        assert half is not None
        fits, refused = _mirrors(job, half), job is channel.refused
        unknown = not (half.data or job.write_told) and half.status != STATUS_SHORT
        if refused or unknown:  # a record may be older than a start-up
            begun = self._started.get(job.peer.device, _NEVER).frame
            sought = record.request or half
            since = channel.ended_frame
            if not half.data and since < begun < sought.frame:
                since = begun
        found = self._requests_missing_after(job.peer, channel, since)
        if found is None and refused and half.data and not fits:
            found = self._missing_after(job.peer, 0)
        if unknown and found is not None:  # at least its own Write response is missing
            lacks = self._requests_missing_after(job.peer, channel, asked.frame)
            return lacks or _unanswered(job, asked)
        sure = fits and _is_of_kind(job, half) is True
        return None if sure and _counts(job, record) else found

    def _set_aside(self, channel: Channel, job: Job, missing: Missing) -> None:
        """Ends a job with an unknown outcome."""
        if channel.open is job:
            channel.open = None
        elif channel.refused is job:
            channel.refused = None
        else:
            self._no_longer_asked(channel, job)
        if job.read_response is None and not job.write_refused:
            job.missing = missing
        self._close(job, "")

    def _idle_since(self, key: ChannelKey, channel: Channel, read: Half) -> int:
        """The newest frame before a Read at which nothing was open on a channel; 0 if none is known.

        The newest Connect may be after the Read, if the AR proves itself late. It does not count then.
        """
        connect = self._connects.get(key[:3], _NEVER)
        return max(channel.ended_frame, connect.frame if connect.frame < read.frame else 0)

    def _requests_missing_after(
        self, peer: Peer, channel: Channel, since: int, *, ordered: bool = False
    ) -> Missing | None:
        """What may be missing of the requests on a channel after a frame; 0: from before the capture."""
        if channel.unseen_frame > since:
            return Missing("requests")
        if not since:
            return Missing("begins")
        if since >= self._sure.get(peer[:2], _UNSURE):
            return None
        return self._missing_after(peer, since, ordered=ordered)

    def _nothing(self, record: Record, channel: Channel, missing: Missing | None) -> None:
        """A Read that brought nothing, while no request is known to be open."""
        half = record.response
        assert half is not None
        known = missing is None
        if known and _was_open(channel, record):
            return  # its response comes after that to a later Read
        if known:
            missing = self._may_be_open(
                record.peer, record.channel, channel, record.request or half
            )
        self._outcomes.append(("nothing", record, missing))
        if half.status is not None and known:
            channel.pass_over()
            if missing is None:
                channel.ended_frame = half.frame
                channel.sought_frame = (record.request or half).frame

    def _may_be_open(
        self, peer: Peer, key: ChannelKey, channel: Channel, half: Half
    ) -> Missing | None:
        """Which missing request may be open on a channel, if the capture shows none (P78).

        A program goes on reading after a Connect what it asked for before.
        """
        since = channel.sought_frame or self._idle_since(key, channel, half)
        missing = self._requests_missing_after(peer, channel, since)
        if missing is None and self._newest_unseen(key) > channel.ended_frame:
            return Missing("requests")
        return missing

    def _newest_unseen(self, key: ChannelKey) -> int:
        """The newest accepted Write to a place without its request, for any controller and AR: its frame."""
        keys = reversed(self._of_place.get(_spot(key), {}))
        return max(
            (self.channels[each].unseen_frame for each in islice(keys, self._limits.users)),
            default=0,
        )

    def is_again(self, record: Record) -> bool:
        """Whether a ReadImplicit repeats the last response of its place (P55). Changes nothing."""
        return record.implicit and self._repeated(record) is not None

    def _repeated(self, record: Record) -> Job | None:
        """The job with the last response of a place, if a later record has the same bytes (P22)."""
        delivered, half = self._delivered.get(_spot(record.channel)), record.response
        before = None if delivered is None else delivered.read_response
        if half is None or before is None or half.frame <= before.frame:
            return None
        return delivered if _is_same(before, half) else None

    def _last_response(self, record: Record, channel: Channel) -> Job | None:
        """The job with the response that a Read without a request may repeat.

        It is the last of the channel. For a ReadImplicit it is the last of the place, for any controller and AR.
        """
        delivered = self._repeated(record) if record.implicit else None
        if delivered is None or record.response is None:
            return channel.last
        again = delivered.phase == "closed" and _bytes(channel.last) == record.response.data
        return channel.last if again else delivered

    def _reread(self, channel: Channel, job: Job, record: Record) -> None:
        assert record.response is not None
        job.phase = self._table[job.phase]["reread"]
        if not job.rereads and not _was_open(channel, record):
            job.between = channel.waiting()
            read = job.read_response.frame if job.read_response else 0
            written = max(channel.written_frame or 0, channel.unasked_frame)
            job.reread_cause = "again_unaccepted" if written > read else "again"
            if record.implicit:
                job.reread_cause = "again_without_ar"
        self._keep(job.rereads, (record.request, record.response))

    def read_request(self, record: Record) -> None:
        """Takes a Read request, and notes the job that it is for, as far as that is known before its response."""
        channel, asked = self.channels.get(record.channel), record.request
        if channel is None or asked is None:
            return
        job = record.job = channel.open or channel.waiting() or channel.refused
        if job is not None:
            job.fetching.append(asked)

    def read_over(self, record: Record) -> None:
        """A Read is over, whichever job gets its response."""
        job, asked = record.job, record.request
        if job is not None and job.phase == "closed":
            channel = self.channels.get(record.channel)
            job = channel.open if channel is not None else None  # see `_displace`
        if job is not None and asked in job.fetching:
            job.fetching.remove(asked)

    def read_lost(self, record: Record) -> None:
        """A Read that never got its RPC response: its job has the first one that brought nothing."""
        job, read = record.job, record.request
        if job is None or read is None or job.over or job.read_response is not None:
            return
        job.read_request = job.read_request or (job.fetching or [read])[0]

    def read_asked_late(self, record: Record, answer: int) -> None:
        """The request of a Read whose response was in an earlier frame."""
        channel = self.channels.get(record.channel)
        last = channel.last if channel is not None else None
        read = last.read_response if last is not None else None
        if last is not None and read is not None and read.frame == answer:
            last.read_request = record.request

    def release(
        self,
        controller: str,
        device: str,
        ar: bytes,
        at: Moment | None = None,
        index: int | None = None,
    ) -> None:
        """The AR is over: open jobs on its channels, or on those of one index, stay unanswered."""
        for key in list(self._of_ar.get((controller, device, ar), ())):
            if index is None or key[-1] == index:
                self._close_channel(key, "release", at)
        if index is not None:
            return
        if self._connected.get((controller, device)) == ar:
            del self._connected[controller, device]

    def connected(
        self,
        controller: str,
        device: str,
        at: Moment,
        ar: bytes | None = None,
        *,
        only: bool = False,
    ) -> None:
        """An AR is set up: open requests of the same AR have lost their connection.

        `only`: a controller has only one of this kind with a device. It replaces the one before, unless there is
        another message on that.
        """
        if ar is not None:
            self._put(self._connects, (controller, device, ar), at)
            if only:
                self._replace(controller, device, ar, at)
                self._put(self._connected, (controller, device), ar)
        self._outcomes.append(("connected", device, at.frame))

    def started(self, station: str, at: Moment) -> None:
        """A PROFIBUS station got its parameters: it may have been switched off before."""
        self._put(self._started, station, at)
        self._outcomes.append(("connected", station, at.frame))

    def _replace(self, controller: str, device: str, ar: bytes, at: Moment) -> None:
        before = self._connected.get((controller, device))
        if before is None or before == ar:
            return
        key = controller, device, before
        if not all(self.channels[each].is_free() for each in self._of_ar.get(key, ())):
            self.replaced[key] = at

    def _put(self, memory: OrderedDict[_K, _T], key: _K, value: _T) -> None:
        memory[key] = value
        memory.move_to_end(key)
        if len(memory) > self._limits.channels:
            memory.popitem(last=False)

    def goes_on(self, controller: str, device: str, ar: bytes) -> None:
        """A message on an AR: it is not replaced."""
        self.replaced.pop((controller, device, ar), None)

    def finish(self, newest_ns: int | None = None) -> None:
        """The capture is over; `newest_ns` is the time of the newest record call that is ours."""
        self._newest_ns = newest_ns
        while self.channels:
            self._close_channel(next(iter(self.channels)), "end")

    def number(self) -> int:
        """The number of the next transaction, in the order in which they begin."""
        self._count += 1
        return self._count

    def _channel(self, record: Record, now: int) -> Channel:
        key, expiry = record.channel, self._limits.transaction_expiry_ns
        if self.replaced:
            self.goes_on(*key[:3])
        channel, channels = self.channels.get(key), self.channels
        if channel is not None and now - channel.touched > expiry:
            self._close_channel(key, "expired")
            channel = None
        if channel is None:
            channel = channels[key] = Channel(now, _spot(key))
            self._of_ar.setdefault(key[:3], {})[key] = None
            self._of_place.setdefault(channel.spot, {})[key] = None
            self._due_ns = now  # there may be too many
        # If the clock was set back, the first channel in the order need not be the oldest by time.
        self._set_back = self._set_back or now < self._touched_ns
        channel.touched = self._touched_ns = now
        channels.move_to_end(key)
        if now >= self._due_ns or self._set_back:
            self._make_room(now)
        return channel

    def _make_room(self, now: int) -> None:
        """Closes channels without a message for too long, and the oldest ones if there are too many."""
        channels, expiry = self.channels, self._limits.transaction_expiry_ns
        while len(channels) > 1:
            key, oldest = next(iter(channels.items()))
            old = now - oldest.touched > expiry
            if not old and len(channels) <= self._limits.channels:
                break
            self._close_channel(key, "expired", limit="" if old else "channels")
        self._due_ns = next(iter(channels.values())).touched + expiry

    def _accept(self, channel: Channel, job: Job) -> None:
        """An accepted Write opens its job. It displaces the open job, and closes the refused one."""
        channel.accepted = max(channel.accepted, job.order)
        if job.phase == "asked":
            self._no_longer_asked(channel, job)
            if channel.asked and job.write_told:
                _written_again(channel, job)
            if channel.open is not None:
                self._displace(channel, channel.open, job)
            if channel.refused is not None:
                self._close(channel.refused, "")
                channel.refused = None
            channel.open, channel.aside = job, None
        job.phase = self._table[job.phase]["write_accepted"]

    def _displace(self, channel: Channel, job: Job, by: Job) -> None:
        """An accepted Write displaces a request without a response; that response may also be missing.

        A Read after that Write is for it. After a Connect, it displaces nothing: the AR is new.
        """
        asked = by.record.request
        if asked is not None:
            by.fetching += [read for read in job.fetching if read.frame >= asked.frame]
            job.fetching = [read for read in job.fetching if read.frame < asked.frame]
        self._refused_at_last(job)
        if job.read_response is not None or self._connected_since(job, asked) is not None:
            self._close(job, _may_be_displaced(channel).get(job.order, "release"))
            return
        job.missing = self._lacks(job, "")
        if job.missing is None:
            job.superseded_by = asked.frame if asked is not None else None
            job.superseding = by
        self._end(job, "displaced")

    def _presume(self, channel: Channel, job: Job) -> None:
        """The record proves that the Write was accepted; the Write response is missing.

        The Write does not displace a newer one: then the record came late.
        """
        if channel.open is not None and channel.open.order > job.order:
            self._no_longer_asked(channel, job)
            job.phase = self._table[job.phase]["write_accepted"]
        else:
            self._accept(channel, job)

    def _held(self, job: Job) -> Job | None:
        """The newest other request that the capture shows open at the place of a job, for any controller and AR.

        A Connect of its AR before the Write of the job ends it.
        """
        came = job.write_request
        keys = reversed(self._of_place.get(_spot(job.key), {}))
        found: Job | None = None
        for key in islice(keys, self._limits.users):
            channel = self.channels[key]
            held = channel.open
            if held is None or held is job or (found and found.order > held.order):
                continue
            if came is not None and self._connected_since(held, came) is None:
                found = held
        return found

    def _rival(self, found: Job, job: Job) -> Job | None:
        """The found request, if it surely was open when the Write of the job came, or came later itself.

        Sure means: it was accepted, and no pending Read may fetch its response. None if a call of the two peers
        may be missing since.
        """
        asked, came = found.write_request, job.write_request
        if not (asked and came):
            return None
        if any(self.may_lack(peer, asked.frame) for peer in (found.peer, job.peer)):
            return None
        fetched = any(read.frame < came.frame for read in found.fetching)
        sure = found.write_told and not (fetched or found.doubled_frame)
        return found if sure or asked.frame > came.frame else None

    def _refuse(self, channel: Channel, job: Job) -> None:
        before = job.phase
        half = job.write_response
        if half is not None and half.status == STATUS_IN_USE:
            held = self._held(job)
            job.rival = held and self._rival(held, job)
            asked = job.write_request or half
            free = held is None and channel.ended_frame < asked.frame
            job.alone = free and self._may_be_open(job.peer, job.key, channel, asked) is None
        job.phase = self._table[job.phase]["write_refused"]
        if before == "answered":
            return
        if before == "asked":
            self._no_longer_asked(channel, job)
        else:
            channel.open = None
        if channel.refused is not None:
            self._close(channel.refused, "")
        channel.refused = job

    def _addressee(self, channel: Channel, event: str, record: Record) -> Job | None:
        """The job that a Read answers. An unanswered Write counts if the record fits it."""
        data = record.response.data if record.response else b""
        opened, reference = channel.open, data[0] if data else None
        if event == "read_record" and (opened is None or opened.reference != reference):
            mirrored = [
                job for job in reversed(channel.asked)
                if job.reference == reference
                and not (job.passed_over or _is_later(job, record))
                and _may_be(channel, job, record.response)
            ]  # fmt: skip
            half = record.response
            if mirrored and half is not None:  # of several the newest with the kind of the record
                return next((job for job in mirrored if _mirrors(job, half)), mirrored[0])
        if opened is not None:
            by_kind = event == "read_record" and channel.asked
            return _by_kind(channel, opened, record) if by_kind else opened
        waiting = channel.waiting()
        if waiting is not None:
            half = record.response
            if event != "read_record" or half is None:
                return waiting
            old_answer = _is_last(channel, half) or not _mirrors(waiting, half)
            return None if old_answer else waiting
        return channel.refused

    def _sought(self, channel: Channel, found: Job, event: str, record: Record) -> Job | None:
        """The same if a request was refused: sets a job aside that may be over."""
        half, over = record.response, _wrote_behind(channel, found, record)
        if over is None:
            return found
        self._set_aside(channel, found, over)
        channel.aside = over
        self._forget_last(channel)  # the missing response is newer
        job = self._addressee(channel, event, record)
        strange = job is not None and half is not None and half.data and not _mirrors(job, half)
        return None if strange else job  # the record may still belong to the job that was set aside

    def _read(self, channel: Channel, job: Job, event: str, record: Record) -> None:
        half, told, sent = record.response, job.write_response, record.request
        assert half is not None
        if told is not None and sent is not None and sent.frame < told.frame:
            job.hasty = self._waits(job.peer)
        if event == "read_record" and job.phase == "refused":
            self._compare(channel.last, job, half)
        if job.phase == "asked" and event == "read_cut":
            self._no_longer_asked(channel, job)  # accepted or not: the status is cut off, too
            channel.accepted = max(channel.accepted, job.order)  # no older Write waits any more
        elif job.phase == "asked" and event not in ("read_empty", "read_short"):
            self._presume(channel, job)
        job.phase = self._table[job.phase][event]
        if event in ("read_poll", "read_short"):
            self._keep(job.polls, (record.request, half))
        elif event == "read_empty":
            if half.status is not None:
                self._keep(job.empty_reads, half)
        else:
            self._answer(channel, job, record.request, half)

    def _answer(self, channel: Channel, job: Job, read: Half | None, half: Half) -> None:
        """A Read ends a job: it brings the record, or it is refused."""
        job.read_request, job.read_response = read, half
        job.read_before = bool(job.polls or job.fetching) and self._may_be_read(job)
        if job.message is not None:  # anything may be missing before an orphan
            channel.ended_frame, channel.sought_frame = half.frame, (read or half).frame
            if half.cut and _is_headless(half) and not job.write_refused:
                job.missing = Missing("cut_off", half.frame)
        if channel.open is job:
            channel.open = None
        if channel.refused is job:
            channel.refused = None
        self._outcomes.append(("answered", job, None))
        if not half.data:
            self._close(job, "")
            if not job.write_refused:
                self._forget_last(channel)  # the next record may be for either
            return
        if channel.last is not None:
            self._end(channel.last)
        channel.last = job
        if job.message is not None and not job.write_refused:
            self._put(self._delivered, channel.spot, job)

    def _may_be_read(self, job: Job) -> bool:
        """Whether a missing Read may have fetched the record earlier, so that the waiting time is unknown.

        The missing call may also be a repetition of the request: then that one waited.
        """
        asked = job.write_request
        if asked is None:
            return False
        return bool(job.fetching) or self._missing_after(job.peer, asked.frame) is not None

    def _compare(self, last: Job | None, job: Job, half: Half) -> None:
        """Whether the answer to a refused request repeats the last one.

        An unanswered Write proves nothing: two questions may have the same answer.
        """
        if last is None or last.read_response is None or not _is_same(last.read_response, half):
            return
        if self._missing_after(job.peer, last.read_response.frame) is None:
            job.repeats = last.read_response.frame

    def _keep(self, reads: list[_T], read: _T) -> None:
        """Keeps a Read of a job; beyond `Limits.reads` the newest replaces the last one kept."""
        if len(reads) >= self._limits.reads:
            reads.pop()
        reads.append(read)

    def _close(self, job: Job, reason: str) -> None:
        """Closes a job: nothing more comes."""
        if job.polls and job.missing is None:
            self._refused_at_last(job)
        job.reason = reason
        if job.read_response is None:
            connect = self._connected_since(job) if job.ended is None else None
            if connect is not None:
                job.ended = connect.frame
            job.missing = job.missing or self._lacks(job, reason)
        self._end(job)

    def _refused_at_last(self, job: Job) -> None:
        """If a Read was too short and no later one brought the response, that refusal is the answer (P34)."""
        short, asked = job.too_short if job.read_response is None else None, job.write_request
        if not short or asked is None:
            return
        lacks = self._lacks_calls(job, asked)
        if lacks is None or lacks.what == "write_answer":  # else a missing Read may have fetched it
            job.polls.remove(short[-1])
            job.read_request, job.read_response = short[-1]

    def _connected_since(self, job: Job, before: Half | None = None) -> Moment | None:
        """The Connect that set up the AR of a request again; None if there is none, or none `before` another call.

        If an AR proves itself late, its Connects are known before its requests.
        """
        asked, key = job.write_request, job.key[:3]
        connect = self.replaced.get(key) or self._connects.get(key)
        if connect is None or asked is None or connect.frame < asked.frame:
            return None
        return connect if before is None or connect.frame < before.frame else None

    def _end(self, job: Job, event: str = "lost") -> None:
        if job.missing is not None and job.fetching and job.read_request is None:
            job.read_request = job.fetching[0]
        job.phase = self._table[job.phase][event]
        self._outcomes.append(("closed", job, None))

    def _push_out_asked(self, job: Job, limit: str) -> None:
        """A limit ends a Write without a response."""
        self._no_longer_asked(self.channels[job.key], job)
        self._push_out(job, limit)

    def _no_longer_asked(self, channel: Channel, job: Job) -> None:
        channel.asked.remove(job)
        del self._unanswered[job.order]

    def _push_out(self, job: Job, limit: str) -> None:
        """A limit closes a job: its response may still come."""
        if job.read_response is None and not job.write_refused:
            job.limit, self._pushed_out = limit, True
        self._close(job, "")

    def _close_channel(
        self, key: ChannelKey, reason: str, at: Moment | None = None, limit: str = ""
    ) -> None:
        _take_out(self._of_ar, key[:3], key)
        _take_out(self._of_place, _spot(key), key)
        channel = self.channels.pop(key)
        why = _at_the_end(channel) if reason == "end" else _may_be_displaced(channel)
        for job in channel.asked:
            del self._unanswered[job.order]
        for job in channel.jobs():
            if limit:
                self._push_out(job, limit)
                continue
            job.ended = at and at.frame
            self._close(job, why.get(job.order, reason))
        if key[:3] not in self._of_ar:
            self.replaced.pop(key[:3], None)


def _unanswered(job: Job, asked: Half) -> Missing:
    """The capture lacks the answer to a Write, or has cut it off."""
    half = job.write_response
    return Missing("write_answer", asked.frame) if half is None else Missing("cut_off", half.frame)


def _written_again(channel: Channel, job: Job) -> None:
    """An accepted Write replaces older unanswered ones with the same request."""
    by = job.write_request
    for each in channel.asked:
        before = each.write_request
        if each.order < job.order and before and by and before.data == by.data:
            each.rewritten_frame = by.frame


def _is_read_before(opened: Job | None, job: Job, response: Half) -> bool:
    """Whether a Read was sent after the Write of a job, and before its response, in the file and by the clock.

    While an older request is open, the Read is taken for one of that.
    """
    reads = [*job.fetching, job.read_request, *(read for read, _ in job.polls)]
    asked = job.write_request
    if asked is not None and opened is not None and opened.order < job.order:
        of_opened = (*opened.fetching, *(read for read, _ in opened.polls))
        reads += [read for read in of_opened if read is not None and read.frame > asked.frame]
    return any(read is not None and read.time_ns < response.time_ns for read in reads)


def _cross(channel: Channel, job: Job) -> bool:
    """Whether a later Write is open already: nobody knows which one the device executed last (P27)."""
    newer = channel.open
    if newer is None or newer.order < job.order:
        newer = channel.last
    if newer is None or newer.order < job.order:
        return False
    one, other = job.write_request, newer.write_request
    if job.phase != "asked" or not (one and other):
        return False
    job.crossed = newer.crossed = one.frame, other.frame
    return newer is channel.open


def _spot(key: ChannelKey) -> tuple[str, int, int, int, int]:
    """The place of a record, for any controller and AR."""
    return (key[1], *key[3:])


def _take_out(index: dict[_K, dict[ChannelKey, None]], name: _K, key: ChannelKey) -> None:
    """Removes a closed channel from an index."""
    keys = index[name]
    del keys[key]
    if not keys:
        del index[name]


def _at_the_end(channel: Channel) -> dict[int, str]:
    """`Job.order` -> why a job has no response, for jobs whose channel went on before the capture ended."""
    newest = channel.asked[-1] if channel.asked else None
    why = {job.order: "unseen" for job in channel.asked if job is not newest}
    if newest is None:
        return why
    asked = newest.record.request
    if newest.order < channel.accepted or (asked is not None and channel.heard_frame > asked.frame):
        why[newest.order] = "unseen"
    return why | _may_be_displaced(channel)


def _may_be_displaced(channel: Channel) -> dict[int, str]:
    """The same for an open request, if a later unanswered Write may have displaced it."""
    held, newest = channel.open, channel.asked[-1] if channel.asked else None
    if held is None or newest is None or held.order > newest.order:
        return {}
    return {held.order: "later"}


def _by_kind(channel: Channel, opened: Job, record: Record) -> Job:
    """The job of a record if its reference does not decide: the open one, or a newer Write (P71, P72).

    A newer Write gets it if the kind of the record fits that, and does not fit the open request. If the kind does
    not decide for the open request either, the newer Writes are contested.
    """
    read, half = record.request, record.response
    assert half is not None
    mirrored = opened.reference == half.data[0]
    if not mirrored and _is_last(channel, half):
        return opened  # the last answer again
    newer = [
        job for job in reversed(channel.asked)
        if job.order > opened.order and not job.passed_over and (job.reference == half.data[0]) is mirrored
    ]  # fmt: skip
    of_opened = _is_of_kind(opened, half)
    for job in newer if of_opened is False else ():
        asked = job.write_request
        if _is_of_kind(job, half) and (read is None or asked is None or read.frame > asked.frame):
            return job
    for job in newer:
        job.contested = job.contested or not of_opened or _is_of_kind(job, half) is not False
    return opened


def _is_later(job: Job, record: Record) -> bool:
    """Whether the Write of a job was sent after the request of a Read, in the file and by the clock."""
    asked, read = job.write_request, record.request
    if asked is None:
        return False
    if read is None:
        return 0 < record.asked_before <= asked.frame
    return asked.frame > read.frame and asked.time_ns >= read.time_ns


def _mirrors(job: Job, half: Half) -> bool:
    """Whether a record has the reference and the kind of a request."""
    data, message = half.data, job.message
    if not data or job.reference != data[0]:
        return False
    return message is None or kind_fits(message, data) is not False


def _counts(job: Job, record: Record) -> bool:
    """Whether a program seems to count its references: one more than before, or two, to skip 0.

    So does the first request on a channel, unless it was refused, a call of it is incomplete, or another channel
    had its reference last. A filtered capture may have no other request, but its calls are whole.
    """
    before, now = job.previous_reference, job.reference
    if before is None:
        reads = [record.request, *(read for read, _ in job.polls)]
        halves = bool(job.fetching) or None in reads
        return job.previous is None and not (halves or job.write_refused or job.uncounted)
    return now is not None and (now - before) % 256 in (1, 2)


def _was_open(channel: Channel, record: Record) -> bool:
    """Whether a Read was sent before the response to the last request that was answered."""
    last, read = channel.last, record.request
    if read is None:
        return 0 < record.asked_before <= channel.sought_frame
    if last is None or last.read_response is None:
        return False
    return read.frame < last.read_response.frame and read.time_ns < last.read_response.time_ns


def _wrote_behind(channel: Channel, job: Job, record: Record) -> Missing | None:
    """The last unanswered Read of a job, if a Write after it was refused: the Read may have ended the job.

    It has not, if the record mirrors the request of the job and not the refused one.
    """
    half, refused = record.response, channel.refused
    written = refused.write_request if refused is not None else None
    if half is None or refused is None or written is None or refused.order <= job.order:
        return None
    own = bool(half.data) and refused.reference != half.data[0]
    if own and _mirrors(job, half) and _is_of_kind(job, half):
        return None
    sent = [each.frame for each in job.fetching if each.frame < written.frame]
    polled = job.polls[-1][1].frame if job.polls else 0
    return Missing("read_answer", sent[-1]) if sent and sent[-1] > polled else None


def _may_be_newer(channel: Channel, job: Job, record: Record) -> bool:
    """Whether a Read may be for an unanswered Write that is newer than that of a job."""
    half = record.response
    assert half is not None
    strange = not half.data or _is_of_kind(job, half) is False
    strange = strange or (job.reference != half.data[0] and _is_last(channel, half))
    return any(
        each.order > job.order
        and not (each.passed_over or _is_later(each, record))
        and (strange or _mirrors(each, half))
        for each in channel.asked
    )


def _may_be(channel: Channel, job: Job, half: Half | None) -> bool:
    """Whether a record may be for the Write that it mirrors.

    If a later Write was accepted, it must also have the right kind, and not repeat the last record.
    """
    return job.order > channel.accepted or (
        half is not None and _is_of_kind(job, half) is True and not _is_last(channel, half)
    )


def _is_of_kind(job: Job, half: Half) -> bool | None:
    return None if job.message is None else kind_fits(job.message, half.data)


def _read_event(half: Half) -> str:
    if half.status == STATUS_NOT_READY:
        return "read_poll"
    if half.status == STATUS_SHORT:
        return "read_short"
    if half.status:
        return "read_refused"
    if half.data:
        return "read_record"
    return "read_cut" if half.cut else "read_empty"


def _is_headless(half: Half) -> bool:
    """Whether the capture cut off the record so early that the kind of response is unknown."""
    return not half.status and len(half.data) < _KIND_END


def _is_same(one: Half, other: Half) -> bool:
    """Whether two records have the same captured bytes, and lack equally many."""
    return one.data == other.data and one.missing == other.missing


def _is_last(channel: Channel, half: Half) -> bool:
    """Whether a record repeats the last one of its channel, which may have been read only in part."""
    before = channel.last.read_response if channel.last else None
    if before is None or not before.data:
        return False
    return _is_same(before, half) if before.cut else half.data.startswith(before.data)


def _bytes(job: Job | None) -> bytes | None:
    return job.read_response.data if job and job.read_response else None
