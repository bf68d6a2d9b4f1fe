"""What the PLC saw of a transaction: the outputs of WRREC and RDREC as a program would see them.

Derived from the transaction (docs/explain.md), from findings about calls that it does not show, and from
what comes after it on its channel: every call of a block with DONE or VALID, ERROR, STATUS and LEN. What
STATUS means is the business of `ds47.explain`; the words are in spec/report.toml.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from typing import Final, NamedTuple

from ds47.model import DS47, CaptureResult, Finding, Transaction
from ds47.profidrive.parameter import family_fits
from ds47.report.bilingual import Both, joined, say
from ds47.spec.semantics import limits

NOT_READY: Final = 0xDE80B500
"""The STATUS of a poll: state conflict on a Read (docs/protocol.md E.1)."""
NEGATIVE: Final = 0x80
"""The bit of byte 1 of a response that says that it is a negative one (docs/protocol.md A.3)."""

_LEFT_OUT: Final = {
    "DS101": "unseen", "DS104": "fault", "DS105": "unseen", "DS108": "bare", "DS201": "error", "DS207": "empty",
}  # fmt: skip
"""Rules about a call that brought no record, and what the call ended with."""
_IN_PART: Final = "DS105"
_OPEN: Final = ("unanswered", "incomplete")
_CUT: Final = "DS106"
_NOTHING: Final = ("DS206", "DS808", "DS110")
"""The rules about a Read without an open request, or with an unknown one."""
_END: Final = 1 << 62
"""Behind every frame."""
_HEADER: Final = (("mirror_reference", 0), ("mirror_axis", 2), ("mirror_count", 3))
"""The bytes of a request that its response mirrors, but for byte 1."""

_Channel = tuple[str, str, str | None, int | None, int | None, int | None, int | None]


class BlockCall(NamedTuple):
    """One call of a block, or several that looked alike.

    `block` is "WRREC" or "RDREC"; `outcome` what it ended with:
    `done` (DONE, VALID), `cut` (the same, of which the capture has only a part; of WRREC it has no STATUS),
    `error`, `fault` (ERROR, the STATUS is made by the PLC), `bare` (a response without STATUS and record),
    `empty` (VALID without a record), `busy` (until the block gives up), `ends` (no response before the capture
    ends), `unseen` (the response, or a part of it, is not in the capture), `missing` (not in the capture, if it
    was at all), `polled` (ERROR with DE80B500), `again` (VALID once more), `never`, `given_up` (not started,
    not started again), `superseded` (no response before the next WRREC), `implicit` (a Read without an AR, which
    no block makes), `nothing` (no record came: the capture has no response, or the station of PROFIBUS
    refused the service), `without` (no record came there, whether a Read was started or not: of those
    refused the result does not tell).
    """

    block: str
    outcome: str
    status: int | None = None
    times: int = 1
    length: int | None = None
    """LEN of RDREC: bytes in RECORD."""
    captured: int | None = None
    """How many of them the capture has."""


class Witness:
    """Tells what the PLC saw of each transaction of a result."""

    def __init__(self, result: CaptureResult) -> None:
        self._calls: dict[int, list[Finding]] = {}
        """By transaction: the findings about calls that brought no record."""
        self._lengths: dict[int, int] = {}
        """Bytes of a record that the capture cut, by the frame of its Read response."""
        self._cut: set[int] = set()
        """Frames of responses that it cut before that length, or before the STATUS of a Write."""
        loose: list[int] = []
        for each in result.entire.findings:
            if each.transaction is None and (each.rule in _LEFT_OUT or each.rule in _NOTHING):
                loose.append(each.frame)
            elif each.rule in _LEFT_OUT and each.transaction is not None:
                self._calls.setdefault(each.transaction, []).append(each)
            elif each.rule == _CUT:
                completed, length = each.args.get("completed"), each.args.get("length")
                if completed is not None and length is not None:
                    self._lengths[completed] = length
                elif completed is not None:
                    self._cut.add(completed)
        records = [each for each in result.evidence if each.channel == DS47]
        self._waits = _waits(records)
        for number in _followed(records, self._calls, loose):
            self._waits[number] = "unseen"
        for number in _beside(records, self._calls, loose):
            self._waits[number] = "beside"

    def saw(self, item: Transaction) -> list[BlockCall]:
        """The calls of a transaction in their order."""
        if item.ar is None and item.station is None and item.frames.write_request is None:
            length = self._length(item)
            return [BlockCall("RDREC", "implicit", item.read_status, length=length)]
        found = self._calls.get(item.id, [])
        left_out, in_part = _left_out(item, found) if found else ([], False)
        wait = "unseen" if in_part else self._waits.get(item.id, "unseen")
        write = _write(item, found, left_out, wait)
        if item.write_status is None and item.frames.write_response in self._cut:
            write = BlockCall("WRREC", "cut")
        return [write, *self._reads(item, left_out, wait)]

    def text(self, item: Transaction) -> Both:
        """`WRREC DONE, STATUS 00000000; RDREC 3 x ERROR, STATUS DE80B500; RDREC VALID ...`."""
        return _summary(tuple(self.saw(item)), remark(item))

    def line(self, item: Transaction) -> Both:
        """The same with `PLC: ` in front; nothing of a channel that no block is called for."""
        if item.channel != DS47:
            return Both.same("")
        return _line(self.text(item))

    def is_cut(self, item: Transaction) -> bool:
        """Whether the capture has a part of the record alone."""
        return self._length(item) > len(item.response or b"")

    def _length(self, item: Transaction) -> int:
        """Bytes of the record that was read; the capture may have only a part of them."""
        return self._lengths.get(item.frames.read_response or 0, len(item.response or b""))

    def _reads(
        self, item: Transaction, left_out: Sequence[tuple[int, BlockCall]], wait: str
    ) -> list[BlockCall]:
        frames = item.frames
        calls = _before(item, left_out, wait)
        captured, length = len(item.response or b""), self._length(item)
        if frames.read_response is not None and item.read_status:
            calls.append(BlockCall("RDREC", "error", item.read_status))
        elif frames.read_response is not None:
            outcome = "cut" if captured < length else "done"
            calls.append(BlockCall("RDREC", outcome, 0, length=length, captured=captured))
        elif item.state == "superseded" and frames.read_request is None:
            calls.append(BlockCall("RDREC", "superseded"))
        elif item.state == "incomplete" and item.station is None:
            if not left_out and frames.read_request is None:
                calls.append(BlockCall("RDREC", "missing"))
        elif not left_out and frames.read_request is None and wait != "beside":
            unread = "given_up" if frames.polls else "never"
            calls.append(BlockCall("RDREC", unread if item.station is None else "without"))
        if frames.rereads:
            calls.append(BlockCall("RDREC", "again", 0, len(frames.rereads), length))
        return calls


def _waits(transactions: Sequence[Transaction]) -> dict[int, str]:
    """How long transactions without a response were waited for: "busy", "ends" or "unseen", by their id.

    "ends" where nothing comes after it on its channel. "busy" where the capture is known to go on for the
    time after which a request is given up, and nothing more came on the channel.
    """
    if {each.state for each in transactions}.isdisjoint(_OPEN):
        return {}
    expiry = limits().transaction_expiry_ns
    end = max((each.start_ns + (each.duration_ns or 0) for each in transactions), default=0)
    after: dict[_Channel, int] = {}
    waits: dict[int, str] = {}
    for item in reversed(transactions):
        channel = _channel(item)
        following = after.get(channel)
        after[channel] = item.start_ns
        if item.state not in _OPEN:
            continue
        known = end if following is None else following
        waits[item.id] = "ends" if following is None else "unseen"
        if known - item.start_ns > expiry and item.state == "unanswered":
            waits[item.id] = "busy"
    return waits


def _followed(
    transactions: Sequence[Transaction],
    calls: Mapping[int, Sequence[Finding]],
    loose: Sequence[int],
) -> Iterator[int]:
    """The ids of transactions with a later Read that may be on their channel."""
    waiting = [each for each in transactions if each.state in _OPEN]
    newest = dict.fromkeys(map(_channel, waiting), max(loose, default=0))
    for item in transactions if waiting else ():
        channel = _channel(item)
        if channel in newest:
            newest[channel] = max(newest[channel], item.frames.all()[-1])
    for item in waiting:
        about = (each.frame for each in calls.get(item.id, ()))
        if newest[_channel(item)] > max(item.frames.all()[-1], *about, 0):
            yield item.id


class _Channels:
    """Where Reads came between the Writes: whose they are is not always known.

    Args:
        loose: frames of calls that belong to no transaction, on whatever channel.
    """

    def __init__(
        self,
        transactions: Sequence[Transaction],
        unread: Sequence[Transaction],
        calls: Mapping[int, Sequence[Finding]],
        loose: Sequence[int],
    ) -> None:
        self._loose = sorted((frame, 0) for frame in loose)
        self._reads: dict[_Channel, list[tuple[int, int]]] = {}
        """Frames of Reads, each with the id of its transaction."""
        self._accepted: dict[_Channel, list[tuple[int, int]]] = {}
        wanted = set(map(_channel, unread))
        for item in transactions if wanted else ():
            channel = _channel(item)
            if channel in wanted:
                self._enter(channel, item, calls.get(item.id, ()))
        for table in (self._reads, self._accepted):
            for entries in table.values():
                entries.sort()

    def _enter(self, channel: _Channel, item: Transaction, found: Sequence[Finding]) -> None:
        frames = item.frames
        if frames.write_request is not None and item.write_status == 0:
            self._accepted.setdefault(channel, []).append((frames.write_request, item.id))
        shown = frames.write_request, frames.write_response
        every = [*frames.all(), *(each.frame for each in found)]
        reads = [(frame, item.id) for frame in every if frame not in shown]
        self._reads.setdefault(channel, []).extend(reads)

    def perhaps(self, item: Transaction) -> bool:
        """Whether a Read shown at another transaction, or at none, came before the next accepted Write."""
        channel, begin = _channel(item), item.frames.write_request
        if begin is None:
            return False
        end = _after(self._accepted.get(channel, ()), begin)
        others = self._reads.get(channel, ())
        return min(_after(self._loose, begin), _after(others, begin, item.id)) < end


def _unread(item: Transaction) -> bool:
    """Whether no Read brought a record, and none was given up."""
    return item.frames.read_request is None and item.frames.read_response is None


def _after(entries: Sequence[tuple[int, int]], frame: int, but: int = -1) -> int:
    """The first frame after another one that does not belong to the transaction `but`."""
    at = bisect_right(entries, (frame, _END))
    return next((each for each, number in islice(entries, at, None) if number != but), _END)


def _beside(
    transactions: Sequence[Transaction],
    calls: Mapping[int, Sequence[Finding]],
    loose: Sequence[int],
) -> Iterator[int]:
    """The ids of transactions whose Write was followed by a Read shown at another transaction, or at none.

    Then it is unknown for which of them the PLC started RDREC.
    """
    unread = [each for each in transactions if _unread(each)]
    channels = _Channels(transactions, unread, calls, loose)
    yield from (each.id for each in unread if channels.perhaps(each))


def _channel(item: Transaction) -> _Channel:
    return (
        item.controller, item.device, item.ar, item.api, item.slot, item.subslot, item.index,
    )  # fmt: skip


def _left_out(
    item: Transaction, found: Sequence[Finding]
) -> tuple[list[tuple[int, BlockCall]], bool]:
    """The Reads that brought no record and are none of the frames of a transaction, by their frame.

    And whether a part of a response is there: then it is not that none came.
    """
    frames = item.frames
    shown = (
        frames.write_request, frames.write_response, frames.read_request, frames.read_response,
    )  # fmt: skip
    out = [each for each in found if each.frame not in shown]
    part = None
    nothing = any(each.frame == frames.read_request for each in found)  # then the part is another's
    if frames.read_request is not None and frames.read_response is None and not nothing:
        part = next((each for each in out if each.rule == _IN_PART), None)
    calls = [
        (each.frame, BlockCall("RDREC", _LEFT_OUT[each.rule], _status(each)))
        for each in out if each is not part
    ]  # fmt: skip
    return calls, any(each.rule == _IN_PART for each in out)


def _status(finding: Finding) -> int | None:
    """The STATUS of a Read that was refused and left its transaction open."""
    status = finding.args.get("status")
    return None if status is None else int(status, 16)


def _before(
    item: Transaction, left_out: Sequence[tuple[int, BlockCall]], wait: str
) -> list[BlockCall]:
    """The Reads before the one that was answered: polls, and those that brought nothing.

    A Read without a response says only that nothing came in the frames after it. Only the last one says that the
    capture ended.
    """
    polls, asked = item.frames.polls, item.frames.read_request
    waits = asked is not None and item.frames.read_response is None
    if not left_out and not waits:
        return [BlockCall("RDREC", "polled", NOT_READY, len(polls))] if polls else []
    end = "unseen" if item.station is None else "nothing"
    alone = [(asked or 0, BlockCall("RDREC", end))] if waits else []
    frames = {frame for frame, _ in left_out}
    polled = [
        (frame or 0, BlockCall("RDREC", "polled", NOT_READY))
        for _, frame in polls
        if frame not in frames
    ]
    found = [call for _, call in sorted([*polled, *left_out, *alone], key=lambda each: each[0])]
    if waits and wait == "ends" and found[-1].outcome == "unseen":
        found[-1] = BlockCall("RDREC", "ends")
    calls: list[BlockCall] = []
    for call in found:
        if calls and calls[-1]._replace(times=1) == call:
            calls[-1] = call._replace(times=calls[-1].times + 1)
        else:
            calls.append(call)
    return calls


def _write(
    item: Transaction,
    found: Sequence[Finding],
    left_out: Sequence[tuple[int, BlockCall]],
    wait: str,
) -> BlockCall:
    frames = item.frames
    if frames.write_request is None:
        return BlockCall("WRREC", "missing")
    if item.write_status is not None:
        return BlockCall("WRREC", "error" if item.write_status else "done", item.write_status)
    if frames.write_response is not None:
        bare = any(each.rule == "DS108" and each.frame == frames.write_response for each in found)
        below = "fault" if item.station is None else "sap"
        return BlockCall("WRREC", "bare" if bare else below)
    if left_out or frames.read_request is not None or frames.read_response is not None:
        return BlockCall("WRREC", "unseen")
    return BlockCall("WRREC", "unseen" if frames.polls or wait == "beside" else wait)


def not_mirrored(item: Transaction) -> list[Both]:
    """What the response of a mismatch has otherwise than the request: reference, DO, count, ID."""
    request, response = item.request or b"", item.response or b""
    words = [
        say(key)
        for key, at in _HEADER
        if at < len(request) and at < len(response) and request[at] != response[at]
    ]
    if len(request) > 1 and len(response) > 1 and not family_fits(request[1], response[1]):
        words.append(say("mirror_id"))
    return words or [say("mirror_count")]  # or there are more value blocks than addresses


def remark(item: Transaction) -> Both | None:
    """What STATUS does not tell: that the record does not mirror the request, or is a negative response."""
    response = item.response
    if response is None or item.read_status:
        return None
    if item.state == "mismatch":
        return say("plc_other", what=joined(not_mirrored(item)))
    if len(response) < 2 or not response[1] & NEGATIVE:
        return None
    key = "plc_negative_partial" if item.state == "partial" else "plc_negative"
    return say(key, id=f"{response[1]:02X}")


@lru_cache(maxsize=4096)
def _line(calls: Both) -> Both:
    return say("plc_line", calls=calls)


@lru_cache(maxsize=4096)
def _summary(calls: tuple[BlockCall, ...], more: Both | None) -> Both:
    shown = joined([_words(call) for call in calls], "; ", "；")
    return shown if more is None else shown.joined(more, " - ", "，")


def _words(call: BlockCall) -> Both:
    kind = "write" if call.block == "WRREC" else "read"
    return say(
        f"plc_{kind}_{call.outcome}",
        n=call.times,
        status=f"{call.status or 0:08X}",
        length=call.length,
        captured=call.captured,
    )
