"""Which captures are of PROFIBUS, for tests that compare with readers who know Ethernet alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ds47.capture import open_capture
from ds47.profibus import LINK_TYPES


def is_profibus(path: Path) -> bool:
    """Whether the link type of a capture is that of PROFIBUS."""
    with open_capture(path) as capture:
        return next((each.link_type in LINK_TYPES for each in capture.everything()), False)


def of_ethernet(paths: Iterable[Path]) -> list[Path]:
    """All others."""
    return [path for path in paths if not is_profibus(path)]
