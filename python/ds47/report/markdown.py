"""Report as Markdown: the summary of a job in CI, a comment, a ticket. Each capture: a heading, causes, drives.

What stands in it is `ds47.report.digest`. Texts from the capture are escaped, so that none of them is Markdown or
HTML.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final

from ds47.report.bilingual import Both, joined, say
from ds47.report.digest import Digest, ShortCause
from ds47.report.digests import Digests
from ds47.report.formatting import escape

DETAILED: Final = 10
"""Captures that are not OK with their causes, the worst ones; all stand in the table."""
LISTED: Final = 200
DRIVES: Final = 20
MARKS: Final = {"bad": "❌", "warn": "⚠️", "good": "✅", "none": "⬜"}
_SPECIAL: Final = re.compile(r"([\\`*_{}\[\]|~])")


class Writer(Digests):
    """Keeps a digest of each capture, and writes at the end."""

    def close(self) -> None:
        for line in self._lines():
            self.stream.write(line + "\n")

    def _lines(self) -> Iterator[str]:
        found = self.captures
        if len(found) == 1 and not self.problems:
            yield from self._one(found[0], "##")
            return
        yield self._heading("##", self.level, self.verdict)
        yield ""
        yield from self._table(("md_capture", "md_verdict"), self._rows())
        for each in self.worst[:DETAILED]:
            yield ""
            yield from self._one(each, "###")

    def _rows(self) -> Iterator[tuple[str, str]]:
        for path, problem in self.problems:
            yield code(path), f"{MARKS['bad']} {plain(problem)}"
        for each in self.captures[:LISTED]:
            yield code(each.path), f"{MARKS[each.level]} {self._text(each.verdict)}"
        if left_out := self.captures[LISTED:]:
            yield self._text(say("md_more", n=len(left_out))), ""

    def _one(self, digest: Digest, mark: str) -> Iterator[str]:
        yield self._heading(mark, digest.level, digest.verdict)
        yield ""
        mirror = say("verdict_mirror") if digest.counts.nothing else None
        parts = (
            say("frames", n=digest.counts.frames),
            digest.there,
            digest.when,
            digest.narrowed,
            digest.expected,
            mirror,
        )
        shown = joined([each for each in parts if each], "; ", "；")
        yield f"{code(digest.path)}: {self._text(shown)}"
        if digest.causes:
            yield ""
            heads = ("md_severity", "md_cause", "md_to_do", "md_frame")
            yield from self._table(heads, map(self._cause, digest.causes))
        if digest.left_out:
            yield ""
            yield self._text(say("short_more", n=digest.left_out))
        if digest.drives and self.options.detail != "summary":
            yield ""
            yield from self._table(("md_drive", "md_name", "md_transactions"), self._drives(digest))

    def _cause(self, cause: ShortCause) -> tuple[str, ...]:
        message = self._text(cause.message.joined(cause.times) if cause.times else cause.message)
        return (
            self._text(say(f"severity_{cause.severity}")),
            f"**{cause.rule}** {message}",
            self._text(cause.advice),
            "" if cause.where is None else self._text(cause.where),
        )

    def _drives(self, digest: Digest) -> Iterator[tuple[str, ...]]:
        for each in digest.drives[:DRIVES]:
            name = code(each.device.station) if each.device.station else ""
            yield plain(each.device.ip), name, plain(each.words(self.options.lang, "; "))
        if left_out := digest.drives[DRIVES:]:
            yield self._text(say("more_drives", n=len(left_out))), "", ""

    def _table(self, heads: Sequence[str], rows: Iterator[tuple[str, ...]]) -> Iterator[str]:
        yield row([self._text(say(each)) for each in heads])
        yield row(["---"] * len(heads))
        yield from map(row, rows)

    def _heading(self, mark: str, level: str, text: Both) -> str:
        return f"{mark} {MARKS[level]} {self._text(text)}"

    def _text(self, text: Both) -> str:
        return plain(text.text(self.options.lang))


def row(cells: Sequence[str]) -> str:
    """A row of a table, of cells that are Markdown."""
    return f"| {' | '.join(cells)} |"


def plain(text: str) -> str:
    """A text without any meaning in Markdown or HTML."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """A name as it is: in Markdown a code span, whose table cell knows no bar."""
    return "`" + escape(text).replace("`", "'").replace("|", "\\|") + "`"
