"""What each part of the page shows of a capture, as plain data for the templates and the script.

`problems`: what went wrong and what to do. `findings`: by rule. `drives`: who is who. `elements`:
parameter by parameter. `rows`: the transactions for the script. Here they are put together.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from markupsafe import Markup

from ds47.model import CaptureResult
from ds47.report import buffers, bus, causes, json
from ds47.report.clock import Clock
from ds47.report.expected import expected_words
from ds47.report.formatting import escape
from ds47.report.html import messages
from ds47.report.html.embed import data_element
from ds47.report.html.texts import Both, say
from ds47.report.html.verdict import VerdictLine, quality
from ds47.report.html.views import timelines
from ds47.report.html.views.drives import DriveView, drives
from ds47.report.html.views.elements import elements
from ds47.report.html.views.events import events
from ds47.report.html.views.findings import Group, groups
from ds47.report.html.views.links import Links
from ds47.report.html.views.problems import Problem, first_screen, problems
from ds47.report.html.views.rows import packed_rows
from ds47.report.html.views.s7 import S7View
from ds47.report.html.views.timelines import TimelineView
from ds47.report.html.views.times import FrameClock, for_script
from ds47.report.html.views.trail import TrailView
from ds47.report.latency import percentile
from ds47.report.narrowing import narrowed_words
from ds47.report.overview import CaptureRow
from ds47.report.reference import Reference
from ds47.report.targets import Targets
from ds47.report.verdict import KINDS, LEVELS, VerdictCounts, blind, verdict
from ds47.report.zones import UNIVERSAL, Zone


@dataclass(slots=True)
class Overview:
    """A capture in one line, or all of them."""

    path: str
    number: int
    counts: VerdictCounts
    row: CaptureRow
    """What the overview of every other format says of it."""
    quality: str = "good"
    """The worst level of its quality."""
    problem: str | None = None
    """Why nothing of it could be read."""

    @property
    def text(self) -> Both:
        """The verdict."""
        if self.problem is not None:
            return say("not_readable", problem=escape(self.problem))
        return verdict(self.counts)

    @property
    def level(self) -> str:
        """How serious it is, one of `verdict.LEVELS`."""
        return "bad" if self.problem is not None else self.counts.level

    @classmethod
    def unreadable(cls, path: str, number: int, problem: str) -> Overview:
        """A capture of which nothing could be read."""
        row = CaptureRow.unreadable(path, problem)
        return cls(path, number, VerdictCounts(captures=1, unreadable=1), row, "bad", problem)

    @classmethod
    def of_all(cls, parts: Iterable[Overview]) -> Overview:
        """The sum over all captures."""
        total = cls("", 0, VerdictCounts(), CaptureRow(""))
        for part in parts:
            total.counts.add(part.counts)
        return total


@dataclass(frozen=True, slots=True)
class ToDo:
    """A cause over all captures; `number` is that of the first capture that has it."""

    severity: str
    headline: Both
    advice: Both
    first: Both
    number: int


class BusView(NamedTuple):
    """The stations of PROFIBUS, as `report.bus` words them."""

    counts: Both
    head: list[Both]
    numbers: int
    """The first column with numbers,"""
    faults: list[int]
    """and those that are 0 on a healthy line."""
    rows: list[list[Both]]
    diagnoses: list[Both]

    @classmethod
    def of(cls, result: CaptureResult) -> BusView | None:
        """Those of a capture; None on PROFINET."""
        line = result.bus
        if line is None:
            return None
        return cls(
            bus.counts(line),
            bus.head(),
            bus.COLUMNS.index("requests"),
            [bus.COLUMNS.index(each) for each in ("unanswered", "damaged", "retries")],
            list(bus.rows(line)),
            [*bus.diagnoses(line), *bus.hints(line, result.relations)],
        )


class BufferView(NamedTuple):
    """A buffer of faults or alarms, as `report.buffers` words it."""

    head: Both
    rows: list[list[Both]]


@dataclass(slots=True)
class CaptureView:
    """All that the page shows of one capture; its transactions are in `data`."""

    overview: Overview
    sha256: str | None
    span: Both | None
    narrowed: Both | None
    expected: Both | None
    dated: bool
    """Whether times of day are known."""
    clock: str
    """What the script says times by."""
    quality: list[VerdictLine]
    blind: list[Both]
    drives: list[DriveView]
    problems: list[Problem]
    problems_left_out: int
    groups: list[Group]
    trail: TrailView
    rows: int
    jobs: int
    elements: int
    elements_left_out: int
    bus: BusView | None
    s7: S7View | None
    buffers: list[BufferView]
    timelines: list[TimelineView]
    plots: bool
    median: int | None
    slowest: int | None
    data: Markup = field(repr=False)


def capture_view(
    result: CaptureResult, number: int, most_rows: int, reference: Reference | None = None,
    zone: Zone = UNIVERSAL,
) -> CaptureView:  # fmt: skip
    """What the page shows of a capture, with at most so many of its transactions.

    `reference` is what 100 % of a setpoint is, if given; `zone` the time zone.
    """
    clock = Clock.of(result, zone)
    moments = FrameClock(result, clock)
    links = Links(result)
    found = groups(result, moments, links)
    targets = Targets(result.evidence)
    table, left_out = elements(result, targets)
    data = packed_rows(result, most_rows, targets)
    data["elements"] = table
    trail = TrailView(result, targets, {row[0] for row in data["rows"]})
    data["trail"] = trail.data
    data["messages"] = _by_transaction(found)
    counts = VerdictCounts.of(result, zone)
    data["totals"] = {"transactions": counts.jobs, "states": counts.states}
    data["kinds"] = KINDS
    data["events"] = events(result, targets)
    remarks = quality(result)
    worst = max((LEVELS.index(each.level) for each in remarks), default=0)
    wrong = problems(result, targets, moments, links)
    first = first_screen(wrong)
    unseen = [] if result.timelines else [say("blind_cyclic")]
    durations = sorted(
        each.duration_ns
        for each in result.transactions
        if each.duration_ns is not None and each.duration_ns >= 0
    )
    return CaptureView(
        overview=Overview(
            result.path, number, counts, CaptureRow.of(result, counts), LEVELS[worst]
        ),
        sha256=result.sha256,
        span=clock.span(result),
        narrowed=None if result.narrowed is None else narrowed_words(result),
        expected=None if result.expected is None else expected_words(result.expected),
        dated=clock.known,
        clock=json.text(for_script(clock)),
        quality=remarks,
        blind=[*blind(result), say("blind_place"), *unseen, say("blind_meaning")],
        drives=drives(result, targets),
        problems=first,
        problems_left_out=len(wrong) - len(first),
        groups=found,
        trail=trail,
        rows=len(data["rows"]),
        jobs=len(result.transactions),
        elements=len(table["rows"]),
        elements_left_out=left_out,
        bus=BusView.of(result),
        s7=S7View.of(result),
        buffers=[
            BufferView(buffers.head(each), buffers.rows(each))
            for each in buffers.buffers(result, targets)
        ],
        timelines=timelines.views(result, reference, clock),
        plots=bool(result.transactions),
        median=percentile(durations, 50) if durations else None,
        slowest=durations[-1] if durations else None,
        data=data_element(f"data-{number}", data),
    )


def _by_transaction(found: list[Group]) -> dict[int, list[list[Any]]]:
    """What the findings that are listed say about each transaction."""
    messages: dict[int, list[list[Any]]] = {}
    for group in found:
        for each in group.shown:
            if each.transaction is not None:
                line = [group.rule, each.frame, *each.message, each.others]
                messages.setdefault(each.transaction, []).append(line)
    return messages


def worst_first(item: Overview) -> tuple[tuple[bool | int | str, ...], int]:
    """Sorts as every other overview does; what is equal stays as it came."""
    return item.row.badness(), item.number


def to_do(items: Iterable[Overview], called: Mapping[str, str]) -> list[ToDo]:
    """What to do over all captures, as every other overview says it; `called` has their names."""
    captures = list(items)
    numbers = {each.path: each.number for each in reversed(captures)}
    return [
        ToDo(
            each["severity"],
            causes.headline(each, messages.rule_name(each["rule"])),
            messages.advice(each["rule"]),
            causes.first_case(each["first"] | {"path": called[each["first"]["path"]]}),
            numbers[each["first"]["path"]],
        )
        for each in causes.over_all((each.path, each.row.diagnoses) for each in captures)
    ]
