"""The parameter channel: every vector both ways, every cut of it, any bytes at all."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ds47.profidrive import (
    Address,
    Options,
    Request,
    Response,
    build_request,
    decode_request,
    decode_response,
    encode_request,
    encode_response,
    error_block,
    make_block,
)

ROOT = Path(__file__).resolve().parents[2]
VECTORS = json.loads((ROOT / "tests/vectors/messages.json").read_text(encoding="utf-8"))
MESSAGES = VECTORS["messages"]
SHARED = ROOT.parent / "shared"


def decode(vector: dict[str, Any], data: bytes | None = None) -> Request | Response:
    data = bytes.fromhex(vector["hex"]) if data is None else data
    options = Options(**vector.get("options", {}))
    if vector["kind"] == "request":
        return decode_request(data, options)
    request = decode_request(bytes.fromhex(vector["request"])) if "request" in vector else None
    return decode_response(data, request, options)


def encode(message: Request | Response) -> bytes:
    return encode_request(message) if isinstance(message, Request) else encode_response(message)


@pytest.mark.parametrize("vector", MESSAGES, ids=lambda vector: vector["id"])
def test_vector(vector: dict[str, Any]) -> None:
    message, expect = decode(vector), vector["expect"]
    for name in ("request_reference", "request_id", "response_id", "axis", "parameter_count"):
        if name in expect:
            assert getattr(message, name) == expect[name], name
    found = [{"rule": flaw.rule, "offset": flaw.offset} for flaw in message.flaws]
    assert found == expect["findings"]
    blocks = [
        parameter for parameter in expect["parameters"] if parameter["value_count"] is not None
    ]
    assert len(message.blocks) == len(blocks)
    for block, parameter in zip(message.blocks, blocks, strict=True):
        assert block.format_name == parameter["format"]
        assert (block.value_count, block.values) == (parameter["value_count"], parameter["values"])
        error = block.error and {"code": block.error.code, "info": block.error.info}
        assert error == parameter["error"]
    if isinstance(message, Request):
        keys = ("attribute_name", "element_count", "pnu", "subindex")
        got = [tuple(getattr(address, key) for key in keys) for address in message.addresses]
        want = ("attribute", "element_count", "pnu", "subindex")
        assert got == [tuple(parameter[key] for key in want) for parameter in expect["parameters"]]
    assert encode(message) == bytes.fromhex(vector["hex"])


FREE = (
    "time-difference-6",
    "sew-data-transport",
    "sew-service-error-one-word",
    "not-supported",
    "vendor-request-not-supported",
)


@pytest.mark.parametrize("vector", MESSAGES, ids=lambda vector: vector["id"])
def test_every_cut_is_a_flaw(vector: dict[str, Any]) -> None:
    data = bytes.fromhex(vector["hex"])
    flawless = not vector["expect"]["findings"]
    for length in range(len(data)):
        message = decode(vector, data[:length])
        assert encode(message) == data[:length]
        # Two bytes less make a 6-byte time difference a 4-byte one, an SEW answer has no printed
        # shape, and 0x80 has no count that could miss a block.
        free = vector["id"] in FREE
        if flawless and not free:
            assert message.flaws, f"cut to {length} bytes"


@pytest.mark.skipif(not SHARED.exists(), reason="the reference vectors are not here")
def test_reference_vectors() -> None:
    vectors = json.loads((SHARED / "reference/seed_vectors.json").read_text(encoding="utf-8"))
    ours = [vector for vector in vectors if vector["channel"] == "ds47"]
    assert ours
    for vector in ours:
        message = decode({"hex": vector["hex"], "kind": vector["role"]})
        expect = vector["expect"]
        assert message.axis == expect["axis"]
        assert message.parameter_count == expect["no_of_parameters"]
        assert message.request_reference == expect["request_reference"]
        values = [(b.format, b.value_count, b.values) for b in message.blocks]
        wanted = [(v["format"], v["no_of_values"], v["values"]) for v in expect.get("values", [])]
        assert values == wanted
        if isinstance(message, Request):
            got = [(a.attribute, a.element_count, a.pnu, a.subindex) for a in message.addresses]
            keys = ("attribute", "no_of_elements", "pnu", "subindex")
            assert got == [tuple(p[key] for key in keys) for p in expect["parameters"]]
        assert not message.flaws
        assert message.shaped
        assert encode(message).hex() == vector["hex"]


def test_real_stacks() -> None:
    log = ROOT / "captures/real-stacks/EXPECTED.jsonl"
    lines = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    ours = [line for line in lines if line["kind"] != "other"]
    assert len(ours) == 328
    for line in ours:
        _compare(line)


def _compare(line: dict[str, Any]) -> None:
    where = f"{line['capture']} {line['n']}"
    request = None
    if line.get("request_hex"):
        request = decode_request(bytes.fromhex(line["request_hex"]))
        assert encode_request(request).hex() == line["request_hex"], where
        asked = [
            tuple(a[key] for key in ("attr", "elements", "pnu", "subindex"))
            for a in line.get("asked") or []
        ]
        got = [(a.attribute, a.element_count, a.pnu, a.subindex) for a in request.addresses]
        assert not asked or got == asked, where
    if not line.get("response_hex"):
        return
    response = decode_response(bytes.fromhex(line["response_hex"]), request)
    assert encode_response(response).hex() == line["response_hex"], where
    assert not response.flaws, where
    blocks = line.get("expected_blocks")
    for block, want in zip(response.blocks, blocks or response.blocks, strict=True):
        if blocks:
            _compare_block(block, want, where)


def _compare_block(block: Any, want: dict[str, Any], where: str) -> None:
    if "error" in want:
        assert (block.error.code, block.error.info) == (want["error"], want["info"]), where
    elif "format" in want:
        assert (block.format, block.value_count) == (want["format"], want["count"]), where
        if isinstance(want["value"], str):
            assert block.raw.hex() == want["value"], where
        elif block.format == 8:
            assert block.raw == struct.pack(f">{len(want['value'])}f", *want["value"]), where
        else:
            assert [int(v) if isinstance(v, str) else v for v in block.values] == want["value"], (
                where
            )
    else:
        assert block.format == 0x40, where


@settings(max_examples=400, deadline=None)
@given(st.binary(max_size=300), st.booleans(), st.booleans())
def test_any_bytes(data: bytes, legacy: bool, v3: bool) -> None:
    options = Options(legacy_g120_formats=legacy, profile_v3_types=v3)
    request = decode_request(data, options)
    assert encode_request(request) == data
    assert encode_response(decode_response(data, request, options)) == data
    assert encode_response(decode_response(data, None, options)) == data


_BLOCKS = st.lists(
    st.tuples(
        st.sampled_from([*range(0x60), *range(0x6E, 0x80)]),
        st.integers(0, 4),
        st.binary(max_size=20),
    ),
    max_size=5,
).map(lambda blocks: b"".join(bytes((code, count)) + raw for code, count, raw in blocks))


@settings(max_examples=400, deadline=None)
@given(st.sampled_from([0x01, 0x02, 0x40, 0x80, 0x81, 0x82, 0xD1]), st.integers(0, 6), _BLOCKS)
def test_any_blocks(identifier: int, count: int, blocks: bytes) -> None:
    data = bytes((1, identifier, 1, count)) + blocks
    response = decode_response(data)
    assert encode_response(response) == data
    for block in response.blocks:
        assert block.format_name is None or block.format_name
        assert block.scaled is None or len(block.scaled) == len(block.values)


def told(answer: bytes) -> list[tuple[str | None, list[Any], list[str]]]:
    """Format, values and rules, whole and cut."""
    return [
        (message.blocks[0].format_name, message.blocks[0].values, [flaw.rule for flaw in message.flaws])
        for cut in (False, True)
        for message in [decode_response(answer, cut=cut)]
    ]  # fmt: skip


def test_what_only_the_end_of_a_message_tells_stays_undecided_without_it() -> None:
    head, value = bytes((1, 1, 1, 2)), bytes((0x0D, 1, 0, 0, 0, 9))
    lacks = ["DS315"]
    ends = head + value + bytes((8, 1, 0))
    assert told(ends) == [
        ("TimeDifference", [9], ["DS317", *lacks]),
        ("TimeDifference", [], []),
    ], "4 bytes or 6"
    odd = head + bytes((5, 1, 7))  # a byte, and its pad
    assert told(odd + bytes((0, 8, 1, 0))) == [("Unsigned8", [7], lacks)] * 2
    assert told(odd + bytes((8, 1, 0))) == [
        ("Unsigned8", [7], ["DS312"]),
        ("Unsigned8", [7], []),
    ]
    cut = decode_response(odd + bytes((8, 1, 0)), cut=True)
    assert encode(cut) == odd + bytes((8, 1, 0))
    unknown = head + bytes((0x66, 1, 0))
    assert told(unknown)[1][2] == told(unknown)[0][2]


def test_many_parameters_are_noted() -> None:
    request = build_request(0x01, [Address(0x10, 1, 922, 0)] * 40)
    assert [flaw.rule for flaw in decode_request(encode_request(request)).flaws] == ["DS304"]


def test_shaped() -> None:
    assert decode_request(bytes.fromhex("01010101100000020000")).shaped
    assert decode_request(bytes.fromhex("0101010110000002000000000000")).shaped
    assert not decode_request(bytes.fromhex("01050101100000020000")).shaped
    assert not decode_request(bytes.fromhex("01010100")).shaped
    assert not decode_request(bytes.fromhex("010101011000000200")).shaped
    assert not decode_request(bytes.fromhex("00000005")).shaped


def test_what_is_built() -> None:
    change = build_request(
        0x02, [Address(0x10, 1, 50304, 0)], [make_block(0x08, [100.0])], reference=2, axis=2
    )
    assert encode_request(change).hex() == "020202011001c4800000080142c80000"
    failed = Response(2, 0x82, 2, 1, [error_block(0x02, 0)])
    assert encode_response(failed).hex() == "02820201440200020000"
    assert encode_response(Response(2, 0x02, 2, 1)).hex() == "02020201"


def test_blocks_are_padded() -> None:
    block = make_block(0x05, [1, 2, 3])
    assert (block.value_count, block.raw.hex(), block.pad.hex()) == (3, "010203", "00")
    block = make_block(0x09, ["PUMP"])
    assert (block.value_count, block.raw.hex(), block.pad.hex()) == (4, "50554d50", "")


@pytest.mark.parametrize(
    ("code", "values"),
    [
        (0x7F, [1]),
        (0x27, ["a"]),
        (0x06, [70000]),
        (0x06, [1.5]),
        (0x08, [1e39]),
        (0x0A, ["0g"]),
        (0x05, [0] * 256),
    ],
)
def test_wrong_use_raises(code: int, values: list[Any]) -> None:
    with pytest.raises(ValueError, match=r"format|values|does not fit|is no"):
        make_block(code, values)
