"""Which frames somebody wants, and what to say about each of them.

From the result of an analysis and a `Selection` to frame numbers with comments. No file is opened here,
and what belongs together on the wire (fragments) is the business of `messages`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from ds47.model import PKW, S7, CaptureResult, Finding, Parameter, Transaction
from ds47.report.formatting import address, escape
from ds47.report.sentences import message
from ds47.report.targets import Targets

_PARAMETERS_SHOWN = 4


class SelectionError(Exception):
    """Something is asked for that this capture does not have; the message says what it has."""


@dataclass(frozen=True, slots=True)
class Selection:
    """What somebody asked for: all criteria must apply, of each criterion one value is enough.

    Attributes:
        transactions: (first, last) ids.
        rules: rule ids or prefixes.
        devices: IP addresses, MAC addresses or station names.
        states: states of transactions.
        start: from when on, nanoseconds since 1970.
        end: until when, inclusive.
        all_frames: frames of other protocols, too (where whole frames are chosen: see `by_frame`).
    """

    transactions: tuple[tuple[int, int], ...] = ()
    rules: tuple[str, ...] = ()
    devices: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    start: int | None = None
    end: int | None = None
    all_frames: bool = False

    @property
    def by_frame(self) -> bool:
        """Whether frames are chosen by what they are, not by the transaction they belong to."""
        return not (self.transactions or self.rules or self.states)

    def in_time(self, time_ns: int) -> bool:
        """Whether a time lies inside the span."""
        return (self.start is None or time_ns >= self.start) and (
            self.end is None or time_ns <= self.end
        )


@dataclass(slots=True)
class Chosen:
    """The outcome for one capture.

    Attributes:
        frames: numbers of the frames that complete a wanted message; empty where `by_frame`.
        notes: what to say about a frame, by its number.
        ips: of the wanted devices; empty for all.
        macs: of the wanted devices, as text.
        transactions: those that were chosen; all where `by_frame`.
    """

    frames: set[int] = field(default_factory=set)
    notes: dict[int, list[str]] = field(default_factory=dict)
    ips: set[str] = field(default_factory=set)
    macs: set[str] = field(default_factory=set)
    transactions: list[Transaction] = field(default_factory=list)


def choose(
    result: CaptureResult, selection: Selection, names: dict[str, str] | None = None
) -> Chosen:
    """Applies a selection to the result of an analysis.

    Args:
        result: a complete one, with its transactions.
        selection: what is wanted.
        names: rule id -> name, to say these instead of the messages (which may hold names and values).

    Raises:
        SelectionError: a transaction or a device that this capture does not have.
    """
    chosen, targets = Chosen(), Targets(result.transactions)
    _find_devices(result, selection, chosen)
    _check_numbers(result, selection)
    findings: dict[int | None, list[Finding]] = {}
    for finding in result.findings:
        findings.setdefault(finding.transaction, []).append(finding)
    for transaction in result.transactions:
        own = findings.get(transaction.id, [])
        if not selection.by_frame and not _wanted(transaction, own, selection, chosen):
            continue
        chosen.transactions.append(transaction)
        _note_transaction(chosen, transaction, targets.place(transaction))
        _note_findings(chosen, own, names)
        if not selection.by_frame:
            chosen.frames.update(transaction.frames.all())
            chosen.frames.update(frame for pair in transaction.segments for frame in pair if frame)
            chosen.frames.update(each.frame for each in own)
    if not selection.by_frame:
        _add_descriptions(result, chosen)
    _lonely(chosen, findings.get(None, []), selection, names)
    return chosen


def _add_descriptions(result: CaptureResult, chosen: Chosen) -> None:
    """What the drive had said of the chosen parameters comes along: the copy names and measures them, too."""
    parameters = [item for each in chosen.transactions for item in each.parameters]
    said = {frame for item in parameters for frame in item.described_in or ()}
    for each in result.transactions:
        if each.frames.read_response in said:
            chosen.frames.update(each.frames.all())


def chosen_of(
    result: CaptureResult,
    transactions: Iterable[Transaction],
    frames: Iterable[int],
    names: dict[str, str] | None = None,
) -> Chosen:
    """These transactions of a result, and frames beside them, with what to say about each."""
    chosen, targets = Chosen(), Targets(result.transactions)
    for each in transactions:
        chosen.transactions.append(each)
        _note_transaction(chosen, each, targets.place(each))
        chosen.frames.update(each.frames.all())
        chosen.frames.update(frame for pair in each.segments for frame in pair if frame)
    chosen.frames.update(frames)
    _add_descriptions(result, chosen)
    _note_findings(chosen, (each for each in result.findings if each.frame in chosen.frames), names)
    return chosen


def _find_devices(result: CaptureResult, selection: Selection, chosen: Chosen) -> None:
    for wanted in selection.devices:
        found = [
            each
            for each in result.devices
            if wanted.lower() in (each.ip, each.mac, (each.station or "").lower())
        ]
        if wanted.lower() in _partners(result):
            chosen.ips.add(wanted.lower())
            continue
        if not found:
            raise SelectionError(f"no device {wanted!r}; {_devices(result)}")
        chosen.ips.update(each.ip for each in found)
        chosen.macs.update(each.mac for each in found if each.mac)


def _partners(result: CaptureResult) -> set[str]:
    """What no frame names: stations of PROFIBUS, and servers of S7."""
    found = {each.device for each in result.transactions if each.station is not None}
    return found | {each.server for each in result.connections}


def _devices(result: CaptureResult) -> str:
    shown = [
        f"{each.ip} ({escape(each.station)})" if each.station else each.ip
        for each in result.devices
    ]
    shown += sorted(_partners(result) - {each.ip for each in result.devices})
    more = f" and {len(shown) - 12} more" if len(shown) > 12 else ""
    shown = shown[:12]
    return f"there are {', '.join(shown)}{more}" if shown else "the capture shows no device"


def _check_numbers(result: CaptureResult, selection: Selection) -> None:
    last = len(result.transactions)
    for first, _ in selection.transactions:
        if not 1 <= first <= last:
            there = f"it has 1 to {last}" if last else "it has none"
            raise SelectionError(f"no transaction {first}; {there}")


def _wanted(
    transaction: Transaction, findings: Iterable[Finding], selection: Selection, chosen: Chosen
) -> bool:
    numbers, rules = selection.transactions, selection.rules
    return (
        (not numbers or any(first <= transaction.id <= last for first, last in numbers))
        and (not selection.states or transaction.state in selection.states)
        and (not rules or any(each.rule.startswith(rules) for each in findings))
        and (not chosen.ips or transaction.device in chosen.ips)
        and selection.in_time(transaction.start_ns)
    )


def _lonely(
    chosen: Chosen, findings: list[Finding], selection: Selection, names: dict[str, str] | None
) -> None:
    """Findings that belong to no transaction: only where a rule is asked for, and nothing narrower."""
    if selection.rules and not (selection.transactions or selection.states):
        findings = [each for each in findings if each.rule.startswith(selection.rules)]
        chosen.frames.update(each.frame for each in findings)
    elif not selection.by_frame:
        return
    _note_findings(chosen, findings, names)


def _note_transaction(chosen: Chosen, item: Transaction, where: str) -> None:
    head = f"{item.channel.upper()} #{item.id}"
    state = "" if item.state == "ok" else f" [{item.state}]"
    about = _parameters(item.parameters) if item.channel != S7 else _items(item)
    what = f"{item.operation} {about}".strip()
    axis = f", {where}" if where else ""
    for role, number in _roles(item):
        if number is not None:
            text = f"{head}{state}: {role} ({what}{axis})"
            chosen.notes.setdefault(number, []).append(text)


def _roles(item: Transaction) -> Iterator[tuple[str, int | None]]:
    frames = item.frames
    if item.channel in (PKW, S7) and not item.segments:
        yield "request", frames.write_request
        yield "response", frames.read_response
        return
    if item.channel == S7:
        for number, (request, response) in enumerate(item.segments, 1):
            yield f"segment {number}", request
            yield f"segment {number}, acknowledged", response
        return
    yield "Write request", frames.write_request
    yield "Write response", frames.write_response
    for number, (request, response) in enumerate(frames.polls, 1):
        yield f"poll {number}, Read request", request
        yield f"poll {number}, not ready", response
    yield "Read request", frames.read_request
    yield "Read response", frames.read_response
    for number, (request, response) in enumerate(frames.rereads, 1):
        yield f"read again {number}, Read request", request
        yield f"read again {number}, Read response", response


def _items(item: Transaction) -> str:
    shown = ", ".join(each.address or "?" for each in item.items[:_PARAMETERS_SHOWN])
    if item.r_id is not None:
        shown = f"R_ID {item.r_id:08X}"
    more = len(item.items) - _PARAMETERS_SHOWN
    return f"{shown} and {more} more" if more > 0 and item.r_id is None else shown


def _parameters(items: list[Parameter]) -> str:
    shown = ", ".join(address(each) for each in items[:_PARAMETERS_SHOWN])
    more = len(items) - _PARAMETERS_SHOWN
    return f"{shown} and {more} more" if more > 0 else shown


def _note_findings(
    chosen: Chosen, findings: Iterable[Finding], names: dict[str, str] | None
) -> None:
    for each in findings:
        text = message(each) if names is None else names.get(each.rule, "")
        chosen.notes.setdefault(each.frame, []).append(f"{each.rule} {each.severity}: {text}")
