"""The conversation vectors through the analysis in Lua, each also looked at after every step."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests/lua/conversations.lua"
VECTORS = ROOT / "tests/vectors/conversations.json"
FILES = (VECTORS, ROOT / "tests/vectors/diagnoses.json")


def run(version: str, *command: Path) -> subprocess.CompletedProcess[str]:
    program = shutil.which(f"lua{version}")
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"lua{version} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"lua{version} is missing")
    return subprocess.run(
        [program, *command],
        capture_output=True,
        encoding="utf-8",
        timeout=120,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
@pytest.mark.parametrize("version", ["5.2", "5.3", "5.4"])
def test_every_conversation(version: str, path: Path) -> None:
    result = run(version, DRIVER, path)
    assert result.returncode == 0, result.stdout + result.stderr
    count = json.loads(path.read_text(encoding="utf-8"))["count"]
    assert result.stdout.splitlines() == [f"{count} cases"]


def test_what_is_not_expected_fails(tmp_path: Path) -> None:
    vectors = json.loads(VECTORS.read_text(encoding="utf-8"))
    cases = [case for case in vectors["cases"] if case["expect"]["findings"]][:3]
    cases += [case for case in vectors["cases"] if "diagnoses" in case["expect"]][-2:]
    cases[0]["expect"]["findings"].pop()
    cases[1]["expect"]["findings"][0]["frame"] += 1
    cases[2]["expect"]["transactions"][0]["frames"]["polls"].append({"request": 1, "response": 2})
    cases[3]["expect"]["diagnoses"][0]["frame"] += 1
    del cases[4]["expect"]["diagnoses"]
    changed = tmp_path / "vectors.json"
    changed.write_text(json.dumps({"cases": cases}), encoding="utf-8")
    result = run("5.4", DRIVER, changed)
    assert result.returncode == 1
    failed = [line.split(":")[0] for line in result.stdout.splitlines()[:-1]]
    assert failed == [case["id"] for case in cases], result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("version", ["5.2", "5.3", "5.4"])
def test_a_memory_and_one_that_goes_on_alone(version: str) -> None:
    result = run(version, ROOT / "tests/lua/memory.lua")
    assert (result.returncode, result.stdout) == (0, "ok\n"), result.stderr
