"""The error numbers of Snap7 and of libnodave as Python objects (spec/snap7.toml): their parts, and the words."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple

from ds47.spec import _load
from ds47.spec.explanations import CodeCause
from ds47.spec.words import Words

_FILE = "snap7.toml"
word = Words(_FILE).word
CLIENT, CONNECTION, SOCKET = "client", "connection", "socket"
LIBNODAVE = "libnodave"
_WHOLE = 1 << 32
"""Numbers of libnodave are negative ones of 32 bits."""
_CLIENT_SHIFT, _CONNECTION_SHIFT, _SOCKET_MASK = 20, 16, 0xFFFF
_SHIFTS = {CLIENT: _CLIENT_SHIFT, CONNECTION: _CONNECTION_SHIFT, SOCKET: 0}
_SOCKET_ERROR = re.compile(r"socketerror\(([0-9]{1,5})\)")


class Part(NamedTuple):
    """A part of a number: CLIENT, CONNECTION, SOCKET or (the whole) LIBNODAVE, its code, and its row or None."""

    name: str
    code: int
    row: Mapping[str, Any] | None

    def text(self, lang: str) -> str:
        """What it says."""
        if self.row is None:
            return word("other_socket", lang).format(code=self.code)
        return str(self.row["zh" if lang == "zh" else "en"])

    def causes(self) -> Iterator[CodeCause]:
        """Its causes, the likeliest first."""
        yield from (CodeCause(**each) for each in (self.row or {}).get("cause", ()))

    @property
    def stands_for(self) -> tuple[int, ...]:
        """The words and return codes of S7 that it is made of."""
        return tuple((self.row or {}).get("stands_for", ()))


@cache
def _rows(table: str) -> Mapping[int, Mapping[str, Any]]:
    rows = _load(_FILE)[table]
    return MappingProxyType(
        {code: row for row in rows for code in row.get("codes", [row.get("code")])}
    )


@cache
def _names() -> Mapping[str, int]:
    rows = [(table, row) for table in _SHIFTS for row in _load(_FILE)[table]]
    named = {
        _plain(name): row.get("code", row.get("codes", [0])[0]) << _SHIFTS[table]
        for table, row in rows for name in row.get("names", ())
    }  # fmt: skip
    named |= {
        _plain(name): row["code"] + _WHOLE
        for row in _load(_FILE)[LIBNODAVE] for name in row.get("names", ())
    }  # fmt: skip
    return MappingProxyType(named)


def _plain(text: str) -> str:
    return "".join(text.split()).lower()


def numbers_named(text: str) -> list[int]:
    """The numbers that a text names as the libraries do: `CPU : Item not available`, `errCliItemNotAvailable`.

    That of a connection with the error of the socket behind it: `... recv TCP : Connection timed out`.
    """
    plain = _plain(text)
    found = list(dict.fromkeys(number for name, number in _names().items() if name in plain))
    sockets = [each for each in found if each <= _SOCKET_MASK]
    sockets += [int(each) & _SOCKET_MASK for each in _SOCKET_ERROR.findall(plain)]
    behind = sockets[0] if sockets else 0
    whole = [each for each in found if each > _SOCKET_MASK]
    return [each if each >> _CLIENT_SHIFT else each | behind for each in whole]


def general_cause(name: str) -> CodeCause:
    """The cause where the row of a part has none: of CLIENT, CONNECTION or LIBNODAVE."""
    return CodeCause(**_load(_FILE)["general"][name])


def parts(number: int) -> tuple[Part, ...]:
    """What a number consists of; empty where it is none of the library."""
    if whole := _rows(LIBNODAVE).get(number - _WHOLE):
        return (Part(LIBNODAVE, number - _WHOLE, whole),)
    client, rest = number >> _CLIENT_SHIFT, number & (1 << _CLIENT_SHIFT) - 1
    if client:
        row = _rows(CLIENT).get(client)
        return () if row is None or rest else (Part(CLIENT, client, row),)
    connection, socket = number >> _CONNECTION_SHIFT, number & _SOCKET_MASK
    row = _rows(CONNECTION).get(connection)
    if row is None:
        return ()
    behind = (Part(SOCKET, socket, _rows(SOCKET).get(socket)),) if socket else ()
    return (Part(CONNECTION, connection, row), *behind)
