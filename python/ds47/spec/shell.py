"""A word as the shell of this system takes it: for every command that is shown to be copied."""

from __future__ import annotations

import sys


def shell_word(text: str) -> str:
    """A word for the shell of this system, quoted if needed; cmd.exe knows only double quotes."""
    if sys.platform == "win32":
        from subprocess import list2cmdline

        return list2cmdline([text])
    from shlex import quote

    return quote(text)
