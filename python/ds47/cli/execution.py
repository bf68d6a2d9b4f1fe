"""How the captures of a report are analysed: here, in processes, on a cluster; stored or not.

Lives here: `Execution`, what the options of `ds47 report` come to. What runs is `ds47.batch` and
`ds47.cli.run`.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from ds47.capture.names import STDIN
from ds47.cli.common import cannot_write, counted, refused, warn
from ds47.cli.run import Run
from ds47.model import CaptureResult
from ds47.report import Writer

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions, OnTransaction
    from ds47.batch.products import Product
    from ds47.batch.results import Results
    from ds47.batch.runner import PathOf
    from ds47.batch.tasks import Task
    from ds47.cli.run import Analyzer, Runner
    from ds47.parameters.expected import Expectation


_NOT_ALL = 3
"""The exit status where not everything could be read."""


class Execution(NamedTuple):
    """How the captures are analysed, and where: what the options say."""

    analysis: AnalysisOptions
    lang: str
    engine: str
    tshark: str | None
    jobs: int | None
    folder: str | None
    resume: bool
    scheduler: str | None
    expected: tuple[Expectation, ...] = ()

    def check(self, paths: Sequence[str], series: bool) -> None:
        """Raises click.UsageError where options do not go together."""
        if self.resume and not self.folder:
            raise click.UsageError("--resume goes with --results FOLDER")
        if self.engine != "native" and (series or self.folder or self.scheduler):
            raise click.UsageError("--series, --results and --scheduler go with --engine native")
        if STDIN in paths and (self.folder or self.scheduler):
            raise click.UsageError("stdin does not go with --results and --scheduler")
        if self.scheduler and self.jobs is not None:
            raise click.UsageError("--jobs is for this machine: leave it out with --scheduler")

    def results(
        self, tasks: Sequence[Task], roots: Sequence[str]
    ) -> tuple[Results | None, Sequence[Task]]:
        """The folder of results, and what is not there yet."""
        if self.folder is None:
            return None, tasks
        from ds47.batch.remote_results import results_at
        from ds47.batch.results import NotOursError, SameNameError, StoredResult
        from ds47.capture import CaptureError

        try:
            make = StoredResult(self.analysis, self.lang, self.expected)
            results = results_at(self.folder, make)
            results.name(tasks, roots)
            results.spare(tasks)
            results.begin()
            if self.resume:
                results.fetch(tasks)
        except (CaptureError, NotOursError) as problem:
            raise click.ClickException(str(problem)) from problem
        except SameNameError as problem:
            raise click.ClickException(f"{problem}; report them one at a time") from problem
        except OSError as problem:
            raise cannot_write(self.folder, problem) from problem
        return results, _todo(results, tasks) if self.resume else tasks

    def run(
        self,
        run: Run,
        tasks: Sequence[Task],
        todo: Sequence[Task],
        results: Results | None,
        writer: Writer,
    ) -> None:
        """Analyses what is to be done and reports on all."""
        if results is None and self.scheduler is None and self._jobs(tasks) == 1:
            run.here(tasks, self._analyzer())
            return
        from ds47.batch.endings import Failed, Lost

        try:
            if results is not None:
                self._stored(run, tasks, todo, results, writer)
            else:
                self._spooled(run, tasks)
        except Failed as problem:
            raise click.ClickException(str(problem)) from problem
        except Lost as problem:  # was reported, with the progress of the run
            raise click.exceptions.Exit(_NOT_ALL) from problem

    def _spooled(self, run: Run, tasks: Sequence[Task]) -> None:
        from tempfile import TemporaryDirectory  # only here: it takes long to import

        from ds47.batch.products import Spool

        numbers = {task.path: str(number) for number, task in enumerate(tasks)}
        make = Spool(self.analysis, run.streams, self.expected)
        with TemporaryDirectory(prefix="ds47-") as folder:
            runner = self._runner(tasks, make, lambda task: Path(folder, numbers[task.path]))
            run.spooled(runner, tasks)

    def _stored(
        self,
        run: Run,
        tasks: Sequence[Task],
        todo: Sequence[Task],
        results: Results,
        writer: Writer,
    ) -> None:
        from ds47.report.overview import Writer as Overview

        rows = writer.rows if isinstance(writer, Overview) else None
        runner = self._runner(todo, results.make, results.path_of)
        results.end(run.stored(results, tasks, todo, runner, rows), os.getpid())

    def _jobs(self, tasks: Sequence[Task]) -> int:
        from ds47.batch.cores import cores, useful_jobs

        if self.engine != "native":
            return 1
        return useful_jobs(tasks) if self.jobs is None else self.jobs or cores()

    def _analyzer(self) -> Analyzer:
        """What analyses a capture with these options, in this process."""
        options, expected = self.analysis, self.expected
        if self.engine == "native":
            from ds47.batch.tasks import read

            return lambda task, finished: read(task, options, finished, expected)
        from ds47.batch.endings import fence
        from ds47.wireshark.engine import Engine
        from ds47.wireshark.tshark import NotReadyError

        with refused(NotReadyError):
            other = Engine(
                "both" if self.engine == "both" else "tshark", options, self.tshark, self.lang
            )

        def analyze(task: Task, finished: OnTransaction | None) -> CaptureResult:
            source = sys.stdin.buffer if task.path == STDIN else task.path
            with fence():
                if not expected:
                    return other.analyze(source, finished)
                from ds47.report.expected import judged

                return judged(other.analyze(source), expected, options, finished)

        return analyze

    def _runner(self, tasks: Sequence[Task], make: Product, path_of: PathOf) -> Runner:
        if self.scheduler is not None and tasks:
            from ds47.batch.cluster import Cluster

            return Cluster(tasks, make, path_of, self.scheduler)
        jobs = self._jobs(tasks)
        if jobs == 1 or not tasks:
            from ds47.batch.runner import here

            return here(tasks, make, path_of)
        from ds47.batch.local import Local

        return Local(tasks, make, path_of, jobs)


def _todo(results: Results, tasks: Sequence[Task]) -> list[Task]:
    """What is not done; says of what was done why it is done again."""
    from ds47.batch.results import DAMAGED

    reasons = {task.path: results.undone(task) for task in tasks}
    again = Counter(reason for reason in reasons.values() if reason not in (None, "no result"))
    for reason, number in sorted(again.items()):
        text = f"{counted(number, 'capture')} done again: {reason}"
        if reason == DAMAGED:
            first = next(task for task in tasks if reasons[task.path] == DAMAGED)
            text += f", {'the first is ' if number > 1 else ''}{results.shown(first)}"
        warn(text)
    return [task for task in tasks if reasons[task.path] is not None]
