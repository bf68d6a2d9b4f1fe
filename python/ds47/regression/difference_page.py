"""A difference between two captures as one HTML page, in the look of the report: it opens offline and prints.

Words come from `difference_words`, points from `points`; the page is templates/difference.html.j2, its plots are
templates/report/difference.js.
"""

from __future__ import annotations

from typing import Any

from ds47 import spec
from ds47.regression import difference_words as words
from ds47.regression.conclusions import Conclusion, conclusions
from ds47.regression.difference import Difference
from ds47.regression.points import durations, elements
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
