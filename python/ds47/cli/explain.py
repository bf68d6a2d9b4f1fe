"""`ds47 explain`: a status or code in words: what it means, what the PLC shows, why, what to do.

The meanings are `ds47.explain`, their layout is `ds47.report.explanation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import lang_option, prose_width, stdout, tell, warn
from ds47.cli.helping import Helped

if TYPE_CHECKING:
    from ds47.explain import CodeMeaning
    from ds47.report.known import SourceEntry

_OF_LISTS = ("parameter", "fault")
"""Kinds of meanings that lists may say more of."""
_LONGEST = 5
"""Digits of the number of a fault or an alarm."""


@click.command(
    "explain",
    context_settings={"ignore_unknown_options": True},
    cls=Helped,
    examples=(
        ("ds47 explain DE80B500", "a STATUS of WRREC or RDREC"),
        ("ds47 explain p1120 0x6B", "a parameter and an error number"),
    ),
)
@click.argument("code", nargs=-1, required=True)
@click.option("--vendor", metavar="NAME|ID", help="Whose device: SINAMICS, ABB, 0x002A.")
@lang_option
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
def command(code: Sequence[str], vendor: str | None, lang: str, format_name: str) -> None:
    """Explain a status or code: DE80B500, 16#80B5, 00700200, 0x6B, 107, 82, DS410, REAL, p2900, F07900.

    Where a number means several things a word in front picks one, as in error 82: error, response, request,
    attribute, format, index, status, parameter, fault, alarm, stw1, zsw1, SFC14, SFC58, s7.
    Several codes are explained one after the other.
    A format may be given by its name, or by that of the type in a PLC: Float32, REAL.
    """
    for word in code:
        if word.startswith("-") and not word[1:].isdigit():
            raise click.NoSuchOption(word)
    for number, text in enumerate(_codes(code, vendor, lang)):
        if number and format_name == "text":
            stdout().write("\n")
        _print(text, vendor, lang, format_name)


def _codes(words: Sequence[str], vendor: str | None, lang: str) -> list[str]:
    """What is to be explained: all words together where that is a code (`error 82`), else one after the other."""
    text = " ".join(words)
    several = len(words) > 1 and _is_code(words[0], lang)  # else it says what the others are
    if not several or _is_code(text, lang):
        return [text]
    for word in words:
        _explained(word, vendor, lang)
    return list(words)


def _is_code(text: str, lang: str) -> bool:
    from ds47.explain import UnknownFormError, explain

    try:
        explain(text, lang)
    except UnknownFormError:
        return False
    return True


def _print(text: str, vendor: str | None, lang: str, format_name: str) -> None:
    meanings = _explained(text, vendor, lang)
    plain = text.strip()
    bare = plain.isascii() and plain.isdecimal() and len(plain) <= _LONGEST
    listed = []
    if bare or meanings[0].kind in _OF_LISTS:
        listed = _listed(text, int(plain) if bare else None, lang)
    stream = stdout()
    if format_name == "json":
        from ds47.report.json import text as json_text

        document: dict[str, Any] = {
            "code": text, "lang": lang, "meanings": list(map(_plain, meanings)),
        }  # fmt: skip
        if listed:
            document["lists"] = [each._asdict() for each in listed]
        stream.write(json_text(document) + "\n")
    else:
        from ds47.report import known
        from ds47.report.explanation import lines

        tell(known.lines(listed))
        stream.write("\n".join(lines(meanings, lang, prose_width())) + "\n")


def _listed(text: str, number: int | None, lang: str) -> list[SourceEntry]:
    """What the lists that the user took in say of a parameter or a message; of a bare number as of a message.

    Args:
        text: what is explained.
        number: the same where it is a number alone.
        lang: "en" or "zh".
    """
    from ds47.parameters import lists, store
    from ds47.parameters.catalogue import Catalogue
    from ds47.report import known

    try:
        catalogue = Catalogue(found for _, found in store.kept())
    except lists.ListError as problem:
        warn(str(problem))
        return []
    if number is not None:
        return known.messages(number, catalogue, lang)
    return known.listed(text, catalogue, lang)


def _plain(meaning: CodeMeaning) -> dict[str, Any]:
    """A meaning for JSON: RDREC has VALID where WRREC has DONE."""
    item = asdict(meaning)
    del item["rank"]
    for block in item["plc"]:
        if block["block"] == "RDREC":
            block["valid"] = block.pop("done")
    return item


def _explained(text: str, vendor: str | None, lang: str) -> list[CodeMeaning]:
    from ds47.cli.common import no_vendor
    from ds47.explain import UnknownFormError, explain, find_vendor
    from ds47.spec import explanations
    from ds47.spec.maker_names import UnclearNameError

    try:
        maker = None if vendor is None else find_vendor(vendor)
    except UnclearNameError as problem:
        raise click.UsageError(no_vendor(problem.text, problem.near)) from problem
    try:
        return explain(text, lang, maker)
    except UnknownFormError as problem:
        forms = explanations.forms(lang)
        if not any(each.isdigit() for each in text):
            from ds47.spec.shell import shell_word

            forms += f"; a parameter by its name: ds47 params show {shell_word(text)}"
        raise click.ClickException(f"unknown code {text!r}. {forms}") from problem
