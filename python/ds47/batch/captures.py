"""Which captures a user means: the arguments of a command, or of `ds47.analyze_many`.

Nothing is opened here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ds47.capture import CaptureError
from ds47.capture.names import EXPORTED, PACKED, STDIN, SUFFIXES, is_capture
from ds47.capture.remote import below, is_url


def captures(
    paths: Sequence[str],
    missing: Callable[[str], None],
    accept: Callable[[str], bool] = is_capture,
    passed: Callable[[str], None] = lambda _: None,
) -> Iterator[str]:
    """The captures that paths mean, each once, in order; folders are searched with all below them.

    Args:
        paths: files, folders, URLs of either, or - for stdin.
        missing: gets one line for each folder that cannot be read or has no capture.
        accept: which names in a folder are captures.
        passed: gets one line for each name in a folder that is a named pipe, a socket or a device.
    """
    seen = set()
    for path in paths:
        for each in _meant(path, missing, accept, passed):
            name = os.path.normpath(each)
            if name not in seen:
                seen.add(name)
                yield each


def _meant(
    path: str,
    missing: Callable[[str], None],
    accept: Callable[[str], bool],
    passed: Callable[[str], None],
) -> Sequence[str]:
    if is_url(path):
        try:
            found = below(path, accept)
        except CaptureError as problem:
            missing(str(problem))
            return ()
    elif path != STDIN and Path(path).is_dir():
        found = list(_files(_in_folder(path, missing, accept), passed))
    else:
        return (path,)
    if not found:
        endings = f"{', '.join(SUFFIXES)}, also with {' or '.join(PACKED[1:])}; not {EXPORTED}"
        missing(f"{path}: no capture in this folder. Try: one with {endings}")
    return found


def _files(paths: Sequence[str], passed: Callable[[str], None]) -> Iterator[str]:
    """The paths without those that are no file. A link that leads nowhere stays: opening it says so."""
    from ds47.capture.special import CIRCLE, special  # few runs are about folders

    for path in paths:
        kind = special(path)
        if kind is None or kind == CIRCLE:
            yield path
        else:
            passed(f"{path} is {kind}, no capture: passed over")


def _in_folder(
    folder: str, missing: Callable[[str], None], accept: Callable[[str], bool]
) -> list[str]:
    def unreadable(problem: OSError) -> None:
        missing(f"{problem.filename}: {problem.strerror}")

    return sorted(
        str(Path(parent, name))
        for parent, _, names in os.walk(folder, onerror=unreadable)
        for name in names
        if accept(name)
    )
