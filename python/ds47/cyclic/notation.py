"""A readable line to the eight bytes of a PKW request.

    pkw read p700                       AK 1
    pkw read p2010[1]                   AK 1 with a subindex, as MICROMASTER takes it
    pkw read array p7841[2]             AK 6, for drives that want it for an array
    pkw count p2900                     AK 9: how many elements
    pkw change p1082=Float32:40.0       AK 2 or 3 by the size of the value; with an index 7 or 8
    pkw change eeprom p1082=REAL:40     AK 11 to 14: the value outlives the supply

Parameters and values are written as for DS47 (`ds47.profidrive.notation`).
"""

from __future__ import annotations

from ds47.cyclic import pkw
from ds47.profidrive.model import VALUE, Block
from ds47.profidrive.naming import element
from ds47.profidrive.notation import parse_request_line
from ds47.spec import cyclic

PREFIX = "pkw"
"""The word with which a line is one of PKW."""
_READ, _READ_ARRAY, _COUNT = 1, 6, 9
_EXAMPLE = "for example: pkw read p700, pkw change p1082=Float32:40.0"


def is_pkw(line: str) -> bool:
    """Whether a readable line is one of PKW."""
    return line.split(maxsplit=1)[:1] == [PREFIX]


def encode_line(line: str, layout: str = pkw.CYCLIC, eeprom: bool = False) -> bytes:
    """The bytes of the request that a line describes (see the top of this file).

    Raises:
        ValueError: the line cannot be understood, or PKW cannot say it; the message says why.
    """
    words = line.split()[1:]
    verb = words.pop(0).lower() if words else ""
    if verb not in ("read", "count", "change", "write"):
        raise ValueError(f"after pkw comes read, count or change; {_EXAMPLE}")
    array = verb == "read" and words[:1] == ["array"]
    stored = verb in ("change", "write") and words[:1] == ["eeprom"]
    rest = " ".join(words[int(array or stored) :])
    operation = "change" if verb in ("change", "write") else "read"
    request = parse_request_line(f"{operation} {rest}")
    if len(request.addresses) != 1:
        raise ValueError("PKW asks for one parameter at a time")
    (address,) = request.addresses
    if address.attribute != VALUE:
        raise ValueError("PKW reads attributes with AK 4 and 15, which this line has no words for")
    if address.element_count > 1:
        raise ValueError(
            f"PKW carries one value; ask for {element(address.pnu, address.subindex)} alone"
        )
    indexed = address.element_count == 1 and "[" in rest.partition("=")[0]
    if operation == "change":
        (block,) = request.blocks
        value = _bytes(block)
        ak = _change(len(value) * 8, indexed, eeprom or stored)
        return pkw.encode(ak, address.pnu, address.subindex, value, layout)
    if eeprom:
        raise ValueError("only a change goes to the EEPROM")
    ak = _COUNT if verb == "count" else _READ_ARRAY if array else _READ
    return pkw.encode(ak, address.pnu, address.subindex, layout=layout)


def _bytes(block: Block) -> bytes:
    """The value as two or four bytes."""
    raw = block.raw
    if len(raw) not in (1, 2, 4):
        raise ValueError(
            f"a value of {block.format_name} has {len(raw)} bytes, and PKW takes one, two or four"
        )
    return raw.rjust(2, b"\0")


def _change(width: int, array: bool, eeprom: bool) -> int:
    return next(
        row.ak
        for row in cyclic.requests().values()
        if row.access == "change" and (row.width, row.array, row.eeprom) == (width, array, eeprom)
    )
