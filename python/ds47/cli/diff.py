"""`ds47 diff`: two captures, or their results, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import output, warn
from ds47.cli.options import analysis_options, options_from
from ds47.cli.paths import about

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions


@click.command("diff")
@click.argument("a", metavar="A")
@click.argument("b", metavar="B")
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(["text", "json", "html"]),
    default="text",
    show_default=True,
)
@click.option("-o", "--output", "output_name", metavar="FILE", default="-", help="Write to a file.")
@click.option("--exit-code", is_flag=True, help="Exit with 1 if parameters or refusals differ.")
@analysis_options
def command(
    a: str, b: str, format_name: str, output_name: str, exit_code: bool, **options: Any
) -> int:
    """Show what changed from A to B: parameters, values, refusals, findings, latency.

    A and B are captures, stored results (NAME.ds47.json), or reports (-f json) of one capture.
    """
    from ds47.regression.difference import difference
    from ds47.report.difference import write

    analysis = options_from(**options)
    one, one_whole = _side(a, analysis)
    other, other_whole = _side(b, analysis)
    found = difference(one, other, (a, b))
    with output(output_name) as stream:
        write(found, format_name, stream, analysis.lang)
    if not (one_whole and other_whole):
        return 3
    return int(exit_code and bool(found.changed or found.errors))


def _side(path: str, analysis: AnalysisOptions) -> tuple[dict[str, Any], bool]:
    """One side as a capture object, and whether it was read as a whole."""
    from ds47.analysis import analyze
    from ds47.capture import CaptureError
    from ds47.regression import baseline

    if path.lower().endswith(".json"):
        return _from_json(path), True
    try:
        result = analyze(path, analysis)
    except CaptureError as problem:
        warn(about(path, str(problem)))
        raise SystemExit(3) from problem
    if not result.complete:
        warn(about(path, result.problem or "only partly read"))
    return baseline.content(result), result.complete


def _from_json(path: str) -> dict[str, Any]:
    import json

    from ds47.regression import baseline

    try:
        document = json.loads(Path(path).read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as problem:
        raise click.ClickException(f"{path}: {problem}") from problem
    if isinstance(document, dict) and document.get("schema") == "ds47.report/1":
        captures = document.get("captures", [])
        if len(captures) != 1:
            raise click.ClickException(
                f"{path}: a report of {len(captures)} captures; diff needs one"
            )
        return dict(captures[0])
    try:
        return baseline.load(Path(path))
    except baseline.BaselineError as problem:
        raise click.ClickException(str(problem)) from problem
