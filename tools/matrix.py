"""Run the plugin's tests on every Wireshark that people have, and the pure Lua ones on plain Lua.

Wireshark: tests/python/test_wireshark_*.py once for each tshark that tools/wireshark-roots.sh
provides, named to the tests by DS47_TSHARK, but for those in which no line of the plugin runs.
Plain Lua: tests/python/test_lua_*.py, which run each of lua5.2, lua5.3 and lua5.4 themselves.
Prints a table; fails when a test does.
Without root other tsharks cannot be made: that part is skipped and says so, and with --must fails.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "tests" / "python"
WORK = ROOT / "build" / "matrix"
"""Inside the checkout, where an ordinary user's tshark finds what a test wrote."""
LUAS = ("lua5.2", "lua5.3", "lua5.4")
WITHOUT_PLUGIN = ("test_wireshark_fields.py", "test_wireshark_s7.py")
"""The reader of PDML, and tshark's own S7: the plain test run has them, with this machine's tshark."""
CANNOT = 77
"""Exit status of tools/wireshark-roots.sh where no root can be made at all."""


@dataclass(frozen=True, slots=True)
class Tshark:
    """A line of tools/wireshark-roots.sh: series 4.4, version 4.4.18, its Lua, the program."""

    series: str
    version: str
    lua: str
    program: str


@dataclass(frozen=True, slots=True)
class Job:
    """Tests to run: their name in the table, the test files, the tshark for them, and its part of the captures."""

    name: str
    lua: str
    pattern: str
    tshark: str | None = None
    share: str = "0/1"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What pytest counted, how long it took, and what it printed."""

    passed: int
    failed: int
    skipped: int
    seconds: float
    output: str

    @property
    def good(self) -> bool:
        """Whether something passed and nothing failed."""
        return self.failed == 0 and self.passed > 0


def read_tsharks(lines: str) -> list[Tshark]:
    """The output of tools/wireshark-roots.sh."""
    return [Tshark(*line.split(maxsplit=3)) for line in lines.splitlines()]


def provide(series: list[str]) -> tuple[list[Tshark], int]:
    """The tsharks of this machine, made where needed, and the tool's exit status."""
    run = subprocess.run(
        [ROOT / "tools" / "wireshark-roots.sh", *series], stdout=subprocess.PIPE, text=True
    )
    return read_tsharks(run.stdout), run.returncode


def lua_versions() -> str:
    """The exact versions of the plain Lua interpreters, or what is missing."""
    found = []
    for name in LUAS:
        program = shutil.which(name)
        if program is None:
            found.append(f"({name} is missing)")
            continue
        run = subprocess.run([program, "-v"], capture_output=True, text=True)
        version = re.search(r"Lua (\S+)", run.stdout + run.stderr)
        found.append(version[1] if version else "?")
    return ", ".join(found)


def read_counts(report: Path) -> tuple[int, int, int]:
    """Tests, failures with errors, skips: from a JUnit file; zeroes where there is none."""
    if not report.exists():
        return 0, 0, 0
    suite = next(ElementTree.parse(report).getroot().iter("testsuite"))
    numbers = {name: int(value) for name, value in suite.items() if value.isdigit()}
    return numbers["tests"], numbers["failures"] + numbers["errors"], numbers["skipped"]


def run(job: Job, arguments: list[str]) -> Outcome:
    """Run the tests of a job in a process and a scratch folder of their own."""
    place = WORK / re.sub(r"\W+", "-", job.name)
    place.mkdir(parents=True, exist_ok=True)
    report = place / "junit.xml"
    report.unlink(missing_ok=True)
    files = sorted(path for path in TESTS.glob(job.pattern) if path.name not in WITHOUT_PLUGIN)
    environment = os.environ | {"DS47_SHARE": job.share}
    environment |= {"DS47_TSHARK": job.tshark} if job.tshark else {}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    command += [f"--basetemp={place / 'tmp'}", f"--junitxml={report}", *arguments, *map(str, files)]
    start = time.monotonic()
    if files:
        done = subprocess.run(
            command,
            cwd=ROOT,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        output, crashed = done.stdout, done.returncode not in (0, 1)
    else:
        output, crashed = f"there is no {job.pattern}\n", True
    tests, failed, skipped = read_counts(report)
    passed = max(0, tests - failed - skipped)
    failed = max(failed, int(crashed))
    return Outcome(passed, failed, skipped, time.monotonic() - start, output)


def table(rows: list[tuple[Job, Outcome]]) -> str:
    """The outcomes as text, one line per job."""
    lines = [f"{'':<16}{'Lua':<22}{'passed':>8}{'failed':>8}{'skipped':>9}{'seconds':>9}"]
    for job, outcome in rows:
        counts = f"{outcome.passed:>8}{outcome.failed:>8}{outcome.skipped:>9}"
        lines.append(f"{job.name:<16}{job.lua:<22}{counts}{outcome.seconds:>9.1f}")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("suites", nargs="*", help="Debian suites instead of all, e.g. trixie")
    parser.add_argument(
        "--must", action="store_true", help="fail where other tsharks cannot be made"
    )
    parser.add_argument(
        "--others",
        action="store_true",
        help="leave out what the plain test run covers: this machine's own tshark, plain Lua, tests marked own;"
        " of tests made for many captures by name each tshark has one part",
    )
    parser.add_argument("--jobs", type=int, default=4, help="at once")
    parser.add_argument("--pytest", action="append", default=[], help="an argument for pytest")
    arguments = parser.parse_args()

    tsharks, status = provide(arguments.suites)
    if arguments.others:
        tsharks = [each for each in tsharks if Path(each.program).parent.name != "own"]
    parts = len(tsharks) if arguments.others else 1
    jobs = [
        Job(
            f"tshark {t.version}",
            t.lua,
            "test_wireshark_*.py",
            t.program,
            f"{number % parts}/{parts}",
        )
        for number, t in enumerate(tsharks)
    ]
    if not arguments.others:
        jobs.append(Job("plain Lua", lua_versions(), "test_lua_*.py"))
    with ThreadPoolExecutor(arguments.jobs) as pool:
        outcomes = list(pool.map(lambda job: run(job, arguments.pytest), jobs))
    rows = list(zip(jobs, outcomes, strict=True))

    for job, outcome in rows:
        if not outcome.good:
            print(f"-- {job.name}\n{outcome.output}")
    print(table(rows))
    bad = any(not outcome.good for outcome in outcomes)
    if status == CANNOT:
        print("tshark: skipped, the other versions are made only as root, on a Debian with apt")
        return 1 if arguments.must or bad else 0
    if status:
        print("tshark: not all versions of the matrix could be had, see above")
    return 1 if status or bad else 0


if __name__ == "__main__":
    sys.exit(main())
