"""What bench/ writes into docs/benchmarks.md: two tables, each between its marks. No time is taken here."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _bench(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    for name in ("run", "plugin", "window"):
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
