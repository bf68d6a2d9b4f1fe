"""Addresses as the programs of a PLC write them: DB1.DBB0..443, DB1.DBX0.3, MW10, T5 (docs/s7.md 3).

What one stands for is in `model.S7Address`; nothing is read here.
"""

from __future__ import annotations

from ds47.s7.model import S7Address
from ds47.spec import s7

_BYTE = 8


def text(address: S7Address) -> str:
    """An address as text: one element with its own letter, several as bytes from and up to.

    What has no such notation is written as a pointer: P#DB1.DBX0.3 BYTE 4.
    """
    row = s7.areas().get(address.area)
    if row is None:
        return f"area {address.area:02X}, {_pointer('', address)}"
    if row.elements:
        last = address.start + address.count - 1
        more = f"..{last}" if address.count > 1 else ""
        return f"{row.letter}{address.start}{more}"
    front = f"{row.letter}{address.db}.{row.letter}" if row.numbered else row.letter
    size = s7.sizes().get(address.transport)
    byte, bit = divmod(address.start, _BYTE)
    if size is not None and address.count == 1:
        if size.bits == 1:
            return f"{front}X{byte}.{bit}" if row.numbered else f"{front}{byte}.{bit}"
        if size.letter and not bit:
            return f"{front}{size.letter}{byte}"
    if bit or not address.size or address.count * address.size % _BYTE or not address.count:
        return _pointer(front, address)
    return f"{front}B{byte}..{byte + address.length - 1}"


def _pointer(front: str, address: S7Address) -> str:
    """An address with its size and its count, as a pointer of the type ANY."""
    size = s7.sizes().get(address.transport)
    name = f"size {address.transport:02X}" if size is None else size.id
    letter = "X" if front and "." in front else ""
    return (
        f"P#{front}{letter}{address.start // _BYTE}.{address.start % _BYTE} {name} {address.count}"
    )
