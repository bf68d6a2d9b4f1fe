"""Wheels at the versions of constraints.txt, checked by hash; and ours, as pure Python.

Lives here: fetching what a release is put together from, once a version, into build/release/. Not here: putting it
together (`make_pyz`, `make_page`, `make_wheelhouse`).
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path

from packaging.markers import Marker

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build" / "release"
FIRST = {"python_version": "3.11", "python_full_version": "3.11.0"}
SYSTEMS = ({"sys_platform": "linux"}, {"sys_platform": "win32", "platform_system": "Windows"})


def lines(names: Iterable[str], **system: str) -> list[str]:
    """The lines of constraints.txt with these projects, hashes included and conditions left out.

    Args:
        names: the projects.
        system: for which one, as markers call it (`python_full_version`, `sys_platform`); for Python 3.11 on any
            system without: what runs there runs on the later ones, if it is pure Python.

    Raises KeyError for a project that such a system does not want.
    """
    found: dict[str, str] = {}
    for entry in re.split(r"\n(?=[a-z])", (ROOT / "constraints.txt").read_text("utf-8"))[1:]:
        head, hashes = entry.split(" \\\n", 1)
        pin, _, condition = head.partition(" ; ")
        if not condition or any(
            Marker(condition).evaluate({**FIRST, **each, **system}) for each in SYSTEMS
        ):
            found.setdefault(pin.partition("==")[0], f"{pin} \\\n{hashes}")
    return [found[name] for name in names]


def download(names: Sequence[str], folder: Path, *options: str) -> list[Path]:
    """The wheels of these projects in `folder`, nothing of what they need themselves.

    Args:
        names: the projects.
        folder: is made where it is missing; what is there already is not fetched again.
        options: of `pip download`, such as the platform.
    """
    pinned = dict(zip(names, lines(names), strict=True))
    missing = [name for name in names if not _held(folder, name, pinned[name])]
    if missing:
        _fetch(missing, folder, *options)
    return [_held(folder, name, pinned[name])[0] for name in names]


def _held(folder: Path, name: str, pinned: str) -> list[Path]:
    """The wheels of a project that are in a folder already and have one of the hashes that are pinned."""
    return [
        path
        for path in folder.glob(f"{name.replace('-', '_')}-*.whl")
        if hashlib.sha256(path.read_bytes()).hexdigest() in pinned
    ]


def _fetch(names: list[str], folder: Path, *options: str) -> None:
    """Lets pip download wheels. They come into the folder whole: others may be fetching them at the same time."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as work:
        wanted = Path(work) / "wanted.txt"
        wanted.write_text("\n".join(lines(names)) + "\n", "utf-8")
        command = [
            sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps",
            "--retries", "10", "--require-hashes", "--only-binary", ":all:", "--dest", work, *options,
            "-r", str(wanted),
        ]  # fmt: skip
        subprocess.run(command, check=True)
        for path in Path(work).glob("*.whl"):
            path.replace(folder / path.name)


def wheel(folder: Path, name: str) -> Path:
    """The newest wheel of a project in `folder`. Raises FileNotFoundError where none is there."""
    found = sorted(
        folder.glob(f"{name.replace('-', '_')}-*.whl"), key=lambda each: each.stat().st_mtime
    )
    if not found:
        raise FileNotFoundError(f"{folder}: no wheel of {name}")
    return found[-1]


def building(python: str | Path, folder: Path) -> list[str]:
    """The command that builds the wheel of this checkout into a folder."""
    return [
        str(python),
        "-m",
        "hatchling",
        "build",
        "--target",
        "wheel",
        "--directory",
        str(folder),
    ]


def own() -> Path:
    """Our wheel of this checkout, in which nothing is compiled: it runs wherever Python does."""
    folder = BUILD / "own"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(
        dir=folder
    ) as work:  # others may be building it at the same time
        done = subprocess.run(
            building(sys.executable, Path(work)), cwd=ROOT, capture_output=True, text=True,
            env={**os.environ, "DS47_COMPILE": "0"},
        )  # fmt: skip
        if done.returncode:
            sys.exit(f"the wheel was not built:\n{done.stderr}")
        built = wheel(Path(work), "ds47")
        return built.replace(folder / built.name)


def version() -> str:
    """That of this checkout."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    return str(project["version"])
