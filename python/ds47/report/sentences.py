"""What an analysis found, in English or Chinese: findings and diagnoses, error numbers, names of parameters.

Only this module words them, and nothing parses its texts. spec/rules.toml explains the types of arguments;
spec/diagnoses.toml and spec/pairing.toml have the words of keys. Used by every report, by `watch`, `check` and
`decode`. lua/ds47/report/sentences.lua says the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from string import Formatter
from typing import Any, Final

from ds47 import model
from ds47.model import Diagnosis, Finding, Parameter, ParameterError
from ds47.profidrive.naming import spelling
from ds47.report import RuleText
from ds47.report.bilingual import say
from ds47.spec import Rule, error_hex, error_text, in_manual, manual_of, rules, s7
from ds47.spec.cyclic import error_text as pkw_error_text
from ds47.spec.semantics import diagnosis_words, parts, reasons
from ds47.spec.statuses import status_text

VALUES_SHOWN: Final = 4
"""The most values of a list that a sentence names."""
_LINE: Final = 100
_NUMBER: Final = re.compile(r"\d+")
_OF_ERROR: Final = re.compile(
    r"(?=0x(?:[0-9A-F]{2}){1,2}(?:, several parameters|，多个参数)?[:：])"
)
"""The start of a part of an advice that is about one error number."""
_SEVERAL: Final = (", several parameters", "，多个参数")
"""What follows the number if the part is only about requests with several parameters."""
_OF_ACCESS: Final = re.compile("D[EF]80([0-9A-F]{2})[0-9A-F]{2}")
_FRAMES: Final = ("frame", "frames")
_KEYS: Final = ("key", "clause")
"""Types of arguments that are keys of diagnoses.toml; a clause is not always there."""
_MANY: Final = "_many"
"""The ending of a key of diagnoses.toml for the words about several cases."""
_BRIEF: Final = "_brief"
"""The ending of a key for the words of a headline."""


def sentence(item: Finding | Diagnosis, lang: str = "en") -> str:
    """What a finding says, or what all cases of a diagnosis share: one line, with texts as captured."""
    if item.said is not None:
        return item.said
    if isinstance(item, Diagnosis) and item.differs:
        return _in_common(item, lang)
    return words(item.rule, item.args, lang)


def brief(item: Diagnosis, lang: str = "en") -> str:
    """The same as a clause for a headline: `dp3 refuses its configuration`."""
    row, args = rules()[item.rule], item.args
    if item.device is not None:
        args = {"device": item.device} | args
    names = _names(row, row.brief, args, _BRIEF)
    unknown = any(args.get(name) is None for name in _fields(row.brief) if name in row.args)
    if not row.brief or unknown or not names.isdisjoint(item.differs):
        return _titled(row, args, lang)
    return (row.brief_zh if lang == "zh" else row.brief).format_map(_Shown(row, args, lang, _BRIEF))


def _in_common(item: Diagnosis, lang: str) -> str:
    """The sentence for one case if none of its arguments differ, else the one for many cases, else the title."""
    row = rules()[item.rule]
    for template, form in ((row.message, ""), (row.many, _MANY)):
        names = _names(row, template, item.args, form)
        if template and names.isdisjoint(item.differs):
            chosen = template if lang != "zh" else row.many_zh if form else row.message_zh
            return chosen.format_map(_Shown(row, item.args, lang, form))
    return _titled(row, item.args, lang)


def _titled(row: Rule, args: Mapping[str, Any], lang: str) -> str:
    """The title of a rule, with its device."""
    title, device = row.title_zh if lang == "zh" else row.title, args.get("device")
    if device is None:
        return title
    where = drive(device, args.get("slot"), lang)
    return say("cause_device", device=where, message=title).text(lang)


def _names(row: Rule, template: str, args: Mapping[str, Any], form: str) -> set[str]:
    """The arguments that a sentence shows, including those in the words of a key."""
    found = set(_fields(template))
    for name in list(found):
        if row.args.get(name) in _KEYS and args.get(name) is not None:
            found.update(_fields(_key_words(args[name], "en", form)))
    if "text" in found:
        found.add("status")
    if "error" in found:
        found.update(("code", "among"))
    if "drive" in found:
        found.update(("device", "slot"))
    if "parameter" in found:
        found.update(("pnu", "subindex"))
    return found


def _fields(template: str) -> Iterator[str]:
    return (name for _, name, _, _ in Formatter().parse(template) if name)


def _key_words(key: str, lang: str, form: str) -> str:
    known = diagnosis_words(lang)
    return known.get(key + form) or known[key]


def words(rule: str, args: Mapping[str, Any], lang: str = "en") -> str:
    """The sentence of a rule with these arguments.

    Raises:
        KeyError: there is no such rule.
    """
    row = rules()[rule]
    template = row.message_zh if lang == "zh" else row.message
    shown = _Shown(row, args, lang)
    text = template.format_map(shown)
    if args.get("dropped") and "reason" not in args:
        reason = reasons(lang)["dropped"]
        text += f"（{reason}）" if lang == "zh" else f" ({reason})"
    return text


def advice(
    row: RuleText, args: Mapping[str, Any], lang: str = "en", said: Collection[str] = ()
) -> str:
    """What a rule advises. Of the parts about error numbers, or codes of a STATUS, only the one seen is kept.

    Parts that were `said` already (`advice_parts`) are left out.
    """
    parts = [part for part in advice_parts(row, args, lang) if part not in said]
    return ("" if lang == "zh" else " ").join(parts)


def advice_parts(row: RuleText, args: Mapping[str, Any], lang: str = "en") -> list[str]:
    """The parts of `advice`, first the one about the error number. A key may have an advice of its own."""
    what = _which(args) if "area" in args else args.get("what")
    known, code = diagnosis_words(lang), _code(args)
    own = known.get(f"advice_{what}") or known.get(f"advice_{args.get('case')}")
    text = own or (row.advice_zh if lang == "zh" else row.advice)
    if code is None:
        return [text]
    ends = (":", "：") if args.get("asked") == 1 else (":", "：", *_SEVERAL)
    seen = tuple(error_hex(code) + each for each in ends)
    parts = [part.strip() for part in _OF_ERROR.split(text) if part]
    wanted = [part for part in parts if part.startswith(seen)]
    wanted += [part for part in parts if not _OF_ERROR.match(part)]
    of_ds47 = isinstance(row, Rule) and row.args.get("code") == "code"
    if of_ds47 and in_manual(code, args.get("vendor_id")):
        wanted.insert(0, manual_of(code, args["vendor_id"], lang))
    return wanted or parts


def _code(args: Mapping[str, Any]) -> int | None:
    """The error number that was seen; of a STATUS about a record access its ErrorCode1."""
    status = _OF_ACCESS.fullmatch(args.get("status") or "")
    return int(status[1], 16) if status else args.get("code")


def _which(args: Mapping[str, Any]) -> str:
    """The key for an item of S7: its address may suggest an element of a drive."""
    return "item" if args.get("pnu") is None else "item_or_element"


def at_offset(offset: int | None, text: str, lang: str = "en") -> str:
    """A text with its byte offset in the message in front; offsets count from 0, None means the whole message."""
    if offset is None:
        return text
    return say("finding_offset", offset=str(offset), message=text).text(lang)


def message(item: Finding, lang: str = "en") -> str:
    """The sentence of a finding, with the offset in front if it is about a byte of a message."""
    return at_offset(item.offset, sentence(item, lang), lang)


def error_words(item: ParameterError, lang: str = "en") -> str:
    """What an error number means on the drive that sent it; empty without a number."""
    return model.error_words(item, lang)


def name(item: Parameter, lang: str = "en") -> str | None:
    """The name the drive gives, else the name of a listed parameter, else None."""
    if item.described is not None and item.described.name is not None:
        return item.described.name
    known = item.listed
    if known is None:
        return None
    return known.name_zh if lang == "zh" else known.name_en


def renumbered(rule: str, args: Mapping[str, Any], number: Callable[[int], int]) -> dict[str, Any]:
    """The arguments with new frame numbers: `number` gives the new one for each."""
    types = rules()[rule].args
    changed = dict(args)
    for name, value in args.items():
        if value is not None and types.get(name) in _FRAMES:
            changed[name] = list(map(number, value)) if isinstance(value, list) else number(value)
    return changed


class _Shown(dict[str, str]):
    """The arguments of a finding by name, worded for a sentence."""

    def __init__(self, row: Rule, args: Mapping[str, Any], lang: str, form: str = "") -> None:
        super().__init__()
        self._row, self._args, self._lang, self._form = row, args, lang, form

    def __missing__(self, key: str) -> str:
        if key == "text":
            text = self._text()
        elif key == "error":
            text = self._error()
        elif key == "drive":
            text = drive(self["device"], self._args.get("slot"), self._lang)
        elif key == "parameter":
            known = "parameter" if self._args.get("pnu") is not None else "parameter_unknown"
            text = _key_words(known, self._lang, self._form).format_map(self)
        elif key == "item":
            known = _which(self._args)
            text = _key_words(known, self._lang, self._form).format_map(self)
        else:
            text = self._shown(key)
        self[key] = text
        return text

    def _error(self) -> str:
        """The error number of the finding, and what it means."""
        code, kind = self._args.get("code"), self._row.args["code"]
        if code is None:
            known = "no_known_number" if kind == "pkw" else "no_error_number"
            return say(known).text(self._lang)
        if kind == "pkw":
            return f"{code} {pkw_error_text(code, self._lang, self._args.get('vendor_id'))}"
        if kind == "s7_item":
            return f"{error_hex(code)} {s7.code_text('return_code', code, self._lang)}"
        if kind == "s7_error":
            return s7.error_text(code, self._lang)
        text = f"{error_hex(code)} {error_text(code, self._lang, self._args.get('vendor_id'))}"
        if not self._args.get("among"):
            return text
        return diagnosis_words(self._lang)["among"].format(error=text)

    def _text(self) -> str:
        """The status of the finding in words."""
        status = self._args.get("status")
        return status_text(int(status, 16), self._lang) if status is not None else ""

    def _shown(self, key: str) -> str:
        kind, value = self._row.args.get(key, "text"), self._args.get(key)
        if kind == "reason" and value is not None:
            known = reasons(self._lang)
            dropped = self._args.get("dropped")
            between = "；" if self._lang == "zh" else "; "
            return known[value] + (between + known["dropped"] if dropped else "")
        if kind == "clause" and value is None:
            return ""
        if kind in _KEYS and value is not None:
            return _key_words(value, self._lang, self._form).format_map(self)
        if kind == "place" and value is not None:
            return place(value, self._lang)
        if kind == "text" and isinstance(value, str):
            return part(value, self._lang)
        if kind == "pnu" and value is not None:
            return spelling(value, self._args.get("family"))
        if kind == "pnus" and value is not None:
            return _values([spelling(each, self._args.get("family")) for each in value])
        return shown(kind, value)


def drive(device: str, slot: int | None, lang: str) -> str:
    """A drive in cyclic frames: its device and slot; a drive named by hand has no slot."""
    if slot is None:
        return device
    return diagnosis_words(lang)["drive"].format(device=device, slot=slot)


def part(text: str, lang: str) -> str:
    """A part of a message, such as `value block 1 of 2`; a part in no table stays as it is."""
    numbers = _NUMBER.findall(text)
    names = iter("nm")
    known = parts().get(_NUMBER.sub(lambda _: f"{{{next(names, '')}}}", text))
    if lang != "zh" or known is None:
        return text
    return known.format(**dict(zip("nm", numbers, strict=False)))


def place(where: Mapping[str, int], lang: str) -> str:
    """Slot, subslot and record index in words."""
    slot = slot_number(where["slot"], where["subslot"])
    return diagnosis_words(lang)["place"].format(slot=slot, index=record_index(where["index"]))


def slot_number(slot: int, subslot: int | None) -> str:
    """`1.1`; `1` on PROFIBUS, which has no subslots."""
    return str(slot) if subslot is None else f"{slot}.{subslot}"


def record_index(index: int) -> str:
    """A record index as people write it: 47, 0xB02E."""
    return str(index) if index < 0x100 else f"0x{index:04X}"


def shown(kind: str, value: Any) -> str:
    """A value of a type that needs no words."""
    if value is None:
        return "-" if kind in _ABSENT else "?"
    return _SHOW.get(kind, str)(value)


def _values(items: list[Any]) -> str:
    shown = [str(each) for each in items[:VALUES_SHOWN]]
    return ", ".join([*shown, "..."] if len(items) > VALUES_SHOWN else shown) or "-"


_ABSENT: Final = frozenset(("code", "pkw", "info", "status", "value", "values"))
_SHOW: Final[Mapping[str, Callable[[Any], str]]] = {
    "hex": error_hex,
    "code": error_hex,
    "hex32": "0x{:08X}".format,
    "index": record_index,
    "ms": "{:.1f}".format,
    "ms3": "{:.3f}".format,
    "s": "{:.1f}".format,
    "numbers": lambda items: ", ".join(map(str, items)),
    "frames": lambda items: ", ".join(map(str, items)),
    "values": _values,
    "line": lambda text: text if len(text) <= _LINE else text[: _LINE - 3] + "...",
}
