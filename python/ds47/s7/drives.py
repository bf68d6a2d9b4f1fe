"""Which servers of S7 are drives, and what their addresses stand for (docs/s7.md 8).

A SINAMICS answers GET and PUT with its parameters: the data block is the parameter, the address 1024 x drive
object + index. Elements lie one address apart and share no bytes. What is said of it stands elsewhere.
"""

from __future__ import annotations

import struct
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from ds47 import model
from ds47.model import SIEMENS, Parameter
from ds47.profidrive.dictionary import family_of, listed, unit_of
from ds47.profidrive.formats import codec
from ds47.s7.addresses import text
from ds47.s7.blocks import ANYBODY
from ds47.s7.model import DB, DONE, GET, PUT, S7Address, S7Item, S7Job, SzlEvidence
from ds47.spec import format_named, s7

CHOSEN, ORDER, RECORDS, VALUES, ADDRESSES = "chosen", "order", "records", "values", "addresses"
"""What shows a drive: the user, its order number in an SZL, its parameter channel, values that share no bytes.
Addresses only suggest one."""
KIND: Final = "sinamics"
"""Its id among `spec.s7.cpus()`."""
PER_OBJECT: Final = 1024
"""Addresses of a drive object."""
SIZES: Final = {1: "Byte", 2: "Word", 4: "DoubleWord"}
"""Bytes of one element, and its format where no table says the type."""
_WIDEST: Final = max(SIZES)
_LEAST, _MOST = 1e-4, 1e9
_INDEX: Final = 100
"""Indices from here on are too rare to suggest anything."""
_BLOCK: Final = "DB"
"""Letters of data blocks."""
_KEPT: Final = 64
"""Values of a server that are remembered."""


class DriveElement(NamedTuple):
    """One element of a parameter."""

    drive_object: int
    pnu: int
    subindex: int


def element(address: S7Address | None) -> DriveElement | None:
    """What an address stands for on a drive; None where it can be no element."""
    if address is None or address.area != DB or address.size < 8 or address.start % 8:
        return None
    return _element(address.db, address.start // 8)


def element_of(item: model.Item) -> DriveElement | None:
    """The same of an item of the report."""
    db, start = item.db, item.start
    if (
        item.area != _BLOCK
        or db is None
        or start is None
        or item.length is None
        or item.bit is not None
    ):
        return None
    return _element(db, start)


def _element(db: int, byte: int) -> DriveElement:
    drive_object, subindex = divmod(byte, PER_OBJECT)
    return DriveElement(drive_object, db, subindex)


def parameter(found: DriveElement, value: bytes | None) -> Parameter:
    """The element with its value, by the type that the tables have of it, where that has as many bytes."""
    known, data = listed(found.pnu, SIEMENS), value or b""
    own = None if known is None else format_named(known.type.partition("[")[0])
    row = own if own is not None and own.size == len(data) else None
    if row is None and len(data) in SIZES:
        row = format_named(SIZES[len(data)])
    format_ = None if row is None else codec(row.code)
    values = [] if format_ is None else format_.decode(data, 1)
    real = _real(data) if row is not None and values and row.kind != "float" else None
    name = row.name if row is not None and values else None
    return Parameter(
        found.pnu, found.subindex, "value", None, known, unit_of(known, name), name,
        len(values) or None, values, value_texts=real, family=family_of(SIEMENS),
    )  # fmt: skip


def _real(data: bytes) -> dict[int | None, str] | None:
    """Four bytes as a Float32, if that is a plausible number: their type is unknown."""
    if len(data) != _WIDEST:
        return None
    (number,) = struct.unpack(">f", data)
    short = float(f"{number:.6g}")
    if not _LEAST <= abs(number) <= _MOST or struct.pack(">f", short) != data:
        return None
    return {None: f"Float32 {short}"}


@dataclass(slots=True)
class _Written:
    """The newest value that was written at an address, and whether one behind it would have changed its bytes."""

    data: bytes
    answered: int
    """Frame of the answer."""
    changed_in: int = 0
    """Frame of the answer to that one; 0 for none."""


@dataclass(slots=True)
class _Server:
    proof: str | None = None
    fits: tuple[str, DriveElement] | None = None
    """The first address that may be that of an element."""
    other: bool = False
    """Whether something was read or written that is none, or it says that it is a CPU."""
    written: OrderedDict[tuple[int, int], _Written] = field(default_factory=OrderedDict)


class Drives:
    """What the capture has shown up to now.

    Args:
        kinds: of servers by IP address, as the user says (`spec.s7.cpus`).
        shown: what else of the capture shows that an IP address is a drive: "cyclic", "device", "station";
            `s7.CPU` that it is none; None.
        most: servers that are remembered.
    """

    def __init__(
        self, kinds: Mapping[str, str], shown: Callable[[str], str | None], most: int
    ) -> None:
        self._kinds = kinds
        self._shown, self._most = shown, most
        self._servers: OrderedDict[str, _Server] = OrderedDict()

    def proof(self, ip: str) -> str | None:
        """What shows that a server is a drive; None where nothing does."""
        if self._kind(ip) == KIND:
            return CHOSEN
        server = self._servers.get(ip)
        if server is not None and server.proof:
            return server.proof
        shown = self._shown(ip)
        if shown == s7.CPU:
            return None
        if server is not None:
            server.proof = shown
        return shown

    def drive_of(self, ip: str) -> tuple[str, tuple[str, DriveElement] | None] | None:
        """The same with the first address of an element, or that addresses suggest it; None for no drive."""
        server, proof = self._servers.get(ip), self.proof(ip)
        fits = server.fits if server is not None else None
        if proof is not None:
            return proof, fits
        if (
            server is None
            or fits is None
            or server.other
            or self._kind(ip)
            or self._shown(ip) == s7.CPU
        ):
            return None
        return ADDRESSES, fits

    def _kind(self, ip: str) -> str | None:
        """What the user says that a server is."""
        return self._kinds.get(ip) or self._kinds.get(ANYBODY)

    def evidence(self, ip: str, found: SzlEvidence) -> None:
        """A server said what it is."""
        if not isinstance(found.value, str):
            return
        cpu = s7.cpu_of_order(found.value)
        if cpu is not None and cpu.id == KIND:
            self._server(ip).proof = ORDER
        elif s7.is_cpu_order(found.value):
            self._server(ip).other = True

    def forget(self, ip: str) -> None:
        """What was written to a server may be something else by now."""
        server = self._servers.get(ip)
        if server is not None:
            server.written.clear()

    def records(self, ip: str) -> None:
        """A device has a parameter channel: it is a drive."""
        server = self._server(ip)
        server.proof = server.proof or RECORDS

    def over(self, job: S7Job) -> None:
        """A job is over: its addresses, and its values, may show what the server is."""
        if job.operation not in (GET, PUT) or not job.from_client or job.answered is None:
            return
        server = self._server(job.partner.ip)
        for item in job.items if job.asked is not None else ():
            if item.code == DONE and item.address is not None:
                self._address(server, job, item.address)
                self._value(server, job, item)

    def _server(self, ip: str) -> _Server:
        server = self._servers.setdefault(ip, _Server())
        self._servers.move_to_end(ip)
        if len(self._servers) > self._most:
            self._servers.popitem(last=False)
        return server

    def _address(self, server: _Server, job: S7Job, address: S7Address) -> None:
        found = _fits(job, address)
        if found is None or listed(found.pnu, SIEMENS) is None:
            server.other = True
        elif server.fits is None:
            server.fits = text(address), found

    def _value(self, server: _Server, job: S7Job, item: S7Item) -> None:
        """A value that is still there though a later one would have changed its bytes, if these were shared.

        Zero proves nothing: with it the program of a CPU takes back what others wrote.
        """
        address, data = item.address, item.value
        if address is None or data is None or _fits(job, address) is None or not job.answered:
            return
        key, written = (address.db, address.start // 8), server.written
        if job.operation == GET:
            known = written.get(key)
            if known is None or not known.changed_in or not job.asked:
                return
            if job.asked.frame > known.changed_in and known.data == data and any(data):
                server.proof = server.proof or VALUES
            return
        for (db, start), other in written.items():
            behind = job.asked is not None and job.asked.frame > other.answered
            if (
                behind
                and db == key[0]
                and start != key[1]
                and _differ(other.data, start, data, key[1])
            ):
                other.changed_in = job.answered.frame
        written[key] = _Written(data, job.answered.frame)
        written.move_to_end(key)
        if len(written) > _KEPT:
            written.popitem(last=False)


def _fits(job: S7Job, address: S7Address) -> DriveElement | None:
    """The element that an address may stand for: a drive has slot 0, and one value at each address."""
    found, server = element(address), s7.rack_and_slot(job.connection.server_tsap)
    if found is None or server is None or server[1] or address.length not in SIZES:
        return None
    return found if found.subindex < _INDEX else None


def _differ(one: bytes, start: int, other: bytes, at: int) -> bool:
    """Whether two values would have other bytes where they lie on each other."""
    first, end = max(start, at), min(start + len(one), at + len(other))
    return first < end and one[first - start : end - start] != other[first - at : end - at]
