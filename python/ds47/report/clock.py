"""Times of a capture as a person reads them: time of day in a zone, and seconds since the first frame.

JSON, CSV and what a program reads stay in UTC. The zone is said once, with the date and what it is ahead of UTC.
In a capture over midnight each time has its date, over a change of summer time its offset too.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import floor

from ds47.model import CaptureResult, Transaction
from ds47.report.bilingual import Both, say
from ds47.report.formatting import duration
from ds47.report.zones import Zone
from ds47.spec.units import SECOND_NS, timestamp

NO_DATE_BEFORE = 315_532_800
"""Seconds since 1970 (1980-01-01). Nothing was captured then: a clock before it was never set."""
_LONG_NS = 30 * 86_400 * SECOND_NS
"""Summer time may begin and end again in a longer capture."""


class Clock:
    """The times of one capture in a zone.

    `first_ns` is the time of the first frame (None where there is none), `last_ns` the last time that is known.
    """

    def __init__(self, where: Zone, first_ns: int | None, last_ns: int | None = None) -> None:
        self._zone = where
        self.first_ns = first_ns
        self.known = first_ns is not None and first_ns >= NO_DATE_BEFORE * SECOND_NS
        last_ns = first_ns if last_ns is None else last_ns
        begin, end = self.day(first_ns or 0), self.day(last_ns or 0)
        self._dated = begin[0] != end[0]
        self._offset = begin[1] != end[1] or (last_ns or 0) - (first_ns or 0) > _LONG_NS

    @classmethod
    def of(cls, result: CaptureResult, where: Zone) -> Clock:
        """That of a capture; a result that was stored before it had a start begins with its first transaction."""
        first = result.start_ns
        if first is None:
            first = min((each.start_ns for each in result.transactions), default=None)
        return cls(where, first, max(_times(result), default=None))

    def day(self, time_ns: int) -> tuple[str, str]:
        """`2026-11-21` and `+01:00`."""
        _, date, offset = self._local(time_ns)
        return date, offset

    def at(self, time_ns: int) -> str:
        """`12:14:03.412`, with its date and offset where these are needed; empty where no time of day is known."""
        if not self.known:
            return ""
        clock, date, offset = self._local(time_ns)
        return f"{f'{date} ' if self._dated else ''}{clock}{f' {offset}' if self._offset else ''}"

    def moment(self, time_ns: int) -> str:
        """The time of day, or the seconds since the first frame where none is known: `0.412 s`."""
        return self.at(time_ns) or f"{self.since(time_ns)} s"

    def since(self, time_ns: int) -> str:
        """Seconds since the first frame, as in Wireshark: `0.412`. Cut to milliseconds, as times of day are."""
        return f"{floor((time_ns - (self.first_ns or 0)) / 1e6) / 1000:.3f}"

    def start(self) -> str:
        """`2026-11-21 12:14:03.412 +01:00 (Europe/Berlin)`: the first frame with the zone."""
        return self.whole(self.first_ns or 0)

    def whole(self, time_ns: int) -> str:
        """A time with its date, offset and zone."""
        clock, date, offset = self._local(time_ns)
        zone_name = f" ({self._zone.name})" if self._zone.name else ""
        return f"{date} {clock} {offset}{zone_name}"

    def begin(self) -> Both:
        """When the first transaction of a watch was, with the zone."""
        return say("time_first_transaction", start=self.start())

    def span(self, result: CaptureResult) -> Both | None:
        """When the capture was taken; None where it has no frame.

        It ends with its last frame; one that was stored before that was kept with the last that is known.
        """
        if self.first_ns is None:
            return None
        if not self.known:
            return say("time_unknown", start=timestamp(self.first_ns)[:19].replace("T", " "))
        kept = result.end_ns is not None
        last = result.end_ns if kept else max(_times(result), default=None)
        if last is None or last < self.first_ns:
            return say("time_first", start=self.start())
        length = duration(last - self.first_ns)
        words = "time_span" if kept else "time_span_known"
        return say(words, start=self.start(), end=self.at(last), length=length)

    def _local(self, time_ns: int) -> tuple[str, str, str]:
        """Time of day in milliseconds, date, offset."""
        ahead = self._zone.offset(time_ns // SECOND_NS)
        date, _, clock = timestamp(time_ns + ahead * SECOND_NS).partition("T")
        minutes = abs(ahead) // 60
        sign = "-" if ahead < 0 else "+"
        return clock[:12], date, f"{sign}{minutes // 60:02}:{minutes % 60:02}"


def _times(result: CaptureResult) -> Iterator[int]:
    """When the last frame was, transactions ended and something happened to drives."""
    if result.end_ns is not None:
        yield result.end_ns
    yield from map(_ended, result.transactions)
    for timeline in result.timelines:
        yield from (each.time_ns for each in timeline.events[-1:])


def _ended(item: Transaction) -> int:
    return item.start_ns + max(0, item.duration_ns or 0)
