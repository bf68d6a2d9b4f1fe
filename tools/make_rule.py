#!/usr/bin/env python3
"""Writes the skeletons of a new rule, to be filled in (docs/developers/development.md).

    python tools/make_rule.py DS419            make rule ID=DS419

Its entry in spec/rules.toml, a conversation and an auditor: each fails a test as long as it says TODO. The
condition is yours to write; the modules that judge rules of these hundreds are named.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from ds47.version import __version__

ROOT = Path(__file__).resolve().parent.parent
RULES = "python/ds47/spec/rules.toml"
BOOK, CLAIMS = "tests/vectors/sources/conversations.py", "tests/audit/claims.py"
PLACES = {
    "1": ("profinet/calls", BOOK, CLAIMS), "2": ("acyclic/record_events", BOOK, CLAIMS),
    "3": ("profidrive/parameter", BOOK, CLAIMS), "4": ("acyclic/judge", BOOK, CLAIMS),
    "5": ("cyclic/judge", "python/ds47/lab/cyclic_scenes.py", "tests/audit/pzd.py"),
    "7": ("diagnosis/refusal", "tests/vectors/sources/diagnoses.py", "tests/audit/causes.py"),
    "8": ("profibus/judge", "python/ds47/lab/profibus_scenes.py", "tests/audit/stations.py"),
    "9": ("s7/judge", "tests/python/s7_scenes.py", "tests/audit/s7.py"),
}  # fmt: skip
"""Hundreds of an id -> the module that judges there, the scenes, the auditor."""
ANALYZERS = "89"
"""Hundreds whose rules the plugin has not."""

ENTRY = """\
[[rule]]
id = "{rule}"
name = "todo"
title = "TODO"
severity = "warning"
scope = "transaction"
anchor = "request"
expert = "sequence"
{only}changed = ["{version}"]
args = {{ }}
message = "TODO"
cause = "TODO."
advice = "TODO."
title_zh = "TODO"
message_zh = "TODO"
cause_zh = "TODO。"
advice_zh = "TODO。"
"""
SCENE = '''

@BOOK.scene("none", row(1), rules="{rule}@1#1")
def {name}_todo(client: Client) -> None:
    """TODO: what happens, and why it is {rule}."""
    client.exchange(ask(1), tell(1, 10.0))
'''
AUDITOR = """

@auditor("{rule}")
def _{name}(case: Case) -> Iterator[str]:
    yield "TODO: what of this finding is not so, by the frames alone"
"""


END = '\n\n\nif __name__ == "__main__":'


def put_entry(text: str, rule: str) -> str:
    """The catalogue with the entry of a rule in its place. ValueError where there is one."""
    ids = re.findall(r'^id = "(DS\d+)"$', text, re.MULTILINE)
    if rule in ids:
        raise ValueError(f"{rule} is in {RULES} already")
    only = "analyzer_only = true\n" if rule[2] in ANALYZERS else ""
    version = __version__.partition(".dev")[0]
    entry = ENTRY.format(rule=rule, only=only, version=version)
    following = next((each for each in ids if each > rule), None)
    if following is None:
        return f"{text}\n{entry}"
    return text.replace(f'[[rule]]\nid = "{following}"', f'{entry}\n[[rule]]\nid = "{following}"')


def write(root: Path, rule: str) -> list[str]:
    """Writes the skeletons into a checkout; what is left to do, a line each."""
    name = rule.lower()
    room, scenes, auditor = PLACES[rule[2]]
    catalogue = root / RULES
    catalogue.write_text(put_entry(catalogue.read_text("utf-8"), rule), "utf-8")
    if scenes.startswith("tests/vectors"):  # in other books a scene is more than a skeleton can say
        book, claims = root / scenes, root / auditor
        before, end, behind = book.read_text("utf-8").rpartition(END)
        scene = SCENE.format(rule=rule, name=name).rstrip()
        book.write_text(f"{before}\n{scene}{end}{behind}", "utf-8")
        with claims.open("a", encoding="utf-8") as file:
            file.write(AUDITOR.format(rule=rule, name=name))
    conditions = [f"python/ds47/{room}.py"] + [f"lua/ds47/{room}.lua"] * (rule[2] not in ANALYZERS)
    return [
        f"{RULES}: the texts, English and Chinese, and the arguments",
        *(f"{path}: the condition" for path in conditions),
        f"{scenes}: a scene that shows {rule}, and one nearby that does not",
        f"{auditor}: what decides from the frames alone whether {rule} is true",
        "CHANGELOG.md: a line",
        "then: make generated; make test; where stored captures have it, .venv/bin/ds47 accept captures",
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rule", metavar="DSnnn")
    rule = parser.parse_args().rule
    if not re.fullmatch(rf"DS[{''.join(PLACES)}]\d\d", rule):
        parser.error(f"{rule!r} is no id of a rule of the analysis: DS and three digits, not DS6xx")
    try:
        print("To be filled in:", *write(ROOT, rule), sep="\n  ")
    except ValueError as problem:
        parser.error(str(problem))
    return 0


if __name__ == "__main__":
    sys.exit(main())
