"""Report as JSON, `ds47.report/2`: the contract that other programs build on.

`Writer` lays a capture out with one transaction a line, so that a difference between two reports is a difference
of lines (`ds47.report.ndjson` writes the same objects). Key order and number texts never vary. The keys are those
of contract.py; what they mean is in `ds47.model` and in schema/report-2.schema.json.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache, partial
from itertools import islice, repeat
from json import JSONEncoder, dumps
from json.encoder import encode_basestring as _quoted
from typing import Any, ClassVar, Final, TextIO

from ds47.model import (
    CaptureResult,
    Finding,
    Parameter,
    Report,
    Transaction,
    Value,
)
from ds47.report import SCHEMA, ReportOptions, contract
from ds47.report import Writer as _Writer
from ds47.report import values as meanings
from ds47.report.bilingual import Both
from ds47.report.contract import DEVICE, DIAGNOSIS, ERROR, FINDING, PARAMETER, TRANSACTION
from ds47.report.targets import Telegrams
from ds47.report.values import about
from ds47.version import __version__

_encoder: Final = JSONEncoder(ensure_ascii=False, allow_nan=False)
_LINES_AT_ONCE = 256


def transaction_line(item: Transaction, lang: str = "en") -> str:
    """The same as `text(TRANSACTION.plain(item, lang))`, but faster, without dictionaries."""
    return visible(_writer(TRANSACTION, item.channel)(item, lang))


# A writer is made from the keys of a shape: the f-string that one would write by hand, compiled once.

_Write = Callable[[Any, str], str]


@cache
def _writer(shape: contract.Shape, channel: str = "") -> _Write:
    """A function that writes an object as text, with the keys of its channel."""
    names: dict[str, Any] = {"none": "[]", "null": "null", "quoted": _quoted}
    code = _code(shape, "item", channel, names)
    return contract.compiled(f"f'''{{{{{code}}}}}'''", names)


def _code(shape: contract.Shape, owner: str, channel: str, names: dict[str, Any]) -> str:
    """The inside of the f-string; `owner` has the attributes, `names` gets the functions that the code calls."""

    def member(key: contract.Key, attribute: str) -> str:
        """A comma, the name, and code for the value: a list, an object, a rare key, or any other."""
        head, function = f', "{key.name}": ', f"of_{key.name}"
        if key.rare:
            names[function] = partial(_rare, key.shape)
            there = f"(value := {owner}.{key.name}) is not None"
            return f"{{'{head}' + {function}(value, lang) if {there} else ''}}"
        if key.schema.get("type") == "array":
            names[function] = _listed(key.shape)
            return f"{head}{{{function}(value, lang) if (value := {attribute}) else none}}"
        if key.shape is not None:
            part = f"{owner}.{key.name}" if key.shape.make else owner
            return f"{head}{{{{{_code(key.shape, part, channel, names)}}}}}"
        if key.take is None and key.tell is not None:
            names[function] = key.tell
            attribute = f"{function}({owner}, lang)"
        code = contract.code(key, attribute, "null", "quoted({})", '"')
        return f"{head}{{{code}}}"

    keys = [key for key in shape.keys if key.channel in ("", channel)]
    cells = [(key, f"{owner}.{key.into or key.name}") for key in keys]
    return contract.fields(cells, member, "", names).removeprefix(", ")


def _rare(shape: contract.Shape | None, value: Any, lang: str) -> str:
    return text(value if shape is None else shape.plain(value, lang))


def _listed(shape: contract.Shape | None) -> Callable[[list[Any], str], str]:
    """A function that writes a list of texts, or of objects of this shape."""
    if shape is None:
        return lambda items, _: text(items)
    if shape is PARAMETER:
        return _parameters
    write = _writer(shape)
    return lambda items, lang: f"[{', '.join([write(each, lang) for each in items])}]"


def _parameters(items: list[Parameter], lang: str) -> str:
    """The same as `text` of a list of parameters, but faster: nothing else is so frequent."""
    texts = []
    for item in items:
        head, may_mean = _parameter_head(about(item), item.value_count, lang)
        if not head:
            texts.append(text(PARAMETER.plain(item, lang)))
            continue
        values, scaled, error, tail = repr(item.values), "null", "null", "}"
        if _is_odd(values):
            values = text(item.values)
        if item.scaled is not None:
            scaled = list_text(item.scaled)
        if item.error is not None:
            error = _writer(ERROR)(item.error, lang)
        if item.value_texts:
            tail = _tail(meanings.meaning(item), lang)
        elif may_mean and item.error is None:
            tail = _usual_tail(about(item), lang, *item.values)
        texts.append(f'{head}, "values": {values}, "scaled": {scaled}, "error": {error}{tail}')
    return f"[{', '.join(texts)}]"


_PLAIN: Final = ("value", None)
"""Attributes of most parameters. Such a parameter has rare keys only if a description names it."""


@lru_cache(maxsize=4096)
def _parameter_head(known: tuple[Any, ...], value_count: int | None, lang: str) -> tuple[str, bool]:
    """A parameter up to its values, "" if it has rare keys; and whether the tables may say what these mean."""
    item = meanings.of_kind(known, value_count=value_count)
    if item.attribute not in _PLAIN or item.described is not None:
        return "", False
    head = PARAMETER.plain(item, lang)
    for key in ("values", "scaled", "error"):
        del head[key]
    return text(head)[:-1], meanings.may_mean(known)


def _tail(meant: Both | None, lang: str) -> str:
    """The end of a parameter, with what its values mean."""
    return "}" if meant is None else f', "meaning": {_quoted(meant.text(lang))}}}'


@lru_cache(maxsize=4096, typed=True)
def _usual_tail(known: tuple[Any, ...], lang: str, *values: Value) -> str:
    """The same if the tables alone decide. Typed, because 1 and 1.0 are equal."""
    return _tail(meanings.meaning(meanings.of_kind(known, values=list(values))), lang)


def list_text(values: list[Value]) -> str:
    """A list of values as JSON; finite numbers have the same text in Python."""
    shown = repr(values)
    return text(values) if _is_odd(shown) else shown


_is_odd: Final = re.compile("['\"n]").search
"""Whether the text of a list has a string, nan or inf."""


def capture_head(result: CaptureResult) -> dict[str, Any]:
    """The keys of a capture itself, before its lists."""
    return _without_empty(contract.CAPTURE_HEAD.plain(result))


def capture(result: CaptureResult, lang: str = "en") -> dict[str, Any]:
    """A capture as an object of the contract, its texts in "en" or "zh"."""
    Telegrams.tell(result)
    return _without_empty(contract.CAPTURE.plain(result, lang))


def _without_empty(plain: dict[str, Any]) -> dict[str, Any]:
    """Leaves out empty keys that only some captures have: files, relations, timelines, bus."""
    for key in contract.HEAD:
        if not (key.required or key.take or plain[key.name]):  # times stay, known or not
            del plain[key.name]
    return plain


def document(report: Report) -> dict[str, Any]:
    """The whole report as plain dictionaries: what `Writer` writes, before it is text."""
    return _head() | {"captures": [capture(each) for each in report.captures]}


class Writer(_Writer):
    """Writes captures as they come; holds none of them.

    `about` are further keys of the document, set before the first capture (`ds47.batch.results`).
    """

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self.about: dict[str, Any] = {}
        self._begun = False

    def _begin(self) -> None:
        self.stream.write(text(_head() | self.about)[:-1] + ', "captures": [')
        self._begun = True

    def capture(self, result: CaptureResult) -> None:
        if self._begun:
            self.stream.write(",")
        else:
            self._begin()
        Telegrams.tell(result)
        write_line = self.stream.write
        write_line("\n" + text(capture_head(result))[:-1])
        self._lines("devices", (text(DEVICE.plain(each)) for each in result.devices))
        lang = self.options.lang
        # map: mypyc makes a list of a generator expression, here of all lines
        lines = map(transaction_line, result.transactions, repeat(lang))
        self._lines("transactions", lines)
        self._lines("findings", (text(FINDING.plain(each, lang)) for each in result.findings))
        self._lines("diagnoses", (text(DIAGNOSIS.plain(each, lang)) for each in result.diagnoses))
        write_line(f',\n"summary": {text(result.summary)}}}')

    def _lines(self, key: str, lines: Iterator[str]) -> None:
        self.stream.write(f',\n"{key}": [')
        separator, write = "\n", self.stream.write
        while piece := list(islice(lines, _LINES_AT_ONCE)):
            write(separator)
            write(",\n".join(piece))
            separator = ",\n"
        write("]")

    def close(self) -> None:
        if not self._begun:
            self._begin()
        self.stream.write("]}\n")


class LineWriter(_Writer):
    """Writes the lines of `ds47.report.ndjson` as things are finished."""

    streams: ClassVar[bool] = True

    def whole(self, result: CaptureResult) -> None:
        Telegrams.tell(result)

    def transaction(self, path: str, transaction: Transaction, findings: Sequence[Finding]) -> None:
        lang = self.options.lang
        line = transaction_line(transaction, lang)
        about = text([FINDING.plain(each, lang) for each in findings]) if findings else "[]"
        self.stream.write(
            f'{{"path": {_path(path)}, "transaction": {line}, "findings": {about}}}\n'
        )

    def capture(self, result: CaptureResult) -> None:
        whole = capture(result, self.options.lang)
        del whole["transactions"]
        self.stream.write(text({"path": result.path, "capture": whole}) + "\n")


@lru_cache(maxsize=16)
def _path(path: str) -> str:
    return text(path)


def text(item: object) -> str:
    """One line of JSON, the same for the same thing; never NaN, which is not JSON."""
    return visible(_encoder.encode(item))


def laid_out(item: object, indent: int = 1) -> str:
    """The same over several lines, with a line end behind it."""
    return visible(dumps(item, ensure_ascii=False, allow_nan=False, indent=indent)) + "\n"


def visible(document: str) -> str:
    """A JSON text that says the same, with escapes of JSON for what `escaping.escape` escapes; line ends stay."""
    if (document.isascii() and "\x7f" not in document) or document.isprintable():
        return document
    if "\n" in document:
        return "\n".join(map(visible, document.split("\n")))
    return "".join(char if char.isprintable() else _of_json(char) for char in document)


def _of_json(char: str) -> str:
    r"""`\\u009b`; two of these for a character beyond 16 bits."""
    units = char.encode("utf-16-be", "surrogatepass").hex()
    return "".join(f"\\u{units[at : at + 4]}" for at in range(0, len(units), 4))


def _head() -> dict[str, Any]:
    return {"schema": SCHEMA, "tool": {"name": "ds47", "version": __version__}}
