"""Tables of text: rows of cells side by side where the terminal has room, else a card for each row.

The reports know what stands in the cells, `ds47.report.wrap` how a line is broken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ds47.report import Paint
from ds47.report.wrap import columns, fitted, padded

_LEAST = 24
"""Columns for the last cell of a row at least, which is broken where it needs more."""
_NOTHING = ("", "-", "0")
"""Cells that a card leaves out."""

Row = Sequence[str]


def table(
    rows: Sequence[Row],
    width: int | None,
    head: Row = (),
    *,
    lead: Sequence[int] = (0,),
    right: bool = False,
    indent: int = 2,
    paint: Paint = lambda _, text: text,
) -> list[str]:
    """Lines of at most `width` columns; None: as wide as the cells are.

    Args:
        rows: what stands in the cells.
        width: columns of a line.
        head: the names of the columns, which stand in a card before each cell.
        lead: the cells in the first line of a card, by their numbers.
        right: whether all cells but the last end below each other.
        indent: blanks before each line.
        paint: colours the names.
    """
    if not rows:
        return []
    whole = [*([head] if head else []), *rows]
    *sizes, last = [max(map(columns, cells)) for cells in zip(*whole, strict=True)]
    room = last if width is None else width - indent - sum(sizes) - 2 * len(sizes)
    lines = []
    if room >= min(last, _LEAST):
        lines = [line for row in whole for line in _side_by_side(row, sizes, room, right, indent)]
    if width is not None and (not lines or max(map(columns, lines)) > width):
        return [line for row in rows for line in _card(row, width, head, lead, indent, paint)]
    return [paint("dim", lines[0]), *lines[1:]] if head else lines


def _side_by_side(
    row: Row, sizes: Sequence[int], room: int, right: bool, indent: int
) -> Iterator[str]:
    front = " " * indent
    for cell, size in zip(row, sizes, strict=False):
        front += (" " * (size - columns(cell)) + cell if right else padded(cell, size)) + "  "
    for part in fitted(row[-1], room, 0):
        yield (front + part).rstrip()
        front = " " * columns(front)


def _card(
    row: Row, width: int, head: Row, lead: Sequence[int], indent: int, paint: Paint
) -> Iterator[str]:
    first = [at % len(row) for at in lead]
    yield from fitted(" " * indent + "  ".join(row[at] for at in first if row[at]), width)
    names = head or [""] * len(row)
    others = [
        f"{paint('dim', name)} {cell}" if name and not cell.startswith(name) else cell
        for at, (name, cell) in enumerate(zip(names, row, strict=True))
        if cell not in _NOTHING and at not in first
    ]
    if others:
        yield from fitted(" " * (indent + 2) + "  ".join(others), width, 0)
