"""The words of the page in English and Chinese (texts.toml, spec/*.toml), and the markup for them.

A page has every text in both languages. The `lang` of the document selects the one to show, so switching needs
no server.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup, escape

from ds47.report.bilingual import LANGUAGES, Both, filled, joined
from ds47.spec.reporting import command_words, report_words

_AR = re.compile("(?<![A-Za-z0-9_-])AR(?![A-Za-z0-9_-])")
_FOR_SCRIPT = ("js_", "state_", "about_", "operation_", "term_")

__all__ = ["LANGUAGES", "Both", "PageWords", "joined", "say", "texts"]


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Every text by key, then by language: its own texts, and those it shares with other formats."""
    own = tomllib.loads((files(__package__) / "texts.toml").read_text("utf-8"))
    return {**command_words(), **report_words(), **own}


def say(key: str, **values: Any) -> Both:
    """A text with its values filled in; `n` also chooses between `one|several`."""
    return filled(texts()[key], values)


class PageWords:
    """What the templates call: `t`, `both`, `label`, `label_of`."""

    def __init__(self, lang: str) -> None:
        self.lang = lang

    def spans(self, key: str, **values: Any) -> Markup:
        """A text in both languages; the style sheet shows one."""
        return self.pair(say(key, **values))

    def pair(self, text: Both) -> Markup:
        """The same for a `Both`; an AR is explained where it is named."""
        if text.en == text.zh:
            return escape(text.en)
        both = Markup('<span lang="en">{}</span><span lang="zh">{}</span>').format(*text)
        if "AR" not in both:
            return both
        explained = f"<abbr {self.terms('application_relation')}>AR</abbr>"
        return Markup(_AR.sub(lambda _: explained, both))

    def attributes(self, name: str, key: str, **values: Any) -> Markup:
        """An attribute (title, aria-label, placeholder); the script updates it when the language changes."""
        return self.attribute(name, say(key, **values))

    def terms(self, *names: str) -> Markup:
        """A title that explains terms, a line each."""
        return self.attribute("title", joined([say(f"term_{each}") for each in names], "\n", "\n"))

    def attribute(self, name: str, text: Both) -> Markup:
        """The same for a `Both`."""
        now = text[LANGUAGES.index(self.lang)]
        start = f'{name}="{{}}" data-{name}-en="{{}}" data-{name}-zh="{{}}"'
        return Markup(start).format(now, *text)

    def for_script(self) -> dict[str, dict[str, str]]:
        """The texts for the script: keys that begin with `js_`, states and operations."""
        found = {
            key.removeprefix("js_"): words
            for key, words in texts().items()
            if key.startswith(_FOR_SCRIPT)
        }
        return {lang: {key: words[lang] for key, words in found.items()} for lang in LANGUAGES}
