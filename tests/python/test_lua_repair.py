"""The Lua search for repairs against the Python one: the same questions, the same answers.

The Lua side of the conversation is tests/lua/repair.lua. Questions have the form of
tests/vectors/repairs.json.
"""

from __future__ import annotations

import json
import random
import subprocess
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from lua_program import LUAS, lua_program
from test_lua_codec import DIALECTS, DRIVERS, line, mutated, pairs
from test_repair import CASES, repair_of, shown

from ds47 import spec
from ds47.profidrive import decode_request, encode_request, make_block
from ds47.profidrive.notation import format_request_line, parse_request_line

Question = dict[str, Any]
NUMBERS = tuple(
    code for code, row in spec.formats().items() if row.kind in ("number", "float") and row.size
)


def asked_of_lua(lua: str, questions: list[Question]) -> list[str]:
    result = subprocess.run(
        [lua_program(lua), str(DRIVERS / "repair.lua")],
        input="".join(line(question) + "\n" for question in questions).encode(),
        capture_output=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr.decode()
    return result.stdout.decode().splitlines()


def compare(lua: str, questions: list[Question], answers: list[str]) -> None:
    got = asked_of_lua(lua, questions)
    assert len(got) == len(questions)
    for question, printed, answer in zip(questions, got, answers, strict=True):
        assert printed == answer, question


def whole(case: Question) -> Question:
    """A case with all that the driver asks for."""
    empty: Question = {"errors": {}, "known": [], "formats": {}, "options": {}}
    keys = ("request", *empty)
    return {key: value for key, value in {**empty, **case}.items() if key in keys}


# --- the vectors --------------------------------------------------------------------------------


@pytest.mark.parametrize("lua", LUAS)
def test_vectors(lua: str) -> None:
    compare(lua, [whole(case) for case in CASES], [line(case["expect"]) for case in CASES])


# --- anything -----------------------------------------------------------------------------------


def damaged(dice: random.Random, data: bytes) -> bytes:
    """What programs do to a request, sometimes more than one of it."""
    for _ in range(dice.choice((1, 1, 1, 2))):
        kind = dice.randrange(7)
        at = dice.randrange(4, max(5, len(data)))
        if kind == 0:
            data = b"".join(data[i : i + 2][::-1] for i in range(0, len(data), 2))
        elif kind == 1:
            data = b"".join(bytes((byte, 0)) for byte in data)
        elif kind == 2:
            data = b"".join(bytes((0, byte)) for byte in data)
        elif kind == 3:
            data = data[:at] + data[at : at + 4][::-1] + data[at + 4 :]
        elif kind == 4:
            data = mutated(dice, data)
        elif kind == 5:
            data = data[:at] + bytes((dice.choice(NUMBERS),)) + data[at + 1 :]
        else:
            data += bytes(dice.randrange(8))
    return data


def number(dice: random.Random) -> float:
    digits = dice.randrange(1, 8)
    shown = float(f"{dice.choice((1, -1)) * 10 ** dice.uniform(-5, 8):.{digits}g}")
    return round(shown) if dice.random() < 0.5 else shown


def values_of(dice: random.Random, code: int) -> bytes:
    """The bytes of a number that a person may type, under a format that may be another."""
    natural = dice.choice((0x04, 0x08, 0x06, 0x07, 0x0F, 0x37, 0x42, code))
    size = spec.formats()[code].size or 1
    try:
        raw = make_block(natural, [number(dice)]).raw
    except ValueError:
        raw = dice.randbytes(size)
    raw = raw[::-1] if dice.random() < 0.4 else raw
    return raw if len(raw) == size else raw[:size].rjust(size, b"\0")


def change(dice: random.Random) -> bytes:
    count = dice.choice((1, 1, 2, 3))
    addresses, blocks = b"", b""
    for _ in range(count):
        code, elements = dice.choice(NUMBERS), dice.choice((1, 1, 1, 2, 5))
        pnu = dice.choice((922, 2900, 2901, 840, 39427, 21515))
        values = b"".join(values_of(dice, code) for _ in range(elements))
        if dice.random() < 0.1:
            values = bytes(len(values))
        addresses += bytes((0x10, elements)) + pnu.to_bytes(2) + bytes((0, dice.randrange(2)))
        blocks += bytes((code, elements)) + values + bytes(len(values) % 2)
    return bytes((dice.randrange(1, 9), 2, 1, count)) + addresses + blocks


def random_question(dice: random.Random) -> Question:
    kind = dice.randrange(4)
    if kind < 2:
        request = change(dice)
    elif kind == 2:
        request = bytes.fromhex(dice.choice(CASES)["request"])
    else:
        request = dice.choice(pairs())[0]
    if kind and dice.random() < 0.7:
        request = damaged(dice, request)
    codes = (0, 2, 5, 5, 0x17, 0x17, 0x11, 0x6B)
    errors = {str(i): dice.choice(codes) for i in range(3) if dice.random() < 0.7}
    there = (922, 2900, 2901, 2902, 50303, 50304, 840, 771)
    known_pnus = [pnu for pnu in there if dice.random() < 0.7]
    wanted = (2, 3, 4, 5, 6, 7, 8, 8, 8, 0x0F, 0x37, 0x43, 0x71, 9, *NUMBERS)
    formats = {str(pnu): dice.choice(wanted) for pnu in there if dice.random() < 0.5}
    options = {**dice.choice((DIALECTS[0], DIALECTS[0], *DIALECTS))}
    if dice.random() < 0.3:
        options["vendor_id"] = dice.choice((0x2A, 0x83))
    return {
        "request": request.hex(),
        "errors": errors,
        "known": known_pnus,
        "formats": formats,
        "options": options,
    }


@cache
def at_random() -> tuple[list[Question], list[str]]:
    dice = random.Random(716)
    questions = [random_question(dice) for _ in range(12000)]
    return questions, [line(shown(repair_of(question))) for question in questions]


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_random_requests(lua: str) -> None:
    compare(lua, *at_random())


@pytest.mark.slow
@pytest.mark.parametrize("what", ["all_bytes", "fields", "values", "zeros", "even_offsets", ""])
def test_random_requests_hold_every_kind_of_repair(what: str) -> None:
    found = [json.loads(answer) for answer in at_random()[1]]
    assert sum(repair is not None and repair["what"] == what for repair in found) >= 20


# --- readable lines -------------------------------------------------------------------------------


def lines() -> Iterator[bytes]:
    dice = random.Random(47)
    for request, _ in pairs():
        yield request
    for _ in range(1500):
        yield mutated(dice, dice.choice(pairs())[0])
    for code in range(256):
        for size in (0, 1, 2, 4, 7, 8, 12, 16):
            raw = dice.randbytes(size)
            yield bytes((1, 2, 1, 1, 0x10, 1, 3, 0x9A, 0, 0, code, 1)) + raw + bytes(size % 2)
    for code, raw in ((8, "7fc00000"), (8, "7fc00001"), (8, "ff800000"), (15, "7ff8" + 12 * "0")):
        yield bytes((1, 2, 1, 1, 0x10, 1, 3, 0x9A, 0, 0, code, 1)) + bytes.fromhex(raw)


def readable(request: bytes) -> str | None:
    message = decode_request(request)
    if any(block.meaning is not None for block in message.blocks):
        return None
    try:
        text = format_request_line(message)
        return text if encode_request(parse_request_line(text)) == request else None
    except ValueError:
        return None


@pytest.mark.parametrize("lua", LUAS)
def test_readable_lines(lua: str) -> None:
    requests = list(dict.fromkeys(lines()))
    expected = [readable(request) for request in requests]
    assert sum(text is not None for text in expected) > 500
    questions: list[Question] = [{"line": request.hex()} for request in requests]
    compare(lua, questions, [line(text) for text in expected])
