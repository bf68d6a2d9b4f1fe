"""The formats of values: bytes to values and back, and the physical values of normalised formats.

One `Codec` per format of spec/formats.toml, made when first used. Blocks, pads and what to do with
unknown formats are in `parameter`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from datetime import date, timedelta
from functools import cache
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.profidrive.model import Block, Value

_EXACT = 2**53
"""A double, and so many JSON readers, cannot hold every whole number beyond this."""
_FLOAT32: Final = struct.Struct(">f")
_NORMAL, _TOO_LARGE = 2.0**-126, 2.0**128 - 2.0**103
"""Below the first, a Float32 has fewer digits; from the second on, a double is infinite as a Float32."""
_LARGEST: Final = {4: "3.4028235e+38", 8: "1.7976931348623157e+308"}
"""The largest finite numbers, by bytes."""
_LEAST_NORMAL: Final = {0x08: 2.0**-126, 0x0F: 2.0**-1022}
"""Float32 and Float64: what is nearer to zero is no number that anybody typed."""
_MOST: Final = 1e30
_DAY_MS = 86_400_000
_DATE: Final = (63, 31, 31, 63, 127)
"""The bits of minute, hour, day, month and year, each a byte."""
_MS_MASK = 0x0FFFFFFF
"""Times of day use 28 of their 32 bits."""


class Codec(NamedTuple):
    """How the values of one format are read, written and scaled.

    decode: (bytes of whole values, how many) -> values.  encode: the reverse; raises ValueError with
    the value that does not fit.  scale: (values, bytes) -> physical values; None if the format has none.
    """

    size: int
    decode: Callable[[bytes, int], list[Value]]
    encode: Callable[[Sequence[Value]], bytes]
    scale: Callable[[Sequence[Value], bytes], list[Value]] | None = None
    whole: bool = False
    unpack: Callable[[bytes], tuple[Any, ...]] | None = None
    """`decode` of one value, if that is all there is to do."""


@cache
def codec(code: int, size: int | None = None) -> Codec | None:
    """The codec of a format code, None if the length of its values is unknown.

    Args:
        code: a code of spec/formats.toml, dialects already resolved.
        size: bytes per value, if the format has two sizes; None: the usual one.
    """
    row = spec.formats().get(code)
    if row is None or row.size is None or row.kind not in _MAKERS:
        return None
    return _MAKERS[row.kind](row, row.size if size is None else size)


def number_value(number: int | float) -> Value:
    """A number as a value: a decimal string beyond 2^53, a word if it is not finite."""
    if isinstance(number, int):
        return number if -_EXACT <= number <= _EXACT else str(number)
    if math.isfinite(number):
        return number
    return "NaN" if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"


def float32_value(number: float) -> Value:
    """The shortest decimal with the same Float32, as a double; a word if it is not finite."""
    if not math.isfinite(number):
        return number_value(number)
    if number.is_integer() and abs(number) < 2**24:
        return number
    wire = _FLOAT32.pack(number)
    for digits in (6, 7, 8) if abs(number) >= _NORMAL else range(1, 9):
        short = float(f"{number:.{digits}g}")
        if abs(short) < _TOO_LARGE and _FLOAT32.pack(short) == wire:
            return short
    return float(f"{number:.9g}")


def is_unlikely(block: Block) -> bool:
    """Whether a value to be written is none that anybody means: not finite, denormal, or huge."""
    least = _LEAST_NORMAL.get(block.format)
    if least is None:
        return False
    for value in block.values:
        if isinstance(value, str):  # NaN or infinite
            return True
        if value and not least <= abs(value) <= _MOST:
            return True
    return False


def _integer(value: Value) -> int:
    try:
        if isinstance(value, float) and not value.is_integer():
            raise ValueError
        return int(value, 0) if isinstance(value, str) else int(value)
    except ValueError:
        raise ValueError(f"{value} is not a whole number") from None


def _real(value: Value) -> float:
    """A number, or a word for one that is not finite.

    Raises:
        ValueError: it is not a number.
        OverflowError: it is beyond any double; `float` would make it infinite.
    """
    try:
        number = float(value)
    except ValueError:
        raise ValueError(f"{value} is not a number") from None
    if isinstance(value, str) and math.isinf(number) and "inf" not in value.lower():
        raise OverflowError
    return number


def _misfit(value: Value, row: spec.Format, low: Value, high: Value) -> ValueError:
    return ValueError(f"{value} does not fit {row.name} ({low} to {high})")


def _integers(values: Sequence[Value], row: spec.Format, low: int, high: int) -> list[int]:
    numbers = [_integer(value) for value in values]
    for number in numbers:
        if not low <= number <= high:
            raise _misfit(number, row, low, high)
    return numbers


def _number(row: spec.Format, size: int) -> Codec:
    letter = row.pack
    one = struct.Struct(">" + letter)
    low = -(1 << 8 * size - 1) if letter.islower() else 0
    high = low + (1 << 8 * size) - 1

    def decode(raw: bytes, count: int) -> list[Value]:
        numbers = struct.unpack(f">{count}{letter}", raw)
        return [number_value(n) for n in numbers] if size == 8 else list(numbers)

    def encode(values: Sequence[Value]) -> bytes:
        return b"".join(one.pack(number) for number in _integers(values, row, low, high))

    if row.divide is None:
        return Codec(size, decode, encode, unpack=one.unpack if size < 8 else None)
    multiply, divide = row.multiply or 1, row.divide

    def scale(values: Sequence[Value], _raw: bytes) -> list[Value]:
        return [int(value) * multiply / divide for value in values]

    return Codec(size, decode, encode, scale)


def _float(row: spec.Format, size: int) -> Codec:
    one = struct.Struct(">" + row.pack)
    show = float32_value if size == 4 else number_value
    largest = _LARGEST[size]

    def decode(raw: bytes, count: int) -> list[Value]:
        if count == 1:
            return [show(one.unpack(raw)[0])]
        return [show(number) for number in struct.unpack(f">{count}{row.pack}", raw)]

    def pack(value: Value) -> bytes:
        try:
            return one.pack(_real(value))
        except OverflowError:
            raise _misfit(value, row, f"-{largest}", largest) from None

    def encode(values: Sequence[Value]) -> bytes:
        return b"".join(map(pack, values))

    return Codec(size, decode, encode)


def _text(row: spec.Format, size: int) -> Codec:
    def decode(raw: bytes, count: int) -> list[Value]:
        text = raw.decode("latin-1")
        if row.whole:
            return [text] if count else []
        return [text[i : i + size] for i in range(0, size * count, size)]

    def encode(values: Sequence[Value]) -> bytes:
        try:
            parts = [str(value).encode("latin-1") for value in values]
        except UnicodeEncodeError as problem:
            character = problem.object[problem.start]
            raise ValueError(
                f"{row.name} cannot hold {character!r}, only Latin-1 characters"
            ) from None
        if row.whole:
            return b"".join(parts)
        if any(len(part) > size for part in parts):
            raise ValueError(f"{row.name} holds at most {size} characters")
        return b"".join(part.ljust(size) for part in parts)

    return Codec(size, decode, encode, whole=row.whole)


def _bytes(value: Value) -> bytes:
    try:
        return bytes.fromhex(str(value))
    except ValueError:
        raise ValueError(
            f"{value} is not a hexadecimal number of whole bytes, such as 0a1b"
        ) from None


def _octets(row: spec.Format, size: int) -> Codec:
    def decode(raw: bytes, count: int) -> list[Value]:
        if row.whole:
            return [raw.hex()] if count else []
        return [raw[i : i + size].hex() for i in range(0, size * count, size)]

    def encode(values: Sequence[Value]) -> bytes:
        parts = [_bytes(value) for value in values]
        if not row.whole and any(len(part) != size for part in parts):
            raise ValueError(f"{row.name} needs {size} bytes as hexadecimal digits")
        return b"".join(parts)

    return Codec(size, decode, encode, whole=row.whole)


def _with_status(row: spec.Format, size: int) -> Codec:
    base = _octets(row, size)
    front = struct.Struct(f">{row.pack}B")

    def scale(_values: Sequence[Value], raw: bytes) -> list[Value]:
        numbers = [number for number, _status in front.iter_unpack(raw)]
        return [float32_value(n) if row.pack == "f" else number_value(n) for n in numbers]

    return Codec(size, base.decode, base.encode, scale)


def _raw_integer(show: Callable[[bytes], Value]) -> Callable[[spec.Format, int], Codec]:
    """Formats whose value is the integer of all their bytes; `show` gives the physical value."""

    def make(row: spec.Format, size: int) -> Codec:
        high = (1 << 8 * size) - 1

        def decode(raw: bytes, count: int) -> list[Value]:
            parts = (raw[i : i + size] for i in range(0, size * count, size))
            return [number_value(int.from_bytes(part, "big")) for part in parts]

        def encode(values: Sequence[Value]) -> bytes:
            numbers = _integers(values, row, 0, high)
            return b"".join(number.to_bytes(size, "big") for number in numbers)

        def scale(_values: Sequence[Value], raw: bytes) -> list[Value]:
            return [show(raw[i : i + size]) for i in range(0, len(raw) - size + 1, size)]

        return Codec(size, decode, encode, scale)

    return make


def _clock(milliseconds: int) -> str:
    seconds, ms = divmod(milliseconds, 1000)
    return f"{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}.{ms:03}"


def _show_time_of_day(raw: bytes) -> Value:
    clock = _clock(int.from_bytes(raw[:4], "big") & _MS_MASK)
    if len(raw) < 6:
        return clock
    return f"{date(1984, 1, 1) + timedelta(int.from_bytes(raw[4:6], 'big'))}T{clock}"


def _show_duration(raw: bytes) -> Value:
    days = int.from_bytes(raw[4:6], "big") if len(raw) == 6 else 0
    return (days * _DAY_MS + int.from_bytes(raw[:4], "big")) / 1000


def _show_date(raw: bytes) -> Value:
    """ISO 8601, unchecked: a month 13 stays visible. Years 84 to 99 belong to the last century."""
    milliseconds = int.from_bytes(raw[:2], "big")
    minute, hour, day, month, year = (
        byte & bits for byte, bits in zip(raw[2:], _DATE, strict=True)
    )
    century = 1900 if year >= 84 else 2000
    seconds = f"{milliseconds // 1000:02}.{milliseconds % 1000:03}"
    return f"{century + year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{seconds}"


def _zero(row: spec.Format, size: int) -> Codec:
    def encode(values: Sequence[Value]) -> bytes:
        if values:
            raise ValueError(f"{row.name} takes no values")
        return b""

    return Codec(size, lambda _raw, _count: [], encode)


_MAKERS: dict[str, Callable[[spec.Format, int], Codec]] = {
    "number": _number,
    "float": _float,
    "text": _text,
    "octets": _octets,
    "with_status": _with_status,
    "date": _raw_integer(_show_date),
    "time_of_day": _raw_integer(_show_time_of_day),
    "duration": _raw_integer(_show_duration),
    "zero": _zero,
}
