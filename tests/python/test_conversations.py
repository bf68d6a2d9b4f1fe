"""The conversation vectors: well-formed, complete, and what the analyzer makes of each."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from ipaddress import IPv4Address
from pathlib import Path
from typing import Any

import pytest
from frames import block, ethernet, option, udp
from jsonschema import Draft202012Validator
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult, Finding, Transaction
from ds47.spec import rules
from ds47.spec.statuses import status_hex

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "tests/vectors"
SCHEMA = VECTORS / "conversations.schema.json"
SOURCES = {
    "conversations.json": "conversations.py",
    "diagnoses.json": "diagnoses.py",
}
FILES = {name: json.loads((VECTORS / name).read_text(encoding="utf-8")) for name in SOURCES}
CASES = [case for vectors in FILES.values() for case in vectors["cases"]]
SOURCE_OF = {case["id"]: SOURCES[name] for name in FILES for case in FILES[name]["cases"]}
START_NS = 1_767_254_400_000_000_000

NO_CONVERSATION = {
    "P1": "that no clock is read is a property of the program, not of what it says",
    "P50": "about the order of output formats: test_report_formats.py",
    "P51": "about the catalogue: test_rules_catalogue.py; every finding here names its frame",
    "P52": "takes tens of thousands of entries",
}
"""Sentences that no small conversation can show, and why."""


def frame(step: dict[str, Any]) -> bytes:
    ports = (step.get("client_port", 49152), step.get("server_port", 34964))
    ends = (step["client"], step["server"])
    if step["direction"] == "response":
        ports, ends = ports[::-1], ends[::-1]
    cut = step.get("cut", 0)
    payload = udp(bytes.fromhex(step["bytes"]) + bytes(cut), ports)
    head = bytearray(bytes.fromhex("4500 0000 0000 0000 4011 0000"))
    head[2:4] = (20 + len(payload)).to_bytes(2, "big")
    head[4:6] = step["ip_id"].to_bytes(2, "big")
    packed = b"".join(IPv4Address(ip).packed for ip in ends)
    whole = ethernet(0x0800, bytes(head) + packed + payload)
    return whole[: len(whole) - cut]


def capture(case: dict[str, Any]) -> io.BytesIO:
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for step in case["steps"]:
            data = frame(step)
            writer.write(START_NS + step["t"], data, len(data) + step.get("cut", 0))
    if "dropped" in case:
        lost = option(5, case["dropped"].to_bytes(8, "little")) + option(0, b"")
        target.write(block(5, bytes(12) + lost))
    target.seek(0)
    return target


def run(case: dict[str, Any]) -> CaptureResult:
    indices = frozenset(case.get("options", {}).get("indices", ()))
    return analyze(capture(case), AnalysisOptions(indices=indices))


def calls(pairs: list[tuple[int | None, int | None]]) -> list[dict[str, int | None]]:
    return [{"request": request, "response": response} for request, response in pairs]


def status(value: int | None) -> str | None:
    return None if value is None else status_hex(value)


def shown(transaction: Transaction) -> dict[str, Any]:
    """A transaction in the words of a vector."""
    names = (
        "id", "operation", "state", "controller", "device", "ar", "api", "slot", "subslot",
        "index", "request_reference", "axis", "duration_ns",
    )  # fmt: skip
    single = ("write_request", "write_response", "read_request", "read_response")
    frames = transaction.frames
    return {name: getattr(transaction, name) for name in names} | {
        "frames": {name: getattr(frames, name) for name in single}
        | {"polls": calls(frames.polls), "rereads": calls(frames.rereads)},
        "status": {
            "write": status(transaction.write_status),
            "read": status(transaction.read_status),
        },
        "parameters": [
            {
                "pnu": each.pnu,
                "subindex": each.subindex,
                "attribute": each.attribute,
                "format": each.format,
                "values": each.values,
                "error": each.error and {"code": each.error.code, "info": each.error.info},
            }
            for each in transaction.parameters
        ],
    }


def told(finding: Finding) -> dict[str, Any]:
    """A finding in the words of a vector."""
    result: dict[str, Any] = {name: getattr(finding, name) for name in ("rule", "frame")}
    result["transaction"] = finding.transaction
    if finding.args.get("dropped"):
        result["says_dropped"] = True
    return result


def typed(finding: dict[str, Any]) -> str:
    """A finding as the source of a vector has it: `DS410@4#1`, at a frame, of a transaction."""
    number = "" if finding["transaction"] is None else f"#{finding['transaction']}"
    return f"{finding['rule']}@{finding['frame']}{number}"


def in_order(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(findings, key=lambda f: (f["frame"], f["rule"], f["transaction"] or 0))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_conversation(case: dict[str, Any]) -> None:
    result = run(case)
    assert result.frames == len(case["steps"])
    assert result.complete
    assert result.dropped == case.get("dropped")
    assert [shown(each) for each in result.transactions] == case["expect"]["transactions"]
    findings = of_transactions(map(told, result.findings))
    expected = case["expect"]["findings"] + case["expect"].get("diagnoses", [])
    known = [*map(typed, expected)]
    new = [word for word in map(typed, findings) if word not in known]
    where = f"tests/vectors/sources/{SOURCE_OF[case['id']]}"
    assert not new, f"add {' '.join(new)} to the `rules` of this case in {where}"
    assert findings == in_order(expected)


@pytest.mark.parametrize("name", FILES)
def test_file_obeys_its_schema(name: str) -> None:
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    problems = [
        f"{error.json_path}: {error.message}"
        for error in Draft202012Validator(schema).iter_errors(FILES[name])
    ]
    assert problems == []


def test_count_is_the_number_of_cases() -> None:
    for vectors in FILES.values():
        assert vectors["count"] == len(vectors["cases"])
    assert len({case["id"] for case in CASES}) == len(CASES)


def test_each_case_shows_the_sentence_in_its_name() -> None:
    assert [case["id"] for case in CASES if case["id"].split("-")[0] not in case["shows"]] == []


def test_findings_stand_in_the_order_of_frame_and_rule() -> None:
    for case in CASES:
        for key in ("findings", "diagnoses"):
            listed = case["expect"].get(key, [])
            assert listed == in_order(listed), case["id"]


def test_every_sentence_has_a_case_or_a_reason_why_not() -> None:
    text = (ROOT / "docs/pairing.md").read_text(encoding="utf-8")
    sentences = set(re.findall(r"^\* \*\*(P\d+)\*\*", text, re.MULTILINE))
    shows = {sentence for case in CASES for sentence in case["shows"]}
    assert shows - sentences - set(rules()) == set()
    assert sentences - shows == set(NO_CONVERSATION)


def test_every_diagnosis_of_a_transaction_has_a_case() -> None:
    shown = {each["rule"] for case in CASES for each in case["expect"].get("diagnoses", [])}
    wanted = of_transactions({"rule": rule} for rule in rules() if rule.startswith("DS7"))
    assert shown == {each["rule"] for each in wanted}


@pytest.mark.parametrize("name", FILES)
def test_the_tool_writes_this_file(name: str, tmp_path: Path) -> None:
    tool = VECTORS / "sources" / SOURCES[name]
    target = tmp_path / name
    subprocess.run([sys.executable, str(tool), str(target)], check=True, timeout=60)
    assert target.read_bytes() == (VECTORS / name).read_bytes(), f"run {tool.name} again"
