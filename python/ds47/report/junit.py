"""JUnit XML: one test case per capture, as CI servers show it.

A capture is the case, not a transaction: its name stays the same when it is recorded again, so
that a server's history and its list of new failures mean something; it is what `ds47 check` counts
in, too; and a recording of 100,000 transactions does not fill the server. What went wrong inside
stands in the failure, rule by rule with frames.

Only the form; what makes a case fail is `ReportOptions.fail_on` in a report, and the caller's business
for `write`. Written at the end: the counts come first in the file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TextIO
from xml.etree import ElementTree as ET

from ds47.model import SEVERITIES, STATES, CaptureResult, Finding, Transaction
from ds47.report import NO_TRANSACTION, NOT_OURS, ReportOptions
from ds47.report import Writer as _Writer
from ds47.report.formatting import count, escape
from ds47.report.sentences import message

FINDINGS_PER_CASE = 100
"""The most findings listed for a capture; the others are counted."""


@dataclass(frozen=True, slots=True)
class Case:
    """One capture: `failure` is a result that is wrong, `error` one that could not be had.

    `headline` is the failure in one line, else its first line. `output` is shown with the case and
    decides nothing.
    """

    name: str
    group: str = "ds47"
    seconds: float = 0.0
    failure: tuple[str, ...] = ()
    error: str | None = None
    headline: str | None = None
    output: tuple[str, ...] = ()


def write(cases: Sequence[Case], stream: TextIO, name: str = "ds47") -> None:
    """Writes one test suite (the widely used JUnit 4 schema, as Jenkins and GitLab read it).

    Args:
        cases: in the order to be shown.
        stream: a text stream in UTF-8.
        name: of the suite.
    """
    failures = sum(1 for case in cases if case.failure and case.error is None)
    errors = sum(1 for case in cases if case.error is not None)
    seconds = f"{sum(case.seconds for case in cases):.3f}"
    counts = {
        "tests": str(len(cases)),
        "failures": str(failures),
        "errors": str(errors),
        "time": seconds,
    }
    root = ET.Element("testsuites", counts | {"name": _clean(name)})
    suite = ET.SubElement(root, "testsuite", counts | {"name": _clean(name), "skipped": "0"})
    for case in cases:
        suite.append(_element(case))
    ET.indent(root)
    stream.write('<?xml version="1.0" encoding="utf-8"?>\n')
    stream.write(ET.tostring(root, encoding="unicode") + "\n")


def _element(case: Case) -> ET.Element:
    own = {
        "name": _clean(case.name),
        "classname": _clean(case.group),
        "time": f"{case.seconds:.3f}",
    }
    element = ET.Element("testcase", own)
    if case.error is not None:
        text = "\n".join((case.error, *case.failure))
        ET.SubElement(element, "error", message=_clean(case.error)).text = _clean(text)
    elif case.failure:
        more = f" (and {len(case.failure) - 1} more)" if len(case.failure) > 1 else ""
        headline = case.headline or case.failure[0] + more
        failed = ET.SubElement(element, "failure", message=_clean(headline))
        failed.text = _clean("\n".join(case.failure))
    if case.output:
        ET.SubElement(element, "system-out").text = _clean("\n".join(case.output))
    return element


class Writer(_Writer):
    """Makes a case of each capture: findings from `ReportOptions.fail_on` on are its failure.

    An error is a capture that could not be read, or not to its end. Findings below the limit stand
    in the output of the case, and so does the summary.
    """

    streams: ClassVar[bool] = True

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._cases: list[Case] = []
        self._worst = SEVERITIES.index(self.options.fail_on)
        self._failed, self._noted = _Lines(self.options.lang), _Lines(self.options.lang)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        self._note(findings)

    def capture(self, result: CaptureResult) -> None:
        self._note(result.findings)
        error = None
        if not result.complete or result.problem:
            error = f"only partly read: {result.problem or 'the file ends early'}"
        elif self.options.required and not result.summary.get("transactions"):
            error = NO_TRANSACTION
        elif result.nothing:
            error = NOT_OURS
        output = [_summary(result)]
        if result.dropped:
            output.append(f"the capturing machine dropped {count(result.dropped, 'frame')}")
        self._end(result.path, error, output)

    def unreadable(self, path: str, problem: str) -> None:
        self._end(path, problem, [])

    def close(self) -> None:
        write(self._cases, self.stream)

    def _end(self, path: str, error: str | None, output: list[str]) -> None:
        headline, noted = self._failed.headline(), self._noted.headline()
        failure = [headline, *self._failed.lines()] if headline else []
        if noted:
            output += [f"below the limit: {noted}", *self._noted.lines()]
        self._cases.append(
            Case(
                path,
                failure=tuple(failure),
                error=error,
                headline=headline,
                output=tuple(output),
            )
        )
        self._failed, self._noted = _Lines(self.options.lang), _Lines(self.options.lang)

    def _note(self, findings: Sequence[Finding]) -> None:
        for finding in findings:
            failed = SEVERITIES.index(finding.severity) >= self._worst
            (self._failed if failed else self._noted).add(finding)


class _Lines:
    """Findings as lines: how often each rule applies, then the first ones in the order of frames."""

    def __init__(self, lang: str) -> None:
        self._lang = lang
        self._rules: Counter[str] = Counter()
        self._shown: list[Finding] = []

    def add(self, finding: Finding) -> None:
        self._rules[finding.rule] += 1
        if len(self._shown) < FINDINGS_PER_CASE:
            self._shown.append(finding)

    def headline(self) -> str | None:
        """`3 findings: DS205 x1, DS401 x2`; None where there are none."""
        if not self._rules:
            return None
        rules = ", ".join(f"{rule} x{number}" for rule, number in sorted(self._rules.items()))
        return f"{count(self._rules.total(), 'finding')}: {rules}"

    def lines(self) -> list[str]:
        """A line per finding, and one that says how many were left out."""
        lines = [
            _line(each, self._lang) for each in sorted(self._shown, key=lambda each: each.frame)
        ]
        left_out = self._rules.total() - len(self._shown)
        return [*lines, f"and {count(left_out, 'finding')} more"] if left_out else lines


def _line(item: Finding, lang: str) -> str:
    of = "" if item.transaction is None else f" #{item.transaction}"
    return f"{item.rule} {item.severity}, frame {item.frame}{of}: {message(item, lang)}"


def _summary(result: CaptureResult) -> str:
    total = count(result.summary.get("transactions", 0), "transaction")
    states = [f"{result.summary[key]} {key}" for key in STATES if result.summary.get(key)]
    split = f": {', '.join(states)}" if states else ""
    return f"{count(result.frames, 'frame')}, {total}{split}"


def _clean(text: str) -> str:
    """What nobody could see as an escape, line by line: XML cannot hold most of it anyway."""
    return "\n".join(map(escape, text.split("\n")))
