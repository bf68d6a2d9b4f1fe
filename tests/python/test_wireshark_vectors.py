"""The vectors through the plugin in tshark: every message and every conversation.

That the analyzer gives what the vectors say is shown elsewhere (test_messages.py,
test_conversations.py); here the plugin has to give what the analyzer gives for the same frames.
"""

from __future__ import annotations

import io
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from shares import share
from test_conversations import CASES, capture
from test_wireshark_plugin import COMPLETE, WORKERS, program, run, told, with_all_args
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.profidrive import Options
from ds47.report import json as report
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
    return fields.Fields([report.transaction(each) for each in result.transactions], findings)


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


@pytest.mark.slow
def test_every_conversation(tmp_path: Path) -> None:
    program()
    assert len(CASES) >= CONVERSATIONS_AT_LEAST
    jobs = []
    for number, case in enumerate(share(CASES)):
        path = tmp_path / f"{number}.pcapng"
        path.write_bytes(capture(case).getvalue())
        indices = frozenset(case.get("options", {}).get("indices", ()))
        jobs.append((case["id"], path, AnalysisOptions(indices=indices)))
    with ThreadPoolExecutor(WORKERS) as pool:
        found = pool.map(lambda job: shark(tmp_path, job[1], job[2]), jobs)
        for (name, path, options), result in zip(jobs, found, strict=True):
            compare(name, result, native(path, options))
