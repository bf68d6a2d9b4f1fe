"""What each format of the report costs on nothing but record calls, beside tshark and an earlier version.

Two captures: many drives, written by the lab (make_dense), and one drive, written by a generator that
shares no code with it (make_one_ar). Each version is installed plain and, where that is possible,
compiled; all of them and `tshark -T fields` take turns. --against names a commit of this repository.
CPU time counts, less that of a bare interpreter; the best of the runs, because whatever else the machine
does only adds to it. It prints tables and writes nothing.
Not a test: it fails where a program fails, not where it is slow. POSIX only (wait4).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import run

FORMATS = ("json", "csv", "ndjson", "text", "html")
CAPTURES = {
    "16 drives": ("make_dense.py", "dense-{}.pcapng"),
    "one AR": ("make_one_ar.py", "one_ar-{}.pcap"),
}
TSHARK = "tshark -T fields"
BARE = "python -c pass"


def sources(commit: str) -> Path:
    """The files of an earlier version, beside the checkout."""
    target = run.ROOT / "build" / "bench" / f"source-{commit}"
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    archive = target.with_suffix(".tar")
    command = ["git", "-C", str(run.ROOT), "archive", "-o", str(archive), commit]
    subprocess.run(command, check=True)
    with tarfile.open(archive) as file:
        file.extractall(target, filter="data")
    archive.unlink()
    return target


def versions(against: str | None, kinds: list[str]) -> dict[str, Path]:
    """Where each version is installed, by the name it has in the table."""
    found = {f"now, {kind}": run.installed(kind) for kind in kinds}
    if against:
        source = sources(against)
        for kind in kinds:
            found[f"{against}, {kind}"] = run.installed(kind, source, f"{against}-{kind}")
    return found


def rows(capture: Path, packages: dict[str, Path]) -> list[run.Row]:
    """What runs on a capture."""
    found = [run.Row(BARE, [sys.executable, "-c", "pass"])]
    for name, package in packages.items():
        for format_ in FORMATS:
            command = [sys.executable, "-m", "ds47", "report", "-f", format_, "-o", "/dev/null"]
            command.append(str(capture))
            found.append(run.Row(f"{format_} {name}", command, ours=True, package=package))
    if tshark := shutil.which("tshark"):
        found.append(run.Row(TSHARK, [tshark, "-n", "-r", str(capture), *run.FIELDS]))
    return found


def measure(capture: Path, packages: dict[str, Path], times: int) -> dict[str, float]:
    """CPU seconds of each row, the best of all its runs."""
    best: dict[str, float] = {}
    for number in range(times):
        for row in rows(capture, packages):
            print(f"  {number + 1}/{times} {row.name}        ", end="\r", file=sys.stderr)
            seconds = run.once(row).cpu
            best[row.name] = min(seconds, best.get(row.name, seconds))
    bare = best.pop(BARE)
    return {name: seconds - (0 if name == TSHARK else bare) for name, seconds in best.items()}


def table(title: str, result: dict[str, float], packages: dict[str, Path]) -> str:
    """The seconds, a line for each format, and what they are to tshark's."""
    tshark = result.get(TSHARK)
    said = f"; {TSHARK}: {tshark:.2f} s" if tshark else ""
    lines = [f"{title}{said}", "", "| report | " + " | ".join(packages) + " |"]
    lines.append("|---|" + "--:|" * len(packages))
    for format_ in FORMATS:
        cells = []
        for name in packages:
            seconds = result[f"{format_} {name}"]
            cells.append(f"{seconds:.2f}" + (f" ({tshark / seconds:.1f} x)" if tshark else ""))
        lines.append(f"| {format_} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--small",
        action="store_true",
        help="a tenth of the frames, nothing compiled",
    )
    parser.add_argument(
        "--trial", action="store_true", help="a tenth of --small, to see that it runs"
    )
    parser.add_argument("-n", type=int, default=3, help="runs of each (default 3)")
    parser.add_argument("--against", metavar="COMMIT", help="an earlier version, side by side")
    arguments = parser.parse_args()
    arguments.small |= arguments.trial
    run.DATA.mkdir(exist_ok=True)
    frames = 2_000 if arguments.trial else 20_000 if arguments.small else 200_000
    kinds = ["plain"] if arguments.small else ["plain", "compiled"]
    packages = versions(arguments.against, kinds)
    print(
        f"CPU seconds, the best of {arguments.n} runs side by side; in brackets how many times as fast "
        f"as `{TSHARK}`.\n"
    )
    for name, (maker, file) in CAPTURES.items():
        capture = run.made(file.format(frames), maker, frames)
        result = measure(capture, packages, arguments.n)
        print(table(f"{frames:,} record frames, {name}", result, packages) + "\n", flush=True)


if __name__ == "__main__":
    main()
