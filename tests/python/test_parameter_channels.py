"""PKW in cyclic frames: found by a Connect, proven by a request and its response, paired from what changes."""

from __future__ import annotations

import io
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.audit import run

import ds47
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cli import main
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import BAD, GOOD, INPUT, OUTPUT, PKW, PZD, Cyclic, LabModule
from ds47.lab.stage import Stage
from ds47.model import CaptureResult, Transaction
from ds47.report import contract
from ds47.spec.semantics import limits
from ds47.wireshark.engine import differences

READ, FIFTY = "143a000000000000", "243a000042480000"
WHICH = {"pnu": 1082, "subindex": 0, "family": "sinamics"}
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
    assert [each.rule for each in result.findings] == ["DS501", "DS531"]
    assert result.summary == {"transactions": 2, "ok": 1, "read": 1, "error": 1, "change": 1}


@pytest.mark.parametrize(
    "modules",
    [
        (PKW, PZD),
        (PZD, PKW),
        (LabModule(1, 1, 2), PZD, LabModule(2, 9, 8), LabModule(7, 1, 30)),
        (LabModule(3, 1, 12),),
        (LabModule(3, 1, 20),),
        (LabModule(3, 1, 8), LabModule(3, 2, 12)),
    ],
    ids=lambda modules: "+".join(str(each.length) for each in modules),
)
def test_wherever_it_lies(modules: tuple[LabModule, ...]) -> None:
    machine = Machine(modules=modules)
    machine.module = next(each for each in modules if each.length in (8, 12, 20) and each != PZD)
    assert talk(machine.connect()).told() == BOTH


@pytest.mark.parametrize(
    "modules",
    [(LabModule(2, 1, 8),), (LabModule(2, 1, 8), LabModule(3, 1, 4)), (LabModule(2, 1, 10), PZD)],
)
def test_where_lengths_say_that_it_is_none(modules: tuple[LabModule, ...]) -> None:
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
    assert [each.rule for each in result.findings] == ["DS501", "DS531"], (
        "that of the request before"
    )


def test_what_stood_there_while_the_other_side_was_lost_is_no_response() -> None:
    """However long it goes on: that a frame is looked at now and then is no edge."""
    machine = talk(Machine().connect()).respond(FIFTY)
    machine.line.iops[OUTPUT] = BAD
    machine.turn()
    machine.line.iops[OUTPUT] = GOOD
    result = machine.ask(IDLE).ask(READ, 1_500).ask(IDLE).result()
    newest = result.transactions[-1]
    assert (newest.state, newest.cycles, newest.parameters[0].values) == ("ok", None, [50.0])
    machine.line.iops[INPUT] = BAD
    machine.ask(READ, 3)
    machine.line.iops[INPUT] = GOOD
    states = [each.state for each in machine.turn(1_500).ask(IDLE).result().transactions]
    assert states == ["ok", "error", "ok", "unanswered"], "the one that was lost is no second one"


def test_a_frame_that_is_not_valid_says_nothing() -> None:
    machine = talk(Machine().connect())
    machine.line.status = 0x31
    machine.ask(READ).respond(FIFTY)
    assert machine.told() == BOTH


def test_a_later_connect_replaces_what_an_earlier_one_said() -> None:
    """The same stations and frame ids, the data elsewhere."""
    machine = talk(Machine().connect())
    machine.line.modules = (LabModule(1, 1, 6), PKW, PZD)
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
    heard: list[tuple[int, str, list[str]]] = []
    source = io.BytesIO(talk(Machine().connect()).capture())
    analyze(
        source,
        AnalysisOptions(),
        lambda item, found: heard.append((item.id, item.channel, [each.rule for each in found])),
    )
    assert heard == [(1, "pkw", []), (2, "pkw", ["DS501", "DS531"])]


@pytest.fixture
def path(tmp_path: Path) -> str:
    path = tmp_path / "cyclic.pcapng"
    path.write_bytes(talk(Machine().connect()).capture())
    return str(path)


@pytest.mark.parametrize("format_name", ["text", "json", "ndjson", "csv", "html"])
def test_every_format_shows_it(format_name: str, path: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["report", "-f", format_name, "-o", str(out), path]) == 0
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
@settings(max_examples=40, deadline=None)
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


def test_it_is_a_difference_between_the_engines_where_one_has_it_not() -> None:
    native = talk(Machine().connect()).result()
    assert differences(native, native) == []
    found = differences(native, replace(native, transactions=native.transactions[:1], findings=[]))
    gone = ["finding_gone"] * len(native.findings)
    assert [each.kind for each in found] == ["transaction_gone", *gone]
    assert {each.rule for each in found} == {None, "DS501", "DS531"}


def test_the_library_tells_it() -> None:
    result = ds47.analyze(io.BytesIO(talk(Machine().connect()).capture()))
    assert [each.channel for each in result.transactions] == ["pkw", "pkw"]


# What is wrong with a transaction (DS5xx)

MOVED = "243a000042490000"
OTHER = "143b000000000000", "243b000041200000"


def rules_of(machine: Machine) -> list[tuple[str, dict[str, Any]]]:
    return [(each.rule, each.args) for each in machine.result().findings]


def proven() -> Machine:
    """One request with its response: the channel is known."""
    return Machine().connect().ask(READ).respond(FIFTY).ask(IDLE).respond(IDLE)


def test_a_negative_response() -> None:
    told = proven().ask(CHANGE).respond(REFUSED).ask(IDLE)
    because = "DS531", {"pnu": 1082, "subindex": 0, "family": "sinamics", "what": "pzd_S2"}
    assert rules_of(told) == [
        ("DS501", WHICH | {"code": 17, "vendor_id": 0x002A}),
        because,
    ]


def test_a_number_that_no_table_knows_is_none() -> None:
    told = proven().ask(CHANGE).respond("743a00000000ffff").ask(IDLE)
    assert rules_of(told) == [("DS501", WHICH | {"code": None, "vendor_id": 0x002A})]


def test_no_right_to_change() -> None:
    told = proven().ask(CHANGE).respond("843a000000000000").ask(IDLE)
    assert rules_of(told) == [("DS502", {"pnu": 1082, "subindex": 0, "family": "sinamics"})]


def test_a_request_that_is_withdrawn() -> None:
    assert rules_of(proven().ask(OTHER[0], 5).ask(IDLE)) == [
        (
            "DS503",
            {
                "pnu": 1083,
                "subindex": 0,
                "family": "sinamics",
                "milliseconds": 20.0,
                "dropped": False,
            },
        )
    ]
    assert rules_of(proven().ask(OTHER[0], 5).respond(OTHER[1]).ask(IDLE)) == []


def test_a_request_at_the_end_of_the_capture_is_nobodys_fault_before_it_stands_for_long() -> None:
    for cycles, rules in ((30, ["DS110", "DS725"]), (2490, ["DS110", "DS725"]), (2600, ["DS514"])):
        found = [rule for rule, _ in rules_of(proven().ask(OTHER[0], cycles))]
        assert [rule for rule in found if rule != "DS521"] == rules


def test_a_request_that_is_replaced() -> None:
    told = proven().ask(OTHER[0]).ask(READ).respond(FIFTY).ask(IDLE)
    frames = [each.frames.write_request for each in told.result().transactions]
    assert rules_of(told) == [
        (
            "DS504",
            {
                "pnu": 1083,
                "subindex": 0,
                "family": "sinamics",
                "request": frames[1],
                "by": frames[2],
                "dropped": False,
            },
        )
    ]


def test_a_response_to_something_else() -> None:
    told = proven().ask(READ).respond(OTHER[1]).ask(IDLE)
    assert rules_of(told) == [
        ("DS505", {"request": "143A 0000 0000 0000", "response": "243B 0000 4120 0000"})
    ]


def test_a_change_that_comes_in_parts() -> None:
    parts = proven().ask("343a000000000000", 1).ask(CHANGE).respond("243a000042200000").ask(IDLE)
    assert rules_of(parts) == [("DS506", {"pnu": 1082, "subindex": 0, "family": "sinamics"})]
    whole = proven().ask(CHANGE).respond("243a000042200000").ask(IDLE)
    assert rules_of(whole) == []


def test_a_word_in_the_wrong_place() -> None:
    wrong = proven().ask("22bc000000050000").respond("12bc000000000000").ask(IDLE)
    assert rules_of(wrong) == [
        ("DS513", {"pnu": 700, "subindex": 0, "family": "sinamics", "pwe": 5})
    ]
    right = proven().ask("22bc000000000005").respond("12bc000000000005").ask(IDLE)
    assert rules_of(right) == []


def test_of_another_maker_notes_are_said() -> None:
    stage = Stage()
    machine = Machine()
    machine.stage = stage
    machine.line = Cyclic(Client(stage, device=drive(vendor_id=0x0493)))
    machine.connect().ask(READ).respond(FIFTY).ask(CHANGE).respond(REFUSED).ask(IDLE)
    result = machine.result()
    assert [each.state for each in result.transactions] == ["ok", "error"]
    told = [(each.rule, each.severity) for each in result.findings]
    assert told == [("DS501", "note"), ("DS531", "note")]


STEPS = st.lists(
    st.tuples(
        st.sampled_from(("ask", "ask", "respond", "respond", "lose")),
        st.sampled_from(
            (READ, FIFTY, MOVED, CHANGE, REFUSED, IDLE, *OTHER, "22bc000000050000", "12bc000000000000",
             "843a000000000000", "343a000000000000", "243a000042200000")
        ),
        st.integers(1, 4),
    ),
    max_size=25,
)  # fmt: skip


@pytest.mark.slow
@given(STEPS)
@settings(max_examples=20, deadline=None)
def test_what_is_said_of_random_talk_is_so(steps: list[tuple[str, str, int]]) -> None:
    """The auditor reads the frames by itself."""
    machine = talk(Machine().connect())
    for what, words, cycles in steps:
        if what == "lose":
            machine.line.iops[OUTPUT] ^= GOOD
            machine.turn(cycles)
        else:
            (machine.ask if what == "ask" else machine.respond)(words, cycles)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "talk.pcapng"
        path.write_bytes(machine.capture())
        assert list(map(str, run.audit(path))) == []


def test_a_parameter_that_is_read_all_the_time() -> None:
    """As often as the limit says it is none of our business, and once more is told with its count."""
    most = limits().pkw_reads
    line = proven()
    for _ in range(most):
        line.ask(OTHER[0]).respond(OTHER[1]).ask(IDLE)
    assert "DS509" not in dict(rules_of(line))
    told = dict(rules_of(line.ask(OTHER[0]).respond(OTHER[1]).ask(IDLE)))["DS509"]
    assert (told["pnu"], told["count"], told["limit"]) == (1083, most + 1, most)
