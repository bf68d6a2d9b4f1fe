"""Makers: a file for each in spec/makers, read without code, and the names of all others."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from lua_program import QUICK, lua_program

from ds47 import spec
from ds47.cli import main
from ds47.spec import maker_names

ACME = """\
name = "Acme"
id = 0x7ABC
also = ["Acme Drives"]
source = "a manual"
by_subindex = [7]

[[error]]
code = 0x65
en = "Anvil on the rope"
zh = "绳子上有铁砧"

[[advice]]
codes = [0x65]
look_en = "the rope."
look_zh = "绳子。"
[[advice.cause]]
en = "take the anvil away"
zh = "移走铁砧"
basis = "documented"

[[attribute]]
code = 0x83
name = "weight"
zh = "重量"

[[request]]
code = 0x60
name = "Acme drop"
operation = "vendor"
body = "free"
positive = 0x60
negative = 0xE0
vendor = true

[[response]]
code = 0x60
name = "Acme drop"
body = "free"
negative = false
vendor = true

[[layout]]
name = "acme-drop"
operation = [0, 0, 8]
group = [1, 8, 8]
index = [1, 0, 8]
requests = { 5 = "write" }
answers = { 9 = "failed" }
[[layout.error]]
code = 1
en = "No rope"
zh = "没有绳子"
"""
LUA = """
package.path = arg[1] .. "/?.lua;" .. package.path
local spec = require("ds47.spec.lookup")
print(spec.error_text(0x65, "en", 0x7ABC))
print(spec.error_text(0x65, "zh", 0x7ABC))
print(require("ds47.explain.meanings").error(0x65, "en", 0x7ABC)[1].causes[1].text)
print(require("ds47.spec.tables").vendor_attributes[0x83])
"""


@pytest.fixture(scope="module")
def program(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program with one file more."""
    folder = tmp_path_factory.mktemp("makers")
    left_out = shutil.ignore_patterns("__pycache__", "*.so")
    for name in ("python/ds47", "lua", "tools"):
        shutil.copytree(repository / name, folder / name, ignore=left_out)
    (folder / "python/ds47/spec/makers" / "acme.toml").write_text(ACME, "utf-8")
    return folder


def run(program: Path, *words: str) -> str:
    """What Python prints that has this copy."""
    paths = os.pathsep.join((str(program / "python"), str(program)))
    done = subprocess.run(
        [sys.executable, *words],
        env=os.environ | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONUTF8": "1"},
        capture_output=True, encoding="utf-8", cwd=program, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("explain", "error 0x65", "--vendor", "acme"), "error number of Acme: Anvil on the rope"),
        (("explain", "error 0x65", "--vendor", "acme"), "take the anvil away"),
        (("explain", "error 0x65", "--vendor", "0x7ABC", "--lang", "zh"), "移走铁砧"),
        (("explain", "attribute 0x83"), "of the manufacturer (Acme: weight)"),
        (("explain", "request 0x60"), "Acme drop"),
        (("decode", "--as", "response", "--vendor", "acme drives", "0181000144010065"), "Anvil on the rope"),
        (("decode", "--as", "request", "01 60 00 00"), "request_id 0x60 Acme drop"),
        (("decode", "--as", "pkw-answer", "--pkw-layout", "acme-drop", "0009 0102 0000 0001"), "error 1: No rope"),
    ],
)  # fmt: skip
def test_to_add_a_maker_is_to_add_a_file(program: Path, words: tuple[str, ...], said: str) -> None:
    assert said in run(program, "-m", "ds47", *words)


def test_its_attributes_are_known(program: Path) -> None:
    asked = ("-m", "ds47", "decode", "--as", "request")
    assert "DS305" not in run(program, *asked, "01 01 00 01 83 01 20 11 00 00")
    assert "DS305" in run(program, *asked, "01 01 00 01 84 01 20 11 00 00")


def test_the_plugin_gets_the_same_maker(program: Path) -> None:
    run(program, "tools/make_tables.py")
    script = program / "ask.lua"
    script.write_text(LUA, "utf-8")
    done = subprocess.run(
        [lua_program(QUICK), str(script), str(program / "lua")], capture_output=True, encoding="utf-8", check=True
    )  # fmt: skip
    assert done.stdout.splitlines() == [
        "Anvil on the rope",
        "绳子上有铁砧",
        "take the anvil away",
        "true",
    ]


def test_a_zip_file_has_them_too(program: Path, tmp_path: Path) -> None:
    """Nothing can be listed there: the tables that are ready say which files there are."""
    write = "import hatch_build, sys; from pathlib import Path; hatch_build.write(*map(Path, sys.argv[1:]))"
    spec_folder = program / "python/ds47/spec"
    shutil.copy(Path(__file__).parents[2] / "hatch_build.py", program)
    run(program, "-c", write, str(spec_folder), str(spec_folder / "tables.ndjson"))
    packed = shutil.make_archive(str(tmp_path / "ds47"), "zip", program / "python")
    asked = "import sys; sys.path.insert(0, sys.argv[1]); from ds47 import spec; "
    asked += "print(spec.__file__, *(each.name for each in spec.vendors()))"
    told = run(tmp_path, "-c", asked, packed)
    assert told.startswith(packed)
    assert " Acme " in told


@pytest.mark.parametrize(
    ("text", "name", "number"),
    [
        ("siemens", "SINAMICS", 0x002A), ("SEW-Eurodrive", "SEW", 0x010A), ("vlt", "Danfoss", 0x0080),
        ("danfoss", "Danfoss", 0x0080), ("VACON", "Vacon", 0x01BA), ("keb", "KEB", 0x0177),
        ("rexroth", "Bosch Rexroth", 0x0103), ("Lenze", "Lenze", 0x0106), (" festo ", "Festo", 0x014D),
        ("nord", "NORD", 0x0189), ("parker", "Parker Hannifin", 0x010F), ("b&r", "B&R", 0x0377),
        ("Yaskawa", "Yaskawa", 0x0213), ("mitsubishi", "Mitsubishi Electric", 0x021C),
        ("Stoeber", "Stöber", 0x010B), ("stöber", "Stöber", 0x010B), ("Kuebler", "Kübler", 0x0198),
    ],
)  # fmt: skip
def test_a_maker_is_named_in_any_case_or_by_a_part(text: str, name: str, number: int) -> None:
    assert maker_names.find(text) == (name, number)


@pytest.mark.parametrize(
    ("text", "near"),
    [
        ("delta", ["Delta Electronics", "Delta Motion"]), ("lense", ["Lenze"]), ("stober", ["Stöber"]),
        ("qqqq", []), ("", []),
    ],
)  # fmt: skip
def test_an_unclear_name_is_asked_back(text: str, near: list[str]) -> None:
    with pytest.raises(maker_names.UnclearNameError) as problem:
        maker_names.find(text)
    assert problem.value.near == near


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("explain '0x67' --vendor lense", "did you mean Lenze?"),
        ("decode --as response --vendor delta 01", "did you mean Delta Electronics, Delta Motion?"),
        (
            "decode --as response --vendor qqqq 01",
            "those with tables of their own: SINAMICS, ABB, ",
        ),
        ("explain 'error 0x67' --vendor b&r", "0x67 in the manual of B&R (vendor 0x0377)."),
        (
            "explain 'error 0x67' --vendor 0x7ABC",
            "0x67 in the manual of the device (vendor 0x7ABC).",
        ),
        (
            "explain 'error 0x67' --vendor 0x0213 --lang zh",
            "Yaskawa（制造商 0x0213）手册中的 0x67。",
        ),
        ("explain 'error 0x67' --vendor ABB", "0x67 in the manual of ABB (vendor 0x001A)."),
        ("explain 'error 0x6B' --vendor Vacon", "a change has too few bytes of values"),
        (
            "decode --as response --vendor lenze 0181000144010067",
            "see the manual of Lenze, vendor 0x0106",
        ),
    ],
)
def test_what_commands_say_of_a_maker(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    main(shlex.split(words))
    told = capsys.readouterr()
    assert said in " ".join((told.out + told.err).split())


@pytest.mark.parametrize(
    ("code", "vendor", "said"),
    [
        (102, "toshiba", "Request not supported"), (102, "0x0190", "Request not supported"),
        (201, "rexroth", "Invalid element in the request received last"),
        (201, "siemens", "Above the limit that holds"), (103, "abb", "Communication error"),
        (160, "abb", "Internal communication"),
        (104, "rockwell", "Parameter does not exist"), (106, "bonfiglioli", "No change in operation"),
        (131, "danfoss", "The factory setup cannot be changed"), (17, "danfoss", "Not possible in this"),
        (3, "mitsubishi", "Wrong parameter number"), (67, "mitsubishi", "Value out of range"),
        (20, "bonfiglioli", "System bus does not answer"), (20, "mitsubishi", "Illegal value"),
        (67, "siemens", "Manufacturer-specific error 67: see the manual of SINAMICS, vendor 0x002A"),
        (150, "rexroth", "Manufacturer-specific error 150: see the manual of Bosch Rexroth, vendor 0x0103"),
    ],
)  # fmt: skip
def test_numbers_of_pkw_are_those_of_the_maker(
    code: int, vendor: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["decode", "--as", "pkw-answer", "--vendor", vendor, f"70230000 0000{code:04X}"])
    assert f"error number {code}: {said}" in " ".join(capsys.readouterr().out.split())


def test_every_id_and_every_name_is_of_one_maker() -> None:
    listed = spec._load("vendors.toml")["ids"]
    ids = [number for each in listed.values() for number in each]
    ids += [
        number for each in spec.vendors() for number in (each.id, *each.ids) if number is not None
    ]
    assert len(set(ids)) == len(ids)
    own = {name.lower() for each in spec.vendors() for name in (each.name, *each.also)}
    assert own.isdisjoint(name.lower() for name in listed)
    assert list(listed) == sorted(listed, key=str.lower)


def test_ids_of_services_are_of_one_maker() -> None:
    for table in ("request", "response"):
        codes = [row["code"] for row in spec._rows(table)]
        assert len(set(codes)) == len(codes), table


def test_a_report_without_such_numbers_loads_no_names(captures: Path) -> None:
    asked = (
        "import sys; from ds47.cli import main;"
        "main(['report', '-f', 'json', sys.argv[1]]);"
        "from ds47 import spec; print(spec.vendor_names.cache_info().currsize, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", asked, str(captures / "conversation-read-back.pcapng")],
        capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    json.loads(done.stdout)
    assert done.stderr.splitlines()[-1] == "0"
