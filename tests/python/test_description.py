"""Descriptions (0x20) and texts (0x30): the vectors, Python and Lua alike on random bytes, reports, Wireshark."""

from __future__ import annotations

import json
import random
import struct
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from fake_tshark import real_tshark
from lua_program import LUAS, lua_program
from test_wireshark_plugin import COMPLETE, run

import ds47
from ds47.cli import main
from ds47.model import Parameter
from ds47.profidrive.description import KEYS
from ds47.report import contract, descriptions
from ds47.report.formatting import parameter

ROOT = Path(__file__).resolve().parents[2]
VECTORS = json.loads((ROOT / "tests/vectors/descriptions.json").read_text("utf-8"))
DESCRIPTION, TEXT = 0x20, 0x30


def question(attribute: int, subindex: int, block: bytes) -> dict[str, str]:
    """A read of p1120 and its answer in hex."""
    request = struct.pack(">BBBBBBHH", 1, 1, 1, 1, attribute, 1, 1120, subindex)
    return {"request": request.hex(), "response": (b"\1\1\1\1" + block).hex()}


def first(asked: dict[str, str]) -> Parameter:
    return ds47.decode_response(asked["response"], asked["request"]).parameters[0]


def told(asked: dict[str, str]) -> dict[str, Any]:
    """What Python says, as tests/lua/descriptions.lua says it."""
    item = first(asked)
    if item.error is not None:
        item.values, item.error = [], None
    plain = contract.PARAMETER.plain(item)
    return {
        "description": plain.get("description"),
        "texts": plain.get("texts"),
        "en": parameter(item, False, "en"),
        "zh": parameter(item, False, "zh"),
    }


def by_lua(version: str, asked: Iterable[dict[str, str]]) -> list[dict[str, Any]]:
    given = "\n".join(map(json.dumps, asked)) + "\n"
    command = [lua_program(version), str(ROOT / "tests/lua/descriptions.lua")]
    done = subprocess.run(
        command, input=given.encode(), capture_output=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    return [json.loads(line) for line in done.stdout.splitlines()]


def asked_of(kind: str, attribute: int) -> list[dict[str, str]]:
    return [
        question(attribute, row.get("subindex", 0), bytes.fromhex(row["block"]))
        for row in VECTORS[kind]
    ]


def test_how_many_vectors_there_are() -> None:
    assert len(VECTORS["descriptions"]) == VECTORS["count"]


def test_the_layout_is_whole() -> None:
    elements = ds47.spec.descriptions.elements()
    assert [each.number for each in elements] == list(range(1, 13))
    assert [each.offset for each in elements[1:]] == [
        each.offset + each.size for each in elements[:-1]
    ]
    assert elements[-1].offset + elements[-1].size == ds47.spec.descriptions.length() == 46


@pytest.mark.parametrize("row", VECTORS["descriptions"], ids=lambda row: row["id"])
def test_a_description(row: dict[str, Any]) -> None:
    item = first(question(DESCRIPTION, row["subindex"], bytes.fromhex(row["block"])))
    found = contract.PARAMETER.plain(item).get("description")
    if row["expect"] is None:
        assert found is None
    else:
        assert found == dict.fromkeys(KEYS) | row["expect"]
        assert json.dumps(found) == json.dumps(dict.fromkeys(KEYS) | row["expect"])
    told_words = descriptions.words(item) if item.error is None else None
    assert (told_words and told_words._asdict()) == row["text"]


@pytest.mark.parametrize("row", VECTORS["texts"], ids=lambda row: row["id"])
def test_texts(row: dict[str, Any]) -> None:
    item = first(question(TEXT, 0, bytes.fromhex(row["block"])))
    assert contract.PARAMETER.plain(item).get("texts") == row["expect"]


@pytest.mark.parametrize("version", LUAS)
def test_lua_says_the_same_of_the_vectors(version: str) -> None:
    asked = asked_of("descriptions", DESCRIPTION) + asked_of("texts", TEXT)
    found = by_lua(version, asked)
    assert list(map(json.dumps, map(_sorted, found))) == [
        json.dumps(_sorted(told(each))) for each in asked
    ]


def _sorted(item: Any) -> Any:
    return {key: _sorted(item[key]) for key in sorted(item)} if isinstance(item, dict) else item


def by_chance(chance: random.Random) -> dict[str, str]:
    """A whole description, an element or a text in any format, often with bytes that mean something."""
    attribute, subindex = chance.choice((DESCRIPTION, DESCRIPTION, TEXT)), chance.randint(0, 13)
    if chance.random() < 0.5:
        raw = bytearray(chance.randbytes(46))
        raw[1] = chance.choice(
            (*range(12), 0x0D, 0x34, 0x36, 0x41, 0x42, 0x43, 0x71, 0x72, 0x73, 0x7A, raw[1])
        )
        raw[8] = chance.choice((0, 4, 9, 11, 17, 28, raw[8]))
        raw[9] = chance.choice((0, 3, 0xFD, 67, 70, 77, raw[9]))
        for at in (30, 34):
            raw[at : at + 2] = chance.choice((b"\0\0", b"\xff\xff", bytes(raw[at : at + 2])))
        return question(
            attribute, 0, bytes((chance.choice((0x0A, 0x41, 0x09, 5)), 46)) + bytes(raw)
        )
    count = chance.choice((0, 1, 1, 2, 4, 16, 32, 46))
    return question(
        attribute,
        subindex,
        bytes((chance.choice((*range(1, 0x45), 0x71, 0x73)), count)) + chance.randbytes(46),
    )


@pytest.mark.slow
@pytest.mark.parametrize("version", LUAS)
def test_lua_says_the_same_of_anything(version: str) -> None:
    chance = random.Random(20)
    asked = [by_chance(chance) for _ in range(4000)]
    asked = [
        each
        for each in asked
        if len(ds47.decode_response(each["response"], each["request"]).plain.blocks)
    ]
    assert len(asked) > 3000
    found = by_lua(version, asked)
    for question_, item in zip(asked, found, strict=True):
        assert _sorted(item) == _sorted(told(question_)), question_


NAMES = (
    "identifier",
    "type",
    "elements",
    "factor",
    "quantity",
    "unit",
    "name",
    "low",
    "high",
    "reference",
    "full_scale",
)
CAPTURES = ("captures/format-description.pcapng", "captures/real-stacks/o1_profinetpy062_be.pcapng")


@pytest.mark.parametrize("capture", CAPTURES)
def test_wireshark_shows_them(capture: str, tmp_path: Path) -> None:
    real_tshark()
    wanted = [f"ds47.description.{name}" for name in NAMES] + ["ds47.text"]
    options = [part for name in ("frame.number", *wanted) for part in ("-e", name)]
    text = run(
        tmp_path, *COMPLETE, "-r", ROOT / capture, "-T", "fields", "-E", "aggregator=|", *options
    ).decode()
    shown = {int(line.split("\t")[0]): line.split("\t")[1:] for line in text.splitlines()}
    seen = 0
    for item in ds47.analyze(ROOT / capture).transactions:
        frame = (
            item.frames.write_request if item.operation == "change" else item.frames.read_response
        )
        if frame is None:
            continue
        plain = [contract.PARAMETER.plain(each) for each in item.parameters]
        told_ = [each["description"] for each in plain if "description" in each]
        for place, name in enumerate(NAMES):
            expected = [str(each[name]) for each in told_ if each[name] is not None]
            found = [each for each in shown[frame][place].split("|") if each]
            assert [_number(each) for each in found] == [_number(each) for each in expected], (
                frame,
                name,
            )
            seen += len(found)
        texts = [each for item_ in plain for each in item_.get("texts", [])]
        assert [each for each in shown[frame][len(NAMES)].split("|") if each] == [
            each for each in texts if each
        ]
    assert seen > 10


def _number(text: str) -> float | str:
    try:
        return float(int(text, 0)) if text.startswith("0x") else float(text)
    except ValueError:
        return text


def test_the_text_of_a_report_has_no_row_of_digits(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(ROOT / CAPTURES[0])]) == 0
    text = capsys.readouterr().out
    assert (
        'p0922[0].description (Telegram selection) = "Speed setpoint", Unsigned16, 0..65535' in text
    )
    assert "810600003f80" not in text
    assert 'p0922[0..1].text (Telegram selection) = "Standard", ""' in text
    assert main(["report", "-f", "html", str(ROOT / CAPTURES[0])]) == 0
    page = capsys.readouterr().out
    assert "Speed setpoint" in page
    assert "0..65535" in page


def test_pkw_has_elements_of_an_older_profile() -> None:
    item = Parameter(922, 1, "description", None, format="Word", value_count=1, values=[0x8106])
    assert descriptions.of(item) is None
    assert parameter(item, False) == "p0922[1].description = 33030"
