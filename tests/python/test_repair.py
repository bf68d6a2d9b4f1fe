"""The one change that makes sense of a request (diagnosis/repair), and what is suggested of it."""

from __future__ import annotations

import json
import random
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from ds47 import spec
from ds47.analysis import analyze
from ds47.cli import main
from ds47.diagnosis import suggest
from ds47.diagnosis.repair import Repair, find
from ds47.profidrive import (
    Address,
    Options,
    build_request,
    decode_request,
    encode_request,
    make_block,
)
from ds47.report import sentences
from ds47.spec.semantics import diagnosis_words, known

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "tests" / "vectors" / "repairs.json"
VECTORS = json.loads(FILE.read_text("utf-8"))
CASES: list[dict[str, Any]] = VECTORS["cases"]
MESSAGES = json.loads((FILE.parent / "messages.json").read_text("utf-8"))["messages"]
WELL_KNOWN = frozenset(spec.parameters())


def repair_of(case: dict[str, Any]) -> Repair | None:
    """What `find` says to a case of repairs.json, or to a question in the same form."""
    options = Options(**case.get("options", {}))
    request = bytes.fromhex(case["request"])
    formats = {int(pnu): code for pnu, code in case.get("formats", {}).items()}
    errors = {int(number): code for number, code in case.get("errors", {}).items()}
    message = decode_request(request, options)
    there = set(case.get("known", ()))
    return find(request, message, errors, there.__contains__, formats.get, options)


def shown(repair: Repair | None) -> dict[str, Any] | None:
    """A repair as repairs.json has it."""
    if repair is None:
        return None
    return {
        "rule": repair.rule,
        "what": repair.what,
        "request": repair.request.hex(),
        "number": repair.number,
        "args": repair.args,
    }


# --- vectors ------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["id"])
def test_repair(case: dict[str, Any]) -> None:
    assert shown(repair_of(case)) == case["expect"]


@pytest.mark.parametrize(
    ("case", "bits"),
    [
        ("type-float-bits", "bits_same"),
        ("type-float-bits-whole", "number_other"),
        ("type-integer-to-float", "number_other"),
        ("type-number-to-float", "number_same"),
        ("type-number-to-byte", "number_same"),
        ("type-same-bits", "bits_same"),
        ("type-same-bits-normalised", "bits_same"),
    ],
)
def test_what_two_types_have_in_common(case: str, bits: str) -> None:
    """The bits of 1092616192 are those of 10.0; where 10 is meant, neither they nor the number stay."""
    found = repair_of(next(each for each in CASES if each["id"] == case))
    assert found is not None
    assert [each.bits for each in found.each] == [bits]


def test_file_obeys_its_schema() -> None:
    schema = json.loads(FILE.with_suffix(".schema.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    problems = [
        f"{error.json_path}: {error.message}"
        for error in Draft202012Validator(schema).iter_errors(VECTORS)
    ]
    assert problems == []


def test_count_is_the_number_of_cases() -> None:
    assert VECTORS["count"] == len(CASES) == len({case["id"] for case in CASES})


@pytest.mark.parametrize("kind", ["all-bytes", "fields", "values", "zeros", "even", "type"])
def test_each_candidate_has_hits_and_near_misses(kind: str) -> None:
    hits = [case["expect"] is not None for case in CASES if case["id"].startswith(kind)]
    assert hits.count(True) >= 3
    assert hits.count(False) >= 3


@pytest.mark.parametrize("case", [c for c in CASES if c["expect"]], ids=lambda case: case["id"])
def test_a_repair_fills_its_rule_and_is_sound_itself(case: dict[str, Any]) -> None:
    expect = case["expect"]
    words = {"what": diagnosis_words("en")[expect["what"]]} if expect["what"] else {}
    words |= {"case": "", "bits": ""}  # of DS714: known where the capture is
    rule = spec.rules()[expect["rule"]]
    assert "{" not in rule.message.format(**words, **expect["args"])
    request = bytes.fromhex(expect["request"])
    assert decode_request(request, Options(**case.get("options", {}))).flaws == []
    again = {**case, "request": expect["request"]}
    again.pop("errors", None)
    assert repair_of(again) is None


# --- what must stay without a repair --------------------------------------------------------------


def nothing(request: bytes, options: Options | None = None) -> bool:
    options = Options() if options is None else options
    message = decode_request(request, options)
    return find(request, message, {}, WELL_KNOWN.__contains__, lambda _: None, options) is None


def test_no_vector_of_messages_is_repaired() -> None:
    requests = [vector for vector in MESSAGES if vector["kind"] == "request"]
    assert len(requests) > 50
    wrong = [
        vector["id"]
        for vector in requests
        if not nothing(bytes.fromhex(vector["hex"]), Options(**vector.get("options", {})))
    ]
    assert wrong == []


ABOUT_REPAIRS = (
    "diagnosis-value-in-wrong-type",
    "diagnosis-bytes-swapped",
    "diagnosis-data-block-layout",
)
"""Captures of the lab that show what is repaired, also where the drive took it."""


def test_no_request_of_a_capture_without_error_is_repaired() -> None:
    seen = 0
    for path in sorted((ROOT / "captures").glob("*.pcap*")):
        if path.name.startswith(ABOUT_REPAIRS):
            continue
        for transaction in analyze(path).transactions:
            if transaction.state == "ok" and transaction.request:
                seen += 1
                assert nothing(transaction.request), (path.name, transaction.id)
    assert seen > 200


ADDRESSES = st.builds(
    Address,
    st.just(0x10),
    st.just(1),
    st.integers(1, 0xFFFF),
    st.integers(0, 0xFFFF - 1),
)
WIDTHS = {2: 1, 3: 2, 4: 4, 5: 1, 6: 2, 7: 4, 0x37: 8, 0x38: 8, 0x41: 1, 0x42: 2, 0x43: 4}


@st.composite
def values(draw: st.DrawFn) -> tuple[int, list[Any]]:
    code = draw(st.sampled_from([*WIDTHS, 0x08, 0x0F]))
    if code in WIDTHS:
        raw = draw(st.binary(min_size=WIDTHS[code], max_size=WIDTHS[code]))
        signed = spec.formats()[code].pack.islower()
        return code, [int.from_bytes(raw, "big", signed=signed)]
    least, most = 2.0**-100, 2.0**99
    number = draw(st.floats(least, most, width=32 if code == 0x08 else 64))
    return code, [draw(st.sampled_from([0.0, -number, number]))]


@given(st.lists(st.tuples(ADDRESSES, values()), min_size=1, max_size=6))
def test_no_valid_change_is_repaired(items: list[tuple[Address, tuple[int, list[Any]]]]) -> None:
    blocks = [make_block(code, numbers) for _, (code, numbers) in items]
    request = build_request(0x02, [address for address, _ in items], blocks)
    assert nothing(encode_request(request))


@given(st.lists(ADDRESSES, min_size=1, max_size=39), st.integers(1, 255), st.integers(0, 255))
def test_no_valid_read_is_repaired(addresses: list[Address], reference: int, axis: int) -> None:
    assert nothing(encode_request(build_request(0x01, addresses, reference=reference, axis=axis)))


# --- any bytes ----------------------------------------------------------------------------------


@given(
    st.binary(max_size=200),
    st.dictionaries(st.integers(0, 5), st.integers(0, 255), max_size=3),
    st.sampled_from([None, *range(256)]),
    st.booleans(),
)
def test_any_bytes(data: bytes, errors: dict[int, int], code: int | None, there: bool) -> None:
    for options in (Options(), Options(True, True, 0x2A)):
        message = decode_request(data, options)
        repair = find(data, message, errors, lambda _: there, lambda _: code, options)
        assert repair is None or decode_request(repair.request, options).flaws == []


def test_cut_and_changed_requests_of_the_vectors() -> None:
    dice = random.Random(714)
    for case in CASES:
        request = bytes.fromhex(case["request"])
        for end in range(len(request)):
            repair_of({**case, "request": request[:end].hex()})
        for _ in range(20):
            at = dice.randrange(len(request))
            broken = request[:at] + dice.randbytes(1) + request[at + 1 :]
            repair_of({**case, "request": broken.hex()})


@pytest.mark.parametrize("more", [0, 2])
def test_the_search_ends_at_twice_the_channel(more: int) -> None:
    request = bytes.fromhex("0300010002000a00" + "10000100c47f0000" * 10)
    request += bytes(2 * known().channel_bytes - len(request) + more)
    repair = repair_of({"request": request.hex()})
    assert (repair is None) == (more > 0)


def test_a_long_line_is_cut() -> None:
    request = bytes.fromhex("0300010002000a00" + "10000100c47f0000" * 10)
    repair = repair_of({"request": request.hex()})
    assert repair is not None
    assert repair.args["meant"] == "read ref 3 axis 2" + " p50303[0]" * 10
    told = sentences.words("DS716", {"what": repair.what, **repair.args})
    assert "read ref 3 axis 2 p50303[0] p50303[0]" in told
    assert told.endswith("...")


# --- suggestions ----------------------------------------------------------------------------------


def test_the_forms_of_a_corrected_request() -> None:
    shown = suggest.corrected(bytes.fromhex("03010201 1001c47f0000"))
    assert shown.hex == "030102011001c47f0000"
    assert shown.words == ["16#0301", "16#0201", "16#1001", "16#C47F", "16#0000"]
    assert shown.scl.split("\n") == [
        "// #request : Array[0..9] of Byte",
        "#request[0] := 16#03; #request[1] := 16#01; #request[2] := 16#02; #request[3] := 16#01;",
        "#request[4] := 16#10; #request[5] := 16#01; #request[6] := 16#C4; #request[7] := 16#7F;",
        "#request[8] := 16#00; #request[9] := 16#00;",
        "#length := 10;",
    ]
    assert shown.encode == "ds47 encode 'read ref 3 axis 2 p50303[0]'"


def test_an_array_of_no_byte_has_one() -> None:
    """TIA Portal knows no array that ends before it begins; LEN says how much of it counts."""
    assert suggest.scl(b"") == "// #request : Array[0..0] of Byte\n#length := 0;"


def test_an_odd_last_byte_is_a_byte() -> None:
    assert suggest.plc_words(b"\x03\x01\x02") == ["16#0301", "16#02"]


def requests_with_a_line() -> Iterator[bytes]:
    yield from (bytes.fromhex(case["expect"]["request"]) for case in CASES if case["expect"])
    yield from (bytes.fromhex(v["hex"]) for v in MESSAGES if v["kind"] == "request")
    yield bytes.fromhex("020201011007 0b540000 0907 69742773206120 00")


def test_the_encode_line_gives_exactly_these_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    ran = 0
    for request in dict.fromkeys(requests_with_a_line()):
        command = suggest.corrected(request).encode
        if command is None:
            continue
        program, *words = shlex.split(command)
        assert program == "ds47"
        assert main(words) == 0
        assert bytes.fromhex(capsys.readouterr().out) == request
        ran += 1
    assert ran > 50


@pytest.mark.parametrize(
    "request_hex",
    ["", "0301", "030102011001c47f00", "030102011001c47f000001", "020201011001039a0000ff010000"],
)
def test_no_line_for_what_no_line_can_say(request_hex: str) -> None:
    assert suggest.corrected(bytes.fromhex(request_hex)).encode is None


TWO = bytes.fromhex("02020102 1001039a0000 10030b560001 06010001 08033f8000004000000040400000")


def test_some_of_the_parameters() -> None:
    message = decode_request(TWO)
    assert suggest.only(message, [0]).hex() == "020201011001039a000006010001"
    assert suggest.only(message, [1]).hex() == ("0202010110030b56000108033f8000004000000040400000")
    assert suggest.only(message, [0, 1]) == TWO


def change_of(pnu: int, value: int):  # type: ignore[no-untyped-def]
    block = bytes((0x06, 1)) + value.to_bytes(2)
    return decode_request(bytes.fromhex("02020101 1001") + pnu.to_bytes(2) + bytes(2) + block)


@pytest.mark.parametrize("pnu", [9300, 9399, 9500, 9601, 9899, 9900, 9949, 10_000, 10_299])
def test_what_is_never_written(pnu: int) -> None:
    assert not suggest.is_harmless(change_of(pnu, 1))
    assert suggest.is_harmless(
        decode_request(bytes((1, 1, 1, 1, 16, 1)) + pnu.to_bytes(2) + bytes(2))
    )


@pytest.mark.parametrize("pnu", [9299, 9400, 9499, 9950, 9999, 10_300])
def test_what_may_be_written(pnu: int) -> None:
    assert suggest.is_harmless(change_of(pnu, 1))


def test_safety_is_never_commissioned() -> None:
    assert not suggest.is_harmless(change_of(10, 95))
    assert suggest.is_harmless(change_of(10, 1))


def test_another_axis() -> None:
    assert suggest.with_axis(TWO, 5) == TWO[:2] + b"\x05" + TWO[3:]
    assert suggest.with_axis(b"\x01\x01", 5) == b"\x01\x01"


@pytest.mark.parametrize(
    ("number", "subindex", "elements", "expected"),
    [
        (1, 0, 1, "02020102 1001039a0000 10010b560000 06010001 08013f800000"),
        (1, 2, 2, "02020102 1001039a0000 10020b560002 06010001 08023f80000040000000"),
        (1, 0, 0, "02020102 1001039a0000 10000b560000 06010001 08013f800000"),
        (1, 0, 4, None),
        (2, 0, 1, None),
        (-1, 0, 1, None),
        (1, 0, 256, None),
        (1, 65536, 1, None),
    ],
)
def test_other_elements_of_a_change(
    number: int, subindex: int, elements: int, expected: str | None
) -> None:
    fixed = suggest.with_elements(decode_request(TWO), TWO, number, subindex, elements)
    assert fixed == (None if expected is None else bytes.fromhex(expected))


def test_other_elements_of_values_of_one_byte() -> None:
    data = bytes.fromhex("02020101 10020b540000 05020102")
    fixed = suggest.with_elements(decode_request(data), data, 0, 0, 1)
    assert fixed == bytes.fromhex("02020101 10010b540000 05010100")


@pytest.mark.parametrize(("subindex", "elements"), [(65536, 1), (-1, 1), (0, 256), (0, -1)])
def test_other_elements_of_a_read_fit_into_their_fields(subindex: int, elements: int) -> None:
    data = bytes.fromhex("01010101 1003039a0001")
    assert suggest.with_elements(decode_request(data), data, 0, subindex, elements) is None


def test_other_elements_of_a_read() -> None:
    data = bytes.fromhex("01010102 1003039a0001 10010b540000")
    fixed = suggest.with_elements(decode_request(data), data, 0, 0, 1)
    assert fixed == bytes.fromhex("01010102 1001039a0000 10010b540000")


@pytest.mark.parametrize(
    "change",
    [
        "02020101 10020b540000",
        "02020101 10020b540000 08023f800000",
        "02020101 10020b540000 09024142",
        "02020101 10020b540000 44020005 0000",
    ],
)
def test_other_elements_of_a_change_that_cannot_be_shortened(change: str) -> None:
    data = bytes.fromhex(change)
    assert suggest.with_elements(decode_request(data), data, 0, 0, 1) is None


def test_the_same_numbers_in_another_format() -> None:
    block = suggest.as_format(0x08, [10])
    assert block is not None
    assert (block.raw.hex(), block.values) == ("41200000", [10.0])
    assert suggest.as_format(0x06, [10.5]) is None
    assert suggest.as_format(0x06, [70000]) is None
    assert suggest.as_format(0x08, [16777217]) is None
    assert suggest.as_format(0x7F, [1]) is None
