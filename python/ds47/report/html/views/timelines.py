"""The picture of a drive: its states, commands, speed and parameter jobs on one axis of time, and its events.

Works out where everything stands in a drawing; what it looks like is in templates/report/timelines.html.j2. A
drawing shows the whole capture, a story (some seconds around what was found) or some cycles around one frame.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any

from ds47.cyclic.closeup import SpeedSample, closeup
from ds47.model import (
    S7,
    CaptureResult,
    Event,
    Finding,
    Point,
    Relation,
    Timeline,
    Transaction,
    Value,
)
from ds47.profidrive.naming import spelling
from ds47.report import timelines
from ds47.report.bilingual import operation, state
from ds47.report.clock import Clock
from ds47.report.formatting import parameter
from ds47.report.html.texts import Both, say
from ds47.report.html.views import s7
from ds47.report.html.views.cursor import Reach, readings
from ds47.report.reference import Reference
from ds47.report.s7 import parts as parts_of_s7
from ds47.report.zones import UNIVERSAL
from ds47.spec import cyclic
from ds47.spec.cyclic import OTHERS, family_of_words

LEFT, WIDTH, RIGHT = 124, 880, 12
"""Of a drawing, in its own units: the names of the lanes, the time, and what is free behind it."""
BAND, FLAGS, CURVE, LANE, AXIS = 26, 30, 132, 22, 36
"""Heights: states, commands, speed, one lane of jobs, the axis."""
SHOWN = 200
"""Rows of the table of events."""
STORIES = 6
CYCLES = 40
"""Cycles in the closest drawing."""
_BEFORE_NS, _AFTER_NS = 2_000_000_000, 5_000_000_000
_LETTER = 6
"""Units that a letter takes."""
_FULL = cyclic.full_scale()


@dataclass(frozen=True, slots=True)
class Box:
    """A part of a lane from one position to another."""

    x: float
    width: float
    kind: str
    words: Both
    title: Both
    y: float = 0
    beside: bool = False
    """Whether its words stand behind it: it is too narrow for them."""

    @property
    def has_room(self) -> bool:
        """Whether its words fit into it."""
        return self.width > _LETTER * max(len(self.words.en), 2 * len(self.words.zh)) + 4


@dataclass(frozen=True, slots=True)
class Mark:
    """A command, or a finding, at a position."""

    x: float
    kind: str
    words: Both
    title: Both
    y: float = 0
    silent: bool = False


@dataclass(frozen=True, slots=True)
class Tick:
    """A position on an axis."""

    at: float
    words: str
    clock: str = ""
    """The same as time of day."""


@dataclass(frozen=True, slots=True)
class Lane:
    """The jobs of one station and channel."""

    name: str
    y: float
    boxes: list[Box]


@dataclass(frozen=True, slots=True)
class Drawing:
    """One zoom of a drive."""

    name: Both
    about: Both
    seconds: float
    """Its beginning, from that of the capture, and how long it is."""
    span: float
    bands: list[Box]
    overlays: list[Box]
    hatched: list[Box]
    flags: list[Mark]
    setpoint: str
    actual: str
    spread: str
    """The path around least and greatest actual values."""
    levels: list[Tick]
    lanes: list[Lane]
    times: list[Tick]
    frames: list[float]
    height: float
    readings: dict[str, Any]
    """What the cursor reads (`cursor.readings`)."""


@dataclass(frozen=True, slots=True)
class TimelineView:
    """A drive with its drawings and its events."""

    device: str
    slot: str
    start: str
    """Time of its first event."""
    dated: bool
    """Whether times of day are known."""
    reference: Both | None
    """What 100 % is."""
    drawings: list[Drawing]
    opened: int
    """The drawing that is seen first."""
    rows: list[tuple[int, str, str, str, Both, Both]]
    """Frame, time of day, seconds, the word, what happened, the state."""
    left_out: int


def views(
    result: CaptureResult, given: Reference | None = None, clock: Clock | None = None
) -> list[TimelineView]:
    """The drives of a capture with known words.

    `given` is what 100 % is, if the user said so; `clock` words the times, by default in UTC.
    """
    clock = clock or Clock.of(result, UNIVERSAL)
    return [_view(result, each, given, clock) for each in result.timelines if each.events]


def _view(
    result: CaptureResult, timeline: Timeline, given: Reference | None, clock: Clock
) -> TimelineView:
    relation = result.relations[timeline.relation - 1]
    reference = timelines.reference(result, relation.device, given)
    rows = timelines.rows(timeline)
    canvas = _Canvas(result, timeline, relation, reference, clock)
    drawings, opened = canvas.drawings()
    return TimelineView(
        device=relation.device,
        slot="" if relation.slot is None else f"slot {relation.slot}.{relation.subslot}",
        start=clock.moment(timeline.events[0].time_ns),
        dated=clock.known,
        reference=timelines.reference_words(reference) if reference else None,
        drawings=drawings,
        opened=opened,
        rows=[
            (
                row.last.frame, clock.at(row.last.time_ns), f"{clock.since(row.last.time_ns)} s",
                timelines.change(row), timelines.words(row), timelines.standing(row),
            )
            for row in rows[:SHOWN]
        ],
        left_out=max(0, len(rows) - SHOWN),
    )  # fmt: skip


class _Canvas:
    """What all drawings of a drive have in common."""

    def __init__(
        self, result: CaptureResult, timeline: Timeline, relation: Relation,
        reference: Reference | None, clock: Clock,
    ) -> None:  # fmt: skip
        self.clock = clock
        self.path = result.path
        self.start_ns = result.start_ns or 0
        self.frames: dict[int, int] = {}
        """Times and numbers of all frames of the drive, if all were read."""
        self.reference = reference
        self.timeline = timeline
        self.relation = relation
        makers = (each.vendor for each in result.devices if relation.device in (each.ip, each.mac))
        self.others = family_of_words(next(makers, None)) == OTHERS
        self.events = timeline.events
        self.first_ns = self.events[0].time_ns
        self.last_ns = max(timeline.end_ns or 0, self.events[-1].time_ns, self.first_ns + 1_000_000)
        self.jobs = [
            each
            for each in result.transactions
            if each.device == relation.device and each.channel != S7
        ]
        self.s7 = [
            each
            for each in result.transactions
            if each.channel == S7 and relation.controller in (each.controller, each.device)
        ]
        """Jobs of S7 that the drive's controller asks for, or that others ask of it."""
        self.marked = s7.marked(result) if self.s7 else {}
        self.before = _values_before(self.jobs)
        numbers = {each.id for each in self.jobs}
        self.findings = [each for each in result.findings if self._is_mine(each, numbers)]
        peak = max((abs(v) for each in self._values() for v in (each.least, each.most)), default=0)
        self.top = next((n for n in (25, 50, 100, 150) if peak <= n / 100 * _FULL), 200)
        self.bottom = -self.top if any(v.least < 0 for v in self._values()) else 0

    def _is_mine(self, finding: Finding, numbers: set[int]) -> bool:
        args = finding.args
        own = (args.get("device"), args.get("slot")) == (self.relation.device, self.relation.slot)
        return finding.severity != "note" and (own or finding.transaction in numbers)

    def _values(self) -> Iterator[Point]:
        yield from self.timeline.setpoint
        yield from self.timeline.actual

    def drawings(self) -> tuple[list[Drawing], int]:
        """All of them, and the number of the one that is seen first: the first story."""
        whole = _Drawing(self, self.first_ns, self.last_ns)
        found = [whole.drawn(say("zoom_capture"), say("zoom_capture_about"))]
        for (first, last), findings in self._stories().items():
            rules = ", ".join(each.rule for each in findings)
            about = say("zoom_story_about", rule=rules, frame=str(findings[0].frame))
            found.append(_Drawing(self, first, last).drawn(Both.same(rules), about))
        stories = len(found)
        if self.findings and self.relation.cycle_ms is not None:
            found.append(self._cycles(self.findings[0].frame, self.relation.cycle_ms))
        return found, 1 if stories > 1 else 0

    def _cycles(self, frame: int, cycle_ms: float) -> Drawing:
        """Some cycles around a frame: all frames that the file has there, else those that were looked at."""
        half = round(CYCLES / 2 * cycle_ms * 1e6)
        seen = closeup(self.path, self.relation, frame, 2 * half, others=self.others)
        moment = next((each.time_ns for each in seen if each.frame == frame), self._time(frame))
        canvas = self
        if seen:
            canvas = copy(self)
            canvas.frames = {each.time_ns: each.frame for each in seen}
            canvas.timeline = replace(
                self.timeline,
                setpoint=_points(seen, self.timeline.setpoint, by_controller=True),
                actual=_points(seen, self.timeline.actual, by_controller=False),
            )
        about = say("zoom_frames_about" if seen else "zoom_cycles_about", n=CYCLES)
        first = max(self.first_ns, moment - half)
        return _Drawing(canvas, first, first + 2 * half).drawn(say("zoom_cycles"), about)

    def _stories(self) -> dict[tuple[int, int], list[Finding]]:
        """The findings with a story, one of each rule, by its time: several may have the same."""
        first: dict[str, Finding] = {}
        for each in self.findings:
            first.setdefault(each.rule, each)
        found: dict[tuple[int, int], list[Finding]] = {}
        for each in sorted(first.values(), key=lambda each: each.frame):
            found.setdefault(self._story(each), []).append(each)
        return dict(list(found.items())[:STORIES])

    def _time(self, frame: int) -> int:
        """The time of a frame, as near as an event or a job tells it."""
        known = [(each.frame, each.time_ns) for each in self.events]
        known += [(each.frames.first(), each.start_ns) for each in self.jobs]
        return min(known, key=lambda each: abs(each[0] - frame))[1]

    def _story(self, finding: Finding) -> tuple[int, int]:
        """From before the change of state that precedes a finding to after the one that follows it."""
        at = self._time(finding.frame)
        edges = [
            now for before, now in itertools.pairwise(self.events) if now.state != before.state
        ]
        cause = [each.time_ns for each in edges if each.time_ns < at]
        effect = [each.time_ns for each in edges if each.time_ns > at]
        first = max(self.first_ns, (cause[-1] if cause else self.first_ns) - _BEFORE_NS)
        last = min(self.last_ns, (effect[0] if effect else at) + _AFTER_NS)
        return first, max(last, first + 100_000_000)


def _points(
    seen: Sequence[SpeedSample], known: Sequence[Point], *, by_controller: bool
) -> list[Point]:
    """The values of one side; none where they are no speed."""
    sent = [each for each in seen if each.by_controller == by_controller] if known else []
    return [Point(each.time_ns, each.raw, each.raw) for each in sent]


class _Drawing:
    """One drawing: from one time to another."""

    def __init__(self, canvas: _Canvas, first_ns: int, last_ns: int) -> None:
        self.canvas = canvas
        self.first_ns, self.last_ns = first_ns, max(last_ns, first_ns + 1)

    def drawn(self, name: Both, about: Both) -> Drawing:
        """Everything in its place."""
        lanes = self._lanes(BAND + FLAGS + CURVE)
        height = BAND + FLAGS + CURVE + LANE * len(lanes) + AXIS
        spans, top, bottom = list(self._spans()), self.canvas.top, self.canvas.bottom
        parts = sorted({bottom, bottom // 2, 0, top // 2, top})
        return Drawing(
            name=name, about=about, seconds=(self.first_ns - self.canvas.start_ns) / 1e9,
            span=(self.last_ns - self.first_ns) / 1e9,
            bands=[self._band(*each) for each in spans],
            overlays=list(self._overlays(spans)),
            hatched=list(self._hatched()),
            flags=self._flags(),
            setpoint=self._line(self.canvas.timeline.setpoint, step=True),
            actual=self._line(self.canvas.timeline.actual),
            spread=self._spread(self.canvas.timeline.actual),
            levels=[Tick(self._level(part), self._percent(part)) for part in parts],
            lanes=lanes,
            times=[
                Tick(self._x(at), label, self.canvas.clock.time_of_day(at))
                for at, label in self._times()
            ],
            frames=self._ticks(),
            height=height,
            readings=self._readings(),
        )  # fmt: skip

    def _x(self, time_ns: int) -> float:
        share = (time_ns - self.first_ns) / (self.last_ns - self.first_ns)
        return round(LEFT + WIDTH * min(1.0, max(0.0, share)), 2)

    def _is_seen(self, time_ns: int) -> bool:
        return self.first_ns <= time_ns <= self.last_ns

    # States

    def _spans(self) -> Iterator[tuple[Event, int, int]]:
        """From each event to the next one: what the drive's state was meanwhile."""
        events = self.canvas.events
        ends = [each.time_ns for each in events[1:]] + [self.canvas.last_ns]
        for event, end in zip(events, ends, strict=True):
            if end > self.first_ns and event.time_ns < self.last_ns and end > event.time_ns:
                yield event, event.time_ns, end

    def _band(self, event: Event, first: int, last: int) -> Box:
        name = event.state or ""
        kind = {"not ready": "none", "": "none"}.get(name, name)
        if event.state is None:
            words = title = Both.same("")
        else:
            words = Both.same(name) if name.startswith("S") else Both.same("-")
            title = Both.of(cyclic.state_text, name, event.overlays)
        return self._box(first, last, kind, words, title)

    def _box(self, first: int, last: int, kind: str, words: Both, title: Both, y: float = 0) -> Box:
        x, end = self._x(first), self._x(last)
        return Box(x, round(max(end - x, 0.6), 2), kind, words, title, y)

    def _overlays(self, spans: Sequence[tuple[Event, int, int]]) -> Iterator[Box]:
        order = [row.id for row in cyclic.overlays()]
        for event, first, last in spans:
            for name in event.overlays:
                words = Both.of(cyclic.overlay_text, name)
                yield self._box(first, last, name, words, words, 4.0 * order.index(name))

    def _hatched(self) -> Iterator[Box]:
        """Where the data of one side is not valid."""
        begun: dict[str, int] = {}
        for event in self.canvas.events:
            side, _, what = event.name.partition("-")
            if what == "lost":
                begun[side] = event.time_ns
            elif what == "back" and side in begun:
                yield self._invalid(begun.pop(side), event.time_ns, side)
        for side, first in begun.items():
            yield self._invalid(first, self.canvas.last_ns, side)

    def _invalid(self, first: int, last: int, side: str) -> Box:
        words = Both.of(cyclic.event_text, f"{side}-lost")
        return self._box(first, last, "invalid", words, words)

    def _flags(self) -> list[Mark]:
        """The commands of the controller, those of one frame together; words where there is room."""
        found: list[Mark] = []
        busy = -1000.0
        for row in timelines.rows(self.canvas.timeline):
            if (
                row.last.word != "STW1"
                or row.last.before is None
                or not self._is_seen(row.last.time_ns)
            ):
                continue
            x = self._x(row.last.time_ns)
            title = timelines.words(row).joined(
                Both.same(f"{timelines.change(row)}, frame {row.last.frame}"), ": ", "："
            )
            first = row.events[0]
            kind = (
                "off" if first.name.startswith("off") else "on" if first.name == "on" else "other"
            )
            words = Both.of(cyclic.event_text, first.name)
            silent = x < busy
            busy = busy if silent else x + _LETTER * (len(words.en) + 2)
            found.append(Mark(x, kind, words, title, silent=silent))
        return found

    # Speed

    def _level(self, percent: float) -> float:
        share = (percent - self.canvas.bottom) / (self.canvas.top - self.canvas.bottom)
        return round(BAND + FLAGS + CURVE - 6 - share * (CURVE - 12), 2)

    def _percent(self, part: int) -> str:
        """`+50 %`, or what that is."""
        reference = self.canvas.reference
        if reference is not None and reference.values[0][1]:
            return reference.shown(part)
        return f"{part:+d} %" if part else "0 %"

    def _points(self, points: Sequence[Point]) -> list[Point]:
        """Those that are seen, with one before and one behind."""
        inside = [n for n, each in enumerate(points) if self._is_seen(each.time_ns)]
        if not inside:
            before = [each for each in points if each.time_ns < self.first_ns]
            return [before[-1], before[-1]._replace(time_ns=self.last_ns)] if before else []
        return list(points[max(0, inside[0] - 1) : inside[-1] + 2])

    def _line(self, points: Sequence[Point], step: bool = False) -> str:
        path, before = "", 0.0
        for each in self._points(points):
            x, y = self._x(each.time_ns), self._level((each.least + each.most) / 2 / _FULL * 100)
            path += (f"H{x}" if step and path else "") + f"{'L' if path else 'M'}{x} {y}"
            before = x
        return path + (f"H{LEFT + WIDTH}" if path and step and before < LEFT + WIDTH else "")

    def _spread(self, points: Sequence[Point]) -> str:
        seen = self._points(points)
        if all(each.least == each.most for each in seen):
            return ""
        upper = [f"{self._x(p.time_ns)} {self._level(p.most / _FULL * 100)}" for p in seen]
        lower = [
            f"{self._x(p.time_ns)} {self._level(p.least / _FULL * 100)}" for p in reversed(seen)
        ]
        return "M" + "L".join(upper + lower) + "Z"

    # Jobs and time

    def _lanes(self, y: float) -> list[Lane]:
        found: dict[str, list[Transaction]] = {}
        for name, job in self._seen_jobs():
            found.setdefault(name, []).append(job)
        return [
            Lane(name, y + LANE * n, list(self._jobs(jobs)))
            for n, (name, jobs) in enumerate(sorted(found.items()))
        ]

    def _seen_jobs(self) -> Iterator[tuple[str, Transaction]]:
        """Lane and transaction of each job of these times."""
        for job in (*self.canvas.jobs, *self.canvas.s7):
            end = job.start_ns + (job.duration_ns or 0)
            if end >= self.first_ns and job.start_ns <= self.last_ns:
                yield f"{job.channel.upper()} {job.controller}", job

    def _readings(self) -> dict[str, Any]:
        canvas = self.canvas
        reach = Reach(canvas.start_ns, self.first_ns, self.last_ns)
        jobs = [
            (lane, job, operation(job.operation).joined(Both(_long(job, "en"), _long(job, "zh"))))
            for lane, job in self._seen_jobs()
        ]
        return readings(canvas.timeline, jobs, reach, canvas.reference, canvas.frames)

    def _jobs(self, jobs: Sequence[Transaction]) -> Iterator[Box]:
        """One after the other; what is too narrow for its words has them behind it, where nothing else is."""
        boxes = [self._job(each) for each in sorted(jobs, key=lambda each: each.start_ns)]
        ends = [each.x for each in boxes[1:]] + [float(LEFT + WIDTH)]
        for box, end in zip(boxes, ends, strict=True):
            room = end - box.x - box.width
            yield replace(box, beside=not box.has_room and room > _LETTER * len(box.words.en) + 8)

    def _job(self, job: Transaction) -> Box:
        words = Both.same(_short(job, self.canvas.before.get(job.id)))
        end = job.start_ns + max(job.duration_ns or 0, 1)
        title = Both(f"#{job.id} {_long(job, 'en')}", f"#{job.id} {_long(job, 'zh')}")
        mark = self.canvas.marked.get(job.id)
        kind = mark or ("ok" if job.state == "ok" else "bad")
        if mark:
            title = title.joined(say(s7.WORDS[mark]), ": ", "：")
        box = self._box(job.start_ns, end, kind, words, title)
        return replace(box, width=max(box.width, 3))

    def _times(self) -> Iterator[tuple[int, str]]:
        """Round times on the axis, counted from the beginning of the capture."""
        span = self.last_ns - self.first_ns
        step = next(each for each in _STEPS if span / each <= 9 or each == _STEPS[-1])
        digits = max(0, 9 - len(str(step)) + len(str(step).rstrip("0")))
        at = (self.first_ns - self.canvas.start_ns) // step * step + step
        while at + self.canvas.start_ns <= self.last_ns:
            yield at + self.canvas.start_ns, f"{at / 1e9:.{digits}f} s"
            at += step

    def _ticks(self) -> list[float]:
        """The frames, or the sampled ones, if single ones can be distinguished."""
        relation = self.canvas.relation
        if (
            relation.cycle_ms is None
            or (self.last_ns - self.first_ns) / 1e6 > 3 * CYCLES * relation.cycle_ms
        ):
            return []
        times = list(self.canvas.frames) or [each.time_ns for each in self.canvas.timeline.actual]
        return [self._x(each) for each in times if self._is_seen(each)]


_STEPS = [n * 10**power for power in range(6, 13) for n in (1, 2, 5)]


def _values_before(jobs: Sequence[Transaction]) -> dict[int, Value]:
    """The old value of the first parameter of a change, by the id of the job, if the capture shows it."""
    newest: dict[tuple[int, int | None, int | None], Value] = {}
    found: dict[int, Value] = {}
    for job in sorted(jobs, key=lambda each: each.start_ns):
        for number, each in enumerate(job.parameters):
            key = job.axis or 0, each.pnu, each.subindex
            if job.operation == "change" and number == 0 and key in newest:
                found[job.id] = newest[key]
            if each.values and each.error is None and job.state in ("ok", "partial"):
                newest[key] = each.values[0]
    return found


def _plain(value: Value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _short(job: Transaction, before: Value | None = None) -> str:
    """`p0304 = 50`, `p0304 10 -> 50`, or the number of the error."""
    if job.channel == S7 and job.items:
        return job.items[0].address or f"R_ID {job.r_id or 0:08X}"
    if not job.parameters:
        return ""
    first = job.parameters[0]
    number = "p?" if first.pnu is None else spelling(first.pnu, first.family)
    if first.error is not None:
        return f"{number}: {first.error.number or '?'}"
    if not first.values:
        return number
    unit = "" if first.scaled else first.unit or ""  # that of the scaled value
    value = f"{_plain(first.values[0])} {unit}".rstrip()
    if job.operation != "change":
        return f"{number} = {value}"
    return f"{number} := {value}" if before is None else f"{number} {_plain(before)} -> {value}"


def _long(job: Transaction, lang: str) -> str:
    if job.channel == S7:
        return f"{'; '.join(parts_of_s7(job, lang)[:4])} [{state(job.state).text(lang)}]"
    written = job.operation == "change"
    parts = "; ".join(parameter(each, written, lang) for each in job.parameters[:4])
    return f"{parts} [{state(job.state).text(lang)}]"
