"""The rows of a sheet of a workbook (XLSX), by openpyxl.

A damaged workbook can raise anything in the library: here it becomes one line. One that unpacks to far more than
a list of parameters has is refused before it is unpacked.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from ds47 import spec

_MOST: Final = 512 << 20
"""Bytes of all parts of a workbook, unpacked."""
_PACKED: Final = 200
"""Tables are packed to a twentieth or so."""
_SMALL: Final = 32 << 20
"""So many bytes may be packed as well as they can be."""
_ADVICE: Final = "open it in a spreadsheet and save it again, or as CSV"


class WorkbookError(Exception):
    """A workbook that cannot be read: one line with what to do."""


def rows(path: Path, name: str | None) -> Iterator[list[str]]:
    """The cells of each row as texts.

    Args:
        path: the workbook.
        name: of the sheet; None takes the first one.

    Raises:
        OSError, WorkbookError: it cannot be read.
    """
    try:
        import openpyxl
    except ImportError as problem:
        raise WorkbookError(
            f"a workbook needs openpyxl: {spec.extras.install('xlsx')}"
        ) from problem
    try:
        _check_size(path)
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        sheets = {each.title: each for each in book.worksheets}
        if not sheets:
            raise WorkbookError("the workbook has no sheet")
        if name is not None and name not in sheets:
            raise WorkbookError(f"no sheet {name!r}; there are: {', '.join(sheets)}")
        sheet = next(iter(sheets.values())) if name is None else sheets[name]
        for row in sheet.iter_rows(values_only=True):
            yield ["" if cell is None else str(cell) for cell in row]
    except (OSError, WorkbookError):
        raise
    except Exception as problem:
        what = " ".join(f"{type(problem).__name__}: {problem}".split())[:120]
        raise WorkbookError(f"the workbook is damaged ({what}): {_ADVICE}") from problem


def _check_size(path: Path) -> None:
    import zipfile  # few lists are workbooks

    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(part.file_size for part in archive.infolist())
    except zipfile.BadZipFile as problem:
        raise WorkbookError(
            f"no workbook of Excel 2007 or later, or cut off: {_ADVICE}"
        ) from problem
    packed = path.stat().st_size
    if size > _MOST or (size > _SMALL and size > _PACKED * packed):
        raise WorkbookError(
            f"the workbook unpacks from {packed:,} to {size:,} bytes, more than any list of parameters "
            f"has: {_ADVICE}"
        )
