"""The plotting library inside the page: BokehJS, as the Python package bokeh ships it.

The package is looked up, never imported (that would take a second, and numpy), and it may be
missing: the page then says so and has no plots. It stands in the page once, packed; the browser
unpacks it when plots come into view. What is plotted is in templates/report/plots.js.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ds47.report.html.embed import packed_element

_FILES = ("bokeh.min.js", "bokeh-api.min.js")
_SOURCE_MAP = re.compile(r"^//# sourceMappingURL=.*$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Library:
    """The scripts of the library with the elements that carry them."""

    name: str
    scripts: tuple[str, ...]
    elements: Markup


@cache
def library() -> Library | None:
    """The library, None where it is not installed."""
    found = find_spec("bokeh")
    if found is None or not found.submodule_search_locations:
        return None
    folder = Path(next(iter(found.submodule_search_locations)), "server", "static", "js")
    try:
        name = f"Bokeh {version('bokeh')}"
        scripts = tuple(_script(found.loader, folder / each) for each in _FILES)
    except (OSError, PackageNotFoundError):
        return None
    elements = Markup("").join(
        packed_element(f"library-{number}", script) for number, script in enumerate(scripts)
    )
    return Library(name, scripts, elements)


def _script(loader: Any, path: Path) -> str:
    """A script, also out of a zip file, without the line that would make developer tools look for another file."""
    return _SOURCE_MAP.sub("", loader.get_data(str(path)).decode("utf-8"))
