"""Captures made from what people told in public, against what `cases.toml` says is right."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_real_stacks import result_of

from ds47.report.plc import Witness
from ds47.report.sentences import advice, sentence
from ds47.spec import rules


@pytest.fixture
def field(captures: Path) -> Path:
    return captures / "field"


def test_a_read_that_was_too_short_leaves_the_response_in_the_drive(field: Path) -> None:
    result = result_of(field / "mlen-then-right.pcap")
    (item,) = result.transactions
    assert (item.frames.write_request, item.frames.read_response, item.state) == (1, 6, "ok")
    assert [tuple(each) for each in item.frames.polls] == [(3, 4)]
    assert [each.values for each in item.parameters] == [[1355] * 8]
    assert {(each.rule, each.frame) for each in result.findings} == {("DS201", 4), ("DS712", 4)}
    told = Witness(result).text(item).text("en")
    assert told == (
        "WRREC DONE, STATUS 00000000; RDREC ERROR, STATUS DE80B100; RDREC VALID, STATUS 00000000, LEN 22"
    )


def test_data_exchange_that_came_too_late_is_refused(field: Path) -> None:
    result = result_of(field / "data-exchange-refused.txt")
    (told,) = [each for each in result.findings if each.rule == "DS816"]
    assert told.args == {
        "device": "dp8", "count": 3, "answer": "RS", "case": "exchange_late", "gap": 182.0,
        "watchdog": 50, "last": 17, "frame": 5, "frames": [20, 22, 40],
    }  # fmt: skip
    (station,) = [each for each in result.bus.stations if each.address == 8] if result.bus else []
    assert station.cycle is not None
    assert station.cycle.most_ns == 182_000_000


def test_the_debug_log_of_a_master_has_its_frames_and_loses_none(field: Path) -> None:
    result = result_of(field / "serial-master.log")
    assert (result.frames, result.problem, result.transactions) == (14, None, [])
    (station,) = [each for each in result.bus.stations if each.address == 5] if result.bus else []
    assert (station.role, station.ident, station.requests, station.unanswered) == (
        "slave",
        0x806A,
        7,
        0,
    )


def test_what_was_read_is_not_to_be_changed(field: Path) -> None:
    result = result_of(field / "read-0x11.pcap")
    assert {each.rule for each in result.findings} == {"DS410", "DS701"}
    for each in result.findings:
        assert advice(rules()[each.rule], each.args).startswith("0x11: the drive does not execute")


def test_a_number_of_a_maker_with_a_table_has_its_words(field: Path) -> None:
    """Nor is 0x03 of PNU 10001, whose subindex is the ID of a parameter, a mistake of an array (DS717)."""
    result = result_of(field / "vacon-10001.pcap")
    assert {each.rule for each in result.findings} == {"DS410", "DS701"}
    told = [sentence(each) for each in result.findings if each.rule == "DS701"]
    assert [
        "0x03 Invalid subindex; of PNU 10001: the drive has no parameter with this ID" in told[0],
        "0x6B Request too short" in told[1],
        "0x67 Invalid axis number (DO-ID)" in told[2],
    ] == [True] * 3


def test_a_number_of_a_maker_without_a_table_is_looked_up_in_its_manual(
    field: Path, tmp_path: Path
) -> None:
    """The same drive as one of Yaskawa: then 0x03 is a mistake of an array again."""
    path, whole = tmp_path / "other.pcap", (field / "vacon-10001.pcap").read_bytes()
    path.write_bytes(whole.replace(b"\x00\x01\x01\xba", b"\x00\x01\x02\x13"))
    result = result_of(path)
    assert "DS717" in {each.rule for each in result.findings}
    (told,) = [
        each for each in result.findings if each.rule == "DS701" and each.args["code"] == 0x67
    ]
    assert "0x67: see the manual of Yaskawa, vendor 0x0213" in sentence(told)
    for rule in ("DS410", "DS701"):
        said = advice(rules()[rule], told.args)
        assert said.startswith("0x67: look it up in the manual of Yaskawa (vendor 0x0213). "), rule


def test_a_position_at_index_47_is_no_parameter_channel(field: Path) -> None:
    result = result_of(field / "record47-position.pcap")
    assert result.transactions == []
    assert [(each.rule, each.args["count"]) for each in result.findings] == [("DS209", 82)]


def test_an_acknowledgement_without_control_by_plc_is_none(field: Path) -> None:
    result = result_of(field / "acknowledge-without-control.txt")
    told = [(each.rule, each.frame, each.args.get("word")) for each in result.findings]
    assert told == [("DS520", 72, None), *(("DS532", at, 0x00FE) for at in (151, 231, 311))]


def test_a_drive_that_takes_one_parameter_a_request(field: Path) -> None:
    result = result_of(field / "single-access.pcap")
    assert {each.rule for each in result.findings} == {"DS410", "DS701"}
    (told,) = [each for each in result.findings if each.rule == "DS701"]
    assert told.args["asked"] == 2
    assert advice(rules()["DS701"], told.args).startswith(
        "0x23, several parameters: the drive takes one per request"
    )


def test_counts_that_agree_are_not_the_cause_of_0x18(field: Path) -> None:
    (told,) = [each for each in result_of(field / "len-0x18.pcap").findings if each.rule == "DS717"]
    assert "(number of elements 1, which agrees with the number of values; " in sentence(told)
    assert "the record has 36 bytes, the message only 16)" in sentence(told)
    assert advice(rules()["DS717"], told.args).startswith(
        "Set LEN of WRREC to the length of the message"
    )


def test_the_change_that_was_accepted_says_what_was_wrong(field: Path) -> None:
    """The same without 20 bytes behind its end (DS419)."""
    (told,) = [each for each in result_of(field / "len-0x18.pcap").findings if each.rule == "DS419"]
    assert (told.frame, told.args["first"]) == (5, 1)
    assert (told.args["refused"], told.args["accepted"]) == (36, 16)
