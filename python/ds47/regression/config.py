"""`ds47.toml`: what a folder of captures says about how its results are compared.

Finding the file, reading it, and telling clearly what is wrong in it. What the numbers do to a
comparison is in `ds47.regression.compare`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from ds47 import spec
from ds47.batch.settings import nearest, parse_expect, parse_names, parse_s7
from ds47.batch.settings import parse as parse_cyclic
from ds47.model import SEVERITIES
from ds47.report.heading import parse as parse_heading
from ds47.spec import toml

_T = TypeVar("_T")


class ConfigError(Exception):
    """A `ds47.toml` that cannot be used: one line with the file, the key and what is allowed."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far numbers may lie apart and still be equal.

    Attributes:
        float_relative, float_absolute: for the values of floating point formats.
        duration_relative, duration_absolute_ms: for the duration of transactions, which are
            compared only where one of the two is given.
    """

    float_relative: float = 0.0
    float_absolute: float = 0.0
    duration_relative: float | None = None
    duration_absolute_ms: float | None = None


@dataclass(frozen=True, slots=True)
class ParameterTolerance:
    """A tolerance for all values of one parameter, whatever its format."""

    pnu: int
    subindex: int | None = None
    relative: float = 0.0
    absolute: float = 0.0


@dataclass(frozen=True, slots=True)
class Mask:
    """A parameter that changes by itself: its values are not compared."""

    pnu: int
    reason: str
    subindex: int | None = None
    device: str | None = None


@dataclass(frozen=True, slots=True)
class Ignore:
    """A known finding that is left out on both sides; `rule` may be the beginning of an id."""

    rule: str
    reason: str
    capture: str = "*"
    pnu: int | None = None


@dataclass(frozen=True, slots=True)
class Config:
    """The content of one `ds47.toml`, or what holds where there is none."""

    folder: Path | None = None
    tolerance: Tolerance = Tolerance()
    parameters: tuple[ParameterTolerance, ...] = ()
    masks: tuple[Mask, ...] = ()
    ignores: tuple[Ignore, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    fail_on: str = "error"

    def label(self, capture: Path) -> str:
        """The label (a firmware, say) of a capture: of the first pattern that fits, else its folder's name."""
        name = self._below(capture)
        for pattern, label in self.labels.items():
            if fnmatch(name, pattern):
                return label
        return capture.resolve().parent.name

    def ignored(self, rule: str, capture: Path, pnus: set[int]) -> bool:
        """Whether a finding of this capture, about these parameters, is a known one."""
        name = self._below(capture)
        return any(
            rule.startswith(known.rule)
            and (fnmatch(name, known.capture) or fnmatch(capture.name, known.capture))
            and (known.pnu is None or known.pnu in pnus)
            for known in self.ignores
        )

    def masked(
        self, device: str, pnu: int | None, subindex: int | None, name: str | None = None
    ) -> bool:
        """Whether the values of a parameter change by themselves (a clock, an actual value).

        `name` is what the parameter is called, None where nothing names it.
        """
        if pnu is not None and spec.is_changing(pnu, name):
            return True
        return any(
            mask.pnu == pnu
            and mask.subindex in (None, subindex)
            and (mask.device is None or fnmatch(device, mask.device))
            for mask in self.masks
        )

    def _below(self, capture: Path) -> str:
        """The name of a capture as patterns see it: with slashes, from the folder of ds47.toml on."""
        whole = capture.resolve()
        if self.folder is not None and whole.is_relative_to(self.folder):
            whole = whole.relative_to(self.folder)
        return whole.as_posix()


def find(capture: Path) -> Config:
    """The configuration for a capture: `ds47.toml` beside it or in the nearest folder above.

    Raises:
        ConfigError: there is one and it cannot be used.
    """
    return _for_folder(capture.resolve().parent)


@cache
def _for_folder(folder: Path) -> Config:
    path = nearest(folder)
    return Config() if path is None else load(path)


def load(path: Path) -> Config:
    """Reads one `ds47.toml`.

    Raises:
        ConfigError: it cannot be read, is no TOML, or holds what it must not.
    """
    try:
        table = toml.parse(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError) as problem:
        raise ConfigError(f"{path}: {problem}") from problem
    try:
        return _config(path.resolve().parent, table)
    except ConfigError as problem:
        raise ConfigError(f"{path}: {problem}") from None


_TOP = ("tolerance", "mask", "ignore", "labels", "check", "cyclic", "s7", "names", "report", "expect")  # fmt: skip


def _config(folder: Path, table: dict[str, Any]) -> Config:
    _known_keys("the file", table, _TOP)
    try:
        parse_cyclic(table.get("cyclic", {}))  # who reads the captures takes these from there
        parse_s7(table.get("s7", {}))
        parse_names(table.get("names", {}))
        parse_heading(table.get("report", {}))
        parse_expect(table.get("expect", {}))
    except ValueError as problem:
        raise ConfigError(str(problem)) from None
    tolerance = _section(table, "tolerance")
    own = _rows(tolerance.pop("parameter", []), "tolerance.parameter")
    check = _section(table, "check")
    _known_keys("[check]", check, ("fail_on",))
    labels = _section(table, "labels")
    if not all(isinstance(label, str) for label in labels.values()):
        raise ConfigError('[labels]: a label is a text, as in "fw-5.2/*" = "5.2"')
    fail_on = check.get("fail_on", "error")
    if fail_on not in ("never", *SEVERITIES):
        raise ConfigError(f"[check] fail_on: one of never, {', '.join(SEVERITIES)}")
    ignores = tuple(
        _known(_make(Ignore, row, "[[ignore]]")) for row in _rows(table.get("ignore", []), "ignore")
    )
    return Config(
        folder,
        _make(Tolerance, tolerance, "[tolerance]"),
        tuple(_make(ParameterTolerance, row, "[[tolerance.parameter]]") for row in own),
        tuple(_make(Mask, row, "[[mask]]") for row in _rows(table.get("mask", []), "mask")),
        ignores,
        labels,
        fail_on,
    )


def _known(ignore: Ignore) -> Ignore:
    """With the id of a rule, or how ids begin, where the file may have a name."""
    rule = spec.rule_prefix(ignore.rule)
    if rule is None:
        raise ConfigError(
            f"[[ignore]]: no rule has the number or name {ignore.rule!r}. Try: ds47 rules"
        )
    return replace(ignore, rule=rule)


def _section(table: dict[str, Any], name: str) -> dict[str, Any]:
    section = table.get(name, {})
    if not isinstance(section, dict):
        raise ConfigError(f"{name}: write it as a table, [{name}]")
    return dict(section)


def _rows(rows: Any, name: str) -> list[dict[str, Any]]:
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ConfigError(f"{name}: write each as a table of its own, [[{name}]]")
    return rows


def _make(kind: type[_T], row: dict[str, Any], where: str) -> _T:
    known = {each.name: each for each in fields(kind)}  # type: ignore[arg-type]
    _known_keys(where, row, tuple(known))
    for name, each in known.items():
        if name not in row:
            if each.default is MISSING:
                raise ConfigError(f"{where}: {name} is missing")
            continue
        if not _fits(row[name], str(each.type)):
            raise ConfigError(
                f"{where} {name}: {row[name]!r} is not {_WORDS[str(each.type).split(' ')[0]]}"
            )
    return kind(**row)


_WORDS = {"int": "a whole number", "float": "a number, 0 or more", "str": "a text"}


def _fits(value: Any, kind: str) -> bool:
    if kind.startswith("str"):
        return isinstance(value, str) and bool(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return isinstance(value, int) if kind.startswith("int") else value >= 0


def _known_keys(where: str, table: Mapping[str, Any], allowed: tuple[str, ...]) -> None:
    for key in table:
        if key not in allowed:
            raise ConfigError(f"{where}: unknown key {key!r}; known are {', '.join(allowed)}")
