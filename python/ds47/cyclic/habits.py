"""Judgement: how a program uses the PKW of one drive, to findings DS507 to DS511 (docs/cyclic.md 5).

What one request alone does not show. Whether anybody wants to know is decided elsewhere, as in `judge`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ds47.cyclic import pkw
from ds47.cyclic.handshake import PkwJob
from ds47.findings.remark import Remark
from ds47.spec import cyclic
from ds47.spec.semantics import Limits

_WRONG_TYPE = 5
"""Error number of PKW."""
_OTHER = {pkw.CYCLIC: pkw.USS, pkw.USS: pkw.CYCLIC}

_Which = tuple[int | None, int]
"""A parameter: its number and subindex."""


@dataclass(slots=True)
class Habits:
    """The remembered requests of one relation.

    Args:
        where: arguments of findings about the drive: the device, its slot and its family of parameters.
        bounds: how much is too much.
        layout: of IND.
    """

    where: dict[str, Any]
    bounds: Limits
    layout: str
    _double: dict[_Which, int] = field(default_factory=dict)
    """Parameters that were answered as double words, and the frame."""
    _saved: Counter[_Which] = field(default_factory=Counter)
    _reads: Counter[_Which] = field(default_factory=Counter)
    _newest: dict[tuple[str, _Which], int] = field(default_factory=dict)
    """Frame of the newest change that saves ("saved"), and of the newest read ("read")."""
    _slow: int = 0
    _slowest: tuple[int, int] = (0, 0)
    """Nanoseconds and frame."""
    _strange: int = 0
    _strange_at: int = 0
    """Requests with a page that does not exist, and the frame of the first one."""
    _unreadable: bool = False
    """Whether the other layout would not do either."""

    def take(self, job: PkwJob) -> Iterator[Remark]:
        """A transaction that is over, and what is wrong with it."""
        asked = pkw.decode(job.request.data, answer=False, layout=self.layout)
        row = cyclic.requests()[asked.ak]
        which, frame = (asked.pnu, asked.subindex), job.request.at.frame
        self._page(job.request.data, frame, asked.fits_layout)
        if row.eeprom and self._has_room("saved", which):
            self._saved[which] += 1
            self._newest["saved", which] = frame
        elif row.access == "read" and self._has_room("read", which):
            self._reads[which] += 1
            self._newest["read", which] = frame
        if job.answer is None:
            return
        self._time(job.reaction_ns, job.answer.at.frame)
        answer = pkw.decode(job.answer.data, answer=True, layout=self.layout)
        width = cyclic.answers()[answer.ak].width
        if row.access == "read" and width == 32 and which in self._reads:
            self._double[which] = job.answer.at.frame
        wrong = answer.error is not None and answer.error.code == _WRONG_TYPE
        if row.access == "change" and row.width == 16 and wrong and which in self._double:
            args = {"pnu": asked.pnu, "subindex": asked.subindex, "read": self._double[which]}
            yield Remark("DS507", job.answer.at.frame, self.where | args)

    def _has_room(self, kind: str, which: _Which) -> bool:
        return (kind, which) in self._newest or len(self._newest) < self.bounds.written_values

    def _page(self, data: bytes, frame: int, fits: bool) -> None:
        other = pkw.decode(data, answer=False, layout=_OTHER[self.layout])
        self._unreadable = self._unreadable or not other.fits_layout
        if not fits:
            self._strange += 1
            self._strange_at = self._strange_at or frame

    def _time(self, took_ns: int | None, frame: int) -> None:
        if took_ns is not None and took_ns > self.bounds.pkw_slow_ns:
            self._slow += 1
            self._slowest = max(self._slowest, (took_ns, frame))

    def finish(self) -> Iterator[Remark]:
        """What the whole capture shows."""
        bounds = self.bounds
        for which, count in self._saved.items():
            if count > bounds.pkw_saved:
                yield self._often("DS508", "saved", which, count, bounds.pkw_saved)
        for which, count in self._reads.most_common(1):
            if count > bounds.pkw_reads:
                yield self._often("DS509", "read", which, count, bounds.pkw_reads)
        if self._strange and not self._unreadable:
            layouts = {"layout": self.layout, "other": _OTHER[self.layout]}
            args = self.where | {"count": self._strange} | layouts
            yield Remark("DS510", self._strange_at, args)
        if self._slow:
            slowest, frame = self._slowest
            times = {"limit": bounds.pkw_slow_ns / 1e6, "slowest": slowest / 1e6}
            yield Remark("DS511", frame, self.where | {"count": self._slow} | times)

    def _often(self, rule: str, kind: str, which: _Which, count: int, limit: int) -> Remark:
        about = {"pnu": which[0], "subindex": which[1], "count": count, "limit": limit}
        return Remark(rule, self._newest[kind, which], self.where | about)
