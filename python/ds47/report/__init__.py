"""Reports: one result model, one serializer per format.

Lives here: what the serializers share. That is their shape, their options, and how to open one by the
name of its format. Each format has the module of its name (`ds47.report.text`, `.json`, `.ndjson`, `.csv`).
`ds47.model` says what the words mean. Nothing here analyses anything.

Each module has `Writer(stream, options)`, which takes results one by one; `write_all` hands it a whole report. A
writer with `streams` takes every transaction as soon as it is finished, and holds no more than one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from types import MappingProxyType
from typing import Any, ClassVar, Final, NamedTuple, Protocol, TextIO, cast

from ds47.model import CaptureResult, Finding, Report, Transaction, worst
from ds47.report.heading import Heading
from ds47.report.reference import Reference
from ds47.report.zones import UNIVERSAL, Zone

SCHEMA = "ds47.report/2"
"""The version of the JSON contract, as the key `schema` of a report."""

FORMATS = (
    "text",
    "overview",
    "json",
    "ndjson",
    "csv",
    "events",
    "parameters",
    "parquet",
    "html",
    "markdown",
    "junit",
    "sarif",
)
"""Names for `open_writer`, each a module of this package."""


_SUMMARIES = {"json": "digest_json", "html": "digest_page"}
"""Formats with a module of their own for `--summary`."""
_PROSE = 140
"""Columns of a line of prose where no terminal has another number."""
_COLORS = {"error": "31", "warning": "33", "note": "36", "ok": "32", "bold": "1", "dim": "2"}

Paint = Callable[[str, str], str]
"""Takes a colour ("error", "bold", ...) and a text."""


class CannotWriteError(Exception):
    """A format that cannot be written here; the text says why, and what to do."""


class RuleText(Protocol):
    """What a report says about a rule; `ds47.spec.Rule` has it."""

    @property
    def name(self) -> str: ...
    @property
    def advice(self) -> str: ...
    @property
    def advice_zh(self) -> str: ...


NO_TRANSACTION: Final = "no transaction in it (--require transactions)"
NOT_OURS: Final = "nothing of PROFINET, PROFIBUS or S7 in it"
"""Why a capture fails that has nothing to judge: the mirror port may be unplugged."""


class ReportOptions(NamedTuple):
    """How to print. `color`: ANSI colours (text only). `rules`: the catalogue, for rule names.

    `fail_on`: the least severity of a finding that is a failure, `required`: so is a capture without a
    transaction (junit only). `lang`: the language of the
    report (text), or the one a page starts in (html). `plc`: also show what the PLC saw of jobs that are ok
    (text only). `reference`: the meaning of 100 % of a setpoint (text, html). `s7`: also show transactions of
    S7 without findings (text only). `heading`: the title block (html). `zone`: the time zone (text, html).
    `width`: columns of a line; None: tables are as wide as they are, and prose has 140 (text).
    `detail`: "all"; "auto" leaves out transactions, events and findings where these are many; "short" is 40
    lines at most (text); "summary" is 12, and the same in html, json and markdown. `captures`: how many captures
    the report covers. For many of them, unless `detail` is "all", the text shows totals. `filters`: a display
    filter for the frames of each cause and rule (text).
    """

    color: bool = False
    rules: Mapping[str, RuleText] = MappingProxyType({})
    fail_on: str = "error"
    lang: str = "en"
    plc: bool = False
    reference: Reference | None = None
    s7: bool = False
    heading: Heading | None = None
    zone: Zone = UNIVERSAL
    width: int | None = None
    detail: str = "all"
    captures: int = 1
    filters: bool = False
    required: bool = False

    @property
    def columns(self) -> int:
        """Columns of a line of prose."""
        return self.width or _PROSE

    def paint(self, color: str, text: str) -> str:
        """A text in a colour ("error", "bold", ...), if there are colours."""
        return f"\x1b[{_COLORS[color]}m{text}\x1b[0m" if self.color else text


class Writer:
    """The shape of a serializer: transactions (if it streams), captures, then `close`."""

    streams: ClassVar[bool] = False

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        self.stream = stream
        self.options = options or ReportOptions()

    def whole(self, result: CaptureResult) -> None:
        """Hears of a capture of which everything is known, before its transactions come one by one."""

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        """Takes one finished transaction of the capture `path` with the findings about it."""

    def capture(self, result: CaptureResult) -> None:
        """Takes a capture at its end; for a writer that streams, without its transactions."""

    def unreadable(self, path: str, problem: str) -> None:
        """Takes a capture that could not be read at all, instead of `capture`."""

    def close(self) -> None:
        """Ends the report. The stream stays open: it belongs to the caller."""


class _WriterClass(Protocol):
    def __call__(self, stream: TextIO, options: ReportOptions | None = None) -> Writer: ...


def open_writer(name: str, stream: TextIO, options: ReportOptions | None = None) -> Writer:
    """The serializer for one of FORMATS, writing to `stream`.

    Raises:
        ValueError: for other names.
        CannotWriteError: the format needs a missing package, or another kind of stream.
    """
    if name not in FORMATS:
        raise ValueError(f"no report format {name!r}: one of {', '.join(FORMATS)}")
    summed = options is not None and options.detail == "summary"
    module = import_module(f"ds47.report.{_SUMMARIES.get(name, name) if summed else name}")
    return cast(_WriterClass, module.Writer)(stream, options)


def write_all(writer: Writer, report: Report) -> None:
    """Drives a writer of any format with a complete report."""
    for result in report.captures:
        write_one(writer, result)
    writer.close()


def write_one(writer: Writer, result: CaptureResult) -> None:
    """Hands one complete result to a writer, as a stream if the writer streams."""
    if writer.streams:
        _replay(writer, result)
    else:
        writer.capture(result)


def _replay(writer: Writer, result: CaptureResult) -> None:
    """Hands over a complete result as a streaming analysis would."""
    writer.whole(result)
    by_transaction: dict[int | None, list[Finding]] = {}
    for finding in result.findings:
        by_transaction.setdefault(finding.transaction, []).append(finding)
    for transaction in result.transactions:
        writer.transaction(result.path, transaction, by_transaction.pop(transaction.id, []))
    rest = [finding for findings in by_transaction.values() for finding in findings]
    writer.capture(replace(result, transactions=[], findings=rest))


def handed_out(
    result: CaptureResult, take: Callable[[Transaction, list[Finding]], None]
) -> CaptureResult:
    """Gives the transactions away in the order in which they ended, as an analysis does; returns the rest."""
    about: dict[int | None, list[Finding]] = {}
    bad = worst(each for each in result.findings if each.transaction is not None)
    for finding in result.findings:
        about.setdefault(finding.transaction, []).append(finding)
    for transaction in sorted(result.transactions, key=lambda t: max(t.frames.all(), default=0)):
        take(transaction, about.pop(transaction.id, []))
    rest = [finding for findings in about.values() for finding in findings]
    return replace(result, transactions=[], findings=rest, worst=bad)


def is_text(format_name: str | None) -> bool:
    """Whether a string value of this format is text from the drive (docs/protocol.md A.6).

    In other formats a string is hex digits, or a number that JSON cannot hold (NaN, 64 bits).
    """
    return format_name is None or format_name.startswith(("VisibleString", "UNICODE", "Unicode"))


def schema(name: str = "report-2") -> dict[str, Any]:
    """A JSON Schema of the package.

    Args:
        name: `report-2` is the report; its `$defs` has `message` (decode). `transaction-2` is a line of
            ndjson. `report-1` and `transaction-1` are their predecessors. `table-1` has the rows of
            `csv` and `parquet` in its `$defs`. `summary-1` is what `--summary -f json` writes. `overview-1`
            is the overview of a folder of results.
    """
    from importlib import resources  # takes as long to import as a small report to write
    from json import loads

    text = resources.files("ds47").joinpath("schema", f"{name}.schema.json")
    return cast(dict[str, Any], loads(text.read_text(encoding="utf-8")))
