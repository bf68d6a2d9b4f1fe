"""PKW and PZD of a PPO: the scenes of cyclic frames, carried by PROFIBUS, say what they say on PROFINET."""

from __future__ import annotations

import io
from typing import Any

import pytest
from test_cyclic_scenes import SCENES, capture

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.model import PKW, PZD, CaptureResult, Side
from ds47.profibus import telegram
from ds47.profibus.bus import PROFIBUS_DL

STATION, MASTER = 3, 2
SHORT = b"\xe5"
SET_PRM = bytes.fromhex("b81e010080b501")
"""Of a MICROMASTER 4."""
ONLY_PROFINET = {"controller-invalid"}
"""IOPS, which PROFIBUS has not."""


class Bus:
    """A master and a slave that exchange what a controller and a device do."""

    def __init__(self, words: int) -> None:
        self.shots: list[tuple[int, bytes]] = []
        self._fcb, self._words = True, words

    def start(self, time_ns: int) -> None:
        """Set_Prm and Chk_Cfg of PPO1, PPO3 or another one with so many words of process data."""
        self._ask(time_ns, SET_PRM, 61)
        self.shots.append((time_ns, SHORT))
        self._ask(time_ns, bytes((0xF3, 0xF0 | (self._words - 1))), 62)
        self.shots.append((time_ns, SHORT))

    def exchange(self, out: tuple[int, bytes], in_: tuple[int, bytes]) -> None:
        """One exchange: data with its time, both ways."""
        self._ask(*out)
        self.shots.append((in_[0], telegram.encode(MASTER, STATION, 0x08, in_[1])))

    def _ask(self, time_ns: int, data: bytes, sap: int | None = None) -> None:
        self._fcb = not self._fcb
        fc = 0x7D if self._fcb else 0x5D
        own = None if sap is None else 62
        self.shots.append((time_ns, telegram.encode(STATION, MASTER, fc, data, sap, own)))

    def written(self) -> bytes:
        target = io.BytesIO()
        with PcapngWriter(target, link_type=PROFIBUS_DL) as writer:
            for shot in self.shots:
                writer.write(*shot)
        return target.getvalue()


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


def on_profibus(content: bytes) -> bytes | None:
    """The same words by PROFIBUS; None where there is no PKW beside PZD."""
    result = analyze(io.BytesIO(content))
    outputs, inputs = sides(result, "output"), sides(result, "input")
    if not outputs:
        return None
    bus, out = Bus(outputs[1].length // 2), None
    with open_capture(io.BytesIO(content)) as opened:
        for frame in opened.everything():
            if not bus.shots:
                bus.start(frame.time_ns)
            if (data := cut(frame.data, outputs)) is not None:
                out = frame.time_ns, data
            elif out is not None and (data := cut(frame.data, inputs)) is not None:
                bus.exchange(out, (frame.time_ns, data))
                out = None
    return bus.written()


def scenes() -> list[str]:
    """Those that PROFIBUS can have."""
    return [name for name in SCENES if name not in ONLY_PROFINET]


def transactions(result: CaptureResult) -> list[Any]:
    return [
        (
            each.operation, each.state, each.duration_ns,
            [
                (one.pnu, one.subindex, one.values, one.unit, one.error and one.error.code)
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
    assert events(here) == events(there)
    assert sorted(each.rule for each in here.findings) == sorted(
        each.rule for each in there.findings
    )
    assert {each.device for each in here.relations} == {f"dp{STATION}"}


def test_most_scenes_are_compared() -> None:
    made = [on_profibus(capture(SCENES[name])) for name in scenes()]
    assert sum(each is not None for each in made) > 30


def test_without_chk_cfg_nothing_is_guessed() -> None:
    bus = Bus(2)
    for number in range(50):
        bus.exchange((number * 1000, bytes(12)), (number * 1000, bytes(12)))
    assert analyze(io.BytesIO(bus.written())).relations == []


def test_another_maker_gets_no_findings() -> None:
    content = on_profibus(capture(SCENES["word-on-double-word"]))
    assert content is not None
    other = content.replace(
        telegram.encode(STATION, MASTER, 0x5D, SET_PRM, 61, 62),
        telegram.encode(STATION, MASTER, 0x5D, SET_PRM.replace(b"\x80\xb5", b"\x12\x34"), 61, 62),
    )
    assert other != content
    found = analyze(io.BytesIO(other))
    assert transactions(found)
    assert not [each for each in found.findings if each.severity != "note"]
