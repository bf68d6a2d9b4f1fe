"""Which files a command may write over: never a capture. A recording cannot be made again.

A capture is known by its first bytes, a link by what it leads to. Here: the refusals. The stream that
a file is written through is `ds47.cli.common.output`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

from ds47.capture.names import STDIN


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
            raise click.ClickException(f"{name} is a capture and is not overwritten: {hint}")


def spare_recordings(names: Iterable[str]) -> None:
    """`spare_captures` for an export, which may replace what an earlier one wrote as NAME.ds47.pcapng."""
    others = (name for name in names if not _is_earlier_export(name))
    spare_captures(*others, hint="choose another -o, or say --force")


def refuse_links(names: Iterable[str]) -> None:
    """Raises click.ClickException where one of the files to write is a link to another file."""
    from ds47.export import LINK, is_link_to_file

    for name in names:
        if name != STDIN and is_link_to_file(Path(name)):
            problem = LINK.format(target=Path(name).resolve())
            raise click.ClickException(f"cannot write {name}: {problem}")


def replaced_captures(names: Iterable[str]) -> list[str]:
    """Those of the files that are a capture now, and no earlier export: what --force writes over."""
    replaced = []
    for name in names:
        try:
            if not _is_earlier_export(name):
                spare_captures(name)
        except click.ClickException:
            replaced.append(name)
    return replaced


def _is_earlier_export(name: str) -> bool:
    """Both its name and all of its content say so."""
    from ds47.capture.names import EXPORTED
    from ds47.export import is_earlier_export

    return name.lower().endswith(EXPORTED) and is_earlier_export(Path(name))
