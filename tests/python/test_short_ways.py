"""The short ways of the usual case say what the long ways say, whatever bytes they are given.

`rpc.from_frame` and `tcp.from_frame` against `link.dissect` and `parse`, the sound blocks of a response against
the careful decoder, shared requests against fresh ones, the line of a transaction against its dictionary.
"""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import frames as make
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47 import spec
from ds47.capture import Frame, open_capture
from ds47.lab import message
from ds47.model import S7, Frames, Item, Parameter, ParameterError, Read, Transaction
from ds47.profidrive import Options, decode_request, decode_response, parameter
from ds47.profinet import link, rpc
from ds47.report import json
from ds47.report.bilingual import LANGUAGES
from ds47.report.contract import TRANSACTION
from ds47.s7 import tcp

HEADERS = 130
OVERWRITTEN = st.lists(st.tuples(st.integers(0, HEADERS), st.integers(0, 255)), max_size=3)


def frame(little: bool, ptype: int, body: bytes, length: int) -> bytes:
    """An Ethernet frame with an RPC PDU; `length` is what its header says of the body."""
    order = "little" if little else "big"
    uuid = make.UUID_LITTLE if little else make.UUID_BIG
    head = bytes((4, ptype, 0x20, 0, 0x10 if little else 0, 0, 0, 0)) + bytes(range(16)) + uuid
    head += bytes(range(16, 32)) + bytes(8) + (7).to_bytes(4, order) + (3).to_bytes(2, order)
    head += bytes(4) + length.to_bytes(2, order) + bytes(4)
    return make.ethernet(0x0800, make.ipv4(make.udp(head + body)))


@settings(max_examples=500)
@given(
    st.booleans(), st.integers(0, 10), st.binary(max_size=40), st.integers(-3, 3), OVERWRITTEN,
    st.integers(0, 3), st.binary(max_size=5),
)  # fmt: skip
def test_from_frame_is_dissect_and_parse(
    little: bool, ptype: int, body: bytes, more: int, overwritten: list[tuple[int, int]],
    cut: int, behind: bytes,
) -> None:  # fmt: skip
    data = bytearray(frame(little, ptype, body, max(0, len(body) + more)))
    for at, value in overwritten:
        if at < len(data):
            data[at] = value
    whole = bytes(data) + behind
    shot = Frame(5, 1234, 1, whole[: len(whole) - cut], len(whole))
    quick = rpc.from_frame(shot)
    packet = link.dissect(shot)
    slow = packet and packet.kind == "udp" and rpc.parse(packet)
    if quick is not None:
        assert quick == slow


@pytest.mark.parametrize("little", [True, False])
def test_from_frame_takes_the_usual_frame(little: bool) -> None:
    found = rpc.from_frame(Frame(1, 2, 1, frame(little, 2, b"body", 4), 200))
    assert found is not None
    assert (found.seq, found.opnum, found.body, found.client) == (7, 3, b"body", "192.168.0.2")


def test_from_frame_takes_no_interface_in_the_other_byte_order() -> None:
    with patch.object(make, "UUID_LITTLE", make.UUID_BIG):
        assert rpc.from_frame(Frame(1, 2, 1, frame(True, 2, b"body", 4), 200)) is None


def test_what_from_frame_remembers_is_bounded() -> None:
    with patch.object(rpc, "_MOST_KNOWN", 8):
        for number in range(100):
            data = bytearray(frame(True, 0, b"", 0))
            data[11] = data[29] = number  # MAC and IP address
            data[50] = number  # object UUID
            assert rpc.from_frame(Frame(1, 2, 1, bytes(data), 200)) is not None
            assert len(rpc._KNOWN[True]) <= 8


@settings(max_examples=500)
@given(
    st.binary(max_size=12), st.integers(0, 15), st.integers(-3, 3), OVERWRITTEN, st.integers(0, 30),
    st.binary(max_size=5), st.booleans(),
)  # fmt: skip
def test_from_frame_is_the_segment_of_dissect(
    body: bytes, words: int, more: int, overwritten: list[tuple[int, int]], cut: int, behind: bytes,
    known: bool,
) -> None:  # fmt: skip
    head = bytes.fromhex("c001006600000001000000f0") + bytes((words << 4, 0x18)) + bytes(6)
    data = bytearray(make.ethernet(0x0800, make.ipv4(head + body, proto=6)))
    total = len(data) - 14 + more if known else 0
    data[16:18] = total.to_bytes(2, "big")
    for at, value in overwritten:
        if at < len(data):
            data[at] = value
    whole = bytes(data) + behind
    shot = Frame(5, 1234, 1, whole[: max(0, len(whole) - cut)], len(whole))
    quick = tcp.from_frame(shot)
    packet = link.dissect(shot)
    slow = None
    if packet is not None and packet.kind == "tcp":
        captured = packet.cut[1] if packet.cut else 0
        slow = tcp.parse(packet.src_ip, packet.dst_ip, packet.payload, packet.missing, captured)
    if quick is not None:
        assert quick == slow


def test_from_frame_takes_the_usual_segment() -> None:
    head = bytes.fromhex("c0010066000000010000000250180400") + bytes(4)
    found = tcp.from_frame(
        Frame(1, 2, 1, make.ethernet(0x0800, make.ipv4(head + b"body", proto=6)), 58)
    )
    assert found is not None
    assert (found.source.port, found.destination.port, found.data) == (0xC001, 102, b"body")
    assert (found.sequence, found.acknowledge, found.flags, found.length) == (1, 2, 0x18, 4)


def test_the_ends_that_from_frame_remembers_are_bounded() -> None:
    head = bytes.fromhex("c0010066000000010000000250180400") + bytes(4)
    with patch.object(tcp, "_MOST_KNOWN", 8):
        for number in range(100):
            data = bytearray(make.ethernet(0x0800, make.ipv4(head, proto=6)))
            data[35] = number
            assert tcp.from_frame(Frame(1, 2, 1, bytes(data), 60)) is not None
        assert len(tcp._ENDS) <= 8


BLOCKS = st.lists(
    st.one_of(
        st.builds(
            lambda code, count, raw, pad: bytes((code, count)) + raw + pad,
            st.sampled_from((0x01, 0x02, 0x05, 0x08, 0x09, 0x41, 0x42, 0x43, 0x44, 0x40, 0x71, 0x0C, 0x34)),
            st.integers(0, 3), st.binary(max_size=12), st.sampled_from((b"", b"\0", b"\1")),
        ),
        st.sampled_from((
            message.real(1.5, -2.0), message.word(7), message.error(0x11), message.error(0, 3),
            message.block(message.UNSIGNED8, "B", 5),
        )),
    ),
    max_size=4,
)  # fmt: skip


@settings(max_examples=500)
@given(
    st.sampled_from((0x01, 0x81, 0x82, 0x02, 0x80, 0xC0)), st.integers(0, 4), BLOCKS, st.booleans()
)
def test_sound_blocks_are_what_the_careful_decoder_gives(
    response_id: int, count: int, blocks: list[bytes], vendor: bool
) -> None:
    data = bytes((1, response_id, 1, count)) + b"".join(blocks)
    request = decode_request(bytes((1, 0x40, 1, 0))) if vendor else None
    for options in (Options(), Options(True, True)):
        quick = decode_response(data, request, options)
        with patch.object(parameter, "_sound_blocks", lambda *_: None):
            assert decode_response(data, request, options) == quick


@given(st.lists(st.tuples(st.integers(0, 3), st.binary(max_size=30)), max_size=12))
def test_a_shared_request_is_a_fresh_one(requests: list[tuple[int, bytes]]) -> None:
    asked = message.read(1, 1, message.address(27))[1:]
    for reference, data in [*requests, (1, asked), (2, asked), (0, asked), (2, asked + b"\0\0\0")]:
        whole = bytes((reference,)) + data
        assert parameter.shared_request(whole) == decode_request(whole)
    assert parameter.shared_request(b"") == decode_request(b"")


numbers = st.one_of(st.none(), st.integers(0, 1 << 40))
texts = st.one_of(st.none(), st.text(max_size=6))
values = st.lists(
    st.one_of(st.integers(-(2**53), 2**53), st.floats(allow_nan=False, allow_infinity=False), st.text(max_size=5)),
    max_size=4,
)  # fmt: skip
rows = [row for all_ in spec.parameters().values() for row in all_.values()]
errors = st.one_of(st.none(), st.builds(ParameterError, numbers, numbers, numbers, texts))
parameters_ = st.builds(
    Parameter, numbers, numbers, texts, numbers, st.sampled_from([None, *rows]), texts, texts, numbers, values,
    st.one_of(st.none(), values), errors,
)  # fmt: skip
pairs = st.lists(st.builds(Read, numbers, numbers), max_size=2)
transactions = st.builds(
    Transaction, st.text(max_size=5), st.text(max_size=5), st.text(max_size=5), st.text(max_size=5), texts,
    st.integers(0, 9), st.integers(0, 9), st.integers(0, 9), st.integers(0, 9), numbers, numbers,
    st.builds(Frames, numbers, numbers, numbers, numbers, pairs, pairs),
    st.integers(-(10**19), 10**20), st.one_of(st.none(), st.integers(-(10**12), 10**15)),
    st.one_of(st.none(), st.binary(max_size=5)), st.one_of(st.none(), st.binary(max_size=5)),
    st.one_of(st.none(), st.integers(0, 2**32 - 1)), st.one_of(st.none(), st.integers(0, 2**32 - 1)),
    st.lists(parameters_, max_size=3), st.integers(0, 3), st.lists(st.text(max_size=5), max_size=2),
    st.integers(0, 99),
)  # fmt: skip
codes = st.one_of(st.none(), st.integers(0, 255))
items = st.builds(
    Item, texts, texts, numbers, numbers, numbers, numbers, st.one_of(st.none(), st.binary(max_size=5)), codes,
)  # fmt: skip


def _of_s7(
    item: Transaction, connection: int | None, its: list[Item], error: int | None, parts: list[Read]
) -> Transaction:
    item.channel, item.connection, item.items = S7, connection, its
    item.r_id = item.error = error
    item.segments = parts
    return item


jobs = st.builds(_of_s7, transactions, numbers, st.lists(items, max_size=3), numbers, pairs)


@pytest.mark.slow
@settings(max_examples=300)
@given(st.one_of(transactions, jobs), st.sampled_from(LANGUAGES))
def test_the_line_of_a_transaction_is_its_dictionary(item: Transaction, lang: str) -> None:
    assert json.transaction_line(item, lang) == json.text(TRANSACTION.plain(item, lang))


def test_a_value_that_is_no_json_is_an_error() -> None:
    item = Parameter(1, 0, "value", 1, format="Float32", value_count=1, values=[float("nan")])
    with pytest.raises(ValueError, match="JSON"):
        json._parameters([item], "en")


def test_stored_captures_take_the_short_way(captures: Any) -> None:
    """Or nothing here is tested on real input: most PDUs of a stored capture are usual ones."""
    with open_capture(captures / "format-change.pcapng") as capture:
        shots = list(capture)
    assert sum(rpc.from_frame(shot) is not None for shot in shots) > len(shots) // 2
