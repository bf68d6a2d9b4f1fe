"""What only the analyzer says: findings of the rules that are marked (`analyzer_only` in rules.toml), jobs and
connections of S7, and the table of the stations of PROFIBUS.

Whatever compares the analyzer with the Lua half leaves them out with the functions that are here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ds47.acyclic.transactions import summarise
from ds47.model import S7, CaptureResult
from ds47.spec import rules


def of_transactions(told: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings or diagnoses of a report without those of rules that only the analyzer has."""
    return [each for each in told if not rules()[each["rule"]].analyzer_only]


def without_analyzers(result: CaptureResult) -> CaptureResult:
    """A result as the Lua half has it: the transactions that are left are counted and numbered anew."""
    left = [each for each in result.transactions if each.channel != S7]
    numbers: dict[int | None, int | None] = {None: None}
    for number, each in enumerate(left, 1):
        numbers[each.id] = each.id = number
        each.findings = [rule for rule in each.findings if not rules()[rule].analyzer_only]
    summary = summarise(Counter((each.state, each.operation) for each in left))
    findings = [each for each in result.findings if not rules()[each.rule].analyzer_only]
    diagnoses = [each for each in result.diagnoses if not rules()[each.rule].analyzer_only]
    for finding in findings:
        finding.transaction = numbers[finding.transaction]
    for diagnosis in diagnoses:
        diagnosis.transactions = [numbers[each] or 0 for each in diagnosis.transactions]
        if diagnosis.corrected_in is not None:
            diagnosis.corrected_in = numbers[diagnosis.corrected_in]
    return replace(
        result, transactions=left, findings=findings, diagnoses=diagnoses, summary=summary, bus=None,
        connections=[], connections_left_out=0,
    )  # fmt: skip
