"""The scenes of PROFIBUS: each rule speaks in its own, and says nothing in its near miss."""

from __future__ import annotations

import io
import re

import pytest

from ds47.analysis import analyze
from ds47.lab import captured, everything
from ds47.lab.fdl import PROFIBUS_DL, USER0
from ds47.lab.profibus_scenes import BOOK
from ds47.lab.scenario import Scenario
from ds47.spec import rules

SCENES = {each.name: each for each in BOOK.scenarios}
OF_BUS = {name: each for name, each in everything().items() if name.startswith("profibus-")}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("link", [PROFIBUS_DL, USER0])
def test_a_scene_says_what_it_is_made_for(name: str, link: int) -> None:
    scene = SCENES[name]
    stage = scene.play()
    stage.link = link
    result = analyze(io.BytesIO(captured(stage)))
    told = tuple((each.operation, each.state) for each in result.transactions)
    assert told == scene.expect.transactions
    expected = scene.expect.rules | scene.expect.diagnoses
    assert {each.rule for each in result.findings} == expected


def shown(scene: Scenario) -> tuple[bool, str]:
    """Whether a scene is a near miss, and of which rule."""
    near, rule = re.match(r"(Near )?(DS8\d\d): ", scene.shows).groups()  # type: ignore[union-attr]
    return near is not None, rule


def test_each_rule_has_a_scene_and_a_near_miss() -> None:
    expected = [each for each in rules() if each.startswith("DS8")]
    found = [shown(each) for each in SCENES.values()]
    assert sorted(rule for near, rule in found if not near) == expected
    assert sorted(rule for near, rule in found if near) == expected
    for scene in SCENES.values():
        near, rule = shown(scene)
        assert (rule in scene.expect.rules) != near


@pytest.mark.parametrize("name", OF_BUS)
def test_a_scene_plays_the_same_again(name: str) -> None:
    assert captured(OF_BUS[name].play()) == captured(OF_BUS[name].play())
