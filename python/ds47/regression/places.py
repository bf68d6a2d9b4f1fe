"""Where two captures have the same parameter: one identity of drive objects for both sides of a difference.

Each capture proves for itself what its requests reach (`profidrive.drive_objects`). A drive may have been changed
between the two, so a proof counts only where each capture that needs it has it; without, two requests are the
same place only where they are the same way to it. No values live here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ds47.profidrive.drive_objects import DO_IDENTIFICATION, LOCAL, DriveAccess, DriveObjects
from ds47.spec.semantics import known

Json = dict[str, Any]


class Place(NamedTuple):
    """What a parameter belongs to; what is None does not count. With nothing but a device, the device itself."""

    device: str
    drive_object: int | None = None
    """The DO-ID, where it is proved."""
    slot: int | None = None
    subslot: int | None = None
    axis: int | None = None
    local: bool = False
    """Whether only 0xB02E reached it: no proof joins it with an axis."""

    @property
    def sort_key(self) -> tuple[Any, ...]:
        """Orders places by device, drive object, slot, subslot, axis."""
        numbers = (-1 if each is None else each for each in self[1:5])
        return (self.device, *numbers, self.local)


def access_of(item: Json, names: Mapping[str, str]) -> DriveAccess:
    """How the request of a transaction of the JSON report reaches its parameters."""
    axis = None if item["index"] == LOCAL else item["axis"]
    return DriveAccess(names[item["device"]], item["index"], item["slot"], item["subslot"], axis)


def attributed(capture: Json) -> Iterator[Json]:
    """The transactions with a response that surely belongs to their request."""
    return (item for item in capture["transactions"] if item["state"] not in ("mismatch", "orphan"))


class Places:
    """The places of both captures.

    Args:
        captures: the capture objects.
        names: for each the names of its devices by IP address; the same name is the same device.
    """

    def __init__(self, captures: Sequence[Json], names: Sequence[Mapping[str, str]]) -> None:
        self._shown = [_shown(*side) for side in zip(captures, names, strict=True)]
        used = [
            {access_of(item, called) for item in capture["transactions"]}
            for capture, called in zip(captures, names, strict=True)
        ]
        self._devices = [{each.device for each in side} for side in used]
        self._local = [{_submodule(each) for each in side if each.local} for side in used]

    def of(self, access: DriveAccess, pnu: int) -> Place:
        """The place that a request for this PNU reaches; equal places are provably the same."""
        device, _, slot, subslot, axis = access
        if pnu in known().global_pnus:
            return Place(device)
        if access.local:
            number = self._number(access)
            if number is None:
                return Place(device, slot=slot, subslot=subslot, local=True)
            return Place(device, number, local=not self._looks_at_axis(device))
        if axis and self._looks_at_axis(device) and self._exists(device, axis):
            return Place(device, axis)
        return Place(device, slot=slot, subslot=subslot, axis=axis)

    def are_different(self, one: Place, other: Place) -> bool:
        """Whether two places are provably different drive objects."""
        if one.device != other.device:
            return True
        if one == other:
            return False
        looks = self._looks_at_axis(one.device)
        mine, theirs = (each.drive_object or each.axis or None for each in (one, other))
        if mine is None or theirs is None or mine == theirs:
            return False
        return looks or (one.local and other.local)

    def _number(self, access: DriveAccess) -> int | None:
        """The DO-ID of a submodule, where each capture that uses it shows the same one."""
        numbers = {
            shown.number(access)
            for shown, used in zip(self._shown, self._local, strict=True)
            if _submodule(access) in used
        }
        return numbers.pop() if len(numbers) == 1 else None

    def _looks_at_axis(self, device: str) -> bool:
        return all(
            shown.looks_at_axis(device)
            for shown, devices in zip(self._shown, self._devices, strict=True)
            if device in devices
        )

    def _exists(self, device: str, axis: int) -> bool:
        return all(shown.exists(device, axis) for shown in self._shown)


def _submodule(access: DriveAccess) -> tuple[str, int | None, int | None]:
    return access.device, access.slot, access.subslot


def _shown(capture: Json, names: Mapping[str, str]) -> DriveObjects:
    """What a capture shows of the drive objects of its devices."""
    shown = DriveObjects()
    for item in attributed(capture):
        if item["operation"] not in ("read", "change"):
            continue
        access = access_of(item, names)
        for each in item["parameters"]:
            if each["error"] is not None:
                shown.refused(access, each["error"]["code"])
            elif each["pnu"] == DO_IDENTIFICATION and item["operation"] == "read":
                first = each["subindex"] if each["attribute"] == "value" else None
                if first is not None:
                    shown.identified(access, first, each["values"])
    return shown
