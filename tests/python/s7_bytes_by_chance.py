"""Bytes of S7 by chance (seeded), and what the decoders say of them (docs/s7.md 2 and 3).

PDUs that are built here and broken, connections whose segments are cut anywhere, doubled, lost, late, out of
order and cut short by the capture, and questions whether what was read was there at one moment. The tests are
in test_s7_by_chance.py.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any

from ds47.s7 import pdu as pdus
from ds47.s7 import tcp, tpkt
from ds47.s7.consistency import ItemAccess, Question
from ds47.s7.model import At, End, S7Address, S7Item
from ds47.s7.tpkt import Tpdu, TpduReader
from ds47.spec import s7
from ds47.spec.words import Flaw

PDUS, TALKS, QUESTIONS = 3000, 120, 6000
PORTS = (102, 1102)
MOST, MOST_BYTES = 3, 150_000


# What the decoders say


def flaws(found: list[Flaw] | tuple[Flaw, ...]) -> list[dict[str, Any]]:
    return [{"kind": each.kind, "offset": each.offset, "args": each.args} for each in found]


def text(data: bytes | None) -> str | None:
    return None if data is None else data.hex()


def address(found: S7Address | None) -> dict[str, Any] | None:
    if found is None:
        return None
    names = ("area", "db", "start", "size", "count", "transport", "length")
    return {name: getattr(found, name) for name in names} | {"last": found.end}


def items(found: list[S7Item]) -> list[dict[str, Any]]:
    return [
        {
            "address": address(each.address),
            "value": text(each.value),
            "code": each.code,
            "syntax": each.syntax,
        }
        for each in found
    ]


def user_data(pdu: pdus.S7Pdu) -> dict[str, Any] | None:
    told = pdus.user_data(pdu)
    if told is None:
        return None
    part = pdus.segment(pdu, told)
    names = ("type", "group", "subfunction", "sequence", "unit", "last", "error", "code")
    return {name: getattr(told, name) for name in names} | {
        "content": told.content.hex(),
        "segment": part and part._asdict() | {"data": part.data.hex()},
    }


def document(data: bytes) -> dict[str, Any]:
    pdu = pdus.decode(data)
    names = ("kind", "reference", "error", "size", "head", "content_at")
    found: dict[str, Any] = {name: getattr(pdu, name) for name in names}
    setup = pdus.setup(pdu)
    found |= {name: getattr(pdu, name).hex() for name in ("data", "parameter", "content")}
    found |= {"service": pdu.function, "setup": setup and setup._asdict()}
    found["user_data"] = user_data(pdu)
    sent = pdus.usend(pdu)
    found["usend"] = sent and {"r_id": sent.r_id, "areas": [each.hex() for each in sent.areas]}
    found["flaws"] = flaws(pdu.flaws)
    return found


def job(request: bytes, answer: bytes) -> dict[str, Any]:
    asked, told = pdus.decode(request), pdus.decode(answer)
    found = pdus.variables(asked)
    each: dict[str, Any] = {"request": items(found.items), "groups": found.groups}
    values = pdus.results(told)
    each["results"] = [{"code": one.code, "data": text(one.data)} for one in values]
    each["answer_flaws"] = flaws(told.flaws)
    each["settled"], each["request_flaws"] = (
        flaws(pdus.settle(found.items, found.groups, values)),
        flaws(asked.flaws),
    )
    each["items"] = items(found.items)
    return each


def told_tpdu(tpdu: Tpdu) -> dict[str, Any]:
    return {
        "kind": tpdu.kind, "data": tpdu.data.hex(), "last": tpdu.last, "calling": text(tpdu.calling),
        "called": text(tpdu.called), "size": tpdu.size, "reason": tpdu.reason, "flaws": flaws(tpdu.flaws),
    }  # fmt: skip


class Ear:
    """Hears of the bytes of connections."""

    def __init__(self, most: int, most_bytes: int) -> None:
        self.told: list[dict[str, Any]] = []
        self.streams = tcp.Streams(frozenset(PORTS), self._take, self._over, most, most_bytes)

    def _tell(self, talk: tcp.Talk, **content: Any) -> None:
        ends = {"client": talk.client._asdict(), "server": talk.server._asdict()}
        self.told.append(ends | content)

    def _take(self, talk: tcp.Talk, from_client: bool, piece: tcp.TcpPiece) -> None:
        talk.owner = talk.owner or {True: TpduReader(), False: TpduReader()}
        own = talk.owner[from_client]
        wholes = [
            {
                "tpdu": told_tpdu(each.tpdu), "data": each.data.hex(), "frame": each.at.frame,
                "late": each.late,
            }
            for each in own.take(piece)
        ]  # fmt: skip
        talk.kept = talk.owner[True].held + talk.owner[False].held
        self._tell(
            talk, from_client=from_client, data=piece.data.hex(), frame=piece.at.frame, lost=piece.lost,
            late=piece.late, whole=wholes, lost_of_reader=own.lost, synced=own.synced, kept=talk.kept,
        )  # fmt: skip

    def _over(self, talk: tcp.Talk, reset: bool, at: At) -> None:
        self._tell(talk, over=at.frame, reset=reset)


def decoded(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    ear = Ear(MOST, MOST_BYTES)
    for line in lines:
        if line["kind"] == "pdu":
            data, answer = bytes.fromhex(line["data"]), bytes.fromhex(line["answer"])
            found.append({"pdu": document(data), "job": job(data, answer)})
        elif line["kind"] == "tpdu":
            found.append(told_tpdu(tpkt.decode(bytes.fromhex(line["data"]), 4)))
        elif line["kind"] == "question":
            found.append(answer_to(line))
        elif line["kind"] == "begin":
            ear = Ear(line["most"], line["most_bytes"])
        elif line["kind"] == "segment":
            payload = bytes.fromhex(line["payload"])
            segment = tcp.parse(line["source"], line["destination"], payload, line["missing"])
            if segment is not None:
                ear.streams.feed(segment, At(line["frame"], line["frame"]))
        else:
            ear.streams.finish()
            found += [*ear.told, {"held": ear.streams._held}]
    return found


# PDUs by chance


def pdu(kind: int, reference: int, parameter: bytes, data: bytes = b"", error: int = 0) -> bytes:
    """A PDU with its header."""
    head = struct.pack(">BBHHHH", 0x32, kind, 0, reference, len(parameter), len(data))
    return head + (struct.pack(">H", error) if kind in (2, 3) else b"") + parameter + data


def any_item(chance: random.Random) -> tuple[bytes, int]:
    """An address, and the bytes that it names."""
    if chance.random() < 0.2:
        areas = [
            (chance.randrange(1, 40), chance.randrange(9), chance.randrange(99)) for _ in range(3)
        ]
        areas = areas[: chance.randrange(4)]
        entries = b"".join(struct.pack(">BHH", *each) for each in areas)
        part = bytes((0xB0, len(areas))) + entries
        return bytes((0x12, len(part))) + part, sum(each[0] for each in areas)
    size = chance.choice((*s7.sizes(), *(2,) * 20, 0x21))
    area = chance.choice((*s7.areas(), *(0x84,) * 20, 0x40))
    count, start = chance.randrange(1, 30), chance.choice((chance.randrange(0x800), 0xFFFFF8))
    row = s7.sizes().get(size)
    part = struct.pack(">BBBBHHBBH", 0x12, 10, 0x10, size, count, chance.randrange(3), area, start >> 16,
                       start & 0xFFFF)  # fmt: skip
    return part, (count * (row.bits if row else 8) + 7) // 8


def entry(chance: random.Random, length: int, last: bool, code: int) -> bytes:
    """An entry of data with its fill byte; one that failed has a length that says nothing."""
    if code != 0xFF and chance.random() < 0.7:
        return bytes((code, 0, 0, chance.choice((0, 4))))
    transport = chance.choice((4, 4, 4, 3, 5, 6, 7, 9, 0, 0x22))
    counts = length * 8 if transport in (3, 4, 5) else length
    fill = b"\0" if length % 2 and not last else b""
    return bytes((code, transport)) + struct.pack(">H", counts) + chance.randbytes(length) + fill


def one_job(chance: random.Random) -> tuple[bytes, bytes]:
    """A read or a write with its answer."""
    reference = chance.choice((0, 1, 0x0100, 0xFFFF))
    found = [any_item(chance) for _ in range(chance.choice((0, 1, 1, 1, 2, 3, 20)))]
    lengths, write = [each[1] for each in found], chance.random() < 0.5
    parameter = bytes((5 if write else 4, len(found)))
    codes = [chance.choice((0xFF,) * 9 + (0x0A, 5)) for _ in found]
    data = b"".join(
        entry(chance, length, at == len(found) - 1, 0 if write else code)
        for at, (length, code) in enumerate(zip(lengths, codes, strict=True))
    )
    request = pdu(
        1, reference, parameter + b"".join(each[0] for each in found), data if write else b""
    )
    error = chance.choice((0,) * 9 + (0x8104, 0xD401, 0x8500, 0x1234))
    says = parameter if chance.random() < 0.9 else bytes((parameter[0], chance.randrange(5)))
    answer = pdu(
        chance.choice((3, 3, 3, 2)), reference, says, bytes(codes) if write else data, error
    )
    return request, answer


def other(chance: random.Random) -> tuple[bytes, bytes]:
    """A setup, a BSEND with its acknowledgement, a USEND, other user data."""
    reference = chance.randrange(5)
    setup = struct.pack(">BBHHH", 0xF0, 0, chance.randrange(9), 1, chance.choice((240, 480, 960)))
    first, last = chance.random() < 0.5, chance.random() < 0.5
    r_id = struct.pack(">I", chance.choice((0, 1, 0x12345678, 0xFFFFFFFF)))
    total = struct.pack(">H", chance.randrange(600)) if first else b""
    content = b"\x12\x06\x13\0" + r_id + total + chance.randbytes(chance.randrange(40))
    head = bytes((0, 1, 0x12, 8, 0x12, 0x46, 1, 0 if first else 3, 2, 0 if last else 1, 0, 0))
    bsend = pdu(7, reference, head, b"\xff\x09" + struct.pack(">H", len(content)) + content)
    taken = pdu(7, reference, b"\0\1\x12\x08\x12\x86\1\3\0\0" + chance.choice((b"\0\0", b"\x85\0")),
                b"\x0a\0\0\0")  # fmt: skip
    areas = [entry(chance, chance.randrange(12), False, 0) for _ in range(chance.randrange(1, 4))]
    usend = pdu(7, reference, b"\0\1\x12\6\x13\0" + r_id,
                b"\xff\x09" + struct.pack(">H", len(areas)) + b"".join(areas))  # fmt: skip
    szl = pdu(7, reference, b"\0\1\x12\4\x11\x44\1\0", b"\xff\x09\0\4\0\x11\0\0")
    plus = b"\x72\1\0\x05hello" if chance.random() < 0.5 else b"\x99hello"
    return chance.choice(
        (
            (pdu(1, reference, setup), pdu(3, reference, setup)),
            (bsend, taken),
            (usend, szl),
            (plus, szl),
        )
    )


def broken(data: bytes, chance: random.Random) -> bytes:
    """The same with bytes changed, cut off or added, or as it is."""
    found = bytearray(data)
    for _ in range(chance.choice((0, 0, 0, 1, 1, 2, 4))):
        kind, at = chance.randrange(5), chance.randrange(len(found) + 1)
        if kind < 3 and at < len(found):
            found[at] = chance.choice((0, 1, 2, 0xFF, 0x12, chance.randrange(256)))
        elif kind == 3:
            del found[at:]
        else:
            found[at:at] = chance.randbytes(chance.randrange(1, 4))
    return bytes(found)


@cache
def pdus_by_chance() -> list[dict[str, Any]]:
    chance = random.Random(19)
    lines: list[dict[str, Any]] = [{"kind": "pdu", "data": "", "answer": ""}]
    for _ in range(PDUS):
        request, answer = chance.choice((one_job, one_job, other))(chance)
        if chance.random() < 0.1:
            request, answer = answer, request
        request, answer = broken(request, chance), broken(answer, chance)
        lines.append({"kind": "pdu", "data": request.hex(), "answer": answer.hex()})
        lines.append({"kind": "tpdu", "data": broken(chance.choice(TPDUS), chance).hex()})
    return lines


# Connections by chance

TPDUS = (
    b"\x11\xe0\0\0\0\1\0\xc0\1\x0a\xc1\2\1\0\xc2\2\1\2",
    b"\x11\xd0\0\1\0\2\0\xc0\1\x20\xc1\2\1\0\xc2\2\1\2", b"\x04\xd0\0\0\0", b"\x02\x80\0",
    b"\x06\x80\0\1\0\2\3", b"\x02\xf0\0", b"\x03\x70\0\1", b"\x06\xe0\0\0\0\1\0",
)  # fmt: skip


def packets(data: bytes, chance: random.Random) -> Iterator[bytes]:
    """A PDU in one TPKT or in several, with TPDUs of other kinds between."""
    while data:
        many = len(data) if chance.random() < 0.7 else chance.randrange(1, len(data) + 1)
        many = min(many, 0xFFF8)
        part, data = data[:many], data[many:]
        yield (
            struct.pack(">BBH", 3, 0, len(part) + 7)
            + b"\x02\xf0"
            + (b"\0" if data else b"\x80")
            + part
        )
    if chance.random() < 0.1:
        tpdu = broken(chance.choice(TPDUS), chance)
        yield struct.pack(">BBH", 3, 0, len(tpdu) + 4) + tpdu
    if chance.random() < 0.03:
        yield chance.choice(
            (b"\3", b"\3\0\0", b"\x03" * 9, chance.randbytes(30), b"\3\0\0\7\2\xf0\x80")
        )


def stream(chance: random.Random) -> list[bytes]:
    """What one end sends, by its TPKT."""
    found: list[bytes] = []
    for _ in range(chance.randrange(1, 12)):
        data = chance.choice(chance.choice((one_job, other))(chance))
        if chance.random() < 0.03:
            data = pdu(1, 1, b"\5\1", bytes(40_000)) + bytes(chance.choice((0, 26_000)))
        found += packets(data, chance)
    return found


def cut(sent: list[bytes], chance: random.Random) -> Iterator[bytes]:
    """The same as segments: each has one TPKT, or they are cut anywhere."""
    data, most = b"".join(sent), chance.choice((3, 40, 1460, 1460))
    if chance.random() < 0.4 and len(data) < 40_000:
        yield from sent
        return
    if most == 3 and len(data) > 3000:
        most = 1460
    at = 0
    while at < len(data):
        many = chance.randrange(1, most + 1)
        yield data[at : at + many]
        at += many


def segments(
    source: End, destination: End, chance: random.Random
) -> Iterator[tuple[int, int, bytes, int]]:
    """One direction: sequence number, flags, bytes, and how many of them the capture lacks."""
    at = chance.choice((1, 0x7FFFFFF0, 0xFFFFFF80, chance.randrange(1 << 32)))
    if chance.random() < 0.7:
        yield at - 1, tcp.SYN | (tcp.ACK if source.port in PORTS else 0), b"", 0
    for part in cut(stream(chance), chance):
        lacks = chance.randrange(len(part)) if chance.random() < 0.01 else 0
        yield at, tcp.ACK, part[: len(part) - lacks], lacks
        at += len(part)
    if chance.random() < 0.6:
        yield at, tcp.ACK | chance.choice((tcp.FIN, tcp.FIN, tcp.RST)), b"", 0


def disturbed(found: list[Any], chance: random.Random) -> list[Any]:
    """The same with some lost, doubled, late and out of order."""
    much = chance.choice((0, 0.02, 0.1, 0.1))
    result: list[Any] = []
    held: list[Any] = []
    for each in found:
        kind = chance.randrange(4) if chance.random() < much else None
        if kind == 0:
            continue
        if kind == 1:
            held.append(each)
        elif kind == 2:
            result += [each, each]
        else:
            result.append(each)
        if held and chance.random() < 0.1:
            result.append(held.pop())
    return result + held


def talk(chance: random.Random, number: int) -> Iterator[dict[str, Any]]:
    """A connection, or two of the same ends, as IP packets without frame numbers."""
    client = End("10.0.0.1", 1000 + number)
    server = End("10.0.0.2", chance.choice((*PORTS, 103) if number % 9 == 0 else PORTS))
    if number % 7 == 0:
        client = End("10.0.0.1", PORTS[0])
    both = [
        disturbed(list(segments(a, b, chance)), chance)
        for a, b in ((client, server), (server, client))
    ]
    ways = [(client, server), (server, client)]
    reached = [0, 0]
    while any(both):
        side = chance.choice([each for each in (0, 1) if both[each]])
        sequence, flags, data, missing = both[side].pop(0)
        source, destination = ways[side]
        acknowledge = reached[1 - side] if chance.random() < 0.8 else 0
        reached[side] = (sequence + len(data) + missing) & 0xFFFFFFFF
        head = struct.pack(
            ">HHIIBBHHH", source.port, destination.port, sequence & 0xFFFFFFFF, acknowledge,
            chance.choice((0x50, 0x50, 0x60)), flags, 8192, 0, 0,
        )  # fmt: skip
        options = b"\2\4\5\xb4" if head[12] == 0x60 else b""
        yield {
            "kind": "segment", "source": source.ip, "destination": destination.ip,
            "payload": (head + options + data).hex(), "missing": missing,
        }  # fmt: skip


@cache
def talks_by_chance(seeds: range = range(TALKS)) -> list[dict[str, Any]]:
    lines: list[dict[str, Any]] = []
    for seed in seeds:
        chance = random.Random(seed)
        lines.append({"kind": "begin", "ports": PORTS, "most": MOST, "most_bytes": MOST_BYTES})
        open_now = [list(talk(chance, number)) for number in range(1, chance.randrange(2, 6))]
        if chance.random() < 0.5:
            open_now.append(list(talk(chance, 1)))
        frame = 0
        while any(open_now):
            own = chance.choice([each for each in open_now if each])
            for line in own[:3]:
                frame += 1
                lines.append(line | {"frame": frame})
            del own[:3]
        lines.append({"kind": "end"})
    return lines


def single_bytes() -> list[dict[str, Any]]:
    """Segments that make it hard: each has one byte, or all begin a TPKT, or leave a hole."""
    lines: list[dict[str, Any]] = []
    whole = b"".join(packets(pdu(1, 1, b"\5\1", bytes(500)), random.Random(1)))
    for data, step in (
        (b"\3\0\0\7\2\xf0\0" * 9000, 1400),
        (whole, 1),
        (b"\3" * 60_000, 1460),
        (b"\3\0\xff\xff\2\xf0\x80" + bytes(70_000), 1460),
    ):
        lines.append({"kind": "begin", "ports": PORTS, "most": MOST, "most_bytes": MOST_BYTES})
        for at in range(0, len(data), step):
            for skip in (0, 2 * step):
                head = struct.pack(">HHIIBBHHH", 9, 102, at + skip, 0, 0x50, 0, 0, 0, 0)
                part = head + data[at + skip : at + skip + step]
                lines.append({
                    "kind": "segment", "source": "1.1.1.1", "destination": "2.2.2.2", "payload": part.hex(),
                    "missing": 0, "frame": at + 1,
                })  # fmt: skip
        lines.append({"kind": "end"})
    return lines


# Questions by chance: whether what was read was there at one moment


def access(chance: random.Random, order: int, write: bool, calm: bool) -> dict[str, Any]:
    """An access to a few bytes; of some values there are many."""
    start, asked = chance.randrange(8), chance.randrange(12)
    size = chance.choice((1, 2, 4, 8)) if write else chance.choice((2, 8, 8))
    lasts = 0 if calm else chance.choice((0, 1, 3, 9))
    answered = None if write and chance.random() < 0.1 and not calm else asked + lasts
    return {
        "order": order, "connection": 1, "write": write, "area": 0x84, "db": 1, "start": start,
        "data": bytes(chance.choice((1, 2, 3)) for _ in range(size)).hex(), "asked_ns": asked,
        "answered_ns": answered, "request": order, "response": None,
        "sure": answered is not None and chance.random() < 0.9, "known": chance.random() < 0.95,
    }  # fmt: skip


def large(chance: random.Random) -> dict[str, Any]:
    """So many writes at once that the answer is given up."""
    others = [
        access(chance, n, True, False) | {"asked_ns": 0, "answered_ns": 90} for n in range(300)
    ]
    read = access(chance, 900, False, True) | {"data": "0909090909090909", "start": 0}
    return {"kind": "question", "read": [read | {"asked_ns": 5, "answered_ns": 80}], "others": others,
            "before": [[n, 1] for n in range(8)], "foreign": []}  # fmt: skip


def wide(chance: random.Random) -> dict[str, Any]:
    """So many bytes that each event costs more than one step."""
    data = chance.randbytes(3 * 4096 + 5)
    front = access(chance, 1, True, True) | {"data": data[:9000].hex(), "start": 0, "sure": True}
    back = access(chance, 2, True, True) | {"data": data[8000:].hex(), "start": 8000, "sure": True}
    read = access(chance, 900, False, True) | {"data": data.hex(), "start": 0, "known": True}
    others = [each | {"known": True, "asked_ns": 1, "answered_ns": 9} for each in (front, back)]
    return {"kind": "question", "read": [read | {"asked_ns": 2, "answered_ns": 8}], "others": others,
            "before": [[n, 0] for n in range(0, len(data), 7)], "foreign": []}  # fmt: skip


@cache
def questions_by_chance() -> list[dict[str, Any]]:
    chance = random.Random(47)
    lines = [large(chance), wide(chance)]
    for number in range(QUESTIONS):
        calm = number % 2 == 0
        read = [access(chance, 900 + n, False, calm) for n in range(chance.choice((1, 1, 2, 3)))]
        others = [
            access(chance, n, chance.random() < 0.8, calm)
            for n in range(chance.choice((0, 1, 2, 3, 5, 9)))
        ]
        before = [[at, chance.choice((1, 2, 3))] for at in range(16) if chance.random() < 0.8]
        foreign = [at for at in range(16) if chance.random() < 0.05]
        lines.append({
            "kind": "question", "read": read, "others": others, "before": before, "foreign": foreign,
        })  # fmt: skip
    return lines


def answer_to(line: dict[str, Any]) -> dict[str, Any]:
    read, others = (
        [ItemAccess(**each | {"data": bytes.fromhex(each["data"])}) for each in line[name]]
        for name in ("read", "others")
    )
    question = Question(read, others, dict(line["before"]), sum(1 << at for at in line["foreign"]))
    found = question.mixed()
    return {"mixed": None if found is None else list(found), "steps": question._steps}
