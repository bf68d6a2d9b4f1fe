"""What one capture shows of each element of each parameter: values, negative responses, what stayed open.

Reads and changes are counted apart, and never become one another. What two captures show is compared in
`ds47.regression.difference`; which drive object a request reaches is known to `ds47.regression.places`.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from ds47.profidrive import decode_request
from ds47.profidrive.dictionary import family_of
from ds47.profidrive.drive_objects import LOCAL
from ds47.profidrive.elements import is_whole, split
from ds47.regression.places import Json, Place, Places, access_of
from ds47.spec import format_named

OPERATIONS: Final = ("read", "change")
VALUE: Final = "value"
_DOUBTFUL: Final = frozenset({"DS106", "DS309", "DS315"})
"""Findings of a response that is not all there: what it does not say is not known."""


def vendor_of(device: Json) -> int | None:
    """The vendor of a device in a report: as the capture shows it, else the assumed one."""
    shown: int | None = device.get("vendor_id")
    return device.get("assumed_vendor_id") if shown is None else shown


class ElementKey(NamedTuple):
    """One element of a parameter."""

    place: Place
    pnu: int
    subindex: int


@dataclass(slots=True)
class Outcomes:
    """What came of all reads, or of all changes, of one element in one capture."""

    asked: int = 0
    values: int = 0
    """Reads that brought a value, or changes that were accepted."""
    distinct: int = 0
    """How many of them are different values."""
    last: Any = None
    """The last of these values, and its format."""
    format: str | None = None
    negative: Counter[int | None] = field(default_factory=Counter)
    """Negative responses by error number; None for one without a number."""
    refused: Counter[str] = field(default_factory=Counter)
    """Record calls with a negative STATUS, by its eight hex digits."""
    of_requests: dict[tuple[Any, ...], Counter[object]] = field(default_factory=dict)
    """How often each request had which kind of outcome. A request is its way, subindex and number of elements,
    for a change what was written, too."""

    seen: set[object] = field(default_factory=set)
    """The values by their numbers and by their bits."""
    history: list[tuple[str | None, Any]] = field(default_factory=list)
    """When the transaction of each value began, as the report has it, and the value."""

    @property
    def open(self) -> int:
        """Requests without an outcome in the capture."""
        return self.asked - self.values - self.negative.total() - self.refused.total()

    @property
    def kinds(self) -> set[object]:
        """The kinds of outcome: VALUE, error numbers, STATUS words."""
        return set().union(*self.of_requests.values())

    def value(self, value: object, format_name: str | None, time: str | None) -> None:
        """Counts a value that was read, or accepted."""
        keys = {
            repr(float(value)) if isinstance(value, int | float) else repr(value),
            _bits(value, format_name),
        } - {None}
        self.values += 1
        self.distinct += self.seen.isdisjoint(keys)
        self.seen |= keys
        self.last, self.format = value, format_name
        self.history.append((time, value))

    def note(self, request: tuple[Any, ...], kind: object) -> None:
        """Counts which kind of outcome a request had."""
        self.of_requests.setdefault(request, Counter())[kind] += 1


@dataclass(slots=True)
class History:
    """What one capture shows of one element that it asked for, by whatever request."""

    read: Outcomes = field(default_factory=Outcomes)
    change: Outcomes = field(default_factory=Outcomes)
    name: str | None = None
    unit: str | None = None
    family: str | None = None
    """The family of the drive's parameters, if the report gives it."""

    def of(self, operation: str) -> Outcomes | None:
        """The outcomes of "read" or "change"; None where there was none."""
        found = self.read if operation == "read" else self.change
        return found if found.asked else None


@dataclass(slots=True)
class CaptureElements:
    """What one capture shows of all elements.

    `unknown`: transactions whose parameters are not all in the capture.
    `texts`: the words of the error numbers of each device.
    """

    elements: dict[ElementKey, History] = field(default_factory=dict)
    unknown: int = 0
    texts: dict[tuple[str, int | None], str] = field(default_factory=dict)


def shown(capture: Json, names: Mapping[str, str], places: Places) -> CaptureElements:
    """What a capture object of `ds47.report/1` or `/2` shows; `names`: of its devices, by IP address."""
    found = CaptureElements()
    vendors = {each["ip"]: vendor_of(each) for each in capture.get("devices", ())}
    for item in capture["transactions"]:
        vendor = vendors.get(item["device"])
        access = access_of(item, names)
        parameters, whole = _asked(item)
        found.unknown += not whole
        for position, each in enumerate(parameters):
            if each["pnu"] is None or each["attribute"] != "value":
                continue
            place = places.of(access, each["pnu"])
            if each["error"] is not None:
                key = access.device, each["error"]["code"]
                found.texts.setdefault(key, each["error"]["text"])
            family = family_of(vendor, each.get("family"))
            _note(found, place, item, position, each, family)
    return found


def _asked(item: Json) -> tuple[list[Json], bool]:
    """The parameters that a transaction asked for, and whether that is all of them."""
    parameters = item["parameters"]
    request = _bytes(item, "request")
    if item["state"] != "mismatch":
        count = request[3] if len(request) > 3 else 0
        return parameters, item["state"] != "orphan" and count <= len(parameters)
    message = decode_request(request)
    asked: list[Json] = [
        {
            "pnu": each.pnu, "subindex": each.subindex, "attribute": each.attribute_name,
            "element_count": each.element_count, "name": None, "unit": None, "format": None,
            "values": [], "error": None,
        }
        for each in message.addresses
    ]  # fmt: skip
    return asked, len(asked) == message.parameter_count


def _bytes(item: Json, kind: str) -> bytes:
    """The bytes of the "request" or "response"; nothing where there are none."""
    about = item.get("bytes")
    text = about.get(kind) if isinstance(about, dict) else None
    try:
        return bytes.fromhex(text) if isinstance(text, str) else b""
    except ValueError:
        return b""


def _note(
    found: CaptureElements, place: Place, item: Json, position: int, each: Json, family: str
) -> None:
    first, values = each["subindex"] or 0, split(each["values"], each.get("format"))
    count = max(1, each["element_count"] or 0, len(values) if is_whole(each.get("format")) else 0)
    operation = item["operation"]
    request = _form(item, each)
    for step in range(count):
        key = ElementKey(place, each["pnu"], first + step)
        history = found.elements.setdefault(key, History())
        unit = None if each.get("scaled") else each["unit"]  # shown are the values as sent
        history.family = family
        history.name, history.unit = each["name"] or history.name, unit or history.unit
        if operation not in OPERATIONS:
            continue  # asked for, but neither read nor changed
        outcomes = history.read if operation == "read" else history.change
        outcomes.asked += 1
        value = values[step] if step < len(values) else None
        _count(outcomes, item, position, each, value, request)


def _form(item: Json, each: Json) -> tuple[Any, ...]:
    """What makes two requests for an element the same request."""
    axis = None if item["index"] == LOCAL else item["axis"]
    way = (
        item["index"],
        item["slot"],
        item["subslot"],
        axis,
        each["subindex"],
        each["element_count"],
    )
    if item["operation"] == "read":
        return way
    return (*way, repr(each.get("format")), repr(each["values"]))


def _count(
    outcomes: Outcomes, item: Json, position: int, each: Json, value: object, form: tuple[Any, ...]
) -> None:
    if each["error"] is not None:
        outcomes.negative[each["error"]["code"]] += 1
        outcomes.note(form, each["error"]["code"])
    elif item["state"] == "refused":
        word = _status(item)
        outcomes.refused[word] += 1
        outcomes.note(form, word)
    elif value is not None and _has_value(item, position):
        outcomes.value(value, each.get("format"), item.get("start"))
        outcomes.note(form, VALUE)


def _has_value(item: Json, position: int) -> bool:
    """Whether the values of a parameter without an error were read, or accepted by the drive."""
    if item["operation"] == "read" or item["state"] == "ok":
        return item["state"] in ("ok", "partial", "error")
    findings = item.get("findings")
    doubtful = isinstance(findings, list) and any(rule in findings for rule in _DOUBTFUL)
    if item["state"] != "partial" or doubtful:
        return False
    response = _bytes(item, "response")
    return len(response) > 3 and position < response[3]


def _status(item: Json) -> str:
    words = (item["status"]["write"], item["status"]["read"])
    return next((each for each in words if each not in (None, "00000000")), "-")


def equal(one: Any, one_format: str | None, other: Any, other_format: str | None) -> bool:
    """Whether two values of JSON are the same: the same text, number, or bits in the width of their formats."""
    if one_format == other_format:
        return repr(one) == repr(other)
    if one == other:
        return True
    mine = _bits(one, one_format)
    return mine is not None and mine == _bits(other, other_format)


def _bits(value: Any, name: str | None) -> bytes | None:
    """The value as it stood in the message; None where that is not known."""
    row = format_named(name) if isinstance(name, str) else None
    if row is None or not row.pack:
        return None
    try:
        number = float(value) if row.pack in "fd" else int(value)
        return struct.pack(">" + row.pack, number)
    except (TypeError, ValueError, OverflowError, struct.error):
        return None
