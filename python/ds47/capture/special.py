"""What stands under the name of a file and is none: reading a named pipe waits for ever."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

CIRCLE = "a link in a circle"
_KINDS = (
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISDIR, "a folder"),
)


def special(path: str | Path) -> str | None:
    """What a path leads to instead of a file; None for a file, for nothing, and where nobody can look."""
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116 (of a name that came from a folder)
    except OSError as problem:
        return CIRCLE if problem.errno == errno.ELOOP else None
    except ValueError:
        return None
    return next((name for is_kind, name in _KINDS if is_kind(mode)), None)
