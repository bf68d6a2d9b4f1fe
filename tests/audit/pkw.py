"""Transactions of PKW: whether their words stand in the frames that are named, and what findings DS5xx claim.

Read from the bytes of the frames at the place that the report names; what a word means is looked up in the manual's
way: AK is the first digit, then the number of the parameter; index; two words of the value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import dropwhile, pairwise, takewhile
from typing import Any

from tests.audit import cyclic
from tests.audit.reading import Complaint, Finding, Reading

NEGATIVE, NO_RIGHTS = 7, 8
WORD_WRITES = (2, 7, 12, 14)
WRITES = (*WORD_WRITES, 3, 8, 11, 13)
ANSWERS = {
    1: (1, 2), 2: (1,), 3: (2,), 4: (3,), 5: (3,), 6: (4, 5), 7: (4,), 8: (5,), 9: (6,), 11: (5,), 12: (4,),
    13: (2,), 14: (1,), 15: (15,),
}  # fmt: skip
"""Request -> what may answer it, apart from 7 and 8."""
UNREAD_MS = 10_000
PAGES = ((0x80, 2000), (0x10, 4000), (0x20, 8000), (0x40, 16000), (0x04, 32000), (0x08, 64000))
Plain = dict[str, Any]


class Talk:
    """A transaction of PKW and its relation."""

    def __init__(self, plain: Plain, reading: Reading) -> None:
        self.plain, self.reading = plain, reading
        self.asked = bytes.fromhex(plain["bytes"]["request"])
        told = plain["bytes"]["response"]
        self.told = None if told is None else bytes.fromhex(told)
        self.begins: int = plain["frames"]["write_request"]
        self.ends: int | None = plain["frames"]["read_response"]
        place = [plain[key] for key in ("controller", "device", "api", "slot", "subslot")]
        self.relation: Plain = [
            each for each in reading.plain["relations"]
            if [each[key] for key in ("controller", "device", "api", "slot", "subslot")] == place
            and each["channel"] == "pkw" and each["frame"] < self.begins
        ][-1]  # fmt: skip

    def words(self, side: str) -> list[tuple[int, bytes]]:
        """Frame and the eight bytes of every frame of a direction; none where the state behind them is not good.

        What was said before its stations set up the relation is of another one.
        """
        return [
            (part.frame, part.data[:8] if part.good else b"")
            for part in cyclic.parts(self.reading, self.relation, side)
            if part.frame >= self.relation["frame"]
        ]

    def since(self) -> list[tuple[int, bytes]]:
        """Frames of the controller from the whole request on."""
        there = [each for each in self.words("output") if each[1] and each[0] >= self.begins]
        return list(dropwhile(lambda each: each[1] != self.asked, there))

    @property
    def ak(self) -> int:
        return self.asked[0] >> 4

    @property
    def parameter(self) -> tuple[int, int]:
        """Number and subindex, the page in the low byte of the index."""
        base = int.from_bytes(self.asked[:2]) & 0x7FF
        return base + sum(more for bit, more in PAGES if self.asked[3] & bit), self.asked[2]


def talks(reading: Reading) -> Iterator[Talk]:
    for plain in reading.plain["transactions"]:
        if plain["channel"] == "pkw":
            yield Talk(plain, reading)


def check(reading: Reading) -> Iterator[Complaint]:
    """Whether words stand where a transaction says that they are, and not a frame before."""
    for talk in talks(reading):
        for side, number, words in (
            ("output", talk.begins, talk.asked),
            ("input", talk.ends, talk.told),
        ):
            if number is None or words is None:
                continue
            there = talk.words(side)
            place = [frame for frame, _ in there].index(number)
            same = there[place][1] == words
            before = place and there[place - 1][1] == words
            settled = side == "input" and talk.plain["cycles"] is None
            halves = "DS506" in talk.plain["findings"]
            if (not same and not halves) or (before and not settled):
                where = f"#{talk.plain['id']}"
                yield Complaint("pkw", where, f"{words.hex()} does not come in frame {number}")


Auditor = Callable[[Finding, Talk], Iterator[str]]


def of(finding: Finding, reading: Reading) -> Iterator[str]:
    """What is not so in a finding about PKW."""
    talk = next((each for each in talks(reading) if each.plain["id"] == finding.transaction), None)
    if talk is None:
        yield "it is of no transaction"
        return
    if {"pnu", "subindex"} <= set(finding.args):
        told = finding.args["pnu"], finding.args["subindex"]
        if told != talk.parameter:
            yield f"the parameter is {talk.parameter}"
    yield from AUDITORS[finding.rule](finding, talk)


def _negative(finding: Finding, talk: Talk) -> Iterator[str]:
    if talk.told is None or talk.told[0] >> 4 != NEGATIVE or finding.frame != talk.ends:
        yield "no negative response is in this frame"
        return
    first, second = int.from_bytes(talk.told[4:6]), int.from_bytes(talk.told[6:8])
    code = finding.args["code"]
    if code is not None and code not in ((second,) if second or not first else (first,)):
        yield f"the error number is {second} or {first}"


def _no_rights(finding: Finding, talk: Talk) -> Iterator[str]:
    if talk.told is None or talk.told[0] >> 4 != NO_RIGHTS or finding.frame != talk.ends:
        yield "no response with AK 8 is in this frame"


def _withdrawn(finding: Finding, talk: Talk) -> Iterator[str]:
    after = talk.since()
    end = next((frame for frame, words in after if words != talk.asked), None)
    if end is None or end != finding.frame or dict(after)[end][0] >> 4:
        yield f"the request was not withdrawn in frame {finding.frame}"
        return
    times = [talk.reading.time(frame) for frame in (talk.begins, end)]
    truth = ((times[1] or 0) - (times[0] or 0)) / 1e6
    if finding.args["milliseconds"] != truth:
        yield f"it stood for {truth} ms"
    yield from _unanswered(talk, end)


def _replaced(finding: Finding, talk: Talk) -> Iterator[str]:
    after = talk.since()
    end = next((frame for frame, words in after if words != talk.asked), None)
    if end is None or finding.args["by"] != end or not dict(after)[end][0] >> 4:
        yield f"no other request replaced it in frame {finding.args['by']}"
        return
    if finding.args["request"] != talk.begins:
        yield f"the request came in frame {talk.begins}"
    yield from _unanswered(talk, end)


def _unanswered(talk: Talk, end: int) -> Iterator[str]:
    """Whether a response for the same parameter came while the request stood.

    One to a change that brings another value may be that to the request before.
    """
    for (_, before), (frame, words) in pairwise(talk.words("input")):
        if not words or not talk.begins < frame < end or words == before:
            continue
        same = (int.from_bytes(words[:2]) ^ int.from_bytes(talk.asked[:2])) & 0x7FF == 0
        fits = words[0] >> 4 in ANSWERS.get(talk.ak, ()) and words[2:4] == talk.asked[2:4]
        if same and fits and (talk.ak not in WRITES or words[4:] == talk.asked[4:]):
            yield f"a response came in frame {frame}"


def _mismatch(finding: Finding, talk: Talk) -> Iterator[str]:
    request = bytes.fromhex(finding.args["request"])
    response = bytes.fromhex(finding.args["response"])
    if request != talk.asked or dict(talk.words("input")).get(finding.frame) != response:
        yield "these words are not in the frames"
    one, other = int.from_bytes(request[:2]) & 0x7FF, int.from_bytes(response[:2]) & 0x7FF
    same = (one, request[2:4]) == (other, response[2:4])
    if same and response[0] >> 4 in ANSWERS.get(request[0] >> 4, ()):
        yield "it is a response to this request"


def _parts(finding: Finding, talk: Talk) -> Iterator[str]:
    there, begun = talk.words("output"), talk.reading.time(finding.frame) or 0
    place = next((at for at, (frame, _) in enumerate(there) if frame == finding.frame), None)
    if place is None:
        yield "no words of the controller change in this frame"
        return
    first, before = there[place][1], there[place - 1][1]
    half_ns = (talk.relation["cycle_ms"] or 0) * 5e5  # what comes sooner is seen twice
    later = (at for at in there[place + 1 :] if (talk.reading.time(at[0]) or 0) - begun >= half_ns)
    second = next(later, there[place])[1]
    if second != talk.asked or talk.ak not in WRITES:
        yield "the request is not whole one cycle later"
    if (first[:4] == before[:4]) == (first[4:] == before[4:]):
        yield "parameter and value changed together"


def _wrong_word(finding: Finding, talk: Talk) -> Iterator[str]:
    if talk.ak not in WORD_WRITES or finding.frame != talk.begins:
        yield "no word is written in this frame"
    if finding.args["pwe"] != int.from_bytes(talk.asked[4:6]) or not finding.args["pwe"]:
        yield f"PWE1 is {talk.asked[4:6].hex()}"


LOOKED_AT = 4
"""Of captures as short as these one cyclic frame of a sender in so many is looked at."""


def _ticks(reading: Reading, earlier: int, frame: int) -> float:
    """The time between two frames in ticks of the cycle counter, which may have come round."""
    return ((reading.time(frame) or 0) - (reading.time(earlier) or 0)) / 1e6 * cyclic.TICKS


def of_incomplete(finding: Finding, reading: Reading) -> Iterator[str]:
    """DS110: frames of the drive are missing where a request stood or ended, or its response comes right behind it."""
    talk = next(each for each in talks(reading) if each.plain["id"] == finding.transaction)
    first, last, what = (finding.args[name] for name in ("first", "last", "what"))
    if finding.frame != talk.begins or talk.told is not None or finding.args["numbers"] is not None:
        yield "it is of no request without a response"
    after = talk.since()
    end = next((frame for frame, words in after if words != talk.asked), after[-1][0])
    if what == "cyclic_frames":
        yield from (_uncounted if talk.relation["cycle_ms"] is None else _counted)(
            talk, first, last
        )
        if last < talk.begins or first > end:
            yield f"the request stood from {talk.begins} to {end}"
    elif what == "cyclic_behind":
        behind = [each for each in talk.words("input") if each[0] > end]
        if (first, last) != (end, behind[0][0] if behind else None):
            yield f"it ended in frame {end}, and the first frame behind that is {behind[:1]}"
            return
        if not _may_answer(behind[0][1], talk.asked):
            yield f"{behind[0][1].hex()} is no response to it"
    elif what == "ends":
        yield from _soon(talk, after)
    else:
        yield f"what {what!r} is nothing"


def _uncounted(talk: Talk, first: int, last: int) -> Iterator[str]:
    """Nothing counts the frames: a pause is between these, or the drive says already what is asked only then."""
    pair = talk.relation["controller"], talk.relation["device"]
    if any(first <= one < two <= last for one, two in cyclic.pauses(talk.reading, pair)):
        return
    asked = dict(talk.words("output")).get(last)  # data exchange without data asks nothing
    said = [words for frame, words in talk.words("input") if frame < last][-1]
    if not asked or not _may_answer(said, asked):
        yield f"{said.hex()} is no answer to what is asked in frame {last} only"


def _counted(talk: Talk, first: int, last: int) -> Iterator[str]:
    """The cycle counter goes on by more than a cycle in between."""
    reading, relation = talk.reading, talk.relation
    there = [
        (way, each.frame, int.from_bytes(reading.capture.frames[each.frame - 1].data[-4:-2]))
        for way in ("input", "output") for each in cyclic.parts(reading, relation, way)
    ]  # fmt: skip
    cycle = relation["cycle_ms"] * cyclic.TICKS
    steps = [
        max((now - before) % cyclic.COUNTERS, _ticks(reading, earlier, frame))
        for (way, earlier, before), (same, frame, now) in pairwise(there)
        if way == same and frame > first and earlier < last  # another drive may have shown it
    ]  # fmt: skip
    if not any(step > 1.5 * cycle for step in steps):
        yield f"no frame is missing between {first} and {last}"


def _soon(talk: Talk, after: list[tuple[int, bytes]]) -> Iterator[str]:
    """It stands to the end, not much longer than the limit, or than the slowest response took."""
    reading, behind = talk.reading, after[-1]
    stood = (reading.time(behind[0]) or 0) - (reading.time(talk.begins) or 0)
    slowest = max((each.plain["duration_ms"] or 0 for each in talks(reading)), default=0)
    late = (LOOKED_AT + 1) * (talk.relation["cycle_ms"] or 0)
    if stood / 1e6 > max(UNREAD_MS, slowest) + late:
        yield f"it stood for {stood / 1e6} ms"
    if behind[1] != talk.asked:
        yield f"{behind[1].hex()} is asked at the end"


def of_end(frame: int, reading: Reading) -> bool:
    """Whether words of a channel of PKW are in a frame of the controller."""
    return any(
        frame == each.frame
        for relation in reading.plain.get("relations", ()) if relation["channel"] == "pkw"
        for each in cyclic.parts(reading, relation, "output")
    )  # fmt: skip


def _may_answer(words: bytes, asked: bytes) -> bool:
    same = not (int.from_bytes(words[:2]) ^ int.from_bytes(asked[:2])) & 0x7FF
    answers = ANSWERS.get(asked[0] >> 4, ())
    return words[0] >> 4 in (NEGATIVE, NO_RIGHTS) or (same and words[0] >> 4 in answers)


def of_ignored(finding: Finding, reading: Reading) -> Iterator[str]:
    """DS514: what stands from a frame on reads as a request, and nothing of the drive fits it."""
    for relation in reversed(reading.plain.get("relations", ())):
        there = [
            each for each in cyclic.parts(reading, relation, "output")
            if each.frame >= relation["frame"]
        ]  # fmt: skip
        numbers = [each.frame for each in there]
        if relation["channel"] == "pkw" and finding.frame in numbers:
            break
    else:
        yield "no words of PKW are in this frame"
        return
    place = numbers.index(finding.frame)
    asked = there[place].data
    stood = place > 0 and there[place - 1].good and there[place - 1].data == asked
    if asked[0] >> 4 not in ANSWERS or stood:
        yield "no request begins in this frame"
        return
    whole = _whole(asked, next((each.data for each in there[place:] if each.data != asked), asked))
    same = list(takewhile(lambda each: each.data in (asked, whole), there[place:]))
    end = there[place + len(same)] if place + len(same) < len(there) else same[-1]
    if finding.args["milliseconds"] * 1e6 > end.time_ns - there[place].time_ns:
        yield "it stands shorter"
    for part in cyclic.parts(reading, relation, "input"):
        fits = part.data[0] >> 4 in (*ANSWERS[asked[0] >> 4], NEGATIVE)
        # Where a request was answered, the relation is known: one before this may have had the same response.
        known = relation["certainty"] != "lengths"
        fits = fits and part.frame >= (finding.frame if known else relation["frame"])
        if fits and (int.from_bytes(part.data[:2]) ^ int.from_bytes(asked[:2])) & 0x7FF == 0:
            yield f"a response is in frame {part.frame}"
            return


def _whole(first: bytes, second: bytes) -> bytes:
    """A change that comes in two parts: its second frame, where one half is that of the first."""
    half = second[:4] == first[:4] or second[4:] == first[4:]
    return second if half and second[0] >> 4 in WRITES else first


AUDITORS: dict[str, Auditor] = {
    "DS501": _negative, "DS502": _no_rights, "DS503": _withdrawn, "DS504": _replaced, "DS505": _mismatch,
    "DS506": _parts, "DS513": _wrong_word,
}  # fmt: skip
