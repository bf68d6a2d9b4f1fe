"""The analysis that hands out at once: a transaction when it has its response, a finding when it is found.

What may still come for a transaction that was shown (it is read again, the Write response is late) is
shown when it is over: `TrafficListener.changed`. All else is as in `ds47.analysis`.
"""

from __future__ import annotations

from typing import Protocol

from ds47.analysis import Analysis, AnalysisOptions, Early
from ds47.capture import Capture
from ds47.model import CaptureResult, Finding, Transaction


class TrafficListener(Protocol):
    """A listener to live traffic."""

    def finished(self, transaction: Transaction, findings: list[Finding]) -> None:
        """A transaction has its response, or will never have one; what was found about it so far."""

    def changed(
        self, before: Transaction, transaction: Transaction, findings: list[Finding]
    ) -> None:
        """Something came for one that was shown; all that was found about it."""

    def found(self, finding: Finding) -> None:
        """A finding that came for a transaction that was shown, or belongs to none."""


class Live:
    """One analysis of a capture that goes on and on."""

    def __init__(self, options: AnalysisOptions, listener: TrafficListener) -> None:
        self._listener = listener
        self._analysis = Analysis(options, self._over, Early(self._settled, self._found))
        self._shown: dict[int, tuple[Transaction, list[Finding]]] = {}
        """What may still change, by id."""

    def watch(self, capture: Capture) -> CaptureResult:
        """Reads to the end; the result holds no transaction and no finding."""
        return self._analysis.run(capture)

    def _settled(self, transaction: Transaction, findings: list[Finding]) -> None:
        before = self._shown.get(transaction.id)
        if before is not None:  # refused first, and then read nevertheless
            findings += [each for each in before[1] if each not in findings]
            transaction.findings = sorted({each.rule for each in findings})
        self._shown[transaction.id] = transaction, findings
        self._tell(before, transaction, findings)

    def _found(self, finding: Finding) -> None:
        """A finding of a transaction that was not shown yet comes with it."""
        if finding.transaction is not None:
            if finding.transaction not in self._shown:
                return
            self._shown[finding.transaction][1].append(finding)
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


def _differs(before: Transaction, after: Transaction) -> bool:
    return (before.state, before.findings, before.frames, before.write_status) != (
        after.state, after.findings, after.frames, after.write_status,
    )  # fmt: skip
