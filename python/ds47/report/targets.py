"""What requests address, in words: a drive object only where the capture proves that it is one.

Which two requests reach the same drive object is the business of `profidrive.drive_objects`. Here it gets a name:
`DO 2`, `axis 9` for an axis byte that names none or one that the device does not have, and the slot where only
that is known.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from ds47.model import DS47, Transaction
from ds47.profidrive.drive_objects import DriveObjects, Identity, access_of
from ds47.report.sentences import slot_number

ANSWERED = ("ok", "partial", "error")
"""States of a transaction that has its response."""


_Way = tuple[str, int | None, int | None, int | None, int | None, int | None]
_WAYS: Final = 4096


class Targets:
    """The names in one capture."""

    def __init__(self, transactions: Iterable[Transaction]) -> None:
        self._shown = DriveObjects.of(transactions)
        self._identities: dict[_Way, Identity] = {}
        """Of the ways that were asked for, until something more is shown."""

    def transaction(self, item: Transaction) -> None:
        """One more transaction, and what it shows."""
        self._shown.transaction(item)
        self._identities.clear()

    def drive_object(self, item: Transaction) -> int | None:
        """The number of the drive object that a request reaches; None where it is not known or does not exist."""
        return self._shown.reached(item)

    def words(self, item: Transaction) -> str:
        """`DO 2`, `axis 0`; empty where only the submodule is known."""
        number, axis = self.drive_object(item), access_of(item).axis
        if number is not None:
            return f"DO {number}"
        return "" if axis is None else f"axis {axis}"

    def place(self, item: Transaction, *, with_slot: bool = False) -> str:
        """The same with the slot in front, if that is wanted or where the submodule decides."""
        where = slot(item) if with_slot or access_of(item).local else ""
        channel = "" if item.channel == DS47 else item.channel.upper()
        return " ".join(filter(None, (where, self.words(item), channel)))

    def identity(self, item: Transaction, pnu: int | None = None) -> Identity:
        """What two transactions have in common that reach the same drive object; for a PNU, if it is given."""
        way = item.device, item.index, item.slot, item.subslot, item.axis, pnu
        found = self._identities.get(way)
        if found is None:
            if len(self._identities) >= _WAYS:
                self._identities.clear()
            found = self._identities[way] = self._shown.identity(access_of(item), pnu)
        return found

    def labels(self, transactions: Sequence[Transaction]) -> dict[Identity, str]:
        """A name for each drive object of the page, on one device never the same for two."""
        first: dict[Identity, Transaction] = {}
        for each in transactions:
            first.setdefault(self.identity(each), each)
        names: dict[tuple[str, str], list[Identity]] = {}
        for key, item in first.items():
            known = self.words(item)
            name = known or (slot(item) if access_of(item).local else "")
            names.setdefault((item.device, name), []).append(key)
        labels: dict[Identity, str] = {}
        for (_, name), keys in names.items():
            for key in keys:
                alone = len(keys) == 1 or not key.by_submodule
                labels[key] = name if alone else f"{slot(first[key])} {name or 'axis ?'}"
        return labels


def slot(item: Transaction) -> str:
    """`slot 1.1`, on PROFIBUS `slot 1`; nothing of a channel that was named by hand."""
    return "" if item.slot is None else f"slot {slot_number(item.slot, item.subslot)}"
