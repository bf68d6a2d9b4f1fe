"""The manual pages: those of the present commands, whole, and without a complaint of what reads them."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from ds47.cli import COMMANDS


@pytest.fixture(scope="module")
def maker(repository: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_man", repository / "tools" / "make_man.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_pages_are_those_of_the_commands(maker: ModuleType, repository: Path) -> None:
    stored = {path.name: path.read_text("utf-8") for path in (repository / "man").iterdir()}
    assert stored.keys() == {"ds47.1", *(f"ds47-{name}.1" for name in COMMANDS)}
    for name, text in maker.pages().items():
        assert stored[name] == text, f"{name} is old: make man"


def test_what_troff_would_take_for_its_own_is_escaped(maker: ModuleType) -> None:
    assert maker.escaped(".TH\n'x' a\\b -1 `c` ^ ~") == (
        "\\&.TH\n\\(aqx\\(aq a\\eb \\-1 \\(gac\\(ga \\(ha \\(ti"
    )


@pytest.mark.parametrize("name", ["ds47", *(f"ds47-{name}" for name in COMMANDS)])
def test_man_shows_every_option_and_complains_of_nothing(repository: Path, name: str) -> None:
    if shutil.which("man") is None or shutil.which("groff") is None:
        pytest.skip("man is missing")
    page = repository / "man" / f"{name}.1"
    environment = {**os.environ, "LC_ALL": "C.UTF-8", "MANWIDTH": "200", "MAN_KEEP_FORMATTING": ""}
    command = [
        "man",
        "--warnings",
        "--encoding=UTF-8",
        "--no-hyphenation",
        "--local-file",
        str(page),
    ]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    words = name.split("-")
    help_ = subprocess.run(
        [sys.executable, "-m", "ds47", *words[1:], "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    for option in set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]+", help_.stdout)):
        assert option in done.stdout


def test_mandoc_finds_nothing_wrong(repository: Path) -> None:
    if shutil.which("mandoc") is None:
        pytest.skip("mandoc is missing")
    pages = sorted(str(path) for path in (repository / "man").iterdir())
    said = subprocess.run(
        ["mandoc", "-T", "lint", "-W", "warning", *pages], capture_output=True, text=True
    ).stdout
    lines = [line for line in said.splitlines() if "missing date" not in line]  # before a release
    assert lines == []
