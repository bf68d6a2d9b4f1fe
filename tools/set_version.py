#!/usr/bin/env python3
"""Gives the checkout another version, everywhere where one is written.

    python tools/set_version.py 2.0.0            what is not released yet gets the version and today's date
    python tools/set_version.py 2.1.0.dev0       the version alone: work goes on under [Unreleased]

pyproject.toml, ds47/version.py, the stored results (which name the version that wrote them), file names in texts,
the changelog; then what is generated is made again: tables of Lua, manual pages, sample output. Afterwards: make
test, commit, tag vVERSION, .ci/release. tests/python/test_package.py holds the places together.
"""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GENERATED = ("make_tables.py", "make_man.py", "readme_report.py")
NAMED = (
    "Makefile",
    "docs/developers/development.md",
    "docs/wireshark.md",
    "tools/make_bundle.py",
    "dissector/ds47_ws/menu.lua",
)
"""Where the plugin as one file is called by its name."""
VERSION = re.compile(r"\d+\.\d+\.\d+(\.dev\d+)?")


def replace(path: Path, pattern: str, new: str) -> bool:
    """Replaces the one place of a pattern in a file; whether there was one that differed."""
    old = path.read_bytes()
    text = re.sub(pattern, new, old.decode("utf-8"), count=1, flags=re.MULTILINE).encode()
    if text == old:
        return False
    path.write_bytes(text)
    return True


def results() -> list[Path]:
    """The stored results of all captures."""
    return sorted((ROOT / "captures").rglob("*.ds47.json"))


def release(version: str, day: str) -> None:
    """What is unreleased in the changelog becomes this version. SystemExit where there is nothing."""
    path = ROOT / "CHANGELOG.md"
    if not replace(path, r"^## \[Unreleased\]$", f"## [{version}] - {day}"):
        sys.exit("CHANGELOG.md has nothing under [Unreleased]")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("version")
    version = parser.parse_args().version
    if not VERSION.fullmatch(version):
        sys.exit(f"{version} is no version such as 1.2.3 or 1.2.3.dev0")
    if ".dev" not in version:
        release(version, datetime.datetime.now(datetime.UTC).date().isoformat())
    replace(ROOT / "pyproject.toml", r'^version = ".*"$', f'version = "{version}"')
    replace(ROOT / "python/ds47/version.py", r'^__version__ = ".*"$', f'__version__ = "{version}"')
    tool = r'("tool": \{\s*"name": "ds47",\s*"version": ")[^"]+'
    changed = sum(replace(path, tool, rf"\g<1>{version}") for path in results())
    for name in NAMED:
        replace(
            ROOT / name, r"ds47-\d+_\d+_\d+(_dev\d+)?\.lua", f"ds47-{version.replace('.', '_')}.lua"
        )
    for name in GENERATED:
        subprocess.run([sys.executable, str(ROOT / "tools" / name)], check=True)
    print(f"{version}: {changed} of {len(results())} stored results")
    return 0


if __name__ == "__main__":
    sys.exit(main())
