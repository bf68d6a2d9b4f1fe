"""TPKT and COTP: bytes in order to TPDUs, and the parts of a PDU put together (docs/s7.md 2).

`Reader` takes what one end sends, finds its place again behind lost bytes, and gives what COTP carries. What that
is, S7 or another protocol, is not known here.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from ds47.s7.model import At, Flaw
from ds47.s7.tcp import Piece

VERSION = 3
HEADER = 4
"""Bytes of a TPKT header."""
CR, CC, DR, DT = 0xE0, 0xD0, 0x80, 0xF0
_KINDS = frozenset((CR, CC, DR, DT, 0xC0, 0x10, 0x20, 0x50, 0x60, 0x70))
_FIXED = {CR: 7, CC: 7, DR: 7, DT: 3}
"""Bytes of the fixed part, its length byte included."""
_EOT = 0x80
_SIZE, _CALLING, _CALLED = 0xC0, 0xC1, 0xC2
_LEAST = 7
"""Bytes of the least TPKT that has a TPDU of S7."""
LONGEST = 1 << 16
"""Bytes of a PDU; more is nobody's."""
_NOWHERE = At(0, 0)


@dataclass(frozen=True, slots=True)
class Tpdu:
    """What COTP says in one TPKT; what its kind does not have is None or empty."""

    kind: int | None
    """CR, CC, DR, DT, or another code; None where there is none."""
    data: bytes = b""
    """What DT carries."""
    last: bool = True
    """Whether DT ends a PDU."""
    calling: bytes | None = None
    """TSAP of the end that opens the connection,"""
    called: bytes | None = None
    """and of the other one."""
    size: int | None = None
    """Bytes of a TPDU."""
    reason: int | None = None
    """Of DR."""
    flaws: tuple[Flaw, ...] = ()


def decode(data: bytes, offset: int = 0) -> Tpdu:
    """The TPDU in the payload of a TPKT. `offset`: where that lies in what flaws count from. Never raises."""
    if len(data) < 2 or data[0] + 1 > len(data) or data[0] < 1:
        length = data[0] + 1 if data else 0
        return Tpdu(None, flaws=(Flaw("cotp", offset, {"length": length, "have": len(data)}),))
    end, code = data[0] + 1, data[1]
    kind = code if code == DT else code & 0xF0
    if kind not in _KINDS:
        return Tpdu(None, flaws=(Flaw("cotp_kind", offset + 1, {"code": code}),))
    if end < _FIXED.get(kind, 2):
        args = {"length": end, "have": end}
        return Tpdu(kind, flaws=(Flaw("cotp", offset, args),))
    if kind == DT:
        return Tpdu(kind, data[end:], bool(data[2] & _EOT))
    reason = data[6] if kind == DR else None
    parameters = dict(_parameters(data[_FIXED.get(kind, end) : end]))
    size = parameters.get(_SIZE, b"")
    return Tpdu(
        kind, data[end:], calling=parameters.get(_CALLING), called=parameters.get(_CALLED),
        size=1 << size[0] if len(size) == 1 and 7 <= size[0] <= 13 else None, reason=reason,
    )  # fmt: skip


def _parameters(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 2 <= len(data) and at + 2 + data[at + 1] <= len(data):
        yield data[at], data[at + 2 : at + 2 + data[at + 1]]
        at += 2 + data[at + 1]


def begins(data: bytes | bytearray, at: int = 0) -> bool:
    """Whether a TPKT can begin here, as far as bytes are there: TPKT header, then a TPDU that fits into it."""
    have = len(data) - at
    if data[at] != VERSION or (have > 1 and data[at + 1]):
        return False
    if have < HEADER:
        return True
    (length,) = struct.unpack_from(">H", data, at + 2)
    if length < _LEAST:
        return False
    if have > HEADER and not 1 <= data[at + HEADER] <= length - HEADER - 1:
        return False
    if have > HEADER + 1:
        code = data[at + HEADER + 1]
        if (code if code == DT else code & 0xF0) not in _KINDS:
            return False
        if code == DT and (
            data[at + HEADER] != 2 or (have > HEADER + 2 and data[at + HEADER + 2] & ~_EOT)
        ):
            return False
    return True


@dataclass(slots=True)
class Whole:
    """A TPDU that is whole; of DT the last one of a PDU, with the data of all."""

    tpdu: Tpdu
    data: bytes
    at: At
    frames: list[int]
    """All frames that it stands in."""
    late: bool = False


@dataclass(slots=True, eq=False)
class Reader:
    """What one end sends, as TPDUs.

    Attributes:
        lost: bytes that were passed over or never there.
        synced: whether the beginning of a TPKT is known.
    """

    lost: int = 0
    synced: bool = False
    _buffer: bytearray = field(default_factory=bytearray)
    _at: At = _NOWHERE
    """The last frame of what is in the buffer,"""
    _newest: At = _NOWHERE
    """and that of its last bytes."""
    _frames: dict[int, None] = field(default_factory=dict)
    """Those of it, in order."""
    _parts: bytearray = field(default_factory=bytearray)
    _parts_at: At = _NOWHERE
    _parts_frames: dict[int, None] = field(default_factory=dict)

    @property
    def held(self) -> int:
        """Bytes that are kept."""
        return len(self._buffer) + len(self._parts)

    def take(self, piece: Piece) -> Iterator[Whole]:
        """Bytes in order; gives what is whole with them."""
        if piece.late:
            yield from self._alone(piece)
            return
        if piece.lost:
            self.lose(piece.lost)
        if not self._buffer or piece.at.frame > self._at.frame:
            self._at = piece.at
        self._newest = piece.at
        self._buffer += piece.data
        self._frames[piece.at.frame] = None
        yield from self._read()

    def lose(self, count: int) -> None:
        """So many bytes are missing: what was begun never becomes whole."""
        self.lost += count + self.held
        self.synced = False
        self._buffer.clear()
        self._frames = {}
        self._forget()

    def _forget(self) -> None:
        """The parts of a PDU are not kept any more."""
        self._parts.clear()
        self._parts_frames = {}
        self._parts_at = _NOWHERE

    def _read(self) -> Iterator[Whole]:
        buffer = self._buffer
        while buffer:
            if not begins(buffer):
                self._seek()
                continue
            if len(buffer) < HEADER:
                return
            (length,) = struct.unpack_from(">H", buffer, 2)
            if len(buffer) < length:
                return
            packet = bytes(buffer[HEADER:length])
            del buffer[:length]
            self.synced = True
            yield from self._tpdu(decode(packet, HEADER))
            self._at = self._newest
            self._frames = {self._newest.frame: None} if buffer else {}

    def _seek(self) -> None:
        """Pass over bytes that begin no TPKT."""
        buffer = self._buffer
        at = buffer.find(VERSION, 1)
        passed = len(buffer) if at < 0 else at
        self.lost += passed
        self.synced = False
        self._forget()
        del buffer[:passed]

    def _tpdu(self, tpdu: Tpdu) -> Iterator[Whole]:
        if tpdu.kind != DT or (tpdu.last and not self._parts):
            yield Whole(tpdu, tpdu.data, self._at, list(self._frames))
            return
        if not tpdu.data and not tpdu.last:
            return
        self._parts += tpdu.data
        self._parts_frames |= self._frames
        self._parts_at = max(self._parts_at, self._at)
        if len(self._parts) > LONGEST:
            self.lost += len(self._parts)
            self._forget()
        elif tpdu.last:
            whole = Whole(tpdu, bytes(self._parts), self._parts_at, list(self._parts_frames))
            self._forget()
            yield whole

    def _alone(self, piece: Piece) -> Iterator[Whole]:
        """Bytes that come when nobody waits for them: only what is whole in them counts."""
        for whole in Reader().take(Piece(piece.data, piece.at)):
            whole.late = True
            yield whole
