"""Many captures at once on this machine: processes that analyse ahead of the report.

Processes are spawned, not forked, so that it is the same on every system. One that dies (out of
memory, killed) costs its tasks a second try, each alone; the others go on. When this process is
interrupted or dies, they end.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from multiprocessing import active_children, get_context, parent_process
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import BinaryIO, ClassVar, Final, TypeVar

from ds47.batch.endings import Failed
from ds47.batch.memory import collect, collect_rarely
from ds47.batch.products import Product, discard, kept_from, whole
from ds47.batch.runner import Begun, Outcome, PathOf, TaskWindow
from ds47.batch.tasks import STDIN, Task
from ds47.capture import CaptureError
from ds47.capture.drafts import draft_of

_SHARE, _SHARE_BYTES = 16, 1 << 20
"""So many tasks, or bytes of captures, go to a process together: to hand one over takes as long as to read one."""
_SMALL = 1 << 15
"""The most bytes of a capture to send its product through the pipe: a file would take a fifth of the time."""
_DEATHS = 3
"""After so many shares in a row without a surviving task, the tasks are not the reason."""
_KILLED: Final = CaptureError(
    "the process that analysed it was killed, twice; is there enough memory? (-j 1 needs less)"
)


Made = TypeVar("Made")
Products = list[CaptureError | bytes | None]
"""For each task of a share: its product, None if that is in its file, or why there is none."""


class Local(TaskWindow[Future[Products]]):
    """Makes products in `jobs` processes; a context manager."""

    def __init__(self, tasks: Sequence[Task], make: Product, path_of: PathOf, jobs: int) -> None:
        super().__init__(tasks, make, path_of)
        self._jobs = jobs
        self._most = max(1, min(_SHARE, len(tasks) // (4 * jobs)))
        self._next: Task | None = None
        """One that did not fit into the share before."""
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
        return draft_of(self._path_of(task), os.getpid())

    def _wanted(self) -> int:
        return 2 * self._jobs

    def _share(self) -> list[Task]:
        share, size = list[Task](), 0
        while len(share) < self._most and size < _SHARE_BYTES:
            task, self._next = self._next or next(self._tasks, None), None
            if task is None:
                break
            if share and task.path == STDIN:
                self._next = task
                break
            share.append(task)
            size += _SHARE_BYTES if task.path == STDIN else task.size
        return share

    def _submit(self, tasks: list[Task]) -> Future[Products]:
        work = [(task, self._path_of(task), self._draft(task)) for task in tasks]
        if tasks[0].path == STDIN:  # is here and nowhere else
            here = Future[Products]()
            here.set_result(_work(self._make, work))
            return here
        try:
            with _uninterrupted(), _without_main():
                return self._pool.submit(_work, self._make, work)
        except BrokenProcessPool as problem:
            future = Future[Products]()
            future.set_exception(problem)
            return future

    def _any_done(self, handles: list[Future[Products]]) -> Iterable[Future[Products]]:
        return wait(handles, return_when=FIRST_COMPLETED).done

    def _take(self, handle: Future[Products], share: list[Begun]) -> None:
        try:
            products = handle.result()
        except BrokenProcessPool:
            self._one_died(share)
            return
        self._deaths = 0
        for begun, product in zip(share, products, strict=True):
            begun.outcome = self._came_of(begun.task, product)

    def _came_of(self, task: Task, product: CaptureError | bytes | None) -> Outcome:
        return self._path_of(task) if product is None else product

    def _one_died(self, share: list[Begun]) -> None:
        """Restarts everything at work, this share task by task: any of them may have killed the process."""
        waiting = dict(self._working)
        self._working.clear()
        self._pool.shutdown()
        self._pool = self._new_pool(1)
        lived = False
        for begun in share:
            begun.outcome = self._alone(begun.task)
            lived = lived or begun.outcome is not _KILLED
        self._deaths = 0 if lived else self._deaths + 1
        if self._deaths == _DEATHS:
            raise Failed("no process of this run stays alive; -j 1 needs none")
        self._pool.shutdown()
        self._pool = self._new_pool()
        for handle, each in waiting.items():
            if handle.done() and handle.exception() is None:  # stdin is read once
                self._take(handle, each)
            else:
                self._begin(each)

    def _alone(self, task: Task) -> Outcome:
        try:
            (product,) = self._submit([task]).result()
        except BrokenProcessPool:
            discard(self._draft(task))
            self._pool.shutdown()
            self._pool = self._new_pool(1)
            return _KILLED
        return self._came_of(task, product)


@dataclass(frozen=True)
class _Made:
    """What a function makes of a task, as a product."""

    function: Callable[[Task], object]
    is_kept: ClassVar[bool] = False

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        pickle.dump(self.function(task), stream, pickle.HIGHEST_PROTOCOL)


def in_order(
    function: Callable[[Task], Made],
    tasks: Sequence[Task],
    jobs: int,
    instead: Callable[[Task, CaptureError], Made] | None = None,
) -> Iterator[Made]:
    """What a function makes of each task, in their order, in several processes; it is sent to them.

    Args:
        function: what is sent.
        tasks: for which it is called, each.
        jobs: how many processes there are.
        instead: makes something of a task whose process was killed, twice, or that it raised CaptureError for.

    Raises:
        CaptureError: as said, without `instead`. What else the function raises is raised here, too.
    """
    numbers = {task.path: str(number) for number, task in enumerate(tasks)}
    with (
        TemporaryDirectory(prefix="ds47-") as folder,
        Local(tasks, _Made(function), lambda task: Path(folder, numbers[task.path]), jobs) as local,
    ):
        for task, outcome in local:
            if isinstance(outcome, CaptureError):
                if instead is None:
                    raise outcome
                yield instead(task, outcome)
                continue
            made: Made = pickle.loads(
                outcome if isinstance(outcome, bytes) else outcome.read_bytes()
            )
            yield made


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


@contextmanager
def _without_main() -> Iterator[None]:
    """Processes started in here do not import the command again; they need nothing of it."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _work(make: Product, work: list[tuple[Task, Path, Path]]) -> Products:
    """What a process does with a share."""
    return [_one(make, *each) for each in work]


def _one(make: Product, task: Task, path: Path, draft: Path) -> CaptureError | bytes | None:
    """One of `Products`."""
    try:
        if not make.is_kept and 0 < task.size <= _SMALL:  # of stdin it is not known
            short = BytesIO()
            make(task, short)
            return short.getvalue()
        with whole(path, draft) as stream:
            make(task, stream)
    except CaptureError as problem:
        return problem
    except OSError as problem:
        return kept_from(problem)
    finally:
        collect()
    return None
