"""What classes of plain data share. This module is below all rooms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar


class Plain:
    """Instances can be compared, shown, copied, and sent to another process.

    All classes share these methods: `dataclass` would write them for each class, which takes longer than to read
    a small capture. Only compiled modules (RECORD_PATH in hatch_build.py) may use this class: an uncompiled
    class cannot inherit from a compiled one.
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
        """A line for a person if `SHOWN` has one, else all fields."""
        return SHOWN.get(type(self), fields)(self)

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return type(self), tuple(getattr(self, name) for name in self.__dataclass_fields__)

    __dataclass_fields__: ClassVar[dict[str, Any]]


def fields(item: Plain) -> str:
    """A class and its fields, as `dataclass` shows them."""
    values = [f"{name}={getattr(item, name)!r}" for name in item.__dataclass_fields__]
    return f"{type(item).__name__}({', '.join(values)})"


SHOWN: dict[type, Callable[[Any], str]] = {}
"""Class -> what shows it in a line. `ds47.report.shown` adds to it, because the words are in a room above."""
