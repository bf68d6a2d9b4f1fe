"""A tshark that says what a test wants it to say, in whatever version; and a plugin to install."""

from __future__ import annotations

import json
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from ds47.wireshark import bundle

ABOUT = """TShark (Wireshark) {version}.

Copyright 1998-2024 Gerald Combs <gerald@wireshark.org> and contributors.

Compiled (64-bit) using GCC 12.2.0, with zlib 1.2.13, with libpcap, {lua}, with GnuTLS 3.7.9.
"""
FIELDS = "P\tDS47\tds47\nF\tParameter number\tds47.pnu\tFT_UINT16\tds47\t\t0x0\t\n"
TRIAL = '<packet><field name="ds47.pnu" show="21"/></packet>\n'

_PROGRAM = """#!{python}
import json, sys
said = json.load(open({state!r}, encoding="utf-8"))
arguments = sys.argv[1:]
kind = "about" if arguments == ["-v"] else arguments[1] if arguments[0] == "-G" else "trial"
out, err = said[kind]
sys.stdout.write(out)
sys.stderr.write(err)
"""


@dataclass
class FakeTshark:
    """What the program says; `save()` makes it so."""

    root: Path
    version: str = "4.2.5"
    lua: str = "with Lua\n5.2.4"
    fields: tuple[str, str] = (FIELDS, "")
    trial: tuple[str, str] = (TRIAL, "")

    @property
    def program(self) -> Path:
        return self.root / "program files" / "tshark"

    @property
    def plugins(self) -> Path:
        return self.root / "a home" / "lib" / "plugins"

    @property
    def settings(self) -> Path:
        return self.root / "a home" / "config"

    @property
    def all_users(self) -> Path:
        return self.root / "usr" / "plugins"

    def save(self) -> FakeTshark:
        folders = (
            f"Temp:                \t/var/tmp\nPersonal configuration:\t{self.settings}\n"
            f"Global configuration:\t{self.root / 'usr' / 'share'}\n"
            f"Personal Lua Plugins:\t{self.plugins}\nGlobal Lua Plugins:  \t{self.all_users}\n"
        )
        self.program.parent.mkdir(parents=True, exist_ok=True)
        state = self.program.with_name("state.json")
        about = ABOUT.format(version=self.version, lua=self.lua)
        said = {"about": (about, ""), "folders": (folders, "Running as user root\n")}
        said |= {"fields": self.fields, "trial": self.trial}
        state.write_text(json.dumps(said), "utf-8")
        self.program.write_text(_PROGRAM.format(python=sys.executable, state=str(state)), "utf-8")
        self.program.chmod(0o755)
        return self


def real_tshark() -> str:
    """The tshark that is really here; without one the test is skipped, in CI it fails."""
    program = os.environ.get("DS47_TSHARK") or shutil.which("tshark")
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail("tshark is missing, and DS47_CI=1 says that it must be there")
        pytest.skip("tshark is missing")
    return program


def stand_in(folder: Path, monkeypatch: pytest.MonkeyPatch, version: int = 1) -> bundle.Sources:
    """A small plugin instead of the real one, as what this ds47 installs."""
    texts = {
        "dissector/ds47.lua": f"-- entry {version}\n",
        "dissector/profile/preferences": f"# preferences {version}\n",
        "dissector/profile/colorfilters": "# colours\n",
        "trial.pcapng": "",
        "LICENSE": "Free\n",
    }
    if version == 1:
        texts["dissector/profile/gone_in_2"] = "# gone\n"
    root = folder / f"sources {version}"
    for name, text in texts.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    modules = {"ds47.lua": root / "dissector/ds47.lua"}
    profile = {path.name: path for path in sorted((root / "dissector/profile").iterdir())}
    sources = bundle.Sources(modules, profile, root / "trial.pcapng", root / "LICENSE")
    monkeypatch.setattr(bundle, "plugin_sources", lambda: sources)
    return sources
