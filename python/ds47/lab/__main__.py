"""`python -m ds47.lab FOLDER`: write every scenario and a MANIFEST.toml that says what each one is.

Files that no scenario writes any more are left alone, but are not in the manifest.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from ds47.lab import Scenario, scenarios, write, write_log
from ds47.lab.profibus_stories import LOGS

HEAD = """\
# What the captures in this folder show. Written by `python -m ds47.lab FOLDER`; do not edit.
# A test writes them again and compares the bytes.
"""


def quoted(text: str) -> str:
    """A TOML basic string; JSON escapes what TOML wants escaped."""
    return json.dumps(text)


def manifest_entry(scenario: Scenario, path: Path, frames: int) -> str:
    """The TOML table of one capture."""
    transactions = ", ".join(
        f'"{operation} {state}"' for operation, state in scenario.expect.transactions
    )
    rules, diagnoses = (
        ", ".join(f'"{rule}"' for rule in sorted(ids))
        for ids in (scenario.expect.rules, scenario.expect.diagnoses)
    )
    return f"""
[[capture]]
file = "{path.name}"
sha256 = "{hashlib.sha256(path.read_bytes()).hexdigest()}"
frames = {frames}
made = "ds47 lab write captures {scenario.name}"
title = {quoted(scenario.title)}
shows = {quoted(scenario.shows)}
transactions = [{transactions}]
rules = [{rules}]
diagnoses = [{diagnoses}]
"""


def log_entry(name: str, path: Path, frames: int) -> str:
    """That of a log: the frames of a capture as text."""
    return f"""
[[log]]
file = "{path.name}"
sha256 = "{hashlib.sha256(path.read_bytes()).hexdigest()}"
frames = {frames}
made = "ds47 lab write --log captures {name}"
"""


def write_all(folder: Path) -> Path:
    """Write every capture into a folder, which is made; the path of the manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    text = HEAD
    for name, scenario in scenarios().items():
        path = folder / f"{name}.pcapng"
        text += manifest_entry(scenario, path, len(write(name, path).shots))
    for name in LOGS:
        path = folder / f"{name}.txt"
        text += log_entry(name, path, len(write_log(name, path).shots))
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
