"""The summary of captures as one HTML page, a sheet on paper for each (`--summary -f html`).

The whole report as a page is `ds47.report.html`; the look of both is the same.
"""

from __future__ import annotations

from typing import Final

from ds47.report.digests import Digests
from ds47.report.heading import Heading
from ds47.report.html import shell
from ds47.report.summary import station

DRIVES: Final = 4
SCRIPTS: Final = ("base", "page")


class Writer(Digests):
    """Keeps a digest of each capture, and writes the page at the end."""

    def close(self) -> None:
        templates = shell.environment()
        known = {
            **shell.known(templates, self.options.lang, SCRIPTS),
            "heading": self.options.heading or Heading(),
            "all": self,
            "called": shell.names(self.paths),
            "drives": DRIVES,
            "station": station,
        }
        self.stream.write(templates.get_template("digest.html.j2").render(known))
