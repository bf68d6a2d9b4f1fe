"""What a code may mean: the numbers that its text stands for, looked up in the tables of `ds47.spec`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

from ds47 import spec
from ds47.explain import blocks, cyclic, forms, messages, snap7
from ds47.explain.answer import CodeMeaning, CodePart, answer
from ds47.explain.makers import Maker, called
from ds47.profidrive.naming import spelling
from ds47.spec import blocks as spec_blocks
from ds47.spec import explanations, s7
from ds47.spec.cyclic import bit_words
from ds47.spec.explanations import Explanation
from ds47.spec.statuses import status_hex, status_text


def explain(text: str, lang: str = "en", vendor: Maker | None = None) -> list[CodeMeaning]:
    """All that a code can mean, the likeliest first; what has no meaning comes last.

    Args:
        text: the code, see `read`.
        lang: "en" or "zh".
        vendor: of the error numbers; None takes all known ones.

    Raises:
        UnknownFormError: the text is not a code.
    """
    asked = blocks.asked(text)
    if asked is not None:
        return _of_block(asked, lang, vendor, text)
    code = forms.read(text)
    found: dict[tuple[str, str, str | None], CodeMeaning] = {}
    for reading in code.readings:
        for meaning in _meanings(reading, code.kind, lang, vendor):
            found.setdefault((meaning.kind, meaning.code, meaning.vendor), meaning)
    if not found:  # a word in front that does not go with the number
        raise forms.UnknownFormError(text)
    if code.kind is None and not any(each.known for each in found.values()):
        guesses = (
            *messages.likely(code.text, lang),
            *cyclic.likely(code.readings, lang),
            *blocks.both_words(code.readings, lang),
        )
        if guesses:
            rest = (each for each in found.values() if each.kind == S7_ERROR)
            found = {(each.kind, each.code, None): each for each in (*guesses, *rest)}
    far = {
        f"0x{each.value:04X}" for each in code.readings if each.decimal and each.size == forms.WORD
    }
    some, bare = any(each.known for each in found.values()), code.text.isdigit()
    kept = [each for each in found.values() if each.known or not some or each.code not in far]
    return sorted(
        kept,
        key=lambda each: (
            not each.known,
            bare and each.kind in (forms.PARAMETER, forms.FAULT),
            each.rank,
        ),
    )


def _of_block(asked: blocks.Asked, lang: str, vendor: Maker | None, text: str) -> list[CodeMeaning]:
    """All that a number can mean at the outputs of a block that may have it."""
    found: list[CodeMeaning] = []
    for output in asked.outputs:
        if output.reads in (blocks.CODE, blocks.ACCESS):
            found += blocks.meanings(asked, output, lang)
        else:
            with suppress(forms.UnknownFormError):
                found += _of_output(asked, output, lang, vendor)
    known = [each for each in found if each.known]
    if not found:
        raise forms.UnknownFormError(text)
    return sorted(known, key=lambda each: each.rank == explanations.rank("block_else")) or found[:1]


def _of_output(
    asked: blocks.Asked, output: spec_blocks.Output, lang: str, vendor: Maker | None
) -> Iterator[CodeMeaning]:
    """What a number means at an output that hands on that of another block or of the drive."""
    service, words = asked.block.service, spec_blocks.words(lang)
    word, value = explanations.kind_word(output.reads), asked.value
    vendor = vendor or (Maker(output.vendor) if output.vendor else None)
    found = explain(f"{word} {value}", lang, vendor)
    if output.decimal and value.isdigit():  # an INT, which a watch table shows so
        found = list(dict.fromkeys([*explain(f"{word} 10#{value}", lang, vendor), *found]))
    others = {0xDE, 0xDF} - {service} if service is not None else set()
    own = [each for each in found if int(each.code[:2], 16) not in others] if others else found
    for each in own or found:
        title = words["of_output"].format(
            blocks=asked.block.name, output=output.name, text=each.title
        )
        yield each if service is not None else replace(each, title=title)


def _meanings(
    reading: forms.Reading, kind: str | None, lang: str, vendor: Maker | None
) -> Iterator[CodeMeaning]:
    value = reading.value
    if kind is None:
        yield from blocks.alone(reading, lang)
    if kind == forms.PKW or kind in bit_words():
        yield cyclic.named(str(kind), value, lang, None if vendor is None else vendor.id)
    elif kind in RETURNED or kind == S7_ERROR:
        below = list(snap7.below_zero(reading, lang)) if kind == S7_ERROR else []
        yield from below
        if reading.size in (forms.BYTE, forms.WORD) and not below:
            yield _s7(value, lang) if kind == S7_ERROR else _number(str(kind), value, lang)
        elif kind == S7_ERROR and not below:
            yield from snap7.named(reading, lang)
    elif reading.size in _OF_ONE_MEANING:
        yield _OF_ONE_MEANING[reading.size](value, lang)
    elif reading.size == forms.FORMAT:
        yield _number(forms.FORMAT, value, lang)
    elif reading.size in (forms.STATUS, forms.NUMBER):
        yield from _of_status(reading, kind, lang)
    elif reading.size == forms.WORD:
        yield from _of_word(reading, kind, lang, vendor)
    elif reading.decimal and kind is None:
        yield from _decimal_byte(value, lang, vendor)
    else:
        yield from _byte(value, kind, lang, vendor)
        if kind is None and value in s7.codes("return_code"):
            yield _behind(_s7(value, lang))


def _of_word(
    reading: forms.Reading, kind: str | None, lang: str, vendor: Maker | None
) -> Iterator[CodeMeaning]:
    """A number of two bytes."""
    value = reading.value
    ours = any(
        value in each.errors for each in spec.vendors()
    )  # beyond a byte only a vendor has errors
    errors = list(_errors(value, lang, vendor)) if kind == "error" or (not kind and ours) else []
    errors += _s7_error(reading, kind, lang)
    yield from errors
    returned = list(_returned(value, lang)) if kind is None else []
    yield from returned
    if kind in (None, "status", "index"):
        known = any(each.known for each in (*errors, *returned))
        yield from (each for each in _word(value, kind, lang) if each.known or not known)


# Statuses


def _of_status(reading: forms.Reading, kind: str | None, lang: str) -> Iterator[CodeMeaning]:
    """A number of four bytes: a status, or one of a library that speaks S7."""
    if kind not in (None, "status"):
        return
    if reading.size == forms.STATUS:
        yield _status(reading.value, lang)
        yield from _without_first_byte(reading.value, lang)
    if kind is None and (reading.decimal or _entry_of_status(reading.value) is None):
        yield from snap7.alone(reading, lang)


def _status(status: int, lang: str, word: int | None = None) -> CodeMeaning:
    """A status of four bytes; `word` where only its two middle bytes were given."""
    words = explanations.words(lang)
    entry = _entry_of_status(status)
    turned = int.from_bytes(status.to_bytes(4, "little"), "big")
    if entry is None and _entry_of_status(turned) is not None:
        return _meant(turned, "bytes_reversed", lang, given=status_hex(status))
    late = None if entry is not None else _read_too_early(status)
    if late is not None:
        return _meant(late, "bytes_shifted", lang, given=status_hex(status))
    code = status_hex(status)
    if entry is None:
        text = f"{words['unknown_status']} ({status_text(status, lang)})"
        title, view, known = words["status"].format(code=code, text=text), "unknown", False
        filter_name = "status"
    else:
        pattern = words["status"] if word is None else words["word"]
        headline = _status_headline(entry, status, lang)
        title = pattern.format(code=code, text=headline, word=f"{word or 0:04X}")
        view, known, filter_name = _sided(entry.plc, status), True, entry.filter
        filter_name = _sided(filter_name, status)
    entry = entry or explanations.of_unknown()
    return answer(
        "status", code, code, title, known, entry, lang, rank="status",
        parts=_status_parts(status, lang), view=view, shown=code,
        filter_name=filter_name, values=_status_values(status),
    )  # fmt: skip


def _meant(status: int, key: str, lang: str, **given: str) -> CodeMeaning:
    """The meaning of a status that was given in another form, with words that say so."""
    inner, words = _status(status, lang), explanations.words(lang)
    headline = inner.title.split(words["separator"], 1)[1]
    title = words[key].format(code=status_hex(status), text=headline, **given)
    return replace(inner, title=title)


def _read_too_early(status: int) -> int | None:
    """The status that begins one byte later, with 0 as its last byte; None if it has no meaning."""
    late = status << 8 & 0xFFFFFFFF
    first = late >> 24
    begins = first in spec.status("en").code or (first and first in _PLC_FUNCTIONS)
    return late if begins and _entry_of_status(late) is not None else None


def _without_first_byte(status: int, lang: str) -> Iterator[CodeMeaning]:
    """What begins with the second byte of a status (80B50000), and is none itself."""
    known = _entry_of_status(status) or _entry_of_status(
        int.from_bytes(status.to_bytes(4, "little"), "big")
    )
    named = status >> 24 == 0x80 and (status >> 16 & 0xFF) in spec.status("en").access
    if known is None and named and status & 0xFFFF == 0:
        yield from (each for each in _word(status >> 16, "status", lang) if each.known)


def _entry_of_status(status: int) -> Explanation | None:
    rest = _four(status)
    return explanations.of_status(*rest) or explanations.of_local(*rest)


def _four(status: int) -> tuple[int, int, int, int]:
    code, decode, first, second = status.to_bytes(4, "big")
    return code, decode, first, second


def _sided(name: str, status: int) -> str:
    """The view or filter for a refused Read or Write: `refused` -> `read_refused`."""
    side = {0xDE: "read", 0xDF: "write"}.get(status >> 24)
    if side is None:
        return name
    return {"refused": f"{side}_refused", "status": f"status_{side}"}.get(name, name)


def _status_headline(entry: Explanation, status: int, lang: str) -> str:
    code, decode, first, second = _four(status)
    names = spec.status(lang)
    service = names.code.get(code, "")
    name = (names.access if decode == 0x80 else names.protocol).get(first)
    number = decode & 0x0F
    return entry.headline(lang).format(
        service=service[:1].upper() + service[1:],
        name=name or f"0x{first:02X}",
        code2=f"0x{second:02X}",
        n=number,
        parameter=explanations.input_name(number, lang),
    )


def _status_parts(status: int, lang: str) -> tuple[CodePart, ...]:
    """The four bytes; what the middle two say depends on who made the status."""
    if status == 0:
        return ()
    code, decode, first, second = _four(status)
    names, words = spec.status(lang), explanations.words(lang)
    table = {0x80: names.access, 0x81: names.protocol}.get(decode, {})
    unknown = words["unknown_part"]
    made_by_plc = code in _PLC_FUNCTIONS
    return (
        CodePart(
            f"{code:02X}",
            "ErrorCode",
            words["plc_itself"] if made_by_plc else names.code.get(code, unknown),
        ),
        CodePart(
            f"{decode:02X}", "ErrorDecode", "" if made_by_plc else names.decode.get(decode, unknown)
        ),
        CodePart(f"{first:02X}", "ErrorCode1", "" if made_by_plc else table.get(first, unknown)),
        CodePart(f"{second:02X}", "ErrorCode2", words["second"] if second else ""),
    )


_PLC_FUNCTIONS = (0x00, 0x40, 0xC0)
"""First bytes of STATUS that no PDU has: the PLC made it up (no job, CODESYS, S7)."""


def _status_values(status: int) -> dict[str, str]:
    code, decode, first, second = (f"0x{each:02x}" for each in _four(status))
    whole = f"0x{status:08x}"
    return {"code": code, "decode": decode, "code1": first, "code2": second, "value": whole}


# Words of two bytes


def _word(value: int, kind: str | None, lang: str) -> Iterator[CodeMeaning]:
    """The middle of a STATUS, or a record index."""
    decode, first = value >> 8, value & 0xFF
    whole: list[int] = []
    if kind != "index":
        if decode == 0x80:
            if explanations.has_local(decode, first):
                whole.append(0xC0)
            if first >= 0xA0:
                whole[:0] = [0xDE, 0xDF]
        elif 0x81 <= decode <= 0x8F:
            whole.append(0xC0)
        elif decode == 0x70 and explanations.of_local(0, decode, first, 0):
            whole.append(0x00)
        elif decode in spec.status("en").code and first in _FOREIGN:
            yield _meant(value << 16, "half", lang, word=f"{value:04X}")
            return
    for code in whole:
        yield _status(code << 24 | value << 8, lang, value)
    entry = explanations.of_number("index", value) if kind != "status" else None
    if entry is not None:
        yield _number("index", value, lang)
    elif not whole:
        yield _unknown_word(value, lang)


_FOREIGN = (0xFE, 0xFF)
"""ErrorDecode that says whose codes the other two bytes are: with the first byte it is an answer already."""


def _unknown_word(value: int, lang: str) -> CodeMeaning:
    words = explanations.words(lang)
    code = f"0x{value:04X}"
    plain = words["plain_word"].format(code=code, decimal=value)
    names = spec.status(lang)
    high, low = value >> 8, value & 0xFF
    parts = (
        CodePart(
            f"{high:02X}",
            words["high"],
            names.code.get(high) or names.decode.get(high) or words["unknown_part"],
        ),
        CodePart(
            f"{low:02X}",
            words["low"],
            names.decode.get(low) or names.access.get(low) or words["unknown_part"],
        ),
    )
    return answer(
        "word", code, code, plain + words["separator"] + words["unknown_word"].format(word=f"{value:04X}"), False,
        explanations.of_unknown(), lang, rank="error_code", parts=parts, view="unknown",
    )  # fmt: skip


# Bytes: ids, formats, error numbers


def _byte(value: int, kind: str | None, lang: str, vendor: Maker | None) -> Iterator[CodeMeaning]:
    if kind in (None, "error"):
        yield from _errors(value, lang, vendor)
    for name in ("response_id", "request_id", "attribute", "format"):
        known = value in _names(name, lang)
        if kind == name or (kind is None and known):
            yield _number(name, value, lang)
    if kind == "index" or (kind is None and explanations.of_number("index", value)):
        yield _number("index", value, lang)
    if kind == "status" or kind is None:
        if value in spec.status("en").access:
            yield from _word(0x8000 | value, "status", lang)
        if value in spec.status("en").code:
            yield _number("error_code", value, lang)
        elif kind == "status" and value not in spec.status("en").access:
            yield _status(value, lang)


def _decimal_byte(value: int, lang: str, vendor: Maker | None) -> Iterator[CodeMeaning]:
    """What people write in decimal: error numbers and indices; a watch table shows response ids."""
    yield from _errors(value, lang, vendor)
    if explanations.of_number("index", value):
        yield _number("index", value, lang)
    if _rank_of("response_id", value) == "negative_response":
        yield _number("response_id", value, lang)


RETURNED = ("consistent_data", "record_data")
"""Kinds of words that system functions of a CPU return: of cyclic data, and of records."""
S7_ERROR, S7_ITEM = "s7_error", "s7_item"
"""The kinds of words with which S7 communication refuses a job, and of bytes that it says of an item."""
_FILTERS = {"error_code": "service"} | dict.fromkeys(RETURNED, "")
"""Kinds with another name in filters, or without filters."""


def _names(kind: str, lang: str) -> Mapping[int, str]:
    """The codes of a kind that the tables know, with their names."""
    names = {code: row.name for code, row in _TABLES[kind]().items()}
    return names | (attributes_of_makers(lang) if kind == "attribute" else {})


def attributes_of_makers(lang: str) -> dict[int, str]:
    """The attributes of makers, and in brackets what the known ones are: ` (Stöber: integer)`."""
    words, found = explanations.words(lang), dict.fromkeys(spec.vendor_attributes(), "")
    for code, rows in spec.maker_attributes().items():
        said = [
            f"{maker}{words['separator']}{row.zh if lang == 'zh' else row.name}"
            for maker, row in rows
        ]
        found[code] = words["bracket"].format(text=words["part_separator"].join(said))
    return found


_TABLES: Mapping[str, Callable[[], Mapping[int, Any]]] = {
    "attribute": spec.attributes, "format": spec.formats,
    "response_id": spec.response_ids, "request_id": spec.request_ids,
}  # fmt: skip


def _number(kind: str, value: int, lang: str) -> CodeMeaning:
    """An id, attribute, format, index or first byte of a status."""
    words = explanations.words(lang)
    wide = kind in RETURNED or (kind == "index" and value > 0xFF)
    code = f"0x{value:0{4 if wide else 2}X}"
    shown = value - 0x10000 if kind in RETURNED and value > 0x7FFF else value  # an INT of the PLC
    known, name = True, ""
    if kind == "error_code":
        name = spec.status(lang).code[value]
    elif kind != "index" and kind not in RETURNED:
        names = _names(kind, lang)
        known, name = value in names, names.get(value, "")
    entry = explanations.of_number(kind, value)
    known = known and entry is not None and name != "Reserved"
    if entry is None or not known:
        plain = words[f"plain_{kind}"].format(code=code, decimal=shown)
        title = f"{plain}{words['separator']}{words['unknown_error_text']}"
        if kind in RETURNED:
            near = (f"{each:04X}" for each in spec_blocks.near(explanations.numbers(kind), value))
            title = words["near"].format(text=title, list=words["list_separator"].join(near))
        entry = explanations.of_unknown()
    else:
        size = _size(value, words) if kind == "format" else ""
        headline = entry.headline(lang).format(name=name, size=size)
        title = words[kind].format(code=code, decimal=shown, text=headline)
    alone = code if kind == "error_code" else f"{explanations.kind_word(kind)} {code}"
    return answer(
        kind, code, alone, title, known, entry, lang, rank=_rank_of(kind, value),
        parts=_other_names(value, words) if known and kind == forms.FORMAT else (),
        filter_name=entry.filter or _FILTERS.get(kind, kind),
        values={"value": code.lower(), "code": code.lower(), "name": name or code},
    )  # fmt: skip


def _rank_of(kind: str, value: int) -> str:
    """The name in the order of meanings (explain.toml) of what a number is as one of a kind."""
    if kind == "response_id" and value in (0x80, 0x81, 0x82):
        return "negative_response"
    if kind in ("response_id", "request_id") and (row := _TABLES[kind]().get(value)) and row.vendor:
        return "vendor_id"
    if kind == "format" and value == 0x44:
        return "format_error"
    if kind == "index" and value not in (0x2F, 0xB02E, 0xB02F):
        return "wrong_index"
    return kind


def _size(code: int, words: Mapping[str, str]) -> str:
    row = spec.formats()[code]
    if row.size is None:
        return words["size_unknown"]
    text = words["size_1" if row.size == 1 else "size_many"].format(size=row.size)
    return text if row.confirmed else words["size_unconfirmed"].format(size=text)


def _other_names(code: int, words: Mapping[str, str]) -> tuple[CodePart, ...]:
    """What a PLC and Wireshark call a format, where they call it something else."""
    row = spec.formats()[code]
    names = (("plc_name", row.plc), ("wireshark_name", row.wireshark))
    return tuple(CodePart(name, "", words[key]) for key, name in names if name)


def _errors(value: int, lang: str, vendor: Maker | None) -> Iterator[CodeMeaning]:
    """An error number: of the profile, and of each vendor that has one of its own."""
    makers = [
        each for each in spec.vendors()
        if value in each.errors and (vendor is None or vendor.name == each.name)
    ]  # fmt: skip
    if value in spec.errors() and not (vendor and makers):
        yield _error(value, spec.error_text(value, lang, _NOBODY), None, lang, vendor)
    for maker in makers:
        row = maker.errors[value]
        text = row.zh if lang == "zh" else row.en
        text, whose = text.format(code=value, above=value - row.code), Maker(maker.name, maker.id)
        yield _error(value, text, maker.name, lang, whose, whole_range=row.last is not None)
    if not makers and value not in spec.errors():
        yield _error(value, spec.error_text(value, lang, _NOBODY), None, lang, vendor)


def _s7_error(reading: forms.Reading, kind: str | None, lang: str) -> Iterator[CodeMeaning]:
    """A word with which S7 communication refuses a job, without a word in front of it."""
    if kind is None and not (reading.decimal and reading.value < _NEGATIVE):
        meaning = _s7(reading.value, lang)
        if meaning.known:
            yield meaning
        elif not reading.decimal and reading.value >= _NEGATIVE:
            others = any(each.known for each in _word(reading.value, None, lang))
            yield from () if others else (_behind(meaning),)


def _returned(value: int, lang: str) -> Iterator[CodeMeaning]:
    """What system functions return, and the diagnosis: a number alone is more likely one of WRREC and RDREC."""
    for kind in RETURNED:
        if explanations.of_number(kind, value) is not None:
            yield replace(_number(kind, value, lang), rank=explanations.rank("returned"))
    yield from messages.message_class(value, lang)


def _behind(meaning: CodeMeaning) -> CodeMeaning:
    """What S7 communication says comes last where it is the less likely meaning."""
    return replace(meaning, rank=explanations.rank("s7_else"))


_NEGATIVE = 0x8000
"""From this word on an INT is negative: below it a decimal number is one of a drive."""


def _s7(value: int, lang: str) -> CodeMeaning:
    """What S7 communication says of a whole job, a word, or of an item, a byte."""
    words, wide = explanations.words(lang), value > 0xFF
    kind, code = (S7_ERROR, f"0x{value:04X}") if wide else (S7_ITEM, f"0x{value:02X}")
    text, entry = _s7_text(value, lang), explanations.of_number(kind, value)
    unknown = words["unknown_s7" if wide else "unknown_error_text"]
    title = words[kind] if text else words[f"plain_{kind}"] + words["separator"] + unknown
    meaning = answer(
        kind, code, f"{explanations.kind_word(S7_ERROR)} {code}",
        title.format(code=code, decimal=value, text=text, high=f"{value >> 8:02X}"), bool(text),
        entry if entry and text else explanations.of_unknown(), lang,
        rank="s7_class" if wide and value not in s7.codes("error") else kind, filter_name=kind,
        values={"code": code.lower(), "high": f"{value >> 8:02X}", "low": f"{value & 0xFF:02X}"},
    )  # fmt: skip
    if wide and any(each.known for each in _word(value, "status", lang)):
        return replace(meaning, look=words["s7_or_status"])
    return meaning


def _s7_text(value: int, lang: str) -> str:
    """The words for it; of an error word that no table has those of its class, as reports say it; else empty."""
    row = s7.codes("return_code" if value <= 0xFF else "error").get(value)
    of_class = s7.codes("error_class").get(value >> 8) if value > 0xFF and row is None else None
    if of_class is not None:
        word = explanations.words(lang)["s7_class"]
        return word.format(code=f"{value >> 8:02X}", text=of_class.text(lang))
    return row.text(lang) if row else ""


_NOBODY = -1
"""No vendor's id: the text of the profile, or that of any manufacturer's number."""


def _error(
    value: int,
    text: str,
    maker: str | None,
    lang: str,
    whose: Maker | None,
    whole_range: bool = False,
) -> CodeMeaning:
    """An error number in the table of a maker, or of the profile; `whose` the device is, if that is known."""
    words = explanations.words(lang)
    code = spec.error_hex(value)
    entry = explanations.of_error(value, maker)
    if maker is None:
        title = words["error"].format(code=code, decimal=value, text=text)
        rank = "error"
    else:
        title = words["vendor_error"].format(code=code, decimal=value, text=text, vendor=maker)
        rank = "vendor_range" if whole_range else "vendor_error"
    info = words[f"info_{spec.error_info_meaning(value)}"] if maker is None else ""
    parts = (CodePart("", "", info),) if info else ()
    known = not entry.reserved and (maker is not None or value in spec.errors())
    alone = f"{explanations.kind_word('error')} {code}" + (f" --vendor {maker}" if maker else "")
    meaning = answer(
        "error", code, alone, title, known, entry, lang, rank=rank, parts=parts,
        view="in_response", filter_name="error", values={"value": code.lower()}, vendor=maker,
    )  # fmt: skip
    if whose is None or not entry.general:
        return meaning
    return replace(
        meaning, look=words["look_in_manual"].format(code=code, maker=called(whose, lang))
    )


# Numbers of a drive


def _parameter(number: int, lang: str) -> CodeMeaning:
    """A parameter by its number: name, type, unit, and on which drives it has them."""
    words, known = explanations.words(lang), spec.of_families(number)
    makers = {row.family for row in known}
    code = spelling(number, spec.MICROMASTER if makers == {spec.MICROMASTER} else None)
    entry = explanations.of_number(forms.PARAMETER, number)
    assert entry is not None
    values = {"code": code, "hex": f"{number:04X}", "value": str(number)}
    if not known:
        plain = words["plain_parameter"].format_map(values)
        title = f"{plain}{words['separator']}{words['unknown_parameter']}"
    else:
        text = words["part_separator"].join(_listed(row, lang) for row in known)
        title = words["parameter"].format_map(values | {"text": text})
    return answer(
        forms.PARAMETER, code, f"{explanations.kind_word(forms.PARAMETER)} {number}", title, bool(known), entry,
        lang, rank=forms.PARAMETER, filter_name=entry.filter, values=values, parts=_values(known, lang),
        advice=None if known else words["parameter_advice"].format_map(values),
    )  # fmt: skip


_SOURCES = {"bit": ("r0722.2", 0x02D2FC02), "index": ("r2050[1]", 0x0802FC01)}
"""A signal of each kind, and the value of a connection that takes it (docs/protocol.md D.2)."""


def _values(rows: list[spec.Pnu], lang: str) -> tuple[CodePart, ...]:
    """What values of a parameter mean, on the drives of which that is known; how one that connects is read."""
    words = explanations.words(lang)
    connects = next((row.connects for row in rows if row.connects is not None), None)
    if connects is not None:
        source, value = _SOURCES[connects]
        example = words["connection_example"].format(value=f"16#{value:08X}")
        return (
            CodePart("U32", "=", words[f"connection_{connects}"]),
            CodePart(example, "=", source),
        )
    texts = next(
        (row.values_zh if lang == "zh" else row.values_en for row in rows if row.values_en), {}
    )
    return tuple(CodePart(str(value), "=", text) for value, text in texts.items())


def _listed(row: spec.Pnu, lang: str) -> str:
    """`Maximum speed, Float32, rpm (SINAMICS)`."""
    words, name = explanations.words(lang), row.name_zh if lang == "zh" else row.name_en
    kind = None if row.type == "unknown" else row.type
    family = words["bracket"].format(text=words[f"family_{row.family}"])
    return words["list_separator"].join(filter(None, (name, kind, row.unit))) + family


# Rules


def _rule(number: int, lang: str) -> CodeMeaning:
    words = explanations.words(lang)
    code = f"DS{number:03d}"
    rule = spec.rules().get(code)
    if rule is None:
        digit = code[2]
        family = explanations.family(digit, lang) or words["no_family"]
        plain = words["plain_rule"].format(code=code)
        text = words["unknown_rule"].format(digit=digit, family=family)
        return answer(
            "rule", code, code, f"{plain}{words['separator']}{text}", False,
            explanations.of_unknown(), lang, rank="error_code", view="rule",
        )  # fmt: skip
    chinese = lang == "zh"
    message = rule.message_zh if chinese else rule.message
    if "{" in message:  # without a case its sentence has nothing to name
        message = rule.title_zh if chinese else rule.title
    title = words["rule"].format(
        code=code, name=rule.name, severity=words[f"{rule.severity}_severity"], text=message
    )
    kind = "rule_of_analyzer" if rule.analyzer_only else "rule"
    entry = explanations.of_number(kind, number) or explanations.of_unknown()
    cause = explanations.CodeCause(rule.cause, rule.cause_zh, "usual")
    return answer(
        "rule", code, code, title, True, entry, lang, rank="index", causes=(cause,),
        parts=tuple(CodePart(version, "", words["changed"]) for version in rule.changed),
        advice=rule.advice_zh if chinese else rule.advice,
        filter_name=entry.filter, values={"name": code},
    )  # fmt: skip


_OF_ONE_MEANING: Mapping[str, Callable[[int, str], CodeMeaning]] = {
    forms.PARAMETER: _parameter, forms.RULE: _rule, forms.TELEGRAM: cyclic.telegram,
    forms.FAULT: partial(messages.meaning, forms.FAULT), forms.ALARM: partial(messages.meaning, forms.ALARM),
}  # fmt: skip
"""What is said about a number that can only be one thing."""
