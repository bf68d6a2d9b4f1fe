"""A report as JSON beside the frames it was made of: transactions, findings, and where they meet the capture."""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any

from tests.audit import dp, message, wire
from tests.audit.gaps import Gaps

NOT_READY, SHORT = 0xDE80B500, 0xDE80B100
_TERM = re.compile(r"frame\.number == (\d+)|frame\.number in \{(\d+)\.\.(\d+)\}")


@dataclass(frozen=True)
class Complaint:
    """Something that the report says and that is not so."""

    rule: str
    """The rule, or the part of the report."""
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.rule} {self.where}: {self.text}"


class Deal:
    """A transaction of the report, with its messages walked anew."""

    def __init__(self, plain: dict[str, Any]) -> None:
        self.plain = plain
        self.id: int = plain["id"]
        self.state: str = plain["state"]
        self.operation: str = plain["operation"]
        self.controller: str = plain["controller"]
        self.device: str = plain["device"]
        self.ar: str | None = plain["ar"]
        self.api: int = plain["api"]
        self.slot: int = plain["slot"]
        self.subslot: int = plain["subslot"]
        self.index: int = plain["index"]
        self.frames: dict[str, Any] = plain["frames"]
        self.parameters: list[dict[str, Any]] = plain["parameters"]
        self.write_status = _status(plain["status"]["write"])
        self.read_status = _status(plain["status"]["read"])
        self.duration_ms: float | None = plain["duration_ms"]
        self.cut = self.short = False
        """Whether the capture cut the Write request, and whether the response."""
        self.s7 = plain["channel"] == "s7"
        self.cyclic = self.s7 or plain["channel"] == "pkw"
        """Its messages are none of DS47: `pkw` and `s7` read them."""
        raw = {"request": None, "response": None} if self.cyclic else plain["bytes"]
        self.asked = (
            message.request(bytes.fromhex(raw["request"])) if raw["request"] is not None else None
        )
        self.answer = (
            message.response(bytes.fromhex(raw["response"]))
            if raw["response"] is not None
            else None
        )

    @cached_property
    def channel(self) -> tuple[object, ...]:
        """Who asks whom where."""
        return (
            self.controller, self.device, self.ar, self.api, self.slot, self.subslot, self.index,
        )  # fmt: skip

    @property
    def place(self) -> tuple[object, ...]:
        """Where, whoever asks."""
        return self.device, self.api, self.slot, self.subslot, self.index

    @property
    def write(self) -> int | None:
        """The frame of the Write request."""
        found: int | None = self.frames["write_request"]
        return found

    @property
    def read(self) -> int | None:
        """The frame of the Read response that ended it."""
        found: int | None = self.frames["read_response"]
        return found

    @property
    def closed(self) -> float:
        """The frame that ended it: one that was longer than what a Read asks for waits for another Read."""
        return inf if self.read is None or self.read_status == SHORT else self.read

    @property
    def polls(self) -> list[dict[str, int | None]]:
        found: list[dict[str, int | None]] = self.frames["polls"]
        return found

    @property
    def rereads(self) -> list[dict[str, int | None]]:
        found: list[dict[str, int | None]] = self.frames["rereads"]
        return found

    @property
    def axis_told(self) -> int | None:
        """The axis byte of the request."""
        return self.asked.axis if self.asked else None

    @cached_property
    def all_frames(self) -> list[int]:
        """Every frame of it."""
        single = [value for value in self.frames.values() if isinstance(value, int)]
        pairs = [frame for pair in [*self.polls, *self.rereads] for frame in pair.values()]
        return sorted({frame for frame in [*single, *pairs] if frame is not None})

    @property
    def fits(self) -> bool:
        """Whether its response is one to its request, by what is mirrored and how many blocks there are."""
        asked, answer = self.asked, self.answer
        if asked is None or answer is None:
            return False
        pairs = ((asked.reference, answer.reference), (asked.axis, answer.axis))
        if any(one != other for one, other in pairs if None not in (one, other)):
            return False
        counted = asked.count is not None or not self.cut
        if counted and len(answer.blocks) > self.parameters_asked:
            return False
        if asked.id is None or answer.id is None:  # the capture cut it off, or it was never there
            return (self.cut or asked.id is not None) and (self.short or answer.id is not None)
        return answer.id in (asked.id, asked.id | 0x80, 0x80)

    @property
    def parameters_asked(self) -> int:
        """How many parameters the request asks for; of one that the capture cut, by its header."""
        asked = self.asked
        if asked is None:
            return 0
        return asked.data[3] if self.cut and len(asked.data) > 3 else len(asked.addresses)

    def pairs(self) -> Iterable[tuple[message.Address, message.Block]]:
        """Address and block of each parameter of a response that fits."""
        if self.asked is None or self.answer is None or not self.fits:
            return ()
        return zip(self.asked.addresses, self.answer.blocks, strict=False)


def _status(text: str | None) -> int | None:
    return None if text is None else int(text, 16)


@dataclass
class Finding:
    """A finding of the report."""

    rule: str
    severity: str
    frame: int
    frames: list[int]
    args: dict[str, Any]
    offset: int | None
    message: str
    filter: str
    transaction: int | None
    time: str | None
    """When the report says that `frame` was."""

    @classmethod
    def of(cls, plain: dict[str, Any]) -> Finding:
        return cls(
            plain["rule"], plain["severity"], plain["frame"], plain["frames"], plain["args"],
            plain["offset"], plain["message"], plain["filter"], plain["transaction"],
            plain.get("time"),
        )  # fmt: skip


@dataclass
class Reading:
    """One capture: what the report says of it, and the frames."""

    name: str
    plain: dict[str, Any]
    capture: wire.Capture
    text: str = ""
    """The text report."""
    page: str = ""
    """The HTML page."""
    deals: list[Deal] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    askers: dict[tuple[object, ...], tuple[set[int], bool]] = field(default_factory=dict)
    """What `plc` found out of each Read: its channel and frames are the key."""

    def __post_init__(self) -> None:
        self.deals = [Deal(each) for each in self.plain["transactions"]]
        for deal in self.deals:
            self._cut(deal)
        self.findings = [Finding.of(each) for each in self.plain["findings"]]

    def _cut(self, deal: Deal) -> None:
        """What the capture cut of a transaction; its messages are walked accordingly."""
        frame = self.capture.frame(deal.write or 0)
        own = [e for e in self.asked_at.get(deal.write or 0, ()) if self.same_place(deal, e)]
        deal.cut = any(e.short for e in own) or (not own and frame is not None and frame.cut)
        deal.short = any(each.short for each in self.answered_at.get(deal.read or 0, ()))
        if deal.asked is not None and deal.cut:
            deal.asked = message.request(deal.asked.data, cut=True)
        if deal.answer is not None and deal.short:
            deal.answer = message.response(deal.answer.data, cut=True)

    @property
    def line(self) -> dp.Line | None:
        """The line of PROFIBUS; None in a capture of PROFINET."""
        found: dp.Line | None = self.capture.line
        return found

    @property
    def dropped(self) -> bool:
        """Whether the capture says that frames were dropped: told by the report itself, on another line."""
        return "machine dropped" in self.text or any(
            each.rule == "DS725" and each.args.get("what") == "dropped" for each in self.findings
        )

    @cached_property
    def gaps(self) -> Gaps:
        return Gaps(self.capture)

    @cached_property
    def by_id(self) -> dict[int, Deal]:
        return {each.id: each for each in self.deals}

    @cached_property
    def by_channel(self) -> dict[tuple[object, ...], list[Deal]]:
        found: dict[tuple[object, ...], list[Deal]] = {}
        for deal in self.deals:
            found.setdefault(deal.channel, []).append(deal)
        return found

    @cached_property
    def said_of(self) -> dict[int, set[int | None]]:
        """The transactions to which the findings of a frame belong."""
        found: dict[int, set[int | None]] = {}
        for each in self.findings:
            found.setdefault(each.frame, set()).add(each.transaction)
        return found

    @cached_property
    def for_nobody(self) -> set[int]:
        """The frames of responses of which the report says that nobody knows whose they are."""
        return {
            each.frame for each in self.findings
            if each.rule in ("DS110", "DS206") and each.transaction is None
        }  # fmt: skip

    @cached_property
    def by_frame(self) -> dict[int, list[wire.Pdu]]:
        found: dict[int, list[wire.Pdu]] = {}
        for pdu in self.capture.pdus:
            found.setdefault(pdu.frame, []).append(pdu)
        return found

    @cached_property
    def asked_at(self) -> dict[int, list[wire.Record]]:
        found: dict[int, list[wire.Record]] = {}
        for each in self.capture.records:
            found.setdefault(each.asked, []).append(each)
        return found

    @cached_property
    def answered_at(self) -> dict[int, list[wire.Record]]:
        found: dict[int, list[wire.Record]] = {}
        for each in self.capture.records:
            if each.answered is not None:
                found.setdefault(each.answered, []).append(each)
        return found

    @cached_property
    def connections_of_47(self) -> set[tuple[object, ...]]:
        """Controller, device and AR whose index 47 is the parameter channel: a transaction, or where it is, shows it."""
        found = {(each.controller, each.device, each.ar) for each in self.deals if each.index == 47}
        there: dict[tuple[object, ...], int] = {}
        for deal in self.deals:
            answer = deal.answer
            whole = answer is not None and answer.sound and not any(answer.rest)
            whole = whole and answer.id in message.KNOWN
            if deal.index in (0xB02E, 0xB02F) and deal.read and whole:
                place = deal.device, deal.api, deal.slot, deal.subslot
                there[place] = min(there.get(place, deal.read), deal.read)
        for each in self.capture.records:
            since = min(
                there.get((each.device, api, each.slot, each.subslot), 10**9)
                for api in (each.api, 0x3A00)
            )
            if each.index == 47 and (each.api == 0x3A00 or since < (each.answered or each.asked)):
                found.add((each.controller, each.device, str(each.ar) if each.ar.int else None))
        return found

    def is_ours(self, record: wire.Record) -> bool:
        """Whether a record is one of the parameter channel."""
        ar = str(record.ar) if record.ar.int else None
        connection = record.controller, record.device, ar
        of_47 = record.index == 47 and connection in self.connections_of_47
        return record.index in (0xB02E, 0xB02F) or of_47

    def deal(self, finding: Finding) -> Deal | None:
        return None if finding.transaction is None else self.by_id.get(finding.transaction)

    def not_ready(self, deal: Deal) -> list[dict[str, int | None]]:
        """The Reads before its response that came too early, and not for fewer bytes than it has."""
        there = self.answered_at
        return [
            poll for poll in deal.polls
            if not any(each.status == SHORT for each in there.get(poll["response"] or 0, []))
        ]  # fmt: skip

    def releases(self, deal: Deal) -> list[int]:
        """The frames in which the AR of a transaction was given up after its request."""
        return [frame for operation, frame in self._ends(deal) if operation == wire.RELEASE]

    def ends(self, deal: Deal) -> list[int]:
        """The same, and those in which it was set up anew: so it was over before."""
        return [frame for _, frame in self._ends(deal)]

    def _ends(self, deal: Deal) -> Iterator[tuple[int, int]]:
        ar = bytes.fromhex((deal.ar or "").replace("-", ""))
        alone = (each for each in self.capture.strays if each.kind == wire.RESPONSE)
        for each in (*(call.request for call in self.capture.calls), *alone):
            ends = each.operation in (wire.RELEASE, wire.CONNECT)
            if ends and ar and ar in each.body and each.frame > (deal.write or 0):
                yield each.operation, each.frame

    @cached_property
    def given_up(self) -> list[wire.Call]:
        """The calls that end an AR."""
        return [call for call in self.capture.calls if call.request.operation == wire.RELEASE]

    @cached_property
    def last(self) -> int | None:
        """When the last frame was, the last transaction ended, or the last event was, in ns."""
        ends = [
            instant(each.plain["start"]) + max(0, round((each.duration_ms or 0) * 1e6))
            for each in self.deals
        ]
        for line in self.plain.get("timelines", ()):
            ends += [instant(each["time"]) for each in line["events"]]
        ends += [instant(self.plain[name]) for name in ("end",) if self.plain.get(name)]
        return max(ends, default=None)

    def time(self, frame: int | None) -> int | None:
        """Time of a frame in nanoseconds."""
        found = None if frame is None else self.capture.frame(frame)
        return found.time_ns if found else None

    def same_place(self, deal: Deal, record: wire.Record) -> bool:
        """Whether a record call is on the channel of a transaction."""
        ar = None if record.ar.int == 0 else str(record.ar)
        return (record.controller, record.device, ar, *record.channel[3:]) == deal.channel

    @cached_property
    def call_at(self) -> dict[int, wire.Call]:
        """The call whose request, first or again, is in a frame."""
        found: dict[int, wire.Call] = {}
        for call in self.capture.calls:
            for frame in (call.request.frame, *call.again, *call.copies):
                found.setdefault(frame, call)
        return found

    @cached_property
    def stray_at(self) -> dict[int, wire.Pdu]:
        return {each.frame: each for each in self.capture.strays}

    @cached_property
    def on_channel(self) -> dict[tuple[object, ...], list[wire.Record]]:
        """The record calls of each channel."""
        found: dict[tuple[object, ...], list[wire.Record]] = {}
        for each in self.capture.records:
            ar = None if each.ar.int == 0 else str(each.ar)
            key = (each.controller, each.device, ar, *each.channel[3:])
            found.setdefault(key, []).append(each)
        return found

    @cached_property
    def asked_and_answered(self) -> set[tuple[object, ...]]:
        """The Write requests whose transactions have a response: their channels and frames."""
        return {(*each.channel, each.write) for each in self.deals if each.answer is not None}

    @cached_property
    def vendors(self) -> dict[str, int | None]:
        return {each["ip"]: each["vendor_id"] for each in self.plain["devices"]}


def shown(text: str) -> set[int]:
    """The frames that a display filter shows.

    Raises:
        ValueError: it is not of the form that Wireshark 3.4 and everything later takes.
    """
    numbers: set[int] = set()
    for term in text.split(" or "):
        found = _TERM.fullmatch(term.strip())
        if found is None:
            raise ValueError(f"not a filter: {term!r}")
        one, first, last = found.groups()
        numbers |= {int(one)} if one else set(range(int(first), int(last) + 1))
    return numbers


def instant(text: str) -> int:
    """Nanoseconds since 1970 of a time in the report."""
    head, _, fraction = text.removesuffix("Z").partition(".")
    seconds = int(datetime.fromisoformat(head + "+00:00").timestamp())
    return seconds * 10**9 + int(fraction.ljust(9, "0"))


def report(paths: list[Path], *options: str) -> str:
    """What `ds47 report` prints of captures."""
    from ds47.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        main(
            [
                "report",
                "--no-progress",
                *(() if "-f" in options else ("--all", "--filters")),
                "--tz",
                "UTC",
                *options,
                *map(str, paths),
            ]
        )
    return out.getvalue()


def read(path: Path, *options: str, text: bool = True, page: bool = True) -> Reading:
    """Analyses a capture, with options of `ds47 report`, and reads it; without its text and its page where nobody
    reads them.
    """
    captures = json.loads(report([path], *options, "-f", "json"))["captures"]
    if not captures:
        raise ValueError(f"{path} is no capture that ds47 can read")
    plain = captures[0]
    lines = report([path], *options, "--plc") if text else ""
    html = report([path], *options, "-f", "html") if page else ""
    capture = wire.read(path)
    dp.enter(capture)
    return Reading(path.name, plain, capture, lines, html)
