"""Time zones by the words of the command line: from `Europe/Berlin` to how far a clock there is ahead of UTC."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import NamedTuple

LOCAL = "local"
_OFFSET = re.compile(r"([+-])(\d\d):?(\d\d)")


class Zone(NamedTuple):
    """Where a clock hangs. `info` is None for the zone of this machine, `name` is empty for a mere offset."""

    name: str
    info: tzinfo | None

    def offset(self, seconds: int) -> int:
        """By how many seconds it is ahead of UTC then; 0 in years that no calendar of Python has."""
        try:
            there = datetime.fromtimestamp(seconds, UTC).astimezone(self.info).utcoffset()
        except (OverflowError, OSError, ValueError):
            return 0
        return 0 if there is None else int(there.total_seconds())


UNIVERSAL = Zone("UTC", UTC)


def zone(text: str) -> Zone:
    """`Europe/Berlin`, `UTC`, `local`, `+02:00`.

    Raises:
        ValueError: nobody knows this zone.
    """
    if text.lower() == LOCAL:
        return Zone(LOCAL, None)
    if text.upper() in ("UTC", "Z"):
        return UNIVERSAL
    if offset := _OFFSET.fullmatch(text):
        ahead = timedelta(hours=int(offset[2]), minutes=int(offset[3]))
        if ahead < timedelta(hours=24) and int(offset[3]) < 60:
            return Zone("", timezone(-ahead if offset[1] == "-" else ahead))
    from zoneinfo import ZoneInfo  # not for reports in UTC

    try:
        return Zone(text, ZoneInfo(text))
    except (LookupError, OSError, ValueError):
        known = "a zone such as Europe/Berlin, UTC, local, or an offset such as +02:00"
        raise ValueError(f"{text!r} is no time zone that this machine knows: {known}") from None
