"""What is to be done: the diagnoses of a capture, and the findings that none of them says already.

Which findings a diagnosis covers stands in spec/report.toml. Used by the text report and by the HTML page.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from ds47.diagnosis.targets import LOCAL
from ds47.model import DIAGNOSIS, SEVERITIES, CaptureResult, Diagnosis, Finding
from ds47.spec.reporting import covers
from ds47.spec.semantics import known

_WRONG_DRIVE_OBJECT = "DS709"
_ANSWERED = ("ok", "partial")


def uncovered(result: CaptureResult) -> list[Finding]:
    """Errors and warnings that no diagnosis covers, in their order."""
    serious = [
        each
        for each in result.findings
        if each.severity != "note" and not each.rule.startswith(DIAGNOSIS)
    ]
    if not serious or not any(each.rule.startswith(DIAGNOSIS) for each in result.findings):
        return serious
    about = _Covered(result)
    return [each for each in serious if not about.covers(each)]


def by_rule(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Findings by rule, the serious rules first, then by id."""
    groups: dict[str, list[Finding]] = {}
    for each in findings:
        groups.setdefault(each.rule, []).append(each)
    return sorted(groups.values(), key=lambda g: (-SEVERITIES.index(g[0].severity), g[0].rule))


class _Covered:
    """What the diagnoses of a capture cover, by job and for the whole."""

    def __init__(self, result: CaptureResult) -> None:
        self._devices = {each.id: each.device for each in result.transactions}
        self._jobs: dict[int, list[Finding]] = {}
        for each in result.findings:
            if each.transaction is not None and each.rule.startswith(DIAGNOSIS):
                self._jobs.setdefault(each.transaction, []).append(each)
        ours = {each.rule for found in self._jobs.values() for each in found}
        self._whole = [each for each in result.diagnoses if each.rule not in ours]

    def covers(self, finding: Finding) -> bool:
        """Whether a diagnosis says it already."""
        for each in self._jobs.get(finding.transaction or 0, ()):
            if _names("job", each.rule, finding) or _same_code(each, finding):
                return True
        device = self._devices.get(finding.transaction or 0)
        return any(
            _names("whole", each.rule, finding) or _same_code(each, finding)
            for each in self._whole
            if device is None or each.device is None or device == each.device
        )


def _names(how: str, rule: str, finding: Finding) -> bool:
    return finding.rule.startswith(covers(how).get(rule, ("-",)))


def _same_code(diagnosis: Diagnosis | Finding, finding: Finding) -> bool:
    """Whether both are about the same error number, or about the same status."""
    if not _names("word", diagnosis.rule, finding):
        return False
    return any(
        finding.args.get(key) is not None and diagnosis.args.get(key) == finding.args[key]
        for key in ("code", "status")
    )


def answering(result: CaptureResult, item: Diagnosis) -> str:
    """The drive objects of its device that answer, for a request to one that does not exist; else empty."""
    if item.rule != _WRONG_DRIVE_OBJECT:
        return ""
    missing, axes = {item.args.get("axis")}, set()
    for each in result.transactions:
        if each.device != item.device or each.index == LOCAL or each.axis is None:
            continue  # under 0xB02E the slot decides who answers
        if any(p.error and p.error.code == known().axis_error for p in each.parameters):
            missing.add(each.axis)
        elif each.state in _ANSWERED:
            axes.add(each.axis)
    return ", ".join(map(str, sorted(axes - missing)))


class More(NamedTuple):
    """Further diagnoses of a rule that are not told one by one."""

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
    told: Counter[str] = Counter()
    for each in diagnoses:
        told[each.rule] += 1
        if told[each.rule] <= most:
            yield each
        rest = of_rule[each.rule][most:]
        if told[each.rule] == most and rest:
            yield More(each.rule, len(rest), sum(other.count for other in rest))
