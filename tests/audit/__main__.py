"""`python -m tests.audit`: audits random conversations and captures, and says what of them is not so.

python -m tests.audit --count 1000 --seed 7     random conversations, the first with seed 7
python -m tests.audit captures/*.pcapng         captures
python -m tests.audit --keep FILE --seed 12     writes the capture of one seed
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.audit import conversations, run, seeds
from tests.audit.reading import Complaint


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


def _all(captures: list[Path], wanted: range) -> Iterator[tuple[str, list[Complaint]]]:
    for path in captures:
        yield str(path), run.audit(path)
    for seed, found in seeds.everywhere(wanted):
        yield f"seed {seed}", found


if __name__ == "__main__":
    sys.exit(main())
