"""One PDU of S7: its header, and what its parameter and its data say (docs/s7.md 3).

Here is one PDU whose bytes are in hand. What is wrong with it is a flaw with its offset, never an exception; which
answer belongs to which job is `jobs`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

from ds47.s7.model import DB, DONE, S7Address, S7Item
from ds47.spec import s7
from ds47.spec.words import Flaw

PROTOCOL, PLUS = 0x32, 0x72
"""What a PDU of S7 begins with, and one of S7CommPlus."""
JOB, ACKNOWLEDGE, ANSWER, USER_DATA = 1, 2, 3, 7
READ, WRITE, SETUP = 0x04, 0x05, 0xF0
CYCLIC, CPU, PROGRAM = 2, 4, 6
"""Groups of user data."""
PUSH, REQUEST, RESPONSE = 0, 4, 8
"""Types of user data."""

_HEAD: Final = struct.Struct(">BBHHHH")
_ERRORS = 2
"""Bytes of error class and code, which only answers have."""
_SPEC, _S7ANY, _R_ID, _DB_READ = 0x12, 0x10, 0x13, 0xB0
_ANY = struct.Struct(">BHHBBH")
_ITEM = 4
"""Bytes in front of the data of an item."""
_METHODS = (0x11, 0x12)
"""Request and response, which all user data has but USEND."""
_USER_HEAD = b"\x00\x01\x12"


@dataclass(slots=True, init=False)
class S7Pdu:
    """A PDU; what it does not have, or what cannot be known of it, is None or empty."""

    data: bytes
    """All of it, without what is behind it."""
    kind: int | None
    """ROSCTR: JOB, ACKNOWLEDGE, ANSWER, USER_DATA."""
    reference: int
    parameter: bytes
    content: bytes
    """Its data."""
    error: int | None
    """Error class and code of an answer as one word."""
    size: int
    """Bytes that it says to have."""
    head: int
    """Bytes of the header: where the parameter begins."""
    flaws: list[Flaw]
    frames: list[int]
    """Frames that it stands in, where it is one of a capture."""
    function: int | None
    """The function of a job, or of what answers one."""

    def __init__(
        self,
        data: bytes,
        kind: int | None = None,
        reference: int = 0,
        parameter: bytes = b"",
        content: bytes = b"",
        error: int | None = None,
        size: int = 0,
        head: int = 10,  # _HEAD.size; a name as default takes the signature away where this is compiled
        flaws: list[Flaw] | None = None,
    ) -> None:
        self.data = data
        self.kind = kind
        self.reference = reference
        self.parameter = parameter
        self.content = content
        self.error = error
        self.size = size
        self.head = head
        self.flaws = [] if flaws is None else flaws
        self.frames = []
        self.function = parameter[0] if parameter and kind != USER_DATA else None

    @property
    def content_at(self) -> int:
        """Where its data begins."""
        return self.head + len(self.parameter)


def decode(data: bytes) -> S7Pdu:
    """The PDU at the beginning of some bytes."""
    if not data or data[0] != PROTOCOL:
        other = "plus" if data and data[0] == PLUS else "protocol"
        return S7Pdu(data, flaws=[Flaw(other, 0, {"byte": data[0]} if data else {"byte": 0})])
    if len(data) < _HEAD.size:
        return S7Pdu(data, flaws=[Flaw("cut", 0, {"have": len(data), "want": _HEAD.size})])
    _, kind, _, reference, parameters, contents = _HEAD.unpack_from(data)
    head, error = _HEAD.size, None
    if kind in (ACKNOWLEDGE, ANSWER):
        head += _ERRORS
        error = data[10] << 8 | data[11] if len(data) >= head else None
    content_at = head + parameters
    size = content_at + contents
    if kind not in s7.codes("kind"):
        flaw = Flaw("kind", 1, {"code": kind})
        return S7Pdu(data[:size], kind, reference, size=size, head=head, flaws=[flaw])
    pdu = S7Pdu(
        data[:size], kind, reference, data[head:content_at], data[content_at:size], error, size, head
    )  # fmt: skip
    if len(data) < size:
        pdu.flaws.append(Flaw("cut", len(data), {"have": len(data), "want": size}))
    elif len(data) > size:
        pdu.flaws.append(Flaw("rest", size, {"n": len(data) - size}))
    return pdu


class Setup(NamedTuple):
    """Setup of communication: parallel jobs of both ends, and the length of a PDU."""

    calling: int
    called: int
    pdu_length: int


def setup(pdu: S7Pdu) -> Setup | None:
    """What a setup, or its answer, says; None where it is too short."""
    if len(pdu.parameter) < 8:
        want = {"have": len(pdu.parameter), "want": 8}
        pdu.flaws.append(Flaw("parameter", pdu.head, want))
        return None
    return Setup(*struct.unpack_from(">3H", pdu.parameter, 2))


# Jobs: the items of a request


class Variables(NamedTuple):
    """The variables of a job. `groups` has the number of the address for each of them."""

    items: list[S7Item]
    groups: list[int]


class _Named(NamedTuple):
    """One of the variables that a request names: its address, or else the syntax that is not known."""

    address: S7Address | None
    syntax: int | None = None


def variables(pdu: S7Pdu) -> Variables:
    """The variables that a job reads or writes, with what it writes."""
    parameter = pdu.parameter
    named, groups, flaws = (_named_again if len(parameter) <= _SHORT else _named)(
        parameter, pdu.head
    )
    items = [S7Item(address, syntax=syntax) for address, syntax in named]
    if flaws:
        pdu.flaws += flaws
    if pdu.function == WRITE:
        _written(pdu, items)
    return Variables(items, groups)


_SHORT = 256
"""Bytes of a parameter that is remembered: clients ask for the same variables again and again."""


def _named(parameter: bytes, head: int) -> tuple[list[_Named], list[int], list[Flaw]]:
    """The variables that the parameter of a request names, their groups, and what is wrong there."""
    found: list[_Named] = []
    groups: list[int] = []
    flaws: list[Flaw] = []
    says = parameter[1] if len(parameter) > 1 else 0
    at = 2
    for group in range(says):
        length = parameter[at + 1] if at + 1 < len(parameter) else 0
        end = at + 2 + length
        if length < 1 or end > len(parameter):
            flaws.append(Flaw("items", head + at, {"says": says, "there": group}))
            break
        several = _addresses(parameter[at:end])
        if several and several[0].address is None:
            flaws.append(Flaw("syntax", head + at, {"code": several[0].syntax or 0}))
        found += several
        groups += [group] * len(several)
        at = end
    else:
        if at < len(parameter):
            flaws.append(Flaw("more", head + at, {"n": len(parameter) - at}))
    return found, groups, flaws


_named_again = lru_cache(maxsize=256)(_named)


def _addresses(part: bytes) -> list[_Named]:
    """What one address of a request names: several variables where its syntax is B0."""
    syntax = part[2] if part[0] == _SPEC else None
    if syntax == _S7ANY and len(part) == 12:
        return [_Named(any_address(part[3:]))]
    if syntax == _DB_READ and len(part) > 3 and len(part) == 4 + 5 * part[3]:
        rows = (struct.unpack_from(">BHH", part, first) for first in range(4, len(part), 5))
        return [_Named(S7Address(DB, db, 8 * start, 8, count)) for count, db, start in rows]
    return [_Named(None, syntax if syntax is not None else part[0])]


def any_address(data: bytes) -> S7Address:
    """The address in the nine bytes behind the syntax S7ANY."""
    transport, count, db, area, high, low = _ANY.unpack_from(data)
    row = s7.sizes().get(transport)
    start = high << 16 | low
    return S7Address(area, db, start, 0 if row is None else row.bits, count, transport)


def _written(pdu: S7Pdu, items: Sequence[S7Item]) -> None:
    """The data of a write, an entry for each address."""
    values, _ = _data_items(pdu, len(items), answer=False)
    for item, value in zip(items, values, strict=False):
        item.value = value.data


# Answers


class ItemResult(NamedTuple):
    """What an answer says of one address."""

    code: int
    data: bytes | None = None


def results(pdu: S7Pdu) -> list[ItemResult]:
    """What the answer to a read or a write says, address by address."""
    says = pdu.parameter[1] if len(pdu.parameter) > 1 else 0
    if pdu.function == READ:
        values, at = _data_items(pdu, says, answer=True)
    else:
        values, at = [ItemResult(code) for code in pdu.content[:says]], says
    if len(values) < says:
        args = {"says": says, "there": len(values)}
        pdu.flaws.append(Flaw("items", pdu.content_at + min(at, len(pdu.content)), args))
    elif len(pdu.content) > at:
        pdu.flaws.append(Flaw("more", pdu.content_at + at, {"n": len(pdu.content) - at}))
    return values


def _data_items(pdu: S7Pdu, count: int, answer: bool) -> tuple[list[ItemResult], int]:
    """Entries of data: code, transport size, length, bytes, and a fill byte behind all but the last.

    The length of one that failed says nothing (docs/s7.md 3): nothing follows its four bytes. Gives the entries,
    and where they end.
    """
    data, at = pdu.content, 0
    found: list[ItemResult] = []
    while len(found) < count and at + _ITEM <= len(data):
        code, transport, length = data[at], data[at + 1], data[at + 2] << 8 | data[at + 3]
        if answer and code != DONE:
            found.append(ItemResult(code))
            at += _ITEM
            continue
        row = s7.data_sizes().get(transport)
        if row is None:
            pdu.flaws.append(Flaw("size", pdu.content_at + at + 1, {"code": transport}))
            break
        size = (length * row.bits + 7) // 8
        have = len(data) - at - _ITEM
        if have < size:
            found.append(ItemResult(code))
            args = {"have": have, "want": size}
            pdu.flaws.append(Flaw("data", pdu.content_at + len(data), args))
            return found, len(data)
        found.append(ItemResult(code, data[at + _ITEM : at + _ITEM + size]))
        at += _ITEM + size
        if size & 1 and len(found) < count:
            at += 1
    return found, at


def settle(items: list[S7Item], groups: list[int], results: list[ItemResult]) -> list[Flaw]:
    """Puts results to the variables of their addresses (`Variables`); what does not fit is said."""
    if len(results) == len(items):
        for item, result in zip(items, results, strict=True):
            item.code = result.code
            if result.data is not None:
                item.value = result.data
        return []
    number = groups[-1] + 1 if groups else 0
    if len(results) != number:
        for item, result in zip(items, results, strict=False):
            item.code, item.value = result.code, result.data or item.value
        return [Flaw("items", 0, {"says": len(items), "there": len(results)})]
    for group, result in enumerate(results):
        _share([each for each, of in zip(items, groups, strict=True) if of == group], result)
    return []


def _share(items: list[S7Item], result: ItemResult) -> None:
    """One result for several variables: their bytes one behind the other, if that fits."""
    lengths = [item.address.length if item.address else 0 for item in items]
    at = 0
    for item, length in zip(items, lengths, strict=True):
        item.code = result.code
        if result.data is not None and len(result.data) == sum(lengths):
            item.value = result.data[at : at + length]
        at += length


# User data


@dataclass(slots=True)
class UserData:
    """User data; `content` is what stands behind the four bytes in front of its data."""

    type: int
    group: int
    subfunction: int
    sequence: int
    unit: int = 0
    """Number of a part,"""
    last: bool = True
    """and whether it is the last one; of a BSEND its place among the segments."""
    error: int = 0
    code: int = 0
    content: bytes = b""


def user_data(pdu: S7Pdu) -> UserData | None:
    """What user data says; None where it is none of the known form. A USEND is not of that form."""
    parameter = pdu.parameter
    if len(parameter) < 8 or not parameter.startswith(_USER_HEAD):
        return None
    if parameter[4] not in _METHODS:
        return None
    found = UserData(parameter[5] >> 4, parameter[5] & 0x0F, parameter[6], parameter[7])
    if len(parameter) >= 12:
        found.unit, found.last = parameter[8], parameter[9] == 0
        found.error = parameter[10] << 8 | parameter[11]
    if len(pdu.content) >= _ITEM:
        found.code = pdu.content[0]
        length = pdu.content[2] << 8 | pdu.content[3]
        found.content = pdu.content[_ITEM : _ITEM + length]
        if len(found.content) < length:
            args = {"have": len(found.content), "want": length}
            pdu.flaws.append(Flaw("data", pdu.content_at + len(pdu.content), args))
    return found


class SegmentData(NamedTuple):
    """A segment of a BSEND. `total` only stands in the first one."""

    r_id: int
    total: int | None
    data: bytes
    sequence: int
    number: int
    last: bool


def segment(pdu: S7Pdu, data: UserData) -> SegmentData | None:
    """The segment of a BSEND in user data of that group; None where too little is there.

    Sequence 0 is that of a first segment: the acknowledgement gives those that follow their number.
    """
    content, first = data.content, data.sequence == 0
    r_id = _r_id(content, 0, (_SPEC, 6))
    at = 10 if first else 8
    if r_id is None or len(content) < at:
        args = {"have": len(content), "want": at}
        pdu.flaws.append(Flaw("data", pdu.content_at + _ITEM, args))
        return None
    total = content[8] << 8 | content[9] if first else None
    return SegmentData(r_id, total, content[at:], data.sequence, data.unit, data.last)


class Usend(NamedTuple):
    """A USEND: its R_ID, and its areas."""

    r_id: int
    areas: list[bytes]


def usend(pdu: S7Pdu) -> Usend | None:
    """A USEND; None where user data is none."""
    parameter = pdu.parameter
    if len(parameter) < 10 or not parameter.startswith(_USER_HEAD) or parameter[3] != 6:
        return None
    r_id = _r_id(parameter, 4, ())
    if r_id is None or len(pdu.content) < _ITEM:
        return None
    says = pdu.content[2] << 8 | pdu.content[3]
    # each area has four bytes in front of it as an entry of data has: the first of them means nothing here
    inner = S7Pdu(pdu.data, pdu.kind, content=pdu.content[_ITEM:], head=pdu.content_at + _ITEM)
    found, at = _data_items(inner, says, answer=False)
    pdu.flaws += inner.flaws
    if len(found) < says:
        args = {"says": says, "there": len(found)}
        pdu.flaws.append(Flaw("items", inner.content_at + at, args))
    return Usend(r_id, [each.data for each in found if each.data is not None])


def _r_id(data: bytes, at: int, front: tuple[int, ...]) -> int | None:
    """The R_ID behind the bytes that announce one; None where these are others."""
    head = bytes((*front, _R_ID, 0))
    if data[at : at + len(head)] != head or len(data) < at + len(head) + 4:
        return None
    return int.from_bytes(data[at + len(head) : at + len(head) + 4], "big")
