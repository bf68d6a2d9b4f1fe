"""A series of files as one capture: the names of ring buffers, and conversations over file boundaries."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from frames import whole_frames
from ringbuffer import NIGHT, pieces, ring, write

from ds47 import report
from ds47.analysis import analyze
from ds47.batch.tasks import plan
from ds47.capture import CaptureError, Series, WholeFrame
from ds47.capture.rings import Ring, is_part, own_name, rings
from ds47.capture.series import SeriesPart
from ds47.cli import main
from ds47.model import CaptureFile, CaptureResult
from ds47.report.file_frames import FileFrames
from ds47.report.sentences import sentence

# -- names ----------------------------------------------------------------------------------------


MORNING, NOON = "20240101060000", "20240101120000"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ([], []),
        (["a.pcapng", "ring.pcapng", "ring_00001_99999999999999.pcapng"], []),
        # in the order of the numbers, also within one second; other names and folders are others
        (
            [ring(2, NIGHT), ring(1, NIGHT), ring(1, NIGHT, "x/ring"), ring(10, MORNING), "other.pcap"],
            [([ring(1, NIGHT), ring(2, NIGHT), ring(10, MORNING)], [0, 0, 7]),
             ([ring(1, NIGHT, "x/ring")], [0])],
        ),
        # the first five were written over
        ([ring(6, NIGHT), ring(7, NIGHT)], [([ring(6, NIGHT), ring(7, NIGHT)], [5, 0])]),
        # packed ones, and the time in front of the number (nametimenum:2)
        (
            [ring(1, NIGHT, ending=".pcapng.gz"), f"r_{NIGHT}_00002.pcapng", f"r_{NIGHT}_00001.pcapng"],
            [([ring(1, NIGHT, ending=".pcapng.gz")], [0]),
             ([f"r_{NIGHT}_00001.pcapng", f"r_{NIGHT}_00002.pcapng"], [0, 0])],
        ),
        # dumpcap was started again: two runs, interleaved by number
        (
            [ring(1, NIGHT), ring(2, NIGHT), ring(1, NOON), ring(2, NOON), ring(3, NOON)],
            [([ring(1, NIGHT), ring(2, NIGHT)], [0, 0]),
             ([ring(1, NOON), ring(2, NOON), ring(3, NOON)], [0, 0, 0])],
        ),
        # a later run with lower numbers is not the beginning of the earlier one
        (
            [ring(8, NIGHT), ring(9, NIGHT), ring(1, NOON)],
            [([ring(1, NOON)], [0]), ([ring(8, NIGHT), ring(9, NIGHT)], [7, 0])],
        ),
        # summer time ends: the clock is set back by an hour
        (
            [ring(1, "20241027023000"), ring(2, "20241027025500"), ring(3, "20241027020500")],
            [([ring(1, "20241027023000"), ring(2, "20241027025500"), ring(3, "20241027020500")], [0] * 3)],
        ),
        # dumpcap counts on with 0 after 99999
        (
            [ring(99998, NIGHT), ring(99999, NIGHT), ring(0, MORNING), ring(1, MORNING)],
            [([ring(99998, NIGHT), ring(99999, NIGHT), ring(0, MORNING), ring(1, MORNING)],
              [99997, 0, 0, 0])],
        ),
        # editcap -c counts from 0
        ([ring(0, NIGHT), ring(2, NIGHT)], [([ring(0, NIGHT), ring(2, NIGHT)], [0, 1])]),
        # tcpdump -C: the first has no number
        (
            ["t.pcap", "t.pcap2", "t.pcap1", "t.pcap10", "u.pcap"],
            [(["t.pcap", "t.pcap1", "t.pcap2", "t.pcap10"], [0, 0, 0, 7])],
        ),
        # tcpdump -G
        (
            [f"g-{NOON}.pcap", f"g-{NIGHT}.pcap", "h_20240101-120000.pcap", "i20240101120000.pcap"],
            [([f"g-{NIGHT}.pcap", f"g-{NOON}.pcap"], [0, 0])],
        ),
    ],
)  # fmt: skip
def test_the_files_of_a_ring_buffer_by_their_names(
    names: list[str], expected: list[tuple[list[str], list[int]]]
) -> None:
    found = [(list(each.names), list(each.missing)) for each in rings(names)]
    assert sorted(found) == sorted(expected)
    assert not any(each.cyclic for each in rings(names))


def test_which_file_of_tcpdump_w_is_the_oldest_stands_in_no_name() -> None:
    assert rings(["w.pcap00", "w.pcap02", "w.pcap01"]) == [
        Ring(("w.pcap00", "w.pcap01", "w.pcap02"), (0, 0, 0), cyclic=True)
    ]
    assert rings(["w.pcap00", "w.pcap02"])[0].missing == (0, 0)
    assert is_part("w.pcap00")
    assert is_part("x.pcap7.gz")
    assert not is_part("w.pcap")


@pytest.mark.parametrize(
    ("first", "others", "name"),
    [
        (ring(1, NIGHT), [ring(2, NIGHT), "other.pcap", ring(1, NOON, "ringer")], "ring"),
        (ring(1, NIGHT), [ring(2, NIGHT), ring(1, NOON)], None),  # dumpcap was started again
        (ring(1, NIGHT), ["ring.pcap"], None),
        (ring(1, NIGHT), [ring(1, NIGHT, ending=".pcapng.gz")], None),
        ("t.pcap", ["t.pcap1", "t.pcap2"], "t"),
        ("t.pcap", ["t.pcap1", "t.pcapng"], None),
        ("w.pcap1", ["w.pcap2", "w.pcap0"], "w"),
        (f"g-{NIGHT}.pcap", [f"g-{NOON}.pcap"], "g"),
        ("a.b.pcapng.gz", [], "a.b"),
    ],
)
def test_the_name_of_a_series_is_its_own(first: str, others: list[str], name: str | None) -> None:
    assert own_name(first, [first, *others]) == name


# -- reading --------------------------------------------------------------------------------------


def as_one(paths: Sequence[Path]) -> CaptureResult:
    with Series([SeriesPart(path.name, str(path)) for path in paths]) as series:
        return analyze(series)


def said(result: CaptureResult) -> Any:
    return (
        result.frames, result.start_ns, result.complete, result.rpc, result.records, result.devices,
        result.transactions, result.findings, result.diagnoses, result.summary,
    )  # fmt: skip


def whole_of(path: Path, folder: Path) -> tuple[list[WholeFrame], CaptureResult]:
    """All frames of a capture, and what an analysis says of them."""
    frames = list(whole_frames(path))
    return frames, analyze(write(folder / "whole.pcapng", frames))


@pytest.mark.slow
def test_a_capture_cut_before_every_frame_says_the_same(captures: Path, tmp_path: Path) -> None:
    transactions = 0
    for path in sorted(captures.rglob("*.pcapng")):
        frames, whole = whole_of(path, tmp_path)
        if len(frames) > 400:
            continue
        result = as_one(pieces(tmp_path, frames, range(1, len(frames))))
        assert said(result) == said(whole), path.name
        assert [file.first_frame for file in result.files] == [*range(1, len(result.files) + 1)]
        transactions += len(result.transactions)
    assert transactions > 250


@pytest.mark.parametrize(
    "name", ["tour-machine", "transport-ip-fragments", "transport-rpc-fragments"]
)
def test_a_capture_cut_in_two_at_any_frame_says_the_same(
    captures: Path, tmp_path: Path, name: str
) -> None:
    (path,) = captures.glob(f"{name}.pcapng")
    frames, whole = whole_of(path, tmp_path)
    for cut in range(len(frames) + 1):
        assert said(as_one(pieces(tmp_path, frames, [cut]))) == said(whole), cut


def test_frames_are_numbered_as_mergecap_does(captures: Path, tmp_path: Path) -> None:
    if shutil.which("mergecap") is None:
        pytest.skip("mergecap is missing")
    parts = [captures / "tour-machine.pcapng", captures / "format-change.pcapng"]
    merged = tmp_path / "merged.pcapng"
    subprocess.run(["mergecap", "-a", "-w", merged, *parts], check=True)
    assert said(as_one(parts)) == said(analyze(merged))


def test_a_missing_file_ends_no_conversation_but_is_said(captures: Path, tmp_path: Path) -> None:
    """A poll is in the file that is gone: the job is answered all the same (docs/pairing.md, P38)."""
    frames, whole = whole_of(captures / "tour-machine.pcapng", tmp_path)
    polled = next(each for each in whole.transactions if each.frames.polls)
    poll = polled.frames.polls[0][0] or 0
    gone = pieces(tmp_path, frames, [poll - 1, poll + 1])[1]
    gone.unlink()
    (task,) = plan([str(path) for path in sorted(tmp_path.glob("ring*"))], series=True)
    parts = [SeriesPart(each.name, each.location, each.missing) for each in task.sources]
    with Series(parts) as series:
        result = analyze(series)
        assert series.gaps
    assert [file.missing_before for file in result.files] == [0, 1]
    assert result.complete
    (same,) = (each for each in result.transactions if each.id == polled.id)
    assert (same.state, same.parameters) == (polled.state, polled.parameters)
    assert len(same.frames.polls) == len(polled.frames.polls) - 1


def test_an_orphan_behind_a_gap_says_why(captures: Path, tmp_path: Path) -> None:
    frames = list(whole_frames(captures / "record-global.pcapng"))
    parts = pieces(tmp_path, frames, [0, len(frames) - 2])
    with Series(
        [SeriesPart("a", str(parts[0])), SeriesPart("c", str(parts[2]), missing=1)]
    ) as series:
        result = analyze(series)
    (finding,) = (each for each in result.findings if each.rule == "DS403")
    assert "dropped" in sentence(finding)


def test_a_damaged_file_costs_only_itself(captures: Path, tmp_path: Path) -> None:
    frames, whole = whole_of(captures / "tour-machine.pcapng", tmp_path)
    parts = pieces(tmp_path, frames, [4, 8, 20])
    parts[0].write_bytes(parts[0].read_bytes()[:-3])
    parts[1].write_text("nothing")
    result = as_one(parts)
    assert not result.complete
    assert result.problem is not None
    assert result.problem.startswith(parts[0].name)
    assert result.problem.endswith("(and 1 more files)")
    assert [file.frames for file in result.files] == [3, 0, 12, 17]
    assert [bool(file.problem) for file in result.files] == [True, True, False, False]
    asked = [each.request for each in whole.transactions[2:]]
    assert [each.request for each in result.transactions][-len(asked) :] == asked


def test_what_the_capturing_machine_dropped_is_summed_up(tmp_path: Path) -> None:
    series = Series([SeriesPart("no", str(tmp_path / "no.pcap"))])
    assert list(series) == []
    assert (series.frames, series.dropped, series.complete) == (0, None, False)
    assert series.files[0].readable is False
    with pytest.raises(CaptureError):
        analyze(tmp_path / "no.pcap")


# -- the command ----------------------------------------------------------------------------------


@pytest.fixture
def plant(captures: Path, tmp_path: Path) -> Path:
    """A ring buffer whose first files are gone and one is missing, and a capture beside it."""
    folder = tmp_path / "plant"
    folder.mkdir()
    frames = list(whole_frames(captures / "tour-machine.pcapng"))
    cuts = [3, 7, 12, 20, 29]
    for path in pieces(folder, frames, cuts):
        path.rename(folder / path.name.replace("_0000", "_0001"))
    (folder / ring(14, NIGHT)).unlink()
    shutil.copy(captures / "format-change.pcapng", folder)
    return folder


def run(capsys: Any, *arguments: str | Path) -> tuple[int, str, list[str]]:
    status = main(["report", *map(str, arguments)])
    shown = capsys.readouterr()
    return status, shown.out, shown.err.splitlines()


def test_the_report_names_files_and_frames(capsys: Any, plant: Path) -> None:
    status, text, problems = run(capsys, plant, "--series", "--filters")
    assert status == 0
    first = plant / ring(11, NIGHT)
    assert problems == [f"ds47: {first}: 1 file of this series missing"]
    lines = text.splitlines()
    at = lines.index(f"{first}: 29 frames")
    assert lines[at + 1].startswith("NOT OK: p50076 cannot be changed now")
    assert " (local) to " in lines[at + 3]
    assert lines[at + 4 : at + 11] == [
        "  5 files read as one, frames numbered through all of them",
        "    10 files before the first: overwritten, or not here",
        f"    {ring(11, NIGHT)}: frames 1 to 3",
        f"    {ring(12, NIGHT)}: frames 4 to 7",
        f"    {ring(13, NIGHT)}: frames 8 to 12",
        f"    1 file missing before {ring(15, NIGHT)}",
        f"    {ring(15, NIGHT)}: frames 13 to 21",
    ]
    refused = next(at for at, line in enumerate(lines) if "Write refused" in line)
    behind = lines[refused:]
    where = next(line for line in behind if "look at" in line)
    assert where.endswith("frame.number == 3")
    assert f"frame 15 (3 of {ring(15, NIGHT)}) (#" in where
    assert "All 2 captures" in text


def test_the_report_names_files_and_frames_in_chinese(capsys: Any, plant: Path) -> None:
    _, text, _ = run(capsys, plant, "--series", "--lang", "zh")
    lines = text.splitlines()
    at = lines.index("  5 个文件作为一个读取，帧号连续编排")
    assert lines[at + 1 : at + 6] == [
        "    第一个文件之前缺少 10 个文件：已被覆盖，或不在此处",
        f"    {ring(11, NIGHT)}: 帧 1 至 3",
        f"    {ring(12, NIGHT)}: 帧 4 至 7",
        f"    {ring(13, NIGHT)}: 帧 8 至 12",
        f"    {ring(15, NIGHT)} 之前缺少 1 个文件",
    ]
    assert f"    帧 15（{ring(15, NIGHT)} 的帧 3） #" in text
    assert "全部 2 个抓包" in lines


def test_what_to_do_names_files_and_frames(capsys: Any, captures: Path, tmp_path: Path) -> None:
    """A diagnosis that shows in two files: each has a filter of its own."""
    frames, whole = whole_of(captures / "real-stacks" / "o1_profinetpy062_be.pcapng", tmp_path)
    (diagnosis,) = (each for each in whole.diagnoses if each.rule == "DS711")
    first, second = diagnosis.frames
    folder = tmp_path / "plant"
    folder.mkdir()
    pieces(folder, frames, [first - 1, second - 1])
    _, text, _ = run(capsys, folder, "--series", "--filters")
    lines = text.splitlines()
    job = diagnosis.transactions[0]
    where = f"    look at frame {first} (1 of {ring(2, NIGHT)}) (#{job}, "
    (at,) = (number for number, line in enumerate(lines) if line.startswith(where))
    assert lines[at].endswith("): frame.number == 1")
    assert lines[at + 1] == f"      {ring(3, NIGHT)}: frame.number == 1"
    _, text, _ = run(capsys, folder, "--series", "-f", "overview")
    place = f"{first} (1 of {ring(2, NIGHT)})"
    assert f"    first in frame {place} of {folder / ring(1, NIGHT)}" in text.splitlines()


def test_an_answer_behind_a_gap_may_belong_to_what_was_lost(captures: Path, tmp_path: Path) -> None:
    """DS706 says that an answer is read at another place; its own request may be in a missing file."""
    path = captures / "diagnosis-request-here-read-there-answered.pcapng"
    frames, whole = whole_of(path, tmp_path)
    assert any(each.rule == "DS706" for each in whole.diagnoses)
    (first, second) = pieces(tmp_path, frames, [len(frames) - 1])
    for missing in (0, 1):
        parts = [SeriesPart("a", str(first)), SeriesPart("b", str(second), missing)]
        with Series(parts) as series:
            result = analyze(series)
        assert any(each.rule == "DS706" for each in result.diagnoses) is not bool(missing)


def test_a_series_in_json_says_where_its_files_begin(capsys: Any, plant: Path) -> None:
    _, text, _ = run(capsys, plant, "--series", "-f", "json", "--digest")
    document = json.loads(text)
    jsonschema.Draft202012Validator(report.schema()).validate(document)
    alone, series = document["captures"]
    assert "files" not in alone
    assert len(alone["sha256"]) == 64
    assert series["sha256"] is None
    assert [(file["first_frame"], file["frames"]) for file in series["files"]] == [
        (1, 3), (4, 4), (8, 5), (13, 9), (22, 8),
    ]  # fmt: skip
    assert all(len(file["sha256"]) == 64 for file in series["files"])
    _, lines, _ = run(capsys, plant, "--series", "-f", "ndjson")
    check = jsonschema.Draft202012Validator(report.schema("transaction-2"))
    for line in lines.splitlines():
        check.validate(json.loads(line))


@pytest.mark.slow
def test_a_series_is_the_same_from_processes_and_from_stored_results(
    capsys: Any, plant: Path, tmp_path: Path
) -> None:
    alone = run(capsys, plant, "--series", "-f", "text")
    assert run(capsys, plant, "--series", "-f", "text", "-j", "2") == alone
    stored = (plant, "--series", "-f", "text", "--results", tmp_path / "r")
    assert run(capsys, *stored) == alone
    assert run(capsys, *stored, "--resume") == alone
    (plant / ring(16, NIGHT)).unlink()
    _, _, problems = run(capsys, *stored, "--resume")
    assert problems[0] == "ds47: 1 capture done again: changed"


def test_without_the_option_every_file_is_a_capture(capsys: Any, plant: Path) -> None:
    _, text, _ = run(capsys, plant, "-f", "overview")
    assert "All 6 captures" in text


def test_the_files_of_tcpdump_w_begin_with_the_oldest(
    capsys: Any, captures: Path, tmp_path: Path
) -> None:
    frames, _ = whole_of(captures / "tour-machine.pcapng", tmp_path)
    folder = tmp_path / "w"
    folder.mkdir()
    for path, name in zip(pieces(tmp_path, frames, [8, 20]), (1, 2, 0), strict=True):
        path.rename(folder / f"w.pcap{name}")
    _, text, _ = run(capsys, folder, "--series", "-f", "json")
    (capture,) = json.loads(text)["captures"]
    assert [Path(file["path"]).name for file in capture["files"]] == [
        "w.pcap1",
        "w.pcap2",
        "w.pcap0",
    ]
    assert capture["summary"]["transactions"] == 8


def test_one_file_named_alone_is_the_whole_series(capsys: Any, plant: Path, tmp_path: Path) -> None:
    whole = run(capsys, plant, "--series", "-f", "ndjson")[1]
    alone = run(capsys, plant / ring(13, NIGHT), "--series", "-f", "ndjson")[1]
    assert alone
    assert set(alone.splitlines()) < set(whole.splitlines())
    twice = (plant / ring(13, NIGHT), f"{plant}/./{ring(13, NIGHT)}")
    assert run(capsys, *twice, "--series", "-f", "ndjson")[1] == alone
    _, text, _ = run(capsys, plant / ring(12, NIGHT), plant / ring(13, NIGHT), "--series")
    assert "2 files read as one" in text
    status, _, problems = run(capsys, tmp_path / ring(1, NIGHT), "--series")
    assert status == 3
    assert "No such file" in problems[-1]


def test_other_engines_know_no_series(capsys: Any, plant: Path) -> None:
    status, _, problems = run(capsys, plant, "--series", "--engine", "tshark")
    assert status == 2
    assert "--engine native" in problems[-1]


def test_where_a_frame_is() -> None:
    files = [CaptureFile("d/a", 1, 10), CaptureFile("d/b", 11, 0), CaptureFile("d/c", 11, 5)]
    places = FileFrames(files)
    assert places.words(10) == "frame 10 (10 of a)"
    assert places.words(10, "zh") == "帧 10（a 的帧 10）"
    assert places.words(11) == "frame 11 (1 of c)"
    assert places.by_file([12, 3, 11, 3]) == [("a", [3]), ("c", [1, 2])]
    assert FileFrames([]).by_file([2, 1]) == [("", [1, 2])]
    assert FileFrames([]).words(7) == "frame 7"
    assert (places.number(11), FileFrames([]).number(7)) == ("11 (1 of c)", "7")
