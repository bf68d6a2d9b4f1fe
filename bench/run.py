"""Time whole processes on the benchmark's capture: `ds47 report`, tshark, a bare interpreter.

Prints the median of wall and CPU time and the peak memory of each command, and how many times
faster than tshark it is. Not a test: it asserts nothing about times, but fails where a command
fails. POSIX only (wait4).
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

DATA = Path(__file__).parent / "data"
FRAMES = 1_000_000
SMALL = 100_000
ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True, slots=True)
class Run:
    """One process: seconds of wall and CPU time, peak resident memory in MiB."""

    wall: float
    cpu: float
    peak: float


def once(command: list[str]) -> Run:
    """Run a command with its output thrown away; SystemExit where it fails."""
    paths = [str(ROOT / "python"), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    start = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment
    )
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode:
        raise SystemExit(f"{command[0]} failed ({process.returncode}): {complaint.decode()}")
    unit = 1024 * 1024 if sys.platform == "darwin" else 1024
    return Run(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / unit)


def make(capture: Path, frames: int) -> None:
    """Write the capture in a process of its own.

    A child starts with the memory of its parent, so this one must stay small for honest peaks.
    """
    whole = capture.with_suffix(".part")
    maker = Path(__file__).with_name("make_noise.py")
    once([sys.executable, str(maker), str(whole), "--frames", str(frames)])
    whole.rename(capture)


def median(runs: list[Run]) -> Run:
    """The median of each number on its own."""
    return Run(*(statistics.median(getattr(run, name) for run in runs) for name in Run.__slots__))


def commands(capture: Path) -> dict[str, list[str]]:
    """What is timed, by the name in the table."""
    report = [sys.executable, "-m", "ds47", "report", str(capture)]
    rows = {
        "python -c pass": [sys.executable, "-c", "pass"],
        "ds47 report": report,
        "ds47 report -f json": [*report, "-f", "json"],
    }
    tshark = shutil.which("tshark")
    if tshark:
        asked = ["-Y", "pn_io.index", "-T", "fields", "-e", "frame.number"]
        rows["tshark -Y pn_io.index -T fields"] = [tshark, "-r", str(capture), *asked]
    return rows


def table(results: dict[str, Run]) -> str:
    """The results as text, one line per command."""
    base = next((run for name, run in results.items() if name.startswith("tshark")), None)
    lines = [
        f"{'command':<34}{'wall s':>9}{'cpu s':>9}{'peak MiB':>10}{'x tshark':>10}{'cpu x':>8}"
    ]
    for name, run in results.items():
        ratios = f"{base.wall / run.wall:>10.1f}{base.cpu / run.cpu:>8.1f}" if base else ""
        lines.append(f"{name:<34}{run.wall:>9.3f}{run.cpu:>9.3f}{run.peak:>10.1f}{ratios}")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help=f"{SMALL} RT frames, for CI")
    parser.add_argument("--frames", type=int, help=f"RT frames (default {FRAMES})")
    parser.add_argument("-n", type=int, default=3, help="runs of each command (default 3)")
    arguments = parser.parse_args()
    frames = arguments.frames or (SMALL if arguments.small else FRAMES)
    capture = DATA / f"noise-{frames}.pcap"
    if not capture.exists():
        make(capture, frames)
    print(f"{capture.name}: {capture.stat().st_size / 1e6:.1f} MB, median of {arguments.n}")
    # In turns, so that a slow minute of the machine does not fall on one command alone.
    runs: dict[str, list[Run]] = {name: [] for name in commands(capture)}
    for _ in range(arguments.n):
        for name, command in commands(capture).items():
            runs[name].append(once(command))
    print(table({name: median(each) for name, each in runs.items()}))


if __name__ == "__main__":
    main()
