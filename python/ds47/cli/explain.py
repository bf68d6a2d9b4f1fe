"""`ds47 explain`: a status or code in words: what it means, what the PLC shows, why, what to do.

The meanings are `ds47.explain`, their layout is `ds47.report.explanation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from ds47.cli.common import lang_option, prose_width, refused, stdout, tell, warn
from ds47.cli.helping import helped

if TYPE_CHECKING:
    from ds47.explain import CodeMeaning
    from ds47.report.known import SourceEntry

_OF_LISTS = ("parameter", "fault")
"""Kinds of meanings that lists may say more of."""
_LONGEST = 5
"""Digits of the number of a fault or an alarm."""
_LINE = 140 - len("ds47: error: ")
_SHOWN = 24
"""Characters of a text that is no code: the rest of it says no more."""
_FOUND = 10
"""Parameters that are listed for a word of their names."""


@helped(
    "explain",
    ("ds47 explain DE80B500", "a STATUS of WRREC or RDREC"),
    ("ds47 explain p1120 0x6B", "a parameter and an error number"),
    ("ds47 explain SINA_POS 8402", "what a block shows"),
    context_settings={"ignore_unknown_options": True},
)
@click.argument("code", nargs=-1, required=True)
@click.option("--vendor", metavar="NAME|ID", help="Vendor of the device: SINAMICS, ABB, 0x002A.")
@lang_option
@click.option("-f", "--format", "format_name", type=click.Choice(["text", "json"]), default="text")
def command(code: Sequence[str], vendor: str | None, lang: str, format_name: str) -> None:
    """Explain a status or code: DE80B500, 16#80B5, 00700200, 0x6B, 107, 82, DS410, REAL, p2900, F07900.

    If a number has several meanings, put a word in front, as in error 82: error, response, request,
    attribute, format, index, status, parameter, fault, alarm, telegram, stw1, zsw1, cu_stw1, cu_zsw1,
    e_stw1, e_zsw1, pkw, SFC14, SFC58, s7.
    Or put a block in front, with or without its output: GET 2, SINA_PARA DiagId 80B5, SINA_POS 8402.
    A format has its own name or that of the PLC type: Float32, REAL.
    Any other word lists the parameters whose names contain it.
    """
    for word in code:
        if word.startswith("-") and not word[1:].isdigit():
            raise click.NoSuchOption(word)
    if format_name == "text" and _named(" ".join(code), lang):
        return
    for number, text in enumerate(_codes(code, vendor, lang)):
        if number and format_name == "text":
            stdout().write("\n")
        _print(text, vendor, lang, format_name)


def _codes(words: Sequence[str], vendor: str | None, lang: str) -> list[str]:
    """What is to be explained: all words together where that is a code (`error 82`), else one after the other.

    Words in front hold for the codes behind them: `GET 2 4 PUT 4` is `GET 2`, `GET 4`, `PUT 4`. Of a line of a
    log the codes in it.
    """
    from ds47.explain.lines import codes_in

    text = " ".join(words)
    if _knows(text, lang):
        return [text]
    words = text.split()
    parts = [text] if len(words) == 1 else _parts(words, lang)
    if _knows(text, lang, known=False) and not all(_knows(each, lang) for each in parts):
        return [text]
    if not all(_knows(each, lang, known=False) for each in parts):
        inside = [each for each in codes_in(text) if _knows(each, lang)]
        if inside:
            return inside
    for each in parts:
        _explained(each, vendor, lang)
    return parts


def _parts(words: Sequence[str], lang: str) -> list[str]:
    """One code after the other, each with the words in front of it; what is none comes last."""
    found: list[str] = []
    front: list[str] = []
    ended = False
    for word in words:
        code = " ".join([*front, word])
        alone = ended and not _knows(code, lang) and _knows(word, lang)
        if found and not alone and not _knows(code, lang, known=False):
            of_block = f"{words[0]} {code}"  # SINA_POS 8600 DiagId 7002
            code = of_block if _knows(of_block, lang, known=False) else code
        if alone or _knows(code, lang, known=False):
            found.append(word if alone else code)
            front = [] if alone else front
            ended = True
        else:
            front = [word] if ended else [*front, word]
            ended = False
    return found if ended else [*found, " ".join(front)]


def _knows(text: str, lang: str, known: bool = True) -> bool:
    """Whether a text is a code, and has a meaning where that is asked for."""
    from ds47.explain import UnknownFormError, explain

    try:
        return explain(text, lang)[0].known or not known
    except UnknownFormError:
        return False


def _named(text: str, lang: str) -> bool:
    """Lists the first parameters that have a word in their names; whether it is such a word, and no code.

    A word that takes a number behind it, as in `error 82`, is none.
    """
    from ds47.cli.params import looked_up
    from ds47.report import known
    from ds47.report.bilingual import say
    from ds47.report.wrap import cut
    from ds47.spec.shell import shell_word

    codes = (text, f"{text} 1", *text.split())
    if not _is_word(text) or any(_knows(each, lang, known=False) for each in codes):
        return False
    found = looked_up(text, lang) or []
    width = prose_width()
    tell(cut(known.heading(each), width) for each in found[:_FOUND])
    if found:
        more = f"ds47 params show {shell_word(text)}"
        left = len(found) - _FOUND
        key = "params_all" if left <= 0 else "params_more"
        tell([say(key, n=max(left, 0), command=more).text(lang)])
    return bool(found)


def _is_word(text: str) -> bool:
    return any(each.isalpha() for each in text) and not any(each.isdigit() for each in text)


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
    from ds47.explain import UnknownFormError, explain, find_vendor
    from ds47.spec import explanations
    from ds47.spec.maker_names import UnclearNameError

    with refused(UnclearNameError, usage=True):
        maker = None if vendor is None else find_vendor(vendor)
    try:
        return explain(text, lang, maker)
    except UnknownFormError as problem:
        raise click.ClickException(_unknown(text, explanations.forms(lang), lang)) from problem


def _unknown(text: str, forms: str, lang: str) -> str:
    """What is said of a text that is no code, in a line of _LINE characters with what stands in front of it."""
    from ds47.cli.params import looked_up
    from ds47.report.bilingual import say_in
    from ds47.report.wrap import columns
    from ds47.spec.shell import shell_word

    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
    unknown = say_in(lang, "explain_unknown", code=repr(shown))
    said = f"{unknown}. {forms}"
    named = say_in(lang, "explain_named", command=f"ds47 params show {shell_word(text)}")
    tries = (said + named, unknown + named) if _is_word(text) and looked_up(text, lang) else ()
    return next((each for each in tries if columns(each) <= _LINE), said)
