"""Record calls: what stands in the body of a Read, Write or ReadImplicit, cut or whole."""

from __future__ import annotations

from dataclasses import replace

import pytest
from talk import pdus

from ds47.lab import wire
from ds47.lab.client import BUSY, CHANNEL, CONTROLLER_AR, OK, Client
from ds47.profinet.records import (
    NIL_UUID,
    Record,
    parse_request,
    parse_response,
    released_ar,
    without_block,
)
from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import RECORD_WRITE_MULTIPLE, RPC_CONNECT, RPC_WRITE

DATA = b"\1\2\3\4\5\6\7"
PLACE = wire.RecordId(CONTROLLER_AR, slot=2, subslot=3, index=0xB02F, api=0x3A00)
OUTER = wire.RecordId(CONTROLLER_AR, 0xFFFF, 0xFFFF, RECORD_WRITE_MULTIPLE, 0xFFFFFFFF)
ORDERS = pytest.mark.parametrize("order", ["<", ">"])


def write(client: Client) -> None:
    client.write(DATA, at=PLACE)


def read(client: Client) -> None:
    client.read(DATA, at=PLACE)


def multiple(client: Client) -> None:
    """Three records, of which the first two need a pad; the second is refused."""
    client.write_multiple(
        [
            (client.at(slot=1), DATA, OK),
            (client.at(slot=2), DATA[:5], 0xDF80B500),
            (client.at(slot=3), DATA[:6], OK),
        ]
    )


def place(record: Record) -> tuple[bytes, int, int, int, int]:
    return record.ar, record.api, record.slot, record.subslot, record.index


@ORDERS
def test_write(order: wire.Order) -> None:
    asked, answered = pdus(write, order=order)
    (record,), multiple = parse_request(asked)
    assert not multiple
    assert place(record) == (CONTROLLER_AR.bytes, 0x3A00, 2, 3, 0xB02F)
    assert (record.write, record.implicit, record.position) == (True, False, 0)
    assert record.request is not None
    assert (record.request.data, record.request.stated, record.request.missing) == (DATA, 7, 0)
    assert (record.request.frame, record.request.time_ns) == (asked.frame, asked.time_ns)
    status, (answer,) = parse_response(answered)
    assert status == 0
    assert place(answer) == place(record)
    assert answer.response is not None
    assert (answer.response.status, answer.response.data, answer.response.missing) == (0, b"", 0)


@ORDERS
def test_read(order: wire.Order) -> None:
    asked, answered = pdus(read, order=order)
    (record,) = parse_request(asked)[0]
    assert record.request is not None
    assert (record.write, record.request.data, record.request.stated) == (False, b"", 4096)
    assert record.request.missing == 0  # a Read request states the most that is wanted
    status, (answer,) = parse_response(answered)
    assert status == 0
    assert answer.response is not None
    assert (answer.response.data, answer.response.status) == (DATA, 0)
    assert (answer.response.frame, answer.response.time_ns) == (answered.frame, answered.time_ns)


def test_implicit_has_no_ar_and_reads() -> None:
    def talk(client: Client) -> None:
        call = client.call(wire.READ_IMPLICIT)
        client.ask(call, wire.read_request(0, CHANNEL, target=CONTROLLER_AR))
        client.accept_read(call, DATA)

    asked, answered = pdus(talk)
    (record,), (answer,) = parse_request(asked)[0], parse_response(answered)[1]
    assert (record.implicit, record.write, record.ar) == (True, False, NIL_UUID)
    assert (answer.implicit, answer.ar) == (True, NIL_UUID)
    assert answer.response is not None
    assert answer.response.data == DATA


@ORDERS
@pytest.mark.parametrize("with_header", [True, False])
def test_status_of_a_refused_read(order: wire.Order, with_header: bool) -> None:
    answered = pdus(lambda client: client.poll(BUSY, with_header=with_header), order=order)[1]
    status, records = parse_response(answered)
    assert status == BUSY
    statuses = [record.response and record.response.status for record in records]
    assert statuses == [BUSY] * with_header


def test_the_answer_has_a_byte_order_of_its_own() -> None:
    answered = pdus(lambda client: client.poll(BUSY), order="<", answer_order=">")[1]
    assert not answered.little
    assert parse_response(answered)[0] == BUSY


@ORDERS
def test_status_in_the_block_of_a_write(order: wire.Order) -> None:
    """The NDR header says ok, the block of the record does not."""

    def talk(client: Client) -> None:
        call = client.ask_write(DATA)
        client.accept(call, OK, wire.write_response(0, CHANNEL, 0, 0xDF80B500))

    status, (answer,) = parse_response(pdus(talk, order=order)[1])
    assert status == 0
    assert answer.response is not None
    assert answer.response.status == 0xDF80B500


@ORDERS
def test_multiple_with_pads(order: wire.Order) -> None:
    asked, answered = pdus(multiple, order=order)
    records, several = parse_request(asked)
    assert several
    assert [record.slot for record in records] == [1, 2, 3]
    assert [record.position for record in records] == [1, 2, 3]
    assert [r.request and r.request.data for r in records] == [DATA, DATA[:5], DATA[:6]]
    status, answers = parse_response(answered)
    assert status == 0
    assert [answer.slot for answer in answers] == [1, 2, 3]
    assert [a.response and a.response.status for a in answers] == [0, 0xDF80B500, 0]


def test_nested_is_told_and_not_opened() -> None:
    inside = wire.write_request(0, CHANNEL, DATA)
    records, multiple = parse_request(
        pdus(lambda client: client.write_multiple([(OUTER, inside, OK)]))[0]
    )
    assert multiple
    assert [record.index for record in records] == [RECORD_WRITE_MULTIPLE]


def test_an_empty_multiple() -> None:
    assert parse_request(pdus(lambda client: client.write_multiple([]))[0]) == ([], True)


def test_stated_length_beyond_the_body_is_missing() -> None:
    asked = pdus(lambda client: client.ask_write(DATA, stated=12))[0]
    (record,) = parse_request(asked)[0]
    assert record.request is not None
    assert (record.request.data, record.request.stated, record.request.missing) == (DATA, 12, 5)

    def talk(client: Client) -> None:
        client.accept_read(client.ask_read(), DATA, stated=12)

    (answer,) = parse_response(pdus(talk)[1])[1]
    assert answer.response is not None
    assert (answer.response.data, answer.response.stated, answer.response.missing) == (DATA, 12, 5)


def test_stated_length_within_the_body_counts() -> None:
    (record,) = parse_request(pdus(lambda client: client.ask_write(DATA, stated=3))[0])[0]
    assert record.request is not None
    assert (record.request.data, record.request.missing) == (DATA[:3], 0)


@ORDERS
@pytest.mark.parametrize("play", [write, read, multiple])
def test_a_body_cut_at_every_byte(play: object, order: wire.Order) -> None:
    asked, answered = pdus(play, order=order)  # type: ignore[arg-type]
    whole = [record.request for record in parse_request(asked)[0]]
    for cut in range(len(asked.body)):
        found = parse_request(replace(asked, body=asked.body[:cut]))[0]
        assert len(found) <= len(whole)
        for record, other in zip(found, whole, strict=False):
            assert record.request is not None
            assert other is not None
            assert other.data.startswith(record.request.data)
            assert len(record.request.data) + record.request.missing == len(other.data)
    most = len(parse_response(answered)[1])
    for cut in range(len(answered.body)):
        status, answers = parse_response(replace(answered, body=answered.body[:cut]))
        assert status == (None if cut < 4 else 0)
        assert len(answers) <= max(most, 1)
        # up to the record length all of the address is there; a multiple has its outer block before
        assert bool(answers) == (cut >= (124 if play is multiple else 60))


def cut_to(pdu: Pdu, length: int) -> Pdu:
    """A PDU of which the capture has so many bytes of the body."""
    missing = len(pdu.body) - length
    return replace(pdu, body=pdu.body[:length], missing=missing, cut=(1, length, len(pdu.body)))


def test_what_the_capture_cut_is_told_from_what_was_never_sent() -> None:
    asked, answered = pdus(write)
    whole = len(asked.body)
    for pdu, cut in (
        (cut_to(asked, whole - 7), True),
        (replace(asked, body=asked.body[:-7]), False),
    ):
        (record,) = parse_request(pdu)[0]
        assert record.request is not None
        assert (record.request.data, record.request.missing, record.request.cut) == (b"", 7, cut)
        assert not record.request.cut_before_status
    for length in range(60, len(answered.body)):
        (record,) = parse_response(cut_to(answered, length))[1]
        assert record.response is not None
        there = length >= 68  # the STATUS of the block is
        assert (record.response.status, record.response.cut_before_status) == (
            (0, False) if there else (None, True)
        )


def test_of_a_record_that_came_the_length_is_known() -> None:
    answered = pdus(read)[1]
    for length in range(60, len(answered.body)):
        (record,) = parse_response(cut_to(answered, length))[1]
        half = record.response
        assert half is not None
        assert (half.cut, half.cut_before_status, half.stated) == (True, False, 7)
        assert len(half.data) == max(0, length - 84)


@pytest.mark.parametrize(
    ("status", "write", "told"),
    [(OK, True, (None, True)), (OK, False, (OK, True)), (BUSY, True, (BUSY, False)), (BUSY, False, (BUSY, False))],
)  # fmt: skip
def test_a_block_that_is_cut_off_may_have_a_status_of_its_own(
    status: int, write: bool, told: tuple[int | None, bool]
) -> None:
    answered = pdus(read)[1]
    half = without_block(cut_to(answered, 30), status, write=write)
    assert (half.status, half.cut_before_status) == told
    whole = without_block(answered, status, write=write)
    assert (whole.status, whole.cut, whole.cut_before_status) == (status, False, False)


@ORDERS
def test_a_status_without_the_rest_of_the_ndr_header(order: wire.Order) -> None:
    answered = pdus(lambda client: client.poll(BUSY), order=order)[1]
    assert parse_response(replace(answered, body=b"")) == (None, [])
    assert parse_response(replace(answered, body=answered.body[:3])) == (None, [])
    assert parse_response(replace(answered, body=answered.body[:4])) == (BUSY, [])


def test_a_block_of_another_kind_is_absent() -> None:
    asked, answered = pdus(read)
    for opnum in (RPC_WRITE, RPC_CONNECT, 9):
        assert parse_request(replace(asked, opnum=opnum))[0] == []
        assert parse_response(replace(answered, opnum=opnum)) == (0, [])


def test_released_ar() -> None:
    def release(client: Client) -> None:
        for kind in (0x0114, 0x0117, 0x0115):
            block = kind.to_bytes(2, "big") + bytes((0, 28, 1, 0, 0, 0)) + CONTROLLER_AR.bytes
            client.ask(client.call(wire.RELEASE), block + bytes(8))

    first, second, other = pdus(release)
    assert released_ar(first) == released_ar(second) == CONTROLLER_AR.bytes
    assert released_ar(other) is None
    assert {released_ar(replace(first, body=first.body[:cut])) for cut in range(44)} == {None}


def test_a_cut_status_of_a_write_is_not_known() -> None:
    def talk(client: Client) -> None:
        call = client.ask_write(DATA)
        client.accept(call, OK, wire.write_response(0, CHANNEL, 0, 0xDF80B500))

    answered = pdus(talk)[1]
    for cut in range(60, 68):
        _, (answer,) = parse_response(replace(answered, body=answered.body[:cut]))
        assert answer.response is not None
        assert answer.response.status is None


def test_a_multiple_cut_behind_its_outer_response_answers_nothing() -> None:
    answered = pdus(multiple)[1]
    assert parse_response(replace(answered, body=answered.body[:84]))[1] == []
