"""The pipeline: collected or told one by one, the same; options reach their place."""

from __future__ import annotations

import hashlib
import io
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import troubles

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import CaptureError, open_capture
from ds47.capture.writer import PcapngWriter
from ds47.lab import message, scenarios
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import Finding, Transaction
from ds47.report.sentences import sentence

READ = message.read(1, 1, message.address(21))
ANSWER = message.answer(1, 1, 1, message.real(10.0))


def capture(stage: Stage) -> io.BytesIO:
    target = io.BytesIO()
    with PcapngWriter(target, link_type=stage.link) as writer:
        for shot in stage.shots:
            writer.write(shot.time_ns, shot.data, original_length=shot.original_length)
    target.seek(0)
    return target


def talk(index: int = 47) -> io.BytesIO:
    stage = Stage()
    client = Client(stage)
    client.exchange(READ, ANSWER, at=client.at(index=index))
    return capture(stage)


def without_id(transaction: Transaction) -> dict[str, Any]:
    return {name: value for name, value in asdict(transaction).items() if name != "id"}


def place(transaction: Transaction) -> tuple[int, int]:
    return transaction.frames.first(), transaction.position


def told(finding: Finding) -> tuple[Any, ...]:
    return finding.rule, finding.severity, sentence(finding), finding.frame, finding.offset


@pytest.mark.parametrize("name", list(scenarios()))
def test_told_one_by_one_is_what_is_collected(name: str) -> None:
    source = capture(scenarios()[name].play())
    heard: list[tuple[Transaction, list[Finding]]] = []
    streamed = analyze(source, None, lambda *args: heard.append(args))
    source.seek(0)
    whole = analyze(source)
    assert streamed.transactions == []
    heard.sort(key=lambda pair: place(pair[0]))
    assert [without_id(t) for t, _ in heard] == [without_id(t) for t in whole.transactions]
    assert len({transaction.id for transaction, _ in heard}) == len(heard)
    findings = [finding for _, each in heard for finding in each] + streamed.findings
    assert Counter(map(told, findings)) == Counter(map(told, whole.findings))
    for transaction, each in heard:
        assert {finding.transaction for finding in each} <= {transaction.id}
    for key in ("frames", "rpc", "records", "devices", "summary", "dropped", "complete"):
        assert getattr(streamed, key) == getattr(whole, key), key


def test_digest(tmp_path: Path) -> None:
    path = tmp_path / "one.pcapng"
    path.write_bytes(talk().getvalue())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    wanted = AnalysisOptions(digest=True)
    assert analyze(path).sha256 is None
    assert analyze(path, wanted).sha256 == analyze(str(path), wanted).sha256 == digest
    assert analyze(talk(), wanted).sha256 is None  # a stream has no file


@pytest.mark.parametrize(("indices", "count"), [((), 0), ((1000,), 1), ((1001,), 0)])
def test_indices(indices: tuple[int, ...], count: int) -> None:
    result = analyze(talk(1000), AnalysisOptions(indices=frozenset(indices)))
    assert len(result.transactions) == count
    assert result.records == {"1000": {"read": 1, "write": 1}}  # counted whosoever's it is


def test_options_reach_findings_and_judge() -> None:
    def rules(**options: Any) -> list[str]:
        source = capture(scenarios()["conversation-slow"].play())
        return [finding.rule for finding in analyze(source, AnalysisOptions(**options)).findings]

    assert rules() == ["DS416"]
    assert rules(slow_ms=2000) == rules(ignore=("DS4",)) == rules(select=("DS1",)) == []


def test_an_open_capture_is_read_on() -> None:
    with open_capture(talk()) as opened:
        assert analyze(opened).summary["ok"] == 1


def values(source: bytes) -> list[list[Any]]:
    """What each answer says of the parameter."""
    return [
        [value for parameter in each.parameters for value in parameter.values]
        for each in analyze(io.BytesIO(source)).transactions
    ]


def test_an_answer_of_cut_fragments_has_no_value_in_a_wrong_place() -> None:
    (found,) = values(troubles.cut_rpc_fragments())
    assert 20 < len(found) < troubles.COUNT
    assert found == list(range(len(found)))


def test_fragments_of_an_old_message_are_none_of_a_new_one() -> None:
    first, second = values(troubles.old_rpc_fragments())
    assert first == []
    assert second == list(range(5000, 5000 + troubles.COUNT))


def test_a_clock_that_is_set_back_spoils_no_fragments() -> None:
    result = analyze(io.BytesIO(troubles.clock_back_with_ip_fragments()))
    assert {each.state for each in result.transactions} == {"ok"}
    assert len(result.transactions) == 23
    assert {each.rule for each in result.findings} == {"DS107"}
    with open_capture(io.BytesIO(troubles.clock_back_with_ip_fragments())) as frames:
        times = {each.number: each.time_ns for each in frames}
    for each in result.findings:
        stepped = times[each.args["first"]] - times[each.frame]
        assert each.args["milliseconds"] == stepped / 1e6 > 0


def test_no_capture() -> None:
    with pytest.raises(CaptureError):
        analyze(io.BytesIO(b"no capture at all"))
