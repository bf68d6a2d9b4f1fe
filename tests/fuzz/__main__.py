"""`python -m tests.fuzz`: looks for inputs on which ds47 breaks, for so many minutes in all.

python -m tests.fuzz --minutes 60                every target, one after the other
python -m tests.fuzz --minutes 480 codec         one of them
python -m tests.fuzz --minutes 5 --seed 1 lua    Lua against Python on changed captures; only where it is named

Needs atheris (`make fuzz` installs it into build/fuzz). A run goes on where the one before it ended: what it found
of interest is in build/fuzz/TARGET. An input that breaks a target is in build/fuzz/faults; what it does shows

    python -m tests.fuzz.targets TARGET FILE
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).resolve().parent / "kept"
WORK = ROOT / "build" / "fuzz"
LONGEST = 20
"""Seconds for one input."""
LUA = "lua"
"""The target that no coverage guides: Lua against Python."""
MEMORY = 2_048
"""MiB of a process."""


def run(atheris: Any, targets: Any, name: str, seconds: int) -> None:
    """Fuzzes one target in this process, which ends with it."""
    corpus, faults = WORK / name, WORK / "faults"
    for folder in (corpus, faults, KEPT / name):
        folder.mkdir(parents=True, exist_ok=True)
    for seed in targets.SEEDS[name]():
        if len(seed) <= targets.LARGEST:
            (corpus / hashlib.sha1(seed).hexdigest()).write_bytes(seed)
    options = {
        "max_total_time": seconds, "timeout": LONGEST, "rss_limit_mb": MEMORY, "max_len": targets.LARGEST,
        "artifact_prefix": f"{faults}/{name}-", "print_final_stats": 1, "reload": 0,
    }  # fmt: skip
    words = [sys.argv[0], *(f"-{key}={value}" for key, value in options.items())]
    more = {}
    if name == "pairing":
        more["custom_mutator"] = lambda data, most, seed: targets.other_frames(
            data, most, seed, atheris.Mutate
        )
    atheris.Setup([*words, str(corpus), str(KEPT / name)], targets.TARGETS[name], **more)
    atheris.Fuzz()


def in_a_child(atheris: Any, targets: Any, name: str, seconds: int) -> bool:
    """Whether nothing was found; what libFuzzer said stays in build/fuzz/TARGET.log."""
    log, began = WORK / f"{name}.log", time.monotonic()
    child = os.fork()
    if child == 0:
        with log.open("wb") as said:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
        run(atheris, targets, name, seconds)
        os._exit(1)  # Fuzz does not return
    _, status = os.waitpid(child, 0)
    text = log.read_text("utf-8", "replace")
    inputs = re.search(r"number_of_executed_units: (\d+)", text)
    took, sound = time.monotonic() - began, status == 0
    count = int(inputs[1]) if inputs else 0
    ended = "sound" if sound else f"BROKEN: {log.relative_to(ROOT)}"
    print(f"{name:10} {count:>12,} inputs {took:7.0f} s  {ended}", flush=True)
    return sound


def compared(seconds: float, first: int) -> bool:
    """Whether Lua says the same as Python of the captures of these seeds."""
    from tests.fuzz import differential

    (WORK / "faults").mkdir(exist_ok=True)
    made, different = differential.run(seconds, first, WORK / "faults")
    ended = "sound" if not different else f"DIFFERENT: {', '.join(map(str, different))}"
    print(f"{LUA:10} {made:>12,} inputs {seconds:7.0f} s  {ended}", flush=True)
    return not different


def main() -> int:
    """Runs it; 1 where a target breaks."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("targets", nargs="*", help="all of them without")
    parser.add_argument("--minutes", type=float, default=1, help="in all, but for 10 s of start")
    parser.add_argument(
        "--seed", type=int, default=time.time_ns() // 10**6, help="the first one of lua"
    )
    given = parser.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    sys.path.append(str(WORK / "lib"))
    import atheris

    with (WORK / "start.log").open("w") as log:  # each module that it instruments is a line
        before, sys.stderr = sys.stderr, log
        try:
            with atheris.instrument_imports(include=["ds47"]):
                from tests.fuzz import targets

                for name in targets.TARGETS:  # what commands and formats import late
                    for seed in list(targets.SEEDS[name]())[-20:]:
                        targets.TARGETS[name](seed)
        finally:
            sys.stderr = before
    known = [*targets.TARGETS, LUA]
    names = given.targets or list(targets.TARGETS)
    if unknown := set(names) - set(known):
        parser.error(f"{', '.join(sorted(unknown))}: none of {', '.join(known)}")
    seconds = max(1, round(given.minutes * 60 / len(names)))
    found = [
        compared(seconds, given.seed)
        if name == LUA
        else in_a_child(atheris, targets, name, seconds)
        for name in names
    ]
    return 0 if all(found) else 1


if __name__ == "__main__":
    sys.exit(main())
