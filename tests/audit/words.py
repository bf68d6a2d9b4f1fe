"""Whether a sentence says just its arguments: the one place where something is read out of a sentence.

The form of a sentence comes from its template in `spec/rules.toml`: where which argument stands, and the text between.
So each number in a sentence belongs to the template or to an argument. What an error number or a status means in words
is not looked at.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from string import Formatter
from typing import Any

from tests.audit.reading import Complaint, Finding, Reading

SPEC = Path(__file__).resolve().parents[2] / "python" / "ds47" / "spec"


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((SPEC / name).read_text("utf-8"))


RULES: dict[str, dict[str, Any]] = {row["id"]: row for row in _table("rules.toml")["rule"]}
WORDS: dict[str, str] = {
    **_table("diagnoses.toml")["words"]["en"],
    **_table("diagnoses.toml")["analyzer"]["en"],
}
"""A key that an argument may have -> its clause, a template itself."""
REASONS = {name: row["en"] for name, row in _table("pairing.toml")["reason"].items()}
ERRORS = {"s7_item": "{} .*", "s7_error": r".*\({}\)"}
"""Type of an error number -> how it stands with its meaning, where that is not behind it."""
NUMBERS = {
    "hex32": "0x{:08X}",
    "s7_error": "{:04X}",
    "ms": "{:.1f}",
    "s": "{:.1f}",
    "ms3": "{:.3f}",
}
"""Type of an argument -> how a number stands in a sentence."""
HEX = ("hex", "code", "s7_item")
MOST_VALUES, MOST_CHARACTERS = 4, 100
ABSENT = "(?:-|\\?|no error number(?: that is known here)?)"
NEVER = "(?!)"
_NUMBER = "(?:[prP]0*)?"
"""What stands in front of the number of a parameter."""


class _Form:
    """The expression of a template with these arguments."""

    def __init__(self, rule: str, args: dict[str, Any], many: bool) -> None:
        self._types, self._args, self._many = RULES[rule].get("args", {}), args, many
        self.named: set[str] = set()
        """The arguments that the sentence shows."""

    def of(self, template: str) -> str:
        parts = Formatter().parse(template)
        return "".join(
            re.escape(text) + (self._argument(name) if name else "") for text, name, *_ in parts
        )

    def _argument(self, name: str) -> str:
        kind, value = self._types.get(name, "text"), self._args.get(name)
        if name == "error":
            self.named.add("code")
            form = ERRORS.get(self._types["code"], "{}(?: .*)?")
            form = form.format(_shown(self._types["code"], self._args.get("code")))
            if not self._args.get("among"):
                return form
            self.named.add("among")
            return form + re.escape(WORDS["among"].removeprefix("{error}"))
        if name == "text" and name not in self._types:
            return ".*"  # what the status means
        if name == "parameter":
            unknown = self._args.get("pnu") is None
            return self._clause("parameter_unknown" if unknown else "parameter")
        if name == "item":
            return self._clause("item" if self._args.get("pnu") is None else "item_or_element")
        if name == "drive":
            return self.of("{device}" if self._args.get("slot") is None else WORDS["drive"])
        self.named.add(name)
        if kind == "clause" and value is None:
            return ""
        if kind in ("key", "clause") and value is not None:
            return self._clause(str(value))
        if kind == "reason":
            return re.escape(REASONS.get(str(value), "?")) + self.dropped("; ", "")
        if kind == "pnus" and value is not None:
            shown = [_NUMBER + str(each) for each in value[:MOST_VALUES]]
            return ", ".join([*shown, r"\.\.\."] if len(value) > MOST_VALUES else shown)
        return (_NUMBER if kind == "pnu" else "") + _shown(kind, value)

    def _clause(self, key: str) -> str:
        words = WORDS.get(f"{key}_many", WORDS.get(key)) if self._many else WORDS.get(key)
        return NEVER if words is None else self.of(words)

    def dropped(self, before: str, behind: str) -> str:
        """What is added where the capture says that frames were dropped."""
        told = before + REASONS["dropped"] + behind
        return re.escape(told) if self._args.get("dropped") else ""


def _shown(kind: str, value: Any) -> str:
    """The expression of an argument of this type."""
    return ABSENT if value is None else re.escape(_plain(kind, value))


def _plain(kind: str, value: Any) -> str:
    if kind in NUMBERS:
        return NUMBERS[kind].format(value)
    if kind in HEX:
        return f"0x{value:02X}" if value < 0x100 else f"0x{value:04X}"
    if kind == "index":
        return str(value) if value < 0x100 else f"0x{value:04X}"
    if kind == "place":
        slot = value["slot"] if value["subslot"] is None else f"{value['slot']}.{value['subslot']}"
        return f"slot {slot}, index {_plain('index', value['index'])}"
    if isinstance(value, list):
        most = MOST_VALUES if kind == "values" else len(value)
        return ", ".join([*map(str, value[:most]), *["..."][: len(value) > most]]) or "-"
    text = str(value)
    cut = kind == "line" and len(text) > MOST_CHARACTERS
    return text[: MOST_CHARACTERS - 3] + "..." if cut else text


def _form(rule: str, args: dict[str, Any], many: bool = False) -> tuple[str, set[str]]:
    form = _Form(rule, args, many)
    found = form.of(RULES[rule]["many" if many else "message"])
    if "reason" not in args:
        found += form.dropped(" (", ")")
    return found, form.named


def check(finding: Finding, reading: Reading) -> Iterator[Complaint]:
    """Whether the sentence of a finding is that of its arguments."""
    for text in problems(finding.rule, finding.message, finding.args):
        yield Complaint(finding.rule, f"frame {finding.frame}, sentence", text)


def problems(rule: str, sentence: str, args: dict[str, Any], many: bool = False) -> Iterator[str]:
    """What is wrong with a sentence of these arguments; `many`: of several cases that agree in them."""
    text = re.sub(r"^offset \d+: ", "", sentence)
    if not re.fullmatch(_form(rule, args, many)[0], text, re.DOTALL):
        yield f"is not that of {args}: {text!r}"


def has_many(rule: str) -> bool:
    """Whether several cases of a rule have a sentence of their own."""
    return "many" in RULES[rule]


def named(rule: str, args: dict[str, Any]) -> set[str]:
    """The arguments that the sentence of one case shows."""
    return _form(rule, args)[1]
