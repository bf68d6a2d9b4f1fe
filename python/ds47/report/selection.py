"""A selection of transactions by device, drive object, parameter, station, state, rule and time.

The same for `ds47 export`, which copies their frames, and for a report that shows no others (`narrowing`). Options
of the command line are `ds47.cli.selecting`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from ds47.model import S7, CaptureResult, Finding, Transaction
from ds47.profidrive.naming import spelling
from ds47.report.bilingual import Both, joined, say
from ds47.report.formatting import duration, escape
from ds47.report.targets import Targets
from ds47.report.verdict import by_state

_DEVICES_NAMED = 12


class SelectionError(Exception):
    """Something is asked for that this capture does not have; the message says what it has."""


class Selection(NamedTuple):
    """The wanted transactions: all criteria must apply, one value of each is enough.

    Attributes:
        transactions: (first, last) ids.
        rules: rule ids or prefixes.
        devices: IP addresses, MAC addresses or station names.
        states: states of transactions.
        start: from when on, nanoseconds since 1970.
        end: until when, inclusive.
        all_frames: frames of other protocols, too (where whole frames are chosen: see `by_frame`).
        stations: who asks: IP addresses, MAC addresses or station names of controllers.
        drive_objects: numbers of drive objects, where the capture proves which one is asked.
        pnus: numbers of parameters.
    """

    transactions: tuple[tuple[int, int], ...] = ()
    rules: tuple[str, ...] = ()
    devices: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    start: int | None = None
    end: int | None = None
    all_frames: bool = False
    stations: tuple[str, ...] = ()
    drive_objects: tuple[int, ...] = ()
    pnus: tuple[int, ...] = ()

    @property
    def narrow(self) -> bool:
        """Whether transactions are chosen by more than device, rule and time: what has none is left out then."""
        return bool(
            self.transactions or self.states or self.stations or self.drive_objects or self.pnus
        )

    @property
    def by_frame(self) -> bool:
        """Whether frames are chosen by what they are, not by the transaction they belong to."""
        return not (self.narrow or self.rules)

    def in_time(self, time_ns: int) -> bool:
        """Whether a time lies inside the span."""
        return (self.start is None or time_ns >= self.start) and (
            self.end is None or time_ns <= self.end
        )


class Wanted:
    """A selection in one capture.

    Args:
        result: a complete one, with its transactions.
        selection: what is wanted.
    """

    def __init__(self, result: CaptureResult, selection: Selection) -> None:
        self._result, self._selection = result, selection
        self.findings: dict[int | None, list[Finding]] = {}
        """By transaction; under None those of no transaction."""
        for each in result.findings:
            self.findings.setdefault(each.transaction, []).append(each)
        self._partners = _partners(result)
        self.ips: set[str] = set()
        """Of the devices; empty for all."""
        self.macs: set[str] = set()
        for name in selection.devices:
            ips, macs = self._named(name, self._partners)
            self.ips |= ips
            self.macs |= macs
        self._askers: set[str] = set()
        askers = {each.controller for each in result.transactions}
        for name in selection.stations:
            self._askers |= self._named(name, askers)[0]
        self._targets = Targets(result.evidence) if selection.drive_objects else None

    def _named(self, name: str, addresses: Iterable[str]) -> tuple[set[str], set[str]]:
        """The IP and MAC addresses that a name stands for; `addresses` are those that no device needs to have."""
        name = name.lower()
        found = [
            each for each in self._result.devices
            if name in (each.ip, each.mac, (each.station or "").lower())
        ]  # fmt: skip
        if not found and name in addresses:
            return {name}, set()
        return {each.ip for each in found}, {each.mac for each in found if each.mac}

    def check(self) -> None:
        """Looks whether what is named is there.

        Raises:
            SelectionError: a transaction or a device that this capture does not have.
        """
        for name in self._selection.devices:
            if not any(self._named(name, self._partners)):
                raise SelectionError(f"no device {name!r}; {self.devices()}")
        last = len(self._result.transactions)
        for first, _ in self._selection.transactions:
            if not 1 <= first <= last:
                there = f"it has 1 to {last}" if last else "it has none"
                raise SelectionError(f"no transaction {first}; {there}")

    def devices(self) -> str:
        """What there is: `there are 192.168.0.5 (press-1), 192.168.0.6`."""
        return there_are(names(self._result))

    def transaction(self, item: Transaction) -> bool:
        """Whether a transaction is wanted."""
        return self._fits(item) and (
            self._targets is None
            or self._targets.drive_object(item) in self._selection.drive_objects
        )

    def unproved(self, item: Transaction) -> bool:
        """Whether it would be wanted if its drive object were the one that is; nothing proves which it is."""
        return (
            self._targets is not None
            and item.channel != S7
            and self._targets.drive_object(item) is None
            and self._fits(item)
        )

    def _fits(self, item: Transaction) -> bool:
        """Whether all but the drive object is as it is wanted."""
        asked, findings = self._selection, self.findings.get(item.id, ())
        return (
            (
                not asked.transactions
                or any(first <= item.id <= last for first, last in asked.transactions)
            )
            and (not asked.states or item.state in asked.states)
            and (not asked.devices or item.device in self.ips)
            and (not asked.stations or item.controller in self._askers)
            and (not asked.pnus or any(each.pnu in asked.pnus for each in item.parameters))
            and (not asked.rules or any(each.rule.startswith(asked.rules) for each in findings))
            and asked.in_time(item.start_ns)
        )


class There:
    """What captures have where nothing of them is wanted: someone who misspelt a name looks for the right one."""

    def __init__(self) -> None:
        self._devices: dict[str, None] = {}
        self._parameters: set[str] = set()
        self._states: Counter[str] = Counter()
        self._rules: set[str] = set()
        self._objects: set[int] = set()
        self._newest = 0
        self._captures = self._length = 0

    def add(self, result: CaptureResult) -> None:
        """Takes a whole result."""
        self._devices |= dict.fromkeys(names(result))
        self._states.update(each.state for each in result.transactions)
        self._rules |= {each.rule for each in result.findings}
        self._rules |= {each.rule for each in result.diagnoses}
        self._objects |= {each.drive_object for each in result.transactions if each.drive_object}
        self._newest = max(self._newest, len(result.transactions))
        self._captures += 1
        self._length = max(self._length, (result.end_ns or 0) - (result.start_ns or 0))
        self._parameters |= {
            spelling(each.pnu, each.family)
            for item in result.transactions
            for each in item.parameters
            if each.pnu is not None
        }

    def words(self, selection: Selection) -> Both:
        """What there is of the kind that is asked for, else the devices: `there are 140 ok, 55 error`."""
        parts = []
        if selection.states and self._states:
            number = self._states.total()
            parts.append(say("there_are", n=number, list=joined(by_state(self._states))))
            if self._states["superseded"]:
                parts.append(say("there_superseded"))
        if selection.rules and self._rules:
            parts.append(say("there_are", n=len(self._rules), list=listed(sorted(self._rules))))
        if selection.transactions and self._newest:
            parts.append(say("there_transactions", last=self._newest))
        if selection.drive_objects:
            numbers = [f"DO {each}" for each in sorted(self._objects)]
            key = "there_are" if numbers else "there_no_object"
            parts.append(say(key, n=len(numbers), list=listed(numbers)))
        if selection.pnus and self._parameters:
            parts.append(say("there_parameters", list=listed(sorted(self._parameters))))
        if selection.start is not None or selection.end is not None:
            parts.append(say("there_length", n=self._captures, length=duration(self._length)))
        if not parts:
            devices = list(self._devices)
            key = "there_are" if devices else "there_no_device"
            parts.append(say(key, n=len(devices), list=listed(devices)))
        return joined(parts, "; ", "；")


def names(result: CaptureResult) -> list[str]:
    """The devices that can be asked for, with the names of stations behind their addresses."""
    shown = [
        f"{each.ip} ({escape(each.station)})" if each.station else each.ip
        for each in result.devices
    ]
    return shown + sorted(_partners(result) - {each.ip for each in result.devices})


def there_are(devices: list[str]) -> str:
    """`there are 192.168.0.5 (press-1), 192.168.0.6`; of many the first ones."""
    key = "there_are" if devices else "there_no_device"
    return say(key, n=len(devices), list=listed(devices)).en


def listed(names: list[str]) -> str:
    """The first of several names, and how many more there are."""
    left_out = len(names) - _DEVICES_NAMED
    more = f" and {left_out} more" if left_out > 0 else ""
    return ", ".join(names[:_DEVICES_NAMED]) + more


def _partners(result: CaptureResult) -> set[str]:
    """What no frame names: stations of PROFIBUS, with records or without, and servers of S7."""
    found = {each.device for each in result.transactions if each.station is not None}
    if result.bus is not None:
        slaves = (each for each in result.bus.stations if each.role != "master")
        found |= {f"dp{each.address}" for each in slaves}
    return found | {each.server for each in result.connections}
