"""The judge in Lua hears what the tests of the judge in Python tell theirs, and says the same.

The tests of the rules, of what is read back and of the drive objects run once more, with a plugin that writes
down what they tell (`heard.py`). What they expect is typed by hand there; so it holds for Lua as well.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

import ds47.acyclic.judge

TESTS = Path(__file__).resolve().parent
DRIVER = TESTS.parent / "lua/judge.lua"
HEARD = ("test_judge.py", "test_readback.py", "test_drive_objects.py")
PLENTY = 500
"""There are more things said than this."""


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the tests of Python told, and what was said."""
    if not ds47.acyclic.judge.__file__.endswith(".py"):
        pytest.skip("a compiled judge cannot be listened to")
    target = tmp_path_factory.mktemp("judge") / "heard"
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "heard",
        "-p",
        "no:cacheprovider",
        *HEARD,
    ]
    found = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    environment = {**os.environ, "DS47_HEARD": str(target), "PYTHONPATH": found}
    done = subprocess.run(
        command, cwd=TESTS, env=environment, capture_output=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return target


def run(lua: str, path: Path) -> subprocess.CompletedProcess[str]:
    command = [lua_program(lua), str(DRIVER), str(path)]
    return subprocess.run(command, capture_output=True, encoding="utf-8", check=False, timeout=120)


@pytest.mark.parametrize("lua", LUAS)
def test_it_says_the_same(lua: str, heard: Path) -> None:
    done = run(lua, heard)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[0]) > PLENTY


def test_what_is_not_said_fails(heard: Path, tmp_path: Path) -> None:
    text = heard.read_text(encoding="utf-8")
    changed = tmp_path / "heard"
    changed.write_text(text.replace('"written": 10.0', '"written": 10.5', 1), encoding="utf-8")
    done = run("lua5.4", changed)
    assert done.returncode == 1
    assert done.stdout.startswith("answered: expected")
