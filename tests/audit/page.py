"""The text report against the transactions: verdict, sums, drives, headlines with their filters, lines, PLC."""

from __future__ import annotations

import calendar
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

from tests.audit import plc
from tests.audit.reading import Complaint, Deal, Finding, Reading, shown
from tests.audit.words import RULES, has_many, problems

TITLES = (
    "Drives", "Other devices", "What to do", "What this capture cannot show", "Transactions", "Findings",
    "Summary", "Channels in cyclic frames", "PROFIBUS",
)  # fmt: skip
WORDS_OF_DRIVES = "Control and status word, "
COUNTED = {
    r"drives?": "drives", r"(jobs?|transactions?)": "all", r"refused": "refused",
    r"(failed|error|errors|with an error)": "error",
    r"(failed in part|partial|partly|in part|refused in part)": "partial",
    r"(answered wrongly|mismatch(es)?|do(es)? not fit.*)": "mismatch",
    r"(without an answer|unanswered|without a response|no response)": "unanswered",
    r"(overtaken|superseded)": "superseded", r"incomplete": "incomplete",
    r"((answers?|responses?) without (its|their|a) request|orphans?)": "orphan",
    r"captures? not read to (its|their) end": "unread", r"S7 connections?": "connections", "ok": "ok",
    r"drives? in cyclic frames": "watched", r"stations? of PROFIBUS": "stations",
}  # fmt: skip
"""Words of a count -> the state that is counted."""
FAILED = ("refused", "error", "partial", "mismatch")
TOLD = (
    "refused",
    "error",
    "partial",
    "mismatch",
    "unanswered",
    "superseded",
    "incomplete",
    "orphan",
)
OPEN = ("unanswered", "superseded", "incomplete")
"""States of which nobody knows what became of it."""
_HEAD = re.compile(r"^(DS\d{3}) (error|warning|note) ([a-z0-9-]+): (.*)$")
_TIMES = re.compile(r" \(([\d,]+) times?(?: in ([\d,]+) frames?)?\)$")
_REST = re.compile(
    r"^  (DS\d{3}) [a-z0-9-]+: ([\d,]+) more causes? of this kind, ([\d,]+) times? in all$"
)
_LOOK = re.compile(r"^look at frame (\d+)(?:.*?)(?: \((?:#(\d+), )?([^)]*)\))?: (frame\.number.*)$")
_START = re.compile(
    r"(\d{4}-\d\d-\d\d) (\d\d:\d\d:\d\d\.\d{3}) \+00:00 \(UTC\)(?: first frame| to (.*?), ([\d.,]+ (?:ms|s|min)))"
)
_UNDATED = "no time of day: the clock of the capture begins at "
_SINCE_1980 = 315_532_800
_STATE = "the status word of the drive (#"
_OF_STATE = ("DS530", "DS531")
_PARTS = re.compile(r"->|instead of|send instead|these respond|look at")
"""How lines begin that are neither words nor status word."""
_DEVICE = re.compile(r"^(\d+\.\d+\.\d+\.\d+|dp\d+): ")
_MORE = re.compile(r"^(.*?)\s+\(and (\d+) more frames?\)$")
_PNU = re.compile(r"\b(?:[prP]0*(?=[\d?])|(?=6\d{4}\b))(\d+|\?)(?:\[(\d+)(?:\.\.(\d+))?\])?")


def sections(text: str) -> dict[str, list[str]]:
    """The lines below each title; those above the first one under ""."""
    found: dict[str, list[str]] = {"": []}
    title = ""
    for line in text.splitlines():
        if line in TITLES or line.startswith(WORDS_OF_DRIVES):
            title = line
            found[title] = []
        elif line:
            found[title].append(line)
    return found


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about the text report of one capture."""
    if not reading.text:
        return
    parts = sections(reading.text)
    for rule, text in [
        *((("times"), each) for each in _times(parts[""], reading)),
        *((("verdict"), each) for each in _verdict(parts[""], reading)),
        *((("drives"), each) for each in _drives(parts.get("Drives", []), reading)),
        *((("summary"), each) for each in _summary(parts.get("Summary", []), reading)),
        *((("blind"), each) for each in _blind(parts.get("What this capture cannot show", []), reading)),
    ]:  # fmt: skip
        yield Complaint(rule, "", text)
    lines = parts.get("What to do", [])
    items = headlines(lines)
    for item in items:
        if any(each.rule == item.rule and re.search(rf"\({item.times} times?\)$", each.message)
               for each in reading.findings):  # fmt: skip
            item.text += item.number
            item.times = item.wide = 1  # a number of the sentence itself
    for text in _rests(lines, items, reading):
        yield Complaint("headline", "", text)
    for item in items:
        for text in headline(item, reading):
            yield Complaint("headline", item.rule, text)
    yield from _lines(parts.get("Transactions", []), reading)
    yield from _groups(parts.get("Findings", []), reading)


# Times


def _first(reading: Reading) -> int:
    return nanoseconds(reading.plain["start"])


def nanoseconds(text: str) -> int:
    """Nanoseconds since 1970 of a time of the JSON."""
    seconds, _, fraction = text.removesuffix("Z").partition(".")
    when = datetime.fromisoformat(seconds + "+00:00")
    return calendar.timegm(when.utctimetuple()) * 10**9 + int(fraction.ljust(9, "0"))


def dated(reading: Reading) -> bool:
    """Whether the clock of the capture was set."""
    return _first(reading) >= _SINCE_1980 * 10**9


def clock(deal: Deal, reading: Reading) -> str:
    """When a transaction began, as the text says it."""
    if not dated(reading):
        return f"{since(deal, reading)} s"
    return moment(deal.plain["start"], reading)


def moment(time: str, reading: Reading) -> str:
    """A time of the JSON as time of day."""
    last = reading.last
    date, day = time.split("T")
    other_day = last is not None and last // (86_400 * 10**9) != _first(reading) // (86_400 * 10**9)
    told = f"{date} {day[:12]}" if other_day else day[:12]
    return f"{told} +00:00" if last and last - _first(reading) > 30 * 86_400 * 10**9 else told


def since(deal: Deal, reading: Reading) -> str:
    """Seconds since the first frame."""
    return seconds(nanoseconds(deal.plain["start"]), reading)


def seconds(time_ns: int, reading: Reading) -> str:
    """The same of any time, in ns since 1970."""
    return f"{(time_ns - _first(reading)) // 10**6 / 1000:.3f}"


def _times(lines: list[str], reading: Reading) -> Iterator[str]:
    """The line about the capture: its first and last frame."""
    if reading.plain.get("start") is None:
        return
    text = " ".join(" ".join(lines).split())
    if not dated(reading):
        if f"{_UNDATED}{reading.plain['start'][:19].replace('T', ' ')}" not in text:
            yield "does not say that the clock was not set"
        return
    told = _START.search(text)
    if told is None:
        yield "does not say when the capture begins"
        return
    if f"{told[1]}T{told[2]}" != reading.plain["start"][:23]:
        yield f"the first frame is of {reading.plain['start']}, not {told[1]} {told[2]}"
    yield from _ends(told[3], told[4], reading)


def _ends(told: str | None, length: str | None, reading: Reading) -> Iterator[str]:
    """The last frame and the length of the capture."""
    last = nanoseconds(reading.plain["end"])
    if reading.capture.frames:
        true = reading.capture.frames[0].time_ns, reading.capture.frames[-1].time_ns
        if true != (_first(reading), last):
            yield f"the capture is of {true}, not {reading.plain['start']} to {reading.plain['end']}"
    if last < _first(reading):
        if told:
            yield f"the last frame, of {reading.plain['end']}, is before the first one"
        return
    if not told or not reading.plain["end"][:23].endswith(
        told.split()[-1 if "+" not in told else -2]
    ):
        yield f"the last frame is of {reading.plain['end']}, not {told}"
    if not length or not near(length, (last - _first(reading)) / 1e6):
        yield f"the capture is {(last - _first(reading)) / 1e6} ms long, not {length}"


# Counts


def _counts(text: str) -> Iterator[tuple[str, int]]:
    """`28 failed, 53 failed in part` as pairs of state and number; what is not known is itself."""
    for part in text.split(", "):
        found = re.fullmatch(r"(\d[\d,]*) (.*)", part.strip())
        if found is None:
            yield part.strip(), -1
            continue
        number, words = int(found[1].replace(",", "")), found[2]
        name = next((name for form, name in COUNTED.items() if re.fullmatch(form, words)), words)
        yield name, number


def _tally(
    text: str, deals: list[Deal], drives: int | None, connections: int | None = None
) -> Iterator[str]:
    states = Counter(each.state for each in deals)
    true = {**states, "all": len(deals), "drives": drives, "connections": connections}
    told = dict(_counts(text))
    for name, number in told.items():
        if name in ("all done", "all answered", "all ok"):
            bad = {state: count for state, count in states.items() if state != "ok"}
            if bad:
                yield f"{name!r}, but {bad}"
        elif name == "all with a response":
            if {state for state, count in states.items() if count} - {"ok"}:
                yield f"{name!r}, but {dict(states)}"
            if any(each.plain["bytes"]["response"] is None for each in deals if not each.s7):
                yield f"{name!r}, but one has none"
        elif name in TOLD or name in ("ok", "all", "drives", "connections"):
            if number != true.get(name, 0):
                yield f"{number} {name} are {true.get(name, 0)}"
        elif name not in ("unread", "watched", "stations"):
            yield f"counts {name!r}, which nobody knows"
    for state in TOLD:
        if states[state] and state not in told:
            yield f"does not tell {states[state]} {state}"


def _verdict(lines: list[str], reading: Reading) -> Iterator[str]:
    said = [
        each
        for each in _unbroken(lines)
        if re.match(r"(NOT OK|WARNING|OK|EMPTY|  \d+ (drive|stat|S7|trans))", each)
    ]
    word, _, text = (said[0] if said else "").partition(": ")
    states = {each.state for each in reading.deals}
    severities = {each.severity for each in reading.findings}
    bad = "error" in severities or states & {*FAILED}
    look = "warning" in severities or states & {*OPEN}
    look = look or not reading.plain["complete"]
    look = look or any(each.severity != RULES[each.rule]["severity"] for each in reading.findings)
    true = (
        "NOT OK"
        if bad
        else "WARNING"
        if look
        else "OK"
        if states or reading.plain.get("timelines")
        else "EMPTY"
    )
    if word != true:
        yield f"{word!r} is {true!r}"
    if reading.deals:
        there = text.partition("; ")[0] if word == "OK" or len(said) < 2 else said[1].strip()
        drives = len({each.device for each in reading.deals if not each.s7})
        yield from _tally(there, reading.deals, drives, len(reading.plain.get("connections", ())))
    if word != "OK":
        yield from _failures(text, reading.deals)


def _failures(text: str, deals: list[Deal]) -> Iterator[str]:
    """What the verdict says of transactions that failed, and of those with an unknown outcome."""
    states = Counter(each.state for each in deals)
    text = text.replace("the only transaction", "1 of 1 transactions")
    text = re.sub("outcome unknown for ([^;,]+)", r"\1 outcome unknown", text)
    for words, kinds in (("fail", FAILED), ("outcome unknown", OPEN)):
        found = re.search(rf"([\d,]+)(?: of ([\d,]+) transactions)? {words}", text)
        told = 0 if found is None else int(found[1].replace(",", ""))
        true = sum(states[each] for each in kinds)
        if told != true:
            yield f"says {told} {words}, it is {true}"
        if found and found[2] and int(found[2].replace(",", "")) != len(deals):
            yield f"says of {found[2]} transactions, there are {len(deals)}"


def _drives(lines: list[str], reading: Reading) -> Iterator[str]:
    devices = {each.device for each in reading.deals}
    for line in whole(lines, 6):
        ip = line.split()[0]
        found = re.search(r"\b\d[\d,]* transactions?\b.*$", line)
        more = r" (p50 \d|DO \d|slot \d|PPO\d|telegram \d|lengths fit |PKW).*"
        counts = re.sub(more, "", found[0]).strip() if found else ""
        if ip == "and":
            continue
        if ip not in devices:
            yield f"{ip} was asked nothing"
            continue
        deals = [each for each in reading.deals if each.device == ip]
        for text in _tally(counts, deals, None):
            yield f"{ip}: {text}"


def _summary(lines: list[str], reading: Reading) -> Iterator[str]:
    for text in whole(lines, 6):
        if text.startswith("latency"):
            yield from _latency(text, reading)
            continue
        head, _, counts = text.partition(": ")
        number = re.match(r"(\d[\d,]*) (transaction|finding)", head)
        if number is None:
            continue
        if number[2] == "transaction":
            items = [each.state for each in reading.deals] + [
                each.operation for each in reading.deals
            ]
            length = len(reading.deals)
        else:
            items = [each.severity for each in reading.findings]
            length = len(reading.findings)
        if int(number[1].replace(",", "")) != length:
            yield f"{number[0]}: there are {length}"
        told = {name.lower(): int(n) for n, name in re.findall(r"(\d+) ([A-Za-z]+)", counts)}
        if told != dict(Counter(items)):
            yield f"{counts}: {dict(Counter(items))}"


def _latency(text: str, reading: Reading) -> Iterator[str]:
    times = sorted(
        each.duration_ms for each in reading.deals
        if each.duration_ms is not None and each.duration_ms >= 0
    )  # fmt: skip
    if "unknown" in text:
        if times:
            yield f"{text!r}, but there are {len(times)} times"
        return
    true = {
        "p50": rank(times, 50),
        "p95": rank(times, 95),
        "p99": rank(times, 99),
        "max": times[-1] if times else None,
    }
    for name, told in re.findall(r"(p50|p95|p99|max) ([\d.,]+ (?:ms|s|min|us))", text):
        if not near(told, true[name]):
            yield f"{name} {told} is {true[name]} ms"


def rank(times: list[float], percent: int) -> float | None:
    """The nearest rank: the least time that so many percent of all are not above."""
    for each in times:
        if sum(1 for other in times if other <= each) * 100 >= percent * len(times):
            return each
    return None


def near(told: str, ms: float | None) -> bool:
    """Whether a time in words is a time in ms, as far as its digits go."""
    found = re.fullmatch(r"(-?[\d.,]+) (ms|s|min|us|µs)", told.strip())
    if found is None or ms is None:
        return False
    digits = found[1].replace(",", "")
    unit = {"ms": 1.0, "s": 1000.0, "min": 60_000.0, "us": 0.001, "µs": 0.001}[found[2]]
    decimals = len(digits.partition(".")[2])
    return abs(float(digits) * unit - ms) <= 0.5001 * 10**-decimals * unit


def _blind(lines: list[str], reading: Reading) -> Iterator[str]:
    text = " ".join(each.strip() for each in lines)
    unseen = sum(each.state in OPEN and not each.cyclic for each in reading.deals)
    found = re.search(r"drive did with ([\d,]+)", text)
    if int(found[1].replace(",", "") if found else 0) != unseen and lines:
        yield f"{found[0] if found else 'nothing'}: {unseen} are open"
    orphans = [each for each in reading.deals if each.write is None]
    alone = [each for each in orphans if _without_ar(each, reading)]
    for form, true in (
        (r"Which requests? ([\d,]+) responses? belongs? to", len(orphans) - len(alone)),
        (r"Which requests? ([\d,]+) responses? read without an AR", len(alone)),
    ):  # fmt: skip
        found = re.search(form, text)
        if int(found[1].replace(",", "") if found else 0) != true and lines:
            yield f"{found[0] if found else 'nothing'}: {true} have no request"
    found = re.search(r"(\d+) other record requests?", text)
    ours = {each.index for each in reading.deals} | {0xB02E, 0xB02F}
    ours |= {47} if any(each.rule == "DS209" for each in reading.findings) else set()
    others = sum(
        1 for each in reading.capture.records if each.index not in ours and each.asked and not each.nested
    )  # fmt: skip
    if found and int(found[1]) != others:
        yield f"{found[0]}: there are {others}"
    taken = any(
        each.operation == "change" and each.state in ("ok", "partial", *OPEN)
        for each in reading.deals
    )  # fmt: skip
    if "still in force" in text and not taken:
        yield "speaks of accepted changes: there is none"


def _without_ar(deal: Deal, reading: Reading) -> bool:
    """Whether a response was read with a ReadImplicit."""
    reads = [each for each in reading.answered_at.get(deal.read or 0, []) if not each.write]
    return bool(reads) and all(each.implicit for each in reads)


# What to do


@dataclass
class Headline:
    """One entry of "What to do"."""

    rule: str
    severity: str
    text: str
    times: int = 1
    wide: int = 1
    """In so many frames."""
    number: str = ""
    """How this stands behind its words."""
    filters: list[str] = field(default_factory=list)
    frame: int | None = None
    job: int | None = None
    answering: list[int] = field(default_factory=list)
    more: int = 0
    time: str = ""
    """When its frame was."""
    device: str | None = None
    """The device in front of its words."""
    state: str = ""
    """What is said of the status word of the drive."""


def headlines(lines: list[str]) -> list[Headline]:
    """The entries of "What to do", lines put together again."""
    found: list[Headline] = []
    part = ""
    for line in lines:
        text = line.strip()
        start = _HEAD.match(text) if line.startswith("  DS") else None
        if start:
            found.append(Headline(start[1], start[2], start[4]))
            part = "text"
            continue
        if not line.startswith("    ") or not found:
            part = ""
            continue
        item = found[-1]
        look = _LOOK.match(text)
        if text.startswith(_STATE):
            item.state, part = text, "state"
            continue
        if part and not look and not _PARTS.match(text):
            setattr(item, part, f"{getattr(item, part)} {text}")
            continue
        part = ""
        if look:
            item.frame, item.job = int(look[1]), int(look[2]) if look[2] else None
            item.time = look[3] or ""
            more = _MORE.match(look[4])
            item.filters.append(more[1] if more else look[4])
            item.more += int(more[2]) if more else 0
        elif text.startswith("these respond"):
            item.answering = [int(each) for each in re.findall(r"\d+", text)]
    for item in found:
        times = _TIMES.search(item.text)
        if times:
            item.times = int(times[1].replace(",", ""))
            item.wide = int((times[2] or times[1]).replace(",", ""))
            item.text, item.number = item.text[: times.start()], times[0]
    return found


def _timed(item: Headline, reading: Reading) -> Iterator[str]:
    """The time behind "look at" is that of the frame; it may lack where no finding stands on that frame."""
    stands = any(each.frame == item.frame for each in reading.findings)
    if (item.time or stands) and item.time != _of_frame(item.frame or 0, reading):
        yield f"frame {item.frame} was not at {item.time}"


def headline(item: Headline, reading: Reading) -> Iterator[str]:
    try:
        frames = set().union(*map(shown, item.filters))
    except ValueError as problem:
        yield str(problem)
        return
    if len(frames) + item.more != item.wide and item.times > 1:
        yield f"{item.wide} frames, the filter shows {len(frames)}: {item.text[:90]}"
    if item.frame is not None and item.frame not in frames:
        yield f"frame {item.frame} is not among those of its filter"
    group = [each for each in reading.findings if each.rule == item.rule and _in(each, frames)]
    yield from _device(item, group, reading)
    if not group:
        yield f"no finding {item.rule} is in the frames {sorted(frames)}"
        return
    mine = [each for each in group if _says(item, each)]
    if not mine:
        yield f"says of none of its frames what is so: {item.text[:120]}"
        return
    yield from _frames(item, frames, group, mine)
    if not item.more and len(mine) < item.times:
        yield f"{item.times} times, and {len(mine)} findings are so: {item.text[:90]}"
    if item.job is not None and item.job not in {each.transaction for each in mine}:
        yield f"#{item.job} has no such finding"
    yield from _timed(item, reading)
    yield from _state(item, mine, reading)
    yield from _answering(item, reading)


def _frames(
    item: Headline, frames: set[int], group: list[Finding], mine: list[Finding]
) -> Iterator[str]:
    """Whether the filter shows the frames in which it is so, and no others."""
    there = set().union(*map(counted, mine))
    if there - frames and not item.more:
        yield f"its filter leaves out frame {min(there - frames)}"
    false = frames - there
    if false:
        first = next((each.message for each in group if each.frame in false), "")
        yield f"its words are not so in frame {min(false)} ({item.times} times): {first}"


def _state(item: Headline, mine: list[Finding], reading: Reading) -> Iterator[str]:
    """What the status word says has to be said of the first of its transactions of which anything is."""
    said = [(each.transaction, each.message) for each in reading.findings if each.rule in _OF_STATE]
    of = {each.transaction for each in mine}
    first = next((f"{_STATE}{job}): {message}" for job, message in said if job in of), "")
    if item.state != first and (item.state or not item.more):
        yield f"says {item.state!r} of the status word, where the findings say {first!r}"


def _device(item: Headline, group: list[Finding], reading: Reading) -> Iterator[str]:
    """Takes the device from the front of the words; all its findings must be of this device, in a capture of several."""
    named = _DEVICE.match(item.text)
    if named is None or any(item.text in each.message for each in group):
        return
    item.text = item.text.removeprefix(named[0])
    stations = {each.device for each in reading.deals}
    stations |= {
        f"dp{each['address']}" for each in (reading.plain.get("bus") or {}).get("stations", ())
    }
    for each in reading.plain.get("connections") or ():
        stations |= {each["client"], each["server"]}
    if len(stations) < 2:
        yield f"names {named[1]}, and there is no other"
    of = {each.frame: about(each, reading) for each in group}
    others = [frame for frame, device in of.items() if device not in (None, named[1])]
    item.device = named[1]
    if others:
        yield f"frame {others[0]} is not about {named[1]}, but about {of[others[0]]}"


def about(finding: Finding, reading: Reading) -> str | None:
    """The device that a finding is about."""
    deal = reading.deal(finding)
    return deal.device if deal else finding.args.get("device")


def _says(item: Headline, finding: Finding) -> bool:
    """Whether a headline is true of a finding: its own sentence, or that of several cases."""
    own = re.sub(r"^offset \d+: ", "", finding.message)
    if item.text in (own, finding.message):
        return True
    if item.times == 1:
        return False
    device, title = str(finding.args.get("device")), RULES[item.rule]["title"]
    if item.text == title or re.fullmatch(
        rf"{re.escape(device)}(?: slot \d+)?: {title}", item.text
    ):
        return True
    if not list(problems(item.rule, item.text, finding.args)):
        return True
    return has_many(item.rule) and not list(problems(item.rule, item.text, finding.args, many=True))


def _rests(lines: list[str], items: list[Headline], reading: Reading) -> Iterator[str]:
    """Of the diagnoses, whether those told one by one and those that are only counted are all there are."""
    told: Counter[str] = Counter()
    for item in items:
        told[item.rule] += item.times
    for line in lines:
        rest = _REST.match(line)
        if rest:
            told[rest[1]] += int(rest[3].replace(",", ""))
    true = Counter(each.rule for each in reading.findings)
    for rule, number in told.items():
        if rule.startswith("DS7") and number != true[rule]:
            yield f"{rule} is told {number} times, and found {true[rule]} times"


def _in(finding: Finding, frames: set[int]) -> bool:
    return finding.frame in frames


def counted(finding: Finding) -> set[int]:
    """The frames in which it happened, of a rule that counts."""
    return {finding.frame, *finding.args.get("frames", ())}


def _answering(item: Headline, reading: Reading) -> Iterator[str]:
    """Drive objects that are said to answer: each must have, and none of them said that it does not exist."""
    told = [
        each for each in reading.findings if each.rule == item.rule and item.text in each.message
    ]
    missing = answered_wrongly(reading, told[0].args.get("device") if told else None)
    for axis in item.answering:
        if axis in missing:
            yield f"DO {axis} is said to answer, and does not exist"


def answered_wrongly(reading: Reading, device: str | None) -> set[int]:
    """The drive objects of which the report says that they do not exist: of one device, or of any."""
    return {
        each.args["axis"] for each in reading.findings
        if each.rule == "DS709" and "axis" in each.args and device in (None, each.args.get("device"))
    }  # fmt: skip


# Transactions


def _lines(lines: list[str], reading: Reading) -> Iterator[Complaint]:
    blocks: dict[int, list[str]] = {}
    number = 0
    for line in lines:
        start = re.match(r"#(\d+) ", line)
        if start:
            number = int(start[1])
        blocks.setdefault(number, []).append(line)
    unlisted = {each.id for each in reading.deals if each.s7 and each.state == "ok"}
    unlisted -= {each.transaction for each in reading.findings}
    if set(blocks) - {0} | unlisted != set(reading.by_id) | unlisted:
        yield Complaint("lines", "", "not every transaction has a line")
    for number, block in blocks.items():
        deal = reading.by_id.get(number)
        for text in _line(block, deal, reading) if deal else ():
            yield Complaint("line", f"#{number}", text)


_TAIL = re.compile(
    r"\s(\d+) frames?((?: -?[\d.,]+ (?:ms|s|min))?)((?:, (?:(?:polled|read again) \d+ times?|[\d,]+ cycles?))*)$"
)
_BROKEN = 3
"""Further lines that a line of a transaction may have before its parameters."""


def _line(block: list[str], deal: Deal, reading: Reading) -> Iterator[str]:
    joined = [" ".join(map(str.strip, block[: n + 1])) for n in range(min(len(block), _BROKEN))]
    first = next((each for each in reversed(joined) if _TAIL.search(each)), block[0])
    tail = _TAIL.search(first)
    if tail is None:
        yield f"has no end: {first!r}"
        return
    if int(tail[1]) != len(deal.all_frames):
        yield f"{tail[1]} frames are {len(deal.all_frames)}"
    if tail[2] and not near(tail[2], deal.duration_ms):
        yield f"{tail[2]} is {deal.duration_ms} ms"
    if not tail[2] and deal.duration_ms is not None:
        yield "does not say how long it took"
    for word, pairs in (("polled", deal.polls), ("read again", deal.rereads)):
        told = re.search(rf"{word} (\d+)", tail[3])
        if int(told[1] if told else 0) != len(pairs):
            yield f"{told[0] if told else 'nothing'}: {word} {len(pairs)} times"
    yield from _front(first.split(), deal, reading)
    if (deal.state == "ok") is bool(re.search(rf"\[{deal.state}\b.*?\]\s+\d+ frame", first)):
        yield f"does not say its state {deal.state}"
    if deal.device not in first:
        yield f"does not name {deal.device}"
    yield from _parameters(block, deal)
    yield from _plc(block, deal, reading)


def _front(words: list[str], deal: Deal, reading: Reading) -> Iterator[str]:
    """Number, time of day, seconds since the first frame, first frame, operation."""
    front = [f"#{deal.id}", *clock(deal, reading).split(), str(min(deal.all_frames, default=0))]
    if dated(reading):
        front.insert(-1, since(deal, reading))
    else:
        front.remove("s")
    if words[: len(front)] != front:
        yield f"begins with {words[: len(front)]}, not with {front}"
    if words[len(front)].lower() != deal.operation:
        yield f"does not say that it is a {deal.operation}"


def _plc(block: list[str], deal: Deal, reading: Reading) -> Iterator[str]:
    for line in whole(block[1:], 10):
        if line.startswith("PLC: "):
            for text in plc.check(line.removeprefix("PLC: "), deal, reading):
                yield f"PLC: {text}"


def _parameters(block: list[str], deal: Deal) -> Iterator[str]:
    text = " ; ".join(line for line in block if not line.strip().startswith("PLC: "))
    told = [(each[0], each[1]) for each in _PNU.findall(re.sub(r"p09\d\d(?!\[)|\".*?\"", "", text))]
    for each in deal.parameters:
        if each["pnu"] is None:
            continue
        if (str(each["pnu"]), str(each["subindex"])) not in told:
            yield f"does not name p{each['pnu']}[{each['subindex']}]"


# Findings


def _groups(lines: list[str], reading: Reading) -> Iterator[Complaint]:
    found: dict[tuple[str, str], list[str]] = {}
    kind = ("", "")
    for line in lines:
        head = re.match(r"  (DS\d{3}) (\w+) \S+: ([\d,]+) findings?$", line)
        if head:
            kind = head[1], head[2]
            count = sum((each.rule, each.severity) == kind for each in reading.findings)
            if count != int(head[3].replace(",", "")):
                yield Complaint("findings", head[1], f"{head[3]} findings are {count}")
        found.setdefault(kind, []).append(line)
    if set(found) - {("", "")} != {(each.rule, each.severity) for each in reading.findings}:
        yield Complaint("findings", "", "not every rule has its group")
    for (rule, severity), group in found.items():
        findings = [
            each for each in reading.findings if (each.rule, each.severity) == (rule, severity)
        ]
        for text in _group(findings, group, reading) if rule else ():
            yield Complaint("findings", rule, text)


def _of_frame(number: int, reading: Reading) -> str | None:
    """When a frame was, as the text says it."""
    frame = reading.capture.frame(number)
    if frame is None:
        return None
    if not dated(reading):
        return f"{seconds(frame.time_ns, reading)} s"
    whole_, rest = divmod(frame.time_ns, 10**9)
    when = datetime.fromtimestamp(whole_, UTC)
    return moment(f"{when:%Y-%m-%dT%H:%M:%S}.{rest:09}Z", reading)


def _unbroken(lines: list[str]) -> list[str]:
    """Lines that were broken, put together again: what goes on is indented by four columns more."""
    found: list[str] = []
    for line in lines:
        deep = len(line) - len(line.lstrip())
        if found and deep and deep == len(found[-1]) - len(found[-1].lstrip()) + 4:
            found[-1] += " " + line.strip()
        else:
            found.append(line)
    return found


def whole(lines: list[str], deep: int = 8) -> list[str]:
    """Lines that were broken, put together again: what stands deeper than the first of them goes on."""
    found: list[str] = []
    for line in lines:
        if line.startswith(" " * deep) and found:
            found[-1] += " " + line.strip()
        else:
            found.append(line.strip())
    return found


def _group(findings: list[Finding], lines: list[str], reading: Reading) -> Iterator[str]:
    frames, more = set[int](), 0
    for text in whole(lines):
        told = re.match(r"frame (\d+)(?: #(\d+))?(?: ([\d.:+ s-]+?))?: (.*)$", text)
        if told and told[3] != _of_frame(int(told[1]), reading):
            yield f"frame {told[1]} was not at {told[3]}"
        if told and not any(
            each.frame == int(told[1]) and each.message == told[4]
            and each.transaction == (int(told[2]) if told[2] else None) for each in findings
        ):  # fmt: skip
            yield f"nothing says {text!r}"
        if text.startswith("frame.number"):
            rest = _MORE.match(text)
            frames |= shown(rest[1] if rest else text)
            more += int(rest[2]) if rest else 0
    true = set().union(*map(counted, findings))
    wide = true | {frame for each in findings for frame in each.frames}
    if not (true <= frames <= wide) and not (more and len(frames) + more in (len(true), len(wide))):
        yield f"the filter shows {sorted(frames ^ true)[:5]} too many or too few"
