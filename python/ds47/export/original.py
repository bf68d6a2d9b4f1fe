"""The capture that frames are taken from: a file, or the files of a series as one; it is read several times.

Not here: which frames, and what becomes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ds47.capture import Capture, Series, WholeFrame, open_capture
from ds47.capture.series import SeriesPart

Original = str | Path | Sequence[SeriesPart]
"""Path of a capture, or the files of a series."""


def opened(original: Original) -> Capture | Series:
    """The capture from its beginning.

    Raises:
        ds47.capture.CaptureError: nothing can be read (of a series: says `problem`).
    """
    return open_capture(original) if isinstance(original, str | Path) else Series(original)


def whole_frames(original: Original, wanted: Callable[[int], bool]) -> Iterator[WholeFrame]:
    """The frames of these numbers as they stand in the file. Raises as `opened`."""
    with opened(original) as capture:
        yield from capture.everything(wanted)


def first_time(original: Original) -> int | None:
    """Time of the first frame, nanoseconds since 1970; None: there is none. Raises as `opened`."""
    with opened(original) as capture:
        return next((frame.time_ns for frame in capture.everything()), None)
