"""The frames of transactions, findings, devices or a time span as a capture of their own.

    analysis -> what is wanted (`selection`) -> all frames of it (`tracking`) -> a second reading that copies

With `Replacements` the frames are rewritten on the way, to hide their origin: `anonymise`.
Nothing is printed here.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO
from uuid import UUID

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Interface, PcapngWriter, WholeFrame
from ds47.capture.drafts import draft_of
from ds47.capture.pcapng import OURS
from ds47.capture.scan import ETHERNET, IPV4, network_layer
from ds47.capture.writer import nearest
from ds47.model import PKW, S7, CaptureResult
from ds47.profibus import LINK_TYPES
from ds47.profinet import dcp, lldp, rpc
from ds47.profinet.link import mac
from ds47.profinet.records import NIL_UUID, parse_request, parse_response
from ds47.report.file_frames import FileFrames
from ds47.report.filters import display_filter
from ds47.s7.choices import PORT
from ds47.spec import layouts
from ds47.version import __version__

from .anonymise import Anonymiser, Knowledge
from .bus import BusFrames
from .drafts import Draft, Drafts
from .earlier import OF_THE_ORIGINAL, is_earlier_export
from .examples import MOST, Example, examples
from .mapping import KeyFileError, Replacements
from .original import Original, first_time, opened, whole_frames
from .s7 import S7Frames
from .selection import Chosen, Selection, SelectionError, choose, refuse_others
from .tracking import Copy, TrackedMessage, Tracker

__all__ = [
    "LINK",
    "MOST",
    "Example",
    "ExportOutcome",
    "KeyFileError",
    "Replacements",
    "Selection",
    "SelectionError",
    "display_filter",
    "examples",
    "export",
    "export_examples",
    "first_time",
    "is_earlier_export",
    "is_link_to_file",
]

_OPERATIONS = {
    layouts.RPC_CONNECT: "Connect",
    layouts.RPC_RELEASE: "Release",
    layouts.RPC_READ: "Read",
    layouts.RPC_WRITE: "Write",
    layouts.RPC_CONTROL: "Control",
    layouts.RPC_READ_IMPLICIT: "ReadImplicit",
}
_MISPLACED = "DS707"
"""The rule of requests that were written to another record."""


@dataclass(slots=True)
class ExportOutcome:
    """What became of one capture.

    Attributes:
        result: of the analysis.
        frames: numbers of the exported frames in the original, sorted.
        transactions: of how many chosen transactions a frame is exported.
        left_out: wanted frames that are not exported because their content is unknown.
        leaks: frame and text of what was left out because an original still stood in it.
    """

    result: CaptureResult
    frames: list[int] = field(default_factory=list)
    transactions: int = 0
    left_out: list[int] = field(default_factory=list)
    leaks: list[tuple[int, str]] = field(default_factory=list)


def export(
    source: Original,
    target: str | Path | BinaryIO,
    selection: Selection,
    options: AnalysisOptions | None = None,
    key: Replacements | None = None,
    everything: bool = False,
    bus_link: int | None = None,
) -> ExportOutcome:
    """Exports the frames of one capture.

    Args:
        source: path of the capture, or the files of a series; it is read several times.
        target: a path, where a file appears whole or not at all, and only when there is a frame; or a
            binary stream.
        selection: what is wanted.
        options: of the analysis.
        key: anonymises with this key, and learns new originals.
        everything: with a key, replaces all values of parameters too.
        bus_link: link type that frames of PROFIBUS get; None leaves them theirs.

    Raises:
        ds47.capture.CaptureError: nothing can be read.
        SelectionError: something is asked for that this capture does not have, or frames of PROFIBUS, S7 or
            cyclic channels are to be anonymised.
        OSError: the target cannot be written; a link to a file is not followed.
        ValueError: frames of other protocols are wanted, and anonymised.
    """
    if key is not None and selection.all_frames:
        raise ValueError("frames of other protocols cannot be anonymised")
    options = options or AnalysisOptions()
    with opened(source) as capture:
        result = analyze(capture, options)
    names = None if key is None else {rule.id: rule.name for rule in spec.rules().values()}
    chosen = choose(result, selection, names)
    if key is not None:
        refuse_others(result, chosen, by_frame=selection.by_frame)
    return _copied(source, target, result, chosen, selection, options, key, everything, bus_link)


def export_examples(
    source: Original,
    target: Callable[[Example], str],
    rules: tuple[str, ...] = (),
    options: AnalysisOptions | None = None,
    bus_link: int | None = None,
) -> Iterator[tuple[Example, ExportOutcome]]:
    """Exports one example of each root cause of a capture, each as a capture of its own.

    Args:
        source: path of the capture, or the files of a series; it is read twice for each example.
        target: the path of an example, where a file appears whole or not at all.
        rules: how the ids of the wanted rules begin; none for all.
        options: of the analysis.
        bus_link: link type that frames of PROFIBUS get; None leaves them theirs.

    Raises:
        ds47.capture.CaptureError: nothing can be read.
        OSError: a target cannot be written; a link to a file is not followed.
    """
    options = options or AnalysisOptions()
    with opened(source) as capture:
        result = analyze(capture, options)
    selection = Selection(rules=("DS",))
    for each in examples(result, rules)[:MOST]:
        yield (
            each,
            _copied(
                source, target(each), result, each.chosen, selection, options, None, False,
                bus_link, each.chosen.frames,
            ),
        )  # fmt: skip


def _copied(
    source: Original,
    target: str | Path | BinaryIO,
    result: CaptureResult,
    chosen: Chosen,
    selection: Selection,
    options: AnalysisOptions,
    key: Replacements | None,
    everything: bool,
    bus_link: int | None,
    also: Iterable[int] = (),
) -> ExportOutcome:
    """Writes what is chosen; `also` are frames that are copied whatever is in them, without a key."""
    outcome = ExportOutcome(result)
    s7_ports = _ports(options) if key is None else ()  # nothing in these is replaced, either
    wanted = _Survey(selection, chosen, s7_ports).run(source)
    if key is None:
        wanted |= _cyclic(chosen) | set(also)  # nothing in these is replaced
        frames: Iterable[WholeFrame] = _plain(source, wanted, selection, chosen)
        frames = frames if bus_link is None else _relinked(frames, bus_link)
    else:
        anonymiser = Anonymiser(key, _knowledge(result, options, everything))
        key.learning = True
        for _ in _Rewriting(anonymiser, ExportOutcome(result)).frames(source, wanted):
            pass
        key.learning = False
        frames = _Rewriting(anonymiser, outcome).frames(source, wanted)
    _write(frames, target, chosen, outcome, plain=key is None)
    written = set(outcome.frames)
    outcome.transactions = sum(
        not written.isdisjoint(each.frames.all()) for each in chosen.transactions
    )
    return outcome


# Which frames


def _cyclic(chosen: Chosen) -> set[int]:
    """Frames of transactions that are in cyclic frames: these are whole messages by themselves."""
    cyclic = (each for each in chosen.transactions if each.channel == PKW)
    return {frame for each in cyclic for frame in each.frames.all()}


def _ports(options: AnalysisOptions) -> tuple[int, ...]:
    """Ports of S7 that are looked at."""
    return (PORT, *options.s7.ports) if S7 in options.channels else ()


class _Survey:
    """Finds all frames of the wanted messages, and a word for those that have none yet."""

    def __init__(self, selection: Selection, chosen: Chosen, s7_ports: Sequence[int]) -> None:
        self._selection = selection
        self._chosen = chosen
        self._ports = s7_ports
        self._wanted: set[int] = set()

    def run(self, original: Original) -> set[int]:
        """Numbers of the wanted frames."""
        tracker, bus = Tracker(), BusFrames(self._selection, self._chosen)
        s7 = S7Frames(self._ports, self._selection, self._chosen)
        with opened(original) as capture:
            capture.tcp(self._ports)
            for frame in capture:
                if bus.wants(frame):
                    self._wanted.add(frame.number)
                s7.feed(frame)
                found = tracker.feed(frame)
                if isinstance(found, TrackedMessage):
                    self._message(found)
                elif found is not None:
                    self._copy(found)
                self._lost(tracker)
        tracker.finish()
        self._lost(tracker)
        s7.finish()
        return self._wanted | s7.wanted

    def _message(self, message: TrackedMessage) -> None:
        if not self._is_wanted(message):
            return
        frames, notes = message.frames, self._chosen.notes
        self._wanted.update(frames)
        if message.frame not in notes:
            notes[message.frame] = [_description(message)]
        if len(frames) > 1:
            of = f"of {len(frames)} frames that are one message"
            for number, frame in enumerate(frames, 1):
                notes.setdefault(frame, []).append(f"{number}. {of}")

    def _copy(self, copy: Copy) -> None:
        if self._selection.by_frame and copy.message.frame in self._wanted:
            for frame in copy.trace.frames:
                self._wanted.add(frame)
                self._chosen.notes.setdefault(frame, []).append("a copy")

    def _lost(self, tracker: Tracker) -> None:
        for traces in tracker.lost:
            numbers = {frame for trace in traces for frame in trace.frames}
            if self._selection.by_frame:
                in_time = self._selection.in_time(traces[0].pieces[0].time_ns)
                chosen = in_time and not self._chosen.ips
            else:
                chosen = not numbers.isdisjoint(self._chosen.frames)
            if chosen:
                self._wanted |= numbers
                for number in numbers:
                    text = "fragment of a message that never became whole"
                    self._chosen.notes.setdefault(number, []).append(text)
        tracker.lost.clear()

    def _is_wanted(self, message: TrackedMessage) -> bool:
        if not self._selection.by_frame:
            return message.frame in self._chosen.frames
        if message.kind == "foreign" or not self._selection.in_time(message.time_ns):
            return False
        return not self._chosen.ips or self._of_device(message)

    def _of_device(self, message: TrackedMessage) -> bool:
        chosen, packet = self._chosen, message.packet
        assert packet is not None
        if message.kind == "rpc":
            return not chosen.ips.isdisjoint((packet.src_ip, packet.dst_ip))
        if packet.dst_mac is None:  # a cooked header does not say to whom
            return False
        station = dcp.parse(packet) if message.kind == "dcp" else lldp.parse(packet)
        stated = (station.ip, station.mac) if station else ()
        return not (chosen.ips | chosen.macs).isdisjoint((packet.src_mac, packet.dst_mac, *stated))


def _description(message: TrackedMessage) -> str:
    """What a frame is that belongs to no transaction."""
    pdu = message.pdu
    if message.kind != "rpc":
        return message.kind.upper()
    if pdu is None:
        return "PROFINET RPC, cut by the capture"
    kind = rpc.PTYPES[pdu.ptype]
    operation = _OPERATIONS.get(pdu.opnum, f"operation {pdu.opnum}")
    index = ""
    if pdu.opnum in (layouts.RPC_READ, layouts.RPC_WRITE, layouts.RPC_READ_IMPLICIT):
        records = parse_request(pdu)[0] if pdu.ptype == 0 else []
        if pdu.ptype == 2:
            records = parse_response(pdu)[1]
        if records:
            index = f", index 0x{records[0].index:04X}"
    return f"PROFINET RPC {operation} {kind}{index}"


def _knowledge(result: CaptureResult, options: AnalysisOptions, everything: bool) -> Knowledge:
    about = Knowledge(codec=options.codec, everything=everything)
    about.misplaced = {
        (each.frame, each.args["index"]) for each in result.findings if each.rule == _MISPLACED
    }
    controllers = {each.controller for each in result.transactions}
    for each in result.transactions:
        if each.index is None:
            continue
        ar = NIL_UUID if each.ar is None else UUID(each.ar).bytes
        about.ours.add((each.controller, each.device, ar, each.index))
        if each.frames.rereads:  # a Read without an AR may be one of them, from any station
            about.ours.update((one, each.device, NIL_UUID, each.index) for one in controllers)
        if each.request is None:
            continue
        for _, response in [(None, each.frames.read_response), *each.frames.rereads]:
            if response is not None:
                about.asked[response] = each.request
    return about


# The second reading


def _plain(
    original: Original, wanted: set[int], selection: Selection, chosen: Chosen
) -> Iterator[WholeFrame]:
    """The frames as they are."""
    every = selection.all_frames and selection.by_frame
    for frame in whole_frames(original, lambda number: every or number in wanted):
        if frame.number in wanted or (selection.in_time(frame.time_ns) and _touches(frame, chosen)):
            yield frame


def _relinked(frames: Iterable[WholeFrame], link_type: int) -> Iterator[WholeFrame]:
    """The same with another link type for those of PROFIBUS."""
    interfaces: dict[Interface, Interface] = {}
    for frame in frames:
        about = frame.interface
        if about.link_type in LINK_TYPES:
            if about not in interfaces:
                interfaces[about] = Interface(link_type, about.snap_length, about.options)
            frame.interface = interfaces[about]
        yield frame


def _touches(frame: WholeFrame, chosen: Chosen) -> bool:
    """Whether a frame of any protocol comes from a wanted device, or goes to one."""
    if not chosen.ips:
        return True
    data, link = frame.data, frame.link_type
    if link == ETHERNET and not chosen.macs.isdisjoint((mac(data[:6]), mac(data[6:12]))):
        return True
    kind, at = network_layer(data, 0, len(data), link)
    if kind != IPV4 or len(data) < at + 20:
        return False
    hosts = (".".join(map(str, data[at + k : at + k + 4])) for k in (12, 16))
    return not chosen.ips.isdisjoint(hosts)


class _Rewriting:
    """The frames without names, in their order."""

    def __init__(self, anonymiser: Anonymiser, outcome: ExportOutcome) -> None:
        self._anonymiser = anonymiser
        self._outcome = outcome

    def frames(self, original: Original, wanted: set[int]) -> Iterator[WholeFrame]:
        """Every frame that could be rewritten."""
        tracker, drafts, anonymiser = Tracker(), Drafts(), self._anonymiser
        for frame in whole_frames(original, wanted.__contains__):
            drafts.add(frame)
            found = tracker.feed(frame)
            if isinstance(found, TrackedMessage):
                drafts.finish(found.frames, anonymiser.message(found, drafts))
            elif found is not None:
                drafts.finish(found.trace.frames, anonymiser.copy(found, drafts))
            yield from self._ready(tracker, drafts)
        tracker.finish()
        yield from self._ready(tracker, drafts)

    def _ready(self, tracker: Tracker, drafts: Drafts) -> Iterator[WholeFrame]:
        for traces in tracker.lost:
            for trace in traces:
                drafts.finish(trace.frames, False)
        tracker.lost.clear()
        for draft in drafts.ready():
            leak = self._leak(draft)
            if leak is not None:
                self._outcome.leaks.append((draft.frame.number, leak))
            elif draft.kept:
                draft.frame.data, draft.frame.comments = bytes(draft.data), []
                yield draft.frame
            else:
                self._outcome.left_out.append(draft.frame.number)

    def _leak(self, draft: Draft) -> str | None:
        learning = self._anonymiser.key.learning
        return self._anonymiser.leaks(draft) if draft.kept and not learning else None


# Writing

LINK = "it is a link to {target}, and links are not followed: name the file itself"


def is_link_to_file(path: Path) -> bool:
    """Whether writing to a path would write somewhere else. A link to a device or a pipe is none."""
    return path.is_symlink() and (path.is_file() or not path.exists())


def _write(
    frames: Iterable[WholeFrame],
    target: str | Path | BinaryIO,
    chosen: Chosen,
    outcome: ExportOutcome,
    plain: bool,
) -> None:
    if not isinstance(target, str | Path):
        _write_all(frames, target, chosen, outcome, plain)
        return
    path = Path(target)
    if is_link_to_file(path):
        raise OSError(errno.EEXIST, LINK.format(target=path.resolve()), str(path))
    special = path.exists() and not path.is_file()
    draft = path if special else draft_of(path)
    try:
        with draft.open("wb") as stream:
            _write_all(frames, stream, chosen, outcome, plain)
        if outcome.frames and not special:
            draft.replace(path)
    finally:
        if not special:
            draft.unlink(missing_ok=True)


def _write_all(
    frames: Iterable[WholeFrame], stream: BinaryIO, chosen: Chosen, done: ExportOutcome, plain: bool
) -> None:
    interfaces: dict[Interface, int] = {}
    # file names show where a capture was taken: not in a copy without names
    file_frames = FileFrames(done.result.files if plain else ())
    with PcapngWriter(stream, link_type=None, application=OURS + __version__) as writer:
        for frame in frames:
            about = frame.interface
            if about not in interfaces:
                options = about.options if plain else ()
                interfaces[about] = writer.add_interface(
                    about.link_type, about.snap_length, options
                )
            lines = [
                *chosen.notes.get(frame.number, ()),
                file_frames.words(frame.number) + OF_THE_ORIGINAL,
            ]
            writer.write(
                nearest(frame.time_ns),
                frame.data,
                frame.original_length,
                interface=interfaces[about],
                comments=(*frame.comments, "\n".join(lines)),
                flags=frame.flags,
            )
            done.frames.append(frame.number)
