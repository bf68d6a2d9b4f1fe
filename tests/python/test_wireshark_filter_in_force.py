"""A display filter that is in force while frames are dissected anew, in a real window that nobody sees.

A script cannot ask how many frames are displayed, so pictures of the status bar are compared: what it says must be
the same when the filter is applied by hand. DS47_WIRESHARK names another Wireshark than the installed one.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
CAPTURES = ROOT / "captures"
FIRST, NEXT = (
    CAPTURES / "real-stacks" / name
    for name in ("o3_two_controllers.pcapng", "o2_pyprofinet_le.pcapng")
)
PROGRAM = os.environ.get("DS47_WIRESHARK", "wireshark")
SIZE = (1366, 720)
COUNTS = "280x20+870+699"
"""Where the status bar says how many frames are displayed."""
NOT_OK = 'ds47.state != "ok"'
SHIFT_BY, APPLY = (640, 219), (810, 425)
"""The field and the button of Edit > Time Shift, which opens in the middle of the main window."""
PREFERENCES, SEARCH, FOUND = (900, 650), (420, 32), ((700, 117), (700, 101))
"""Edit > Preferences > Advanced: the field to search in, and the one line found, in 4.0 and from 4.4 on."""

pytestmark = [pytest.mark.slow, pytest.mark.plugin]


def tool() -> Any:
    """tools/window.py."""
    spec = importlib.util.spec_from_file_location("ds47_window", ROOT / "tools/window.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def shark() -> Iterator[Any]:
    """A window with the first capture and a filter that needs later frames."""
    if sys.platform != "linux":
        pytest.skip("windows are driven on Linux alone")
    window = tool()
    if packages := window.missing(PROGRAM):
        pytest.skip(f"needs the packages {' '.join(packages)}")
    with window.Wireshark(FIRST, "-Y", NOT_OK, program=PROGRAM, size=SIZE) as opened:
        shutil.copy(NEXT, opened.work / "run")
        (opened.work / "run" / NEXT.name).chmod(0o644)
        opened.place(opened.main, *SIZE)
        yield opened
        assert opened.complaints() == ""


def settled(shark: Any) -> bytes:
    """The counts in the status bar, as the points of a picture, once nothing has changed for a while."""
    seen: list[bytes] = []
    for _ in range(30):
        time.sleep(2)
        shark.wait_until_loaded()
        target = shark.work / "counts.png"
        shark.picture(target, crop=COUNTS)
        drawn = subprocess.run(
            ["convert", target, "-threshold", "60%", "gray:-"], capture_output=True, check=True
        )
        seen.append(drawn.stdout)
        if len(seen) > 2 and len(set(seen[-3:])) == 1:
            return seen[-1]
    raise AssertionError("the status bar does not come to rest")


def by_hand(shark: Any) -> bytes:
    """The same when another filter and then this one is applied, as a user does who does not trust the list."""
    shark.focus(shark.main)
    for text in ("frame", NOT_OK):
        shark.keys("ctrl+slash", "ctrl+a")
        shark.type(text)
        shark.keys("Escape", "Return", wait=2)
    return settled(shark)


def reload(shark: Any) -> None:
    """View > Reload."""
    shark.focus(shark.main)
    shark.keys("ctrl+r")


def open_next(shark: Any) -> None:
    """File > Open."""
    shark.focus(shark.main)
    shark.keys("ctrl+o")
    shark.focus(shark.window("Open Capture"))
    shark.keys("ctrl+a")
    shark.type(str(shark.work / "run" / NEXT.name))
    shark.keys("Return")
    shark.window(NEXT.name)


def shift(shark: Any) -> None:
    """Edit > Time Shift by a second."""
    shark.focus(shark.main)
    shark.keys("ctrl+shift+t")
    dialog = shark.window("Time Shift")
    shark.focus(dialog)
    shark.click(*SHIFT_BY)
    shark.type("1")
    shark.click(*APPLY)
    time.sleep(1)
    shark.close_window(dialog)


def prefer(shark: Any) -> None:
    """Edit > Preferences: a Boolean one is another when its line is clicked twice."""
    shark.focus(shark.main)
    shark.keys("ctrl+shift+p")
    dialog = shark.window("Preferences")
    shark.place(dialog, *PREFERENCES)
    shark.focus(dialog)
    shark.keys("End")
    shark.click(*SEARCH)
    shark.type("ds47.assume_sinamics")
    for line in FOUND:
        shark.click(*line, repeat=2)
    shark.keys("Return", wait=1)
    assert dialog not in shark.windows()


@pytest.mark.parametrize("anew", [reload, open_next, shift, prefer])
def test_the_list_is_complete_by_itself(shark: Any, anew: Callable[[Any], None]) -> None:
    assert settled(shark) == by_hand(shark), "as it was opened"
    anew(shark)
    assert settled(shark) == by_hand(shark)
