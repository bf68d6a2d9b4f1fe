"""The command line: exit statuses, streams, files, the commands that need no capture."""

from __future__ import annotations

import gzip
import json
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from ds47 import __version__, spec
from ds47.cli import COMMANDS, encode, main
from ds47.model import OPERATIONS, STATES
from ds47.report import schema
from ds47.spec.reporting import command_words, report_words
from ds47.spec.shell import shell_word

READ = "03 01 02 01 10 01 c4 7f 00 00"
ANSWER = "03 01 02 01 08 01 41 20 00 00"
EMPTY_PCAP = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
CUT_PCAP = EMPTY_PCAP + struct.pack("<IIII", 1, 0, 60, 60) + bytes(10)


def frame(data):
    """The rest of a zstd frame behind its magic: one segment, one raw block (RFC 8878, 3.1.1)."""
    return bytes([0x20, len(data)]) + (len(data) << 3 | 1).to_bytes(3, "little") + data


def run(capsys, *arguments):
    status = main([str(each) for each in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "b.pcap").write_bytes(EMPTY_PCAP)
    (tmp_path / "a b.PCAP").write_bytes(EMPTY_PCAP)
    (tmp_path / "sub" / "c.pcap.gz").write_bytes(gzip.compress(EMPTY_PCAP))
    (tmp_path / "notes.txt").write_text("no capture")
    return tmp_path


def imported(*arguments):
    """The modules that a command imports, by itself."""
    code = f"import sys; from ds47.cli import main; main({arguments!r}); print(*sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(shown.stdout.splitlines()[-1].split())


def test_version_imports_next_to_nothing():
    ours = {name for name in imported("--version") if name.split(".")[0] == "ds47"}
    assert ours == {"ds47", "ds47.cli", "ds47.version"}


RARE = (
    "argparse", "csv", "difflib", "email", "http", "logging", "multiprocessing", "queue", "random",
    "shlex", "shutil", "socket", "subprocess", "tempfile", "urllib.request", "xml",
    "ds47.cyclic.channels", "ds47.cyclic.named", "ds47.cyclic.pkw", "ds47.cyclic.search",
    "ds47.diagnosis.repair", "ds47.explain", "ds47.export", "ds47.lab", "ds47.library",
    "ds47.parameters.lists", "ds47.profidrive.notation", "ds47.profibus.telegram",
    "ds47.profinet.connect", "ds47.profinet.traces", "ds47.regression", "ds47.report.bus",
    "ds47.report.contract", "ds47.report.html", "ds47.report.json", "ds47.report.narrowing",
    "ds47.report.timelines", "ds47.s7.communication", "ds47.s7.model", "ds47.scapy",
    "ds47.spec.profibus", "ds47.live", "ds47.wireshark",
)  # fmt: skip
"""What a capture of a few record calls does not need."""


def test_a_plain_report_imports_what_it_needs(repository):
    """Importing is most of what a small capture takes, 0.2 to 1 ms a module."""
    capture = repository / "captures" / "conversation-late-read.pcapng"
    loaded = imported("report", str(capture))
    assert not loaded.intersection(RARE)
    ours = [name for name in loaded if name.split(".")[0] == "ds47"]
    assert len(ours) <= 130, "more than there were: import the new one where it is needed"


def test_module_runs():
    shown = subprocess.run(
        [sys.executable, "-m", "ds47", "--version"], capture_output=True, text=True, check=True
    )
    assert shown.stdout.strip() == f"ds47 {__version__}"


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help(capsys, name):
    status, out, _ = run(capsys, *name.split(), "--help")
    assert status == 0
    assert "Usage: ds47" in out


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["report"],
        ["report", "x.pcap", "--select", "XX"],
        ["report", "x.pcap", "--index", "70000"],
        *(["report", "x.pcap", "--slow", limit] for limit in ("-3", "-0.5", "nan", "inf", "x")),
        ["report", "x.pcap", "-f", "docx"],
        ["decode", "xyz"],
        ["decode", "--as", "request", "--request", READ, READ],
        ["encode", "frobnicate"],
        ["rules", "DS999"],
    ],
)
def test_wrong_use_is_2(capsys, arguments):
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert "error: " in err


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("reprot", "No such command 'reprot'. Did you mean: ds47 report, ds47 export?"),
        ("DECODE", "No such command 'DECODE'. Did you mean: ds47 decode, ds47 encode, ds47 demo?"),
        (
            "a b.PCAP",
            "No such command 'a b.PCAP'. For a report of it: ds47 report " + shell_word("a b.PCAP"),
        ),
        ("sub", "No such command 'sub'. For a report of it: ds47 report sub"),
        ("-", "No such command '-'. For a report of it: ds47 report -"),
        ("frobnicate", "No such command 'frobnicate'. Try: ds47 -h"),
    ],
)
def test_no_such_command_says_which_was_meant(capsys, monkeypatch, folder, word, said):
    monkeypatch.chdir(folder)
    status, out, err = run(capsys, word, "--index", "47")
    assert (status, out) == (2, "")
    assert err.splitlines()[-1] == f"ds47: error: {said}"


def test_a_fault_of_ours_is_one_line_and_70(capsys, monkeypatch):
    """1 would say that something was found."""

    def fault(*_):
        raise KeyError("operation\x1b[2J")

    monkeypatch.setattr("ds47.spec.rules", fault)
    monkeypatch.delenv("DS47_TRACEBACK", raising=False)
    status, out, err = run(capsys, "rules", "list")
    assert (status, out) == (70, "")
    assert re.fullmatch(
        r"ds47: error: internal fault: KeyError: 'operation\\x1b\[2J'; please report it .+\n", err
    )
    monkeypatch.setenv("DS47_TRACEBACK", "1")
    status, out, err = run(capsys, "rules", "list")
    assert (status, out) == (70, "")
    assert err.startswith("Traceback (most recent call last):\n")
    assert ", in fault\n" in err


def test_report_of_a_folder_is_sorted_and_recursive(capsys, folder):
    status, out, err = run(capsys, "report", folder, folder / "b.pcap", "-f", "json")
    document = json.loads(out)
    jsonschema.validate(document, schema())
    assert (status, err) == (0, "")
    assert [capture["path"][len(str(folder)) + 1 :] for capture in document["captures"]] == [
        "a b.PCAP",
        "b.pcap",
        str(folder.joinpath("sub", "c.pcap.gz"))[len(str(folder)) + 1 :],
    ]


@pytest.mark.parametrize("format_name", ["text", "json", "ndjson", "csv"])
def test_an_unreadable_capture_is_one_line_and_the_others_are_reported(capsys, folder, format_name):
    arguments = ["report", folder / "gone.pcap", folder / "b.pcap", "-f", format_name]
    status, out, err = run(capsys, *arguments)
    assert status == 3
    assert len(err.splitlines()) == 1
    assert "gone.pcap" in err
    assert out.startswith("path,") if format_name == "csv" else "b.pcap" in out


def test_a_file_that_is_no_capture_is_3(capsys, folder):
    status, _, err = run(capsys, "report", folder / "notes.txt")
    assert status == 3
    assert len(err.splitlines()) == 1


def test_a_cut_capture_is_reported_and_3(capsys, tmp_path):
    (tmp_path / "cut.pcap").write_bytes(CUT_PCAP)
    status, out, err = run(capsys, "report", tmp_path / "cut.pcap")
    assert status == 3
    assert "only partly read" in out
    assert len(err.splitlines()) == 1


def test_a_folder_without_captures_is_3(capsys, tmp_path):
    status, _, err = run(capsys, "report", tmp_path)
    assert status == 3
    assert "no capture in this folder" in err


def test_an_export_is_no_capture_of_its_folder(capsys, folder):
    (folder / "b.ds47.pcapng").write_bytes(EMPTY_PCAP)
    (folder / "sub" / "C.DS47.PCAPNG.GZ").write_bytes(gzip.compress(EMPTY_PCAP))
    _, out, _ = run(capsys, "report", folder, "-f", "json")
    assert len(json.loads(out)["captures"]) == 3
    status, out, _ = run(capsys, "report", folder / "b.ds47.pcapng")
    assert status == 0
    assert "b.ds47.pcapng: 0 frames" in out


def test_report_of_stdin():
    shown = subprocess.run(
        [sys.executable, "-m", "ds47", "report", "-"], input=EMPTY_PCAP, capture_output=True
    )
    assert shown.returncode == 0
    assert shown.stdout.startswith(b"-: 0 frames")


def test_output_file_appears_whole_or_not_at_all(capsys, folder, monkeypatch):
    target = folder / "out.json"
    assert run(capsys, "report", folder, "-f", "json", "-o", target) == (0, "", "")
    before = target.read_bytes()
    jsonschema.validate(json.loads(before), schema())

    def fail(*_):
        raise RuntimeError

    monkeypatch.setattr("ds47.report.json.Writer.close", fail)
    assert run(capsys, "report", folder, "-f", "json", "-o", target)[0] == 70
    assert target.read_bytes() == before
    assert not list(folder.glob(".out*"))


def test_output_that_cannot_be_written_is_2(capsys, folder):
    status, _, err = run(capsys, "report", folder, "-o", folder / "no" / "out.txt")
    assert status == 2
    assert "cannot write" in err


@pytest.mark.parametrize(
    "pack", [bytes, gzip.compress, lambda data: bytes.fromhex("28b52ffd") + frame(data)]
)
@pytest.mark.parametrize(
    "arguments",
    [
        ["report", "b.pcap", "-f", "html", "-o", "evidence"],
        ["report", "evidence", "-o", "evidence"],
        ["check", "b.pcap", "--junit", "evidence"],
        ["check", "b.pcap", "--sarif", "evidence"],
        ["diff", "b.pcap", "b.pcap", "-o", "evidence"],
        ["export", "b.pcap", "-o", "evidence"],
    ],
)
def test_no_report_takes_the_place_of_a_capture(capsys, monkeypatch, folder, pack, arguments):
    monkeypatch.chdir(folder)
    Path("evidence").write_bytes(pack(EMPTY_PCAP))
    before = Path("evidence").read_bytes()
    status, out, err = run(capsys, *arguments)
    assert (status, out) == (2, "")
    assert err.startswith(
        "ds47: error: evidence is a capture and is not overwritten: choose another"
    )
    assert len(err.splitlines()) == 1
    assert Path("evidence").read_bytes() == before


def test_any_other_file_is_written_over(capsys, monkeypatch, folder):
    monkeypatch.chdir(folder)
    for name in ("old.pcap", "empty.pcap"):
        Path(name).write_bytes(b"text" if name == "old.pcap" else b"")
        assert run(capsys, "report", "b.pcap", "-o", name) == (0, "", "")
        assert Path(name).read_text().startswith("b.pcap: 0 frames")


def test_a_file_that_cannot_be_unpacked_is_not_written_over(capsys, monkeypatch, folder):
    monkeypatch.chdir(folder)
    monkeypatch.setitem(sys.modules, "compression.zstd", None)
    monkeypatch.setitem(sys.modules, "backports.zstd", None)
    Path("a.pcap.zst").write_bytes(bytes.fromhex("28b52ffd") + frame(EMPTY_PCAP))
    status, _, err = run(capsys, "report", "b.pcap", "-o", "a.pcap.zst")
    assert status == 2
    assert err.startswith(
        "ds47: error: cannot write over a.pcap.zst: this capture is zstd-compressed"
    )


@pytest.mark.parametrize("words", [["rules", "DS"], ["--help"], ["rules", "--help"]])
def test_a_reader_that_leaves_is_silent(words):
    code = f"import sys; from ds47.cli import main; sys.exit(main({words}))"
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    process.stdout.close()
    _, err = process.communicate()
    assert (process.returncode, err) == (141, b"")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell that closes streams")
@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("report b.pcap >&-", 2, b"ds47: error: standard output is closed\n"),
        ("rules >&-", 2, b"ds47: error: standard output is closed\n"),
        ("--help >&-", 2, b"ds47: error: standard output is closed\n"),
        ("export b.pcap -o - >&-", 2, b"ds47: error: standard output is closed\n"),
        ("check b.pcap >&-", 2, b"ds47: error: standard output is closed\n"),
        ("report b.pcap -f html -o page.html >&-", 0, b""),
        ("report - -o page.html <&- >&-", 3, b"ds47: error: stdin: -: the file is empty\n"),
        ("report . -o page.html >&- 2>&-", 0, b""),
        ("report nowhere.pcap -o page.html 2>&-", 3, b""),
    ],
)
def test_closed_streams(folder, words, status, said):
    line = f"{sys.executable} -m ds47 {words}"
    done = subprocess.run(line, shell=True, capture_output=True, cwd=folder)
    assert (done.returncode, done.stderr) == (status, said)
    if "-o page.html" in words:
        assert (folder / "page.html").exists()


def test_a_console_with_a_code_page_gets_utf_8():
    shown = subprocess.run(
        [sys.executable, "-m", "ds47", "rules", "DS410", "--lang", "zh"],
        capture_output=True,
        check=True,
        env={"PYTHONIOENCODING": "cp1252", "PYTHONPATH": ":".join(sys.path)},
    )
    assert not shown.stdout.decode("utf-8").isascii()


def test_rules_lists_and_explains(capsys):
    status, out, _ = run(capsys, "rules")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == sorted(spec.rules())
    _, out, _ = run(capsys, "rules", "ds301")
    assert out.startswith("DS301 ")
    assert "What to do:" in out
    _, out, _ = run(capsys, "rules", "DS3", "-f", "json")
    assert {rule["id"][:3] for rule in json.loads(out)} == {"DS3"}


def test_rules_that_the_plugin_has_not_are_marked(capsys):
    _, out, _ = run(capsys, "rules", "DS")
    marked = out.count("Only the analyzer finds it, the Wireshark plugin does not.")
    _, out, _ = run(capsys, "rules", "-f", "json")
    told = [each["id"] for each in json.loads(out) if each["analyzer_only"]]
    assert told == [rule.id for rule in spec.rules().values() if rule.analyzer_only]
    assert marked == len(told) > 0


def test_rules_by_name(capsys):
    _, out, _ = run(capsys, "rules", "Drive-Error")
    assert out.startswith("DS410 drive-error (error)\n")
    _, both, _ = run(capsys, "rules", "drive-error", "DS4")
    assert both == run(capsys, "rules", "DS4")[1]


def test_rules_that_have_a_word(capsys):
    status, out, _ = run(capsys, "rules", "refusal")
    assert (status, [line.split()[0] for line in out.splitlines()]) == (0, ["DS701"])
    _, out, _ = run(capsys, "rules", "PUT A QUEUE")
    assert out.startswith("DS705 ")
    _, out, _ = run(capsys, "rules", "轮询", "--lang", "zh")
    assert [line.split()[0] for line in out.splitlines()][:2] == ["DS111", "DS205"]
    for word in ("no-such-word", "", " "):
        status, out, err = run(capsys, "rules", word)
        assert (status, out) == (2, "")
        assert err.splitlines()[-1] == (
            f"ds47: error: no rule has {word!r} in its name or text. Try: ds47 rules"
        )


def test_findings_are_chosen_by_the_name_that_reports_print(capsys, captures):
    def rules(*arguments):
        out = run(capsys, "report", captures / "tour-machine.pcapng", "-f", "json", *arguments)[1]
        return {each["rule"] for each in json.loads(out)["captures"][0]["findings"]}

    assert rules("--select", "drive-error", "--select", "ds70") == {"DS410", "DS701", "DS705"}
    assert "DS410" not in rules("--ignore", "drive-error")
    assert rules("--select", "drive-error", "--ignore", "drive-error") == set()


@pytest.mark.parametrize(
    "text", [READ, READ.replace(" ", ""), "16#0301 16#0201 16#1001 16#C47F 16#0000"]
)
def test_decode_guesses_and_says_so(capsys, text):
    status, out, err = run(capsys, "decode", text)
    assert status == 0
    assert "guessed to be a request" in err
    assert "p50303[0]" in out
    assert "     4  10 01 c4 7f 00 00" in out


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        (["--as", "request", READ], "request"),
        (["--as", "response", ANSWER], "response"),
        (["--request", READ, ANSWER], "response"),
        (["--as", "response", "03 81 02 01 44 02 00 11"], "response"),
        (["--as", "request", "03"], "request"),
    ],
)
def test_decode_json_is_the_contract(capsys, arguments, kind):
    status, out, err = run(capsys, "decode", "-f", "json", *arguments)
    message = json.loads(out)
    validator = jsonschema.Draft202012Validator(schema())
    validator.evolve(schema={"$ref": "urn:ds47:report:2#/$defs/message"}).validate(message)
    assert (status, err, message["kind"]) == (0, "", kind)


def test_decode_with_its_request_names_the_parameter(capsys):
    _, out, _ = run(capsys, "decode", "--request", READ, ANSWER)
    assert "p50303[0] = 10.0" in out
    _, out, _ = run(capsys, "decode", "--as", "response", ANSWER)
    assert "p? = 10.0" in out


def test_decode_stdin():
    shown = subprocess.run(
        [sys.executable, "-m", "ds47", "decode"], input=READ, capture_output=True, text=True
    )
    assert shown.returncode == 0
    assert "p50303[0]" in shown.stdout


def test_encode(capsys):
    line = "read ref 3 axis 2 p50303[0]"
    assert run(capsys, "encode", line) == (0, READ + "\n", "")
    status, out, _ = run(capsys, "encode", *line.split(), "--format", "words")
    assert (status, out) == (0, "16#0301 16#0201 16#1001 16#C47F 16#0000\n")
    _, out, _ = run(capsys, "encode", line, "--format", "scl")
    assert out.splitlines()[1].startswith("#request[0] := 16#03; #request[1] := 16#01;")
    assert encode.written(bytes(3), "words") == "16#0000 16#00"


def words_of(text):
    """The words of a text, without the marks around them."""
    return set(re.findall(r"[^\s，。：；、（）()\[\]{}<>:;,|\"]+", text))


def english_layout():
    """Words of the English layout that have no place in a Chinese one: no state, no name of a field."""
    tables = [*report_words().values(), *command_words().values()]
    bare = [{lang: re.sub(r"{\w+}", " ", text) for lang, text in each.items()} for each in tables]
    english = set().union(*(words_of(each["en"]) for each in bare))
    chinese = set().union(*(words_of(each["zh"]) for each in bare))
    fields = {
        "state",
        "values",
        "value",
        "rule",
        "operation",
        "parameter",
        "name",
        "device",
        "slot",
    }
    names = {rule.name for rule in spec.rules().values()}
    return english - chinese - fields - names - {*STATES, *OPERATIONS}


@pytest.mark.parametrize(
    "command",
    [
        "report {folder} -f overview",
        "report {folder}",
        "report {folder} --results {new} --no-progress",
        "watch --no-follow {folder}/tour-machine.pcapng",
        f"decode --as request {READ}",
        f"decode --as request {READ} 01",
        f"decode --request {READ.replace(' ', '')} {ANSWER}",
        "decode --as response 03 01 02 01 44 02 00 11 00 00",
        "diff {folder}/tour-machine.pcapng {folder}/conversation-error.pcapng",
        "diff {folder}/tour-machine.pcapng {folder}/tour-machine.pcapng",
        "diff -f html {folder}/tour-machine.pcapng {folder}/conversation-error.pcapng",
        "baseline {folder}",
        "check {folder} --summary",
        "accept {folder} --yes",
        "export {folder}/tour-machine.pcapng --anonymise -o {new}",
        "rules",
        "rules DS301",
    ],
)
def test_no_english_word_of_the_layout_is_left_in_chinese(command, capsys, tmp_path, captures):
    folder = tmp_path / "plant"
    folder.mkdir()
    for name in ("tour-machine", "conversation-error", "seed-g120-read"):
        shutil.copy(captures / f"{name}.pcapng", folder)
    if command.startswith(("check", "accept")):  # every kind of change
        run(capsys, "baseline", folder, "--lang", "zh")
        changed(folder / "tour-machine.ds47.json")
    place = {"folder": str(folder), "new": str(tmp_path / "new")}
    _, out, err = run(capsys, *command.format_map(place).split(), "--lang", "zh")
    other = r'<style>.*?</style>|<script.*?</script>|<(span|button)[^>]* lang="en.*?</\1>|<[^>]*>'
    shown = re.sub(other, " ", out, flags=re.DOTALL)  # a page holds both languages
    shown = re.sub(r"(or )?frame\.number (== \d+|in )|{[^}]*}", " ", shown)
    assert re.search("[\u4e00-\u9fff]", shown)
    assert words_of(shown + err) & english_layout() == set()


def changed(path):
    """Changes a stored result in all that people are told of."""
    stored = json.loads(path.read_text("utf-8"))
    result = stored["capture"]
    first, second, third, *others = result["transactions"]
    first["parameters"][0]["values"] = [11.5]
    second["parameters"][0] |= {"unit": None, "values": [1.0, 2.0]}
    third["parameters"] = []
    others[-1]["state"] = "ok"
    others[-2]["parameters"][0]["error"] = {"code": 1, "text": "不", "info": None}
    result["transactions"] = [first, second, third, *others[1:], {**others[0], "axis": 9}]
    result["devices"] = [{"ip": "10.0.0.1", "station": None}]
    result["findings"][0]["message"] = "offset 4: 文"
    path.write_text(json.dumps(stored), "utf-8")


def test_the_formats_of_programs_keep_their_words_in_chinese(capsys):
    for english in (
        ["rules", "DS3", "-f", "json"],
        ["decode", "-f", "json", "--request", READ, ANSWER],
    ):
        _, en, _ = run(capsys, *english)
        _, zh, _ = run(capsys, *english, "--lang", "zh")
        assert re.findall(r'"(\w+)":', en) == re.findall(r'"(\w+)":', zh)
    assert json.loads(en) == json.loads(zh)


def test_flaws_are_told_in_chinese(capsys):
    _, _, err = run(capsys, "encode", "read ref 0 axis 2 p50303", "--lang", "zh")
    assert err == "ds47: 警告 DS301：偏移 0：请求参考为 0，该值为保留值\n"
    _, out, err = run(capsys, "decode", "00" + READ[2:], "--lang", "zh")
    assert err == "ds47: 按请求解码，这是推测；若不是，请用 --as response\n"
    assert out.endswith("DS301 警告：偏移 0：请求参考为 0，该值为保留值\n")
    assert out.startswith("请求，10 个字节\n")


def test_encode_takes_the_quotes_that_cmd_exe_leaves(capsys):
    """A copied line has those of a POSIX shell; cmd.exe hands them over as characters."""
    words = ["'read", "ref", "3", "axis", "2", "p50303[0]'"]
    assert main(["encode", *words]) == 0
    assert capsys.readouterr().out == "03 01 02 01 10 01 c4 7f 00 00\n"


def test_encode_says_what_it_understood(capsys):
    status, out, err = run(capsys, "encode", "change axis 2 p1120[0..1]=Float32:10,5", "-f", "scl")
    assert (status, err) == (0, "ds47: p1120[0..1] := 10.0, 5.0\n")
    assert "#length := 20;" in out
    _, _, err = run(capsys, "encode", "change axis 1 p1=Float32:0.1 p2[3]=UINT:1,16#10")
    assert err == "ds47: r0002[3..4] := 1, 16\n"


def test_encode_takes_the_type_of_a_parameter_that_it_knows(capsys):
    status, out, err = run(capsys, "encode", "write p2900 = 10.0")
    assert (status, out) == (0, "01 02 01 01 10 01 0b 54 00 00 08 01 41 20 00 00\n")
    assert err == (
        "ds47: p2900 is sent as Float32: Fixed value 1, as on SINAMICS\n"
        "ds47: DO 1, because the line names none; DO N in the line names another\n"
    )
    _, out, err = run(capsys, "encode", "change axis 2 P0922=1 p2900=REAL:2.0", "--lang", "zh")
    assert out.startswith("01 02 02 02 10 01 03 9a ")
    assert err == "ds47: p0922 按 Unsigned16 发送：报文选择（PROFIdrive 行规）\n"
    _, _, err = run(capsys, "encode", "-f", "scl-fb", "change axis 2 p2900=10.0")
    assert "p2900 is sent as Float32" in err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("change axis 2 p2900=10,5", "write p2900=Float32:10.5 for one"),
        ("change axis 2 p1999=10.5", "p1999: the format of the value is missing"),
        ("change axis 2 p922=-1", "p922: -1 does not fit Unsigned16 (0 to 65535)"),
        ("change axis 2 p2900=REAL", "the value after the format is missing"),
        ("change axis 2 p2900.description=10.0", "the format of the value is missing"),
        ("change axis 2 p951=1", "the format of the value is missing"),
    ],
)
def test_encode_takes_no_type_where_it_is_not_sure(line, says, capsys):
    status, out, err = run(capsys, "encode", line)
    assert (status, out) == (2, "")
    assert says in err


def test_encode_refuses_a_decimal_comma(capsys):
    for layout in ("hex", "words", "scl"):
        arguments = ("encode", "-f", layout, "change axis 2 p1120=Float32:10,5")
        status, out, err = run(capsys, *arguments)
        assert (status, out) == (2, "")
        assert "p1120=Float32:10.5 for one, p1120[0..1]=Float32:10,5 for 2" in err.splitlines()[-1]


def test_encode_says_that_a_read_of_an_array_asks_for_nothing(capsys):
    status, out, err = run(capsys, "encode", "read p945 p922 p945[0] p945.description")
    assert status == 0
    assert out.startswith("01 01 01 04 10 00 03 b1 00 00 ")
    assert err == (
        "ds47: r0945 is an array, but the request asks for 0 elements;"
        " r0945[0] asks for one, r0945[0..7] for eight\n"
    )
    assert "r0945 是数组" in run(capsys, "encode", "--lang", "zh", "read p945")[2]
    assert run(capsys, "encode", "change axis 1 p945=Unsigned16:0")[2] == ""


def test_the_help_of_encode_has_an_example_a_line(capsys):
    _, out, _ = run(capsys, "encode", "--help")
    assert "\n    read ref 3 axis 2 p50303[0]\n" in out
    assert "\\b" not in out
    assert "\b" not in out


def test_lab_without_scapy_is_one_clear_line(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "scapy", None)
    status, out, err = run(capsys, "lab", "list")
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err == f"ds47: error: the lab needs scapy: {sys.executable} -m pip install scapy\n"


def test_lab_writes_logs_of_profibus(capsys, tmp_path):
    pytest.importorskip("scapy")
    name = "profibus-repeated"
    assert run(capsys, "lab", "write", "--log", tmp_path, name)[1] == f"{tmp_path / name}.txt\n"
    status, out, _ = run(capsys, "report", tmp_path / f"{name}.txt")
    assert status == 0
    assert "DS803" in out
    status, _, err = run(capsys, "lab", "write", "--log", tmp_path, "seed-dcm-read")
    assert status == 2
    assert "PROFIBUS" in err


def test_lab_writes_and_report_reads(capsys, tmp_path):
    pytest.importorskip("scapy")
    _, listed, _ = run(capsys, "lab", "list")
    name = listed.split()[0]
    assert run(capsys, "lab", "write", tmp_path, name)[0] == 0
    assert run(capsys, "lab", "write", tmp_path, "no-such-scenario")[0] == 2
    status, out, _ = run(capsys, "report", tmp_path, "-f", "json")
    assert status in (0, 3)
    jsonschema.validate(json.loads(out), schema())
