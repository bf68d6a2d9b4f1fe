"""Channels that are named by hand, where a capture has no Connect, and who sends cyclic frames there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from report_formats import PRINTED
from test_cyclic_scenes import SCENES, capture
from test_lua_pzd import NAMES, without_connect

import ds47
from ds47.analysis import analyze
from ds47.batch import settings as batch_settings
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.cyclic.named import pairs, parse

CONTROLLER, DRIVE = "00:1c:06:00:00:01", "00:1f:f8:00:00:01"


@pytest.fixture
def story(tmp_path: Path) -> Path:
    """A drive that does not start, without its Connect."""
    path = tmp_path / "story.pcapng"
    path.write_bytes(without_connect().getvalue())
    return path


def report(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    capsys.readouterr()
    assert main(["report", *words]) == 0
    return capsys.readouterr().out


def test_the_report_says_who_sends_cyclic_frames_and_how_to_name_them(
    story: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = report(capsys, str(story))
    assert f"{CONTROLLER} -> {DRIVE}  frame id 0x8002, 40 bytes" in text
    line = next(each for each in text.splitlines() if "--cyclic" in each)
    named = report(capsys, *line.split(), str(story))
    assert "named by hand" in named
    assert "DS523" in named
    assert "without their Connect" not in named
    assert "slot" not in named.split("Findings")[0]


def test_senders_in_json_come_back(story: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = json.loads(report(capsys, "-f", "json", str(story)))["captures"][0]
    assert [each["frame_id"] for each in told["senders"]] == [0x8002, 0x8001]
    result = analyze(story)
    assert [(each.mac, each.to) for each in result.senders] == [
        (CONTROLLER, DRIVE), (DRIVE, CONTROLLER),
    ]  # fmt: skip


def test_with_a_connect_nobody_is_asked(tmp_path: Path) -> None:
    path = tmp_path / "whole.pcapng"
    path.write_bytes(capture(SCENES["fault"]))
    assert analyze(path).senders == []


def test_what_is_named_has_no_place_and_no_cycle(story: Path) -> None:
    result = ds47.analyze(str(story), cyclic=NAMES)
    (relation,) = result.relations
    place = (relation.api, relation.slot, relation.subslot, relation.cycle_ms)
    assert place == (None, None, None, None)
    assert (relation.controller, relation.device, relation.frame) == (CONTROLLER, DRIVE, 1)


def test_pkw_that_is_named_gives_the_same_transactions(tmp_path: Path) -> None:
    """PKW and PZD of a drive, named as the Connect says: the same but for what only a Connect knows."""
    whole, path = tmp_path / "whole.pcapng", tmp_path / "named.pcapng"
    whole.write_bytes(capture(SCENES["change-in-operation"]))
    first = analyze(whole)
    with open_capture(whole) as source, PcapngWriter(path) as writer:
        for frame in source.everything():
            if frame.data[12:14] != b"\x08\x00":
                writer.write(frame.time_ns, frame.data, frame.original_length)
    names = [
        f"{side.mac}@{side.frame_id:04x}:{side.offset}:{each.channel}"
        for each in first.relations for side in (each.output, each.input)
    ]  # fmt: skip
    second = ds47.analyze(str(path), cyclic=names)
    own = [each for each in first.transactions if each.channel == "pkw"]
    assert own
    told = [
        (each.operation, each.state, each.request, each.response, each.duration_ns) for each in own
    ]
    assert told == [
        (each.operation, each.state, each.request, each.response, each.duration_ns)
        for each in second.transactions
    ]
    assert [each.name for each in first.timelines[0].events] == [
        each.name for each in second.timelines[0].events
    ]
    assert {each.slot for each in second.transactions} == {None}
    assert {each.cycles for each in second.transactions} == {None}


def test_every_format_has_room_for_it(story: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = [word for name in NAMES for word in ("--cyclic", name)]
    told = {name: report(capsys, *options, "-f", name, str(story)) for name in PRINTED}
    assert all(told[name] for name in ("text", "json", "csv", "events", "html", "junit", "sarif"))


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["00:1b@8000:0:pkw"], "is not MAC@FRAMEID:OFFSET:KIND"),
        (["00:1b:1b:11:22:33@8000:0:stw"], "'stw' is none of pkw, pzd, ppo1"),
        (["00:1b:1b:11:22:33@feff:0:pkw"], "from 0100 to FBFF"),
        (["00:1b:1b:11:22:33@8000:1440:pkw"], "at most 1440 bytes"),
        (["00:1b:1b:11:22:33@8000:0:pkw"], "two directions"),
        (["00:1b:1b:11:22:33@8000:0:pkw", "00:1f:f8:11:22:33@8001:0:pzd"], "of one kind"),
    ],
)
def test_a_name_that_is_none_is_told_in_one_line(
    names: list[str], words: str, story: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word for name in names for word in ("--cyclic", name)]
    assert main(["report", *given, str(story)]) == 2
    (line,) = [each for each in capsys.readouterr().err.splitlines() if "--cyclic" in each]
    assert words in line
    with pytest.raises(ValueError, match=words.split("'")[-1]):
        pairs([parse(each) for each in names])


def with_settings(story: Path, text: str) -> Path:
    (story.parent / "ds47.toml").write_text(text, encoding="utf-8")
    batch_settings._nearest.cache_clear()
    return story


def test_a_folder_names_its_channels(
    story: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = report(capsys, str(story))
    with_settings(story, f"[cyclic]\nchannels = {list(NAMES)!r}\n")
    assert "DS523" not in plain
    assert "DS523" in report(capsys, str(story))
    assert main(["baseline", str(story)]) == 0
    assert main(["check", str(story)]) == 0
    results = tmp_path / "results"
    assert "DS523" in report(capsys, "--results", str(results), str(story))
    with_settings(story, "[cyclic]\nchannels = []\n")
    assert "DS523" not in report(capsys, "--results", str(results), str(story))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[cyclic]\nchannels = 'x'", "[cyclic] channels: write a list of texts"),
        ("[cyclic]\nchannels = ['x']", "[cyclic] channels: 'x' is not MAC@FRAMEID:OFFSET:KIND"),
        ("[cyclic]\nlayout = 'uss'", "unknown key 'layout'; known are channels, pkw_layout"),
        ("[cyclic]\npkw_layout = ['us']", "cyclic or uss"),
        ("cyclic = 3", "write it as a table"),
        ("[cyclic", "ds47.toml"),
    ],
)
def test_settings_that_cannot_be_are_told_in_one_line(
    text: str, words: str, story: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with_settings(story, text)
    results = str(tmp_path / "results")
    for command, status in ((["report"], 3), (["report", "--results", results], 3), (["check"], 2)):
        assert main([*command, str(story)]) == status
        told = capsys.readouterr()
        line = next(each for each in (told.err + told.out).splitlines() if "ds47.toml" in each)
        assert words in line
        assert "Traceback" not in told.err
