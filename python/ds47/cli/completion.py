"""`ds47 completion`: the script that completes commands, options and their values in a shell. click writes it."""

from __future__ import annotations

import click

from ds47.cli.common import stdout

SHELLS = ("bash", "zsh", "fish")
HELP = """Print the script that completes ds47 in a shell (bash 4.4 or later, zsh, fish).

\b
  bash: echo 'eval "$(ds47 completion bash)"' >> ~/.bashrc
  zsh:  echo 'eval "$(ds47 completion zsh)"' >> ~/.zshrc
  fish: ds47 completion fish > ~/.config/fish/completions/ds47.fish
"""


@click.command("completion", help=HELP)
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> None:
    """See `HELP`."""
    from click.shell_completion import get_completion_class

    from ds47.cli import group

    found = get_completion_class(shell)
    assert found is not None
    stdout().write(found(group, {}, "ds47", "_DS47_COMPLETE").source() + "\n")
