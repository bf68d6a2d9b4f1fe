"""A message without names, written back into its frames: link layer, IP, UDP, RPC header, checksums.

What is inside is in `blocks`, `values` and `stations`; what stands for what in `mapping`. A frame of
another kind is refused: nobody can tell what it holds.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field

from ds47.acyclic.index47 import ALWAYS
from ds47.capture.scan import ETHERNET, SLL, SLL2, UUIDS
from ds47.profidrive import Options
from ds47.profinet import rpc
from ds47.profinet.records import NIL_UUID
from ds47.profinet.traces import Trace
from ds47.spec import layouts

from . import blocks, stations, values
from .drafts import Draft, Drafts
from .mapping import Replacements
from .tracking import Copy, TrackedMessage

_UDP = 8
"""Bytes of the UDP header in front of that of RPC."""
_UUIDS = (layouts.RPC_OBJECT, layouts.RPC_ACTIVITY)
"""Object and activity, in the RPC header."""
_UNREAD = (
    (layouts.RPC_FLAGS + 1, 1),  # the second byte of flags
    (layouts.RPC_ORDER + 1, 3),  # kind of floating point numbers, reserved, serial number
    (layouts.RPC_BOOT, 4),
    (layouts.RPC_FRAGMENT + 2, 2),  # authentication, serial number
)
"""What nobody needs of the RPC header: where it begins, and how long it is."""
_NO_HINTS = b"\xff" * 4
_VERSION, _MAPPER_VERSION = 1, 3
"""Of the interfaces of PROFINET, and of that of the endpoint mapper: others are not dissected."""
_TIME_TO_LIVE = 64
_TAGS = {ETHERNET: 14, SLL: 16, SLL2: 20}
"""Where the first VLAN tag begins, after its type."""
_MOST_ASKED = 65_536
"""Answered calls that are known, for a response that is sent again; the oldest goes first."""


@dataclass(slots=True)
class Knowledge:
    """What the analysis knows and a frame alone does not.

    Attributes:
        ours: controller, device, AR and index of the channels on which there is a transaction: index 47
            alone says nothing.
        asked: frame of a Read response -> the request it answers.
        misplaced: frame and index of requests that were written to a record that is none of a channel.
        codec: dialects of the messages.
        everything: whether all values are replaced.
    """

    ours: set[tuple[str, str, bytes, int]] = field(default_factory=set)
    asked: dict[int, bytes] = field(default_factory=dict)
    misplaced: set[tuple[int, int]] = field(default_factory=set)
    codec: Options = field(default_factory=Options)
    everything: bool = False


class Anonymiser:
    """Rewrites messages in place, with one key.

    While the key learns, nothing changes. `leaks` finds what is left of an original.
    """

    def __init__(self, key: Replacements, knowledge: Knowledge) -> None:
        self.key = key
        self._knowledge = knowledge
        self._values = values.Rewriter(key, knowledge.codec, knowledge.everything)
        self._originals: re.Pattern[bytes] | None = None
        self._frame = 0
        self._asked: dict[tuple[str, bytes, int], bytes] = {}
        """The same as `asked` by RPC call: a response may be sent again."""

    def message(self, message: TrackedMessage, drafts: Drafts) -> bool:
        """Rewrites all frames of a message; False where that cannot be done."""
        if message.kind == "foreign":
            return False
        frames = [drafts[number] for number in message.frames]
        for draft in frames:
            if not self._link(draft):
                return False
        if message.kind == "rpc":
            sums = [_Checksum(trace, drafts) for trace in message.traces]
            self._rpc(message, drafts)
            for draft in frames:
                self._ip(draft)
            for each in sums:
                each.correct()
        else:
            (draft,) = frames
            data = bytes(draft.data[draft.layer :])
            change = stations.dcp if message.kind == "dcp" else stations.lldp
            draft.data[draft.layer :] = change(self.key, data)
        message.rewritten = True
        return True

    def copy(self, copy: Copy, drafts: Drafts) -> bool:
        """Rewrites a datagram like the one it copies; False where that one was not."""
        if not copy.message.rewritten:
            return False
        frames = [drafts[number] for number in copy.trace.frames]
        if not all(self._link(draft) for draft in frames):
            return False
        for draft in frames:
            self._ip(draft)
        drafts.write(copy.trace, copy.sibling.data)
        return True

    def leaks(self, draft: Draft) -> str | None:
        """What of an original still stands in a frame; None where nothing does."""
        if self._originals is None:
            every = sorted(self.key.originals(), key=len, reverse=True)
            self._originals = re.compile(b"|".join(map(re.escape, every)) or b"(?!)", re.I)
        found = self._originals.search(draft.data)
        return None if found is None else found[0].decode("latin-1")

    # Below RPC

    def _link(self, draft: Draft) -> bool:
        """Addresses of the link layer. False for one that is not known."""
        data, key, link = draft.data, self.key, draft.frame.link_type
        if link == ETHERNET:
            data[:6], data[6:12] = key.mac(bytes(data[:6])), key.mac(bytes(data[6:12]))
        elif link == SLL:
            data[6:14] = _hardware(key, bytes(data[4:6]), bytes(data[6:14]))
        elif link == SLL2:
            data[2:8] = bytes(6)  # reserved, number of the interface
            data[12:20] = _hardware(key, b"\0" + bytes(data[11:12]), bytes(data[12:20]))
        else:
            return draft.layer == 0  # raw IP
        for at in range(_TAGS[link], draft.layer - 2, 4):  # priority and number of a VLAN
            data[at : at + 2] = b"\0\0"
        return True

    def _ip(self, draft: Draft) -> None:
        """The IPv4 header: addresses, checksum, what nobody needs; and what stands behind the datagram."""
        data, at = draft.data, draft.layer
        size = (data[at] & 15) * 4
        data[at + 1] = 0  # kind of service
        data[at + 6] &= 0x3F  # of the flags only whether more fragments follow
        data[at + 8] = _TIME_TO_LIVE
        data[at + 12 : at + 16] = self.key.ip(bytes(data[at + 12 : at + 16]))
        data[at + 16 : at + 20] = self.key.ip(bytes(data[at + 16 : at + 20]))
        data[at + 20 : at + size] = b"\1" * (size - 20)  # no operation
        data[at + 10 : at + 12] = b"\0\0"
        data[at + 10 : at + 12] = internet_checksum(bytes(data[at : at + size])).to_bytes(2, "big")
        total = int.from_bytes(data[at + 2 : at + 4], "big")
        if total:
            data[at + total :] = bytes(len(data[at + total :]))

    # RPC

    def _rpc(self, message: TrackedMessage, drafts: Drafts) -> None:
        pdu = message.pdu
        if pdu is None:
            for trace in message.traces:
                drafts.write(trace, self._stump(trace.data))
            return
        self._frame = message.frame
        body = blocks.body(self.key, pdu, self._record)
        at = 0
        for copies in message.parts:
            size = _body_size(copies[0].data)
            part = body[at : at + size]
            at += size
            for trace in copies:
                drafts.write(trace, self._header(trace.data, part))

    def _header(self, data: bytes, body: bytes) -> bytes:
        """UDP header, RPC header with other UUIDs, the body, zeros."""
        little = data[_UDP + layouts.RPC_ORDER] & layouts.RPC_LITTLE != 0
        out = bytearray(_cleared(data[: _UDP + layouts.RPC_SIZE]) + body)
        for at, change in zip(_UUIDS, (blocks.object_uuid, Replacements.uuid), strict=True):
            span = slice(_UDP + at, _UDP + at + 16)
            out[span] = _turned(change(self.key, _turned(bytes(out[span]), little)), little)
        return (bytes(out) + bytes(len(data)))[: len(data)]

    def _stump(self, data: bytes) -> bytes:
        """A frame that ends inside the RPC header: what is needed in front of the activity stays."""
        data = _cleared(data)
        start, end, stop = (
            _UDP + at for at in (layouts.RPC_OBJECT, layouts.RPC_INTERFACE, layouts.RPC_ACTIVITY)
        )
        head, known = data[:start], data[start:end]
        little = (
            len(data) > _UDP + layouts.RPC_ORDER
            and data[_UDP + layouts.RPC_ORDER] & layouts.RPC_LITTLE != 0
        )
        if len(known) < 16 or rpc.device_identity(_turned(known, little)) is None:
            known = bytes(len(known))
        return head + known + data[end:stop] + bytes(len(data[stop:]))

    def _record(self, pdu: rpc.Pdu, ar: bytes, index: int, content: bytes) -> bytes:
        """The content of one record; zeros where it is no parameter message."""
        about = self._knowledge
        if pdu.opnum == layouts.RPC_READ_IMPLICIT:
            ar = NIL_UUID
        ours = (pdu.client, pdu.server, ar, index) in about.ours or index in ALWAYS
        if not ours and (self._frame, index) not in about.misplaced:
            return stations.blank(content)
        vendor = (rpc.device_identity(pdu.object_uuid) or (None,))[0]
        if pdu.ptype == 0:
            return self._values.request(content, vendor)
        call = (pdu.client, pdu.activity, pdu.seq)
        asked = about.asked.get(self._frame)
        if asked is not None:
            self._asked[call] = asked
            if len(self._asked) > _MOST_ASKED:
                del self._asked[next(iter(self._asked))]
        return self._values.response(content, self._asked.get(call), vendor)


def internet_checksum(data: bytes) -> int:
    """The checksum of IP, UDP and others (RFC 1071) over data with its own checksum set to 0."""
    if len(data) % 2:
        data += b"\0"
    total: int = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


class _Checksum:
    """The UDP checksum of one datagram; made before anything of it is written.

    Over the whole datagram; 0 means that there is none and stays. Where the capture cut the datagram it is
    corrected by what changed (RFC 1624), so that what was right stays right.
    """

    def __init__(self, trace: Trace, drafts: Drafts) -> None:
        self._trace = trace
        self._drafts = drafts
        self._before = internet_checksum(self._addresses() + self._covered())

    def correct(self) -> None:
        """Writes it, when all else is written."""
        data = self._trace.data
        if len(data) < 8 or data[6:8] == b"\0\0":
            return
        length = int.from_bytes(data[4:6], "big")
        if 8 <= length <= len(data):
            pseudo = self._addresses() + struct.pack(">2H", 17, length)
            value = internet_checksum(pseudo + data[:6] + b"\0\0" + data[8:length])
        elif length > len(data):
            now = internet_checksum(self._addresses() + self._covered())
            total = (~int.from_bytes(data[6:8], "big") & 0xFFFF) + self._before + (~now & 0xFFFF)
            while total >> 16:
                total = (total & 0xFFFF) + (total >> 16)
            value = ~total & 0xFFFF
        else:
            return
        new = data[:6] + (value or 0xFFFF).to_bytes(2, "big") + data[8:]
        self._drafts.write(self._trace, new)

    def _addresses(self) -> bytes:
        """Source and destination in the IPv4 header."""
        draft = self._drafts[self._trace.pieces[0].frame]
        return bytes(draft.data[draft.layer + 12 : draft.layer + 20])

    def _covered(self) -> bytes:
        """What it covers and the capture has, with zeros for the rest and for the checksum.

        Empty where nothing is missing: then the checksum is made anew.
        """
        length = int.from_bytes(self._trace.data[4:6], "big")
        if length <= len(self._trace.data):
            return b""
        image = self._drafts.image(self._trace)[:length]
        return image[:6] + b"\0\0" + image[8:]


def _hardware(key: Replacements, length: bytes, field_: bytes) -> bytes:
    """The eight bytes of an address in a cooked header."""
    if bytes(length) == b"\0\6":
        return key.mac(field_[:6]) + bytes(len(field_[6:]))
    return bytes(len(field_))


def _cleared(data: bytes) -> bytes:
    """UDP and RPC header, or the begin of them, without what nobody needs."""
    out = bytearray(data.ljust(_UDP + layouts.RPC_SIZE, b"\0"))
    for at, size in _UNREAD:
        out[_UDP + at : _UDP + at + size] = bytes(size)
    little = out[_UDP + layouts.RPC_ORDER] & layouts.RPC_LITTLE
    out[_UDP + layouts.RPC_ORDER] = little
    at = _UDP + layouts.RPC_INTERFACE + 8
    version = _VERSION if out[at : at + 8] == UUIDS[8:16] else _MAPPER_VERSION
    at = _UDP + layouts.RPC_INTERFACE_VERSION
    out[at : at + 4] = version.to_bytes(4, "little" if little else "big")
    at = _UDP + layouts.RPC_INTERFACE_HINT
    out[at : at + 4] = _NO_HINTS
    return bytes(out[: len(data)])


def _body_size(data: bytes) -> int:
    """Captured bytes of the RPC body in a UDP datagram."""
    little = data[_UDP + layouts.RPC_ORDER] & layouts.RPC_LITTLE != 0
    stated = int.from_bytes(
        data[_UDP + layouts.RPC_BODY : _UDP + layouts.RPC_BODY + 2], "little" if little else "big"
    )
    length = int.from_bytes(data[4:6], "big")
    end = min(len(data), length) if length >= 8 else len(data)
    return max(0, min(stated, end - _UDP - layouts.RPC_SIZE))


def _turned(data: bytes, little: bool) -> bytes:
    """A UUID between the order of a little-endian PDU and network order; both ways are the same."""
    return struct.pack(">IHH8s", *struct.unpack("<IHH8s", data)) if little else data
