"""What a limit pushes out is told once, and nothing is said that only its absence would prove (DS109)."""

from __future__ import annotations

import io
from collections import Counter
from pathlib import Path

import pytest
import troubles

from ds47 import analysis
from ds47.analysis import analyze
from ds47.lab import message
from ds47.lab.client import Client
from ds47.model import CaptureResult
from ds47.report.sentences import words
from ds47.spec.semantics import limits

REPRODUCERS = Path(__file__).resolve().parents[3] / "shared/captures/reproducers"


def found(result: CaptureResult) -> Counter[str]:
    """How often each rule speaks, without the diagnoses."""
    return Counter(each.rule for each in result.findings if not each.rule.startswith("DS7"))


def told(result: CaptureResult) -> list[tuple[int, str]]:
    """Frame and sentence of each DS109."""
    return [
        (each.frame, words("DS109", each.args)) for each in result.findings if each.rule == "DS109"
    ]


def sentence(limit: str, count: int) -> str:
    most = getattr(limits(), limit)
    return f"ds47 reached its limit {limit} = {most}: {count} given up, the first in this frame"


def test_calls_that_were_pushed_out_are_neither_unanswered_nor_unasked() -> None:
    result = analyze(io.BytesIO(troubles.calls_at_once()))
    assert told(result) == [(1, sentence("activities", 52))]
    assert found(result) == {"DS109": 1, "DS110": troubles.AT_ONCE}  # the capture ends
    assert result.rpc["unanswered"] == 0


def test_a_write_that_was_pushed_out_may_have_been_read() -> None:
    result = analyze(io.BytesIO(troubles.writes_at_once()))
    assert told(result) == [(1, sentence("pending_writes", 36)), (1, sentence("calls", 36))]
    assert {"DS101", "DS102", "DS402", "DS403"}.isdisjoint(found(result))


def test_where_no_response_comes_nothing_was_given_up() -> None:
    """One direction of a capture says no more than that, however much is open at once."""
    result = analyze(io.BytesIO(troubles.requests_alone()))
    assert told(result) == []
    assert {"DS401", "DS402", "DS403"}.isdisjoint(found(result))
    assert {each.args["what"] for each in result.findings if each.rule == "DS725"} == {
        "only_requests"
    }


def test_datagrams_that_were_pushed_out_are_counted() -> None:
    result = analyze(io.BytesIO(troubles.ip_fragments_at_once()))
    assert told(result) == [(5, sentence("ip_datagrams", 44))]
    assert found(result) == {"DS109": 1, "DS105": 256}


def test_rpc_messages_that_were_pushed_out_are_counted() -> None:
    """Their responses are not without a request in the capture, and those of the others neither."""
    result = analyze(io.BytesIO(troubles.rpc_fragments_at_once()))
    assert told(result) == [(5, sentence("rpc_messages", 76))]
    assert found(result) == {"DS109": 1, "DS105": 1024}


def test_what_its_time_is_over_for_is_told_however_much_it_is() -> None:
    result = analyze(io.BytesIO(troubles.fragments_one_after_the_other()))
    assert found(result) == {"DS105": 400}


def test_an_orphan_whose_channel_was_pushed_out_may_have_had_a_request(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bounds = limits().but(channels=2)
    monkeypatch.setattr(analysis, "limits", lambda: bounds)
    stage = troubles.Quick()
    clients = [Client(stage) for _ in range(3)]
    for slot, client in enumerate(clients):
        client.channel = client.at(slot=slot + 1, index=0xB02F)
        client.sequence = 10 * slot
        client.write(message.read(1, 1, message.address(21)))
    clients[0].read(message.answer(1, 1, 1, message.real(1.5)))
    result = analyze(io.BytesIO(stage.written()))
    assert told(result) == [
        (1, "ds47 reached its limit channels = 2: 2 given up, the first in this frame")
    ]
    assert found(result) == {"DS109": 1, "DS110": 3}


@pytest.mark.parametrize(
    ("wanted", "rules"),
    [
        ({"ignore": ("DS908",)}, {"DS904": 3, "DS109": 1}),
        ({"ignore": ("DS109", "DS908")}, {"DS904": 3}),
        ({"select": ("DS904",)}, {"DS904": 3}),
    ],
)
def test_of_any_channel_the_findings_that_had_no_room_are_told(
    wanted: dict[str, tuple[str, ...]],
    rules: dict[str, int],
    captures: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bounds = limits().but(lone_findings=3)
    monkeypatch.setattr(analysis, "limits", lambda: bounds)
    options = analysis.AnalysisOptions(channels=("s7",), **wanted)
    result = analyze(captures / "lossy-stacks/s7connector.pcapng", options)
    assert found(result) == rules
    assert [each[1] for each in told(result)] == [
        "ds47 reached its limit lone_findings = 3: 7 given up, the first in this frame"
    ] * rules.get("DS109", 0)


@pytest.mark.skipif(not REPRODUCERS.is_dir(), reason="shared/captures is missing")
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("reverse-3000.pcap.gz", {"DS109": 1, "DS110": 3000}),
        ("ipfrag-silent.pcap", {"DS109": 1, "DS105": 256}),
    ],
)
def test_a_capture_made_to_hurt_is_told_no_lies_about(name: str, said: dict[str, int]) -> None:
    assert found(analyze(REPRODUCERS / name)) == said
