"""Which Wireshark is here, which version, and which folders it reads.

Lives here: finding tshark, running it, reading what it says about itself. Not here: what is put
into the folders (`install`) and what can be wrong with them (`doctor`).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

SECONDS = 120
"""How long tshark may take; the first run after an update can be slow, -G fields is long."""


class NoWiresharkError(Exception):
    """No Wireshark was found, or what was found does not answer; the message says which."""


@dataclass(frozen=True, slots=True)
class Folders:
    """The folders that count for a Lua plugin, as Wireshark names them (Help > About > Folders)."""

    personal_lua: Path
    personal_configuration: Path
    global_lua: Path | None = None
    global_configuration: Path | None = None

    def profile(self, name: str) -> Path:
        """The folder of a configuration profile."""
        return self.personal_configuration / "profiles" / name

    def read_for_lua(self) -> list[Path]:
        """Every folder whose *.lua files are loaded at the start, sub-folders included.

        `plugins` beside the settings is the place of old; it is still read (measured: 3.4 to 4.6).
        """
        folders = [self.personal_lua, self.personal_configuration / "plugins"]
        if self.global_lua is not None:
            folders.append(self.global_lua)
        return list(dict.fromkeys(folders))


@dataclass(frozen=True, slots=True)
class Wireshark:
    """A tshark (or wireshark) program and what it says about itself."""

    program: Path
    version: tuple[int, int, int]
    lua: str | None
    """The version of its Lua, empty where it does not say; None for one built without Lua."""
    folders: Folders

    @property
    def version_text(self) -> str:
        """Such as `4.0.17`."""
        return ".".join(map(str, self.version))


@dataclass(frozen=True, slots=True)
class ProgramRun:
    """What a run of the program left behind."""

    status: int
    output: str
    errors: str


def find(program: str | None = None) -> Wireshark:
    """The Wireshark of this machine: `program`, or the first one found that answers.

    Raises NoWiresharkError.
    """
    if program is not None:
        named = shutil.which(program)
        if named is None:
            raise NoWiresharkError(f"{program} is not a program that can be run")
        return ask(Path(named))
    problem = NoWiresharkError("no tshark found, neither on the PATH nor in the usual folders")
    for path in candidates():
        try:
            return ask(path)
        except NoWiresharkError as found:
            problem = found
    raise problem


def candidates(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> Iterator[Path]:
    """The programs worth asking, best first. tshark before wireshark: it has a console."""
    folders = usual_folders(environment, platform)
    suffix = ".exe" if platform == "win32" else ""
    seen = set()
    for name in ("tshark", "wireshark"):
        on_path = shutil.which(name, path=environment.get("PATH"))
        found = [Path(on_path)] if on_path else []
        for path in (*found, *(folder / (name + suffix) for folder in folders)):
            if path not in seen and path.is_file():
                seen.add(path)
                yield path


def usual_folders(environment: Mapping[str, str], platform: str) -> list[Path]:
    """Where installers put Wireshark without putting it on the PATH."""
    home = environment.get("USERPROFILE" if platform == "win32" else "HOME")
    if platform == "win32":
        roots = ["ProgramW6432", "ProgramFiles", "ProgramFiles(x86)"]
        folders = [Path(environment[root], "Wireshark") for root in roots if environment.get(root)]
        if environment.get("LOCALAPPDATA"):
            folders.append(Path(environment["LOCALAPPDATA"], "Programs", "Wireshark"))
        folders.append(Path(environment.get("SystemDrive", "C:") + "\\Program Files", "Wireshark"))
        if home:
            folders.append(Path(home, "scoop", "apps", "wireshark", "current"))
    elif platform == "darwin":
        bundle = Path("Wireshark.app", "Contents", "MacOS")
        folders = [Path("/Applications", bundle)]
        folders += [Path(home, "Applications", bundle)] if home else []
        folders += map(Path, ("/opt/homebrew/bin", "/usr/local/bin", "/opt/local/bin"))
    else:
        folders = [*map(Path, ("/usr/bin", "/usr/local/bin", "/opt/wireshark/bin", "/snap/bin"))]
    return list(dict.fromkeys(folders))


def ask(program: Path) -> Wireshark:
    """What `program` says of its version, its Lua and its folders. Raises NoWiresharkError."""
    about = run(program, "-v")
    version = parse_version(about.output)
    if version is None:
        raise NoWiresharkError(f"{program} does not say that it is Wireshark{_last(about.errors)}")
    listed = run(program, "-G", "folders")
    folders = parse_folders(listed.output)
    if folders is None:
        raise NoWiresharkError(f"{program} does not name its folders{_last(listed.errors)}")
    return Wireshark(program, version, parse_lua(about.output), folders)


def run(program: Path, *arguments: str | Path) -> ProgramRun:
    """Run the program to its end. Raises NoWiresharkError where that cannot be."""
    try:
        result = subprocess.run(
            [str(program), *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired as problem:
        raise NoWiresharkError(f"{program} did not end within {SECONDS} s") from problem
    except OSError as problem:
        raise NoWiresharkError(f"{program} cannot be run: {problem.strerror}") from problem
    return ProgramRun(result.returncode, result.stdout, result.stderr)


def parse_version(text: str) -> tuple[int, int, int] | None:
    """The version in what `-v` prints; None where there is none.

    It begins a line, but not always the first: an init.lua may print before it.
    """
    line = r"^(?:TShark \()?Wireshark\)? v?(\d+)\.(\d+)(?:\.(\d+))?"
    match = re.search(line, text, re.MULTILINE)
    if match is None:
        return None
    return int(match[1]), int(match[2]), int(match[3] or 0)


def parse_lua(text: str) -> str | None:
    """The version of Lua in what `-v` prints, empty where it says none; None: without Lua.

    Up to 4.4 a sentence that is broken anywhere (`with Lua 5.2.4`), in 4.6 a table (`+Lua 5.4.9`).
    """
    words = " ".join(text.split())
    if re.search(r"\bwithout Lua\b|(?<!\S)-Lua\b", words):
        return None
    match = re.search(r"(?:\bwith |(?<!\S)\+)Lua(?: (\d[\d.]*\d))?", words)
    return (match[1] or "") if match else ""


def parse_folders(text: str) -> Folders | None:
    """The folders in what `-G folders` prints: `Label:`, white space, a path; None if not there."""
    named: dict[str, Path] = {}
    for line in text.splitlines():
        label, colon, value = line.partition(":")
        if colon and value.strip():
            named.setdefault(label.strip().lower(), Path(value.strip()))
    configuration = named.get("personal configuration")
    personal = named.get("personal lua plugins") or _unversioned(named.get("personal plugins"))
    if configuration is None or personal is None:
        return None
    return Folders(
        personal,
        configuration,
        named.get("global lua plugins") or _unversioned(named.get("global plugins")),
        named.get("global configuration"),
    )


def _unversioned(folder: Path | None) -> Path | None:
    """The folder for Lua from the one for binary plugins, which ends in the version."""
    if folder is not None and re.fullmatch(r"\d+[.-]\d+", folder.name):
        return folder.parent
    return folder


def _last(errors: str) -> str:
    lines = [line for line in errors.splitlines() if line.strip()]
    return f": {lines[-1].strip()}" if lines else ""
