"""The lab: its captures never change, and the analysis says of each what the scenario expects."""

from __future__ import annotations

import hashlib
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("scapy")

from ds47 import lab
from ds47.analysis import AnalysisOptions, analyze
from ds47.lab.__main__ import write_all
from ds47.lab.profibus_stories import LOGS
from ds47.spec import rules

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
NAMES = tuple(lab.scenarios())
BOOK_OF = {
    scenario.name: f"python/ds47/lab/{name}.py"
    for name in lab.BOOKS
    for scenario in import_module(f"ds47.lab.{name}").BOOK.scenarios
}


@pytest.mark.parametrize("name", NAMES)
def test_analysis_says_what_the_scenario_expects(name: str, tmp_path: Path) -> None:
    scenario = lab.scenarios()[name]
    path = tmp_path / f"{name}.pcapng"
    stage = lab.write(name, path)
    result = analyze(path, AnalysisOptions())
    assert result.frames == len(stage.shots)
    assert result.complete
    got = tuple((transaction.operation, transaction.state) for transaction in result.transactions)
    assert got == scenario.expect.transactions
    ids = {finding.rule for finding in result.findings}
    expected = scenario.expect.rules | scenario.expect.diagnoses
    where = f"expectation of this scene in {BOOK_OF[name]}"
    assert not ids - expected, f"add {' '.join(sorted(ids - expected))} to the {where}"
    assert not expected - ids, f"not found is {' '.join(sorted(expected - ids))} of the {where}"
    diagnoses = {rule for rule in ids if rule.startswith("DS7")}
    assert {each.rule for each in result.diagnoses} == diagnoses


@pytest.mark.slow
def test_stored_captures_are_what_the_lab_writes(tmp_path: Path) -> None:
    write_all(tmp_path)
    written = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for name, content in written.items():
        assert (CAPTURES / name).read_bytes() == content, f"{name}: make captures writes it again"


def test_manifest_names_every_lab_capture_with_its_digest() -> None:
    entries = tomllib.loads((CAPTURES / "MANIFEST.toml").read_text(encoding="utf-8"))["capture"]
    assert [entry["file"] for entry in entries] == [f"{name}.pcapng" for name in NAMES]
    for entry in entries:
        digest = hashlib.sha256((CAPTURES / entry["file"]).read_bytes()).hexdigest()
        assert digest == entry["sha256"], entry["file"]


def test_a_log_is_its_capture_as_text() -> None:
    manifest = tomllib.loads((CAPTURES / "MANIFEST.toml").read_text(encoding="utf-8"))
    assert [each["file"] for each in manifest["log"]] == [f"{name}.txt" for name in LOGS]
    for entry in manifest["log"]:
        path = CAPTURES / entry["file"]
        assert hashlib.sha256(path.read_bytes()).hexdigest() == entry["sha256"]
        log, capture = analyze(path), analyze(path.with_suffix(".pcapng"))
        assert log.frames == capture.frames == entry["frames"]
        assert (log.transactions, log.findings) == (capture.transactions, capture.findings)
        assert (log.bus, log.relations) == (capture.bus, capture.relations)


def test_every_rule_of_the_catalogue_has_a_scenario() -> None:
    expected = [scenario.expect for scenario in lab.scenarios().values()]
    shown = {rule for each in expected for rule in each.rules | each.diagnoses}
    # two engines that differ: test_engine.py; a list of the user: test_expected.py;
    # thousands of calls at once: test_limits.py;
    # cyclic frames, of which few captures are stored: test_parameter_channels.py, test_cyclic_scenes.py;
    # those of S7 are in test_s7_scenes.py
    no_capture_can_show = {"DS601", "DS602", "DS109"}
    no_capture_can_show |= {rule for rule in rules() if rule.startswith(("DS5", "DS9"))} - shown
    missing = set(rules()) - shown - no_capture_can_show
    assert not missing, f"python/ds47/lab/ needs a scene, then make captures: {sorted(missing)}"
    assert not no_capture_can_show & shown


def test_every_state_has_a_scenario() -> None:
    from ds47.model import STATES

    expected = [pair for each in lab.scenarios().values() for pair in each.expect.transactions]
    assert {state for _, state in expected} == set(STATES)


def test_unknown_scenario_is_wrong_use(tmp_path: Path) -> None:
    with pytest.raises(KeyError):
        lab.write("no-such-scenario", tmp_path / "x.pcapng")
