"""The auditor of PROFIBUS: random lines, and the auditor itself against false numbers and words about stations."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from test_audit import lines_of_profibus, mutated
from test_lua_analysis import Source, compare
from tests.audit import cuts, dp, lines, pkw, reading, run, stations, wire
from tests.audit import seeds as many
from tests.audit.reading import Reading

LINES = 40


@pytest.mark.slow
def test_random_lines(tmp_path: Path) -> None:
    random = Random(7)
    for plan in (lines.planned(random) for _ in range(LINES)):
        assert list(map(str, many.of_plan(plan, tmp_path))) == [], plan.text()


def test_every_trouble_is_told_truly() -> None:
    item = reading.read(lines_of_profibus()[0])
    assert list(map(str, run.complaints(item))) == []


@pytest.mark.parametrize("kind", ["text", "page"])
@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ("frames 291,", "frames 290,"),
        ("damaged frames 2", "damaged frames 3"),
        ("PPO1", "PPO2"),
        ("300 ms", "301 ms"),
        ("144", "145"),
        ("1.8 ms (22.9 ms)", "1.9 ms (22.9 ms)"),
        ("1.8 ms (22.9 ms)", "1.8 ms (22.8 ms)"),
        ("2 (1)", "2 (2)"),
        ("master dp2", "master dp1"),
        ("06 81 00 00 AB 12", "06 81 00 00 AB 13"),
        ("watchdog is on; ", ""),
    ],
)
def test_a_false_word_about_stations_is_noticed(was: str, becomes: str, kind: str) -> None:
    item = reading.read(lines_of_profibus()[0])
    told = getattr(item, kind)
    at = told.index("PROFIBUS\n" if kind == "text" else '<section id="bus-')
    lie = copy.copy(item)
    assert was in told[at:]
    setattr(lie, kind, told[:at] + told[at:].replace(was, becomes, 1))
    assert list(map(str, run.complaints(item))) == []
    assert [each for each in run.complaints(lie) if each.rule == "bus"]


def numbers(plain: Any) -> Iterator[tuple[Any, Any]]:
    """Every place of a number, a word or nothing in the stations of a result: its container and its key."""
    keys = range(len(plain)) if isinstance(plain, list) else list(plain)
    for key in keys:
        if not isinstance(plain[key], (dict, list)):
            yield plain, key
        if isinstance(plain[key], (dict, list)):
            yield from numbers(plain[key])


def test_a_false_number_about_stations_is_noticed() -> None:
    item = reading.read(lines_of_profibus()[0])
    missed = []
    for number in range(len(list(numbers(item.plain["bus"])))):
        plain = copy.deepcopy(item.plain)
        inside, key = list(numbers(plain["bus"]))[number]
        inside[key] = next(mutated(inside[key]))
        lie = Reading(item.name, plain, item.capture)
        if not list(stations.check(lie)):
            missed.append((key, inside[key]))
    assert missed == []


def test_frames_of_profibus_are_taken_apart() -> None:
    def heard(text: str, length: int = 0) -> dp.Heard:
        data = bytes.fromhex(text)
        return dp.hear(wire.Frame(1, 0, data, length or len(data), 257))

    asked = heard("6813136883827d33335f002f0a030102011001c47f0000db16")
    assert (asked.da, asked.sa, asked.saps, asked.service) == (3, 2, (51, 51), "record")
    assert asked.du.hex() == "5f002f0a030102011001c47f0000"
    assert [heard(each).damage for each in ("e5", "dc0202", "10030249 4e16")] == ["", "", ""]
    assert heard("100302494f16").damage == "check"
    assert [heard(each).damage for each in ("", "e5e5", "dc0280", "6805", "100302494e17")] == [
        "other"
    ] * 5
    assert heard("6813136883", 25).damage == "cut"


def test_of_a_line_of_two_places_out_of_order_nobody_counts_repetitions(tmp_path: Path) -> None:
    plan = replace(
        lines.planned(Random("ret 2")), doubled=True, snap=None, back=False, loss=0.0, noise=0.0
    )
    many.play(plan).tape.write(tmp_path / "line.pcap")
    frames = reading.read(tmp_path / "line.pcap", text=False, page=False).capture.frames
    cuts.write(tmp_path / "cut.pcap", cuts.swapped(7)(frames))
    item = reading.read(tmp_path / "cut.pcap", page=False)
    assert item.line is not None
    assert item.line.doubled
    assert list(stations.check(item)) == []


def test_data_exchange_without_data_ends_a_pause(tmp_path: Path) -> None:
    plan = next(each for each in many.kept(many.WITH_HOLES) if each.seed == 5867366)
    many.play(plan).tape.write(tmp_path / "line.pcap")
    item = reading.read(tmp_path / "line.pcap", text=False, page=False)
    told = next(each for each in item.findings if each.rule == "DS110")
    first, last = told.args["first"], told.args["last"]
    assert item.capture.frames[last - 1].data.hex() == "1004015c6116"
    assert list(pkw.of_incomplete(told, item)) == []
    for wrong in ((first, last - 1), (last, last + 1), (last + 20, last + 30)):
        told.args["first"], told.args["last"] = wrong
        assert list(pkw.of_incomplete(told, item))


def test_a_request_before_an_open_one_displaces_it_not(tmp_path: Path) -> None:
    plan = next(each for each in many.kept(many.WITH_HOLES) if each.seed == 1340934)
    many.play(plan).tape.write(tmp_path / "line.pcap")
    frames = wire.read(tmp_path / "line.pcap").frames
    path = tmp_path / "cut.pcap"
    cuts.write(path, cuts.swapped(3)(frames))
    item = reading.read(path, text=False, page=False)
    told = [each for each in item.findings if (each.rule, each.frame) == ("DS110", 462)]
    assert [each.args["what"] for each in told] == ["line"]
    compare("5.4", "en", [Source("line", path.read_bytes(), False)], tmp_path)
