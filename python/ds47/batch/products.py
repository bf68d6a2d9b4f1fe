"""What is made of a task, as bytes: the spool of a report, or the stored result of a capture.

A product is written by whoever analyses, a process here or a worker elsewhere, and read by the one
who writes the report. Here: the spool, and the way a product appears whole or not at all. The
stored result is `ds47.batch.results`.
"""

from __future__ import annotations

import errno
import pickle
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, ClassVar, Protocol, cast

from ds47.analysis import AnalysisOptions, OnTransaction
from ds47.batch.tasks import Task, read
from ds47.capture import CaptureError
from ds47.model import CaptureResult, Finding, Transaction

_AT_ONCE = 256
"""Transactions that are written together."""
_ABOUT_ALL = frozenset(
    getattr(errno, name, None)
    for name in ("ENOSPC", "EDQUOT", "EROFS", "EIO", "EMFILE", "ENFILE", "ENOMEM", "ENODEV")
)
"""What ails the disk or the machine, and so every product; all else is about one name or one file."""


class Product(Protocol):
    """Analyses a task and writes what came of it. Goes to other processes: plain data only."""

    @property
    def is_kept(self) -> bool:
        """Whether it stays in its place; else nobody needs it once it was taken."""

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        """Raises ds47.capture.CaptureError where nothing of the task can be read."""


@dataclass(frozen=True)
class Spool:
    """Transactions as they are finished, if the report streams, then the rest of the result.

    So a capture with more transactions than fit into memory is no more of a problem than one that
    is analysed where the report is written.
    """

    options: AnalysisOptions
    streams: bool
    """As in the report's writer (`ds47.report.Writer`)."""
    is_kept: ClassVar[bool] = False

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        """Writes lists of transactions with their findings, and the result last."""
        told: list[tuple[Transaction, list[Finding]]] = []

        def finished(transaction: Transaction, findings: list[Finding]) -> None:
            told.append((transaction, findings))
            if len(told) == _AT_ONCE:
                pickle.dump(told, stream, pickle.HIGHEST_PROTOCOL)
                told.clear()

        told_at_once = finished if self.streams else None
        result = read(task, self.options, told_at_once)
        if told:
            pickle.dump(told, stream, pickle.HIGHEST_PROTOCOL)
        pickle.dump(result, stream, pickle.HIGHEST_PROTOCOL)


def replay(stream: BinaryIO, finished: OnTransaction | None) -> CaptureResult:
    """Tells what a `Spool` holds, in its order."""
    while True:
        told = pickle.load(stream)
        if not isinstance(told, list):
            return cast(CaptureResult, told)
        for transaction, findings in told:
            assert finished is not None
            finished(transaction, findings)


@contextmanager
def whole(path: Path, draft: Path) -> Iterator[BinaryIO]:
    """A stream whose file appears under its name when all of it is written, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with draft.open("wb") as stream:
            yield stream
        draft.replace(path)
    except BaseException:
        discard(draft)
        raise


def discard(path: Path) -> None:
    """Takes away what is there; nothing is under a name that no file can have."""
    with suppress(OSError):
        path.unlink()


def kept_from(problem: OSError) -> CaptureError:
    """Why there is no product of one task. Raises `problem` itself where all others would have it too."""
    if problem.errno in _ABOUT_ALL:
        raise problem
    return CaptureError(f"no result could be stored: {problem.strerror or problem}")


def draft_of(path: Path, owner: int) -> Path:
    """Where the product is written by the run of the process `owner`."""
    return path.with_name(f".{path.name}.{owner}.tmp")
