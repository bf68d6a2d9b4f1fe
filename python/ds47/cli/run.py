"""How a run over captures goes: each analysed in its turn, told to the report, counted for the exit status.

Lives here: `Run`, with the three ways in which a result comes (analysed here and now, from a
process or worker, from a folder of results). Options and files are `ds47.cli.report`, how captures
are analysed elsewhere is `ds47.batch`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from io import BytesIO
from typing import TYPE_CHECKING

from ds47.batch.endings import Lost, fence
from ds47.batch.memory import collect
from ds47.capture import CaptureError
from ds47.capture.names import about
from ds47.cli.common import counted
from ds47.cli.series import missing_files
from ds47.model import CaptureResult, Finding, worst
from ds47.report import Writer, write_one

if TYPE_CHECKING:
    from ds47.analysis import OnTransaction
    from ds47.batch.results import Results
    from ds47.batch.runner import Outcome
    from ds47.batch.tasks import Task
    from ds47.cli.progress import Progress
    from ds47.cli.selecting import Choice
    from ds47.report.bilingual import Both
    from ds47.report.overview import CaptureRow
    from ds47.report.selection import Selection, There

    Analyzer = Callable[[Task, OnTransaction | None], CaptureResult]
    Runner = AbstractContextManager[Iterable[tuple[Task, Outcome]]]


class Run:
    """Goes from capture to capture, and remembers what the exit status needs."""

    def __init__(self, writer: Writer, progress: Progress, choice: Choice | None = None) -> None:
        self._writer = writer
        self._choice = choice
        self._there: There | None = None
        """What captures have in which nothing is wanted."""
        self._shown = 0
        self._progress = progress
        self._reported = 0
        self.failed = False
        self.ours = False
        """Whether ds47 itself broke on a capture."""
        self.worst = -1
        self.empty: list[str] = []
        """The captures without a transaction,"""
        self.blank: list[str] = []
        """and those without PROFINET, PROFIBUS and S7: in a run that may fail, no finding is no success there."""

    @property
    def streams(self) -> bool:
        """Whether transactions are told as they are finished; a part is chosen when all is known."""
        return self._writer.streams and self._choice is None

    @property
    def nothing(self) -> bool:
        """Whether a part is wanted that no capture has."""
        return self._choice is not None and not self._shown

    def instead(self, selection: Selection) -> Both:
        """What there is instead of what is wanted: `there are 192.168.0.5 (press-1)`, states or parameters."""
        from ds47.report.selection import There

        return (self._there or There()).words(selection)

    def missing(self, text: str) -> None:
        """Says what could not be read, or not as a whole."""
        self.failed = True
        self._progress.warn(f"error: {text}")

    def here(self, tasks: Sequence[Task], analyze: Analyzer) -> None:
        """Analyses one after the other, in this process."""
        with self._interruptible(len(tasks)):
            for task in tasks:
                self._tell(task, analyze)
                self._end(task)

    def spooled(self, runner: Runner, tasks: Sequence[Task]) -> None:
        """Takes what processes or workers have spooled."""
        with self._interruptible(len(tasks)), runner as outcomes:
            for task, outcome in outcomes:
                self._tell(task, partial(_taken, outcome))
                self._end(task)

    def _end(self, task: Task) -> None:
        self._reported += 1
        self._progress.done(task.size)

    def _tell(self, task: Task, analyze: Analyzer) -> None:
        """Analyses a capture and hands what it says to the writer."""
        writer = self._writer
        finished = partial(writer.transaction, task.path)
        collect()
        try:
            result = analyze(task, finished if self.streams else None)
        except CaptureError as problem:
            self._unreadable(task, problem)
            return
        result.path, self.worst = task.path, max(self.worst, result.worst)
        self._whole(task.path, result.complete, result.problem)
        self._gaps(result)
        if not result.summary["transactions"]:
            self.empty.append(task.path)
        if result.nothing:
            self.blank.append(task.path)
        try:
            with fence():
                self._show(result)
        except CaptureError as problem:
            self._unreadable(task, problem)

    def _show(self, result: CaptureResult) -> None:
        if self._choice is None:
            self._note(result.findings)
            self._writer.capture(result)
        else:
            self._part(result, self._choice)

    def _part(self, result: CaptureResult, choice: Choice) -> None:
        """A part of a capture; one of which nothing is wanted is left out."""
        from ds47.report.narrowing import is_empty, narrowed
        from ds47.report.selection import There

        selection = choice.of(result.start_ns, result.end_ns)
        part = narrowed(result, selection, choice.criteria)
        if is_empty(part, selection):
            self._there = self._there or There()
            self._there.add(result)
            return
        self._shown += 1
        self._note(part.findings)
        write_one(self._writer, part)

    def stored(
        self,
        results: Results,
        tasks: Sequence[Task],
        todo: Sequence[Task],
        runner: Runner,
        rows: list[CaptureRow] | None,
    ) -> list[CaptureRow]:
        """Stores a result of each task in `todo`, and reports over all.

        Args:
            results: where they are stored.
            tasks: all captures of the report.
            todo: those of them that are not done already.
            runner: analyses what is in `todo`, in that order.
            rows: of a writer that wants nothing but rows; else None, and it gets all results.
        """
        waiting = {task.path for task in todo}
        kept: list[CaptureRow] = [] if rows is None else rows
        try:
            with runner as outcomes:
                coming = iter(outcomes)
                for task in tasks:
                    collect()
                    if task.path in waiting:
                        _, outcome = next(coming)
                        if not isinstance(outcome, CaptureError):
                            results.keep(task)
                        self._progress.done(task.size)
                    else:
                        outcome = results.path_of(task)
                    kept.append(self._store(results, task, outcome, whole=rows is None))
        except (KeyboardInterrupt, Lost) as problem:
            done = results.done(tasks)
            self._progress.warn(
                f"{_ended(problem)}: {done} of {counted(len(tasks), 'result')} are in "
                f"{results.shown()}; to go on: the same command with --resume"
            )
            raise
        return kept

    def _store(self, results: Results, task: Task, outcome: Outcome, *, whole: bool) -> CaptureRow:
        from ds47.report.overview import CaptureRow

        try:
            if isinstance(outcome, CaptureError):
                raise outcome
            with fence():
                return self._take(results, task, whole=whole)
        except CaptureError as problem:
            results.forget(task)
            return CaptureRow.unreadable(task.path, self._unreadable(task, problem, told=whole))

    def _take(self, results: Results, task: Task, *, whole: bool) -> CaptureRow:
        """Reports what is stored."""
        row = results.row(task)
        self.worst = max(self.worst, row.worst)
        self._whole(task.path, row.complete, row.problem)
        if not row.transactions:
            self.empty.append(task.path)
        result = results.load(task) if whole or not (row.transactions or row.findings) else None
        if result is not None and result.nothing:
            self.blank.append(task.path)
        if whole and result is not None:
            self._gaps(result)
            write_one(self._writer, result)
        results.reported(task)
        return row

    def _unreadable(self, task: Task, problem: CaptureError, *, told: bool = True) -> str:
        text, self.ours = str(problem), self.ours or problem.ours
        self.missing(about(task.path, text))
        if told:
            self._writer.unreadable(task.path, text)
        return text

    def _whole(self, path: str, complete: bool, problem: str | None) -> None:
        if not complete:
            self.missing(about(path, problem or "only partly read"))

    def _gaps(self, result: CaptureResult) -> None:
        """A file of a series that is missing is no damage, but nobody should overlook it."""
        text = missing_files(result.path, result.missing_files)
        if text:
            self._progress.warn(text)

    def _note(self, findings: Sequence[Finding]) -> None:
        self.worst = max(self.worst, worst(findings))

    @contextmanager
    def _interruptible(self, total: int) -> Iterator[None]:
        """Says how far a run of many captures came."""
        try:
            yield
        except (KeyboardInterrupt, Lost) as problem:
            if total > 1 or isinstance(problem, Lost):
                self._progress.warn(
                    f"{_ended(problem)}: {self._reported} of {counted(total, 'capture')} were reported; "
                    "a run with --results FOLDER can be resumed"
                )
            raise


def _ended(problem: BaseException) -> str:
    """Why a run ended before its end."""
    return str(problem) if isinstance(problem, Lost) else "interrupted"


def _taken(outcome: Outcome, _task: Task, finished: OnTransaction | None) -> CaptureResult:
    """What was spooled for a capture; the spool is gone then."""
    from ds47.batch.products import replay

    if isinstance(outcome, CaptureError):
        raise outcome
    if isinstance(outcome, bytes):
        return replay(BytesIO(outcome), finished)
    with outcome.open("rb") as stream:
        result = replay(stream, finished)
    outcome.unlink()
    return result
