"""What values mean beside those of the profile: enumerations, connections, buffers, texts of users' lists."""

from __future__ import annotations

import json
import random
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lua_program import LUAS, lua_program

from ds47 import spec
from ds47.model import Described, Parameter, Value
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedMessage, ListedParameter, ParameterList
from ds47.parameters.naming import explain
from ds47.report import contract, values
from ds47.report import json as report_json
from ds47.report.contract import PARAMETER
from ds47.report.formatting import parameter

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "tests" / "lua" / "value_meanings.lua"
EMPTY = [0] * 8


def of(
    pnu: int, given: list[Value], subindex: int = 0, format_name: str = "Unsigned16", **more: Any
) -> Parameter:
    row = spec.parameter(pnu, more.pop("family", "sinamics"))
    return Parameter(
        pnu, subindex, "value", len(given), row, None, format_name, len(given), given, **more
    )


SAID = [
    (300, [1], "induction motor", "异步电机"),
    (300, [1, 2, 77], "induction motor, synchronous motor, 77", "异步电机，同步电机，77"),
    (300, [77], None, None),
    (300, [1] * 9, None, None),
    (10, [1], "quick commissioning", "快速调试"),
    (1115, [0], "basic", "基本型"),
    (840, [0x02D2FC02], "from r0722.2, Digital inputs, state", "来自 r0722.2，数字量输入状态"),
    (1070, [0x0802FC01], "from r2050[1], PZD received, words", "来自 r2050[1]，接收的 PZD，字"),
    (840, [0x1F40FC03], "from 8000.3", "来自 8000.3"),
    (840, [0x02D20802], None, None),  # of another drive object
    (840, [1], None, None),  # a constant
    (840, [0x02D2FC02, 0x02D2FC03], None, None),
    (945, EMPTY, "no active fault", "无当前故障"),
    (945, [0], "no active fault", "无当前故障"),
    (945, [7900, 30001, *[0] * 6], "active: 7900, 30001", "当前：7900，30001"),
    (945, [*EMPTY, 7900, *[0] * 7, 7901], "no active fault; acknowledged situation 1: 7900; "
     "acknowledged situation 2: 7901", "无当前故障；已应答的第 1 次故障事件：7900；已应答的第 2 次故障事件：7901"),
    (2122, [7991, *[0] * 7, 7920, 7921, *[0] * 6, 7922], "active: 7991; gone: 7920, 7921, 7922",
     "当前：7991；已消失：7920，7921，7922"),
    (2122, EMPTY, "no active alarm", "无当前报警"),
    (949, [0, 5, *[0] * 7, 3], "active: 5; acknowledged situation 1: 3", "当前：5；已应答的第 1 次故障事件：3"),
    (949, EMPTY, None, None),  # a fault may have the value 0
    (948, [1234, *[0] * 7], "active: 1234", "当前：1234"),
    (722, [5], None, None),
]  # fmt: skip


@pytest.mark.parametrize(("pnu", "given", "en", "zh"), SAID)
def test_what_is_said(pnu: int, given: list[Value], en: str | None, zh: str | None) -> None:
    found = values.meaning(of(pnu, given))
    assert (found and found.en, found and found.zh) == (en, zh)


def test_a_part_of_a_buffer_says_of_the_rest_nothing() -> None:
    assert values.meaning(of(945, EMPTY, 8)) is None
    found = values.meaning(of(945, [7900], 9))
    assert found is not None
    assert found.en == "acknowledged situation 1: 7900"


@pytest.mark.parametrize("family", ["micromaster", "profile"])
def test_other_drives_have_other_buffers_and_values(family: str) -> None:
    for pnu, given, _, _ in SAID:
        assert values.meaning(of(pnu, given, family=family)) is None


def test_no_number_is_a_text_where_it_is_none() -> None:
    assert values.meaning(of(300, [1.0], format_name="Float32")) is None
    assert values.meaning(of(300, ["NaN"], format_name="Float32")) is None
    item = of(300, [1])
    item.attribute = "description"
    assert values.meaning(item) is None


def listed() -> Catalogue:
    rows = [
        ListedParameter(300, "Motor", None, None, None, {1: "Asynchron", 5: "eigener\x1b"}),
        ListedParameter(777, "Mode", None, None, None, {3: "auto"}),
    ]
    messages = [
        ListedMessage("A", 7900, "wrong letter"),
        ListedMessage("F", 7900, "Motor blocked"),
        ListedMessage("C", 1711, "defect"),
    ]
    return Catalogue([ParameterList("own", vendor_id=0x002A, rows=rows, messages=messages)])


@pytest.mark.parametrize(
    ("pnu", "given", "said"),
    [
        (300, [1], "Asynchron"), (300, [5], r"eigener\x1b"), (300, [2], "synchronous motor"), (777, [3], "auto"),
        (777, [4], None), (945, [7900, 7901], "active: F07900 Motor blocked, 7901"),
        (945, [1711], "active: C01711 defect"), (2122, [7900], "active: A07900 wrong letter"),
        (2131, [7900], "F07900 Motor blocked"), (2131, [0], None), (1120, [7900], None),
    ],
)  # fmt: skip
def test_lists_of_a_user_come_first(pnu: int, given: list[Value], said: str | None) -> None:
    item = of(pnu, given)
    from types import SimpleNamespace

    explain(SimpleNamespace(parameters=[item]), listed(), 0x002A, None)  # type: ignore[arg-type]
    found = values.meaning(item)
    assert (found and found.en) == said
    line = parameter(item, written=False)
    assert line.endswith(f" ({said})") == (said is not None)
    item = of(pnu, given)
    explain(SimpleNamespace(parameters=[item]), listed(), 0x0042, None)  # type: ignore[arg-type]
    assert item.value_texts is None


def test_json_says_it_and_keeps_what_lists_say() -> None:
    for item in (
        of(300, [1]),
        of(840, [0x02D2FC02]),
        of(777, [3], value_texts={3: "auto"}, described=Described("Mode", ())),
    ):
        for lang in ("en", "zh"):
            found = values.meaning(item)
            assert found is not None
            plain = PARAMETER.plain(item, lang)
            assert plain["meaning"] == found.text(lang)
            assert json.loads(report_json._parameters([item], lang)) == [plain]
            again = contract.PARAMETER.load(plain, 0x002A)
            assert values.meaning(again) in (found, (found.text(lang),) * 2)
            assert PARAMETER.plain(again, lang) == plain
    assert "meaning" not in PARAMETER.plain(of(722, [1]), "en")


@pytest.mark.parametrize("lua", LUAS)
def test_both_say_the_same(lua: str) -> None:
    chance = random.Random(4)
    numbers = [
        (pnu, family)
        for pnu, rows in spec.parameters().items()
        for family in ("sinamics", "micromaster")
        if rows
    ]
    cases = []
    items = []
    for _ in range(3000):
        pnu, family = chance.choice([*numbers, *[(pnu, "sinamics") for pnu, *_ in SAID] * 20])
        row = spec.parameter(pnu, family)
        known = [
            *(row.values_en if row is not None else ()),
            0,
            1,
            2,
            7900,
            0x02D2FC02,
            0x02D20802,
            0xFFFFFFFF,
            -1,
        ]
        given = [chance.choice(known) for _ in range(chance.choice([1, 1, 1, 2, 3, 8, 9, 17]))]
        told = {1: "one\x1b", 7900: "F07900 x"} if chance.random() < 0.2 else None
        kind = chance.choice(["Unsigned32", "Unsigned16", "Integer16", "Float32"])
        numbers_ = [float(each) for each in given] if kind == "Float32" else given
        item = of(
            pnu,
            list(numbers_),
            chance.choice([0, 0, 1, 8, 9]),
            kind,
            family=family,
            value_texts=told,
        )
        items.append(item)
        cases.append({"pnu": pnu, "family": family, "values": given, "subindex": item.subindex, "format": kind,
                      "value_texts": [[key, text] for key, text in (told or {}).items()]})  # fmt: skip
    result = subprocess.run(
        [lua_program(lua), str(PROGRAM)], input="\n".join(map(json.dumps, cases)), capture_output=True,
        encoding="utf-8", check=True,
    )  # fmt: skip
    told_ = [json.loads(line) for line in result.stdout.splitlines()]
    assert len(told_) == len(items)
    assert any(each["en"] for each in told_)
    for item, told_one, case in zip(items, told_, cases, strict=True):
        found = values.meaning(item)
        assert (told_one["en"], told_one["zh"]) == (found and found.en, found and found.zh), case
