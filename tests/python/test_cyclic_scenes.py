"""The scenes of the cyclic channels: each says what it is made for and nothing else, and all of it is so."""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.audit import run

import ds47
from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.cli import main
from ds47.lab import captured
from ds47.lab.client import Client
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic
from ds47.lab.cyclic_scenes import ALONE, BOOK, SPEED, parameters
from ds47.lab.drive import LabDrive
from ds47.lab.machine import Machine
from ds47.lab.scenario import Scenario
from ds47.lab.stage import Stage
from ds47.model import CaptureResult
from ds47.regression.accept import merge
from ds47.regression.compare import Comparison
from ds47.regression.config import Config
from ds47.report import contract, timelines
from ds47.report import json as report_json
from ds47.report.html.views.timelines import WIDTH, views

SCENES = {each.name.removeprefix("cyclic-"): each for each in BOOK.scenarios}


def capture(scene: Scenario) -> bytes:
    return captured(scene.play())


def result(name: str) -> CaptureResult:
    return analyze(io.BytesIO(capture(SCENES[name])))


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_says_what_it_is_made_for(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.pcapng"
    path.write_bytes(capture(SCENES[name]))
    found = analyze(path)
    expect = SCENES[name].expect
    assert tuple((each.operation, each.state) for each in found.transactions) == expect.transactions
    assert {each.rule for each in found.findings} == expect.rules
    assert [str(each) for each in run.audit(path)] == []


def words(name: str) -> list[str]:
    (timeline,) = result(name).timelines
    return [
        f"{timelines.change(row)} {timelines.words(row).en}".strip()
        for row in timelines.rows(timeline)
    ]


def test_a_start_and_a_stop_as_events() -> None:
    told = words("start-and-stop")
    assert told[0] == "STW1 047E first seen"
    assert [each for each in told if "STW1" in each][1:] == [
        "STW1 047E -> 047F ON",
        "STW1 047F -> 047E OFF1",
    ]
    (stopped,) = [each for each in told if "no longer running" in each]
    # 30 % of a ramp of one second, in whole cycles, and one until the drive sees it
    assert stopped.endswith("320.1 ms after OFF1")


def test_a_word_that_the_drive_ignores_has_no_events_but_that() -> None:
    told = words("on-without-control")
    assert "STW1 047E -> 007E control by PLC ends" in told
    assert "STW1 007F -> 047E control by PLC" in told
    assert not [each for each in told if "ON" in each or "OFF1" in each]


def test_the_number_of_a_fault_where_the_telegram_has_it() -> None:
    (finding,) = result("fault-with-number").findings
    assert finding.args["code"] == 30002


def test_relations_of_process_data() -> None:
    relations = result("start-and-stop").relations
    assert [(each.channel, each.subslot, each.telegrams, each.certainty) for each in relations] == [
        ("pkw", 2, [353], "seen"),
        ("pzd", 3, [353], "seen"),
    ]
    (alone,) = result("fault-with-number").relations
    assert (alone.channel, alone.telegrams, alone.output.length) == ("pzd", [352], 12)


def test_values_are_sampled() -> None:
    (timeline,) = result("start-and-stop").timelines
    assert max(point.most for point in timeline.setpoint) == round(0.6 * 0x4000)
    speeds = [point.most for point in timeline.actual]
    assert max(speeds) == round(0.6 * 0x4000)
    assert min(speeds) == 0
    assert len(speeds) < 200


def test_both_languages_tell_events(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.pcapng"
    path.write_bytes(capture(SCENES["every-event"]))
    main(["report", str(path)])
    told = capsys.readouterr().out
    for text in ("jog 1", "direction reversed", "OFF3", "alarm gone", "S5 switching off"):
        assert text in told
    main(["report", "--lang", "zh", str(path)])
    told = capsys.readouterr().out
    for text in ("点动 1", "反向", "OFF3", "报警消除", "S5 正在停车"):
        assert text in told


def test_wireshark_finds_nothing_malformed(tmp_path: Path) -> None:
    path = tmp_path / "scene.pcapng"
    path.write_bytes(capture(SCENES["start-and-stop"]))
    asked = ["tshark", "-r", str(path), "-Y", "_ws.malformed"]
    told = subprocess.run(asked, capture_output=True, text=True, check=True)
    assert told.stdout == ""


def told(capsys: pytest.CaptureFixture[str], path: Path, *options: str) -> str:
    capsys.readouterr()
    assert main(["report", *options, str(path)]) == 0
    return capsys.readouterr().out


@pytest.fixture
def operation(tmp_path: Path) -> Path:
    """A capture with PKW, PZD and what they say of each other."""
    path = tmp_path / "operation.pcapng"
    path.write_bytes(capture(SCENES["change-in-operation"]))
    return path


def test_events_as_rows(operation: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "-f", "events", str(operation)]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    stopped = next(each for each in rows if each["name"] == "stopped")
    about = {key: stopped[key] for key in ("device", "slot", "subslot", "word", "state", "words")}
    assert about == {
        "device": "192.168.133.33", "slot": "2", "subslot": "3", "word": "ZSW1", "state": "S2",
        "words": "no longer running",
    }  # fmt: skip
    assert int(stopped["before"]) == 0xFB37
    assert 500 < float(stopped["after_ms"]) < 600
    assert [each["name"] for each in rows if each["after_ms"]] == ["running", "stopped"]


def test_channels_are_chosen(operation: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def there(channels: str) -> tuple[int, int, set[str]]:
        text = told(capsys, operation, "-f", "json", "--channels", channels)
        (plain,) = json.loads(text)["captures"]
        rules = {each["rule"] for each in plain["findings"]}
        return len(plain["transactions"]), len(plain.get("timelines", ())), rules

    assert there("ds47,pkw,pzd") == (2, 1, {"DS501", "DS530"})
    assert there("pkw") == (2, 0, {"DS501"})
    assert there("pzd") == (0, 1, set())
    assert there("ds47") == (0, 0, set())
    assert main(["report", "--channels", "pkw,uss", str(operation)]) == 2
    assert "'uss' is none of ds47, pkw, pzd" in capsys.readouterr().err
    assert len(ds47.analyze(operation, channels=["pkw"]).timelines) == 0
    with pytest.raises(ValueError, match="no channel 'uss'"):
        ds47.analyze(operation, channels=["uss"])


def test_json_comes_back(operation: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = json.loads(told(capsys, operation, "-f", "json"))["captures"][0]
    loaded = contract.CAPTURE.load(plain | {"problem": None, "dropped": None})
    assert contract.TIMELINE.plain(loaded.timelines[0]) == plain["timelines"][0]
    assert loaded.timelines[0].events == result("change-in-operation").timelines[0].events


def test_the_picture_of_a_drive(operation: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = told(capsys, operation, "-f", "html")
    drawings = re.findall(r"<figure class=\"drawing\"(.*?)</figure>", page, re.DOTALL)
    assert len(drawings) == 3  # the capture, the story of DS501, some cycles
    assert [" hidden>" in each.split("\n")[0] for each in drawings] == [True, False, True]
    story = drawings[1]
    states = re.findall(r"<g class=\"state is-(\w+)\"", story)
    assert states == ["none", "S1", "S2", "S2", "S3", "S4", "S5", "S2"]
    assert re.findall(r"<g class=\"flag is-(\w+)\"", story) == ["on", "off"]
    assert re.findall(r"<g class=\"job is-(\w+)\"", story) == ["bad", "ok"]
    assert "p304 := 50 error 17" not in story.split("<title>")[0]


def test_in_some_cycles_each_frame_is_a_tick(operation: Path) -> None:
    """All of those that the file has there, with their values; without the file those that were looked at."""
    found = analyze(operation)
    (view,) = views(found)
    cycles = view.drawings[-1]
    relation = found.relations[found.timelines[0].relation - 1]
    senders = [(side.mac, side.frame_id) for side in (relation.output, relation.input)]
    with open_capture(operation) as source:
        sent = [
            each.time_ns - (found.start_ns or 0) for each in source.everything()
            if (each.data[6:12].hex(":"), int.from_bytes(each.data[14:16])) in senders
        ]  # fmt: skip
    first, last = cycles.seconds, cycles.seconds + cycles.span
    assert len(cycles.frames) == len([each for each in sent if first <= each / 1e9 <= last]) > 70
    operation.unlink()
    (without,) = views(found)
    assert 0 < len(without.drawings[-1].frames) < len(cycles.frames) / 2


def test_the_picture_says_where_data_is_invalid(tmp_path: Path) -> None:
    found = result("controller-invalid")
    (view,) = views(found)
    whole, story, _ = view.drawings
    (hatched,) = whole.hatched
    assert hatched.words.en == "controller's data no longer valid"
    assert 0.4 < hatched.width / WIDTH * whole.span < 0.6  # half a second
    assert story.hatched
    assert view.opened == 1


def test_the_axis_has_round_times() -> None:
    (view,) = views(result("on-without-enable"))
    whole = view.drawings[0]
    assert [each.words for each in whole.times] == [f"{n} s" for n in range(2, 13, 2)]
    assert [each.words for each in whole.levels] == ["0 %", "+25 %", "+50 %"]


def test_what_a_hundred_percent_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = Stage()
    line = Cyclic(Client(stage), reduction=16)
    machine = Machine(line, LabDrive(cells=parameters())).connect().start().read(2000)
    machine.run(0.1)
    path = tmp_path / "p2000.pcapng"
    path.write_bytes(captured(stage))
    (read,) = analyze(path).transactions
    where = f"100 % is 50 (p2000, read in frame {read.frames.read_response})"
    assert where in told(capsys, path)
    assert where in told(capsys, path, "-f", "html")
    given = told(capsys, path, "--reference", "50Hz=1395rpm")
    assert "100 % is 50 Hz, 1395 rpm" in given
    page = told(capsys, path, "-f", "html", "--reference", "50Hz=1395rpm")
    assert "25 Hz, 697.5 rpm" in page
    for wrong in ("50", "Hz", "0Hz", "50Hz=", "1e3Hz"):
        assert main(["report", "--reference", wrong, str(path)]) == 2
        assert "no number with a unit" in capsys.readouterr().err


def test_other_events_are_a_change() -> None:
    def plain(name: str) -> dict[str, Any]:
        return report_json.capture(result(name))

    stored, now = plain("on-with-edge"), plain("on-from-the-first-frame")
    found = Comparison(stored, now, Config(), Path("x.pcapng"))
    changes = [each for each in found.changes() if each.kind == "event"]
    assert changes == []  # the same, only later
    other = plain("on-without-control")
    found = Comparison(stored, other, Config(), Path("x.pcapng"))
    (change,) = [each for each in found.changes() if each.kind == "event"]
    assert change.text == (
        "192.168.133.33 slot 2.3: event 1 was STW1 047F first, is STW1 047E first"
    )
    merged = merge(stored, other, found.pairs, [change])
    assert merged["timelines"] == other["timelines"]
    del stored["timelines"]
    found = Comparison(stored, other, Config(), Path("x.pcapng"))
    assert [each for each in found.changes() if each.kind == "event"] == []


WORDS = (
    0x047E,
    0x047F,
    0x04FE,
    0x0000,
    0x007F,
    0x047C,
    0x047B,
    0x0477,
    0x043F,
    0x0C7F,
    0x057E,
    0x0400,
)
"""Control words that programs send, and some that they should not."""
STEPS = st.one_of(
    st.tuples(st.just("control"), st.sampled_from(WORDS)),
    st.tuples(st.just("setpoint"), st.integers(-100, 100)),
    st.tuples(st.just("run"), st.sampled_from((0.016, 0.05, 0.3, 1.0, 2.5, 6.0, 11.0))),
    st.tuples(st.just("drive"), st.sampled_from(
        ("enabled", "off2", "off3", "local", "alarm", "blocked", "fault", "cleared")
    )),
    st.tuples(st.just("iops"), st.sampled_from((INPUT, OUTPUT))),
    st.tuples(st.just("read"), st.sampled_from((1082, 700, 2000, 999))),
    st.tuples(st.just("change"), st.sampled_from((304, 52, 1082))),
)  # fmt: skip


def play(machine: Machine, step: str, what: Any) -> None:
    if step in ("control", "setpoint", "run", "read"):
        getattr(machine, step)(what)
    elif step == "change":
        machine.change(what, b"\0\5", ak=2)
    elif step == "iops":
        good = machine.line.iops[what] == GOOD
        machine.line.iops[what] = BAD if good else GOOD
    else:
        value = getattr(machine.drive, what)
        setattr(machine.drive, what, (0 if value else 30001) if what == "fault" else not value)
    machine.run(0.016)


RANDOM = given(
    steps=st.lists(STEPS, max_size=14),
    begin=st.sampled_from(WORDS),
    telegram=st.sampled_from((353, 352, 1)),
)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@example(steps=[("control", 0x047F), ("change", 52), ("change", 304)], begin=0x047E, telegram=353)
@example(
    steps=[("control", word) for word in (0x047F, 0x047F, 0x047E, 0)], begin=0x047E, telegram=353
)
@RANDOM
def test_what_is_said_of_random_operation_is_so(
    steps: list[tuple[str, Any]], begin: int, telegram: int
) -> None:
    is_so(steps, begin, telegram)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@RANDOM
def test_what_is_said_of_much_random_operation_is_so(
    steps: list[tuple[str, Any]], begin: int, telegram: int
) -> None:
    is_so(steps, begin, telegram)


def is_so(steps: list[tuple[str, Any]], begin: int, telegram: int) -> None:
    """The auditor reads every frame; the analysis sees those in which something changes, and samples."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "talk.pcapng")
        path.write_bytes(captured(operated(steps, begin, telegram)))
        assert [str(each) for each in run.audit(path)] == []


def operated(steps: list[tuple[str, Any]], begin: int, telegram: int) -> Stage:
    """A drive with one of these telegrams, and what happens to it."""
    stage = Stage()
    modules = {353: (PKW, PZD), 352: (ALONE,), 1: (SPEED,)}[telegram]
    line = Cyclic(Client(stage), modules, reduction=16)
    machine = Machine(line, LabDrive(cells=parameters() if telegram == 353 else {}))
    machine.control(begin).connect().run(0.1)
    for step, what in steps:
        if telegram == 353 or step not in ("read", "change"):
            play(machine, step, what)
    machine.run(0.5)
    return stage


def test_the_printed_telegrams() -> None:
    """Nine of PKW, six of PZD, as they stand in the frames and as they are told."""
    found = result("as-printed")
    told = [(each.request or b"", each.response or b"") for each in found.transactions]
    assert [(one.hex(), two.hex()) for one, two in told] == [
        ("12bc000000000000", "12bc000000000002"), ("100a018000000000", "200a018042480000"),
        ("143a000000000000", "243a000042480000"), ("343a000042200000", "243a000042200000"),
        ("1019000000000000", "2019000043660000"),
    ]  # fmt: skip
    values = [(each.parameters[0].pnu, each.parameters[0].values) for each in found.transactions]
    assert values == [(700, [2]), (2010, [50.0]), (1082, [50.0]), (1082, [40.0]), (25, [230.0])]
    words = [(each.word, each.after) for each in found.timelines[0].events]
    for word in (("STW1", 0x047E), ("ZSW1", 0xFB31), ("STW1", 0x047F), ("STW1", 0x057E)):
        assert word in words
    assert found.findings == []
