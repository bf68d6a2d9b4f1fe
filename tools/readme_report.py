"""Puts present output into README.md, README.zh.md and the pages of docs/.

The commands are those that the blocks name; tests/python/test_readme.py checks the result. Above a block stands
what of the output is shown: ``<!-- show 3, "What to do" 9 -->`` are the first three lines and nine from the first
one on that has these words; ``<!-- show -->`` is nothing of it.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
ANSWER = re.compile(
    r"(<!-- show ?([^\n]*?) ?-->\n```console\n\$ (ds47 [^\n]*)\n)(.*?)(```\n)", re.DOTALL
)
PART = re.compile(r'(?:"([^"]*)" )?(\d+)')


def output(line: str, folder: Path) -> list[str]:
    """The lines that a command prints in a folder."""
    command = [sys.executable, "-m", "ds47", *shlex.split(line)[1:]]
    environment = os.environ | {"TZ": "UTC", "NO_COLOR": "1", "PYTHONPATH": str(ROOT / "python")}
    result = subprocess.run(command, cwd=folder, capture_output=True, check=False, env=environment)
    if result.returncode not in (0, 1):
        raise SystemExit(f"{line}: {result.stderr.decode('utf-8')}")
    return [each.rstrip() for each in result.stdout.decode("utf-8").splitlines()]


def shown(lines: list[str], parts: str) -> str:
    """What is shown of them; ``...`` stands for what is left out."""
    text, done = "", 0
    for words, count in PART.findall(parts):
        found = [at for at, line in enumerate(lines) if words in line and at >= done]
        if not found:
            raise LookupError(f"{words!r} is not in the output: {lines[:3]}")
        start = found[0]
        text += "...\n" if start > done else ""
        done = min(len(lines), start + int(count))
        text += "".join(f"{line}\n" for line in lines[start:done])
    return text + ("...\n" if done < len(lines) else "")


def pages() -> list[Path]:
    """The pages that may show output."""
    return [ROOT / "README.md", ROOT / "README.zh.md", *sorted(DOCS.rglob("*.md"))]


def made(page: Path) -> str:
    """A page with its answers made anew, in the order of its commands, which share a folder."""
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        (folder / "captures").symlink_to(ROOT / "captures", target_is_directory=True)

        def answer(match: re.Match[str]) -> str:
            try:
                return match[1] + shown(output(match[3], folder), match[2]) + match[5]
            except LookupError as problem:
                raise SystemExit(f"{page.relative_to(ROOT)}: {match[3]}: {problem}") from problem

        return ANSWER.sub(answer, page.read_text("utf-8"))


def main() -> int:
    """Rewrite all of them; returns the exit status."""
    for page in pages():
        page.write_text(made(page), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
