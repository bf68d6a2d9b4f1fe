"""A chosen part of a result (`selection`), counted anew as if the capture had no more.

The analysis is always that of the whole capture: pairing, findings and values are right, whatever is shown. What
is left out still proves what is what (`CaptureResult.entire`), and the result says how much that is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ds47.acyclic.transactions import summarise
from ds47.findings.grouping import Grouping, cause
from ds47.model import (
    DIAGNOSIS,
    Bus,
    CaptureResult,
    Diagnosis,
    Finding,
    Narrowed,
    Timeline,
    Transaction,
)  # fmt: skip
from ds47.report.bilingual import Both, say
from ds47.report.formatting import escape
from ds47.report.selection import Selection, Wanted


def narrowed(result: CaptureResult, selection: Selection, criteria: str) -> CaptureResult:
    """The part of a complete result that is wanted.

    Args:
        result: of the whole capture.
        selection: what is wanted.
        criteria: the same in words, as options of the command line.
    """
    wanted = Wanted(result, selection)
    transactions, unproved = [], 0
    for item in result.transactions:
        if wanted.transaction(item):
            transactions.append(item)
        else:
            unproved += wanted.unproved(item)
    part = _Part(result, selection, wanted, transactions)
    findings = part.findings()
    return replace(
        result, transactions=transactions, findings=findings, diagnoses=_diagnoses(result, findings, part.ids),
        devices=[each for each in result.devices if part.device(each.ip)], summary=_summary(transactions),
        bus=part.bus(), connections=[each for each in result.connections if part.device(each.server)],
        narrowed=Narrowed(criteria, len(result.transactions), len(result.findings), unproved), whole=result,
        **part.cyclic(),
    )  # fmt: skip


def is_empty(result: CaptureResult, selection: Selection) -> bool:
    """Whether nothing that is wanted is in a part; a device that is asked for is something."""
    if result.transactions or result.findings or result.timelines:
        return False
    wanted = Wanted(result.entire, selection).ips
    there = {each.ip for each in result.devices} | {each.server for each in result.connections}
    there |= {f"dp{each.address}" for each in result.bus.stations} if result.bus else set()
    return selection.narrow or bool(selection.rules) or wanted.isdisjoint(there)


def narrowed_words(result: CaptureResult) -> Both:
    """`narrowed by --pnu 1120: 3 of 8 transactions, 1 of 4 findings`."""
    about = result.narrowed
    assert about is not None
    words = say(
        "narrowed", criteria=escape(about.criteria), transactions=len(result.transactions), n=about.transactions,
        findings=say("narrowed_findings", findings=len(result.findings), n=about.findings),
    )  # fmt: skip
    if not about.unproved:
        return words
    return words.joined(say("narrowed_unproved", n=about.unproved), "; ", "；")


def _summary(transactions: Iterable[Transaction]) -> dict[str, int]:
    return summarise(Counter((each.state, each.operation) for each in transactions))


def _diagnoses(
    result: CaptureResult, findings: Iterable[Finding], shown: set[int]
) -> list[Diagnosis]:
    """The causes of these findings; a corrected request where it is that of a transaction that is shown."""
    devices = {each.id: each.device for each in result.transactions}
    grouping = Grouping()
    for each in findings:
        if each.rule.startswith(DIAGNOSIS):
            device = devices.get(each.transaction or 0, each.args.get("device"))
            grouping.add(cause(each.rule, device, each.args), each)
    causes = grouping.result()
    offered = {
        _key(each): each for each in result.diagnoses if each.corrected is not None and each.corrected_in in shown
    }  # fmt: skip
    for item in causes:
        if whole := offered.get(_key(item)):
            item.corrected, item.corrected_in = whole.corrected, whole.corrected_in
    return causes


def _key(item: Diagnosis) -> tuple[str, str | None, tuple[str, ...]]:
    return cause(item.rule, item.device, item.args)


class _Part:
    """What belongs to the transactions that are wanted, or is wanted itself where these are not asked for."""

    def __init__(
        self, result: CaptureResult, selection: Selection, wanted: Wanted, transactions: Iterable[Transaction]
    ) -> None:  # fmt: skip
        self._result, self._selection, self._wanted = result, selection, wanted
        self.ids = {each.id for each in transactions}
        self._devices = {each.device for each in transactions}

    def device(self, address: str) -> bool:
        """Whether a device is shown: it is asked for, or has a transaction that is; else all are."""
        selection = self._selection
        if selection.devices:
            return address in self._wanted.ips
        return selection.by_frame or address in self._devices

    def findings(self) -> list[Finding]:
        """Those of the transactions; others by rule and time, unless a device or more is asked for."""
        return [each for each in self._result.findings if self._has(each)]

    def _has(self, item: Finding) -> bool:
        selection = self._selection
        if item.transaction is not None:
            return item.transaction in self.ids
        if selection.narrow or (selection.rules and not item.rule.startswith(selection.rules)):
            return False
        if selection.devices and item.args.get("device") not in self._wanted.ips:
            return False
        timed = selection.start is not None or selection.end is not None
        return not timed or (item.time_ns is not None and selection.in_time(item.time_ns))

    def bus(self) -> Bus | None:
        """The line of PROFIBUS, with the stations that are shown and the masters."""
        bus = self._result.bus
        if bus is None:
            return None
        stations = [
            each
            for each in bus.stations
            if each.role == "master" or self.device(f"dp{each.address}")
        ]
        return replace(bus, stations=stations)

    def cyclic(self) -> dict[str, Any]:
        """The channels in cyclic frames, and the events of drives."""
        result, selection = self._result, self._selection
        kept = [
            number for number, each in enumerate(result.relations, 1) if self.device(each.device)
        ]
        numbers = {old: new for new, old in enumerate(kept, 1)}
        timelines = [
            self._in_time(replace(each, relation=numbers[each.relation]))
            for each in result.timelines
            if each.relation in numbers and selection.by_frame
        ]
        return {
            "relations": [result.relations[number - 1] for number in kept],
            "timelines": [each for each in timelines if each.events],
            "senders": result.senders if selection.by_frame and not selection.devices else [],
        }

    def _in_time(self, item: Timeline) -> Timeline:
        selection = self._selection
        if selection.start is None and selection.end is None:
            return item
        inside = selection.in_time
        return replace(
            item, events=[each for each in item.events if inside(each.time_ns)],
            setpoint=[each for each in item.setpoint if inside(each.time_ns)],
            actual=[each for each in item.actual if inside(each.time_ns)],
        )  # fmt: skip
