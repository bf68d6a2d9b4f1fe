"""`ds47 rules`: the catalogue of findings, or one of them explained.

The texts themselves are in spec/rules.toml.
"""

from __future__ import annotations

from collections.abc import Sequence

import click

from ds47.cli.common import RuleText, lang_option, rule_text, stdout
from ds47.report.bilingual import say
from ds47.report.wrap import padded, wrap

_WIDTH = 100
"""Columns of a line of an explanation."""


@click.command("rules")
@click.argument("names", metavar="[RULE]...", nargs=-1)
@lang_option
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
def command(names: Sequence[str], lang: str, format_name: str) -> None:
    """List the rules, or explain those named (DS301; DS3 for all that begin so)."""
    chosen = _chosen(names, lang)
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text

        lines = ",\n".join(text(rule._asdict()) for rule in chosen)
        stream.write(f"[\n{lines}\n]\n")
    elif names:
        stream.write("\n".join(_explained(rule, lang) for rule in chosen))
    else:
        width = max((len(rule.name) for rule in chosen), default=0)
        for rule in chosen:
            severity = padded(say(f"severity_{rule.severity}").text(lang), 7)
            stream.write(f"{rule.id}  {severity}  {rule.name:<{width}}  {rule.message}\n")


def _chosen(names: Sequence[str], lang: str) -> list[RuleText]:
    from ds47 import spec

    rules = spec.rules()
    wanted = tuple(name.strip().upper() for name in names)
    for name in wanted:
        if not name or not any(rule.startswith(name) for rule in rules):
            raise click.UsageError(f"no rule begins with {name!r}; ds47 rules lists them")
    found = [rule for key, rule in sorted(rules.items()) if not wanted or key.startswith(wanted)]
    return [rule_text(rule, lang) for rule in found]


def _explained(rule: RuleText, lang: str) -> str:
    severity = say(f"severity_{rule.severity}")
    lines = [say("rules_entry", rule=rule.id, name=rule.name, severity=severity).text(lang)]
    for key, text in (
        ("rules_message", rule.message),
        ("rules_cause", rule.cause),
        ("rules_advice", rule.advice),
    ):
        told = say(key, text=" ".join(text.split())).text(lang)
        lines += ("  " + line for line in wrap(told, _WIDTH - 2, 2))
    return "\n".join(lines) + "\n"
