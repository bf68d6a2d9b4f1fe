"""The forms in which people write codes: a text such as `DE80B500` or `16#44` to the numbers it may stand for."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass

from ds47 import spec
from ds47.spec import cyclic, explanations, s7

BYTE, WORD, STATUS, RULE, FORMAT = "byte", "word", "status", "rule", "format"
PARAMETER, FAULT, ALARM, TELEGRAM = "parameter", "fault", "alarm", "telegram"
MESSAGES = {"F": FAULT, "A": ALARM}
"""The letters in front of the numbers of faults and alarms."""
NUMBER = "number"
"""A decimal number of eight digits: a status is hexadecimal then, but libraries print their errors so."""
PKW = "pkw"
"""The kind of the first word of PKW."""

_PREFIX = re.compile(r"(?:[BWD]{1,2}#)?16#|0X|&H|\$")
_DECIMAL_PREFIX = re.compile(r"10#")
_BINARY_PREFIX = re.compile(r"(?:W#)?2#|0B")
_PAIRS = re.compile(r"[0-9A-F]{2}(?:[ :,\-][0-9A-F]{2})+")
_HEX = re.compile(r"[0-9A-F]+")
_RULE = re.compile(r"DS([0-9]{3})")
_STATUS_DIGITS = 8
_NUMBER = r"[:=, ]*(0X[0-9A-F]{1,2}|[0-9]{1,3})\b"
_CLASS_AND_CODE = re.compile(
    rf"(?:.* )?ERR(?:OR)?[_ ]CL(?:AS)?S{_NUMBER}.*?ERR(?:OR)?[_ ]CODE{_NUMBER}.*"
)
"""As libraries of S7 and stacks of PROFINET log: `Error class: 133, error code: 0`, `err_cls 253 err_code 5`."""
_PAIRED = re.compile(r"(?:.* )?0X([0-9A-F]{1,2}) ?/ ?0X([0-9A-F]{1,2})\b.*")
"""The same as libraries of S7 print it: `S7 protocol error 0x81/0x04`."""
_SAID = r"\W+(?:[A-Z][A-Z_ -]*\()?(0X[0-9A-F]{1,2}|[0-9]{1,3})\b"
_FOUR = re.compile(
    r"(?:.*\W)?ERROR[_ ]?CODE"
    + r".*?ERROR[_ ]?".join(
        (_SAID, *(f"{name}{_SAID}" for name in ("DECODE", "CODE[_ ]?1", "CODE[_ ]?2")))
    )
    + ".*"
)
"""A status by the names of its bytes: `error_code=219 error_decode=129 ...`, `ErrorCode = RTA-ERR (0xCF)`."""
_BYTES = re.compile(
    r"(?:.*\W)?" + r"(?:, ?|(?<=0X..) (?=0X))".join(["(0X[0-9A-F]{1,2}|[0-9]{1,3})"] * 4) + r"\W*"
)
"""The same without them: `ERROR: 219, 129, 61, 0`, `(0xCF 0x81 0xFD 0x05)`."""
_RTA, _ABORTED = 0xFD, 0xCF810000
"""The class of errors of the protocol of alarms (RTA), and the bytes in front of it in a status."""
_EVENT = re.compile(r"^16# ?08:")
"""In front of the channel error type in an event id of an S7: `16#08:9005`."""
_PARAMETER = re.compile(r"(?:P|R|PNU) ?([0-9]{1,5})(?:\[[0-9]{1,5}\]|\.[0-9]{1,2})?")
_MESSAGE = re.compile(r"([FA])([0-9]{4,5})")
_BARE = re.compile(r"[1-9][0-9]{2,4}")
"""A number that may be that of a parameter; of two digits it is taken for an error number, a format, a byte."""
_WHOLE = re.compile(r"([0-9]{1,5})(\[[0-9]{1,5}\])?")


class UnknownFormError(ValueError):
    """The text has none of the forms in which codes are written."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One number that a text may stand for.

    `size`: a byte, a word, a status, a number of eight digits, or of what it is the number: rule, format,
    parameter, fault, alarm, telegram.
    `decimal`: it was read as a decimal number.
    """

    size: str
    value: int
    decimal: bool = False


@dataclass(frozen=True, slots=True)
class Code:
    """A text with all its readings; `kind` is what a word in front of it says, None without."""

    text: str
    kind: str | None
    readings: tuple[Reading, ...]


def read(text: str) -> Code:
    """Reads a code in any of the forms in which people write it.

    Raises:
        UnknownFormError: it has none of them.
    """
    plain = " ".join(unicodedata.normalize("NFKC", text).strip("\"'` \t\r\n").split())
    plain = _EVENT.sub("16#", plain)
    if logged := _in_parts(text, plain.upper()):
        return logged
    kind, digits = _split_kind(plain)
    code = digits.upper()
    if kind == PKW or kind in cyclic.bit_words():
        words = tuple(Reading(WORD, each) for each in word_values(digits))
        if not words:
            raise UnknownFormError(text)
        return Code(code, kind, words)
    if own := tuple(_drive_numbers(kind, code)):
        named = spec.format_named(digits) if kind is None else None
        return Code(code, kind, ((Reading(FORMAT, named.code),) if named else ()) + own)
    if rule := _RULE.fullmatch(code):
        return Code(code, kind or "rule", (Reading(RULE, int(rule[1])),))
    if code == "DS47":
        return Code(code, kind or "index", (Reading(BYTE, 47),))
    readings = tuple(dict.fromkeys(_numbers(code)))
    named = spec.format_named(digits)
    alone = kind is None and not readings and digits.lower() not in explanations.kinds()
    if named is not None and (kind == FORMAT or alone):  # C4 alone is a byte
        return Code(code, FORMAT, (Reading(FORMAT, named.code), *readings))
    if (
        kind is None
        and _BARE.fullmatch(code)
        and int(code) <= 0xFFFF
        and spec.of_families(int(code))
    ):
        readings += (Reading(PARAMETER, int(code), True),)
    if not readings:
        rule_id = spec.rule_prefix(digits)
        if rule_id is None or rule_id not in spec.rules():
            raise UnknownFormError(text)
        return Code(rule_id, kind or "rule", (Reading(RULE, int(rule_id[2:])),))
    return Code(code, kind, readings)


def _in_parts(text: str, line: str) -> Code | None:
    """A code whose bytes a log has apart: a status, or an error as class and code."""
    if four := _FOUR.fullmatch(line) or _BYTES.fullmatch(line):
        parts = [_byte(each) for each in four.groups()]
        if _is_status(*parts):
            return Code(text, "status", (Reading(STATUS, int.from_bytes(parts)),))
    if pair := _CLASS_AND_CODE.fullmatch(line):
        return _class_and_code(text, *map(_byte, pair.groups()))
    if pair := _PAIRED.fullmatch(line):
        return _class_and_code(text, *(int(each, 16) for each in pair.groups()))
    return None


def _byte(text: str) -> int:
    """A byte, decimal or with 0X in front."""
    return int(text, 16 if text.startswith("0X") else 10)


def _is_status(*parts: int) -> bool:
    """Whether four numbers are the bytes of a status."""
    words = spec.status("en")
    return max(parts) <= 0xFF and parts[0] in words.code and parts[1] in words.decode


def _class_and_code(text: str, error_class: int, code: int) -> Code:
    """An error as class and code: of the connection (RTA, 0 in older p-net), or of S7 communication."""
    value = error_class << 8 | code
    if error_class == _RTA or (error_class == 0 and code):
        return Code(text, "status", (Reading(STATUS, _ABORTED | _RTA << 8 | code),))
    if error_class == 0 or error_class not in s7.codes("error_class"):
        raise UnknownFormError(text)
    return Code(text, "s7_error", (Reading(WORD, value),))


def _drive_numbers(kind: str | None, code: str) -> Iterator[Reading]:
    """Numbers of parameters, faults, alarms and telegrams, as they are written: `R0945[0]`, `F07900`, `390`."""
    parameter = _PARAMETER.fullmatch(code) if kind in (None, PARAMETER) else None
    message = _MESSAGE.fullmatch(code)
    plain = _WHOLE.fullmatch(code) if kind in (PARAMETER, FAULT, ALARM, TELEGRAM) else None
    shown = _whole(_PREFIX.sub("", code, 1), 16) if kind in (FAULT, ALARM) else None
    if parameter:
        size, digits = PARAMETER, parameter[1]
    elif message and kind in (None, MESSAGES[message[1]]):
        size, digits = MESSAGES[message[1]], message[2]
    elif plain and (kind == PARAMETER or not plain[2]):
        size, digits = str(kind), plain[1]
    elif shown is not None:  # as a watch table has it
        size, digits = str(kind), str(shown)
    else:
        return
    if int(digits) <= 0xFFFF:
        yield Reading(size, int(digits), True)


def _split_kind(text: str) -> tuple[str | None, str]:
    """The kind that the words in front announce, and the rest; the longest wording counts."""
    lower = text.lower()
    for word in sorted(explanations.kinds(), key=len, reverse=True):
        rest = lower[len(word) :]
        joined = not word.isascii()  # Chinese needs no space behind a word
        if lower.startswith(word) and rest.strip() and (joined or rest[0] in " :="):
            return explanations.kinds()[word], text[len(word) :].lstrip(" :=")
    return None, text


def _numbers(code: str) -> Iterator[Reading]:
    if _PAIRS.fullmatch(code):
        yield from _hexadecimal(re.sub(r"[^0-9A-F]", "", code))
        return
    code = code.replace("_", "").replace(" ", "")
    if prefix := _DECIMAL_PREFIX.match(code):
        yield from _decimal(code[prefix.end() :])
    elif prefix := _PREFIX.match(code):
        yield from _hexadecimal(code[prefix.end() :])
    elif code.endswith("H") and _HEX.fullmatch(code[:-1]):
        yield from _hexadecimal(code[:-1])
    elif code.isascii() and code.isdigit():
        if len(code) <= _STATUS_DIGITS:
            yield from _hexadecimal(code)
        if code.startswith("0") and code != "0":
            return
        if len(code) == _STATUS_DIGITS:
            yield Reading(NUMBER, int(code), True)
        else:
            yield from _decimal(code)
    elif code.startswith("-"):
        yield from _decimal(code)
    else:
        yield from _hexadecimal(code)


def _hexadecimal(digits: str) -> Iterator[Reading]:
    """Two digits are a byte, four a word, up to eight a status (zeros in front may be missing)."""
    if not _HEX.fullmatch(digits) or len(digits) > _STATUS_DIGITS:
        return
    value = int(digits, 16)
    if len(digits) > 4:
        yield Reading(STATUS, value)
        if value == 0:
            return
    yield from _sized(value)


def word_values(text: str) -> list[int]:
    """The words of 16 bits that a text may stand for, the likeliest first; empty where it is none.

    `047F`, `16#047F`, `2#0100_0111_1111`, `-1231`, `1151`: as PLC tables print a control or a status word.
    """
    code = text.strip().upper().replace("_", "").replace(" ", "")
    found: list[int | None]
    if prefix := _PREFIX.match(code):
        found = [_whole(code[prefix.end() :], 16)]
    elif prefix := _BINARY_PREFIX.match(code):
        found = [_whole(code[prefix.end() :], 2)]
    elif re.fullmatch(r"-\d+", code):
        number = int(code)
        found = [number + 0x10000 if number >= -0x8000 else None]
    elif re.fullmatch(r"[0-9A-F]{1,4}H", code):
        found = [_whole(code[:-1], 16)]
    else:
        found = [_whole(code, 16) if len(code) <= 4 else None]
        if code.isascii() and code.isdigit() and (not code.startswith("0") or code == "0"):
            found.insert(0, int(code))
    return [each for each in dict.fromkeys(found) if each is not None and each <= 0xFFFF]


def numbers(text: str) -> list[tuple[int, bool]]:
    """The numbers that a text may stand for, and whether it was read as a decimal one."""
    return list(dict.fromkeys((each.value, each.decimal) for each in _numbers(text.upper())))


def _whole(digits: str, base: int) -> int | None:
    allowed = "0123456789ABCDEF"[:base]
    return int(digits, base) if digits and all(each in allowed for each in digits) else None


def _decimal(digits: str) -> Iterator[Reading]:
    """A signed number is what a PLC shows of a byte, word or double word with the top bit set."""
    if not re.fullmatch(r"-?[0-9]{1,10}", digits):
        return
    value = int(digits)
    if value < 0:
        bits = next((each for each in (8, 16, 32) if value >= -(1 << each - 1)), None)
        if bits is None:
            return
        value += 1 << bits
    if 0xFFFF < value <= 0xFFFFFFFF or value == 0:
        yield Reading(STATUS, value, True)
    yield from _sized(value, decimal=True)


def _sized(value: int, decimal: bool = False) -> Iterator[Reading]:
    if value <= 0xFF:
        yield Reading(BYTE, value, decimal)
    elif value <= 0xFFFF:
        yield Reading(WORD, value, decimal)
