"""Lists of parameters as one file for the Wireshark plugin: lines of cells with tabs between them.

    ds47-parameters 1                               the first line
    list            VENDOR  DEVICE,DEVICE           begins a list: ids in decimal digits, nothing for any
    parameter       NUMBER  NAME  UNIT  VALUE  TEXT  VALUE  TEXT ...
    message         LETTER  NUMBER  TEXT

Lists that are made for a device most closely come first. lua/ds47/parameters/table.lua reads it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedParameter, ParameterList

HEAD: Final = "ds47-parameters\t1"
_ESCAPES: Final = str.maketrans({"\\": "\\\\", "\t": "\\t", "\n": "\\n", "\r": "\\r"})


def text(lists: Iterable[ParameterList]) -> str:
    """Lists as the text of such a file. `lists`: in the order in which they were named."""
    return "".join(f"{line}\n" for line in _lines(Catalogue(lists)))


def _lines(catalogue: Catalogue) -> Iterator[str]:
    yield HEAD
    for found in catalogue.lists:
        vendor = "" if found.vendor_id is None else str(found.vendor_id)
        yield "\t".join(("list", vendor, ",".join(map(str, found.device_ids))))
        yield from map(_parameter, {row.number: row for row in found.rows}.values())
        messages = {(each.letter, each.number): each for each in found.messages}
        for each in messages.values():
            yield "\t".join(("message", each.letter, f"{each.number:05}", _cell(each.text)))


def _parameter(row: ListedParameter) -> str:
    cells = ["parameter", str(row.number), _cell(row.name), _cell(row.unit or "")]
    for value, said in sorted(row.values.items()):
        cells += [str(value), _cell(said)]
    return "\t".join(cells)


def _cell(text_: str) -> str:
    return text_.translate(_ESCAPES)
