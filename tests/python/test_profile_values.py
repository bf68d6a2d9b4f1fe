"""What values of profile parameters mean, in words; and that the plugin says the same."""

from __future__ import annotations

from typing import Any

import pytest
from test_lua_report import Run, job, lua, timed

from ds47.model import CaptureResult, Parameter
from ds47.report.formatting import parameter
from ds47.report.values import meaning

__all__ = ["lua"]  # the fixture
MEANT = [
    (964, 0, "Unsigned16", [0x2A, 5300, 4700, 2014, 1503, 1],
     "manufacturer 0x002A, device type 5300, version 47.00, 2014-03-15, 1 drive object"),
    (964, 2, "Unsigned16", [470, 2014], "version 4.70"),
    (964, 3, "Unsigned16", [2014, 3113], None),
    (964, 5, "Unsigned16", [3], "3 drive objects"),
    (975, 0, "Unsigned16", [0x1A, 12, 100, 2020, 3112, 1, 1, 2],
     "manufacturer 0x001A, DO type 12, version 1.00, 2020-12-31, axis, DO-ID 2"),
    (975, 5, "Unsigned16", [5], "encoder"),
    (974, 0, "Unsigned16", [240, 39, 100],
     "blocks of up to 240 bytes, up to 39 parameters in a request, response within 1,000 ms"),
    (974, 1, "Unsigned16", [1, 0], "up to 1 parameter in a request"),
    (965, 0, "OctetString2", ["0329"], "PROFIdrive 4.1"),
    (965, 0, "OctetString", ["3d2a"], "encoder profile 4.2"),
    (965, 0, "Unsigned16", [0x0329], "PROFIdrive 4.1"),
    (965, 0, "Unsigned8", [3, 42], "PROFIdrive 4.2"),
    (965, 0, "Unsigned16", [0x0529], None),
    (965, 0, "OctetString", ["03293d"], None),
    (922, 0, "Unsigned16", [1], "standard telegram 1: STW1 NSOLL_A / ZSW1 NIST_A"),
    (922, 0, "Unsigned16", [98], "standard telegram 98"),
    (922, 0, "Unsigned16", [888], "manufacturer's telegram 888"),
    (922, 0, "Unsigned16", [390], "manufacturer's telegram 390"),
    (922, 0, "Unsigned16", [391], "manufacturer's telegram 391"),
    (922, 0, "Unsigned16", [999], None),
    (922, 0, "Unsigned16", [0], None),
    (922, 0, "Float32", [1.5], None),
    (61000, 0, "OctetString", ["70726573732d3100"], '"press-1"'),
    (61000, 0, "OctetString", ["00"], None),
    (61000, 0, "OctetString", ["0a41"], None),
    (61001, 0, "OctetString4", ["c0a88521"], "192.168.133.33"),
    (61002, 0, "OctetString", ["001ff8000001"], "00:1f:f8:00:00:01"),
    (61003, 0, "OctetString4", ["c0a88501"], "192.168.133.1"),
    (61004, 0, "OctetString4", ["ffffff00"], "255.255.255.0"),
    (61001, 0, "OctetString", ["c0a885"], None),
    (61001, 0, "Unsigned32", [3232269601], None),
    (60000, 0, "Float32", [1.0], None),
    (945, 0, "Unsigned16", [7900], None),
]  # fmt: skip


def of(pnu: int, subindex: int, format_name: str, values: list[Any], **about: Any) -> Parameter:
    known = {"attribute": "value", "element_count": len(values)} | about
    return Parameter(
        pnu, subindex, known["attribute"], known["element_count"], format=format_name,
        value_count=len(values), values=values, family=known.get("family"),
    )  # fmt: skip


@pytest.mark.parametrize(("pnu", "subindex", "format_name", "values", "meant"), MEANT)
def test_what_a_value_means(pnu, subindex, format_name, values, meant):
    told = meaning(of(pnu, subindex, format_name, values))
    assert (told and told.en) == meant


OWN = [
    ("sinamics", 390, "manufacturer's telegram 390: CU_STW1 A_DIGITAL / CU_ZSW1 E_DIGITAL"),
    ("micromaster", 353, "manufacturer's telegram 353: STW1 NSOLL_A / ZSW1 NIST_A_GLATT"),
    ("profile", 353, "manufacturer's telegram 353"),
    ("sinamics", 391, "manufacturer's telegram 391"),
    ("profile", 7, "standard telegram 7: STW1 SATZANW / ZSW1 AKTSATZ"),
]


def owned() -> list[Parameter]:
    return [of(922, 0, "Unsigned16", [number], family=family) for family, number, _ in OWN]


def test_a_number_of_a_maker_has_words_on_its_drives_alone() -> None:
    told = [meaning(each) for each in owned()]
    assert [each and each.en for each in told] == [row[2] for row in OWN]


def test_it_stands_behind_the_values():
    item = of(965, 0, "OctetString2", ["0329"])
    assert parameter(item, written=False) == "r0965[0] = 0329 (PROFIdrive 4.1)"
    assert parameter(item, written=False, lang="zh") == "r0965[0] = 0329（PROFIdrive 4.1）"


@pytest.mark.parametrize("attribute", ["description", "text", None])
def test_a_description_is_no_value(attribute):
    assert meaning(of(964, 0, "Unsigned16", [42], attribute=attribute)) is None


def test_what_no_request_names_means_nothing():
    assert meaning(Parameter(None, None, None, None, values=[42])) is None


@pytest.mark.parametrize("lang", ["en", "zh"])
def test_the_plugin_says_the_same(lua: Run, lang: str) -> None:
    parameters = [*(of(*row[:4]) for row in MEANT), *owned()]
    result = CaptureResult("values.pcapng", transactions=[timed(1, 12, parameters=parameters)])
    (told,) = lua([job("parameters", result, lang=lang)])
    assert told.splitlines() == [parameter(each, False, lang) for each in parameters]
    if lang == "en":
        for row in MEANT:
            assert row[4] is None or f"({row[4]})" in told
