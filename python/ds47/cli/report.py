"""`ds47 report`: captures to transactions, in the format asked for.

Here: options, finding the files, exit status. The analysis is `ds47.analysis`, the formats are
`ds47.report`.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import (
    codec_options,
    color,
    dialect_options,
    lang_option,
    output,
    warn,
)
from ds47.model import SEVERITIES, CaptureResult, Finding, Transaction
from ds47.report import FORMATS, Options, Writer, open_writer

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions

SUFFIXES = (".pcap", ".pcapng", ".cap")
"""Files of a folder that are captures; each also with one of PACKED behind."""
PACKED = ("", ".gz", ".zst")
STDIN = "-"
UNREADABLE = 3
_ENDINGS = tuple(suffix + packed for suffix in SUFFIXES for packed in PACKED)


@click.command("report")
@click.argument("paths", metavar="PATH...", nargs=-1, required=True)
@click.option(
    "-f",
    "--format",
    "format_name",
    type=click.Choice(FORMATS),
    default="text",
    show_default=True,
    help="Format of the report; ndjson and csv appear transaction by transaction.",
)
@click.option(
    "-o",
    "--output",
    "output_name",
    metavar="FILE",
    default=STDIN,
    help="Write to a file, which then appears whole or not at all; - is stdout.",
)
@click.option(
    "--fail-on",
    type=click.Choice(["never", *SEVERITIES]),
    default="never",
    show_default=True,
    help="Exit with 1 if a finding is at least this severe.",
)
@click.option("--select", multiple=True, metavar="RULE", help="Only these rules (DS301, DS3).")
@click.option("--ignore", multiple=True, metavar="RULE", help="Not these rules (DS204, DS2).")
@click.option("--index", "indices", multiple=True, metavar="N", help="Another record index.")
@lang_option
@click.option("--slow", type=float, metavar="MS", help="Limit for a slow transaction, in ms.")
@click.option("--digest", is_flag=True, help="Put the SHA-256 of each capture into the report.")
@dialect_options
def command(
    paths: Sequence[str], format_name: str, output_name: str, fail_on: str, **options: Any
) -> int:
    """Report the DS47 transactions of captures.

    PATH is a pcap or pcapng file (also .gz and .zst), a folder, which is searched for captures
    with all that is below it, or - for stdin.
    """
    analysis = _analysis_options(**options)
    run = _Run(analysis)
    _collect_rarely()
    with output(output_name) as stream:
        report_options = Options(color=color(stream), rules=_rules())
        writer = open_writer(format_name, stream, report_options)
        for path in _captures(paths, run.missing):
            run.one(path, writer)
        writer.close()
    if run.failed:
        return UNREADABLE
    return int(fail_on != "never" and run.worst >= SEVERITIES.index(fail_on))


def _collect_rarely() -> None:
    """What an analysis keeps has no cycles: looking for them again and again only costs time."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 100)


class _Run:
    """Goes from capture to capture, and remembers what the exit status needs."""

    def __init__(self, options: AnalysisOptions) -> None:
        self.options = options
        self.failed = False
        self.worst = -1

    def missing(self, text: str) -> None:
        """Says what could not be read, or not as a whole."""
        self.failed = True
        warn(text)

    def one(self, path: str, writer: Writer) -> None:
        """Analyses a capture and hands what it says to the writer."""
        from ds47.analysis import analyze
        from ds47.capture import CaptureError

        def finished(transaction: Transaction, findings: Sequence[Finding]) -> None:
            self._note(findings)
            writer.transaction(path, transaction, findings)

        source = sys.stdin.buffer if path == STDIN else path
        try:
            result = analyze(source, self.options, finished if writer.streams else None)
        except CaptureError as problem:
            self.missing(_about(path, str(problem)))
            return
        self._end(path, result, writer)

    def _end(self, path: str, result: CaptureResult, writer: Writer) -> None:
        result.path = path
        self._note(result.findings)
        if not result.complete:
            self.missing(_about(path, result.problem or "only partly read"))
        writer.capture(result)

    def _note(self, findings: Sequence[Finding]) -> None:
        for finding in findings:
            self.worst = max(self.worst, SEVERITIES.index(finding.severity))


def _about(path: str, problem: str) -> str:
    """One line that names the capture, and names it once."""
    name = "stdin" if path == STDIN else path
    line = " ".join(problem.split())
    return line if name in line else f"{name}: {line}"


def _captures(paths: Sequence[str], missing: Callable[[str], None]) -> Iterator[str]:
    """The captures that the arguments mean, each once, in order."""
    seen = set()
    for path in paths:
        found = [path]
        if path != STDIN and Path(path).is_dir():
            found = _in_folder(path, missing)
            if not found:
                missing(f"{path}: no capture in this folder ({', '.join(SUFFIXES)})")
        for each in found:
            name = os.path.normpath(each)
            if name not in seen:
                seen.add(name)
                yield each


def _in_folder(folder: str, missing: Callable[[str], None]) -> list[str]:
    def unreadable(problem: OSError) -> None:
        missing(f"{problem.filename}: {problem.strerror}")

    return sorted(
        str(Path(parent, name))
        for parent, _, names in os.walk(folder, onerror=unreadable)
        for name in names
        if name.lower().endswith(_ENDINGS)
    )


def _analysis_options(
    select: Sequence[str],
    ignore: Sequence[str],
    indices: Sequence[str],
    slow: float | None,
    legacy_g120_formats: bool,
    profile_v3_types: bool,
    **others: Any,
) -> AnalysisOptions:
    from ds47.analysis import AnalysisOptions

    if slow is not None:
        others["slow_ms"] = slow
    return AnalysisOptions(
        select=_known_rules(select),
        ignore=_known_rules(ignore),
        indices=frozenset(map(_index, indices)),
        codec=codec_options(legacy_g120_formats, profile_v3_types),
        **others,
    )


def _rules() -> Any:
    from ds47 import spec

    return spec.rules()


def _known_rules(names: Sequence[str]) -> tuple[str, ...]:
    """Rules or the start of rules, in capitals; one that means no rule is a typing error."""
    wanted = tuple(name.strip().upper() for name in names)
    for name in wanted:
        if not name or not any(rule.startswith(name) for rule in _rules()):
            raise click.UsageError(f"no rule begins with {name!r}; see: ds47 rules")
    return wanted


def _index(text: str) -> int:
    try:
        index = int(text, 0)
    except ValueError:
        index = -1
    if not 0 <= index <= 0xFFFF:
        raise click.UsageError(f"--index {text!r} is no record index: 0..65535, also as 0xB02E")
    return index
