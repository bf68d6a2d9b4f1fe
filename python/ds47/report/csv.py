r"""Report as CSV: one row per parameter, for spreadsheets and data frames.

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
from ds47.report import Options, is_text, json, write_all
from ds47.report import Writer as _Writer
from ds47.report.formatting import escape
from ds47.report.sentences import error_words, name

TRANSACTION_COLUMNS = (
    "path",
    "transaction",
    "operation",
    "state",
    "controller",
    "device",
    "ar",
    "api",
    "slot",
    "subslot",
    "index",
    "request_reference",
    "axis",
    "frames.write_request",
    "frames.write_response",
    "frames.read_request",
    "frames.read_response",
    "polls",
    "start",
    "duration_ms",
    "status.write",
    "status.read",
    "findings",
)
"""`transaction` is its id, `polls` how many, `findings` the rules with a blank between."""
PARAMETER_COLUMNS = (
    "pnu",
    "subindex",
    "attribute",
    "element_count",
    "name",
    "unit",
    "format",
    "value_count",
    "values",
    "scaled",
    "error.code",
    "error.text",
    "error.info",
)
COLUMNS = TRANSACTION_COLUMNS + PARAMETER_COLUMNS
"""The header."""

Cell = int | float | str | None


def write(report: Report, stream: TextIO, options: Options | None = None) -> None:
    """Writes a complete report, the header first."""
    write_all(Writer(stream, options), report)


class _Lines:
    """Ends rows with LF. They come with CR LF: before Python 3.13 csv quotes only what ends a row."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, row: str) -> object:
        return self._stream.write(row.removesuffix("\r\n") + "\n")


class Writer(_Writer):
    """Writes rows as transactions are finished."""

    streams: ClassVar[bool] = True

    def __init__(self, stream: TextIO, options: Options | None = None) -> None:
        super().__init__(stream, options)
        self._csv = csv.writer(_Lines(stream), lineterminator="\r\n")
        self._csv.writerow(COLUMNS)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        left = _transaction_cells(path, transaction)
        for parameter in transaction.parameters:
            self._csv.writerow(left + _parameter_cells(parameter, self.options.lang))
        if not transaction.parameters:
            self._csv.writerow(left + [None] * len(PARAMETER_COLUMNS))


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
    return [
        guarded(path),
        item.id,
        item.operation,
        item.state,
        guarded(item.controller),
        guarded(item.device),
        item.ar,
        item.api,
        item.slot,
        item.subslot,
        item.index,
        item.request_reference,
        item.axis,
        item.frames.write_request,
        item.frames.write_response,
        item.frames.read_request,
        item.frames.read_response,
        len(item.frames.polls),
        json.timestamp(item.start_ns),
        json.milliseconds(item.duration_ns),
        json.status(item.write_status),
        json.status(item.read_status),
        " ".join(item.findings),
    ]


def _parameter_cells(item: Parameter, lang: str) -> list[Cell]:
    error = item.error
    return [
        item.pnu,
        item.subindex,
        item.attribute,
        item.element_count,
        guarded(name(item, lang)),
        guarded(item.unit),
        item.format,
        item.value_count,
        _values(item.values, item.format),
        _values(item.scaled or [], item.format),
        error.code if error else None,
        guarded(error_words(error, lang)) if error else None,
        error.info if error else None,
    ]


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
