"""Findings to headlines: each cause once, with a count, frames, and what is true of all (docs/diagnoses.md).

A cause is a rule, a device and those arguments of the finding that the rule names in `group`. Of the other
arguments a headline keeps those that are the same in all of its cases; it is worded in `ds47.report.sentences`.
"""

from __future__ import annotations

import sys
from bisect import bisect_left, insort
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from ds47.findings.remark import Corrected
from ds47.model import SEVERITIES, Diagnosis, Finding
from ds47.spec import rules
from ds47.spec.semantics import known

OF_THE_RECORDING: Final = "DS725"
"""What the capture lacks comes first: readers need it to understand the rest."""
_OFFERED: Final = 8
"""Corrected requests of a cause that are kept until it is known which of them holds."""


class Cause(NamedTuple):
    """What the cases of one headline have in common."""

    rule: str
    device: str | None
    key: tuple[str, ...]


def cause(rule: str, device: str | None, args: dict[str, Any]) -> Cause:
    """The cause of a finding, by its arguments."""
    row = rules().get(rule)
    names = row.group if row else ()
    return Cause(
        rule, device, tuple("" if args.get(name) is None else str(args[name]) for name in names)
    )


class _Cases:
    """The cases of one cause, as they come."""

    def __init__(self, first: Finding, device: str | None) -> None:
        self.diagnosis = Diagnosis(
            first.rule, first.severity, dict(first.args), device, said=first.said
        )
        self.offered: list[tuple[Corrected, int | None]] = []
        """The first corrected requests, with their transactions; which of them holds is known at the end."""
        self._last = 0
        """The last frame that had no room: it may come again."""

    def add(self, finding: Finding) -> None:
        diagnosis = self.diagnosis
        diagnosis.count += 1
        agree(diagnosis, finding.args)
        for frame in finding.counted:
            if not _keep(diagnosis.frames, frame) and self._last != frame:
                self._last = frame
                diagnosis.frames_left_out += 1
        jobs, job = diagnosis.transactions, finding.transaction
        if job is not None and len(jobs) < known().frames and job not in jobs:
            jobs.append(job)


class Grouping:
    """Counts findings by their causes; memory is bounded, whatever the capture holds."""

    def __init__(self) -> None:
        self._groups: dict[Cause, _Cases] = {}

    def add(self, about: Cause, finding: Finding, corrected: Corrected = None) -> None:
        """A finding of a cause, with its transaction where it has one."""
        if about not in self._groups and len(self._groups) >= known().groups:
            about = Cause(about.rule, None, ())  # too many to tell apart: by rule alone
        cases = self._groups.get(about)
        if cases is None:
            cases = self._groups[about] = _Cases(finding, about.device)
        cases.add(finding)
        if corrected is not None and len(cases.offered) < _OFFERED:
            cases.offered.append((corrected, finding.transaction))

    def result(self) -> list[Diagnosis]:
        """The diagnoses: what the capture lacks, then the worst first, then the most frequent."""

        def order(item: tuple[Cause, _Cases]) -> tuple[Any, ...]:
            about, each = item[0], item[1].diagnosis
            severity = -SEVERITIES.index(each.severity)
            recorded = each.rule != OF_THE_RECORDING
            where = about.device or "", about.key
            return recorded, severity, -each.count, each.rule, each.frames, *where

        for cases in self._groups.values():
            diagnosis = cases.diagnosis
            for each, transaction in cases.offered:
                diagnosis.corrected = each() if callable(each) else each
                if diagnosis.corrected is not None:
                    diagnosis.corrected_in = transaction
                    break
        return [cases.diagnosis for _, cases in sorted(self._groups.items(), key=order)]


def headlines(findings: Iterable[Finding]) -> list[Diagnosis]:
    """Findings that no diagnosis says, by their causes.

    The serious rules first, then in the order in which the capture shows them: what came first may be the cause
    of the rest. Of one rule the most frequent cause comes first.
    """
    groups: dict[Cause, _Cases] = {}
    for each in findings:
        about = cause(each.rule, None, each.args)
        if each.said is not None:
            about = about._replace(key=(each.said,))
        about = about._replace(key=(*about.key, each.severity))
        if about not in groups:
            groups[about] = _Cases(each, None)
        groups[about].add(each)

    found = [group.diagnosis for group in groups.values()]
    begins: dict[tuple[str, str], int] = {}
    for item in found:
        kind = item.severity, item.rule
        begins[kind] = min((begins.get(kind, sys.maxsize), *item.frames[:1]))

    def order(item: Diagnosis) -> tuple[Any, ...]:
        first = begins[item.severity, item.rule]
        return -SEVERITIES.index(item.severity), first, item.rule, -item.count, item.frames

    return sorted(found, key=order)


def agree(group: Diagnosis, args: dict[str, Any]) -> None:
    """Takes from a headline what is not the same in a further case."""
    for name, value in group.args.items():
        if name not in group.differs and not _same(value, args.get(name)):
            group.args[name] = None
            insort(group.differs, name)


def _same(one: Any, other: Any) -> bool:
    """Whether two arguments look the same: 30 is not 30.0."""
    return one is other or (one == other and repr(one) == repr(other))


def _keep(numbers: list[int], number: int) -> bool:
    """Keeps a frame in a sorted list, each once; False where it has no room."""
    at = bisect_left(numbers, number)
    if at < len(numbers) and numbers[at] == number:
        return True
    numbers.insert(at, number)
    if len(numbers) <= known().frames:
        return True
    numbers.pop()
    return False
