"""The words of the page in English and Chinese (texts.toml), and how they get into it.

A page holds both languages: every text stands in it twice, and the `lang` of the document says
which one shows. So it can be read, and switched, without asking anybody.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from markupsafe import Markup, escape

LANGUAGES = ("en", "zh")


class Both(NamedTuple):
    """One text in both languages."""

    en: str
    zh: str

    @classmethod
    def same(cls, text: str) -> Both:
        """A text that has only one language: a name, a number."""
        return cls(text, text)

    def joined(self, other: Both, en: str = " ", zh: str = "") -> Both:
        """This text and another one behind it."""
        return Both(self.en + en + other.en, self.zh + zh + other.zh)


@cache
def texts() -> Mapping[str, Mapping[str, str]]:
    """Every text by its key, then by language."""
    return tomllib.loads((files(__package__) / "texts.toml").read_text("utf-8"))


def say(key: str, **values: Any) -> Both:
    """A text with its values filled in; `n` also chooses between `one|several`."""
    return Both(*(_fill(texts()[key][lang], index, values) for index, lang in enumerate(LANGUAGES)))


def _fill(text: str, language: int, values: Mapping[str, Any]) -> str:
    number = values.get("n")
    if "|" in text:
        one, several = text.split("|")
        text = one if number == 1 else several
    return text.format_map({key: _shown(value, language) for key, value in values.items()})


def _shown(value: Any, language: int) -> str:
    if isinstance(value, Both):
        return value[language]
    return f"{value:,}" if isinstance(value, int) else str(value)


def joined(parts: list[Both], en: str = ", ", zh: str = "，") -> Both:
    """Texts in a row."""
    return Both(en.join(part.en for part in parts), zh.join(part.zh for part in parts))


class Words:
    """What the templates call: `t`, `both`, `label`."""

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
        text = say(key, **values)
        now = text[LANGUAGES.index(self.lang)]
        start = f'{name}="{{}}" data-{name}-en="{{}}" data-{name}-zh="{{}}"'
        return Markup(start).format(now, *text)

    def for_script(self) -> dict[str, dict[str, str]]:
        """The texts that the script needs: those whose key begins with `js_`."""
        return {
            lang: {key[3:]: words[lang] for key, words in texts().items() if key.startswith("js_")}
            for lang in LANGUAGES
        }
