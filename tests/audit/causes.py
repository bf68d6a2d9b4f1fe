"""What diagnoses DS7xx claim, decided anew from frames and transactions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from tests.audit import claims
from tests.audit.claims import Auditor, Case
from tests.audit.reading import Complaint, Reading

AUDITORS: dict[str, Auditor] = {}


def auditor(*rules: str) -> Callable[[Auditor], Auditor]:
    """Makes a function the auditor of rules."""

    def enter(function: Auditor) -> Auditor:
        AUDITORS.update(dict.fromkeys(rules, function))
        return function

    return enter


def diagnoses(reading: Reading) -> Iterator[Complaint]:
    return iter(())
