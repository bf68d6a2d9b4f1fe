"""The part of many captures that a run takes: in the matrix each tshark has one, and all of them the whole."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def parts() -> int:
    """In how many parts the captures are divided; 1 where a run takes them all."""
    return int(os.environ.get("DS47_SHARE", "0/1").partition("/")[2])


def share(items: Sequence[T]) -> list[T]:
    """The part of a run: DS47_SHARE=1/3 is the second of three (tools/matrix.py)."""
    part = int(os.environ.get("DS47_SHARE", "0/1").partition("/")[0])
    return list(items[part :: parts()])
