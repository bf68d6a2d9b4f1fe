"""What a run of the matrix takes: each tshark has a part of many captures, and all of them the whole.

Divided are the captures that a test goes through itself (`share`), and the tests of which there is one for each of
many captures (`own`).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

import pytest

T = TypeVar("T")
MANY = 8
"""A test of fewer captures looks at something that each tshark has to show."""


def parts() -> int:
    """In how many parts the captures are divided; 1 where a run takes them all."""
    return int(os.environ.get("DS47_SHARE", "0/1").partition("/")[2])


def share(items: Sequence[T]) -> list[T]:
    """The part of a run: DS47_SHARE=1/3 is the second of three (tools/matrix.py)."""
    part = int(os.environ.get("DS47_SHARE", "0/1").partition("/")[0])
    return list(items[part :: parts()])


def own(items: Sequence[pytest.Item]) -> list[pytest.Item]:
    """The tests of a run: of those that are made for many captures by name, its part; none that are marked."""
    items = [item for item in items if item.get_closest_marker("own") is None]
    made: dict[str, list[pytest.Item]] = {}
    for item in items:
        call = getattr(item, "callspec", None)
        if call is not None and "name" in call.params:
            made.setdefault(item.nodeid.partition("[")[0], []).append(item)
    of_others = {
        item for many in made.values() if len(many) >= MANY for item in set(many) - set(share(many))
    }
    return [item for item in items if item not in of_others]
