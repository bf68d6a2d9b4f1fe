"""Last values side by side: a CSV of `ds47 report -f parameters` against another one, or against a capture.

Here a table is read and compared, as a `Difference` whose rows are of the operation LAST; what a last value is has
`ds47.report.trail`, how a difference looks `difference_report`. A capture is compared by the table that it gives.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ds47.model import CaptureResult, Report, Value
from ds47.regression.difference import (
    LAST,
    ONLY,
    OTHER_WAY,
    Difference,
    ElementDifference,
    compare,
    named_alike,
)
from ds47.regression.elements import VALUE, ElementKey, Outcomes
from ds47.regression.places import Place
from ds47.report import is_text, parameters, write_all

_NEEDED = (
    "path", "device", "station", "target", "drive_object", "pnu", "subindex", "name", "unit",
    "value", "format", "known", "certain",
)  # fmt: skip
_SLOT = re.compile(r"\bslot (\d+)(?:\.(\d+))?")
_AXIS = re.compile(r"\baxis (\d+)")
_HOW = ("read", "written")


class NoTableError(ValueError):
    """A file that is no such table, or one of several captures; the text says why."""


class ValueLine(NamedTuple):
    """One element of a table; `how` is "read", "written" or empty where no value is known."""

    device: str
    station: str
    place: Place
    pnu: int
    subindex: int
    name: str
    unit: str
    value: Value | None
    format: str | None
    how: str
    certain: bool


def table(result: CaptureResult) -> list[ValueLine]:
    """The table that `ds47 report -f parameters` gives of a capture."""
    stream = io.StringIO()
    write_all(parameters.Writer(stream), Report([result]))
    return read(stream.getvalue())


def read(text: str) -> list[ValueLine]:
    """A table as it was written, or as a spreadsheet saved it (with semicolons).

    Raises:
        NoTableError: it is another table, a broken one, or one of several captures.
    """
    head = text.partition("\n")[0]
    delimiter = ";" if head.count(";") > head.count(",") else ","
    try:
        rows = list(csv.DictReader(io.StringIO(text), delimiter=delimiter))
    except csv.Error as problem:
        raise NoTableError(f"no CSV: {problem}") from problem
    names = [each.strip() for each in head.split(delimiter)]
    if missing := [each for each in _NEEDED if each not in names]:
        raise NoTableError(
            "no CSV of `ds47 report -f parameters`: its first line has no " + ", ".join(missing)
        )
    paths = {each["path"] for each in rows}
    if len(paths) > 1:
        raise NoTableError(f"a table of {len(paths)} captures; diff needs one")
    return [_line(number, each) for number, each in enumerate(rows, 2)]


def _line(number: int, row: dict[str, Any]) -> ValueLine:
    if None in row or None in row.values():
        raise NoTableError(f"row {number} has another number of cells than the first line")
    how = row["known"]
    if how not in ("", *_HOW):
        raise NoTableError(f"row {number}: known is {how!r}, not read or written")
    form = row["format"] or None
    return ValueLine(
        row["device"], row["station"], _place(number, row), _number(number, row, "pnu"),
        _number(number, row, "subindex"), row["name"], row["unit"],
        _value(row["value"], form) if how else None, form, how, row["certain"].lower() == "true",
    )  # fmt: skip


def _number(number: int, row: Mapping[str, str], name: str) -> int:
    if not re.fullmatch(r"\d{1,9}", row[name]):
        raise NoTableError(f"row {number}: {name} is {row[name]!r}, not a number")
    return int(row[name])


def _place(number: int, row: Mapping[str, str]) -> Place:
    """The drive object, where its number is proved; else the way to it. Of neither: the device."""
    slot, axis = _SLOT.search(row["target"]), _AXIS.search(row["target"])
    object_ = _number(number, row, "drive_object") if row["drive_object"] else None
    return Place(
        row["device"],
        object_,
        int(slot[1]) if slot else None,
        int(slot[2]) if slot and slot[2] else None,
        int(axis[1]) if axis else None,
    )


def _value(text: str, form: str | None) -> Value:
    """A cell as the value that it was made of: text, a number, or what no number can hold."""
    if is_text(form):
        return text
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def difference(a: list[ValueLine], b: list[ValueLine], names: tuple[str, str]) -> Difference:
    """Compares two tables. Devices are the same as in `regression.difference.difference`."""
    called = named_alike(*({each.device: each.station for each in side} for side in (a, b)))
    sides = [_elements(side, known) for side, known in zip((a, b), called, strict=True)]
    found = Difference(names)
    found.rows = list(_rows(*sides))
    return found


def _elements(lines: list[ValueLine], called: Mapping[str, str]) -> dict[ElementKey, ValueLine]:
    """The lines by their elements.

    Where a number is proved, the way to the drive object does not count, unless a table has the element by two
    ways that were not proved to be one.
    """
    often = Counter(_element(each, called, _bare(each.place)) for each in lines)
    found: dict[ElementKey, ValueLine] = {}
    for each in lines:
        bare = _element(each, called, _bare(each.place))
        found[bare if often[bare] == 1 else _element(each, called, each.place)] = each
    return found


def _element(line: ValueLine, called: Mapping[str, str], place: Place) -> ElementKey:
    return ElementKey(place._replace(device=called[line.device]), line.pnu, line.subindex)


def _bare(place: Place) -> Place:
    return place if place.drive_object is None else Place(place.device, place.drive_object)


def _rows(
    a: Mapping[ElementKey, ValueLine], b: Mapping[ElementKey, ValueLine]
) -> Iterator[ElementDifference]:
    near = _near(a), _near(b)
    for element in sorted(a.keys() | b.keys(), key=lambda each: (each.place.sort_key, *each[1:])):
        mine, theirs = a.get(element), b.get(element)
        one, other = (None if each is None else _outcomes(each) for each in (mine, theirs))
        if one is not None and other is not None:
            result = compare(one, other)
        else:
            asked = near[1 if one else 0][element.place.device, *element[1:]]
            unclear = any(_may_be(each, element.place) for each in asked)
            result = OTHER_WAY if unclear else ONLY
        known = [each for each in (mine, theirs) if each is not None]
        name = next((each.name for each in known if each.name), None)
        unit = next((each.unit for each in known if each.unit), None)
        yield ElementDifference(element, LAST, result, one, other, name, unit)


def _near(lines: Mapping[ElementKey, ValueLine]) -> Mapping[tuple[str, int, int], list[Place]]:
    """The places where a table has a PNU and subindex of a device."""
    found = defaultdict[tuple[str, int, int], list[Place]](list)
    for element in lines:
        found[element.place.device, *element[1:]].append(element.place)
    return found


def _may_be(one: Place, other: Place) -> bool:
    """Whether two places may be the same drive object: not if they have different numbers."""
    if one.drive_object is None or other.drive_object is None:
        return True
    return one.drive_object == other.drive_object


def _outcomes(line: ValueLine) -> Outcomes:
    """A last value as the one outcome of one request."""
    found = Outcomes(asked=1)
    if line.how and line.value is not None:
        found.value(line.value, line.format, None)
        found.note((line.how, line.certain), VALUE)
    return found
