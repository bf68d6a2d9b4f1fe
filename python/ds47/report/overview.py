"""Many captures in one view: a line for each, the worst first, then the totals.

Lives here: `CaptureRow`, the summary of a capture (a few hundred bytes, whatever its length), the text,
and the document `ds47.overview/1`. `ds47.report.causes` says what to do; other formats show single captures.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, TextIO

from ds47.model import DIAGNOSIS, OPERATIONS, SEVERITIES, STATES, CaptureResult
from ds47.report import ReportOptions, causes
from ds47.report import Writer as _Writer
from ds47.report.bilingual import Both, joined, numbered, say
from ds47.report.clock import Clock, beginning
from ds47.report.formatting import duration, escape
from ds47.report.todo import is_lowered
from ds47.report.verdict import VerdictCounts
from ds47.report.wrap import fitted
from ds47.report.zones import Zone
from ds47.spec.units import nanoseconds
from ds47.version import __version__

SCHEMA = "ds47.overview/1"
_CYCLIC = "DS5"
"""The prefix of the rules that are only notes for drives of makers without tables."""


@dataclass(slots=True)
class CaptureRow:
    """One capture; the names are those of the report.

    `readable` is False if it could not be read at all; `problem` says why. `findings` counts by severity, `rules`
    by rule. `diagnoses` has the causes by rule, `slowest_ns` is the longest duration. `start` and `end` are the
    times of the first and the last frame, in the form of the report.
    """

    path: str
    readable: bool = True
    complete: bool = True
    problem: str | None = None
    dropped: int | None = None
    frames: int = 0
    files: int = 1
    missing_files: int = 0
    operations: dict[str, int] = field(default_factory=dict)
    states: dict[str, int] = field(default_factory=dict)
    findings: dict[str, int] = field(default_factory=dict)
    rules: dict[str, int] = field(default_factory=dict)
    diagnoses: dict[str, causes.CauseSummary] = field(default_factory=dict)
    slowest_ns: int | None = None
    start: str | None = None
    end: str | None = None

    @classmethod
    def of(cls, result: CaptureResult, counts: VerdictCounts | None = None) -> CaptureRow:
        """The row of a complete result, which has its transactions and findings; `counts` are its own."""
        counts = counts or VerdictCounts.of(result)
        times = [each.duration_ns for each in result.transactions if each.duration_ns is not None]
        return cls(
            result.path,
            complete=result.complete,
            problem=result.problem,
            dropped=result.dropped,
            frames=result.frames,
            files=len(result.files) or 1,
            missing_files=sum(each.missing_before for each in result.files),
            operations=_in_order(OPERATIONS, counts.operations),
            states=_in_order(STATES, counts.states),
            findings=_in_order(SEVERITIES[::-1], counts.severities),
            rules=dict(sorted(Counter(each.rule for each in result.findings).items())),
            diagnoses=causes.of_capture(result),
            slowest_ns=max((each for each in times if each >= 0), default=None),
            start=result.start,
            end=result.end,
        )

    @classmethod
    def unreadable(cls, path: str, problem: str) -> CaptureRow:
        """A capture that could not be read at all."""
        return cls(path, readable=False, complete=False, problem=problem)

    @classmethod
    def loaded(cls, plain: dict[str, Any]) -> CaptureRow:
        """A row written by `plain`; words are interned, as there may be ten thousand rows.

        Raises:
            ValueError, LookupError, TypeError, AttributeError: it is none.
        """
        for key in ("operations", "states", "findings", "rules"):
            plain[key] = {sys.intern(word): number for word, number in plain[key].items()}
        plain["diagnoses"] = causes.loaded(plain["diagnoses"])
        row = cls(**plain)
        if not {*row.findings, *(each.severity for each in row.diagnoses.values())} <= {
            *SEVERITIES
        }:
            raise ValueError("a severity that is none")
        for time in (row.start, row.end):
            if time is not None:
                nanoseconds(time)  # raises where it is none
        return row

    def plain(self) -> dict[str, Any]:
        """As an object of `ds47.overview/1`."""
        shown = {each.name: getattr(self, each.name) for each in fields(self)}
        shown["diagnoses"] = causes.plain(self.diagnoses)
        return shown

    @property
    def transactions(self) -> int:
        """The number of transactions."""
        return sum(self.states.values())

    @property
    def start_ns(self) -> int | None:
        """Time of the first frame."""
        return None if self.start is None else nanoseconds(self.start)

    @property
    def length_ns(self) -> int | None:
        """From the first frame to the last one; None if these are unknown, or out of order."""
        if self.start is None or self.end is None:
            return None
        length = nanoseconds(self.end) - nanoseconds(self.start)
        return length if length >= 0 else None

    @property
    def worst(self) -> int:
        """Index of the most serious severity, -1 without findings."""
        return max((SEVERITIES.index(name) for name in self.findings), default=-1)

    def badness(self) -> tuple[bool | int | str, ...]:
        """A sort key, the worst first: not readable, errors, warnings, truncated, not ok, notes; then the path."""
        found = self.findings
        return (
            self.readable,
            -found.get("error", 0),
            -found.get("warning", 0),
            self.complete,
            self.states.get("ok", 0) - self.transactions,
            -found.get("note", 0),
            self.path,
        )

    @property
    def quiet(self) -> bool:
        """Whether it needs no attention: read completely, no error, no warning, every job ok."""
        return (
            self.complete
            and not ({"error", "warning"} & self.findings.keys())
            and not any(
                rule.startswith(_CYCLIC) and is_lowered(rule, "note") for rule in self.rules
            )
            and self.states.get("ok", 0) == self.transactions
        )


def total(rows: Sequence[CaptureRow]) -> dict[str, Any]:
    """The totals over captures, in the order of the run, as an object of `ds47.overview/1`."""
    sums: dict[str, Counter[str]] = {
        key: Counter() for key in ("operations", "states", "findings", "rules", "rule_captures")
    }
    for row in rows:
        for key in ("operations", "states", "findings", "rules"):
            sums[key].update(getattr(row, key))
        sums["rule_captures"].update(row.rules.keys())
    slowest = max(
        (
            (row.slowest_ns, -at, row.path)
            for at, row in enumerate(rows)
            if row.slowest_ns is not None
        ),
        default=None,
    )
    return {
        "captures": len(rows),
        "unreadable": sum(not row.readable for row in rows),
        "incomplete": sum(row.readable and not row.complete for row in rows),
        "quiet": sum(row.quiet for row in rows),
        "frames": sum(row.frames for row in rows),
        "operations": _in_order(OPERATIONS, sums["operations"]),
        "states": _in_order(STATES, sums["states"]),
        "findings": _in_order(SEVERITIES[::-1], sums["findings"]),
        "rules": {
            rule: {"findings": number, "captures": sums["rule_captures"][rule]}
            for rule, number in sorted(sums["rules"].items())
        },
        "to_do": causes.over_all((row.path, row.diagnoses) for row in rows),
        "slowest": None if slowest is None else {"path": slowest[2], "ns": slowest[0]},
    }


def document(rows: Sequence[CaptureRow]) -> Iterator[str]:
    """The overview as pieces of JSON text, one capture per line, the worst first."""
    from ds47.report import json  # text needs none of the contract

    head = {
        "schema": SCHEMA,
        "tool": {"name": "ds47", "version": __version__},
        "total": total(rows),
    }
    yield json.text(head)[:-1] + ', "captures": ['
    for number, row in enumerate(sorted(rows, key=CaptureRow.badness)):
        yield (",\n" if number else "\n") + json.text(row.plain())
    yield "]}\n"


class Writer(_Writer):
    """Keeps a row for each capture, and prints at the end."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self.rows: list[CaptureRow] = []

    def capture(self, result: CaptureResult) -> None:
        self.rows.append(CaptureRow.of(result))

    def unreadable(self, path: str, problem: str) -> None:
        self.rows.append(CaptureRow.unreadable(path, problem))

    def close(self) -> None:
        for line in lines(self.rows, self.options):
            self.stream.write(line + "\n")


def lines(rows: Sequence[CaptureRow], options: ReportOptions) -> list[str]:
    """The overview as text: captures that need attention, what to do, what was found, totals."""
    summed = total(rows)
    numbers = [*_spaced(_rules(summed, options)), *_sums(summed, options)]
    return [
        *_spaced(worst_first(rows, options)),
        *_spaced(list(causes.lines(summed["to_do"], options))),
        *(line for each in numbers for line in fitted(each, options.width)),
    ]


def _spaced(block: list[str]) -> list[str]:
    return [*block, ""] if block else []


_HEADINGS = ("errors", "warnings", "notes", "not_ok", "of")
_TIMES = ("start", "length")


def worst_first(
    rows: Iterable[CaptureRow], options: ReportOptions, most: int | None = None
) -> list[str]:
    """A line for each capture that needs attention, the worst first, at most `most`.

    If the time of any is known, all have the columns start (in the zone of the report) and length.
    """
    lang, zone = options.lang, options.zone
    ordered = sorted((row for row in rows if not row.quiet), key=CaptureRow.badness)
    if not ordered:
        return []
    from ds47.report.table import table  # not for a single capture

    listed = ordered[:most]
    timed = any(beginning(zone, row.start_ns) for row in listed)
    names = (*_HEADINGS, *(_TIMES if timed else ()), "capture")
    head = [say(f"worst_{each}").text(lang) for each in names]
    cells = []
    for row in listed:
        *counts, name = _cells(row, options)
        cells.append((*counts, *(times_of(row, zone) if timed else ()), name))
    zone_name = Clock(zone, listed[0].start_ns).zone_name
    title = say("worst_head_timed", zone=zone_name) if timed else say("worst_head")
    shown = [
        options.paint("bold", title.text(lang)),
        *table(cells, options.width, head, lead=(-1,), right=True, paint=options.paint),
    ]
    if most is not None and len(ordered) > most:
        shown.append("  " + say("worst_more", n=len(ordered) - most).text(lang))
    return shown


def times_of(row: CaptureRow, zone: Zone) -> tuple[str, str]:
    """The start and the length of a capture; `-` if unknown."""
    length = row.length_ns
    return beginning(zone, row.start_ns) or "-", "-" if length is None else duration(length)


def _cells(row: CaptureRow, options: ReportOptions) -> tuple[str, ...]:
    name, lang = escape(row.path), options.lang
    if not row.readable:
        problem = say("worst_unreadable", problem=_about(row)).text(lang)
        return ("-",) * len(_HEADINGS) + (f"{name}  {problem}",)
    if row.files > 1:
        name += " " + say("worst_files", n=row.files).text(lang)
    notes = []
    if row.missing_files:
        notes.append(say("worst_files_missing", n=row.missing_files))
    if not row.complete:
        notes.append(say("partly_read", problem=_about(row)))
    if row.dropped:
        notes.append(say("worst_dropped", n=row.dropped))
    found = row.findings
    not_ok = row.transactions - row.states.get("ok", 0)
    numbers = [found.get(each, 0) for each in SEVERITIES[::-1]]
    shown = [
        options.paint(severity, f"{number:,}") if number else "0"
        for severity, number in zip(SEVERITIES[::-1], numbers, strict=True)
    ]
    told = "  ".join([name, *(each.text(lang) for each in notes)])
    return (*shown, f"{not_ok:,}", f"{row.transactions:,}", told)


def _about(row: CaptureRow) -> Both:
    """The problem without the name in front of it."""
    if not row.problem:
        return say("file_ends_early")
    problem = " ".join(row.problem.split())
    return Both.same(escape(problem.removeprefix(f"{row.path}: ")))


def _rules(summed: dict[str, Any], options: ReportOptions) -> list[str]:
    """The rules without the diagnoses, which are under what to do."""
    found = [each for each in summed["rules"].items() if not each[0].startswith(DIAGNOSIS)]
    if not found:
        return []
    shown = [options.paint("bold", say("findings_head").text(options.lang))]
    for rule, numbers in sorted(found, key=lambda item: (-item[1]["captures"], item[0])):
        about = options.rules.get(rule)
        line = say(
            "rule_in_captures",
            rule=rule,
            name=f" {about.name}" if about else "",
            findings=say("findings", n=numbers["findings"]),
            captures=say("captures", n=numbers["captures"]),
        )
        shown.append(f"  {line.text(options.lang)}")
    return shown


def _sums(summed: dict[str, Any], options: ReportOptions) -> list[str]:
    captures = say(
        "all_captures", n=summed["captures"], captures=say("captures", n=summed["captures"])
    )
    odd = [say(f"all_{key}", n=summed[key]) for key in _ODD if summed[key]]
    work, found = told_sums(summed, "{:,}".format)
    shown = [joined([say("frames", n=summed["frames"]), work]), found]
    if summed["slowest"]:
        time, path = duration(summed["slowest"]["ns"]), escape(summed["slowest"]["path"])
        shown.append(say("slowest", time=time, path=path))
    head = captures.joined(joined(odd), ": ", "：") if odd else captures
    title, *others = (each.text(options.lang) for each in (head, *shown))
    return [options.paint("bold", title), *(f"  {each}" for each in others)]


_ODD = ("quiet", "unreadable", "incomplete")


def told_sums(summed: dict[str, Any], shown: Callable[[int], str]) -> tuple[Both, Both]:
    """How many transactions and findings there are, and of which kinds."""

    def words(key: str, word: str) -> Both:
        return numbered({each: shown(number) for each, number in summed[key].items()}, word)

    states, findings = summed["states"], summed["findings"]
    work = say("transactions", n=sum(states.values()))
    if states:
        split = words("states", "state_").joined(words("operations", "operation_"), "; ", "；")
        work = work.joined(split, ": ", "：")
    found = say("findings", n=sum(findings.values()))
    return work, found.joined(words("findings", "severity_"), ": ", "：") if findings else found


def _in_order(order: Sequence[str], counts: Counter[str]) -> dict[str, int]:
    return {word: counts[word] for word in order if counts[word]}
