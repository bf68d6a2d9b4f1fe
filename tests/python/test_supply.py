"""What SECURITY.md promises: no socket is opened, and nothing is installed without its hash."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import ds47

LISTENING = """
import os, sys

opened = []
net = "socket.", "urllib.", "http."
sys.addaudithook(lambda event, _: event.startswith(net) and opened.append(event))
import json
from ds47.cli import main

sys.stdout = open(os.devnull, "w")
for words in json.load(sys.stdin):
    try:
        status = main(words)
    except SystemExit as end:
        status = end.code
    print(*words, status, *opened, file=sys.stderr)
    if status not in (0, 1) or opened:
        os._exit(9)
"""
"""Runs commands, of which each is to do its work, and ends with 9 at the first that opens a socket."""
CAPTURE = "tour-machine.pcapng"
COMMANDS = [
    *(["report", "-f", form, CAPTURE] for form in ("text", "html", "json", "csv", "ndjson", "sarif", "junit")),
    ["report", "--summary", "."],
    ["report", "--lang", "zh", "pyprofibus_ppo1.pcapng"],
    ["check", "."],
    ["diff", CAPTURE, CAPTURE],
    ["trail", "--pnu", "1120", CAPTURE],
    ["watch", "--no-follow", CAPTURE],
    ["decode", "01 02 01 01 10 00 07 6F 00 00"],
    ["encode", "read axis 2 p945[0..7]"],
    ["explain", "DE80B500"],
    ["explain", "DS705"],
    ["params", "list"],
    ["export", CAPTURE, "-o", "out.pcapng"],
    ["export", "--anonymise", CAPTURE, "-o", "out-2.pcapng"],
]  # fmt: skip


def heard(commands: list[list[str]], folder: Path, program: str = LISTENING) -> tuple[int, str]:
    """Exit status of the commands, and what was said to stderr."""
    done = subprocess.run(
        [sys.executable, "-c", program], input=json.dumps(commands), cwd=folder, capture_output=True, text=True
    )  # fmt: skip
    return done.returncode, done.stderr


@pytest.mark.slow
def test_no_command_opens_a_socket(captures: Path, tmp_path: Path) -> None:
    for path in (*captures.glob("tour-machine.*"), captures / "profibus/pyprofibus_ppo1.pcapng"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    status, said = heard(COMMANDS, tmp_path)
    assert status == 0, said
    assert len(said.splitlines()) >= len(COMMANDS)


def test_a_socket_would_be_noticed(tmp_path: Path) -> None:
    ours = "from ds47.cli import main"
    asks = "import socket; main = lambda _: socket.socket().close() or 0"
    status, said = heard([["report"]], tmp_path, LISTENING.replace(ours, asks))
    assert (status, said) == (9, "report 0 socket.__new__\n")


def test_what_make_installs_has_a_hash(repository: Path) -> None:
    texts = [
        repository / "Makefile",
        *(repository / ".ci").iterdir(),
        *(repository / "tools").rglob("*.sh"),
    ]
    fetched = re.compile(
        r"-m pip (?:install|download|wheel)\b(?!.*--(?:require-hashes|no-index)).*"
    )
    for path in texts:
        assert fetched.findall(path.read_text("utf-8")) == [], path


def test_what_resolves_the_versions_is_the_one_that_is_named(repository: Path) -> None:
    folder = repository / "tools" / "resolver"
    named, held = (
        re.findall(
            r"^uv==\S+", (folder / f"requirements.{ending}").read_text("utf-8"), re.MULTILINE
        )
        for ending in ("in", "txt")
    )
    assert named == held
    assert "--hash=sha256:" in (folder / "requirements.txt").read_text("utf-8")


def test_the_versions_that_get_repairs_are_ours(repository: Path) -> None:
    series = ".".join(ds47.__version__.split(".")[:2])
    assert f"| {series}." in (repository / "SECURITY.md").read_text("utf-8")
