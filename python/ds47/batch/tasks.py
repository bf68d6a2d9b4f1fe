"""What to analyse: captures, or series of files read as one, with a mark that shows a changed file.

Lives here: `Task`, how to read it, and the name of its product. Not here: which captures a folder has
(`ds47.batch.captures`), and which files are a series (`ds47.capture.rings`).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ds47.analysis import AnalysisOptions, OnTransaction, analyze
from ds47.batch.endings import fence
from ds47.batch.settings import expected_for, options_for
from ds47.capture import CaptureError, Series, open_capture, sha256
from ds47.capture.names import is_capture
from ds47.capture.remote import facts, is_url
from ds47.capture.series import SeriesPart
from ds47.model import CaptureResult

if TYPE_CHECKING:
    from ds47.capture.rings import Ring
    from ds47.parameters.expected import Expectation

STDIN = "-"


class Source(NamedTuple):
    """One file of a task.

    `name` is its name in the report, `location` what to open, `size` its bytes. `mark` changes with the
    file; None if that cannot be seen. `missing` counts the files of its series that are missing before it.
    """

    name: str
    location: str
    size: int = 0
    mark: str | None = None
    missing: int = 0


class Task(NamedTuple):
    """One capture of the report; with `series` its sources are read as one."""

    path: str
    sources: tuple[Source, ...]
    series: bool = False

    @property
    def size(self) -> int:
        """Bytes of all its files."""
        return sum(source.size for source in self.sources)

    @property
    def parts(self) -> list[SeriesPart]:
        """Its files, to be read as one."""
        return [SeriesPart(each.name, each.location, each.missing) for each in self.sources]

    @property
    def own_name(self) -> str | None:
        """NAME of a series (`ds47.capture.rings.own_name`); None: use the name of its file."""
        if not self.series:
            return None
        from ds47.capture.rings import own_name

        path = Path(self.path)
        return own_name(path.name, names_in(path.parent) or [path.name])


def plan(names: Sequence[str], series: bool) -> list[Task]:
    """One task for each capture or series, in order; a series takes the position of its first file."""
    if not series:
        return [Task(name, (_source(name),)) for name in names]
    from ds47.capture.rings import rings

    found = {ring.names[0]: ring for ring in rings(names)}
    inside = {name for ring in found.values() for name in ring.names}
    tasks = []
    for name in names:
        if name not in inside:
            tasks.append(Task(name, (_source(name),)))
        elif name in found:
            tasks.append(_series(found[name]))
    return tasks


def in_folders(series: bool) -> Callable[[str], bool]:
    """A test for names of captures in a folder; with `series` also for names that only tcpdump -C gives."""
    if not series:
        return is_capture
    from ds47.capture.rings import may_be_part

    return may_be_part


def names_in(folder: Path) -> list[str]:
    """Names of the captures in a folder, including files of tcpdump -C; none if it cannot be listed."""
    from ds47.capture.rings import may_be_part
    from ds47.capture.special import special

    try:
        names = [each.name for each in folder.iterdir()]
    except OSError:
        return []
    return sorted(name for name in filter(may_be_part, names) if special(folder / name) is None)


def _series(ring: Ring) -> Task:
    sources = [
        _source(name, missing) for name, missing in zip(ring.names, ring.missing, strict=True)
    ]
    if ring.cyclic:  # tcpdump -W: only the frames show which file is the oldest
        sources = _from_the_oldest(sources)
    return Task(sources[0].name, tuple(sources), series=True)


def _from_the_oldest(sources: list[Source]) -> list[Source]:
    times = [_first_time(source.location) for source in sources]
    known = [at for at, time in enumerate(times) if time is not None]
    oldest = min(known, key=lambda at: times[at] or 0, default=0)
    return sources[oldest:] + sources[:oldest]


def _first_time(location: str) -> int | None:
    try:
        with open_capture(location) as capture:
            frame = next(iter(capture), None)
    except CaptureError:
        return None
    return frame.time_ns if frame else None


def _source(name: str, missing: int = 0) -> Source:
    if name == STDIN:
        return Source(name, name)
    if is_url(name):
        size, mark = facts(name)
        return Source(name, name, size, mark, missing)
    location = os.path.abspath(name)  # noqa: PTH100 (a link stays a link, its name may be all there is)
    try:
        about = Path(location).stat()
    except (OSError, ValueError):  # the analysis will say why
        return Source(name, location, missing=missing)
    return Source(name, location, about.st_size, f"{about.st_mtime_ns}", missing)


def read(
    task: Task,
    options: AnalysisOptions,
    finished: OnTransaction | None = None,
    expected: tuple[Expectation, ...] = (),
) -> CaptureResult:
    """Analyses a task; `finished` as in `ds47.analysis.analyze`.

    With parameters that are expected, by the caller or by its `ds47.toml`, all transactions come at the end.

    Raises CaptureError where none of it can be read, its `ds47.toml` cannot be used, or ds47 itself broke.
    """
    with fence():
        expected = expected or expected_for(task.sources[0].location)
        if not expected:
            return _read(task, options, finished)
        from ds47.report.expected import judged

        return judged(_read(task, options, None), expected, options, finished)


def _read(task: Task, options: AnalysisOptions, finished: OnTransaction | None) -> CaptureResult:
    if task.series:
        with Series(task.parts) as series:
            result = analyze(series, options_for(task.path, options), finished)
    else:
        (source,) = task.sources
        location = sys.stdin.buffer if source.location == STDIN else source.location
        with open_capture(location, name=source.name) as capture:
            result = analyze(capture, options_for(source.location, options), finished)
    result.path = task.path
    if options.digest and task.path != STDIN:
        _digest(task, result)
    return result


def _digest(task: Task, result: CaptureResult) -> None:
    """The SHA-256 of a capture; for a series, of each readable file."""
    if not task.series:
        result.sha256 = sha256(task.sources[0].location)
        return
    for source, file in zip(task.sources, result.files, strict=True):
        if file.readable:
            file.sha256 = sha256(source.location)
