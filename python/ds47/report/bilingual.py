"""A text in both English and Chinese, and words of the tables in spec/ with their values filled in.

The text report shows one language, the HTML page holds both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from ds47.spec.reporting import command_words, report_words

LANGUAGES = ("en", "zh")


class Both(NamedTuple):
    """One text in both languages."""

    en: str
    zh: str

    @classmethod
    def same(cls, text: str) -> Both:
        """A text that is the same in both: a name, a number."""
        return cls(text, text)

    @classmethod
    def of(cls, words: Callable[..., str | None], *about: object) -> Both:
        """What a function says in either language, which is its last argument; empty where it says nothing."""
        return cls(*(words(*about, lang) or "" for lang in LANGUAGES))

    def joined(self, other: Both, en: str = " ", zh: str = "") -> Both:
        """This text followed by another one."""
        return Both(self.en + en + other.en, self.zh + zh + other.zh)

    def text(self, lang: str) -> str:
        """The text in "en" or "zh"."""
        return self.zh if lang == "zh" else self.en


def say(key: str, **values: Any) -> Both:
    """A text of spec/report.toml or commands.toml, filled in; `n` also chooses between `one|several`.

    Integers are written with commas. Pass a string to avoid that.
    """
    return filled(report_words().get(key) or command_words()[key], values)


def say_in(lang: str, key: str, **values: Any) -> str:
    """The same in "en" or "zh" alone."""
    texts = report_words().get(key) or command_words()[key]
    return _fill(texts[lang], LANGUAGES.index(lang), values)


@lru_cache(maxsize=1024)
def counted(key: str, n: int) -> Both:
    """`say` with nothing but a number, cached: most lines of a report repeat a few numbers."""
    return say(key, n=n)


def filled(texts: Mapping[str, str], values: Mapping[str, Any]) -> Both:
    """A text of a table in both languages, with its values filled in."""
    return Both(*(_fill(texts[lang], index, values) for index, lang in enumerate(LANGUAGES)))


def state(word: str) -> Both:
    """The name of a state of a transaction, the same in every report."""
    return _named(f"state_{word}", word)


def operation(word: str) -> Both:
    """The name of the operation of a transaction."""
    return _named(f"operation_{word}", word)


def _named(key: str, word: str) -> Both:
    """A word of the table. A stored result may have others; they stay as they are."""
    return say(key) if key in report_words() else Both.same(word)


def joined(parts: Sequence[Both], en: str = ", ", zh: str = "，") -> Both:
    """Texts in a row."""
    if len(parts) == 1:
        return parts[0]
    return Both(en.join(part.en for part in parts), zh.join(part.zh for part in parts))


def numbered(numbers: Mapping[str, str], words: str = "") -> Both:
    """`4 ok, 1 error`, from key -> text of a number; `words` is the prefix of keys to translate."""
    parts = [
        Both.same(number).joined(say(words + key) if words else Both.same(key), zh=" ")
        for key, number in numbers.items()
    ]
    return joined(parts)


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
