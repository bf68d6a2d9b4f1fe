"""Whether what was read from a file is a capture object that can be compared.

Checked is what the comparisons rely on, and no more: a result that an older version stored may lack the
rest, and ten thousand of them are read in one run. The whole contract is the JSON Schema
`ds47/schema/report-2.schema.json`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType
from typing import Any, NamedTuple

from ds47.report import contract

Shape = Mapping[str, Any]
"""Key -> the types of its value; or a shape, for an object; or a list of one shape, for a list of such."""


class Maybe(NamedTuple):
    """An object of this shape, or null."""

    shape: Shape


_TYPES: Mapping[str, tuple[type, ...]] = {
    "string": (str,), "integer": (int,), "number": (int, float), "array": (list,), "null": (NoneType,),
}  # fmt: skip


def _of(shape: contract.Shape, *names: str) -> dict[str, Any]:
    """The types of these keys, as the contract has them."""
    return {key.name: _types(key.schema) for key in shape.keys if key.name in names}


def _types(schema: Mapping[str, Any]) -> tuple[type, ...]:
    own = schema.get("type", ["string", "null"] if "anyOf" in schema else "string")
    return tuple(each for name in ([own] if isinstance(own, str) else own) for each in _TYPES[name])


_TEXT, _WHOLE = (str,), (int,)
_MAYBE_TEXT = (str, NoneType)
_PARAMETER: Shape = _of(
    contract.PARAMETER,
    "pnu", "subindex", "attribute", "element_count", "name", "unit", "values", "scaled",
) | {"error": Maybe(_of(contract.ERROR, "code", "text"))}  # fmt: skip
_TRANSACTION: Shape = _of(
    contract.TRANSACTION,
    "id", "operation", "state", "device", "slot", "subslot", "index", "axis", "duration_ms",
) | {
    "frames": _of(
        contract.FRAMES, "write_request", "write_response", "read_request", "read_response"
    ),
    "status": {"write": _MAYBE_TEXT, "read": _MAYBE_TEXT},
    "parameters": [_PARAMETER],
}  # fmt: skip
_CAPTURE: Shape = {
    "devices": [_of(contract.DEVICE, "ip", "station")],
    "transactions": [_TRANSACTION],
    "findings": [_of(contract.FINDING, "rule", "severity", "message", "frame", "transaction")],
}
_OPTIONAL: Shape = {
    "diagnoses": [{"rule": _TEXT}],
    "files": [{"path": _TEXT, "first_frame": _WHOLE, "frames": _WHOLE}],
}


def flaw(capture: object) -> str | None:
    """Where a part is missing or of the wrong type first, `transactions[0].id`; None if all is well."""
    where = _flaw(capture, _CAPTURE)
    if where is None and isinstance(capture, dict):
        extra = {key: shape for key, shape in _OPTIONAL.items() if key in capture}
        where = _flaw(capture, extra)
    return None if where is None else where.lstrip(".")


def _flaw(item: object, shape: Shape) -> str | None:
    """The path from `item` to what is wrong; empty where it is no object at all."""
    if not isinstance(item, dict):
        return ""
    for key, kind in shape.items():
        if key not in item:
            return f".{key}"
        value = item[key]
        if type(kind) is tuple:
            if not isinstance(value, kind):
                return f".{key}"
        elif (where := _inside(value, kind)) is not None:
            return f".{key}{where}"
    return None


def _inside(value: object, kind: Any) -> str | None:
    if isinstance(kind, Maybe):
        return None if value is None else _flaw(value, kind.shape)
    return _flaw_of_many(value, kind[0]) if isinstance(kind, list) else _flaw(value, kind)


def _flaw_of_many(items: object, shape: Shape) -> str | None:
    if not isinstance(items, list):
        return ""
    for number, item in enumerate(items):
        where = _flaw(item, shape)
        if where is not None:
            return f"[{number}]{where}"
    return None
