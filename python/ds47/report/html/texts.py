"""The words of the page in English and Chinese (texts.toml, spec/*.toml), and how they get into it.

A page holds both languages: every text stands in it twice, and the `lang` of the document says
which one shows. So it can be read, and switched, without asking anybody.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from markupsafe import Markup, escape

from ds47.report.bilingual import LANGUAGES, Both, filled, joined
from ds47.spec.reporting import command_words, report_words

_FOR_SCRIPT = ("js_", "state_", "about_", "operation_")

__all__ = ["LANGUAGES", "Both", "PageWords", "joined", "say", "texts"]


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Every text by its key, then by language: those of the page, and those that it shares with others."""
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
        """A text in both languages, of which the style sheet shows one."""
        return self.pair(say(key, **values))

    def pair(self, text: Both) -> Markup:
        """A text that is there in both languages already."""
        if text.en == text.zh:
            return escape(text.en)
        return Markup('<span lang="en">{}</span><span lang="zh">{}</span>').format(*text)

    def attributes(self, name: str, key: str, **values: Any) -> Markup:
        """An attribute (title, aria-label, placeholder) that the script sets when the language changes."""
        return self.attribute(name, say(key, **values))

    def attribute(self, name: str, text: Both) -> Markup:
        """The same, of a text that is there in both languages already."""
        now = text[LANGUAGES.index(self.lang)]
        start = f'{name}="{{}}" data-{name}-en="{{}}" data-{name}-zh="{{}}"'
        return Markup(start).format(now, *text)

    def for_script(self) -> dict[str, dict[str, str]]:
        """The texts that the script needs: those whose key begins with `js_`, states and operations."""
        found = {
            key.removeprefix("js_"): words
            for key, words in texts().items()
            if key.startswith(_FOR_SCRIPT)
        }
        return {lang: {key: words[lang] for key, words in found.items()} for lang in LANGUAGES}
