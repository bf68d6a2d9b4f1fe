"""The `ds47` command: its entry point, and which commands there are.

One file per command; a command's module is imported when it is used, and imports what is heavy
inside its function, so that `ds47 --version` costs nothing. What the commands share is in
`ds47.cli.common`.

Exit status: 0 nothing at or above --fail-on; 1 something; 2 wrong use; 3 input unreadable or only
partly read; 70 a fault of ds47 itself. A command returns it as its result. 130 interrupted; 141 who
read the output left.
"""

from __future__ import annotations

import atexit
import errno
import gc
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, cast

if sys.argv[1:2] == ["watch"] and hasattr(signal, "SIGUSR1"):
    # until it listens: who asks for a summary too early gets none, and does not end it
    signal.signal(signal.SIGUSR1, signal.SIG_IGN)
gc.disable()  # until a command is imported: no import leaves garbage, and looking for it takes long
atexit.register(gc.freeze)  # or the interpreter looks through all of it when it ends

import click  # noqa: E402

from ds47.version import __version__  # noqa: E402

GROUPS = {
    "Look at captures": {
        "report": "What happened: causes, transactions, values",
        "trail": "Who changed which parameter, from what to what",
        "watch": "The same while it happens",
        "export": "The frames of what went wrong as a capture, anonymised on request",
    },
    "Compare": {
        "diff": "Two captures: what changed between them",
        "check": "Captures against their stored results, for CI",
        "baseline": "Store the results",
        "accept": "Accept changes into them",
    },
    "Look up and build": {
        "explain": "A STATUS, an error number, a parameter in words",
        "params": "Search parameters by word or number; import lists of makers",
        "rules": "What ds47 finds, and what to do about it",
        "decode": "Bytes of a message into its fields",
        "encode": "A request as bytes, or as a block for the PLC",
    },
    "Tools": {
        "demo": "A capture with faults, its report and its page",
        "plugin": "Install and check the Wireshark plugin",
        "lab": "Make captures of faults",
        "completion": "Complete commands and options in the shell",
    },
}
"""Each is a module of this package with a click command named `command`; with what it shows, in a few words."""
COMMANDS = tuple(name for group in GROUPS.values() for name in group)
EXAMPLES = (
    ("ds47 report machine.pcapng", "what went wrong, and what to do"),
    ("ds47 report -f html machine.pcapng", "the same as a page"),
    ("ds47 diff yesterday.pcapng today.pcapng", "what changed since yesterday"),
    ("ds47 explain DE80B500", "what a STATUS means"),
)
"""Lines to type and what they do, of the help and of ds47(1)."""

_INTERRUPTED = 130
_READER_LEFT = 141
"""The exit status that a shell shows after SIGPIPE: the rest of the output is unknown."""
_INTERNAL = 70
"""EX_SOFTWARE of sysexits.h, as `Misses.OURS`. Python itself would end with 1: something was found."""

_WIDEST = 100
"""Columns of a line of help."""


class _Commands(click.Group):
    """Finds a command by its name, and imports only that one."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        if cmd_name not in COMMANDS:
            return None
        command = import_module(f"ds47.cli.{cmd_name}").command
        gc.freeze()
        gc.enable()
        return cast(click.Command, command)

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Reads the words in front of the command; the help is printed here."""
        with _reader_may_leave():
            return super().make_context(info_name, args, parent, **extra)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click, with what was probably meant where there is no such command."""
        word = args[0]
        if word in COMMANDS or ctx.resilient_parsing or (word.startswith("-") and word != "-"):
            return super().resolve_command(ctx, args)
        raise click.UsageError(f"No such command {word!r}.{_meant(word)}", ctx)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options, then the commands in groups, then how to begin."""
        click.Command.format_options(self, ctx, formatter)
        for title, commands in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl(list(commands.items()))
        with formatter.section("Examples"):
            formatter.write_dl(EXAMPLES, 48)
        formatter.write_paragraph()
        formatter.write_text("No capture at hand? Start with: ds47 demo")

    def invoke(self, ctx: click.Context) -> object:
        """Runs the command; a reader that leaves ends it in silence (click itself would exit 1)."""
        with _reader_may_leave():
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": _WIDEST},
)
@click.version_option(__version__, message="%(prog)s %(version)s")
def group() -> None:
    """What happened on the parameter channel of PROFIdrive drives, from captures of PROFINET, PROFIBUS and S7."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; `arguments` instead of sys.argv[1:]. Returns the exit status."""
    closed = _stand_in()
    words = sys.argv[1:] if arguments is None else arguments
    try:
        result = group.main(words or ["--help"], prog_name="ds47", standalone_mode=False)
    except click.ClickException as problem:
        _refuse(problem)
        return 2
    except (click.Abort, KeyboardInterrupt):
        return _INTERRUPTED
    except OSError as problem:
        nowhere = closed and problem.errno == errno.EBADF
        what = "standard output is closed" if nowhere else _cannot(problem)
        click.echo(f"ds47: error: {what}", err=True)
        return 2
    except Exception as problem:  # noqa: BLE001 (our own fault, and no caller above)
        _explain(problem)
        return _INTERNAL
    finally:
        if closed:
            _silence_stdout()
    return result if isinstance(result, int) else 0


def _refuse(problem: click.ClickException) -> None:
    """One line: what is wrong and why; of wrong use how to see what is right."""
    text = _near(problem, " ".join(problem.format_message().split()))
    context = problem.ctx if isinstance(problem, click.UsageError) else None
    if context is not None and "ds47 " not in text and "Try: " not in text:
        text += "" if text.endswith(("?", ".", "?)")) else "."
        text += f" Try: {context.command_path} -h"
    click.echo(f"ds47: error: {text}", err=True)


def _near(problem: click.ClickException, text: str) -> str:
    """The text; of a word that is none of a choice with the one that was probably meant, and not with all."""
    kind = problem.param.type if isinstance(problem, click.BadParameter) and problem.param else None
    if not isinstance(kind, click.Choice):
        return text
    from difflib import get_close_matches

    front, there, rest = text.partition("' is not one of ")
    near = get_close_matches(front.rpartition("'")[2], kind.choices, 1)
    return (
        f"{front}{there}{rest}" if not near else f"{front}' is unknown. Did you mean '{near[0]}'?"
    )


def _cannot(problem: OSError) -> str:
    """What could not be read; without the name of a file it was the standard output that could not be written."""
    if problem.filename:
        return f"{problem.filename}: {problem.strerror}"
    from pathlib import Path

    from ds47.cli.common import cannot_write

    try:
        name = str(Path("/proc/self/fd/1").readlink())
    except OSError:  # not Linux
        name = ""
    return cannot_write(name if name.startswith("/") else "standard output", problem).message


def _meant(word: str) -> str:
    """The report of a capture that was named without a command, or the commands of a similar name."""
    from difflib import get_close_matches
    from pathlib import Path

    from ds47.spec.shell import shell_word

    if word == "-" or Path(word).exists():
        return f" For a report of it: ds47 report {shell_word(word)}"
    near = get_close_matches(word.lower(), COMMANDS)
    return f" Did you mean: ds47 {', ds47 '.join(near)}?" if near else ""


def _stand_in() -> bool:
    """Opens the standard streams that the caller has closed (`>&-`): Python has None for them.

    In their order, so that no other file gets their numbers. Writing to stdout fails then, as it does in
    every program; whether stdout was closed is the result.
    """
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")
    closed = sys.stdout is None
    if closed:
        sys.stdout = open(os.open(os.devnull, os.O_RDONLY), "w", encoding="utf-8")
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")
    return closed


@contextmanager
def _reader_may_leave() -> Iterator[None]:
    """Raises click.exceptions.Exit where the reader of stdout went away."""
    try:
        yield
    except OSError as problem:
        if not _reader_left(problem):
            raise
        _silence_stdout()
        raise click.exceptions.Exit(_READER_LEFT) from problem


def _explain(problem: Exception) -> None:
    """One line about a fault of ours."""
    from ds47.batch.endings import explained
    from ds47.cli.common import fail

    fail(explained(problem))


def _reader_left(problem: OSError) -> bool:
    """Whether the reader of stdout went away (`| head`); Windows says EINVAL then."""
    if isinstance(problem, BrokenPipeError):
        return True
    return sys.platform == "win32" and problem.errno == errno.EINVAL


def _silence_stdout() -> None:
    """Python flushes stdout once more when it ends, and would complain."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):
        sys.stdout = open(os.devnull, "w")
