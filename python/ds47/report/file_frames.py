"""The file of a frame in a series, and its number there.

Frames of a series are numbered through all its files (`ds47.model.CaptureFile`). Wireshark
opens one file at a time, and starts each at 1.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import PurePath

from ds47.model import CaptureFile
from ds47.report.bilingual import say


class FileFrames:
    """Frame numbers of a capture as numbers of its files; without files they stay as they are."""

    def __init__(self, files: Sequence[CaptureFile]) -> None:
        self._files = [file for file in files if file.frames]
        self._starts = [file.first_frame for file in self._files]

    def file_of(self, frame: int) -> tuple[CaptureFile, int] | None:
        """The file that has a frame, and the number of the frame in it; None without files."""
        at = bisect_right(self._starts, frame) - 1
        if at < 0:
            return None
        file = self._files[at]
        return file, frame - file.first_frame + 1

    def words(self, frame: int, lang: str = "en") -> str:
        """`frame 812`, of a series `frame 812 (12 of ring_00003_20240101120000.pcapng)`."""
        return say("frame", frame=self.number(frame, lang)).text(lang)

    def number(self, frame: int, lang: str = "en") -> str:
        """The same without the word."""
        found = self.file_of(frame)
        if found is None:
            return str(frame)
        values = {"frame": str(frame), "number": str(found[1]), "file": name(found[0])}
        return say("frame_in_file", **values).text(lang)

    def by_file(self, frames: Iterable[int]) -> list[tuple[str, list[int]]]:
        """The frames by file, each with its number there; one nameless file where there is no series."""
        groups: dict[str, list[int]] = {}
        for frame in sorted(set(frames)):
            found = self.file_of(frame)
            file, number = (name(found[0]), found[1]) if found else ("", frame)
            groups.setdefault(file, []).append(number)
        return list(groups.items())


def name(file: CaptureFile) -> str:
    """The name of a file without its folder, which is that of the series."""
    return PurePath(file.path).name
