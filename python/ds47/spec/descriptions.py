"""The layout of the description of a parameter, and its units: descriptions.toml as Python objects."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from types import MappingProxyType

from ds47.spec import _load
from ds47.spec.rows import Row


class DescriptionElement(Row):
    """A part of a description, and the subindex under which it is read alone (docs/protocol.md C)."""

    number: int
    name: str
    offset: int
    size: int


class Quantity(Row):
    """What a parameter measures: the unit of its conversion index 0."""

    index: int
    unit: str
    prefix: bool = False


@cache
def length() -> int:
    """Bytes of a whole description."""
    size: int = _load("descriptions.toml")["length"]
    return size


@cache
def text_length() -> int:
    """Bytes of an entry of a text array."""
    size: int = _load("descriptions.toml")["text_length"]
    return size


@cache
def elements() -> tuple[DescriptionElement, ...]:
    """The elements of a description in their order."""
    return tuple(DescriptionElement(**row) for row in _load("descriptions.toml")["element"])


@cache
def bits() -> Mapping[str, int]:
    """The bits of the identifier that have a meaning, by name."""
    return MappingProxyType(dict(_load("descriptions.toml")["bit"]))


@cache
def normalisation() -> Mapping[str, int]:
    """Of the normalisation: the bit that makes it valid, and how many values the number of a bit has."""
    return MappingProxyType(dict(_load("descriptions.toml")["normalisation"]))


@cache
def quantities() -> Mapping[int, Quantity]:
    """What is measured, by variable index."""
    rows = _load("descriptions.toml")["quantity"]
    return MappingProxyType({row["index"]: Quantity(**row) for row in rows})


@cache
def powers() -> int:
    """The largest conversion index that is a power of ten."""
    most: int = _load("descriptions.toml")["conversion"]["powers"]
    return most


@cache
def own_units() -> Mapping[tuple[int, int], str]:
    """Units that are no power of ten of another one, by variable index and conversion index."""
    rows = _load("descriptions.toml")["conversion"]["unit"]
    return MappingProxyType({(row["quantity"], row["index"]): row["unit"] for row in rows})


@cache
def prefixes() -> Mapping[int, str]:
    """Letters before a unit, by the power of ten that they mean."""
    rows = _load("descriptions.toml")["conversion"]["prefix"]
    return MappingProxyType({row["power"]: row["text"] for row in rows})


@lru_cache(maxsize=1024)
def unit(quantity: int, conversion: int) -> str | None:
    """The unit of a variable attribute: `kW`, `10^-1 °C`; None where the tables do not know it.

    Args:
        quantity: the variable index, 0..255.
        conversion: the conversion index, -128..127.
    """
    known, own = quantities().get(quantity), own_units().get((quantity, conversion))
    if known is None or own is not None:
        return own
    if not -powers() - 1 <= conversion <= powers():
        return None
    if conversion == 0:
        return known.unit
    letter = prefixes().get(conversion) if known.prefix else None
    return f"10^{conversion} {known.unit}" if letter is None else letter + known.unit
