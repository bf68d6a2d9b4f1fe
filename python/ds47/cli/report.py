"""`ds47 report`: captures to transactions, in the format asked for.

Here: options, finding the files, exit status. The analysis is `ds47.analysis`, the formats are
`ds47.report`.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

import click

from ds47.cli.common import color, output, warn
from ds47.cli.options import analysis_options, options_from
from ds47.cli.paths import STDIN, about, captures
from ds47.model import SEVERITIES, CaptureResult, Finding, Transaction
from ds47.report import FORMATS, CannotWriteError, Options, RuleText, Writer, open_writer

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions, OnTransaction

    _Analyzer = Callable[[str | BinaryIO, OnTransaction | None], CaptureResult]

UNREADABLE = 3
_OBJECTS = 100_000
"""How many new ones make it worth to look for garbage."""


@click.command("report")
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(FORMATS),
    default="text",
    show_default=True,
    help="Format of the report; ndjson, csv and parquet do not grow in memory.",
)
@click.option(
    "-o",
    "--output",
    "output_name",
    metavar="FILE",
    default=STDIN,
    help="Write to a file, which then appears whole or not at all; - is stdout.",
)
@click.option(
    "--fail-on",
    type=click.Choice(["never", *SEVERITIES]),
    default="never",
    show_default=True,
    help="Exit with 1 if a finding is at least this severe.",
)
@click.option(
    "--plc",
    is_flag=True,
    help="What the PLC saw of every job, not only of those that failed (text).",
)
@click.option("--digest", is_flag=True, help="Put the SHA-256 of each capture into the report.")
@analysis_options
@click.option(
    "--engine",
    type=click.Choice(["native", "tshark", "both"]),
    default="native",
    show_default=True,
    help="Who decodes; tshark is the Wireshark plugin, both reports where they differ (DS601).",
)
@click.option(
    "--tshark",
    metavar="PROGRAM",
    envvar="DS47_TSHARK",
    help="The tshark of the engine tshark, else the one that is found. [env: DS47_TSHARK]",
)
@click.option(
    "-j",
    "--jobs",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    metavar="N",
    help="Captures analysed at once, each in a process; 0: as many as there are cores.",
)
def command(
    paths: Sequence[str],
    format_name: str,
    output_name: str,
    fail_on: str,
    plc: bool,
    engine: str,
    tshark: str | None,
    jobs: int,
    **options: Any,
) -> int:
    """Report the DS47 transactions of captures.

    PATH is a pcap or pcapng file (also .gz and .zst), a folder, which is searched for captures
    with all that is below it, or - for stdin.
    """
    analysis = options_from(**options)
    run = _Run(_analyzer(engine, analysis, tshark))
    _collect_rarely()
    with output(output_name) as stream:
        writer = _writer(format_name, stream, fail_on, analysis.lang, plc)
        wanted = captures(paths, run.missing)
        if jobs == 1 or engine != "native":
            run.all(wanted, writer)
        else:
            from ds47.cli.ahead import Ahead

            jobs = jobs or os.cpu_count() or 1
            with Ahead(wanted, (STDIN,), analysis, writer.streams, jobs) as ahead:
                run.analyze = ahead.analyze
                run.all(ahead, writer)
        writer.close()
    if run.failed:
        return UNREADABLE
    return int(fail_on != "never" and run.worst >= SEVERITIES.index(fail_on))


def _writer(format_name: str, stream: TextIO, fail_on: str, lang: str, plc: bool) -> Writer:
    """The serializer; of a junit report that fails on nothing, the errors still fail."""
    options = Options(
        color=color(stream),
        rules=_Catalogue(),
        fail_on="error" if fail_on == "never" else fail_on,
        lang=lang,
        plc=plc,
    )
    try:
        return open_writer(format_name, stream, options)
    except CannotWriteError as problem:
        raise click.ClickException(str(problem)) from problem


def _analyzer(engine: str, options: AnalysisOptions, tshark: str | None) -> _Analyzer:
    """What analyses a capture with these options."""
    if engine == "native":
        from ds47.analysis import analyze

        return lambda source, finished: analyze(source, options, finished)
    from ds47.wireshark.engine import Engine
    from ds47.wireshark.shark import NotReadyError

    try:
        return Engine("both" if engine == "both" else "tshark", options, tshark).analyze
    except NotReadyError as problem:
        raise click.ClickException(str(problem)) from problem


def _collect_rarely() -> None:
    """What an analysis keeps has no cycles: looking for them again and again only costs time."""
    gc.freeze()
    gc.disable()


def _collect() -> None:
    """Between two captures: what belonged to the last one, as a whole, has cycles."""
    if gc.get_count()[0] > _OBJECTS:
        gc.collect()


class _Run:
    """Goes from capture to capture, and remembers what the exit status needs."""

    def __init__(self, analyzer: _Analyzer) -> None:
        self.analyze = analyzer
        self.failed = False
        self.worst = -1

    def missing(self, text: str) -> None:
        """Says what could not be read, or not as a whole."""
        self.failed = True
        warn(text)

    def all(self, paths: Iterable[str], writer: Writer) -> None:
        """Analyses the captures, one after the other."""
        for path in paths:
            self.one(path, writer)

    def one(self, path: str, writer: Writer) -> None:
        """Analyses a capture and hands what it says to the writer."""
        from ds47.capture import CaptureError

        def finished(transaction: Transaction, findings: Sequence[Finding]) -> None:
            self._note(findings)
            writer.transaction(path, transaction, findings)

        _collect()
        source = sys.stdin.buffer if path == STDIN else path
        try:
            result = self.analyze(source, finished if writer.streams else None)
        except CaptureError as problem:
            self.missing(about(path, str(problem)))
            writer.unreadable(path, str(problem))
            return
        self._end(path, result, writer)

    def _end(self, path: str, result: CaptureResult, writer: Writer) -> None:
        result.path = path
        self._note(result.findings)
        if not result.complete:
            self.missing(about(path, result.problem or "only partly read"))
        writer.capture(result)

    def _note(self, findings: Sequence[Finding]) -> None:
        for finding in findings:
            self.worst = max(self.worst, SEVERITIES.index(finding.severity))


class _Catalogue(Mapping[str, RuleText]):
    """The rules, loaded when the first one is asked for: many captures have no finding."""

    def __getitem__(self, rule: str) -> RuleText:
        return self._rules()[rule]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rules())

    def __len__(self) -> int:
        return len(self._rules())

    def _rules(self) -> Mapping[str, RuleText]:
        from ds47 import spec

        return spec.rules()
