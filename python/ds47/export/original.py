"""The capture that frames are taken from: a file, or the files of a series as one.

Lives here: reading it several times, in both ways of `ds47.capture`, with the same frame numbers. Not
here: which frames, and what becomes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ds47.capture import Capture, CaptureError, Series, open_capture
from ds47.capture.raw import Interface, RawFrame, raw_frames
from ds47.capture.series import Part
from ds47.model import CaptureFile


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

    def first_time(self) -> int | None:
        """Time of the first frame, nanoseconds since 1970; None where there is none."""
        if isinstance(self._source, str | Path):
            return next((frame.time_ns for frame in raw_frames(self._source)), None)
        for part in self._source:
            try:
                return next(frame.time_ns for frame in raw_frames(part.place))
            except (CaptureError, StopIteration):
                continue
        return None

    def frames(
        self, files: Sequence[CaptureFile], wanted: Callable[[int], bool] | None = None
    ) -> Iterator[RawFrame]:
        """Every frame as it stands in the file; only those whose number is `wanted`, None: all.

        `files` are those of the result of the analysis: where in a series each file begins.
        """
        if isinstance(self._source, str | Path):
            yield from raw_frames(self._source, wanted)
            return
        interfaces: dict[tuple[object, ...], Interface] = {}
        for part, file in zip(self._source, files, strict=True):
            if file.readable:
                yield from _numbered(part, file, wanted, interfaces)


def _numbered(
    part: Part,
    file: CaptureFile,
    wanted: Callable[[int], bool] | None,
    interfaces: dict[tuple[object, ...], Interface],
) -> Iterator[RawFrame]:
    """The frames of a file, numbered through the series; equal interfaces of several files are one."""
    before = file.first_frame - 1
    chosen = None if wanted is None else lambda number: wanted(number + before)
    for frame in raw_frames(part.place, chosen):
        if frame.number > file.frames:
            return
        frame.number += before
        about = frame.interface
        key = (about.link_type, about.snap_length, *about.options)
        frame.interface = interfaces.setdefault(key, about)
        yield frame
