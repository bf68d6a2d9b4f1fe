#!/usr/bin/env python3
"""Writes everything that a release consists of into dist/, with a bill of materials and checksums, and checks it.

    python tools/release/make_release.py [FOLDER] [PYTHON...]        (make release WITH="python3.12 python3.13")

The page, the file for Python, the wheelhouse, the plugin as one Lua file, the pure wheel, one that is compiled for
this Python and each that is named, and the source archive. What an earlier run left in the folder goes.
RELEASE_KEY names a key of OpenSSH, which then signs the checksums.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path
from typing import Any

import check_release
import make_page
import make_pyz
import make_wheels
import pins

HERE = Path(__file__).resolve().parent


def build(folder: Path, programs: list[str]) -> None:
    """All files but the bill and the checksums."""

    def make(tool: Path, *words: Path) -> None:
        subprocess.run([sys.executable, *map(str, (tool, folder, *words))], check=True)

    compiled = make_wheels.make(folder, programs)
    make(HERE / "make_pyz.py")
    make(HERE / "make_page.py")
    make(HERE / "make_wheelhouse.py", *compiled)
    make(pins.ROOT / "tools" / "make_bundle.py")
    pure = pins.own()
    (folder / pure.name).write_bytes(pure.read_bytes())
    command = [sys.executable, "-m", "hatchling", "build", "--directory", str(folder)]
    subprocess.run([*command, "--target", "sdist"], check=True, cwd=pins.ROOT)


def bill() -> dict[str, Any]:
    """The libraries in page, pyz and wheelhouse as CycloneDX 1.6."""
    wheels = pins.download((*make_pyz.LIBRARIES, "backports-zstd"), pins.BUILD / "wheels")
    parts = [_component(each) for each in wheels]
    parts.append({
        "type": "library", "name": make_page.PYODIDE, "version": make_page.VERSION,
        "purl": f"pkg:npm/{make_page.PYODIDE}@{make_page.VERSION}", "licenses": [{"expression": "MPL-2.0"}],
        "hashes": [],
    })  # fmt: skip
    return {
        "bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1,
        "metadata": {"component": {"type": "application", "name": "ds47", "version": pins.version()}},
        "components": sorted(parts, key=lambda each: str(each["name"])),
    }  # fmt: skip


def _component(wheel: Path) -> dict[str, Any]:
    with zipfile.ZipFile(wheel) as held:
        (name,) = (each for each in held.namelist() if each.endswith(".dist-info/METADATA"))
        told = Parser().parsestr(held.read(name).decode("utf-8"))
    licence = told["License-Expression"] or told["License"] or ""
    return {
        "type": "library", "name": told["Name"], "version": told["Version"],
        "purl": f"pkg:pypi/{told['Name'].lower()}@{told['Version']}",
        "licenses": [{"license": {"name": licence.splitlines()[0][:80]}}] if licence else [],
        "hashes": [{"alg": "SHA-256", "content": hashlib.sha256(wheel.read_bytes()).hexdigest()}],
    }  # fmt: skip


def seal(folder: Path, key: str | None) -> str:
    """Writes the checksums of all files, and signs them where there is a key; what there is now, in words."""
    files = sorted(each for each in folder.iterdir() if each.is_file())
    sums = (f"{hashlib.sha256(each.read_bytes()).hexdigest()}  {each.name}\n" for each in files)
    listed = folder / check_release.SUMS
    listed.write_text("".join(sums), "utf-8", newline="\n")
    told = f"{folder}: {len(files)} files, listed in {listed.name}"
    if not key:
        return f"{told}, which is not signed: RELEASE_KEY names no key"
    sign = ["ssh-keygen", "-q", "-Y", "sign", "-n", check_release.NAMESPACE, "-f", key, str(listed)]
    subprocess.run(sign, check=True)
    return f"{told}, which is signed"


def main() -> int:
    folder, programs = Path(sys.argv[1] if len(sys.argv) > 1 else pins.ROOT / "dist"), sys.argv[2:]
    folder.mkdir(parents=True, exist_ok=True)
    for old in (*folder.glob("ds47*"), *folder.glob(f"{check_release.SUMS}*")):
        old.unlink()
    build(folder, programs)
    name = f"ds47-{pins.version()}.cdx.json"
    (folder / name).write_text(json.dumps(bill(), indent=1, sort_keys=True) + "\n", "utf-8")
    told = seal(folder, os.environ.get("RELEASE_KEY"))
    check_release.check(folder, programs)
    print(told)
    return 0


if __name__ == "__main__":
    sys.exit(main())
