"""Puts present output into README.md, into the block marked ``<!-- report -->``, and into docs/questions.md.

The commands are those that the blocks name; tests/python/test_readme.py checks the result. In docs/questions.md
stands above each block what of the output is shown: ``<!-- show 3, "What to do" 9 -->`` are the first three lines
and nine from the first one on that has these words.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
QUESTIONS = ROOT / "docs" / "questions.md"
BLOCK = re.compile(
    r"(<!-- report -->\n```console\n\$ (ds47 [^\n]*)\n)(.*?)(```\n<!-- /report -->)", re.DOTALL
)
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
            raise SystemExit(f"{QUESTIONS}: {words!r} is not in the output: {lines[:3]}")
        start = found[0]
        text += "...\n" if start > done else ""
        done = min(len(lines), start + int(count))
        text += "".join(f"{line}\n" for line in lines[start:done])
    return text + ("...\n" if done < len(lines) else "")


def readme() -> str:
    """README.md with its report made anew."""
    text = README.read_text("utf-8")
    match = BLOCK.search(text)
    if match is None:
        raise SystemExit("README.md has no block <!-- report -->")
    report = "".join(f"{line}\n" for line in output(match[2], ROOT))
    return f"{text[: match.start()]}{match[1]}{report}{match[4]}{text[match.end() :]}"


def questions() -> str:
    """docs/questions.md with its answers made anew, in the order of its commands."""
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        (folder / "captures").symlink_to(ROOT / "captures", target_is_directory=True)
        return ANSWER.sub(
            lambda match: match[1] + shown(output(match[3], folder), match[2]) + match[5],
            QUESTIONS.read_text("utf-8"),
        )


def main() -> int:
    """Rewrite both; returns the exit status."""
    README.write_text(readme(), "utf-8", newline="\n")
    QUESTIONS.write_text(questions(), "utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
