"""What the cursor of a drawing reads: all that is known of a drive at each moment, with its frame.

Times are microseconds from the beginning of the capture, texts stand once in a list of their own. What the page
makes of it is in templates/report/timelines.js; where things stand in a drawing is `timelines`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ds47.model import Point, Timeline, Transaction
from ds47.report import timelines
from ds47.report.bilingual import Both
from ds47.report.reference import Reference
from ds47.spec import cyclic

Moment = tuple[int, int | None, int]
"""Microseconds, frame, number of a text."""


@dataclass(frozen=True, slots=True)
class Reach:
    """The times of a drawing, and the time from which those of its readings count: nanoseconds since 1970."""

    start_ns: int
    first_ns: int
    last_ns: int

    def after(self, time_ns: int) -> int:
        """Microseconds from the beginning of the capture; never before the moment itself."""
        return -((self.start_ns - time_ns) // 1000)

    def counts(self, times: Iterable[int]) -> range:
        """Which of these times, in their order, count in the drawing: those inside it, and the one before."""
        listed = list(times)
        first = max(0, sum(each <= self.first_ns for each in listed) - 1)
        return range(first, sum(each <= self.last_ns for each in listed))


class _Texts:
    """Texts in both languages, each once."""

    def __init__(self) -> None:
        self.listed: list[tuple[str, str]] = []
        self._numbers: dict[tuple[str, str], int] = {}

    def number(self, text: Both) -> int:
        key = text.en, text.zh
        if key not in self._numbers:
            self._numbers[key] = len(self.listed)
            self.listed.append(key)
        return self._numbers[key]


def readings(
    timeline: Timeline, jobs: Sequence[tuple[str, Transaction, Both]], reach: Reach,
    reference: Reference | None, frames: dict[int, int],
) -> dict[str, Any]:  # fmt: skip
    """What a drawing can tell, as the page takes it.

    Args:
        timeline: the drive.
        jobs: lane, transaction and words of each job that the drawing shows.
        reach: the times of the drawing.
        reference: what 100 % is; None if unknown.
        frames: time to number, of the frames that the drawing shows one by one.
    """
    texts, rows = _Texts(), timelines.rows(timeline)
    lanes: dict[str, list[list[int | None]]] = {}
    for lane, job, words in jobs:
        begin, took = job.start_ns, job.duration_ns
        end = None if took is None else reach.after(begin + took)
        bar = [reach.after(begin), end, job.id, job.frames.first(), texts.number(words)]
        lanes.setdefault(lane, []).append(bar)
    last = timeline.events[-1].time_ns
    commands = [each for each in rows if each.last.word == "STW1" and each.last.before is not None]
    return {
        "known": [
            reach.after(timeline.events[0].time_ns), reach.after(max(timeline.end_ns or last, last)),
        ],
        "events_until": reach.after(last) if timeline.events_left_out else None,
        "states": _moments(list(_changes(rows)), reach, texts, timelines.standing),
        "commands": _moments(commands, reach, texts, _command),
        "invalid": list(_invalid(timeline, reach, texts)),
        "setpoint": _values(timeline.setpoint, reach, frames),
        "actual": _values(timeline.actual, reach, frames),
        "lanes": sorted(lanes.items()),
        "full": cyclic.full_scale(),
        "reference": [] if reference is None else [list(each) for each in reference.values],
        "texts": texts.listed,
    }  # fmt: skip


def _command(row: timelines.EventRow) -> Both:
    """`ON (STW1 047E -> 047F)`."""
    return timelines.words(row).joined(Both.same(f"({timelines.change(row)})"), " ")


def _changes(rows: Sequence[timelines.EventRow]) -> Iterator[timelines.EventRow]:
    """The rows behind which the state is another one than before."""
    before: Both | None = None
    for row in rows:
        now = timelines.standing(row)
        if now != before:
            yield row
        before = now


def _moments(
    rows: Sequence[timelines.EventRow], reach: Reach, texts: _Texts, words: Any
) -> list[Moment]:
    there = reach.counts(each.last.time_ns for each in rows)
    return [
        (reach.after(each.last.time_ns), each.last.frame, texts.number(words(each)))
        for each in rows[there.start : there.stop]
    ]


def _invalid(timeline: Timeline, reach: Reach, texts: _Texts) -> Iterator[list[int | None]]:
    """From when to when the data of a side is not valid; to None where that lasts."""
    begun: dict[str, list[int | None]] = {}
    for event in timeline.events:
        side, _, what = event.name.partition("-")
        if what == "lost":
            words = Both.of(cyclic.event_text, event.name)
            begun[side] = [reach.after(event.time_ns), None, texts.number(words)]
            yield begun[side]
        elif what == "back" and side in begun:
            begun.pop(side)[1] = reach.after(event.time_ns)


def _values(
    points: Sequence[Point], reach: Reach, frames: dict[int, int]
) -> list[list[int | None]]:
    """Microseconds, least, most, and the frame where the drawing shows each."""
    there = reach.counts(each.time_ns for each in points)
    return [
        [reach.after(each.time_ns), each.least, each.most, frames.get(each.time_ns)]
        for each in points[there.start : there.stop]
    ]
