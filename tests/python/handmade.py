"""A result made by hand, for the tests of the report formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ds47.model import Diagnosis, Finding, Frames, Transaction


def transaction(**changes: Any) -> Transaction:
    """A read of one drive that was answered, with the attributes that a test wants otherwise."""
    item = Transaction(
        operation="read",
        state="ok",
        controller="192.168.133.2",
        device="192.168.133.33",
        ar=None,
        api=0,
        slot=1,
        subslot=1,
        index=47,
        request_reference=3,
        axis=2,
        frames=Frames(1, 2, 3, 4),
        start_ns=1_767_225_600_000_000_001,
        duration_ns=12_400_000,
        request=None,
        response=None,
        write_status=0,
        read_status=0,
        parameters=[],
        id=1,
    )
    for key, value in changes.items():
        setattr(item, key, value)
    return item


def finding(
    rule: str,
    severity: str,
    said: str,
    frame: int,
    transaction: int | None = None,
    offset: int | None = None,
    **args: Any,
) -> Finding:
    """A finding that says these words, as one of an older result does."""
    return Finding(rule, severity, frame, [frame], transaction, offset, args, said)


def diagnosis(
    rule: str,
    severity: str,
    said: str,
    device: str | None = None,
    count: int = 0,
    frames: Sequence[int] = (),
    transactions: Sequence[int] = (),
    **args: Any,
) -> Diagnosis:
    """A diagnosis that says these words."""
    return Diagnosis(
        rule, severity, args, device, count, list(frames), list(transactions), said=said
    )
