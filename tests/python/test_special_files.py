"""What stands in folders and is no file, what is not written over, and what killed processes left there."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ds47.batch.settings import passed_over
from ds47.capture.drafts import draft_of
from ds47.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs files of POSIX")
GOOD = "conversation-error.pcapng"


@pytest.fixture
def folder(tmp_path: Path, captures: Path) -> Path:
    """A capture, a named pipe and a device beside it."""
    found = tmp_path / "captures"
    found.mkdir()
    shutil.copy(captures / GOOD, found / "good.pcapng")
    os.mkfifo(found / "pipe.pcap")
    (found / "nothing.pcap").symlink_to("/dev/null")
    return found


@pytest.fixture
def run(capsys: Any) -> Callable[..., tuple[int, str, list[str]]]:
    """Runs a command: status, stdout, lines on stderr. One that waits for a pipe is ended."""

    def ran(*words: str | Path) -> tuple[int, str, list[str]]:
        before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("waits for a pipe"))
        signal.alarm(60)
        try:
            status = main([str(each) for each in words])
        finally:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)
        shown = capsys.readouterr()
        return status, shown.out, shown.err.splitlines()

    return ran


def test_a_folder_gives_its_files_and_names_the_rest(
    folder: Path, tmp_path: Path, run: Any
) -> None:
    words = [
        f"ds47: {folder}/nothing.pcap is a device, no capture: passed over",
        f"ds47: {folder}/pipe.pcap is a named pipe, no capture: passed over",
    ]
    (tmp_path / "out").mkdir()
    for command in (
        ["report"], ["report", "-j", "2"], ["report", "-f", "ndjson"], ["report", "--series"],
        ["report", "--results", tmp_path / "r"], ["baseline"], ["check"], ["trail"],
        ["export", "-o", tmp_path / "out"],
    ):  # fmt: skip
        status, _, said = run(*command, folder)
        assert (status, said) == (0, words), command


def test_a_stored_result_that_is_a_pipe_is_told(folder: Path, run: Any) -> None:
    os.mkfifo(folder / "good.ds47.json")
    status, shown, _ = run("check", folder)
    assert status == 1
    assert "good.ds47.json is a named pipe, no stored result: remove it" in shown


def test_settings_that_are_no_file_are_passed_over_with_a_word(folder: Path, run: Any) -> None:
    (folder / "pipe.pcap").unlink()
    (folder / "nothing.pcap").unlink()
    settings = folder / "ds47.toml"
    for kind, make in {
        "a named pipe": os.mkfifo,
        "a folder": os.mkdir,
        "a link in a circle": lambda path: path.symlink_to(path),
    }.items():
        make(settings)
        status, _, said = run("report", folder)
        assert (status, said) == (0, [f"ds47: {settings} is {kind}, no file: passed over"])
        shutil.rmtree(settings) if kind == "a folder" else settings.unlink()


def test_settings_above_count_and_those_above_them_do_not(folder: Path) -> None:
    (folder.parent / "ds47.toml").mkdir()
    assert len(list(passed_over([str(folder / "good.pcapng")]))) == 1
    (folder / "ds47.toml").write_text("")
    assert not list(passed_over([str(folder / "good.pcapng"), "s3://bucket/x.pcapng"]))


def test_a_list_that_is_a_pipe_is_none(folder: Path, run: Any, monkeypatch: Any) -> None:
    monkeypatch.setenv("DS47_PARAMS", str(folder / "lists"))
    (folder / "lists").mkdir()
    os.mkfifo(folder / "lists" / "pipe.toml")
    assert run("params", "list")[0] == 0
    assert run("report", folder / "good.pcapng")[0] == 0


# What is not written over


@pytest.mark.parametrize("text", ["a log\n", '{"captures": []}', "a report"])
@pytest.mark.parametrize("name", ["good.pcapng.json", "overview.json"])
def test_results_replace_only_results(
    folder: Path, tmp_path: Path, run: Any, name: str, text: str
) -> None:
    capture, results = folder / "good.pcapng", tmp_path / "r"
    assert run("report", "--results", results, capture)[0] == 0
    assert run("report", "--results", results, capture)[0] == 0
    if text == "a report":
        text = run("report", "-f", "json", capture)[1]
    (results / name).write_text(text)
    for words in ([], ["--resume"], ["-j", "2"]):
        status, _, said = run("report", "--results", results, *words, capture)
        assert (status, len(said)) == (2, 1)
        assert f"{results / name} is not a result of ds47 report --results" in said[0]
    assert (results / name).read_text() == text


def test_a_pipe_in_the_place_of_a_result(folder: Path, tmp_path: Path, run: Any) -> None:
    (tmp_path / "r").mkdir()
    os.mkfifo(tmp_path / "r" / "good.pcapng.json")
    status, _, said = run("report", "--resume", "--results", tmp_path / "r", folder / "good.pcapng")
    assert (status, "is a named pipe" in said[0]) == (2, True)


def test_results_behind_a_url_replace_only_results(folder: Path, run: Any) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory, capture = fsspec.filesystem("memory"), folder / "good.pcapng"
    url = "memory://special/r"
    for words in ([], ["--resume"], []):
        assert run("report", "--results", url, *words, capture)[0] == 0
    memory.pipe("/special/r/good.pcapng.json", b"a log")
    status, _, said = run("report", "--results", url, capture)
    assert (status, f"{url}/good.pcapng.json is not a result" in said[0]) == (2, True)
    assert memory.cat("/special/r/good.pcapng.json") == b"a log"


def test_the_lab_replaces_no_recording(tmp_path: Path, run: Any) -> None:
    pytest.importorskip("scapy")
    place = tmp_path / "seed-g120-read.pcapng"
    for _ in range(2):
        assert run("lab", "write", tmp_path, "seed-g120-read")[0] == 0
    whole = place.read_bytes()
    place.write_bytes(whole[:-4])
    status, _, said = run("lab", "write", tmp_path, "seed-g120-read")
    assert (status, f"{place} is there and is not what the lab writes" in said[0]) == (2, True)
    assert place.read_bytes() == whole[:-4]
    place.unlink()
    place.symlink_to(tmp_path / "other")
    assert run("lab", "write", tmp_path, "seed-g120-read")[0] == 2
    assert sorted(each.name for each in tmp_path.iterdir()) == [place.name]


# What killed processes left


def dead() -> int:
    """The id of a process that is no more."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_drafts_of_dead_processes_go_with_the_next_one(
    folder: Path, tmp_path: Path, run: Any
) -> None:
    capture, owner, alive = folder / "good.pcapng", dead(), os.getppid()
    targets = [
        (tmp_path / "a.html", ["report", "-o", tmp_path / "a.html"]),
        (folder / "good.ds47.json", ["baseline"]),
        (tmp_path / "r" / "good.pcapng.json", ["report", "--results", tmp_path / "r"]),
        (tmp_path / "r2" / "overview.json", ["report", "--results", tmp_path / "r2"]),
        (tmp_path / "a.ds47.pcapng", ["export", "-o", tmp_path / "a.ds47.pcapng"]),
        (tmp_path / "key", ["export", "--anonymise", "--key", tmp_path / "key", "-o", tmp_path / "b.pcapng"]),
    ]  # fmt: skip
    for path, _ in targets:
        path.parent.mkdir(exist_ok=True)
        for each in (owner, alive):
            path.with_name(f".{path.name}.{each}.tmp").touch()
    (tmp_path / f".other.html.{owner}.tmp").touch()
    for path, words in targets:
        assert run(*words, capture)[0] == 0
        assert path.exists()
        left = [each.name for each in path.parent.glob(f".{path.name}.*.tmp")]
        assert left == [f".{path.name}.{alive}.tmp"]
    assert (tmp_path / f".other.html.{owner}.tmp").exists()


def test_only_what_is_a_draft_is_taken_away(tmp_path: Path) -> None:
    owner = dead()
    names = [f".a.{owner}.tmp.x", f"a.{owner}.tmp", ".a.tmp", f".a.{'9' * 30}.tmp", ".a.0.tmp"]
    for name in names:
        (tmp_path / name).touch()
    assert draft_of(tmp_path / "a").name == f".a.{os.getpid()}.tmp"
    assert draft_of(tmp_path / "a", 7).name == ".a.7.tmp"
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted(names)
