"""`ds47 plugin`: the Wireshark plugin into Wireshark, out of it, and what is wrong with it.

The work is done in `ds47.wireshark`; here is what people read. Exit status: 0 all well, 1 something
is not (not installed, or a check found something), 2 wrong use, 3 no Wireshark.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ds47.cli.common import counted, fail, refused, stdout, warn
from ds47.cli.helping import Gathered
from ds47.version import __version__

if TYPE_CHECKING:
    from ds47.wireshark.bundle import Sources
    from ds47.wireshark.doctor import Check
    from ds47.wireshark.install import InstallOutcome
    from ds47.wireshark.locate import Wireshark

_NO_WIRESHARK = 3
_SIGNS = {"ok": "ok", "warning": "note", "wrong": "WRONG", "skipped": "-"}

_tshark_option = click.option(
    "--tshark",
    metavar="PROGRAM",
    envvar="DS47_TSHARK",
    help="The tshark to ask.  [default: on the PATH or in a usual folder] [env: DS47_TSHARK]",
)
_folder_option = click.option(
    "--folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="The plugins folder, instead of the one that Wireshark names.",
)


@click.group("plugin", cls=Gathered)
def command() -> None:
    """Install the Wireshark plugin, remove it, check it."""


@command.command("install")
@_folder_option
@click.option("--no-profile", is_flag=True, help="The plugin only, not the profile DS47.")
@click.option(
    "--force", is_flag=True, help="Replace files that are not from ds47, or that you changed."
)
@_tshark_option
def install(folder: Path | None, no_profile: bool, force: bool, tshark: str | None) -> int:
    """Copy the plugin and the profile DS47 into Wireshark's folders."""
    from ds47.wireshark import install as files

    sources = _sources()
    shark = _find(tshark, needed=folder is None)
    plugins = _plugins(folder, shark)
    if plugins is None:
        return _NO_WIRESHARK
    stream = stdout()
    try:
        outcome = files.install_plugin(plugins, sources, force)
        stream.write(_installed(f"plugin {__version__}", outcome))
    except files.RefusedError as problem:
        fail(str(problem))
        return 1
    status = 0 if no_profile else _install_profile(shark, force)
    status |= _warn_of_left(outcome)
    for copy in files.copies(plugins):
        if copy.parent not in (outcome.folder, outcome.left):
            fail(f"a second copy of the plugin is there. Try: delete {copy}")
            status = 1
    stream.write("Next: start Wireshark again, or Analyze > Reload Lua Plugins.\n")
    if not no_profile and shark is not None and not status:
        stream.write("      The profile DS47 is chosen at the right end of the status bar.\n")
    stream.write("      ds47 plugin doctor looks whether it works.\n")
    return status


@command.command("uninstall")
@_folder_option
@click.option("--force", is_flag=True, help="Remove the profile even if you changed it.")
@_tshark_option
def uninstall(folder: Path | None, force: bool, tshark: str | None) -> int:
    """Remove what `ds47 plugin install` wrote, nothing else."""
    from ds47.wireshark import install as files

    shark = _find(tshark, needed=folder is None)
    plugins = _plugins(folder, shark)
    if plugins is None:
        return _NO_WIRESHARK
    targets = {"plugin": (plugins / files.FOLDER, False)}
    if shark is not None:
        targets["profile"] = (shark.folders.profile(files.PROFILE), not force)
    status = 0
    for what, (target, keep_changed) in targets.items():
        try:
            stdout().write(_removed(what, files.uninstall(target, keep_changed)))
        except files.RefusedError as problem:
            fail(str(problem))
            status = 1
    return status


@command.command("path")
@_tshark_option
def path(tshark: str | None) -> int:
    """Print the folders of Wireshark and of the plugin."""
    from ds47.wireshark import install as files

    shark = _find(tshark, needed=True)
    if shark is None:
        return _NO_WIRESHARK
    folders = shark.folders
    rows = (
        ("tshark", shark.program),
        ("plugin", folders.personal_lua / files.FOLDER),
        ("profile", folders.profile(files.PROFILE)),
        ("plugins of all users", folders.global_lua),
        ("comes from", _sources().modules["ds47.lua"].parent),
    )
    stdout().writelines(f"{name + ':':<22}{value}\n" for name, value in rows if value)
    return 0


@command.command("doctor")
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
@_tshark_option
def doctor(format_name: str, tshark: str | None) -> int:
    """Check for the usual faults, and say how to fix them."""
    from ds47.wireshark.doctor import examine

    _sources()
    shark, checks = examine(tshark)
    if format_name == "json":
        stdout().write(_doctor_json(shark, checks))
    else:
        stdout().write("".join(map(_line, checks)))
    if shark is None:
        return _NO_WIRESHARK
    return 1 if any(check.state == "wrong" for check in checks) else 0


def _install_profile(shark: Wireshark | None, force: bool) -> int:
    from ds47.wireshark import install as files

    if shark is None:
        warn("the profile was not installed: no Wireshark that would name its settings folder")
        return 0
    sources = _sources()
    if not sources.profile:
        return 0
    try:
        outcome = files.install_profile(shark.folders.profile(files.PROFILE), sources, force)
    except files.RefusedError as problem:
        fail(str(problem))
        return 1
    stdout().write(_installed("profile DS47", outcome))
    return _warn_of_left(outcome)


def _warn_of_left(outcome: InstallOutcome) -> int:
    """Says that the old files are still there, under another name; returns the exit status."""
    if outcome.left is None:
        return 0
    fail(f"what was there before could not be removed. Try: delete {outcome.left}")
    return 1


def _find(program: str | None, needed: bool) -> Wireshark | None:
    from ds47.wireshark.locate import NoWiresharkError, find

    try:
        shark = find(program)
    except NoWiresharkError as problem:
        if needed or program is not None:
            fail(f"{problem}. Try: --tshark PROGRAM, or install --folder DIR")
        return None
    return shark


def _plugins(folder: Path | None, shark: Wireshark | None) -> Path | None:
    if folder is None and shark is not None:
        return shark.folders.personal_lua
    return folder


def _sources() -> Sources:
    from ds47.wireshark import bundle

    with refused(FileNotFoundError):
        return bundle.plugin_sources()


def _installed(what: str, outcome: InstallOutcome) -> str:
    before = f", {outcome.replaced} replaced" if outcome.replaced else ""
    lines = [f"{what}: {outcome.folder} ({counted(outcome.written, 'file')}{before})"]
    if outcome.kept:
        lines.append(f"  kept, because you changed them: {_listed(outcome.kept)}")
    if outcome.foreign:
        lines.append(f"  left there, not of ds47: {_listed(outcome.foreign)}")
    return "\n".join(lines) + "\n"


def _removed(what: str, outcome: InstallOutcome | None) -> str:
    if outcome is None:
        return f"{what}: nothing there that ds47 plugin install wrote\n"
    if not outcome.removed:
        why = _listed([*outcome.kept, *outcome.foreign])
        return f"{what}: kept, because {why} changed in {outcome.folder} (--force removes it)\n"
    text = f"{what}: removed from {outcome.folder} ({counted(outcome.removed, 'file')})\n"
    if outcome.foreign:
        names = _listed(outcome.foreign)
        text += (
            f"  left there, not of ds47: {names}; delete {outcome.folder} if you do not need it\n"
        )
    return text


def _line(check: Check) -> str:
    mend = f"{'':<21}-> {check.mend}\n" if check.mend else ""
    return f"{_SIGNS[check.state]:<6} {check.name:<13} {check.text}\n{mend}"


def _doctor_json(shark: Wireshark | None, checks: list[Check]) -> str:
    from ds47.report.json import laid_out

    content = {
        "ok": not any(check.state == "wrong" for check in checks),
        "wireshark": shark and {"program": str(shark.program), "version": shark.version_text},
        "checks": [asdict(check) for check in checks],
    }
    return laid_out(content, indent=2)


def _listed(names: list[str]) -> str:
    from ds47.wireshark.install import listed

    return listed(names)
