"""Random conversations, audited one after the other or by all processors."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.audit import conversations, run
from tests.audit.reading import Complaint

SHARE = 100
"""So many conversations are audited by one process, in 10 s or so."""


def of_seed(seed: int, folder: Path) -> list[Complaint]:
    """What is not so in the report of a random conversation."""
    made = conversations.make(seed)
    path = folder / f"{seed}.pcap"
    made.tape.write(path)
    try:
        return run.audit(path, made.drives)
    except Exception as error:
        error.add_note(f"seed {seed}")
        raise
    finally:
        path.unlink()


def over(seeds: range) -> Iterator[tuple[int, list[Complaint]]]:
    """The complaints of each seed that has any."""
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            found = of_seed(seed, Path(folder))
            if found:
                yield seed, found


def everywhere(seeds: range) -> Iterator[tuple[int, list[Complaint]]]:
    """The same by all processors. A worker ends after its share: analyses leave memory behind."""
    shares = [seeds[start : start + SHARE] for start in range(0, len(seeds), SHARE)]
    with ProcessPoolExecutor(max_tasks_per_child=1) as pool:
        for found in pool.map(_share, shares):
            yield from found


def _share(seeds: range) -> list[tuple[int, list[Complaint]]]:
    return list(over(seeds))
