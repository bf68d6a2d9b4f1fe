"""The auditor of names, units and physical values from descriptions notices each that is not so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.audit import described, reading
from tests.audit.memory import Memory

CAPTURE = Path(__file__).resolve().parents[2] / "captures/format-described.pcapng"
READ, OF_ANOTHER = 2, 3
"""Places of a transaction that is named, and of one of a drive object that has described nothing."""


def complaints(change: Callable[[list[dict[str, Any]]], object] | None = None) -> list[str]:
    found = reading.read(CAPTURE, page=False)
    if change is not None:
        change([deal.parameters[0] for deal in found.deals])
    return [each.text for each in described.check(found, Memory(found))]


def test_what_is_so_is_no_complaint() -> None:
    assert complaints() == []


LIES: dict[str, tuple[int, dict[str, Any], str]] = {
    "another name": (READ, {"name": "Ramp-down time"}, "is named 'Ramp-down time'"),
    "another value": (READ, {"scaled": [100.0]}, "is [100.0] s, not [10.0] s"),
    "another unit": (READ, {"unit": "ms"}, "is [10.0] ms, not [10.0] s"),
    "not scaled": (READ, {"scaled": None}, "is None s, not [10.0] s"),
    "a frame of another parameter": (
        READ,
        {"described_in": [20]},
        "named by frame 20, which came later",
    ),
    "a frame without a description": (READ, {"described_in": [4]}, "is not described in frame 4"),
    "not named": (READ, {"described_in": None}, "is not named 'Ramp-up time', as frame 8 says"),
    "of another drive object": (OF_ANOTHER, {"described_in": [8]}, "is not described in frame 8"),
}


@pytest.mark.parametrize(("place", "lie", "said"), LIES.values(), ids=LIES)
def test_a_lie_is_noticed(place: int, lie: dict[str, Any], said: str) -> None:
    found = complaints(lambda parameters: parameters[place].update(lie))
    assert any(said in each for each in found), found
