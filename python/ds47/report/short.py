"""A capture as text in few lines: 40 on a terminal, 12 as `--summary`. `ds47.report.digest` says what is in them.

No line is wider than the terminal, and no sentence is cut: it is broken, or said in fewer words.
`ds47.report.text` has the whole report.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Final

from ds47.report import Paint
from ds47.report.bilingual import say
from ds47.report.digest import Digest, ShortCause, Who, first_sentences
from ds47.report.formatting import escape
from ds47.report.summary import COLORS, WIDTH, station, whose
from ds47.report.wrap import columns, end_of, fitted, wrap
from ds47.spec.shell import shell_word

LINES: Final = 40
CAUSES: Final = 5
"""Causes in so many lines, if they have room,"""
SUMMARY: Final = 12
SUMMED: Final = 3
"""and in a summary."""
_DRIVES: Final = 3
_SENTENCE: Final = 3
"""Lines of the sentence of a cause, which is said in brief if it needs more,"""
_ADVICE: Final = 2
"""and of its advice, unless its first sentence needs more."""
_LISTED: Final = 12
"""Lines of the transactions on a screen of what somebody asked for,"""
_FEWER: Final = 2
"""and the most causes beside them."""


class Short:
    """Makes the lines. `paint` takes a colour ("error", "bold", ...) and a text."""

    def __init__(self, lang: str, width: int, paint: Paint) -> None:
        self._lang, self._whole, self._width, self._paint = lang, width, min(width, WIDTH), paint

    def screen(
        self,
        digest: Digest,
        head: Sequence[str],
        totals: Sequence[str],
        asked: Sequence[Sequence[str]] = (),
    ) -> list[str]:
        """At most LINES lines: as many causes as have room, and the verdict again at the end.

        Args:
            digest: with at most CAUSES causes.
            head: more about the file, such as damage.
            totals: the lines of the sums.
            asked: the lines of each transaction that somebody asked for; the first ones are shown.
        """
        rows = list(self._first(asked))
        most = min(len(digest.causes), _FEWER) if rows else len(digest.causes)
        for number in range(most, -1, -1):
            lines = list(self._screen(digest, number, head, totals, rows))
            if len(lines) <= LINES:
                return lines
        return [*lines[: LINES - 1], lines[-1]]

    def _screen(
        self,
        digest: Digest,
        number: int,
        head: Sequence[str],
        totals: Sequence[str],
        rows: Sequence[str],
    ) -> Iterator[str]:
        yield from self._top(digest)
        yield from (line for each in head for line in fitted(each, self._whole))
        if number:
            yield from ("", self._paint("bold", self._say("to_do_head")))
        for each in digest.causes[:number]:
            yield from self._cause(each)
        yield from self._rest(digest, number)
        if rows:
            yield from ("", self._paint("bold", self._say("transactions_head")))
            yield from rows
        if digest.drives:
            yield from ("", self._paint("bold", self._say("drives_head")))
            yield from self._drives(digest.drives, _DRIVES)
        yield ""
        yield from (line for each in totals for line in fitted(each, self._whole))
        yield self._dim(self._more(digest))
        yield from self.verdict(digest)

    def _first(self, asked: Sequence[Sequence[str]]) -> Iterator[str]:
        """The lines of the first transactions, none of which is cut off, and how many more there are."""
        shown = room = 0
        for lines in asked:
            room += len(lines)
            if shown and room > _LISTED:
                break
            shown += 1
            yield from lines[:_LISTED]
        if shown < len(asked):
            yield self._dim("  " + self._say("more", number=str(len(asked) - shown)))

    def summary(self, digest: Digest) -> list[str]:
        """At most 12 lines: verdict, three causes, who, when. What has no room is left out as a whole.

        First the words become fewer, then what is there goes (verdict and drives say most of it), then
        advice, then a cause.
        """
        plans = (
            (number, advised, there, brief)
            for number in range(len(digest.causes), -1, -1)
            for advised in range(number, -1, -1)
            for there in (digest.there, None)
            for brief in (False, True)
        )
        for number, advised, there, brief in plans:
            lines = list(self._top(digest._replace(there=there)))
            for each in filter(None, (digest.narrowed, digest.expected)):
                lines += fitted("  " + each.text(self._lang), self._whole)
            for at, cause in enumerate(digest.causes[:number]):
                lines += self._summed(cause, 1 if brief else _SENTENCE, advised=at < advised)
            lines += self._rest(digest, number)
            lines += self._drives(digest.drives, 1, brief=brief)
            if len(lines) <= SUMMARY:
                return lines
        return lines[:SUMMARY]

    def _summed(self, cause: ShortCause, at_most: int, *, advised: bool) -> Iterator[str]:
        """A cause in a summary."""
        where = self._say("cause_frame", frame=cause.number) if cause.number else ""
        for number, line in enumerate(self._sentence(cause, self._whole - 4, at_most, where)):
            yield ("    " if number else "  ") + line
        if advised:
            advice = first_sentences(cause.advice.text(self._lang), self._whole - 7)
            yield from ("    " + line for line in wrap("-> " + advice, self._whole - 4, 3))

    def _say(self, key: str, **values: object) -> str:
        return say(key, **values).text(self._lang)

    def _dim(self, text: str) -> str:
        return self._paint("dim", text)

    def _title(self, digest: Digest) -> str:
        frames, path = self._say("frames", n=digest.counts.frames), escape(digest.path)
        room = self._whole - columns(frames) - 2
        if columns(path) > room:
            path = escape(PurePath(digest.path).name)
        return self._paint("bold", f"{end_of(path, room)}: {frames}")

    def verdict(self, digest: Digest) -> Iterator[str]:
        """The verdict in as many lines as it needs."""
        for line in fitted(digest.verdict.text(self._lang), self._whole):
            yield self._paint(COLORS[digest.level], line)

    def _top(self, digest: Digest) -> Iterator[str]:
        yield self._title(digest)
        yield from self.verdict(digest)
        mirror = say("verdict_mirror") if digest.counts.nothing else None
        for each in filter(None, (mirror, digest.there, digest.when)):
            yield from fitted("  " + each.text(self._lang), self._whole)

    def _sentence(self, cause: ShortCause, room: int, at_most: int, where: str = "") -> list[str]:
        """What a cause says, in so many lines; in brief where that needs more."""
        lines = []
        for message in (cause.message, cause.brief):
            severity = say(f"severity_{cause.severity}")
            line = say("short_cause", rule=cause.rule, severity=severity, message=message)
            told = line.joined(cause.times) if cause.times else line
            lines.append(wrap(told.text(self._lang) + where, room))
            if len(lines[-1]) <= at_most:
                break
        return min(lines, key=len) if len(lines[-1]) > at_most else lines[-1]

    def _rest(self, digest: Digest, number: int) -> Iterator[str]:
        """How many causes there are besides the first ones."""
        left_out = digest.left_out + sum(1 + each.alike for each in digest.causes[number:])
        if left_out:
            yield self._dim("  " + self._say("short_more", n=left_out))

    def _cause(self, cause: ShortCause) -> Iterator[str]:
        room = self._width - 4
        for number, line in enumerate(self._sentence(cause, room, _SENTENCE)):
            yield ("    " if number else "  ") + self._paint(cause.severity, line)
        advice = first_sentences(cause.advice.text(self._lang), _ADVICE * (room - 8))
        for line in wrap("-> " + advice, room, 3):
            yield "    " + line
        if cause.where is not None:
            yield from fitted("    " + self._say("look_at_first", frame=cause.where), self._whole)

    def _drives(self, drives: Sequence[Who], most: int, *, brief: bool = False) -> Iterator[str]:
        for each in drives[:most]:
            device = f"  {escape(each.device.ip)}{station(each.device)}  "
            said = device + each.words(self._lang)
            whole = said + whose(each.device, self._lang)
            short = device + each.total.text(self._lang) if brief else said
            fits = (line for line in (whole, said) if columns(line) <= self._whole)
            yield from fitted(next(fits, short), self._whole)
        if len(drives) > most:
            yield "  " + self._say("more_drives", n=len(drives) - most)

    def _more(self, digest: Digest) -> str:
        """How to see all: a line to copy, if it has room and no other option belongs to it."""
        everything = say("short_all", path=shell_word(escape(digest.path)))
        page = everything.joined(say("short_page"), "; ", "；")
        known = (page, everything) if digest.narrowed is None else ()
        fit: Iterator[str] = (each.text(self._lang) for each in (*known, say("short_same")))
        return next(line for line in fit if columns(line) <= self._whole)
