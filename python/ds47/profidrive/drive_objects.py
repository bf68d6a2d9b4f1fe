"""Which drive object a request reaches, and whether two requests reach the same one (docs/pairing.md, P60).

A parameter is (device, drive object, PNU, subindex). Index 47 and 0xB02F reach the drive object of the axis
byte; 0xB02E reaches the one of its submodule, whatever the axis byte says. Only the capture can show which
submodule that is, and whether a device uses the axis byte at all. Nothing is guessed: without proof, two drive
objects are neither the same nor different. No values and no findings live here.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable
from typing import Final, NamedTuple, TypeVar

from ds47.model import Parameter, Transaction
from ds47.spec.semantics import known

LOCAL: Final = 0xB02E
"""Record index of local access: the submodule decides, not the axis byte (docs/protocol.md E.4)."""
DO_IDENTIFICATION: Final = 975
"""PNU of the DO identification; element 7 is the DO-ID (docs/protocol.md D.1)."""
_DO_ID: Final = 7
SELECTION: Final = 922
"""PNU that says the telegram of a drive object; 999 is free configuration."""
_MOST: Final = 0xFFFF
"""The largest DO-ID."""


class DriveAccess(NamedTuple):
    """How a request reaches a parameter. `axis` is None if the axis byte does not count."""

    device: str
    record_index: int
    slot: int | None
    subslot: int | None
    axis: int | None

    @property
    def local(self) -> bool:
        """Whether the submodule decides."""
        return self.record_index == LOCAL


class Identity(NamedTuple):
    """What all requests for the same drive object share."""

    device: str
    number: int | None = None
    """Its DO-ID; None if it is unknown, or does not matter."""
    slot: int | None = None
    """With `subslot`: the submodule, if the number alone does not identify the drive object."""
    subslot: int | None = None
    local: bool = False
    axis: int | None = None

    @property
    def by_submodule(self) -> bool:
        """Whether another submodule may be another drive object."""
        return self.slot is not None


class DriveObjects:
    """What a capture has shown about the drive objects of its devices so far.

    Memory is bounded: the oldest entry goes first, and what it proved is unknown again.
    """

    def __init__(self) -> None:
        self._submodules: OrderedDict[tuple[str, int | None, int | None], int | None] = (
            OrderedDict()
        )
        """DO-ID of a submodule, from PNU 975; None if two reads differ."""
        self._distinguishing: OrderedDict[str, None] = OrderedDict()
        """Devices that have refused an axis number, and so use the axis byte."""
        self.missing: OrderedDict[tuple[str, int], None] = OrderedDict()
        """Device and an axis number that does not exist there."""
        self.telegrams: OrderedDict[Identity, int] = OrderedDict()
        """The number of the telegram (p0922) that a drive object has said last."""

    @classmethod
    def of(cls, transactions: Iterable[Transaction]) -> DriveObjects:
        """What a whole capture shows."""
        shown = cls()
        for each in transactions:
            shown.transaction(each)
        return shown

    # What is seen

    def transaction(self, item: Transaction) -> None:
        """A finished transaction; a response that belongs to another request proves nothing."""
        if item.operation not in ("read", "change") or item.state == "mismatch":
            return
        for each in item.parameters:
            if each.error is not None:
                self.refused(access_of(item), each.error.code)
            elif each.pnu == DO_IDENTIFICATION and item.operation == "read":
                first = each.subindex if each.attribute == "value" else None
                if first is not None:
                    self.identified(access_of(item), first, each.values)
            elif each.pnu == SELECTION and (number := telegram_said(item, each)):
                put(self.telegrams, self.identity(access_of(item), SELECTION), number)

    def refused(self, access: DriveAccess, code: int | None) -> None:
        """A parameter got a negative response with this error number."""
        if code != known().axis_error or access.local:
            return
        put(self._distinguishing, access.device, None)
        if access.axis is not None:
            put(self.missing, (access.device, access.axis), None)

    def identified(self, access: DriveAccess, first: int, values: Iterable[object]) -> None:
        """PNU 975 was read, from element `first` on."""
        if not access.local:
            return
        for element, value in enumerate(values, first):
            if element == _DO_ID and isinstance(value, int) and 0 <= value <= _MOST:
                key = access.device, access.slot, access.subslot
                seen = self._submodules.get(key, value)
                put(self._submodules, key, value if seen == value else None)

    # What that proves

    def number(self, access: DriveAccess) -> int | None:
        """The DO-ID of the drive object that a request reaches; None without proof.

        Axis 0 is the device itself, or its only drive object: it names none.
        """
        if access.local:
            return self._submodules.get((access.device, access.slot, access.subslot))
        return access.axis or None

    def reached(self, item: Transaction) -> int | None:
        """The number of the drive object that is reached; None if it is unknown or does not exist.

        Addresses of S7 name it; a job that names several has None.
        """
        if item.items:
            named = {each.drive_object for each in item.items}
            return (named.pop() or None) if len(named) == 1 else None
        device, number = item.device, item.axis or None
        if item.index is None or item.index == LOCAL:
            number = self._submodules.get((device, item.slot, item.subslot))
        return number if number is not None and (device, number) not in self.missing else None

    def telegram(self, item: Transaction) -> int | None:
        """The telegram that the drive object has said before which is reached; None for none."""
        return self.telegrams.get(self.identity(access_of(item), SELECTION))

    def exists(self, device: str, number: int) -> bool:
        """False if the device has said that there is no such drive object."""
        return (device, number) not in self.missing

    def looks_at_axis(self, device: str) -> bool:
        """Whether the device has refused an axis number, and so uses the axis byte."""
        return device in self._distinguishing

    def same(self, one: DriveAccess, other: DriveAccess, pnu: int) -> bool:
        """Whether two requests for a parameter provably reach the same drive object."""
        if one.device != other.device:
            return False
        if pnu in known().global_pnus or _is_same_way(one, other):
            return True
        mine, theirs = self.number(one), self.number(other)
        if mine is None or mine != theirs:
            return False
        # A device that has shown no use of the axis byte may go by the submodule alone.
        return (one.local and other.local) or one.device in self._distinguishing

    def identity(self, access: DriveAccess, pnu: int | None = None) -> Identity:
        """Two requests have equal identities if and only if `same` is true for them."""
        if pnu is not None and pnu in known().global_pnus:
            return Identity(access.device)
        number = self.number(access)
        if number is not None and access.device in self._distinguishing:
            return Identity(access.device, number)
        if number is not None and access.local:
            return Identity(access.device, number, local=True)
        return Identity(access.device, None, access.slot, access.subslot, access.local, access.axis)

    def other(self, one: DriveAccess, other: DriveAccess, pnu: int) -> bool:
        """Whether two requests provably reach different drive objects."""
        if one.device != other.device:
            return True
        mine, theirs = self.number(one), self.number(other)
        if pnu in known().global_pnus or mine is None or theirs is None or mine == theirs:
            return False
        return (one.local and other.local) or one.device in self._distinguishing


def telegram_said(item: Transaction, parameter: Parameter) -> int | None:
    """The number of the telegram, if a parameter of a transaction says it: p0922, read or changed."""
    if item.state not in ("ok", "partial") or item.operation not in ("read", "change"):
        return None
    if parameter.pnu != SELECTION or parameter.error is not None or parameter.attribute != "value":
        return None
    number = parameter.values[0] if parameter.values else None
    if isinstance(number, int | float) and number % 1 == 0 and 0 < number <= 999:
        return int(number)
    return None


def access_of(item: Transaction) -> DriveAccess:
    """How the request of a transaction reaches its parameters; PKW goes by the submodule."""
    index = LOCAL if item.index is None else item.index
    return access(item.device, index, item.slot, item.subslot, item.axis)


def access(
    device: str, record_index: int, slot: int | None, subslot: int | None, axis: int | None
) -> DriveAccess:
    """An access; a local one ignores the axis byte."""
    return DriveAccess(device, record_index, slot, subslot, None if record_index == LOCAL else axis)


def _is_same_way(one: DriveAccess, other: DriveAccess) -> bool:
    """The same submodule, and the same axis byte if it counts: the same request twice."""
    if (one.slot, one.subslot, one.local) != (other.slot, other.subslot, other.local):
        return False
    return one.local or one.axis == other.axis


_K = TypeVar("_K")
_V = TypeVar("_V")


def put(memory: OrderedDict[_K, _V], key: _K, value: _V) -> _V:
    """Remembers a value as the newest one and returns it; beyond the limit the oldest one is forgotten."""
    memory[key] = value
    memory.move_to_end(key)
    if len(memory) > known().history:
        memory.popitem(last=False)
    return value
