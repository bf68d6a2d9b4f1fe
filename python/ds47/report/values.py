"""What values mean, in words: values of the profile and of the tables, connections, buffers of faults.

The words follow the values in a line. Lists of the user win over the tables; values in neither are left out.
docs/protocol.md D has the layouts. lua/ds47/report/values.lua says the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from operator import attrgetter
from typing import Any, Final

from ds47 import spec
from ds47.model import Parameter, Value
from ds47.report import profile
from ds47.report.bilingual import Both, joined, say
from ds47.report.escaping import escape

_MOST: Final = 8
"""The most values of one parameter that get words, one by one."""
_OWN: Final = 63
"""The drive object of a connection that stays within its own."""
_FAULTS, _ALARMS = "faults", "alarms"
_HALF: Final = {"Word": 0x8000, "DoubleWord": 0x8000_0000}
"""From here on, a word of PKW has another value if it is signed."""
_OPEN: Final = ("unknown", "Integer16", "Integer32")
"""Types in the tables that allow a sign."""
PLACES: Final = 8
"""Elements for one situation in a buffer."""
LEADING: Final = ("number", "code")
"""Columns of a buffer that show whether there is an entry."""


_ABOUT: Final = (
    "pnu", "subindex", "attribute", "element_count", "listed", "unit", "format", "described", "family",
)  # fmt: skip
"""The attributes that identify a parameter, and the form of its values."""
about: Final[Callable[[Parameter], tuple[Any, ...]]] = attrgetter(*_ABOUT)
"""All of these at once, as a key: writers cache what they make of it."""


def of_kind(known: tuple[Any, ...], **more: Any) -> Parameter:
    """A parameter with these attributes, and `more`."""
    return Parameter(**dict(zip(_ABOUT, known, strict=True)), **more)


def meaning(item: Parameter) -> Both | None:
    """What the values of a parameter mean; None if there is nothing to add.

    Args:
        item: with the values that were read or written.
    """
    told, row = item.value_texts or {}, item.listed
    if item.error is not None or not item.values or not may_mean(about(item), bool(told)):
        return None
    if None in told:
        return Both.same(escape(told[None]))
    found = profile.meaning(item) if item.pnu in profile.NUMBERS else None
    if found is not None or set(map(type, item.values)) != {int}:
        return found
    if row is not None and row.buffer is not None:
        return _buffer(row, item.subindex or 0, item.values, told)
    if row is not None and row.connects is not None and not told:
        return _connection(row.connects, item)
    found = _texts(row, item.values, told)
    return _signed(item) if found is None and item.element_count is None else found


@lru_cache(maxsize=4096)
def may_mean(known: tuple[Any, ...], told: bool = False) -> bool:
    """Whether the values of a parameter may have a meaning, in the tables or in a list (`told`)."""
    item = of_kind(known)
    row = item.listed
    if item.attribute != "value" or item.pnu is None or item.subindex is None:
        return False
    if told or item.pnu in profile.NUMBERS or item.element_count is None:
        return True
    return row is not None and bool(row.values_en or row.connects or row.buffer)


def _signed(item: Parameter) -> Both | None:
    """`signed -25`: for a word of PKW, which has no type, if nothing else says its type."""
    value, half, row = item.values[0], _HALF.get(item.format or ""), item.listed
    known = item.described is not None or (row is not None and row.type not in _OPEN)
    if known or half is None or not isinstance(value, int) or value < half:
        return None
    return say("value_signed", value=str(value - 2 * half))


def _texts(
    row: spec.Pnu | None, values: list[Value], told: Mapping[int | None, str]
) -> Both | None:
    """The text of each value; a value without one stays a number. None if no value has a text."""
    english: Mapping[int, str] = row.values_en if row is not None else {}
    chinese: Mapping[int, str] = row.values_zh if row is not None else {}
    if len(values) > _MOST:
        return None
    known = [value in told or value in english for value in values]
    if not any(known):
        return None
    return joined([_text(int(value), told, english, chinese) for value in values])


def _text(
    value: int,
    told: Mapping[int | None, str],
    english: Mapping[int, str],
    chinese: Mapping[int, str],
) -> Both:
    if value in told:
        return Both.same(escape(told[value]))
    return Both(english[value], chinese[value]) if value in english else Both.same(str(value))


def _connection(kind: str, item: Parameter) -> Both | None:
    """`from r0722.2`, for 32 bits that name a signal of the same drive object; else None."""
    value = item.values[0]
    if len(item.values) != 1 or not isinstance(value, int) or not 0xFFFF < value <= 0xFFFFFFFF:
        return None
    number, place = value >> 16, value & 0x3FF
    if value >> 10 & 0x3F != _OWN:
        return None
    row = spec.parameter(number, "sinamics")
    letter = (row.access if row is not None else None) or ""
    source = f"{letter}{number:04}" if letter else str(number)
    source += f".{place}" if kind == "bit" else f"[{place}]"
    told = say("value_from", source=source)
    return told if row is None else told.joined(Both(row.name_en, row.name_zh), ", ", "，")


def _buffer(
    row: spec.Pnu, first: int, values: list[Value], told: Mapping[int | None, str]
) -> Both | None:
    """The entries of a buffer that are not 0, by situation: eight elements each."""
    places: dict[int, list[str]] = {}
    for place, value in enumerate(values, first):
        if value:
            entry = escape(told[int(value)]) if value in told else str(value)
            places.setdefault(place // PLACES, []).append(entry)
    found = list(_situations(row, first, places))
    return joined(found, "; ", "；") if found else None


def _situations(row: spec.Pnu, first: int, places: Mapping[int, list[str]]) -> Iterator[Both]:
    """The entries of each situation. Only a missing number or code shows that there is none: a value may be 0."""
    kind = row.buffer
    if 0 not in places and first == 0 and row.entry is not None and row.entry[1] in LEADING:
        yield _word("value_no_faults" if kind == _FAULTS else "value_no_alarms")
    gone: list[str] = []
    for situation, entries in places.items():
        if situation == 0 or kind == _FAULTS:
            yield _situation(situation).joined(_row(entries), ": ", "：")
        else:
            gone += entries
    if gone:
        yield _word("value_gone").joined(_row(gone), ": ", "：")


def _row(entries: list[str]) -> Both:
    return Both(", ".join(entries), "，".join(entries))


_word = lru_cache(maxsize=8)(say)
"""Words that stand in many lines."""


@lru_cache(maxsize=64)
def _situation(number: int) -> Both:
    return say("value_acknowledged", n=str(number)) if number else say("value_active")
