"""Times, durations and statuses as the contract writes them: JSON, CSV, and the attributes of a result."""

from __future__ import annotations

from datetime import date
from functools import lru_cache
from typing import Final

SECOND_NS: Final = 1_000_000_000
_EPOCH_DAY: Final = date(1970, 1, 1).toordinal()
_DAYS_IN_400_YEARS: Final = 146_097
_SECONDS_IN_DAY: Final = 86_400


def timestamp(time_ns: int) -> str:
    """Nanoseconds since 1970 as ISO 8601 in UTC with nine digits; any number, as captures may lie.

    `datetime` ends with the year 9999; the calendar repeats every 400 years, so only the years
    inside one cycle are asked of it.
    """
    seconds = time_ns // SECOND_NS
    digits = str(time_ns - seconds * SECOND_NS + SECOND_NS)  # a 1, and then all nine of them
    return f"{_second(seconds)}.{digits[1:]}Z"


@lru_cache(maxsize=64)
def _second(seconds: int) -> str:
    days, seconds = divmod(seconds, _SECONDS_IN_DAY)
    cycles, days = divmod(days, _DAYS_IN_400_YEARS)
    day = date.fromordinal(_EPOCH_DAY + days)
    minutes, second = divmod(seconds, 60)
    hour, minute = divmod(minutes, 60)
    year = day.year + 400 * cycles
    return f"{year:04}-{day:%m-%d}T{hour:02}:{minute:02}:{second:02}"


def milliseconds(duration_ns: int | None) -> float | None:
    """A duration in ms, correctly rounded from integer nanoseconds (beyond 2^53 rounded twice, as in Lua)."""
    return None if duration_ns is None else duration_ns / 1e6


def status(word: int | None) -> str | None:
    """A PNIO status as the 8 hex digits that people know (docs/protocol.md C): `DE80B500`."""
    return None if word is None else f"{word:08X}"
