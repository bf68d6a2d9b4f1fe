"""The product of a task, as bytes: the spool of a report, or the stored result of a capture.

The process or remote worker that analyses writes a product; the process that writes the report reads it.
Lives here: the spool, and how a product appears whole or not at all. `ds47.batch.results` has the stored result.
"""

from __future__ import annotations

import errno
import pickle
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, ClassVar, Protocol, cast

from ds47.analysis import AnalysisOptions, OnTransaction
from ds47.batch.tasks import Task, read
from ds47.capture import CaptureError
from ds47.model import CaptureResult, Finding, Transaction

if TYPE_CHECKING:
    from ds47.parameters.expected import Expectation

_AT_ONCE = 256
"""Transactions that are written together."""
_ABOUT_ALL = frozenset(
    getattr(errno, name, None)
    for name in ("ENOSPC", "EDQUOT", "EROFS", "EIO", "EMFILE", "ENFILE", "ENOMEM", "ENODEV")
)
"""Errors of the disk or the machine, which hit every product; all others are about one name or file."""


class Product(Protocol):
    """Analyses a task and writes the outcome. It is sent to other processes, so it has plain data only."""

    @property
    def is_kept(self) -> bool:
        """Whether its file stays; else the file can go once it was read."""

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        """Raises ds47.capture.CaptureError if the task cannot be read at all."""


@dataclass(frozen=True)
class Spool:
    """Transactions as they are finished, if the report streams, then the rest of the result.

    So memory need not hold all transactions of a capture, just as if it were analysed in the process that
    writes the report.
    """

    options: AnalysisOptions
    streams: bool
    """As in the report's writer (`ds47.report.Writer`)."""
    expected: tuple[Expectation, ...] = ()
    is_kept: ClassVar[bool] = False

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        """Writes lists of transactions with their findings, then the result."""
        batch: list[tuple[Transaction, list[Finding]]] = []

        def finished(transaction: Transaction, findings: list[Finding]) -> None:
            batch.append((transaction, findings))
            if len(batch) == _AT_ONCE:
                pickle.dump(batch, stream, pickle.HIGHEST_PROTOCOL)
                batch.clear()

        on_finished = finished if self.streams else None
        result = read(task, self.options, on_finished, self.expected)
        if batch:
            pickle.dump(batch, stream, pickle.HIGHEST_PROTOCOL)
        pickle.dump(result, stream, pickle.HIGHEST_PROTOCOL)


def replay(stream: BinaryIO, finished: OnTransaction | None) -> CaptureResult:
    """Hands out the transactions of a `Spool` in order, and returns its result."""
    while True:
        loaded = pickle.load(stream)
        if not isinstance(loaded, list):
            return cast(CaptureResult, loaded)
        for transaction, findings in loaded:
            assert finished is not None
            finished(transaction, findings)


@contextmanager
def whole(path: Path, draft: Path) -> Iterator[BinaryIO]:
    """A stream into a file that appears under its name when complete, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with draft.open("wb") as stream:
            yield stream
        draft.replace(path)
    except BaseException:
        discard(draft)
        raise


def discard(path: Path) -> None:
    """Removes a file if it exists; impossible names are no error."""
    with suppress(OSError):
        path.unlink()


def kept_from(problem: OSError) -> CaptureError:
    """Why a task has no product. Raises `problem` itself if it would hit all other tasks, too."""
    if problem.errno in _ABOUT_ALL:
        raise problem
    return CaptureError(f"no result could be stored: {problem.strerror or problem}")
