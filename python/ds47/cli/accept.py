"""`ds47 accept`: takes changes over into stored results, after saying which.

Never silently: what will change is listed first, and without a terminal only `--yes` lets it happen.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.capture.names import about
from ds47.cli.common import Misses, refused, tell, warn
from ds47.cli.helping import helped
from ds47.cli.options import analysis_options, each_of, jobs_option, options_from
from ds47.cli.series import refuse_urls, series_option, tasks, tell_lacking
from ds47.version import __version__

if TYPE_CHECKING:
    from ds47.regression.compare import Change, Json
    from ds47.regression.run import CheckOutcome

_SHOWN = 20


@helped(
    "accept",
    (
        "ds47 accept press.pcapng --where pnu=1120 --yes",
        "the changes of p1120 become the stored result",
    ),
)
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option(
    "--where",
    "conditions",
    multiple=True,
    metavar="KEY=VALUE",
    help="Only changes about this: pnu=964, subindex=0, rule=DS410, kind=value, device=IP, "
    "capture=PATTERN. Given more than once, all must hold.",
)
@click.option(
    "--by-version",
    is_flag=True,
    help="Only changes that come from a newer ds47 alone, not from the capture or the device.",
)
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.option(
    "--all", "show_all", is_flag=True, help=f"List more than {_SHOWN} changes of a capture."
)
@jobs_option
@series_option
@analysis_options
def command(
    paths: Sequence[str],
    conditions: Sequence[str],
    by_version: bool,
    yes: bool,
    show_all: bool,
    jobs: int | None,
    series: bool,
    lang: str,
    **options: Any,
) -> int:
    """Accept changes into the stored results of captures.

    Lists the changes and asks first. Changes that --where or --by-version leave out remain.
    """
    from ds47.regression.accept import WhereError, parse_where
    from ds47.report.bilingual import say

    refuse_urls(paths)
    with refused(WhereError, usage=True):
        where = parse_where(conditions)
    found, status = _find(paths, series, where, by_version, lang, jobs, options)
    if not found:
        tell([say("accept_nothing").text(lang)])
        return status
    _list(found, None if show_all else _SHOWN, lang)
    total = sum(len(changes) for _, changes in found)
    what = {
        "changes": say("accept_changes", n=total, number=str(total)),
        "captures": say("accept_captures", n=len(found), number=str(len(found))),
    }
    question = say("accept_question", **what)
    if not yes:
        if not sys.stdin.isatty():
            raise click.UsageError(f"{question.en} Pass --yes: nobody can be asked here")
        click.confirm(question.text(lang), abort=True)
    for outcome, changes in found:
        _take(outcome, changes)
    tell([say("accept_done", **what).text(lang)])
    return status


def _find(
    paths: Sequence[str],
    series: bool,
    where: dict[str, str],
    by_version: bool,
    lang: str,
    jobs: int | None,
    options: dict[str, Any],
) -> tuple[list[tuple[CheckOutcome, list[Change]]], int]:
    """The captures with changes that were asked for; and the exit status so far."""
    from ds47.regression.accept import chosen
    from ds47.regression.config import ConfigError
    from ds47.regression.run import check

    one = partial(check, options=options_from(**options), lang=lang)
    found, status, misses = [], 0, Misses()
    with refused(ConfigError):
        for task, outcome in each_of(one, tasks(paths, series, misses), jobs):
            tell_lacking(task.path, outcome.missing_files, outcome.problem, misses)
            if outcome.error is not None:
                text = about(task.path, outcome.error)
                if outcome.unreadable:
                    misses(text, ours=outcome.ours)
                else:
                    warn(text)
                status = 1
                continue
            changes = [
                change
                for change in outcome.changes
                if chosen(change, where, Path(task.path)) and (change.version or not by_version)
            ]
            if changes:
                found.append((outcome, changes))
    return found, misses.status or status


def _list(found: Sequence[tuple[CheckOutcome, list[Change]]], most: int | None, lang: str) -> None:
    from ds47.report.bilingual import say
    from ds47.report.formatting import escape

    for outcome, changes in found:
        tell([escape(outcome.path), *(f"    {escape(change.text)}" for change in changes[:most])])
        if most is not None and len(changes) > most:
            more = say("changes_more", number=str(len(changes) - most)).text(lang)
            tell([f"    {more}"])


def _take(outcome: CheckOutcome, changes: list[Change]) -> None:
    """All changes: the present result as it is; some: the stored one with these.

    It stays a result of the version that stored it as long as that is the reason for what is left.
    """
    from ds47.regression import baseline
    from ds47.regression.accept import merge

    assert outcome.now is not None
    assert outcome.stored is not None
    assert outcome.origin is not None
    now: Json = outcome.now
    version: str | None = __version__
    if len(changes) < len(outcome.changes):
        now = merge(outcome.stored, outcome.now, outcome.pairs, changes)
        taken = set(map(id, changes))
        left = [change for change in outcome.changes if id(change) not in taken]
        version = outcome.origin.version_with(left)
    baseline.save(outcome.result_path, now, Path(outcome.path).name, version)
