"""Judgement: a transaction of PKW to findings DS5xx (spec/rules.toml has the catalogue).

What is wrong with one request and its response. The tables are those of one maker; of drives of others only what
the profile says is said (docs/cyclic.md 5).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ds47.cyclic import handshake, pkw
from ds47.cyclic.handshake import PkwJob
from ds47.cyclic.relations import CyclicRelation
from ds47.findings.remark import Remark
from ds47.spec import cyclic


def remarks(relation: CyclicRelation, job: PkwJob, layout: str = pkw.CYCLIC) -> Iterator[Remark]:
    """What is wrong with a transaction that is over."""
    asked, which = _which(relation, job, layout)
    yield from _request(job, asked, which)
    if job.answer is not None:
        yield from _response(relation, job.answer, which, layout)
    elif job.state == handshake.INCOMPLETE and job.hole is not None:
        yield Remark("DS110", job.request.at.frame, job.hole._asdict())
    elif job.state == handshake.MISMATCH and job.odd is not None:
        words = {"request": _words(job.request.data), "response": _words(job.odd.data)}
        yield Remark("DS505", job.odd.at.frame, words)
    elif not job.heard:
        return  # the capture has nothing of the drive
    elif job.state == handshake.SUPERSEDED and job.ended is not None:
        frames = {"request": job.request.at.frame, "by": job.ended.frame}
        yield Remark("DS504", job.ended.frame, which | frames)
    elif job.reason == handshake.WITHDRAWN and job.ended is not None:
        stood_ns = job.ended.time_ns - job.request.at.time_ns
        if stood_ns >= 0:  # else the clock was set in between: the time is unknown
            yield Remark("DS503", job.ended.frame, which | {"milliseconds": stood_ns / 1e6})


def unanswered(relation: CyclicRelation, job: PkwJob, layout: str = pkw.CYCLIC) -> Iterator[Remark]:
    """What reads as a request has no response: nothing proves that it is one, or it stands to the end."""
    last = job.ended or job.last or job.request.at
    stood_ns = last.time_ns - job.request.at.time_ns
    if stood_ns >= 0:  # else the clock was set in between
        which = _which(relation, job, layout)[1]
        yield Remark("DS514", job.request.at.frame, which | {"milliseconds": stood_ns / 1e6})


def _which(
    relation: CyclicRelation, job: PkwJob, layout: str
) -> tuple[pkw.PkwMessage, dict[str, Any]]:
    """The request, and the arguments that name its parameter."""
    asked = pkw.decode(job.request.data, answer=False, layout=layout)
    return asked, {"pnu": asked.pnu, "subindex": asked.subindex, "family": relation.drives}


def _request(job: PkwJob, asked: pkw.PkwMessage, which: dict[str, Any]) -> Iterator[Remark]:
    row = cyclic.requests()[asked.ak]
    if job.halves is not None:
        yield Remark("DS506", job.halves, which)
    if row.access == "change" and row.width == 16 and asked.pwe1:
        yield Remark("DS513", job.request.at.frame, which | {"pwe": asked.pwe1})


def _response(
    relation: CyclicRelation, answer: handshake.Sight, which: dict[str, Any], layout: str
) -> Iterator[Remark]:
    decoded = pkw.decode(answer.data, answer=True, layout=layout)
    if decoded.ak == pkw.ERROR and decoded.error is not None:
        args = {"code": decoded.error.code, "vendor_id": relation.vendor_id}
        yield Remark("DS501", answer.at.frame, which | args)
    elif decoded.ak == pkw.NO_RIGHTS:
        yield Remark("DS502", answer.at.frame, which)


def _words(data: bytes) -> str:
    """Four words as manuals print them: 143A 0000 0000 0000."""
    return data.hex(" ", 2).upper()
