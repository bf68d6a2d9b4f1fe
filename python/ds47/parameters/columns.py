"""Which column of a table has what: by the headings that lists of makers and exports of tools usually have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

COLUMNS: Final = ("number", "name", "unit", "type", "access", "values")
"""What a column may have; a list needs the first two."""
_USUAL: Final[Mapping[str, tuple[str, ...]]] = {
    "number": (
        "number", "no", "nr", "parameter number", "parameternummer", "parameter no", "param", "pnu", "nummer",
        "parameter", "fault", "alarm", "message", "参数号", "编号", "参数",
    ),
    "name": (
        "name", "parameter name", "parameter text", "parametertext", "text", "description", "designation",
        "bezeichnung", "bedeutung", "meaning", "名称", "参数名称", "参数文本", "含义",
    ),
    "unit": ("unit", "units", "einheit", "单位"),
    "type": ("type", "data type", "datatype", "datentyp", "format", "数据类型", "类型"),
    "access": ("access", "read/write", "r/w", "zugriff", "访问"),
    "values": ("values", "value list", "enumeration", "selection", "auswahl", "werte", "取值", "枚举"),
}  # fmt: skip
"""Headings in small letters, the surest first."""


def guessed(cells: Sequence[str], named: Mapping[str, str]) -> dict[str, int]:
    """Where the columns are, if a row of cells is one of headings; else nothing.

    Args:
        cells: the row.
        named: key of COLUMNS -> heading, from the user; these must be there.
    """
    headings = [_plain(cell) for cell in cells]
    found: dict[str, int] = {}
    for key, heading in named.items():
        if _plain(heading) not in headings:
            return {}
        found[key] = headings.index(_plain(heading))
    for key in COLUMNS:
        taken = set(found.values())
        indices = (headings.index(each) for each in _USUAL[key] if each in headings)
        index = next((each for each in indices if each not in taken), None)
        if key not in found and index is not None:
            found[key] = index
    return found if "number" in found and "name" in found else {}


def _plain(heading: str) -> str:
    return " ".join(heading.replace(".", " ").split()).casefold()
