"""TPKT and COTP: bytes in order to TPDUs, and the parts of a PDU put together (docs/s7.md 2).

`TpduReader` takes what one end sends, finds its place again after lost bytes, and gives what COTP carries.
Whether that is S7 or another protocol is not known here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from ds47.s7.model import At
from ds47.s7.tcp import TcpPiece
from ds47.spec.words import Flaw

VERSION = 3
HEADER = 4
"""Bytes of a TPKT header."""
CR, CC, DR, DT = 0xE0, 0xD0, 0x80, 0xF0
_KINDS = frozenset((CR, CC, DR, DT, 0xC0, 0x10, 0x20, 0x50, 0x60, 0x70))
_FIXED = {CR: 7, CC: 7, DR: 7, DT: 3}
"""Bytes of the fixed part, its length byte included."""
_EOT = 0x80
_USUAL: Final = bytes((2, DT))
"""How nearly all TPDUs begin."""
_SIZE, _CALLING, _CALLED = 0xC0, 0xC1, 0xC2
LEAST = 7
"""Bytes of the least TPKT that has a TPDU of S7."""
LONGEST = 1 << 16
"""The most bytes of a PDU."""
_NOWHERE: Final = At(0, 0)


@dataclass(slots=True, init=False)
class Tpdu:
    """What COTP says in one TPKT; what its kind does not have is None or empty."""

    kind: int | None
    """CR, CC, DR, DT, or another code; None where there is none."""
    data: bytes
    """What DT carries."""
    last: bool
    """Whether DT ends a PDU."""
    calling: bytes | None
    """TSAP of the end that opens the connection,"""
    called: bytes | None
    """and of the other one."""
    size: int | None
    """Bytes of a TPDU."""
    reason: int | None
    """Of DR."""
    flaws: tuple[Flaw, ...]

    def __init__(
        self,
        kind: int | None,
        data: bytes = b"",
        last: bool = True,
        calling: bytes | None = None,
        called: bytes | None = None,
        size: int | None = None,
        reason: int | None = None,
        flaws: tuple[Flaw, ...] = (),
    ) -> None:
        self.kind = kind
        self.data = data
        self.last = last
        self.calling = calling
        self.called = called
        self.size = size
        self.reason = reason
        self.flaws = flaws


def decode(data: bytes, offset: int = 0) -> Tpdu:
    """The TPDU in the payload of a TPKT. `offset`: where that lies in what flaws count from. Never raises."""
    if len(data) > 2 and data.startswith(_USUAL):
        return Tpdu(DT, data[3:], data[2] & _EOT != 0)
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
    """Whether a TPKT can begin here, judging by the bytes present: TPKT header, then a TPDU that fits into it."""
    have = len(data) - at
    if data[at] != VERSION or (have > 1 and data[at + 1]):
        return False
    if have < HEADER:
        return True
    length = data[at + 2] << 8 | data[at + 3]
    if length < LEAST:
        return False
    if have > HEADER + 2 and data[at + HEADER] == 2 and data[at + HEADER + 1] == DT:
        return not data[at + HEADER + 2] & ~_EOT
    if have > HEADER and not 1 <= data[at + HEADER] <= length - HEADER - 1:
        return False
    if have > HEADER + 1:
        code = data[at + HEADER + 1]
        if (code if code == DT else code & 0xF0) not in _KINDS:
            return False
        if code == DT and data[at + HEADER] != 2:
            return False
    return True


@dataclass(slots=True, init=False)
class WholeTpdu:
    """A TPDU that is whole; of DT the last one of a PDU, with the data of all."""

    tpdu: Tpdu
    data: bytes
    at: At
    frames: list[int]
    """All frames that it stands in."""
    late: bool

    def __init__(self, tpdu: Tpdu, data: bytes, at: At, frames: list[int]) -> None:
        self.tpdu = tpdu
        self.data = data
        self.at = at
        self.frames = frames
        self.late = False


@dataclass(slots=True, init=False, eq=False)
class TpduReader:
    """What one end sends, as TPDUs.

    Attributes:
        lost: bytes that were passed over or never there.
        synced: whether the beginning of a TPKT is known.
    """

    lost: int
    synced: bool
    _buffer: bytearray
    _at: At
    """The last frame of what is in the buffer,"""
    _newest: At
    """and that of its last bytes."""
    _frames: dict[int, None]
    """Those of it, in order."""
    _parts: bytearray
    _parts_at: At
    _parts_frames: dict[int, None]

    def __init__(self) -> None:
        self.lost = 0
        self.synced = False
        self._buffer, self._parts = bytearray(), bytearray()
        self._at = self._newest = self._parts_at = _NOWHERE
        self._frames = {}
        self._parts_frames = {}

    @property
    def held(self) -> int:
        """Bytes that are kept."""
        return len(self._buffer) + len(self._parts)

    def take(self, piece: TcpPiece) -> list[WholeTpdu]:
        """Bytes in order; gives what is whole with them."""
        if piece.late:
            return _alone(piece)
        if piece.lost:
            self.lose(piece.lost)
        if not piece.data:
            return []
        buffer, at = self._buffer, piece.at
        if not buffer or at.frame > self._at.frame:
            self._at = at
        self._newest = at
        self._frames[at.frame] = None
        if not buffer:
            found, end = self._read(piece.data)
            buffer += piece.data[end:]
        else:
            buffer += piece.data
            found, end = self._read(buffer)
            del buffer[:end]
        return found

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

    def _read(self, data: bytes | bytearray) -> tuple[list[WholeTpdu], int]:
        """What is whole in some bytes, and where that ends."""
        found: list[WholeTpdu] = []
        at, end = 0, len(data)
        while at < end:
            if not begins(data, at):
                at = self._seek(data, at)
                continue
            if end - at < HEADER:
                break
            length = data[at + 2] << 8 | data[at + 3]
            if end - at < length:
                break
            self.synced = True
            whole = self._tpdu(decode(bytes(data[at + HEADER : at + length]), HEADER))
            if whole is not None:
                found.append(whole)
            at += length
            self._at = self._newest
            self._frames = {self._newest.frame: None} if at < end else {}
        return found, at

    def _seek(self, data: bytes | bytearray, at: int) -> int:
        """Where a TPKT may begin behind bytes that begin none."""
        behind = data.find(VERSION, at + 1)
        if behind < 0:
            behind = len(data)
        self.lost += behind - at
        self.synced = False
        self._forget()
        return behind

    def _tpdu(self, tpdu: Tpdu) -> WholeTpdu | None:
        if tpdu.kind != DT or (tpdu.last and not self._parts):
            return WholeTpdu(tpdu, tpdu.data, self._at, list(self._frames))
        if not tpdu.data and not tpdu.last:
            return None
        self._parts += tpdu.data
        self._parts_frames |= self._frames
        self._parts_at = max(self._parts_at, self._at)
        if len(self._parts) > LONGEST:
            self.lost += len(self._parts)
            self._forget()
        elif tpdu.last:
            whole = WholeTpdu(tpdu, bytes(self._parts), self._parts_at, list(self._parts_frames))
            self._forget()
            return whole
        return None


def _alone(piece: TcpPiece) -> list[WholeTpdu]:
    """Unexpected bytes: only whole TPDUs in them count."""
    found = TpduReader().take(TcpPiece(piece.data, piece.at))
    for whole in found:
        whole.late = True
    return found
