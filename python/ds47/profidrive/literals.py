"""Formats and values as people write them in a request line: `Float32`, `REAL`, `10.0,5.0`, `16#10`, `"a b"`.

What a number becomes on the wire is `formats`; where values stand in a line is `notation`.
"""

from __future__ import annotations

import json
import re
from typing import Final

from ds47 import spec
from ds47.profidrive.model import Value

QUOTED: Final = r'"(?:[^"\\]|\\.)*"'
"""A text in quotes, with the escapes of JSON."""
_LIST = re.compile(rf"(?:{QUOTED}|[^,\"]+)(?:,(?:{QUOTED}|[^,\"]+))*")
_ITEM = re.compile(rf"{QUOTED}|[^,\"]+")
_CODE = re.compile(r"0x[0-9a-f]{1,2}|\d{1,3}", re.IGNORECASE)
_BASED = re.compile(r"(?:(?:B|W|DW)#)?(2|8|10|16)#(\w+)", re.IGNORECASE)
_ZEROS = re.compile(r"[+-]?0\d+")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d+)?")
_STRINGS = ("VisibleString", "OctetString")
_NEAR = 4


def format_code(name: str) -> int:
    """The code of a format from its name (`Float32`, `REAL`) or its number (`8`, `0x08`).

    Raises:
        ValueError: there is no such format; the message names the near ones, or the usual ones.
    """
    known = spec.format_named(name)
    if known is not None:
        return known.code
    if _CODE.fullmatch(name):
        return int(name, 16 if name[:2].lower() == "0x" else 10)
    from difflib import get_close_matches

    own = {row.name.lower(): row.name for row in spec.formats().values()}
    plc = {row.plc.lower(): row.plc for row in spec.formats().values() if row.plc}
    near = get_close_matches(name.lower(), own | plc, n=_NEAR)
    if near:
        names = "near it: " + ", ".join((own | plc)[each] for each in near)
    else:
        usual = [row for row in spec.formats().values() if row.plc or row.name in _STRINGS]
        names = "usual ones: " + ", ".join(map(_both_names, usual))
    raise ValueError(f"unknown format {name!r}; {names}")


def _both_names(row: spec.Format) -> str:
    alike = row.plc is None or row.plc.lower() == row.name.lower()
    return row.name if alike else f"{row.name} ({row.plc})"


def values(code: int, text: str) -> list[Value]:
    """The values of a list, as `build.make_block` takes them; an empty text has none.

    Whole numbers may have a base (`16#10`, `2#1010`, `0x10`); a string in quotes has JSON's escapes.

    Raises:
        ValueError: it is not a list, or has several texts where the format is one text.
    """
    if not text:
        return []
    if not _LIST.fullmatch(text):
        raise ValueError(f'{text} is not a list of values such as 1,2 or "a","b"')
    row = spec.formats().get(code)
    words = _ITEM.findall(text)
    if row is not None and row.kind == "text" and row.whole and len(words) > 1:
        raise ValueError(f"{row.name} is one text: write it in quotes")
    whole = row is not None and row.kind not in ("text", "octets", "with_status", "float")
    return [_value(word, whole) for word in words]


def _value(word: str, whole: bool) -> Value:
    if word.startswith('"'):
        try:
            return str(json.loads(word))
        except ValueError:
            raise ValueError(f"{word} has an escape sequence that is not valid in JSON") from None
    if not whole:
        return word
    based = _BASED.fullmatch(word)
    try:
        if based:
            return int(based[2], int(based[1]))
        if _ZEROS.fullmatch(word):
            raise ValueError
        return int(word, 0)
    except ValueError:
        raise ValueError(
            f"{word} is not a whole number, such as 10, 16#0A, 2#1010 or 0x0A"
        ) from None


def as_one_number(code: int, text: str) -> list[str]:
    """The numbers that someone may have meant who wrote this list; none where it can only be a list.

    `10,5` has a decimal comma (10.5), `1,000.5` commas between thousands (1000.5), `1,000` may have either.
    """
    row = spec.formats().get(code)
    if row is None or row.kind != "float":
        return []
    meant = [text.replace(",", ".")] if _DECIMAL_COMMA.fullmatch(text) else []
    return [*meant, text.replace(",", "")] if _THOUSANDS.fullmatch(text) else meant
