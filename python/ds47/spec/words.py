"""The words of a file in English and Chinese, except those of its rows: the same look-ups for every file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Any

from ds47.spec import _load


@cache
def _flaws(file: str) -> Mapping[str, Mapping[str, str]]:
    return MappingProxyType({row["id"]: row for row in _load(file)["flaw"]})


@dataclass(frozen=True, slots=True)
class Flaw:
    """What is wrong with bytes, where, and the numbers for its words."""

    kind: str
    """One of `Words.flaw_ids()`."""
    offset: int
    """Bytes from the start of the decoded data."""
    args: Mapping[str, int] = field(default_factory=dict)


class Words:
    """The words of one file: `[words]`, and `[[flaw]]`, what can be wrong with bytes."""

    def __init__(self, file: str) -> None:
        self._file = file

    def words(self) -> Mapping[str, Mapping[str, str]]:
        """The table `[words]`: key -> "en" and "zh"."""
        return MappingProxyType(_load(self._file)["words"])

    def word(self, key: str, lang: str) -> str:
        """One of them, in "en" or "zh"."""
        return self.words()[key][lang]

    def flaw_ids(self) -> tuple[str, ...]:
        """The ids of everything that can be wrong."""
        return tuple(_flaws(self._file))

    def flaw_template(self, flaw_id: str, lang: str = "en") -> str:
        """What is wrong, in "en" or "zh", without its numbers."""
        return _flaws(self._file)[flaw_id][lang]

    def flaw_text(self, flaw_id: str, args: Mapping[str, Any], lang: str = "en") -> str:
        """What is wrong, in "en" or "zh"."""
        return self.flaw_template(flaw_id, lang).format(**args)
