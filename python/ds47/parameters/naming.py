"""What lists of a user say of parameters: name and unit, where the drive says none itself, and texts of values."""

from __future__ import annotations

from collections.abc import Mapping

from ds47.model import Described, Parameter, Transaction
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedParameter


def explain(
    item: Transaction, catalogue: Catalogue, vendor_id: int | None, device_id: int | None
) -> Transaction:
    """Gives the parameters of a transaction what lists say of them; the transaction is the same one."""
    for each in item.parameters:
        if each.pnu is None:
            continue
        entry = catalogue.row(each.pnu, vendor_id, device_id)
        if entry is not None:
            _name(each, entry.row)
        if each.attribute == "value":
            row = None if entry is None else entry.row
            each.value_texts = _texts(each, row, catalogue, vendor_id, device_id) or None
    return item


def _name(item: Parameter, row: ListedParameter) -> None:
    said = item.described
    if said is None:
        item.unit = row.unit or item.unit
        item.described = Described(row.name, ())
    elif said.name is None:
        item.described = Described(row.name, said.frames)


def _texts(
    item: Parameter,
    row: ListedParameter | None,
    catalogue: Catalogue,
    vendor_id: int | None,
    device_id: int | None,
) -> Mapping[int | None, str]:
    """Texts of the values of a parameter; of numbers of messages those of the messages."""
    found: dict[int | None, str] = {}
    letter = None if item.listed is None else item.listed.messages
    for value in item.values:
        if not isinstance(value, int) or isinstance(value, bool):
            continue
        if row is not None and value in row.values:
            found[value] = row.values[value]
        elif letter is not None and value:
            message = catalogue.message(value, letter, vendor_id, device_id)
            if message is not None:
                found[value] = f"{message.letter}{message.number:05} {message.text}"
    return found
