"""The four words of PKW: bytes to their meaning, and back (docs/cyclic.md 2).

One request or one answer at a time. What belongs together, and when an answer counts, is not here.
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple, cast

from ds47.profidrive.formats import float32_value
from ds47.spec import cyclic

LENGTH = 8
CYCLIC, USS = "cyclic", "uss"
"""The layouts of IND: the page in the low byte (cyclic transfer), or in the high one (USS, data set 100)."""
ERROR, NO_RIGHTS = 7, 8
ALL_ELEMENTS = 255
"""As a subindex: the whole array."""

_WORDS = struct.Struct(">HHHH")
_AK_SHIFT, _SPM, _BASE = 12, 0x0800, 0x07FF
_NO_PAGE = 0x03
"""Bits that no page has."""
_PAGE = 2000
_MOST_PNU = 0xFFFF


class Error(NamedTuple):
    """Why a request was not executed; `code` is None where no word of the answer is an error number."""

    code: int | None


class PkwMessage(NamedTuple):
    """A request (`answer` False) or an answer; the attributes have the names of the JSON.

    `pnu` is None where page and number together are none that exists. `value` is a whole number or a
    float, None where PWE is no value. `connector` is the parameter and bit or index that a value of
    SINAMICS G120 names.
    """

    answer: bool
    ak: int
    spm: int
    pnu: int | None
    subindex: int
    layout: str
    page: int
    pwe1: int
    pwe2: int
    value: int | float | None
    error: Error | None
    connector: tuple[int, int] | None

    @property
    def fits_layout(self) -> bool:
        """Whether the page is one that exists: what is set beyond that speaks for the other layout."""
        return not self.page & _NO_PAGE and self.pnu is not None


def decode(
    data: bytes, answer: bool, layout: str = CYCLIC, family: str | None = None
) -> PkwMessage:
    """A request or an answer from its eight bytes; further ones are left alone.

    Args:
        data: the four words as they stand in the frame.
        answer: whether the drive sent it.
        layout: CYCLIC or USS.
        family: of the error numbers, one of `spec.cyclic.families()`; None takes all known ones.

    Raises:
        ValueError: there are fewer than eight bytes.
        KeyError: there is no such family.
    """
    if len(data) < LENGTH:
        raise ValueError(f"PKW is {LENGTH} bytes, and here are {len(data)}")
    pke, ind, pwe1, pwe2 = _WORDS.unpack_from(data)
    subindex, page = (ind >> 8, ind & 0xFF) if layout == CYCLIC else (ind & 0xFF, ind >> 8)
    ak = pke >> _AK_SHIFT
    width = (cyclic.answers() if answer else cyclic.requests())[ak].width
    failed = answer and ak in (ERROR, NO_RIGHTS)
    return PkwMessage(
        answer=answer,
        ak=ak,
        spm=int(bool(pke & _SPM)),
        pnu=_number(pke & _BASE, page),
        subindex=subindex,
        layout=layout,
        page=page,
        pwe1=pwe1,
        pwe2=pwe2,
        value=_value(pwe1, pwe2, width),
        error=_error(ak, pwe1, pwe2, family) if failed else None,
        connector=_connector(pwe1, pwe2) if width else None,
    )


def encode(ak: int, pnu: int, subindex: int = 0, value: bytes = b"", layout: str = CYCLIC) -> bytes:
    """The eight bytes of a request.

    Args:
        ak: what is asked for, 0 to 15.
        pnu: the parameter, 0 to 65535.
        subindex: 0 to 255; 255 is the whole array.
        value: at most four bytes, which end with PWE2.
        layout: CYCLIC or USS.

    Raises:
        ValueError: no page reaches the parameter number, or something is too large.
    """
    if not 0 <= subindex <= ALL_ELEMENTS:
        raise ValueError(f"subindex {subindex}: PKW has subindexes 0 to {ALL_ELEMENTS}")
    if len(value) > 4:
        raise ValueError(f"a value of {len(value)} bytes does not fit into PWE, which has four")
    page, base = _page(pnu)
    ind = subindex << 8 | page if layout == CYCLIC else page << 8 | subindex
    return struct.pack(">HH", ak << _AK_SHIFT | base, ind) + value.rjust(4, b"\0")


def _number(base: int, page: int) -> int | None:
    pnu = base + sum(weight for bit, weight in cyclic.weights().items() if page >> bit & 1)
    return pnu if pnu <= _MOST_PNU else None


def _page(pnu: int) -> tuple[int, int]:
    """The page byte and the number on that page."""
    if not 0 <= pnu <= _MOST_PNU:
        raise ValueError(f"PNU {pnu}: parameter numbers go from 0 to {_MOST_PNU}")
    left, page = pnu - pnu % _PAGE, 0
    for bit, weight in sorted(cyclic.weights().items(), key=lambda item: -item[1]):
        if weight <= left:
            left -= weight
            page |= 1 << bit
    return page, pnu % _PAGE


def _value(pwe1: int, pwe2: int, width: int | None) -> int | float | None:
    """A word, or a double word as what people mean by it: a float where it looks like one."""
    if width is None:
        return None
    if width == 16:
        return pwe2
    raw = struct.pack(">HH", pwe1, pwe2)
    number: float = struct.unpack(">f", raw)[0]
    least, most = cyclic.float_range()
    if math.isfinite(number) and least <= abs(number) <= most:
        return cast(float, float32_value(number))
    whole: int = struct.unpack(">i", raw)[0]
    return whole if pwe1 == 0xFFFF else whole & 0xFFFFFFFF


def _error(ak: int, pwe1: int, pwe2: int, family: str | None) -> Error:
    """The error number stands in PWE2; some manuals put it into PWE1, with 0 behind it."""
    if ak == NO_RIGHTS:
        return Error(None)
    code = pwe2 if pwe2 or not pwe1 else pwe1
    return Error(code if code in cyclic.error_codes(family) else None)


def _connector(pwe1: int, pwe2: int) -> tuple[int, int] | None:
    mark = cyclic.connector_mark()
    return (pwe1, pwe2 & ~mark & 0xFFFF) if pwe1 and pwe2 & mark == mark else None
