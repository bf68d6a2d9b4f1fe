"""The first lines of the text report: verdict, drives, what to do, what the capture cannot show.

In English or Chinese, by the words of spec/report.toml; what to do comes from `ds47.report.todo`. A capture in
which all is well has the first two only. Nothing here writes: lines are given to whoever prints them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ds47.findings.grouping import headlines
from ds47.model import CaptureResult, Device, Diagnosis, Finding
from ds47.report import ReportOptions
from ds47.report.bilingual import say, say_in
from ds47.report.clock import Clock, seen_at
from ds47.report.digest import times_of, who
from ds47.report.file_frames import FileFrames
from ds47.report.filters import display_filter, plugin_filter
from ds47.report.formatting import escape
from ds47.report.latency import Latency
from ds47.report.sentences import advice, advice_parts, sentence
from ds47.report.todo import More, answering, by_state, causes, is_lowered, of_state, uncovered
from ds47.report.verdict import VerdictCounts, blind, inventory, verdict
from ds47.report.wrap import columns, cut, fitted, wrap
from ds47.spec import called

WIDTH = 100
"""Columns of a line of prose at most; what can be copied is never broken."""
DRIVES = 50
"""Drives, and other devices, that are listed."""
_LONGEST_SCL = 32
"""Bytes of a corrected request that is shown as SCL as well; `ds47 encode -f scl` shows any."""
OF_ONE_RULE = 3
"""The most diagnoses of one rule that are listed one by one."""
COLORS = {"bad": "error", "warn": "warning", "good": "ok", "none": "dim"}
"""The colour of a verdict by its level."""


class Opening:
    """Makes the lines."""

    def __init__(self, options: ReportOptions) -> None:
        self._options = options
        self._lang = options.lang
        self._paint = options.paint
        self._width = min(WIDTH, options.columns)
        self._clock = Clock(options.zone, None)
        self._seen_at: dict[int, int] = {}
        """When the frames of findings were, by number."""

    def verdict(self, counts: VerdictCounts, width: int | None = None) -> str:
        """`NOT OK: dp3 refuses its configuration; 2 more causes`, cut where it is wider than `width`."""
        text = verdict(counts).text(self._lang)
        return self._paint(COLORS[counts.level], text if width is None else cut(text, width))

    def there(self, counts: VerdictCounts) -> Iterator[str]:
        """What is there, unless the verdict says it: `1 drive, 8 transactions, 4 ok, 1 partial`."""
        if counts.nothing:
            yield self._say("verdict_mirror")
        if counts.level not in ("good", "none") and (found := inventory(counts)):
            yield found.text(self._lang)

    def lines(self, result: CaptureResult, clock: Clock, counts: VerdictCounts) -> Iterator[str]:
        """Everything behind the verdict, each part with an empty line before it; no line is to be broken."""
        self._clock = clock
        self._seen_at = seen_at(result)
        yield from self._drives(result, counts)
        serious = [each for each in result.diagnoses if each.severity != "note"]
        rest = uncovered(result)
        if result.diagnoses or rest:
            yield from self._title("to_do_head")
            yield from self._to_do(result, rest, FileFrames(result.files))
        if serious or rest or counts.level not in ("good", "none"):
            yield from self._blind(result)

    def _say(self, key: str, **values: object) -> str:
        return say_in(self._lang, key, **values)

    def _title(self, key: str) -> Iterator[str]:
        yield ""
        yield self._paint("bold", self._say(key))

    # Drives

    def _drives(self, result: CaptureResult, counts: VerdictCounts) -> Iterator[str]:
        drives = who(result, counts)
        ours = {each.device.ip for each in drives}
        others = [each for each in result.devices if each.ip not in ours]
        times, objects = _times(result)
        texts = []
        for each in drives:
            time = times.get(each.device.ip) if len(drives) > 1 else None
            about = [] if each.telegram is None else [each.telegram.text(self._lang)]
            about += self._of_objects(objects.get(each.device.ip, {}))
            took = f"  {time.brief(self._lang)}" if time else ""
            texts.append((f"  {each.transactions.text(self._lang)}{took}", about))
        devices = [each.device for each in drives]
        yield from self._devices("drives_head", "more_drives", devices, texts)
        yield from self._devices(
            "other_devices_head", "more_devices", others, [("", [])] * len(others)
        )

    def _of_objects(self, times: dict[int, Latency]) -> list[str]:
        """`DO 1: p50 1.6 ms, max 252.2 ms; DO 2: ...`; nothing of a single drive object."""
        texts = [f"DO {number}: {times[number].brief(self._lang)}" for number in sorted(times)]
        return [("; " if self._lang == "en" else "；").join(texts)] if len(texts) > 1 else []

    def _devices(
        self,
        title: str,
        more: str,
        items: Sequence[Device],
        texts: Sequence[tuple[str, Sequence[str]]],
    ) -> Iterator[str]:
        if not items:
            return
        yield from self._title(title)
        shown = items[:DRIVES]
        width = max(len(escape(each.ip)) for each in shown)
        for each, (text, more_of_it) in zip(shown, texts, strict=False):
            line = f"  {escape(each.ip):<{width}}{about(each, self._lang)}{text}".rstrip()
            yield from fitted(line, self._options.columns)
            for further in more_of_it:
                yield from fitted("      " + further, self._options.columns)
        if len(items) > DRIVES:
            yield "  " + self._say(more, n=len(items) - DRIVES)

    # What to do

    def _to_do(
        self, result: CaptureResult, rest: list[Finding], files: FileFrames
    ) -> Iterator[str]:
        yield from self._causes(result, result.diagnoses, files)
        if rest and result.diagnoses:
            yield "  " + self._paint("bold", self._say("other_findings_head"))
        yield from self._causes(result, headlines(rest), files)

    def _causes(
        self, result: CaptureResult, items: Sequence[Diagnosis], files: FileFrames
    ) -> Iterator[str]:
        """Diagnoses, or the findings that none covers, by what they have in common."""
        several = len({each.device for each in result.transactions}) > 1
        said: dict[str, set[str]] = {}
        for each in causes(items, OF_ONE_RULE):
            if isinstance(each, More):
                yield from self._more(each)
                continue
            yield from self._diagnosis(each, several)
            yield from self._advice(each, said)
            if axes := answering(result, each):
                yield from fitted("    " + self._say("answering", list=axes), self._width)
            yield from self._state(result, each)
            yield from self._look(each, files)
            yield from self._corrected(each)

    def _diagnosis(self, item: Diagnosis, several: bool) -> Iterator[str]:
        text = escape(sentence(item, self._lang))
        if several and item.device and item.device not in text:
            text = self._say("cause_device", device=escape(item.device), message=text)
        known = self._options.rules.get(item.rule)
        line = self._say(
            "cause_line",
            rule=item.rule,
            severity=self._say(f"severity_{item.severity}"),
            name=known.name if known else "",
            message=text,
        )
        if times := times_of(item):
            line += ("", " ")[self._lang != "zh"] + times.text(self._lang)
        first, *others = wrap(line.rstrip(), self._width - 4)
        yield "  " + self._paint(item.severity, first)
        for other in others:
            yield "    " + self._paint(item.severity, other)

    def _state(self, result: CaptureResult, item: Diagnosis) -> Iterator[str]:
        """What the status word of the drive says of it."""
        found = by_state(of_state(result), item.transactions)
        if found is not None:
            said = escape(sentence(found, self._lang))
            for line in wrap(
                self._say("state_says", job=str(found.transaction), message=said), self._width - 4
            ):
                yield "    " + line

    def _more(self, item: More) -> Iterator[str]:
        known = self._options.rules.get(item.rule)
        times = self._say("times", n=item.findings)
        name = known.name if known else ""
        line = self._say("more_causes", rule=item.rule, name=name, n=item.causes, times=times)
        yield from fitted("  " + line, self._width)

    def _advice(self, item: Diagnosis, said: dict[str, set[str]]) -> Iterator[str]:
        """What to do, each part once for diagnoses of one rule that follow each other.

        `said`: those of the last one, by its rule, or by the word that stands for those of other makers.
        """
        known = self._options.rules.get(item.rule)
        key = "advice_foreign" if is_lowered(item.rule, item.severity) else item.rule
        before = said.pop(key, set())
        said.clear()
        if known is None:
            return
        if key != item.rule:
            parts, text = [key], "" if before else self._say(key)
        else:
            parts = advice_parts(known, item.args, self._lang)
            text = advice(known, item.args, self._lang, before)
        said[key] = before.union(parts)
        for line in wrap("-> " + text, self._width - 4, 3) if text else ():
            yield "    " + line

    def _look(self, item: Diagnosis, files: FileFrames) -> Iterator[str]:
        """Where it shows: the first frame, and what shows them all."""
        frames, jobs = item.frames, item.transactions
        if not frames:
            return
        frame = escape(files.number(frames[0], self._lang))
        about = [f"#{jobs[0]}"] if jobs else []
        if frames[0] in self._seen_at:
            about.append(self._clock.moment(self._seen_at[frames[0]]))
        if about:
            frame = self._say("frame_about", frame=frame, about=", ".join(about))
        if self._options.filters:
            yield from self._filters(item, files, frame)
            return
        short = plugin_filter(item.rule) if len(frames) > 1 else None
        line = self._say("look_at_first", frame=frame)
        whole = line if short is None else self._say("look_at", frame=frame, filter=short)
        if columns(whole) <= self._width - 4:
            yield "    " + self._paint("dim", whole)
            return
        yield from fitted("    " + self._paint("dim", line), self._width)
        if short is not None:
            yield "      " + self._paint("dim", short)

    def _filters(self, item: Diagnosis, files: FileFrames, frame: str) -> Iterator[str]:
        """The filter for all of its frames; of a series that of the first file, then that of each other."""
        (_, numbers), *others = files.by_file(item.frames)
        shown, left_out = display_filter(numbers)
        line = self._say("look_at", frame=frame, filter=shown)
        yield "    " + self._paint("dim", line) + self._left_out(left_out + item.frames_left_out)
        for file, numbers in others:
            shown, left_out = display_filter(numbers)
            line = self._paint("dim", f"{escape(file)}: {shown}")
            yield f"      {line}{self._left_out(left_out)}"

    def _left_out(self, frames: int) -> str:
        return "  " + self._say("frames_more", n=frames) if frames else ""

    def _corrected(self, item: Diagnosis) -> Iterator[str]:
        """The request as it should have been."""
        if item.corrected is None:
            return
        from ds47.diagnosis.suggest import corrected  # not for captures without any

        better = corrected(item.corrected, item.args.get("family"))
        if item.count > 1 and item.corrected_in is not None:
            yield "    " + self._say("instead_of", job=str(item.corrected_in), hex=better.hex)
        else:
            yield "    " + self._say("instead", hex=better.hex)
        for line in wrap(" ".join(better.words), self._width - 6):
            yield "      " + line
        if len(item.corrected) <= _LONGEST_SCL:
            for line in better.scl.splitlines():
                yield from fitted("      " + line.replace("; ", ";  "), self._width, 0)
        if better.encode:
            yield "      " + better.encode
            if better.block:
                yield "      " + self._say("as_function_block")

    # What the capture cannot show

    def _blind(self, result: CaptureResult) -> Iterator[str]:
        lines = blind(result)
        if not lines:
            return
        yield from self._title("blind")
        for each in lines:
            for number, line in enumerate(wrap(each.text(self._lang), self._width - 4)):
                yield ("    " if number else "  ") + line


def about(item: Device, lang: str = "en") -> str:
    """MAC, station name, vendor and device id of a device, if known."""
    mac = f"  {escape(item.mac)}" if item.mac else ""
    return mac + station(item) + whose(item, lang)


def station(item: Device) -> str:
    """The name of a station, in quotes; nothing where it is not known."""
    return f'  "{escape(item.station)}"' if item.station else ""


def whose(item: Device, lang: str) -> str:
    """Vendor and device id, as far as they are known."""
    parts = list[str]()
    if item.vendor_id is not None:
        parts.append(say("vendor_id", id=f"{item.vendor_id:04X}").text(lang))
    elif item.assumed_vendor_id is not None:
        vendor = called(item.assumed_vendor_id, lang)
        words = say("vendor_assumed", id=f"{item.assumed_vendor_id:04X}", vendor=vendor)
        parts.append(words.text(lang))
    if item.device_id is not None:
        parts.append(say("device_id", id=f"{item.device_id:04X}").text(lang))
    return "".join(f"  {part}" for part in parts)


def _times(result: CaptureResult) -> tuple[dict[str, Latency], dict[str, dict[int, Latency]]]:
    """How long the transactions of each drive took, by its address, and of each of its drive objects."""
    drives: dict[str, Latency] = {}
    objects: dict[str, dict[int, Latency]] = {}
    device = result.named()
    for each in result.transactions:
        if each.duration_ns is None or each.duration_ns < 0:
            continue
        ip = device(each.device).ip
        drives.setdefault(ip, Latency()).add(each.duration_ns)
        if each.drive_object is not None:
            of_drive = objects.setdefault(ip, {})
            of_drive.setdefault(each.drive_object, Latency()).add(each.duration_ns)
    return drives, objects
