"""The analysis that hands out at once: a transaction when it has its response, a finding when it is found.

What may still come for a transaction that was shown (it is read again, the Write response is late) is
shown when it is over: `Listener.changed`. All else is as in `ds47.analysis`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ds47.analysis import AnalysisOptions, _Analysis
from ds47.capture import Capture
from ds47.findings import Findings
from ds47.model import CaptureResult, Finding, Transaction
from ds47.pairing import Job, Pairing, Peer
from ds47.profinet.records import Half, Record
from ds47.rules import Remark
from ds47.spec.semantics import Limits, limits
from ds47.transactions import build


class Listener(Protocol):
    """Who wants to know."""

    def finished(self, transaction: Transaction, findings: list[Finding]) -> None:
        """A transaction has its response, or will never have one; what was found about it so far."""

    def changed(
        self, before: Transaction, transaction: Transaction, findings: list[Finding]
    ) -> None:
        """Something came for one that was shown; all that was found about it."""

    def found(self, finding: Finding) -> None:
        """A finding that came for a transaction that was shown, or belongs to none."""


class Live(_Analysis):
    """One analysis of a capture that goes on and on."""

    def __init__(self, options: AnalysisOptions, listener: Listener) -> None:
        super().__init__(options, self._over)
        self._listener = listener
        self._findings = _Immediate(options, listener)
        self._lang = options.lang
        self._shown: dict[int, tuple[Transaction, list[Finding]]] = {}
        self._pairing = _Pairing(
            limits(), self._answered, self._closed, self._nothing_to_read, self._refused
        )
        self._records._pairing = self._pairing

    def watch(self, capture: Capture) -> CaptureResult:
        """Reads to the end; the result holds no transaction and no finding."""
        return self.run(capture)

    def _answered(self, job: Job) -> None:
        super()._answered(job)
        self._show(job, self._answers[job])

    def _refused(self, job: Job) -> None:
        """The Write was refused: a Read may still come for it, but seldom does."""
        self._show(job, self._judge.closed(job))

    def _show(self, job: Job, remarks: list[Remark]) -> None:
        remarks = [*remarks, *self._transport.get(job, ())]
        remarks = [remark for remark in remarks if self._findings.wanted(remark.rule)]
        transaction = build(job, self._lang)
        transaction.id = job.order
        findings = [self._findings.word(remark, job.order) for remark in remarks]
        before = self._shown.get(job.order)
        if before is not None:  # refused first, and then read nevertheless
            findings += [each for each in before[1] if each not in findings]
        transaction.findings = sorted({each.rule for each in findings})
        self._shown[job.order] = transaction, findings
        self._tell(before, transaction, findings)

    def _remark(self, remark: Remark) -> None:
        job = remark.job
        super()._remark(remark)
        if job is None or job.order not in self._shown or not self._findings.wanted(remark.rule):
            return
        if job.phase != "closed":
            finding = self._findings.word(remark, job.order)
            self._shown[job.order][1].append(finding)
            self._listener.found(finding)

    def _over(self, transaction: Transaction, findings: list[Finding]) -> None:
        """Nothing more can come for this one."""
        self._tell(self._shown.pop(transaction.id, None), transaction, findings)

    def _tell(
        self,
        shown: tuple[Transaction, list[Finding]] | None,
        transaction: Transaction,
        findings: list[Finding],
    ) -> None:
        if shown is None:
            self._listener.finished(transaction, findings)
            return
        before, known = shown
        for finding in findings:
            if finding not in known:
                self._listener.found(finding)
        if _differs(before, transaction):
            self._listener.changed(before, transaction, findings)


class _Pairing(Pairing):
    """Says when a Write is refused: to the report that is no news before the job is closed."""

    def __init__(
        self,
        bounds: Limits,
        answered: Callable[[Job], None],
        closed: Callable[[Job], None],
        nothing_to_read: Callable[[Peer, Record], None],
        refused: Callable[[Job], None],
    ) -> None:
        super().__init__(bounds, answered, closed, nothing_to_read)
        self._tell_refused = refused

    def write_response(self, job: Job, response: Half | None, *, fault: bool = False) -> None:
        super().write_response(job, response, fault=fault)
        if job.phase == "refused":
            self._tell_refused(job)


class _Immediate(Findings):
    """Words a finding and hands it on; keeps none."""

    def __init__(self, options: AnalysisOptions, listener: Listener) -> None:
        super().__init__(options.lang, options.select, options.ignore)
        self._listener = listener

    def add(self, remark: Remark) -> None:
        if self.wanted(remark.rule):
            self._listener.found(self.word(remark))


def _differs(before: Transaction, after: Transaction) -> bool:
    return (before.state, before.findings, before.frames, before.write_status) != (
        after.state, after.findings, after.frames, after.write_status,
    )  # fmt: skip
