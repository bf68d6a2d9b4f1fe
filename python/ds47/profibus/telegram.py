"""One frame of PROFIBUS: start byte, addresses, function code, SAPs, data, check byte (docs/profibus.md 2).

Here is one frame whose bytes are in hand; what its data says is `dp` and `ms1`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from ds47.spec import profibus
from ds47.spec.words import Flaw

SD1: Final = "SD1"
SD2: Final = "SD2"
SD3: Final = "SD3"
SD4: Final = "SD4"
SC: Final = "SC"
START: Final = 0x68
END: Final = 0x16
"""What begins SD2, twice, and what ends every frame but SD4 and SC."""
ALL_STATIONS: Final = 127
"""The address that stands for all of them."""
SIZES: Mapping[str, int] = {SD1: 6, SD3: 14, SD4: 3, SC: 1}
"""Bytes of the frames that have always as many."""

_REQUEST, _FCB, _FCV, _RESERVED = 0x40, 0x20, 0x10, 0x80
_EXTENDED, _ADDRESS = 0x80, 0x7F
_SEGMENT, _SAP = 0x40, 0x3F
_TRAILER: Final = 2
"""Check byte and end byte."""
_HEAD: Final = 4
"""Start byte, both length bytes, start byte: what SD2 begins with."""
_LEAST: Final = 7
"""Its bytes up to the function code: more than a frame without data has."""
_REMEMBERED: Final = 1024
"""Beginnings of frames, and whole short ones, that are remembered."""


@dataclass(slots=True, init=False, eq=False)
class Front:
    """What a frame begins with, and what that means; what is not there, or cannot be known, is None or empty.

    Frames that begin alike share one.
    """

    kind: str
    """SD1 to SD4 or SC; empty where no frame begins so."""
    da: int | None
    sa: int | None
    """The stations, without the bit that announces an extension,"""
    fc: int | None
    dae: bytes
    sae: bytes
    """and the extension bytes."""
    request: bool | None
    """Whether a master asks or says something; False for an answer, None without a function code."""
    code: int | None
    """The function, bits 3 to 0 of the function code."""
    fcb: int | None
    """The frame count bit of a request; the same again is a retry, where `fcv` is 1."""
    fcv: int | None
    """Whether `fcb` counts: 0 in the first request to a station."""
    dsap: int | None
    """The SAP at the destination,"""
    ssap: int | None
    """and at the source."""
    way: bytes
    """The stations as two bytes, source and destination; empty without them,"""
    back: bytes
    """and turned round."""
    service: str | None
    """What it belongs to (`spec.profibus.service_id`)."""
    silent: bool
    """Whether nobody answers such a request."""
    exchanges: bool
    """Of an answer: whether it has data of data exchange; SC has none,"""
    wants: bool
    """and whether the slave asks for Slave_Diag in it."""

    def __init__(
        self, kind: str, da: int | None = None, sa: int | None = None, fc: int | None = None,
        dae: bytes = b"", sae: bytes = b"",
    ) -> None:  # fmt: skip
        self.kind, self.da, self.sa, self.fc = kind, da, sa, fc
        self.dae, self.sae = dae, sae
        self.request = self.code = self.fcb = self.fcv = None
        if fc is not None:
            self.request, self.code = bool(fc & _REQUEST), fc & 0x0F
            if self.request:
                self.fcb, self.fcv = int(bool(fc & _FCB)), int(bool(fc & _FCV))
        self.dsap, self.ssap = _sap(dae), _sap(sae)
        self.way = b"" if sa is None or da is None else bytes((sa, da))
        self.back = self.way[::-1]
        saps = (self.dsap, self.ssap) if self.request else (self.ssap, self.dsap)
        self.service = profibus.service_id(self.request, self.code, *saps)
        row = profibus.codes("request" if self.request else "answer").get(self.code or 0)
        self.silent = da == ALL_STATIONS or (row is not None and row.silent)
        self.exchanges = row is not None and row.exchange
        self.wants = row is not None and row.wants


@dataclass(slots=True, init=False, eq=False)
class Telegram:
    """A frame; what it begins with is `front`.

    `flaws` are those of the frame itself: with one of them none of its content is proved.
    """

    front: Front
    data: bytes
    du: bytes
    fcs: int | None
    """The check byte as it was sent."""
    flaws: tuple[Flaw, ...]

    def __init__(
        self, front: Front, data: bytes, du: bytes = b"", fcs: int | None = None,
        flaws: tuple[Flaw, ...] = (),
    ) -> None:  # fmt: skip
        self.front = front
        self.data = data
        self.du = du
        self.fcs = fcs
        self.flaws = flaws

    def __eq__(self, other: object) -> bool:
        """All of a frame is in its bytes; what is wrong about it may be in those around it."""
        return isinstance(other, Telegram) and self.data == other.data and self.flaws == other.flaws

    def __hash__(self) -> int:
        return hash(self.data)

    @property
    def kind(self) -> str:
        """As in `Front`, like those that follow."""
        return self.front.kind

    @property
    def da(self) -> int | None:
        """The station that it goes to."""
        return self.front.da

    @property
    def sa(self) -> int | None:
        """The station that sends it."""
        return self.front.sa

    @property
    def fc(self) -> int | None:
        """The function code."""
        return self.front.fc

    @property
    def dae(self) -> bytes:
        """The extension bytes of the destination."""
        return self.front.dae

    @property
    def sae(self) -> bytes:
        """The extension bytes of the source."""
        return self.front.sae

    @property
    def request(self) -> bool | None:
        """Whether a master asks or says something."""
        return self.front.request

    @property
    def code(self) -> int | None:
        """The function."""
        return self.front.code

    @property
    def fcb(self) -> int | None:
        """The frame count bit."""
        return self.front.fcb

    @property
    def fcv(self) -> int | None:
        """Whether it counts."""
        return self.front.fcv

    @property
    def dsap(self) -> int | None:
        """The SAP at the destination."""
        return self.front.dsap

    @property
    def ssap(self) -> int | None:
        """The SAP at the source."""
        return self.front.ssap

    @property
    def slave(self) -> tuple[int | None, int | None]:
        """Station and SAP of the side that answers."""
        return (self.da, self.dsap) if self.request else (self.sa, self.ssap)

    @property
    def master(self) -> tuple[int | None, int | None]:
        """Station and SAP of the side that asks."""
        return (self.sa, self.ssap) if self.request else (self.da, self.dsap)


def check_byte(content: bytes) -> int:
    """The check byte of what stands between start and check byte, DA to the last byte of data."""
    return sum(content) & 0xFF


def size(data: bytes) -> int | None:
    """How many bytes the frame has that begins here (docs/profibus.md 2).

    Returns:
        None where no frame begins with this byte, where too few bytes are there to know, or where SD2 has length
        bytes that differ or that no frame has.
    """
    start = profibus.codes("start").get(data[0]) if data else None
    if start is None:
        return None
    if start.id != SD2:
        return SIZES[start.id]
    least, most = profibus.lengths()
    if len(data) < 3 or data[1] != data[2] or not least <= data[1] <= most:
        return None
    return data[1] + _HEAD + _TRAILER


def decode(data: bytes) -> Telegram:
    """The frame that these bytes are; whatever they are, with what is wrong about it (docs/profibus.md 2).

    Args:
        data: all bytes of one frame, from its start byte; further ones are a flaw.
    """
    if len(data) < _LEAST:
        return _short(data)
    begin = data[:_LEAST]
    front = _usual.get(begin)
    if front is None and begin not in _usual:
        front = _learn(begin)
    if front is not None and len(data) == data[1] + _HEAD + _TRAILER and data[-1] == END:
        fcs = data[-_TRAILER]
        if sum(data[_HEAD:-_TRAILER]) & 0xFF == fcs:
            return Telegram(front, data, data[_LEAST:-_TRAILER], fcs)
    return _decode(data)


@lru_cache(maxsize=_REMEMBERED)
def _short(data: bytes) -> Telegram:
    """A frame without data: there are few of them on a line, and they come all the time."""
    return _decode(data)


_usual: Final[dict[bytes, Front | None]] = {}
"""By the bytes of SD2 up to the function code: the front of a sound frame that begins so; None for anything else.

With its length, check byte and end byte right such a frame has no flaw, whatever its data is.
"""


def _learn(begin: bytes) -> Front | None:
    """What `_usual` says of frames that begin so, from now on."""
    front: Front | None = None
    if begin[0] == START:
        content = begin[_HEAD:].ljust(begin[1], b"\0")
        item = _decode(begin[:_HEAD] + content + bytes((check_byte(content), END)))
        front = None if item.flaws or item.dae or item.sae else item.front
    if len(_usual) >= _REMEMBERED:
        _usual.clear()
    _usual[begin] = front
    return front


def _decode(data: bytes) -> Telegram:
    """As `decode`; nothing is remembered."""
    if not data:
        return Telegram(_front("", b""), data, flaws=(Flaw("cut", 0, {"have": 0, "want": 1}),))
    start = profibus.codes("start").get(data[0])
    if start is None:
        return Telegram(_front("", b""), data, flaws=(Flaw("start", 0, {"byte": data[0]}),))
    whole, flaws = size(data), _head_flaws(start.id, data)
    if whole is None:
        return Telegram(_front(start.id, b""), data, flaws=tuple(flaws))
    flaws += _border_flaws(data, whole)
    if start.id == SC:
        return Telegram(_front(SC, b""), data, flaws=tuple(flaws))
    if start.id == SD4:
        return _token(data, flaws)
    head = _HEAD if start.id == SD2 else 1
    return _body(start.id, data, head, whole - _TRAILER, flaws)


@lru_cache(maxsize=_REMEMBERED)
def _front(kind: str, begin: bytes) -> Front:
    """What a frame begins with, of the bytes from DA to the last one in front of its data."""
    da, sa, fc = (begin[at] if at < len(begin) else None for at in range(3))
    dae, at = _extension(begin, 3, da or 0)
    sae, _ = _extension(begin, at, sa or 0)
    return Front(
        kind, None if da is None else da & _ADDRESS, None if sa is None else sa & _ADDRESS,
        fc, dae, sae,
    )  # fmt: skip


def encode(
    da: int, sa: int, fc: int, du: bytes = b"", dsap: int | None = None, ssap: int | None = None
) -> bytes:
    """The bytes of a frame: SD1 without data and SAPs, else SD2 (docs/profibus.md 2).

    Args:
        da: the station that it goes to, 0 to 127.
        sa: the station that sends it, 0 to 126.
        fc: the function code, 0 to 127.
        du: its data.
        dsap: the SAP at the destination, 0 to 63; None for none.
        ssap: the SAP at the source.

    Raises:
        ValueError: a number is too large, or the data does not fit into a frame.
    """
    if not (0 <= da <= ALL_STATIONS and 0 <= sa < ALL_STATIONS and 0 <= fc < _RESERVED):
        raise ValueError(f"no frame goes from {sa} to {da} with function code {fc}")
    saps = [sap for sap in (dsap, ssap) if sap is not None]
    if any(not 0 <= sap <= _SAP for sap in saps):
        raise ValueError(f"SAPs go from 0 to {_SAP}")
    extended = (_EXTENDED * (dsap is not None), _EXTENDED * (ssap is not None))
    content = bytes((da | extended[0], sa | extended[1], fc, *saps)) + du
    if len(content) > profibus.lengths()[1]:
        raise ValueError(f"{len(du)} bytes of data do not fit into a frame")
    trailer = bytes((check_byte(content), END))
    if len(content) == profibus.lengths()[0]:
        return b"\x10" + content + trailer
    return bytes((START, len(content), len(content), START)) + content + trailer


def _head_flaws(kind: str, data: bytes) -> list[Flaw]:
    """What is wrong with the first four bytes of SD2."""
    if kind != SD2:
        return []
    if len(data) < _HEAD - 1:
        return [Flaw("cut", 0, {"have": len(data), "want": _HEAD})]
    least, most = profibus.lengths()
    le, ler = data[1:3]
    flaws = []
    if le != ler:
        flaws.append(Flaw("lengths", 1, {"le": le, "ler": ler}))
    elif not least <= le <= most:
        flaws.append(Flaw("length", 1, {"le": le, "least": least, "most": most}))
    if len(data) >= _HEAD and data[3] != START:
        flaws.append(Flaw("second", 3, {"byte": data[3]}))
    return flaws


def _border_flaws(data: bytes, whole: int) -> list[Flaw]:
    if len(data) < whole:
        return [Flaw("cut", len(data), {"have": len(data), "want": whole})]
    if len(data) > whole:
        return [Flaw("rest", whole, {"n": len(data) - whole})]
    return []


def _token(data: bytes, flaws: list[Flaw]) -> Telegram:
    """A token has addresses alone: no check byte proves them."""
    flaws += [
        Flaw("address", at, {"address": data[at]})
        for at in (1, 2)
        if at < len(data) and data[at] >= ALL_STATIONS
    ]
    return Telegram(_front(SD4, data[1 : SIZES[SD4]]), data, flaws=tuple(flaws))


def _body(kind: str, data: bytes, head: int, end: int, flaws: list[Flaw]) -> Telegram:
    """SD1, SD2 or SD3, as far as it is there; its content stands from `head` to `end`."""
    content = data[head:end]
    if len(content) < 3:
        return Telegram(_front(kind, b""), data, flaws=tuple(flaws))
    fcs = data[end] if end < len(data) else None
    computed = check_byte(content)
    if fcs is not None and fcs != computed:
        flaws.append(Flaw("check", end, {"sent": fcs, "computed": computed}))
    if end + 1 < len(data) and data[end + 1] != END:
        flaws.append(Flaw("end_byte", end + 1, {"byte": data[end + 1]}))
    da, sa, fc = content[:3]
    if sa & _ADDRESS == ALL_STATIONS:
        flaws.append(Flaw("address", head + 1, {"address": ALL_STATIONS}))
    if fc & _RESERVED:
        flaws.append(Flaw("reserved", head + 2, {"byte": fc}))
    at = 3
    dae, at = _extension(content, at, da)
    sae, at = _extension(content, at, sa)
    if any(byte & _EXTENDED and not _whole(part) for byte, part in ((da, dae), (sa, sae))):
        flaws.append(Flaw("extension", head + at))
    return Telegram(_front(kind, content[:at]), data, content[at:], fcs, tuple(flaws))


def _extension(content: bytes, at: int, address: int) -> tuple[bytes, int]:
    """The extension bytes that an address announces, and where they end: bit 7 announces another one."""
    first, more = at, bool(address & _EXTENDED)
    while more and at < len(content):
        more = bool(content[at] & _EXTENDED)
        at += 1
    return content[first:at], at


def _whole(extension: bytes) -> bool:
    return bool(extension) and not extension[-1] & _EXTENDED


def _sap(extension: bytes) -> int | None:
    """The SAP among extension bytes; those with bit 6 name a segment of the net."""
    return next((byte & _SAP for byte in extension if not byte & _SEGMENT), None)
