"""Several files read as one capture, one after the other: the files of a ring buffer.

Lives here: `Series`, which is to the analysis what `Capture` is. Frames are numbered through all
files, as `mergecap -a` would put them into one; `files` says where each began. Which files belong
together is in rings.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple, TypeVar

from ds47.model import CaptureFile

from .closing import Closing
from .errors import CaptureError
from .frame import Frame, Interface, WholeFrame
from .reader import Capture, open_capture
from .scan import Watch

_F = TypeVar("_F", bound=Frame)


class SeriesPart(NamedTuple):
    """A file of a series: its name in the report, its path or URL, how many files are missing before it."""

    name: str
    location: str
    missing: int = 0


class Series(Closing):
    """The files as one capture: a context manager, and an iterable of the frames that may matter.

    The attributes are those of `Capture`. A file that is damaged, or cannot be read at all, is named
    in `problem` and in `files`; reading goes on with the next one.
    """

    def __init__(self, parts: Sequence[SeriesPart]) -> None:
        self.path = parts[0].name
        self.files: list[CaptureFile] = []
        self.dropped: int | None = None
        self.first_ns: int | None = None
        self.last_ns: int | None = None
        self._parts = parts
        self._capture: Capture | None = None
        self._before = 0
        self._watches: Sequence[Watch] = ()
        self._ports: tuple[int, ...] = ()
        self._frames = self._read(iter)

    def __iter__(self) -> Iterator[Frame]:
        return self._frames

    def watch(self, watches: Sequence[Watch]) -> None:
        """As `Capture.watch`, in all files that follow too."""
        self._watches = watches
        if self._capture is not None:
            self._capture.watch(watches)

    def tcp(self, ports: Iterable[int]) -> None:
        """As `Capture.tcp`, in all files that follow too."""
        self._ports = tuple(ports)
        if self._capture is not None:
            self._capture.tcp(self._ports)

    def everything(self, wanted: Callable[[int], bool] = lambda _: True) -> Iterator[WholeFrame]:
        """As `Capture.everything`. Interfaces that the files describe in the same words are one."""
        interfaces: dict[tuple[object, ...], Interface] = {}
        for frame in self._read(lambda file: file.everything(lambda n: wanted(n + self._before))):
            about = frame.interface
            key = (about.link_type, about.snap_length, *about.options)
            frame.interface = interfaces.setdefault(key, about)
            yield frame

    def _read(self, way: Callable[[Capture], Iterator[_F]]) -> Iterator[_F]:
        for part in self._parts:
            file = CaptureFile(part.name, self._before + 1, missing_before=part.missing)
            self.files.append(file)
            try:
                self._capture = open_capture(part.location, name=part.name)
            except CaptureError as problem:
                file.problem, file.readable = problem.message, False
                continue
            self._capture.watch(self._watches)
            self._capture.tcp(self._ports)
            with self._capture:
                yield from self._numbered(way(self._capture))
                self._end(self._capture, file)
            self._capture = None

    def _numbered(self, frames: Iterable[_F]) -> Iterator[_F]:
        before = self._before
        for frame in frames:
            frame.number += before
            yield frame

    def _end(self, capture: Capture, file: CaptureFile) -> None:
        file.frames, file.problem = capture.frames, capture.problem
        self._before += file.frames
        if self.first_ns is None:
            self.first_ns = capture.first_ns
        if capture.last_ns is not None:
            self.last_ns = capture.last_ns
        if capture.dropped is not None:
            self.dropped = capture.dropped + (self.dropped or 0)

    @property
    def frames(self) -> int:
        """Frames passed so far, in all files."""
        return self._before + (self._capture.frames if self._capture else 0)

    @property
    def problem(self) -> str | None:
        """What was wrong with the first file that was not read as a whole, and with how many more."""
        wrong = [file for file in self.files if file.problem]
        if not wrong:
            return None
        first = wrong[0]
        text = first.problem or ""
        if first.path not in text:
            text = f"{first.path}: {text}"
        return text if len(wrong) == 1 else f"{text} (and {len(wrong) - 1} more files)"

    @property
    def complete(self) -> bool:
        """True when every file was read to its end."""
        whole = len(self.files) == len(self._parts) and self._capture is None
        return whole and self.problem is None

    @property
    def timed(self) -> bool:
        """As `Capture.timed`, of the file that is open."""
        return self._capture is None or self._capture.timed

    @property
    def excerpt(self) -> bool:
        """As `Capture.excerpt`: no export is a series of files."""
        return False

    @property
    def gaps(self) -> bool:
        """Whether frames are missing between two others: dropped ones, a missing or a damaged file."""
        missing = any(file.missing_before for file in self.files[1:])
        damaged = any(file.problem for file in self.files[:-1])
        return missing or damaged or bool(self.dropped)

    def close(self) -> None:
        """Close the file that is open."""
        if self._capture is not None:
            self._capture.close()
