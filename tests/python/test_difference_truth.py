"""Every line that `ds47 diff` prints of a parameter, against the transactions of both JSON reports.

A second, naive reading: it shares no code with what it checks, and knows nothing but the text and the JSON.
"""

from __future__ import annotations

import itertools
import json
import random
import re
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from ds47.analysis import analyze
from ds47.regression.difference import difference
from ds47.regression.difference_report import lines
from ds47.report.json import capture as as_json

Json = dict[str, Any]
LOCAL = 0xB02E
GLOBAL = {964, 974, 976, 977, 978, 61000, 61001, 61002, 61003, 61004}
STRINGS = {"VisibleString": 1, "OctetString": 2, "BitString": 2, "OctetString_S": 2}
LINE = re.compile(
    r"  (?P<device>\S+(?: / \S+)?)(?: DO (?P<do>\d+))?(?: slot (?P<slot>\d+)\.(?P<subslot>\d+))?"
    r"(?: axis (?P<axis>\d+))?(?P<local> \(0xB02E\))?"
    r" (?:[pr]0*)?(?P<pnu>\d+)\[(?P<first>\d+)(?:\.\.(?P<last>\d+))?\]"
    r" (?P<operation>read|change)  A: (?P<a>.*); B: (?P<b>.*)"
)
VALUES = re.compile(r"(\d+) x(?: accepted)?(?:, (\d+) different values, the last)? :?=? ?(.*)")
SECTIONS = {
    "parameter elements that differ": "differ",
    "other negative responses, but to other requests": "requests",
    "the same last value in both; the failures are within chance": "sometimes",
    "requested in one capture only": "only",
    "requested in both captures, but read or changed in one only": "operation",
    "requested in other ways in the other capture": "way",
    "requested in both captures, but one does not show the outcome": "open",
}


def text_of(a: Json, b: Json) -> list[str]:
    return list(lines(difference(a, b, ("a", "b")), everything=True))


@cache
def report(path: Path) -> Json:
    return json.loads(json.dumps(as_json(analyze(path))))


# -- what a capture shows, read naively ---------------------------------------------------------------


def requests(capture: Json) -> list[tuple[Json, int, Json]]:
    """Transaction, position and parameter of all that was asked for; of a foreign response the request's."""
    found = []
    for item in capture["transactions"]:
        if item["state"] == "orphan":
            continue
        parameters = item["parameters"]
        if item["state"] == "mismatch":
            raw = bytes.fromhex(item["bytes"]["request"])
            parameters = [
                {
                    "attribute": "value" if raw[at] == 0x10 else "other",
                    "element_count": raw[at + 1],
                    "pnu": int.from_bytes(raw[at + 2 : at + 4]),
                    "subindex": int.from_bytes(raw[at + 4 : at + 6]),
                    "format": None,
                    "values": [],
                    "error": None,
                }
                for at in range(4, 4 + 6 * raw[3], 6)
            ]
        found += [(item, n, each) for n, each in enumerate(parameters)]
    return [row for row in found if row[2]["attribute"] == "value" and row[2]["pnu"] is not None]


def values_of(each: Json) -> list[Any]:
    asked = max(1, each["element_count"] or 0)
    width = STRINGS.get(each["format"] or "")
    if width is None:
        return each["values"][:asked]
    text = "".join(each["values"])
    return [text[at : at + width] for at in range(0, len(text), width)]


def covers(each: Json, subindex: int) -> bool:
    step = subindex - each["subindex"]
    strings = len(values_of(each)) if each["format"] in STRINGS else 0
    return 0 <= step < max(1, each["element_count"] or 0, strings)


def outcome(item: Json, position: int, each: Json, subindex: int) -> tuple[str, Any]:
    if each["error"]:
        return "negative", each["error"]["code"]
    if item["state"] == "refused":
        status = item["status"]
        return "refused", status["write"] if status["write"] != "00000000" else status["read"]
    values, step = values_of(each), subindex - each["subindex"]
    if step >= len(values) or item["state"] not in ("ok", "partial", "error"):
        return "open", None
    if item["operation"] == "change" and item["state"] != "ok":
        known = item["state"] == "partial" and position < int(item["bytes"]["response"][6:8], 16)
        cut = {"DS106", "DS309", "DS315"} & set(item["findings"])
        return ("value", values[step]) if known and not cut else ("open", None)
    return "value", values[step]


def refuses_axes(capture: Json) -> set[tuple[str, int]]:
    """Devices and axes of the negative response 0x19."""
    return {
        (item["device"], item["axis"])
        for item in capture["transactions"]
        for each in item["parameters"]
        if each["error"] and each["error"]["code"] == 0x19 and item["index"] != LOCAL
        if item["state"] not in ("mismatch", "orphan") and item["operation"] in ("read", "change")
    }


def do_ids(capture: Json) -> dict[tuple[str, int, int], set[int]]:
    """By device and submodule: what 975[7] says by local access."""
    found: dict[tuple[str, int, int], set[int]] = {}
    for item, position, each in requests(capture):
        if item["index"] == LOCAL and each["pnu"] == 975 and covers(each, 7):
            kind, value = outcome(item, position, each, 7)
            if kind == "value" and item["operation"] == "read":
                key = item["device"], item["slot"], item["subslot"]
                found.setdefault(key, set()).add(value)
    return found


class Side:
    """One capture, and what it shows of the parameters of a line."""

    def __init__(self, capture: Json, other: Json) -> None:
        self.all = requests(capture)
        self.refused_axes = refuses_axes(capture)
        self.do_ids = do_ids(capture)
        stations = {each["ip"]: each["station"] for each in other["devices"]}
        stations |= {each["ip"]: each["station"] for each in capture["devices"] if each["station"]}
        self.names = {item["device"]: stations.get(item["device"]) for item, _, _ in self.all}

    def is_named(self, device: str, ip: str) -> bool:
        return (self.names[ip] or ip) in device.split(" / ")

    def is_at(self, line: dict[str, str | None], item: Json) -> bool:
        """Whether a line speaks of the place that a request reaches."""
        assert line["device"]
        if not self.is_named(line["device"], item["device"]):
            return False
        if line["do"] is None and line["slot"] is None:
            assert int(line["pnu"] or 0) in GLOBAL
            return True
        local = item["index"] == LOCAL
        if line["do"] is None:
            there = (str(item["slot"]), str(item["subslot"]))
            axis = line["axis"] == (None if item["axis"] is None else str(item["axis"]))
            return (
                there == (line["slot"], line["subslot"])
                and local == bool(line["local"])
                and (local or axis)
            )
        number = int(line["do"])
        if local:
            key = item["device"], item["slot"], item["subslot"]
            return self.do_ids.get(key) == {number}
        if line["local"]:
            return False
        return item["axis"] == number

    def outcomes(self, line: dict[str, str | None], subindex: int) -> list[tuple[str, Any]]:
        return [
            outcome(item, position, each, subindex)
            for item, position, each in self.all
            if item["operation"] == line["operation"]
            and str(each["pnu"]) == line["pnu"]
            and covers(each, subindex)
            and self.is_at(line, item)
        ]

    def asked(self, line: dict[str, str | None], subindex: int) -> list[Json]:
        """All transactions that asked for that PNU and subindex at that device, by whatever way."""
        assert line["device"]
        return [
            item
            for item, _, each in self.all
            if str(each["pnu"]) == line["pnu"]
            and covers(each, subindex)
            and self.is_named(line["device"], item["device"])
        ]

    def distinguishes(self, device: str) -> bool:
        return any(ip == device for ip, _ in self.refused_axes)

    def is_elsewhere(self, line: dict[str, str | None], item: Json, other: Side) -> bool:
        """Whether a request certainly reached another drive object than that of the line."""
        here = int(line["do"] or line["axis"] or 0)
        if item["index"] == LOCAL:
            found = self.do_ids.get((item["device"], item["slot"], item["subslot"]), set())
            there = next(iter(found)) if len(found) == 1 else 0
        else:
            there = item["axis"] or 0
        looks = self.distinguishes(item["device"]) and all(
            other.distinguishes(ip) for ip in other.names
        )
        both_local = bool(line["local"]) and item["index"] == LOCAL
        return bool(here and there and here != there and (looks or both_local))


# -- what a line says ---------------------------------------------------------------------------------


def said(text: str) -> tuple[Counter[Any], dict[str, Any]]:
    """How often what came, and the values and how many of them differ, as one side of a line says it."""
    counts: Counter[Any] = Counter()
    about: dict[str, Any] = {}
    tail = r"(?:, )?(\d+) x (negative response 0x([0-9A-F]+)|refused, STATUS (\w+)|outcome not in the capture)"
    while found := None if text == "none" else last_match(tail, text):
        n, _, code, status = found.groups()
        key = (
            ("negative", int(code, 16))
            if code
            else ("refused", status)
            if status
            else ("open", None)
        )
        counts[key] += int(n)
        text = text[: found.start()]
    if text and text != "none":
        found = VALUES.fullmatch(text)
        assert found, text
        counts["value"] = int(found[1])
        about = {"different": int(found[2] or 1), "last": found[3]}
    return counts, about


def last_match(pattern: str, text: str) -> re.Match[str] | None:
    found = list(re.finditer(pattern, text))
    return found[-1] if found else None


def check_side(line: dict[str, str | None], side: Side, text: str, where: str) -> None:
    counts, about = said(text)
    first, last = int(line["first"] or 0), int(line["last"] or line["first"] or 0)
    lasts = []
    for subindex in range(first, last + 1):
        outcomes = side.outcomes(line, subindex)
        found = Counter("value" if kind == "value" else (kind, what) for kind, what in outcomes)
        assert found == counts, where
        values = [what for kind, what in outcomes if kind == "value"]
        if values:
            assert len(set(map(str, values))) == about["different"], where
            lasts.append(values[-1])
    if lasts:
        check_values(lasts, about["last"], where)


def check_values(values: list[Any], text: str, where: str) -> None:
    if text.startswith('"'):
        assert re.sub(r'" \(\w+\)$', '"', text) == '"' + "".join(values) + '"', where
        return
    plain = ", ".join(map(str, values))
    octets = "".join(map(str, values))
    cut = ", ".join(map(str, values[:8])) + f", ... ({len(values)} values)"
    begins = any(text == each or text.startswith(each + " ") for each in (plain, octets, cut))
    assert begins, (where, values)


def check(a: Json, b: Json, text: list[str]) -> Counter[str]:
    """Holds every line of a text against both reports; returns how many lines of each section there were."""
    sides = Side(a, b), Side(b, a)
    section, seen = "", Counter[str]()
    told: dict[str, set[tuple[str, ...]]] = {}
    for row in text:
        if not row.startswith("  "):
            section = next((SECTIONS[each] for each in SECTIONS if row.startswith(each)), "")
        elif section:
            found = LINE.fullmatch(row)
            assert found, row
            line = found.groupdict()
            seen[section] += 1
            for side, key in zip(sides, "ab", strict=True):
                check_side(line, side, line[key] or "", row)
            check_section(section, line, sides, row)
            where = tuple(
                str(line[key]) for key in ("device", "do", "slot", "subslot", "axis", "local")
            )
            last = int(line["last"] or line["first"] or 0)
            for subindex in range(int(line["first"] or 0), last + 1):
                key_ = (*where, str(line["pnu"]), str(subindex), str(line["operation"]))
                assert key_ not in told.setdefault("all", set()), f"told twice: {row}"
                told["all"].add(key_)
                told.setdefault(section, set()).add(key_)
    check_verdict(text, told.get("differ", set()))
    seen += check_conclusions(text, sides, told.get("differ", set()))
    check_nothing_is_left_out(sides, told)
    return seen


def check_section(
    section: str, line: dict[str, str | None], sides: tuple[Side, Side], row: str
) -> None:
    if section in ("differ", "requests", "sometimes", "open"):
        assert "none" not in (line["a"], line["b"]), row
        return
    assert (line["a"] == "none") != (line["b"] == "none"), row
    lacking, other = sides if line["a"] == "none" else sides[::-1]
    last = int(line["last"] or line["first"] or 0)
    for subindex in range(int(line["first"] or 0), last + 1):
        asked = lacking.asked(line, subindex)
        here = [item for item in asked if lacking.is_at(line, item)]
        if section == "operation":
            assert here, row
            assert all(item["operation"] != line["operation"] for item in here), row
        elif section == "way":
            assert asked, row
            assert not here, row
        else:
            assert all(lacking.is_elsewhere(line, item, other) for item in asked), row


def check_verdict(text: list[str], told: set[tuple[str, ...]]) -> None:
    verdict = text[3]
    different = len({each[:-1] for each in told})
    found = re.match(r"(\d+) of ([\d,]+) parameter elements", verdict)
    if different:
        assert found, verdict
        assert int(found[1]) == different, verdict
    else:
        assert verdict.startswith(("None of", "The one parameter", "No parameter")), verdict


CONCLUSION = re.compile(
    r"  (?P<device>\S+(?: / \S+)?)(?: DO (?P<do>\d+))?(?: slot (?P<slot>\d+)\.(?P<subslot>\d+))?"
    r"(?: axis (?P<axis>\d+))?(?P<local> \(0xB02E\))?: (?P<claim>[^:]+): (?P<parameters>.*)"
)
NAMED = re.compile(
    r"(?:[pr]0*)?(?P<pnu>\d+)\[(?P<first>\d+)(?:\.\.(?P<last>\d+))?\]"
    r" (?P<about>.*?)(?=, [pr]?\d+\[|, \d+ more elements?$|$)"
)
CLAIMS = {
    "changes that A shows accepted fail in B": ("change", True, False),
    "reads that brought a value in A fail in B": ("read", True, False),
    "changes that failed in A are accepted in B": ("change", False, True),
    "reads that failed in A bring a value in B": ("read", False, True),
    "the same requests (read) fail in both, in B with": ("read", False, False),
    "the same requests (change) fail in both, in B with": ("change", False, False),
}
"""The operation, and whether the same request had a value in A and in B."""
VALUE_CLAIMS = {
    "other values read": "read",
    "other values of parameters that the drive changes by itself": "read",
    "other values written": "change",
}
SHARE_CLAIM = re.compile(r"the same requests \(\w+\) fail (more|less) often in B \(failed/asked\)")


def check_conclusions(
    text: list[str], sides: tuple[Side, Side], differ: set[tuple[str, ...]]
) -> Counter[str]:
    """Each conclusion holds for each parameter that it names, and together they speak of all that differs."""
    if "what changed in B, the worst first:" not in text:
        assert not differ
        return Counter()
    seen: Counter[str] = Counter()
    start = text.index("what changed in B, the worst first:") + 1
    section = text[start : text.index("", start)]
    counted = 0
    for row in section:
        found = CONCLUSION.fullmatch(row)
        if found is None or "slower" in row or "quicker" in row or "status word" in row:
            assert found or re.fullmatch(r"  and \d+ more: see below", row), row
            continue
        line, claim = found.groupdict(), found["claim"]
        seen[claim] += 1
        for each in NAMED.finditer(found["parameters"]):
            first, last = int(each["first"]), int(each["last"] or each["first"])
            counted += last - first + 1
            for subindex in range(first, last + 1):
                check_conclusion(line | each.groupdict(), claim, subindex, sides, row)
        more = re.search(r", (\d+) more elements?$", found["parameters"])
        counted += int(more[1]) if more else 0
    if not re.match("  and ", section[-1]):
        assert counted == len(differ), "a row is in no conclusion, or in two"
    return seen


def check_conclusion(
    line: dict[str, str | None], claim: str, subindex: int, sides: tuple[Side, Side], row: str
) -> None:
    about = line["about"] or ""
    if claim in VALUE_CLAIMS:
        line["operation"] = VALUE_CLAIMS[claim]
        was, now = (
            [what for kind, what in side.outcomes(line, subindex) if kind == "value"][-1]
            for side in sides
        )
        assert was != now or str(was) in about, row
        if "[" in row and line["last"] is None and isinstance(now, int | float):
            assert about.startswith(f"{was} "), row
            assert f" -> {now}" in about, row
        return
    if share := SHARE_CLAIM.fullmatch(claim):
        numbers = re.fullmatch(r"([\d,]+)/([\d,]+) -> ([\d,]+)/([\d,]+)", about)
        assert numbers, row
        a, of_a, b, of_b = (int(each.replace(",", "")) for each in numbers.groups())
        assert (b / of_b > a / of_a) == (share[1] == "more"), row
        return
    line["operation"], in_a, in_b = CLAIMS[claim]
    failing = [
        (a if in_b else b) - {("value", None)}
        for a, b in same_requests(line, subindex, sides)
        if has_value(a) == in_a and has_value(b) == in_b
    ]
    codes = {what for each in failing for kind, what in each if kind == "negative"}
    assert failing, row
    assert {int(code, 16) for code in re.findall(r"0x([0-9A-F]+) ", about)} <= codes, row


def has_value(outcomes: set[tuple[str, Any]]) -> bool:
    return any(kind == "value" for kind, _ in outcomes)


def same_requests(
    line: dict[str, str | None], subindex: int, sides: tuple[Side, Side]
) -> Iterator[tuple[set[tuple[str, Any]], set[tuple[str, Any]]]]:
    """What came of each request for an element that both captures have, without what they do not show."""
    found: list[dict[Any, set[tuple[str, Any]]]] = []
    for side in sides:
        mine: dict[Any, set[tuple[str, Any]]] = {}
        for item, position, each in side.all:
            if (
                item["operation"] != line["operation"]
                or str(each["pnu"]) != line["pnu"]
                or not covers(each, subindex)
                or not side.is_at(line, item)
            ):
                continue
            kind, what = outcome(item, position, each, subindex)
            axis = None if item["index"] == LOCAL else item["axis"]
            key = (
                item["index"], item["slot"], item["subslot"], axis, each["subindex"], each["element_count"],
                *((each["format"], str(each["values"])) if item["operation"] == "change" else ()),
            )  # fmt: skip
            if kind != "open":
                mine.setdefault(key, set()).add((kind, None if kind == "value" else what))
        found.append(mine)
    return ((found[0][key], found[1][key]) for key in found[0].keys() & found[1].keys())


def check_nothing_is_left_out(
    sides: tuple[Side, Side], told: dict[str, set[tuple[str, ...]]]
) -> None:
    """Whatever the same request brought otherwise as its last value stands among what differs."""

    def lasts(side: Side) -> dict[tuple[Any, ...], tuple[Any, ...]]:
        found = {}
        for item, position, each in side.all:
            axis = None if item["index"] == LOCAL else item["axis"]
            if len(side.names) > 1 or item["operation"] not in ("read", "change"):
                continue
            for subindex in range(each["subindex"], each["subindex"] + 256):
                if not covers(each, subindex):
                    break
                kind, value = outcome(item, position, each, subindex)
                if kind == "value":
                    way = item["index"], item["slot"], item["subslot"], axis
                    key = (*way, each["pnu"], subindex, item["operation"])
                    found[key] = value, each["format"]
        return found

    mine, theirs = (lasts(side) for side in sides)
    differ = {(key[-3], key[-2], key[-1]) for key in told.get("differ", set())}
    by_element: dict[tuple[Any, ...], set[tuple[Any, ...]]] = {}
    for key in mine.keys() | theirs.keys():
        by_element.setdefault(key[4:], set()).add(key)
    for element, keys in by_element.items():
        if len(keys) > 1:
            continue  # by several ways: which one was the last is another question
        (key,) = keys
        if key in mine and key in theirs and mine[key][1] == theirs[key][1]:
            expected = mine[key][0] != theirs[key][0]
            as_text = tuple(map(str, element))
            assert not expected or as_text in differ, (element, mine[key], theirs[key])


# -- pairs of captures --------------------------------------------------------------------------------


@pytest.mark.parametrize("names", list(itertools.permutations(("o1", "o2", "o3"), 2)), ids="-".join)
def test_every_line_about_captures_of_real_stacks(shared: Path, names: tuple[str, str]) -> None:
    folder = shared / "captures" / "real-stacks"
    a, b = (report(next(folder.glob(f"{name}_*.pcapng"))) for name in names)
    seen = check(a, b, text_of(a, b))
    assert seen["open" if "o3" not in names else "only"]


@pytest.mark.slow
def test_every_line_about_stored_captures(captures: Path) -> None:
    paths = [
        *captures.glob("conversation-*.pcapng"),
        *captures.glob("diagnosis-*axis*.pcapng"),
        *captures.glob("diagnosis-wrong-*.pcapng"),
        *captures.glob("format-*.pcapng"),
        captures / "tour-machine.pcapng",
    ]
    all_ = [report(path) for path in sorted(paths)]
    seen: Counter[str] = Counter()
    pairs = list(itertools.permutations(all_, 2))
    for a, b in random.Random(1).sample(pairs, 500):
        seen += check(a, b, text_of(a, b))
    assert {"differ", "only", "operation", "open"} <= seen.keys(), seen


def changed(capture: Json, chance: random.Random) -> Json:
    """A capture with some transactions left out, some values, negative responses and ways changed."""
    copy = deepcopy(capture)
    copy["transactions"] = [item for item in copy["transactions"] if chance.random() > 0.2]
    for item in copy["transactions"]:
        if chance.random() < 0.1:
            item["index"] = chance.choice((47, 0xB02E, 0xB02F))
        if chance.random() < 0.05 and item["axis"] is not None:
            item["axis"] = chance.randrange(4)
        for each in item["parameters"]:
            if each["values"] and isinstance(each["values"][0], int) and chance.random() < 0.2:
                each["values"][0] = chance.randrange(3)
            if each["error"] and chance.random() < 0.3:
                each["error"]["code"] = chance.choice((0x00, 0x01, 0x19, 0x6B))
            elif item["operation"] == "read" and item["state"] == "ok" and chance.random() < 0.1:
                each |= {"values": [], "error": {"code": 0x11, "text": "state", "info": None}}
    return copy


@pytest.mark.slow
def test_every_line_about_captures_that_differ_at_random(captures: Path) -> None:
    chance = random.Random(1)
    seen: Counter[str] = Counter()
    for path in sorted((captures / "real-stacks").glob("*.pcapng")) * 10:
        one = report(path)
        a, b = changed(one, chance), changed(one, chance)
        seen += check(a, b, text_of(a, b))
    assert seen["differ"], seen
    assert seen["only"], seen
    assert seen["other values read"], seen
    assert seen["reads that brought a value in A fail in B"], seen
    assert seen["reads that failed in A bring a value in B"], seen
