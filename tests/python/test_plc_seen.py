"""What the PLC saw of a transaction, where a call of it has no response, or not all of one."""

from __future__ import annotations

from pathlib import Path

import handmade
import pytest
from tests.audit import cuts, wire

from ds47.analysis import analyze
from ds47.model import CaptureResult, Finding, Frames
from ds47.report.plc import Witness
from ds47.spec import rules


def finding(
    rule: str, frame: int, job: int | None, offset: int | None, /, **args: object
) -> Finding:
    """A finding of a rule, as serious as the rule is."""
    return Finding(rule, rules()[rule].severity, frame, [frame], job, offset, args)


def saw(result: CaptureResult) -> str:
    """What the PLC saw of each transaction."""
    witness = Witness(result)
    return "\n".join(
        witness.text(each).en for each in result.transactions if each.channel == "ds47"
    )


def test_reads_without_a_response_are_told_in_their_order() -> None:
    """Between the polls, and behind them; that the capture ended is told of the last one."""
    frames = Frames(1, 2, 5, None, [(3, 4), (6, 7)])
    item = handmade.transaction(state="unanswered", frames=frames, read_status=None)
    lost = [[], [finding("DS101", 8, 1, None, operation="Read")]]
    results = [CaptureResult("x", transactions=[item], findings=each) for each in lost]
    texts = [saw(each) for each in results]
    assert "RDREC, no response before" not in texts[0]
    assert (
        " ".join(texts[1].split()).count(
            "DE80B500; RDREC, its whole response is not in the capture; RDREC "
        )
        == 1
    )
    assert "DE80B500; RDREC, no response before the capture ends" in texts[1]


def test_a_part_of_a_response_is_that_of_the_read_that_has_no_finding_of_its_own() -> None:
    """Nothing came for one Read, a fragment for the other: two Reads without a response, or one in part."""
    item = handmade.transaction(state="unanswered", frames=Frames(1, 2, 5, None), read_status=None)
    part = finding("DS105", 8, 1, None, have=1, kind="RPC")
    lost = finding("DS101", 5, 1, None, operation="Read")
    results = [
        CaptureResult("x", transactions=[item], findings=each) for each in ([part], [lost, part])
    ]
    texts = [saw(each) for each in results]
    assert texts[0].endswith("00000000; RDREC, its whole response is not in the capture")
    assert texts[1].endswith("00000000; RDREC 2 x, the whole response is not in the capture")


def test_a_write_without_a_response_before_other_reads_is_told() -> None:
    """Whose the Reads behind it were is not known; nor where a finding alone names one of them."""
    lost = handmade.transaction(id=2, state="unanswered", frames=Frames(3), write_status=None)
    results = []
    for frames, found in (
        (Frames(1, 2, 6, 7, [(4, 5)]), []),
        (Frames(1, 2), [finding("DS104", 5, 1, None, kind="reject", fault=1)]),
        (Frames(1, 2), []),
    ):
        older = handmade.transaction(frames=frames)
        results.append(CaptureResult("x", transactions=[older, lost], findings=found))
    texts = [saw(each) for each in results]
    for text, known in zip(texts, (False, False, True), strict=True):
        assert text.endswith("\nWRREC, its response is not in the capture") is not known
        assert ("WRREC, no response before the capture ends; RDREC not started" in text) is known


@pytest.mark.parametrize(
    ("length", "write"),
    [
        (184, "WRREC, its STATUS was cut off by the capture"),
        (200, "WRREC DONE, STATUS 00000000"),
    ],
)
def test_what_a_snap_length_left_of_calls_is_told(
    captures: Path, tmp_path: Path, length: int, write: str
) -> None:
    path = tmp_path / "cut.pcap"
    frames = wire.frames(captures / "real-stacks/o2_pyprofinet_le.pcapng")
    cuts.write(path, cuts.snapped(length)(frames))
    result = analyze(path)
    read = "RDREC VALID, STATUS 00000000, LEN 10 (0 of them captured)"
    assert saw(result).splitlines()[-1] == f"{write}; {read}"
