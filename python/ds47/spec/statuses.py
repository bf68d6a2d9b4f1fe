"""PNIOStatus in words: what `DE80B500` means (docs/protocol.md E.5, spec/status.toml)."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from ds47 import spec

_ACCESS, _PROTOCOL = 0x80, 0x81


def status_hex(status: int) -> str:
    """A status as engineers write it, ErrorCode first: `DE80B500`."""
    return f"{status:08X}"


@lru_cache(maxsize=1024)
def status_text(status: int, lang: str = "en") -> str:
    """A status in words: `read: access: state conflict`.

    Args:
        status: 32 bits, ErrorCode in the highest byte, for either byte order on the wire.
        lang: "en" or "zh"; anything else gives English.
    """
    words = spec.status(lang)
    if status == 0:
        return words.words["ok"]
    code, decode, first, second = (status >> shift & 0xFF for shift in (24, 16, 8, 0))
    parts = [_name(words.code, code, words.words)]
    if decode == _ACCESS:
        parts.append(_name(words.access, first, words.words))
        detail = "user"
    elif decode == _PROTOCOL:
        parts += [words.decode[decode], _name(words.protocol, first, words.words)]
        detail = "detail"
    else:
        parts += [_name(words.decode, decode, words.words), f"0x{first:02X}"]
        detail = "detail"
    if second:
        parts.append(words.words[detail].format(value=second))
    return words.words["separator"].join(parts)


def _name(table: Mapping[int, str], value: int, words: Mapping[str, str]) -> str:
    return table.get(value) or words["unknown"].format(value=value)
