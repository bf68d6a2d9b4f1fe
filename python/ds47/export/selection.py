"""The wanted frames, and what to say about each of them.

From the result of an analysis and a `Selection` (`ds47.report.selection`) to frame numbers with comments. No file
is opened here, and what belongs together on the wire (fragments) is the business of `messages`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from ds47.model import CHANNELS, DS47, PKW, PZD, S7, CaptureResult, Finding, Parameter, Transaction
from ds47.report.formatting import address
from ds47.report.selection import Selection, SelectionError, Wanted
from ds47.report.sentences import message
from ds47.report.targets import Targets
from ds47.spec import rules

__all__ = ["Chosen", "Selection", "SelectionError", "choose", "chosen_of", "refuse_others"]

_PARAMETERS_SHOWN = 4


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
    wanted, targets = Wanted(result, selection), Targets(result.transactions)
    wanted.check()
    chosen = Chosen(ips=wanted.ips, macs=wanted.macs)
    for transaction in result.transactions:
        if not selection.by_frame and not wanted.transaction(transaction):
            continue
        own = wanted.findings.get(transaction.id, [])
        chosen.transactions.append(transaction)
        _note_transaction(chosen, transaction, targets.where(transaction))
        _note_findings(chosen, own, names)
        if not selection.by_frame:
            chosen.frames.update(transaction.frames.all())
            chosen.frames.update(frame for pair in transaction.segments for frame in pair if frame)
            chosen.frames.update(each.frame for each in own)
    if not selection.by_frame:
        _add_descriptions(result, chosen)
    if selection.states or selection.rules:  # who names transactions, gets these
        _add_causes(result, chosen, targets)
    _lonely(chosen, wanted.findings.get(None, []), selection, names)
    return chosen


def refuse_others(result: CaptureResult, chosen: Chosen, *, by_frame: bool) -> None:
    """Refuses to anonymise what is chosen and no message of DS47 on PROFINET: nothing in it is replaced.

    Raises:
        SelectionError: what that is, and how to leave it out.
    """
    ips = chosen.ips
    if result.bus is not None or any(each.station is not None for each in result.transactions):
        names = ["PROFIBUS"]
    else:
        found = {
            each.channel
            for each in chosen.transactions
            if not ips or each.device in ips or each.controller in ips
        }
        if by_frame:
            drives = {result.relations[each.relation - 1].device for each in result.timelines}
            servers = {host for each in result.connections for host in (each.client, each.server)}
            found |= {PZD for each in drives if not ips or each in ips}
            found |= {S7 for each in servers if not ips or each in ips}
        names = [each.upper() for each in CHANNELS if each in found and each != DS47]
    if names:
        apart = "leave them out with --channels ds47, or " if any(result.rpc.values()) else ""
        text = f"frames of {' and '.join(names)} cannot be anonymised"
        raise SelectionError(f"{text}: {apart}export without --anonymise")


def _add_descriptions(result: CaptureResult, chosen: Chosen) -> None:
    """What the drive had said of the chosen parameters comes along: the copy names and measures them, too."""
    parameters = [item for each in chosen.transactions for item in each.parameters]
    said = {frame for item in parameters for frame in item.described_in or ()}
    for each in result.transactions:
        if each.frames.read_response in said:
            chosen.frames.update(each.frames.all())


def _add_causes(result: CaptureResult, chosen: Chosen, targets: Targets) -> None:
    """What a cause of the chosen transactions names comes along, or the copy would have another cause."""
    ids = {each.id for each in chosen.transactions}
    causes = [each for each in result.diagnoses if not ids.isdisjoint(each.transactions)]
    named = {frame for each in causes for frame in rules()[each.rule].named_frames(each.args)}
    for each in result.transactions:
        if each.id not in ids and not named.isdisjoint(each.frames.all()):
            chosen.frames.update(each.frames.all())
            _note_transaction(chosen, each, targets.where(each))


def chosen_of(
    result: CaptureResult, transactions: Iterable[Transaction], frames: Iterable[int]
) -> Chosen:
    """These transactions of a result, and frames beside them, with what to say about each."""
    chosen, targets = Chosen(), Targets(result.transactions)
    for each in transactions:
        chosen.transactions.append(each)
        _note_transaction(chosen, each, targets.where(each))
        chosen.frames.update(each.frames.all())
        chosen.frames.update(frame for pair in each.segments for frame in pair if frame)
    chosen.frames.update(frames)
    _add_descriptions(result, chosen)
    _note_findings(chosen, (each for each in result.findings if each.frame in chosen.frames), None)
    return chosen


def _lonely(
    chosen: Chosen, findings: list[Finding], selection: Selection, names: dict[str, str] | None
) -> None:
    """Findings that belong to no transaction: only where a rule is asked for, and nothing narrower."""
    if selection.rules and not selection.narrow:
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
