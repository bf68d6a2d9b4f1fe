"""PKW and PZD of a PPO: the scenes of cyclic frames, carried by PROFIBUS, say what they say on PROFINET."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from test_cyclic_scenes import SCENES, capture

import ds47
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.cyclic import channels
from ds47.cyclic.named import parse_ppo
from ds47.lab import captured
from ds47.lab.master import SET_PRM, Master
from ds47.model import NAMED, PKW, PZD, CaptureResult, Side
from ds47.profibus import PROFIBUS_DL

STATION = 3
START_UP = 8
"""Frames before the first data exchange."""
ONLY_PROFINET = {
    "controller-invalid", "request-ignored", "request-ignored-shortly", "fault-of-another-maker",
    "fault-behind-invalid-data",
}  # fmt: skip
"""IOPS, which PROFIBUS has not; lengths that prove nothing, where PROFIBUS has Chk_Cfg; vendor ids."""


def sides(result: CaptureResult, way: str) -> list[Side]:
    """Where PKW and PZD are in the frames of one direction; none where there are others."""
    found = {each.channel: getattr(each, way) for each in result.relations}
    whole = set(found) == {PKW, PZD} and len(result.relations) == len(found)
    return [found[PKW], found[PZD]] if whole else []


def cut(data: bytes, places: list[Side]) -> bytes | None:
    """The bytes of PKW and PZD in a frame; None where it is another one."""
    at = 16 if data[12:14] == b"\x81\x00" else 12
    first = places[0]
    head = b"\x88\x92" + first.frame_id.to_bytes(2)
    if data[6:12].hex(":") != first.mac or data[at : at + 4] != head:
        return None
    return b"".join(
        data[at + 4 + each.offset : at + 4 + each.offset + each.length] for each in places
    )


def on_profibus(content: bytes, set_prm: str = SET_PRM) -> bytes | None:
    """The same words by PROFIBUS; None where there is no PKW beside PZD."""
    result = analyze(io.BytesIO(content))
    outputs, inputs = sides(result, "output"), sides(result, "input")
    if not outputs:
        return None
    configured = bytes((0xF3, 0xF0 | (outputs[1].length // 2 - 1))).hex()
    master, out = Master(), b""
    stage = master.stage
    stage.gap_ns = 0
    with open_capture(io.BytesIO(content)) as opened:
        for frame in opened.everything():
            stage.now_ns = frame.time_ns
            if not stage.shots:
                master.start(STATION, set_prm, configured)
            if (data := cut(frame.data, outputs)) is not None:
                out = data
                master.ask(STATION, data.hex())
            elif out and (data := cut(frame.data, inputs)) is not None:
                master.tell(STATION, data.hex())
                out = b""
    return captured(stage)


def scenes() -> list[str]:
    """Those that PROFIBUS can have."""
    return [name for name in SCENES if name not in ONLY_PROFINET]


def transactions(result: CaptureResult) -> list[Any]:
    """Without names and units: the same number means another thing on the MICROMASTER that PROFIBUS names."""
    return [
        (
            each.operation, each.state, each.duration_ns,
            [
                (one.pnu, one.subindex, one.values, one.error and one.error.code)
                for one in each.parameters
            ],
        )
        for each in result.transactions if each.channel == PKW
    ]  # fmt: skip


def events(result: CaptureResult) -> list[Any]:
    return [
        (each.time_ns, each.name, each.before, each.after, each.state, each.overlays)
        for timeline in result.timelines
        for each in timeline.events
    ]


@pytest.mark.parametrize("name", scenes())
def test_a_scene_says_the_same_on_profibus(name: str) -> None:
    content = capture(SCENES[name])
    bus = on_profibus(content)
    if bus is None:
        pytest.skip("no PKW beside PZD")
    there, here = analyze(io.BytesIO(content)), analyze(io.BytesIO(bus))
    assert transactions(here) == transactions(there)
    assert {each.station for each in here.transactions} <= {3}
    assert {each.station for each in there.transactions} <= {None}
    assert events(here) == events(there)
    assert sorted(each.rule for each in here.findings) == sorted(
        each.rule for each in there.findings
    )
    assert {each.device for each in here.relations} == {f"dp{STATION}"}
    assert {each.station for each in here.transactions} <= {STATION}


def test_most_scenes_are_compared() -> None:
    made = [on_profibus(capture(SCENES[name])) for name in scenes()]
    assert sum(each is not None for each in made) > 30


def long_line(exchanges: int = 6000) -> bytes:
    """A drive that is started and stopped, and asked by PKW; setpoint and actual value move in every cycle."""
    master = Master()
    stage = master.stage
    master.start(STATION, SET_PRM, "f3f1")
    for number in range(exchanges):
        stage.now_ns, place = 1_000_000_000 + number * 2_000_000, number % 701
        asked = "12bc000000000000" if place > 500 else "00" * 8
        told = "12bc000000000002" if place > 503 else "00" * 8
        stw1, zsw1 = ("047f", "fb37") if 100 < place < 400 else ("047e", "fb31")
        values = (number * 7 & 0x3FFF).to_bytes(2).hex()
        master.ask(STATION, asked + stw1 + values)
        master.tell(STATION, told + zsw1 + values)
    return captured(stage)


def test_of_a_long_line_what_says_the_same_is_looked_at_now_and_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looked: list[int] = []
    take = channels.CyclicChannels._take

    def counting(self: channels.CyclicChannels, *args: Any) -> None:
        looked.append(1)
        take(self, *args)

    monkeypatch.setattr(channels.CyclicChannels, "_take", counting)
    content = long_line()
    here, few = analyze(io.BytesIO(content)), len(looked)
    monkeypatch.setattr(channels, "_DENSE", 1 << 60)
    there = analyze(io.BytesIO(content))
    assert few < 0.75 * (len(looked) - few)
    assert transactions(here) == transactions(there)
    assert len(transactions(here)) == 8
    assert events(here) == events(there)
    assert here.findings == there.findings


def test_without_chk_cfg_nothing_is_guessed() -> None:
    master = Master()
    for _ in range(50):
        master.exchange(STATION)
    assert analyze(io.BytesIO(captured(master.stage))).relations == []


def running() -> bytes:
    """A scene on PROFIBUS without its start-up."""
    content = on_profibus(capture(SCENES["word-on-double-word"]))
    assert content is not None
    target = io.BytesIO()
    with (
        open_capture(io.BytesIO(content)) as opened,
        PcapngWriter(target, link_type=PROFIBUS_DL) as writer,
    ):
        for frame in opened.everything():
            if frame.number > START_UP:
                writer.write(frame.time_ns, frame.data)
    return target.getvalue()


def named(*ppos: tuple[int, int]) -> CaptureResult:
    return analyze(io.BytesIO(running()), AnalysisOptions(ppos=ppos))


def without_units(result: CaptureResult) -> list[Any]:
    """Units come from the tables of a maker, and nobody says whose drive it is."""
    return [(*each[:3], [(*one[:3], *one[4:]) for one in each[3]]) for each in transactions(result)]


def test_a_named_ppo_says_what_chk_cfg_says() -> None:
    whole = on_profibus(capture(SCENES["word-on-double-word"]))
    assert whole is not None
    there, here = analyze(io.BytesIO(whole)), named((STATION, 1))
    assert without_units(here) == without_units(there) != []
    assert events(here) == events(there)
    rules = [each.rule for each in there.findings]
    assert [each.rule for each in here.findings] == rules
    assert {(each.certainty, each.frame) for each in here.relations} == {(NAMED, 1)}


def test_nothing_is_named_of_another_station() -> None:
    assert named((4, 1)).relations == []
    assert transactions(named((4, 1))) == []


def test_a_name_with_other_lengths_is_not_there() -> None:
    found = named((STATION, 2))
    assert [each.frame for each in found.relations] == [None] * len(found.relations) != []
    assert transactions(found) == []
    assert events(found) == []


def test_chk_cfg_counts_more_than_a_name() -> None:
    whole = on_profibus(capture(SCENES["word-on-double-word"]))
    assert whole is not None
    there = analyze(io.BytesIO(whole))
    here = analyze(io.BytesIO(whole), AnalysisOptions(ppos=((STATION, 3),)))
    assert here == there


def test_the_report_says_how_to_name_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def report(folder: str, *words: str, settings: str = "") -> str:
        path = tmp_path / folder / "running.pcapng"
        path.parent.mkdir()
        path.write_bytes(running())
        (path.parent / "ds47.toml").write_text(settings, encoding="utf-8")
        assert main(["report", *words, str(path)]) == 0
        return capsys.readouterr().out

    line = next(each for each in report("nobody").splitlines() if "--ppo" in each)
    assert line.endswith(": --ppo 3=ppo1 | --ppo 3=ppo4")
    for text in (
        report("command", "--ppo", "3=PPO1"),
        report("file", settings='[cyclic]\nppo = ["3=ppo1"]\n'),
    ):
        assert "named by hand" in text
        assert "--ppo" not in text


def test_the_library_takes_names() -> None:
    found = ds47.analyze(io.BytesIO(running()), ppos={STATION: 1})
    assert found.transactions
    with pytest.raises(ValueError, match="is not STATION=PPO"):
        ds47.analyze(io.BytesIO(running()), ppos={STATION: 6})


@pytest.mark.parametrize("text", ["3", "3=ppo6", "127=ppo1", "x=ppo1", "3=ppo1x", ""])
def test_a_wrong_name_is_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="is not STATION=PPO, as in 3=ppo1"):
        parse_ppo(text)
    path = tmp_path / "running.pcapng"
    path.write_bytes(running())
    assert main(["report", "--ppo", text, str(path)]) == 2
    (tmp_path / "ds47.toml").write_text(f'[cyclic]\nppo = ["{text}"]\n', encoding="utf-8")
    assert main(["report", str(path)]) == 3
    assert "[cyclic] ppo" in capsys.readouterr().err


def test_another_maker_gets_no_findings() -> None:
    scene = capture(SCENES["word-on-double-word"])
    other = on_profibus(scene, SET_PRM.replace("80b5", "1234"))
    assert other is not None
    found = analyze(io.BytesIO(other))
    assert transactions(found)
    assert not [each for each in found.findings if each.severity != "note"]


def test_a_configuration_that_is_no_ppo_ends_the_channels() -> None:
    wire = Master()
    wire.start(STATION)
    wire.exchange(STATION)
    wire.exchange(STATION, "12bc000000000000047e0000", "00" * 12)
    wire.exchange(STATION, "12bc000000000000047e0000", "12bc00000000000102310000")
    wire.start(STATION, configured="1f2f")
    wire.exchange(STATION, "1001" * 8, "00" * 16)
    wire.exchange(STATION, "1001" * 8, "100100000000000104370000" + "00" * 4)
    result = analyze(io.BytesIO(captured(wire.stage)))
    assert [each.request for each in result.transactions] == [bytes.fromhex("12bc000000000000")]


def test_requests_before_a_start_up_are_requests() -> None:
    """The recording began without Set_Prm, so the channels are others when its ident number is known."""
    wire = Master()
    wire.ask(STATION, "f3f1", 62)
    wire.short()
    for out in ("00" * 12, "12bc000000000000047e0000", "00" * 8 + "047f0000"):
        wire.exchange(
            STATION, out, out[:16] + "02310000" if out[:2] == "12" else "00" * 8 + "02310000"
        )
    wire.start(STATION)
    for _ in range(3):
        wire.exchange(STATION, "00" * 8 + "047f0000", "00" * 8 + "02310000")
        wire.exchange(STATION, "00" * 8 + "047e0000", "00" * 8 + "02330000")
    result = analyze(io.BytesIO(captured(wire.stage)))
    assert len(result.transactions) == 1
    assert [each.rule for each in result.findings if each.rule == "DS512"] == []
