"""The auditor of what values mean notices each that is not so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.audit import meant, reading

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
FAULTS, STATES = "tour-machine.pcapng", "diagnosis-commissioning-state-not.pcapng"


def complaints(
    name: str, pnu: int, change: Callable[[dict[str, Any]], object] | None = None
) -> list[str]:
    found = reading.read(CAPTURES / name, page=False)
    told = [each for deal in found.deals for each in deal.parameters if each["pnu"] == pnu]
    assert told[0]["meaning"]
    if change is not None:
        change(told[0])
    return [each.text for each in meant.check(found)]


@pytest.mark.parametrize(("name", "pnu"), [(FAULTS, 945), (STATES, 10)])
def test_what_is_so_is_no_complaint(name: str, pnu: int) -> None:
    assert complaints(name, pnu) == []


LIES: dict[str, tuple[str, int, Callable[[dict[str, Any]], object], str]] = {
    "another text": (STATES, 10, lambda told: told.update(meaning="ready"), "means 'ready'"),
    "no text": (STATES, 10, lambda told: told.pop("meaning"), "has no meaning"),
    "another value": (STATES, 10, lambda told: told.update(values=[77]), "by the tables [None"),
    "without a value": (STATES, 10, lambda told: told.update(values=None), "without a value"),
    "gone faults": (FAULTS, 945, lambda told: told.update(subindex=8), "means 'active"),
    "too few": (FAULTS, 945, lambda told: told.update(meaning="active: 7900"), "means 'active"),
}


@pytest.mark.parametrize(("name", "pnu", "lie", "said"), LIES.values(), ids=LIES)
def test_a_lie_is_noticed(
    name: str, pnu: int, lie: Callable[[dict[str, Any]], object], said: str
) -> None:
    found = complaints(name, pnu, lie)
    assert any(said in each for each in found), found


WORDS = [
    ({"connects": "bit"}, [722 << 16 | 63 << 10 | 2], 0, "from r0722.2"),
    ({"connects": "bit"}, [722 << 16 | 2 << 10 | 2], 0, None),
    ({"connects": "index"}, [1], 0, None),
    ({"buffer": "faults", "entry": "faults.code"}, [0] * 8 + [7901, 0, 30001], 0,
     "no active fault; acknowledged situation 1: 7901, 30001"),
    ({"buffer": "alarms", "entry": "alarms.code"}, [0] * 8 + [7910] + [0] * 9 + [7911], 0,
     "no active alarm; gone: 7910, 7911"),
    ({"buffer": "faults", "entry": "faults.code"}, [0], 9, None),
    ({"values": [[1, "one", ""]]}, [1, 2], 0, "one, 2"),
    ({"values": [[1, "one", ""]]}, [1.0], 0, None),
]  # fmt: skip


@pytest.mark.parametrize(("row", "values", "first", "text"), WORDS)
def test_words(row: dict[str, Any], values: list[Any], first: int, text: str | None) -> None:
    found = meant._words(row, values, first)
    assert found is None if text is None else str(found).startswith(text)
