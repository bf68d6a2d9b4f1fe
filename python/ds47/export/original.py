"""The capture that frames are taken from: a file, or the files of a series as one.

Lives here: reading it several times, with the same frame numbers. Not here: which frames, and what
becomes of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ds47.capture import Capture, Series, WholeFrame, open_capture
from ds47.capture.series import Part


class Original:
    """One capture, to be read as often as needed.

    Args:
        source: path of a capture, or the files of a series.
    """

    def __init__(self, source: str | Path | Sequence[Part]) -> None:
        self._source = source

    def open(self) -> Capture | Series:
        """The frames that may matter, for the analysis.

        Raises:
            ds47.capture.CaptureError: nothing can be read (of a series: says `problem`).
        """
        if isinstance(self._source, str | Path):
            return open_capture(self._source)
        return Series(self._source)

    def everything(self) -> Iterator[WholeFrame]:
        """Every frame as it stands in the file. Raises as `open`."""
        with self.open() as capture:
            yield from capture.everything()

    def first_time(self) -> int | None:
        """Time of the first frame, nanoseconds since 1970; None where there is none."""
        with self.open() as capture:
            return next((frame.time_ns for frame in capture.everything()), None)
