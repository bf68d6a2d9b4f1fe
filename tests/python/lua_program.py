"""Where a Lua, or sharkd, is: tests that run one ask here, so that a missing one is treated alike everywhere.

And which tests run a Lua, or tshark: by a parameter, a fixture or the name of the file.
"""

from __future__ import annotations

import os
import shutil

import pytest

LUAS = ("lua5.2", "lua5.3", "lua5.4")
"""Those of Wireshark 3.4 to 4.6."""
QUICK = LUAS[-1]
"""The one that the quick tests run; with the others the same tests are slow."""


def luas_of(item: pytest.Item) -> set[str]:
    """The Luas that a test has as parameters, be it "lua5.4" or "5.4"."""
    call = getattr(item, "callspec", None)
    given = [each for each in call.params.values() if isinstance(each, str)] if call else []
    return {f"lua{each.removeprefix('lua')}" for each in given} & set(LUAS)


def runs_another(item: pytest.Item) -> bool:
    """Whether a test starts a Lua or a tshark: it says nothing of the Python that it runs on."""
    named = item.path.name.startswith(("test_lua_", "test_wireshark_"))
    return named or bool(luas_of(item)) or "tshark" in getattr(item, "fixturenames", ())


def lua_program(name: str) -> str:
    """The path of a program; skips the test where there is none, fails it where CI promises one."""
    program = shutil.which(name)
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"{name} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"{name} is missing")
    return program
