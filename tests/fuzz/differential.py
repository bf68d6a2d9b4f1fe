"""The analysis in Lua against that in Python on changed captures: findings, relations, events, transactions.

The captures are those of the target `pairing`, whose frames are changed by chance; the comparison is that of
test_lua_analysis.py. What differs is kept as a capture.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

from tests.fuzz import targets

TOGETHER = 40
"""Captures of one Lua process."""
LUA = "5.4"


def byte_changed(chance: random.Random) -> targets.Change:
    """What changes some bytes, mostly to values that mean something."""

    def change(data: bytes, most: int) -> bytes:
        found = bytearray(data)
        for _ in range(chance.choice((1, 1, 2, 6))):
            if found:
                at = chance.randrange(len(found))
                found[at] = chance.choice(
                    (0, 1, 2, 0x2F, 0x7F, 0x80, 0xFF, found[at] ^ 1, chance.randrange(256))
                )
        cut = chance.random() < 0.1
        return bytes(found[: chance.randrange(len(found) + 1)] if cut else found)[:most]

    return change


def captures(first: int) -> Iterator[tuple[str, bytes]]:
    """Changed captures, each with the seed that makes it again."""
    seeds = list(targets.SEEDS["pairing"]())
    for seed in count(first):
        chance = random.Random(seed)
        content = chance.choice(seeds)
        for _ in range(chance.choice((1, 2, 4))):
            content = targets.other_frames(
                content, 4 * targets.LARGEST, chance.getrandbits(32), byte_changed(chance)
            )
        try:
            targets.frames(content)
        except targets.CaptureError:
            continue
        yield f"seed {seed}", content


def run(seconds: float, first: int, faults: Path) -> tuple[int, list[Path]]:
    """Compares for so long: how many captures, and those that differ."""
    sys.path.append(str(Path(__file__).resolve().parents[1] / "python"))
    import test_lua_analysis as both

    end, made, different = time.monotonic() + seconds, 0, list[Path]()
    given = captures(first)
    with tempfile.TemporaryDirectory() as folder:
        while time.monotonic() < end:
            sources = [both.Source(*next(given), look=False) for _ in range(TOGETHER)]
            made += len(sources)
            if not _alike(both, sources, Path(folder)):
                alone = [each for each in sources if not _alike(both, [each], Path(folder))]
                for each in alone or sources:
                    different.append(faults / f"lua-{each.name.replace(' ', '-')}.pcapng")
                    different[-1].write_bytes(each.content)
    return made, different


def _alike(both: Any, sources: list[Any], folder: Path) -> bool:
    try:
        both.compare(LUA, "en", sources, folder)
    except AssertionError:
        return False
    return True
