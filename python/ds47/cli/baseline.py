"""`ds47 baseline`: stores the results of captures, for `ds47 check` to compare with."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ds47.capture.names import about
from ds47.cli.common import Misses, stdout
from ds47.cli.helping import Helped
from ds47.cli.options import analysis_options, options_from
from ds47.cli.paths import refuse_urls
from ds47.cli.series import series_option, tasks, tell_lacking


@click.command(
    "baseline",
    cls=Helped,
    examples=(("ds47 baseline captures", "a stored result beside each capture"),),
)
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option("--force", is_flag=True, help="Write over a result that is there already.")
@series_option
@analysis_options
def command(paths: Sequence[str], force: bool, series: bool, lang: str, **options: Any) -> int:
    """Store the result of each capture beside it, as NAME.ds47.json.

    A result that is there already stays as it is; ds47 accept takes over what changed.
    """
    from ds47.batch.products import kept_from
    from ds47.capture import CaptureError
    from ds47.regression import baseline
    from ds47.regression.run import result_of, result_path
    from ds47.report.bilingual import say

    refuse_urls(paths)
    analysis = options_from(**options)
    misses = Misses()
    for task in tasks(paths, series, misses):
        target = result_path(task)
        if os.path.exists(target) and not force:  # noqa: PTH110 (of a name that is too long: False)
            _say(say("baseline_there", target=str(target)).text(lang))
            continue
        try:
            result = result_of(task, analysis)
        except CaptureError as problem:
            misses(about(task.path, str(problem)))
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
    return 3 if misses else 0


def _say(text: str) -> None:
    from ds47.report.formatting import escape

    stdout().write(f"{escape(text)}\n")
