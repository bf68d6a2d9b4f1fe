"""`ds47 report`: captures to transactions, in the format asked for.

Here: options, finding the files, exit status. The analysis is `ds47.analysis`, many captures at once
are `ds47.batch`, how a run goes `ds47.cli.run`, the formats `ds47.report`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, TextIO

import click

from ds47.batch.memory import collect_rarely
from ds47.batch.settings import heading_for
from ds47.capture import CaptureError
from ds47.capture.names import STDIN
from ds47.cli.common import Misses, color, columns_of, fail, output, refused, stdout, width_option
from ds47.cli.execution import Execution
from ds47.cli.helping import helped
from ds47.cli.options import (
    analysis_options,
    expect_option,
    expected_in,
    fail_on_option,
    heading_options,
    jobs_option,
    options_from,
    refuse_without_effect,
    require_option,
    tell_empty,
    tz_option,
    zone_for_paths,
)
from ds47.cli.progress import Progress
from ds47.cli.run import Run
from ds47.cli.selecting import CRITERIA, chosen, selection_options
from ds47.cli.series import series_option, tasks
from ds47.model import S7, SEVERITIES
from ds47.report import (
    FORMATS,
    NO_TRANSACTION,
    NOT_OURS,
    CannotWriteError,
    ReportOptions,
    RuleText,
    Writer,
    open_writer,
)
from ds47.report.bilingual import say
from ds47.report.heading import Heading
from ds47.report.reference import Reference
from ds47.report.zones import Zone

UNREADABLE, NOTHING = 3, 1


@helped(
    "report",
    ("ds47 report machine.pcapng", "what went wrong, and what to do"),
    ("ds47 report machine.pcapng -o machine.html", "the same as a page"),
    ("ds47 report -s failed --do 3 machine.pcapng", "what failed on drive object 3"),
    ("ds47 report --summary captures", "a folder in 12 lines"),
    (
        "ds47 report --expect golden.toml machine.pcapng",
        "which parameters are not as they should be",
    ),
)
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(FORMATS),
    metavar="FORMAT",
    help=f"{', '.join(FORMATS)}.  [default: that of the FILE of -o, else text; overview with --results]",
)
@click.option(
    "-o",
    "--output",
    "output_name",
    metavar="FILE",
    default=STDIN,
    help="Write to a file; - is stdout.",
)
@click.option("--open", "opens", is_flag=True, help="Open the page in the browser (html).")
@fail_on_option
@require_option
@expect_option
@click.option(
    "--plc",
    is_flag=True,
    help="What the PLC saw of every job, not only of failed ones (text).",
)
@click.option(
    "--reference",
    metavar="VALUE",
    help="What 100 % is, p2000: 50Hz or 50Hz=1395rpm (text, html).",
)
@click.option(
    "--summary",
    is_flag=True,
    help="12 lines: verdict, causes, who (text, html, json, markdown).",
)
@click.option(
    "--all",
    "show_all",
    is_flag=True,
    help="Every transaction, event, finding and capture (text).",
)
@click.option(
    "--filters",
    is_flag=True,
    help="Full display filter of each cause and rule (text).",
)
@selection_options
@heading_options
@tz_option
@width_option
@click.option("--digest", is_flag=True, help="Include the SHA-256 of each capture.")
@analysis_options
@click.option(
    "--engine",
    type=click.Choice(["native", "tshark", "both"]),
    default="native",
    show_default=True,
    help="Decoder; both compares them (DS601).",
)
@click.option(
    "--tshark",
    metavar="PROGRAM",
    envvar="DS47_TSHARK",
    help="The tshark for --engine.  [env: DS47_TSHARK]",
)
@jobs_option
@series_option
@click.option(
    "--results",
    "results_name",
    metavar="FOLDER",
    help="Store each result (JSON) and an overview in this folder or URL.",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Skip what --results has stored already, if unchanged.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Analyse on a Dask cluster: tcp://HOST:PORT.",
)
@click.option("--no-progress", is_flag=True, help="No progress bar.")
def command(
    paths: Sequence[str],
    format_name: str | None,
    output_name: str,
    opens: bool,
    fail_on: str,
    required: str | None,
    expect: str | None,
    plc: bool,
    reference: str | None,
    summary: bool,
    show_all: bool,
    filters: bool,
    where: Zone,
    width: int | None,
    engine: str,
    tshark: str | None,
    jobs: int | None,
    series: bool,
    results_name: str | None,
    resume: bool,
    scheduler: str | None,
    no_progress: bool,
    title: str,
    order: str,
    customer: str,
    author: str,
    lang: str,
    **options: Any,
) -> int:
    """Report the DS47 transactions of captures.

    What failed and why, what got no response or was not saved, telegram and times of each drive.
    PATH is a pcap or pcapng file (also .gz and .zst), a folder with everything below it, a URL of
    either (s3://...), or - for stdin. Hex dumps of packets (tshark -x, tcpdump -xx) and logs of
    PROFIBUS are captures, too.
    """
    collect_rarely()
    asked = {name: options.pop(name) for name in CRITERIA}
    execution = Execution(
        options_from(**options, kept_lists=True), lang, engine, tshark, jobs, results_name, resume, scheduler,
        expected_in(expect),
    )  # fmt: skip
    execution.check(paths, series)
    name = format_name or _of_name(output_name) or ("overview" if results_name else "text")
    refuse_without_effect(name, _ONLY_IN)
    if summary and show_all:
        raise click.UsageError("either --summary or --all")
    where = zone_for_paths(where, paths)
    choice = chosen(where, **asked)
    if choice and results_name:
        raise click.UsageError("--results keeps whole results and takes no criteria")
    lacking: list[str] = []
    found = tasks(paths, series, lacking.append)
    shown_page = name == "html" and output_name == STDIN and (opens or sys.stdout.isatty())
    if shown_page:
        output_name = _page_beside(paths)
    detail = "auto" if plc or filters else _detail(name, output_name)
    detail = "summary" if summary else "all" if show_all else detail
    shown = ReportOptions(
        rules=_Catalogue(), lang=lang, plc=plc, zone=where, width=width or columns_of(output_name),
        reference=None if reference is None else _reference(reference), detail=detail,
        captures=len(found), filters=filters, required=bool(required),
    )  # fmt: skip
    heading = Heading(title, order, customer, author)
    if name == "html":
        with refused(CaptureError):  # what is not typed is as ds47.toml has it
            heading = heading.over(heading_for(paths))
    with output(output_name) as stream:
        only_s7 = execution.analysis.channels == (S7,)
        writer = _writer(name, stream, fail_on, shown._replace(s7=only_s7, heading=heading))
        results, todo = execution.results(found, paths)
        quiet = name == "overview" or not stream.isatty()
        bar = quiet and not no_progress and len(todo) > 1 and sys.stderr.isatty()
        with Progress(len(todo), sum(task.size for task in todo), shown=bar) as progress:
            run = Run(writer, progress, choice or None)
            for text in lacking:
                run.missing(text)
            execution.run(run, found, todo, results, writer)
        writer.close()
    if shown_page:
        stdout().write(say("page_written", path=output_name).text(lang) + "\n")
    if opens:
        import webbrowser  # takes its time

        webbrowser.open(Path(output_name).resolve().as_uri())
    if run.failed:
        return Misses.OURS if run.ours else UNREADABLE
    if run.nothing:
        choice.refuse_backwards()
        there = run.instead(choice.of(None))
        fail(say("nothing_matches", criteria=choice.criteria, devices=there).text(lang))
        return NOTHING
    if required and run.empty:
        tell_empty(run.empty, NO_TRANSACTION)
        return NOTHING
    if fail_on == "never":
        return 0
    tell_empty(run.blank, NOT_OURS)
    return int(bool(run.blank) or run.worst >= SEVERITIES.index(fail_on))


_ONLY_IN = {
    "plc": ("text",), "reference": ("text", "html"), "width": ("text", "overview"), "filters": ("text",),
    "summary": ("text", "html", "json", "markdown"), "show_all": ("text",),
    "title": ("html",), "opens": ("html",), "order": ("html",), "customer": ("html",), "author": ("html",),
}  # fmt: skip
_ENDINGS = {
    ".html": "html", ".htm": "html", ".json": "json", ".ndjson": "ndjson", ".csv": "csv", ".parquet": "parquet",
    ".md": "markdown", ".sarif": "sarif",
}  # fmt: skip
_OF_OTHERS = {
    ".pdf": "print the page to one: -o report.html",
    **dict.fromkeys((".xlsx", ".xls"), "a spreadsheet reads -o report.csv"),
}


def _of_name(output_name: str) -> str | None:
    """The format that the name of a file says: nobody wants text in `report.html`."""
    ending = PurePath(output_name).suffix.lower()
    if ending in _OF_OTHERS:
        raise click.UsageError(f"{output_name}: ds47 writes no {ending[1:]}; {_OF_OTHERS[ending]}")
    return _ENDINGS.get(ending)


def _page_beside(paths: Sequence[str]) -> str:
    """The file for a page that nobody named: nobody wants to read HTML on a terminal."""
    first = PurePath(paths[0]).name
    stem = first.partition(".")[0] if len(paths) == 1 and paths[0] != STDIN else ""
    return f"{stem or 'report'}.html"


def _detail(format_name: str, output_name: str) -> str:
    """On a terminal text is short: what matters stands on one screen."""
    terminal = output_name == STDIN and sys.stdout.isatty()
    return "short" if format_name == "text" and terminal else "auto"


def _reference(text: str) -> Reference:
    """`50Hz=1395rpm`: the same speed in one unit or several.

    Raises:
        click.UsageError: it is no number with a unit.
    """
    values = []
    for part in text.split("="):
        found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([^\d\s.]\D*)\s*", part)
        if found is None or not float(found[1]):
            raise click.UsageError(
                f"--reference {text}: no number with a unit, such as 50Hz or 1395rpm"
            )
        values.append((float(found[1]), found[2]))
    return Reference(tuple(values))


def _writer(format_name: str, stream: TextIO, fail_on: str, options: ReportOptions) -> Writer:
    """The serializer; of a junit report that fails on nothing, the errors still fail."""
    options = options._replace(
        color=color(stream), fail_on="error" if fail_on == "never" else fail_on
    )
    with refused(CannotWriteError):
        return open_writer(format_name, stream, options)


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
