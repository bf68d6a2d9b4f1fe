"""What values of profile parameters mean: 964, 965, 974 and 975, telegrams of 922, addresses of 61000 and on.

Stands behind the values in a line; docs/protocol.md D has the layouts. What a value does not say is left out.
lua/ds47/report/profile.lua says the same.
"""

from __future__ import annotations

from collections.abc import Iterator

from ds47 import spec
from ds47.model import Parameter, Value
from ds47.report.bilingual import Both, joined, say
from ds47.report.escaping import quoted
from ds47.spec import cyclic

_CLASSES = {1: "profile_axis", 5: "profile_encoder"}
_PROFILES = {0x03: "profile_profidrive", 0x3D: "profile_of_encoders"}
NUMBERS = frozenset((922, 964, 965, 974, 975, 61000, 61001, 61002, 61003, 61004))
"""Parameters whose values are explained here."""
_SIEMENS = (spec.SINAMICS, spec.MICROMASTER)
"""Families of the only maker whose telegrams are known."""
_MOST_NAME = 240
"""Characters of a name of station."""


def meaning(item: Parameter) -> Both | None:
    """What values of the profile mean; None of any other parameter, or where they say it themselves.

    Args:
        item: with a number, a subindex and values, and no error.
    """
    if item.pnu not in NUMBERS or item.subindex is None:
        return None
    if item.pnu in (964, 974, 975):
        found = list(_elements(item.pnu, item.subindex, item.values))
        return joined(found) if found else None
    if item.pnu == 922:
        return _telegram(item.values[0], item.family)
    if item.pnu == 965:
        return _profile(item.values)
    return _address(item.pnu, item.values[0])


def _elements(pnu: int, first: int, values: list[Value]) -> Iterator[Both]:
    """The elements of 964, 974 and 975, each for itself; year and day together."""
    known = {first + at: value for at, value in enumerate(values) if _is_number(value)}
    for subindex, value in known.items():
        if pnu == 974:
            words = _limit(subindex, value)
        elif subindex in (3, 4) and 3 in known and 4 in known:
            words = _date(known[3], known[4]) if subindex == 3 else None
        else:
            words = _identification(pnu, subindex, value)
        if words is not None:
            yield words


def _is_number(value: Value) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 0xFFFF


def _limit(subindex: int, value: Value) -> Both | None:
    assert isinstance(value, int)
    if subindex == 0:
        return say("profile_block", n=value)
    if subindex == 1:
        return say("profile_parameters", n=value)
    return say("profile_latency", n=value * 10) if subindex == 2 and value else None


def _identification(pnu: int, subindex: int, value: Value) -> Both | None:
    assert isinstance(value, int)
    if subindex == 0:
        return say("profile_maker", id=f"0x{value:04X}")
    if subindex == 1:
        return say("profile_device" if pnu == 964 else "profile_do_type", n=str(value))
    if subindex == 2:
        return say("profile_version", version=f"{value // 100}.{value % 100:02}")
    if subindex == 5:
        if pnu == 964:
            return say("profile_objects", n=value)
        return say(_CLASSES[value]) if value in _CLASSES else None
    return say("profile_do_id", n=str(value)) if subindex == 7 and pnu == 975 else None


def _date(year: Value, ddmm: Value) -> Both | None:
    """`2014-03-15`, where there is such a day."""
    assert isinstance(year, int)
    assert isinstance(ddmm, int)
    day, month = divmod(ddmm, 100)
    if not (1 <= day <= 31 and 1 <= month <= 12 and 1990 <= year <= 2199):
        return None
    return Both.same(f"{year}-{month:02}-{day:02}")


def telegram(number: int, family: str | None) -> cyclic.PzdTelegram | None:
    """A telegram whose words are known; that of a maker only for the `family` of its drives."""
    known = cyclic.telegrams().get(number)
    if known is None or not known.is_known or (known.vendor is not None and family not in _SIEMENS):
        return None
    return known


def _telegram(value: Value, family: str | None) -> Both | None:
    """The name of a telegram, and its words where they are known."""
    if not _is_number(value) or not 0 < int(value) < 999:
        return None
    shown = say("profile_standard" if int(value) < 100 else "profile_own", n=str(value))
    known = telegram(int(value), family)
    if known is None:
        return shown
    words = f"{' '.join(known.out)} / {' '.join(known.inward)}"
    return shown.joined(Both.same(words), ": ", "：")


def _profile(values: list[Value]) -> Both | None:
    """`PROFIdrive 4.1` of 0x0329, whatever the format of the two bytes."""
    first = values[0]
    if isinstance(first, str):
        number = int(first, 16) if len(first) == 4 and _is_hex(first) else None
    elif len(values) == 2 and all(_is_number(each) and int(each) <= 0xFF for each in values):
        number = int(first) << 8 | int(values[1])
    else:
        number = int(first) if _is_number(first) else None
    if number is None or number >> 8 not in _PROFILES:
        return None
    version = f"{(number & 0xFF) // 10}.{(number & 0xFF) % 10}"
    return say(_PROFILES[number >> 8], version=version)


def _is_hex(text: str) -> bool:
    return all(char in "0123456789abcdefABCDEF" for char in text)


def _address(pnu: int, value: Value) -> Both | None:
    """A name of station, an IP address, a MAC address, of octets in hex."""
    if not isinstance(value, str) or not _is_hex(value) or len(value) % 2:
        return None
    octets = bytes.fromhex(value)
    if pnu in (61001, 61003, 61004) and len(octets) == 4:
        return Both.same(".".join(map(str, octets)))
    if pnu == 61002 and len(octets) == 6:
        return Both.same(octets.hex(":"))
    text = octets.rstrip(b"\0 ")
    if (
        pnu == 61000
        and text
        and len(text) <= _MOST_NAME
        and all(0x20 < each < 0x7F for each in text)
    ):
        return Both.same(quoted(text.decode("ascii")))
    return None
