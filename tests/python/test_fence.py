"""A capture on which ds47 itself breaks costs its own report; those beside it are told as always.

It is broken on purpose, in each process: `sitecustomize` makes reading fail for captures with this name.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BREAKS = """
from ds47.capture import reader

real = reader.Capture.__iter__

def broken(self):
    if "ours" in self.path:
        [][0]
    return real(self)

reader.Capture.__iter__ = broken
"""
GOOD = "conversation-error.pcapng"
LINE = "ours.pcapng: internal fault: IndexError: list index out of range; please report it with"
OURS = 70


@pytest.fixture
def folder(tmp_path: Path, captures: Path) -> Path:
    """Two good captures with one between them that breaks us, in the order of their names."""
    found = tmp_path / "captures"
    found.mkdir()
    for name in ("good.pcapng", "ours.pcapng", "whole.pcapng"):
        shutil.copy(captures / GOOD, found / name)
    (tmp_path / "hook").mkdir()
    (tmp_path / "hook" / "sitecustomize.py").write_text(BREAKS)
    return found


def run(folder: Path, *words: str, breaks: bool = True) -> tuple[int, str, list[str]]:
    """Status, stdout and the lines on stderr."""
    hook = [str(folder.parent / "hook")] if breaks else []
    done = subprocess.run(
        [sys.executable, "-m", "ds47", *words],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([*hook, *sys.path])},
        cwd=folder.parent,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr.splitlines()


@pytest.mark.parametrize(
    "words",
    [["-j", "1"], ["-j", "2"], ["-j", "1", "--results", "r"], ["-j", "2", "--results", "r"]],
    ids=" ".join,
)
def test_a_report_tells_the_others(folder: Path, words: list[str]) -> None:
    status, shown, said = run(folder, "report", "-f", "json", *words, str(folder))
    assert (status, len(said)) == (OURS, 1)
    assert LINE in said[0]
    names = [Path(each["path"]).name for each in json.loads(shown)["captures"]]
    assert names == ["good.pcapng", "whole.pcapng"]


def test_each_format_tells_the_others(folder: Path) -> None:
    for words in (["-f", "text"], ["--summary"], ["-f", "html"], ["-f", "csv"], ["-f", "overview"]):
        status, shown, said = run(folder, "report", *words, str(folder))
        assert (status, len(said)) == (OURS, 1)
        assert LINE in said[0]
        assert "whole" in shown or words == ["--summary"]
        assert shown.strip()


def test_resume_reads_it_again(folder: Path) -> None:
    assert run(folder, "report", "--results", "r", str(folder))[0] == OURS
    words = ("report", "--results", "r", "--resume", str(folder))
    assert run(folder, *words)[0] == OURS
    assert run(folder, *words, breaks=False)[0] in (0, 1)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_baseline_and_check_tell_the_others(folder: Path, jobs: str) -> None:
    status, shown, said = run(folder, "baseline", "-j", jobs, str(folder))
    assert (status, len(said), LINE in said[0]) == (OURS, 1, True)
    stored = sorted(each.name for each in folder.glob("*.json"))
    assert stored == ["good.ds47.json", "whole.ds47.json"]
    status, shown, said = run(folder, "check", "-j", jobs, str(folder))
    assert (status, said) == (OURS, [])
    assert LINE in shown
    assert "3 captures: 2 as stored" in shown
    status, shown, said = run(folder, "accept", "--yes", "-j", jobs, str(folder))
    assert (status, LINE in said[0]) == (OURS, True)


def test_export_trail_and_diff_say_it(folder: Path) -> None:
    (folder.parent / "out").mkdir()
    for words in (["-o", "out"], ["-o", "out", "--examples"]):
        status, shown, said = run(folder, "export", *words, str(folder))
        assert (status, LINE in said[0]) == (OURS, True)
        assert "whole" in shown
    assert run(folder, "trail", str(folder))[0] == OURS
    pair = (str(folder / "good.pcapng"), str(folder / "ours.pcapng"))
    status, _, said = run(folder, "diff", *pair)
    assert (status, LINE in said[0]) == (OURS, True)
