"""The summary of captures as one HTML page, a sheet on paper for each (`--summary -f html`).

The whole report as a page is `ds47.report.html`; the look of both is the same.
"""

from __future__ import annotations

from typing import Final, TextIO

from ds47.model import CaptureResult
from ds47.report import ReportOptions
from ds47.report import Writer as _Writer
from ds47.report.digests import Digests
from ds47.report.heading import Heading
from ds47.report.html import shell
from ds47.report.summary import about

DRIVES: Final = 8
_SCRIPTS: Final = ("base", "page")


class Writer(_Writer):
    """Keeps a digest of each capture, and writes the page at the end."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._all = Digests(self.options)

    def capture(self, result: CaptureResult) -> None:
        self._all.capture(result)

    def unreadable(self, path: str, problem: str) -> None:
        self._all.unreadable(path, problem)

    def close(self) -> None:
        templates = shell.environment()
        known = {
            **shell.known(templates, self.options.lang, _SCRIPTS, None),
            "heading": self.options.heading or Heading(),
            "all": self._all,
            "called": shell.names(self._all.paths),
            "drives": DRIVES,
            "about": about,
        }
        self.stream.write(templates.get_template("digest.html.j2").render(known))
