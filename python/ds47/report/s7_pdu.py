"""PDUs of S7 for people and for JSON: what stands at which byte, and what it means.

Of single PDUs, as `ds47 decode --as s7` shows them, from TPKT on or without it. Decoding is `ds47.s7`; what a
capture shows of a connection is `ds47.report.s7`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ds47.report.bilingual import Both, say
from ds47.report.s7 import failure, tsap
from ds47.s7 import addresses, pdu, tpkt
from ds47.s7.model import DONE, S7Address, S7Item
from ds47.s7.pdu import ItemResult, S7Pdu, SegmentData, Setup, Usend, UserData
from ds47.spec import s7
from ds47.spec.words import Flaw

Line = tuple[int, Both]
"""Where something stands, and what it means."""
_COTP = {tpkt.CR: "s7_cotp_cr", tpkt.CC: "s7_cotp_cc", tpkt.DR: "s7_cotp_dr"}

_TYPES = {pdu.PUSH: "push", pdu.REQUEST: "request", pdu.RESPONSE: "answer"}


@dataclass(slots=True)
class Decoded:
    """One PDU with what is around it; offsets count from the beginning of the bytes."""

    data: bytes
    packet: bool
    """Whether it begins with a TPKT."""
    tpdu: tpkt.Tpdu | None
    start: int
    """Where the PDU begins."""
    pdu: S7Pdu | None
    setup: Setup | None = None
    items: list[S7Item] = field(default_factory=list)
    results: list[ItemResult] = field(default_factory=list)
    user: UserData | None = None
    segment: SegmentData | None = None
    usend: Usend | None = None
    flaws: list[Flaw] = field(default_factory=list)


def decode(data: bytes) -> Decoded:
    """The PDU in some bytes, from its TPKT on, or from its first byte on."""
    if not data or data[0] != tpkt.VERSION:
        return _content(Decoded(data, False, None, 0, pdu.decode(data)))
    flaws: list[Flaw] = []
    length = data[2] << 8 | data[3] if len(data) >= tpkt.HEADER else tpkt.HEADER
    if len(data) < max(length, tpkt.HEADER):
        flaws.append(Flaw("cut", len(data), {"have": len(data), "want": max(length, tpkt.HEADER)}))
    elif len(data) > length >= tpkt.HEADER:
        flaws.append(Flaw("rest", length, {"n": len(data) - length}))
    tpdu = tpkt.decode(data[tpkt.HEADER : max(length, tpkt.HEADER)], tpkt.HEADER)
    start = tpkt.HEADER + (data[tpkt.HEADER] + 1 if len(data) > tpkt.HEADER else 0)
    carries = tpdu.kind == tpkt.DT and bool(tpdu.data)
    found = Decoded(data, True, tpdu, start, pdu.decode(tpdu.data) if carries else None)
    found.flaws = [*flaws, *tpdu.flaws]
    return _content(found)


def _content(found: Decoded) -> Decoded:
    item = found.pdu
    if item is None:
        return found
    if item.kind == pdu.USER_DATA:
        found.usend = pdu.usend(item)
        found.user = None if found.usend else pdu.user_data(item)
        user = found.user
        if user is not None and (user.group, user.type) == (pdu.PROGRAM, pdu.REQUEST):
            found.segment = pdu.segment(item, user)
    elif item.function == pdu.SETUP:
        found.setup = pdu.setup(item)
    elif item.function in (pdu.READ, pdu.WRITE):
        if item.kind == pdu.JOB:
            found.items = pdu.variables(item).items
        else:
            found.results = pdu.results(item)
    found.flaws += [Flaw(each.kind, found.start + each.offset, each.args) for each in item.flaws]
    return found


def _both(table: str, code: int) -> Both:
    return Both.of(s7.code_text, table, code)


def headline(found: Decoded) -> Both:
    """What it is."""
    item = found.pdu
    if item is None or item.kind is None:
        return say("s7_nothing")
    return say("decode_s7", kind=_both("kind", item.kind))


def flaw(found: Flaw) -> Both:
    """What is wrong."""
    return Both.of(s7.flaw_text, found.kind, found.args)


# For JSON


def document(found: Decoded) -> dict[str, Any]:
    """A PDU for JSON; what it does not have is None."""
    item, user, part = found.pdu, found.user, found.segment
    known = item is not None and item.kind is not None
    return {
        "length": len(found.data),
        "cotp": None if found.tpdu is None else _cotp(found.tpdu),
        "rosctr": item.kind if item and known else None,
        "kind": s7.code_text("kind", item.kind) if item and item.kind is not None else None,
        "reference": item.reference if item and known else None,
        "function": _function(item),
        "error": item.error if item else None,
        "setup": found.setup and found.setup._asdict(),
        "items": [_item(each) for each in found.items] if found.items else [
            {"code": each.code, "text": s7.code_text("return_code", each.code),
             "value": None if each.data is None else each.data.hex()}
            for each in found.results
        ],
        "user_data": None if user is None else {
            "type": user.type, "group": s7.code_text("group", user.group), "subfunction": user.subfunction,
            "sequence": user.sequence, "unit": user.unit, "last": user.last, "error": user.error,
            "code": user.code, "data": user.content.hex(),
        },
        "bsend": None if part is None else part._asdict() | {"data": part.data.hex()},
        "usend": None if found.usend is None else {
            "r_id": found.usend.r_id, "areas": [each.hex() for each in found.usend.areas],
        },
        "flaws": [
            {"kind": each.kind, "offset": each.offset, "text": s7.flaw_text(each.kind, each.args)}
            for each in found.flaws
        ],
    }  # fmt: skip


def _function(item: S7Pdu | None) -> str | None:
    if item is None or item.function is None:
        return None
    return s7.code_text("function", item.function)


def _cotp(item: tpkt.Tpdu) -> dict[str, Any]:
    return {
        "code": item.kind,
        "last": item.last if item.kind == tpkt.DT else None,
        "calling_tsap": item.calling and item.calling.hex(),
        "called_tsap": item.called and item.called.hex(),
        "size": item.size,
        "reason": item.reason,
    }


def _item(item: S7Item) -> dict[str, Any]:
    address = item.address
    return {
        "address": None if address is None else addresses.text(address),
        "length": address.length if address is not None and address.size else None,
        "value": None if item.value is None else item.value.hex(),
    }


# For people


def lines(found: Decoded) -> Iterator[Line]:
    """What stands at which byte, in order."""
    if found.packet:
        yield 0, say("s7_tpkt", n=len(found.data))
        if len(found.data) > tpkt.HEADER and found.tpdu is not None:
            yield tpkt.HEADER, _cotp_words(found.tpdu)
    item = found.pdu
    if item is None or item.kind is None or len(item.data) < item.head:
        return
    start = found.start
    yield start, say(
        "s7_pdu_head", kind=_both("kind", item.kind), reference=str(item.reference),
        parameter=str(len(item.parameter)), data=str(len(item.content)),
    )  # fmt: skip
    if item.error is not None:
        text = Both.of(s7.error_text, item.error or 0)
        yield start + 10, say("s7_pdu_error", error=text) if item.error else say("s7_pdu_done")
    if item.parameter:
        yield from _parameter(found, item, start + item.head)
    if item.content:
        yield from _data(found, item, start + item.content_at)


def _cotp_words(item: tpkt.Tpdu) -> Both:
    if item.kind == tpkt.DT:
        return say("s7_cotp_dt" if item.last else "s7_cotp_more")
    return say(
        _COTP.get(item.kind or 0, "s7_cotp"), calling=tsap(item.calling), called=tsap(item.called),
        size=str(item.size or "?"), reason=str(item.reason), code=f"{item.kind or 0:02X}",
    )  # fmt: skip


def _parameter(found: Decoded, item: S7Pdu, at: int) -> Iterator[Line]:
    user, part = found.user, found.usend
    if part is not None:
        yield at, say("s7_pdu_usend", r_id=f"{part.r_id:08X}")
    elif user is not None:
        yield at, _user_words(user)
    elif found.setup is not None:
        calling, called, length = map(str, found.setup)
        yield at, say("s7_pdu_setup", calling=calling, called=called, pdu=length)
    elif item.function in (pdu.READ, pdu.WRITE) and len(item.parameter) > 1:
        number = item.parameter[1]
        yield at, say("s7_pdu_function", function=_both("function", item.function), n=number)
        if item.kind == pdu.JOB:
            yield from _addresses(found, item, at)
    else:
        known = item.function is not None
        yield at, _both("function", item.function or 0) if known else say("decode_rest")


def _user_words(user: UserData) -> Both:
    kind = say(f"s7_user_{_TYPES.get(user.type, 'other')}", type=str(user.type))
    return say(
        "s7_pdu_user", group=_both("group", user.group), type=kind, subfunction=str(user.subfunction),
        sequence=str(user.sequence),
    )  # fmt: skip


def _addresses(found: Decoded, item: S7Pdu, begin: int) -> Iterator[Line]:
    """The addresses of a job; one that names several areas is one."""
    groups, at = pdu.variables(S7Pdu(**_again(item))).groups, 2
    for group in range(groups[-1] + 1 if groups else 0):
        there = [each for each, of in zip(found.items, groups, strict=True) if of == group]
        names = [
            addresses.text(each.address) for each in there if isinstance(each.address, S7Address)
        ]
        yield begin + at, Both.same(", ".join(names)) if names else say("decode_unknown")
        at += 2 + item.parameter[at + 1]


def _again(item: S7Pdu) -> dict[str, Any]:
    """A PDU to be read once more, without what was wrong with it."""
    names = ("data", "kind", "reference", "parameter", "content", "error", "size", "head")
    return {name: getattr(item, name) for name in names}


def _data(found: Decoded, item: S7Pdu, begin: int) -> Iterator[Line]:
    part = found.segment
    if part is not None:
        total = "?" if part.total is None else str(part.total)
        yield begin, say(
            "s7_pdu_segment", r_id=f"{part.r_id:08X}", number=str(part.number), total=total,
            last=say("s7_yes" if part.last else "s7_no"),
        )  # fmt: skip
        yield (
            begin + 4 + (10 if part.total is not None else 8),
            say("s7_pdu_bytes", n=len(part.data)),
        )
    elif found.usend is not None:
        yield begin, say("s7_pdu_bytes", n=sum(map(len, found.usend.areas)))
    elif item.function == pdu.WRITE and item.kind != pdu.JOB:
        for number, each in enumerate(found.results):
            yield begin + number, _both("return_code", each.code)
    elif item.function in (pdu.READ, pdu.WRITE):
        yield from _entries(found, begin)
    else:
        yield begin, say("decode_rest")


def _entries(found: Decoded, begin: int) -> Iterator[Line]:
    """The entries of data, each with what was read or is to be written."""
    results = found.results or [ItemResult(DONE, each.value) for each in found.items]
    at, end = begin, found.start + len(found.pdu.data if found.pdu else b"")
    for each in results:
        if at >= end:
            return
        size = len(each.data or b"")
        words = Both.same((each.data or b"").hex(" ").upper())
        yield at, words if each.code == DONE else Both.of(failure, each.code)
        at += 4 + size + size % 2
