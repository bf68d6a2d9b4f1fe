"""Statistics, reports and the profile in a real tshark (DS47_TSHARK names another one).

What `-X lua_script1:csv` writes must be what `ds47 report -f csv` prints, and the report has what the JSON has;
the profile must give columns, colours and filters without a warning.
"""

from __future__ import annotations

import csv
import gzip
import io
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from fake_tshark import real_tshark
from many_filters import many
from test_lua_report import told_by_json

from ds47 import spec
from ds47.analysis import AnalysisOptions, analyze
from ds47.model import Report
from ds47.report import csv as csv_report
from ds47.report import write_all
from ds47.wireshark import install
from ds47.wireshark.bundle import bundle, plugin_sources

ANALYZER_ONLY = tuple(rule.id for rule in spec.rules().values() if rule.analyzer_only)
"""The rules that the plugin has not."""
CAPTURES = (
    "tour-machine",
    "conversation-slow",
    "diagnosis-bytes-swapped",
    "diagnosis-index-and-count",
    "format-mixed",
    "format-description",
    "message-error-words",
    "naming-all",
    "record-foreign",
    "record-multiple-refused",
    "seed-g120-constant-reference",
    "transport-ip-fragments-disorder",
    "transport-rpc-fragments",
    "transport-time-back",
    "transport-two-controllers",
)


@dataclass(frozen=True, slots=True)
class Output:
    """What a tshark printed."""

    out: str
    err: str


Run = Callable[..., Output]


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home folder with nothing in it."""
    folder = tmp_path / "home"
    folder.mkdir()
    folder.chmod(0o777)
    return folder


@pytest.fixture
def shark(home: Path) -> Run:
    """Runs tshark with an empty home folder; fails on any error that Lua reports."""
    program = real_tshark()
    environment = {
        "PATH": os.environ.get("PATH", ""),
        "HOME": str(home),
        "XDG_CONFIG_HOME": str(home / ".config"),
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    }

    def run(*arguments: str | Path) -> Output:
        command = [program, *map(str, arguments)]
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            timeout=120,
            check=False,
        )
        listing = arguments[0] == "-G"  # a list of fields holds these words
        both = done.stderr if listing else done.stdout + done.stderr
        assert done.returncode == 0, done.stderr
        assert "Lua Error" not in both, both
        assert "Lua: Error during" not in both, both
        return Output(done.stdout, done.stderr)

    return run


@pytest.fixture
def plugin(repository: Path) -> list[str]:
    """The arguments that load the plugin of the checkout."""
    return ["-X", f"lua_script:{repository / 'dissector' / 'ds47.lua'}"]


@pytest.fixture
def tour(captures: Path) -> Path:
    return captures / "tour-machine.pcapng"


def asked(*arguments: str) -> list[str]:
    """Arguments of the script."""
    return [part for each in arguments for part in ("-X", f"lua_script1:{each}")]


@pytest.mark.slow
@pytest.mark.parametrize("name", CAPTURES)
def test_reports_are_those_of_the_analyzer(
    shark: Run, plugin: list[str], captures: Path, tmp_path: Path, name: str
) -> None:
    path = captures / f"{name}.pcapng"
    text, table = tmp_path / "report.txt", tmp_path / "report.csv"
    wanted = asked(f"report={text}", f"csv={table}", f"name={name}")
    shark("-q", *plugin, *wanted, "-r", path)
    result = analyze(path, AnalysisOptions(ignore=ANALYZER_ONLY))
    result.path = name
    assert "".join(text.read_text("utf-8").split()) == told_by_json(result, "en")
    expected = io.StringIO()
    write_all(csv_report.Writer(expected), Report([result]))
    assert table.read_bytes().decode() == expected.getvalue()


@pytest.mark.slow
def test_the_rows_of_many_conversations_at_once_are_those_of_the_analyzer(
    shark: Run, plugin: list[str], repository: Path, tmp_path: Path
) -> None:
    path, table = tmp_path / "dense.pcapng", tmp_path / "report.csv"
    maker = repository / "bench" / "make_dense.py"
    subprocess.run([sys.executable, maker, path, "--frames", "2000"], check=True, timeout=60)
    shark("-q", *plugin, *asked(f"csv={table}", "name=dense"), "-r", path)
    result = analyze(path, AnalysisOptions(ignore=ANALYZER_ONLY))
    result.path = "dense"
    expected = io.StringIO()
    write_all(csv_report.Writer(expected), Report([result]))
    lines = table.read_bytes().decode().splitlines()
    assert len(lines) > 500
    assert sorted(lines) == sorted(expected.getvalue().splitlines())


@pytest.mark.slow
def test_statistics_are_the_same_however_the_file_is_read(
    shark: Run, plugin: list[str], tour: Path
) -> None:
    said = [
        shark(*ways, "-q", *plugin, *asked("statistics", "name=tour"), "-r", tour).out
        for ways in ([], ["-2"], ["-2", "-R", "frame"])
    ]
    assert said[0].startswith("DS47 statistics: tour\n37 frames, 8 transactions (4 ok, 1 partial, ")
    assert said == [said[0]] * 3
    assert re.search(
        r"^  192\.168\.133\.33\n.*\n    change +4 +2 +3\.000 +15\.000 ", said[0], re.MULTILINE
    )
    shares = said[0].split("Share of the drive")[1]
    assert re.search(r"^  192\.168\.133\.33\n    read +4 +4 +2\.000 +3\.000 ", shares, re.MULTILINE)
    assert re.search(r"^  DS410  error +2 +29  \S", said[0], re.MULTILINE)


@pytest.mark.parametrize("passes", [[], ["-2"], ["-2", "-R", "frame"]])
@pytest.mark.parametrize(
    ("filtering", "begins"),
    [
        ("frame.number <= 17", "37 frames, 3 of 8 transactions (3 ok), 1 finding\n"),
        ("ds47.pnu == 50303", "37 frames, 4 of 8 transactions (1 ok, 1 partial, 1 refused, 1\n"),
        ("frame.number == 8", "37 frames, 1 of 8 transactions (1 ok), 0 findings\n"),  # a poll
        ("frame.number == 1", "37 frames, 0 of 8 transactions, 0 findings\n"),
    ],
)
def test_statistics_of_what_a_filter_shows(
    shark: Run, plugin: list[str], tour: Path, passes: list[str], filtering: str, begins: str
) -> None:
    wanted = asked("statistics", f"filter={filtering}")
    said = shark(*passes, "-q", *plugin, *wanted, "-r", tour).out
    assert said.startswith(f"DS47 statistics\n{begins}")
    assert f"\nDisplay filter: {filtering}\n\n" in said


def test_a_filter_narrows_drives_and_rows_and_no_report(
    shark: Run, plugin: list[str], tour: Path, captures: Path
) -> None:
    wanted = asked("drives", "filter=frame.number < 300")
    said = shark("-q", *plugin, *wanted, "-r", captures / "cyclic-longer-ramp.pcapng").out
    assert "Display filter: frame.number < 300\n" in said
    assert "telegram 1: 11 events\n" in said
    wanted = asked("csv", "filter=ds47.pnu == 50076")
    rows = list(csv.DictReader(io.StringIO(shark("-q", *plugin, *wanted, "-r", tour).out)))
    assert [row["pnu"] for row in rows] == ["50076"]
    wanted = asked("report", "filter=ds47.pnu == 50076")
    assert shark("-q", *plugin, *wanted, "-r", tour).out.startswith("37 frames\n8 transactions")


def test_a_filter_that_is_none_prints_nothing(shark: Run, plugin: list[str], tour: Path) -> None:
    said = shark("-q", *plugin, *asked("statistics", "filter=nothing =="), "-r", tour)
    assert said.out == ""
    assert "ds47: not a display filter: nothing ==" in said.err


WINDOW = """
local actions, buttons, filter, text, copied = {}, {}, "", nil, nil
function _G.gui_enabled() return true end
function _G.register_menu(name, action) actions[name] = action end
function _G.get_filter() return filter end
function _G.retap_packets() end
function _G.copy_to_clipboard(given) copied = given end
local window = { set = function(_, given) text = given end }
function window:add_button(name, action) buttons[name] = action end
_G.TextWindow = { new = function() return window end }
require("ds47_ws.stats").listener = function(given) -- which shows a frame of the second transaction
  if given ~= "wrong" then return { remove = function() end }, { [6] = true } end
end
require("ds47_ws.menu").register(require("ds47_ws.track"))
local listener = Listener.new("frame")
local function times() return text:match("Max.-\\n\\n"):gsub("[%s-]+", " ") end
function listener.draw()
  actions["DS47 Statistics"]()
  print(text:match("\\n(.-)\\n"), times())
  buttons["By time"]()
  print(times())
  buttons["By time"]()
  print(times())
  buttons.Copy()
  print(copied == text)
  for _, each in ipairs({ "wrong", "right", " " }) do
    filter = each
    buttons.Refresh()
    print((text:match("^(.-)\\n\\n"):gsub("%s+", " ")))
  end
  actions["DS47 Drives"]()
  print(text:match("^(.-)\\n"))
end
"""


def test_the_window_of_statistics(
    shark: Run, plugin: list[str], tour: Path, tmp_path: Path
) -> None:
    """tshark has none, so a script plays it; which frames a filter shows is Wireshark's business."""
    script = tmp_path / "window.lua"
    script.write_text(WINDOW, encoding="utf-8")
    said = shark("-q", *plugin, "-X", f"lua_script:{script}", "-r", tour).out.splitlines()
    read, change = (
        "read 4 4 3.000 4.000 3.000 7.000 7.000",
        "change 4 2 3.000 15.000 3.000 27.000 27.000",
    )
    assert said[0].startswith("8 transactions (4 ok, 1 partial, ")
    assert f"Max 192.168.133.33 {read} {change} all 8" in said[0]
    assert f"Max* 192.168.133.33 {change} {read} all 8" in said[1]
    assert f"Max* 192.168.133.33 {read} {change} all 8" in said[2]
    assert said[3] == "true"
    assert said[4].endswith("The display filter is not valid, so nothing is left out: wrong")
    assert said[5] == "DS47 statistics 1 of 8 transactions (1 ok), 0 findings Display filter: right"
    assert said[6].startswith("DS47 statistics 8 transactions (4 ok, 1 partial, ")
    assert "Display filter" not in said[6]
    assert said[7] == "Drives: control and status word"


def test_statistics_stand_behind_the_packet_list(shark: Run, plugin: list[str], tour: Path) -> None:
    lines = shark(*plugin, *asked("statistics"), "-r", tour).out.split("DS47 statistics\n")
    assert len(lines) == 2
    assert lines[0].count("\n") == 37


def test_csv_on_standard_output(shark: Run, plugin: list[str], tour: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(shark("-q", *plugin, *asked("csv"), "-r", tour).out)))
    assert [row["pnu"] for row in rows][:3] == ["50303", "50304", "50304"]
    assert {row["path"] for row in rows} == {"'-"}


def test_chinese(shark: Run, plugin: list[str], tour: Path) -> None:
    out = shark("-q", *plugin, *asked("statistics", "lang=zh"), "-r", tour).out
    assert out.startswith("DS47 统计\n")


def test_what_nobody_asked_for_is_not_printed(shark: Run, plugin: list[str], tour: Path) -> None:
    assert shark("-q", *plugin, "-r", tour).out == ""
    said = shark("-q", *plugin, *asked("statistic", "lang=fr"), "-r", tour)
    assert said.out == ""
    assert "unknown argument statistic;" in said.err
    assert "unknown argument lang=fr;" in said.err


def test_a_file_that_cannot_be_written_is_said(
    shark: Run, plugin: list[str], tour: Path, tmp_path: Path
) -> None:
    wanted = asked(f"report={tmp_path / 'no' / 'such'}", "statistics")
    said = shark("-q", *plugin, *wanted, "-r", tour)
    assert "ds47: cannot write" in said.err
    assert "such" in said.err
    assert said.out.startswith("DS47 statistics\n")


@pytest.mark.slow
def test_a_capture_is_not_written_over(
    shark: Run, plugin: list[str], tour: Path, tmp_path: Path
) -> None:
    data = tour.read_bytes()
    pcap = bytes.fromhex("d4c3b2a1")
    packed = gzip.compress(data), bytes.fromhex("28b52ffd") + b"zstd", b"snoop\0\0\0\0\0\0\2"
    targets = {kind: tmp_path / f"{kind} here" for kind in ("report", "csv", "statistics")}
    wanted = asked(*(f"{kind}={target}" for kind, target in targets.items()))
    for content in (data, pcap, pcap[::-1], *packed):
        for target in targets.values():
            target.write_bytes(content)
        said = shark("-q", *plugin, *wanted, "-r", tour)
        for target in targets.values():
            assert f"ds47: cannot write {target}: a capture or a packed file" in said.err
            assert target.read_bytes() == content
    for target in targets.values():
        target.write_text("an older report")
    said = shark("-q", *plugin, *wanted, "-r", tour)
    for target in targets.values():
        assert f"ds47: {target}: was there, and is overwritten" in said.err
        assert "older" not in target.read_text("utf-8")
        target.unlink()
    assert "ds47:" not in shark("-q", *plugin, *wanted, "-r", tour).err


def test_a_report_without_a_name_begins_with_its_frames(
    shark: Run, plugin: list[str], tour: Path
) -> None:
    assert shark("-q", *plugin, *asked("report"), "-r", tour).out.startswith(
        "37 frames\n8 transactions: 4 ok, "
    )


@pytest.mark.slow
def test_only_ipv4_has_to_be_enabled(shark: Run, plugin: list[str], tour: Path) -> None:
    """As "Check installation" says."""
    for name, frames in (("dcerpc", 34), ("pn_io", 34), ("udp", 34), ("ip", 0)):
        off = ["--disable-protocol", name]
        said = shark(*plugin, *off, "-2", "-Y", "ds47", "-r", tour)
        assert len(said.out.splitlines()) == frames, name


def test_a_report_into_a_pipe(shark: Run, plugin: list[str], tour: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    pipe.chmod(0o666)
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE) as reader:
        shark("-q", *plugin, *asked(f"statistics={pipe}"), "-r", tour)
        text, _ = reader.communicate(timeout=60)
    assert text.startswith(b"DS47 statistics")


# The profile


@pytest.fixture
def profile(home: Path, repository: Path) -> list[str]:
    """The arguments that choose the profile, which is installed by copying it."""
    folder = home / ".config" / "wireshark" / "profiles" / "DS47"
    shutil.copytree(repository / "dissector" / "profile", folder)
    return ["-C", "DS47"]


def test_columns_of_the_profile(
    shark: Run, plugin: list[str], profile: list[str], tour: Path
) -> None:
    said = shark(*profile, *plugin, "-2", "-R", "frame", "-r", tour)
    assert "warning" not in said.err.lower()
    line = said.out.splitlines()[12].split()
    assert line[:2] == ["13", "0.282000000"]
    assert line[5:12] == ["DS47", "2", "ok", "27", "p50304[0]", ":=", "100.0"]  # others are hidden


def test_hidden_columns_of_the_profile(
    shark: Run, plugin: list[str], profile: list[str], tour: Path, captures: Path
) -> None:
    """Those of several parameters stay with their values, and PKW has the same column."""
    seen = ["-o", "gui.column.hidden:%m,%t,%s,%d,%p,%i"]
    ways = *profile, *plugin, *seen, "-2", "-R", "frame"
    lines = [line.split() for line in shark(*ways, "-r", tour).out.splitlines()]
    assert lines[12][:3] == ["2", "ok", "27"]
    assert lines[12][3] == "change"
    assert lines[12][4].startswith("p50304[0]")
    assert lines[12][-4:] == [":=", "100.0", "s", "100"]
    assert "p50303[0] (Ramp-function generator ramp-up time 1) = 10.0 s,p50999[0] error 0x00: " in (
        shark(*ways, "-r", tour).out
    )
    said = shark(*ways, "-r", captures / "profibus-ppo1-start.pcapng").out
    assert "change P1082[0] (Maximum frequency) := 40.0 Hz 40" in re.sub(r" +", " ", said)


def colours(shark: Run, *arguments: str | Path) -> dict[str, str]:
    """Frame number -> name of the colour rule that fits."""
    fields = ["-T", "fields", "-e", "frame.number", "-e", "frame.coloring_rule.name"]
    out = shark("--color", "-2", "-R", "frame", *fields, *arguments).out
    return dict(line.split("\t") for line in out.splitlines())


OLDER = {
    "colorfilters": "@S7@ds47_s7 || s7comm@[0,0,0][0,8224,8224]\n@Mine@ds47@[0,0,0][1,1,1]\n",
    "preferences": "ds47.s7_ports: 1102\nds47.slow_ms: 500\n",
}
"""Rows of a profile that an older version installed, and a user changed."""


@pytest.mark.slow
def test_an_older_profile_is_mended(
    shark: Run, plugin: list[str], home: Path, captures: Path
) -> None:
    """What the plugin no longer has is a message at each start until the next installation."""
    folder = home / ".config" / "wireshark" / "profiles" / "DS47"
    install.install_profile(folder, plugin_sources())
    for name, rows in OLDER.items():
        (folder / name).write_text(rows, encoding="ascii")
    asked = ("-C", "DS47", "--color", *plugin, "-r", captures / "seed-g120-read.pcapng")
    marker = install.read_marker(folder)
    assert marker is not None
    assert install.outdated(folder, marker) == sorted(OLDER)
    assert all(word in shark(*asked).err for word in ("ds47_s7", "ds47.s7_ports"))
    outcome = install.install_profile(folder, plugin_sources())
    assert outcome.kept == sorted(OLDER)
    assert install.outdated(folder, marker) == []
    assert "ds47" not in shark(*asked).err
    assert (folder / "preferences").read_text("ascii").endswith("\nds47.slow_ms: 500\n")


@pytest.mark.slow
def test_colours_of_the_profile(
    shark: Run, plugin: list[str], profile: list[str], tour: Path, captures: Path
) -> None:
    rules = colours(shark, *profile, *plugin, "-r", tour)
    expected = {
        "1": "PROFINET RPC, DCP and LLDP",
        "5": "DS47",
        "17": "DS47 finding",
        "22": "DS47 refused",
        "29": "DS47 error",
        "33": "DS47 error",
        "34": "DS47 unanswered",
    }
    assert {frame: rules[frame] for frame in expected} == expected
    slow = colours(shark, *profile, *plugin, "-r", captures / "conversation-slow.pcapng")
    assert "DS47 slow" in slow.values()
    other = colours(shark, *profile, *plugin, "-r", captures / "conversation-wrong-axis.pcapng")
    assert "DS47 mismatch" in other.values()
    drive = colours(shark, *profile, *plugin, "-r", captures / "cyclic-does-not-start.pcapng")
    assert (drive["6"], drive["842"]) == ("Drive: event", "Drive: event")
    assert drive["7"] == "PROFINET cyclic data"
    line = colours(shark, *profile, *plugin, "-r", captures / f"{BUS}.pcapng")
    assert {"PROFIBUS", "PROFIBUS: damaged frame"} <= set(line.values())


def buttons(repository: Path) -> dict[str, str]:
    """Label -> display filter."""
    text = (repository / "dissector" / "profile" / "dfilter_buttons").read_text(encoding="ascii")
    rows = csv.reader(line for line in text.splitlines() if not line.startswith("#"))
    return {row[1]: row[2].replace("\\x22", '"') for row in rows}


TOUR, BUS = "tour-machine", "profibus-bad-line"
S7 = "s7-stacks/errors_cpp_cpp"
STARTS, PKW, FAULT = "cyclic-does-not-start", "profibus-ppo1-start", "profibus-ppo3-and-records"
BUTTONS = {
    "DS47": {TOUR: 34, S7: 0},
    "Findings": {TOUR: 6, BUS: 0, S7: 0},
    "Not ok": {TOUR: 12, S7: 0},
    "Errors": {TOUR: 4},
    "Refused": {TOUR: 4, "real-stacks/o3_two_controllers": 83},
    "No answer": {TOUR: 2},
    "Changes": {TOUR: 16},
    "Slow": {TOUR: 0, "conversation-slow": 1},
    "Drives//Events": {TOUR: 0, STARTS: 8},
    "Drives//Faults": {TOUR: 0, FAULT: 1},
    "Drives//PKW": {TOUR: 0, PKW: 12},
    "PROFIBUS//Parameter channel": {TOUR: 0, BUS: 0, "profibus-seed-records": 22},
    "PROFIBUS//Without data exchange": {TOUR: 0, BUS: 29},
    "PROFIBUS//Damaged": {TOUR: 0, BUS: 5},
}
"""Label -> how many frames the button finds in captures."""


@pytest.mark.parametrize("name", sorted({name for counts in BUTTONS.values() for name in counts}))
def test_filter_buttons(
    shark: Run, plugin: list[str], repository: Path, captures: Path, tmp_path: Path, name: str
) -> None:
    filters = buttons(repository)
    assert list(filters) == list(BUTTONS)
    wanted = {filters[label]: counts[name] for label, counts in BUTTONS.items() if name in counts}

    def run(*arguments: str | Path) -> str:
        said = shark(*plugin, "-2", "-R", "frame", *arguments)
        assert "warning" not in said.err.lower()
        return said.out

    found = many(run, tmp_path, wanted, "-r", captures / f"{name}.pcapng")
    assert {shown: len(frames) for shown, frames in found.items()} == wanted


# What the menu shows of the installation


def told(shark: Run, tmp_path: Path, expression: str, *arguments: str | Path) -> str:
    """What an expression of Lua is worth at the end of a run of the plugin."""
    script = tmp_path / "told.lua"
    script.write_text(
        f"local listener = Listener.new('frame')\nfunction listener.draw() print({expression}) end\n"
    )
    return shark("-q", *arguments, "-X", f"lua_script:{script}").out


def check(shark: Run, tmp_path: Path, *arguments: str | Path) -> str:
    """The text of Tools > DS47 > Check installation, printed at the end of a run."""
    info = "{ version = '1', path = package.loaded['ds47_ws.loaded'].path }"
    call = f"require('ds47_ws.menu').check(require('ds47_ws.track'), {info})"
    return told(shark, tmp_path, call, *arguments)


def test_check_installation(shark: Run, plugin: list[str], tour: Path, tmp_path: Path) -> None:
    text = check(shark, tmp_path, *plugin, "-r", tour)
    assert re.search(r"^Wireshark +\d+\.\d+\.\d+$", text, re.MULTILINE), text
    assert re.search(r"^Lua +5\.[2-4]$", text, re.MULTILINE)
    assert "dissector/ds47.lua\n" in text
    assert re.search(r"^Other copies +none$", text, re.MULTILINE)
    assert re.search(r"^Open capture +18 RPC requests, 18 responses, 8 trans", text, re.MULTILINE)


def test_check_installation_finds_another_copy(
    shark: Run, plugin: list[str], tour: Path, tmp_path: Path
) -> None:
    folders = shark("-G", "folders").out
    found = re.search(r"^Personal Lua Plugins:\s+(.*)$", folders, re.MULTILINE)
    assert found, folders
    place = Path(found[1]) / "more"
    assert tmp_path in place.parents
    place.mkdir(parents=True)
    (place / "ds47-0_0_1.lua").write_text("-- the single file of an older version\n")
    (place / "other.lua").write_text("-- another plugin\n")
    text = check(shark, tmp_path, *plugin, "-r", tour)
    assert re.findall(r"^ANOTHER COPY +(.*)$", text, re.MULTILINE) == [
        str(place / "ds47-0_0_1.lua")
    ]


def add_profile(shark: Run, tmp_path: Path, *arguments: str | Path) -> str:
    """What Tools > DS47 > Add profile DS47 says."""
    call = "table.concat(require('ds47_ws.profile').add('en'), '\\n')"
    return told(shark, tmp_path, call, *arguments)


@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True])
def test_the_plugin_adds_the_profile(
    single: bool, shark: Run, home: Path, tour: Path, repository: Path, tmp_path: Path
) -> None:
    """Of the checkout, and of the one file."""
    entry = repository / "dissector" / "ds47.lua"
    if single:
        entry = tmp_path / "alone.lua"
        entry.write_text(bundle(plugin_sources()), "utf-8")
    arguments = ["-X", f"lua_script:{entry}", "-r", str(tour)]
    text = check(shark, tmp_path, *arguments)
    assert re.search(r"^Profile DS47 +none: Tools > DS47 > Add profile", text, re.MULTILINE), text
    folder = home / ".config" / "wireshark" / "profiles" / "DS47"
    folder.parent.mkdir(parents=True)
    folder.parent.chmod(0o777)
    assert add_profile(shark, tmp_path, *arguments).splitlines()[:1] == [
        f"The profile DS47 is in {folder}."
    ]
    wanted = repository / "dissector" / "profile"
    names = {path.name for path in wanted.iterdir()}
    assert {path.name for path in folder.iterdir()} == names
    assert all((folder / name).read_bytes() == (wanted / name).read_bytes() for name in names)
    (folder / "colorfilters").unlink()
    assert "already exists and is left as it is" in add_profile(shark, tmp_path, *arguments)
    assert not (folder / "colorfilters").exists()
    assert f"{folder}\n" in check(shark, tmp_path, *arguments)


def test_a_profile_that_cannot_be_added(
    shark: Run, plugin: list[str], home: Path, tour: Path, tmp_path: Path
) -> None:
    settings = home / ".config" / "wireshark"
    settings.mkdir(parents=True)
    (settings / "profiles").write_text("no folder")
    said = add_profile(shark, tmp_path, *plugin, "-r", tour)
    assert said.startswith(f"The profile was not added: {settings / 'profiles' / 'DS47'}")


def test_check_installation_tells_of_lists(
    shark: Run, plugin: list[str], tour: Path, tmp_path: Path
) -> None:
    text = check(shark, tmp_path, *plugin, "-r", tour)
    assert "Lists  " not in text
    missing = tmp_path / "köln.tsv"
    text = check(shark, tmp_path, *plugin, "-o", f"ds47.lists:{missing}", "-r", tour)
    assert re.search(
        rf"^Lists +{missing}\n +cannot be read; ds47 params export", text, re.MULTILINE
    ), text


# The documentation


def test_every_field_is_documented(shark: Run, plugin: list[str], repository: Path) -> None:
    text = (repository / "docs" / "wireshark.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| `ds47.")]
    told = [name for row in rows for name in re.findall(r"`(ds47\.[a-z_.0-9]+)`", row)]
    others = tomllib.loads((repository / "tools/site/fields.toml").read_text(encoding="utf-8"))
    told += [f"ds47.{name}" for names in others for name in names.split()]
    listed = shark("-G", "fields", *plugin).out
    known = set(re.findall(r"^F\t[^\t]*\t(ds47\.(?!expert)[a-z_.0-9]+)\t", listed, re.MULTILINE))
    assert set(told) == known
    assert len(told) == len(known)


def test_every_preference_is_documented(shark: Run, plugin: list[str], repository: Path) -> None:
    text = (repository / "docs" / "wireshark.md").read_text(encoding="utf-8")
    table = text.split("## Preferences")[1].split("\n## ")[0]
    rows = [line.split(" | ")[0] for line in table.splitlines() if line.startswith("| `")]
    told = {name for row in rows for name in re.findall(r"`([a-z_0-9]+)`", row)}
    listed = shark("-G", "currentprefs", *plugin).out
    assert told == set(re.findall(r"^#?ds47\.([a-z_0-9]+):", listed, re.MULTILINE))


def test_an_installed_plugin_takes_arguments(shark: Run, tour: Path) -> None:
    found = re.search(r"^Personal Lua Plugins:\s+(.*)$", shark("-G", "folders").out, re.MULTILINE)
    assert found
    path = Path(found[1]) / "ds47" / "ds47.lua"
    path.parent.mkdir(parents=True)
    path.write_text(bundle(plugin_sources()), encoding="utf-8")
    again = ["-X", f"lua_script:{path}", *asked("statistics")]
    assert shark("-q", *again, "-r", tour).out.startswith("DS47 statistics\n37 frames, 8 trans")
    assert shark("-q", "-r", tour).out == ""
