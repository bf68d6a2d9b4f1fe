"""An answer about a code: what it consists of, and how it is put together from an entry of the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ds47.spec import explanations
from ds47.spec.explanations import Explanation


@dataclass(frozen=True, slots=True)
class CodePart:
    """A part of a code: its value as text, where it stands, what it says."""

    value: str
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class BlockOutputs:
    """What WRREC or RDREC shows (`done` is VALID for RDREC); without a name a remark only."""

    block: str
    done: bool | None
    busy: bool | None
    error: bool | None
    status: str | None
    note: str


@dataclass(frozen=True, slots=True)
class Reason:
    """A cause and how sure it is: documented, usual or unconfirmed."""

    text: str
    basis: str


@dataclass(frozen=True, slots=True)
class CodeMeaning:
    """One thing that a code can mean, in one language; causes in the order of likelihood.

    `known` is False where only the parts of the code have a meaning. `name` is the code in a form
    that has this meaning alone (`ds47 explain NAME`).
    """

    kind: str
    code: str
    name: str
    vendor: str | None
    title: str
    known: bool
    parts: tuple[CodePart, ...]
    plc: tuple[BlockOutputs, ...]
    causes: tuple[Reason, ...]
    advice: str | None
    look: str
    filter: str | None
    plugin_filter: str | None
    rank: int


def answer(
    kind: str,
    code: str,
    name: str,
    title: str,
    known: bool,
    entry: Explanation,
    lang: str,
    *,
    rank: str,
    parts: tuple[CodePart, ...] = (),
    view: str = "",
    shown: str = "",
    causes: Sequence[explanations.CodeCause] = (),
    advice: str | None = None,
    filter_name: str = "",
    values: Mapping[str, str] | None = None,
    vendor: str | None = None,
) -> CodeMeaning:
    """A meaning in one language: the texts are those of the entry, where none is given."""
    rows = explanations.views(view or entry.plc)
    templates = explanations.filters(filter_name) if filter_name else {}
    filled = {key: text.format_map(values or {}) for key, text in templates.items()}
    return CodeMeaning(
        kind=kind,
        code=code,
        name=name,
        vendor=vendor,
        title=title,
        known=known,
        parts=parts,
        plc=tuple(
            BlockOutputs(
                row.block,
                row.done,
                row.busy,
                row.error,
                shown if row.status == "" else row.status,
                row.text(lang).format_map(values or {}),
            )
            for row in rows
        ),
        causes=tuple(Reason(each.text(lang), each.basis) for each in causes or entry.causes),
        advice=advice,
        look=entry.look(lang),
        filter=filled.get("wireshark"),
        plugin_filter=filled.get("plugin"),
        rank=explanations.rank(rank),
    )
