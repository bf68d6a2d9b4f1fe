"""What is to be done: the diagnoses of a capture, and the findings that none of them says already.

Which findings a diagnosis covers stands in spec/report.toml. Used by the text report and by the HTML page.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from ds47.model import DIAGNOSIS, CaptureResult, Diagnosis, Finding
from ds47.report.targets import Targets
from ds47.spec import rules
from ds47.spec.reporting import covers

_WRONG_DRIVE_OBJECT = "DS709"
_ANSWERED = ("ok", "partial")
_OF_STATE = ("DS530", "DS531")
"""What the status word says of a change that was not accepted."""


def uncovered(result: CaptureResult) -> list[Finding]:
    """Errors and warnings that no diagnosis covers, in their order; also those that are notes by the maker."""
    serious = [
        each
        for each in result.findings
        if (each.severity != "note" or is_lowered(each.rule, each.severity))
        and not each.rule.startswith(DIAGNOSIS)
    ]
    about = _Covered(result)
    return [each for each in serious if not about.covers(each)]


def is_lowered(rule: str, severity: str) -> bool:
    """Whether a finding is a note only because the maker of the drive has no tables here."""
    known = rules().get(rule)
    return severity == "note" and known is not None and known.severity != "note"


class _Covered:
    """What the diagnoses of a capture cover, by job and for the whole."""

    def __init__(self, result: CaptureResult) -> None:
        self._devices = {each.id: each.device for each in result.transactions}
        self._jobs: dict[int, list[Finding]] = {}
        for each in result.findings:
            if each.transaction is not None and each.rule.startswith(DIAGNOSIS):
                self._jobs.setdefault(each.transaction, []).append(each)
        ours = {each.rule for found in self._jobs.values() for each in found}
        whole = [
            each
            for each in result.findings
            if each.rule.startswith(DIAGNOSIS) and each.rule not in ours
        ]
        self._whole = {_what(each): each for each in whole}.values()

    def covers(self, finding: Finding) -> bool:
        """Whether a diagnosis says it already."""
        for each in self._jobs.get(finding.transaction or 0, ()):
            if _names("job", each.rule, finding) or _same_code(each, finding):
                return True
        device = self._devices.get(finding.transaction or 0)
        return any(
            _names("whole", each.rule, finding) or _same_code(each, finding)
            for each in self._whole
            if device is None or each.args.get("device") in (None, device)
        )


def _what(item: Finding) -> tuple[object, ...]:
    """What decides which findings a diagnosis covers."""
    return item.rule, *(item.args.get(name) for name in ("device", "code", "status"))


def _names(how: str, rule: str, finding: Finding) -> bool:
    return finding.rule.startswith(covers(how).get(rule, ("-",)))


def _same_code(diagnosis: Finding, finding: Finding) -> bool:
    """Whether both are about the same error number, or about the same status."""
    if not _names("word", diagnosis.rule, finding):
        return False
    return any(
        finding.args.get(key) is not None and diagnosis.args.get(key) == finding.args[key]
        for key in ("code", "status")
    )


OfState = dict[int, tuple[int, Finding]]
"""Transaction -> a finding about it, with its place among all."""


def of_state(result: CaptureResult) -> OfState:
    """What the status word says about each transaction that it explains."""
    found: OfState = {}
    for place, each in enumerate(result.findings):
        if each.rule in _OF_STATE and each.transaction is not None:
            found.setdefault(each.transaction, (place, each))
    return found


def by_state(said: OfState, transactions: Collection[int]) -> Finding | None:
    """What it says about the first of these transactions; `said` by `of_state`."""
    found = [said[each] for each in transactions if each in said] if said else []
    return min(found)[1] if found else None


def answering(result: CaptureResult, item: Diagnosis) -> str:
    """The drive objects of its device that answer, for a request to one that does not exist; else empty."""
    if item.rule != _WRONG_DRIVE_OBJECT:
        return ""
    targets = Targets(result.evidence)
    numbers = {
        targets.drive_object(each)
        for each in result.evidence
        if each.device == item.device and each.state in _ANSWERED
    }
    return ", ".join(str(number) for number in sorted(filter(None, numbers)))


class More(NamedTuple):
    """Further diagnoses of a rule that are not listed one by one."""

    rule: str
    causes: int
    findings: int


def causes(diagnoses: Sequence[Diagnosis], most: int) -> Iterator[Diagnosis | More]:
    """The diagnoses in their order, but no more than `most` of one rule: the rest of it stands behind the last.

    So a drive that refuses in many ways does not hide what else is wrong.
    """
    of_rule: dict[str, list[Diagnosis]] = {}
    for each in diagnoses:
        of_rule.setdefault(each.rule, []).append(each)
    counts: Counter[str] = Counter()
    for each in diagnoses:
        counts[each.rule] += 1
        if counts[each.rule] <= most:
            yield each
        if counts[each.rule] == most and (rest := of_rule[each.rule][most:]):
            yield More(each.rule, len(rest), sum(other.count for other in rest))
