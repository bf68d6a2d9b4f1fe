"""What diagnoses DS7xx claim, decided anew from frames and transactions.

`AUDITORS` are those of the findings DS7xx, as `claims.AUDITORS` are of the others; `diagnoses` looks at the
entries of the report that sum them up.
"""

from __future__ import annotations

import re
import shlex
import struct
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from itertools import combinations, pairwise, product
from math import inf
from pathlib import Path
from typing import Any

from tests.audit import cyclic, message, pkw, s7, stations, wire, words
from tests.audit.claims import Auditor, Case, absent, means, vendor
from tests.audit.memory import LOCAL, MAYBE, NO_SUCH_AXIS, OF_THE_DEVICE, SURE, Memory, Target
from tests.audit.reading import NOT_READY, SHORT, Complaint, Deal, Finding, Reading, shown

DISORDER_MS = 1000
"""By how much time steps back at the most where frames are out of order."""
AUDITORS: dict[str, Auditor] = {}
SIEMENS = 0x002A
IN_USE = 0xDF80B500
STATES = {
    0x6E: "p0010 = 3", 0x6F: "p0010 = 2", 0x70: "p0010 = 1", 0x71: "p0010 = 0", 0x72: "p0010 = 30",
    0x73: "p0010 = 95", 0x74: "p0010 = 5", 0x75: "p0010 > 0",
}  # fmt: skip
SHARED = 47
"""The record index that others use too."""
TOO_LONG = 0x15
TYPE_ERRORS = (0x02, 0x05, 0x17)
SOURCE_MOST = 9_999
SAVE_ONE, SAVE_ALL = 971, 977
RECORDS = (wire.READ, wire.WRITE, wire.IMPLICIT)
SPEC = Path(__file__).parents[2] / "python/ds47/spec"


def auditor(*rules: str) -> Callable[[Auditor], Auditor]:
    """Makes a function the auditor of rules."""

    def enter(function: Auditor) -> Auditor:
        AUDITORS.update(dict.fromkeys(rules, function))
        return function

    return enter


def _refusal(case: Case) -> Iterator[str]:
    """Of a rule with pnu, subindex and code: that parameter was answered with this error."""
    deal = case.deal
    if deal is None or deal.answer is None or deal.read != case.frame:
        yield "no response of a transaction is in this frame"
        return
    args = case.args
    wanted = args.get("pnu"), args.get("subindex"), args.get("code")
    found = [
        (address, block) for address, block in deal.pairs()
        if (address.pnu, address.subindex, block.code) == wanted
        and case.finding.offset in (None, block.offset)
    ]  # fmt: skip
    if not found:
        yield f"p{wanted[0]}[{wanted[1]}] was not answered with error {wanted[2]!r} here"
    for name in ("elements",):
        if name in args and not any(each.elements == args[name] for each, _ in found):
            yield f"{name} {args[name]!r} is another"
    yield from vendor(case)


@auditor("DS701")
def _not_seen(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.answer is None or deal.read != case.frame:
        yield "no response of a transaction is in this frame"
        return
    yield from case.wrong("id", deal.answer.id)
    codes = [block.code for block in deal.answer.blocks if block.failed and block.code is not None]
    yield from case.wrong("code", codes[0] if codes else None)
    records = case.reading.answered_at.get(case.frame, [])
    short = any(each.stated > len(each.data) for each in records if not each.write)
    yield from case.wrong("among", len(set(codes)) > 1)
    if short and not codes and any(block.count for block in deal.answer.blocks if block.failed):
        yield "the error number is not there"
    yield from vendor(case)
    if not (deal.answer.id or 0) & 0x80:
        yield "the response is positive"
    if deal.write_status or deal.read_status:
        yield "a STATUS tells of it"
    polls = case.reading.not_ready(deal)
    yield from case.wrong("polls", len(polls))
    yield from case.wrong("case", "status_zero_at_last" if polls else "status_zero")
    yield from case.wrong("asked", deal.asked.count if deal.asked else None)


@auditor("DS702")
def _early(case: Case) -> Iterator[str]:
    deal, frame, by = case.deal, case.args.get("frame"), case.args.get("by")
    if deal is None:
        yield "belongs to no transaction"
        return
    reads = [
        each for each in case.reading.asked_at.get(frame or 0, [])
        if not each.write and case.reading.same_place(deal, each)
    ]  # fmt: skip
    if not reads:
        yield f"no Read of its channel is in frame {frame}"
    yield from case.wrong("by", deal.frames["write_response"])
    if frame != case.frame or frame is None or by is None or frame > by or deal.write_status:
        yield "the Write was answered before"
    elif (case.reading.time(frame) or 0) > (case.reading.time(by) or 0):
        yield "by their own times the Write was answered before"


@auditor("DS703")
def _nothing_asked(case: Case) -> Iterator[str]:
    polled = {poll["response"] for deal in case.reading.deals for poll in deal.polls}
    unknown = {each.frame for each in case.reading.findings if each.rule == "DS110"}
    found = [
        each for each in case.reading.capture.records
        if not each.write and each.status == NOT_READY and each.answered not in polled
        and case.reading.is_ours(each) and each.device == case.args.get("device") and each.answered not in unknown
        and not _is_late(each, case.reading)
    ]  # fmt: skip
    yield from case.wrong("count", len(found))
    if not found or case.frame not in [each.answered for each in found]:
        yield "no such Read is answered in this frame"


def _channel(record: wire.Record) -> tuple[Any, ...]:
    """What `Reading.on_channel` and `Deal.channel` call the channel of a record."""
    ar = str(record.ar) if record.ar.int else None
    return (record.controller, record.device, ar, *record.channel[3:])


def _is_late(read: wire.Record, reading: Reading) -> bool:
    """Whether a Write of its channel stands between a Read and its response: nobody says what that was for."""
    asked = (each.asked for each in reading.on_channel.get(_channel(read), []) if each.write)
    return any((read.asked or 0) < frame < (read.answered or 0) for frame in asked if read.asked)


@auditor("DS704")
def _once_more(case: Case) -> Iterator[str]:
    frame, first = case.args.get("frame"), case.args.get("first")
    again = [each for each in case.reading.answered_at.get(frame or 0, []) if not each.write]
    before = [each for each in case.reading.answered_at.get(first or 0, []) if not each.write]
    pairs = [(a, b) for a in again for b in before if a.data == b.data and a.data]
    if not pairs or frame != case.frame:
        yield f"frames {first} and {frame} do not bring the same response"
        return
    one, other = pairs[0]
    same = one.channel[3:] == other.channel[3:] and one.device == other.device
    if (first or 0) >= (frame or 0) or not same:
        yield "they are not of one place, one after the other"
    key = _channel(one)
    until = one.asked or one.answered or 0  # a response whose request was lost has no other frame
    between = [
        each for each in case.reading.on_channel.get(key, [])
        if each.write and (first or 0) < _at(each) < until
    ]  # fmt: skip
    taken = [_at(each) for each in between if each.status == 0]
    if taken:
        yield f"a new request was accepted in frame {taken[0]}"
    began = min(first or 0, other.asked or first or 0)  # frames may be out of order
    faults = [
        each.write for each in case.reading.deals
        if each.channel == key and each.state == "refused" and began < (each.write or 0) < until
    ]  # fmt: skip
    if case.reading.line is None:
        yield from case.reading.gaps.between(one.controller, one.device, first or 0, until)
    behind = [
        each.asked for each in case.reading.on_channel.get(key, [])
        if each.write and each.status != 0 and (first or 0) < _at(each) < case.frame
    ]  # fmt: skip
    yield from _how_again(
        case, one, [*(each.asked for each in between if each.status), *faults], behind
    )
    told = case.args.get("case")
    if between and told == "again":
        yield f"a new request was written in frame {_at(between[-1])}"
    later = [
        each
        for each in case.reading.on_channel.get(key, [])
        if each.write and (first or 0) < _at(each) < case.frame
    ]
    if not later and told == "again_unaccepted":
        yield "no new request was written in between"


def _at(record: wire.Record) -> int:
    """The frame of a request, or of its response where the capture has no request."""
    return record.asked or record.answered or 0


def _how_again(
    case: Case, one: wire.Record, refused: list[int | None], behind: list[int]
) -> Iterator[str]:
    """How the response was read once more: after a refused Write, without an AR, or with nothing before it."""
    told, write = case.args.get("case"), case.args.get("write")
    if told == "again_after_refusal":
        if write not in (*refused, *behind):
            yield f"write {write!r} is none of the refused {refused}"
        return
    yield from case.wrong("write", None)
    known = ("again", "again_unaccepted", "again_without_ar")
    if told not in known or (told != "again_without_ar") is one.implicit:
        yield f"case {told!r} is another: ReadImplicit {one.implicit}"
    if refused and told == "again":
        yield f"a new request was refused in frame {refused[-1]}"


@auditor("DS705")
def _two_users(case: Case) -> Iterator[str]:
    args, reading = case.args, case.reading
    came = [each for each in reading.asked_at.get(args.get("frame") or 0, []) if each.write]
    came = [each for each in came if each.controller == args.get("controller")]
    refused = [each for each in came if each.status == IN_USE]
    came = refused if args.get("first") is None and refused else came
    if not came:
        yield f"{args.get('controller')} did not write in frame {args.get('frame')}"
        return
    if str(came[0].ar) != args.get("ar") and args.get("ar") is not None:
        yield f"ar {args['ar']!r} is {came[0].ar}"
    if case.frame != args.get("frame"):
        yield f"stands on frame {case.frame}"
    stations = args.get("controller"), args.get("other")
    kind = "one_station" if args.get("ar") == args.get("other_ar") else "two_ars"
    kind = "two_stations" if stations[0] != stations[1] else kind
    kind = "unseen_user" if args.get("first") is None else kind
    yield from case.wrong("case", kind)
    if args.get("first") is None:
        yield from _turned_away(came[0], case)
        return
    places = {each.channel[3:] for each in came}
    held = [each for each in reading.deals if each.write == args["first"]]
    held = [each for each in held if each.controller == args.get("other")]
    if not held:
        yield f"{args.get('other')} did not write in frame {args['first']}"
        return
    here = [each for each in held if (each.api, each.slot, each.subslot, each.index) in places]
    if (here or held)[0].ar != args.get("other_ar"):
        yield f"other_ar {args.get('other_ar')!r} is {(here or held)[0].ar}"
    if not here:
        yield "they are at two places"
    until = {each.id: min([each.closed, *reading.ends(each)]) for each in here or held}
    refused = all(each.write_status for each in here or held)
    if max(until.values()) < came[0].asked or args["first"] > came[0].asked or refused:
        yield f"the request of frame {args['first']} was not open in frame {came[0].asked}"
    for each in here:  # a Write may carry several requests: of one that was over nothing is missing
        if until[each.id] >= came[0].asked:
            yield from absent(case, each, case.frame)


def _turned_away(record: wire.Record, case: Case) -> Iterator[str]:
    """By whom, the sentence does not say: on index 47 an AR may show only later that it carries DS47."""
    if record.status != IN_USE:
        yield f"the Write was answered with {record.status}"
    place = (record.device, *record.channel[3:])
    for deal in case.reading.deals:
        accepted = deal.frames["write_response"] if deal.write_status == 0 else None
        begun = (accepted or 10**9) < (record.answered or record.asked)
        ended = min([deal.read or 10**9, *case.reading.ends(deal)])
        still = ended > (record.answered or record.asked) and deal.state not in (
            "superseded",
            "refused",
            "incomplete",
        )
        unsure = list(absent(case, deal, record.answered or record.asked))
        # Its Read was under way: when that is told, nobody knows what it brings.
        unsure += [
            "" for each in case.reading.on_channel.get(deal.channel, [])
            if not each.write and (deal.write or 0) < each.asked < record.asked < (each.answered or inf)
        ]  # fmt: skip
        if deal.place == place and begun and still and deal.index != SHARED and not unsure:
            yield f"it is known whose request was open: that of frame {deal.write}"


def _is_place(told: object, deal: Deal | wire.Record) -> bool:
    return told == {"slot": deal.slot, "subslot": deal.subslot, "index": deal.index}


@auditor("DS706")
def _elsewhere(case: Case) -> Iterator[str]:
    args, reading = case.args, case.reading
    asked = [
        each for each in reading.deals
        if each.write == args.get("request") and _is_place(args.get("place"), each)
    ]  # fmt: skip
    reads = [each for each in reading.answered_at.get(args.get("frame") or 0, []) if not each.write]
    if not asked or not reads or not _is_place(args.get("other"), reads[0]):
        yield f"no request in {args.get('request')} or no Read in {args.get('frame')} at these places"
        return
    if reads[0].ar.int and str(reads[0].ar) != asked[0].ar:
        yield "the Read is that of another program"
    yield from case.wrong("device", asked[0].device)
    if asked[0].answer is not None:
        yield f"its response was read in frame {asked[0].read}"
    if _is_place(args.get("other"), asked[0]) or case.frame != args.get("frame"):
        yield "it is one place"
    there = [
        each.asked for each in reading.capture.records
        if each.write and _is_place(args.get("other"), each)
        and (each.controller, each.device) == (reads[0].controller, reads[0].device)
    ]  # fmt: skip
    if there:
        yield f"something was asked there, too, answered in frame {there[0]}"


@auditor("DS707")
def _wrong_index(case: Case) -> Iterator[str]:
    found = [
        each for each in case.requests()
        if each.write and (each.index, each.device) == (case.args.get("index"), case.args.get("device"))
    ]  # fmt: skip
    if not found:
        yield "no Write to this index of this device is in this frame"
        return
    status = found[0].status
    yield from case.wrong("status", None if status is None else f"{status:08X}")
    walked = message.request(found[0].data)
    if not walked.sound or walked.id not in (1, 2) or any(walked.rest):
        yield "what was written is no parameter request"
    if found[0].index in (47, 0xB02E, 0xB02F):
        yield "the index is right"


@auditor("DS708")
def _wrong_slot(case: Case) -> Iterator[str]:
    args, reading = case.args, case.reading
    here = [
        each for each in reading.capture.records
        if each.device == args.get("device") and _is_place(args.get("place"), each)
    ]  # fmt: skip
    told = int(args.get("status") or "0", 16)
    if not any(each.answered == case.frame and each.status == told for each in here):
        yield f"no call there is answered with {args.get('status')} in this frame"
    good = [each.answered for each in here if each.status == 0 and (each.write or each.data)]
    if good:
        yield f"a call there is accepted in frame {good[0]}"
    there = [
        each for each in reading.capture.records
        if each.device == args.get("device") and _is_place(args.get("other"), each)
        and not each.write and each.status == 0 and each.data
    ]  # fmt: skip
    if not there:
        yield f"nothing answers at {args.get('other')}"


@auditor("DS709")
def _no_such_axis(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.answer is None or deal.read != case.frame:
        yield "no response to a request is in this frame"
        return
    yield from case.wrong("axis", deal.asked.axis)
    yield from case.wrong("device", deal.device)
    if not any(block.code == NO_SUCH_AXIS for block in deal.answer.blocks):
        yield "the error number is not 0x19"
    # What the device says in another frame does not change what it says in this one: the sentence names no more.


@auditor("DS710")
def _ignored(case: Case) -> Iterator[str]:
    args = case.args
    here = [
        each for each in case.reading.deals
        if each.device == args.get("device") and _is_place(args.get("place"), each)
    ]  # fmt: skip
    for each in here:
        counts = each.axis_told in (args.get("axes") or ()) and each.fits and each.answer
        if counts and each.answer and any(b.code == NO_SUCH_AXIS for b in each.answer.blocks):
            yield f"the axis counts there: 0x19 in frame {each.read}"
            break
    true, told = {each.asked.axis for each in here if each.asked}, args.get("axes")
    if not isinstance(told, list) or len(set(told)) < 2 or not set(told) <= true:
        yield f"axes {told} are {sorted(each for each in true if each is not None)}"
    if (args.get("place") or {}).get("index") != LOCAL:
        yield "the axis counts at this index"
    if not any(case.frame in each.all_frames for each in here):
        yield "no such transaction is in this frame"


@auditor("DS711")
def _too_short(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.write != case.frame:
        yield "no request is in this frame"
        return
    asked = deal.asked
    yield from case.wrong("have", len(asked.data))
    count = asked.count or 1
    yield from case.wrong("count", count)
    just = _just_as_long(asked)
    either = case.args.get("case") == "length_or_count"  # less is said of one that has other flaws
    yield from case.wrong("case", "length_or_count" if either and just else "length_short")
    yield from case.wrong("fits", just if either else None)
    least = 4 + 6 * count
    if asked.changes and len(asked.addresses) == count and asked.blocks:
        last, left = asked.blocks[-1], count - len(asked.blocks)
        least = last.offset + 2 + last.count * last.size
        least += least % 2 + 4 * left if left else 0
    elif asked.changes:
        least += 4 * count
    yield from case.wrong("need", least)
    if not asked.missing:
        yield "nothing is missing"


def _just_as_long(asked: message.Message) -> int | None:
    """The greatest number of parameters for which a request is just as long as it has to be."""
    for number in range((asked.count or 1) - 1, 0, -1):
        other = message.request(asked.data[:3] + bytes([number]) + asked.data[4:])
        if other.sound and not other.missing and not other.rest:
            return number
    return None


@auditor("DS712")
def _read_length(case: Case) -> Iterator[str]:
    deal = case.deal
    reads = [each for each in case.answers() if not each.write]
    before = [each["response"] for each in deal.polls] if deal is not None else []
    if deal is None or not reads or case.frame not in (deal.read, *before):
        yield "no Read of a transaction is answered in this frame"
        return
    yield from case.wrong("asked", reads[0].wanted)
    need = case.args.get("need")
    if case.args.get("more") == "mlen_request":
        yield from _refused_for_length(case, deal, reads[0].wanted)
        return
    if deal.answer is None or not deal.answer.data:
        yield "no response was read that is longer"
        return
    yield from case.wrong("need", len(deal.answer.data) + deal.answer.missing)
    if case.frame != deal.read and reads[0].status != SHORT:
        yield "the Read was not refused for its length"
    if not isinstance(need, int) or need <= reads[0].wanted:
        yield "it does not need more"
        return
    more, whole = case.args.get("more"), case.args.get("whole")
    if more not in (None, "mlen_whole") or (more is None) != (whole is None):
        yield f"{more!r} says nothing of {whole!r}"
    elif more is not None:
        if not deal.fits:
            yield "it is the response to another request"
        sums = {4}
        for lengths in _lengths(case, deal):
            sums = {each + length for each in sums for _, length in lengths}
        if whole <= need or whole not in sums:
            yield f"with all values it has {sorted(sums)}, not {whole!r}"


def _refused_for_length(case: Case, deal: Deal, wanted: int) -> Iterator[str]:
    """No record came: what the request needs, of one byte a value at least, or of as many as any type has."""
    asked = deal.asked
    if asked is None or asked.changes or (deal.answer is not None and deal.answer.data):
        yield "no request for values was left without its record"
        return
    need, places = case.args.get("need"), asked.addresses
    counts = [max(1, each.elements) if each.attribute == message.VALUE else 1 for each in places]
    least, most = (4 + sum(2 + size * n + size * n % 2 for n in counts) for size in (1, 8))
    if not isinstance(need, int) or not max(least, wanted + 1) <= need <= most:
        yield f"all its values have {least} to {most} bytes, not {need!r}"


def _lengths(case: Case, deal: Deal) -> list[set[tuple[int, int]]]:
    """Of each parameter the bytes of one value, and of its block with all of them, as far as responses show them.

    Its own block says it, or any in which the drive object brought its values: of these there may be several.
    """
    blocks = deal.answer.blocks if deal.answer is not None else []
    found = []
    for number, address in enumerate(deal.asked.addresses if deal.asked is not None else []):
        own = blocks[number] if number < len(blocks) else None
        count, sizes = max(1, address.elements), set[int]()
        if own is not None and not own.failed:  # it may be cut
            count, sizes = own.count, {own.size}
        elif address.attribute == message.VALUE:
            sizes = {each.size for each in _values(case.memory, case.reading, deal, address.pnu)}
        found.append({(size, 2 + count * size + count * size % 2) for size in sizes if size})
    return found


@auditor("DS713")
def _too_long(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.answer is None or deal.read != case.frame:
        yield "no response to a request is in this frame"
        return
    limit = case.args.get("limit")
    yield from case.wrong("parameters", deal.parameters_asked)
    there = sum(not block.failed for block in deal.answer.blocks)
    yield from case.wrong("number", there)
    if not deal.fits:
        yield "it is the response to another request"
    lengths = {
        length for each in case.reading.deals
        if each.device == deal.device and each.answer is not None
        for length in (len(each.answer.data), *_stated(each, case.reading))
    }  # fmt: skip
    if case.args.get("room") == "room_seen" and limit not in lengths:
        yield f"no response of the device has {limit} bytes"
    elif case.args.get("room") == "room_stated" and limit not in _longest(
        case.reading, deal.device
    ):
        yield f"limit {limit!r} was not read from PNU 974[0]"
    elif case.args.get("room") not in ("room_seen", "room_stated"):
        yield f"room {case.args.get('room')!r} is none"
    yield from _no_room(case, deal.asked, deal.answer)
    yield from _has_room(case, deal)
    if there == deal.parameters_asked:
        yield "all found room"


def _stated(deal: Deal, reading: Reading) -> list[int]:
    """The length of a response by its record, of one that the capture cut."""
    frame = reading.capture.frame(deal.read or 0)
    reads = reading.answered_at.get(deal.read or 0, [])
    return [each.stated for each in reads] if frame is not None and frame.cut else []


def _has_room(case: Case, deal: Deal) -> Iterator[str]:
    """For how many parameters, or elements of the first one, there is room."""
    fit, fits, most = (case.args.get(name) for name in ("fit", "fits", "most"))
    if fit not in (None, "fit_parameters", "fit_elements"):
        yield f"fit {fit!r} is none"
    if fit is None or not isinstance(fits, int):
        if (fits, most) != (None, None) or fit is not None:
            yield f"{fit!r} says nothing of {fits!r} and {most!r}"
        return
    limit = case.args.get("limit") or 0
    room = limit if case.args.get("room") == "room_stated" else max(limit, 240)
    yield from case.wrong("most", room)
    rooms, true = {room - 4}, set[tuple[str, int]]()
    for number, lengths in enumerate(_lengths(case, deal)):
        for left, (size, length) in product(rooms, lengths):
            if length > left:
                true.add(("fit_parameters", number))
                true |= set() if number else {("fit_elements", max(0, left - 2) // size)}
        rooms = {left - length for left in rooms for _, length in lengths if length <= left}
    if (fit, fits) not in true:
        yield f"{fit} {fits} is {sorted(true)}"


def _no_room(case: Case, asked: message.Message, answer: message.Message) -> Iterator[str]:
    """The first parameter that found no room, and how the drive says so."""
    codes = [block.code for block in answer.blocks]
    what = "too_long" if TOO_LONG in codes else "left_out"
    yield from case.wrong("what", what)
    at = codes.index(TOO_LONG) if what == "too_long" else len(codes)
    address = asked.addresses[at] if at < len(asked.addresses) else None
    yield from case.wrong("pnu", address.pnu if address else None)
    yield from case.wrong("subindex", address.subindex if address else None)


def _longest(reading: Reading, device: str) -> list[int]:
    return [
        int.from_bytes(block.elements()[-address.subindex])
        for deal in reading.deals if deal.device == device and deal.operation == "read"
        for address, block in deal.pairs()
        if address.pnu == 974 and not address.subindex and block.elements()
    ]  # fmt: skip


@auditor("DS714")
def _wrong_type(case: Case) -> Iterator[str]:
    deal, args = case.deal, case.args
    if deal is None or deal.asked is None or deal.write != case.frame:
        yield "no request is in this frame"
        return
    pairs = list(zip(deal.asked.addresses, deal.asked.blocks, strict=False))
    found = [
        (number, block) for number, (address, block) in enumerate(pairs)
        if (address.pnu, address.subindex) == (args.get("pnu"), args.get("subindex"))
    ]  # fmt: skip
    if not found:
        yield f"p{args.get('pnu')}[{args.get('subindex')}] is not written here"
        return
    named = [each for each in found if message.NAMES.get(str(args.get("format"))) == each[1].format]
    exact = [each for each in named if _equal(args.get("values"), each[1])]
    number, block = (exact or named or found)[0]
    given = message.NAMES.get(str(args.get("format")))
    if given != block.format and (given or block.format in message.NAMES.values()):
        yield f"format {args.get('format')!r} is 0x{block.format:02X}"
    if message.NAMES.get(str(args.get("better"))) != args.get("better_code"):
        yield f"better {args.get('better')!r} is not format {args.get('better_code')!r}"
    if block.values() is not None and not _equal(args.get("values"), block):
        yield f"values {args.get('values')!r} are {block.values()}"
    yield from _meant(case, block)
    if block.format == args.get("better_code") and args.get("meant") == args.get("values"):
        yield "it is written so"
    yield from _better(case, deal)
    answer = (
        deal.answer.blocks[number].code
        if deal.answer and number < len(deal.answer.blocks)
        else None
    )
    yield from case.wrong("code", answer)
    odd = any(_odd(value) for value in block.values() or [])
    if answer not in TYPE_ERRORS and not odd:
        yield f"it was answered with {answer!r}, and its value is no odd one"


def _better(case: Case, deal: Deal) -> Iterator[str]:
    """How the better format is known: read or described so in a frame, by the list of parameters, or by its bits."""
    told, better, pnu = case.args.get("case"), case.args.get("better_code"), case.args.get("pnu")
    seen = formats(case.memory, case.reading, deal, pnu)
    # By the list, or by the bits: what the drive reads later nobody knows in the frame on which this stands,
    # and a transaction may be read once more until the next one on its channel has its response.
    before = [each for each in case.reading.deals if _over(each, case.reading) < (deal.write or 0)]
    # A read of what may be another drive object says nothing against the list.
    known = [formats(case.memory, case.reading, deal, pnu, each, kinds=(SURE,)) for each in before]
    seen = seen if told == "format_read" else set().union(*known)
    # What the drive says of itself comes first.
    if seen and better not in seen and told != "format_described":
        yield f"the drive reads it as {sorted(seen)}"
    if told == "format_read":
        there = _brought(case.reading, case.args.get("seen"))
        if not any(better in formats(case.memory, case.reading, deal, pnu, each) for each in there):
            yield f"seen {case.args.get('seen')!r}: p{pnu} is not read in this format there"
        return
    if told == "format_described":
        there = _brought(case.reading, case.args.get("seen"))
        if not any(better in described(case.memory, deal, pnu, each) for each in there):
            yield f"seen {case.args.get('seen')!r}: p{pnu} is not described as this there"
        return
    yield from case.wrong("seen", None)
    listed = _listed().get(pnu, set())
    if told == "format_listed" and better not in {
        message.NAMES.get(each.removesuffix("[]")) for each in listed
    }:
        yield f"the tables of parameters say {sorted(listed)}"
    elif told not in ("format_listed", "format_bits"):
        yield f"case {told!r} is none"


def _brought(reading: Reading, frame: object) -> list[Deal]:
    """The transactions whose response is in a frame, be it once more: a cut has it there alone."""
    there = [each for each in reading.deals if each.read == frame]
    records = {each.plain["bytes"]["response"] for each in there} - {None}
    return there + [each for each in reading.deals if each.plain["bytes"]["response"] in records]


def _over(deal: Deal, reading: Reading) -> int:
    """The frame in which the response of the next transaction on the channel of another is read."""
    later = [
        each.read or 10**9 for each in reading.deals
        if each.channel == deal.channel and (each.write or 0) > (deal.read or 0)
    ]  # fmt: skip
    return min(later, default=10**9)


def _meant(case: Case, block: message.Block) -> Iterator[str]:
    """The values that are meant: the same bits or the same numbers under the better format, or neither."""
    meant, better = case.args.get("meant"), case.args.get("better_code")
    bits = message.SIZES.get(better or 0) == block.size and _as_bits(meant, block, better or 0)
    numbers = meant == case.args.get("values")
    true = {"bits_same": bits, "number_same": numbers}.get(str(case.args.get("bits")))
    other = [code for code in message.LETTERS if message.SIZES[code] == block.size]
    if case.args.get("bits") == "number_other":
        true = not bits and not numbers and any(_as_bits(meant, block, code) for code in other)
    if not true:
        yield f"meant {meant!r} is not {case.args.get('bits')!r}"


def _as_bits(told: object, block: message.Block, code: int) -> bool:
    """Whether values are the bits of a block under another format of the same size."""
    return _equal(told, message.Block(code, block.count, block.raw, block.offset, block.size))


@cache
def _rows() -> list[tuple[int, dict[str, Any]]]:
    """Numbers and rows of the package's own tables of parameters."""
    found = []
    for name in ("parameters.toml", "drives.toml"):
        for row in tomllib.loads((SPEC / name).read_text(encoding="utf-8"))["parameter"]:
            numbers = range(row["number"], row.get("last", row["number"]) + 1)
            found += [(number, row) for number in numbers]
    return found


@cache
def _listed() -> dict[object, set[str]]:
    """PNU -> formats of all families of drives."""
    found: dict[object, set[str]] = {}
    for pnu, row in _rows():
        found.setdefault(pnu, set()).add(row["type"])
    return found


def _equal(told: object, block: message.Block) -> bool:
    """Whether values of a report are those of a block, in the width of its format."""
    parts = block.elements()
    if not isinstance(told, list) or len(told) != len(parts):
        return False
    return all(
        means(each, bits, block.format) or _as_number(each, bits, block.format)
        for each, bits in zip(told, parts, strict=True)
    )


def _as_number(told: object, bits: bytes, code: int) -> bool:
    """Whether it is the same number, though of another type: 10.0 and 10."""
    letter = message.LETTERS.get(code)
    if letter is None or not isinstance(told, (int, float)):
        return False
    return bool(struct.unpack(">" + letter, bits)[0] == told)


def _odd(value: float) -> bool:
    """Whether a float is none that anybody types."""
    return (
        isinstance(value, float)
        and (value != value or not 1e-37 < abs(value) < 1e30)
        and value != 0
    )


def formats(
    memory: Memory,
    reading: Reading,
    deal: Deal,
    pnu: object,
    only: Deal | None = None,
    target: Target | None = None,
    kinds: tuple[str, ...] = (SURE, MAYBE),
) -> set[int]:
    """The formats in which a parameter of the drive object of a transaction was read, in one transaction or in any."""
    return {each.format for each in _values(memory, reading, deal, pnu, only, target, kinds)}


def _values(
    memory: Memory,
    reading: Reading,
    deal: Deal,
    pnu: object,
    only: Deal | None = None,
    target: Target | None = None,
    kinds: tuple[str, ...] = (SURE, MAYBE),
) -> list[message.Block]:
    """The same: the blocks that brought its values."""
    return [
        block for each in ([only] if only else reading.deals) if each.operation == "read"
        if memory.same(memory.target(each), target or memory.target(deal)) in kinds
        and each.device == deal.device
        for address, block in each.pairs()
        if address.pnu == pnu and address.attribute == message.VALUE and not block.failed
    ]  # fmt: skip


def described(
    memory: Memory, deal: Deal, pnu: object, there: Deal, target: Target | None = None
) -> set[int]:
    """The types that a transaction describes a parameter as: all of a description, or its first element."""
    if there.operation != "read" or there.device != deal.device or not there.fits:
        return set()
    sure = memory.same(memory.target(there), target or memory.target(deal)) == SURE
    if not sure and pnu not in OF_THE_DEVICE:
        return set()
    return {
        block.raw[1] for address, block in there.pairs()
        if address.pnu == pnu and address.attribute == message.DESCRIPTION and not block.failed
        and (address.subindex, len(block.raw)) in ((0, 46), (1, 2))
    }  # fmt: skip


@auditor("DS715", "DS716")
def _rearranged(case: Case) -> Iterator[str]:
    deal = case.deal
    if deal is None or deal.asked is None or deal.write != case.frame:
        yield "no request is in this frame"
        return
    mine = [
        each for each in case.reading.plain["diagnoses"]
        if each["rule"] == case.finding.rule and each["corrected"]
        and each["corrected"]["transaction"] == deal.id
    ]  # fmt: skip
    if not str(case.args.get("meant") or ""):
        yield "does not say what is meant"
    elif not re.match(r"(read|change) ref \d+ axis \d+ ", str(case.args["meant"])):
        yield f"what is meant is no request: {case.args['meant']}"
    if case.args.get("what") not in words.WORDS:
        yield f"what {case.args.get('what')!r} is nothing"
    if not mine:
        return  # one of several of a cause: the corrected request is that of another
    line = shlex.split(mine[0]["corrected"]["encode"] or "")[2:]
    if line and line[0] != case.args["meant"]:
        yield f"what is meant is {line[0]}"
    new, old = bytes.fromhex(mine[0]["corrected"]["request"]), deal.asked.data
    yield from (_swapped if case.finding.rule == "DS715" else _spread)(
        case.args.get("what"), old, new
    )


def _swapped(what: object, old: bytes, new: bytes) -> Iterator[str]:
    words = b"".join(old[at : at + 2][::-1] for at in range(0, len(old), 2))
    head = 4 + 6 * old[3]
    if (what == "all_bytes") is not (words.startswith(new) and not any(words[len(new) :])):
        yield f"what {what!r} is another"
    elif what == "values" and new[:head] != old[:head]:
        yield "more than the values are swapped"
    elif what == "fields" and new[:head] == old[:head]:
        yield "the fields are not swapped"
    elif what not in ("all_bytes", "fields", "values"):
        yield f"what {what!r} is nothing"


def _spread(what: object, old: bytes, new: bytes) -> Iterator[str]:
    if what not in ("zeros", "even_offsets"):
        yield f"what {what!r} is nothing"
    if (what == "zeros") is not any(each.startswith(new) for each in (old[::2], old[1::2])):
        yield f"what {what!r} is another"
    if Counter(old) - Counter(new) != Counter({0: len(old) - len(new)}):
        yield "what is left out is not only zeros"


@auditor("DS717")
def _index_and_count(case: Case) -> Iterator[str]:
    yield from _refusal(case)
    code, deal = case.args.get("code"), case.deal
    if code not in (0x03, 0x04, 0x16, 0x18):
        yield f"code {code!r} speaks of something else"
    if deal is None or deal.asked is None:
        return
    asked, told = deal.asked, deal.answer.blocks if deal.answer is not None else []
    at = next((at for at, each in enumerate(told) if each.offset == case.finding.offset), None)
    value = asked.blocks[at] if at is not None and at < len(asked.blocks) else None
    agree = (
        code == 0x18 and at is not None and value is not None
        and value.count == (asked.addresses[at].elements or 1)
    )  # fmt: skip
    longer = agree and asked.rest and not deal.cut
    yield from case.wrong(
        "case", "record_longer" if longer else "counts_agree" if agree else "counts"
    )
    yield from case.wrong("have", len(asked.data) if longer else None)
    yield from case.wrong("need", len(asked.data) - len(asked.rest) if longer else None)


@auditor("DS718")
def _commissioning(case: Case) -> Iterator[str]:
    yield from _refusal(case)
    yield from case.wrong("state", STATES.get(case.args.get("code") or 0))
    if case.deal and case.reading.vendors.get(case.deal.device) != SIEMENS:
        yield "the vendor is not Siemens"
    yield from _is_change(case)


def _is_change(case: Case) -> Iterator[str]:
    if case.deal is not None and case.deal.asked is not None and not case.deal.asked.changes:
        yield "it was not to be changed, but read"


@auditor("DS719")
def _running(case: Case) -> Iterator[str]:
    yield from _refusal(case)
    code = case.args.get("code")
    siemens = case.deal is not None and case.reading.vendors.get(case.deal.device) == SIEMENS
    siemens = (
        siemens or case.args.get("family") == "sinamics"
    )  # on PROFIBUS the ident number says it
    if code != 0x11 and not (code == 0x6B and siemens):
        yield f"code {code!r} speaks of something else"
    yield from _is_change(case)


@auditor("DS720")
def _connector(case: Case) -> Iterator[str]:
    yield from _refusal(case)
    yield from _is_change(case)
    deal = case.deal
    if deal is None or deal.asked is None:
        return
    told = deal.answer.blocks if deal.answer is not None else []
    for address, block, said in zip(deal.asked.addresses, deal.asked.blocks, told, strict=False):
        if (address.pnu, address.subindex) != (case.args.get("pnu"), case.args.get("subindex")):
            continue
        if case.finding.offset not in (None, said.offset):
            continue  # the same parameter twice
        given, high = case.args.get("format"), int.from_bytes(block.raw[:2])
        if message.NAMES.get(str(given)) != block.format:
            yield f"format {given!r} is 0x{block.format:02X}"
        if not (
            block.elements() and means(case.args.get("value"), block.elements()[0], block.format)
        ):
            yield f"value {case.args.get('value')!r} is {block.values()}"
        link = block.format in (0x07, 0x43) and 0 < high <= SOURCE_MOST
        yield from case.wrong("case", "source_refused" if link else "no_source")
        yield from case.wrong("source", high if link else None)
        return


@cache
def volatile(other_make: bool) -> frozenset[int]:
    """Parameters that the drive changes itself, of the package's own tables; of another make those of the profile."""
    return frozenset(
        pnu for pnu, row in _rows() if row.get("volatile") and not (other_make and "family" in row)
    )


Moment = tuple[int, int]
"""The frame of a request and the number of its transaction: two records of one frame have an order."""


@auditor("DS721")
def _unsaved(case: Case) -> Iterator[str]:
    here = [each for each in case.reading.deals if each.device == case.args.get("device")]
    known = [save for each in here for save in saves(case.reading, each)]
    gaps = case.reading.gaps
    hole = gaps.newest_gap(str(case.args.get("device")))
    hole = max([hole, *_unproven(case.reading, str(case.args.get("device")))])
    known += [((hole, 0), each, True, False) for each in here[:1]]  # a save may be missing there
    kept: list[tuple[int, Deal]] = []
    named: set[int] = set()
    perhaps = 0
    for deal in here:
        for at, seen, pnus in _lasting(case.reading, deal):
            after = [save for save in known if save[0] > at]
            if any(_has_saved(deal, *save[1:]) for save in after):
                continue
            sure = [by for _, by, _, done in after if done and _surely_one(case.memory, deal, by)]
            if not seen or any(_may_save(deal, by, whole) for _, by, whole, _ in after):
                perhaps += 1
            else:
                kept.append((at[0], deal))
                named.update(pnus)
                if sure:
                    yield f"the change of frame {at[0]} was saved in frame {sure[0].write}"
    frames = [frame for frame, _ in kept]
    targets = len({_addressed(deal) for _, deal in kept})
    axis = _addressed(kept[0][1]) if targets == 1 else None
    axis = axis if isinstance(axis, int) and axis else None
    one = "unsaved" if axis is None else "unsaved_object"
    yield from case.wrong("count", len(kept))
    yield from case.wrong("pnus", sorted(named)[:16])
    yield from case.wrong("axis", axis)
    yield from case.wrong("last", max(frames, default=None))
    yield from case.wrong("targets", targets)
    yield from case.wrong("case", one if targets == 1 else "unsaved_targets")
    yield from case.wrong("unknown", perhaps)
    yield from case.wrong("more", "some_unknown" if perhaps else "all_known")
    if kept and case.frame != min(frames):
        yield f"the first of them is in frame {min(frames)}"


def saves(reading: Reading, deal: Deal) -> Iterator[tuple[Moment, Deal, bool, bool]]:
    """When which transaction may have saved, whether all drive objects, and whether that is known."""
    if _unasked_change(reading, deal):
        yield (deal.read or 0, deal.id), deal, True, False
    if _may_hide_changes(reading, deal):
        yield (deal.write or 0, deal.id), deal, True, False
    for pnu, done in _outcomes(reading, deal):
        if pnu in (SAVE_ONE, SAVE_ALL) and done is not False:
            yield (deal.write or 0, deal.id), deal, pnu == SAVE_ALL, bool(done)


def _lasting(reading: Reading, deal: Deal) -> Iterator[tuple[Moment, bool, list[int]]]:
    """The changes of a transaction that a later one has to save: those that are known, and those that are not."""
    parts = list(_outcomes(reading, deal))
    found: dict[bool, list[int]] = {}
    for number, (pnu, done) in enumerate(parts):
        behind = [each for after, each in parts[number + 1 :] if after in (SAVE_ONE, SAVE_ALL)]
        saves = pnu in (SAVE_ONE, SAVE_ALL) or True in behind
        other = reading.vendors.get(deal.device) not in (None, SIEMENS)
        if done is not False and not saves and pnu not in volatile(other):
            found.setdefault(done is True and None not in behind, []).append(pnu)
    if _may_hide_changes(reading, deal):  # whatever it is: it may save those, or be lost itself
        found = {False: []}
    for seen, pnus in found.items():
        yield (deal.write or 0, deal.id), seen, pnus


def _unproven(reading: Reading, device: str) -> Iterator[int]:
    """The Writes to index 47 of which the capture has the begin alone, as of a change, and which nothing proves."""
    proven = {deal.write for deal in reading.deals}
    for each in reading.capture.records:
        begins = each.write and (each.device, each.index) == (device, 47) and each.short
        if (
            begins
            and not each.status
            and each.asked not in proven
            and each.data[1:2] in (b"", b"\x02")
        ):
            yield each.asked


def _may_hide_changes(reading: Reading, deal: Deal) -> bool:
    """Whether a request that the capture cut before all its addresses may have changed what is behind the cut."""
    asked, answer = deal.asked, deal.answer
    if asked is None or not deal.cut or not _was_taken(reading, deal):
        return False
    if asked.id is not None and (deal.operation != "change" or len(asked.addresses) == asked.count):
        return False
    if answer is None or not deal.fits or answer.id is None:
        return True
    if answer.id == 0x80 or (asked.id is None and answer.id not in (0x02, 0x82)):
        return False
    behind = answer.blocks[len(asked.addresses) :]
    total = asked.count if asked.count is not None else answer.count or 256
    return len(asked.addresses) + len(behind) < total or not all(each.failed for each in behind)


def _unasked_change(reading: Reading, deal: Deal) -> bool:
    """Whether it is the response to a change that is not in the capture, and no earlier response once more."""
    again = any(
        each.args.get("frame") == deal.read
        for each in reading.findings if each.rule == "DS704" and each.transaction == deal.id
    )  # fmt: skip
    answer = deal.answer
    return deal.asked is None and answer is not None and answer.id in (0x02, 0x82) and not again


def _has_saved(deal: Deal, by: Deal, whole: bool, done: bool) -> bool:
    return done and (whole or _addressed(deal) == _addressed(by) != 0)


def _may_save(deal: Deal, by: Deal, whole: bool) -> bool:
    """Whether a save may be one of the drive object of a change, as far as the two say it themselves."""
    one, two = _addressed(deal), _addressed(by)
    by_submodule = isinstance(one, tuple) or isinstance(two, tuple)  # which may be any
    return whole or one == two or 0 in (one, two) or by_submodule


def _addressed(deal: Deal) -> object:
    """What a request names: a slot under 0xB02E, else an axis; 0 is none."""
    return (deal.slot, deal.subslot) if deal.index == LOCAL else deal.axis_told or 0


def _surely_one(memory: Memory, deal: Deal, other: Deal) -> bool:
    return memory.same(memory.target(deal), memory.target(other)) == SURE


def _was_taken(reading: Reading, deal: Deal) -> bool:
    """Whether nothing shows that its Write was refused."""
    call = reading.call_at.get(deal.write or 0)
    told = call.response if call else None
    return not deal.write_status and (told is None or told.kind not in (wire.FAULT, wire.REJECT))


def _outcomes(reading: Reading, deal: Deal) -> Iterator[tuple[int, bool | None]]:
    """The parameters of a change in their order, and whether each was changed; None where nobody knows."""
    asked, answer = deal.asked, deal.answer
    if asked is None or deal.operation != "change" or not _was_taken(reading, deal):
        return
    for number, address in enumerate(asked.addresses):
        if answer is None or not deal.fits:
            yield address.pnu, None
        elif answer.id == 0x80:
            yield address.pnu, False
        elif number < len(answer.blocks):
            yield address.pnu, not answer.blocks[number].failed
        else:
            yield address.pnu, True if answer.id == asked.id else None


@auditor("DS722")
def _lost(case: Case) -> Iterator[str]:
    deal, frame = case.deal, case.args.get("frame")
    if deal is None or deal.write != case.frame:
        yield "no request is in this frame"
        return
    if deal.answer is not None or deal.write_status:
        yield f"it was answered in frame {deal.read}"
    yield from absent(case, deal, frame or 10**9)
    capture = case.reading.capture
    behind = {
        call.response.frame for call in capture.calls
        if call.response is not None and call.response.frame > call.request.frame
    }  # fmt: skip
    alone = (each for each in capture.pdus if each.frame == frame and each.frame not in behind)
    end = next(alone, None)  # a request, or a response that is there before it, or without it
    stations = {deal.controller, deal.device}
    ends = end is not None and end.operation in (wire.CONNECT, wire.RELEASE)
    if end is None or not ends or {end.source, end.target} != stations:
        yield f"neither Release nor Connect of the two is in frame {frame}"
    elif not (frame or 0) > case.frame:
        yield "that was before the request"
    later = [
        each.asked
        for each in case.reading.capture.records
        if str(each.ar) == deal.ar and each.asked > (frame or 0) and each.status == 0
    ]
    own = bytes.fromhex((deal.ar or "").replace("-", ""))
    if later and end is not None and own not in end.body:
        yield f"that was another AR, its own goes on in frame {later[0]}"


@auditor("DS723")
def _held(case: Case) -> Iterator[str]:
    args, device = case.args, case.args.get("device")
    first = next((each for each in case.reading.deals if each.write == case.frame), None)
    if first is None or first.asked is None or not first.asked.changes or first.device != device:
        yield "no change is in this frame"
        return
    if not _is_place(args.get("place"), first):
        yield "the place is another"
    same = [
        each for each in case.reading.deals
        if each.channel == first.channel and each.operation == "change"
    ]  # fmt: skip
    same.sort(key=lambda each: each.write or 0)
    run: list[Deal] = []
    for each in same[same.index(first) :]:
        if each.asked is None or each.asked.data[1:] != first.asked.data[1:]:
            break
        run.append(each)
    yield from case.wrong("count", len(run))
    times = [case.reading.time(each.write) or 0 for each in run]
    gaps = sorted(b - a for a, b in pairwise(times))
    if not gaps or not _about(args.get("period"), gaps[(len(gaps) - 1) // 2] / 1e6, 0.001):
        yield f"period {args.get('period')!r} is {gaps}"


def _about(told: object, truth: float, share: float) -> bool:
    return isinstance(told, (int, float)) and abs(told - truth) <= share * abs(truth)


@auditor("DS724")
def _storm(case: Case) -> Iterator[str]:
    args, reading = case.args, case.reading
    start = next((each for each in reading.deals if case.frame in _polls(each)), None)
    if start is None or start.device != args.get("device"):
        yield "no poll of this device is in this frame"
        return
    same = [each for each in reading.deals if each.channel == start.channel and each.write]
    same.sort(key=lambda each: each.write or 0)
    jobs = [each for each in same if len(each.polls) >= 10]
    begin = max(0, jobs.index(start) - 4) if start in jobs else 0
    jobs = jobs[begin : begin + 10]
    runs = [
        list(run) for size in range(1, len(jobs) + 1) for run in combinations(jobs, size)
        if start in run and sum(len(each.polls) for each in run) == args.get("count")
    ]  # fmt: skip
    if not runs:
        yield f"count {args.get('count')!r} is not that of {[len(each.polls) for each in jobs]}"
        return
    problems = [list(_pace(case, run)) for run in runs]
    yield from min(problems, key=len)


def _polls(deal: Deal) -> list[int | None]:
    return [frame for poll in deal.polls for frame in poll.values()]


def _pace(case: Case, run: list[Deal]) -> Iterator[str]:
    args, time = case.args, case.reading.time
    gaps, taken = [], []
    for each in run:
        reads = [poll["request"] or poll["response"] for poll in each.polls]
        if each.read is not None:
            reads.append(each.frames["read_request"] or each.read)
        times = [time(frame) or 0 for frame in reads if frame is not None]
        gaps += [b - a for a, b in pairwise(times)]
        # Without the record: as long as the drive was heard to work on it.
        end = time(each.read or each.polls[-1]["response"] or max(each.all_frames)) or 0
        taken.append(end - (time(each.write) or 0))
    if any(gap < 0 for gap in [*gaps, *taken]):
        return  # the clock was set back
    if not gaps or not _about(args.get("period"), sum(gaps) / len(gaps) / 1e6, 0.026):
        yield f"period {args.get('period')!r} is {sum(gaps) / max(1, len(gaps)) / 1e6:.3f}"
    if not _about(args.get("time"), sum(taken) / len(taken) / 1e6, 0.001):
        yield f"time {args.get('time')!r} is {sum(taken) / len(taken) / 1e6:.3f}"


_SAYS_OF = {
    "dropped": ("count",), "cut": ("count", "bytes"), "disorder": ("count",),
    "gaps": ("numbers", "controller", "device"), "bus_answers": ("count", "device"),
    "bus_exchanges": ("count", "device"), "bus_requests": ("count",),
}  # fmt: skip
"""What DS725 carries, where that is not the number, and the two stations."""


@auditor("DS725")
def _half(case: Case) -> Iterator[str]:
    what = str(case.args.get("what"))
    kept = {"what", *_SAYS_OF.get(what, ("count", "controller", "device"))}
    for name in sorted(set(case.args) - kept):
        if case.args[name] is not None:
            yield f"{name} is nothing that {what!r} says"
    if what.startswith("s7_"):
        yield from s7.missing(case.args, case.reading)
        return
    if what.startswith("bus_"):
        of_line = {"bus_answers": stations.missing, "bus_exchanges": stations.gaps}
        yield from of_line.get(what, stations.unasked)(case)
        return
    pair = str(case.args.get("controller")), str(case.args.get("device"))
    if what == "disorder" and case.frame in (late := cyclic.late(case.reading)):
        if not 0 < (case.args.get("count") or 0) <= len(late):
            yield f"{len(late)} cyclic frames stand behind a later one"
    elif what == "cyclic_holes":
        places = cyclic.pauses(case.reading, pair)
        if not (0 < (case.args.get("count") or 0) <= len(places) and case.frame > places[0][0]):
            yield f"no frames of the two are missing but between {places}"
    elif what == "cyclic_gaps" or (what == "file_ends" and pkw.of_end(case.frame, case.reading)):
        yield from _of_pkw(case, what, pair)
    else:
        yield from _of_calls(case, what, pair)


def _of_pkw(case: Case, what: str, pair: tuple[str, str]) -> Iterator[str]:
    """Requests by PKW of which the response may be missing, or come behind the end."""
    ends = {
        each.frame for each in case.reading.findings
        if each.rule == "DS110" and each.args["what"] == "ends"
    }  # fmt: skip
    mine = [
        each.write for each in case.reading.deals
        if each.plain["channel"] == "pkw" and each.state == "incomplete"
        and (each.controller, each.device) == pair
        and (each.write in ends) is (what == "file_ends")
    ]  # fmt: skip
    mine = mine or [case.frame]  # what reads as a request in a channel that nothing proves
    yield from case.wrong("count", len(mine))
    if case.frame != min(filter(None, mine), default=None):
        yield f"the first of them is in frame {min(filter(None, mine), default=None)}"


def _of_calls(case: Case, what: str, pair: tuple[str, str]) -> Iterator[str]:
    """What is missing, cut or out of order of record calls."""
    capture = case.reading.capture
    if what == "disorder":
        pairs = {(each.request.source, each.request.target) for each in capture.calls}
        steps = [
            each for each in case.reading.findings
            if each.rule == "DS107" and each.args["milliseconds"] < DISORDER_MS
        ]  # fmt: skip
        late = sum(len(case.reading.gaps.late(*each)) for each in pairs)
        yield from case.wrong("count", len(steps) + late)
        return
    if what in ("dropped", "cut"):
        dropped = [
            int(each.split(" frame")[0].split()[-1].replace(",", ""))
            for each in case.reading.text.splitlines() if "machine dropped" in each
        ]  # fmt: skip
        cut = _cut_frames(capture)
        if what == "cut":
            sizes = {len(capture.frames[at - 1].data) for at in cut}
            yield from case.wrong("bytes", min(sizes) if len(sizes) == 1 else None)
        told = {each.frame for each in case.reading.findings if each.rule == "DS106"}
        count = case.args.get("count")
        if what == "dropped":
            yield from case.wrong("count", dropped[0])
        elif count != len(told) and not (capture.fragments and count in range(1, len(cut))):
            yield from case.wrong(
                "count", len(cut)
            )  # of fragments of IP the first that is cut counts
        return
    deals = [
        each for each in case.reading.deals
        if not each.cyclic and (each.controller, each.device) == pair
    ]  # fmt: skip
    yield from _of_pair(case, what, pair, [each for each in deals if each.asked], deals)


def _cut_frames(capture: wire.Capture) -> set[int]:
    """The frames of record calls that the capture cut, of those of which that is known, and of fragments."""
    calls = {at for pdu in capture.pdus if pdu.operation in RECORDS for at in pdu.frames}
    pieces = {at for frames in capture.pieces.values() for at in frames}
    return capture.headless | {at for at in calls | pieces if capture.frames[at - 1].cut}


def _of_pair(
    case: Case, what: str, pair: tuple[str, str], asked: list[Deal], deals: list[Deal]
) -> Iterator[str]:
    """What is missing of what two stations say to each other."""
    gaps = case.reading.gaps
    true: dict[str, int | None] = {
        "only_requests": len(asked), "only_responses": len(deals) - len(asked),
        "no_write": len(deals) - len(asked), "half_calls": len(gaps.halves(*pair)),
        "gaps": None,
        "file_begins": len(_begun(case, pair, asked)), "file_ends": len(_open_at_the_end(case, pair)),
    }  # fmt: skip
    if what not in true:
        yield f"what {what!r} is nothing"
        return
    if what != "gaps":
        yield from case.wrong("count", true[what])
    if what == "only_requests" and (pair[1], pair[0]) in gaps.heard:
        yield "there are responses"
    if what == "only_responses" and pair in gaps.asked:
        yield "there are requests"
    if what == "no_write" and asked:
        yield f"the request of frame {asked[0].write} was captured"
    if what == "gaps":
        missing = gaps.of(*pair)
        true = dict.fromkeys(each.text for each in missing[:8])
        told = ", ".join([*true, *["..."][: len(missing) > 8]])
        if told != case.args.get("numbers"):
            yield f"numbers {case.args.get('numbers')!r} is {told!r}"


def _begun(case: Case, pair: tuple[str, str], asked: list[Deal]) -> list[int]:
    """The frames of what was asked for before anything that two stations ask of each other in the capture."""
    first = min((each.write for each in asked if each.write), default=None)
    deals = {each.id: (each.controller, each.device) for each in case.reading.deals}
    reads = {
        each.answered: (each.controller, each.device) for each in case.reading.capture.records
        if not each.write
    }  # fmt: skip
    alone = [
        each.frame for each in case.reading.findings
        if (each.rule == "DS403" and each.args["case"] == "unasked" and deals[each.transaction or 0] == pair)
        or (each.rule == "DS110" and each.args["what"] == "begins" and reads.get(each.frame) == pair)
    ]  # fmt: skip
    return [each for each in alone if first is None or each < first]


def _open_at_the_end(case: Case, pair: tuple[str, str]) -> list[int]:
    """The frames of requests, and of a last call, whose responses are not there since the capture ends (DS110)."""
    found = []
    is_line = case.reading.line is not None  # which has no calls
    newest = case.reading.gaps.newest_call(*pair)
    deals = {
        each.id: (each.controller, each.device) for each in case.reading.deals if not each.cyclic
    }
    calls = set()
    for each in case.reading.findings:
        if each.rule != "DS110" or deals.get(each.transaction or 0) != pair:
            continue
        if each.args["what"] == "ends":
            found.append(each.frame)
        elif (
            not is_line
            and each.args["what"] in ("read_answer", "write_answer")
            and each.args["first"] >= newest
        ):
            calls.add(each.args["first"])
    return [*found, *calls]


def diagnoses(reading: Reading) -> Iterator[Complaint]:
    """What is not so in the entries that sum up the findings DS7xx."""
    told: Counter[str] = Counter()
    for each in reading.plain["diagnoses"]:
        for text in _diagnosis(each, reading):
            yield Complaint(each["rule"], "diagnosis", text)
        told[each["rule"]] += each["count"]
    true = Counter(each.rule for each in reading.findings if each.rule.startswith("DS7"))
    if told != true:
        yield Complaint("diagnosis", "", f"{dict(told)} are {dict(true)}")


def _diagnosis(plain: dict[str, object], reading: Reading) -> Iterator[str]:
    rule, args = str(plain["rule"]), plain["args"]
    mine = [each for each in reading.findings if each.rule == rule]
    assert isinstance(args, dict)
    yield from _cases(plain, args, mine)
    frames = plain["frames"]
    assert isinstance(frames, list)
    if not set(frames) <= {frame for each in mine for frame in (each.frame, *each.frames)}:
        yield f"no finding is in the frames {frames}"
    if shown(str(plain["filter"])) != set(frames):
        yield f"{plain['filter']} does not show {frames}"
    transactions = plain["transactions"]
    assert isinstance(transactions, list)
    if not set(transactions) <= {each.transaction for each in mine}:
        yield f"no finding is of the transactions {transactions}"


def _cases(plain: dict[str, object], args: dict[str, object], mine: list[Finding]) -> Iterator[str]:
    """The findings that an entry sums up: how many there are, in what they differ, and what of it the entry says."""
    rule, differs, count = str(plain["rule"]), plain["differs"], plain["count"]
    transactions, frames = plain["transactions"], plain["frames"]
    assert isinstance(differs, list)
    assert isinstance(transactions, list)
    assert isinstance(frames, list)
    cases = [
        each for each in mine
        if all(each.args[name] == value for name, value in args.items() if name not in differs)
        and each.frame in frames
    ]  # fmt: skip
    if not cases:
        yield f"no finding has the arguments {args}"
        return
    if not plain["frames_left_out"] and len(cases) < int(str(count)):
        yield f"count {count} is {len(cases)}"
    for name in args:
        values = {repr(each.args[name]) for each in cases}
        if name in differs and (args[name] is not None or len(values) < 2):
            yield f"{name} is said to differ, and is {values}"
    shown_ones = set().union(*(words.named(rule, each.args) for each in cases))
    sentence = str(plain["message"])
    if set(differs) & shown_ones and words.has_many(rule):
        yield from words.problems(rule, sentence, args, many=True)
    else:
        yield from words.problems(rule, sentence, cases[0].args)
