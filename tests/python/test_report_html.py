"""The HTML report without a browser: what it says, and that nothing in a capture can break it."""

from __future__ import annotations

import base64
import gzip
import hashlib
import io
import json
import re
import string
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import handmade
import pytest

from ds47 import spec
from ds47.analysis import analyze
from ds47.batch import settings
from ds47.cli import main
from ds47.model import (
    Bus,
    BusStation,
    CaptureFile,
    CaptureResult,
    Device,
    Diagnosis,
    Finding,
    Frames,
    Parameter,
    ParameterError,
    Report,
    Transaction,
)
from ds47.regression import difference_page
from ds47.regression.config import ConfigError, load
from ds47.report import ReportOptions, causes, html, sentences, write_all
from ds47.report.bilingual import Both
from ds47.report.html import embed, messages, texts
from ds47.report.html.verdict import quality
from ds47.report.html.views import capture_view
from ds47.report.html.views.elements import elements
from ds47.report.html.views.findings import groups
from ds47.report.html.views.problems import first_screen, problems
from ds47.report.html.views.rows import ROW, packed_rows
from ds47.report.overview import CaptureRow, total
from ds47.report.verdict import VerdictCounts, blind, verdict
from ds47.spec import cyclic, s7
from ds47.spec.reporting import command_words, report_words
from ds47.spec.semantics import diagnosis_words
from ds47.spec.statuses import status_text

HOSTILE = "<script>alert(1)</script>"
QUOTES = "\"press\" & 'line' <b>1</b> </script>"
DRIVE = "192.168.133.33"
GLOSSARY = Path(__file__).parents[2] / "docs" / "glossary.md"
TEMPLATES = Path(html.__file__).parent.parent / "templates"
RPC = {"requests": 4, "responses": 4, "faults": 0, "rejects": 0, "unanswered": 0}


def transaction(number=1, **changes):
    item = Transaction(
        operation="read", state="ok", controller="192.168.133.2", device=DRIVE,
        ar="12345678-1234-1234-1234-123456789abc", api=0, slot=1, subslot=1, index=47,
        request_reference=3, axis=2, frames=Frames(4 * number, 4 * number + 1, 4 * number + 2, 4 * number + 3),
        start_ns=1_767_225_600_000_000_000 + number * 1_000_000_000, duration_ns=12_400_000,
        request=bytes.fromhex("030102011001c47f0000"), response=bytes.fromhex("03010201080141200000"),
        write_status=0, read_status=0, parameters=[parameter()], id=number,
    )  # fmt: skip
    return replace(item, **changes)


def parameter(pnu=50303, subindex=0, values=(10.0,), **changes):
    item = Parameter(
        pnu,
        subindex,
        "value",
        max(1, len(values)),
        None,
        None,
        "Float32",
        len(values),
        list(values),
    )
    return replace(item, **changes)


def failed(code=0x6B, vendor_id=0x2A, **changes):
    return parameter(error=ParameterError(code, 0, vendor_id), **changes)


def capture(*transactions, findings=(), **changes):
    item = CaptureResult(
        path="line 1.pcapng", frames=1234, rpc=dict(RPC), records={"47": {"read": 2, "write": 2}},
        devices=[Device(DRIVE, "00:0e:8c:00:00:01", "press-1", 0x2A, 0x501)],
        transactions=list(transactions), findings=list(findings),
    )  # fmt: skip
    return replace(item, **changes)


def page(*results, lang="en"):
    stream = io.StringIO()
    write_all(html.Writer(stream, ReportOptions(lang=lang)), Report(list(results)))
    return stream.getvalue()


class Elements(HTMLParser):
    """The elements of a page with their attributes, and the text of each script."""

    def __init__(self, text):
        super().__init__()
        self.found, self.scripts, self.text = [], [], []
        self._inside = None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.scripts.append((dict(attrs), ""))

    def handle_endtag(self, tag):
        self._inside = None

    def handle_data(self, data):
        if self._inside == "script":
            attributes, text = self.scripts[-1]
            self.scripts[-1] = (attributes, text + data)
        else:
            self.text.append(data)

    def data(self, name):
        for attributes, text in self.scripts:
            if attributes.get("id") == name:
                packed = attributes["type"] == "application/gzip"
                return json.loads(gzip.decompress(base64.b64decode(text)) if packed else text)
        raise AssertionError(f"no data {name}")


# The verdict


@pytest.mark.parametrize(
    ("states", "severities", "expected"),
    [
        (["ok", "ok"], [], "OK: 1 drive, 2 transactions, all done"),
        (["ok"], ["note"], "OK: 1 drive, 1 transaction, all done"),
        (["ok"], ["warning"], "WARNING: Time steps back"),
        (["refused"] * 3 + ["ok"], [], "NOT OK: 3 of 4 transactions failed"),
        (["partial"], ["error"], "NOT OK: Time steps back; the only transaction failed"),
        (["unanswered", "orphan"], [],
         "WARNING: outcome unknown for 1 of 2 transactions"),
        (["superseded", "ok"], ["note"], "WARNING: outcome unknown for 1 of 2 transactions"),
        (["ok"], ["error", "error"], "NOT OK: Time steps back"),
        ([], ["error"], "NOT OK: Time steps back"),
        ([], [], "EMPTY: 1,234 frames, no parameter transaction"),
    ],
)  # fmt: skip
def test_the_verdict_counts_what_went_wrong(states, severities, expected):
    result = capture(
        *(transaction(number, state=state) for number, state in enumerate(states, 1)),
        findings=[handmade.finding("DS107", severity, "m", 1) for severity in severities],
    )
    assert verdict(VerdictCounts.of(result)).en == expected


def test_the_verdict_in_chinese():
    result = capture(transaction(1, state="refused"), transaction(2))
    assert verdict(VerdictCounts.of(result)).zh == "不正常：2 个任务中有 1 个失败"


def test_a_capture_that_is_only_partly_read_is_never_ok():
    assert VerdictCounts.of(capture(transaction(), complete=False)).level == "warn"


def test_several_captures_count_each_drive_once():
    total = VerdictCounts()
    for result in (
        capture(transaction()),
        capture(transaction(), transaction(2, device="10.0.0.1")),
    ):
        total.add(VerdictCounts.of(result))
    assert verdict(total).en == "OK: 2 drives, 3 transactions, all done"


def test_a_capture_that_cannot_be_read_stands_in_the_overview():
    stream = io.StringIO()
    writer = html.Writer(stream, ReportOptions())
    writer.unreadable("broken.pcapng", HOSTILE)
    writer.capture(capture(transaction()))
    writer.close()
    text = "".join(Elements(stream.getvalue()).text)
    assert f"NOT READ: {HOSTILE}" in text
    assert "WARNING: 1 drive, 1 transaction, all done; 1 capture not read to its end" in text


def test_a_capture_that_cannot_be_read_can_be_the_only_one():
    stream = io.StringIO()
    writer = html.Writer(stream, ReportOptions())
    writer.unreadable("broken.pcapng", "no capture file")
    writer.close()
    assert "<title>NOT READ: no capture file" in stream.getvalue()
    text = "".join(Elements(stream.getvalue()).text)
    assert "1 captures" not in text
    assert "with all their parts" not in text


def test_captures_that_cannot_be_read_are_none_that_were_left_out():
    stream = io.StringIO()
    writer = html.Writer(stream, ReportOptions())
    writer.unreadable("broken.pcapng", "no capture file")
    writer.capture(capture(transaction()))
    writer.close()
    assert "stand in this overview only" not in stream.getvalue()


def test_one_place_counts_for_tiles_verdict_drives_and_plots():
    states = ["ok", "ok", "partial", "refused", "unanswered", "superseded", "orphan", "orphan"]
    seen = Elements(
        page(capture(*(transaction(n, state=each) for n, each in enumerate(states, 1))))
    )
    text = " ".join("".join(seen.text).split())
    told = "1 partial, 1 refused, 1 unanswered, 1 superseded, 2 orphan"
    assert "NOT OK: 2 of 8 transactions failed, 2 outcome unknown" in text
    assert f"2 ok, {told}" in text
    data = seen.data("data-1")
    assert data["totals"] == {
        "transactions": 8,
        "states": {
            "ok": 2,
            "partial": 1,
            "refused": 1,
            "unanswered": 1,
            "superseded": 1,
            "orphan": 2,
        },
    }
    assert set(data["kinds"]) == set(data["states"])
    tiles = page(capture(transaction(state="orphan"))).split('<dl class="tiles">')[1]
    (tile,) = re.findall(r'<div class="warn"[^>]*title="([^"]+)"', tiles.split("</dl>")[0])
    assert tile == "A response whose request is not in the capture."


def test_what_failed_is_one_figure_and_the_states_are_in_the_line_below():
    states = ["ok", "partial", "refused", "mismatch", "unanswered", "superseded", "orphan"]
    text = page(capture(*(transaction(n, state=each) for n, each in enumerate(states, 1))))
    english = re.sub(r'<span lang="zh">.*?</span>', "", text)
    tiles, below = english.split('<dl class="tiles">')[1].split("</dl>")[:2]
    words = re.sub(r"<[^>]*>", " ", tiles).split()
    assert " ".join(words).startswith("drive 1 read 7 ok 1 failed 3 outcome unknown 2 orphan 1")
    (line,) = re.findall(r'<p class="states dim">(.*?)</p>', below, re.DOTALL)
    assert " ".join(re.sub(r"<[^>]*>", " ", line).split()) == (
        "failed : 1 refused 1 partial 1 mismatch outcome unknown : 1 unanswered 1 superseded"
    )
    assert 'title="The capture has no response to the request."' in line
    assert '<p class="states dim">' not in page(capture(transaction()))


def test_an_ar_is_explained_where_a_sentence_names_it():
    both = texts.PageWords("en").pair(Both("without an AR <b>", "没有AR"))
    assert both.count('<abbr title="application relation (AR): ') == 2
    assert "&lt;b&gt;" in both
    assert "<abbr" not in texts.PageWords("en").pair(Both("ARP", "LEAR-1"))


def test_a_term_is_explained_in_the_words_of_the_glossary():
    lines = [
        each.split("|")[1:4] for each in GLOSSARY.read_text("utf-8").splitlines() if each[:1] == "|"
    ]
    rows = [[cell.strip() for cell in each] for each in lines]
    glossary = {}
    for term, short, means in rows:
        plain = re.sub(r" \(\[.*?\]\(.*?\)\)|`", "", means)
        glossary[f"{term} ({short})" if short else term] = plain
    terms = {key: each for key, each in texts.texts().items() if key.startswith("term_")}
    for key, each in terms.items():
        term, _, means = each["en"].partition(": ")
        assert glossary[term] == means, key
        assert "：" in each["zh"], key
    script = (TEMPLATES / "report" / "base.js").read_text("utf-8")
    known = set(re.findall(r'"(\w+)"', script.split("const TERMS = {")[1].split("};")[0]))
    assert {f"term_{each}" for each in known} <= set(terms)
    drives = next(
        a for tag, a in Elements(page(capture(transaction()))).found if "PZD" in a.get("title", "")
    )
    assert drives["title"].startswith("drive object (DO): a part of a drive")


# The quality of the capture


@pytest.mark.parametrize(
    ("changes", "level", "text"),
    [
        ({}, "good", "read to its end: 1,234 frames"),
        ({"complete": False, "problem": "block 3 is cut"}, "bad", "block 3 is cut"),
        ({"dropped": None}, "none", "does not say whether frames were lost"),
        ({"dropped": 0}, "good", "lost no frame"),
        ({"dropped": 1}, "bad", "lost 1 frame:"),
        ({"dropped": 2000}, "bad", "lost 2,000 frames:"),
        ({"files": [CaptureFile("a", 1, 2), CaptureFile("b", 3, 4)]}, "good", "2 files of a ring"),
        ({"files": [CaptureFile("a", 1), CaptureFile("d", 3, missing_before=2)]}, "bad", "2 files of the"),
        ({"rpc": {"requests": 5, "responses": 0}}, "bad", "Only requests (5)"),
        ({"rpc": {"requests": 0, "responses": 5}}, "bad", "Only responses (5)"),
        ({"rpc": {"requests": 5, "responses": 4, "unanswered": 1}}, "warn", "1 of 5 calls has no response"),
        ({"rpc": {}}, "none", "no acyclic PROFINET call"),
        ({"findings": [handmade.finding("DS106", "warning", "m", 1)]}, "warn", "1 frame was cut"),
        (
            {"findings": [handmade.finding("DS403", "warning", "m", 1)] * 2}, "warn",
            "2 responses belong to no known request",
        ),
    ],
)  # fmt: skip
def test_the_quality_of_a_capture(changes, level, text):
    remarks = quality(capture(transaction(), **changes))
    assert [each.level for each in remarks if text in each.text.en] == [level]


def line(*stations: dict[str, int | None], damaged: int = 0) -> Bus:
    """A line with slaves that differ in this."""
    plain = dict.fromkeys(BusStation._fields) | {
        "role": "slave", "requests": 10, "unanswered": 0, "damaged": 0, "retries": 0, "exchanges": 0,
        "diagnoses_wanted": 0, "diagnoses_fetched": 0, "parameters": 3, "configuration": 5,
    }  # fmt: skip
    found = [BusStation(**plain | {"address": at} | each) for at, each in enumerate(stations, 3)]
    return Bus(99, 0, damaged, 0, found)


@pytest.mark.parametrize(
    ("bus", "level", "text"),
    [
        (line({}), "good", "10 requests, all answered"),
        (line({}, {"unanswered": 4}), "warn", "but 4 of 20 requests have no answer"),
        (line({"unanswered": 10}), "warn", "but 10 of 10 requests have no answer"),
        (line({"unanswered": 10, "parameters": None}), "bad", "Only requests (10)"),
        (line({}, {}), "good", "of each of its 2 slaves is included"),
        (line({}, {"configuration": None}), "none", "of 1 of 2 slaves is not included"),
        (line({}, damaged=3), "warn", "3 frames are damaged"),
    ],
)
def test_the_quality_of_a_capture_of_profibus(bus, level, text):
    remarks = quality(capture(bus=bus))
    assert [each.level for each in remarks if text in each.text.en] == [level]
    assert not [each for each in remarks if "PROFINET" in each.text.en]


def test_what_is_wrong_with_a_station_stands_out():
    text = page(capture(bus=line({"damaged": 6, "diagnoses_wanted": 0}, {})))
    assert text.count('class="number alarm"') == 1
    assert re.search(r'class="number alarm" data-label="damaged"[^>]*>6<', text)


def test_what_a_capture_cannot_show_depends_on_what_is_in_it():
    plain = [each.en for each in blind(capture(transaction(), dropped=0))]
    assert not any("in force later" in line or "lost frames" in line for line in plain)
    assert not any("What the drive made" in line for line in plain)
    item = transaction(operation="change")
    more = [
        each.en
        for each in blind(capture(item, devices=[Device(DRIVE)], records={"1": {"read": 7}}))
    ]
    assert any("in force later" in line for line in more)
    assert any("lost frames" in line for line in more)
    assert any("station name of 1 device" in line for line in more)
    assert any(line.startswith("7 other record requests") for line in more)
    container = capture(item, records={"47": {"write": 2}, "57408": {"write": 1}})
    assert not any("other record request" in each.en for each in blind(container))
    jobs = [transaction(1, state="unanswered"), transaction(2, state="superseded")]
    assert any(
        "2 requests: their responses were not fetched" in each.en for each in blind(capture(*jobs))
    )


# What went wrong


def test_drive_errors_are_put_together_by_their_number_and_direction():
    items = [
        transaction(1, state="error", operation="change", parameters=[failed(), failed(pnu=5)]),
        transaction(2, state="error", operation="change", parameters=[failed()]),
        transaction(3, state="partial", parameters=[parameter(), failed(0x00, values=())]),
    ]
    findings = [
        finding(
            "DS410", "error", 1, number, 4, pnu=pnu, subindex=0, code=code, vendor_id=0x2A, info=0
        )
        for number, pnu, code in ((1, 50303, 0x6B), (1, 5, 0x6B), (2, 50303, 0x6B), (3, 50303, 0))
    ]
    found = problems(capture(*items, findings=findings))
    assert [(each.count, each.what.en) for each in found] == [
        (3, "The drive rejects a value: No change access while the controller is enabled (0x6B)"),
        (1, "The drive does not return a value: Illegal parameter number: the parameter does not exist (0x00)"),
    ]  # fmt: skip
    assert found[0].locations == {"p50303[0] DO 2": 2, "p0005[0] DO 2": 1}
    assert found[0].what.zh.startswith("驱动器不接受写入的值：")


def test_refusals_are_put_together_by_their_status():
    words = [0xDF80B500, 0xDF80B700, 0xDF80B700]
    items = [
        transaction(number, state="refused", operation="change", write_status=word)
        for number, word in enumerate(words, 1)
    ]
    findings = [handmade.finding("DS203", "error", "m", 1, number) for number in (1, 2, 3)]
    found = problems(capture(*items, findings=findings))
    assert [each.count for each in found] == [2, 1]
    assert "(DF80B700)" in found[0].what.en
    assert found[0].advice == texts.Both(
        spec.rules()["DS203"].advice, spec.rules()["DS203"].advice_zh
    )


def test_diagnoses_come_first_then_errors_then_warnings_and_notes_last():
    rules = [("DS417", "warning"), ("DS402", "note"), ("DS315", "error"), ("DS701", "warning")]
    findings = [handmade.finding(rule, severity, rule, 1) for rule, severity in rules]
    diagnoses = [
        handmade.diagnosis("DS701", "warning", "m", count=1),
        handmade.diagnosis("DS721", "note", "m", count=9),
    ]
    found = problems(capture(findings=findings, diagnoses=diagnoses))
    assert [each.rule for each in found] == ["DS701", "DS315", "DS417", "DS721"]


def finding(rule, severity, frame, transaction=None, offset=None, /, **args):
    """A finding as the analysis makes it: with arguments and without words."""
    return Finding(rule, severity, frame, [frame], transaction, offset, args)


RUNNING = {"pnu": 76, "subindex": 1, "code": 0x6B, "vendor_id": 0x2A}


def diagnosis(rule="DS719", args=RUNNING, **changes):
    """A diagnosis as the analysis makes it."""
    item = Diagnosis(rule, spec.rules()[rule].severity, dict(args), DRIVE, 3, [9, 13, 15], [2, 3])
    return replace(item, **changes)


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_a_diagnosis_is_told_in_both_languages_with_what_to_do(lang):
    item = diagnosis(corrected=bytes.fromhex("030102011001004c0001"))
    findings = [finding(rule, "error", 9, 2, 4, **RUNNING) for rule in ("DS410", "DS719")]
    (found,) = problems(capture(transaction(2), findings=findings, diagnoses=[item]))
    assert found.what.en.startswith("r0076[1] cannot be changed now: 0x6B No change access while")
    assert found.what.zh.endswith("0x6B " + spec.error_text(0x6B, "zh", 0x2A))
    assert (found.count, found.frame, found.job) == (3, 9, 2)
    assert found.filter == "frame.number == 9 or frame.number == 13 or frame.number == 15"
    assert found.where == texts.Both.same(DRIVE)
    text = page(capture(transaction(2), findings=findings, diagnoses=[item]), lang=lang)
    assert "030102011001004c0001" in text
    assert "16#0301 16#0201 16#1001 16#004C 16#0001" in text
    assert "#request[0] := 16#03;" in text
    assert "ds47 encode" in text
    assert text.count('<span lang="en">') == text.count('<span lang="zh">')


def test_the_words_that_fill_a_diagnosis_are_of_its_language():
    place, other = (
        {"slot": 1, "subslot": 2, "index": 47},
        {"slot": 3, "subslot": 4, "index": 0xB02E},
    )
    moved = diagnosis(
        "DS708", {"device": DRIVE, "place": place, "status": "DF80B600", "other": other}
    )
    part = diagnosis("DS725", {"what": "no_write", "count": 4, "controller": "c", "device": DRIVE})
    for lang in ("en", "zh"):
        words, row = diagnosis_words(lang), spec.rules()["DS708"]
        template = row.message if lang == "en" else row.message_zh
        told = template.format(
            device=DRIVE,
            place=words["place"].format(slot="1.2", index="47"),
            other=words["place"].format(slot="3.4", index="0xB02E"),
            status="DF80B600",
        )
        assert getattr(messages.message(moved), lang) == told
        row = spec.rules()["DS725"]
        template = row.message if lang == "en" else row.message_zh
        told = template.format(
            what=words["no_write"].format(count=4, controller="c", device=DRIVE), count=4
        )
        assert getattr(messages.message(part), lang) == told


@pytest.mark.parametrize(
    ("number", "told"),
    [
        (1, "p0001 DO 2"),
        (4, "p0001 DO 2, r0002 DO 2, p0003 DO 2, p0004 DO 2"),
        (5, "p0001 DO 2, r0002 DO 2, p0003 DO 2, p0004 DO 2, and 1 more"),
        (7, "p0001 DO 2, r0002 DO 2, p0003 DO 2, p0004 DO 2, and 3 more"),
    ],
)
def test_a_problem_names_four_places_and_counts_the_others(number, told):
    count = range(1, number + 1)
    items = [transaction(n, state="error", parameters=[failed(pnu=n)]) for n in count]
    findings = [finding("DS410", "error", 1, n, code=0x6B, pnu=n) for n in count]
    (found,) = problems(capture(*items, findings=findings))
    assert found.where is not None
    assert found.where.en == told


def test_a_problem_of_the_whole_capture_has_no_place():
    (found,) = problems(capture(diagnoses=[handmade.diagnosis("DS725", "warning", "m")]))
    assert found.where is None


def test_findings_that_differ_are_told_by_an_example_with_the_places_they_name():
    findings = [
        finding("DS417", "warning", 1, 1, pnu=7, subindex=0, read=read, written=2, by=3)
        for read in (1, 4)
    ]
    (found,) = problems(capture(transaction(), findings=findings))
    one = "Parameter p0007[0] reads back as 1, but the last value written in this capture is 2"
    assert found.title.en == f"{one} (frame 3) (for example)"
    assert found.locations == {"p0007[0] DO 2": 2}
    (alone,) = problems(capture(transaction(), findings=findings[:1]))
    assert alone.title.en == f"{one} (frame 3)"


def test_a_finding_that_names_no_parameter_stands_at_the_first_of_its_transaction():
    items = [transaction(1, parameters=[parameter(7), parameter(8)]), transaction(2, parameters=[])]
    findings = [finding("DS315", "error", 1, n, need=5, what="values") for n in (1, 2)]
    (found,) = problems(capture(*items, findings=findings))
    assert found.locations == {"p0007[0] DO 2": 1, f"{DRIVE} DO 2": 1}


def test_frames_for_which_there_was_no_room_are_counted():
    told = diagnosis(frames=[9], count=5, frames_left_out=4)
    (found,) = problems(capture(diagnoses=[told]))
    assert (found.times.en, found.filter_left_out) == ("5 times", 4)


def test_the_first_screen_tells_three_problems_of_one_rule_and_then_the_others():
    """Six in all, in the order in which they are serious."""
    rules = ["DS705"] * 4 + ["DS708", "DS709", "DS719", "DS720"]
    diagnoses = [
        handmade.diagnosis(rule, "error", f"m{n}", count=99 - n) for n, rule in enumerate(rules)
    ]
    told = first_screen(problems(capture(diagnoses=diagnoses)))
    assert [each.what.en for each in told] == ["m0", "m1", "m2", "m4", "m5", "m6"]


def test_many_problems_of_one_rule_do_not_hide_the_others():
    items = [transaction(n, state="error", parameters=[failed(n)]) for n in range(1, 9)]
    findings = [finding("DS410", "error", 1, n, pnu=n, code=n) for n in range(1, 9)]
    findings.append(handmade.finding("DS417", "warning", "read back", 1, 1))
    told = first_screen(problems(capture(*items, findings=findings)))
    assert [each.rule for each in told] == ["DS410"] * 5 + ["DS417"]
    assert "3 more problems" in page(capture(*items, findings=findings))


# Words


def fields(text):
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def test_every_text_is_there_in_both_languages_with_the_same_values():
    for key, words in texts.texts().items():
        assert set(words) == {"en", "zh"}, key
        assert words["en"].strip(), key
        assert words["zh"].strip(), key
        parts = [fields(part) - {"n"} for text in words.values() for part in text.split("|")]
        assert all(part == parts[0] for part in parts), key
        assert words["zh"].count("|") == 0, key


def sources(pattern):
    return {path.name: path.read_text("utf-8") for path in (TEMPLATES / "report").glob(pattern)}


def test_every_text_is_used_and_every_text_used_is_there():
    python = "".join(path.read_text("utf-8") for path in Path(html.__file__).parent.rglob("*.py"))
    pages = "".join(sources("*.j2").values()) + (TEMPLATES / "report.html.j2").read_text("utf-8")
    scripts = "".join(sources("*.js").values())
    used = set(re.findall(r"\bsay\(\s*\"(\w+)\"", python)) | set(
        re.findall(r"\bt\(\"(\w+)\"[,)]", pages)
    )
    used |= set(re.findall(r"label\(\"[\w-]+\", \"(\w+)\"\)", pages))
    used |= {f"js_{key}" for key in re.findall(r"\bsay\(\"(\w+)\"", scripts)}
    assert used <= set(texts.texts())
    names = texts.PageWords("en").for_script()["en"]
    for state in html.views.rows.STATES:
        assert {f"state_{state}", f"about_{state}"} <= set(names)
    known = set(texts.texts()) - set(report_words()) - set(command_words())
    quoted = set(re.findall(r"\"(\w+)\"", python + pages + scripts))
    made = (
        "verdict_",
        "tile_",
        "told_",
        "level_",
        "severity_",
        "js_theme_",
        "state_",
        "about_",
        "sign_",
        "term_",
    )
    unused = {
        key
        for key in known - used
        if not key.startswith(made) and key not in quoted and key.removeprefix("js_") not in quoted
    }
    assert not unused - {f"js_{key}" for key in re.findall(r"words: \"(\w+)\"", scripts)}


SAMPLES = {
    "number": (7, "7"), "numbers": ([7, 8], "7, 8"), "frame": (9, "9"), "frames": ([9, 10], "9, 10"),
    "hex": (0x6B, "0x6B"), "hex32": (0x1C010006, "0x1C010006"), "code": (0x11, "0x11"), "vendor": (0x2A, ""),
    "info": (3, "3"), "status": ("DF80B700", "DF80B700"), "index": (0xB02E, "0xB02E"), "ms": (2.04, "2.0"),
    "ms3": (2.0404, "2.040"), "text": ("10.0.0.9", "10.0.0.9"), "line": ("x" * 101, "x" * 97 + "..."),
    "pkw": (17, "17"), "value": (1.0, "1.0"), "s7_item": (5, "5"), "s7_error": (0x8104, "0x8104"),
    "values": ([1, 2, 3, 4, 5], "1, 2, 3, 4, ..."), "dropped": (None, ""), "among": (True, ""),
    "clause": (None, ""),
}  # fmt: skip
"""A value of each type of argument that needs no words, and how a sentence shows it."""


@pytest.mark.parametrize("rule", spec.rules())
def test_a_finding_with_arguments_is_worded_in_both_languages(rule):
    known = spec.rules()[rule]
    samples = {name: SAMPLES.get(kind, (None, "?")) for name, kind in known.args.items()}
    told = {name: shown for name, (_, shown) in samples.items()}
    args = {name: value for name, (value, _) in samples.items()}
    both = messages.message(finding(rule, "error", 1, **args))
    for lang, template in (("en", known.message), ("zh", known.message_zh)):
        text = status_text(0xDF80B700, lang)
        error = f"0x11 {spec.error_text(0x11, lang, args.get('vendor_id'))}"
        if known.args.get("code") == "pkw":
            error = f"17 {cyclic.error_text(17, lang)}"
        if known.args.get("code") == "s7_item":
            error = f"0x05 {s7.code_text('return_code', 5, lang)}"
        if known.args.get("code") == "s7_error":
            error = s7.error_text(0x8104, lang)
        if args.get("among"):
            error = diagnosis_words(lang)["among"].format(error=error)
        shown = dict(told, text=text, error=error)
        shown["drive"] = sentences.drive(told.get("device", ""), args.get("slot"), lang)
        shown["parameter"] = diagnosis_words(lang)["parameter_unknown"]
        shown["item"] = diagnosis_words(lang)["item"].format_map({"area": "", **told})
        assert getattr(both, lang) == template.format(**shown)
        assert getattr(both, lang) == sentences.words(rule, args, lang)


@pytest.mark.slow
@pytest.mark.parametrize("rule", spec.rules())
def test_a_finding_that_lacks_its_arguments_is_worded_too(rule):
    """A stored result may be older or damaged."""
    args = dict.fromkeys(spec.rules()[rule].args)
    assert messages.message(finding(rule, "error", 1)) == messages.message(
        finding(rule, "error", 1, **args)
    )
    findings = [finding(rule, "error", 1, 1)]
    assert page(capture(transaction(), findings=findings, diagnoses=[diagnosis(rule, {})]))


def test_the_words_of_an_error_number_are_of_either_language():
    both = messages.message(
        finding("DS410", "error", 1, pnu=5, subindex=0, code=1, vendor_id=0x2A, info=0)
    )
    en, zh = (f"0x01 {spec.error_text(1, lang, 0x2A)}" for lang in ("en", "zh"))
    assert both.en == f"Parameter p0005[0] got a negative response: {en} (info 0)"
    assert both.zh == f"参数 p0005[0] 得到否定应答：{zh}（附加信息 0）"


def test_what_an_older_result_says_stays_as_it_is():
    assert messages.message(handmade.finding("DS410", "error", "odd", 1)) == ("odd", "odd")
    assert messages.message(handmade.finding("XX999", "error", "odd", 1)) == ("odd", "odd")


def test_control_characters_and_turned_text_are_made_visible():
    told = "a\u202eb\x1b"
    assert messages.message(handmade.finding("DS410", "error", told, 1)).en == "a\\u202eb\\x1b"
    both = messages.message(finding("DS101", "warning", 1, operation=told))
    assert "a\\u202eb\\x1b" in both.en
    assert "a\\u202eb\\x1b" in both.zh


# Nothing in a capture can break the page


def hostile():
    item = transaction(
        1, state="error", operation="change",
        parameters=[parameter(values=(HOSTILE, QUOTES), format="VisibleString", unit=QUOTES,
                              error=ParameterError(None, 0, said=HOSTILE))],
    )  # fmt: skip
    return capture(
        item,
        path=f"{HOSTILE}{QUOTES}.pcapng",
        problem=QUOTES,
        complete=False,
        devices=[Device(DRIVE, HOSTILE, QUOTES, 1, 2)],
        findings=[
            handmade.finding("DS410", "error", HOSTILE, 1, 1, 2),
            handmade.finding("DS315", "error", QUOTES, 1, 1),
        ],
    )


@pytest.mark.parametrize("count", [1, 3])
def test_what_comes_from_a_capture_is_always_text(count):
    text = page(*[hostile()] * count)
    seen = Elements(text)
    assert HOSTILE not in text.replace(HOSTILE.replace("<", "&lt;"), "")
    plain = Elements(page(*[capture(transaction())] * count))
    assert len([tag for tag, _ in seen.found if tag == "script"]) == len(
        [tag for tag, _ in plain.found if tag == "script"]
    )
    assert not [
        tag for tag, _ in seen.found if tag in ("b", "img", "iframe", "object", "base", "link")
    ]
    assert not [
        name for _, attributes in seen.found for name in attributes if name.startswith("on")
    ]
    assert HOSTILE in "".join(seen.text)
    row = seen.data("data-1")["rows"][0]
    assert row[ROW.index("parameters")][0][1] == [
        f'"{HOSTILE}"',
        '"' + QUOTES.replace('"', '\\"') + '"',
    ]
    assert seen.data("data-1")["devices"] == [[DRIVE, QUOTES]]


def test_the_page_loads_nothing():
    seen = Elements(page(hostile()))
    for tag, attributes in seen.found:
        assert not {"src", "srcset", "action", "formaction", "poster", "background"} & set(
            attributes
        ), tag
        assert attributes.get("href", "#").startswith("#")
        assert "style" not in attributes
    (policy,) = [
        a["content"] for tag, a in seen.found if a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy
    assert "unsafe-eval" not in policy
    assert "http" not in policy


def test_only_the_script_of_the_page_may_run():
    seen = Elements(page(capture(transaction())))
    (policy,) = [a["content"] for tag, a in seen.found if "http-equiv" in a]
    (script,) = [text for attributes, text in seen.scripts if "type" not in attributes]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"'sha256-{digest}'" in policy


def test_the_scripts_make_no_markup_out_of_text_and_ask_no_network():
    banned = (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function"
        r"|fetch\(|XMLHttpRequest|WebSocket|sendBeacon|import\("
    )
    for name, text in sources("*.js").items():
        assert not re.search(banned, text), name
        assert set(re.findall(r"https?://[^\"'\s]+", text)) <= {"http://www.w3.org/2000/svg"}, name
    for name, text in sources("*.css").items():
        assert not re.search(r"url\(|@import", text), name


def test_every_script_file_is_part_of_the_page():
    names = {*html.SCRIPTS, *difference_page.SCRIPTS}
    assert {f"{name}.js" for name in names} == set(sources("*.js"))


def test_data_cannot_end_its_element():
    text = str(embed.as_json({"a": "</script><!--", "b": "\u2028"}))
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": "</script><!--", "b": "\u2028"}


def test_half_a_surrogate_in_a_path_is_no_exception():
    text = page(capture(transaction(), path="a\udc80.pcapng"))
    text.encode("utf-8", "backslashreplace")
    assert "a\\udc80.pcapng" in text


# What stands in the page


def test_the_first_screen_says_what_matters(captures):
    text = " ".join("".join(Elements(page(analyze(captures / "tour-machine.pcapng"))).text).split())
    for part in (
        "NOT OK: 192.168.133.2 writes while its own request is open; 3 more causes; 3 of 8 transactions failed",
        "The file was read to its end: 37 frames.",
        "Both directions are there: 18 calls, 18 responses.",
        "press-1-drive",
        DRIVE,
        "p50076[1] cannot be changed now: 0x6B No change access while the controller is enabled",
        'ds47.finding == "DS410"',
        "frame.number == 29 or frame.number == 33",
        "控制器使能时无修改权限",
        "0x6B: remove the enable (OFF1, standstill) and repeat the change.",
        "0x6B：取消使能（OFF1，静止）后重复修改。",
    ):
        assert part in text, part


def test_the_first_problem_is_that_of_the_verdict_and_one_time_is_not_counted(captures):
    text = page(analyze(captures / "profibus-wrong-project.pcapng"))
    listed = text[text.index('<ol class="problem-list">') : text.index("</ol>")]
    assert re.findall(r'href="#finding-1-(DS\d+)"', listed) == ["DS811", *["DS814"] * 3, "DS813"]
    assert "1 time" not in listed


@pytest.mark.parametrize(
    ("lang", "title"), [("en", "NOT OK: 192.168.133.2 writes"), ("zh", "不正常：192.168.133.2 在")]
)
def test_the_language_chosen_is_the_one_shown_first(captures, lang, title):
    text = page(analyze(captures / "tour-machine.pcapng"), lang=lang)
    assert f'<html lang="{lang}">' in text
    assert f"<title>{title}" in text
    assert text.count('<span lang="en">') == text.count('<span lang="zh">')


def test_the_same_result_gives_the_same_page(captures):
    path = captures / "tour-machine.pcapng"
    assert page(analyze(path)) == page(analyze(path))


@pytest.mark.slow
def test_every_stored_capture_gives_a_page(captures):
    results = [analyze(path) for path in sorted(captures.rglob("*.pcapng"))]
    seen = Elements(page(*results))
    assert len([1 for _, a in seen.found if "data-capture" in a]) == html.DETAILED < len(results)
    overview = [a for tag, a in seen.found if a.get("href", "").startswith("#capture-")]
    assert len({a["href"] for a in overview}) == html.DETAILED
    assert f"{html.DETAILED} captures are shown in full" in "".join(seen.text)


def test_no_capture_at_all_is_a_page_too():
    assert "EMPTY: 0 frames" in page()


def test_of_many_captures_the_worst_are_shown_whole(monkeypatch):
    monkeypatch.setattr(html, "DETAILED", 2)
    results = [capture(transaction(state=state)) for state in ("ok", "refused", "ok", "error")]
    links = [
        a["href"]
        for _, a in Elements(page(*results)).found
        if a.get("href", "").startswith("#capture-")
    ]
    assert links == ["#capture-2", "#capture-4"]


def test_the_overview_is_in_the_order_of_the_text_and_says_what_to_do(captures):
    results = [analyze(path) for path in sorted(captures.glob("diagnosis-*.pcapng"))[:30]]
    rows = list(map(CaptureRow.of, results))
    seen = Elements(page(*results))
    content = "".join(seen.text)
    place = content.rindex("30 个抓包")  # the head of the table
    table = content[place:]
    places = [table.index(Path(row.path).name) for row in sorted(rows, key=CaptureRow.badness)]
    assert places == sorted(places)
    heads = [
        content.index(causes.headline(each, messages.rule_name(each["rule"])).en)
        for each in total(rows)["to_do"]
    ]
    assert len(heads) > 6
    assert heads == sorted(heads)
    assert heads[-1] < place


def test_rows_are_short_and_their_tables_hold_what_repeats():
    items = [
        transaction(1),
        transaction(2, state="error", parameters=[failed()], findings=["DS410"]),
    ]
    data = packed_rows(capture(*items), 100)
    one, two = (dict(zip(ROW, row, strict=True)) for row in data["rows"])
    assert (one["id"], one["start"], one["duration"]) == (1, 0, 12_400.0)
    assert two["start"] == 1_000_000
    assert data["operations"][one["operation"]] == "read"
    assert data["states"][two["state"]] == "error"
    assert one["request"] == "030102011001c47f0000"
    assert one["parameters"] == [[0, [10.0], 1]]
    assert data["addresses"][0][:3] == ["p50303[0]", 50303, 0]
    place, _values, _count, scaled, error = two["parameters"][0]
    assert (place, scaled) == (0, 0)
    assert data["errors"][error][1] == "No change access while the controller is enabled"
    assert data["rules"] == [["DS410", "drive-error", "error"]]


def test_a_row_has_the_frames_of_polls_and_further_reads():
    """0 where there are none, which is shorter."""
    frames = Frames(1, 2, 7, 8, polls=[(3, 4), (5, 6)], rereads=[(9, 10)])
    items = [transaction(1, frames=frames), transaction(2)]
    rows = packed_rows(capture(*items), 100)["rows"]
    polls, rereads = ROW.index("polls"), ROW.index("rereads")
    assert [(row[polls], row[rereads]) for row in rows] == [
        ([(3, 4), (5, 6)], [(9, 10)]), (0, 0),
    ]  # fmt: skip


def test_times_count_from_the_first_frame_of_the_capture():
    item = transaction(1)
    result = capture(item, start_ns=item.start_ns - 2_500_000_000)
    data = packed_rows(result, 100)
    assert data["rows"][0][ROW.index("start")] == 2_500_000


def test_times_of_a_result_without_that_frame_count_from_the_first_transaction():
    items = [transaction(2, id=1), transaction(1, id=2)]
    data = packed_rows(capture(*items), 100)
    assert [row[ROW.index("start")] for row in data["rows"]] == [1_000_000, 0]
    items[0].start_ns += 1
    assert packed_rows(capture(*items), 100)["rows"][0][ROW.index("start")] == 1_000_000.001


def test_the_page_knows_the_size_of_a_value_where_there_is_one():
    """A TimeDifference has four bytes or six, a UnicodeString any number of them."""
    sizes = packed_rows(capture(), 100)["sizes"]
    assert (sizes["Unsigned8"], sizes["Float64"], sizes["Date"]) == (1, 8, 7)
    assert not {"TimeDifference", "UnicodeString", "Zero"} & sizes.keys()


def test_a_long_message_is_cut_and_the_page_knows():
    data = packed_rows(capture(transaction(request=bytes(5000))), 100)
    assert data["rows"][0][ROW.index("request")] == "00" * 2048 + "+2952"
    data = packed_rows(capture(transaction(request=bytes(2048))), 100)
    assert data["rows"][0][ROW.index("request")] == "00" * 2048


def test_scaled_values_stand_behind_the_others():
    items = [
        transaction(1, parameters=[parameter(scaled=[0.5]), failed(scaled=[0.5])]),
    ]
    data = packed_rows(capture(*items), 100)
    assert data["rows"][0][ROW.index("parameters")] == [
        [0, [10.0], 1, ["0.5"]], [0, [10.0], 1, ["0.5"], 0],
    ]  # fmt: skip


def test_where_not_all_jobs_fit_those_that_went_wrong_stay(monkeypatch):
    monkeypatch.setattr(html, "ROWS", 3)
    monkeypatch.setattr(html, "ROWS_EACH", 3)
    states = ["ok"] * 5 + ["refused"] + ["ok"] * 3 + ["error"]
    text = page(capture(*(transaction(n, state=state) for n, state in enumerate(states, 1))))
    data = Elements(text).data("data-1")
    assert [row[0] for row in data["rows"]] == [1, 6, 10]
    assert "3 of 10 transactions are listed" in text
    assert "NOT OK: 2 of 10 transactions failed" in text


def test_long_lists_of_findings_are_cut_with_their_number():
    findings = [handmade.finding("DS315", "error", f"m{n}", 2 * n) for n in range(1, 251)]
    view = capture_view(capture(transaction(), findings=findings), 1, 10)
    (group,) = view.groups
    assert (group.count, len(group.shown), group.left_out, group.filter_left_out) == (
        250,
        100,
        150,
        190,
    )
    assert "150 more are not listed here" in page(capture(transaction(), findings=findings))


def test_a_finding_names_its_further_frames_with_the_transactions_they_are_of():
    both = [Finding("DS705", "error", 9, [5, 9], 2), Finding("DS315", "error", 77, [77])]
    clash, alone = groups(capture(transaction(1), transaction(2), findings=both))[::-1]
    assert [each.others for each in clash.shown] == [[(5, 1)]]
    assert [each.others for each in alone.shown] == [[]]


def test_only_what_the_plugin_finds_has_a_filter_for_it():
    """A diagnosis of the whole capture stands at no frame while Wireshark shows it."""
    found = [handmade.finding(rule, "error", "m", 1) for rule in ("DS410", "DS708", "DS799")]
    assert {each.rule: each.plugin_filter for each in groups(capture(findings=found))} == {
        "DS410": 'ds47.finding == "DS410"', "DS708": None, "DS799": 'ds47.finding == "DS799"',
    }  # fmt: skip


def test_what_the_page_says_of_a_transaction_are_its_findings():
    """Those that belong to none stand in the list of findings only."""
    found = [
        handmade.finding("DS410", "error", "no", 4, 1),
        handmade.finding("DS315", "error", "cut", 9),
    ]
    data = Elements(page(capture(transaction(1), findings=found))).data("data-1")
    assert data["messages"] == {"1": [["DS410", 4, "no", "no", []]]}


def test_a_diagnosis_links_the_frames_it_names_but_not_the_first_which_stands_beside_it():
    args = {
        "case": "two_stations",
        "controller": "a",
        "ar": None,
        "frame": 9,
        "other": "b",
        "other_ar": None,
    }
    told = diagnosis("DS705", {**args, "first": 5}, frames=[5, 9, 13])
    (found,) = problems(capture(transaction(1), transaction(2), diagnoses=[told]))
    assert (found.frame, found.others) == (5, [(9, 2)])


def test_a_missing_drive_object_is_told_with_those_that_answer():
    jobs = [transaction(1, axis=2), transaction(2, axis=3), transaction(3, axis=7, state="error")]
    told = handmade.diagnosis(
        "DS709", "error", "drive object 7 does not exist", DRIVE, 1, [14], [3]
    )
    other = replace(told, rule="DS719")
    found = {each.rule: each.what.en for each in problems(capture(*jobs, diagnoses=[told, other]))}
    assert found["DS719"] == "drive object 7 does not exist"
    assert found["DS709"].startswith("drive object 7 does not exist; ")
    assert "2, 3" in found["DS709"]


def row_of(table, pnu, subindex):
    names = ("device", "object", "pnu", "subindex", "en", "zh", "unit", "reads", "accepted",
             "negative", "sent", "refused", "last", "written", "last_in", "error", "error_in")  # fmt: skip
    (found,) = [row for row in table["rows"] if row[2:4] == [pnu, subindex]]
    return dict(zip(names, found, strict=True))


def test_a_parameter_keeps_its_last_value_and_its_last_refusal():
    change = {"operation": "change"}
    items = [
        transaction(1, parameters=[parameter(values=(1.0, 2.0))]),
        transaction(2, **change, parameters=[parameter(values=(5.0,))]),
        transaction(3, **change, state="error", parameters=[failed(values=(7.0,))]),
        transaction(4, **change, state="unanswered", parameters=[parameter(values=(9.0,))]),
        transaction(
            5, **change, state="refused", write_status=0xDF80B500, parameters=[parameter()]
        ),
        transaction(6, state="mismatch", parameters=[parameter(pnu=None)]),
        transaction(7, operation="vendor", parameters=[parameter(values=(8.0,))]),
        transaction(8, state="refused", read_status=0xDE80B700, parameters=[parameter()]),
        transaction(9, parameters=[failed(values=())]),
        transaction(10, **change, state="superseded", parameters=[parameter(values=(9.0,))]),
    ]
    table, left_out = elements(capture(*items))
    assert left_out == 0
    one = row_of(table, 50303, 0)
    assert (one["reads"], one["accepted"]) == (1, 1)
    assert (one["negative"], one["sent"], one["refused"]) == ([1, 1], [0, 2], [1, 1])
    assert (one["last"], one["written"], one["last_in"]) == ("5.0", 1, 2)
    assert one["error_in"] == 9
    assert one["error"][0].endswith("(0x6B)")
    two = row_of(table, 50303, 1)
    assert (two["reads"], two["accepted"], two["last"]) == (1, 0, "2.0")


def test_a_text_is_one_value():
    items = [
        transaction(
            parameters=[parameter(values=("abc",), format="VisibleString", element_count=9)]
        )
    ]
    table, _ = elements(capture(*items))
    assert [row[12] for row in table["rows"]] == ['"abc"']


# Plots


def test_the_page_with_its_plots_goes_by_mail(captures, tmp_path):
    page_of = tmp_path / "page.html"
    assert (
        main(["report", "-f", "html", "-o", str(page_of), str(captures / "tour-machine.pcapng")])
        == 0
    )
    assert 'data-part="plots"' in page_of.read_text("utf-8")
    assert page_of.stat().st_size <= 350_000


def test_what_is_counted_once_has_its_singular():
    text = page(capture(transaction(), findings=[finding("DS410", "error", 1, 1)], frames=1))
    assert "1 error, 0 warnings, 0 notes" in text
    assert "1 个错误，0 个警告，0 个提示" in text
    assert "The file was read to its end: 1 frame." in text
    shown = re.sub(
        r"<[^>]+>", " ", re.sub(r"<script.*?</script>|<style.*?</style>", "", text, flags=re.DOTALL)
    )
    assert (
        re.findall(
            r"\b1 (?:errors|warnings|notes|frames|transactions|responses|calls|points|drives|captures)\b",
            shown,
        )
        == []
    )


# The title block


def _heading_of(path):
    text = path.read_text("utf-8")
    found = re.search(r'<section class="heading">.*?</section>', text, re.DOTALL)
    return None if found is None else re.sub(r"<[^>]+>|\s+", " ", found[0])


def test_the_title_block_is_what_was_typed_then_what_the_folder_says(tmp_path, captures):
    page_of = tmp_path / "page.html"
    capture_of = tmp_path / "machine" / "tour.pcapng"
    capture_of.parent.mkdir()
    capture_of.write_bytes((captures / "tour-machine.pcapng").read_bytes())
    plain = ["report", "-f", "html", "-o", str(page_of), str(capture_of)]
    assert main(plain) == 0
    assert _heading_of(page_of) is None
    (tmp_path / "ds47.toml").write_text(
        '[report]\ncustomer = "Example <b>Works</b>"\nauthor = "One"\n', "utf-8"
    )
    settings._nearest.cache_clear()
    assert main([*plain, "--author", "Two", "--title", "Press 4", "--order", "4711"]) == 0
    words = _heading_of(page_of)
    assert "Example &lt;b&gt;Works&lt;/b&gt;" in words
    assert "Two" in words
    assert "One" not in words
    assert words.index("Press 4") < words.index("4711")
    assert "<title>Press 4 – " in page_of.read_text("utf-8")


@pytest.mark.parametrize("table", ['titel = "x"', "order = 4711", f'title = "{"x" * 201}"'])
def test_a_title_block_that_cannot_be_is_named(tmp_path, captures, capsys, table):
    capture_of = tmp_path / "tour.pcapng"
    capture_of.write_bytes((captures / "tour-machine.pcapng").read_bytes())
    (tmp_path / "ds47.toml").write_text(f"[report]\n{table}\n", "utf-8")
    settings._nearest.cache_clear()
    assert main(["report", "-f", "html", "-o", str(tmp_path / "x.html"), str(capture_of)]) == 2
    err = capsys.readouterr().err
    assert "ds47.toml: [report]" in err
    assert table.split(" ")[0] in err
    with pytest.raises(ConfigError, match=r"\[report\]"):
        load(tmp_path / "ds47.toml")
