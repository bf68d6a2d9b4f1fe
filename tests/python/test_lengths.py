"""Three lengths of a report: a screen of 40 lines, a summary of 12, everything; and options that a format refuses.

The sentences are tested with the rules, the whole text in test_report_opening.py.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterator
from pathlib import Path

import handmade
import pytest
from jsonschema import Draft202012Validator

from ds47 import spec
from ds47.analysis import analyze
from ds47.cli import main
from ds47.model import CaptureResult, Report
from ds47.report import ReportOptions, open_writer, schema, text, write_all
from ds47.report.bilingual import say
from ds47.report.digest import Digest, first_sentences
from ds47.report.short import Short
from ds47.report.verdict import VerdictCounts, concluded, verdict
from ds47.report.wrap import columns

ROOT = Path(__file__).resolve().parents[2]
CAPTURES = sorted((ROOT / "captures").rglob("*.pcapng"))
SMALL = [each for each in CAPTURES if each.stat().st_size < 40_000]
LONG = ROOT / "captures" / "real-stacks" / "o1_profinetpy062_be.pcapng"
VALIDATOR = Draft202012Validator(schema("summary-1"))
FORMS = [("short", 40), ("summary", 12)]


def written(*results: CaptureResult, name: str = "text", **options: object) -> str:
    stream = io.StringIO()
    known = ReportOptions(rules=spec.rules(), captures=len(results))._replace(**options)
    write_all(open_writer(name, stream, known), Report(list(results)))
    return stream.getvalue()


@pytest.fixture(scope="module")
def results() -> list[CaptureResult]:
    return [analyze(path) for path in [*SMALL[::3], LONG]]


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("width", [60, 80, 140])
@pytest.mark.parametrize(("detail", "most"), FORMS)
def test_it_has_room(
    results: list[CaptureResult], detail: str, most: int, width: int, lang: str
) -> None:
    for result in results:
        lines = written(result, detail=detail, width=width, lang=lang).splitlines()
        assert len(lines) <= most, result.path
        assert max(map(columns, lines)) <= width, result.path


def test_a_screen_begins_and_ends_with_the_verdict() -> None:
    result = analyze(LONG)
    said = verdict(VerdictCounts.of(result)).en
    lines = written(result, detail="short").splitlines()
    assert said == lines[1] == lines[-1]
    assert sum(line.startswith("  DS") for line in lines) == 5
    assert sum(line.lstrip().startswith("look at frame ") for line in lines) == 5
    assert any(re.fullmatch(r"  and \d+ more causes and notes", line) for line in lines)
    assert any(line.startswith(f"all of it: ds47 report --all {LONG}") for line in lines)


@pytest.mark.parametrize("most", [1, 3, 5])
def test_every_cause_is_counted_once_and_one_of_each_kind_comes_first(
    results: list[CaptureResult], most: int
) -> None:
    alike = 0
    for result in results:
        digest, known = Digest.of(result, ReportOptions(), most), concluded(result)
        counted = sum(1 + each.alike for each in digest.causes)
        assert counted + digest.left_out == len(known), result.path
        kinds = len({each.rule for each in known})
        assert len({each.rule for each in digest.causes}) == min(most, kinds), result.path
        alike += sum(each.alike for each in digest.causes)
    assert alike  # else there was nothing to count


def test_a_screen_without_room_for_a_cause_counts_those_like_it() -> None:
    digest = Digest.of(analyze(LONG), ReportOptions(), 5)
    lines = Short("en", 140, lambda _, text: text).screen(digest, ["x"] * 20, [])
    shown = sum(bool(re.match(r"  DS\d", line)) for line in lines)
    rest = sum(1 + each.alike for each in digest.causes[shown:]) + digest.left_out
    assert 0 < shown < 5
    assert f"  and {rest} more causes and notes" in lines


@pytest.mark.parametrize("width", [60, 80])
def test_a_summary_has_the_whole_verdict_and_who(width: int) -> None:
    result = analyze(LONG)
    lines = written(result, detail="summary", width=width).splitlines()
    assert " ".join(" ".join(lines).split()).count(verdict(VerdictCounts.of(result)).en) == 1
    assert any(line.startswith(f"  {result.devices[0].ip}") for line in lines)


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("width", [60, 80, 140])
@pytest.mark.parametrize(("detail", "most"), [("short", 5), ("summary", 3)])
def test_no_sentence_is_cut(
    results: list[CaptureResult], detail: str, most: int, width: int, lang: str
) -> None:
    for result in results:
        said = "".join(written(result, detail=detail, width=width, lang=lang).split())
        whole = tuple(
            "".join(
                f"{each.rule}{say(f'severity_{each.severity}').text(lang)}{colon}{form}".split()
            )
            for each in Digest.of(result, ReportOptions(rules=spec.rules()), most).causes
            for form in (each.message.text(lang), each.brief.text(lang))
            for colon in (":" if lang == "en" else "：")
        )
        for found in re.finditer(r"DS\d{3}(error|warning|note|错误|警告|提示)[:：]", said):
            assert said.startswith(whole, found.start()), result.path


def test_a_summary_of_80_columns_has_three_causes_and_what_to_do() -> None:
    result = analyze(ROOT / "captures" / "tour-machine.pcapng")
    lines = written(result, detail="summary", width=80).splitlines()
    assert sum(line.startswith("  DS") for line in lines) == 3
    assert lines[5].startswith("    -> One transaction at a time")
    assert lines[6].endswith("as the blocks of ds47 encode -f scl-fb do.")


@pytest.mark.parametrize("width", [60, 80])
def test_a_summary_of_many_captures_fits_and_names_the_worst(
    results: list[CaptureResult], width: int
) -> None:
    lines = written(*results, detail="summary", width=width).splitlines()
    assert len(lines) <= 12
    assert max(map(columns, lines)) <= width
    assert sum(bool(re.match(r"  DS\d", line)) for line in lines) == 3
    assert sum(" not ok, errors: " in line for line in lines) == 3


def test_what_somebody_asked_for_stands_on_the_screen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
    tour = ROOT / "captures" / "tour-machine.pcapng"
    assert main(["report", "-s", "failed", str(tour)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 40
    assert [line[:14] for line in lines if re.match(r"#\d", line)] == [
        "#5  08:00:00.7", "#6  08:00:01.1", "#7  08:00:01.3",
    ]  # fmt: skip
    assert any("the same command with --all" in line for line in lines)
    assert main(["report", "-s", "failed", str(LONG)]) == 0
    lines = re.sub(r"\x1b\[\d+m", "", capsys.readouterr().out).splitlines()
    assert len(lines) <= 40
    listed = sum(bool(re.match(r"#\d", line)) for line in lines)
    (asked,) = re.findall(r"--state failed: (\d+) of", "".join(lines))
    assert listed
    assert f"  and {int(asked) - listed} more" in lines


def test_what_has_room_is_there_as_a_whole() -> None:
    result = analyze(ROOT / "captures" / "seed-g120-read.pcapng")
    whole = written(result, detail="auto").splitlines()
    assert written(result, detail="short").splitlines() == [*whole, whole[1]]


def test_on_a_terminal_it_is_short(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("ds47.cli.report.columns_of", lambda _: 100)
    main(["report", "--no-progress", str(LONG)])
    whole = capsys.readouterr().out
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    main(["report", "--no-progress", str(LONG)])
    shown = re.sub(r"\x1b\[\d+m", "", capsys.readouterr().out)
    main(["report", "--no-progress", "--all", str(LONG)])
    everything = capsys.readouterr().out
    assert len(shown.splitlines()) <= 40 < len(whole.splitlines()) < len(everything.splitlines())


def test_what_is_asked_for_is_there_on_a_terminal_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    tour = ROOT / "captures" / "tour-machine.pcapng"
    assert main(["report", "--no-progress", "--plc", str(tour)]) == 0
    assert capsys.readouterr().out.count("PLC: WRREC ") == 8
    assert main(["report", "--no-progress", "--filters", str(LONG)]) == 0
    assert "frame.number == " in capsys.readouterr().out


def test_a_page_of_one_sheet(results: list[CaptureResult]) -> None:
    page = written(results[0], long := analyze(LONG), name="html", detail="summary")
    assert len(page) < 100_000
    assert page.count('<section class="card digest">') == 2
    assert verdict(VerdictCounts.of(long)).en in page
    assert page.count('<p class="advice">') <= 6
    assert "transactions-1" not in page
    assert page.count('<dl class="sign onlyprint">') == 1, "a place to sign, on paper alone"
    assert re.findall(r'<div><dt><span lang="en">(\w+)', page) == ["Name", "Date", "Signature"]


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_summary_as_json(results: list[CaptureResult], lang: str) -> None:
    document = json.loads(written(*results, name="json", detail="summary", lang=lang))
    VALIDATOR.validate(document)
    assert [each["path"] for each in document["captures"]] == [each.path for each in results]
    for told, result in zip(document["captures"], results, strict=True):
        assert told["verdict"] == verdict(VerdictCounts.of(result)).text(lang)
        assert sum(told["states"].values()) == told["transactions"] == len(result.transactions)
        assert len(told["causes"]) <= 3


def cells(markdown: str) -> Iterator[list[str]]:
    for line in markdown.splitlines():
        if line.startswith("| "):
            yield re.split(r"(?<!\\)\|", line)[1:-1]


def test_markdown_is_a_table_whatever_stands_in_it() -> None:
    drive = handmade.transaction(state="refused", write_status=0xDF80B500)
    result = CaptureResult(path="a`|<b>.pcapng", transactions=[drive], frames=1)
    result.findings = [handmade.finding("DS203", "error", "x | <script> *b* [l](http://x)", 1, 1)]
    shown = written(result, name="markdown")
    assert {len(each) for each in cells(shown)} <= {3, 4}
    assert "<script>" not in shown
    assert "[l]" not in shown
    assert "`a'\\|<b>.pcapng`" in shown


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_markdown_on_the_command_line(lang: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "-f", "markdown", "--lang", lang, str(LONG)]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("## ❌ ")
    assert shown.count("**DS") == 5
    assert main(["report", "-f", "markdown", "--summary", "--lang", lang, str(LONG)]) == 0
    assert capsys.readouterr().out.count("**DS") == 3


def test_markdown_of_several_captures(results: list[CaptureResult]) -> None:
    shown = written(*results, name="markdown")
    assert shown.startswith("## ❌ NOT OK: ")
    for result in results:
        assert f"`{result.path}`" in shown
    assert shown.count("\n### ") == 10


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        (["--title", "x"], "--title has no effect in text, only in html"),
        (["--summary", "-f", "csv"], "--summary has no effect in csv, only in text, html, json"),
        (["--all", "-f", "html"], "--all has no effect in html, only in text"),
        (["--plc", "-f", "json"], "--plc has no effect in json, only in text"),
        (["--width", "80", "-f", "html"], "--width has no effect in html, only in text, overview"),
        (["--filters", "-f", "junit"], "--filters has no effect in junit, only in text"),
        (["--reference", "50Hz", "-f", "json"], "--reference has no effect in json, only in"),
    ],
)
def test_an_option_without_effect_is_refused(
    options: list[str], refused: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", *options, str(SMALL[0])]) == 2
    assert refused in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "refused"),
    [
        ("trail -f csv --width 80", "--width has no effect in csv, only in text"),
        ("check -f json --all", "--all has no effect in json, only in text, markdown"),
        ("check -f markdown --summary", "--summary has no effect in markdown, only in text, json"),
        ("diff -f json --all", "--all has no effect in json, only in text, html"),
    ],
)
def test_nor_do_other_commands_take_one(
    words: str, refused: str, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [str(SMALL[0])] * (2 if words.startswith("diff") else 1)
    assert main([*words.split(), *paths]) == 2
    assert refused in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "room", "kept"),
    [
        ("One. Two. Three.", 9, "One. Two."),
        ("One two three four five. Six.", 12, "One two three four five."),
        ("p0971 = 1.5 s. Then more of it.", 14, "p0971 = 1.5 s."),
        ("一个。两个。三个。", 12, "一个。两个。"),
        ("一个。两个。三个。", 11, "一个。"),
    ],
)
def test_whole_sentences_as_far_as_they_have_room(words: str, room: int, kept: str) -> None:
    assert first_sentences(words, room) == kept


def test_the_text_of_a_library_user_is_complete() -> None:
    result = analyze(LONG)
    stream = io.StringIO()
    write_all(text.Writer(stream), Report([result]))
    assert stream.getvalue().count("\n#") == len(result.transactions)


@pytest.mark.parametrize("name", ["text", "markdown"])
def test_chinese_has_no_blank_before_its_brackets_and_commas(name: str) -> None:
    for detail in ("short", "summary"):
        shown = written(analyze(LONG), name=name, detail=detail, lang="zh")
        assert "次）" in shown
        assert not re.search(r"\S [（，]|[^\x00-\x7f] \(", shown)
