"""PKW in cyclic frames: found by a Connect, proven by a request and its response, paired from what changes."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ds47
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab.client import Client
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic, Module
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Transaction
from ds47.report import contract
from ds47.wireshark.engine import differences

READ, FIFTY = "143a000000000000", "243a000042480000"
CHANGE, REFUSED = "343a000042200000", "743a000000000011"
IDLE = "00" * 8


class Machine:
    """A controller and a drive with cyclic frames."""

    def __init__(self, **settings: Any) -> None:
        self.stage = Stage()
        self.line = Cyclic(Client(self.stage), **settings)
        self.module = self.line.modules[0]

    def connect(self) -> Machine:
        self.line.connect()
        return self.turn()

    def turn(self, count: int = 3) -> Machine:
        """Cycles in which setpoint and actual value move."""
        for number in range(count):
            self.line.say(PZD, OUTPUT, bytes.fromhex("047f") + (1000 + number).to_bytes(2))
            self.line.say(PZD, INPUT, bytes.fromhex("fb31") + (900 + number).to_bytes(2))
            self.line.cycle()
        return self

    def ask(self, words: str, cycles: int = 3) -> Machine:
        self.line.say(self.module, OUTPUT, bytes.fromhex(words))
        return self.turn(cycles)

    def respond(self, words: str, cycles: int = 3) -> Machine:
        self.line.say(self.module, INPUT, bytes.fromhex(words))
        return self.turn(cycles)

    def capture(self) -> bytes:
        target = io.BytesIO()
        with PcapngWriter(target) as writer:
            for shot in self.stage.shots:
                writer.write(shot.time_ns, shot.data, shot.original_length)
        return target.getvalue()

    def result(self) -> CaptureResult:
        return analyze(io.BytesIO(self.capture()))

    def told(self) -> list[tuple[Any, ...]]:
        return [short(each) for each in self.result().transactions]


def short(item: Transaction) -> tuple[Any, ...]:
    (only,) = item.parameters
    number = only.error.number if only.error else None
    return item.operation, item.state, only.pnu, only.subindex, only.values, number


def talk(machine: Machine) -> Machine:
    """Two requests with their responses."""
    return machine.ask(READ).respond(FIFTY).ask(CHANGE).respond(REFUSED).ask(IDLE).respond(IDLE)


BOTH = [("read", "ok", 1082, 0, [50.0], None), ("change", "error", 1082, 0, [40.0], "17")]


def test_requests_and_responses() -> None:
    result = talk(Machine().connect()).result()
    assert [short(each) for each in result.transactions] == BOTH
    first = result.transactions[0]
    assert (first.channel, first.cycles, first.duration_ms) == ("pkw", 3, 12.1)
    assert (first.api, first.slot, first.subslot, first.index) == (0, 2, 2, None)
    assert first.frames.all() == [9, 16]
    assert first.status == (None, None)
    assert first.bytes == (READ, FIFTY)
    assert result.findings == []
    assert result.summary == {"transactions": 2, "ok": 1, "read": 1, "error": 1, "change": 1}


@pytest.mark.parametrize(
    "modules",
    [
        (PKW, PZD),
        (PZD, PKW),
        (Module(1, 1, 2), PZD, Module(2, 9, 8), Module(7, 1, 30)),
        (Module(3, 1, 12),),
        (Module(3, 1, 20),),
        (Module(3, 1, 8), Module(3, 2, 12)),
    ],
    ids=lambda modules: "+".join(str(each.length) for each in modules),
)
def test_wherever_it_lies(modules: tuple[Module, ...]) -> None:
    machine = Machine(modules=modules)
    machine.module = next(each for each in modules if each.length in (8, 12, 20) and each != PZD)
    assert talk(machine.connect()).told() == BOTH


@pytest.mark.parametrize(
    "modules", [(Module(2, 1, 8),), (Module(2, 1, 8), Module(3, 1, 4)), (Module(2, 1, 10), PZD)]
)
def test_where_lengths_say_that_it_is_none(modules: tuple[Module, ...]) -> None:
    assert talk(Machine(modules=modules).connect()).told() == []


def test_lengths_alone_are_no_parameter_channel() -> None:
    """Eight bytes that look like a request, and nothing that responds to it."""
    assert Machine().connect().ask(READ, 200).ask(CHANGE).ask(IDLE).told() == []
    assert Machine().connect().respond(FIFTY).ask(READ, 3).ask(IDLE).told() == []


def test_nothing_is_guessed_without_a_connect() -> None:
    assert talk(Machine().turn()).told() == []


def test_a_request_that_stood_there_when_the_capture_began_has_no_time() -> None:
    machine = Machine()
    machine.line.say(PKW, OUTPUT, bytes.fromhex(READ))
    told = machine.connect().respond(FIFTY).ask(CHANGE).respond(REFUSED).ask(IDLE).result()
    assert [short(each) for each in told.transactions] == BOTH
    assert [each.cycles for each in told.transactions] == [None, 3]


def test_data_that_is_not_valid_ends_a_request_and_nobody_is_to_blame() -> None:
    machine = talk(Machine().connect()).ask(READ)
    machine.line.iops[OUTPUT] = BAD
    machine.respond(FIFTY)
    machine.line.iops[OUTPUT] = GOOD
    result = machine.ask(IDLE).ask(READ).respond(FIFTY).ask(IDLE).result()
    assert [each.state for each in result.transactions] == ["ok", "error", "unanswered", "ok"]
    assert result.findings == []


def test_a_frame_that_is_not_valid_says_nothing() -> None:
    machine = talk(Machine().connect())
    machine.line.status = 0x31
    machine.ask(READ).respond(FIFTY)
    assert machine.told() == BOTH


def test_a_later_connect_replaces_what_an_earlier_one_said() -> None:
    """The same stations and frame ids, the data elsewhere."""
    machine = talk(Machine().connect())
    machine.line.modules = (Module(1, 1, 6), PKW, PZD)
    machine.connect()
    assert talk(machine).told() == BOTH + BOTH


def test_values_that_move_are_updates_of_one_transaction() -> None:
    machine = Machine().connect().ask(READ)
    for number in range(50):
        machine.respond(f"243a00004248{number:04x}", 2)
    assert [each.state for each in machine.ask(IDLE).result().transactions] == ["ok"]


def test_a_long_capture_is_skipped_and_nothing_in_it() -> None:
    machine = talk(Machine().connect()).turn(5_000)
    assert talk(machine).told() == BOTH + BOTH


def test_the_result_can_be_stored_and_loaded() -> None:
    result = talk(Machine().connect()).result()
    for each in result.transactions:
        plain = json.loads(json.dumps(contract.TRANSACTION.plain(each)))
        again = contract.TRANSACTION.load(plain, 0x002A)
        assert contract.TRANSACTION.plain(again) == plain
        assert again.parameters[0].error == each.parameters[0].error


def test_transactions_are_handed_out_as_they_end() -> None:
    heard: list[tuple[int, str]] = []
    source = io.BytesIO(talk(Machine().connect()).capture())
    analyze(source, AnalysisOptions(), lambda item, found: heard.append((item.id, item.channel)))
    assert heard == [(1, "pkw"), (2, "pkw")]


@pytest.fixture
def path(tmp_path: Path) -> str:
    path = tmp_path / "cyclic.pcapng"
    path.write_bytes(talk(Machine().connect()).capture())
    return str(path)


@pytest.mark.parametrize("format_name", ["text", "json", "ndjson", "csv", "html"])
def test_every_format_shows_it(format_name: str, path: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["report", "--plc", "-f", format_name, "-o", str(out), path]) == 0
    text = out.read_text("utf-8")
    assert "1082" in text
    assert format_name == "html" or "WRREC" not in text


def test_the_same_capture_is_no_difference(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diff", path, path]) == 0
    assert main(["baseline", path]) == 0
    assert main(["check", path]) == 0


def test_its_frames_can_be_exported(path: str, tmp_path: Path) -> None:
    out = tmp_path / "out.pcapng"
    assert main(["export", "--transaction", "2", "-o", str(out), path]) == 0
    with open_capture(out) as capture:
        numbers = [frame.number for frame in capture.everything()]
    assert len(numbers) >= 2


USS = "100a800100000000", "100a800100000005"


@pytest.mark.parametrize(
    ("option", "found"),
    [
        ([], (10, 128)),
        (["--pkw-layout", "uss"], (2010, 1)),
        (["--pkw-layout", "192.168.133.33=uss"], (2010, 1)),
        (["--pkw-layout", "192.168.133.99=uss"], (10, 128)),
        (["--pkw-layout", "uss", "--pkw-layout", "192.168.133.33=cyclic"], (10, 128)),
    ],
)
def test_the_layout_of_the_index_is_that_of_the_drive(
    option: list[str], found: tuple[int, int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "uss.pcapng"
    path.write_bytes(Machine().connect().ask(USS[0]).respond(USS[1]).ask(IDLE).capture())
    assert main(["report", "-f", "json", *option, str(path)]) == 0
    (item,) = json.loads(capsys.readouterr().out)["captures"][0]["transactions"]
    assert (item["parameters"][0]["pnu"], item["parameters"][0]["subindex"]) == found


def test_a_layout_that_there_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", "--pkw-layout", "usb", "x.pcap"]) == 2
    assert "cyclic or uss" in capsys.readouterr().err


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_whatever_is_in_the_frames(data: st.DataObject) -> None:
    """Any words, any state of data; and bytes overwritten anywhere, in the Connect too."""
    machine = Machine().connect()
    known = st.sampled_from((READ, FIFTY, CHANGE, REFUSED, IDLE)).map(bytes.fromhex)
    words = st.one_of(known, st.binary(min_size=8, max_size=8))
    kinds, states = st.sampled_from((INPUT, OUTPUT)), st.sampled_from((GOOD, GOOD, BAD))
    for _ in range(data.draw(st.integers(1, 12))):
        machine.line.iops[data.draw(kinds)] = data.draw(states)
        machine.line.say(PKW, data.draw(kinds), data.draw(words))
        machine.line.cycle(data.draw(st.integers(1, 3)))
    capture = bytearray(machine.capture())
    for _ in range(data.draw(st.integers(0, 6))):
        capture[data.draw(st.integers(200, len(capture) - 1))] = data.draw(st.integers(0, 255))
    for each in analyze(io.BytesIO(bytes(capture))).transactions:
        contract.TRANSACTION.plain(each)


def test_it_is_no_difference_between_the_engines() -> None:
    """The plugin does not look for it."""
    native = talk(Machine().connect()).result()
    assert differences(native, replace(native, transactions=[])) == []


def test_the_library_tells_it() -> None:
    result = ds47.analyze(io.BytesIO(talk(Machine().connect()).capture()))
    assert [each.channel for each in result.transactions] == ["pkw", "pkw"]
