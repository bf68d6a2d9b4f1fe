"""What a watch prints: lines of text or NDJSON, each at once, and summaries.

A line of text is that of the text report (`ds47.report.text`); NDJSON is that of `ds47 report`, see
docs/watch.md for the one difference.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TextIO

from ds47.model import OPERATIONS, SEVERITIES, STATES, CaptureResult, Finding, Transaction
from ds47.report import ReportOptions, json, ndjson, text
from ds47.report.bilingual import Both, joined, numbered, operation, say
from ds47.report.clock import Clock
from ds47.report.contract import FINDING
from ds47.report.formatting import escape
from ds47.report.latency import Latency
from ds47.report.sentences import at_offset, sentence
from ds47.report.summary import about
from ds47.report.targets import Targets
from ds47.report.wrap import columns
from ds47.report.zones import Zone

_DIGITS = 3
"""Digits that are kept of a duration: so there is a bounded number of different ones."""


class Tally:
    """Counts for the summary; of durations only how often each was, rounded."""

    def __init__(self) -> None:
        self.states: Counter[str] = Counter()
        self.operations: Counter[str] = Counter()
        self.severities: Counter[str] = Counter()
        self.rules: Counter[str] = Counter()
        self._latency = Latency()

    def transaction(self, item: Transaction) -> None:
        """Counts one."""
        self.states[item.state] += 1
        self.operations[item.operation] += 1
        if item.duration_ns is not None and item.duration_ns >= 0:
            digits = len(str(item.duration_ns))
            self._latency.add(round(item.duration_ns, min(0, _DIGITS - digits)))

    def changed(self, before: Transaction, after: Transaction) -> None:
        """Recounts one after a change of its state."""
        self.states[before.state] -= 1
        self.states[after.state] += 1

    def finding(self, item: Finding) -> None:
        """Counts one."""
        self.severities[item.severity] += 1
        self.rules[item.rule] += 1

    def worst(self) -> int:
        """Index of the most serious severity that was found, -1 for none."""
        found = [SEVERITIES.index(name) for name, number in self.severities.items() if number]
        return max(found, default=-1)

    def lines(self, frames: int, lang: str) -> list[str]:
        """The summary after so many frames, its heading first."""
        jobs = say("transactions", n=self.states.total())
        if self.states.total():
            split = _counts(STATES, self.states, "state_")
            split = split.joined(_counts(OPERATIONS, self.operations, "operation_"), "; ", "；")
            jobs = jobs.joined(split, ": ", "：")
        found = say("findings", n=self.severities.total())
        if self.severities.total():
            split = _counts(SEVERITIES[::-1], self.severities, "severity_")
            rules = [Both.same(f"{rule} {n}") for rule, n in sorted(self.rules.items())]
            split = split.joined(joined(rules), "; ", "；")
            found = found.joined(split, ": ", "：")
        lines = [jobs.text(lang), found.text(lang), self._latency.text(lang)]
        head = say("watch_summary", n=frames).text(lang)
        return [head, *(f"  {line}" for line in lines if line)]


class TextShow(text.Writer):
    """A line per transaction, of S7 where it has findings, findings below; summaries on the same stream."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self.tally = Tally()
        self._clock = Clock(self.options.zone, 0)
        self._columns = _Growing(self.options.lang, self._clock)
        self._day = ("", "")

    def finished(self, transaction: Transaction, findings: list[Finding]) -> None:
        """A transaction is finished."""
        self.tally.transaction(transaction)
        if self._is_listed(transaction):
            self._transaction(transaction)
        for each in findings:
            self.found(each)

    def changed(
        self,
        before: Transaction,
        transaction: Transaction,
        findings: list[Finding],  # noqa: ARG002
    ) -> None:
        """Shown again only where its state is another one; findings were shown."""
        if before.state != transaction.state:
            self.tally.changed(before, transaction)
            self._transaction(transaction)

    def found(self, finding: Finding) -> None:
        """A finding, at once."""
        self.tally.finding(finding)
        of = "" if finding.transaction is None else f" #{finding.transaction}"
        severity = self._say(f"severity_{finding.severity}")
        rule = self._paint(finding.severity, f"{finding.rule} {severity}")
        text = escape(sentence(finding, self.options.lang))
        text = at_offset(finding.offset, text, self.options.lang)
        frame = say("frame", frame=str(finding.frame))
        shown = self._say("finding_line", frame=frame, job=of, message=text)
        self._line(f"      {rule} {shown}")
        self.stream.flush()

    def summary(self, frames: int) -> None:
        """How things stand."""
        head, *lines = self.tally.lines(frames, self.options.lang)
        self._title(head)
        for line in lines:
            self._line(line)
        self.stream.flush()

    def end(self, result: CaptureResult) -> None:
        """The devices, and how things stood."""
        if result.devices:
            self._line()
            self._title(self._say("watch_devices"))
        width = max((len(escape(each.ip)) for each in result.devices), default=0)
        for each in result.devices:
            self._line(f"  {escape(each.ip):<{width}}{about(each, self.options.lang)}".rstrip())
        self._connections(result)
        self._line()
        if result.dropped:
            lost = self._say("machine_dropped", n=result.dropped)
            self._line(self._paint("warning", lost))
        self.summary(result.frames)

    def _transaction(self, item: Transaction) -> None:
        if self._day[0] == "":
            self._clock = self._columns.begin(self.options.zone, item.start_ns)
            if self._clock.known:
                self._line(self._clock.begin().text(self.options.lang))
            self._day = self._clock.day(item.start_ns)
        self._columns.grow(item)
        if self._clock.known and self._day != self._clock.day(item.start_ns):
            self._day = self._clock.day(item.start_ns)
            self._line(" ".join(self._day))
        for line in self._transaction_lines(item, self._columns):
            self._line(line)
        self.stream.flush()


class NdjsonShow:
    """An object a line; summaries on demand go elsewhere, as text."""

    def __init__(self, stream: TextIO, name: str, aside: TextIO, lang: str = "en") -> None:
        self._stream, self._lang = stream, lang
        self._writer = ndjson.Writer(stream, ReportOptions(lang=lang))
        self.tally = Tally()
        self._name = name
        self._aside = aside

    def finished(self, transaction: Transaction, findings: list[Finding]) -> None:
        """A transaction is finished."""
        self.tally.transaction(transaction)
        for each in findings:
            self.tally.finding(each)
        self._write(transaction, findings)

    def changed(
        self, before: Transaction, transaction: Transaction, findings: list[Finding]
    ) -> None:
        """Written again as a whole: the later line counts."""
        self.tally.changed(before, transaction)
        self._write(transaction, findings)

    def found(self, finding: Finding) -> None:
        """A finding, at once; that of a transaction comes again with the line of `changed`."""
        self.tally.finding(finding)
        line = {"path": self._name, "finding": FINDING.plain(finding)}
        self._stream.write(json.text(line) + "\n")
        self._stream.flush()

    def summary(self, frames: int) -> None:
        """How things stand, for a person."""
        self._aside.writelines(f"{line}\n" for line in self.tally.lines(frames, self._lang))
        self._aside.flush()

    def end(self, result: CaptureResult) -> None:
        """The line that ends a capture."""
        result.path = self._name
        self._writer.capture(result)
        self._stream.flush()

    def _write(self, transaction: Transaction, findings: Sequence[Finding]) -> None:
        self._writer.transaction(self._name, transaction, findings)
        self._stream.flush()


Show = TextShow | NdjsonShow


class _Growing(text._Columns):
    """Columns for transactions that are still to come: they only get wider."""

    def __init__(self, lang: str, clock: Clock) -> None:
        self.lang = lang
        self._clock = clock
        self.since = self.frame = 0
        self._targets = Targets(())
        self.operation = columns(operation("change").text(lang))
        self.number = 3
        self.controllers = False
        self.slots = False
        self.route = 0
        self._routes = {}
        self._first: tuple[str, tuple[int | None, int | None, int | None]] | None = None

    def begin(self, zone: Zone, first_ns: int) -> Clock:
        """The first transaction has come: seconds count from it."""
        self._clock = Clock(zone, first_ns)
        return self._clock

    def _seconds(self, item: Transaction) -> str:
        """Only without a time of day: the first frame of a live capture is not shown."""
        return "" if self._clock.known else super()._seconds(item)

    def grow(self, item: Transaction) -> None:
        """Makes room for one more; its target is named by what was seen until then."""
        self._targets.transaction(item)
        submodule = (item.api, item.slot, item.subslot)
        if self._first is None:
            self._first = item.controller, submodule
        self.controllers = self.controllers or item.controller != self._first[0]
        self.slots = self.slots or submodule != self._first[1]
        self.operation = max(self.operation, columns(operation(item.operation).text(self.lang)))
        self.number = max(self.number, len(str(item.id)) + 1)
        self.since = max(self.since, len(self._clock.since(item.start_ns)))
        self.frame = max(self.frame, len(str(item.frames.first())))
        self.route = max(self.route, len(self._route(item)))


def _counts(order: Sequence[str], counts: Counter[str], words: str) -> Both:
    return numbered({key: str(counts[key]) for key in order if counts[key]}, words)
