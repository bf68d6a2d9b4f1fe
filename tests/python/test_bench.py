"""What bench/ prints, and writes into docs/benchmarks.md between its marks: tables. No time is taken here."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _bench(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    for name in ("run", "plugin", "window", "hurtful", "make_hurtful", "make_dense"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_the_analyzer_has_a_row_for_each_program_and_says_what_is_missed(tmp_path: Path) -> None:
    import run

    capture = tmp_path / "x.pcap"
    capture.write_bytes(bytes(2_000_000))
    targets = [run.Target("ds47", "tshark", 4), run.Target("ds47", "tcpdump", 1 / 2)]
    section = run.Section("Frames", capture, [run.Row("ds47", [], ours=True)], targets)
    bare, ours = run.Run(0.5, 0.5, 9.6), run.Run(1.5, 1.25, 20)
    result = {"python -c pass": bare, "ds47": ours, "tshark": run.Run(3, 3, 99), "tcpdump": bare}
    assert run.rows_of(section, result)[:2] == [
        "| Frames, 2 MB | python -c pass | 0.500 | 0.500 | 10 |  |",
        "|  | ds47 | 1.500 | 1.250 | 20 | "
        "**missed**: 3.0 x as fast as tshark (4.0); 2.00 x the time of tcpdump (2.00) |",
    ]


def test_the_plugin_has_a_row_for_each_tshark_and_capture() -> None:
    import plugin

    costs = [plugin.Cost("4.0.17", "RT", mode.title, 1, 1.5) for mode in plugin.MODES]
    costs += [plugin.Cost("4.4.19", "RT", mode.title, 1, 2) for mode in plugin.MODES]
    assert list(plugin.rows(costs)) == [
        "| 4.0.17 | RT | " + " | ".join(["1.00 to 1.50 (1.5)"] * 4) + " |",
        "| 4.4.19 | RT | " + " | ".join(["1.00 to 2.00 (2.0)"] * 4) + " |",
    ]


def test_the_page_has_room_for_both() -> None:
    import plugin
    import run

    page = (ROOT / "docs/benchmarks.md").read_text("utf-8")
    for program in (run, plugin):
        between = page.partition(program.BEGIN)[2].partition(program.END)[0]
        assert f"\n\n{program.HEAD}\n" in between


def test_each_hurtful_conversation_is_read_to_its_end(tmp_path: Path) -> None:
    import make_hurtful

    from ds47.analysis import analyze

    for name in make_hurtful.KINDS:
        make_hurtful.write(tmp_path / name, name, 12)
        assert analyze(tmp_path / name).frames == 12, name


def test_what_grows_and_what_is_too_large_is_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    import hurtful
    import run

    costs = {"x-10.pcap": run.Run(1, 1.001, 100), "x-50.pcap": run.Run(9, 1.008, 201)}
    monkeypatch.setattr(run, "made", lambda name, *_: Path(name))
    monkeypatch.setattr(hurtful, "cost", lambda _, capture: costs[capture.name])
    line = hurtful.row("x", "csv", [10, 50], run.Run(1, 1, 20))
    assert line.split() == ["x", "csv", "100.0", "us", "100", "MiB", "160.0", "us!", "201", "MiB!"]
    line = hurtful.row("x", "json", [10, 50], run.Run(1, 1.0005, 20))
    assert line.split() == ["x", "json", "50.0", "us", "100", "MiB", "150.0", "us!", "201", "MiB"]


@pytest.mark.slow
def test_the_benchmark_of_hurtful_conversations_runs() -> None:
    words = [sys.executable, str(ROOT / "bench" / "hurtful.py"), "--trial"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert len(re.findall(r"ndjson +[\d.]+ us", done.stdout)) > 34


@pytest.mark.parametrize("form", ["text", "html"])
def test_a_report_looks_through_the_devices_as_often_however_many_there_are(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import make_hurtful

    from ds47 import model
    from ds47.cli import main

    looked: list[int] = []
    named = model.CaptureResult.named
    count = lambda result: looked.append(len(result.devices)) or named(result)  # noqa: E731
    monkeypatch.setattr(model.CaptureResult, "named", count)
    for frames in (40, 160):
        make_hurtful.write(tmp_path / "x.pcap", "devices", frames)
        main(["report", "-f", form, "-o", str(tmp_path / f"{frames}"), str(tmp_path / "x.pcap")])
    few, many = looked.count(10), looked.count(40)
    assert few == many > 0
    assert few + many == len(looked)
