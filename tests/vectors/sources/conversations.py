"""Writes tests/vectors/conversations.json: small conversations and what they must become.

The lab's `Client` plays each one; only its UDP payloads are kept, so scapy is not needed. What is
expected is typed by hand, from the sentences of docs/pairing.md, and never taken from an analysis.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from uuid import UUID

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "python"))

from ds47.lab import message, wire  # noqa: E402
from ds47.lab.client import BUSY, Client, controller, drive  # noqa: E402
from ds47.lab.ether import PNIO_PORT, Host  # noqa: E402
from ds47.lab.stage import START_NS, Stage  # noqa: E402

TARGET = ROOT / "tests/vectors/conversations.json"
ABOUT = (
    "Conversations and the transactions and findings they must become, for every implementation. "
    "tests/vectors/README.md says how to run them; tests/vectors/sources/conversations.py writes this file."
)
CLIENT_PORT = 49152
REQUEST_KINDS = (wire.REQUEST, wire.PING)
Row = dict[str, Any]


# The tape: what goes past, as steps


@dataclass(slots=True)
class Tape(Stage):
    """A stage that keeps UDP payloads and no frames."""

    steps: list[Row] = field(default_factory=list)

    def send(
        self, source: Host, target: Host, payload: bytes, ports: tuple[int, int] | None = None
    ) -> None:
        """A UDP datagram goes past; ports are (source, target)."""
        asked = payload[1] & 0x1F in REQUEST_KINDS
        client, server = (source, target) if asked else (target, source)
        here, there = ports or (source.port, target.port)
        ours, theirs = (here, there) if asked else (there, here)
        step: Row = {
            "t": self.now_ns - START_NS,
            "direction": "request" if asked else "response",
            "client": client.ip,
            "server": server.ip,
            "ip_id": next(source.identification) & 0xFFFF,
            "bytes": payload.hex(),
        }
        if ours != CLIENT_PORT:
            step["client_port"] = ours
        if theirs != PNIO_PORT:
            step["server_port"] = theirs
        if not self.deaf:
            self.steps.append(step)
        self.now_ns += self.gap_ns

    def cut(self, count: int) -> None:
        """The capture cuts so many bytes off the newest frame."""
        step = self.steps[-1]
        step["bytes"] = step["bytes"][: -2 * count]
        step["cut"] = count

    def repeat(self, number: int = -1) -> None:
        """A datagram that was seen before is seen again, with its IP id."""
        self.steps.append({**self.steps[number], "t": self.now_ns - START_NS})
        self.now_ns += self.gap_ns


# What is expected


AR, AR2 = (UUID(f"47474747-000{n}-4000-8000-000000000001") for n in (1, 2))
GOOD = "00000000"
HOME: Row = {
    "controller": "192.168.133.2",
    "device": "192.168.133.33",
    "ar": str(AR),
    "api": 0,
    "slot": 1,
    "subslot": 1,
    "index": 47,
}


def par(
    pnu: int | None,
    form: str | None = None,
    *values: float,
    subindex: int = 0,
    error: tuple[int | None, int | None] | None = None,
) -> Row:
    """A parameter; without a PNU it has no address at all."""
    return {
        "pnu": pnu,
        "subindex": None if pnu is None else subindex,
        "attribute": None if pnu is None else "value",
        "format": form,
        "values": list(values),
        "error": None if error is None else {"code": error[0], "info": error[1]},
    }


def tx(
    number: int,
    state: str,
    frames: tuple[int | None, int | None, int | None, int | None],
    ms: float | None,
    *parameters: Row,
    operation: str = "read",
    ref: int = 1,
    axis: int = 1,
    write: str | None = GOOD,
    read: str | None = GOOD,
    polls: Sequence[tuple[int | None, int]] = (),
    rereads: Sequence[tuple[int, int]] = (),
    **place: Any,
) -> Row:
    """A transaction; `frames` are Write request and response, Read request and response."""
    names = ("write_request", "write_response", "read_request", "read_response")
    return {
        "id": number,
        "operation": operation,
        "state": state,
        **HOME,
        **place,
        "request_reference": ref,
        "axis": axis,
        "frames": {
            **dict(zip(names, frames, strict=True)),
            "polls": [{"request": one, "response": two} for one, two in polls],
            "rereads": [{"request": one, "response": two} for one, two in rereads],
        },
        "duration_ns": None if ms is None else round(ms * 1_000_000),
        "status": {"write": write, "read": read},
        "parameters": list(parameters),
    }


def found(text: str, *, dropped: bool = False) -> list[Row]:
    """Findings from words such as `DS413@3#1`: rule, frame, transaction (none without #)."""
    result = []
    for word in text.split():
        rule, _, place = word.partition("@")
        frame, _, owner = place.partition("#")
        finding: Row = {
            "rule": rule,
            "frame": int(frame),
            "transaction": int(owner) if owner else None,
        }
        if dropped:
            finding["says_dropped"] = True
        result.append(finding)
    return result


def in_order(findings: list[Row]) -> list[Row]:
    """As a report has them."""
    return sorted(findings, key=lambda one: (one["frame"], one["rule"], one["transaction"] or 0))


CASES: list[Row] = []
Play = Callable[[Tape], None]


def case(
    name: str,
    shows: str,
    flags: str,
    transactions: Sequence[Row],
    findings: str = "",
    *,
    diagnoses: str = "",
    options: Row | None = None,
    dropped: int | None = None,
    cases: list[Row] = CASES,
) -> Callable[[Play], Play]:
    """Decorator: a function that plays a conversation becomes a case; its docstring the comment."""

    def enter(play: Play) -> Play:
        tape = Tape()
        play(tape)
        row: Row = {
            "id": name,
            "comment": " ".join((play.__doc__ or "").split()),
            "shows": shows.split(),
            "flags": flags.split(),
        }
        if options is not None:
            row["options"] = options
        if dropped is not None:
            row["dropped"] = dropped
        row["steps"] = tape.steps
        listed = found(findings, dropped=dropped is not None)
        row["expect"] = {"transactions": list(transactions), "findings": in_order(listed)}
        if diagnoses:
            row["expect"]["diagnoses"] = in_order(found(diagnoses))
        cases.append(row)
        return play

    return enter


# Messages


def ask(reference: int = 1, *pnus: int, axis: int = 1) -> bytes:
    """A read of parameters without index; of r0021 where none is named."""
    return message.read(reference, axis, *(message.address(pnu) for pnu in pnus or (21,)))


def tell(reference: int, *values: float, axis: int = 1, identifier: int = 1) -> bytes:
    """The answer to a read: one Float32 each."""
    return message.answer(reference, identifier, axis, *(message.real(value) for value in values))


def put(reference: int, value: float, pnu: int = 1120) -> bytes:
    """A change of one Float32."""
    return message.change(reference, 1, (message.address(pnu), message.real(value)))


def real(*values: float, pnu: int | None = 21) -> Row:
    """What a Float32 becomes."""
    return par(pnu, "Float32", *values)


NOTHING = par(21)
NOT_POSSIBLE, BAD_HEADER = 0xDF80B500, 0xDF80B700
CUT = ask(7)[:8]
"""A read whose only address lacks its last two bytes: known id, but the length does not fit."""


def release(client: Client) -> None:
    """The AR of the client ends: IODReleaseReq and IODReleaseRes."""

    def block(kind: int, command: int) -> bytes:
        head = kind.to_bytes(2, "big") + bytes((0, 28, 1, 0, 0, 0)) + client.channel.ar.bytes
        return head + bytes((0, 1, 0, 0)) + command.to_bytes(2, "big") + bytes(2)

    call = client.call(wire.RELEASE)
    client.ask(call, block(0x0114, 4))
    client.accept(call, 0, block(0x8114, 8))


def implicit(client: Client, record: bytes, index: int = 0xB02F) -> None:
    """A ReadImplicit brings a record."""
    nowhere = client.at(ar=wire.NIL, index=index)
    call = client.call(wire.READ_IMPLICIT)
    client.ask(call, wire.read_request(call.sequence, nowhere))
    client.accept_read(call, record, at=nowhere)


def again(client: Client, call: wire.Call, record: bytes) -> None:
    """The Write request of a call is sent once more, with an IP id of its own."""
    client.ask(call, wire.write_request(call.sequence, client.channel, record))


def second(tape: Tape, **more: Any) -> Client:
    """A second controller on the same drive, with an AR of its own."""
    settings = {"activity": UUID(int=0x47), "channel": wire.Channel(AR2), **more}
    return Client(tape, controller(2), **settings)


HOME2: Row = {"controller": "192.168.133.3", "ar": str(AR2)}


# The plain life of a transaction


@case("P24-read", "P2 P3 P14 P24 P29 P46 P48", "none", [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5))])
def _(tape: Tape) -> None:
    """Write request and response, Read request and response: one read."""
    Client(tape).exchange(ask(), tell(1, 1.5))


@case(
    "P24-change",
    "P24 P29 P46",
    "none",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change")],
)
def _(tape: Tape) -> None:
    """A change; its values are those that were written."""
    Client(tape).exchange(put(1, 10.0), message.changed(1, 1))


@case(
    "P37-by-position",
    "P37",
    "none",
    [
        tx(
            1,
            "ok",
            (1, 2, 3, 4),
            3,
            par(27, "Unsigned16", 7, 8, subindex=3),
            par(21, "Float32", 1.5),
        )
    ],
)
def _(tape: Tape) -> None:
    """Two parameters in another order than their numbers: the n-th block is the n-th address."""
    request = message.read(1, 1, message.address(27, 3, 2), message.address(21))
    Client(tape).exchange(request, message.answer(1, 1, 1, message.word(7, 8), message.real(1.5)))


@case(
    "P3-fragments",
    "P3 P48",
    "fragments",
    [tx(1, "ok", (2, 4, 6, 8), 6, real(1.5))],
)
def _(tape: Tape) -> None:
    """Every PDU in two RPC fragments: frame and time are those of the second one."""
    Client(tape, fragment=60).exchange(ask(), tell(1, 1.5))


@case("P29-late-read", "P29 P48", "late-read", [tx(1, "ok", (1, 2, 3, 4), 30003, real(1.5))])
def _(tape: Tape) -> None:
    """The response is fetched 30 s after the Write: still the same transaction, and not slow."""
    client = Client(tape)
    client.write(ask())
    tape.wait(30_000)
    client.read(tell(1, 1.5))


@case(
    "P2-time-back",
    "P2 P48",
    "time-back",
    [tx(1, "ok", (1, 2, 3, 4), -2497, real(1.5))],
    "DS107@3",
)
def _(tape: Tape) -> None:
    """The clock steps back by 2.5 s before the Read: the order of the frames counts."""
    client = Client(tape)
    client.write(ask())
    tape.wait(-2500)
    client.read(tell(1, 1.5))


# RPC level


@case(
    "P4-same-activity",
    "P4 P14",
    "interleaved",
    [
        tx(1, "ok", (1, 4, 6, 8), 7, real(1.5)),
        tx(2, "ok", (2, 3, 5, 7), 5, real(2.5), **HOME2),
    ],
)
def _(tape: Tape) -> None:
    """Two controllers with the same activity UUID and the same sequence numbers at one time."""
    first = Client(tape)
    other = second(tape, activity=first.activity)
    one, two = first.ask_write(ask()), other.ask_write(ask())
    other.accept_write(two, ask())
    first.accept_write(one, ask())
    two, one = other.ask_read(), first.ask_read()
    other.accept_read(two, tell(1, 2.5))
    first.accept_read(one, tell(1, 1.5))


@case(
    "P5-big-asks-little-answers",
    "P5 P13",
    "byte-order",
    [tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)])],
)
def _(tape: Tape) -> None:
    """Big-endian controller, little-endian drive; the poll's status swaps, the blocks do not."""
    client = Client(tape, order=">", answer_order="<")
    client.write(ask())
    client.poll()
    client.read(tell(1, 1.5))


@case(
    "P5-little-asks-big-answers",
    "P5 P13",
    "byte-order",
    [tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), polls=[(3, 4)])],
)
def _(tape: Tape) -> None:
    """Little-endian controller, big-endian drive."""
    client = Client(tape, order="<", answer_order=">")
    client.write(ask())
    client.poll(with_header=False)
    client.read(tell(1, 1.5))


@case("P6-copies", "P6", "copy", [tx(1, "ok", (1, 3, 5, 7), 3.3, real(1.5))])
def _(tape: Tape) -> None:
    """A mirror port shows every datagram twice, 0.1 to 1 ms apart: the first one counts."""
    client = Client(tape)
    tape.gap_ns = 100_000

    def twice() -> None:
        tape.repeat()
        tape.wait(0.9)

    call = client.ask_write(ask())
    twice()
    client.accept_write(call, ask())
    twice()
    call = client.ask_read()
    twice()
    client.accept_read(call, tell(1, 1.5))
    tape.wait(0.9)
    tape.repeat()


@case("P6-limit-of-copy", "P6", "copy", [tx(1, "ok", (1, 3, 4, 5), 4, real(1.5))])
def _(tape: Tape) -> None:
    """Exactly 1 ms apart is still a copy."""
    client = Client(tape)
    call = client.ask_write(ask())
    tape.repeat()
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P7-same-ip-id-2-ms",
    "P6 P7 P10",
    "retransmission",
    [tx(1, "ok", (1, 3, 4, 5), 5, real(1.5))],
    "DS103@2#1",
)
def _(tape: Tape) -> None:
    """2 ms apart is no copy, though the IP id is the same: a retransmission."""
    client = Client(tape)
    call = client.ask_write(ask())
    tape.wait(1)
    tape.repeat()
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P7-other-ip-id-within-1-ms",
    "P6 P7 P10",
    "retransmission",
    [tx(1, "ok", (1, 3, 4, 5), 4, real(1.5))],
    "DS103@2#1",
)
def _(tape: Tape) -> None:
    """1 ms apart is no copy where the IP id differs: a retransmission."""
    client = Client(tape)
    call = client.ask_write(ask())
    again(client, call, ask())
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P7-retransmission-unanswered",
    "P7 P10",
    "retransmission",
    [tx(1, "ok", (1, 4, 5, 6), 25_005, real(1.5))],
    "DS103@2#1 DS103@3#1 DS416@6#1",
)
def _(tape: Tape) -> None:
    """A Write sent three times within 25 s before its answer: one call, however long it takes."""
    client = Client(tape)
    call = client.ask_write(ask())
    tape.wait(12_500)
    again(client, call, ask())
    tape.wait(12_500)
    again(client, call, ask())
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P8-retransmission-answered",
    "P8 P10",
    "retransmission",
    [tx(1, "ok", (1, 2, 5, 6), 2005, real(1.5))],
    "DS103@3#1",
)
def _(tape: Tape) -> None:
    """The identical Write 2 s after its answer, and its answer again."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    tape.wait(2000)
    again(client, call, ask())
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P8-after-10-s",
    "P8 P9 P27 P41",
    "reused-number superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(1.5)),
    ],
    "DS413@3#1 DS415@3#2",
)
def _(tape: Tape) -> None:
    """The identical Write 10.001 s after its answer is a new call."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    tape.wait(10_000)
    again(client, call, ask())
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P8-other-number-between",
    "P8 P9 P27 P41",
    "reused-number superseded poll",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None, polls=[(3, 4)]),
        tx(2, "ok", (5, 6, 7, 8), 3, real(1.5)),
    ],
    "DS413@5#1 DS415@5#2",
)
def _(tape: Tape) -> None:
    """The identical Write after another sequence number of the activity is a new call."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    client.poll()
    again(client, call, ask())
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P8-not-identical",
    "P8 P9",
    "reused-number superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS413@3#1",
    diagnoses="DS705@3#1",
)
def _(tape: Tape) -> None:
    """The same sequence number with another record right after the answer is a new call."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.accept_write(call, ask())
    again(client, call, ask(2, 27))
    client.accept_write(call, ask(2, 27))
    client.read(tell(2, 2.5))


@case(
    "P9-reused-after-59-s",
    "P9 P16",
    "reused-number",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "ok", (5, 6, 7, 8), 3, real(2.5)),
    ],
    "DS415@5#2",
)
def _(tape: Tape) -> None:
    """59 s later the same activity, sequence numbers and bytes again: a new transaction."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    tape.wait(59_000)
    client.sequence = 0
    client.exchange(ask(), tell(1, 2.5))


@case(
    "P9-other-record-unanswered",
    "P7 P9 P11 P42",
    "reused-number lost",
    [
        tx(1, "unanswered", (1, None, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (2, 3, 4, 5), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS101@1#1 DS401@1#1",
)
def _(tape: Tape) -> None:
    """The same sequence number with another record while the call is open: not the same request."""
    client = Client(tape)
    call = client.ask_write(ask())
    again(client, call, ask(2, 27))
    client.accept_write(call, ask(2, 27))
    client.read(tell(2, 2.5))


@case(
    "P11-call-at-end",
    "P11 P38 P42",
    "lost",
    [tx(1, "unanswered", (1, 2, 3, None), None, NOTHING, read=None)],
    "DS401@1#1 DS101@3#1",
)
def _(tape: Tape) -> None:
    """The capture ends after the Read request: call and transaction are unanswered."""
    client = Client(tape)
    client.write(ask())
    client.ask_read()


@case(
    "P11-response-after-expiry",
    "P11 P28",
    "lost late-response",
    [tx(1, "ok", (1, None, 3, 4), 61_003, real(1.5), write=None)],
    "DS101@1#1 DS102@2",
)
def _(tape: Tape) -> None:
    """A Write response 61 s after its request: the call was given up after 60 s."""
    client = Client(tape)
    call = client.ask_write(ask())
    tape.wait(61_000)
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P12-other-index",
    "P12",
    "retransmission lost other-index",
    [tx(1, "ok", (4, 5, 6, 7), 3, real(1.5))],
)
def _(tape: Tape) -> None:
    """A retransmission, a refused and a lost Read on I&M0 are none of our business."""
    client = Client(tape)
    place = client.at(index=0xAFF0)
    call = client.ask_read(at=place)
    tape.wait(500)
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


@case(
    "P14-places",
    "P14 P16",
    "interleaved",
    [
        tx(n, "ok", (2 * n - 1, 2 * n, 25 - 2 * n, 26 - 2 * n), 27 - 4 * n, real(n), **place)
        for n, place in enumerate(PLACES, 1)
    ],
)
def _(tape: Tape) -> None:
    """Six channels of one AR with the same reference: all asked, then read in reverse order."""
    client = Client(tape)
    places = [client.at(**place) for place in PLACES]
    for place in places:
        client.write(ask(), at=place)
    for number in range(len(places), 0, -1):
        client.read(tell(1, float(number)), at=places[number - 1])


@case(
    "P14-two-controllers",
    "P14 P16",
    "interleaved",
    [
        tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
        tx(2, "ok", (3, 4, 5, 6), 3, real(2.5), **HOME2),
    ],
)
def _(tape: Tape) -> None:
    """Two controllers on one drive, same place, reference and sequence numbers."""
    first, other = Client(tape), second(tape)
    first.write(ask())
    other.write(ask())
    other.read(tell(1, 2.5))
    first.read(tell(1, 1.5))


@case(
    "P14-same-ar-uuid",
    "P14",
    "interleaved",
    [
        tx(1, "ok", (1, 2, 9, 10), 9, real(1.5)),
        tx(2, "ok", (3, 4, 7, 8), 5, real(2.5), controller="192.168.133.3"),
        tx(3, "ok", (5, 6, 11, 12), 7, real(3.5), device="192.168.133.34"),
    ],
)
def _(tape: Tape) -> None:
    """The same AR UUID with two controllers and with two devices: three channels."""
    clients = [
        Client(tape),
        second(tape, channel=wire.Channel(AR)),
        Client(tape, device=drive(2), activity=UUID(int=0x48)),
    ]
    for client in clients:
        client.write(ask())
    clients[1].read(tell(1, 2.5))
    clients[0].read(tell(1, 1.5))
    clients[2].read(tell(1, 3.5))


@case(
    "P15-implicit-own-channel",
    "P15 P32",
    "implicit orphan",
    [
        tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), index=0xB02F),
        tx(2, "orphan", (None, None, 3, 4), None, real(9.5, pnu=None),
           ref=7, write=None, index=0xB02F, ar=None),
    ],
    "DS403@4#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """A ReadImplicit between Write and Read of an AR does not take the response of the AR."""
    client = Client(tape)
    place, nowhere = client.at(index=0xB02F), client.at(ar=wire.NIL, index=0xB02F)
    client.write(ask(), at=place)
    call = client.call(wire.READ_IMPLICIT)
    client.ask(call, wire.read_request(call.sequence, nowhere))
    client.accept_read(call, tell(7, 9.5), at=nowhere)
    client.read(tell(1, 1.5), at=place)


@case(
    "P55-implicit-reread",
    "P55",
    "implicit reread",
    [
        tx(1, "error", (1, 2, 3, 4), 3, par(21, error=(1, 0)), index=0xB02F, rereads=[(5, 6)]),
        tx(2, "ok", (7, 8, 9, 10), 3, real(2.5), ref=2, index=0xB02F),
    ],
    "DS410@4#1",
    diagnoses="DS701@4#1 DS704@6#1",
)
def _(tape: Tape) -> None:
    """Another station reads the response of an AR without one: nothing was asked, nothing fails once more."""
    client = Client(tape)
    place = client.at(index=0xB02F)
    failed = message.answer(1, 0x81, 1, message.error(1))
    client.exchange(ask(), failed, at=place)
    implicit(second(tape), failed)
    client.exchange(ask(2), tell(2, 2.5), at=place)


@case(
    "P55-implicit-of-another-ar",
    "P55",
    "implicit reread",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5), index=0xB02F),
        tx(2, "ok", (5, 6, 7, 8), 3, real(2.5), index=0xB02F, rereads=[(9, 10)], **HOME2),
        tx(3, "orphan", (None, None, 11, 12), None, real(1.5, pnu=None),
           write=None, index=0xB02F, ar=None),
    ],
    "DS403@12#3",
    diagnoses="DS704@10#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """Of two that asked at a place the last one counts; the response before it is nobody's any more."""
    client, other = Client(tape), second(tape)
    client.exchange(ask(), tell(1, 1.5), at=client.at(index=0xB02F))
    other.exchange(ask(), tell(1, 2.5), at=other.at(index=0xB02F))
    implicit(client, tell(1, 2.5))
    implicit(client, tell(1, 1.5))


@case(
    "P55-implicit-after-release",
    "P55 P38",
    "implicit orphan release reread",
    [
        tx(1, "error", (1, 2, 3, 4), 3, par(21, error=(1, 0)), index=0xB02F),
        tx(2, "orphan", (None, None, 7, 8), None, par(None, error=(1, 0)),
           write=None, index=0xB02F, ar=None, rereads=[(9, 10)]),
    ],
    "DS410@4#1 DS403@8#2",
    diagnoses="DS701@4#1 DS704@8#2 DS704@10#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """The transaction was over when its response was read again; its error is not told twice."""
    client = Client(tape)
    place = client.at(index=0xB02F)
    failed = message.answer(1, 0x81, 1, message.error(1))
    client.exchange(ask(), failed, at=place)
    release(client)
    implicit(client, failed)
    implicit(client, failed)


@case(
    "P16-no-keys",
    "P16",
    "none",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "ok", (5, 6, 7, 8), 3, real(2.5, pnu=27)),
    ],
    "DS415@5#2",
)
def _(tape: Tape) -> None:
    """Block sequence number and reference never change, the drive answers from another port."""
    client = Client(tape, answer_port=49999)
    place = client.channel
    for pnu, value in ((21, 1.5), (27, 2.5)):
        call = client.call(wire.WRITE)
        client.ask(call, wire.write_request(5, place, ask(1, pnu)))
        client.accept(call, 0, wire.write_response(5, place, 10, 0))
        call = client.call(wire.READ)
        client.ask(call, wire.read_request(5, place))
        client.accept(call, 0, wire.read_response(5, place, tell(1, value)))


def multiple(client: Client, statuses: Sequence[int]) -> list[wire.Channel]:
    """IODWriteMultiple: a read of r0021 on slots 1, 2, 3 with references 1, 2, 3."""
    places = [client.at(slot=number) for number in range(1, len(statuses) + 1)]
    client.write_multiple(
        [(place, ask(place.slot), status) for place, status in zip(places, statuses, strict=True)]
    )
    return places


@case(
    "P17-write-multiple",
    "P17 P49",
    "write-multiple",
    [
        tx(1, "ok", (1, 2, 7, 8), 7, real(1.0)),
        tx(2, "ok", (1, 2, 5, 6), 5, real(2.0), ref=2, slot=2),
        tx(3, "ok", (1, 2, 3, 4), 3, real(3.0), ref=3, slot=3),
    ],
)
def _(tape: Tape) -> None:
    """Three requests in one Write, read in reverse order: ids follow the place in the Write."""
    client = Client(tape)
    for place in reversed(multiple(client, (0, 0, 0))):
        client.read(tell(place.slot, float(place.slot)), at=place)


@case(
    "P17-one-refused",
    "P17 P25 P49",
    "write-multiple refused",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.0)),
        tx(2, "refused", (1, 2, None, None), None, NOTHING,
           ref=2, slot=2, write="DF80B500", read=None),
        tx(3, "ok", (1, 2, 5, 6), 5, real(3.0), ref=3, slot=3),
    ],
    "DS203@2#2",
    diagnoses="DS705@1#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """The second of three inner responses is negative: paired by position, only it is refused."""
    client = Client(tape)
    places = multiple(client, (0, NOT_POSSIBLE, 0))
    for place in (places[0], places[2]):
        client.read(tell(place.slot, float(place.slot)), at=place)


def nested(client: Client) -> tuple[wire.Channel, bytes, int]:
    """An inner IODWriteMultiple with a request for slot 2, refused."""
    place = client.at(slot=0xFFFF, subslot=0xFFFF, api=0xFFFFFFFF, index=wire.WRITE_MULTIPLE)
    return place, wire.write_request(0, client.at(slot=2), ask(2)), 0xDF80B401


@case(
    "P18-nested",
    "P18",
    "write-multiple nested",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5))],
    "DS208@5",
)
def _(tape: Tape) -> None:
    """An IODWriteMultiple inside another one: a finding, no transaction."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    client.write_multiple([nested(client)])


@case(
    "P18-nested-beside-a-request",
    "P17 P18",
    "write-multiple nested",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5))],
    "DS208@1",
)
def _(tape: Tape) -> None:
    """Beside the nested one stands a request of the first level: that one is opened."""
    client = Client(tape)
    client.write_multiple([(client.channel, ask(), 0), nested(client)])
    client.read(tell(1, 1.5))


# Which records are ours


@case(
    "P19-malformed-on-b02f",
    "P19 P25 P40 P53",
    "malformed refused",
    [tx(1, "refused", (1, 2, None, None), None, ref=7, write="DF80B700", read=None, index=0xB02F)],
    "DS315@1#1 DS203@2#1",
    diagnoses="DS711@1#1",
)
def _(tape: Tape) -> None:
    """A cut request on 0xB02F is ours though nothing else is there: a finding, no exception."""
    client = Client(tape)
    client.write(CUT, status=BAD_HEADER, at=client.at(index=0xB02F))


@case(
    "P20-response-opens",
    "P20 P32",
    "starts-late orphan",
    [tx(1, "orphan", (None, None, 1, 2), None, real(1.5, pnu=None), write=None)],
    "DS403@2#1",
)
def _(tape: Tape) -> None:
    """On index 47 a shaped response is proof enough."""
    Client(tape).read(tell(1, 1.5))


@case(
    "P20-once-more-without-an-ar",
    "P20 P43 P55",
    "mismatch implicit",
    [
        tx(1, "mismatch", (1, 2, 3, 4), 3, real(1.5, pnu=None), rereads=[(5, 6)]),
        tx(2, "ok", (7, 8, 9, 10), 3, real(2.5), ref=2),
    ],
    "DS319@4#1 DS405@4#1",
    diagnoses="DS704@6#1",
)
def _(tape: Tape) -> None:
    """A response without the shape of DS47, read once more without an AR while a shaped request is known."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5, identifier=0x03))
    implicit(client, tell(1, 1.5, identifier=0x03), index=47)
    client.exchange(ask(2), tell(2, 2.5))


@case(
    "P20-per-ar",
    "P20 P23",
    "foreign",
    [tx(1, "ok", (3, 4, 5, 6), 3, real(1.5))],
)
def _(tape: Tape) -> None:
    """Index 47 of one AR is a parameter channel, of another AR on the same device it is not."""
    foreign = second(tape)
    foreign.write(b"Hello, world")
    Client(tape).exchange(ask(), tell(1, 1.5))
    foreign.read(b"Hello, world")


@case(
    "P21-malformed-later",
    "P21",
    "malformed refused",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "refused", (5, 6, None, None), None, ref=7, write="DF80B700", read=None),
    ],
    "DS315@5#2 DS203@6#2",
    diagnoses="DS711@5#2",
)
def _(tape: Tape) -> None:
    """After a shaped message a cut one on index 47 is decoded with its findings."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    client.write(CUT, status=BAD_HEADER)


@case(
    "P22-malformed-before",
    "P22 P20",
    "malformed refused",
    [
        tx(1, "refused", (1, 2, None, None), None, ref=7, write="DF80B700", read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(1.5)),
    ],
    "DS315@1#1 DS203@2#1",
    diagnoses="DS711@1#1",
)
def _(tape: Tape) -> None:
    """A cut and refused request before the first shaped one is taken in too."""
    client = Client(tape)
    client.write(CUT, status=BAD_HEADER)
    client.exchange(ask(), tell(1, 1.5))


@case(
    "P22-late-is-no-step-back",
    "P22 P20",
    "malformed refused interleaved",
    [
        tx(1, "refused", (1, 2, None, None), None, ref=7, write="DF80B700", read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(1.5), **HOME2),
        tx(3, "ok", (7, 8, 9, 10), 3, real(1.5)),
    ],
    "DS315@1#1 DS203@2#1",
    diagnoses="DS711@1#1",
)
def _(tape: Tape) -> None:
    """What waited for its AR to prove itself is taken in behind frames of another one: no clock stepped back."""
    client = Client(tape)
    client.write(CUT, status=BAD_HEADER)
    second(tape).exchange(ask(), tell(1, 1.5))
    client.exchange(ask(), tell(1, 1.5))


@case(
    "P22-late-step-back",
    "P2 P22",
    "malformed refused interleaved time-back",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5), **HOME2),
        tx(2, "refused", (5, 6, None, None), None, ref=7, write="DF80B700", read=None),
        tx(3, "ok", (7, 8, 9, 10), 3, real(1.5)),
    ],
    "DS107@5 DS315@5#2 DS203@6#2",
    diagnoses="DS711@5#2",
)
def _(tape: Tape) -> None:
    """The clock steps back at a frame that waits for its AR to prove itself: there, and not behind it."""
    second(tape).exchange(ask(), tell(1, 1.5))
    client = Client(tape)
    tape.wait(-50)
    client.write(CUT, status=BAD_HEADER)
    client.exchange(ask(), tell(1, 1.5))


@case(
    "P22-in-its-place",
    "P22 P27 P41",
    "malformed superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, ref=7, read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(1.5)),
    ],
    "DS315@1#1 DS413@3#1",
    diagnoses="DS711@1#1 DS705@3#1",
)
def _(tape: Tape) -> None:
    """A cut but accepted request before the first shaped one was open when that one came."""
    client = Client(tape)
    client.write(CUT)
    client.exchange(ask(), tell(1, 1.5))


@case(
    "P22-release-in-its-place",
    "P22 P38",
    "malformed release unanswered",
    [
        tx(1, "unanswered", (1, 2, None, None), None, ref=7, read=None),
        tx(2, "ok", (5, 6, 7, 8), 3, real(1.5)),
    ],
    "DS315@1#1 DS401@1#1",
    diagnoses="DS711@1#1 DS722@1#1",
)
def _(tape: Tape) -> None:
    """A cut request was over by the Release of its AR when the first shaped one came, which displaces nothing."""
    client = Client(tape)
    client.write(CUT)
    release(client)
    client.exchange(ask(), tell(1, 1.5))


@case("P23-foreign", "P12 P23", "foreign lost", [])
def _(tape: Tape) -> None:
    """Index 47 of a device that is no drive: no transaction and no finding, lost calls included."""
    client = Client(tape)
    for data in (b"Hello, world", b"\0\0\0\x10calibration", b"\xff" * 8):
        client.write(data)
        client.read(data)
    client.poll(0xDE80B600)
    client.ask_write(b"again")


@case(
    "P14-index-of-the-user",
    "P14",
    "none",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5), index=0x1234)],
    options={"indices": [0x1234]},
)
def _(tape: Tape) -> None:
    """An index that the user names is ours."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5), at=client.at(index=0x1234))


# The Write


@case(
    "P25-refused-write",
    "P25 P40",
    "refused",
    [tx(1, "refused", (1, 2, None, None), None, NOTHING, write="DF80B700", read=None)],
    "DS203@2#1",
)
def _(tape: Tape) -> None:
    """A refused Write is a transaction of its own."""
    Client(tape).write(ask(), status=BAD_HEADER)


@case(
    "P26-refused-displaces-nothing",
    "P25 P26 P29 P40",
    "refused",
    [
        tx(1, "ok", (1, 2, 5, 6), 5, real(1.5)),
        tx(2, "refused", (3, 4, None, None), None, par(27), ref=2, write="DF80B500", read=None),
    ],
    "DS203@4#2",
    diagnoses="DS705@3#2",
)
def _(tape: Tape) -> None:
    """A second Write is refused while the first is open: the Read brings the first's response."""
    client = Client(tape)
    client.write(ask())
    client.write(ask(2, 27), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))


@case(
    "P27-superseded-read",
    "P27 P41",
    "superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS413@3#1",
    diagnoses="DS705@3#1",
)
def _(tape: Tape) -> None:
    """An accepted Write before the response of the first: reported on its request."""
    client = Client(tape)
    client.write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))


@case(
    "P27-superseded-changes",
    "P27 P41",
    "superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, real(10.0, pnu=1120),
           operation="change", read=None),
        tx(2, "superseded", (3, 4, None, None), None, real(11.0, pnu=1120),
           operation="change", ref=2, read=None),
        tx(3, "ok", (5, 6, 7, 8), 3, real(12.0, pnu=1120), operation="change", ref=3),
    ],
    "DS414@3#1 DS414@5#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """Three changes, only the response of the last is fetched."""
    client = Client(tape)
    client.write(put(1, 10.0))
    client.write(put(2, 11.0))
    client.exchange(put(3, 12.0), message.changed(3, 1))


@case(
    "P27-superseded-after-polls",
    "P27 P34 P40 P41",
    "superseded poll",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None, polls=[(3, 4), (5, 6)]),
        tx(2, "ok", (7, 8, 9, 10), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS413@7#1",
    diagnoses="DS705@7#1",
)
def _(tape: Tape) -> None:
    """A polled request is displaced: superseded, not refused, for a poll is no response."""
    client = Client(tape)
    client.write(ask())
    client.poll()
    client.poll()
    client.exchange(ask(2, 27), tell(2, 2.5))


@case(
    "P28-passed-over",
    "P28 P33",
    "lost poll orphan",
    [
        tx(1, "unanswered", (1, None, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (2, 3, 4, 5), 3, real(2.5, pnu=27), ref=2),
        tx(3, "orphan", (None, None, 8, 9), None, real(1.5, pnu=None), write=None),
    ],
    "DS101@1#1 DS206@7 DS401@1#1 DS403@9#3",
)
def _(tape: Tape) -> None:
    """A Read finds no request open: a record that comes after that is not the response to an older Write."""
    client = Client(tape)
    client.ask_write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.poll()
    client.read(tell(1, 1.5))


@case(
    "P70-unasked-write",
    "P31 P70",
    "lost orphan",
    [
        tx(1, "unanswered", (1, None, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (2, 3, 4, 5), 3, real(2.5, pnu=27), ref=2),
        tx(3, "orphan", (None, None, 7, 8), None, real(2.5, pnu=None), ref=2, write=None),
        tx(4, "orphan", (None, None, 9, 10), None, real(1.5, pnu=None), write=None),
    ],
    "DS101@1#1 DS102@6 DS401@1#1 DS403@8#3 DS403@10#4",
)
def _(tape: Tape) -> None:
    """A Write is accepted whose request is lost: the same record once more may be the response to that."""
    client = Client(tape)
    client.ask_write(ask())
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.accept_write(client.call(wire.WRITE), ask())
    client.read(tell(2, 2.5))
    client.read(tell(1, 1.5))


@case(
    "P70-unasked-refused",
    "P30 P70",
    "lost poll refused",
    [
        tx(
            1,
            "refused",
            (1, 2, None, None),
            None,
            NOTHING,
            write="DF80B700",
            read=None,
            polls=[(3, 4)],
        ),
        tx(2, "orphan", (None, None, 8, 9), None, real(1.5, pnu=None), write=None),
    ],
    "DS102@5 DS203@2#1 DS206@7 DS403@9#2",
)
def _(tape: Tape) -> None:
    """A Write is refused whose request is lost: no Read after it is for the refused Write before it."""
    client = Client(tape)
    client.write(ask(), BAD_HEADER)
    client.poll()
    client.accept_write(client.call(wire.WRITE), ask(), status=BAD_HEADER)
    client.poll()
    client.read(tell(1, 1.5))


@case(
    "P28-nothing-read",
    "P28 P36",
    "lost unanswered",
    [
        tx(1, "unanswered", (1, None, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (4, 5, 6, 7), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS101@1#1 DS207@3#1 DS401@1#1",
)
def _(tape: Tape) -> None:
    """A Read that brings nothing does not prove that the Write before it was accepted: it is not superseded."""
    client = Client(tape)
    client.ask_write(ask())
    client.read(b"")
    client.exchange(ask(2, 27), tell(2, 2.5))


@case(
    "P28-late-record",
    "P27 P28",
    "lost interleaved",
    [
        tx(1, "ok", (1, None, 4, 5), 4, real(1.5), write=None),
        tx(2, "ok", (2, 3, 6, 7), 5, real(2.5, pnu=27), ref=2),
    ],
    "DS101@1#1",
)
def _(tape: Tape) -> None:
    """The record of an older Write comes when a newer one was accepted already: it displaces nothing."""
    client = Client(tape)
    client.ask_write(ask())
    client.write(ask(2, 27))
    client.read(tell(1, 1.5))
    client.read(tell(2, 2.5))


@case(
    "P68-behind-a-refused-write",
    "P68",
    "lost refused unanswered",
    [
        tx(1, "refused", (1, 2, None, None), None, NOTHING, write="DF80B700", read=None),
        tx(2, "unanswered", (3, None, 4, None), None, par(27), ref=2, write=None, read=None),
    ],
    "DS101@3#2 DS101@4#2 DS203@2#1 DS401@3#2",
)
def _(tape: Tape) -> None:
    """The Read without a response comes after a Write without a response, and is not one of the refused Write."""
    client = Client(tape)
    client.write(ask(), BAD_HEADER)
    client.ask_write(ask(2, 27))
    client.ask_read()


@case(
    "P69-later",
    "P69",
    "lost unanswered",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "unanswered", (3, None, None, None), None, par(27), ref=2, write=None, read=None),
    ],
    "DS101@3#2 DS401@1#1 DS401@3#2",
)
def _(tape: Tape) -> None:
    """A Write without its response may have displaced the one before it."""
    client = Client(tape)
    client.write(ask())
    client.ask_write(ask(2, 27))


@case(
    "P28-write-response-lost",
    "P28",
    "lost",
    [tx(1, "ok", (1, None, 2, 3), 2, real(1.5), write=None)],
    "DS101@1#1",
)
def _(tape: Tape) -> None:
    """The Write response is not in the capture: the Read proves that the Write was accepted."""
    client = Client(tape)
    client.ask_write(ask())
    client.read(tell(1, 1.5))


@case(
    "P28-read-before-write-response",
    "P28 P29",
    "disorder",
    [tx(1, "ok", (1, 4, 2, 3), 2, real(1.5))],
    diagnoses="DS702@2#1",
)
def _(tape: Tape) -> None:
    """The Write response comes after the Read response: it still belongs to its transaction."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.read(tell(1, 1.5))
    client.accept_write(call, ask())


@case(
    "P28-two-asked-second-answered",
    "P28 P42",
    "lost",
    [
        tx(1, "unanswered", (1, None, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (2, None, 3, 4), 2, real(2.5, pnu=27), ref=2, write=None),
    ],
    "DS101@1#1 DS101@2#2 DS401@1#1",
)
def _(tape: Tape) -> None:
    """Two Writes without response, the Read brings the record of the second."""
    client = Client(tape)
    client.ask_write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(2, 2.5))


@case(
    "P28-two-asked-first-answered",
    "P28 P42",
    "lost",
    [
        tx(1, "ok", (1, None, 3, 4), 3, real(1.5), write=None),
        tx(2, "unanswered", (2, None, None, None), None, par(27), ref=2, write=None, read=None),
    ],
    "DS101@1#1 DS101@2#2 DS401@2#2",
)
def _(tape: Tape) -> None:
    """Two Writes without response, the Read brings the record of the first."""
    client = Client(tape)
    client.ask_write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(1, 1.5))


@case(
    "P68-lost-read-of-an-older-request",
    "P68",
    "lost",
    [
        tx(1, "ok", (1, 2, 4, 5), 4, real(1.5)),
        tx(2, "ok", (6, 7, 8, 9), 3, real(2.5, pnu=27), ref=2),
    ],
    "DS101@3#1",
)
def _(tape: Tape) -> None:
    """A Read never got its RPC response: it belongs to the request before it, though another is open later."""
    client = Client(tape)
    client.write(ask())
    client.ask_read()
    client.read(tell(1, 1.5))
    client.exchange(ask(2, 27), tell(2, 2.5))


@case(
    "P69-a-later-write-may-have-displaced-it",
    "P69",
    "lost",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "unanswered", (3, None, None, None), None, par(27), ref=2, write=None, read=None),
    ],
    "DS101@3#2 DS401@1#1 DS401@3#2",
)
def _(tape: Tape) -> None:
    """The channel goes on behind an open request, with a Write whose response is not in the capture."""
    client = Client(tape)
    client.write(ask())
    client.ask_write(ask(2, 27))


@case(
    "P28-presumed-displaces",
    "P27 P28 P41",
    "lost superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "ok", (3, None, 4, 5), 2, real(2.5, pnu=27), ref=2, write=None),
    ],
    "DS101@3#2 DS413@3#1",
    diagnoses="DS705@3#1",
)
def _(tape: Tape) -> None:
    """While one request is open the Read brings another's record, whose Write response is lost."""
    client = Client(tape)
    client.write(ask())
    client.ask_write(ask(2, 27))
    client.read(tell(2, 2.5))


@case(
    "P28-passed",
    "P28",
    "lost poll",
    [
        tx(1, "unanswered", (1, None, None, None), None, real(1.0, pnu=1120), write=None, read=None,
           operation="change"),
        tx(2, "ok", (2, 3, 4, 5), 3, real(2.5, pnu=27), ref=2),
        tx(3, "ok", (8, 9, 10, 11), 3, real(1.5), ref=3),
    ],
    "DS101@1#1 DS206@7 DS402@1#1",
)  # fmt: skip
def _(tape: Tape) -> None:
    """A Write without its response, then an accepted one: no later Read is that of the first."""
    client = Client(tape)
    client.ask_write(put(1, 1.0))
    client.exchange(ask(2, 27), tell(2, 2.5))
    client.poll()
    client.exchange(ask(3), tell(3, 1.5))


# The Read


@case(
    "P30-read-after-refused",
    "P30 P40",
    "refused",
    [tx(1, "refused", (1, 2, 3, 4), 3, real(1.5), write="DF80B500")],
    "DS203@2#1",
    diagnoses="DS705@1#1",
)
def _(tape: Tape) -> None:
    """Without an open request a Read belongs to the refused Write; the state stays refused."""
    client = Client(tape)
    client.write(ask(), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))


@case(
    "P30-latest-refused",
    "P30 P40",
    "refused",
    [
        tx(1, "refused", (1, 2, None, None), None, NOTHING, write="DF80B500", read=None),
        tx(2, "refused", (3, 4, 5, 6), 3, real(2.5, pnu=27), ref=2, write="DF80B500"),
    ],
    "DS203@2#1 DS203@4#2",
    diagnoses="DS705@1#1 DS705@3#2",
)
def _(tape: Tape) -> None:
    """Two refused Writes: the Read belongs to the latest."""
    client = Client(tape)
    client.write(ask(), status=NOT_POSSIBLE)
    client.write(ask(2, 27), status=NOT_POSSIBLE)
    client.read(tell(2, 2.5))


@case(
    "P30-before-reread",
    "P30 P31",
    "refused",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "refused", (5, 6, 7, 8), 3, real(1.5), write="DF80B500"),
    ],
    "DS415@5#2 DS203@6#2",
    diagnoses="DS705@5#2 DS704@8#2",
)
def _(tape: Tape) -> None:
    """The refused Write comes before the last response, even where the bytes are the same."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    client.write(ask(), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))


@case(
    "P30-read-since",
    "P30 P31 P26",
    "refused reread",
    [
        tx(1, "ok", (1, 2, 5, 6), 5, real(1.5), rereads=[(7, 8)]),
        tx(2, "refused", (3, 4, None, None), None, par(27), ref=2, write="DF80B500", read=None),
    ],
    "DS203@4#2",
    diagnoses="DS705@3#2 DS704@8#1",
)
def _(tape: Tape) -> None:
    """Something was read since the refused Write: the next Read is not its own."""
    client = Client(tape)
    client.write(ask())
    client.write(ask(2, 27), status=NOT_POSSIBLE)
    client.read(tell(1, 1.5))
    client.read(tell(1, 1.5))


@case(
    "P31-reread",
    "P31 P48",
    "reread",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5), rereads=[(5, 6), (7, 8)])],
    diagnoses="DS704@6#1",
)
def _(tape: Tape) -> None:
    """The same bytes read twice more: re-reads, and the duration is that of the first Read."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    client.read(tell(1, 1.5))
    client.read(tell(1, 1.5))


@case(
    "P54-read-after-600-s",
    "P32 P54",
    "orphan late-read",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "orphan", (None, None, 5, 6), None, real(1.5, pnu=None), write=None),
    ],
    "DS403@6#2",
)
def _(tape: Tape) -> None:
    """After 600 s without a call the channel is forgotten, its last response too: an orphan."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    tape.wait(601_000)
    client.read(tell(1, 1.5))


@case(
    "P32-other-bytes",
    "P31 P32 P39",
    "orphan",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "orphan", (None, None, 5, 6), None, real(2.5, pnu=None), write=None),
    ],
    "DS403@6#2",
)
def _(tape: Tape) -> None:
    """Another Read with other bytes than the last response: an orphan."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    client.read(tell(1, 2.5))


@case(
    "P32-starts-late",
    "P32 P39 P48",
    "starts-late orphan",
    [tx(1, "orphan", (None, None, 2, 3), None, real(1.5, pnu=None), write=None, index=0xB02F)],
    "DS102@1 DS403@3#1",
)
def _(tape: Tape) -> None:
    """The capture starts after the Write request."""
    client = Client(tape)
    client.channel = client.at(index=0xB02F)
    tape.deaf = True
    call = client.ask_write(ask())
    tape.deaf = False
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case("P33-empty-body-nothing-asked", "P33 P53", "nothing-to-read malformed", [], "DS108@2")
def _(tape: Tape) -> None:
    """A Read on a channel without a request, whose response has no body: that is the cause, and said once."""
    client = Client(tape)
    client.channel = client.at(index=0xB02F)
    client.reply(client.ask_read(), b"")


@case("P33-nothing-to-read", "P33", "nothing-to-read", [], "DS206@2 DS206@4 DS206@6")
def _(tape: Tape) -> None:
    """Reads without data on a channel without a request: busy, refused, and positive."""
    client = Client(tape)
    client.channel = client.at(index=0xB02F)
    client.poll(BUSY)
    client.poll(0xDE80B000, with_header=False)
    client.read(b"")


@case(
    "P34-polls",
    "P34 P48",
    "poll",
    [tx(1, "ok", (1, 2, 7, 8), 27, real(1.5), polls=[(3, 4), (5, 6)])],
)
def _(tape: Tape) -> None:
    """DE80B500 twice, then the record; the duration runs to the record."""
    Client(tape).exchange(ask(), tell(1, 1.5), polls=2)


@case(
    "P34-polls-then-end",
    "P34 P38 P40 P42",
    "poll",
    [tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None, polls=[(3, 4)])],
    "DS401@1#1",
)
def _(tape: Tape) -> None:
    """Only polls until the end of the capture: unanswered, not refused."""
    client = Client(tape)
    client.write(ask())
    client.poll()


@case(
    "P35-read-refused",
    "P32 P35 P40",
    "read-refused orphan",
    [
        tx(1, "refused", (1, 2, 3, 4), None, NOTHING, read="DE80B600"),
        tx(2, "orphan", (None, None, 5, 6), None, real(1.5, pnu=None), write=None),
    ],
    "DS201@4#1 DS403@6#2",
)
def _(tape: Tape) -> None:
    """Any other negative status ends the transaction: a record that comes later is an orphan."""
    client = Client(tape)
    client.write(ask())
    client.poll(0xDE80B600)
    client.read(tell(1, 1.5))


@case(
    "P36-empty-read",
    "P36",
    "empty-read",
    [tx(1, "ok", (1, 2, 5, 6), 5, real(1.5))],
    "DS207@4#1",
)
def _(tape: Tape) -> None:
    """A positive Read without data: a finding, and the transaction stays open."""
    client = Client(tape)
    client.write(ask())
    client.read(b"")
    client.read(tell(1, 1.5))


@case(
    "P38-end",
    "P38 P42",
    "unanswered",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "unanswered", (3, 4, None, None), None, real(10.0, pnu=1120),
           operation="change", ref=2, read=None, slot=2),
    ],
    "DS401@1#1 DS402@3#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """A read and a change that nobody fetches until the capture ends."""
    client = Client(tape)
    client.write(ask())
    client.write(put(2, 10.0), at=client.at(slot=2))


@case(
    "P38-release",
    "P38 P42 P32",
    "release orphan",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "orphan", (None, None, 5, 6), None, real(1.5, pnu=None), write=None),
    ],
    "DS401@1#1 DS403@6#2",
    diagnoses="DS722@1#1",
)
def _(tape: Tape) -> None:
    """The AR is released: what was open stays unanswered, a later Read finds nothing."""
    client = Client(tape)
    client.write(ask())
    release(client)
    client.read(tell(1, 1.5))


@case(
    "P38-release-of-another-ar",
    "P14 P38",
    "release interleaved",
    [
        tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
        tx(2, "unanswered", (3, 4, None, None), None, NOTHING, read=None, **HOME2),
    ],
    "DS401@3#2",
    diagnoses="DS722@3#2",
)
def _(tape: Tape) -> None:
    """The release of one AR leaves the other alone."""
    first, other = Client(tape), second(tape)
    first.write(ask())
    other.write(ask())
    release(other)
    first.read(tell(1, 1.5))


@case(
    "P38-release-by-another-controller",
    "P14 P38",
    "release interleaved",
    [
        tx(1, "ok", (1, 2, 7, 8), 7, real(1.5)),
        tx(2, "unanswered", (3, 4, None, None), None, NOTHING,
           read=None, controller="192.168.133.3"),
    ],
    "DS401@3#2",
    diagnoses="DS722@3#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """An AR with the same UUID between another controller and the drive is another AR."""
    first, other = Client(tape), second(tape, channel=wire.Channel(AR))
    first.write(ask())
    other.write(ask())
    release(other)
    first.read(tell(1, 1.5))


@case(
    "P38-expiry",
    "P32 P38 P42",
    "expiry orphan",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "orphan", (None, None, 3, 4), None, real(1.5, pnu=None), write=None),
    ],
    "DS401@1#1 DS403@4#2",
)
def _(tape: Tape) -> None:
    """A Read 601 s after the Write comes too late."""
    client = Client(tape)
    client.write(ask())
    tape.wait(601_000)
    client.read(tell(1, 1.5))


@case(
    "P38-not-expired",
    "P29 P38",
    "late-read",
    [tx(1, "ok", (1, 2, 3, 4), 599_003, real(1.5))],
)
def _(tape: Tape) -> None:
    """A Read 599 s after the Write is in time."""
    client = Client(tape)
    client.write(ask())
    tape.wait(599_000)
    client.read(tell(1, 1.5))


# States


@case(
    "P40-refused-after-the-read",
    "P28 P40",
    "disorder refused",
    [tx(1, "refused", (1, 4, 2, 3), 2, real(1.5), write="DF80B500")],
    "DS203@4#1",
    diagnoses="DS705@1#1",
)
def _(tape: Tape) -> None:
    """A negative Write response after the Read that brought the record: refused, and it is said."""
    client = Client(tape)
    call = client.ask_write(ask())
    client.read(tell(1, 1.5))
    client.accept_write(call, ask(), status=NOT_POSSIBLE)


MISMATCHES: tuple[tuple[str, str, bytes, bytes, tuple[Row, ...], str], ...] = (
    ("reference", "The reference is not mirrored", ask(), tell(2, 1.5),
     (real(1.5, pnu=None),), "DS404@4#1"),
    ("axis", "The axis is not mirrored", ask(), tell(1, 1.5, axis=2),
     (real(1.5, pnu=None),), "DS406@4#1"),
    ("id", "A read is answered as a change", ask(), message.changed(1, 1), (), "DS405@4#1"),
    ("blocks", "One parameter asked for, two value blocks answered", ask(), tell(1, 1.5, 2.5),
     (real(1.5, pnu=None), real(2.5, pnu=None)), "DS407@4#1"),
)  # fmt: skip
"""(name, comment, request, response, parameters, findings)."""


def _mismatch(row: tuple[str, str, bytes, bytes, tuple[Row, ...], str]) -> None:
    name, comment, request, response, parameters, findings = row

    def play(tape: Tape) -> None:
        Client(tape).exchange(request, response)

    play.__doc__ = f"{comment}: the values are kept without a parameter number."
    expect = tx(1, "mismatch", (1, 2, 3, 4), 3, *parameters)
    case(f"P43-mismatch-{name}", "P43", "mismatch", [expect], findings)(play)


for _row in MISMATCHES:
    _mismatch(_row)


@case(
    "P43-no-history",
    "P43",
    "mismatch",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change"),
        tx(2, "mismatch", (5, 6, 7, 8), 3, real(9.5, pnu=None), ref=2),
        tx(3, "ok", (9, 10, 11, 12), 3, real(10.0, pnu=1120), ref=3),
    ],
    "DS404@8#2",
)
def _(tape: Tape) -> None:
    """The value of a mismatch is not compared with what was written (no DS417)."""
    client = Client(tape)
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.exchange(ask(2, 1120), tell(1, 9.5))
    client.exchange(ask(3, 1120), tell(3, 10.0))


@case(
    "P43-count-without-blocks",
    "P43 P46",
    "count",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change")],
    "DS407@4#1",
)
def _(tape: Tape) -> None:
    """A change answered with count 2 but no value block: a finding, no mismatch."""
    Client(tape).exchange(put(1, 10.0), message.changed(1, 1, count=2))


@case(
    "P44-all-failed",
    "P44",
    "drive-error",
    [
        tx(1, "error", (1, 2, 3, 4), 3, par(21, error=(0, 0)), par(27, error=(0x6B, 3))),
    ],
    "DS410@4#1 DS410@4#1",
    diagnoses="DS719@4#1",
)
def _(tape: Tape) -> None:
    """Both parameters failed."""
    answer = message.answer(1, 0x81, 1, message.error(0), message.error(0x6B, 3))
    Client(tape).exchange(ask(1, 21, 27), answer)


@case(
    "P44-not-supported",
    "P44",
    "drive-error",
    [tx(1, "error", (1, 2, 3, 4), 3, par(21, error=(0x21, 0)))],
    "DS410@4#1 DS418@4#1",
)
def _(tape: Tape) -> None:
    """Response id 0x80 is of every family: an error, not a mismatch."""
    Client(tape).exchange(ask(), message.answer(1, 0x80, 1, message.error(0x21)))


@case(
    "P44-not-supported-in-part",
    "P44",
    "drive-error",
    [tx(1, "error", (1, 2, 3, 4), 3, real(1.5), par(27, error=(0x21, 0)))],
    "DS410@4#1 DS418@4#1",
)
def _(tape: Tape) -> None:
    """Response id 0x80 is an error, whatever its blocks say."""
    answer = message.answer(1, 0x80, 1, message.real(1.5), message.error(0x21))
    Client(tape).exchange(ask(1, 21, 27), answer)


@case(
    "P45-partial-read",
    "P37 P45",
    "drive-error",
    [tx(1, "partial", (1, 2, 3, 4), 3, par(21, error=(0, 0)), real(2.5, pnu=27))],
    "DS410@4#1",
    diagnoses="DS701@4#1",
)
def _(tape: Tape) -> None:
    """The first of two parameters failed."""
    answer = message.answer(1, 0x81, 1, message.error(0), message.real(2.5))
    Client(tape).exchange(ask(1, 21, 27), answer)


@case(
    "P45-partial-change",
    "P37 P45",
    "drive-error",
    [
        tx(1, "partial", (1, 2, 3, 4), 3, real(10.0, pnu=1120),
           par(1121, "Float32", 5.0, error=(0x6B, 0)), operation="change"),
    ],
    "DS410@4#1",
    diagnoses="DS719@4#1",
)  # fmt: skip
def _(tape: Tape) -> None:
    """The second of two changes failed: it keeps the value that was written."""
    request = message.change(
        1,
        1,
        (message.address(1120), message.real(10.0)),
        (message.address(1121), message.real(5.0)),
    )
    Client(tape).exchange(request, message.answer(1, 0x82, 1, message.done(), message.error(0x6B)))


@case(
    "P47-dropped",
    "P47",
    "dropped orphan unanswered",
    [
        tx(1, "unanswered", (1, 2, None, None), None, NOTHING, read=None),
        tx(2, "unanswered", (3, 4, None, None), None, real(10.0, pnu=1120),
           operation="change", ref=2, read=None, slot=2),
        tx(3, "orphan", (None, None, 5, 6), None, real(1.5, pnu=None), write=None, slot=3),
    ],
    "DS401@1#1 DS402@3#2 DS403@6#3",
    dropped=12,
)  # fmt: skip
def _(tape: Tape) -> None:
    """The capture says that it lost 12 frames: unanswered and orphan transactions say so."""
    client = Client(tape)
    client.write(ask())
    client.write(put(2, 10.0), at=client.at(slot=2))
    client.read(tell(1, 1.5), at=client.at(slot=3))


@case(
    "P49-by-first-frame",
    "P49",
    "interleaved orphan",
    [
        tx(1, "orphan", (None, None, 1, 6), None, real(9.5, pnu=None), ref=7, write=None),
        tx(2, "ok", (2, 3, 4, 5), 3, real(1.5), slot=2),
    ],
    "DS403@6#1",
)
def _(tape: Tape) -> None:
    """A Read that began first and ended last has the lower id."""
    client = Client(tape)
    other = replace(client, activity=UUID(int=0x48), channel=client.at(slot=2))
    call = client.ask_read()
    other.exchange(ask(), tell(1, 1.5))
    client.accept_read(call, tell(7, 9.5))


# A case for each rule that no sentence above needs: transport, time and values


FAULT_CODE = bytes.fromhex("0300011c")
"""nca_s_unknown_interface, as a little-endian PDU writes it."""


@case(
    "P25-rpc-fault",
    "P12 P25 P40 P53",
    "fault refused",
    [
        tx(1, "refused", (1, 2, None, None), None, NOTHING, write=None, read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, real(1.5), ref=2),
    ],
    "DS104@2#1",
)
def _(tape: Tape) -> None:
    """The drive answers the Write with an RPC fault: refused, though no status says so."""
    client = Client(tape)
    client.reply(client.ask_write(ask()), FAULT_CODE, wire.FAULT)
    client.exchange(ask(2), tell(2, 1.5))


@case(
    "P29-rpc-reject",
    "P12 P29 P53",
    "fault",
    [tx(1, "ok", (1, 2, 5, 6), 5, real(1.5))],
    "DS104@4#1",
)
def _(tape: Tape) -> None:
    """The drive rejects the first Read on the RPC level: the next one brings the response."""
    client = Client(tape)
    client.write(ask())
    client.reply(client.ask_read(), FAULT_CODE, wire.REJECT)
    client.read(tell(1, 1.5))


@case(
    "P3-fragment-lost",
    "P3 P11 P12 P29 P48",
    "fragments lost",
    [tx(1, "ok", (2, 4, 9, 11), 10, real(1.5))],
    "DS105@7#1",
)
def _(tape: Tape) -> None:
    """The last fragment of the Read response is lost, and the record is read again: it is there in part."""
    client = Client(tape, fragment=60)
    client.write(ask())
    client.read(tell(1, 1.5))
    del tape.steps[-1]
    client.read(tell(1, 1.5))


@case(
    "P3-first-fragment-lost",
    "P3 P11 P12 P29 P48",
    "fragments lost",
    [tx(1, "ok", (2, 4, 9, 11), 10, real(1.5))],
    "DS105@7#1",
)
def _(tape: Tape) -> None:
    """The first fragment of the Read response is lost: the last one says whose it is, by its RPC header."""
    client = Client(tape, fragment=60)
    client.write(ask())
    client.read(tell(1, 1.5))
    del tape.steps[-2]
    client.read(tell(1, 1.5))


@case(
    "P53-frame-cut",
    "P53 P67",
    "malformed",
    [tx(1, "ok", (1, 2, 3, 4), 3, real())],
    "DS106@4",
)
def _(tape: Tape) -> None:
    """The frame of the Read response lacks its last two bytes, half of the only value."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    tape.cut(2)


@case(
    "P53-pdu-longer-than-its-datagram",
    "P53",
    "malformed",
    [tx(1, "error", (1, 2, 3, 4), 3, real())],
    "DS202@4 DS315@4#1",
)
def _(tape: Tape) -> None:
    """The datagram of the Read response ends two bytes too early, and the frame is whole: nothing was cut."""
    client = Client(tape)
    client.exchange(ask(), tell(1, 1.5))
    tape.steps[-1]["bytes"] = tape.steps[-1]["bytes"][:-4]


@case(
    "P53-fragment-cut",
    "P3 P53",
    "fragments malformed",
    [tx(1, "ok", (2, 3, 4, 6), 4, real())],
    "DS106@5",
)
def _(tape: Tape) -> None:
    """The frame with the first of two fragments of the Read response is cut: that one is named."""
    client = Client(tape, fragment=92)
    client.write(ask())
    client.read(tell(1, 1.5))
    last = tape.steps.pop()
    tape.cut(2)
    tape.steps.append(last)


@case(
    "P11-request-in-part",
    "P3 P11 P32 P39",
    "fragments lost orphan",
    [tx(1, "orphan", (None, None, 3, 4), None, real(1.5, pnu=None), ref=1, write=None)],
    "DS105@1 DS403@4#1",
)
def _(tape: Tape) -> None:
    """The last fragment of the Write request is lost: its response is not without a request in the capture."""
    client = Client(tape, fragment=60)
    call = client.ask_write(ask())
    del tape.steps[-1]
    client.fragment = None
    client.accept_write(call, ask())
    client.read(tell(1, 1.5))


@case(
    "P53-record-length",
    "P53",
    "malformed",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5))],
    "DS202@4",
)
def _(tape: Tape) -> None:
    """The header of the record says 12 bytes, 10 are there, and the frame is whole."""
    client = Client(tape)
    client.write(ask())
    client.accept_read(client.ask_read(), tell(1, 1.5), stated=12)


@case(
    "P53-empty-body",
    "P12 P29 P53",
    "malformed",
    [tx(1, "ok", (1, 2, 5, 6), 5, real(1.5))],
    "DS108@4#1",
)
def _(tape: Tape) -> None:
    """The response to the first Read has no body at all; the second one brings the record."""
    client = Client(tape)
    client.write(ask())
    client.reply(client.ask_read(), b"")
    client.read(tell(1, 1.5))


def polled(count: int) -> list[tuple[int, int]]:
    """So many polls right behind a Write: frames 3 and 4, 5 and 6, ..."""
    return [(3 + 2 * n, 4 + 2 * n) for n in range(count)]


def play_polls(tape: Tape, count: int) -> None:
    """A read whose response is there after so many polls."""
    client = Client(tape)
    client.write(ask())
    for _ in range(count):
        client.poll()
    client.read(tell(1, 1.5))


@case(
    "P34-nine-polls",
    "P34",
    "poll",
    [tx(1, "ok", (1, 2, 21, 22), 21, real(1.5), polls=polled(9))],
)
def _(tape: Tape) -> None:
    """Nine polls are nothing to speak of."""
    play_polls(tape, 9)


@case(
    "P34-ten-polls",
    "P34",
    "poll",
    [tx(1, "ok", (1, 2, 23, 24), 23, real(1.5), polls=polled(10))],
    "DS204@24#1",
)
def _(tape: Tape) -> None:
    """Ten polls are worth a note."""
    play_polls(tape, 10)


@case(
    "P34-first-poll-half-lost",
    "P34 P48",
    "poll lost",
    [tx(1, "ok", (1, 2, 6, 7), 1507, real(1.5), polls=[(None, 3), (4, 5)])],
    "DS102@3 DS205@7#1",
)
def _(tape: Tape) -> None:
    """The request of the first Read is missing: how long the drive took of 1507 ms is not known."""
    client = Client(tape)
    client.write(ask())
    tape.deaf = True
    read = client.ask_read()
    tape.deaf = False
    client.refuse_read(read, BUSY)
    client.poll()
    tape.wait(1500)
    client.read(tell(1, 1.5))


@case(
    "P34-polled-1000-ms",
    "P34 P48",
    "poll slow",
    [tx(1, "ok", (1, 2, 5, 6), 1002, real(1.5), polls=[(3, 4)])],
    "DS416@6#1",
)
def _(tape: Tape) -> None:
    """Exactly 1000 ms from the first poll to the response: not too long, but the drive is slow."""
    client = Client(tape)
    client.write(ask())
    client.poll()
    tape.wait(997)
    client.read(tell(1, 1.5))


@case(
    "P34-polled-1001-ms",
    "P34 P48",
    "poll slow",
    [tx(1, "ok", (1, 2, 5, 6), 1003, real(1.5), polls=[(3, 4)])],
    "DS205@6#1 DS416@6#1",
)
def _(tape: Tape) -> None:
    """1001 ms from the first poll to the response."""
    client = Client(tape)
    client.write(ask())
    client.poll()
    tape.wait(998)
    client.read(tell(1, 1.5))


@case(
    "P29-lost-read-before-the-write",
    "P11 P29 P38",
    "lost unanswered",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(1.5)),
        tx(2, "unanswered", (6, 7, None, None), None, par(27), ref=2, read=None),
    ],
    "DS101@5 DS401@6#2",
)
def _(tape: Tape) -> None:
    """A Read without its RPC response came before the Write that is open when it is given up: not its Read."""
    client = Client(tape)
    client.exchange(ask(1), tell(1, 1.5))
    client.ask_read()
    client.write(ask(2, 27))


@case(
    "P35-old-response-after-refused-read",
    "P30 P35",
    "refused",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change"),
        tx(
            2,
            "refused",
            (5, 6, 7, 8),
            None,
            real(10.0, pnu=1120),
            operation="change",
            read="DE80B700",
        ),
        tx(
            3,
            "refused",
            (9, 10, 11, 12),
            3,
            real(10.0, pnu=1120),
            operation="change",
            write="DF80B700",
        ),
    ],
    "DS201@8#2 DS203@10#3 DS415@5#2 DS415@9#3",
)
def _(tape: Tape) -> None:
    """The Read of an accepted change is refused: a later response may be its, and is not called an old one."""
    client = Client(tape)
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.write(put(1, 10.0))
    client.poll(0xDE80B700)
    client.write(put(1, 10.0), BAD_HEADER)
    client.read(message.changed(1, 1))


@case(
    "P37-fewer-values",
    "P37 P46",
    "values",
    [tx(1, "ok", (1, 2, 3, 4), 3, par(27, "Unsigned16", 7, 8, subindex=3))],
    "DS408@4#1",
)
def _(tape: Tape) -> None:
    """Four elements asked for, two answered."""
    request = message.read(1, 1, message.address(27, 3, 4))
    Client(tape).exchange(request, message.answer(1, 1, 1, message.word(7, 8)))


@case(
    "P37-zero-asked-none-answered",
    "P37 P46",
    "values",
    [tx(1, "ok", (1, 2, 3, 4), 3, real())],
    "DS408@4#1",
)
def _(tape: Tape) -> None:
    """Number of elements 0 asks for one value, as 1 does; the block has none."""
    request = message.read(1, 1, message.address(21, elements=0))
    Client(tape).exchange(request, message.answer(1, 1, 1, message.real()))


@case(
    "P37-more-values",
    "P37 P46",
    "values",
    [tx(1, "ok", (1, 2, 3, 4), 3, par(964, "Unsigned16", 42, 4711, 2))],
    "DS409@4#1",
)
def _(tape: Tape) -> None:
    """One element asked for, the whole array answered."""
    Client(tape).exchange(ask(1, 964), message.answer(1, 1, 1, message.word(42, 4711, 2)))


@case(
    "P45-positive-id",
    "P45",
    "drive-error malformed",
    [tx(1, "partial", (1, 2, 3, 4), 3, real(1.5), par(27, error=(0x11, 0)))],
    "DS410@4#1 DS411@4#1",
    diagnoses="DS719@4#1",
)
def _(tape: Tape) -> None:
    """One of two failed, and the response id says that none did."""
    answer = message.answer(1, 0x01, 1, message.real(1.5), message.error(0x11))
    Client(tape).exchange(ask(1, 21, 27), answer)


@case(
    "P46-change-header-cut",
    "P43 P44 P46",
    "malformed",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change")],
    "DS315@4#1",
)
def _(tape: Tape) -> None:
    """The positive response id says that the change was done; the number of parameters is missing."""
    Client(tape).exchange(put(1, 10.0), message.changed(1, 1)[:3])


@case(
    "P46-announced-block-missing",
    "P43 P44 P46",
    "malformed count",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5))],
    "DS315@4#1 DS407@4#1",
)
def _(tape: Tape) -> None:
    """Two blocks announced, the only one that was asked for is there: no parameter is missing."""
    answer = tell(1, 1.5)
    Client(tape).exchange(ask(), answer[:3] + bytes([2]) + answer[4:])


@case(
    "P44-negative-id",
    "P44",
    "malformed",
    [tx(1, "error", (1, 2, 3, 4), 3, real(1.5))],
    "DS412@4#1",
)
def _(tape: Tape) -> None:
    """No block holds an error, and the response id says that something failed."""
    Client(tape).exchange(ask(), tell(1, 1.5, identifier=0x81))


@case(
    "P44-negative-id-change",
    "P44",
    "malformed",
    [tx(1, "error", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change")],
    "DS412@4#1",
)
def _(tape: Tape) -> None:
    """The same of a change: done, says the block, and the response id says that something failed."""
    Client(tape).exchange(put(1, 10.0), message.answer(1, 0x82, 1, message.done()))


@case(
    "P44-response-cut",
    "P44",
    "malformed",
    [tx(1, "error", (1, 2, 3, 4), 3, real())],
    "DS315@4#1",
)
def _(tape: Tape) -> None:
    """The device sent half of the only value."""
    Client(tape).exchange(ask(), tell(1, 1.5)[:-2])


@case(
    "P45-response-cut",
    "P45",
    "malformed",
    [tx(1, "partial", (1, 2, 3, 4), 3, real(1.5), par(27, "Float32"))],
    "DS315@4#1",
)
def _(tape: Tape) -> None:
    """The device sent the first of two values, and half of the second."""
    Client(tape).exchange(ask(1, 21, 27), tell(1, 1.5, 2.5)[:-2])


@case(
    "P67-negative-frame-cut",
    "P67",
    "malformed",
    [tx(1, "partial", (1, 2, 3, 4), 3, real(1.5), par(27, "Float32"))],
    "DS106@4",
)
def _(tape: Tape) -> None:
    """One value was captured, the other half; the response id says that something failed."""
    client = Client(tape)
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5, identifier=0x81))
    tape.cut(2)


@case(
    "P67-blocks-not-captured",
    "P67",
    "malformed",
    [tx(1, "ok", (1, 2, 3, 4), 3, real(1.5), par(27))],
    "DS106@4",
)
def _(tape: Tape) -> None:
    """The capture lacks the second block, and the response id says that nothing failed."""
    client = Client(tape)
    client.exchange(ask(1, 21, 27), tell(1, 1.5, 2.5))
    tape.cut(6)


@case(
    "P46-read-back",
    "P46",
    "values",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, real(10.0, pnu=1120), operation="change"),
        tx(2, "ok", (5, 6, 7, 8), 3, real(10.0, pnu=1120), ref=2),
        tx(3, "ok", (9, 10, 11, 12), 3, real(11.0, pnu=1120), ref=3),
    ],
    "DS417@12#3",
)
def _(tape: Tape) -> None:
    """What was written is read back, first as it was written, then another value."""
    client = Client(tape)
    client.exchange(put(1, 10.0), message.changed(1, 1))
    client.exchange(ask(2, 1120), tell(2, 10.0))
    client.exchange(ask(3, 1120), tell(3, 11.0))


@case(
    "P46-message-long",
    "P46",
    "values",
    [
        tx(1, "ok", (1, 2, 3, 4), 3, par(974, "Unsigned16", 16)),
        tx(2, "ok", (5, 6, 7, 8), 3, real(1.5), real(2.5, pnu=27), ref=2),
        tx(
            3,
            "ok",
            (9, 10, 11, 12),
            3,
            real(1.5),
            real(2.5, pnu=27),
            real(3.5, pnu=25),
            ref=3,
        ),
    ],
    "DS316@9#3",
)
def _(tape: Tape) -> None:
    """The drive says that it takes 16 bytes: a request of 16 is no finding, one of 22 is."""
    client = Client(tape)
    client.exchange(ask(1, 974), message.answer(1, 1, 1, message.word(16)))
    client.exchange(ask(2, 21, 27), tell(2, 1.5, 2.5))
    client.exchange(ask(3, 21, 27, 25), tell(3, 1.5, 2.5, 3.5))


MANY = range(100, 140)
"""Parameters: one more than the usual number."""


@case(
    "P46-as-many-parameters-as-the-drive-takes",
    "P46",
    "values",
    [tx(1, "ok", (1, 2, 3, 4), 3, *(real(pnu / 2, pnu=pnu) for pnu in MANY))],
)
def _(tape: Tape) -> None:
    """40 parameters of which the drive gives all: not too many, and not called so while the response is due."""
    Client(tape).exchange(ask(1, *MANY), tell(1, *(pnu / 2 for pnu in MANY)))


# Which parameter is meant


LOCAL = 0xB02E
RAMP = 1120


def ramp(value: float) -> Row:
    return real(value, pnu=RAMP)


def changed(value: float, reference: int, axis: int = 1, pnu: int = RAMP) -> tuple[bytes, bytes]:
    """A change of a Float32 and its response."""
    asked = message.change(reference, axis, (message.address(pnu), message.real(value)))
    return asked, message.changed(reference, axis)


def fetched(value: float, reference: int, axis: int = 1, pnu: int = RAMP) -> tuple[bytes, bytes]:
    """A read of a Float32 and its response."""
    return ask(reference, pnu, axis=axis), tell(reference, value, axis=axis)


def four(number: int) -> tuple[int, int, int, int]:
    """The frames of the n-th transaction where each has four."""
    return (4 * number - 3, 4 * number - 2, 4 * number - 1, 4 * number)


def row(number: int, *parameters: Row, state: str = "ok", **more: Any) -> Row:
    """The n-th transaction of four frames; its reference is its number."""
    return tx(number, state, four(number), 3, *parameters, ref=number, **more)


@case(
    "P60-the-submodule-decides",
    "P60",
    "values",
    [
        row(1, ramp(10.0), operation="change", axis=9, index=LOCAL, slot=2),
        row(2, ramp(9.5), axis=0, index=LOCAL, slot=2),
        row(3, ramp(10.0), operation="change", axis=2, index=LOCAL, slot=2),
        row(4, ramp(9.5), axis=2, index=LOCAL),
    ],
    "DS417@8#2",
)
def _(tape: Tape) -> None:
    """Local access: the axis byte does not count, the slot does."""
    client = Client(tape)
    here, there = client.at(index=LOCAL), client.at(index=LOCAL, slot=2)
    client.exchange(*changed(10.0, 1, axis=9), at=there)
    client.exchange(*fetched(9.5, 2, axis=0), at=there)
    client.exchange(*changed(10.0, 3, axis=2), at=there)
    client.exchange(*fetched(9.5, 4, axis=2), at=here)


@case(
    "P60-two-ways-to-one-parameter",
    "P60",
    "values",
    [
        row(1, ramp(10.0), operation="change"),
        row(2, ramp(9.5), operation="change", index=LOCAL, slot=2),
        row(3, ramp(9.5)),
    ],
)
def _(tape: Tape) -> None:
    """Local access may have reached the same drive object: the value that was written last is not known."""
    client = Client(tape)
    client.exchange(*changed(10.0, 1))
    client.exchange(*changed(9.5, 2), at=client.at(index=LOCAL, slot=2))
    client.exchange(*fetched(9.5, 3))


@case(
    "P61-a-submodule-names-itself",
    "P61",
    "values drive-error",
    [
        row(1, par(RAMP, error=(0x19, 0)), state="error", axis=77),
        row(2, par(975, "Unsigned16", 3, subindex=7), axis=0, index=LOCAL, slot=2),
        row(3, ramp(10.0), operation="change", axis=3),
        row(4, ramp(9.5), axis=9, index=LOCAL, slot=2),
    ],
    "DS410@4#1 DS417@16#4",
    diagnoses="DS709@4#1",
)
def _(tape: Tape) -> None:
    """PNU 975[7] of a submodule is its DO-ID: what was written to that drive object is read back there."""
    client = Client(tape)
    there = client.at(index=LOCAL, slot=2)
    client.exchange(ask(1, RAMP, axis=77), message.answer(1, 0x81, 77, message.error(0x19)))
    asked = message.read(2, 0, message.address(975, 7))
    client.exchange(asked, message.answer(2, 1, 0, message.word(3)), at=there)
    client.exchange(*changed(10.0, 3, axis=3))
    client.exchange(*fetched(9.5, 4, axis=9), at=there)


@case(
    "P62-two-axes",
    "P62",
    "values drive-error",
    [
        row(1, ramp(10.0), operation="change", axis=2),
        row(2, ramp(9.5), operation="change", axis=3),
        row(3, ramp(9.5), axis=2),
        row(4, par(RAMP, error=(0x19, 0)), state="error", axis=77),
        row(5, ramp(10.0), operation="change", axis=2),
        row(6, ramp(9.5), operation="change", axis=3),
        row(7, ramp(9.5), axis=2),
    ],
    "DS410@16#4 DS417@28#7",
    diagnoses="DS709@16#4",
)
def _(tape: Tape) -> None:
    """Two axis numbers may be one drive object until the device has refused a third."""
    client = Client(tape)
    client.exchange(*changed(10.0, 1, axis=2))
    client.exchange(*changed(9.5, 2, axis=3))
    client.exchange(*fetched(9.5, 3, axis=2))
    client.exchange(ask(4, RAMP, axis=77), message.answer(4, 0x81, 77, message.error(0x19)))
    client.exchange(*changed(10.0, 5, axis=2))
    client.exchange(*changed(9.5, 6, axis=3))
    client.exchange(*fetched(9.5, 7, axis=2))


@case(
    "P63-one-for-the-whole-device",
    "P63",
    "values",
    [
        row(1, real(10.0, pnu=61000), operation="change", axis=2),
        row(2, real(9.5, pnu=61000), axis=3, index=LOCAL, slot=2),
    ],
    "DS417@8#2",
)
def _(tape: Tape) -> None:
    """PNU 61000 is one parameter, whichever drive object is asked."""
    client = Client(tape)
    client.exchange(*changed(10.0, 1, axis=2, pnu=61000))
    client.exchange(*fetched(9.5, 2, axis=3, pnu=61000), at=client.at(index=LOCAL, slot=2))


@case(
    "P64-not-settled-yet",
    "P64",
    "values",
    [
        row(1, ramp(10.0), operation="change"),
        tx(2, "ok", (5, 6, 11, 12), 7, ramp(9.5), operation="change", ref=2, index=0xB02F),
        tx(3, "ok", (7, 8, 9, 10), 3, ramp(9.5), ref=3),
    ],
)
def _(tape: Tape) -> None:
    """A change that was accepted is in force perhaps, before its response is fetched."""
    client = Client(tape)
    asked, answer = changed(9.5, 2)
    other = client.at(index=0xB02F)
    client.exchange(*changed(10.0, 1))
    client.write(asked, at=other)
    client.exchange(*fetched(9.5, 3))
    client.read(answer, at=other)


@case(
    "P64-one-parameter-twice",
    "P44 P64",
    "values drive-error",
    [
        row(1, ramp(9.5), operation="change"),
        row(
            2,
            ramp(10.0),
            par(RAMP, "Float32", 8.0, error=(0x17, 0)),
            state="partial",
            operation="change",
        ),
        row(3, ramp(10.0)),
    ],
    "DS410@8#2",
    diagnoses="DS701@8#2",
)
def _(tape: Tape) -> None:
    """A change writes a parameter twice, and the second time it is refused: the first value is in force."""
    client = Client(tape)
    where = message.address(RAMP)
    client.exchange(*changed(9.5, 1))
    asked = message.change(2, 1, (where, message.real(10.0)), (where, message.real(8.0)))
    client.exchange(asked, message.answer(2, 0x82, 1, message.done(), message.error(0x17)))
    client.exchange(*fetched(10.0, 3))


@case(
    "P64-change-without-its-request",
    "P32 P64",
    "values orphan",
    [
        row(1, ramp(10.0), operation="change"),
        tx(2, "orphan", (None, None, 5, 6), None, operation="change", ref=2, write=None, slot=2),
        tx(3, "ok", (7, 8, 9, 10), 3, ramp(9.5), ref=3),
    ],
    "DS403@6#2",
)
def _(tape: Tape) -> None:
    """The response to a change says that something was written, and its request is not there: it may be any."""
    client = Client(tape)
    client.exchange(*changed(10.0, 1))
    client.read(message.changed(2, 1), at=client.at(slot=2))
    client.exchange(*fetched(9.5, 3))


@case(
    "P64-response-not-fetched",
    "P64",
    "values superseded",
    [
        row(1, ramp(10.0), operation="change"),
        tx(2, "superseded", (5, 6, None, None), None, ramp(9.5), operation="change", ref=2, read=None,
           index=0xB02F),
        tx(3, "ok", (7, 8, 9, 10), 3, real(1.5), ref=3, index=0xB02F),
        tx(4, "ok", (11, 12, 13, 14), 3, ramp(8.0), ref=4),
    ],
    "DS414@7#2",
)  # fmt: skip
def _(tape: Tape) -> None:
    """A change whose response nobody fetched makes the value unknown, on every channel."""
    client = Client(tape)
    other = client.at(index=0xB02F)
    client.exchange(*changed(10.0, 1))
    client.write(changed(9.5, 2)[0], at=other)
    client.exchange(ask(3), tell(3, 1.5), at=other)
    client.exchange(*fetched(8.0, 4))


@case(
    "P65-computed-anew",
    "P65",
    "values",
    [
        row(1, ramp(10.0), operation="change"),
        row(2, par(340, "Unsigned16", 1), operation="change"),
        row(3, ramp(9.5)),
    ],
)
def _(tape: Tape) -> None:
    """p0340 computes others: what was written before it is not known any more."""
    client = Client(tape)
    client.exchange(*changed(10.0, 1))
    asked = message.change(2, 1, (message.address(340), message.word(1)))
    client.exchange(asked, message.changed(2, 1))
    client.exchange(*fetched(9.5, 3))


@case(
    "P66-the-same-bits",
    "P66",
    "values",
    [
        row(1, par(2900, "Integer16", -32765), operation="change"),
        row(2, par(2900, "Unsigned16", 32771)),
        row(3, par(RAMP, "Unsigned32", 10), operation="change"),
        row(4, ramp(10.0)),
    ],
)
def _(tape: Tape) -> None:
    """-32765 and 32771 are the same 16 bits; 10 and 10.0 the same number."""
    client = Client(tape)
    where = message.address(2900)
    asked = message.change(1, 1, (where, message.block(0x03, "h", -32765)))
    client.exchange(asked, message.changed(1, 1))
    client.exchange(ask(2, 2900), message.answer(2, 1, 1, message.block(0x06, "H", 32771)))
    asked = message.change(3, 1, (message.address(RAMP), message.block(0x07, "I", 10)))
    client.exchange(asked, message.changed(3, 1))
    client.exchange(*fetched(10.0, 4))


@case(
    "P64-displaced-by-the-last-change",
    "P64",
    "values superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, ramp(9.5), operation="change", read=None),
        tx(2, "ok", (3, 4, 5, 6), 3, ramp(10.0), operation="change", ref=2),
        tx(3, "ok", (7, 8, 9, 10), 3, ramp(9.5), ref=3),
        tx(4, "ok", (11, 12, 13, 14), 3, ramp(10.0), operation="change", ref=4),
        tx(5, "ok", (15, 16, 17, 18), 3, ramp(9.5), ref=5),
    ],
    "DS414@3#1 DS417@18#5",
)
def _(tape: Tape) -> None:
    """A change may be in force until it is displaced, so perhaps after the one that displaced it; no longer."""
    client = Client(tape)
    client.write(changed(9.5, 1)[0])
    client.exchange(*changed(10.0, 2))
    client.exchange(*fetched(9.5, 3))
    client.exchange(*changed(10.0, 4))
    client.exchange(*fetched(9.5, 5))


@case(
    "P64-failed-in-part",
    "P64",
    "values drive-error",
    [
        row(1, ramp(10.0), par(1121, "Float32", 5.0, error=(0x6B, 0)), state="partial",
            operation="change"),
        row(2, ramp(9.5), real(4.0, pnu=1121)),
        row(3, par(RAMP, "Float32", 8.0, error=(0x6B, 0)), real(5.0, pnu=1121), state="error",
            operation="change"),
        row(4, ramp(7.0), real(4.0, pnu=1121)),
    ],
    "DS410@4#1 DS417@8#2 DS410@12#3 DS407@12#3",
    diagnoses="DS719@4#1 DS719@12#3",
)  # fmt: skip
def _(tape: Tape) -> None:
    """What did not fail is in force; a block that is not there says nothing."""
    client = Client(tape)
    both = message.address(RAMP), message.address(1121)
    asked = message.change(1, 1, (both[0], message.real(10.0)), (both[1], message.real(5.0)))
    client.exchange(asked, message.answer(1, 0x82, 1, message.done(), message.error(0x6B)))
    client.exchange(ask(2, RAMP, 1121), tell(2, 9.5, 4.0))
    asked = message.change(3, 1, (both[0], message.real(8.0)), (both[1], message.real(5.0)))
    client.exchange(asked, message.answer(3, 0x82, 1, message.error(0x6B)))
    client.exchange(ask(4, RAMP, 1121), tell(4, 7.0, 4.0))


@case(
    "P64-elements",
    "P64",
    "values",
    [
        row(1, par(2900, "Unsigned16", 1, 2, 3, subindex=4), operation="change"),
        row(2, par(2900, "Unsigned16", 9, subindex=5)),
        row(3, par(2900, "Unsigned16", 8, 3, subindex=5)),
        row(4, par(2900, "Unsigned16", 7, subindex=4)),
    ],
    "DS417@8#2 DS417@16#4",
)
def _(tape: Tape) -> None:
    """Each element is a parameter of its own; of what differs it is told once."""
    client = Client(tape)
    asked = message.change(1, 1, (message.address(2900, 4, 3), message.word(1, 2, 3)))
    client.exchange(asked, message.changed(1, 1))
    for number, first, values in ((2, 5, (9,)), (3, 5, (8, 3)), (4, 4, (7,))):
        asked = message.read(number, 1, message.address(2900, first, len(values)))
        client.exchange(asked, message.answer(number, 1, 1, message.word(*values)))


@case(
    "P65-displaced",
    "P65",
    "values superseded",
    [
        tx(1, "superseded", (1, 2, None, None), None, par(340, "Unsigned16", 1), operation="change",
           read=None, index=0xB02F),
        tx(2, "ok", (3, 4, 5, 6), 3, ramp(10.0), operation="change", ref=2),
        tx(3, "ok", (7, 8, 9, 10), 3, real(1.5), ref=3, index=0xB02F),
        tx(4, "ok", (11, 12, 13, 14), 3, ramp(9.5), ref=4),
        tx(5, "ok", (15, 16, 17, 18), 3, ramp(10.0), operation="change", ref=5),
        tx(6, "ok", (19, 20, 21, 22), 3, ramp(9.5), ref=6),
    ],
    "DS414@7#1 DS417@22#6",
)  # fmt: skip
def _(tape: Tape) -> None:
    """A change of p0340 whose response nobody fetched may have come until it was displaced."""
    client = Client(tape)
    other = client.at(index=0xB02F)
    asked = message.change(1, 1, (message.address(340), message.word(1)))
    client.write(asked, at=other)
    client.exchange(*changed(10.0, 2))
    client.exchange(ask(3), tell(3, 1.5), at=other)
    client.exchange(*fetched(9.5, 4))
    client.exchange(*changed(10.0, 5))
    client.exchange(*fetched(9.5, 6))


# The file


def rows(items: Sequence[Row]) -> str:
    """A list with one line per item."""
    if not items:
        return "[]"
    return "[\n    " + ",\n    ".join(dump(item) for item in items) + "\n   ]"


def dump(value: Any) -> str:
    """JSON on one line."""
    return json.dumps(value, ensure_ascii=False)


def render(one: Row) -> str:
    """A case: a line per field, step, transaction and finding."""
    lines = [f"  {dump(k)}: {dump(v)}" for k, v in one.items() if k not in ("steps", "expect")]
    lines.append(f'  "steps": {rows(one["steps"])}')
    expect = ",\n".join(f"   {dump(k)}: {rows(v)}" for k, v in one["expect"].items())
    return " {\n" + ",\n".join([*lines, '  "expect": {\n' + expect + "}"]) + "\n }"


def text(cases: list[Row] = CASES, about: str = ABOUT) -> str:
    """The whole file."""
    shown = ",\n".join(render(one) for one in cases)
    head = f'{{\n"$schema": "conversations.schema.json",\n"about": {dump(about)},\n'
    return f'{head}"count": {len(cases)},\n"cases": [\n{shown}\n]\n}}\n'


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    target.write_text(text(), "utf-8", newline="\n")
