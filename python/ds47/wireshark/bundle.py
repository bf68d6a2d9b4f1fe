"""What the plugin consists of, and all of it as one Lua file.

Lives here: finding the Lua files of this package or checkout, and joining them. One file, because
Wireshark runs every *.lua below its plugins folder, sub-folders first and modules too: a module
would run before the entry has said where its modules are. Not here: where the file goes (`install`).
"""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZipFile

from ds47.version import __version__

ENTRY = "ds47.lua"
FILE_NAME = f"ds47-{__version__.replace('.', '_')}.lua"
"""What the file is called where it is given to people. No dot before `.lua`: from version 4.4 on
Wireshark loads a plugin as a module, and a dot in the name of a module means a folder."""

HEADER = """\
-- ds47 {version}: the PROFIdrive parameter channel (record index 47, 0xB02E, 0xB02F) in Wireshark.
--
-- The whole plugin in one file, for Wireshark 3.4 and later. Put it into the folder that Wireshark
-- names under Help > About Wireshark > Folders > Personal Lua Plugins, delete older copies there,
-- and start Wireshark again. Its name may be another, but without a dot before ".lua". Or for one
-- run: tshark -X lua_script:FILE -r CAPTURE
--
-- Made from the folders dissector/ and lua/ of the ds47 repository: change those, not this.
--
{licence}
"""

# Where another copy runs already, its modules stay the ones that its later require() calls find.
# Modules stand there as text: what is not used is not compiled, and the collector of Lua sees one string
# instead of a thousand objects. A message of Lua names the module and its line.
_OPEN = """\
if not package.loaded["ds47.spec.tables"] then
local function module(name, file, text)
  package.preload[name] = function(...)
    return assert(load(text, "@" .. file))(...)
  end
end
"""
_BRACKET = "===="
PROFILE_MODULE = "ds47_ws/profile_files.lua"
"""The module of the single file that holds the profile; dissector/ds47_ws/profile.lua asks for it."""

# Wireshark 4.4 and later load a plugin as a module: its arguments are its name and its path then.
_START = """\

local _, path = ...
if path and "@" .. path == debug.getinfo(1, "S").source then
  start()
else
  start(...) -- those of -X lua_script1:ARGUMENT
end
"""


@dataclass(frozen=True, slots=True)
class Sources:
    """The files of the plugin."""

    modules: Mapping[str, Path]
    """Path as `require` knows it, with `/` and `.lua` (`ds47/support/bytes.lua`) -> file; and the entry."""
    profile: Mapping[str, Path]
    """Name of a file of the Wireshark profile -> file."""
    trial: Path
    """A small capture with one transaction, to try the plugin on."""
    licence: Path


def plugin_sources() -> Sources:
    """The files of the installed package, or of the checkout from which it runs.

    Raises FileNotFoundError where neither has them.
    """
    packed, checkout = _packed(), Path(__file__).resolve().parents[3]
    for root, trial in (
        (packed, packed / "trial.pcapng"),
        (checkout, checkout / "captures" / "record-global.pcapng"),
    ):
        dissector, pure = root / "dissector", root / "lua" / "ds47"
        if (dissector / ENTRY).is_file() and pure.is_dir():
            modules = {
                ENTRY: dissector / ENTRY,
                **_below(dissector / "ds47_ws", "ds47_ws/", "*.lua"),
                **_below(pure, "ds47/", "*.lua"),
            }
            profile = _below(dissector / "profile", "", "*")
            return Sources(modules, profile, trial, root / "LICENSE")
    raise FileNotFoundError("this installation of ds47 does not hold the Wireshark plugin")


def _packed() -> Path:
    """The folder of the plugin in the package; where that is a zip file, a copy that lasts as long as the program.

    tshark reads it, too.
    """
    here = Path(__file__).resolve().with_name("plugin")
    archive = getattr(__spec__.loader, "archive", None)
    return here if archive is None else _unpacked(archive, "ds47/wireshark/plugin")


@cache
def _unpacked(archive: str, folder: str) -> Path:
    target = TemporaryDirectory(prefix="ds47-")
    atexit.register(target.cleanup)
    with ZipFile(archive) as opened:
        opened.extractall(
            target.name, [name for name in opened.namelist() if name.startswith(f"{folder}/")]
        )
    return Path(target.name, folder)


def bundle(sources: Sources) -> str:
    """The whole plugin as the text of one Lua file; equal sources give equal text."""
    modules = sorted(name for name in sources.modules if name != ENTRY)
    parts = [_header(sources), _OPEN]
    parts += (
        _module(name, _text(sources.modules[name]), sources.modules[name]) for name in modules
    )
    parts += [_module(PROFILE_MODULE, _profile(sources), PROFILE_MODULE)]
    parts += ["end\n", "\n-- The entry.\nlocal function start(...)\n"]
    parts += [_text(sources.modules[ENTRY]), "end\n", _START]
    return "".join(parts)


def _header(sources: Sources) -> str:
    lines = sources.licence.read_text("utf-8").splitlines()
    licence = "\n".join(f"-- {line}".rstrip() for line in lines)
    return HEADER.format(version=__version__, licence=licence)


def _profile(sources: Sources) -> str:
    """The files of the profile as a module: who has only this file has the profile, too."""
    files = ((name, _text(path)) for name, path in sorted(sources.profile.items()))
    lines = (f'  ["{name}"] = [==[\n{text}]==],\n' for name, text in files)
    return f"return {{\n{''.join(lines)}}}\n"


def _module(name: str, text: str, source: object) -> str:
    """A module as text, to be compiled when asked for. ValueError where the text would end early."""
    dotted = name.removesuffix(".lua").replace("/", ".")
    if f"]{_BRACKET}]" in text:
        raise ValueError(f"{source}: contains ]{_BRACKET}]")
    # A line feed after the opening bracket is none of the text: lines keep their numbers.
    return f'\nmodule("{dotted}", "{name}", [{_BRACKET}[\n{text}]{_BRACKET}])\n'


def _text(path: Path) -> str:
    text = path.read_text("utf-8")  # a checkout on Windows may have CRLF: read as LF
    return text if text.endswith("\n") else text + "\n"


def _below(folder: Path, prefix: str, pattern: str) -> dict[str, Path]:
    paths = (path for path in sorted(folder.rglob(pattern)) if path.is_file())
    return {prefix + path.relative_to(folder).as_posix(): path for path in paths}
