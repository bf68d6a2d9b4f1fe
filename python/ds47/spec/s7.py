"""The tables of S7 communication as Python objects (spec/s7.toml).

Loading, lookup and words only; PDUs are decoded in `ds47.s7`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, lru_cache
from types import MappingProxyType

from ds47.spec import _load
from ds47.spec.rows import Row
from ds47.spec.words import Words


class S7Code(Row):
    """A code with its words: a kind of PDU, a function, a return code, an error, a group, an owner of a TSAP."""

    code: int
    en: str
    zh: str
    id: str = ""
    last: int | None = None
    """Up to which code the row goes, where it is more than one."""


class Area(Row):
    """An area of memory."""

    code: int
    letter: str
    """What stands in front of its addresses."""
    en: str
    zh: str
    elements: bool = False
    """An address is the number of an element, not of a bit."""
    numbered: bool = False
    """The area has a number, as a data block has."""


class Size(Row):
    """A transport size of an item, or of data."""

    code: int
    id: str
    bits: int
    """Of one element; of data, of what its length counts."""
    letter: str = ""
    """With it one element is written: DB1.DBW0."""


class CpuKind(Row):
    """A kind of CPU and the bytes that it copies without interruption."""

    id: str
    block: int
    en: str
    zh: str


class Order(Row):
    """How the order numbers of a kind of CPU begin; "?" is any character."""

    number: str
    cpu: str
    """Its id in [[cpu]]."""


class Room(Row):
    """What a PDU has no room for: `fixed` bytes, and `each` for every item."""

    fixed: int
    each: int


CPU = "cpu"
"""What shows that a server of S7 is no drive."""
_WORDS = Words("s7.toml")
flaw_ids, flaw_text = _WORDS.flaw_ids, _WORDS.flaw_text
CODES = ("kind", "function", "return_code", "error_class", "error", "group", "tsap")


@cache
def codes(table: str) -> Mapping[int, S7Code]:
    """One of CODES, by code."""
    return MappingProxyType({row["code"]: S7Code(**row) for row in _load("s7.toml")[table]})


@cache
def areas() -> Mapping[int, Area]:
    """The areas by code."""
    return MappingProxyType({row["code"]: Area(**row) for row in _load("s7.toml")["area"]})


@cache
def sizes() -> Mapping[int, Size]:
    """Transport sizes of items, by code."""
    return MappingProxyType({row["code"]: Size(**row) for row in _load("s7.toml")["size"]})


@cache
def data_sizes() -> Mapping[int, Size]:
    """Transport sizes of data, by code."""
    return MappingProxyType({row["code"]: Size(**row) for row in _load("s7.toml")["data_size"]})


@cache
def cpus() -> Mapping[str, CpuKind]:
    """Kinds of CPU by their id."""
    return MappingProxyType({row["id"]: CpuKind(**row) for row in _load("s7.toml")["cpu"]})


def is_drive(kind: str) -> bool:
    """Whether a type of station in DCP is a drive with parameters that S7 reaches."""
    return kind.upper().startswith(tuple(_load("s7.toml")["drive_stations"]))


def is_drive_device(vendor_id: int, device_id: int) -> bool:
    """Whether a device of PROFINET is such a drive."""
    return [vendor_id, device_id >> 8] in _load("s7.toml")["drive_devices"]


def is_cpu(kind: str | None, identity: tuple[int, int] | None) -> bool:
    """Whether a type of station, or vendor and device id, are those of a CPU."""
    named = kind is not None and kind.upper().startswith(tuple(_load("s7.toml")["cpu_stations"]))
    return named or (
        identity is not None and [identity[0], identity[1] >> 8] in _load("s7.toml")["cpu_devices"]
    )


def is_cpu_order(number: str) -> bool:
    """Whether an order number is that of a CPU, its kind known or not."""
    return number.upper().startswith(tuple(_load("s7.toml")["cpu_orders"]))


@cache
def orders() -> tuple[Order, ...]:
    """Order numbers of CPUs; the first that fits counts."""
    return tuple(Order(**row) for row in _load("s7.toml")["order"])


def cpu_of_order(number: str) -> CpuKind | None:
    """The kind of CPU with an order number; None where it is none, or not known."""
    number = " ".join(number.upper().split())
    for row in orders():
        pairs = zip(row.number, number, strict=False)
        if len(number) >= len(row.number) and all(want in ("?", has) for want, has in pairs):
            return cpus()[row.cpu]
    return None


@cache
def rooms() -> Mapping[str, Room]:
    """What has no room in a PDU, by "get", "put", "usend", "bsend_first", "bsend"."""
    return MappingProxyType({name: Room(**row) for name, row in _load("s7.toml")["room"].items()})


@lru_cache(maxsize=256)
def room(use: str, pdu_length: int, items: int = 1) -> int:
    """Bytes of user data that a PDU of this length holds."""
    row = rooms()[use]
    return pdu_length - row.fixed - items * row.each


def code_text(table: str, code: int, lang: str = "en") -> str:
    """What a code of one of CODES means, an unknown one too."""
    row = codes(table).get(code)
    return _WORDS.word("unknown", lang).format(code=code) if row is None else row.text(lang)


def error_text(error: int, lang: str = "en") -> str:
    """What an error word means: the whole of it, else its class."""
    whole = codes("error").get(error)
    found = whole.text(lang) if whole else code_text("error_class", error >> 8, lang)
    return _WORDS.word("error", lang).format(text=found, code=error)


def owner(tsap: bytes | None) -> str:
    """Who owns a connection by a TSAP of two bytes: an id of [[tsap]]; empty where it does not tell."""
    if tsap is None or len(tsap) != 2 or not tsap[0]:
        return ""
    for row in codes("tsap").values():
        if row.code <= tsap[0] <= (row.last or row.code):
            return row.id
    return ""


def rack_and_slot(tsap: bytes | None) -> tuple[int, int] | None:
    """Rack and slot in the TSAP of a server; None if it has none."""
    if tsap is None or len(tsap) != 2 or not tsap[0]:
        return None
    return tsap[1] >> 5, tsap[1] & 0x1F
