"""Lists of parameters: what a row has, and how to read it from CSV, XLSX and TOML.

A list names its device. A row has the name of a parameter, its unit, type and the texts of its values. A message
is the text of a fault or alarm. `store` keeps lists, `catalogue` looks things up.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from ds47 import spec
from ds47.parameters import workbook
from ds47.parameters.columns import guessed
from ds47.profidrive.naming import spelled
from ds47.spec import toml

MOST_ROWS: Final = 200_000
"""The most rows of one list: more than any drive has parameters."""
_MESSAGE = re.compile(r"(?P<letter>[FACNfacn]) ?0*(?P<number>\d{1,6})")
_VALUE = re.compile(r"(?P<number>-?\d{1,10})\s*[:=]\s*(?P<text>[^;|\n]+)")
_ENCODINGS: Final = ("utf-8-sig", "utf-16", "cp1252")
_TYPES: Final = {
    "u8": "Unsigned8", "u16": "Unsigned16", "u32": "Unsigned32", "u64": "Unsigned64",
    "i8": "Integer8", "i16": "Integer16", "i32": "Integer32", "i64": "Integer64",
    "usint": "Unsigned8", "uint": "Unsigned16", "udint": "Unsigned32", "ulint": "Unsigned64",
    "sint": "Integer8", "int": "Integer16", "dint": "Integer32", "lint": "Integer64",
    "real": "Float32", "float": "Float32", "lreal": "Float64", "floatingpoint32": "Float32",
    "floatingpoint64": "Float64",
    "byte": "Byte", "word": "Word", "dword": "DoubleWord", "bool": "Boolean", "string": "VisibleString",
}  # fmt: skip
"""Types as makers' lists and PLCs name them, in lower case without blanks."""


_ACCESS: Final = {
    "p": ("p", "rw", "wr", "w", "wo", "readwrite", "write", "lesenschreiben", "读写", "可读写"),
    "r": ("r", "ro", "read", "readonly", "lesen", "nurlesen", "只读"),
}  # fmt: skip
"""Access as lists name it, in lower case without blanks and punctuation."""


class ListError(Exception):
    """A list that cannot be read; the text is one line with the problem, its position and what to do."""


@dataclass(frozen=True, slots=True)
class ListedParameter:
    """A parameter. `access` is "p", "r", or None if the list does not say; `values` are texts of its values."""

    number: int
    name: str
    access: str | None = None
    unit: str | None = None
    type: str | None = None
    values: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ListedMessage:
    """The text of a fault ("F"), an alarm ("A"), or a message with another letter of the maker."""

    letter: str
    number: int
    text: str


@dataclass(slots=True)
class ParameterList:
    """Parameters and messages of one kind of device.

    `vendor_id` and `device_ids` are PROFINET ids; without them the list is for every device. `firmware` is a
    text, such as "4.7".
    """

    name: str
    vendor_id: int | None = None
    device_ids: tuple[int, ...] = ()
    firmware: str | None = None
    source: str | None = None
    rows: list[ListedParameter] = field(default_factory=list)
    messages: list[ListedMessage] = field(default_factory=list)
    passed_over: list[str] = field(default_factory=list)
    """Skipped content of the file, one line each, for the user who imports it."""


def read(
    path: Path, columns: Mapping[str, str] | None = None, sheet: str | None = None
) -> ParameterList:
    """Reads a list from a file; the ending says how.

    Args:
        path: .csv, .tsv, .txt, .xlsx or .toml.
        columns: key of COLUMNS -> heading of its column; missing keys are guessed from usual headings.
        sheet: of a workbook; None takes the first one.

    Raises:
        ListError: the file cannot be read, or has neither parameters nor messages.
    """
    ending = path.suffix.lower()
    try:
        if ending == ".toml":
            found = _of_toml(path)
        elif ending in (".xlsx", ".xlsm"):
            found = _of_table(path.stem, workbook.rows(path, sheet), columns or {})
        else:
            found = _of_table(path.stem, _lines(path), columns or {})
    except OSError as problem:
        raise ListError(f"{path}: {problem.strerror or problem}") from problem
    except (ListError, workbook.WorkbookError) as problem:
        raise ListError(f"{path}: {problem}") from None
    if not found.rows and not found.messages:
        raise ListError(f"{path}: no row has the number of a parameter or a fault")
    found.source = found.source or path.name
    return found


def _lines(path: Path) -> Iterator[list[str]]:
    """The rows of a file of separated values, with any separator."""
    text = text_of(path.read_bytes())
    sample = text[:8192]
    try:
        dialect: Any = csv.Sniffer().sniff(sample, delimiters=",;\t|")
    except csv.Error:
        dialect = csv.excel
    try:
        yield from csv.reader(io.StringIO(text, newline=""), dialect)
    except csv.Error as problem:
        raise ListError(f"no table of separated values: {problem}") from problem


def text_of(data: bytes) -> str:
    """A text in one of the encodings of spreadsheets."""
    for encoding in _ENCODINGS:
        if encoding == "utf-16" and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
            continue
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1")


def _of_table(name: str, table: Iterator[list[str]], columns: Mapping[str, str]) -> ParameterList:
    """A list from rows of cells; the first row with the wanted headings is the header."""
    found = ParameterList(name)
    columns_of: dict[str, int] = {}
    headings: list[str] = []
    for number, cells in enumerate(table, 1):
        if number > MOST_ROWS:
            found.passed_over.append(f"all rows from {MOST_ROWS + 1:,} on")
            break
        if not columns_of:
            columns_of = guessed(cells, columns)
            headings = headings or [cell for cell in cells if cell.strip()]
            continue
        _add(
            found,
            {key: cells[at].strip() for key, at in columns_of.items() if at < len(cells)},
            f"row {number}",
        )
    if not columns_of:
        first = " ".join(", ".join(headings[:8]).split()) or "empty"
        raise ListError(
            f"no row has headings that are known (the first one: {first}); say which they are: "
            "--columns number=HEADING,name=HEADING"
        )
    return found


def _add(found: ParameterList, cells: Mapping[str, str], where: str) -> None:
    """Adds a row of a table: a parameter, a message, or skipped content."""
    text, name = cells.get("number", ""), " ".join(cells.get("name", "").split())
    if not text and not name:
        return
    message = _MESSAGE.fullmatch(text)
    if message is not None and name:
        found.messages.append(
            ListedMessage(message["letter"].upper(), int(message["number"]), name)
        )
        return
    parameter = spelled(text)
    if parameter is None or not name:
        found.passed_over.append(
            f"{where}: {text!r} {'has no name' if parameter else 'is the number of no parameter'}"
        )
        return
    if parameter.subindex:
        return  # a later element of an array: the first one has the name
    found.rows.append(
        ListedParameter(
            parameter.number, name, parameter.letter or access_of(cells.get("access", "")),
            cells.get("unit") or None, type_of(cells.get("type", "")), values_of(cells.get("values", "")),
        )
    )  # fmt: skip


def access_of(text: str) -> str | None:
    """Whether a list calls a parameter writable ("p") or read-only ("r"); None if it does not say."""
    plain = re.sub(r"[\s_/.-]", "", text).lower()
    return next((letter for letter, words in _ACCESS.items() if plain in words), None)


def type_of(text: str) -> str | None:
    """The format of ds47 that a list means, by any of its names; None if it is unknown."""
    plain = re.sub(r"[\s_/-]", "", text.split("/")[0]).lower()
    for row in spec.formats().values():
        if row.name.lower() == plain:
            return row.name
    return _TYPES.get(plain)


def values_of(text: str) -> dict[int, str]:
    """The texts of values in a cell: `0: no; 1: yes`, also one per line."""
    return {int(match["number"]): match["text"].strip() for match in _VALUE.finditer(text)}


def _of_toml(path: Path) -> ParameterList:
    """A list in the form of docs/parameters.md."""
    try:
        document = toml.parse(text_of(path.read_bytes()))
    except ValueError as problem:
        raise ListError(f"no TOML: {problem}") from problem
    about = document.get("list", {})
    if not isinstance(about, dict):
        raise ListError("[list] is not a table")
    found = ParameterList(
        str(about.get("name", path.stem)), _number(about, "vendor_id"), tuple(_numbers(about, "device_ids")),
        _word(about, "firmware"), _word(about, "source"),
    )  # fmt: skip
    for key, add in (("parameter", _add_parameter), ("message", _add_message)):
        rows = document.get(key, [])
        if not isinstance(rows, list) or not all(isinstance(each, dict) for each in rows):
            raise ListError(f"[[{key}]] is not a list of tables")
        for number, row in enumerate(rows, 1):
            add(found, row, f"[[{key}]] {number}")
    return found


def _add_parameter(found: ParameterList, row: Mapping[str, Any], where: str) -> None:
    parameter = spelled(str(row.get("number", "")))
    name = _word(row, "name")
    if parameter is None or name is None:
        raise ListError(f"{where}: wants number and name")
    access = _word(row, "access") or parameter.letter
    if access not in (None, "p", "r"):
        raise ListError(f"{where}: access is 'p' or 'r', not {access!r}")
    kind = _word(row, "type")
    if kind is not None and type_of(kind) is None:
        raise ListError(f"{where}: no type {kind!r}. Try: ds47 explain format")
    values = row.get("values", {})
    if not isinstance(values, dict) or not all(re.fullmatch(r"-?\d{1,10}", key) for key in values):
        raise ListError(f"{where}: values is a table of numbers and texts")
    texts = {int(key): str(text) for key, text in values.items()}
    found.rows.append(
        ListedParameter(
            parameter.number, name, access, _word(row, "unit"), type_of(kind or ""), texts
        )
    )


def _add_message(found: ParameterList, row: Mapping[str, Any], where: str) -> None:
    match, text = _MESSAGE.fullmatch(str(row.get("number", ""))), _word(row, "text")
    if match is None or text is None:
        raise ListError(f"{where}: wants number, such as F07900, and text")
    found.messages.append(ListedMessage(match["letter"].upper(), int(match["number"]), text))


def _word(row: Mapping[str, Any], key: str) -> str | None:
    value = row.get(key)
    return " ".join(value.split()) or None if isinstance(value, str) else None


def _number(row: Mapping[str, Any], key: str) -> int | None:
    value = row.get(key)
    if value is None or (isinstance(value, int) and 0 <= value <= LARGEST_ID):
        return value
    raise ListError(f"[list]: {key} is not a number of 16 bits: {value!r}")


LARGEST_ID: Final = 0xFFFF


def _numbers(row: Mapping[str, Any], key: str) -> Sequence[int]:
    values = row.get(key, [])
    if not isinstance(values, list):
        raise ListError(f"[list]: {key} is not a list of numbers")
    return [number for each in values if (number := _number({key: each}, key)) is not None]


def write(found: ParameterList) -> str:
    """A list in the form of docs/parameters.md."""
    lines = ["[list]", f"name = {quoted(found.name)}"]
    if found.vendor_id is not None:
        lines.append(f"vendor_id = 0x{found.vendor_id:04X}")
    if found.device_ids:
        lines.append(f"device_ids = [{', '.join(f'0x{each:04X}' for each in found.device_ids)}]")
    for key in ("firmware", "source"):
        if (text := getattr(found, key)) is not None:
            lines.append(f"{key} = {quoted(text)}")
    for row in found.rows:
        lines += ["", "[[parameter]]", f"number = {row.number}", f"name = {quoted(row.name)}"]
        for key in ("access", "unit", "type"):
            if (text := getattr(row, key)) is not None:
                lines.append(f"{key} = {quoted(text)}")
        if row.values:
            texts = ", ".join(
                f"{number} = {quoted(text)}" for number, text in sorted(row.values.items())
            )
            lines.append(f"values = {{ {texts} }}")
    for each in found.messages:
        lines += [
            "",
            "[[message]]",
            f'number = "{each.letter}{each.number:05}"',
            f"text = {quoted(each.text)}",
        ]
    return "\n".join(lines) + "\n"


def _escaped(char: str) -> str:
    code = ord(char)
    return f"\\u{code:04X}" if code <= 0xFFFF else f"\\U{code:08X}"


def quoted(text: str) -> str:
    """A text as a basic string of TOML."""
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    shown = (escapes.get(char) or (char if char.isprintable() else _escaped(char)) for char in text)
    return f'"{"".join(shown)}"'
