"""A golden list: each form of it, which elements a row is about, when a value is as expected, what is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from tests.audit import expected, reading, run
from tests.audit.memory import Memory

import ds47
from ds47.analysis import AnalysisOptions, analyze
from ds47.cli import main
from ds47.model import CaptureResult, Device
from ds47.parameters.expected import Wanted, read
from ds47.parameters.lists import ListError
from ds47.report import schema
from ds47.report.expected import expected_words, judged
from ds47.report.parameters import rows

TOUR = Path(__file__).parents[2] / "captures/tour-machine.pcapng"
"""The drive press-1-drive, 192.168.133.33: DO 2 has p50303[0] = 10.0 and p50304[0] = 60.0, r0945[0] = 7900."""


def written(tmp_path, text, ending="toml"):
    path = tmp_path / f"golden.{ending}"
    path.write_text(text, encoding="utf-8")
    return path


def found(tmp_path, text, ending="toml"):
    """What is found in the tour: `p50304[0] 60.0 expected 59.0`, and the counts."""
    result = judged(analyze(TOUR), read(written(tmp_path, text, ending)), AnalysisOptions())
    told = [each.args for each in result.findings if each.rule == "DS602"]
    shown = [
        f"p{each['pnu']}[{each['subindex']}] {each['value']}, {each['expected']}" for each in told
    ]
    about = result.expected
    return shown, (about.parameters, about.seen, about.wrong)


# Forms of a list


@pytest.mark.parametrize(
    ("text", "said", "counts"),
    [
        ("p50304 = 60.0", [], (1, 1, 0)),
        ("p50304 = 60", [], (1, 1, 0)),
        ("p50304 = 59.0", ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ('"p50304[0]" = 59.0', ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ('"p50304[1]" = 59.0', [], (1, 0, 0)),
        ("50304 = 59.0", ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ("p50304 = { value = 59.9, within = 0.1 }", [], (1, 1, 0)),
        ("p50304 = { value = 59.8, within = 0.1 }", ["p50304[0] 60.0, 59.8 ± 0.1"], (1, 1, 1)),
        ("p50304 = { min = 1.0, max = 60.0 }", [], (1, 1, 0)),
        ("p50304 = { min = 1.0, max = 59.5 }", ["p50304[0] 60.0, 1.0 .. 59.5"], (1, 1, 1)),
        ("p50304 = { min = 60.5 }", ["p50304[0] 60.0, >= 60.5"], (1, 1, 1)),
        ("p50304 = { max = 59.5 }", ["p50304[0] 60.0, <= 59.5"], (1, 1, 1)),
        ("p50304.max = 59.5", ["p50304[0] 60.0, <= 59.5"], (1, 1, 1)),
        ('p50304 = "sixty"', ["p50304[0] 60.0, sixty"], (1, 1, 1)),
        ("[do.2]\np50304 = 59.0", ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ("[do.3]\np50304 = 59.0", [], (1, 0, 0)),
        ('[drive."*"]\np50304 = 59.0', ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ('[drive."192.168.133.33"]\np50304 = 59.0', ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ("[drive.Press-1-drive]\np50304 = 59.0", ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ('[drive."press-*".do.2]\np50304 = 59.0', ["p50304[0] 60.0, 59.0"], (1, 1, 1)),
        ('[drive."192.168.133.34"]\np50304 = 59.0', [], (0, 0, 0)),
        ('"r945[0..1]" = 7900', ["p945[1] 30002, 7900"], (2, 2, 1)),
        ("r945 = 0x1EDC", ["p945[1] 30002, 7900", "p945[2] 0, 7900", "p945[3] 0, 7900"], (4, 4, 3)),
        # never read or written: p50999 and p50076 were refused
        ("p50999 = 1\np50076 = 1\np922 = 105\np50304 = 60.0", [], (4, 1, 0)),
    ],
)  # fmt: skip
def test_a_list_in_toml(tmp_path, text, said, counts):
    assert found(tmp_path, text) == (said, counts)


@pytest.mark.parametrize(
    ("text", "said", "counts"),
    [
        # what says more exactly which element it is about counts, wherever it stands
        ("p50304 = 1.0\n[do.2]\np50304 = 60.0", [], (1, 1, 0)),
        ('"p50304[0]" = 60.0\np50304 = 1.0', [], (1, 1, 0)),
        ("[drive.press-1-drive]\np50304 = 60.0\n[do.2]\np50304 = 1.0", [], (1, 1, 0)),
        ('[drive."press-*"]\np50304 = 1.0\n[drive.press-1-drive]\np50304 = 60.0', [], (1, 1, 0)),
        ('[drive."*"]\np50304 = 1.0\n[drive."press-*"]\np50304 = 60.0', [], (1, 1, 0)),
    ],
)
def test_the_exact_row_wins(tmp_path, text, said, counts):
    assert found(tmp_path, text) == (said, counts)


@pytest.mark.parametrize(
    "text",
    [
        "drive,drive object,parameter,index,value\npress-1-drive,2,p50304,0,59.0\n",
        "Drive;Drive_Object;PNU;Subindex;Value\n192.168.133.33;DO 2;50304;0;59,0\n",
        "parameter\tvalue\np50304[0]\t59.0\n\n",
        "驱动器,驱动对象,参数号,下标,期望值\n*,2,p50304,0,59.0\n",
        "device,station,target,pnu,subindex,value\n10.0.0.1,press-1-drive,,50304,0,59.0\n",
        "station,parameter,value\nPRESS-1-DRIVE,p50304,59.0\n",
        "parameter,value,within\np50304,58.0,1\n",
        "parameter,min,max\np50304,,59.0\n",
    ],
)
def test_a_list_in_csv(tmp_path, text):
    said, counts = found(tmp_path, text, "csv")
    (one,) = said
    assert one.startswith("p50304[0] 60.0, ")
    assert counts == (1, 1, 1)


def test_a_list_in_a_workbook(tmp_path):
    """Numbers, booleans and texts as a spreadsheet has them; the first sheet counts."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Drive", "DO", "PNU", "Index", "Value", "Within"], [], ["press-*", 2, "p50304", 0, 58, 1.5],
                [None, 2, 50303, None, "10,0", None], [None, None, "p1", None, True, None]):  # fmt: skip
        book.active.append(row)
    book.create_sheet("other").append(["nothing"])
    path = tmp_path / "golden.xlsx"
    book.save(path)
    assert [each.wanted for each in read(path)] == [
        Wanted("58 ± 1.5", 56.5, 59.5), Wanted("10,0", 10.0, 10.0), Wanted("True", 1, 1),
    ]  # fmt: skip
    result = judged(analyze(TOUR), read(path), AnalysisOptions())
    (one,) = [each.args for each in result.findings if each.rule == "DS602"]
    assert (one["pnu"], one["expected"]) == (50304, "58 ± 1.5")
    assert (result.expected.seen, result.expected.wrong) == (2, 1)
    book.active["C3"] = "ramp"
    book.save(path)
    with pytest.raises(ListError, match=r"golden\.xlsx, line 3: 'ramp' is not a parameter"):
        read(path)


def test_the_name_of_the_station_counts_more_than_the_address(tmp_path):
    rows = "device,station,parameter,value\n192.168.133.33,press-2-drive,p50304,59.0\n"
    assert found(tmp_path, rows, "csv") == ([], (0, 0, 0))
    (row,) = read(written(tmp_path, rows, "csv"))
    assert row.is_of(Device("192.168.133.33"))  # has no name
    assert not row.is_of(Device("192.168.133.34"))


# Lists that are wrong


@pytest.mark.parametrize(
    ("text", "ending", "says"),
    [
        ("p50304 = ]", "toml", r"golden.toml: no TOML: .*line 1.*\. Try: p1120 = 4.5"),
        ("", "toml", r"golden.toml: no parameter has a value in it\. Try: "),
        ("# one\n[do.2]\nramp = 4\n", "toml", r"line 3: 'ramp' is not a parameter\. Try: p1120"),
        ("[do.two]\np1 = 4\n", "toml", r"line 1: 'two' is not the number of a drive object\. Try: 3"),
        ("do = 4\n", "toml", r"line 1: write it as a table\. Try: \[do\.3\]"),
        ("drive = 4\n", "toml", r'line 1: write it as a table\. Try: \[drive\."press-1"\]'),
        ("p1 = 1\np2 = { value = 1, plus = 2 }\n", "toml", r"line 2: p2 has no key 'plus'; known are"),
        ("p2 = { value = 1, max = 2 }\n", "toml", r"line 1: p2 has a value and a range\. Try: one"),
        ("p2 = { within = 2 }\n", "toml", r"line 1: p2 has no value\. Try: "),
        ("p2 = {}\n", "toml", r"line 1: p2 has no value\. Try: "),
        ("p2 = { min = 2, max = 1 }\n", "toml", r"line 1: min 2 of p2 is more than max 1\. Try: "),
        ("p2 = { value = 1, within = -2 }\n", "toml", r"within of p2 is -2, less than 0\. Try: 2"),
        ('p2 = { value = "a", within = 2 }\n', "toml", r"p2 is 'a', no number, within 2\. Try: "),
        ('p2 = { min = "a" }\n', "toml", r"min of p2 is 'a', no number\. Try: "),
        ("p2 = nan\n", "toml", r"p2 is nan, neither a number nor a text\. Try: "),
        ("p2 = [1, 2]\n", "toml", r"p2 is \[1, 2\], neither a number nor a text\. Try: "),
        ("p1120 = 1\n\nP1120 = 2\n", "toml", r"line 3: p1120 is 2, but 1 in line 1\. Try: one of them"),
        ('"p2[3..1]" = 1\n', "toml", r"line 1: 'p2\[3\.\.1\]' is not a parameter"),
        ("a,b\n1,2\n", "csv", r"line 1: no headings that are known \(a, b\)\. Try: drive,"),
        ("\nparameter,value\np1,1\nq1,2\n", "csv", r"line 4: 'q1' is not a parameter\. Try: "),
        ("parameter,value\np1,1\np2,\n", "csv", r"line 3: p2 has no value\. Try: "),
        ("parameter,index,value\np1,x,1\n", "csv", r"line 2: 'x' is not an index\. Try: 0"),
        ("parameter,do,value\np1,x,1\n", "csv", r"line 2: 'x' is not the number of a drive object"),
        ("parameter,value\np1120,1\np1120,2\n", "csv", r"line 3: p1120 is 2, but 1 in line 2\. Try: one"),
        ("parameter,value\n", "csv", r"golden.csv: no parameter has a value in it\. Try: "),
        ("parameter\n", "ods", r"golden.ods: no list .* ends in \.ods\. Try: \.toml, \.csv or \.xlsx"),
        ("parameter\n", "xlsx", r"golden.xlsx: no workbook of Excel 2007 or later"),
    ],
)  # fmt: skip
def test_a_list_that_is_wrong(tmp_path, text, ending, says):
    with pytest.raises(ListError, match=says):
        read(written(tmp_path, text, ending))


def test_lines_of_a_longer_list(tmp_path):
    text = '[drive.a]\np1 = 1\n[drive.b.do.3]\n"p1[0]" = { value = 1 }\n# p2\np2 = { value = "x",\n within = 1 }\n'
    with pytest.raises(
        ListError, match="no TOML"
    ):  # no newline inside such a table before TOML 1.1
        read(written(tmp_path, text))
    text = '[drive.a]\np2 = 1\n[drive.b.do.3]\np1 = """\nx\n"""\np2 = { value = "x", within = 1 }\n'
    with pytest.raises(ListError, match="line 7: p2"):
        read(written(tmp_path, text))


# Values


@pytest.mark.parametrize(
    ("wanted", "value", "kind", "fits"),
    [
        (Wanted("0.1", 0.1, 0.1), 0.1, "Float32", True),
        (Wanted("0.1", 0.1, 0.1), 0.10000000149011612, "Float32", True),
        (Wanted("0.1", 0.1, 0.1), 0.1000001, "Float32", False),
        (Wanted("0.1", 0.1, 0.1), 0.10000000149011612, "Float64", False),
        (Wanted("16777217", 16777217, 16777217), 16777216.0, "Float32", True),
        (Wanted("16777217", 16777217, 16777217), 16777216, "Unsigned32", False),
        (Wanted("1e40", 1e40, 1e40), 5.0, "Float32", False),
        (Wanted("5", 5, 5), 5, "Unsigned16", True),
        (Wanted("5.0", 5.0, 5.0), 5, "Unsigned16", True),
        (Wanted("5.5", 5.5, 5.5), 5, "Unsigned16", False),
        (Wanted("1.0 ± 0.1", 1.0 - 0.1, 1.0 + 0.1), 1.1, "Float32", True),
        (Wanted("0.6 ± 0.1", 0.6 - 0.1, 0.6 + 0.1), 0.7, "Float64", True),
        (Wanted("0.6 ± 0.1", 0.6 - 0.1, 0.6 + 0.1), 0.71, "Float64", False),
        (Wanted("18446744073709551615", 2**64 - 1, 2**64 - 1), str(2**64 - 1), "Unsigned64", True),
        (Wanted("18446744073709551615", 2**64 - 1, 2**64 - 1), str(2**64 - 2), "Unsigned64", False),
        (Wanted("5", 5, 5), "NaN", "Float32", False),
        (Wanted("press"), "press", "VisibleString", True),
        (Wanted("press"), "Press", "VisibleString", False),
        (Wanted("7", 7, 7), "7", "VisibleString", True),
        (Wanted("7", 7, 7), "07", "VisibleString", False),
        (Wanted("press"), 5, "Unsigned16", False),
    ],
)  # fmt: skip
def test_a_value_is_as_expected(wanted, value, kind, fits):
    assert wanted.fits(value, kind) is fits


@pytest.mark.parametrize(
    ("cell", "number"),
    [("4.5", 4.5), ("0x10", 16), ("TRUE", 1), ("false", 0), ("007", 7), ("4,5", None), ("nan", None)],
)  # fmt: skip
def test_a_number_in_a_cell(tmp_path, cell, number):
    (row,) = read(written(tmp_path, f'parameter,value\np1,"{cell}"\n', "csv"))
    assert row.wanted == (cell, number, number)


def test_a_boolean_is_a_number(tmp_path):
    (row,) = read(written(tmp_path, "p1 = true"))
    assert row.wanted == ("1", 1, 1)


# Counted once more, from the bytes


@pytest.mark.parametrize(
    ("name", "wanted", "found"),
    [
        ("tour-machine", {50303: 10.0, 50304: 59.0, 945: 7900.0}, 4),
        ("tour-machine", {50303: 10.0, 50304: 60.0}, 0),
        ("conversation-partial-change", {1120: 5.0, 2900: 1.0}, 1),
        ("conversation-read-back", {1120: 10.0, 1121: 1.0}, 1),
        ("cyclic-longer-ramp", {50303: 11.0, 50304: 60.0}, 1),
        ("profibus-seed-records", {50303: 10.0, 50304: 60.0, 2901: 0.0}, 2),
    ],
)
def test_the_auditor_finds_the_same(name, wanted, found, tmp_path):
    text = "".join(f"{pnu} = {value}\n" for pnu, value in wanted.items())
    path = TOUR.with_name(f"{name}.pcapng")
    item = reading.read(path, "--expect", str(written(tmp_path, text)))
    findings = [each for each in item.findings if each.rule == "DS602"]
    assert len(findings) == found
    assert list(map(str, run.complaints(item))) == []
    memory = Memory(item)
    assert list(map(str, expected.check(item, memory, wanted))) == []
    assert len(list(expected.check(item, memory, {}))) == found
    for each in findings:
        for key in ("value", "by", "device", "how", "pnu", "subindex"):
            changed = replace(
                each, args={**each.args, key: each.args["value"] if key == "by" else 12345}
            )
            assert list(run.of_finding(changed, item, memory)) != [], key


# Both ways, and everywhere


@pytest.fixture
def good(tmp_path):
    """The table of a good machine, as `-f parameters` writes it."""
    path = tmp_path / "good.csv"
    assert main(["report", "-f", "parameters", str(TOUR), "-o", str(path)]) == 0
    return path


@pytest.fixture
def worse(good):
    """The same of a machine whose p50304[0] was 59.0."""
    text = good.read_text(encoding="utf-8")
    assert text.count(",60.0,Float32,") == 1
    good.write_text(text.replace(",60.0,Float32,", ",59.0,Float32,"), encoding="utf-8")
    return good


SENTENCE = "p50304[0] of 192.168.133.33 DO 2 is 60.0, expected 59.0 (read in frame 17)"
COUNTS = "2 of 2 expected parameters appear in the capture; 1 is not as expected"


def test_a_machine_is_like_itself(good, capsys):
    assert main(["report", "--expect", str(good), "--select", "DS602", str(TOUR)]) == 0
    out = capsys.readouterr().out
    assert "2 of 2 expected parameters appear in the capture; all of these are as expected" in out
    assert "DS602" not in out


def test_faults_and_what_was_never_known_is_not_expected_of_a_table(good):
    assert sorted(row.pnu for row in read(good)) == [50303, 50304]


@pytest.mark.parametrize("name", ["text", "html", "markdown"])
def test_what_differs_is_in_every_report_for_people(name, worse, capsys):
    assert main(["report", "-f", name, "--expect", str(worse), str(TOUR)]) == 0
    out = " ".join(capsys.readouterr().out.replace("\\", "").split())
    assert COUNTS in out
    assert SENTENCE in out


@pytest.mark.parametrize("name", ["json", "ndjson", "csv", "junit", "sarif"])
def test_what_differs_is_in_every_report_for_programs(name, worse, capsys):
    assert main(["report", "-f", name, "--expect", str(worse), str(TOUR)]) == 0
    assert "DS602" in capsys.readouterr().out


def test_the_json_has_facts_and_counts(worse, capsys):
    main(["report", "-f", "json", "--expect", str(worse), str(TOUR)])
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, schema())
    (capture,) = document["captures"]
    assert capture["expected"] == {"parameters": 2, "seen": 2, "wrong": 1, "absent": []}
    (one,) = [each for each in capture["findings"] if each["rule"] == "DS602"]
    assert one["message"] == SENTENCE
    assert one["frame"] == 17
    assert one["time"] == "2026-01-01T08:00:00.386000000Z"
    (owner,) = [each for each in capture["transactions"] if each["id"] == one["transaction"]]
    assert owner["findings"] == ["DS417", "DS602"]


def test_a_capture_without_a_drive_has_none_of_them(tmp_path):
    result = judged(
        CaptureResult("nothing"), read(written(tmp_path, "p922 = 1")), AnalysisOptions()
    )
    assert (result.expected.parameters, result.expected.seen, result.expected.absent) == (1, 0, [])


@pytest.mark.parametrize("name", ["field/s7-drive-elements.pcap", "cyclic-longer-ramp.pcapng"])
def test_every_channel_counts(name, tmp_path):
    """Items of S7, PKW and records: a finding has the value, and its transaction knows it."""
    capture = TOUR.parent / name
    (known, *_) = [each for each in rows(analyze(capture)) if each.element.last]
    text = f"{known.pnu} = 123456.5"
    result = judged(analyze(capture), read(written(tmp_path, text)), AnalysisOptions())
    found = [each for each in result.findings if each.rule == "DS602"]
    assert {each.args["value"] for each in found} >= {known.element.last.value}
    assert all("DS602" in result.transactions[each.transaction - 1].findings for each in found)


def test_without_a_list_there_is_no_word_of_it(capsys):
    main(["report", "-f", "json", str(TOUR)])
    assert '"expected"' not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ([], 0),
        (["--fail-on", "warning", "--select", "DS602"], 1),
        (["--fail-on", "error", "--select", "DS602"], 0),
        (["--fail-on", "note", "--select", "DS6", "--ignore", "not-as-expected"], 0),
        (["--fail-on", "warning", "--select", "DS602", "-f", "ndjson"], 1),
        (["--fail-on", "warning", "--select", "DS602", "-j", "2"], 1),
        (["--fail-on", "warning", "--select", "DS602", "--do", "2"], 1),
    ],
)
def test_the_exit_status(options, status, worse, capsys):
    assert main(["report", "--expect", str(worse), *options, str(TOUR)]) == status


def test_a_written_value_counts_too(tmp_path):
    """p50304[0] := 100.0 was accepted in frame 13, and read as 60.0 later: without the read it is the last one."""
    result = analyze(TOUR)
    result.transactions = [each for each in result.transactions if each.operation == "change"]
    result = judged(result, read(written(tmp_path, "p50304 = 60.0")), AnalysisOptions())
    (one,) = [each for each in result.findings if each.rule == "DS602"]
    assert (one.args["value"], one.args["how"], one.frame) == (100.0, "expected_written", 13)


def test_each_capture_of_a_folder_in_several_processes(tmp_path, worse, capsys):
    folder = tmp_path / "captures"
    folder.mkdir()
    for name in ("one.pcapng", "two.pcapng"):
        (folder / name).write_bytes(TOUR.read_bytes())
    told = []
    for jobs in ("1", "2"):
        main(["report", "-f", "json", "-j", jobs, "--expect", str(worse), str(folder)])
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]
    assert [each["expected"]["wrong"] for each in json.loads(told[0])["captures"]] == [1, 1]


def test_stored_results_are_of_their_list(tmp_path, worse, capsys):
    out = str(tmp_path / "out")
    with_list = ["report", "--results", out, "--resume", "--expect", str(worse), str(TOUR)]
    assert main([*with_list, "--fail-on", "warning", "--select", "DS602"]) == 1
    main([*with_list, "-f", "json", "--select", "DS602"])
    shown = capsys.readouterr()
    assert '"wrong": 1' in shown.out
    assert "done again" not in shown.err
    main(["report", "--results", out, "--resume", "--select", "DS602", str(TOUR)])
    shown = capsys.readouterr()
    assert "1 capture done again: other options" in shown.err
    assert "DS602" not in shown.out


def test_a_list_that_is_wrong_at_the_command(tmp_path, capsys):
    path = written(tmp_path, "ramp = 4")
    assert main(["report", "--expect", str(path), str(TOUR)]) == 2
    assert (
        f"--expect {path}, line 1: 'ramp' is not a parameter. Try: p1120" in capsys.readouterr().err
    )
    assert main(["report", "--expect", "nowhere.toml", str(TOUR)]) == 2
    assert "nowhere.toml: No such file" in capsys.readouterr().err


def test_the_list_of_a_folder(tmp_path, capsys):
    (tmp_path / "one.pcapng").write_bytes(TOUR.read_bytes())
    written(tmp_path, "p50304 = 59.0")
    (tmp_path / "ds47.toml").write_text('[expect]\nfile = "golden.toml"\n', encoding="utf-8")
    assert main(["report", str(tmp_path / "one.pcapng")]) == 0
    assert SENTENCE.split(" is ")[1] in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("expect = 1", "expect: write it as a table, [expect]"),
        ("[expect]\nlist = 1", "[expect]: unknown key 'list'; known is file"),
        ("[expect]\nfile = 1", "[expect] file: write the name of a list"),
        ('[expect]\nfile = "golden.toml"', "golden.toml: No such file"),
    ],
)
def test_a_folder_without_the_list_that_it_names(tmp_path, text, says, capsys):
    (tmp_path / "one.pcapng").write_bytes(TOUR.read_bytes())
    (tmp_path / "ds47.toml").write_text(text, encoding="utf-8")
    assert main(["report", str(tmp_path / "one.pcapng")]) == 3
    assert says in capsys.readouterr().err


def test_a_check_takes_the_list_of_its_folder(tmp_path, capsys):
    (tmp_path / "one.pcapng").write_bytes(TOUR.read_bytes())
    path = written(tmp_path, "p50304 = 60.0")
    (tmp_path / "ds47.toml").write_text('[expect]\nfile = "golden.toml"\n', encoding="utf-8")
    assert main(["baseline", str(tmp_path)]) == 0
    assert main(["check", str(tmp_path)]) == 0
    path.write_text("p50304 = 59.0", encoding="utf-8")
    from ds47.batch.settings import _nearest

    _nearest.cache_clear()  # a command reads it once
    assert main(["check", "--fail-on", "warning", str(tmp_path)]) == 1
    assert "DS602" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "status"), [(["--fail-on", "warning"], 1), ([], 0), (["--fail-on", "never"], 0)]
)
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_check_with_a_list(options, status, jobs, tmp_path, capsys):
    """Each capture of a folder against its stored result, and its drives against the list."""
    folder = tmp_path / "captures"
    folder.mkdir()
    for name in ("one.pcapng", "two.pcapng"):
        (folder / name).write_bytes(TOUR.read_bytes())
    assert main(["baseline", str(folder)]) == 0
    right, wrong = (
        written(folder, f"p50304 = {each}").rename(tmp_path / f"{each}.toml")
        for each in (60.0, 59.0)
    )
    assert (
        main(["check", "-j", jobs, "--expect", str(right), "--fail-on", "note", str(folder)]) == 0
    )
    capsys.readouterr()
    assert main(["check", "-j", jobs, "--expect", str(wrong), *options, str(folder)]) == status
    assert (
        capsys.readouterr().out.count("p50304[0] of 192.168.133.33 DO 2 is 60.0, expected 59.0")
        == 2
    )
    assert main(["check", "--expect", "nowhere.toml", str(folder)]) == 2


def test_the_library(worse):
    (one,) = [each for each in ds47.analyze(TOUR, expect=worse).findings if each.rule == "DS602"]
    assert one.args["expected"] == "59.0"
    with pytest.raises(ValueError, match=r"nowhere\.csv: No such file"):
        ds47.analyze(TOUR, expect="nowhere.csv")
    with pytest.raises(TypeError):
        ds47.watch(TOUR, expect=worse)


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_the_library_with_several_captures(jobs, worse):
    paths = [TOUR, TOUR.with_name("seed-g120-read.pcapng")]
    results = ds47.analyze_many(paths, jobs=jobs, expect=worse)
    found = [[each.rule for each in one.findings].count("DS602") for one in results]
    assert found == [1, 0]


@pytest.mark.parametrize(
    ("text", "en", "zh"),
    [
        (
            "p922 = 1", "0 of 1 expected parameter appears in the capture", "预期的 1 个参数中有 0 个出现在抓包中"
        ),
        (
            "[drive.press-2]\np922 = 1\n", "expected, but not in the capture: press-2", "预期但不在抓包中：press-2"
        ),
        (
            "p922 = 1\n[drive.press-2]\np922 = 1\n",
            "0 of 1 expected parameter appears in the capture; expected, but not in the capture: press-2",
            "预期的 1 个参数中有 0 个出现在抓包中；预期但不在抓包中：press-2",
        ),
        (
            "p922 = 1\np50304 = 1\np50303 = 1\n",
            "2 of 3 expected parameters appear in the capture; 2 are not as expected",
            "预期的 3 个参数中有 2 个出现在抓包中；2 个与预期不符",
        ),
    ],
)  # fmt: skip
def test_the_words_of_the_counts(tmp_path, text, en, zh):
    result = judged(analyze(TOUR), read(written(tmp_path, text)), AnalysisOptions())
    assert expected_words(result.expected) == (en, zh)
