"""The drives of a capture with what was asked of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from ds47.model import S7, CaptureResult, Device, Transaction
from ds47.report.html.texts import Both, joined
from ds47.report.latency import percentile
from ds47.report.targets import ANSWERED, Targets, Telegrams
from ds47.report.verdict import by_state


@dataclass(slots=True)
class DriveView:
    """A device that was asked for parameters."""

    device: Device
    telegram: Both | None = None
    objects: set[int] = field(default_factory=set)
    """Drive objects that answered, by their numbers."""
    controllers: set[str] = field(default_factory=set)
    operations: Counter[str] = field(default_factory=Counter)
    states: Counter[str] = field(default_factory=Counter)
    durations: list[int] = field(default_factory=list)

    @property
    def outcomes(self) -> Both:
        """How many of its transactions have each state."""
        return joined(by_state(self.states))

    @property
    def median(self) -> int | None:
        """The middle of the times from request to response, in ns."""
        return percentile(self.durations, 50) if self.durations else None

    @property
    def slowest(self) -> int | None:
        """The longest time from request to response, in ns."""
        return self.durations[-1] if self.durations else None


def drives(result: CaptureResult, targets: Targets | None = None) -> list[DriveView]:
    """The drives in the order of their first transaction."""
    known: dict[str, DriveView] = {}
    targets = targets or Targets(result.evidence)
    telegrams = Telegrams(result, targets)
    found: dict[str, DriveView] = {}
    named = result.named()
    for item in result.transactions:
        if item.channel == S7:
            continue  # its partners are no drives
        if item.device not in known:
            device = named(item.device)
            known[item.device] = found.setdefault(
                device.ip, DriveView(device, telegrams.words(device.ip))
            )
        _count(known[item.device], item, targets)
    for drive in found.values():
        drive.durations.sort()
    return list(found.values())


def _count(drive: DriveView, item: Transaction, targets: Targets) -> None:
    drive.operations[item.operation] += 1
    drive.states[item.state] += 1
    drive.controllers.add(item.controller)
    number = targets.drive_object(item)
    if number is not None and item.state in ANSWERED:
        drive.objects.add(number)
    if item.duration_ns is not None and item.duration_ns >= 0:
        drive.durations.append(item.duration_ns)
