"""Conversations over wires that lose, double and delay datagrams: what clients and drive did is the truth."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from tests.audit import ends, lossy, reading, seeds

KINDS = seeds.of_wires()
SHARES = 4


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_once_untrue_over_a_wire(kind: str, tmp_path: Path) -> None:
    """Of each kind three conversations, near the controllers and near the drive."""
    assert len(KINDS[kind]) == 3
    for plan in KINDS[kind]:
        assert list(map(str, ends.of(lossy.play(plan), tmp_path))) == [], plan.text()


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_random_wires(share: int, tmp_path: Path) -> None:
    random = Random(f"wires {share}")
    for plan in (lossy.planned(random) for _ in range(6)):
        assert list(map(str, ends.of(lossy.play(plan), tmp_path))) == [], plan.text()


def test_a_plan_is_read_as_it_is_written() -> None:
    plan = lossy.planned(Random(1))
    assert seeds.plan(plan.text()) == plan


def test_a_wire_does_what_its_plan_says() -> None:
    made = lossy.play(KINDS["a second answer with other bytes"][0])
    near, far = made.near.labels, made.far.labels
    assert [each for each in near if each[2]] != [each for each in far if each[2]]
    assert made.near.shots == sorted(made.near.shots, key=lambda shot: shot[0])
    said = [each.said for job in made.jobs for each in job.reads]
    assert any(len(each) > 1 and each[0] != each[1] for each in said)


def told(tmp_path: Path, kind: str, change: str) -> list[str]:
    """What is complained of in a report into which somebody wrote something else."""
    made = lossy.play(KINDS[kind][0])
    made.near.write(tmp_path / "near.pcap")
    item = reading.read(tmp_path / "near.pcap", text=False, page=False)
    first = next(each for each in item.deals if each.plain["bytes"]["response"] and each.polls)
    if change == "missing":
        item.deals.remove(first)
    elif change == "twice":
        item.deals.append(first)
    elif change == "polls":
        first.polls.append(first.polls[0])
    elif change == "response":
        first.plain["bytes"]["response"] = first.plain["bytes"]["response"][:-2]
    elif change == "request":
        first.plain["bytes"]["request"] += "00"
    else:
        first.frames["write_request"] = None
    return [each.text for each in ends.told(made, made.near, item)]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ("missing", "are 0 transactions"),
        ("twice", "are 2 transactions"),
        ("polls", "polls, not"),
        ("response", "has the response"),
        ("request", "has another request"),
        ("orphan", "has a request that is in the capture"),
    ],
)
def test_what_is_not_so_is_complained_of(tmp_path: Path, change: str, complaint: str) -> None:
    found = told(tmp_path, "DE80B100 leaves it open", change)
    assert found
    assert any(complaint in each for each in found)


def test_an_end_of_the_connection_that_nothing_waited_for_is_complained_of(tmp_path: Path) -> None:
    """A request that was written again, and accepted, is not open any more."""
    made = lossy.play(KINDS["a Write whose response was lost, written again"][0])
    made.near.write(tmp_path / "near.pcap")
    item = reading.read(tmp_path / "near.pcap", text=False, page=False)
    again = next(each for each in item.findings if each.args.get("what") == "written_again")
    again.rule = "DS722"
    (text,) = [each.text for each in ends.told(made, made.near, item)]
    assert "was accepted there" in text
