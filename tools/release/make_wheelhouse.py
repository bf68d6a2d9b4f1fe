#!/usr/bin/env python3
"""Writes what a computer without internet installs from: dist/ds47-VERSION-wheelhouse.zip.

    python tools/release/make_wheelhouse.py [FOLDER [WHEEL...]]        (make wheelhouse)

In it are our wheel (pure Python), those that are named (compiled ones, of which pip takes what fits), those of the
libraries for the systems and Pythons below, a list of them with their digests, the line that installs them, and a
description of a container that is built from the same files.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from pathlib import Path

import make_pyz
import pins

SOURCES = Path(__file__).resolve().parent
PURE = ("click", "jinja2", "openpyxl", "et-xmlfile", "tzdata")
COMPILED = {"markupsafe": (11, 12, 13, 14), "backports-zstd": (11, 12, 13)}
"""With the Pythons (3.n) that want them."""
SYSTEMS = {
    "linux": ("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64"),
    "win32": ("win_amd64",),
    "darwin": ("macosx_11_0_arm64", "macosx_12_0_arm64"),
}
CONDITIONS = {
    "tzdata": ' ; sys_platform == "win32"',
    "backports-zstd": ' ; python_version < "3.14"',
}


def wheels(compiled: list[Path]) -> Iterator[Path]:
    """All files, ours first."""
    yield pins.own()
    yield from compiled
    yield from pins.download(PURE, pins.BUILD / "wheels")
    for name, minors in COMPILED.items():
        for minor in minors:
            for system, platforms in SYSTEMS.items():
                folder = pins.BUILD / f"wheels-{system}-3.{minor}"
                options = [word for each in platforms for word in ("--platform", each)]
                options += ["--implementation", "cp", "--python-version", f"3.{minor}"]
                yield from pins.download([name], folder, *options)


def requirements(files: list[Path]) -> str:
    """Every project with its version and the digests of its files."""
    found: dict[str, list[str]] = {}
    for each in files:
        name, version = each.name.split("-")[:2]
        project = name.replace("_", "-").lower()
        line = f"{project}=={version}{CONDITIONS.get(project, '')}"
        found.setdefault(line, []).append(hashlib.sha256(each.read_bytes()).hexdigest())
    lines = (
        " \\\n".join([line, *(f"    --hash=sha256:{each}" for each in sorted(digests))])
        for line, digests in sorted(found.items())
    )
    return "\n".join(lines) + "\n"


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else pins.ROOT / "dist"
    files = list(wheels([Path(each) for each in sys.argv[2:]]))
    version = pins.version()
    top = f"ds47-{version}-wheelhouse"
    held = {f"{top}/wheels/{each.name}": each.read_bytes() for each in files}
    held[f"{top}/requirements.txt"] = requirements(files).encode()
    held[f"{top}/Containerfile"] = (SOURCES / "Containerfile").read_bytes()
    told = (SOURCES / "wheelhouse.txt").read_text("utf-8")
    held[f"{top}/README.txt"] = told.format(version=version).encode()
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{top}.zip"
    path.write_bytes(make_pyz.archive(held))
    print(f"{path}: {path.stat().st_size // 1024} KiB, {len(files)} wheels")
    return 0


if __name__ == "__main__":
    sys.exit(main())
