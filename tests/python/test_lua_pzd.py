"""PZD in Lua against Python: relations, events, and findings of operation, habits and what explains a refusal.

The scenes of the lab, captures of stories with channels that are named by hand, and operation by chance.
"""

from __future__ import annotations

import io
import random
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from test_cyclic_scenes import SCENES, WORDS, capture, operated
from test_lua_analysis import VERSIONS, Source, compare

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cyclic import named
from ds47.lab import captured
from ds47.lab.cyclic import INPUT, OUTPUT
from ds47.lab.cyclic_stories import BOOK
from ds47.model import Relation

NAMES = ("00:1c:06:00:00:01@8002:0:pzd", "00-1F-F8-00-00-01@0x8001:0:PZD")
"""Control and status word of the last story."""
ABSENT = ("00:1c:06:00:00:09@8002:0:ppo1", "00:1f:f8:00:00:01@8009:0:ppo1")
"""Of frames that nobody sends."""
CHANCES: tuple[tuple[str, tuple[Any, ...]], ...] = (
    ("control", WORDS), ("setpoint", tuple(range(-100, 101, 10))), ("run", (0.016, 0.05, 0.3, 1.0, 2.5, 6.0)),
    ("drive", ("enabled", "off2", "off3", "local", "alarm", "blocked", "fault", "cleared")),
    ("iops", (INPUT, OUTPUT)), ("read", (1082, 700, 2000, 999)), ("change", (304, 52, 1082)),
)  # fmt: skip
RULES = {f"DS{number}" for number in (*range(507, 513), *range(520, 532))}


@cache
def scene(name: str) -> Source:
    return Source(name, capture(SCENES[name]), False)


def sources(*names: str) -> list[Source]:
    """Those scenes, or all."""
    return [scene(name) for name in names or SCENES]


@pytest.mark.slow
@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("version", VERSIONS)
def test_scenes_give_the_same_result(version: str, lang: str, tmp_path: Path) -> None:
    compare(version, lang, sources(), tmp_path)


def test_some_scenes_give_the_same_result(tmp_path: Path) -> None:
    compare("5.4", "en", sources("fault", "every-event", "motor-blocked"), tmp_path)


@pytest.mark.slow
def test_the_scenes_have_every_rule() -> None:
    found = {each.rule for source in sources() for each in analyze(source.open()).findings}
    assert found >= RULES


def by_chance(seed: int) -> Source:
    """What may happen to a drive, as in test_cyclic_scenes, from a seed."""
    chance = random.Random(seed)
    steps = [chance.choice(CHANCES) for _ in range(chance.randint(1, 14))]
    told = [(step, chance.choice(what)) for step, what in steps]
    stage = operated(told, chance.choice(WORDS), chance.choice((353, 352, 1)))
    return Source(f"seed {seed}", captured(stage), False)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_operation_by_chance_gives_the_same_result(version: str, tmp_path: Path) -> None:
    first = 1000 * VERSIONS.index(version)
    compare(version, "en", [by_chance(seed) for seed in range(first, first + 40)], tmp_path)


def without_connect() -> io.BytesIO:
    """The last story without its IP frames."""
    content = capture(next(each for each in BOOK.scenarios if "start" in each.name))
    target = io.BytesIO()
    with open_capture(io.BytesIO(content)) as source, PcapngWriter(target) as writer:
        for frame in source.everything():
            if frame.data[12:14] != b"\x08\x00":
                writer.write(frame.time_ns, frame.data, frame.original_length)
    return io.BytesIO(target.getvalue())


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("wrong", [False, True])
def test_channels_named_by_hand(version: str, wrong: bool, tmp_path: Path) -> None:
    """At the right offset they are a drive, at another one no drive has such words."""
    names = tuple(named.parse(each.replace(":0:", ":2:" if wrong else ":0:")) for each in NAMES)
    options = AnalysisOptions(cyclic=names)
    source = Source("named", without_connect().getvalue(), False)
    result = analyze(source.open(), options)
    assert [each.certainty for each in result.relations] == ["refuted" if wrong else "named"]
    assert [each.rule for each in result.findings] == ([] if wrong else ["DS523"])
    assert result.timelines == [] if wrong else len(result.timelines[0].events) > 5
    compare(version, "en", [source], tmp_path, options)


def name_of(relation: Relation, kind: str, behind: int = 0) -> list[named.Name]:
    """Both directions of a channel as a user names it."""
    return [
        named.parse(f"{each.mac}@{each.frame_id:04x}:{each.offset + behind}:{kind}")
        for each in (relation.output, relation.input)
    ]


def joined(*contents: bytes) -> bytes:
    """One capture behind the other; of the first one only what is no IP."""
    target, since = io.BytesIO(), 0
    with PcapngWriter(target) as writer:
        for content in contents:
            with open_capture(io.BytesIO(content)) as source:
                frames = [
                    each for each in source.everything() if since or each.data[12:14] != b"\x08\x00"
                ]
            for each in frames:
                writer.write(each.time_ns + since, each.data, each.original_length)
            since += frames[-1].time_ns - frames[0].time_ns + 10**9
    return target.getvalue()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(
    ("kind", "of", "behind", "expected"),
    [
        ("pkw", "pkw", 0, ["pkw named 2", "pzd seen 2"]),
        ("pzd", "pzd", 0, ["pkw seen 2", "pzd named 2"]),
        ("pzd", "pkw", 0, ["pzd odd None", "pkw seen 2", "pzd seen 2"]),
        ("pzd", "pzd", 2, ["pzd refuted None", "pkw seen 2"]),
        ("pkw", "pkw", 1, ["pkw named None", "pzd seen 2"]),
        ("pkw", "pzd", 0, ["pkw named None", "pkw seen 2"]),
        ("pzd", "pkw", 1400, ["pzd named None", "pkw seen 2", "pzd seen 2"]),
    ],
)
def test_what_is_named_stays_where_a_connect_sets_it_up(
    version: str, kind: str, of: str, behind: int, expected: list[str], tmp_path: Path
) -> None:
    """What the Connect has there becomes that, with its slot; other bytes are as they were named."""
    source = scene("start-and-stop")
    there = next(each for each in analyze(source.open()).relations if each.channel == of)
    options = AnalysisOptions(cyclic=tuple(name_of(there, kind, behind)))
    result = analyze(source.open(), options)
    told = [f"{each.channel} {each.certainty} {each.slot}" for each in result.relations]
    assert told == expected
    assert behind == 1 or result.findings == []
    compare(version, "en", [source], tmp_path, options)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("channel", ["pkw", "pzd"])
def test_what_is_named_was_there_before_its_connect(
    version: str, channel: str, tmp_path: Path
) -> None:
    whole = scene("change-in-operation")
    first = analyze(whole.open())
    there = next(each for each in first.relations if each.channel == channel)
    options = AnalysisOptions(cyclic=tuple(name_of(there, channel)))
    content = joined(capture(SCENES["change-in-operation"]), capture(SCENES["change-in-operation"]))
    source = Source("joined", content, False)
    result = analyze(source.open(), options)
    told = [(each.certainty, each.slot) for each in result.relations if each.channel == channel]
    assert told == [("named", None), ("named", 2)]
    assert len(result.transactions) == len(first.transactions) * (2 if channel == "pkw" else 1)
    compare(version, "en", [source], tmp_path, options)
