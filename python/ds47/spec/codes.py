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
    return tuple(name for name in _load("codes.toml") if name != "analyzer_only")


@cache
def codes(table: str) -> Mapping[str, int]:
    """Word -> number. Raises KeyError where there is no table of that name."""
    return MappingProxyType(_load("codes.toml")[table])


def analyzer_only(table: str) -> tuple[str, ...]:
    """The words of a table that the plugin does not say."""
    return tuple(_load("codes.toml")["analyzer_only"].get(table, ()))


@cache
def of_plugin(table: str) -> Mapping[str, int]:
    """Word -> number, of what the plugin can say."""
    left_out = analyzer_only(table)
    found = {word: code for word, code in codes(table).items() if word not in left_out}
    return MappingProxyType(found)


@cache
def words(table: str) -> Mapping[int, str]:
    """Number -> word."""
    return MappingProxyType({code: word for word, code in codes(table).items()})
