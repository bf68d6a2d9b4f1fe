"""The PROFIdrive telegram of a drive object, as the capture tells it.

The drive itself says it in p0922. Where nobody asks for that, the lengths of the cyclic data may leave only one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from ds47.model import ODD, PZD, REFUTED, CaptureResult, Transaction
from ds47.profidrive.drive_objects import Identity
from ds47.report.bilingual import Both, joined, say
from ds47.report.targets import Targets

_SELECTION: Final = 922
_LARGEST: Final = 999
"""Free configuration."""


class Telegrams:
    """The telegrams of one capture."""

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
        """That of the drive object that a transaction reaches; None where nothing tells it."""
        if self._said:
            said = self._said.get(self._targets.identity(item, _SELECTION))
            if said is not None:
                return said[1]
        return self._lengths.get((item.device, item.slot))

    def words(self, ip: str) -> Both | None:
        """`telegram 102` of a device, as it says, `lengths of telegram 1`; None where nothing tells it."""
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
    """Transactions that say the telegram, and which."""
    for item in transactions:
        if item.state not in ("ok", "partial") or item.operation not in ("read", "change"):
            continue
        for each in item.parameters:
            if each.pnu != _SELECTION or each.error is not None or each.attribute != "value":
                continue
            number = each.values[0] if each.values else None
            if isinstance(number, int) and 0 < number <= _LARGEST:
                yield item, number
