"""One capture against its stored result: analyse, load, compare, and decide whether it failed.

Shared by `ds47 check`, `ds47 accept` and the pytest plugin. Also lists what to check in a folder: its captures,
and the stored results that belong to none of them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from ds47.analysis import AnalysisOptions
from ds47.batch.endings import fence
from ds47.batch.tasks import Task, in_folders, plan, read
from ds47.capture import CaptureError
from ds47.capture.rings import common_name
from ds47.capture.special import special
from ds47.model import SEVERITIES, CaptureResult
from ds47.regression import baseline, config
from ds47.regression.compare import Change, Comparison, Json
from ds47.regression.versions import Origin
from ds47.spec.shell import shell_word

if TYPE_CHECKING:
    from ds47.parameters.expected import Expectation


@dataclass(slots=True)
class CheckOutcome:
    """The outcome of checking one capture.

    Attributes:
        path: the capture as given, or the first file of a series; the stored result if its capture is gone.
        result_path: the path of its stored result.
        now: its present capture object, None if it cannot be read at all.
        stored: the stored one, None if there is none.
        origin: the version that stored it.
        changes: what differs from the stored result.
        pairs: the matching transactions, stored and present.
        error: why there is nothing to compare.
        unreadable: whether the capture could not be read, or only in part.
        ours: whether it could not be read because ds47 itself broke.
        problem: why it was read only in part.
        label: the label of the capture.
    """

    path: str
    result_path: Path
    now: Json | None = None
    stored: Json | None = None
    origin: Origin | None = None
    changes: list[Change] = field(default_factory=list)
    pairs: list[tuple[int | None, int | None]] = field(default_factory=list)
    error: str | None = None
    unreadable: bool = False
    ours: bool = False
    problem: str | None = None
    label: str = ""
    fail_on: str = "error"

    @property
    def series(self) -> bool:
        """Whether it is a series of files."""
        return "files" in (self.now or {})

    @property
    def missing_files(self) -> list[int]:
        """How many files of a series are missing before each present one."""
        return [file["missing_before"] for file in (self.now or {}).get("files", ())]

    @property
    def failures(self) -> list[Change]:
        """The changes that make a check fail."""
        return [change for change in self.changes if fails(change, self.fail_on)]

    @property
    def failed(self) -> bool:
        """Whether the check of this capture fails."""
        return self.error is not None or bool(self.failures)


def fails(change: Change, fail_on: str) -> bool:
    """Whether a change makes a check fail.

    A new finding counts from the severity `fail_on` on. A finding that is gone never counts, nor does a change
    caused by the version of ds47 alone. Everything else always counts.
    """
    if change.kind == "finding_gone" or change.version:
        return False
    if change.kind != "finding_new":
        return True
    if fail_on == "never":
        return False
    severity = change.is_now["severity"]
    return SEVERITIES.index(severity) >= SEVERITIES.index(fail_on)


def result_path(task: Task) -> Path:
    """The path of the stored result of a capture or series."""
    return baseline.path_of(Path(task.path), task.own_name)


def result_of(
    task: Task,
    options: AnalysisOptions | None = None,
    expected: tuple[Expectation, ...] = (),
) -> CaptureResult:
    """Analyses a capture or series, with its digest. Raises CaptureError where it cannot be read at all."""
    return readable(task, (options or AnalysisOptions())._replace(digest=True), expected)


def readable(
    task: Task, options: AnalysisOptions, expected: tuple[Expectation, ...] = ()
) -> CaptureResult:
    """Analyses a capture, or a series with at least one readable file.

    Raises:
        ds47.capture.CaptureError: it cannot be read at all.
    """
    result = read(task, options, expected=expected)
    if result.files and not any(file.readable for file in result.files):
        raise CaptureError(result.problem or "nothing can be read")
    return result


@dataclass(frozen=True, slots=True)
class Lonely:
    """A stored result that belongs to no checked capture: a test that lost its recording would pass forever."""

    path: Path
    error: str

    def outcome(self, fail_on: str | None = None) -> CheckOutcome:
        """The outcome of its check, a failure. `fail_on` and ConfigError as in `check`."""
        settings = config.find(self.path)
        label = settings.label(self.path)
        fail_on = fail_on or settings.fail_on
        return CheckOutcome(
            str(self.path), self.path, error=self.error, label=label, fail_on=fail_on
        )


@dataclass(frozen=True, slots=True)
class Content:
    """Everything to check in one folder, by `ds47 check` or pytest."""

    tasks: list[Task]
    lonely: list[Lonely]


def content(folder: Path, names: Sequence[str], *, series: bool) -> Content:
    """What to check in a folder with files of these names, without its subfolders."""
    captures = sorted(
        str(folder / name)
        for name in names
        if in_folders(series)(name) and special(folder / name) is None
    )
    gone = [Lonely(folder / name, error) for name, error in baseline.orphans(names, series=series)]
    return Content(plan(captures, series), gone)


def lonely(folder: str, *, series: bool) -> Iterator[Lonely]:
    """The stored results in a folder and its subfolders that belong to no checked capture."""
    for parent, below, names in os.walk(folder):
        below.sort()
        for name, error in baseline.orphans(names, series=series):
            yield Lonely(Path(parent, name), error)


def check(
    task: Task,
    options: AnalysisOptions | None = None,
    fail_on: str | None = None,
    lang: str = "en",
    expected: tuple[Expectation, ...] = (),
) -> CheckOutcome:
    """Compares a capture with its stored result. Problems with either file go to `error`.

    Args:
        task: the capture or series.
        options: how to analyse it; the same as when the result was stored.
        fail_on: the least severity of a new finding that fails; None takes it from `ds47.toml`.
        lang: language of the changes, "en" or "zh".
        expected: what parameters should be; none takes it from `ds47.toml`.

    Raises:
        ds47.regression.config.ConfigError: the `ds47.toml` of the capture cannot be used.
    """
    capture = Path(task.path)
    settings = config.find(capture)
    outcome = CheckOutcome(
        task.path,
        result_path(task),
        label=settings.label(capture),
        fail_on=fail_on or settings.fail_on,
    )
    try:
        with fence():
            _compare(task, options, outcome, settings, lang, expected)
    except CaptureError as problem:
        outcome.error, outcome.unreadable, outcome.ours = str(problem), True, problem.ours
    return outcome


def _compare(
    task: Task,
    options: AnalysisOptions | None,
    outcome: CheckOutcome,
    settings: config.Config,
    lang: str,
    expected: tuple[Expectation, ...],
) -> None:
    """Analyses, loads and compares."""
    result = result_of(task, options, expected)
    outcome.now = baseline.content(result)
    outcome.unreadable, outcome.problem = not result.complete, result.lacking
    try:
        outcome.stored, version = _stored(task, outcome.result_path)
    except baseline.BaselineError as problem:
        outcome.error = str(problem)
        return
    comparison = Comparison(outcome.stored, outcome.now, settings, Path(task.path), lang)
    outcome.origin = Origin(version, same_file=comparison.same_file)
    outcome.changes = outcome.origin.explained(
        list(comparison.changes()), outcome.stored, outcome.now
    )
    outcome.pairs = comparison.pairs


def _stored(task: Task, path: Path) -> baseline.Stored:
    """The stored result of a capture or series.

    Raises:
        ds47.regression.baseline.BaselineError: there is none, or it belongs to something else.
    """
    try:
        stored = baseline.load(path)
    except baseline.NoBaselineError as problem:
        _refuse_a_part(task, baseline.path_of(Path(task.path), common_name(Path(task.path).name)))
        option = "--series " if task.series else ""
        word = shell_word(task.path)
        raise baseline.BaselineError(f"{problem} {option}{word}") from problem
    _refuse_a_part(task, path, stored.content)
    return stored


def _refuse_a_part(task: Task, path: Path, stored: Json | None = None) -> None:
    """Raises BaselineError if a single file is checked against the result of its whole series."""
    if task.series:
        return
    if stored is None:
        try:
            stored = baseline.load(path).content
        except baseline.BaselineError:
            return
    names = [file["path"] for file in stored.get("files", ())]
    if len(names) > 1 and Path(task.path).name in names:
        raise baseline.BaselineError(
            f"{path}: this is the result of {len(names)} files as one capture; "
            "use --series (pytest: --ds47-series)"
        )
