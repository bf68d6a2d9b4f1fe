"""Descriptions (attribute 0x20) and texts (0x30) in a real tshark: what JSON has, and what is learned of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from test_wireshark_plugin import CAPTURES, COMPLETE, Tshark, columns, rows, tshark

from ds47.analysis import AnalysisOptions, analyze
from ds47.model import Parameter
from ds47.report import descriptions
from ds47.report.contract import TRANSACTION
from ds47.wireshark.engine import Engine

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


DESCRIBED = CAPTURES["format-described.pcapng"]
LEARNED = ("name", "unit", "scaled", "scaled.number", "described_in")


def learned() -> dict[int, list[str]]:
    """What each frame of a request and of a response with values says of their parameter."""
    found = {}
    for each in analyze(DESCRIBED).transactions:
        (item,) = each.parameters
        for frame in (each.frames.write_request, each.frames.read_response):
            if item.attribute != "value" or frame is None:
                continue
            asked = each.operation == "read" and frame == each.frames.write_request
            scaled = str(item.scaled[0]) if item.scaled and not asked else ""
            number = scaled and shown(float(scaled))
            told = [str(item.described_in[0])] if item.described_in else [""]
            unit = item.unit
            if asked and item.listed is not None and not item.described_in:
                unit = item.listed.unit  # whatever type the values of the response have
            found[frame] = [item.name or "", unit or "", scaled, number, *told]
    return found


@pytest.mark.parametrize("passes", [COMPLETE, ()], ids=["complete", "one pass"])
def test_what_was_described_names_and_scales_values(
    tshark: Tshark, passes: tuple[str, ...]
) -> None:
    fields = [f"ds47.{key}" for key in LEARNED]
    wanted = ("-Y", "ds47.attribute == 0x10", *columns("frame.number", *fields))
    found = {int(row[0]): row[1:] for row in rows(tshark("-r", DESCRIBED, *passes, *wanted))}
    expected = learned()
    assert {frame: found[frame] for frame in expected} == expected
    assert expected[12] == ["Ramp-up time", "s", "10.0", "10", "8"]


def test_a_physical_value_can_be_filtered(tshark: Tshark) -> None:
    wanted = (
        "-Y",
        'ds47.scaled.number > 12 && ds47.unit == "s"',
        *columns("frame.number", "ds47.parameter"),
    )
    found = rows(tshark("-r", DESCRIBED, *COMPLETE, *wanted))
    assert [row[0] for row in found] == ["25", "28"]
    assert found[1][1] == 'p1121[0] ("Ramp-down time") := 1500 (15.0 s)'


@pytest.mark.slow
def test_the_engine_reads_what_was_described(tshark: Tshark) -> None:
    native = analyze(DESCRIBED)
    found = Engine("tshark", AnalysisOptions()).analyze(DESCRIBED)
    assert list(map(TRANSACTION.plain, found.transactions)) == list(
        map(TRANSACTION.plain, native.transactions)
    )
    assert [each.parameters[0].described_in for each in found.transactions].count([20]) == 2
