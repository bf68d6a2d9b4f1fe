"""Puts the present report into README.md, into the block marked ``<!-- report -->``.

The command is the one that the block names; tests/python/test_readme.py checks the result.
"""

import re
import shlex
import subprocess
import sys
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"
BLOCK = re.compile(
    r"(<!-- report -->\n```console\n\$ (ds47 [^\n]*)\n)(.*?)(```\n<!-- /report -->)", re.DOTALL
)


def main() -> int:
    """Rewrite the block; returns the exit status."""
    text = README.read_text("utf-8")
    match = BLOCK.search(text)
    if match is None:
        sys.stderr.write("README.md has no block <!-- report -->\n")
        return 1
    words = shlex.split(match[2])
    command = [sys.executable, "-m", "ds47", *words[1:]]
    result = subprocess.run(command, cwd=README.parent, capture_output=True, check=True)
    output = "".join(f"{line.rstrip()}\n" for line in result.stdout.decode("utf-8").splitlines())
    block = f"{match[1]}{output}{match[4]}"
    README.write_text(text[: match.start()] + block + text[match.end() :], "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
