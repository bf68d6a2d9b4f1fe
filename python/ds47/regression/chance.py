"""How likely chance alone makes two samples differ so much: of durations, and of failures among requests.

Plain statistics; nothing of captures is known here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import erf, exp, lgamma, sqrt
from typing import Final

SIGNIFICANT: Final = 0.01
"""From this probability down a difference is taken for real."""
_ROUNDING: Final = 1e-9


def fisher(failed: int, passed: int, failed_too: int, passed_too: int) -> float:
    """Two-sided probability that two shares of failures differ so much by chance.

    Fisher's exact test: it holds for any number of requests, one included.

    Args:
        failed: failures of one sample, `passed` its successes; neither may be negative.
        passed: see there.
        failed_too: failures of the other.
        passed_too: its successes.
    """
    failures, size = failed + failed_too, failed + passed
    total = size + failed_too + passed_too
    possible = range(max(0, size + failures - total), min(size, failures) + 1)
    whole = _log_ways(total, size)

    def probability(count: int) -> float:
        """That so many of the failures are in the first sample."""
        return exp(_log_ways(failures, count) + _log_ways(total - failures, size - count) - whole)

    seen = probability(failed) * (1 + _ROUNDING)
    return min(1.0, sum(each for each in map(probability, possible) if each <= seen))


def _log_ways(of: int, count: int) -> float:
    """The logarithm of how many ways there are to take `count` out of `of`: numbers of any size are quick."""
    return lgamma(of + 1) - lgamma(count + 1) - lgamma(of - count + 1)


def mann_whitney(a: list[float], b: list[float]) -> float:
    """Two-sided probability that two samples differ so much by chance.

    The rank test of Mann and Whitney with the normal approximation, corrected for ties and for
    continuity; it asks nothing of the shape of the distributions, which latencies never give.

    Args:
        a: one sample, at least one value.
        b: the other.
    """
    ranks = dict(_ranks(sorted(a + b)))
    size_a, size_b = len(a), len(b)
    total = size_a + size_b
    u = sum(ranks[value] for value in a) - size_a * (size_a + 1) / 2
    ties = sum(count**3 - count for count in Counter(a + b).values())
    spread = size_a * size_b / 12 * (total + 1 - ties / (total * (total - 1)))
    if spread <= 0:
        return 1.0  # all values are equal
    z = max(0.0, abs(u - size_a * size_b / 2) - 0.5) / sqrt(spread)
    return 1 - erf(z / sqrt(2))


def _ranks(ordered: list[float]) -> Iterator[tuple[float, float]]:
    """Each value with its rank from 1; equal values share the mean of theirs."""
    start = 0
    while start < len(ordered):
        end = start
        while end < len(ordered) and ordered[end] == ordered[start]:
            end += 1
        yield ordered[start], (start + 1 + end) / 2
        start = end
