"""The Wireshark plugin in a real tshark: what it shows is what the analyzer reports.

`DS47_TSHARK` may name another tshark.
"""

from __future__ import annotations

import io
import os
import re
import subprocess
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import beside
import pytest
from fake_tshark import real_tshark
from many_filters import many
from of_profibus import of_ethernet
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab import message
from ds47.lab.client import Client
from ds47.lab.stage import Stage
from ds47.model import STATES, Finding
from ds47.profidrive.naming import element
from ds47.report.contract import FINDING, TRANSACTION
from ds47.report.html.views.findings import groups
from ds47.report.sentences import sentence
from ds47.spec import codes, formats, rules
from ds47.wireshark import fields

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "dissector/ds47.lua"
FOLDERS = (ROOT / "captures", ROOT.parent / "shared/captures/real-stacks")
CAPTURES = {
    path.name: path
    for folder in FOLDERS
    for path in of_ethernet(sorted(folder.rglob("*.pcap*")))
    if not path.name.startswith(("s7-", "s7connector", "lossy_nodes7"))
    and path.parent.name != "s7-stacks"
}
"""Neither those of PROFIBUS (test_wireshark_profibus.py) nor those of S7, of which the plugin shows nothing."""
WORKERS = 2
BROKEN = (
    "Lua Error", "Lua: Error", "Error during loading", "Error initializing protocols", "lua_tap_draw",
)  # fmt: skip
COMPLETE = ("-2", "-R", "frame")
PDML = (*COMPLETE, "-T", "pdml", "-J", "frame ds47")

Tshark = Callable[..., str]


@cache
def program() -> list[str]:
    """The command; skips where there is none, fails where CI promises one."""
    return [real_tshark()]


def crashes_alone(environment: dict[str, str], arguments: tuple[str | Path, ...]) -> bool:
    """Whether a tshark without the plugin ends by a signal too (4.6.9 does on cooked headers)."""
    if "-r" not in arguments:
        return False
    capture = str(arguments[arguments.index("-r") + 1])
    # With the tree of everything: the fault is in a dissector that writes into it.
    command = [*program(), "-n", "-r", capture, "-V"]
    result = subprocess.run(command, env=environment, capture_output=True, timeout=300, check=False)
    return result.returncode < 0


def run(home: Path, *arguments: str | Path) -> bytes:
    """What tshark with the plugin prints, with empty settings."""
    environment = {
        **os.environ,
        "HOME": str(home),
        "XDG_CONFIG_HOME": str(home),
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    }
    environment.pop("WIRESHARK_CONFIG_DIR", None)
    command = [*program(), "-n", "-X", f"lua_script:{PLUGIN}", *map(str, arguments)]
    result = subprocess.run(command, env=environment, capture_output=True, timeout=300, check=False)
    problem = result.stderr.decode("utf-8", "replace")
    if result.returncode < 0 and crashes_alone(environment, arguments):
        pytest.skip("this tshark crashes on the capture without the plugin as well")
    assert result.returncode == 0, problem
    for word in BROKEN:
        assert word not in problem
        assert word.encode() not in result.stdout
    return result.stdout


@pytest.fixture
def tshark(tmp_path: Path) -> Tshark:
    """Runs tshark with the plugin and gives its output as text."""

    def shark(*arguments: str | Path) -> str:
        return run(tmp_path, *arguments).decode("utf-8", "replace")

    return shark


@pytest.fixture
def make(tmp_path: Path) -> Callable[[Callable[[Client], object]], Path]:
    """Writes a capture of what a client does."""

    def write(play: Callable[[Client], object]) -> Path:
        stage = Stage()
        play(Client(stage))
        path = tmp_path / "made.pcapng"
        with path.open("wb") as file, PcapngWriter(file) as writer:
            for shot in stage.shots:
                writer.write(shot.time_ns, shot.data)
        return path

    return write


def rows(output: str) -> list[list[str]]:
    return [line.split("\t") for line in output.splitlines()]


def in_decimal(output: str) -> list[list[str]]:
    """The rows with decimal numbers: tshark 3.4 prints eight digits of everything hexadecimal."""
    return rows(re.sub(r"\b0x[0-9a-f]+\b", lambda number: str(int(number[0], 16)), output))


def named(table: str, numbers: str) -> list[str]:
    """The words of the numbers that a field of words has."""
    return [codes.words(table)[int(number)] for number in numbers.split(",")]


def columns(*names: str) -> list[str]:
    wanted = ["-T", "fields"]
    for name in names:
        wanted += ["-e", name]
    return wanted


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("tour-machine", ["17\tDS417\t6", "22\tDS705\t18"]),
        ("conversation-superseded-change", ["3\tDS414\t1", "5\tDS414\t3"]),
    ],
)
def test_further_frames_of_a_finding_are_links(
    tshark: Tshark, name: str, expected: list[str]
) -> None:
    shown = columns("frame.number", "ds47.finding", "ds47.finding.frame")
    lines = tshark(
        "-2", "-r", CAPTURES[f"{name}.pcapng"], "-Y", "ds47.finding", *shown
    ).splitlines()
    assert [line for line in lines if line.split("\t")[2]] == expected


# The whole result, capture by capture


@pytest.fixture(scope="module")
def answers(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[dict[str, Future[bytes]]]:
    """What tshark says of the captures that this run wants, by name; two at a time."""
    home = tmp_path_factory.mktemp("home")
    program()
    wanted = [
        item.callspec.params["name"]
        for item in request.session.items
        if isinstance(item, pytest.Function)
        and item.originalname == test_the_result_is_that_of_the_analyzer.__name__
    ]
    with ThreadPoolExecutor(WORKERS) as pool:
        yield {name: pool.submit(run, home, *PDML, "-r", CAPTURES[name]) for name in wanted}


def told(item: Finding) -> dict[str, Any]:
    """A finding as the plugin tells it.

    Its offset stands beside its message, and it has no filter. That frames were dropped nobody can know
    inside Wireshark.
    """
    args = dict(item.args)
    if args.get("dropped"):
        args["dropped"] = False
    about = FINDING.plain(replace(item, args=args))
    del about["filter"]
    about.pop("time", None)  # Wireshark has it beside each frame
    about["message"] = sentence(replace(item, args=args))
    return about


def with_all_args(each: dict[str, Any]) -> dict[str, Any]:
    """A finding of the plugin with what it does not know as None: Lua has no key for that."""
    return {**each, "args": rules()[each["rule"]].carried(each["args"])}


def expected(path: Path) -> fields.Fields:
    result = analyze(path)
    findings = of_transactions(told(each) for each in result.findings)
    return fields.Fields([TRANSACTION.plain(each) for each in result.transactions], findings)


def same_result(pdml: bytes, path: Path) -> None:
    wanted, found = expected(path), fields.read(io.BytesIO(pdml))
    for left, right in zip(found.transactions, wanted.transactions, strict=False):
        assert left == right
    assert len(found.transactions) == len(wanted.transactions)
    assert all(each["args"].keys() <= rules()[each["rule"]].args.keys() for each in found.findings)
    assert [with_all_args(each) for each in found.findings] == wanted.findings


BESIDE = [name for name, path in CAPTURES.items() if beside.fits(path.read_bytes())]
ALONE_TOO = [*BESIDE[::3], BESIDE[-1]]
"""Of them, those that are looked at as they are, too, a start of tshark for each. What the analysis in Lua says of
each capture alone is compared in test_lua_analysis.py."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.own if name in BESIDE else ())
        for name in CAPTURES
        if name in ALONE_TOO or name not in BESIDE
    ],
)
def test_the_result_is_that_of_the_analyzer(name: str, answers: dict[str, Future[bytes]]) -> None:
    same_result(answers[name].result(), CAPTURES[name])


@pytest.mark.slow
def test_the_result_of_captures_beside_each_other_is_that_of_the_analyzer(tmp_path: Path) -> None:
    """All that can stand it, in one start, in which each has what it has alone."""
    captures = {name: CAPTURES[name].read_bytes() for name in BESIDE}
    assert len(captures) > 150
    whole = beside.beside(captures)
    assert whole.shown(analyze(whole.open())) == {
        name: beside.shown_alone(each) for name, each in captures.items()
    }
    path = tmp_path / "beside.pcapng"
    path.write_bytes(whole.content)
    same_result(run(tmp_path, *PDML, "-r", path), path)


def test_the_captures_show_every_state() -> None:
    """The comparison above is worth nothing where there is nothing to compare."""
    states = {each.state for path in CAPTURES.values() for each in analyze(path).transactions}
    assert states == set(STATES)


# One pass and two


POLLED = "record-polls.pcapng"


def test_one_pass_shows_what_earlier_frames_prove(tshark: Tshark) -> None:
    path = CAPTURES[POLLED]
    names = ("frame.number", "ds47.request_in", "ds47.response_in", "ds47.state", "ds47.polls")
    found = rows(tshark("-r", path, "-Y", "ds47", *columns(*names)))
    assert found[0] == ["1", "", "", "", "0"]
    assert found[-1][1:3] == ["1", ""]
    assert named("states", found[-1][3]) == ["ok"]
    assert int(found[-1][4]) > 0
    assert all(row[2] == "" for row in found)


@pytest.mark.parametrize("name", ["conversation-read-unanswered.pcapng", POLLED])
def test_one_pass_does_not_say_that_nothing_will_come(name: str, tshark: Tshark) -> None:
    early = tshark("-r", CAPTURES[name], "-Y", 'ds47.finding matches "DS40[12]"')
    unanswered = tshark("-r", CAPTURES[name], "-Y", 'ds47.state == "unanswered"')
    assert early == unanswered == ""


def test_two_passes_say_it(tshark: Tshark) -> None:
    path = CAPTURES["conversation-read-unanswered.pcapng"]
    found = tshark("-r", path, "-2", "-Y", 'ds47.finding == "DS401"', *columns("ds47.state"))
    assert named("states", found) == ["unanswered"]


def test_two_passes_link_both_ways(tshark: Tshark) -> None:
    names = ("frame.number", "ds47.request_in", "ds47.response_in")
    path = CAPTURES["conversation-error.pcapng"]
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47", *columns(*names)))
    assert found == [["1", "", "4"], ["2", "1", "4"], ["3", "1", "4"], ["4", "1", ""]]


def test_two_passes_without_a_filter_link_back(tshark: Tshark) -> None:
    path = CAPTURES["conversation-error.pcapng"]
    found = tshark("-r", path, "-2", "-V", "-O", "ds47").split("\nFrame ")
    assert ["[Request in frame: 1]" in frame for frame in found] == [False, True, True, True]


def test_a_filter_in_the_second_pass_changes_nothing(tshark: Tshark) -> None:
    path = CAPTURES["tour-machine.pcapng"]
    pdml = ("-T", "pdml", "-J", "frame ds47")
    all_frames = fields.read(io.BytesIO(tshark("-r", path, *COMPLETE, *pdml).encode()))
    filtered = fields.read(io.BytesIO(tshark("-r", path, "-2", "-Y", "ds47", *pdml).encode()))
    assert filtered == all_frames
    assert all_frames.transactions


def test_a_read_filter_that_drops_frames_keeps_the_pairs(tshark: Tshark) -> None:
    path = CAPTURES["tour-machine.pcapng"]
    found = rows(
        tshark("-r", path, "-2", "-R", "ds47", *columns("frame.number", "ds47.request_in"))
    )
    assert found[:4] == [["1", ""], ["2", "1"], ["3", "1"], ["4", "1"]]


# Findings


@cache
def rules_of(path: Path) -> set[str]:
    """The rules of the findings that the analyzer has in a capture."""
    return {each.rule for each in analyze(path).findings}


def test_a_finding_is_found_by_its_rule(tshark: Tshark) -> None:
    path = CAPTURES["conversation-error.pcapng"]
    names = ("frame.number", "ds47.finding.severity")
    ((frame, severities),) = rows(
        tshark("-r", path, "-2", "-Y", 'ds47.finding == "DS410"', *columns(*names))
    )
    assert frame == "4"
    assert named("severities", severities) == ["error", "warning"]  # and of DS701


@pytest.mark.parametrize(
    "name",
    ["tour-machine.pcapng", "record-nothing-to-read.pcapng", "diagnosis-data-block-layout.pcapng"],
)
def test_every_filter_that_the_page_offers_finds_frames(name: str, tshark: Tshark) -> None:
    """That the plugin has all other rules, capture by capture, is compared above."""
    found = groups(analyze(CAPTURES[name]))
    offered = {each.rule: each.plugin_filter for each in found if each.plugin_filter}
    wanted = " || ".join(offered.values())
    output = tshark("-r", CAPTURES[name], "-2", "-Y", wanted, *columns("ds47.finding"))
    shown = {rule for line in output.splitlines() for rule in line.split(",")}
    assert shown == offered.keys()


@pytest.mark.parametrize(
    "rule",
    [each.id for each in rules().values() if each.analyzer_only and each.id.startswith("DS7")],
)
def test_no_filter_is_offered_for_what_the_plugin_has_not(rule: str) -> None:
    path = next(
        each
        for each in CAPTURES.values()
        if each.name.startswith("diagnosis-") and rule in rules_of(each)
    )
    offered = {each.rule: each.plugin_filter for each in groups(analyze(path))}
    assert offered[rule] is None


def test_findings_are_expert_infos(tshark: Tshark) -> None:
    path = CAPTURES["tour-machine.pcapng"]
    findings = analyze(path).findings
    shown = {each["rule"] for each in of_transactions({"rule": each.rule} for each in findings)}
    found = tshark("-r", path, *COMPLETE, "-q", "-z", "expert")
    assert {rule[:3] for rule in shown} >= {"DS4", "DS7"}
    assert all(f"{rule} {rules()[rule].title}\n" in found for rule in shown)
    once = tshark("-r", path, "-q", "-z", "expert")
    assert f"DS417 {rules()['DS417'].title}\n" in once


@pytest.mark.parametrize(
    ("name", "rule"),
    [("transport-fault.pcapng", "DS104"), ("record-nothing-to-read.pcapng", "DS206")],
)
def test_a_frame_without_a_record_shows_its_finding(name: str, rule: str, tshark: Tshark) -> None:
    found = tshark("-r", CAPTURES[name], "-2", "-Y", f'ds47.finding == "{rule}"')
    assert len(found.splitlines()) == 1


def test_rules_are_left_out_on_demand(tshark: Tshark) -> None:
    path = CAPTURES["conversation-error.pcapng"]
    assert tshark("-r", path, "-2", "-Y", "ds47.finding", "-o", "ds47.ignore:DS2 ds410 DS7") == ""


# Values


def several_types(client: Client) -> None:
    """A read of a parameter of each type."""
    blocks = (
        message.raw_block(0x03, 2, bytes.fromhex("8000 7fff")),  # Integer16
        message.raw_block(0x38, 1, b"\xff" * 8),  # Unsigned64
        message.raw_block(0x37, 1, b"\x80" + bytes(7)),  # Integer64
        message.real(0.5),
        message.block(0x0F, "d", 0.1),  # Float64
        message.raw_block(0x09, 3, b"Mot"),  # VisibleString
        message.raw_block(0x0A, 2, b"\x00\xff"),  # OctetString
        message.raw_block(0x34, 1, bytes.fromhex("0036ee80")),  # TimeOfDayWithoutDate
        message.raw_block(0x71, 1, bytes.fromhex("4000")),  # N2
        message.raw_block(0x01, 1, b"\x01"),  # Boolean
    )
    places = [message.address(100 + number) for number in range(len(blocks))]
    client.exchange(message.read(3, 2, *places), message.answer(3, 1, 2, *blocks))


TYPED = {
    "scaled.number": "100",
    "value": '-32768,32767,18446744073709551615,-9223372036854775808,0.5,0.1,"Mot",00ff,3600000,16384,1',
    "value.float": "0.5",
    "value.bytes": ("4d6f74,00ff", "4d:6f:74,00:ff"),
    "scaled": "01:00:00.000,100.0",
    "pnu": "100,101,102,103,104,105,106,107,108,109",
}


def test_values_have_the_type_of_their_format(tshark: Tshark, make: Any) -> None:
    output = tshark(
        "-r", make(several_types), "-Y", "ds47.value", *columns(*map("ds47.{}".format, TYPED))
    )
    (found,) = rows(output)
    for shown, wanted in zip(found, TYPED.values(), strict=True):
        assert shown in (wanted if isinstance(wanted, tuple) else (wanted,))


def test_every_number_is_one_as_a_double(tshark: Tshark, make: Any) -> None:
    """Whatever its format; a text, octets and a time are none, and 64 bits lose their last digits."""
    output = tshark("-r", make(several_types), "-Y", "ds47.value", *columns("ds47.value.number"))
    numbers = [float(each) for each in output.split(",")]
    wanted = [-32768, 32767, 2.0**64, -(2.0**63), 0.5, 0.1, 16384, 1]
    assert numbers == [pytest.approx(each, rel=1e-14) for each in wanted]


FILTERS = (
    'ds47.value == "18446744073709551615"',
    "ds47.value.float == 0.5",
    "ds47.value.number == 0.1",
    "ds47.value.number == 0.5",
    "ds47.value.number == 32767",
    "ds47.value.number > 1e19",
    "ds47.value.number < -9e18",
    "ds47.scaled.number >= 100",
    "ds47.value contains Mot && ds47.value.bytes == 4d:6f:74",
    "ds47.value.bytes == 00:ff",
    'ds47.scaled > "00:59" && ds47.scaled < "01:01"',
    'ds47.format == "Float64" && ds47.pnu == 104',
    "ds47.format == 0x0f && ds47.format == 15",
    'ds47.state == "ok" && ds47.state == 1 && ds47.state < "partial"',
    'ds47.operation == "read" && ds47.operation == 1',
    'ds47.channel == "ds47"',
    "ds47.device == 192.168.133.0/24 && ds47.controller == 192.168.133.2",
    'ds47.ar == "47474747-0001-4000-8000-000000000001"',
    "ds47.bytes.response contains 4d:6f:74",
    "ds47.axis == 2 && ds47.request_reference == 3 && ds47.response_id == 1",
    'ds47.attribute == "value"',
    "ds47.time > 0.002 && ds47.time < 0.004",
    "ds47.index == 0x2f && ds47.slot == 1",
)


def test_fields_can_be_filtered(tshark: Tshark, make: Any, tmp_path: Path) -> None:
    wanted = {f"ds47.value && {each}": 1 for each in FILTERS}
    found = many(tshark, tmp_path, wanted, *COMPLETE, "-r", make(several_types))
    assert {each: len(frames) for each, frames in found.items()} == wanted


WRONG = (
    'ds47.state == "refusedd"',
    'ds47.operation == "chnge"',
    'ds47.channel == "dp"',
    'ds47.channel == "s7"',
    'ds47.operation == "usend"',
    'ds47.finding.severity == "warn"',
    'ds47.format == "Flaot32"',
    'ds47.attribute == "values"',
    'ds47.error.code == "Invalid subindx"',
    'ds47.pzd.event.name == "falt"',
    'ds47.profibus.service == "exchnge"',
    'ds47.device == "dp3"',
    "ds47.value.number > nine",
)


def test_a_wrong_word_is_an_error(tshark: Tshark, tmp_path: Path) -> None:
    found = many(tshark, tmp_path, WRONG, "-r", CAPTURES["tour-machine.pcapng"])
    for condition, told in found.items():
        wrong = condition.split('"')[1] if '"' in condition else "nine"
        assert isinstance(told, str), condition
        assert f'"{wrong}"' in told.replace(condition, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["tour-machine.pcapng", "o1_profinetpy062_be.pcapng", "o3_two_controllers.pcapng"]
)
def test_numbers_are_those_of_the_analyzer(name: str, tshark: Tshark) -> None:
    """In the frame that shows all of a transaction; compared with its text, 9.5 is more than 1444."""
    kinds = {row.name: row.kind for row in formats().values()}
    wanted = {}
    for item in analyze(CAPTURES[name]).transactions:
        frame = item.frames.read_response or item.frames.write_request
        numbers = [
            float(value)
            for each in item.parameters
            if kinds.get(each.format or "") in ("number", "float")
            for value in each.values
        ]
        if numbers:
            wanted[frame] = numbers
    shown = rows(
        tshark(
            "-r",
            CAPTURES[name],
            *COMPLETE,
            "-Y",
            "ds47.value.number",
            *columns("frame.number", "ds47.value.number"),
        )
    )
    found = {int(frame): [float(each) for each in numbers.split(",")] for frame, numbers in shown}
    assert wanted
    assert {frame: found.get(frame) for frame in wanted} == {
        frame: pytest.approx(numbers, rel=1e-14, nan_ok=True) for frame, numbers in wanted.items()
    }
    above = tshark(
        "-r", CAPTURES[name], *COMPLETE, "-Y", "ds47.value.number > 9.5", *columns("frame.number")
    ).split()
    assert {int(each) for each in above} == {
        frame for frame, numbers in found.items() if max(numbers) > 9.5
    }


@pytest.mark.parametrize("name", ["conversation-error.pcapng", "cyclic-longer-ramp.pcapng"])
def test_a_frame_has_its_own_message_at_its_bytes_and_no_others(name: str, tshark: Tshark) -> None:
    """No tab beside the bytes of the frame: neither for a message of another one nor for a UUID."""
    path = CAPTURES[name]
    item = analyze(path).transactions[0]
    place = re.compile(r'name="ds47.bytes.(\w+)" [^>]*size="(\d+)" pos="(\d+)"[^>]* value="(\w+)"')
    for frame, kind, data in (
        (item.frames.write_request, "request", item.request),
        (item.frames.read_response, "response", item.response),
    ):
        asked = ("-r", path, *COMPLETE, "-Y", f"frame.number == {frame}")
        ((found, size, offset, value),) = place.findall(tshark(*asked, "-T", "pdml", "-J", "ds47"))
        assert (found, value, int(size)) == (kind, data and data.hex(), len(data or b""))
        assert int(offset) > 10
        assert "bytes):" not in tshark(*asked, "-x")  # the heading of one of several sources


def test_bytes_of_a_value_are_marked(tshark: Tshark, make: Any) -> None:
    """The range of a value is where its bytes stand, also behind an odd value with its pad."""
    output = tshark("-r", make(several_types), "-2", "-R", "ds47.value", "-T", "pdml", "-J", "ds47")
    for value in ("7fff", "3f000000", "4d6f74", "0036ee80", "4000", "01"):
        assert f'value="{value}"' in output


@pytest.mark.parametrize(
    "name", ["transport-rpc-fragments.pcapng", "transport-ip-fragments.pcapng"]
)
def test_values_in_fragments_are_marked_where_they_were_put_together(
    name: str, tshark: Tshark
) -> None:
    output = tshark("-r", CAPTURES[name], *COMPLETE, "-T", "pdml", "-J", "ds47")
    assert 'size="4" pos=' in output.partition("ds47.value.float")[2].partition("/>")[0]


# What is in a frame, and what its request says


ALONE = (
    "ds47", "ds47.pnu", "ds47.value", "ds47.value.float", "ds47.error.code", "ds47.format",
    "ds47.axis", "ds47.state", "ds47.api", "ds47.request_in", "ds47.frames.read_response",
    "ds47.duration_ms", "ds47.finding", "ds47.finding.severity",
)  # fmt: skip
"""Fields of every part of the tree."""


@pytest.mark.slow
def test_a_tree_that_nobody_sees_has_the_one_field_that_is_asked_for(tshark: Tshark) -> None:
    """For a filter and a column only that field is made; for PDML the whole tree is."""
    path = CAPTURES["tour-machine.pcapng"]
    whole = ElementTree.fromstring(
        tshark("-r", path, *COMPLETE, "-T", "pdml", "-J", "frame ds47").encode()
    )
    for name in ALONE:
        column = ("-o", f'gui.column.format:"No.","%m","Asked","%Cus:{name}:0:R"')
        asked = tshark("-r", path, *COMPLETE, "-Y", name, *column)
        found = [line.split(maxsplit=1)[0] for line in asked.splitlines()]
        wanted = [
            number.get("show")
            for packet in whole.iter("packet")
            for number in packet.iterfind(".//field[@name='frame.number']")
            if packet.find(f".//*[@name='{name}']") is not None
        ]
        assert found == wanted != [], name
        if name != "ds47":  # a column has no text of a protocol alone
            assert all(len(line.split()) > 1 for line in asked.splitlines()), name


def changes(client: Client) -> None:
    """A change that is done, and one of which a part failed."""
    values = message.real(10.0), message.real(20.0)
    places = message.address(4711), message.address(4712)
    client.exchange(
        message.change(1, 2, *zip(places, values, strict=True)), bytes.fromhex("01020202")
    )
    client.exchange(
        message.change(2, 2, *zip(places, values, strict=True)),
        bytes.fromhex("02820202 4000 4402 0811 0003"),
    )


OF_A_BLOCK = ("format", "value_count", "error.code", "error.info")
WRITTEN = ("written.format", "written.value_count", "value", "pnu")


def test_a_change_response_has_the_fields_of_its_own_bytes(tshark: Tshark, make: Any) -> None:
    names = map("ds47.{}".format, (*OF_A_BLOCK, *WRITTEN))
    output = tshark("-r", make(changes), *COMPLETE, "-Y", "ds47.response_id", *columns(*names))
    copied = ["8,8", "1,1", "10.0,20.0", "4711,4712"]
    assert in_decimal(output) == [
        ["", "", "", "", *copied],
        [f"{0x40},{0x44}", "0,2", f"{0x0811}", "3", *copied],
    ]


@pytest.mark.slow
def test_a_format_matches_where_it_is_in_the_frame(tshark: Tshark, make: Any) -> None:
    path = make(changes)
    numbers = columns("frame.number")
    found = tshark("-r", path, *COMPLETE, "-Y", 'ds47.format == "Float32"', *numbers).split()
    asked = tshark("-r", path, *COMPLETE, "-Y", "ds47.request_id", *numbers).split()
    assert found == asked
    failed = tshark("-r", path, *COMPLETE, "-Y", "ds47.error.code == 0x0811", *numbers).split()
    assert len(failed) == 1
    assert tshark("-r", path, *COMPLETE, "-Y", "ds47.error.code == 0x11", *numbers) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["o1_profinetpy062_be.pcapng", "o3_two_controllers.pcapng"])
def test_change_responses_of_real_stacks_have_what_they_carry(name: str, tshark: Tshark) -> None:
    names = ("ds47.response_id", "ds47.format", "ds47.value_count", "ds47.error.code")
    wanted = "ds47.response_id == 2 && !ds47.finding"
    done = rows(tshark("-r", CAPTURES[name], *COMPLETE, "-Y", wanted, *columns(*names)))
    assert done
    assert all(row[1:] == ["", "", ""] for row in done)
    failed = 'ds47.response_id == 0x82 && !(ds47.state == "mismatch")'
    found = in_decimal(tshark("-r", CAPTURES[name], *COMPLETE, "-Y", failed, *columns(*names)))
    assert found
    for _, kinds, counts, numbers in found:
        assert set(kinds.split(",")) <= {"64", "68"}
        assert len(counts.split(",")) == len(kinds.split(","))
        assert len(numbers.split(",")) == kinds.split(",").count("68")


def test_what_the_request_wrote_stands_in_brackets(tshark: Tshark, make: Any) -> None:
    output = tshark("-r", make(changes), *COMPLETE, "-Y", "ds47.error.code", "-V", "-O", "ds47")
    lines = [line.strip() for line in output.splitlines()]
    start = lines.index("Number of parameters: 2") + 1
    assert lines[start:][:27] == [
        "[Parameter: p4711[0] := 10.0]",
        "[Attribute: value (0x10)]",
        "[Number of elements: 1]",
        "[Parameter number (PNU): 4711]",
        "[Subindex: 0]",
        "[Follow: 192.168.133.33 DO 2 PNU 4711]",
        "Format: Zero (0x40)",
        "Number of values: 0",
        "[Format written: Float32 (0x08)]",
        "[Number of values written: 1]",
        "[Value: 10.0]",
        "[Number: 10]",
        "Parameter: p4712[0] := 20.0 error 0x0811: Manufacturer-specific error 0x0811 (info 3)",
        "[Attribute: value (0x10)]",
        "[Number of elements: 1]",
        "[Parameter number (PNU): 4712]",
        "[Subindex: 0]",
        "[Follow: 192.168.133.33 DO 2 PNU 4712]",
        "Format: Error (0x44)",
        "Number of values: 2",
        "[Format written: Float32 (0x08)]",
        "[Number of values written: 1]",
        "[Value: 20.0]",
        "[Number: 20]",
        "Error number: 0x0811",
        "Error: Manufacturer-specific error 0x0811",
        "Additional information: 3",
    ]


def test_every_byte_of_an_error_block_has_its_field(tshark: Tshark, make: Any) -> None:
    output = tshark(
        "-r", make(changes), *COMPLETE, "-Y", "ds47.error.code", "-T", "pdml", "-J", "ds47"
    )
    tree = output[output.index('name="ds47"') :]
    for name, value in (("format", "40"), ("format", "44"), ("value_count", "02")):
        assert re.search(rf'name="ds47.{name}" [^>]*value="{value}"', tree)
    assert re.search(r'name="ds47.error.code" [^>]*size="2"[^>]*value="0811"', tree)
    assert re.search(r'name="ds47.error.info" [^>]*size="2"[^>]*value="0003"', tree)


def test_a_request_id_that_is_not_supported_has_its_number(tshark: Tshark, make: Any) -> None:
    def play(client: Client) -> None:
        client.exchange(bytes.fromhex("6a400201 100100020000"), bytes.fromhex("6a800201 44010021"))

    names = ("ds47.error.code", "ds47.error.text", "ds47.raw", "ds47.format")
    output = tshark("-r", make(play), *COMPLETE, "-Y", "ds47.response_id", *columns(*names))
    found = in_decimal(output)
    assert found == [["33", "Service not supported: illegal request ID", "", "68"]]


def test_blocks_of_another_request_belong_to_no_parameter(tshark: Tshark, make: Any) -> None:
    def play(client: Client) -> None:
        place, value = message.address(50303), message.real(10.0)
        client.exchange(message.change(1, 2, (place, value)), bytes.fromhex("09820201 4401 0002"))

    names = ("ds47.error.code", "ds47.error.text", "ds47.format", "ds47.value")
    output = tshark("-r", make(play), *COMPLETE, "-Y", "ds47.response_id", *columns(*names))
    found = in_decimal(output)
    assert found == [["2", "", "68", "10.0"]]


# Which records are ours


def test_index_47_can_be_forbidden(tshark: Tshark) -> None:
    path = CAPTURES["conversation-error.pcapng"]
    assert tshark("-r", path, "-2", "-Y", "ds47", "-o", "ds47.index_47:never") == ""


def test_index_47_can_be_forced(tshark: Tshark) -> None:
    path = CAPTURES["record-foreign.pcapng"]
    decoded = ("-r", path, "-2", "-Y", "ds47.transaction")
    assert tshark(*decoded) == ""
    assert tshark(*decoded, "-o", "ds47.index_47:always") != ""


def test_another_index_can_be_ours(tshark: Tshark, make: Any) -> None:
    def play(client: Client) -> None:
        place = client.at(index=0x1234)
        client.write(message.read(1, 1, message.address(922)), at=place)
        client.accept_read(
            client.ask_read(place), message.answer(1, 1, 1, message.word(352)), place
        )

    path = make(play)
    usual, more = (
        fields.read(io.BytesIO(tshark("-r", path, *COMPLETE, "-T", "pdml", *option).encode()))
        for option in ((), ("-o", "ds47.indices:40-42,0x1234"))
    )
    options = AnalysisOptions(indices=frozenset({0x1234}))
    assert usual.transactions == []
    assert more.transactions == [
        TRANSACTION.plain(each) for each in analyze(path, options).transactions
    ]
    assert len(more.transactions) == 1


def test_what_the_built_in_calls_malformed_is_decoded(tshark: Tshark) -> None:
    names = ("ds47.state", "ds47.pnu", "ds47.value")
    path = CAPTURES["format-mixed.pcapng"]
    if not tshark("-r", path, "-Y", "_ws.malformed", *columns("frame.number")):
        pytest.skip("the built-in of this version does not decode index 47 (3.4)")
    found = rows(tshark("-r", path, "-2", "-Y", "_ws.malformed && ds47", *columns(*names)))
    wanted = analyze(path).transactions[0]
    assert len(found) == 1
    state, numbers, shown = found[0]
    assert named("states", state) == ["ok"]
    assert numbers == ",".join(str(each.pnu) for each in wanted.parameters)
    assert shown.count(",") + 1 == sum(len(each.values) for each in wanted.parameters)


def test_preferences_change_formats_texts_and_limits(tshark: Tshark, make: Any) -> None:
    def play(client: Client) -> None:
        client.exchange(
            message.read(1, 1, message.address(1), message.address(2)),
            message.answer(1, 0x81, 1, message.raw_block(0x21, 1, b"\x40\x00"), message.error(0)),
        )

    path = make(play)
    found = tshark(
        "-r", path, "-2", "-Y", "ds47.value", *columns("ds47.format", "ds47.error.text", "ds47.finding"),
        "-o", "ds47.profile_v3_types:TRUE", "-o", "ds47.language:zh", "-o", "ds47.slow_ms:1",
    )  # fmt: skip
    ((kinds, text, rules),) = in_decimal(found)
    assert kinds == f"{0x71},{0x44}"
    assert not text.isascii()
    assert rules == "DS410,DS416,DS701"


# What a person reads


def sentences(output: str) -> list[str]:
    return [line.partition(" DS47 ")[2].partition(" ")[2] for line in output.splitlines()]


def play_sentences(client: Client) -> None:
    client.exchange(
        message.read(3, 2, message.address(50303)), message.answer(3, 1, 2, message.real(10))
    )
    change = message.change(4, 2, (message.address(50304), message.real(5)))
    client.write(change)
    client.refuse_read(client.ask_read(), 0xDE80B500)
    client.accept_read(client.ask_read(), message.answer(4, 0x82, 2, message.error(0x02)))
    client.write(message.read(5, 2, message.address(1, 2, 3)), status=0xDF80B700)
    many = [message.address(number) for number in range(1, 21)]
    client.exchange(
        message.read(6, 2, *many),
        message.answer(6, 0x81, 2, message.word(7), *[message.error(1, 2)] * 19),
    )


SENTENCES = [
    "p50303[0], read request, DO 2, ref 0x03 (Ramp-function generator ramp-up time 1)",
    "write accepted, DO 2, ref 0x03",
    "fetch response, DO 2, ref 0x03",
    "p50303[0] = 10.0 s, read response, DO 2, ref 0x03 (Ramp-function generator ramp-up time 1)",
    "p50304[0] := 5.0 s, change request, DO 2, ref 0x04 (Ramp-function generator ramp-down time 1)",
    "write accepted, DO 2, ref 0x04",
    "fetch response, DO 2, ref 0x04",
    "read poll: not ready, DO 2, ref 0x04",
    "fetch response, DO 2, ref 0x04",
    "p50304[0]: 0x02 Below or above the value limit, change error, DO 2, ref 0x04 "
    "(Ramp-function generator ramp-down time 1)",
    "p0001[2..4], read request, DO 2, ref 0x05",
    "write refused: DF80B700 write: access: invalid range, DO 2, ref 0x05",
    "p0001[0], r0002[0], p0003[0], p0004[0], p0005[0], p0006[0], ... and 14 more, "
    "read request, DO 2, ref 0x06",
    "write accepted, DO 2, ref 0x06",
    "fetch response, DO 2, ref 0x06",
    "p0001[0] = 7, "
    + "".join(
        f"{element(n, 0)}: 0x01 Parameter value cannot be changed, info 2, " for n in range(2, 7)
    )
    + "... and 14 more, read partial, DO 2, ref 0x06",
]


@pytest.mark.parametrize("passes", [(), COMPLETE, ("-2",)], ids=["one", "two", "two-bare"])
def test_the_info_column_reads_like_a_sentence(
    passes: tuple[str, ...], tshark: Tshark, make: Any
) -> None:
    assert sentences(tshark("-r", make(play_sentences), *passes)) == SENTENCES


def test_the_protocol_tree_begins_with_the_sentence(tshark: Tshark, make: Any) -> None:
    shown = tshark("-r", make(play_sentences), "-V", "-O", "ds47")
    short = [text for text in SENTENCES if len(text) < 200]  # Wireshark cuts labels at 240
    assert len(short) > 10
    assert all(f"\nDS47 {text}\n" in shown for text in short)


@pytest.mark.slow
def test_the_info_column_has_names_and_units(tshark: Tshark) -> None:
    """Of one parameter or two; with more the line grows long."""
    said = sentences(tshark("-r", CAPTURES["tour-machine.pcapng"], *COMPLETE, "-Y", "ds47"))
    ramp = "Ramp-function generator ramp-up time 1"
    assert said[0] == f"p50303[0], read request, DO 2, ref 0x01 ({ramp})"
    assert said[24] == "p50076[1] := 100.0, change request, DO 2, ref 0x06"
    assert said[28] == f"p50303[0], p50999[0], read request, DO 2, ref 0x07 (p50303[0] {ramp})"
    said = sentences(tshark("-r", CAPTURES["tour-machine.pcapng"], *COMPLETE, "-Y", "ds47",
                            "-o", "ds47.language:zh"))  # fmt: skip
    assert (
        said[11]
        == "p50304[0] := 100.0 s, change response, DO 2, ref 0x02 (斜坡函数发生器斜坡下降时间 1)"
    )


def test_names_and_units_stand_in_the_tree(tshark: Tshark) -> None:
    shown = tshark("-r", CAPTURES["tour-machine.pcapng"], "-V", "-O", "ds47")
    assert "[Name: Ramp-function generator ramp-up time 1]" in shown
    assert "[Unit: s]" in shown


def test_frames_of_others_are_left_alone(tshark: Tshark) -> None:
    path = CAPTURES["record-foreign.pcapng"]
    assert " DS47 " not in tshark("-r", path)


@pytest.mark.slow
def test_no_field_is_added_when_nobody_wants_one(tshark: Tshark, tmp_path: Path) -> None:
    """A second script counts how often the tree is asked for."""
    script = tmp_path / "count.lua"
    script.write_text(
        "local tree = require('ds47_ws.tree')\n"
        "local add = tree.add\n"
        "function tree.add(...) io.stderr:write('TREE\\n') print('TREE') return add(...) end\n"
    )
    path = CAPTURES["conversation-error.pcapng"]
    count = ("-r", path, "-X", f"lua_script:{script}")
    assert "TREE" not in tshark(*count)
    assert "TREE" not in tshark(*count, *COMPLETE, "-Y", "frame.number == 4")
    assert tshark(*count, "-Y", "ds47.pnu == 21").count("TREE") == 4
    assert tshark(*count, *COMPLETE, "-V").count("TREE") == 4


def test_two_copies_do_no_harm(tshark: Tshark) -> None:
    path = CAPTURES["conversation-error.pcapng"]
    found = tshark("-r", path, "-X", f"lua_script:{PLUGIN}", "-Y", "ds47", *columns("ds47.pnu"))
    assert rows(found) == [["21"], [""], [""], ["21"]]
