"""Whether a sentence says just its arguments: the one place where something is read out of a sentence.

Each rule has its expression here: where in its sentence which argument stands. Numbers that stand elsewhere in a
sentence must be arguments too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from tests.audit.reading import Complaint, Finding, Reading

NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
PARAMETER = r"[pr]?(?P<pnu>\d+|\?)\[(?P<subindex>\d+|\?)\]"
CODE = r"(?P<code>0x[0-9A-F]{2,4}|-)"
STATUS = r"status (?P<status>[0-9A-F]{8}|-)"
SAYS: dict[str, str] = {
    "DS101": r"RPC (?P<operation>\w+) request",
    "DS102": r"RPC (?P<operation>\w+) response",
    "DS103": r"RPC (?P<operation>\w+) request .*frame (?P<first>\d+|\?)",
    "DS104": r"RPC (?P<kind>\w+) with code (?P<fault>0x[0-9A-F]{8})",
    "DS105": r"(?P<kind>RPC|IP) fragments .* (?P<have>\d+)",
    "DS106": r"(?P<captured>\d+) of (?P<original>\d+) bytes",
    "DS107": r"by (?P<milliseconds>[\d.]+) ms",
    "DS201": STATUS,
    "DS202": r"says (?P<stated>\d+) bytes, (?P<present>\d+)",
    "DS203": STATUS,
    "DS204": r"(?P<count>\d+) times",
    "DS205": r"(?P<milliseconds>[\d.]+) ms .*limit (?P<limit>\d+) ms",
    "DS206": STATUS,
    "DS302": r"ID (?P<id>0x[0-9A-F]{2})",
    "DS304": r"parameters (?P<count>\d+) is above (?P<limit>\d+)",
    "DS305": r"attribute (?P<attribute>0x[0-9A-F]{2})",
    "DS307": r"elements (?P<count>\d+) is above (?P<limit>\d+)",
    "DS308": r"Subindex (?P<subindex>\d+) with (?P<count>\d+)",
    "DS309": r"format (?P<format>0x[0-9A-F]{2})",
    "DS310": r"(?P<values>\d+) values for (?P<elements>\d+)",
    "DS312": r"is (?P<pad>0x[0-9A-F]{2})",
    "DS313": r"(?P<count>\d+)$",
    "DS314": r"(?P<count>\d+)$",
    "DS315": r"missing: (?P<need>\d+) \((?P<what>.*)\)",
    "DS316": r"of (?P<length>\d+) bytes is longer than (?P<limit>\d+)",
    "DS317": r"Format (?P<format>\w+) .*with (?P<size>\d+) bytes",
    "DS318": r"with (?P<count>\d+) words",
    "DS319": r"ID (?P<id>0x[0-9A-F]{2})",
    "DS404": r"sent (?P<sent>\d+), got (?P<got>\d+)",
    "DS405": r"ID (?P<got>0x[0-9A-F]{2}) .*request ID (?P<sent>0x[0-9A-F]{2})",
    "DS406": r"sent (?P<sent>\d+), got (?P<got>\d+)",
    "DS407": r"asked for (?P<sent>\d+), got (?P<got>\d+)",
    "DS408": r"Parameter (?P<pnu>\d+|\?)\D.* (?P<got>\d+) of (?P<asked>\d+)",
    "DS409": r"Parameter (?P<pnu>\d+|\?)\D.* (?P<got>\d+) instead of (?P<asked>\d+)",
    "DS410": rf"{PARAMETER}.*error {CODE}.*\(info (?P<info>\d+|-)\)",
    "DS413": r"frame (?P<request>\d+) .*frame (?P<by>\d+)",
    "DS414": r"frame (?P<request>\d+) .*frame (?P<by>\d+)",
    "DS415": r"reference (?P<reference>\d+) ",
    "DS416": r"took (?P<milliseconds>[\d.]+) ms .*limit (?P<limit>\d+) ms",
    "DS417": rf"{PARAMETER} reads back (?P<read>\S+), but (?P<written>\S+) was",
    "DS418": r"request ID (?P<id>0x[0-9A-F]{2})",
    "DS701": rf"response ID (?P<id>0x[0-9A-F]{{2}}), {CODE}",
    "DS702": r"in frame (?P<frame>\d+), .*frame (?P<by>\d+)",
    "DS703": r"(?P<count>\d+) x .* on (?P<device>[\d.]+) ",
    "DS704": r"in frame (?P<frame>\d+) .*of frame (?P<first>\d+)",
    "DS706": r"in frame (?P<request>\d+) .*frame (?P<frame>\d+)\)",
    "DS707": r"index (?P<index>\d+|0x[0-9A-F]{4}) of (?P<device>[\d.]+) \((?P<status>[0-9A-F]{8}|-)\)",
    "DS708": r"^(?P<device>[\d.]+) .*\((?P<status>[0-9A-F]{8})\)",
    "DS709": r"\(axis\) (?P<axis>\d+) .* (?P<device>[\d.]+)$",
    "DS710": r"\((?P<axes>[\d, ]+)\)",
    "DS711": r"after (?P<have>\d+) bytes but needs (?P<need>\d+)",
    "DS712": r"for (?P<asked>\d+) bytes .*needs (?P<need>\d+)",
    "DS713": r"all of (?P<parameters>\d+) .*into (?P<limit>\d+) bytes: (?P<number>\d+)",
    "DS714": rf"{PARAMETER} is written as (?P<format>\w+) (?P<values>.*); .* is (?P<better>\w+) "
             r"\((?P<code>0x[0-9A-F]{2})\) (?P<meant>.*)$",
    "DS715": r"swapped: (?P<meant>.*)$",
    "DS716": r": (?P<meant>.*)$",
    "DS717": rf"{PARAMETER} with number of elements (?P<elements>\d+) .*: {CODE} ",
    "DS718": rf"{PARAMETER} .* with (?P<state>.*?): {CODE} ",
    "DS719": rf"{PARAMETER} .*: {CODE} ",
    "DS720": rf"{PARAMETER} .* as (?P<format>\w+) (?P<value>\S+): {CODE} ",
    "DS721": r"(?P<count>\d+) change.* on (?P<device>[\d.]+) .*frame (?P<last>\d+)\)",
    "DS722": r"frame (?P<frame>\d+|\?)",
    "DS723": r"(?P<count>\d+) times to (?P<device>[\d.]+), every (?P<period>[\d.]+) ms",
    "DS724": r"(?P<count>\d+) Reads on (?P<device>[\d.]+) .*every (?P<period>[\d.]+) ms.* (?P<time>[\d.]+) ms",
    "DS725": r"\((?P<count>\d+) times?\)",
}  # fmt: skip
"""Rule -> where in its English sentence which argument stands."""
FREE = {"DS705": "the clause of each case names its frames, its stations and its ARs"}
"""Rules whose sentence has no one form; their numbers are looked at all the same."""
SILENT = {"vendor_id", "dropped", "reason", "what", "case", "place", "other", "device"}
"""Arguments that no number in the sentence shows."""
OWN = {"DS701": {"0"}, "DS703": {"0xDE80B500"}, "DS204": {"0xDE80B500"}, "DS301": {"0"}, "DS303": {"0"},
       "DS306": {"0"}, "DS308": {"65535"}, "DS312": {"0"}, "DS318": {"1", "2"}, "DS317": {"2"},
       "DS418": {"0x80"}, "DS721": {"971", "977"}}  # fmt: skip
"""Numbers that stand in the sentence of every finding of a rule."""
_WORDS = {"DS410", "DS201", "DS203", "DS701", "DS717", "DS718", "DS719", "DS720", "DS715", "DS716"}
"""Rules that end in the words of an error number, or in a line: numbers inside those are not looked at."""


def check(finding: Finding, reading: Reading) -> Iterator[Complaint]:
    """Whether the sentence of a finding is that of its arguments."""
    for text in problems(finding.rule, finding.message, finding.args):
        yield Complaint(finding.rule, f"frame {finding.frame}, sentence", text)


def problems(rule: str, sentence: str, args: dict[str, Any]) -> Iterator[str]:
    """What is wrong with a sentence of these arguments."""
    text = re.sub(r"^offset \d+: ", "", sentence)
    form = SAYS.get(rule)
    found = re.search(form, text) if form else None
    if form and found is None:
        yield f"has another form: {text!r}"
        return
    for name, told in found.groupdict().items() if found else ():
        if name in args and told not in renderings(args[name]):
            yield f"says {name} {told}, which is {args[name]!r}"
        if name not in args:
            yield f"says {name} {told}, which is no argument"
    shown = set(found.groupdict()) if found else set()
    for name in set(args) - shown - SILENT if form else ():
        yield f"does not say {name} {args[name]!r}"
    if rule not in _WORDS:
        yield from _strangers(rule, text, args)


def _strangers(rule: str, text: str, args: dict[str, Any]) -> Iterator[str]:
    """Numbers in a sentence that no argument has."""
    allowed = set(OWN.get(rule, ()))
    for value in args.values():
        for word in renderings(value):
            allowed |= {word, *re.findall(r"0x[0-9A-F]+|\d+", word)}
    for word in re.findall(r"0x[0-9A-F]+|[0-9A-F]{8}|\b\d+(?:\.\d+)*", text):
        if word not in allowed and "0x" + word not in allowed and not _part(word, allowed):
            yield f"says {word}, which is in no argument"


def _part(word: str, allowed: set[str]) -> bool:
    return any(word in each for each in allowed if len(each) > len(word))


def renderings(value: Any) -> set[str]:
    """The ways in which an argument may stand in a sentence."""
    if value is None:
        return {"-", "?"}
    if isinstance(value, bool):
        return {str(value)}
    if isinstance(value, int):
        words = {str(value), f"0x{value:02X}", f"0x{value:04X}", f"0x{value:08X}", f"{value:.1f}"}
        return words | {f"{float(value):.3f}"}
    if isinstance(value, float):
        return {str(value), f"{value:.1f}", f"{value:.3f}", repr(value)}
    if isinstance(value, dict):
        return {"{}.{}".format(value.get("slot"), value.get("subslot")), *(
            word for each in value.values() for word in renderings(each)
        )}  # fmt: skip
    if isinstance(value, list):
        parts = [str(each) for each in value]
        cut = [*parts[:4], "..."] if len(parts) > 4 else parts
        return {", ".join(parts), ", ".join(cut)} if parts else {"-"}
    text = str(value)
    return {text, text[:97] + "..." if len(text) > 100 else text}
