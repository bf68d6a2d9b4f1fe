"""Time zones of the command line: from `Europe/Berlin` to the offset from UTC."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from typing import NamedTuple

LOCAL = "local"
_OFFSET = re.compile(r"([+-])(\d\d):?(\d\d)")


class Zone(NamedTuple):
    """A time zone. `info` is None for the zone of this machine, `name` is empty for a mere offset."""

    name: str
    info: tzinfo | None

    def offset(self, seconds: int) -> int:
        """How many seconds it is ahead of UTC at that time; 0 in years beyond Python's calendar."""
        try:
            there = datetime.fromtimestamp(seconds, UTC).astimezone(self.info).utcoffset()
        except (OverflowError, OSError, ValueError):
            return 0
        return 0 if there is None else int(there.total_seconds())


UNIVERSAL = Zone("UTC", UTC)


def zone(text: str) -> Zone:
    """`Europe/Berlin`, `UTC`, `local`, `+02:00`.

    Raises:
        ValueError: the zone is unknown.
    """
    if text.lower() == LOCAL:
        return Zone(LOCAL, None)
    if text.upper() in ("UTC", "Z"):
        return UNIVERSAL
    if offset := _OFFSET.fullmatch(text):
        ahead = timedelta(hours=int(offset[2]), minutes=int(offset[3]))
        if ahead < timedelta(hours=24) and int(offset[3]) < 60:
            return Zone("", timezone(-ahead if offset[1] == "-" else ahead))
    from zoneinfo import ZoneInfo  # reports in UTC do not need it

    try:
        return Zone(text, ZoneInfo(text))
    except (LookupError, OSError, ValueError):
        known = "a zone such as Europe/Berlin, UTC, local, or an offset such as +02:00"
        raise ValueError(f"{text!r} is not a time zone known here: {known}") from None
