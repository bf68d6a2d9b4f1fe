"""Which captures the arguments of a command mean.

Nothing is opened here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ds47.capture.names import SUFFIXES, is_capture

STDIN = "-"


def captures(paths: Sequence[str], missing: Callable[[str], None]) -> Iterator[str]:
    """The captures that paths mean, each once, in order; folders are searched with all below them.

    Args:
        paths: files, folders, or - for stdin.
        missing: is told in one line of a folder that cannot be read or has no capture.
    """
    seen = set()
    for path in paths:
        found = [path]
        if path != STDIN and Path(path).is_dir():
            found = _in_folder(path, missing)
            if not found:
                missing(f"{path}: no capture in this folder ({', '.join(SUFFIXES)})")
        for each in found:
            name = os.path.normpath(each)
            if name not in seen:
                seen.add(name)
                yield each


def about(path: str, problem: str) -> str:
    """One line that names the capture, and names it once."""
    name = "stdin" if path == STDIN else path
    line = " ".join(problem.split())
    return line if name in line else f"{name}: {line}"


def _in_folder(folder: str, missing: Callable[[str], None]) -> list[str]:
    def unreadable(problem: OSError) -> None:
        missing(f"{problem.filename}: {problem.strerror}")

    return sorted(
        str(Path(parent, name))
        for parent, _, names in os.walk(folder, onerror=unreadable)
        for name in names
        if is_capture(name)
    )
