"""Requests of PKW and what answers them: the words of both directions to transactions (docs/cyclic.md 4).

One channel at a time, fed with what changed in it; times, frames and cycles are arguments. Which bytes of
which frame are a channel, and what is said of a transaction, is not here.

A request stands until it is answered, an answer until the request changes. So an answer counts when it changed
after the request did: the answer to the request before it is still there, and may even be allowed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import floor
from typing import NamedTuple

from ds47.cyclic import pkw
from ds47.spec import cyclic

OK, ERROR, MISMATCH = "ok", "error", "mismatch"
SUPERSEDED, UNANSWERED = "superseded", "unanswered"
INCOMPLETE = "incomplete"
END, IO_LOST, WITHDRAWN = "end", "io-lost", "withdrawn"
"""Why there was no answer: the capture ends, the data was not valid any more, the controller gave up."""
ENDS, _BEHIND = "ends", "cyclic_behind"
"""Why a response may not be in the capture."""
_UNNOTICED = 3
"""So many cycles may be missing, and nothing else shows it (`channels`)."""
_WAITING = 16
"""Transactions that wait for a frame of the drive; it says nothing any more where there are more."""


class CycleMoment(NamedTuple):
    """Where something changed: the frame, its time, and how many cycles its relation had before it."""

    frame: int
    time_ns: int
    cycle: float

    def since(self, earlier: CycleMoment) -> int:
        """Cycles that lie between."""
        return floor(self.cycle - earlier.cycle + 0.5)


class Sight(NamedTuple):
    """Eight bytes, and when they were there first."""

    data: bytes
    at: CycleMoment


class FrameGap(NamedTuple):
    """Frames are missing behind one and before another, or may be.

    `what` is `_BEHIND` where the response is in the first frame of the drive, `last`, behind that in which the
    request ended, and `ENDS` where the capture ends so soon that the response may come behind it.
    """

    first: int | None
    last: int | None
    what: str = "cyclic_frames"


@dataclass(slots=True)
class PkwJob:
    """A request while it lasts, with its answer; None for what did not come.

    `answer` is the one that counted. It is `settled` if no edge showed it: it was there before, so the time that
    the drive took is unknown. `began` is False if the request was there when the capture began. `updates` are
    further values under the same answer. `halves`: the frame in which a part of the request changed before the
    rest. `late`: the frame of an answer to the previous request. `heard`: whether a frame of the drive came during
    the request. `last`: the last frame seen of the request. `hole`: where its response may be missing.
    """

    request: Sight
    standing: Sight | None
    began: bool
    state: str = ""
    reason: str | None = None
    answer: Sight | None = None
    settled: bool = False
    updates: int = 0
    newest: Sight | None = None
    halves: int | None = None
    odd: Sight | None = None
    late: int | None = None
    ended: CycleMoment | None = None
    heard: bool = False
    last: CycleMoment | None = None
    hole: FrameGap | None = None
    moving: bool = field(default=False, repr=False)
    """Whether the answer that stood when it began had been changing."""

    @property
    def is_ignored(self) -> bool:
        """Whether it reads as a request, and a drive that said something did not respond, nor did before."""
        asked, standing = self.request.data, self.standing
        open_ = self.state in (UNANSWERED, SUPERSEDED) and _is_request(asked)
        return self.heard and open_ and not (standing and _fits(asked, standing.data))

    @property
    def ends(self) -> bool:
        """Whether its response may come behind the end of the capture."""
        return self.hole is not None and self.hole.what == ENDS

    @property
    def stood(self) -> int:
        """Cycles from its first frame to the one that ended it, or the last in which it was looked at."""
        last = self.ended or self.last or self.request.at
        return last.since(self.request.at)

    @property
    def cycles(self) -> int | None:
        """From the request to its answer, in frames of one direction; None if no edge showed the answer.

        They are counted by time, so None also if the clock was set back in between.
        """
        if self.answer is None or self.settled or not self.began:
            return None
        count = self.answer.at.since(self.request.at)
        return count if count >= 0 else None

    @property
    def duration_ns(self) -> int | None:
        """From the first frame of the request to the first of its answer; None if no edge showed the answer."""
        if self.answer is None or self.settled or not self.began:
            return None
        return self.answer.at.time_ns - self.request.at.time_ns

    @property
    def reaction_ns(self) -> int | None:
        """The same of the drive; None where frames are missing right before its answer."""
        return None if self.hole is not None and not self.ends else self.duration_ns


class PkwChannel:
    """The requests and answers of one PKW channel.

    Args:
        closed: called with each transaction when its request ends, and of one without an answer the first frame
            of the drive behind that is known.
        fresh: whether nothing was asked before the first words: they are those after a start-up.
    """

    def __init__(self, closed: Callable[[PkwJob], None], fresh: bool = False) -> None:
        self._closed = closed
        self._fresh = fresh
        self._out: Sight | None = None
        self._in: Sight | None = None
        self._job: PkwJob | None = None
        self._before: PkwJob | None = None
        self._slowest_ns = 0
        """What the slowest response took."""
        self._newest = 0
        """The newest frame of the drive."""
        self._over: list[PkwJob] = []
        """Those that wait for the next frame of the drive, in order."""
        self._previous = b""
        """What was sent before the request that is open."""
        self._echoes = True
        """Whether the answer to a change has its value: some drives answer with 0."""

    def sent(self, data: bytes, at: CycleMoment) -> bool:
        """The controller sends these eight bytes from now on; whether they are others than before."""
        data, last = _without_spm(data), self._out
        if last is not None and last.data == data:
            if self._job is not None:
                self._job.last = at
            return False
        self._out = Sight(data, at)
        if self._is_second_half(data, at):
            return True
        self._previous = b"" if last is None else last.data
        job = self._job
        odd = None if job is None or job.odd is not self._in else job.odd
        if job and odd and _ak(data) and _fits(data, odd.data) and at.since(odd.at) <= _UNNOTICED:
            # This was sent before the answer to it.
            job.hole = FrameGap(job.request.at.frame, at.frame)
        self._end(at, withdrawn=not _ak(data))
        if _ak(data):
            moving = self._before is not None and self._before.updates > 0
            began = last is not None or self._fresh
            self._job = PkwJob(self._out, self._in, began, moving=moving)
        self._fresh = False
        return True

    def answered(self, data: bytes, at: CycleMoment) -> None:
        """The drive sends these eight bytes from now on."""
        data, last, before, self._newest = _without_spm(data), self._in, self._newest, at.frame
        if self._over:
            is_new = _ak(data) and (last is None or last.data != data)
            self._tell(Sight(data, at) if is_new else None)
        if last is not None and last.data == data:
            return
        self._in = Sight(data, at)
        job = self._job
        if job is None or not _ak(data):
            return
        if job.answer is not None:
            self._update(job, self._in)
        elif self._counts(job, data):
            job.answer = self._in
            self._slowest_ns = max(self._slowest_ns, at.time_ns - job.request.at.time_ns)
            if job.hole is not None and job.hole.last is not None and before >= job.hole.last:
                job.hole = None  # it did not stand there yet
            changed = _access(job.request.data) == "change" and any(job.request.data[4:])
            self._echoes = self._echoes and (not changed or any(data[4:]))
        elif self._is_late(data):
            job.late = at.frame
        elif not _fits(job.request.data, data):
            job.odd = job.odd or self._in

    def skipped(self, first: int, last: int, seen_ns: int = 0) -> None:
        """Frames of the channel are missing between two; call it before `answered` for the latter.

        `seen_ns`: of a request that ended earlier a frame of the drive was seen behind its end.
        """
        hole, job = FrameGap(first, last), self._job
        for each in self._over:
            if each.ended is None or each.ended.time_ns >= seen_ns:
                each.hole = hole
        if job is not None and job.answer is None and job.request.at.frame <= first:
            job.hole = hole

    def lost(self, at: CycleMoment, *, out: bool = True, answers: bool = True) -> None:
        """Data is not valid from now on: what is open stays without an answer, and nobody is to blame.

        `out`: that of the controller, `answers`: that of the drive. What the other one says stands as before.
        """
        job = self._job
        if job is not None and job.answer is None:
            self._close(job, UNANSWERED, IO_LOST, at)
        elif job is not None:
            self._settle(job, at, END)
        self._tell(None)
        self._job, self._fresh = None, False
        self._out = None if out else self._out
        self._in = None if answers else self._in

    def finish(self, within_ns: int | None = None) -> None:
        """Nothing more comes.

        `within_ns`: the capture ends; to what was asked so shortly before, or no longer than the slowest response
        took, one may come.
        """
        job = self._job
        if job is not None:
            stood_ns = (job.last or job.request.at).time_ns - job.request.at.time_ns
            if within_ns is not None and stood_ns <= max(within_ns, self._slowest_ns):
                job.hole = job.hole or FrameGap(None, None, ENDS)
            self._settle(job, None, END)
            self._job = None
        self._tell(None)

    def _end(self, at: CycleMoment, withdrawn: bool) -> None:
        if self._job is not None:
            self._settle(self._job, at, WITHDRAWN if withdrawn else None)
            self._before, self._job = self._job, None

    def _settle(self, job: PkwJob, at: CycleMoment | None, reason: str | None) -> None:
        """The state of a transaction at the end of its request.

        `reason` says why there is no answer, None: another request came.
        """
        if job.answer is None and self._in is not None and self._stands(job, self._in.data):
            job.answer, job.settled = self._in, True
        if job.answer is not None:
            self._close(job, ERROR if _is_refusal(job.answer.data) else OK, None, at)
        elif job.odd is not None:
            self._close(job, MISMATCH, None, at)
        elif reason is None:
            self._close(job, SUPERSEDED, None, at)
        else:
            self._close(job, UNANSWERED, reason, at)

    def _close(self, job: PkwJob, state: str, reason: str | None, at: CycleMoment | None) -> None:
        job.state, job.reason, job.ended = state, reason, at
        job.heard = self._in is not None and self._newest >= job.request.at.frame
        hole, seen = job.hole, job.last
        if job.answer is None and hole and hole.last and seen and seen.frame > hole.last:
            job.hole = None  # it stood there still, without a response
        self._over.append(job)
        if (job.answer is not None and len(self._over) == 1) or len(self._over) > _WAITING:
            self._tell(None)

    def _tell(self, behind: Sight | None) -> None:
        """Tells of those that are over; `behind`: the first frame behind them, where it says something new.

        A response that stands there may have stood in one before, which is missing.
        """
        over, self._over = self._over, []
        for job in over:
            if job.answer is None and job.reason != IO_LOST:
                if (
                    behind is not None
                    and job.ended is not None
                    and _fits(job.request.data, behind.data)
                ):
                    job.hole = job.hole or FrameGap(job.ended.frame, behind.at.frame, _BEHIND)
                if job.hole is not None:
                    job.state = INCOMPLETE
            self._closed(job)

    def _is_second_half(self, data: bytes, at: CycleMoment) -> bool:
        """Whether a request goes on that was begun a cycle ago: first the parameter changed, then the value.

        Or the value first.
        """
        job, old = self._job, self._previous
        if job is None or job.answer is not None or not old or _access(data) != "change":
            return False
        first, cycles = job.request.data, at.since(job.request.at)
        parameter_first = first[4:] == old[4:] and first[:4] == data[:4]
        value_first = first[:4] == old[:4] and first[4:] == data[4:]
        if cycles > 1 or not (parameter_first or value_first):
            return False
        job.halves, job.request = job.request.at.frame, Sight(data, job.request.at)
        return True

    def _counts(self, job: PkwJob, data: bytes) -> bool:
        """Whether a changed answer is that of the open request, and not one before it that moved."""
        asked, standing = job.request.data, job.standing
        if not _fits(asked, data):
            return False
        if _access(asked) != "change" or _is_refusal(data) or data[4:] == asked[4:]:
            return True
        if job.moving and standing is not None and standing.data[:4] == data[:4]:
            return False  # the value that was read goes on moving
        # If late, the read before it was not answered: this is what it asked for.
        return not self._is_late(data)

    def _stands(self, job: PkwJob, data: bytes) -> bool:
        """Whether the answer at the end of a request may be its own, though no edge showed it."""
        if not _fits(job.request.data, data) or _is_refusal(data):
            return False
        if _access(job.request.data) != "change" or job.moving or not self._echoes:
            return True
        return data[4:] == job.request.data[4:]

    def _is_late(self, data: bytes) -> bool:
        before = self._before
        return before is not None and before.answer is None and _fits(before.request.data, data)

    def _update(self, job: PkwJob, seen: Sight) -> None:
        """The drive repeats an answer with the value of the moment."""
        assert job.answer is not None
        if seen.data[:4] == job.answer.data[:4]:
            job.updates += 1
            job.newest = seen


def _is_request(data: bytes) -> bool:
    """Whether words read as a request: AK, page and number are some that exist, and a read has no value."""
    access, no_page = _access(data), data[2] & 0x03 and data[3] & 0x03
    if access not in ("read", "change", "count") or no_page or not _number(data):
        return False
    return access == "change" or not any(data[4:])


def _fits(asked: bytes, data: bytes) -> bool:
    """Whether an answer may be that of a request: its AK is allowed, and it names the same parameter."""
    answer = _ak(data)
    if _is_refusal(data):
        if answer == pkw.NO_RIGHTS and _access(asked) not in ("change", "text"):
            return False
        if not _number(data):  # Danfoss answers without the parameter
            return True
    elif answer not in cyclic.requests()[_ak(asked)].answers:
        return False
    return _number(asked) == _number(data) and asked[2:4] == data[2:4]


def _is_refusal(data: bytes) -> bool:
    return _ak(data) in (pkw.ERROR, pkw.NO_RIGHTS)


def _without_spm(data: bytes) -> bytes:
    """The bytes without the toggle bit of spontaneous messages, which belongs to no request."""
    return bytes((data[0] & 0xF7,)) + data[1:8]


def _ak(data: bytes) -> int:
    return data[0] >> 4


def _number(data: bytes) -> int:
    """The parameter number on its page."""
    return int.from_bytes(data[:2]) & 0x07FF


def _access(data: bytes) -> str:
    return cyclic.requests()[_ak(data)].access
