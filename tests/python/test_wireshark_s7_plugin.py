"""S7 communication in a real tshark: jobs, links, split areas and findings of the plugin are the analyzer's.

What Wireshark's own dissector makes of the same captures is compared in test_wireshark_s7.py.
"""

from __future__ import annotations

from collections import defaultdict
from datetime import UTC
from decimal import Decimal
from pathlib import Path

import pytest
import s7_segments as s7
from frames import pcap
from shares import parts, share
from test_lua_s7_scenes import scenes
from test_wireshark_plugin import COMPLETE, Tshark, columns, rows, tshark

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.model import CaptureResult, Report, Transaction
from ds47.report import Options
from ds47.report import s7 as words
from ds47.report import text as text_report
from ds47.report.zones import Zone
from ds47.s7.choices import Choices
from ds47.spec import codes
from ds47.spec import s7 as spec_s7

__all__ = ["tshark"]  # the fixture
ROOT = Path(__file__).resolve().parents[2]
BESIDE = ROOT.parent / "shared" / "captures" / "s7"
CAPTURES = sorted((
    *(ROOT / "captures").glob("s7-*.pcapng"), *(ROOT / "captures" / "s7-stacks").glob("*.pcapng"),
    *BESIDE.glob("*.pcap*"),
))  # fmt: skip
SHOWN = (
    "frame.number", "ds47.transaction", "ds47.channel", "ds47.operation", "ds47.state", "ds47.controller",
    "ds47.device", "ds47.s7.request_in", "ds47.s7.response_in", "ds47.s7.time", "ds47.s7.connection",
    "ds47.s7.reference", "ds47.s7.item", "ds47.s7.area",
)  # fmt: skip
TOLD = ("frame.number", "ds47.s7.r_id", "ds47.s7.segments", "ds47.s7.total", "ds47.s7.error")
Row = tuple[str, ...]


def frames_of(item: Transaction) -> dict[int, str]:
    """The frames of a job, and what each of them is."""
    found: dict[int, str] = {}
    for request, response in item.segments:
        for frame in (request, response):
            if frame is not None:
                found[frame] = "part"
    if item.frames.read_response is not None:
        found[item.frames.read_response] = "response"
    if item.frames.write_request is not None:
        found[item.frames.write_request] = "request"
    return found


def seconds(item: Transaction) -> str:
    return "" if item.duration_ns is None else str(Decimal(item.duration_ns) / 10**9)


def expected(result: CaptureResult) -> dict[int, list[Row]]:
    """What each frame shows, in the order of the jobs."""
    found: dict[int, list[Row]] = defaultdict(list)
    for item in result.transactions:
        for frame, role in frames_of(item).items():
            request = "" if role == "request" else str(item.frames.write_request or "")
            response = "" if role == "response" else str(item.frames.read_response or "")
            found[frame].append((
                str(item.id), str(codes.codes("channels")["s7"]), str(codes.codes("operations")[item.operation]),
                str(codes.codes("states")[item.state]), item.controller, item.device, request, response,
                seconds(item), str(item.connection), str(item.request_reference),
                *words.parts(item), *(each.address for each in item.items if each.address),
            ))  # fmt: skip
    return found


def told(result: CaptureResult) -> dict[int, list[str]]:
    """The rules of the findings of S7 by their frames."""
    found: dict[int, list[str]] = defaultdict(list)
    for each in result.findings:
        found[each.frame].append(each.rule)
    return found


def shown(line: list[str]) -> list[str]:
    """The values of a frame, whatever jobs it has; a time without the zeros at its end."""
    values = [part for cell in line for part in cell.split("\x1f") if part]
    return sorted(values)


def flat(found: list[Row]) -> list[str]:
    return sorted(cell for row in found for cell in row if cell)


def short(cells: list[str]) -> list[str]:
    """Times as numbers: tshark prints nine digits."""
    return [str(Decimal(cell).normalize()) if _is_time(cell) else cell for cell in cells]


def _is_time(cell: str) -> bool:
    whole, dot, rest = cell.partition(".")
    return bool(dot) and whole.lstrip("-").isdecimal() and rest.isdecimal()


def compare(tshark: Tshark, path: Path, *options: str) -> int:
    """How many frames have a job; fails where one does not show what the analyzer says."""
    wanted = expected(analyze(path))
    output = tshark("-r", path, *options, *columns(*SHOWN), "-E", "aggregator=\x1f")
    there = {int(line[0]): line[1:] for line in rows(output)}
    for frame, line in there.items():
        assert sorted(short(shown(line))) == sorted(short(flat(wanted.get(frame, [])))), (
            path.name, frame,
        )  # fmt: skip
    assert set(wanted) <= set(there)
    return len(wanted)


@pytest.mark.slow
def test_every_capture_shows_the_jobs_of_the_analyzer(tshark: Tshark) -> None:
    assert len(CAPTURES) > 40
    assert sum(compare(tshark, path, *COMPLETE) for path in share(CAPTURES)) > 1000 // (2 * parts())


@pytest.mark.slow
def test_scenes_by_chance_show_the_jobs_of_the_analyzer(tshark: Tshark, tmp_path: Path) -> None:
    """With segments that are lost, doubled, late, out of order and damaged, and clocks that jump."""
    path, found = tmp_path / "scene.pcap", 0
    for scene in share(scenes()[1::3]):
        path.write_bytes(scene.content)
        found += compare(tshark, path, *COMPLETE)
        compare(tshark, path, "-2", "-Y", "frame")
    assert found > 500 // (2 * parts())


@pytest.mark.slow
def test_every_finding_is_an_expert_info_on_its_frame(tshark: Tshark) -> None:
    for path in share(CAPTURES):
        wanted = told(analyze(path))
        output = tshark("-r", path, *COMPLETE, "-Y", "ds47.finding",
                        *columns("frame.number", "ds47.finding", "_ws.expert.message"))  # fmt: skip
        there = {int(line[0]): (line[1].split(","), line[2]) for line in rows(output)}
        assert {frame: sorted(rules) for frame, (rules, _) in there.items()} == {
            frame: sorted(rules) for frame, rules in wanted.items()
        }, path.name
        assert all(message for _, message in there.values())


def test_one_pass_shows_what_earlier_frames_prove(tshark: Tshark) -> None:
    """No answer before it is there, and no state of a job that is open."""
    path = ROOT / "captures" / "s7-stacks" / "torn_cpp_pure_cpp.pcapng"
    names = (
        "frame.number",
        "ds47.state",
        "ds47.s7.request_in",
        "ds47.s7.response_in",
        "ds47.s7.area",
    )
    found = rows(tshark("-r", path, "-Y", "ds47_s7", *columns(*names)))
    asked, answered = found[0], found[1]
    assert asked == ["20", "", "", "", "DB1.DBB0..461"]
    assert answered == ["21", str(codes.codes("states")["ok"]), "20", "", "DB1.DBB0..461"]


def test_a_split_area_says_its_parts_and_the_bytes_that_were_not_there_together(
    tshark: Tshark,
) -> None:
    path = ROOT / "captures" / "s7-stacks" / "torn_cpp_pure_cpp.pcapng"
    names = (
        "frame.number",
        "ds47.s7.whole",
        "ds47.s7.parts",
        "ds47.s7.part",
        "ds47.s7.inconsistent",
    )
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.s7.parts", *columns(*names)))
    (mixed,) = [each for each in analyze(path).findings if each.rule == "DS905"]
    args = mixed.args
    two = f"{args['first']} = 0x{args['first_value']:02X}, {args['second']} = 0x{args['second_value']:02X}"
    assert [row[:4] for row in found][-2:] == [
        ["29", "DB1.DBB0..599", "2", "2"],
        ["30", "DB1.DBB0..599", "2", "2"],
    ]
    assert {row[0]: row[4] for row in found if row[4]} == {str(mixed.frame): two}


def test_a_bsend_says_what_it_announces_and_its_segments(tshark: Tshark) -> None:
    path = ROOT / "captures" / "s7-stacks" / "bsend_cpp_cpp.pcapng"
    sent = [each for each in analyze(path).transactions if each.operation == "bsend"]
    names = (
        "ds47.transaction",
        "ds47.s7.r_id",
        "ds47.s7.total",
        "ds47.s7.segments",
        "ds47.s7.segment",
    )
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.s7.total", *columns(*names)))
    by_job = {row[0]: row[1:] for row in found}
    assert len(sent) > 5
    for item in sent:
        r_id, total, segments, frames = by_job[str(item.id)]
        value = item.items[0].value
        assert value is not None
        assert (int(r_id, 16), int(total)) == (item.r_id, len(value))
        assert int(segments) == len(item.segments)
        wanted = [str(frame) for pair in item.segments for frame in pair if frame]
        assert frames.split(",") == wanted


def other_port() -> bytes:
    talk = s7.Talk(server=("10.0.0.2", 1102)).opened()
    talk.ask(s7.get(7, s7.item(1, 0, 40)), s7.got(7, s7.entry(bytes(40))))
    return pcap(talk.frames())


def test_the_port_and_the_block_of_a_server_can_be_chosen(tshark: Tshark, tmp_path: Path) -> None:
    """As --s7-port and --s7-cpu; a word that means nothing is left out."""
    path = tmp_path / "port.pcap"
    path.write_bytes(other_port())
    asked = columns("frame.number", "ds47.s7.area", "ds47.finding")
    assert tshark("-r", path, *COMPLETE, "-Y", "ds47_s7", *asked) == ""
    chosen = ("-o", "ds47.s7_ports:1102 x 99999", "-o", "ds47.s7_cpus:10.0.0.2=s7-400 nonsense")
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47_s7", *chosen, *asked))
    choices = Choices(ports=(1102,), cpus=(("10.0.0.2", "s7-400"),))
    result = analyze(path, AnalysisOptions(s7=choices))
    assert [each.rule for each in result.findings] == ["DS903"]
    assert [row[1] for row in found] == ["DB1.DBB0..39"] * 2
    assert [row[2] for row in found if row[2]] == ["DS903"]


@pytest.mark.parametrize("ways", [(), ("-2",), COMPLETE])
def test_the_protocol_alone_is_a_filter(ways: tuple[str, ...], tshark: Tshark) -> None:
    path = ROOT / "captures" / "s7-stacks" / "errors_cpp_cpp.pcapng"
    frames = [
        row[0] for row in rows(tshark("-r", path, *ways, "-Y", "ds47_s7", *columns("frame.number")))
    ]
    with_field = tshark(
        "-r", path, *ways, "-Y", "ds47_s7 && ds47.channel", *columns("frame.number")
    )
    assert len(frames) == 14
    assert frames == [row[0] for row in rows(with_field)]


def test_the_statistics_have_a_row_for_each_connection(tshark: Tshark) -> None:
    path = ROOT / "captures" / "s7-stacks" / "torn_cpp_pure_cpp.pcapng"
    text = tshark("-r", path, "-X", "lua_script1:statistics", "-q")
    table = text.split("\n\nS7 communication\n")[1].splitlines()
    assert set(table[3].strip()) == {"-"}
    lines = iter(table[4:])  # three for each connection
    for item in analyze(path).connections:
        assert next(lines).split("  ")[1].strip() == words.ends(item)
        counts = [item.jobs, item.refused, item.unanswered, item.read_bytes, item.written_bytes]
        assert next(lines).split()[:5] == [f"{each:,}" for each in counts]
        assert next(lines).split()[0] == str(item.pdu_length)
    assert list(lines) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torn_cpp_pure_cpp", "bsend_cpp_cpp", "errors_cpp_cpp"])
def test_the_report_is_that_of_the_analyzer(name: str, tshark: Tshark, tmp_path: Path) -> None:
    path, report = ROOT / "captures" / "s7-stacks" / f"{name}.pcapng", tmp_path / "report.txt"
    tshark(
        "-r",
        path,
        "-X",
        f"lua_script1:report={report}",
        "-X",
        f"lua_script1:name={path.name}",
        "-q",
    )
    result = analyze(path)
    result.path = path.name
    with (tmp_path / "own.txt").open("w", encoding="utf-8") as stream:
        options = Options(rules=spec.rules(), zone=Zone("local", UTC))
        text_report.write(Report([result]), stream, options)
    assert report.read_text("utf-8") == (tmp_path / "own.txt").read_text("utf-8")


def test_codes_have_their_meaning_beside_them(tshark: Tshark) -> None:
    path = ROOT / "captures" / "s7-stacks" / "errors_cpp_pure.pcapng"
    tree = tshark("-2", "-r", path, "-V")
    for code in (0x05, 0x0A, 0xFF):
        meaning = spec_s7.code_text("return_code", code)
        assert f"[Return code: 0x{code:02x} ({meaning})]" in tree
    for word in (0x0000, 0x8404):
        meaning = spec_s7.error_text(word).removesuffix(f" ({word:04X})")
        assert f"[Error class and code: 0x{word:04x} ({meaning})]" in tree
