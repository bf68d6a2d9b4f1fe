"""Captures of PROFIBUS to transactions: DS47 by MS1 gives what the same records give on PROFINET."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_profibus_calls import Talk

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab import captured
from ds47.lab.fdl import RECORDS
from ds47.lab.master import Master
from ds47.model import Transaction
from ds47.profibus import PROFIBUS_DL, USER0, telegram
from ds47.profinet import rpc
from ds47.profinet.calls import CallTracker, RpcCall
from ds47.profinet.link import Packets
from ds47.profinet.records import Record, parse_request, parse_response
from ds47.spec.semantics import limits

STATION, MASTER = 3, 2
SHORT = b"\xe5"
MOST = 240
OTHER = ("controller", "device", "station", "ar", "api", "subslot", "findings")
"""What PROFIBUS has no equal of, or has in another way."""
OTHER_RULES = {"DS103", "DS111", "DS701", "DS712", "DS713", "DS718", "DS719", "DS720"}
"""About RPC; about lengths that MS1 cannot ask for; about the vendor, whom no frame of MS1 names."""


class Records:
    """What a controller asked a device, asked by a master."""

    def __init__(self) -> None:
        self.master = Master()
        self.master.stage.gap_ns = 0
        self.frames: dict[int, int] = {}
        """Frames of PROFINET to those of PROFIBUS."""
        self.places: set[tuple[str, str, bytes, int]] = set()
        """Who asked whom, by which AR and subslot: PROFIBUS has but one of them."""

    def service(self, record: Record, ask: bytes, answer: bytes, polls: int = 1) -> None:
        """A request, short acknowledgement, empty polls, and the answer."""
        asked, answered, stage = record.request, record.response, self.master.stage
        assert asked is not None
        assert answered is not None
        stage.now_ns = asked.time_ns
        self.frames[asked.frame] = self.master.ask(STATION, ask.hex(), RECORDS, RECORDS)
        for _ in range(polls):
            self.master.short()
            self.master.ask(STATION, "", RECORDS, RECORDS)
        stage.now_ns = answered.time_ns
        self.frames[answered.frame] = self.master.tell(STATION, answer.hex(), RECORDS, RECORDS)

    def write(self, path: Path, link_type: int = PROFIBUS_DL) -> dict[int, int]:
        """Frames of PROFINET to those of PROFIBUS."""
        self.master.stage.link = link_type
        path.write_bytes(captured(self.master.stage))
        return self.frames


def calls(path: Path) -> list[tuple[rpc.Pdu, rpc.Pdu | None]]:
    """Requests and responses of the RPC calls of a capture, in the order of the requests."""
    found: dict[RpcCall, tuple[rpc.Pdu, rpc.Pdu | None]] = {}
    tracker = CallTracker(limits())
    with open_capture(path) as capture:
        for packet in Packets().of(capture):
            pdu = rpc.parse(packet) if packet.kind == "udp" else None
            if pdu is not None:
                for what, call, said in tracker.take(pdu):
                    if call is not None and said is not None and what == "asked":
                        found[call] = said, None
                    elif call is not None and what in ("answered", "failed", "late"):
                        found[call] = found.get(call, (pdu, None))[0], said
    return list(found.values())


def reframed(path: Path) -> Records | None:
    """The same records by MS1; None where MS1 cannot carry them so."""
    master, busy = Records(), 0
    for request, response in calls(path):
        if request.opnum in (rpc_ for rpc_ in range(10) if rpc_ not in (2, 3)):
            return None
        if response is None or request.frame < busy:
            return None
        busy = response.frame
        (asked, multiple), (_, told) = parse_request(request), parse_response(response)
        if len(asked) != 1 or len(told) != 1 or multiple:
            return None
        record = asked[0]
        record.response = told[0].response
        both = framed(record)
        if both is None:
            return None
        master.places.add((request.client, request.server, record.ar, record.subslot))
        master.service(record, *both)
    return master if master.frames else None


def framed(record: Record) -> tuple[bytes, bytes] | None:
    """Request and response of a record as data units of MS1."""
    asked, told = record.request, record.response
    assert asked is not None
    if told is None or record.index > 0xFF or record.slot > 0xFE or asked.missing or told.missing:
        return None
    if max(len(asked.data), len(told.data)) > MOST or told.status is None:
        return None
    if told.status and told.status >> 16 not in (0xDE80, 0xDF80):
        return None
    place = bytes((record.slot, record.index))
    code = b"\x5f" if record.write else b"\x5e"
    wanted = len(asked.data) if record.write else min(asked.stated, MOST)
    ask = code + place + bytes((wanted,)) + asked.data
    if told.status:
        return ask, told.status.to_bytes(4)
    length = len(asked.data) if record.write else len(told.data)
    return ask, code + place + bytes((length,)) + told.data


def told(item: Transaction, frames: dict[int, int] | None = None) -> dict[str, Any]:
    """What a transaction says that both can say; frame numbers as those of PROFIBUS."""
    plain = {name: getattr(item, name) for name in item.__dataclass_fields__ if name not in OTHER}
    number = dict(frames or {})
    place = item.frames
    plain["frames"] = [
        each if frames is None or each is None else number[each]
        for each in (place.write_request, place.write_response, place.read_request,
                     place.read_response, *(one for read in place.polls + place.rereads for one in read))
    ]  # fmt: skip
    plain["parameters"] = [
        {
            name: value
            for name, value in _plain(each).items()
            if name not in ("listed", "unit", "scaled", "described", "family")
        }
        for each in item.parameters
    ]
    return plain


def _plain(item: Any) -> dict[str, Any]:
    found = {name: getattr(item, name) for name in item.__dataclass_fields__}
    if found.get("error") is not None:
        found["error"] = (found["error"].code, found["error"].info)
    return found


def captures() -> Iterator[Path]:
    yield from sorted((Path(__file__).parents[2] / "captures").glob("*.pcapng"))


@pytest.mark.parametrize("link_type", [PROFIBUS_DL, USER0])
def test_the_same_records_give_the_same_transactions(tmp_path: Path, link_type: int) -> None:
    compared = 0
    for path in captures():
        master = reframed(path)
        if master is None or len(master.places) > 1:
            continue
        target = tmp_path / "bus.pcapng"
        frames = master.write(target, link_type)
        there, here = analyze(path), analyze(target)
        expected = [told(each, frames) for each in there.transactions]
        assert [told(each) for each in here.transactions] == expected, path.name
        assert [rules(each) for each in here.transactions] == [
            rules(each) for each in there.transactions
        ], path.name
        assert all(each.station == STATION for each in here.transactions)
        compared += len(expected)
    assert compared > 300


def rules(item: Transaction) -> set[str]:
    return set(item.findings) - OTHER_RULES


def read_back(*between: bytes) -> list[bytes]:
    """p1082 is written, and reads back something else; what comes between the two."""
    change = "020201011001043a0000080141200000"
    talk = Talk().ask("5f002f10" + change).answer().ask("").answer("5f002f10")
    talk.ask("5e002ff0").answer("5e002f04" + "02020101").add(*between)
    talk.ask("5f002f0a" + "030101011001043a0000").answer().ask("").answer("5f002f0a")
    return talk.ask("5e002ff0").answer("5e002f0a" + "03010101080141100000").frames


SET_PRM = telegram.encode(STATION, MASTER, 0x7D, bytes.fromhex("b81e010080b501"), 61, 62)


@pytest.mark.parametrize(
    ("between", "found"),
    [((), ["DS417"]), ((SET_PRM, SHORT), []), ((SET_PRM,), [])],
    ids=["nothing", "parameters", "parameters-without-answer"],
)
def test_a_station_that_gets_its_parameters_may_have_been_off(
    tmp_path: Path, between: tuple[bytes, ...], found: list[str]
) -> None:
    target = tmp_path / "bus.pcapng"
    with PcapngWriter(target, link_type=PROFIBUS_DL) as writer:
        for number, data in enumerate(read_back(*between)):
            writer.write(number * 1_000_000, data)
    result = analyze(target)
    assert [each.state for each in result.transactions] == ["ok", "ok"]
    assert [each.rule for each in result.findings if each.rule == "DS417"] == found


def test_what_is_no_profibus_says_nothing(tmp_path: Path) -> None:
    target = tmp_path / "own.pcapng"
    with PcapngWriter(target, link_type=USER0) as writer:
        for number in range(100):
            writer.write(number, bytes((number, 0xE5, 0xDC)) * 9)
    result = analyze(target)
    assert (result.frames, result.transactions, result.findings) == (100, [], [])


ASKED, OTHERS = "5f002f0a01010101100103840000", "5f002f0a02010101100103850000"
ANSWER = "5e002f080101010142010005"


def on_a_line(*steps: tuple[str, str]) -> Master:
    """Services of MS1 after a start-up; what refuses one below MS1 is its code."""
    wire = Master()
    wire.start(STATION)
    for asked, answer in steps:
        if len(answer) > 1:
            wire.record(STATION, asked)
            wire.poll(STATION, answer)
        else:
            wire.ask(STATION, asked, 51, 51)
            wire.tell(STATION, code=int(answer))
    return wire


def reported(
    wire: Master, tmp_path: Path, capsys: pytest.CaptureFixture[str], *options: str
) -> str:
    path = tmp_path / "line.pcapng"
    path.write_bytes(captured(wire.stage))
    main(["report", "--no-progress", "--plc", *options, str(path)])
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("steps", "words"),
    [
        ([(ASKED, "5f002f0a"), ("5e002ff0", "2")], "RDREC, no record came (no response in the capture, or"),
        ([(ASKED, "2")], "no record by RDREC in this capture"),
        ([(ASKED, "5f002f0a"), ("5e002ff0", "de80b500")], "no record by RDREC in this capture"),
    ],
)  # fmt: skip
def test_what_the_plc_saw_of_a_read_that_was_refused(
    steps: list[tuple[str, str]], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = reported(on_a_line((ASKED, "5f002f0a"), ("5e002ff0", ANSWER), *steps), tmp_path, capsys)
    (line,) = [each for each in told.split("#2 ")[1].splitlines() if "PLC: " in each]
    assert words in " ".join(told.split("#2 ")[1].split()), line
    assert "not in the capture" not in line
    assert "not started" not in line


def test_a_response_without_a_request_is_no_implicit_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = reported(on_a_line(("5e002ff0", ANSWER)), tmp_path, capsys, "--index", "47")
    assert "#1 " in told
    assert "ReadImplicit" not in told
    assert "Which request 1 response belongs to" in " ".join(told.split())


def test_a_request_between_names_no_ar(tmp_path: Path) -> None:
    wire = on_a_line(
        (ASKED, "5f002f0a"), (OTHERS, "5f002f0a"), ("5e002ff0", "5e002f080201010142010005")
    )
    path = tmp_path / "line.pcapng"
    path.write_bytes(captured(wire.stage))
    (clash,) = [each for each in analyze(path).findings if each.rule == "DS705"]
    assert (clash.args["ar"], clash.args["other_ar"]) == (None, None)
