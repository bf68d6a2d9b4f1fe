"""Devices of which a capture shows no vendor, and that are said to be SINAMICS."""

from __future__ import annotations

import json
import shutil
import struct
from pathlib import Path

import pytest
from fake_tshark import real_tshark
from test_lua_analysis import VERSIONS, Source, compare
from test_profibus_families import IDENTS, refused
from test_wireshark_plugin import COMPLETE, run

from ds47.analysis import AnalysisOptions, analyze
from ds47.batch.settings import options_for
from ds47.capture import CaptureError, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab import captured
from ds47.model import SIEMENS, CaptureResult
from ds47.report import json as report
from ds47.report import load
from ds47.report.contract import TRANSACTION

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
FILES = (
    "tour-machine",
    "seed-dcm-change",
    "format-mixed",
    "cyclic-does-not-start",
    "transport-big-little",
)
NAME = "Ramp-function generator ramp-down time 1"
ABB = 0x001A
SINAMICS = AnalysisOptions(vendor_id=SIEMENS)


def anonymous(name: str) -> bytes:
    """A stored capture whose object UUIDs are none of PROFINET: they say no vendor."""
    data = (CAPTURES / f"{name}.pcapng").read_bytes()
    big, little = bytes.fromhex("dea000006c9711d1"), bytes.fromhex("0000a0de976cd111")
    return data.replace(big, big[:-1] + b"\xd2").replace(little, little[:-2] + b"\xd2\x11")


def identify(vendor_id: int) -> bytes:
    """The answer of a drive to DCP Identify: its address and whose it is."""
    device = struct.pack(">BBHH", 2, 3, 6, 0) + struct.pack(">HH", vendor_id, 1)
    address = struct.pack(">BBHH", 1, 2, 14, 1) + bytes((192, 168, 133, 33)) + bytes(8)
    blocks = device + address
    head = struct.pack(">HBBIHH", 0xFEFF, 5, 1, 7, 0, len(blocks))
    ends = bytes.fromhex("001b1b000001001ff8000001")
    return ends + b"\x88\x92" + head + blocks


@pytest.fixture
def make(tmp_path: Path):  # type: ignore[no-untyped-def]
    """Writes the tour without a vendor: without its DCP, and with an answer to Identify before a frame."""

    def write(vendor_id: int | None = None, before: int = 1) -> Path:
        whole, path = tmp_path / "whole.pcapng", tmp_path / "tour.pcapng"
        whole.write_bytes(anonymous("tour-machine"))
        with open_capture(whole) as capture, path.open("wb") as stream:
            writer = PcapngWriter(stream)
            for number, frame in enumerate(capture.everything(), 1):
                if vendor_id is not None and number == before:
                    writer.write(frame.time_ns, identify(vendor_id))
                if b"\x88\x92\xfe" not in frame.data[:18]:
                    writer.write(frame.time_ns, frame.data)
        return path

    return write


def names(result: CaptureResult) -> list[str | None]:
    return [each.parameters[0].name for each in result.transactions]


def errors(result: CaptureResult) -> list[str]:
    return [
        each.error.text for item in result.transactions for each in item.parameters if each.error
    ]


def test_nothing_is_assumed_unless_it_is_said(make) -> None:  # type: ignore[no-untyped-def]
    plain, assumed = analyze(make()), analyze(make(), SINAMICS)
    assert NAME not in names(plain)
    assert names(assumed)[1:3] == [NAME, NAME]
    assert errors(plain)[0].startswith("Manufacturer-specific error 0x6B (SINAMICS: ")
    assert errors(assumed)[0] == "No change access while the controller is enabled"
    assert [(each.vendor_id, each.assumed_vendor_id) for each in plain.devices] == [(None, None)]
    assert [(each.vendor_id, each.assumed_vendor_id) for each in assumed.devices] == [
        (None, SIEMENS)
    ]


def test_a_device_that_dcp_has_told_is_what_it_says(make) -> None:  # type: ignore[no-untyped-def]
    result = analyze(make(ABB), SINAMICS)
    assert NAME not in names(result)
    assert "SINAMICS" not in errors(result)[0]
    assert [(each.vendor_id, each.assumed_vendor_id) for each in result.devices] == [(ABB, None)]


def test_what_dcp_tells_counts_from_then_on(make) -> None:  # type: ignore[no-untyped-def]
    found = names(analyze(make(ABB, 14), SINAMICS))
    assert found[1] == NAME
    assert NAME not in found[2:]


def test_it_is_what_the_object_uuid_would_have_said(tmp_path: Path) -> None:
    for name in FILES:
        path = tmp_path / f"{name}.pcapng"
        path.write_bytes(anonymous(name))
        told, assumed = analyze(CAPTURES / path.name), analyze(path, SINAMICS)
        assert [TRANSACTION.plain(each) for each in assumed.transactions] == [
            TRANSACTION.plain(each) for each in told.transactions
        ]
        assert assumed.findings == told.findings


@pytest.mark.parametrize("version", VERSIONS)
def test_the_lua_pipeline_agrees(version: str, tmp_path: Path, make) -> None:  # type: ignore[no-untyped-def]
    sources = []
    for name in FILES:
        path = tmp_path / f"{name}.pcapng"
        path.write_bytes(anonymous(name))
        sources.append(Source(name, path.read_bytes(), True))
    for number, vendor_id in ((1, ABB), (14, ABB), (14, SIEMENS)):
        path = tmp_path / f"dcp-{number}-{vendor_id}.pcapng"
        shutil.copy(make(vendor_id, number), path)
        sources.append(Source(path.name, path.read_bytes(), True))
    compare(version, "en", sources, tmp_path, SINAMICS)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_lua_pipeline_agrees_on_profibus(version: str, tmp_path: Path) -> None:
    sources = [Source(ident, captured(refused(ident).stage), True) for ident in IDENTS]
    compare(version, "en", sources, tmp_path, AnalysisOptions(vendor_id=0x0106))
    compare(version, "zh", sources, tmp_path, SINAMICS)


@pytest.mark.parametrize("passes", [(), COMPLETE])
def test_wireshark_agrees_and_marks_it(passes: tuple[str, ...], make, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    real_tshark()
    fields = ("-T", "fields", "-e", "ds47.name", "-e", "ds47.vendor_assumed", "-Y", "ds47")
    for before, vendor_id in ((1, None), (1, ABB), (14, ABB)):
        path = make(vendor_id, before)
        result = analyze(path, SINAMICS)
        text = run(
            tmp_path, *passes, "-r", path, "-o", "ds47.assume_sinamics:TRUE", *fields
        ).decode()
        shown = {line.split("\t")[0] for line in text.splitlines()} - {""}
        expected = {name for item in result.transactions for name in [
            ",".join(each.name for each in item.parameters if each.name)] if name}  # fmt: skip
        assert shown == expected
        assert ("0x002a" in text) == (NAME in shown)


def test_a_stored_result_keeps_it(make) -> None:  # type: ignore[no-untyped-def]
    result = analyze(make(), SINAMICS)
    document = report.capture(result)
    assert document["devices"][0]["assumed_vendor_id"] == SIEMENS
    assert "assumed_vendor_id" not in report.capture(analyze(make()))["devices"][0]
    loaded = load.capture(json.loads(json.dumps(document)))
    assert report.capture(loaded) == document
    assert loaded.transactions[5].parameters[0].error == result.transactions[5].parameters[0].error


def test_it_can_be_said_at_the_command_and_in_ds47_toml(
    make,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],  # type: ignore[no-untyped-def]
) -> None:
    path = make()
    assert main(["report", str(path), "--vendor", "sinamics"]) == 0
    text = capsys.readouterr().out
    assert NAME in text
    assert "no vendor seen, assumed to be 0x002A (SINAMICS)" in text
    folder = tmp_path / "project"
    folder.mkdir()
    inside = Path(shutil.copy(path, folder))
    (folder / "ds47.toml").write_text('[names]\nvendor = "sinamics"\n', encoding="utf-8")
    assert options_for(str(inside), AnalysisOptions()).vendor_id == SIEMENS
    for said, number in (('"vacon"', 0x01BA), ("0x0106", 0x0106), ('"lense"', None)):
        there = tmp_path / f"of {number}"
        there.mkdir()
        inside = Path(shutil.copy(path, there))
        (there / "ds47.toml").write_text(f"[names]\nvendor = {said}\n", encoding="utf-8")
        if number is None:
            with pytest.raises(CaptureError, match="did you mean Lenze"):
                options_for(str(inside), AnalysisOptions())
        else:
            assert options_for(str(inside), AnalysisOptions()).vendor_id == number
    assert main(["report", str(path), "--vendor", "Vacon"]) == 0
    assert "assumed to be 0x01BA (Vacon)" in capsys.readouterr().out
