"""The name, unit and type of a parameter: one door to all sources.

The first source that has a thing wins. First comes what the drive itself said in this capture (descriptions,
attribute 0x20; docs/protocol.md C), then spec/parameters.toml and drives.toml, if they cover the maker of the
device. A description holds for the drive object that was asked, and for other requests if `drive_objects` proves
that they reach the same one. `ds47.acyclic.learning` decides which responses to believe. No words here.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from ds47 import spec
from ds47.model import SIEMENS, Described, Parameter, Transaction, Value
from ds47.profidrive.description import Description, describe
from ds47.profidrive.drive_objects import DriveAccess, DriveObjects, access_of
from ds47.spec import descriptions

_UNKNOWN: Final = "unknown"
"""The type of a parameter, if no source knows it."""
_WHOLE: Final = 0
"""The subindex of a whole description."""
_WAYS: Final = 16
"""How many accesses to remember for the descriptions of a parameter; the least recent one is forgotten first."""
_NO_TYPES: Final = (0x00, 0x40, 0x44)
"""Codes that are never the type of a parameter: Reserved; Zero and Error of a value block."""
_INTEGERS: Final = range(0x02, 0x08)
"""Codes of the integers that are scaled: a double holds them exactly."""
_UNSIGNED: Final = {"Unsigned8": "Byte", "Unsigned16": "Word", "Unsigned32": "DoubleWord"}
"""Types with the same values in a format that gives only their size."""
_FLOATS: Final = (0x08, 0x0F)
_POWERS: Final = 22
"""The largest power of ten that a double holds exactly."""


class Statement(NamedTuple):
    """One element of a description, and the frame of the response."""

    value: Any
    frame: int


class Measure(NamedTuple):
    """The power of ten that scales an integer, and the unit after scaling."""

    power: int
    unit: str
    frames: tuple[int, ...]
    """The descriptions it comes from."""


class Meaning(NamedTuple):
    """What is known about a parameter; None for what no source says.

    Attributes:
        listed: its row in the tables, if one covers this device.
        name: from the drive.
        type: name of its data type, from the drive.
        measure: scale and unit of values of this type, from the drive.
        low, high: its limits in that type, from the drive.
    """

    listed: spec.Pnu | None
    name: Statement | None = None
    type: Statement | None = None
    measure: Measure | None = None
    low: Statement | None = None
    high: Statement | None = None

    @property
    def is_said(self) -> bool:
        """Whether the drive has said anything about it."""
        return any(each is not None for each in self[1:])

    def fits(self, format_name: str | None) -> bool:
        """Whether a value in this format has the type that the drive says."""
        if self.type is None:
            return False
        own = self.type.value
        return format_name in (None, own) or _UNSIGNED.get(own) == format_name


def family_of(vendor_id: int | None, family: str | None = None) -> str:
    """The family of parameters of a vendor's device: "sinamics", "micromaster", or "profile" for all others.

    On PROFINET no device of Siemens is a MICROMASTER. Its numbers mean other things: 1082 is a frequency there
    and a speed on SINAMICS. On PROFIBUS the ident number gives the family.
    """
    return family or ("sinamics" if vendor_id == SIEMENS else "profile")


def listed(pnu: int | None, vendor_id: int | None, family: str | None = None) -> spec.Pnu | None:
    """The row in spec/parameters.toml or drives.toml for a parameter of a device of this vendor."""
    return None if pnu is None else spec.parameter(pnu, family_of(vendor_id, family))


def unit_of(row: spec.Pnu | None, format_name: str | None) -> str | None:
    """The unit of the tables for values in a format; None if the tables have another type."""
    if row is None or format_name is None:
        return None if row is None else row.unit
    own = row.type.partition("[")[0]
    fits = "Float32" if own == _UNKNOWN else own
    return row.unit if format_name in (fits, _UNSIGNED.get(fits)) else None


def changes_itself(pnu: int, vendor_id: int | None, family: str | None = None) -> bool:
    """Whether a drive may change a parameter itself, by any table; for other makers only by the profile."""
    if vendor_id in (None, SIEMENS) or family is not None:
        return pnu in spec.changing()
    row = spec.parameter(pnu)
    return row is not None and row.volatile


def is_known(pnu: int, vendor_id: int | None, family: str | None = None) -> bool:
    """Whether a device has such a parameter; if its maker is unknown, whether any device has it."""
    if vendor_id is None and family is None:
        return pnu in spec.parameters()
    return listed(pnu, vendor_id, family) is not None


class Dictionary:
    """What the descriptions of a capture have said so far; they win over the tables.

    Args:
        objects: what the capture shows about drive objects; the caller keeps it up to date.
        most: how many descriptions are remembered; the least recent one is forgotten first.
    """

    def __init__(self, objects: DriveObjects, most: int) -> None:
        self._objects = objects
        self._most = most
        self._said: OrderedDict[tuple[DriveAccess, int], dict[str, Statement]] = OrderedDict()
        self._ways: dict[tuple[str, int], list[DriveAccess]] = {}
        """Device and PNU -> accesses that brought a description, the newest last."""
        self.is_empty = True
        """Whether no description was learned."""

    def learn(
        self,
        access: DriveAccess,
        pnu: int,
        subindex: int,
        format_name: str | None,
        values: Sequence[Value],
        frame: int,
    ) -> None:
        """A description was read, whole or one element of it; an absurd one is not believed.

        It replaces what was said before: the elements it has, or all of them if it is whole.

        Args:
            access: of the request.
            pnu: of the parameter.
            subindex: 0 for all elements, else the number of one.
            format_name: of the values.
            values: as the decoder shows them.
            frame: of the response.
        """
        found = describe(subindex, format_name, values)
        if found is None or not _is_sensible(found):
            return
        key = access, pnu
        said = {"whole": Statement(True, frame)} if subindex == _WHOLE else self._said.get(key, {})
        said.update({name: Statement(value, frame) for name, value in _parts(found)})
        if not said:
            return
        self._said[key], self.is_empty = said, False
        self._said.move_to_end(key)
        self._note_way(access, pnu)
        if len(self._said) > self._most:
            self._forget(*next(iter(self._said)))

    def _note_way(self, access: DriveAccess, pnu: int) -> None:
        ways = self._ways.setdefault((access.device, pnu), [])
        if access in ways:
            ways.remove(access)
        elif len(ways) == _WAYS:
            self._forget(ways[0], pnu)
        self._ways.setdefault((access.device, pnu), ways).append(access)

    def _forget(self, access: DriveAccess, pnu: int) -> None:
        del self._said[access, pnu]
        ways = self._ways[access.device, pnu]
        ways.remove(access)
        if not ways:
            del self._ways[access.device, pnu]

    def meaning(
        self,
        access: DriveAccess,
        pnu: int,
        vendor_id: int | None,
        until: int | None = None,
        family: str | None = None,
    ) -> Meaning:
        """What is known about a parameter.

        Args:
            access: of the request.
            pnu: its number.
            vendor_id: PROFINET vendor id of the device; None if unknown.
            until: descriptions after this frame do not count; None: all so far count.
            family: of its parameters, if the capture gives it.
        """
        known = listed(pnu, vendor_id, family)
        said: dict[str, Statement] = {}
        for way in self._ways.get((access.device, pnu), ()):
            if self._objects.same(access, way, pnu):
                _add_newer(said, self._said[way, pnu], until)
        whole = said.pop("whole", None)
        if whole is not None:
            said = {name: each for name, each in said.items() if each.frame >= whole.frame}
        if not said:
            return Meaning(known)
        kind = said.get("type")
        return Meaning(
            known, said.get("name"), kind, kind and _measure(kind, said), said.get("low"), said.get("high")
        )  # fmt: skip


def explain_transaction(
    dictionary: Dictionary, item: Transaction, vendor_id: int | None, family: str | None = None
) -> None:
    """Adds to a transaction of PKW what the drive has said about its parameters up to its response."""
    if dictionary.is_empty:
        return
    access, last = access_of(item), item.frames.read_response
    for each in item.parameters:
        if each.pnu is not None and each.attribute == "value":
            explain(each, dictionary.meaning(access, each.pnu, vendor_id, last, family))


def _add_newer(said: dict[str, Statement], more: dict[str, Statement], until: int | None) -> None:
    """Adds what another access brought, if it is newer, but nothing from frames after `until`."""
    for name, each in more.items():
        before = said.get(name)
        if (until is None or each.frame <= until) and (
            before is None or before.frame <= each.frame
        ):
            said[name] = each


def _is_sensible(found: Description) -> bool:
    """Whether a description makes sense: an existing type, a name of printable characters."""
    if found.type is not None:
        row = spec.format_named(found.type)
        if row is None or row.code in _NO_TYPES:
            return False
    return found.name is None or all(" " <= char <= "~" or char > "\xa0" for char in found.name)


def _parts(found: Description) -> list[tuple[str, Any]]:
    """The parts of a description to remember. An empty name does not count."""
    variable = None if found.quantity is None else (found.quantity, found.conversion)
    relevant = None
    if found.identifier is not None:
        relevant = not found.identifier >> descriptions.bits()["irrelevant"] & 1
    parts = (
        ("type", found.type), ("relevant", relevant), ("name", found.name or None),
        ("variable", variable), ("factor", found.factor), ("low", found.low), ("high", found.high),
    )  # fmt: skip
    return [(name, value) for name, value in parts if value is not None]


def _measure(kind: Statement, said: dict[str, Statement]) -> Measure | None:
    """Scale and unit of values, if all elements about them agree."""
    variable, factor = said.get("variable"), said.get("factor")
    plain = _code(kind.value) in (*_INTEGERS, *_FLOATS)
    if variable is None or not plain or not said["relevant"].value:
        return None
    quantity, power = variable.value
    unit, known = descriptions.unit(quantity, power), descriptions.quantities().get(quantity)
    if unit is None or known is None:
        return None
    # Sources disagree on the direction of the factor, so it must only repeat the conversion index.
    if factor and factor.value not in (1.0, float(f"1e{power}"), float(f"1e{-power}")):
        return None
    frames = {each.frame for each in (kind, variable, factor) if each is not None}
    if not unit.startswith("10^"):
        return Measure(0, unit, tuple(sorted(frames)))
    if _code(kind.value) not in _INTEGERS or abs(power) > _POWERS:
        return None
    return Measure(power, known.unit, tuple(sorted(frames)))


def _code(type_name: str) -> int | None:
    row = spec.format_named(type_name)
    return None if row is None else row.code


def scaled(values: Sequence[Value], power: int) -> list[Value] | None:
    """Integers times a power of ten; None if one of them is not an integer."""
    found: list[Value] = []
    times = 10 ** abs(power)
    for value in values:
        if not isinstance(value, int):
            return None
        found.append(value * float(times) if power > 0 else value / times)
    return found if found and power else None


def explain(item: Parameter, meaning: Meaning) -> None:
    """Adds to a parameter what the drive has said about it: its name; unit and physical values, if they fit."""
    frames = set() if meaning.name is None else {meaning.name.frame}
    fits, measure = meaning.fits(item.format), meaning.measure
    if item.format is None and item.values:
        fits = False  # a number of elements of PKW
    if fits and measure is not None and item.scaled is None:
        item.unit, frames = measure.unit, frames.union(measure.frames)
        item.scaled = scaled(item.values, measure.power)
    elif meaning.type is not None:
        row = meaning.listed
        if row is None or row.type.removesuffix("[]") != meaning.type.value:
            item.unit = None  # the unit of the list belongs to another parameter
    if frames:
        name = None if meaning.name is None else meaning.name.value
        item.described = Described(name, tuple(sorted(frames)))
