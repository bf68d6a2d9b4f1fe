#!/usr/bin/env python3
"""Writes the skeletons of a new rule, to be filled in (docs/developers/development.md).

    python tools/make_rule.py DS4              make rule ID=DS4       the next of DS4xx
    python tools/make_rule.py DSnnn            make rule ID=DSnnn     that one, where it leaves no gap

Its entry in spec/rules.toml, its condition in Python and in Lua (make_rule.toml), a scene of the lab, the vectors
and an auditor: a file that says TODO fails a test that names it. What it cannot write is told.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path

from ds47.version import __version__

ROOT = Path(__file__).resolve().parent.parent
RULES, LAB = "python/ds47/spec/rules.toml", "python/ds47/lab/"
TALKS, CAUSES = "tests/vectors/sources/conversations.py", "tests/vectors/sources/diagnoses.py"
CLAIMS = "tests/audit/claims.py"
PLACES = {
    "1": ("acyclic/record_calls", "transport", TALKS, CLAIMS),
    "2": ("acyclic/judge", "records", TALKS, CLAIMS),
    "3": ("profidrive/parameter", "messages", "tests/vectors/sources/messages.py", CLAIMS),
    "4": ("acyclic/judge", "conversation", TALKS, CLAIMS),
    "51": ("cyclic/judge", "cyclic_scenes", None, "tests/audit/pkw.py"),
    "5": ("cyclic/operation", "cyclic_scenes", None, "tests/audit/pzd.py"),
    "7": ("diagnosis/refusal", "diagnoses", CAUSES, "tests/audit/causes.py"),
    "8": ("profibus/judge", "profibus_scenes", None, "tests/audit/stations.py"),
    "9": ("s7/judge", "tests/python/s7_scenes", None, "tests/audit/s7.py"),
}  # fmt: skip
"""Hundreds, or tens, of an id -> the module that judges, that of the lab with scenes, the vectors, the auditor."""
CONDITIONS = ROOT / "tools" / "make_rule.toml"
ANALYZERS = "89"
"""Hundreds whose rules the plugin has not."""

IDS = re.compile(r'^id = "(DS\d+)"$', re.MULTILINE)
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

@BOOK.scene("TODO: what a reader of the capture sees", "read ok, {rule}")
def todo(client: Client) -> None:
    """TODO: what happens; the name of the function becomes that of the capture."""
    answer = message.answer(1, 1, 1, message.real(10.0))
    client.exchange(message.read(1, 1, message.address(21)), answer)
'''
VECTORS = '''

BOOK.lab("{rule}", "{topic}-todo", "none", row(1, real(10.0)), rules="{rule}@1#1")


@BOOK.scene("none", row(1, real(10.0)))
def {name}_todo(client: Client) -> None:
    """TODO: what is nearby and not {rule}."""
    client.exchange(ask(1), tell(1, 10.0))
'''
AUDITOR = """

@auditor("{rule}")
def _{name}(case: Case) -> Iterator[str]:
    yield "TODO: what of this finding is not so, by the frames alone"
"""
IN_TABLE = """def _{name}({takes}) -> Iterator[str]:
    yield "TODO: what of this finding is not so, by the frames alone"


"""
TABLE = re.compile(r"^AUDITORS: .* = \{\n(?: .*\n)*", re.MULTILINE)
TAKES = {
    "tests/audit/pkw.py": "finding: Finding, talk: Talk",
    "tests/audit/pzd.py": "finding: Finding, drive: Drive",
    "tests/audit/stations.py": "case: Case, station: Station",
}
"""Modules whose auditors stand in a table -> what each of them takes."""


END = '\n\n\nif __name__ == "__main__":'


def following(ids: Sequence[str], rule: str) -> str:
    """The id of a new rule: that which is given, or the next of its hundred. ValueError where it cannot be one."""
    free = [after for each in ids if (after := f"DS{int(each[2:]) + 1}") not in ids]
    of_hundred = [each for each in free if each[2] == rule[2]]
    if len(rule) == len("DS4"):
        return of_hundred[-1]
    if rule in ids:
        raise ValueError(f"{rule} is in {RULES} already")
    if rule not in of_hundred:
        raise ValueError(f"{rule} leaves a gap: the next is {' or '.join(of_hundred)}")
    return rule


def put_entry(text: str, rule: str) -> str:
    """The catalogue with the entry of a rule in its place."""
    only = "analyzer_only = true\n" if rule[2] in ANALYZERS else ""
    version = __version__.partition(".dev")[0]
    entry = ENTRY.format(rule=rule, only=only, version=version)
    behind = next((each for each in IDS.findall(text) if each > rule), None)
    if behind is None:
        return f"{text}\n{entry}"
    return text.replace(f'[[rule]]\nid = "{behind}"', f'{entry}\n[[rule]]\nid = "{behind}"')


def put_condition(text: str, rule: str, path: str) -> tuple[str, str]:
    """The module that judges with the stub of a condition, and what that is called."""
    where = {
        name: each.replace("DSnnn", rule).replace("dsnnn", rule.lower()).strip("\n")
        for name, each in tomllib.loads(CONDITIONS.read_text("utf-8"))[path].items()
    }
    beside, call, stub = where.get("after") or where["ahead"], where["call"], where["stub"]
    called = f"{beside}\n{call}\n" if "after" in where else f"{call}\n{beside}"
    gap = "\n\n\n" if stub.startswith("def ") else "\n\n"
    for old, new in (
        (beside + "\n" * ("after" in where), called),
        (f"\n{where['before']}", f"\n{stub}{gap}{where['before']}"),
    ):
        if text.count(old) != 1:
            raise ValueError(f"{old!r} does not stand once in {path}: mend tools/make_rule.toml")
        text = text.replace(old, new)
    (name,) = re.findall(r"^(?: *def|local function|function \w+:) ?(\w+)\(", stub, re.MULTILINE)
    return text, str(name)


def put_auditor(text: str, rule: str, takes: str | None = None) -> str:
    """The auditors with one more, at the end of the section of its hundred; where it `takes` this, in a table."""
    if takes is not None:
        (table,) = TABLE.findall(text)
        function = IN_TABLE.format(name=rule.lower(), takes=takes)
        return text.replace(table, f'{function}{table}    "{rule}": _{rule.lower()},\n')
    begin = text.index(f'@auditor("{rule[:3]}')
    end = re.compile(r"\n\n\n# |\n\Z").search(text, begin)
    assert end is not None
    auditor = AUDITOR.format(rule=rule, name=rule.lower())
    return f"{text[: end.start()]}\n{auditor.rstrip()}{text[end.start() :]}"


def put_vectors(text: str, rule: str, scenes: str) -> str:
    """The vectors with those that take over the scene of a rule; `scenes`: the text of its book."""
    (topic,) = re.findall(r'^BOOK = Book\("(\w+)"\)', scenes, re.MULTILINE)
    case = VECTORS.format(rule=rule, name=rule.lower(), topic=topic).rstrip()
    before, end, rest = text.rpartition(END)
    return f"{before}\n{case}{end}{rest}"


def write(root: Path, wanted: str) -> list[str]:
    """Writes the skeletons into a checkout; what is left to do, a line each."""
    rule = following(IDS.findall((root / RULES).read_text("utf-8")), wanted)
    room, lab, vectors, auditor = PLACES.get(rule[2:4]) or PLACES[rule[2]]
    scenes = f"{lab}.py" if "/" in lab else f"{LAB}{lab}.py"
    judges = [f"python/ds47/{room}.py"] + [f"lua/ds47/{room}.lua"] * (rule[2] not in ANALYZERS)
    played = vectors in (TALKS, CAUSES)  # in other books a scene is more than a skeleton can say
    paths = (RULES, auditor, *judges, *((scenes, vectors) if played else ()))
    texts = {path: (root / path).read_text("utf-8") for path in paths}
    left = [f"{RULES}: the texts, English and Chinese, and the arguments"]
    texts[RULES] = put_entry(texts[RULES], rule)
    for path in judges:
        texts[path], name = put_condition(texts[path], rule, path)
        left.append(f"{path}: the condition, in {name}")
    if played:
        texts[vectors] = put_vectors(texts[vectors], rule, texts[scenes])
        texts[scenes] += SCENE.format(rule=rule)
    texts[auditor] = put_auditor(texts[auditor], rule, TAKES.get(auditor))
    for path, text in texts.items():
        (root / path).write_text(text, "utf-8", newline="\n")
    near = "" if vectors else ", and one nearby that does not"
    left.append(f"{scenes}: a scene that shows {rule}{near}")
    if vectors:
        left.append(
            f"{vectors}: the same with all that is expected, and one nearby that is not {rule}"
        )
    if rule[2] == "8":
        left.append(f"{LAB}profibus_stories.py: a story that has it, which becomes a capture")
    tests = "test_lab.py and test_conversations.py name"
    tests = tests if vectors else f"test_{Path(lab).name}.py names"
    return [
        *left,
        f"{auditor}: what decides from the frames alone whether {rule} is true",
        "CHANGELOG.md: a line",
        f"then: {tests} the older scenes that have it, too; add {rule} to what they expect",
        "then: make captures; .venv/bin/ds47 accept --yes captures; make generated; make test",
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rule", metavar="DSnnn")
    rule = parser.parse_args().rule
    if not re.fullmatch(rf"DS[{''.join(PLACES)}](\d\d)?", rule):
        parser.error(f"{rule!r} is no rule of the analysis: DS4 for the next of DS4xx; not DS6xx")
    try:
        print("To be filled in:", *write(ROOT, rule), sep="\n  ")
    except ValueError as problem:
        parser.error(str(problem))
    return 0


if __name__ == "__main__":
    sys.exit(main())
