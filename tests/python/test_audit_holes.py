"""Captures and conversations with holes: what is said of program, drive and cable is true of the whole one."""

from __future__ import annotations

from pathlib import Path
from uuid import UUID

import pytest
from tests.audit import cuts, holes, seeds, wire
from tests.audit.gaps import Gaps

from ds47.analysis import analyze

ROOT = Path(__file__).parents[2]
STACKS = sorted((ROOT / "captures/real-stacks").glob("*.pcapng"))
SMALL = ROOT / "captures/conversation-superseded-read.pcapng"
FOLDERS = (".", "field", "lossy-stacks", "profibus", "s7-stacks")
STORED = sorted(path for each in FOLDERS for path in (ROOT / "captures" / each).glob("*.pcap*"))
SHARES = 8


@pytest.mark.slow
@pytest.mark.parametrize("name", cuts.ALL)
@pytest.mark.parametrize("path", STACKS, ids=lambda path: path.stem)
def test_a_real_stack_with_holes(path: Path, name: str) -> None:
    assert list(map(str, holes.of(path, [name]))) == []


CHARGES = {
    "DS206", "DS401", "DS402", "DS404", "DS405", "DS406", "DS407", "DS413", "DS414", "DS702", "DS703", "DS705",
    "DS706", "DS722",
}  # fmt: skip
"""What charges program, drive or cable with what did not come, or with another order."""


@pytest.mark.slow
@pytest.mark.parametrize("name", cuts.MOVED)
@pytest.mark.parametrize("path", STACKS, ids=lambda path: path.stem)
def test_a_real_stack_out_of_order_charges_nobody(path: Path, name: str, tmp_path: Path) -> None:
    """Each frame has its own time, which says what came first."""
    frames = cuts.MOVED[name](wire.frames(path))
    cuts.write(tmp_path / "moved.pcap", frames)
    told = {(each.rule, each.frame) for each in analyze(path).findings}
    for each in analyze(tmp_path / "moved.pcap").findings:
        if each.rule in CHARGES:
            assert (each.rule, frames[each.frame - 1].number) in told


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_stored_captures_with_holes(share: int) -> None:
    for number, path in enumerate(STORED[share::SHARES]):
        small = path.parent.name == "captures"  # each with every second cut: many are alike
        names = list(cuts.ALL)[number % 2 :: 2] if small else cuts.ALL
        assert list(map(str, holes.of(path, names))) == [], path.name


@pytest.mark.slow
@pytest.mark.parametrize("share", range(SHARES))
def test_what_once_had_a_complaint(share: int, tmp_path: Path) -> None:
    for plan in seeds.kept(seeds.WITH_HOLES)[share::SHARES]:
        assert list(map(str, seeds.of_cuts(plan, tmp_path))) == [], plan.text()


@pytest.mark.slow
@pytest.mark.parametrize("share", range(4))
def test_random_conversations_with_holes(share: int, tmp_path: Path) -> None:
    for plan in seeds.planned(6, 470 + share, wires=False):
        assert list(map(str, seeds.of_cuts(plan, tmp_path))) == [], plan.text()


@pytest.mark.parametrize("name", ["to devices", "from devices", "hole"])
def test_a_small_conversation_with_holes(name: str) -> None:
    assert list(map(str, holes.of(SMALL, [name]))) == []


def test_the_number_of_a_late_answer_is_not_missing() -> None:
    """Those on both sides of it are told in the order of their numbers."""
    activity = UUID(int=1)
    capture = wire.Capture(numbers=[(at, "client", "device", activity, at) for at in (1, 12)])

    def told(*numbers: int) -> list[str]:
        capture.strays = [
            wire.Pdu(
                20, 0, "device", "client", wire.RESPONSE, "<", activity, number, wire.READ, b"", [20], 0, False,
                activity,
            )
            for number in numbers
        ]  # fmt: skip
        return [each.text for each in Gaps(capture).of("client", "device")]

    assert told() == ["2..11"]
    assert told(5) == ["2..4", "6..11"]
    assert told(11, 2) == ["3..10"]
    assert told(*range(2, 12)) == []
    assert told(15) == ["2..11", "13..14"]


# The cuts themselves


def left(name: str) -> list[int]:
    return [each.number for each in cuts.ALL[name](wire.frames(SMALL))]


def test_what_cuts_leave() -> None:
    assert len(wire.frames(SMALL)) == 6
    assert left("every 5th lost") == [1, 2, 3, 4, 6]
    assert left("to devices") == [1, 3, 5]
    assert left("from devices") == [2, 4, 6]
    assert left("hole") == [1, 2, 4, 5, 6]
    assert left("middle") == [3, 4]
    assert left("3rd swapped") == [1, 2, 4, 3, 5, 6]
    assert left("doubled") == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]
    assert left("twice") == [*range(1, 7)] * 2


def test_a_merged_capture_takes_the_earlier_frame() -> None:
    frames = wire.frames(SMALL)
    late = [cuts.replace(each, time_ns=each.time_ns + 1_500_000) for each in frames]
    times = [each.time_ns for each in cuts.merged(frames, late)]
    assert times == sorted(times)
    assert len(times) == 12
    plant = cuts.elsewhere(frames)
    assert cuts.servers(frames) == {bytes((192, 168, 133, 33))}
    assert cuts.servers(plant) == {bytes((192, 168, 132, 33))}


def test_what_the_whole_conversation_does_not_say_is_noticed() -> None:
    item, other = (holes.reading.read(SMALL, page=False) for _ in range(2))
    frames = item.capture.frames
    assert list(map(str, holes.check(holes.Whole(item), item, frames))) == []
    assert other.connections_of_47  # kept, as it is no longer known from what is left
    other.deals.clear()
    other.findings.clear()
    told = {each.rule for each in holes.check(holes.Whole(other), item, frames)}
    assert told >= {"whole transaction", "DS413"}
