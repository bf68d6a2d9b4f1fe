"""`ds47 watch`: transactions of a running plant, line by line.

Here: options, starting and ending the capture, exit status. The work is in `ds47.live`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ds47.capture.names import STDIN
from ds47.cli.common import color, columns_of, fail, format_option, stdout, warn
from ds47.cli.helping import helped
from ds47.cli.options import analysis_options, fail_on_option, options_from, tz_option
from ds47.cli.series import tell_nothing
from ds47.model import S7, SEVERITIES

if TYPE_CHECKING:
    from ds47.analysis import AnalysisOptions
    from ds47.live.dumpcap import Dumpcap
    from ds47.live.feed import Feed
    from ds47.live.show import Show
    from ds47.report.zones import Zone

_UNREADABLE = 3


@helped("watch", ("ds47 watch -i eth0", "what happens on this interface"))
@click.argument("source", metavar="[SOURCE]", required=False)
@click.option(
    "-i",
    "--interface",
    "interfaces",
    multiple=True,
    metavar="NAME",
    help="Capture here, with dumpcap; repeatable. Names: dumpcap -D.",
)
@click.option(
    "--capture-filter",
    metavar="FILTER",
    help='Filter for dumpcap; "" captures everything.',
)
@click.option("--duration", type=float, metavar="SECONDS", help="End after this time (with -i).")
@click.option("--dumpcap", "program", metavar="PROGRAM", help="The dumpcap to use.")
@click.option(
    "--no-follow",
    is_flag=True,
    help="Stop at the end of SOURCE instead of waiting for more.",
)
@format_option("text", "ndjson")
@fail_on_option
@tz_option
@analysis_options
def command(
    source: str | None,
    interfaces: Sequence[str],
    capture_filter: str | None,
    duration: float | None,
    program: str | None,
    no_follow: bool,
    format_name: str,
    fail_on: str,
    where: Zone,
    lang: str,
    **options: Any,
) -> int:
    """Show DS47 transactions as they happen.

    Give -i INTERFACE, or SOURCE: a capture file that is still growing (followed like tail -f), a named
    pipe, or - for stdin (dumpcap -i eth0 -w - | ds47 watch -). Enter, or the signal SIGUSR1, shows a
    summary; Ctrl-C ends with one.
    """
    if bool(source) == bool(interfaces):
        raise click.UsageError("either -i INTERFACE or a SOURCE (- for stdin)")
    if source and (capture_filter is not None or duration is not None or program):
        raise click.UsageError("--capture-filter, --duration and --dumpcap go with -i")
    if duration is not None and duration <= 0:
        raise click.UsageError("--duration must be more than 0 seconds")
    from ds47.live.dumpcap import DumpcapError
    from ds47.live.feed import grows

    analysis = options_from(**options, kept_lists=True)
    name = source or "+".join(interfaces)
    show = _show(format_name, name, lang, analysis.channels == (S7,), where)
    watch = _Watch(name, analysis, show, lang)
    try:
        if source:
            with _opened(source) as descriptor:
                status = watch.run(descriptor, follow=not no_follow and grows(source, descriptor))
        else:
            status = watch.run_dumpcap(program, interfaces, capture_filter, duration)
    except DumpcapError as problem:
        fail(str(problem))
        return _UNREADABLE
    if status:
        return status
    return int(fail_on != "never" and show.tally.worst() >= SEVERITIES.index(fail_on))


def _show(format_name: str, name: str, lang: str, only_s7: bool, where: Zone) -> Show:
    from ds47 import spec
    from ds47.live.show import NdjsonShow, TextShow
    from ds47.report import ReportOptions

    stream = stdout()
    if format_name == "ndjson":
        return NdjsonShow(stream, name, sys.stderr, lang)
    options = ReportOptions(
        color=color(stream),
        rules=spec.rules(),
        lang=lang,
        s7=only_s7,
        zone=where,
        width=columns_of(),
    )
    return TextShow(stream, options)


@contextmanager
def _opened(source: str) -> Iterator[int]:
    """The descriptor of a source, which is closed at the end."""
    from ds47.live.feed import opened

    try:
        descriptor = opened(source)
    except OSError as problem:
        from ds47.spec.shell import shell_word

        hint = (
            f". For an interface: ds47 watch -i {shell_word(source)}"
            if _may_be_interface(source, problem)
            else ""
        )
        raise click.ClickException(f"cannot open {source}: {problem.strerror}{hint}") from problem
    try:
        yield descriptor
    finally:
        if source != STDIN:
            os.close(descriptor)


def _may_be_interface(source: str, problem: OSError) -> bool:
    """Whether a source that is not there has no folder and no ending: `eth0` instead of `-i eth0`."""
    return (
        isinstance(problem, FileNotFoundError) and Path(source).name == source and "." not in source
    )


class _Watch:
    """One watch, from the first byte to the summary."""

    def __init__(self, name: str, options: AnalysisOptions, show: Show, lang: str) -> None:
        self._name = name
        self._options = options
        self._show = show
        self._lang = lang
        self._frames: Callable[[], int] = int

    def run_dumpcap(
        self,
        program: str | None,
        interfaces: Sequence[str],
        capture_filter: str | None,
        duration: float | None,
    ) -> int:
        """Captures with dumpcap. Raises DumpcapError."""
        from ds47.live import dumpcap

        with dumpcap.start(program, interfaces, capture_filter, duration, self._options) as running:
            # dumpcap is told the duration, too; it opens the interface first
            seconds = None if duration is None else duration + dumpcap.SECONDS_TO_END
            return self.run(running.output.fileno(), running, seconds=seconds)

    def run(
        self,
        descriptor: int,
        running: Dumpcap | None = None,
        *,
        follow: bool = False,
        seconds: float | None = None,
    ) -> int:
        """Watches a pipe to its end, or until the user stops it; `follow`: a file that grows."""
        from ds47.live.feed import Feed, keyboard
        from ds47.report.bilingual import say

        def end() -> None:
            if running is not None:
                running.end()

        feed = Feed(
            descriptor,
            lambda: self._show.summary(self._frames()),
            end,
            drain=running is not None,
            follow=follow,
            seconds=seconds,
        )
        keys = keyboard(descriptor)
        if follow:
            warn(say("watch_follows", name=self._name).text(self._lang))
        if keys is not None:
            hint = say("watch_hint", name=self._name).text(self._lang)
            click.echo(f"ds47: {hint}", err=True)
        with feed.listening(keys):
            return self._read(feed, running)

    def _read(self, feed: Feed, running: Dumpcap | None) -> int:
        from ds47.capture import CaptureError, open_capture
        from ds47.live.traffic import Live

        try:
            with open_capture(feed, name=self._name) as capture:  # type: ignore[arg-type]
                self._frames = lambda: capture.frames
                result = Live(self._options, self._show).watch(capture)
        except CaptureError as problem:
            return self._nothing(feed, running, str(problem))
        if feed.stopped:
            result.complete, result.problem = True, None
        self._show.end(result)
        tell_nothing(result, self._lang)
        complaint = running.problem() if running else None
        problem_text = complaint or result.problem or feed.problem
        if problem_text:
            fail(f"{self._name}: {problem_text}")
        return _UNREADABLE if problem_text else 0

    def _nothing(self, feed: Feed, running: Dumpcap | None, problem: str) -> int:
        """There was not even the beginning of a capture."""
        complaint = running.problem() if running else None
        if feed.stopped and complaint is None:
            self._show.summary(0)
            return 0
        fail(complaint or problem)
        return _UNREADABLE
