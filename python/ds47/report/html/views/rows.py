"""The transactions as the script wants them: short rows, and tables for what repeats.

The order of a row is that of ROW; templates/report/data.js reads it by the same names.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Mapping
from operator import attrgetter
from typing import Any

from ds47 import spec
from ds47.model import (
    OPERATIONS,
    S7,
    STATES,
    CaptureResult,
    Item,
    Parameter,
    ParameterError,
    Transaction,
)
from ds47.profidrive.drive_objects import Identity
from ds47.report import descriptions, plc, s7
from ds47.report import values as meanings
from ds47.report.bilingual import LANGUAGES
from ds47.report.clock import first_ns
from ds47.report.formatting import address, escape, value
from ds47.report.html import messages
from ds47.report.targets import Targets
from ds47.spec import s7 as s7_tables
from ds47.spec.semantics import known

ROW = (
    "id", "operation", "state", "controller", "device", "channel", "axis", "request_reference",
    "start", "duration", "write_request", "write_response", "read_request", "read_response",
    "polls", "rereads", "write_status", "read_status", "request", "response", "parameters", "findings", "plc",
    "object",
)  # fmt: skip
"""`start` and `duration` are microseconds with fractions, `start` from the first frame of the capture on."""
MOST_BYTES = 2048
"""Bytes of a message that the page shows."""
VALUES = 64
"""Values of one parameter that the page shows; the last of a row says how many there are."""


def packed_rows(result: CaptureResult, most: int, targets: Targets | None = None) -> dict[str, Any]:
    """The rows of a capture with their tables; `object` is what `objects` has the name of."""
    items = _chosen(result.transactions, most)
    start_ns = first_ns(result) or 0
    stations = {each.ip: each.station for each in result.devices}
    targets = targets or Targets(result.evidence)
    connections = {each.id: s7.ends(each) for each in result.connections}
    tables = _Tables(stations, targets, targets.labels(result.evidence), connections)
    witness = plc.Witness(result)
    rows = [_row(each, start_ns, tables, witness) for each in items]
    return {
        "row": ROW,
        "rows": rows,
        "operations": OPERATIONS,
        "states": STATES,
        "sizes": _sizes(),
        "global_pnus": sorted(known().global_pnus),
        **tables.lists(),
    }


def _sizes() -> dict[str, int]:
    """Bytes of a value by the name of its format; not where there are two sizes of that name."""
    return {
        each.name: each.size
        for each in spec.formats().values()
        if each.size and each.other_size is None
    }


def _chosen(items: list[Transaction], most: int) -> list[Transaction]:
    """Those that are not ok and then the first ones, as many as there is room for, in their order."""
    if len(items) > most:
        ranked = sorted(items, key=lambda each: (each.state == "ok" and not each.findings, each.id))
        items = ranked[:most]
    return sorted(items, key=attrgetter("id"))


class _Positions(dict[Hashable, int]):
    """Where an item stands in a table; one that does not comes at its end."""

    def __missing__(self, item: Hashable) -> int:
        number = self[item] = len(self)
        return number


class _Tables:
    """What repeats from row to row, each once, by its position in a list."""

    def __init__(
        self,
        stations: Mapping[str, str | None],
        targets: Targets,
        labels: Mapping[Identity, str],
        connections: Mapping[int, str],
    ) -> None:
        self.connections = connections
        self.targets = targets
        self._labels = labels
        self._stations = stations
        self.positions: defaultdict[str, _Positions] = defaultdict(_Positions)

    def lists(self) -> dict[str, list[Any]]:
        """The tables for the page, in words."""
        found: dict[str, list[Any]] = {name: list(each) for name, each in self.positions.items()}
        found["devices"] = [
            [ip, escape(self._stations.get(ip) or "")] for ip in found.get("devices", [])
        ]
        found["objects"] = [self._labels[each] for each in found.get("objects", [])]
        found["statuses"] = [
            [f"{word:08X}", *messages.status(word)] for word in found.get("statuses", [])
        ]
        found["rules"] = [
            [rule, messages.rule_name(rule), spec.rules()[rule].severity]
            for rule in found.get("rules", [])
        ]
        found["addresses"] = [
            _of_item(each) if isinstance(each, str) else _address(meanings.of_kind(each))
            for each in found.get("addresses", [])
        ]
        found["errors"] = [
            _code(each) if isinstance(each, int) else _failed(ParameterError(*each))
            for each in found.get("errors", [])
        ]
        return {"controllers": [], "channels": [], "plc": [], **found}


def _of_item(name: str) -> list[Any]:
    """An item of S7 in the place of a parameter: it has an address and no number."""
    return [escape(name), None, None, None, None, "", "", None, None]


def _code(code: int) -> list[Any]:
    """The return code of an item, in the place of an error number."""
    words = [s7_tables.code_text("return_code", code, lang) for lang in LANGUAGES]
    return [f"0x{code:02X}", *words, None]


def _item(name: str, item: Item, tables: _Tables) -> list[Any]:
    """An item as `_parameter`: its bytes are its value."""
    shown = [] if item.value is None else [s7.value(item.value, "en")]
    if (known := item.parameter) is not None:
        name = f"DO {item.drive_object} {address(known)}"
        shown = [value(each, known.format) for each in known.values] or shown
    row: list[Any] = [tables.positions["addresses"][name], shown, len(shown)]
    if item.code in (None, s7.OK):
        return row
    return [*row, 0, tables.positions["errors"][item.code]]


def _channel(item: Transaction, connections: Mapping[int, str]) -> Hashable:
    """What a transaction went by; of S7 the ends of its connection."""
    if item.channel == S7:
        ends = connections.get(item.connection or 0, "")
        return (ends, None, None, None, S7)
    return (item.ar, item.api, item.slot, item.subslot, item.index)


def _failed(error: ParameterError) -> list[Any]:
    return [error.number, *messages.error(error), error.info]


def _address(item: Parameter) -> list[Any]:
    row = [
        address(item), item.pnu, item.subindex, item.attribute, item.element_count,
        *messages.name(item), item.unit, item.format,
    ]  # fmt: skip
    return [*row, item.described_in] if item.described_in else row


def _row(item: Transaction, start_ns: int, tables: _Tables, witness: plc.Witness) -> list[Any]:
    positions, frames = tables.positions, item.frames
    return [
        item.id,
        OPERATIONS.index(item.operation),
        STATES.index(item.state),
        positions["controllers"][item.controller],
        positions["devices"][item.device],
        positions["channels"][_channel(item, tables.connections)],
        item.axis,
        item.request_reference,
        _microseconds(item.start_ns - start_ns),
        None if item.duration_ns is None else item.duration_ns / 1000,
        frames.write_request,
        frames.write_response,
        frames.read_request,
        frames.read_response,
        item.segments or frames.polls or 0,
        frames.rereads or 0,
        None if item.write_status is None else positions["statuses"][item.write_status],
        None if item.read_status is None else positions["statuses"][item.read_status],
        _hex(item.request),
        _hex(item.response),
        _asked(item, tables),
        item.findings and [positions["rules"][rule] for rule in item.findings],
        positions["plc"][witness.line(item)],
        positions["objects"][tables.targets.identity(item)],
    ]


def _microseconds(nanoseconds: int) -> int | float:
    return nanoseconds / 1000 if nanoseconds % 1000 else nanoseconds // 1000


def _asked(item: Transaction, tables: _Tables) -> list[list[Any]]:
    """The parameters of a transaction, of S7 its items."""
    if item.channel != S7:
        return [_parameter(each, tables) for each in item.parameters]
    name = "?" if item.r_id is None else f"R_ID {item.r_id:08X}"
    return [_item(each.address or name, each, tables) for each in item.items]


def _hex(data: bytes | None) -> str | None:
    if data is None:
        return None
    cut = data[:MOST_BYTES].hex()
    return cut if len(data) <= MOST_BYTES else f"{cut}+{len(data) - MOST_BYTES}"


def _parameter(item: Parameter, tables: _Tables) -> list[Any]:
    """Address, values, how many there are; then, where there are any, scaled values, error and meaning."""
    known = meanings.about(item)
    described = None if item.attribute == "value" else descriptions.parts(item)
    shown: list[Any] = (described or item.values)[:VALUES]
    if str in map(type, shown) and not described:
        shown = [value(each, item.format) if isinstance(each, str) else each for each in shown]
    row: list[Any] = [
        tables.positions["addresses"][known],
        shown,
        len(described) if described else descriptions.stated(item),
    ]
    scaled = None if item.scaled is None else [str(each) for each in item.scaled[:VALUES]]
    if meanings.may_mean(known, bool(item.value_texts)) and (meant := meanings.meaning(item)):
        return [*row, scaled or 0, None, list(meant)]
    if item.error is not None:
        of = item.error
        error = (of.code, of.info, of.vendor_id, of.said, of.ak)
        return [*row, scaled or 0, tables.positions["errors"][error]]
    return [*row, scaled] if scaled else row
