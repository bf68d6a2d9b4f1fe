"""S7: PDUs of printed and captured vectors, jobs, transfers, connections, what TCP does, broken bytes, bounds."""

from __future__ import annotations

import json
import random
import struct
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from frames import pcap
from hypothesis import given, settings
from hypothesis import strategies as st
from s7_segments import (
    ACK,
    PSH,
    RST,
    SYN,
    Talk,
    agreed,
    answer,
    bsend,
    capture,
    connect,
    dt,
    entry,
    get,
    got,
    header,
    item,
    job,
    put,
    received,
    result,
    setup,
    taken,
    tpkt,
)

from ds47.analysis import AnalysisOptions
from ds47.model import CaptureResult, Transaction
from ds47.profinet.link import Packet
from ds47.report import contract, schema
from ds47.report import json as report
from ds47.report.contract import TRANSACTION
from ds47.s7 import addresses, pdu
from ds47.s7 import tpkt as iso
from ds47.s7.choices import Choices
from ds47.s7.communication import Communication
from ds47.s7.model import At, S7Address
from ds47.s7.tcp import TcpPiece
from ds47.spec import s7
from ds47.spec.semantics import limits

READ = item(1, 0, 4)


# The vectors: what a PDU says


def vectors(shared: Path) -> list[dict[str, Any]]:
    known = json.loads((shared / "reference" / "channel_vectors.json").read_text("utf-8"))
    return [each for each in known["vectors"] if each["row"] == 19]


def told(data: bytes) -> dict[str, Any]:
    """What the bytes of a vector say, in its words."""
    found = pdu.decode(iso.decode(data[4:], 4).data)
    assert found.flaws == []
    say: dict[str, Any] = {"rosctr": found.kind, "pduref": found.reference, "func": found.function}
    if found.function == pdu.SETUP:
        agreement = pdu.setup(found)
        assert agreement is not None
        say |= {"pdu": agreement.pdu_length, "maxamq": [agreement.calling, agreement.called]}
    elif found.kind == pdu.JOB:
        say["items"] = [
            {"area": each.address.area, "db": each.address.db, "byte": each.address.start // 8,
             "bytes": each.address.length}
            for each in pdu.variables(found).items if each.address
        ]  # fmt: skip
    elif found.kind == pdu.ANSWER:
        say["results"] = [
            {"code": each.code, "bytes": (each.data or b"").hex()} for each in pdu.results(found)
        ]
    else:
        say |= of_programs(found)
    assert found.flaws == []
    return say


def of_programs(found: pdu.S7Pdu) -> dict[str, Any]:
    sent, data = pdu.usend(found), pdu.user_data(found)
    assert (sent is None) != (data is None)
    if sent is not None:
        return {"r_id": sent.r_id, "areas": [each.hex() for each in sent.areas]}
    assert data is not None
    say: dict[str, Any] = {"group": data.group, "subfunc": data.subfunction, "seq": data.sequence}
    part = pdu.segment(found, data) if data.type == pdu.REQUEST else None
    if part is None:
        return say | {"error": data.error}
    say |= {"r_id": part.r_id, "idseq": part.number, "last": part.last, "payload": part.data.hex()}
    say["first"] = part.total is not None
    return say if part.total is None else say | {"total": part.total}


def test_the_vectors_of_the_reference(shared: Path) -> None:
    found = vectors(shared)
    assert len(found) == 10
    for each in found:
        say = told(bytes.fromhex(each["hex"]))
        assert {key: say[key] for key in each["expect"]} == each["expect"], each["id"]


@pytest.mark.parametrize(
    ("address", "text"),
    [
        (S7Address(0x84, 1, 0, 8, 444), "DB1.DBB0..443"),
        (S7Address(0x84, 1, 8, 8, 1), "DB1.DBB1"),
        (S7Address(0x84, 5, 16, 16, 1, 4), "DB5.DBW2"),
        (S7Address(0x84, 5, 32, 32, 2, 8), "DB5.DBB4..11"),
        (S7Address(0x84, 5, 19, 1, 1, 1), "DB5.DBX2.3"),
        (S7Address(0x84, 5, 19, 1, 3, 1), "P#DB5.DBX2.3 BIT 3"),
        (S7Address(0x84, 5, 19, 8, 3), "P#DB5.DBX2.3 BYTE 3"),
        (S7Address(0x85, 3, 0, 16, 1, 5), "DI3.DIW0"),
        (S7Address(0x83, 0, 83, 1, 1, 1), "M10.3"),
        (S7Address(0x81, 0, 0, 8, 16), "IB0..15"),
        (S7Address(0x80, 0, 2048, 16, 1, 4), "PW256"),
        (S7Address(0x1D, 0, 7, 16, 1, 0x1D), "T7"),
        (S7Address(0x1C, 0, 7, 16, 3, 0x1C), "C7..9"),
        (S7Address(0x42, 0, 8, 8, 2), "area 42, P#1.0 BYTE 2"),
        (S7Address(0x84, 1, 8, 0, 2, 0x77), "P#DB1.DBX1.0 size 77 2"),
    ],
)
def test_the_notation_of_an_address(address: S7Address, text: str) -> None:
    assert addresses.text(address) == text


def test_what_a_pdu_holds_is_the_table_of_the_manual() -> None:
    assert [s7.room("get", size) for size in (240, 480, 960)] == [222, 462, 942]
    assert [s7.room(use, size) for use in ("put", "usend") for size in (240, 480, 960)] == [
        212, 452, 932, 212, 452, 932,
    ]  # fmt: skip


# Jobs and answers


def one(data: bytes, options: AnalysisOptions | None = None) -> Transaction:
    (found,) = result(data, options).transactions
    return found


def values(item_: Transaction) -> list[tuple[str | None, bytes | None, int | None]]:
    return [(each.address, each.value, each.code) for each in item_.items]


def test_a_read_has_its_values_its_times_and_its_frames() -> None:
    talk = (
        Talk()
        .opened()
        .ask(get(7, READ, item(0, 80, 1, 0x83, 1)), got(7, entry(b"abcd"), entry(b"\1", 0xFF, 3)))
    )
    found = one(capture(talk))
    assert (found.channel, found.operation, found.state) == ("s7", "get", "ok")
    assert (found.controller, found.device, found.request_reference) == ("10.0.0.1", "10.0.0.2", 7)
    assert values(found) == [("DB1.DBB0..3", b"abcd", 255), ("M10.0", b"\1", 255)]
    assert (found.frames.write_request, found.frames.read_response) == (8, 9)
    assert found.duration_ns == 1_000_000_000
    assert found.request == get(7, READ, item(0, 80, 1, 0x83, 1))
    assert found.connection == 1


def test_a_write_has_what_was_written() -> None:
    talk = Talk().opened().ask(put(9, READ, b"wxyz"), taken(9, 255))
    found = one(capture(talk))
    assert (found.operation, found.state, values(found)) == (
        "put",
        "ok",
        [("DB1.DBB0..3", b"wxyz", 255)],
    )


def test_the_length_of_an_item_that_failed_says_nothing() -> None:
    """One stack sends 4 there, another one 0, and bytes never follow."""
    for length in (b"\0\4", b"\0\0", b"\xff\xff"):
        talk = Talk().opened().ask(get(1, READ, READ), got(1, b"\x0a\0" + length, entry(b"abcd")))
        found = one(capture(talk))
        assert (found.state, values(found)) == (
            "partial", [("DB1.DBB0..3", None, 10), ("DB1.DBB0..3", b"abcd", 255)],
        )  # fmt: skip


def test_items_of_odd_length_have_a_fill_byte_but_the_last() -> None:
    first, second, third = item(1, 0, 1), item(1, 8, 3), item(1, 32, 1)
    talk = (
        Talk()
        .opened()
        .ask(get(1, first, second, third), got(1, entry(b"a"), entry(b"bcd"), entry(b"e")))
    )
    assert [each.value for each in one(capture(talk)).items] == [b"a", b"bcd", b"e"]


def test_states_of_a_job() -> None:
    def state(told: bytes | None) -> tuple[str, int | None]:
        found = one(capture(Talk().opened().ask(get(1, READ), told)))
        return found.state, found.error

    assert state(got(1, entry(b"abcd"))) == ("ok", 0)
    assert state(got(1, b"\x05\0\0\0")) == ("error", 0)
    assert state(answer(1, b"", error=0x8500)) == ("refused", 0x8500)
    assert state(header(2, 1, b"", b"", 0x8104)) == ("refused", 0x8104)
    assert state(None) == ("incomplete", None)  # the capture ends before an answer


def test_an_answer_without_a_job_is_an_orphan() -> None:
    found = one(capture(Talk().opened().say(False, dt(got(4, entry(b"abcd"))))))
    assert (found.state, found.operation, values(found)) == (
        "orphan",
        "get",
        [(None, b"abcd", 255)],
    )
    assert (found.controller, found.device) == ("10.0.0.1", "10.0.0.2")


def test_references_have_no_order_and_may_be_used_again() -> None:
    talk = Talk().opened(pdu=480)
    talk.say(True, dt(get(0x500, READ)) + dt(get(0x100, READ)))
    talk.say(False, dt(got(0x100, entry(b"1111"))) + dt(got(0x500, entry(b"5555"))))
    talk.ask(get(0x100, READ), got(0x100, entry(b"2222")))
    found = result(capture(talk)).transactions
    assert [(each.request_reference, each.items[0].value) for each in found] == [
        (0x500, b"5555"), (0x100, b"1111"), (0x100, b"2222"),
    ]  # fmt: skip


def test_a_job_ends_the_open_one_of_its_reference() -> None:
    talk = Talk().opened().ask(get(3, READ)).ask(get(3, READ), got(3, entry(b"abcd")))
    assert [each.state for each in result(capture(talk)).transactions] == ["unanswered", "ok"]


def test_an_answer_of_another_function_is_not_taken() -> None:
    talk = Talk().opened().ask(get(3, READ), taken(3, 255)).say(False, dt(got(3, entry(b"abcd"))))
    assert [(each.operation, each.state) for each in result(capture(talk)).transactions] == [
        ("get", "ok"), ("put", "orphan"),
    ]  # fmt: skip


def test_both_ends_may_ask() -> None:
    talk = Talk().opened().ask(get(3, READ)).say(False, dt(get(3, READ)))
    talk.say(True, dt(got(3, entry(b"up.."))))
    talk.say(False, dt(got(3, entry(b"down"))))
    found = result(capture(talk)).transactions
    assert [(each.controller, each.items[0].value) for each in found] == [
        ("10.0.0.1", b"down"), ("10.0.0.2", b"up.."),
    ]  # fmt: skip


DB_READ = bytes.fromhex("120eb0 02 200001 0000 040001 0020".replace(" ", ""))


@pytest.mark.parametrize(
    "told",
    [(entry(bytes(range(36))),), (entry(bytes(range(32))), entry(bytes(range(32, 36))))],
    ids=["one entry", "an entry for each"],
)
def test_an_address_of_several_areas(told: tuple[bytes, ...]) -> None:
    """Syntax B0: an answer has one entry for all, or one for each."""
    address = DB_READ[:1] + bytes((len(DB_READ) - 2,)) + DB_READ[2:]
    found = one(capture(Talk().opened().ask(get(1, address), got(1, *told))))
    assert values(found) == [
        ("DB1.DBB0..31", bytes(range(32)), 255), ("DB1.DBB32..35", bytes(range(32, 36)), 255),
    ]  # fmt: skip


def test_an_unknown_address_is_left_as_it_is() -> None:
    symbol = bytes.fromhex("120ab20000000000000000ff")
    found = one(capture(Talk().opened().ask(get(1, symbol), got(1, entry(b"ab")))))
    assert (found.state, values(found)) == ("ok", [(None, b"ab", 255)])


# Connections


def test_what_a_connection_agreed_on() -> None:
    talk = Talk().opened(pdu=480).ask(get(1, READ), got(1, entry(b"abcd")))
    talk.ask(put(2, READ, b"wxyz"), taken(2, 255)).ask(get(3, READ), got(3, b"\x05\0\0\0")).ask(
        get(4, READ)
    )
    (found,) = result(capture(talk)).connections
    assert (found.client, found.client_port, found.server, found.server_port) == (
        "10.0.0.1",
        49152,
        "10.0.0.2",
        102,
    )
    assert (found.client_tsap, found.server_tsap, found.rack, found.slot) == (
        b"\1\0",
        b"\1\2",
        0,
        2,
    )
    assert (found.pdu_length, found.parallel, found.most_open, found.setup) == (480, 1, 1, 7)
    assert (found.jobs, found.refused, found.unanswered, found.orphans) == (4, 1, 0, 0)
    assert (found.read_bytes, found.written_bytes) == (4, 4)
    assert found.answer is not None
    assert found.answer.mean_ns == 1_000_000_000


def test_a_new_connection_on_the_same_ports_is_another_one() -> None:
    first = Talk().opened().ask(get(1, READ))
    second = Talk(up=70_000, down=90_000).opened(pdu=960).ask(get(1, READ), got(1, entry(b"abcd")))
    found = result(capture(first, second))
    assert [each.pdu_length for each in found.connections] == [240, 960]
    assert [(each.state, each.connection) for each in found.transactions] == [
        ("unanswered", 1),
        ("ok", 2),
    ]


def test_a_connection_without_beginning_and_one_that_was_never_closed() -> None:
    talk = Talk().ask(get(1, READ), got(1, entry(b"abcd")))
    found = result(capture(talk))
    assert [each.state for each in found.transactions] == ["ok"]
    assert found.connections[0].pdu_length is None


def test_several_connections_at_once() -> None:
    talks = [
        Talk(client=("10.0.0.1", 50_000 + port))
        .opened()
        .ask(get(1, READ), got(1, entry(bytes([port] * 4))))
        .closed()
        for port in range(20)
    ]
    mixed = [talk.frame(shot) for shots in zip(*(t.shots for t in talks), strict=True) for talk, shot in
             zip(talks, shots, strict=True)]  # fmt: skip
    found = result(pcap(mixed))
    assert [each.items[0].value for each in found.transactions] == [
        bytes([port] * 4) for port in range(20)
    ]
    assert len(found.connections) == 20


def test_another_port_is_looked_at_where_it_is_named() -> None:
    talk = Talk(server=("10.0.0.2", 1102)).opened().ask(get(1, READ), got(1, entry(b"abcd")))
    assert result(capture(talk)).transactions == []
    options = AnalysisOptions(s7=Choices(ports=(1102,)))
    assert [each.state for each in result(capture(talk), options).transactions] == ["ok"]


def test_s7_is_left_out_where_nobody_wants_it() -> None:
    talk = Talk().opened().ask(get(1, READ), got(1, entry(b"abcd")))
    found = result(capture(talk), AnalysisOptions(channels=("ds47", "pkw", "pzd")))
    assert (found.transactions, found.connections, found.findings) == ([], [], [])


def test_another_protocol_on_its_port_is_none() -> None:
    mms = (
        Talk()
        .opened(pdu=None)
        .say(True, dt(b"\x60\x10" + bytes(20)))
        .say(False, dt(b"\x61\x10" + bytes(20)))
    )
    assert result(capture(mms)).connections == []
    plus = Talk().opened(pdu=None).say(True, dt(b"\x72\x01" + bytes(20)))
    (found,) = result(capture(plus)).connections
    assert (found.plus, found.jobs) == (1, 0)


# BSEND and USEND


def test_a_bsend_is_one_transaction_with_its_segments() -> None:
    whole = bytes(range(256)) * 2
    talk = Talk().opened()
    talk.ask(bsend(1, 9, whole[:204], total=512, last=False), received(1, 5))
    talk.ask(bsend(2, 9, whole[204:410], sequence=5, number=1, last=False), received(2, 5))
    talk.ask(bsend(3, 9, whole[410:], sequence=5, number=2), received(3, 5))
    found = one(capture(talk))
    assert (found.operation, found.state, found.r_id) == ("bsend", "ok", 9)
    assert [each.value for each in found.items] == [whole]
    assert [tuple(each) for each in found.segments] == [(8, 9), (10, 11), (12, 13)]
    assert (found.frames.write_request, found.frames.read_response) == (8, 13)
    assert found.duration_ns == 5_000_000_000


def test_states_of_a_bsend() -> None:
    def state(*said: tuple[bytes, bytes | None]) -> str:
        talk = Talk().opened()
        for asked, told in said:
            talk.ask(asked, told)
        return one(capture(talk)).state

    assert state((bsend(1, 9, b"ab"), received(1, 1))) == "ok"
    assert state((bsend(1, 9, b"ab", total=3), received(1, 1))) == "partial"
    assert state((bsend(1, 9, b"ab"), received(1, 1, 0xD209))) == "refused"
    assert state((bsend(1, 9, b"ab"), None)) == "incomplete"
    assert state((bsend(1, 9, b"ab", total=3, last=False), received(1, 1))) == "incomplete"
    assert state((bsend(1, 9, b"ab", sequence=3), received(1, 3))) == "orphan"


def test_two_bsend_at_once_are_known_by_their_r_id() -> None:
    talk = Talk().opened()
    talk.ask(bsend(1, 1, b"one ", total=8, last=False)).ask(
        bsend(2, 2, b"two ", total=8, last=False)
    )
    talk.say(False, dt(received(2, 4))).say(False, dt(received(1, 3)))
    talk.ask(bsend(3, 2, b"more", sequence=4, number=1), received(3, 4))
    talk.ask(bsend(4, 1, b"rest", sequence=3, number=1), received(4, 3))
    found = result(capture(talk)).transactions
    assert [(each.r_id, each.state, each.items[0].value) for each in found] == [
        (1, "ok", b"one rest"), (2, "ok", b"two more"),
    ]  # fmt: skip


def test_a_usend_has_up_to_four_areas_and_no_answer() -> None:
    areas = (entry(b"a", 0), entry(b"bc", 0, 9), entry(b"d" * 5, 0), entry(b"ef", 0))
    parts = struct.pack(">BBBBBBI", 0, 1, 0x12, 6, 0x13, 0, 0x12345678)
    data = b"\xff\x09\0\4" + b"".join(each + bytes(len(each) % 2) for each in areas[:3]) + areas[3]
    found = one(capture(Talk().opened().say(True, dt(header(7, 1, parts, data)))))
    assert (found.operation, found.state, found.r_id) == ("usend", "ok", 0x12345678)
    assert [each.value for each in found.items] == [b"a", b"bc", b"ddddd", b"ef"]
    assert (found.duration_ns, found.frames.all()) == (None, [8])


# TCP: whatever it does to the segments, the transactions are the same


def conversation() -> Talk:
    """Reads, writes and a BSEND, answered and not, with PDUs in several TPDUs."""
    talk = Talk().opened(pdu=240)
    for number in range(1, 12):
        value = bytes([number]) * 4
        talk.say(True, dt(get(number, READ), 1 + number % 3)).say(
            False, dt(got(number, entry(value)), number % 2 + 1)
        )
    talk.say(True, dt(get(50, READ)) + dt(put(51, READ, b"\x03\0\0\x1f")) + dt(get(52, READ)))
    talk.say(False, dt(taken(51, 255)) + dt(got(52, entry(b"abcd"))) + dt(got(50, b"\5\0\0\0")))
    talk.ask(bsend(60, 7, bytes(200), total=300, last=False), received(60, 1))
    talk.ask(bsend(61, 7, bytes(100), sequence=1, number=1), received(61, 1))
    return talk.ask(get(62, READ)).closed()


def gist(found: CaptureResult) -> list[tuple[Any, ...]]:
    return sorted(
        (each.operation, each.state, each.request_reference, values(each), each.request, each.response)
        for each in found.transactions
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    sizes=st.lists(st.integers(1, 90), min_size=1, max_size=6),
    seed=st.integers(0, 1 << 20),
    copies=st.integers(0, 30),
)
def test_segments_may_be_cut_repeated_and_out_of_order(
    sizes: list[int], seed: int, copies: int
) -> None:
    talk, chance = conversation(), random.Random(seed)
    cut = talk.cut(sizes)
    shots = list(cut.shots)
    for _ in range(copies):
        at = chance.randrange(len(shots))
        shots.insert(chance.randrange(at, len(shots)) + 1, shots[at])
    runs: list[list[Any]] = [[]]
    for shot in shots:  # between two turns of speaking anything may overtake anything
        if runs[-1] and (runs[-1][-1].up != shot.up or shot.flags & SYN or not shot.data):
            runs.append([])
        runs[-1].append(shot)
    mixed = [shot for run in runs for shot in chance.sample(run, len(run))]
    changed = replace(cut, shots=mixed)
    told = result(capture(changed, apart_s=0))  # a job that is open for a minute has no answer
    assert gist(told) == gist(result(capture(talk)))


def test_a_retransmission_with_other_borders_is_read_once() -> None:
    talk = Talk().opened()
    place = talk.up
    first, second = dt(get(1, READ)), dt(get(2, READ))
    talk.say(True, first).say(True, second)
    talk.shots.append(replace(talk.shots[-1], sequence=place, data=first + second[:5]))
    talk.say(False, dt(got(1, entry(b"1111")))).say(False, dt(got(2, entry(b"2222"))))
    assert [each.state for each in result(capture(talk)).transactions] == ["ok", "ok"]


def test_a_lost_segment_costs_what_stood_in_it() -> None:
    """The other side has acknowledged it: nobody sends it again."""
    talk = Talk().opened()
    for number in range(1, 7):
        talk.ask(get(number, READ), got(number, entry(bytes([number]) * 4)))
    lost = [shot for shot in talk.shots if shot.data != dt(get(3, READ))]
    found = result(capture(replace(talk, shots=lost)))
    assert [(each.request_reference, each.state) for each in found.transactions] == [
        (1, "ok"), (2, "ok"), (3, "orphan"), (4, "ok"), (5, "ok"), (6, "ok"),
    ]  # fmt: skip
    assert found.connections[0].lost_bytes == len(dt(get(3, READ)))


def test_an_answer_whose_acknowledgement_came_first_is_taken() -> None:
    """The recording saw the acknowledgement, and the segment only when it was sent again."""
    talk = Talk().opened().ask(get(1, READ), got(1, entry(b"abcd"))).add(True, b"", ACK)
    talk.shots[-1], talk.shots[-2] = talk.shots[-2], talk.shots[-1]
    assert [each.state for each in result(capture(talk)).transactions] == ["ok"]


def test_what_was_given_up_and_comes_late_is_read_alone() -> None:
    talk = Talk().opened().ask(get(1, READ)).ask(get(2, READ))
    talk.say(False, dt(got(2, entry(b"2222"))))
    *before, first, second, told = talk.shots
    late = replace(talk, shots=[*before, second, told, first])
    late.say(False, dt(got(1, entry(b"1111"))))
    assert [(each.request_reference, each.state) for each in result(capture(late)).transactions] == [
        (2, "ok"), (1, "ok"),
    ]  # fmt: skip


def test_parts_without_data_keep_nothing() -> None:
    """However many there are; a PDU in as many frames as bytes costs no more than each of them."""
    reader = iso.TpduReader()
    for number in range(2000):
        assert list(reader.take(TcpPiece(tpkt(b"\x02\xf0\0"), At(number + 1, 0)))) == []
    assert reader.held == 0
    assert not reader._parts_frames
    data = dt(b"\x32" + bytes(3000))
    found = [
        whole
        for number in range(len(data))
        for whole in reader.take(TcpPiece(data[number : number + 1], At(number + 1, 0)))
    ]
    assert [whole.frames for whole in found] == [list(range(1, len(data) + 1))]


def test_a_reader_finds_its_place_again() -> None:
    """A capture begins within a PDU; what looks like a TPKT in the data is none."""
    value = b"\x03\x00\x00\x1f\x02\xf0"
    talk = Talk()
    whole = dt(got(9, entry(value * 20)))
    talk.say(False, whole[30:]).ask(get(1, READ), got(1, entry(b"abcd")))
    assert [
        (each.request_reference, each.state) for each in result(capture(talk)).transactions
    ] == [(1, "ok")]


def test_a_frame_that_the_capture_cut_costs_no_more_than_itself() -> None:
    talk = Talk().opened()
    for number in range(1, 5):
        talk.ask(get(number, READ), got(number, entry(bytes(150))))
    found = result(pcap(talk.frames(), snap=150))
    assert [each.state for each in found.transactions] == ["incomplete"] * 4
    assert found.connections[0].lost_bytes > 0


# What is refused


def cases(found: CaptureResult) -> list[Any]:
    return [each.args["case"] for each in found.findings if each.rule == "DS917"]


def test_connections_that_come_to_nothing() -> None:
    alone = Talk().opened(cotp=False, pdu=None).say(True, connect())
    assert cases(result(capture(alone))) == []  # CC may come behind the capture
    refused = Talk().opened(cotp=False, pdu=None).say(True, connect())
    refused.say(False, tpkt(bytes.fromhex("068000010000 80".replace(" ", ""))))
    assert cases(result(capture(refused))) == ["refused_disconnect"]
    reset = Talk().opened(cotp=False, pdu=None).say(True, connect()).add(False, b"", RST)
    assert cases(result(capture(reset))) == ["refused_reset"]
    for flags in (RST, RST | ACK):  # the client itself: nobody refused anything
        tried = Talk().opened(cotp=False, pdu=None).add(True, b"", flags)
        assert cases(result(capture(tried))) == []
        assert result(capture(tried)).connections == []
    gone = Talk().opened(cotp=False, pdu=None).say(True, connect()).add(True, b"", RST)
    assert cases(result(capture(gone))) == ["refused_no_confirm"]
    closed = Talk().add(True, b"", SYN).add(False, b"", RST | ACK)
    assert cases(result(capture(closed))) == ["refused_reset_tcp"]
    setup_ = Talk().opened(pdu=None).ask(setup(5), answer(5, b"", error=0x8104))
    assert cases(result(capture(setup_))) == ["refused_setup"]
    good = Talk().opened().ask(get(1, READ), got(1, entry(b"abcd"))).add(True, b"", RST)
    assert cases(result(capture(good))) == []


# Broken bytes


@settings(max_examples=300, deadline=None)
@given(
    st.binary(max_size=200), st.sampled_from([b"", b"\x32", b"\x32\x01", b"\x32\x03", b"\x32\x07"])
)
def test_bytes_are_never_an_exception(data: bytes, front: bytes) -> None:
    found = pdu.decode(front + data)
    pdu.setup(found)
    pdu.variables(found)
    pdu.results(found)
    pdu.usend(found)
    told_ = pdu.user_data(found)
    if told_ is not None:
        pdu.segment(found, told_)
    iso.decode(data)
    for each in found.flaws:
        assert s7.flaw_text(each.kind, each.args)
        assert 0 <= each.offset <= len(front + data) + 65_535


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_a_damaged_byte_costs_the_frames_that_it_touches(data: st.DataObject) -> None:
    """Whatever stands in one segment, the jobs of later ones are read."""
    talk = Talk().opened()
    for number in range(1, 6):
        talk.ask(get(number, READ), got(number, entry(bytes([number]) * 4)))
    at = data.draw(st.integers(7, 8))
    place = data.draw(st.integers(0, len(talk.shots[at].data) - 1))
    broken = bytearray(talk.shots[at].data)
    broken[place] = data.draw(st.integers(0, 255))
    talk.shots[at] = replace(talk.shots[at], data=bytes(broken))
    found = result(capture(talk))
    states = {each.request_reference: each.state for each in found.transactions}
    whole = [number for number in range(2, 6) if states.get(number) == "ok"]
    length, ends = (2, 3), 6  # both may join it with what follows; TCP damages no byte
    assert whole == [2, 3, 4, 5] or place in length or (place == ends and whole[-2:] == [4, 5]), (
        states
    )


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 40), st.binary(max_size=80), st.integers(0, 63)), max_size=40)
)
def test_hostile_segments(rows: list[tuple[int, bytes, int]]) -> None:
    talk = Talk().opened().ask(get(1, READ), got(1, entry(b"abcd")))
    for jump, data, flags in rows:
        talk.add(bool(flags & 32), data, flags & 31)
        talk.up = (talk.up + jump * 1000) & 0xFFFF_FFFF
    found = result(capture(talk))
    assert any(each.state == "ok" for each in found.transactions)
    report.text(report.capture(found))


# How much is kept


@pytest.mark.slow
def test_memory_does_not_grow_with_the_capture() -> None:
    """Connections without number, holes that nobody fills, jobs and BSEND without end."""

    def most(count: int) -> int:
        bounds = limits().but(
            s7_connections=64, s7_told=64, s7_transfers=8, s7_notes=32, s7_memories=8
        )
        connections = Communication(Choices(), bounds, lambda *_: None, lambda _: None)
        tracemalloc.start()
        try:
            for number in range(count):
                for frame in hostile(number):
                    connections.packet(frame)
            connections.finish()
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    most(1200)  # fills what is remembered once
    few, many = most(200), most(1200)
    assert many < few * 1.3, (few, many)


def hostile(number: int) -> list[Packet]:
    """A connection with a hole, a TPKT that never ends, a job and a BSEND."""
    talk = Talk(client=("10.0.0.1", 1024 + number % 60_000), up=number * 7919, down=number).opened(
        pdu=960
    )
    talk.say(False, dt(bsend(number & 0xFFFF, number, bytes(900), total=60_000, last=False)))
    talk.say(True, dt(get(number & 0xFFFF, *[READ] * 20)))
    talk.up += 100
    talk.say(True, dt(get(number + 1 & 0xFFFF, *[READ] * 20)))
    talk.say(False, b"\x03\0\xff\xff\x02\xf0\x80\x32" + bytes(400))
    return [
        Packet(
            "tcp",
            at,
            at,
            frame[34:],
            src_ip=".".join(map(str, frame[26:30])),
            dst_ip=".".join(map(str, frame[30:34])),
        )
        for at, frame in enumerate(talk.frames(), 20 * number + 1)
    ]


def test_a_direction_keeps_no_more_than_its_window() -> None:
    talk = Talk().opened()
    talk.up += 10
    for _ in range(200):
        talk.say(True, bytes(1400))
    talk.say(True, dt(get(7, READ))).say(False, dt(got(7, entry(b"abcd"))))
    assert [each.state for each in result(capture(talk)).transactions] == ["ok"]


def test_open_jobs_are_bounded() -> None:
    bounds = limits()
    talk = Talk().opened()
    talk.say(True, b"".join(dt(get(number + 1, READ)) for number in range(bounds.s7_jobs * 2)))
    found = result(capture(talk))
    assert len(found.transactions) == bounds.s7_jobs * 2
    assert found.connections[0].most_open == bounds.s7_jobs + 1


# The contract


def test_the_result_holds_to_its_schema_and_comes_back() -> None:
    found = result(capture(conversation()))
    plain = json.loads(report.text(report.capture(found)))
    document = report.document(type("R", (), {"captures": [found]})())  # type: ignore[arg-type]
    jsonschema.validate(json.loads(report.text(document)), schema())
    again = contract.CAPTURE.load(plain | {"problem": None, "dropped": None})
    assert again.connections == found.connections
    assert report.capture(again)["transactions"] == plain["transactions"]
    assert again.transactions[0].items == found.transactions[0].items
    assert plain["connections"][0]["server_tsap"] == "0102"


def test_transactions_of_other_channels_have_no_keys_of_s7() -> None:
    names = {key.name for key in contract.TRANSACTION.keys if key.channel}
    assert names == {"connection", "items", "r_id", "error", "segments"}
    found = one(capture(Talk().opened().ask(get(1, READ), got(1, entry(b"abcd")))))
    assert names <= TRANSACTION.plain(found).keys()
    found.channel = "pkw"
    assert not names & TRANSACTION.plain(found).keys()
    assert json.loads(report.transaction_line(found)) == TRANSACTION.plain(found)


def test_user_data_that_is_no_bsend_is_counted() -> None:
    cyclic = header(
        7, 1, bytes.fromhex("0001120811420100 00000000".replace(" ", "")), b"\x0a\0\0\0"
    )
    clock = header(7, 1, bytes.fromhex("0001120411470100"), b"\x0a\0\0\0")
    stop = job(5, b"\x29" + bytes(5) + b"\x09P_PROGRAM")
    talk = Talk().opened().say(True, dt(cyclic)).say(True, dt(clock)).say(True, dt(stop))
    (found,) = result(capture(talk)).connections
    assert (found.cyclic, found.other, found.jobs) == (1, 2, 0)


def test_the_setup_is_that_of_the_answer() -> None:
    talk = Talk().opened(pdu=None).ask(setup(1, 960, 8), agreed(1, 240, 2))
    (found,) = result(capture(talk)).connections
    assert (found.pdu_length, found.parallel) == (240, 2)


def test_flags_of_a_push_matter_to_nobody() -> None:
    talk = Talk().opened()
    talk.add(True, dt(get(1, READ)), ACK).add(False, dt(got(1, entry(b"abcd"))), PSH | ACK | 32)
    assert [each.state for each in result(capture(talk)).transactions] == ["ok"]
