"""Writes tests/vectors/conversations.json: small conversations and what they must become.

What is expected is typed by hand, from the sentences of docs/pairing.md, and never taken from an analysis.
How a scene becomes a case is in `book`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any
from uuid import UUID

from book import NOTHING, RAMP, Row, Vectors, orphan, par, ramp, real, row, tape, tx

from ds47.lab import message, wire
from ds47.lab.client import BUSY, CONTROLLER_AR, Client, controller, drive

BOOK = Vectors(
    "conversations.json",
    "Conversations and the transactions and findings they must become, for every implementation. "
    "tests/vectors/README.md says how to run them; tests/vectors/sources/conversations.py writes this file.",
)
AR2 = UUID("47474747-0002-4000-8000-000000000001")


# Messages


def ask(reference: int = 1, *pnus: int, axis: int = 1) -> bytes:
    """A read of parameters without index; of r0021 where none is named."""
    return message.read(reference, axis, *(message.address(pnu) for pnu in pnus or (21,)))


def tell(reference: int, *values: float, axis: int = 1, identifier: int = 1) -> bytes:
    """The answer to a read: one Float32 each."""
    return message.answer(reference, identifier, axis, *(message.real(value) for value in values))


def put(reference: int, value: float, pnu: int = RAMP) -> bytes:
    """A change of one Float32."""
    return message.change(reference, 1, (message.address(pnu), message.real(value)))


NOT_POSSIBLE, BAD_HEADER, SHORT = 0xDF80B500, 0xDF80B700, 0xDE80B100
CUT = ask(7)[:8]
"""A read whose only address lacks its last two bytes: known id, but the length does not fit."""


def implicit(client: Client, record: bytes, index: int = 0xB02F) -> None:
    """A ReadImplicit brings a record."""
    nowhere = client.at(ar=wire.NIL, index=index)
    client.accept_read(client.ask_implicit(nowhere), record, at=nowhere)


def second(client: Client, **more: Any) -> Client:
    """A second controller on the same drive, with an AR of its own."""
    settings = {"activity": UUID(int=0x47), "channel": wire.RecordId(AR2), **more}
    return Client(client.stage, controller(2), **settings)


HOME2: Row = {"controller": "192.168.133.3", "ar": str(AR2)}
NO_AR: Row = {"index": 0xB02F, "ar": None}
"""Where a ReadImplicit reads."""


# The plain life of a transaction


@BOOK.scene("P2 P3 P14 P29 P46 P48 none", row(1, real(1.5)))
def p24_read(client: Client) -> None:
    """Write request and response, Read request and response: one read."""
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene("P29 P46 none", row(1, ramp(10.0), state="change ok"))
def p24_change(client: Client) -> None:
    """A change; its values are those that were written."""
    client.exchange(put(1, 10.0), message.changed(1, 1))


@BOOK.scene("none", row(1, par(27, "Unsigned16", 7, 8, subindex=3), par(21, "Float32", 1.5)))
def p37_by_position(client: Client) -> None:
    """Two parameters in another order than their numbers: the n-th block is the n-th address."""
    request = message.read(1, 1, message.address(27, 3, 2), message.address(21))
    client.exchange(request, message.answer(1, 1, 1, message.word(7, 8), message.real(1.5)))


@BOOK.scene("P48 fragments", tx(1, "ok", (2, 4, 6, 8), 6, real(1.5)))
def p3_fragments(client: Client) -> None:
    """Every PDU in two RPC fragments: frame and time are those of the second one."""
    client.fragment = 60
    client.exchange(ask(), tell(1, 1.5))


BOOK.lab("P29", "conversation-late-read", "P48 late-read", row(1, real(10.0), ms=30003))
BOOK.lab(
    "P2", "transport-time-back", "P48 time-back", row(1, real(1500.0), ms=-2497), rules="DS107@3"
)


# RPC level


@BOOK.scene(
    "P14 interleaved",
    tx(1, "ok", (1, 4, 6, 8), 7, real(1.5)),
    tx(2, "ok", (2, 3, 5, 7), 5, real(2.5), **HOME2),
)
def p4_same_activity(client: Client) -> None:
    """Two controllers with the same activity UUID and the same sequence numbers at one time."""
    other = second(client, activity=client.activity)
    one, two = client.ask_write(ask()), other.ask_write(ask())
    other.accept_write(two, ask())
    client.accept_write(one, ask())
    two, one = other.ask_read(), client.ask_read()
    other.accept_read(two, tell(1, 2.5))
    client.accept_read(one, tell(1, 1.5))


@BOOK.scene("P13 byte-order", tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)]))
def p5_big_asks_little_answers(client: Client) -> None:
    """Big-endian controller, little-endian drive; the poll's status swaps, the blocks do not."""
    client.order, client.answer_order = ">", "<"
    client.write(ask())
    client.poll()
    client.read(tell(1, 1.5))


@BOOK.scene("P13 byte-order", tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)]))
def p5_little_asks_big_answers(client: Client) -> None:
    """Little-endian controller, big-endian drive."""
    client.order, client.answer_order = "<", ">"
    client.write(ask())
    client.poll(with_header=False)
    client.read(tell(1, 1.5))


@BOOK.scene("copy", tx(1, "ok", (1, 3, 5, 7), 3.3, real(1.5)))
def p6_copies(client: Client) -> None:
    """A mirror port shows every datagram twice, 0.1 to 1 ms apart: the first one counts."""
    client.stage.gap_ns = 100_000

    def twice() -> None:
        tape(client).repeat()
        client.wait(0.9)

    call = client.ask_write(ask())
    twice()
    client.accept_write(call, ask())
    twice()
    call = client.ask_read()
    twice()
    client.accept_read(call, tell(1, 1.5))
    client.wait(0.9)
    tape(client).repeat()


@BOOK.scene("copy", tx(1, "ok", (1, 3, 4, 5), 4, real(1.5)))
def p6_limit_of_copy(client: Client) -> None:
    """1 ms apart."""
    call = client.ask_write(ask())
    tape(client).repeat()
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene("copy", tx(1, "ok", (1, 3, 4, 5), 31, real(1.5)))
def p6_same_ip_id_28_ms(client: Client) -> None:
    """28 ms apart: the network doubled the datagram, and held one of them back."""
    call = client.ask_write(ask())
    client.wait(27)
    tape(client).repeat()
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene("P6 P10 retransmission", tx(1, "ok", (1, 3, 4, 5), 4, real(1.5)), rules="DS103@2#1")
def p7_other_ip_id_within_1_ms(client: Client) -> None:
    """1 ms apart is no copy where the IP id differs: a retransmission."""
    call = client.ask_write(ask())
    client.ask_write(ask(), again=call)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P10 retransmission",
    tx(1, "ok", (1, 4, 5, 6), 25_005, real(1.5)),
    rules="DS103@2#1 DS103@3#1 DS416@6#1",
)
def p7_retransmission_unanswered(client: Client) -> None:
    """A Write sent three times within 25 s before its answer: one call, however long it takes."""
    call = client.ask_write(ask())
    client.wait(12_500)
    client.ask_write(ask(), again=call)
    client.wait(12_500)
    client.ask_write(ask(), again=call)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


BOOK.lab(
    "P8",
    "transport-retransmission-answered",
    "P10 retransmission",
    tx(1, "ok", (1, 2, 5, 6), 505, real(1500.0)),
    rules="DS103@3#1",
)


BOOK.lab(
    "P81",
    "transport-second-response",
    "P10 second-response",
    row(1, real(1500.0)),
    rules="DS103@5#1 DS111@6#1",
)


@BOOK.scene("second-response", row(1, real(1.5)), rules="DS111@5#1")
def p81_of_the_wire(client: Client) -> None:
    """The request was doubled before the point of capture: its second response is no poll."""
    client.write(ask())
    call = client.ask_read()
    client.accept_read(call, tell(1, 1.5))
    client.refuse_read(call, BUSY)


@BOOK.scene(
    "P73 second-response incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING, polls=[(3, 4)]),
    row(2, real(2.5), first=7, ref=2),
    rules="DS103@5#1 DS110@1#1 DS111@6#1",
)
def p81_either(client: Client) -> None:
    """Not ready, sent again, and the record: its client may have that, so it was not displaced unread."""
    client.write(ask())
    call = client.ask_read()
    client.refuse_read(call, BUSY)
    client.ask_read(again=call)
    client.accept_read(call, tell(1, 1.5))
    client.exchange(ask(2), tell(2, 2.5))


@BOOK.scene(
    "P9 second-response reused-number",
    row(1, real(1.5)),
    tx(2, "orphan", (None, None, None, 6), None, real(2.5, pnu=None), ref=2, write=None),
    rules="DS102@6 DS403@6#2",
)
def p81_behind_a_connect(client: Client) -> None:
    """Behind a Connect a number that was answered stands for another call."""
    client.write(ask())
    call = client.ask_read()
    client.accept_read(call, tell(1, 1.5))
    client.ask(client.call(wire.CONNECT), bytes(60))
    client.accept_read(call, tell(2, 2.5))


@BOOK.scene(
    "P9 P27 P41 reused-number incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    row(2, real(1.5), first=3, ref=1),
    rules="DS110@1#1",
)
def p8_after_60_s(client: Client) -> None:
    """The identical Write 60.001 s after its answer is a new call: no client repeats one then."""
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    client.wait(60_000)
    client.ask_write(ask(), again=call)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P10 retransmission poll",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5), polls=[(3, 4)]),
    rules="DS103@5#1",
)
def p8_other_number_between(client: Client) -> None:
    """The identical Write after another sequence number of the activity is the old one, which came late."""
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    client.poll()
    client.ask_write(ask(), again=call)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P9 reused-number incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    row(2, real(2.5, pnu=27), first=3),
    rules="DS110@1#1",
)
def p8_not_identical(client: Client) -> None:
    """The same sequence number with another record right after the answer is a new call."""
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    client.ask_write(ask(2, 27), again=call)
    client.accept_write(call, ask(2, 27))
    client.read(tell(2, 2.5))


@BOOK.scene("P16 reused-number", row(1, real(1.5)), row(2, real(2.5), ref=1))
def p9_reused_after_61_s(client: Client) -> None:
    """61 s later the same activity, sequence numbers and bytes again: a new transaction."""
    client.exchange(ask(), tell(1, 1.5))
    client.wait(61_000)
    client.sequence = 0
    client.exchange(ask(), tell(1, 2.5))


@BOOK.scene("P16 reused-number", row(1, real(1.5)), row(2, real(2.5), first=7, ref=1))
def p9_reused_after_a_connect(client: Client) -> None:
    """The same once more behind a Connect: the program was started again, and counts from 0."""
    client.exchange(ask(), tell(1, 1.5))
    client.connect("plc")
    client.sequence = 0
    client.exchange(ask(), tell(1, 2.5))


@BOOK.scene(
    "P7 P11 P73 reused-number lost",
    tx(1, "incomplete", (1,), None, NOTHING),
    row(2, real(2.5, pnu=27), first=2),
    rules="DS101@1#1 DS110@1#1",
)
def p9_other_record_unanswered(client: Client) -> None:
    """The same sequence number with another record while the call is open: not the same request."""
    call = client.ask_write(ask())
    client.ask_write(ask(2, 27), again=call)
    client.accept_write(call, ask(2, 27))
    client.read(tell(2, 2.5))


@BOOK.scene(
    "P38 P73 lost", tx(1, "incomplete", (1, 2, 3), None, NOTHING), rules="DS110@1#1 DS101@3#1"
)
def p11_call_at_end(client: Client) -> None:
    """The capture ends after the Read request: call and transaction are unanswered."""
    client.write(ask())
    client.ask_read()


@BOOK.scene(
    "P28 lost late-response",
    tx(1, "ok", (1, None, 3, 4), 61_003, real(1.5)),
    rules="DS101@1#1 DS102@2",
)
def p11_response_after_expiry(client: Client) -> None:
    """A Write response 61 s after its request: the call was given up after 60 s."""
    call = client.ask_write(ask())
    client.wait(61_000)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@BOOK.scene("retransmission lost other-index", row(1, real(1.5), first=4))
def p12_other_index(client: Client) -> None:
    """A retransmission, a refused and a lost Read on I&M0 are none of our business."""
    place = client.at(index=0xAFF0)
    call = client.ask_read(at=place)
    client.wait(500)
    client.ask(call, wire.read_request(call.sequence, place))
    client.refuse_read(call, 0xDE80B000, at=place)
    client.exchange(ask(), tell(1, 1.5))
    client.ask_read(at=place)


# Record level


PLACES: tuple[dict[str, Any], ...] = (
    {},
    {"slot": 2},
    {"subslot": 2},
    {"api": 0x3A00},
    {"index": 0xB02E},
    {"index": 0xB02F},
)


@BOOK.scene(
    "P16 interleaved",
    *[
        tx(n, "ok", (2 * n - 1, 2 * n, 25 - 2 * n, 26 - 2 * n), 27 - 4 * n, real(n), **place)
        for n, place in enumerate(PLACES, 1)
    ],
)
def p14_places(client: Client) -> None:
    """Six channels of one AR with the same reference: all asked, then read in reverse order."""
    places = [client.at(**place) for place in PLACES]
    for place in places:
        client.write(ask(), at=place)
    for number in range(len(places), 0, -1):
        client.read(tell(1, float(number)), at=places[number - 1])


@BOOK.scene(
    "P16 interleaved",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
    row(2, real(2.5), first=3, ref=1, **HOME2),
)
def p14_two_controllers(client: Client) -> None:
    """Two controllers on one drive, same place, reference and sequence numbers."""
    other = second(client)
    client.write(ask())
    other.write(ask())
    other.read(tell(1, 2.5))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "interleaved",
    tx(1, "ok", (1, 2, 9, 10), 9, real(1.5)),
    tx(2, "ok", (3, 4, 7, 8), 5, real(2.5), controller="192.168.133.3"),
    tx(3, "ok", (5, 6, 11, 12), 7, real(3.5), device="192.168.133.34"),
)
def p14_same_ar_uuid(client: Client) -> None:
    """The same AR UUID with two controllers and with two devices: three channels."""
    clients = [
        client,
        second(client, channel=wire.RecordId(CONTROLLER_AR)),
        Client(client.stage, device=drive(2), activity=UUID(int=0x48)),
    ]
    for client in clients:
        client.write(ask())
    clients[1].read(tell(1, 2.5))
    clients[0].read(tell(1, 1.5))
    clients[2].read(tell(1, 3.5))


@BOOK.scene(
    "P32 implicit orphan",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), index=0xB02F),
    orphan(2, 3, real(9.5, pnu=None), ref=7, **NO_AR),
    rules="DS403@4#2",
)
def p15_implicit_own_channel(client: Client) -> None:
    """A ReadImplicit between Write and Read of an AR does not take the response of the AR."""
    place = client.at(index=0xB02F)
    client.write(ask(), at=place)
    implicit(client, tell(7, 9.5))
    client.read(tell(1, 1.5), at=place)


@BOOK.scene(
    "implicit reread",
    row(1, par(21, error=(1, 0)), state="error", index=0xB02F, rereads=[(5, 6)]),
    row(2, real(2.5), first=7, index=0xB02F),
    rules="DS410@4#1 DS701@4#1 DS704@6#1",
)
def p55_implicit_reread(client: Client) -> None:
    """Another station reads the response of an AR without one: nothing was asked, nothing fails once more."""
    place = client.at(index=0xB02F)
    failed = message.answer(1, 0x81, 1, message.error(1))
    client.exchange(ask(), failed, at=place)
    implicit(second(client), failed)
    client.exchange(ask(2), tell(2, 2.5), at=place)


@BOOK.scene(
    "implicit reread",
    row(1, real(1.5), index=0xB02F),
    row(2, real(2.5), index=0xB02F, rereads=[(9, 10)], ref=1, **HOME2),
    orphan(3, 11, real(1.5, pnu=None), **NO_AR),
    rules="DS403@12#3 DS704@10#2",
)
def p55_implicit_of_another_ar(client: Client) -> None:
    """Of two that asked at a place the last one counts; the response before it is nobody's any more."""
    other = second(client)
    client.exchange(ask(), tell(1, 1.5), at=client.at(index=0xB02F))
    other.exchange(ask(), tell(1, 2.5), at=other.at(index=0xB02F))
    implicit(client, tell(1, 2.5))
    implicit(client, tell(1, 1.5))


@BOOK.scene(
    "P38 implicit orphan release reread",
    row(1, par(21, error=(1, 0)), state="error", index=0xB02F),
    orphan(2, 7, par(None, error=(1, 0)), rereads=[(9, 10)], **NO_AR),
    rules="DS410@4#1 DS403@8#2 DS701@4#1 DS704@8#2 DS704@10#2",
)
def p55_implicit_after_release(client: Client) -> None:
    """The transaction was over when its response was read again; its error is not told twice."""
    place = client.at(index=0xB02F)
    failed = message.answer(1, 0x81, 1, message.error(1))
    client.exchange(ask(), failed, at=place)
    client.release()
    implicit(client, failed)
    implicit(client, failed)


@BOOK.scene("none", row(1, real(1.5)), row(2, real(2.5, pnu=27), ref=1), rules="DS415@5#2")
def p16_no_keys(client: Client) -> None:
    """Block sequence number and reference never change, the drive answers from another port."""
    client.answer_port = 49999
    place = client.channel
    for pnu, value in ((21, 1.5), (27, 2.5)):
        call = client.call(wire.WRITE)
        client.ask(call, wire.write_request(5, place, ask(1, pnu)))
        client.accept(call, 0, wire.write_response(5, place, 10, 0))
        call = client.call(wire.READ)
        client.ask(call, wire.read_request(5, place))
        client.accept(call, 0, wire.read_response(5, place, tell(1, value)))


@BOOK.scene(
    "P49 write-multiple",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.0)),
    tx(2, "ok", (1, 2, 5, 6), 5, real(2.0), ref=2, slot=2),
    row(3, real(3.0), first=1, slot=3),
)
def p17_write_multiple(client: Client) -> None:
    """Three requests in one Write, read in reverse order: ids follow the place in the Write."""
    places = [client.at(slot=number) for number in (1, 2, 3)]
    client.write_multiple([(place, ask(place.slot), 0) for place in places])
    for place in reversed(places):
        client.read(tell(place.slot, float(place.slot)), at=place)


BOOK.lab(
    "P17",
    "record-multiple-refused",
    "P25 P49 write-multiple refused",
    row(1, real(1.0), axis=2),
    tx(2, "refused", (1, 2), None, par(22), ref=2, axis=3, slot=2, write="DF80B500"),
    tx(3, "ok", (1, 2, 5, 6), 5, real(3.0, pnu=23), ref=3, axis=4, slot=3),
    rules="DS203@2#2",
)


BOOK.lab(
    "P18", "record-multiple-nested", "write-multiple nested", row(1, real(1500.0)), rules="DS208@5"
)


@BOOK.scene("P17 write-multiple nested", row(1, real(1.5)), rules="DS208@1")
def p18_nested_beside_a_request(client: Client) -> None:
    """Beside the nested one stands a request of the first level: that one is opened."""
    outer = client.at(slot=0xFFFF, subslot=0xFFFF, api=0xFFFFFFFF, index=wire.WRITE_MULTIPLE)
    nested = wire.write_request(0, client.at(slot=2), ask(2))
    client.write_multiple([(client.channel, ask(), 0), (outer, nested, 0xDF80B401)])
    client.read(tell(1, 1.5))


# Which records are ours


BOOK.lab(
    "P19",
    "message-missing-request",
    "P25 P40 P53 malformed refused",
    tx(1, "refused", (1, 2), None, write="DF80B700", index=0xB02F),
    rules="DS315@1#1 DS203@2#1 DS711@1#1",
)


@BOOK.scene(
    "P43 P55 mismatch implicit",
    row(1, real(1.5, pnu=None), state="mismatch", rereads=[(5, 6)]),
    row(2, real(2.5), first=7),
    rules="DS319@4#1 DS405@4#1 DS704@6#1",
)
def p20_once_more_without_an_ar(client: Client) -> None:
    """A response without the shape of DS47, read once more without an AR while a shaped request is known."""
    client.exchange(ask(), tell(1, 1.5, identifier=0x03))
    implicit(client, tell(1, 1.5, identifier=0x03), index=47)
    client.exchange(ask(2), tell(2, 2.5))


@BOOK.scene("P23 foreign", row(1, real(1.5), first=3))
def p20_per_ar(client: Client) -> None:
    """Index 47 of one AR is a parameter channel, of another AR on the same device it is not."""
    foreign = second(client)
    foreign.write(b"Hello, world")
    client.exchange(ask(), tell(1, 1.5))
    foreign.read(b"Hello, world")


@BOOK.scene("P23 foreign", rules="DS209@1")
def p20_values(client: Client) -> None:
    """Values of 4 bytes, each of which would be the response to a change: a position, written and read."""
    for position in (0x00021D8D, 0x00021E01, 0x01020101):
        value = position.to_bytes(4)
        client.exchange(value, value)
        client.read((position + 256).to_bytes(4))


@BOOK.scene("P23 foreign", rules="DS209@1")
def p20_a_response_alone(client: Client) -> None:
    """Responses alone prove nothing, whatever they are."""
    client.read(tell(1, 1.5))
    client.read(message.changed(2, 1))


@BOOK.scene("P23 foreign", rules="DS209@1")
def p20_stored(client: Client) -> None:
    """What is no certain request (its attribute is unknown) is read back as it was written: a store, no drive."""
    stored = message.read(1, 1, message.address(21, attribute=0x55))
    client.exchange(stored, stored)


@BOOK.scene("P23 foreign echo", rules="DS209@1")
def p20_echo(client: Client) -> None:
    """What was written, read as it is: a store, though each Write is a question by itself, the last one, too."""
    client.exchange(ask(), ask())
    client.exchange(put(2, 1.5), put(2, 1.5) + bytes(6))
    client.write(ask(3))


@BOOK.scene("P23 foreign echo superseded", rules="DS209@1")
def p20_echo_of_the_newest(client: Client) -> None:
    """Written before the newest is read, in a call sent again; one is no question, and one is refused."""
    client.write(ask(1, 21))
    client.write(put(2, 1.5))
    client.write(ask(3, 22), status=NOT_POSSIBLE)
    client.read(b"another place", at=client.at(slot=2))
    client.write(b"Hello, world")
    call = client.ask_read()
    client.ask_read(again=call)
    client.accept_read(call, b"Hello, world")
    client.write(ask(4))


@BOOK.scene("P23 foreign echo interleaved", rules="DS209@1")
def p20_echo_to_another(client: Client) -> None:
    """Three ARs write to a store, and one of them reads what another one wrote; the third never reads."""
    other = second(client)
    client.write(ask(1, 21))
    second(client, channel=wire.RecordId(UUID(int=0x4703))).write(ask(2, 22))
    other.write(ask(3, 23))
    client.read(ask(3, 23))
    other.write(put(4, 2.5))
    other.read(put(4, 2.5))


@BOOK.scene(
    "P22 malformed echo interleaved",
    tx(1, "error", (1, 2, 5, 6), 5, par(21, "UniversalTime")),
    tx(2, "ok", (3, 4, 7, 8), 5, real(1.5), ref=2, slot=2),
    rules="DS315@6#1",
)
def p20_echo_beside_a_drive(client: Client) -> None:
    """A drive of the AR responds behind the echo of a store: then all of that AR is ours, what was before, too."""
    client.write(ask())
    client.write(ask(2), at=client.at(slot=2))
    client.read(ask())
    client.read(tell(2, 1.5), at=client.at(slot=2))


@BOOK.scene(
    "malformed",
    row(1, real(1.5)),
    row(2, par(21, "UniversalTime"), state="error"),
    rules="DS315@8#2",
)
def p20_echo_of_a_drive(client: Client) -> None:
    """Nothing refutes a proof: behind a response the request itself is a faulty one."""
    client.exchange(ask(), tell(1, 1.5))
    client.exchange(ask(2), ask(2))


@BOOK.scene(
    "poll superseded refused",
    tx(1, "superseded", (1, 2), None, NOTHING),
    tx(2, "refused", (3, 4), None, NOTHING, ref=2, write="DF80B500"),
    tx(3, "ok", (5, 6, 9, 10), 15, real(1.5), ref=3, polls=[(7, 8)]),
    rules="DS705@3#2 DS203@4#2 DS413@5#1",
)
def p20_polled(client: Client) -> None:
    """A drive that takes its time: what it was asked before its first response is told then."""
    client.write(ask())
    client.write(ask(2), status=NOT_POSSIBLE)
    client.exchange(ask(3), tell(3, 1.5), polls=1)


@BOOK.scene("P23 foreign", rules="DS209@1")
def p20_another_response(client: Client) -> None:
    """Nor is it one where the response is that to another reference, axis or number of parameters."""
    strange = message.read(1, 1, message.address(21, attribute=0x55))
    client.exchange(strange, tell(2, 1.5))
    client.exchange(strange, tell(1, 1.5, axis=2))
    client.exchange(strange, tell(1, 1.5, 2.5))
    client.exchange(strange, put(1, 1.5))


@BOOK.scene("P22 malformed", row(1, {**real(1.5), "attribute": "0x55"}), rules="DS305@1#1")
def p20_pair(client: Client) -> None:
    """A request of which one cannot be sure (its attribute is unknown) is one by the response that mirrors it."""
    strange = message.read(1, 1, message.address(21, attribute=0x55))
    client.exchange(strange, tell(1, 1.5))


@BOOK.scene("unanswered", tx(1, "incomplete", (1, 2), None, NOTHING), rules="DS314@1#1 DS110@1#1")
def p20_request_alone(client: Client) -> None:
    """A whole request, behind which there are zeros, is enough."""
    client.write(ask() + bytes(6))
    client.wait(12_000)


@BOOK.scene(
    "P22 malformed refused",
    tx(1, "refused", (1, 2), None, ref=7, write="DF80B700", api=0x3A00),
    rules="DS315@1#1 DS203@2#1 DS711@1#1",
)
def p20_api(client: Client) -> None:
    """Under the API of PROFIdrive index 47 is a parameter channel, whatever comes."""
    client.write(CUT, status=BAD_HEADER, at=client.at(api=0x3A00))


@BOOK.scene(
    "P22 malformed refused",
    tx(1, "refused", (1, 2), None, ref=7, write="DF80B700"),
    row(2, real(1.5), first=3, ref=1, index=0xB02F),
    tx(3, "refused", (7, 8), None, ref=7, write="DF80B700"),
    rules="DS315@1#1 DS203@2#1 DS315@7#3 DS203@8#3 DS415@7#3 DS711@1#1 DS711@7#3",
)
def p20_beside_another_index(client: Client) -> None:
    """A submodule that answers at 0xB02F uses 47, too, under whatever API; another submodule need not."""
    client.write(CUT, status=BAD_HEADER)
    client.exchange(ask(), tell(1, 1.5), at=client.at(index=0xB02F))
    client.write(CUT, status=BAD_HEADER)


@BOOK.scene(
    "malformed refused",
    row(1, real(1.5)),
    tx(2, "refused", (5, 6), None, ref=7, write="DF80B700"),
    rules="DS315@5#2 DS203@6#2 DS711@5#2",
)
def p21_malformed_later(client: Client) -> None:
    """After a shaped message a cut one on index 47 is decoded with its findings."""
    client.exchange(ask(), tell(1, 1.5))
    client.write(CUT, status=BAD_HEADER)


BOOK.lab(
    "P22",
    "record-foreign-then-ours",
    "P20 malformed refused",
    tx(1, "refused", (1, 2), None, ref=7, write="DF80B700"),
    row(2, real(1500.0), first=3, ref=1),
    rules="DS315@1#1 DS203@2#1 DS711@1#1",
)


@BOOK.scene(
    "P20 malformed refused interleaved",
    tx(1, "refused", (1, 2), None, ref=7, write="DF80B700"),
    row(2, real(1.5), first=3, ref=1, **HOME2),
    row(3, real(1.5), first=7, ref=1),
    rules="DS315@1#1 DS203@2#1 DS711@1#1",
)
def p22_late_is_no_step_back(client: Client) -> None:
    """What waited for its AR to prove itself is taken in behind frames of another one: no clock stepped back."""
    client.write(CUT, status=BAD_HEADER)
    second(client).exchange(ask(), tell(1, 1.5))
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene(
    "P2 malformed refused interleaved time-back",
    row(1, real(1.5), **HOME2),
    tx(2, "refused", (5, 6), None, ref=7, write="DF80B700"),
    row(3, real(1.5), first=7, ref=1),
    rules="DS107@5 DS315@5#2 DS203@6#2 DS711@5#2",
)
def p22_late_step_back(client: Client) -> None:
    """The clock steps back at a frame that waits for its AR to prove itself: there, and not behind it."""
    second(client).exchange(ask(), tell(1, 1.5))
    client.wait(-50)
    client.write(CUT, status=BAD_HEADER)
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene(
    "P27 P41 malformed superseded",
    tx(1, "superseded", (1, 2), None, ref=7),
    row(2, real(1.5), first=3, ref=1),
    rules="DS315@1#1 DS413@3#1 DS711@1#1 DS705@3#1",
)
def p22_in_its_place(client: Client) -> None:
    """A cut but accepted request before the first shaped one was open when that one came."""
    client.write(CUT)
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene(
    "P38 malformed release unanswered",
    tx(1, "unanswered", (1, 2), None, ref=7),
    row(2, real(1.5), ref=1),
    rules="DS315@1#1 DS401@1#1 DS711@1#1 DS722@1#1",
)
def p22_release_in_its_place(client: Client) -> None:
    """A cut request was over by the Release of its AR when the first shaped one came, which displaces nothing."""
    client.write(CUT)
    client.release()
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene("P12 foreign lost", rules="DS209@1")
def p23_foreign(client: Client) -> None:
    """Index 47 of a device that is no drive: no transaction and no finding, lost calls included."""
    for data in (b"Hello, world", b"\0\0\0\x10calibration", b"\xff" * 8):
        client.exchange(data, data)
    client.poll(0xDE80B600)
    client.ask_write(b"again")


@BOOK.scene("none", row(1, real(1.5), index=0x1234))
def p14_index_of_the_user(client: Client) -> None:
    """An index that the user names is ours."""
    tape(client).options = {"indices": [0x1234]}
    client.exchange(ask(), tell(1, 1.5), at=client.at(index=0x1234))


# The Write


BOOK.lab(
    "P25",
    "record-write-refused",
    "P40 refused",
    tx(1, "refused", (1, 2), None, NOTHING, write="DF80B700"),
    rules="DS203@2#1",
)
BOOK.lab(
    "P26",
    "record-write-refused-open",
    "P25 P29 P40 refused",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1500.0)),
    tx(2, "refused", (3, 4), None, par(27), ref=2, write="DF80B500"),
    rules="DS203@4#2 DS705@3#2",
)
BOOK.lab(
    "P27",
    "conversation-superseded-read",
    "P41 superseded",
    tx(1, "superseded", (1, 2), None, NOTHING),
    row(2, real(5.0, pnu=27), first=3),
    rules="DS413@3#1 DS705@3#1",
)
BOOK.lab(
    "P27",
    "conversation-superseded-change",
    "P41 superseded",
    tx(1, "change superseded", (1, 2), None, ramp(10.0)),
    tx(2, "change superseded", (3, 4), None, ramp(11.0), ref=2),
    row(3, ramp(12.0), state="change ok", first=5),
    rules="DS414@3#1 DS414@5#2",
)


@BOOK.scene(
    "P34 P40 P41 superseded poll",
    tx(1, "superseded", (1, 2), None, NOTHING, polls=[(3, 4), (5, 6)]),
    row(2, real(2.5, pnu=27), first=7),
    rules="DS413@7#1 DS705@7#1",
)
def p27_superseded_after_polls(client: Client) -> None:
    """A polled request is displaced: superseded, not refused, for a poll is no response."""
    client.write(ask())
    client.poll()
    client.poll()
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P33 lost poll orphan",
    tx(1, "incomplete", (1,), None, NOTHING),
    row(2, real(2.5, pnu=27), first=2),
    orphan(3, 8, real(1.5, pnu=None)),
    rules="DS101@1#1 DS206@7 DS110@1#1 DS403@9#3",
)
def p28_passed_over(client: Client) -> None:
    """A Read finds no request open: a record that comes after that is not the response to an older Write."""
    client.ask_write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.poll()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P31 lost orphan",
    tx(1, "incomplete", (1,), None, NOTHING),
    row(2, real(2.5, pnu=27), first=2),
    orphan(3, 7, real(2.5, pnu=None), ref=2),
    orphan(4, 9, real(1.5, pnu=None)),
    rules="DS101@1#1 DS102@6 DS110@1#1 DS403@8#3 DS403@10#4",
)
def p70_unasked_write(client: Client) -> None:
    """A Write is accepted whose request is lost: the same record once more may be the response to that."""
    client.ask_write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.accept_write(client.call(wire.WRITE), ask())
    client.read(tell(2, 2.5))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P30 lost poll refused",
    tx(1, "refused", (1, 2), None, NOTHING, write="DF80B700", polls=[(3, 4)]),
    orphan(2, 8, real(1.5, pnu=None)),
    rules="DS102@5 DS203@2#1 DS110@7 DS403@9#2",
)
def p70_unasked_refused(client: Client) -> None:
    """A Write is refused whose request is lost: no Read after it is for the refused Write before it."""
    client.write(ask(), BAD_HEADER)
    client.poll()
    client.accept_write(client.call(wire.WRITE), ask(), status=BAD_HEADER)
    client.poll()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P36 lost incomplete",
    tx(1, "incomplete", (1,), None, NOTHING),
    row(2, real(2.5, pnu=27), first=4),
    rules="DS101@1#1 DS207@3#1 DS110@1#1",
)
def p28_nothing_read(client: Client) -> None:
    """A Read that brings nothing does not prove that the Write before it was accepted: it is not superseded."""
    client.ask_write(ask())
    client.read(b"")
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P27 lost interleaved",
    tx(1, "ok", (1, None, 4, 5), 4, real(1.5)),
    tx(2, "ok", (2, 3, 6, 7), 5, real(2.5, pnu=27), ref=2),
    rules="DS101@1#1",
)
def p28_late_record(client: Client) -> None:
    """The record of an older Write comes when a newer one was accepted already: it displaces nothing."""
    client.ask_write(ask())
    client.write(ask(2, 27))
    client.read(tell(1, 1.5))
    client.read(tell(2, 2.5))


@BOOK.scene(
    "lost refused incomplete",
    tx(1, "refused", (1, 2), None, NOTHING, write="DF80B700"),
    tx(2, "incomplete", (3, None, 4), None, par(27), ref=2),
    rules="DS101@3#2 DS101@4#2 DS203@2#1 DS110@3#2",
)
def p68_behind_a_refused_write(client: Client) -> None:
    """The Read without a response comes after a Write without a response, and is not one of the refused Write."""
    client.write(ask(), BAD_HEADER)
    client.ask_write(ask(2, 27))
    client.ask_read()


BOOK.lab(
    "P28",
    "transport-write-unanswered",
    "lost",
    tx(1, "ok", (1, None, 2, 3), 2, real(1500.0)),
    rules="DS101@1#1",
)


@BOOK.scene("P29 disorder", tx(1, "ok", (1, 4, 2, 3), 2, real(1.5)), rules="DS702@2#1")
def p28_read_before_write_response(client: Client) -> None:
    """The Write response comes after the Read response: it still belongs to its transaction."""
    call = client.ask_write(ask())
    client.read(tell(1, 1.5))
    client.accept_write(call, ask())


@BOOK.scene(
    "P73 lost",
    tx(1, "incomplete", (1,), None, NOTHING),
    tx(2, "ok", (2, None, 3, 4), 2, real(2.5, pnu=27), ref=2),
    rules="DS101@1#1 DS101@2#2 DS110@1#1",
)
def p28_two_asked_second_answered(client: Client) -> None:
    """Two Writes without response, the Read brings the record of the second."""
    client.ask_write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(2, 2.5))


@BOOK.scene(
    "P73 lost",
    tx(1, "ok", (1, None, 3, 4), 3, real(1.5)),
    tx(2, "incomplete", (2,), None, par(27), ref=2),
    rules="DS101@1#1 DS101@2#2 DS110@2#2",
)
def p28_two_asked_first_answered(client: Client) -> None:
    """Two Writes without response, the Read brings the record of the first."""
    client.ask_write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "lost",
    tx(1, "ok", (1, 2, 4, 5), 4, real(1.5)),
    row(2, real(2.5, pnu=27), first=6),
    rules="DS101@3#1",
)
def p68_lost_read_of_an_older_request(client: Client) -> None:
    """A Read never got its RPC response: it belongs to the request before it, though another is open later."""
    client.write(ask())
    client.ask_read()
    client.read(tell(1, 1.5))
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "lost",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    tx(2, "incomplete", (3,), None, par(27), ref=2),
    rules="DS101@3#2 DS110@1#1 DS110@3#2",
)
def p69_a_later_write_may_have_displaced_it(client: Client) -> None:
    """The channel goes on behind an open request, with a Write whose response is not in the capture."""
    client.write(ask())
    client.ask_write(ask(2, 27))


@BOOK.scene(
    "P27 P41 lost superseded",
    tx(1, "superseded", (1, 2), None, NOTHING),
    tx(2, "ok", (3, None, 4, 5), 2, real(2.5, pnu=27), ref=2),
    rules="DS101@3#2 DS413@3#1 DS705@3#1",
)
def p28_presumed_displaces(client: Client) -> None:
    """While one request is open the Read brings another's record, whose Write response is lost."""
    client.write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(2, 2.5))


@BOOK.scene(
    "lost poll",
    tx(1, "change incomplete", (1,), None, ramp(1.0)),
    row(2, real(2.5, pnu=27), first=2),
    row(3, real(1.5), first=8),
    rules="DS101@1#1 DS206@7 DS110@1#1",
)
def p28_passed(client: Client) -> None:
    """A Write without its response, then an accepted one: no later Read is that of the first."""
    client.ask_write(put(1, 1.0))
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.poll()
    client.exchange(ask(3), tell(3, 1.5))


# A record that mirrors no reference


FAILED = message.answer(9, 0x82, 1, message.error(2))
"""A negative response to a change of one parameter, under a reference that nobody sent."""


@BOOK.scene(
    "P27 P43 lost superseded mismatch",
    tx(1, "superseded", (1, 2), None, NOTHING),
    tx(2, "change mismatch", (3, None, 4, 5), 2, real(10.0, pnu=None), ref=2),
    rules="DS101@3#2 DS413@3#1 DS705@3#1 DS404@5#2 DS410@5#2",
)
def p71_family(client: Client) -> None:
    """A read is open, the Write response of a newer change is lost: a response to a change is for the latter."""
    client.write(ask())
    client.ask_write(put(2, 10.0))
    client.read(FAILED)


@BOOK.scene(
    "P27 P43 lost superseded mismatch",
    tx(1, "superseded", (1, 2), None, NOTHING),
    tx(2, "mismatch", (3, None, 4, 5), 2, real(2.5, pnu=None), real(3.5, pnu=None), ref=2),
    rules="DS101@3#2 DS413@3#1 DS705@3#1 DS404@5#2",
)
def p71_count(client: Client) -> None:
    """Two reads, of one parameter and of two: a response with two is that of the newer one."""
    client.write(ask())
    client.ask_write(ask(2, 27, 28))
    client.read(tell(9, 2.5, 3.5))


@BOOK.scene(
    "P29 P43 lost mismatch incomplete",
    tx(1, "mismatch", (1, 2, 4, 5), 4, real(2.5, pnu=None)),
    tx(2, "change incomplete", (3,), None, ramp(10.0), ref=2),
    rules="DS101@3#2 DS110@3#2 DS404@5#1",
)
def p71_family_of_the_open_one(client: Client) -> None:
    """A response to a read is that of the read, though a change was written behind it."""
    client.write(ask())
    client.ask_write(put(2, 10.0))
    client.read(tell(9, 2.5))


@BOOK.scene(
    "P29 P43 lost mismatch incomplete",
    tx(1, "mismatch", (1, 2, 3, 5), 4, par(None, error=(2, 0))),
    tx(2, "change incomplete", (4,), None, ramp(10.0), ref=2),
    rules="DS110@4#2 DS101@4#2 DS404@5#1 DS405@5#1 DS410@5#1",
)
def p71_asked_before(client: Client) -> None:
    """The Read that brings it was asked for before the change was written: it is for the open read."""
    client.write(ask())
    call = client.ask_read()
    client.ask_write(put(2, 10.0))
    client.accept_read(call, FAILED)


@BOOK.scene(
    "P29 lost orphan incomplete",
    row(1, par(RAMP, "Float32", 5.0, error=(2, 0)), state="change error"),
    tx(2, "incomplete", (5, 6), None, par(21), ref=2),
    tx(3, "change incomplete", (7,), None, ramp(10.0), ref=3),
    orphan(4, 8, par(None, error=(2, 0)), state="change orphan"),
    rules="DS410@4#1 DS701@4#1 DS110@5#2 DS101@7#3 DS110@7#3 DS403@9#4 DS410@9#4 DS701@9#4",
)
def p77_old_answer(client: Client) -> None:
    """What is read is the last response once more: of the open read, or of the change behind it."""
    old = message.answer(1, 0x82, 1, message.error(2))
    client.exchange(put(1, 5.0), old)
    client.write(ask(2))
    client.ask_write(put(3, 10.0))
    client.read(old)


@BOOK.scene(
    "P43 P73 lost mismatch incomplete poll",
    tx(1, "mismatch", (1, 2, 4, 5), 4, real(2.5, pnu=None)),
    tx(2, "incomplete", (3,), None, par(27), ref=2, polls=[(6, 7)]),
    row(3, real(1.5), first=8),
    rules="DS110@3#2 DS101@3#2 DS404@5#1",
)
def p72_displaced(client: Client) -> None:
    """A record may be of either of two reads: that of the newer one is not said to be unread (no DS413)."""
    client.write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(9, 2.5))
    client.poll()
    client.exchange(ask(3), tell(3, 1.5))


@BOOK.scene(
    "P43 lost mismatch incomplete",
    tx(1, "mismatch", (1, 2, 4, 5), 4, real(2.5, pnu=None)),
    tx(2, "incomplete", (3,), None, par(27), ref=2),
    rules="DS110@3#2 DS101@3#2 DS404@5#1",
)
def p72_unanswered(client: Client) -> None:
    """A record may be of either of two reads: of the newer one is not said that it is without a response."""
    client.write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(9, 2.5))


@BOOK.scene(
    "P27 lost superseded count",
    tx(1, "superseded", (1, 2), None, NOTHING),
    tx(2, "change ok", (3, None, 4, 5), 2, ramp(10.0)),
    rules="DS101@3#2 DS413@3#1 DS415@3#2 DS705@3#1",
)
def p71_one_reference_for_all(client: Client) -> None:
    """Read and change have one reference: a response to a change is the change's (its Write response is lost)."""
    client.write(ask())
    client.ask_write(put(1, 10.0))
    client.read(message.changed(1, 1))


@BOOK.scene(
    "P33 lost poll disorder orphan",
    tx(1, "incomplete", (1, 8), None, NOTHING),
    row(2, real(2.5, pnu=27), first=2),
    tx(3, "incomplete", (9,), None, par(28), ref=1),
    orphan(4, 10, real(1.5, pnu=None)),
    rules="DS110@1#1 DS110@9#3 DS206@7 DS101@9#3 DS403@11#4",
)
def p77_one_reference_for_all(client: Client) -> None:
    """Two reads have one reference: the record may be that of the open one or of the other; it goes to none."""
    call = client.ask_write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.poll()
    client.accept_write(call, ask())
    client.ask_write(ask(1, 28))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P31 lost reread",
    tx(1, "incomplete", (1,), None, NOTHING),
    row(2, real(2.5, pnu=27), real(3.5, pnu=28), first=2, ref=1, rereads=[(6, 7)]),
    rules="DS101@1#1 DS110@1#1 DS415@2#2 DS704@7#2",
)
def p28_other_kind(client: Client) -> None:
    """A response is read once more that has the reference of an older Write, and not its number of parameters."""
    client.ask_write(ask())
    client.exchange(ask(1, 27, 28), tell(1, 2.5, 3.5))
    client.read(tell(1, 2.5, 3.5))


# The Read


@BOOK.scene("P40 refused", row(1, real(1.5), state="refused", write="DF80B500"), rules="DS203@2#1")
def p30_read_after_refused(client: Client) -> None:
    """Without an open request a Read belongs to the refused Write; the state stays refused."""
    client.write(ask(), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P40 refused",
    tx(1, "refused", (1, 2), None, NOTHING, write="DF80B500"),
    row(2, real(2.5, pnu=27), state="refused", first=3, write="DF80B500"),
    rules="DS203@2#1 DS203@4#2",
)
def p30_latest_refused(client: Client) -> None:
    """Two refused Writes: the Read belongs to the latest."""
    client.write(ask(), status=NOT_POSSIBLE)
    client.write(ask(2, 27), status=NOT_POSSIBLE)
    client.read(tell(2, 2.5))


@BOOK.scene(
    "P31 refused",
    row(1, real(1.5)),
    row(2, real(1.5), state="refused", write="DF80B500", ref=1),
    rules="DS415@5#2 DS203@6#2 DS705@5#2 DS704@8#2",
)
def p30_before_reread(client: Client) -> None:
    """The refused Write comes before the last response, even where the bytes are the same."""
    client.exchange(ask(), tell(1, 1.5))
    client.write(ask(), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P31 P26 refused reread",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), rereads=[(7, 8)]),
    tx(2, "refused", (3, 4), None, par(27), ref=2, write="DF80B500"),
    rules="DS203@4#2 DS705@3#2 DS704@8#1",
)
def p30_read_since(client: Client) -> None:
    """Something was read since the refused Write: the next Read is not its own."""
    client.write(ask())
    client.write(ask(2, 27), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))
    client.read(tell(1, 1.5))


BOOK.lab(
    "P31",
    "record-reread",
    "P48 reread",
    row(1, real(1500.0), rereads=[(5, 6), (7, 8)]),
    rules="DS704@6#1",
)


@BOOK.scene(
    "P32 orphan late-read", row(1, real(1.5)), orphan(2, 5, real(1.5, pnu=None)), rules="DS403@6#2"
)
def p54_read_after_600_s(client: Client) -> None:
    """After 600 s without a call the channel is forgotten, its last response too: an orphan."""
    client.exchange(ask(), tell(1, 1.5))
    client.wait(601_000)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P31 P39 orphan", row(1, real(1.5)), orphan(2, 5, real(2.5, pnu=None)), rules="DS403@6#2"
)
def p32_other_bytes(client: Client) -> None:
    """Another Read with other bytes than the last response: an orphan."""
    client.exchange(ask(), tell(1, 1.5))
    client.read(tell(1, 2.5))


@BOOK.scene(
    "P39 malformed orphan",
    row(1, real(1.5), par(27)),
    orphan(2, 5, real(1.5, pnu=None)),
    rules="DS106@4 DS106@6 DS403@6#2",
)
def p32_cut_of_another_length(client: Client) -> None:
    """The capture has the same bytes of two records, the first value of each; the second one is longer."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5))
    tape(client).cut(6)
    client.read(message.answer(1, 1, 1, message.real(1.5), message.real(2.5, 3.5)))
    tape(client).cut(10)


BOOK.lab(
    "P32",
    "transport-starts-late",
    "P39 P48 starts-late orphan",
    orphan(1, 2, real(1500.0, pnu=None), index=0xB02F),
    rules="DS102@1 DS403@3#1",
)


@BOOK.scene("P53 nothing-to-read malformed", rules="DS108@2")
def p33_empty_body_nothing_asked(client: Client) -> None:
    """A Read on a channel without a request, whose response has no body: that is the cause, and said once."""
    client.channel = client.at(index=0xB02F)
    client.reply(client.ask_read(), b"")


@BOOK.scene("P78 nothing-to-read", rules="DS110@2 DS110@4 DS110@6")
def p73_nothing_to_read(client: Client) -> None:
    """The same Reads at the begin of a capture: their request may lie before it."""
    client.channel = client.at(index=0xB02F)
    client.poll(BUSY)
    client.poll(0xDE80B000, with_header=False)
    client.read(b"")


@BOOK.scene("nothing-to-read", rules="DS206@4 DS206@6 DS206@8")
def p33_nothing_to_read(client: Client) -> None:
    """Reads without data on a channel without a request since its Connect: busy, refused, and positive."""
    client.connect("plc")
    client.channel = client.at(index=0xB02F)
    client.poll(BUSY)
    client.poll(0xDE80B000, with_header=False)
    client.read(b"")


BOOK.lab(
    "P34",
    "record-polls",
    "P48 poll",
    tx(1, "ok", (1, 2, 9, 10), 39, real(1500.0), polls=[(3, 4), (5, 6), (7, 8)]),
)


@BOOK.scene(
    "P38 P40 P73 poll",
    tx(1, "incomplete", (1, 2), None, NOTHING, polls=[(3, 4)]),
    rules="DS110@1#1",
)
def p34_polls_then_end(client: Client) -> None:
    """Only polls until the end of the capture: unanswered, not refused."""
    client.write(ask())
    client.poll()


@BOOK.scene(
    "P40 P48 read-refused",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5), polls=[(3, 4), (5, 6)]),
    rules="DS201@4#1 DS712@4#1",
)
def p34_too_short(client: Client) -> None:
    """A Read asks for fewer bytes than the response has, the next one comes too early: a longer one brings it."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=8), SHORT)
    client.poll()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P40 read-refused",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)]),
    rules="DS201@4#1",
)
def p34_too_long(client: Client) -> None:
    """The Read that was refused for its length asked for as many bytes: MLEN is not blamed."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=240), SHORT)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P40 P41 read-refused",
    tx(1, "refused", (1, 2, 5, 6), None, NOTHING, read="DE80B100", polls=[(3, 4)]),
    row(2, real(2.5, pnu=27), first=7),
    rules="DS201@4#1 DS201@6#1",
)
def p34_too_short_then_written(client: Client) -> None:
    """Nothing is read but refusals for the length: refused, and not displaced by the next Write."""
    client.write(ask())
    client.poll(SHORT)
    client.poll(SHORT)
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P38 P40 read-refused poll",
    tx(1, "refused", (1, 2, 3, 4), None, NOTHING, read="DE80B100", polls=[(5, 6)]),
    rules="DS201@4#1",
)
def p34_too_short_then_end(client: Client) -> None:
    """The same at the end of the capture, also where a poll follows."""
    client.write(ask())
    client.poll(SHORT)
    client.poll()


@BOOK.scene(
    "P32 P40 read-refused orphan",
    tx(1, "refused", (1, 2, 5, 6), None, NOTHING, read="DE80B600", polls=[(3, 4)]),
    orphan(2, 7, real(1.5, pnu=None)),
    rules="DS201@4#1 DS201@6#1 DS403@8#2",
)
def p35_too_short_then_refused(client: Client) -> None:
    """Another refusal behind it ends the transaction: a record that comes later is an orphan."""
    client.write(ask())
    client.poll(SHORT)
    client.poll(0xDE80B600)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "read-refused",
    tx(1, "ok", (1, None, 4, 5), 4, real(1.5), polls=[(2, 3)], write=None),
    rules="DS101@1#1 DS201@3#1",
)
def p28_too_short(client: Client) -> None:
    """A Read that is too short proves no Write; the record behind it does."""
    client.ask_write(ask())
    client.poll(SHORT)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P32 P40 read-refused orphan",
    row(1, NOTHING, state="refused", ms=None, read="DE80B600"),
    orphan(2, 5, real(1.5, pnu=None)),
    rules="DS201@4#1 DS403@6#2",
)
def p35_read_refused(client: Client) -> None:
    """Any other negative status ends the transaction: a record that comes later is an orphan."""
    client.write(ask())
    client.poll(0xDE80B600)
    client.read(tell(1, 1.5))


BOOK.lab(
    "P36",
    "record-read-empty",
    "empty-read",
    tx(1, "ok", (1, 2, 5, 6), 25, real(1500.0)),
    rules="DS207@4#1",
)


@BOOK.scene(
    "P42 unanswered",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    tx(2, "change unanswered", (3, 4), None, ramp(10.0), ref=2, slot=2),
    row(3, real(1.5), first=5, slot=3),
    rules="DS401@1#1 DS402@3#2",
)
def p38_end(client: Client) -> None:
    """A read and a change that nobody fetches until the capture ends, 12 s later."""
    client.write(ask())
    client.write(put(2, 10.0), at=client.at(slot=2))
    client.wait(12_000)
    client.exchange(ask(3), tell(3, 1.5), at=client.at(slot=3))


@BOOK.scene(
    "P38 P80 incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    tx(2, "change incomplete", (3, 4), None, ramp(10.0), ref=2, slot=2),
    rules="DS110@1#1 DS110@3#2",
)
def p73_end(client: Client) -> None:
    """The capture ends right behind them: their responses may be fetched after it."""
    client.write(ask())
    client.write(put(2, 10.0), at=client.at(slot=2))


@BOOK.scene(
    "P42 P32 release orphan",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    orphan(2, 5, real(1.5, pnu=None)),
    rules="DS401@1#1 DS403@6#2 DS722@1#1",
)
def p38_release(client: Client) -> None:
    """The AR is released: what was open stays unanswered, a later Read finds nothing."""
    client.write(ask())
    client.release()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P27 unanswered",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    row(2, real(2.5, pnu=27), first=5),
    rules="DS401@1#1 DS722@1#1",
)
def p38_set_up_anew(client: Client) -> None:
    """The AR is set up anew, its Release is not there: the next Write displaces nothing."""
    client.write(ask())
    client.connect("plc")
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P14 release interleaved",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
    tx(2, "unanswered", (3, 4), None, NOTHING, **HOME2),
    rules="DS401@3#2 DS722@3#2",
)
def p38_release_of_another_ar(client: Client) -> None:
    """The release of one AR leaves the other alone."""
    other = second(client)
    client.write(ask())
    other.write(ask())
    other.release()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P14 release interleaved",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
    tx(2, "unanswered", (3, 4), None, NOTHING, controller="192.168.133.3"),
    rules="DS401@3#2 DS722@3#2",
)
def p38_release_by_another_controller(client: Client) -> None:
    """An AR with the same UUID between another controller and the drive is another AR."""
    other = second(client, channel=wire.RecordId(CONTROLLER_AR))
    client.write(ask())
    other.write(ask())
    other.release()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P32 P42 expiry orphan",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    orphan(2, 3, real(1.5, pnu=None)),
    rules="DS401@1#1 DS403@4#2",
)
def p38_expiry(client: Client) -> None:
    """A Read 601 s after the Write comes too late."""
    client.write(ask())
    client.wait(601_000)
    client.read(tell(1, 1.5))


@BOOK.scene("P29 late-read", row(1, real(1.5), ms=599_003))
def p38_not_expired(client: Client) -> None:
    """A Read 599 s after the Write is in time."""
    client.write(ask())
    client.wait(599_000)
    client.read(tell(1, 1.5))


# States


@BOOK.scene(
    "P28 disorder refused",
    tx(1, "refused", (1, 4, 2, 3), 2, real(1.5), write="DF80B500"),
    rules="DS203@4#1",
)
def p40_refused_after_the_read(client: Client) -> None:
    """A negative Write response after the Read that brought the record: refused, and it is said."""
    call = client.ask_write(ask())
    client.read(tell(1, 1.5))
    client.accept_write(call, ask(), status=NOT_POSSIBLE)


for _name, _rules, _values in (
    ("wrong-reference", "DS404@4#1", (10.0,)),
    ("wrong-axis", "DS406@4#1", (10.0,)),
    ("wrong-id", "DS405@4#1", ()),
    ("more-parameters", "DS407@4#1", (10.0, 5.0)),
):  # the values are kept without a parameter number
    _parameters = (real(value, pnu=None) for value in _values)
    _expected = row(1, *_parameters, state="mismatch")
    BOOK.lab("P43", f"conversation-{_name}", "mismatch", _expected, rules=_rules)


@BOOK.scene(
    "mismatch",
    row(1, ramp(10.0), state="change ok"),
    row(2, real(9.5, pnu=None), state="mismatch"),
    row(3, ramp(10.0)),
    rules="DS404@8#2",
)
def p43_no_history(client: Client) -> None:
    """The value of a mismatch is not compared with what was written (no DS417)."""
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.exchange(ask(2, 1120), tell(1, 9.5))
    client.exchange(ask(3, 1120), tell(3, 10.0))


@BOOK.scene("P46 count", row(1, ramp(10.0), state="change ok"), rules="DS407@4#1")
def p43_count_without_blocks(client: Client) -> None:
    """A change answered with count 2 but no value block: a finding, no mismatch."""
    client.exchange(put(1, 10.0), message.changed(1, 1, count=2))


@BOOK.scene(
    "drive-error",
    row(1, par(21, error=(0, 0)), par(27, error=(0x6B, 3)), state="error"),
    rules="DS410@4#1 DS410@4#1 DS701@4#1",
)
def p44_all_failed(client: Client) -> None:
    """Both parameters failed."""
    answer = message.answer(1, 0x81, 1, message.error(0), message.error(0x6B, 3))
    client.exchange(ask(1, 21, 27), answer)


BOOK.lab(
    "P44",
    "conversation-not-supported",
    "drive-error",
    row(1, par(21, error=(0x21, 0)), state="error"),
    rules="DS410@4#1 DS418@4#1",
)


@BOOK.scene(
    "drive-error",
    row(1, real(1.5), par(27, error=(0x21, 0)), state="error"),
    rules="DS410@4#1 DS418@4#1",
)
def p44_not_supported_in_part(client: Client) -> None:
    """Response id 0x80 is an error, whatever its blocks say."""
    answer = message.answer(1, 0x80, 1, message.real(1.5), message.error(0x21))
    client.exchange(ask(1, 21, 27), answer)


BOOK.lab(
    "P45",
    "conversation-accepted-with-other-length",
    "drive-error",
    row(1, par(1120, "Float32", 10.0, error=(0x18, 0)), state="change error"),
    row(2, ramp(10.0), state="change ok"),
    rules="DS314@1#1 DS410@4#1 DS717@4#1 DS419@5#2",
)


@BOOK.scene(
    "drive-error",
    row(1, par(1120, "Float32", 10.0, error=(0x18, 0)), state="change error"),
    row(2, ramp(12.5), state="change ok"),
    rules="DS314@1#1 DS410@4#1 DS717@4#1",
)
def p45_accepted_with_another_value(client: Client) -> None:
    """Length and value differ: which of the two was wrong nobody knows."""
    refused = message.answer(1, 0x82, 1, message.error(0x18))
    client.exchange(put(1, 10.0) + bytes(20), refused)
    client.exchange(put(2, 12.5), message.changed(2, 1))


BOOK.lab(
    "P45",
    "conversation-partial-read",
    "P37 drive-error",
    row(1, real(10.0), par(27, error=(0, 0)), state="partial"),
    rules="DS410@4#1 DS701@4#1",
)
BOOK.lab(
    "P45",
    "conversation-partial-change",
    "P37 drive-error",
    row(1, ramp(10.0), par(1121, "Float32", 5.0, error=(0x6B, 0)), state="change partial"),
    rules="DS410@4#1 DS719@4#1",
)


@BOOK.scene(
    "dropped orphan unanswered",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    tx(2, "change unanswered", (3, 4), None, ramp(10.0), ref=2, slot=2),
    orphan(3, 5, real(1.5, pnu=None), slot=3),
    row(4, real(1.5), first=7, slot=4),
    rules="DS401@1#1 DS402@3#2 DS403@6#3",
)
def p47_dropped(client: Client) -> None:
    """The capture says that it lost 12 frames: unanswered and orphan transactions say so."""
    client.stage.dropped = 12
    client.write(ask())
    client.write(put(2, 10.0), at=client.at(slot=2))
    client.read(tell(1, 1.5), at=client.at(slot=3))
    client.wait(12_000)
    client.exchange(ask(4), tell(4, 1.5), at=client.at(slot=4))


@BOOK.scene(
    "interleaved orphan",
    tx(1, "orphan", (None, None, 1, 6), None, real(9.5, pnu=None), ref=7),
    row(2, real(1.5), first=2, slot=2, ref=1),
    rules="DS403@6#1",
)
def p49_by_first_frame(client: Client) -> None:
    """A Read that began first and ended last has the lower id."""
    other = replace(client, activity=UUID(int=0x48), channel=client.at(slot=2))
    call = client.ask_read()
    other.exchange(ask(), tell(1, 1.5))
    client.accept_read(call, tell(7, 9.5))


# A case for each rule that no sentence above needs: transport, time and values


BOOK.lab(
    "P25",
    "transport-fault",
    "P12 P40 P53 fault refused",
    tx(1, "refused", (1, 2), None, NOTHING, write=None),
    row(2, real(1500.0), first=3),
    rules="DS104@2#1",
)
BOOK.lab(
    "P29",
    "transport-reject",
    "P12 P53 fault",
    tx(1, "ok", (1, 2, 5, 6), 55, real(1500.0)),
    rules="DS104@4#1",
)


@BOOK.scene(
    "P11 P12 P29 P48 fragments lost", tx(1, "ok", (2, 4, 9, 11), 10, real(1.5)), rules="DS105@7#1"
)
def p3_fragment_lost(client: Client) -> None:
    """The last fragment of the Read response is lost, and the record is read again: it is there in part."""
    client.fragment = 60
    client.exchange(ask(), tell(1, 1.5))
    client.stage.lose()
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P11 P12 P29 P48 fragments lost", tx(1, "ok", (2, 4, 9, 11), 10, real(1.5)), rules="DS105@7#1"
)
def p3_first_fragment_lost(client: Client) -> None:
    """The first fragment of the Read response is lost: the last one says whose it is, by its RPC header."""
    client.fragment = 60
    client.exchange(ask(), tell(1, 1.5))
    client.stage.lose(-2)
    client.read(tell(1, 1.5))


@BOOK.scene("P67 malformed", row(1, real()), rules="DS106@4")
def p53_frame_cut(client: Client) -> None:
    """The frame of the Read response lacks its last two bytes, half of the only value."""
    client.exchange(ask(), tell(1, 1.5))
    tape(client).cut(2)


@BOOK.scene("malformed", row(1, real(), state="error"), rules="DS202@4 DS315@4#1")
def p53_pdu_longer_than_its_datagram(client: Client) -> None:
    """The datagram of the Read response ends two bytes too early, and the frame is whole: nothing was cut."""
    client.exchange(ask(), tell(1, 1.5))
    step = tape(client).steps[-1]
    step["bytes"] = step["bytes"][:-4]


@BOOK.scene("P3 fragments malformed", tx(1, "ok", (2, 3, 4, 6), 4, real()), rules="DS106@5")
def p53_fragment_cut(client: Client) -> None:
    """The frame with the first of two fragments of the Read response is cut: that one is named."""
    client.fragment = 92
    client.exchange(ask(), tell(1, 1.5))
    tape(client).cut(2, -2)


@BOOK.scene(
    "P3 P32 P39 fragments lost orphan",
    orphan(1, 3, real(1.5, pnu=None), index=0xB02F),
    rules="DS105@1 DS403@4#1",
)
def p11_request_in_part(client: Client) -> None:
    """The last fragment of the Write request is lost: its response is not without a request in the capture."""
    client.fragment = 60
    there = client.at(index=0xB02F)
    call = client.ask_write(ask(), at=there)
    client.stage.lose()
    client.fragment = None
    client.accept_write(call, ask(), at=there)
    client.read(tell(1, 1.5), at=there)


BOOK.lab("P53", "record-length", "malformed", row(1, real(1500.0)), rules="DS202@4")
BOOK.lab(
    "P53",
    "transport-empty-body",
    "P12 P29 malformed",
    tx(1, "ok", (1, 2, 5, 6), 55, real(1500.0)),
    rules="DS108@4#1",
)


def polled(count: int) -> list[tuple[int, int]]:
    """So many polls right behind a Write: frames 3 and 4, 5 and 6, ..."""
    return [(3 + 2 * n, 4 + 2 * n) for n in range(count)]


def play_polls(client: Client, count: int) -> None:
    """A read whose response is there after so many polls."""
    client.write(ask())
    for _ in range(count):
        client.poll()
    client.read(tell(1, 1.5))


@BOOK.scene("poll", tx(1, "ok", (1, 2, 21, 22), 21, real(1.5), polls=polled(9)))
def p34_nine_polls(client: Client) -> None:
    """Nine polls are nothing to speak of."""
    play_polls(client, 9)


@BOOK.scene(
    "poll", tx(1, "ok", (1, 2, 23, 24), 23, real(1.5), polls=polled(10)), rules="DS204@24#1"
)
def p34_ten_polls(client: Client) -> None:
    """Ten polls are worth a note."""
    play_polls(client, 10)


@BOOK.scene(
    "P48 poll lost",
    tx(1, "ok", (1, 2, 6, 7), 1507, real(1.5), polls=[(None, 3), (4, 5)]),
    rules="DS102@3 DS205@7#1",
)
def p34_first_poll_half_lost(client: Client) -> None:
    """The request of the first Read is missing: how long the drive took of 1507 ms is not known."""
    client.write(ask())
    client.stage.deaf = True
    read = client.ask_read()
    client.stage.deaf = False
    client.refuse_read(read, BUSY)
    client.poll()
    client.wait(1500)
    client.read(tell(1, 1.5))


@BOOK.scene("P75 poll", tx(1, "ok", (1, 2, 5, 6), 1503, real(1.5), polls=[(3, 4)]))
def p48_number_missing(client: Client) -> None:
    """A number is missing before the poll: what waits may be the same request once more."""
    client.write(ask())
    client.call(wire.READ)
    client.poll()
    client.wait(1498)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P48 poll slow", tx(1, "ok", (1, 2, 5, 6), 1002, real(1.5), polls=[(3, 4)]), rules="DS416@6#1"
)
def p34_polled_1000_ms(client: Client) -> None:
    """Exactly 1000 ms from the first poll to the response: not too long, but the drive is slow."""
    client.write(ask())
    client.poll()
    client.wait(997)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P48 poll slow",
    tx(1, "ok", (1, 2, 5, 6), 1003, real(1.5), polls=[(3, 4)]),
    rules="DS205@6#1 DS416@6#1",
)
def p34_polled_1001_ms(client: Client) -> None:
    """1001 ms from the first poll to the response."""
    client.write(ask())
    client.poll()
    client.wait(998)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P11 P38 lost incomplete",
    row(1, real(1.5)),
    tx(2, "incomplete", (6, 7), None, par(27), ref=2),
    rules="DS101@5 DS110@6#2",
)
def p29_lost_read_before_the_write(client: Client) -> None:
    """A Read without its RPC response came before the Write that is open when it is given up: not its Read."""
    client.exchange(ask(1), tell(1, 1.5))
    client.ask_read()
    client.write(ask(2, 27))


@BOOK.scene(
    "P30 refused",
    row(1, ramp(10.0), state="change ok"),
    row(2, ramp(10.0), state="change refused", ms=None, read="DE80B700", ref=1),
    row(3, ramp(10.0), state="change refused", write="DF80B700", ref=1),
    rules="DS201@8#2 DS203@10#3 DS415@5#2 DS415@9#3",
)
def p35_old_response_after_refused_read(client: Client) -> None:
    """The Read of an accepted change is refused: a later response may be its, and is not called an old one."""
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.write(put(1, 10.0))
    client.poll(0xDE80B700)
    client.write(put(1, 10.0), BAD_HEADER)
    client.read(message.changed(1, 1))


BOOK.lab(
    "P37",
    "conversation-fewer-values",
    "P46 values",
    row(1, real(1.0, 2.0, pnu=2902)),
    rules="DS408@4#1",
)


@BOOK.scene("P46 values", row(1, real()), rules="DS408@4#1")
def p37_zero_asked_none_answered(client: Client) -> None:
    """Number of elements 0 asks for one value, as 1 does; the block has none."""
    request = message.read(1, 1, message.address(21, elements=0))
    client.exchange(request, message.answer(1, 1, 1, message.real()))


BOOK.lab(
    "P37",
    "conversation-more-values",
    "P46 values",
    row(1, par(964, "Unsigned16", 1, 2, 3, 4, 5)),
    rules="DS409@4#1",
)


@BOOK.scene(
    "drive-error malformed",
    row(1, real(1.5), par(27, error=(0x11, 0)), state="partial"),
    rules="DS410@4#1 DS411@4#1",
)
def p45_positive_id(client: Client) -> None:
    """One of two failed, and the response id says that none did."""
    answer = message.answer(1, 0x01, 1, message.real(1.5), message.error(0x11))
    client.exchange(ask(1, 21, 27), answer)


@BOOK.scene("P43 P44 malformed", row(1, ramp(10.0), state="change ok"), rules="DS315@4#1")
def p46_change_header_cut(client: Client) -> None:
    """The positive response id says that the change was done; the number of parameters is missing."""
    client.exchange(put(1, 10.0), message.changed(1, 1)[:3])


@BOOK.scene("P43 P44 malformed count", row(1, real(1.5)), rules="DS315@4#1 DS407@4#1")
def p46_announced_block_missing(client: Client) -> None:
    """Two blocks announced, the only one that was asked for is there: no parameter is missing."""
    answer = tell(1, 1.5)
    client.exchange(ask(), answer[:3] + bytes([2]) + answer[4:])


BOOK.lab(
    "P44",
    "conversation-negative-without-error",
    "malformed",
    row(1, real(10.0), state="error"),
    rules="DS412@4#1",
)


@BOOK.scene("malformed", row(1, ramp(10.0), state="change error"), rules="DS412@4#1")
def p44_negative_id_change(client: Client) -> None:
    """The same of a change: done, says the block, and the response id says that something failed."""
    client.exchange(put(1, 10.0), message.answer(1, 0x82, 1, message.done()))


BOOK.lab(
    "P44",
    "message-missing-response",
    "malformed",
    row(1, real(), state="error", index=0xB02F),
    rules="DS315@4#1",
)


@BOOK.scene("malformed", row(1, real(1.5), par(27, "Float32"), state="partial"), rules="DS315@4#1")
def p45_response_cut(client: Client) -> None:
    """The device sent the first of two values, and half of the second."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5)[:-2])


@BOOK.scene("malformed", row(1, real(1.5), par(27, "Float32"), state="partial"), rules="DS106@4")
def p67_negative_frame_cut(client: Client) -> None:
    """One value was captured, the other half; the response id says that something failed."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5, identifier=0x81))
    tape(client).cut(2)


@BOOK.scene("malformed", row(1, par(21), par(27), state="incomplete"), rules="DS106@4")
def p67_no_block_captured(client: Client) -> None:
    """The capture has the header alone, which says that something failed: whether all did, nobody knows."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5, identifier=0x81))
    tape(client).cut(12)


@BOOK.scene("malformed", row(1, par(21), state="error"), rules="DS106@4")
def p67_one_parameter_negative(client: Client) -> None:
    """The same where one parameter was asked for: that one failed."""
    client.exchange(ask(1, 21), tell(1, 1.5, identifier=0x81))
    tape(client).cut(6)


@BOOK.scene("malformed", row(1, real(1.5), par(27, "Integer8", 7), state="error"), rules="DS106@4")
def p67_all_blocks_captured(client: Client) -> None:
    """The capture lacks the pad byte alone: all that was asked for is there, and nothing says what failed."""
    blocks = message.real(1.5), message.block(0x02, "b", 7) + bytes(1)
    client.exchange(ask(1, 21, 27), message.answer(1, 0x81, 1, *blocks))
    tape(client).cut(1)


@BOOK.scene("malformed", row(1, real(1.5), par(27), state="partial"), rules="DS106@4 DS407@4#1")
def p67_fewer_parameters(client: Client) -> None:
    """A positive response to two parameters says that it has one; its value is there."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5) + bytes(4))
    tape(client).cut(2)


@BOOK.scene("malformed", row(1, par(21, "VisibleString")), rules="DS106@4 DS409@4#1")
def p67_string_cut(client: Client) -> None:
    """The capture has the begin of a string, which is no value."""
    client.exchange(ask(1, 21), message.answer(1, 1, 1, message.raw_block(9, 8, b"Terminal")))
    tape(client).cut(4)


@BOOK.scene("malformed", row(1, real(1.5), par(27)), rules="DS106@4")
def p67_blocks_not_captured(client: Client) -> None:
    """The capture lacks the second block, and the response id says that nothing failed."""
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5))
    tape(client).cut(6)


@BOOK.scene(
    "values",
    row(1, ramp(10.0), state="change ok"),
    row(2, ramp(10.0)),
    row(3, ramp(11.0)),
    rules="DS417@12#3",
)
def p46_read_back(client: Client) -> None:
    """What was written is read back, first as it was written, then another value."""
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.exchange(ask(2, 1120), tell(2, 10.0))
    client.exchange(ask(3, 1120), tell(3, 11.0))


@BOOK.scene(
    "values",
    row(1, par(974, "Unsigned16", 16)),
    row(2, real(1.5), real(2.5, pnu=27)),
    row(3, real(1.5), real(2.5, pnu=27), real(3.5, pnu=25)),
    rules="DS316@9#3",
)
def p46_message_long(client: Client) -> None:
    """The drive says that it takes 16 bytes: a request of 16 is no finding, one of 22 is."""
    client.exchange(ask(1, 974), message.answer(1, 1, 1, message.word(16)))
    client.exchange(ask(2, 21, 27), tell(2, 1.5, 2.5))
    client.exchange(ask(3, 21, 27, 25), tell(3, 1.5, 2.5, 3.5))


MANY = range(100, 140)
"""Parameters: one more than the usual number."""


@BOOK.scene("values", row(1, *(real(pnu / 2, pnu=pnu) for pnu in MANY)))
def p46_as_many_parameters_as_the_drive_takes(client: Client) -> None:
    """40 parameters of which the drive gives all: not too many, and not called so while the response is due."""
    client.exchange(ask(1, *MANY), tell(1, *(pnu / 2 for pnu in MANY)))


# Which parameter is meant


LOCAL = 0xB02E


def changed(value: float, reference: int, axis: int = 1, pnu: int = RAMP) -> tuple[bytes, bytes]:
    """A change of a Float32 and its response."""
    asked = message.change(reference, axis, (message.address(pnu), message.real(value)))
    return asked, message.changed(reference, axis)


def fetched(value: float, reference: int, axis: int = 1, pnu: int = RAMP) -> tuple[bytes, bytes]:
    """A read of a Float32 and its response."""
    return ask(reference, pnu, axis=axis), tell(reference, value, axis=axis)


@BOOK.scene(
    "values",
    row(1, ramp(10.0), state="change ok", axis=9, index=LOCAL, slot=2),
    row(2, ramp(9.5), axis=0, index=LOCAL, slot=2),
    row(3, ramp(10.0), state="change ok", axis=2, index=LOCAL, slot=2),
    row(4, ramp(9.5), axis=2, index=LOCAL),
    rules="DS417@8#2",
)
def p60_the_submodule_decides(client: Client) -> None:
    """Local access: the axis byte does not count, the slot does."""
    here, there = client.at(index=LOCAL), client.at(index=LOCAL, slot=2)
    client.exchange(*changed(10.0, 1, axis=9), at=there)
    client.exchange(*fetched(9.5, 2, axis=0), at=there)
    client.exchange(*changed(10.0, 3, axis=2), at=there)
    client.exchange(*fetched(9.5, 4, axis=2), at=here)


@BOOK.scene(
    "values",
    row(1, ramp(10.0), state="change ok"),
    row(2, ramp(9.5), state="change ok", index=LOCAL, slot=2),
    row(3, ramp(9.5)),
)
def p60_two_ways_to_one_parameter(client: Client) -> None:
    """Local access may have reached the same drive object: the value that was written last is not known."""
    client.exchange(*changed(10.0, 1))
    client.exchange(*changed(9.5, 2), at=client.at(index=LOCAL, slot=2))
    client.exchange(*fetched(9.5, 3))


@BOOK.scene(
    "values drive-error",
    row(1, par(RAMP, error=(0x19, 0)), state="error", axis=77),
    row(2, par(975, "Unsigned16", 3, subindex=7), axis=0, index=LOCAL, slot=2),
    row(3, ramp(10.0), state="change ok", axis=3),
    row(4, ramp(9.5), axis=9, index=LOCAL, slot=2),
    rules="DS410@4#1 DS417@16#4 DS709@4#1",
)
def p61_a_submodule_names_itself(client: Client) -> None:
    """PNU 975[7] of a submodule is its DO-ID: what was written to that drive object is read back there."""
    there = client.at(index=LOCAL, slot=2)
    client.exchange(ask(1, RAMP, axis=77), message.answer(1, 0x81, 77, message.error(0x19)))
    asked = message.read(2, 0, message.address(975, 7))
    client.exchange(asked, message.answer(2, 1, 0, message.word(3)), at=there)
    client.exchange(*changed(10.0, 3, axis=3))
    client.exchange(*fetched(9.5, 4, axis=9), at=there)


@BOOK.scene(
    "values drive-error",
    row(1, ramp(10.0), state="change ok", axis=2),
    row(2, ramp(9.5), state="change ok", axis=3),
    row(3, ramp(9.5), axis=2),
    row(4, par(RAMP, error=(0x19, 0)), state="error", axis=77),
    row(5, ramp(10.0), state="change ok", axis=2),
    row(6, ramp(9.5), state="change ok", axis=3),
    row(7, ramp(9.5), axis=2),
    rules="DS410@16#4 DS417@28#7 DS709@16#4",
)
def p62_two_axes(client: Client) -> None:
    """Two axis numbers may be one drive object until the device has refused a third."""
    client.exchange(*changed(10.0, 1, axis=2))
    client.exchange(*changed(9.5, 2, axis=3))
    client.exchange(*fetched(9.5, 3, axis=2))
    client.exchange(ask(4, RAMP, axis=77), message.answer(4, 0x81, 77, message.error(0x19)))
    client.exchange(*changed(10.0, 5, axis=2))
    client.exchange(*changed(9.5, 6, axis=3))
    client.exchange(*fetched(9.5, 7, axis=2))


@BOOK.scene(
    "values",
    row(1, real(10.0, pnu=61000), state="change ok", axis=2),
    row(2, real(9.5, pnu=61000), axis=3, index=LOCAL, slot=2),
    rules="DS417@8#2",
)
def p63_one_for_the_whole_device(client: Client) -> None:
    """PNU 61000 is one parameter, whichever drive object is asked."""
    client.exchange(*changed(10.0, 1, axis=2, pnu=61000))
    client.exchange(*fetched(9.5, 2, axis=3, pnu=61000), at=client.at(index=LOCAL, slot=2))


@BOOK.scene(
    "values",
    row(1, ramp(10.0), state="change ok"),
    tx(2, "change ok", (5, 6, 11, 12), 7, ramp(9.5), ref=2, index=0xB02F),
    row(3, ramp(9.5), first=7),
)
def p64_not_settled_yet(client: Client) -> None:
    """A change that was accepted is in force perhaps, before its response is fetched."""
    asked, answer = changed(9.5, 2)
    other = client.at(index=0xB02F)
    client.exchange(*changed(10.0, 1))
    client.write(asked, at=other)
    client.exchange(*fetched(9.5, 3))
    client.read(answer, at=other)


@BOOK.scene(
    "P44 values drive-error",
    row(1, ramp(9.5), state="change ok"),
    row(2, ramp(10.0), par(RAMP, "Float32", 8.0, error=(0x17, 0)), state="change partial"),
    row(3, ramp(10.0)),
    rules="DS410@8#2 DS701@8#2",
)
def p64_one_parameter_twice(client: Client) -> None:
    """A change writes a parameter twice, and the second time it is refused: the first value is in force."""
    where = message.address(RAMP)
    client.exchange(*changed(9.5, 1))
    asked = message.change(2, 1, (where, message.real(10.0)), (where, message.real(8.0)))
    client.exchange(asked, message.answer(2, 0x82, 1, message.done(), message.error(0x17)))
    client.exchange(*fetched(10.0, 3))


@BOOK.scene(
    "P32 values orphan",
    row(1, ramp(10.0), state="change ok"),
    orphan(2, 5, state="change orphan", slot=2, ref=2),
    row(3, ramp(9.5), first=7),
    rules="DS403@6#2",
)
def p64_change_without_its_request(client: Client) -> None:
    """The response to a change says that something was written, and its request is not there: it may be any."""
    client.exchange(*changed(10.0, 1))
    client.read(message.changed(2, 1), at=client.at(slot=2))
    client.exchange(*fetched(9.5, 3))


@BOOK.scene(
    "values superseded",
    row(1, ramp(10.0), state="change ok"),
    tx(2, "change superseded", (5, 6), None, ramp(9.5), ref=2, index=0xB02F),
    row(3, real(1.5), first=7, index=0xB02F),
    row(4, ramp(8.0), first=11),
    rules="DS414@7#2",
)
def p64_response_not_fetched(client: Client) -> None:
    """A change whose response nobody fetched makes the value unknown, on every channel."""
    other = client.at(index=0xB02F)
    client.exchange(*changed(10.0, 1))
    client.write(changed(9.5, 2)[0], at=other)
    client.exchange(ask(3), tell(3, 1.5), at=other)
    client.exchange(*fetched(8.0, 4))


@BOOK.scene(
    "values",
    row(1, ramp(10.0), state="change ok"),
    row(2, par(340, "Unsigned16", 1), state="change ok"),
    row(3, ramp(9.5)),
)
def p65_computed_anew(client: Client) -> None:
    """p0340 computes others: what was written before it is not known any more."""
    client.exchange(*changed(10.0, 1))
    asked = message.change(2, 1, (message.address(340), message.word(1)))
    client.exchange(asked, message.changed(2, 1))
    client.exchange(*fetched(9.5, 3))


@BOOK.scene(
    "values",
    row(1, par(2900, "Integer16", -32765), state="change ok"),
    row(2, par(2900, "Unsigned16", 32771)),
    row(3, par(RAMP, "Unsigned32", 10), state="change ok"),
    row(4, ramp(10.0)),
)
def p66_the_same_bits(client: Client) -> None:
    """-32765 and 32771 are the same 16 bits; 10 and 10.0 the same number."""
    where = message.address(2900)
    asked = message.change(1, 1, (where, message.block(0x03, "h", -32765)))
    client.exchange(asked, message.changed(1, 1))
    client.exchange(ask(2, 2900), message.answer(2, 1, 1, message.block(0x06, "H", 32771)))
    asked = message.change(3, 1, (message.address(RAMP), message.block(0x07, "I", 10)))
    client.exchange(asked, message.changed(3, 1))
    client.exchange(*fetched(10.0, 4))


@BOOK.scene(
    "values superseded",
    tx(1, "change superseded", (1, 2), None, ramp(9.5)),
    row(2, ramp(10.0), state="change ok", first=3),
    row(3, ramp(9.5), first=7),
    row(4, ramp(10.0), state="change ok", first=11),
    row(5, ramp(9.5), first=15),
    rules="DS414@3#1 DS417@18#5",
)
def p64_displaced_by_the_last_change(client: Client) -> None:
    """A change may be in force until it is displaced, so perhaps after the one that displaced it; no longer."""
    client.write(changed(9.5, 1)[0])
    client.exchange(*changed(10.0, 2))
    client.exchange(*fetched(9.5, 3))
    client.exchange(*changed(10.0, 4))
    client.exchange(*fetched(9.5, 5))


@BOOK.scene(
    "values drive-error",
    row(1, ramp(10.0), par(1121, "Float32", 5.0, error=(0x6B, 0)), state="change partial"),
    row(2, ramp(9.5), real(4.0, pnu=1121)),
    row(3, par(RAMP, "Float32", 8.0, error=(0x6B, 0)), real(5.0, pnu=1121), state="change error"),
    row(4, ramp(7.0), real(4.0, pnu=1121)),
    rules="DS410@4#1 DS417@8#2 DS410@12#3 DS407@12#3 DS719@4#1 DS719@12#3",
)
def p64_failed_in_part(client: Client) -> None:
    """What did not fail is in force; a block that is not there says nothing."""
    both = message.address(RAMP), message.address(1121)
    asked = message.change(1, 1, (both[0], message.real(10.0)), (both[1], message.real(5.0)))
    client.exchange(asked, message.answer(1, 0x82, 1, message.done(), message.error(0x6B)))
    client.exchange(ask(2, RAMP, 1121), tell(2, 9.5, 4.0))
    asked = message.change(3, 1, (both[0], message.real(8.0)), (both[1], message.real(5.0)))
    client.exchange(asked, message.answer(3, 0x82, 1, message.error(0x6B)))
    client.exchange(ask(4, RAMP, 1121), tell(4, 7.0, 4.0))


@BOOK.scene(
    "values",
    row(1, par(2900, "Unsigned16", 1, 2, 3, subindex=4), state="change ok"),
    row(2, par(2900, "Unsigned16", 9, subindex=5)),
    row(3, par(2900, "Unsigned16", 8, 3, subindex=5)),
    row(4, par(2900, "Unsigned16", 7, subindex=4)),
    rules="DS417@8#2 DS417@16#4",
)
def p64_elements(client: Client) -> None:
    """Each element is a parameter of its own; of what differs it is told once."""
    asked = message.change(1, 1, (message.address(2900, 4, 3), message.word(1, 2, 3)))
    client.exchange(asked, message.changed(1, 1))
    for number, first, values in ((2, 5, (9,)), (3, 5, (8, 3)), (4, 4, (7,))):
        asked = message.read(number, 1, message.address(2900, first, len(values)))
        client.exchange(asked, message.answer(number, 1, 1, message.word(*values)))


@BOOK.scene(
    "values superseded",
    tx(1, "change superseded", (1, 2), None, par(340, "Unsigned16", 1), index=0xB02F),
    row(2, ramp(10.0), state="change ok", first=3),
    row(3, real(1.5), first=7, index=0xB02F),
    row(4, ramp(9.5), first=11),
    row(5, ramp(10.0), state="change ok", first=15),
    row(6, ramp(9.5), first=19),
    rules="DS414@7#1 DS417@22#6",
)
def p65_displaced(client: Client) -> None:
    """A change of p0340 whose response nobody fetched may have come until it was displaced."""
    other = client.at(index=0xB02F)
    asked = message.change(1, 1, (message.address(340), message.word(1)))
    client.write(asked, at=other)
    client.exchange(*changed(10.0, 2))
    client.exchange(ask(3), tell(3, 1.5), at=other)
    client.exchange(*fetched(9.5, 4))
    client.exchange(*changed(10.0, 5))
    client.exchange(*fetched(9.5, 6))


# What is not in the capture


@BOOK.scene(
    "P7 P38 P73 P80 lost incomplete retransmission release",
    tx(1, "incomplete", (1, 2, 3), None, NOTHING),
    rules="DS101@3#1 DS103@4#1 DS110@1#1",
)
def p74_sent_again(client: Client) -> None:
    """The Read is sent again, and its client is quiet then: it may have the response, late as that may be."""
    client.write(ask())
    call = client.ask_read()
    client.wait(500)
    client.ask(call, wire.read_request(call.sequence, client.channel))
    client.wait(500)
    client.release()


@BOOK.scene(
    "P38 P73 P80 lost incomplete release",
    tx(1, "incomplete", (1, 2, 3), None, NOTHING),
    rules="DS101@3#1 DS110@1#1",
)
def p74_went_on(client: Client) -> None:
    """The Read has no response, and its client goes on at once: that had one."""
    client.write(ask())
    client.ask_read()
    client.release()


@BOOK.scene(
    "P73 P80 incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    row(2, real(2.5, pnu=27), first=3),
    rules="DS110@1#1",
)
def p75_number_missing(client: Client) -> None:
    """A number is missing between a request and the one that displaces it: its Read may have been that call."""
    client.write(ask())
    client.call(wire.READ)
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P73 incomplete other-index",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    row(2, real(1.5), first=3, slot=2),
    row(3, real(2.5, pnu=27), first=9),
    rules="DS110@1#1",
)
def p75_number_late(client: Client) -> None:
    """The number comes behind the answer to a later call: it may have been sent before that, and more with it."""
    client.write(ask())
    late, place = client.call(wire.READ), client.at(index=0xAFF0)
    client.exchange(ask(2), tell(2, 1.5), at=client.at(slot=2))
    client.ask(late, wire.read_request(late.sequence, place))
    client.accept_read(late, b"I&M0", at=place)
    client.exchange(ask(3, 27), tell(3, 2.5))


@BOOK.scene(
    "P73 P80 incomplete interleaved",
    tx(1, "incomplete", (2, 3), None, NOTHING),
    row(2, real(2.5, pnu=27), first=4),
    rules="DS102@1 DS110@2#1",
)
def p76_two_activities(client: Client) -> None:
    """The next request is of another activity, and of these stations something is missing: nothing is proven."""
    client.accept_write(client.call(wire.WRITE), ask(), at=client.at(slot=2))
    client.write(ask())
    other = replace(client, activity=UUID(int=0x47), sequence=0)
    other.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "P32 P73 P80 incomplete orphan",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    orphan(2, 4, real(2.5, pnu=None), ref=2),
    rules="DS102@3 DS110@1#1 DS403@5#2",
)
def p77_unseen_write(client: Client) -> None:
    """A Write is accepted whose request is lost: what is read then is of that, and no mismatch of the open one."""
    client.write(ask())
    client.accept_write(client.call(wire.WRITE), ask(2, 27))
    client.read(tell(2, 2.5))


@BOOK.scene(
    "refused unanswered",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    tx(2, "refused", (5, 6), None, par(27), ref=2, write="DF80B500"),
    rules="DS203@6#2 DS401@1#1 DS705@5#2 DS722@1#1",
)
def p77_turned_away_behind_a_connect(client: Client) -> None:
    """A Connect ended what was open: another request, which the capture does not show, turns the next one away."""
    client.write(ask())
    client.wait(1_000)
    client.connect("plc")
    client.write(ask(2, 27), 0xDF80B500)
    client.wait(15_000)
    client.release()


@BOOK.scene(
    "incomplete retransmission",
    tx(1, "incomplete", (1,), None, NOTHING, write=None),
    row(2, real(1.5), first=2, ref=1),
    rules="DS101@1#1 DS110@1#1 DS415@2#2",
)
def p73_written_again(client: Client) -> None:
    """The program writes again what had no response, as a new call: nothing is open when the connection ends."""
    client.ask_write(ask())
    client.wait(140)
    client.exchange(ask(), tell(1, 1.5))
    client.wait(15_000)
    client.release()


@BOOK.scene(
    "P80 malformed incomplete",
    tx(1, "incomplete", (1, 2, 3, 4), None, NOTHING),
    row(2, real(1.5), first=5, ref=2),
    rules="DS106@4 DS110@1#1",
)
def p82_record_cut_off(client: Client) -> None:
    """Of the record that a Read brought the capture has nothing: it is no empty one, and was not displaced."""
    client.exchange(ask(), tell(1, 1.5))
    tape(client).cut(10)
    client.exchange(ask(2), tell(2, 1.5))


@BOOK.scene(
    "P80 malformed incomplete",
    tx(1, "incomplete", (1, 2, 3, 4), 3, NOTHING),
    rules="DS106@4 DS110@1#1",
)
def p82_kind_cut_off(client: Client) -> None:
    """Of the record the capture has the reference alone: whether it says that all went well is not known."""
    client.exchange(ask(), tell(1, 1.5))
    tape(client).cut(9)


@BOOK.scene("malformed", row(1, real(1.5), write=None), rules="DS106@2")
def p82_status_cut_off(client: Client) -> None:
    """The Write response ends before the STATUS in its block; the record shows that it was accepted."""
    client.write(ask())
    tape(client).cut(20)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P32 P77 P80 malformed incomplete orphan",
    tx(1, "incomplete", (1, 2), None, NOTHING, write=None),
    orphan(2, 3, state="unknown orphan", ref=None, axis=None),
    tx(3, "incomplete", (5, 6), None, NOTHING, ref=2, write=None),
    rules="DS106@2 DS106@4 DS106@6 DS110@1#1 DS110@5#3 DS403@4#2",
)
def p82_status_and_record_cut_off(client: Client) -> None:
    """Neither STATUS nor record: what was read may be for a request of before the capture."""
    client.write(ask())
    tape(client).cut(20)
    client.read(tell(1, 1.5))
    tape(client).cut(10)
    client.write(ask(2))
    tape(client).cut(20)
    client.wait(15_000)
    client.release()


@BOOK.scene(
    "P80 malformed incomplete",
    tx(1, "incomplete", (1, 2, 3), None, NOTHING),
    row(2, real(1.5), first=5, ref=2),
    rules="DS106@4 DS110@1#1",
)
def p82_block_cut_off(client: Client) -> None:
    """The Read response ends in its block: whether a record came, or the next Read polls, is not known."""
    client.exchange(ask(), tell(1, 1.5))
    tape(client).cut(35)
    client.exchange(ask(2), tell(2, 1.5))


@BOOK.scene(
    "P46 malformed",
    tx(1, "unknown ok", (1, 2, 3, 4), 3, ref=None, axis=None, index=0xB02F),
    rules="DS106@1",
)
def p82_request_cut_off(client: Client) -> None:
    """Of the request nothing was captured; its response says that all went well, and mirrors who knows what."""
    there = client.at(index=0xB02F)
    client.write(ask(), at=there)
    tape(client).cut(10, -2)
    client.read(tell(1, 1.5), there)


@BOOK.scene(
    "P80 malformed incomplete",
    tx(1, "unknown incomplete", (1, 2), None, ref=None, axis=None),
    row(2, real(1.5), first=3, ref=2),
    rules="DS106@1 DS110@1#1",
)
def p82_displaced_request_cut_off(client: Client) -> None:
    """The same, displaced: whether somebody waits for the response to a change is not known."""
    client.write(ask())
    tape(client).cut(10, -2)
    client.exchange(ask(2), tell(2, 1.5))


@BOOK.scene("P44 malformed", row(1, par(21, error=(None, None)), state="error"), rules="DS106@4")
def p83_error_number_cut_off(client: Client) -> None:
    """The capture cut off both words of an error block: it has a number, and nobody knows which."""
    client.exchange(ask(), message.answer(1, 0x81, 1, message.error(2)))
    tape(client).cut(4)


@BOOK.scene("P67 malformed", row(1, par(21, "TimeDifference"), par(27)), rules="DS106@4")
def p83_size_cut_off(client: Client) -> None:
    """A format that has two sizes: only the end of the message tells which, and what stands behind the value."""
    client.exchange(
        ask(1, 21, 27), message.answer(1, 1, 1, message.block(0x0D, "I", 68), message.real(1.5))
    )
    tape(client).cut(2)


@BOOK.scene(
    "incomplete superseded disorder",
    tx(1, "incomplete", (1, 4), None, NOTHING),
    tx(2, "incomplete", (2, 3), None, NOTHING, ref=2),
    rules="DS110@1#1 DS110@2#2",
)
def p27_accepted_in_the_other_order(client: Client) -> None:
    """Two Writes, the second one accepted first: neither displaced the other one, as far as anybody knows."""
    first = client.ask_write(ask())
    second = client.ask_write(ask(2))
    client.accept_write(second, ask(2))
    client.accept_write(first, ask())
    client.wait(15_000)
    client.release()


@BOOK.scene(
    "incomplete superseded disorder",
    tx(1, "ok", (1, 4, 5, 6), 5, real(1.5)),
    tx(2, "incomplete", (2, 3), None, NOTHING, ref=2),
    rules="DS110@2#2",
)
def p27_the_first_is_answered(client: Client) -> None:
    """The record mirrors the first of them: of the second nobody knows more."""
    first = client.ask_write(ask())
    second = client.ask_write(ask(2))
    client.accept_write(second, ask(2))
    client.accept_write(first, ask())
    client.read(tell(1, 1.5))
    client.wait(15_000)
    client.release()


@BOOK.scene(
    "P2 disorder",
    tx(1, "ok", (2, 1, 3, 4), 3, real(1.5)),
)
def p79_response_first(client: Client) -> None:
    """The Write response stands before its request, and is later by their times."""
    call = client.call(wire.WRITE)
    client.wait(1)
    client.accept_write(call, ask())
    client.wait(-2)
    client.ask_write(ask(), again=call)
    client.wait(1)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "unanswered disorder",
    tx(1, "unanswered", (1, 3), None, NOTHING),
    rules="DS401@1#1 DS722@1#1",
)
def p79_connect_before_a_response(client: Client) -> None:
    """The Connect stands before the Write response, and is later by their times: the Write was accepted before."""
    client.write(ask())
    client.connect("plc")
    tape(client).bring_forward(2, 1)


@BOOK.scene(
    "unanswered disorder",
    tx(1, "unanswered", (1, 2), None, NOTHING),
    row(2, real(2.5, pnu=27), first=7),
    rules="DS401@1#1 DS722@1#1",
)
def p79_release_behind_a_connect(client: Client) -> None:
    """The Release stands behind the next Connect, and is earlier by their times: both count."""
    client.write(ask())
    client.release()
    client.connect("plc")
    tape(client).bring_forward(4, 2)
    client.exchange(ask(2, 27), tell(2, 2.5))


@BOOK.scene(
    "refused fault disorder",
    tx(1, "refused", (1, 3), None, NOTHING, write=None),
    rules="DS104@3#1",
)
def p79_release_before_a_reject(client: Client) -> None:
    """The Release stands before the reject of a Write: that was turned away, and its response is not missing."""
    client.reply(client.ask_write(ask()), bytes.fromhex("0300011c"), wire.REJECT)
    client.release()
    tape(client).bring_forward(2, 1)


@BOOK.scene(
    "P32 P73 P80 incomplete refused orphan",
    tx(1, "incomplete", (1,), None, NOTHING, write=None),
    tx(2, "refused", (2, 3), None, NOTHING, write="DF80B500"),
    orphan(3, 4, real(1.5, pnu=None)),
    rules="DS101@1#1 DS110@1#1 DS203@3#2 DS403@5#3 DS415@2#2",
)
def p77_refused_behind(client: Client) -> None:
    """The record mirrors a Write without its response, and the refused one behind it: nobody knows whose it is."""
    client.write(ask())
    client.stage.lose()
    client.write(ask(), 0xDF80B500)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "P32 P73 refused orphan",
    row(1, real(2.5), slot=2),
    tx(2, "refused", (7, 8), None, NOTHING, ref=2, write="DF80B500"),
    orphan(3, 9, real(1.5, pnu=None)),
    rules="DS203@8#2 DS403@10#3 DS705@7#2",
)
def p77_record_of_an_older_one(client: Client) -> None:
    """A request is missing before a Connect: what does not mirror the refused Write may be of that one."""
    client.exchange(ask(), tell(1, 2.5), at=client.at(slot=2))
    client.call(wire.WRITE)
    client.connect("plc")
    client.write(ask(2), 0xDF80B500)
    client.read(tell(1, 1.5))


if __name__ == "__main__":
    BOOK.write(sys.argv[1:])
