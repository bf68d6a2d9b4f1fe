"""pytest plugin: captures with a stored result as tests, and the analysis of a capture as a fixture.

`pytest --ds47 captures/` makes a test of each capture beside which `NAME.ds47.json` stands, with
`--ds47-series` of each series of files (the file of the test is its first one). The fixture
`ds47_capture` gives the analysis to a project's own tests. Loaded by pytest wherever ds47 is
installed, so nothing of ds47 is imported before it is used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ds47.batch.tasks import Task
    from ds47.model import CaptureResult, Finding, Parameter, Transaction
    from ds47.regression.run import Outcome

_SHOWN = 50
"""Changes of one capture that a failure lists."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds --ds47, --ds47-series and --ds47-fail-on."""
    group = parser.getgroup("ds47", "DS47 captures")
    group.addoption(
        "--ds47",
        action="store_true",
        help="collect captures that have a stored result (NAME.ds47.json) as tests",
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


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """A capture is collected with --ds47, and only where a result of it is stored."""
    if not parent.config.getoption("--ds47"):
        return None
    from ds47.capture.names import is_capture, is_export
    from ds47.regression.run import place_of

    task = None
    if parent.config.getoption("--ds47-series"):
        task = _in_its_folder(file_path)
    elif is_capture(file_path.name) or is_export(file_path.name):
        task = _alone(file_path)
    if task is None or not place_of(task).exists():
        return None
    collected: CaptureFile = CaptureFile.from_parent(parent, path=file_path)
    collected.task = task
    return collected


def _alone(path: Path) -> Task:
    from ds47.batch.tasks import plan

    return plan([str(path)], series=False)[0]


def _in_its_folder(path: Path) -> Task | None:
    """The capture or series that begins with a file."""
    return _tasks_in(path.parent).get(str(path))


@cache
def _tasks_in(folder: Path) -> dict[str, Task]:
    from ds47.batch.tasks import names_in, plan

    paths = [str(folder / name) for name in names_in(folder)]
    return {task.path: task for task in plan(paths, series=True)}


class CaptureFile(pytest.File):
    """A capture, or the first file of a series; holds one test."""

    task: Task

    def collect(self) -> Iterator[pytest.Item]:
        """The comparison with the stored result."""
        item: CaptureItem = CaptureItem.from_parent(self, name="as-stored")
        item.task = self.task
        yield item


class CaptureItem(pytest.Item):
    """The test that a capture gives the result that is stored."""

    task: Task

    def runtest(self) -> None:
        """Analyses and compares.

        Raises:
            Changed: something is not as it was stored, or cannot be read.
        """
        from ds47.regression.run import check

        outcome = check(self.task, fail_on=self.config.getoption("--ds47-fail-on"))
        if outcome.failed or outcome.unreadable:
            raise Changed(outcome)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What changed, as people read it; everything else as pytest shows it."""
        if isinstance(excinfo.value, Changed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the test is and how it is called."""
        return self.path, None, f"{self.path.name} as stored"


class Changed(Exception):
    """A capture is not as it was stored; the text says what changed and how to take it over."""

    def __init__(self, outcome: Outcome) -> None:
        lines = [f"{outcome.path} is not as it was stored:"]
        if outcome.error is not None:
            lines.append(f"  {outcome.error}")
        elif outcome.unreadable:
            lines.append("  the capture could be read only in part")
        failures = outcome.failures
        lines += [f"  {change.text}" for change in failures[:_SHOWN]]
        if len(failures) > _SHOWN:
            lines.append(f"  ... and {len(failures) - _SHOWN} more")
        if failures:
            option = "--series " if outcome.series else ""
            lines.append(f"to take this over: ds47 accept {option}{outcome.path}")
        super().__init__("\n".join(lines))


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

        result = analyze(request.path.parent / path, AnalysisOptions(**options))
        if result.lacking:
            pytest.fail(f"{path}: {result.lacking}", pytrace=False)
        return CaptureUnderTest(result)

    return analysis
