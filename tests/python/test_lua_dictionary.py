"""The dictionary in Lua against that in Python: descriptions by chance, of few parameters in few ways."""

from __future__ import annotations

import json
import random
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from lua_program import LUAS, lua_program

from ds47.model import SIEMENS, Parameter
from ds47.profidrive import Block, decode_response
from ds47.profidrive.dictionary import Dictionary, Statement, explain, unit_of
from ds47.profidrive.drive_objects import LOCAL, DriveAccess, DriveObjects, access
from ds47.report import formatting
from ds47.spec.semantics import known

DRIVER = Path(__file__).resolve().parent.parent / "lua/dictionary.lua"
PNUS = (1082, 922, 964, 2000)
"""One that nobody lists, one of the profile, one of the whole device, one of Siemens."""
TYPES = (*(3, 6) * 20, *range(1, 0x10), 0x37, 0x41, 0x42, 0x43, 0x71, 0x76, 0x00, 0x44, 0xEE)
QUANTITIES = (28, 28, 28, 0, 4, 9, 11, 24, 28, 99)
CONVERSIONS = (0, 0, -1, -2, -3, 1, 2, 3, 6, 22, 23, -22, 67, 70, 74, 100, -64)
FACTORS = (1.0, 1.0, 1.0, 0.1, 0.01, 10.0, 1000.0, 0.0, -1.0, float("nan"), float("inf"))
NAMES = (
    b"Speed", b"Max_frequency", b"", "Höchstwert".encode("latin-1"), b'a "name"', b"a\x01b", b"a\x9bb", b"\xa0",
    b"\xad",
)  # fmt: skip


def an_access(chance: random.Random) -> DriveAccess:
    index = chance.choice((47, 47, 0xB02F, LOCAL))
    slot, axis = chance.choice((1, 2, None)), chance.choice((0, 1, 2, 3))
    return access(f"192.168.0.{chance.randint(1, 2)}", index, slot, 1, axis)


def response(code: int, count: int, raw: bytes) -> str:
    return (bytes((1, 1, 0, 1, code, count)) + raw + bytes(len(raw) % 2)).hex()


def a_description(chance: random.Random) -> tuple[int, str]:
    """Subindex and response."""
    kind, name = chance.choice(TYPES), chance.choice(NAMES)
    bits = chance.choice((0, 0, 1, 2))
    variable = struct.pack(">Bb", chance.choice(QUANTITIES), chance.choice(CONVERSIONS))
    factor = struct.pack(">f", chance.choice(FACTORS))
    limits = chance.choice(
        (bytes(8), chance.randbytes(8), bytes(3) + b"\1" + bytes(2) + b"\xff\xff")
    )
    whole = (
        bytes((bits, kind))
        + bytes(2)
        + factor
        + variable
        + bytes(4)
        + name.ljust(16)
        + limits
        + bytes(8)
    )
    parts = {
        1: (0x42, 1, bytes((bits, kind))), 3: (0x08, 1, factor), 4: (0x42, 1, variable),
        6: (0x09, 16, name.ljust(16)), 7: (0x43, 1, limits[:4]), 8: (0x08, 1, limits[4:]),
    }  # fmt: skip
    if chance.random() < 0.5:
        return 0, response(chance.choice((0x0A, 0x41)), 46, whole)
    subindex = chance.choice(tuple(parts))
    return subindex, response(*parts[subindex])


def a_value(chance: random.Random) -> str:
    code, size = chance.choice(
        ((3, 2), (6, 2), (4, 4), (7, 4), (5, 1), (8, 4), (0x42, 2), (0x43, 4), (0x71, 2))
    )
    count = chance.choice((1, 1, 3))
    return response(code, count, chance.randbytes(size * count))


def lines(chance: random.Random, count: int) -> Iterator[dict[str, Any]]:
    for frame in range(count):
        if frame % 200 == 0:
            yield {"most": chance.choice((3, 12, 1000, 1000))}
        pnu, what = chance.choice(PNUS), chance.random()
        if what < 0.03:
            yield {"refused": an_access(chance), "code": known().axis_error}
        elif what < 0.06:
            yield {"identified": an_access(chance), "values": [chance.randint(1, 3)]}
        elif what < 0.5:
            subindex, data = a_description(chance)
            yield {
                "learn": an_access(chance),
                "pnu": pnu,
                "subindex": subindex,
                "response": data,
                "frame": frame + 1,
            }
        else:
            yield {
                "ask": an_access(chance), "pnu": pnu, "vendor_id": chance.choice((None, SIEMENS)),
                "last": chance.choice((None, None, max(1, frame - 50))), "response": a_value(chance),
            }  # fmt: skip


def block(line: dict[str, Any]) -> Block:
    return decode_response(bytes.fromhex(line["response"])).blocks[0]


class Python:
    """What Python says to the same."""

    def __init__(self) -> None:
        self.answers: list[dict[str, Any]] = []

    def take(self, line: dict[str, Any]) -> None:
        if "most" in line:
            self.objects = DriveObjects()
            self.dictionary = Dictionary(self.objects, line["most"])
        elif "refused" in line:
            self.objects.refused(line["refused"], line["code"])
        elif "identified" in line:
            self.objects.identified(line["identified"], 7, line["values"])
        elif "learn" in line:
            value = block(line)
            self.dictionary.learn(
                line["learn"], line["pnu"], line["subindex"], value.format_name, value.values, line["frame"]
            )  # fmt: skip
        else:
            self.answers.append(self.asked(line))

    def asked(self, line: dict[str, Any]) -> dict[str, Any]:
        value = block(line)
        meaning = self.dictionary.meaning(line["ask"], line["pnu"], line["vendor_id"], line["last"])
        row = meaning.listed
        item = Parameter(
            line["pnu"], 0, "value", 0, row, unit_of(row, value.format_name), value.format_name, value.value_count,
            value.values, value.scaled,
        )  # fmt: skip
        explain(item, meaning)
        return {
            "is_said": meaning.is_said,
            "type": _pair(meaning.type), "low": _pair(meaning.low), "high": _pair(meaning.high),
            "frames": item.described_in, "en": formatting.parameter(item, written=False),
            "zh": formatting.parameter(item, written=True, lang="zh"),
        }  # fmt: skip


def _pair(said: Statement | None) -> list[Any] | None:
    return None if said is None else list(said)


@pytest.mark.slow
@pytest.mark.parametrize("version", LUAS)
@pytest.mark.parametrize("seed", range(3))
def test_both_learn_the_same(version: str, seed: int) -> None:
    told = list(lines(random.Random(seed), 12_000))
    python = Python()
    for line in told:
        python.take(line)
    command = [lua_program(version), str(DRIVER)]
    done = subprocess.run(
        command, input="\n".join(map(json.dumps, told)), capture_output=True, encoding="utf-8", check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(python.answers) > 3000
    for one, other in zip(found, python.answers, strict=True):
        assert one == other
    kinds = {
        "named": any('("Speed")' in each["en"] for each in found),
        "scaled": any(
            each["frames"] and any(f" {unit})" in each["en"] for unit in ("Hz", "s"))
            for each in found
        ),
        "limited": any(each["low"] is not None for each in found),
        "several": any(len(each["frames"] or ()) > 1 for each in found),
        "nothing": any(not each["is_said"] for each in found),
    }
    assert all(kinds.values()), kinds
