"""Findings DS7xx to diagnoses: one for each cause, with a count and the first frames (docs/diagnoses.md).

A cause is a rule, a device and those arguments of the message that the rule names in `group`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ds47.model import SEVERITIES, Diagnosis, Finding
from ds47.rules import Corrected
from ds47.spec import rules
from ds47.spec.semantics import known


class Cause(NamedTuple):
    """What is kept of the finding that showed it first."""

    rule: str
    device: str | None
    key: tuple[str, ...]


def cause(rule: str, device: str | None, args: dict[str, Any]) -> Cause:
    """The cause of a finding, by the arguments of its message."""
    return Cause(
        rule,
        device,
        tuple("" if args.get(name) is None else str(args[name]) for name in rules()[rule].group),
    )


class Grouping:
    """Counts findings by their causes; memory is bounded, whatever the capture holds."""

    def __init__(self) -> None:
        self._groups: dict[Cause, Diagnosis] = {}
        self._corrected: dict[Cause, list[Corrected]] = {}
        """The first of each group; which of them holds is known when the capture is over."""

    def add(self, about: Cause, finding: Finding, corrected: Corrected = None) -> None:
        """A finding of a cause, with its transaction where it has one."""
        group = self._groups.get(about)
        if group is None:
            if len(self._groups) >= known().groups:  # too many to tell apart: by rule alone
                about = Cause(about.rule, None, ())
                group = self._groups.get(about)
            if group is None:
                group = Diagnosis(finding.rule, finding.severity, finding.args, about.device)
                self._groups[about] = group
        group.count += 1
        if corrected is not None:
            offered = self._corrected.setdefault(about, [])
            if len(offered) < known().frames:
                offered.append(corrected)
        _insert(group.frames, finding.frame)
        if finding.transaction is not None:
            _insert(group.transactions, finding.transaction)

    def result(self) -> list[Diagnosis]:
        """The diagnoses, worst first, then the most frequent."""

        def order(item: tuple[Cause, Diagnosis]) -> tuple[Any, ...]:
            about, each = item
            severity = -SEVERITIES.index(each.severity)
            return severity, -each.count, each.rule, each.frames, about.device or "", about.key

        for about, offered in self._corrected.items():
            made = (each() if callable(each) else each for each in offered)
            self._groups[about].corrected = next((each for each in made if each is not None), None)
        return [each for _, each in sorted(self._groups.items(), key=order)]


def _insert(numbers: list[int], number: int) -> None:
    """Keeps the least ones, sorted, each once."""
    if number in numbers:
        return
    numbers.append(number)
    numbers.sort()
    del numbers[known().frames :]
