"""Descriptions and texts of parameters as the plugin shows them, back to the keys of the JSON report.

What stands where in the tree is decided in dissector/ds47_ws/description_tree.lua; the rest of a parameter is read
in `fields`.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

from ds47 import spec
from ds47.profidrive.description import KEYS
from ds47.profidrive.formats import number_value

_PREFIX = "ds47."
_FLAGS = frozenset(("writable", "text_array", "changed", "reset_only", "array"))
_TEXTS = frozenset(("type", "unit"))


def read(item: Element, format_name: str | None) -> dict[str, Any]:
    """`description` and `texts` of a parameter, those that it has; `format_name` is that of its values."""
    found: dict[str, Any] = {}
    texts = [_text(each) for each in item.iterfind("field") if each.get("name") == "ds47.text"]
    for child in item.iterfind("field"):
        if child.get("name") == "ds47.description":
            found["description"] = _description(child, format_name)
    return found | ({"texts": texts} if texts else {})


def _description(item: Element, format_name: str | None) -> dict[str, Any]:
    seen = {
        child.get("name", "").removeprefix(f"{_PREFIX}description."): child
        for child in item.iterfind("field")
    }
    found: dict[str, Any] = dict.fromkeys(KEYS)
    of_limits = seen["type"].get("show") if "type" in seen else format_name
    for name, element in seen.items():
        shown = element.get("show", "")
        if name in _FLAGS:
            found[name] = shown in ("1", "True")
        elif name in _TEXTS:
            found[name] = shown
        elif name == "name":
            found[name] = _text(element)
        elif name == "factor":
            found[name] = number_value(float(shown))
        elif name in ("low", "high"):
            row, number = spec.format_named(of_limits or ""), float(shown)
            is_float = row is None or row.kind == "float"
            found[name] = number_value(number) if is_float else int(number)
        else:
            found[name] = int(shown, 0)
    return found


def _text(item: Element) -> str:
    """Latin-1 where the bytes are there; a text of another frame as it is shown."""
    raw = item.get("value")
    return (
        item.get("show", "") if raw is None else bytes.fromhex(raw).decode("latin-1").rstrip("\0 ")
    )
