"""`ds47 lab`: write example captures of a simulated controller and drive.

The scenarios are `ds47.lab`; it needs scapy, which a plain installation does not have.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType

import click

from ds47.capture.special import special
from ds47.cli.common import cannot_write, columns_of, stdout, tell
from ds47.cli.helping import Gathered
from ds47.report.table import table
from ds47.spec.extras import install


@click.group("lab", cls=Gathered)
def command() -> None:
    """Write example captures: scenarios of a simulated controller and drive."""


@command.command("list")
def list_scenarios() -> None:
    """List the scenarios."""
    scenarios = _lab().everything()
    rows = [(name, scenarios[name].title) for name in sorted(scenarios)]
    tell(table(rows, columns_of(), indent=0))


@command.command("write")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path, file_okay=False))
@click.argument("names", metavar="[SCENARIO]...", nargs=-1)
@click.option("--log", is_flag=True, help="Write logs as text instead; of PROFIBUS only.")
def write(folder: Path, names: Sequence[str], log: bool) -> None:
    """Write scenarios, all or those named, into DIR as pcapng files."""
    lab = _lab()
    known = lab.everything()
    of_bus = {name for name in known if name.startswith("profibus-")}
    for name in names:
        if name not in known:
            raise click.UsageError(f"no scenario {name!r}; ds47 lab list shows them")
        if log and name not in of_bus:
            raise click.UsageError(f"--log writes scenarios of PROFIBUS; {name!r} is not one")
    folder.mkdir(parents=True, exist_ok=True)
    stream = stdout()
    for name in names or sorted(of_bus if log else known):
        path = folder / (f"{name}.txt" if log else f"{name}.pcapng")
        _place(partial(lab.write_log if log else lab.write, name), path)
        stream.write(f"{path}\n")


def _place(write: Callable[[Path], object], path: Path) -> None:
    """Writes a file that appears whole or not at all; one that is there stays if it is another one.

    Raises:
        click.ClickException: it is, or it cannot be written.
    """
    from ds47.capture.drafts import draft_of

    draft = draft_of(path)
    try:
        write(draft)
        if not os.path.lexists(path):
            draft.replace(path)
        elif special(path) is not None or path.read_bytes() != draft.read_bytes():
            raise click.ClickException(
                f"{path} is there and is not what the lab writes: move it, or choose another folder"
            )
    except OSError as problem:
        raise cannot_write(str(path), problem) from problem
    finally:
        draft.unlink(missing_ok=True)


def _lab() -> ModuleType:
    try:
        import scapy  # noqa: F401 - asked for before the long imports, for a clear answer

        from ds47 import lab
    except ModuleNotFoundError as problem:
        if (problem.name or "").partition(".")[0] != "scapy":
            raise
        raise click.ClickException(f"the lab needs scapy: {install('lab')}") from problem
    return lab
