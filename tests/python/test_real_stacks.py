"""The captures of two real stacks against the log that the controllers wrote while they ran."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections import defaultdict
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from ds47.analysis import analyze
from ds47.model import CaptureResult, Transaction

CAPTURES = ("o1_profinetpy062_be", "o2_pyprofinet_le", "o3_two_controllers")
CONTAINER = 0x80B0
"""CombinedObjectContainer: tshark shows the indices inside the record as well; it is the last one there."""
LATE = {("o1_profinetpy062_be", 55), ("o2_pyprofinet_le", 54)}
"""Logged without a response; a later read of the log fetches it."""


@cache
def result_of(path: Path) -> CaptureResult:
    return analyze(path)


def expected_lines(folder: Path, capture: str) -> dict[str, list[dict[str, Any]]]:
    """The log of one capture, without `other`, by client and in the order of n."""
    lines: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for text in (folder / "EXPECTED.jsonl").read_text().splitlines():
        line = json.loads(text)
        if line["capture"] == capture and line["kind"] != "other":
            lines[line["client"]].append(line)
    return {client: sorted(group, key=lambda line: line["n"]) for client, group in lines.items()}


def pairs(folder: Path, capture: str) -> list[tuple[dict[str, Any], Transaction]]:
    by_controller: dict[str, list[Transaction]] = defaultdict(list)
    for transaction in result_of(folder / f"{capture}.pcapng").transactions:
        if transaction.request is not None:
            by_controller[transaction.controller].append(transaction)
    matched = []
    for lines in expected_lines(folder, capture).values():
        requests = [line["request_hex"] for line in lines]
        group = next(
            transactions
            for transactions in by_controller.values()
            if [t.request.hex() for t in transactions if t.request] == requests
        )
        matched += list(zip(lines, group, strict=True))
    return matched


@pytest.fixture(params=CAPTURES)
def matched(
    request: pytest.FixtureRequest, captures: Path
) -> list[tuple[dict[str, Any], Transaction]]:
    return pairs(captures / "real-stacks", request.param)


def test_the_evidence_is_as_it_was_recorded(captures: Path) -> None:
    folder = captures / "real-stacks"
    entries = tomllib.loads((folder / "MANIFEST.toml").read_text("utf-8"))["capture"]
    assert [entry["file"] for entry in entries] == [f"{name}.pcapng" for name in CAPTURES]
    for entry in entries:
        found = hashlib.sha256((folder / entry["file"]).read_bytes()).hexdigest()
        assert found == entry["sha256"], f"{entry['file']} is not as it was recorded"
        assert result_of(folder / entry["file"]).frames == entry["frames"]


def test_every_logged_transaction_is_there(captures: Path) -> None:
    folder = captures / "real-stacks"
    assert sum(len(pairs(folder, capture)) for capture in CAPTURES) == 328


def test_responses_and_statuses_are_the_logged_ones(
    matched: list[tuple[dict[str, Any], Transaction]],
) -> None:
    for line, transaction in matched:
        where = f"{line['capture']} n={line['n']}"
        late = (line["capture"], line["n"]) in LATE
        response = "31020101" if late else line["response_hex"]
        assert (transaction.response.hex() if transaction.response else None) == response, where
        for key in ("write_status", "read_status"):
            logged = "00000000" if late and key == "read_status" else line.get(key)
            if logged is not None:
                assert f"{getattr(transaction, key):08x}" == logged, where
        if "busy_polls" in line and not late:
            assert len(transaction.frames.polls) == line["busy_polls"], where


def test_addresses_values_and_errors_are_the_logged_ones(
    matched: list[tuple[dict[str, Any], Transaction]],
) -> None:
    for line, transaction in matched:
        if transaction.state == "mismatch":
            continue
        where = f"{line['capture']} n={line['n']}"
        for asked, parameter in zip(line.get("asked") or [], transaction.parameters, strict=False):
            assert (parameter.pnu, parameter.subindex) == (asked["pnu"], asked["subindex"]), where
        for block, parameter in zip(
            line.get("expected_blocks") or [], transaction.parameters, strict=False
        ):
            check_block(block, transaction, parameter, where)


def check_block(
    block: dict[str, Any], transaction: Transaction, parameter: Any, where: str
) -> None:
    if "error" in block:
        assert parameter.error is not None, where
        assert (parameter.error.code, parameter.error.info) == (block["error"], block["info"]), (
            where
        )
        return
    assert parameter.error is None, where
    if transaction.operation != "read" or "zero" in block:
        return
    assert parameter.value_count == block["count"], where
    logged = block["value"]
    if isinstance(logged, str):
        in_hex = {0x09: lambda: [bytes.fromhex(logged).decode("latin-1")], 0x0A: lambda: [logged]}
        if block["format"] in in_hex:
            assert parameter.values == in_hex[block["format"]](), where
        return
    assert [as_number(value) for value in parameter.values] == pytest.approx(logged, rel=1e-6), (
        where
    )


def as_number(value: Any) -> Any:
    return int(value) if isinstance(value, str) else value


@pytest.mark.parametrize("name", CAPTURES[:2])
def test_a_read_without_an_ar_is_no_transaction_of_its_own(captures: Path, name: str) -> None:
    """The log: "read without AR (opnum 5), the device returns the latest response"."""
    result = result_of(captures / "real-stacks" / f"{name}.pcapng")
    assert not [each for each in result.transactions if each.state == "orphan"]
    again = [each for each in result.findings if each.args.get("case") == "again_without_ar"]
    assert [each.rule for each in again] == ["DS704"]
    assert not [each for each in result.findings if each.rule == "DS403"]


def test_states(captures: Path) -> None:
    folder = captures / "real-stacks"
    states = {line["n"]: t.state for line, t in pairs(folder, CAPTURES[0])}
    assert [states[n] for n in (56, 58, 61, 62, 63, 67)] == [
        "refused", "superseded", "mismatch", "mismatch", "refused", "error",
    ]  # fmt: skip
    result = result_of(folder / f"{CAPTURES[0]}.pcapng")
    assert not [t for t in result.transactions if t.request is None]
    late = next(t for line, t in pairs(folder, CAPTURES[0]) if line["n"] == 85)
    assert len(late.frames.rereads) == 2  # one of them without an AR


@pytest.mark.parametrize(
    "name",
    [
        "icsnpp_iocm_all.pcapng",
        "icsnpp_iocm_mixed1.pcap",
        "plc4x_working.pcapng",
        "plc4x_implicit.pcapng",
    ],
)
def test_captures_without_the_channel_give_nothing(shared: Path, name: str) -> None:
    result = result_of(shared / "captures" / name)
    assert result.transactions == []
    assert result.complete


@pytest.mark.parametrize(
    "name",
    [
        "icsnpp_iocm_all.pcapng",
        "icsnpp_iocm_mixed1.pcap",
        "plc4x_working.pcapng",
        "plc4x_implicit.pcapng",
    ],
)
def test_counts_of_foreign_captures_agree_with_tshark(shared: Path, tshark: Any, name: str) -> None:
    counts_agree(shared / "captures" / name, tshark)


@pytest.mark.parametrize("name", CAPTURES[1:])
def test_counts_agree_with_tshark(captures: Path, tshark: Any, name: str) -> None:
    counts_agree(captures / "real-stacks" / f"{name}.pcapng", tshark)


def counts_agree(path: Path, tshark: Any) -> None:
    """tshark counts fragments and copies one by one: both are folded before the comparison.

    Frames 431 to 442 of icsnpp_iocm_all are 421 to 430 once more, 59 s later: the file was spliced.
    """
    fields = ["dcerpc.pkt_type", "dcerpc.dg_frag_num", "dcerpc.dg_act_id", "dcerpc.dg_seqnum",
              "ip.src", "ip.id", "udp.checksum", "pn_io.index", "dcerpc.opnum", "dcerpc.dg_if_id",
              "frame.time_epoch"]  # fmt: skip
    only = "dcerpc.pkt_type in {0, 2} && !icmp"
    options = [word for field in fields for word in ("-e", field)]
    output = tshark("-r", str(path), "-Y", only, "-T", "fields", *options)
    seen: dict[tuple[str, ...], Decimal] = {}
    requests = responses = 0
    records: dict[str, dict[str, int]] = {}
    for row in (line.split("\t") for line in output.splitlines()):
        kind, fragment, _, _, _, ip_id, _, indices, opnum, interface, time = row
        before, now = seen.get(tuple(row[:7])), Decimal(time)
        late = int(ip_id, 0) == 0 and before and abs(now - before) > Decimal("0.001")
        if not interface.startswith("dea0000") or (before and not late):
            continue
        seen[tuple(row[:7])] = now
        if fragment in ("", "0"):
            requests += kind == "0"
            responses += kind == "2"
        if kind == "0" and (fragment in ("", "0") or indices) and opnum in ("2", "3", "5"):
            for index in (int(text, 0) for text in indices.split(",") if text):
                counts = records.setdefault(str(index), {"read": 0, "write": 0})
                counts["write" if opnum == "3" else "read"] += 1
                if index == CONTAINER:
                    break
    result = result_of(path)
    assert (result.rpc["requests"], result.rpc["responses"]) == (requests, responses)
    assert result.records == records
