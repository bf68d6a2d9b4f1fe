"""Two captures (or results) side by side: parameters, states, findings, latency.

Answers what an engineer asks after a firmware update. Pure: takes capture objects of `ds47.report/1` or `/2`, and
gives a `Difference`; `difference_report` formats it. Reads are compared with reads, changes with changes, and only
by facts: the last value and the kinds of negative response, never a sequence.

Unlike `ds47.regression.compare` this does not expect the same requests in the same order.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from statistics import median
from typing import Final, NamedTuple

from ds47.model import S7
from ds47.regression import elements
from ds47.regression.chance import SIGNIFICANT, fisher, mann_whitney
from ds47.regression.places import Json, Place, Places

_FEW = 8
"""Below this many durations on one side the normal approximation says nothing."""

SAME: Final = "same"
DIFFERENT: Final = "different"
"""The last values differ, the same request returns a value in only one capture, or it fails more often than
chance explains."""
SOMETIMES: Final = "sometimes"
"""The last values are the same, but negative responses differ, probably by chance."""
OTHER_REQUESTS: Final = "other requests"
"""The kinds of negative response differ, and so do the requests: access, number of elements, value or format."""
OPEN: Final = "open"
"""One capture does not show the outcome."""
ONLY: Final = "only"
"""Only one capture asked for this element at all."""
OTHER_OPERATION: Final = "other operation"
"""The other capture asked for the element, but did not read it (or did not change it)."""
OTHER_WAY: Final = "other way"
"""The other capture asked for this PNU and subindex at a drive object that may or may not be the same."""


LAST: Final = "last"
"""The operation of rows that compare last values from any source (`regression.last_values`)."""
FAULT: Final = "fault"
"""The event of spec/pzd.toml."""
_PROFIBUS: Final = "dp"
"""How a device of PROFIBUS is named; one of PROFINET has an address."""


class ElementDifference(NamedTuple):
    """The reads, the changes, or the last value of one element in both captures; None for a capture without."""

    element: elements.ElementKey
    operation: str
    result: str
    a: elements.Outcomes | None
    b: elements.Outcomes | None
    name: str | None
    unit: str | None
    family: str | None = None
    """The family of parameters of the drive; None if no side gives it."""


Took = tuple[str | None, float]


@dataclass(frozen=True, slots=True)
class LatencyDifference:
    """Durations of one operation on one device in both captures, in milliseconds.

    `probability`: of an equally large difference by chance (Mann-Whitney, two-sided); None for too few
    durations.
    """

    device: str
    operation: str
    counts: tuple[int, int]
    medians: tuple[float, float]
    p95: tuple[float, float]
    probability: float | None
    points: tuple[list[Took], list[Took]] = ([], [])
    """The start of each transaction, in the form of the report, and its duration."""

    @property
    def significant(self) -> bool:
        """Whether the shift is more than chance."""
        return self.probability is not None and self.probability <= SIGNIFICANT

    @property
    def is_slower(self) -> bool:
        """Whether the median became longer."""
        return self.medians[1] > self.medians[0]


class Faults(NamedTuple):
    """How often the status word of a drive began to signal a fault (bit 3 of ZSW1), in both captures."""

    device: str
    slot: int | None
    subslot: int | None
    a: int
    b: int


@dataclass(slots=True)
class Difference:
    """The content of `ds47 diff`."""

    names: tuple[str, str]
    rows: list[ElementDifference] = field(default_factory=list)
    findings: list[tuple[str, int, int]] = field(default_factory=list)
    """Rule, count in the first, count in the second."""
    states: list[tuple[str, int, int]] = field(default_factory=list)
    latencies: list[LatencyDifference] = field(default_factory=list)
    faults: list[Faults] = field(default_factory=list)
    """Only drives with control and status words in both captures."""
    unknown: tuple[int, int] = (0, 0)
    """For each capture: transactions whose parameters it does not show in full."""
    starts: tuple[str | None, str | None] = (None, None)
    """The start of the first transaction of each capture."""
    texts: dict[tuple[str, int | None], str] = field(default_factory=dict)
    """The meaning of error numbers, by device and number."""
    strangers: tuple[list[str], list[str]] | None = None
    """The drives of each capture where none is in both: nothing is compared then."""

    def of(self, *results: str) -> list[ElementDifference]:
        """The rows with one of these results."""
        return [row for row in self.rows if row.result in results]

    @property
    def of_last_values(self) -> bool:
        """Whether only last values are compared."""
        return all(row.operation == LAST for row in self.rows) and bool(self.rows)

    @property
    def compared(self) -> int:
        """The number of comparable elements: both captures asked in the same way, and show the outcome."""
        return len({row.element for row in self.of(SAME, DIFFERENT, SOMETIMES)})

    @property
    def different(self) -> int:
        """The number of elements that differ, asked for in the same way."""
        return len({row.element for row in self.of(DIFFERENT)})

    @property
    def changed(self) -> list[ElementDifference]:
        """The rows that are not the same, or not in both captures."""
        return [row for row in self.rows if row.result not in (SAME, SOMETIMES, OPEN)]


def difference(a: Json, b: Json, names: tuple[str, str]) -> Difference:
    """Compares two capture objects.

    Devices match by station name, else by IP address. If each capture has only one device, the two match
    whatever their names are, unless they are of different types.
    """
    drives = _without_s7(a), _without_s7(b)
    called = _devices(*drives)
    places = Places(drives, called)
    sides = [
        elements.shown(capture, name, places) for capture, name in zip(drives, called, strict=True)
    ]
    result = Difference(names)
    result.rows = list(_rows(sides[0], sides[1], places))
    result.starts = _start(drives[0]), _start(drives[1])
    result.unknown = sides[0].unknown, sides[1].unknown
    result.texts = sides[1].texts | sides[0].texts
    result.faults = _faults(a, b, called)
    mine, theirs = (sorted({*each.values()}) for each in called)
    if mine and theirs and not result.faults and set(mine).isdisjoint(theirs):
        result.strangers = mine, theirs
        return result
    result.findings = _counts(
        *((each["rule"] for each in capture["findings"]) for capture in (a, b))
    )
    result.states = _counts(
        *((each["state"] for each in capture["transactions"]) for capture in (a, b))
    )
    result.latencies = _latencies(a, b, called)
    return result


def _start(capture: Json) -> str | None:
    times = [each.get("start") for each in capture["transactions"]]
    return min((each for each in times if isinstance(each, str)), default=None)


def _without_s7(capture: Json) -> Json:
    """A capture without the jobs of S7: they have no parameters, and their partners are no drives."""
    drives = [each for each in capture["transactions"] if each.get("channel") != S7]
    return capture | {"transactions": drives}


def _devices(a: Json, b: Json) -> tuple[dict[str, str], dict[str, str]]:
    """For each capture: the common name of each device, by IP address."""
    one, other = _named(a), _named(b)
    wires = {device.startswith(_PROFIBUS) for device in (*one, *other)}
    types = {each for side in ((a, one), (b, other)) for each in _types(*side)}
    return _alike(one, other, of_one_type=len(wires) < 2 and len(types) < 2)


def _types(capture: Json, names: Mapping[str, str]) -> Iterator[str]:
    """Vendor and device id of these drives, where the capture shows both."""
    for each in capture.get("devices", []):
        vendor, device = each.get("vendor_id"), each.get("device_id")
        if each["ip"] in names and vendor is not None and device is not None:
            yield f"{vendor} {device}"


def named_alike(
    a: Mapping[str, str], b: Mapping[str, str]
) -> tuple[dict[str, str], dict[str, str]]:
    """The same for station names by IP address; an empty string is no name."""
    return _alike(_unique(a), _unique(b))


def _alike(
    one: dict[str, str], other: dict[str, str], *, of_one_type: bool = True
) -> tuple[dict[str, str], dict[str, str]]:
    if len(one) == len(other) == 1 and of_one_type:
        name, second = *one.values(), *other.values()
        both = name if name == second else f"{name} / {second}"
        return dict.fromkeys(one, both), dict.fromkeys(other, both)
    return _completed(one, other), _completed(other, one)


def _completed(names: dict[str, str], others: dict[str, str]) -> dict[str, str]:
    """The names; an address without a name takes it from the other capture."""
    taken = set(names.values())
    return {
        ip: others[ip] if name == ip and others.get(ip, ip) not in taken else name
        for ip, name in names.items()
    }


def _named(capture: Json) -> dict[str, str]:
    """Station names by IP address; the address itself without a name, or if two devices share it."""
    stations = {each["ip"]: each.get("station") for each in capture.get("devices", [])}
    ips = sorted({each["device"] for each in capture["transactions"]})
    return _unique({ip: stations.get(ip) for ip in ips})


def _unique(stations: Mapping[str, str | None]) -> dict[str, str]:
    often = Counter(stations.values())
    return {ip: (often[name] == 1 and name) or ip for ip, name in stations.items()}


def _family(*sides: elements.History | None) -> str | None:
    """The family of parameters of the drive: a maker's family if either side shows one."""
    known = {each.family for each in sides if each is not None}
    return next(iter(known - {"profile"}), "profile")


def _rows(
    a: elements.CaptureElements, b: elements.CaptureElements, places: Places
) -> Iterator[ElementDifference]:
    near = _near(a), _near(b)
    for element in sorted(a.elements.keys() | b.elements.keys(), key=_sort_key):
        mine, theirs = a.elements.get(element), b.elements.get(element)
        name, unit = _about(mine, theirs)
        family = _family(mine, theirs)
        for operation in elements.OPERATIONS:
            one = None if mine is None else mine.of(operation)
            other = None if theirs is None else theirs.of(operation)
            if one is None and other is None:
                continue
            if one is not None and other is not None:
                result = compare(one, other)
            elif mine is not None and theirs is not None:
                result = OTHER_OPERATION
            else:
                lacking = near[1] if one else near[0]
                result = _one_sided(element, lacking[element[1:]], places)
            yield ElementDifference(element, operation, result, one, other, name, unit, family)


def compare(a: elements.Outcomes, b: elements.Outcomes) -> str:
    """SAME, DIFFERENT, SOMETIMES, OTHER_REQUESTS or OPEN, for the reads or changes of an element."""
    if not equal_last(a, b):
        return DIFFERENT
    if not a.kinds or not b.kinds:
        return OPEN
    shared = shared_requests(a, b)
    if any(map(turned, shared)):
        return DIFFERENT
    if a.kinds == b.kinds:
        return SAME
    return OTHER_REQUESTS if all(one.keys() == other.keys() for one, other in shared) else SOMETIMES


def equal_last(a: elements.Outcomes, b: elements.Outcomes) -> bool:
    """Whether the last values are the same; True if a capture has none."""
    return not (a.values and b.values) or elements.equal(a.last, a.format, b.last, b.format)


Pair = tuple[Counter[object], Counter[object]]
"""The kinds of outcome of one request, counted, in A and in B."""


def shared_requests(a: elements.Outcomes, b: elements.Outcomes) -> list[Pair]:
    """The requests that both captures show, with their outcomes."""
    shared = [each for each in a.of_requests if each in b.of_requests]
    return [(a.of_requests[each], b.of_requests[each]) for each in shared]


def turned(pair: Pair) -> bool:
    """Whether B answers the same request differently.

    It returns a value in only one capture, fails with different errors, or fails more often in one capture than
    chance explains.
    """
    one, other = pair
    if one[elements.VALUE] and other[elements.VALUE]:
        return fails_otherwise(pair)
    return one.keys() != other.keys()


def fails_otherwise(pair: Pair) -> bool:
    """Whether a request fails more often in one capture than chance explains."""
    (failed, passed), (failed_too, passed_too) = (
        (each.total() - each[elements.VALUE], each[elements.VALUE]) for each in pair
    )
    return fisher(failed, passed, failed_too, passed_too) <= SIGNIFICANT


def _one_sided(element: elements.ElementKey, asked: Iterable[Place], places: Places) -> str:
    """ONLY or OTHER_WAY; `asked` are the places where the other capture asked for the same PNU and subindex."""
    unclear = any(not places.are_different(place, element.place) for place in asked)
    return OTHER_WAY if unclear else ONLY


def _near(side: elements.CaptureElements) -> Mapping[tuple[int, int], list[Place]]:
    """The places at which a capture asked for a PNU and subindex."""
    found = defaultdict[tuple[int, int], list[Place]](list)
    for element in side.elements:
        found[element[1:]].append(element.place)
    return found


def _about(*histories: elements.History | None) -> tuple[str | None, str | None]:
    """Name and unit of an element from either capture."""
    known = [each for each in histories if each is not None]
    name = next((each.name for each in known if each.name), None)
    return name, next((each.unit for each in known if each.unit), None)


def _sort_key(element: elements.ElementKey) -> tuple[object, ...]:
    return *element.place.sort_key, element.pnu, element.subindex


def _counts(a: Iterable[str], b: Iterable[str]) -> list[tuple[str, int, int]]:
    first, second = Counter(a), Counter(b)
    return [(name, first[name], second[name]) for name in sorted(first.keys() | second.keys())]


def _latencies(
    a: Json, b: Json, called: tuple[dict[str, str], dict[str, str]]
) -> list[LatencyDifference]:
    groups: dict[tuple[str, str], tuple[list[Took], list[Took]]] = {}
    for side, (capture, names) in enumerate(zip((a, b), called, strict=True)):
        for item in capture["transactions"]:
            if item["duration_ms"] is not None and item["duration_ms"] >= 0:  # no clock set back
                key = names.get(item["device"], item["device"]), item["operation"]
                groups.setdefault(key, ([], []))[side].append(
                    (item.get("start"), item["duration_ms"])
                )
    return [_latency(*key, *sides) for key, sides in sorted(groups.items()) if all(sides)]


def _latency(device: str, operation: str, one: list[Took], other: list[Took]) -> LatencyDifference:
    a, b = ([took for _, took in side] for side in (one, other))
    return LatencyDifference(
        device,
        operation,
        (len(a), len(b)),
        (median(a), median(b)),
        (_percentile(a, 95), _percentile(b, 95)),
        mann_whitney(a, b) if min(len(a), len(b)) >= _FEW else None,
        (one, other),
    )


def _percentile(values: list[float], percent: int) -> float:
    """The nearest-rank percentile: always a measured value."""
    return sorted(values)[max(0, -(-percent * len(values) // 100) - 1)]


def _faults(a: Json, b: Json, called: tuple[dict[str, str], dict[str, str]]) -> list[Faults]:
    one, other = (_counted(*side) for side in zip((a, b), called, strict=True))
    both = sorted(one.keys() & other.keys(), key=str)
    return [Faults(*key, one[key], other[key]) for key in both]


def _counted(capture: Json, names: dict[str, str]) -> dict[tuple[str, int | None, int | None], int]:
    """The faults of each drive with complete events."""
    relations = capture.get("relations") or []
    found: Counter[tuple[str, int | None, int | None]] = Counter()
    partly = set()
    for timeline in capture.get("timelines") or []:
        relation = relations[timeline["relation"] - 1]
        device = names.get(relation["device"], relation["device"])
        key = device, relation["slot"], relation["subslot"]
        found[key] += sum(event["name"] == FAULT for event in timeline["events"])
        if timeline["events_left_out"]:
            partly.add(key)
    return {key: count for key, count in found.items() if key not in partly}
