"""What `repr` shows of a result: a line that a person reads, in English.

    <ds47 transaction #3: read ok, 192.168.133.33 DO 2, p50304[0] = 60.0, frames 14 to 17, 12.3 ms>
    <ds47 finding DS417 warning, frame 17, #3: Parameter p50304[0] reads back 60.0, but ...>

The classes stand below the words: `switch_on` brings the two together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ds47.model import Diagnosis, Finding, Parameter, ParameterError, Transaction
from ds47.report.escaping import escape
from ds47.report.formatting import duration, error, parameter
from ds47.report.sentences import at_offset, sentence
from ds47.spec import rules
from ds47.spec.plain import SHOWN, fields

_MOST: Final = 3
"""Parameters, or items of S7, that a line has."""


def transaction(item: Transaction) -> str:
    """What was asked, whom, what came of it, and where that is."""
    where = "" if item.axis is None else f" axis {item.axis}"
    if item.drive_object is not None:
        where = f" DO {item.drive_object}"
    written = item.operation == "change"
    what = [parameter(each, written) for each in item.parameters[:_MOST]]
    what += [escape(each.address or "?") for each in item.items[:_MOST]]
    more = len(item.parameters) + len(item.items) - len(what)
    parts = [
        f"{item.operation} {item.state}",
        escape(item.device) + where,
        *what,
        *([f"{more} more"] if more else []),
        _frames(item.frames.all()),
    ]
    if item.duration_ns is not None:
        parts.append(duration(item.duration_ns))
    return f"<ds47 transaction #{item.id}: {', '.join(parts)}>"


def finding(item: Finding) -> str:
    """Its rule, where it shows, and its sentence."""
    of = [] if item.transaction is None else [f"#{item.transaction}"]
    return _said("finding", item, item.offset, [f"frame {item.frame}", *of])


def diagnosis(item: Diagnosis) -> str:
    """Its rule, where it shows, and its sentence."""
    return _said("diagnosis", item, None, [_frames(item.frames)])


def _said(kind: str, item: Finding | Diagnosis, offset: int | None, where: list[str]) -> str:
    if item.rule not in rules():
        return fields(item)
    text = escape(at_offset(offset, sentence(item)))
    return f"<ds47 {kind} {', '.join([f'{item.rule} {item.severity}', *where])}: {text}>"


def _frames(numbers: Sequence[int]) -> str:
    """`frame 3`, `frames 3 to 9`."""
    if len(numbers) < 2:
        return f"frame {numbers[0]}" if numbers else "no frame"
    return f"frames {numbers[0]} to {numbers[-1]}"


def _written(item: Parameter) -> str:
    return f"<ds47 parameter {parameter(item, written=False)}>"


def _error(item: ParameterError) -> str:
    return f"<ds47 {error(item)}>"


def switch_on() -> None:
    """From now on `repr` shows these lines."""
    SHOWN.update(
        {
            Transaction: transaction,
            Finding: finding,
            Diagnosis: diagnosis,
            Parameter: _written,
            ParameterError: _error,
        }
    )
