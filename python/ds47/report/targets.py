"""What requests address, in words: a drive object only if the capture proves it.

`profidrive.drive_objects` decides which requests reach the same drive object. Here it gets a name: `DO 2`;
`axis 9` for an axis byte that names none, or one that the device lacks; or the slot if only that is known.
`Telegrams` knows what it exchanges in cyclic data.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from ds47.model import DS47, ODD, PZD, REFUTED, CaptureResult, Transaction
from ds47.profidrive.drive_objects import LOCAL, DriveObjects, Identity, access_of
from ds47.report.bilingual import Both, joined, say
from ds47.report.sentences import slot_number

ANSWERED = ("ok", "partial", "error")
"""States of a transaction with a response."""


_Way = tuple[str, int | None, int | None, int | None, int | None, int | None]
_WAYS: Final = 4096
_SELECTION: Final = 922
"""The parameter with the telegram of a drive object; 999 is free configuration."""
_LOCAL: Final = (LOCAL, None)
"""Record indices of requests that reach the drive object of their submodule; PKW has none."""


class Targets:
    """The names in one capture."""

    def __init__(self, transactions: Iterable[Transaction]) -> None:
        self._shown = DriveObjects.of(transactions)
        self._identities: dict[_Way, Identity] = {}
        """A cache, valid until the next transaction."""

    def transaction(self, item: Transaction) -> None:
        """Takes one more transaction."""
        self._shown.transaction(item)
        self._identities.clear()

    def drive_object(self, item: Transaction) -> int | None:
        """The number of the drive object that a request reaches; None if it is unknown or does not exist."""
        return self._shown.reached(item)

    def words(self, item: Transaction) -> str:
        """`DO 2`, `axis 0`; empty if only the submodule is known."""
        number = self._shown.reached(item)
        if number is not None:
            return f"DO {number}"
        return "" if item.axis is None or item.index in _LOCAL else f"axis {item.axis}"

    def where(self, item: Transaction, *, with_slot: bool = False) -> str:
        """The same with the slot in front, if asked for or if the submodule decides."""
        where = slot(item) if with_slot or item.index in _LOCAL else ""
        channel = "" if item.channel == DS47 else item.channel.upper()
        return " ".join(filter(None, (where, self.words(item), channel)))

    def identity(self, item: Transaction, pnu: int | None = None) -> Identity:
        """What transactions that reach the same drive object share; for one PNU, if given."""
        way = item.device, item.index, item.slot, item.subslot, item.axis, pnu
        found = self._identities.get(way)
        if found is None:
            if len(self._identities) >= _WAYS:
                self._identities.clear()
            found = self._identities[way] = self._shown.identity(access_of(item), pnu)
        return found

    def labels(self, transactions: Sequence[Transaction]) -> dict[Identity, str]:
        """A name for each drive object of the page, unique on each device."""
        ways: dict[tuple[object, ...], Transaction] = {}
        for each in transactions:
            ways.setdefault((each.device, each.index, each.slot, each.subslot, each.axis), each)
        first: dict[Identity, Transaction] = {}
        for each in ways.values():
            first.setdefault(self.identity(each), each)
        names: dict[tuple[str, str], list[Identity]] = {}
        for key, item in first.items():
            known = self.words(item)
            name = known or (slot(item) if item.index in _LOCAL else "")
            names.setdefault((item.device, name), []).append(key)
        labels: dict[Identity, str] = {}
        for (_, name), keys in names.items():
            for key in keys:
                alone = len(keys) == 1 or not key.by_submodule
                labels[key] = name if alone else f"{slot(first[key])} {name or 'axis ?'}"
        return labels


def slot(item: Transaction) -> str:
    """`slot 1.1`, on PROFIBUS `slot 1`; empty for a channel named by hand."""
    return "" if item.slot is None else f"slot {slot_number(item.slot, item.subslot)}"


class Telegrams:
    """The PROFIdrive telegrams of one capture.

    The drive says them in p0922. If nobody reads that, the lengths of cyclic data may leave only one.
    """

    def __init__(self, result: CaptureResult, targets: Targets | None = None) -> None:
        told = list(_told(result.evidence))
        self._targets = targets or Targets(result.evidence if told else ())
        self._said: dict[Identity, tuple[str, int]] = {
            self._targets.identity(item, _SELECTION): (item.device, number) for item, number in told
        }
        self._lengths = {
            (each.device, each.slot): each.telegrams[0]
            for each in result.entire.relations
            if each.channel == PZD
            and len(each.telegrams) == 1
            and each.certainty not in (ODD, REFUTED)
        }
        self._slots = {(item.device, item.slot) for item, _ in told}

    def of(self, item: Transaction) -> int | None:
        """The telegram of the drive object that a transaction reaches; None if unknown."""
        if self._said:
            said = self._said.get(self._targets.identity(item, _SELECTION))
            if said is not None:
                return said[1]
        return self._lengths.get((item.device, item.slot))

    def words(self, ip: str) -> Both | None:
        """`telegram 102` (the device says so), `lengths fit telegram 1`; None if unknown."""
        said = {number for device, number in self._said.values() if device == ip}
        lengths = {
            number
            for place, number in self._lengths.items()
            if place[0] == ip and place not in self._slots
        }
        found = [
            say(key, numbers=", ".join(map(str, sorted(numbers))))
            for key, numbers in (("drive_telegram", said), ("drive_lengths", lengths))
            if numbers
        ]
        return joined(found) if found else None


def _told(transactions: list[Transaction]) -> Iterator[tuple[Transaction, int]]:
    """Transactions with the telegram of a drive object, and its number."""
    for item in transactions:
        if item.state not in ("ok", "partial") or item.operation not in ("read", "change"):
            continue
        for each in item.parameters:
            if each.pnu != _SELECTION or each.error is not None or each.attribute != "value":
                continue
            number = each.values[0] if each.values else None
            if isinstance(number, int) and 0 < number <= 999:
                yield item, number
