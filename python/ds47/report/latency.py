"""Latencies of any number of transactions in bounded room: how often each was, as it is shown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate

from ds47.report.bilingual import say
from ds47.report.formatting import duration


def percentile(ordered: Sequence[int], percent: int) -> int:
    """The nearest-rank percentile (1 to 100) of sorted numbers: always one that was measured."""
    return ordered[-(-percent * len(ordered) // 100) - 1]


class Latency:
    """Counts durations by their text, which rises with them: so percentiles are as exact as it is."""

    def __init__(self, durations_ns: Iterable[int] = ()) -> None:
        self._times: Counter[str] = Counter()
        self._nanoseconds: dict[str, int] = {}
        self._negative = 0
        for each in durations_ns:
            self.add(each)

    def add(self, nanoseconds: int) -> None:
        """Counts one; a clock set back leaves negative ones, which cannot be true."""
        if nanoseconds < 0:
            self._negative += 1
            return
        shown = duration(nanoseconds)
        self._times[shown] += 1
        self._nanoseconds.setdefault(shown, nanoseconds)

    def update(self, other: Latency) -> None:
        """Counts all that another one has."""
        self._times.update(other._times)
        self._nanoseconds = other._nanoseconds | self._nanoseconds
        self._negative += other._negative

    def text(self, lang: str = "en") -> str:
        """Percentiles and the longest; empty where there is no duration."""
        if not self._times and not self._negative:
            return ""
        shown = say("latency_unknown")
        if self._times:
            ordered = self._ordered()
            half, most, nearly = (self._percentile(ordered, each) for each in (50, 95, 99))
            shown = say("latency", half=half, most=most, nearly=nearly, longest=ordered[-1])
        if self._negative:
            shown = shown.joined(say("negative_times", n=self._negative))
        return shown.text(lang)

    def brief(self, lang: str = "en") -> str:
        """The typical and the longest one, of which there must be one."""
        ordered = self._ordered()
        half = self._percentile(ordered, 50)
        return say("latency_brief", half=half, longest=ordered[-1]).text(lang)

    def _ordered(self) -> list[str]:
        return sorted(self._times, key=self._nanoseconds.__getitem__)

    def _percentile(self, ordered: Sequence[str], percent: int) -> str:
        wanted = -(-percent * self._times.total() // 100)
        counted = accumulate(self._times[shown] for shown in ordered)
        return next(shown for shown, seen in zip(ordered, counted, strict=True) if seen >= wanted)
