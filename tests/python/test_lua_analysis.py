"""The analysis in Lua against that in Python: the complete result, but for what only the analyzer has.

Every capture as it is, in both languages; and captures mixed and broken by chance (seeded): conversations of
several files at once, frames lost, doubled, swapped and changed, clocks that jump.
"""

from __future__ import annotations

import io
import json
import os
import random
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, BinaryIO
from unittest.mock import patch

import pytest
import test_cyclic_scenes
import test_lua_profibus
import test_profibus_analysis
import test_profibus_bus
import test_profibus_families
import test_profibus_ppo
import troubles
from test_conversations import CASES, capture
from test_cyclic_scenes import SCENES
from tests.audit import cuts, lossy, seeds, wire
from whole_capture import without_analyzers

from ds47 import analysis, lab
from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import Frame, open_capture
from ds47.capture.scan import (
    ETHERNET,
    IPV4,
    PROFINET,
    network_layer,
    relevant,
)
from ds47.capture.writer import PcapngWriter
from ds47.model import CaptureResult
from ds47.profibus import LINK_TYPES, PROFIBUS_DL, USER0
from ds47.profinet import ip
from ds47.profinet.link import dissect, mac
from ds47.report import json as report
from ds47.report.sentences import at_offset
from ds47.spec.semantics import limits

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[2]
DRIVER = ROOT / "tests/lua/analysis.lua"
BESIDE = ROOT.parent / "shared/captures"
CAPTURES = sorted(
    path
    for folder in (
        ROOT / "captures",
        ROOT / "captures" / "s7-stacks",
        ROOT / "captures" / "lossy-stacks",
        ROOT / "captures" / "field",
        BESIDE,
        BESIDE / "real-stacks",
        BESIDE / "s7",
    )
    for path in folder.glob("*.pcap*")
)
SMALL = 200_000
"""Bytes of a file up to which the end is played after every packet, too."""
BROKEN = 100
"""Mixed and broken captures for each Lua version, other ones for each."""
SMALL_LIMITS = ({"unanswered_writes": 2},)
"""Limits that few captures reach, so small that many do."""
VOLATILE = 944
"""A parameter that the drive itself changes (spec/parameters.toml)."""
VERSIONS = ("5.2", "5.3", "5.4")
START_NS = 1_767_254_400_000_000_000


def lua(version: str) -> str:
    """The interpreter of a Lua version; skips without it, or fails where everything has to be there."""
    program = shutil.which(f"lua{version}")
    if program is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"lua{version} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"lua{version} is missing")
    return program


def instant(frame: Frame) -> dict[str, int]:
    seconds, nanoseconds = divmod(frame.time_ns, 10**9)
    found = {"frame": frame.number, "seconds": seconds, "nanoseconds": nanoseconds}
    if frame.original_length > len(frame.data):
        found |= {"captured": len(frame.data), "original": frame.original_length}
    return found


def fragment(frame: Frame) -> dict[str, Any] | None:
    """An IP fragment as it stands in the frame; None for everything else."""
    kind, at = network_layer(frame.data, 0, len(frame.data), frame.link_type)
    part = ip.parse(frame.data, at) if kind == IPV4 else None
    if part is None or part.protocol != ip.UDP or part.whole:
        return None
    return instant(frame) | {
        "kind": "fragment",
        "src_ip": part.source,
        "dst_ip": part.destination,
        "ip_id": part.identification,
        "offset": part.offset,
        "more": part.more,
        "data": part.payload.hex(),
        "missing": part.missing,
        "src_mac": mac(frame.data[6:12]),
    }


def cyclic(frame: Frame) -> bool:
    """Whether it is an RT frame that names no station: Lua gets all of them."""
    data, link = frame.data, frame.link_type
    return network_layer(data, 0, len(data), link)[0] == PROFINET and not relevant(
        data, 0, len(data), link, frame.original_length
    )


def everything(content: BinaryIO) -> Iterator[Frame]:
    """The frames that may matter, and all cyclic ones."""
    with open_capture(content) as capture:
        for frame in capture.everything():
            told = Frame(
                frame.number, frame.time_ns, frame.link_type, frame.data, frame.original_length
            )
            data = frame.data
            known = relevant(data, 0, len(data), frame.link_type, frame.original_length)
            if known or cyclic(told):
                yield told


def lines(frames: Iterable[Frame]) -> Iterator[dict[str, Any]]:
    """What Wireshark's half of the program would feed: datagrams, fragments, names of stations, cyclic frames."""
    for frame in frames:
        if frame.link_type in LINK_TYPES:
            bus = {"kind": "bus", "link": frame.link_type, "data": frame.data.hex()}
            yield instant(frame) | bus
            continue
        if cyclic(frame):
            yield instant(frame) | {"kind": "rt", "data": frame.data.hex()}
            continue
        part = fragment(frame)
        if part is not None:
            yield part
            continue
        packet = dissect(frame)
        if packet is not None:
            names = (
                "kind", "src_ip", "dst_ip", "src_port", "ip_id", "src_mac", "dst_mac", "missing",
            )  # fmt: skip
            yield (
                instant(frame)
                | {name: getattr(packet, name) for name in names}
                | {"payload": packet.payload.hex()}
            )


@dataclass(frozen=True)
class Source:
    """A capture to compare; `look`: in Lua the end is played after every packet, too."""

    name: str
    content: bytes
    look: bool

    def open(self) -> BinaryIO:
        return io.BytesIO(self.content)


def stored() -> Iterator[Source]:
    for path in CAPTURES:
        content = path.read_bytes()
        yield Source(path.name, content, len(content) <= SMALL)


def expected(result: CaptureResult, lang: str) -> dict[str, Any]:
    told = report.capture(result, lang)
    diagnoses = told.pop("diagnoses")
    offers = [(each["rule"], each["corrected"]) for each in diagnoses if each["corrected"]]
    told["instead"] = {
        f"{rule} {offer['transaction']} {offer['request']}": offer for rule, offer in offers
    }
    for name in ("path", "sha256", "frames", "start", "end", "complete", "summary"):
        del told[name]
    for finding in told["findings"]:
        finding["message"] = finding["message"].removeprefix(at_offset(finding["offset"], "", lang))
        finding["args"] = without_null(finding["args"])  # nil has no place in a table of Lua
        del finding["filter"]
        finding.pop("time", None)  # Wireshark has it beside each frame
    for shown, transaction in zip(told["transactions"], result.transactions, strict=True):
        shown["start"] = list(divmod(transaction.start_ns, 10**9))
        del shown["duration_ms"]
        shown["duration_ns"] = transaction.duration_ns
    for shown, timeline in zip(told.get("timelines", []), result.timelines, strict=True):
        for event, known in zip(shown["events"], timeline.events, strict=True):
            event["time"] = list(divmod(known.time_ns, 10**9))
    return told


def without_null(args: dict[str, Any]) -> dict[str, Any]:
    """Arguments without those that are null, in a place of a record too."""
    return {
        name: without_null(value) if isinstance(value, dict) else value
        for name, value in args.items()
        if value is not None
    }


def text(item: Any) -> str:
    """As text 10 is not 10.0."""
    return json.dumps(item, sort_keys=True, ensure_ascii=False, indent=0)


@lru_cache(maxsize=6)  # as many as one test asks about, so that the next Lua finds them
def of_python(
    sources: tuple[Source, ...],
    lang: str,
    options: AnalysisOptions,
    fewer: tuple[tuple[str, int], ...],
) -> tuple[str, list[str]]:
    """What Lua is given, and what it has to say: the same for each version, of which one follows the other.

    `fewer`: limits that are otherwise than in spec/limits.toml.
    """
    given, wanted = [], []
    bounds = limits().but(**dict(fewer))
    for source in sources:
        begin = {"kind": "begin", "lang": lang, "look": source.look}
        begin["layouts"] = dict(options.pkw_layouts)
        begin["cyclic"] = " ".join(
            f"{each.mac}@{each.frame_id:x}:{each.offset}:{each.kind}" for each in options.cyclic
        )
        begin["vendor_id"] = options.vendor_id
        begin["ppos"] = " ".join(f"{station}=ppo{number}" for station, number in options.ppos)
        begin["limits"] = dict(fewer)
        with patch.object(analysis, "limits", lambda: bounds):
            result = analyze(source.open(), options)
        end = {"kind": "end", "dropped": bool(result.dropped)}
        given += [begin, *lines(everything(source.open())), end]
        result = without_analyzers(result)
        wanted += [text(expected(result, each)) for each in lang.split()]
    return "".join(f"{json.dumps(line)}\n" for line in given), wanted


def compare(
    version: str,
    lang: str,
    sources: Sequence[Source],
    folder: Path,
    options: AnalysisOptions = AnalysisOptions(),  # noqa: B008
    **fewer: int,
) -> None:
    """Runs all of them through one Lua process; fails where one result is not Python's.

    "en zh" is the result in both languages.
    """
    given, got = folder / "input", folder / "output"
    asked, wanted = of_python(tuple(sources), lang, options, tuple(fewer.items()))
    given.write_text(asked, encoding="utf-8")
    with got.open("wb") as output:
        subprocess.run([lua(version), DRIVER, given], stdout=output, check=True, timeout=300)
    found = got.read_text(encoding="utf-8").splitlines()
    assert len(found) == len(wanted)
    names = [source.name for source in sources for _ in lang.split()]
    for name, line, told in zip(names, found, wanted, strict=True):
        assert text(with_instead(json.loads(line), told)) == told, name


def with_instead(found: dict[str, Any], told: str) -> dict[str, Any]:
    """What Lua says, of requests to send instead only those of which Python tells: one of each cause."""
    known = json.loads(told)["instead"]
    found["instead"] = {key: each for key, each in found["instead"].items() if key in known}
    return found


@pytest.mark.parametrize("version", VERSIONS)
def test_every_capture_gives_the_same_result(version: str, tmp_path: Path) -> None:
    sources = list(stored())
    assert len(sources) > 100
    compare(version, "en zh", sources, tmp_path)


def frames_of(path: Path) -> list[Frame]:
    with open_capture(path) as capture:
        return [frame for frame in capture if frame.link_type == ETHERNET]


def mixed(chance: random.Random, files: list[list[Frame]]) -> list[Frame]:
    """Frames of some files in one another's way, each file still in its order."""
    queues = [list(reversed(chance.choice(files))) for _ in range(chance.randint(1, 3))]
    frames = []
    while queues := [queue for queue in queues if queue]:
        frames.append(chance.choice(queues).pop())
    return frames


def changed(chance: random.Random, data: bytes) -> bytes:
    """One byte of the record, or of what says where it goes, is another one."""
    if len(data) < 150:
        return data
    at = chance.choice((chance.randint(142, len(data) - 1), len(data) - chance.randint(1, 24)))
    new = chance.choice((0, 1, 2, 0x2F, 0x7F, 0x80, 0xFF, data[at] ^ 1, chance.randint(0, 255)))
    return data[:at] + bytes([new]) + data[at + 1 :]


STEPS_BACK = (5_000_000, 5 * 10**9, 61 * 10**9, 3600 * 10**9)
"""Nanoseconds by which a clock that was wrong is put back."""


def broken(chance: random.Random, frames: list[Frame]) -> Iterator[tuple[int, bytes, int]]:
    """Time, captured bytes and length of frames to which things happened."""
    for time_ns, data in happened(chance, frames):
        if chance.random() < 0.005:
            yield time_ns, data[: chance.randint(14, len(data))], len(data)
        elif chance.random() < 0.002:
            yield time_ns + chance.choice((-1, 1)) * chance.choice(STEPS_BACK), data, len(data)
        else:
            yield time_ns, data, len(data)


def happened(chance: random.Random, frames: list[Frame]) -> Iterator[tuple[int, bytes]]:
    """Time and bytes of frames, but for what happens to a single one."""
    rate, now = chance.choice((0.0, 0.02, 0.1)), START_NS
    for number, frame in enumerate(frames):
        now += chance.choice((1_000, 500_000, 2_000_000))
        if chance.random() >= rate:
            yield now, frame.data
            continue
        fate = chance.choice(("lost", "doubled", "again", "swapped", "changed", "later", "earlier"))
        if fate == "later":
            now += chance.choice((2, 11, 61, 601)) * 10**9
        elif fate == "earlier":
            now -= chance.choice(STEPS_BACK)
        elif fate == "again":
            yield now, chance.choice(frames).data
        elif fate == "swapped" and number + 1 < len(frames):
            yield now, frames[number + 1].data
        if fate == "changed":
            yield now, changed(chance, frame.data)
        elif fate != "lost":
            yield now, frame.data
        if fate == "doubled":
            yield now + 1_000, frame.data


def own(version: str, sources: list[Source]) -> list[Source]:
    """Those of one Lua: what differs between the three, stored captures and vectors show by all of them."""
    return sources[VERSIONS.index(version) :: len(VERSIONS)]


AUDITED = 12
"""Random conversations of the auditor: every third is a line of PROFIBUS."""


@pytest.fixture(scope="module")
def audited(tmp_path_factory: pytest.TempPathFactory) -> list[Source]:
    sources, path = [], tmp_path_factory.mktemp("audited") / "talk.pcap"
    once = *seeds.kept(), *seeds.kept(seeds.WITH_HOLES)
    for plan in (*once, *seeds.planned(AUDITED, number=1)):
        seeds.play(plan).tape.write(path)
        sources.append(Source(plan.text(), path.read_bytes(), False))
        for name, frames in cuts.of(wire.frames(path), cuts.two(plan.seed)):
            cuts.write(path, frames)
            sources.append(Source(f"{name} {plan.text()}", path.read_bytes(), False))
    for plan in (plans[0] for plans in seeds.of_wires().values()):
        for name, tape in zip(("near", "far"), lossy.play(plan).tapes, strict=True):
            tape.write(path)
            sources.append(Source(f"{name} {plan.text()}", path.read_bytes(), False))
    return sources


@pytest.mark.parametrize("version", VERSIONS)
def test_conversations_of_the_auditor_give_the_same_result(
    version: str, audited: list[Source], tmp_path: Path
) -> None:
    compare(version, "en", own(version, audited), tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_snap_lengths_give_the_same_result(version: str, tmp_path: Path) -> None:
    """From what is too short for a header of RPC to what is longer than most records."""
    sources, path = [], tmp_path / "cut.pcap"
    for stack in sorted((ROOT / "captures/real-stacks").glob("*.pcapng")):
        for length in range(120 + 14 * VERSIONS.index(version), 340, 42):
            cuts.write(path, cuts.snapped(length)(wire.frames(stack)))
            name = f"{stack.name} {length}"
            sources.append(Source(name, path.read_bytes(), look=length % 5 == 0))
    compare(version, "en", sources, tmp_path)


@pytest.fixture(scope="module")
def by_ms1(tmp_path_factory: pytest.TempPathFactory) -> list[Source]:
    sources, path = [], tmp_path_factory.mktemp("ms1") / "bus.pcapng"
    for number, stored_ in enumerate(CAPTURES):
        master = test_profibus_analysis.reframed(stored_)
        if master is not None:
            master.write(path, PROFIBUS_DL if number % 2 else USER0)
            sources.append(Source(stored_.name, path.read_bytes(), number % 5 == 0))
    assert len(sources) > 100
    again = (test_profibus_analysis.SET_PRM, test_profibus_analysis.SHORT)
    told = [test_profibus_analysis.read_back(*between) for between in ((), again)]
    for number, frames in enumerate([*told, *test_lua_profibus.by_chance()]):
        with PcapngWriter(path, link_type=PROFIBUS_DL) as writer:
            for at, data in enumerate(frames):
                writer.write(at * 1_000_000, data)
        sources.append(Source(f"by chance {number}", path.read_bytes(), False))
    return sources


@pytest.mark.parametrize("version", VERSIONS)
def test_records_by_ms1_give_the_same_result(
    version: str, by_ms1: list[Source], tmp_path: Path
) -> None:
    compare(version, "en", own(version, by_ms1), tmp_path)


@cache
def of_ppo() -> list[Source]:
    sources = []
    for number, name in enumerate(test_profibus_ppo.scenes()):
        content = test_profibus_ppo.on_profibus(test_cyclic_scenes.capture(SCENES[name]))
        if content is not None:
            sources.append(Source(name, content, number % 9 == 0 and len(content) < SMALL))
    assert len(sources) > 30
    return [*sources, Source("long", test_profibus_ppo.long_line(), look=False)]


@pytest.mark.parametrize("version", VERSIONS)
def test_ppo_gives_the_same_result(version: str, tmp_path: Path) -> None:
    compare(version, "en", own(version, of_ppo()), tmp_path)
    running = [Source("running", test_profibus_ppo.running(), look=True)]
    for ppos in ((), ((3, 1),), ((3, 2),), ((3, 4), (5, 1))):
        compare(version, "en", running, tmp_path, AnalysisOptions(ppos=ppos))


@pytest.fixture(scope="module")
def faulty_lines(tmp_path_factory: pytest.TempPathFactory) -> list[Source]:
    """Records and words on lines with faults."""
    lines = [test_profibus_bus.everything_wrong()]
    lines += [test_profibus_bus.by_chance(seed)[0] for seed in range(100, 140)]
    lines += [test_profibus_bus.twice(each) for each in lines[::4]]
    lines += [test_profibus_bus.third_heard_twice(both) for both in (5, 6)]
    sources = [
        Source(f"line {number}", lab.captured(line.stage), number % 5 == 0)
        for number, line in enumerate(lines)
    ]
    sources += [
        Source(name, lab.captured(scene.play()), False)
        for name, scene in lab.everything().items()
        if name.startswith("profibus-")
    ]
    path = tmp_path_factory.mktemp("lines") / "line.pcap"
    for plan in seeds.planned(18, number=60)[::3]:
        seeds.play(plan).tape.write(path)
        kinds = ["every 5th lost", "every 11th lost", cuts.snap(30)]
        for name, frames in cuts.of(wire.frames(path), kinds):
            cuts.write(path, frames)
            sources.append(Source(f"{name} {plan.text()}", path.read_bytes(), False))
    return sources


@pytest.mark.parametrize("version", VERSIONS)
def test_lines_of_profibus_give_the_same_result(
    version: str, faulty_lines: list[Source], tmp_path: Path
) -> None:
    """In both languages."""
    compare(version, "en", own(version, faulty_lines), tmp_path)
    compare(version, "zh", faulty_lines[:1], tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_families_of_profibus_give_the_same_result(version: str, tmp_path: Path) -> None:
    sources = [
        Source(name, lab.captured(master.stage), look=True)
        for name, master, _ in test_profibus_families.lines()
    ]
    compare(version, "en", sources, tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_conversation_vectors_give_the_same_result(version: str, tmp_path: Path) -> None:
    """The vectors say which rule and which frame; here the arguments are compared as well."""
    cases = [case for case in CASES if "options" not in case]
    sources = [Source(case["id"], capture(case).getvalue(), False) for case in cases]
    compare(version, "en", sources, tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_rare_troubles_give_the_same_result(version: str, tmp_path: Path) -> None:
    sources = [
        Source(each.__name__, each(), False) for each in troubles.ALL[VERSIONS.index(version) :: 3]
    ]
    compare(version, "en", sources, tmp_path)


def by_chance(seed: int, files: list[list[Frame]]) -> Source:
    chance = random.Random(seed)
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for time_ns, data, length in broken(chance, mixed(chance, files)):
            writer.write(time_ns, data, length)
    return Source(f"seed {seed}", target.getvalue(), seed % 4 == 0)


@pytest.mark.parametrize("version", VERSIONS)
def test_mixed_and_broken_captures_give_the_same_result(version: str, tmp_path: Path) -> None:
    files = [frames for path in CAPTURES if (frames := frames_of(path)) and len(frames) < 200]
    first = 1000 * VERSIONS.index(version)
    sources = [by_chance(seed, files) for seed in range(first, first + BROKEN)]
    compare(version, "en", sources, tmp_path)


@pytest.mark.parametrize("version", VERSIONS)
def test_small_limits_give_the_same_result(version: str, tmp_path: Path) -> None:
    files = [frames for path in CAPTURES if (frames := frames_of(path)) and len(frames) < 200]
    sources = [by_chance(7000 + seed, files) for seed in range(30)]
    sources += [Source(each.__name__, each(), False) for each in troubles.ALL]
    for fewer in SMALL_LIMITS:
        compare(version, "en", sources, tmp_path, **fewer)


def numbered(frame: Frame, number: int, pnu: int | None) -> bytes:
    """The frame as another call: with this IP id, RPC sequence number, request reference, parameter."""
    data = bytearray(frame.data)
    data[18:20] = (number & 0xFFFF).to_bytes(2, "big")
    data[106:110] = number.to_bytes(4, "little" if data[46] & 0x10 else "big")
    if len(data) > 206:
        data[206] = number % 255 + 1
        if pnu is not None and data[43] & 0x1F == 0:
            data[212:214] = pnu.to_bytes(2, "big")
    return bytes(data)


def flood(name: str, parts: list[tuple[int, int, int]], pnu: int | None = None) -> Source:
    """Ranges of frames of a stored capture, each so many times; as if about another parameter."""
    frames = frames_of(ROOT / "captures" / f"{name}.pcapng")
    target, count = io.BytesIO(), 0
    with PcapngWriter(target) as writer:
        for first, last, times in parts:
            for call in range(times):
                for frame in frames[first:last]:
                    writer.write(START_NS + count * 10**5, numbered(frame, 1 + call, pnu))
                    count += 1
    return Source(name, target.getvalue(), False)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_same_again_and_again_gives_the_same_result(version: str, tmp_path: Path) -> None:
    sources = [
        flood("record-polls", [(0, 2, 1), (2, 4, 4200), (8, 10, 1)]),  # polls of one transaction
        flood("record-read-empty", [(0, 2, 1), (2, 4, 4200), (4, 6, 1)]),
        flood("record-reread", [(0, 2, 1), (2, 4, 1), (6, 8, 1), (6, 7, 90), (7, 8, 90)]),
        flood("conversation-read-back", [(0, 4, 1), (4, 8, 3)]),  # is told once
        flood("conversation-read-back", [(0, 4, 1), (4, 8, 1)], VOLATILE),
        flood("record-global", [(0, 1, 100), (1, 2, 100), (2, 4, 40)]),  # Writes without a response
    ]
    compare(version, "en", sources, tmp_path)
