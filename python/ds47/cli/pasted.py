"""Bytes as people paste them: hex dumps with their offsets, lists of decimal numbers, and plain hexadecimal.

What a single number may look like is in `ds47.profidrive.notation`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from ds47.profidrive.notation import parse_hex

_LINE: Final = re.compile(r"\s*(?:0x)?([0-9A-Fa-f]{4,8})(:\s*|\s{2,})(\S.*)")
"""Offset, what separates it, and the rest of a line of a dump."""
_LAST: Final = re.compile(r"\s*[0-9A-Fa-f]{4,8}:?\s*")
"""What `hexdump -C` writes last: how many bytes there were."""
_ENDS: Final = re.compile(r"\s+\||\s{3,}")
"""Where the column of text begins, if there is one;"""
_ENDS_BY_XXD: Final = re.compile(r"\s{2,}")
"""behind offsets with a colon two spaces are enough."""
_GROUP: Final = re.compile(r"(?:[0-9A-Fa-f]{2})+")
_LIST: Final = re.compile(r"[\[({]?\s*(?:\d{1,3}\s*,\s*)+\d{1,3}\s*,?\s*[\])}]?")
_WIDEST: Final = 16
"""Bytes of a line of a dump."""


@dataclass(frozen=True, slots=True)
class Pasted:
    """Bytes, and whether they were written as decimal numbers."""

    data: bytes
    decimal: bool = False


def read(text: str) -> Pasted:
    """The bytes of a text.

    Raises:
        ValueError: it has none of the forms; the message says which part.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) > 1 and _LAST.fullmatch(lines[-1]) and _LINE.fullmatch(lines[-2]):
        lines.pop()
    dump = [_LINE.fullmatch(line) for line in lines]
    rows = [row for row in dump if row is not None]
    if rows and len(rows) == len(lines) and (data := _dumped(rows)) is not None:
        return Pasted(data)
    if _LIST.fullmatch(text.strip()):
        numbers = re.findall(r"\d+", text)
        if any(len(each) != 2 for each in numbers):  # hexadecimal ones have two digits each
            return Pasted(_decimal(numbers), decimal=True)
    return Pasted(parse_hex(text))


def _dumped(rows: list[re.Match[str]]) -> bytes | None:
    """The bytes of a dump without its offsets; None where the numbers in front do not count the bytes.

    Raises:
        ValueError: it is one line, whose number in front may be an offset or data.
    """
    offsets = [int(row[1], 16) for row in rows]
    data = b""
    for number, row in enumerate(rows):
        if offsets[number] != offsets[0] + len(data):
            return None
        last = number + 1 == len(rows)
        line = _row(row, _WIDEST if last else offsets[number + 1] - offsets[number])
        if not line:
            return None
        data += line
    if len(rows) == 1 and offsets[0]:
        raise ValueError(
            f"{rows[0][1]!r} in front may be an offset or data: leave it out, or put one space behind it"
        )
    return data


def _row(row: re.Match[str], most: int) -> bytes:
    """The bytes of a line of a dump, at most so many; empty where there are no pairs of digits."""
    by_xxd = row[2].startswith(":")
    ends = _ENDS_BY_XXD if by_xxd else _ENDS
    found = b""
    for token in ends.split(row[3], maxsplit=1)[0].split():
        if not _GROUP.fullmatch(token) or len(found) >= most or not (by_xxd or len(token) == 2):
            break
        found += bytes.fromhex(token)
    return found[:most] if most > 0 else b""


def _decimal(numbers: list[str]) -> bytes:
    large = next((each for each in numbers if int(each) > 0xFF), None)
    if large is not None:
        raise ValueError(f"{large!r} in a list of decimal numbers is more than a byte")
    return bytes(map(int, numbers))
