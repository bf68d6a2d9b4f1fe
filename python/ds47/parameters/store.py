"""The folder of the user in which imported lists are kept, one file of TOML each.

The folder is that of DS47_PARAMS, else `parameters` in the folder that the system has for settings of programs.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from ds47.parameters.file_names import is_device

if TYPE_CHECKING:
    from ds47.parameters.lists import ParameterList

VARIABLE: Final = "DS47_PARAMS"
_NO_NAME: Final = r"[^\w.+-]+"


def folder() -> Path:
    """Where the lists are; it need not be there."""
    named = os.environ.get(VARIABLE)
    return Path(named) if named else Path(click.get_app_dir("ds47"), "parameters")


def save(found: ParameterList) -> tuple[Path, bool]:
    """Keeps a list under its name; where, and whether one of that name was replaced.

    Raises:
        ListError: the folder cannot be written.
    """
    from ds47.parameters.lists import ListError, write

    path = folder() / f"{file_name(found.name)}.toml"
    replaced = path.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(write(found), "utf-8", newline="\n")
    except OSError as problem:
        raise ListError(f"{path}: {problem.strerror}; {VARIABLE} names another folder") from problem
    return path, replaced


def file_name(name: str) -> str:
    """The name of a list as that of a file that every system takes."""
    plain = re.sub(_NO_NAME, "-", name).strip("-. ") or "list"
    stem, dot, rest = plain.partition(".")
    return f"{stem}-{dot}{rest}" if is_device(plain) else plain


def files() -> list[Path]:
    """Those of all lists that are kept; nearly always none, and what reads them takes its time to import."""
    return sorted(path for path in folder().glob("*.toml") if path.is_file())


def kept() -> list[tuple[Path, ParameterList]]:
    """All lists that are kept, in the order of `files`. Raises ListError where one of them cannot be read."""
    from ds47.parameters.lists import read

    return [(path, read(path)) for path in files()]


def remove(name: str) -> Path:
    """Removes a list by its name, or that of its file.

    Raises:
        ListError: there is none, or it cannot be removed.
    """
    from ds47.parameters.lists import ListError

    for path, found in kept():
        if name in (found.name, path.stem, path.name):
            try:
                path.unlink()
            except OSError as problem:
                raise ListError(f"{path}: {problem.strerror}") from problem
            return path
    names = ", ".join(found.name for _, found in kept())
    raise ListError(f"no list {name!r} in {folder()}{f'; there are: {names}' if names else ''}")
