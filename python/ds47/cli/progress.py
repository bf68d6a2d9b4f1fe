"""How far a run over many captures is: captures, bytes, rate and time left, on stderr of a terminal.

The bar is that of click. Here is what it counts; warnings go around it.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import click

from ds47.cli.common import warn

_UNITS = ("B", "kB", "MB", "GB", "TB")


class Progress:
    """A context manager; without `shown` it only passes warnings on."""

    def __init__(self, captures: int, size: int, *, shown: bool) -> None:
        self._captures = captures
        self._size = size
        self._done = 0
        self._bytes = 0
        self._begin = time.monotonic()
        self._bar: Any = None
        if shown:
            self._bar = click.progressbar(
                length=max(1, size), file=sys.stderr, width=0, show_percent=True,
                item_show_func=self._words, update_min_steps=1,
            )  # fmt: skip

    def __enter__(self) -> Progress:
        if self._bar is not None:
            self._bar.__enter__()
        return self

    def __exit__(self, *problem: object) -> None:
        if self._bar is not None:
            self._bar.__exit__(*problem)

    def done(self, size: int) -> None:
        """One more capture."""
        self._done += 1
        self._bytes += size
        if self._bar is not None:
            self._bar.update(size, size)

    def warn(self, text: str) -> None:
        """A line of its own on stderr; the bar comes again below it."""
        if self._bar is not None:
            click.echo("\r\x1b[K", nl=False, err=True)
        warn(text)

    def _words(self, _item: object) -> str:
        seconds = max(1e-3, time.monotonic() - self._begin)
        return (
            f"{self._done:,} of {self._captures:,}, {_bytes(self._bytes)} of "
            f"{_bytes(self._size)}, {_bytes(int(self._bytes / seconds))}/s"
        )


def _bytes(number: int) -> str:
    size, unit = float(number), 0
    while size >= 999.5 and unit < len(_UNITS) - 1:
        size /= 1000
        unit += 1
    return (
        f"{size:.0f} {_UNITS[unit]}" if unit == 0 or size >= 99.5 else f"{size:.1f} {_UNITS[unit]}"
    )
