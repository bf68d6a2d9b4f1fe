"""What the PLC is said to have seen of a transaction, call by call, against the Writes and Reads of its channel."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import groupby

from tests.audit import wire
from tests.audit.reading import NOT_READY, SHORT, Deal, Reading

_FAULT = "(?:RPC fault or reject|the station refused the service, not the record)"
FORMS = {
    "done": r"WRREC DONE, STATUS 00000000",
    "error": r"WRREC ERROR, STATUS (?P<status>[0-9A-F]{8})",
    "fault": rf"WRREC ERROR with a STATUS of the PLC itself \({_FAULT}\)",
    "bare": r"WRREC, a response without STATUS",
    "cut": r"WRREC, its STATUS was cut off by the capture",
    "busy": r"WRREC BUSY until its timeout, then ERROR \(no response in the capture\)",
    "ends": r"WRREC, no response before the capture ends",
    "unseen": r"WRREC, its response is not in the capture",
    "missing": r"its WRREC is not known",
    "read error": r"RDREC (?:(?P<times>\d+) x )?ERROR, STATUS (?P<status>[0-9A-F]{8})",
    "read valid": r"RDREC (?:(?P<times>\d+) x )?VALID, STATUS 00000000, LEN (?P<length>\d+)"
                  r"(?: \((?P<captured>\d+) of them captured\))?",
    "read fault": rf"RDREC (?:(?P<times>\d+) x )?ERROR with a STATUS of the PLC itself \({_FAULT}\)",
    "read bare": r"RDREC(?: (?P<times>\d+) x)?, a response without STATUS and record",
    "read nothing": r"RDREC(?: (?P<times>\d+) x)?, no record came "
                    r"\(no response in the capture, or the station refused the service\)",
    "read unseen": r"RDREC(?: (?P<times>\d+) x, the|, its) whole response is not in the capture",
    "read ends": r"RDREC, no response before the capture ends",
    "read again": r"RDREC (?:(?P<times>\d+) x )?VALID once more, LEN (?P<length>\d+)",
    "never": r"RDREC not started in this capture",
    "absent": r"RDREC, if there was one, is not in the capture",
    "given up": r"RDREC not started again in this capture",
    "without": r"no record by RDREC in this capture",
    "superseded": r"no response by RDREC before the next WRREC",
    "implicit": r"a Read without an AR \(ReadImplicit\), no call of RDREC: STATUS (?P<status>[0-9A-F]{8}), LEN (?P<length>\d+)",
}  # fmt: skip
"""What a call ended with -> its words."""
MIRROR = {"reference": 0, "DO": 2, "count": 3, "ID": 1}
"""What a record may not mirror -> the byte in which it stands."""


class Told:
    """One call of a block as the line tells it."""

    def __init__(self, kind: str, groups: dict[str, str | None]) -> None:
        self.kind = kind
        self.times = int(groups.get("times") or 1)
        self.length = int(groups.get("length") or 0)
        self.captured = None if groups.get("captured") is None else int(groups["captured"] or 0)
        self.status = None if groups.get("status") is None else int(groups["status"] or "", 16)


def check(text: str, deal: Deal, reading: Reading) -> Iterator[str]:
    """What of a line is not so."""
    words, _, remark = text.partition(" - ")
    calls: list[Told] = []
    for part in words.split("; "):
        kind, found = next(
            ((kind, found) for kind, form in FORMS.items() if (found := re.fullmatch(form, part))),
            ("", None),
        )
        if found is None:
            yield f"nobody knows {part!r}"
            return
        calls.append(Told(kind, found.groupdict()))
    if calls[0].kind == "implicit":
        yield from _implicit(calls, deal, reading)
    else:
        yield from _write(calls[0], deal, reading)
        yield from _reads(calls[1:], deal, reading)
    yield from _remark(remark, deal)


# WRREC


def _write(told: Told, deal: Deal, reading: Reading) -> Iterator[str]:
    if (told.kind == "missing") is not (deal.write is None):
        yield f"the Write is in frame {deal.write}"
    if deal.write is None or told.kind == "missing":
        return
    own = [each for each in _channel(deal, reading) if each.write and each.asked == deal.write]
    if not own:
        return  # the capture cut the request; the frames are those of the transaction
    if not any(_matches(told, each) for each in own):
        yield f"WRREC {told.kind} {told.status or 0:08X} is {_end(own[0])} {own[0].status or 0:08X}"
    if told.kind == "ends":
        yield from _nothing_after(deal, reading, deal.write)
    if told.kind == "busy":
        yield from _quiet(deal, reading, deal.write)


def _matches(told: Told, record: wire.Record) -> bool:
    end = _end(record)
    if told.kind in ("busy", "ends", "unseen"):
        return end == "unseen"
    return told.kind == end and (told.kind != "error" or told.status == record.status)


def _end(record: wire.Record) -> str:
    """How a call ended."""
    response = record.call.response
    if response is None:
        return "unseen"
    if response.kind in (wire.FAULT, wire.REJECT):
        return "fault"
    if record.untold:
        return "cut" if record.write else "unseen"
    if record.status is None:
        return "bare"
    if record.status:
        return "polled" if record.status == NOT_READY and not record.write else "error"
    return "empty" if not record.write and not record.stated else "done"


# RDREC


def _reads(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    yield from _polled(calls, deal, reading)
    yield from _read_again(calls, deal)
    yield from _left_out(calls, deal, reading)
    yield from _order(calls, deal, reading)
    yield from _last(calls, deal, reading)


def _order(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    """The Reads before the one that brought the response, one after the other."""
    told = [kind for each in calls for kind in [_kind(each)] * each.times if kind]
    own = sorted(_own(deal, reading), key=lambda each: each.answered or each.asked)
    true = [_end(each) for each in own if _end(each) not in ("done", "error")]
    if (
        reading.line is not None
    ):  # of Reads without an answer, or refused, no finding is there to tell them
        kinds = ("fault", "unseen")
        told = [each for each in told if each not in kinds]
        true = [each for each in true if each not in kinds]
    if any(each.rule == "DS109" for each in reading.findings):  # calls that were given up
        told, true = ([each for each in kinds if each != "unseen"] for kinds in (told, true))
    if reading.capture.pieces:  # a response that came twice, each time in part, is told twice
        told, true = (_once(each, "unseen") for each in (told, true))
    if "DS110" in deal.plain["findings"]:
        true = true[: len(told)]  # of those behind, nobody knows whose they are
    if deal.write is not None and told != true:
        yield f"the Reads are told as {_runs(told)}, and came as {_runs(true)}"


def _once(kinds: list[str], kind: str) -> list[str]:
    """A list in which a kind never follows itself."""
    return [each for at, each in enumerate(kinds) if each != kind or kinds[at - 1 : at] != [kind]]


def _kind(told: Told) -> str:
    """What a call that brought nothing ended with; empty for any other."""
    if told.kind == "read error" and told.status == NOT_READY:
        return "polled"
    if told.kind == "read valid" and not told.length:
        return "empty"
    words = {
        "read fault": "fault",
        "read bare": "bare",
        "read unseen": "unseen",
        "read ends": "unseen",
        "read nothing": "unseen",
    }
    return words.get(told.kind, "")


def _runs(kinds: list[str]) -> str:
    return ", ".join(f"{len(list(run))} x {kind}" for kind, run in groupby(kinds)) or "none"


def _sum(calls: list[Told], tells: Callable[[Told], bool]) -> int:
    return sum(each.times for each in calls if tells(each))


def _polled(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    told = _sum(calls, lambda each: each.kind == "read error" and each.status == NOT_READY)
    true = len(deal.polls) - _short(deal, reading)
    if told != true:
        yield f"{told} x DE80B500: polled {true} times"


def _short(deal: Deal, reading: Reading) -> int:
    """How many Reads were refused because they asked for fewer bytes than the response has, and left it."""
    frames = [each["response"] or 0 for each in deal.polls]
    return sum(
        any(each.status == SHORT for each in reading.answered_at.get(frame, [])) for frame in frames
    )


def _read_again(calls: list[Told], deal: Deal) -> Iterator[str]:
    told = _sum(calls, lambda each: each.kind == "read again")
    if told != len(deal.rereads):
        yield f"{told} x VALID once more: read again {len(deal.rereads)} times"


def _left_out(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    """Reads that brought no record: as many as its channel has until the next Write."""
    told = Counter[str]()
    for each in calls:
        if each.kind in ("read fault", "read bare"):
            told[each.kind.removeprefix("read ")] += each.times
        elif each.kind == "read valid" and not each.length and each is not _valid(calls, deal):
            told["empty"] += each.times
    loose = Counter(_end(each) for each in _own(deal, reading) if _loose(each, reading))
    if reading.line is not None:
        loose["fault"] = 0  # no finding is about those
    for kind in ("fault", "bare", "empty"):
        if told[kind] != loose[kind] and deal.write is not None:
            yield f"{told[kind]} x RDREC {kind}: there are {loose[kind]}"


def _valid(calls: list[Told], deal: Deal) -> Told | None:
    """The call that is said to have brought the response."""
    if deal.read is None or deal.read_status:
        return None
    return next((each for each in reversed(calls) if each.kind == "read valid"), None)


def _last(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    """What brought the response, or why nothing did."""
    valid = _valid(calls, deal)
    filled = [each for each in calls if each.kind == "read valid" and each.length]
    if valid is not None and filled != [valid][: len(filled)]:
        yield "more than one Read is said to have brought the response"
    if deal.read is None and filled:
        yield f"VALID, LEN {filled[0].length}: no Read brought a response"
    if deal.read is not None and valid is None and not deal.read_status:
        yield "does not say that a Read brought the response"
    lengths = [valid, *(each for each in calls if each.kind == "read again")]
    for each in lengths if deal.read is not None else ():
        if each is not None:
            yield from _length(each, deal, reading)
    refused = [
        each.status for each in calls if each.kind == "read error" and each.status != NOT_READY
        for _ in range(each.times)
    ]  # fmt: skip
    last = [deal.read_status] if deal.read_status else []
    if refused != [SHORT] * _short(deal, reading) + last:
        yield f"RDREC ERROR {refused} is {deal.read_status}"
    for each in calls:
        yield from _without(each, deal, reading)


def _stated(record: wire.Record) -> int:
    """The bytes of a record, of which the capture may have a part only."""
    response = record.call.response
    return record.stated if response is not None and response.cut else len(record.data)


def _length(told: Told, deal: Deal, reading: Reading) -> Iterator[str]:
    """LEN: the bytes of the record, of which the capture may have a part only."""
    records = [each for each in reading.answered_at.get(deal.read or 0, []) if not each.write]
    if records and all(each.implicit for each in records):
        yield "RDREC VALID is a ReadImplicit, and no RDREC"
    mine = [each for each in records if deal.answer and each.data == deal.answer.data]
    true = set(map(_stated, mine))
    if mine and told.length not in true:
        yield f"LEN {told.length} is {sorted(true)}"
    got = len(deal.answer.data) if deal.answer else 0
    if told.kind == "read valid" and (told.captured is not None) is (got == told.length):
        yield f"LEN {told.length}, of which {told.captured} were captured: {got} were"
    if told.captured not in (None, got):
        yield f"{told.captured} bytes captured are {got}"


def _without(told: Told, deal: Deal, reading: Reading) -> Iterator[str]:
    """Calls that are said not to have been, or to have no response."""
    last = max([deal.write or 0, *(each["request"] or 0 for each in deal.polls)])
    if told.kind in ("never", "given up", "absent"):
        after = [
            _at(each) for each in _channel(deal, reading)
            if not each.write and not each.implicit and last < each.asked
            and deal.write in _askers(each, deal, reading)[0]
        ]  # fmt: skip
        if told.kind == "absent":  # of other Reads nobody knows whose they are
            own = {each.frame for each in reading.findings if each.transaction == deal.id}
            after = [frame for frame in after if frame in own]
        if deal.read is not None or (told.kind == "never" and deal.polls):
            yield f"RDREC {told.kind}, but it was"
        elif after:
            yield f"RDREC was started in frame {after[0]}"
    elif told.kind == "without" and (deal.read is not None or reading.line is None):
        yield "a record came, or this is not PROFIBUS"
    elif told.kind == "superseded" and _next_write(deal, reading) is None:
        yield "there is no next WRREC"
    elif told.kind == "read ends":
        reads = [each for each in _own(deal, reading) if _end(each) == "unseen"]
        yield from _nothing_after(deal, reading, max((each.asked for each in reads), default=0))
    elif told.kind == "read nothing":
        if not {"fault", "unseen"} & {_end(each) for each in _own(deal, reading)}:
            yield "every RDREC brought a record"
    elif told.kind == "read unseen":
        pieces = {frame for each in reading.capture.pieces.values() for frame in each}
        ends = [_end(each) for each in _own(deal, reading) if each.asked not in _answered(deal)]
        if ends.count("unseen") < told.times and not pieces:
            yield f"{told.times} x RDREC without its response: there are {ends.count('unseen')}"


def _implicit(calls: list[Told], deal: Deal, reading: Reading) -> Iterator[str]:
    records = [each for each in reading.answered_at.get(deal.read or 0, []) if not each.write]
    if len(calls) > 1 or not records or not all(each.implicit for each in records):
        yield "a Read without an AR is told"
    elif calls[0].status != deal.read_status:
        yield f"STATUS {calls[0].status} is {deal.read_status}"
    elif calls[0].length not in map(_stated, records):
        yield f"LEN {calls[0].length} is another"


# Where it stands


def _channel(deal: Deal, reading: Reading) -> list[wire.Record]:
    return reading.on_channel.get(deal.channel, [])


def _next_write(deal: Deal, reading: Reading) -> int | None:
    """The frame of the next Write request of the channel."""
    return min(
        (each.asked for each in _writes(deal, reading) if each.asked > (deal.write or 0)),
        default=None,
    )


def _writes(deal: Deal, reading: Reading) -> list[wire.Record]:
    return [each for each in _channel(deal, reading) if each.write and not each.nested]


_NOBODY = -1
"""Instead of the frame of a Write, where a Read may be for one that nobody saw."""


def _own(deal: Deal, reading: Reading) -> list[wire.Record]:
    """The Reads of the channel that look for its response: those before it came, and before the next request did.

    Of a Read that may be for one of several Writes nobody knows more: it is told of the one that the report gives
    it to, or of none.
    """
    found = []
    for each in _channel(deal, reading):
        if each.write or each.implicit or _at(each) >= deal.closed:
            continue
        askers, sure = _askers(each, deal, reading)
        mine = sure or _given(each, deal, reading) == (deal.write or 0)
        if (deal.write or 0) in askers and mine:
            found.append(each)
    return found


def _at(record: wire.Record) -> int:
    """The frame of a request, or of its response where the capture has no request."""
    return record.asked or record.answered or 0


def _askers(record: wire.Record, deal: Deal, reading: Reading) -> tuple[set[int], bool]:
    """The same of each Read for all transactions of its channel, which ask one after the other."""
    key = deal.channel, record.asked, record.answered
    if key not in reading.askers:
        reading.askers[key] = _asked_by(record, deal, reading)
    return reading.askers[key]


def _asked_by(record: wire.Record, deal: Deal, reading: Reading) -> tuple[set[int], bool]:
    """The Writes that a Read may be for, and whether it surely is for one of them; 0 is one that nobody saw.

    It is for the newest that was accepted while that has no response, else for the newest. Of a Write without its
    response nobody knows whether it was accepted.
    """
    at = _at(record)
    writes = sorted((each for each in _writes(deal, reading) if _at(each) < at), key=_at)
    taken = [each for each in writes if each.asked and _end(each) == "done"]
    begin = taken[-1].asked if taken else 0
    behind = [each for each in writes if each.asked > begin]
    unseen = {each.asked for each in behind if _end(each) in ("unseen", "cut")}
    if any(not each.asked and _end(each) == "done" and _at(each) > begin for each in writes):
        unseen.add(0)  # a Write that was accepted, and whose request nobody saw
    if taken and _is_open(begin, at, deal, reading):
        owner = _owner(begin, deal, reading)
        unsure = bool(unseen) or (owner is not None and owner.state == "incomplete")
        refused = {behind[-1].asked} if unsure and behind else set()
        return {begin, *unseen, *refused}, not unsure
    last = writes[-1].asked if writes else 0
    if (
        not last
    ):  # a response whose request nobody saw: a late one of an older Write, or one of its own
        return {0, *unseen}, False
    return {last, *unseen}, unseen <= {last} and not _is_over(last, at, deal, reading)


def _owner(write: int, deal: Deal, reading: Reading) -> Deal | None:
    """The transaction of a Write of the same channel."""
    own = (each for each in reading.by_channel.get(deal.channel, ()) if each.write == write)
    return next(own, None)


def _is_open(write: int, at: int, deal: Deal, reading: Reading) -> bool:
    """Whether an accepted Write has no response before a frame, and its AR is not released."""
    owner = _owner(write, deal, reading)
    if owner is None or any(write < frame < at for frame in reading.releases(owner)):
        return False
    return owner.closed > at and not _others(write, at, deal, reading)


def _others(write: int, at: int, deal: Deal, reading: Reading) -> list[wire.Record]:
    """The Reads between a Write and a frame that are for another Write."""
    return [
        each for each in _channel(deal, reading)
        if not each.write and write < _at(each) < at
        and _given(each, deal, reading) not in (write, None)
    ]  # fmt: skip


def _is_over(write: int, at: int, deal: Deal, reading: Reading) -> bool:
    """Whether a Write has nothing to wait for: its time or its AR is over, or a Read was for another, or may be."""
    owner = _owner(write, deal, reading)
    if owner is None:
        return True
    reads = [each for each in _channel(deal, reading) if not each.write and write < _at(each) < at]
    before = max([write, *(_at(each) for each in reads)])
    silent = (reading.time(at) or 0) - (reading.time(before) or 0) > 600 * 10**9
    released = any(write < frame < at for frame in reading.releases(owner))
    if bool(_others(write, at, deal, reading)) or silent or released:
        return True
    return any(reading.gaps.between(deal.controller, deal.device, write, at))


def _given(record: wire.Record, deal: Deal, reading: Reading) -> int | None:
    """The Write of the transaction to which a Read is given, by its frames or by what is said of the Read."""
    frames = (record.asked, record.answered or 0, *_fragments(record, reading))
    said = set().union(*(reading.said_of.get(frame, ()) for frame in frames))
    for each in reading.by_channel.get(deal.channel, ()):
        if _at(record) in each.all_frames or each.id in said:
            return each.write or 0
    return _NOBODY if record.answered in reading.for_nobody else None


def _fragments(record: wire.Record, reading: Reading) -> list[int]:
    """The frames of those fragments of its response that the capture has, where it is not whole."""
    request = record.call.request
    for key, frames in reading.capture.pieces.items():
        _, begun = reading.capture.begun.get(key, (0, None))
        if (request.activity in key and request.sequence in key) or begun == request.key[1:]:
            return frames
    return []


def _loose(record: wire.Record, reading: Reading) -> bool:
    """Whether a Read is none of the frames of a transaction."""
    return not any(_at(record) in each.all_frames for each in reading.deals)


def _answered(deal: Deal) -> set[int]:
    """The frames of its Reads whose responses are there."""
    pairs = [*deal.polls, *deal.rereads]
    read = deal.frames["read_request"] if deal.read is not None else None
    return {frame for frame in (read, *(each["request"] for each in pairs)) if frame is not None}


def _nothing_after(deal: Deal, reading: Reading, frame: int) -> Iterator[str]:
    """A call without a response before the capture ends: nothing else may follow on its channel."""
    later = [each.asked for each in _channel(deal, reading) if each.asked > frame]
    if later:
        yield f"the capture is said to end, and the channel goes on in frame {later[0]}"


def _quiet(deal: Deal, reading: Reading, frame: int) -> Iterator[str]:
    """A timeout: nothing may come on the channel for as long as it takes."""
    begin = reading.time(frame) or 0
    times = [
        reading.time(each.asked) or 0 for each in _channel(deal, reading) if each.asked > frame
    ]
    last = reading.capture.frames[-1].time_ns
    if min([last, *times]) - begin < 10**9:
        yield "a timeout is told, and less than 1 s later the channel goes on, or the capture ends"


# What STATUS does not tell


def _remark(text: str, deal: Deal) -> Iterator[str]:
    asked, answer = deal.asked, deal.answer
    byte = re.fullmatch(r"byte 1 is 16#([0-9A-F]{2}): negative response(, in part)?", text)
    other = re.fullmatch(r"the record does not mirror the request \((.*)\)", text)
    if text and byte is None and other is None:
        yield f"nobody knows {text!r}"
    if byte and (answer is None or answer.id != int(byte[1], 16) or not answer.id & 0x80):
        yield f"{byte[0]} is not so"
    if byte and bool(byte[2]) is not (deal.state == "partial"):
        yield f"{byte[0]}, but {deal.state}"
    negative = answer is not None and (answer.id or 0) & 0x80 and not deal.read_status
    if negative and not text:
        yield "does not say that the response is negative"
    if other and (asked is None or answer is None or deal.fits):
        yield "the record is said not to mirror the request, and does"
    elif other and asked is not None and answer is not None:
        yield from _not_mirrored(set(other[1].split(", ")), deal)


def _not_mirrored(told: set[str], deal: Deal) -> Iterator[str]:
    """Whether reference, DO and count that differ are those that are named; of the ID, that it is another one."""
    asked, answer = deal.asked, deal.answer
    request, response = (asked.data, answer.data) if asked and answer else (b"", b"")
    true = {
        name for name, at in MIRROR.items()
        if at < min(len(request), len(response)) and response[at] != request[at]
    }  # fmt: skip
    if min(len(request), len(response)) > 1 and response[1] in (
        request[1],
        request[1] | 0x80,
        0x80,
    ):
        true.discard("ID")
    if told - {"count"} != true - {"count"} or (true and told != true):
        yield f"{sorted(told)} are not mirrored: {sorted(true)}"
