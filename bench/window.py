"""What the plugin costs while a capture is loaded in the window of Wireshark.

Wireshark is started on a display of its own (Xvfb), with the plugin and the profile DS47, and without
either. What counts is its processor time until that is flat, less what a file of one frame takes. Not
here: which captures, and tshark (plugin.py). Linux only (/proc).
"""

from __future__ import annotations

import os
import shutil
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("Xvfb", "tshark")
TICKS = os.sysconf("SC_CLK_TCK")
LOOK_S, FLAT_S, LONGEST_S = 0.5, 3.0, 600.0
IDLE_S = 0.06
"""Processor time that an idle window takes in FLAT_S: it blinks."""
NAME = "DS47"


@contextmanager
def running(command: list[str], **options: object) -> Iterator[subprocess.Popen[bytes]]:
    """A process in a group of its own, which is ended afterwards."""
    quiet = {
        "stdin": subprocess.DEVNULL,
        "stdout": subprocess.DEVNULL,
        "stderr": subprocess.DEVNULL,
    }
    process = subprocess.Popen(command, start_new_session=True, **(quiet | options))  # type: ignore[call-overload]
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@contextmanager
def display() -> Iterator[str]:
    """The name of a display that nobody sees."""
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "1600x1000x24", "-nolisten", "tcp"]
    with running(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        yield ":" + process.stdout.readline().decode().strip()
        process.stdout.close()


def used(pid: int) -> float:
    """Processor seconds of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def seconds(command: list[str], environment: dict[str, str]) -> float:
    """Processor seconds of Wireshark until they are flat; SystemExit where it ends by itself or never rests."""
    with running(command, env=environment) as process:
        seen: list[float] = []
        span, end = round(FLAT_S / LOOK_S), time.monotonic() + LONGEST_S
        while len(seen) <= 2 * span or seen[-1] - seen[-1 - span] > IDLE_S:
            time.sleep(LOOK_S)
            if process.poll() is not None or time.monotonic() > end:
                raise SystemExit(
                    f"{' '.join(command)}: ended ({process.returncode}) or never rested"
                )
            seen.append(used(process.pid))
        return seen[-1]


def measure(
    program: str, captures: dict[str, Path], plugin: Path, profile: Path, turns: int
) -> None:
    """Prints the medians, without the plugin and with it, of each capture (title -> file).

    As root, Wireshark 4.4 and later load no plugin: then the program is a wrapper that goes on as another user.
    """
    missing = [each for each in (*PROGRAMS, program) if not shutil.which(each)]
    if missing:
        print(f"No {', '.join(missing)}: loading in the window is not measured")
        return
    with tempfile.TemporaryDirectory() as home, display() as name:
        shutil.copytree(profile, Path(home, "wireshark", "profiles", NAME))
        environment = os.environ | {
            "HOME": home, "XDG_CONFIG_HOME": home, "XDG_RUNTIME_DIR": home, "DISPLAY": name,
            "QT_QPA_PLATFORM": "xcb", "LC_ALL": "C.UTF-8",
        }  # fmt: skip
        plain = [program, "-n"]
        if program == "wireshark":  # as root, where 4.0 would ask
            plain += ["-o", "privs.warn_if_elevated:FALSE"]
        loaded = [*plain, "-C", NAME, "-X", f"lua_script:{plugin}"]
        print(f"CPU seconds of {program}, median of {turns}")
        print(f"{'capture':<34}{'without':>9}{'with':>9}{'ratio':>8}")
        for title, capture in captures.items():
            first = Path(home, "first.pcapng")
            subprocess.run(
                ["tshark", "-r", capture, "-c", "1", "-w", first], check=True, capture_output=True
            )
            costs: list[list[float]] = [[], []]
            for _ in range(turns):
                for cost, command in zip(costs, (plain, loaded), strict=True):
                    whole = seconds([*command, "-r", str(capture)], environment)
                    cost.append(whole - seconds([*command, "-r", str(first)], environment))
            without, including = map(statistics.median, costs)
            print(
                f"{title:<34}{without:>9.2f}{including:>9.2f}{including / without:>8.2f}",
                flush=True,
            )
