"""What the Wireshark plugin says, as the dictionaries of the JSON report.

Reads the output of `tshark -2 -R frame -T pdml` and builds the transactions, the findings and the events of
drives of `ds47.report/2` from the `ds47.*` fields. Knows the layout of the plugin's tree and nothing of the
wire: what is compared with the analyzer here was decoded by the plugin. Running tshark is not here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from json import loads
from pathlib import Path
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element, iterparse

from ds47 import spec
from ds47.model import DS47
from ds47.profidrive.formats import codec
from ds47.profidrive.model import ERROR
from ds47.report import contract
from ds47.spec.codes import words
from ds47.spec.units import SECOND_NS, timestamp
from ds47.wireshark import described

_PREFIX = "ds47."
_TREES = ("ds47", "ds47_pzd")
_EXACT = 2**53
_OF_MESSAGE = ("request_reference", "axis")
"""What stands in a message, and not once more with the transaction."""
_FLOATS = ("NaN", "Infinity", "-Infinity")
_SCALED_TEXT = ("date", "time_of_day")


@dataclass(slots=True)
class Fields:
    """The transactions, by `id`, and the findings, in the order of the report, of one capture.

    Each of the events of drives has `frame`, and of its relation `relation`, `device`, `slot`, `subslot` and
    `telegrams` beside its own keys.
    """

    transactions: list[dict[str, Any]] = field(default_factory=list)
    findings: list[dict[str, Any]] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)


def read(source: str | Path | BinaryIO) -> Fields:
    """Reads PDML, packet by packet, so that memory grows with the transactions only.

    Raises:
        xml.etree.ElementTree.ParseError: the text is no XML, or ends early.
    """
    transactions: dict[int, dict[str, Any]] = {}
    findings: list[dict[str, Any]] = []
    events: list[dict[str, Any]] = []
    for frame, time, tree in _trees(source):
        events += [_event(frame, each) for each in tree.iter("field") if _name(each) == "pzd.event"]
        for item in tree.iterfind("field"):
            if _name(item) == "finding":
                findings.append(_finding(frame, item))
        for item in tree.iterfind("field"):
            if _name(item) == "transaction":
                number = int(_show(item))
                transaction = transactions.setdefault(number, _nothing(number))
                _merge(transaction, frame, tree, item)
                if not transaction["start"] or frame == transaction["frames"]["write_request"]:
                    transaction["start"] = time  # of PKW a response may stand before its request
    findings.sort(key=lambda f: (f["frame"], f["rule"], f["transaction"] or 0, f["offset"] or 0))
    ordered = [transactions[number] for number in sorted(transactions)]
    for transaction in ordered:
        about = {each["rule"] for each in findings if each["transaction"] == transaction["id"]}
        transaction["findings"] = sorted(about)
    return Fields(ordered, findings, events)


def _trees(source: str | Path | BinaryIO) -> Iterator[tuple[int, str, Element]]:
    """Number and time of the frame and tree of the plugin, for each of those trees."""
    root: Element | None = None
    frame, time = 0, ""
    for event, element in iterparse(source, events=("start", "end")):
        if root is None:
            root = element
        if event == "start":
            continue
        if element.tag == "field" and element.get("name") == "frame.number":
            frame = int(_show(element))
        elif element.tag == "field" and element.get("name") == "frame.time_epoch":
            time = timestamp(int(Decimal(_show(element)) * SECOND_NS))
        elif element.tag == "proto" and element.get("name") in _TREES:
            yield frame, time, element
        elif element.tag == "packet":
            root.clear()


def _name(item: Element) -> str:
    return (item.get("name") or "").removeprefix(_PREFIX)


def _show(item: Element) -> str:
    return item.get("show") or ""


def _children(item: Element) -> dict[str, str]:
    """The first field of each name that stands directly below."""
    found: dict[str, str] = {}
    for child in item.iterfind("field"):
        found.setdefault(_name(child), _show(child))
    return found


def _number(text: str | None) -> int | None:
    return None if text is None else int(text, 0)


def _coded(table: str, text: str | None) -> str | None:
    """The word of a number, as a field of words has it."""
    return None if text is None else words(table)[int(text)]


def _digits(text: str | None) -> str | None:
    """Bytes in hexadecimal, which Wireshark writes with colons."""
    return None if text is None else text.replace(":", "")


# Transactions


def _nothing(number: int) -> dict[str, Any]:
    """A transaction before its first frame is read, with its keys in the order of the report."""
    transaction = _empty(contract.TRANSACTION)
    transaction["channel"] = DS47
    transaction["id"] = number
    return transaction


def _empty(shape: contract.Shape) -> dict[str, Any]:
    """An object that has all its keys and no values."""
    return {
        key.name: []
        if key.schema.get("type") == "array"
        else _empty(key.shape)
        if key.shape
        else None
        for key in shape.keys
        if not key.channel
    }


def _merge(transaction: dict[str, Any], frame: int, tree: Element, item: Element) -> None:
    """Adds what one frame says; the frame with the whole transaction gives what only it has."""
    seen = _children(item)
    frames, message = transaction["frames"], {key: transaction[key] for key in _OF_MESSAGE}
    _read(transaction, contract.TRANSACTION, "", seen)
    transaction["channel"] = transaction["channel"] or DS47
    transaction["controller"] = _peer(seen, "controller", "master")
    transaction["device"] = _peer(seen, "device", "station")
    first = frames["write_request"]
    if frame == (first if first is not None else frames["read_response"]):
        head = _children(tree)  # the message as it was sent; that of an orphan as it was answered
        message = {key: _number(head.get(key)) for key in _OF_MESSAGE}
    transaction |= message
    for kind, known in transaction["bytes"].items():
        if known is None:
            transaction["bytes"][kind] = _digits(seen.get(f"bytes.{kind}"))
    if frame == (frames["read_response"] or first):
        _merge_all(transaction, tree, item)


def _read(found: dict[str, Any], shape: contract.Shape, prefix: str, seen: dict[str, str]) -> None:
    """Takes the keys of an object that are fields of the transaction."""
    for key in shape.keys:
        if key.shape is not None and "items" not in key.schema:
            _read(found[key.name], key.shape, f"{prefix}{key.name}.", seen)
        elif key.field and key.name != "id":
            found[key.name] = _taken(key, seen.get(prefix + key.name))


def _taken(key: contract.Key, text: str | None) -> Any:
    """The value of a key from what its field shows."""
    if text is None:
        return None
    _, kind, *more = key.field
    if kind == "code":
        return _coded(more[0], text)
    if key.take is contract.take_status:
        return f"{int(text, 0):08X}"
    if kind == "double":
        return float(text)
    return _number(text) if kind.startswith(("uint", "framenum")) else text


def _peer(seen: dict[str, str], key: str, on_bus: str) -> str | None:
    """Controller or device, as the report writes it: by IP, by MAC, or the address on PROFIBUS."""
    if on_bus in seen:
        return f"dp{seen[on_bus]}"
    return seen.get(key, seen.get(f"{key}.mac"))


def _merge_all(transaction: dict[str, Any], tree: Element, item: Element) -> None:
    transaction["frames"]["polls"] = list(_reads(item, "poll"))
    transaction["frames"]["rereads"] = list(_reads(item, "reread"))
    frames = transaction["frames"]
    asked = frames["read_response"] is None
    # The values of a change stand in its request; beneath a response are copies of them.
    written = transaction["operation"] == "change" and frames["write_request"] is not None
    prefix = ("" if written else None) if asked else ("written." if written else "")
    transaction["parameters"] = [
        _parameter(each, prefix) for each in tree.iterfind("field") if _name(each) == "parameter"
    ]


def _reads(item: Element, kind: str) -> Iterator[dict[str, int | None]]:
    """Reads as they stand one behind the other: a request may be missing, a response never is."""
    request: int | None = None
    for child in item.iterfind("field"):
        if _name(child) == f"frames.{kind}.request":
            request = int(_show(child))
        elif _name(child) == f"frames.{kind}.response":
            yield {"request": request, "response": int(_show(child))}
            request = None


# Parameters


@cache
def _formats() -> dict[str, spec.Format]:
    return {row.name: row for row in spec.formats().values()}


def _named(rows: Mapping[int, spec.Format | spec.Attribute], text: str | None) -> str | None:
    """The name of a format or an attribute, `0x77` of one that has none."""
    if text is None:
        return None
    code = int(text, 0)
    known = rows.get(code)
    return known.name if known else f"0x{code:02X}"


def _parameter(item: Element, prefix: str | None) -> dict[str, Any]:
    """A parameter; `prefix` is that of the fields with the format of its values, None without any."""
    seen = _children(item)
    name = count = None
    if prefix is not None:
        name, count = (
            _named(spec.formats(), seen.get(f"{prefix}format")),
            _number(seen.get(f"{prefix}value_count")),
        )
        if name == spec.formats()[ERROR].name:
            name = count = None
    values = [each for each in item.iterfind("field") if _name(each) == "value"]
    frames = [int(_show(each)) for each in item.iterfind("field") if _name(each) == "described_in"]
    return {
        "pnu": _number(seen.get("pnu")),
        "subindex": _number(seen.get("subindex")),
        "attribute": _named(spec.attributes(), seen.get("attribute")),
        "element_count": _number(seen.get("element_count")),
        "name": seen.get("name"),
        "unit": seen.get("unit"),
        "format": name,
        "value_count": count,
        "values": [_value(each, name) for each in values],
        "scaled": _scaled(values, name) if values or not count else None,
        "error": _error(seen),
        **described.read(item, name),
        **({"family": seen["family"]} if "family" in seen else {}),
        **({"described_in": frames} if frames else {}),
        **({"meaning": seen["meaning"]} if "meaning" in seen else {}),
    }


def _error(seen: dict[str, str]) -> dict[str, Any] | None:
    if "error.text" not in seen:
        return None
    return {
        "code": _number(seen.get("error.code")),
        "text": seen["error.text"],
        "info": _number(seen.get("error.info")),
    }


def _value(item: Element, name: str | None) -> int | float | str:
    kind = _formats()[name].kind if name in _formats() else "octets"
    if name is None and _show(item).isdigit():
        return int(_show(item))  # a number of elements, which PKW tells without a format
    below = _children(item)
    if kind == "text":
        digits = _digits(below.get("value.bytes"))
        if digits is not None:
            return bytes.fromhex(digits).decode("latin-1")
        return _show(item)[1:-1]  # in quotes
    if kind in ("octets", "with_status"):
        return _show(item).strip('"')  # characters of an unknown code are shown in quotes, too
    return _float(_show(item)) if kind == "float" else _integer(_show(item))


def _scaled(values: list[Element], name: str | None) -> list[int | float | str] | None:
    row = _formats().get(name or "")
    found = codec(row.code) if row else None
    if row is None or found is None:
        return None
    texts = [
        _show(child)
        for item in values
        for child in item.iterfind("field")
        if _name(child) == "scaled"
    ]
    if found.scale is None:  # by the description of the parameter
        return [_float(text) for text in texts] or None
    return [_physical(text, row) for text in texts]


def _physical(text: str, row: spec.Format) -> int | float | str:
    if row.kind in _SCALED_TEXT:
        return text
    if row.kind == "with_status" and row.pack != "f":
        return _integer(text)
    return _float(text)


def _float(text: str) -> float | str:
    return text if text in _FLOATS else float(text)


def _integer(text: str) -> int | str:
    return int(text) if -_EXACT <= int(text) <= _EXACT else text


# Findings


def _finding(frame: int, item: Element) -> dict[str, Any]:
    seen = _children(item)
    frames = [int(_show(each)) for each in item.iterfind("field") if _name(each) == "finding.frame"]
    return {
        "rule": _show(item),
        "severity": _coded("severities", seen.get("finding.severity")),
        "message": seen.get("finding.message", ""),
        "args": loads(seen.get("finding.args", "{}")),
        "frame": frame,
        "frames": sorted({frame, *frames}),
        "transaction": _number(seen.get("finding.transaction")),
        "offset": _number(seen.get("finding.offset")),
    }


def _event(frame: int, item: Element) -> dict[str, Any]:
    seen = {key.removeprefix("pzd.event."): text for key, text in _children(item).items()}
    return {
        "frame": frame,
        "name": _coded("events", seen.get("name")),
        "word": _coded("drive_words", seen.get("word")),
        "before": _number(seen.get("before")),
        "after": _number(seen.get("after")),
        "state": _coded("drive_states", seen.get("state")),
        "overlays": tuple(seen.get("overlays", "").split()),
        "relation": int(seen["relation"]),
        "device": _peer(seen, "device", "station"),
        "slot": _number(seen.get("slot")),
        "subslot": _number(seen.get("subslot")),
        "telegrams": [int(each) for each in seen.get("telegrams", "").split()],
    }
