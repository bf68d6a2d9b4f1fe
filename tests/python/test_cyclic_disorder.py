"""Cyclic frames out of their order: what is found is so of the whole capture (docs/cyclic.md 4)."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from test_cyclic_holes import Frames, frames, written
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47.analysis import analyze
from ds47.lab import captured, everything
from ds47.model import Finding

SCENES = (
    "cyclic-off-by-the-controller", "cyclic-as-printed", "cyclic-saved-seldom", "cyclic-saved-often",
    "cyclic-slow-response", "cyclic-fault",
    "cyclic-fault-that-stays", "cyclic-motor-blocked", "cyclic-change-in-operation",
)  # fmt: skip
MOVES = ((4, 2), (6, 3), (7, 2), (3, 5))
"""Every which frame stands how many places later."""


def scene(name: str) -> Frames:
    return frames(captured(everything()[name].play()))


def moved(there: Frames, every: int, places: int) -> Frames:
    there = list(there)
    for at in range(len(there) - places - 1 - len(there) % every, 0, -every):
        there.insert(at + places, there.pop(at))
    return there


def rules(there: Frames) -> list[str]:
    return sorted(each.rule for each in analyze(io.BytesIO(written(there))).findings)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("move", MOVES)
def test_disorder_makes_no_finding(name: str, move: tuple[int, int], tmp_path: Path) -> None:
    there = scene(name)
    cut = moved(there, *move)
    assert [each for each in rules(cut) if each != "DS725"] == rules(there)
    assert rules(cut).count("DS725") <= 1  # where such a frame says something
    path = tmp_path / "moved.pcapng"
    path.write_bytes(written(cut))
    assert [str(each) for each in run.audit(path)] == []


def test_the_story_goes_on_by_the_time() -> None:
    (timeline,) = analyze(io.BytesIO(written(moved(scene(SCENES[0]), 4, 2)))).timelines
    times = [each.time_ns for each in timeline.events]
    assert times == sorted(times)
    assert [each.name for each in timeline.events].count("running") == 1
    assert "DS725" in rules(moved(scene(SCENES[0]), 4, 2))


STANDING = {
    "cyclic-does-not-start": "DS523", "cyclic-fault-that-stays": "DS524",
    "cyclic-on-without-enable": "DS521", "cyclic-setpoint-blocked": "DS525",
}  # fmt: skip
"""Values (DS526) are not looked at in each frame: what they show begins a frame earlier or later."""


def at_its_begin(name: str) -> tuple[Finding, Frames, list[Frames]]:
    """What stands in a scene, its frames, and the same with the first one of it a place earlier, or later."""
    there, swapped = scene(name), list[Frames]()
    told = standing(name, there)
    for place in (told.frame - 2, told.frame - 1):
        swapped.append([*there[:place], there[place + 1], there[place], *there[place + 2 :]])
    return told, there, swapped


def standing(name: str, there: Frames) -> Finding:
    findings = analyze(io.BytesIO(written(there))).findings
    (found,) = [each for each in findings if each.rule == STANDING[name]]
    return found


@pytest.mark.parametrize("name", STANDING)
def test_what_stands_began_when_by_the_clock_both_sides_said_so(name: str) -> None:
    told, there, swapped = at_its_begin(name)
    for others in swapped:
        found = standing(name, others)
        assert found.args == told.args
        assert others[found.frame - 1] == there[told.frame - 1]


@pytest.mark.parametrize("back_ms", [100, 900, 2500])
def test_a_clock_that_is_set_back_is_no_disorder(back_ms: int) -> None:
    """The counters go on."""
    there = scene(SCENES[0])
    half = len(there) // 2
    back = [(at - back_ms * 1_000_000, data) for at, data in there[half:]]
    assert "DS725" not in rules(there[:half] + back)


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [
        Source(f"{name} {move}", written(moved(scene(name), *move)), False)
        for name in SCENES for move in MOVES
    ]  # fmt: skip
    for name in STANDING:
        sources += [Source(name, written(each), False) for each in at_its_begin(name)[2]]
    compare(version, "en", sources, tmp_path)
