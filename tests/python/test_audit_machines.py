"""Machines in cyclic frames under any link header: what is said of them is what is said on plain Ethernet."""

from __future__ import annotations

from pathlib import Path
from random import Random
from typing import Any

import pytest
from tests.audit import cyclic, machines, reading, seeds, wire

from ds47.lab import captured

SHARES = 4
SLOW = Random("machines")
TWO = machines.Plan(33, wire.SLL2, (0x88A8, 0x8100), ("353", "1"), 16, 12)


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_random_machines(share: int, tmp_path: Path) -> None:
    random = Random(f"machines {share}")
    for plan in (machines.planned(random) for _ in range(12)):
        assert list(map(str, machines.of(machines.play(plan), tmp_path))) == [], plan.text()


@pytest.mark.slow
def test_random_machines_with_holes(tmp_path: Path) -> None:
    for plan in (machines.planned(SLOW) for _ in range(8)):
        assert list(map(str, seeds.of_cuts(plan, tmp_path))) == [], plan.text()


def test_a_plan_is_read_as_it_is_written() -> None:
    for plan in (machines.planned(SLOW), TWO):
        assert seeds.plan(plan.text()) == plan


def test_a_plan_is_played_the_same_each_time() -> None:
    once, again = (machines.play(TWO).tape.stage for _ in range(2))
    assert once.shots == again.shots


@pytest.mark.parametrize("link", [wire.ETHERNET, wire.SLL, wire.SLL2])
@pytest.mark.parametrize("tags", [(), (0x8100,), (0x9100, 0x88A8, 0x8100)])
def test_what_is_around_a_frame_is_what_the_plan_says(link: int, tags: tuple[int, ...]) -> None:
    plan = machines.Plan(8, link, tags, ("353",), 16, 2)
    for shot in machines.play(plan).tape.stage.shots:
        data = machines.wrapped(shot.data, plan)
        frame = wire.Frame(1, 0, data, len(data), link)
        assert wire.payload(frame) == (shot.data[12:14], shot.data[14:])
        assert wire.sender(frame) == shot.data[6:12]
        assert data.count(b"\xc0\x05") >= len(tags)


def read(tmp_path: Path) -> tuple[reading.Reading, reading.Reading]:
    made = machines.play(TWO)
    made.tape.write(tmp_path / "wrapped.pcapng")
    (tmp_path / "bare.pcapng").write_bytes(captured(made.tape.stage))
    item, bare = (
        reading.read(tmp_path / f"{each}.pcapng", text=False, page=False)
        for each in ("wrapped", "bare")
    )
    return item, bare


@pytest.mark.parametrize("key", ["transactions", "findings", "relations", "timelines"])
@pytest.mark.parametrize("change", ["other", "less", "more"])
def test_what_differs_from_plain_ethernet_is_noticed(key: str, change: str, tmp_path: Path) -> None:
    item, bare = read(tmp_path)
    assert list(machines.told(item, bare)) == []
    there: list[Any] = item.plain[key]
    if change == "other":
        there[-1] = {**there[-1], "new": 1}
    elif change == "less":
        there.pop()
    else:
        there.append(there[-1])
    assert [each.where for each in machines.told(item, bare)] == [key]


def test_each_drive_has_frames_of_its_own(tmp_path: Path) -> None:
    item, _ = read(tmp_path)
    numbers = [
        each.frame
        for relation in item.plain["relations"] if relation["channel"] == "pzd"
        for side in ("output", "input")
        for each in cyclic.parts(item, relation, side)
    ]  # fmt: skip
    assert sorted(numbers) == [each.frame.number for each in item.capture.rt]
