"""What outputs of PLC blocks say: a text such as `GET 2` or `SINA_PARA DiagId 80B5`, or a number alone."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from ds47.explain.answer import BlockOutputs, CodeMeaning, CodePart, answer
from ds47.explain.forms import BYTE, STATUS, WORD, Reading, numbers
from ds47.spec import blocks, explanations
from ds47.spec.blocks import Block, BlockCode, Output
from ds47.spec.explanations import Explanation

KIND = "block_output"
CODE, ACCESS = "code", "access"
"""What the tables of this room read themselves; anything else is a kind of code of its own."""
_PARTS = re.compile(r"[\s:=.,;]+")
_ELEMENT = re.compile(r"\w+\[\d+\]")
"""`Parameter[3]` in front of `swErrorNo`."""
_FLAGS = {"0": False, "false": False, "1": True, "true": True}
_MOST_WORDS = 4
_PARA = "SINA_PARA"
_WORD_BITS, _LOW = 16, 0xFFFF


@dataclass(frozen=True, slots=True)
class Asked:
    """A block, which of its outputs are meant, the number as it was written, and ERROR where it was given."""

    block: Block
    outputs: tuple[Output, ...]
    value: str
    error: bool | None


def asked(text: str) -> Asked | None:
    """What a text asks about a block; None where it does not begin with one, or has no number behind it."""
    words = [
        each for each in _PARTS.split(unicodedata.normalize("NFKC", text).strip("\"'` ")) if each
    ]
    for count in range(min(len(words) - 1, _MOST_WORDS), 0, -1):
        name = "".join(words[:count]).lower()
        block = next((each for each in blocks.blocks() if name in each.words), None)
        if block is not None:
            return _asked(block, words[count:])
    return None


def _asked(block: Block, words: list[str]) -> Asked | None:
    error: bool | None = None
    named: list[Output] = []
    value: list[str] = []
    of_block = blocks.outputs(block.name)
    while words:
        word = words.pop(0)
        plain = word.lower().replace("_", "")
        output = next((each for each in of_block if plain in each.words), None)
        if plain == "error" and words and words[0].lower() in _FLAGS:
            error = _FLAGS[words.pop(0).lower()]
        elif output is not None:
            named.append(output)
        elif not _ELEMENT.fullmatch(word):
            value.append(word)
    if not value or len(named) > 1:
        return None
    outputs = tuple(named) or tuple(each for each in of_block if not each.only_named)
    return Asked(block, outputs, " ".join(value), error)


def meanings(question: Asked, output: Output, lang: str) -> Iterator[CodeMeaning]:
    """What the number means at an output that the tables here know; one without meaning where it has none."""
    ordered = sorted(numbers(question.value), key=lambda number: number[1] != output.decimal)
    values = list(dict.fromkeys(value for value, _ in ordered))
    known = blocks.of_output(question.block.name, output.name)
    if output.reads == ACCESS:
        digits = re.sub(r"^.*#|^0x|h$|[^0-9a-f]", "", question.value.lower())
        whole = len(digits) > _WORD_BITS // 4
        for value in values[:1]:
            yield from _access(question.block, output, value, lang, whole)
        return
    found = [value for value in values if value in known]
    for value in found:
        yield _of_row(known[value], output, value, lang, question)
    if values and not found:
        yield _unknown(question.block.name, output, values[0], lang)


def alone(reading: Reading, lang: str) -> Iterator[CodeMeaning]:
    """What a number without a block in front of it may be at the outputs of all of them."""
    if reading.size in (BYTE, WORD) and reading.value:
        for row in blocks.codes():
            if reading.value in row.codes:
                outputs = blocks.outputs(row.blocks[0])
                output = next(each for each in outputs if each.name == row.output)
                yield _of_row(row, output, reading.value, lang)


def both_words(readings: Iterable[Reading], lang: str) -> Iterator[CodeMeaning]:
    """What a double word that is no status may be: the two words of SINA_PARA."""
    block = next(each for each in blocks.blocks() if each.name == _PARA)
    output = next(each for each in blocks.outputs(_PARA) if each.reads == ACCESS)
    kinds = blocks.of_output(_PARA, output.name)
    for reading in readings:
        kind = reading.value >> _WORD_BITS
        if reading.size == STATUS and kind and kind in kinds:
            yield next(_access(block, output, reading.value, lang, True))


def _of_row(
    row: BlockCode, output: Output, value: int, lang: str, question: Asked | None = None
) -> CodeMeaning:
    words = blocks.words(lang)
    names = [question.block.name] if question else row.blocks
    title = words["status"].format(
        blocks=explanations.words(lang)["list_separator"].join(names), output=output.name,
        value=_number(output, value, lang), flag=output.error, error=int(row.error), text=row.text(lang),
    )  # fmt: skip
    doubt = None
    if question and question.error not in (None, row.error):
        doubt = words["differs"].format(
            flag=output.error, given=int(not row.error), error=int(row.error)
        )
    likely = row.first and value > 0xFF
    return _put(
        output, f"{names[0]} {_plain_number(output, value)}", title, row.causes(), lang,
        "block_word" if likely else KIND, advice=doubt,
    )  # fmt: skip


def _unknown(block: str, output: Output, value: int, lang: str) -> CodeMeaning:
    """A number that no table has for this output: which ones it has beside it."""
    words = blocks.words(lang)
    near = blocks.near(blocks.of_output(block, output.name), value)
    listed = explanations.words(lang)["list_separator"].join(
        _plain_number(output, each) for each in near
    )
    title = words["unknown"].format(
        blocks=block, output=output.name, value=_number(output, value, lang), near=listed
    )
    meaning = _put(output, f"{block} {_plain_number(output, value)}", title, (), lang, KIND)
    return replace(meaning, known=False, causes=(), plc=(), filter=None)


def _access(
    asked: Block, output: Output, value: int, lang: str, whole: bool
) -> Iterator[CodeMeaning]:
    """Both readings of the two words of SINA_PARA: the kind of error first, or the bits of the parameters.

    Args:
        asked: SINA_PARA or SINA_PARA_S.
        output: Status.
        value: the double word, or a word alone.
        lang: "en" or "zh".
        whole: both words were written.
    """
    block = asked.name
    words, known = blocks.words(lang), blocks.of_output(block, output.name)
    high, low = value >> _WORD_BITS & _LOW, value & _LOW
    shown = f"16#{value:0{8 if whole else 4}X}"
    order = [(1, high, low), (2, low, high)]
    rank = KIND
    for place, kind, bits in order if whole else reversed(order):
        row = known.get(kind)
        if row is None or bits >> asked.parameters:
            continue
        texts = [row.text(lang)] if kind or not bits else []
        if bits:
            failed = (str(bit + 1) for bit in range(_WORD_BITS) if bits >> bit & 1)
            separator = explanations.words(lang)["list_separator"]
            texts.append(words["failed"].format(list=separator.join(failed)))
        title = words["access"].format(
            blocks=block, output=output.name, value=value, text=words["join"].join(texts)
        )
        parts = [words["kind_of"], words["bits_of"]][:: 1 if place == 1 else -1]
        meaning = _put(
            output, f"{block} {output.name} {shown}", title, row.causes() if kind or not bits else (),
            lang, rank if kind or whole or not bits else "block_else",
            advice=words["advice"] if bits else None,
            parts=tuple(
                CodePart(words["parts"].format(word=number, value=word), "", text)
                for number, word, text in ((1, high, parts[0]), (2, low, parts[1]))
            ),
        )  # fmt: skip
        yield meaning
        rank = "block_else"
        if not value:
            return


def _put(
    output: Output,
    name: str,
    title: str,
    causes: tuple[explanations.CodeCause, ...],
    lang: str,
    rank: str,
    *,
    advice: str | None = None,
    parts: tuple[CodePart, ...] = (),
) -> CodeMeaning:
    entry = Explanation(causes, output.look_en, output.look_zh)
    meaning = answer(
        KIND, name, name, title, True, entry, lang, rank=rank, view="none", advice=advice, parts=parts,
        filter_name=output.filter, values={"code": "", "value": ""},
    )  # fmt: skip
    note = output.note_zh if lang == "zh" else output.note_en
    return replace(meaning, plc=(BlockOutputs("", None, None, None, None, note),))


def _number(output: Output, value: int, lang: str) -> str:
    """As the manual writes it, and as a watch table shows it: `2 = 16#0002`, `16#8402`."""
    pattern = blocks.words(lang)["number" if output.decimal and value <= 0xFF else "word"]
    return pattern.format(decimal=value, value=value)


def _plain_number(output: Output, value: int) -> str:
    return str(value) if output.decimal and value <= 0xFF else f"16#{value:04X}"
