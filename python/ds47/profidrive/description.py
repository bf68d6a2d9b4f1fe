"""What the attributes description (0x20) and text (0x30) say about a parameter (docs/protocol.md C).

Made from the values that a message has, whatever format a drive puts them in: a whole description of 46 bytes, one
element of it, entries of a text array. What is no description is None, and no bytes raise. Nothing is guessed: a
limit whose bytes do not fit the type of the parameter, a type or a unit that no table has, stay None.
Words are elsewhere.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

from ds47 import spec
from ds47.profidrive.formats import codec, float32_value
from ds47.profidrive.model import Value
from ds47.spec import descriptions

_WHOLE: Final = 0
"""The subindex of a whole description."""
_LIMIT: Final = 4
"""Bytes of a limit."""
_BYTES: Final = {"number": 4, "text": 16, "octets": 16}
"""Kinds of formats in which drives send a description or a text, and the most bytes of a value."""
_LIMITED: Final = frozenset(("number", "float", "duration", "time_of_day"))
"""Kinds of formats with limits for values."""


@dataclass(slots=True)
class Description:
    """A description from a message; None for what is missing, or unknown to the tables.

    Attributes:
        identifier: the word of data type and bits.
        type: name of the data type, `0x7F` where that has none.
        writable: False where the parameter is write-protected.
        text_array: whether it has texts (attribute 0x30).
        changed: whether it differs from its factory setting.
        reset_only: whether it can only be reset.
        array: whether it has elements.
        elements: how many, or the length of a string; 0 where it is neither.
        factor: to the standard unit.
        quantity, conversion: the variable attribute: variable index and conversion index.
        unit: what the two mean.
        name: without the blanks at its end.
        low, high: the limits, as values of the type.
        extension: of the identifier.
        reference: PNU whose value is 100 %.
        normalisation: the word.
        full_scale: what is 100 % in the value, where that word is valid: 0x4000 for bit 14.
    """

    identifier: int | None = None
    type: str | None = None
    writable: bool | None = None
    text_array: bool | None = None
    changed: bool | None = None
    reset_only: bool | None = None
    array: bool | None = None
    elements: int | None = None
    factor: Value | None = None
    quantity: int | None = None
    conversion: int | None = None
    unit: str | None = None
    name: str | None = None
    low: Value | None = None
    high: Value | None = None
    extension: int | None = None
    reference: int | None = None
    normalisation: int | None = None
    full_scale: int | None = None


def describe(
    subindex: int | None, format_name: str | None, values: Sequence[Value]
) -> Description | None:
    """The description in these values, None if they are none.

    Args:
        subindex: 0 for all elements, else the number of one.
        format_name: of the values, as the table names it.
        values: as the decoder shows them.
    """
    raw = _octets(format_name, values)
    found = Description()
    if subindex == _WHOLE:
        if raw is None or len(raw) != descriptions.length():
            return None
        for element in descriptions.elements():
            _take(found, element.name, raw[element.offset : element.offset + element.size])
        return found
    for element in descriptions.elements():
        if element.number != subindex:
            continue
        if len(values) == 1 and _says(format_name, element.name):
            setattr(found, element.name, values[0])
        elif raw is not None and len(raw) == element.size:
            _take(found, element.name, raw)
    return None if found == Description() else found


def texts(format_name: str | None, values: Sequence[Value]) -> list[str] | None:
    """The entries of a text array without trailing blanks, None if these values are no text."""
    row = None if format_name is None else spec.format_named(format_name)
    if row is None or row.size not in (1, descriptions.text_length()):
        return None
    raw = _octets(format_name, values)
    size = descriptions.text_length()
    if not raw:
        return None
    step = len(raw) if len(raw) % size else size
    return [_text(raw[at : at + step]) for at in range(0, len(raw), step)]


def _octets(format_name: str | None, values: Sequence[Value]) -> bytes | None:
    """The bytes of these values in the message; None if unknown."""
    row = None if format_name is None else spec.format_named(format_name)
    if row is None or row.size is None or not values or row.size > _BYTES.get(row.kind, -1):
        return None
    found = codec(row.code)
    try:
        return None if found is None else found.encode(values)
    except (ValueError, TypeError, OverflowError):
        return None  # a value of a stored result that no drive sent


def _says(format_name: str | None, element: str) -> bool:
    """Whether the format says what the value of an element is: a factor or a limit, with more than its size."""
    row = None if format_name is None else spec.format_named(format_name)
    if row is None or row.kind not in _LIMITED or 0x40 <= row.code <= 0x44:
        return False
    return element in ("low", "high") or (element == "factor" and row.kind == "float")


def _text(raw: bytes) -> str:
    return raw.decode("latin-1").rstrip("\0 ")


def _take(found: Description, name: str, raw: bytes) -> None:
    """Sets the fields for an element."""
    number = int.from_bytes(raw, "big")
    match name:
        case "identifier":
            _identifier(found, number)
        case "factor":
            found.factor = float32_value(struct.unpack(">f", raw)[0])
        case "variable":
            found.quantity, found.conversion = struct.unpack(">Bb", raw)
            found.unit = descriptions.unit(found.quantity, found.conversion)
        case "name":
            found.name = _text(raw)
        case "low" | "high":
            setattr(found, name, _limit(found.type, raw))
        case "normalisation":
            found.normalisation, known = number, descriptions.normalisation()
            if number >> known["valid"] & 1:
                found.full_scale = 1 << number % known["bits"]
        case "elements" | "extension" | "reference":
            setattr(found, name, number)


def _identifier(found: Description, word: int) -> None:
    code = word & 0xFF
    row, bits = spec.formats().get(code), descriptions.bits()
    found.identifier = word
    found.type = f"0x{code:02X}" if row is None else row.name
    found.writable = not word >> bits["read_only"] & 1
    for name in ("text_array", "changed", "reset_only", "array"):
        setattr(found, name, bool(word >> bits[name] & 1))


def _limit(type_name: str | None, raw: bytes) -> Value | None:
    """A limit as a value of the type: all four bytes, or the last ones, after nothing but copies of its sign."""
    row = None if type_name is None else spec.format_named(type_name)
    if row is None or row.kind not in _LIMITED or row.size is None or row.size > _LIMIT:
        return None
    found = codec(row.code)
    front, value = raw[: _LIMIT - row.size], raw[_LIMIT - row.size :]
    negative = row.pack.islower() and value[0] >= 0x80
    if found is None or (any(front) and not (negative and front == b"\xff" * len(front))):
        return None
    return found.decode(value, 1)[0]


KEYS: Final = tuple(each.name for each in fields(Description))
"""The parts of a description in their order."""
