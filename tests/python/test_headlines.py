"""Headlines: what stands above several cases is true of all of them, and its number is that of the frames shown.

The forms of many (spec/rules.toml), the grouping, the text report and the page; then every diagnosis of the
stored captures and of real stacks against the findings that it sums up.
"""

from __future__ import annotations

import re
import string
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import handmade
import pytest
from test_report_opening import DRIVE, capture, opening

from ds47 import spec
from ds47.acyclic.pairing import Peer
from ds47.analysis import analyze
from ds47.diagnosis import refusal
from ds47.findings.grouping import Grouping, cause, headlines
from ds47.model import Diagnosis, Finding, Frames
from ds47.profidrive import Address
from ds47.report import load
from ds47.report.contract import DIAGNOSIS
from ds47.report.filters import display_filter
from ds47.report.html.views.problems import problems
from ds47.report.sentences import advice, sentence
from ds47.report.targets import Targets
from ds47.spec.semantics import diagnosis_words, known, parts

ROOT = Path(__file__).resolve().parents[2]
STACKS = ROOT.parent / "shared/captures/real-stacks"
CAPTURES = [*sorted((ROOT / "captures").glob("*.pcapng")), *sorted(STACKS.glob("*.pcapng"))]


def refused(frame, pnu=2902, subindex=6, code=3, rule="DS717", job=None, elements=1):
    args = {"pnu": pnu, "subindex": subindex, "elements": elements, "code": code, "vendor_id": None}
    if rule == "DS410":
        args = {"pnu": pnu, "subindex": subindex, "code": code, "vendor_id": None, "info": 0}
    return Finding(rule, "error", frame, [frame], job or frame, 4, args)


def grouped(*findings, device=DRIVE):
    groups = Grouping()
    for each in findings:
        groups.add(cause(each.rule, device, each.args), each)
    return groups.result()


def names(template: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(template) if name}


# The forms


@pytest.mark.parametrize("rule", spec.rules().values(), ids=spec.rules())
def test_a_form_of_many_names_only_what_all_cases_have(rule):
    """Its group, and the device of a diagnosis; a key has words of many that do so, too."""
    if not rule.many:
        assert not rule.many_zh
        return
    shared = {*rule.group, "text", "error"} | ({"device"} if rule.id.startswith("DS7") else set())
    for template, lang in ((rule.many, "en"), (rule.many_zh, "zh")):
        assert names(template) <= shared, template
        assert not template.endswith((".", "。"))
        words = diagnosis_words(lang) if "case" in rule.group else {}
        for word, text in words.items():
            assert not word.endswith("_many") or names(text) <= shared, text
    assert names(rule.many) == names(rule.many_zh)


@pytest.mark.parametrize("rule", spec.rules().values(), ids=spec.rules())
def test_a_diagnosis_that_names_more_than_its_group_has_a_form_of_many(rule):
    shared = {*rule.group, "text", "error", "device"}
    if rule.id.startswith("DS7") and not names(rule.message) <= shared:
        assert rule.many


# The grouping


def test_what_differs_is_not_named():
    (told,) = grouped(refused(5, subindex=6), refused(9, subindex=7), refused(9, subindex=7))
    assert (told.count, told.frames, told.transactions) == (3, [5, 9], [5, 9])
    assert told.differs == ["subindex"]
    assert told.args["subindex"] is None
    assert told.args["pnu"] == 2902
    assert sentence(told) == (
        "r2902 is refused with several subindices or numbers of elements: 0x03 Invalid subindex"
    )
    assert sentence(told, "zh") == "r2902（多个下标或元素数量）被拒绝：0x03 错误的下标"


def test_what_nothing_names_may_differ():
    other = refused(9)
    other.args["vendor_id"] = 0x2A
    (told,) = grouped(refused(5), other)
    assert told.differs == ["vendor_id"]
    assert sentence(told).startswith("r2902[6] (number of elements 1) is refused: 0x03 ")


def test_an_integer_is_not_a_float():
    one, other = (Finding("DS720", "error", 1, args={"pnu": 1, "value": v}) for v in (30, 30.0))
    assert grouped(one, other)[0].differs == ["value"]


def test_parameters_and_error_numbers_are_told_apart():
    told = grouped(refused(1), refused(2, pnu=5), refused(3, code=4), refused(4, pnu=5))
    assert [(each.args["pnu"], each.args["code"], each.count) for each in told] == [
        (5, 3, 2), (2902, 3, 1), (2902, 4, 1),
    ]  # fmt: skip


def test_the_words_of_a_key_are_those_of_many():
    def clash(frame, first):
        args = {
            "case": "two_stations", "controller": "10.0.0.1", "ar": None, "frame": frame,
            "other": "10.0.0.2", "other_ar": None, "first": first,
        }  # fmt: skip
        return Finding("DS705", "error", frame, [first, frame], frame, None, args)

    (one,) = grouped(clash(9, 7))
    assert sentence(one).startswith(
        "10.0.0.1 wrote in frame 9 while the request of 10.0.0.2 (frame 7)"
    )
    (many,) = grouped(clash(9, 7), clash(15, 11))
    assert sentence(many) == (
        "10.0.0.1 wrote while a request of 10.0.0.2 was open: two stations use one channel"
    )


def test_the_first_frames_and_transactions_of_a_cause_are_kept():
    """A frame that comes twice counts once, and a late one that stands before others has its place."""
    most = known().frames
    numbers = [*range(2, most + 3), most + 2, 1, 1, 7]
    (told,) = grouped(*(refused(n) for n in numbers))
    assert told.frames == list(range(1, most + 1))
    assert told.transactions == list(range(2, most + 2))
    assert (told.count, told.frames_left_out) == (len(numbers), 2)


def test_causes_that_are_alike_stand_by_their_devices():
    groups = Grouping()
    for device in ("10.0.0.2", None, "10.0.0.1"):
        groups.add(cause("DS717", device, {}), refused(5))
    assert [each.device for each in groups.result()] == [None, "10.0.0.1", "10.0.0.2"]


@pytest.mark.parametrize(("number", "expected"), [(1, b"x"), (8, b"x"), (9, None)])
def test_the_first_corrected_request_that_holds_is_offered_of_eight(number, expected):
    groups, item = Grouping(), refused(5)
    for at in range(1, 10):
        groups.add(
            cause(item.rule, DRIVE, item.args),
            refused(at),
            lambda at=at: b"x" if at == number else None,
        )
    (told,) = groups.result()
    assert (told.corrected, told.corrected_in) == (expected, number if expected else None)


def test_the_job_that_is_named_is_that_of_the_first_frame():
    (told,) = grouped(refused(5, job=8), refused(9, job=2))
    assert told.transactions == [8, 2]


def test_what_an_older_result_says_in_other_words_is_another_cause():
    """A result without arguments has its words alone to be told apart by."""
    items = [handmade.finding("DS410", "error", said, n) for n, said in enumerate("abb", 1)]
    assert [(told.said, told.count, told.frames) for told in headlines(items)] == [
        ("b", 2, [2, 3]), ("a", 1, [1]),
    ]  # fmt: skip


def test_of_too_many_causes_nothing_particular_is_said():
    told = grouped(*(refused(n, pnu=n) for n in range(1, known().groups + 11)))
    rest = told[0]
    assert (rest.count, rest.device) == (10, None)
    assert sentence(rest) == spec.rules()["DS717"].title
    assert sentence(rest, "zh") == spec.rules()["DS717"].title_zh
    assert sum(each.count for each in told) == known().groups + 10


def test_one_of_several_sentences_stands_for_no_other():
    """Reads and Writes are two causes; cases that differ in numbers alone have their title in common."""
    calls = [
        Finding("DS101", "warning", n, args={"operation": o})
        for n, o in enumerate(("Read", "Write", "Read"))
    ]
    assert [(sentence(each), each.count) for each in headlines(calls)] == [
        ("RPC Read request has no complete response in the capture", 2),
        ("RPC Write request has no complete response in the capture", 1),
    ]  # fmt: skip
    limits = [
        {"limit": "s7_jobs", "most": 64, "count": 9},
        {"limit": "frames", "most": 9, "count": 3},
    ]
    told = headlines(Finding("DS109", "note", 7, args=each) for each in limits)
    assert [each.count for each in told] == [1, 1]
    (told,) = headlines(Finding("DS404", "error", n, args={"sent": n, "got": 9}) for n in (1, 2))
    assert sentence(told) == "Request reference not mirrored"
    assert sentence(told, "zh") == spec.rules()["DS404"].title_zh


def test_a_title_that_stands_for_several_says_of_whom_they_are():
    inhibited = {"device": "192.168.0.5", "slot": 2, "limit": 5.0}
    findings = [
        Finding("DS523", "error", n, args={**inhibited, "seconds": n + 0.5}) for n in (6, 9)
    ]
    findings.append(Finding("DS523", "error", 12, args={**inhibited, "slot": 3, "seconds": 7.5}))
    several, alone = headlines(findings)
    assert (several.count, sentence(several)) == (2, "192.168.0.5 slot 2: ON without a new edge")
    assert sentence(alone).startswith("192.168.0.5 slot 3 inhibits switching on")
    refused = {"device": "10.0.0.2", "controller": "10.0.0.1", "operation": "PUT", "code": 0x8404}
    (told,) = headlines(
        Finding("DS909", "error", n, args={**refused, "area": f"MB{n}"}) for n in (1, 2)
    )
    assert sentence(told).startswith("PUT refused by 10.0.0.2 as a whole: ")


def test_an_advice_is_about_the_error_number_that_was_seen():
    rule = spec.rules()["DS719"]
    state, enabled = "0x11: look up in the parameter list", "0x6B: remove the enable"
    for code, seen, other in ((0x11, state, enabled), (0x6B, enabled, state)):
        text = advice(rule, {"code": code})
        assert text.startswith(seen)
        assert other not in text
    usual = spec.rules()["DS410"]
    assert advice(usual, {"code": 0x84}).endswith("the first element that failed.")
    assert " failed. 0x11: " in usual.advice
    assert advice(usual, {"code": 0x11}).startswith("0x11: the drive does not execute")
    assert "Look the parameter up" in advice(usual, {"code": 0x11})
    assert advice(rule, {"code": 0x6B}, "zh").startswith("0x6B：取消使能")
    assert advice(rule, {"code": None}) == advice(rule, {"code": 0x15}) == rule.advice
    single = spec.rules()["DS701"]
    for asked in (2, None):
        assert advice(single, {"code": 0x23, "asked": asked}).startswith(
            "0x23, several parameters: the drive"
        )
        assert advice(single, {"code": 0x23, "asked": asked}, "zh").startswith("0x23，多个参数：")
    assert advice(single, {"code": 0x23, "asked": 1}) == advice(single, {"code": 0x6B, "asked": 2})
    assert "0x23" not in advice(single, {"code": 0x23, "asked": 1}, "zh")
    write = spec.rules()["DS203"]
    assert advice(write, {"status": "DF80B100"}) == "0xB1: check LEN of WRREC."
    assert advice(write, {"status": "DF80B100"}, "zh") == "0xB1：检查 WRREC 的 LEN。"
    assert advice(write, {"status": "DF80A900"}) == advice(write, {}) == write.advice
    item = spec.rules()["DS908"]
    assert advice(item, {"code": 0x0A}) == "0x0A: load the data block, and check its number."


def test_each_error_number_has_its_own_advice_and_the_rest_is_said_once():
    def lines(rule, *codes):
        findings = [refused(n, pnu=n, rule=rule, code=code) for n, code in enumerate(codes, 1)]
        jobs = [handmade.transaction(id=n, state="error") for n in range(1, len(codes) + 1)]
        told = grouped(*findings) if rule.startswith("DS7") else []
        return " ".join(
            " ".join(opening(capture(*jobs, findings=findings, diagnoses=told))).split()
        )

    told = lines("DS410", 0x84, 0x11, 0x85)
    assert told.count("Look the parameter up") == told.count("-> 0x11: the drive does not") == 1
    told = lines("DS719", 0x11, 0x6B)
    assert told.count("-> 0x11: look up in the parameter list") == 1
    assert told.count("-> 0x6B: remove the enable") == 1


def test_every_frame_is_kept_up_to_a_limit_and_the_rest_is_counted():
    most = known().frames
    (told,) = grouped(*(refused(n, job=1) for n in range(1, most + 4) for _ in "ab"))
    assert told.frames == list(range(1, most + 1))
    assert (told.frames_left_out, told.count) == (3, 2 * most + 6)


def test_frames_may_come_in_any_order():
    (told,) = grouped(*(refused(n) for n in (7, 3, 7, 5, 3)))
    assert told.frames == [3, 5, 7]


def test_json_says_what_differs_and_comes_back():
    groups = Grouping()
    for each in (refused(5, job=3), refused(9, subindex=7, job=4)):
        groups.add(cause(each.rule, DRIVE, each.args), each, b"\x01\x01\x02\x00")
    (told,) = groups.result()
    item = DIAGNOSIS.plain(told)
    assert item["differs"] == ["subindex"]
    assert item["frames_left_out"] == 0
    assert item["filter"] == "frame.number == 5 or frame.number == 9"
    assert item["corrected"]["transaction"] == 3
    assert load.diagnosis(item) == told


# Refusals of one job


def test_two_parameters_that_are_refused_alike_are_two():
    """One of them would not be counted otherwise; a drive object that does not exist is told once."""

    def told(code, addresses):
        peer = Peer("192.168.133.2", DRIVE, vendor_id=0x2A)
        found = [
            refusal.Refusal(
                n, code, Address(0x10, 1, pnu, subindex), SimpleNamespace(offset=4 + 6 * n), None
            )
            for n, (pnu, subindex) in enumerate(addresses)
        ]
        job = SimpleNamespace(
            peer=peer, message=SimpleNamespace(axis=7, operation="change"), write_request=None,
            read_response=SimpleNamespace(frame=4),
        )  # fmt: skip
        return [(each.rule, each.args.get("pnu")) for _, each in refusal.of(job, found)]

    assert told(0x11, [(1300, 0), (1437, 0), (1437, 1)]) == [
        ("DS719", 1300), ("DS719", 1437), ("DS719", 1437),
    ]  # fmt: skip
    assert told(0x19, [(1300, 0), (1437, 0)]) == [("DS709", None)]


# The text report


def test_the_number_is_that_of_the_frames_or_both_are_told():
    findings = [refused(5, rule="DS410", code=0), refused(5, pnu=3, rule="DS410", code=0, job=5)]
    lines = opening(capture(handmade.transaction(id=5, state="error"), findings=findings))
    head = " ".join(line.strip() for line in lines[lines.index("What to do") + 1 :][:2])
    assert head == (
        "DS410 error drive-error: Parameters got a negative response: 0x00 Illegal parameter number: the "
        "parameter does not exist (2 times in 1 frame)"
    )
    assert "    look at frame 5 (#5)" in lines


def test_findings_are_told_by_their_error_number():
    findings = [
        refused(n, pnu=n, rule="DS410", code=(0x84, 0x11, 0x11)[n % 3]) for n in range(1, 7)
    ]
    jobs = [handmade.transaction(id=n, state="error") for n in range(1, 7)]
    lines = "\n".join(opening(capture(*jobs, findings=findings), filters=True))
    assert "first:" not in lines
    assert lines.index("0x11") < lines.index("0x84")
    assert re.search(r"0x11[^(]*\(4\s+times\)", lines)
    assert "frame.number in {1..2} or frame.number in {4..5}" in lines
    assert lines.count("Look the parameter up") == 1


def test_where_cases_have_nothing_in_common_their_title_stands_for_them():
    findings = [Finding("DS404", "error", n, [n], n, 0, {"sent": n, "got": n + 1}) for n in (3, 4)]
    jobs = [handmade.transaction(id=n, state="mismatch") for n in (3, 4)]
    text = " ".join("\n".join(opening(capture(*jobs, findings=findings), filters=True)).split())
    assert "not-mirrored: Request reference not mirrored (2 times)" in text
    assert "look at frame 3 (#3): frame.number in {3..4}" in text


def test_frames_that_the_filter_has_no_room_for_are_told():
    told = Diagnosis("DS719", "error", refused(1).args, DRIVE, 90, list(range(1, 140, 2)), [1])
    told.frames_left_out = 20
    lines = opening(capture(handmade.transaction(), diagnoses=[told]), filters=True)
    assert lines[-1].endswith("  (and 30 more frames)")  # 10 of the filter, 20 that were not kept


def test_a_corrected_request_says_whose_it_is():
    told = Diagnosis("DS717", "error", refused(1).args, DRIVE, 2, [5, 9], [3, 4])
    told.corrected, told.corrected_in = bytes.fromhex("01010200"), 4
    lines = opening(capture(handmade.transaction(), diagnoses=[told]))
    assert "    instead of the request of #4 send: 01010200" in lines


# The page


def test_problems_count_frames_and_show_them_all():
    jobs = [
        handmade.transaction(id=n, state="error", frames=Frames(n, None, None, n + 100))
        for n in (1, 2)
    ]
    findings = [
        refused(101, rule="DS410", code=0x84, job=1), refused(101, pnu=7, rule="DS410", code=0x84, job=1),
        refused(102, rule="DS410", code=0x84, job=2), refused(102, rule="DS410", code=0x11, job=2),
    ]  # fmt: skip
    result = capture(*jobs, findings=findings)
    found = problems(result, Targets(jobs))
    shown = [(each.count, each.times.en, each.filter) for each in found]
    assert shown == [
        (3, "3 times in 2 frames", "frame.number in {101..102}"),
        (1, "1 time", "frame.number == 102"),
    ]
    assert "0x84" in found[0].title.en


def test_frames_that_a_problem_names_are_links():
    jobs = [handmade.transaction(id=n, frames=Frames(n, None, None, n + 1)) for n in (3, 9)]
    args = {
        "case": "one_station", "controller": "10.0.0.1", "ar": None, "frame": 9, "other": "10.0.0.1",
        "other_ar": None, "first": 3,
    }  # fmt: skip
    told = Diagnosis("DS705", "error", args, DRIVE, 1, [9], [9])
    (problem,) = problems(capture(*jobs, diagnoses=[told]), Targets(jobs))
    assert problem.others == [(3, 3)]


# What was recorded


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_every_headline_is_true_of_all_its_findings(path: Path):
    result = analyze(path)
    devices = {each.id: each.device for each in result.transactions}
    cases: dict[tuple, list[Finding]] = {}
    for each in result.findings:
        if each.rule.startswith("DS7"):
            device = devices.get(each.transaction) or each.args.get("device")
            cases.setdefault(cause(each.rule, device, each.args), []).append(each)
    assert Counter(each.rule for each in result.diagnoses) == Counter(about.rule for about in cases)
    for told in result.diagnoses:
        mine = cases[cause(told.rule, told.device, told.args)]
        _is_true(told, mine)
    for told in headlines(result.findings):
        mine = [
            each
            for each in result.findings
            if cause(each.rule, None, each.args) == cause(told.rule, None, told.args)
        ]
        _is_true(told, mine)


def _is_true(told: Diagnosis, mine: list[Finding]) -> None:
    assert told.count == len(mine)
    there = sorted({frame for each in mine for frame in each.args.get("frames", [each.frame])})
    assert told.frames == there[: known().frames]
    assert told.transactions == list(
        dict.fromkeys(each.transaction for each in mine if each.transaction is not None)
    )
    for name, value in told.args.items():
        seen = {repr(each.args[name]) for each in mine}
        assert (len(seen) > 1) == (name in told.differs), name
        assert name in told.differs or seen == {repr(value)}
    for lang in ("en", "zh"):
        text = sentence(told, lang)
        if not told.differs:
            assert {sentence(each, lang) for each in mine} == {text}
        assert "?" not in text or "?" in sentence(mine[0], lang)
    shown, left_out = display_filter(told.frames)
    numbers = set()
    for one, first, last in re.findall(r"== (\d+)|\{(\d+)\.\.(\d+)\}", shown):
        numbers.update({int(one)} if one else range(int(first), int(last) + 1))
    assert len(numbers) + left_out == len(told.frames)
    assert numbers <= set(told.frames)


@pytest.mark.parametrize(
    ("what", "chinese"),
    [
        ("header", "报头"),
        ("address 2 of 3", "第 2 个参数地址，共 3 个"),
        ("value block 1 of 2", "第 1 个数值块，共 2 个"),
        ("values of block 12", "第 12 个数据块的数值"),
        ("block header", "数据块的格式和数量"),
        ("nobody knows 7", "nobody knows 7"),
    ],
)
def test_a_part_of_a_message_has_words_in_both_languages(what, chinese):
    for lang, told in (("en", what), ("zh", chinese)):
        assert f"{told}" in sentence(
            Finding("DS315", "error", 1, args={"need": 3, "what": what}), lang
        )


def test_every_part_of_a_message_that_a_codec_names_is_in_chinese():
    source = (ROOT / "python/ds47/profidrive/parameter.py").read_text(encoding="utf-8")
    named = re.findall(r'(?:, |what = )f?"((?:header|block header|address|values?)[^"]*)"', source)
    named += ["{} x unknown address"]  # of S7
    named = [re.sub(r"{[^}]*}", "{}", each) for each in named]
    assert sorted(set(named)) == sorted({re.sub("{.}", "{}", each) for each in parts()})
