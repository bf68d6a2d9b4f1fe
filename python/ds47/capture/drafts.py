"""Where a file is written until it is whole: `.NAME.PID.tmp` beside it.

A process that is killed leaves its draft behind. Who writes a file of the same name next takes it away.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

_DRAFT = re.compile(r"\.(?P<name>.+)\.(?P<owner>\d{1,10})\.tmp")


def draft_of(path: Path, owner: int | None = None) -> Path:
    """Where the process `owner`, or this one, writes a file; what dead ones left there is gone."""
    for each in _left_over(path.parent).get(path.name, ()):
        with suppress(OSError):
            each.unlink()
    return path.with_name(f".{path.name}.{owner or os.getpid()}.tmp")


@cache
def _left_over(folder: Path) -> dict[str, Sequence[Path]]:
    """The drafts of dead processes, by the name of their file. A folder is listed once: it may be large."""
    found = defaultdict[str, list[Path]](list)
    if os.name == "posix":  # elsewhere no signal asks whether a process lives
        with suppress(OSError):
            for each in os.scandir(folder):
                draft = _DRAFT.fullmatch(each.name)
                if draft is not None and _is_dead(int(draft["owner"])):
                    found[draft["name"]].append(Path(each.path))
    return dict(found)


def _is_dead(owner: int) -> bool:
    try:
        os.kill(owner, 0)
    except ProcessLookupError:
        return owner > 0
    except (OSError, OverflowError):  # it is somebody else's; no process has that number
        return False
    return False
