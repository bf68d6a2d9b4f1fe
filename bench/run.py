"""Time whole processes side by side: ds47, tcpdump, tshark, pyshark and scapy on the same captures.

Makes the captures, installs ds47 twice beside the checkout (plain Python, and compiled where that is
possible), runs every program in turns so that a slow minute of the machine falls on all of them,
and prints the medians of wall time, CPU time and peak memory with the ratios of the targets. The
time of a bare interpreter stands in a row of its own and is taken off the rows of ds47 before
a ratio is made. The table of the full captures goes into docs/benchmarks.md.

Not a test: it judges no time, but fails where a program fails. POSIX only (wait4). pyshark and scapy
get a slice, and their times are scaled to the whole.
"""

from __future__ import annotations

import argparse
import gzip
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
DATA = HERE / "data"
PACKAGES = ROOT / "build" / "bench"
PLUGIN = ROOT / "dissector" / "ds47.lua"
DOCUMENT = ROOT / "docs" / "benchmarks.md"
BEGIN, END = "<!-- bench/run.py writes from here -->", "<!-- to here -->"

RPC = "(udp[8]=4 and (udp[36:4]=0x976cd111 or udp[36:4]=0x6c9711d1)) or (ip[6:2] & 0x3fff != 0)"
FILTER = f"{RPC} or (vlan and ({RPC} or (vlan and ({RPC}))))"
"""What of our predicate BPF can say (docs/protocol.md E.2); without the vlan arms tagged frames are lost."""
FIELDS = ["-Y", "pn_io.index", "-T", "fields", "-e", "frame.number"]
PLUGIN_FIELDS = ["-Y", "ds47", "-T", "fields", "-e", "frame.number", "-e", "ds47.pnu"]

JSON = ("-f", "json")
"""What ds47 writes, whatever the capture."""

PYSHARK = """
import sys, pyshark
capture = pyshark.FileCapture(sys.argv[1], display_filter="pn_io.index", keep_packets=False)
print(sum(1 for packet in capture))
"""
SCAPY = """
import sys
from scapy.all import PcapReader, UDP, bind_layers
from scapy.layers.dcerpc import DceRpc4
import scapy.contrib.pnio_rpc
bind_layers(UDP, DceRpc4, dport=34964)
bind_layers(UDP, DceRpc4, sport=34964)
with PcapReader(sys.argv[1]) as reader:
    print(sum(DceRpc4 in packet for packet in reader))
"""


@dataclass(frozen=True, slots=True)
class Run:
    """One process: seconds of wall and CPU time, peak resident memory in MiB."""

    wall: float
    cpu: float
    peak: float


@dataclass(frozen=True, slots=True)
class Row:
    """A program on a capture; `share` of the capture that it gets; `ours` is started by Python.

    A `slow` one runs once, all others as often as is asked for.
    """

    name: str
    command: list[str]
    share: float = 1.0
    ours: bool = False
    package: Path | None = None
    slow: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """A row should be `limit` times as fast as `other`; below 1 it may be slower."""

    row: str
    other: str
    limit: float


@dataclass(frozen=True, slots=True)
class Section:
    """A capture, what runs on it, what is expected."""

    title: str
    capture: Path
    rows: list[Row]
    targets: list[Target]


# Captures


def once(row: Row) -> Run:
    """Run a program with its output thrown away; SystemExit where it fails."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    if row.package is not None:
        environment["PYTHONPATH"] = str(row.package)
    start = time.perf_counter()
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(
            row.command, stdout=subprocess.DEVNULL, stderr=complaints, env=environment
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            complaints.seek(0)
            said = complaints.read().decode(errors="replace")
            raise SystemExit(f"{row.name}: {row.command[0]} failed ({process.returncode}): {said}")
    unit = 1024 * 1024 if sys.platform == "darwin" else 1024
    return Run(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / unit)


def made(name: str, maker: str, frames: int, *options: str) -> Path:
    """A capture of bench/data, written by a process of its own: a child's peak begins with its parent's."""
    path = DATA / name
    if not path.exists():
        part = path.with_name(f"part-{name}")
        command = [sys.executable, str(HERE / maker), str(part), "--frames", str(frames), *options]
        once(Row(maker, command, package=ROOT / "python"))
        part.rename(path)
    return path


def packed(path: Path, suffix: str) -> Path:
    """The capture as .gz or .zst, at the usual level of the usual tool."""
    target = path.with_name(path.name + suffix)
    if target.exists():
        return target
    part = target.with_name(f"part-{target.name}")
    if suffix == ".gz":
        with path.open("rb") as source, gzip.open(part, "wb", compresslevel=6) as file:
            shutil.copyfileobj(source, file, 1 << 20)
    else:
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        with path.open("rb") as source, zstd.open(part, "wb") as file:
            shutil.copyfileobj(source, file, 1 << 20)
    part.rename(target)
    return target


# Programs


def installed(kind: str, source: Path = ROOT, name: str = "") -> Path:
    """The package as pip installs it, "plain" or "compiled", with its byte code."""
    target = PACKAGES / (name or kind)
    shutil.rmtree(target, ignore_errors=True)
    environment = os.environ | {"DS47_COMPILE": "0" if kind == "plain" else "1"}
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index",
               "--no-build-isolation", "--target", str(target), str(source)]  # fmt: skip
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
    subprocess.run([sys.executable, "-m", "compileall", "-q", str(target)], check=True)
    return target


def is_compiled(package: Path) -> bool:
    """Whether both compilers did their work."""
    code = "import ds47.capture.scan as s, ds47.acyclic.pairing as p; print(s.COMPILED, p.__file__[-3:])"
    environment = os.environ | {"PYTHONPATH": str(package)}
    said = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout
    return said.startswith("True ") and ".py" not in said


class Programs:
    """The rows for a capture, of what is there."""

    def __init__(self, packages: dict[str, Path]) -> None:
        self.packages = packages
        self.tcpdump = shutil.which("tcpdump")
        self.tshark = shutil.which("tshark")

    def ours(self, capture: Path, *options: str, name: str = "ds47") -> Iterator[Row]:
        """ds47 as each of the packages."""
        for kind, package in self.packages.items():
            label = f"{name} {kind}".replace(" plain", ", plain").replace(" comp", ", comp")
            command = [sys.executable, "-m", "ds47", "report", *options, str(capture)]
            yield Row(label, command, ours=True, package=package)

    def bare(self) -> Row:
        """What a Python process costs before it does anything."""
        return Row("python -c pass", [sys.executable, "-c", "pass"])

    def others(self, capture: Path, plugin: bool = True, slow: bool = False) -> Iterator[Row]:
        """Rows of tcpdump and tshark, as far as they are installed; `slow`: tshark is, on this one."""
        if self.tcpdump:
            command = [self.tcpdump, "-r", str(capture), "-w", os.devnull, FILTER]
            yield Row("tcpdump, BPF", command)
        if self.tshark:
            base = [self.tshark, "-n", "-r", str(capture)]
            yield Row("tshark -T fields", [*base, *FIELDS], slow=slow)
            if plugin and PLUGIN.exists():
                script = ["-X", f"lua_script:{PLUGIN}"]
                yield Row("tshark with the plugin", [*base, *script, *PLUGIN_FIELDS], slow=True)

    def slices(self, capture: Path, share: float) -> Iterator[Row]:
        """Rows of pyshark and scapy on the beginning of a capture, as far as they are installed."""
        for name, module, code in (("pyshark", "pyshark", PYSHARK), ("scapy", "scapy", SCAPY)):
            found = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True)
            if found.returncode == 0 and (self.tshark or name != "pyshark"):
                command = [sys.executable, "-c", code, str(capture)]
                yield Row(f"{name}, a slice", command, share, slow=True)


# Sections


def sections(programs: Programs, small: bool, trial: bool) -> list[Section]:
    """What is measured, small or whole."""
    frames, record_frames, slice_frames = (
        (100_000, 20_000, 800) if small else (1_000_000, 200_000, 4_000)
    )
    if trial:
        frames, record_frames, slice_frames = 10_000, 2_000, 80
    one = made(f"noise-{frames}.pcap", "make_noise.py", frames)
    dense = made(f"dense-{record_frames}.pcapng", "make_dense.py", record_frames)
    part = made(f"dense-{slice_frames}.pcapng", "make_dense.py", slice_frames)
    noise_targets = [
        Target("ds47, compiled", "tcpdump, BPF", 1 / 2.5),
        Target("ds47, compiled", "tshark -T fields", 40),
        Target("ds47, plain", "tshark -T fields", 15),
    ]
    found = [
        Section(f"{frames:,} frames of noise (pcap)", one,
                [programs.bare(), *programs.ours(one, *JSON), *programs.others(one)], noise_targets),
    ]  # fmt: skip
    if not small:
        ten = made("noise-10000000.pcap", "make_noise.py", 10_000_000)
        found.append(
            Section("10,000,000 frames of noise (pcap)", ten,
                    [programs.bare(), *programs.ours(ten, *JSON), *programs.others(ten, plugin=False, slow=True)],
                    [Target("ds47, compiled", "tcpdump, BPF", 1), *noise_targets[2:]])
        )  # fmt: skip
        ng = made(f"noise-{frames}.pcapng", "make_noise.py", frames)
        found.append(
            Section(f"{frames:,} frames of noise (pcapng)", ng,
                    [programs.bare(), *programs.ours(ng, *JSON), *programs.others(ng, plugin=False)],
                    noise_targets)
        )  # fmt: skip
        plant = made(f"mixed-{frames}.pcap", "make_noise.py", frames, "--mixed")
        found.append(
            Section(f"{frames:,} frames of many sizes, with other traffic (pcap)", plant,
                    [programs.bare(), *programs.ours(plant, *JSON), *programs.others(plant, plugin=False)],
                    [])
        )  # fmt: skip
    found.append(profibus(programs, frames, one))
    found.append(s7(programs, record_frames))
    rows = [
        programs.bare(), *programs.ours(dense, *JSON), *programs.others(dense),
        *programs.slices(part, slice_frames / record_frames),
    ]  # fmt: skip
    for suffix in (".gz", ".zst"):
        path = packed(dense, suffix)
        rows += programs.ours(path, *JSON, name=f"ds47 {suffix}")
    targets = [
        Target("ds47, compiled", "tshark -T fields", 6),
        Target("ds47, compiled", "pyshark, a slice", 100),
        Target("ds47, plain", "tshark -T fields", 2),
        *(Target(f"ds47 {s}, {k}", f"ds47, {k}", 1 / 1.5) for s in (".gz", ".zst") for k in programs.packages),
    ]  # fmt: skip
    found.append(Section(f"{record_frames:,} record frames (pcapng)", dense, rows, targets))
    return found


def profibus(programs: Programs, frames: int, noise: Path) -> Section:
    """Data exchange by PROFIBUS beside as many frames of noise: no other program here reads it."""
    bus = made(f"profibus-{frames}.pcap", "make_profibus.py", frames)
    return Section(
        f"{frames:,} frames of PROFIBUS, PPO1 in data exchange (pcap)", bus,
        [programs.bare(), *programs.ours(bus, *JSON), *programs.ours(noise, *JSON, name="noise")],
        [Target("ds47, plain", "noise, plain", 1 / 10), Target("ds47, compiled", "noise, plain", 1 / 3)],
    )  # fmt: skip


def s7(programs: Programs, frames: int) -> Section:
    """Jobs of S7 communication beside as many record frames: two frames are a job, four a transaction of DS47."""
    jobs = made(f"s7-{frames}.pcap", "make_s7.py", frames)
    records = made(f"one_ar-{frames}.pcap", "make_one_ar.py", frames)
    return Section(
        f"{frames:,} frames of S7, GET and PUT (pcap)", jobs,
        [programs.bare(), *programs.ours(jobs, *JSON), *programs.ours(records, *JSON, name="records")],
        [Target(f"ds47, {kind}", f"records, {kind}", 1) for kind in programs.packages],
    )  # fmt: skip


# Tables


def median(runs: list[Run]) -> Run:
    """The median of each number on its own."""
    return Run(*(statistics.median(getattr(run, name) for run in runs) for name in Run.__slots__))


def measure(section: Section, times: int) -> dict[str, Run]:
    """The medians of all rows, scaled to the whole capture."""
    runs: dict[str, list[Run]] = {row.name: [] for row in section.rows}
    for number in range(times):
        for row in section.rows:
            if not (row.slow and number):
                print(f"  {number + 1}/{times} {row.name}        ", end="\r", file=sys.stderr)
                runs[row.name].append(once(row))
    result = {name: median(each) for name, each in runs.items()}
    for row in section.rows:
        if row.share != 1:
            run = result[row.name]
            result[row.name] = Run(run.wall / row.share, run.cpu / row.share, run.peak)
    return result


def net(section: Section, result: dict[str, Run], name: str) -> float:
    """Wall time of a row; of ours without that of a bare interpreter."""
    ours = any(row.ours for row in section.rows if row.name == name)
    return max(1e-9, result[name].wall - (result["python -c pass"].wall if ours else 0))


HEAD = """\
| capture, JSON out | program | wall s | CPU s | peak MiB | ratio, target |
|---|---|--:|--:|--:|---|"""


def rows_of(section: Section, result: dict[str, Run]) -> list[str]:
    """The section as rows of the table, its title in the first of them."""
    title = f"{section.title}, {section.capture.stat().st_size / 1e6:,.0f} MB"
    lines = []
    for name, run in result.items():
        ratios = [
            judged(target, net(section, result, target.other) / net(section, result, name))
            for target in section.targets
            if target.row == name and target.other in result
        ]
        numbers = f"{run.wall:.3f} | {run.cpu:.3f} | {run.peak:.0f}"
        lines.append(f"| {title} | {name} | {numbers} | {'; '.join(ratios)} |")
        title = ""
    return lines


def judged(target: Target, ratio: float) -> str:
    """A ratio in words with what was wanted: how many times as fast, or as long."""
    missed = "" if ratio >= target.limit else "**missed**: "
    if target.limit >= 1:
        return f"{missed}{ratio:.1f} x as fast as {target.other} ({target.limit:.1f})"
    return f"{missed}{1 / ratio:.2f} x the time of {target.other} ({1 / target.limit:.2f})"


def machine(times: int) -> str:
    """Where and how it was measured."""
    cpu = next(
        (line.split(":")[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")),
        platform.processor() or "unknown processor",
    )  # fmt: skip
    tshark = (
        subprocess.run(["tshark", "-v"], capture_output=True, text=True).stdout
        if shutil.which("tshark")
        else ""
    )
    number = re.search(r"\d+\.\d+\.\d+", tshark)
    version = f"tshark {number[0]}" if number else "no tshark"
    load = f", load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else ""
    return (
        f"{os.cpu_count()} x {cpu}, Python {platform.python_version()}, {version}; "
        f"whole processes, warm page cache, median of {times} (scapy, pyshark, the plugin, and "
        f"tshark on ten million frames: one run){load}."
    )


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []


def write(text: str) -> None:
    """Put the table between the two marks of docs/benchmarks.md."""
    document = DOCUMENT.read_text(encoding="utf-8")
    before, rest = document.split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    DOCUMENT.write_text(
        f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8", newline="\n"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--small", action="store_true", help="small captures, for CI; writes nothing"
    )
    parser.add_argument(
        "--trial", action="store_true", help="a tenth of --small, to see that it runs"
    )
    parser.add_argument("-n", type=int, default=5, help="runs of each program (default 5)")
    parser.add_argument("--no-write", action="store_true", help="leave docs/benchmarks.md alone")
    arguments = parser.parse_args()
    arguments.small |= arguments.trial
    DATA.mkdir(exist_ok=True)
    packages: dict[str, Path] = {}
    checks: dict[str, Callable[[Path], bool]] = {"plain": lambda _: True, "compiled": is_compiled}
    for kind, check in checks.items():
        try:
            package = installed(kind)
        except subprocess.CalledProcessError:  # pip has said why
            print(f"{kind}: not there (no compiler, or no Cython and mypy)", file=sys.stderr)
            continue
        if check(package):
            packages[kind] = package
    lines = [HEAD]
    print(HEAD)
    for section in sections(Programs(packages), arguments.small, arguments.trial):
        found = rows_of(section, measure(section, arguments.n))
        print("\n".join(found), flush=True)
        lines += found
    where = machine(arguments.n)
    print("\n" + where)
    if not arguments.small and not arguments.no_write:
        write(where + "\n\n" + "\n".join(lines))


if __name__ == "__main__":
    main()
