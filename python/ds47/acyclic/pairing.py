"""Pairing on the DS47 level: Writes and Reads of one channel to jobs (docs/pairing.md).

A job is a transaction in the making. Its life is the table `spec/pairing.toml`; the only thing decided
here is to which job a record call belongs. Nothing is decoded beyond what a caller hands in, and nothing
is judged: what becomes of jobs is put on a list (`Told`), and whoever runs the steps takes it from there.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
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
"""Length error on a Read: the response is longer than what it asks for (docs/protocol.md E.1)."""
STATUS_IN_USE: Final = 0xDF80B500
"""State conflict on a Write: the device still works on another request."""


_KIND_END: Final = 2
"""Bytes of a message up to the end of its ID."""

_T = TypeVar("_T")
_K = TypeVar("_K")


class Moment(NamedTuple):
    """A frame and its time."""

    frame: int
    time_ns: int


_NEVER: Final = Moment(0, 0)
_FORGOTTEN: Final = Record(False, False, NIL_UUID, NO_API, 0, 0, 0, 0)
_ENDS: Final = {"end": "ends", "expired": "unseen", "later": "later", "unseen": "unseen"}
"""Why a request is over without its response -> what is not in the capture then."""


@dataclass(slots=True, eq=False, init=False, repr=False)
class Job:
    """A transaction in the making: the halves of its record calls and what pairing learnt of it."""

    peer: Peer
    record: Record
    key: ChannelKey
    """Its channel."""
    message: Request | None
    reference: int | None
    """The request reference that was sent."""
    write_request: Half | None
    """The request of the Write that asked; None for an orphan."""
    phase: str
    write_response: Half | None
    write_refused: bool
    """Whether the Write was answered with a negative status or an RPC fault."""
    read_request: Half | None
    read_response: Half | None
    polls: list[tuple[Half | None, Half]]
    """Reads that left it open: not ready yet, or too short for its response."""
    rereads: list[tuple[Half | None, Half]]
    empty_reads: list[Half]
    response: Response | None
    """Decoded by whoever is told of the answer."""
    stray: bool
    """Whether that cannot be the answer to the request; found by the judge,"""
    usual: bool
    """who found nothing else to be said of it, too: it was answered as it was asked, in full."""
    known: bool
    """Whether it shows nothing, beside its values, that is not known already."""
    previous_reference: int | None
    previous: int | None
    """Frame of the request before it on its channel, as far as the capture shows."""
    uncounted: bool
    """Whether it is the first one on its channel, and another channel of its AR had its reference last."""
    superseded_by: int | None
    reason: str
    order: int
    superseding: Job | None
    """The request that displaced this one."""
    rival: Job | None
    """Whose request was open when this one was turned away as in conflict with another."""
    alone: bool
    """Whether it was turned away so where it is known that no request was open."""
    refused_behind: Job | None
    """The newer Write that was refused before the first Read: what is read may be for that one."""
    repeats: int | None
    """Frame of an earlier response that was read once more where a new one was due."""
    again: str
    """Of the first re-read behind the response, how it came about: a key of diagnoses.toml."""
    between: Job | None
    """The Write without its response before the first re-read, which may have brought the response to it."""
    ended: int | None
    """Frame that ended the connection while the request was open."""
    fetching: list[Half]
    """The Reads that were sent for it and have no response up to now."""
    read_before: bool
    """Whether an earlier Read that is not in the capture, or not whole, may have brought the response."""
    twice: int
    """Frame of a call of it with two responses, of which the client may have either; 0 for none."""
    hasty: bool
    """Whether its Read was sent before the response to its Write, though its client waits for each as a rule."""
    untold: int
    """Frame that the capture cut off before it says what is asked, or what became of a call; 0 for none."""
    written_again: int
    """Frame of the Write that asked for the same while this one had no response, and was accepted; 0 for none."""
    crossed: tuple[int, int] | None
    """Frames of two Writes, this one among them, whose responses came in the other order (P27)."""
    missing: Missing | None
    """Why nobody knows what became of it."""
    limit: str
    """Name of the limit that pushed it out (spec/limits.toml): a response may still come. "" for none."""
    passed: bool
    """Whether ds47 has said, while this Write waited for its response, that no request is open (P28)."""
    contested: bool
    """Whether a record that went to an older request may be the response to this one (P72)."""
    over: bool
    """Whether its transaction was told."""
    certain: bool
    """False for an orphan whose request a limit may have pushed out."""
    meanings: Sequence[Meaning | None]
    """What the drive has said of its parameters, by their number; empty where it has said nothing of them."""

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
        self.stray = self.usual = self.known = False
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
        self.again = ""
        self.between = None
        self.ended = None
        self.fetching = []
        self.read_before = False
        self.twice = self.untold = self.written_again = 0
        self.crossed = None
        self.missing = None
        self.limit = ""
        self.passed = False
        self.contested = False
        self.over, self.certain = False, True
        self.meanings = ()

    def forget(self) -> None:
        """It is told. Else each would keep the next one alive, and the memory of calls its response.

        Its record knows it, so it forgets that, too: what knows each other stays until somebody looks for garbage.
        """
        self.over, self.record = True, _FORGOTTEN
        self.superseding = self.rival = self.refused_behind = self.between = self.response = None

    @property
    def device(self) -> str:
        """IP address of the device."""
        return self.peer.device

    @property
    def write_told(self) -> bool:
        """Whether the capture shows what the Write was answered."""
        return self.write_response is not None and not self.write_response.untold

    @property
    def not_ready(self) -> list[tuple[Half | None, Half]]:
        """The Reads that came before its response was ready."""
        return [read for read in self.polls if read[1].status == STATUS_NOT_READY]

    @property
    def too_short(self) -> list[tuple[Half | None, Half]]:
        """The Reads that asked for fewer bytes than its response has."""
        return [read for read in self.polls if read[1].status == STATUS_SHORT]


@dataclass(slots=True, init=False, repr=False, eq=False)
class Channel(Plain):
    """The jobs of a channel."""

    touched: int
    """When anything was said on it last."""
    spot: tuple[str, int, int, int, int]
    """Its place, whoever asks there."""
    asked: list[Job]
    open: Job | None
    refused: Job | None
    last: Job | None
    reference: int | None
    written: int | None
    """The frame of the newest Write; `reference` is that of its request."""
    accepted: int
    """The `Job.order` of the newest Write that was accepted."""
    heard: int
    """The frame of the newest record that was read; 0 for none."""
    unasked: int
    """The frame of the newest Write response whose request is not in the capture; 0 for none."""
    unseen: int
    """The same, of one that was accepted: it displaced what was open."""
    ended: int
    """The frame of the newest Read response that ended a known request, or found none; 0 for neither."""

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
        self.written = None
        self.accepted = 0
        self.heard = 0
        self.unasked = self.unseen = 0
        self.ended = 0

    def pass_over(self) -> None:
        """No request is open: of the Writes that wait for their responses none is answered any more."""
        for job in self.asked:
            job.passed = True

    def waiting(self) -> Job | None:
        """The newest Write without its response that a Read may ask for: none was accepted after it."""
        newest = self.asked[-1] if self.asked else None
        if newest is None or newest.passed:
            return None
        return newest if newest.order > self.accepted else None

    def is_free(self) -> bool:
        """Whether nothing waits for a response or for the end of its grace."""
        return not (self.asked or self.open or self.refused)

    def jobs(self) -> list[Job]:
        """All of them."""
        return [job for job in (self.last, self.refused, self.open) if job] + self.asked


What = Literal[
    "asked", "refused", "answered", "closed", "nothing", "connected", "remark", "foreign", "set_up",
    "questions", "proven", "no_drive",
]  # fmt: skip
Told = tuple[What, Any, Any]
"""What became known, of what, and what goes with it; in the order of the capture:

    asked       a job whose Write asks for a change
    refused     a job whose Write was refused: what comes after that is seldom of interest
    answered    a job that has its response, once
    closed      a job of which nothing more can come, once; `Job.forget` is for whoever takes it
    nothing     the Read without a record where no request is open; what may be missing, or None
    connected   the device of a Connect, or a station that got its parameters; the frame
    remark      a finding of the steps before (`ds47.findings.remark`); the record that it is about, or None
    foreign     a Write that was answered, to an index that cannot be ours, or without its request
    set_up      the request of a Connect; its response
    questions   an AR of which a question is the proof; all that is told of it at index 47 is not sure until
    proven      it is one of DS47, or
    no_drive    it is none: then all of that is nothing
"""


class Pairing:
    """Takes record calls in the order of the capture and keeps the jobs of every channel.

    Args:
        limits: the numbers of spec/limits.toml.
        told: gets what becomes of jobs.
        completeness: what is missing of what stations say to each other; None: nothing.
    """

    def __init__(
        self, limits: Limits, told: list[Told], completeness: Completeness | None = None
    ) -> None:
        self._limits = limits
        self._completeness = completeness
        self._behind = _nothing_behind if completeness is None else completeness.behind
        self._told = told
        self._table = phases()
        self.channels: OrderedDict[ChannelKey, Channel] = OrderedDict()
        self._of_ar: dict[tuple[str, str, bytes], dict[ChannelKey, None]] = {}
        self._of_place: dict[tuple[str, int, int, int, int], dict[ChannelKey, None]] = {}
        """The channels of a place, whoever asks there; the newest is the last."""
        self._pushed_out = False
        """Whether a limit pushed out requests whose responses may still come."""
        self._delivered: OrderedDict[tuple[str, int, int, int, int], Job] = OrderedDict()
        """The newest accepted request of a place whose response was read, whoever asked."""
        self._connects: OrderedDict[tuple[str, str, bytes], Moment] = OrderedDict()
        """The newest Connect of each AR."""
        self._started: OrderedDict[str, Moment] = OrderedDict()
        """When a station of PROFIBUS got its parameters last: before that nothing is open."""
        self._connected: OrderedDict[tuple[str, str], bytes] = OrderedDict()
        """Of the ARs of which two stations have one, that which they set up last and did not release."""
        self.replaced: dict[tuple[str, str, bytes], Moment] = {}
        """ARs with open requests that a Connect seems to have replaced; until anything is said on them."""
        self._count = 0
        self._newest_ns: int | None = None
        self._due_ns = 0
        """Up to then no channel is too old,"""
        self._touched_ns = 0
        self._set_back = False
        """unless the clock went back since the last one was touched."""

    def write_request(self, record: Record, message: Request) -> Job:
        """A Write that asks for something. Returns the job, for `write_response`."""
        asked = record.request
        assert asked is not None
        channel = self._channel(record, asked.time_ns)
        self._count += 1
        job = Job(record, message, order=self._count)
        if asked.cut and message.request_id is None:
            job.untold = asked.frame
        before = job.previous = channel.written
        missing = None if before is None else self._behind(record.peer, before)
        if missing is None or missing.what == "one_direction":
            job.previous_reference = channel.reference
        if before is None:
            others = self._of_ar[record.relation]
            last = (self.channels[each].reference for each in others)
            job.uncounted = message.request_reference in last
        channel.reference, channel.written = message.request_reference, asked.frame
        channel.asked.append(job)
        if message.operation == "change":
            self._told.append(("asked", job, None))
        if len(channel.asked) > self._limits.pending_writes:
            self._push_out(channel.asked.pop(0), "pending_writes")
        return job

    def write_response(self, job: Job, response: Half | None, *, fault: bool = False) -> None:
        """The answer to a Write: accepted (status 0), refused (any other status, or an RPC fault)."""
        if job.polls or job.fetching or job.read_request:
            job.hasty = self._waits(job.peer)
        if job.hasty and (fault or (response is not None and response.status)):
            job.twice = job.write_request.frame if job.write_request else 0
            return  # who waits had another response before, and the device executed the call once more
        status = response.status if response else None
        job.write_response, job.write_refused = response, fault or bool(status)
        if response is not None and response.cut and response.untold:
            job.untold = response.frame
        if job.phase == "closed" or (status is None and not fault):
            return
        channel = self.channels.get(job.key)
        if channel is None:
            return
        if self.replaced:
            self.goes_on(*job.key[:3])
        if status == 0 and not fault:
            if not _cross(channel, job):
                self._accept(channel, job)
        else:
            self._refuse(channel, job)
            if job.phase == "refused":
                self._told.append(("refused", job, None))

    def _waits(self, peer: Peer) -> bool:
        """Whether a response behind a later call is a second one, as far as the habit of the client tells."""
        known = self._completeness
        return known is not None and known.waits(peer.controller, peer.device)

    def write_unasked(self, record: Record) -> None:
        """The answer to a Write whose request is not in the capture.

        It came after the refused one of its channel: no Read is for that one any more. One that was accepted asks
        for something that nobody knows: what is read from now on may be its response, also where that has the
        bytes of an earlier one.
        """
        half = record.response
        if half is None:
            return
        channel = self._channel(record, half.time_ns)
        channel.unasked = half.frame
        given_up = half.time_ns - self._limits.call_expiry_ns
        asked = (job.record.request for job in channel.asked)
        if any(each is not None and each.time_ns < given_up for each in asked):
            return  # that request is there, and its call was given up before
        if channel.refused is not None:
            self._lose(channel.refused, "")
            channel.refused = None
        if half.status != 0 and not half.untold:
            return
        channel.unseen = half.frame
        channel.pass_over()
        self._forget_last(channel)

    def _forget_last(self, channel: Channel) -> None:
        """A response that is not in the capture came behind the last one, or what is read may be of either."""
        if channel.last is not None:
            self._lose(channel.last, "")
            channel.last = None

    def read_response(self, record: Record) -> Job | None:
        """The answer to a Read. Returns the job it went to, None where there is none."""
        half = record.response
        assert half is not None
        self.read_over(record)
        channel = self._channel(record, half.time_ns)
        event = _read_event(half)
        if event in ("read_record", "read_cut"):
            channel.heard = half.frame
        job = self._addressee(channel, event, record)
        if job is not None and channel.refused is not None:
            job = self._sought(channel, job, event, record)
        late = job is not None and _is_later(job, record)  # what the Read asked for is over
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
        if channel.open is not None:  # whosever this is, it ends what was asked before it
            self._set_aside(channel, channel.open, Missing("later"))
        return self._of_nobody(record, channel, event, missing, late=False)

    def _of_nobody(
        self, record: Record, channel: Channel, event: str, missing: Missing | None, *, late: bool
    ) -> Job | None:
        """The answer to a Read that is for no job, as far as the capture shows.

        `missing`: why nobody knows for which one; `late`: the job that its Read asked for is over.
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
        """The last response, if a record is that once more, and no request may be missing since its Read."""
        first, half = None if read is None else read.read_response, record.response
        if read is None or first is None or half is None or not _is_same(first, half):
            return None
        asked = None if record.implicit else read.read_request
        since = (asked or first).frame  # frames may be out of order
        return first if self._behind(record.peer, since) is None else None

    def read_untold(self, record: Record) -> None:
        """The answer to a Read of which the capture cut off what it brought: it is as good as not there (P73)."""
        job, half = record.job, record.response
        assert half is not None
        self._channel(record, half.time_ns)
        if job is not None and not job.over:
            job.untold = half.frame

    def _leave_refused(self, channel: Channel, job: Job | None) -> None:
        """What is read is no response to the refused Write: from now on none is."""
        refused = channel.refused
        if refused is None or refused is job:
            return
        if job is not None and refused.order > job.order:
            job.refused_behind = refused
        self._lose(refused, "")
        channel.refused = None

    def _orphan(self, record: Record, channel: Channel, repeats: int | None) -> Job:
        """A record whose request is not known; `repeats`: the frame in which its bytes were read first."""
        job = Job(record, None, order=self.number())
        job.phase, job.certain, job.previous = "open", not self._pushed_out, channel.written
        job.repeats = repeats
        half = record.response
        assert half is not None
        self._read(channel, job, _read_event(half), record)
        return job

    # What is not in the capture (P73)

    def may_lack(self, peer: Peer, frame: int) -> bool:
        """Whether something that a controller asked of a device may be missing behind a frame."""
        return self._behind(peer, frame) is not None

    def _lacks(self, job: Job, reason: str) -> Missing | None:
        """Why nobody knows whether the response of a job was fetched, or came."""
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
        """Which call of a job, or which half of one, may be missing; PROFIBUS has no calls."""
        if job.peer.station is not None:
            return self._behind(job.peer, asked.frame)
        if job.written_again:
            return Missing("written_again", asked.frame, job.written_again)
        if job.crossed:
            return Missing("crossed", *job.crossed)
        if job.twice:
            return Missing("twice", job.twice)
        if job.untold:
            return Missing("cut_off", job.untold)
        if job.fetching and not job.limit:
            return Missing("read_answer", job.fetching[0].frame)
        found = self._behind(job.peer, asked.frame)
        if found is None and not job.limit and not job.write_told:
            return _unanswered(job, asked)
        return found

    def _ends_soon(self, peer: Peer, asked: Half) -> bool:
        """Whether so little of what the controller sent came behind a request that its Read may still come."""
        newest_ns = self._newest_ns
        if peer.station is None and self._completeness is not None:
            newest_ns = self._completeness.spoke_ns(peer.controller, peer.device)
        return newest_ns is None or newest_ns - asked.time_ns < self._limits.unread_ns

    def _of_another(self, channel: Channel, job: Job, record: Record) -> Missing | None:
        """Why a record, or the refusal of a Read, may be for another Write than that of a job; None: it is not.

        It is not for a Write that is missing where the record mirrors the reference and the program counts it,
        unless such a Write was accepted on this channel: else a filter, too, would leave every request without its
        response. It may be for the same request once more.
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
        if not fits and _is_last(channel, half) and channel.last and channel.last.order > job.order:
            # A device that executes a Read once more has the newest response.
            return Missing("read_answer", read)
        if channel.asked and _may_be_newer(channel, job, record):
            return Missing("later")
        unknown = not (half.data or job.write_told)  # whether its Write was accepted
        since = asked.frame
        if (unknown or job is channel.refused) and half.status != STATUS_SHORT:
            since = self._free_since(job.key, channel, record.request or half)
        found = self._asked_behind(job.peer, channel, since, ordered=fits)
        if found is None and job is channel.refused and half.data and not fits:
            found = self._behind(job.peer, 0)  # what it mirrors may have outlived a Connect
        if unknown and found is not None:  # of its own calls it is at least this one
            behind = self._asked_behind(job.peer, channel, asked.frame, ordered=fits)
            return behind or _unanswered(job, asked)
        if found is None or not half.data or channel.unseen > since:
            return found
        # Of a record that is too short nothing tells.
        sure = fits and _is_of_kind(job, half) is True
        first = found.what == "begins" and (fits if not job.write_refused else sure)
        return None if first or (sure and _counts(job, record)) else found

    def _of_another_on_line(
        self, channel: Channel, job: Job, asked: Half, record: Record
    ) -> Missing | None:
        """The same on PROFIBUS: of the requests of a station nothing is known but what its line shows."""
        half, since = record.response, asked.frame
        assert half is not None
        fits, refused = _mirrors(job, half), job is channel.refused
        if refused:  # what a record brings may have outlived a start-up
            begun = self._started.get(job.peer.device, _NEVER).frame
            sought = record.request or half
            since = channel.ended
            if not half.data and since < begun < sought.frame:
                since = begun
        found = self._asked_behind(job.peer, channel, since)
        if found is None and refused and half.data and not fits:
            found = self._behind(job.peer, 0)
        sure = fits and _is_of_kind(job, half) is True
        return None if sure and _counts(job, record) else found

    def _set_aside(self, channel: Channel, job: Job, missing: Missing) -> None:
        """Nobody knows any more what becomes of a job."""
        if channel.open is job:
            channel.open = None
        elif channel.refused is job:
            channel.refused = None
        else:
            channel.asked.remove(job)
        if job.read_response is None and not job.write_refused:
            job.missing = missing
        self._lose(job, "")

    def _free_since(self, key: ChannelKey, channel: Channel, read: Half) -> int:
        """The frame in which nothing was open on a channel before a Read; 0 where none is known.

        A Connect may be behind it: what is known of an AR that proves itself late is told late.
        """
        connect = self._connects.get(key[:3], _NEVER)
        return max(channel.ended, connect.frame if connect.frame < read.frame else 0)

    def _asked_behind(
        self, peer: Peer, channel: Channel, since: int, *, ordered: bool = False
    ) -> Missing | None:
        """What may be missing behind a frame of what was asked for on a channel; 0: the begin of the capture."""
        if channel.unseen > since:
            return Missing("requests")
        return self._behind(peer, since, ordered=ordered) if since else Missing("begins")

    def _nothing(self, record: Record, channel: Channel, missing: Missing | None) -> None:
        """A Read that brought nothing, where no request is open as far as is known."""
        half = record.response
        assert half is not None
        known = missing is None
        if known and _was_open(channel, record.request):
            return  # its response is behind that to a later Read
        if known:
            missing = self._may_be_open(
                record.peer, record.channel, channel, record.request or half
            )
        self._told.append(("nothing", record, missing))
        if half.status is not None and known:
            channel.pass_over()
            if missing is None:
                channel.ended = half.frame

    def _may_be_open(
        self, peer: Peer, key: ChannelKey, channel: Channel, half: Half
    ) -> Missing | None:
        """What may be missing that is open on a channel where nothing is, as far as the capture shows (P78).

        A program goes on reading behind a Connect what it asked for before.
        """
        since = channel.ended or self._free_since(key, channel, half)
        missing = self._asked_behind(peer, channel, since)
        if missing is None and self._newest_unseen(key) > channel.ended:
            return Missing("requests")
        return missing

    def _newest_unseen(self, key: ChannelKey) -> int:
        """The newest frame in which a Write to a place was accepted, whoever asked, whose request is missing."""
        keys = reversed(self._of_place.get(_spot(key), {}))
        return max(
            (self.channels[each].unseen for each in islice(keys, self._limits.users)), default=0
        )

    def is_again(self, record: Record) -> bool:
        """Whether a ReadImplicit brings the bytes of the last response of its place (P55). Changes nothing."""
        return record.implicit and self._repeated(record) is not None

    def _repeated(self, record: Record) -> Job | None:
        """The last response of a place, where a record has its bytes and came behind it (P22)."""
        delivered, half = self._delivered.get(_spot(record.channel)), record.response
        before = None if delivered is None else delivered.read_response
        if half is None or before is None or half.frame <= before.frame:
            return None
        return delivered if _is_same(before, half) else None

    def _last_response(self, record: Record, channel: Channel) -> Job | None:
        """Whose response a Read without a request may bring once more.

        That of its channel; without an AR that of the place, whoever asked there.
        """
        delivered = self._repeated(record) if record.implicit else None
        if delivered is None or record.response is None:
            return channel.last
        again = delivered.phase == "closed" and _bytes(channel.last) == record.response.data
        return channel.last if again else delivered

    def _reread(self, channel: Channel, job: Job, record: Record) -> None:
        assert record.response is not None
        job.phase = self._table[job.phase]["reread"]
        if not job.rereads and not _was_open(channel, record.request):
            job.between = channel.waiting()
            read = job.read_response.frame if job.read_response else 0
            written = max(channel.written or 0, channel.unasked)
            job.again = "again_unaccepted" if written > read else "again"
            if record.implicit:
                job.again = "again_without_ar"
        self._keep(job.rereads, (record.request, record.response))

    def read_request(self, record: Record) -> None:
        """A Read that asks: for the response of a job, as far as is known before its own."""
        channel, asked = self.channels.get(record.channel), record.request
        if channel is None or asked is None:
            return
        job = record.job = channel.open or channel.waiting() or channel.refused
        if job is not None:
            job.fetching.append(asked)

    def read_over(self, record: Record) -> None:
        """A Read is over, to whichever job its response goes."""
        job, asked = record.job, record.request
        if job is not None and asked in job.fetching:
            job.fetching.remove(asked)

    def read_lost(self, record: Record) -> Job | None:
        """A Read that never got its RPC response."""
        channel, read = self.channels.get(record.channel), record.request
        if channel is None or read is None:
            return None
        job = channel.open or channel.waiting() or channel.refused
        asked = job.write_request if job is not None else None
        if job is None or asked is None or asked.frame > read.frame:
            return None  # what the Read asked for is over: it came before the Write of this one
        if channel.ended > read.frame:
            return None  # the same: another request was open then
        if job.read_request is None:
            job.read_request = read
        return job

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
        """The AR is over: what is open on its channels, or on those of one index, stays unanswered."""
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
        """An AR is set up: requests of the same AR that are open now have lost their connection.

        `only`: a controller has one of this kind with a device. It replaces the one whose Connect came before,
        if nothing is said on that from now on.
        """
        if ar is not None:
            self._put(self._connects, (controller, device, ar), at)
            if only:
                self._replace(controller, device, ar, at)
                self._put(self._connected, (controller, device), ar)
        self._told.append(("connected", device, at.frame))

    def started(self, station: str, at: Moment) -> None:
        """A station of PROFIBUS got its parameters: it may have been switched off before that."""
        self._put(self._started, station, at)
        self._told.append(("connected", station, at.frame))

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
        """Something is said on an AR."""
        self.replaced.pop((controller, device, ar), None)

    def finish(self, newest_ns: int | None = None) -> None:
        """The capture is over, with the time of the newest record call that is ours."""
        self._newest_ns = newest_ns
        while self.channels:
            self._close_channel(next(iter(self.channels)), "end")

    def number(self) -> int:
        """The number of the next transaction, by their beginnings."""
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
        # Once the clock was set back the oldest by its place need not be so by its time.
        self._set_back = self._set_back or now < self._touched_ns
        channel.touched = self._touched_ns = now
        channels.move_to_end(key)
        if now >= self._due_ns or self._set_back:
            self._make_room(now)
        return channel

    def _make_room(self, now: int) -> None:
        """Closes the channels of which nothing was heard for long, and the oldest of too many."""
        channels, expiry = self.channels, self._limits.transaction_expiry_ns
        while len(channels) > 1:
            key, oldest = next(iter(channels.items()))
            old = now - oldest.touched > expiry
            if not old and len(channels) <= self._limits.channels:
                break
            self._close_channel(key, "expired", limit="" if old else "channels")
        self._due_ns = next(iter(channels.values())).touched + expiry

    def _accept(self, channel: Channel, job: Job) -> None:
        """An accepted Write opens; it displaces what was open and ends the grace of a refused one."""
        channel.accepted = max(channel.accepted, job.order)
        if job.phase == "asked":
            channel.asked.remove(job)
            if channel.asked and job.write_told:
                _written_again(channel, job)
            if channel.open is not None:
                self._displace(channel, channel.open, job)
            if channel.refused is not None:
                self._lose(channel.refused, "")
                channel.refused = None
            channel.open = job
        job.phase = self._table[job.phase]["write_accepted"]

    def _displace(self, channel: Channel, job: Job, by: Job) -> None:
        """An accepted Write displaces a request without its response; whose response may be missing, too.

        A Read that was sent behind that Write is for it. Behind a Connect it displaces nothing: the AR is new.
        """
        asked = by.record.request
        if asked is not None:
            job.fetching = [read for read in job.fetching if read.frame < asked.frame]
        self._refused_at_last(job)
        if job.read_response is not None or self._connected_since(job, asked) is not None:
            self._lose(job, _may_be_displaced(channel).get(job.order, "release"))
            return
        job.missing = self._lacks(job, "")
        if job.missing is None:
            job.superseded_by = asked.frame if asked is not None else None
            job.superseding = by
        self._end(job, "displaced")

    def _presume(self, channel: Channel, job: Job) -> None:
        """What is read proves that a Write was accepted; its response is missing in the capture.

        It displaces no newer one: the record of an older request came late.
        """
        if channel.open is not None and channel.open.order > job.order:
            channel.asked.remove(job)
            job.phase = self._table[job.phase]["write_accepted"]
        else:
            self._accept(channel, job)

    def _held(self, job: Job) -> Job | None:
        """The newest request that is open at the place of another one, as far as the capture shows, whoever asked.

        Not one that a Connect of its AR ended. What comes later changes nothing.
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
        """The request that is open where another one came, if it surely is; or if it came behind that.

        It was accepted, no Read that is under way fetches its response, and nothing is missing behind it of what
        either of the two asked.
        """
        asked, came = found.write_request, job.write_request
        if not (asked and came):
            return None
        if any(self._behind(peer, asked.frame) is not None for peer in (found.peer, job.peer)):
            return None
        fetched = any(read.frame < came.frame for read in found.fetching)
        sure = found.write_told and not (fetched or found.twice)
        return found if sure or asked.frame > came.frame else None

    def _refuse(self, channel: Channel, job: Job) -> None:
        before = job.phase
        half = job.write_response
        if half is not None and half.status == STATUS_IN_USE:
            held = self._held(job)
            job.rival = held and self._rival(held, job)
            asked = job.write_request or half
            free = held is None and channel.ended < asked.frame
            job.alone = free and self._may_be_open(job.peer, job.key, channel, asked) is None
        job.phase = self._table[job.phase]["write_refused"]
        if before == "answered":
            return
        if before == "asked":
            channel.asked.remove(job)
        else:
            channel.open = None
        if channel.refused is not None:
            self._lose(channel.refused, "")
        channel.refused = job

    def _addressee(self, channel: Channel, event: str, record: Record) -> Job | None:
        """The job a Read answers; a Write whose response was not seen counts when the answer fits."""
        data = record.response.data if record.response else b""
        opened, reference = channel.open, data[0] if data else None
        if event == "read_record" and (opened is None or opened.reference != reference):
            mirrored = [
                job for job in reversed(channel.asked)
                if job.reference == reference
                and not (job.passed or _is_later(job, record))
                and _may_be(channel, job, record.response)
            ]  # fmt: skip
            half = record.response
            if (
                mirrored and half is not None
            ):  # of several the newest that it may be for by its kind
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
        """The same, where a request was refused: one that may be over is set aside."""
        half, over = record.response, _wrote_behind(channel, found, record)
        if over is None:
            return found
        self._set_aside(channel, found, over)
        self._forget_last(channel)  # the missing one is newer
        job = self._addressee(channel, event, record)
        strange = job is not None and half is not None and half.data and not _mirrors(job, half)
        return None if strange else job  # it may be that of the other one all the same

    def _read(self, channel: Channel, job: Job, event: str, record: Record) -> None:
        half, told, sent = record.response, job.write_response, record.request
        assert half is not None
        if told is not None and sent is not None and sent.frame < told.frame:
            job.hasty = self._waits(job.peer)
        if event == "read_record" and job.phase == "refused":
            self._compare(channel.last, job, half)
        if job.phase == "asked" and event == "read_cut":
            channel.asked.remove(job)  # accepted or not: its STATUS is cut off, too
            channel.accepted = max(channel.accepted, job.order)  # no older one waits any more
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
        """A Read that ends the waiting of a job: with the record, or with a refusal."""
        job.read_request, job.read_response = read, half
        job.read_before = bool(job.polls or job.fetching) and self._may_be_read(job)
        if job.message is not None:  # before an orphan anything may be missing
            channel.ended = half.frame
            if half.cut and _is_headless(half) and not job.write_refused:
                job.missing = Missing("cut_off", half.frame)
        if channel.open is job:
            channel.open = None
        if channel.refused is job:
            channel.refused = None
        self._told.append(("answered", job, None))
        if not half.data:
            self._lose(job, "")
            if not job.write_refused:
                self._forget_last(channel)  # what is read from now on may be of either
            return
        if channel.last is not None:
            self._end(channel.last)
        channel.last = job
        if job.message is not None and not job.write_refused:
            self._put(self._delivered, channel.spot, job)

    def _may_be_read(self, job: Job) -> bool:
        """Whether how long a request waited is not known: a Read that brought its record may be missing.

        So may the same request once more: then it is that one which waited.
        """
        asked = job.write_request
        if asked is None:
            return False
        return bool(job.fetching) or self._behind(job.peer, asked.frame) is not None

    def _compare(self, last: Job | None, job: Job, half: Half) -> None:
        """Whether a request that was refused is answered as the last one was.

        Of a Write without a Write response nothing follows: two questions may have the same answer.
        """
        if last is None or last.read_response is None or not _is_same(last.read_response, half):
            return
        if self._behind(job.peer, last.read_response.frame) is None:
            job.repeats = last.read_response.frame

    def _keep(self, reads: list[_T], read: _T) -> None:
        """The reads of one transaction: of more than `Limits.reads` the first and the newest are kept."""
        if len(reads) >= self._limits.reads:
            reads.pop()
        reads.append(read)

    def _lose(self, job: Job, reason: str) -> None:
        """Nothing more comes of a job."""
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
        """Where a Read was too short for a response, and none brought it, that refusal is the end (P34)."""
        short, asked = job.too_short if job.read_response is None else None, job.write_request
        if not short or asked is None:
            return
        lacks = self._lacks_calls(job, asked)
        if lacks is None or lacks.what == "write_answer":  # else it may have been read
            job.polls.remove(short[-1])
            job.read_request, job.read_response = short[-1]

    def _connected_since(self, job: Job, before: Half | None = None) -> Moment | None:
        """When the AR of a request was set up anew; None where it was not, or not `before` another one.

        Of an AR that proves itself late the Connects are known first.
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
        self._told.append(("closed", job, None))

    def _push_out(self, job: Job, limit: str) -> None:
        """Nothing more is known of a job from now on, and not because nothing came."""
        if job.read_response is None and not job.write_refused:
            job.limit, self._pushed_out = limit, True
        self._lose(job, "")

    def _close_channel(
        self, key: ChannelKey, reason: str, at: Moment | None = None, limit: str = ""
    ) -> None:
        _take_out(self._of_ar, key[:3], key)
        _take_out(self._of_place, _spot(key), key)
        channel = self.channels.pop(key)
        why = _at_the_end(channel) if reason == "end" else _may_be_displaced(channel)
        for job in channel.jobs():
            if limit:
                self._push_out(job, limit)
                continue
            job.ended = at and at.frame
            self._lose(job, why.get(job.order, reason))
        if key[:3] not in self._of_ar:
            self.replaced.pop(key[:3], None)


def _nothing_behind(peer: Peer, since: int, *, ordered: bool = False) -> Missing | None:
    """What may be missing where nobody tells what is."""
    return None


def _unanswered(job: Job, asked: Half) -> Missing:
    """That nobody knows what a Write was answered."""
    half = job.write_response
    return Missing("write_answer", asked.frame) if half is None else Missing("cut_off", half.frame)


def _written_again(channel: Channel, job: Job) -> None:
    """An accepted Write takes the place of those that asked for the same and have no response."""
    by = job.write_request
    for each in channel.asked:
        before = each.write_request
        if each.order < job.order and before and by and before.data == by.data:
            each.written_again = by.frame


def _cross(channel: Channel, job: Job) -> bool:
    """Whether a later Write is open already: which of them the device did last nobody knows (P27)."""
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
    """Where a record is, whoever asks for it."""
    return (key[1], *key[3:])


def _take_out(index: dict[_K, dict[ChannelKey, None]], name: _K, key: ChannelKey) -> None:
    """A channel is closed: it goes out of an index of channels."""
    keys = index[name]
    del keys[key]
    if not keys:
        del index[name]


def _at_the_end(channel: Channel) -> dict[int, str]:
    """`Job.order` -> why a job has no response, where its channel went on before the capture ended."""
    newest = channel.asked[-1] if channel.asked else None
    why = {job.order: "unseen" for job in channel.asked if job is not newest}
    if newest is None:
        return why
    asked = newest.record.request
    if newest.order < channel.accepted or (asked is not None and channel.heard > asked.frame):
        why[newest.order] = "unseen"
    return why | _may_be_displaced(channel)


def _may_be_displaced(channel: Channel) -> dict[int, str]:
    """The same of an accepted request before a Write without its response, which may have displaced it."""
    held, newest = channel.open, channel.asked[-1] if channel.asked else None
    if held is None or newest is None or held.order > newest.order:
        return {}
    return {held.order: "later"}


def _by_kind(channel: Channel, opened: Job, record: Record) -> Job:
    """Whose record it is where its reference does not tell: of the open request or of a newer Write (P71, P72).

    Its kind tells, where it fits such a Write and not the open request. Where it does not tell the reverse either,
    the newer Writes are contested.
    """
    read, half = record.request, record.response
    assert half is not None
    mirrored = opened.reference == half.data[0]
    if not mirrored and _is_last(channel, half):
        return opened  # an old answer
    newer = [
        job for job in reversed(channel.asked)
        if job.order > opened.order and not job.passed and (job.reference == half.data[0]) is mirrored
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
    """Whether the Write of a job was sent behind the request of a Read: in the file, and by the clock."""
    asked, read = job.write_request, record.request
    if asked is None or read is None:
        return False
    return asked.frame > read.frame and asked.time_ns >= read.time_ns


def _mirrors(job: Job, half: Half) -> bool:
    """Whether a record has the reference and the kind of a request."""
    data, message = half.data, job.message
    if not data or job.reference != data[0]:
        return False
    return message is None or kind_fits(message, data) is not False


def _counts(job: Job, record: Record) -> bool:
    """Whether a program counts its references, as far as is known: one more than before, or two past 0.

    Of the first one on a channel it may, if another channel had not the same one last, and a capture that has
    only what somebody chose has no other. Whoever chooses takes whole calls.
    """
    before, now = job.previous_reference, job.reference
    if before is None:
        reads = [record.request, *(read for read, _ in job.polls)]
        halves = bool(job.fetching) or None in reads
        return job.previous is None and not (halves or job.write_refused or job.uncounted)
    return now is not None and (now - before) % 256 in (1, 2)


def _was_open(channel: Channel, read: Half | None) -> bool:
    """Whether a Read was sent before the response to the last request that was answered."""
    last = channel.last
    if read is None or last is None or last.read_response is None:
        return False
    return read.frame < last.read_response.frame and read.time_ns < last.read_response.time_ns


def _wrote_behind(channel: Channel, job: Job, record: Record) -> Missing | None:
    """The last Read of a job without its answer, if a Write behind it was refused: it may have ended the job.

    A record that mirrors the request, and not the refused one, shows that it did not.
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
    """Whether a Read may be for a Write without its response that is newer than the one of a job."""
    half = record.response
    assert half is not None
    strange = not half.data or _is_of_kind(job, half) is False
    strange = strange or (job.reference != half.data[0] and _is_last(channel, half))
    return any(
        each.order > job.order
        and not (each.passed or _is_later(each, record))
        and (strange or _mirrors(each, half))
        for each in channel.asked
    )


def _may_be(channel: Channel, job: Job, half: Half | None) -> bool:
    """Whether a record may be for the Write that it mirrors.

    For one before an accepted one only by its kind, and where it is not the last one once more.
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
    """Whether a record came of which the capture cut off even what kind of response it is."""
    return not half.status and len(half.data) < _KIND_END


def _is_same(one: Half, other: Half) -> bool:
    """Whether two records have the same bytes; of cut ones the same length, and the same as far as they go."""
    return one.data == other.data and one.missing == other.missing


def _is_last(channel: Channel, half: Half) -> bool:
    """Whether a record is the last one once more, of which less may have been read."""
    before = channel.last.read_response if channel.last else None
    if before is None or not before.data:
        return False
    return _is_same(before, half) if before.cut else half.data.startswith(before.data)


def _bytes(job: Job | None) -> bytes | None:
    return job.read_response.data if job and job.read_response else None
