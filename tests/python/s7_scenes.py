"""Scenes of S7 communication: each rule DS9xx with its near miss, and odd transports.

A near miss is the closest conversation of which the rule says nothing. 192.168.134.1 is the CPU, .2 and .3 ask.
What the seed draws and tells is in `ds47.lab.s7_stories`, which become captures.
"""

from __future__ import annotations

import struct

from ds47.lab import s7_wire
from ds47.lab.client import Client
from ds47.lab.s7 import DRIVE_TSAP, Asked, Cpu, DriveCpu, Link
from ds47.lab.s7_wire import ANSWER, DB, DENIED, JOB, MISSING, WRITE, db, flags
from ds47.lab.scenario import Book

BOOK = Book("s7")
MOST = 480 - 18
"""Bytes that one job reads at a PDU of 480."""
SENT = bytes(range(256)) * 8


def cpu(client: Client) -> Cpu:
    """The CPU of a scene."""
    return Cpu(client.stage)


def connected(client: Client, pdu: int = 480, parallel: int = 1) -> Link:
    """A client and the CPU, with nothing asked yet."""
    return cpu(client).link().open(pdu, parallel)


# Jobs and their answers


@BOOK.scene(
    "DS901: the second of three reads is never answered", "get ok, get unanswered, get ok, DS901"
)
def never_answered(client: Client) -> None:
    """A job without an answer."""
    link = connected(client, parallel=2).get(db(1, 0, 4))
    link.ask_get(db(1, 4, 4))
    client.wait(3000)
    link.get(db(1, 8, 4)).close()


@BOOK.scene("Near DS901: it is answered after three seconds", "3 get ok")
def answered_late(client: Client) -> None:
    """A job whose answer takes three seconds."""
    link = connected(client).get(db(1, 0, 4))
    asked = link.ask_get(db(1, 4, 4))
    client.wait(3000)
    link.answer(asked)
    link.get(db(1, 8, 4)).close()


@BOOK.scene("DS902: a PDU of 481 bytes where 480 were agreed", "put ok, DS902")
def longer_than_agreed(client: Client) -> None:
    """A write of 453 bytes at a PDU size of 480."""
    connected(client).put((db(1, 0, 453), SENT[:453])).close()


@BOOK.scene("Near DS902: a PDU of exactly 480 bytes", "put ok")
def as_long_as_agreed(client: Client) -> None:
    """A write of 452 bytes at a PDU size of 480."""
    connected(client).put((db(1, 0, 452), SENT[:452])).close()


@BOOK.scene("DS908: two of three variables, with their codes", "get partial, put error, DS908")
def refused_items(client: Client) -> None:
    """A data block that is missing, and one that clients may not write."""
    plc = cpu(client)
    plc.refused = {(DB, 99): MISSING, (DB, 50): DENIED}
    link = plc.link().open().get(db(1, 0, 4), db(99, 0, 4), flags(10, 2))
    link.put((db(50, 0, 2), b"\1\2")).close()


def drive(client: Client) -> DriveCpu:
    """The drive of a scene: two ramp-up times of drive object 2, and two run times of drive object 1."""
    values = struct.Struct(">f").pack
    times = {(2114, 1024): b"\0\1\2\3", (2114, 1025): b"\0\0\0\4"}
    ramps = {(1120, 2048): values(10.0), (1120, 2049): values(20.0)}
    return DriveCpu(client.stage, elements=times | ramps)


@BOOK.scene(
    "DS919: two elements of a drive asked as one area, and a parameter that it does not have",
    "get ok, 2 get error, put ok, DS919",
)
def refused_elements(client: Client) -> None:
    """Parameters of a drive, read by S7: data block = parameter, address = 1024 x drive object + index."""
    link = drive(client).link().open()
    link.szl(0x0011, 0, struct.pack(">H20sHHH", 1, b"6SL3 244-0BB13-1FA0", 0, 0, 0))
    link.get(db(2114, 1024, 4)).get(db(2114, 1024, 5)).get(db(9999, 1024, 4))
    link.put((db(1120, 2048, 4), struct.pack(">f", 12.5))).close()


@BOOK.scene(
    "Near DS919: the same of a partner that only its addresses make a drive",
    "get ok, 2 get error, DS908",
)
def refused_by_what_seems_a_drive(client: Client) -> None:
    """Parameters of a drive, or bytes of data blocks with such numbers: nothing says which."""
    link = drive(client).link().open().get(db(2114, 1024, 4))
    link.get(db(2114, 1024, 5)).get(db(9999, 1024, 4)).close()


@BOOK.scene(
    "Near DS919: the same of a CPU, which has bytes where a drive has none",
    "get ok, get error, DS908",
)
def refused_by_a_cpu(client: Client) -> None:
    """A data block with the number of a parameter, of which 40 bytes are read."""
    plc = cpu(client)
    plc.tsap, plc.refused = DRIVE_TSAP, {(DB, 9999): MISSING}
    plc.link().open().get(db(2114, 1024, 40)).get(db(9999, 1024, 4)).close()


@BOOK.scene(
    "Near DS905, DS907, DS916: elements of a drive, one address apart, share no bytes",
    "2 put ok, 2 get ok, 2 put ok, get ok",
)
def elements_share_nothing(client: Client) -> None:
    """Two stations write two elements of a drive, and read both back as they wrote them."""
    there = drive(client)
    one, two = there.link(2).open(), there.link(3).open()
    for values in ((10.0, 20.0), (12.5, 25.0)):
        one.put((db(1120, 2048, 4), struct.pack(">f", values[0])))
        two.put((db(1120, 2049, 4), struct.pack(">f", values[1])))
        one.get(db(1120, 2048, 4))
        if values[0] == 10.0:
            two.get(db(1120, 2049, 4))
    one.close()
    two.close()


@BOOK.scene("DS918: the CPU gives one code for a write of three variables", "put partial, DS918")
def one_code_for_all(client: Client) -> None:
    """A write of three variables that is answered with one code."""
    link = connected(client)
    asked = link.ask_put(
        *((each, bytes(each.size)) for each in (db(1, 0, 4), db(2, 7, 3), flags(10, 2)))
    )
    link.say(False, ANSWER, asked.reference, bytes((WRITE, 1)), b"\xff")
    link.close()


@BOOK.scene("DS909: the CPU refuses a read as a whole, 81 04", "get refused, get ok, DS909")
def refused_job(client: Client) -> None:
    """A job that is refused with a class and a code."""
    link = connected(client)
    link.refuse(link.ask_get(db(1, 0, 4)), 0x8104)
    link.get(db(1, 0, 4)).close()


@BOOK.scene("DS906: two jobs of three variables each", "get ok, put ok, DS906")
def several_items(client: Client) -> None:
    """Jobs of several variables."""
    variables = db(1, 0, 4), db(2, 7, 3), flags(10, 2)
    link = connected(client).get(*variables)
    link.put(*((each, bytes(each.size)) for each in variables)).close()


@BOOK.scene("DS914: two jobs are open at once, and one was agreed", "2 get ok, DS914")
def too_many_at_once(client: Client) -> None:
    """Two jobs at once where one was agreed."""
    link = connected(client)
    first, second = link.ask_get(db(1, 0, 4)), link.ask_get(db(1, 100, 4))
    link.answer(first)
    link.answer(second)
    link.close()


@BOOK.scene(
    "Near DS914: two jobs at once, answered in the other order, and two were agreed", "2 get ok"
)
def two_at_once(client: Client) -> None:
    """Two jobs at once where two were agreed."""
    link = connected(client, parallel=2)
    first, second = link.ask_get(db(1, 0, 4)), link.ask_get(db(1, 100, 4))
    link.answer(second)
    link.answer(first)
    link.close()


# Is it whole


@BOOK.scene(
    "With `--s7-block 8`: DS903. Without: nothing, because the CPU does not say its block", "get ok"
)
def block_not_known(client: Client) -> None:
    """GET of 32 bytes of a CPU whose block nobody knows."""
    connected(client).get(db(10, 0, 32)).close()


@BOOK.scene("DS904: 600 bytes are read by two jobs", "2 get ok, DS904")
def split_read(client: Client) -> None:
    """A read that is split because its answer does not fit."""
    connected(client).get(db(1, 0, MOST)).get(db(1, MOST, 600 - MOST)).close()


@BOOK.scene("DS904: 1000 bytes are written by three jobs", "3 put ok, DS904")
def split_write(client: Client) -> None:
    """A write that is split."""
    link = connected(client)
    for at in range(0, 1000, 452):
        part = SENT[at : min(at + 452, 1000)]
        link.put((db(1, at, len(part)), part))
    link.close()


@BOOK.scene(
    "Near DS904: two reads follow each other in memory, and the first one would have had room",
    "2 get ok",
)
def side_by_side(client: Client) -> None:
    """Reads of 400 and 200 bytes, side by side."""
    connected(client).get(db(1, 0, 400)).get(db(1, 400, 200)).close()


@BOOK.scene("Near DS904: the second read begins one byte further", "2 get ok")
def with_a_gap(client: Client) -> None:
    """Two reads with one byte between them."""
    connected(client).get(db(1, 0, MOST)).get(db(1, MOST + 1, 100)).close()


def between(client: Client, start: int, data: bytes) -> None:
    """600 bytes are read by two jobs, then once more, and what another station writes meanwhile.

    Without the first time nobody could say that the write changed anything.
    """
    plc = cpu(client)
    one, two = plc.link(2).open(), plc.link(3).open()
    one.get(db(1, 0, MOST)).get(db(1, MOST, 600 - MOST))
    one.get(db(1, 0, MOST))
    two.put((db(1, start, len(data)), data))
    one.get(db(1, MOST, 600 - MOST))
    one.close()
    two.close()


@BOOK.scene(
    "DS905: between the two jobs of a read both parts are written",
    "3 get ok, put ok, get ok, DS904 DS905",
)
def inconsistent_read(client: Client) -> None:
    """A read with old bytes in front and new ones behind."""
    between(client, MOST - 8, b"\xee" * 16)


@BOOK.scene(
    "Near DS905: only the part that is not yet read is written: all is as after it",
    "3 get ok, put ok, get ok, DS904",
)
def whole_and_newer(client: Client) -> None:
    """A write into the second part of a read, before it is read."""
    between(client, MOST, b"\xee" * 8)


@BOOK.scene(
    "Near DS905: only the part that was read is written: all is as before it",
    "3 get ok, put ok, get ok, DS904",
)
def whole_and_older(client: Client) -> None:
    """A write into the first part of a read, after it was read."""
    between(client, MOST - 8, b"\xee" * 8)


@BOOK.scene(
    "Near DS905: both parts are written, with the bytes that they have",
    "3 get ok, put ok, get ok, DS904",
)
def written_as_before(client: Client) -> None:
    """A write between the parts of a read that changes nothing."""
    between(client, MOST - 8, bytes((at * 7 + 3) & 0xFF for at in range(MOST - 8, MOST + 8)))


def during_a_write(client: Client, start: int) -> None:
    """600 bytes are written by two jobs, and 24 of them are read before it and between the two."""
    plc = cpu(client)
    one, two = plc.link(2).open(), plc.link(3).open()
    two.get(db(1, start, 24))
    one.put((db(1, 0, 452), b"\xee" * 452))
    two.get(db(1, start, 24))
    one.put((db(1, 452, 148), b"\xee" * 148))
    one.close()
    two.close()


@BOOK.scene(
    "DS905: between the two jobs of a write bytes of both parts are read",
    "get ok, put ok, get ok, put ok, DS904 DS905",
)
def inconsistent_write(client: Client) -> None:
    """A read of new bytes in front and old ones behind, while a station writes."""
    during_a_write(client, 440)


@BOOK.scene(
    "Near DS905: between the two jobs of a write bytes of the first part are read",
    "get ok, put ok, get ok, put ok, DS904",
)
def read_beside_the_border(client: Client) -> None:
    """A read of bytes that one job has written."""
    during_a_write(client, 428)


@BOOK.scene(
    "DS907: within a second two stations write other bytes to the same place", "2 put ok, DS907"
)
def two_writers(client: Client) -> None:
    """Two stations write one place."""
    plc = cpu(client)
    one, two = plc.link(2).open(), plc.link(3).open()
    one.put((db(1, 0, 8), b"\x11" * 8))
    client.wait(400)
    two.put((db(1, 4, 8), b"\x22" * 8))
    one.close()
    two.close()


@BOOK.scene("Near DS907: the second one writes five seconds later", "2 put ok")
def writers_apart(client: Client) -> None:
    """Two stations write one place, five seconds apart."""
    plc = cpu(client)
    one, two = plc.link(2).open(), plc.link(3).open()
    one.put((db(1, 0, 8), b"\x11" * 8))
    client.wait(5000)
    two.put((db(1, 4, 8), b"\x22" * 8))
    one.close()
    two.close()


@BOOK.scene("Near DS907: they write side by side", "2 put ok")
def writers_side_by_side(client: Client) -> None:
    """Two stations write places that touch."""
    plc = cpu(client)
    one, two = plc.link(2).open(), plc.link(3).open()
    one.put((db(1, 0, 8), b"\x11" * 8))
    two.put((db(1, 8, 8), b"\x22" * 8))
    one.close()
    two.close()


@BOOK.scene(
    "With `--s7-readback`: DS916. Without: nothing, because a program writes its own memory",
    "put ok, get ok",
)
def reads_back_differently(client: Client) -> None:
    """What was written is something else when it is read."""
    plc = cpu(client)
    link = plc.link().open().put((db(1, 0, 4), b"\1\2\3\4"))
    plc.bytes_of(db(1, 0, 4))[0:4] = b"\1\2\3\5"
    link.get(db(1, 0, 4)).close()


@BOOK.scene("With `--s7-readback` nothing: what is read is what was written", "put ok, get ok")
def reads_back(client: Client) -> None:
    """What was written is read again."""
    connected(client).put((db(1, 0, 4), b"\1\2\3\4")).get(db(1, 0, 4)).close()


# Between programs


@BOOK.scene("One segment, three, and three the other way: each sum is right", "3 bsend ok")
def bsends(client: Client) -> None:
    """BSEND of 10, 1200 and 1000 bytes."""
    link = connected(client).send(0x12, SENT[:10]).send(0x12, SENT[:1200])
    link.send(0x99, SENT[:1000], from_client=False).close()


@BOOK.scene("DS910: 1000 bytes are announced, 900 come", "bsend partial, DS910")
def bsend_too_short(client: Client) -> None:
    """BSEND whose segments are less than it announced."""
    connected(client).send(0x12, SENT[:900], total=1000).close()


@BOOK.scene("DS910: the last segment of 1000 bytes never comes", "bsend unanswered, DS910")
def bsend_without_an_end(client: Client) -> None:
    """BSEND that never ends."""
    connected(client).send(0x12, SENT[:890], total=1000, ended=False).close()


@BOOK.scene("DS911: the second of three segments is not acknowledged", "bsend ok, DS911")
def bsend_unacknowledged(client: Client) -> None:
    """BSEND with a segment that nobody acknowledges."""
    connected(client).send(0x12, SENT[:1200], lost=(1,)).close()


@BOOK.scene(
    "DS912: it begins again before it has ended, which is told of the second one",
    "bsend unanswered, bsend ok, DS912",
)
def r_id_twice(client: Client) -> None:
    """BSEND is started again before it is done."""
    connected(client).send(0x12, SENT[:890], ended=False).send(0x12, SENT[:600]).close()


@BOOK.scene("Near DS912: one after the other", "2 bsend ok")
def r_id_again(client: Client) -> None:
    """Two BSENDs of one R_ID, one after the other."""
    connected(client).send(0x12, SENT[:600]).send(0x12, SENT[:600]).close()


@BOOK.scene("DS912: the partner refuses it in its acknowledge", "bsend refused, DS912")
def bsend_refused(client: Client) -> None:
    """BSEND for which the partner has no BRCV."""
    connected(client).send(0x12, SENT[:100], error=0xD202).close()


@BOOK.scene("DS913: ten bytes, then twelve, with the same R_ID", "2 usend ok, DS913")
def usend_changes(client: Client) -> None:
    """USEND whose areas change."""
    connected(client).usend(7, b"\1" * 10).usend(7, b"\1" * 12).close()


@BOOK.scene("Near DS913: ten bytes, then twelve, with another R_ID", "3 usend ok")
def usend_of_two(client: Client) -> None:
    """USEND of two R_IDs, one with two areas of odd length."""
    link = connected(client).usend(7, b"\1" * 10).usend(8, b"\1" * 3, b"\2" * 5)
    link.usend(7, b"\3" * 10).close()


# Connections


@BOOK.scene("DS915: the capture begins later than the connection", "2 get ok, DS915")
def setup_not_seen(client: Client) -> None:
    """A read by two jobs, and how long a PDU may be is not known."""
    client.stage.deaf = True
    link = connected(client)
    client.stage.deaf = False
    link.get(db(1, 0, MOST)).get(db(1, MOST, 100)).close()


@BOOK.scene("DS917: the connection is asked for, and TCP is closed", "DS917")
def closed_after_cr(client: Client) -> None:
    """CR, then FIN."""
    cpu(client).link().dial().close(by_client=False)


@BOOK.scene("DS917: the connection is asked for, and TCP is reset", "DS917")
def reset_after_cr(client: Client) -> None:
    """CR, then RST."""
    cpu(client).link().dial().segment(False, flags="RA")


@BOOK.scene("DS917: the connection is asked for, and refused by DR", "DS917")
def disconnected_after_cr(client: Client) -> None:
    """CR, then DR."""
    link = cpu(client).link().dial()
    link.segment(False, s7_wire.disconnect(3))
    link.close()


@BOOK.scene("DS917: the setup is refused", "DS917")
def setup_refused(client: Client) -> None:
    """CR and CC, and the setup is refused."""
    link = cpu(client).link().dial().confirm()
    link.say(True, JOB, link.next(), s7_wire.setup(480, 1))
    link.say(False, s7_wire.ACK, link.reference, b"", error=0x8500)
    link.close()


@BOOK.scene("Near DS917: the answer to CR takes two seconds", "get ok")
def confirmed_late(client: Client) -> None:
    """CR, and CC two seconds later."""
    link = cpu(client).link().dial()
    client.wait(2000)
    link.confirm()
    link.say(True, JOB, link.next(), s7_wire.setup(480, 1))
    link.say(False, s7_wire.ANSWER, link.reference, s7_wire.setup(480, 1))
    link.get(db(1, 0, 4)).close()


# How it is carried


@BOOK.scene("PDUs in several DT, each of at most 100 bytes", "get ok, put ok")
def cotp_segments(client: Client) -> None:
    """COTP cuts PDUs into pieces."""
    link = connected(client)
    link.tpdu = 100
    link.get(db(1, 0, 400)).put((db(1, 0, 300), SENT[:300])).close()


@BOOK.scene("One PDU in three TCP segments, and two PDUs in one", "3 get ok")
def tcp_pieces(client: Client) -> None:
    """TCP has no borders of messages."""
    link = connected(client, parallel=2)
    pieces = whole(link, db(1, 0, 4))
    for at in (0, 3, 20):
        link.segment(True, pieces[at : {0: 3, 3: 20, 20: None}[at]])
    link.answer(asked(link))
    two = whole(link, db(1, 8, 4)) + whole(link, db(1, 40, 4))
    link.segment(True, two)
    for reference, start in ((link.reference - 1, 8), (link.reference, 40)):
        link.answer(asked(link, start, reference))
    link.close()


@BOOK.scene("A request and an answer that TCP sends again: each counts once", "2 get ok")
def tcp_again(client: Client) -> None:
    """TCP retransmits."""
    link = connected(client)
    request = whole(link, db(1, 0, 4))
    link.segment(True, request)
    link.segment(True, request, back=len(request))
    link.answer(asked(link))
    last = client.stage.shots[-1]
    client.stage.frame(last.data)
    link.get(db(1, 4, 4)).close()


def whole(link: Link, variable: s7_wire.Var) -> bytes:
    """A read as TPKT, which is not sent."""
    return s7_wire.data(s7_wire.pdu(JOB, link.next(), s7_wire.items(s7_wire.READ, [variable])))


def asked(link: Link, start: int = 0, reference: int | None = None) -> Asked:
    """The read of four bytes that was sent so."""
    return Asked(reference or link.reference, (db(1, start, 4),))
