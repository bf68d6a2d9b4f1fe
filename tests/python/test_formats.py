"""Every format of spec/formats.toml: its value, its scaling, and back to the bytes."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47 import spec
from ds47.profidrive import decode_response, make_block
from ds47.profidrive.formats import codec, float32_value

VECTORS = json.loads(
    (Path(__file__).resolve().parents[1] / "vectors/messages.json").read_text(encoding="utf-8")
)["formats"]


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: f"0x{vector['format']:02X}")
def test_format(vector: dict[str, Any]) -> None:
    raw, count = bytes.fromhex(vector["raw"]), vector["value_count"]
    block_bytes = bytes((vector["format"], count)) + raw + bytes(len(raw) % 2)
    response = decode_response(b"\x01\x01\x01\x01" + block_bytes)
    assert not response.flaws
    (block,) = response.blocks
    assert block.values == vector["values"]
    assert [type(value) for value in block.values] == [type(value) for value in vector["values"]]
    assert block.scaled == vector["scaled"]
    assert block.format_name == spec.formats()[vector["format"]].name
    again = make_block(vector["format"], block.values)
    assert bytes((again.format, again.value_count)) + again.raw + again.pad == block_bytes


def test_every_sized_format_has_a_vector() -> None:
    sized = {row.code for row in spec.formats().values() if row.size is not None}
    assert sized - {0x44} == {vector["format"] for vector in VECTORS}


def test_unsized_formats_have_no_codec() -> None:
    assert codec(0x27) is None
    assert codec(0x7F) is None


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_float32_round_trips_in_its_width(number: float) -> None:
    shown = float32_value(number)
    assert isinstance(shown, float)
    assert struct.pack(">f", shown) == struct.pack(">f", number)
    assert len(repr(shown)) <= len(repr(number))


def test_not_finite_floats_are_words() -> None:
    assert make_block(0x08, ["NaN", "Infinity"]).raw.hex() == "7fc000007f800000"


WIRES = st.one_of(
    st.binary(min_size=4, max_size=4),
    st.floats(-5000, 5000).map(lambda number: struct.pack(">f", round(number, 1))),
    st.floats(-1, 1).map(lambda number: struct.pack(">f", number)),
    st.integers(-(10**9), 10**9).map(lambda number: struct.pack(">f", number / 1000)),
    st.integers(-40, 40).map(lambda power: struct.pack(">f", 10.0 ** max(-37, min(38, power)))),
)


@pytest.mark.slow
@settings(max_examples=2000)
@given(WIRES)
def test_the_value_of_a_float32_gives_its_bytes_again(wire: bytes) -> None:
    (number,) = struct.unpack(">f", wire)
    value = float32_value(number)
    assert isinstance(value, str) or struct.pack(">f", value) == wire
