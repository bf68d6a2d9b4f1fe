"""The Lua codec against the Python one: the same messages, the same results to the last digit.

What is compared are lines of JSON, so that 10 is not 10.0 and every float has the same text. The
Lua side of the conversation is tests/lua/codec.lua; the vectors have a driver of their own.
"""

from __future__ import annotations

import json
import random
import struct
import subprocess
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from lua_program import LUAS, lua_program

from ds47 import spec
from ds47.analysis import analyze
from ds47.lab.formats import EXAMPLES
from ds47.lab.messages import ROWS
from ds47.profidrive import Options, Request, Response, decode_request, decode_response
from ds47.profidrive.formats import float32_value, number_value
from ds47.report import formatting
from ds47.spec.statuses import status_hex, status_text

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "tests" / "vectors" / "messages.json"
DRIVERS = ROOT / "tests" / "lua"
DIALECTS: tuple[dict[str, bool], ...] = (
    {},
    {"legacy_g120_formats": True},
    {"profile_v3_types": True},
    {"legacy_g120_formats": True, "profile_v3_types": True},
)
Question = dict[str, Any]


def show(message: Request | Response) -> dict[str, Any]:
    """A decoded message as tests/lua/codec.lua prints it."""
    request = message if isinstance(message, Request) else None
    response = message if isinstance(message, Response) else None
    return {
        "request_reference": message.request_reference,
        "axis": message.axis,
        "request_id": request and request.request_id,
        "response_id": response and response.response_id,
        "parameter_count": message.parameter_count,
        "length": message.length,
        "addresses": [
            {
                "attribute": address.attribute,
                "attribute_name": address.attribute_name,
                "element_count": address.element_count,
                "pnu": address.pnu,
                "subindex": address.subindex,
                "offset": address.offset,
            }
            for address in (request.addresses if request else [])
        ],
        "blocks": [
            {
                "format": block.format,
                "format_name": block.format_name,
                "value_count": block.value_count,
                "values": block.values,
                "scaled": block.scaled,
                "texts": [formatting.value(value, block.format_name) for value in block.values],
                "scaled_texts": [
                    formatting.value(value, block.format_name) for value in block.scaled or []
                ],
                "error": block.error
                and {
                    "code": block.error.code,
                    "info": block.error.info,
                    "words": block.error.words,
                },
                "raw": block.raw.hex(),
                "pad": block.pad.hex(),
                "offset": block.offset,
                "meaning": block.meaning,
            }
            for block in message.blocks
        ],
        "flaws": [
            {
                "rule": flaw.rule,
                "offset": flaw.offset,
                "args": flaw.args,
                "message": spec.rules()[flaw.rule].message.format(**flaw.args),
            }
            for flaw in message.flaws
        ],
        "rest": message.rest.hex(),
        "shaped": message.shaped,
        "operation": request and request.operation,
    }


@cache
def _decoded_request(data: bytes) -> Request:
    return decode_request(data)


def answer(question: Question) -> dict[str, Any]:
    """What the Lua side has to say."""
    ask = question["ask"]
    if ask == "error_text":
        code = question["code"]
        text = spec.error_text(code, question["lang"], question["vendor_id"])
        return {"text": text, "info": spec.error_info_meaning(code)}
    if ask == "status_text":
        status = question["status"]
        return {"text": status_text(status, question["lang"]), "hex": status_hex(status)}
    data = bytes.fromhex(question["hex"])
    if ask == "number":
        return {"value": number(question["as"], data)}
    options = Options(**question["options"])
    if ask == "request":
        return show(decode_request(data, options))
    request = question["request"]
    to = None if request is None else _decoded_request(bytes.fromhex(request))
    return show(decode_response(data, to, options))


def number(kind: str, data: bytes) -> int | float | str:
    if kind == "float32":
        return float32_value(struct.unpack(">f", data)[0])
    if kind == "float64":
        return number_value(struct.unpack(">d", data)[0])
    return number_value(int.from_bytes(data, "big", signed=kind == "signed64"))


def line(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True, separators=(",", ":"))


@dataclass(frozen=True)
class Case:
    """A question as a line, and the line that answers it."""

    question: str
    answer: str


def cases(questions: Iterable[Question]) -> list[Case]:
    return [Case(line(question), line(answer(question))) for question in questions]


def compare(lua: str, asked: list[Case]) -> None:
    """Asks one Lua all questions; every answer has to be the line that Python writes."""
    result = subprocess.run(
        [lua_program(lua), str(DRIVERS / "codec.lua")],
        input="".join(case.question + "\n" for case in asked).encode(),
        capture_output=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr.decode()
    got = result.stdout.decode().split("\n")
    assert len(got) == len(asked) + 1
    for case, printed in zip(asked, got, strict=False):
        assert printed == case.answer, case.question


# --- messages -----------------------------------------------------------------------------------


CORNERS = (
    # A pad that is not zero, with which the next block fits, and would without it as well.
    ("010101021001000100001001000200 00", "01010102 050107 010100"),
    # The last subindex there is, and one more than that.
    ("010101011001 0001ffff", None),
    ("010101011002 0001ffff", None),
    ("010101011001 00010000", "01010101"),
    ("", ""),
)


def dates() -> Iterator[bytes]:
    """Responses with the days around the ends of months and years, as TimeOfDay."""
    first = date(1984, 1, 1)
    days = [day for day in range(65536) if (first + timedelta(day + 1)).day in (1, 2)]
    for start in range(0, len(days), 250):
        chosen = days[start : start + 250]
        values = b"".join(b"\x02\x3a\x1f\xff" + day.to_bytes(2, "big") for day in chosen)
        yield bytes((1, 1, 1, 1, 0x0C, len(chosen))) + values


def requests_and_responses() -> Iterator[tuple[bytes, bytes | None]]:
    """Requests with their responses: vectors, the lab's wrong messages, the stored captures."""
    for vector in json.loads(VECTORS.read_text("utf-8"))["messages"]:
        data = bytes.fromhex(vector["hex"])
        if vector["kind"] == "request":
            yield data, None
        else:
            yield bytes.fromhex(vector.get("request", "010101011001000100000000")), data
    for sent, got in (*CORNERS, *((row[4], row[5] if len(row) > 5 else None) for row in ROWS)):
        yield bytes.fromhex(sent), None if got is None else bytes.fromhex(got)
    for path in sorted((ROOT / "captures").glob("*.pcap*")):
        for transaction in analyze(path).transactions:
            if transaction.request:
                yield transaction.request, transaction.response


def every_format() -> Iterator[tuple[bytes, bytes | None]]:
    """A read and a change of every format code, with the lab's values and with any bytes."""
    dice = random.Random(47)
    values = [(code, count, bytes.fromhex(data)) for code, count, data in EXAMPLES]
    for code in range(256):
        row = spec.formats().get(code)
        size = (row.size if row else None) or 2
        for count in (0, 1, 2, 3, 255 if size < 9 else 4):
            values.append((code, count, dice.randbytes(count * size)))
            values.append((code, count, bytes(count * size)))
            values.append((code, count, dice.randbytes(count * (size ^ 2))))
    read = bytes.fromhex("010101011001039a0001")
    yield from ((read, response) for response in dates())
    for code, count, data in values:
        block = bytes((code, count)) + data + bytes(len(data) % 2)
        address = bytes((0x10, count)) + b"\x03\x9a\x00\x01"
        read, change = b"\x07\x01\x01\x01" + address, b"\x07\x02\x01\x01" + address + block
        yield change, b"\x07\x01\x01\x01" + block
        yield read, b"\x07\x01\x01\x02" + block + block


def ask_both(request: bytes, response: bytes | None, options: dict[str, bool]) -> list[Question]:
    questions: list[Question] = [{"ask": "request", "hex": request.hex(), "options": options}]
    if response is not None:
        ask: Question = {"ask": "response", "hex": response.hex(), "options": options}
        questions += [{**ask, "request": None}, {**ask, "request": request.hex()}]
    return questions


def mutated(dice: random.Random, data: bytes) -> bytes:
    """The message with a byte or two changed, taken out, put in, or with bytes behind it."""
    changed = bytearray(data)
    for _ in range(dice.randrange(1, 4)):
        at = dice.randrange(len(changed) + 1)
        kind = dice.randrange(5)
        if kind < 2 and at < len(changed):
            changed[at] = dice.choice((0, 1, 2, 8, 13, 0x40, 0x44, 0x81, dice.randrange(256)))
        elif kind == 2 and at < len(changed):
            del changed[at]
        elif kind == 3:
            changed.insert(at, dice.randrange(256))
        else:
            changed += bytes(dice.randrange(4)) + dice.randbytes(dice.randrange(2))
    return bytes(changed)


@cache
def pairs() -> list[tuple[bytes, bytes | None]]:
    return list(dict.fromkeys(requests_and_responses()))


@cache
def in_every_dialect() -> list[Case]:
    return cases(
        ask for pair in pairs() for options in DIALECTS for ask in ask_both(*pair, options)
    )


@cache
def in_every_format() -> list[Case]:
    return cases(
        ask
        for number, pair in enumerate(every_format())
        for ask in ask_both(*pair, DIALECTS[number % 4 if number % 3 else 0])
    )


@cache
def cut() -> list[Case]:
    """Short messages cut at every byte, long ones at some."""
    asked: list[Question] = []
    for number, (request, response) in enumerate(pairs()):
        options, behind = DIALECTS[number % 4], response or b""
        for end in range(0, len(request), 1 + len(request) // 48):
            asked.append({"ask": "request", "hex": request[:end].hex(), "options": options})
        for end in range(0, len(behind), 1 + len(behind) // 48):
            asked += ask_both(request, behind[:end], options)[1:]
    return cases(asked)


@cache
def damaged() -> list[Case]:
    dice = random.Random(47)
    asked: list[Question] = []
    for _ in range(3000):
        request, response = dice.choice(pairs())
        broken = mutated(dice, response) if response is not None else None
        sent = mutated(dice, request) if dice.random() < 0.7 else request
        asked += ask_both(sent, broken, dice.choice(DIALECTS))
    for _ in range(1500):
        head = bytes((1, dice.choice((1, 2, 0x40, 0x42, 0x51, 0x80, 0x81, 0x82, 9)), 1))
        noise = head + bytes((dice.randrange(4),)) + dice.randbytes(dice.randrange(24))
        asked += ask_both(noise, noise, dice.choice(DIALECTS))
    return cases(asked)


@pytest.mark.parametrize("lua", LUAS)
def test_vectors(lua: str) -> None:
    result = subprocess.run(
        [lua_program(lua), str(DRIVERS / "messages.lua"), str(VECTORS)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    declared = json.loads(VECTORS.read_text("utf-8"))["count"]
    ran = "".join(f"{count} {part}, " for part, count in declared.items())
    assert result.stdout == f"{ran}0 differences\n"


@pytest.mark.parametrize("lua", LUAS)
def test_a_wrong_vector_is_noticed(lua: str, tmp_path: Path) -> None:
    stored = json.loads(VECTORS.read_text("utf-8"))
    stored["messages"] = stored["messages"][:2]
    stored["messages"][1]["expect"]["parameters"][0]["values"] = [10.5]
    wrong = tmp_path / "messages.json"
    wrong.write_text(json.dumps(stored), "utf-8")
    result = subprocess.run(
        [lua_program(lua), str(DRIVERS / "messages.lua"), str(wrong)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1
    assert "s000-fig5-1-rsp: values 1 is" in result.stdout


@pytest.mark.parametrize("lua", LUAS)
def test_every_message_in_every_dialect(lua: str) -> None:
    assert len(in_every_dialect()) > 1000
    compare(lua, in_every_dialect())


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_every_format(lua: str) -> None:
    compare(lua, in_every_format())


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_every_cut(lua: str) -> None:
    compare(lua, cut())


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_every_kind_of_damage(lua: str) -> None:
    compare(lua, damaged())


# --- numbers and texts --------------------------------------------------------------------------


def ask_number(kind: str, data: bytes) -> Question:
    return {"ask": "number", "as": kind, "hex": data.hex()}


def number_questions() -> Iterator[Question]:
    """The ends of every binade, small decimals, whole numbers around powers, and any bits."""
    dice = random.Random(4711)
    for sign in (0, 1):
        for exponent in range(256):
            for fraction in (0, 1, 0x400000, 0x7FFFFF):
                bits = sign << 31 | exponent << 23 | fraction
                yield ask_number("float32", bits.to_bytes(4, "big"))
        for exponent in range(2048):
            for fraction in (0, 1, 2**52 - 1):
                bits = sign << 63 | exponent << 52 | fraction
                yield ask_number("float64", bits.to_bytes(8, "big"))
    for _ in range(4000):
        yield ask_number("float32", dice.randbytes(4))
        yield ask_number("float64", dice.randbytes(8))
        decimal = float(f"{10 ** dice.uniform(-20, 25):.{dice.randrange(1, 18)}g}")
        yield ask_number("float32", struct.pack(">f", decimal))
        yield ask_number("float64", struct.pack(">d", decimal))
    whole = [2**n + d for n in range(65) for d in (-1, 0, 1)] + [10**n for n in range(20)]
    whole += [dice.getrandbits(dice.randrange(1, 65)) for _ in range(2000)]
    for value in whole:
        data = (value % 2**64).to_bytes(8, "big")
        yield ask_number("unsigned64", data)
        yield ask_number("signed64", data)
        yield ask_number("signed64", (-value % 2**64).to_bytes(8, "big"))


@cache
def numbers() -> list[Case]:
    return cases(number_questions())


@cache
def error_texts() -> list[Case]:
    ids = sorted({vendor.id for vendor in spec.vendors() if vendor.id is not None})
    return cases(
        {"ask": "error_text", "code": code, "lang": lang, "vendor_id": vendor_id}
        for code in range(256)
        for lang in ("en", "zh", "fr")
        for vendor_id in (None, 0, 0xFFFF, *ids)
    )


@cache
def status_texts() -> list[Case]:
    statuses = {0, 0xDE80B500, 0xFFFFFFFF}
    for byte in range(256):
        statuses |= {byte << 24, 0xDE000000 | byte << 16 | 0x1234, 0xDE80B500 | byte}
        statuses |= {0xDF800000 | byte << 8, 0xDB810000 | byte << 8 | byte, 0xDB810000 | byte}
    return cases(
        {"ask": "status_text", "status": status, "lang": lang}
        for status in sorted(statuses)
        for lang in ("en", "zh", "fr")
    )


@pytest.mark.slow
@pytest.mark.parametrize("lua", LUAS)
def test_numbers(lua: str) -> None:
    compare(lua, numbers())


@pytest.mark.parametrize("lua", LUAS)
def test_error_texts(lua: str) -> None:
    compare(lua, error_texts())


@pytest.mark.parametrize("lua", LUAS)
def test_status_texts(lua: str) -> None:
    compare(lua, status_texts())


@pytest.mark.parametrize("lua", LUAS)
def test_a_remembered_layout_says_what_decoding_says(lua: str) -> None:
    """Formats by chance, one request after the other, some damaged: with and without memory."""
    run = subprocess.run(
        [lua_program(lua), str(DRIVERS / "layouts.lua")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    compared, known = map(int, run.stdout.split())
    assert known > compared / 10
