"""The stations of a line and what is wrong there (DS8xx): lines by hand, whose faults the test counts itself."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ds47.analysis import analyze
from ds47.lab import captured
from ds47.lab.fdl import FIRST, NO_RESOURCE, NOT_ENABLED, frame
from ds47.lab.master import NO_DPV1, PPO3, SET_PRM, Master
from ds47.lab.master import READY as DIAGNOSIS
from ds47.model import BusStation, CaptureResult, Finding
from ds47.profibus.judge import LineJudge
from ds47.profibus.line import Line, LineFrame
from ds47.profibus.stations import MOST_FRAMES, LineStations
from ds47.profibus.telegram import decode
from ds47.spec import rules
from ds47.spec.semantics import Limits, limits

STATION, MASTER = 3, 2


def result(wire: Master) -> CaptureResult:
    return analyze(io.BytesIO(captured(wire.stage)))


def station(wire: Master, address: int = STATION) -> BusStation:
    bus = result(wire).bus
    assert bus is not None
    return next(each for each in bus.stations if each.address == address)


def found(wire: Master, rule: str = "DS8") -> list[Finding]:
    return [each for each in result(wire).findings if each.rule.startswith(rule)]


def one(wire: Master, rule: str) -> Finding:
    """The only finding DS8xx, which is of this rule; its frames are not among its arguments here."""
    (finding,) = found(wire)
    assert finding.rule == rule
    frames = finding.args.pop("frames", [finding.frame])
    assert {finding.frame, *frames} <= {*finding.frames}
    assert len(frames) == finding.args.get("count", 1) or len(frames) == MOST_FRAMES
    return finding


def running() -> Master:
    """A station after its start-up, in data exchange."""
    wire = Master()
    wire.start(STATION)
    for _ in range(5):
        wire.exchange(STATION)
        wire.token()
    return wire


def test_a_healthy_line_has_no_findings() -> None:
    wire = running()
    assert found(wire) == []
    bus = result(wire).bus
    assert bus is not None
    assert (bus.frames, bus.tokens, bus.damaged, bus.stray) == (len(wire.stage.shots), 5, 0, 0)
    assert [(each.address, each.role) for each in bus.stations] == [(2, "master"), (3, "slave")]
    told = station(wire)
    assert (told.ident, told.ppo, told.watchdog_ms) == (0x80B5, 1, 300)
    assert (told.requests, told.unanswered, told.damaged, told.retries) == (9, 0, 0, 0)
    assert (told.exchanges, told.parameters, told.configuration) == (5, 3, 5)
    assert told.cycle == (300_000, 300_000, 300_000)
    assert told.answer == (100_000, 100_000, 100_000)
    assert told.diagnosis is not None
    assert told.diagnosis.frame == 8
    assert (told.diagnosis.master, told.diagnosis.ident) == (MASTER, 0x80B5)
    assert told.diagnosis.flags == ["watchdog"]


def test_wrong_check_bytes_are_counted() -> None:
    wire = running()
    first = wire.exchange(STATION)
    wire.spoil()
    wire.exchange(STATION)
    wire.spoil()
    wire.exchange(STATION)
    assert (one(wire, "DS801").frame, one(wire, "DS801").args) == (first, {"count": 2})
    assert (station(wire).damaged, station(wire).unanswered) == (2, 0)


def test_other_damage_is_counted_apart() -> None:
    wire = running()
    wire.exchange(STATION)
    wire.spoil(1)
    wire.exchange(STATION)
    assert one(wire, "DS802").args == {"count": 1}


def test_a_frame_that_the_recording_cut_is_no_damage() -> None:
    wire = running()
    assert found(wire) == []
    wire.stage.snap = 10
    wire.exchange(STATION)
    wire.token()
    told = result(wire)
    assert [each for each in told.findings if each.rule in ("DS801", "DS802")] == []
    assert told.bus is not None
    assert told.bus.damaged == 0


def test_retries_are_counted() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    first = wire.repeat()
    wire.repeat()
    wire.tell(STATION, "00" * 12)
    wire.exchange(STATION)
    finding = one(wire, "DS803")
    assert (finding.frame, finding.args) == (first, {"device": "dp3", "count": 2, "of": 11})
    assert station(wire).retries == 2
    assert station(wire).answer == (100_000, 100_000, 100_000)


def test_a_damaged_answer_is_that_of_its_station_though_a_retry_was_answered() -> None:
    wire = running()
    for _ in range(2):
        wire.exchange(STATION)
        wire.spoil()
        wire.repeat()
        wire.tell(STATION, "00" * 12)
        wire.spoil()
        wire.repeat()
        wire.tell(STATION, "00" * 12)
    told = station(wire)
    assert (told.damaged, told.unanswered, told.retries, told.exchanges) == (4, 0, 4, 7)


def test_no_answer_is_counted() -> None:
    wire = running()
    first = wire.ask(STATION, "00" * 12)
    wire.restart(STATION)
    wire.ask(STATION, "01" * 12)
    wire.restart(STATION)
    wire.exchange(STATION)
    finding = one(wire, "DS804")
    assert (finding.frame, finding.args) == (first, {"device": "dp3", "count": 2, "of": 12})


def test_an_answer_that_the_master_had_is_missing_in_the_capture() -> None:
    """FCB turns round with the next request; who asks for FDL_Status, or another master, says nothing of it."""
    wire = running()
    first = wire.ask(STATION, "00" * 12)
    wire.look([STATION])
    wire.put(frame(STATION, 1, FIRST, b""))
    wire.exchange(STATION)
    wire.ask(STATION, "00" * 12)
    wire.repeat()
    wire.exchange(STATION)
    assert (station(wire).unanswered, found(wire)) == (0, [])
    (finding,) = (each for each in result(wire).findings if each.rule == "DS725")
    assert finding.frame == first
    told = {name: value for name, value in finding.args.items() if value is not None}
    assert told == {"what": "bus_answers", "count": 2, "device": "dp3"}


def test_what_repeats_a_request_where_exchanges_are_missing_is_no_repetition() -> None:
    """Data exchange asks the same again and again: the third stands behind the answer to the first."""
    wire = running()
    for _ in range(12):
        wire.exchange(STATION)
    shots = wire.stage.shots
    begin = len(shots) - 20
    wire.stage.shots = [
        each for at, each in enumerate(shots, -begin)
        if at not in (2, 3, 9)  # an exchange, and an answer
    ]  # fmt: skip
    assert station(wire).retries == 1
    assert found(wire) == []
    (told,) = (each for each in result(wire).findings if each.rule == "DS725")
    assert (told.args["what"], told.args["count"], told.frame) == ("bus_answers", 1, begin + 7)
    wire.stage.shots = shots


def test_two_requests_with_the_same_fcb_show_that_an_exchange_is_missing() -> None:
    wire = running()
    for number in range(4):
        wire.exchange(STATION, f"{number:024x}")
    del wire.stage.shots[-6:-4]
    (told,) = (each for each in result(wire).findings if each.rule == "DS725")
    args = {name: value for name, value in told.args.items() if value is not None}
    assert args == {"what": "bus_exchanges", "count": 1, "device": "dp3"}
    assert told.frame == len(wire.stage.shots) - 3
    assert found(wire) == []


def test_requests_alone_that_stand_there_twice_are_no_repetitions() -> None:
    wire = running()
    for number in range(4):
        wire.exchange(STATION, f"{number:024x}")
    asked = [each for each in wire.stage.shots if decode(each.data).request]
    wire.stage.shots = [each for each in asked for _ in range(2)]
    assert [each.rule for each in result(wire).findings] == ["DS725"]


def test_of_a_line_with_answers_alone_the_requests_are_missing() -> None:
    wire = running()
    shots = [
        each
        for each in wire.stage.shots
        if each.data[:1] == b"\xe5" or not decode(each.data).request
    ]
    wire.stage.shots = [each for each in shots if decode(each.data).kind != "SD4"]
    told = [each for each in result(wire).findings if each.rule == "DS725"]
    assert [each.args["what"] for each in told] == ["bus_requests"]
    assert told[0].args["count"] == len(wire.stage.shots)


def test_an_answer_that_is_older_than_its_request_is_none() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    wire.tell(STATION, "00" * 12)
    wire.exchange(STATION)
    assert station(wire).exchanges == 7
    shots = wire.stage.shots
    shots[-3], shots[-2] = shots[-2], shots[-3]
    bus = result(wire).bus
    assert bus is not None
    assert (station(wire).exchanges, bus.stray) == (6, 1)


def test_what_was_said_with_a_station_is_all_there() -> None:
    assert _lost(running().stage.shots) == 0


@pytest.mark.parametrize("number", [12, 13, 15, 16, 18, 19])
def test_a_frame_that_is_missing_is_noticed_by_the_next_request(number: int) -> None:
    """An answer, because nobody repeats the request; a request, because the FCB is that of the one before."""
    frames = list(running().stage.shots)
    del frames[number - 1]
    assert _lost(frames) in range(number, number + 4)


def _lost(frames: list[Any], cut: dict[int, int] | None = None) -> int:
    """`cut`: frames of which the recording has so many bytes."""
    line = Line()
    for number, each in enumerate(frames, 1):
        kept = (cut or {}).get(number)
        line.take(LineFrame(number, each.time_ns, decode(each.data[:kept])), kept is not None)
    return line.lost(STATION)


@pytest.mark.parametrize(("kept", "lost"), [(6, 0), (7, 1), (14, 1)])
def test_what_a_frame_says_that_the_recording_cut_nobody_knows(kept: int, lost: int) -> None:
    """A request or an answer, where stations and function code are there."""
    shots = running().stage.shots
    sizes = [(number, len(each.data)) for number, each in enumerate(shots, 1)]
    number = max(number for number, size in sizes if size > 14)
    for each in (number, number - 1):
        item = decode(shots[each - 1].data)
        assert (item.da if item.request else item.sa) == STATION
        assert _lost(list(shots[:number]), {each: kept}) == each * lost


def test_the_end_of_a_capture_is_no_missing_answer() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    assert found(wire) == []
    assert station(wire).requests == 9


def test_a_token_says_that_the_master_waited_in_vain() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    wire.token()
    assert (station(wire).requests, station(wire).unanswered) == (10, 0)
    wire.token()
    wire.spoil(1, 128)
    told = station(wire)
    assert (told.requests, told.unanswered, told.damaged) == (10, 0, 0)
    wire.repeat()
    assert station(wire).requests == 9
    wire.tell(STATION, "00" * 12)
    wire.spoil()
    wire.token()
    told = station(wire)
    assert (told.requests, told.unanswered, told.damaged, told.retries) == (10, 0, 1, 1)


def twice(wire: Master, many: int | None = None) -> Master:
    """The same line, recorded at two places; one of them heard so many frames, from the first on."""
    shots, both = wire.stage.shots, Master()
    both.stage.shots[:] = [each for shot in shots[:many] for each in (shot, shot)]
    if many is not None:
        both.stage.shots += shots[many:]
    return both


def test_a_recording_of_two_places_has_an_answer_to_each_request() -> None:
    assert found(twice(running())) == []


def third_heard_twice(both: int) -> Master:
    """Twelve exchanges, of which another place heard so many: half of them makes a third of the answers copies."""
    wire = Master()
    for _ in range(12):
        wire.exchange(STATION)
    return twice(wire, 2 * both)


def test_a_third_of_the_answers_twice_makes_two_places() -> None:
    """With less the same frame again is a repetition, and the same answer again one that nobody asked for."""
    for both, retries in ((5, 5), (6, 0)):
        told = result(third_heard_twice(both)).bus
        assert told is not None
        assert (told.stray, told.stations[1].retries) == (retries, retries)
        assert told.stations[1].exchanges == 12


def test_who_is_asked_whether_he_is_there_is_no_station() -> None:
    wire = running()
    wire.look(range(10, 20))
    wire.exchange(STATION)
    assert found(wire) == []
    bus = result(wire).bus
    assert bus is not None
    assert [each.address for each in bus.stations] == [2, 3]


@pytest.mark.parametrize(
    ("set_prm", "case"),
    [(SET_PRM, "sap_dpv1"), (NO_DPV1, "sap_no_dpv1"), ("", "sap_unknown")],
)
def test_a_sap_that_is_not_enabled(set_prm: str, case: str) -> None:
    wire = Master()
    if set_prm:
        wire.start(STATION, set_prm)
    for _ in range(2):
        wire.ask(STATION, "5f002f0401010100", 51, 51)
        wire.tell(STATION, code=3)
        wire.exchange(STATION)
    finding = one(wire, "DS805")
    assert finding.args["case"] == case
    assert (finding.args["sap"], finding.args["count"]) == (51, 2)
    assert finding.args.get("frame") == (3 if set_prm else None)


def test_a_refused_record_that_is_not_ours() -> None:
    wire = running()
    for _ in range(3):
        wire.record(STATION, "5e01ff40")
        last = wire.poll(STATION, "de80b000")
    finding = one(wire, "DS806")
    assert finding.frame == last - 8
    assert finding.args == {
        "device": "dp3", "count": 3, "operation": "DS_Read", "status": "DE80B000",
        "place": {"slot": 1, "subslot": None, "index": 255},
    }  # fmt: skip


def test_many_polls() -> None:
    wire = running()
    most = limits().bus_polls
    frames = []
    for polls in (most - 1, most + 3, most + 9, most + 1, most + 9):
        wire.record(STATION, "5e01ff40")
        for _ in range(polls):
            wire.poll(STATION)
        wire.poll(STATION, "5e01ff0400000000")
        frames.append([each.frame for each in found(wire) if each.rule == "DS807"])
    finding = one(wire, "DS807")
    assert finding.args == {"device": "dp3", "count": 4, "limit": most, "polls": most + 10}
    assert frames[2] != frames[1]
    assert frames[4] == frames[3] == frames[2]  # that of the first with the most


def reading(wire: Master) -> None:
    """DS47 by somebody who has not asked."""
    wire.record(STATION, "5e002ff0")
    wire.poll(STATION, "de80b500")


def asking(wire: Master) -> None:
    """DS47 as it should be."""
    wire.record(STATION, "5f002f0a01010101100103840000")
    wire.poll(STATION, "5f002f0a")
    wire.record(STATION, "5e002ff0")
    wire.poll(STATION, "5e002f080101010142010005")


@pytest.mark.parametrize(
    ("steps", "told"),
    [
        ((asking, reading), ["DS206"]),
        ((reading, asking), ["DS808"]),
        ((reading, asking, reading), ["DS808", "DS206"]),
    ],
)
def test_a_read_without_a_write_since_the_start_up(
    steps: tuple[Callable[[Master], None], ...], told: list[str]
) -> None:
    wire = running()
    for step in steps:
        step(wire)
    findings = [each for each in result(wire).findings if each.rule in ("DS206", "DS808")]
    assert [each.rule for each in findings] == told
    for each in found(wire):
        assert each.args == {"device": "dp3", "index": 47, "status": "DE80B500"}


def test_without_the_start_up_the_write_may_be_before_the_capture() -> None:
    wire = Master()
    reading(wire)
    asking(wire)
    assert found(wire) == []
    assert "DS110" in [each.rule for each in result(wire).findings]


def test_a_write_that_is_too_long() -> None:
    wire = running()
    at = wire.ask(STATION, "5f002ff1" + "00" * 240, 51, 51)
    wire.tell(STATION, "df80b100", 51, 51)
    finding = next(each for each in found(wire) if each.rule == "DS809")
    assert (finding.frame, finding.args["length"], finding.args["most"]) == (at, 241, 240)


def test_parameters_again_after_data_exchange() -> None:
    wire = running()
    wire.token()
    last = wire.exchange(STATION) - 1
    wire.start(STATION)
    wire.exchange(STATION)
    wire.start(STATION)
    finding = one(wire, "DS810")
    assert finding.args == {"device": "dp3", "count": 2, "last": last}
    assert finding.frame == last + 4


@pytest.mark.parametrize(
    ("wait", "told"),
    [
        (400, {"case": "exchange_late", "watchdog": 300, "frame": 3}),
        (250, {"case": "exchange_in_time", "watchdog": 300, "frame": 3}),
        (299.8001, {"case": "exchange_late", "gap": 300.0001}),
    ],
)
def test_data_exchange_that_is_refused(wait: float, told: dict[str, Any]) -> None:
    wire = running()
    last = wire.exchange(STATION) - 1
    wire.wait(wait)
    for code in (NOT_ENABLED, NOT_ENABLED, NO_RESOURCE):
        wire.ask(STATION, "00" * 12)
        wire.tell(STATION, code=code)
    rs, rr = [each for each in found(wire) if each.rule == "DS816"]
    assert {key: rs.args[key] for key in told} == told
    assert (rs.args["last"], rs.args["count"], rs.args["answer"]) == (last, 2, "RS")
    assert wait < rs.args["gap"] < wait + 5
    assert (rr.args["answer"], rr.args["count"], rr.frame) == ("RR", 1, rs.frame + 4)


def test_refusals_behind_each_other_are_one_series() -> None:
    """The watchdog runs out behind the first of them: what ended the data exchange, that one shows."""
    wire = running()
    wire.exchange(STATION)
    for _ in range(2):
        last = wire.exchange(STATION) - 1
        for _ in range(3):
            wire.wait(200)
            wire.ask(STATION, "00" * 12)
            wire.tell(STATION, code=NOT_ENABLED)
    finding = one(wire, "DS816")
    assert (finding.args["case"], finding.args["count"]) == ("exchange_in_time", 6)
    assert finding.args["last"] < last
    assert 200 < finding.args["gap"] < 205


@pytest.mark.parametrize(("code", "told"), [(NO_RESOURCE, "RR"), (1, "UE"), (NOT_ENABLED, None)])
def test_a_service_that_is_refused(code: int, told: str | None) -> None:
    wire = running()
    frames = []
    for _ in range(2):
        wire.ask(STATION, "5e001f00", 51, 51)
        frames.append(wire.tell(STATION, code=code))
    wire.exchange(STATION)
    refused = [each for each in found(wire) if each.rule in ("DS805", "DS817")]
    if told is None:
        assert [each.rule for each in refused] == ["DS805"]
        return
    (finding,) = refused
    assert (finding.rule, finding.frame) == ("DS817", frames[0])
    assert finding.args == {
        "device": "dp3", "count": 2, "frames": frames, "sap": 51, "answer": told,
    }  # fmt: skip


def test_data_exchange_that_is_refused_from_the_begin() -> None:
    wire = Master()
    wire.start(STATION)
    wire.ask(STATION, "00" * 12)
    at = wire.tell(STATION, code=NOT_ENABLED)
    finding = one(wire, "DS816")
    assert (finding.frame, finding.args["case"], finding.args["last"]) == (
        at,
        "exchange_none",
        None,
    )


def test_data_of_another_length_than_configured() -> None:
    wire = running()
    at = wire.exchange(STATION, "00" * 12, "00" * 4)
    wire.exchange(STATION, "00" * 12, "00" * 4)
    wire.exchange(STATION, "", "00" * 12)
    finding = one(wire, "DS811")
    assert (finding.frame, finding.args) == (at, {
        "device": "dp3", "count": 2, "outputs": 12, "inputs": 4, "configured_outputs": 12,
        "configured_inputs": 12, "frame": 5,
    })  # fmt: skip


def test_outputs_and_inputs_are_configured_apart() -> None:
    wire = Master()
    wire.start(STATION, configured="2010")  # a byte out, a byte in
    wire.exchange(STATION, "0000", "00")
    told = one(wire, "DS811").args
    assert (told["outputs"], told["inputs"]) == (2, 1)
    assert (told["configured_outputs"], told["configured_inputs"]) == (1, 1)
    wire = Master()
    wire.start(STATION, configured="2011")  # a byte out, two in
    wire.exchange(STATION, "00", "00")
    told = one(wire, "DS811").args
    assert (told["configured_outputs"], told["configured_inputs"]) == (1, 2)


def test_a_diagnosis_that_nobody_reads() -> None:
    most = limits().bus_diagnosis
    wire = running()
    first = wire.exchange(STATION, code=0x0A)
    for _ in range(most):
        wire.exchange(STATION, code=0x0A)
    finding = one(wire, "DS812")
    assert (finding.frame, finding.args) == (first, {"device": "dp3", "count": most + 1})
    assert (station(wire).diagnoses_wanted, station(wire).diagnoses_fetched) == (1, 0)


def test_a_diagnosis_that_is_read_in_time() -> None:
    wire = running()
    for _ in range(3):
        for _ in range(limits().bus_diagnosis - 1):
            wire.exchange(STATION, code=0x0A)
        wire.diagnose(STATION, "080c000280b5" + "06810000ab12")
        wire.exchange(STATION)
    assert found(wire) == []
    told = station(wire)
    assert (told.diagnoses_wanted, told.diagnoses_fetched) == (3, 3)
    assert told.diagnosis is not None
    assert [each.hex() for each in told.diagnosis.blocks] == ["06810000ab12"]


@pytest.mark.parametrize(("configured", "identifier"), [("73f1", "73"), ("73fd", None)])
def test_pkw_without_consistency(configured: str, identifier: str | None) -> None:
    wire = Master()
    wire.start(STATION, configured=configured)
    told = [each.args["identifier"] for each in found(wire, "DS813")]
    assert told == ([identifier] if identifier else [])


@pytest.mark.parametrize(
    ("told", "cases"),
    [
        (DIAGNOSIS, []),
        ("400c000280b5", ["diag_prm_fault"]),
        ("040c000280b5", ["diag_cfg_fault"]),
        ("440c000280b5", ["diag_cfg_fault", "diag_prm_fault"]),
        ("000c000280b6", ["diag_ident"]),
        ("000c000580b5", ["diag_master"]),
        ("000c00ff80b5", []),
    ],
)
def test_what_slave_diag_says(told: str, cases: list[str]) -> None:
    wire = Master()
    wire.start(STATION, diagnosis=told)
    wire.diagnose(STATION, told)
    findings = found(wire, "DS814")
    assert sorted(each.args["case"] for each in findings) == cases
    assert {each.args["count"] for each in findings} <= {2}
    assert {each.frame for each in findings} <= {8}


def test_what_slave_diag_says_before_it_was_sent_anything_is_of_an_earlier_start_up() -> None:
    """As that of a sensor in a public log, which then took its configuration."""
    wire = Master()
    wire.diagnose(STATION, "460500ff80b5")
    assert found(wire, "DS814") == []
    wire.start(STATION)
    wire.exchange(STATION)
    assert found(wire) == []
    wire.diagnose(STATION, "040500ff80b5")
    assert [each.args["case"] for each in found(wire, "DS814")] == ["diag_cfg_fault"]
    wire = Master()
    wire.diagnose(STATION, "040c000280b5")  # a master is named, so it was sent something
    assert [each.args["case"] for each in found(wire, "DS814")] == ["diag_cfg_fault"]


def test_another_master_may_read_the_diagnosis_of_a_station() -> None:
    wire = running()
    wire.put(frame(STATION, 1, 0x6D, b"", 60, 62))
    wire.put(frame(1, STATION, 8, bytes.fromhex(DIAGNOSIS), 62, 60))
    wire.exchange(STATION)
    assert found(wire) == []


def test_no_watchdog() -> None:
    wire = Master()
    wire.start(STATION, "b0" + SET_PRM[2:])
    finding = one(wire, "DS815")
    assert (finding.frame, finding.args) == (3, {"device": "dp3", "count": 1})
    assert station(wire).watchdog_ms is None


def test_every_rule_of_the_bus_has_a_test() -> None:
    told = [each for each in rules() if each.startswith("DS8")]
    assert told == [f"DS{number}" for number in range(801, 818)]
    text = Path(__file__).read_text(encoding="utf-8")
    assert [each for each in told if f'"{each}"' not in text] == []


def everything_wrong() -> Master:
    """One line with every trouble that has a rule, on four stations."""
    wire, most = Master(), limits()
    wire.start(3, "90" + SET_PRM[2:14] + "000000", "73f1", "440c000580b6")
    reading(wire)
    asking(wire)
    for out, back, code in (("00" * 12, "00" * 12, 8), ("00" * 12, "00" * 4, 8), ("", "00", 9)):
        wire.exchange(3, out, back, code)
    wire.start(3)
    for number in range(most.bus_diagnosis + 3):
        wire.exchange(3, code=0x0A)
        if number == 1:
            wire.diagnose(3, "080c000280b5" + "06810000ab12")
    wire.ask(3, "5f002f0401010100", 51, 51)
    wire.tell(3, code=3)
    wire.ask(3, "", 20, 62)
    wire.tell(3, code=3)
    wire.ask(3, "5f002ff1" + "00" * 240, 51, 51)
    wire.tell(3, "df80b100", 51, 51)
    wire.ask(4, "")
    wire.restart(4)
    wire.exchange(3)
    wire.spoil()
    wire.ask(4, "")
    wire.repeat()
    wire.exchange(3)
    wire.spoil(1)
    wire.record(3, "5e01ff40")
    for _ in range(most.bus_polls + 5):
        wire.poll(3)
    wire.poll(3, "de80b000")
    wire.exchange(3)
    return wire


def test_everything_wrong_has_every_rule() -> None:
    told = {each.rule for each in found(everything_wrong())}
    assert sorted(told) == [f"DS{number}" for number in range(801, 816)]


def by_chance(seed: int) -> tuple[Master, dict[int, dict[str, int]], dict[str, int]]:
    """A line with faults, and how many of each there are: whoever makes a fault counts it."""
    chance, wire = random.Random(seed), Master()
    stations = chance.sample(range(3, 100), chance.randint(1, 4))
    counts: dict[int, dict[str, int]] = {
        each: dict.fromkeys(("requests", "unanswered", "damaged", "retries", "exchanges"), 0)
        for each in stations
    }
    line = {"tokens": 0, "damaged": 0}
    for each in stations:
        wire.start(each, configured=PPO3)
        counts[each]["requests"] += 4
    for _ in range(chance.randint(5, 120)):
        each = chance.choice(stations)
        told = counts[each]
        told["requests"] += 1
        wire.ask(each, f"{chance.randrange(1 << 32):08x}")
        for _ in range(chance.choice((0, 0, 0, 0, 1, 2))):
            wire.repeat()
            told["retries"] += 1
        kind = chance.choice(("answer", "answer", "answer", "damaged", "nothing"))
        if kind != "nothing":
            wire.tell(each, "00" * 4)
        if kind == "damaged":
            wire.spoil(by=chance.randrange(1, 256))
            line["damaged"] += 1
        told["exchanges"] += kind == "answer"
        told["damaged"] += kind == "damaged"
        if kind == "nothing":
            told["unanswered"] += 1
            wire.restart(each)
        if chance.random() < 0.2:
            wire.token()
            line["tokens"] += 1
    for each in stations:
        wire.exchange(each, "00" * 4, "00" * 4)
        counts[each]["requests"] += 1
        counts[each]["exchanges"] += 1
    return wire, counts, line


@pytest.mark.parametrize("seed", range(60))
def test_lines_by_chance_are_counted(seed: int) -> None:
    wire, counts, line = by_chance(seed)
    told = result(wire)
    assert told.bus is not None
    assert {"tokens": told.bus.tokens, "damaged": told.bus.damaged} == line
    for address, wanted in counts.items():
        here = station(wire, address)
        assert {name: getattr(here, name) for name in wanted} == wanted
    sums: dict[str, Any] = {}
    for finding in told.findings:
        if finding.rule in ("DS801", "DS803", "DS804"):
            sums[finding.rule] = sums.get(finding.rule, 0) + finding.args["count"]
    wanted_sums = {
        "DS801": line["damaged"],
        "DS803": sum(each["retries"] for each in counts.values()),
        "DS804": sum(each["unanswered"] for each in counts.values()),
    }
    assert sums == {rule: number for rule, number in wanted_sums.items() if number}


# What the auditor found


def test_a_start_up_that_the_station_refuses_is_none() -> None:
    wire = running()
    wire.ask(STATION, "b0" + SET_PRM[2:], 61)
    wire.tell(STATION, code=2)
    wire.ask(STATION, PPO3, 62)
    wire.tell(STATION, code=1)
    wire.exchange(STATION)
    told = station(wire)
    assert (told.parameters, told.configuration, told.watchdog_ms, told.ppo) == (3, 5, 300, 1)
    assert [each.rule for each in found(wire)] == ["DS817", "DS817"]


def test_outputs_that_are_acknowledged_alone_are_data_exchange() -> None:
    wire = Master()
    wire.start(STATION, configured="21")
    for _ in range(3):
        wire.ask(STATION, "00" * 2)
        wire.short()
    told = station(wire)
    assert (told.exchanges, told.outputs, told.inputs) == (3, 2, 0)
    assert told.cycle == (200_000, 200_000, 200_000)
    assert found(wire) == []


def test_an_answer_that_the_recording_cut_is_not_damaged() -> None:
    wire = running()
    wire.stage.snap = 10
    wire.exchange(STATION, "")
    wire.ask(STATION)
    here = station(wire)
    assert (here.requests, here.unanswered, here.damaged) == (10, 0, 0)


def test_each_frame_twice_is_a_line_of_two_places() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    wire.repeat()
    wire.tell(STATION, "00" * 12)
    wire.ask(4)
    wire.exchange(STATION)
    wire.spoil()
    wire.exchange(STATION)
    wire.restart(4)
    wire.exchange(4)
    single, double = wire, twice(wire)
    one, two = result(single).bus, result(double).bus
    assert one is not None
    assert two is not None
    assert (two.frames, two.stray) == (2 * one.frames, 0)
    for name in ("requests", "unanswered", "damaged", "retries", "exchanges"):
        assert getattr(station(double), name) == getattr(station(single), name)
        assert getattr(station(double, 4), name) == getattr(station(single, 4), name)
    assert [each.args["count"] for each in found(double, "DS804")] == [1]
    assert found(double, "DS803") == []


@pytest.mark.parametrize("damaged", [True, False])
def test_behind_a_damaged_request_nothing_is_a_repetition(damaged: bool) -> None:
    wire = asked_twice(damaged=damaged)
    assert station(wire).retries == (not damaged)


def test_behind_a_pause_that_stands_out_nothing_is_a_repetition() -> None:
    """So may whole exchanges be missing, the one with the other FCB among them."""
    wire = asked_twice(wait=0.2)
    wire.exchange(STATION)
    assert station(wire).retries == 0
    assert found(wire, "DS803") == []


@pytest.mark.parametrize("copied", [False, True])
def test_nor_is_it_behind_more_repetitions_than_are_kept(copied: bool) -> None:
    wire = running()
    for wait in (0, 0.2):
        for _ in range(MOST_FRAMES + 1):
            wire.ask(STATION, "00" * 12)
            wire.wait(wait)
            wait = 0
            wire.repeat()
            wire.tell(STATION, "00" * 12)
    assert station(twice(wire) if copied else wire).retries == 2 * MOST_FRAMES + 1


def test_nor_is_it_where_each_frame_stands_there_twice() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    wire.wait(0.2)
    wire.repeat()
    wire.tell(STATION, "00" * 12)
    for each in (wire, twice(wire)):
        assert station(each).retries == 0
        assert found(each, "DS803") == []


def test_an_answer_behind_a_token_is_none() -> None:
    wire = running()
    wire.ask(STATION, "00" * 12)
    wire.token()
    wire.tell(STATION, "00" * 12)
    told = result(wire).bus
    assert told is not None
    assert told.stray == 1


def asked_twice(*, damaged: bool = False, wait: float = 0) -> Master:
    """An exchange, and the same request once more; between them a damaged one, or milliseconds."""
    wire = running()
    wire.ask(STATION, "00" * 12)
    asked = wire.stage.shots[-1].data
    wire.tell(STATION, "00" * 12)
    if damaged:
        wire.ask(STATION, "01" * 12)
        wire.spoil()
    wire.wait(wait)
    wire.put(asked)
    wire.tell(STATION, "00" * 12)
    return wire


def test_what_is_counted_is_what_is_said() -> None:
    wire = running()
    for back in ("00" * 4, "00" * 6, "00" * 4):
        wire.exchange(STATION, "00" * 12, back)
    assert [(each.args["inputs"], each.args["count"]) for each in found(wire, "DS811")] == [
        (4, 2), (6, 1),
    ]  # fmt: skip
    for told in ("000c000280b6", "000c000280b7", "000c000280b6", "000c000580b5", "000c000680b5"):
        wire.diagnose(STATION, told)
    said = [
        (each.args.get("ident"), each.args.get("master"), each.args["count"])
        for each in found(wire, "DS814")
    ]
    assert said == [(0x80B6, None, 2), (0x80B7, None, 1), (None, 5, 1), (None, 6, 1)]


def test_a_sap_names_the_start_up_that_was_the_last() -> None:
    wire, frames = Master(), []
    for _ in range(2):
        frames.append(wire.number + 3)
        wire.start(STATION)
        wire.ask(STATION, "5f002f0401010100", 51, 51)
        wire.tell(STATION, code=3)
        wire.ask(STATION, "", 20)
        wire.tell(STATION, code=3)
    told = [(each.args["case"], each.args.get("frame")) for each in found(wire, "DS805")]
    assert told == [
        ("sap_dpv1", frames[0]),
        ("sap_other", None),
        ("sap_dpv1", frames[1]),
    ]


@pytest.mark.parametrize("spoilt", [3, 1])
def test_a_write_that_was_damaged_may_be_there(spoilt: int) -> None:
    wire = running()
    for number, data in enumerate(("5f002f0a01010101100103840000", "5e002ff0")):
        wire.record(STATION, data)
        if not number:
            shot = wire.stage.shots[-2]
            wire.stage.shots[-2] = replace(shot, data=shot.data[:-spoilt] + b"\x00" * spoilt)
        wire.poll(STATION, "5f002f0a" if not number else "de80b500")
    asking(wire)
    told = [each.rule for each in result(wire).findings if each.rule in ("DS110", "DS206", "DS808")]
    assert told == ["DS110"]


def test_a_frame_that_is_damaged_behind_a_read_hides_no_write_before_it() -> None:
    """Although the Read is told of later: once the answer to the question shows that this is DS47."""
    wire = running()
    reading(wire)
    asking(wire)
    shots = wire.stage.shots
    answer = next(n for n, shot in enumerate(shots) if shot.data[-6:-2] == b"\x5f\x00\x2f\x0a")
    shots[answer] = replace(shots[answer], data=shots[answer].data[:-1] + b"\x00")
    told = [each.rule for each in result(wire).findings if each.rule in ("DS110", "DS206", "DS808")]
    assert told == ["DS808"]


def test_different_things_are_bounded() -> None:
    judge = LineJudge(Limits(**{**limits().columns(), "bus_remarks": 2}))
    for number, index in enumerate((1, 2, 3, 1)):
        judge.refused(STATION, True, 0, index, 0xDF80B000, number + 1)
    told = [
        (each.args["place"]["index"], each.args["count"])
        for each in judge.finish(LineStations(judge.heard))
    ]
    assert told == [(1, 2), (2, 1)]
