"""Report as JSON, `ds47.report/1`: the contract that other programs build on.

The functions turn one thing of the model each into plain dictionaries (`ds47.report.ndjson` uses
them too); `Writer` lays them out with one transaction a line, so that a difference between two
reports is a difference of lines. Key order and number texts never vary. What the keys mean is in
`ds47.model` and in schema/report-1.schema.json.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from json import dumps
from typing import Any, TextIO

from ds47 import __version__
from ds47.model import CaptureResult, Device, Finding, Frames, Parameter, Report, Transaction
from ds47.report import SCHEMA, Options, message, write_all
from ds47.report import Writer as _Writer

_EPOCH_DAY = date(1970, 1, 1).toordinal()
_DAYS_IN_400_YEARS = 146_097
_NS_IN_DAY = 86_400 * 10**9


def timestamp(time_ns: int) -> str:
    """Nanoseconds since 1970 as ISO 8601 in UTC with nine digits; any number, as captures may lie.

    `datetime` ends with the year 9999; the calendar repeats every 400 years, so only the years
    inside one cycle are asked of it.
    """
    days, ns = divmod(time_ns, _NS_IN_DAY)
    cycles, days = divmod(days, _DAYS_IN_400_YEARS)
    day = date.fromordinal(_EPOCH_DAY + days)
    seconds, ns = divmod(ns, 10**9)
    minutes, second = divmod(seconds, 60)
    hour, minute = divmod(minutes, 60)
    year = day.year + 400 * cycles
    return f"{year:04}-{day:%m-%d}T{hour:02}:{minute:02}:{second:02}.{ns:09}Z"


def milliseconds(duration_ns: int | None) -> float | None:
    """A duration in ms, correctly rounded from integer nanoseconds."""
    return None if duration_ns is None else duration_ns / 1_000_000


def status(word: int | None) -> str | None:
    """A PNIO status as the 8 hex digits that people know (docs/protocol.md C): `DE80B500`."""
    return None if word is None else f"{word:08X}"


def device(item: Device) -> dict[str, Any]:
    """A device as an object of the contract."""
    return {
        "ip": item.ip,
        "mac": item.mac,
        "station": item.station,
        "vendor_id": item.vendor_id,
        "device_id": item.device_id,
    }


def frames(item: Frames) -> dict[str, Any]:
    """The frame numbers of a transaction as an object of the contract."""
    return {
        "write_request": item.write_request,
        "write_response": item.write_response,
        "read_request": item.read_request,
        "read_response": item.read_response,
        "polls": [{"request": request, "response": response} for request, response in item.polls],
        "rereads": [
            {"request": request, "response": response} for request, response in item.rereads
        ],
    }


def parameter(item: Parameter) -> dict[str, Any]:
    """A parameter of a transaction as an object of the contract."""
    error = item.error and {
        "code": item.error.code,
        "text": item.error.text,
        "info": item.error.info,
    }
    return {
        "pnu": item.pnu,
        "subindex": item.subindex,
        "attribute": item.attribute,
        "element_count": item.element_count,
        "name": item.name,
        "unit": item.unit,
        "format": item.format,
        "value_count": item.value_count,
        "values": item.values,
        "scaled": item.scaled,
        "error": error,
    }


def transaction(item: Transaction) -> dict[str, Any]:
    """A transaction as an object of the contract."""
    return {
        "id": item.id,
        "operation": item.operation,
        "state": item.state,
        "controller": item.controller,
        "device": item.device,
        "ar": item.ar,
        "api": item.api,
        "slot": item.slot,
        "subslot": item.subslot,
        "index": item.index,
        "request_reference": item.request_reference,
        "axis": item.axis,
        "frames": frames(item.frames),
        "start": timestamp(item.start_ns),
        "duration_ms": milliseconds(item.duration_ns),
        "bytes": {
            "request": None if item.request is None else item.request.hex(),
            "response": None if item.response is None else item.response.hex(),
        },
        "status": {"write": status(item.write_status), "read": status(item.read_status)},
        "parameters": [parameter(each) for each in item.parameters],
        "findings": item.findings,
    }


def finding(item: Finding) -> dict[str, Any]:
    """A finding as an object of the contract."""
    return {
        "rule": item.rule,
        "severity": item.severity,
        "message": message(item),
        "frame": item.frame,
        "transaction": item.transaction,
        "filter": item.filter,
    }


def capture_head(result: CaptureResult) -> dict[str, Any]:
    """What the contract says about a capture itself, before its lists."""
    return {
        "path": result.path,
        "sha256": result.sha256,
        "frames": result.frames,
        "complete": result.complete,
        "rpc": result.rpc,
        "records": dict(sorted(result.records.items(), key=_by_index)),
    }


def capture(result: CaptureResult) -> dict[str, Any]:
    """A capture as an object of the contract."""
    return capture_head(result) | {
        "devices": [device(each) for each in result.devices],
        "transactions": [transaction(each) for each in result.transactions],
        "findings": [finding(each) for each in result.findings],
        "summary": result.summary,
    }


def document(report: Report) -> dict[str, Any]:
    """The whole report as plain dictionaries: what `write` writes, before it is text."""
    return _head() | {"captures": [capture(each) for each in report.captures]}


def write(report: Report, stream: TextIO, options: Options | None = None) -> None:
    """Writes a complete report as one JSON text."""
    write_all(Writer(stream, options), report)


class Writer(_Writer):
    """Writes captures as they come; holds none of them."""

    def __init__(self, stream: TextIO, options: Options | None = None) -> None:
        super().__init__(stream, options)
        self._begun = False

    def _begin(self) -> None:
        self.stream.write(text(_head())[:-1] + ', "captures": [')
        self._begun = True

    def capture(self, result: CaptureResult) -> None:
        if self._begun:
            self.stream.write(",")
        else:
            self._begin()
        write_line = self.stream.write
        write_line("\n" + text(capture_head(result))[:-1])
        self._lines("devices", map(device, result.devices))
        self._lines("transactions", map(transaction, result.transactions))
        self._lines("findings", map(finding, result.findings))
        write_line(f',\n"summary": {text(result.summary)}}}')

    def _lines(self, key: str, items: Iterable[dict[str, Any]]) -> None:
        self.stream.write(f',\n"{key}": [')
        separator = "\n"
        for item in items:
            self.stream.write(separator + text(item))
            separator = ",\n"
        self.stream.write("]")

    def close(self) -> None:
        if not self._begun:
            self._begin()
        self.stream.write("]}\n")


def text(item: object) -> str:
    """One line of JSON, the same for the same thing; never NaN, which is not JSON."""
    return dumps(item, ensure_ascii=False, allow_nan=False)


def _head() -> dict[str, Any]:
    return {"schema": SCHEMA, "tool": {"name": "ds47", "version": __version__}}


def _by_index(item: tuple[str, object]) -> tuple[int, str]:
    """Record indices are numbers written as text; what is none comes last."""
    key = item[0]
    return (int(key) if key.isdecimal() else 1 << 32, key)
