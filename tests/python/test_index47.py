"""The gate: index 47 waits until something of its AR proves that it is the parameter channel."""

from __future__ import annotations

import pytest

from ds47.acyclic.index47 import ArKey, Index47
from ds47.profidrive import decode_request
from ds47.profinet.records import Half, Peer, Record
from ds47.spec import attributes, formats

AR: ArKey = ("192.168.133.2", "192.168.133.33", b"A" * 16)
OTHER: ArKey = (*AR[:2], b"B" * 16)


def write(ar: ArKey, data: bytes, cut: int = 0) -> Record:
    """A Write to slot 1, subslot 1, without its last bytes."""
    half = Half(7, 0, data, len(data) + cut, cut, cut=cut > 0)
    return Record(True, False, ar[2], 0, 1, 1, 47, 0, half, None, Peer(ar[0], ar[1]))


class Door(Index47):
    """A gate that notes what went through, by name."""

    def __init__(self, extra: frozenset[int] = frozenset(), waiting: int = 4) -> None:
        super().__init__(extra, waiting)
        self.through: list[object] = []

    def send(self, name: object, ar: ArKey = AR, index: int = 47, proves: bool = False) -> None:
        passes = self.passes(ar, index)
        self.through += [name] if passes else self.pass_on(ar, name, proves=proves)


@pytest.mark.parametrize(
    ("index", "concerned"),
    [(47, True), (0xB02E, True), (0xB02F, True), (48, False), (1000, True)],
)
def test_which_indices_are_ours(index: int, concerned: bool) -> None:
    gate = Index47(frozenset({1000}), 4)
    assert (index in gate.concerned) == concerned


def test_47_named_by_the_user_needs_no_proof() -> None:
    door = Door(frozenset({47}))
    door.send("now")
    assert door.through == ["now"]


def test_what_waited_goes_first_and_in_its_order() -> None:
    door = Door()
    door.send("a")
    door.send("b")
    assert door.through == []
    door.send("proof", proves=True)
    assert door.through == ["a", "b", "proof"]
    door.send("after")
    assert door.through[3:] == ["after"]
    assert door.passes(AR, 47)


def test_a_device_waits_until_its_ar_has_proved_itself() -> None:
    door = Door()
    assert not door.waits(AR[1])
    door.send("a")
    assert door.waits(AR[1])
    assert not door.waits(AR[0])
    assert not door.waits(AR[1][:-1])
    door.send("other", OTHER)
    door.send("proof", proves=True)
    assert door.waits(AR[1])
    door.send("proof", OTHER, proves=True)
    assert not door.waits(AR[1])


def test_each_ar_proves_itself() -> None:
    door = Door()
    door.send("other", OTHER)
    door.send("proof", proves=True)
    assert door.through == ["proof"]
    assert not door.passes(OTHER, 47)


@pytest.mark.parametrize("proves", [True, False])
def test_another_index_passes_and_proves_nothing(proves: bool) -> None:
    door = Door()
    door.send("47")
    door.send("b02f", index=0xB02F, proves=proves)
    assert door.through == ["b02f"]
    assert not door.passes(AR, 47)


def test_the_oldest_event_of_an_ar_is_forgotten() -> None:
    door = Door(waiting=4)
    for number in range(6):
        door.send(number)
    door.send("proof", proves=True)
    assert door.through == [2, 3, 4, 5, "proof"]


def test_the_oldest_ar_is_forgotten() -> None:
    door = Door(waiting=4)
    ars = [(*AR[:2], bytes([n]) * 16) for n in range(5)]
    for number, ar in enumerate(ars):
        door.send(number, ar)
    for ar in ars:
        door.send("proof", ar, proves=True)
    assert [name for name in door.through if name != "proof"] == [1, 2, 3, 4]


def test_all_together_may_wait_sixteen_times_as_long() -> None:
    door = Door(waiting=20)
    ars = [(*AR[:2], bytes([n]) * 16) for n in range(17)]
    for ar in ars:
        for _ in range(20):
            door.send(ar, ar)
    for ar in ars:
        door.send("proof", ar, proves=True)
    assert {name for name in door.through if name != "proof"} == set(ars[1:])


def test_a_question_proves_until_too_much_waits_or_an_echo_comes() -> None:
    outcomes: list[object] = []
    gate = Index47(frozenset(), 4, outcomes=outcomes)
    place, request = (0, 1, 1), decode_request(bytes.fromhex("01010101 1001 0015 0000"))
    for ar in (AR, OTHER):
        assert gate.pass_on(ar, "before") == ()
        assert gate.pass_on(ar, "question", asks=True) == ["before", "question"]
        gate.asked(write(ar, bytes(10)), request)
    assert gate.pass_on(AR, "behind") == ["behind"]
    assert not gate.passes(AR, 47)
    assert not gate.waits(AR[1])
    for number in range(2):
        gate.pass_on(AR, number)
    assert gate.passes(AR, 47)
    assert gate.echoed(OTHER, place, b"no echo") is None
    assert gate.echoed(OTHER, place, bytes(10)) == [OTHER]
    assert not gate.is_question_here(AR[1], place, request)
    assert gate.pass_on(OTHER, "again", asks=True) == ()
    assert outcomes == [("questions", AR, None), ("questions", OTHER, None), ("proven", AR, None)]
    assert gate.pass_on(OTHER, "proof", proves=True) == ["before", "question", "again", "proof"]


@pytest.mark.parametrize("code", sorted(formats()))
def test_no_response_begins_as_a_question_does_but_by_a_format_that_is_an_attribute(
    code: int,
) -> None:
    """Its fifth byte is a format. Where that is an attribute, too, no response is as long as its request."""
    if code in attributes():
        assert code in (0x10, 0x20, 0x30)
        assert formats()[code].size in (12, 4, None)


@pytest.mark.parametrize(
    ("data", "whole", "told"),
    [
        ("01020102 1001 0b54 0000", 34, True),
        ("01", 34, True),
        ("01010102 1001 0b54 0000", 34, False),  # a read
        ("01020101 1001 0b54 0000 0801 41200000", 16, False),  # all of it
    ],
)
@pytest.mark.parametrize("proven", [False, True])
def test_a_change_that_the_capture_cut_is_told_where_nothing_proves_it(
    data: str, whole: int, told: bool, proven: bool
) -> None:
    outcomes: list[object] = []
    gate, there = Index47(frozenset(), 4, outcomes=outcomes), bytes.fromhex(data)
    gate.pass_on(AR, "asked")
    asked = write(AR, there, cut=whole - len(there))
    gate.asked(asked, decode_request(there, cut=len(there) < whole))
    gate.heard(AR, 7, asks=True)
    if proven:
        gate.pass_on(AR, "answered", proves=True)
    list(gate.unproven())
    assert outcomes == ([("foreign", asked, None)] if told and not proven else [])
