"""What every page of ours begins with: its look, its script, its policy and its words, as the templates name them.

What a page is about is not known here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import PurePath
from typing import Any

from ds47.report.formatting import count, duration, escape
from ds47.report.html import embed
from ds47.report.html.texts import PageWords
from ds47.version import __version__

_FOLDER = "report"


@cache
def environment() -> Any:
    """The templates, with the filters that they use; made once, because it keeps what it has compiled.

    Each is filled in once a page: to look for constants in it takes longer than it saves.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined  # only for pages

    found = Environment(
        loader=PackageLoader("ds47.report"), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, optimized=False,
    )  # fmt: skip
    found.filters |= {"shown": escape, "duration": duration, "size": count}
    return found


def known(templates: Any, lang: str, scripts: Sequence[str]) -> dict[str, Any]:
    """The names that a template of a whole page has.

    Args:
        templates: the environment.
        lang: "en" or "zh", the language that shows first.
        scripts: the files of templates/report/ that make the one script of the page, in this order.
    """
    words = PageWords(lang)
    script = script_of(templates, scripts)
    return {
        "lang": lang,
        "version": __version__,
        "t": words.spans,
        "both": words.pair,
        "label": words.attributes,
        "label_of": words.attribute,
        "terms": words.terms,
        "style": embed.safe_style(_source(templates, "page.css")),
        "script": embed.safe_script(script),
        "policy": embed.policy(script),
        "words": embed.as_json(words.for_script()),
        "data_element": embed.data_element,
    }


def names(paths: Sequence[str]) -> dict[str, str]:
    """What a page calls captures, by their paths: a page is passed on, and no machine's folders go with it.

    Where two have one name, the folders that tell them apart stand in front.
    """
    known = {path: PurePath(path) for path in paths}
    several = {name for name, n in Counter(each.name for each in known.values()).items() if n > 1}
    alike = [each.parts[:-1] for each in known.values() if each.name in several]
    common = 0
    for parts in zip(*alike, strict=False):
        if len(set(parts)) > 1:
            break
        common += 1
    return {
        path: "/".join(each.parts[common:]) if each.name in several else each.name
        for path, each in known.items()
    }


def script_of(templates: Any, names: Sequence[str]) -> str:
    """The one script of a page, of these files of templates/report/."""
    parts = (_source(templates, f"{name}.js") for name in names)
    return '"use strict";\n(() => {\n' + "\n".join(parts) + "\n})();\n"


def _source(templates: Any, name: str) -> str:
    source, _, _ = templates.loader.get_source(templates, f"{_FOLDER}/{name}")
    return str(source)
