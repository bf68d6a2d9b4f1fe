"""Report as text, for a person: the verdict and what to do, a line per transaction, findings, a summary.

What stands in a line is decided here, in the first lines in `ds47.report.opening`; how values and addresses are
written in `ds47.report.words`.
The layout itself is ASCII, so that any console can show it; texts from the capture are escaped, so
that none of them can talk to the terminal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TextIO

from ds47.model import (
    SEVERITIES,
    CaptureFile,
    CaptureResult,
    Finding,
    Report,
    Transaction,
)
from ds47.report import Options, causes, message, plc, write_all
from ds47.report import Writer as _Writer
from ds47.report import json as contract
from ds47.report.bilingual import say
from ds47.report.filters import display_filter
from ds47.report.latency import Latency
from ds47.report.opening import Opening
from ds47.report.overview import Row, table, total
from ds47.report.places import Places, name
from ds47.report.verdict import Counts
from ds47.report.words import count, duration, escape, parameter

LINE_LENGTH = 120
"""Parameters that make a line longer than this stand below it, one a line."""
FINDINGS_PER_RULE = 12
FILES_LISTED = 20
"""Files of a series that are listed; JSON has all, and every finding names its file."""
CAPTURES_LISTED = 20
"""Captures of a run that are listed at its end, the worst ones; `-f overview` lists all."""
_COLORS = {"error": "31", "warning": "33", "note": "36", "ok": "32", "bold": "1", "dim": "2"}
_SERIOUS_STATES = ("error", "mismatch", "refused")


def write(report: Report, stream: TextIO, options: Options | None = None) -> None:
    """Writes a complete report."""
    write_all(Writer(stream, options), report)


class Writer(_Writer):
    """Prints a capture when it is complete; keeps only counts for the last lines."""

    def __init__(self, stream: TextIO, options: Options | None = None) -> None:
        super().__init__(stream, options)
        self._opening = Opening(self.options, self._paint)
        self._counts = Counts()
        self._rows: list[Row] = []
        self._latency = Latency()

    def capture(self, result: CaptureResult) -> None:
        if self._rows:
            self._line()
        counts = Counts.of(result)
        self._counts.add(counts)
        self._header(result, counts)
        for line in self._opening.lines(result):
            self._line(line)
        self._table(result.transactions)
        self._findings(result.findings, Places(result.files))
        row = Row.of(result)
        durations = (each.duration_ns for each in result.transactions)
        latency = Latency(each for each in durations if each is not None)
        self._summary("Summary", total([row]), latency)
        self._rows.append(row)
        self._latency.update(latency)

    def unreadable(self, path: str, problem: str) -> None:
        self._rows.append(Row.unreadable(path, problem))
        self._counts.add(Counts(captures=1, unreadable=1))

    def close(self) -> None:
        if len(self._rows) < 2:
            return
        sums = total(self._rows)
        to_do = list(causes.lines(sums["to_do"], self.options, advice=False))
        for block in (table(self._rows, CAPTURES_LISTED), to_do):
            for line in ["", *block] if block else ():
                self._line(line)
        title = f"All {len(self._rows):,} captures"
        verdict = self._opening.verdict(self._counts)
        self._summary(title, sums, self._latency, verdict)

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
        self._files(result.files)
        if not result.complete or result.problem:
            problem = escape(result.problem or self._say("file_ends_early"))
            self._line("  " + self._paint("error", self._say("partly_read", problem=problem)))
        if result.dropped:
            lost = self._say("machine_dropped", n=result.dropped)
            self._line("  " + self._paint("warning", lost))
        if not result.transactions:
            there = _traffic(result) or self._say("no_rpc")
            self._line("  " + self._say("no_transaction") + f" ({there})")

    def _files(self, files: Sequence[CaptureFile]) -> None:
        """Of a series: which file has which frames, and which are missing."""
        if not files:
            return
        self._line(
            f"  {count(len(files), 'file')} read as one, frames numbered through all of them"
        )
        if files[0].missing_before:
            gone = count(files[0].missing_before, "file")
            self._line(f"    {gone} before the first: written over, or not here")
        for file in files[:FILES_LISTED]:
            self._missing(file, files[0])
            frames = f"frames {file.first_frame} to {file.first_frame + file.frames - 1}"
            shown = frames if file.frames else "no frame"
            problem = f"  {escape(file.problem)}" if file.problem else ""
            self._line(f"    {escape(name(file))}: {shown}" + self._paint("error", problem))
        for file in files[FILES_LISTED:]:
            self._missing(file, files[0])
        if len(files) > FILES_LISTED:
            self._line(f"    and {count(len(files) - FILES_LISTED, 'file')} more")

    def _missing(self, file: CaptureFile, first: CaptureFile) -> None:
        if file.missing_before and file is not first:
            text = f"{count(file.missing_before, 'file')} missing before {escape(name(file))}"
            self._line("    " + self._paint("warning", text))

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

    def _findings(self, findings: Sequence[Finding], places: Places) -> None:
        if not findings:
            return
        self._line()
        self._title("Findings")
        groups: dict[str, list[Finding]] = {}
        for each in findings:
            groups.setdefault(each.rule, []).append(each)
        for _, group in sorted(groups.items(), key=_serious_first):
            self._group(group, places)

    def _group(self, group: Sequence[Finding], places: Places) -> None:
        first = group[0]
        rule = self.options.rules.get(first.rule)
        name = f" {rule.name}" if rule else ""
        severity = self._paint(first.severity, first.severity)
        self._line(f"  {first.rule} {severity}{name}: {count(len(group), 'finding')}")
        for each in group[:FINDINGS_PER_RULE]:
            of = "" if each.transaction is None else f" #{each.transaction}"
            self._line(f"    {escape(places.words(each.frame))}{of}: {escape(message(each))}")
        if len(group) > FINDINGS_PER_RULE:
            self._line(f"    and {len(group) - FINDINGS_PER_RULE} more")
        for file, frames in places.by_file(each.frame for each in group):
            text, left_out = display_filter(frames)
            note = f"  (and {count(left_out, 'frame')} more)" if left_out else ""
            where = f"{escape(file)}: " if file else ""
            self._line(f"    {where}{self._paint('dim', text)}{note}")

    def _summary(
        self, title: str, sums: dict[str, Any], latency: Latency, verdict: str = ""
    ) -> None:
        self._line()
        self._title(title)
        if verdict:
            self._line(f"  {verdict}")
        states, operations, findings = sums["states"], sums["operations"], sums["findings"]
        split = f": {_counts(states)}; {_counts(operations)}" if states else ""
        self._line(f"  {count(sum(states.values()), 'transaction')}{split}")
        found = f": {_counts(findings)}" if findings else ""
        self._line(f"  {count(sum(findings.values()), 'finding')}{found}")
        if latency.text():
            self._line(f"  {latency.text()}")


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


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{number} {word}" for word, number in counts.items())
