r"""Report as CSV: one row per parameter, of S7 per item, for spreadsheets and data frames.

The columns are COLUMNS, named as the keys of the JSON contract, a dot between a key and the one
inside it. A transaction whose parameters nobody knows has one row with these columns empty. One
value stands as it is, several as a JSON array. Findings that belong to no transaction are not in
this format. UTF-8, comma, LF; holds nothing between two rows.

A text that a spreadsheet would take for a formula gets a quote (') in front, and what nobody could
see is an escape (`\x1b`), so that a row is a line: captures come from strangers. Numbers stay
numbers, negative ones too. The columns with type and meaning: schema/table-1.schema.json.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any, ClassVar, TextIO

from ds47.model import CaptureResult, Finding, Parameter, Transaction, Value
from ds47.report import ReportOptions, contract, is_text, json
from ds47.report import Writer as _Writer
from ds47.report.formatting import escape
from ds47.report.targets import Telegrams
from ds47.report.values import about, of_kind

TRANSACTION_COLUMNS = tuple(each.name for each in contract.TRANSACTION_COLUMNS)
PARAMETER_COLUMNS = (
    *(each.name for each in contract.HEAD_COLUMNS),
    "values",
    "scaled",
    *(each.name for each in contract.ERROR_COLUMNS),
)
S7_COLUMNS = tuple(each.name for each in contract.S7_COLUMNS)
COLUMNS = ("path", *TRANSACTION_COLUMNS, *PARAMETER_COLUMNS, *S7_COLUMNS)
"""The header."""
_OF_LISTS = [
    number
    for number, each in enumerate(contract.HEAD_COLUMNS)
    if each.key.schema is contract.MAYBE_TEXT
]
"""Cells with a text that anybody may have written."""

Cell = int | float | str | None


class Lines:
    """Ends rows with LF. They come with CR LF: before Python 3.13 csv quotes only what ends a row."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, row: str) -> object:
        return self._stream.write(row.removesuffix("\r\n") + "\n")


class Table(_Writer):
    """Writes rows under a header."""

    header: ClassVar[Sequence[str]] = ()

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._csv = csv.writer(Lines(stream), lineterminator="\r\n")
        self._csv.writerow(self.header)


class Writer(Table):
    """Writes rows as transactions are finished."""

    streams: ClassVar[bool] = True
    header: ClassVar[Sequence[str]] = COLUMNS

    def whole(self, result: CaptureResult) -> None:
        Telegrams.tell(result)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        lang = self.options.lang
        left = f"{_guarded(path)},{_left()(transaction, lang)}"
        for parameter, right in contract.rows(transaction):
            told = _EMPTY if parameter is None else _parameter(parameter, lang)
            more = _NO_S7 if right is contract.NOTHING else ",".join(map(_cell, right))
            self.stream.write(f"{left},{told},{more}\n")


_EMPTY = "," * (len(PARAMETER_COLUMNS) - 1)
_NO_S7 = "," * (len(S7_COLUMNS) - 1)
_quotes = re.compile('[",\r\n]').search
_FORMULA = re.compile(r"(?:^|(?<=;))(?=\s*[=+\-@＝＋－＠])")
"""In front of what a formula begins with, also in full width; at a semicolon some spreadsheets begin a cell."""


def guarded(text: str | None) -> str | None:
    """A text that no spreadsheet takes for a formula and no terminal for a command.

    Blanks in front are skipped by some spreadsheets; tabs and line ends are escapes here.
    """
    if not text:
        return text
    return _FORMULA.sub("'", escape(text))


def _cell(value: Cell) -> str:
    """A cell as `csv` writes it: in quotes where it has to be."""
    if value is None:
        return ""
    text = str(value)
    return text if _quotes(text) is None else '"' + text.replace('"', '""') + '"'


_text = lru_cache(maxsize=4096)(_cell)
"""The same of a text that comes again."""


@lru_cache(maxsize=4096)
def _guarded(text: str | None) -> str:
    return _cell(guarded(text))


@cache
def _left() -> Callable[[Transaction, str], str]:
    """What writes the cells of a transaction: the f-string that one would write by hand, as that of JSON."""
    names: dict[str, Any] = {"text": _text, "guarded": _guarded}
    cells = [(each.key, each.attribute) for each in contract.TRANSACTION_COLUMNS]
    return contract.compiled(f"f'''{contract.fields(cells, _code, ',', names)}'''", names)


def _code(key: contract.Key, attribute: str) -> str:
    text = "guarded({})" if key.schema is contract.TEXT else "text({})"
    code = contract.code(key, attribute, "''", text)
    return f"{{{code}}}"


def _parameter(item: Parameter, lang: str) -> str:
    head, shown = _head(about(item), item.value_count, lang), _values(item.values, item.format)
    scaled = "" if item.scaled is None else _values(item.scaled, item.format)
    if item.error is None:
        return f"{head},{shown},{scaled},,,"
    code, text, info = contract.error_cells(item, lang)
    return f"{head},{shown},{scaled},{_cell(code)},{_guarded(text)},{_cell(info)}"


@lru_cache(maxsize=4096)
def _head(known: tuple[Any, ...], value_count: int | None, lang: str) -> str:
    """The cells of a parameter up to its values."""
    cells = contract.head_cells(of_kind(known, value_count=value_count), lang)
    for number in _OF_LISTS:
        cells[number] = guarded(cells[number])
    return ",".join(map(_cell, cells))


def _values(values: list[Value], format_name: str | None) -> str:
    if not values:
        return ""
    if len(values) > 1:
        return _cell(json.visible(json.list_text(values)))
    value = values[0]
    if isinstance(value, str):
        return _cell(guarded(value) if is_text(format_name) else value)
    return str(value)
