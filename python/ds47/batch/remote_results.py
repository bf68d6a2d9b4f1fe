"""Stored results behind a URL: `--results s3://bucket/out`, and all else that fsspec writes.

A result is made in a folder of this machine, written to the URL as soon as it is its turn, and gone
here when the report has it. An object store shows a file whole or not at all; elsewhere one that was
cut is found by its digest (`ds47.batch.results`).
"""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from ds47.batch.endings import Lost
from ds47.batch.products import discard
from ds47.batch.results import LOOKED_AT, OVERVIEW, Results, StoredResult
from ds47.batch.tasks import Task
from ds47.capture.remote import file_system, is_url, reason
from ds47.report.overview import CaptureRow

_AT_ONCE = 128
"""Results that are fetched together."""
_READ_ONLY = ("http://", "https://")


class RemoteResults(Results):
    """A folder behind a URL. Raises CaptureError where nothing opens such a URL."""

    def __init__(self, url: str, make: StoredResult) -> None:
        self._scratch = TemporaryDirectory(prefix="ds47-")
        super().__init__(Path(self._scratch.name), make)
        self._url = url if url.endswith("://") else url.rstrip("/")
        self._system, base = file_system(url)
        self._base = base.rstrip("/")
        self._done: set[str] = set()

    def shown(self, task: Task | None = None) -> str:
        """The URL of the folder, or of the result of a task."""
        return self._url if task is None else f"{self._url}/{self._name(task)}"

    def spare(self, tasks: Sequence[Task]) -> None:
        """Whether the folder can be written at all, too."""
        if self._url.startswith(_READ_ONLY):
            raise OSError(errno.EROFS, "a web server stores no results")
        super().spare(tasks)

    def _heads(self, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """The beginnings of those files of these names that are behind the URL."""
        wanted = {f"{self._base}/{name}": f"{self._url}/{name}" for name in names}
        with self._reached():
            paths = sorted(self._there() & set(wanted))
            ends = [LOOKED_AT] * len(paths)
            heads = self._system.cat_ranges(paths, [0] * len(paths), ends, on_error="raise")
        yield from ((wanted[path], head) for path, head in zip(paths, heads, strict=True))

    def _there(self) -> set[str]:
        """All files behind the URL."""
        with suppress(FileNotFoundError):
            self._system.invalidate_cache()
            return set(self._system.find(self._base))
        return set()

    def begin(self) -> None:
        """Whether the folder can be written; an overview of an earlier run is not that of this one.

        Raises:
            OSError: it cannot.
        """
        super().begin()
        overview = self.folder / OVERVIEW
        overview.write_text("{}")
        with self._reached():
            self._system.put_file(str(overview), f"{self._base}/{OVERVIEW}")
            self._system.rm_file(f"{self._base}/{OVERVIEW}")
        overview.unlink()

    def fetch(self, tasks: Sequence[Task]) -> None:
        """Gets the results that are there. Raises OSError where they cannot be read."""
        with self._reached():
            there = self._there()
            wanted = [task for task in tasks if self._remote(task) in there]
            for begin in range(0, len(wanted), _AT_ONCE):
                some = wanted[begin : begin + _AT_ONCE]
                paths = [self.path_of(task) for task in some]
                for path in paths:
                    path.parent.mkdir(parents=True, exist_ok=True)
                self._system.get([self._remote(each) for each in some], list(map(str, paths)))

    def undone(self, task: Task) -> str | None:
        """As there, of what `fetch` got."""
        why = super().undone(task)
        if why is None:
            self._done.add(task.path)
        return why

    def keep(self, task: Task) -> None:
        """Writes a new result to the URL. Raises Lost where it cannot be written."""
        try:
            with self._reached():
                self._system.put_file(str(self.path_of(task)), self._remote(task))
        except OSError as problem:
            raise Lost(f"cannot write {self.shown(task)}: {problem.strerror}") from problem
        self._done.add(task.path)

    def reported(self, task: Task) -> None:
        """What the report has need not stay here."""
        discard(self.path_of(task))

    def forget(self, task: Task) -> None:
        """A capture that cannot be read any more has no result."""
        super().forget(task)
        with suppress(Exception):  # mostly there is none
            self._system.rm_file(self._remote(task))

    def done(self, tasks: Sequence[Task]) -> int:
        """How many results there are when a run is ended; those that waited for their turn are written."""
        for task in tasks:
            if task.path not in self._done and super().undone(task) is None:
                with suppress(Lost):
                    self.keep(task)
        return len(self._done)

    def end(self, rows: Sequence[CaptureRow], owner: int) -> None:
        """Writes the overview."""
        super().end(rows, owner)
        with self._reached():
            self._system.put_file(str(self.folder / OVERVIEW), f"{self._base}/{OVERVIEW}")

    def _name(self, task: Task) -> str:
        return self.path_of(task).relative_to(self.folder).as_posix()

    def _remote(self, task: Task) -> str:
        return f"{self._base}/{self._name(task)}"

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """What the libraries of a file system raise, as OSError with one line."""
        try:
            yield
        except Exception as problem:
            raise OSError(errno.EIO, reason(problem), self._url) from problem


def results_at(name: str, make: StoredResult) -> Results:
    """The results in a folder of this machine, or behind a URL.

    Raises:
        ds47.capture.CaptureError: nothing opens such a URL.
    """
    if not is_url(name):
        return Results(Path(name), make)
    system, path = file_system(name)
    return Results(Path(path), make) if "file" in system.protocol else RemoteResults(name, make)
