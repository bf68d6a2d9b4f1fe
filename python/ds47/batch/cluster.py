"""Many captures over many machines: the workers of a Dask cluster make the products.

A worker opens the files of its task itself, so paths have to mean the same there (a shared folder, or
a URL), and sends back the bytes of the product, which appear here as a process would have written
them. The scheduler gives the tasks of a lost worker to another one; what was finished stays.
"""

from __future__ import annotations

import io
import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from importlib import metadata
from typing import Any

from ds47.batch.endings import Failed, Lost
from ds47.batch.products import Product, kept_from, whole
from ds47.batch.runner import Begun, Outcome, PathOf, TaskWindow
from ds47.batch.tasks import Task
from ds47.capture import CaptureError
from ds47.capture.drafts import draft_of
from ds47.spec.extras import install
from ds47.version import __version__

_SECONDS_TO_CONNECT = 15
_SECONDS_FOR_WORKERS = 60


class Cluster(TaskWindow[Any]):
    """Makes products on the workers of a scheduler; a context manager.

    Raises:
        Failed: no Dask, no scheduler, no workers, or workers with another version of ds47.
        Lost: the scheduler went away, while iterating.
    """

    def __init__(
        self, tasks: Iterable[Task], make: Product, path_of: PathOf, scheduler: str
    ) -> None:
        super().__init__(tasks, make, path_of)
        self._address = scheduler
        self._distributed = _distributed()
        try:
            self._client = self._distributed.Client(
                scheduler, timeout=_SECONDS_TO_CONNECT, set_as_default=False
            )
        except (OSError, ValueError, RuntimeError) as problem:
            raise Failed(f"no Dask scheduler answers at {scheduler}: {_line(problem)}") from problem
        try:
            with self._connected():
                self._check_workers(scheduler)
        except BaseException:
            self._client.close()
            raise

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # a scheduler that is lost has nothing to cancel
            if self._working and self._client.status == "running":
                self._client.cancel(list(self._working), force=True)
        self._client.close()

    @contextmanager
    def _connected(self) -> Iterator[None]:
        """Raises Lost where what failed inside did so because the scheduler is not there any more."""
        try:
            yield
        except Failed:
            raise
        except Exception as problem:
            if isinstance(problem, OSError) or self._client.status != "running":
                raise Lost(f"the Dask scheduler at {self._address} is gone") from problem
            raise

    def _check_workers(self, scheduler: str) -> None:
        """Whether there are workers, all with this version; one that comes later checks itself."""
        try:
            self._client.wait_for_workers(1, timeout=_SECONDS_FOR_WORKERS)
        except self._distributed.TimeoutError as problem:
            raise Failed(f"the Dask scheduler at {scheduler} has no workers") from problem
        found = self._client.run(metadata.version, "ds47", on_error="return")
        for worker, version in sorted(found.items()):
            if version != __version__:
                has = f"has ds47 {version}" if isinstance(version, str) else "has no ds47"
                raise Failed(
                    f"the Dask worker {worker} {has}, this is {__version__}: install the same version there"
                )

    def _wanted(self) -> int:
        with self._connected():
            threads: int = sum(self._client.nthreads().values())
        return max(2, 2 * threads)

    def _submit(self, tasks: list[Task]) -> Any:
        (task,) = tasks
        key = f"ds47-{os.urandom(8).hex()}"
        with self._connected():
            return self._client.submit(_work, self._make, task, __version__, key=key, pure=False)

    def _any_done(self, handles: list[Any]) -> Iterable[Any]:
        with self._client.as_current(), self._connected():
            try:
                return list(self._distributed.wait(handles, return_when="FIRST_COMPLETED").done)
            except self._distributed.CancelledError:  # some of them: each says so itself
                if self._client.status != "running":
                    raise
                return [each for each in handles if each.done()]

    def _take(self, handle: Any, share: list[Begun]) -> None:
        (begun,) = share
        begun.outcome = self._outcome(handle, begun)

    def _outcome(self, future: Any, begun: Begun) -> Outcome | None:
        """What came of a finished one; None where it had to be begun again."""
        try:
            product = future.result()
        except CaptureError as problem:
            return problem
        except self._distributed.KilledWorker:
            return CaptureError("every worker that analysed it was lost: is there enough memory?")
        except self._distributed.CancelledError as problem:  # its result went with its worker
            with self._connected():
                if self._client.status != "running":
                    raise problem
            self._begin([begun])
            return None
        except self._distributed.comm.CommClosedError as problem:  # it went while this result came
            raise Lost(f"the Dask scheduler at {self._address} is gone") from problem
        except ImportError as problem:
            raise Failed(f"a Dask worker has no ds47 {__version__}: {_line(problem)}") from problem
        finally:
            future.release()
        path = self._path_of(begun.task)
        try:
            with whole(path, draft_of(path, os.getpid())) as stream:
                stream.write(product)
        except OSError as problem:
            return kept_from(problem)
        return path


def _work(make: Product, task: Task, version: str) -> bytes:
    """What a worker does: the bytes of the product."""
    if version != __version__:
        raise ImportError(f"there is {__version__}")
    stream = io.BytesIO()
    make(task, stream)
    return stream.getvalue()


def _distributed() -> Any:
    """Dask's package, without what it likes to say: whatever matters comes as an exception.

    Raises:
        Failed: it is not installed.
    """
    try:
        import distributed
    except ImportError as problem:
        raise Failed(f"--scheduler needs Dask: {install('cluster')}") from problem
    # Dask sets the level of each. Tornado, in whose loop it runs, tells of what fails while Ctrl-C ends that.
    for name in list(logging.root.manager.loggerDict):
        if name.startswith(("distributed", "tornado")):
            logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed


def _line(problem: Exception) -> str:
    return " ".join(str(problem).split()) or type(problem).__name__
