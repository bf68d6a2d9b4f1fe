"""A finding in the making: what a judge says of a transaction, before rules are selected.

Used by every channel. spec/rules.toml lists the arguments of each rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from ds47.spec.plain import Plain


class AnyJob(Protocol):
    """The transaction in the making that a remark is about, on any channel."""

    order: int
    """Its number among all transactions, in the order of their first frames."""

    @property
    def over(self) -> bool:
        """Whether its transaction was handed out."""

    @property
    def device(self) -> str:
        """IP address of the device."""


class Subject(Protocol):
    """The drive that a remark is about."""

    @property
    def is_foreign(self) -> bool:
        """Whether its maker is not the one whose tables the rule reads."""


Corrected = bytes | Callable[[], bytes | None] | None


@dataclass(slots=True, repr=False, eq=False)
class Remark(Plain):
    """A finding in the making: the rule, its frame, and its arguments as in spec/rules.toml."""

    rule: str
    frame: int
    args: dict[str, Any] = field(default_factory=dict)
    offset: int | None = None
    job: AnyJob | None = None
    corrected: Corrected = None
    """For a diagnosis: the corrected request, or a function that gives it at the end of the capture."""
    time_ns: int | None = None
    """Time of its frame, if known when it was made."""
    withdrawn: bool = False
    """Whether a later frame has disproved it."""
    of: Subject | None = None
    """The drive, if its maker decides the severity."""
