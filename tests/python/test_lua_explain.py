"""What Lua says of statuses and error numbers, and how it copies requests, against Python.

The Lua side of the conversation is tests/lua/explain.lua.
"""

from __future__ import annotations

import json
import random
import shlex
import subprocess
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from lua_program import LUAS, lua_program
from test_lua_codec import DRIVERS, mutated, pairs

from ds47 import spec
from ds47.cli.encode import written
from ds47.cyclic.notation import encode_line
from ds47.diagnosis.suggest import encode_command, scl
from ds47.explain import explain, find_vendor
from ds47.explain.meanings import _status
from ds47.profidrive import encode_request
from ds47.profidrive.notation import parse_request_line
from ds47.report.explanation import lines
from ds47.spec import explanations

Question = dict[str, Any]
SERVICES = (0x00, 0x01, 0x40, 0xC0, 0xCF, 0xD1, 0xD7, 0xDA, 0xDB, 0xDC, 0xDD, 0xDE, 0xDF, 0xFF)
DECODES = (0x00, 0x01, 0x70, 0x7F, *range(0x80, 0x90), 0xFE, 0xFF)


def answers(lua: str, questions: list[Question]) -> list[Any]:
    done = subprocess.run(
        [lua_program(lua), str(DRIVERS / "explain.lua")],
        input="".join(json.dumps(question) + "\n" for question in questions).encode(),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    return [json.loads(line) for line in done.stdout.decode().splitlines()]


def statuses() -> Iterator[int]:
    """Each that has a meaning of its own, and others of each kind. Of its third byte each service has a fifth, in
    steps that begin elsewhere: together they have all of it.
    """
    dice = random.Random(47)
    for service in SERVICES:
        for decode in DECODES:
            close = decode in (0x00, 0x70, 0x80, 0x81) and service not in (0x01, 0xFF)
            for first in range(service % 5, 256, 5) if close else range(0, 256, 51):
                yield service << 24 | decode << 16 | first << 8 | dice.choice((0, 0, 1, 7))
    for _ in range(500):
        yield dice.randrange(1 << 32)
    yield from (0, 0xDE80B500, 0x00B580DE, 0xDF80B200, 0xFFFFFFFF)
    yield from (0x80DE80B5, 0x00DF80B0, 0x12C080C3, 0x00007002, 0x01408200, 0xDEDE80B5)
    for row in (*explanations._table()["status"], *explanations._table()["local"]):
        for service in row.get("services", [row.get("function")]):
            middle = row.get("decode", 0) << 16 | row.get("code1", 0) << 8 | row.get("code2", 0)
            yield service << 24 | middle


@cache
def of_status(status: int, lang: str) -> tuple[bool, list[str]]:
    """Whether it is known, and the lines of Python, which are the same for each Lua."""
    meaning = _status(status, lang)  # as a text 00000001 may be a byte
    return meaning.known, list(lines([meaning], lang))


@pytest.mark.slow
@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("lua", LUAS)
def test_every_status(lua: str, lang: str) -> None:
    asked = list(dict.fromkeys(statuses()))
    asked = asked[:: 1 if lua == LUAS[-1] else 17]
    got = answers(lua, [{"status": each, "lang": lang, "width": 100} for each in asked])
    known = 0
    for status, told in zip(asked, got, strict=True):
        is_known, wanted = of_status(status, lang)
        known += is_known
        assert told == wanted, f"{status:08X}"
    assert known > len(asked) // 4


def test_every_entry_of_a_status_is_asked_for() -> None:
    seen = {
        id(entry)
        for each in statuses()
        for entry in (
            explanations.of_status(*each.to_bytes(4)), explanations.of_local(*each.to_bytes(4)),
        )
        if entry
    }  # fmt: skip
    table = explanations._table()
    assert len(seen) == len(table["status"]) + len(table["local"])


@cache
def of_errors(lang: str, width: int) -> list[tuple[Question, list[str]]]:
    """Each number of each maker, and the lines of Python."""
    ids = [vendor.id for vendor in spec.vendors() if vendor.id is not None]
    codes = {*range(300), *(code for vendor in spec.vendors() for code in vendor.errors), 0xFFFF}
    found = []
    for vendor in (None, 0x1234, *ids):
        maker = None if vendor is None else find_vendor(f"0x{vendor:04X}")
        for code in sorted(codes):
            question: Question = {"error": code, "vendor": vendor, "lang": lang, "width": width}
            meanings = explain(f"error 0x{code:02X}", lang, maker)
            found.append((question, list(lines(meanings, lang, width))))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("width", [80, 100])
@pytest.mark.parametrize("lang", ["en", "zh"])
@pytest.mark.parametrize("lua", LUAS)
def test_every_error_number(lua: str, lang: str, width: int) -> None:
    known = of_errors(lang, width)[:: 1 if lua == LUAS[-1] else 7]
    got = answers(lua, [question for question, _ in known])
    for (question, wanted), told in zip(known, got, strict=True):
        assert told == wanted, question


def requests() -> list[bytes]:
    dice = random.Random(21)
    found = [request for request, _ in pairs()]
    found += [mutated(dice, dice.choice(found)) for _ in range(500)]
    found += [encode_request(parse_request_line(line)) for line in (
        'change ref 7 p1=VisibleString:"it\'s \\"$HOME\\" `a` \\\\ %x%"',
        "change axis 2 p2900[0..1]=REAL:10.0,-0.0", "0x51 ref 1 p10", "read p945[0..7] p1082.description[6]",
    )]  # fmt: skip
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("lua", LUAS)
def test_a_request_is_copied_as_python_writes_it(lua: str) -> None:
    asked = requests()
    got = answers(lua, [{"request": each.hex()} for each in asked])
    lines_copied = 0
    for request, told in zip(asked, got, strict=True):
        assert told["scl"] == scl(request) == written(request, "scl")
        assert told["encode"] == encode_command(request), request.hex()
        if told["encode"] is not None:
            ds47, encode, line = shlex.split(told["encode"])
            assert (ds47, encode) == ("ds47", "encode")
            assert encode_request(parse_request_line(line)) == request
            lines_copied += 1
    assert lines_copied > 200


def pkw_requests() -> Iterator[tuple[bytes, str]]:
    dice = random.Random(8)
    for layout in ("cyclic", "uss"):
        for pnu in (0, 1, 700, 1082, 1999, 2000, 2010, 7841, 9000, 50304, 65535):
            for text in (
                "read p{}", "read p{}[1]", "read array p{}", "read array p{}[2]", "count p{}", "count p{}[9]",
                "change p{}=Float32:-0.1", "change p{}=Word:7", "change p{}=DoubleWord:4294967295",
                "change p{}[0]=Word:65535", "change p{}[3]=DoubleWord:0", "change eeprom p{}=REAL:40",
                "change eeprom p{}[255]=INT:-1", "change eeprom p{}[4]=REAL:3.5", "change eeprom p{}=Word:0",
            ):  # fmt: skip
                yield encode_line("pkw " + text.format(pnu), layout), layout
        for _ in range(2000):
            ak = dice.randrange(16) << 12
            word = ak | dice.randrange(0x800 if dice.random() < 0.9 else 0x1000)
            ind = dice.choice((0, 0x80, 0x0100, 0x8001, dice.randrange(0x10000)))
            value = dice.choice((bytes(4), dice.randbytes(4), bytes(2) + dice.randbytes(2)))
            yield word.to_bytes(2) + ind.to_bytes(2) + value, layout


@pytest.mark.parametrize("lua", LUAS)
def test_a_request_of_pkw_is_copied_as_python_reads_it(lua: str) -> None:
    asked = list(pkw_requests())
    got = answers(lua, [{"pkw": data.hex(), "layout": layout} for data, layout in asked])
    copied = 0
    for (data, layout), command in zip(asked, got, strict=True):
        written_by_line = len(asked) // 2 - 2000
        if command is None:
            assert asked.index((data, layout)) % (len(asked) // 2) >= written_by_line, data.hex()
            continue
        *start, line = shlex.split(command)
        assert start == ["ds47", "encode", *(["--pkw-layout", "uss"] if layout == "uss" else [])]
        assert encode_line(line, layout) == data
        copied += 1
    assert copied > 2 * written_by_line + 200
