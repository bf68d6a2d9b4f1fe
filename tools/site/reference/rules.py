"""The catalogue of findings, from spec/rules.toml: what a rule reports, why, and what to do, in both languages."""

from __future__ import annotations

from pathlib import Path

from ds47 import spec
from ds47.spec import Rule

from .markdown import code, plain, table

_HEAD = """# Rules

Every finding has the id of a rule, and an id never changes its meaning. `ds47 rules` prints this list,
`ds47 rules DS410` one of them, `--select` and `--ignore` take ids, beginnings of ids (`DS3`) and names. A sentence
is shown with the names of the facts that it is filled with; JSON has these facts by the same names, under `args`.
The Wireshark plugin has all rules but those that are marked as the analyzer's.
"""
_GROUPS = {
    "1": "RPC and transport", "2": "Record calls of PROFINET", "3": "Format of DS47 messages",
    "4": "Conversation on the parameter channel", "5": "PKW and PZD in cyclic frames", "6": "Engines",
    "7": "Diagnoses", "8": "PROFIBUS", "9": "S7 communication",
}  # fmt: skip
"""What the first digit of an id says."""
_SCOPES = {
    "capture": "the capture", "transport": "a call or a frame", "record": "a record call",
    "message": "the bytes of a message", "transaction": "a transaction",
}  # fmt: skip


def page(_root: Path) -> str:
    """All rules, by their groups, with a table of them on top."""
    parts, digit = [_HEAD, _overview()], ""
    for rule in spec.rules().values():
        if rule.id[2] != digit:
            digit = rule.id[2]
            parts.append(f"## DS{digit}xx: {_GROUPS[digit]}\n")
        parts.append(_chapter(rule))
    return "\n".join(parts)


def _overview() -> str:
    rows = (
        (
            f"[{rule.id}](#{rule.id.lower()})",
            code(rule.name),
            rule.severity,
            "" if rule.analyzer_only else "yes",
            plain(rule.title),
        )
        for rule in spec.rules().values()
    )
    return table(("id", "name", "severity", "in Wireshark", "says"), rows)


def _chapter(rule: Rule) -> str:
    told = f"{rule.severity}, about {_SCOPES[rule.scope]}"
    if rule.analyzer_only:
        told += ", only in the analyzer"
    if rule.changed:
        told += f"; finds more or less than before from {', '.join(rule.changed)} on"
    parts = [
        f"### {rule.id} {rule.name} {{#{rule.id.lower()}}}",
        f"**{plain(rule.title)}** ({told})",
    ]
    parts += [f"```text\n{rule.message}\n```", f"**Why** {plain(rule.cause)}"]
    parts.append(f"**What to do** {plain(rule.advice)}")
    if rule.id[2] == "7":
        anchor = f"{rule.id}-{rule.name}-{rule.severity}".lower()
        parts.append(f"[The conversation, drawn](../diagnoses.md#{anchor})")
    if rule.args:
        carried = ", ".join(f"{code(name)} ({kind})" for name, kind in rule.args.items())
        parts.append(f"Carries {carried}.")
    parts.append(_chinese(rule))
    return "\n\n".join(parts) + "\n"


def _chinese(rule: Rule) -> str:
    """The same in Chinese, folded."""
    lines = [
        plain(rule.message_zh),
        f"**原因** {plain(rule.cause_zh)}",
        f"**处理** {plain(rule.advice_zh)}",
    ]
    body = "\n\n".join(f"    {line}" for line in lines)
    return f'??? quote "{rule.title_zh}"\n\n{body}'
