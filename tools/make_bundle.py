#!/usr/bin/env python3
"""Writes the whole plugin as one Lua file, for people without Python: dist/ds47-2_0_0_dev0.lua.

The version has underscores for dots (ds47.wireshark.bundle.FILE_NAME says why).

    python tools/make_bundle.py [FOLDER]        (make dist)

What is in it and how it is joined: ds47.wireshark.bundle.
"""

import sys
from pathlib import Path

from ds47.wireshark.bundle import FILE_NAME, bundle, plugin_sources

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist"
    path = folder / FILE_NAME
    folder.mkdir(parents=True, exist_ok=True)
    path.write_text(bundle(plugin_sources()), "utf-8", newline="\n")
    print(f"{path}: {path.stat().st_size // 1024} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
