"""Real stacks whose frames a snap length cut, wherever: nothing is said that is not so of the whole capture.

Rules, frames and arguments are compared here; whether sentences about the cut capture are true, the auditor says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from tests.audit import cuts, holes, wire

from ds47.analysis import analyze
from ds47.model import CaptureResult, Finding, Parameter, Report, Transaction
from ds47.report import descriptions, formatting, text, write_all

ROOT = Path(__file__).parents[2]
STACKS = sorted((ROOT / "captures/real-stacks").glob("*.pcapng"))
SMALL = ROOT / "captures/real-stacks/o2_pyprofinet_le.pcapng"
LENGTHS = [
    (path, length) for at, path in enumerate(STACKS) for length in range(42 + 5 * at, 400, 17)
]
FREE = {
    "DS701": {"among", "case", "polls"},
    "DS705": {"case", "other", "other_ar", "first"},
    "DS708": {"other"},
    "DS721": {"axis", "case", "count", "unknown", "more", "last", "pnus", "targets"},
}
"""Arguments that a cut capture may say otherwise: they count, or name the first one, or who it is known to be."""
LATER = {"DS721"}
"""Told at the first frame that is certain: in a cut capture that may be a later one."""
OTHERWISE = {"DS701"}
"""Told of more transactions than of the whole: what a better cause needs is cut off."""

Place = tuple[object, ...]


def cut(path: Path, length: int, folder: Path) -> CaptureResult:
    there = folder / f"{length}.pcap"
    cuts.write(there, cuts.snapped(length)(wire.frames(path)))
    return analyze(there)


@lru_cache(maxsize=1)
def whole(path: Path) -> CaptureResult:
    return analyze(path)


def place(item: Transaction) -> Place:
    return item.frames.write_request, item.slot, item.subslot, item.index, item.position


def is_said(finding: Finding, of: CaptureResult) -> bool:
    """Whether the whole says the same, or more."""
    said = {name for name, value in finding.args.items() if value is not None}
    known = said - FREE.get(finding.rule, set())
    return any(
        each.rule == finding.rule
        and (each.frame == finding.frame or (each.rule in LATER and each.frame < finding.frame))
        and all(each.args[name] == finding.args[name] for name in known)
        for each in of.findings
    )


def false(path: Path, length: int, folder: Path) -> Iterator[Any]:
    """What is said of a cut capture, and not so of the whole."""
    told, true = cut(path, length, folder), whole(path)
    for each in told.findings:
        if each.rule not in holes.OF_THE_RECORDING | OTHERWISE and not is_said(each, true):
            yield each.rule, each.frame, each.args
    states = {place(each): each.state for each in true.transactions}
    for item in told.transactions:
        state = states.get(place(item), "orphan")
        if item.state not in {state, "incomplete"}:
            yield item.state, state, place(item)


@pytest.mark.parametrize("length", [184, 200, 207, 208, 213, 226])
def test_what_a_snap_length_cut_off_is_nobodys_fault(length: int, tmp_path: Path) -> None:
    assert list(false(SMALL, length, tmp_path)) == []


@pytest.mark.parametrize(
    ("length", "states"),
    [
        (150, {}),
        (184, {"incomplete": 5}),
        (200, {"incomplete": 5}),
        (207, {"incomplete": 5}),
        (208, {"ok": 5}),
        (300, {"ok": 47, "error": 24, "partial": 2, "refused": 5, "mismatch": 2, "superseded": 1}),
    ],
)
def test_what_is_left_is_told(length: int, states: dict[str, int], tmp_path: Path) -> None:
    """From 182 on AR and index are there, from 207 on a byte of the record, from 210 on what proves index 47."""
    assert Counter(each.state for each in cut(SMALL, length, tmp_path).transactions) == states


def test_that_all_failed_is_said_where_it_is_certain(tmp_path: Path) -> None:
    """At 210 bytes the header of each response is there, and nothing behind it."""
    told, true = cut(STACKS[2], 210, tmp_path), whole(STACKS[2])
    failed = {place(each) for each in told.transactions if each.state == "error"}
    assert failed <= {place(each) for each in true.transactions if each.state == "error"}
    states = Counter(each.state for each in told.transactions)
    assert states == {"ok": 79, "error": 25, "superseded": 4, "incomplete": 56}


def test_a_string_that_is_cut_is_no_value(tmp_path: Path) -> None:
    """Of texts of 48 characters the capture has four, of a description of 46 bytes too."""
    told = cut(STACKS[0], 216, tmp_path)
    for number, attribute, count in ((41, "description", 46), (44, "text", 48)):
        (item,) = told.transactions[number - 1].parameters
        assert (item.attribute, item.value_count, item.values) == (attribute, count, [])
        assert told.transactions[number - 1].state == "ok"
    with StringIO() as stream:
        write_all(text.Writer(stream), Report([told]))
        shown = stream.getvalue()
    assert "Oper" not in shown
    assert "p0700[1..3].text  4 frames" in shown
    assert "LEN 54 (10 of them captured)" in shown


@pytest.mark.parametrize("attribute", ["value", "text"])
def test_of_a_list_that_is_cut_the_whole_number_is_told(attribute: str) -> None:
    item = Parameter(2902, 0, attribute, 10, format="Byte", value_count=10, values=[79, 112])
    assert descriptions.parts(item) is None
    assert formatting.parameter(item, False).endswith(" = 79, 112, ... (10 values)")


@pytest.mark.slow
@pytest.mark.parametrize(("path", "length"), LENGTHS, ids=str)
def test_any_snap_length(path: Path, length: int, tmp_path: Path) -> None:
    assert list(false(path, length, tmp_path)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("path", "length"), LENGTHS[::3], ids=str)
def test_the_auditor_finds_nothing_at_any_snap_length(path: Path, length: int) -> None:
    assert list(map(str, holes.of(path, [cuts.snap(length)]))) == []
