"""Writes tests/vectors/diagnoses.json: small conversations, and the diagnoses (DS7xx) of each.

Played and written as those of conversations.py, in the same layout. What is expected is typed by hand,
from the conditions in docs/diagnoses.md; for each diagnosis there is a near miss, too. Diagnoses that need the
whole capture are not here: Wireshark has none of them.
"""

from __future__ import annotations

import sys
from uuid import UUID

from book import NOTHING, Row, Vectors, orphan, par, ramp, real, row, tape, tx
from conversations import AR2, BAD_HEADER, CUT, HOME2, SHORT, ask, put, second, tell

from ds47.lab import message, wire
from ds47.lab.client import BUSY, Client, drive

BOOK = Vectors(
    "diagnoses.json",
    "Conversations and the diagnoses (DS7xx) of their messages and transactions, for every implementation. "
    "tests/vectors/README.md says how to run them; tests/vectors/sources/diagnoses.py writes this file.",
)
TEN = message.block(0x07, "I", 10)
TURNED = 0x00002041
"""10.0 as Float32 with its bytes in the other order: 1.157e-41."""
ANOTHER_MAKE = 0x0119
TURNED_AWAY: Row = {"write": "DF80B700", "index": 0xB02F}


def refused(reference: int, code: int, identifier: int = 0x81, axis: int = 1) -> bytes:
    """The answer of a drive that refuses the only parameter."""
    return message.answer(reference, identifier, axis, message.error(code))


def change(pnu: int, block: bytes) -> bytes:
    """A change of one parameter, reference 1."""
    return message.change(1, 1, (message.address(pnu), block))


# DS701: the program does not see the refusal


BOOK.lab(
    "DS701",
    "diagnosis-refusal-not-seen",
    "drive-error",
    row(1, par(2902, "Float32", 10.0, subindex=2, error=(1, 2)), state="change error", ms=13),
    rules="DS410@4#1 DS701@4#1",
)


@BOOK.scene(
    "mismatch drive-error",
    row(1, par(None, error=(1, 0)), state="mismatch"),
    rules="DS404@4#1 DS410@4#1",
)
def ds701_of_another_request(client: Client) -> None:
    """Near miss: what was read refuses another request."""
    client.exchange(ask(1), refused(2, 0x01))


# DS702: read too early


BOOK.lab(
    "DS702",
    "diagnosis-read-too-early",
    "disorder poll",
    tx(1, "ok", (1, 3, 5, 6), 15, real(1500.0), polls=[(2, 4)]),
    rules="DS702@2#1",
)
BOOK.lab(
    "DS702",
    "diagnosis-read-too-early-not",
    "poll",
    tx(1, "ok", (1, 2, 5, 6), 15, real(1500.0), polls=[(3, 4)]),
)


# DS704: an old answer taken for a new one


@BOOK.scene(
    "refused mismatch",
    row(1, real(1.5)),
    row(2, par(27), state="refused", write="DF80B700"),
    rules="DS203@6#2 DS404@8#2 DS704@8#2",
)
def ds704_after_a_refused_write(client: Client) -> None:
    """The second Write fails, the Read behind it brings the first response again."""
    client.exchange(ask(1), tell(1, 1.5))
    client.write(ask(2, 27), BAD_HEADER)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "refused",
    row(1, real(1.5)),
    row(2, real(2.5, pnu=27), state="refused", write="DF80B700"),
    rules="DS203@6#2",
)
def ds704_new_answer_after_a_refused_write(client: Client) -> None:
    """Near miss: the Write is refused, but what is read is new."""
    client.exchange(ask(1), tell(1, 1.5))
    client.write(ask(2, 27), BAD_HEADER)
    client.read(tell(2, 2.5))


@BOOK.scene(
    "lost",
    row(1, real(1.5)),
    tx(2, "ok", (5, None, 6, 7), 2, real(1.5, pnu=27)),
    rules="DS101@5#2 DS415@5#2",
)
def ds704_write_response_lost(client: Client) -> None:
    """Near miss: two parameters may have the same value; only the Write response could say more."""
    client.exchange(ask(1), tell(1, 1.5))
    client.ask_write(ask(1, 27))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "incomplete",
    row(1, real(1.5), rereads=[(6, 7)]),
    tx(2, "incomplete", (5, 8), None, par(27), ref=2),
    rules="DS110@5#2 DS704@7#1",
)
def ds704_unaccepted_between(client: Client) -> None:
    """A request lies between, and was accepted only afterwards."""
    client.exchange(ask(1), tell(1, 1.5))
    call = client.ask_write(ask(2, 27))
    client.read(tell(1, 1.5))
    client.accept_write(call, ask(2, 27))


@BOOK.scene(
    "lost",
    row(1, real(1.5), rereads=[(6, 7)]),
    tx(2, "incomplete", (5,), None, par(27), ref=2),
    rules="DS101@5#2 DS110@5#2",
)
def ds704_unseen_between(client: Client) -> None:
    """Near miss: whether the request between was accepted before, the capture does not show."""
    client.exchange(ask(1), tell(1, 1.5))
    client.ask_write(ask(2, 27))
    client.read(tell(1, 1.5))


@BOOK.scene(
    "lost",
    row(1, real(1.5)),
    tx(2, "ok", (5, None, 6, 7), 2, real(1.5)),
    rules="DS101@5#2 DS415@5#2",
)
def ds704_same_question(client: Client) -> None:
    """Near miss: the same question may have the same answer."""
    client.exchange(ask(1), tell(1, 1.5))
    client.ask_write(ask(1))
    client.read(tell(1, 1.5))


BOOK.lab(
    "DS704",
    "diagnosis-old-answer-not",
    "none",
    row(1, par(945, "Unsigned16", 7900, 0, 0, 0)),
    row(2, par(945, "Unsigned16", 7900, 0, 0, 0), ms=13, ref=1),
    rules="DS415@5#2",
)


# DS705: two users of one channel


BOOK.lab(
    "DS705",
    "diagnosis-two-users-again-not",
    "superseded",
    tx(1, "superseded", (1, 2), None, NOTHING),
    row(2, real(12.5), first=3),
    rules="DS413@3#1",
)


SECOND: Row = {"controller": "192.168.133.3", "ar": "47474747-0002-4000-8000-000000000002"}
THIRD: Row = {"ar": "74747474-0003-4000-8000-000000000003"}
BOOK.lab(
    "DS705",
    "diagnosis-two-users-across",
    "refused interleaved",
    row(1, real(1500.0), **SECOND),
    tx(2, "ok", (5, 6, 9, 10), 5, real(1500.0), ref=7),
    tx(3, "refused", (7, 8), None, NOTHING, ref=2, write="DF80B500", **SECOND),
    rules="DS203@8#3 DS705@7#3",
)
BOOK.lab(
    "DS705",
    "diagnosis-two-users-connections",
    "refused interleaved",
    row(1, real(1500.0), **THIRD),
    tx(2, "ok", (5, 6, 9, 10), 5, real(1500.0), ref=7),
    tx(3, "refused", (7, 8), None, NOTHING, ref=2, write="DF80B500", **THIRD),
    rules="DS203@8#3 DS705@7#3",
)


@BOOK.scene(
    "refused interleaved",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1.5)),
    tx(2, "refused", (3, 4), None, par(27), write="DF80B700", **HOME2),
    rules="DS203@4#2",
)
def ds705_refused_otherwise(client: Client) -> None:
    """Near miss: turned away while another is open, but not for that."""
    other = second(client)
    client.write(ask(1))
    other.write(ask(1, 27), BAD_HEADER)
    client.read(tell(1, 1.5))


# DS709: a drive object that is not there


BOOK.lab(
    "DS709",
    "diagnosis-wrong-drive-object",
    "drive-error",
    row(1, real(1500.0), ms=13),
    row(2, par(21, error=(0x19, 0)), state="error", ms=13, axis=2),
    rules="DS410@8#2 DS709@8#2",
)
BOOK.lab(
    "DS709",
    "diagnosis-wrong-drive-object-not",
    "none",
    row(1, real(1500.0), ms=13),
    row(2, real(1500.0), ms=13, axis=2),
)


# DS711: the request is not whole (cut ones are among the conversations of pairing)


@BOOK.scene(
    "malformed refused other-index",
    tx(1, "refused", (1, 2), None, ref=7, **TURNED_AWAY),
    rules="DS202@1 DS203@2#1 DS315@1#1",
)
def ds711_stated_more(client: Client) -> None:
    """Near miss: the record itself is shorter than it says, so LEN is not to blame."""
    place = client.at(index=0xB02F)
    call = client.ask_write(CUT, place, stated=len(CUT) + 2)
    client.accept_write(call, CUT, place, BAD_HEADER)


@BOOK.scene(
    "malformed drive-error",
    row(1, real(1.5)),
    row(2, par(1120, "Unsigned64", error=(0x17, 0)), state="change error"),
    rules="DS315@5#2 DS410@8#2 DS701@8#2",
)
def ds711_wrong_format(client: Client) -> None:
    """Near miss: the drive has read four bytes and says that the format of eight is wrong."""
    client.exchange(ask(1), tell(1, 1.5))
    block = message.raw_block(0x38, 1, bytes(4))
    request = message.change(2, 1, (message.address(1120), block))
    client.exchange(request, refused(2, 0x17, 0x82))


@BOOK.scene(
    "malformed refused other-index",
    tx(
        1, "change refused", (1, 2), None, par(1120, "Integer64"), par(971), par(100), **TURNED_AWAY
    ),
    rules="DS203@2#1 DS315@1#1 DS711@1#1",
)
def ds711_address_as_value(client: Client) -> None:
    """Two of three addresses read as a value of format 0x10: no request for one parameter is meant."""
    addresses = [message.address(pnu) for pnu in (1120, 971, 100)]
    asked = message.header(1, 2, 1, 3) + b"".join(addresses) + bytes((0x37, 1))
    client.write(asked, BAD_HEADER, client.at(index=0xB02F))


def _cut_change(client: Client, length: int) -> None:
    """The first bytes of a change of two parameters; the drive turns the request away."""
    asked = message.change(
        7, 1, *[(message.address(pnu), message.real(10.0)) for pnu in (2900, 2901)]
    )
    client.write(asked[:length], BAD_HEADER, client.at(index=0xB02F))


def _of_cut_change(*parameters: Row) -> Row:
    """The transaction of it."""
    return tx(1, "change refused", (1, 2), None, *parameters, ref=7, **TURNED_AWAY)


@BOOK.scene(
    "malformed refused other-index",
    _of_cut_change(par(2900, "Float32"), par(2901)),
    rules="DS203@2#1 DS315@1#1 DS711@1#1",
)
def ds711_first_of_two_values(client: Client) -> None:
    """The first value is cut, the second one is not there: 20 bytes are 26 at least."""
    _cut_change(client, 20)


@BOOK.scene(
    "malformed refused other-index",
    _of_cut_change(real(10.0, pnu=2900), par(2901)),
    rules="DS203@2#1 DS315@1#1 DS711@1#1",
)
def ds711_second_of_two_values(client: Client) -> None:
    """The second value block is not there: 22 bytes are 26 at least."""
    _cut_change(client, 22)


# DS712: the Read asks for too few bytes


@BOOK.scene(
    "malformed",
    row(1, par(21, "Unsigned8", 7), par(27), state="partial"),
    rules="DS311@4#1 DS315@4#1 DS712@4#1",
)
def ds712_cut_at_a_pad(client: Client) -> None:
    """The Read takes 7 bytes: the byte that fills the first block up is not there, nor is the next block."""
    client.write(ask(1, 21, 27))
    client.accept_read(client.ask_read(maximum=7), message.header(1, 1, 1, 2) + bytes((5, 1, 7)))


BOOK.lab(
    "DS712",
    "diagnosis-read-length",
    "malformed",
    row(1, par(2902, "Float32", 10.0, subindex=2), state="error", ms=13),
    rules="DS315@4#1 DS712@4#1",
)


@BOOK.scene("malformed", row(1, real(), state="error"), rules="DS315@4#1")
def ds712_cut_by_itself(client: Client) -> None:
    """Near miss: the response is cut, though the Read would have taken more."""
    client.write(ask())
    client.accept_read(client.ask_read(maximum=240), tell(1, 1.5)[:8])


@BOOK.scene(
    "read-refused poll",
    tx(1, "ok", (1, 2, 7, 8), 7, real(1.5), polls=[(3, 4), (5, 6)]),
    rules="DS201@4#1 DS201@6#1 DS712@4#1 DS712@6#1",
)
def ds712_refused(client: Client) -> None:
    """Two Reads ask for fewer bytes than the response has, and are refused; the next one brings it."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=8), SHORT)
    client.refuse_read(client.ask_read(maximum=9), SHORT)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "read-refused poll",
    tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)]),
    rules="DS201@4#1",
)
def ds712_refused_with_room(client: Client) -> None:
    """Near miss: the Read that was refused for its length had asked for as many bytes as the response has."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=10), SHORT)
    client.read(tell(1, 1.5))


@BOOK.scene(
    "read-refused",
    row(1, NOTHING, par(27), state="refused", ms=None, read="DE80B100"),
    rules="DS201@4#1",
)
def ds712_refused_and_nothing_longer(client: Client) -> None:
    """Near miss: the Read asked for all that two parameters need, and no longer response was seen."""
    client.write(ask(1, 21, 27))
    client.refuse_read(client.ask_read(maximum=16), SHORT)


@BOOK.scene(
    "read-refused",
    row(1, NOTHING, state="refused", ms=None, read="DE80B800"),
    orphan(2, 5, real(1.5, pnu=None)),
    rules="DS201@4#1 DS403@6#2",
)
def ds712_refused_for_something_else(client: Client) -> None:
    """Near miss: refused with another status, and a longer record is read behind it."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=8), 0xDE80B800)
    client.read(tell(1, 1.5))


@BOOK.scene("poll", tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)]))
def ds712_not_ready(client: Client) -> None:
    """Near miss: a Read for 6 bytes is refused because the response is not ready."""
    client.write(ask())
    client.refuse_read(client.ask_read(maximum=6), BUSY)
    client.read(tell(1, 1.5))


# DS713: more asked than one response carries


@BOOK.scene(
    "drive-error",
    row(1, real(1.5), par(27, error=(0x15, 0)), par(25, error=(0x15, 0)), state="partial"),
    rules="DS410@4#1 DS410@4#1 DS713@4#1",
)
def ds713_said(client: Client) -> None:
    """The drive says of the second and the third parameter that they do not fit."""
    blocks = (message.real(1.5), message.error(0x15), message.error(0x15))
    client.exchange(ask(1, 21, 27, 25), message.answer(1, 0x81, 1, *blocks))


@BOOK.scene(
    "count",
    row(1, par(974, "Unsigned16", 16)),
    row(2, real(1.5), real(2.5, pnu=27), par(25), state="partial"),
    rules="DS316@5#2 DS407@8#2 DS713@8#2",
)
def ds713_left_out(client: Client) -> None:
    """The drive takes 16 bytes, and answers two of three parameters in them."""
    client.exchange(ask(1, 974), message.answer(1, 1, 1, message.word(16)))
    client.exchange(ask(2, 21, 27, 25), tell(2, 1.5, 2.5))


@BOOK.scene(
    "count", row(1, real(1.5), real(2.5, pnu=27), par(25), state="partial"), rules="DS407@4#1"
)
def ds713_room_left(client: Client) -> None:
    """Near miss: one of three is left out, though a usual channel has room for it."""
    client.exchange(ask(1, 21, 27, 25), tell(1, 1.5, 2.5))


@BOOK.scene(
    "count malformed",
    row(1, real(1.5)),
    row(2, real(2.5)),
    row(3, real(3.5)),
    row(4, par(2900, "Float32", *range(58)), par(21), state="partial"),
    rules="DS106@12 DS407@16#4",
)
def ds713_room_seen(client: Client) -> None:
    """Near miss: the drive sent more before, of which the capture has only the value that was asked for."""
    client.exchange(ask(1), tell(1, 1.5))
    client.exchange(ask(2), tell(2, 2.5))
    client.exchange(ask(3), tell(3, 3.5) + bytes(290))
    tape(client).cut(290)
    asked = message.read(4, 1, message.address(2900, 0, 58), message.address(21))
    client.exchange(asked, message.answer(4, 1, 1, message.real(*range(58))))


# DS714 to DS716: what the bytes were meant to be


BOOK.lab(
    "DS714",
    "diagnosis-value-in-wrong-type",
    "drive-error",
    row(1, par(2900, "Unsigned32", 0x41200000, error=(5, 0)), state="change error", ms=13),
    rules="DS410@4#1 DS714@1#1",
)


@BOOK.scene(
    "drive-error",
    row(1, par(1120, "Unsigned32", 10, error=(2, 0)), state="change error"),
    rules="DS410@4#1 DS701@4#1",
)
def ds714_integer(client: Client) -> None:
    """Near miss: 10 as it should be, outside of the limits."""
    client.exchange(change(1120, TEN), refused(1, 0x02, 0x82))


@BOOK.scene(
    "values",
    row(1, par(1120, "Float32") | {"values": ["NaN"]}, state="change ok"),
    rules="DS714@1#1",
)
def ds714_integer_as_float(client: Client) -> None:
    """The bits of -1 under Float32, where they are no number; the drive takes it."""
    block = message.raw_block(0x08, 1, b"\xff" * 4)
    client.exchange(change(1120, block), message.changed(1, 1))


@BOOK.scene(
    "drive-error",
    row(1, par(2900, "Unsigned16", 7)),
    row(2, par(2900, "Unsigned32", 10, error=(5, 0)), state="change error", ref=1),
    rules="DS410@8#2 DS415@5#2 DS714@5#2",
)
def ds714_read_in_this_way(client: Client) -> None:
    """The drive object reads it as Unsigned16, whatever the list of parameters says."""
    client.exchange(ask(1, 2900), message.answer(1, 1, 1, message.word(7)))
    client.exchange(change(2900, TEN), refused(1, 0x05, 0x82))


@BOOK.scene(
    "drive-error",
    row(1, par(2900, "Unsigned16", 7), axis=2),
    row(2, par(2900, "Unsigned32", 10, error=(5, 0)), state="change error", ref=1),
    rules="DS410@8#2 DS415@5#2 DS701@8#2",
)
def ds714_read_of_another_drive_object(client: Client) -> None:
    """Near miss: drive object 2 reads it in a format that is not that of the list; of 1 nobody knows."""
    client.exchange(ask(1, 2900, axis=2), message.answer(1, 1, 2, message.word(7)))
    client.exchange(change(2900, TEN), refused(1, 0x05, 0x82))


@BOOK.scene(
    "drive-error",
    row(1, par(2900, "Unsigned32", 10, error=(5, 0)), state="change error"),
    rules="DS410@4#1 DS701@4#1",
)
def ds714_another_make(client: Client) -> None:
    """Near miss: p2900 is in the list of one maker, and the drive is of another."""
    client.device = drive(vendor_id=ANOTHER_MAKE)
    client.exchange(change(2900, TEN), refused(1, 0x05, 0x82))


@BOOK.scene("values", row(1, ramp(1.157e-41), state="change ok"), rules="DS715@1#1")
def ds715_values(client: Client) -> None:
    """10.0 with its bytes turned round, and the drive takes it."""
    client.exchange(change(1120, message.block(0x08, "I", TURNED)), message.changed(1, 1))


@BOOK.scene(
    "malformed refused other-index",
    tx(
        1,
        "refused",
        (1, 2),
        None,
        par(1, subindex=16) | {"attribute": "0x00"},
        ref=0,
        axis=0,
        **TURNED_AWAY,
    ),
    rules="DS203@2#1 DS301@1#1 DS305@1#1 DS313@1#1 DS716@1#1",
)
def ds716_zeros(client: Client) -> None:
    """A zero before each byte of a read."""
    spread = b"".join(bytes((0, byte)) for byte in ask())
    client.write(spread, BAD_HEADER, client.at(index=0xB02F))


# DS717 to DS720: what the error numbers say


BOOK.lab(
    "DS717",
    "diagnosis-index-and-count",
    "drive-error",
    row(1, par(2900, subindex=1, error=(4, 0)), state="error", ms=13),
    rules="DS410@4#1 DS717@4#1",
)


@BOOK.scene(
    "drive-error", row(1, par(21, error=(3, 0)), state="error"), rules="DS410@4#1 DS701@4#1"
)
def ds717_no_subindex(client: Client) -> None:
    """Near miss: 0x03, but nothing was indexed."""
    client.exchange(ask(), refused(1, 0x03))


BOOK.lab(
    "DS718",
    "diagnosis-commissioning-state",
    "drive-error",
    row(1, par(304, "Unsigned16", 400, error=(0x70, 0)), state="change error", ms=13),
    rules="DS410@4#1 DS718@4#1",
)


@BOOK.scene(
    "drive-error",
    row(1, par(304, "Float32", 1.0, error=(0x70, 0)), state="change error"),
    rules="DS410@4#1 DS701@4#1",
)
def ds718_another_make(client: Client) -> None:
    """Near miss: the same number of another make means something else."""
    client.device = drive(vendor_id=ANOTHER_MAKE)
    client.exchange(put(1, 1.0, 304), refused(1, 0x70, 0x82))


@BOOK.scene(
    "drive-error",
    row(1, par(1120, "Float32", 1.0, error=(0x6B, 0)), state="change error"),
    rules="DS410@4#1 DS701@4#1",
)
def ds719_another_make(client: Client) -> None:
    """Near miss: 0x6B says that a Siemens drive is enabled, and nothing of others."""
    client.device = drive(vendor_id=ANOTHER_MAKE)
    client.exchange(put(1, 1.0), refused(1, 0x6B, 0x82))


BOOK.lab(
    "DS720",
    "diagnosis-connector-as-number-word",
    "drive-error",
    row(1, par(840, "Unsigned16", 1, error=(0x17, 0)), state="change error", ms=13),
    rules="DS410@4#1 DS720@4#1",
)


@BOOK.scene(
    "drive-error malformed",
    row(1, par(1070, "Unsigned32", error=(0x83, 0)), state="change error"),
    rules="DS315@1#1 DS410@4#1 DS711@1#1",
)
def ds720_no_value(client: Client) -> None:
    """Near miss: the request ends inside the source of signals, and that is the cause."""
    whole = change(1070, message.block(0x07, "I", 0x34_0000))
    client.exchange(whole[:-2], refused(1, 0x83, 0x82))


# DS722: the connection ends inside a job


@BOOK.scene("unanswered", tx(1, "unanswered", (1, 2), None, NOTHING), rules="DS401@1#1 DS722@1#1")
def ds722_connect(client: Client) -> None:
    """The controller connects anew while its request is open."""
    client.write(ask())
    client.connect("plc")


@BOOK.scene(
    "incomplete lost",
    tx(1, "incomplete", (1, 2, 3), None, NOTHING),
    rules="DS101@3#1 DS103@4#1 DS110@1#1",
)
def ds722_read_sent_again(client: Client) -> None:
    """The same while its Read is under way, sent again: the response may be missing in the capture."""
    client.write(ask())
    call = client.ask_read()
    client.wait(1_000)
    client.ask(call, wire.read_request(call.sequence, client.channel))
    client.wait(1_000)
    client.connect("plc")


@BOOK.scene(
    "incomplete lost",
    tx(1, "incomplete", (1, 2, 3), None, NOTHING),
    rules="DS101@3#1 DS110@1#1",
)
def ds722_read_sent_once(client: Client) -> None:
    """Near miss: the client sends nothing again in 3 s: the response may be missing in the capture."""
    client.write(ask())
    client.ask_read()
    client.wait(3_000)
    client.connect("plc")


@BOOK.scene(
    "unanswered poll",
    tx(1, "change unanswered", (1, 2), None, ramp(1.0), polls=[(3, 4)]),
    rules="DS402@1#1 DS722@1#1",
)
def ds722_change_polled(client: Client) -> None:
    """A change whose answer is waited for when the connection ends."""
    client.write(put(1, 1.0))
    client.poll()
    client.release()


BOOK.lab(
    "DS722",
    "diagnosis-connection-lost-unread-not",
    "unanswered release",
    tx(1, "change unanswered", (3, 4), None, par(977, "Unsigned16", 1)),
    rules="DS402@3#1",
)


@BOOK.scene("incomplete", tx(1, "incomplete", (3, 4), None, NOTHING), rules="DS110@3#1")
def ds722_connected_before(client: Client) -> None:
    """Near miss: the connection is older than the request."""
    client.connect("plc")
    client.write(ask())


@BOOK.scene("incomplete", tx(1, "incomplete", (1, 2), None, NOTHING), rules="DS110@1#1")
def ds722_another_connects(client: Client) -> None:
    """Near miss: another controller connects to the drive."""
    client.write(ask())
    second(client).connect("panel")


BOOK.lab(
    "DS722",
    "diagnosis-connection-lost-restart",
    "unanswered",
    tx(1, "unanswered", (3, 4), None, NOTHING),
    row(2, real(1500.0), first=7, ar="47474747-0003-4000-8000-000000000003"),
    rules="DS401@3#1 DS722@3#1",
)


@BOOK.scene(
    "incomplete",
    tx(1, "incomplete", (1, 2), None, NOTHING),
    row(2, real(1.5), ar=str(AR2), ref=1),
    rules="DS110@1#1",
)
def ds722_connect_not_seen(client: Client) -> None:
    """Near miss: of what kind the first AR is, the capture does not show; there may be both."""
    client.write(ask())
    client.channel = client.at(ar=AR2)
    client.connect("plc")
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene(
    "incomplete",
    tx(1, "incomplete", (3, 4), None, NOTHING),
    row(2, real(1.5), first=7, ar=str(AR2), ref=1),
    rules="DS110@3#1",
)
def ds722_supervisor_connects(client: Client) -> None:
    """Near miss: the same station sets up a supervisor's AR, which stands beside the other."""
    client.connect("plc")
    client.write(ask())
    client.channel = client.at(ar=AR2)
    client.connect("plc", kind=6)
    client.exchange(ask(), tell(1, 1.5))


@BOOK.scene(
    "incomplete",
    tx(1, "incomplete", (3, 4), None, NOTHING),
    row(2, real(1.5), first=7, slot=2, ref=1),
    rules="DS110@3#1",
)
def ds722_another_ar_connects(client: Client) -> None:
    """Near miss: the same controller sets up another AR, and the one that asked goes on."""
    client.connect("plc")
    client.write(ask())
    Client(client.stage, channel=client.at(ar=AR2), activity=AR2).connect("plc")
    client.exchange(ask(), tell(1, 1.5), at=client.at(slot=2))


@BOOK.scene(
    "incomplete",
    row(1, real(1.5), ar=str(AR2)),
    tx(2, "incomplete", (5, 6), None, NOTHING),
    rules="DS110@5#2",
)
def ds722_second_ar_connects(client: Client) -> None:
    """Near miss: the controller has two ARs already; which one the third replaces is not known."""
    client.exchange(ask(), tell(1, 1.5), at=client.at(ar=AR2))
    client.write(ask())
    Client(client.stage, channel=client.at(ar=UUID(int=3)), activity=UUID(int=3)).connect("plc")


BOOK.lab(
    "DS722",
    "diagnosis-connection-lost-not",
    "release poll",
    tx(1, "ok", (3, 4, 9, 10), 27, real(1500.0), polls=[(5, 6), (7, 8)]),
)


@BOOK.scene(
    "release refused", tx(1, "refused", (1, 2), None, NOTHING, write="DF80B700"), rules="DS203@2#1"
)
def ds722_refused(client: Client) -> None:
    """Near miss: the connection ends after a Write that was refused: nothing was open."""
    client.write(ask(), BAD_HEADER)
    client.release()


if __name__ == "__main__":
    BOOK.write(sys.argv[1:])
