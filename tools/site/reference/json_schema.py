"""The keys of the JSON outputs, from the schemas in python/ds47/schema."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from .markdown import code, plain, table

Schema = Mapping[str, Any]

CURRENT = ("report-2", "transaction-2", "overview-1", "table-1")
"""The schemas that are written today, by the beginnings of their file names."""
_TITLES = {
    "report-2": "Report: `-f json`", "transaction-2": "Lines: `-f ndjson` and `ds47 watch`",
    "overview-1": "Overview: `-f overview` with `--results`", "table-1": "Tables: CSV and Parquet",
}  # fmt: skip
_ANCHOR = "key-"
_ROWS = ("csv", "parquet")
"""Definitions of a table that are whole rows."""
_AS_COLUMNS = ("transaction", "parameter")
"""Definitions whose keys are columns of the tables."""
_HEAD = """# Keys of the JSON

Times are UTC, numbers of frames are those of Wireshark, units stand in the names (`duration_ms`). Keys may be
added; what is there keeps its name and meaning as long as the version in `schema` is the same.
"""


def page(root: Path) -> str:
    """All schemas; a definition stands once, where it comes first."""
    parts, told = [_HEAD], set[str]()
    columns = load(root, "table-1")["$defs"]
    for name in CURRENT:
        schema = load(root, name)
        about = plain(schema.get("description", ""))
        file = f"{name}.schema.json"
        parts.append(f"## {_TITLES[name]}\n\n[{file}](../../python/ds47/schema/{file}). {about}\n")
        parts += [_object(each) for each in _objects(schema)]
        if name.startswith("table"):
            parts.append(_columns(schema["$defs"]))
        else:
            parts += _definitions(schema.get("$defs", {}), told, columns)
    return "\n".join(parts)


def _definitions(definitions: Schema, told: set[str], columns: Schema) -> Iterator[str]:
    """Objects with a heading each, and one table of all else; `told` gets their names.

    What a key is that says nothing itself, the column of its name says.
    """
    simple = []
    for title, inner in definitions.items():
        if title in told:
            continue
        told.add(title)
        about = plain(inner.get("description", ""))
        objects = _objects(inner)
        if objects:
            yield f"### {title} {{#{_ANCHOR}{title}}}\n\n{about}\n"
            told_by = columns if title in _AS_COLUMNS else {}
            yield "\nor\n\n".join(_object(each, told_by) for each in objects)
        else:
            simple.append(
                (
                    f'<span id="{_ANCHOR}{title}">{code(title)}</span>',
                    _type(inner),
                    about or _form(inner),
                )
            )
    if simple:
        yield "### Values that have a name\n"
        yield table(("name", "type", "is"), simple)


def _objects(schema: Schema) -> list[Schema]:
    """The objects that a value may be."""
    several = schema.get("oneOf", schema.get("anyOf", [schema]))
    return [each for each in several if "properties" in each]


def _form(schema: Schema) -> str:
    return code(schema["pattern"]) if "pattern" in schema else ""


def _columns(columns: Schema) -> str:
    """The columns that rows of tables have, whatever the format."""
    rows = (
        (code(name), _type(inner), plain(inner.get("description", "")))
        for name, inner in columns.items()
        if name not in _ROWS
    )
    return table(("column", "type", "is"), rows)


def load(root: Path, name: str) -> dict[str, Any]:
    """A schema by the beginning of its file's name."""
    found = json.loads(
        (root / "python" / "ds47" / "schema" / f"{name}.schema.json").read_text("utf-8")
    )
    assert isinstance(found, dict)
    return found


def _object(schema: Schema, columns: Schema | None = None) -> str:
    rows = [(*row, plain(about)) for *row, about in keys(schema, columns or {})]
    return table(("key", "type", "is"), rows) if rows else f"{_type(schema)}\n"


def keys(schema: Schema, columns: Schema, before: str = "") -> Iterator[tuple[str, str, str]]:
    """The keys of an object, those of objects within it behind a dot, of lists within it behind `[].`."""
    for name, inner in schema.get("properties", {}).items():
        path = f"{before}{name}"
        about = inner.get("description") or columns.get(path, {}).get("description", "")
        yield code(path), _type(inner), about
        yield from keys(inner, columns, f"{path}.")
        yield from keys(inner.get("items", {}), columns, f"{path}[].")


def _type(schema: Schema) -> str:
    """What a value is, in a few words."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{_ANCHOR}{name})"
    for several in ("anyOf", "oneOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(_type(each) for each in schema[several]))
    if "const" in schema:
        return code(json.dumps(schema["const"]))
    if "enum" in schema:
        return ", ".join(code(json.dumps(each)) for each in schema["enum"])
    kinds = schema.get("type", "any")
    named = [kinds] if isinstance(kinds, str) else list(kinds)
    if "array" in named and "items" in schema:
        inner = _type(schema["items"])
        named[named.index("array")] = f"list of {inner}"
    return " or ".join(named)
