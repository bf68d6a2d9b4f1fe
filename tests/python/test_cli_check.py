"""`ds47 baseline`, `check`, `accept` and `diff` as commands: files, streams, exit statuses."""

from __future__ import annotations

import gzip
import json
import os
import re
import shlex
import shutil
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from frames import whole_frames
from ringbuffer import NIGHT, pieces, recording, ring

from ds47.cli import main
from ds47.regression.baseline import path_of

AGAIN = "20240102030000"
NAMES = ("seed-g120-read.pcapng", "conversation-error.pcapng")


def run(capsys, *arguments):
    status = main([str(each) for each in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


@pytest.fixture
def folder(tmp_path, captures):
    place = tmp_path / "fw 5.2"
    place.mkdir()
    for name in NAMES:
        shutil.copy(captures / name, place / name)
    return place


@pytest.fixture
def stored(folder, capsys):
    assert run(capsys, "baseline", folder)[0] == 0
    return folder


def edit(folder, name, old, new):
    path = folder / name
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_a_missing_baseline_fails_and_is_not_made(folder, capsys):
    status, out, _ = run(capsys, "check", folder)
    assert status == 1
    assert "make one with: ds47 baseline" in out
    assert not list(folder.glob("*.json"))


def test_stored_results_check(stored, capsys):
    status, out, _ = run(capsys, "check", stored)
    assert status == 0
    assert out == "2 captures: 2 as stored, 0 not\n"


def test_a_stored_result_without_its_capture_fails(stored, capsys, tmp_path):
    (stored / NAMES[0]).unlink()
    junit, sarif = tmp_path / "j.xml", tmp_path / "s.sarif"
    arguments = ["check", stored, tmp_path, "--junit", junit, "--sarif", sarif]
    status, out, err = run(capsys, *arguments)
    gone = stored / "seed-g120-read.ds47.json"
    said = "its capture is gone: restore it, or delete this stored result"
    assert (status, err) == (1, "")
    assert out == f"FAILED   {gone}: {said}\n2 captures: 1 as stored, 1 not\n"
    suite = ET.parse(junit).getroot()[0]
    assert (suite.get("tests"), suite.get("errors")) == ("2", "1")
    error = suite.find("testcase/error")
    assert error is not None
    assert error.get("message") == said
    (result,) = json.loads(sarif.read_text(encoding="utf-8"))["runs"][0]["results"]
    assert said in result["message"]["text"]
    gone.unlink()
    assert run(capsys, "check", stored)[0] == 0


def test_results_find_their_captures_whatever_their_endings(folder, capsys):
    plain = folder / NAMES[0]
    shutil.copy(plain, folder / "Case A.PCAPNG")
    shutil.copy(plain, folder / "twice.pcap")
    shutil.copy(plain, folder / "twice.pcapng")
    (folder / "packed.pcapng.gz").write_bytes(gzip.compress(plain.read_bytes()))
    assert run(capsys, "baseline", folder)[0] == 0
    assert run(capsys, "check", folder)[0] == 0
    (folder / "twice.pcap").unlink()
    status, out, _ = run(capsys, "check", folder)
    assert status == 1
    assert f"{folder / 'twice.pcap.ds47.json'}: its capture is gone" in out
    assert out.count("is gone") == 1


def test_the_stored_result_of_an_export_is_not_forgotten(folder, capsys):
    export = folder / "part.ds47.pcapng"
    (folder / NAMES[0]).rename(export)
    assert run(capsys, "baseline", folder, export)[0] == 0
    status, out, _ = run(capsys, "check", folder)
    assert status == 1
    assert "part.ds47.ds47.json: its capture is an export, which folders leave out" in out
    assert run(capsys, "check", export)[0] == 0


def test_baseline_writes_over_nothing(stored, capsys):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    before = (stored / "seed-g120-read.ds47.json").read_bytes()
    status, out, _ = run(capsys, "baseline", stored)
    assert status == 0
    assert "already exists" in out
    assert (stored / "seed-g120-read.ds47.json").read_bytes() == before
    run(capsys, "baseline", "--force", stored)
    assert (stored / "seed-g120-read.ds47.json").read_bytes() != before


@pytest.mark.parametrize("command", ["baseline", "accept"])
def test_a_folder_without_captures_is_3(tmp_path, capsys, command):
    status, _, err = run(capsys, command, tmp_path)
    assert status == 3
    endings = ".pcap, .pcapng, .cap, also with .gz or .zst; not .ds47.pcapng"
    assert err == f"ds47: error: {tmp_path}: no capture in this folder. Try: one with {endings}\n"


@pytest.mark.skipif(os.name == "nt", reason="other lengths there")
def test_a_name_that_is_too_long_costs_only_its_capture(folder, capsys):
    long = f"{'a' * 242}.pcapng"
    shutil.copy(folder / NAMES[0], folder / long)
    status, out, err = run(capsys, "baseline", folder)
    assert status == 3
    assert out.count(": stored ") == 2
    assert err == f"ds47: error: {folder / long}: no result could be stored: File name too long\n"
    status, out, _ = run(capsys, "check", folder)
    assert (status, out.splitlines()[-1].split(";")[0]) == (1, "3 captures: 2 as stored, 1 not")


@pytest.mark.skipif(sys.platform != "linux", reason="such a name is refused there")
def test_a_name_that_is_not_utf_8_has_its_result(tmp_path, captures, capsys):
    path = os.fsdecode(os.fsencode(tmp_path) + b"/x\xff.pcapng")
    shutil.copy(captures / NAMES[0], path)
    status, out, _ = run(capsys, "baseline", tmp_path)
    assert status == 0
    assert "x\\udcff.ds47.json: stored" in out
    assert run(capsys, "check", tmp_path)[:2] == (0, "1 capture: 1 as stored, 0 not\n")


def test_the_name_of_a_result_does_not_depend_on_the_file_system(tmp_path, monkeypatch):
    """Windows and macOS find a file in whatever case; here their `stat` is played."""
    capture, packed = tmp_path / "LINE.PCAP", tmp_path / "TWO.pcap.gz"
    for path in (capture, packed, tmp_path / "two.PCAPNG"):
        path.write_bytes(b"")
    assert path_of(capture).name == "LINE.ds47.json"
    real = os.stat

    def stat(path, *rest, **more):
        path = Path(path)
        names = {each.casefold(): each for each in os.listdir(path.parent)}  # noqa: PTH208
        return real(path.with_name(names.get(path.name.casefold(), path.name)), *rest, **more)

    with monkeypatch.context() as patch:
        patch.setattr(os, "stat", stat)
        assert path_of(capture).name == "LINE.ds47.json"
        assert path_of(packed).name == "TWO.pcap.gz.ds47.json"


def test_two_that_differ_only_in_case_have_two_results(tmp_path):
    for name in ("LINE.PCAP", "LINE.pcap"):
        (tmp_path / name).write_bytes(b"")
    if len(list(tmp_path.iterdir())) == 1:
        pytest.skip("one file here")
    assert path_of(tmp_path / "LINE.PCAP").name == "LINE.PCAP.ds47.json"


def test_a_change_is_said_like_people_say_it(stored, capsys):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    status, out, _ = run(capsys, "check", stored)
    assert status == 1
    assert "transaction 1: p2900[0] was 12.0, is 0.0" in out
    assert "1 as stored, 1 not" in out


def test_accept_by_what_changed(stored, capsys):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    edit(stored, "conversation-error.ds47.json", '"state": "error"', '"state": "ok"')
    status, out, _ = run(capsys, "accept", stored, "--where", "pnu=2900", "--yes")
    assert status == 0
    assert "p2900[0] was 12.0, is 0.0" in out
    assert "state was ok" not in out
    status, out, _ = run(capsys, "check", stored)
    assert status == 1
    assert "state was ok, is error" in out
    assert "p2900" not in out
    assert run(capsys, "accept", stored, "--yes")[0] == 0
    assert run(capsys, "check", stored)[0] == 0
    assert run(capsys, "accept", stored, "--yes")[1] == "nothing to accept\n"


def test_accept_asks_nobody_who_is_not_there(stored, capsys):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    before = (stored / "seed-g120-read.ds47.json").read_bytes()
    status, _, err = run(capsys, "accept", stored)
    assert status == 2
    assert "--yes" in err
    assert (stored / "seed-g120-read.ds47.json").read_bytes() == before


def test_junit_and_sarif(stored, capsys, tmp_path):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    junit, sarif = tmp_path / "j.xml", tmp_path / "s.sarif"
    assert run(capsys, "check", stored, "--junit", junit, "--sarif", sarif)[0] == 1
    suite = ET.parse(junit).getroot()[0]
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "1", "0")
    failure = suite.find("testcase/failure")
    assert failure is not None
    assert "p2900[0] was 12.0, is 0.0" in failure.get("message", "")
    log = json.loads(sarif.read_text(encoding="utf-8"))
    (result,) = log["runs"][0]["results"]
    assert result["ruleId"] == "value"
    assert (
        "seed-g120-read.pcapng"
        in result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
    )


def test_json_and_summary(stored, capsys):
    (stored.parent / "ds47.toml").write_text('[labels]\n"fw 5.2/*" = "V5.2"\n')
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    status, out, _ = run(capsys, "check", stored, "-f", "json", "--summary")
    assert status == 1
    document = json.loads(out)
    assert document["summary"]["labels"]["V5.2"]["changes"] == {"value": 1}
    assert document["summary"]["coverage"]["pnu"]["2900"] == 1
    status, out, _ = run(capsys, "check", stored, "--summary")
    assert re.search(r"V5\.2 +2 captures, 1 failed, 1 changed, 1 value", out)


def test_known_findings_and_the_severity_that_fails(stored, capsys):
    edit(stored, "conversation-error.ds47.json", '"rule": "DS410"', '"rule": "DS411"')
    assert run(capsys, "check", stored)[0] == 1
    assert run(capsys, "check", stored, "--fail-on", "never")[0] == 0
    (stored / "ds47.toml").write_text('[[ignore]]\nrule = "DS41"\nreason = "a test"\n')
    from ds47.regression import config

    config._for_folder.cache_clear()
    status, out, _ = run(capsys, "check", stored)
    assert (status, out) == (0, "2 captures: 2 as stored, 0 not\n")


def test_a_wrong_configuration_is_wrong_use(stored, capsys):
    (stored / "ds47.toml").write_text("[wrong]\n")
    status, _, err = run(capsys, "check", stored)
    assert status == 2
    assert "unknown key 'wrong'" in err


def test_a_capture_that_cannot_be_read(stored, capsys):
    (stored / "broken.pcapng").write_bytes(b"no capture")
    status, out, _ = run(capsys, "check", stored)
    assert status == 3
    assert "broken.pcapng" in out


BROKEN = ({}, {"transactions": 3}, {"transactions": [{}]}, {"devices": None}, {"findings": [{}]})


@pytest.mark.parametrize("broken", BROKEN, ids=str)
def test_a_stored_result_that_is_not_whole_costs_only_its_capture(stored, capsys, broken):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    path = stored / "conversation-error.ds47.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    document["capture"] = document["capture"] | broken if broken else {}
    path.write_text(json.dumps(document), encoding="utf-8")
    line = f"{path}: the stored result is not whole (see "
    status, out, _ = run(capsys, "check", stored)
    assert status == 1
    assert line in out
    assert "p2900[0] was 12.0, is 0.0" in out
    status, out, err = run(capsys, "accept", stored, "--yes")
    assert (status, out.splitlines()[-1]) == (1, "accepted 1 change in 1 capture")
    assert line in err
    status, _, err = run(capsys, "diff", path, path)
    assert (status, err.count("\n")) == (2, 1)
    assert line in err


@pytest.mark.parametrize("captures_of_it", [3, [None], [{"devices": None}]], ids=str)
def test_diff_of_a_report_that_is_not_whole(tmp_path, capsys, captures_of_it):
    path = tmp_path / "r.json"
    path.write_text(json.dumps({"schema": "ds47.report/1", "captures": captures_of_it}))
    status, _, err = run(capsys, "diff", path, path)
    assert (status, err.count("\n")) == (2, 1)
    assert f"{path}: the report is not whole (see " in err


def test_diff(captures, capsys, tmp_path):
    a, b = captures / "conversation-error.pcapng", captures / "seed-g120-read.pcapng"
    status, out, _ = run(capsys, "diff", a, b)
    assert status == 0
    assert "No parameter element is in both captures" in out
    assert "p2900[0]" not in out
    assert "p2900[0]" in run(capsys, "diff", a, b, "--all")[1]
    assert run(capsys, "diff", a, b, "--exit-code")[0] == 1
    assert run(capsys, "diff", a, a, "--exit-code")[0] == 0
    status, _, err = run(capsys, "diff", a, tmp_path / "none.json")
    assert status == 2
    assert "none.json" in err
    page = tmp_path / "d.html"
    assert run(capsys, "diff", a, b, "-f", "html", "-o", page)[0] == 0
    assert "there is nothing to compare" in page.read_text(encoding="utf-8")
    status, out, _ = run(capsys, "diff", a, b, "-f", "json")
    assert status == 0
    assert json.loads(out)["schema"] == "ds47.diff/2"


def test_a_capture_that_is_cut_is_named_and_compared(stored, capsys):
    """The exit status alone would not say which of many it was."""
    path = stored / "seed-g120-read.pcapng"
    path.write_bytes(path.read_bytes()[:-3])
    for command in ("check", "accept"):
        status, out, err = run(capsys, command, path, *(["--yes"] if command == "accept" else []))
        assert status == 3
        assert err.startswith(f"ds47: error: {path}: ")
        assert "transaction" in out


# A series of files


@pytest.fixture
def plant(tmp_path, captures):
    """The folder of a ring buffer, as `recording` cuts it."""
    return recording(tmp_path / "fw 5.3", captures)


@pytest.fixture
def kept(plant, capsys):
    assert run(capsys, "baseline", "--series", plant)[0] == 0
    return plant


def recorded_again(folder, night=AGAIN):
    """Another recording of the same test: other times in the names, other frames, other cuts."""
    files = sorted(folder.glob("*.pcapng"))
    frames = [frame for file in files for frame in whole_frames(file)]
    for file in files:
        file.unlink()
    for frame in frames:
        frame.time_ns += 86_400 * 10**9
    for file in pieces(folder, frames, [9, 30]):
        file.rename(file.with_name(file.name.replace(NIGHT, night)))


def test_a_series_has_one_result_and_it_is_that_of_the_whole(kept, captures, tmp_path, capsys):
    assert [path.name for path in kept.glob("*.json")] == ["ring.ds47.json"]
    status, out, err = run(capsys, "check", "--series", kept)
    assert (status, out, err) == (0, "1 capture: 1 as stored, 0 not\n", "")
    series = json.loads((kept / "ring.ds47.json").read_text("utf-8"))["capture"]
    assert [file["path"] for file in series["files"]] == [ring(n, NIGHT) for n in (1, 2, 3, 4)]
    assert all(len(file["sha256"]) == 64 for file in series.pop("files"))
    shutil.copy(captures / "tour-machine.pcapng", tmp_path)
    run(capsys, "baseline", tmp_path / "tour-machine.pcapng")
    whole = json.loads((tmp_path / "tour-machine.ds47.json").read_text("utf-8"))["capture"]
    assert series | {"sha256": whole["sha256"]} == whole


def test_a_result_of_a_series_does_not_depend_on_where_it_was_asked_for(kept, capsys, monkeypatch):
    before = (kept / "ring.ds47.json").read_bytes()
    monkeypatch.chdir(kept)
    assert run(capsys, "check", "--series", ".")[0] == 0
    assert run(capsys, "baseline", "--series", "--force", ".")[0] == 0
    assert (kept / "ring.ds47.json").read_bytes() == before


@pytest.mark.parametrize("number", [1, 3])
def test_a_file_named_alone_is_its_series(kept, capsys, number):
    """What check prints can be named to accept, and does not mean less there."""
    edit(kept, "ring.ds47.json", "[60.0]", "[12.0]")
    status, out, _ = run(capsys, "check", "--series", kept / ring(number, NIGHT))
    assert status == 1
    assert out.splitlines()[0] == f"CHANGED  {kept / ring(1, NIGHT)}"
    assert "transaction 3: p50304[0] was 12.0, is 60.0" in out
    line = out.splitlines()[-1].partition("to accept the changes: ds47 ")[2]
    assert run(capsys, *shlex.split(line), "--yes")[0] == 0
    assert run(capsys, "check", "--series", kept)[0] == 0


def test_several_files_of_a_series_are_these(kept, capsys):
    status, out, _ = run(capsys, "check", "--series", kept / ring(1, NIGHT), kept / ring(2, NIGHT))
    assert status == 1
    assert "transaction 8 is gone" in out


def test_where_a_series_is_meant_by_its_first_file(kept, capsys):
    edit(kept, "ring.ds47.json", "[60.0]", "[12.0]")
    accept = ("accept", "--series", kept, "--yes", "--where")
    assert run(capsys, *accept, f"capture={ring(2, NIGHT)}")[1] == "nothing to accept\n"
    status, out, _ = run(capsys, *accept, "capture=ring_*")
    assert status == 0
    assert "accepted 1 change in 1 capture" in out


def test_another_recording_is_compared_with_the_same_result(kept, capsys):
    recorded_again(kept)
    assert run(capsys, "check", "--series", kept)[:2] == (0, "1 capture: 1 as stored, 0 not\n")
    edit(kept, "ring.ds47.json", "[60.0]", "[12.0]")
    status, out, _ = run(capsys, "check", "--series", kept)
    assert status == 1
    assert out.splitlines()[1].strip() == "transaction 3: p50304[0] was 12.0, is 60.0"


def test_the_same_files_have_to_repeat_everything(kept, capsys):
    edit(kept, "ring.ds47.json", '"duration_ms": 7.0', '"duration_ms": 7.5')
    status, out, _ = run(capsys, "check", "--series", kept)
    assert status == 1
    assert "duration_ms was 7.5, is 7.0" in out
    edit(kept, "ring.ds47.json", '"sha256": "', '"sha256": "0')
    assert run(capsys, "check", "--series", kept)[0] == 0


def test_two_series_of_one_name_have_results_of_their_own(plant, capsys):
    for path in sorted(plant.iterdir()):
        shutil.copy(path, plant / path.name.replace(NIGHT, AGAIN))
    assert run(capsys, "baseline", "--series", plant)[0] == 0
    names = sorted(path.name for path in plant.glob("*.json"))
    assert names == [f"ring_00001_{NIGHT}.ds47.json", f"ring_00001_{AGAIN}.ds47.json"]
    assert run(capsys, "check", "--series", plant)[1] == "2 captures: 2 as stored, 0 not\n"


def test_a_capture_of_the_same_name_keeps_its_result(plant, captures, capsys):
    shutil.copy(captures / "seed-g120-read.pcapng", plant / "ring.pcapng")
    assert run(capsys, "baseline", "--series", plant)[0] == 0
    names = sorted(path.name for path in plant.glob("*.json"))
    assert names == ["ring.ds47.json", f"ring_00001_{NIGHT}.ds47.json"]
    assert run(capsys, "check", "--series", plant)[1] == "2 captures: 2 as stored, 0 not\n"


def test_the_files_of_tcpdump(plant, capsys):
    for number, path in enumerate(sorted(plant.iterdir())):
        path.rename(plant / f"t.pcapng{number or ''}")
    assert run(capsys, "baseline", "--series", plant)[0] == 0
    assert [path.name for path in plant.glob("*.json")] == ["t.ds47.json"]
    assert run(capsys, "check", "--series", plant / "t.pcapng2")[0] == 0
    status, out, _ = run(capsys, "check", plant / "t.pcapng")
    assert status == 1
    assert "t.ds47.json: this is the result of 4 files as one capture; use --series" in out


def test_files_that_only_tcpdump_names_are_not_overlooked(plant, capsys):
    for number, path in enumerate(sorted(plant.iterdir()), 1):
        path.rename(plant / f"t.pcapng{number}")
    assert run(capsys, "baseline", "--series", plant)[0] == 0
    assert run(capsys, "check", "--series", plant)[0] == 0
    status, out, err = run(capsys, "check", plant)
    assert status == 3
    assert "t.ds47.json: its captures are the files of a series; use --series" in out
    assert "no capture in this folder" in err


def test_without_the_option_nobody_is_sent_the_wrong_way(kept, capsys):
    status, out, _ = run(capsys, "check", kept)
    assert status == 1
    assert out.count("this is the result of 4 files as one capture; use --series") == 4
    status, _, err = run(capsys, "accept", kept, "--yes")
    assert status == 1
    assert err.count("use --series") == 4


def test_a_missing_result_of_a_series_says_how_to_make_it(plant, capsys):
    status, out, _ = run(capsys, "check", "--series", plant)
    assert status == 1
    advice = out.splitlines()[0].split("make one with: ds47 ")[1]
    words = shlex.split(advice)  # the folder has a blank in its name
    assert words == ["baseline", "--series", str(plant / ring(1, NIGHT))]
    assert run(capsys, *words)[0] == 0
    assert run(capsys, "check", "--series", plant)[0] == 0


def test_a_series_with_a_file_that_cannot_be_read(kept, capsys):
    (kept / ring(2, NIGHT)).write_bytes(b"no capture")
    for command in ("check", "baseline"):
        status, out, err = run(
            capsys, command, "--series", kept, *["--force"][: command != "check"]
        )
        assert status == 3
        assert err.count("\n") == 1
        assert err.startswith(
            f"ds47: error: {kept / ring(1, NIGHT)}: {kept / ring(2, NIGHT)}: not a capture"
        )
        assert ("transaction 4 is gone" if command == "check" else "stored") in out
    text = (kept / "ring.ds47.json").read_text("utf-8")
    assert str(kept) not in text
    assert f'"problem": "{ring(2, NIGHT)}: not a capture' in text


def test_nothing_is_stored_where_no_file_of_a_series_can_be_read(plant, capsys):
    for path in plant.iterdir():
        path.write_bytes(b"no capture")
    status, out, err = run(capsys, "baseline", "--series", plant)
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert err.endswith("(and 3 more files)\n")
    assert not list(plant.glob("*.json"))
    status, out, _ = run(capsys, "check", "--series", plant)
    assert status == 3
    assert out.startswith(f"FAILED   {plant / ring(1, NIGHT)}: not a capture")


def test_a_missing_file_is_said(kept, capsys):
    (kept / ring(3, NIGHT)).unlink()
    status, out, err = run(capsys, "check", "--series", kept)
    assert status == 1
    assert err == f"ds47: {kept / ring(1, NIGHT)}: 1 file of this series missing\n"
    assert "is gone" in out


def test_a_finding_of_no_transaction_says_in_which_file_it_is(kept, capsys):
    edit(kept, "ring.ds47.json", '"rule": "DS721"', '"rule": "DS720"')
    _, out, _ = run(capsys, "check", "--series", kept, "--all")
    assert f"(frame 6 (6 of {ring(1, NIGHT)}))" in out


def test_diff_takes_a_series_for_a_side(kept, captures, capsys):
    whole = captures / "tour-machine.pcapng"
    for side in (kept, kept / ring(2, NIGHT), kept / "ring.ds47.json"):
        status, out, _ = run(capsys, "diff", "--series", side, whole, "--exit-code")
        assert status == 0
        assert "None of the 8 parameter elements that both captures show differs." in out
    status, _, err = run(capsys, "diff", "--series", captures, kept)
    assert status == 2
    assert "captures and series; diff needs one: name its first file" in err
    (kept / "empty").mkdir()
    status, _, err = run(capsys, "diff", "--series", kept / "empty", kept)
    assert status == 3
    assert "no capture in this folder" in err
