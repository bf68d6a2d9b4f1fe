"""Nothing in spec/ is without a vector: what each table holds against what the vectors name.

Each test makes the set of what is not covered; `NOT_YET` is the list of what may be in it, and it is empty.
Names are those of the tables, so that a failure says what is missing.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ds47 import spec
from ds47.analysis import AnalysisOptions
from ds47.profidrive import Options

VECTORS = Path(__file__).resolve().parents[1] / "vectors"
MESSAGES = json.loads((VECTORS / "messages.json").read_text(encoding="utf-8"))
CONVERSATIONS = [
    case
    for name in ("conversations.json", "diagnoses.json")
    for case in json.loads((VECTORS / name).read_text(encoding="utf-8"))["cases"]
]
CASES = MESSAGES["messages"]

NOT_YET: frozenset[str] = frozenset()
"""What spec/ has and no vector shows yet."""

NO_MESSAGE = frozenset({"DS316", "DS711"})
"""Rules about a message that it cannot show alone: the limit comes from an earlier one, and whether the
record was cut by the capture from its block. A conversation shows them."""

NOT_OF_THE_WIRE = frozenset(
    {
        "vendor_id",
        "lists",
        "lang",
        "slow_ms",
        "select",
        "ignore",
        "codec",
        "digest",
        "pkw_layouts",
        "channels",
        "cyclic",
        "ppos",
        "s7",
    }
)
"""Options that choose texts or what is shown, or are about cyclic frames, and no meaning of records.

Other tests have them.
"""

ELSEWHERE = {
    "DS601": "two engines disagree about one capture, which no step of a conversation makes",
    "DS602": "a user expects other parameters, in a list that no conversation has: test_expected.py",
    "DS109": "more than ds47 keeps is open at once, which takes thousands of frames: test_limits.py",
    **{
        rule: "it is about cyclic frames, and these are no conversation: test_parameter_channels.py"
        for rule in spec.rules()
        if rule.startswith("DS5")
    },
    **{
        rule: "it is about a line of PROFIBUS, and these are RPC: test_profibus_bus.py"
        for rule in spec.rules()
        if rule.startswith("DS8")
    },
    **{
        rule: "it is about S7 communication, and these are RPC: test_s7_judge.py, test_s7_moments.py"
        for rule in spec.rules()
        if rule.startswith("DS9")
    },
    **{
        rule: "only the whole capture shows it, and only to the analyzer: test_diagnoses.py"
        for rule, row in spec.rules().items()
        if rule.startswith("DS7") and row.scope == "capture"
    },
}
"""Rules that no conversation can show, and why."""


def covered(wanted: set[str], shown: set[str], source: str = "messages.py") -> None:
    """`source` is the file in tests/vectors/sources/ that has to show it."""
    assert wanted, "the table is empty"
    missing = wanted - shown
    told = f"tests/vectors/sources/{source} has nothing for {', '.join(sorted(missing))}; then make generated"
    assert missing == NOT_YET & wanted, told


def blocks(case: dict[str, Any]) -> list[tuple[int, dict[str, Any]]]:
    """The format byte of each block of a message, and what it must become."""
    data = bytes.fromhex(case["hex"])
    found = [each for each in case["expect"]["parameters"] if each["offset"] is not None]
    return [(data[each["offset"]], each) for each in found]


def test_formats() -> None:
    in_messages = {
        f"format 0x{code:02X} {block['format'] or 'Error'}"
        for case in CASES
        if not case.get("options")
        for code, block in blocks(case)
    }
    alone = {f"format 0x{each['format']:02X} {each['name']}" for each in MESSAGES["formats"]}
    table = {f"format 0x{code:02X} {row.name}" for code, row in spec.formats().items()}
    covered(table, in_messages | alone)


def test_scaled_formats_have_a_scaled_vector() -> None:
    shown = {each["name"] for each in MESSAGES["formats"] if each["scaled"] is not None}
    kinds = {"date", "time_of_day", "duration", "with_status"}
    rows = spec.formats().values()
    assert {row.name for row in rows if row.divide or row.kind in kinds} == shown


def test_formats_with_two_sizes() -> None:
    sizes: dict[str, set[int]] = {}
    for case in CASES:
        for code, block in blocks(case):
            row = spec.formats().get(code)
            if row and row.other_size and block["value_count"]:
                data, at = case["hex"], block["offset"]
                if not case["expect"]["findings"]:
                    follows = [b["offset"] for _, b in blocks(case) if b["offset"] > at]
                    end = min(follows, default=len(data) // 2)
                    sizes.setdefault(row.name, set()).add((end - at - 2) // block["value_count"])
    for row in spec.formats().values():
        if row.other_size:
            assert sizes[row.name] == {row.size, row.other_size}


def test_attributes() -> None:
    shown = {each["attribute"] for case in CASES for each in case["expect"]["parameters"]}
    vendor = {f"0x{code:02X}" for code in spec.vendor_attributes()}
    covered({row.name for row in spec.attributes().values()} | vendor, shown)


def ids(kind: str, shaped: bool) -> set[str]:
    cases = [case for case in CASES if case["kind"] == kind and case["expect"]["shaped"] is shaped]
    return {f"{kind} id 0x{code:02X}" for case in cases if (code := case["expect"][f"{kind}_id"])}


def test_request_ids() -> None:
    covered({f"request id 0x{code:02X}" for code in spec.request_ids()}, ids("request", True))
    operations = {case["expect"].get("operation") for case in CASES}
    assert {row.operation for row in spec.request_ids().values()} | {"unknown"} == operations - {
        None
    }


def test_response_ids() -> None:
    covered({f"response id 0x{code:02X}" for code in spec.response_ids()}, ids("response", True))


def test_error_numbers() -> None:
    texts = {(each["vendor_id"], each["code"]) for each in MESSAGES["errors"]}
    known = {None, *(vendor.id for vendor in spec.vendors() if vendor.errors)}
    covered(
        {f"error 0x{code:02X} (vendor {vendor})" for vendor in known for code in range(256)},
        {f"error 0x{code:02X} (vendor {vendor})" for vendor, code in texts},
        "message_texts.txt",
    )
    strangers = {vendor for vendor, _ in texts} - known
    assert strangers, "no vendor without a table"
    in_messages = {
        each["error"]["code"] for case in CASES for _, each in blocks(case) if each["error"]
    }
    covered(
        {f"error 0x{code:02X}" for code in range(256)},
        {f"error 0x{c:02X}" for c in in_messages if c is not None},
    )


def test_tables_of_vendors() -> None:
    table = {
        f"error 0x{code:02X} ({vendor.name})" for vendor in spec.vendors() for code in vendor.errors
    }
    shown = {f"error 0x{each['code']:02X} ({each['vendor']})" for each in MESSAGES["vendors"]}
    covered(table, shown, "message_texts.txt")
    assert shown == table


def test_statuses() -> None:
    values = [int(each["status"], 16) for each in MESSAGES["statuses"]]
    words = spec.status("en")
    covered(
        {f"error code 0x{code:02X}" for code in words.code},
        {f"error code 0x{value >> 24:02X}" for value in values},
        "message_texts.txt",
    )
    covered(
        {f"error decode 0x{code:02X}" for code in words.decode},
        {f"error decode 0x{value >> 16 & 0xFF:02X}" for value in values},
        "message_texts.txt",
    )
    for decode, table in ((0x80, words.access), (0x81, words.protocol)):
        covered(
            {f"error code 1 0x{code:02X} ({decode:02X})" for code in table},
            {
                f"error code 1 0x{value >> 8 & 0xFF:02X} ({decode:02X})"
                for value in values
                if value >> 16 & 0xFF == decode
            },
            "message_texts.txt",
        )
    for lang in ("en", "zh"):
        texts = [each[lang] for each in MESSAGES["statuses"]]
        for name, word in spec.status(lang).words.items():
            assert any(word.split("{")[0] in text for text in texts), f"no vector for word {name}"


def test_dialects() -> None:
    shown = {
        f"{option} 0x{code:02X} as {block['format']}"
        for case in CASES
        for option in case.get("options", {})
        for code, block in blocks(case)
    }
    names = set(Options._fields) - NOT_OF_THE_WIRE
    table = {
        f"{option} 0x{code:02X} as {spec.formats()[meaning].name}"
        for option in names
        for code, meaning in spec.dialect(option).items()
    }
    covered(table, shown)
    without = {code for case in CASES if not case.get("options") for code, _ in blocks(case)}
    codes = {code for option in names for code in spec.dialect(option)}
    assert codes <= without | {each["format"] for each in MESSAGES["formats"]}
    assert {option for case in CASES for option in case.get("options", {})} == names


def test_options_of_an_analysis() -> None:
    names = set(AnalysisOptions._fields)
    shown = {option for case in CONVERSATIONS for option in case.get("options", {})}
    assert "indices" in names
    covered(names - NOT_OF_THE_WIRE, shown, "conversations.py")


def rules_of_messages() -> set[str]:
    return {each["rule"] for case in CASES for each in case["expect"]["findings"]}


def rules_of_conversations() -> set[str]:
    return {
        each["rule"]
        for case in CONVERSATIONS
        for key in ("findings", "diagnoses")
        for each in case["expect"].get(key, [])
    }


def test_rules_of_one_message() -> None:
    table = {rule for rule, row in spec.rules().items() if row.scope == "message"}
    covered(table - NO_MESSAGE, rules_of_messages())
    covered(set(NO_MESSAGE), rules_of_conversations(), "conversations.py")
    assert {rule for rule in spec.rules() if rule.startswith("DS3")} <= table


def test_rules_of_conversations() -> None:
    others = {rule for rule in spec.rules() if not rule.startswith("DS3")} - set(ELSEWHERE)
    causes = {rule for rule in others if rule.startswith("DS7")}
    covered(others - causes, rules_of_conversations(), "conversations.py")
    covered(causes, rules_of_conversations(), "diagnoses.py")
    assert not set(ELSEWHERE) & rules_of_conversations()


def test_no_vector_names_a_rule_that_is_not() -> None:
    assert rules_of_messages() | rules_of_conversations() <= set(spec.rules())


def test_every_finding_is_a_reject_or_a_tolerated_fault() -> None:
    """A case says by its flags which class of fault it stands for, and all that must not pass say so."""
    for case in CASES:
        rejected = "reject" in case["flags"]
        unsupported = case["hex"][2:4] == "80" and case["kind"] == "response"
        assert case["expect"]["shaped"] != rejected or unsupported, case["id"]
        if case["flags"] in (["none"], ["example"]):
            assert not case["expect"]["findings"], case["id"]


def test_nothing_is_left_to_do() -> None:
    assert not NOT_YET
