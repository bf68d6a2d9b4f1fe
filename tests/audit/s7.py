"""What findings DS9xx claim, decided anew from the frames of S7 (`s7_wire`).

Whether data is of two moments is decided by trying all orders (`s7_moment`).
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

from tests.audit import s7_wire
from tests.audit.reading import Finding, Reading
from tests.audit.s7_moment import Happened, was_there
from tests.audit.s7_wire import Item, Job, Line, Part

ELEMENT = ("pnu", "subindex", "drive_object", "family")
"""What an element of a drive is."""
MOST = 60
"""Frames that a finding of many names."""
SECOND = 10**9
TABLE = Path(__file__).parents[2] / "python/ds47/spec/s7.toml"
Auditor = Callable[["Case"], Iterator[str]]
AUDITORS: dict[str, Auditor] = {}


class Case:
    """A finding and the connections of its capture."""

    def __init__(self, finding: Finding, lines: list[Line], block: int | None) -> None:
        self.finding, self.lines, self.block = finding, lines, block
        self.args: dict[str, Any] = finding.args
        self.frame = finding.frame

    def wrong(self, **truth: Any) -> Iterator[str]:
        """A complaint for each argument that is not the truth."""
        for name, value in truth.items():
            if self.args.get(name, "missing") != value:
                yield f"{name} {self.args.get(name)!r} is {value!r}"

    def ends(self, line: Line, by_client: bool) -> Iterator[str]:
        """Who asks, and who should answer."""
        both = line.client[0], line.server[0]
        yield from self.wrong(controller=both[not by_client], device=both[by_client])

    def servers(self, line: Line) -> list[Line]:
        """All connections of the server of one."""
        return [each for each in self.lines if each.server == line.server]

    def jobs(self) -> Iterator[Job]:
        for line in self.lines:
            yield from line.jobs

    def asked(self) -> list[Job]:
        return [each for each in self.jobs() if each.asked.number == self.frame]

    def answered(self) -> list[Job]:
        """Those that are answered in the frame of the finding, without their job too."""
        every = [*self.jobs(), *(each for line in self.lines for each in line.orphans)]
        return [each for each in every if each.answered and each.answered.number == self.frame]


def auditor(rule: str) -> Callable[[Auditor], Auditor]:
    def enter(function: Auditor) -> Auditor:
        AUDITORS[rule] = function
        return function

    return enter


def of(finding: Finding, reading: Reading, block: int | None = None) -> Iterator[str]:
    """What is not so of a finding; `block` is what the user chose."""
    lines = reading.__dict__.get("s7")
    if lines is None:
        lines = reading.__dict__["s7"] = s7_wire.read(reading.capture.frames)
    yield from AUDITORS[finding.rule](Case(finding, lines, block))


def _best(case: Case, found: list[Iterator[str]]) -> Iterator[str]:
    """The complaints about the thing that the finding means: the one with the fewest."""
    told = [list(each) for each in found]
    yield from min(told, key=len) if told else ["nothing of the kind is in the capture"]


def _many(case: Case, frames: list[list[int]], count: int | None = None) -> Iterator[str]:
    """How often, and in which frames first: those of each time stand together."""
    kept: list[int] = []
    for some in frames:
        kept += [each for each in some if each not in kept][: MOST - len(kept)]
    yield from case.wrong(count=len(frames) if count is None else count, frames=sorted(kept))


def missing(args: dict[str, Any], reading: Reading) -> Iterator[str]:
    """What is not so of DS725 about S7: the capture lacks all that one end sent, or a part."""
    if args["what"] == "s7_cut":
        yield from _cut(args, reading)
        return
    count = 0
    states = {"s7_begins": "orphan", "s7_ends": "incomplete"}
    if args["what"] in states:
        pair = {args["controller"], args["device"]}
        count = sum(
            each["channel"] == "s7" and each["state"] == states[args["what"]]
            and {each["controller"], each["device"]} == pair
            for each in reading.plain["transactions"]
        )  # fmt: skip
    for client, server, both in s7_wire.ways(reading.capture.frames):
        silent = next((up for up in (True, False) if both[up].silent), None)
        told = {True: "s7_client_missing", False: "s7_server_missing"}.get(silent or False)
        if silent is None:
            told = "s7_bytes_missing" if both[True].lacks or both[False].lacks else None
        ends = client[0], server[0], told
        count += ends == tuple(args[name] for name in ("controller", "device", "what"))
    if count < args["count"]:  # of another one nobody knows that it is S7
        yield f"{count} connections or jobs are so, not {args['count']}"


def _cut(args: dict[str, Any], reading: Reading) -> Iterator[str]:
    """How many frames of two ends the capture cut, and to how many bytes."""
    pair = {args["controller"], args["device"]}
    cut = [
        len(frame.data) for frame in reading.capture.frames
        if frame.cut and s7_wire.ends(frame) == pair
    ]  # fmt: skip
    if (len(cut) < args["count"]) or not cut:  # of another connection nobody knows that it is S7
        yield f"{len(cut)} frames are cut, not {args['count']}"
    elif args["bytes"] < max(cut):
        yield f"bytes {args['bytes']} is {max(cut)}"


# Jobs


@auditor("DS901")
def _unanswered(case: Case) -> Iterator[str]:
    def each(job: Job) -> Iterator[str]:
        yield from case.ends(job.line, job.by_client)
        yield from case.wrong(operation=job.name, area=job.area)
        if job.answered:
            yield f"it is answered in frame {job.answered.number}"

    yield from _best(case, [each(job) for job in case.asked()])


@auditor("DS908")
def _item(case: Case) -> Iterator[str]:
    def each(job: Job) -> Iterator[str]:
        failed = [i for i in job.items if i.code == case.args.get("code") and i.code != 0xFF]
        yield from case.ends(job.line, job.by_client)
        yield from case.wrong(operation=job.name, area=s7_wire.listed(failed))
        if any(case.args.get(name) is not None for name in ELEMENT):
            yield from _seems_a_drive(case, job, failed)

    yield from _best(case, [each(job) for job in case.answered()])


@auditor("DS919")
def _element(case: Case) -> Iterator[str]:
    """An address of a drive is 1024 x drive object + index, its data block the parameter."""
    drive_object, subindex = case.args.get("drive_object"), case.args.get("subindex")
    if drive_object is None or subindex is None or not 0 <= subindex < 1024:
        yield f"no address stands for {subindex} of drive object {drive_object}"
        return
    place = 1024 * drive_object + subindex

    def each(job: Job) -> Iterator[str]:
        yield from case.ends(job.line, job.by_client)
        yield from case.wrong(operation=job.name, family="sinamics")
        named = [
            i for i in job.items
            if (i.db, i.start, i.code) == (case.args.get("pnu"), 8 * place, case.args.get("code"))
        ]  # fmt: skip
        if not named or named[0].code == 0xFF:
            yield "no such item is refused"
            return
        yield from case.wrong(bytes=named[0].size)
        lines = case.servers(job.line)
        if not _shares_nothing(lines) and not any(map(_says_drive, lines)):
            yield "nothing shows a drive"

    yield from _best(case, [each(job) for job in case.answered()])


def _seems_a_drive(case: Case, job: Job, failed: list[Item]) -> Iterator[str]:
    """Slot 0, nothing was read or written up to then but single elements, and it is one that is refused."""
    if len(failed) != 1:
        yield "it is not one item that is refused"
        return
    lines = case.servers(job.line)
    number, index = divmod(failed[0].start // 8, 1024)
    yield from case.wrong(pnu=failed[0].db, subindex=index, drive_object=number, family="sinamics")
    if job.line.tsap is None or job.line.tsap[-1] & 31:
        yield "its slot is not 0"
    end = job.answered.number if job.answered else 0
    done = [
        i for each in _in_order(lines) if each.answered and each.answered.number <= end
        for i in each.items if i.code == 0xFF
    ]  # fmt: skip
    if not done or any(i.area != 0x84 or i.size not in (1, 2, 4) for i in done):
        yield "something else than an element is read or written"


def _in_order(lines: list[Line]) -> list[Job]:
    every = [job for line in lines for job in line.jobs if job.answered]
    return sorted(every, key=lambda job: job.answered.number if job.answered else 0)


def _says_drive(line: Line) -> bool:
    return any(isinstance(each, str) and each.startswith("6SL3") for _, each in line.said)


def _shares_nothing(lines: list[Line]) -> bool:
    """Whether a value is read back although one that lies on it was written since, of one server."""
    written: dict[tuple[int, int], tuple[bytes, bool]] = {}
    for job in _in_order(lines):
        for item in job.items:
            key, data = (item.db, item.start // 8), item.data or b""
            if item.code != 0xFF or item.area != 0x84:
                continue
            if job.name == "GET" and written.get(key) == (data, True):
                return True
            if job.name == "PUT":
                for (db, start), (known, _) in written.items():
                    if db == key[0] and 0 < abs(start - key[1]) < 4:
                        written[db, start] = known, True
                written[key] = data, False
    return False


@auditor("DS918")
def _no_result(case: Case) -> Iterator[str]:
    def each(job: Job) -> Iterator[str]:
        silent = [i for i in job.items if i.code is None]
        yield from case.ends(job.line, job.by_client)
        yield from case.wrong(operation=job.name, area=s7_wire.listed(silent))
        yield from case.wrong(count=len(silent), of=len(job.items))
        if job.error or not silent:
            yield "every item has a result"

    yield from _best(case, [each(job) for job in case.answered()])


@auditor("DS909")
def _refused(case: Case) -> Iterator[str]:
    def each(job: Job) -> Iterator[str]:
        yield from case.ends(job.line, job.by_client)
        yield from case.wrong(operation=job.name, area=job.area, code=job.error, **_sums(job))

    yield from _best(case, [each(job) for job in case.answered() if job.error])


def _sums(job: Job) -> dict[str, Any]:
    """Of a job that is too long: what it needs, and how much of it one PDU holds."""
    found = dict.fromkeys(("sum", "needs", "agreed", "room", "jobs"), None)
    agreed, sizes, heads = job.line.length, [each.size for each in job.items], (14, 4)
    if job.write:
        heads = (12, 16)
    lengths = [
        heads[0]
        + heads[1] * count
        + sum(size + size % 2 for size in sizes[: count - 1])
        + sizes[count - 1]
        for count in range(1, len(sizes) + 1)
    ]
    if job.error != 0x8500 or agreed is None or not lengths or lengths[-1] <= agreed:
        return found
    way, one = "put" if job.write else "get", agreed - sum(heads)
    found |= {"needs": lengths[-1], "agreed": agreed}
    if len(sizes) == 1:
        return found | {"sum": f"{way}_bytes", "room": one, "jobs": -(-sizes[0] // one)}
    return found | {
        "sum": f"{way}_items",
        "room": len([each for each in lengths if each <= agreed]),
    }


@auditor("DS906")
def _several(case: Case) -> Iterator[str]:
    def each(line: Line, by_client: bool) -> Iterator[str]:
        jobs = [j for j in line.jobs if j.by_client is by_client and j.good and len(j.items) > 1]
        yield from case.ends(line, by_client)
        yield from _many(case, [[job.asked.number] for job in jobs])
        if case.frame not in {job.asked.number for job in jobs}:
            yield "no such job is in this frame"

    yield from _best(case, [each(line, way) for line in case.lines for way in (True, False)])


@auditor("DS903")
def _block(case: Case) -> Iterator[str]:
    def each(line: Line, by_client: bool, text: str) -> Iterator[str]:
        jobs = [
            (job, item)
            for job in line.jobs
            for item in job.items
            if job.by_client is by_client and item.text() == text and item.code == 0xFF
            and job.name == case.args.get("operation") and _said(case, line, job) == told
        ]  # fmt: skip
        yield from case.ends(line, by_client)
        yield from _many(case, [_frames(job) for job, _ in jobs])
        for job, item in jobs[:1]:
            yield from case.wrong(bytes=item.size)
            if job.asked.number != case.frame:
                yield f"the first one is in frame {job.asked.number}"
            if item.size <= told[0]:
                yield "it is not larger than the block"
        if not jobs:
            yield "there is no such area, or nobody says that of the block"

    names = ("block", "case", "frame", "name")
    told: Any = tuple(case.args.get(name) for name in names)
    if not isinstance(told[0], int):
        yield "the block is no number"
        return
    text = str(case.args.get("area"))
    yield from _best(case, [each(line, way, text) for line in case.lines for way in (True, False)])


def _said(case: Case, line: Line, job: Job) -> tuple[int | None, str, int | None, str | None]:
    """How large a block is at the time of a job, who says so, where, and with which name."""
    if case.block is not None:
        return case.block, "block_chosen", None, None
    before = [
        (frame, value)
        for other in case.lines if other.server[0] == line.server[0]
        for frame, value in other.said if job.answered and frame < job.answered.number
    ]  # fmt: skip
    found: tuple[int | None, str, int | None, str | None] = (None, "", None, None)
    for frame, value in sorted(before, key=lambda each: each[0]):
        size = value if isinstance(value, int) else _size(value)
        if size > (found[0] or 0):
            found = (
                (size, "block_said", frame, None)
                if isinstance(value, int)
                else (size, "block_order", frame, value)
            )
    return found


def _size(order: str) -> int:
    """The block of the CPU with an order number, 0 where it is not known."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    blocks = {row["id"]: row["block"] for row in table["cpu"]}
    for row in table["order"]:
        if re.match(row["number"].replace("?", "."), order):
            return int(blocks[row["cpu"]])
    return 0


def _frames(job: Job) -> list[int]:
    return [each.number for each in (job.asked, job.answered) if each]


# Areas in parts


def _room(job: Job) -> int:
    length = job.line.length
    if length is None:
        return 1 << 30
    return length - (12 + 16 * len(job.items) if job.write else 14 + 4 * len(job.items))


def _full(job: Job) -> bool:
    return 10 * sum(each.size for each in job.items) >= 9 * _room(job)


def _follows(before: Job, job: Job, more: bool) -> bool:
    last, first = before.items[-1], job.items[0]
    since = before.answered or before.asked
    return (
        before.write is job.write and (last.area, last.db, last.end) == (first.area, first.db, first.start)
        and job.asked.time_ns - since.time_ns <= SECOND and not (more and len(before.items) > 1)
    )  # fmt: skip


def _even(parts: list[Job]) -> bool:
    """Pieces of one length, the last one perhaps shorter, none a single variable; each behind the answer before."""
    sizes = [each.size for job in parts for each in job.items]
    behind = all(a.answered and a.answered.number < b.asked.number for a, b in pairwise(parts))
    alike = len(set(sizes[:-1])) == 1 and 0 < sizes[-1] <= sizes[0] and sizes[0] > 8
    return len(parts) == len(sizes) and alike and behind


def _halves(one: Job, two: Job) -> bool:
    """Two halves of an area, both asked for before one of them is there."""
    if len(one.items) != 1 or len(two.items) != 1 or one.write is not two.write:
        return False
    a, b = one.items[0], two.items[0]
    beside = (a.area, a.db) == (b.area, b.db) and (a.end == b.start or b.end == a.start)
    waits = one.answered is not None and one.answered.number > two.asked.number
    return beside and waits and abs(a.size - b.size) <= 1 and min(a.size, b.size) > 8


def areas(line: Line, by_client: bool) -> Iterator[list[Job]]:
    """Areas that were split: their jobs."""
    parts: list[Job] = []
    closed = False
    for job in [each for each in line.jobs if each.by_client is by_client and each.items]:
        more = bool(parts) and not closed and _follows(parts[-1], job, len(parts) > 1)
        if more and (_full(parts[-1]) or _even([*parts, job])):
            parts.append(job)
            closed = not _full(job) and all(map(_full, parts[:-1]))
        elif len(parts) == 1 and _halves(parts[0], job):
            parts, closed = sorted((*parts, job), key=lambda each: each.items[0].start), True
        else:
            yield from _in_parts(parts)
            parts, closed = [job], False
    yield from _in_parts(parts)


def _in_parts(parts: list[Job]) -> Iterator[list[Job]]:
    if len(parts) < 2 or not all(each.good for each in parts):
        return
    if all(map(_full, parts[:-1])) or (len(parts) > 2 and _even(parts)) or _halves(parts[0], parts[1]) \
            or _halves(parts[1], parts[0]):  # fmt: skip
        yield parts


def _area(parts: list[Job]) -> str:
    items = [parts[0].items[-1], *(each.items[0] for each in parts[1:])]
    return Item(
        items[0].area, items[0].db, items[0].start, 2, sum(each.size for each in items)
    ).text()


@auditor("DS904")
def _split(case: Case) -> Iterator[str]:
    def each(line: Line, by_client: bool) -> Iterator[str]:
        found = [
            parts for parts in areas(line, by_client)
            if _area(parts) == case.args.get("area") and parts[0].name == case.args.get("operation")
        ]  # fmt: skip
        if not found:
            yield "no area in parts is like that"
            return
        yield from case.ends(line, by_client)
        yield from case.wrong(jobs=len(found[0]))
        yield from _many(case, [[f for job in parts for f in _frames(job)] for parts in found])
        if case.frame != found[0][0].asked.number:
            yield f"the first one begins in frame {found[0][0].asked.number}"

    yield from _best(case, [each(line, way) for line in case.lines for way in (True, False)])


# Moments


def _values(job: Job, place: str) -> dict[int, int]:
    """The bytes of one memory that a job reads or writes; `place` is what stands in front of the address."""
    found: dict[int, int] = {}
    for item in job.items:
        front = Item(item.area, item.db, 0, 2, 2).text().partition("B0..")[0]
        done = item.code == 0xFF or (job.write and item.code is None)
        if front == place and item.data is not None and done:
            start = item.start // 8
            if item.kind == 1:
                return {}
            found |= dict(enumerate(item.data, start))
    return found


@auditor("DS905")
def _moments(case: Case) -> Iterator[str]:
    place, names = _bytes(case)
    jobs = sorted(case.jobs(), key=lambda each: each.asked.number)
    frames = set(case.args.get("frames") or ())
    named = [each for each in jobs if set(_frames(each)) <= frames]
    reads = [each for each in named if not each.write and _values(each, place)]
    puts = [each for each in named if each.write]
    if not reads or len(names) != 2:
        yield "no reads are in these frames"
        return
    read: dict[int, int] = {}
    for job in reads:
        read |= {at: value for at, value in _values(job, place).items() if at in names}
        yield from case.ends(job.line, job.by_client)
    yield from case.wrong(jobs=len(reads))
    if [read.get(at) for at in names] != [case.args.get(f"{n}_value") for n in ("first", "second")]:
        yield f"the two bytes were read as {read}"
        return
    writes = [each for each in puts if each.asked.number == case.args.get("write")]
    written = puts if case.args.get("case") == "mixed_put" else writes
    if not writes or not {at for each in written for at in _values(each, place)} & set(names):
        yield "the write does not write one of the two bytes"
    whole = puts if case.args.get("case") == "mixed_put" else []
    if case.args.get("case") != (
        "mixed_put" if whole else "mixed_split" if len(reads) > 1 else "mixed_job"
    ):
        yield "the case is another one"
    if {f for job in (*reads, *puts) for f in _frames(job)} != frames or case.frame not in frames:
        yield "the frames are others"
    if not whole and len(puts) != 1:
        yield "there are several writes"
    last = max(job.answered.number for job in reads if job.answered)
    if case.frame != last:
        yield f"the last part was read in frame {last}"
    yield from _together(case, jobs, reads, whole, place, read)


def _bytes(case: Case) -> tuple[str, list[int]]:
    found = [str(case.args.get(name)).rpartition("B") for name in ("first", "second")]
    if found[0][0] != found[1][0] or not all(each[2].isdigit() for each in found):
        return "", []
    return found[0][0], [int(each[2]) for each in found]


def _together(
    case: Case,
    jobs: list[Job],
    reads: list[Job],
    whole: list[Job],
    place: str,
    read: dict[int, int],
) -> Iterator[str]:
    begin = min(each.asked.time_ns for each in reads)
    end = max(each.answered.time_ns for each in reads if each.answered)
    server = reads[0].line.server
    happened: list[Happened] = []
    before: dict[int, int] = {}
    merged: dict[int, int | None] = {}
    for job in sorted(jobs, key=lambda each: each.answered.number if each.answered else 1 << 40):
        values = {at: v for at, v in _values(job, place).items() if at in read}
        if job.line.server != server or not values or job in reads:
            continue
        last = None if job.answered is None else job.answered.time_ns
        if job in whole:
            merged |= values
        elif last is not None and last < begin:
            before |= values
        elif job.asked.time_ns <= end:
            happened.append(
                Happened(job.asked.time_ns, last, values, job.write, job.write and not job.good)
            )
    if merged:
        first, last = whole[0].asked.time_ns, max(j.answered.time_ns for j in whole if j.answered)
        happened.append(Happened(first, last, merged))
    if len(happened) > 6:
        yield f"{len(happened)} accesses are too many to try all orders"
    elif was_there(read, begin, end, happened, before):
        yield "there is a moment at which both were there"


@auditor("DS907")
def _writers(case: Case) -> Iterator[str]:
    names = {case.args.get("controller"), case.args.get("other")}
    place, _, at = str(case.args.get("byte")).rpartition("B")
    writes = [
        job for job in sorted(case.jobs(), key=lambda each: each.answered.number if each.answered else 0)
        if job.write and job.answered and job.line.server[0] == case.args.get("device")
        and job.line.client[0] in names
    ]  # fmt: skip
    found = []
    named = set(case.args.get("frames") or ())
    for n, job in enumerate(writes):
        differing = []
        for other in writes[:n]:
            mine, theirs = _values(job, place), _values(other, place)
            differ = [b for b in mine.keys() & theirs.keys() if mine[b] != theirs[b]]
            near = other.answered and job.asked.time_ns - other.answered.time_ns <= SECOND
            if differ and near and job.line.client[0] != other.line.client[0]:
                differing.append((job, other, min(differ)))
        if differing:  # the oldest may be forgotten: what else was said made the memory doubtful
            told = (each for each in differing if each[1].asked.number in named)
            found.append(next(told, differing[0]))
    if not found:
        yield "no two stations write other values to the same bytes"
        return
    yield from case.wrong(controller=min(map(str, names)), other=max(map(str, names)))
    if any(each.said for each in case.lines if each.server[0] == case.args.get("device")):
        # What is no job makes the memory doubtful: older writes do not count then.
        found = [each for each in found if {each[0].asked.number, each[1].asked.number} <= named]
    yield from _many(case, [[one.asked.number, two.asked.number] for one, two, _ in found])
    job, _, byte = found[0] if found else (writes[0], None, None)
    if not at.isdigit() or int(at) != byte or job.asked.number != case.frame:
        yield f"it is byte {byte} in frame {job.asked.number}"


@auditor("DS916")
def _readback(case: Case) -> Iterator[str]:
    place, _, at = str(case.args.get("byte")).rpartition("B")
    if not at.isdigit():
        yield "is no byte"
        return
    reads = [j for j in case.answered() if int(at) in _values(j, place) and not j.write]
    writes = [j for j in case.jobs() if j.write and j.good and int(at) in _values(j, place)]
    earlier = [w for w in writes if w.answered and w.answered.number < case.frame]
    if not reads or not earlier:
        yield "nothing was read, or nothing written"
        return
    last = max(earlier, key=lambda each: each.asked.number)
    yield from case.ends(reads[0].line, reads[0].by_client)
    yield from case.wrong(
        by=last.asked.number,
        written=_values(last, place)[int(at)],
        read=_values(reads[0], place)[int(at)],
    )
    if case.args.get("written") == case.args.get("read"):
        yield "both are equal"


# PDUs and connections


@auditor("DS902")
def _long(case: Case) -> Iterator[str]:
    def each(line: Line, by_client: bool) -> Iterator[str]:
        if line.length is None or line.setup is None:
            yield "there is no setup"
            return
        pdus = [
            (frame.number, size) for frame, client, size in line.pdus
            if client is by_client and size > line.length and frame.number > line.setup.number
        ]  # fmt: skip
        most = max((size for _, size in pdus), default=0)
        yield from case.wrong(
            device=line.server[0], sender=(line.client if by_client else line.server)[0],
            agreed=line.length, frame=line.setup.number, size=most,
        )  # fmt: skip
        yield from _many(case, [[frame] for frame, _ in pdus])
        if case.frame != next((frame for frame, size in pdus if size == most), None):
            yield "the longest one is in another frame"

    yield from _best(case, [each(line, way) for line in case.lines for way in (True, False)])


@auditor("DS914")
def _crowd(case: Case) -> Iterator[str]:
    def each(line: Line) -> Iterator[str]:
        most, frame = 0, 0
        for job in line.jobs:
            there = [
                j for j in line.jobs
                if j.by_client and j.asked.number <= job.asked.number
                and (j.answered is None or j.answered.number > job.asked.number)
            ]  # fmt: skip
            if len(there) > most and all(j.answered for j in there):
                most, frame = len(there), job.asked.number
        yield from case.ends(line, True)
        yield from case.wrong(most=most, agreed=line.parallel)
        if case.frame != frame:
            yield f"the most are open in frame {frame}"
        frames = case.args.get("frames") or []
        if case.args.get("count") != len(frames) or frame not in frames:
            yield "count is not that of the frames"
        if not set(frames) <= {job.asked.number for job in line.jobs}:
            yield "the frames are others"
        if line.parallel is None or most <= line.parallel:
            yield "so many were agreed"

    yield from _best(case, [each(line) for line in case.lines])


@auditor("DS915")
def _setup(case: Case) -> Iterator[str]:
    ends = case.args.get("controller"), case.args.get("device")
    found = [
        line for line in case.lines
        if line.length is None and line.jobs and (line.client[0], line.server[0]) == ends
    ]  # fmt: skip
    firsts = [[min(job.asked.number for job in line.jobs)] for line in found]
    if [case.frame] not in firsts:
        yield "no connection without a setup begins so"
    yield from _many(case, firsts)


@auditor("DS917")
def _connection(case: Case) -> Iterator[str]:
    def told(line: Line) -> tuple[str, int, int]:
        if line.refused:
            return "refused_setup", line.refused.number, line.refusal
        behind = "" if line.tsap is not None else "_tcp"
        if line.dr and not line.cc:
            return f"refused_disconnect{behind}", line.dr.number, line.reason
        if line.cr and not line.cc:
            why = "reset" if line.reset else "no_confirm"
            return f"refused_{why}{behind}", line.cr.number, 0
        return (f"refused_reset{behind}", line.reset.number, 0) if line.reset else ("", 0, 0)

    key = [case.args.get(name) for name in ("controller", "device", "case")]
    found = [
        line for line in case.lines
        if not line.jobs and [line.client[0], line.server[0], told(line)[0]] == key
        and (None if line.tsap is None else line.tsap.hex(".").upper()) == case.args.get("tsap")
    ]  # fmt: skip
    yield from _many(case, [[told(line)[1]] for line in found])
    if not found or case.frame != told(found[0])[1]:
        yield "no connection is refused in this frame"
        return
    tsap, code = found[0].tsap, told(found[0])[2]
    rack, slot = divmod(tsap[1], 32) if tsap and len(tsap) == 2 and tsap[0] else (None, None)
    yield from case.wrong(rack=rack, slot=slot, code=code)


# BSEND and USEND


def transfers(line: Line) -> Iterator[list[Part]]:
    """The BSEND of a connection, each by its segments: the first one has a sum."""
    by_id = sorted(line.parts, key=lambda each: (each.by_client, each.r_id, each.frame.number))
    for _, parts in groupby(by_id, key=lambda each: (each.by_client, each.r_id)):
        open_parts: list[Part] = []
        for part in parts:
            if part.total is not None and open_parts:
                yield open_parts
                open_parts = []
            open_parts.append(part)
        yield open_parts


def _transfers(case: Case, each: Callable[[Line, list[Part]], Iterator[str]]) -> Iterator[str]:
    def one(line: Line, parts: list[Part]) -> Iterator[str]:
        yield from case.ends(line, parts[0].by_client)
        yield from case.wrong(r_id=parts[0].r_id)
        yield from each(line, parts)

    yield from _best(case, [one(line, parts) for line in case.lines for parts in transfers(line)])


@auditor("DS910")
def _whole(case: Case) -> Iterator[str]:
    def each(_: Line, parts: list[Part]) -> Iterator[str]:
        size, total = sum(part.size for part in parts), parts[0].total
        first = parts[0].assigned
        truth = None
        if not parts[-1].last:
            truth = "bsend_open"
        elif size != total:
            truth = "bsend_sum"
        elif any(part.sequence != first for part in parts[1:]):
            truth = "bsend_sequence"
        yield from case.wrong(
            case=truth, size=size, total=total, segments=len(parts), first=parts[0].frame.number
        )
        if case.frame != parts[-1].frame.number:
            yield "its last segment is in another frame"

    yield from _transfers(case, each)


@auditor("DS911")
def _silent(case: Case) -> Iterator[str]:
    def each(_: Line, parts: list[Part]) -> Iterator[str]:
        silent = [part.frame.number for part in parts if part.answered is None]
        yield from case.wrong(count=len(silent), segments=len(parts), frames=silent)
        if not silent or case.frame != silent[0]:
            yield "the first one without is in another frame"

    yield from _transfers(case, each)


@auditor("DS912")
def _in_use(case: Case) -> Iterator[str]:
    def each(line: Line, parts: list[Part]) -> Iterator[str]:
        if case.args.get("case") == "r_id_refused":
            refused = [part for part in parts if part.error]
            if not refused or refused[0].answered is None:
                yield "it is not refused"
                return
            yield from case.wrong(code=refused[0].error, frame=None)
            if case.frame != refused[0].answered.number:
                yield "it is refused in another frame"
            return
        yield from case.wrong(case="r_id_open", code=None)
        if case.frame != parts[0].frame.number:
            yield "it begins in another frame"
        before = [
            other for other in transfers(line)
            if other[0].frame.number == case.args.get("frame") and other is not parts
            and (other[0].r_id, other[0].by_client) == (parts[0].r_id, parts[0].by_client)
        ]  # fmt: skip
        if not before or parts[0].frame.number <= before[0][0].frame.number:
            yield "no earlier one begins there"
        elif before[0][-1].last and before[0][-1].answered:
            yield "the earlier one was over"

    yield from _transfers(case, each)


@auditor("DS913")
def _shape(case: Case) -> Iterator[str]:
    for line in case.lines:
        for n, sent in enumerate(line.sent):
            if sent.frame.number != case.frame or sent.r_id != case.args.get("r_id"):
                continue
            same = [
                s for s in line.sent[:n] if (s.r_id, s.by_client) == (sent.r_id, sent.by_client)
            ]
            yield from case.ends(line, sent.by_client)
            before = same[-1] if same else sent
            yield from case.wrong(now=sent.sizes, before=before.sizes, first=before.frame.number)
            return
    yield "no such USEND is in this frame"
