"""The help of a command: an example, its own options, then those of others in groups; PROFIBUS and S7 come last.

Each option explains itself where it is defined. This module only says which options belong together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import click

GROUPS: Final = {
    "What to show": (
        "transactions", "rules", "devices", "drive_objects", "pnus", "stations", "states", "start", "end",
        "all_frames",
    ),
    "How to show it": (
        "format_name", "output_name", "opens", "show_all", "summary", "filters", "plc", "reference",
        "width", "lang", "where", "digest", "title", "order", "customer", "author",
    ),
    "When to fail": ("fail_on", "required", "junit", "sarif"),
    "What to find": ("select", "ignore", "slow", "vendor", "lists"),
    "Many captures": ("series", "jobs", "results_name", "resume", "scheduler", "no_progress"),
    "How to read the frames": (
        "indices", "profile_v3_types", "legacy_g120_formats", "engine", "tshark", "channels",
    ),
    "Cyclic frames, PROFIBUS, S7": (
        "cyclic", "ppos", "pkw_layouts", "pkw_layout", "link", "s7_ports", "s7_cpus", "s7_blocks", "s7_readback",
    ),
}  # fmt: skip
"""Which options, by the names of their values, belong together."""
_FEW: Final = 14
"""Up to this many options need no groups."""
_LINE: Final = 48
"""Columns of an example that has its explanation beside it."""


class Gathered(click.Group):
    """A command of commands: its bare name shows its help, as `ds47` does."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click, but for no words at all."""
        return super().parse_args(ctx, args or ["--help"])


class Helped(click.Command):
    """A command with examples: pairs of a line to type and what it does."""

    def __init__(self, *about: Any, examples: Sequence[tuple[str, str]] = (), **more: Any) -> None:
        super().__init__(*about, **more)
        self.examples = examples

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The examples, then the text."""
        if self.examples:
            with formatter.section("Examples"):
                formatter.write_dl(self.examples, _LINE)
        super().format_help_text(ctx, formatter)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The options in groups, where there are many; those that no other command has come first."""
        known = [
            (each.name or "", each.get_help_record(ctx))
            for each in self.get_params(ctx)
            if isinstance(each, click.Option)
        ]
        shown = [(name, record) for name, record in known if record is not None]
        if len(shown) <= _FEW:
            super().format_options(ctx, formatter)
            return
        grouped = {name for names in GROUPS.values() for name in names}
        others = tuple(name for name, _ in shown if name not in grouped)
        for title, names in (("Options", others), *GROUPS.items()):
            records = [record for name, record in shown if name in names]
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def helped(name: str, *examples: tuple[str, str], **more: Any) -> Callable[..., Helped]:
    """A decorator: a command of this name, with examples."""
    return click.command(name, cls=Helped, examples=examples, **more)
