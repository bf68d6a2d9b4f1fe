"""Findings: which remarks are wanted, their order, their words and their transactions."""

from __future__ import annotations

import pytest
from talk import job

from ds47.acyclic.transactions import build
from ds47.analysis import Analysis, AnalysisOptions
from ds47.capture import Frame
from ds47.findings.collection import Findings
from ds47.findings.remark import Remark
from ds47.findings.times import FrameTimes
from ds47.lab import message
from ds47.report.sentences import renumbered, sentence, words
from ds47.spec import rules
from ds47.spec.semantics import Limits, limits, reasons

READ = message.read(1, 1, message.address(21))


@pytest.mark.parametrize(
    ("select", "ignore", "wanted"),
    [
        ((), (), ["DS101", "DS401", "DS403", "DS417"]),
        (("DS4",), (), ["DS401", "DS403", "DS417"]),
        (("DS101", "DS417"), (), ["DS101", "DS417"]),
        ((), ("DS40",), ["DS101", "DS417"]),
        (("DS4",), ("DS40",), ["DS417"]),
        (("DS4",), ("DS",), []),
    ],
)
def test_select_and_ignore(
    select: tuple[str, ...], ignore: tuple[str, ...], wanted: list[str]
) -> None:
    findings = Findings(select, ignore)
    for rule in ("DS101", "DS401", "DS403", "DS417"):
        assert findings.wanted(rule) == (rule in wanted)
        findings.add(Remark(rule, 1))
    assert [finding.rule for finding in findings.result({})] == wanted


def test_frames_have_their_times_as_far_as_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    few = Limits(**(limits().columns() | {"frame_times": 3}))
    monkeypatch.setattr("ds47.analysis.limits", lambda: few)
    times = ((2, 20), (3, 1 << 70), (5, 50), (6, 60), (9, 90), (12, -(1 << 70)))
    analysis, noted = Analysis(AnalysisOptions(), None), FrameTimes(few.frame_times)
    told = {}
    for number, time_ns in times:
        frame = Frame(number, time_ns, 1, b"", 0)
        analysis._frames([frame])  # type: ignore[arg-type]
        noted.note(frame)
        told[number] = analysis._times.of(number)
    assert told == dict(times)
    assert [analysis._times.of(number) for number in (2, 3, 4, 5, 6)] == [20, None, None, 50, None]
    assert noted.numbers == analysis._times.numbers
    assert noted.times == analysis._times.times


def test_order_and_owner() -> None:
    first, second = job(READ), job(READ, frame=5)
    first.order, second.order, other = 1, 2, job(READ)
    other.order = 3
    owners = {2: build(second), 1: build(first)}
    owners[1].id, owners[2].id = 1, 2
    findings = Findings((), ())
    for remark in (
        Remark("DS403", 9),
        Remark("DS401", 2, job=second),
        Remark("DS401", 2, job=first),
        Remark("DS101", 2, job=first),
        Remark("DS410", 1, offset=10),
        Remark("DS410", 1, offset=4),
        Remark("DS401", 2, job=other),  # of no transaction here
        Remark("DS101", 3, job=first),
    ):
        findings.add(remark)
    told = [(f.frame, f.rule, f.transaction, f.offset) for f in findings.result(owners)]
    assert told == [
        (1, "DS410", None, 4), (1, "DS410", None, 10), (2, "DS101", 1, None),
        (2, "DS401", None, None), (2, "DS401", 1, None), (2, "DS401", 2, None),
        (3, "DS101", 1, None), (9, "DS403", None, None),
    ]  # fmt: skip
    assert owners[1].findings == ["DS101", "DS401"]
    assert owners[2].findings == ["DS401"]


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_dropped_frames_are_named_where_something_is_missing(lang: str) -> None:
    findings, said = Findings((), ()), reasons(lang)
    plain = sentence(findings.finding(Remark("DS403", 1)), lang)
    findings.frames_dropped = True
    note = f"（{said['dropped']}）" if lang == "zh" else f" ({said['dropped']})"
    assert sentence(findings.finding(Remark("DS403", 1)), lang) == plain + note
    assert said["dropped"] not in sentence(findings.finding(Remark("DS404", 1)), lang)
    args = {"reason": "end", "dropped": True}
    between = "；" if lang == "zh" else "; "
    assert f"{said['end']}{between}{said['dropped']}" in words("DS401", args, lang)
    assert said["dropped"] not in words("DS401", args | {"dropped": False}, lang)


def test_an_argument_that_is_not_known_is_a_question_mark() -> None:
    finding = Findings((), ()).finding(Remark("DS404", 3, {"sent": 1}))
    assert "?" in sentence(finding)
    assert finding.filter == "frame.number == 3"


def test_a_finding_is_about_the_frames_of_its_arguments_too() -> None:
    args = {"request": 413, "by": 415}
    finding = Findings((), ()).finding(Remark("DS414", 415, args))
    assert finding.frames == [413, 415]
    assert finding.filter == "frame.number == 413 or frame.number == 415"
    assert renumbered("DS414", args, lambda number: number + 100) == {"request": 513, "by": 515}


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("rule", rules())
def test_every_rule_can_be_worded_from_nothing_but_its_rule(rule: str, lang: str) -> None:
    """An older or a damaged result may lack any argument."""
    assert words(rule, {}, lang)
    assert "{" not in words(rule, dict.fromkeys(rules()[rule].args), lang)


def test_where_somebody_is_told_at_once_nothing_is_kept() -> None:
    told: list[str] = []
    findings = Findings((), ("DS1",), lambda finding: told.append(finding.rule))
    for rule in ("DS101", "DS403"):
        findings.add(Remark(rule, 1))
    assert told == ["DS403"]
    assert findings.result({}) == []


def test_a_diagnosis_is_counted_with_its_like_and_a_symptom_is_not() -> None:
    findings = Findings((), ())
    one = job(READ, device="drive")
    for rule, frame in (("DS709", 1), ("DS709", 2), ("DS410", 3)):
        args = {"axis": 1, "device": "drive"} if rule == "DS709" else {"pnu": 21, "code": 2}
        findings.add(Remark(rule, frame, args, job=one))
    assert findings.diagnoses() == []
    findings.result({})
    counted = [(each.rule, each.device, each.count) for each in findings.diagnoses()]
    assert counted == [("DS709", "drive", 2)]


def test_without_an_offset_comes_before_offset_1() -> None:
    findings = Findings((), ())
    findings.add(Remark("DS410", 1, offset=1))
    findings.add(Remark("DS410", 1))
    findings.add(Remark("DS410", 1, offset=0))
    assert [finding.offset for finding in findings.result({})] == [None, 0, 1]
