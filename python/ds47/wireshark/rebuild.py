"""From the dictionaries of a report back to the model: `ds47.report.json` the other way round.

Knows the keys of the contract only; where the dictionaries come from does not matter.
"""

from __future__ import annotations

import re
from datetime import date
from fractions import Fraction
from typing import Any

from ds47.model import Finding, Frames, Parameter, ParameterError, Transaction

_NS = 10**9
_EPOCH_DAY = date(1970, 1, 1).toordinal()
_DAYS_IN_400_YEARS = 146_097
_OFFSET = re.compile(r"offset (\d+): ")  # ds47.report.at_offset
_START = re.compile(r"(-?\d+)-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)\.(\d{9})Z")

Json = dict[str, Any]


def transaction(item: Json) -> Transaction:
    """A transaction of the report. Raises ValueError where `start` is no time."""
    data, status = item["bytes"], item["status"]
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
        frames=frames(item["frames"]),
        start_ns=nanoseconds(item["start"]),
        duration_ns=duration(item["duration_ms"]),
        request=None if data["request"] is None else bytes.fromhex(data["request"]),
        response=None if data["response"] is None else bytes.fromhex(data["response"]),
        write_status=None if status["write"] is None else int(status["write"], 16),
        read_status=None if status["read"] is None else int(status["read"], 16),
        parameters=[parameter(each) for each in item["parameters"]],
        findings=list(item["findings"]),
        id=item["id"],
    )


def frames(item: Json) -> Frames:
    """The frame numbers of a transaction."""
    return Frames(
        item["write_request"],
        item["write_response"],
        item["read_request"],
        item["read_response"],
        [(each["request"], each["response"]) for each in item["polls"]],
        [(each["request"], each["response"]) for each in item["rereads"]],
    )


def parameter(item: Json) -> Parameter:
    """A parameter of a transaction."""
    return Parameter(**(item | {"error": item["error"] and ParameterError(**item["error"])}))


def finding(item: Json) -> Finding:
    """A finding; the offset that the message of a report begins with is taken off."""
    text: str = item["message"]
    match = _OFFSET.match(text)
    offset = int(match[1]) if match else None
    rest = text[match.end() :] if match else text
    return Finding(item["rule"], item["severity"], rest, item["frame"], item["transaction"], offset)


def nanoseconds(text: str) -> int:
    """Nanoseconds since 1970 of a time as the report writes it, in any year."""
    match = _START.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is no time of a report")
    year, month, day, hour, minute, second, ns = map(int, match.groups())
    cycles, year = divmod(year, 400)  # the calendar repeats; `date` knows the years 1 to 9999
    days = date(year + 400, month, day).toordinal() - _EPOCH_DAY
    days += (cycles - 1) * _DAYS_IN_400_YEARS
    return (((days * 24 + hour) * 60 + minute) * 60 + second) * _NS + ns


def duration(milliseconds: float | None) -> int | None:
    """Whole nanoseconds of a duration in ms: those it was rounded from."""
    return None if milliseconds is None else round(Fraction(milliseconds) * 1_000_000)
