"""A report in JSON back to the model: the reverse of `ds47.report.json`.

What the contract does not hold is not there again: `Transaction.position`. Written once more, in any format,
it is the same report. Texts that are those of this version are left out: the report words them anew. Results of
`ds47.report/1` have findings with a sentence and without args.
"""

from __future__ import annotations

import re
from datetime import date
from fractions import Fraction
from typing import Any

from ds47.model import (
    CaptureFile,
    CaptureResult,
    Device,
    Diagnosis,
    Finding,
    Frames,
    Parameter,
    ParameterError,
    Read,
    Transaction,
)
from ds47.report.bilingual import LANGUAGES
from ds47.spec import error_text

_EPOCH_DAY = date(1970, 1, 1).toordinal()
_DAYS_IN_400_YEARS = 146_097
_TIMESTAMP = re.compile(r"(-?\d+)-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)\.(\d{9})Z")
_AT_OFFSET = re.compile(r"offset (\d+): (.*)", re.DOTALL)


def capture(item: dict[str, Any]) -> CaptureResult:
    """A capture of the contract; `problem` and `dropped` are not in it."""
    devices = [Device(**each) for each in item["devices"]]
    vendors = {each.ip: each.vendor_id for each in devices}
    return CaptureResult(
        path=item["path"],
        sha256=item["sha256"],
        frames=item["frames"],
        start_ns=nanoseconds(item["start"]) if item.get("start") else None,
        complete=item["complete"],
        rpc=item["rpc"],
        records=item["records"],
        devices=devices,
        transactions=[
            transaction(each, vendors.get(each["device"])) for each in item["transactions"]
        ],
        findings=[finding(each) for each in item["findings"]],
        diagnoses=[diagnosis(each) for each in item["diagnoses"]],
        summary=item["summary"],
        files=[CaptureFile(**each) for each in item.get("files", ())],
    )


def transaction(item: dict[str, Any], vendor_id: int | None = None) -> Transaction:
    """A transaction of the contract, with a device of this vendor. Raises ValueError where `start` is no time."""
    return Transaction(
        operation=item["operation"],
        state=item["state"],
        controller=item["controller"],
        device=item["device"],
        ar=item["ar"],
        api=item["api"],
        slot=item["slot"],
        subslot=item["subslot"],
        index=item["index"],
        request_reference=item["request_reference"],
        axis=item["axis"],
        frames=_frames(item["frames"]),
        start_ns=nanoseconds(item["start"]),
        duration_ns=duration(item["duration_ms"]),
        request=_bytes(item["bytes"]["request"]),
        response=_bytes(item["bytes"]["response"]),
        write_status=_status(item["status"]["write"]),
        read_status=_status(item["status"]["read"]),
        parameters=[_parameter(each, vendor_id) for each in item["parameters"]],
        findings=list(item["findings"]),
        id=item["id"],
    )


def finding(item: dict[str, Any]) -> Finding:
    """A finding of the contract."""
    if "args" not in item:
        return _finding_1(item)
    return Finding(
        item["rule"], item["severity"], item["frame"], item["frames"], item["transaction"],
        item["offset"], item["args"],
    )  # fmt: skip


def _finding_1(item: dict[str, Any]) -> Finding:
    """A finding of `ds47.report/1`; the offset in front of its message is taken off."""
    text, offset = message(item["message"])
    return Finding(
        item["rule"], item["severity"], item["frame"], None, item["transaction"], offset, said=text
    )


def message(text: str) -> tuple[str, int | None]:
    """The message of a finding of `ds47.report/1` without the offset in front of it, and that offset."""
    match = _AT_OFFSET.fullmatch(text)
    return (match[2], int(match[1])) if match else (text, None)


def diagnosis(item: dict[str, Any]) -> Diagnosis:
    """A diagnosis of the contract."""
    corrected = item["corrected"]
    return Diagnosis(
        rule=item["rule"],
        severity=item["severity"],
        args=item.get("args", {}),
        device=item["device"],
        count=item["count"],
        frames=item["frames"],
        transactions=item["transactions"],
        corrected=None if corrected is None else bytes.fromhex(corrected["request"]),
        said=None if "args" in item else item["message"],
        differs=item.get("differs", []),
        frames_left_out=item.get("frames_left_out", 0),
        corrected_in=None if corrected is None else corrected.get("transaction"),
    )


def nanoseconds(timestamp: str) -> int:
    """Nanoseconds since 1970 of a time as the report writes it, in any year.

    Raises ValueError where it is none.
    """
    match = _TIMESTAMP.fullmatch(timestamp)
    if match is None:
        raise ValueError(f"{timestamp!r} is no time of a report")
    year, month, day, hour, minute, second, ns = map(int, match.groups())
    cycles, year = divmod(year, 400)  # the calendar repeats; `date` knows the years 1 to 9999
    days = date(year + 400, month, day).toordinal() - _EPOCH_DAY
    days += (cycles - 1) * _DAYS_IN_400_YEARS
    return (((days * 24 + hour) * 60 + minute) * 60 + second) * 1_000_000_000 + ns


def duration(milliseconds: float | None) -> int | None:
    """Whole nanoseconds of a duration in ms: those it was rounded from."""
    return None if milliseconds is None else round(Fraction(milliseconds) * 1_000_000)


def _frames(item: dict[str, Any]) -> Frames:
    def pairs(key: str) -> list[Read]:
        return [Read(each["request"], each["response"]) for each in item[key]]

    return Frames(
        item["write_request"], item["write_response"], item["read_request"],
        item["read_response"], pairs("polls"), pairs("rereads"),
    )  # fmt: skip


def error(item: dict[str, Any], vendor_id: int | None) -> ParameterError:
    """An error of a parameter, of a device of this vendor; its text tells whether the vendor was known then."""
    code, info, text = item["code"], item.get("info"), item["text"]
    for vendor in (vendor_id, None):
        if text in (error_text(code, lang, vendor) for lang in LANGUAGES):
            return ParameterError(code, info, vendor)
    return ParameterError(code, info, said=text)


def _parameter(item: dict[str, Any], vendor_id: int | None) -> Parameter:
    known = {key: value for key, value in item.items() if key != "name"}
    known["listed"] = item["name"] is not None
    known["error"] = None if item["error"] is None else error(item["error"], vendor_id)
    return Parameter(**known)


def _bytes(digits: str | None) -> bytes | None:
    return None if digits is None else bytes.fromhex(digits)


def _status(digits: str | None) -> int | None:
    return None if digits is None else int(digits, 16)
