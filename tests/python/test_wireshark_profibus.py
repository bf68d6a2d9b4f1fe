"""Frames of PROFIBUS in a real tshark: what the plugin shows of each is what Python decodes, and what it says of
the line is what the analyzer reports.

Frames and lines are those of the tests of the analyzer: printed ones, by hand, and by chance (seeded).
"""

from __future__ import annotations

import io
import os
import random
import shutil
import struct
import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import pytest
import test_cyclic_scenes
import test_profibus_analysis
import test_profibus_bus
import test_profibus_ppo
from test_profibus import asked
from test_wireshark_cyclic import told
from test_wireshark_plugin import (
    CAPTURES,
    COMPLETE,
    ROOT,
    Tshark,
    columns,
    program,
    rows,
    tshark,
    with_all_args,
)
from test_wireshark_plugin import told as told_finding
from test_wireshark_pzd import truth
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab.master import Master
from ds47.model import CaptureResult
from ds47.profibus import PROFIBUS_DL, USER0, dp, ms1, telegram
from ds47.report import profibus as shown
from ds47.report.bilingual import LANGUAGES
from ds47.spec import codes, rules
from ds47.spec import profibus as spec
from ds47.wireshark import fields

__all__ = ["tshark"]  # the fixture
ON = ("-o", "ds47.profibus_user0:TRUE")
WAYS: dict[str, tuple[int, tuple[str, ...]]] = {
    "pcapng 257": (PROFIBUS_DL, ()),
    "pcap 147": (USER0, ON),
}
PDML = ("-T", "pdml", "-J", "frame ds47")
READ = "5f002f0a030102011001c47f0000"
"""DS_Write of a DS47 request: read p50303[0]."""
ANSWER = "5e002f0a03010201080141200000"
PREFIX = "ds47.profibus."
OK = str(codes.codes("states")["ok"])
EVENTS = codes.codes("events")
STORED = sorted((ROOT / "captures").rglob("*profibus*.pcapng"))


def saved(path: Path, frames: Iterable[bytes | tuple[int, bytes]], link: int = PROFIBUS_DL) -> Path:
    """A capture of frames: USER0 as pcap, all else as pcapng."""
    shots = [
        each if isinstance(each, tuple) else (number * 1_000_000, each)
        for number, each in enumerate(frames)
    ]
    if link != USER0:
        with PcapngWriter(path, link_type=link) as writer:
            for shot in shots:
                writer.write(*shot)
        return path
    target = io.BytesIO(struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, link))
    target.seek(0, io.SEEK_END)
    for time_ns, data in shots:
        target.write(struct.pack("<IIII", *divmod(time_ns, 10**9), len(data), len(data)) + data)
    path.write_bytes(target.getvalue())
    return path


def shots(master: Master) -> list[tuple[int, bytes]]:
    """What went past, with its times."""
    return [(each.time_ns, each.data) for each in master.stage.shots]


def request() -> Master:
    """A station that starts up, exchanges data, and reads a parameter by DS47 with polls, B5 and an answer."""
    wire = Master()
    wire.start(3)
    wire.exchange(3)
    wire.token()
    wire.record(3, READ)
    wire.poll(3)
    wire.poll(3, READ[:8])
    wire.record(3, "5e002ff0")
    wire.poll(3, "de80b500")
    wire.record(3, "5e002ff0")
    wire.poll(3, ANSWER)
    wire.token()
    return wire


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> tuple[int, tuple[str, ...]]:
    """A link type, and what makes Wireshark take it as PROFIBUS."""
    return WAYS[request.param]


# Field by field


def flags(table: str, data: bytes) -> Iterator[tuple[str, str]]:
    for row in spec.flags(table):
        if row.byte < len(data):
            yield f"{table}.{row.id}", str(data[row.byte] >> row.bit & 1)


def of_content(item: telegram.Telegram) -> Iterator[tuple[str, Any]]:
    """What DP says in the data of a frame."""
    found, du = dp.decode(item), item.du
    if isinstance(found, dp.SlaveDiagnosis):
        yield from flags("diagnosis", du)
        yield "diagnosis.master", du[3] if len(du) > 3 else None
        yield "ident", found.ident
        yield "diagnosis.block", ",".join(each.data.hex() for each in found.blocks) or None
    elif isinstance(found, dp.Parameters):
        yield from flags("parameters", du)
        yield "parameters.watchdog_ms", found.watchdog_ms
        yield "parameters.tsdr", found.tsdr
        yield "ident", found.ident
        yield "groups", found.groups
        yield "parameters.user", found.user.hex() or None
    elif isinstance(found, dp.Configuration):
        yield "configuration.module", ",".join(each.data.hex() for each in found.modules) or None
        for side in ("outputs", "inputs"):
            areas = [getattr(each, side) for each in found.modules]
            lengths = [str(area.length) for area in areas if area is not None]
            yield f"configuration.{side}", ",".join(lengths) or None
        roles = [str(codes.codes("profibus_roles")[each]) for each in found.roles if each]
        yield "configuration.role", ",".join(roles) or None
        yield "ppo", found.ppo
    elif isinstance(found, dp.Control):
        yield from flags("control", du)
        yield "groups", found.groups
    elif isinstance(found, dp.DataExchange):
        yield "outputs" if found.outputs else "inputs", du.hex() or None
        yield "wants_diagnosis", None if found.outputs else str(int(found.wants_diagnosis))


def of_message(found: ms1.Ms1Message) -> Iterator[tuple[str, Any]]:
    yield "ms1", codes.codes("profibus_messages")[found.kind]
    yield "ms1.function", found.code
    yield "ms1.slot", found.slot
    yield "ms1.index", found.index
    yield "ms1.length", found.length
    record = found.length is not None and found.data
    yield "ms1.record", found.data.hex() if record else None
    yield "ms1.error_decode", found.error_decode
    yield "ms1.error_code_1", found.error_code_1
    yield "ms1.error_code_2", found.error_code_2
    yield "ms1.status", found.status
    yield "ms1.not_ready", "1" if found.not_ready else None


def expected(data: bytes) -> dict[str, str]:
    """The fields of a frame as tshark prints them, numbers in decimal digits."""
    item = telegram.decode(data)
    message, name = shown.record(item), dp.service(item)
    found: dict[str, Any] = {"sd": data[0] if item.kind else None, "da": item.da, "sa": item.sa}
    if item.fc is not None:
        found |= {
            "fc": item.fc, "fc.request": str(int(bool(item.request))), "dsap": item.dsap, "ssap": item.ssap,
            "service": name and codes.codes("profibus_services")[name], "fcs": item.fcs,
            "fc.function" if item.request else "fc.answer": item.fc & 15,
        }  # fmt: skip
        if item.request:
            found |= {"fc.fcb": str(item.fc >> 5 & 1), "fc.fcv": str(item.fc >> 4 & 1)}
        else:
            found["fc.station"] = item.fc >> 4 & 3
        found |= dict(of_message(message) if message else of_content(item) if item.du else ())
    content = message or dp.decode(item)
    flaws = [*item.flaws, *(content.flaws if content else ())]
    start = shown.record_start(item) - 4
    found["flaw"] = (
        ",".join(str(codes.codes("profibus_flaws")[each.kind]) for each in flaws) or None
    )
    found["flaw.offset"] = ",".join(
        str(each.offset + start * (place >= len(item.flaws))) for place, each in enumerate(flaws)
    )
    return {key: str(value) for key, value in found.items() if value not in (None, "")}


HEX = ("sd", "fc", "fc.function", "fc.answer", "ident", "groups", "fcs", "ms1.function", "ms1.error_decode",
       "ms1.error_code_1", "ms1.error_code_2", "ms1.status")  # fmt: skip
FLAGS = [f"{table}.{row.id}" for table in spec.FLAGS for row in spec.flags(table)]
BOOLEANS = (*FLAGS, "fc.request", "fc.fcb", "fc.fcv", "wants_diagnosis", "ms1.not_ready")
OTHERS = (
    "da", "sa", "dsap", "ssap", "service", "fc.station", "diagnosis.master", "diagnosis.block",
    "parameters.watchdog_ms", "parameters.tsdr", "parameters.user", "configuration.module",
    "configuration.outputs", "configuration.inputs", "configuration.role", "ppo", "outputs", "inputs", "ms1",
    "ms1.slot", "ms1.index", "ms1.length", "ms1.record", "flaw", "flaw.offset",
)  # fmt: skip
KEYS = (*HEX, *BOOLEANS, *OTHERS)


def plain(key: str, cell: str) -> str:
    """What stands in a cell, numbers in decimal digits, whatever the version of tshark prints."""
    if key in HEX:
        return str(int(cell, 16))
    return str(truth(cell)) if key in BOOLEANS else cell.replace(":", "")


def says(line: list[str]) -> dict[str, str]:
    return {key: plain(key, cell) for key, cell in zip(KEYS, line, strict=True) if cell}


@cache
def frames_by_chance() -> tuple[bytes, ...]:
    """The first of them proves what they all are."""
    return (shots(request())[2][1], *(data for data in asked([]) if data))


@pytest.mark.slow
def test_fields_of_frames_are_those_of_python(tshark: Tshark, tmp_path: Path) -> None:
    frames = frames_by_chance()
    path = saved(tmp_path / "frames.pcapng", frames)
    wanted = [PREFIX + key for key in KEYS]
    lines = rows(tshark("-r", path, "-Y", "ds47_profibus", *columns(*wanted)))
    assert len(lines) == len(frames)
    for data, line in zip(frames, lines, strict=True):
        assert says(line) == expected(data), data.hex()


def test_chance_leaves_no_field_out() -> None:
    seen: set[str] = set()
    for data in frames_by_chance():
        seen |= expected(data).keys()
    assert set(KEYS) - seen == set()


@pytest.mark.slow
def test_fields_stand_at_their_bytes(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path / "line.pcapng", shots(request()))
    places = {
        3: {"sd": (0, 1), "le": (1, 1), "ler": (2, 1), "sd_repeated": (3, 1), "da": (4, 1), "sa": (5, 1),
            "fc": (6, 1), "fc.fcb": (6, 1), "dsap": (7, 1), "ssap": (8, 1), "data": (9, 10),
            "parameters.lock": (9, 1), "parameters.watchdog_1": (10, 1), "parameters.watchdog_2": (11, 1),
            "parameters.tsdr": (12, 1), "ident": (13, 2), "groups": (15, 1), "parameters.user": (16, 3),
            "parameters.dpv1": (16, 1), "fcs": (19, 1), "ed": (20, 1)},
        5: {"configuration.module": (9, 1)},
        8: {"diagnosis.watchdog": (7, 1), "diagnosis.master": (9, 1), "ident": (10, 2)},
        9: {"outputs": (7, 12)},
        12: {"ms1": (9, 14), "ms1.function": (9, 1), "ms1.slot": (10, 1), "ms1.index": (11, 1),
             "ms1.length": (12, 1), "ms1.record": (13, 10)},
        21: {"ms1.error_decode": (10, 1), "ms1.status": (9, 4)},
    }  # fmt: skip
    packets = tshark("-r", path, "-T", "pdml", "-J", "ds47_profibus").split("<packet>")
    assert len(packets) == 1 + len(shots(request()))
    for number, wanted in places.items():
        text = packets[number]
        for key, (at, size) in wanted.items():
            field = text.split(f'name="{PREFIX}{key}"', 1)[1]
            assert f'size="{size}" pos="{at}"' in field[: field.index(">")], (number, key)
    damaged = saved(
        tmp_path / "damaged.pcapng", [*shots(request())[:2], (0, b"\x10\2\3\x49\0\x16")]
    )
    text = tshark("-r", damaged, "-Y", "ds47.profibus.flaw", "-T", "pdml")
    flaw = text.split('name="ds47.profibus.flaw"', 1)[1]
    assert 'size="1" pos="4"' in flaw[: flaw.index(">")]
    text = tshark("-r", path, *COMPLETE, "-Y", "frame.number == 12", "-T", "pdml")
    for key, at, size in (("request_reference", 13, 1), ("pnu", 19, 2), ("subindex", 21, 2)):
        field = text.split(f'name="ds47.{key}"', 1)[1]
        assert f'size="{size}" pos="{at}"' in field[: field.index(">")], key


@pytest.mark.parametrize("lang", LANGUAGES)
def test_the_tree_has_the_words_of_the_command(lang: str, tshark: Tshark, tmp_path: Path) -> None:
    """Function codes, modules, flags in Chinese, flaws: what `ds47 decode --as profibus` says."""
    wire = request()
    wire.exchange(3, code=0x0A)
    wire.spoil()
    path = saved(tmp_path / "line.pcapng", shots(wire))
    trees = tshark("-r", path, "-V", "-o", f"ds47.language:{lang}").split("\nFrame ")
    assert len(trees) == len(shots(wire))
    for (_, data), tree in zip(shots(wire), trees, strict=True):
        item = telegram.decode(data)
        texts = [shown.flaw(each).text(lang) for each in item.flaws]
        texts += [] if item.fc is None else [spec.control_text(item.fc, lang)]
        content = dp.decode(item)
        if isinstance(content, dp.Configuration):
            pairs = zip(content.modules, content.roles, strict=True)
            texts += [shown.module_text(*each).text(lang) for each in pairs]
        if isinstance(content, (dp.SlaveDiagnosis, dp.Parameters)):
            rows = spec.flags(
                "diagnosis" if isinstance(content, dp.SlaveDiagnosis) else "parameters"
            )
            texts += [row.text(lang) for row in rows if row.stands_in(item.du)]
        for text in texts:
            assert text in tree, data.hex()


# Columns


def test_columns(tshark: Tshark, tmp_path: Path, way: tuple[int, tuple[str, ...]]) -> None:
    wire = request()
    wire.exchange(3, code=0x0A)
    wire.spoil()
    wire.put(telegram.encode(127, 2, 0x46, b"\x20\0", 58, 62))
    path = saved(tmp_path / "line.cap", shots(wire), way[0])
    shown = 'gui.column.format:"S","%s","D","%d","P","%p","I","%i"'
    text = tshark("-r", path, *way[1], "-o", shown, "-T", "tabs")
    found = ["|".join(each for each in map(str.strip, line) if each != "→") for line in rows(text)]
    assert found[2:6] + found[8:10] + found[11:15] + found[16:] == [
        "dp2|dp3|DP|set parameters: watchdog 300 ms, ident number 80B5",
        "||DP|short acknowledgement",
        "dp2|dp3|DP|check configuration: PPO1: 12 bytes to the slave, 12 from it",
        "||DP|short acknowledgement",
        "dp2|dp3|DP|data exchange: outputs, 12 bytes",
        "dp3|dp2|DP|data exchange: inputs, 12 bytes",
        "dp2|dp3|DS47|P50303[0], read request, DO 2, ref 0x03",
        "||DP|short acknowledgement",
        "dp2|dp3|DP|poll: the master asks for the answer",
        "||DP|short acknowledgement",
        "dp3|dp2|DS47|write accepted, DO 2, ref 0x03",
        "dp2|dp3|DS47|fetch response, DO 2, ref 0x03",
        "||DP|short acknowledgement",
        "dp2|dp3|DP|poll: the master asks for the answer",
        "dp3|dp2|DS47|read poll: not ready, DO 2, ref 0x03",
        "dp2|dp3|DS47|fetch response, DO 2, ref 0x03",
        "||DP|short acknowledgement",
        "dp2|dp3|DP|poll: the master asks for the answer",
        "dp3|dp2|DS47|P50303[0] = 10.0, read response, DO 2, ref 0x03",
        "dp2|dp2|DP|token from 2 to 2",
        "dp2|dp3|DP|data exchange: outputs, 12 bytes",
        "dp3|dp2|DP|data exchange: inputs, 12 bytes, the slave asks for a diagnosis request (SAP 60); "
        "check byte is 10, and the bytes give 0F",
        "dp2|all stations|DP|global control: sync",
    ]  # fmt: skip


# The line: transactions, findings, events


def compare(tshark: Tshark, path: Path, *options: str) -> CaptureResult:
    """Fails where a transaction or finding is not the analyzer's."""
    result = analyze(path)
    text = tshark("-r", path, *COMPLETE, *options, *PDML)
    found = fields.read(io.BytesIO(text.encode()))
    assert found.transactions == [told(each) for each in result.transactions]
    wanted = of_transactions(map(told_finding, result.findings))
    assert [with_all_args(each) for each in found.findings] == wanted
    return result


def test_a_transaction(tshark: Tshark, tmp_path: Path, way: tuple[int, tuple[str, ...]]) -> None:
    path = saved(tmp_path / "line.cap", shots(request()), way[0])
    (item,) = compare(tshark, path, *way[1]).transactions
    assert (item.station, item.state, len(item.frames.polls)) == (3, "ok", 1)
    names = ("frame.number", "ds47.station", "ds47.request_in", "ds47.response_in", "ds47.state")
    found = rows(tshark("-r", path, *way[1], *COMPLETE, "-Y", "ds47", *columns(*names)))
    assert found == [
        ["12", "3", "", "25", OK], ["17", "3", "12", "25", OK], ["18", "3", "12", "25", OK],
        ["21", "3", "12", "25", OK], ["22", "3", "12", "25", OK], ["25", "3", "12", "", OK],
    ]  # fmt: skip
    assert rows(tshark("-r", path, *way[1], "-2", "-Y", "ds47", *columns(*names))) == found


def test_one_pass_shows_what_earlier_frames_prove(
    tshark: Tshark, tmp_path: Path, way: tuple[int, tuple[str, ...]]
) -> None:
    """The request is decoded in its own frame, before anybody answered."""
    path = saved(tmp_path / "line.cap", shots(request()), way[0])
    names = ("frame.number", "ds47.pnu", "ds47.request_in", "ds47.value", "ds47.state")
    assert rows(tshark("-r", path, *way[1], "-Y", "ds47", *columns(*names))) == [
        ["12", "50303", "", "", ""], ["17", "", "12", "", ""], ["18", "", "12", "", ""],
        ["21", "", "12", "", ""], ["22", "", "12", "", ""], ["25", "50303", "12", "10.0", OK],
    ]  # fmt: skip


@pytest.mark.slow
def test_everything_that_is_wrong(
    tshark: Tshark, tmp_path: Path, way: tuple[int, tuple[str, ...]]
) -> None:
    path = saved(tmp_path / "line.cap", shots(test_profibus_bus.everything_wrong()), way[0])
    result = compare(tshark, path, *way[1])
    frames: dict[str, set[str]] = {}
    for each in result.findings:
        if each.rule.startswith("DS8") and not rules()[each.rule].analyzer_only:
            frames.setdefault(each.rule, set()).add(str(each.frame))
    assert set(frames) == {"DS808", "DS809"}
    names = ("frame.number", "ds47.finding")
    for cells in rows(tshark("-r", path, *way[1], "-2", "-Y", "ds47.finding", *columns(*names))):
        for rule in frames.keys() & cells[1].split(","):
            frames[rule].remove(cells[0])
    assert not any(frames.values())
    assert tshark("-r", path, *way[1], *COMPLETE, "-Y", "ds47.expert.ds808") != ""
    damaged = tshark("-r", path, *way[1], "-q", "-z", "expert,error")
    assert "check byte is" in damaged


@pytest.mark.slow
def test_lines_by_chance(tshark: Tshark, tmp_path: Path) -> None:
    for seed in range(3):
        path = saved(tmp_path / "line.pcapng", shots(test_profibus_bus.by_chance(seed)[0]))
        assert compare(tshark, path).findings


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_stored_captures(path: Path, tshark: Tshark) -> None:
    compare(tshark, path, *ON)


RECORDS = [
    name for name in sorted(CAPTURES) if name.startswith(("conversation", "record", "message"))
]


@pytest.mark.slow
@pytest.mark.parametrize("name", RECORDS[::5])
def test_records_by_ms1(name: str, tshark: Tshark, tmp_path: Path) -> None:
    master = test_profibus_analysis.reframed(CAPTURES[name])
    if master is None:
        pytest.skip("MS1 cannot carry them")
    path = tmp_path / "bus.pcapng"
    master.write(path, PROFIBUS_DL)
    assert compare(tshark, path).transactions


STORIES = ("every-event", "fault")


def on_profibus(name: str, folder: Path) -> Path:
    content = test_profibus_ppo.on_profibus(
        test_cyclic_scenes.capture(test_cyclic_scenes.SCENES[name])
    )
    assert content is not None
    path = folder / f"{name}.pcapng"
    path.write_bytes(content)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_words_and_events_of_a_ppo(name: str, tshark: Tshark, tmp_path: Path) -> None:
    path = on_profibus(name, tmp_path)
    result = compare(tshark, path)
    (timeline,) = result.timelines
    wanted = [[str(each.frame), str(EVENTS[each.name])] for each in timeline.events]
    assert wanted
    names = ("frame.number", "ds47.pzd.event.name")
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.event", *columns(*names)))
    assert [[cells[0], each] for cells in found for each in cells[1].split(",")] == wanted


# Somebody else's frames


FOREIGN = (
    b"\1\2\3",
    b"\x68\x05\x05\x68",
    bytes(60),
    b"\xe5",
    b"\xdc\2\2",
    b"\x10" * 40,
    bytes(1400),
)
"""What may stand in a link type that is not ours; two of them look like PROFIBUS, and prove nothing."""
ETHERNET = bytes.fromhex("ffffffffffff0200000000010806") + bytes.fromhex(
    "0001080006040001020000000001c0a80001000000000000c0a80002"
)
MAPPED = 'uat:user_dlts:"User 0 (DLT=147)","eth_withoutfcs","0","","0",""'


def without_plugin(home: Path, *arguments: str | Path) -> str:
    environment = os.environ | {
        "HOME": str(home),
        "XDG_CONFIG_HOME": str(home),
        "LC_ALL": "C.UTF-8",
    }
    command = [*program(), "-n", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.slow
def test_frames_that_are_not_profibus_stay_as_they_were(tshark: Tshark, tmp_path: Path) -> None:
    """Their rows, and their trees below; of each link type in one capture with an interface for each."""
    path = tmp_path / "foreign.pcapng"
    with PcapngWriter(path, link_type=None) as writer:
        links = [writer.add_interface(link) for link in (PROFIBUS_DL, 300, USER0)]
        for number, (interface, data) in enumerate(product(links, FOREIGN)):
            writer.write(number * 1_000_000, data, interface=interface)
    plain, rows_alone = (without_plugin(tmp_path, "-r", path, *form) for form in (("-P", "-V"), ()))
    assert plain.count("\nFrame ") + plain.startswith("Frame ") >= len(links) * len(FOREIGN)
    for options in ((), ON):
        for passes in ((), COMPLETE):
            found = tshark("-r", path, *options, *passes, "-P", "-V")
            named = found.replace("[Protocols in frame: ds47_profibus:", "[Protocols in frame: ")
            assert named == plain
        assert tshark("-r", path, *options) == rows_alone  # here nobody asks for a tree


@pytest.mark.slow
def test_user0_is_taken_by_preference_alone(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path / "line.pcap", shots(request()), USER0)
    assert tshark("-r", path, "-Y", "ds47 || ds47_profibus") == ""
    assert tshark("-r", path) == without_plugin(tmp_path, "-r", path)
    assert len(tshark("-r", path, *ON, "-Y", "ds47_profibus").splitlines()) == len(shots(request()))


def test_the_profile_takes_user0(tshark: Tshark, tmp_path: Path) -> None:
    profile = tmp_path / "wireshark" / "profiles" / "DS47"
    shutil.copytree(ROOT / "dissector" / "profile", profile)
    path = saved(tmp_path / "line.pcap", shots(request()), USER0)
    found = tshark("-r", path, "-C", "DS47", "-Y", "ds47_profibus", *columns("frame.number"))
    assert len(found.split()) == len(shots(request()))


@pytest.mark.parametrize("options", [(), ON])
def test_a_mapping_of_the_user_stays(
    options: tuple[str, ...], tshark: Tshark, tmp_path: Path
) -> None:
    """Of frames that are not PROFIBUS even where USER0 is taken; a broken one is no Lua error."""
    frames = (ETHERNET, ETHERNET[:20], b"\1", ETHERNET)
    path = saved(tmp_path / "mapped.pcap", frames, USER0)
    found = tshark("-o", MAPPED, *options, "-r", path)
    assert found == without_plugin(tmp_path, "-o", MAPPED, "-r", path)
    assert found.count("Who has 192.168.0.2?") == 2


TOGGLE = """
local taken = require("ds47_ws.encapsulations")
local table, proto = DissectorTable.get("wtap_encap"), Proto("toggled", "TOGGLED")
function proto.dissector() end
local function say() print("USER0 " .. tostring(table:get_dissector(45))) end
for _, with in ipairs({true, true, false, false, true}) do taken.register(proto, with) say() end
taken.register(proto, false) table:remove(45, Dissector.get("user_dlt")) say() -- as where plugins are loaded anew
taken.register(proto, true) say() taken.register(proto, false) say() taken.register(proto, true) say()
table:add(45, Dissector.get("data")) -- somebody else takes it
taken.register(proto, false) say()
"""


def test_user0_is_given_back(tshark: Tshark, tmp_path: Path) -> None:
    """While Wireshark runs: to who had it, and not where somebody else has taken it since."""
    script = tmp_path / "toggle.lua"
    script.write_text(TOGGLE)
    path = saved(tmp_path / "line.pcap", shots(request())[:1], USER0)
    found = tshark("-r", path, "-X", f"lua_script:{script}")
    names = [line.split()[1] for line in found.splitlines() if line.startswith("USER0 ")]
    assert names[:5] == ["TOGGLED", "TOGGLED", "DLT_USER", "DLT_USER", "TOGGLED"]
    assert names[5:] == ["nil", "TOGGLED", "DLT_USER", "TOGGLED", "Data"]


# What comes before the proof


def early() -> Master:
    """A line that begins with what proves nothing."""
    wire = Master()
    wire.short()
    wire.token()
    wire.exchange(3)
    wire.spoil()
    wire.stage.shots.pop(2)
    wire.start(3)
    return wire


def test_frames_before_the_proof_count_of_257(tshark: Tshark, tmp_path: Path) -> None:
    """They are shown once it is there: in a second pass, as when somebody looks at them."""
    path = saved(tmp_path / "line.pcapng", shots(early()))
    (found,) = [each.frame for each in compare(tshark, path).findings]
    shown = columns("frame.number")
    assert found == 3
    one = tshark("-r", path, "-Y", "ds47_profibus", *shown).split()
    two = tshark("-r", path, *COMPLETE, "-Y", "ds47_profibus", *shown).split()
    assert (one, two) == (list(map(str, range(4, 12))), list(map(str, range(1, 12))))


@pytest.mark.slow
def test_of_user0_they_do_not(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path / "line.pcap", shots(early()), USER0)
    assert compare(tshark, path, *ON).findings == []
    for passes in ((), COMPLETE):
        shown = tshark("-r", path, *ON, *passes, "-Y", "ds47_profibus", *columns("frame.number"))
        assert shown.split() == list(map(str, range(4, 12)))


# Words of a PPO, and all of the line in other words


@pytest.mark.slow
def test_words_stand_in_each_frame(tshark: Tshark, tmp_path: Path) -> None:
    """STW1 and ZSW1 of a drive behind PKW, whether they changed or not; PKW that stands is text."""
    path = on_profibus("start-and-stop", tmp_path)
    names = (
        "frame.number",
        "ds47.pzd.stw1",
        "ds47.pzd.zsw1",
        "ds47.profibus.outputs",
        "ds47.profibus.inputs",
    )
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd", *columns(*names)))
    assert len(found) > 100
    for number, stw1, zsw1, outputs, inputs in found:
        data = (outputs or inputs).replace(":", "")
        assert int(stw1 or zsw1, 16) == int(data[16:20], 16), number
        assert bool(stw1) == bool(outputs)
    text = tshark("-r", path, *COMPLETE, "-Y", f"frame.number == {found[40][0]}", "-V")
    assert "DS47 PKW request: " in text
    one = rows(tshark("-r", path, "-Y", "ds47.pzd", *columns("frame.number")))
    assert len(found) - 5 < len(one) <= len(found)


def test_a_ppo_that_is_named(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "running.pcapng"
    path.write_bytes(test_profibus_ppo.running())
    wanted = analyze(path, AnalysisOptions(ppos=((3, 1),))).timelines[0].events
    names = ("-Y", "ds47.pzd.event", *columns("ds47.pzd.event.name"))
    found = tshark("-r", path, "-o", "ds47.ppos:3=ppo1", *COMPLETE, *names).split()
    assert ",".join(found).split(",") == [str(EVENTS[each.name]) for each in wanted]
    assert tshark("-r", path, *COMPLETE, *names) == ""


@pytest.mark.slow
def test_each_text_tells_of_a_line(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path / "line.pcapng", shots(test_profibus_bus.everything_wrong()))
    for kind in ("report", "statistics", "csv", "drives"):
        assert tshark("-q", "-X", f"lua_script1:{kind}", "-r", path)


# Hostile bytes


def hostile(chance: random.Random) -> Iterator[bytes]:
    """Frames by chance, among them some whose head says that they are long or carry everything."""
    yield shots(request())[0][1]
    heads = (b"", b"\x68\x09\x09\x68\x83\x82\x5d", b"\x10", b"\xa2\x83\x82\x7d", b"\xdc", b"\xe5")
    known = [data for _, data in shots(request())]
    for _ in range(1500):
        data = bytearray(chance.choice(known))
        for _ in range(chance.randrange(4)):
            data[chance.randrange(len(data))] = chance.randrange(256)
        cut = bytes(data[: chance.randrange(1, len(data) + 1)])
        yield chance.choice((cut, bytes(data), b"\0" + chance.choice(heads) + chance.randbytes(30)))
        yield chance.choice(heads) + chance.randbytes(chance.choice((0, 1, 3, 8, 40, 300)))


@pytest.mark.slow
def test_no_bytes_stop_it(tshark: Tshark, tmp_path: Path) -> None:
    """The runner fails where Lua does."""
    frames = [each for seed in range(3) for each in hostile(random.Random(seed))]
    path = saved(tmp_path / "hostile.pcapng", frames)
    assert tshark("-r", path, "-V", "-O", "ds47,ds47_profibus").count("PROFIBUS DP") == 3 * 3001
    compare(tshark, path)


def test_a_recording_that_kept_the_begin_of_its_frames(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "short.pcapng"
    with PcapngWriter(path, link_type=PROFIBUS_DL) as writer:
        for number, (time_ns, data) in enumerate(shots(request())):
            writer.write(time_ns, data[: 7 if number % 5 == 4 else 99], len(data))
    assert compare(tshark, path).bus is not None
