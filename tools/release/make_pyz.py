#!/usr/bin/env python3
"""Writes the whole command as one file that any Python from 3.11 on runs: dist/ds47.pyz.

    python tools/release/make_pyz.py [FOLDER]        (make pyz)

In it are ds47 without compiled parts, the Wireshark plugin, and the libraries that are pure Python. Equal sources
give equal bytes. What needs a compiled library (Parquet, zstd before Python 3.14) is found where the Python that
runs the file has it.
"""

from __future__ import annotations

import io
import sys
import zipfile
from pathlib import Path

import pins

LIBRARIES = ("click", "jinja2", "markupsafe", "openpyxl", "et-xmlfile", "tzdata")
COMPILED = (".so", ".pyd", ".dll", ".c", ".pyi")
LONG_AGO = (1980, 1, 1, 0, 0, 0)

MAIN = '''\
"""The command in one file. What is below runs with Python 2, too, as far as the message."""
import sys

if sys.version_info < (3, 11):
    sys.stderr.write(
        "ds47 needs Python 3.11 or later; this is %d.%d (%s)\\n"
        % (sys.version_info[0], sys.version_info[1], sys.executable)
    )
    sys.exit(2)

if __name__ == "__main__":
    from ds47.cli import main

    sys.exit(main())
'''


def wanted(name: str) -> bool:
    """Whether a file of a wheel belongs into the archive."""
    if name.endswith(COMPILED) or ".data/" in name:  # manual pages
        return False
    return not name.endswith("/RECORD")


def contents(wheels: list[Path]) -> dict[str, bytes]:
    """What the archive has: name -> content."""
    found = {"__main__.py": MAIN.encode()}
    for each in wheels:
        with zipfile.ZipFile(each) as held:
            found |= {name: held.read(name) for name in held.namelist() if wanted(name)}
    return found


def archive(files: dict[str, bytes]) -> bytes:
    """A zip file in which equal files give equal bytes."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as written:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, LONG_AGO)
            entry.external_attr = 0o644 << 16
            written.writestr(entry, files[name], zipfile.ZIP_DEFLATED, 9)
    return target.getvalue()


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else pins.ROOT / "dist"
    wheels = [pins.own(), *pins.download(LIBRARIES, pins.BUILD / "wheels")]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "ds47.pyz"
    path.write_bytes(b"#!/usr/bin/env python3\n" + archive(contents(wheels)))
    path.chmod(0o755)
    print(f"{path}: {path.stat().st_size // 1024} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
