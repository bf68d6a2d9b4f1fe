"""How many processes pay for a run over captures.

A file of its own, because one capture needs no other process, nor what starts one (`ds47.batch.local`):
that takes longer to import than a small capture to analyse.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable

from ds47.batch.tasks import Task

_A_PROCESS = 8 << 20
"""Bytes of captures for which another process pays: to start one takes as long as to read these."""
_A_FILE = 1 << 16
"""What a file costs besides its bytes."""


def useful_jobs(tasks: Iterable[Task]) -> int:
    """How many processes these tasks keep busy, at most as many as there are cores for us."""
    sizes = [task.size + _A_FILE for task in tasks]
    return max(1, min(cores(), len(sizes), sum(sizes) // _A_PROCESS))


def cores() -> int:
    """Cores that this process may use."""
    affinity: Callable[[int], set[int]] | None = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1
