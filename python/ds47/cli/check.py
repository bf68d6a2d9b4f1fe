"""`ds47 check`: captures against their stored results, for a person and for CI.

Here: options, output and exit status. Comparing is `ds47.regression`.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.capture.names import STDIN, about
from ds47.cli.common import Misses, columns_of, format_option, output, refused, stdout, tell
from ds47.cli.helping import helped
from ds47.cli.options import (
    analysis_options,
    each_of,
    expect_option,
    expected_in,
    jobs_option,
    options_from,
    refuse_without_effect,
    require_option,
)
from ds47.cli.series import refuse_urls, series_option, tasks, tell_lacking
from ds47.cli.targets import spare_captures
from ds47.model import SEVERITIES

if TYPE_CHECKING:
    from ds47.batch.tasks import Task
    from ds47.regression.run import CheckOutcome
    from ds47.report.bilingual import Both

_SHOWN = 20
"""Changes of one capture that are printed; a firmware that changed everything fills no screen."""
_REPEATED = 3
"""Paths that the line about ds47 accept repeats; instead of more it has PATH..."""
_MARGIN = 8
"""Columns of the word in front of a capture."""


@helped(
    "check",
    (
        "ds47 check captures --junit ds47.xml",
        "all captures of a folder against their stored results",
    ),
    (
        "ds47 check captures --expect golden.toml --fail-on warning",
        "and their drives against a list",
    ),
)
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@format_option("text", "json", "markdown", about="What goes to stdout.")
@click.option(
    "--fail-on",
    type=click.Choice(["never", *SEVERITIES]),
    metavar="SEVERITY",
    help="Fail on a new finding at or above.  [default: that of ds47.toml, or error]",
)
@require_option
@expect_option
@click.option("--junit", metavar="FILE", help="Write JUnit XML too, one test per capture.")
@click.option("--sarif", metavar="FILE", help="Write SARIF 2.1.0 too.")
@click.option("--summary", is_flag=True, help="Totals by label, and what the captures cover.")
@click.option(
    "--all", "show_all", is_flag=True, help=f"Print more than {_SHOWN} changes of a capture."
)
@jobs_option
@series_option
@analysis_options
def command(
    paths: Sequence[str],
    format_name: str,
    fail_on: str | None,
    required: str | None,
    expect: str | None,
    junit: str | None,
    sarif: str | None,
    summary: bool,
    show_all: bool,
    jobs: int | None,
    series: bool,
    lang: str,
    **options: Any,
) -> int:
    """Compare captures with their stored results (NAME.ds47.json).

    Exit status: 0 all as stored; 1 something changed, no result is stored, or the capture of a
    stored one is gone from a folder, or it lacks what --require asks for; 3 a capture cannot be read
    as a whole. Changes that come from a newer ds47 alone are reported and do not fail. A parameter
    that is not as --expect has it is a new finding, a warning. Tolerances, masks and known findings
    are set in ds47.toml.
    """
    refuse_without_effect(
        format_name, {"summary": ("text", "json"), "show_all": ("text", "markdown")}
    )
    refuse_urls(paths)
    spare_captures(junit, sarif)
    outcomes, seconds, misses = _run(paths, series, jobs, {
        "options": options_from(**options), "fail_on": fail_on, "lang": lang, "expected": expected_in(expect),
    })  # fmt: skip
    empty = [each for each in outcomes if each.now and not each.now["summary"]["transactions"]]
    if required and empty:
        from ds47.report import NO_TRANSACTION

        for each in empty:
            each.error = each.error or NO_TRANSACTION
    if format_name == "json":
        _print_json(outcomes, summary)
    elif format_name == "markdown":
        _print_markdown(outcomes, _typed(paths, series), None if show_all else _SHOWN, lang)
    else:
        shown = None if show_all else _SHOWN
        _print_text(outcomes, summary, _typed(paths, series), shown, lang)
    if junit:
        _write_junit(outcomes, seconds, junit)
    if sarif:
        _write_sarif(outcomes, sarif)
    if any(outcome.ours for outcome in outcomes):
        return misses.OURS
    if misses or any(outcome.unreadable for outcome in outcomes):
        return misses.UNREADABLE
    return int(any(outcome.failed for outcome in outcomes))


def _run(
    paths: Sequence[str],
    series: bool,
    jobs: int | None,
    how: dict[str, Any],
) -> tuple[list[CheckOutcome], list[float], Misses]:
    from ds47.regression.config import ConfigError

    one = partial(_timed, how=how)
    outcomes, seconds, misses = [], [], Misses()
    with refused(ConfigError):
        for _, (outcome, took) in each_of(one, tasks(paths, series, misses), jobs):
            outcomes.append(outcome)
            seconds.append(took)
            tell_lacking(outcome.path, outcome.missing_files, outcome.problem, misses)
    gone = _gone(paths, series, how["fail_on"])
    return outcomes + gone, seconds + [0.0] * len(gone), misses


def _timed(task: Task, how: dict[str, Any]) -> tuple[CheckOutcome, float]:
    """The check of a capture, and how many seconds it took; `how`: the arguments of `run.check`."""
    from ds47.regression.run import check

    begin = time.perf_counter()
    return check(task, **how), time.perf_counter() - begin


def _gone(paths: Sequence[str], series: bool, fail_on: str | None) -> list[CheckOutcome]:
    """The stored results in the folders that have lost their capture, each once."""
    from ds47.regression.config import ConfigError
    from ds47.regression.run import lonely

    folders = (path for path in paths if path != STDIN and Path(path).is_dir())
    with refused(ConfigError):
        found = [
            each.outcome(fail_on) for folder in folders for each in lonely(folder, series=series)
        ]
    return list({os.path.normpath(outcome.path): outcome for outcome in found}.values())


def _print_text(
    outcomes: Sequence[CheckOutcome], summary: bool, typed: str, most: int | None, lang: str
) -> None:
    from ds47.report.bilingual import say
    from ds47.report.formatting import escape
    from ds47.report.wrap import padded, wrap

    width = columns_of()

    def line(key: str, text: str) -> None:
        front = padded(say(key).text(lang) if key else "", _MARGIN) + " "
        tell([front + text] if width is None else wrap(front + text, width, _MARGIN + 3))

    for outcome in outcomes:
        if outcome.error is not None:
            line("check_failed", escape(about(outcome.path, outcome.error)))
            continue
        if not outcome.changes:
            continue
        line("check_changed" if outcome.failures else "check_noted", escape(outcome.path))
        for text in _changes(outcome, most, lang):
            line("", text)
    if summary:
        tell(_summary(outcomes).lines(lang, width))
    tell([_last_line(outcomes, typed).text(lang)])


def _print_markdown(
    outcomes: Sequence[CheckOutcome], typed: str, most: int | None, lang: str
) -> None:
    """For the summary page of a job: what is not as stored, capture by capture."""
    from ds47.report.bilingual import say
    from ds47.report.markdown import MARKS, code, plain, row

    failed = any(outcome.failed for outcome in outcomes)
    last = plain(_last_line(outcomes, typed).text(lang))
    lines = [f"## {MARKS['bad' if failed else 'good']} {last}"]
    told = [each for each in outcomes if each.error is not None or each.changes]
    if told:
        heads = [plain(say(key).text(lang)) for key in ("md_capture", "check_changes")]
        lines += ["", row(heads), row(["---"] * 2)]
    for each in told:
        known = each.error is None
        texts = (
            [text.strip() for text in _changes(each, most, lang)] if known else [each.error or ""]
        )
        mark = MARKS["bad" if each.failed else "none"]
        lines.append(row([f"{mark} {code(each.path)}", "<br>".join(map(plain, texts))]))
    stdout().write("\n".join(lines) + "\n")


def _changes(outcome: CheckOutcome, most: int | None, lang: str) -> Iterator[str]:
    """The changes of a capture. Those of the version alone are summed up; where all are wanted, they follow."""
    from ds47.report.bilingual import say
    from ds47.report.formatting import escape

    others = [change for change in outcome.changes if not change.version]
    yield from (escape(change.text) for change in others[:most])
    if most is not None and len(others) > most:
        yield say("changes_more", number=str(len(others) - most)).text(lang)
    assert outcome.origin is not None
    yield from (line.text(lang) for line in outcome.origin.lines(outcome.changes))
    if most is None:
        yield from (f"  {escape(change.text)}" for change in outcome.changes if change.version)


def _typed(paths: Sequence[str], series: bool) -> str:
    """What is typed behind `ds47 accept` for the same captures."""
    from ds47.spec.shell import shell_word

    words = [shell_word(path) for path in paths] if len(paths) <= _REPEATED else ["PATH..."]
    return " ".join((*(["--series"] if series else []), *words))


def _last_line(outcomes: Sequence[CheckOutcome], typed: str) -> Both:
    from ds47.report.bilingual import say

    total, failed = len(outcomes), sum(outcome.failed for outcome in outcomes)
    text = say("check_sum", n=total, number=str(total), same=str(total - failed), other=str(failed))
    changes = [change for outcome in outcomes for change in outcome.changes]
    if any(not change.version for change in changes):
        text = text.joined(say("check_accept", paths=typed), "", "")
    if any(change.version for change in changes):
        text = text.joined(say("check_accept_version", paths=typed), "", "")
    return text


def _summary(outcomes: Sequence[CheckOutcome]) -> Any:
    from ds47.regression.summary import Summary

    summary = Summary()
    for outcome in outcomes:
        summary.add(outcome)
    return summary


def _print_json(outcomes: Sequence[CheckOutcome], summary: bool) -> None:
    from ds47.report.json import laid_out

    document: dict[str, Any] = {
        "schema": "ds47.check/1",
        "captures": [
            {
                "path": outcome.path,
                "label": outcome.label,
                "failed": outcome.failed,
                "error": outcome.error,
                "stored_by": outcome.origin.version if outcome.origin else None,
                "changes": [_plain(outcome, number) for number in range(len(outcome.changes))],
            }
            for outcome in outcomes
        ],
    }
    if summary:
        document["summary"] = _summary(outcomes).document()
    stdout().write(laid_out(document))


def _plain(outcome: CheckOutcome, number: int) -> dict[str, Any]:
    from ds47.regression.run import fails

    change = outcome.changes[number]
    return {
        "kind": change.kind,
        "text": change.text,
        "fails": fails(change, outcome.fail_on),
        "by_version": change.version,
        "transaction": None if change.now is None else change.now + 1,
        "path": list(change.path),
        "was": change.was,
        "is": change.is_now,
        "pnu": change.pnu,
        "subindex": change.subindex,
        "device": change.device,
        "rule": change.rule,
    }


def _write_junit(outcomes: Sequence[CheckOutcome], seconds: Sequence[float], name: str) -> None:
    from ds47.report.junit import Case, write

    cases = [
        Case(
            outcome.path,
            f"ds47.{outcome.label}" if outcome.label else "ds47",
            duration,
            tuple(change.text for change in outcome.failures),
            outcome.error,
        )
        for outcome, duration in zip(outcomes, seconds, strict=True)
    ]
    with output(name) as stream:
        write(cases, stream)


def _write_sarif(outcomes: Sequence[CheckOutcome], name: str) -> None:
    from ds47.regression.run import fails
    from ds47.report.sarif import SarifResult, write

    results = []
    for outcome in outcomes:
        if outcome.error is not None:
            results.append(SarifResult("check", "error", outcome.error, outcome.path))
        for change in outcome.changes:
            finding = change.is_now if change.kind == "finding_new" else None
            severity = "error" if fails(change, outcome.fail_on) else "note"
            results.append(
                SarifResult(
                    change.rule if finding and change.rule else change.kind,
                    severity,
                    change.text,
                    outcome.path,
                    finding["frame"] if finding else None,
                    None if change.now is None else change.now + 1,
                )
            )
    with output(name) as stream:
        write(results, stream)
