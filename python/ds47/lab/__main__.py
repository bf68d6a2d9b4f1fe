"""`python -m ds47.lab FOLDER`: write every scenario and a MANIFEST.toml that says what each one is.

Files that no scenario writes any more are left alone, but are not in the manifest.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from ds47.lab import scenarios, write, write_log
from ds47.lab.profibus_stories import LOGS

HEAD = """\
# What the captures in this folder show. Written by `python -m ds47.lab FOLDER`; do not edit.
# A test writes them again and compares the bytes.
"""


def entry(kind: str, path: Path, frames: int, made: str, **more: object) -> str:
    """The TOML table of a file that was written; JSON escapes what TOML wants escaped."""
    about = {
        "file": path.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "frames": frames,
        "made": f"ds47 lab write {made}",
        **more,
    }
    rows = (f"{key} = {json.dumps(value)}" for key, value in about.items())
    return "\n".join(["", f"[[{kind}]]", *rows, ""])


def write_all(folder: Path) -> Path:
    """Write every capture into a folder, which is made; the path of the manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    text = HEAD
    for name, scenario in scenarios().items():
        path = folder / f"{name}.pcapng"
        frames, expect = len(write(name, path).shots), scenario.expect
        text += entry(
            "capture", path, frames, f"captures {name}", title=scenario.title, shows=scenario.shows,
            transactions=list(map(" ".join, expect.transactions)), rules=sorted(expect.rules),
            diagnoses=sorted(expect.diagnoses),
        )  # fmt: skip
    for name in LOGS:
        path = folder / f"{name}.txt"
        text += entry("log", path, len(write_log(name, path).shots), f"--log captures {name}")
    manifest = folder / "MANIFEST.toml"
    manifest.write_text(text, encoding="utf-8", newline="\n")
    return manifest


def main(arguments: list[str]) -> int:
    """The command: one argument, the folder."""
    if len(arguments) != 1:
        sys.stderr.write("usage: python -m ds47.lab FOLDER\n")
        return 2
    sys.stdout.write(f"{write_all(Path(arguments[0]))}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
