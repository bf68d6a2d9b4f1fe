"""A difference between two captures as one HTML page, in the look of the report: it opens offline and prints.

Words come from `difference_words`, points from `points`; the page is templates/difference.html.j2, its plots are
templates/report/difference.js.
"""

from __future__ import annotations

from typing import Any

from ds47 import spec
from ds47.regression import difference_words as told
from ds47.regression.conclusions import Conclusion, conclusions
from ds47.regression.difference import Difference
from ds47.regression.points import durations, elements
from ds47.report.bilingual import say, state
from ds47.report.html import plots, shell

SCRIPTS = (
    "base",
    "clock",
    "data",
    "table",
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
    plotted = {"durations": durations(found), "elements": _elements(found, otherwise)}
    library = plots.library() if any(plotted.values()) else None
    known = {
        **shell.known(templates, lang, SCRIPTS, library),
        "found": found,
        "everything": everything,
        "verdict": told.verdict(found),
        "level": level(found, otherwise),
        "concluded": [(each.level, told.conclusion_text(each, found)) for each in otherwise],
        "first": told.CONCLUSIONS,
        "plotted": plotted,
        "sections": told.sections(found),
        "rest": told.rest(found),
        "notes": told.notes(found),
        "rules": spec.rules(),
        "words_of": say,
        "state": state,
        "operation": told.asked,
        "changed": told.changed,
        "rest_text": told.rest_text,
        "parameter_text": told.parameter_text,
        "side_text": lambda run, side: told.side_text(run, side, found),
        "shift_text": told.shift_text,
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
            "label": told.parameter_text(told.ElementRun((each["row"],))),
            "name": told.element_text(told.ElementRun((each["row"],))),
            "unit": each["unit"],
            "a": each["a"],
            "b": each["b"],
        }
        for each in elements(otherwise, found)
    ]
