"""Which files a command may write over: never a capture. A recording cannot be made again.

Here: the refusal. The stream that a file is written through is `ds47.cli.common.output`.
"""

from __future__ import annotations

from pathlib import Path

import click

from ds47.cli.paths import STDIN


def spare_captures(*names: str | None, hint: str = "choose another name") -> None:
    """Raises click.ClickException where one of the files to write is there and is a capture.

    Its first bytes say so, not its name. A file that nobody can look into is spared too. A command
    that writes at its end calls this at its beginning.
    """
    from ds47.capture import CaptureError, holds_capture

    for name in names:
        if name is None or name == STDIN or not Path(name).is_file():
            continue
        try:
            spared = holds_capture(Path(name))
        except CaptureError as problem:
            raise click.ClickException(f"cannot write over {problem}") from problem
        if spared:
            raise click.ClickException(f"{name} is a capture, which is not written over: {hint}")
