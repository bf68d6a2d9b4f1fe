"""What classes of plain data have in common, in whatever room they are; it is below all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar


class Plain:
    """Instances can be compared, shown, copied, sent to another process.

    One method for all instead of one that `dataclass` writes for each: writing them takes longer than a
    small capture, and nobody compares two transactions in a hurry. Only for modules that are compiled, too
    (RECORD_PATH in hatch_build.py): what is not compiled cannot inherit from what is.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(
            getattr(self, name) == getattr(other, name) for name in self.__dataclass_fields__
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """A line for a person where some room has words for it, else all fields."""
        return SHOWN.get(type(self), fields)(self)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return type(self), tuple(getattr(self, name) for name in self.__dataclass_fields__)

    __dataclass_fields__: ClassVar[dict[str, Any]]


def fields(item: Plain) -> str:
    """A class and its fields, as `dataclass` shows them."""
    values = [f"{name}={getattr(item, name)!r}" for name in item.__dataclass_fields__]
    return f"{type(item).__name__}({', '.join(values)})"


SHOWN: dict[type, Callable[[Any], str]] = {}
"""What shows a class in a line: `ds47.report.shown` adds those that need words, which are in no room below."""
