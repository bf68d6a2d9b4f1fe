"""Diagnoses of the order of frames: too early, too late, twice, somebody else's (DS702, 704, 705, 722).

Each function looks at one closed job, with what pairing learnt of its neighbours. Nothing is decoded here.
"""

from __future__ import annotations

from collections.abc import Iterator

from ds47.acyclic.pairing import STATUS_IN_USE, Job
from ds47.findings.remark import Remark
from ds47.profinet.records import NIL_UUID, Half
from ds47.spec.units import uuid_text


def of(job: Job) -> Iterator[Remark]:
    """What the order of its frames says of a closed job."""
    asked, answer, read = job.write_request, job.write_response, job.read_request
    if job.polls:
        read = next((request for request, _ in job.polls if request is not None), read)
    if answer is not None and read is not None and read.frame < answer.frame:
        yield from _read_too_early(job, read, answer)
    if job.repeats is not None or job.rereads:
        yield from _old_answer(job)
    if asked is None:
        return
    if job.superseding is not None:
        yield from _displaced(job, asked)
    if answer is not None and answer.status == STATUS_IN_USE:
        yield from _turned_away(job, asked)
    if job.ended is not None:
        yield from _connection_lost(job, asked)


def _read_too_early(job: Job, read: Half, answer: Half) -> Iterator[Remark]:
    asked = job.record.request
    begin_ns = 0 if asked is None else asked.time_ns  # before that the times say another order
    if answer.status == 0 and not job.hasty and begin_ns <= read.time_ns <= answer.time_ns:
        yield Remark("DS702", read.frame, {"frame": read.frame, "by": answer.frame})


def _old_answer(job: Job) -> Iterator[Remark]:
    read = job.read_response
    if read is not None and job.repeats is not None:
        refused = job.write_request
        case = "again_without_ar" if refused is None else "again_after_refusal"
        yield _again(case, read.frame, job.repeats, refused.frame if refused else None)
    unseen = job.between is not None and not job.between.write_told
    if read is not None and job.reread_cause and not unseen:
        yield _again(job.reread_cause, job.rereads[0][1].frame, read.frame)


def _again(case: str, frame: int, first: int, write: int | None = None) -> Remark:
    """`write` is the frame of the Write that was refused between the two Reads."""
    args = {"case": case, "frame": frame, "first": first, "write": write}
    return Remark("DS704", frame, args)


def _displaced(job: Job, asked: Half) -> Iterator[Remark]:
    """A read that is displaced by another request.

    A change that is displaced says nothing: many programs never read what a change is answered. Nor does
    the same question asked again: that is one user who does not wait.
    """
    later = None if job.contested else job.superseding
    if later is not None and job.message is not None and job.message.operation == "read":
        other = later.write_request
        if other is not None and other.data[1:] != asked.data[1:]:
            yield _clash(job, later, asked.frame, other.frame)


def _turned_away(job: Job, asked: Half) -> Iterator[Remark]:
    """A Write that is turned away while another request is open."""
    rival = job.rival
    held = rival.write_request if rival else None
    if held is not None and held.frame > asked.frame:
        return  # the two crossed: it was not open yet when this one was sent
    if held is None and not job.alone:
        return  # what was open may be missing in the capture
    yield _clash(rival, job, held.frame if held else None, asked.frame)


def _clash(held: Job | None, came: Job, first: int | None, frame: int) -> Remark:
    args = {
        "case": _case(held, came),
        "controller": came.peer.controller,
        "ar": _ar(came),
        "frame": frame,
        "other": held.peer.controller if held else None,
        "other_ar": _ar(held) if held else None,
        "first": first,
    }
    return Remark("DS705", frame, args)


def _ar(job: Job) -> str | None:
    """The AR of a request; None on PROFIBUS, which has none."""
    ar = job.key[2]
    return None if ar == NIL_UUID else uuid_text(ar)


def _case(held: Job | None, came: Job) -> str:
    """Who the two are, as far as the capture shows it."""
    if held is None:
        return "unseen_user"
    if held.peer.controller != came.peer.controller:
        return "two_stations"
    return "one_station" if held.key[2] == came.key[2] else "two_ars"


def _connection_lost(job: Job, asked: Half) -> Iterator[Remark]:
    """What was to be read, or was waited for; of a change many programs never read the answer."""
    message = job.message
    if job.missing is not None or job.contested:
        return
    if job.read_response is not None or job.write_refused:
        return
    waited = bool(job.polls or job.empty_reads or job.read_request)
    if not waited and (message is None or message.operation != "read"):
        return
    yield Remark("DS722", asked.frame, {"frame": job.ended})
