"""Bytes beside what they mean: the layout of `ds47 decode`."""

from __future__ import annotations

from collections.abc import Iterator

BYTES_PER_LINE = 8


def dump(data: bytes, start: int, end: int, meaning: str) -> Iterator[str]:
    """Lines with offset, bytes and, beside the first, what they mean."""
    width = BYTES_PER_LINE * 3 - 1
    for at in range(start, max(end, start + 1), BYTES_PER_LINE):
        part = data[at : min(end, at + BYTES_PER_LINE)].hex(" ")
        yield f"{at:>6}  {part:<{width}}  {meaning if at == start else ''}".rstrip()
