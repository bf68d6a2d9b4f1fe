"""One frame of PROFIBUS: start byte, addresses, function code, SAPs, data, check byte (docs/profibus.md 2).

Here is one frame whose bytes are in hand; what its data says is `dp` and `ms1`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ds47.spec import profibus

SD1, SD2, SD3, SD4, SC = "SD1", "SD2", "SD3", "SD4", "SC"
START, END = 0x68, 0x16
"""What begins SD2, twice, and what ends every frame but SD4 and SC."""
ALL_STATIONS = 127
"""The address that stands for all of them."""
SIZES: Mapping[str, int] = {SD1: 6, SD3: 14, SD4: 3, SC: 1}
"""Bytes of the frames that have always as many."""

_REQUEST, _FCB, _FCV, _RESERVED = 0x40, 0x20, 0x10, 0x80
_EXTENDED, _ADDRESS = 0x80, 0x7F
_SEGMENT, _SAP = 0x40, 0x3F
_TRAILER = 2
"""Check byte and end byte."""
_HEAD = 4
"""Start byte, both length bytes, start byte: what SD2 begins with."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """What is wrong, where, and with which numbers; the words are in `spec.profibus`."""

    kind: str
    """One of `spec.profibus.flaw_ids()`."""
    offset: int
    """Bytes from the beginning of what was decoded."""
    args: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Telegram:
    """A frame; what it does not have, or what cannot be known of it, is None or empty.

    `da` and `sa` are the stations without the bit that announces an extension; `dae` and `sae` the extension
    bytes. `flaws` are those of the frame itself: with one of them none of its content is proved.
    """

    kind: str
    """SD1 to SD4 or SC; empty where no frame begins so."""
    data: bytes
    da: int | None = None
    sa: int | None = None
    fc: int | None = None
    dae: bytes = b""
    sae: bytes = b""
    du: bytes = b""
    fcs: int | None = None
    """The check byte as it was sent."""
    flaws: tuple[Flaw, ...] = ()

    @property
    def request(self) -> bool | None:
        """Whether a master asks or says something; False for an answer, None without a function code."""
        return None if self.fc is None else bool(self.fc & _REQUEST)

    @property
    def code(self) -> int | None:
        """The function, bits 3 to 0 of the function code."""
        return None if self.fc is None else self.fc & 0x0F

    @property
    def fcb(self) -> int | None:
        """The frame count bit of a request; the same again is a retry, where `fcv` is 1."""
        return int(bool(self.fc & _FCB)) if self.fc is not None and self.request else None

    @property
    def fcv(self) -> int | None:
        """Whether `fcb` counts: 0 in the first request to a station."""
        return int(bool(self.fc & _FCV)) if self.fc is not None and self.request else None

    @property
    def dsap(self) -> int | None:
        """The SAP at the destination."""
        return _sap(self.dae)

    @property
    def ssap(self) -> int | None:
        """The SAP at the source."""
        return _sap(self.sae)

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
    if not data:
        return Telegram("", data, flaws=(Flaw("cut", 0, {"have": 0, "want": 1}),))
    start = profibus.codes("start").get(data[0])
    if start is None:
        return Telegram("", data, flaws=(Flaw("start", 0, {"byte": data[0]}),))
    whole, flaws = size(data), _head_flaws(start.id, data)
    if whole is None:
        return Telegram(start.id, data, flaws=tuple(flaws))
    flaws += _border_flaws(data, whole)
    if start.id == SC:
        return Telegram(SC, data, flaws=tuple(flaws))
    if start.id == SD4:
        return _token(data, flaws)
    head = _HEAD if start.id == SD2 else 1
    return _body(start.id, data, head, whole - _TRAILER, flaws)


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
    da, sa = ((data[at] & _ADDRESS if at < len(data) else None) for at in (1, 2))
    return Telegram(SD4, data, da, sa, flaws=tuple(flaws))


def _body(kind: str, data: bytes, head: int, end: int, flaws: list[Flaw]) -> Telegram:
    """SD1, SD2 or SD3, as far as it is there; its content stands from `head` to `end`."""
    content = data[head:end]
    if len(content) < 3:
        return Telegram(kind, data, flaws=tuple(flaws))
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
    stations = da & _ADDRESS, sa & _ADDRESS
    return Telegram(kind, data, *stations, fc, dae, sae, content[at:], fcs, tuple(flaws))


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
