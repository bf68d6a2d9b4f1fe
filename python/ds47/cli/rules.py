"""`ds47 rules`: the catalogue of findings, or one of them explained.

The texts themselves are in spec/rules.toml.
"""

from __future__ import annotations

from collections.abc import Sequence

import click

from ds47.cli.common import RuleWords, columns_of, lang_option, prose_width, rule_text, stdout, tell
from ds47.cli.helping import helped
from ds47.report.bilingual import say
from ds47.report.table import table
from ds47.report.wrap import fitted, wrap


@helped("rules", ("ds47 rules DS705", "what a finding means, and what to do"))
@click.argument("names", metavar="[RULE]...", nargs=-1)
@lang_option
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
def command(names: Sequence[str], lang: str, format_name: str) -> None:
    """List the rules, or explain those named: DS301, DS3 for all that begin with it, or drive-error.

    Any other word lists the rules whose name or text contains it.
    """
    chosen, searched = _chosen(names, lang)
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text

        lines = ",\n".join(text(rule._asdict()) for rule in chosen)
        stream.write(f"[\n{lines}\n]\n")
    elif names and not searched:
        width = prose_width()
        stream.write("\n".join(_explained(rule, lang, width) for rule in chosen))
    else:
        rows = [
            (rule.id, say(f"severity_{rule.severity}").text(lang), rule.name, rule.message)
            for rule in chosen
        ]
        tell(table(rows, columns_of(), lead=range(3), indent=0))


def _chosen(names: Sequence[str], lang: str) -> tuple[list[RuleWords], bool]:
    """The rules that the words mean, in the order of their ids; and whether one had to be searched for."""
    from ds47 import spec

    rules = {key: rule_text(rule, lang) for key, rule in sorted(spec.rules().items())}
    found: set[str] = set() if names else set(rules)
    searched = False
    for name in names:
        prefix = spec.rule_prefix(name)
        if prefix is not None:
            found.update(key for key in rules if key.startswith(prefix))
            continue
        searched = True
        having = {key for key, rule in rules.items() if _has(rule, name)}
        if not having:
            raise click.UsageError(f"no rule has {name!r} in its name or text. Try: ds47 rules")
        found |= having
    return [rule for key, rule in rules.items() if key in found], searched


def _has(rule: RuleWords, word: str) -> bool:
    """Whether a word stands in a rule, in whatever case; no word stands in none."""
    wanted = " ".join(word.casefold().split())
    texts = [" ".join(text.casefold().split()) for text in rule if isinstance(text, str)]
    return bool(wanted) and any(wanted in text for text in texts)


def _explained(rule: RuleWords, lang: str, width: int) -> str:
    severity = say(f"severity_{rule.severity}")
    lines = [say("rules_entry", rule=rule.id, name=rule.name, severity=severity).text(lang)]
    for key, text in (
        ("rules_message", rule.message),
        ("rules_args", rule.args),
        ("rules_cause", rule.cause),
        ("rules_advice", rule.advice),
    ):
        if not text:
            continue
        shown = say(key, text=" ".join(text.split())).text(lang)
        lines += ("  " + line for line in wrap(shown, width - 2, 2))
    if rule.analyzer_only:
        lines += fitted("  " + say("rules_analyzer_only").text(lang), width)
    if rule.changed:
        lines += fitted("  " + say("rules_changed", text=", ".join(rule.changed)).text(lang), width)
    return "\n".join(lines) + "\n"
