"""Report as text, for a person: the verdict and what to do, a line per transaction, findings, a summary.

What stands in a line is decided here, in the first lines in `ds47.report.summary`; how values and addresses are
written in `ds47.report.formatting`; the words of both languages stand in spec/report.toml.
The English layout is ASCII, so that any console can show it; texts from the capture are escaped, so
that none of them can talk to the terminal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from io import StringIO
from itertools import islice
from typing import TYPE_CHECKING, Any, TextIO

from ds47.model import (
    DS47,
    PZD,
    S7,
    SEEN,
    SEVERITIES,
    Bus,
    CaptureFile,
    CaptureResult,
    Finding,
    Relation,
    Report,
    Sender,
    Transaction,
)
from ds47.report import ReportOptions, buffers, causes, plc, write_all
from ds47.report import Writer as _Writer
from ds47.report import s7 as communication
from ds47.report.bilingual import Both, counted, joined, operation, say, say_in, state
from ds47.report.clock import Clock
from ds47.report.file_frames import FileFrames, name
from ds47.report.filters import display_filter
from ds47.report.formatting import duration, escape, parameter
from ds47.report.latency import Latency
from ds47.report.overview import CaptureRow, told_sums, total, worst_first
from ds47.report.sentences import at_offset, sentence
from ds47.report.summary import Opening
from ds47.report.targets import Targets
from ds47.report.verdict import VerdictCounts
from ds47.report.wrap import columns, end_of, fitted, wrap
from ds47.spec.cyclic import telegrams

if TYPE_CHECKING:
    from ds47.report.timelines import EventRow

FINDINGS_PER_RULE = 12
RELATIONS_LISTED = 20
NAMES_OFFERED = 4
"""Drives whose words the frames show, for which `--cyclic` is offered."""
CONNECTIONS_LISTED = 50
EVENTS_LISTED = 60
FILES_LISTED = 20
"""Files of a series that are listed; JSON has all, and every finding names its file."""
LONG = 60
"""Of more transactions and events of drives than these a report lists none unless asked to."""
MANY = 5
"""Of more captures than these a report tells what they come to, and none by itself unless asked to."""
CAPTURES_LISTED = 20
"""Captures of a run that are listed at its end, the worst ones; `-f overview` lists all."""
WORST_LISTED, CAUSES_LISTED = 6, 4
"""Captures, and causes, in a report that tells of many captures together only."""
_SERIOUS_STATES = ("error", "mismatch", "refused")


class Writer(_Writer):
    """Prints a capture when it is complete; keeps only counts for the last lines."""

    def __init__(self, stream: TextIO, options: ReportOptions | None = None) -> None:
        super().__init__(stream, options)
        self._paint = self.options.paint
        self._opening = Opening(self.options)
        self._counts = VerdictCounts()
        self._rows: list[CaptureRow] = []
        self._latency = Latency()
        self._clock = Clock(self.options.zone, None)

    def capture(self, result: CaptureResult) -> None:
        counts = VerdictCounts.of(result, self.options.zone)
        row = CaptureRow.of(result, counts)
        durations = [each.duration_ns for each in result.transactions]
        latency = Latency([each for each in durations if each is not None])
        if not self._many:
            self._one(result, counts, row, latency)
        self._counts.add(counts)
        self._rows.append(row)
        self._latency.update(latency)

    @property
    def _many(self) -> bool:
        """Whether the report tells of all captures together only."""
        most = 1 if self.options.detail in ("short", "summary") else MANY
        return self.options.detail != "all" and self.options.captures > most

    def _one(
        self, result: CaptureResult, counts: VerdictCounts, row: CaptureRow, latency: Latency
    ) -> None:
        """A capture by itself."""
        if self.options.detail in ("short", "summary"):
            self._in_short(result, counts, row, latency)
            return
        if self._rows:
            self._line()
        self._clock = Clock.of(result, self.options.zone)
        self._header(result, counts)
        for line in self._opening.lines(result, self._clock, counts):
            self._copied(line)
        left_out = self._left_out(result)
        if left_out:
            self._line()
            self._line(self._say("not_listed", what=joined(left_out).text(self.options.lang)))
        else:
            self._lists(result)
        self._summary(self._say("summary_head"), total([row]), latency)

    def _in_short(
        self, result: CaptureResult, counts: VerdictCounts, row: CaptureRow, latency: Latency
    ) -> None:
        """A capture in 12 lines, or in 40: with all there is to say, if that has room."""
        from ds47.report.digest import Digest  # not for pipes and files
        from ds47.report.short import CAUSES, LINES, SUMMED, Short

        form = Short(self.options.lang, self.options.columns, self._paint)
        if self.options.detail == "summary":
            for line in form.summary(Digest.of(result, self.options, SUMMED, counts)):
                self._copied(line)
            return
        whole = StringIO()
        write_all(Writer(whole, self.options._replace(detail="auto")), Report([result]))
        digest = Digest.of(result, self.options, CAUSES, counts)
        lines = [*whole.getvalue().splitlines(), *form.verdict(digest)]
        if len(lines) > LINES or max(map(columns, lines)) > self.options.columns:
            head = [f"  {each}" for each in self._about_file(result)]
            self._clock = Clock.of(result, self.options.zone)
            listed = self._listed(result) if result.narrowed is not None else ()
            asked = [lines for _, lines in listed]
            lines = form.screen(digest, head, self._totals(total([row]), latency), asked)
        for line in lines:
            self._copied(line)

    def _left_out(self, result: CaptureResult) -> list[Both]:
        """What is counted instead of listed; nothing where all is listed."""
        listed = sum(map(self._is_listed, result.transactions))
        events = sum(len(each.events) for each in result.timelines)
        detail = self.options.detail
        if detail == "all" or self.options.plc or (detail == "auto" and listed + events <= LONG):
            return []
        counts = {
            "transactions": len(result.transactions), "findings": len(result.findings),
            "drive_events": events, "s7_connections": len(result.connections),
        }  # fmt: skip
        return [say(key, n=number) for key, number in counts.items() if number]

    def _lists(self, result: CaptureResult) -> None:
        """Everything one by one."""
        if result.bus is not None:
            self._bus(result.bus, result.relations)
        self._relations(result.relations)
        self._senders(result.senders)
        self._timelines(result)
        self._connections(result)
        self._buffers(result)
        self._table(result)
        self._findings(result.findings, FileFrames(result.files))

    def unreadable(self, path: str, problem: str) -> None:
        self._rows.append(CaptureRow.unreadable(path, problem))
        self._counts.add(VerdictCounts(captures=1, unreadable=1))

    def close(self) -> None:
        if len(self._rows) < 2:
            return
        sums = total(self._rows)
        if self.options.detail == "summary":
            self._sum_up(sums)
            return
        listed, causes_listed = CAPTURES_LISTED, len(sums["to_do"])
        if self._many:
            listed, causes_listed = WORST_LISTED, CAUSES_LISTED
        to_do = list(causes.lines(sums["to_do"][:causes_listed], self.options, advice=self._many))
        if left_out := len(sums["to_do"][causes_listed:]):
            to_do.append("  " + self._say("causes_more", n=left_out))
        worst = worst_first(self._rows, self.options, listed)
        blocks = [block for block in (worst, to_do) if block]
        for number, block in enumerate(blocks):
            before = [] if self._many and not number else [""]  # many: nothing stands above
            for line in [*before, *block]:
                self._copied(line)
        title = self._say("summary_all", n=len(self._rows))
        verdict = self._opening.verdict(self._counts)
        self._summary(title, sums, self._latency, verdict)
        if self._many:
            self._line()
            self._line(self._say("captures_not_listed"))

    def _sum_up(self, sums: dict[str, Any]) -> None:
        """All captures in 12 lines: the verdict, the most frequent causes, the worst captures."""
        from ds47.report.short import SUMMARY, SUMMED

        worst = sorted((row for row in self._rows if not row.quiet), key=CaptureRow.badness)
        told = told_sums(sums, str)[0].text(self.options.lang)
        plans = ((most, first) for most in range(SUMMED, -1, -1) for first in ([told], []))
        for most, total_of_all in plans:
            lines = list(self._summed_up(total_of_all, sums["to_do"][:most], worst, most))
            if len(lines) <= SUMMARY:
                break
        for each in lines[:SUMMARY]:
            self._copied(each)

    def _summed_up(
        self,
        told: Sequence[str],
        to_do: Sequence[dict[str, Any]],
        worst: Sequence[CaptureRow],
        most: int,
    ) -> Iterator[str]:
        """The same with so many captures, in lines that fit."""
        width, rules = self.options.columns, self.options.rules
        yield self._paint("bold", self._say("summary_all", n=len(self._rows)))
        yield from fitted(self._opening.verdict(self._counts), width)
        heads = [
            causes.headline(each, rule.name if rule else "").text(self.options.lang)
            for each in to_do
            for rule in (rules.get(each["rule"]),)
        ]
        yield from (line for each in (*told, *heads) for line in fitted(f"  {each}", width))
        for row in worst[:most]:
            not_ok = row.transactions - row.states.get("ok", 0)
            counts = self._say(
                "sum_worst", n=row.transactions, bad=not_ok, errors=row.findings.get("error", 0)
            )
            yield f"  {end_of(escape(row.path), width - columns(counts) - 4)}: {counts}"
        if left_out := worst[most:]:
            yield "  " + self._say("worst_more", n=len(left_out))

    def _line(self, text: str = "") -> None:
        for line in fitted(text, self.options.columns):
            self._copied(line)

    def _copied(self, text: str) -> None:
        """A line that is not wrapped: text to copy, and text that fits."""
        self.stream.write(text + "\n")

    def _rows_of(
        self, rows: Iterable[Sequence[Both]], head: Sequence[Both] = (), lead: Sequence[int] = (0,)
    ) -> None:
        """A table in the language of the report."""
        from ds47.report.table import table  # few captures have any

        named, *shown = [[cell.text(self.options.lang) for cell in row] for row in (head, *rows)]
        for line in table(shown, self.options.width, named, lead=lead, paint=self._paint):
            self._copied(line)

    def _title(self, text: str) -> None:
        self._line(self._paint("bold", text))

    def _section(self, title: str) -> None:
        self._line()
        self._title(title)

    def _rest(self, number: int) -> None:
        """How many more there are than listed."""
        if number > 0:
            self._line("  " + self._say("more", number=str(number)))

    def _say(self, key: str, **values: object) -> str:
        return say_in(self.options.lang, key, **values)

    def _header(self, result: CaptureResult, counts: VerdictCounts) -> None:
        frames = self._say("frames", n=result.frames)
        self._title(f"{escape(result.path)}: {frames}")
        if result.sha256:
            self._copied(f"  sha256 {result.sha256}")
        self._line(self._opening.verdict(counts))
        for line in self._opening.there(counts):
            self._line("  " + line)
        if span := self._clock.span(result):
            self._line("  " + span.text(self.options.lang))
        self._files(result.files)
        for text in self._about_file(result):
            self._line("  " + text)
        if not (result.evidence or result.connections or result.nothing):
            there = _traffic(result)
            if there is None and not counts.cut:
                there = say("no_rpc" if result.bus is None else "no_bus_records")
            nothing = say("no_transaction")
            if there is not None:
                nothing = say("no_transaction_but", there=there)
            self._line("  " + nothing.text(self.options.lang))

    def _about_file(self, result: CaptureResult) -> Iterator[str]:
        """What part of the file is shown, or could be read."""
        if result.narrowed is not None:
            from ds47.report.narrowing import narrowed_words

            yield narrowed_words(result).text(self.options.lang)
        if result.expected is not None:
            from ds47.report.expected import expected_words

            yield expected_words(result.expected).text(self.options.lang)
        if not result.complete or result.problem:
            problem = escape(result.problem or self._say("file_ends_early"))
            yield self._paint("error", self._say("partly_read", problem=problem))
        if result.dropped:
            yield self._paint("warning", self._say("machine_dropped", n=result.dropped))

    def _bus(self, bus: Bus, relations: Sequence[Relation]) -> None:
        """The stations of PROFIBUS."""
        from ds47.report import bus as stations  # few captures have any

        lang = self.options.lang
        self._section(self._say("bus_head"))
        self._line("  " + stations.counts(bus).text(lang))
        self._rows_of(stations.rows(bus), stations.head(), lead=(0, 1))
        for each in (*stations.diagnoses(bus), *stations.hints(bus, relations)):
            self._line("  " + each.text(lang))

    def _relations(self, relations: Sequence[Relation]) -> None:
        """The parameter channels in cyclic frames, and how sure each is."""
        if not relations:
            return
        self._section(self._say("relations_head"))
        for each in relations[:RELATIONS_LISTED]:
            numbers = ", ".join(map(str, each.telegrams))
            out, in_, ms = each.output.frame_id, each.input.frame_id, each.cycle_ms
            self._line("  " + self._say(
                "relation_ppo" if out is None else "relation",
                where=_where(each), channel=each.channel.upper(),
                telegram=self._say("relation_telegram", numbers=numbers) if numbers else "",
                output=f"{out or 0:04X}", output_at=each.output.offset,
                input=f"{in_ or 0:04X}", input_at=each.input.offset,
                cycle=self._say("relation_cycle", cycle=duration(round(ms * 1_000_000))) if ms is not None else "",
                certainty=self._say(_certainty(each)),
            ))  # fmt: skip
            self._words_of(each)
        self._rest(len(relations) - RELATIONS_LISTED)

    def _senders(self, senders: Sequence[Sender]) -> None:
        """Who sends cyclic frames in which no channel is known, and how to name one."""
        if not senders:
            return
        self._section(self._say("senders_head"))
        for each in senders[:RELATIONS_LISTED]:
            frame_id = f"{each.frame_id:04X}"
            self._line(
                "  "
                + self._say("sender", mac=each.mac, to=each.to, frame_id=frame_id, n=each.length)
            )
        self._rest(len(senders) - RELATIONS_LISTED)
        known = [each for each in senders if each.word is not None]
        pairs = [
            (one, other) for one in known or senders for other in known or senders
            if one.is_answered_by(other) and one.word != "ZSW1"
        ]  # fmt: skip
        if pairs:
            self._line("  " + self._say("senders_offer" if known else "senders_form"))
        for pair in pairs[: NAMES_OFFERED if known else 1]:
            names = [
                f"--cyclic {each.mac}@{each.frame_id:04X}:{'OFFSET' if each.offset is None else each.offset}:pzd"
                for each in pair
            ]
            self._copied("    " + " ".join(names))

    def _words_of(self, relation: Relation) -> None:
        """The words of a drive, where only one telegram has these lengths."""
        if relation.channel == PZD and len(relation.telegrams) == 1:
            row = telegrams()[relation.telegrams[0]]
            both = {"output": ", ".join(row.out), "input": ", ".join(row.inward)}
            self._line("    " + self._say("relation_words", number=str(row.number), **both))

    def _timelines(self, result: CaptureResult) -> None:
        """What happened to each drive, a line for each word and frame."""
        for timeline in result.timelines:
            from ds47.report import timelines  # few captures have any

            relation = result.relations[timeline.relation - 1]
            self._section(self._say("timeline_head", where=_where(relation)))
            known = timelines.reference(result, relation.device, self.options.reference)
            if known is not None:
                self._line("  " + timelines.reference_words(known).text(self.options.lang))
            rows = timelines.rows(timeline)
            self._rows_of(map(self._event, rows[:EVENTS_LISTED]), lead=range(3))
            self._rest(len(rows) - EVENTS_LISTED)
            if timeline.events_left_out:
                self._line("  " + self._say("timeline_left_out", n=timeline.events_left_out))

    def _event(self, row: EventRow) -> list[Both]:
        from ds47.report import timelines

        moment, standing = self._clock.at(row.last.time_ns), timelines.standing(row)
        return [
            say("frame", frame=str(row.last.frame)),
            *map(Both.same, filter(None, [moment])),
            Both.same(f"{self._clock.since(row.last.time_ns)} s"),
            Both.same(timelines.change(row)),
            timelines.words(row),
            Both.same(f"[{standing.text(self.options.lang)}]" if standing.en else ""),
        ]

    def _connections(self, result: CaptureResult) -> None:
        """The connections of S7."""
        if not result.connections:
            return
        lang = self.options.lang
        self._section(self._say("s7_head"))
        listed = list(islice(communication.rows(result), CONNECTIONS_LISTED))
        self._rows_of(listed, communication.head())
        left_out = len(result.connections) - len(listed) + result.connections_left_out
        if left_out:
            self._line("  " + self._say("s7_left_out", n=left_out))
        for each in communication.about(result, CONNECTIONS_LISTED):
            self._line("  " + each.text(lang))
        if communication.blocks_missing(result):
            self._line("  " + self._say("s7_no_block"))
        unlisted = sum(not self._is_listed(each) for each in result.transactions)
        if unlisted:
            self._line("  " + self._say("s7_unlisted", n=unlisted))

    def _buffers(self, result: CaptureResult) -> None:
        """The entries of fault buffers, where more is known of them than their numbers."""
        for each in buffers.buffers(result):
            self._section(buffers.head(each).text(self.options.lang))
            rows = buffers.rows(each)
            self._rows_of(rows, lead=range(len(rows[0])))

    def _files(self, files: Sequence[CaptureFile]) -> None:
        """Of a series: which file has which frames, and which are missing."""
        if not files:
            return
        self._line("  " + self._say("files_as_one", n=len(files)))
        if files[0].missing_before:
            self._line("    " + self._say("files_before", n=files[0].missing_before))
        for file in files[:FILES_LISTED]:
            self._missing(file, files[0])
            shown = self._frames(file)
            problem = f"  {escape(file.problem)}" if file.problem else ""
            self._line(f"    {escape(name(file))}: {shown}" + self._paint("error", problem))
        for file in files[FILES_LISTED:]:
            self._missing(file, files[0])
        if len(files) > FILES_LISTED:
            self._line("    " + self._say("files_more", n=len(files) - FILES_LISTED))

    def _frames(self, file: CaptureFile) -> str:
        if not file.frames:
            return self._say("frames_none")
        last = file.first_frame + file.frames - 1
        return self._say("frames_range", first=str(file.first_frame), last=str(last))

    def _missing(self, file: CaptureFile, first: CaptureFile) -> None:
        if file.missing_before and file is not first:
            text = self._say("files_missing", n=file.missing_before, name=escape(name(file)))
            self._line("    " + self._paint("warning", text))

    def _listed(self, result: CaptureResult) -> Iterator[tuple[Transaction, list[str]]]:
        """The transactions that are listed, each with its lines."""
        listed = [each for each in result.transactions if self._is_listed(each)]
        if listed:
            table = _Columns(listed, Targets(result.evidence), self.options.lang, self._clock)
            yield from ((each, self._transaction_lines(each, table)) for each in listed)

    def _table(self, result: CaptureResult) -> None:
        witness = plc.Witness(result)
        for number, (each, lines) in enumerate(self._listed(result)):
            if not number:
                key = "line_columns" if self._clock.known else "line_columns_undated"
                self._section(self._say("transactions_head"))
                self._line("  " + self._paint("dim", self._say(key)))
            self._copied("\n".join(lines))
            shown = self.options.plc or each.state != "ok" or witness.is_cut(each)
            if each.channel == DS47 and shown:
                saw = witness.line(each).text(self.options.lang)
                self._line("      " + self._paint("dim", saw))

    def _is_listed(self, item: Transaction) -> bool:
        return item.channel != S7 or communication.listed(item, self.options.s7)

    def _transaction_lines(self, item: Transaction, table: _Columns) -> list[str]:
        left = table.left(item)
        marks = [self._state(item)] if item.state != "ok" else []
        lang, written = self.options.lang, item.operation == "change"
        parts = [parameter(each, written, lang) for each in item.parameters]
        if item.channel == S7:
            parts = communication.parts(item, lang)
        end, width = [*marks, _timing(item, lang)], self.options.columns
        whole = "  ".join([left, *filter(None, ["; ".join(parts)]), *end])
        if columns(whole) <= width or not parts:
            return wrap(whole, width, 6)
        number = counted("s7_items" if item.channel == S7 else "parameters", len(parts)).text(lang)
        below = [line for part in parts for line in wrap(f"      {part}", width, 8)]
        front, end_text = [left, number][: len(parts)], "  ".join(end)
        whole = "  ".join([*front, end_text])
        if columns(whole) <= width:
            return [whole, *below]
        return [*wrap("  ".join(front), width, 6), *wrap("      " + end_text, width, 6), *below]

    def _state(self, item: Transaction) -> str:
        refusals = [
            word
            for word in (item.write_status, item.read_status)
            if word and item.state == "refused"
        ]
        words = " ".join(f"{word:08X}" for word in refusals) or communication.error(
            item, self.options.lang
        )
        color = "error" if item.state in _SERIOUS_STATES else "warning"
        name = state(item.state).text(self.options.lang)
        return self._paint(color, f"[{name} {words}]" if words else f"[{name}]")

    def _findings(self, findings: Sequence[Finding], file_frames: FileFrames) -> None:
        if not findings:
            return
        self._section(self._say("findings_head"))
        groups: dict[tuple[str, str], list[Finding]] = {}
        for each in findings:
            groups.setdefault((each.rule, each.severity), []).append(each)
        for group in sorted(
            groups.values(), key=lambda of: (-SEVERITIES.index(of[0].severity), of[0].rule)
        ):
            self._group(group, file_frames)

    def _group(self, group: Sequence[Finding], file_frames: FileFrames) -> None:
        first = group[0]
        rule = self.options.rules.get(first.rule)
        name = f" {rule.name}" if rule else ""
        severity = self._paint(first.severity, self._say(f"severity_{first.severity}"))
        number = self._say("findings", n=len(group))
        values = {"rule": first.rule, "severity": severity, "name": name, "findings": number}
        self._line("  " + self._say("findings_of_rule", **values))
        for each in group[:FINDINGS_PER_RULE]:
            self._line("    " + self._finding(each, file_frames))
        if len(group) > FINDINGS_PER_RULE:
            self._line("    " + self._say("more", number=str(len(group) - FINDINGS_PER_RULE)))
        if not self.options.filters:
            return
        for file, frames in file_frames.by_file(frame for each in group for frame in each.counted):
            text, left_out = display_filter(frames)
            note = "  " + self._say("frames_more", n=left_out) if left_out else ""
            where = f"{escape(file)}: " if file else ""
            self._copied(f"    {where}{self._paint('dim', text)}{note}")

    def _finding(self, item: Finding, file_frames: FileFrames) -> str:
        text = escape(sentence(item, self.options.lang))
        text = at_offset(item.offset, text, self.options.lang)
        frame = escape(file_frames.words(item.frame, self.options.lang))
        job = "" if item.transaction is None else f" #{item.transaction}"
        time = "" if item.time_ns is None else f" {self._clock.moment(item.time_ns)}"
        return self._say("finding_line", frame=frame, job=job + time, message=text)

    def _summary(
        self, title: str, sums: dict[str, Any], latency: Latency, verdict: str = ""
    ) -> None:
        self._section(title)
        if verdict:
            self._line(f"  {verdict}")
        for line in self._totals(sums, latency):
            self._line(line)

    def _totals(self, sums: dict[str, Any], latency: Latency) -> list[str]:
        lang = self.options.lang
        work = [each.text(lang) for each in told_sums(sums, str)]
        return [f"  {line}" for line in (*work, latency.text(lang)) if line]


def _where(relation: Relation) -> str:
    slot = "" if relation.slot is None else f" slot {relation.slot}.{relation.subslot}"
    return escape(relation.device) + slot


def _certainty(relation: Relation) -> str:
    """The key of the words that say how sure a relation is."""
    if relation.frame is None:
        return "certainty_absent"
    drive = relation.channel == PZD and relation.certainty == SEEN
    return "certainty_seen_pzd" if drive else f"certainty_{relation.certainty}"


class _Columns:
    """The columns that distinguish the transactions of one capture, and their widths."""

    def __init__(
        self, transactions: Sequence[Transaction], targets: Targets, lang: str, clock: Clock
    ) -> None:
        self._targets = targets
        self.lang = lang
        self._clock = clock
        starts = [each.start_ns for each in transactions]
        self.since = max(len(clock.since(each)) for each in (min(starts), max(starts)))
        self.frame = len(str(max([each.frames.first() for each in transactions])))
        asked = {each.operation for each in transactions}
        self.operation = max(columns(_operation(each, lang)) for each in asked)
        self.number = len(str(max([each.id for each in transactions]))) + 1
        self.controllers = len({each.controller for each in transactions}) > 1
        self.slots = len({(each.api, each.slot, each.subslot) for each in transactions}) > 1
        self._routes = {each.id: self._route(each) for each in transactions}
        self.route = max(map(len, self._routes.values()))

    def _route(self, item: Transaction) -> str:
        controller = f"{escape(item.controller)} -> " if self.controllers else ""
        where = self._targets.where(item, with_slot=self.slots)
        return f"{controller}{escape(item.device)} {where}".rstrip()

    def _seconds(self, item: Transaction) -> str:
        """Seconds since the first frame of the capture."""
        return self._clock.since(item.start_ns).rjust(self.since)

    def left(self, item: Transaction) -> str:
        """The start of the line: number, time, first frame, operation, where to."""
        number = f"#{item.id}".ljust(self.number)
        moment = self._clock.at(item.start_ns)
        since = self._seconds(item)
        frame = str(item.frames.first()).rjust(self.frame)
        number = "  ".join(filter(None, [number, moment, since, frame])) + " "
        word = _operation(item.operation, self.lang)
        word += " " * (self.operation - columns(word))
        route = self._routes.get(item.id) or self._route(item)
        return f"{number} {word}  {route.ljust(self.route)}"


@lru_cache
def _operation(word: str, lang: str) -> str:
    return operation(word).text(lang)


def _timing(item: Transaction, lang: str) -> str:
    frames = item.frames
    shown = counted("frames", len(frames.all())).text(lang)
    if item.duration_ns is not None:
        shown = f"{shown} {duration(item.duration_ns)}"
    more = [] if item.cycles is None else [counted("cycles", item.cycles).text(lang)]
    for key, reads in (("polled", frames.polls), ("read_again", frames.rereads)):
        if reads:
            more.append(say_in(lang, key, times=counted("times", len(reads))))
    return ("，" if lang == "zh" else ", ").join([shown, *more])


def _traffic(result: CaptureResult) -> Both | None:
    """What a capture without transactions has instead, as proof that it was read."""
    calls = [
        say("record_index", index=index, kind=say(f"statistics_{kind}"), number=str(number))
        for index, kinds in sorted(result.records.items(), key=lambda each: (len(each[0]), each[0]))
        for kind, number in kinds.items()
        if number
    ]
    rpc = [
        say(f"rpc_{name}").joined(Both.same(f"{number}"), zh=" ")
        for name, number in result.rpc.items()
        if number
    ]
    if not rpc:
        return None
    if len(calls) > 6:
        calls[6:] = [say("more", number=str(len(calls) - 6))]
    shown = Both.same("RPC").joined(joined(rpc), ": ", "：")
    return shown.joined(say("record_calls", calls=joined(calls)), zh="", en="") if calls else shown
