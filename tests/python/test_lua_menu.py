"""What the menus of Wireshark do, under plain Lua: files that are saved."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

PROGRAMS = Path(__file__).resolve().parents[1] / "lua"
PCAPNG, PCAP = bytes.fromhex("0a0d0d0a1c000000"), bytes.fromhex("d4c3b2a102000400")


def run(lua: str, program: str, *arguments: str | Path) -> list[str]:
    command = [lua_program(lua), str(PROGRAMS / program), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.parametrize("lua", LUAS)
def test_a_report_takes_a_name_that_is_free(lua: str, tmp_path: Path) -> None:
    (tmp_path / "report.csv").write_bytes(PCAPNG)  # whatever it is, it stays
    (tmp_path / "capture").write_bytes(PCAP)
    (tmp_path / "older").write_text("older")
    (tmp_path / "locked").write_text("no folder")
    lines = iter(run(lua, "saving.lua", tmp_path))
    assert next(lines) == "Nothing was saved: no file name was given."
    for number, saved, stays in ((2, "Saved: {}", "{} already exists and is left as it is."),
                                 (3, "Saved: {}", "{} already exists and is left as it is."),
                                 (4, "已保存：{}", "{} 已存在，保持不变。")):  # fmt: skip
        for ending in (".txt", ".csv"):
            assert next(lines) == saved.format(tmp_path / f"report-{number}{ending}")
        assert next(lines) == stays.format(tmp_path / "report")
    for place in ("no", "locked"):
        told = next(lines)
        assert told.startswith("Not saved: ")
        assert str(tmp_path / place) in told
        if place == "no":
            assert next(lines).startswith("Not saved: ")
    assert next(lines).endswith("is not overwritten: choose another name")
    assert next(lines).split() == ["true", "true"]
    assert next(lines).split() == ["true", "false"]
    assert next(lines, None) is None
    assert (tmp_path / "report.csv").read_bytes() == PCAPNG
    assert (tmp_path / "capture").read_bytes() == PCAP
    assert (tmp_path / "report-2.txt").read_text() == f"report of {tmp_path}/report.txt"
    assert (tmp_path / "report-3.csv").read_text() == f"csv of {tmp_path}/report"
    assert (tmp_path / "older").read_text() == (tmp_path / "newer").read_text() == "a report"
