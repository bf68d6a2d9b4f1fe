"""Times of a capture as a person reads them: time of day in a zone, and seconds since the first frame.

JSON, CSV and other formats for programs stay in UTC. The zone is given once, with the date and the offset.
If a capture crosses midnight, each time has its date; across a change of summer time, its offset too.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import floor

from ds47.model import CaptureResult
from ds47.report.bilingual import Both, say
from ds47.report.formatting import duration
from ds47.report.zones import Zone
from ds47.spec.units import SECOND_NS, second, timestamp

NO_DATE_BEFORE = 315_532_800
"""1980-01-01 in seconds since 1970. An earlier time means that the clock was never set."""
_DAY = 86_400
_LONG_NS = 30 * _DAY * SECOND_NS
"""In a longer capture summer time may begin and end again."""
_DAYS = 20_000
"""How many days to search for changes: a clock set to the year 5000 gets no summer time."""


class Clock:
    """The times of one capture in a zone.

    `first_ns` is the time of the first frame (None without frames), `last_ns` the last known time. `known`: the
    clock was set at some time. `dated`, `has_offsets`: each time is shown with its date, its offset.
    """

    def __init__(self, where: Zone, first_ns: int | None, last_ns: int | None = None) -> None:
        self._zone = where
        self._second: tuple[int | None, str, str, str] = None, "", "", ""
        """A cache: the second of the last time, with its words. The next time is often in the same second."""
        self.first_ns = first_ns
        self.known = first_ns is not None and first_ns >= NO_DATE_BEFORE * SECOND_NS
        last_ns = first_ns if last_ns is None else last_ns
        self._last_ns = last_ns
        begin, end = self.day(first_ns or 0), self.day(last_ns or 0)
        self.dated = begin[0] != end[0]
        self.has_offsets = begin[1] != end[1] or (last_ns or 0) - (first_ns or 0) > _LONG_NS

    @classmethod
    def of(cls, result: CaptureResult, where: Zone) -> Clock:
        """The clock of a capture."""
        return cls(where, first_ns(result), max(_times(result), default=None))

    def day(self, time_ns: int) -> tuple[str, str]:
        """`2026-11-21` and `+01:00`."""
        _, date, offset = self._local(time_ns)
        return date, offset

    def at(self, time_ns: int) -> str:
        """`12:14:03.412`, with date and offset if needed; empty if the time of day is unknown."""
        if not self.known:
            return ""
        clock, date, offset = self._local(time_ns)
        return (
            f"{f'{date} ' if self.dated else ''}{clock}{f' {offset}' if self.has_offsets else ''}"
        )

    def time_of_day(self, time_ns: int) -> str:
        """`12:14:03.412`, never with a date; empty if the time of day is unknown."""
        return self._local(time_ns)[0] if self.known else ""

    def moment(self, time_ns: int) -> str:
        """The time of day, or if that is unknown the seconds since the first frame: `0.412 s`."""
        return self.at(time_ns) or f"{self.since(time_ns)} s"

    def since(self, time_ns: int) -> str:
        """Seconds since the first frame, as in Wireshark: `0.412`. Cut to milliseconds, like times of day."""
        return f"{floor((time_ns - (self.first_ns or 0)) / 1e6) / 1000:.3f}"

    def start(self) -> str:
        """`2026-11-21 12:14:03.412 +01:00 (Europe/Berlin)`: the first frame with the zone."""
        return self.whole(self.first_ns or 0)

    def whole(self, time_ns: int) -> str:
        """A time with its date, offset and zone."""
        clock, date, offset = self._local(time_ns)
        zone_name = f" ({self._zone.name})" if self._zone.name else ""
        return f"{date} {clock} {offset}{zone_name}"

    @property
    def zone_name(self) -> str:
        """`Europe/Berlin`, or `+02:00` for a mere offset."""
        return self._zone.name or self.day(self.first_ns or 0)[1]

    def changes(self) -> list[tuple[int, int]]:
        """Start (ns) and offset from UTC (s) of each period: from the first frame, and from each change."""
        first, last = self.first_ns or 0, self._last_ns or 0
        found = [(first, self._zone.offset(first // SECOND_NS))]
        if not self.has_offsets:
            return found
        at, end = first // SECOND_NS, min(last // SECOND_NS, first // SECOND_NS + _DAYS * _DAY)
        while at < end:
            step = min(at + _DAY, end)
            ahead = self._zone.offset(step)
            if ahead != found[-1][1]:
                found.append((self._change(at, step) * SECOND_NS, ahead))
            at = step
        return found

    def _change(self, before: int, after: int) -> int:
        """The second of the change between two times: the first with the later offset."""
        there = self._zone.offset(after)
        while after - before > 1:
            middle = (before + after) // 2
            before, after = (
                (before, middle) if self._zone.offset(middle) == there else (middle, after)
            )
        return after

    def begin(self) -> Both:
        """When the first transaction of a watch was, with the zone."""
        return say("time_first_transaction", start=self.start())

    def span(self, result: CaptureResult) -> Both | None:
        """When the capture was taken; None without frames.

        It ends with its last frame. Old stored results lack that time: there the last known time counts.
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
        seconds, ns = divmod(time_ns, SECOND_NS)
        if seconds != self._second[0]:
            ahead = self._zone.offset(seconds)
            date, _, clock = second(seconds + ahead).partition("T")
            minutes, sign = abs(ahead) // 60, "-" if ahead < 0 else "+"
            self._second = seconds, clock, date, f"{sign}{minutes // 60:02}:{minutes % 60:02}"
        _, clock, date, offset = self._second
        return f"{clock}.{ns // 1_000_000:03}", date, offset


def first_ns(result: CaptureResult) -> int | None:
    """When a capture begins; one that was stored before it had a start does with its first transaction."""
    if result.start_ns is not None:
        return result.start_ns
    return min((each.start_ns for each in result.transactions), default=None)


def seen_at(result: CaptureResult) -> dict[int, int]:
    """The times of the frames of findings, by frame number: nanoseconds since 1970."""
    return {each.frame: each.time_ns for each in result.findings if each.time_ns is not None}


def beginning(where: Zone, time_ns: int | None) -> str:
    """`2026-11-21 12:14:03`, the start of a capture in a table of many; empty if the time of day is unknown."""
    clock = Clock(where, time_ns)
    if time_ns is None or not clock.known:
        return ""
    return f"{clock.day(time_ns)[0]} {clock.time_of_day(time_ns)[:8]}"


def _times(result: CaptureResult) -> Iterator[int]:
    """The times of the last frame, the ends of transactions, and the last event of each drive."""
    if result.end_ns is not None:
        yield result.end_ns
    yield from [each.start_ns + max(0, each.duration_ns or 0) for each in result.transactions]
    for timeline in result.timelines:
        yield from (each.time_ns for each in timeline.events[-1:])
