#!/usr/bin/env python3
"""Looks whether what a release consists of is whole: sizes, versions, checksums, and that each file works.

    python tools/release/check_release.py [FOLDER] [PYTHON...]        (part of make release)

Wheels are installed, each into an environment of its own and from the wheelhouse alone, and check a capture; the
source archive is built; the plugin is loaded by a Lua. A wheel for a Python that is not here, or not named, is
only weighed, and that is said. Not here: whether it works where nothing else is (try_release.py).
Exit status: 0 all is well; 1 something is not, with a line that says what.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import make_wheels
import pins

MOST = {
    "ds47.html": 15_000_000, "ds47.pyz": 4_000_000, "ds47-*.lua": 2_000_000, "ds47-*-wheelhouse.zip": 40_000_000,
    "ds47-*-none-any.whl": 3_000_000, "ds47-*-cp*.whl": 8_000_000, "ds47-*.tar.gz": 8_000_000,
    "ds47-*.cdx.json": 100_000, "SHA256SUMS": 10_000,
}  # fmt: skip
"""All that a release consists of, with the bytes that each may have at most; of wheels there may be several."""
SUMS, SIGNATURE = "SHA256SUMS", "SHA256SUMS.sig"
NAMESPACE = "ds47-release"
"""What a signature is for: one of the same key for something else is none."""
CAPTURE = pins.ROOT / "captures" / "tour-machine.pcapng"
Said = Callable[[str], None]


def run(*command: str | Path, **more: str) -> str:
    """What a command prints. SystemExit where it fails."""
    clean = {
        name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "PYTHON"))
    }
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, env={**clean, **more}, cwd=tempfile.gettempdir()
    )  # fmt: skip
    if done.returncode:
        sys.exit(
            f"{' '.join(map(str, command))}\nexit status {done.returncode}\n{done.stdout}{done.stderr}"
        )
    return done.stdout


def weigh(folder: Path) -> None:
    """Every file is known, none is missing, each has its size. SystemExit with what is wrong."""
    known = {path for pattern in (*MOST, SIGNATURE) for path in folder.glob(pattern)}
    others = {path.name for path in folder.iterdir()} - {path.name for path in known}
    if others:
        sys.exit(f"{folder}: {', '.join(sorted(others))} belongs to no release")
    for pattern, most in MOST.items():
        found = [*folder.glob(pattern)]
        if not found or (len(found) > 1 and not pattern.endswith("-cp*.whl")):
            sys.exit(f"{folder}: {len(found)} files {pattern}")
        for path in found:
            if not most // 1000 <= path.stat().st_size <= most:
                sys.exit(f"{path} has {path.stat().st_size} bytes; it may have {most}")


def sums(folder: Path) -> None:
    """The checksums are those of the files, of all of them; so is their signature, where there is one."""
    listed = dict(
        reversed(line.split("  ")) for line in (folder / SUMS).read_text("utf-8").splitlines()
    )
    for path in folder.iterdir():
        if path.name not in (SUMS, SIGNATURE):
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
            if listed.pop(path.name, None) != digest:
                sys.exit(f"{path} is not what SHA256SUMS says")
    if listed:
        sys.exit(f"{folder}: {', '.join(sorted(listed))} is listed in SHA256SUMS and not there")
    if (folder / SIGNATURE).exists():
        verify = [
            "ssh-keygen",
            "-Y",
            "check-novalidate",
            "-n",
            NAMESPACE,
            "-s",
            str(folder / SIGNATURE),
        ]
        with (folder / SUMS).open("rb") as signed:
            if subprocess.run(verify, stdin=signed, capture_output=True).returncode:
                sys.exit(f"{folder / SIGNATURE} is no signature of SHA256SUMS")


def versions(folder: Path) -> None:
    """Names and contents have the version of this checkout."""
    version = pins.version()
    for path in folder.glob("ds47-*"):
        if not path.name.startswith((f"ds47-{version}", f"ds47-{version.replace('.', '_')}.")):
            sys.exit(f"{path} is not of version {version}")
    pyz = run(sys.executable, "-I", "-S", folder / "ds47.pyz", "--version").split()
    bill = json.loads(next(folder.glob("*.cdx.json")).read_text("utf-8"))
    page = (folder / "ds47.html").read_text("utf-8")[
        :200_000
    ]  # its head, in which the version stands once
    told = {
        "ds47.pyz": pyz[1],
        "ds47.html": ", ".join(re.findall(r">(\d+\.\d+\.\d+(?:\.dev\d+)?)</span>", page)),
        "bill of materials": bill["metadata"]["component"]["version"],
    }
    for name, found in told.items():
        if found != version:
            sys.exit(f"{name} says version {found}, not {version}")
    if len(bill["components"]) < 5:
        sys.exit("the bill of materials lists too little")


def wheels(folder: Path, programs: list[str], say: Said) -> None:
    """Each wheel installs from the wheelhouse, without an index, and checks a capture."""
    by_series = {make_wheels.series(each): each for each in (*reversed(programs), sys.executable)}
    with tempfile.TemporaryDirectory(prefix="ds47-check-") as scratch:
        (house,) = folder.glob("*-wheelhouse.zip")
        zipfile.ZipFile(house).extractall(scratch)
        libraries = Path(scratch, house.stem, "wheels")
        for path in sorted(folder.glob("*.whl")):
            tag = re.search(r"-cp3(\d+)-", path.name)
            program = by_series.get(f"3.{tag[1]}") if tag else sys.executable
            if program is None:
                say(f"{path.name}: not installed, no Python of that version was named")
                continue
            place = Path(scratch, path.stem)
            run(program, "-m", "venv", place)
            python = place / ("Scripts" if os.name == "nt" else "bin") / "python"
            install = [
                python,
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--no-index",
            ]
            run(*install, "--find-links", libraries, path)
            compiled = run(
                python, "-c", "from ds47.capture import scan; print(scan.COMPILED)"
            ).strip()
            if compiled != str(bool(tag)):
                sys.exit(f"{path.name}: compiled is {compiled}")
            if run(python, "-m", "ds47", "--version").split()[1] != pins.version():
                sys.exit(f"{path.name} says another version")
            run(python, "-m", "ds47", "check", CAPTURE)
            say(f"{path.name}: installed, checks a capture")


def sources(folder: Path) -> None:
    """The archive builds, with nothing of this checkout, a wheel that has the files of the pure one."""
    (archive,), (pure,) = folder.glob("*.tar.gz"), folder.glob("*-none-any.whl")
    with tempfile.TemporaryDirectory(prefix="ds47-check-") as scratch:
        build = [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "--quiet",
            "--no-index",
            "--no-deps",
            "--no-build-isolation",
        ]
        run(*build, "--wheel-dir", scratch, archive, DS47_COMPILE="0")
        (made,) = Path(scratch).glob("*.whl")
        one, two = (set(zipfile.ZipFile(path).namelist()) for path in (made, pure))
    if one != two:
        sys.exit(f"{archive.name} builds another wheel: {', '.join(sorted(one ^ two)[:5])}")


def plugin(folder: Path, say: Said) -> None:
    """The plugin is Lua that can be loaded."""
    (path,) = folder.glob("*.lua")
    if f'"{pins.version()}"' not in path.read_text("utf-8"):
        sys.exit(f"{path} does not name version {pins.version()}")
    for program in filter(shutil.which, ("lua5.2", "lua5.3", "lua5.4")):
        run(program, "-e", f"assert(loadfile({json.dumps(str(path))}))")
        say(f"{path.name}: {program} takes it")


def check(folder: Path, programs: list[str], say: Said = print) -> None:
    """All of the above."""
    weigh(folder)
    sums(folder)
    versions(folder)
    plugin(folder, say)
    sources(folder)
    wheels(folder, programs, say)


def main() -> int:
    check(Path(sys.argv[1]) if len(sys.argv) > 1 else pins.ROOT / "dist", sys.argv[2:])
    return 0


if __name__ == "__main__":
    sys.exit(main())
