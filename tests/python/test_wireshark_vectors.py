"""The vectors through the plugin in tshark: every message and every conversation.

That the analyzer gives what the vectors say is shown elsewhere (test_messages.py,
test_conversations.py); here the plugin has to give what the analyzer gives for the same frames.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from test_conversations import CASES, capture
from test_wireshark_plugin import COMPLETE, program, run, told, with_all_args
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.profidrive import Options
from ds47.report.contract import TRANSACTION
from ds47.wireshark import fields

VECTORS = json.loads(
    (Path(__file__).resolve().parents[1] / "vectors/messages.json").read_text("utf-8")
)
MESSAGES = VECTORS["messages"]
DIALECTS = ("legacy_g120_formats", "profile_v3_types")
CONVERSATIONS_AT_LEAST = 180
"""So that an empty file is noticed."""


def shark(home: Path, path: Path, options: AnalysisOptions) -> fields.Fields:
    wanted = ["-o", f"ds47.indices:{','.join(map(str, sorted(options.indices)))}"]
    wanted = wanted if options.indices else []
    for name in DIALECTS:
        if getattr(options.codec, name):
            wanted += ["-o", f"ds47.{name}:TRUE"]
    pdml = ("-T", "pdml", "-J", "frame ds47", "-r", path)
    return fields.read(io.BytesIO(run(home, *COMPLETE, *wanted, *pdml)))


def native(path: Path, options: AnalysisOptions) -> fields.Fields:
    result = analyze(path, options)
    findings = of_transactions(told(each) for each in result.findings)
    return fields.Fields([TRANSACTION.plain(each) for each in result.transactions], findings)


def compare(name: str, found: fields.Fields, wanted: fields.Fields) -> None:
    for left, right in zip(found.transactions, wanted.transactions, strict=False):
        assert left == right, name
    assert len(found.transactions) == len(wanted.transactions), name
    assert [with_all_args(each) for each in found.findings] == wanted.findings, name


def of_dialect(dialect: tuple[bool, bool]) -> list[dict[str, Any]]:
    return [
        message
        for message in MESSAGES
        if tuple(bool(message.get("options", {}).get(name)) for name in DIALECTS) == dialect
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "dialect", [(False, False), (True, False), (False, True), (True, True)], ids=str
)
def test_every_message(dialect: tuple[bool, bool], tmp_path: Path) -> None:
    """All messages of a dialect in one capture, each on a slot of its own."""
    messages = of_dialect(dialect)
    assert messages
    stage = Stage()
    client = Client(stage)
    for slot, message in enumerate(messages, 1):
        where = client.at(slot=slot, index=0xB02F)
        data = bytes.fromhex(message["hex"])
        if message["kind"] == "request":
            client.write(data, at=where)
        elif message.get("request"):
            client.exchange(bytes.fromhex(message["request"]), data, at=where)
        else:
            client.read(data, at=where)
    path = tmp_path / "messages.pcapng"
    with path.open("wb") as file, PcapngWriter(file) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data)
    options = AnalysisOptions(codec=Options(**dict(zip(DIALECTS, dialect, strict=True))))
    wanted = native(path, options)
    with_data = [message for message in messages if message["hex"] or message["kind"] == "request"]
    assert len(wanted.transactions) == len(with_data)
    compare(str(dialect), shark(tmp_path, path, options), wanted)


def test_every_message_is_of_a_dialect() -> None:
    dialects = [(False, False), (True, False), (False, True), (True, True)]
    assert sum(len(of_dialect(each)) for each in dialects) == VECTORS["count"]["messages"]


def fits(case: dict[str, Any]) -> bool:
    """Whether others may go on beside it: it has no options, and no other clock."""
    times = [step["t"] for step in case["steps"]]
    return not case.keys() & {"options", "dropped"} and times == sorted(times)


def together(cases: list[dict[str, Any]]) -> tuple[bytes, list[str]]:
    """A capture in which they all go on at once, each between ends of its own; and whose each frame is."""
    steps: list[tuple[str, dict[str, Any]]] = []
    for number, case in enumerate(cases):
        names = dict.fromkeys(step[end] for step in case["steps"] for end in ("client", "server"))
        ends = {
            name: f"10.{47 + number // 256}.{number % 256}.{last}"
            for last, name in enumerate(names, 1)
        }
        for step in case["steps"]:
            own = {end: ends[step[end]] for end in ("client", "server")}
            steps.append((case["id"], step | own))
    steps.sort(key=lambda each: each[1]["t"])
    content = capture({"steps": [step for _, step in steps]}).getvalue()
    return content, [name for name, _ in steps]


def shows(case: dict[str, Any]) -> Counter[tuple[str, str]]:
    """The states and rules of a conversation, and how often."""
    told, findings = case["expect"], case["expect"].get("diagnoses", [])
    found = Counter(("state", each["state"]) for each in told["transactions"])
    return found + Counter(("rule", each["rule"]) for each in (*told["findings"], *findings))


@pytest.mark.slow
def test_every_conversation(tmp_path: Path) -> None:
    """Nearly all of them in one capture: a start of tshark costs more than a conversation."""
    program()
    assert len(CASES) >= CONVERSATIONS_AT_LEAST
    beside = [case for case in CASES if fits(case)]
    content, owners = together(beside)
    path = tmp_path / "together.pcapng"
    path.write_bytes(content)
    wanted = native(path, AnalysisOptions())
    found = {case["id"]: Counter[tuple[str, str]]() for case in beside}
    for each in wanted.transactions:
        first = min(frame for frame in each["frames"].values() if isinstance(frame, int))
        found[owners[first - 1]]["state", each["state"]] += 1
    for each in wanted.findings:
        found[owners[each["frame"] - 1]]["rule", each["rule"]] += 1
    assert found == {case["id"]: shows(case) for case in beside}
    compare("together", shark(tmp_path, path, AnalysisOptions()), wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [case for case in CASES if not fits(case)], ids=lambda case: case["id"]
)
def test_a_conversation_alone(case: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "alone.pcapng"
    path.write_bytes(capture(case).getvalue())
    options = AnalysisOptions(indices=frozenset(case.get("options", {}).get("indices", ())))
    compare(case["id"], shark(tmp_path, path, options), native(path, options))
