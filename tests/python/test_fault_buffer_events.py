"""Faults that were read from the fault buffer are events of the plots."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import handmade
import pytest

from ds47.analysis import analyze
from ds47.model import CaptureResult, Parameter, ParameterError, Transaction
from ds47.report.html.views.events import SHOWN, events

CAPTURES = Path(__file__).parents[2] / "captures"


def read(
    number: int, values: list[Any], first: int = 0, pnu: int = 945, **about: Any
) -> Transaction:
    """A read of the fault buffer of drive object 2."""
    item = handmade.transaction(
        id=number,
        start_ns=10**18 + number * 10**6,
        duration_ns=500_000,
        operation="read",
        state="ok",
        **about,
    )
    item.parameters = [
        Parameter(pnu, first, "value", len(values), format="Unsigned16", values=values)
    ]
    return item


def told(*items: Transaction) -> list[tuple[int, str, str]]:
    result = CaptureResult("x", start_ns=10**18, transactions=list(items))
    return [(each[0], each[1], each[2]) for each in events(result)]


def test_a_fault_is_told_when_it_is_new_and_when_none_is_left() -> None:
    assert told(
        read(1, [0, 0]), read(2, [7900, 0]), read(3, [7900, 0]), read(4, [30002, 7900]), read(5, [7900], 1),
        read(6, [0, 0]), read(7, [0, 0]), read(8, [7900, 7900]),
    ) == [
        (2500, "fault", "read from the fault buffer, r0945: 7900"),
        (4500, "fault", "read from the fault buffer, r0945: 30002"),
        (6500, "state", "the fault buffer is empty, r0945"),
        (8500, "fault", "read from the fault buffer, r0945: 7900"),
    ]  # fmt: skip


def test_what_was_acknowledged_and_what_is_no_fault_buffer_is_no_event() -> None:
    change, refused = read(3, [7900]), read(4, [7900])
    change.operation, refused.state = "change", "refused"
    negative = read(5, [])
    negative.parameters[0].error = ParameterError(5, None)
    text = read(6, ["1EDC"])
    assert told(read(1, [7900], 8), read(2, [7900], pnu=944), change, refused, negative, text) == []
    assert told(read(1, [1] * 8 + [7])) == [(1500, "fault", "read from the fault buffer, r0945: 1")]


def test_there_is_room_for_some_hundred() -> None:
    items = [read(number, [number]) for number in range(1, SHOWN + 99)]
    assert len(told(*items)) == SHOWN


@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("tour-machine.pcapng", ["read from the fault buffer, r0945: 7900, 30002"]),
        (
            "real-stacks/o1_profinetpy062_be.pcapng",
            ["read from the fault buffer, r0947: 7900, 30002"],
        ),
        ("conversation-error.pcapng", []),
    ],
)
def test_those_of_stored_captures(name: str, faults: list[str]) -> None:
    result = analyze(CAPTURES / name)
    found = events(result)
    assert [each[2] for each in found] == faults
    for each in found:
        (item,) = [item for item in result.transactions if item.frames.read_response == each[5]]
        assert str(each[4]).startswith(item.device)
        assert each[0] == (item.start_ns + (item.duration_ns or 0) - (result.start_ns or 0)) // 1000
