"""Many captures at once on this machine: processes that analyse ahead of the report.

Processes are spawned, not forked, so that it is the same on every system. One that dies (out of
memory, killed) costs its task a second try, alone; the others go on. When this process is
interrupted or dies, they end.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path

from ds47.batch.endings import Failed
from ds47.batch.memory import collect, collect_rarely
from ds47.batch.products import Product, discard, draft_of, kept_from, whole
from ds47.batch.runner import Begun, Outcome, Place, Window
from ds47.batch.tasks import STDIN, Task
from ds47.capture import CaptureError

_DEATHS = 3
"""So many tasks in a row that kill their process are no longer about the tasks."""


class Local(Window[Future[str | None]]):
    """Makes products in `jobs` processes; a context manager."""

    def __init__(self, tasks: Iterable[Task], make: Product, place: Place, jobs: int) -> None:
        super().__init__(tasks, make, place)
        self._jobs = jobs
        self._deaths = 0
        self._before = set(active_children())
        self._pool = self._new_pool()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            for process in set(active_children()) - self._before:
                process.terminate()
        self._pool.shutdown(cancel_futures=True)
        for begun in self._begun:
            discard(self._draft(begun.task))

    def _new_pool(self, jobs: int | None = None) -> ProcessPoolExecutor:
        context = get_context("spawn")
        return ProcessPoolExecutor(jobs or self._jobs, mp_context=context, initializer=_prepare)

    def _draft(self, task: Task) -> Path:
        return draft_of(self._place(task), os.getpid())

    def _wanted(self) -> int:
        return 2 * self._jobs

    def _submit(self, task: Task) -> Future[str | None]:
        path, draft = self._place(task), self._draft(task)
        if task.path == STDIN:  # is here and nowhere else
            here = Future[str | None]()
            here.set_result(_work(self._make, task, path, draft))
            return here
        try:
            with _uninterrupted():
                return self._pool.submit(_work, self._make, task, path, draft)
        except BrokenProcessPool as problem:
            future = Future[str | None]()
            future.set_exception(problem)
            return future

    def _any_done(self, handles: list[Future[str | None]]) -> Iterable[Future[str | None]]:
        return wait(handles, return_when=FIRST_COMPLETED).done

    def _outcome(self, begun: Begun[Future[str | None]]) -> Outcome | None:
        assert begun.handle is not None
        try:
            problem = begun.handle.result()
        except BrokenProcessPool:
            return self._one_died(begun)
        self._deaths = 0
        path = self._place(begun.task)
        return path if problem is None else CaptureError(problem)

    def _one_died(self, begun: Begun[Future[str | None]]) -> Outcome | None:
        """Begins all anew that was at work; nobody knows whose process it was, so this one alone."""
        waiting = list(self._working.values())
        self._working.clear()
        self._pool.shutdown()
        self._pool = self._new_pool(1)
        outcome: Outcome
        try:
            problem = self._submit(begun.task).result()
            outcome = self._place(begun.task) if problem is None else CaptureError(problem)
            self._deaths = 0
        except BrokenProcessPool:
            discard(self._draft(begun.task))
            self._deaths += 1
            if self._deaths == _DEATHS:
                raise Failed("no process of this run stays alive; -j 1 needs none") from None
            outcome = CaptureError(
                "the process that analysed it was killed, twice; is there enough memory? (-j 1 needs less)"
            )
        self._pool.shutdown()
        self._pool = self._new_pool()
        for each in waiting:
            self._again(each)
        return outcome


def _prepare() -> None:
    """In each process: Ctrl-C is for the one that writes the report, and without that one we end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    collect_rarely()
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: object) -> None:
    parent.join()  # type: ignore[attr-defined]
    os._exit(1)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """What is started in here never sees Ctrl-C, not even before `_prepare`; we see it afterwards."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(make: Product, task: Task, path: Path, draft: Path) -> str | None:
    """What a process does with a task; the text of what kept it from a product."""
    try:
        with whole(path, draft) as stream:
            make(task, stream)
    except CaptureError as problem:
        return problem.message
    except OSError as problem:
        return kept_from(problem).message
    finally:
        collect()
    return None
