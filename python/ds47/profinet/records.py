"""Record calls: the body of a Read, Write or ReadImplicit RPC to the records in it (docs/protocol.md E.3, E.4).

Opens one level of IODWriteMultiple (0xE040). Knows nothing of DS47: `data` is opaque bytes here.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Container
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from ds47.profidrive.dictionary import family_of
from ds47.profinet.rpc import Pdu
from ds47.spec.layouts import (
    BLOCK_AR,
    BLOCK_AR_REQUEST,
    BLOCK_READ_REQUEST,
    BLOCK_READ_RESPONSE,
    BLOCK_RELEASE_OF_RSI,
    BLOCK_RELEASE_REQUEST,
    BLOCK_SIZE,
    BLOCK_WRITE_REQUEST,
    BLOCK_WRITE_RESPONSE,
    NDR_SIZE,
    RECORD_SIZE,
    RECORD_STATUS,
    RECORD_STRUCT,
    RECORD_WRITE_MULTIPLE,
    RPC_READ,
    RPC_READ_IMPLICIT,
    RPC_WRITE,
)
from ds47.spec.plain import Plain

NIL_UUID: Final = bytes(16)
NO_API: Final = -1

_BLOCK: Final = struct.Struct(RECORD_STRUCT)
"""Type, length, version, sequence, AR, API, slot, subslot, padding, index, record data length."""
_FIRST_END: Final = NDR_SIZE + _BLOCK.size
_INDEX: Final = 9
"""The position of the index among them."""
_STATUS: Final = {True: struct.Struct("<I"), False: struct.Struct(">I")}
_REQUEST_BLOCKS: Final = {
    RPC_READ: BLOCK_READ_REQUEST,
    RPC_READ_IMPLICIT: BLOCK_READ_REQUEST,
    RPC_WRITE: BLOCK_WRITE_REQUEST,
}
_READS: Final = (RPC_READ, RPC_READ_IMPLICIT)
_ONLY_ARS: Final = (0x0001, 0x0010)
_IS_RESPONSE: Final = 0x8000
"""The bit that the block type of a response adds to that of its request."""
_RELEASE_BLOCKS: Final = (BLOCK_RELEASE_REQUEST, BLOCK_RELEASE_OF_RSI)
_AR_END: Final = NDR_SIZE + BLOCK_AR + 16
"""Where the AR ends in the first block of a Connect or Release."""


@dataclass(slots=True, init=False, repr=False, eq=False)
class Half(Plain):
    """The request or the response of a record call: its frame, and what it carries."""

    frame: int
    time_ns: int
    data: bytes
    stated: int
    """RecordDataLength: the bytes that follow; in a Read request the most bytes wanted."""
    missing: int
    """Missing bytes of the record: cut off by the capture, or never sent."""
    cut: bool
    """Whether the capture cut off a part of the message: these bytes, or something before them."""
    status: int | None
    """PNIOStatus, ErrorCode first; None if the PDU carries none."""

    def __init__(
        self,
        frame: int,
        time_ns: int,
        data: bytes = b"",
        stated: int = 0,
        missing: int = 0,
        status: int | None = None,
        *,
        cut: bool = False,
    ) -> None:
        self.frame = frame
        self.time_ns = time_ns
        self.data = data
        self.stated = stated
        self.missing = missing
        self.cut = cut
        self.status = status

    @property
    def cut_before_status(self) -> bool:
        """Whether the capture cut this response off before it shows the outcome of the call."""
        return self.cut and not (self.status or self.missing)


class Peer(NamedTuple):
    """Who talks to whom, and what is known about the device."""

    controller: str
    device: str
    vendor_id: int | None = None
    device_id: int | None = None
    station: int | None = None
    """The address of the device on PROFIBUS; None on PROFINET."""
    family: str | None = None
    """The family of its parameters, if PROFIBUS says it (`ds47.profibus.idents`)."""

    @property
    def drives(self) -> str:
        """The family of its parameters: "profile" if nothing better is known."""
        return family_of(self.vendor_id, self.family)


Relation = tuple[str, str, bytes]
"""An application relation: controller, device, AR UUID (nil for ReadImplicit)."""
ChannelKey = tuple[str, str, bytes, int, int, int, int]
"""A DS47 channel (docs/pairing.md, record level): controller, device, AR, API, slot, subslot, index."""


NOBODY: Final = Peer("", "")
_NONE: Final[frozenset[int]] = frozenset()
Answer = tuple[Half, int, tuple[Any, ...]]
"""The half from a response block, its place in an IODWriteMultiple (0 outside), the fields of its header."""


@dataclass(slots=True, init=False, repr=False, eq=False)
class Record(Plain):
    """One record call: its address, its request and its response.

    Later steps set `proven` and `job`.
    """

    write: bool
    implicit: bool
    ar: bytes
    api: int
    """`NO_API` on PROFIBUS, which has neither API nor subslot."""
    slot: int
    subslot: int
    index: int
    position: int
    """0, or the place inside an IODWriteMultiple."""
    request: Half | None
    response: Half | None
    peer: Peer
    """Who calls whom."""
    relation: Relation
    channel: ChannelKey
    may_be_ours: bool
    """Whether its index can carry the parameter channel."""
    proven: bool
    """Whether its AR had proved itself when the request came."""
    asked_before: int
    """Without a request: the frame before which it was sent; 0 if that is unknown."""
    job: Any
    """A Write: its own job. A Read: the job that it fetches the response for. None if unknown."""

    def __init__(
        self,
        write: bool,
        implicit: bool,
        ar: bytes,
        api: int,
        slot: int,
        subslot: int,
        index: int,
        position: int,
        request: Half | None = None,
        response: Half | None = None,
        peer: Peer = NOBODY,
        may_be_ours: bool = False,
    ) -> None:
        self.write = write
        self.implicit = implicit
        self.ar = ar
        self.api = api
        self.slot = slot
        self.subslot = subslot
        self.index = index
        self.position = position
        self.request = request
        self.response = response
        self.peer, self.may_be_ours, self.proven = peer, may_be_ours, False
        controller, device = peer[0], peer[1]
        self.relation = controller, device, ar
        self.channel = controller, device, ar, api, slot, subslot, index
        self.job, self.asked_before = None, 0

    def of(self, peer: Peer, *, may_be_ours: bool = True) -> Record:
        """The same call with its peer, if that was unknown when the call came."""
        return Record(
            self.write, self.implicit, self.ar, self.api, self.slot, self.subslot, self.index, self.position,
            self.request, self.response, peer, may_be_ours,
        )  # fmt: skip

    @property
    def place(self) -> tuple[int, int, int]:
        """API, slot and subslot."""
        return self.api, self.slot, self.subslot


def parse_request(
    pdu: Pdu, peer: Peer = NOBODY, concerned: Container[int] = _NONE
) -> tuple[list[Record], bool]:
    """The records of a Read, Write or ReadImplicit request. Never raises: what does not parse is left out.

    Args:
        pdu: the request.
        peer: who calls whom.
        concerned: the indices that can carry the parameter channel.

    Returns:
        The records in their order, and whether it is an IODWriteMultiple. An IODWriteMultiple inside another
        one stays a single record.
    """
    opnum, data, offset, records, multiple = pdu.opnum, pdu.body, NDR_SIZE, list[Record](), False
    expected = _REQUEST_BLOCKS.get(opnum)
    while len(data) >= offset + _BLOCK.size:
        (kind, _length, _version, _seq, ar, api, slot, subslot, _pad, index,
         stated) = _BLOCK.unpack_from(data, offset)  # fmt: skip
        if kind != expected:
            break
        if opnum != RPC_WRITE:
            half = Half(pdu.frame, pdu.time_ns, b"", stated)
            implicit = opnum == RPC_READ_IMPLICIT
            ar = NIL_UUID if implicit else ar
            return [Record(
                False, implicit, ar, api, slot, subslot, index, 0, half, None, peer, index in concerned
            )], False  # fmt: skip
        start = offset + RECORD_SIZE
        carried = data[start : start + stated]
        if index == RECORD_WRITE_MULTIPLE and not multiple:
            data, offset, multiple = carried, 0, True
            continue
        missing, position = stated - len(carried), len(records) + 1 if multiple else 0
        cut = missing > 0 and pdu.cut is not None
        half = Half(pdu.frame, pdu.time_ns, carried, stated, missing, cut=cut)
        records.append(Record(
            True, False, ar, api, slot, subslot, index, position, half, None, peer, index in concerned
        ))  # fmt: skip
        if not multiple:
            break
        offset = start + stated + -stated % 4
    return records, multiple


def without_block(pdu: Pdu, status: int | None, *, write: bool) -> Half:
    """The response to a record without a response block: it has the status of the NDR header.

    If the capture cut the block of a Write off, only a negative status counts: the block may hold a refusal.
    """
    cut = pdu.cut is not None
    return Half(
        pdu.frame, pdu.time_ns, status=None if cut and write and not status else status, cut=cut
    )


def parse_response(
    pdu: Pdu, peer: Peer = NOBODY, concerned: Container[int] = _NONE
) -> tuple[int | None, list[Record]]:
    """PNIOStatus of the NDR header (None for an empty body) and the response blocks as records.

    The blocks carry their own address, so that even a response without its request has one.
    An IODWriteMultiple gives its inner responses only. Arguments as for `parse_request`.
    """
    status, answers = parse_answers(pdu)
    write, implicit = pdu.opnum == RPC_WRITE, pdu.opnum == RPC_READ_IMPLICIT
    records = list[Record]()
    for half, position, block in answers:
        (_kind, _length, _version, _seq, ar, api, slot, subslot, _pad, index, _data) = block
        ar = NIL_UUID if implicit else ar
        records.append(Record(
            write, implicit, ar, api, slot, subslot, index, position, None, half, peer, index in concerned
        ))  # fmt: skip
    return status, records


def parse_answers(pdu: Pdu) -> tuple[int | None, list[Answer]]:
    """The status of a response, and its blocks. Makes no `Record`: the request has made them."""
    body, opnum = pdu.body, pdu.opnum
    if len(body) < NDR_SIZE:
        told = body[:4]
        order = "little" if pdu.little else "big"
        return (int.from_bytes(told, order) if len(told) == 4 else None), []  # type: ignore[arg-type]
    status: int = _STATUS[pdu.little].unpack_from(body)[0]
    if opnum == RPC_WRITE:
        return _written(pdu, status)
    if opnum not in _READS or len(body) < _FIRST_END:
        return status, []
    block = _BLOCK.unpack_from(body, NDR_SIZE)
    if block[0] != BLOCK_READ_RESPONSE:
        return status, []
    start, stated = NDR_SIZE + RECORD_SIZE, block[-1]
    data = body[start : start + stated]
    missing = stated - len(data)
    cut = missing > 0 and pdu.cut is not None
    return status, [
        (Half(pdu.frame, pdu.time_ns, data, stated, missing, status, cut=cut), 0, block)
    ]


def _written(pdu: Pdu, status: int) -> tuple[int, list[Answer]]:
    """The response blocks of a Write; each has its own status if that of the NDR header is 0."""
    body, answers = pdu.body, list[Answer]()
    for offset in range(NDR_SIZE, len(body) - _BLOCK.size + 1, RECORD_SIZE):
        block = _BLOCK.unpack_from(body, offset)
        if block[0] != BLOCK_WRITE_RESPONSE:
            break
        told: int | None = status
        if not status:
            own = body[offset + RECORD_STATUS : offset + RECORD_STATUS + 4]
            told = int.from_bytes(own, "big") if len(own) == 4 else None
        cut = told is None and pdu.cut is not None
        half = Half(pdu.frame, pdu.time_ns, b"", 0, 0, told, cut=cut)
        answers.append((half, len(answers), block))
    if answers and answers[0][2][_INDEX] == RECORD_WRITE_MULTIPLE:
        outer = answers.pop(0)[0]
        if not answers and outer.status:
            status = outer.status
    return status, answers


def released_ar(pdu: Pdu) -> bytes | None:
    """The AR that a Release ends, from its request or response; None if its block does not parse."""
    return _first_ar(pdu, _RELEASE_BLOCKS)


def is_only_ar(pdu: Pdu) -> bool:
    """Whether a Connect request sets up the AR of cyclic data (IOCARSingle, also with IRT).

    A controller has only one of these with a device. ARs of supervisors may exist beside it.
    """
    kind = pdu.body[NDR_SIZE + BLOCK_SIZE : NDR_SIZE + BLOCK_AR]
    return int.from_bytes(kind, "big") in _ONLY_ARS


def connected_ar(pdu: Pdu) -> bytes | None:
    """The AR that a Connect sets up, from its request or response; None if its first block is no ARBlock."""
    return _first_ar(pdu, (BLOCK_AR_REQUEST,))


def _first_ar(pdu: Pdu, blocks: Collection[int]) -> bytes | None:
    block = pdu.body[NDR_SIZE:_AR_END]
    if len(block) < BLOCK_AR + 16 or int.from_bytes(block[:2], "big") & ~_IS_RESPONSE not in blocks:
        return None
    return block[BLOCK_AR:]
