"""PKW in cyclic frames in a real tshark: what the plugin shows is what the analyzer reports.

Scenes and talk by chance are those of `test_lua_cyclic`.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import beside
import pytest
from test_lua_cyclic import by_chance, scenes
from test_parameter_channels import (
    CHANGE,
    FIFTY,
    IDLE,
    OTHER,
    READ,
    REFUSED,
    USS,
    Machine,
    rules_of,
    talk,
)
from test_shared_frame_ids import merged, two_controllers
from test_wireshark_plugin import (
    COMPLETE,
    Tshark,
    columns,
    expected,
    program,
    rows,
    tshark,
    with_all_args,
)
from whole_capture import of_transactions

from ds47.analysis import AnalysisOptions, analyze
from ds47.capture.writer import PcapngWriter
from ds47.lab.cyclic import OUTPUT, PKW
from ds47.model import Transaction
from ds47.report import json as report
from ds47.report.contract import TRANSACTION
from ds47.spec import codes
from ds47.wireshark import fields
from ds47.wireshark.engine import Engine
from ds47.wireshark.tshark import prepare

__all__ = ["tshark"]  # the fixture
SEEDS = 12
PDML = ("-T", "pdml", "-J", "frame ds47")
SPM = 0x08


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Two requests with their responses."""
    return saved(tmp_path, talk(Machine().connect()).capture())


def saved(folder: Path, content: bytes) -> Path:
    path = folder / "cyclic.pcapng"
    path.write_bytes(content)
    return path


def told(item: Transaction) -> dict[str, Any]:
    """A transaction without the rules that the plugin does not know."""
    plain = TRANSACTION.plain(item)
    known = of_transactions({"rule": rule} for rule in plain["findings"])
    return plain | {"findings": [each["rule"] for each in known]}


def compare(tshark: Tshark, path: Path, *options: str) -> int:
    """How many transactions there are; fails where one is not the analyzer's."""
    found = fields.read(io.BytesIO(tshark("-r", path, *options, *PDML).encode()))
    wanted = [told(each) for each in analyze(path).transactions]
    assert found.transactions == wanted
    assert [with_all_args(each) for each in found.findings] == expected(path).findings
    return len(wanted)


@pytest.mark.slow
def test_the_result_of_scenes_and_of_talk_by_chance_is_that_of_the_analyzer(
    tshark: Tshark, tmp_path: Path
) -> None:
    """All that can stand it beside each other, the rest alone."""
    made = [*scenes(), *map(by_chance, range(SEEDS))]
    together = {each.name: each.content for each in made if beside.fits(each.content)}
    whole = beside.beside(together)
    assert whole.shown(analyze(whole.open())) == {
        name: beside.shown_alone(content) for name, content in together.items()
    }
    assert compare(tshark, saved(tmp_path, whole.content), *COMPLETE) > 50
    for each in made:
        if each.name not in together:
            compare(tshark, saved(tmp_path, each.content), *COMPLETE)


def test_one_frame_id_to_two_controllers(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path, two_controllers(1, 2))
    assert compare(tshark, path, *COMPLETE) == 6
    zsw1 = columns("eth.dst", "ds47.pzd.zsw1")
    told = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.pzd.zsw1", *zsw1))
    assert len({receiver for receiver, _ in told}) == 2
    assert not [word for _, word in told if "," in word]


def test_two_recordings_in_one_file(tshark: Tshark, tmp_path: Path) -> None:
    path = saved(tmp_path, merged("saved-often", "slow-response", 300_000_000, whole=False))
    compare(tshark, path, *COMPLETE)
    told = rows(
        tshark("-r", path, *COMPLETE, "-Y", 'ds47.finding == "DS515"', *columns("frame.number"))
    )
    assert len(told) == 1


def test_a_filter_in_the_second_pass_changes_nothing(tshark: Tshark, path: Path) -> None:
    assert compare(tshark, path, *COMPLETE) == compare(tshark, path, "-2", "-Y", "ds47") == 2


OK, ERROR = (str(codes.codes("states")[each]) for each in ("ok", "error"))
SHOWN = (
    "frame.number", "ds47.pkw.ak", "ds47.pkw.pnu", "ds47.pkw.subindex", "ds47.value", "ds47.state",
    "ds47.request_in", "ds47.response_in", "ds47.cycles", "ds47.finding",
)  # fmt: skip


def test_the_words_have_fields(tshark: Tshark, path: Path) -> None:
    assert rows(tshark("-r", path, *COMPLETE, "-Y", "ds47", *columns(*SHOWN))) == [
        ["9", "1", "1082", "0", "", OK, "", "16", "3", ""],
        ["16", "2", "1082", "0", "50.0", OK, "9", "", "3", ""],
        ["21", "3", "1082", "0", "40.0", ERROR, "", "28", "3", ""],
        ["28", "7", "1082", "0", "40.0", ERROR, "21", "", "3", "DS501,DS531"],
    ]


def test_one_pass_shows_what_earlier_frames_prove(tshark: Tshark, path: Path) -> None:
    """Nothing of a request before its channel is proven, and no frame that is still to come."""
    assert rows(tshark("-r", path, "-Y", "ds47", *columns(*SHOWN))) == [
        ["16", "2", "1082", "0", "50.0", OK, "9", "", "3", ""],
        ["21", "3", "1082", "0", "40.0", "", "", "", "", ""],
        ["28", "7", "1082", "0", "40.0", ERROR, "21", "", "3", "DS501"],
    ]


def test_two_passes_without_a_filter_show_the_same_as_one(tshark: Tshark, path: Path) -> None:
    """The first of them has no fields."""
    both = [
        tshark("-r", path, *option, "-T", "fields", "-e", "ds47.pnu") for option in ((), ("-2",))
    ]
    assert both[0] == both[1]
    assert both[0].split() == ["1082"] * 3


def test_fields_stand_at_their_bytes(tshark: Tshark, path: Path) -> None:
    text = tshark("-r", path, *COMPLETE, "-Y", "frame.number == 16", *PDML)
    for name, at, size in (
        ("ds47.pkw", 16, 8), ("ds47.pkw.ak", 16, 1), ("ds47.pkw.pnu", 16, 2), ("ds47.pkw.subindex", 18, 1),
        ("ds47.pkw.page", 19, 1), ("ds47.pkw.pwe1", 20, 2), ("ds47.pkw.pwe2", 22, 2), ("ds47.value", 20, 4),
    ):  # fmt: skip
        field = text.split(f'name="{name}"', 1)[1]
        assert f'size="{size}" pos="{at}"' in field[: field.index(">")], name


def test_the_toggle_bit_does_not_hide_the_words(tshark: Tshark, tmp_path: Path) -> None:
    """A response is the same with it and without it; so its bytes are not those of the report."""
    toggled = f"{int(FIFTY[:2], 16) | SPM:02x}{FIFTY[2:]}"
    machine = Machine().connect().ask(READ).respond(toggled).ask(IDLE).respond(IDLE)
    path = saved(tmp_path, machine.capture())
    found = rows(
        tshark(
            "-r", path, *COMPLETE, "-Y", "ds47.pkw.spm == 1", *columns("ds47.pkw.pnu", "ds47.value")
        )
    )
    assert found == [["1082", "50.0"]]


def test_the_sentence_of_a_frame(tshark: Tshark, path: Path) -> None:
    """As the packet list has it: 4.6 fills the fields of the columns before a postdissector comes."""
    lines = tshark("-r", path, *COMPLETE, "-Y", "ds47").splitlines()
    assert [line[line.index(" DS47 ") + 1 :].split(" ", 2)[2] for line in lines] == [
        "p1082[0], PKW read request (Maximum speed)",
        "p1082[0] = 50.0 rpm, PKW read response (Maximum speed)",
        "p1082[0] := 40.0 rpm, PKW change request (Maximum speed)",
        "p1082[0]: 17 Not possible in this operating state, PKW change response (Maximum speed)",
    ]


@pytest.mark.parametrize(("lang", "text"), [("en", "(read value)"), ("zh", "(读参数值)")])
def test_words_of_both_languages(tshark: Tshark, path: Path, lang: str, text: str) -> None:
    shown = tshark("-r", path, *COMPLETE, "-o", f"ds47.language:{lang}", "-V", "-O", "ds47")
    (line,) = {each.strip() for each in shown.splitlines() if "AK: 1" in each}
    assert line == f"AK: 1 {text}"


def test_what_stands_is_text_and_no_field(tshark: Tshark, path: Path) -> None:
    """A filter finds the frames in which something happened; who looks at one sees what stands there."""
    two = "(frame.number == 11 || frame.number == 18)"
    shown = tshark("-r", path, *COMPLETE, "-Y", two, "-V", "-O", "ds47")
    assert "DS47 PKW request: AK 1 read value: p1082[0]" in shown
    assert "DS47 PKW response: AK 2 double word: p1082[0] = 50.0" in shown
    assert not tshark("-r", path, *COMPLETE, "-Y", f"ds47 && {two}", "-V")


def test_the_built_in_decode_stays(tshark: Tshark, path: Path) -> None:
    shown = columns("frame.number", "pn_io.io_data_object")
    with_it = tshark("-r", path, "-Y", "pn_io.io_data_object", *shown)
    assert len(with_it.splitlines()) > 20


@pytest.mark.parametrize(
    "options",
    [
        ("-o", "ds47.pkw_layout:uss"),
        ("-o", "ds47.pkw_layouts:192.168.0.9=cyclic 192.168.133.33=uss"),
    ],
)
def test_the_layout_is_a_preference(
    options: tuple[str, str], tshark: Tshark, tmp_path: Path
) -> None:
    content = Machine().connect().ask(USS[0]).respond(USS[1]).ask(IDLE).capture()
    path = saved(tmp_path, content)
    shown = columns("ds47.pkw.pnu", "ds47.pkw.subindex", "ds47.pnu", "ds47.subindex")
    plain = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47", *shown))
    other = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47", *shown, *options))
    assert (plain, other) == ([["10", "128", "10", "128"]] * 2, [["2010", "1", "2010", "1"]] * 2)


def test_statistics_and_reports_count_them(tshark: Tshark, path: Path) -> None:
    arguments = ("statistics", "csv", "report")
    options = [part for each in arguments for part in ("-X", f"lua_script1:{each}")]
    text = tshark("-q", *options, "-r", path)
    assert "2 transactions (1 ok, 1 error)" in text
    assert ",1,pkw,read,ok," in text
    assert "2 transactions: 1 ok, 1 error\n2 findings: " in text


def test_a_frame_that_something_else_stands_in_is_not_touched(
    tshark: Tshark, tmp_path: Path
) -> None:
    """Frames of other senders, short ones, and cyclic frames before the Connect."""
    machine = talk(talk(Machine()).connect())
    target = io.BytesIO()
    with PcapngWriter(target) as writer:
        for number, shot in enumerate(machine.stage.shots):
            writer.write(shot.time_ns, shot.data, shot.original_length)
            if number % 3 == 0 and shot.data[12:14] == b"\x88\x92":
                writer.write(shot.time_ns, b"\2" * 12 + shot.data[12:], None)
                writer.write(shot.time_ns, shot.data[:15], 64)
    assert compare(tshark, saved(tmp_path, target.getvalue()), *COMPLETE) == 2


@pytest.mark.slow
def test_both_engines_say_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyshark")
    prepared = prepare(*program())
    monkeypatch.setattr("ds47.wireshark.tshark.prepare", lambda _program: prepared)
    machine = talk(Machine().connect()).ask(OTHER[0], 5).ask(READ).respond(FIFTY).ask(CHANGE)
    machine.respond(REFUSED).ask(IDLE)
    assert {rule for rule, _ in rules_of(machine)} >= {"DS501", "DS504"}
    machine.line.say(PKW, OUTPUT, bytes.fromhex(READ))
    path = saved(tmp_path, talk(machine.turn(2_000)).capture())
    for options in (
        AnalysisOptions(),
        AnalysisOptions(pkw_layouts=(("", "uss"),)),
        AnalysisOptions(pkw_layouts=(("192.168.133.33", "uss"),)),
        AnalysisOptions(channels=("pkw",)),
        AnalysisOptions(channels=("pzd",)),
        AnalysisOptions(channels=("ds47",)),
    ):
        native = analyze(path, options)
        # both says native's result, and a finding for each difference from tshark's (test_engine.py)
        for name in ("both", "tshark") if options == AnalysisOptions() else ("tshark",):
            found = Engine(name, options).analyze(path)
            assert report.capture(found) == report.capture(native), name


def test_a_value_says_what_it_means(tshark: Tshark, tmp_path: Path) -> None:
    machine = Machine().connect().ask("139a000000000000").respond("139a000000000161")
    path = saved(tmp_path, machine.ask(IDLE).respond(IDLE).capture())
    (parameter,) = TRANSACTION.plain(analyze(path).transactions[0])["parameters"]
    assert "telegram 353" in parameter["meaning"]
    found = tshark(
        "-r", path, *COMPLETE, "-Y", "ds47.meaning", *columns("ds47.pnu", "ds47.meaning")
    )
    assert rows(found) == [["922", parameter["meaning"]]]
