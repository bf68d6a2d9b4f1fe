"""`ds47 baseline`, `check`, `accept` and `diff` as commands: files, streams, exit statuses."""

from __future__ import annotations

import json
import re
import shutil
from xml.etree import ElementTree as ET

import pytest

from ds47.cli import main

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


def test_baseline_writes_over_nothing(stored, capsys):
    edit(stored, "seed-g120-read.ds47.json", "[0.0]", "[12.0]")
    before = (stored / "seed-g120-read.ds47.json").read_bytes()
    status, out, _ = run(capsys, "baseline", stored)
    assert status == 0
    assert "is there already" in out
    assert (stored / "seed-g120-read.ds47.json").read_bytes() == before
    run(capsys, "baseline", "--force", stored)
    assert (stored / "seed-g120-read.ds47.json").read_bytes() != before


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
    assert run(capsys, "accept", stored, "--yes")[1] == "nothing to take over\n"


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


def test_diff(captures, capsys, tmp_path):
    a, b = captures / "conversation-error.pcapng", captures / "seed-g120-read.pcapng"
    status, out, _ = run(capsys, "diff", a, b)
    assert status == 0
    assert "parameters that differ:" in out
    assert run(capsys, "diff", a, b, "--exit-code")[0] == 1
    assert run(capsys, "diff", a, a, "--exit-code")[0] == 0
    status, _, err = run(capsys, "diff", a, tmp_path / "none.json")
    assert status == 2
    assert "none.json" in err
    page = tmp_path / "d.html"
    assert run(capsys, "diff", a, b, "-f", "html", "-o", page)[0] == 0
    assert "What changed" in page.read_text(encoding="utf-8")
