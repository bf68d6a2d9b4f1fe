"""A difference between two captures as one HTML page, in the look of the report: it opens offline and prints.

Words come from `difference_words`, points from `points`; the page is templates/difference.html.j2, its plots are
templates/report/difference.js.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from math import isfinite
from typing import Any, Final

from ds47 import spec
from ds47.regression import difference_words as words
from ds47.regression.conclusions import Conclusion, conclusions
from ds47.regression.difference import Difference, ElementDifference
from ds47.regression.elements import Outcomes
from ds47.report.bilingual import say, state
from ds47.report.html import shell

SCRIPTS = (
    "base",
    "clock",
    "data",
    "table",
    "chart",
    "plots",
    "plot_marks",
    "difference",
    "cursor",
    "timelines",
    "page",
)
"""The files of templates/report/ that make the script of the page, in this order."""


def page(found: Difference, lang: str = "en", *, everything: bool = False) -> str:
    """The whole page as text.

    Args:
        found: what differs.
        lang: "en" or "zh", the language that shows first.
        everything: open also what was not compared.
    """
    templates = shell.environment()
    otherwise = conclusions(found)
    called = shell.names(found.names)
    plotted = {"durations": durations(found), "elements": _elements(found, otherwise)}
    known = {
        **shell.known(templates, lang, SCRIPTS),
        "found": found,
        "called": [called[path] for path in found.names],
        "everything": everything,
        "verdict": words.verdict(found),
        "level": level(found, otherwise),
        "concluded": [(each.level, words.conclusion_text(each, found)) for each in otherwise],
        "first": words.CONCLUSIONS,
        "plotted": plotted,
        "sections": words.sections(found),
        "rest": words.rest(found),
        "notes": words.notes(found),
        "rules": spec.rules(),
        "words_of": say,
        "state": state,
        "operation": words.asked,
        "changed": words.changed,
        "rest_text": words.rest_text,
        "parameter_text": words.parameter_text,
        "side_text": lambda run, side: words.side_text(run, side, found),
        "shift_text": words.shift_text,
    }
    return str(templates.get_template("difference.html.j2").render(known))


def level(found: Difference, otherwise: list[Conclusion]) -> str:
    """That of the worst conclusion; "good" where nothing differs, nothing where there is nothing to compare."""
    lights = {each.level for each in otherwise}
    for each in ("bad", "warn"):
        if each in lights:
            return each
    return "good" if found.compared and not found.different else ""


def _elements(found: Difference, otherwise: list[Conclusion]) -> list[dict[str, Any]]:
    return [
        {
            "label": words.parameter_text(words.ElementRun((each["row"],))),
            "name": words.element_text(words.ElementRun((each["row"],))),
            "unit": each["unit"],
            "a": each["a"],
            "b": each["b"],
        }
        for each in elements(otherwise, found)
    ]


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
