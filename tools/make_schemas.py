"""Writes the JSON Schemas of results, python/ds47/schema/: report-2, transaction-2 (ndjson), table-1, summary-1.

And the names of the columns of CSV into docs/data.md.

    .venv/bin/python tools/make_schemas.py            writes the files
    .venv/bin/python tools/make_schemas.py --check    fails when one is not what would be written

They are made of the table in `ds47.report.contract`; what no object of the model is stands here: a line, a decoded
message, what is kept for an overview. report-1 and transaction-1 are what both were before, and stay as they are.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ds47 import model
from ds47.report import contract, csv
from ds47.report.contract import (
    BYTE,
    COUNT,
    FLAG,
    FRAME,
    MAYBE_TEXT,
    MAYBE_VALUES,
    NUMBER,
    TEXT,
    Column,
    Key,
    many,
    ref,
    whole,
)
from ds47.report.verdict import LEVELS

ROOT = Path(__file__).resolve().parent.parent
TARGET, PAGE = ROOT / "python" / "ds47" / "schema", ROOT / "docs" / "data.md"
Schema = dict[str, Any]
_DRAFT = "https://json-schema.org/draft/2020-12/schema"


def entity(
    keys: Sequence[Key], about: str = "", own: str | Sequence[str] = "object"
) -> Schema:  # fmt: skip
    """An object with these keys and no others."""
    found: Schema = {"description": about} if about else {}
    return found | {
        "type": own,
        "additionalProperties": False,
        "required": [key.name for key in keys if key.required and not (key.channel or key.rare)],
        "properties": {key.name: value(key) for key in keys},
    }


def value(key: Key) -> Schema:
    """What is said of the value of a key."""
    schema = key.schema
    if key.shape is not None and not key.shape.title:
        listed = "items" in schema
        inner = entity(key.shape.keys, own="object" if listed else schema.get("type", "object"))
        schema = many(inner) if listed else inner
    elif key.name == "corrected":
        schema = entity(contract.CORRECTED.keys, own=["object", "null"])
    return ({"description": key.about} if key.about else {}) | schema


def enum(words: Sequence[str]) -> Schema:
    return {"enum": list(words)}


COUNTS: Schema = {"type": "object", "additionalProperties": COUNT}
SIMPLE: dict[str, Schema] = {
    "counts": COUNTS,
    "channel": enum((model.DS47, model.PKW, model.S7)),
    "operation": enum(model.OPERATIONS),
    "state": enum(model.STATES),
    "severity": enum(model.SEVERITIES),
    "rule": {"type": "string", "pattern": "^DS[1-9][0-9]{2}$"},
    "attribute": {"type": "string", "pattern": "^(value|description|text|0x[0-9A-F]{2})$"},
    "hex": MAYBE_TEXT | {"pattern": "^([0-9a-f]{2})*$"},
    "status": MAYBE_TEXT | {"pattern": "^[0-9A-F]{8}$"},
    "error": {"anyOf": [{"type": "null"}, entity(contract.ERROR.keys)]},
}
SHAPES = (
    contract.CAPTURE, contract.FILE, contract.RELATION, contract.SENDER, contract.TIMELINE, contract.EVENT,
    contract.BUS, contract.BUS_STATION, contract.DEVICE,
    contract.CONNECTION, contract.NARROWED, contract.EXPECTED, contract.TRANSACTION, contract.ITEM,
    contract.PARAMETER, contract.DESCRIPTION,
    contract.FINDING,
    contract.DIAGNOSIS,
)  # fmt: skip

_PATH = Key("path", TEXT)
_FINDINGS = Key("findings", many(ref("finding")))
_END = [
    *contract.HEAD,
    *(key for key in contract.LISTS if key.name != "transactions"),
    contract.SUMMARY,
]
LINE: Schema = {
    "description": "A line of -f ndjson: a finished transaction, the end of a capture, or (ds47 watch) "
    "a finding.",
    "oneOf": [
        entity([_PATH, Key("transaction", ref("transaction")), _FINDINGS]),
        entity([_PATH, Key("capture", entity(_END))]),
        entity(
            [_PATH, Key("finding", ref("finding"))],
            "Only of ds47 watch: a finding that belongs to no transaction, or came after the line of its "
            "transaction.",
        ),
    ],
}


def _message(kind: str) -> Schema:
    return entity([
        Key("kind", {"const": kind}),
        Key("request_reference", BYTE),
        Key(f"{kind}_id", BYTE),
        Key("axis", BYTE),
        Key("parameter_count", BYTE),
        Key("parameters", many(ref("message_parameter"))),
        Key("findings", many(ref("message_finding"))),
    ])  # fmt: skip


MESSAGE: dict[str, Schema] = {
    "message": {
        "description": "What `ds47 decode -f json` prints.",
        "oneOf": [_message("request"), _message("response")],
    },
    "message_parameter": entity([
        key._replace(schema=MAYBE_VALUES) if key.name == "values" else key
        for key in contract.PARAMETER.keys if key.name not in ("name", "unit")
    ]),
    "message_finding": entity([
        Key("rule", ref("rule")), Key("severity", ref("severity")), Key("message", TEXT),
        Key("offset", COUNT),
    ]),
}  # fmt: skip

_WHERE = entity([
    Key("severity", enum(model.SEVERITIES)),
    Key("findings", NUMBER),
    Key("frame", whole(maybe=True),
        "The first frame, numbered as in the report of the capture; null where no frame shows it."),
    Key("file", MAYBE_TEXT, "Of a series the file that has the frame; else null."),
    Key("file_frame", FRAME, "The number of the frame in that file."),
])  # fmt: skip
ROW = entity([
    Key("path", TEXT),
    Key("readable", FLAG, "False where nothing of it could be read."),
    Key("complete", FLAG),
    Key("problem", MAYBE_TEXT, "Why it was not read, or not to its end."),
    Key("dropped", whole(maybe=True),
        "Frames that the capturing machine lost; null where the capture does not say."),
    Key("frames", COUNT),
    Key("files", NUMBER, "More than one for a series."),
    Key("missing_files", COUNT, "Files of the series that are not there."),
    Key("operations", ref("counts"), "Transactions by operation; what is not there is 0."),
    Key("states", ref("counts"), "Transactions by state."),
    Key("findings", ref("counts"), "Findings by severity."),
    Key("rules", ref("counts"), "Findings by rule."),
    Key("diagnoses",
        {"type": "object", "propertyNames": {"pattern": "^DS7[0-9]{2}$"}, "additionalProperties": _WHERE},
        "Diagnoses by rule: findings of all their causes, and where the first shows."),
    Key("slowest_ns", whole(maybe=True), "The longest duration, nanoseconds; null without one."),
    Key("start", MAYBE_TEXT, "Time of the first frame; absent before it was kept.", required=False),
    Key("end", MAYBE_TEXT, "Time of the last frame.", required=False),
], "What is kept of a capture for an overview.")  # fmt: skip

_SOURCE = entity([
    Key("path", TEXT),
    Key("size", COUNT),
    Key("mark", MAYBE_TEXT,
        "Changes when the file does: time of its last change in nanoseconds, or what its server says."),
    Key("missing_before", COUNT),
])  # fmt: skip
RUN = entity([
    Key("seal", TEXT | {"pattern": "^[0-9a-f]{64}$"},
        "The SHA-256 of this file with zeros in place of it: a damaged result is made again.", required=False),
    Key("sources", many(_SOURCE, 1)),
    Key("options", {"type": "object"}, "The options of the analysis."),
    Key("row", ref("row")),
])  # fmt: skip


def _definitions() -> dict[str, Schema]:
    shapes = {each.title: entity(each.keys, each.about) for each in SHAPES}
    return SIMPLE | shapes | {"line": LINE} | MESSAGE | {"row": ROW}


_TOOL = Key(
    "tool", entity([Key("name", {"const": "ds47"}), Key("version", TEXT | {"minLength": 1})])
)


def report() -> Schema:
    """The whole report."""
    about = (
        "Only in a stored result (--results): what it was made of, so that --resume knows whether it "
        "still holds, and its line of the overview."
    )
    document = entity([
        Key("schema", {"const": "ds47.report/2"}),
        _TOOL,
        Key("run", RUN, about, required=False),
        Key("captures", many(ref("capture"))),
    ])  # fmt: skip
    return _head(
        "report:2", "ds47.report/2",
        "DS47 transactions of PROFINET captures. Frame numbers are those Wireshark shows for the same file.",
    ) | document | {"$defs": _definitions()}  # fmt: skip


def transaction() -> Schema:
    """A line of ndjson, with the definitions that it needs."""
    known = _definitions()
    needed = {
        name: schema for name, schema in known.items()
        if not name.startswith(("capture", "line", "message", "row"))
    }  # fmt: skip
    return _head(
        "transaction:2", "ds47.transaction/2",
        "A line of -f ndjson: a finished transaction with its findings, the end of a capture, or "
        "(ds47 watch only) a finding that comes alone. The same definitions as in report-2.schema.json.",
    ) | {"oneOf": LINE["oneOf"], "$defs": needed}  # fmt: skip


_SHORT_CAUSE = entity([
    Key("rule", TEXT),
    Key("severity", {"enum": list(model.SEVERITIES)}),
    Key("message", TEXT, "In the language of --lang, as all words here."),
    Key("advice", TEXT),
    Key("findings", COUNT),
    Key("alike", COUNT, "Causes of the same rule that are not listed; they are not in causes_left_out."),
    Key("frame", whole(1, maybe=True), "The first one that shows it; null where none does."),
    Key("transaction", whole(1, maybe=True)),
])  # fmt: skip
_LEVEL = {"enum": list(LEVELS)}
_DIGEST = entity([
    Key("path", TEXT),
    Key("level", _LEVEL),
    Key("verdict", TEXT),
    Key("frames", COUNT),
    Key("start", MAYBE_TEXT, "Time of the first frame, as in ds47.report/2."),
    Key("end", MAYBE_TEXT),
    Key("narrowed", MAYBE_TEXT, "Which part of the capture is shown; null for all of it."),
    Key("transactions", COUNT),
    Key("failed", COUNT, "Those that did not do what they were meant to do."),
    Key("unknown", COUNT, "Those of which nobody knows what the drive made of them."),
    Key("states", ref("counts"), "All of them by state; what is not there is 0."),
    Key("causes", many(_SHORT_CAUSE), "Three at most, the worst first; one of each rule before a second of any."),
    Key("causes_left_out", COUNT),
    Key("drives", many(entity([Key("ip", TEXT), Key("station", MAYBE_TEXT), Key("transactions", TEXT)]))),
])  # fmt: skip


def summary() -> Schema:
    """What --summary -f json writes."""
    document = entity([
        Key("schema", {"const": "ds47.summary/1"}),
        _TOOL,
        Key("level", _LEVEL, "That of all captures."),
        Key("verdict", TEXT),
        Key("captures", many(_DIGEST)),
        Key("unreadable", many(entity([Key("path", TEXT), Key("problem", TEXT)]))),
    ])  # fmt: skip
    return _head(
        "summary:1", "ds47.summary/1", "The summary of captures: verdict, three causes, who, when.",
    ) | document | {"$defs": {"counts": SIMPLE["counts"]}}  # fmt: skip


def _head(name: str, title: str, about: str) -> Schema:
    return {"$schema": _DRAFT, "$id": f"urn:ds47:{name}", "title": title, "description": about}


# Tables


_ARROW = {"integer": "int64", "number": "double", "string": "string"}
_OF_CSV = {
    "values": Key("values", MAYBE_TEXT, column="One value as it is, several as a JSON array."),
    "scaled": Key("scaled", MAYBE_TEXT, column="Physical value of normalised types and times."),
}
_OF_PARQUET = [
    Key("value_index", whole(maybe=True),
        column="Position of the value in its parameter, from 0; null where there is none."),
    Key("element", whole(0, 0xFFFF + 0xFF, maybe=True),
        column="Subindex of this value; null where the attribute is not value."),
    Key("value", MAYBE_TEXT,
        column="The value as JSON writes it: read, or written where the operation is change."),
    Key("value.number", {"type": ["number", "null"]},
        column="The value as a number, also not-a-number and infinities; null for text and bytes."),
    Key("value.integer", whole(-(1 << 63), (1 << 63) - 1, maybe=True),
        column="The value where it is an integer of at most 64 bits with sign, exactly."),
    _OF_CSV["scaled"],
    Key("scaled.number", {"type": ["number", "null"]},
        column="The physical value as a number; null for points in time."),
]  # fmt: skip
_CAPTURE = Key("path", TEXT, column="The capture, as given on the command line.")
_POSITION = Key(
    "parameter", whole(maybe=True),
    column="Position of the parameter in the message, from 0; null where the transaction has none.",
)  # fmt: skip
_START: Schema = {
    "arrow": "timestamp[ns, tz=UTC]",
    "description": "Time of the first frame; null before 1678 and after 2262, where 64 bits of nanoseconds end.",
}


def _nullable(schema: Schema) -> Schema:
    own = schema["type"]
    return schema | {"type": own if isinstance(own, list) else [own, "null"]}


def _cell(key: Key, optional: bool) -> Schema:
    """What is said of a column; that of a parameter is empty where a transaction has none."""
    schema = key.schema
    if "anyOf" in schema:
        schema = schema["anyOf"][1]
    if "$ref" in schema:
        title = schema["$ref"].rpartition("/")[2]
        schema = SIMPLE[title]
        schema = {"type": "string", **schema} if "enum" in schema else schema
    schema = _nullable(schema) if optional else schema
    own = schema["type"]
    arrow = _ARROW[own if isinstance(own, str) else own[0]]
    unit = {"unit": "ms"} if key.name.endswith("_ms") else {}
    return schema | {"arrow": arrow} | unit | {"description": key.column}


def table() -> Schema:
    """The columns of csv and parquet."""
    left = {"path": _cell(_CAPTURE, False)} | _cells(contract.TRANSACTION_COLUMNS, False)
    head, error = _cells(contract.HEAD_COLUMNS, True), _cells(contract.ERROR_COLUMNS, True)
    values = {name: _cell(key, True) for name, key in _OF_CSV.items()}
    more = {"parameter": _cell(_POSITION, True)}
    single = {key.name: _cell(key, True) for key in _OF_PARQUET}
    last = _cells(contract.S7_COLUMNS, True)
    first = left | head | values | error | last
    assert tuple(first) == csv.COLUMNS
    second = left | more | head | single | error | last
    time = {"start": _nullable(left["start"]) | _START}
    about = (
        "The columns of -f csv and -f parquet, in order. A row is valid against #/$defs/csv or #/$defs/parquet. "
        "'arrow' is the type in a data frame, 'unit' the unit; an empty cell of csv is null."
    )
    return _head("table:1", "ds47.table/1", about) | {"$defs": {
        "csv": _row(first, "A row of -f csv: one parameter; a transaction whose parameters are not known "
                    "has one row."),
        "parquet": _row(second, "A row of -f parquet: one value; a parameter without a value, and a transaction "
                        "whose parameters are not known, have one row.", time),
        **(second | first),
    }}  # fmt: skip


def _cells(columns: Sequence[Column], optional: bool) -> dict[str, Schema]:
    return {each.name: _cell(each.key, optional) for each in columns}


def _row(columns: dict[str, Schema], about: str, own: dict[str, Schema] | None = None) -> Schema:
    keys = [Key(name, (own or {}).get(name, ref(name))) for name in columns]
    return entity(keys, about)


def page() -> str:
    """docs/data.md with the names of the columns of CSV."""
    named = ", ".join(f"`{name}`" for name in table()["$defs"]["csv"]["properties"])
    return re.sub(r"^Columns: .*$", f"Columns: {named}.", PAGE.read_text("utf-8"), flags=re.M)


def main() -> int:
    parser = argparse.ArgumentParser(description="Writes python/ds47/schema/.")
    parser.add_argument("--check", action="store_true", help="only say whether they are up to date")
    check: bool = parser.parse_args().check
    stale = False
    schemas = {
        "report-2": report(),
        "transaction-2": transaction(),
        "table-1": table(),
        "summary-1": summary(),
    }
    files = {
        TARGET / f"{name}.schema.json": json.dumps(made, indent=2, ensure_ascii=False) + "\n"
        for name, made in schemas.items()
    }
    for path, text in (files | {PAGE: page()}).items():
        if not check:
            path.write_text(text, encoding="utf-8", newline="\n")
        elif not path.exists() or path.read_text(encoding="utf-8") != text:
            print(f"{path} is stale: run tools/make_schemas.py", file=sys.stderr)
            stale = True
    return int(stale)


if __name__ == "__main__":
    sys.exit(main())
