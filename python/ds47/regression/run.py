"""One capture against its stored result: analyse, load, compare, and whether that is a failure.

What `ds47 check`, `ds47 accept` and the pytest plugin have in common.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import CaptureError
from ds47.model import SEVERITIES, CaptureResult
from ds47.regression import baseline, config
from ds47.regression.compare import Change, Comparison, Json


@dataclass(slots=True)
class Outcome:
    """What came of one capture.

    Attributes:
        path: the capture as it was named.
        now: its present capture object, None where nothing of it can be read.
        stored: the stored one, None where there is none.
        changes: what is not as it was stored.
        pairs: which transaction of the stored result is which of the present one.
        error: why there is nothing to compare, or why the capture was read only in part.
        unreadable: whether `error` is about the capture itself.
        label: the label of the capture.
    """

    path: str
    now: Json | None = None
    stored: Json | None = None
    changes: list[Change] = field(default_factory=list)
    pairs: list[tuple[int | None, int | None]] = field(default_factory=list)
    error: str | None = None
    unreadable: bool = False
    label: str = ""
    fail_on: str = "error"

    @property
    def failures(self) -> list[Change]:
        """The changes that make a check fail: all but new or gone findings below `fail_on`."""
        return [change for change in self.changes if fails(change, self.fail_on)]

    @property
    def failed(self) -> bool:
        """Whether a check fails for this capture."""
        return self.error is not None or bool(self.failures)


def fails(change: Change, fail_on: str) -> bool:
    """Whether a change makes a check fail.

    A finding that came counts from the severity `fail_on` on, one that went never does; everything
    else always counts.
    """
    if change.kind == "finding_gone":
        return False
    if change.kind != "finding_new":
        return True
    if fail_on == "never":
        return False
    severity = change.is_now["severity"]
    return SEVERITIES.index(severity) >= SEVERITIES.index(fail_on)


def result_of(path: str, options: AnalysisOptions | None = None) -> CaptureResult:
    """Analyses a capture with its digest.

    Raises:
        ds47.capture.CaptureError: nothing of it can be read.
    """
    return analyze(path, replace(options or AnalysisOptions(), digest=True))


def check(path: str, options: AnalysisOptions | None = None, fail_on: str | None = None) -> Outcome:
    """Compares a capture with its stored result. Files that cannot be used are in `error`.

    Args:
        path: the capture.
        options: how to analyse it; the same as when the result was stored. What changed is said in
            their language.
        fail_on: from which severity on a new finding is a failure; None for what `ds47.toml` says.

    Raises:
        ds47.regression.config.ConfigError: the `ds47.toml` of the capture cannot be used.
    """
    capture = Path(path)
    settings = config.find(capture)
    outcome = Outcome(path, label=settings.label(capture), fail_on=fail_on or settings.fail_on)
    try:
        result = result_of(path, options)
    except CaptureError as problem:
        outcome.error, outcome.unreadable = str(problem), True
        return outcome
    outcome.now = baseline.content(result)
    if not result.complete:
        outcome.unreadable = True
    try:
        outcome.stored = baseline.load(baseline.path_of(capture))
    except baseline.BaselineError as problem:
        outcome.error = f"{problem} {path}" if "make one" in str(problem) else str(problem)
        return outcome
    lang = "en" if options is None else options.lang
    comparison = Comparison(outcome.stored, outcome.now, settings, capture, lang)
    outcome.changes, outcome.pairs = list(comparison.changes()), comparison.pairs
    return outcome
