"""What `with` closes: captures, series of them, and what writes them. Nothing else lives here."""

from __future__ import annotations

from typing import Self


class Closing:
    """A context manager that closes itself at the end, whatever happened."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close what was opened."""
        raise NotImplementedError
