"""The stations of PROFIBUS: whether the table counts what the frames show, and what findings DS801 to DS815 claim.

Every number is counted anew from the turns of `dp`, one question at a time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import groupby, pairwise
from typing import Any

from tests.audit import dp
from tests.audit.claims import Case
from tests.audit.dp import Heard, Line, Turn
from tests.audit.page import near, whole
from tests.audit.reading import Complaint, Reading

FCB = 0x20
"""Of the FC of a request."""
KEPT = 60
"""Frames that a finding names of what happens again and again."""
MOST_POLLS, MOST_WANTING, MOST_BYTES = 100, 10, 240
KNOWN_REPEATS = 16
"""Of more repetitions of one request nobody says when the last one was sent."""
COLUMNS = ("station", "role", "ident", "PPO", "watchdog", "requests", "no answer", "damaged", "repeated", "exchanges",
           "cycle (most)", "answer (most)", "diagnosis (read)")  # fmt: skip
PPOS = {(8, 4): 1, (8, 12): 2, (4,): 3, (12,): 4, (8, 20): 5}
FLAGS = {
    (0, 0): "station_non_existent", (0, 1): "station_not_ready", (0, 2): "cfg_fault", (0, 3): "ext_diag",
    (0, 4): "not_supported", (0, 5): "invalid_response", (0, 6): "prm_fault", (0, 7): "master_lock",
    (1, 0): "prm_req", (1, 1): "stat_diag", (1, 3): "watchdog", (1, 4): "freeze", (1, 5): "sync",
    (1, 7): "deactivated", (2, 7): "overflow",
}  # fmt: skip


# One station

REFUSED = {1: "UE", 2: "RR", 3: "RS"}


def _is_refused(turn: Turn) -> bool:
    told = turn.answer
    return told is not None and not told.short and told.fc & 15 in REFUSED


class Station:
    """What the turns with one station say."""

    def __init__(self, line: Line, address: int) -> None:
        self.line, self.address = line, address
        self.turns = [each for each in line.of(address) if _is_request(each)]
        self.asked = [
            each.asked for each in line.of(address) if each.asked.fc & 15 != dp.STATUS_REQUEST
        ]

    def asks(self) -> bool:
        return any(
            each.sa == self.address and (each.token or each.asks) for each in self.line.heard
        )

    def answered(self, service: str) -> list[Turn]:
        return [each for each in self.turns if each.answer and each.asked.service == service]

    def unanswered(self, *, had: bool = False) -> list[Turn]:
        """Those without an answer that the master had not either, or `had`, as its next request shows."""
        found = []
        for each in self.turns:
            at, master = each.asked.number, each.asked.sa
            later = [two for two in self.asked if two.number > at and two.sa == master]
            if each.answer or each.broken or each.cut or not later:
                continue
            turned = later[0].counts and (later[0].fc ^ each.asked.fc) & FCB
            if turned if had else not later[0].counts:
                found.append(each)
        return found

    def damaged(self) -> list[int]:
        """Frames in the place of answers; the request may have one after it was repeated."""
        return [frame for each in self.turns for frame in each.broken]

    def repeats(self) -> list[int]:
        """The frames that repeat a request, but for one that may stand behind a hole."""
        found, unsure = [], self.line.behind_a_lull()
        for each in self.turns:
            found += [each.asked.number] * each.again + [one.number for one in each.repeats]
        return [each for each in found if each != unsure]

    def exchanges(self) -> list[Turn]:
        return [each for each in self.answered("exchange") if _is_data(each)]

    def cycles(self) -> list[int]:
        """Times between exchanges that follow each other, a start-up in between aside."""
        fresh = [each.asked.number for each in self.start_ups()]
        return _forward(
            two.asked.time_ns - one.asked.time_ns
            for one, two in pairwise(self._asked_for_data())
            if not two.again and not any(one.asked.number < at < two.asked.number for at in fresh)
        )

    def _asked_for_data(self) -> list[Turn]:
        """The exchanges, and those that it refused."""
        mine = {each.asked.number for each in self.exchanges()}
        return [
            each for each in self.turns
            if each.asked.number in mine or (each.asked.service == "exchange" and _is_refused(each))
        ]  # fmt: skip

    def answers(self) -> list[int]:
        return _forward(
            each.answer.time_ns - [each.asked, *each.repeats][-1].time_ns
            for each in self.turns if each.answer and len(each.repeats) <= KNOWN_REPEATS
        )  # fmt: skip

    def start_ups(self) -> list[Turn]:
        return list(dp.start_ups(self.line, self.address))

    def configurations(self) -> list[Turn]:
        return [each for each in self.answered("configuration") if dp.is_taken(each)]

    def diagnoses(self) -> list[Turn]:
        """Answers with data; one without SAPs is that of a data exchange whose request was not seen."""
        told = self.answered("diagnosis")
        return [
            each
            for each in told
            if each.answer and each.answer.du and each.answer.saps != (None, None)
        ]

    def before(self, turns: list[Turn], frame: int) -> Turn | None:
        """The last of them that was over before a frame; None where a newer one has no answer."""
        over = [each for each in turns if each.answer and each.answer.number < frame]
        if not over:
            return None
        newer = [
            each for each in self.turns
            if each.asked.service == over[-1].asked.service and not each.answer
            and over[-1].asked.number < each.asked.number < frame
        ]  # fmt: skip
        hidden = any(over[-1].asked.number < each < frame for each in self.holes())
        return None if newer or hidden else over[-1]

    def gaps(self) -> list[int]:
        """The requests before which an exchange was not seen: they have the FCB of the one before."""
        found = []
        for master in {each.asked.sa for each in self.line.of(self.address)}:
            own = [each for each in self.line.of(self.address) if each.asked.sa == master]
            found += [
                two.asked.number for one, two in pairwise(own)
                if one.asked.counts and two.asked.counts and not two.again
                and not (one.asked.fc ^ two.asked.fc) & FCB
            ]  # fmt: skip
        return sorted(found)

    def holes(self) -> list[int]:
        """The requests before which something was not seen, an exchange or an answer that the master had."""
        found = self.gaps()
        for master in {each.asked.sa for each in self.line.of(self.address)}:
            own = [each for each in self.line.of(self.address) if each.asked.sa == master]
            asked = [each for each in own if each.asked.fc & 15 != dp.STATUS_REQUEST]
            found += [
                two.asked.number for one, two in pairwise(asked)
                if two.asked.counts and not (one.answer or one.broken or one.cut or one.last)
            ]  # fmt: skip
        return sorted(found)

    def rows(self) -> list[tuple[list[int], bool]]:
        """Rows of answers that ask for Slave_Diag, and whether it was read at the end of each."""
        steps: list[tuple[int, str]] = []
        for each in self.exchanges():
            assert each.answer is not None
            steps.append(
                (each.answer.number, "wants" if each.answer.fc & 15 in dp.HIGH else "well")
            )
        steps += [(each.answer.number, "read") for each in self.diagnoses() if each.answer]
        found = []
        for kind, group in groupby(sorted(steps), key=lambda each: each[1]):
            frames = [frame for frame, _ in group]
            if kind == "wants":
                found.append(
                    (frames, any(step == (_next(steps, frames[-1]), "read") for step in steps))
                )
        return found


def _next(steps: list[tuple[int, str]], frame: int) -> int:
    return min((at for at, _ in steps if at > frame), default=0)


def _is_request(turn: Turn) -> bool:
    """Whether it counts: who is there at all is no request, and what the recording does not show is none."""
    if turn.answer:
        return True
    return turn.asked.fc & 15 != dp.STATUS_REQUEST and not turn.last


def _is_data(turn: Turn) -> bool:
    told = turn.answer
    return told is not None and (told.short or told.fc & 15 in dp.DATA)


def _forward(times: Iterator[int]) -> list[int]:
    """Without those of a clock that was set back."""
    return [each for each in times if each >= 0]


# What frames say


def is_dpv1(du: bytes) -> bool:
    """Whether Set_Prm enables DPV1."""
    return len(du) > 7 and bool(du[7] & 0x80)


def watchdog(du: bytes) -> int | None:
    """In ms; None where it is off."""
    if len(du) < 3 or not du[0] & 0x08:
        return None
    return du[1] * du[2] * (1 if is_dpv1(du) and du[7] & 0x04 else 10)


def modules(du: bytes) -> list[tuple[bytes, int, int, bool]] | None:
    """The modules of Chk_Cfg: identifier, bytes out and in, whether all of it is consistent; None where one is cut."""
    found, rest = [], du
    while rest:
        head, sizes, sure = rest[0], [0, 0], True
        size = 1
        if head & 0x30:
            length = (head % 16 + 1) * (2 if head & 0x40 else 1)
            sizes = [length if head & 0x20 else 0, length if head & 0x10 else 0]
            sure = head > 0x7F
        else:
            for place, bit in enumerate((0x80, 0x40)):
                if head & bit:
                    if len(rest) <= size:
                        return None
                    own = rest[size]
                    sizes[place] = (own % 64 + 1) * (2 if own & 0x40 else 1)
                    sure = sure and own > 0x7F
                    size += 1
            size += head % 16 if head % 16 < 15 else 0
        if len(rest) < size:
            return None
        found.append((rest[:size], sizes[0], sizes[1], sure))
        rest = rest[size:]
    return found


def ppo(du: bytes) -> int | None:
    """The PPO of Chk_Cfg."""
    filled = [each for each in modules(du) or () if each[1] or each[2]]
    if any(each[1] != each[2] for each in filled):
        return None
    return PPOS.get(tuple(each[1] for each in filled))


def _word(du: bytes, at: int) -> int | None:
    return int.from_bytes(du[at : at + 2]) if len(du) > at + 1 else None


def blocks(du: bytes) -> list[str]:
    """Extended diagnosis."""
    found, rest = [], du[6:]
    while rest:
        size = {2: 3, 3: 1}.get(rest[0] >> 6, max(1, rest[0] & 63))
        found.append(rest[:size].hex())
        rest = rest[size:]
    return found


# The table


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about the stations of a line, in JSON, text and page."""
    line, told = reading.line, reading.plain.get("bus")
    if line is None or told is None:
        if (line is None) is not (told is None):
            yield Complaint("bus", "", "a line is there or told, and not both")
        return
    for text in (*_of_line(line, told), *_of_stations(line, told)):
        yield Complaint("bus", "json", text)
    yield from _shown(reading, told)


def _of_line(line: Line, told: dict[str, Any]) -> Iterator[str]:
    true = {
        "frames": len(line.heard), "tokens": sum(each.token for each in line.heard),
        "damaged": sum(each.damage in ("check", "other") for each in line.heard),
        "stray": len(line.stray),
    }  # fmt: skip
    for name, value in true.items():
        if told[name] != value:
            yield f"{name} {told[name]} is {value}"


def _of_stations(line: Line, told: dict[str, Any]) -> Iterator[str]:
    seen = {each.sa for each in line.heard if each.good} | {
        each.da for each in line.heard if each.good
    }
    all_of = [Station(line, address) for address in sorted(seen - {-1})]
    there = [each for each in all_of if each.asks() or each.turns]
    if [each["address"] for each in told["stations"]] != [each.address for each in there]:
        yield f"the stations are {[each.address for each in there]}"
        return
    for station, plain in zip(there, told["stations"], strict=True):
        for name, value in _truth(station).items():
            if name == "retries" and line.doubled and line.disordered:
                continue  # a copy behind the answer is like a repetition: nobody can tell them apart
            if plain[name] != value:
                yield f"dp{station.address}: {name} {plain[name]!r} is {value!r}"
        spans = [("cycle", station.cycles())]
        if not line.doubled:  # of which place the times are there is a matter of chance
            spans.append(("answer", station.answers()))
        for name, times in spans:
            yield from _times(f"dp{station.address}: {name}", plain[name], times)


def _truth(station: Station) -> dict[str, Any]:
    data, read = station.exchanges(), station.diagnoses()
    set_up, configured = station.start_ups(), station.configurations()
    last = data[-1] if data else None
    said = read[-1].answer.du if read and read[-1].answer else None
    ident = _word(set_up[-1].asked.du, 4) if set_up else _word(said, 4) if said else None
    return {
        "role": "master" if station.asks() else "slave", "ident": ident,
        "ppo": ppo(configured[-1].asked.du) if configured else None,
        "watchdog_ms": watchdog(set_up[-1].asked.du) if set_up else None,
        "requests": len(station.turns), "unanswered": len(station.unanswered()),
        "damaged": len(station.damaged()), "retries": len(station.repeats()), "exchanges": len(data),
        "outputs": len(last.asked.du) if last else None,
        "inputs": len(last.answer.du) if last and last.answer else None,
        "diagnoses_wanted": len(station.rows()),
        "diagnoses_fetched": sum(fetched for _, fetched in station.rows()),
        "parameters": set_up[-1].asked.number if set_up else None,
        "configuration": configured[-1].asked.number if configured else None,
        "diagnosis": None if said is None or read[-1].answer is None else {
            "frame": read[-1].answer.number,
            "flags": [
                name for (byte, bit), name in FLAGS.items() if len(said) > byte and said[byte] >> bit & 1
            ],
            "master": said[3] if len(said) > 3 and said[3] != 255 else None,
            "ident": _word(said, 4), "blocks": blocks(said),
        },
    }  # fmt: skip


def _times(name: str, told: dict[str, float] | None, times: list[int]) -> Iterator[str]:
    true = None
    if times:
        true = {
            "least_ms": min(times) / 1e6, "mean_ms": sum(times) // len(times) / 1e6, "most_ms": max(times) / 1e6,
        }  # fmt: skip
    if (told is None) is not (true is None):
        yield f"{name} {told} is {true}"
    for key, value in (true or {}).items():
        if told is not None and abs(told[key] - value) > 1e-6:
            yield f"{name} {key} {told[key]} is {value}"


# Text and page


def _shown(reading: Reading, told: dict[str, Any]) -> Iterator[Complaint]:
    if reading.text:
        lines = whole(_section(reading.text), 6)
        cells = [re.split(r"\s{2,}", each) for each in lines]
        rows = {each[0]: each for each in cells if re.fullmatch(r"dp\d+", each[0])}
        for text in (
            *_counts(lines[:1], told),
            *_rows_of_text(lines, rows, told),
            *_said(lines, told),
        ):
            yield Complaint("bus", "text", text)
    if reading.page:
        english = re.sub(r'<span lang="zh">.*?</span>', "", reading.page, flags=re.DOTALL)
        part = re.search(r'<section id="bus-.*?</section>', english, re.DOTALL)
        if part is None:
            yield Complaint("bus", "page", "has no stations")
            return
        body = part[0]
        plain = [
            [_plain(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)]
            for row in re.findall(r"<tr>(.*?)</tr>", body, re.DOTALL)
        ]  # fmt: skip
        lines = [
            _plain(each) for each in re.findall(r"<(?:li|p)[^>]*>(.*?)</(?:li|p)>", body, re.DOTALL)
        ]
        rows_of = {row[0]: row for row in plain[1:]}
        if tuple(plain[0]) != COLUMNS:
            yield Complaint("bus", "page", f"has other columns: {plain[0]}")
        for text in (*_counts(lines[:1], told), *_rows(rows_of, told), *_said(lines, told)):
            yield Complaint("bus", "page", text)


def _plain(text: str) -> str:
    return " ".join(re.sub(r"<[^>]+>", "", text).split())


def _section(text: str) -> list[str]:
    """The lines below the title."""
    lines = text.splitlines()
    begin = lines.index("PROFIBUS") + 1 if "PROFIBUS" in lines else len(lines)
    end = next((at for at in range(begin, len(lines)) if not lines[at]), len(lines))
    return lines[begin:end]


def _counts(lines: list[str], told: dict[str, Any]) -> Iterator[str]:
    true = (
        f"frames {told['frames']:,}, tokens {told['tokens']:,}, damaged frames {told['damaged']:,}, "
        f"answers without a request {told['stray']:,}"
    )
    if lines != [true]:
        yield f"{lines} is {true!r}"


def _cells(plain: dict[str, Any]) -> list[Callable[[str], bool]]:
    """What must stand in each cell of a row."""

    def same(text: str) -> Callable[[str], bool]:
        return lambda cell: cell == text

    def times(span: dict[str, float] | None) -> Callable[[str], bool]:
        def fits(cell: str) -> bool:
            found = re.fullmatch(r"(.*) \((.*)\)", cell)
            if span is None or found is None:
                return span is None and not cell
            return near(found[1], span["mean_ms"]) and near(found[2], span["most_ms"])

        return fits

    cells = [same(f"dp{plain['address']}"), same(plain["role"])]
    if not plain["requests"]:
        return cells + [same("")] * (len(COLUMNS) - 2)
    wanted = plain["diagnoses_wanted"]
    off = "" if plain["parameters"] is None else "off"
    watch = plain["watchdog_ms"]
    cells += [
        same("" if plain["ident"] is None else f"{plain['ident']:04X}"),
        same("" if plain["ppo"] is None else f"PPO{plain['ppo']}"),
        same(off if watch is None else f"{watch:,} ms"),
    ]
    cells += [
        same(f"{plain[name]:,}") for name in ("requests", "unanswered", "damaged", "retries", "exchanges")
    ]  # fmt: skip
    return [
        *cells,
        times(plain["cycle"]), times(plain["answer"]),
        same(f"{wanted} ({plain['diagnoses_fetched']})" if wanted else ""),
    ]  # fmt: skip


def _rows(rows: dict[str, list[str]], told: dict[str, Any]) -> Iterator[str]:
    if list(rows) != [f"dp{each['address']}" for each in told["stations"]]:
        yield f"the rows are {list(rows)}"
        return
    for plain in told["stations"]:
        row = rows[f"dp{plain['address']}"]
        wanted = _cells(plain)
        if len(row) != len(wanted):
            yield f"{row} has {len(row)} cells"
        for name, cell, fits in zip(COLUMNS, row, wanted, strict=False):
            if not fits(cell):
                yield f"dp{plain['address']}: {name} is not {cell!r}"


def _rows_of_text(
    lines: list[str], rows: dict[str, list[str]], told: dict[str, Any]
) -> Iterator[str]:
    """Empty cells leave nothing behind there: what stands is compared in its order."""
    if rows and re.split(r"\s{2,}", lines[1]) != list(COLUMNS):
        yield f"has other columns: {lines[1]}"
    if list(rows) != [f"dp{each['address']}" for each in told["stations"]]:
        yield f"the rows are {list(rows)}"
        return
    for plain in told["stations"]:
        row = rows[f"dp{plain['address']}"]
        wanted = [fits for fits in _cells(plain) if not fits("")]
        if len(row) != len(wanted) or not all(
            fits(cell) for fits, cell in zip(wanted, row, strict=True)
        ):
            yield f"{row} is not so"


_SAID = re.compile(
    r"dp(\d+) Slave_Diag in frame (\d+): (.*); ident ([0-9A-F]{4}|\?), master (none|dp\d+)(?:; extended (.*))?"
)


def _said(lines: list[str], told: dict[str, Any]) -> Iterator[str]:
    """The lines about Slave_Diag; what the flags are called is looked up in the table."""
    found = {int(each[1]): each for each in map(_SAID.fullmatch, lines) if each}
    for plain in told["stations"]:
        item, line = plain["diagnosis"], found.get(plain["address"])
        if (item is None) is not (line is None):
            yield f"dp{plain['address']}: Slave_Diag is told, or not: {item}"
        if item is None or line is None:
            continue
        master = "none" if item["master"] is None else f"dp{item['master']}"
        ident = "?" if item["ident"] is None else f"{item['ident']:04X}"
        if (int(line[2]), line[4], line[5]) != (item["frame"], ident, master):
            yield f"{line[0]!r} is {item}"
        count = 0 if line[3] == "nothing" else len(line[3].split("; "))
        if count != len(item["flags"]):
            yield f"{line[3]!r} are {item['flags']}"
        there = re.sub(r"[ |]", "", line[6] or "").lower()
        if there != "".join(item["blocks"]):
            yield f"{line[6]!r} are {item['blocks']}"


# Findings

Auditor = Callable[[Case, Station], Iterator[str]]


def of(case: Case) -> Iterator[str]:
    """What is not so in a finding about the line."""
    line = case.reading.line
    if line is None:
        yield "there is no line"
        return
    device = str(case.args.get("device", "dp-1"))
    if not re.fullmatch(r"dp-?\d+", device):
        yield f"{device} is no station"
        return
    yield from AUDITORS[case.finding.rule](case, Station(line, int(device[2:])))


def _are(case: Case, frames: list[int]) -> Iterator[str]:
    """Count, frames and frame of what happened in these frames."""
    yield from case.wrong("count", len(frames))
    line = case.reading.line
    if (
        line is not None and line.doubled
    ):  # which one of two equal frames is named is a matter of chance
        told = [line.first.get(each) for each in case.args.get("frames", ())]
        if (
            told != [line.first[each] for each in frames[:KEPT]]
            or line.first[case.frame] != told[0]
        ):
            yield f"frames {told} are {frames[:KEPT]}"
        return
    yield from case.wrong("frames", frames[:KEPT])
    if case.frame not in frames[:1]:
        yield f"it happened first in frame {frames[:1]}"
    others = {case.args.get(name) for name in ("frame", "last")} - {None}
    if sorted(case.finding.frames) != sorted({*frames[:KEPT], *others}):
        yield f"names the frames {case.finding.frames}, which are {frames[:KEPT]}"


def _check_bytes(case: Case, station: Station) -> Iterator[str]:
    yield from _are(case, [each.number for each in station.line.heard if each.damage == "check"])


def _damage(case: Case, station: Station) -> Iterator[str]:
    yield from _are(case, [each.number for each in station.line.heard if each.damage == "other"])


def _repeats(case: Case, station: Station) -> Iterator[str]:
    if holes := station.holes():
        yield f"before frame {holes[0]} something was not seen"
    frames = station.repeats()
    yield from _are(case, frames)
    yield from case.wrong("of", len(station.turns))


def _no_answer(case: Case, station: Station) -> Iterator[str]:
    yield from _are(case, [each.asked.number for each in station.unanswered()])
    yield from case.wrong("of", len(station.turns))


def missing(case: Case) -> Iterator[str]:
    """Requests whose answers their master had, and the capture has not."""
    line, station = case.reading.line, str(case.args.get("device")).removeprefix("dp")
    lost = Station(line, int(station)).unanswered(had=True) if line and station.isdigit() else []
    if not lost or case.finding.frame != lost[0].asked.number:
        yield f"such requests are {[each.asked.number for each in lost]}"
    yield from case.wrong("count", len(lost))


def gaps(case: Case) -> Iterator[str]:
    """Requests before which an exchange is not in the capture, as their FCB shows."""
    line, station = case.reading.line, str(case.args.get("device")).removeprefix("dp")
    found = Station(line, int(station)).gaps() if line and station.isdigit() else []
    if not found or case.finding.frame != found[0]:
        yield f"such requests are in frames {found}"
    yield from case.wrong("count", len(found))


def unasked(case: Case) -> Iterator[str]:
    """Answers, and nothing that asks."""
    heard = case.reading.line.heard if case.reading.line else []
    answers = [each for each in heard if each.good and not each.token and not each.asks]
    yield from case.wrong("count", len(answers))
    if asked := [each.number for each in heard if each.asks and each.good]:
        yield f"frame {asked[0]} asks"


def _not_enabled(case: Case, station: Station) -> Iterator[str]:
    frames = []
    for turn in station.turns:
        told = turn.answer
        if (
            told is None
            or told.short
            or told.fc & 15 != 3
            or turn.asked.saps[0] != case.args.get("sap")
        ):
            continue
        records = turn.asked.service in ("record", "alarm")
        set_up = station.before(station.start_ups(), told.number) if records else None
        frame = set_up.asked.number if set_up else None
        key = "sap_other"
        if records:
            key = "sap_unknown"
            if set_up:
                key = "sap_dpv1" if is_dpv1(set_up.asked.du) else "sap_no_dpv1"
        if (key, frame) == (case.args.get("case"), case.args.get("frame")):
            frames.append(told.number)
    yield from _are(case, frames)


def _refused(case: Case, station: Station) -> Iterator[str]:
    args = case.args
    place = args.get("place")
    operation = {"DS_Write": True, "DS_Read": False}.get(str(args.get("operation")))
    ours = {(each.device, each.index) for each in case.reading.deals}
    found = [
        each.answered for each in station.line.records
        if each.status and f"{each.status:08X}" == args.get("status") and each.write is operation
        and each.device == f"dp{station.address}"
        and {"slot": each.slot, "subslot": None, "index": each.index} == place
    ]  # fmt: skip
    yield from _are(case, sorted(each for each in found if each is not None))
    if isinstance(place, dict) and (f"dp{station.address}", place.get("index")) in ours:
        yield "this is the parameter channel"


def _polled(case: Case, station: Station) -> Iterator[str]:
    line = station.line
    known = {
        frame: polls for frame, polls in sorted(line.polls.items())
        if line.stations[frame] == station.address and polls > MOST_POLLS
    }  # fmt: skip
    yield from case.wrong("limit", MOST_POLLS)
    yield from case.wrong("count", len(known))
    yield from case.wrong("frames", list(known)[:KEPT])
    yield from case.wrong("polls", max(known.values(), default=0))
    if known.get(case.frame) != case.args.get("polls"):
        yield f"this took {known.get(case.frame)} polls"


def _not_written(case: Case, station: Station) -> Iterator[str]:
    """A Read that found nothing: nobody wrote there since the start-up, which the recording has."""
    reads = [
        each for each in station.line.records
        if each.answered == case.frame and not each.write and each.device == f"dp{station.address}"
    ]  # fmt: skip
    if not reads:
        yield "no Read is answered in this frame"
        return
    yield from case.wrong("index", reads[0].index)
    yield from case.wrong("status", None if reads[0].status is None else f"{reads[0].status:08X}")
    if reads[0].data:
        yield "the Read brings data"
    fresh = [each.asked.number for each in station.start_ups() if each.asked.number < case.frame]
    if not fresh:
        yield "there is no start-up before it"
        return
    since = [
        each.asked or each.answered for each in station.line.records
        if each.write and each.index == reads[0].index and each.device == reads[0].device
        and fresh[-1] < (each.asked or each.answered or 0) < case.frame
    ]  # fmt: skip
    since += [
        each.number for each in station.line.stray
        if each.sa == station.address and fresh[-1] < each.number < case.frame
        and each.du[:1] == bytes((dp.WRITE,)) and each.du[2:3] == bytes((reads[0].index,))
    ]  # fmt: skip
    if since:
        yield f"it was written to in frame {since[0]}"


def _too_long(case: Case, station: Station) -> Iterator[str]:
    writes = [
        each for each in station.line.records
        if each.write and each.asked == case.frame and each.device == f"dp{station.address}"
    ]  # fmt: skip
    yield from case.wrong("length", writes[0].stated if writes else None)
    yield from case.wrong("most", MOST_BYTES)
    if not writes or writes[0].stated <= MOST_BYTES:
        yield "no write in this frame is too long"


def _set_again(case: Case, station: Station) -> Iterator[str]:
    """Set_Prm behind data exchange, of which none came since the Set_Prm before; none of which may be missing."""
    frames, lasts = [], []
    begin, holes = 0, station.holes()
    unsure = [
        each.asked.number for each in station.turns
        if each.asked.service == "parameters" and each.answer is None
    ]  # fmt: skip
    for turn in station.start_ups():
        at = turn.asked.number
        data = [each.asked.number for each in station.exchanges() if begin < each.asked.number < at]
        begin = at
        if data and not any(data[-1] < each <= at for each in (*holes, *unsure)):
            frames.append(at)
            lasts.append(data[-1])
    yield from _are(case, frames)
    yield from case.wrong("last", lasts[0] if lasts else None)


def _no_exchange(case: Case, station: Station) -> Iterator[str]:
    """Refused data exchanges of one kind, and what was before the first of them."""
    name, args = case.args.get("answer"), case.args
    kinds: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    series: dict[str, Any] = {"last": 0}
    for turn in station.turns:
        told = turn.answer
        if turn.asked.service != "exchange" or told is None or not _is_refused(turn):
            continue
        if REFUSED[told.fc & 15] == name:
            true = _before_refusal(station, turn.asked)
            if true["last"] != series["last"]:
                series = true  # what is said of a series is what its first one shows
            kinds.setdefault(series["case"], []).append((told.number, series))
    mine = kinds.get(args.get("case", ""), [])
    yield from _are(case, [frame for frame, _ in mine])
    for key, value in (mine[0][1] if mine else {}).items():
        yield from case.wrong(key, value)


def _no_service(case: Case, station: Station) -> Iterator[str]:
    """Services that were refused, but those of data exchange, and SAPs that are not enabled."""
    kind = case.args.get("sap"), case.args.get("answer")
    yield from _are(case, [
        turn.answer.number for turn in station.turns
        if turn.answer is not None and _is_refused(turn) and turn.answer.fc & 15 != 3
        and turn.asked.service != "exchange"
        and (turn.asked.saps[0], REFUSED[turn.answer.fc & 15]) == kind
    ])  # fmt: skip


def _before_refusal(station: Station, asked: Heard) -> dict[str, Any]:
    """Which data exchange was the last one since Set_Prm, and what its watchdog says of the time since then."""
    begin = max(
        (each.asked.number for each in station.start_ups() if each.asked.number < asked.number),
        default=0,
    )
    data = [each.asked for each in station.exchanges() if begin < each.asked.number < asked.number]
    nothing = {"last": None, "gap": None, "watchdog": None, "frame": None}
    if not data:
        return {"case": "exchange_none", **nothing}
    last, set_up = data[-1], station.before(station.start_ups(), asked.number)
    gap_ns, watchdog = asked.time_ns - last.time_ns, _watchdog(set_up.asked.du) if set_up else None
    hidden = any(last.number < each <= asked.number for each in station.holes())
    if not watchdog or gap_ns <= 0 or hidden or set_up is None:
        return {"case": "exchange_since", **nothing, "last": last.number}
    case = "exchange_late" if gap_ns > watchdog * 10**6 else "exchange_in_time"
    told = {"gap": gap_ns / 1e6, "watchdog": watchdog, "frame": set_up.asked.number}
    return {"case": case, "last": last.number, **told}


def _watchdog(set_prm: bytes) -> int | None:
    """Milliseconds; None where it is off."""
    if len(set_prm) < 3 or not set_prm[0] & 0x08:
        return None
    fine = len(set_prm) > 7 and set_prm[7] & 0x84 == 0x84
    return (1 if fine else 10) * set_prm[1] * set_prm[2]


def _lengths(case: Case, station: Station) -> Iterator[str]:
    args, frames = case.args, []
    for turn in station.exchanges():
        told = turn.answer
        configured = station.before(station.configurations(), told.number if told else 0)
        known = modules(configured.asked.du) if configured else None
        if told is None or told.short or configured is None or known is None:
            continue
        true = {
            "outputs": len(turn.asked.du), "inputs": len(told.du),
            "configured_outputs": sum(each[1] for each in known),
            "configured_inputs": sum(each[2] for each in known), "frame": configured.asked.number,
        }  # fmt: skip
        out = true["outputs"] and true["outputs"] != true["configured_outputs"]
        if (out or true["inputs"] != true["configured_inputs"]) and all(
            args.get(name) == value for name, value in true.items()
        ):
            frames.append(told.number)
    yield from _are(case, frames)


def _not_read(case: Case, station: Station) -> Iterator[str]:
    rows = [frames for frames, _ in station.rows()]
    longest = max(rows, key=len, default=[])
    yield from _are(case, longest)
    if len(longest) < MOST_WANTING:
        yield "that is not many"


def _inconsistent(case: Case, station: Station) -> Iterator[str]:
    frames = []
    for turn in station.configurations():
        known = modules(turn.asked.du) or []
        first = [each for each in known if each[1] or each[2]][:1]
        split = ppo(turn.asked.du) in (1, 2, 5) and not first[0][3]
        if split and first[0][0].hex().upper() == case.args.get("identifier"):
            frames.append(turn.asked.number)
    yield from _are(case, frames)


def _taken_before(turns: list[Turn], frame: int) -> bool:
    """Whether a station had taken any of these before a frame."""
    return any(each.answer is not None and each.answer.number < frame for each in turns)


OF_CASES = {"diag_ident": {"ident", "sent"}, "diag_master": {"master"}}
"""What is told of a case of DS814; the others have nothing more."""


def _slave_diag(case: Case, station: Station) -> Iterator[str]:
    args, frames = case.args, []
    for name in {"ident", "sent", "master"} - OF_CASES.get(str(args.get("case")), set()):
        yield from case.wrong(name, None)
    for turn in station.diagnoses():
        told = turn.answer
        assert told is not None
        set_up = station.before(station.start_ups(), told.number)
        own = set_up is not None and set_up.asked.sa == turn.asked.sa
        sent = _word(set_up.asked.du, 4) if set_up and own else None
        ident, master = _word(told.du, 4), told.du[3] if len(told.du) > 3 else 255
        refused = {
            "diag_prm_fault": (0x40, station.start_ups),
            "diag_cfg_fault": (0x04, station.configurations),
        }
        true = {
            **{
                # Of a station that nobody has, it is of a start-up before the capture where none is in it.
                name: bool(told.du[0] & bit) and (master != 255 or _taken_before(taken(), told.number))
                for name, (bit, taken) in refused.items()
            },
            "diag_ident": None not in (ident, sent) and ident != sent
            and (ident, sent) == (args.get("ident"), args.get("sent")),
            "diag_master": own and master not in (255, turn.asked.sa) and master == args.get("master"),
        }  # fmt: skip
        if true.get(str(args.get("case"))):
            frames.append(told.number)
    yield from _are(case, frames)


def _no_watchdog(case: Case, station: Station) -> Iterator[str]:
    yield from _are(case, [
        each.asked.number for each in station.start_ups()
        if each.asked.du and each.asked.du[0] & 0x80 and not each.asked.du[0] & 0x08
    ])  # fmt: skip


AUDITORS: dict[str, Auditor] = {
    "DS801": _check_bytes, "DS802": _damage, "DS803": _repeats, "DS804": _no_answer, "DS805": _not_enabled,
    "DS806": _refused, "DS807": _polled, "DS808": _not_written, "DS809": _too_long, "DS810": _set_again,
    "DS811": _lengths, "DS812": _not_read, "DS813": _inconsistent, "DS814": _slave_diag, "DS815": _no_watchdog,
    "DS816": _no_exchange, "DS817": _no_service,
}  # fmt: skip
