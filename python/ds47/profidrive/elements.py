"""The elements of a parameter that values are: of a string each character, or octet, is one."""

from __future__ import annotations

from collections.abc import Sequence

from ds47.model import Value
from ds47.spec import format_named


def is_whole(format_name: object) -> bool:
    """Whether values of a format are one string, with each character or octet as an element.

    Args:
        format_name: the name of a format; anything else is none, as a stored result may have it.
    """
    row = format_named(format_name) if isinstance(format_name, str) else None
    return row is not None and row.whole


def split(values: Sequence[Value], format_name: object) -> list[Value]:
    """The value of each element.

    Args:
        values: as a report has them.
        format_name: as for `is_whole`.
    """
    row = format_named(format_name) if isinstance(format_name, str) else None
    if row is None or not row.whole:
        return list(values)
    text = "".join(value for value in values if isinstance(value, str))
    if row.kind == "text":
        return list(text)
    return [text[start : start + 2] for start in range(0, len(text), 2)]
