"""A request as a function block in SCL for S7-1200 and S7-1500: WRREC, RDREC until there is a response, its check.

The block is templates/block.scl.j2, what depends on the parameters is `scl_fields`. Nobody compiled what comes
out of it: its head says so, and the tests run it in an interpreter of their own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import Any, Final

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from ds47 import spec
from ds47.model import Parameter
from ds47.profidrive import Request
from ds47.report import formatting, scl_fields
from ds47.report.bilingual import say
from ds47.report.escaping import escape
from ds47.report.scl_fields import LONGEST, NUMBER, TEXT, Field
from ds47.version import __version__

_OPERATIONS: Final = {0x01: "Read", 0x02: "Change"}
_NAMED: Final = 3
"""So many parameters give the block its name."""
_TEMPORARY: Final = {
    "tempWord": "Word", "tempByte": "Byte", "tempDWord": "DWord", "tempLWord": "LWord",
    "tempIndex": "Int", "tempChar": "Int", "tempSize": "Int", "tempPlace": "Int",
}  # fmt: skip
"""Variables that only some blocks need."""
_SPELLED: Final = {"BOOL": "Bool", "DINT": "DInt", "UINT": "UInt", "DWORD": "DWord"}
"""Types as an editor of TIA Portal writes them."""


def function_block(request: Request, line: str, lang: str = "en") -> str:
    """The source of a function block that makes this request, and takes its response apart.

    Args:
        request: a read or a change that is whole.
        line: the request as it was written, for the head.
        lang: "en" or "zh", of the comments.

    Raises:
        ValueError: it is another request, or one that no record of 240 bytes takes.
    """
    if request.request_id not in _OPERATIONS:
        raise ValueError("a function block is made of a read or a change, not of another request")
    found = scl_fields.fields(request)
    length = _length(request, found)
    if length > LONGEST:
        raise ValueError(
            f"the request has {length} bytes, a function block sends {LONGEST} at the most"
        )
    said = partial(_said, lang=lang)
    changes = request.request_id == 0x02
    known = {
        "request": request, "fields": found, "changes": changes, "parameters": len(found),
        "written": [each for each in found if changes and each.start],
        "asked": [] if changes else found,
        "about": {each.number: " ".join(_about(each, lang)) for each in found},
        "shown": {each.number: _shown(each) for each in found},
        "name": block_name(request, found), "line": escape(line), "version": __version__,
        "longest": length, "most": LONGEST, "t": said, "types": _types(),
        "addressing": scl_fields.addressing, "writing": scl_fields.writing, "reading": scl_fields.reading,
    }  # fmt: skip
    known["head"] = _head(found, said)
    known["example"] = _example(str(known["name"]), found, changes)
    text = _template().render(known | {"temporary": ()})
    return _template().render(known | {"temporary": _temporary(text)})


def block_name(request: Request, found: Sequence[Field]) -> str:
    """`Change_p2900`, `Read_p945_p947_p948_and_3_more`."""
    names = [each.name for each in found[:_NAMED]]
    more = [f"and_{len(found) - _NAMED}_more"] if len(found) > _NAMED else []
    return "_".join([_OPERATIONS[request.request_id or 0], *names, *more])


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("ds47.report"), autoescape=False, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    return environment.get_template("block.scl.j2")


def _said(key: str, lang: str, **values: Any) -> str:
    return say(key, **{name: str(value) for name, value in values.items()}).text(lang)


def _types() -> dict[str, dict[str, str]]:
    """The type of each parameter of WRREC and RDREC, as it is declared."""
    return {
        name: {each.name: _SPELLED.get(each.type, each.type) for each in parameters}
        for name, parameters in spec.instructions().items()
    }


def _temporary(text: str) -> Iterator[str]:
    for name, kind in _TEMPORARY.items():
        if re.search(rf"#{name}\b", text):
            yield f"{name} : {kind}"


def _length(request: Request, found: Sequence[Field]) -> int:
    blocks = sum(2 + len(each.block.raw) + len(each.block.pad) for each in found if each.block)
    return 4 + 6 * len(request.addresses) + blocks


def _shown(field: Field) -> str:
    address = field.address
    return formatting.parameter(
        Parameter(address.pnu, address.subindex, address.attribute_name, address.element_count),
        written=False,
    )


def _about(field: Field, lang: str) -> Iterator[str]:
    """The comment at its variable: which parameter, its format, what has to be known of it."""
    row = spec.formats().get(-1 if field.format is None else field.format)
    yield _shown(field) + (f", {row.name}" if row else "")
    if field.block is None and row is not None:
        yield say("scl_known_type").text(lang)
    if field.way == NUMBER:
        yield say("scl_any_number").text(lang)
    elif field.format is None:
        yield say("scl_any_bytes").text(lang)
    elif row is not None and row.divide:
        yield (
            say(
                "scl_scaled", raw=str(row.divide), value=str(row.multiply or 1), unit=row.unit or ""
            )
            .text(lang)
            .rstrip()
        )
    if field.whole:
        yield say("scl_text", n=field.count).text(lang)
    elif field.way == TEXT:
        yield say("scl_padded").text(lang)
    if field.wide:
        yield say("scl_wide").text(lang)


def _head(found: Sequence[Field], said: Any) -> list[str]:
    keys = [
        "scl_head_run",
        "scl_head_repeat",
        "scl_head_check",
        "scl_head_channel",
        "scl_head_call",
    ]
    texts = [text for key in keys for text in said(key).split("\n")]
    constant = [each.name for each in found if each.block and not each.start]
    return texts + ([said("scl_constant", names=", ".join(constant))] if constant else [])


def _example(name: str, found: Sequence[Field], changes: bool) -> list[str]:
    """A call of the block, as comment: its instance, and what has to be connected."""
    given = [(each.name, f"#{each.name}") for each in found if changes and each.start]
    rows = [("start", "#start"), ("hardwareId", '"Drive_1~Telegram"'), *given]
    rows += [("channelInUse", '"Drives".inUse1'), ("channelReference", '"Drives".reference1')]
    head = f'"{name}_DB"('
    lines = [f"{left} := {right}" for left, right in rows]
    return ["", *(
        (head if at == 0 else " " * len(head)) + text + ("," if at < len(lines) - 1 else ");")
        for at, text in enumerate(lines)
    )]  # fmt: skip
