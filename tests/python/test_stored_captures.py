"""The captures that are stored here: each has its entry in a manifest and its result, and gives it."""

from __future__ import annotations

import hashlib
import json
import shutil
import tomllib
from pathlib import Path

import pytest

from ds47.batch.tasks import plan
from ds47.regression import baseline
from ds47.regression.run import check

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
FILES = sorted([*CAPTURES.rglob("*.pcapng"), *CAPTURES.rglob("*.pcap")])


def test_none_is_lost() -> None:
    manifests = sorted(CAPTURES.rglob("MANIFEST.toml"))
    named = [
        manifest.parent / entry["file"]
        for manifest in manifests
        for entry in tomllib.loads(manifest.read_text("utf-8"))["capture"]
    ]
    assert manifests
    assert sorted(named) == sorted(FILES)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_capture_is_what_its_manifest_says(path: Path) -> None:
    entries = tomllib.loads((path.parent / "MANIFEST.toml").read_text("utf-8"))["capture"]
    (entry,) = [entry for entry in entries if entry["file"] == path.name]
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    assert found == entry["sha256"], f"{path.name} is another file than MANIFEST.toml says"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_capture_gives_its_stored_result(path: Path) -> None:
    stored = json.loads(baseline.path_of(path).read_bytes())["capture"]["sha256"]
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert stored == digest, f"{path.name} is new: ds47 baseline --force {path.name}"
    outcome = check(plan([str(path)], series=False)[0], fail_on="note")
    said = "\n".join(change.text for change in outcome.changes)
    assert outcome.error is None, outcome.error
    assert not outcome.changes, f"{path.name}:\n{said}\n(to take it over: ds47 accept {path.name})"


def test_a_changed_byte_is_named(tmp_path: Path) -> None:
    """The last byte of a value: both the manifest and the stored result say which capture it is."""
    path = tmp_path / "seed-g120-read.pcapng"
    shutil.copy(CAPTURES / path.name, path)
    shutil.copy(baseline.path_of(CAPTURES / path.name), baseline.path_of(path))
    data = bytearray(path.read_bytes())
    at = data.rindex(bytes.fromhex("42c80000"))  # 100.0, the last value of the response
    data[at + 1] ^= 1
    path.write_bytes(data)
    outcome = check(plan([str(path)], series=False)[0])
    assert outcome.failed
    assert [change.text for change in outcome.changes] == [
        "transaction 1: r2902[5] was 100.0, is 100.5"
    ]
