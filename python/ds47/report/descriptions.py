"""Descriptions and texts of parameters in words: what stands in a line instead of their 46 bytes.

What the bytes mean is in `ds47.profidrive.description`; lua/ds47/report/descriptions.lua says the same.
"""

from __future__ import annotations

from functools import lru_cache

from ds47 import spec
from ds47.model import Parameter, Value
from ds47.profidrive.description import Description, describe, texts
from ds47.profidrive.naming import spelling
from ds47.report.bilingual import Both, joined, say
from ds47.report.escaping import quoted


def of(item: Parameter) -> Description | None:
    """The description that the values of a parameter are; None where they are none.

    The elements of PKW, which has no number of elements, are those of an older profile.
    """
    if item.attribute != "description" or not item.values or item.element_count is None:
        return None
    return describe(item.subindex, item.format, item.values)


def entries(item: Parameter) -> list[str] | None:
    """The entries of a text array that the values of a parameter are; None where they are none."""
    if item.attribute != "text" or not item.values or item.element_count is None:
        return None
    if stated(item) > len(item.values):
        return None
    return texts(item.format, item.values)


def stated(item: Parameter) -> int:
    """How many values there are, more than are shown where the end of the record is missing; a string is one."""
    there, told = len(item.values), item.value_count or 0
    row = None if item.format is None or told <= there else spec.format_named(item.format)
    return there if row is None or row.whole else told


def words(item: Parameter) -> Both | None:
    """What a description or a text says, in a line; None where the values say it themselves."""
    parts, described = _entries(item)
    marks = [] if described is None else _marks(described)
    return joined([*map(Both.same, parts), *marks]) if parts or marks else None


def parts(item: Parameter) -> list[str] | None:
    """The same without what needs words of a language: name, type, unit, limits; None where there is nothing."""
    return _entries(item)[0] or None


def _entries(item: Parameter) -> tuple[list[str], Description | None]:
    """The parts, none where there is nothing; and the description, if it is one."""
    listed = entries(item)
    if listed is not None:
        return [quoted(each) for each in listed], None
    described = of(item)
    return ([] if described is None else _plain(described, item.family)), described


def _plain(item: Description, family: str | None) -> list[str]:
    found = [] if item.name is None else [quoted(item.name)]
    if item.type is not None:
        found.append(item.type + (f"[{item.elements}]" if item.elements else ""))
    if item.unit is not None:
        found.append(item.unit)
    if item.low is not None or item.high is not None:
        found.append(f"{_limit(item.low)}..{_limit(item.high)}")
    if item.factor not in (None, 1.0):
        found.append(f"* {item.factor}")
    if item.full_scale is not None:
        whole = spelling(item.reference, family) if item.reference else "100 %"
        found.append(f"0x{item.full_scale:04X} = {whole}")
    return found


def _marks(item: Description) -> list[Both]:
    """What its bits say, where it is not what they say of most parameters."""
    marks = {
        "description_read_only": item.writable is False,
        "description_texts": item.text_array,
        "description_changed": item.changed,
        "description_reset": item.reset_only,
    }
    return [_mark(key) for key, holds in marks.items() if holds]


@lru_cache
def _mark(key: str) -> Both:
    return say(key)


def _limit(value: Value | None) -> str:
    return "" if value is None else str(value)
