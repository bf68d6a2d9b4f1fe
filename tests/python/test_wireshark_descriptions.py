"""Descriptions (attribute 0x20) and texts (0x30) in a real tshark: each element as JSON has it, at its bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_wireshark_plugin import CAPTURES, COMPLETE, Tshark, columns, rows, tshark

from ds47.analysis import analyze
from ds47.model import Parameter
from ds47.report import descriptions

__all__ = ["tshark"]  # a fixture

KEYS = ("name", "type", "unit", "low", "high", "elements", "reference")
STACKS = ("o1_profinetpy062_be", "o2_pyprofinet_le", "o3_two_controllers")
FOLDER = Path(__file__).resolve().parents[2] / "captures" / "real-stacks"


def described(path: Path) -> list[tuple[int, Parameter]]:
    """The responses with one description, whole or an element."""
    found = []
    for each in analyze(path).transactions:
        own = [item for item in each.parameters if descriptions.of(item) is not None]
        if len(own) == 1 and each.operation == "read" and each.frames.read_response:
            found.append((each.frames.read_response, own[0]))
    return found


def shown(value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.15g}"


@pytest.mark.parametrize("name", STACKS)
def test_the_fields_are_those_of_the_json(tshark: Tshark, name: str) -> None:
    path = FOLDER / f"{name}.pcapng"
    fields = [f"ds47.description.{key}" for key in KEYS]
    wanted = ("-Y", "ds47.attribute == 0x20", *columns("frame.number", *fields))
    found = {int(row[0]): row[1:] for row in rows(tshark("-r", path, *COMPLETE, *wanted))}
    expected = described(path)
    assert expected
    for frame, item in expected:
        told = descriptions.of(item)
        assert told is not None
        assert found[frame] == [shown(getattr(told, key)) for key in KEYS], frame


def test_elements_stand_at_their_bytes(tshark: Tshark) -> None:
    text = tshark(
        "-r",
        CAPTURES["format-description.pcapng"],
        *COMPLETE,
        "-T",
        "pdml",
        "-Y",
        "ds47.description.name",
    )
    assert 'name="ds47.description.name" showname="Name: ' in text
    line = next(each for each in text.splitlines() if '"ds47.description.name"' in each)
    value = bytes.fromhex(line.partition('value="')[2].partition('"')[0])
    assert len(value) == 16
    assert f'show="{value.decode("latin-1").rstrip()}"' in line
