#!/usr/bin/env python3
"""Writes wheels with compiled parts into dist/: of this Python, and of others that are named.

    python tools/release/make_wheels.py [FOLDER] [PYTHON...]        (make release WITH="python3.12 python3.13")

On Linux auditwheel gives each the oldest manylinux tag that what it needs of the system allows; where it cannot,
the wheel keeps the tag of this machine, and that is said. Compilers and tools are those of constraints.txt and
manylinux.txt, checked by hash. A wheel takes some minutes.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pins

BUILDERS = (
    "hatchling", "packaging", "pathspec", "pluggy", "trove-classifiers", "cython", "mypy", "mypy-extensions",
    "typing-extensions", "librt", "ast-serialize", "setuptools",
)  # fmt: skip
"""hatchling and the compilers of hatch_build.py, with what they need."""
TOOLS = Path(__file__).with_name("manylinux.txt")


def series(program: str) -> str:
    """Such as `3.12`."""
    told = "import sys; print('%d.%d' % sys.version_info[:2])"
    return subprocess.run(
        [program, "-c", told], stdout=subprocess.PIPE, text=True, check=True
    ).stdout.strip()


def environment(folder: Path, program: str, wanted: str) -> Path:
    """The Python of a virtual environment with what a list of requirements names, made anew where that changed."""
    python = folder / "bin" / "python"
    kept = folder / "requirements.txt"
    if not kept.exists() or kept.read_text("utf-8") != wanted:
        subprocess.run([program, "-m", "venv", "--clear", str(folder)], check=True)
        draft = folder / "requirements.part"
        draft.write_text(wanted, "utf-8")
        install = [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--no-deps",
        ]
        subprocess.run(
            [*install, "--require-hashes", "--only-binary", ":all:", "-r", str(draft)], check=True
        )
        draft.replace(kept)
    return python


def built(program: str) -> Path:
    """The wheel of this checkout, compiled for a Python."""
    version = series(program)
    python = Path(program)
    if program != sys.executable:
        lines = pins.lines(
            BUILDERS, python_version=version, python_full_version=f"{version}.0", sys_platform=sys.platform
        )  # fmt: skip
        python = environment(pins.BUILD / f"python-{version}", program, "\n".join(lines) + "\n")
    folder = pins.BUILD / f"compiled-{version}"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(
        pins.building(python, folder), check=True, cwd=pins.ROOT, env={**os.environ, "DS47_COMPILE": "1"}
    )  # fmt: skip
    return pins.wheel(folder, "ds47")


def repaired(wheel: Path, folder: Path) -> Path:
    """A copy in `folder`, with a tag that other distributions take where that can be."""
    if sys.platform == "linux":
        python = environment(pins.BUILD / "auditwheel", sys.executable, TOOLS.read_text("utf-8"))
        work = pins.BUILD / "repaired"
        shutil.rmtree(work, ignore_errors=True)
        path = {**os.environ, "PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
        command = [str(python), "-m", "auditwheel", "repair", "--wheel-dir", str(work), str(wheel)]
        done = subprocess.run(command, env=path, capture_output=True, text=True)
        if done.returncode == 0:
            wheel = pins.wheel(work, "ds47")
        else:
            last = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            print(f"{wheel.name} keeps its tag: {last}", file=sys.stderr)
    return Path(shutil.copy(wheel, folder / wheel.name))


def make(folder: Path, programs: list[str]) -> list[Path]:
    """The wheels, of this Python first."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for program in (sys.executable, *programs):
        made.append(repaired(built(program), folder))
        print(f"{made[-1]}: {made[-1].stat().st_size // 1024} KiB", flush=True)
    return made


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else pins.ROOT / "dist"
    make(folder, sys.argv[2:])
    return 0


if __name__ == "__main__":
    sys.exit(main())
