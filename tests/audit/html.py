"""The HTML page against the transactions: tiles, drives, problems with their filters, the rows of its data."""

from __future__ import annotations

import base64
import gzip
import json
import re
import struct
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from html import unescape
from typing import Any

from tests.audit.page import (
    Headline,
    answered_wrongly,
    dated,
    headline,
    moment,
    nanoseconds,
    near,
    rank,
    seconds,
)
from tests.audit.reading import Complaint, Deal, Reading

_DATA = re.compile(
    r'<script type="application/(json|gzip)" id="(data-\d+)">(.*?)</script>', re.DOTALL
)  # fmt: skip
_STATES = ("ok", "partial", "error", "superseded")
_TILE = re.compile(r"<dt>(.*?)</dt><dd>(.*?)</dd>", re.DOTALL)
_ROW = re.compile(r"<tr>(.*?)</tr>", re.DOTALL)
_CELL = re.compile(r"<t[hd][^>]*>(.*?)</t[hd]>", re.DOTALL)
_PROBLEM = re.compile(r'<li class="(?:error|warning|note)">(.*?)</li>', re.DOTALL)
STATES = {
    "refused": ("refused",), "failed": ("refused", "error", "partial", "mismatch"),
    "no answer|no response|response not fetched": ("unanswered", "superseded"),
    "unanswered": ("unanswered",), "outcome unknown": ("unanswered", "superseded", "incomplete"),
}  # fmt: skip
"""Labels of counts -> the states that they count."""


def check(reading: Reading) -> Iterator[Complaint]:
    """All complaints about the page of one capture."""
    if not reading.page:
        return
    text = re.sub(r'<span lang="zh">.*?</span>', "", reading.page, flags=re.DOTALL)
    body = re.sub(r"<(script|style).*?</\1>", "", text, flags=re.DOTALL)
    for name, told in [
        *(("tile", each) for each in _tiles(body, reading)),
        *(("drives of the page", each) for each in _drives(body, reading)),
        *(("data of the page", each) for each in _data(reading)),
        *(("times of the page", each) for each in _times(body, reading)),
    ]:  # fmt: skip
        yield Complaint(name, "", told)
    for told in _PROBLEM.findall(body):
        item = _problem(told)
        for problem in headline(item, reading) if item else ():
            yield Complaint("headline", f"page, {item.rule}" if item else "", problem)


def _plain(text: str) -> str:
    return " ".join(unescape(re.sub(r"<[^>]+>", "", text)).split())


def _count(label: str, told: str, deals: list[Deal]) -> Iterator[str]:
    """Whether a number under a label is that of the transactions."""
    known = [each.duration_ms for each in deals if each.duration_ms is not None]
    times = sorted(each for each in known if each >= 0)
    tests: list[tuple[str, Callable[[], object]]] = [
        (r"drives?", lambda: len({each.device for each in deals if not each.s7})),
        (r"read( jobs?| transactions?)?", lambda: sum(each.operation == "read" for each in deals)),
        (r"changed?( jobs?| transactions?)?", lambda: sum(each.operation == "change" for each in deals)),
        *((form, lambda states=states: sum(each.state in states for each in deals))  # type: ignore[misc]
          for form, states in STATES.items()),
        *((state, lambda state=state: sum(each.state == state for each in deals))  # type: ignore[misc]
          for state in _STATES),
    ]  # fmt: skip
    for form, truth in tests:
        counts = re.fullmatch(form, label.lower()) and re.fullmatch(r"[\d,]+", told)
        if counts and int(told.replace(",", "")) != truth():
            yield f"{label} {told} is {truth()}"
    middle = {"typical time": rank(times, 50), "slowest": times[-1] if times else None}
    if label.lower() in middle and re.match(r"\d", told) and not near(told, middle[label.lower()]):
        yield f"{label} {told} is {middle[label.lower()]} ms"


def _tiles(body: str, reading: Reading) -> Iterator[str]:
    block = re.search(r'<dl class="tiles">(.*?)</dl>', body, re.DOTALL)
    for label, told in _TILE.findall(block[1]) if block else ():
        yield from _count(_plain(label), _plain(told), reading.deals)


def _drives(body: str, reading: Reading) -> Iterator[str]:
    start = body.find('<table class="plain stack">')
    if start < 0:
        return
    rows = [
        [_plain(cell) for cell in _CELL.findall(row)]
        for row in _ROW.findall(body[start : body.find("</table>", start)])
    ]  # fmt: skip
    if not rows or not rows[0] or rows[0][0] != "Address":
        return
    for row in rows[1:]:
        missing = answered_wrongly(reading, row[0])
        deals = [each for each in reading.deals if each.device == row[0]]
        for label, told in zip(rows[0], row, strict=False):
            counts = [(label, told)]
            if label == "Outcome":
                counts = [
                    (state, number) for number, state in re.findall(r"([\d,]+) ([a-z]+)", told)
                ]
            for each in counts:
                for text in _count(*each, deals):
                    yield f"{row[0]}: {text}"
            if label == "Drive objects":
                listed = re.match(r"[\d, ]*", told)  # behind them, the telegrams
                for axis in {int(each) for each in re.findall(r"\d+", listed[0])} & missing:
                    yield f"{row[0]}: lists DO {axis}, which does not exist"


def _problem(text: str) -> Headline | None:
    rule = re.search(r">(DS7\d\d)<", text)
    what = re.search(r'<p class="what">(.*?)<a class="rule"', text, re.DOTALL)
    code = re.search(r'<code class="copyable">(frame\.number.*?)</code>', text, re.DOTALL)
    if rule is None or what is None or code is None:
        return None
    times = re.search(
        r'class="dim times">.*?([\d,]+) times?(?: in ([\d,]+) frames?)?', text, re.DOTALL
    )
    job = re.search(r'href="#job-\d+-(\d+)"', text)
    words = _plain(re.sub(r'<span class="badge.*?</span></span>', "", what[1], flags=re.DOTALL))
    words, _, others = words.partition("; these respond here: ")
    item = Headline(
        rule[1], "", words, answering=[int(each) for each in re.findall(r"\d+", others)]
    )
    if times:
        item.times = int(times[1].replace(",", ""))
        item.wide = int((times[2] or times[1]).replace(",", ""))
    item.filters = [_plain(code[1])]
    item.job = int(job[1]) if job else None
    state = re.search(r'<p class="state">(.*?)</p>', text, re.DOTALL)
    item.state = _plain(state[1]) if state else ""
    return item


def _data(reading: Reading) -> Iterator[str]:
    for kind, _name, text in _DATA.findall(reading.page):
        data = gzip.decompress(base64.b64decode(text)).decode() if kind == "gzip" else text
        plain = json.loads(data)
        yield from _rows(plain, reading)
        yield from _trail(plain["trail"], reading)


def _microseconds(deal: Deal, reading: Reading) -> float:
    since = nanoseconds(deal.plain["start"]) - nanoseconds(reading.plain["start"])
    return since / 1000


def _times(body: str, reading: Reading) -> Iterator[str]:
    """The times of findings and events: those of their frames."""
    rows = re.findall(r"<tr[^>]*>(<td class=\"number\"[^>]*>\d.*?)</tr>", body, re.DOTALL)
    for row in rows:
        frame = reading.capture.frame(int(re.findall(r">(\d+)", row)[0]))
        told = [_plain(each) for each in re.findall(r'<td class="number time">(.*?)</td>', row)]
        if not told or frame is None or "–" in told:
            continue
        true = [f"{seconds(frame.time_ns, reading)} s"]
        if dated(reading):
            true.insert(0, moment(_iso(frame.time_ns), reading))
        if told != true:
            yield f"frame {frame.number} is of {true}, not {told}"


def _iso(time_ns: int) -> str:
    whole, rest = divmod(time_ns, 10**9)
    return f"{datetime.fromtimestamp(whole, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09}Z"


def _channel(deal: Deal, reading: Reading) -> list[Any]:
    """What a row has of its channel: of S7 the ends of its connection, and that it is one."""
    place = [deal.ar, deal.api, deal.slot, deal.subslot, deal.index]
    for line in reading.plain.get("connections", ()):
        if deal.s7 and line["id"] == deal.plain["connection"]:
            ends = ("client", "server")
            place[0] = " -> ".join(f"{line[each]}:{line[each + '_port']}" for each in ends)
            place[-1] = "s7"
    return place


def _trail(data: dict[str, Any], reading: Reading) -> Iterator[str]:
    """The changes of parameters: each of a request that says so, with what its response and an earlier one say."""
    told = set()
    for values in data["rows"]:
        row = dict(zip(data["row"], values, strict=True))
        deal, name = reading.by_id.get(row["id"]), f"p{row['pnu']}[{row['subindex']}]"
        told.add(row["id"])
        if deal is not None and deal.operation == "put":
            yield from _element(row, deal, data["outcomes"][row["outcome"]])
            continue
        if deal is None or deal.operation != "change":
            yield f"the change of {name} is none: #{row['id']}"
            continue
        if data["objects"][row["object"]][0] != deal.device:
            yield f"{name} of #{deal.id} was not written on {data['objects'][row['object']][0]}"
        if deal.state == "mismatch":
            continue  # its response is of another request
        found = [each for each in deal.plain["parameters"] if _covers(each, row)]
        outcome = data["outcomes"][row["outcome"]]
        if not found or outcome not in {_outcome(deal, each) for each in found}:
            yield f"{name} of #{deal.id} is not {outcome}"
        if row["new"] is not None and not any(_is_value(row["new"], each, row) for each in found):
            yield f"#{deal.id} did not write {row['new']} to {name}"
        if row["old_from"] and not _was(row, deal, reading):
            yield f"{name} was not {row['old']} in frame {abs(row['old_from'])}"
    written = {each.id for each in reading.deals if _writes(each)}
    if not written <= told:
        yield f"the trail lacks #{min(written - told)}"


def _element(row: dict[str, Any], deal: Deal, outcome: str) -> Iterator[str]:
    """The change of an element of a drive by S7: its data block, its address, its bytes and its return code."""
    outcomes = {None: "sent", 255: "accepted"}
    found = [
        each for each in deal.plain["items"]
        if each["area"] == "DB" and (each["db"], each["start"] % 1024) == (row["pnu"], row["subindex"])
        and outcomes.get(each["code"], "refused") == outcome
    ]  # fmt: skip
    if not found:
        yield f"#{deal.id} did not write index {row['subindex']} of DB{row['pnu']}, {outcome}"
    raw = [bytes.fromhex(each["value"] or "") for each in found]
    true = {str(int.from_bytes(each)) for each in raw}
    true |= {str(struct.unpack(">f", each)[0]) for each in raw if len(each) == 4}
    if row["new"] is not None and found and row["new"] not in true:
        yield f"#{deal.id} wrote {sorted(true)}, not {row['new']}"


def _covers(parameter: dict[str, Any], row: dict[str, Any]) -> bool:
    first, count = parameter["subindex"] or 0, max(parameter["element_count"] or 1, 1)
    own = (parameter["pnu"], parameter["attribute"]) == (row["pnu"], "value")
    width = max(count, len("".join(map(str, parameter["values"]))), len(parameter["values"]))
    return own and first <= row["subindex"] < first + width


def _outcome(deal: Deal, parameter: dict[str, Any]) -> str:
    if parameter["error"] is not None:
        return "negative"
    if deal.plain["status"]["write"] not in (None, "00000000"):
        return "refused"
    return "accepted" if deal.state == "ok" else "accepted" if _is_told(deal, parameter) else "sent"


def _is_told(deal: Deal, parameter: dict[str, Any]) -> bool:
    """Whether a response in part reaches as far as a parameter."""
    response = bytes.fromhex(deal.plain["bytes"]["response"] or "")
    place = deal.plain["parameters"].index(parameter)
    broken = {"DS106", "DS309", "DS313", "DS315"} & set(deal.plain["findings"])
    return deal.state == "partial" and not broken and len(response) > 3 and place < response[3]


def _on_the_wire(shown: str, form: str | None) -> str | None:
    """The value of `45.5 (DoubleWord 1110835200)`, in the format in brackets; None where these are other bits."""
    named = re.fullmatch(rf"(\S+) \({form}(?: (\d+))?\)", shown)
    if named is None or named[2] is None:
        return shown if named is None else named[1]
    size = {"Byte": 1, "Word": 2, "DoubleWord": 4}[form or ""]
    raw = int(named[2]).to_bytes(size)
    if not re.fullmatch(r"-?\d+", named[1]):
        return named[2] if struct.pack(">f", float(named[1])) == raw else None
    return named[2] if int(named[1]) % 256**size == int(named[2]) else None


def _is_value(told: str, parameter: dict[str, Any], row: dict[str, Any]) -> bool:
    values, at = parameter["values"], row["subindex"] - (parameter["subindex"] or 0)
    shown = _on_the_wire(told, parameter["format"])
    if shown is None:
        return False
    if not any(isinstance(each, str) for each in values):
        return at < len(values) and shown in (
            str(values[at]),
            f"{values[at]:.1f}",
            repr(values[at]),
        )
    return any(shown.strip('"') in str(each) for each in values) or "\\" in shown


def _was(row: dict[str, Any], deal: Deal, reading: Reading) -> bool:
    """Whether an earlier response read the old value, or accepted it."""
    frame = abs(row["old_from"])
    for each in reading.deals:
        wanted = "change" if row["old_from"] < 0 else "read"
        answered = each.read or max(each.all_frames, default=0)
        if (each.operation, each.device, answered) != (wanted, deal.device, frame):
            continue
        parameters = [item for item in each.plain["parameters"] if _covers(item, row)]
        if any(item["error"] is None and _is_value(row["old"], item, row) for item in parameters):
            return frame < min(deal.all_frames, default=0)
    return False


def _writes(deal: Deal) -> bool:
    named = (
        each["pnu"] is not None and each["attribute"] == "value"
        for each in deal.plain["parameters"]
    )
    fits = deal.operation == "change" and deal.state not in ("orphan", "mismatch")
    return fits and not deal.s7 and any(named)


def _rows(data: dict[str, Any], reading: Reading) -> Iterator[str]:
    place = {name: number for number, name in enumerate(data["row"])}
    if len(data["rows"]) != len(reading.deals):
        yield f"{len(data['rows'])} rows are {len(reading.deals)}"
    for row in data["rows"]:
        deal = reading.by_id.get(row[place["id"]])
        if deal is None:
            yield f"#{row[place['id']]} is no transaction"
            continue
        true = {
            "operation": data["operations"].index(deal.operation),
            "state": data["states"].index(deal.state),
            "controller": data["controllers"].index(deal.controller),
            "device": [each[0] for each in data["devices"]].index(deal.device),
            "channel": data["channels"].index(_channel(deal, reading)),
            "axis": deal.plain["axis"],
            "request": deal.plain["bytes"]["request"], "response": deal.plain["bytes"]["response"],
            "start": _microseconds(deal, reading),
            **{name: deal.frames[name] for name in ("write_request", "read_response")},
        }  # fmt: skip
        for name, value in true.items():
            if row[place[name]] != value:
                yield f"#{deal.id}: {name} {row[place[name]]} is {value}"
