"""What lists of a user say of the parameters of a transaction: name and unit, where the drive says none itself."""

from __future__ import annotations

from ds47.model import Described, Parameter, Transaction
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import Row


def explain(
    item: Transaction, catalogue: Catalogue, vendor_id: int | None, device_id: int | None
) -> Transaction:
    """Gives the parameters of a transaction the names of lists; the transaction is the same one."""
    for each in item.parameters:
        entry = None if each.pnu is None else catalogue.row(each.pnu, vendor_id, device_id)
        if entry is not None:
            _name(each, entry.row)
    return item


def _name(item: Parameter, row: Row) -> None:
    said = item.described
    if said is None:
        item.unit = row.unit or item.unit
        item.described = Described(row.name, ())
    elif said.name is None:
        item.described = Described(row.name, said.frames)
