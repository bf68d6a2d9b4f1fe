"""Control and status words in a real tshark: what the plugin shows in each frame is what stands there.

Words are read here once more, from the bytes of the frames; states and events are those of the analyzer.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import beside
import pytest
from many_filters import many
from test_cyclic_scenes import SCENES, capture
from test_lua_pzd import NAMES, without_connect
from test_wireshark_plugin import CAPTURES, COMPLETE, Tshark, columns, rows, tshark

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.cyclic import pzd
from ds47.cyclic.named import parse
from ds47.model import CaptureResult, Event, Relation, Side
from ds47.spec import codes, cyclic

__all__ = ["tshark"]  # the fixture
STORIES = tuple(name for name in CAPTURES if name.startswith("cyclic-"))
QUICK = ("every-event", "fault-with-number", "controller-invalid")
STORY = CAPTURES["cyclic-does-not-start.pcapng"]
HEEDED, REVERSE = 10, 11
PDML = ("-T", "pdml")
EVENT = (
    "frame.number", "ds47.pzd.event", "ds47.pzd.event.name", "ds47.pzd.event.word", "ds47.pzd.event.before",
    "ds47.pzd.event.after", "ds47.pzd.event.state", "ds47.pzd.event.overlays", "ds47.device", "ds47.slot",
)  # fmt: skip


def scene(name: str, folder: Path) -> Path:
    path = folder / f"{name}.pcapng"
    path.write_bytes(capture(SCENES[name]))
    return path


# Events


def joined(values: list[object]) -> str:
    return ",".join(str(each) for each in values if each is not None)


def word(value: int | None) -> str | None:
    return None if value is None else f"0x{value:04x}"


def row(frame: int, events: list[tuple[Relation, Event]], lang: str = "en") -> list[str]:
    """What tshark prints of a frame with events: of each field the values of all of them."""
    told = [event for _, event in events]
    return [
        str(frame),
        joined([cyclic.event_text(each.name, lang) for each in told]),
        joined([codes.codes("events")[each.name] for each in told]),
        joined([codes.codes("drive_words")[each.word] for each in told if each.word]),
        joined([word(each.before) for each in told]),
        joined([word(each.after) for each in told]),
        joined([codes.codes("drive_states")[each.state] for each in told if each.state]),
        joined([" ".join(each.overlays) or None for each in told]),
        joined([relation.device for relation, _ in events]),
        joined([f"0x{relation.slot:04x}" for relation, _ in events]),
    ]


def events_of(result: CaptureResult, lang: str = "en") -> list[list[str]]:
    frames: dict[int, list[tuple[Relation, Event]]] = {}
    for timeline in result.timelines:
        for event in timeline.events:
            told = result.relations[timeline.relation - 1], event
            frames.setdefault(event.frame, []).append(told)
    return [row(frame, frames[frame], lang) for frame in sorted(frames)]


def shown_events(tshark: Tshark, path: Path, *options: str) -> list[list[str]]:
    return as_told(rows(tshark("-r", path, *options, "-Y", "ds47.pzd.event", *columns(*EVENT))))


def as_told(found: list[list[str]]) -> list[list[str]]:
    """Numbers as `row` writes them."""
    return [
        [re.sub(r"\b0x0000([0-9a-f]{4})\b", r"0x\1", cell) for cell in with_hex_slots(each)] for each in found
    ]  # fmt: skip


def with_hex_slots(cells: list[str]) -> list[str]:
    """Slots as hexadecimal numbers: fields with both bases are printed as decimal ones."""
    slots = ",".join(f"0x{int(each, 0):04x}" for each in cells[-1].split(","))
    return [*cells[:-1], slots]


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_a_filter_finds_the_events_of_the_analyzer(name: str, tshark: Tshark) -> None:
    wanted = events_of(analyze(CAPTURES[name]))
    assert len(wanted) >= 8
    assert shown_events(tshark, CAPTURES[name], *COMPLETE) == wanted
    assert shown_events(tshark, CAPTURES[name], "-2") == wanted


@pytest.mark.parametrize("name", STORIES)
def test_one_pass_shows_events_from_the_proof_on(name: str, tshark: Tshark) -> None:
    """Those of frames in which the drive was not proven yet are missing, and no others."""
    wanted = events_of(analyze(CAPTURES[name]))
    found = shown_events(tshark, CAPTURES[name])
    assert found == wanted[-len(found) :]
    assert len(wanted) - len(found) <= 2


def test_events_have_words_of_both_languages(tshark: Tshark) -> None:
    result = analyze(STORY)
    shown = shown_events(tshark, STORY, *COMPLETE, "-o", "ds47.language:zh")
    assert shown == events_of(result, "zh") != events_of(result)


@pytest.mark.slow
def test_events_are_expert_infos_and_faults_are_warnings(tshark: Tshark, tmp_path: Path) -> None:
    path = scene("fault", tmp_path)
    for name, severity in (("fault", "Warning"), ("running", "Chat")):
        text = tshark("-r", path, *COMPLETE, "-Y", f'ds47.pzd.event.name == "{name}"', "-V")
        assert f"[Severity level: {severity}]" in text.split("DS47 PZD")[1]
    faults = tshark("-r", path, *COMPLETE, "-Y", "ds47.expert.pzd.fault").splitlines()
    assert len(faults) == 1
    assert "fault" in tshark("-r", path, "-q", "-z", "expert,warn")


@pytest.mark.slow
def test_a_finding_about_a_drive_of_another_maker_is_a_note(tshark: Tshark, tmp_path: Path) -> None:
    for name, shown in (
        ("fault", "ds47.expert.ds520"),
        (
            "fault-of-another-maker",
            '_ws.expert.severity == "Note" && _ws.expert.message contains "DS520 "',
        ),
    ):
        path = scene(name, tmp_path)
        filters = 'ds47.finding == "DS520"', shown, "ds47.finding.severity == 1"
        told = many(tshark, tmp_path, filters, *COMPLETE, "-r", path)
        found, expert, note = (told[each] for each in filters)
        assert found == expert
        assert set(found) <= set(note) if "another" in name else not set(found) & set(note)
        assert isinstance(found, list)
        assert found


def test_the_info_column_tells_events(tshark: Tshark) -> None:
    lines = tshark("-r", STORY, *COMPLETE, "-Y", "ds47.pzd.event").splitlines()
    told = [line.split(" DS47 ", 1)[1].split(" ", 1)[1] for line in lines]
    assert told == [
        "PZD first seen (STW1 047F)",
        "PZD first seen (ZSW1 FB40): S1 switching on inhibited, OFF2 active, OFF3 active",
        "PZD OFF2 no longer active, OFF3 no longer active (ZSW1 FB40 -> FB70): S1 switching on inhibited",
        "PZD OFF1 (STW1 047F -> 047E)",
        "PZD switching on no longer inhibited (ZSW1 FB70 -> FB31): S2 ready to switch on",
        "PZD ON (STW1 047E -> 047F)",
        "PZD ready (ZSW1 FB31 -> FB33): S3 switched on",
        "PZD running (ZSW1 FB33 -> FB37): S4 operation enabled",
    ]


def test_frames_of_drives_are_none_of_the_parameter_channel(tshark: Tshark) -> None:
    """Findings are: DS523 stands on the first of its frames."""
    found = rows(tshark("-r", STORY, *COMPLETE, "-Y", "ds47", *columns("ds47.finding")))
    assert found == [[each.rule] for each in analyze(STORY).findings]


# Words


@dataclass(frozen=True)
class Said:
    """What one direction of a drive says in a frame."""

    frame: int
    sent: bool
    data: bytes
    at: int
    """Where it begins in the frame."""
    valid: bool

    @property
    def word(self) -> int:
        return int.from_bytes(self.data[:2])


def said(path: Path, relation: Relation) -> list[Said]:
    """The words of a drive, read from the frames behind its Connect."""
    found = []
    with open_capture(path) as source:
        for number, frame in enumerate(source.everything(), 1):
            if frame.data[12:14] != b"\x88\x92" or number <= (relation.frame or 0):
                continue
            for side in (relation.output, relation.input):
                if int.from_bytes(frame.data[14:16]) == side.frame_id:
                    found.append(told(number, frame.data, side, side is relation.output))
    return found


def told(number: int, frame: bytes, side: Side, sent: bool) -> Said:
    at = 16 + side.offset
    valid = (
        frame[-2] & 4 == 4 and frame[at + side.length] >= 0x80
    )  # the padding has the length of the lab's data
    return Said(number, sent, frame[at : at + side.length], at, valid)


def percent(each: Said) -> float | None:
    if not each.valid:
        return None
    share = int.from_bytes(each.data[2:4], signed=True) / 16384 * 100
    return -share if each.sent and each.word >> REVERSE & 1 else share


def states(words: list[Said]) -> dict[int, str | None]:
    """The state in each frame of the drive; None where its data is not valid."""
    found: dict[int, str | None] = {}
    heeded = None
    for each in words:
        if each.sent:
            heeded = each.word if each.valid and each.word >> HEEDED & 1 else heeded
            continue
        status = pzd.state(each.word, heeded)
        code = str(codes.codes("drive_states")[status.state])
        found[each.frame] = code if each.valid else None
    return found


WORDS = (
    "frame.number", "ds47.pzd.stw1", "ds47.pzd.zsw1", "ds47.pzd.state", "ds47.pzd.setpoint",
    "ds47.pzd.actual", "ds47.pzd.stw1.on", "ds47.pzd.zsw1.alarm", "ds47.pzd.setpoint.raw",
)  # fmt: skip


def compare_words(shown: list[list[str]], path: Path, result: CaptureResult) -> int:
    """How many frames have words; fails where one shows something else."""
    (relation,) = [each for each in result.relations if each.channel == "pzd"]
    words = said(path, relation)
    state = states(words)
    assert [int(each[0]) for each in shown] == [each.frame for each in words]
    for cells, each in zip(shown, words, strict=True):
        value, raw = percent(each), int.from_bytes(each.data[2:4], signed=True)
        number = "" if value is None else f"{value:.3f}"
        own = [float(cell) for cell in (cells[4], cells[5]) if cell]
        assert [f"{each:.3f}" for each in own] == ([number] if number else []), each
        assert int(cells[1] or cells[2], 16) == each.word
        assert (cells[1] != "") == each.sent == (cells[2] == "")
        assert (cells[3] or None) == (None if each.sent else state[each.frame])
        assert truth(cells[6]) == (each.word & 1 if each.sent else None)
        assert truth(cells[7]) == (None if each.sent else each.word >> 7 & 1)
        assert cells[8] == (str(raw) if each.sent else "")
    return len(words)


def truth(cell: str) -> int | None:
    """A boolean field: `1` or `True`, as the version has it."""
    return None if cell == "" else int(cell in ("1", "True"))


@pytest.mark.slow
@pytest.mark.parametrize("name", STORIES)
def test_words_of_each_frame(name: str, tshark: Tshark) -> None:
    path = CAPTURES[name]
    shown = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd", *columns(*WORDS)))
    assert compare_words(shown, path, analyze(path)) > 100


def words_and_events(tshark: Tshark, path: Path) -> list[list[str]]:
    """The rows of all frames that have either."""
    shown = columns(*WORDS, "ds47.pzd", *EVENT[1:])  # which begins with the same column
    return rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd || ds47.pzd.event", *shown))


def compare_both(found: list[list[str]], path: Path) -> None:
    result, at, behind = analyze(path), len(WORDS), len(WORDS) + 1
    words = [cells[:at] for cells in found if cells[at]]
    events = [[cells[0], *cells[behind:]] for cells in found if cells[behind]]
    assert compare_words(words, path, result) > 20
    assert as_told(events) == events_of(result)


@pytest.mark.parametrize("name", QUICK)
def test_words_and_events_of_a_scene(name: str, tshark: Tshark, tmp_path: Path) -> None:
    path = scene(name, tmp_path)
    compare_both(words_and_events(tshark, path), path)


@pytest.mark.slow
def test_words_and_events_of_scenes_beside_each_other(tshark: Tshark, tmp_path: Path) -> None:
    """Their drives have the same frame ids, and other addresses."""
    captures = {name: capture(scene) for name, scene in SCENES.items()}
    whole = beside.beside(captures)
    path = tmp_path / "beside.pcapng"
    path.write_bytes(whole.content)
    found: dict[str, list[list[str]]] = {name: [] for name in captures}
    for cells in words_and_events(tshark, path):
        name, number = whole.owners[int(cells[0]) - 1]
        *rest, devices, slots = cells[1:]
        told = ",".join(whole.addresses.get(each, each) for each in devices.split(","))
        found[name].append([str(number), *rest, told, slots])
    for name, cells_of in found.items():
        compare_both(cells_of, scene(name, tmp_path))


@pytest.mark.slow
def test_one_pass_shows_words_from_the_proof_on(tshark: Tshark) -> None:
    shown = columns(*WORDS)
    whole = rows(tshark("-r", STORY, *COMPLETE, "-Y", "ds47.pzd", *shown))
    found = rows(tshark("-r", STORY, "-Y", "ds47.pzd", *shown))
    assert len(whole) - 10 < len(found) < len(whole)
    assert found == whole[-len(found) :]


def test_values_are_the_points_of_the_analyzer(tshark: Tshark) -> None:
    """The analyzer keeps those of the frames that it looks at; percent there is 16384 here."""
    (timeline,) = analyze(STORY).timelines
    shown = columns("frame.time_epoch", "ds47.pzd.setpoint", "ds47.pzd.actual")
    values: tuple[dict[str, float], dict[str, float]] = ({}, {})
    for time, *cells in rows(tshark("-r", STORY, *COMPLETE, "-Y", "ds47.pzd", *shown)):
        for kind, cell in zip(values, cells, strict=True):
            if cell:
                kind[time] = float(cell)
    for kind, points in zip(values, (timeline.setpoint, timeline.actual), strict=True):
        assert len(points) > 40
        for point in points:
            time = f"{point.time_ns // 10**9}.{point.time_ns % 10**9:09d}"
            assert kind[time] == pytest.approx(point.least / 163.84)


@pytest.mark.slow
def test_fields_stand_at_the_bytes_that_the_built_in_shows(tshark: Tshark) -> None:
    for frame, name in ((627, "stw1"), (842, "zsw1")):
        text = tshark("-r", STORY, *COMPLETE, "-Y", f"frame.number == {frame}", *PDML)
        place = {
            key: re.search(rf'<field name="{key}"[^>]* size="(\d+)" pos="(\d+)"[^>]* value="(\w+)"', text)
            for key in ("pn.user_data", "ds47.pzd", f"ds47.pzd.{name}")
        }  # fmt: skip
        data, root, own = place.values()
        assert data, "the built-in knows the data of the submodule"
        assert root
        assert own
        assert root.groups() == data.groups()
        assert own.groups() == ("2", data[2], data[3][:4])


@pytest.mark.slow
def test_each_bit_has_its_words(tshark: Tshark) -> None:
    for lang in ("en", "zh"):
        text = tshark(
            "-r", STORY, *COMPLETE, "-Y", "frame.number == 842", "-o", f"ds47.language:{lang}", "-V"
        )
        shown = re.findall(r"^ *([.01 ]{19}) = ZSW1 bit (\d+): (.*)$", text, re.MULTILINE)
        assert [int(number) for _, number, _ in shown] == list(range(16))
        for bit, (picture, _, told) in zip(cyclic.bits("zsw1"), shown, strict=True):
            value = 0xFB37 >> bit.bit & 1
            assert picture.replace(" ", "")[15 - bit.bit] == str(value)
            assert told == (bit.said(0xFB37, lang) or str(value))


def test_bits_that_a_maker_is_free_to_use_have_no_words_of_siemens(
    tshark: Tshark, tmp_path: Path
) -> None:
    path = scene("fault-of-another-maker", tmp_path)
    for lang, own in (("en", "see the manual of the drive"), ("zh", "见驱动器手册")):
        text = tshark(
            "-r",
            path,
            *COMPLETE,
            "-Y",
            "ds47.pzd.zsw1 == 0xfb31",
            "-o",
            f"ds47.language:{lang}",
            "-V",
        )
        shown = re.findall(r"^ *[.01 ]{19} = ZSW1 bit (\d+): (.*)$", text, re.MULTILINE)[:16]
        words = [
            bit.said(0xFB31, lang) or str(0xFB31 >> bit.bit & 1) for bit in cyclic.bits("zsw1")
        ]
        assert shown == [(str(bit), told) for bit, told in enumerate([*words[:11], *[own] * 5])]


@pytest.mark.slow
def test_the_words_of_the_only_telegram(tshark: Tshark, tmp_path: Path) -> None:
    """Telegram 352 has the number of the fault."""
    path = scene("fault-with-number", tmp_path)
    assert [each.telegrams for each in analyze(path).relations] == [[352]]
    (number,) = {
        each[0]
        for each in rows(
            tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.word.fault_code > 0",
                   *columns("ds47.pzd.word.fault_code"))
        )
    }  # fmt: skip
    assert int(number, 0) == 30002
    telegrams = tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.telegram == 352").splitlines()
    assert len(telegrams) == len(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd").splitlines())


def test_data_that_is_not_valid_has_neither_state_nor_values(
    tshark: Tshark, tmp_path: Path
) -> None:
    path = scene("controller-invalid", tmp_path)
    text = tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.stw1 && !ds47.pzd.setpoint", "-V")
    assert "data not valid" in text


def test_pkw_and_pzd_stand_in_one_frame(tshark: Tshark, tmp_path: Path) -> None:
    path = scene("start-and-stop", tmp_path)
    both = tshark("-r", path, *COMPLETE, "-Y", "ds47.pkw && ds47.pzd", "-V")
    assert "DS47 p1082[0], PKW read request" in both
    assert "DS47 PZD: STW1 16#047F" in both


@pytest.mark.slow
def test_tagged_and_cut_frames(tshark: Tshark, tmp_path: Path) -> None:
    """A VLAN tag moves the words by four bytes; a frame that the capture cut has none."""
    target = io.BytesIO()
    with open_capture(STORY) as source, PcapngWriter(target) as writer:
        for number, frame in enumerate(source.everything(), 1):
            data, length = frame.data, frame.original_length
            if data[12:14] == b"\x88\x92":
                data, length = data[:12] + b"\x81\0\xc0\0" + data[12:], length + 4
                data = data[:23] if number % 50 == 0 else data
            writer.write(frame.time_ns, data, length)
    path = tmp_path / "tagged.pcapng"
    path.write_bytes(target.getvalue())
    result = analyze(path)
    assert shown_events(tshark, path, *COMPLETE) == events_of(result) != []
    shown = columns("frame.number", "ds47.pzd.stw1", "ds47.pzd.zsw1")
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd", *shown))
    plain = rows(tshark("-r", STORY, *COMPLETE, "-Y", "ds47.pzd", *shown))
    assert found == [each for each in plain if int(each[0]) % 50]
    text = tshark("-r", path, *COMPLETE, "-Y", "frame.number == 842", *PDML)
    assert re.search(r'name="ds47.pzd.zsw1"[^>]* size="2" pos="20"', text)


def test_a_graph_of_setpoint_and_actual_value(tshark: Tshark) -> None:
    """What the profile draws, as a table: the drive stands first, and runs up to its setpoint at the end."""
    fields = [f"AVG({each}){each}" for each in ("ds47.pzd.setpoint", "ds47.pzd.actual")]
    text = tshark("-r", STORY, "-q", "-z", f"io,stat,0.5,{','.join(fields)}")
    found = re.findall(r"<> +\S+ +\| +(\S+) \| +(\S+) \|", text)
    assert {setpoint for setpoint, _ in found} == {"59.997559"}
    assert (float(found[0][1]), float(found[-1][1])) == (0, pytest.approx(60, abs=2))


@pytest.mark.slow
def test_the_window_of_drives(tshark: Tshark) -> None:
    text = tshark("-q", "-X", "lua_script1:drives", "-r", STORY)
    lines = text.splitlines()
    assert lines[0] == "Drives: control and status word"
    assert lines[2] == "192.168.133.33 slot 2.2, telegram 1: 9 events"
    assert lines[-1] == ("                                            enabled")
    assert lines[-2] == "  08:00:06.706      842  ZSW1 FB33 -> FB37  running: S4 operation"
    assert lines[4] == "  2026-01-01"
    assert max(map(len, lines)) <= 72  # as wide as the window
    told = [line.split() for line in lines[5:] if line.startswith("  0")]
    assert [each[1] for each in told] == [each[0] for each in events_of(analyze(STORY))]
    assert "运行：" in tshark(
        "-q", "-X", "lua_script1:drives", "-X", "lua_script1:lang=zh", "-r", STORY
    )
    none = tshark("-q", "-X", "lua_script1:drives", "-r", CAPTURES["tour-machine.pcapng"])
    assert none.splitlines()[1] == "The cyclic frames of this capture show no drive."


@pytest.mark.slow
def test_graphs_of_the_profile(tshark: Tshark, tmp_path: Path) -> None:
    """Eight values in each line: 3.4 takes no more, later ones fewer. One bad line, and none is taken."""
    folder = Path(__file__).parents[2] / "dissector/profile"
    lines = (folder / "io_graphs").read_text(encoding="ascii").splitlines()
    lines = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r'"[^"]*"(,"[^"]*"){7}', line) for line in lines)
    graphs = [re.findall(r'"([^"]*)"', line) for line in lines]
    assert {each[0] for each in graphs} <= {"Enabled", "Disabled"}
    shown = [each[6] for each in graphs if each[0] == "Enabled"]
    assert shown == ["ds47.duration_ms", "ds47.pzd.setpoint", "ds47.pzd.actual"]
    filters: dict[Path, list[str]] = {STORY: [], CAPTURES["tour-machine.pcapng"]: []}
    for _, name, asked, _, style, axis, field, _ in graphs:
        assert name
        assert style in {"Line", "Dot", "Impulse"}
        assert axis in {"MAX(Y Field)", "AVG(Y Field)", "Packets"}
        assert (axis == "Packets") == (not field)
        wanted = " && ".join(each.replace("\\x22", '"') for each in (asked, field) if each)
        path = STORY if "pzd" in field else CAPTURES["tour-machine.pcapng"]
        filters[path].append(wanted or "frame")
    for path, wanted_there in filters.items():
        assert wanted_there
        found = many(tshark, tmp_path, wanted_there, *COMPLETE, "-r", path)
        assert all(isinstance(frames, list) and frames for frames in found.values()), found


@pytest.mark.slow
@pytest.mark.parametrize("ways", [(), ("-2",)])
def test_a_drive_that_is_named_by_hand(
    ways: tuple[str, ...], tshark: Tshark, tmp_path: Path
) -> None:
    """Without its Connect: the same events as the analyzer tells, and no slot."""
    path = tmp_path / "named.pcapng"
    path.write_bytes(without_connect().getvalue())
    names = tuple(map(parse, NAMES))
    wanted = [
        str(event.frame)
        for event in analyze(path, AnalysisOptions(cyclic=names)).timelines[0].events
    ]
    shown = tshark(
        "-o", "ds47.cyclic:" + " ".join(NAMES), *ways, "-r", path, "-Y", "ds47.pzd.event",
        *columns("frame.number", "ds47.slot"),
    )  # fmt: skip
    assert rows(shown) == [[frame, ""] for frame in dict.fromkeys(wanted)]
    device = "00:1f:f8:00:00:01"
    found = tshark(
        "-o", "ds47.cyclic:" + " ".join(NAMES), "-2", "-r", path, "-Y", f"ds47.device.mac == {device}",
        *columns("frame.number", "ds47.device", "ds47.device.mac"),
    )  # fmt: skip
    assert {each[1] for each in rows(found)} == {""}
    assert {mac for each in rows(found) for mac in each[2].split(",")} == {device}
    assert tshark("-r", path, "-Y", "ds47") == ""
