"""`python -m tests.audit`: audits random conversations and captures, and says what of them is not so.

python -m tests.audit --count 1000 --seed 7     random conversations; every hundred has a seed of its own, from 7 on
python -m tests.audit captures/*.pcapng         captures
python -m tests.audit --plan '{...}'            one conversation, planned as a complaint shows it
python -m tests.audit --plan '{...}' --keep FILE   writes its capture
python -m tests.audit --holes ...               the same, each with holes
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.audit import holes, run, seeds
from tests.audit.reading import Complaint


def main() -> int:
    """Runs it; 1 where something is not so."""
    parser = argparse.ArgumentParser(prog="python -m tests.audit")
    parser.add_argument("captures", nargs="*", type=Path)
    parser.add_argument("--count", type=int, default=0, help="random conversations")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first hundred")
    parser.add_argument("--plan", type=seeds.plan, help="one conversation, as JSON")
    parser.add_argument("--keep", type=Path, help="only write the capture of the plan")
    parser.add_argument("--holes", action="store_true", help="read them with holes")
    given = parser.parse_args()
    if given.keep is not None:
        seeds.play(given.plan).tape.write(given.keep)
        return 0
    total = 0
    for name, found in _all(given):
        total += len(found)
        for each in found:
            print(f"{name}: {each}", flush=True)
    count = given.count + (given.plan is not None)
    print(f"{len(given.captures)} captures, {count} conversations: {total} complaints")
    return 1 if total else 0


def _all(given: argparse.Namespace) -> Iterator[tuple[str, list[Complaint]]]:
    for path in given.captures:
        yield str(path), list(holes.of(path)) if given.holes else run.audit(path)
    for plan, found in seeds.over([given.plan] if given.plan else [], cut=given.holes):
        yield plan.text(), found
    for plan, found in seeds.everywhere(given.count, given.seed, cut=given.holes):
        yield plan.text(), found


if __name__ == "__main__":
    sys.exit(main())
