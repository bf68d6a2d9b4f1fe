"""The table of telegrams, what `ds47 explain` says of them, and which of them a channel may have."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from test_lua_analysis import VERSIONS, Source, compare
from tests.audit import run

from ds47 import spec
from ds47.analysis import analyze
from ds47.cli import main
from ds47.cyclic.closeup import closeup
from ds47.cyclic.pzd import REVERSE
from ds47.cyclic.relations import fitting_telegrams
from ds47.explain import UnknownFormError, explain
from ds47.lab import captured
from ds47.lab.client import Client, drive
from ds47.lab.cyclic import INPUT, OUTPUT, Cyclic, LabModule
from ds47.lab.drive import LabDrive
from ds47.lab.machine import ACKNOWLEDGE, OFF, ON, Machine
from ds47.lab.stage import Stage
from ds47.spec import cyclic, explanations

SIEMENS, OTHER = 0x002A, 0x0493
PRINTED = {
    1: (2, 2), 2: (4, 4), 3: (5, 9), 4: (6, 14), 5: (9, 9), 6: (10, 14), 7: (2, 2), 9: (10, 5), 20: (2, 6),
    30: (1, 1), 31: (2, 2), 81: (2, 6), 82: (2, 7), 83: (2, 8), 84: (2, 10), 102: (6, 10), 103: (7, 15),
    105: (10, 10), 106: (11, 15), 111: (12, 12), 112: (17, 12), 116: (11, 19), 350: (4, 4), 352: (6, 6),
    353: (2, 2), 354: (6, 6), 370: (1, 1), 390: (2, 2), 391: (3, 7), 392: (3, 15), 700: (0, 3), 701: (2, 5),
    750: (3, 1), 900: (2, 2), 901: (3, 5), 902: (3, 6), 903: (3, 5),
}  # fmt: skip
"""Words out and in, counted in the tables that the sources print."""
WORDLESS = (
    86,
    88,
    89,
    110,
    118,
    125,
    126,
    136,
    138,
    139,
    146,
    148,
    166,
    220,
    371,
    393,
    394,
    395,
    999,
)
"""Telegrams that a source names without their words."""
CONTROL_UNIT, SPEED = LabModule(3, 1, 4), LabModule(2, 2, 4)
POSITIONER, LONG = LabModule(2, 2, 10, out=20), LabModule(2, 2, 12)
"""Telegrams 390, 1, 9, and one that only Siemens has: 352."""


# The table


def test_lengths_are_those_that_the_sources_print() -> None:
    found = {
        number: tuple(each // 2 for each in row.sizes)
        for number, row in cyclic.telegrams().items()
        if row.out or row.inward
    }
    assert found == PRINTED
    assert sorted(cyclic.telegrams()) == sorted((*PRINTED, *WORDLESS))


@pytest.mark.parametrize("number", cyclic.telegrams())
def test_a_telegram_is_told_with_its_words_in_both_languages(number: int) -> None:
    row = cyclic.telegrams()[number]
    assert row.sources
    assert row.en != row.zh
    assert (row.vendor is None) == (number < 100)
    for each in (*row.out, *row.inward):
        told = [cyclic.telegram_word(each, lang) for lang in ("en", "zh")]
        assert all(told) == (each != "-"), each
        assert told[0] != told[1] or each == "-"
    if row.is_of_drive:
        assert row.inward[0] == "ZSW1"


def test_the_words_and_bits_of_the_table_are_used() -> None:
    table = spec._load("telegrams.toml")
    used = [row.out + row.inward for row in cyclic.telegrams().values()]
    assert set(table["words"]) == {cyclic.bare(each) for row in used for each in row} - {"-"}
    assert set(table["sources"]) == {each for row in table["telegram"] for each in row["sources"]}
    assert cyclic.bit_words() == ("stw1", "zsw1", "e_stw1", "e_zsw1", "cu_stw1", "cu_zsw1")
    for word in cyclic.bit_words():
        places = [row.bit for row in cyclic.bits(word)]
        assert places == sorted(set(places))
        assert set(places) <= set(range(16))


# ds47 explain


def test_a_telegram_in_full(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "telegram", "390"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Telegram 390 of SINAMICS: control unit with digital inputs and outputs"
    assert lines[1].split(maxsplit=2)[2] == (
        "1 CU_STW1 control word of the control unit · 2 A_DIGITAL digital outputs"
    )
    assert lines[2].split(maxsplit=2)[2] == (
        "1 CU_ZSW1 status word of the control unit · 2 E_DIGITAL digital inputs"
    )
    assert lines[3].startswith("  Read in     Siemens TIA Portal")
    assert "ds47 explain cu_stw1 0400" in "\n".join(lines)


@pytest.mark.parametrize("text", ["telegram 105", "tgm 105", "Telegramm 105", "报文105", "TLG=105"])
def test_a_telegram_in_any_form(text: str) -> None:
    (found,) = explain(text)
    assert found.title.startswith("Telegram 105 of SINAMICS: speed, 32 bits")
    assert [each.name for each in found.parts if each.value == "XERR"] == ["out 7-8"]
    assert found.plugin_filter == "ds47.pzd.telegram == 105"


@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("number", cyclic.telegrams())
def test_each_telegram_is_explained(number: int, lang: str) -> None:
    (found,) = explain(f"telegram {number}", lang)
    row = cyclic.telegrams()[number]
    assert found.known
    assert found.title.endswith(row.text(lang))
    told = [each.value for each in found.parts if each.name != "source"]
    assert told == [cyclic.bare(each) for each in (*row.out, *row.inward)]
    assert [each.text for each in found.parts if each.name == "source"] == list(row.sources)
    if not row.is_known:
        assert found.advice


def test_words_without_a_proved_place_have_none() -> None:
    (found,) = explain("telegram 391")
    assert {each.name for each in found.parts} == {"out", "in", "source"}
    assert found.advice == explanations.words("en")["telegram_unordered"]


@pytest.mark.parametrize(
    ("number", "near", "own"), [(397, "392, 393, 394, 395", True), (12, "5, 6, 7, 9", False)]
)
def test_an_unknown_telegram_has_neighbours(number: int, near: str, own: bool) -> None:
    (found,) = explain(f"telegram {number}")
    assert not found.known
    assert found.advice == f"Near ones: {near}."
    assert ("each maker" in found.title) == own


@pytest.mark.parametrize("text", ["telegram", "telegram x", "telegram 99999", "telegram -1"])
def test_what_is_no_number_of_a_telegram(text: str) -> None:
    with pytest.raises(UnknownFormError):
        explain(text)


@pytest.mark.parametrize(
    ("text", "bits"),
    [
        ("cu_stw1 0481", "0 7 10"), ("cu_zsw1 16#0E08", "3 9 10 11"), ("cu_zsw1 0", "9 10 11"),
        ("e_stw1 16#040B", "0 1 3 10"), ("a_zsw1 1A17", "0 1 2 4 9 11 12"),
    ],
)  # fmt: skip
def test_words_of_control_units_and_infeeds(text: str, bits: str) -> None:
    (found,) = explain(text)
    assert found.kind == text.split()[0].replace("a_", "e_")
    assert " ".join(each.value for each in found.parts if each.text) == bits


def test_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "telegram 370", "-f", "json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["meanings"]
    assert (found["kind"], found["code"], found["vendor"]) == ("telegram", "370", "SINAMICS")


# Channels


@pytest.mark.parametrize(
    ("lengths", "maker", "expected"),
    [
        ((4, 4), SIEMENS, (1, 7)), ((4, 4), OTHER, (1, 7)), ((12, 12), SIEMENS, (352,)), ((12, 12), OTHER, ()),
        ((12, 12), None, ()), ((20, 10), OTHER, (9,)), ((18, 18), None, (5,)), ((34, 24), SIEMENS, (112,)),
        ((22, 30), SIEMENS, (106,)), ((22, 38), SIEMENS, (116,)), ((4, 12), SIEMENS, (20,)),
    ],
)  # fmt: skip
def test_only_its_maker_has_a_number_above_those_of_the_profile(
    lengths: tuple[int, int], maker: int | None, expected: tuple[int, ...]
) -> None:
    """81 has the lengths of 20, and 390 those of 1: their first word is not that of a drive."""
    assert fitting_telegrams([lengths], maker, pkw=False) == expected


def with_control_unit() -> bytes:
    """A drive that runs, and the control unit beside it with signs of life and a fault that is acknowledged."""
    stage = Stage()
    line, axis = Cyclic(Client(stage), (CONTROL_UNIT, SPEED), reduction=16), LabDrive()
    line.connect()
    for cycle in range(400):
        life, control = (cycle % 15 + 1) << 12, OFF if cycle < 20 or cycle > 300 else ON
        fails = 100 < cycle < 200
        acknowledged = 0x80 if 190 < cycle < 200 else 0
        line.say(CONTROL_UNIT, OUTPUT, struct.pack(">HH", life | 0x0400 | acknowledged, 0x0100))
        line.say(CONTROL_UNIT, INPUT, struct.pack(">HH", life | (0x0A08 if fails else 0x0E00), 3))
        line.say(SPEED, OUTPUT, struct.pack(">Hh", control, 0x2000))
        line.cycle()
        line.say(SPEED, INPUT, struct.pack(">Hh", *axis.step(control, 0x2000, 0.016)))
    return captured(stage)


def positioner() -> bytes:
    """A drive with telegram 9 goes to traversing block 3."""
    stage = Stage()
    machine = Machine(Cyclic(Client(stage), (POSITIONER,), reduction=16), raw=3).connect()
    machine.control(OFF).run(0.3).control(ON).run(2).control(OFF).run(0.5)
    return captured(stage)


def of_another_maker() -> bytes:
    """A drive with the lengths of telegram 352, which is none of its maker's, trips."""
    stage = Stage()
    machine = Machine(Cyclic(Client(stage, device=drive(vendor_id=OTHER)), (LONG,), reduction=16))
    machine.connect().start()
    machine.drive.fault = 30002
    machine.run(0.5).control(OFF).run(0.2).control(ACKNOWLEDGE).run(0.2).control(OFF).run(0.5)
    machine.control(OFF | 1 << REVERSE).run(0.2).control(OFF).run(0.2)
    return captured(stage)


def turned(vendor_id: int) -> bytes:
    """A drive runs at 30 %, with bit 11 of STW1 set all the time."""
    stage = Stage()
    machine = Machine(
        Cyclic(Client(stage, device=drive(vendor_id=vendor_id)), (SPEED,), reduction=16)
    )
    machine.connect().control(OFF | 1 << REVERSE).run(0.2).setpoint(30)
    machine.control(ON | 1 << REVERSE).run(1).control(OFF | 1 << REVERSE).run(1)
    return captured(stage)


CONVERSATIONS = (with_control_unit, positioner, of_another_maker)


def sources() -> list[Source]:
    return [Source(each.__name__, each(), False) for each in CONVERSATIONS]


def test_a_control_unit_is_no_drive() -> None:
    result = analyze(sources()[0].open())
    assert [(each.slot, each.telegrams, each.certainty) for each in result.relations] == [
        (2, [1], "seen")
    ]
    assert len(result.timelines) == 1
    assert result.findings == []


def test_a_positioner_has_no_speed_behind_its_control_word() -> None:
    result = analyze(sources()[1].open())
    (relation,) = result.relations
    assert (relation.telegrams, relation.output.length, relation.input.length) == ([9], 20, 10)
    names = {each.name for each in result.timelines[0].events}
    assert {"on", "running", "off1"} <= names
    assert not names & {each.id for each in cyclic.edges("stw1") if each.speed}


def test_another_makers_drive_has_no_words_of_siemens() -> None:
    result = analyze(sources()[2].open())
    assert [(each.telegrams, each.certainty) for each in result.relations] == [([], "seen")]
    (fault,) = [each for each in result.findings if each.rule == "DS520"]
    assert fault.args["code"] is None
    names = {each.name for each in result.timelines[0].events}
    assert "fault" in names
    assert not names & {"reverse", "forward"}  # what its bit 11 does its manual says


@pytest.mark.parametrize(("vendor_id", "sign"), [(SIEMENS, -1), (OTHER, 1)])
def test_the_sign_of_a_setpoint_is_turned_by_bit_11_on_drives_of_siemens_alone(
    vendor_id: int, sign: int, tmp_path: Path
) -> None:
    path = tmp_path / "turned.pcapng"
    path.write_bytes(turned(vendor_id))
    result = analyze(path)
    (timeline,) = result.timelines
    furthest = max((each.most for each in timeline.setpoint), key=abs)
    assert furthest == sign * round(0.3 * 0x4000)
    (relation,) = result.relations
    frame = timeline.events[-1].frame
    seen = closeup(str(path), relation, frame, 10**9, others=vendor_id == OTHER)
    assert {each.raw for each in seen if each.by_controller} <= {0, furthest}
    assert any(each.raw for each in seen if each.by_controller)
    compare(VERSIONS[-1], "en", [Source("turned", path.read_bytes(), False)], tmp_path)
    assert run.audit(path) == []


@pytest.mark.parametrize(
    ("vendor", "words"),
    [
        ("", "bit 11 = 1 direction reversal (depends on the drive)"),
        ("--vendor sinamics", "setpoint 50 % of p2000, sign turned by STW1 bit 11"),
        ("--vendor abb", "bit 11 = 1 see the manual of the drive"),
        ("--vendor 0x7ABC", "setpoint 50 % of p2000 (16#2000"),
    ],
)
def test_decode_knows_whose_bits_they_are(
    vendor: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["decode", "--as", "stw1", "0C7F2000", *vendor.split()]) == 0
    assert words in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("stw1 0C7F --vendor abb", "11 see the manual of the drive"),
        ("stw1 0C7F", "11 direction reversal (depends on the drive)"),
        ("zsw1 FB31 --vendor lenze --lang zh", "15 见驱动器手册"),
    ],
)
def test_explain_knows_whose_bits_they_are(
    code: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", *code.split()]) == 0
    assert words in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_lua_says_the_same(lang: str, tmp_path: Path) -> None:
    compare(VERSIONS[-1], lang, sources(), tmp_path)
