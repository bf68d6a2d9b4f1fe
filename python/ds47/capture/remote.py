"""Captures on other machines: `s3://bucket/x.pcapng` and everything else that fsspec opens.

Lives here: what a URL is, opening it, listing below it, its size and mark. fsspec is imported only for a
URL. Its file systems raise any exception of their libraries: here they become OSError or CaptureError, as
for a file.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ds47.spec.extras import install

from .errors import CaptureError
from .names import is_capture

_PIECE = 1 << 20

_MARKS = ("ETag", "etag", "mtime", "LastModified", "last_modified", "Last-Modified", "created")
"""Names that file systems use for something that changes with a file."""


def is_url(name: str) -> bool:
    """Whether a name is a URL, with a protocol."""
    return "://" in name


def sha256(location: str | Path) -> str:
    """The SHA-256 of all bytes of a file or URL, in hex."""
    import hashlib  # only here: it takes longer to import than a small capture to analyse

    found = hashlib.sha256()
    with open_bytes(location) as stream:
        while piece := stream.read(_PIECE):
            found.update(piece)
    return found.hexdigest()


def open_bytes(location: str | Path) -> io.RawIOBase:
    """The bytes of a file or a URL, unbuffered. Raises OSError, ValueError, CaptureError."""
    if not is_url(str(location)):
        return Path(location).open("rb", buffering=0)
    system, path = file_system(str(location))
    try:
        return _Remote(system.open(path, "rb"))
    except Exception as problem:
        raise OSError(reason(problem)) from problem


def facts(url: str) -> tuple[int, str | None]:
    """The size of a URL's file, and a mark that changes with it; None if unknown."""
    try:
        system, path = file_system(url)
        about = system.info(path)
    except Exception:  # noqa: BLE001 (opening it says why)
        return 0, None
    marks = [str(about[key]) for key in _MARKS if about.get(key)]
    return int(about.get("size") or 0), marks[0] if marks else None


def below(url: str, accept: Callable[[str], bool] = is_capture) -> list[str]:
    """The captures that a URL means: itself, or those in the folder that it names, sorted.

    Raises:
        CaptureError: it cannot be listed.
    """
    if accept(url):
        return [url]
    system, path = file_system(url)
    try:
        names = system.find(path)
        found = sorted(str(system.unstrip_protocol(name)) for name in names if accept(name))
        if not found and not system.isdir(path):
            return [url]
    except Exception as problem:
        raise CaptureError(f"{url}: cannot be listed: {reason(problem)}") from problem
    return found


def file_system(url: str) -> tuple[Any, str]:
    """The file system behind a URL and the path in it. Raises CaptureError."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise CaptureError(f"{url}: needs the package fsspec: {install('urls')}") from None
    try:
        system, path = url_to_fs(url)
    except Exception as problem:
        raise CaptureError(f"{url}: {reason(problem)}") from problem
    return system, str(path)


class _Remote(io.RawIOBase):
    """A remote file that fails with OSError, like a local one."""

    def __init__(self, file: Any) -> None:
        super().__init__()
        self._file = file

    def readable(self) -> bool:
        return True

    def readinto(self, room: Any, /) -> int:
        """Fill the beginning of `room`; how many bytes, 0 at the end."""
        try:
            piece = self._file.read(len(room))
        except Exception as problem:
            raise OSError(reason(problem)) from problem
        room[: len(piece)] = piece
        return len(piece)

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()


def reason(problem: Exception) -> str:
    """The message of a file system about a failure, in one line."""
    if isinstance(problem, FileNotFoundError):
        return "No such file or directory"
    text = getattr(problem, "strerror", None) or str(problem) or type(problem).__name__
    return " ".join(str(text).split())
