"""Conversations of S7 with CPUs and drives: what was done in them is the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from tests.audit import partners, reading, seeds

SHARES = 4
SLOW = Random("partners")
DRIVE = partners.Plan(7, 0.0, 0.0, None, (("drive", 0, True), ("cpu", 2, False)), 2, 6)


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_random_partners(share: int, tmp_path: Path) -> None:
    random = Random(f"partners {share}")
    for plan in (partners.planned(random) for _ in range(12)):
        assert list(map(str, partners.of(partners.play(plan), tmp_path))) == [], plan.text()


@pytest.mark.slow
def test_random_partners_with_holes(tmp_path: Path) -> None:
    for plan in (partners.planned(SLOW) for _ in range(8)):
        assert list(map(str, seeds.of_cuts(plan, tmp_path))) == [], plan.text()


def test_a_plan_is_read_as_it_is_written() -> None:
    for plan in (partners.planned(SLOW), DRIVE):
        assert seeds.plan(plan.text()) == plan


def test_a_wire_does_what_its_plan_says() -> None:
    calm = partners.play(DRIVE).tape.stage.shots
    plan = partners.Plan(7, 0.3, 0.3, 20, DRIVE.servers, 2, 6)
    shots = partners.play(plan).tape.stage.shots
    assert len({each.data for each in shots}) < len(shots) > len(calm)
    assert len({each.data for each in calm}) == len(calm)


def read(tmp_path: Path) -> tuple[partners.Conversation, reading.Reading]:
    made, path = partners.play(DRIVE), tmp_path / "partners.pcapng"
    made.tape.write(path)
    return made, reading.read(path, text=False, page=False)


def an_item(item: reading.Reading, of_drive: bool) -> dict[str, Any]:
    return next(
        each
        for deal in item.deals
        for each in deal.plain["items"]
        if ("parameter" in each) is of_drive and each["code"] == 255
    )


@pytest.mark.parametrize("change", ["element", "value", "address", "strange", "missing"])
def test_what_is_not_so_of_a_job_is_noticed(change: str, tmp_path: Path) -> None:
    made, item = read(tmp_path)
    assert list(partners.told(made, item)) == []
    if change == "element":
        del an_item(item, True)["parameter"]
    elif change == "value":
        an_item(item, False)["value"] += "00"
    elif change == "address":
        an_item(item, True)["parameter"]["subindex"] += 1
    elif change == "strange":
        an_item(item, False).update(parameter={"pnu": 1, "subindex": 0}, drive_object=0)
    else:
        item.deals.pop()
    assert list(partners.told(made, item)) != []


def test_who_is_a_drive_is_looked_at(tmp_path: Path) -> None:
    made, item = read(tmp_path)
    for each in item.plain["connections"]:
        each["drive"] = None if each.get("drive") else {"proof": "values"}
    found = {str(each) for each in partners.told(made, item) if each.where.count(".") == 3}
    assert len([each for each in found if "is a drive" in each]) == 1
    assert len([each for each in found if "is no drive" in each]) == 1


def test_what_is_said_of_shared_bytes_of_a_drive_is_noticed(tmp_path: Path) -> None:
    made, item = read(tmp_path)
    finding = item.findings[0]
    args = {**finding.args, "device": next(iter(made.drives))}
    item.findings.append(replace(finding, rule="DS907", args=args))
    assert [each.rule for each in partners.told(made, item)] == ["DS907"]
