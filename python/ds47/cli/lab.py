"""`ds47 lab`: write example captures of a simulated controller and drive.

The scenarios are `ds47.lab`; it needs scapy, which a plain installation does not have.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import click

from ds47.cli.common import columns_of, stdout, tell
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
            raise click.UsageError(f"--log writes scenarios of PROFIBUS; {name!r} is none")
    folder.mkdir(parents=True, exist_ok=True)
    stream = stdout()
    for name in names or sorted(of_bus if log else known):
        path = folder / (f"{name}.txt" if log else f"{name}.pcapng")
        (lab.write_log if log else lab.write)(name, path)
        stream.write(f"{path}\n")


def _lab() -> ModuleType:
    try:
        import scapy  # noqa: F401 - asked for before the long imports, for a clear answer

        from ds47 import lab
    except ModuleNotFoundError as problem:
        if (problem.name or "").partition(".")[0] != "scapy":
            raise
        raise click.ClickException(f"the lab needs scapy: {install('lab')}") from problem
    return lab
