"""Lists of a user in the plugin: written by `params export`, read by Lua, shown by tshark as in the report."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from lua_program import LUAS, lua_program

from ds47.cli import main
from ds47.model import Parameter
from ds47.parameters import naming, table
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedMessage, ListedParameter, ParameterList
from ds47.wireshark import bundle, install

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "tests" / "lua" / "parameter_lists.lua"
PLUGIN = ROOT / "dissector" / "ds47.lua"
CAPTURE = ROOT / "captures" / "conversation-partial-read.pcapng"
pytestmark = pytest.mark.plugin
TSHARK = os.environ.get("DS47_TSHARK") or shutil.which("tshark")
needs_tshark = pytest.mark.skipif(
    TSHARK is None and not os.environ.get("DS47_CI"), reason="no tshark"
)
ODD = ("plain", "tab\tand\nline\r", "back\\slash \\t", "\x1b[2J", "名称", "a" * 300)


def some_list(chance: random.Random, number: int) -> ParameterList:
    found = ParameterList(
        f"list {number}",
        chance.choice([None, 0x002A, 0x0042]),
        tuple(chance.sample([1, 2, 3], chance.choice([0, 0, 1, 2]))),
        chance.choice([None, "4.7", "4.8"]),
    )
    for _ in range(chance.randrange(8)):
        values = {
            chance.choice([0, 1, -2, 7]): chance.choice(ODD) for _ in range(chance.choice([0, 2]))
        }
        found.rows.append(
            ListedParameter(
                chance.choice([300, 945, 2122, 7]), chance.choice(ODD), None,
                chance.choice([None, "s", "°C"]), None, values,
            )
        )  # fmt: skip
    for _ in range(chance.randrange(6)):
        found.messages.append(
            ListedMessage(chance.choice("FAN"), chance.choice([1, 7900, 30001]), chance.choice(ODD))
        )
    return found


@pytest.mark.parametrize("lua", LUAS)
@pytest.mark.parametrize("seed", range(4))
def test_both_say_the_same_of_lists(lua: str, seed: int, tmp_path: Path) -> None:
    chance = random.Random(seed)
    lists = [some_list(chance, number) for number in range(6)]
    path = tmp_path / "lists.tsv"
    path.write_text(table.text(lists), "utf-8", newline="\n")
    catalogue, questions, expected = Catalogue(lists), [], []
    for _ in range(400):
        pnu = chance.choice([300, 945, 2122, 7, 8])
        vendor, device = chance.choice([None, 0x002A, 0x0042, 7]), chance.choice([None, 1, 2, 9])
        given = [chance.choice([0, 1, -2, 7, 7900, 30001]) for _ in range(chance.choice([0, 1, 3]))]
        item = Parameter(pnu, 0, "value", 1, format="Integer32", values=list(given))
        naming.explain(SimpleNamespace(parameters=[item]), catalogue, vendor, device)  # type: ignore[arg-type]
        questions.append(
            {
                "pnu": pnu,
                "vendor_id": vendor,
                "device_id": device,
                "values": given,
                "format": "Integer32",
            }
        )
        texts = (
            None
            if item.value_texts is None
            else {str(key): text for key, text in item.value_texts.items()}
        )
        expected.append({"name": item.name, "unit": item.unit, "value_texts": texts})
    result = subprocess.run(
        [lua_program(lua), str(PROGRAM), str(path)], input="\n".join(map(json.dumps, questions)),
        capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    answers = [json.loads(line) for line in result.stdout.splitlines()]
    assert answers == expected
    assert any(each["value_texts"] for each in answers)


BROKEN = {
    "": 1, "ds47-parameters\t2\n": 1, "number,name\n300,Motor\n": 1,
    "ds47-parameters\t1\nparameter\t300\tMotor\t\n": 2,
    "ds47-parameters\t1\nlist\tx\t\n": 2, "ds47-parameters\t1\nlist\t42\n": 2,
    "ds47-parameters\t1\nlist\t42\t1,y\n": 2, "ds47-parameters\t1\nlist\t70000\t\n": 2,
    "ds47-parameters\t1\nlist\t\t\nparameter\t99999\tMotor\t\n": 3,
    "ds47-parameters\t1\nlist\t\t\nparameter\t300\t\t\n": 3,
    "ds47-parameters\t1\nlist\t\t\nparameter\t300\tMotor\ts\t1\n": 3,
    "ds47-parameters\t1\nlist\t\t\nparameter\t300\tMotor\ts\tone\ttext\n": 3,
    "ds47-parameters\t1\nlist\t\t\nmessage\tf\t07900\tblocked\n": 3,
    "ds47-parameters\t1\nlist\t\t\nmessage\tF\t07900\n": 3,
    "ds47-parameters\t1\nlist\t\t\nos.execute\t1\n": 3, "\0\xff\0": 1,
}  # fmt: skip


@pytest.mark.parametrize(("text", "line"), BROKEN.items())
def test_a_broken_file_names_its_line(text: str, line: int, tmp_path: Path) -> None:
    path = tmp_path / "lists.tsv"
    path.write_bytes(text.encode("latin-1"))
    result = subprocess.run(
        [lua_program(LUAS[0]), str(PROGRAM), str(path)], capture_output=True, encoding="utf-8", check=True
    )  # fmt: skip
    assert json.loads(result.stdout) == {"line": line}


def test_windows_may_have_edited_it(tmp_path: Path) -> None:
    path = tmp_path / "lists.tsv"
    path.write_bytes(b"ds47-parameters\t1\r\nlist\t\t\r\nparameter\t300\tMotor\ts\r\n\r\n")
    question = {
        "pnu": 300,
        "vendor_id": None,
        "device_id": None,
        "values": [],
        "format": "Integer16",
    }
    result = subprocess.run(
        [lua_program(LUAS[0]), str(PROGRAM), str(path)], input=json.dumps(question), capture_output=True,
        encoding="utf-8", check=True,
    )  # fmt: skip
    assert json.loads(result.stdout) == {"name": "Motor", "unit": "s", "value_texts": None}


@pytest.fixture
def taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Path:
    """A folder with one list that was taken in."""
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "kept"))
    source = tmp_path / "own.csv"
    source.write_text(
        "number,name,unit,values\nr21,Speed now,1/min,\np27,Amps,A,7: seven\n", "utf-8"
    )
    assert main(["params", "import", str(source), "--vendor", "0x002A"]) == 0
    capsys.readouterr()
    return tmp_path


def test_export_writes_a_file_or_standard_output(
    taken: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["params", "export", str(taken / "a.tsv")]) == 0
    assert "1 list written to" in capsys.readouterr().out
    assert main(["params", "export", "-"]) == 0
    text = capsys.readouterr().out
    assert text == (taken / "a.tsv").read_text("utf-8")
    assert text.splitlines()[:3] == [table.HEAD, "list\t42\t", "parameter\t21\tSpeed now\t1/min"]
    assert main(["params", "export", str(taken / "no" / "a.tsv")]) == 3
    assert main(["params", "export"]) == 2
    assert main(["params", "export", "a.tsv", "--wireshark"]) == 2


def test_beside_the_plugin_it_is_ours(taken: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plugins = taken / "plugins"
    arguments = ["params", "export", "--wireshark", "--folder", str(plugins)]
    assert main(arguments) == 1
    assert "no plugin of ds47 is installed" in capsys.readouterr().err
    sources = bundle.plugin_sources()
    install.install_plugin(plugins, sources)
    assert main(arguments) == 0
    place = plugins / install.FOLDER
    lists = (place / install.LISTS).read_text("utf-8")
    assert lists.startswith(table.HEAD)
    again = install.install_plugin(plugins, sources)
    assert not again.foreign
    assert (place / install.LISTS).read_text("utf-8") == lists
    install.uninstall(place, False)
    assert not place.exists()


def shown(path: Path | None, plugin: Path = PLUGIN) -> tuple[list[list[str]], str]:
    """Names, units and line of all frames of ds47, and what tshark says beside that."""
    assert TSHARK is not None
    more = [] if path is None else ["-o", f"ds47.lists:{path}"]
    command = [TSHARK, "-X", f"lua_script:{plugin}", *more, "-r", str(CAPTURE), "-Y", "ds47"]
    fields = ["-T", "fields", "-e", "ds47.name", "-e", "ds47.unit"]
    result, lines = (
        subprocess.run(each, capture_output=True, encoding="utf-8", check=True)
        for each in ([*command, *fields], command)  # fields of columns are before plugins in 4.4
    )
    rows = zip(result.stdout.splitlines(), lines.stdout.splitlines(), strict=True)
    return [[*told.split("\t"), line] for told, line in rows], result.stderr


@pytest.mark.slow
@needs_tshark
def test_tshark_shows_what_the_report_shows(taken: Path) -> None:
    main(["params", "export", str(taken / "a.tsv")])
    rows, said = shown(taken / "a.tsv")
    assert "Lua Error" not in said
    assert rows[-1][:2] == ["Speed now,Amps", "1/min,A"]
    assert "r0021[0] = 10.0 1/min" in rows[-1][2]
    plain, _ = shown(None)
    assert plain[-1][0] == "Actual speed, smoothed,Actual current, absolute value, smoothed"


@pytest.mark.slow
@needs_tshark
@pytest.mark.parametrize("text", ["number,name\n", "ds47-parameters\t1\nlist\tx\t\n", "\0"])
def test_a_broken_file_costs_one_line(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.tsv"
    path.write_text(text, "utf-8")
    rows, said = shown(path)
    assert (rows, "Lua Error" in said) == (shown(None)[0], False)
    assert [line for line in said.splitlines() if str(path) in line] == [
        f"ds47: {path} is no file of lists: line {text.count(chr(10)) or 1}; "
        "ds47 params export --wireshark writes it anew"
    ]


@pytest.mark.slow
@needs_tshark
def test_a_file_that_is_not_there_costs_one_line(tmp_path: Path) -> None:
    rows, said = shown(tmp_path / "none.tsv")
    assert rows == shown(None)[0]
    assert said.count("cannot be read; ds47 params export --wireshark writes it anew") == 1


@needs_tshark
def test_the_file_beside_an_installed_plugin_is_read(taken: Path) -> None:
    plugins = taken / "plugins"
    install.install_plugin(plugins, bundle.plugin_sources())
    assert main(["params", "export", "--wireshark", "--folder", str(plugins)]) == 0
    rows, _ = shown(None, plugins / install.FOLDER / "ds47.lua")
    assert rows[-1][0] == "Speed now,Amps"
