"""What is said about codes beyond their names: explain.toml as Python objects.

Loading and finding the entry for a code; how an answer is put together is `ds47.explain`. The
names of the codes are in `ds47.spec`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

from ds47.spec import _load, makers
from ds47.spec.rows import Row

BASES = ("documented", "usual", "unconfirmed")
"""How sure a cause is: a document says so, it is so in practice, or neither is certain."""


@dataclass(frozen=True, slots=True)
class CodeCause:
    """One cause of a code; `basis` is one of BASES."""

    en: str
    zh: str
    basis: str

    def text(self, lang: str) -> str:
        """The cause in "en" or "zh"."""
        return self.zh if lang == "zh" else self.en


@dataclass(frozen=True, slots=True)
class Explanation:
    """What is said about a code or a group of them; explain.toml says what the fields mean."""

    causes: tuple[CodeCause, ...]
    look_en: str
    look_zh: str
    en: str = ""
    zh: str = ""
    plc: str = ""
    filter: str = ""
    reserved: bool = False
    general: bool = False
    """It is the entry of any number of which nothing better is said."""

    def headline(self, lang: str) -> str:
        """The headline in "en" or "zh", with its placeholders."""
        return self.zh if lang == "zh" else self.en

    def look(self, lang: str) -> str:
        """What to look for in a capture."""
        return self.look_zh if lang == "zh" else self.look_en


class View(Row):
    """What one block shows, or one sentence about both where `block` is empty.

    `done` is DONE of WRREC or VALID of RDREC; None where the block says nothing. An empty status
    is the code itself.
    """

    en: str
    zh: str
    block: str = ""
    done: bool | None = None
    busy: bool | None = None
    error: bool | None = None
    status: str | None = None


def _table() -> dict[str, Any]:
    return _load("explain.toml")


@cache
def _entry(table: str, number: int) -> Explanation:
    return _explanation(_table()[table][number])


def _explanation(row: Mapping[str, Any], general: bool = False) -> Explanation:
    causes = tuple(CodeCause(**cause) for cause in row.get("cause", ()))
    known = ("look_en", "look_zh", "en", "zh", "plc", "filter", "reserved")
    return Explanation(
        causes, general=general, **{name: row[name] for name in known if name in row}
    )


def _within(row: Mapping[str, Any], name: str, value: int, last: str) -> bool:
    """Whether a row says nothing about a byte, or names it, or a range that holds it."""
    first = row.get(name)
    return first is None or bool(first <= value <= row.get(last, first))


def _bytes_match(row: Mapping[str, Any], rest: tuple[int, int, int]) -> bool:
    decode, code1, code2 = rest
    return (
        _within(row, "decode", decode, "decode_to")
        and _within(row, "code1", code1, "to")
        and _within(row, "code2", code2, "")
    )


@cache
def of_status(code: int, decode: int, code1: int, code2: int) -> Explanation | None:
    """What is said about a PNIOStatus by its four bytes (docs/protocol.md E.5)."""
    for number, row in enumerate(_table()["status"]):
        if code in row["services"] and _bytes_match(row, (decode, code1, code2)):
            return _entry("status", number)
    return None


@cache
def of_local(function: int, decode: int, code1: int, code2: int) -> Explanation | None:
    """What is said about a STATUS that the PLC itself makes up."""
    for number, row in enumerate(_table()["local"]):
        if row["function"] == function and _bytes_match(row, (decode, code1, code2)):
            return _entry("local", number)
    return None


def has_local(decode: int, code1: int) -> bool:
    """Whether a CPU has a meaning of its own for these two bytes of STATUS."""
    rows = (row for row in _table()["local"] if row["function"] == _CPU and "code1" in row)
    return any(_bytes_match(row, (decode, code1, 0)) for row in rows)


_CPU = 0xC0


@cache
def errors() -> tuple[Mapping[str, Any], ...]:
    """What is said about error numbers: of each maker, then of the profile, and at last of any other number."""
    own = (row | {"vendor": maker["name"]} for maker in makers() for row in maker.get("advice", ()))
    return (*own, *_table()["error"])


@cache
def of_error(code: int, vendor: str | None = None) -> Explanation:
    """What is said about an error number, of the profile or of the named vendor."""
    for row in errors():
        general = not row.keys() & {"vendor", "codes", "ranges"}
        if not general and row.get("vendor") != vendor:
            continue
        codes, ranges = row.get("codes"), row.get("ranges", ())
        everything = codes is None and not ranges
        if everything or code in (codes or ()) or any(a <= code <= b for a, b in ranges):
            return _explanation(row, general)
    raise KeyError(code)


@cache
def of_number(kind: str, code: int) -> Explanation | None:
    """What is said about an id, attribute, format, index, first byte of a status, or a rule."""
    for number, row in enumerate(_table()["number"]):
        if row["kind"] == kind and code in row.get("codes", (code,)):
            return _entry("number", number)
    return None


@cache
def numbers(kind: str) -> frozenset[int]:
    """The numbers of a kind that have a meaning of their own."""
    rows = (row for row in _table()["number"] if row["kind"] == kind)
    return frozenset(code for row in rows for code in row.get("codes", ()))


@cache
def message_classes() -> Mapping[int, CodeCause]:
    """What the channel error types of drives say; each has a text alone."""
    rows = _table()["message_class"]
    return MappingProxyType(
        {row["code"]: CodeCause(row["en"], row["zh"], "documented") for row in rows}
    )


@cache
def of_unknown() -> Explanation:
    """What is said about a code if only its parts are known."""
    row = _table()["unknown"]
    cause = CodeCause(row["cause_en"], row["cause_zh"], "usual")
    return Explanation((cause,), row["look_en"], row["look_zh"], plc=row["plc"])


def words(lang: str) -> Mapping[str, str]:
    """Labels and sentences of the answers."""
    table: Mapping[str, str] = _table()["words"]["zh" if lang == "zh" else "en"]
    return table


def forms(lang: str) -> str:
    """Which forms of a code are taken, in one line."""
    return str(_table()["forms"]["zh" if lang == "zh" else "en"])


@cache
def kinds() -> Mapping[str, str]:
    """A word in front of a code, in lower case -> the kind of code that it announces."""
    return {word: row["kind"] for row in _table()["kind"] for word in row["words"]}


@cache
def kind_word(kind: str) -> str:
    """The word by which the program itself asks for a kind."""
    return next(str(row["say"]) for row in _table()["kind"] if row["kind"] == kind)


@cache
def rank(name: str) -> int:
    """Where a meaning stands among several, the first is 0."""
    order: list[str] = _table()["order"]["kinds"]
    return order.index(name)


@cache
def views(name: str) -> tuple[View, ...]:
    """What WRREC and RDREC show, by the name of the view."""
    rows = []
    for row in _table()["plc"][name]:
        fields = dict(row)
        if "valid" in fields:
            fields["done"] = fields.pop("valid")
        rows.append(View(**fields))
    return tuple(rows)


def filters(name: str) -> Mapping[str, str]:
    """The display filters of that name: "wireshark" and "plugin", if there are any."""
    table: Mapping[str, str] = _table()["filter"][name]
    return table


def input_name(number: int, lang: str) -> str:
    """The input of WRREC and RDREC that Error_Decode 0x81 and so on counts."""
    table = _table()["parameters"]
    if 1 <= number <= len(table["names"]):
        return str(table["names"][number - 1])
    return str(table["unknown_zh" if lang == "zh" else "unknown_en"])


def family(digit: str, lang: str) -> str | None:
    """What the rules DS`digit`xx are about."""
    row = _table()["families"].get(digit)
    return None if row is None else str(row["zh" if lang == "zh" else "en"])
