"""`-j`: the report of several processes is that of one, byte for byte."""

from __future__ import annotations

import io
import pickle
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from report_formats import STREAMED

from ds47.analysis import AnalysisOptions
from ds47.batch.local import Local
from ds47.batch.products import Spool
from ds47.cli import main
from ds47.cyclic.named import parse
from ds47.parameters.lists import ListedParameter, ParameterList
from ds47.profidrive import Options
from ds47.s7.choices import Choices


@pytest.fixture
def folder(tmp_path: Path, captures: Path) -> Path:
    """Some captures, one of them cut, one no capture, one empty folder."""
    for name in ("format-change", "conversation-change-unread", "seed-dcm-read"):
        for path in captures.glob(f"{name}*.pcap*"):
            shutil.copy(path, tmp_path)
    whole = (captures / "format-change.pcapng").read_bytes()
    (tmp_path / "cut.pcapng").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "no.pcap").write_text("not a capture")
    (tmp_path / "empty").mkdir()
    return tmp_path


def said(capsys: Any, *arguments: str) -> tuple[int, str, list[str]]:
    status = main(["report", *arguments])
    shown = capsys.readouterr()
    return status, shown.out, sorted(shown.err.splitlines())


@pytest.mark.slow
@pytest.mark.parametrize("format_name", ["text", "json", *STREAMED])
def test_two_processes_say_what_one_says(capsys: Any, folder: Path, format_name: str) -> None:
    arguments = ("-f", format_name, str(folder), str(folder / "empty"))
    alone = said(capsys, *arguments)
    assert alone[0] == 3
    assert len(alone[1]) > 1000
    assert said(capsys, *arguments, "-j", "2") == alone


def test_options_and_stdin_go_the_same_way(capsys: Any, folder: Path, monkeypatch: Any) -> None:
    arguments = (
        "-f",
        "json",
        "--lang",
        "zh",
        "--ignore",
        "DS4",
        "-",
        str(folder / "format-change.pcapng"),
    )

    def answers(*more: str) -> Any:
        data = (folder / "cut.pcapng").read_bytes()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        return said(capsys, *arguments, *more)

    assert answers("-j", "0") == answers()


def test_no_captures(tmp_path: Path) -> None:
    make = Spool(AnalysisOptions(), streams=False)
    with Local([], make, lambda task: tmp_path / task.path, 2) as outcomes:
        assert list(outcomes) == []


def test_every_option_goes_to_another_process() -> None:
    """A new option that does not compare would be lost on the way unseen."""
    given = AnalysisOptions(
        frozenset({48}), 2.5, ("DS3",), ("DS301",), Options(True, True, 42), True, (("", "uss"),),
        ("pzd",), (parse("00:1b:1b:11:22:33@8000:0:pkw"),), ((3, 1),),
        Choices((1102,), (("", 32),), (("10.0.0.2", "s7-400"),), True), 0x002A,
        (ParameterList("own", 0x002A, (7,), "4.7", "own.csv", [ListedParameter(1, "one", values={0: "no"})]),),
    )  # fmt: skip
    assert pickle.loads(pickle.dumps(given)) == given
    for options, default in (
        (given, AnalysisOptions()), (given.codec, Options()), (given.s7, Choices()),
    ):  # fmt: skip
        for name in options._fields:
            assert getattr(options, name) != getattr(default, name), f"{name} is not tested"
