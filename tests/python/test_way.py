"""The way of a frame is the one that docs/developers/way.md tells: files that it enters, and calls."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs/developers/way.md"
_TOLD = re.compile(r"\| (\w+ \w+) \| (\d+), \d+ \| (\d+) \|")
_COUNTED = re.compile(r"^(\w+ \w+) +\d+ +(\d+) +\d+ +(\d+)$", re.MULTILINE)


def _run(*command: str | Path) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    return done.stdout


@pytest.mark.slow
def test_a_usual_frame_goes_no_further_than_the_page_says(tmp_path: Path) -> None:
    """The page counts a capture ten times as long, in which the begin counts for less."""
    capture = tmp_path / "dense.pcapng"
    _run(sys.executable, ROOT / "bench/make_dense.py", capture, "--frames", "2000")
    counted = _COUNTED.findall(_run(sys.executable, ROOT / "bench/way.py", capture))
    told = _TOLD.findall(PAGE.read_text(encoding="utf-8"))
    assert [kind for kind, *_ in counted] == [kind for kind, *_ in told]
    assert len(counted) == 4
    for (kind, files, calls), (_, most, usual) in zip(counted, told, strict=True):
        assert int(files) <= int(most), kind
        assert int(calls) <= 1.2 * int(usual), kind
