"""What the Wireshark plugin costs: the CPU time of tshark with it and without.

Three captures: cyclic RT frames with a few transactions among them (make_noise), and nothing but
record calls, of many drives by the lab (make_dense) and of one drive by a generator that shares no
code with it (make_one_ar). They are read as people read them (MODES): printed, with a filter on
one of our fields, printed with the columns of the profile, and in two passes. A filter that
matches nothing makes tshark dissect all and print nothing. Runs with and without take turns; the
medians are compared. Each tshark
under build/wireshark (`make matrix` puts them there) is measured, otherwise the one on the PATH.
The full captures give the table in docs/benchmarks.md. `--window` measures the loading of a file in the
window instead, with the profile, and writes nothing: see bench/window.py. `--operations` counts the
operations of Lua a frame (bench/operations.lua), which other work of the machine does not change.
Not a test: it fails where the plugin does not load or meets an error, not where it is slow. POSIX
only (wait4).
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import window

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
DATA = HERE / "data"
TSHARKS = ROOT / "build" / "wireshark"
PLUGIN = ROOT / "dissector" / "ds47.lua"
COUNTER = HERE / "operations.lua"
PROFILE = ROOT / "dissector" / "profile" / "preferences"
DOCUMENT = ROOT / "docs" / "benchmarks.md"
BEGIN, END = "<!-- bench/plugin.py writes from here -->", "<!-- the plugin: to here -->"
COMPLAINTS = ("Lua Error", "Error during loading")
"""tshark prints these and still exits with 0."""


@dataclass(frozen=True, slots=True)
class Mode:
    """How a capture is read: the arguments of tshark without the plugin and with it."""

    title: str
    without: tuple[str, ...]
    including: tuple[str, ...]


def columns() -> tuple[str, str]:
    """The option that gives tshark the columns of the profile."""
    text = (
        PROFILE.read_text(encoding="utf-8").partition("gui.column.format:")[2].partition("\n\n")[0]
    )
    return "-o", "gui.column.format:" + " ".join(text.split())


_TWO = ("-2", "-R", "frame", "-Y", "frame.number==1")
MODES = (
    Mode("print", (), ()),
    Mode("a filter on a field", ("-Y", "pn_io.index==9"), ("-Y", "ds47.pnu==65535")),
    Mode("print, columns of the profile", (), columns()),
    Mode("two passes", _TWO, _TWO),
)


@dataclass(frozen=True, slots=True)
class Load:
    """A capture to read."""

    title: str
    maker: str
    frames: int
    small: int

    def capture(self, small: bool) -> Path:
        """The capture, written by a process of its own where it is missing."""
        frames = self.small if small else self.frames
        suffix = ".pcapng" if self.maker == "make_dense" else ".pcap"
        path = DATA / f"{self.maker.removeprefix('make_')}-{frames}{suffix}"
        if not path.exists():
            part = path.with_suffix(".part")
            environment = os.environ | {"PYTHONPATH": str(ROOT / "python")}
            command = [sys.executable, HERE / f"{self.maker}.py", part, "--frames", str(frames)]
            subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
            part.rename(path)
        return path


LOADS = (
    Load("RT frames", "make_noise", 1_000_000, 100_000),
    Load("record frames, 16 drives", "make_dense", 100_000, 20_000),
    Load("record frames, one AR", "make_one_ar", 100_000, 20_000),
)


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds of one tshark on one capture, without the plugin and with it."""

    version: str
    capture: str
    mode: str
    without: float
    including: float

    @property
    def ratio(self) -> float:
        """How many times as long tshark takes with the plugin."""
        return self.including / self.without

    def line(self) -> str:
        """As it is printed."""
        times = f"{self.without:>9.2f}{self.including:>9.2f}{self.ratio:>8.2f}"
        return f"{self.version:<9}{self.capture:<34}{self.mode:<30}{times}"

    def cell(self) -> str:
        """As it stands in the document."""
        return f"{self.without:.2f} to {self.including:.2f} ({self.ratio:.1f})"


HEAD = f"| tshark | capture | {' | '.join(mode.title for mode in MODES)} |\n|---|---|{'--:|' * len(MODES)}"


def rows(costs: list[Cost]) -> Iterator[str]:
    """A row for each tshark and capture, a cell for each way of reading."""
    for (number, capture), group in groupby(costs, lambda cost: (cost.version, cost.capture)):
        yield f"| {number} | {capture} | {' | '.join(cost.cell() for cost in group)} |"


def write(costs: list[Cost], turns: int) -> None:
    """Put the table between the two marks of docs/benchmarks.md."""
    load = f", load {os.getloadavg()[0]:.1f} at the end"
    lines = [
        f"Processor seconds of tshark without the plugin and with it, in brackets their ratio; median of {turns}, "
        f"{os.cpu_count()} cores{load}.",
        "",
        HEAD,
        *rows(costs),
    ]
    document = DOCUMENT.read_text(encoding="utf-8")
    before, rest = document.split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    text = "\n".join([before + BEGIN, "", *lines, "", END + after])
    DOCUMENT.write_text(text, encoding="utf-8", newline="\n")


def tsharks(small: bool) -> list[str]:
    """The programs to measure, those of the matrix if there are any and not one alone is wanted."""
    found = sorted(str(path) for path in TSHARKS.glob("*/tshark"))
    own = [path for path in [shutil.which("tshark")] if path]
    return (own or found[:1]) if small else (found or own)


def version(program: str) -> tuple[int, ...]:
    """The version of a tshark; empty where it does not run."""
    run = subprocess.run([program, "-v"], capture_output=True, text=True, check=False)
    match = re.match(r"TShark \(Wireshark\) (\d+)\.(\d+)\.(\d+)", run.stdout)
    return tuple(map(int, match.groups())) if match else ()


def seconds(command: list[str], home: str) -> float:
    """User and system time of a run; SystemExit where it fails or Lua complains."""
    environment = os.environ | {"HOME": home, "XDG_CONFIG_HOME": home, "LC_ALL": "C.UTF-8"}
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment, text=True
    )
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode or any(text in complaint for text in COMPLAINTS):
        raise SystemExit(f"{' '.join(command)} failed ({process.returncode}): {complaint}")
    return usage.ru_utime + usage.ru_stime


def compare(program: str, capture: Path, mode: Mode, turns: int, home: str) -> tuple[float, float]:
    """Median seconds without and with the plugin, in turns."""
    common = [program, "-n", "-r", str(capture)]
    plain = [*common, *mode.without]
    loaded = [*common, "-X", f"lua_script:{PLUGIN}", *mode.including]
    without, including = [], []
    for _ in range(turns):
        without.append(seconds(plain, home))
        including.append(seconds(loaded, home))
    return statistics.median(without), statistics.median(including)


def operations(program: str, capture: Path, mode: Mode, home: str) -> int:
    """Operations of Lua while a capture is read with the plugin; SystemExit where none are told."""
    command = [program, "-n", "-r", str(capture), "-X", f"lua_script:{COUNTER}"]
    command += ["-X", f"lua_script1:{PLUGIN}", *mode.including]
    environment = os.environ | {"HOME": home, "XDG_CONFIG_HOME": home, "LC_ALL": "C.UTF-8"}
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=True)
    told = re.search(r"^operations: (\d+)$", run.stderr, re.MULTILINE)
    if told is None:
        raise SystemExit(f"{' '.join(command)} counted nothing: {run.stderr}")
    return int(told[1])


def print_operations(
    programs: dict[str, tuple[int, ...]], captures: dict[Load, Path], small: bool
) -> None:
    """A line for each program, capture and way of reading."""
    with tempfile.TemporaryDirectory() as home:
        Path(home).chmod(0o755)
        for program, number in sorted(programs.items(), key=lambda item: item[1]):
            for load, capture in captures.items():
                frames = load.small if small else load.frames
                for mode in MODES:
                    each = operations(program, capture, mode, home) / frames
                    name, title = ".".join(map(str, number)), f"{frames:,} {load.title}"
                    print(f"{name:<9}{title:<34}{mode.title:<30}{each:>9,.0f}", flush=True)


def loads_plugin(program: str, home: str) -> None:
    """SystemExit where this tshark does not know the plugin's protocol when it is told to load it."""
    capture = next((ROOT / "captures").glob("*.pcapng"))
    seconds([program, "-r", str(capture), "-X", f"lua_script:{PLUGIN}", "-Y", "ds47"], home)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--small", action="store_true",
        help="a tenth of the frames, and one tshark where none is named; for CI, writes nothing",
    )  # fmt: skip
    parser.add_argument(
        "--trial", action="store_true", help="a tenth of --small, to see that it runs"
    )
    parser.add_argument("-n", type=int, default=3, help="runs of each (default 3)")
    parser.add_argument(
        "--window", action="store_true", help="loading in the window instead; writes nothing"
    )
    parser.add_argument(
        "--operations",
        action="store_true",
        help="operations of Lua a frame instead; writes nothing",
    )
    parser.add_argument("--no-write", action="store_true", help="leave docs/benchmarks.md alone")
    parser.add_argument(
        "tshark", nargs="*", help="programs to measure instead of all; with --window a wireshark"
    )
    arguments = parser.parse_args()
    arguments.small |= arguments.trial
    loads = [replace(each, small=each.small // 10) if arguments.trial else each for each in LOADS]
    if arguments.window:
        captures = {load.title: load.capture(arguments.small) for load in loads}
        for program in arguments.tshark or ["wireshark"]:
            window.measure(program, captures, PLUGIN, PROFILE.parent, arguments.n)
        return
    programs = {
        program: version(program) for program in arguments.tshark or tsharks(arguments.small)
    }
    programs = {program: number for program, number in programs.items() if number}
    if not programs:
        print("No tshark: the cost of the plugin is not measured")
        return
    captures = {load: load.capture(arguments.small) for load in loads}
    if arguments.operations:
        print_operations(programs, captures, arguments.small)
        return
    print(f"CPU seconds of tshark, median of {arguments.n}")
    columns = f"{'without':>9}{'with':>9}{'ratio':>8}"
    print(f"{'tshark':<9}{'capture':<34}{'read with':<30}{columns}")
    costs = []
    with tempfile.TemporaryDirectory() as home:
        Path(home).chmod(0o755)
        for program, number in sorted(programs.items(), key=lambda item: item[1]):
            loads_plugin(program, home)
            for load, capture in captures.items():
                frames = load.small if arguments.small else load.frames
                name, title = ".".join(map(str, number)), f"{frames:,} {load.title}"
                for mode in MODES:
                    seconds_ = compare(program, capture, mode, arguments.n, home)
                    costs.append(Cost(name, title, mode.title, *seconds_))
                    print(costs[-1].line(), flush=True)
    if not arguments.small and not arguments.no_write:
        write(costs, arguments.n)


if __name__ == "__main__":
    main()
