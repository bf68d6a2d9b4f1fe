"""`ds47 explain`: a status or code in words: what it means, what the PLC shows, why, what to do.

The meanings are `ds47.explain`; here only their layout. The likeliest is shown in full, the others
in short: an answer fits on a screen and begins with the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import lang_option, stdout
from ds47.report.wrap import columns, wrap

if TYPE_CHECKING:
    from ds47.explain import Block, Meaning, Reason

_WIDTH = 100
_LABEL = 12
_WITH_CAUSE = 2


@click.command("explain", context_settings={"ignore_unknown_options": True})
@click.argument("code", nargs=-1, required=True)
@click.option("--vendor", metavar="NAME|ID", help="Whose device: SINAMICS, ABB, 0x002A.")
@lang_option
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
def command(code: Sequence[str], vendor: str | None, lang: str, format_name: str) -> None:
    """Explain a status or code: DE80B500, 16#80B5, 00700200, 0x6B, 107, 16#44, 82, DS410, REAL.

    Where a number means several things a word in front picks one: error 82, response 82, format 8.
    A format may be given by its name, or by that of the type in a PLC: Float32, REAL.
    """
    text = " ".join(code)
    for word in code:
        if word.startswith("-") and not word[1:].isdigit():
            raise click.NoSuchOption(word)
    meanings = _explained(text, vendor, lang)
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text as json_text

        document = {"code": text, "lang": lang, "meanings": list(map(_plain, meanings))}
        stream.write(json_text(document) + "\n")
    else:
        stream.write("\n".join(_lines(meanings, lang)) + "\n")


def _plain(meaning: Meaning) -> dict[str, Any]:
    """A meaning for JSON: RDREC has VALID where WRREC has DONE."""
    item = asdict(meaning)
    del item["rank"]
    for block in item["plc"]:
        if block["block"] == "RDREC":
            block["valid"] = block.pop("done")
    return item


def _explained(text: str, vendor: str | None, lang: str) -> list[Meaning]:
    from ds47 import spec
    from ds47.explain import UnknownFormError, explain, find_vendor
    from ds47.spec import explanations

    try:
        maker = None if vendor is None else find_vendor(vendor)
    except UnknownFormError as problem:
        known = ", ".join(each.name for each in spec.vendors())
        raise click.UsageError(
            f"no vendor {vendor!r}: a PROFINET vendor id, or one of {known}"
        ) from problem
    try:
        return explain(text, lang, maker)
    except UnknownFormError as problem:
        raise click.ClickException(f"{text!r} is no code; {explanations.forms(lang)}") from problem


def _lines(meanings: Sequence[Meaning], lang: str) -> Iterator[str]:
    """The first meaning in full, of the others what they are, those without meaning in one line."""
    from ds47.spec import explanations

    words = explanations.words(lang)
    yield from _full(meanings[0], words)
    if len(meanings) > 1:
        yield ""
    others = [each for each in meanings[1:] if each.known]
    for number, meaning in enumerate(others):
        yield from _wrapped(f"{words['or']} {meaning.title}", 2)
        if number < _WITH_CAUSE and meaning.causes:
            yield from _labelled(words["causes"], _cause(meaning.causes[0], words))
    empty = [each.title for each in meanings[1:] if not each.known]
    if empty:
        yield from _wrapped(words["nothing"].format(list=words["list_separator"].join(empty)), 2)
    if others:
        yield words["more"].format(command=others[0].name)


def _full(meaning: Meaning, words: Mapping[str, str]) -> Iterator[str]:
    yield from _wrapped(meaning.title, 2)
    if meaning.parts:
        parts = (" ".join(filter(None, (p.value, p.name, p.text))) for p in meaning.parts)
        label = words["names" if meaning.kind == "format" else "parts"]
        yield from _labelled(label, words["part_separator"].join(parts))
    for label, block in zip([words["plc"], "", ""], meaning.plc, strict=False):
        yield from _labelled(label, _block(block, words), 2)
    numbered = len(meaning.causes) > 1
    for number, cause in enumerate(meaning.causes, 1):
        text = _cause(cause, words)
        label = words["causes"] if number == 1 else ""
        yield from _labelled(label, f"{number}. {text}" if numbered else text, 3 * numbered)
    if meaning.advice:
        yield from _labelled(words["advice"], meaning.advice)
    yield from _labelled(words["look"], meaning.look)
    if meaning.filter:
        yield _label(words["filter"]) + meaning.filter
    if meaning.plugin_filter:
        label = words["plugin_filter" if meaning.filter else "filter"]
        yield _label(label) + meaning.plugin_filter


def _cause(cause: Reason, words: Mapping[str, str]) -> str:
    return cause.text + words["bracket"].format(text=words[cause.basis])


def _block(block: Block, words: Mapping[str, str]) -> str:
    """`RDREC VALID 0  BUSY 0  ERROR 1  STATUS 16#DE80B500  (for one call only)`."""
    if not block.block:
        return block.note
    if block.done is None:
        return f"{block.block}  {block.note}"
    done = "VALID" if block.block == "RDREC" else "DONE"
    outputs = ((done, block.done), ("BUSY", block.busy), ("ERROR", block.error))
    shown = "  ".join(f"{name} {int(bool(value))}" for name, value in outputs)
    note = words["bracket"].format(text=block.note)
    return f"{block.block}  {shown:<24}  STATUS 16#{block.status} {note}"


def _labelled(label: str, text: str, hanging: int = 0) -> Iterator[str]:
    lines = wrap(text, _WIDTH - _LABEL - 2, hanging)
    for number, line in enumerate(lines):
        yield _label(label if number == 0 else "") + line


def _label(text: str) -> str:
    return "  " + text + " " * max(1, _LABEL - columns(text))


def _wrapped(text: str, hanging: int) -> list[str]:
    return wrap(text, _WIDTH, hanging)
