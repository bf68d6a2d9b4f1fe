"""Words of PKW that makers have instead of those of PROFIdrive (`[[layout]]` in makers/*.toml)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple

from ds47.spec import ErrorNumber, makers


class Part(NamedTuple):
    """Where a part stands: in which word, from which bit on, and how many."""

    word: int
    low: int
    bits: int

    def of(self, words: tuple[int, ...]) -> int:
        """Its value."""
        return words[self.word] >> self.low & (1 << self.bits) - 1


class MakerLayout(NamedTuple):
    """One layout: what is asked or answered, group and number of the parameter; the last word is the value.

    `requests` and `answers`: what the number of an operation says, as the words of commands.toml name it.
    """

    maker: str
    operation: Part
    group: Part
    number: Part
    requests: Mapping[int, str]
    answers: Mapping[int, str]
    errors: Mapping[int, ErrorNumber]


@cache
def maker_layouts() -> Mapping[str, MakerLayout]:
    """All of them by name."""
    rows = [(maker["name"], row) for maker in makers() for row in maker.get("layout", ())]
    return MappingProxyType({row["name"]: _layout(maker, row) for maker, row in rows})


def _layout(maker: str, row: Mapping[str, Any]) -> MakerLayout:
    operation, group, index = (Part(*row[key]) for key in ("operation", "group", "index"))
    requests, answers = (
        {int(number): word for number, word in row[key].items()} for key in ("requests", "answers")
    )
    errors = {each["code"]: ErrorNumber(**each) for each in row.get("error", ())}
    return MakerLayout(maker, operation, group, index, requests, answers, errors)
