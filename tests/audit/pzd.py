"""Control and status words: whether the events are those of the frames, and what findings DS507 to DS533 claim.

Every frame of a relation is read, changed or not, and the bits are those of the manual. What stands for some seconds
is looked for in each of the frames.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, takewhile
from typing import Any, NamedTuple

from tests.audit import cyclic, dp, wire
from tests.audit.reading import Complaint, Finding, Reading

Plain = dict[str, Any]
CONTROL = {
    (0, 1): "on", (0, 0): "off1", (1, 0): "off2", (2, 0): "off3", (3, 1): "enable-operation",
    (3, 0): "disable-operation", (4, 1): "ramp-generator-on", (4, 0): "ramp-generator-off",
    (5, 1): "ramp-generator-continued", (5, 0): "ramp-generator-frozen", (6, 1): "setpoint-enabled",
    (6, 0): "setpoint-blocked", (7, 1): "acknowledge", (8, 1): "jog-1", (8, 0): "jog-1-end", (9, 1): "jog-2",
    (9, 0): "jog-2-end", (11, 1): "reverse", (11, 0): "forward",
}  # fmt: skip
STATUS = {
    (1, 1): "ready", (1, 0): "not-ready", (2, 1): "running", (2, 0): "stopped", (3, 1): "fault",
    (3, 0): "fault-cleared", (4, 0): "off2-active", (4, 1): "off2-inactive", (5, 0): "off3-active",
    (5, 1): "off3-inactive", (6, 1): "inhibited", (6, 0): "released", (7, 1): "alarm", (7, 0): "alarm-cleared",
    (9, 1): "control-requested", (9, 0): "local",
}  # fmt: skip
LIMITS = {"DS521": 10, "DS523": 2, "DS524": 2, "DS525": 2, "DS526": 5}
"""Seconds for which something stands before it is said, as docs and findings have them."""
COUNTS = {"DS508": 10, "DS509": 100, "DS511": 1000}
OF_SPEED = [name for (bit, _), name in CONTROL.items() if bit in (4, 5, 6, 11)]
"""Of telegram 7 these bits are about positions, and its lengths are those of telegram 1."""
STATES = ((0x40, 0x40, "S1"), (7, 7, "S4"), (7, 3, "S3"), (7, 1, "S2"))


class Look(NamedTuple):
    """What both sides say after a frame; None before the first word, and where the data is not valid."""

    frame: int
    time_ns: int
    by_controller: bool
    stw1: int | None
    zsw1: int | None
    setpoint: int
    actual: int
    heeded: int
    code: int


class Drive:
    """One relation of PZD, frame by frame."""

    def __init__(self, relation: Plain, reading: Reading) -> None:
        self.relation = relation
        later = [
            each["frame"] for each in reading.plain.get("relations", ())
            if all(each[key] == relation[key] for key in ("channel", "controller", "device", "slot"))
        ]  # fmt: skip
        later += [
            call.response.frame for call in reading.capture.calls
            if call.request.operation == wire.CONNECT and call.response
            and call.response.kind == wire.RESPONSE and call.response.body[:4] == bytes(4)
            and (call.request.client, call.request.server) == (relation["controller"], relation["device"])
        ]  # fmt: skip
        self.ends: int = min(
            (each for each in later if (each or 0) > (relation["frame"] or 0)),
            default=len(reading.capture.frames) + 1,
        )
        """The frame in which another one takes its place, which need not be proven."""
        self.far = False
        """Whether a word behind STW1 or ZSW1 is no number of a traversing task: these end at 63."""
        self.looks: list[Look] = list(self._read(reading))

    @property
    def is_speed(self) -> bool:
        """Whether these words are speeds: by the telegrams, or where none is known by what they say."""
        known = set(self.relation["telegrams"])
        return not {7, 9, 111, 112} & known if known else self.far

    def _read(self, reading: Reading) -> Iterator[Look]:
        words: dict[bool, bytes | None] = {True: None, False: None}
        heeded, setpoint, actual, code = None, 0, 0, 0
        turns = 0x800 if reading.vendors.get(self.relation["device"]) in (None, 0x2A) else 0
        sides = [
            (part, sent) for sent, side in ((True, "output"), (False, "input"))
            for part in cyclic.parts(reading, self.relation, side)
        ]  # fmt: skip
        for part, sent in sorted(sides, key=lambda each: each[0].frame):
            if self.relation["frame"] < part.frame < self.ends:
                words[sent] = part.data if part.good else None
                self.far |= part.good and int.from_bytes(part.data[2:4]) & 0x7FFF > 63
                out, in_ = words[True], words[False]
                if out is not None:
                    stw1 = int.from_bytes(out[:2])
                    heeded = stw1 if stw1 & 0x400 else heeded
                    setpoint = int.from_bytes(out[2:4], signed=True) * (-1 if stw1 & turns else 1)
                if in_ is not None:
                    actual = int.from_bytes(in_[2:4], signed=True)
                    code = int.from_bytes(in_[10:12])
                yield Look(
                    part.frame, part.time_ns, sent, _word(out), _word(in_), setpoint, actual,
                    (_word(out) or 0) if heeded is None else heeded, code,
                )  # fmt: skip

    def before(self, frame: int, by_controller: bool) -> tuple[Look, Look]:
        """The frame of a side before one, and this one; twice the first, where this one is of the other side."""
        side = [each for each in self.looks if each.by_controller == by_controller]
        place = next((at for at, each in enumerate(side) if each.frame == frame), 0)
        return side[max(0, place - 1)], side[place]

    def while_(self, frame: int, seconds: float) -> list[Look]:
        """What was said from a frame on, for some seconds, without the moment at which they end."""
        there = [each for each in self.looks if each.frame >= frame]
        end = there[0].time_ns + round(seconds * 1e9)
        return list(takewhile(lambda each: each.time_ns < end, there))


def _word(data: bytes | None) -> int | None:
    return None if data is None else int.from_bytes(data[:2])


def drives(reading: Reading) -> list[Drive]:
    return [
        Drive(each, reading)
        for each in reading.plain.get("relations", ())
        if each["channel"] == "pzd"
    ]


def check(reading: Reading) -> Iterator[Complaint]:
    """Whether the events are those that the frames have, and in which state the drive is then."""
    mixed = {each.args["device"] for each in reading.findings if each.rule == "DS515"}
    for timeline in reading.plain.get("timelines", ()):
        drive = Drive(reading.plain["relations"][timeline["relation"] - 1], reading)
        left_out = {"first"} if drive.is_speed else {"first", *OF_SPEED}
        if reading.vendors.get(drive.relation["device"]) not in (None, 0x2A):
            left_out |= {"reverse", "forward"}  # bit 11 is the maker's
        events = [each for each in timeline["events"] if each["name"] not in left_out]
        said = sorted((each["frame"], each["name"]) for each in events)
        truth = sorted(each for each in _events(drive.looks) if each[1] not in left_out)
        if drive.relation["device"] in mixed:  # told as far as its frames are of one drive
            truth = truth[: len(said)]
        if (end := _configured_anew(drive, reading)) is not None:
            truth = [each for each in truth if each[0] < end or each in said]
        if said != truth:
            odd = sorted(set(said) ^ set(truth))[:4]
            yield Complaint("pzd", f"relation {timeline['relation']}", f"the events differ: {odd}")
        for each in timeline["events"]:
            look = next((look for look in drive.looks if look.frame == each["frame"]), None)
            if look is None:
                yield Complaint("pzd", f"frame {each['frame']}", f"{each['name']}: is not of it")
                continue
            if each["state"] != _state(look):
                where = f"frame {each['frame']}"
                yield Complaint(
                    "pzd", where, f"{each['name']}: {each['state']} and not {_state(look)}"
                )
            word = look.stw1 if each["word"] == "STW1" else look.zsw1
            if each["word"] and each["after"] != word:
                yield Complaint("pzd", f"frame {each['frame']}", f"{each['word']} is {word}")


def _configured_anew(drive: Drive, reading: Reading) -> int | None:
    """The frame of a later configuration of its device: behind it the words have to show themselves once more."""
    mine, line = drive.relation, reading.line
    later = [
        each["frame"] for each in reading.plain["relations"] if each["device"] == mine["device"]
    ]
    later += [
        each.asked.number for each in (line.turns if line is not None else ())
        if each.asked.service == "configuration" and f"dp{each.asked.da}" == mine["device"]
        and dp.is_taken(each)
    ]  # fmt: skip
    return min((frame for frame in later if frame > mine["frame"]), default=None)


def offers(reading: Reading) -> Iterator[Complaint]:
    """Whether the words at the offsets that the report offers may be those of a drive, and whether it offers them."""
    for sender in reading.plain.get("senders", ()):
        option = f"{sender['mac']}@{sender['frame_id']:04X}:{sender.get('offset')}:pzd"
        if sender.get("word") is None:
            continue
        words = {
            int.from_bytes(each.data[sender["offset"] : sender["offset"] + 2])
            for each in reading.capture.rt
            if each.frame.number <= 2000
            and (each.sender, each.frame_id) == (sender["mac"], sender["frame_id"])
        }
        if sender["word"] == "STW1":
            so = not any(each & 0xF000 for each in words) and any(
                each & 0x406 == 0x406 for each in words
            )
        else:
            so = all(each & 7 in (0, 1, 3, 7) or each & 8 for each in words)
        if not so or option not in reading.text:
            yield Complaint("pzd", option, f"is no {sender['word']}, or is not offered")


COMMANDS = {
    "ON": (0, 1), "OFF1": (0, 0), "OFF2": (1, 0), "OFF3": (2, 0), "enable operation": (3, 1),
    "operation no longer enabled": (3, 0), "acknowledge fault": (7, 1),
}  # fmt: skip
"""What an event may come after: the bit of the control word, and what it becomes."""
_AFTER = re.compile(
    r"^  frame ([\d,]+) .*, ([\d.]+) (ms|s) after ([A-Za-z0-9 ]+?)(?:  .*)?$", re.MULTILINE
)


def stories(reading: Reading) -> Iterator[Complaint]:
    """Whether an event of the text report comes after its command, which is in force and is what explains it."""
    known = drives(reading)
    for number, time, unit, command in _AFTER.findall(reading.text):
        frame = int(number.replace(",", ""))
        drive = next(each for each in known if any(look.frame == frame for look in each.looks))
        before = [each for each in drive.looks if each.frame <= frame]
        for text in _after(before, float(time) * (1e9 if unit == "s" else 1e6), *COMMANDS[command]):
            yield Complaint("pzd", f"frame {frame}", f"after {command}: {text}")


def _after(looks: Sequence[Look], span_ns: float, bit: int, value: int) -> Iterator[str]:
    given = [
        place for place, (one, two) in enumerate(pairwise(looks), 1)
        if one.heeded >> bit & 1 != value and two.heeded >> bit & 1 == value
    ]  # fmt: skip
    if not given:
        yield "it was never said"
        return
    since = looks[given[-1] :]
    if abs(since[-1].time_ns - since[0].time_ns - span_ns) > max(span_ns / 99, 51_000):
        yield f"it is {since[-1].time_ns - since[0].time_ns} ns later"
    if bit != 7 and any(each.heeded >> bit & 1 != value for each in since):
        yield "it is no longer in force"
    known = [None not in (each.stw1, each.zsw1) for each in looks]
    heard = known.index(True) if True in known else 0  # a hole may be before that
    if not all(known[max(given[-1], heard) :]):
        yield "data was not valid in between"
    # Where frames are out of order, what is behind the command in the file may have come before it.
    while len(since) > 1 and since[1].time_ns < since[0].time_ns:
        since = since[1:]
    faults = [bool((each.zsw1 or 0) & 8) for each in since]
    if (bit == 7) != faults[0] or (bit == 7 and faults[-1]) or (bit != 7 and any(faults)):
        yield "a fault is nearer, or there is none to acknowledge"


def _state(look: Look) -> str | None:
    if look.zsw1 is None:
        return None
    for mask, bits, name in STATES:
        if look.zsw1 & mask == bits:
            off = look.heeded & 0x400 and not look.heeded & 0x300 and look.heeded & 5 != 5
            return "S5" if name in ("S3", "S4") and off else name
    return "not ready"


def _events(looks: Sequence[Look]) -> Iterator[tuple[int, str]]:
    """What happens, told slowly: frame and name."""
    valid: dict[bool, bool] = {}
    stw1 = zsw1 = heeded = None
    for look in looks:
        sent, now = look.by_controller, look.stw1 if look.by_controller else look.zsw1
        name = "output" if sent else "input"
        if now is None:
            if valid.get(sent):
                yield look.frame, f"{name}-lost"
                valid[sent] = False
            continue
        if valid.get(sent) is False:
            yield look.frame, f"{name}-back"
        valid[sent] = True
        if sent:
            if stw1 is not None and (stw1 ^ now) & 0x400:
                yield look.frame, "control" if now & 0x400 else "no-control"
            if stw1 is not None and now & 0x400 and heeded is not None:
                yield from ((look.frame, each) for each in _edges(CONTROL, heeded, now))
            stw1, heeded = now, now if now & 0x400 else heeded
        else:
            if zsw1 is not None:
                yield from ((look.frame, each) for each in _edges(STATUS, zsw1, now))
            zsw1 = now


def _edges(names: dict[tuple[int, int], str], before: int, after: int) -> Iterator[str]:
    for bit in range(16):
        value = after >> bit & 1
        if before >> bit & 1 != value and (bit, value) in names:
            yield names[bit, value]


# Findings about operation


def of(finding: Finding, reading: Reading) -> Iterator[str]:
    """What is not so in a finding about control and status word."""
    frame = finding.frame
    for drive in drives(reading):
        where = drive.relation["device"], drive.relation["slot"]
        there = any(each.frame == frame for each in drive.looks)
        if where == (finding.args["device"], finding.args["slot"]) and there:
            yield from AUDITORS[finding.rule](finding, drive)
            return
    yield "no drive of that slot has this frame"


def _stands(finding: Finding, drive: Drive) -> list[Look]:
    """What was said while it stood; both sides were known by then."""
    there = drive.while_(finding.frame, finding.args["seconds"])
    return [each for each in there if each.stw1 is not None and each.zsw1 is not None]


def _long_enough(finding: Finding, wrong: list[Look]) -> Iterator[str]:
    if finding.args["limit"] != LIMITS[finding.rule]:
        yield f"the limit is {LIMITS[finding.rule]} s"
    if finding.args["seconds"] < finding.args["limit"]:
        yield "it did not stand for as long as the limit"
    if wrong:
        yield f"it is not so in frame {wrong[0].frame}"


def _fault(finding: Finding, drive: Drive) -> Iterator[str]:
    said = [each for each in drive.looks if each.zsw1 is not None and not each.by_controller]
    place = next((at for at, each in enumerate(said) if each.frame == finding.frame), 0)
    before, now = said[max(0, place - 1)], said[place]
    if (before.zsw1 or 0) & 8 or not (now.zsw1 or 0) & 8:
        yield "no fault comes in this frame"
    elif not (before.zsw1 or 0) & 4 or drive.before(now.frame, by_controller=False)[0] != before:
        yield from _stopped_of_itself(drive, said[:place], now)
    code = finding.args["code"]
    if (code is None) != (finding.args["what"] == "pzd_fault"):
        yield "the number of the fault is not said"
    codes = [each.code for each in drive.looks if each.frame >= finding.frame and each.code]
    if code is not None and codes[:1] != [code]:
        yield f"the number is {codes[:1]}"


def _stopped_of_itself(drive: Drive, said: list[Look], fault: Look) -> Iterator[str]:
    """Whether a drive ran up to a second before, and nobody switched it off; `said`: its valid words before."""
    ran = next((each for each in reversed(said) if (each.zsw1 or 0) & 4), None)
    if ran is None:
        yield "the drive did not run"
        return
    since = [each for each in drive.looks if ran.frame <= each.frame < fault.frame]
    if any(each.heeded & 0xE != 0xE or not each.heeded & 0x301 for each in since):
        yield "the controller switched it off"
    words = [each.zsw1 for each in since if each.zsw1 is not None and not each.by_controller]
    if any(each & 0x230 != 0x230 for each in words):
        yield "it was switched off at the drive"
    stood = [each for each in since if not each.by_controller and each != ran]
    if len(words) > 1 and fault.time_ns - stood[0].time_ns > 10**9:
        yield "it does not run for more than a second"


def _idle(finding: Finding, drive: Drive) -> Iterator[str]:
    there = _stands(finding, drive)
    wrong = [each for each in there if (each.stw1 or 0) & 0x40F != 0x40F or (each.zsw1 or 0) & 0x4C]
    yield from _long_enough(finding, wrong)
    state = _state(there[0])
    if finding.args["what"] != f"pzd_{(state or '').replace(' ', '_')}":
        yield f"the drive stands in {state}"


def _ignored(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=True)
    word = now.stw1 or 0
    if (before.stw1 or 0) & 1 or not word & 1 or word & 0x400:
        yield "there is no ON without bit 10 in this frame"
    if finding.args["word"] != word:
        yield f"the word is {word:04X}"


def _inhibited(finding: Finding, drive: Drive) -> Iterator[str]:
    there = _stands(finding, drive)
    wrong = [
        each for each in there if (each.stw1 or 0) & 0x407 != 0x407 or not (each.zsw1 or 0) & 0x40
    ]
    yield from _long_enough(finding, wrong)


def _acknowledged(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=True)
    if (before.stw1 or 0) & 0x80 or (now.stw1 or 0) & 0x480 != 0x480:
        yield "no edge of the acknowledgement is in this frame"
    yield from _long_enough(
        finding, [each for each in _stands(finding, drive) if not (each.zsw1 or 0) & 8]
    )


def _not_taken(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=True)
    if (before.stw1 or 0) & 0x80 or (now.stw1 or 0) & 0x480 != 0x80:
        yield "no edge of the acknowledgement without bit 10 is in this frame"
    if finding.args["word"] != now.stw1:
        yield f"the word is {now.stw1}"
    there = drive.while_(finding.frame, LIMITS["DS524"])
    edges = (
        each.frame for last, each in pairwise(there)
        if (each.stw1 or 0) & 0x480 == 0x480 and not (last.stw1 or 0) & 0x80
    )  # fmt: skip
    end = next(edges, there[-1].frame + 1)  # what counts there acknowledges it
    if any(each.zsw1 is not None and not each.zsw1 & 8 for each in there if each.frame < end):
        yield "the fault goes then"


def _stands_at_the_end(finding: Finding, drive: Drive) -> Iterator[str]:
    words = [each for each in drive.looks if not each.by_controller]
    while words and words[-1].zsw1 is None:  # its data is not valid any more
        words.pop()
    since = [each for each in words if each.frame >= finding.frame]
    if any(each.zsw1 is None or not each.zsw1 & 8 for each in since):
        yield "the fault goes"
    before = [each for each in words if each.frame < finding.frame]
    if before and before[-1].zsw1 is not None and before[-1].zsw1 & 8:
        yield "it was seen before"
    codes = [each.code for each in drive.looks if each.frame >= finding.frame and each.code]
    if finding.args["code"] is not None and codes[:1] != [finding.args["code"]]:
        yield f"the number is {codes[:1]}"


def _locked(finding: Finding, drive: Drive) -> Iterator[str]:
    there = _stands(finding, drive)
    bits = [bit for bit in (4, 5, 6) if not there[0].heeded >> bit & 1]
    if finding.args["bits"] != bits:
        yield f"the bits are {bits}"
    yield from _long_enough(finding, [each for each in there if not _is_locked(each)])
    end = there[0].time_ns + round(finding.args["seconds"] * 1e9)
    last = [each for each in drive.looks if each.time_ns == end and _is_locked(each)]
    setpoints = [each.setpoint for each in [*there, *last]]  # what stands in the last frame counts
    if max(setpoints) - min(setpoints) < 160:
        yield "the setpoint does not change"


def _is_locked(look: Look) -> bool:
    return bool((look.zsw1 or 0) & 4 and look.heeded & 0x70 != 0x70)


def _away(finding: Finding, drive: Drive) -> Iterator[str]:
    there, gap = _stands(finding, drive), 10 * 163.84
    if finding.args["percent"] != 10:
        yield "it is 10 % of the reference value"
    if there:  # of the last cycle, or a little more, one side may have been looked at, and the other one not
        end = there[-1].time_ns - (drive.relation["cycle_ms"] or 0) * 1.5e6
        there = [each for each in there if each.time_ns <= end] or there[:1]
    wrong = [
        each for each in there
        if abs(each.setpoint - each.actual) <= gap or (each.zsw1 or 0) & 0x104 != 4 or each.heeded & 0x77 != 0x77
    ]  # fmt: skip
    yield from _long_enough(finding, wrong)


def _not_requested(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=False)
    if not (before.zsw1 or 0) & 0x200 or (now.zsw1 or 0) & 0x200 or not (now.stw1 or 0) & 0x400:
        yield "control is not lost in this frame"


def _stopped(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=True)
    if not (before.stw1 or 0) & 0x400 or not (now.zsw1 or 0) & 4:  # its word may be newer
        yield "the drive did not run under control"
    if now.stw1 != (0 if finding.args["what"] == "pzd_zero" else None):
        yield f"the word is {now.stw1}"


def _off(finding: Finding, drive: Drive) -> Iterator[str]:
    before, now = drive.before(finding.frame, by_controller=False)
    active, asked = {"OFF2": (0x10, 2), "OFF3": (0x20, 4)}[finding.args["off"]]
    if not (before.zsw1 or 0) & active or (now.zsw1 or 0) & active:
        yield "it does not become active in this frame"
    if not now.heeded & asked:
        yield "the controller asks for it"


def of_change(finding: Finding, reading: Reading) -> Iterator[str]:
    """A change that was not accepted, and the state of the drive from its request to its response."""
    deal = next(each for each in reading.plain["transactions"] if each["id"] == finding.transaction)
    first, last = deal["frames"]["write_request"], deal["frames"]["read_response"]
    codes = [each["error"]["code"] for each in deal["parameters"] if each["error"]]
    if finding.frame != last:
        yield f"its response is in frame {last}"
    if deal["operation"] != "change" or not set(codes) & {0x11, 0x6B, 0x71}:
        yield "no such change was turned down"
    named = finding.args["pnu"], finding.args["subindex"]
    if named not in [
        (each["pnu"], each["subindex"]) for each in deal["parameters"] if each["error"]
    ]:
        yield "it is another parameter"
    drive = [
        each for each in drives(reading)
        if (each.relation["device"], each.relation["slot"]) == (deal["device"], deal["slot"])
        and each.looks and each.looks[0].frame <= last
    ][-1]  # fmt: skip
    known = [each for each in drive.looks if each.zsw1 is not None and each.frame <= last]
    there = [each for each in known if each.frame >= first] or known[-1:]
    if drive.ends <= first:
        yield f"its channel was set up anew in frame {drive.ends}"
        return
    if any(each.zsw1 is None for each in drive.looks if there[0].frame <= each.frame <= last):
        yield "the data of the drive is not valid"
        return
    runs = finding.rule == "DS530"
    if any(bool((each.zsw1 or 0) & 4) != runs for each in there):
        yield "the drive was in another state"
    if not runs:
        state = _state(there[-1]) or "not ready"
        if finding.args["what"] != f"pzd_{state.replace(' ', '_')}":
            yield f"the drive stands in {state}"
        return
    if finding.args["what"] != ("pzd_since_ever" if finding.args["since"] is None else "pzd_since"):
        yield "since when it runs is not said"
    said = cyclic.parts(reading, drive.relation, "input")
    begins = drive.relation["frame"]
    stood = [
        each.frame for each in said if each.good and not each.data[1] & 4 and each.frame >= begins
    ]
    if finding.args["since"] is None and stood and stood[0] < first:
        yield f"it did not run in frame {stood[0]}"
    began = [
        now.frame for before, now in pairwise(known)
        if now.frame <= first and not (before.zsw1 or 0) & 4 and (now.zsw1 or 0) & 4
    ]  # fmt: skip
    if finding.args["since"] != (began[-1] if began else None):
        yield f"it runs since {began[-1:]}"


AUDITORS: dict[str, Callable[[Finding, Drive], Iterator[str]]] = {
    "DS520": _fault, "DS521": _idle, "DS522": _ignored, "DS523": _inhibited, "DS524": _acknowledged,
    "DS525": _locked, "DS526": _away, "DS527": _not_requested, "DS528": _stopped, "DS529": _off,
    "DS532": _not_taken, "DS533": _stands_at_the_end,
}  # fmt: skip
OF_CHANGES = ("DS530", "DS531")


# Findings about habits


def of_habit(finding: Finding, reading: Reading) -> Iterator[str]:
    """What is not so in a finding about all requests to a drive."""
    args = finding.args
    if finding.rule in COUNTS and args["limit"] != COUNTS[finding.rule]:
        yield f"the limit is {COUNTS[finding.rule]}"
    own = [
        each for each in reading.plain["transactions"]
        if each["channel"] == "pkw" and (each["device"], each["slot"]) == (args["device"], args["slot"])
    ]  # fmt: skip
    if finding.rule == "DS512":
        place = args["device"], args["slot"], finding.frame
        known = {
            (each["device"], each["slot"], each["frame"]) for each in reading.plain["relations"]
        }
        if place not in known:
            yield "no such drive was set up in this frame"
        if own:
            yield f"there are {len(own)} requests"
        return
    if finding.rule == "DS510":
        counted = [each for each in own if bytes.fromhex(each["bytes"]["request"])[3] & 3]
    elif finding.rule == "DS511":
        counted = [each for each in own if (each["duration_ms"] or 0) > args["limit"]]
        if max((each["duration_ms"] or 0 for each in counted), default=0) != args["slowest"]:
            yield "another one is the slowest"
    else:
        aks = range(11, 15) if finding.rule == "DS508" else (1, 6)
        counted = [
            each for each in own
            if int(each["bytes"]["request"][0], 16) in aks
            and (each["parameters"][0]["pnu"], each["parameters"][0]["subindex"]) == (args["pnu"], args["subindex"])
        ]  # fmt: skip
        if len(counted) <= args["limit"]:
            yield "it is no more than the limit"
    if len(counted) != args["count"]:
        yield f"it is {len(counted)} times"


HABITS = ("DS508", "DS509", "DS510", "DS511", "DS512")


def of_word(finding: Finding, reading: Reading) -> Iterator[str]:
    """DS507: the response to a read of the same parameter, in the frame that is named, was a double word."""
    args = finding.args
    reads = [
        each
        for each in reading.plain["transactions"]
        if each["frames"]["read_response"] == args["read"]
    ]
    if not any(int(each["bytes"]["response"][0], 16) in (2, 5) for each in reads):
        yield "it was no double word"
    told = [(each["parameters"][0]["pnu"], each["parameters"][0]["subindex"]) for each in reads]
    if (args["pnu"], args["subindex"]) not in told:
        yield "another parameter was read"
