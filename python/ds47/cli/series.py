"""`--series`: the files of a ring buffer as one capture, for every command that reads captures.

The option, and from paths to what is analysed. Which files belong together is
`ds47.capture.rings`, reading them as one `ds47.capture.Series`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ds47.batch.captures import captures
from ds47.capture.names import STDIN, about
from ds47.capture.remote import is_url
from ds47.cli.common import counted, warn

if TYPE_CHECKING:
    from ds47.batch.tasks import Task
    from ds47.capture.rings import Ring
    from ds47.model import CaptureResult

series_option = click.option(
    "--series",
    is_flag=True,
    help="Treat the files of a ring buffer as one capture; naming one is enough.",
)


def tasks(paths: Sequence[str], series: bool, missing: Callable[[str], None]) -> list[Task]:
    """What the paths of a command mean, in order; with `series` the files of a ring buffer are one.

    Args:
        paths: as for `ds47.batch.captures.captures`.
        series: whether the option was given.
        missing: as for `ds47.batch.captures.captures`.
    """
    from ds47.batch.settings import passed_over
    from ds47.batch.tasks import in_folders, plan

    named = list(_with_their_series(paths)) if series else paths
    found = plan(list(captures(named, missing, in_folders(series), warn)), series)
    for text in passed_over(task.path for task in found):
        warn(text)
    return found


def refuse_urls(paths: Sequence[str]) -> None:
    """Raises click.UsageError for a URL: a stored result stands beside its capture, in a folder."""
    for path in paths:
        if is_url(path):
            raise click.UsageError(
                f"{path}: stored results are beside captures in a folder, not behind a URL: "
                "copy the captures, or use ds47 report --results"
            )


def missing_files(path: str, missing: Sequence[int]) -> str | None:
    """One line where files of a series are not there; None where all are.

    Args:
        path: of the series.
        missing: how many are missing before each of its files. What lacks before the first one is
            what a ring buffer has written over.
    """
    lost = sum(missing[1:])
    return f"{path}: {counted(lost, 'file')} of this series missing" if lost else None


def tell_lacking(
    path: str,
    missing: Sequence[int],
    problem: str | None,
    misses: Callable[[str], None] = warn,
) -> None:
    """Says on stderr what could not be read of a capture: `missing_files`, and damage.

    Damage changes the exit status, so it goes through `misses`.
    """
    lost = missing_files(path, missing)
    if lost:
        warn(lost)
    if problem:
        misses(about(path, problem))


def tell_nothing(result: CaptureResult, lang: str) -> bool:
    """Says on stderr what a capture without traffic of drives has instead. Returns whether it is one."""
    if result.nothing:
        from ds47.report.bilingual import say
        from ds47.report.formatting import escape
        from ds47.report.verdict import VerdictCounts, verdict

        said = verdict(VerdictCounts.of(result)).text(lang)
        warn(f"{escape(result.path)}: {said}. {say('verdict_mirror').text(lang)}")
    return result.nothing


def _with_their_series(paths: Sequence[str]) -> Iterator[str]:
    """The paths; the only one that is named of the files of a series brings the others along."""
    known: dict[Path, dict[str, Ring]] = {}
    found: dict[str, Ring] = {}
    for path in paths:
        if path != STDIN and not is_url(path) and Path(path).is_file():
            file = Path(path)
            if file.parent not in known:
                known[file.parent] = _rings_in(file.parent)
            if file.name in known[file.parent]:
                found[path] = known[file.parent][file.name]
    named = Counter(
        id(ring) for ring in {Path(path): ring for path, ring in found.items()}.values()
    )
    for path in paths:
        if path in found and named[id(found[path])] == 1:
            folder = path.removesuffix(Path(path).name)
            yield from (folder + name for name in found[path].names)
        else:
            yield path


def _rings_in(folder: Path) -> dict[str, Ring]:
    """The ring buffers in a folder, by each name of a file."""
    from ds47.batch.tasks import names_in
    from ds47.capture.rings import rings

    return {name: ring for ring in rings(names_in(folder)) for name in ring.names}
