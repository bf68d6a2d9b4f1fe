"""Where a Lua, or sharkd, is: tests that run one ask here, so that a missing one is treated alike everywhere."""

from __future__ import annotations

import os
import shutil

import pytest

LUAS = ("lua5.2", "lua5.3", "lua5.4")
"""Those of Wireshark 3.4 to 4.6."""


def lua_program(name: str) -> str:
    """The path of a program; skips the test where there is none, fails it where CI promises one."""
    program = shutil.which(name)
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"{name} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"{name} is missing")
    return program
