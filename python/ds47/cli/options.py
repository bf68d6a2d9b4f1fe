"""The options of every command that analyses captures.

Turns the command line into `ds47.analysis.AnalysisOptions`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.core import ParameterSource

from ds47.cli.common import (
    codec_options,
    dialect_options,
    fail,
    lang_option,
    refused,
    vendor_number,
)
from ds47.model import CHANNELS, SEVERITIES

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions
    from ds47.batch.tasks import Task
    from ds47.cyclic.named import Name
    from ds47.parameters.expected import Expectation
    from ds47.parameters.lists import ParameterList
    from ds47.report.zones import Zone
    from ds47.s7.choices import Choices

Made = TypeVar("Made")
Function = TypeVar("Function", bound=Callable[..., Any])


def _zone(_context: click.Context, _parameter: click.Parameter, text: str) -> Zone:
    from ds47.report.zones import zone

    with refused(ValueError, said="--tz ", usage=True):
        return zone(text)


def zone_for_paths(where: Zone, paths: Sequence[str]) -> Zone:
    """The zone of --tz; without that option, the zone of the `ds47.toml` beside the captures.

    Errors in that file are reported with the captures.
    """
    from ds47.batch.settings import zone_for
    from ds47.capture import CaptureError

    if click.get_current_context().get_parameter_source("where") is not ParameterSource.DEFAULT:
        return where
    try:
        return zone_for(paths) or where
    except CaptureError:
        return where


tz_option = click.option(
    "--tz",
    "where",
    metavar="ZONE",
    default="local",
    show_default=True,
    callback=_zone,
    help="Time zone: Europe/Berlin, UTC, +02:00 or local.",
)


fail_on_option = click.option(
    "--fail-on",
    type=click.Choice(["never", *SEVERITIES]),
    metavar="SEVERITY",
    default="never",
    show_default=True,
    help="Exit with 1 at or above: note, warning, error.",
)


jobs_option = click.option(
    "-j",
    "--jobs",
    type=click.IntRange(min=0),
    metavar="N",
    help="Captures analysed at once; 0: one per core.  [default: automatic]",
)


def each_of(
    function: Callable[[Task], Made], found: Iterable[Task], jobs: int | None
) -> Iterator[tuple[Task, Made]]:
    """Each task with what the function makes of it, in their order, in as many processes as `--jobs` says."""
    from ds47.batch.cores import cores, useful_jobs

    tasks = list(found)
    number = useful_jobs(tasks) if jobs is None else jobs or cores()
    if number <= 1:
        yield from ((task, function(task)) for task in tasks)
        return
    from ds47.batch.endings import Failed
    from ds47.batch.local import in_order  # takes longer to import than a small capture to check
    from ds47.capture import CaptureError

    with refused(CaptureError, Failed):
        yield from zip(tasks, in_order(function, tasks, number), strict=True)


require_option = click.option(
    "--require",
    "required",
    type=click.Choice(["transactions"]),
    help="Exit with 1 if a capture has no transaction.",
)


expect_option = click.option(
    "--expect",
    metavar="LIST",
    help="Compare parameters with a golden list: TOML, CSV, XLSX, or -f parameters of a good machine.",
)


def tell_empty(paths: Sequence[str], lacking: str) -> None:
    """Says which captures lack something."""
    from ds47.capture.names import about

    for path in paths:
        fail(about(path, lacking))


_SPELLED = {"opens": "open", "show_all": "all", "everything": "all"}


def refuse_without_effect(format_name: str, only_in: Mapping[str, Sequence[str]]) -> None:
    """An option that a format does not know is refused: whoever gives it waits for its effect.

    Args:
        format_name: the format that is written.
        only_in: the names of options, and the formats that know them.

    Raises:
        click.UsageError: one is given.
    """
    context = click.get_current_context()
    for name, formats in only_in.items():
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if given and format_name not in formats:
            raise click.UsageError(
                f"--{_SPELLED.get(name, name)} has no effect in {format_name}, only in {', '.join(formats)}"
            )


def heading_options(function: Function) -> Function:
    """Adds --title, --order, --customer, --author."""
    for name, about in (
        ("author", "Author (html)."),
        ("customer", "Customer (html)."),
        ("order", "Order number (html)."),
        ("title", "What the report is about, for its title block (html)."),
    ):
        function = click.option(f"--{name}", default="", metavar="TEXT", help=about)(function)
    return function


def analysis_options(function: Function) -> Function:
    """Adds --select, --ignore, --index, --lang, --slow, --params, --vendor, --channels, and their companions."""
    for option in (
        dialect_options,
        s7_options,
        click.option(
            "--pkw-layout",
            "pkw_layouts",
            multiple=True,
            metavar="[IP=]LAYOUT",
            help="Byte of IND that has the page: cyclic (low) or uss (high).",
        ),
        click.option(
            "--cyclic",
            multiple=True,
            metavar="MAC@ID:AT:KIND",
            help="Channel whose Connect is missing; once per direction (docs/cyclic.md).",
        ),
        click.option(
            "--ppo",
            "ppos",
            multiple=True,
            metavar="STATION=PPO",
            help="PPO type of a station if Chk_Cfg is missing: 3=ppo1.",
        ),
        click.option(
            "--channels",
            metavar="NAMES",
            default=",".join(CHANNELS),
            show_default=True,
            help="Channels to report.",
        ),
        click.option(
            "--vendor",
            metavar="NAME|ID",
            help="Vendor to assume when the capture names none.",
        ),
        click.option(
            "--params",
            "lists",
            multiple=True,
            metavar="FILE",
            help="Parameter list for missing names (docs/parameters.md).",
        ),
        click.option(
            "--slow", type=float, metavar="MS", help="Limit for a slow transaction, in ms."
        ),
        lang_option,
        click.option(
            "--index", "indices", multiple=True, metavar="N", help="Another record index."
        ),
        click.option(
            "--ignore",
            multiple=True,
            metavar="RULE",
            help="Not these rules (DS204, DS2, or a name).",
        ),
        click.option(
            "--select",
            multiple=True,
            metavar="RULE",
            help="Only these rules (DS301, DS3, or a name).",
        ),
    ):
        function = option(function)
    return function


def s7_options(function: Function) -> Function:
    """Adds --s7-port, --s7-cpu, --s7-block, --s7-readback."""
    for option in (
        click.option(
            "--s7-readback",
            is_flag=True,
            help="Report values that are not read as they were written (DS916).",
        ),
        click.option(
            "--s7-block",
            "s7_blocks",
            multiple=True,
            metavar="[IP=]BYTES",
            help="The same in bytes: how many a CPU copies at once.",
        ),
        click.option(
            "--s7-cpu",
            "s7_cpus",
            multiple=True,
            metavar="[IP=]CPU",
            help="Kind of CPU: s7-300, s7-400, s7-1500 and others (docs/s7.md).",
        ),
        click.option(
            "--s7-port",
            "s7_ports",
            multiple=True,
            type=click.IntRange(1, 0xFFFF),
            metavar="N",
            help="Another TCP port of S7 servers, besides 102.",
        ),
    ):
        function = option(function)
    return function


def options_from(
    select: Sequence[str],
    ignore: Sequence[str],
    indices: Sequence[str],
    slow: float | None,
    pkw_layouts: Sequence[str],
    channels: str,
    cyclic: Sequence[str],
    ppos: Sequence[str],
    s7_ports: Sequence[int],
    s7_cpus: Sequence[str],
    s7_blocks: Sequence[str],
    s7_readback: bool,
    legacy_g120_formats: bool,
    profile_v3_types: bool,
    vendor: str | None = None,
    lists: Sequence[str] = (),
    kept_lists: bool = False,
    **others: Any,
) -> AnalysisOptions:
    """The options of an analysis from those of the command line.

    With `kept_lists` the user's imported lists of parameters count, too. A comparison with a stored result must
    not use them, as another user may have stored it.

    Raises:
        click.UsageError: an impossible rule, index, limit, layout or channel.
    """
    from ds47.analysis import AnalysisOptions

    if slow is not None:
        if not 0 <= slow < math.inf:
            raise click.UsageError(f"--slow {slow:g} is not a limit: give milliseconds, 0 or more")
        others["slow_ms"] = slow
    return AnalysisOptions(
        select=known_rules(select),
        ignore=known_rules(ignore),
        indices=frozenset(map(_index, indices)),
        codec=codec_options(legacy_g120_formats, profile_v3_types),
        pkw_layouts=tuple(map(_layout, pkw_layouts)),
        channels=_channels(channels),
        cyclic=_named(cyclic),
        ppos=_ppos(ppos),
        s7=_s7(s7_ports, s7_cpus, s7_blocks, s7_readback),
        vendor_id=None if vendor is None else vendor_number(vendor),
        lists=_lists(lists, kept_lists),
        **others,
    )


def _lists(names: Sequence[str], kept: bool) -> tuple[ParameterList, ...]:
    """The imported lists, then the named ones, which win."""
    if not names and not kept:
        return ()
    from ds47.parameters import store

    if not names and not store.files():
        return ()
    from ds47.parameters import lists

    with refused(lists.ListError, usage=True):
        own = [found for _, found in store.kept()] if kept else []
        return (*own, *(lists.read(Path(name)) for name in names))


def expected_in(name: str | None) -> tuple[Expectation, ...]:
    """The golden list of --expect.

    Raises:
        click.UsageError: it cannot be read.
    """
    if name is None:
        return ()
    from ds47.parameters import expected, lists

    with refused(lists.ListError, said="--expect ", usage=True):
        return expected.read(Path(name))


def _channels(names: str) -> tuple[str, ...]:
    """The channels in a comma-separated list."""
    chosen = [name.strip().lower() for name in names.split(",")]
    unknown = [name for name in chosen if name not in CHANNELS]
    if unknown:
        raise click.UsageError(
            f"--channels {names}: {unknown[0]!r} is none of {', '.join(CHANNELS)}"
        )
    return tuple(name for name in CHANNELS if name in chosen)


def _named(texts: Sequence[str]) -> tuple[Name, ...]:
    """The channels named by hand."""
    if not texts:
        return ()
    from ds47.cyclic import named

    with refused(ValueError, said="--cyclic: ", usage=True):
        names = tuple(map(named.parse, texts))
        named.pairs(names)
    return names


def _ppos(texts: Sequence[str]) -> tuple[tuple[int, int], ...]:
    """The PPOs of stations named by hand."""
    if not texts:
        return ()
    from ds47.cyclic import named

    with refused(ValueError, said="--ppo: ", usage=True):
        return tuple(map(named.parse_ppo, texts))


def _s7(
    ports: Sequence[int], cpus: Sequence[str], blocks: Sequence[str], readback: bool
) -> Choices:
    """The choices for S7."""
    from ds47.s7 import choices

    with refused(ValueError, said="--s7-", usage=True):
        return choices.parse(ports, cpus, blocks, readback)


def known_rules(names: Sequence[str]) -> tuple[str, ...]:
    """The prefixes of rule ids for these words.

    Raises:
        click.UsageError: a word is neither an id, nor the start of one, nor a name.
    """
    return tuple(_known_rule(name) for name in names)


def _known_rule(name: str) -> str:
    from ds47 import spec

    found = spec.rule_prefix(name)
    if found is None:
        from difflib import get_close_matches

        near = get_close_matches(name.lower(), [each.name for each in spec.rules().values()], 1)
        advice = f"Did you mean: {near[0]}?" if near else "Try: ds47 rules"
        raise click.UsageError(f"no rule has the number or name {name!r}. {advice}")
    return found


def _index(text: str) -> int:
    try:
        index = int(text, 0)
    except ValueError:
        index = -1
    if not 0 <= index <= 0xFFFF:
        raise click.UsageError(f"--index {text!r} is not a record index: 0..65535, also as 0xB02E")
    return index


def _layout(text: str) -> tuple[str, str]:
    from ds47.batch.settings import layout

    with refused(ValueError, said="--pkw-layout ", usage=True):
        return layout(text)
