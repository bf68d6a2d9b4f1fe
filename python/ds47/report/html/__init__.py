"""Report as one HTML file: opens offline, on a phone, on paper; nothing is fetched, ever.

This module assembles the page. `views` and `verdict` work out its content, `texts.toml` has its words.
templates/report.html.j2 and the partials, style and scripts in templates/report/ define its looks. `embed` makes
text and data safe for a page.
"""

from __future__ import annotations

from functools import partial
from typing import Any, TextIO

from ds47.model import CaptureResult
from ds47.report import ReportOptions
from ds47.report import Writer as _Writer
from ds47.report.clock import Clock
from ds47.report.heading import Heading
from ds47.report.html import shell
from ds47.report.html.texts import say
from ds47.report.html.views import (
    CaptureView,
    Overview,
    capture_view,
    timelines,
    to_do,
    worst_first,
)  # fmt: skip
from ds47.report.html.views.problems import FIRST_SCREEN
from ds47.report.overview import times_of
from ds47.report.verdict import KINDS, LEVELS
from ds47.report.zones import UNIVERSAL, Zone

ROWS = 100_000
"""The most transactions on a page; failed ones come first, and the page says so."""
ROWS_EACH = 500
"""Transactions that each capture may list, even if the captures before it used up ROWS."""
DETAILED = 40
"""The most captures shown in detail; the worst ones win. The overview has all of them."""
PRINTED = 8
"""Findings of one rule that are printed on paper."""
DRIVES = 250
"""The most drives that a page lists for one capture."""
SCRIPTS = (
    "base",
    "clock",
    "data",
    "table",
    "message",
    "sequence",
    "transactions",
    "parameters",
    "trail",
    "overview",
    "chart",
    "plots",
    "plot_marks",
    "cursor",
    "timelines",
    "page",
)
"""The files of templates/report/ that form the script of the page, in this order."""


class Writer(_Writer):
    """Turns each capture into its part of the page, and drops the rest."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self.lang = "zh" if getattr(self.options, "lang", "en") == "zh" else "en"
        self._overview: list[Overview] = []
        self._views: list[CaptureView] = []
        self._rows_left = ROWS

    def capture(self, result: CaptureResult) -> None:
        number = len(self._overview) + 1
        most_rows = max(ROWS_EACH, self._rows_left)
        options = self.options
        view = capture_view(result, number, most_rows, options.reference, options.zone)
        self._rows_left -= view.rows
        self._overview.append(view.overview)
        self._views.append(view)
        if len(self._views) > DETAILED:
            self._views.remove(max(self._views, key=lambda each: worst_first(each.overview)))

    def unreadable(self, path: str, problem: str) -> None:
        self._overview.append(Overview.unreadable(path, len(self._overview) + 1, problem))

    def close(self) -> None:
        heading, zone = self.options.heading, self.options.zone
        self.stream.write(page(self._overview, self._views, self.lang, heading, zone))


def page(
    overview: list[Overview], views: list[CaptureView], lang: str, heading: Heading | None = None,
    zone: Zone = UNIVERSAL,
) -> str:  # fmt: skip
    """The whole page as text."""
    templates = shell.environment()
    called = shell.names([each.path for each in overview])
    page_of: dict[str, Any] = {
        "called": called,
        **shell.known(templates, lang, SCRIPTS),
        "heading": heading or Heading(),
        "zone": Clock(zone, next((each.row.start_ns for each in overview), None)).zone_name,
        "times_of": partial(times_of, zone=zone),
        "printed": PRINTED,
        "levels": LEVELS,
        "kinds": KINDS,
        "overview": sorted(overview, key=worst_first),
        "to_do": to_do(overview, called),
        "first_screen": FIRST_SCREEN,
        "total": overview[0] if len(overview) == 1 else Overview.of_all(overview),
        "alone": len(overview) == len(views) == 1,
        "views": sorted(views, key=lambda each: worst_first(each.overview)),
        "most_drives": DRIVES,
        "words_of": say,
        "left": timelines.LEFT,
        "width": timelines.WIDTH,
        "right": timelines.RIGHT,
        "band": timelines.BAND,
        "flags": timelines.FLAGS,
        "curve": timelines.CURVE,
    }
    return str(templates.get_template("report.html.j2").render(page_of))
