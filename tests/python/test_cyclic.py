"""The words of cyclic frames, PKW and PZD, in both implementations (docs/cyclic.md 2 and 3).

What is expected stands in tests/vectors/cyclic.json, typed from printed telegrams; Lua has to say what Python
says, for each of them and for random words. The commands are in test_cyclic_commands.
"""

from __future__ import annotations

import json
import random
import struct
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lua_program import LUAS, lua_program

from ds47.cyclic import pkw, pzd
from ds47.cyclic.notation import encode_line
from ds47.explain.forms import word_values
from ds47.report import cyclic as shown
from ds47.spec import cyclic as spec

ROOT = Path(__file__).resolve().parents[2]
VECTORS = json.loads((ROOT / "tests/vectors/cyclic.json").read_text("utf-8"))
DRIVER = ROOT / "tests/lua/cyclic.lua"
Question = dict[str, Any]


# What is printed


def _pwe(item: pkw.PkwMessage) -> bytes:
    return struct.pack(">HH", item.pwe1, item.pwe2)


@pytest.mark.parametrize("vector", VECTORS["pkw"], ids=lambda vector: str(vector["id"]))
def test_a_printed_telegram(vector: dict[str, Any]) -> None:
    expected = vector["expect"]
    message = pkw.decode(bytes.fromhex(vector["hex"]), vector["answer"], expected["layout"])
    document = shown.pkw_document(message)
    error = document["error"]
    document["error"] = None if error is None else error["code"]
    assert {key: document[key] for key in expected} == expected


@pytest.mark.parametrize(
    "vector", [each for each in VECTORS["pkw"] if not each["answer"]], ids=lambda vector: str(vector["id"])
)  # fmt: skip
def test_a_printed_request_is_encoded_again(vector: dict[str, Any]) -> None:
    data = bytes.fromhex(vector["hex"])
    item = pkw.decode(data, False, vector["expect"]["layout"])
    assert item.pnu is not None
    assert pkw.encode(item.ak, item.pnu, item.subindex, _pwe(item), item.layout) == data


@pytest.mark.parametrize("vector", VECTORS["words"], ids=lambda vector: str(vector["id"]))
def test_a_pair_of_words(vector: dict[str, Any]) -> None:
    stw1, zsw1 = int(vector["stw1"], 16), int(vector["zsw1"], 16)
    found = pzd.state(zsw1, stw1)
    assert (found.state, list(found.overlays)) == (vector["state"], vector["overlays"])
    assert [row.bit for row in pzd.missing(stw1)] == vector["missing"]


def test_the_vectors_of_the_reference(shared: Path) -> None:
    """Those printed by others, and what was computed from them by code that is not the project's."""
    known = json.loads((shared / "reference" / "channel_vectors.json").read_text("utf-8"))
    seen = 0
    for vector in known["vectors"]:
        if vector.get("row") != 16 or "hex" not in vector:
            continue
        expected = vector["expect"]
        layout = expected.get("layout", pkw.CYCLIC)
        item = pkw.decode(bytes.fromhex(vector["hex"]), vector["role"] == "response", layout)
        said = {
            "ak": item.ak, "spm": item.spm, "pnu": item.pnu, "subindex": item.subindex,
            "page_byte": item.page, "pwe1": item.pwe1, "pwe2": item.pwe2, "pwe": _pwe(item).hex(),
            "meaning": spec.meaning(item.ak, item.answer), "value": item.value,
            "error": item.error and item.error.code,
        }  # fmt: skip
        assert {key: said[key] for key in expected if key in said} == {
            key: value for key, value in expected.items() if key in said
        }, vector["id"]
        seen += 1
    assert seen == 41


# What is so of every message


@given(st.binary(min_size=8, max_size=12), st.booleans(), st.sampled_from([pkw.CYCLIC, pkw.USS]))
def test_any_eight_bytes_have_a_meaning_in_both_languages(
    data: bytes, answer: bool, layout: str
) -> None:
    item = pkw.decode(data, answer, layout)
    for _, text in shown.pkw_lines(item):
        assert text.en
        assert text.zh
    assert _pwe(item) == data[4:8]


@given(st.integers(0, 65535), st.integers(0, 255), st.binary(max_size=4), st.integers(0, 15))
def test_every_parameter_number_has_a_page(pnu: int, subindex: int, value: bytes, ak: int) -> None:
    for layout in (pkw.CYCLIC, pkw.USS):
        item = pkw.decode(pkw.encode(ak, pnu, subindex, value, layout), False, layout)
        assert (item.ak, item.pnu, item.subindex) == (ak, pnu, subindex)
        assert _pwe(item) == value.rjust(4, b"\0")
        assert item.fits_layout


@pytest.mark.parametrize(
    ("data", "fits"), [("1000000300000000", False), ("17ff00fc00000000", False), ("1000008000000000", True)]
)  # fmt: skip
def test_a_page_that_does_not_exist_speaks_for_the_other_layout(data: str, fits: bool) -> None:
    assert pkw.decode(bytes.fromhex(data), False).fits_layout is fits


@pytest.mark.parametrize(
    ("family", "code"), [(None, 107), ("SINAMICS G120", 107), ("MICROMASTER 4", None)]
)
def test_a_family_knows_its_own_numbers(family: str | None, code: int | None) -> None:
    item = pkw.decode(bytes.fromhex("743a00000000006b"), True, family=family)
    assert item.error is not None
    assert item.error.code == code


def test_fewer_than_eight_bytes_are_no_message() -> None:
    with pytest.raises(ValueError, match="8 bytes, and here are 7"):
        pkw.decode(b"1234567", False)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ((1, 65536), "parameter numbers go from 0 to 65535"),
        ((1, 1, 256), "subindexes 0 to 255"),
        ((3, 1, 0, b"12345"), "does not fit into PWE"),
    ],
)
def test_what_pkw_cannot_say_is_refused(arguments: tuple[Any, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        pkw.encode(*arguments)


# Readable lines


@pytest.mark.parametrize(
    ("line", "data"),
    [
        ("pkw read p700", "12bc000000000000"),
        ("pkw read p2010[1]", "100a018000000000"),
        ("pkw read array p7841[2]", "6731029000000000"),
        ("pkw count p2900", "9384008000000000"),
        ("pkw change p1082=Float32:40.0", "343a000042200000"),
        ("pkw change p1082=REAL:40", "343a000042200000"),
        ("pkw change eeprom p1082=Float32:40.0", "d43a000042200000"),
        ("pkw change p402=Unsigned16:30", "219200000000001e"),
        ("pkw change p480[3]=Integer32:-30000", "81e00300ffff8ad0"),
        ("pkw change p10[1]=Unsigned8:7", "700a010000000007"),
        ("pkw change eeprom p10[1]=Unsigned16:7", "c00a010000000007"),
    ],
)
def test_a_line_is_a_request(line: str, data: str) -> None:
    assert encode_line(line).hex() == data


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("pkw", "after pkw comes read, count or change"),
        ("pkw erase p1", "after pkw comes read, count or change"),
        ("pkw read", "no parameter given"),
        ("pkw read p1 p2", "one parameter at a time"),
        ("pkw read p1[0..3]", "PKW carries one value"),
        ("pkw read p1.text", "AK 4 and 15"),
        ("pkw change p1=Float64:1", "has 8 bytes, and PKW takes one, two or four"),
        ("pkw change p1", "change needs a value"),
    ],
)
def test_a_line_that_is_none(line: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        encode_line(line)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("047F", [0x047F]),
        ("47f", [0x047F]),
        ("16#047F", [0x047F]),
        ("W#16#FB31", [0xFB31]),
        ("0x47f", [0x047F]),
        ("047FH", [0x047F]),
        ("2#0000_0100_0111_1111", [0x047F]),
        ("-1231", [0xFB31]),
        ("-1", [0xFFFF]),
        ("64305", [0xFB31]),
        ("1151", [1151, 0x1151]),
        ("0", [0]),
        ("0477", [0x0477]),
        ("-32769", []),
        ("99999", []),
        ("16#1FFFF", []),
        ("", []),
        ("ON", []),
    ],
)
def test_a_word_as_people_write_it(text: str, words: list[int]) -> None:
    assert word_values(text) == words


# Lua says the same


def told(question: Question) -> dict[str, Any]:
    """What Python says to a question of tests/lua/cyclic.lua."""
    if question["ask"] == "pkw":
        data, answer = bytes.fromhex(question["hex"]), question["answer"]
        item = pkw.decode(data, answer, question["layout"], question["family"])
        return shown.pkw_document(item) | {"fits": item.fits_layout}
    stw1, zsw1, lang = question["stw1"], question["zsw1"], question["lang"]
    found = pzd.state(zsw1, stw1)
    return {
        "state": found.state, "overlays": list(found.overlays),
        "text": spec.state_text(found.state, found.overlays, lang),
        "signed": pzd.signed(zsw1),
    }  # fmt: skip


def questions() -> Iterator[Question]:
    for vector in VECTORS["pkw"]:
        yield {
            "ask": "pkw", "hex": vector["hex"], "answer": vector["answer"], "family": None,
            "layout": vector["expect"]["layout"],
        }  # fmt: skip
    chance = random.Random(16)
    families = (None, *spec.families())
    for _ in range(2000):
        data = bytearray(chance.randbytes(8))
        if chance.random() < 0.5:
            data[4:8] = chance.choice(
                (bytes(2) + data[6:8], data[4:6] + bytes(2), b"\xff\xff" + data[6:8])
            )
        yield {
            "ask": "pkw", "hex": data.hex(), "answer": chance.random() < 0.6,
            "layout": chance.choice((pkw.CYCLIC, pkw.USS)), "family": chance.choice(families),
        }  # fmt: skip
    for _ in range(2000):
        yield {
            "ask": "words", "stw1": chance.randrange(0x10000), "zsw1": chance.randrange(0x10000),
            "family": chance.choice((None, "micromaster", "positioning")),
            "lang": chance.choice(("en", "zh")),
        }  # fmt: skip


def lines(items: Iterable[dict[str, Any]]) -> list[str]:
    return [
        json.dumps(each, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
        for each in items
    ]


@pytest.mark.parametrize("lua", LUAS)
def test_lua_says_the_same(lua: str) -> None:
    asked = list(questions())
    result = subprocess.run(
        [lua_program(lua), str(DRIVER)],
        input="".join(f"{each}\n" for each in lines(asked)).encode(), capture_output=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr.decode()
    got = result.stdout.decode().splitlines()
    for question, answer, expected in zip(asked, got, lines(map(told, asked)), strict=True):
        assert answer == expected, question
