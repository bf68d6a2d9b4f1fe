"""Whose device a code is from: a maker by its name or its PROFINET vendor id, and what it is called."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass

from ds47 import spec
from ds47.spec import explanations, maker_names


@dataclass(frozen=True, slots=True)
class Maker:
    """A maker by its name, None where nobody knows whose the id is, and its id, None where no source has it."""

    name: str | None
    id: int | None = None


def find_vendor(text: str) -> Maker:
    """The vendor by its name, or by its PROFINET vendor id in hex (0x002A) or decimal.

    Raises:
        UnclearNameError: neither an id nor the name of one maker; it tells which names are near.
    """
    wanted = unicodedata.normalize("NFKC", text).strip()
    if number := re.fullmatch(r"(?:0x|16#)([0-9a-f]{1,4})|([0-9]{1,5})", wanted.lower()):
        value = int(number[1], 16) if number[1] else int(number[2])
        return Maker(spec.vendor_names().get(value), value)
    return Maker(*maker_names.find(wanted))


def called(whose: Maker, lang: str) -> str:
    """`Yaskawa (vendor 0x0213)`."""
    if whose.id is None:
        return whose.name or ""
    name = spec.called(whose.id, lang)
    return explanations.words(lang)["maker_with_id"].format(maker=name, vendor=f"0x{whose.id:04X}")
