"""The message vectors against the Python codec and tables: every case, with nothing left out of a case."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from ds47 import spec
from ds47.profidrive import (
    Block,
    Options,
    Request,
    Response,
    decode_request,
    decode_response,
    encode_request,
    encode_response,
)
from ds47.spec.statuses import status_text

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "tests/vectors/messages.json"
VECTORS = json.loads(FILE.read_text(encoding="utf-8"))
PARTS = ("messages", "formats", "errors", "vendors", "statuses")
ran: dict[str, set[int]] = {part: set() for part in PARTS}
"""Which cases of each part were run in this process."""


def mark(part: str, case: dict[str, Any]) -> None:
    ran[part].add(id(case))


def decode(case: dict[str, Any]) -> Request | Response:
    data, options = bytes.fromhex(case["hex"]), Options(**case.get("options", {}))
    if case["kind"] == "request":
        return decode_request(data, options)
    request = decode_request(bytes.fromhex(case["request"])) if "request" in case else None
    return decode_response(data, request, options)


def shown_block(block: Block) -> dict[str, Any]:
    error = block.error
    return {
        "format": block.format_name,
        "value_count": block.value_count,
        "values": block.values,
        "scaled": block.scaled,
        "error": error and {"code": error.code, "info": error.info},
        "words": error and error.words,
        "offset": block.offset,
    }


def shown(message: Request | Response, case: dict[str, Any]) -> dict[str, Any]:
    """A decoded message in the words of a vector."""
    request: Request | None = message if isinstance(message, Request) else None
    if request is None and "request" in case:
        request = decode_request(bytes.fromhex(case["request"]))
    addresses = [
        {
            "attribute": each.attribute_name,
            "element_count": each.element_count,
            "pnu": each.pnu,
            "subindex": each.subindex,
        }
        for each in (request.addresses if request else [])
    ]
    blocks = [shown_block(block) for block in message.blocks]
    number = max(len(addresses), len(blocks))
    no_address = dict.fromkeys(("attribute", "element_count", "pnu", "subindex"))
    no_block = shown_block(Block(0, 0, [], None, None, b"")) | {
        "format": None,
        "value_count": None,
        "offset": None,
    }
    pairs = zip(
        addresses + [no_address] * (number - len(addresses)),
        blocks + [no_block] * (number - len(blocks)),
        strict=True,
    )
    result: dict[str, Any] = {"request_reference": message.request_reference}
    if isinstance(message, Request):
        result |= {"request_id": message.request_id, "operation": message.operation}
    else:
        result["response_id"] = message.response_id
    return result | {
        "axis": message.axis,
        "parameter_count": message.parameter_count,
        "parameters": [{**address, **block} for address, block in pairs],
        "rest": message.rest.hex(),
        "shaped": message.shaped,
        "findings": [{"rule": flaw.rule, "offset": flaw.offset} for flaw in message.flaws],
        "args": [flaw.args for flaw in message.flaws],
    }


def typed(value: Any) -> Any:
    """A value in which 1 and 1.0, and 0.0 and -0.0, are not the same."""
    if isinstance(value, dict):
        return {key: typed(item) for key, item in value.items()}
    if isinstance(value, list):
        return [typed(item) for item in value]
    return repr(value) if isinstance(value, float) else value


def unlike(where: str, found: Any, wanted: Any) -> Iterator[str]:
    """What differs, down to the single value."""
    if isinstance(found, dict) and isinstance(wanted, dict) and found.keys() == wanted.keys():
        for key, value in wanted.items():
            yield from unlike(f"{where} {key}", found[key], value)
    elif isinstance(found, list) and isinstance(wanted, list) and len(found) == len(wanted):
        for number, value in enumerate(wanted, start=1):
            yield from unlike(f"{where} {number}", found[number - 1], value)
    elif found != wanted:
        yield f"{where}: codec says {found}, vector says {wanted}"


@pytest.mark.parametrize("case", VECTORS["messages"], ids=lambda case: case["id"])
def test_message(case: dict[str, Any]) -> None:
    mark("messages", case)
    message = decode(case)
    problems = list(unlike(case["id"], typed(shown(message, case)), typed(case["expect"])))
    assert not problems, "\n".join(problems)
    again = encode_request(message) if isinstance(message, Request) else encode_response(message)
    assert again.hex() == case["hex"]
    assert message.length == len(case["hex"]) // 2


def code_of(case: dict[str, Any]) -> str:
    return f"0x{case['format']:02X}-{case['raw']}"


@pytest.mark.parametrize("case", VECTORS["formats"], ids=code_of)
def test_format(case: dict[str, Any]) -> None:
    """The bytes as a block of a response and of a change."""
    mark("formats", case)
    name = f"format 0x{case['format']:02X}"
    raw, count = bytes.fromhex(case["raw"]), case["value_count"]
    block = bytes((case["format"], count)) + raw + bytes(len(raw) % 2)
    address = bytes((0x10, count, 0x03, 0x9A, 0, 0))
    for message in (
        decode_response(b"\x01\x01\x01\x01" + block),
        decode_request(b"\x01\x02\x01\x01" + address + block),
    ):
        rules = [(flaw.rule, flaw.offset) for flaw in message.flaws]
        zero = [("DS310", 11)] if count == 0 and isinstance(message, Request) else []
        assert rules == zero, f"{name}: findings {rules}"
        found = shown_block(message.blocks[0])
        for key in ("values", "scaled"):
            wanted = typed(case[key])
            assert typed(found[key]) == wanted, f"{name}: codec says {found[key]}, vector {wanted}"


@pytest.mark.parametrize("case", VECTORS["formats"], ids=code_of)
def test_format_in_the_table(case: dict[str, Any]) -> None:
    name, row = f"format 0x{case['format']:02X}", spec.formats().get(case["format"])
    assert row is not None, f"{name} is not in the table"
    for key in ("name", "size", "unit"):
        says = getattr(row, key)
        assert says == case[key], f"{name}: table says {key} {says}, vector says {case[key]}"


def differences(part: str, key: str, found: Any) -> list[str]:
    """What a part of the vectors has to say against `found(case, lang)`; `key` names a case."""
    problems = []
    for case in VECTORS[part]:
        mark(part, case)
        for lang in ("en", "zh"):
            text = found(case, lang)
            if text != case[lang]:
                name = key.format(**case, lang=lang)
                problems.append(f"{name}: table says {text!r}, vector says {case[lang]!r}")
    return problems


def test_error_texts() -> None:
    def found(case: dict[str, Any], lang: str) -> str:
        return spec.error_text(case["code"], lang, case["vendor_id"])

    problems = differences("errors", "error 0x{code:02X} (vendor {vendor_id}, {lang})", found)
    assert not problems, "\n".join(problems)


def test_meaning_of_the_second_error_word() -> None:
    problems = [
        f"error 0x{case['code']:02X}: table says info is {says}, vector says {case['info']}"
        for case in VECTORS["errors"]
        if (says := spec.error_info_meaning(case["code"])) != case["info"]
    ]
    assert not problems, "\n".join(problems)


def test_tables_of_vendors() -> None:
    tables = {vendor.name: vendor for vendor in spec.vendors()}

    def found(case: dict[str, Any], lang: str) -> str | None:
        vendor = tables.get(case["vendor"])
        row = vendor.errors.get(case["code"]) if vendor else None
        text = row and getattr(row, lang)
        return text and row and text.format(code=case["code"], above=case["code"] - row.code)

    problems = differences("vendors", "error 0x{code:02X} ({vendor}, {lang})", found)
    assert not problems, "\n".join(problems)
    named = {case["vendor"]: case["vendor_id"] for case in VECTORS["vendors"]}
    assert {name: vendor.id for name, vendor in tables.items() if vendor.errors} == named


def test_status_texts() -> None:
    def found(case: dict[str, Any], lang: str) -> str:
        return status_text(int(case["status"], 16), lang)

    problems = differences("statuses", "status {status} ({lang})", found)
    assert not problems, "\n".join(problems)


def test_file_obeys_its_schema() -> None:
    schema = json.loads(FILE.with_suffix(".schema.json").read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    problems = [
        f"{error.json_path}: {error.message}"
        for error in Draft202012Validator(schema).iter_errors(VECTORS)
    ]
    assert problems == []


def test_declared_numbers_are_those_of_the_cases() -> None:
    assert VECTORS["count"] == {part: len(VECTORS[part]) for part in PARTS}
    names = [case["id"] for case in VECTORS["messages"]]
    assert len(set(names)) == len(names)


def test_the_tool_writes_this_file(tmp_path: Path) -> None:
    tool = ROOT / "tests/vectors/sources/messages.py"
    target = tmp_path / FILE.name
    subprocess.run([sys.executable, str(tool), str(target)], check=True, timeout=60)
    assert target.read_bytes() == FILE.read_bytes(), f"run {tool.name} again"


def test_every_declared_case_ran(request: pytest.FixtureRequest) -> None:
    """Last in this file: with the whole file selected, no case may have been passed over."""
    here = [item for item in request.session.items if item.path == Path(__file__)]
    names = [getattr(item, "originalname", "") for item in here]
    whole = names.count("test_message") == VECTORS["count"]["messages"]
    whole &= names.count("test_format") == VECTORS["count"]["formats"]
    whole &= {"test_error_texts", "test_tables_of_vendors", "test_status_texts"} <= set(names)
    if not whole:
        pytest.skip("only a part of the file is run here")
    assert {part: len(cases) for part, cases in ran.items()} == VECTORS["count"]
