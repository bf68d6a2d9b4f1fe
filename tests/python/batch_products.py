"""Products for the tests of the runners: other processes import them from here."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, ClassVar

from ds47.batch.tasks import Task
from ds47.capture import CaptureError


@dataclass(frozen=True)
class Names:
    """Writes the name of the task; some kill their process, always or the first time."""

    folder: Path
    is_kept: ClassVar[bool] = False

    def __call__(self, task: Task, stream: BinaryIO) -> None:
        if task.path.startswith("broken"):
            raise CaptureError(f"{task.path}: is broken")
        if task.path.startswith("full-disk"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        once = self.folder / f"{task.path}.died"
        if task.path.startswith("deadly") or (
            task.path.startswith("dies-once") and not once.exists()
        ):
            once.touch()
            stream.write(b"half of it")
            stream.flush()
            os._exit(9)
        stream.write(task.path.encode())
