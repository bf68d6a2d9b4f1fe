"""A finding in the making: what a judge says of a transaction, before anybody asks whether it is wanted.

Used by every channel. What the arguments of a rule are is in spec/rules.toml.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from ds47.spec.plain import Plain


class AnyJob(Protocol):
    """The transaction in the making that a remark is about, of whatever channel."""

    order: int
    """Its number among all, by their beginnings."""

    @property
    def over(self) -> bool:
        """Whether its transaction was told."""
        ...

    @property
    def device(self) -> str:
        """IP address of the device."""
        ...


class Subject(Protocol):
    """Whose drive a remark is about."""

    @property
    def is_foreign(self) -> bool:
        """Whether it is none of the maker whose tables the rule reads."""
        ...


Corrected = bytes | Callable[[], bytes | None] | None


@dataclass(slots=True, repr=False, eq=False)
class Remark(Plain):
    """A finding in the making: the rule, where it shows, and what spec/rules.toml says that it carries."""

    rule: str
    frame: int
    args: dict[str, Any] = field(default_factory=dict)
    offset: int | None = None
    job: AnyJob | None = None
    corrected: Corrected = None
    """Of a diagnosis: the request as it should have been, or who knows it when the capture is over."""
    time_ns: int | None = None
    """Time of its frame, where that was known when it was made."""
    withdrawn: bool = False
    """Whether a later frame has shown that it is not so."""
    of: Subject | None = None
    """Whose drive it is, where that decides how serious it is."""
