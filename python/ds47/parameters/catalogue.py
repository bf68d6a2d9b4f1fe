"""What a parameter or a message is on a device, of several lists: the one that is made for it most closely.

A list that names the device comes before one that names its vendor, and that before one for all devices; among
equals the one with the newest firmware, and the one that was named last. What drives say themselves is not known
here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from ds47.parameters.lists import ListedMessage, ListedParameter, ParameterList


class CatalogueEntry(NamedTuple):
    """A row and the list that has it."""

    row: ListedParameter
    list: ParameterList


class Catalogue:
    """Lists together; empty without any. `lists`: in the order in which they were named."""

    def __init__(self, lists: Iterable[ParameterList] = ()) -> None:
        ordered = sorted(lists, key=lambda each: (_closeness(each), _version(each.firmware)))
        self._lists = ordered[::-1]  # stable: of equals the one named last comes first
        self._rows = [{row.number: row for row in each.rows} for each in self._lists]
        self._messages = [
            {(each.letter, each.number): each for each in found.messages} for found in self._lists
        ]

    @property
    def is_empty(self) -> bool:
        """Whether there is no list."""
        return not self._lists

    @property
    def lists(self) -> list[ParameterList]:
        """Its lists, those that are made for devices most closely first."""
        return self._lists

    def numbers(self) -> set[int]:
        """The numbers of all parameters that a list has."""
        return {number for rows in self._rows for number in rows}

    def entries(self, number: int) -> Iterator[CatalogueEntry]:
        """What all lists say of a number, the closest first."""
        for found, rows in zip(self._lists, self._rows, strict=True):
            if number in rows:
                yield CatalogueEntry(rows[number], found)

    def row(
        self, number: int, vendor_id: int | None, device_id: int | None
    ) -> CatalogueEntry | None:
        """What a parameter is on a device.

        Args:
            number: of the parameter.
            vendor_id: PROFINET vendor id, None where it is not known.
            device_id: PROFINET device id, None where it is not known.
        """
        fitting = (each for each in self.entries(number) if fits(each.list, vendor_id, device_id))
        return next(fitting, None)

    def messages(
        self, number: int, letter: str | None = None
    ) -> Iterator[tuple[ListedMessage, ParameterList]]:
        """The texts of a fault or an alarm, those of the closest list first."""
        for found, texts in zip(self._lists, self._messages, strict=True):
            for key, each in texts.items():
                if key[1] == number and letter in (None, key[0]):
                    yield each, found

    def message(
        self, number: int, letter: str, vendor_id: int | None, device_id: int | None
    ) -> ListedMessage | None:
        """The text of a message on a device: one with this letter before any other one of its number.

        Args:
            number: of the fault or alarm.
            letter: "F" or "A".
            vendor_id: PROFINET vendor id, None where it is not known.
            device_id: PROFINET device id, None where it is not known.
        """
        fit = [each for each, found in self.messages(number) if fits(found, vendor_id, device_id)]
        return next((each for each in fit if each.letter == letter), next(iter(fit), None))


def fits(found: ParameterList, vendor_id: int | None, device_id: int | None) -> bool:
    """Whether a list is for a device: a list without an id fits all, an unknown device fits no id."""
    if found.vendor_id is not None and found.vendor_id != vendor_id:
        return False
    return not found.device_ids or device_id in found.device_ids


def _closeness(found: ParameterList) -> int:
    return 2 * bool(found.device_ids) + (found.vendor_id is not None)


def _version(text: str | None) -> tuple[int, ...]:
    """A version as numbers: 4.7 SP13 comes after 4.7."""
    return tuple(int(number) for number in re.findall(r"\d{1,9}", text or ""))
