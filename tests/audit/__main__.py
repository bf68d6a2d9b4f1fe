"""`python -m tests.audit`: audits random conversations and captures, and says what of them is not so.

python -m tests.audit --count 1000 --seed 7     random conversations, the first with seed 7
python -m tests.audit captures/*.pcapng         captures
python -m tests.audit --keep FILE --seed 12     writes the capture of one seed
"""

from __future__ import annotations

import argparse
import sys
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


def main() -> int:
    """Runs it; 1 where something is not so."""
    parser = argparse.ArgumentParser(prog="python -m tests.audit")
    parser.add_argument("captures", nargs="*", type=Path)
    parser.add_argument("--count", type=int, default=0, help="random conversations")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first")
    parser.add_argument("--keep", type=Path, help="only write the capture of the seed")
    given = parser.parse_args()
    if given.keep is not None:
        conversations.make(given.seed).tape.write(given.keep)
        return 0
    total = 0
    for name, found in _all(given.captures, range(given.seed, given.seed + given.count)):
        total += len(found)
        for each in found:
            print(f"{name}: {each}", flush=True)
    print(f"{len(given.captures)} captures, {given.count} conversations: {total} complaints")
    return 1 if total else 0


def _all(captures: list[Path], seeds: range) -> Iterator[tuple[str, list[Complaint]]]:
    for path in captures:
        yield str(path), run.audit(path)
    for seed, found in everywhere(seeds):
        yield f"seed {seed}", found


if __name__ == "__main__":
    sys.exit(main())
