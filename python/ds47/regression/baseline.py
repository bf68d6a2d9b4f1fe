"""Stored results: where they stand, how they look on disk, reading and writing them.

`NAME.ds47.json` beside the capture `NAME.pcapng`, or beside the files of the series NAME. What
differs from one is found in `ds47.regression.compare`; who may overwrite one is the business of the
commands.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from ds47.batch.tasks import in_folders
from ds47.capture.drafts import draft_of
from ds47.capture.names import PACKED, SUFFIXES, is_export
from ds47.capture.rings import common_name, may_be_part
from ds47.capture.special import special
from ds47.model import CaptureResult
from ds47.regression.shape import flaw
from ds47.report.json import visible
from ds47.version import __version__

SCHEMA = "ds47.baseline/1"
SUFFIX = ".ds47.json"
_WIDTH = 100
_GONE = "its capture is gone: restore it, or delete this stored result"
_PARTS = "its captures are the files of a series; use --series (pytest: --ds47-series)"
_EXPORT = "its capture is an export, which folders leave out: name it, or rename both"


class BaselineError(Exception):
    """A stored result that cannot be used: one line that says which, and what to do."""


class NoBaselineError(BaselineError):
    """There is none; the line ends with the command that makes one, without its path."""


def path_of(capture: Path, own_name: str | None = None) -> Path:
    """Where the stored result of a capture stands.

    Captures of one folder that differ in nothing but their endings keep the ending in the name.

    Args:
        capture: the file, of a series the first one.
        own_name: of a series that has a name of its own (`ds47.batch.tasks.Task.own_name`).
    """
    stem = own_name or _stem(capture.name)
    if own_name is None and _has_namesake(capture, stem):
        stem = capture.name
    return capture.with_name(stem + SUFFIX)


def names_for(capture: str) -> tuple[str, ...]:
    """The names that the stored result of a capture, or of its series, may have, by its file's name."""
    return _stem(capture) + SUFFIX, capture + SUFFIX, common_name(capture) + SUFFIX


def orphans(names: Sequence[str], *, series: bool) -> Iterator[tuple[str, str]]:
    """The stored results among the names of one folder that belong to no checked capture.

    Each with what is the matter, and what to do. `series`: the files of a series are one capture.
    """
    found = _results_of(filter(in_folders(series), names))
    parts = _results_of(filter(may_be_part, names))
    exports = _results_of(filter(is_export, names))
    for name in sorted(names):
        if name.endswith(SUFFIX) and name not in found:
            why = _PARTS if name in parts else _EXPORT if name in exports else _GONE
            yield name, why


def _results_of(captures: Iterable[str]) -> set[str]:
    return {each for name in captures for each in names_for(name)}


def _stem(name: str) -> str:
    for packed in PACKED:
        name = name.removesuffix(packed)
    for suffix in SUFFIXES:
        if name.lower().endswith(suffix):
            return name[: -len(suffix)]
    return name


def _has_namesake(capture: Path, stem: str) -> bool:
    names = (stem + suffix + packed for suffix in SUFFIXES for packed in PACKED)
    return any(_is_other(capture, capture.with_name(name)) for name in names)


def _is_other(capture: Path, path: Path) -> bool:
    """Whether a second capture has that name: not this one, which has it too where case is nothing."""
    if path.name == capture.name:
        return False
    try:
        if path.name.casefold() == capture.name.casefold():
            return not path.samefile(capture)
        return path.exists()
    except OSError:  # there is none; or none can be, the name is too long
        return False


def content(result: CaptureResult, lang: str = "en") -> dict[str, Any]:
    """What is stored of a result: the capture object of `ds47.report/2` without its path and its times.

    Files of a series go by their names alone: they stand beside it.
    """
    from ds47.report.json import capture

    stored = capture(result, lang)
    del stored["path"], stored["start"], stored["end"]
    for file in stored.get("files", ()):
        name = Path(file["path"]).name
        file["problem"] = file["problem"] and file["problem"].replace(file["path"], name)
        file["path"] = name
    for finding in stored["findings"]:
        finding.pop("time", None)
    return stored


class Stored(NamedTuple):
    """What was read: the `content`, and the version of ds47 that wrote it, None where it does not say."""

    content: dict[str, Any]
    version: str | None


def load(path: Path) -> Stored:
    """Reads a stored result.

    Raises:
        NoBaselineError: there is none.
        BaselineError: it is not one.
    """
    if (kind := special(path)) is not None:
        raise BaselineError(f"{path} is {kind}, no stored result: remove it")
    try:
        document = parse(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise NoBaselineError(
            f"{path}: there is no stored result; make one with: ds47 baseline"
        ) from None
    except (OSError, ValueError, RecursionError) as problem:
        raise BaselineError(f"{path}: {problem}") from problem
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise BaselineError(
            f"{path}: not a stored result ({SCHEMA}); make it with: ds47 baseline --force"
        )
    stored = document.get("capture")
    if (where := flaw(stored)) is not None:
        raise BaselineError(
            f"{path}: the stored result is not whole (see {where or 'capture'}); "
            "make it with: ds47 baseline --force"
        )
    tool = document.get("tool")
    version = tool.get("version") if isinstance(tool, dict) else None
    return Stored(cast(dict[str, Any], stored), version if isinstance(version, str) else None)


def parse(text: str) -> Any:
    """JSON as the contract has it: without NaN and infinity, which Python's would let pass.

    Raises:
        ValueError, RecursionError: it is none.
    """

    def refuse(word: str) -> None:
        raise ValueError(f"{word} is not a number in JSON")

    return json.loads(text, parse_constant=refuse)


def save(
    path: Path, stored: dict[str, Any], capture: str, version: str | None = __version__
) -> None:
    """Writes a stored result whole or not at all; the same content gives the same bytes anywhere.

    Args:
        path: where it stands.
        stored: its `content`.
        capture: the name of the file, of a series of its first one.
        version: of the ds47 that analysed it.

    Raises:
        OSError: it cannot be written.
    """
    draft = draft_of(path)
    try:
        draft.write_text(
            text(stored, capture, version),
            encoding="utf-8",
            errors="backslashreplace",
            newline="\n",
        )
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def text(stored: dict[str, Any], capture: str, version: str | None = __version__) -> str:
    """The file as text: sorted keys, short things on one line, the way to update it first."""
    option = " --series" if "files" in stored else ""
    document = {
        "#": f"stored result of {capture}; look at what changed with: ds47 check{option}, "
        f"take it over with: ds47 accept{option}",
        "schema": SCHEMA,
        "tool": {"name": "ds47", "version": version},
        "capture": stored,
    }
    return _layout(document, 0) + "\n"


def _layout(item: Any, depth: int) -> str:
    """JSON in which what fits on a line stands on one, so that a change is a change of lines."""
    line = visible(json.dumps(item, ensure_ascii=False, sort_keys=True, allow_nan=False))
    broken = (
        isinstance(item, dict | list) and item and (depth < 2 or len(line) + 2 * depth > _WIDTH)
    )
    if not broken:
        return line
    pad = "  " * (depth + 1)
    if isinstance(item, dict):
        rows = [f"{pad}{json.dumps(key)}: {_layout(item[key], depth + 1)}" for key in sorted(item)]
        rows[0] = rows[0][1:].lstrip() if depth == 0 else rows[0]
        opening = "{" if depth == 0 else "{\n"
        return opening + ",\n".join(rows) + "\n" + "  " * depth + "}"
    rows = [pad + _layout(each, depth + 1) for each in item]
    return "[\n" + ",\n".join(rows) + "\n" + "  " * depth + "]"
