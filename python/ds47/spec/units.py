"""Times, durations and statuses in the form of the contract: JSON, CSV, and the attributes of a result."""

from __future__ import annotations

import re
from datetime import UTC, date, datetime, timedelta
from functools import lru_cache
from typing import Final

SECOND_NS: Final = 1_000_000_000
_EPOCH_DAY: Final = date(1970, 1, 1).toordinal()
_DAYS_IN_400_YEARS: Final = 146_097
_SECONDS_IN_DAY: Final = 86_400
_TIMESTAMP: Final = re.compile(r"(-?\d+)-(\d\d)-(\d\d)T(\d\d):(\d\d):(\d\d)\.(\d{9})Z")


def timestamp(time_ns: int) -> str:
    """Nanoseconds since 1970 as ISO 8601 in UTC with nine digits; takes any number, because clocks may be wrong.

    `datetime` ends with the year 9999. The calendar repeats every 400 years, so `date` only gets years
    of one cycle.
    """
    return f"{second(time_ns // SECOND_NS)}.{time_ns % SECOND_NS:09}Z"


@lru_cache(maxsize=64)
def second(seconds: int) -> str:
    """The same for whole seconds, without the fraction; cached, because many times share one second."""
    days, seconds = divmod(seconds, _SECONDS_IN_DAY)
    cycles, days = divmod(days, _DAYS_IN_400_YEARS)
    day = date.fromordinal(_EPOCH_DAY + days)
    minutes, seconds = divmod(seconds, 60)
    hour, minute = divmod(minutes, 60)
    year = day.year + 400 * cycles
    return f"{year:04}-{day:%m-%d}T{hour:02}:{minute:02}:{seconds:02}"


def moment(time_ns: int) -> datetime | None:
    """Nanoseconds since 1970 as a time in UTC, cut to microseconds; None in a year beyond `datetime`."""
    try:
        return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=time_ns // 1000)
    except OverflowError:
        return None


def nanoseconds(text: str) -> int:
    """Nanoseconds since 1970 from a time of a report, in any year.

    Raises ValueError for any other text.
    """
    match = _TIMESTAMP.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not the time of a report")
    year, month, day, hour, minute, second, ns = map(int, match.groups())
    cycles, year = divmod(year, 400)  # the calendar repeats; `date` knows the years 1 to 9999
    days = date(year + 400, month, day).toordinal() - _EPOCH_DAY
    days += (cycles - 1) * _DAYS_IN_400_YEARS
    return (((days * 24 + hour) * 60 + minute) * 60 + second) * SECOND_NS + ns


def milliseconds(duration_ns: int | None) -> float | None:
    """A duration in ms, correctly rounded from nanoseconds (beyond 2^53 rounded twice, as in Lua)."""
    return None if duration_ns is None else duration_ns / 1e6


def duration(shown_ms: float | None) -> int | None:
    """The whole nanoseconds that a duration in ms was rounded from."""
    if shown_ms is None:
        return None
    from fractions import Fraction  # only results that are loaded need it

    return round(Fraction(shown_ms) * 1_000_000)


@lru_cache(maxsize=4096)
def uuid_text(raw: bytes) -> str:
    """An AR UUID as people write it."""
    text = raw.hex()
    return f"{text[:8]}-{text[8:12]}-{text[12:16]}-{text[16:20]}-{text[20:]}"


def status(word: int | None) -> str | None:
    """A PNIO status as 8 hex digits (docs/protocol.md C): `DE80B500`."""
    return None if word is None else f"{word:08X}"
