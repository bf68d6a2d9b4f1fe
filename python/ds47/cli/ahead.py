"""Many captures at once: processes that analyse ahead, while the results are taken in order.

Lives here: `Ahead`, what `-j` means. What an analysis is (`ds47.analysis`) and what becomes of its
result (`ds47.cli.report`) is not known better than its types. Processes are spawned, not forked, so
that it is the same on every system.

A worker writes what it finds to a file of its own, as it finds it; so a capture with more
transactions than fit into memory is no more of a problem than without -j.
"""

from __future__ import annotations

import gc
import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import TYPE_CHECKING, BinaryIO, cast

from ds47.capture import CaptureError

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions, OnTransaction
    from ds47.model import CaptureResult, Finding, Transaction

_AT_ONCE = 256
"""Transactions that a worker writes together."""


class Ahead:
    """Analyses captures in `jobs` processes; a context manager.

    Iterating gives the paths in their order; after each, `analyze` must be called with it. What
    cannot be sent to a process (stdin) is analysed here.
    """

    def __init__(
        self,
        paths: Iterable[str],
        here: Iterable[str],
        options: AnalysisOptions,
        streams: bool,
        jobs: int,
    ) -> None:
        """`here` are the paths for this process; `streams` says that transactions are told one by one."""
        self._paths = iter(paths)
        self._here = frozenset(here)
        self._options = options
        self._streams = streams
        self._jobs = jobs
        self._folder = TemporaryDirectory(prefix="ds47-")
        self._pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
        self._begun: deque[tuple[str, Future[None] | None, Path]] = deque()
        self._count = 0

    def __enter__(self) -> Ahead:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pool.shutdown(cancel_futures=True)
        self._folder.cleanup()

    def __iter__(self) -> Iterator[str]:
        while True:
            # one more than there are processes waits, so that none of them has to
            for path in islice(self._paths, max(0, 2 * self._jobs - len(self._begun))):
                self._begin(path)
            if not self._begun:
                return
            yield self._begun[0][0]

    def _begin(self, path: str) -> None:
        self._count += 1
        spool = Path(self._folder.name, str(self._count))
        future = None
        if path not in self._here:
            future = self._pool.submit(_work, path, self._options, self._streams, spool)
        self._begun.append((path, future, spool))

    def analyze(self, source: str | BinaryIO, finished: OnTransaction | None) -> CaptureResult:
        """The result for the path that was given last; raises what the analysis raised."""
        _path, future, spool = self._begun.popleft()
        if future is None:
            from ds47.analysis import analyze

            return analyze(source, self._options, finished)
        future.result()
        with spool.open("rb") as file:
            while True:
                told = pickle.load(file)
                if not isinstance(told, list):
                    break
                for transaction, findings in told:
                    assert finished is not None
                    finished(transaction, findings)
        spool.unlink()
        if isinstance(told, CaptureError):
            raise told
        return cast("CaptureResult", told)


def _work(path: str, options: AnalysisOptions, streams: bool, spool: Path) -> None:
    """What a process does: lists of transactions with their findings, then the result or the error."""
    from ds47.analysis import analyze

    gc.disable()
    told: list[tuple[Transaction, list[Finding]]] = []
    with spool.open("wb") as file:

        def finished(transaction: Transaction, findings: list[Finding]) -> None:
            told.append((transaction, findings))
            if len(told) == _AT_ONCE:
                pickle.dump(told, file, pickle.HIGHEST_PROTOCOL)
                told.clear()

        try:
            last: object = analyze(path, options, finished if streams else None)
        except CaptureError as problem:
            last = problem
        if told:
            pickle.dump(told, file, pickle.HIGHEST_PROTOCOL)
        pickle.dump(last, file, pickle.HIGHEST_PROTOCOL)
    gc.collect()
