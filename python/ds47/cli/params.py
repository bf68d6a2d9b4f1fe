"""`ds47 params`: lists of parameters taken in, looked up, listed and removed.

Reading and keeping them is `ds47.parameters`; here is what people read. Exit status: 0 done, 1 nothing of that
name is known, 2 wrong use, 3 a list that cannot be read.
"""

from __future__ import annotations

import os
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import fail, format_option, lang_option, stdout, tell, vendor_number, warn
from ds47.cli.helping import Gathered
from ds47.profidrive.naming import spelled
from ds47.report.bilingual import say
from ds47.report.formatting import escape

if TYPE_CHECKING:
    from ds47.parameters.lists import ParameterList
    from ds47.report.known import SourceEntry

_UNREADABLE = 3
_SHOWN = 12
"""Rows that were passed over and are shown; of more the number."""


class _Params(Gathered):
    """`params p1120` is `params show p1120`, and so is any word that no command resembles."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click; a word that is a parameter, or may be in the name of one, is looked up."""
        word = args[0]
        meant = word in self.commands or get_close_matches(word, self.commands)
        if spelled(word) is not None or not meant:
            args = ["show", *args]
        return super().resolve_command(ctx, args)


@click.group("params", cls=_Params)
def command() -> None:
    """Look parameters up; import lists of makers and tools."""


@command.command("import")
@click.argument("path", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--columns", metavar="KEY=HEADING,...",
    help="Columns by their headings: number=Param,name=Text,unit=..,type=..,access=..,values=..",
)  # fmt: skip
@click.option("--sheet", metavar="NAME", help="Of a workbook; else its first one.")
@click.option("--name", metavar="NAME", help="Of the list; else that of the file.")
@click.option("--vendor", metavar="NAME|ID", help="Vendor of the devices: SINAMICS, ABB, 0x002A.")
@click.option(
    "--device-id",
    "device_ids",
    metavar="ID",
    multiple=True,
    help="PROFINET device id, more than once.",
)
@click.option("--firmware", metavar="VERSION", help="Of the device, such as 4.7.")
@lang_option
def take(
    path: Path,
    columns: str | None,
    sheet: str | None,
    name: str | None,
    vendor: str | None,
    device_ids: tuple[str, ...],
    firmware: str | None,
    lang: str,
) -> int:
    """Import a list of parameters: CSV, XLSX or TOML.

    Reports name these parameters on such devices from then on. A list of the same name is replaced.
    The forms of lists: docs/parameters.md.
    """
    from ds47.parameters import lists, store

    mapping = _columns(columns)
    try:
        found = lists.read(path, mapping, sheet)
        _about(found, name, vendor, device_ids, firmware)
        saved_to, replaced = store.save(found)
    except lists.ListError as problem:
        fail(str(problem))
        return _UNREADABLE
    counts = say(
        "params_counts", n=len(found.rows), messages=say("params_messages", n=len(found.messages))
    )
    key = "params_replaced" if replaced else "params_taken"
    tell([say(key, name=escape(found.name), counts=counts, place=str(saved_to)).text(lang)])
    for line in found.passed_over[:_SHOWN]:
        warn(say("params_passed_over", what=escape(line)).text(lang))
    if len(found.passed_over) > _SHOWN:
        warn(say("params_more_passed_over", n=len(found.passed_over) - _SHOWN).text(lang))
    return 0


def _columns(text: str | None) -> dict[str, str]:
    from ds47.parameters.columns import COLUMNS

    found = {}
    for part in (text or "").split(","):
        key, sign, heading = part.partition("=")
        if not part.strip():
            continue
        if not sign or key.strip() not in COLUMNS or not heading.strip():
            raise click.BadParameter(
                f"{part!r}: wants KEY=HEADING; keys are {', '.join(COLUMNS)}",
                param_hint="--columns",
            )
        found[key.strip()] = heading.strip()
    return found


def _about(
    found: ParameterList,
    name: str | None,
    vendor: str | None,
    device_ids: tuple[str, ...],
    firmware: str | None,
) -> None:
    """Which devices a list is for, as the options say; what they leave out stays as the file has it."""
    found.name = name or found.name
    found.firmware = firmware or found.firmware
    if vendor is not None:
        found.vendor_id = vendor_number(vendor)
    if device_ids:
        try:
            found.device_ids = tuple(int(each, 0) for each in device_ids)
        except ValueError as problem:
            raise click.BadParameter(
                f"{', '.join(device_ids)}: wants numbers", param_hint="--device-id"
            ) from problem


@command.command("show")
@click.argument("words", metavar="NUMBER|WORD...", nargs=-1, required=True)
@lang_option
@format_option("text", "json")
def show(words: tuple[str, ...], lang: str, format_name: str) -> int:
    """Look up a parameter or message: 2900, r0945, F07900.

    A word lists the names that contain it.
    """
    from ds47.report import known

    found = looked_up(" ".join(words), lang)
    if found is None:
        return _UNREADABLE
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text

        stream.write(text([each._asdict() for each in found]) + "\n")
    elif found:
        tell(known.lines(found))
    if not found:
        fail(say("params_unknown", text=escape(" ".join(words))).text(lang))
        return 1
    return 0


def looked_up(text: str, lang: str) -> list[SourceEntry] | None:
    """What is known of a number or a word; None, and a warning, where a list cannot be read."""
    from ds47.parameters import lists, store
    from ds47.parameters.catalogue import Catalogue
    from ds47.report import known

    try:
        catalogue = Catalogue(found for _, found in store.kept())
    except lists.ListError as problem:
        fail(str(problem))
        return None
    return known.known(text, catalogue, lang)


@command.command("list")
@lang_option
@format_option("text", "json")
def listed(lang: str, format_name: str) -> int:
    """Name the imported lists."""
    from ds47.parameters import lists, store

    try:
        kept = store.kept()
    except lists.ListError as problem:
        fail(str(problem))
        return _UNREADABLE
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text

        stream.write(text([_plain(path, found) for path, found in kept]) + "\n")
        return 0
    from ds47.report.known import about

    for path, found in kept:
        counts = say(
            "params_counts",
            n=len(found.rows),
            messages=say("params_messages", n=len(found.messages)),
        )
        tell([f"{escape(found.name)}: {counts.text(lang)}; {about(found, lang)}; {path}"])
    if not kept:
        tell([say("params_no_list", folder=str(store.folder())).text(lang)])
    return 0


def _plain(path: Path, found: ParameterList) -> dict[str, Any]:
    return {
        "name": found.name, "vendor_id": found.vendor_id, "device_ids": list(found.device_ids),
        "firmware": found.firmware, "source": found.source, "parameters": len(found.rows),
        "messages": len(found.messages), "path": str(path),
    }  # fmt: skip


@command.command("export")
@click.argument(
    "path",
    metavar="[FILE]",
    required=False,
    type=click.Path(path_type=Path, dir_okay=False, allow_dash=True),
)
@click.option(
    "--wireshark", is_flag=True, help="Beside the installed plugin, which reads it there."
)
@click.option(
    "--folder",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help="With --wireshark: the plugins folder, instead of the one that Wireshark names.",
)
@lang_option
def export(path: Path | None, wireshark: bool, folder: Path | None, lang: str) -> int:
    """Write the imported lists as one file for the Wireshark plugin."""
    from ds47.parameters import lists, store, table

    if (path is None) != wireshark:
        raise click.UsageError(say("params_export_where").text(lang))
    try:
        kept = [found for _, found in store.kept()]
    except lists.ListError as problem:
        fail(str(problem))
        return _UNREADABLE
    if wireshark:
        path = _beside_plugin(folder, lang)
    if path is None:
        return 1
    text, stream = table.text(kept), stdout()
    if str(path) == "-":
        stream.write(text)
        return 0
    try:
        path.write_text(text, "utf-8", newline="\n")
    except OSError as problem:
        fail(f"{path}: {problem.strerror or problem}")
        return _UNREADABLE
    tell([say("params_exported", n=len(kept), place=str(path)).text(lang)])
    return 0


def _beside_plugin(folder: Path | None, lang: str) -> Path | None:
    """Where the plugin looks for lists; None, and said, where it is not installed."""
    from ds47.wireshark import install
    from ds47.wireshark.locate import NoWiresharkError, find

    if folder is None:
        try:
            folder = find(os.environ.get("DS47_TSHARK") or None).folders.personal_lua
        except NoWiresharkError as problem:
            fail(f"{problem}. Try: --folder DIR, the plugins folder")
            return None
    plugin = folder / install.FOLDER
    if install.read_marker(plugin) is None:
        fail(say("params_no_plugin", folder=str(plugin)).text(lang))
        return None
    return plugin / install.LISTS


@command.command("remove")
@click.argument("name")
@lang_option
def remove(name: str, lang: str) -> int:
    """Remove an imported list."""
    from ds47.parameters import lists, store

    try:
        path = store.remove(name)
    except lists.ListError as problem:
        fail(str(problem))
        return 1
    tell([say("params_removed", path=str(path)).text(lang)])
    return 0
