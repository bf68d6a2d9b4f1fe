"""Bytes beside what they mean: the layout of `ds47 decode`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest

from ds47.cli.common import columns_of
from ds47.report.wrap import wrap

BYTES_PER_LINE = 8
_FRONT = 6 + 2 + 3 * BYTES_PER_LINE + 1
"""Columns before what the bytes mean."""


def dump(data: bytes, start: int, end: int, meaning: str) -> Iterator[str]:
    """Lines with offset and bytes, and beside them, from the first on, what they mean."""
    width = columns_of()
    parts = [meaning] if width is None else wrap(meaning, width - _FRONT, 2)
    for at, part in zip_longest(range(start, max(end, start + 1), BYTES_PER_LINE), parts):
        front = (
            "" if at is None else f"{at:>6}  {data[at : min(end, at + BYTES_PER_LINE)].hex(' ')}"
        )
        yield f"{front:<{_FRONT}}{part or ''}".rstrip()
