"""The engine tshark: the same result as the native one, and a finding where it is not the same."""

from __future__ import annotations

import json
import os
import re
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import test_profibus_bus
import troubles
from fake_tshark import real_tshark
from report_formats import STREAMED

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import CaptureError, open_capture
from ds47.capture.scan import ETHERNET, SLL, SLL2
from ds47.capture.writer import PcapngWriter
from ds47.cyclic import channels as cyclic_channels
from ds47.cyclic.named import parse
from ds47.findings.times import FrameTimes
from ds47.model import CHANNELS, CaptureResult, Event, Finding, Transaction
from ds47.parameters.lists import ListedParameter, ParameterList
from ds47.profibus import PROFIBUS_DL, USER0
from ds47.profidrive import Options
from ds47.report import contract, load
from ds47.report import json as report
from ds47.report.bilingual import LANGUAGES
from ds47.report.contract import FINDING, TRANSACTION
from ds47.report.sentences import error_words, sentence
from ds47.spec import units
from ds47.spec.semantics import limits, reasons
from ds47.wireshark import engine, tshark
from ds47.wireshark.engine import Engine
from ds47.wireshark.fields import Fields
from ds47.wireshark.tshark import Answer, NotReadyError

ROOT = Path(__file__).resolve().parents[2]
CAPTURES = ROOT / "captures"
SOME = [
    "tour-machine", "seed-g120-change", "format-mixed", "format-description",
    "message-error-words", "message-left-over", "message-value-count", "message-vendor",
    "conversation-orphan", "conversation-partial-change", "conversation-read-back",
    "conversation-released", "conversation-superseded-read", "transport-time-back",
    "conversation-wrong-reference", "record-implicit", "record-multiple-refused",
    "record-nothing-to-read", "record-polls-many", "record-reread", "record-write-refused-open",
    "transport-copies", "transport-fault", "transport-ip-fragments-disorder",
    "transport-little-big", "transport-retransmission", "transport-rpc-fragments",
    "transport-sll", "transport-sll2", "transport-snap-length", "transport-vlan", "naming-all",
]  # fmt: skip
NOISE = 60_000


@pytest.fixture(scope="module")
def program() -> str:
    pytest.importorskip("pyshark") if os.environ.get("DS47_CI") != "1" else __import__("pyshark")
    return real_tshark()


@pytest.fixture(scope="module")
def ready(program: str) -> Callable[..., Engine]:
    """Makes an engine with any options; tshark is tried once."""
    prepared = tshark.prepare(program)

    def make(
        name: Any = "both", options: AnalysisOptions | None = None, lang: str = "en"
    ) -> Engine:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(tshark, "prepare", lambda _program: prepared)
            return Engine(name, options or AnalysisOptions(), lang=lang)

    return make


def endures(program: str, path: Path) -> None:
    """Skips where tshark dies of a capture without any plugin: some 4.6 do of cooked frames."""
    command = [program, "-n", "-r", str(path)]
    if subprocess.run(command, capture_output=True, check=False).returncode not in (0, 1, 2):
        pytest.skip("this tshark dies of this capture, without the plugin too")


def as_json(result: CaptureResult) -> str:
    return json.dumps(report.capture(result), indent=1, ensure_ascii=False)


# -- the same result --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", SOME)
def test_both_engines_say_the_same(ready: Callable[..., Engine], program: str, name: str) -> None:
    path = CAPTURES / f"{name}.pcapng"
    if "sll" in name:
        endures(program, path)
    assert as_json(ready("tshark").analyze(path)) == as_json(analyze(path))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        AnalysisOptions(slow_ms=1),
        AnalysisOptions(select=("DS4",)),
        AnalysisOptions(ignore=("DS4",)),
        AnalysisOptions(indices=frozenset((0xAFF0, 47)), codec=Options(legacy_g120_formats=True)),
        AnalysisOptions(codec=Options(profile_v3_types=True)),
        AnalysisOptions(digest=True),
    ],
    ids=lambda options: str(options)[16:60],
)
def test_the_options_are_those_of_the_plugin(
    ready: Callable[..., Engine], options: AnalysisOptions
) -> None:
    """Whichever engine has them: both would tell of a difference."""
    for which, name in (("tshark", "tour-machine"), ("both", "conversation-superseded-read")):
        path = CAPTURES / f"{name}.pcapng"
        assert as_json(ready(which, options).analyze(path)) == as_json(analyze(path, options))


@pytest.mark.slow
def test_transactions_one_by_one(ready: Callable[..., Engine]) -> None:
    path = CAPTURES / "tour-machine.pcapng"
    handed: list[tuple[Transaction, list[Finding]]] = []
    result = ready("tshark").analyze(path, lambda *item: handed.append((item[0], list(item[1]))))
    whole = analyze(path)
    assert result.transactions == []
    assert result.summary == whole.summary
    assert sorted(t.id for t, _ in handed) == [t.id for t in whole.transactions]
    ends = [t.frames.all()[-1] for t, _ in handed]
    assert ends == sorted(ends)
    for transaction, findings in handed:
        assert sorted({f.rule for f in findings}) == transaction.findings


def test_a_capture_without_a_frame_of_ours(ready: Callable[..., Engine], tmp_path: Path) -> None:
    path = tmp_path / "noise.pcapng"
    with PcapngWriter(path) as writer:
        for number in range(5):
            writer.write(number, cyclic(number))
    assert as_json(ready().analyze(path)) == as_json(analyze(path))
    assert ready("tshark").analyze(path).frames == 5


# -- what goes through tshark -----------------------------------------------------------------------


def cyclic(number: int) -> bytes:
    """A frame of cyclic data: none of our business."""
    return (
        bytes.fromhex("001c06000001001ff8000001") + b"\x88\x92\xc0\x00" + bytes([number & 255] * 44)
    )


def buried(path: Path) -> dict[int, int]:
    """The tour among cyclic frames, every link type it can have; its frame numbers, old to new."""
    places, number = {}, 0
    with PcapngWriter(path) as writer, open_capture(CAPTURES / "tour-machine.pcapng") as capture:
        for frame in capture:
            for _ in range(NOISE // 35):
                number += 1
                writer.write(frame.time_ns, cyclic(number))
            number += 1
            places[frame.number] = number
            writer.write(frame.time_ns, bytes(frame.data), frame.original_length)
    return places


@pytest.mark.slow
def test_only_frames_that_matter_go_through_tshark(
    ready: Callable[..., Engine], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "huge.pcapng"
    places = buried(path)
    given: list[int] = []
    ask = tshark.ask

    def watched(tshark: Any, capture: Path, preferences: Any) -> Answer:
        with open_capture(capture) as extract:
            given.append(sum(1 for _ in extract))
            assert extract.frames == given[-1]
        return ask(tshark, capture, preferences)

    monkeypatch.setattr(tshark, "ask", watched)
    result = ready("tshark").analyze(path)
    assert given == [len(places)]
    assert result.frames > NOISE * 0.9
    assert as_json(result) == as_json(analyze(path))
    before = analyze(CAPTURES / "tour-machine.pcapng")
    for then, now in zip(before.transactions, result.transactions, strict=True):
        assert now.frames.all() == [places[number] for number in then.frames.all()]
    assert [f.frame for f in result.findings] == [places[f.frame] for f in before.findings]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    ["conversation-superseded-read", "conversation-superseded-change", "transport-retransmission"],
)
def test_frame_numbers_in_messages_are_those_of_the_capture(
    ready: Callable[..., Engine], tmp_path: Path, name: str
) -> None:
    path = tmp_path / "later.pcapng"
    with PcapngWriter(path) as writer, open_capture(CAPTURES / f"{name}.pcapng") as capture:
        for frame in capture:
            for _ in range(3):
                writer.write(frame.time_ns, cyclic(1))
            writer.write(frame.time_ns, bytes(frame.data), frame.original_length)
    assert as_json(ready("tshark").analyze(path)) == as_json(analyze(path))


def test_every_frame_number_in_a_message_is_known() -> None:
    """A frame that is called something else than a frame would keep the number of the extract."""
    for rule in spec.rules().values():
        named = set(re.findall(r"frame \{(\w+)\}", rule.message))
        named |= set(re.findall(r"第 \{(\w+)\} 帧", rule.message_zh))
        assert named <= set(rule.frames), rule.id


def test_link_types_and_times_are_kept(
    ready: Callable[..., Engine], program: str, tmp_path: Path
) -> None:
    """One capture with three link types, times to the nanosecond."""
    endures(program, CAPTURES / "transport-sll2.pcapng")
    path = tmp_path / "two.pcapng"
    with PcapngWriter(path, link_type=None) as writer:
        for interface, name in enumerate(
            ("transport-sll", "transport-sll2", "transport-little-endian")
        ):
            with open_capture(CAPTURES / f"{name}.pcapng") as capture:
                for frame in capture:
                    if frame.number == 1:
                        writer.add_interface(frame.link_type)
                    late = frame.time_ns + interface * 10**9 + 123_456_789
                    writer.write(late, bytes(frame.data), interface=interface)
    native = analyze(path)
    assert {frame.link_type for frame in open_capture(path)} == {SLL, SLL2, ETHERNET}
    assert all(t.start_ns % 10**9 for t in native.transactions)
    assert as_json(ready("tshark").analyze(path)) == as_json(native)


def at_times(path: Path, times: Callable[[int], int]) -> Path:
    """A capture with the frames of another and their times in nanoseconds changed."""

    def block(kind: int, body: bytes) -> bytes:
        size = struct.pack("<I", len(body) + 12)
        return struct.pack("<I", kind) + size + body + size

    offset = struct.pack("<HHq", 14, 8, -(2**33))  # if_tsoffset: seconds
    options = struct.pack("<HHB3x", 9, 1, 9) + offset + bytes(4)
    data = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    data += block(1, struct.pack("<HHI", 1, 0, 0) + options)
    with open_capture(CAPTURES / "tour-machine.pcapng") as capture:
        for frame in capture:
            stamp = times(frame.time_ns) + 2**33 * 10**9
            head = struct.pack("<5I", 0, stamp >> 32, stamp & 0xFFFFFFFF, *[len(frame.data)] * 2)
            data += block(6, head + bytes(frame.data) + bytes(-len(frame.data) % 4))
    path.write_bytes(data)
    return path


@pytest.mark.slow
def test_times_before_1970(ready: Callable[..., Engine], tmp_path: Path) -> None:
    path = at_times(tmp_path / "1930.pcapng", lambda ns: ns - 3 * 10**18)
    native = analyze(path)
    assert native.transactions[0].start_ns < 0
    for name in ("tshark", "both"):
        assert as_json(ready(name).analyze(path)) == as_json(native)


@pytest.mark.slow
def test_a_clock_that_is_set_by_decades(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """More than a double holds in nanoseconds, forth and back, between transactions and within one."""
    path = tmp_path / "decades.pcapng"
    path.write_bytes(troubles.clock_set_by_decades())
    assert as_json(ready().analyze(path)) == as_json(analyze(path))
    frames = count()
    back = troubles.DECADES // 2 + 1
    moved = at_times(tmp_path / "often.pcapng", lambda ns: ns - back * (next(frames) // 3 % 2))
    native = analyze(moved)
    assert min(each.duration_ns or 0 for each in native.transactions) < -(2**53)
    assert as_json(ready().analyze(moved)) == as_json(native)  # not one DS601


@pytest.mark.slow
@pytest.mark.parametrize("link_type", [PROFIBUS_DL, USER0])
def test_profibus(link_type: int, ready: Callable[..., Engine], tmp_path: Path) -> None:
    path = tmp_path / "bus.pcapng"
    wire = test_profibus_bus.everything_wrong()
    with PcapngWriter(path, link_type=link_type) as writer:
        for shot in wire.stage.shots:
            writer.write(shot.time_ns, shot.data)
    native = analyze(path)
    assert {each.station for each in native.transactions} == {3}
    assert sum(each.rule.startswith("DS8") for each in native.findings) > 10
    assert as_json(ready("tshark").analyze(path)) == as_json(native)
    assert as_json(ready("both").analyze(path)) == as_json(native)  # not one DS601


def test_a_channel_that_the_native_engine_does_not_see(
    ready: Callable[..., Engine], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it passes over goes through tshark, too, and so it is not missed by both."""
    monkeypatch.setattr(cyclic_channels, "channels", lambda *_: iter(()))
    result = ready("both").analyze(CAPTURES / "cyclic-does-not-start.pcapng")
    told = [each.args["difference"] for each in result.findings if each.rule == "DS601"]
    assert any("DS523" in each for each in told)


def test_damaged_frames_alone(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """What is said of them is the analyzer's."""
    path = tmp_path / "bus.pcapng"
    with PcapngWriter(path, link_type=PROFIBUS_DL) as writer:
        for number, data in enumerate(
            (b"\xe5", b"\x10\2\3\x49\0\x16", b"\x10\2", b"\x10\2\3\x49\0\x16")
        ):
            writer.write(number, data)
    native = analyze(path)
    assert {each.rule for each in native.findings} == {"DS725", "DS801", "DS802"}
    assert as_json(ready("tshark").analyze(path)) == as_json(native)
    assert as_json(ready("both").analyze(path)) == as_json(native)


def test_a_log_of_profibus(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """A text: its frames go through tshark as those of a capture do."""
    path = tmp_path / "bus.txt"
    path.write_text(
        "".join(f"{shot.data.hex()}\n" for shot in test_profibus_bus.running().stage.shots)
    )
    native = analyze(path)
    assert native.bus is not None
    assert as_json(ready("both").analyze(path)) == as_json(native)
    assert as_json(ready("tshark").analyze(path)) == as_json(native)


def both_say_the_same(
    ready: Callable[..., Engine], path: Path, options: AnalysisOptions | None = None
) -> CaptureResult:
    """The native result, after it is known that it is that of the others, without a DS601."""
    native = analyze(path, options)
    assert as_json(ready("tshark", options).analyze(path)) == as_json(native)
    assert as_json(ready("both", options).analyze(path)) == as_json(native)
    return native


@pytest.mark.parametrize("name", ["s7-figure-1", "s7-stacks/torn_cpp_pure_cpp"])
def test_s7_is_that_of_the_native_engine(
    ready: Callable[..., Engine], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Jobs, their findings and connections; tshark has nothing to read."""
    monkeypatch.setattr(tshark, "ask", lambda *_: pytest.fail("nothing is asked"))
    native = both_say_the_same(ready, CAPTURES / f"{name}.pcapng")
    assert {each.channel for each in native.transactions} == {"s7"}
    assert {each.rule for each in native.findings} <= {f"DS9{number:02}" for number in range(1, 18)}
    assert native.findings
    assert native.connections


@pytest.mark.slow
def test_s7_among_other_frames(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """Frame numbers are those of the capture, in segments and in arguments too; channels can be left out."""
    path = tmp_path / "later.pcapng"
    torn, tour = CAPTURES / "s7-stacks/torn_cpp_pure_cpp.pcapng", CAPTURES / "tour-machine.pcapng"
    with PcapngWriter(path) as writer:
        for name in (torn, CAPTURES / "s7-stacks/bsend_cpp_pure.pcapng", tour):
            with open_capture(name) as capture:
                capture.tcp((102,))
                for frame in capture:
                    writer.write(frame.time_ns, cyclic(1))
                    writer.write(frame.time_ns, bytes(frame.data), frame.original_length)
    native = both_say_the_same(ready, path)
    assert {each.channel for each in native.transactions} == {"ds47", "s7"}
    assert any(each.segments for each in native.transactions)
    for channel in ("ds47", "s7"):
        both_say_the_same(ready, path, AnalysisOptions(channels=(channel,)))


def test_times_that_no_clock_shows(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """An interface that counts in seconds, and timestamps in microseconds: beyond 64 bits of nanoseconds."""
    data, path = (CAPTURES / "conversation-error.pcapng").read_bytes(), tmp_path / "far.pcapng"
    at = data.index((1).to_bytes(4, "little"), 28)
    length = int.from_bytes(data[at + 4 : at + 8], "little")
    body = data[at + 8 : at + 16] + struct.pack("<HHB3xHH", 9, 1, 0, 0, 0)
    block = struct.pack("<II", 1, len(body) + 12) + body + struct.pack("<I", len(body) + 12)
    path.write_bytes(data[:at] + block + data[at + length :])
    with open_capture(path) as capture:
        assert all(frame.time_ns > 2**63 for frame in capture)
    native = analyze(path)
    assert [each.state for each in native.transactions]
    assert [each.state for each in ready("tshark").analyze(path).transactions] == [
        each.state for each in native.transactions
    ]


def test_a_single_time_before_1970(ready: Callable[..., Engine], tmp_path: Path) -> None:
    """The first frames say 1970 and later; one does not."""
    first = analyze(CAPTURES / "tour-machine.pcapng").transactions[0].start_ns
    path = at_times(
        tmp_path / "odd.pcapng", lambda ns: ns if ns < first + 10**7 else ns - 3 * 10**18
    )
    native = analyze(path)
    result = ready("tshark").analyze(path)
    assert not result.complete
    assert result.problem
    number = int(re.fullmatch(r"the time of frame (\d+) is too far .+", result.problem)[1])
    with open_capture(path) as capture:
        assert next(frame.number for frame in capture if frame.time_ns < 0) == number
    both = ready("both").analyze(path)
    (said,) = [each for each in both.findings if each.rule == "DS601"]
    assert f"not compared, the time of frame {number} is too far" in sentence(said)
    both.findings.remove(said)
    assert as_json(both) == as_json(native)


@pytest.mark.slow
def test_a_capture_that_lost_frames_says_so(ready: Callable[..., Engine], tmp_path: Path) -> None:
    for name in (
        "conversation-orphan",
        "conversation-read-unanswered",
        "conversation-change-unread",
    ):
        path = tmp_path / f"{name}.pcapng"
        statistics = bytes.fromhex("0500000028000000000000000000000000000000")
        statistics += bytes.fromhex("0500080007000000000000000000000028000000")
        path.write_bytes((CAPTURES / path.name).read_bytes() + statistics)
        native = analyze(path)
        assert native.dropped == 7
        assert reasons("en")["dropped"] in "".join(sentence(f) for f in native.findings)
        assert as_json(ready("tshark").analyze(path)) == as_json(native)


def test_a_damaged_capture_is_read_as_far_as_it_goes(
    ready: Callable[..., Engine], tmp_path: Path
) -> None:
    path = tmp_path / "cut.pcapng"
    path.write_bytes((CAPTURES / "tour-machine.pcapng").read_bytes()[:-700])
    result = ready().analyze(path)
    assert not result.complete
    assert as_json(result) == as_json(analyze(path))


def test_what_is_no_capture(ready: Callable[..., Engine], tmp_path: Path) -> None:
    path = tmp_path / "text.pcapng"
    path.write_text("no capture")
    with pytest.raises(CaptureError, match="not a capture"):
        ready().analyze(path)


# -- a difference -----------------------------------------------------------------------------------


def lying(monkeypatch: pytest.MonkeyPatch, change: Callable[[Fields], None]) -> None:
    """From here on the plugin says something else."""
    ask = tshark.ask

    def changed(*arguments: Any) -> Answer:
        answer = ask(*arguments)
        change(answer.fields)
        return answer

    monkeypatch.setattr(tshark, "ask", changed)


def value(fields: Fields) -> None:
    fields.transactions[0]["parameters"][0]["values"] = [47.0]


def state(fields: Fields) -> None:
    fields.transactions[1]["state"] = "orphan"


def lost(fields: Fields) -> None:
    fields.transactions.pop()


def silent(fields: Fields) -> None:
    fields.findings.pop()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (value, r"transaction 1: p\d+\[\d+\] was .*, is 47\.0"),
        (state, r"transaction 2: state was ok, is orphan"),
        (lost, r"transaction 8 is gone"),
        (silent, r"finding gone: DS402"),
    ],
)
def test_a_difference_is_a_finding(
    ready: Callable[..., Engine],
    monkeypatch: pytest.MonkeyPatch,
    change: Callable[[Fields], None],
    words: str,
) -> None:
    lying(monkeypatch, change)
    path = CAPTURES / "tour-machine.pcapng"
    result, native = ready().analyze(path), analyze(path)
    found = [f for f in result.findings if f.rule == "DS601"]
    assert any(re.search(words, sentence(f)) for f in found), list(map(sentence, found))
    assert {f.severity for f in found} == {"error"}
    frames = {frame for t in native.transactions for frame in t.frames.all()}
    assert {f.frame for f in found} <= frames
    result.findings = [f for f in result.findings if f.rule != "DS601"]
    assert as_json(result) == as_json(native)


def test_a_difference_that_nobody_wants(
    ready: Callable[..., Engine], monkeypatch: pytest.MonkeyPatch
) -> None:
    lying(monkeypatch, value)
    path = CAPTURES / "tour-machine.pcapng"
    assert not ready("both", AnalysisOptions(select=("DS2",))).analyze(path).findings[1:]
    chinese = ready("both", AnalysisOptions(select=("DS601",)), "zh").analyze(path)
    assert [f.rule for f in chinese.findings] == ["DS601"]
    assert re.search("插件（现为）.*：任务 .*原为 .*，现为 ", sentence(chinese.findings[0], "zh"))


def test_an_error_of_the_plugin_shows(ready: Callable[..., Engine], tmp_path: Path) -> None:
    for folder in ("dissector", "lua"):
        copy(ROOT / folder, tmp_path / folder)
    entry = tmp_path / "dissector/ds47.lua"
    text = entry.read_text(encoding="utf-8")
    head = "function ds47.dissector(tvb, pinfo, tree)"
    assert head in text
    entry.write_text(text.replace(head, f"{head} if pinfo.number == 3 then error('<no>') end"))
    path = CAPTURES / "record-global.pcapng"
    both, alone = ready("both"), ready("tshark")
    for each in (both, alone):
        each._tshark = replace(each._tshark, script=entry)
    texts = [sentence(f) for f in both.analyze(path).findings if f.rule == "DS601"]
    assert any("<no>" in text for text in texts)
    with pytest.raises(CaptureError, match="<no>"):
        alone.analyze(path)


def copy(source: Path, target: Path) -> None:
    for path in source.rglob("*.lua"):
        place = target / path.relative_to(source)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(path.read_bytes())


def broken_tshark(folder: Path, program: str, rest: str) -> Path:
    """A tshark that is the real one until it has to print PDML."""
    path = folder / "tshark"
    path.write_text(f'#!/bin/sh\ncase "$*" in *pdml*) {rest};; esac\nexec {program} "$@"\n')
    path.chmod(0o755)
    return path


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
@pytest.mark.parametrize(
    ("rest", "words"),
    [
        ("echo '<pdml><packet>'; echo out of memory >&2; exit 0", "out of memory"),
        ("echo '<pdml></pdml>'; echo no plugin >&2; exit 4", "no plugin"),
        ("echo '<pdml><packet><proto></packet></pdml>'; exit 0", "cannot be read"),
        ("kill -9 $$", "stopped early"),
    ],
)
def test_a_tshark_that_stops(
    program: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, rest: str, words: str
) -> None:
    path = CAPTURES / "record-global.pcapng"
    broken = tshark.Tshark(broken_tshark(tmp_path, program, rest), tshark.prepare(program).script)
    monkeypatch.setattr(tshark, "prepare", lambda _program: broken)
    with pytest.raises(CaptureError, match=words):
        Engine("tshark", AnalysisOptions()).analyze(path)
    (found,) = Engine("both", AnalysisOptions()).analyze(path).findings
    assert found.rule == "DS601"
    assert words in sentence(found)


# -- what is missing --------------------------------------------------------------------------------


def test_without_tshark(tmp_path: Path) -> None:
    with pytest.raises(NotReadyError, match="install tshark, or name it with --tshark"):
        Engine("tshark", AnalysisOptions(), str(tmp_path / "no-tshark"))


def test_without_pyshark(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyshark", None)
    tshark._file_capture.cache_clear()
    with pytest.raises(NotReadyError, match=r"needs pyshark .*pip install pyshark"):
        Engine("tshark", AnalysisOptions())


@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
def test_where_the_plugin_is_not_loaded(program: str, tmp_path: Path) -> None:
    """As root Wireshark 4.4 ignores scripts: it then takes ds47 for a typing error."""
    path = tmp_path / "tshark"
    path.write_text(
        f'#!/bin/sh\ncase "$*" in *lua_script*) echo "tshark: ds47 is neither a field" >&2; exit 2;; esac\n'
        f'exec {program} "$@"\n'
    )
    path.chmod(0o755)
    with pytest.raises(NotReadyError, match=r"(neither a field|as root).*ds47 plugin doctor"):
        Engine("tshark", AnalysisOptions(), str(path))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="a shell script")
def test_a_plugin_of_another_version_is_in_the_way(program: str, tmp_path: Path) -> None:
    path = tmp_path / "tshark"
    path.write_text(
        "#!/bin/sh\n"
        f'if [ "$1 $2" = "-G plugins" ]; then printf "ds47.lua\\t0.0.9\\tlua script\\t/opt/ds47.lua\\n"; fi\n'
        f'exec {program} "$@"\n'
    )
    path.chmod(0o755)
    with pytest.raises(NotReadyError, match=r"/opt/ds47\.lua is version 0\.0\.9 .*delete it"):
        Engine("tshark", AnalysisOptions(), str(path))


@pytest.mark.parametrize("slow_ms", [0.5, -1, float("inf"), 2.0**33])
def test_a_limit_that_the_plugin_cannot_have(slow_ms: float) -> None:
    with pytest.raises(NotReadyError, match="whole ms"):
        engine.preferences(AnalysisOptions(slow_ms=slow_ms))


def test_preferences_are_complete() -> None:
    """Each preference of the plugin can be given; `ignore` comes afterwards, others with a capture."""
    there = {row["name"] for row in spec._load("wireshark.toml")["preferences"]}
    layouts = (("192.168.0.5", "uss"),)
    names = tuple(map(parse, ("00:1b:1b:11:22:33@8000:0:pkw", "00:1f:f8:11:22:33@8001:4:pkw")))
    options = AnalysisOptions(
        indices=frozenset((3, 0xB030)),
        pkw_layouts=layouts,
        cyclic=names,
        ppos=((3, 1), (4, 3)),
    )
    given = engine.preferences(options)
    assert {each.split(":")[0].removeprefix("ds47.") for each in given} == there - {
        "ignore",
        "lists",
        "frame_numbers",
    }
    assert "ds47.cyclic:00:1b:1b:11:22:33@8000:0:pkw 00:1f:f8:11:22:33@8001:4:pkw" in given
    assert "ds47.ppos:3=ppo1 4=ppo3" in given
    assert {"ds47.indices:3,45104", f"ds47.slow_ms:{limits().slow_ns // 10**6}"} <= set(given)
    assert all(each.split(":")[1] for each in engine.preferences(AnalysisOptions()))


@pytest.mark.slow
def test_lists_of_the_user_count(ready: Callable[..., Engine]) -> None:
    rows = [
        ListedParameter(21, "Speed now", None, "1/min", None, {}),
        ListedParameter(945, "Faults", None, None, None, {7900: "stalled"}),
    ]
    options = AnalysisOptions(lists=(ParameterList("mine", rows=rows),))
    for name in ("conversation-partial-read", "tour-machine"):
        path = CAPTURES / f"{name}.pcapng"
        native = analyze(path, options)
        wanted = [TRANSACTION.plain(each) for each in native.transactions]
        assert any("Speed now" in str(each) or "stalled" in str(each) for each in wanted)
        for kind in ("tshark", "both"):
            found = ready(kind, options).analyze(path)
            assert "DS601" not in {each.rule for each in found.findings}
            assert [TRANSACTION.plain(each) for each in found.transactions] == wanted


def test_settings_of_the_user_do_not_count(
    ready: Callable[..., Engine], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "XDG_CONFIG_HOME", "WIRESHARK_CONFIG_DIR"):
        monkeypatch.setenv(name, str(tmp_path))
    for folder in (tmp_path, tmp_path / ".config/wireshark"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "disabled_protos").write_text("ds47\n")
    path = CAPTURES / "record-global.pcapng"
    assert as_json(ready("tshark").analyze(path)) == as_json(analyze(path))
    assert os.environ["HOME"] == str(tmp_path)


# -- the command ------------------------------------------------------------------------------------


def ds47(*arguments: str | Path, data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "ds47", *map(str, arguments)]
    return subprocess.run(command, input=data, capture_output=True, check=False)


@pytest.mark.slow
def test_the_command(program: str) -> None:
    path = CAPTURES / "tour-machine.pcapng"
    texts = {
        name: ds47("report", "--engine", name, "--tshark", program, path).stdout
        for name in ("native", "tshark", "both")
    }
    assert texts["native"] == texts["tshark"] == texts["both"] != b""


@pytest.mark.slow
@pytest.mark.parametrize("form", ["json", *STREAMED])
def test_the_command_in_other_formats_from_stdin(program: str, form: str) -> None:
    data = (CAPTURES / "conversation-superseded-read.pcapng").read_bytes()
    native, both = (
        ds47("report", "-f", form, "--engine", name, "--tshark", program, "-", data=data)
        for name in ("native", "both")
    )
    assert native.returncode == both.returncode == 0, both.stderr
    assert sorted(native.stdout.splitlines()) == sorted(both.stdout.splitlines())


def test_the_command_without_tshark() -> None:
    said = ds47("report", "--engine", "tshark", "--tshark", "no-such-tshark", CAPTURES)
    assert said.returncode == 2
    assert said.stdout == b""
    assert len(said.stderr.splitlines()) == 1


# -- from dictionaries to the model -----------------------------------------------------------------


@pytest.mark.parametrize("path", sorted(CAPTURES.glob("*.pcapng")), ids=lambda path: path.stem)
def test_rebuilding_is_the_reverse_of_the_report(path: Path) -> None:
    result = analyze(path)
    vendors = {each.ip: each.vendor_id for each in result.devices}
    for transaction in result.transactions:
        vendor_id = vendors.get(transaction.device)
        rebuilt = load.transaction(TRANSACTION.plain(transaction), vendor_id)
        assert rebuilt == replace(transaction, position=0)
        rebuilt = load.transaction(TRANSACTION.plain(transaction, "zh"), vendor_id)
        assert rebuilt == replace(transaction, position=0)
    for finding in result.findings:
        assert load.finding(FINDING.plain(finding)) == finding


def test_a_text_that_is_not_of_this_version_stays() -> None:
    stored = contract.error({"code": 0x11, "text": "not today", "info": 3}, 42)
    assert {error_words(stored, lang) for lang in LANGUAGES} == {"not today"}
    assert (stored.code, stored.info, stored.text) == (0x11, 3, "not today")


@pytest.mark.parametrize("time_ns", [0, 1, -1, -(10**18), 1_767_254_400_123_456_789, 2**63, 2**80])
def test_times_are_exact(time_ns: int) -> None:
    assert units.nanoseconds(units.timestamp(time_ns)) == time_ns


@pytest.mark.parametrize("ns", [0, 1, -5, 999_999, 12_345_678_901, 10**15 + 1, None])
def test_durations_are_exact(ns: int | None) -> None:
    assert units.duration(units.milliseconds(ns)) == ns


def test_what_is_no_time() -> None:
    with pytest.raises(ValueError, match="is not the time"):
        units.nanoseconds("yesterday")


def test_events_of_drives_and_where_they_are_come_from_the_plugin(
    ready: Callable[..., Engine],
) -> None:
    path = CAPTURES / "cyclic-does-not-start.pcapng"
    native, found = analyze(path), ready("tshark").analyze(path)
    ((line,), (told,)) = native.timelines, found.timelines
    assert len(told.events) == len(line.events) == 9
    assert (told.events, told.relation) == (line.events, 1)
    assert engine.differences(native, found) == []


def test_events_that_differ_are_differences() -> None:
    native = analyze(CAPTURES / "cyclic-does-not-start.pcapng")
    (line,), (relation,) = native.timelines, native.relations

    def kinds(events: list[Event], **other: Any) -> list[str]:
        moved = replace(relation, **other)
        found = replace(native, timelines=[replace(line, events=events)], relations=[moved])
        return [each.kind for each in engine.differences(native, found)]

    events = line.events
    assert kinds(events) == []
    assert kinds(events[:-1]) == ["event"]
    assert kinds([*events[:-1], events[-1]._replace(frame=1)]) == ["event"]
    assert kinds([*events[:-1], events[-1]._replace(after=0)]) == ["event"]
    assert kinds(events, telegrams=[2]) == ["event"]
    assert kinds(events, slot=3) == ["event", "event"]  # gone there, new here


def test_a_drive_that_only_the_plugin_knows_is_a_difference() -> None:
    native = analyze(CAPTURES / "cyclic-does-not-start.pcapng")
    told = {
        "frame": 1, "relation": 2, "device": "192.0.2.9", "slot": 1, "subslot": 1, "telegrams": [1],
        "name": "first", "word": "STW1", "before": None, "after": 0x047F, "state": None, "overlays": (),
    }  # fmt: skip

    class Kept:
        numbers, shift, times = [7], 0, FrameTimes(10)

    found = replace(native, **engine._Original(Kept(), native).drives([told], CHANNELS))  # type: ignore[arg-type]
    assert [each.device for each in found.relations] == [native.relations[0].device, "192.0.2.9"]
    assert [each.frame for each in found.timelines[1].events] == [7]
    assert any("192.0.2.9 slot 1.1" in each.text for each in engine.differences(native, found))
