"""Frames in the lines of debug logs, among words (docs/profibus.md 5).

    12:00:00,250 DEBUG PHY-serial: TX   10 03 02 49 4E 16           pyprofibus, with a logger's words or without
    [...] PHY RX DataTelegram { h: DataTelegramHeader { da: 2, ...  profirust, which prints no bytes
    DPM1: Trying to initialize slave 3...                           no frame, and nothing lost

A frame with the right check byte counts wherever it stands. Other bytes count at the end of a line, behind a word
for a direction or a colon.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import dropwhile, groupby
from typing import Final, NamedTuple

from ds47.profibus.stream import split
from ds47.profibus.telegram import Telegram, decode, encode
from ds47.spec import profibus

_TOKEN: Final = re.compile(r"->|<-|=>|<=|[^\s=,;:\[\](){}<>|\"'-]+")
_BYTES: Final = re.compile(r"(?:0x)?((?:[0-9A-Fa-f]{2})+)h?")
_LONGEST: Final = 4096
"""Characters of a line with a frame among words; the longest frame has 255 bytes."""
_WORDS: Final = 2
"""Words in front of bytes that may say the direction: `RX (fragment)`."""
_SEVERAL: Final = 3
"""Bytes that are a damaged frame rather than a number."""
_TELEGRAM: Final = re.compile(
    r"DataTelegram \{ h: DataTelegramHeader \{ da: (?P<da>\d{1,3}), sa: (?P<sa>\d{1,3}),"
    r" dsap: (?:None|Some\((?P<dsap>\d{1,3})\)), ssap: (?:None|Some\((?P<ssap>\d{1,3})\)),"
    r" fc: (?:Request \{ fcb: (?P<fcb>\w+), req: (?P<req>\w+) \}"
    r"|Response \{ state: (?P<state>\w+), status: (?P<status>\w+) \}) \}, pdu: \[(?P<pdu>[\d, ]*)\] \}"
)
_TOKEN_PASS: Final = re.compile(r"TokenTelegram \{ da: (\d{1,3}), sa: (\d{1,3}) \}")
_CONFIRMATION: Final = re.compile(r"\bShortConfirmation\b(?! \{)")
_REQUEST: Final = 0x40


class Found(NamedTuple):
    """What a line says."""

    word: str | None
    """That in front of the bytes, if it is one for a direction."""
    telegrams: list[Telegram]


class _Word(NamedTuple):
    text: str
    start: int
    end: int
    data: bytes | None
    """The bytes that it is."""


def find(line: str) -> Found | None:
    """The frames of a line; None where it has none."""
    if len(line) > _LONGEST:
        return None
    if (item := _printed(line)) is not None:
        word = next((each for each in _TOKEN.findall(line) if _says_direction(each)), None)
        return Found(word, [item])
    words = list(_words(line))
    at = 0
    for is_data, group in groupby(words, key=lambda each: each.data is not None):
        run = list(group)
        if is_data:
            before = words[max(0, at - _WORDS) : at]
            found = [piece.telegram for piece in split(b"".join(each.data or b"" for each in run))]
            word = next((each.text for each in before if _says_direction(each.text)), None)
            last = at + len(run) == len(words)
            colon = bool(before) and ":" in line[before[-1].end : run[0].start]
            if any(
                each.proved for each in found
            ):  # without a word for it, a number in front is none of its bytes
                return Found(
                    word, found if word else list(dropwhile(lambda each: each.flaws, found))
                )
            if last and _counts(found, word, colon):
                return Found(word, found)
        at += len(run)
    return None


def damaged(line: str) -> bool:
    """Whether a line without frames looks as if it had one: bytes, and something among them that is none."""
    if len(line) > _LONGEST:
        return True
    words = list(_words(line))
    tail = 0
    while tail < len(words) and (
        words[-1 - tail].data is not None or _like_byte(words[-1 - tail].text)
    ):
        tail += 1
    good = sum(each.data is not None for each in words[len(words) - tail :])
    least = 2 if tail == len(words) else _SEVERAL + 1
    if least <= tail <= 2 * good and good < tail:
        return True
    long = words[-1].text if words else ""
    digits = sum(each in "0123456789abcdefABCDEF" for each in long)
    return (
        len(long) >= 2 * _SEVERAL
        and any(map(str.isdigit, long))
        and len(long) > digits >= 0.75 * len(long)
    )


def _words(line: str) -> Iterator[_Word]:
    for found in _TOKEN.finditer(line):
        number = _BYTES.fullmatch(found[0])
        data = None if number is None else bytes.fromhex(number[1])
        yield _Word(found[0], found.start(), found.end(), data)


def _like_byte(text: str) -> bool:
    return len(text) == 2 and not _says_direction(text)


def _says_direction(text: str) -> bool:
    names = profibus.listing()
    return text.lower() in names.to_slave or text.lower() in names.to_master


def _counts(found: list[Telegram], word: str | None, colon: bool) -> bool:
    """Whether bytes that no check byte proves are more than numbers of a text."""
    if not any(each.flaws for each in found):
        return colon or word is not None
    return word is not None and sum(len(each.data) for each in found) >= _SEVERAL


def _printed(line: str) -> Telegram | None:
    """The frame that profirust prints as the fields of its structs."""
    try:
        if found := _TELEGRAM.search(line):
            return decode(_encoded(found))
        if found := _TOKEN_PASS.search(line):
            return decode(bytes((0xDC, int(found[1]), int(found[2]))))
    except (KeyError, ValueError):  # a name or a number that no frame has
        return None
    return decode(b"\xe5") if _CONFIRMATION.search(line) else None


def _encoded(found: re.Match[str]) -> bytes:
    names = profibus.printed()
    if found["req"]:
        code = _REQUEST | names.count[found["fcb"]] | names.request[found["req"]]
    else:
        code = names.state[found["state"]] | names.status[found["status"]]
    saps = [None if found[each] is None else int(found[each]) for each in ("dsap", "ssap")]
    data = bytes(int(each) for each in found["pdu"].replace(",", " ").split())
    return encode(int(found["da"]), int(found["sa"]), code, data, *saps)
