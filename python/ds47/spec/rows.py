"""What a row of a table is, whatever its columns."""

from __future__ import annotations

from typing import Any, Self


class Row:
    """A row of a table: a subclass annotates its columns, with a default where one may be missing.

    Nobody changes a row. It is no dataclass and no named tuple, because to define twenty of these takes
    longer than to read the tables.

    Raises TypeError where there is no such column.
    """

    def __init__(self, **columns: Any) -> None:
        if not columns.keys() <= type(self).__annotations__.keys():
            unknown = ", ".join(sorted(columns.keys() - type(self).__annotations__.keys()))
            raise TypeError(f"{type(self).__name__} has no column {unknown}")
        vars(self).update(columns)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{name} of a {type(self).__name__} stays as it is")

    def __repr__(self) -> str:
        values = [f"{name}={value!r}" for name, value in self.columns().items()]
        return f"{type(self).__name__}({', '.join(values)})"

    def text(self, lang: str = "en") -> str:
        """The words of a row that has `en` and `zh`."""
        words: str = getattr(self, "zh" if lang == "zh" else "en")
        return words

    def columns(self) -> dict[str, Any]:
        """All columns, in their order."""
        return {name: getattr(self, name) for name in type(self).__annotations__}

    def but(self, **columns: Any) -> Self:
        """The same row with other values."""
        return type(self)(**{**vars(self), **columns})
