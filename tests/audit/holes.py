"""Whether what is said of a capture with holes is true of the whole one.

Of program, drive and cable the whole conversation is the truth: findings, the states of transactions, values. What is
said of the recording is a matter of the cut one, and `run` looks at that as at any other capture.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from math import inf
from pathlib import Path
from typing import Any

from tests.audit import causes, cuts, pkw, pzd, reading, run, stations, wire
from tests.audit.claims import Case
from tests.audit.memory import Memory
from tests.audit.reading import Complaint, Deal, Finding, Reading

OF_THE_RECORDING = {
    "DS101", "DS102", "DS103", "DS105", "DS106", "DS107", "DS109", "DS110", "DS209", "DS403", "DS725",
    "DS512", "DS533", "DS915",
}  # fmt: skip
"""Rules about what is in the capture."""
COUNTS = {
    "count", "polls", "milliseconds", "seconds", "period", "time", "dropped", "number", "of", "frames",
}  # fmt: skip
"""Arguments that count, time or list what is in the capture."""

OF_COUNTS = {
    "DS701": {"case", "among"},
    "DS902": {"size"},
    "DS904": {"area", "jobs"},
    "DS810": {"last"},
    "DS816": {"last"},
    "DS417": {"by"},  # the last one that the capture shows
    "DS111": {"has"},  # the repeated request tells
    "DS907": {"byte"},  # of the first write
}
"""Arguments of a rule that follow from such a count."""
NOTHING = (
    None, "sap_unknown", "exchange_since", "exchange_none", *(f"{n} x unknown address" for n in range(1, 5)),
)  # fmt: skip
"""Arguments that say nothing."""
ALIKE = {
    **dict.fromkeys(("DS401", "DS402"), "its AR was released"),  # the cut has not the Release
    "DS705": "it is known whose request was open",  # in the cut one it may not be
    "DS722": "neither Release nor Connect",  # but a response that comes first there
    "DS413": "the new request that followed",  # a later one did, too
    "DS414": "the new request that followed",
    "DS417": "written last may be",  # it says what the capture shows
    "DS714": "the drive reads it as",  # what was read the cut does not have
    "DS917": "no connection is refused in this frame",  # the frame of RST, which stands before that of CR
    # Of an answer, and the cut has not the job.
    "DS908": (
        *(f"area '{n} x unknown address' is" for n in range(1, 5)),
        "something else than an element",  # what else is asked for the cut does not show
    ),
    "DS907": "it is byte",
    "DS701": "a STATUS tells of it",  # of the Write, which the cut does not have
    # How many and how slow: that is counted in the cut.
    **dict.fromkeys(("DS508", "DS509", "DS510", "DS511"), ("it is ", "another one is the slowest")),
    # The cut has not the Connect that set it up anew, and nothing proves it in the whole one.
    **dict.fromkeys(pkw.AUDITORS, "it is of no transaction"),
    **dict.fromkeys(pzd.AUDITORS, "no drive of that slot has this frame"),
    **dict.fromkeys(pzd.OF_CHANGES, ("its channel was set up anew", "it runs since []")),
    # Of it the cut has no response, or not in its order.
    "DS704": ("a new request was written", "no new request was written"),
}
"""How complaints begin of what is true of the whole as well."""
_NEGATIVE = 0x80
"""Response IDs from here on say that something failed."""
UNSUPPORTED = 0x80
"""The response ID of a drive that does not know the request ID."""
SHORTLY = 4
"""Frames around one that is lost alone."""


@cache
def _of_type(rule: str, *types: str) -> set[str]:
    return {name for name, kind in run.declared()[rule].items() if kind in types}


class Whole:
    """A conversation without holes."""

    def __init__(self, item: Reading) -> None:
        self.item = item
        self.memory = Memory(item)
        self.told: dict[tuple[str, int], list[Finding]] = {}
        for each in item.findings:
            self.told.setdefault((each.rule, each.frame), []).append(each)
        self.by_write = {(each.write, each.place): each for each in item.deals if each.write}
        self.first = _first_frames(item)
        self.second = {each.frame for call in item.capture.calls for each in call.others}
        self.by_frame: dict[int, list[Deal]] = {}
        for deal in item.deals:
            for frame in deal.all_frames:
                self.by_frame.setdefault(frame, []).append(deal)


def _first_frames(item: Reading) -> dict[int, int]:
    """Of each frame of a request or a response that was sent again, or of a fragment, the one that the report tells."""
    again = {frame: call.request.frame for frame, call in item.call_at.items()}
    for call in item.capture.calls:
        if call.response is not None:
            again |= dict.fromkeys(call.repeated, call.response.frame)
    pieces = ((frame, pdu.frame) for pdu in item.capture.pdus for frame in pdu.frames)
    return {**again, **{frame: again.get(whole, whole) for frame, whole in pieces}}


def _agrees(rule: str, told: dict[str, Any], true: dict[str, Any], kept: list[int]) -> bool:
    """Whether arguments say nothing else than those of the whole.

    None says nothing, a count is that of the cut, and of a frame that is not kept the next one that shows it is told.
    """
    fixed = set(told) - COUNTS - OF_COUNTS.get(rule, set())
    later = {
        name for name in _of_type(rule, "frame")
        if isinstance(true[name], int) and true[name] not in kept and isinstance(told[name], int) and told[name] > true[name]
    }  # fmt: skip
    return all(told[name] in (*NOTHING, true[name]) for name in fixed - later)


def of(path: Path, names: Iterable[str] = cuts.ALL) -> Iterator[Complaint]:
    """What is not so in the reports of cuts of a capture."""
    whole = Whole(reading.read(path, text=False, page=False))
    with tempfile.TemporaryDirectory() as folder:
        for name, frames in cuts.of(whole.item.capture.frames, names):
            there = Path(folder, "cut.pcap")
            cuts.write(there, frames)
            ended = name not in cuts.LONGER
            for each in check(whole, reading.read(there, page=False), frames, ended=ended):
                yield Complaint(each.rule, f"{each.where} ({name})", each.text)


def check(
    whole: Whole, cut: Reading, frames: cuts.Cut, *, ended: bool = True
) -> Iterator[Complaint]:
    """What is not so in the report of one cut; `frames` are those of the whole one that are left.

    `ended`: whether it ends where the whole one does, or earlier.
    """
    if cut.line and whole.item.line and cut.line.doubled > whole.item.line.doubled:
        return  # equal answers that disorder put side by side: a line of two places looks like that
    numbers = [each.number for each in frames]
    whole_one = numbers == sorted(numbers) and len(set(numbers)) == len(whole.item.capture.frames)
    # The auditor of S7 reads whole connections alone.
    for complaint in () if whole.item.plain.get("connections") else run.complaints(cut, {}):
        if complaint.rule != "line" or whole_one:  # else nobody knows whose all Reads are
            yield complaint
    origin = [0, *(whole.first.get(at, at) for at in numbers)]
    if _takes_a_stray(whole, cut, [0, *numbers]):
        return
    for deal in cut.deals:
        same = _same(whole, deal, origin)
        settled = ended or (same is not None and same.answer is not None and _is_over(whole, same))
        settled = settled and not _given_away(whole, deal, origin)
        if deal.cyclic or not settled or (same is None and _is_unproven(whole, deal)):
            continue
        if same is None:
            strange = deal.write is not None or origin[deal.read or 0] not in whole.second
            about = [
                f"no transaction of the whole has frame {origin[deal.write or deal.read or 0]}"
            ]
            texts: Iterable[str] = about if strange else []
        else:
            texts = _deal(whole, same, deal, cut, origin)
        for text in texts:
            yield Complaint("whole transaction", f"#{deal.id}", text)
    for finding in cut.findings if ended else ():
        if finding.rule not in OF_THE_RECORDING:
            for text in _finding(whole, finding, cut, origin):
                where = f"frame {finding.frame}, {origin[finding.frame]} of all"
                yield Complaint(finding.rule, where, f"{text} [{finding.message}]")


def _takes_a_stray(whole: Whole, cut: Reading, origin: list[int]) -> bool:
    """Whether an answer to nothing stands in the cut where the true answer is lost: nobody can tell them apart."""
    if cut.line is None or whole.item.line is None:
        return False
    stray = {each.number for each in whole.item.line.stray}
    return any(turn.answer and origin[turn.answer.number] in stray for turn in cut.line.turns)


def merged(one: Path, two: Path) -> Iterator[Complaint]:
    """What is not so in the report of two recordings as one: the states of their transactions stay."""
    with tempfile.TemporaryDirectory() as folder:
        there, plant = Path(folder, "merged.pcap"), Path(folder, "elsewhere.pcap")
        cuts.write(plant, cuts.elsewhere(wire.frames(two)))
        cuts.write(there, cuts.merged(wire.frames(one), wire.frames(plant)))
        cut = reading.read(there, page=False)
        whole = [reading.read(path, text=False, page=False) for path in (one, plant)]
    yield from run.complaints(cut, {})
    told = Counter(
        (each.plain["start"], each.place, each.state) for each in cut.deals if each.answer
    )
    for item in whole:
        for deal in item.deals:
            if deal.answer and not told[deal.plain["start"], deal.place, deal.state]:
                yield Complaint(
                    "merged", f"#{deal.id} of {item.name}", f"is no longer {deal.state}"
                )


def _same(whole: Whole, deal: Deal, origin: list[int]) -> Deal | None:
    """The transaction of the whole conversation that one of a cut is of."""
    if deal.write is not None:
        return whole.by_write.get((origin[deal.write], deal.place))
    there = whole.by_frame.get(origin[deal.read or 0], [])
    return next((each for each in there if each.place == deal.place), None)


def _first_seen(frame: int, cut: Reading, origin: list[int]) -> range:
    """The frames of the whole of which a frame of a cut may be the first one that is left, if it is a cyclic one."""
    there = [each for each in cut.capture.rt if each.frame.number <= frame]
    number, last = origin[frame], there[-1] if there else None
    if last is None or last.frame.number != frame:
        return range(number, number + 1)
    before = [origin[each.frame.number] for each in there[:-1] if each[1:4] == last[1:4]]
    return range(min([number, *(each + 1 for each in before[-1:])]), number + 1)


def _is_over(whole: Whole, same: Deal) -> bool:
    """Whether nothing is open on a channel at the end: what comes behind that is for nobody else."""
    there = [each for each in whole.item.deals if each.channel == same.channel]
    return there[-1].answer is not None


def _deal(whole: Whole, same: Deal, deal: Deal, cut: Reading, origin: list[int]) -> Iterator[str]:
    allowed = {same.state, "orphan" if deal.write is None else "incomplete"}
    if same.state == "unanswered":
        allowed.add("superseded")  # the cut has not what ended the connection before
    if _connected_at_last(whole, same, origin):
        allowed.add("unanswered")
    if same.state == "superseded" and _next_write(whole, same) > max(origin):
        allowed.add("unanswered")  # its connection ended before, as far as the cut shows
    if deal.frames["write_response"] is None and same.state == "refused":
        return  # that it was refused the cut does not show, nor that an old answer was read
    short = _of_another_length(deal, same)
    allowed |= short
    if (again := _asked_again(whole, same, origin[deal.read or 0])) is not None:
        alike = (each for each in whole.item.deals if _is_once_more(each, again))
        allowed |= {each.state for each in alike if each is again or _same_bytes(each, deal)}
    if deal.state not in allowed:
        yield f"{deal.state} is {same.state} (#{same.id} of the whole)"
    read = origin[deal.read or 0]
    told = _alike(deal, same)  # the same once more, or the begin of it
    told = told or again is not None
    if deal.read is not None and read not in same.all_frames and not told:
        yield f"its response is that of frame {same.read} of the whole, not of {read}"
    same_one = deal.state == same.state and read in same.all_frames
    if same_one and deal.answer and same.answer and not short:
        mine = [_values(each) for each in deal.parameters]
        if mine != [_values(each) for each in same.parameters]:
            yield f"parameters are others than those of #{same.id} of the whole"


def _of_another_length(deal: Deal, same: Deal) -> set[str]:
    """The states of a transaction whose record is not there whole, or of which another Read brought more or less."""
    if deal.cut or deal.short:
        positive = deal.answer is not None and (deal.answer.id or _NEGATIVE) < _NEGATIVE
        # Whatever its blocks say then; a negative one that has all values says what it is at its end.
        negative = {"partial"} if not any(each["error"] for each in same.parameters) else set()
        return {"incomplete", *(("ok",) if positive else negative)}
    other = _alike(deal, same) and not _same_bytes(deal, same)
    return {"ok", "partial", "error"} if other else set()


def _connected_at_last(whole: Whole, same: Deal, origin: list[int]) -> bool:
    """Whether the cut ends between a Connect of the AR of a request and its response, which outlived that."""
    end = max(origin)
    return (same.read or 0) > end and any(each <= end for each in whole.item.ends(same))


def _is_unproven(whole: Whole, deal: Deal) -> bool:
    """Whether index 47 of its AR shows in the cut alone that it is DS47: the whole one says nothing of it."""
    connection = deal.controller, deal.device, deal.ar
    return deal.index == 47 and connection not in whole.item.connections_of_47


def _asked_again(whole: Whole, same: Deal, read: int) -> Deal | None:
    """The transaction that asks for the same, byte for byte, and whose response is in a frame."""
    there = whole.by_frame.get(read, []) if read else []
    return next((each for each in there if _is_once_more(each, same)), None)


def _is_once_more(one: Deal, other: Deal) -> bool:
    """Whether two transactions of a place ask for the same, byte for byte."""
    asked = one.plain["bytes"]["request"]
    return bool(asked) and one.place == other.place and asked == other.plain["bytes"]["request"]


def _next_write(whole: Whole, same: Deal) -> float:
    """The frame of the next Write of its channel that was accepted."""
    there = whole.item.on_channel.get(same.channel, [])
    later = (e.asked for e in there if e.write and e.status == 0 and e.asked > (same.write or 0))
    return min(later, default=inf)


def _given_away(whole: Whole, deal: Deal, origin: list[int]) -> bool:
    """Whether the whole knows that a request was over, and leaves the record that mirrors it to another Write.

    Or to one with its reference, where it was the first one of its channel (docs/pairing.md, P77), or to nobody,
    where it does not know what became of the request, or a Read of it was refused.
    """
    there = whole.by_frame.get(origin[deal.read or 0], [])
    same, states = _same(whole, deal, origin), {each.state for each in there}
    unknown = same is not None and same.state == "incomplete"
    if unknown and not there and deal.state == "refused" and deal.read is not None:
        return True
    if not _fits_wholly(deal):
        return False
    if states == {"orphan"} and (unknown or (same is not None and same.state == "refused")):
        return True
    others = [each for each in there if each.state in ("refused", "mismatch")]
    if not all(_fits_wholly(each) for each in others):
        return True
    writes = [
        each.write for each in whole.item.deals if each.channel == deal.channel and each.write
    ]
    alike = any(
        each.asked and deal.asked and each.asked.reference == deal.asked.reference for each in there
    )
    return alike and bool(deal.write) and origin[deal.write] == min(writes)


def _fits_wholly(deal: Deal) -> bool:
    """Whether a response has the number of parameters, too; behind response ID 0x80 no number is documented."""
    answer = deal.answer
    if answer is None or not deal.fits:
        return False
    return answer.id == UNSUPPORTED or answer.data[3:4] == bytes([deal.parameters_asked])


def _values(plain: dict[str, Any]) -> tuple[object, ...]:
    return tuple(repr(plain[name]) for name in ("pnu", "subindex", "values", "error"))


def _moved(finding: Finding, origin: list[int]) -> dict[str, Any]:
    """The arguments with the frames of the whole one."""
    args = dict(finding.args)
    for name in _of_type(finding.rule, "frame"):
        if isinstance(args[name], int):
            args[name] = origin[args[name]]
    for name in _of_type(finding.rule, "frames"):
        args[name] = sorted({origin[each] for each in args[name]})
    return args


def _finding(whole: Whole, finding: Finding, cut: Reading, origin: list[int]) -> Iterator[str]:
    """What of a finding is not so of the whole: neither its report says that, nor do its frames."""
    if finding.rule.startswith("DS5"):
        yield from _of_words(whole, finding, cut, origin)
        return
    deal = cut.deal(finding)
    if deal is not None and deal.write is None and origin[finding.frame] in whole.second:
        return  # of a second response, of which the whole tells no more than that: `run` looks at its bytes
    same = _same(whole, deal, origin) if deal is not None else None
    args, frame = _moved(finding, origin), origin[finding.frame]
    of_its_bytes = not any(args.get(each) for each in _of_type(finding.rule, "frame", "frames"))
    if deal is not None and same is not None and of_its_bytes and finding.frame == deal.write:
        again = _asked_again(whole, same, origin[deal.read or 0])
        if again is not None and again.write is not None:  # what is said of one is said of both
            same, frame = again, again.write
    if finding.rule != "DS704":
        frame = _first_time(frame, deal is not None and finding.frame == deal.read, deal, same)
    moved = Finding(
        finding.rule, finding.severity, frame, [frame], args,
        finding.offset, finding.message, "", same.id if same else None, None,
    )  # fmt: skip
    if moved.rule == "DS721":
        yield from _saved(whole, args, origin)
        return
    there = whole.told.get((moved.rule, moved.frame), [])
    if "frames" in args or moved.rule in OF_COUNTS:  # the first of them the cut one may not have
        there = [each for each in whole.item.findings if each.rule == moved.rule]
    true = [each.args for each in there if _agrees(moved.rule, args, each.args, origin)]
    if true and _are_named(args.get("frames", []), [each.get("frames", []) for each in true]):
        return
    if frame != origin[finding.frame] and deal and same and not _same_bytes(deal, same):
        return  # of the record itself, of which another Read brought more or less: `run` looks at that
    if deal and _is_free(whole, deal, same, moved.rule, origin):
        return
    if moved.rule == "DS703" and ("DS110", moved.frame) in whole.told:
        return  # the whole one does not know it: nothing contradicts
    yield from _untrue(whole, moved, origin)


def _of_words(whole: Whole, finding: Finding, cut: Reading, origin: list[int]) -> Iterator[str]:
    """The same of what is said of cyclic frames: it is in the first frame that is left since it became so.

    Of a request and what comes 0.1 ms later from the other side, the file says which was first.
    """
    if finding.rule in pkw.AUDITORS and origin != sorted(origin):
        return
    seen = _first_seen(finding.frame, cut, origin)
    deal, texts = cut.deal(finding), list[str]()
    same = _same(whole, deal, origin) if deal is not None else None
    begun = range(0)
    if deal is not None and deal.cyclic and deal.write is not None:
        begun = _first_seen(deal.write, cut, origin)
        there = (whole.by_write.get((each, deal.place)) for each in begun)
        same = next(filter(None, there), None)
    for frame in reversed(seen):
        earlier = {origin[finding.frame]: frame}
        if same is not None and deal is not None:
            earlier[origin[deal.write or 0]] = same.write or 0
        args = _moved(finding, [earlier.get(each, each) for each in origin])
        moved = replace(finding, frame=frame, args=args, transaction=same.id if same else None)
        told = whole.told.get((finding.rule, frame), [])
        if any(_agrees(finding.rule, args, each.args, origin) for each in told):
            return
        found = list(_untrue(whole, moved, origin))
        if not found:
            return
        texts = texts or found
    if deal is not None and finding.rule in pzd.OF_CHANGES:  # by what the drive said before it
        seen = range(origin[deal.write or 0] - SHORTLY, origin[finding.frame])
    if not any(_is_alone(each, origin) for each in (*begun, *seen)):
        yield from texts


def _is_alone(frame: int, origin: list[int]) -> bool:
    """Whether a frame is lost, and no other one near it: what was so for that cycle only nobody knows."""
    near = range(frame - SHORTLY, frame + SHORTLY + 1)
    return frame > 0 and [each for each in near if each > 0 and each not in origin] == [frame]


def _untrue(whole: Whole, moved: Finding, origin: list[int]) -> Iterator[str]:
    """What the auditor of its rule says of a finding in the whole one, but for what the cut one cannot know."""
    rule, args = moved.rule, moved.args
    free = COUNTS | OF_COUNTS.get(rule, set())
    for text in run.AUDITORS[rule](Case(moved, whole.item, whole.memory)):
        alike = text.startswith(ALIKE.get(rule, "-")) or _is_outside(rule, text, origin)
        alike = alike or _is_other_letter(text, args)
        wrong = re.fullmatch(r"it is not so in frame (\d+)", text)
        alike = alike or (wrong is not None and _is_alone(int(wrong[1]), origin))
        if text.split(" ")[0] not in free and not _says_nothing(text, args) and not alike:
            yield text


def _is_free(whole: Whole, deal: Deal, same: Deal | None, rule: str, origin: list[int]) -> bool:
    """Whether the whole is not the truth about a transaction of the cut one: it says another thing, or nothing."""
    if _given_away(whole, deal, origin) or (same is None and _is_unproven(whole, deal)):
        return True
    if deal.write is None and same and same.answer and not same.fits:
        return True  # the whole reads it as the answer to a request that it is not the answer to
    ended = rule in ("DS401", "DS402", "DS722")
    return ended and same is not None and _connected_at_last(whole, same, origin)


def _are_named(told: list[int], true: list[list[int]]) -> bool:
    """Whether the frames are those of the whole, of which only the first ones are named."""
    named = {frame for each in true for frame in each}
    ends = max((each[-1] for each in true if len(each) >= stations.KEPT), default=inf)
    return all(frame in named or frame > ends for frame in told)


def _saved(whole: Whole, args: dict[str, Any], origin: list[int]) -> Iterator[str]:
    """Whether all was saved while the cut one ran: what comes at its end, or behind, it cannot show."""
    for deal in whole.item.deals if args["count"] else ():
        for moment, _, everything, done in causes.saves(whole.item, deal):
            inside = args["last"] < moment[0] < max(origin) and deal.device == args["device"]
            if inside and everything and done:
                yield f"all was saved in frame {moment[0]}"


def _is_outside(rule: str, complaint: str, origin: list[int]) -> bool:
    """Whether what contradicts came before the cut one began, or after its end.

    DS415, DS417 and DS530 say what the capture shows: there it is what the capture has not.
    """
    pattern = {
        "DS417": r"the value is not known since frame (\d+)", "DS415": r"first \d+ is (\d+)",
        "DS530": r"it runs since \[(\d+)\]",
    }.get(rule, "-")  # fmt: skip
    unknown = re.fullmatch(pattern, complaint)
    if unknown is not None:
        return int(unknown[1]) not in origin
    wanted = {
        "DS708": "a call there is accepted", "DS401": "the channel goes on", "DS402": "the channel goes on",
    }.get(rule, "-")  # fmt: skip
    found = re.fullmatch(rf"{wanted} in frame (\d+)", complaint)
    return found is not None and int(found[1]) not in range(origin[1], max(origin) + 1)


def _says_nothing(complaint: str, args: dict[str, Any]) -> bool:
    """Whether somebody complains of an argument that is not known in the cut capture."""
    name, _, rest = complaint.partition(" ")
    return name in args and args[name] is None and rest.startswith("None is ")


def _is_other_letter(complaint: str, args: dict[str, Any]) -> bool:
    """Whether somebody complains of P for p alone: whose parameters they are the cut one may not show."""
    meant = complaint.removeprefix("what is meant is ")
    return meant.lower() == str(args.get("meant")).lower()


def _first_time(frame: int, read: bool, deal: Deal | None, same: Deal | None) -> int:
    """The frame in which a response was read first, of one that was read again."""
    if deal is None or same is None or same.read is None:
        return frame
    again = frame in [each["response"] for each in same.rereads]
    return same.read if again or (read and _alike(deal, same)) else frame


def _same_bytes(deal: Deal, same: Deal) -> bool:
    return bool(deal.answer and same.answer and deal.answer.data == same.answer.data)


def _alike(deal: Deal, same: Deal) -> bool:
    """Whether one of two responses begins with the other one."""
    if deal.answer is None or same.answer is None:
        return False
    one, other = deal.answer.data, same.answer.data
    return one.startswith(other) or other.startswith(one)
