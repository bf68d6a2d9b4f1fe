"""IPv4: the header and reassembly, whatever the order, with copies, holes and cuts."""

from __future__ import annotations

import frames as make
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.profinet import ip

PAYLOAD = bytes(range(100))
KEY = "192.168.0.1", "192.168.0.2", 17, 7


def fragments(size: int = 24, ident: int = 7) -> list[ip.Datagram]:
    found = []
    for at in range(0, len(PAYLOAD), size):
        piece = PAYLOAD[at : at + size]
        more = at + size < len(PAYLOAD)
        part = ip.parse(make.ipv4(piece, ident=ident, offset=at, more=more))
        assert part is not None
        found.append(part)
    return found


def test_header() -> None:
    found = ip.parse(b"xx" + make.ipv4(b"data", ident=9) + b"ethernet padding", 2)
    assert found == ip.Datagram("192.168.0.1", "192.168.0.2", 17, 9, 0, False, b"data", 0, at=22)
    assert found.whole


def test_options_are_skipped_and_a_zero_length_means_all() -> None:
    data = bytearray(make.ipv4(bytes(4) + b"data"))
    data[0] = 0x46
    found = ip.parse(bytes(data))
    assert found is not None
    assert found.payload == b"data"
    data[2:4] = b"\0\0"
    found = ip.parse(bytes(data) + b"more")
    assert found is not None
    assert found.payload == b"datamore"


def test_cut_at_every_byte() -> None:
    data = make.ipv4(PAYLOAD)
    for cut in range(len(data)):
        found = ip.parse(data[:cut])
        if cut < 20:
            assert found is None
        else:
            assert found is not None
            assert (found.payload, found.missing) == (data[20:cut], len(data) - cut)


@pytest.mark.parametrize("first", [0x44, 0x4F, 0x65, 0x00])
def test_headers_that_contradict_themselves(first: int) -> None:
    assert ip.parse(bytes([first]) + make.ipv4(b"data")[1:]) is None


@given(st.permutations(range(5)), st.lists(st.integers(0, 4), max_size=4))
def test_any_order_and_any_copies(order: list[int], copies: list[int]) -> None:
    parts = fragments()
    sequence = [*order[:4], *[n for n in copies if n != order[4]], order[4], *copies]
    reassembler = ip.Reassembler()
    whole = [reassembler.feed(parts[n], i, i) for i, n in enumerate(sequence)]
    done = [datagram for datagram in whole if datagram is not None]
    assert [(datagram.payload, datagram.missing) for datagram in done] == [(PAYLOAD, 0)]
    assert whole.index(done[0]) == len(sequence) - len(copies) - 1
    assert reassembler.unfinished() == []  # a late copy opens nothing


def test_an_identification_used_again_is_a_new_datagram() -> None:
    reassembler = ip.Reassembler()
    for start in (0, 2_000_000):
        whole = [reassembler.feed(part, 1, start) for part in fragments()]
        assert whole[-1] is not None


def test_a_datagram_that_comes_once_more_is_whole_whenever_its_fragments_come() -> None:
    """The wire doubled it: its first fragment came as soon as a mirror port's copy, its last one did not."""
    reassembler = ip.Reassembler()
    first, *others = fragments()
    for part in (first, *others, first):
        reassembler.feed(part, 1, 0)
    again = [reassembler.feed(part, 2, 14_000_000) for part in others]
    assert [each is not None and each.payload for each in again] == [False, False, False, PAYLOAD]
    assert reassembler.unfinished() == []


def test_copies_are_no_part_of_another_datagram_with_their_identification() -> None:
    reassembler = ip.Reassembler()
    first, *others = fragments()
    for part in (first, *others, first):
        reassembler.feed(part, 1, 0)
    new = [ip.Datagram(*KEY, each.offset, each.more, each.payload[::-1], 0) for each in others]
    assert [reassembler.feed(part, 2, 14_000_000) for part in new] == [None] * 4


def test_fragments_cut_by_the_snap_length_complete_with_missing_bytes() -> None:
    reassembler = ip.Reassembler()
    parts = fragments()
    parts[1].payload, parts[1].missing = parts[1].payload[:10], 14
    whole = [reassembler.feed(part, 1, 0) for part in parts][-1]
    assert whole is not None
    assert (whole.payload, whole.missing) == (PAYLOAD[:34], 66)


def test_expiry_and_what_was_never_whole() -> None:
    reassembler = ip.Reassembler(expiry_ns=1000)
    first, second, *_ = fragments()
    assert reassembler.feed(first, 1, 0) is None
    assert reassembler.feed(second, 2, 900) is None
    assert reassembler.feed(fragments(ident=8)[0], 3, 1500) is None
    lost = [*reassembler.given_up, *reassembler.unfinished()]
    assert [(u.identification, u.have, u.frame, u.total, u.limit) for u in lost] == [
        (7, 48, 2, None, ""),
        (8, 24, 3, None, ""),
    ]
    # its other fragments come too late: they begin a new one, without a head
    assert [reassembler.feed(part, 4, 1600) for part in fragments()[2:]] == [None] * 3


def test_memory_is_bounded() -> None:
    reassembler = ip.Reassembler(datagrams=4, fragments=10)
    for ident in range(1000):
        for part in fragments()[:4]:
            reassembler.feed(part, 1, 0)
        reassembler.feed(fragments(ident=ident)[0], 1, 0)
    assert len(reassembler.unfinished()) <= 4
    assert {each.limit for each in reassembler.given_up} == {"ip_datagrams"}


def test_bytes_are_bounded() -> None:
    reassembler = ip.Reassembler(most_bytes=5_000)
    for ident in range(100):
        reassembler.feed(
            ip.Datagram("192.168.0.1", "192.168.0.2", 17, ident, 0, True, bytes(1400), 0), 1, 0
        )
        assert reassembler._bytes <= 5_000 + 1400
    assert [entry.identification for entry in reassembler._open.values()] == [97, 98, 99]
    for entry in list(reassembler._open.values()):
        last = ip.Datagram(
            entry.source, entry.destination, 17, entry.identification, 1400, False, b"ab", 0
        )
        assert reassembler.feed(last, 2, 0) is not None
    assert reassembler._bytes == 0


def test_a_hole_and_impossible_offsets() -> None:
    reassembler = ip.Reassembler()
    parts = fragments()
    assert [reassembler.feed(part, 1, 0) for part in (parts[0], *parts[2:])] == [None] * 4
    assert reassembler.unfinished()[0].head() == PAYLOAD[:24]
    huge = ip.Datagram("a", "b", 17, 1, 65_528, False, bytes(8), 0)
    assert reassembler.feed(huge, 1, 0) is None
    assert len(reassembler.unfinished()) == 1
