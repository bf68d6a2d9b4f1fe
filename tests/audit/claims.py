"""What findings DS1xx to DS4xx claim, decided anew from frames and transactions.

An auditor is a generator of texts, each of which says what of a finding is not so. It complains of every argument
that it cannot find in the capture itself, so that a rule cannot pass with an argument that nobody looked at.
"""

from __future__ import annotations

import struct
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.audit import message, wire
from tests.audit.memory import SURE, Memory, elements
from tests.audit.reading import NOT_READY, SHORT, Deal, Finding, Reading

Auditor = Callable[["Case"], Iterator[str]]
AUDITORS: dict[str, Auditor] = {}
LIMITS = Path(__file__).parents[2] / "python/ds47/spec/limits.toml"
NO_CLAIM = {
    "DS601": "compares two engines; its difference is their own text, and both run only with tshark",
}
"""Rules without an auditor, and why."""


class Case:
    """One finding, where it stands."""

    def __init__(self, finding: Finding, reading: Reading, memory: Memory) -> None:
        self.finding, self.reading, self.memory = finding, reading, memory
        self.args: dict[str, Any] = finding.args
        self.frame = finding.frame
        self.deal: Deal | None = reading.deal(finding)

    def wrong(self, name: str, truth: object) -> Iterator[str]:
        """A complaint where an argument is not the truth."""
        told = self.args.get(name)
        if name not in self.args:
            yield f"has no {name}, which is {truth!r}"
        elif told != truth:
            yield f"{name} {told!r} is {truth!r}"

    def requests(self) -> list[wire.Record]:
        return self.reading.asked_at.get(self.frame, [])

    def answers(self) -> list[wire.Record]:
        return self.reading.answered_at.get(self.frame, [])

    def records(self) -> list[wire.Record]:
        """The records that the frame asks for or brings, on the channel of the transaction if there is one."""
        all_of = self.requests() + self.answers()
        deal = self.deal
        return [each for each in all_of if deal is None or self.reading.same_place(deal, each)]

    def message(self) -> message.Message | None:
        """The message of the transaction that stands in this frame."""
        deal = self.deal
        if deal is None:
            return None
        if self.frame == deal.write:
            return deal.asked
        return deal.answer if self.frame == deal.read else None

    def at_offset(self) -> int:
        return -1 if self.finding.offset is None else self.finding.offset


def auditor(*rules: str) -> Callable[[Auditor], Auditor]:
    """Makes a function the auditor of rules."""

    def enter(function: Auditor) -> Auditor:
        AUDITORS.update(dict.fromkeys(rules, function))
        return function

    return enter


# RPC and transport


def _call(case: Case) -> wire.Call | None:
    return case.reading.call_at.get(case.frame)


def _operation(case: Case, pdu: wire.Pdu | None) -> Iterator[str]:
    known = pdu is not None and pdu.operation < len(wire.OPERATIONS)
    name = wire.OPERATIONS[pdu.operation] if known and pdu else None
    told = str(case.args.get("operation", "")).replace(" ", "")
    if name is None or told.lower() != name.lower():
        yield f"operation {case.args.get('operation')!r} is {name!r}"


@auditor("DS101")
def _no_response(case: Case) -> Iterator[str]:
    call = _call(case)
    if call is None or call.request.frame != case.frame:
        yield "there is no request in this frame"
        return
    yield from _operation(case, call.request)
    if call.response is not None:
        yield f"the response is in frame {call.response.frame}"
    for key, frames in case.reading.capture.pieces.items():
        request = call.request
        parts = key[0] == "RPC" and key[2:] == (
            request.source,
            request.activity,
            request.sequence,
            2,
        )
        later = key[0] == "IP" and key[1:3] == (request.target, request.source)
        begun = case.reading.capture.begun.get(key)  # without it nobody knows whose they are
        later = later and begun is not None and begun[1] in (None, request.key[1:])
        if parts or (later and frames[0] > request.frame):
            yield f"parts of a response are in the frames {frames}"


@auditor("DS102")
def _no_request(case: Case) -> Iterator[str]:
    stray = case.reading.stray_at.get(case.frame)
    if stray is None:
        yield "no response without a request is in this frame"
        return
    yield from _operation(case, stray)


@auditor("DS103")
def _again(case: Case) -> Iterator[str]:
    call = _call(case)
    if call is None or case.frame not in call.again:
        yield "no request of an earlier frame is sent again here"
        return
    yield from _operation(case, call.request)
    yield from case.wrong("first", call.request.frame)


@auditor("DS104")
def _fault(case: Case) -> Iterator[str]:
    kinds = {wire.FAULT: "fault", wire.REJECT: "reject"}
    for pdu in case.reading.by_frame.get(case.frame, []):
        if pdu.kind in kinds:
            yield from case.wrong("kind", kinds[pdu.kind])
            (code,) = struct.unpack_from(pdu.order + "I", pdu.body.ljust(4, b"\0"))
            yield from case.wrong("fault", code)
            return
    yield "neither fault nor reject is in this frame"


@auditor("DS105")
def _pieces(case: Case) -> Iterator[str]:
    for key, frames in case.reading.capture.pieces.items():
        there = case.reading.capture.fragments.get(key, frames)
        if key[0] == case.args.get("kind") and case.frame in there:
            yield from case.wrong("have", len(frames))
            return
    yield f"no {case.args.get('kind')} fragments that never became whole are in this frame"


@auditor("DS106")
def _cut(case: Case) -> Iterator[str]:
    frame = case.reading.capture.frame(case.frame)
    if frame is None or not frame.cut:
        yield "the frame is whole"
        return
    yield from case.wrong("captured", len(frame.data))
    yield from case.wrong("original", frame.length)
    whole = case.args.get("completed")
    if whole is None:
        yield from case.wrong("length", None)
        return
    if not any(case.frame in each.frames for each in case.reading.by_frame.get(whole, [])):
        yield f"no call of this frame is complete in frame {whole}"
    records = [
        *case.reading.asked_at.get(whole, []), *case.reading.answered_at.get(whole, []),
    ]  # fmt: skip
    if case.args.get("length") is None:
        if not any(each.untold for each in records):
            yield "the length of its record is there, or it has none"
    elif case.args.get("length") not in {each.stated for each in records}:
        yield f"length {case.args.get('length')!r} is none of {[each.stated for each in records]}"


@auditor("DS109")
def _limit(case: Case) -> Iterator[str]:
    tables = tomllib.loads(LIMITS.read_text(encoding="utf-8")).values()
    limits = {name: value for table in tables for name, value in table.items()}
    yield from case.wrong("most", limits.get(case.args.get("limit")))
    count = case.args.get("count")
    if not isinstance(count, int) or count < 1:
        yield f"count {count!r} is nothing that was given up"
    if case.reading.capture.frame(case.frame) is None:
        yield "there is no such frame"


@auditor("DS107")
def _back(case: Case) -> Iterator[str]:
    first = case.args.get("first")
    now, before = case.reading.time(case.frame), case.reading.time(first)
    if now is None or before is None or first is None:
        yield "there are no two frames"
        return
    if first >= case.frame:
        yield "the other frame is not an earlier one"
    if before <= now:
        yield "time does not step back here"
    yield from _ms(case, "milliseconds", (before - now) / 1e6)


@auditor("DS108")
def _empty(case: Case) -> Iterator[str]:
    here = case.reading.by_frame.get(case.frame, [])
    if not any(len(pdu.body) < 84 for pdu in here):
        yield "the body has room for a record call"
    elif any(pdu.cut for pdu in here):
        yield "the capture cut it"


def _ms(case: Case, name: str, truth: float) -> Iterator[str]:
    told = case.args.get(name)
    if not isinstance(told, (int, float)) or abs(told - truth) > 1e-6 * max(1.0, abs(truth)):
        yield f"{name} {told!r} is {truth:.6f}"


@auditor("DS111")
def _second_response(case: Case) -> Iterator[str]:
    found = [
        call for call in case.reading.capture.calls
        if case.frame in (each.frame for each in call.others)
    ]  # fmt: skip
    if not found or (first := found[0].response) is None:
        yield "no second response to a call is in this frame, with other bytes"
        return
    yield from _operation(case, found[0].request)
    yield from case.wrong("first", first.frame)
    asked = (found[0].again, _doubled(case, found[0]))
    again = any(frame < case.frame for frames in asked for frame in frames)
    yield from case.wrong("has", "has_either" if again else "has_first")


def _doubled(case: Case, call: wire.Call) -> list[int]:
    """The frames in which the wire brought its request once more: later than a mirror port does."""
    begin = call.request.time_ns
    return [at for at in call.copies if (case.reading.time(at) or 0) - begin > wire.COPY_NS]


# Record calls


def _refused(case: Case, write: bool) -> Iterator[str]:
    deal = case.deal
    if deal is not None and not write and case.frame in [each["response"] for each in deal.polls]:
        yield from case.wrong("status", f"{SHORT:08X}")
    elif deal is not None:
        status = deal.write_status if write else deal.read_status
        frame = deal.frames["write_response"] if write else deal.read
        if frame != case.frame:
            yield f"the response of #{deal.id} is in frame {frame}"
        if not status:
            yield "its status is not negative"
        yield from case.wrong("status", None if status is None else f"{status:08X}")
    seen = {each.status for each in case.answers() if each.write is write}
    told = case.args.get("status")
    if told is None or int(told, 16) not in seen:
        yield f"status {told} is none of {[f'{each or 0:08X}' for each in seen]} in the frame"


@auditor("DS201")
def _read_refused(case: Case) -> Iterator[str]:
    yield from _refused(case, False)


@auditor("DS203")
def _write_refused(case: Case) -> Iterator[str]:
    yield from _refused(case, True)


@auditor("DS202")
def _record_length(case: Case) -> Iterator[str]:
    told = [each for each in case.requests() if each.write]
    told += [each for each in case.answers() if not each.write]
    mine = case.records()
    found = [(each.stated, len(each.data)) for each in told if each in mine]
    if (case.args.get("stated"), case.args.get("present")) not in found:
        yield f"stated and present are {found}"
    elif case.args["stated"] == case.args["present"]:
        yield "they are equal"


@auditor("DS204")
def _polled(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None:
        yield "belongs to no transaction"
        return
    yield from case.wrong("count", len(case.reading.not_ready(deal)))
    yield from _are_polls(case, deal)
    if deal.read != case.frame:
        yield f"the response is in frame {deal.read}"


def _are_polls(case: Case, deal: Deal) -> Iterator[str]:
    for poll in deal.polls:
        frame = poll["response"]
        answers = case.reading.answered_at.get(frame or 0, [])
        stray = frame in case.reading.stray_at and not answers
        put_off = any(each.status in (NOT_READY, SHORT) and not each.write for each in answers)
        if not put_off and not stray:
            yield f"frame {frame} is no poll with DE80B500 or DE80B100"


@auditor("DS205")
def _polled_long(case: Case) -> Iterator[str]:
    deal = case.deal
    polls = case.reading.not_ready(deal) if deal is not None else []
    if deal is None or not polls:
        yield "was not polled"
        return
    first = polls[0]["request"] or polls[0]["response"]
    begin, end = case.reading.time(first), case.reading.time(deal.read)
    if begin is None or end is None or deal.read != case.frame:
        yield "there is no response in this frame"
        return
    yield from _ms(case, "milliseconds", (end - begin) / 1e6)
    yield from case.wrong("limit", 1000)
    if (end - begin) <= 10**9:
        yield "that is not above the limit"


@auditor("DS206")
def _nothing(case: Case) -> Iterator[str]:
    reads = [each for each in case.answers() if not each.write]
    if not reads:
        yield "no Read is answered in this frame"
        return
    read = reads[0]
    told = case.args.get("status")
    truth = None if read.status is None else f"{read.status:08X}"
    if told != truth:
        yield f"status {told!r} is {truth!r}"
    if read.data:
        yield "the Read brings data"
    waiting = [
        deal for deal in case.reading.deals
        if case.reading.same_place(deal, read) and (deal.write or 10**9) < case.frame
        and not deal.write_status and case.frame <= (deal.read or 0)
    ]  # fmt: skip
    if waiting:
        yield f"#{waiting[0].id} was open on this channel"
    if case.reading.line is None and not read.implicit:
        yield from _not_asked(case, read)


def _not_asked(case: Case, read: wire.Record) -> Iterator[str]:
    """Why a Read may be for a request that is not in the capture: what is known of the channel begins behind it."""
    ar = None if read.ar.int == 0 else str(read.ar)
    key = (read.controller, read.device, ar, *read.channel[3:])
    free = [
        each.answered for each in case.reading.on_channel.get(key, [])
        if not each.write and each.answered and each.answered < case.frame
    ] + [
        each.frame
        for each in (
            *(call.request for call in case.reading.capture.calls), *case.reading.capture.strays
        )
        if each.operation == wire.CONNECT and read.ar.bytes in each.body
    ]  # fmt: skip
    before = [frame for frame in free if frame < case.frame]
    if not before:
        yield "its request may have been sent before the capture began"
        return
    yield from case.reading.gaps.between(read.controller, read.device, max(before), case.frame)


@auditor("DS207")
def _without_data(case: Case) -> Iterator[str]:
    if not any(not each.write and each.status == 0 and not each.stated for each in case.answers()):
        yield "no positive Read without data is in this frame"


@auditor("DS208")
def _nested(case: Case) -> Iterator[str]:
    if not any(each.nested for each in case.requests()):
        yield "no IODWriteMultiple inside another one is in this frame"


def _is_echo(read: wire.Record, write: wire.Record) -> bool:
    """Whether a Read brings what a Write before it wrote."""
    there = (write.api, write.slot, write.subslot) == (read.api, read.slot, read.subslot)
    both = write.write and not read.write and there and (read.answered or 0) > write.asked
    return both and bool(read.data) and read.data == write.data


@auditor("DS209")
def _unproven(case: Case) -> Iterator[str]:
    reading = case.reading
    device = case.args.get("device")
    if any(connection[1] == device for connection in reading.connections_of_47):
        yield "index 47 of this device is the parameter channel"
    left = [each for each in reading.capture.records if each.index == 47 and each.device == device]
    yield from case.wrong("count", len(left))
    alone = not any(each.asked for each in left)
    yield from case.wrong("what", "unproven_responses" if alone else "unproven_calls")
    frames = [frame for each in left for frame in (each.asked, each.answered) if frame]
    asked = [each.asked or each.answered for each in left]  # an answer may stand before its request
    if left and case.frame not in (min(frames), min(asked)):
        yield f"the first one is in frame {min(frames)}"
    if any(_is_echo(read, write) for read in left for write in left):
        return  # a store, whatever was written there
    for each in left:
        asked = message.request(each.data) if each.write else None
        if each.api == 0x3A00 or (
            asked is not None and asked.sound and not any(asked.rest) and asked.addresses
            and asked.id in (*message.READS, *message.CHANGES)
            and all(one.pnu and one.attribute in (0x10, 0x20, 0x30) for one in asked.addresses)
        ):  # fmt: skip
            yield f"frame {each.asked} shows that it is DS47"


# Messages


def _told(case: Case) -> tuple[message.Message | None, list[str]]:
    found = case.message()
    return found, [] if found else ["no message of a transaction is in this frame"]


def _byte(case: Case, at: int, name: str | None, wanted: Callable[[int], bool]) -> Iterator[str]:
    """One byte of the message: where it is, what it is, and whether that is what the rule speaks of."""
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    if len(found.data) <= at:
        yield f"the message has no byte {at}"
        return
    value = found.data[at]
    if case.finding.offset is not None and case.finding.offset != at:
        yield f"the offset is {at}"
    if not wanted(value):
        yield f"the byte is 0x{value:02X}"
    if name is not None:
        told = case.args.get(name)
        if told not in (value, f"0x{value:02X}"):
            yield f"{name} {told!r} is 0x{value:02X}"


@auditor("DS301")
def _reference_zero(case: Case) -> Iterator[str]:
    yield from _byte(case, 0, None, lambda value: value == 0)


@auditor("DS302")
def _request_id(case: Case) -> Iterator[str]:
    known = (0x01, 0x02, 0x40, 0x41, 0x42, 0x51, 0x52)
    yield from _byte(case, 1, "id", lambda value: value not in known)


@auditor("DS303")
def _count_zero(case: Case) -> Iterator[str]:
    yield from _byte(case, 3, None, lambda value: value == 0)


@auditor("DS304")
def _count_high(case: Case) -> Iterator[str]:
    limit = case.args.get("limit")
    yield from _byte(case, 3, "count", lambda value: isinstance(limit, int) and value > limit)
    if limit != 39:
        read = [each for each in _limits(case, 1) if each == limit]
        if not read:
            yield f"limit {limit!r} was not read from PNU 974[1]"
    else:
        more = [each for each in _limits(case, 1) if each >= (case.args.get("count") or 0)]
        if more:
            yield f"PNU 974[1] of this device is {more[-1]}"


def _limits(case: Case, element: int) -> list[int]:
    """The values of PNU 974 that were read from the device, in this capture."""
    found = []
    for deal in case.reading.deals:
        if case.deal is None or deal.device != case.deal.device or deal.operation != "read":
            continue
        for address, block in deal.pairs():
            if address.pnu == 974 and not block.failed:
                found += [
                    int.from_bytes(bits)
                    for at, bits in enumerate(block.elements(), address.subindex)
                    if at == element
                ]
    return [each for each in found if each > 0]


def _address(case: Case, wanted: Callable[[message.Address], bool]) -> Iterator[message.Address]:
    """The address of the request at or around the offset."""
    found = case.message()
    for each in found.addresses if found else ():
        if each.offset <= case.at_offset() < each.offset + 6 and wanted(each):
            yield each


@auditor("DS305")
def _attribute(case: Case) -> Iterator[str]:
    odd = list(_address(case, lambda each: each.attribute not in (0x10, 0x20, 0x30)))
    if not odd:
        yield "no unknown attribute is at this offset"
        return
    if case.args.get("attribute") not in (odd[0].attribute, f"0x{odd[0].attribute:02X}"):
        yield f"attribute {case.args.get('attribute')!r} is 0x{odd[0].attribute:02X}"


@auditor("DS306")
def _pnu_zero(case: Case) -> Iterator[str]:
    if not list(_address(case, lambda each: each.pnu == 0)):
        yield "no PNU 0 is at this offset"


@auditor("DS307")
def _elements_high(case: Case) -> Iterator[str]:
    high = list(_address(case, lambda each: each.elements > 234))
    if not high:
        yield "no number of elements above 234 is at this offset"
        return
    yield from case.wrong("count", high[0].elements)
    yield from case.wrong("limit", 234)


@auditor("DS308")
def _overflow(case: Case) -> Iterator[str]:
    over = list(_address(case, lambda each: each.subindex + each.elements - 1 > 65535))
    if not over:
        yield "no subindex that runs past 65535 is at this offset"
        return
    yield from case.wrong("subindex", over[0].subindex)
    yield from case.wrong("count", over[0].elements)


@auditor("DS309")
def _format(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    if found.unknown is None:
        yield "every format is known"
        return
    value = found.data[found.unknown]
    if case.finding.offset != found.unknown:
        yield f"the offset is {found.unknown}"
    if case.args.get("format") not in (value, f"0x{value:02X}"):
        yield f"format {case.args.get('format')!r} is 0x{value:02X}"


@auditor("DS310")
def _value_count(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    blocks = list(found.blocks)
    if found.unknown is not None and found.unknown + 1 < len(found.data):
        at = found.unknown
        blocks.append(message.Block(found.data[at], found.data[at + 1], b"", at, 0))
    for address, block in zip(found.addresses, blocks, strict=False):
        if block.offset <= case.at_offset() < block.offset + 2:
            yield from case.wrong("values", block.count)
            if case.args.get("elements") not in (address.elements, max(1, address.elements)):
                yield f"elements {case.args.get('elements')!r} is {address.elements}"
            if block.count == max(1, address.elements):
                yield "they are equal"
            return
    yield "no value block is at this offset"


@auditor("DS311")
def _no_pad(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found and not any(pad is None for _, pad in found.pads):
        yield "no pad byte is missing"


@auditor("DS312")
def _odd_pad(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    pads = [pad for at, pad in found.pads if pad and at == case.finding.offset]
    if not pads:
        yield "no pad byte other than 0 is at this offset"
    elif case.args.get("pad") not in (pads[0], f"0x{pads[0]:02X}"):
        yield f"pad {case.args.get('pad')!r} is 0x{pads[0]:02X}"


@auditor("DS313", "DS314")
def _rest(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    rest = found.rest if found.sound else b""
    if found is (case.deal.answer if case.deal else None) and found.id not in message.KNOWN:
        rest = found.data[4:]  # whether blocks stand behind an unknown ID nobody knows
    elif (
        found.asked_for
        and case.finding.offset == 4 + 6 * len(found.addresses)
        and (found.id or 0) > 2
    ):
        rest = found.data[case.finding.offset :]
    yield from case.wrong("count", len(rest))
    if not rest or any(rest) is not (case.finding.rule == "DS313"):
        yield f"what is left over is {rest.hex()!r}"
    if case.finding.offset is not None and case.finding.offset != len(found.data) - len(rest):
        yield f"the offset is {len(found.data) - len(rest)}"


@auditor("DS315")
def _missing(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    if not found.missing:
        yield "nothing is missing"
        return
    unpadded = bool(found.pads) and found.pads[-1][1] is None
    if case.args.get("need") not in (found.missing, found.missing - unpadded):
        yield f"need {case.args.get('need')!r} is {found.missing}"
    yield from case.wrong("what", _cut_part(found))
    frame = case.reading.capture.frame(case.frame)
    records = case.reading.asked_at.get(case.frame, [])  # of several in a frame some may be whole
    whole = any(each.data == found.data and each.stated == len(found.data) for each in records)
    if frame is not None and frame.cut and not whole:
        yield "the capture cut the frame, not the sender the message"


def _cut_part(found: message.Message) -> str:
    """The part of a message in which it ends."""
    count = found.count
    if len(found.data) < 4 or count is None:
        return "header"
    if found.asked_for and len(found.addresses) < count:
        return f"address {len(found.addresses) + 1} of {count}"
    if found.id == 0x80 and not found.asked_for and len(found.data) == 5:
        return "block header"  # how many there are is not said
    blocks = len(found.blocks)
    last = found.blocks[-1] if found.blocks else None
    if last is not None and len(last.raw) < last.count * last.size:
        return f"values of block {blocks}"
    return f"value block {blocks + 1} of {count}"


@auditor("DS316")
def _long(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    asked = [each for each in case.reading.asked_at.get(case.frame, []) if each.write]
    whole = max((each.stated for each in asked if each.data == found.data), default=0)
    # The capture may have cut it.
    length, limit = max(len(found.data), whole), case.args.get("limit")
    yield from case.wrong("length", length)
    if limit not in (240, *_limits(case, 0)):
        yield f"limit {limit!r} was not read from PNU 974[0]"
    if isinstance(limit, int) and length <= limit:
        yield "it is not longer"


@auditor("DS317")
def _two_sizes(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    if found is None:
        return
    at = case.at_offset()
    code = found.data[at] if 0 <= at < len(found.data) else None
    here = [each for each in found.blocks if each.offset == at]
    if code is None or not any(code in other for other in message.TWO_SIZES) or not here:
        yield "no format of two sizes is at this offset"
        return
    yield from case.wrong("size", here[0].size)
    if case.args.get("format") not in (f"0x{code:02X}", "TimeDifference" if code == 0x0D else None):
        yield f"format {case.args.get('format')!r} is 0x{code:02X}"


@auditor("DS318")
def _words(case: Case) -> Iterator[str]:
    found, problems = _told(case)
    yield from problems
    blocks = [each for each in found.blocks if each.failed] if found else []
    here = [each for each in blocks if each.offset <= case.at_offset() < each.offset + 2]
    if not here or here[0].count in (1, 2):
        yield "no error block with other than 1 or 2 words is at this offset"
    else:
        yield from case.wrong("count", here[0].count)


@auditor("DS319")
def _response_id(case: Case) -> Iterator[str]:
    known = (1, 2, 0x80, 0x81, 0x82, 0x40, 0xC0, 0x41, 0xC1, 0x42, 0xC2, 0x51, 0xD1, 0x52, 0xD2)
    yield from _byte(case, 1, "id", lambda value: value not in known)


# Conversations


@auditor("DS401", "DS402")
def _unanswered(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None:
        yield "belongs to no request"
        return
    yield from _asked_for(case, deal.asked, changes=case.finding.rule == "DS402")
    if deal.write != case.frame:
        yield f"the request is in frame {deal.write}"
    if deal.answer is not None or deal.read is not None:
        yield f"the response is in frame {deal.read}"
    yield from _reason(case, deal)
    yield from absent(case, deal, _over(case, deal))


def absent(case: Case, deal: Deal, end: int) -> Iterator[str]:
    """Why nobody knows that a response was not fetched up to a frame: what the capture may lack of it."""
    begin, gaps = deal.write or 0, case.reading.gaps
    if case.reading.line is not None or deal.cyclic:
        return
    yield from gaps.unheard(deal.controller, deal.device)
    yield from gaps.between(deal.controller, deal.device, begin, end)
    for each in case.reading.on_channel.get(deal.channel, []):
        lost = not each.write and begin < each.asked < end and each.answered is None
        if lost and not each.call.again:
            yield f"the response to the Read of frame {each.asked} is not in the capture"


def _over(case: Case, deal: Deal) -> int:
    """The frame in which a transaction ended that has no response."""
    if case.args.get("reason") == "release":
        return min(case.reading.ends(deal), default=10**9)
    last = (case.reading.time(max(deal.all_frames)) or 0) + 600 * 10**9
    late = [each.number for each in case.reading.capture.frames if each.time_ns > last]
    return min(late, default=10**9)


def _asked_for(case: Case, asked: message.Message, *, changes: bool) -> Iterator[str]:
    """That the sentence calls a request what it is: makers' services are neither read nor change."""
    text = case.finding.message.lower()
    if (asked.id == message.CHANGE) is not changes or ("parameter change" in text) is not changes:
        yield "the operation is another one"
    if "parameter read" in text and asked.id not in message.READS:
        yield f"request ID 0x{asked.id or 0:02X} is no read"


def _reason(case: Case, deal: Deal) -> Iterator[str]:
    """Why it stayed without: the Release of its AR, ten minutes of silence, or the end of the capture."""
    told, capture = case.args.get("reason"), case.reading.capture
    released = case.reading.ends(deal)
    refused = {
        each.write
        for each in case.reading.deals
        if each.state == "refused" and not each.read_status
    }
    later = [
        each.asked or each.answered for each in case.reading.on_channel.get(deal.channel, [])
        if (
            each.asked > (deal.write or 0) and each.status in (None, 0) and each.asked not in refused
            if each.write else (each.asked or each.answered or 0) > max(deal.all_frames) and bool(each.data)
        )
    ]  # fmt: skip
    end = capture.frames[-1].time_ns if capture.frames else 0
    silent = end - (case.reading.time(max(deal.all_frames)) or 0) > 600 * 10**9
    if told == "release" and not released:
        yield "its AR was not released"
    elif told == "end" and any(
        call is None or call.response
        for call in map(
            case.reading.call_at.get, case.reading.releases(deal)
        )  # None: a lone response
    ):
        yield f"its AR was released in frame {released[0]}"
    elif told == "end" and (own := [frame for frame in later if not _older(case, deal, frame)]):
        yield f"the channel goes on in frame {own[0]}"
    elif told == "expired" and not silent and not later:
        yield "no ten minutes passed"
    elif told == "unseen":
        yield from _unseen(case, deal)
    elif told == "later":
        yield from _later(case, deal, refused)
    elif told not in (None, "later", "release", "end", "expired", "dropped"):
        yield f"reason {told!r} is none"
    elif told is None and not later:
        yield "gives no reason"


def _older(case: Case, deal: Deal, frame: int) -> bool:
    """Whether a Read is one of a request before this one."""
    return any(
        frame in each.all_frames and each.channel == deal.channel and (each.write or 0) < (deal.write or 0)
        for each in case.reading.deals
    )  # fmt: skip


def _unseen(case: Case, deal: Deal) -> Iterator[str]:
    """That its responses are not in the capture: the channel went on, and neither call of it has one."""
    calls = [each.asked or each.answered or 0 for each in case.reading.on_channel[deal.channel]]
    if not any(frame > (deal.write or 0) and frame not in deal.all_frames for frame in calls):
        yield "nothing follows on this channel, the capture ends"
    if deal.frames["write_response"] is not None or deal.polls:
        yield "a response of it is in the capture"


def _later(case: Case, deal: Deal, refused: set[int | None]) -> Iterator[str]:
    """That a later Write has no response in the capture, and none was accepted."""
    writes = [
        each for each in case.reading.on_channel.get(deal.channel, [])
        if each.write and each.asked > (deal.write or 0) and each.asked not in refused
    ]  # fmt: skip
    if not any(each.answered is None for each in writes):
        yield "each later Write of its channel has its response"
    taken = [each.asked for each in writes if each.status == 0]
    if taken:
        yield f"the Write of frame {taken[0]} was accepted"


def _pending(case: Case, deal: Deal) -> Iterator[str]:
    """That a later Write has no response, whatever came behind it."""
    later = [
        each for each in case.reading.on_channel.get(deal.channel, [])
        if each.write and each.asked > (deal.write or 0)
    ]  # fmt: skip
    if all(each.answered is not None and not each.untold for each in later):
        yield "each later Write of its channel has its response"


@auditor("DS403")
def _orphan(case: Case) -> Iterator[str]:
    deal = case.deal
    data = deal.answer.data if deal and deal.answer else b""
    if deal is None or deal.read != case.frame or not (data or deal.short):
        yield "no response of a transaction is in this frame"
        return
    if deal.asked is not None:
        yield f"the request is in frame {deal.write}"
    reads = [each for each in case.answers() if not each.write and each.data == data]
    there = [
        each for each in case.reading.deals
        if each.place == deal.place and each.asked is not None and each.answer is not None
        and (each.read or 10**9) < case.frame
    ]  # fmt: skip
    same = [each for each in there if each.answer and each.answer.data == data]
    last = max(there, key=lambda each: each.read or 0, default=None)
    others = [
        each.read or 0 for each in case.reading.deals
        if each.place == deal.place and each.asked is None and each is not deal
    ]  # fmt: skip
    told = case.args.get("case")
    implicit = bool(reads) and all(each.implicit for each in reads)
    if told not in ("unasked", "unasked_behind", "unasked_without_ar", "unasked_again"):
        yield f"case {told!r} is none"
    elif (told in ("unasked", "unasked_behind")) is implicit:
        yield f"case {told!r}, but a ReadImplicit is {'here' if implicit else 'not here'}"
    if told == "unasked_again" and not same:
        yield "no transaction with this response is over"
    elif (
        told == "unasked_without_ar"
        and last in same
        and last
        and last.state not in ("refused", "mismatch")  # then it says nothing of its request either
        and not any((last.read or 0) < each < case.frame for each in others)
        # Else it proves no AR: what was read may be no response yet.
        and last.operation != "unknown"
        and not (last.index == 47 and _is_broken(last, case))
        and not any(each.call.response and each.call.response.cut for each in reads)
        and not any(
            each.asked > (each.answered or 0) for each in reads
        )  # it looked like a hole then
        and not case.reading.gaps.leaves_open(
            last.controller, last.device, last.read or 0, case.frame
        )
    ):
        yield f"the same response was read in frame {last.read}, the request is in {last.write}"
    elif told in ("unasked", "unasked_behind"):
        here = [each for each in case.reading.deals if each.channel == deal.channel]
        newest = max(
            (each.write for each in here if each.write and each.write < case.frame), default=None
        )
        if newest is None or told == "unasked_behind":
            yield from case.wrong("first", newest)
        elif not _is_forgotten(deal, newest, case):
            yield f"a Write of its channel is in frame {newest}"
        unsure = [each.asked for each in here if each.asked and each.state == "incomplete"]
        its_own = any(not data or each.reference == data[0] for each in unsure)
        for other in here:
            open_still = _is_open(other, case.frame, case.reading) and other.state != "incomplete"
            open_still = open_still and (other.write or 0) < (
                deal.plain["frames"]["read_request"] or case.frame
            )
            # Else it is a wrong one of that, or the one of the other.
            if open_still and not its_own:
                yield f"the request of frame {other.write} is open"


def _is_broken(deal: Deal, case: Case) -> bool:
    """Whether something is wrong with the messages of a transaction."""
    return any(
        each.rule.startswith("DS3") for each in case.reading.findings if each.transaction == deal.id
    )


def _is_forgotten(deal: Deal, written: int, case: Case) -> bool:
    """Whether the channel of a transaction was given up, or its connection ended, behind a Write of it."""
    reading = case.reading
    silent = (reading.time(case.frame) or 0) - (reading.time(written) or 0) > 600 * 10**9
    over = any(written < each < case.frame for each in reading.ends(deal))
    return silent or over or any(each.rule == "DS109" for each in reading.findings)


def _is_open(deal: Deal, frame: int, reading: Reading) -> bool:
    """Whether a request was accepted before a frame, and nothing ended it before that."""
    accepted = deal.frames["write_response"]
    if deal.write_status != 0 or accepted is None or accepted >= frame:
        return False
    displaced = [
        each.asked for each in reading.on_channel.get(deal.channel, [])
        if each.write and each.asked > (deal.write or 0)
        and (each.status == 0 or (not each.status and (*deal.channel, each.asked) in reading.asked_and_answered))
    ]  # fmt: skip
    before = max(each for each in deal.all_frames if each < frame)
    silent = (reading.time(frame) or 0) - (reading.time(before) or 0) > 600 * 10**9
    return not silent and min([deal.read or 10**9, *displaced, *reading.ends(deal)]) > frame


@auditor("DS404", "DS405", "DS406", "DS407")
def _mirror(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.answer is None or deal.read != case.frame:
        yield "no response to a request is in this frame"
        return
    names = {"DS404": "reference", "DS405": "id", "DS406": "axis", "DS407": "count"}
    name = names[case.finding.rule]
    sent, got = getattr(deal.asked, name), getattr(deal.answer, name)
    yield from case.wrong("sent", sent)
    yield from case.wrong("got", got)
    fits = got in (sent, sent | 0x80, 0x80) if name == "id" and sent is not None else sent == got
    if fits:
        yield "they fit"


@auditor("DS408", "DS409")
def _values(case: Case) -> Iterator[str]:
    deal = case.deal
    for address, block in deal.pairs() if deal and deal.read == case.frame else ():
        if block.offset != case.at_offset():
            continue
        yield from case.wrong("pnu", address.pnu)
        yield from case.wrong("asked", max(1, address.elements))
        yield from case.wrong("got", block.count)
        if (block.count < max(1, address.elements)) is not (case.finding.rule == "DS408"):
            yield "it is the other way round"
        if block.count == max(1, address.elements):
            yield "they are equal"
        return
    yield "no block of an answer is at this offset"


@auditor("DS410")
def _error(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.answer is None or deal.read != case.frame:
        yield "no response is in this frame"
        return
    for number, block in enumerate(deal.answer.blocks):
        if block.offset != case.at_offset() or not block.failed:
            continue
        fits = deal.asked is not None and deal.fits and number < len(deal.asked.addresses)
        address = deal.asked.addresses[number] if fits and deal.asked else None
        yield from case.wrong("pnu", address.pnu if address else None)
        yield from case.wrong("subindex", address.subindex if address else None)
        told = not _is_of_a_maker(deal, block)
        yield from case.wrong("code", block.code if told else None)
        yield from case.wrong("info", block.info if told else None)
        yield from vendor(case)
        if deal.short and block.count and not block.words:
            yield "the capture cut the error number off"
        return
    yield "no error block is at this offset"


def _is_of_a_maker(deal: Deal, block: message.Block) -> bool:
    """Whether a word is no error number of the profile: a low one of a maker's own service (docs/protocol.md A.3).

    That is told by the response ID, and by the request where the response does not say that it is not supported.
    A request whose ID is one of a response (0xC0) is nobody's service.
    """
    asked, answer = deal.asked, deal.answer
    service = asked is not None and asked.id in message.MAKERS and not asked.id & 0x80
    own = service or (answer is not None and answer.id in message.MAKERS)
    if answer is not None and answer.id == 0x80:
        return False
    return own and block.code is not None and block.code <= 0xFF


OTHERS_ON_PROFIBUS = (0x001A, 0x0080, 0x03FB)
"""ABB, Danfoss, Delta: ident numbers of their drives are known."""


def vendor(case: Case) -> Iterator[str]:
    """The vendor of the device that was asked; None where the capture does not name it."""
    device = case.deal.device if case.deal else None
    known = case.reading.vendors.get(device) if device else None
    if str(device).startswith("dp"):  # the ident number says it, which is not looked at here
        told = case.args.get("vendor_id")
        other = told if told in OTHERS_ON_PROFIBUS else None
        known = {"sinamics": 0x2A, None: told if told == 0x2A else other, "profile": other}.get(
            case.args.get("family")
        )
    if case.args.get("vendor_id") not in (known, *((None,) if not known else ())):
        yield f"vendor_id {case.args.get('vendor_id')!r} is {known!r}"
    elif "vendor_id" in case.args and known and case.args["vendor_id"] is None:
        yield f"vendor_id is {known!r}"


@auditor("DS411", "DS412")
def _sign(case: Case) -> Iterator[str]:
    deal = case.deal
    answer = deal.answer if deal and deal.read == case.frame else None
    if answer is None or answer.id is None:
        yield "no response is in this frame"
        return
    inside = any(block.failed for block in answer.blocks)
    positive = case.finding.rule == "DS411"
    if bool(answer.id & 0x80) is positive or inside is not positive:
        yield f"the response ID is 0x{answer.id:02X}, errors inside: {inside}"


@auditor("DS413", "DS414")
def _superseded(case: Case) -> Iterator[str]:
    request, by = case.args.get("request"), case.args.get("by")
    deals = [each for each in case.reading.deals if each.write == request]
    deals = [each for each in deals if case.deal is None or each.id == case.deal.id] or deals
    asked = deals[0].asked if deals else None
    if asked is None:
        yield f"no request is in frame {request}"
        return
    deal = deals[0]
    yield from _asked_for(case, asked, changes=case.finding.rule == "DS414")
    if deal.answer is not None:
        yield f"its response was fetched in frame {deal.read}"
    later = [
        each.asked for each in case.reading.capture.records
        if each.write and not each.nested and each.asked == by
        and case.reading.same_place(deal, each) and not each.status
    ]  # fmt: skip
    if by is None or not later or by < (request or 0):
        yield f"no request that was accepted on its channel is in frame {by}"
    if by != case.frame:
        yield f"stands on frame {case.frame}, the new request is in {by}"
    between = [
        each.asked for each in case.reading.capture.records
        if each.write and each.status == 0 and case.reading.same_place(deal, each)
        and (request or 0) < each.asked < (by or 0)
    ]  # fmt: skip
    if between:
        yield f"the new request that followed is in frame {between[0]}"
    brought = [
        each.answered for each in case.reading.capture.records
        if not each.write and (each.data or each.short) and case.reading.same_place(deal, each)
        and (request or 0) < (each.answered or 0) < (by or 0)
        and (not each.asked or each.asked > (request or 0))
        and not _is_old(each, deal, case.reading) and not _is_of_an_older(each, deal, case.reading)
    ]  # fmt: skip
    if brought:
        yield f"a response was fetched in frame {brought[0]}"
    yield from absent(case, deal, case.frame)


def _is_of_an_older(record: wire.Record, deal: Deal, reading: Reading) -> bool:
    """Whether it mirrors the reference of an older request too, which was open and has it in the report."""
    return any(
        each.read == record.answered and (each.write or 0) < (deal.write or 0)
        and each.channel == deal.channel and each.asked is not None
        and each.asked.data[:1] == record.data[:1]
        for each in reading.deals
    )  # fmt: skip


def _is_old(read: wire.Record, deal: Deal, reading: Reading) -> bool:
    """Whether a Read brought what was read before a request already, under another reference than that has."""
    before = [
        each for each in reading.on_channel.get(deal.channel, [])
        if not each.write and each.data == read.data and 0 < (each.answered or 0) < (deal.write or 0)
    ]  # fmt: skip
    return (
        bool(before and read.data)
        and deal.asked is not None
        and read.data[0] != deal.asked.reference
    )


@auditor("DS415")
def _reference(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.write != case.frame:
        yield "no request is in this frame"
        return
    yield from case.wrong("reference", deal.asked.reference)
    before = [
        each for each in case.reading.deals
        if each.channel == deal.channel and each.asked and (each.write or 0) < case.frame
    ]  # fmt: skip
    previous = max(before, key=lambda each: each.write or 0, default=None)
    if previous is None or previous.asked is None:
        yield "there is no request before"
        return
    if previous.asked.reference != deal.asked.reference:
        yield f"the request before (frame {previous.write}) has {previous.asked.reference}"
    yield from case.wrong("first", previous.write)
    if case.reading.line is None:
        between = case.reading.gaps.between
        yield from between(deal.controller, deal.device, previous.write or 0, case.frame)


@auditor("DS416")
def _slow(case: Case) -> Iterator[str]:
    deal, time = case.deal, case.reading.time
    if deal is None or deal.read != case.frame:
        yield "no response is in this frame"
        return
    asked, accepted, read = time(deal.write), time(deal.frames["write_response"]), time(deal.read)
    poll = (
        deal.polls[0] if deal.polls else {"request": deal.frames["read_request"], "response": None}
    )
    first = time(poll["request"] or poll["response"])
    if asked is None or read is None:
        yield "has no request"
        return
    if accepted is None:
        yield "when the pause of the program began is not in the capture"
        return
    pause = max(0, first - accepted) if first is not None else 0
    truth, told = (read - asked - pause) / 1e6, case.args.get("milliseconds")
    lost = poll["request"] is None  # then only a least time is known
    if not lost or not isinstance(told, float) or not truth <= told <= (read - asked) / 1e6:
        yield from _ms(case, "milliseconds", truth)
    yield from case.wrong("limit", 1000)
    if read - asked <= 10**9:
        yield "that is not above the limit"


@auditor("DS417")
def _read_back(case: Case) -> Iterator[str]:
    deal, pnu, subindex = case.deal, case.args.get("pnu"), case.args.get("subindex")
    if deal is None or deal.read != case.frame or pnu is None or subindex is None:
        yield "no parameter was read in this frame"
        return
    got = [
        (bits, block)
        for address, block in deal.pairs()
        for element, bits in elements(address, block)
        if (address.pnu, element) == (pnu, subindex) and case.finding.offset in (None, block.offset)
    ]
    if not got or deal.operation != "read":
        yield f"p{pnu}[{subindex}] was not read here"
        return
    bits, block = got[0]
    if not means(case.args.get("read"), bits, block.format):
        yield f"read {case.args.get('read')!r} is {bits.hex()} under format 0x{block.format:02X}"
    last = case.memory.last(deal, pnu, subindex)
    target = case.memory.target(deal)
    sure = [
        each
        for each in last
        if each.bits is not None
        and each.end < (deal.write or 0)
        and case.memory.same(each.target, target) == SURE
    ]
    values = {each.tried if each.bits is None else each.bits for each in last}
    if not last:
        yield f"nobody wrote p{pnu}[{subindex}] of this drive object for certain"
    elif None in values:
        unknown = next(each.start for each in last if each.bits is None and each.tried is None)
        yield f"the value is not known since frame {unknown}"
    elif len(values) > 1:
        yield f"written last may be {sorted(each.hex() for each in values if each)}"
    else:
        # The newest one with this value is told, accepted for sure or not; or, where the drive may go by the slot
        # alone, one through the same slot.
        by, value = case.args.get("by"), next(each for each in values if each is not None)
        there = [each for each in case.memory.events if each in last or each.bits == value]
        told = [each for each in there if each.start == by and each.end < (deal.write or 0)]
        yield from _written(case, value, bits, (told or sure)[-1].start)


def _written(case: Case, written: bytes, bits: bytes, frame: int) -> Iterator[str]:
    """What was written last against what was read, as bits."""
    if len(written) != len(bits):
        yield f"{len(written)} bytes were written, {len(bits)} read"
    elif written == bits:
        yield "the bits are equal"
    if not any(means(case.args.get("written"), written, code) for code in message.LETTERS):
        yield f"written {case.args.get('written')!r} is {written.hex()} (frame {frame})"
    for name in ("frame", "by", "wrote", "write"):
        if name in case.args:
            yield from case.wrong(name, frame)


def means(told: object, bits: bytes, code: int) -> bool:
    """Whether a value of the report is these bits under a format."""
    letter = message.LETTERS.get(code)
    if letter is None:
        return told in (bits.hex(), int.from_bytes(bits), bits.decode("latin-1"))
    if struct.calcsize(letter) != len(bits):
        return False
    (value,) = struct.unpack(">" + letter, bits)
    if letter in "fd":
        try:
            given = float(told)  # type: ignore[arg-type]
            return struct.pack(">" + letter, given) == bits or (given != given and value != value)
        except (TypeError, ValueError, OverflowError):
            return False
    return told in (value, str(value))


@auditor("DS418")
def _not_supported(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.answer is None or deal.read != case.frame:
        yield "no response to a request is in this frame"
        return
    yield from case.wrong("id", deal.asked.id)
    if deal.answer.id != 0x80:
        yield f"the response ID is 0x{deal.answer.id or 0:02X}"


@auditor("DS419")
def _other_length(case: Case) -> Iterator[str]:
    """The same change, refused with 0x18 there and accepted here, one of them longer than the other."""
    first = case.args.get("first")
    there = [
        each for each in case.reading.deals if each.write == first and case.deal is not None
        and each.place == case.deal.place and each.asked is not None and each.answer is not None
    ]  # fmt: skip
    if case.deal is None or case.deal.state != "ok" or case.deal.asked is None or not there:
        yield "no such change is accepted here, and another one answered there"
        return
    one, other = there[0].asked, case.deal.asked
    codes = [block.code for block in there[0].answer.blocks] if there[0].answer else []
    if 0x18 not in codes:
        yield f"it was refused with {codes}"
    yield from case.wrong("refused", len(one.data) if one else None)
    yield from case.wrong("accepted", len(other.data))
    both = sorted(((one.data if one else b"")[1:], other.data[1:]), key=len)
    if not both[1].startswith(both[0]) or both[0] == both[1]:
        yield "they differ in more than their length"


# What the capture lacks


@auditor("DS110")
def _incomplete(case: Case) -> Iterator[str]:
    args, deal, gaps = case.args, case.deal, case.reading.gaps
    what = str(args.get("what"))
    known = ("first", "last", "numbers")
    told = {name for name in known if args.get(name) is not None}
    first = {"first"} if what in ("read_answer", "write_answer", "twice", "cut_off") else set()
    if what in ("written_again", "crossed"):
        first = {"first", "last"}
    if told not in ([{*known}, {"last", "numbers"}] if what == "calls" else [first]):
        yield f"{what} tells {sorted(told)}"
    if deal is None:
        yield from _read_for_nothing(case, what)
        return
    if deal.write != case.frame or (deal.answer is not None and deal.answer.id is not None):
        yield f"the request is in frame {deal.write}, its response in {deal.read}"
    pair = deal.controller, deal.device
    late = gaps.late(*pair)
    why: dict[str, Callable[[], Iterator[str]]] = {
        "calls": lambda: _is_gap(case, *pair),
        "requests": lambda: _lacks_requests(case, *pair, deal.write or 0),
        "halves": lambda: iter([] if late or gaps.newest(deal.device) else ["nothing is missing"]),
        "one_direction": lambda: iter(
            ["the device said something"] if gaps.spoke(*pair) < (deal.write or 0) else []
        ),
        "line": lambda: _lacks_turns(case, deal.device, deal.write or 0),
        "read_answer": lambda: _is_without(case, deal, False),
        "write_answer": lambda: _is_without(case, deal, True),
        "twice": lambda: _is_twice(case, deal),
        "written_again": lambda: _is_written_again(case, deal),
        "crossed": lambda: _is_crossed(case, deal),
        "renewed": lambda: _is_renewed(case, *pair, deal.write or 0),
        "ends": lambda: _ends(case, deal),
        "unseen": lambda: _unseen(case, deal),
        "later": lambda: iter([]) if late else _pending(case, deal),
        "cut_off": lambda: _is_cut_off(case, deal),
    }
    yield from why[what]() if what in why else [f"what {what!r} is nothing"]


def _is_cut_off(case: Case, deal: Deal) -> Iterator[str]:
    """That the capture cut off what a call of a transaction asks for, or what became of it."""
    first = case.args.get("first") or 0
    if first == deal.write and deal.cut and deal.asked is not None and deal.asked.id is None:
        return
    own = [
        each for each in case.reading.answered_at.get(first, [])
        if case.reading.same_place(deal, each) and (each.asked or first) >= (deal.write or 0)
    ]  # fmt: skip
    if not any(
        each.untold or (not each.write and each.short and len(each.data) < 2) for each in own
    ):
        yield f"frame {first} says what became of it, or is none of its calls"


def _read_for_nothing(case: Case, what: str) -> Iterator[str]:
    """Of a Read that brought nothing: its request may be there and not in the capture."""
    reads = [each for each in case.answers() if not each.write and not each.data]
    if not reads:
        yield "no Read without a record is answered in this frame"
        return
    pair = reads[0].controller, reads[0].device
    if what == "calls":
        yield from _is_gap(case, *pair)
    elif what == "requests":
        yield from _lacks_requests(case, *pair, 0)
    elif what == "line":
        yield from _lacks_turns(case, pair[1], 0)
    elif what == "begins":
        unknown = {each.frame for each in case.reading.findings if each.rule == "DS110"}
        for each in case.reading.deals:
            unknown |= {*each.all_frames} if each.asked is None else set()
        before = [
            each for each in case.reading.capture.records
            if each.channel == reads[0].channel and not each.write and each.answered not in unknown
            and (each.data or each.status not in (None, 0, NOT_READY, SHORT)) and (each.answered or 0) < case.frame
        ]  # fmt: skip
        silent = before and (case.reading.time(case.frame) or 0) - (
            case.reading.time(before[-1].answered) or 0
        ) > 600 * 10**9  # fmt: skip
        asked = reads[0].asked or case.frame
        # Out of order, a Release may stand before the response.
        over = any(asked < call.request.frame < case.frame for call in case.reading.given_up)
        if before and not silent and not over and not case.reading.gaps.newest(pair[1]):
            yield f"what was asked for before was fetched in frame {before[-1].answered}"
    elif what in ("read_answer", "cut_off"):
        yield from _lacks_answer(case, reads[0], what)
    elif what not in ("one_direction", "halves", "later", "write_answer", "renewed"):
        yield f"what {what!r} is nothing"


def _lacks_answer(case: Case, read: wire.Record, what: str) -> Iterator[str]:
    """That an earlier call of the channel of a Read has no answer, or one that is cut off before it says anything."""
    first, reading = case.args.get("first") or 0, case.reading
    there = reading.asked_at if what == "read_answer" else reading.answered_at
    mine = [each for each in there.get(first, []) if each.channel == read.channel]
    if what == "cut_off" and not any(each.untold for each in mine):
        yield f"no response that is cut off is in frame {first}"
    reads = [each for each in mine if not each.write]
    if what == "read_answer" and all(each.answered and not _swapped(case, each) for each in reads):
        yield f"no such Read without an answer is in frame {first}"


def _lacks_requests(case: Case, client: str, server: str, begin: int) -> Iterator[str]:
    """That a request is missing behind a frame: a response shows it, or it is there and cut."""
    gaps = case.reading.gaps
    found = [each.frame for each in gaps.strays(client, server)]
    found += gaps.cut(client, server)
    found += gaps.late(client, server)
    since = 0 if gaps.began_behind(client, server, begin) else begin
    if (client, server) in gaps.asked and not any(frame > since for frame in found):
        yield "no response without its request follows, nor a Write that is cut"


def _is_gap(case: Case, client: str, server: str) -> Iterator[str]:
    """That these numbers are missing, behind the one frame and before the other."""
    args, found = case.args, case.reading.gaps.of(client, server)
    mine = [
        frame for frame, *who in case.reading.capture.numbers
        if who[0] == client and frame in (args.get("first"), args.get("last"))
    ]  # fmt: skip
    strays = [each.frame for each in case.reading.gaps.strays(client, server)]
    strays += [
        each.response.frame for each in case.reading.capture.calls
        if each.response and each.response.frame < each.request.frame
    ]  # fmt: skip
    if args.get("last") not in (*mine, *strays) or (args.get("first") or 0) >= args["last"]:
        yield "no calls are in these frames, one after the other"
    if args.get("numbers") not in [each.text for each in found]:
        yield f"the numbers {args.get('numbers')} are not missing there: {[each.text for each in found]}"


def _lacks_turns(case: Case, device: str, begin: int) -> Iterator[str]:
    """That of a station an exchange or an answer is missing behind a frame."""
    line = case.reading.line
    late = [
        each.answer.number for each in (line.turns if line is not None else [])
        if each.answer is not None and each.answer.number > each.asked.number + 1
    ]  # fmt: skip
    if not any(number >= begin for number in (*case.reading.gaps.turns(device), *late)):
        yield "each exchange with the station is there, with its answer"


def _is_without(case: Case, deal: Deal, write: bool) -> Iterator[str]:
    """That a call of a transaction has no response."""
    calls = [
        each for each in case.reading.asked_at.get(case.args.get("first") or 0, [])
        if each.write is write and case.reading.same_place(deal, each)
    ]  # fmt: skip
    if not calls or (write and case.args.get("first") != deal.write):
        yield f"no such call is in frame {case.args.get('first')}"
    elif all(each.answered is not None and not _disordered(case, each) for each in calls):
        yield f"the call is answered in frame {calls[0].answered}"
    elif calls[0].asked < (deal.write or 0):
        yield "the call came before the request"


def _is_written_again(case: Case, deal: Deal) -> Iterator[str]:
    """That the same Write came later and was accepted, while this one had no response."""
    yield from case.wrong("first", deal.write)
    mine = [each for each in case.reading.asked_at.get(deal.write or 0, []) if each.write]
    again = [
        each for each in case.reading.asked_at.get(case.args.get("last") or 0, [])
        if each.write and each.status == 0
        and any(each.channel == one.channel and each.data == one.data for one in mine)
    ]  # fmt: skip
    if not again or (deal.write or 0) >= again[0].asked:
        yield f"the same Write is not accepted in frame {case.args.get('last')}"
        return
    before = [each.answered for each in mine if each.answered and each.answered < again[0].asked]
    if before:
        yield f"the Write is answered in frame {before[0]}"


def _is_renewed(case: Case, client: str, server: str, since: int) -> Iterator[str]:
    """That a client uses a number once more, for another call, behind a frame."""
    seen: set[tuple[object, int]] = set()
    for call in case.reading.capture.calls:
        asked = call.request
        if (asked.source, asked.target) == (client, server):
            if (asked.activity, asked.sequence) in seen and asked.frame > since:
                return
            seen.add((asked.activity, asked.sequence))
    yield f"no number of {client} stands for two calls"


def _is_crossed(case: Case, deal: Deal) -> Iterator[str]:
    """That two Writes of its channel, its own among them, were accepted in the other order."""
    frames = case.args.get("first") or 0, case.args.get("last") or 0
    accepted = [
        each.answered or 0
        for frame in frames for each in case.reading.asked_at.get(frame, [])
        if each.write and each.status == 0 and case.reading.same_place(deal, each)
    ]  # fmt: skip
    if deal.write not in frames:
        yield f"its own Write is in frame {deal.write}"
    if len(accepted) != 2 or frames != tuple(sorted(frames)) or accepted[0] < accepted[1]:
        yield f"they are accepted in frames {accepted}"


def _is_twice(case: Case, deal: Deal) -> Iterator[str]:
    """That a call of a transaction has two responses: its client may have either, or the device gave a record away."""
    first = case.args.get("first")
    calls = [
        each.call for each in case.reading.asked_at.get(first or 0, [])
        if case.reading.same_place(deal, each) and each.asked >= (deal.write or 0)
    ]  # fmt: skip
    known = [each for each in calls if each.others]
    if not any(e.request.operation != wire.WRITE or e.again or _doubled(case, e) for e in known):
        yield f"no call of it in frame {first} has two responses"


def _disordered(case: Case, record: wire.Record) -> bool:
    """Whether an answer is out of order: by the times, or behind a later call of its client, which had one before."""
    asked = record.call.request
    return _swapped(case, record) or any(
        frame < (record.answered or 0) and number > asked.sequence
        for frame, client, _, activity, number in case.reading.capture.numbers
        if (client, activity) == (asked.client, asked.activity)
    )


def _swapped(case: Case, record: wire.Record) -> bool:
    """Whether what stands before an answer in the capture came behind it, by their times, or before its request."""
    between = case.reading.capture.frames[record.asked - 1 : record.answered or 0]
    first, last = (each.time_ns for each in (between[0], between[-1]))
    return any(not first <= each.time_ns <= last for each in between)


def _ends(case: Case, deal: Deal) -> Iterator[str]:
    """That the capture ends before a response may be expected."""
    capture = case.reading.capture
    later = [each.time_ns for each in capture.frames if each.number > (deal.write or 0)]
    pair = deal.controller, deal.device  # of a plant beside it nothing follows
    calls = [
        case.reading.time(each.frame) or 0 for each in capture.pdus
        if pair in ((each.source, each.target), (each.target, each.source)) and each.frame not in capture.copies
    ]  # fmt: skip
    newest = max(later, default=0) if case.reading.line is not None else calls[-1]
    if newest - (case.reading.time(deal.write) or 0) >= 10 * 10**9 and case.reading.line is None:
        yield "the capture goes on for 10 s and more"
    if (released := case.reading.ends(deal)) and any(
        each.frame > released[0]
        and pair in ((each.source, each.target), (each.target, each.source))
        for each in capture.pdus
    ):  # by the last frame of the two no connection ends (P79)
        yield f"its AR was released in frame {released[0]}"
