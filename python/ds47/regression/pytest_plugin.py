"""pytest plugin: captures with their stored results as tests, and the analysis of a capture as a fixture.

`pytest --ds47 captures/` makes a test of each capture (with `--ds47-series` of each series of files: the
file of the test is its first one) and of each stored result without a capture. What there is to check
is what `ds47 check` looks at, so a capture without a stored result fails. The fixture `ds47_capture`
gives the analysis to a project's own tests. Loaded by pytest wherever ds47 is installed, so nothing of
ds47 is imported before it is used.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ds47.batch.tasks import Task
    from ds47.model import CaptureResult, Finding, Parameter, Transaction
    from ds47.regression.run import CheckOutcome, Lonely

_Folders = pytest.StashKey[list[Path]]()
"""The folders that were searched."""
_SHOWN = 50
"""Changes of one capture that a failure lists."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds --ds47, --ds47-series and --ds47-fail-on."""
    group = parser.getgroup("ds47", "DS47 captures")
    group.addoption(
        "--ds47",
        action="store_true",
        help="collect captures as tests: each is to be as stored (NAME.ds47.json)",
    )
    group.addoption(
        "--ds47-series",
        action="store_true",
        help="take the files of a ring buffer (dumpcap -b, tcpdump -C) as one capture",
    )
    group.addoption(
        "--ds47-fail-on",
        choices=("never", "note", "warning", "error"),
        help="from which severity on a new finding fails (default: ds47.toml, or error)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """With --ds47 a folder that is named and has neither captures nor tests is wrong use."""
    if not config.getoption("--ds47") or hasattr(config, "workerinput"):
        return
    from ds47.batch.tasks import in_folders
    from ds47.regression.baseline import SUFFIX

    accept = in_folders(config.getoption("--ds47-series"))
    for name in config.args:
        folder = Path(config.invocation_params.dir, name)
        files = (each for _, _, names in os.walk(folder) for each in names)
        if folder.is_dir() and not any(
            accept(each) or each.endswith((SUFFIX, ".py")) for each in files
        ):
            raise pytest.UsageError(f"--ds47: {name}: no capture in this folder")


@pytest.hookimpl(tryfirst=True)
def pytest_collect_directory(path: Path, parent: pytest.Collector) -> None:
    """Remembers the folders of this run; collecting them is left to others."""
    session = parent.session
    if parent.config.getoption("--ds47") and any(map(session.isinitpath, (path, *path.parents))):
        session.stash.setdefault(_Folders, []).append(path)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, items: list[pytest.Item]) -> None:
    """Adds what pytest does not take for a file: a capture that is a link to nothing."""
    series = session.config.getoption("--ds47-series")
    folders: list[Path] = session.stash.setdefault(_Folders, [])
    for folder in dict.fromkeys(folders):
        for path, subject in _content(folder, series)[0].items():
            if not path.exists():
                items.extend(_collected(session, path, subject).collect())


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """With --ds47 all that `ds47 check` of the folder looks at is collected: it fails where that fails."""
    if not parent.config.getoption("--ds47"):
        return None
    subject = _subject(file_path, parent.session, parent.config.getoption("--ds47-series"))
    if subject is None:
        return None
    return _collected(parent, file_path, subject)


def _collected(parent: pytest.Collector, path: Path, subject: Task | Lonely) -> CaptureFile:
    collected: CaptureFile = CaptureFile.from_parent(parent, path=path)
    collected.subject = subject
    return collected


def _subject(path: Path, session: pytest.Session, series: bool) -> Task | Lonely | None:
    """What there is to check about a file; of a series that is about its first one, or the one that is named."""
    subjects, tasks = _content(path.parent, series)
    if path in subjects:
        return subjects[path]
    from ds47.batch.tasks import plan
    from ds47.capture.names import is_capture, is_export

    if not session.isinitpath(path):
        return None
    if path in tasks:
        task = tasks[path]
        named = [each for each in task.sources if session.isinitpath(each.location)]
        return task if len(named) == 1 else None
    if is_capture(path.name) or is_export(path.name):
        return plan([str(path)], series=False)[0]
    return None


@cache
def _content(folder: Path, series: bool) -> tuple[dict[Path, Task | Lonely], dict[Path, Task]]:
    """What there is to check in a folder: by the file that is collected for it, by any file of a task."""
    from ds47.regression.run import content

    names = [each.name for each in folder.iterdir() if not each.is_dir()]
    found = content(folder, names, series=series)
    subjects: dict[Path, Task | Lonely] = {Path(task.path): task for task in found.tasks}
    subjects |= {each.path: each for each in found.lonely}
    return subjects, {Path(part.location): task for task in found.tasks for part in task.sources}


class CaptureFile(pytest.File):
    """A capture, the first file of a series, or a stored result without a capture; holds one test."""

    subject: Task | Lonely

    def collect(self) -> Iterator[pytest.Item]:
        """The comparison with the stored result."""
        item: CaptureItem = CaptureItem.from_parent(self, name="as-stored")
        item.subject = self.subject
        yield item


class CaptureItem(pytest.Item):
    """The test that a capture gives the result that is stored."""

    subject: Task | Lonely

    def runtest(self) -> None:
        """Analyses and compares.

        Raises:
            Changed: something is not as it was stored, or cannot be read or compared.
        """
        from ds47.regression.config import ConfigError
        from ds47.regression.run import Lonely, check

        fail_on = self.config.getoption("--ds47-fail-on")
        try:
            if isinstance(self.subject, Lonely):
                outcome = self.subject.outcome(fail_on)
            else:
                outcome = check(self.subject, fail_on=fail_on)
        except ConfigError as problem:
            raise Changed(str(problem)) from problem
        if outcome.failed or outcome.unreadable:
            raise Changed(_failure(outcome))
        versions = "\n".join(_of_versions(outcome))
        if versions:
            self.add_report_section("call", "ds47", versions)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What changed, as people read it; everything else as pytest shows it."""
        if isinstance(excinfo.value, Changed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the test is and how it is called."""
        return self.path, None, f"{self.path.name} as stored"


class Changed(Exception):
    """A capture is not as it was stored; the text says what is the matter, and what to do."""


def _failure(outcome: CheckOutcome) -> str:
    """What `ds47 check` says of a capture that failed, and how to take it over."""
    if outcome.error is not None:
        return _line(outcome.path, outcome.error)
    lines = [f"{outcome.path} is not as it was stored:"]
    if outcome.unreadable:
        lines.append("  the capture could be read only in part")
    failures = outcome.failures
    lines += [f"  {change.text}" for change in failures[:_SHOWN]]
    if len(failures) > _SHOWN:
        lines.append(f"  ... and {len(failures) - _SHOWN} more")
    lines += [f"  {line}" for line in _of_versions(outcome)]
    if failures:
        from ds47.spec.shell import shell_word

        option = "--series " if outcome.series else ""
        lines.append(f"to take this over: ds47 accept {option}{shell_word(str(outcome.path))}")
    return "\n".join(lines)


def _of_versions(outcome: CheckOutcome) -> list[str]:
    """What there is to say of the version that stored the result."""
    return [line.en for line in outcome.origin.lines(outcome.changes)] if outcome.origin else []


def _line(path: str, problem: str) -> str:
    from ds47.capture.names import about

    return about(path, problem)


class CaptureUnderTest:
    """The analysis of a capture as tests like to ask it. `result` holds all of it."""

    def __init__(self, result: CaptureResult) -> None:
        self.result = result

    @property
    def transactions(self) -> list[Transaction]:
        """All transactions in the order of their ids."""
        return self.result.transactions

    def findings(self, severity: str | None = None, rule: str | None = None) -> list[Finding]:
        """Findings of at least a severity ("note", "warning", "error"), of a rule ("DS410", "DS4", "drive-error").

        Raises:
            ValueError: there is no such severity.
        """
        from ds47.model import SEVERITIES
        from ds47.spec import rule_prefix

        prefix = rule and (rule_prefix(rule) or rule)
        least = 0 if severity is None else SEVERITIES.index(severity)
        return [
            finding
            for finding in self.result.findings
            if SEVERITIES.index(finding.severity) >= least
            and (prefix is None or finding.rule.startswith(prefix))
        ]

    def parameters(self, pnu: int, subindex: int | None = None) -> list[Parameter]:
        """Every parameter with this number, in the order of the transactions."""
        return [
            parameter
            for transaction in self.result.transactions
            for parameter in transaction.parameters
            if parameter.pnu == pnu and subindex in (None, parameter.subindex)
        ]

    def last_value(self, pnu: int, subindex: int = 0) -> Any:
        """The value that was last read or successfully written; None where there is none."""
        value = None
        for transaction in self.result.transactions:
            if transaction.state not in ("ok", "partial"):
                continue
            for parameter in transaction.parameters:
                place = subindex - (parameter.subindex or 0)
                if (
                    parameter.pnu == pnu
                    and parameter.error is None
                    and 0 <= place < len(parameter.values)
                ):
                    value = parameter.values[place]
        return value

    def __repr__(self) -> str:
        counts = self.result.summary.get("transactions", 0), len(self.result.findings)
        return f"<{self.result.path}: {counts[0]} transactions, {counts[1]} findings>"


@pytest.fixture
def ds47_capture(request: pytest.FixtureRequest) -> Callable[..., CaptureUnderTest]:
    """A function from the path of a capture to its analysis.

    A relative path counts from the folder of the test file. Keyword arguments are those of
    `ds47.analysis.AnalysisOptions`. A capture that cannot be read as a whole fails the test.
    """

    def analysis(path: str | Path, **options: Any) -> CaptureUnderTest:
        from ds47.analysis import AnalysisOptions, analyze
        from ds47.capture import CaptureError
        from ds47.report.shown import switch_on

        switch_on()  # what a failed assertion prints
        settings, result = AnalysisOptions(**options), None
        try:
            result = analyze(request.path.parent / path, settings)
            lacking = result.lacking
        except CaptureError as problem:
            lacking = str(problem)
        if result is None or lacking:  # out here: pytest would show the causes of the failure
            pytest.fail(_line(str(path), str(lacking)), pytrace=False)
        return CaptureUnderTest(result)

    return analysis
