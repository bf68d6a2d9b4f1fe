"""What the page of a difference plots: durations, and values that differ, of both captures on one axis.

Times are seconds since the first transaction of each capture, so that two runs of one machine lie upon each other.
A `Difference` in, plain lists out; how they are drawn is in templates/report/difference.js.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from math import isfinite
from typing import Any, Final

from ds47.regression.conclusions import Conclusion
from ds47.regression.difference import Difference, ElementDifference
from ds47.regression.elements import Outcomes

MOST_POINTS: Final = 3000
"""Points of one series; of more, evenly spread ones are taken, the first and the last among them."""
MOST_ELEMENTS: Final = 200
"""Elements that a page can plot."""

Points = list[tuple[float, float]]


def durations(found: Difference) -> list[dict[str, Any]]:
    """For each device and operation: its durations in milliseconds over time, in both captures."""
    return [
        {
            "device": each.device,
            "operation": each.operation,
            "a": _points(each.points[0], found.starts[0]),
            "b": _points(each.points[1], found.starts[1]),
        }
        for each in found.latencies
    ]


def elements(concluded: Iterable[Conclusion], found: Difference) -> list[dict[str, Any]]:
    """Values over time of the elements that conclusions speak of and that have numbers, in their order."""
    rows = (row for each in concluded for row in each.rows)
    all_ = (_element(row, found) for row in rows)
    return [each for each in all_ if each["a"] or each["b"]][:MOST_ELEMENTS]


def _element(row: ElementDifference, found: Difference) -> dict[str, Any]:
    sides = zip((row.a, row.b), found.starts, strict=True)
    a, b = (_values(*side) for side in sides)
    return {"row": row, "unit": row.unit or "", "a": a, "b": b}


def _values(side: Outcomes | None, start: str | None) -> Points:
    numbers = [] if side is None else [
        (time, float(value))
        for time, value in side.history
        if isinstance(value, int | float) and isfinite(value)
    ]  # fmt: skip
    return _points(numbers, start)


def _points(of: list[tuple[str | None, float]], start: str | None) -> Points:
    """Seconds since `start` and what was there then; those without a time are left out."""
    zero = _seconds(start)
    timed = [(_seconds(time), value) for time, value in of]
    known = sorted(
        (time - zero, value) for time, value in timed if time is not None and zero is not None
    )
    if len(known) <= MOST_POINTS:
        return known
    step = (len(known) - 1) / (MOST_POINTS - 1)
    return [known[round(number * step)] for number in range(MOST_POINTS)]


def _seconds(text: str | None) -> float | None:
    """A time of the JSON report, as seconds; None where it is none."""
    try:
        return datetime.fromisoformat(text).timestamp() if isinstance(text, str) else None
    except (ValueError, OverflowError):
        return None
