"""One frame of PROFIBUS: start byte, addresses, function code, SAPs, data, check byte (docs/profibus.md 2).

Decodes the bytes of one frame; `dp` and `ms1` decode its data.
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
"""SD2 has START twice. END ends every frame but SD4 and SC."""
ALL_STATIONS: Final = 127
"""The broadcast address."""
SIZES: Mapping[str, int] = {SD1: 6, SD3: 14, SD4: 3, SC: 1}
"""The bytes of frames with a fixed length."""

_REQUEST, _FCB, _FCV, _RESERVED = 0x40, 0x20, 0x10, 0x80
_EXTENDED, _ADDRESS = 0x80, 0x7F
_SEGMENT, _SAP = 0x40, 0x3F
_TRAILER: Final = 2
"""Check byte and end byte."""
_HEAD: Final = 4
"""The head of SD2: start byte, both length bytes, start byte."""
_LEAST: Final = 7
"""The bytes of SD2 up to the function code: longer than a frame without data."""
_REMEMBERED: Final = 1024
"""The size of each cache, for fronts and for short frames."""


@dataclass(slots=True, init=False, eq=False)
class Front:
    """The beginning of a frame, decoded; None or empty for what is missing or unknown.

    Frames with the same beginning share one object.
    """

    kind: str
    """SD1 to SD4 or SC; empty if no frame begins like this."""
    da: int | None
    sa: int | None
    """The stations, without the bit that announces an extension."""
    fc: int | None
    dae: bytes
    sae: bytes
    """The extension bytes."""
    request: bool | None
    """True for a request of a master, False for an answer, None without a function code."""
    code: int | None
    """The function, bits 3 to 0 of the function code."""
    fcb: int | None
    """The frame count bit of a request; a repeated value marks a retry, if `fcv` is 1."""
    fcv: int | None
    """Whether `fcb` counts: 0 in the first request to a station."""
    dsap: int | None
    """The SAP at the destination."""
    ssap: int | None
    """The SAP at the source."""
    way: bytes
    """The stations as two bytes, source and destination; empty without them."""
    back: bytes
    """`way` reversed."""
    service: str | None
    """The service (`spec.profibus.service_id`)."""
    silent: bool
    """Whether this request gets no answer."""
    exchanges: bool
    """Whether this answer has data of data exchange; SC has none."""
    wants: bool
    """Whether the slave asks for Slave_Diag in this answer."""

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
    """A frame; `front` is its beginning.

    `flaws` are about the frame itself: with any of them its content is not reliable.
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
        """The bytes define a frame, but its flaws may come from the bytes around it."""
        return isinstance(other, Telegram) and self.data == other.data and self.flaws == other.flaws

    def __hash__(self) -> int:
        return hash(self.data)

    @property
    def kind(self) -> str:
        """As in `Front`, like the next ones."""
        return self.front.kind

    @property
    def da(self) -> int | None:
        """The destination station."""
        return self.front.da

    @property
    def sa(self) -> int | None:
        """The source station."""
        return self.front.sa

    @property
    def fc(self) -> int | None:
        """The function code."""
        return self.front.fc

    @property
    def request(self) -> bool | None:
        """Whether it is a request of a master."""
        return self.front.request

    @property
    def code(self) -> int | None:
        """The function."""
        return self.front.code

    @property
    def dsap(self) -> int | None:
        """The SAP at the destination."""
        return self.front.dsap

    @property
    def ssap(self) -> int | None:
        """The SAP at the source."""
        return self.front.ssap

    @property
    def proved(self) -> bool:
        """Whether it has a check byte and an end byte, and both are right."""
        return not self.flaws and self.kind not in (SC, SD4)


def check_byte(content: bytes) -> int:
    """The check byte of the content of a frame, DA to the last byte of data."""
    return sum(content) & 0xFF


def size(data: bytes) -> int | None:
    """The length of the frame that begins here (docs/profibus.md 2).

    Returns:
        None if no frame begins with this byte, if there are too few bytes to know, or if the length bytes of SD2
        differ or are out of range.
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
    """The frame in these bytes, with its flaws; takes any bytes (docs/profibus.md 2).

    `data`: all bytes of one frame, from its start byte; extra ones are a flaw.
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
    """A frame without data, cached: a line has few of them, and repeats them all the time."""
    return _decode(data)


_usual: Final[dict[bytes, Front | None]] = {}
"""The bytes of SD2 up to the function code -> the front of a sound frame with this beginning, or None.

If length, check byte and end byte are right, such a frame has no flaw, whatever its data is.
"""


def _learn(begin: bytes) -> Front | None:
    """Adds the entry of `_usual` for this beginning."""
    front: Front | None = None
    if begin[0] == START:
        content = begin[_HEAD:].ljust(begin[1], b"\0")
        item = _decode(begin[:_HEAD] + content + bytes((check_byte(content), END)))
        front = None if item.flaws or item.front.dae or item.front.sae else item.front
    if len(_usual) >= _REMEMBERED:
        _usual.clear()
    _usual[begin] = front
    return front


def _decode(data: bytes) -> Telegram:
    """As `decode`, without a cache."""
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
    """The front of a frame, from its bytes between start byte and data."""
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
        da: the destination station, 0 to 127.
        sa: the source station, 0 to 126.
        fc: the function code, 0 to 127.
        du: its data.
        dsap: the SAP at the destination, 0 to 63; None for none.
        ssap: the SAP at the source.

    Raises:
        ValueError: a number is out of range, or the data does not fit into a frame.
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
    """A token has only addresses, and no check byte."""
    flaws += [
        Flaw("address", at, {"address": data[at]})
        for at in (1, 2)
        if at < len(data) and data[at] >= ALL_STATIONS
    ]
    return Telegram(_front(SD4, data[1 : SIZES[SD4]]), data, flaws=tuple(flaws))


def _body(kind: str, data: bytes, head: int, end: int, flaws: list[Flaw]) -> Telegram:
    """SD1, SD2 or SD3, perhaps incomplete; its content is data[head:end]."""
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
    if any(
        byte & _EXTENDED and (not part or part[-1] & _EXTENDED)
        for byte, part in ((da, dae), (sa, sae))
    ):
        flaws.append(Flaw("extension", head + at))
    return Telegram(_front(kind, content[:at]), data, content[at:], fcs, tuple(flaws))


def _extension(content: bytes, at: int, address: int) -> tuple[bytes, int]:
    """The extension bytes of an address, and where they end: bit 7 announces another one."""
    first, more = at, bool(address & _EXTENDED)
    while more and at < len(content):
        more = bool(content[at] & _EXTENDED)
        at += 1
    return content[first:at], at


def _sap(extension: bytes) -> int | None:
    """The SAP in extension bytes; bytes with bit 6 name a network segment instead."""
    return next((byte & _SAP for byte in extension if not byte & _SEGMENT), None)
