"""`ds47 baseline`: stores the results of captures, for `ds47 check` to compare with."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.capture.names import about
from ds47.cli.common import Misses, stdout
from ds47.cli.helping import helped
from ds47.cli.options import analysis_options, each_of, jobs_option, options_from
from ds47.cli.series import refuse_urls, series_option, tasks, tell_lacking

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions
    from ds47.batch.tasks import Task
    from ds47.capture import CaptureError
    from ds47.model import CaptureResult


@helped("baseline", ("ds47 baseline captures", "a stored result beside each capture"))
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option("--force", is_flag=True, help="Overwrite an existing result.")
@jobs_option
@series_option
@analysis_options
def command(
    paths: Sequence[str], force: bool, jobs: int | None, series: bool, lang: str, **options: Any
) -> int:
    """Store the result of each capture beside it, as NAME.ds47.json.

    An existing result is kept; ds47 accept updates it.
    """
    from ds47.batch.products import kept_from
    from ds47.capture import CaptureError
    from ds47.regression import baseline
    from ds47.regression.run import result_path
    from ds47.report.bilingual import say

    refuse_urls(paths)
    misses = Misses()
    one = partial(_result, analysis=options_from(**options), force=force)
    for task, result in each_of(one, tasks(paths, series, misses), jobs):
        target = result_path(task)
        if result is None:
            _say(say("baseline_there", target=str(target)).text(lang))
            continue
        if isinstance(result, CaptureError):
            misses.of(task.path, result)
            continue
        try:
            baseline.save(target, baseline.content(result), Path(task.path).name)
        except OSError as problem:
            misses(about(task.path, str(kept_from(problem))))
            continue
        jobs, findings = len(result.transactions), len(result.findings)
        stored = say(
            "baseline_stored",
            target=str(target),
            transactions=say("baseline_transactions", n=jobs, number=str(jobs)),
            findings=say("baseline_findings", n=findings, number=str(findings)),
        )
        _say(stored.text(lang))
        tell_lacking(task.path, result.missing_files, result.lacking, misses)
    return misses.status


def _result(
    task: Task, analysis: AnalysisOptions, *, force: bool
) -> CaptureResult | CaptureError | None:
    """What is to be stored of a capture, or why it cannot be read; None where a result is there already."""
    from ds47.capture import CaptureError
    from ds47.regression.run import result_of, result_path

    if os.path.exists(result_path(task)) and not force:  # noqa: PTH110 (of a name that is too long: False)
        return None
    try:
        return result_of(task, analysis)
    except CaptureError as problem:
        return problem


def _say(text: str) -> None:
    from ds47.report.formatting import escape

    stdout().write(f"{escape(text)}\n")
