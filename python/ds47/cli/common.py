"""What several commands share: options, output streams, rule texts.

Nothing that only one command needs, and nothing about captures or messages.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO, TypeVar

import click

if TYPE_CHECKING:
    from ds47.capture import CaptureError
    from ds47.profidrive import Flaw, Options
    from ds47.spec import Rule

Function = TypeVar("Function", bound=Callable[..., Any])

lang_option = click.option(
    "--lang",
    type=click.Choice(["en", "zh"]),
    default="en",
    show_default=True,
    help="Language of texts and messages.",
)


LEAST_WIDTH = 60
width_option = click.option(
    "--width",
    type=click.IntRange(min=LEAST_WIDTH),
    metavar="COLUMNS",
    help="Width of the text.  [default: the terminal's, or 140]",
)


def columns_of(output_name: str = "-") -> int | None:
    """Columns of the terminal (or COLUMNS), at least as many as a report needs; None if text goes elsewhere."""
    if output_name != "-" or not sys.stdout.isatty():
        return None
    from shutil import get_terminal_size  # slow: shutil imports archives, too

    return max(LEAST_WIDTH, get_terminal_size().columns)


def prose_width() -> int:
    """Columns of a line of explanation on stdout."""
    from ds47.report.explanation import WIDTH

    return min(WIDTH, columns_of() or WIDTH)


def tell(lines: Iterable[str]) -> None:
    """Writes lines to stdout, wrapped to the terminal."""
    from ds47.report.wrap import fitted

    stream, width = stdout(), columns_of()
    stream.writelines(f"{part}\n" for line in lines for part in fitted(line, width))


def format_option(*formats: str, about: str | None = None) -> Callable[[Function], Function]:
    """`-f`: the output format; the first one is the default."""
    return click.option(
        "-f",
        "--format",
        "format_name",
        type=click.Choice(formats),
        default=formats[0],
        show_default=True,
        help=about,
    )


pkw_layout_option = click.option(
    "--pkw-layout",
    type=click.Choice(["cyclic", "uss"]),
    default="cyclic",
    show_default=True,
    help="Byte of IND that has the page: cyclic (low) or uss (high; also Delta).",
)


def dialect_options(function: Function) -> Function:
    """The options for the dialect of formats that the drive speaks (docs/protocol.md A.6)."""
    for name, text in (
        ("--profile-v3-types", "Formats as numbered by PROFIdrive profile V3."),
        ("--legacy-g120-formats", "Formats as numbered by old SINAMICS G120 firmware."),
    ):
        function = click.option(name, is_flag=True, help=text)(function)
    return function


def vendor_number(text: str) -> int:
    """The PROFINET vendor id of a known name, or from a number.

    Raises:
        click.BadParameter: it is neither.
    """
    from ds47.parameters.lists import LARGEST_ID
    from ds47.spec import maker_names

    try:
        number = int(text, 0)
    except ValueError:
        number = None
    if number is not None and 0 <= number <= LARGEST_ID:
        return number
    try:
        return maker_names.number(text)
    except ValueError as problem:
        raise click.BadParameter(str(problem), param_hint="--vendor") from problem


def codec_options(
    legacy_g120_formats: bool, profile_v3_types: bool, vendor: str | None = None
) -> Options:
    """The codec's options from those of the command line.

    Raises:
        click.BadParameter: `vendor` is neither a known name nor an id.
    """
    from ds47.profidrive import Options

    vendor_id = None if vendor is None else vendor_number(vendor)
    return Options(legacy_g120_formats, profile_v3_types, vendor_id)


def stdout() -> TextIO:
    """Standard output in UTF-8 with LF, whatever the console's code page.

    What UTF-8 cannot hold (half a surrogate in a file name) becomes an escape.
    """
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None:
        reconfigure(encoding="utf-8", errors="backslashreplace", newline="\n")
    return sys.stdout


def color(stream: TextIO) -> bool:
    """Whether to use colours: only on a terminal, and never with NO_COLOR."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty():
        return False
    if sys.platform == "win32":  # an old console prints escapes unless set up
        with suppress(ImportError):
            from colorama import just_fix_windows_console

            just_fix_windows_console()
    return True


def warn(text: str) -> None:
    """One line on stderr; stdout is for results."""
    from ds47.report.formatting import escape

    click.echo(f"ds47: {escape(text)}", err=True)


def fail(text: str) -> None:
    """The same about what makes the exit status another than 0: `WHAT: WHY. Try: DO`."""
    warn(f"error: {text}")


class Misses:
    """Says on stderr what could not be read; true after the first line. `status` is that of the command then."""

    UNREADABLE, OURS = 3, 70

    def __init__(self) -> None:
        self.status = 0

    def __call__(self, text: str, *, ours: bool = False) -> None:
        """Says one line; `ours` where it is about a fault of ds47 itself."""
        self.status = max(self.status, self.OURS if ours else self.UNREADABLE)
        fail(text)

    def of(self, path: str, problem: CaptureError) -> None:
        """Says what is wrong with a capture."""
        from ds47.capture.names import about

        self(about(path, str(problem)), ours=problem.ours)

    def __bool__(self) -> bool:
        return bool(self.status)


def counted(number: int, noun: str) -> str:
    """A number and its noun: `1 capture`, `2 captures`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def cannot_write(name: str, problem: OSError) -> click.ClickException:
    """The error of an output: which, why, and what helps."""
    full = problem.errno in (errno.ENOSPC, getattr(errno, "EDQUOT", None))
    advice = ". Try: a file on another disk" if full else ""
    return click.ClickException(f"cannot write {name}: {problem.strerror or problem}{advice}")


@contextmanager
def refused(*kinds: type[Exception], said: str = "", usage: bool = False) -> Iterator[None]:
    """What is wrong as an error of the command, or of its words; `said` stands in front."""
    try:
        yield
    except kinds as problem:
        made = click.UsageError if usage else click.ClickException
        raise made(f"{said}{problem}") from problem


@contextmanager
def output(name: str) -> Iterator[TextIO]:
    """The stream for `-o`: `-` is stdout, a file appears whole or not at all.

    Raises click.ClickException if the file cannot be written, or is a capture.
    """
    from ds47.capture.drafts import draft_of
    from ds47.cli.targets import spare_captures

    if name == "-":
        yield stdout()
        return
    spare_captures(name)
    target = Path(name).resolve()
    special = target.exists() and not target.is_file()  # /dev/null, a pipe: nothing to replace
    draft = target if special else draft_of(target)
    try:
        stream = draft.open("w", encoding="utf-8", errors="backslashreplace", newline="\n")
    except OSError as problem:
        raise cannot_write(name, problem) from problem
    try:
        with stream:
            yield stream
        if not special:
            _take_its_place(draft, target, name)
    except BaseException as problem:
        if not special:
            draft.unlink(missing_ok=True)
        if isinstance(problem, BrokenPipeError) or not isinstance(problem, OSError):
            raise
        if problem.filename is None:
            raise cannot_write(name, problem) from problem
        raise


def _take_its_place(draft: Path, target: Path, name: str) -> None:
    """Renames the finished draft. Windows refuses that while a program has the old file open."""
    try:
        draft.replace(target)
    except OSError as problem:
        hint = " (is it open in another program?)" if isinstance(problem, PermissionError) else ""
        raise click.ClickException(f"cannot write {name}: {problem.strerror}{hint}") from problem


class RuleWords(NamedTuple):
    """A rule in one language."""

    id: str
    name: str
    severity: str
    message: str
    cause: str
    advice: str
    args: str
    """The arguments of a finding: names and types."""
    analyzer_only: bool
    """Whether the Wireshark plugin lacks it."""
    changed: tuple[str, ...]
    """The versions that changed what it finds."""


def rule_text(rule: Rule, lang: str) -> RuleWords:
    """The texts of a rule in `lang`, or else in English."""

    def text(key: str) -> str:
        own = getattr(rule, f"{key}_{lang}", None) if lang != "en" else None
        return str(own or getattr(rule, key))

    return RuleWords(
        rule.id, rule.name, rule.severity, text("message"), text("cause"), text("advice"),
        ", ".join(f"{name} ({kind})" for name, kind in rule.args.items()), rule.analyzer_only,
        rule.changed,
    )  # fmt: skip


def flaw_text(flaw: Flaw, lang: str = "en") -> str:
    """What is wrong with a message, in `lang`, with its offset in front."""
    from ds47.report.sentences import at_offset, words

    return at_offset(flaw.offset, words(flaw.rule, flaw.args, lang), lang)
