"""What gives the products of tasks in their order, however many are analysed at once.

Lives here: the shape of a runner, the window of tasks that are on their way, and the runner that
needs no other process. Those that do are in local.py (processes) and cluster.py (Dask).
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Generic, Self, TypeVar

from ds47.batch.products import Product, kept_from, whole
from ds47.batch.tasks import Task
from ds47.capture import CaptureError
from ds47.capture.drafts import draft_of

Outcome = Path | bytes | CaptureError
"""Where the product of a task is, or itself where it is short, or why there is none."""
PathOf = Callable[[Task], Path]
"""The path for the product of a task."""
Handle = TypeVar("Handle")
"""How a runner names what it has begun."""

_WAITING = 1024
"""Products that may wait for their turn."""


def make_here(make: Product, task: Task, path: Path) -> Outcome:
    """Makes the product of a task in this process."""
    try:
        with whole(path, draft_of(path, os.getpid())) as stream:
            make(task, stream)
    except CaptureError as problem:
        return problem
    except OSError as problem:
        return kept_from(problem)
    return path


def here(
    tasks: Iterable[Task], make: Product, path_of: PathOf
) -> AbstractContextManager[Iterator[tuple[Task, Outcome]]]:
    """One task after the other, in this process."""
    return nullcontext((task, make_here(make, task, path_of(task))) for task in tasks)


@dataclass(slots=True, eq=False)
class Begun:
    """A task on its way."""

    task: Task
    outcome: Outcome | None = None


class TaskWindow(ABC, Generic[Handle]):
    """Begins tasks ahead of their turn, a share at a time; iterating gives each with its outcome, in order.

    There are always some more begun than can be worked at, so that nobody has to wait; one that
    takes long does not hold up the others behind it.
    """

    def __init__(self, tasks: Iterable[Task], make: Product, path_of: PathOf) -> None:
        self._tasks = iter(tasks)
        self._make = make
        self._path_of = path_of
        self._begun: deque[Begun] = deque()
        self._working: dict[Handle, list[Begun]] = {}

    def __enter__(self) -> Self:
        return self

    def __iter__(self) -> Iterator[tuple[Task, Outcome]]:
        while True:
            room = min(self._wanted() - len(self._working), _WAITING - len(self._begun))
            while room > 0 and (share := [Begun(task) for task in self._share()]):
                self._begun += share
                self._begin(share)
                room -= 1
            if not self._begun:
                return
            first = self._begun[0]
            if first.outcome is None:
                self._wait()
                continue
            self._begun.popleft()
            yield first.task, first.outcome

    def _share(self) -> list[Task]:
        """The next tasks that are given away together; none where there are no more."""
        return list(islice(self._tasks, 1))

    def _begin(self, share: list[Begun]) -> None:
        self._working[self._submit([begun.task for begun in share])] = share

    def _wait(self) -> None:
        for handle in self._any_done(list(self._working)):
            share = self._working.pop(handle, None)
            if share is not None:
                self._take(handle, share)

    @abstractmethod
    def _wanted(self) -> int:
        """How many shares to have at work."""

    @abstractmethod
    def _submit(self, tasks: list[Task]) -> Handle:
        """Gives a share away."""

    @abstractmethod
    def _any_done(self, handles: list[Handle]) -> Iterable[Handle]:
        """Waits until at least one of them is finished; those that are."""

    @abstractmethod
    def _take(self, handle: Handle, share: list[Begun]) -> None:
        """Sets what came of a finished share, or begins it again."""

    @abstractmethod
    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Ends what is still at work."""
