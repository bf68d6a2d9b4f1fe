"""S7 in captures with holes: what is said of programs and CPUs must be true of the whole conversation, too.

The stored captures of two stacks are cut as captures of people are: one direction, lost frames, a
part, a snap length, neighbours swapped. What the analyzer says of each cut is held against the whole one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Frame, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult, Finding
from ds47.report import ReportOptions
from ds47.report.clock import Clock
from ds47.report.sentences import sentence
from ds47.report.summary import Opening
from ds47.report.verdict import FAILED, VerdictCounts
from ds47.report.zones import UNIVERSAL
from ds47.s7.tcp import from_frame

ROOT = Path(__file__).resolve().parents[2]
STACKS = sorted((ROOT / "captures/s7-stacks").glob("*.pcapng"))
ANSWERS = ROOT.parent / "shared/captures/sentences/s7-answers-only.pcapng"
OF_RECORDING = {"DS725", "DS915"}
"""What is said of the recording."""
OF_WHAT_IS_THERE = {"DS902", "DS903", "DS904", "DS906", "DS908", "DS909", "DS913", "DS918"}
"""What stands in the frames themselves; the counts are those of the cut."""

Cut = Callable[[list[Frame]], Iterable[Frame]]


def from_server(frame: Frame) -> bool:
    segment = from_frame(frame)
    return segment is not None and segment.source.port in (102, 1102)


def swapped(frames: list[Frame]) -> list[Frame]:
    """Every fifth frame changes places with the next one."""
    found = list(frames)
    for at in range(4, len(found) - 1, 5):
        found[at], found[at + 1] = found[at + 1], found[at]
    return found


CUTS: dict[str, Cut] = {
    "only clients": lambda frames: [f for f in frames if not from_server(f)],
    "only servers": lambda frames: [f for f in frames if from_server(f)],
    "middle": lambda frames: frames[len(frames) // 3 : 2 * len(frames) // 3],
    "begin": lambda frames: frames[: len(frames) // 2],
    "swapped": swapped,
} | {
    f"every {n}th from {first}": lambda frames, n=n, first=first: [
        f for at, f in enumerate(frames) if (at + first) % n
    ]
    for n in (3, 7, 11, 17)
    for first in (0, 1, 5)
}


def frames_of(path: Path) -> list[Frame]:
    with open_capture(path) as capture:
        capture.tcp((102, 1102))
        return list(capture.everything())


def write(path: Path, frames: Iterable[Frame], link: int, snap: int = 1 << 16) -> Path:
    with PcapngWriter(path, link_type=link) as writer:
        for frame in frames:
            writer.write(frame.time_ns, frame.data[:snap], original_length=frame.original_length)
    return path


def said(item: Finding) -> tuple[str, ...]:
    """What a finding says, without what counts it."""
    keep = ["device", "controller", "operation", "area", "r_id", "code", "byte"]
    if item.rule != "DS917":  # CR has no CC, and is reset: both are true
        keep.append("case")
    return item.rule, *(str(item.args.get(name)) for name in keep)


@pytest.mark.parametrize("path", STACKS, ids=lambda path: path.stem)
def test_what_a_cut_says_is_true_of_the_whole(path: Path, tmp_path: Path) -> None:
    frames = frames_of(path)
    whole = analyze(path)
    true = {said(each) for each in whole.findings}
    wrong: Counter[tuple[str, ...]] = Counter()
    cuts = [(name, cut(frames), 1 << 16) for name, cut in CUTS.items()]
    cuts += [(f"snap {n}", frames, n) for n in (90, 120, 300)]
    for name, left, snap in cuts:
        result = analyze(write(tmp_path / "cut.pcapng", left, frames[0].link_type, snap))
        for each in result.findings:
            if each.rule not in OF_RECORDING | OF_WHAT_IS_THERE and said(each) not in true:
                wrong[name, sentence(each)] += 1
        failed = {
            (each.operation, each.state) for each in result.transactions if each.state in FAILED
        }
        assert failed <= {(each.operation, each.state) for each in whole.transactions}, name
    assert not wrong, "\n".join(f"{n} x {each}" for each, n in wrong.most_common(40))


@pytest.mark.parametrize("path", STACKS, ids=lambda path: path.stem)
def test_what_is_missing_is_told_and_what_is_refused_is_never_ok(
    path: Path, tmp_path: Path
) -> None:
    """Of one direction too; a whole capture lacks nothing."""
    frames = frames_of(path)
    assert [each for each in analyze(path).findings if each.rule == "DS725"] == []
    for name, what in (
        ("only clients", "s7_server_missing"),
        ("only servers", "s7_client_missing"),
    ):
        cut = write(tmp_path / "cut.pcapng", CUTS[name](frames), frames[0].link_type)
        result = analyze(cut, AnalysisOptions(channels=("s7",)))
        told = {each.args["what"] for each in result.findings if each.rule == "DS725"}
        assert what in told
        refused = [
            item.code
            for job in result.transactions
            for item in job.items
            if item.code not in (None, 0xFF)
        ]
        level = VerdictCounts.of(result).level
        assert level == ("bad" if refused else "warn"), name


@pytest.mark.parametrize(
    ("first", "last", "told"),
    [
        (1, 20, [("s7_ends", 20)]),
        (1, 21, []),
        (15, 21, [("s7_begins", 1)]),
        (15, 20, [("s7_begins", 1), ("s7_ends", 6)]),
    ],
)
def test_a_part_of_a_connection_begins_or_ends_inside_a_job(
    first: int, last: int, told: list[tuple[str, int]], tmp_path: Path
) -> None:
    path = ROOT / "captures/s7-stacks/areas_cpp_cpp_240.pcapng"
    frames = frames_of(path)
    result = analyze(write(tmp_path / "cut.pcapng", frames[first - 1 : last], frames[0].link_type))
    found = [each for each in result.findings if each.rule == "DS725"]
    assert [(each.args["what"], each.frame) for each in found] == told
    assert [each.args["count"] for each in found] == [1] * len(told)
    assert [each.rule for each in result.diagnoses][: len(told)] == ["DS725"] * len(told)


@pytest.mark.parametrize("snap", [80, 90, 100, 110, 120, 150])
@pytest.mark.parametrize("name", ["lossy-stacks/s7connector", "s7-stacks/multi_cpp_cpp"])
def test_frames_that_a_snap_length_cut(name: str, snap: int, tmp_path: Path) -> None:
    """What is cut off is not missing on the line: its jobs are incomplete, and all others as in the whole."""
    path = ROOT / f"captures/{name}.pcapng"
    frames = frames_of(path)
    cut = [each for each in frames if len(each.data) > snap]
    result = analyze(write(tmp_path / "cut.pcapng", frames, frames[0].link_type, snap))
    (told,) = [each for each in result.findings if each.rule == "DS725"]
    assert (told.frame, told.args["what"], told.args["count"], told.args["bytes"]) == (
        cut[0].number, "s7_cut", len(cut), snap,
    )  # fmt: skip
    assert f"were cut to {snap} bytes: {len(cut)}" in sentence(told)
    assert "DS901" not in {each.rule for each in result.findings}
    whole = {str(each.frames): each.state for each in analyze(path).transactions}
    for each in result.transactions:
        if each.state not in ("incomplete", "orphan"):
            assert whole[str(each.frames)] == each.state


@pytest.mark.skipif(not ANSWERS.is_file(), reason="that capture is beside the checkout only")
def test_a_report_of_answers_alone_begins_with_the_direction_that_is_missing() -> None:
    result = analyze(ANSWERS)
    assert [each.rule for each in result.diagnoses] == ["DS725"]
    opening, clock = Opening(ReportOptions()), Clock.of(result, UNIVERSAL)
    lines = "\n".join(opening.lines(result, clock, VerdictCounts.of(result)))
    first, rest = lines.split("  DS725 ")[0], lines.split("  DS725 ")[1]
    assert "DS908" not in first
    assert " sends was captured" in " ".join(rest.split())
    assert "DS908 error" in rest
    assert VerdictCounts.of(result).level == "bad"


def cut_result(name: str, tmp_path: Path, missing: Iterable[int]) -> CaptureResult:
    """The result of a capture without some of its frames."""
    frames = frames_of(ROOT / "captures" / name)
    left = [each for each in frames if each.number not in missing]
    return analyze(write(tmp_path / "cut.pcapng", left, frames[0].link_type))


def test_a_connection_that_carried_data_was_not_refused(tmp_path: Path) -> None:
    """Its confirmation is missing, and its SYN-ACK, which would show that; the CPU ends it later."""
    result = cut_result("s7-stacks/bsend_pure_pure.pcapng", tmp_path, (2, 6))
    assert "DS917" not in {each.rule for each in result.findings}


def test_with_one_reference_for_all_an_answer_behind_a_gap_is_nobodys(tmp_path: Path) -> None:
    """The answer of a job, the jobs after it and the request of the next answer are missing."""
    result = cut_result("lossy-stacks/s7connector.pcapng", tmp_path, range(15, 39))
    job, answer = result.transactions[2:4]
    assert (job.state, job.frames.write_request) == ("incomplete", 14)
    assert (answer.state, answer.frames.read_response) == ("orphan", 15)
