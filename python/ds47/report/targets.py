"""What requests address, in words: a drive object only if the capture proves it.

`profidrive.drive_objects` decides which requests reach the same drive object. Here it gets a name: `DO 2`;
`axis 9` for an axis byte that names none, or one that the device lacks; or the slot if only that is known.
`Telegrams` knows what it exchanges in cyclic data.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from ds47.model import DS47, ODD, PKW, PZD, REFUTED, CaptureResult, Transaction
from ds47.profidrive.drive_objects import (
    LOCAL,
    SELECTION,
    DriveObjects,
    Identity,
    access_of,
    telegram_said,
)
from ds47.report.bilingual import Both, joined, say
from ds47.report.profile import telegram
from ds47.report.sentences import slot_number
from ds47.spec.cyclic import PzdTelegram, telegrams

ANSWERED = ("ok", "partial", "error")
"""States of a transaction with a response."""


_Way = tuple[str, int | None, int | None, int | None, int | None, int | None]
_WAYS: Final = 4096
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

    The drive itself says them in p0922. Where nobody asks for that, the lengths of cyclic data may leave only one.
    """

    def __init__(self, result: CaptureResult, targets: Targets | None = None) -> None:
        told = list(_told(result.evidence))
        self._targets = targets or Targets(result.evidence if told else ())
        self._said: dict[Identity, _Selected] = {
            self._targets.identity(each.item, SELECTION): each for each in told
        }
        sure = [each for each in result.entire.relations if each.certainty not in (ODD, REFUTED)]
        self._lengths = {
            (each.device, each.slot): each.telegrams[0]
            for each in sure
            if each.channel == PZD and len(each.telegrams) == 1
        }
        self._pkw = {(each.device, each.slot) for each in sure if each.channel == PKW}
        self._slots = {(each.item.device, each.item.slot) for each in told}
        self._ppos = {
            f"dp{each.address}": f"PPO{each.ppo}"
            for each in (result.bus.stations if result.bus else ())
            if each.ppo is not None
        }

    @classmethod
    def tell(cls, result: CaptureResult) -> None:
        """Gives the transactions of a capture their telegrams."""
        known = cls(result)
        if known.says or known._lengths:
            for each in result.transactions:
                each.telegram = known.of(each)

    @property
    def says(self) -> bool:
        """Whether a drive says the telegram of any drive object."""
        return bool(self._said)

    def of(self, item: Transaction) -> int | None:
        """The telegram of the drive object that a transaction reaches; None if unknown."""
        if self._said:
            said = self._said.get(self._targets.identity(item, SELECTION))
            if said is not None:
                return said.number
        return self._lengths.get((item.device, item.slot))

    def words(self, ip: str) -> Both | None:
        """`DO 2, DO 3: telegram 105 without PKW` of a device, as it says, `slot 2: lengths fit telegram 1 ...`.

        Where no telegram is known, whether there is PKW: `PPO2: PKW`. None where nothing tells it.
        """
        places: dict[tuple[str, int, PzdTelegram | None], list[str]] = {}
        for identity, each in self._said.items():
            if identity.device == ip:
                reached = self._targets.drive_object(each.item)
                where = slot(each.item) if reached is None else f"DO {reached}"
                row = telegram(each.number, each.family)
                places.setdefault(("drive_telegram", each.number, row), []).append(where)
        for key in {*self._lengths, *self._pkw} - self._slots:
            device, place = key
            if device == ip:
                where = self._ppos.get(ip, "") if place is None else f"slot {place}"
                known = self._lengths.get(key)
                kind = "drive_only_pkw" if known is None else "drive_lengths"
                row = telegrams().get(
                    known or 0
                )  # it is of this maker, or the lengths would not fit
                places.setdefault((kind, known or 0, row), []).append(where)
        found = [_named(*which, where) for which, where in places.items()]
        found.sort(key=lambda each: (len(each[0]), each))
        return joined([words for _, words in found], "; ", "；") if found else None


def _named(key: str, number: int, row: PzdTelegram | None, places: list[str]) -> tuple[str, Both]:
    """Which drive objects have a telegram, and that with them; whether it has PKW, if there is a `row` of it."""
    pkw = Both.same("")
    if row is not None:
        pkw = say("drive_pkw" if row.pkw else "drive_no_pkw")
    words = say(key, number=str(number), pkw=pkw)
    where = ", ".join(sorted(filter(None, set(places)), key=lambda each: (len(each), each)))
    return where, words if not where else say("drive_place", where=where, words=words)


class _Selected(NamedTuple):
    """A transaction that says the telegram, which, and whose parameters the drive has."""

    item: Transaction
    number: int
    family: str | None


def _told(transactions: Iterable[Transaction]) -> Iterator[_Selected]:
    """Transactions that say the telegram."""
    for item in transactions:
        for each in item.parameters:
            if number := telegram_said(item, each):
                yield _Selected(item, number, each.family)
