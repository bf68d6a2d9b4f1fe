"""Two captures (or results) side by side: parameters, errors, findings, latency.

What an engineer asks after a firmware update. Pure: capture objects of `ds47.report/1` or `/2` in, a
`Difference` out; how it looks is in `ds47.report.difference`.

Unlike `ds47.regression.compare` this does not expect the same requests in the same order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import erf, sqrt
from statistics import median
from typing import Any, NamedTuple

from ds47 import spec
from ds47.regression.compare import Json

SIGNIFICANT = 0.01
"""From this probability down a shift of the latency is taken for real."""
_FEW = 8
"""Below this many durations on one side the normal approximation says nothing."""


class Place(NamedTuple):
    """One element of a parameter of one drive object."""

    device: str
    slot: int
    axis: int | None
    pnu: int
    subindex: int


@dataclass(slots=True)
class History:
    """What one capture says of one element."""

    reads: int = 0
    writes: int = 0
    refused: int = 0
    last: Any = None
    """Last value read or successfully written; None where there is none."""
    error: str | None = None
    """The last refusal, when nothing came after it."""
    name: str | None = None
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Latency:
    """Durations of one operation on one device in both captures, in milliseconds.

    `probability`: that a difference as large comes by chance (Mann-Whitney, two-sided); None where
    there are too few.
    """

    device: str
    operation: str
    counts: tuple[int, int]
    medians: tuple[float, float]
    p95: tuple[float, float]
    probability: float | None

    @property
    def significant(self) -> bool:
        """Whether the shift is more than chance."""
        return self.probability is not None and self.probability <= SIGNIFICANT


@dataclass(slots=True)
class Difference:
    """All that `ds47 diff` says."""

    names: tuple[str, str]
    parameters: list[tuple[Place, History | None, History | None]] = field(default_factory=list)
    findings: list[tuple[str, int, int]] = field(default_factory=list)
    """Rule, count in the first, count in the second."""
    states: list[tuple[str, int, int]] = field(default_factory=list)
    latencies: list[Latency] = field(default_factory=list)

    @property
    def changed(self) -> list[tuple[Place, History | None, History | None]]:
        """The elements whose last value or refusal differs, or that only one capture has."""
        return [row for row in self.parameters if differs(row[1], row[2])]

    @property
    def errors(self) -> list[tuple[Place, History | None, History | None]]:
        """The elements refused in one capture and not, not asked, or otherwise in the other."""
        return [
            (place, a, b)
            for place, a, b in self.parameters
            if (a.error if a else None) != (b.error if b else None)
        ]


def differs(a: History | None, b: History | None) -> bool:
    """Whether two captures say something else of an element, or only one of them asked for it."""
    return a is None or b is None or a.last != b.last or a.error != b.error


def difference(a: Json, b: Json, names: tuple[str, str]) -> Difference:
    """Compares two capture objects.

    Devices are the same by station name, else by IP address; where each capture has one device,
    these two are the same whatever they are called.
    """
    called = _devices(a, b)
    histories = [_histories(capture, name) for capture, name in zip((a, b), called, strict=True)]
    places = sorted(histories[0].keys() | histories[1].keys(), key=_sort_key)
    result = Difference(names)
    result.parameters = [
        (place, histories[0].get(place), histories[1].get(place)) for place in places
    ]
    result.findings = _counts(
        *((each["rule"] for each in capture["findings"]) for capture in (a, b))
    )
    result.states = _counts(
        *((each["state"] for each in capture["transactions"]) for capture in (a, b))
    )
    result.latencies = _latencies(a, b, called)
    return result


def _sort_key(place: Place) -> tuple[Any, ...]:
    return (
        place.device,
        place.slot,
        -1 if place.axis is None else place.axis,
        place.pnu,
        place.subindex,
    )


def _devices(a: Json, b: Json) -> tuple[dict[str, str], dict[str, str]]:
    """For each capture: the common name of each device, by IP address."""
    found = []
    for capture in (a, b):
        stations = {each["ip"]: each.get("station") for each in capture.get("devices", [])}
        ips = {each["device"] for each in capture["transactions"]}
        found.append({ip: stations.get(ip) or ip for ip in ips})
    one, other = found
    if len(one) == len(other) == 1:
        name, second = *one.values(), *other.values()
        both = name if name == second else f"{name} / {second}"
        return dict.fromkeys(one, both), dict.fromkeys(other, both)
    return one, other


def _histories(capture: Json, names: dict[str, str]) -> dict[Place, History]:
    histories: dict[Place, History] = {}
    for item in capture["transactions"]:
        if item["state"] in ("mismatch", "orphan"):
            continue  # nobody can say whose values these are
        for each in item["parameters"]:
            if each["pnu"] is not None and each["attribute"] == "value":
                _note(histories, names[item["device"]], item, each)
    return histories


def _note(histories: dict[Place, History], device: str, item: Json, each: Json) -> None:
    first = each["subindex"] or 0
    change = item["operation"] == "change"
    refusal = _refusal(item, each)
    values = each["values"] if isinstance(each["values"], list) and each["values"] else [None]
    for step, value in enumerate(values):
        place = Place(device, item["slot"], item["axis"], each["pnu"], first + step)
        history = histories.setdefault(place, History())
        history.name, history.unit = each["name"], each["unit"]
        history.writes += change
        history.reads += not change
        if refusal is not None:
            history.refused += 1
            history.error = refusal
        elif value is not None and item["state"] in ("ok", "partial", "error"):
            history.last, history.error = value, None


def _refusal(item: Json, each: Json) -> str | None:
    if each["error"] is not None:
        code = each["error"]["code"]
        return f"{'-' if code is None else spec.error_hex(code)} {each['error']['text']}".strip()
    if item["state"] == "refused":
        status = item["status"]
        return next(
            (word for word in (status["write"], status["read"]) if word not in (None, "00000000")),
            "refused",
        )
    return None


def _counts(a: Iterable[str], b: Iterable[str]) -> list[tuple[str, int, int]]:
    first, second = Counter(a), Counter(b)
    return [(name, first[name], second[name]) for name in sorted(first.keys() | second.keys())]


def _latencies(a: Json, b: Json, called: tuple[dict[str, str], dict[str, str]]) -> list[Latency]:
    groups: dict[tuple[str, str], tuple[list[float], list[float]]] = {}
    for side, (capture, names) in enumerate(zip((a, b), called, strict=True)):
        for item in capture["transactions"]:
            if item["duration_ms"] is not None:
                key = names[item["device"]], item["operation"]
                groups.setdefault(key, ([], []))[side].append(item["duration_ms"])
    return [_latency(*key, *sides) for key, sides in sorted(groups.items()) if all(sides)]


def _latency(device: str, operation: str, a: list[float], b: list[float]) -> Latency:
    return Latency(
        device,
        operation,
        (len(a), len(b)),
        (median(a), median(b)),
        (_percentile(a, 0.95), _percentile(b, 0.95)),
        mann_whitney(a, b) if min(len(a), len(b)) >= _FEW else None,
    )


def _percentile(values: list[float], part: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]


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
