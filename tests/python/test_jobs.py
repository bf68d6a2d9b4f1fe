"""`check`, `baseline` and `accept` in several processes say and store the same as in one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ds47.cli import main

NAMES = (
    "conversation-read-back.pcapng", "conversation-read-back-equal.pcapng", "tour-machine.pcapng",
    "seed-g120-read.pcapng",
)  # fmt: skip
Captured = pytest.CaptureFixture[str]


@pytest.fixture
def folder(captures: Path, tmp_path: Path) -> Path:
    for name in NAMES:
        (tmp_path / name).write_bytes((captures / name).read_bytes())
    return tmp_path


def run(capsys: Captured, *words: object) -> tuple[int, str, str]:
    status = main([*map(str, words)])
    said = capsys.readouterr()
    return status, said.out, said.err


def stored(folder: Path) -> dict[str, bytes]:
    return {each.name: each.read_bytes() for each in folder.glob("*.ds47.json")}


def test_the_same_in_several_processes(capsys: Captured, folder: Path) -> None:
    one = run(capsys, "baseline", "-j", 1, folder), stored(folder)
    assert len(one[1]) == len(NAMES)
    assert (run(capsys, "baseline", "-j", 2, "--force", folder), stored(folder)) == one
    (folder / NAMES[0]).write_bytes((folder / NAMES[1]).read_bytes())
    checked = run(capsys, "check", "-j", 1, folder)
    assert checked[0] == 1
    assert run(capsys, "check", "-j", 2, folder) == checked
    accepted = run(capsys, "accept", "-j", 2, "--yes", folder)
    assert accepted[0] == 0
    assert "accepted" in accepted[1]
    assert run(capsys, "check", "-j", 2, folder)[1].endswith("4 captures: 4 as stored, 0 not\n")


def test_what_cannot_be_read_is_told_from_a_process_too(capsys: Captured, folder: Path) -> None:
    (folder / "broken.pcapng").write_bytes(b"\x89PNG\r\n")
    alone = run(capsys, "baseline", "-j", 1, folder)
    assert alone[0] == 3
    assert "it is a PNG picture" in alone[2]
    assert run(capsys, "baseline", "-j", 2, "--force", folder) == alone
    (folder / "ds47.toml").write_text("[check\n")
    status, _, err = run(capsys, "check", "-j", 2, folder)
    assert status == 2
    assert err.startswith("ds47: error: ")
    assert "ds47.toml" in err


def test_as_markdown(capsys: Captured, folder: Path) -> None:
    run(capsys, "baseline", folder)
    assert run(capsys, "check", "-f", "markdown", folder) == (
        0, "## ✅ 4 captures: 4 as stored, 0 not\n", "",
    )  # fmt: skip
    (folder / NAMES[0]).write_bytes((folder / NAMES[1]).read_bytes())
    status, out, _ = run(capsys, "check", "-f", "markdown", folder)
    assert status == 1
    assert out.startswith("## ❌ 4 captures: 3 as stored, 1 not")
    (line,) = [each for each in out.splitlines() if NAMES[0] in each]
    assert line.startswith(f"| ❌ `{folder / NAMES[0]}` | transaction 2: ")
    assert "p1120\\[0\\] was 9.5, is 10.0<br>" in line


def test_as_json(capsys: Captured, folder: Path) -> None:
    run(capsys, "baseline", folder)
    one, two = (run(capsys, "check", "-j", jobs, "-f", "json", folder)[1] for jobs in (1, 2))
    assert json.loads(one) == json.loads(two)
