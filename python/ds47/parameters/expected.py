"""What the parameters of a drive should be: a golden list, read from TOML, CSV or XLSX, one value held against it.

`ds47 report -f parameters` of a good machine is such a list as it stands. Which element of a capture a row is
about, and what is found, is `ds47.report.expected`.
"""

from __future__ import annotations

import csv
import io
import math
import operator
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.model import Device, Value
from ds47.parameters import workbook
from ds47.parameters.lists import ListError, text_of
from ds47.profidrive.naming import LARGEST, element, spelled, spelling
from ds47.spec import toml

_HEADINGS: Final[Mapping[str, tuple[str, ...]]] = {
    "drive": ("drive", "device", "ip", "address", "antrieb", "gerät", "驱动器", "设备"),
    "station": ("station", "station name", "gerätename", "设备名称"),
    "drive_object": ("drive object", "do", "antriebsobjekt", "驱动对象"),
    "target": ("target",),
    "parameter": ("parameter", "pnu", "number", "parameter number", "parameternummer", "参数", "参数号"),
    "index": ("index", "subindex", "下标"),
    "name": ("name",),
    "value": ("value", "expected", "wert", "sollwert", "值", "数值", "期望值"),
    "within": ("within", "tolerance", "toleranz", "容差"),
    "min": ("min", "minimum", "最小值"),
    "max": ("max", "maximum", "最大值"),
    "known": ("known",),
}  # fmt: skip
"""What a column has -> its headings, in small letters and with blanks; those of `-f parameters` among them."""
_VALUE_KEYS: Final = ("value", "within", "min", "max")
_RANGE: Final = re.compile(r"(.*)\[(\d{1,5})(?:\.\.\.?|-)(\d{1,5})\]")
_DECIMAL_COMMA: Final = re.compile(r"[+-]?\d+,\d+")
_FEW_DIGITS: Final = 1e-12
"""Relative: a bound of Float64 that was worked out has no more digits than that."""
_EXAMPLE: Final = "p1120 = 4.5, or { value = 4.5, within = 0.1 }, or { min = 1.0, max = 10.0 }"


class Wanted(NamedTuple):
    """What a value should be: from `low` to `high`, None where there is no bound; without both, the text."""

    text: str
    """In print: `4.5`, `4.5 ± 0.1`, `1.0 .. 10.0`, `>= 1.0`."""
    low: float | None = None
    high: float | None = None

    def fits(self, value: Value, format_name: str | None) -> bool:
        """Whether a value of this format is as it should be."""
        if isinstance(value, str):
            if value == self.text:
                return True
            if "64" not in (format_name or "") or not value.lstrip("-").isdecimal():
                return False
            value = int(value)  # more digits than a number of JSON holds
        if self.low is None and self.high is None:
            return False
        same = _same(value, format_name)
        return (self.low is None or value >= self.low or same(self.low)) and (
            self.high is None or value <= self.high or same(self.high)
        )


class Expectation(NamedTuple):
    """One row of a list: which elements it is about, and what they should be.

    Attributes:
        pnu: the parameter.
        subindex: its element; None for all of them.
        drive: address, name of the station, or a pattern of these; "" for every drive.
        station: the name of the station, where a table has it beside the address.
        drive_object: its number; None for all of them.
        target: the way to a drive object without a known number, in the words of `-f parameters`.
        raw: whether values are meant as they were sent, and not as they are scaled.
    """

    pnu: int
    subindex: int | None
    wanted: Wanted
    drive: str = ""
    station: str = ""
    drive_object: int | None = None
    target: str = ""
    raw: bool = False

    def is_of(self, device: Device) -> bool:
        """Whether a device is meant: by the name of its station where both have one, else by `drive`."""
        if self.station and device.station:
            return self.station.lower() == device.station.lower()
        names = (device.ip, device.station, device.mac)
        pattern = self.drive.lower()
        return not pattern or any(fnmatchcase(each.lower(), pattern) for each in names if each)

    @property
    def rank(self) -> tuple[int, bool, bool]:
        """What says more exactly which element it is about counts more: drive, drive object, index."""
        exact = 0 if not self.drive else 1 if set(self.drive) & set("*?[") else 2
        known = self.drive_object is not None or bool(self.target)
        return exact, known, self.subindex is not None


class _Wrong(Exception):
    """What is wrong with a row, and what to try."""


Row = tuple[int, Expectation]
"""A row with its line."""


def read(path: Path) -> tuple[Expectation, ...]:
    """The rows of a list; the ending of the file says how to read it.

    Raises:
        ListError: file, line, what is wrong there, and what to try.
    """
    ending = path.suffix.lower()
    try:
        if ending == ".toml":
            return _checked(path, _of_toml(path, text_of(path.read_bytes())))
        if ending in (".csv", ".tsv", ".txt"):
            return _checked(path, _of_table(path, *_cells(path, text_of(path.read_bytes()))))
        if ending in (".xlsx", ".xlsm"):
            return _checked(path, _of_table(path, _of_sheet(path), comma=True))
    except OSError as problem:
        raise ListError(f"{path}: {problem.strerror or problem}") from problem
    raise ListError(
        f"{path}: no list of expected parameters ends in {ending or 'nothing'}. Try: .toml, .csv or .xlsx"
    )


def _checked(path: Path, rows: Iterable[Row]) -> tuple[Expectation, ...]:
    """All rows; one element is expected only once, unless it is twice the same."""
    found: dict[tuple[object, ...], Row] = {}
    for line, row in rows:
        key = row._replace(wanted=Wanted(""))
        before = found.setdefault(key, (line, row))
        if before[1] != row:
            one, other = before[1].wanted.text, row.wanted.text
            raise ListError(
                f"{path}, line {line}: {_shown(row)} is {other}, but {one} in line {before[0]}. Try: one of them"
            )
    if not found:
        raise ListError(f"{path}: no parameter has a value in it. Try: {_EXAMPLE}")
    return tuple(row for _, row in found.values())


def _shown(row: Expectation) -> str:
    return spelling(row.pnu) if row.subindex is None else element(row.pnu, row.subindex)


def _elements(text: str) -> tuple[int, list[int | None]]:
    """The parameter of a text, and its elements: `p1120`, `p1120[0]`, `p2900[0..3]`."""
    ranged = _RANGE.fullmatch(text.strip())
    named = spelled(ranged[1] if ranged else text)
    first, last = (int(ranged[2]), int(ranged[3])) if ranged else (0, 0)
    if named is None or not first <= last <= LARGEST:
        raise _Wrong(f"{text!r} is not a parameter. Try: p1120 or p1120[0]")
    return named.number, [*range(first, last + 1)] if ranged else [named.subindex]


def _object(text: str) -> int:
    number = re.fullmatch(r"(?:DO )?0*(\d{1,5})", text.strip(), re.IGNORECASE)
    if number is None or int(number[1]) > LARGEST:
        raise _Wrong(f"{text!r} is not the number of a drive object. Try: 3")
    return int(number[1])


# What a value should be


def _wanted(what: str, given: Mapping[str, tuple[str, float | None]]) -> Wanted:
    """Of `value`, `within`, `min` and `max`, each as a text and a number."""
    numbers = {key: number for key, (_, number) in given.items()}
    for key in ("within", "min", "max"):
        if key in given and numbers[key] is None:
            raise _Wrong(f"{key} of {what} is {given[key][0]!r}, no number. Try: {_EXAMPLE}")
    if "value" not in given:
        if "within" in given or not given:
            raise _Wrong(f"{what} has no value. Try: {_EXAMPLE}")
        return _between(what, given)
    if {"min", "max"} & set(given):
        raise _Wrong(f"{what} has a value and a range. Try: one of them")
    text, number = given["value"]
    if "within" not in given:
        return Wanted(text, number, number)
    if number is None:
        raise _Wrong(f"{what} is {text!r}, no number, within {given['within'][0]}. Try: {_EXAMPLE}")
    shown, within = given["within"]
    assert within is not None
    if within < 0:
        raise _Wrong(f"within of {what} is {shown}, less than 0. Try: {shown.lstrip('-')}")
    return Wanted(f"{text} ± {shown}", number - within, number + within)


def _between(what: str, given: Mapping[str, tuple[str, float | None]]) -> Wanted:
    (least, low), (most, high) = given.get("min", ("", None)), given.get("max", ("", None))
    if low is None or high is None:
        return Wanted(f"<= {most}" if low is None else f">= {least}", low, high)
    if low > high:
        raise _Wrong(f"min {least} of {what} is more than max {most}. Try: the other way round")
    return Wanted(f"{least} .. {most}", low, high)


def _same(value: float, format_name: str | None) -> Callable[[float], bool]:
    """What says whether a number is this value, as exactly as the format has it."""
    if isinstance(value, int):
        return partial(operator.eq, value)
    if format_name == "Float64":
        return partial(math.isclose, value, rel_tol=_FEW_DIGITS)
    single = _single(value)
    return lambda bound: single == _single(bound)


def _single(number: float) -> float:
    """The nearest Float32."""
    try:
        single: float = struct.unpack("<f", struct.pack("<f", number))[0]
    except OverflowError:
        return math.copysign(math.inf, number)
    return single


# TOML


def _of_toml(path: Path, text: str) -> Iterator[Row]:
    try:
        document = toml.parse(text)
    except ValueError as problem:
        raise ListError(f"{path}: no TOML: {problem}. Try: {_EXAMPLE}") from problem
    lines = _Lines(text)
    for place, table, drive, number in _tables(path, lines, document):
        for key, given in table.items():
            line = lines.of((*place, key))
            try:
                pnu, subindices = _elements(key)
                wanted = _wanted(key, _given(key, given))
            except _Wrong as problem:
                raise ListError(f"{path}, line {line}: {problem}") from None
            for subindex in subindices:
                yield line, Expectation(pnu, subindex, wanted, drive, drive_object=number)


_Table = tuple[tuple[str, ...], dict[str, Any], str, int | None]
"""Its place in the document, its parameters, its drive and the number of its drive object."""


def _tables(path: Path, lines: _Lines, document: dict[str, Any]) -> Iterator[_Table]:
    """All tables of parameters: `[do.3]`, `[drive."press-1"]`, `[drive."press-1".do.3]`, and what is in none."""
    drives = document.pop("drive", {})
    for place, drive, table in (
        ((), "", document),
        *((("drive", name), name, each) for name, each in _named(path, lines, drives, "drive")),
    ):
        objects = table.pop("do", {})
        yield place, table, "" if drive == "*" else drive, None
        for number, each in _named(path, lines, objects, *place, "do"):
            here = (*place, "do", number)
            try:
                yield here, each, "" if drive == "*" else drive, _object(number)
            except _Wrong as problem:
                raise ListError(f"{path}, line {lines.of(here)}: {problem}") from None


def _named(path: Path, lines: _Lines, tables: Any, *place: str) -> list[tuple[str, dict[str, Any]]]:
    """The tables in a table of tables, by their names."""
    name = "3" if place[-1] == "do" else '"press-1"'
    found = tables.items() if isinstance(tables, dict) else [("", tables)]
    for key, each in found:
        if not isinstance(each, dict):
            line = lines.of((*place, key))
            raise ListError(f"{path}, line {line}: write it as a table. Try: [{place[-1]}.{name}]")
    return list(found)


def _given(key: str, given: Any) -> dict[str, tuple[str, float | None]]:
    table = given if isinstance(given, dict) else {"value": given}
    if unknown := set(table) - set(_VALUE_KEYS):
        known = ", ".join(_VALUE_KEYS)
        raise _Wrong(f"{key} has no key {min(unknown)!r}; known are {known}. Try: {_EXAMPLE}")
    return {name: _typed(key, each) for name, each in table.items()}


def _typed(key: str, value: Any) -> tuple[str, float | None]:
    """A value of TOML as a text and a number; a boolean is 1 or 0."""
    if isinstance(value, str):
        return value, _number(value)
    if not isinstance(value, (int, float)) or (isinstance(value, float) and math.isnan(value)):
        raise _Wrong(f"{key} is {value!r}, neither a number nor a text. Try: {_EXAMPLE}")
    number = int(value) if isinstance(value, bool) else value
    return str(number), number


class _Lines:
    """In which line a key stands: TOML does not say, but a line is mostly a header or a key with its value."""

    def __init__(self, text: str) -> None:
        self._lines: dict[tuple[str, ...], int] = {}
        header: tuple[str, ...] = ()
        for number, line in enumerate(text.splitlines(), 1):
            try:
                place = (*_down(toml.parse(line)),)
            except ValueError:  # a part of a value
                continue
            if line.lstrip().startswith("["):
                header = place
            else:
                place = (*header, *place)
            for end in range(1, len(place) + 1):
                self._lines.setdefault(place[:end], number)

    def of(self, place: tuple[str, ...]) -> int:
        """The line of a key, or of the table that it stands in; 1 where none is known."""
        while place and place not in self._lines:
            place = place[:-1]
        return self._lines.get(place, 1)


def _down(table: Any) -> Iterator[str]:
    """The keys from a table down to its only value."""
    while isinstance(table, dict) and table:
        key, table = next(iter(table.items()))
        yield key


# Tables

_Cells = Iterator[tuple[int, list[str]]]
"""The cells of each row, with its line."""


def _cells(path: Path, text: str) -> tuple[_Cells, bool]:
    """Those of separated values, and whether a number may have a comma."""
    first = next((line for line in text.splitlines() if line.strip()), "")
    separator = max(",;\t|", key=first.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)

    def rows() -> _Cells:
        try:
            for cells in reader:
                yield reader.line_num, cells
        except csv.Error as problem:
            where = f"{path}, line {reader.line_num}"
            raise ListError(f"{where}: {problem}. Try: a CSV file") from problem

    return rows(), separator != ","


def _of_sheet(path: Path) -> _Cells:
    """Those of the first sheet of a workbook."""
    try:
        yield from enumerate(workbook.rows(path, None), 1)
    except workbook.WorkbookError as problem:
        raise ListError(f"{path}: {problem}") from problem


def _of_table(path: Path, rows: _Cells, comma: bool) -> Iterator[Row]:
    columns: dict[str, int] = {}
    for line, cells in rows:
        if not any(each.strip() for each in cells):
            continue
        if not columns:
            columns = _columns(path, line, cells)
            continue
        row = {key: _cell(cells, at) for key, at in columns.items()}
        try:
            yield from ((line, each) for each in _of_row(row, comma))
        except _Wrong as problem:
            raise ListError(f"{path}, line {line}: {problem}") from None


def _columns(path: Path, line: int, cells: Sequence[str]) -> dict[str, int]:
    headings = [" ".join(each.replace("_", " ").split()).casefold() for each in cells]
    found = {
        key: headings.index(each)
        for key, known in _HEADINGS.items()
        for each in reversed(known)
        if each in headings
    }
    if "parameter" in found and {"value", "min", "max"} & set(found):
        return found
    first = ", ".join(each for each in headings[:8] if each) or "empty"
    raise ListError(
        f"{path}, line {line}: no headings that are known ({first}). "
        "Try: drive,drive object,parameter,index,value"
    )


def _cell(cells: Sequence[str], at: int) -> str:
    """A cell, without what keeps a spreadsheet from taking a text for a formula."""
    return cells[at].strip().removeprefix("'") if at < len(cells) else ""


def _of_row(row: Mapping[str, str], comma: bool) -> Iterator[Expectation]:
    """The elements that a row of a table is about; `comma` is whether a number may have one."""
    parameter = row["parameter"]
    pnu, subindices = _elements(parameter)
    if "known" in row and (not row["value"] or spec.is_changing(pnu, row.get("name") or None)):
        return  # our own table: what no frame shows, and what the drive changes itself, is nothing to expect
    if index := row.get("index"):
        if not index.isdecimal() or int(index) > LARGEST:
            raise _Wrong(f"{index!r} is not an index. Try: 0")
        subindices = [int(index)]
    given = {key: (row[key], _number(row[key], comma)) for key in _VALUE_KEYS if row.get(key, "")}
    wanted = _wanted(parameter, given)
    number, station = row.get("drive_object"), row.get("station", "")
    for subindex in subindices:
        drive = row.get("drive", "") or station
        yield Expectation(
            pnu, subindex, wanted, "" if drive == "*" else drive, station,
            _object(number) if number else None, "" if number else row.get("target", ""), "known" in row,
        )  # fmt: skip


def _number(text: str, comma: bool = False) -> float | None:
    """The number in a text: 4.5, 0x10, true; `4,5` where a comma cannot separate cells."""
    plain = text.strip().lower()
    if plain in ("true", "false"):
        return int(plain == "true")
    if comma and _DECIMAL_COMMA.fullmatch(plain):
        plain = plain.replace(",", ".")
    for kind in (partial(int, base=0), float):
        try:
            number = kind(plain)
            return None if math.isnan(number) else number
        except ValueError:
            continue
        except OverflowError:  # more than any format holds
            return None
    return None
