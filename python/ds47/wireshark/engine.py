"""The engine tshark: the same model as from `ds47.analysis`, but decoded by the Wireshark plugin.

The native engine reads the capture and keeps the frames that may matter; only those go through
tshark, and their numbers are put back into what it says. To compare, all frames of a file do: what the
native engine passed over may be what it does wrong. What the plugin does not show (counts,
devices, S7, drives without an event, findings of rules that only the analyzer has) is that of the
native engine. `both` compares the two: a difference is a finding (DS601).
Running tshark is in `tshark`, reading its answer in `fields`.
"""

from __future__ import annotations

import tempfile
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

from ds47 import model, spec
from ds47.acyclic.transactions import summarise
from ds47.analysis import AnalysisOptions, OnTransaction
from ds47.analysis import analyze as analyze_natively
from ds47.capture import Capture, CaptureError, Frame, sha256
from ds47.capture.scan import IPV4, TCP, network_layer
from ds47.capture.stream import Stream
from ds47.capture.writer import PcapngWriter, nearest
from ds47.findings.collection import Findings, rules_of_others
from ds47.findings.times import FrameTimes
from ds47.parameters import table
from ds47.profibus import LINK_TYPES
from ds47.regression.compare import Change, compare
from ds47.regression.config import Config
from ds47.report import handed_out, load
from ds47.report import json as report
from ds47.report.sentences import renumbered
from ds47.spec.semantics import limits
from ds47.wireshark import tshark
from ds47.wireshark.fields import Fields

DIFFERS = "DS601"
_MOST_MS = 2**32 - 1
_YEARS_MS = 2**53 / 1e6
"""Durations from which on tshark shows too few digits."""
_HOME_NS = 2**60
"""The time of the first frame in a capture with times that the file cannot hold: 2006."""

Json = dict[str, Any]


class Engine:
    """Analyses captures with tshark; ready once it is made.

    Args:
        name: "tshark" gives what the plugin says, "both" what the native engine says and where the
            plugin differs.
        options: choices of the user, for all captures.
        program: tshark; None for the one of this machine.
        lang: language in which it is said where the two differ, "en" or "zh".

    Raises:
        ds47.wireshark.tshark.NotReadyError: something is missing, in one line.
    """

    def __init__(
        self,
        name: Literal["tshark", "both"],
        options: AnalysisOptions,
        program: str | None = None,
        lang: str = "en",
    ) -> None:
        self._both = name == "both"
        self._options = options
        self._lang = lang
        ignore = (*options.ignore, *rules_of_others(options.channels))
        self._findings = Findings(options.select, ignore)
        self._preferences = preferences(options)
        self._tshark = tshark.prepare(program)

    def analyze(
        self, source: str | Path | BinaryIO, on_transaction: OnTransaction | None = None
    ) -> model.CaptureResult:
        """Analyses one capture; arguments and result are those of `ds47.analysis.analyze`.

        `on_transaction` is called at the end of the capture: tshark needs two passes.

        Raises:
            ds47.capture.CaptureError: nothing of the source can be read, or tshark gave up.
        """
        with tempfile.TemporaryDirectory(prefix="ds47-") as folder:
            extract = Path(folder, "frames.pcapng")
            capture = _Extract(source, extract)
            whole = self._both and isinstance(source, (str, Path)) and str(source) != "-"
            with capture:
                native = analyze_natively(source if whole else capture, self._options)
                for frame in capture.everything() if whole else ():
                    capture.keep(frame)
            try:
                found, errors = self._ask(capture, extract, native, whole)
            except tshark.StoppedError as problem:
                if not self._both:
                    raise CaptureError(f"{native.path}: {problem}") from problem
                found, errors = None, [str(problem)]
        if capture.misfit is not None:
            text = f"the time of frame {capture.misfit} is too far from the others for tshark"
            if self._both:
                found, errors = None, [f"not compared, {text}"]
            elif found is not None:
                found.complete, found.problem = False, found.problem or text
        result = self._compared(native, found, errors) if self._both else found
        if result is None or (errors and not self._both):
            raise CaptureError(f"{native.path}: the plugin failed: {errors[0]}")
        if self._options.digest and isinstance(source, (str, Path)) and str(source) != "-":
            result.sha256 = sha256(source)
        return result if on_transaction is None else handed_out(result, on_transaction)

    def _ask(
        self, capture: _Extract, extract: Path, native: model.CaptureResult, whole: bool
    ) -> tuple[model.CaptureResult, list[str]]:
        """The result of the plugin, with the frame numbers of the capture itself."""
        shown, errors = Fields(), list[str]()
        if capture.numbers:
            answer = self._answer(capture, extract, whole)
            shown, errors = _of_channels(answer.fields, self._options.channels), answer.errors
        original = _Original(capture, native)
        transactions = [original.transaction(item) for item in shown.transactions]
        findings = [original.finding(each) for each in shown.findings]
        wanted = [each for each in findings if self._findings.wanted(each.rule)]
        joined = replace(native, **original.drives(shown.events, self._options.channels))
        return _joined(joined, transactions, wanted), errors

    def _answer(self, capture: _Extract, extract: Path, whole: bool) -> tshark.Answer:
        """What tshark says of the frames that were kept; of those that the analyzer chose every one counts."""
        chosen = list(self._preferences)
        if not whole:
            numbers = extract.with_name("numbers.txt")
            numbers.write_text("\n".join(map(str, capture.numbers)), "ascii")
            chosen.append(f"ds47.frame_numbers:{numbers}")
        if self._options.lists:
            lists = extract.with_name("parameters.tsv")
            lists.write_text(table.text(self._options.lists), "utf-8", newline="\n")
            chosen.append(f"ds47.lists:{lists}")
        return tshark.ask(self._tshark, extract, chosen)

    def _compared(
        self, native: model.CaptureResult, found: model.CaptureResult | None, errors: Sequence[str]
    ) -> model.CaptureResult:
        """The native result, with a finding for each difference."""
        if not self._findings.wanted(DIFFERS):
            return native
        first = next((t.frames.first() for t in native.transactions), 1)
        findings = [self._difference(text, first) for text in errors]
        if found is not None:
            findings += [
                self._difference(change.text, _frame(change, native, found) or first)
                for change in differences(native, found, self._lang)
            ]
        native.findings = sorted(native.findings + findings, key=_order)
        return native

    def _difference(self, text: str, frame: int) -> model.Finding:
        return model.Finding(
            DIFFERS, spec.rules()[DIFFERS].severity, frame, args={"difference": text}
        )


def _of_channels(shown: Fields, channels: Sequence[str]) -> Fields:
    """The transactions of some channels, counted anew, and the findings that are about no others."""
    wanted = [each for each in shown.transactions if each["channel"] in channels]
    numbers: dict[int | None, int | None] = {None: None}
    numbers |= {each["id"]: number for number, each in enumerate(wanted, 1)}
    return Fields(
        [each | {"id": numbers[each["id"]]} for each in wanted],
        [
            each | {"transaction": numbers[each["transaction"]]}
            for each in shown.findings
            if each["transaction"] in numbers
        ],
        shown.events,
    )


def _joined(
    native: model.CaptureResult,
    transactions: list[model.Transaction],
    findings: list[model.Finding],
) -> model.CaptureResult:
    """What the plugin says, with what only the native engine has: S7, and the rules that are marked.

    All transactions are numbered anew, by their first frame.
    """
    jobs = [copy(each) for each in native.transactions if each.channel == model.S7]
    own = [copy(each) for each in native.findings if spec.rules()[each.rule].analyzer_only]
    ordered = sorted([*transactions, *jobs], key=lambda each: each.frames.first())
    numbers: dict[tuple[bool, int | None], int | None]
    numbers = {
        (each.channel == model.S7, each.id): number for number, each in enumerate(ordered, 1)
    }
    for finding in findings:
        finding.transaction = numbers.get((False, finding.transaction))
    for finding in own:  # what is of no job of S7 has the same number with both engines
        finding.transaction = numbers.get((True, finding.transaction), finding.transaction)
    about: dict[int | None, set[str]] = {}
    for finding in (*findings, *own):
        about.setdefault(finding.transaction, set()).add(finding.rule)
    for number, each in enumerate(ordered, 1):
        each.id, each.findings = number, sorted(about.get(number, ()))
    summary = summarise(Counter((each.state, each.operation) for each in ordered))
    # Equal results are equal texts: the native one counts in the order in which they end.
    summary = {key: summary[key] for key in native.summary if key in summary} | summary
    found = sorted(findings + own, key=_order)
    return replace(native, transactions=ordered, findings=found, summary=summary)


def _order(finding: model.Finding) -> tuple[int, str, int, int]:
    return finding.frame, finding.rule, finding.transaction or 0, finding.offset or 0


def differences(
    native: model.CaptureResult, found: model.CaptureResult, lang: str = "en"
) -> list[Change]:
    """What differs between two results of one capture, in words of `lang`: was native, is tshark."""
    # One file: compare() then compares frames and times too.
    one_file = {"sha256": "the same"}
    stored, now = report.capture(native) | one_file, report.capture(found) | one_file
    for result in (stored, now):
        _round_ages(result["transactions"])
    return compare(stored, now, Config(), Path(native.path), lang)


def _round_ages(transactions: list[Json]) -> None:
    """Leaves the 15 digits of tshark to durations that span years, where a clock was set."""
    for each in transactions:
        duration = each["duration_ms"]
        if duration is not None and abs(duration) > _YEARS_MS:
            each["duration_ms"] = float(f"{duration:.15g}")


def preferences(options: AnalysisOptions) -> list[str]:
    """The options of an analysis as preferences of the plugin.

    Rules are not left out by the plugin but afterwards: those of the comparison would be missing.

    Raises NotReadyError where the plugin takes whole milliseconds.
    """
    slow_ms = limits().slow_ns / 1e6 if options.slow_ms is None else options.slow_ms
    if not 0 <= slow_ms <= _MOST_MS or slow_ms != int(slow_ms):
        raise tshark.NotReadyError(f"the engine tshark takes whole ms for --slow, not {slow_ms:g}")
    if options.vendor_id not in (None, model.SIEMENS):
        raise tshark.NotReadyError("the engine tshark takes --vendor sinamics alone")
    codec = options.codec
    # Wireshark 3.4 takes no empty value. A preference is empty unless set.
    indices = ",".join(map(str, sorted(options.indices)))
    layouts = dict(options.pkw_layouts)
    plain = layouts.pop("", "cyclic")
    others = " ".join(f"{device}={layout}" for device, layout in sorted(layouts.items()))
    cyclic = " ".join(
        f"{each.mac}@{each.frame_id:04x}:{each.offset}:{each.kind}" for each in options.cyclic
    )
    ppos = " ".join(f"{station}=ppo{number}" for station, number in options.ppos)
    return [
        *([f"ds47.indices:{indices}"] if indices else []),
        f"ds47.pkw_layout:{plain}",
        *([f"ds47.pkw_layouts:{others}"] if others else []),
        *([f"ds47.cyclic:{cyclic}"] if cyclic else []),
        *([f"ds47.ppos:{ppos}"] if ppos else []),
        "ds47.profibus_user0:TRUE",  # the analyzer looks at USER0, too
        "ds47.index_47:auto",
        "ds47.language:en",
        f"ds47.slow_ms:{int(slow_ms)}",
        f"ds47.legacy_g120_formats:{str(codec.legacy_g120_formats).upper()}",
        f"ds47.assume_sinamics:{str(options.vendor_id == model.SIEMENS).upper()}",
        f"ds47.profile_v3_types:{str(codec.profile_v3_types).upper()}",
    ]


def _is_tcp(frame: Frame) -> bool:
    """Whether a frame is TCP, which the plugin does not decode."""
    kind, at = network_layer(frame.data, 0, len(frame.data), frame.link_type)
    return kind == IPV4 and frame.data[at + 9 : at + 10] == bytes((TCP,))


class _Extract(Capture):
    """A capture that keeps, while it is read, the frames that may matter in a file of their own.

    Attributes:
        numbers: `numbers[n - 1]` is the number in the capture of frame n of that file.
        times: when the frames of the capture were.
        shift: nanoseconds by which all times are later in that file: it holds none before 1970.
        misfit: the first frame with a time that it cannot hold even so; None if all times are right.
    """

    def __init__(self, source: str | Path | BinaryIO, path: Path) -> None:
        stream = Stream(source)
        try:
            super().__init__(stream)
        except CaptureError as error:
            stream.close()
            raise CaptureError(f"{stream.name}: {error.message}") from error
        self.numbers = array("Q")
        self.times = FrameTimes(limits().frame_times)
        self.shift = 0
        self.misfit: int | None = None
        self._writer = PcapngWriter(path, link_type=None)
        self._interfaces: dict[int, int] = {}

    def __iter__(self) -> Iterator[Frame]:
        for frame in super().__iter__():
            self.keep(frame)
            yield frame

    def keep(self, frame: Frame) -> None:
        """Writes a frame into the file."""
        if _is_tcp(frame):
            return
        interface = self._interfaces.get(frame.link_type)
        if interface is None:
            interface = self._writer.add_interface(frame.link_type)
            self._interfaces[frame.link_type] = interface
        if not self.numbers and nearest(frame.time_ns) != frame.time_ns:
            self.shift = _HOME_NS - frame.time_ns
        wanted = frame.time_ns + self.shift
        time = nearest(wanted)
        if time != wanted and self.misfit is None:
            self.misfit = frame.number
        self._writer.write(time, bytes(frame.data), frame.original_length, interface=interface)
        self.numbers.append(frame.number)
        if frame.link_type not in LINK_TYPES or self.timed:
            self.times.note(frame)

    def close(self) -> None:
        """Close both files."""
        super().close()
        self._writer.close()


class _Original:
    """Puts what the plugin cannot know into what it says: numbers and times, and that frames are lost."""

    def __init__(self, capture: _Extract, native: model.CaptureResult) -> None:
        self._native = native
        self._numbers = capture.numbers
        self._shift = capture.shift
        self._times = capture.times
        self._dropped = bool(native.dropped)
        self._vendors = {each.ip: each.vendor for each in native.devices}

    def transaction(self, item: Json) -> model.Transaction:
        """The transaction, with the frame numbers and the time of the capture."""
        transaction = load.transaction(item, self._vendors.get(item["device"]))
        transaction.start_ns -= self._shift
        frames = transaction.frames
        for name in ("write_request", "write_response", "read_request", "read_response"):
            setattr(frames, name, self._number(getattr(frames, name)))
        frames.polls = [model.Read(self._number(a), self._number(b)) for a, b in frames.polls]
        frames.rereads = [model.Read(self._number(a), self._number(b)) for a, b in frames.rereads]
        for each in transaction.parameters:
            if each.described is not None:
                moved = tuple(self._numbers[frame - 1] for frame in each.described.frames)
                each.described = each.described._replace(frames=moved)
        return transaction

    def finding(self, item: Json) -> model.Finding:
        """The finding, with the frame numbers of the capture, also among its arguments."""
        finding = load.finding(item)
        finding.frame = self._numbers[finding.frame - 1]
        finding.time_ns = self._times.of(finding.frame)
        finding.frames = [self._numbers[frame - 1] for frame in finding.frames]
        args = spec.rules()[finding.rule].carried(finding.args)
        finding.args = renumbered(finding.rule, args, lambda n: self._numbers[n - 1])
        if "dropped" in finding.args:  # a missing frame: the capture may say that it dropped some
            last = finding.args.get("reason") in (None, "end")
            finding.args["dropped"] = self._dropped and last
        return finding

    def drives(self, events: list[Json], channels: Sequence[str]) -> Json:
        """The relations and timelines of the native result, with what the plugin says of drives instead."""
        if model.PZD not in channels:
            return {}
        relations = [copy(each) for each in self._native.relations]
        lines = {each.relation: replace(each, events=[]) for each in self._native.timelines}
        for each in events:
            number, frame = each["relation"], self._numbers[each["frame"] - 1]
            time_ns = self._times.of(frame) or 0
            words = (each[key] for key in ("name", "word", "before", "after", "state", "overlays"))
            if number > len(relations):
                number = len(relations) + 1
                relations.append(_of_plugin(each))
            line = lines.setdefault(number, model.Timeline(number))
            line.events.append(model.Event(frame, time_ns, *words))
            for key in ("device", "slot", "subslot", "telegrams"):
                setattr(relations[number - 1], key, each[key])
        return {"relations": relations, "timelines": [lines[number] for number in sorted(lines)]}

    def _number(self, frame: int | None) -> int | None:
        return None if frame is None else self._numbers[frame - 1]


def _of_plugin(event: Json) -> model.Relation:
    """The relation of an event that the native engine does not have."""
    nowhere = model.Side("", None, 0, 0)
    return model.Relation(
        model.PZD, "", event["device"], None, event["slot"], event["subslot"], event["telegrams"],
        nowhere, nowhere, None, None, model.SEEN,
    )  # fmt: skip


def _frame(change: Change, native: model.CaptureResult, found: model.CaptureResult) -> int | None:
    """A frame in which a difference shows."""
    if change.stored is not None:
        return native.transactions[change.stored].frames.first()
    if change.now is not None:
        return found.transactions[change.now].frames.first()
    about = change.is_now or change.was
    return about.get("frame") if isinstance(about, dict) else None
