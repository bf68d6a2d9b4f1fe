"""What the `ds47.toml` beside captures says of cyclic channels: `[cyclic]` with `channels`, `ppo`, `pkw_layout`.

Where a folder of captures has no Connects, its channels are named once and not at each command. What is typed at a
command counts more. Everything else in the file is about comparing results (`ds47.regression.config`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

from ds47.analysis import AnalysisOptions
from ds47.capture import CaptureError
from ds47.cyclic import CYCLIC, USS, named, ppo
from ds47.cyclic.named import Name

FILE: Final = "ds47.toml"


@dataclass(frozen=True, slots=True)
class CyclicSettings:
    """The table `[cyclic]`: channels that are named, and layouts of IND by the address of a device."""

    channels: tuple[Name, ...] = ()
    pkw_layouts: tuple[tuple[str, str], ...] = ()
    ppos: tuple[tuple[int, int], ...] = ()


def parse(table: Any) -> CyclicSettings:
    """The settings of a table `[cyclic]`.

    Raises:
        ValueError: the key and what is allowed.
    """
    if not isinstance(table, dict):
        raise ValueError("cyclic: write it as a table, [cyclic]")
    unknown = set(table) - {"channels", "pkw_layout", "ppo"}
    if unknown:
        known = "channels, pkw_layout, ppo"
        raise ValueError(f"[cyclic]: unknown key {min(unknown)!r}; known are {known}")
    try:
        names = tuple(map(named.parse, _texts(table, "channels")))
        named.pairs(names)
    except ValueError as problem:
        raise ValueError(f"[cyclic] channels: {problem}") from None
    try:
        ppos = tuple(map(ppo.parse, _texts(table, "ppo")))
    except ValueError as problem:
        raise ValueError(f"[cyclic] ppo: {problem}") from None
    return CyclicSettings(names, tuple(map(layout, _texts(table, "pkw_layout"))), ppos)


def _texts(table: dict[str, Any], key: str) -> Sequence[str]:
    found = table.get(key, [])
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError(f"[cyclic] {key}: write a list of texts")
    return found


def layout(text: str) -> tuple[str, str]:
    """`uss`, or `192.168.0.5=uss` for one device: its address ("" for all) and the layout.

    Raises:
        ValueError: it is none.
    """
    device, _, name = text.rpartition("=")
    if name not in (CYCLIC, USS):
        raise ValueError(f"{text!r}: cyclic or uss, for one device 192.168.0.5=uss")
    return device, name


def options_for(place: str, options: AnalysisOptions) -> AnalysisOptions:
    """The options for a capture, with what the nearest `ds47.toml` says of it; URLs and pipes have none.

    Raises:
        ds47.capture.CaptureError: the file says something that cannot be.
    """
    path = Path(place)
    if "://" in place or not path.is_file():
        return options
    settings = _nearest(path.resolve().parent)
    if settings == CyclicSettings():
        return options
    return replace(
        options,
        cyclic=options.cyclic or settings.channels,
        pkw_layouts=(*settings.pkw_layouts, *options.pkw_layouts),
        ppos=(*settings.ppos, *options.ppos),
    )


@cache
def _nearest(folder: Path) -> CyclicSettings:
    for place in (folder, *folder.parents):
        if (place / FILE).is_file():
            return _read(place / FILE)
    return CyclicSettings()


def _read(path: Path) -> CyclicSettings:
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8-sig"))
        return parse(table.get("cyclic", {}))
    except (OSError, ValueError) as problem:  # a mistake in TOML is a ValueError, too
        raise CaptureError(f"{path}: {problem}") from None
