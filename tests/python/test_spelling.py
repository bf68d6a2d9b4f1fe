"""How the number of a parameter is written: the same in Python and Lua, and read back in every form."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from lua_program import LUAS, lua_program

from ds47 import spec
from ds47.profidrive.naming import LARGEST, element, spelled, spelling
from ds47.profidrive.notation import parse_request_line

NUMBERS = sorted({0, 7, 999, 1000, 9999, 10000, LARGEST, *spec.parameters()})
FAMILIES = (None, *spec.FAMILIES)


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (10, "p0010"),
        (945, "r0945"),
        (964, "r0964"),
        (922, "p0922"),
        (1120, "p1120"),
        (61000, "61000"),
        (59999, "p59999"),
    ],
)
def test_numbers_are_printed_as_manuals_have_them(number, text):
    assert spelling(number) == text
    assert element(number, 3) == f"{text}[3]"


@pytest.mark.parametrize("number", NUMBERS)
def test_what_is_printed_is_read_back(number):
    text = spelling(number)
    found = spelled(text)
    assert found is not None
    assert (found.number, found.letter) == (number, text[0] if number < 60000 else None)
    forms = (text, text.upper(), f"p{number}", f"r{number}", f"PNU{number}", str(number))
    assert {parse_request_line(f"read {each}").addresses[0].pnu for each in forms} == {number}


@pytest.mark.parametrize(
    ("number", "family", "text"),
    [
        (700, "micromaster", "P0700"),
        (22, "micromaster", "P0022"),
        (21, "micromaster", "r0021"),
        (947, "micromaster", "r0947"),
        (918, "micromaster", "P0918"),
        (61000, "micromaster", "61000"),
        (700, "sinamics", "p0700"),
        (21, "sinamics", "r0021"),
        (21, "profile", "p0021"),
        (722, "profile", "p0722"),
        (947, "profile", "r0947"),
        (21, None, "r0021"),
    ],
)
def test_the_letter_is_that_of_the_family(number, family, text):
    assert spelling(number, family) == text


@pytest.mark.parametrize("family", spec.FAMILIES)
def test_a_letter_of_a_family_is_the_access_that_its_tables_say(family):
    for number in NUMBERS:
        known = spec.parameter(number, family)
        if number < 60000 and known is not None and known.access is not None:
            assert spelling(number, family)[0].lower() == known.access


@pytest.mark.parametrize("lua", LUAS)
def test_lua_writes_the_same(lua, repository: Path):
    done = subprocess.run(
        [lua_program(lua), "tests/lua/spelling.lua"],
        input="".join(
            f"{number} {family or ''}\n" for family in FAMILIES for number in NUMBERS
        ),
        text=True, cwd=repository, capture_output=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == [
        spelling(number, family) for family in FAMILIES for number in NUMBERS
    ]
