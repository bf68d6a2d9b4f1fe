"""The numbers of the words that fields of Wireshark are compared by (codes.toml): loading and lookup.

The words themselves are those of the model and of the other tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from ds47.spec import _load


def tables() -> tuple[str, ...]:
    """The names of the tables: "states", "operations", ..."""
    return tuple(_load("codes.toml"))


@cache
def codes(table: str) -> Mapping[str, int]:
    """Word -> number.

    Raises:
        KeyError: there is no table of that name.
    """
    return MappingProxyType(_load("codes.toml")[table])


@cache
def words(table: str) -> Mapping[int, str]:
    """Number -> word."""
    return MappingProxyType({code: word for word, code in codes(table).items()})
