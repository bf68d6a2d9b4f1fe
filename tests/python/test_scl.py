"""The function blocks of `ds47 encode -f scl-fb`, run by an interpreter of SCL (`scl_machine`).

The drive that answers is the auditor's, which shares no code with ds47; the calls are held to the documented
interface of WRREC and RDREC. What the interpreter cannot show is whether TIA Portal takes the source; that nobody
claims.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
import scl_machine
from hypothesis import given, settings
from hypothesis import strategies as st
from scl_machine import Machine, Records, SclError, parse
from tests.audit.drive import Drive, Parameter

from ds47 import __version__, spec
from ds47.cli import main
from ds47.profidrive import decode_response, encode_request, make_block
from ds47.profidrive.notation import parse_request_line
from ds47.report.scl import function_block

CYCLE_MS = 10
IDENTIFIER = 270
NOT_READY, CHANNEL_BUSY, BAD_HEADER = 0xDE80B500, 0xDF80B500, 0xDF80B700
NO_DEVICE, OCCUPIED = 0xC080C500, 0xC080C300
QUEUE, WRITE, READ, TIME, OTHER, CONTENT, REFUSED = range(1, 8)
"""The values of failure, as the block documents them."""


def source(line: str, lang: str = "en") -> str:
    return function_block(parse_request_line(line), line, lang)


def drive() -> Drive:
    """DO 2 has p2900 (Float32), p0922 (Unsigned16, not now), r2902[0..4], p1999 (DoubleWord)."""
    real = struct.Struct(">f").pack
    parameters = {
        2900: Parameter(0x08, [real(1.5)], most=100.0),
        922: Parameter(0x06, [b"\x00\x07"], refuses=0x6B),
        2902: Parameter(0x08, [real(each) for each in (0.0, 5.0, 10.0, 20.0, 50.0)], array=True),
        1999: Parameter(0x07, [b"\xff\xff\xff\xfe"]),
    }
    return Drive("192.168.0.2", 0x2A, {2: parameters}, {1: 2})


@dataclass
class Plant:
    """A controller with one drive behind hardware identifier 270, index 47.

    Attributes:
        polls: Reads that find no response yet.
        writes, reads: statuses with which the next WRREC and RDREC end, one after the other.
        lost: whether there never is a response.
        bend: what becomes of a response on its way.
        lasts: calls of each job in which BUSY is 1.
        edge: whether REQ counts as an edge.
    """

    drive: Drive = field(default_factory=drive)
    polls: int = 0
    writes: list[int] = field(default_factory=list)
    reads: list[int] = field(default_factory=list)
    lost: bool = False
    bend: Callable[[bytes], bytes] = bytes
    lasts: int = 2
    edge: bool = False
    now: int = 0
    sent: list[bytes] = field(default_factory=list)
    jobs: dict[str, Records] = field(default_factory=dict)
    in_use: bool = False
    reference: int = 0
    _response: bytes | None = None
    _waits: int = 0

    def machine(self, text: str) -> Machine:
        return Machine(parse(text), lambda: self.now, self.instance)

    def instance(self, name: str, kind: str) -> Records:
        done = self.write if kind == "WRREC" else self.read
        self.jobs[kind] = Records(kind, done, lambda: self.lasts, self.edge)
        return self.jobs[kind]

    def write(self, number: int, index: int, data: bytes) -> tuple[int, bytes]:
        assert (number, index) == (IDENTIFIER, 47)
        if self.writes:
            return self.writes.pop(0), b""
        answer = self.drive.answer(1, index, data)
        if answer is None:
            return BAD_HEADER, b""
        self.sent.append(data)
        self._response, self._waits = self.bend(answer), self.polls
        return 0, b""

    def read(self, number: int, index: int, length: int) -> tuple[int, bytes]:
        assert (number, index, length) == (IDENTIFIER, 47, 240)
        if self.reads:
            return self.reads.pop(0), b""
        if self.lost or self._response is None or self._waits:
            self._waits -= 1
            return NOT_READY, b""
        answer, self._response = self._response, None
        return 0, answer

    def cycle(self, machine: Machine, **inputs: Any) -> None:
        """One cycle of the program."""
        self.now += CYCLE_MS
        channel = {"channelInUse": self.in_use, "channelReference": self.reference}
        machine.call(hardwareId=IDENTIFIER, **channel, **inputs)
        self.in_use, self.reference = machine["channelInUse"], machine["channelReference"]

    def run(self, machine: Machine, **inputs: Any) -> Machine:
        """From the rising edge to the end of the request."""
        self.cycle(machine, start=False)
        for number in range(3000):
            self.cycle(machine, start=True, **inputs)
            assert machine["busy"] == (not machine["done"] and not machine["error"])
            if not machine["busy"]:
                assert number > 0
                assert not self.in_use
                return machine
        raise AssertionError("the request never ends")


def run(line: str, plant: Plant | None = None, **inputs: Any) -> Machine:
    plant = plant or Plant()
    return plant.run(plant.machine(source(line)), **inputs)


def result(machine: Machine) -> tuple[bool, int, int, int]:
    return machine["done"], machine["failure"], machine["errorParameter"], machine["errorNumber"]


GOOD = (True, 0, 0, -1)
CHANGE = "change axis 2 p2900=REAL:10.0"

# What the block does


@pytest.mark.parametrize("edge", [False, True], ids=["level", "edge"])
@pytest.mark.parametrize("lasts", [0, 1, 5])
@pytest.mark.parametrize("polls", [0, 2])
def test_a_change_is_sent_once_polled_and_done(edge, lasts, polls):
    plant = Plant(edge=edge, lasts=lasts, polls=polls)
    machine = plant.machine(source(CHANGE))
    for value in (12.25, -3.5):
        plant.run(machine, p2900=value)
        assert result(machine) == GOOD
        assert machine["status"] == 0
        assert plant.drive.objects[2][2900].values == [struct.pack(">f", value)]
        plant.cycle(machine, start=False)
    assert [each[0] for each in plant.sent] == [1, 2]
    assert plant.jobs["WRREC"].started == 2
    assert plant.jobs["RDREC"].started == 2 * (1 + polls)


def test_without_an_input_the_block_sends_what_the_line_says():
    plant = Plant()
    plant.run(plant.machine(source(CHANGE)))
    assert plant.sent == [encode_request(parse_request_line(CHANGE))]


def test_start_counts_as_an_edge_and_done_stays():
    plant = Plant()
    machine = plant.run(plant.machine(source(CHANGE)))
    for _ in range(20):
        plant.cycle(machine, start=True)
        assert machine["done"]
    assert len(plant.sent) == 1


def test_values_that_change_while_it_runs_are_not_sent():
    plant = Plant(lasts=4)
    machine = plant.machine(source(CHANGE))
    plant.cycle(machine, start=True, p2900=7.0)
    while machine["busy"]:
        plant.cycle(machine, start=False, p2900=99.0, driveObject=9)
    assert result(machine) == GOOD
    assert plant.sent[0][12:] == struct.pack(">f", 7.0)


def test_the_reference_goes_from_1_to_255_and_begins_again():
    plant = Plant(lasts=0)
    machine = plant.machine(source(CHANGE))
    for _ in range(257):
        plant.run(machine)
        assert machine["done"]
    assert [each[0] for each in plant.sent] == [*range(1, 256), 1, 2]


def test_a_refused_change_says_which_parameter_and_why():
    machine = run("change axis 2 p2900=REAL:10.0 p0922=UINT:3")
    assert result(machine) == (False, REFUSED, 2, 0x6B)
    assert machine["errorNumbers"] == [-1, 0x6B]
    assert machine["error"]


def test_error_number_0_is_a_number():
    machine = run("change axis 2 p2901=REAL:10.0")
    assert result(machine) == (False, REFUSED, 1, 0)


def test_the_subindex_that_failed_is_in_error_info():
    machine = run("read axis 2 r2902[4..6]")
    assert (*result(machine), machine["errorInfo"]) == (False, REFUSED, 1, 3, 4)


def test_an_error_of_before_is_gone_with_the_next_start():
    plant = Plant()
    machine = plant.run(plant.machine(source(CHANGE)), p2900=1000.0)
    assert result(machine) == (False, REFUSED, 1, 2)
    assert result(plant.run(machine, p2900=50.0)) == GOOD


def test_another_drive_object_is_an_input():
    machine = run(CHANGE, driveObject=9)
    assert result(machine) == (False, REFUSED, 1, 0x19)


def test_a_response_that_never_comes_ends_with_the_time_limit():
    plant = Plant(lost=True)
    machine = run(CHANGE, plant, timeLimit=2000)
    assert result(machine) == (False, TIME, 0, -1)
    assert machine["status"] == NOT_READY
    assert 2000 <= plant.now <= 2200
    plant.lost = False
    assert result(plant.run(machine)) == GOOD


def test_a_response_of_the_request_before_is_not_taken():
    plant = Plant(bend=lambda data: bytes((data[0] ^ 1,)) + data[1:])
    assert result(run(CHANGE, plant)) == (False, OTHER, 0, -1)


@pytest.mark.parametrize(
    ("place", "value"), [(1, 0x01), (1, 0x42), (3, 2)], ids=["read", "vendor", "parameters"]
)
def test_a_header_that_is_not_of_this_request(place, value):
    def bend(data: bytes) -> bytes:
        return data[:place] + bytes((value,)) + data[place + 1 :]

    assert result(run(CHANGE, Plant(bend=bend))) == (False, OTHER, 0, -1)


@pytest.mark.parametrize("kept", range(12))
def test_a_response_that_is_cut(kept):
    plant = Plant(bend=lambda data: data[:kept])
    machine = run("read axis 2 r2902[0..1]", plant)
    assert result(machine) == (False, CONTENT, 0, -1)


def test_byte_1_is_looked_at_not_the_status_of_the_instructions():
    plant = Plant(bend=lambda data: data[:1] + b"\x82" + data[2:])
    machine = run(CHANGE, plant)
    assert machine["failure"] in (REFUSED, CONTENT)
    assert not machine["done"]


def test_a_drive_that_knows_no_requests_for_several_parameters():
    answer = bytes.fromhex("8002014402002100")
    plant = Plant(
        bend=lambda data: (
            data[:1] + answer[:1] + data[2:3] + b"\x01" + bytes.fromhex("440200210000")
        )
    )
    assert result(run("read axis 2 p2900 p0922", plant)) == (False, REFUSED, 1, 0x21)


@pytest.mark.parametrize(
    "status", [CHANNEL_BUSY, 0xDF80B501, OCCUPIED, 0xC080C200], ids=lambda status: f"{status:08X}"
)
def test_a_wrrec_that_is_put_off_is_repeated(status):
    plant = Plant(writes=[status] * 3)
    assert result(run(CHANGE, plant)) == GOOD
    assert len(plant.sent) == 1
    assert plant.jobs["WRREC"].started == 4


@pytest.mark.parametrize("edge", [False, True], ids=["level", "edge"])
@pytest.mark.parametrize("lasts", [0, 2])
@pytest.mark.parametrize(
    "status", [BAD_HEADER, 0xDF80B000, NO_DEVICE], ids=lambda status: f"{status:08X}"
)
def test_a_wrrec_that_fails_is_not_repeated(status, lasts, edge):
    plant = Plant(writes=[status], lasts=lasts, edge=edge)
    machine = run(CHANGE, plant)
    assert (machine["failure"], machine["status"]) == (WRITE, status)
    assert plant.jobs["RDREC"].started == 0
    assert result(plant.run(machine)) == GOOD


def test_a_rdrec_that_fails_for_another_reason():
    plant = Plant(reads=[NOT_READY, NO_DEVICE])
    machine = run(CHANGE, plant)
    assert (machine["failure"], machine["status"]) == (READ, NO_DEVICE)
    assert plant.jobs["WRREC"].started == 1


# One request at a time


def test_blocks_on_one_drive_go_one_after_the_other():
    plant = Plant(polls=2)
    machines = [plant.machine(source(f"change axis 2 p2900=REAL:{each}.0")) for each in (1, 2, 3)]
    order, open_ = [], [0, 1, 2]
    for number in range(400):
        for each, machine in enumerate(machines):
            plant.cycle(machine, start=number > 0)
            holders = [m for m in machines if m["statHasChannel"]]
            assert len(holders) <= 1
            if number and not machine["busy"] and each in open_:
                assert machine["done"]
                order.append(each)
                open_.remove(each)
    assert order == [0, 1, 2]
    assert [each[0] for each in plant.sent] == [1, 2, 3]
    assert plant.drive.objects[2][2900].values == [struct.pack(">f", 3.0)]


def test_a_late_response_to_another_block_is_not_taken():
    late: list[bytes] = []
    plant = Plant(lost=True)
    first, second = (plant.machine(source(f"read axis 2 p{each}")) for each in (2900, 1999))
    plant.bend = lambda data: late.append(data) or data
    assert plant.run(first, timeLimit=500)["failure"] == TIME
    plant.lost, plant.bend = False, lambda _: late[0]
    assert result(plant.run(second)) == (False, OTHER, 0, -1)


def test_a_channel_that_stays_in_use_ends_with_the_time_limit_and_stays_so():
    plant = Plant(in_use=True)
    machine = plant.machine(source(CHANGE))
    for number in range(200):
        plant.cycle(machine, start=number > 0, timeLimit=500)
    assert result(machine) == (False, QUEUE, 0, -1)
    assert plant.in_use
    assert not plant.sent


# Values


def test_a_read_of_values_whose_type_is_known():
    machine = run("read axis 2 p2900 r2902[1..3] p0922")
    assert result(machine) == GOOD
    assert machine["p2900"] == 1.5
    assert machine["r2902_1"] == [5.0, 10.0, 20.0]
    assert machine["p0922"] == 7


def test_a_read_of_a_value_whose_type_nobody_knows():
    machine = run("read axis 2 p1999")
    assert (machine["p1999"], machine["p1999Format"]) == (0xFFFFFFFE, 0x07)


def test_the_values_that_came_are_there_where_one_was_refused():
    machine = run("read axis 2 p2901 p2900")
    assert result(machine) == (False, REFUSED, 1, 0)
    assert machine["errorNumbers"] == [0, -1]
    assert machine["p2900"] == 1.5


def test_a_value_in_another_format_than_the_known_one_is_not_taken():
    plant = Plant()
    plant.drive.objects[2][2900] = Parameter(0x06, [b"\x00\x07"])
    assert result(run("read axis 2 p2900", plant)) == (False, CONTENT, 0, -1)
    plant.drive.objects[2][2900] = Parameter(0x43, [struct.pack(">f", 2.5)])
    assert run("read axis 2 p2900", plant)["p2900"] == 2.5


ANY = {
    "0281FF": -1, "0501FF": 255, "4101FF": 255, "0301FFFE": -2, "0601FFFE": 65534, "4201FFFE": 65534,
    "0401FFFFFFFD": -3, "0701FFFFFFFD": 0xFFFFFFFD, "4301FFFFFFFD": 0xFFFFFFFD, "080140490FDB": 3.1415927410125732,
}  # fmt: skip


@pytest.mark.parametrize(
    ("block", "value"), [(each.replace("81", "01", 1), value) for each, value in ANY.items()]
)
def test_every_format_of_up_to_32_bits_is_read_as_a_number(block, value):
    data = bytes.fromhex(block)
    plant = Plant(
        bend=lambda answer: answer[:1] + b"\x01" + answer[2:4] + data + bytes(len(data) % 2)
    )
    machine = run("read axis 2 p1999", plant)
    assert (machine["p1999"], machine["p1999Format"], machine["done"]) == (value, data[0], True)


def _answer(block: str) -> Plant:
    data = bytes.fromhex(block)
    return Plant(
        bend=lambda answer: answer[:1] + b"\x01" + answer[2:4] + data + bytes(len(data) % 2)
    )


def test_texts_and_bytes_are_read():
    assert run("read axis 2 p0919", _answer("0903414243"))["r0919"] == "ABC"
    machine = run("read axis 2 p1082.text[0]", _answer("41054d6f746f72"))
    assert bytes(machine["p1082_Text"][: machine["p1082_TextLength"]]) == b"Motor"
    machine = run("read axis 2 p61001", _answer("2001c0a80002"))
    assert bytes(machine["p61001"][: machine["p61001Length"]]) == bytes((192, 168, 0, 2))


HOSTILE = st.one_of(
    st.binary(max_size=239),
    st.lists(
        st.tuples(
            st.sampled_from([0x06, 0x08, 0x40, 0x41, 0x43, 0x44, 0x09]),
            st.integers(0, 255),
            st.binary(max_size=12),
        ),
        max_size=6,
    ).map(lambda parts: b"".join(bytes((code, count)) + raw for code, count, raw in parts)[:235]),
)
"""What stands behind the reference, or behind the header, of a response that nobody should trust."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "change axis 2 p2900=REAL:10.0 p0922=UINT:3",
        "read axis 2 p2900 p1999 r2902[1..3] r0919 p61001 p1082.text[0]",
    ],
)
@settings(max_examples=300, deadline=None)
@given(tail=HOSTILE, good=st.booleans())
def test_whatever_the_response_is_the_block_ends_and_is_done_only_with_a_good_one(line, tail, good):
    request = parse_request_line(line)
    count = len(request.addresses)

    def bend(data: bytes) -> bytes:
        head = bytes((request.request_id, 2, count)) if good else b""
        return (data[:1] + head + tail)[:240]

    machine = run(line, Plant(bend=bend, lasts=0))
    response = decode_response(bend(bytes((1,))), request)
    if machine["done"]:
        assert response.response_id == request.request_id
        assert response.parameter_count == count
        assert not any(block.error for block in response.blocks)
        assert request.request_id == 2 or len(response.blocks) == count
    if response.response_id == 0x82 and request.request_id == 2:
        assert machine["error"]


# The bytes of every format

TYPES = {
    code: row
    for code, row in spec.formats().items()
    if row.size and row.kind not in ("error", "zero")
}


def _values(row: spec.Format) -> st.SearchStrategy[Any]:
    low = -(1 << 8 * (row.size or 1) - 1) if row.pack.islower() else 0
    whole = st.integers(low, low + (1 << 8 * (row.size or 1)) - 1)
    latin = st.text(
        st.characters(max_codepoint=0xFF),
        min_size=1,
        max_size=1 if row.size == 1 and not row.whole else 9,
    )
    kinds = {
        "float": st.floats(width=32 if row.size == 4 else 64),
        "text": latin if row.whole else latin.map(lambda text: text[: row.size]),
        "octets": st.binary(min_size=row.size or 1, max_size=(row.size or 1) + 7 * row.whole).map(
            bytes.hex
        ),
        "with_status": st.binary(min_size=row.size or 1, max_size=row.size).map(bytes.hex),
    }
    return kinds.get(row.kind, whole)


@pytest.mark.parametrize("code", TYPES, ids=lambda code: TYPES[code].name)
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_the_block_makes_the_bytes_that_encode_makes(code, data):
    """Of each type a few: 31 of them are numbers, 20 octets, and those of a kind are written alike."""
    row = TYPES[code]
    count = 1 if row.whole else data.draw(st.integers(1, 3))
    values = [data.draw(_values(row)) for _ in range(count)]
    wanted = make_block(code, [str(each) if isinstance(each, int) else each for each in values])
    request = parse_request_line(f"change axis 2 p0007[5]*{wanted.value_count}=BYTE:1")
    request.blocks = [wanted]
    text = function_block(request, "a line")
    machine = Plant().machine(text)
    machine.call(start=True, hardwareId=1, channelInUse=False, channelReference=0)
    length = machine["statLength"]
    assert bytes(machine["statRequest"][:length]) == encode_request(request)


def test_a_text_may_be_shorter_than_that_of_the_line():
    plant = Plant()
    machine = plant.machine(source('change axis 2 p0007=VisibleString:"abcd"'))
    plant.cycle(machine, start=True, p0007="xyz")
    made = bytes(machine["statRequest"][: machine["statLength"]])
    assert made == encode_request(parse_request_line('change axis 2 p0007=VisibleString:"xyz"'))


def test_a_value_without_a_constant_in_scl_stands_in_the_block():
    text = source("change axis 2 p0007=REAL:NaN p0008=REAL:Infinity p0009=REAL:1e30")
    assert "Fixed in the block, as SCL has no start value or no type for it: p0007, p0008" in text
    assert "p0009 : Real := 1.0e+30;" in text


# The source


@pytest.mark.parametrize("instruction", ["WRREC", "RDREC"])
@pytest.mark.parametrize("line", [CHANGE, "read axis 2 p2900 p1999"])
def test_the_calls_are_those_of_the_documented_interface(instruction, line):
    block = parse(source(line))
    rows = {each.name: each for each in spec.instructions()[instruction]}
    (call,) = [given for name, given in block.calls if block.variables[name].type == instruction]
    assert set(call) == set(rows)
    for name, (way, actual) in call.items():
        row = rows[name]
        assert way == ("=>" if row.declaration == "Output" else ":="), name
        if row.type == "VARIANT":
            variable = block.variables[actual[1]]
            assert (variable.type, variable.bounds is not None) == ("Byte", True)
        elif actual[0] == "variable":
            assert block.variables[actual[1]].type.upper() == row.type, name
        else:
            assert (name, row.type, actual[:2]) == ("REQ", "BOOL", ("binary", "="))


INTERFACE = {
    "WRREC": "REQ:Input:BOOL ID:Input:HW_IO INDEX:Input:DINT LEN:Input:UINT DONE:Output:BOOL BUSY:Output:BOOL"
    " ERROR:Output:BOOL STATUS:Output:DWORD RECORD:InOut:VARIANT",
    "RDREC": "REQ:Input:BOOL ID:Input:HW_IO INDEX:Input:DINT MLEN:Input:UINT VALID:Output:BOOL BUSY:Output:BOOL"
    " ERROR:Output:BOOL STATUS:Output:DWORD LEN:Output:UINT RECORD:InOut:VARIANT",
}  # fmt: skip
"""As the help of STEP 7 prints it, typed a second time."""


@pytest.mark.parametrize("name", INTERFACE)
def test_the_table_of_the_interface(name):
    rows = spec.instructions()[name]
    assert " ".join(f"{row.name}:{row.declaration}:{row.type}" for row in rows) == INTERFACE[name]
    assert all(
        row.sources and set(row.sources) <= set(spec._load("instructions.toml")["sources"])
        for row in rows
    )


def test_comments_are_in_both_languages_and_the_code_is_the_same():
    english, chinese = source(CHANGE), source(CHANGE, "zh")
    assert scl_machine.tokens(english) == scl_machine.tokens(chinese)
    assert "Not compiled in TIA Portal" in english
    assert "未在 TIA Portal 中编译" in chinese
    comments = re.findall(r"//(.*)", chinese)
    assert not [text for text in comments if re.search(r"\b(the|is|of)\b", text)]


def test_the_source_has_the_version_and_the_line(capsys):
    assert main(["encode", "-f", "scl-fb", CHANGE]) == 0
    out, _ = capsys.readouterr()
    assert f"// Generated by ds47 {__version__}.\n" in out
    assert "// Request: change ref 1 axis 2 p2900=Float32:10.0\n" in out
    assert 'FUNCTION_BLOCK "Change_p2900"' in out


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("0x51 axis 2 p0010", "of a read or a change, not of another request"),
        ("pkw read p2010[1]", "not of PKW"),
        ("change p0001=OctetString:" + "00" * 240, "240 at the most"),
    ],
)
def test_what_no_block_is_made_of(line, says, capsys):
    assert main(["encode", "-f", "scl-fb", line]) == 2
    out, err = capsys.readouterr()
    assert (out, says in err) == ("", True)


def test_no_line_of_a_request_can_leave_its_comment():
    request = parse_request_line(CHANGE)
    text = function_block(request, "change p1\n#start := TRUE;\x85// \u2028x")
    assert parse(text).name == "Change_p2900"
    assert scl_machine.tokens(text) == scl_machine.tokens(source(CHANGE))


def test_the_same_parameter_twice_has_two_names():
    block = parse(source("change axis 2 p0007=INT:1 p0007=INT:2 p0007[1]=INT:3 p0007.0x80=INT:4"))
    inputs = [name for name, each in block.variables.items() if each.section == "VAR_INPUT"]
    assert [name for name in inputs if name.startswith("p0007")] == [
        "p0007",
        "p0007_b",
        "p0007_1",
        "p0007_0x80",
    ]


# The interpreter itself: it notices what a compiler would


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("#tempDWord := REAL_TO_DWORD(#p2900);", "#tempDWord := #p2900;"),
        ("#tempDWord := REAL_TO_DWORD(#p2900);", "#tempWord := REAL_TO_DWORD(#p2900);"),
        ("#tempDWord.%B3;", "#tempDWord.%B4;"),
        ("#statLength := INT_TO_UINT(#tempAt);", "#statLength := #tempAt;"),
        ("#statRequest[1] := 16#02;", "#statRequest[16] := 16#02;"),
        ("#statRequest[1] := 16#02;", "#p2900 := 1.0;"),
        ("#channelReference MOD 255", "#channelReference MOD TRUE"),
        ("LEN := #statLength,", "LEN := #tempAt,"),
        ("MLEN := #LONGEST,", ""),
        ("#tempDWord := REAL_TO_DWORD(#p2900);", ""),
    ],
)  # fmt: skip
def test_the_interpreter_notices_what_a_compiler_would(old, new):
    text = source(CHANGE)
    assert old in text
    with pytest.raises(SclError):
        Plant().run(Plant().machine(text.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new"),
    [("END_IF;", "END_IF"), (":= 10.0;", ":= 10.0"), ("CASE ", "CASES "), ("OF\n", "\n")],
)
def test_what_is_no_scl_is_not_parsed(old, new):
    with pytest.raises(SclError):
        parse(source(CHANGE).replace(old, new, 1))
