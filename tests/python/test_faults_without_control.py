"""A fault of a drive that nobody controls, and what acknowledges it (docs/cyclic.md 6); both implementations."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import pytest
from test_cyclic_limits import played
from test_lua_analysis import VERSIONS, Source, compare
from test_profibus_ppo import on_profibus
from tests.audit import run

from ds47.analysis import analyze
from ds47.cyclic.operation import Operation
from ds47.cyclic.timeline import Recorder
from ds47.lab.cyclic import Cyclic, LabModule
from ds47.lab.machine import Machine
from ds47.report.verdict import VerdictCounts, verdict
from ds47.spec.semantics import limits

It = Machine[Cyclic]
ALONE = LabModule(2, 1, 4, 4)
"""Process data without PKW in its slot: its lengths say little."""


def comes(it: It) -> None:
    it.control(0).run(1)
    it.drive.fault = 7860
    it.run(2)


def comes_and_is_acknowledged(it: It) -> None:
    it.control(0).run(1)
    it.drive.fault = 7860
    it.run(1).control(0x80).run(2.5).control(0).run(0.5)


def comes_and_goes(it: It) -> None:
    it.control(0).run(1)
    it.drive.fault = 7860
    it.run(1)
    it.drive.fault = 0
    it.run(1)


def two_edges(it: It) -> None:
    """The second one has bit 10."""
    it.control(0x7E).run(1)
    it.drive.fault = 7860
    it.run(1).control(0xFE).run(0.5).control(0x7E).run(0.5).control(0x47E).run(0.2).control(0x4FE)
    it.run(1)


def goes_at_the_first(it: It) -> None:
    it.control(0x7E).run(1)
    it.drive.fault = 7860
    it.run(1).control(0xFE).run(0.1)
    it.drive.fault = 0
    it.run(0.4).control(0x7E).run(0.5).control(0x47E).run(0.2).control(0x4FE).run(1)


def goes_with_bit_10(it: It) -> None:
    """The acknowledgement stands until the drive is controlled."""
    it.control(0x7E).run(1)
    it.drive.fault = 7860
    it.run(1).control(0xFE).run(0.5).control(0x4FE).run(1)


CASES: dict[Callable[[It], None], list[str]] = {
    comes: ["DS533"], comes_and_is_acknowledged: ["DS533", "DS532"], comes_and_goes: [],
    two_edges: ["DS532"], goes_at_the_first: [], goes_with_bit_10: [],
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_is_said(case: Callable[[It], None], tmp_path: Path) -> None:
    content = played(case)
    result = analyze(io.BytesIO(content))
    assert [each.rule for each in result.findings if each.rule != "DS512"] == CASES[case]
    if CASES[case]:
        assert verdict(VerdictCounts.of(result)).en.startswith(("NOT OK", "WARNING"))
    path = tmp_path / "case.pcapng"
    path.write_bytes(content)
    assert [str(each) for each in run.audit(path)] == []


def test_on_profibus_too() -> None:
    bus = on_profibus(played(comes))
    assert bus is not None
    assert "DS533" in {each.rule for each in analyze(io.BytesIO(bus)).findings}


def test_lengths_alone_are_not_enough() -> None:
    assert analyze(io.BytesIO(played(comes, ALONE))).findings == []


@pytest.mark.parametrize(
    ("words", "configured", "proven"),
    [
        ("FB31 FB38", False, True), ("FB31 FB78", False, True), ("FB38", True, False),
        ("FB31 FB38 FB31", True, False), ("FB40 FB48", True, True), ("FB40 FB48", False, False),
        ("FB40 FB48 FB40 FB48", True, False), ("FB31 FA38", True, False), ("F931 F938", True, False),
        ("FB40 FB4C", True, False),
    ],
)  # fmt: skip
def test_what_shows_a_drive_that_nobody_controls(
    words: str, configured: bool, proven: bool
) -> None:
    recorder = Recorder(Operation({}, limits()), True, True)
    recorder.sent(bytes(4), 1, 1)
    for at, word in enumerate(words.split(), 2):
        recorder.answered(bytes.fromhex(word) + bytes(2), at, at)
    recorder.finish(configured)
    assert recorder.proven is proven


def test_a_fault_alone_is_a_word_of_a_drive() -> None:
    recorder = Recorder(Operation({}, limits()), True, True)
    recorder.sent(bytes.fromhex("047E0000"), 1, 1)
    recorder.answered(bytes.fromhex("FB380000"), 2, 2)
    assert recorder.proven


@pytest.mark.parametrize("version", VERSIONS)
def test_lua_says_the_same(version: str, tmp_path: Path) -> None:
    sources = [Source(case.__name__, played(case), False) for case in CASES]
    sources.append(Source("alone", played(comes, ALONE), False))
    compare(version, "en", sources, tmp_path)
