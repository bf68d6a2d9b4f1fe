"""`ds47 diff`: two captures, or their results, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from ds47.capture.names import about
from ds47.cli.common import Misses, columns_of, fail, format_option, output, refused
from ds47.cli.helping import helped
from ds47.cli.options import analysis_options, options_from, refuse_without_effect
from ds47.cli.series import series_option, tasks, tell_lacking
from ds47.cli.targets import spare_captures

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions
    from ds47.batch.tasks import Task
    from ds47.regression.difference import Difference
    from ds47.regression.last_values import ValueLine


@helped("diff", ("ds47 diff yesterday.pcapng today.pcapng", "what changed between them"))
@click.argument("a", metavar="A")
@click.argument("b", metavar="B")
@format_option("text", "json", "html")
@click.option("-o", "--output", "output_name", metavar="FILE", default="-", help="Write to a file.")
@click.option("--all", "everything", is_flag=True, help="List also what only one capture shows.")
@click.option(
    "--exit-code",
    is_flag=True,
    help="Exit with 1 if a parameter differs, or only one capture asks for it.",
)
@series_option
@analysis_options
def command(
    a: str,
    b: str,
    format_name: str,
    output_name: str,
    everything: bool,
    exit_code: bool,
    series: bool,
    lang: str,
    **options: Any,
) -> int:
    """Show what differs between A and B: values, negative responses, states, findings, latency.

    A and B are captures, stored results (NAME.ds47.json), or reports (-f json) of one capture. With
    --series also the folder of a ring buffer. If one is a table of last values (the CSV of
    `ds47 report -f parameters`), only last values are compared.
    """
    from ds47.regression.difference_report import write

    refuse_without_effect(format_name, {"everything": ("text", "html")})
    analysis = options_from(**options)
    spare_captures(output_name)
    if any(path.lower().endswith(".csv") for path in (a, b)):
        found, whole = _last_values(a, b, series, analysis, lang)
    else:
        found, whole = _captures(a, b, series, analysis, lang)
    with output(output_name) as stream:
        width = columns_of(output_name)
        write(found, format_name, stream, lang, everything=everything, width=width)
    if not whole:
        return 3
    return int(exit_code and bool(found.changed))


def _captures(
    a: str, b: str, series: bool, analysis: AnalysisOptions, lang: str
) -> tuple[Difference, bool]:
    """What differs, and whether both were read as a whole."""
    from ds47.regression.difference import difference

    one, one_whole = _side(a, series, analysis, lang)
    other, other_whole = _side(b, series, analysis, lang)
    return difference(one, other, (a, b)), one_whole and other_whole


def _last_values(
    a: str, b: str, series: bool, analysis: AnalysisOptions, lang: str
) -> tuple[Difference, bool]:
    """The same of last values."""
    from ds47.regression.last_values import difference, table
    from ds47.report.load import capture

    tables, complete = [], True
    for path in (a, b):
        if path.lower().endswith(".csv"):
            tables.append(_table(path))
            continue
        plain, whole = _side(path, series, analysis, lang)
        complete &= whole
        tables.append(table(capture({"path": path} | plain)))
    return difference(tables[0], tables[1], (a, b)), complete


def _table(path: str) -> list[ValueLine]:
    from ds47.regression.last_values import read

    with refused(OSError, ValueError, said=f"{path}: "):
        return read(Path(path).read_text(encoding="utf-8-sig"))


def _side(
    path: str, series: bool, analysis: AnalysisOptions, lang: str
) -> tuple[dict[str, Any], bool]:
    """One side as a capture object, and whether it was read as a whole."""
    from ds47.capture import CaptureError
    from ds47.regression import baseline
    from ds47.regression.run import readable

    if path.lower().endswith(".json"):
        return _from_json(path), True
    task = _one(path, series)
    try:
        result = readable(task, analysis)
    except CaptureError as problem:
        fail(about(path, str(problem)))
        raise click.exceptions.Exit(Misses.OURS if problem.ours else 3) from problem
    tell_lacking(task.path, result.missing_files, result.lacking)
    return baseline.content(result, lang), result.complete


def _one(path: str, series: bool) -> Task:
    """The one capture that a side is."""
    from ds47.batch.tasks import plan

    if not series:
        return plan([path], series)[0]
    found = tasks([path], series, fail)
    if not found:
        raise click.exceptions.Exit(3)
    if len(found) > 1:
        raise click.ClickException(
            f"{path}: {len(found)} captures and series; diff needs one: name its first file"
        )
    return found[0]


def _from_json(path: str) -> dict[str, Any]:
    from ds47.regression import baseline
    from ds47.regression.shape import flaw

    with refused(OSError, ValueError, RecursionError, said=f"{path}: "):
        document = baseline.parse(Path(path).read_text(encoding="utf-8-sig"))
    if isinstance(document, dict) and document.get("schema") in ("ds47.report/1", "ds47.report/2"):
        captures = document.get("captures", [])
        if not isinstance(captures, list):
            captures = [None]
        if len(captures) != 1:
            raise click.ClickException(
                f"{path}: a report of {len(captures)} captures; diff needs one"
            )
        (capture,) = captures
        if isinstance(capture, dict) and (part := capture.get("narrowed")):
            raise click.ClickException(
                f"{path}: the report is narrowed by {part['criteria']}; make a whole one to compare"
            )
        if (where := flaw(capture)) is not None:
            raise click.ClickException(
                f"{path}: the report is not whole (see {where or 'captures'}); make it again"
            )
        return cast(dict[str, Any], capture)
    with refused(baseline.BaselineError):
        return baseline.load(Path(path)).content
