"""Report as text, for a person: the verdict and what to do, a line per transaction, findings, a summary.

What stands in a line is decided here, in the first lines in `ds47.report.opening`; how values and addresses are
written in `ds47.report.words`.
The layout itself is ASCII, so that any console can show it; texts from the capture are escaped, so
that none of them can talk to the terminal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TextIO

from ds47.model import (
    OPERATIONS,
    SEVERITIES,
    STATES,
    CaptureResult,
    Finding,
    Report,
    Transaction,
)
from ds47.report import Options, message, plc, write_all
from ds47.report import Writer as _Writer
from ds47.report import json as contract
from ds47.report.bilingual import say
from ds47.report.filters import display_filter
from ds47.report.opening import Opening
from ds47.report.verdict import Counts
from ds47.report.words import count, duration, escape, parameter

LINE_LENGTH = 120
"""Parameters that make a line longer than this stand below it, one a line."""
FINDINGS_PER_RULE = 12
_COLORS = {"error": "31", "warning": "33", "note": "36", "ok": "32", "bold": "1", "dim": "2"}
_SERIOUS_STATES = ("error", "mismatch", "refused")


def write(report: Report, stream: TextIO, options: Options | None = None) -> None:
    """Writes a complete report."""
    write_all(Writer(stream, options), report)


def percentile(ordered: Sequence[int], percent: int) -> int:
    """The nearest-rank percentile of sorted numbers: always one that was measured."""
    return ordered[max(0, -(-percent * len(ordered) // 100) - 1)]


class Writer(_Writer):
    """Prints a capture when it is complete; keeps only counts for the last lines."""

    def __init__(self, stream: TextIO, options: Options | None = None) -> None:
        super().__init__(stream, options)
        self._opening = Opening(self.options, self._paint)
        self._captures = 0
        self._counts = Counts()
        self._transactions: list[tuple[str, str, int | None]] = []
        self._severities: Counter[str] = Counter()

    def capture(self, result: CaptureResult) -> None:
        if self._captures:
            self._line()
        self._captures += 1
        counts = Counts.of(result)
        self._counts.add(counts)
        self._header(result, counts)
        for line in self._opening.lines(result):
            self._line(line)
        self._table(result.transactions)
        self._findings(result.findings)
        rows = [(each.operation, each.state, each.duration_ns) for each in result.transactions]
        severities = Counter(each.severity for each in result.findings)
        self._summary("Summary", rows, severities)
        self._transactions += rows
        self._severities += severities

    def unreadable(self, path: str, problem: str) -> None:
        self._captures += 1
        self._counts.add(Counts(captures=1, unreadable=1))

    def close(self) -> None:
        if self._captures > 1:
            title = f"All {self._captures} captures"
            verdict = self._opening.verdict(self._counts)
            self._summary(title, self._transactions, self._severities, verdict)

    def _line(self, text: str = "") -> None:
        self.stream.write(text + "\n")

    def _paint(self, color: str, text: str) -> str:
        return f"\x1b[{_COLORS[color]}m{text}\x1b[0m" if self.options.color else text

    def _title(self, text: str) -> None:
        self._line(self._paint("bold", text))

    def _say(self, key: str, **values: object) -> str:
        return say(key, **values).text(self.options.lang)

    def _header(self, result: CaptureResult, counts: Counts) -> None:
        frames = self._say("frames", n=result.frames)
        self._title(f"{escape(result.path)}: {frames}")
        if result.sha256:
            self._line(f"  sha256 {result.sha256}")
        self._line(self._opening.verdict(counts))
        if not result.complete or result.problem:
            problem = escape(result.problem or self._say("file_ends_early"))
            self._line("  " + self._paint("error", self._say("partly_read", problem=problem)))
        if result.dropped:
            lost = self._say("machine_dropped", n=result.dropped)
            self._line("  " + self._paint("warning", lost))
        if not result.transactions:
            there = _traffic(result) or self._say("no_rpc")
            self._line("  " + self._say("no_transaction") + f" ({there})")

    def _table(self, transactions: Sequence[Transaction]) -> None:
        if not transactions:
            return
        self._line()
        self._title("Transactions")
        columns = _Columns(transactions)
        for each in transactions:
            for line in self._transaction_lines(each, columns):
                self._line(line)
            if self.options.plc or each.state != "ok":
                saw = plc.line(each).text(self.options.lang)
                self._line("      " + self._paint("dim", saw))

    def _transaction_lines(self, item: Transaction, columns: _Columns) -> list[str]:
        left = columns.left(item)
        marks = [self._state(item)] if item.state != "ok" else []
        parts = [parameter(each, item.operation == "change") for each in item.parameters]
        below = len(parts) > 1 and sum(map(len, parts)) + len(left) > LINE_LENGTH
        if below:
            middle, lines = [count(len(parts), "parameter")], [f"      {part}" for part in parts]
        else:
            middle, lines = (["; ".join(parts)] if parts else []), []
        return ["  ".join([left, *middle, *marks, _timing(item)]), *lines]

    def _state(self, item: Transaction) -> str:
        refusals = [
            word
            for word in (item.write_status, item.read_status)
            if word and item.state == "refused"
        ]
        words = " ".join(f"{word:08X}" for word in refusals)
        color = "error" if item.state in _SERIOUS_STATES else "warning"
        return self._paint(color, f"[{item.state} {words}]" if words else f"[{item.state}]")

    def _findings(self, findings: Sequence[Finding]) -> None:
        if not findings:
            return
        self._line()
        self._title("Findings")
        groups: dict[str, list[Finding]] = {}
        for each in findings:
            groups.setdefault(each.rule, []).append(each)
        for _, group in sorted(groups.items(), key=_serious_first):
            self._group(group)

    def _group(self, group: Sequence[Finding]) -> None:
        first = group[0]
        rule = self.options.rules.get(first.rule)
        name = f" {rule.name}" if rule else ""
        severity = self._paint(first.severity, first.severity)
        self._line(f"  {first.rule} {severity}{name}: {count(len(group), 'finding')}")
        for each in group[:FINDINGS_PER_RULE]:
            of = "" if each.transaction is None else f" #{each.transaction}"
            self._line(f"    frame {each.frame}{of}: {escape(message(each))}")
        if len(group) > FINDINGS_PER_RULE:
            self._line(f"    and {len(group) - FINDINGS_PER_RULE} more")
        text, left_out = display_filter(each.frame for each in group)
        note = f"  (and {count(left_out, 'frame')} more)" if left_out else ""
        self._line("    " + self._paint("dim", text) + note)

    def _summary(
        self,
        title: str,
        rows: Sequence[tuple[str, str, int | None]],
        severities: Counter[str],
        verdict: str = "",
    ) -> None:
        self._line()
        self._title(title)
        if verdict:
            self._line(f"  {verdict}")
        states = _counts(STATES, Counter(state for _, state, _ in rows))
        operations = _counts(OPERATIONS, Counter(operation for operation, _, _ in rows))
        split = f": {states}; {operations}" if rows else ""
        self._line(f"  {count(len(rows), 'transaction')}{split}")
        found = _counts(tuple(reversed(SEVERITIES)), severities)
        self._line(f"  {count(severities.total(), 'finding')}" + (f": {found}" if found else ""))
        latency = _latency([ns for _, _, ns in rows if ns is not None])
        if latency:
            self._line(f"  {latency}")


class _Columns:
    """What the transactions of one capture need to be told apart, and how wide that is."""

    def __init__(self, transactions: Sequence[Transaction]) -> None:
        self.operation = max(len(each.operation) for each in transactions)
        self.number = max(len(str(each.id)) for each in transactions) + 1
        self.controllers = len({each.controller for each in transactions}) > 1
        self.slots = len({(each.api, each.slot, each.subslot) for each in transactions}) > 1
        self.route = max(len(self._route(each)) for each in transactions)

    def _route(self, item: Transaction) -> str:
        controller = f"{escape(item.controller)} -> " if self.controllers else ""
        slot = f" slot {item.slot}.{item.subslot}" if self.slots else ""
        axis = "" if item.axis is None else f" DO {item.axis}"
        return f"{controller}{escape(item.device)}{slot}{axis}"

    def left(self, item: Transaction) -> str:
        """The start of the line: number, operation, where to."""
        number = f"#{item.id}".ljust(self.number)
        operation = item.operation.ljust(self.operation)
        return f"{number} {operation}  {self._route(item).ljust(self.route)}"


def _timing(item: Transaction) -> str:
    took = "" if item.duration_ns is None else f" {duration(item.duration_ns)}"
    polls = f", polled {count(len(item.frames.polls), 'time')}" if item.frames.polls else ""
    again = f", read again {count(len(item.frames.rereads), 'time')}" if item.frames.rereads else ""
    return f"{count(len(item.frames.all()), 'frame')}{took}{polls}{again}"


def _traffic(result: CaptureResult) -> str:
    """What a capture without transactions has instead, so that nobody doubts it was read."""
    calls = [
        f"index {index} {kind} {number}"
        for index, kinds in contract.capture_head(result)["records"].items()
        for kind, number in kinds.items()
        if number
    ]
    rpc = [f"{name} {number}" for name, number in result.rpc.items() if number]
    more = f", and {len(calls) - 6} more" if len(calls) > 6 else ""
    records = f"; record calls: {', '.join(calls[:6])}{more}" if calls else ""
    return f"RPC: {', '.join(rpc)}{records}" if rpc else ""


def _serious_first(item: tuple[str, list[Finding]]) -> tuple[int, str]:
    rule, group = item
    return (-SEVERITIES.index(group[0].severity), rule)


def _counts(order: Sequence[str], counts: Counter[str]) -> str:
    return ", ".join(f"{counts[key]} {key}" for key in order if counts[key])


def _latency(durations: Sequence[int]) -> str:
    """Percentiles of the times that can be true: a clock set back leaves negative ones."""
    ordered = sorted(each for each in durations if each >= 0)
    odd = len(durations) - len(ordered)
    note = f" ({count(odd, 'negative time')} left out)" if odd else ""
    if not ordered:
        return f"latency unknown{note}" if odd else ""
    values = ((name, percentile(ordered, at)) for name, at in (("p50", 50), ("p95", 95)))
    shown = ", ".join(f"{name} {duration(value)}" for name, value in values)
    return f"latency {shown}, max {duration(ordered[-1])}{note}"
