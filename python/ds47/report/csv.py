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
from collections.abc import Sequence
from json import dumps
from typing import ClassVar, TextIO

from ds47.model import Finding, Parameter, Report, Transaction, Value
from ds47.report import Options, contract, is_text, json, write_all
from ds47.report import Writer as _Writer
from ds47.report.formatting import escape

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
_OF_DEVICES = [
    number
    for number, each in enumerate(contract.TRANSACTION_COLUMNS)
    if each.key.schema is contract.TEXT
]
_OF_LISTS = [
    number
    for number, each in enumerate(contract.HEAD_COLUMNS)
    if each.key.schema is contract.MAYBE_TEXT
]
"""Cells with a text that anybody may have written."""

Cell = int | float | str | None


def write(report: Report, stream: TextIO, options: Options | None = None) -> None:
    """Writes a complete report, the header first."""
    write_all(Writer(stream, options), report)


class Lines:
    """Ends rows with LF. They come with CR LF: before Python 3.13 csv quotes only what ends a row."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, row: str) -> object:
        return self._stream.write(row.removesuffix("\r\n") + "\n")


class Table(_Writer):
    """Writes rows under a header."""

    header: ClassVar[Sequence[str]] = ()

    def __init__(self, stream: TextIO, options: Options | None = None) -> None:
        super().__init__(stream, options)
        self._csv = csv.writer(Lines(stream), lineterminator="\r\n")
        self._csv.writerow(self.header)


class Writer(Table):
    """Writes rows as transactions are finished."""

    streams: ClassVar[bool] = True
    header: ClassVar[Sequence[str]] = COLUMNS

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        left = _transaction_cells(path, transaction)
        for parameter, right in contract.rows(transaction):
            told = _EMPTY if parameter is None else _parameter_cells(parameter, self.options.lang)
            self._csv.writerow(left + told + right)


_EMPTY: list[Cell] = [None] * len(PARAMETER_COLUMNS)
_FORMULA = "=+-@＝＋－＠"
"""What a formula begins with, also in full width."""


def guarded(text: str | None) -> str | None:
    """A text that no spreadsheet takes for a formula and no terminal for a command.

    Blanks in front are skipped by some spreadsheets; tabs and line ends are escapes here.
    """
    if not text:
        return text
    shown = escape(text)
    return "'" + shown if shown.lstrip()[:1] in _FORMULA and not shown.isspace() else shown


def _transaction_cells(path: str, item: Transaction) -> list[Cell]:
    cells = contract.transaction_cells(item)
    for number in _OF_DEVICES:
        cells[number] = guarded(cells[number])
    return [guarded(path), *cells]


def _parameter_cells(item: Parameter, lang: str) -> list[Cell]:
    cells = contract.head_cells(item, lang)
    for number in _OF_LISTS:
        cells[number] = guarded(cells[number])
    code, text, info = contract.error_cells(item, lang)
    values, scaled = _values(item.values, item.format), _values(item.scaled or [], item.format)
    return [*cells, values, scaled, code, guarded(text), info]


def _values(values: Sequence[Value], format_name: str | None) -> Cell:
    if len(values) != 1:
        return _array(values) if values else None
    value = values[0]
    return guarded(value) if isinstance(value, str) and is_text(format_name) else value


def _array(values: Sequence[Value]) -> str:
    """Several values as JSON; an escape in it is one of JSON."""
    text = json.text(values)
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else dumps(each)[1:-1] for each in text)
