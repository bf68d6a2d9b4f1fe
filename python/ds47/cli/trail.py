"""`ds47 trail`: who changed which parameter, when, by which way, from which value to which.

Here: options, finding the files, exit status. What is printed is `ds47.report.changes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import click

from ds47.cli.common import (
    Misses,
    color,
    columns_of,
    fail,
    format_option,
    output,
    warn,
    width_option,
)
from ds47.cli.helping import helped
from ds47.cli.options import (
    analysis_options,
    options_from,
    refuse_without_effect,
    tz_option,
    zone_for_paths,
)
from ds47.cli.selecting import CRITERIA, chosen, selection_options
from ds47.cli.series import series_option, tasks, tell_lacking, tell_nothing
from ds47.report.bilingual import say
from ds47.report.formatting import escape
from ds47.report.zones import Zone


@helped("trail", ("ds47 trail machine.pcapng --pnu p1120", "who changed p1120, from what to what"))
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@format_option("text", "csv", "json")
@click.option("-o", "--output", "output_name", metavar="FILE", default="-", help="Write to a file.")
@width_option
@selection_options
@tz_option
@series_option
@analysis_options
def command(
    paths: Sequence[str],
    format_name: str,
    output_name: str,
    width: int | None,
    where: Zone,
    series: bool,
    lang: str,
    **options: Any,
) -> int:
    """Show who changed which parameter, when, from where, from which value to which."""
    from ds47.capture import CaptureError
    from ds47.regression.run import readable
    from ds47.report import ReportOptions
    from ds47.report.changes import Writer
    from ds47.report.selection import There

    refuse_without_effect(format_name, {"width": ("text",)})
    where = zone_for_paths(where, paths)
    choice = chosen(where, **{name: options.pop(name) for name in CRITERIA})
    analysis = options_from(**options)
    misses = Misses()
    instead = There()
    changes = 0
    with output(output_name) as stream:
        width = width or columns_of(output_name)
        shown = ReportOptions(color(stream), lang=lang, zone=where, width=width)
        writer = Writer(stream, format_name, shown)
        for task in tasks(paths, series, misses):
            try:
                result = readable(task, analysis)
            except CaptureError as problem:
                misses.of(task.path, problem)
                continue
            found, left = writer.capture(result, choice.of(result.start_ns, result.end_ns))
            changes += found
            instead.add(result)
            if left:
                asked = ", ".join(map(str, choice.selection.drive_objects))
                words = say("trail_unproved", path=escape(result.path), n=left, do=asked)
                warn(words.text(lang))
            tell_nothing(result, lang)
            tell_lacking(task.path, result.missing_files, result.lacking, misses)
        writer.close()
    if choice and not changes:
        choice.refuse_backwards()
        there = instead.words(choice.of(None))
        fail(say("trail_nothing", criteria=choice.criteria, devices=there).text(lang))
    if misses:
        return misses.status
    return int(bool(choice) and not changes)
