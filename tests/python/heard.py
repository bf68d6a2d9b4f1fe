"""A plugin of pytest: writes down what tests tell `Judge` and `DriveObjects`, and what these say.

    DS47_HEARD=FILE python -m pytest -p heard test_judge.py        one JSON object a line goes to FILE

What is written is what `tests/lua/judge.lua` takes. Of calls within calls only the outermost is there.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ds47.acyclic.judge
import ds47.profidrive.drive_objects
import ds47.profidrive.parameter
from ds47.acyclic.judge import Judge
from ds47.acyclic.pairing import Job
from ds47.findings.remark import Remark
from ds47.model import Transaction
from ds47.profidrive.drive_objects import DriveObjects
from ds47.profinet.records import Half
from ds47.spec.semantics import Limits

_PLAIN = ("phase", "write_refused", "previous_reference", "previous", "superseded_by", "reason",
          "repeats", "limit", "contested")  # fmt: skip
_lines: list[dict[str, Any]] = []
_numbers: dict[int, tuple[int, object]] = {}
_depth = [0]
_waits: list[bool] = []
"""What the call that runs was told of record calls that wait."""


def _number(item: object) -> int:
    """Which judge, which memory of drive objects, which job; kept, so that no other has its address."""
    return _numbers.setdefault(id(item), (len(_numbers) + 1, item))[0]


def _half(half: Half | None) -> dict[str, Any] | None:
    if half is None:
        return None
    names = ("frame", "time_ns", "missing", "cut", "status")
    return {name: getattr(half, name) for name in names} | {"data": half.data.hex()}


def _job(job: Job) -> dict[str, Any]:
    record = job.record
    return {name: getattr(job, name) for name in _PLAIN} | {
        "id": _number(job),
        "peer": job.peer._asdict(),
        "record": {
            name: getattr(record, name) for name in ("implicit", "api", "slot", "subslot", "index")
        },
        "request": _half(record.request),
        "asked": job.message is not None,
        "answered": job.response is not None,
        "write_response": _half(job.write_response),
        "read_request": _half(job.read_request),
        "read_response": _half(job.read_response),
        "polls": [{"request": _half(one), "response": _half(two)} for one, two in job.polls],
        "empty_reads": [_half(each) for each in job.empty_reads],
        "uncertain": not job.certain,
        "missing": job.missing and job.missing._asdict(),
    }


def _transaction(item: Transaction) -> dict[str, Any]:
    names = ("device", "index", "slot", "subslot", "axis", "state", "operation")
    parameters = [
        {
            "pnu": each.pnu,
            "subindex": each.subindex,
            "attribute": each.attribute,
            "values": each.values,
            "error": None if each.error is None else {"code": each.error.code},
        }
        for each in item.parameters
    ]
    return {name: getattr(item, name) for name in names} | {"parameters": parameters}


def _shown(value: Any) -> Any:
    """What Lua takes for it; remarks without the corrected request, which test_lua_analysis.py compares."""
    if isinstance(value, Job):
        return _job(value)
    if isinstance(value, Transaction):
        return _transaction(value)
    if isinstance(value, Remark):
        return {
            "rule": value.rule,
            "frame": value.frame,
            "args": {name: each for name, each in value.args.items() if each is not None},
            "offset": value.offset,
            "job": None if value.job is None else _number(value.job),
        }
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return value._asdict()
    if isinstance(value, (list, tuple)):
        return [_shown(each) for each in value]
    return value


def _listen(owner: Any, name: str, said: bool) -> None:
    """Puts a function in the place of another; `said`: what it gives is compared."""
    old: Callable[..., Any] = getattr(owner, name)

    def new(*given: Any, **named: Any) -> Any:
        outer = _depth[0] == 0
        line: dict[str, Any] = {"call": name}
        if outer:
            own = isinstance(owner, type)
            line["of"] = _number(given[0]) if own else None
            line["args"] = _shown([*(given[1:] if own else given), *named.values()])
        _depth[0] += 1
        try:
            result = old(*given, **named)
        finally:
            _depth[0] -= 1
        if outer:
            if said:
                line["gives"] = _shown(result)
            line["waits"] = _waits.copy()
            _waits.clear()
            _lines.append(line)
        return result

    setattr(owner, name, new)


def _heard(unseen: Callable[..., bool]) -> Callable[..., bool]:
    def new(*what: object) -> bool:
        _waits.append(unseen(*what))
        return _waits[-1]

    return new


def _listen_to_new(owner: type, call: str) -> None:
    old = owner.__init__

    def new(self: Any, *given: Any) -> None:
        old(self, *(_heard(each) if callable(each) else each for each in given))
        if _depth[0] == 0:
            plain = [each for each in given if not callable(each)]
            args = [each.columns() if isinstance(each, Limits) else each for each in plain]
            _lines.append({"call": call, "of": _number(self), "args": args})

    owner.__init__ = new  # type: ignore[misc]


def pytest_configure() -> None:
    _listen_to_new(Judge, "judge")
    _listen_to_new(DriveObjects, "objects")
    for name in ("asked", "refused", "connected"):
        _listen(Judge, name, said=False)
    for name in ("answered", "unanswered", "closed"):
        _listen(Judge, name, said=True)
    for name in ("transaction", "refused", "identified"):
        _listen(DriveObjects, name, said=False)
    for name in ("number", "exists", "same", "other"):
        _listen(DriveObjects, name, said=True)
    for name in ("is_mismatch", "drive_time_ns"):
        _listen(ds47.acyclic.judge, name, said=True)
    _listen(ds47.profidrive.parameter, "family_fits", said=True)


def pytest_unconfigure() -> None:
    with Path(os.environ["DS47_HEARD"]).open("w", encoding="utf-8") as stream:
        stream.writelines(json.dumps(each) + "\n" for each in _lines)
