"""One capture: its transactions, parameters and findings, and what a parameter held last."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from ds47.model import (
    CaptureFile,
    CaptureResult,
    Device,
    Diagnosis,
    Finding,
    Parameter,
    ParameterError,
    Relation,
    Report,
    Timeline,
    Transaction,
    Value,
)
from ds47.report import contract, csv, json, parquet
from ds47.report import values as meanings
from ds47.report.bilingual import say
from ds47.report.filters import display_filter
from ds47.report.sentences import error_words, message, sentence
from ds47.report.targets import Targets, Telegrams
from ds47.report.verdict import VerdictCounts, verdict
from ds47.spec import extras
from ds47.spec.units import moment

if TYPE_CHECKING:
    import pandas
    import pyarrow  # type: ignore[import-untyped]

"""A column that only tables of the library have: a report writes rows before it knows."""
_KINDS: Final = {"int64": "Int64", "string": "string", "double": "float64"}
"""Types of pandas by those of Arrow, for columns that may lack a value."""
_KNOWN = ("ok", "partial")
"""States of a transaction of which a value is one of its parameter."""


class Element(NamedTuple):
    """One parameter of one drive object: what two transactions have in common that mean the same."""

    device: str
    """IP address."""
    drive_object: str
    """`DO 2`, `axis 0` where the capture does not prove which one it is, or a slot; empty
    for a parameter of the whole device."""
    pnu: int
    subindex: int


class Access(NamedTuple):
    """A parameter of a transaction."""

    transaction: Transaction
    parameter: Parameter


class LastValue(NamedTuple):
    """What an element held last, as far as the capture shows it."""

    value: Value
    format: str | None
    transaction: Transaction
    """The Read that brought it, or the change that was accepted."""


class Result:
    """All that one capture says. Attributes have the names and units of the JSON (docs/report.md)."""

    def __init__(self, capture: CaptureResult) -> None:
        self._capture = capture
        Telegrams.tell(capture)

    def __iter__(self) -> Iterator[Transaction]:
        return iter(self._capture.transactions)

    def __len__(self) -> int:
        return len(self._capture.transactions)

    def __repr__(self) -> str:
        transactions, findings = (
            say("transactions", n=len(self)),
            say("findings", n=len(self.findings)),
        )
        return f"<ds47 result of {self.path}: {transactions.en}, {findings.en}>"

    @property
    def path(self) -> str:
        """The file, or the first one of a series."""
        return self._capture.path

    @property
    def sha256(self) -> str | None:
        """Of the file, in hex; None unless `digest` asked for it."""
        return self._capture.sha256

    @property
    def files(self) -> list[CaptureFile]:
        """The files of a ring buffer; of any other capture empty."""
        return self._capture.files

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return self._capture.frames

    @property
    def start(self) -> str | None:
        """Time of the first frame: ISO 8601 in UTC, nine digits."""
        return self._capture.start

    @property
    def end(self) -> str | None:
        """Time of the last frame: ISO 8601 in UTC, nine digits."""
        return self._capture.end

    @property
    def start_time(self) -> datetime | None:
        """Time of the first frame in UTC, to the microsecond; None in a year that `datetime` has not, too."""
        return None if self._capture.start_ns is None else moment(self._capture.start_ns)

    @property
    def end_time(self) -> datetime | None:
        """The same of the last frame."""
        return None if self._capture.end_ns is None else moment(self._capture.end_ns)

    @property
    def complete(self) -> bool:
        """Whether the file was read to its end; `problem` says why not."""
        return self._capture.complete

    @property
    def problem(self) -> str | None:
        """Why the file was not read to its end."""
        return self._capture.lacking

    @property
    def rpc(self) -> dict[str, int]:
        """How many RPC PDUs there are, by kind."""
        return self._capture.rpc

    @property
    def records(self) -> dict[str, dict[str, int]]:
        """How many record calls there are, by record index and by kind."""
        return self._capture.records

    @property
    def transactions(self) -> list[Transaction]:
        """In the order of their first frames."""
        return self._capture.transactions

    @property
    def findings(self) -> list[Finding]:
        """In the order of their frames; `message` words one."""
        return self._capture.findings

    @property
    def diagnoses(self) -> list[Diagnosis]:
        """The causes, worst first; `message` words one."""
        return self._capture.diagnoses

    @property
    def devices(self) -> list[Device]:
        """Who answered: IP and MAC address, name of station, vendor and device id."""
        return self._capture.devices

    @property
    def relations(self) -> list[Relation]:
        """The channels of drives in cyclic frames (docs/cyclic.md 5)."""
        return self._capture.relations

    @property
    def timelines(self) -> list[Timeline]:
        """What happened to the drives among them: events and sampled values (docs/cyclic.md 6)."""
        return self._capture.timelines

    @property
    def summary(self) -> dict[str, int]:
        """How many transactions there are, by state and by operation."""
        return self._capture.summary

    def verdict(self, lang: str = "en") -> str:
        """What the capture comes to, in a line: `NOT OK: dp3 refuses its parameters; 2 more causes`."""
        return verdict(VerdictCounts.of(self._capture)).text(lang)

    @property
    def parameters(self) -> Iterator[Access]:
        """Every parameter of every transaction, in their order."""
        for each in self._capture.transactions:
            for parameter in each.parameters:
                yield Access(each, parameter)

    def by_pnu(self, pnu: int, subindex: int | None = None) -> list[Access]:
        """The accesses to a parameter on whatever drive object, refused ones among them.

        Args:
            pnu: its number.
            subindex: one element, where not all are meant; one inside an array that was asked for counts.
        """
        return [
            each
            for each in self.parameters
            if each.parameter.pnu == pnu
            and (subindex is None or subindex in _subindices(each.parameter))
        ]

    def last_values(self) -> dict[Element, LastValue]:
        """What each element held last: read, or written and accepted.

        Which requests reach the same drive object is decided by what the capture proves (docs/pairing.md, P60).
        """
        targets = Targets(self._capture.transactions)
        labels = targets.labels(self._capture.transactions)
        found: dict[Any, tuple[Element, LastValue]] = {}
        for each, parameter in self.parameters:
            if each.state not in _KNOWN or each.operation not in ("read", "change"):
                continue
            if parameter.error is not None or parameter.attribute != "value":
                continue
            about = targets.identity(each, parameter.pnu)
            name = labels.get(about, "")
            for subindex, value in zip(_subindices(parameter), parameter.values, strict=False):
                key = Element(each.device, name, parameter.pnu or 0, subindex)
                last = LastValue(value, parameter.format, each)
                found[about, parameter.pnu, subindex] = key, last
        return dict(found.values())

    def telegram(self, item: Transaction) -> int | None:
        """The PROFIdrive telegram of the drive object that a transaction reaches, None where nothing tells it.

        It is p0922 as it was read or written last; else the only one that has the lengths of the cyclic data.
        """
        return self._telegrams.of(item)

    @cached_property
    def _telegrams(self) -> Telegrams:
        return Telegrams(self._capture)

    def message(self, item: Finding | Diagnosis | ParameterError, lang: str = "en") -> str:
        """What a finding, a diagnosis or an error of a parameter says: a line in "en" or "zh"."""
        if isinstance(item, ParameterError):
            return error_words(item, lang)
        return message(item, lang) if isinstance(item, Finding) else sentence(item, lang)

    def meaning(self, item: Parameter, lang: str = "en") -> str | None:
        """What the values of a parameter mean, where tables or lists say it: `F07900 Motor blocked`."""
        meant = meanings.meaning(item)
        return None if meant is None else meant.text(lang)

    def filter(self, item: Finding | Diagnosis) -> str:
        """A Wireshark display filter that shows the frames of a finding or a diagnosis."""
        return item.filter if isinstance(item, Finding) else display_filter(item.frames)[0]

    def to_dict(self) -> dict[str, Any]:
        """The document of `ds47 report -f json` (`ds47.report/2`)."""
        return json.document(Report([self._capture]))

    def to_frame(self) -> pandas.DataFrame:
        """A table with a row for each parameter and the columns of `ds47 report -f csv`.

        `values` and `scaled` are lists, `start` is a time of pandas in UTC. Whole numbers and texts are of the
        types of pandas that may lack. A transaction without parameters has one row.

        Raises:
            NotReadyError: pandas is not installed; the text says how to install it.
        """
        pandas = _needed("pandas", "to_frame", "pandas")
        table = pandas.DataFrame(list(self._rows()), columns=list(csv.COLUMNS))
        table["start"] = pandas.to_datetime(table["start"], utc=True, errors="coerce")
        kinds = {
            name: _KINDS[each["arrow"]]
            for name, each in parquet.columns("csv").items()
            if name not in ("start", "values", "scaled")  # a time, and lists
        }
        return table.astype(kinds)

    def to_arrow(self) -> pyarrow.Table:
        """A table with a row for each value and the columns of `ds47 report -f parquet`.

        polars, DuckDB and pandas take it as it is.

        Raises:
            NotReadyError: pyarrow is not installed; the text says how to install it.
        """
        _needed("pyarrow", "to_arrow", "parquet")
        columns = parquet.Columns()
        for each in self:
            columns.add(self.path, each)
        return columns.table()

    def _rows(self) -> Iterator[list[Any]]:
        path = parquet.utf8(self.path)
        for each in self:
            left = [path, *contract.transaction_cells()(each, "en")]
            for item, right in contract.rows(each):
                told: list[Any] = [None] * len(csv.PARAMETER_COLUMNS)
                if item is not None:
                    values, error = [item.values, item.scaled], contract.error_cells(item, "en")
                    told = [*contract.head_cells(item, "en"), *values, *error]
                yield [*left, *told, *right]


def _subindices(item: Parameter) -> range:
    """The elements of an access; a text is one, however long it is."""
    first = item.subindex or 0
    if len(item.values) == 1 and item.error is None:
        return range(first, first + 1)
    return range(first, first + max(item.element_count or 1, len(item.values)))


def _needed(package: str, method: str, extra: str) -> Any:
    """A package that a plain installation does not have."""
    try:
        return import_module(package)
    except ModuleNotFoundError as problem:
        from ds47.wireshark.tshark import NotReadyError

        raise NotReadyError(f"{method} needs {package}: {extras.install(extra)}") from problem
