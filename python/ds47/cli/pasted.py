"""Bytes as people paste them: hex dumps with their offsets, lists of decimal numbers, and plain hexadecimal.

Offsets and the column of text go first; what is left is a list or hexadecimal. What may be read in two ways is
refused, never guessed. What a single number may look like is in `ds47.profidrive.notation`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

from ds47.profidrive.notation import parse_hex

_LINE: Final = re.compile(
    r"\s*(\[)?(?:0x)?(0{,8}[0-9a-f]{1,8})h?(?(1)\])(\s*[:|>](?!\S+:)\s*|\s+|$)(.*)", re.IGNORECASE
)
"""The number in front of a line, what separates it, and the rest; `03:01:02` has none in front."""
_TOKEN: Final = re.compile(r"[^\s,;\[\](){}-]+")
_NAME: Final = re.compile(r"(?<!\w)hex\b:?|(?<=[0-9a-f])hex\b", re.IGNORECASE)
"""What people write beside hexadecimal numbers: `0101 hex`."""
_BUFFER: Final = re.compile(r"<Buffer\b([^<>]*)>", re.IGNORECASE)
"""How Node.js prints bytes, in one line or several."""
_DIGITS: Final = re.compile(r"(?:0x)?([0-9a-f]+)h?", re.IGNORECASE)
_DECIMAL: Final = re.compile(r"-?\d{1,3}")
_BASES: Final = (16, 10, 8)
"""Of offsets: most are hexadecimal, those of `od` are octal."""
_APART: Final = re.compile(r"\s+\||\s{3,}")
"""What no bytes stand behind, unless they look like some."""
_LONGEST: Final = 320
"""Signs from the last byte of a line to the end of its column of text, of 64 bytes a line at most."""
_USUAL: Final = 2
"""Bytes of a word of xxd."""
_SPACED: Final = re.compile(r"(?![0-9a-f]{2}(?: \S|\s*$|\s+>))\S", re.IGNORECASE)
"""How what is no byte in hexadecimal begins: of other width, or wide apart."""
_WIDTHS: Final = (6, 7)
"""Digits of the offsets of hexdump and od."""
_STEP: Final = 64
"""Bytes of a line of a dump, at most."""
_WORD: Final = 4
"""Digits from which on a number may be an offset for the blanks behind it alone."""


@dataclass(frozen=True, slots=True)
class Pasted:
    """Bytes, and whether they were written as decimal numbers."""

    data: bytes
    decimal: bool = False


def read(text: str) -> Pasted:
    """The bytes of a text, without bold type of Markdown; none of an empty one.

    Raises:
        ValueError: it has none of the forms, or may have two; the message says where, and what to do.
    """
    plain = [
        _NAME.sub("", line) for line in _BUFFER.sub(r"\1", text.replace("**", "")).splitlines()
    ]
    written = [line for line in plain if line.strip()]
    if not written:
        return Pasted(b"")
    lines = _without_offsets(written)
    numbers = _decimal(lines)
    if numbers is None:
        return Pasted(parse_hex("\n".join(lines)))
    return Pasted(numbers, decimal=True)


# Offsets, and the column of text


class _Row(NamedTuple):
    """A line with a number in front, which may be an offset."""

    front: str
    between: str
    rest: str

    def content(self, size: int | None = None) -> str | None:
        """The rest without its column of text; None where it is not so many bytes, or not bytes and text alone."""
        data, end = bytearray(), len(self.rest.rstrip(" \t,;"))
        for token in _TOKEN.finditer(self.rest):
            digits = _DIGITS.fullmatch(token[0])
            if digits is None:
                return None
            odd = len(digits[1]) % 2  # one digit, or a decimal number of three
            data += b"\0" if odd else bytes.fromhex(digits[1])
            at = token.end()
            if size in (None, len(data)) and (at >= end or _is_text(self.rest, at, data)):
                return self.rest[:at]
        return None if self.rest.strip() or size else ""

    def orders(self) -> set[bool]:
        """Whether the bytes of words of xxd are the other way round: False and True where its text fits both."""
        plain, swapped, wide = bytearray(), bytearray(), False
        for token in _TOKEN.finditer(self.rest if ":" in self.between else ""):
            if not re.fullmatch(r"(?:[0-9a-fA-F]{2})+", token[0]):
                break
            word, behind = bytes.fromhex(token[0]), self.rest[token.end() :]
            plain += word
            swapped += word[::-1]
            wide |= len(word) > _USUAL
            if behind.startswith("  ") and plain != swapped and _spells(behind, swapped):
                straight = _spells(behind, plain)
                return {not straight, True} if wide else {not straight}
            if behind.startswith("  ") and _spells(behind, plain):
                return {False}
        return set()

    def stands_out(self) -> bool:
        """Whether the number in front differs from what is behind it, as offsets do."""
        tokens = list(_TOKEN.finditer(self.content() or self.rest))
        widths = [len(digits[1]) for each in tokens if (digits := _DIGITS.fullmatch(each[0]))]
        gaps = [later.start() - each.end() for each, later in pairwise(tokens)]
        marked = self.between.strip() and (gaps or self.between[-1].isspace())
        apart = len(self.front) >= _WORD and gaps and len(self.between) > max(gaps)
        return bool(widths and (len(self.front) > max(widths) or marked or apart))


def _is_text(line: str, at: int, data: bytearray) -> bool:
    """Whether from there on it is what dumps print beside such bytes: these as text, with a sign for some."""
    if len(line) - at > _LONGEST:
        return False
    behind = line[at:]
    digits = [_DIGITS.fullmatch(each[0]) is not None for each in _TOKEN.finditer(behind)]
    if all(digits) and not behind.startswith("  "):  # as more bytes do
        return False
    if _APART.match(behind) and digits[:1] != [True]:
        return True
    return _spells(behind, data)


def _spells(text: str, data: bytearray) -> bool:
    """Whether a text is that of bytes."""
    signs = "".join(text.split())
    if not len(data) - data.count(b" ") <= len(signs) <= len(data) + 2:
        return False
    forms = ("".join(_sign(each, blank) for each in data) for blank in ("", r"\."))
    return any(re.fullmatch(rf"[|>]?{form}[|<]?", signs) for form in forms)


def _sign(byte: int, blank: str) -> str:
    """What stands for a byte, as a pattern."""
    return blank if byte == 0x20 else re.escape(chr(byte)) if 0x20 < byte < 0x7F else "[^0-9A-Za-z]"


def _without_offsets(lines: list[str]) -> list[str]:
    """Lines without their offsets and columns of text; as they are where no number in front may be an offset.

    Raises:
        ValueError: what stands in front of a line may be an offset or data.
    """
    found = [_LINE.fullmatch(line) for line in lines]
    rows = [_Row(*each.group(2, 3, 4)) if each else None for each in found]
    whole = [row for row in rows if row is not None]
    _refuse_words(whole)
    behind = [row for row in rows[1:] if row is not None]
    begun = [_Row("0", " ", lines[0].strip()), *behind]  # copied from the first byte on
    for counted in (whole, begun if all(row.stands_out() for row in behind) else []):
        column = len(counted) == len(rows) > 1 and _is_column(counted[counted is begun :])
        for base in _BASES if column else ():
            contents = list(_counted(counted, base))
            if len(contents) == len(rows):
                _refuse_chance(counted)
                return contents
    for number, row in enumerate(rows, 1):
        if row is None or not row.stands_out():
            continue
        content = row.content()
        if len(rows) > 1:
            raise ValueError(
                f"{row.front!r} in front of line {number} may be an offset, but the numbers in front do not"
                " count the bytes: paste all lines, whole ('*' stands for lines left out), or leave offsets out;"
                " write data as two digits for each byte"
            )
        if row.front.strip("0") or content is None:
            raise ValueError(
                f"{row.front!r} in front may be an offset or data: leave an offset out, and all that is not data;"
                " write data as two digits for each byte"
            )
        return [content]
    return lines


def _is_column(rows: list[_Row]) -> bool:
    """Whether the numbers in front have one width, or count from 0 without zeros in front."""
    fronts = [row.front for row in rows]
    plain = fronts[0] == "0" and not any(each[0] == "0" for each in fronts[1:])
    return plain or len({len(each) for each in fronts}) == 1


def _counted(rows: list[_Row], base: int) -> Iterator[str]:
    """What stands behind the offsets, as long as they count the bytes; behind the last one there may be none."""
    for row, later in zip(rows, [*rows[1:], None], strict=True):
        try:
            size = None if later is None else int(later.front, base) - int(row.front, base)
        except ValueError:
            return
        content = row.content(size) if size is None or size > 0 else None
        if content is None:
            return
        yield content


def _steps(rows: list[_Row], base: int) -> bool:
    """Whether numbers in front are as wide as those of hexdump and od, blanks behind, and count as these."""
    if any(len(row.front) not in _WIDTHS or row.between.strip() for row in rows):
        return False
    try:
        fronts = [int(row.front, base) for row in rows]
    except ValueError:
        return False
    if len(fronts) < 2:
        return fronts == [0]
    return all(0 < later - each <= _STEP for each, later in pairwise(fronts))


def _refuse_words(rows: list[_Row]) -> None:
    """Raises ValueError for numbers of several bytes in the order of a machine, and for octal ones, by their form.

    hexdump and od have offsets of six or seven digits with blanks behind; of xxd its text tells the order.
    """
    orders = [row.orders() for row in rows]
    swapped = {True} in orders or ({False, True} in orders and {False} not in orders)
    tool = any(_steps(rows, base) for base in _BASES)
    words = [
        row.rest for row in rows if row.rest and (swapped or (tool and _SPACED.match(row.rest)))
    ]
    if words:
        raise ValueError(
            f"{words[0].split()[0]!r} is not a byte in hexadecimal, but a word in the byte order of a machine,"
            " octal or decimal: dump bytes with hexdump -C, xxd or od -tx1"
        )


def _refuse_chance(rows: list[_Row]) -> None:
    """Raises ValueError where bytes in front of the lines may count the others by chance alone."""
    first = rows[0]
    narrow = len(first.front) <= 2 and first.front.strip("0")
    if narrow and not any(row.stands_out() for row in rows):
        raise ValueError(
            f"{first.front!r}, {rows[1].front!r} in front of the lines count bytes and may be offsets or data:"
            " leave offsets out, or write data in one line"
        )


# Lists of decimal numbers


def _decimal(lines: list[str]) -> bytes | None:
    """The bytes of a list of decimal numbers; None where it is none: hexadecimal numbers have two digits each.

    Raises:
        ValueError: a number is no byte, or nothing tells whether it is a list.
    """
    numbers = [number for line in lines for number in re.split(r"[\s,;\[\](){}]+", line) if number]
    if len(numbers) < 2 or not all(map(_DECIMAL.fullmatch, numbers)):
        return None
    odd = next((each for each in numbers if len(each) != 2 or each[0] == "-"), None)
    if odd is None:
        return None
    listed = any(re.search(r"[,;\[({]", line) for line in lines) or len(lines) == len(numbers)
    if not listed and not any(len(each) > 2 or each[0] == "-" for each in numbers):
        raise ValueError(
            f"{odd!r} is a number of one digit, so these may be decimal or hexadecimal: write commas between"
            " decimal ones, and two digits for each hexadecimal one"
        )
    wrong = next((each for each in numbers if not -0x80 <= int(each) <= 0xFF), None)
    if wrong is not None:
        raise ValueError(
            f"{wrong!r} in a list of decimal numbers is not a byte: write words in hexadecimal, as"
            f" 16#{int(wrong) & 0xFFFF:04X}"
        )
    return bytes(int(each) & 0xFF for each in numbers)
