"""Writes tests/vectors/tables.json: every entry of the protocol tables as a line, key and value.

    .venv/bin/python tests/vectors/sources/tables.py           writes the file
    .venv/bin/python tests/vectors/sources/tables.py --diff    prints what would change in it

A change of python/ds47/spec/*.toml by accident must not go unnoticed: the tests compare the tables of both
implementations with the file and name every key that differs. What is meant is written by running this.
"""

from __future__ import annotations

import argparse
import json
import runpy
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ds47 import spec
from ds47.spec import codes, semantics

HERE = Path(__file__).resolve()
TARGET = HERE.parents[1] / "tables.json"
MAKE_TABLES = runpy.run_path(str(HERE.parents[3] / "tools/make_tables.py"))
ABOUT = (
    "Every entry of the protocol tables. After a change of python/ds47/spec/*.toml that is meant: "
    "tools/make_tables.py, then tests/vectors/sources/tables.py, and look at the difference."
)
Flat = Iterator[tuple[str, Any]]
KEYS = ("code", "last", "number", "id")
"""Fields that say again what stands in the key."""
EXPLAINING = (
    "note",
    "confirmed",
    "zh_from",
    "plc",
    "wireshark",
    "analyzer_only",
    "many",
    "many_zh",
    "brief",
    "brief_zh",
)
"""Fields for the reader of a table alone, and of headlines, which are the analyzer's: the Lua tables lack them."""


def fields(where: str, row: Any) -> Flat:
    """An object's fields; what is absent or empty has no line."""
    for name, value in row.columns().items():
        if name not in KEYS and value is not None and value != "":
            yield from leaves(f"{where}.{name}", value)


def leaves(where: str, value: Any) -> Flat:
    """A value, or what a list, a set or a table holds."""
    if isinstance(value, tuple):
        value = dict(enumerate(value, 1))
    elif isinstance(value, frozenset):
        value = dict.fromkeys(sorted(value), True)
    if not isinstance(value, Mapping):
        yield where, value
        return
    for key, item in value.items():
        yield f"{where}.{key if isinstance(key, str) else f'0x{key:02X}'}", item


def rows(where: str, table: Mapping[int, Any]) -> Flat:
    for code in sorted(table):
        yield from fields(f"{where}.0x{code:02X}", table[code])


def texts(where: str, english: Mapping[Any, str], chinese: Mapping[Any, str]) -> Flat:
    """Words by number or by name, in both languages."""
    for key, text in english.items():
        name = f"0x{key:02X}" if isinstance(key, int) else key
        yield f"{where}.{name}.en", text
        yield f"{where}.{name}.zh", chinese[key]


def numbers(where: str, row: Any) -> Flat:
    """The columns of limits or of what is known; those that no Lua reads are the analyzer's."""
    read = MAKE_TABLES["read_by_lua"](where, row)
    for name, value in row.columns().items():
        yield from leaves(f"{where if name in read else f'analyzer_{where}'}.{name}", value)


def semantic() -> Flat:
    yield from numbers("limits", semantics.limits())
    for phase, events in semantics.phases().items():
        for event, then in events.items():
            yield f"phases.{phase}.{event}", then
    yield from texts("reasons", semantics.reasons("en"), semantics.reasons("zh"))
    yield from numbers("known", semantics.known())
    pnus, values = semantics.never_written()
    for number, each in enumerate(pnus, 1):
        yield from leaves(f"known.never_written.ranges.0x{number:02X}", (each[0], each[-1]))
    for number, pair in enumerate(sorted(values), 1):
        yield from leaves(f"known.never_written.values.0x{number:02X}", pair)
    words = semantics.diagnosis_words("zh")
    plugins = semantics.plugin_words("en")
    own = {key: text for key, text in semantics.diagnosis_words("en").items() if key not in plugins}
    yield from texts("diagnosis_words", plugins, words)
    yield from texts("analyzer_words", own, words)


def wire() -> Flat:
    yield from rows("formats", spec.formats())
    for name in ("legacy_g120_formats", "profile_v3_types"):
        for code, meaning in spec.dialect(name).items():
            yield f"dialects.{name}.0x{code:02X}", meaning
    yield from rows("attributes", spec.attributes())
    for code in sorted(spec.vendor_attributes()):
        yield f"vendor_attributes.0x{code:02X}", True
    yield from rows("request_ids", spec.request_ids())
    yield from rows("response_ids", spec.response_ids())
    for name in codes.tables():
        yield from leaves(f"codes.{name}", codes.of_plugin(name))
        left_out = {word: codes.codes(name)[word] for word in codes.analyzer_only(name)}
        yield from leaves(f"analyzer_codes.{name}", left_out)


def errors() -> Flat:
    yield from rows("errors", spec.errors())
    fallback = spec._load("errors.toml")["fallback"]
    yield from ((f"error_fallback.{lang}", fallback[lang]) for lang in ("en", "zh"))
    for vendor in spec.vendors():
        if vendor.id is not None:
            yield f"vendors.{vendor.name}.id", vendor.id
        yield from rows(f"vendors.{vendor.name}.errors", vendor.errors)


def statuses() -> Flat:
    en, zh = spec.status("en"), spec.status("zh")
    yield from texts("status.error_code", en.code, zh.code)
    yield from texts("status.error_decode", en.decode, zh.decode)
    yield from texts("status.access", en.access, zh.access)
    yield from texts("status.protocol", en.protocol, zh.protocol)
    yield from texts("status.words", en.words, zh.words)


def flat() -> dict[str, Any]:
    """Every entry of the tables: key -> text, number or truth."""
    lines = [*semantic(), *wire(), *errors(), *statuses()]
    for number, families in spec.parameters().items():
        for family, row in families.items():
            lines += fields(f"parameters.{number}.{family}", row)
    for rule, told in spec.rules().items():
        lines += fields(f"rules.{rule}", told)
    assert len(dict(lines)) == len(lines)
    return dict(lines)


def explaining(key: str) -> bool:
    """Whether the Lua tables leave a key out; among the codes there are words of such names."""
    kind, _, rest = key.partition(".")
    if kind == "codes":
        return False
    if kind.startswith("analyzer_"):
        return True
    if kind == "rules" and spec.rules()[rest.partition(".")[0]].analyzer_only:
        return True
    return key.rpartition(".")[2] in EXPLAINING or any(
        f".{each}." in key for each in ("sources", "changed", "group")
    )


def text() -> str:
    """The whole file: a line per key."""
    tables = flat()
    dump = json.dumps
    lines = [f"{dump(key)}: {dump(value, ensure_ascii=False)}" for key, value in tables.items()]
    count = {"all": len(tables), "lua": sum(not explaining(key) for key in tables)}
    head = f'"about": {dump(ABOUT)},\n"count": {dump(count)},\n"tables": '
    return "{\n" + head + "{\n" + ",\n".join(lines) + "\n}\n}\n"


def differences(stored: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """What differs, a line per key."""
    keys = [*stored, *(key for key in found if key not in stored)]
    absent = object()

    def show(table: Mapping[str, Any], key: str) -> str:
        return repr(table[key]) if key in table else "nothing"

    return [
        f"{key}: table says {show(found, key)}, vector says {show(stored, key)}"
        for key in keys
        if stored.get(key, absent) != found.get(key, absent)
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Writes tests/vectors/tables.json.")
    parser.add_argument("--diff", action="store_true", help="only print what would change")
    parser.add_argument("target", nargs="?", type=Path, default=TARGET)
    wanted = parser.parse_args()
    if wanted.diff:
        there = json.loads(wanted.target.read_text("utf-8"))["tables"]
        print("\n".join(differences(there, flat())))
    else:
        wanted.target.write_text(text(), "utf-8", newline="\n")
