"""What the `ds47.toml` beside captures says of them and of reports.

`[cyclic]` has `channels`, `ppo` and `pkw_layout`, `[s7]` has `ports`, `cpu`, `block` and `readback`, `[names]` has
`vendor`, `[expect]` the `file` that says what parameters should be. What a folder of captures does not show is
named once there, and not at each command. What is typed at a command counts more.
`[report]` is the title block of a page (`ds47.report.heading`), and `tz` there the zone of times of day.
Everything else in the file is about comparing results (`ds47.regression.config`).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from ds47.analysis import AnalysisOptions
from ds47.capture import CaptureError
from ds47.report import heading
from ds47.report.heading import Heading
from ds47.report.zones import Zone, zone
from ds47.s7 import choices
from ds47.s7.choices import Choices

if TYPE_CHECKING:
    from ds47.cyclic.named import Name
    from ds47.parameters.expected import Expectation

FILE: Final = "ds47.toml"


class Settings(NamedTuple):
    """`[cyclic]`: channels that are named, and layouts of IND by the address of a device; and the other tables."""

    channels: tuple[Name, ...] = ()
    pkw_layouts: tuple[tuple[str, str], ...] = ()
    ppos: tuple[tuple[int, int], ...] = ()
    s7: Choices = Choices()
    vendor_id: int | None = None
    heading: Heading = Heading()
    zone: Zone | None = None
    """That of times of day."""
    expected: tuple[Expectation, ...] = ()
    """The golden list."""


@contextmanager
def _said_of(place: str) -> Iterator[None]:
    """Says of a ValueError where in the file it is."""
    try:
        yield
    except ValueError as problem:
        raise ValueError(f"{place} {problem}") from None


def parse(table: Any) -> Settings:
    """The settings of a table `[cyclic]`. Raises ValueError with the key and what is allowed."""
    from ds47.cyclic import named  # most folders have no settings

    table = _checked(table, "cyclic", "channels", "pkw_layout", "ppo")
    with _said_of("[cyclic] channels:"):
        names = tuple(map(named.parse, _texts(table, "channels")))
        named.pairs(names)
    with _said_of("[cyclic] ppo:"):
        ppos = tuple(map(named.parse_ppo, _texts(table, "ppo")))
    return Settings(names, tuple(map(layout, _texts(table, "pkw_layout"))), ppos)


def parse_s7(table: Any) -> Choices:
    """The choices of a table `[s7]`. Raises ValueError with the key and what is allowed."""
    table = _checked(table, "s7", "ports", "cpu", "block", "readback")
    ports, readback = table.get("ports", []), table.get("readback", False)
    if not isinstance(ports, list) or not all(type(each) is int for each in ports):
        raise ValueError("[s7] ports: write a list of numbers")
    if not isinstance(readback, bool):
        raise ValueError("[s7] readback: write true or false")
    cpus, blocks = _texts(table, "cpu", "s7"), _texts(table, "block", "s7")
    with _said_of("[s7]"):
        return choices.parse(ports, cpus, blocks, readback)


def parse_names(table: Any) -> int | None:
    """The vendor id in `[names]`, for devices without one in the capture.

    Raises:
        ValueError: the key and what is allowed.
    """
    vendor = _checked(table, "names", "vendor").get("vendor")
    if vendor is None or (isinstance(vendor, int) and not isinstance(vendor, bool)):
        return vendor
    from ds47.spec import maker_names  # few settings name one

    with _said_of("[names] vendor:"):
        return maker_names.number(str(vendor))


def parse_expect(table: Any) -> str | None:
    """The name of the golden list in `[expect]`. Raises ValueError with the key and what is allowed."""
    name = _checked(table, "expect", "file").get("file")
    if table and not (isinstance(name, str) and name):
        raise ValueError('[expect] file: write the name of a list, such as "golden.toml"')
    return name


def _checked(table: Any, name: str, *known: str) -> dict[str, Any]:
    """A table of the file that has no other keys. Raises ValueError with the key and what is allowed."""
    if not isinstance(table, dict):
        raise ValueError(f"{name}: write it as a table, [{name}]")
    unknown, are = set(table) - set(known), "is" if len(known) == 1 else "are"
    if unknown:
        raise ValueError(f"[{name}]: unknown key {min(unknown)!r}; known {are} {', '.join(known)}")
    return table


def _texts(table: dict[str, Any], key: str, name: str = "cyclic") -> Sequence[str]:
    found = table.get(key, [])
    if not isinstance(found, list) or not all(isinstance(each, str) for each in found):
        raise ValueError(f"[{name}] {key}: write a list of texts")
    return found


def layout(text: str) -> tuple[str, str]:
    """`uss`, or `192.168.0.5=uss` for one device: its address ("" for all) and the layout.

    Raises:
        ValueError: it is none.
    """
    from ds47.cyclic.pkw import CYCLIC, USS

    device, _, name = text.rpartition("=")
    if name not in (CYCLIC, USS):
        raise ValueError(f"{text!r}: cyclic or uss, for one device 192.168.0.5=uss")
    return device, name


def parse_tz(text: Any) -> Zone:
    """The zone of `tz` in `[report]`. Raises ValueError with what is allowed."""
    with _said_of("[report] tz:"):
        return zone(str(text))


def options_for(location: str, options: AnalysisOptions) -> AnalysisOptions:
    """The options for a capture, with what the nearest `ds47.toml` says of it; URLs and pipes have none.

    Raises:
        ds47.capture.CaptureError: the file says something that cannot be.
    """
    path = Path(location)
    if "://" in location or not path.is_file():
        return options
    settings = _nearest(path.resolve().parent)
    if settings == Settings():
        return options
    return options._replace(
        cyclic=options.cyclic or settings.channels,
        pkw_layouts=(*settings.pkw_layouts, *options.pkw_layouts),
        ppos=(*settings.ppos, *options.ppos),
        s7=settings.s7.and_then(options.s7),
        vendor_id=settings.vendor_id if options.vendor_id is None else options.vendor_id,
    )


def expected_for(location: str) -> tuple[Expectation, ...]:
    """The golden list for a capture that the nearest `ds47.toml` names; URLs and pipes have none.

    Raises:
        ds47.capture.CaptureError: the file says something that cannot be, or its list cannot be read.
    """
    path = Path(location)
    if "://" in location or not path.is_file():
        return ()
    return _nearest(path.resolve().parent).expected


def heading_for(locations: Sequence[str]) -> Heading:
    """The title block that the nearest `ds47.toml` of the first capture, or folder, says.

    Raises:
        ds47.capture.CaptureError: the file says something that cannot be.
    """
    return _of_first(locations).heading


def zone_for(locations: Sequence[str]) -> Zone | None:
    """The zone of times of day that it says; None where it says none.

    Raises:
        ds47.capture.CaptureError: the file says something that cannot be.
    """
    return _of_first(locations).zone


def _of_first(locations: Sequence[str]) -> Settings:
    path = Path(locations[0])
    if "://" in locations[0] or not path.exists():
        return Settings()
    whole = path.resolve()
    return _nearest(whole if whole.is_dir() else whole.parent)


def nearest(folder: Path) -> Path | None:
    """The file that counts for a folder: its own, or that of the nearest one above."""
    return next((path for path in _places(folder) if path.is_file()), None)


def passed_over(locations: Iterable[str]) -> Iterator[str]:
    """A line for each `ds47.toml` that would count for captures, and is a folder, a named pipe or the like."""
    folders = {os.path.dirname(each) for each in locations if "://" not in each}  # noqa: PTH120
    seen = set[Path]()
    for folder in sorted(folders):
        for path in _places(Path(folder).resolve()):
            if path in seen or path.is_file():
                break
            seen.add(path)
            if os.path.lexists(path):
                from ds47.capture.special import special  # hardly ever

                if (kind := special(path)) is not None:
                    yield f"{path} is {kind}, no file: passed over"


def _places(folder: Path) -> Iterator[Path]:
    return (each / FILE for each in (folder, *folder.parents))


@cache
def _nearest(folder: Path) -> Settings:
    path = nearest(folder)
    return Settings() if path is None else _read(path)


def _read(path: Path) -> Settings:
    from ds47.spec import toml  # most folders have no settings

    try:
        table = toml.parse(path.read_text(encoding="utf-8-sig"))
        report = table.get("report", {})
        tz = report.pop("tz", None) if isinstance(report, dict) else None
        return parse(table.get("cyclic", {}))._replace(
            s7=parse_s7(table.get("s7", {})),
            vendor_id=parse_names(table.get("names", {})),
            heading=heading.parse(report),
            zone=None if tz is None else parse_tz(tz),
            expected=_expected(path.parent, parse_expect(table.get("expect", {}))),
        )
    except (OSError, ValueError) as problem:  # a mistake in TOML is a ValueError, too
        raise CaptureError(f"{path}: {problem}") from None


def _expected(folder: Path, name: str | None) -> tuple[Expectation, ...]:
    """The golden list of this name; a relative one is that of the folder."""
    if name is None:
        return ()
    from ds47.parameters import expected, lists

    try:
        return expected.read(folder / name)
    except lists.ListError as problem:
        raise ValueError(f"[expect] file: {problem}") from problem
