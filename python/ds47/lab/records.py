"""Scenarios: PNIO's record services. Refused and polled calls, IODWriteMultiple, implicit reads."""

from __future__ import annotations

from ds47.lab import message, wire
from ds47.lab.client import BUSY, OK, Client
from ds47.lab.scenario import Book
from ds47.lab.wire import RecordId

BOOK = Book("record")

SPEED = message.address(21)
READ = message.read(1, 1, SPEED)
ANSWER = message.answer(1, 1, 1, message.real(1500.0))
NOT_POSSIBLE = 0xDF80B500
BAD_HEADER = 0xDF80B700


@BOOK.scene("index 0xB02E, API 0x3A00", "read ok")
def local(client: Client) -> None:
    """Base Mode Parameter Access, local."""
    client.exchange(READ, ANSWER, at=client.at(index=0xB02E, api=0x3A00))


@BOOK.scene("index 0xB02F", "read ok")
def global_(client: Client) -> None:
    """Base Mode Parameter Access, global."""
    client.exchange(READ, ANSWER, at=client.at(index=0xB02F))


@BOOK.scene("three refused Reads before the response", "read ok")
def polls(client: Client) -> None:
    """Polling."""
    client.exchange(READ, ANSWER, polls=3)


@BOOK.scene("fifteen refused Reads, without a header of their own", "read ok, DS204")
def polls_many(client: Client) -> None:
    """Polling many times."""
    client.write(READ)
    for _ in range(15):
        client.poll(with_header=False)
        client.wait(10)
    client.read(ANSWER)


@BOOK.scene("the drive is busy for 4 s", "read ok, DS205 DS416")
def polls_long(client: Client) -> None:
    """Polling for a long time."""
    client.write(READ)
    for _ in range(4):
        client.poll()
        client.wait(1000)
    client.read(ANSWER)


@BOOK.scene("the response is read three times", "read ok, DS704")
def reread(client: Client) -> None:
    """A response read again."""
    client.exchange(READ, ANSWER)
    for _ in range(2):
        client.wait(20)
        client.read(ANSWER)


@BOOK.scene("DF80B700: an error in the header", "read refused, DS203")
def write_refused(client: Client) -> None:
    """A refused Write."""
    client.write(READ, status=BAD_HEADER)


@BOOK.scene(
    "a second request while the first is open is refused; the Read brings the first one's response",
    "read ok, read refused, DS203 DS705",
)
def write_refused_open(client: Client) -> None:
    """A Write refused while another request is open."""
    client.write(READ)
    client.write(message.read(2, 1, message.address(27)), status=NOT_POSSIBLE)
    client.read(ANSWER)


@BOOK.scene("DE80B600: access denied", "read refused, DS201")
def read_refused(client: Client) -> None:
    """A refused Read."""
    client.write(READ)
    client.poll(0xDE80B600)


@BOOK.scene("a positive Read without data, then the response", "read ok, DS207")
def read_empty(client: Client) -> None:
    """A positive Read without data."""
    client.write(READ)
    client.read(b"")
    client.wait(20)
    client.read(ANSWER)


@BOOK.scene("a Read before the first Write of its connection", "read ok, DS206 DS703")
def nothing_to_read(client: Client) -> None:
    """A Read that no request goes before."""
    client.connect("plc-1")
    client.poll(BUSY)
    client.exchange(READ, ANSWER)


@BOOK.scene("RecordDataLength of the Read response says 12, 8 bytes are there", "read ok, DS202")
def length(client: Client) -> None:
    """A record length that lies."""
    client.write(READ)
    client.accept_read(client.ask_read(), ANSWER, stated=len(ANSWER) + 4)


def _slots(client: Client) -> list[tuple[RecordId, bytes, int]]:
    """A read on each of three slots; request lengths need padding inside."""
    return [
        (client.at(slot=n), message.read(n, n + 1, message.address(20 + n)), OK) for n in (1, 2, 3)
    ]


@BOOK.scene("three requests in one IODWriteMultiple, read one by one", "3 read ok")
def multiple(client: Client) -> None:
    """IODWriteMultiple."""
    records = _slots(client)
    client.write_multiple(records)
    for number, (channel, _, _) in enumerate(records, start=1):
        answer = message.answer(number, 1, number + 1, message.real(float(number)))
        client.read(answer, at=channel)


@BOOK.scene(
    "the second of three requests in one IODWriteMultiple is refused",
    "read ok, read refused, read ok, DS203",
)
def multiple_refused(client: Client) -> None:
    """IODWriteMultiple with a refused record."""
    records = _slots(client)
    records[1] = (*records[1][:2], NOT_POSSIBLE)
    client.write_multiple(records)
    for number in (1, 3):
        answer = message.answer(number, 1, number + 1, message.real(float(number)))
        client.read(answer, at=records[number - 1][0])


@BOOK.scene("an IODWriteMultiple inside another one is not opened", "read ok, DS208")
def multiple_nested(client: Client) -> None:
    """IODWriteMultiple, nested."""
    client.exchange(READ, ANSWER)
    inner_place = client.at(slot=0xFFFF, subslot=0xFFFF, api=0xFFFFFFFF, index=wire.WRITE_MULTIPLE)
    inside = wire.write_request(0, client.at(slot=2), message.read(2, 1, SPEED))
    client.write_multiple([(inner_place, inside, 0xDF80B401)])


@BOOK.scene(
    "ReadImplicit of 0xB02F is a channel of its own: nothing there, though the AR has a response",
    "read ok, DS110",
)
def implicit(client: Client) -> None:
    """ReadImplicit."""
    place = client.at(index=0xB02F)
    client.write(READ, at=place)
    nowhere = client.at(ar=wire.NIL, index=0xB02F)
    client.refuse_read(client.ask_implicit(nowhere), 0xDE80B000, at=nowhere)
    client.read(ANSWER, at=place)


@BOOK.scene("ReadImplicit brings a response that nobody asked for", "read orphan, DS403 DS725")
def implicit_orphan(client: Client) -> None:
    """ReadImplicit with data."""
    nowhere = client.at(ar=wire.NIL, index=0xB02F)
    client.accept_read(client.ask_implicit(nowhere), ANSWER, at=nowhere)


@BOOK.scene("record 47 of something that is no drive: no transaction", "DS209")
def foreign(client: Client) -> None:
    """Index 47 that is not a parameter channel."""
    for text in (b"Hello, world", b"\x00\x00\x00\x10calibration data", b"\xff" * 8):
        client.exchange(text, text)


@BOOK.scene(
    "a broken request before the AR shows its parameter channel is taken in too",
    "read refused, read ok, DS203 DS315 DS711",
)
def foreign_then_ours(client: Client) -> None:
    """A broken request first."""
    client.write(message.read(7, 1, SPEED)[:8], status=BAD_HEADER)
    client.exchange(READ, ANSWER)


@BOOK.scene("other records around the parameter channel: I&M0, PDRealData", "change ok, DS721")
def other_index(client: Client) -> None:
    """Other records on the same AR."""
    client.read(bytes(54), at=client.at(index=0xAFF0))
    change = message.change(1, 1, (message.address(1070), message.word(7)))
    client.exchange(change, message.changed(1, 1))
    client.read(bytes(64), at=client.at(slot=0, index=0xF841))
