"""How a run over captures ends before its end, and how a fault of ours ends one capture and not the run.

What reads a capture, or says what was in it, stands inside `fence`: an exception that nobody raised on purpose
becomes one line about this capture. The run goes on, and its exit status still says whose fault it was.

A file of its own, because a run of one capture needs nothing else of `ds47.batch.runner`.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar

from ds47.capture import CaptureError
from ds47.spec.raised import Error

_LONGEST = 300
"""Letters of an internal error that its line shows."""


class Failed(Exception):
    """The run as a whole cannot go on; the text says why, and what to do."""


class Lost(Exception):
    """What analyses, or takes the results, went away in the middle; what is finished stays. The text says what."""


class OwnFaultError(CaptureError):
    """ds47 itself broke on a capture; the message says how to report it."""

    ours: ClassVar[bool] = True


@contextmanager
def fence(*meant: type[Exception]) -> Iterator[None]:
    """Around all that depends on the content of one capture.

    Args:
        meant: what is raised in there on purpose, besides `ds47.Error` and OSError.

    Raises:
        OwnFaultError: something else was raised.
    """
    wanted: tuple[type[Exception], ...] = (Error, OSError, *meant)
    try:
        yield
    except wanted:
        raise
    except Exception as problem:
        raise OwnFaultError(explained(problem)) from problem


def explained(problem: Exception) -> str:
    """One line about a fault of ours; all that Python knows of it goes to stderr where DS47_TRACEBACK is set."""
    if os.environ.get("DS47_TRACEBACK"):
        import traceback

        traceback.print_exception(problem)
    what = " ".join(f"{type(problem).__name__}: {problem}".split()).rstrip(": ")[:_LONGEST]
    return (
        f"internal fault: {what}; please report it with the command, ds47 --version and what "
        "DS47_TRACEBACK=1 shows"
    )
