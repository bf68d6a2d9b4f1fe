"""The engine tshark: the same model as from `ds47.analysis`, but decoded by the Wireshark plugin.

The native engine reads the capture and keeps the frames that may matter; only those go through
tshark, and their numbers are put back into what it says. What the plugin does not show (counts,
devices) is that of the native engine. `both` compares the two: a difference is a finding (DS601).
Running tshark is in `shark`, reading its answer in `fields`.
"""

from __future__ import annotations

import tempfile
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

from ds47 import spec
from ds47.acyclic.transactions import summarise
from ds47.analysis import AnalysisOptions, OnTransaction, rules_of_others
from ds47.analysis import analyze as analyze_natively
from ds47.capture import Capture, CaptureError, Frame, sha256
from ds47.capture.stream import Stream
from ds47.capture.writer import PcapngWriter, nearest
from ds47.findings.collection import Findings
from ds47.findings.times import FrameTimes
from ds47.model import SIEMENS, CaptureResult, Finding, Read, Transaction
from ds47.parameters import table
from ds47.profibus.bus import LINK_TYPES, PROFIBUS_DL, proves
from ds47.profibus.telegram import decode
from ds47.regression.compare import Change, compare
from ds47.regression.config import Config
from ds47.report import json as report
from ds47.report import load
from ds47.report.sentences import renumbered
from ds47.s7.choices import PORT, Choices
from ds47.spec.semantics import limits
from ds47.wireshark import tshark
from ds47.wireshark.fields import Fields

DIFFERS = "DS601"
_OF_A_LOSS = frozenset(("DS401", "DS402", "DS403"))
"""Rules about a frame that is not there: they tell whether the capture says that it dropped frames."""
_OF_FRAMES = frozenset(("DS801", "DS802"))
"""Rules about frames of PROFIBUS that are damaged, each of which may be all that there is."""
_MOST_MS = 2**32 - 1
_YEARS_MS = 2**53 / 1e6
"""Durations from which on tshark shows too few digits."""
_HOME_NS = 2**60
"""Where the first frame goes of a capture whose own times it cannot hold: 2006."""

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
    ) -> CaptureResult:
        """Analyses one capture; arguments and result are those of `ds47.analysis.analyze`.

        `on_transaction` is called at the end of the capture: tshark needs two passes.

        Raises:
            ds47.capture.CaptureError: nothing of the source can be read, or tshark gave up.
        """
        with tempfile.TemporaryDirectory(prefix="ds47-") as folder:
            extract = Path(folder, "frames.pcapng")
            capture = _Extract(source, extract)
            with capture:
                native = analyze_natively(capture, self._options)
            try:
                found, errors = self._ask(capture, extract, native)
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
        return result if on_transaction is None else _handed_out(result, on_transaction)

    def _ask(
        self, capture: _Extract, extract: Path, native: CaptureResult
    ) -> tuple[CaptureResult, list[str]]:
        """The result of the plugin, with the frame numbers of the capture itself."""
        whole = [each for each in native.findings if not capture.shows(each)]
        result = replace(native, transactions=[], findings=whole, summary={"transactions": 0})
        if not capture.numbers:
            return result, []
        chosen = list(self._preferences)
        if self._options.lists:
            lists = extract.with_name("parameters.tsv")
            lists.write_text(table.text(self._options.lists), "utf-8", newline="\n")
            chosen.append(f"ds47.lists:{lists}")
        answer = tshark.ask(self._tshark, extract, chosen)
        original = _Original(capture, native)
        shown = _of_channels(answer.fields, self._options.channels)
        findings = [original.finding(each) for each in shown.findings]
        findings = [each for each in findings if self._findings.wanted(each.rule)]
        result.findings = sorted(findings + whole, key=_place)
        summary, about = {"transactions": 0}, _by_transaction(whole)
        for item in shown.transactions:
            transaction = original.transaction(item)
            known = filter(self._findings.wanted, transaction.findings)
            transaction.findings = sorted({*known, *about.get(transaction.id, ())})
            summarise(summary, transaction.state, transaction.operation)
            result.transactions.append(transaction)
        # Equal results are equal texts: the native one counts in the order in which they end.
        result.summary = {key: summary[key] for key in native.summary if key in summary} | summary
        return result, answer.errors

    def _compared(
        self, native: CaptureResult, found: CaptureResult | None, errors: Sequence[str]
    ) -> CaptureResult:
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
        native.findings = sorted(native.findings + findings, key=_place)
        return native

    def _difference(self, text: str, frame: int) -> Finding:
        return Finding(DIFFERS, spec.rules()[DIFFERS].severity, frame, args={"difference": text})


def _of_channels(told: Fields, channels: Sequence[str]) -> Fields:
    """The transactions of some channels, counted anew, and the findings that are about no others."""
    wanted = [each for each in told.transactions if each["channel"] in channels]
    numbers: dict[int | None, int | None] = {None: None}
    numbers |= {each["id"]: number for number, each in enumerate(wanted, 1)}
    return Fields(
        [each | {"id": numbers[each["id"]]} for each in wanted],
        [
            each | {"transaction": numbers[each["transaction"]]}
            for each in told.findings
            if each["transaction"] in numbers
        ],
    )


def _by_transaction(findings: Sequence[Finding]) -> dict[int | None, set[str]]:
    """The rules of findings by their transaction."""
    found: dict[int | None, set[str]] = {}
    for each in findings:
        found.setdefault(each.transaction, set()).add(each.rule)
    return found


def _place(finding: Finding) -> tuple[int, str, int, int]:
    return finding.frame, finding.rule, finding.transaction or 0, finding.offset or 0


def differences(native: CaptureResult, found: CaptureResult, lang: str = "en") -> list[Change]:
    """What differs between two results of one capture, in words of `lang`: was native, is tshark.

    Events of drives are no difference: what they lead to is compared, the findings.
    """
    native, found = replace(native, timelines=[]), replace(found, timelines=[])
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

    Raises:
        ds47.wireshark.tshark.NotReadyError: the plugin takes whole milliseconds.
    """
    slow_ms = limits().slow_ns / 1e6 if options.slow_ms is None else options.slow_ms
    if not 0 <= slow_ms <= _MOST_MS or slow_ms != int(slow_ms):
        raise tshark.NotReadyError(f"the engine tshark takes whole ms for --slow, not {slow_ms:g}")
    codec = options.codec
    # Wireshark 3.4 takes no empty value. Empty is what a preference is where nobody has set it.
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
        *_of_s7(options.s7),
        "ds47.every_cyclic:TRUE",  # those that the analyzer looked at are given, and no others
        "ds47.profibus_user0:TRUE",  # the analyzer looks at USER0, too
        "ds47.index_47:auto",
        "ds47.language:en",
        f"ds47.slow_ms:{int(slow_ms)}",
        f"ds47.legacy_g120_formats:{str(codec.legacy_g120_formats).upper()}",
        f"ds47.assume_sinamics:{str(options.vendor_id == SIEMENS).upper()}",
        f"ds47.profile_v3_types:{str(codec.profile_v3_types).upper()}",
    ]


def _of_s7(choices: Choices) -> Iterator[str]:
    """The choices for S7 as preferences; of several for one server the last one counts."""
    ports = " ".join(map(str, sorted({*choices.ports} - {PORT})))
    cpus, blocks = _by_address(choices.cpus), _by_address(choices.blocks)
    for name, text in (("ports", ports), ("cpus", cpus), ("blocks", blocks)):
        if text:
            yield f"ds47.s7_{name}:{text}"
    yield f"ds47.s7_readback:{str(choices.readback).upper()}"


def _by_address(pairs: Sequence[tuple[str, object]]) -> str:
    """`10.0.0.2=s7-400` of one server, `s7-400` of all others."""
    return " ".join(f"{ip}={each}" if ip else str(each) for ip, each in dict(pairs).items())


class _Extract(Capture):
    """A capture that keeps, while it is read, the frames that may matter in a file of their own.

    Attributes:
        numbers: `numbers[n - 1]` is the number in the capture of frame n of that file.
        times: when the frames of the capture were.
        shift: nanoseconds by which all times are later in that file: it holds none before 1970.
        misfit: the first frame whose time it cannot hold even so; None where all times are right.
        unproven: the first frame of PROFIBUS_DL before one that proves that it is PROFIBUS; 0 where there is none.
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
        self.unproven = 0
        self._proven = False
        self._writer = PcapngWriter(path, link_type=None)
        self._interfaces: dict[int, int] = {}

    def __iter__(self) -> Iterator[Frame]:
        for frame in super().__iter__():
            self._keep(frame)
            yield frame

    def shows(self, finding: Finding) -> bool:
        """Whether Wireshark finds it when it looks at a frame: the others are the analyzer's.

        It does not know link types by their number, and shows no frame of PROFIBUS where none proves to be one.
        """
        blind = self.unproven > 0 and finding.rule in _OF_FRAMES
        return spec.rules()[finding.rule].in_wireshark and not blind

    def _prove(self, frame: Frame) -> None:
        self._proven = proves(decode(bytes(frame.data)))
        if self._proven:
            self.unproven = 0
        elif frame.link_type == PROFIBUS_DL:
            self.unproven = self.unproven or frame.number

    def _keep(self, frame: Frame) -> None:
        if not self._proven and frame.link_type in LINK_TYPES:
            self._prove(frame)
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
            self.times.note(frame.number, frame.time_ns)

    def close(self) -> None:
        """Close both files."""
        super().close()
        self._writer.close()


class _Original:
    """Puts what the plugin cannot know into what it says: numbers and times, and that frames are lost."""

    def __init__(self, capture: _Extract, native: CaptureResult) -> None:
        self._numbers = capture.numbers
        self._shift = capture.shift
        self._times = capture.times
        self._dropped = bool(native.dropped)
        self._vendors = {each.ip: each.vendor for each in native.devices}

    def transaction(self, item: Json) -> Transaction:
        """The transaction, with the frame numbers and the time of the capture."""
        transaction = load.transaction(item, self._vendors.get(item["device"]))
        transaction.start_ns -= self._shift
        frames = transaction.frames
        for name in ("write_request", "write_response", "read_request", "read_response"):
            setattr(frames, name, self._number(getattr(frames, name)))
        frames.polls = [Read(self._number(a), self._number(b)) for a, b in frames.polls]
        frames.rereads = [Read(self._number(a), self._number(b)) for a, b in frames.rereads]
        for each in transaction.parameters:
            if each.described is not None:
                told = tuple(self._numbers[frame - 1] for frame in each.described.frames)
                each.described = each.described._replace(frames=told)
        transaction.segments = [
            Read(self._number(a), self._number(b)) for a, b in transaction.segments
        ]
        return transaction

    def finding(self, item: Json) -> Finding:
        """The finding, with the frame numbers of the capture, also among its arguments."""
        finding = load.finding(item)
        finding.frame = self._numbers[finding.frame - 1]
        finding.time_ns = self._times.of(finding.frame)
        finding.frames = [self._numbers[frame - 1] for frame in finding.frames]
        args = spec.rules()[finding.rule].carried(finding.args)
        finding.args = renumbered(finding.rule, args, lambda n: self._numbers[n - 1])
        if finding.rule in _OF_A_LOSS:
            last = finding.args.get("reason") in (None, "end")
            finding.args["dropped"] = self._dropped and last
        return finding

    def _number(self, frame: int | None) -> int | None:
        return None if frame is None else self._numbers[frame - 1]


def _frame(change: Change, native: CaptureResult, found: CaptureResult) -> int | None:
    """A frame in which a difference shows."""
    if change.stored is not None:
        return native.transactions[change.stored].frames.first()
    if change.now is not None:
        return found.transactions[change.now].frames.first()
    about = change.is_now or change.was
    return about.get("frame") if isinstance(about, dict) else None


def _handed_out(result: CaptureResult, on_transaction: OnTransaction) -> CaptureResult:
    """Gives the transactions away in the order in which they ended, as an analysis does."""
    about: dict[int | None, list[Finding]] = {}
    for finding in result.findings:
        about.setdefault(finding.transaction, []).append(finding)
    for transaction in sorted(result.transactions, key=lambda t: max(t.frames.all(), default=0)):
        on_transaction(transaction, about.pop(transaction.id, []))
    rest = [finding for findings in about.values() for finding in findings]
    return replace(result, transactions=[], findings=rest)
