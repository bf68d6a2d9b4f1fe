"""RPC: one UDP payload to one PDU, whatever its byte order; fragments to one message."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from uuid import UUID

import pytest
from talk import packets, pdus

from ds47.lab import wire
from ds47.lab.client import CONTROLLER_ACTIVITY, Client
from ds47.profinet import rpc
from ds47.spec.layouts import RPC_READ, RPC_SIZE

BODY = bytes(range(40))


def one(order: wire.Order = "<", kind: int = wire.REQUEST, body: bytes = BODY) -> rpc.Packet:
    return packets(lambda client: client.ask(client.call(wire.READ), body, kind), order=order)[0]


def parts(size: int = 10, body: bytes = BODY) -> list[rpc.Pdu]:
    def talk(client: Client) -> None:
        client.ask(client.call(wire.READ), body, wire.PING)  # a body without an NDR header

    return [replace(pdu, ptype=0) for pdu in pdus(talk, fragment=size)]


def feed(fragments: rpc.Fragments, sequence: list[rpc.Pdu]) -> list[rpc.Pdu]:
    return [whole for pdu in sequence if (whole := fragments.feed(replace(pdu)))]


@pytest.mark.parametrize("order", ["<", ">"])
def test_header_in_both_byte_orders(order: wire.Order) -> None:
    packet = one(order, wire.PING)
    pdu = rpc.parse(packet)
    assert pdu is not None
    assert pdu.little == (order == "<")
    assert (pdu.ptype, pdu.seq, pdu.opnum, pdu.body, pdu.missing) == (1, 0, RPC_READ, BODY, 0)
    assert pdu.activity == CONTROLLER_ACTIVITY.bytes
    assert pdu.object_uuid == wire.object_uuid(0x0501, 0x002A).bytes
    assert (pdu.fragmented, pdu.last) == (False, False)
    assert (pdu.frame, pdu.time_ns, pdu.ip_id) == (packet.frame, packet.time_ns, packet.ip_id)


def test_client_and_server_do_not_depend_on_the_direction() -> None:
    asked, answered = pdus(lambda client: client.poll())
    assert (asked.source, asked.destination) == (answered.destination, answered.source)
    assert (asked.client, asked.server) == (answered.client, answered.server)
    assert asked.client == asked.source


@pytest.mark.parametrize("order", ["<", ">"])
def test_cut_at_every_byte(order: wire.Order) -> None:
    packet = one(order, wire.PING)
    for cut in range(len(packet.payload)):
        pdu = rpc.parse(replace(packet, payload=packet.payload[:cut]))
        if cut < RPC_SIZE:
            assert pdu is None
        else:
            assert pdu is not None
            assert (pdu.body, pdu.missing) == (BODY[: cut - 80], 120 - cut)


def test_bytes_behind_the_stated_length_are_left_out() -> None:
    packet = one("<", wire.PING)
    pdu = rpc.parse(replace(packet, payload=packet.payload + b"padding"))
    assert pdu is not None
    assert (pdu.body, pdu.missing) == (BODY, 0)


@pytest.mark.parametrize(
    ("at", "value"),
    [(0, 5), (1, 11), (24, 0x02), (26, 0xA1), (28, 0x98), (32, 0x83), (39, 0x7E)],
    ids=["version", "ptype", "not 1..F", "dea1", "6c98", "node", "node end"],
)
def test_what_is_not_pnio_is_none(at: int, value: int) -> None:
    packet = one()
    data = bytearray(packet.payload)
    data[at] = value
    wanted = at == 24  # the low digit of the interface number is free: dea00002 is the controller
    assert (rpc.parse(replace(packet, payload=bytes(data))) is not None) == wanted


def test_foreign_interface() -> None:
    packet = one(">")
    for foreign in ("e1af8308-5d1f-11c9-91a4-08002b14a0fb", "367abb81-9844-35f1-ad32-98f038001003"):
        data = packet.payload[:24] + UUID(foreign).bytes + packet.payload[40:]
        assert rpc.parse(replace(packet, payload=data)) is None


@pytest.mark.parametrize("order", ["<", ">"])
def test_calls_of_the_endpoint_mapper_have_numbers_and_nothing_else(order: str) -> None:
    packet, mapper = one(order), UUID("e1af8308-5d1f-11c9-91a4-08002b14a0fa")
    interface = mapper.bytes_le if order == "<" else mapper.bytes
    payload = packet.payload[:24] + interface + packet.payload[40:]
    said, ours = rpc.parse(replace(packet, payload=payload)), rpc.parse(packet)
    assert said is not None
    assert ours is not None
    assert (said.opnum, said.seq, said.activity) == (rpc.NO_OPERATION, ours.seq, ours.activity)


def test_the_upper_bits_of_the_type_are_not_looked_at() -> None:
    packet = one()
    data = bytearray(packet.payload)
    data[1] |= 0xE0
    pdu = rpc.parse(replace(packet, payload=bytes(data)))
    assert pdu is not None
    assert pdu.ptype == 0


def test_device_identity() -> None:
    assert rpc.device_identity(wire.object_uuid(0x0501, 0x002A).bytes) == (0x002A, 0x0501)
    assert rpc.device_identity(bytes(16)) is None
    assert rpc.device_identity(CONTROLLER_ACTIVITY.bytes) is None


def test_a_message_in_one_piece_passes() -> None:
    pdu = rpc.parse(one())
    assert pdu is not None
    assert rpc.Fragments(1).feed(pdu) is pdu


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_fragments_in_any_order(order: tuple[int, ...]) -> None:
    pieces = parts()
    fragments = rpc.Fragments(10**9)
    (whole,) = feed(fragments, [pieces[number] for number in order])
    newest = pieces[order[-1]]
    assert (whole.body, whole.fragmented) == (BODY, False)
    assert (whole.frame, whole.time_ns) == (newest.frame, newest.time_ns)
    assert fragments.unfinished() == []


def test_a_fragment_twice_counts_once() -> None:
    pieces = parts()
    again = replace(pieces[0], body=b"something else")
    (whole,) = feed(rpc.Fragments(10**9), [pieces[0], again, *pieces[1:3], pieces[1], pieces[3]])
    assert whole.body == BODY


def test_a_fragment_behind_the_last_one_is_none_of_the_message() -> None:
    pieces = parts()
    stray = replace(pieces[0], fragment=9, body=b"stray")
    for sequence in ([stray, *pieces], [pieces[3], stray, *pieces[:3]]):
        (whole,) = feed(rpc.Fragments(10**9), sequence)
        assert whole.body == BODY


def test_a_fragment_that_is_none_of_the_message_takes_no_room() -> None:
    first, second, third, last = parts()  # of ten bytes each
    stray = replace(first, fragment=9)
    (whole,) = feed(rpc.Fragments(10**9, most_bytes=35), [stray, last, first, second, third])
    assert whole.body == BODY


def test_fragments_of_different_messages_do_not_mix() -> None:
    first, second = parts(), [replace(pdu, seq=7) for pdu in parts(body=BODY[::-1])]
    mixed = [pdu for pair in zip(first, second, strict=True) for pdu in pair]
    assert [whole.body for whole in feed(rpc.Fragments(10**9), mixed)] == [BODY, BODY[::-1]]


def test_what_stands_behind_a_hole_is_missing() -> None:
    pieces = parts()
    pieces[1] = replace(pieces[1], body=pieces[1].body[:4], missing=6)
    pieces[3] = replace(pieces[3], body=pieces[3].body[:7], missing=3, cut=(4, 129, 132))
    (whole,) = feed(rpc.Fragments(10**9), pieces)
    assert whole.cut == (4, 129, 132), "the second one is short for another reason"
    assert whole.body == BODY[: len(pieces[0].body) + 4]
    assert len(whole.body) + whole.missing == len(BODY)


def test_an_old_message_is_given_up_and_told() -> None:
    pieces = parts()
    fragments = rpc.Fragments(expiry_ns=10**9)
    assert feed(fragments, [pieces[1], pieces[0]]) == []
    late = replace(pieces[0], seq=7, time_ns=pieces[0].time_ns + 10**9 + 1)
    assert feed(fragments, [late]) == []
    assert [(gone.pdu.seq, gone.have, gone.limit) for gone in fragments.given_up] == [(0, 2, "")]
    assert [(pdu.seq, have) for pdu, have in fragments.unfinished()] == [(7, 1)]
    assert feed(fragments, pieces[2:]) == []  # what was given up does not become whole


def test_expiry_counts_from_the_newest_fragment() -> None:
    pieces = [replace(pdu, time_ns=900 * number) for number, pdu in enumerate(parts())]
    fragments = rpc.Fragments(expiry_ns=1000)
    other = replace(pieces[0], seq=7, time_ns=2000)
    (whole,) = feed(fragments, [*pieces[:3], other, pieces[3]])
    assert whole.body == BODY


def test_the_oldest_goes_first_at_the_limit() -> None:
    head = parts()[0]
    fragments = rpc.Fragments(10**9, limit=2)
    assert feed(fragments, [replace(head, seq=number) for number in range(3)]) == []
    assert [(gone.pdu.seq, gone.limit) for gone in fragments.given_up] == [(0, "rpc_messages")]
    assert [pdu.seq for pdu, _ in fragments.unfinished()] == [1, 2]
    rest = parts()[1:]
    assert feed(fragments, rest) == []  # of seq 0, which is gone


def test_the_number_of_fragments_is_bounded() -> None:
    pieces = parts(size=2)  # twenty of them
    fragments = rpc.Fragments(10**12, fragments=15)
    assert feed(fragments, pieces) == []
    assert [(gone.have, gone.limit) for gone in fragments.given_up] == [(16, "rpc_fragments")]
    assert [have for _, have in fragments.unfinished()] == [4]


def test_the_bytes_of_fragments_are_bounded() -> None:
    head, *rest = parts()
    fragments = rpc.Fragments(10**12, most_bytes=35)  # of ten bytes each
    assert feed(fragments, [replace(head, seq=number) for number in range(5)]) == []
    assert [len(partial.parts) for partial in fragments._partial.values()] == [1, 1, 1]
    (whole,) = feed(fragments, [replace(part, seq=4) for part in rest[:1] + rest[1:]])
    assert whole.body == BODY
    assert fragments._bytes == sum(partial.bytes for partial in fragments._partial.values())
