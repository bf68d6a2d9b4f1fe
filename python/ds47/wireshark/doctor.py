"""What can be wrong with the plugin in Wireshark: one small check after the other.

Lives here: the checks, each a function from a `Patient` to a `Check` with the mend. Not here: how
they are shown (`ds47.cli.plugin`), and repairing anything: the doctor only looks.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from ds47.version import __version__
from ds47.wireshark import bundle, install
from ds47.wireshark.locate import NoWiresharkError, ProgramRun, Wireshark, find, run

OLDEST = (3, 4)
"""The oldest Wireshark the plugin is tried with."""
STRICT_ROOT = (4, 4)
"""From this version on, scripts of a user are silently ignored for root."""
AS_MODULES = (4, 4)
"""From this version on, a plugin is loaded as a module: a dot in its name means a folder."""

State = Literal["ok", "warning", "wrong", "skipped"]

_ERROR = re.compile(r"Lua Error|Error during loading|Lua: syntax error", re.IGNORECASE)
_SWITCHED_OFF = re.compile(r"^\s*(enable_lua\s*=\s*false|disable_lua\s*=\s*true)\b", re.MULTILINE)
_ROOT_ALLOWED = "run_user_scripts_when_superuser = true"


@dataclass(frozen=True, slots=True)
class Check:
    """What a check found. `warning` is worth knowing; only `wrong` keeps the plugin from working."""

    name: str
    state: State
    text: str
    mend: str | None = None


class Patient:
    """Wireshark and what is installed in it; what is asked of it is asked once."""

    def __init__(self, wireshark: Wireshark) -> None:
        self.wireshark = wireshark
        self.folders = wireshark.folders

    @cached_property
    def sources(self) -> bundle.Sources:
        """The files of the present version."""
        return bundle.plugin_sources()

    @cached_property
    def installed(self) -> list[Path]:
        """The folders into which `ds47 plugin install` put the plugin."""
        return [folder for folder in _targets(self) if install.read_marker(folder) is not None]

    @cached_property
    def copies(self) -> list[Path]:
        """Every copy that Wireshark loads, by the file with which it starts; links followed once."""
        found: dict[Path, Path] = {}
        for folder in self.folders.read_for_lua():
            for path in install.copies(folder):
                found.setdefault(path.resolve(), path)
        return list(found.values())

    @cached_property
    def fields(self) -> ProgramRun:
        """The list of all fields: the plugin's too, where it was loaded."""
        return run(self.wireshark.program, "-G", "fields")

    @cached_property
    def trial(self) -> ProgramRun:
        """A capture with one transaction, dissected."""
        return run(self.wireshark.program, "-n", "-r", self.sources.trial, "-T", "pdml")

    @cached_property
    def loaded(self) -> bool:
        """Whether Wireshark knows the fields of the plugin."""
        return re.search(r"^F\t[^\t]*\tds47\.", self.fields.output, re.MULTILINE) is not None

    @cached_property
    def root(self) -> bool:
        """Whether this runs as root (never on Windows, where Wireshark does not look)."""
        return hasattr(os, "geteuid") and os.geteuid() == 0


def examine(program: str | None = None) -> tuple[Wireshark | None, list[Check]]:
    """Find Wireshark and make every check; without Wireshark there is one, and it is wrong."""
    try:
        wireshark = find(program)
    except NoWiresharkError as problem:
        return None, [_no_wireshark(str(problem))]
    return wireshark, list(examined(Patient(wireshark)))


def examined(patient: Patient) -> Iterator[Check]:
    """Every check; one that Wireshark does not answer is wrong by that."""
    for name, check in CHECKS:
        try:
            yield check(patient)
        except NoWiresharkError as problem:
            yield Check(
                name, "wrong", str(problem), "run that program by hand and see what it says"
            )


def check_found(patient: Patient) -> Check:
    """Which Wireshark this is about."""
    shark = patient.wireshark
    return Check("wireshark", "ok", f"Wireshark {shark.version_text}: {shark.program}")


def check_version(patient: Patient) -> Check:
    """Too old a Wireshark lacks what the plugin needs."""
    oldest = ".".join(map(str, OLDEST))
    if patient.wireshark.version < OLDEST:
        text = f"version {patient.wireshark.version_text} is older than {oldest}"
        return Check("version", "wrong", text, f"install Wireshark {oldest} or later")
    return Check("version", "ok", f"{oldest} or later")


def check_lua(patient: Patient) -> Check:
    """A Wireshark can be built without Lua."""
    lua = patient.wireshark.lua
    if lua is None:
        text = "this Wireshark was built without Lua"
        return Check(
            "lua", "wrong", text, "install the Wireshark of wireshark.org or of your system"
        )
    return Check("lua", "ok", f"with Lua {lua}".rstrip())


def check_switched_off(patient: Patient) -> Check:
    """An init.lua can switch Lua off: the global one, from 4.4 on a personal one too; loading decides."""
    folders = patient.folders
    global_folders = (folders.global_configuration, folders.global_lua, folders.personal_lua)
    for folder in (*global_folders, folders.personal_configuration):
        path = folder / "init.lua" if folder else None
        match = _SWITCHED_OFF.search(_read(path)) if path else None
        if match is not None and not patient.loaded:
            mend = f"take {match[1]!r} out of {path}"
            return Check("switched on", "wrong", f"Lua is switched off in {path}", mend)
    return Check("switched on", "ok", "no init.lua switches Lua off")


def check_installed(patient: Patient) -> Check:
    """The plugin has to be in a folder that Wireshark reads."""
    name = "installed"
    if patient.installed:
        return Check(name, "ok", f"in {patient.installed[0]}")
    if patient.copies:
        copy = patient.copies[0]
        if "." in copy.stem and patient.wireshark.version >= AS_MODULES:
            text = f"Wireshark cannot load {copy}: its name has a dot before .lua"
            return Check(name, "wrong", text, "rename it to ds47.lua")
        return Check(name, "ok", f"by hand: {copy}")
    stray = next(_strays(patient), None)
    if stray is not None:
        text = f"{stray} is in a folder that Wireshark does not read"
        mend = f"{_installing(patient)}, then delete {stray}"
        return Check(name, "wrong", text, mend)
    text = f"nothing in {patient.folders.personal_lua}"
    if (denied := install.obstacle(_target(patient))) is not None:
        text += f", and no right to write into {denied}"
    return Check(name, "wrong", text, _installing(patient))


def check_copies(patient: Patient) -> Check:
    """Two copies: the first that is loaded wins, and it may be the old one."""
    left = [each for folder in _targets(patient) for each in install.leftovers(folder)]
    live = [each for each in left if install.copies(each)]
    if live:
        text = f"left by an installation, and loaded: {install.listed(map(str, live))}"
        return Check("one copy", "wrong", text, _deleting(live))
    if len(patient.copies) > 1:
        others = [path for path in patient.copies if path.parent not in patient.installed]
        text = f"{len(patient.copies)} copies: {', '.join(map(str, patient.copies))}"
        surplus = others if len(others) < len(patient.copies) else others[1:]
        mend = f"delete {', '.join(map(str, surplus))}" if surplus else _leave_one(patient)
        return Check("one copy", "wrong", text, mend)
    return Check("one copy", "ok", "no second copy in the folders that Wireshark reads")


def check_current(patient: Patient) -> Check:
    """An older copy is not brought up to date by pip install."""
    if not patient.installed:
        return Check(
            "current", "skipped", "not put there by ds47 plugin install: cannot be compared"
        )
    folder = patient.installed[0]
    marker = install.read_marker(folder)
    if marker is None:
        return Check("current", "skipped", f"{folder} was removed meanwhile")
    mend = _installing(patient, folder)
    if marker.version != __version__:
        text = f"version {marker.version} is installed, this is ds47 {__version__}"
        return Check("current", "wrong", text, mend)
    touched = install.changed(folder, marker)
    if touched:
        text = f"changed or gone since: {install.listed(touched)}"
        return Check("current", "wrong", text, f"{mend} --force")
    if stale := install.stale(folder, marker, install.plugin_files(patient.sources)):
        return Check("current", "wrong", f"not those of this ds47: {install.listed(stale)}", mend)
    if foreign := install.foreign(folder, marker):
        text = f"version {marker.version}; beside it, not of ds47: {install.listed(foreign)}"
        return Check("current", "warning", text, f"move what is not of ds47 out of {folder}")
    return Check("current", "ok", f"version {marker.version}, nothing changed")


def check_root(patient: Patient) -> Check:
    """Wireshark 4.4 and later ignore a user's scripts for root, and do not say so."""
    if not patient.root:
        return Check("not root", "ok", "an ordinary user")
    if patient.loaded:
        return Check("not root", "ok", "root, but the plugin is loaded all the same")
    if patient.wireshark.version < STRICT_ROOT:
        return Check("not root", "ok", "root, which this version allows")
    text = "as root, Wireshark 4.4 and later ignore the scripts of a user without a word"
    init = (patient.folders.global_lua or patient.folders.personal_lua) / "init.lua"
    mend = f"run as an ordinary user, or put the line {_ROOT_ALLOWED!r} into {init}"
    return Check("not root", "wrong", text, mend)


def check_errors(patient: Patient) -> Check:
    """Lua errors do not change the exit status of tshark: only the text tells."""
    # The list of fields on stdout names one that is called "Lua Error".
    texts = (patient.fields.errors, patient.trial.errors, patient.trial.output)
    seen = list(dict.fromkeys(found for text in texts for found in errors_in(text)))
    ours = [text for text in seen if "ds47" in text.lower()]
    if ours:
        mend = f"{_installing(patient)} --force; if it stays, report it with this text"
        return Check("no Lua error", "wrong", ours[0], mend)
    if seen:
        return Check("no Lua error", "warning", f"of another script: {seen[0]}", "mend that script")
    return Check("no Lua error", "ok", "neither at the start nor on a trial capture")


def check_fields(patient: Patient) -> Check:
    """The fields are there: Wireshark has loaded the plugin."""
    if patient.loaded:
        count = len(re.findall(r"^F\t[^\t]*\tds47\.", patient.fields.output, re.MULTILINE))
        return Check("fields", "ok", f"{count} fields ds47.*")
    text = "Wireshark does not know the fields ds47.*: the plugin was not loaded"
    return Check("fields", "wrong", text, "mend what is wrong above; then look here again")


def check_trial(patient: Patient) -> Check:
    """The plugin shows a parameter of a capture that has one."""
    if not patient.loaded:
        return Check("trial", "skipped", "the plugin is not loaded")
    disabled = _disabled(patient)
    if disabled is not None:
        text = f"the protocol ds47 is disabled in {disabled}"
        return Check("trial", "wrong", text, "enable it under Analyze > Enabled Protocols")
    if 'name="ds47.pnu"' in patient.trial.output:
        return Check("trial", "ok", "shows the parameter of a trial capture")
    text = "loaded, but shows nothing of a trial capture"
    return Check("trial", "wrong", text, "look at Preferences > Protocols > DS47 and PN_IO")


def check_profile(patient: Patient) -> Check:
    """The profile is for comfort: without it nothing is wrong."""
    folder = patient.folders.profile(install.PROFILE)
    marker = install.read_marker(folder)
    if marker is None:
        files = install.profile_files(patient.sources)
        lost = install.not_ours(folder, files)
        if not lost and all((folder / name).is_file() for name in files):
            return Check("profile", "ok", f"{folder}; added by the plugin")
        text = f"{folder} is not of ds47" if lost else "not installed"
        mend = _installing(patient, folder) + (" --force replaces it" if lost else " puts it there")
        return Check("profile", "warning", text, mend)
    if left := install.leftovers(folder):
        text = f"left by an installation: {install.listed(map(str, left))}"
        return Check("profile", "warning", text, _deleting(left))
    if rows := install.outdated(folder, marker):
        text = f"{folder} has rows of what the plugin no longer has: {install.listed(rows)}"
        return Check("profile", "warning", text, _installing(patient, folder))
    if changed := install.changed(folder, marker, missing=False):
        return Check("profile", "ok", f"{folder}; changed by you: {install.listed(changed)}")
    if install.stale(folder, marker, install.profile_files(patient.sources)):
        text = f"of version {marker.version}, not as in this ds47"
        return Check("profile", "warning", text, _installing(patient, folder))
    return Check("profile", "ok", str(folder))


CHECKS: tuple[tuple[str, Callable[[Patient], Check]], ...] = (
    ("wireshark", check_found),
    ("version", check_version),
    ("lua", check_lua),
    ("installed", check_installed),
    ("one copy", check_copies),
    ("current", check_current),
    ("switched on", check_switched_off),
    ("not root", check_root),
    ("no Lua error", check_errors),
    ("fields", check_fields),
    ("trial", check_trial),
    ("profile", check_profile),
)
"""In the order in which they are made: causes before what follows from them."""


def errors_in(text: str) -> list[str]:
    """Each Lua error in what tshark printed, in one line: its first line and where it happened."""
    lines = text.splitlines()
    found = []
    for number, line in enumerate(lines):
        if _ERROR.search(line):
            more = lines[number + 1 : number + 2] if line.rstrip().endswith(":") else []
            found.append(" ".join(part.strip() for part in (line, *more))[:400])
    return found


def _no_wireshark(problem: str) -> Check:
    mend = "install Wireshark (with tshark), or name its tshark: --tshark PROGRAM or DS47_TSHARK"
    return Check("wireshark", "wrong", problem, mend)


def _strays(patient: Patient) -> Iterator[Path]:
    """Copies in folders where people put them but Wireshark does not look."""
    home = Path.home()
    configuration = patient.folders.personal_configuration
    folders = [configuration, home / ".wireshark" / "plugins", home / ".config" / "wireshark"]
    folders += [patient.wireshark.program.parent, configuration / "extcap", configuration / "lua"]
    for each in dict.fromkeys(folders):
        for folder in (each, each / install.FOLDER):
            if install.asked(folder.is_dir):
                yield from (path for path in sorted(folder.glob("*.lua")) if install.is_entry(path))


def _target(patient: Patient) -> Path:
    """The folder where `ds47 plugin install` puts the plugin."""
    return patient.folders.personal_lua / install.FOLDER


def _targets(patient: Patient) -> list[Path]:
    """All folders where it may have put the plugin: one in every folder that Wireshark reads."""
    return [folder / install.FOLDER for folder in patient.folders.read_for_lua()]


def _installing(patient: Patient, folder: Path | None = None) -> str:
    """The command that installs, after the one that gives write permission if that is missing."""
    denied = install.obstacle(folder or _target(patient))
    command = "ds47 plugin install"
    return command if denied is None else f"{install.mend(denied)}, then {command}"


def _deleting(folders: list[Path]) -> str:
    """How to delete folders, after how to get write permission if that is missing."""
    denied = next(filter(None, map(install.obstacle, folders)), None)
    text = f"delete {', '.join(map(str, folders))}"
    return text if denied is None else f"{install.mend(denied)}, then {text}"


def _leave_one(patient: Patient) -> str:
    first, *others = map(str, patient.installed)
    return f"keep {first} and delete {', '.join(others)}"


def _disabled(patient: Patient) -> Path | None:
    """The settings in which the user switched the protocol off, as Enabled Protocols writes them."""
    path = patient.folders.personal_configuration / "disabled_protos"
    names = (line.split("#")[0].strip().lower() for line in _read(path).splitlines())
    return path if "ds47" in names else None


def _read(path: Path) -> str:
    try:
        return path.read_text("utf-8", errors="replace")
    except OSError:
        return ""
