"""Scenarios: below the record. Byte orders, link headers, fragments, lost, cut, repeated frames."""

from __future__ import annotations

from dataclasses import replace
from uuid import UUID

from ds47.lab import ether, message, wire
from ds47.lab.client import Client, controller, drive
from ds47.lab.scenario import Book
from ds47.lab.wire import Order

BOOK = Book("transport")

SPEED = message.address(21)
READ = message.read(1, 1, SPEED)
ANSWER = message.answer(1, 1, 1, message.real(1500.0))
LONG = message.address(2902, 0, 50)
LONG_ANSWER = message.answer(1, 1, 1, message.real(*range(50)))
NCA_UNKNOWN_INTERFACE = 0x1C010003
NCA_BUSY = 0x1C01000B


def _speed(client: Client, reference: int = 1, value: float = 1500.0) -> None:
    """Read r0021."""
    answer = message.answer(reference, 1, 1, message.real(value))
    client.exchange(message.read(reference, 1, SPEED), answer)


def _long(client: Client) -> None:
    """Read an array of 50 floats: more than fits into a small fragment."""
    client.exchange(message.read(1, 1, LONG), LONG_ANSWER)


def _long_in_part(client: Client) -> None:
    """The same; of its response the fragment before the last is lost, and it is read again."""
    _long(client)
    client.stage.lose(-2)
    client.wait(500)
    client.read(LONG_ANSWER)


def _long_change(client: Client) -> None:
    """Change an array of 50 floats."""
    client.exchange(message.change(2, 1, (LONG, message.real(*range(50)))), message.changed(2, 1))


def _orders(client: Client, order: Order, answer: Order | None) -> None:
    client.order, client.answer_order = order, answer
    _speed(client)
    client.exchange(
        message.change(2, 1, (message.address(1070), message.word(7))), message.changed(2, 1)
    )
    client.write(message.read(3, 1, SPEED), status=0xDF80B500)


_SWAPPED = (
    "UUID, numbers and PNIOStatus follow the byte order of each PDU",
    "read ok, change ok, read refused, DS203 DS705 DS721",
)
BOOK.scenes(
    _orders,
    ("big-endian", "Controller and drive big-endian", *_SWAPPED, ">", None),
    ("little-endian", "Controller and drive little-endian", *_SWAPPED, "<", None),
    ("big-little", "Big-endian controller, little-endian drive", *_SWAPPED, ">", "<"),
    ("little-big", "Little-endian controller, big-endian drive", *_SWAPPED, "<", ">"),
)


def _carried(client: Client, link: int, *tags: tuple[int, int]) -> None:
    client.stage.link, client.stage.tags = link, tags
    _speed(client)


BOOK.scenes(
    _carried,
    ("vlan", "One VLAN tag", "802.1Q tag, priority 6", "read ok", ether.ETHERNET, (ether.CTAG, 10)),
    ("qinq", "Two VLAN tags", "802.1ad tag around an 802.1Q tag", "read ok", ether.ETHERNET,
     (ether.STAG, 100), (ether.CTAG, 10)),
    ("sll", "Linux cooked capture, version 1", "link type 113, as `tcpdump -i any` writes", "read ok",
     ether.COOKED),
    ("sll2", "Linux cooked capture, version 2", "link type 276, as newer `tcpdump -i any` writes",
     "read ok", ether.COOKED2),
)  # fmt: skip


@BOOK.scene("requests and responses in IP fragments", "read ok, change ok, DS721")
def ip_fragments(client: Client) -> None:
    """IP fragments."""
    client.stage.mtu = 176
    _long(client)
    _long_change(client)


@BOOK.scene("the last IP fragment comes first", "read ok")
def ip_fragments_disorder(client: Client) -> None:
    """IP fragments in the wrong order."""
    client.stage.mtu = 176
    _long(client)
    shots = client.stage.shots
    times = [shot.time_ns for shot in shots]
    # The last three frames are fragments of the Read response.
    ordered = [*shots[:-3], shots[-1], shots[-3], shots[-2]]
    client.stage.shots = [replace(shot, time_ns=t) for t, shot in zip(times, ordered, strict=True)]


@BOOK.scene(
    "a fragment of the Read response is lost; the controller reads again", "read ok, DS105 DS725"
)
def ip_fragments_incomplete(client: Client) -> None:
    """IP fragments, one of them lost."""
    client.stage.mtu = 176
    _long_in_part(client)


@BOOK.scene("requests and responses in RPC fragments", "read ok, change ok, DS721")
def rpc_fragments(client: Client) -> None:
    """RPC fragments."""
    client.fragment = 100
    _long(client)
    _long_change(client)


@BOOK.scene(
    "the middle fragment of the Read response is lost; the controller reads again",
    "read ok, DS105 DS725",
)
def rpc_fragments_incomplete(client: Client) -> None:
    """RPC fragments, one of them lost."""
    client.fragment = 100
    _long_in_part(client)


@BOOK.scene(
    "the capture keeps 260 bytes of each frame: the response is there in part",
    "read ok, DS106 DS725",
)
def snap_length(client: Client) -> None:
    """Frames cut by the snap length."""
    client.write(message.read(1, 1, LONG))
    client.stage.snap = 260
    client.read(LONG_ANSWER)


@BOOK.scene("a mirror port shows each frame twice, same IP id, 20 us apart", "read ok")
def copies(client: Client) -> None:
    """Every frame captured twice."""
    client.stage.copies = 2
    _speed(client)


@BOOK.scene(
    "no answer for 500 ms: the controller sends the Write again, the drive answers once",
    "read ok, DS103",
)
def retransmission(client: Client) -> None:
    """A Write sent again before its answer."""
    call = client.ask_write(READ)
    client.wait(500)
    client.ask_write(READ, again=call)
    client.accept_write(call, READ)
    client.read(ANSWER)


@BOOK.scene(
    "the answer was lost on the way: the same Write again half a second later, and its answer again",
    "read ok, DS103",
)
def retransmission_answered(client: Client) -> None:
    """A Write sent again after its answer."""
    call = client.ask_write(READ)
    client.accept_write(call, READ)
    client.wait(500)
    client.ask_write(READ, again=call)
    client.accept_write(call, READ)
    client.read(ANSWER)


@BOOK.scene(
    "the Read is sent again half a second behind its response, and answered with what there is now",
    "read ok, DS103 DS111",
)
def second_response(client: Client) -> None:
    """A Read that the device executes twice."""
    client.write(READ)
    call = client.ask_read()
    client.accept_read(call, ANSWER)
    client.wait(500)
    client.ask_read(again=call)
    client.accept_read(call, message.answer(1, 1, 1, message.real(1498.5)))


@BOOK.scene(
    "the controller starts again: same activity, same sequence numbers, a new request", "2 read ok"
)
def reused_numbers(client: Client) -> None:
    """Activity and sequence numbers used again after 59 s."""
    _speed(client)
    client.wait(59_000)
    client.sequence = 0
    _speed(client, reference=2, value=1480.0)


@BOOK.scene("ping and working PDUs between request and response", "read ok")
def ping_working(client: Client) -> None:
    """A slow answer with ping and working."""
    call = client.ask_write(READ)
    client.ask(call, b"", wire.PING)
    client.reply(call, b"", wire.WORKING)
    client.accept_write(call, READ)
    client.read(ANSWER)


def _status(client: Client, code: int) -> bytes:
    return code.to_bytes(4, "little" if client.reply_order == "<" else "big")


@BOOK.scene(
    "the drive answers the Write with an RPC fault; the next attempt works",
    "read refused, read ok, DS104",
)
def fault(client: Client) -> None:
    """An RPC fault."""
    call = client.ask_write(READ)
    client.reply(call, _status(client, NCA_UNKNOWN_INTERFACE), wire.FAULT)
    client.wait(100)
    _speed(client, reference=2)


@BOOK.scene(
    "the drive rejects the first Read, server too busy; the second one works", "read ok, DS104"
)
def reject(client: Client) -> None:
    """An RPC reject."""
    client.order = ">"
    client.write(READ)
    call = client.ask_read()
    client.reply(call, _status(client, NCA_BUSY), wire.REJECT)
    client.wait(50)
    client.read(ANSWER)


@BOOK.scene("an RPC response to the Read without any body; the second Read works", "read ok, DS108")
def empty_body(client: Client) -> None:
    """A response without a body."""
    client.write(READ)
    client.reply(client.ask_read(), b"")
    client.wait(50)
    client.read(ANSWER)


@BOOK.scene("the clock steps back by 2.5 s between two frames", "read ok, DS107")
def time_back(client: Client) -> None:
    """Time steps backwards."""
    client.write(READ)
    client.wait(-2500)
    client.read(ANSWER)


@BOOK.scene("the drive answers from port 49153 and is asked there", "2 read ok")
def ephemeral_port(client: Client) -> None:
    """Answers from another port."""
    client.answer_port = 49153
    _speed(client)
    _speed(client, reference=2)


@BOOK.scene(
    "the response to the Write was not captured; the Read proves that it was accepted",
    "read ok, DS101 DS725",
)
def write_unanswered(client: Client) -> None:
    """A Write response that is missing."""
    client.ask_write(READ)
    client.read(ANSWER)


@BOOK.scene("the capture starts after the Write request", "read orphan, DS102 DS403 DS725")
def starts_late(client: Client) -> None:
    """Capture starts in the middle of a transaction."""
    client.stage.deaf = True
    call = client.ask_write(READ, at=client.at(index=0xB02F))
    client.stage.deaf = False
    client.accept_write(call, READ, at=client.at(index=0xB02F))
    client.read(ANSWER, at=client.at(index=0xB02F))


@BOOK.scene("the capture ends after the Write response", "read ok, read incomplete, DS110 DS725")
def ends_early(client: Client) -> None:
    """Capture ends in the middle of a transaction."""
    _speed(client)
    client.write(message.read(2, 1, SPEED))


@BOOK.scene(
    "the last frame of the capture is a Write request",
    "read ok, read incomplete, DS101 DS110 DS725",
)
def ends_in_call(client: Client) -> None:
    """Capture ends in the middle of a call."""
    _speed(client)
    client.ask_write(message.read(2, 1, SPEED))


@BOOK.scene(
    "two controllers on one drive at the same time, same references and sequence numbers",
    "6 read ok",
)
def two_controllers(client: Client) -> None:
    """Two controllers, one drive."""
    second = Client(
        client.stage,
        controller(2),
        client.device,
        order=">",
        activity=UUID("1f2e3d4c-5b6a-11f0-8a47-00000a0b0c02"),
    )
    second.channel = second.at(ar=UUID("47474747-0002-4000-8000-000000000002"), slot=2)
    for reference in (1, 2, 3):
        request = message.read(reference, 1, SPEED)
        client.write(request)
        second.write(request)
        second.read(message.answer(reference, 1, 1, message.real(20.0)))
        client.read(message.answer(reference, 1, 1, message.real(10.0)))


@BOOK.scene(
    "two drives, two slots each, DO 2 and 3: all asked, then all read in another order", "4 read ok"
)
def many_channels(client: Client) -> None:
    """Several drives, slots and axes interleaved."""
    clients = [
        Client(
            client.stage,
            device=drive(n),
            activity=UUID(int=0x4700 + n),
            channel=wire.RecordId(UUID(int=n)),
        )
        for n in (1, 2)
    ]
    jobs = [(each, each.at(slot=slot)) for each in clients for slot in (1, 2)]
    for each, channel in jobs:
        each.write(message.read(7, channel.slot + 1, SPEED), at=channel)
    for number, (each, channel) in enumerate(reversed(jobs)):
        value = message.real(float(number))
        each.read(message.answer(7, 1, channel.slot + 1, value), at=channel)
