"""Frames of a log that is text: lines with bytes, with or without times, and CSV (docs/profibus.md 5).

    1003 0249 4E16                                  bytes, with or without blanks, one frame or several
    12:00:01.250 -> 10 03 02 49 4E 16               a time, a direction
    [0.001250] E5                                   seconds, or with a unit: 1250 us
    Index;Time us;Dirn;Data                         CSV, by a head that names the data

    DEBUG PHY-serial: TX   10 03 02 49 4E 16        a line of a debug log (wordy.py)

Damaged bytes are reported by number of line; words without any cost nothing. Files and encodings are not here.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from ds47.profibus import wordy
from ds47.profibus.stream import split
from ds47.profibus.telegram import Telegram
from ds47.profidrive.notation import parse_hex
from ds47.spec import profibus

TO_SLAVE, TO_MASTER = "to_slave", "to_master"

_CLOCK = re.compile(
    r"(?:(?P<date>\d{4}-\d\d-\d\d)[T ])?(?P<h>\d{1,2}):(?P<m>\d\d):(?P<s>\d\d)(?:[.,](?P<part>\d{1,9})\d*)?Z?"
)
_NUMBER = re.compile(r"(?P<whole>\d{1,19})(?:[.,](?P<part>\d{1,9})\d*)?")
_UNIT = r"(?P<unit>[mnuµμ]?s)"
_END = r"(?:[\])](?=[\s;,|:]|$)|(?=[\s;|]|:\s|$))"
"""Behind a time: a comma alone ends none, it may stand between bytes."""
_CLOCK_FRONT = re.compile(rf"\s*[\[(]?(?P<clock>{_CLOCK.pattern})(?:{_END}|(?=,))")
_CLOCK_WITHIN = re.compile(rf"(?<![\w:.-]){_CLOCK.pattern}(?![\w:])")
"""A logger may put its name or the level in front."""
_NUMBER_FRONT = re.compile(
    rf"\s*(?:(?P<open>[\[(])\s*)?(?P<number>{_NUMBER.pattern})\s*{_UNIT}?{_END}"
)
_GAP = re.compile(r"[\s;,|:]+")
_HEAD_UNIT = re.compile(rf"(?P<name>.*?)[\s_/]*[\s_/(\[]{_UNIT}[)\]]?")
_DELIMITERS = ";\t|,"
_MOST_TEXT = 80
_DAY_BEGINS = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class LogEntry:
    """A frame of a log, or bytes that are none: then `telegram` has flaws."""

    line: int
    """From 1."""
    time_ns: int | None
    """By the log's own clock: since 1970 where there is a date, else since midnight or where it began."""
    direction: str | None
    """TO_SLAVE or TO_MASTER, as the log says; the function code of a frame says it too."""
    telegram: Telegram


@dataclass(frozen=True, slots=True)
class Unread:
    """What could not be read of a line."""

    line: int
    reason: str
    """"hex" (no bytes in hexadecimal digits), "column" (that of the data is missing) or "time"."""
    text: str
    """The beginning of the line."""


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where a CSV has what."""

    delimiter: str
    data: int
    time: int | None
    unit: int
    direction: int | None


def read(lines: Iterable[str]) -> Iterator[LogEntry | Unread]:
    """The frames of a log, in its order (docs/profibus.md 5).

    Empty lines and those that begin with # say nothing. The first other line may be the head of a CSV.

    `lines`: with or without their ends.
    """
    columns: _Columns | None = None
    first = True
    for number, line in enumerate(lines, start=1):
        text = line.strip("\ufeff\r\n")
        if not text.strip() or text.lstrip().startswith("#"):
            continue
        if first and (columns := _columns(text)) is not None:
            first = False
            continue
        first = False
        yield from _plain(number, text) if columns is None else _row(number, text, columns)


def _plain(number: int, text: str) -> Iterator[LogEntry | Unread]:
    time_ns, rest = front(text)
    direction, digits = _direction(rest)
    if data := _bytes(digits):
        for piece in split(data):
            yield LogEntry(number, time_ns, direction, piece.telegram)
    elif found := wordy.find(rest):
        if time_ns is None and (clock := _CLOCK_WITHIN.search(rest)):
            time_ns = _clock(clock[0])
        for item in found.telegrams:
            yield LogEntry(number, time_ns, _side(found.word or ""), item)
    elif wordy.damaged(digits):
        yield Unread(number, "hex", text[:_MOST_TEXT])


def _bytes(digits: str) -> bytes:
    """The bytes of a text that is nothing else; none where it is something else."""
    try:
        return parse_hex(digits)
    except ValueError:
        return b""


def front(text: str) -> tuple[int | None, str]:
    """The time with which a line begins, and what stands behind it.

    A whole number without unit and brackets is none: it would be taken from the bytes.
    """
    if found := _CLOCK_FRONT.match(text):
        return _clock(found["clock"]), _behind(text, found.end())
    found = _NUMBER_FRONT.match(text)
    if found is None or not (found["unit"] or found["part"] or found["open"]):
        return None, text
    unit = profibus.listing().units[found["unit"] or "s"]
    return _scaled(found["number"], unit), _behind(text, found.end())


def _behind(text: str, at: int) -> str:
    gap = _GAP.match(text, at)
    return text[gap.end() if gap else at :]


def _direction(text: str) -> tuple[str | None, str]:
    """The word for a direction with which a line goes on, and what stands behind it."""
    word = re.match(r"\s*([^\s;|:,]+)", text)
    side = None if word is None else _side(word[1])
    return (None, text) if word is None or side is None else (side, _behind(text, word.end()))


def _side(word: str) -> str | None:
    names, plain = profibus.listing(), word.strip().lower()
    if plain in names.to_slave:
        return TO_SLAVE
    return TO_MASTER if plain in names.to_master else None


def _clock(text: str) -> int | None:
    found = _CLOCK.fullmatch(text.strip())
    if found is None:
        return None
    seconds = int(found["h"]) * 3600 + int(found["m"]) * 60 + int(found["s"])
    if found["date"]:
        try:
            day = datetime.fromisoformat(found["date"]).replace(tzinfo=UTC)
        except ValueError:
            return None
        seconds += (day - _DAY_BEGINS).days * 86_400
    return seconds * 1_000_000_000 + int((found["part"] or "0").ljust(9, "0"))


def _scaled(text: str, unit: int) -> int | None:
    """A number of a unit in nanoseconds, without the detour of a float."""
    found = _NUMBER.fullmatch(text.strip())
    if found is None:
        return None
    part = (found["part"] or "").ljust(9, "0")
    return int(found["whole"]) * unit + int(part) * unit // 1_000_000_000


def _columns(text: str) -> _Columns | None:
    """The columns that a line names as the head of a CSV; None where it names no data."""
    names = profibus.listing()
    for delimiter in _DELIMITERS:
        cells = [each.strip().lower() for each in _cells(text, delimiter)]
        columns = {_named(each)[0]: at for at, each in reversed(list(enumerate(cells)))}
        data = _column(columns, names.data)
        if data is None or len(cells) < 2:
            continue
        time = _column(columns, names.time)
        unit = "s" if time is None else _named(cells[time])[1]
        direction = _column(columns, names.direction)
        return _Columns(delimiter, data, time, names.units[unit], direction)
    return None


def _cells(text: str, delimiter: str) -> list[str]:
    """The cells of a line; none where it is no CSV."""
    try:
        return next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error:
        return []


def _named(cell: str) -> tuple[str, str]:
    """The name of a column, and the unit behind it: `Time us`, `time [ms]`."""
    found = _HEAD_UNIT.fullmatch(cell) if len(cell) <= _MOST_TEXT else None
    return (cell, "s") if found is None else (found["name"], found["unit"])


def _column(columns: dict[str, int], names: tuple[str, ...]) -> int | None:
    return next((columns[name] for name in names if name in columns), None)


def _row(number: int, text: str, columns: _Columns) -> Iterator[LogEntry | Unread]:
    cells = _cells(text, columns.delimiter)
    if len(cells) <= columns.data:
        yield Unread(number, "column", text[:_MOST_TEXT])
        return
    said = _cell(cells, columns.time).strip()
    time_ns = _clock(said)
    if time_ns is None:
        time_ns = _scaled(said, columns.unit)
    if said and time_ns is None:
        yield Unread(number, "time", text[:_MOST_TEXT])
    direction = _side(_cell(cells, columns.direction))
    data = _bytes(cells[columns.data])
    if not data:
        yield Unread(number, "hex", text[:_MOST_TEXT])
    for piece in split(data):
        yield LogEntry(number, time_ns, direction, piece.telegram)


def _cell(cells: list[str], at: int | None) -> str:
    """A cell of a row, which may end before it: then, and where there is no such column, nothing."""
    return cells[at] if at is not None and at < len(cells) else ""
