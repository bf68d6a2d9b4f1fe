"""`ds47 params`: lists as engineers have them, taken in, looked up, removed; and what is no list."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ds47.cli import main
from ds47.parameters import lists, store
from ds47.parameters.catalogue import Catalogue
from ds47.parameters.lists import ListedMessage, ListedParameter, ParameterList
from ds47.profidrive.naming import Spelled, spelled
from ds47.report.load import capture

GERMAN = (
    "Nr.;Bezeichnung;Einheit;Datentyp;Auswahl\n"
    "p0304[0...n];Motor-Bemessungsspannung;Veff;FloatingPoint32;\n"
    "r0945[0...63];Störcode;;Unsigned16;\n"
    'p1300[0];Steuerungsart;;Integer16;"0: U/f linear; 20: Drehzahlregelung"\n'
    "F07900;Antrieb: Motor blockiert;;;\n"
    "quark;;;;\n"
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    place = tmp_path / "a home" / "lists"
    monkeypatch.setenv(store.VARIABLE, str(place))
    return place


def write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("p0945", Spelled(945, "p", None)),
        ("r945[0]", Spelled(945, "r", 0)),
        ("R0945[0...63]", Spelled(945, "r", 0)),
        ("p0304[0...n]", Spelled(304, "p", 0)),
        ("P700", Spelled(700, "p", None)),
        ("PNU 945", Spelled(945, None, None)),
        ("pnu945", Spelled(945, None, None)),
        ("r0722.2", Spelled(722, "r", 2)),
        (" 61000 ", Spelled(61000, None, None)),
        ("65536", None),
        ("p1[70000]", None),
        ("F07900", None),
        ("p", None),
        ("", None),
        ("p12x", None),
    ],
)
def test_a_number_in_every_spelling(text, found):
    assert spelled(text) == found


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("mark", [";", ",", "\t"])
def test_params_are_read_from_a_table_of_separated_values(tmp_path, encoding, mark):
    text = GERMAN.replace(
        '"0: U/f linear; 20: Drehzahlregelung"', '"0: U/f linear | 20: Drehzahlregelung"'
    )
    found = lists.read(write(tmp_path / "g120.csv", text.replace(";", mark), encoding))
    assert found.name == "g120"
    assert found.source == "g120.csv"
    assert found.rows == [
        ListedParameter(304, "Motor-Bemessungsspannung", "p", "Veff", "Float32", {}),
        ListedParameter(945, "Störcode", "r", None, "Unsigned16", {}),
        ListedParameter(
            1300, "Steuerungsart", "p", None, "Integer16", {0: "U/f linear", 20: "Drehzahlregelung"}
        ),
    ]
    assert found.messages == [ListedMessage("F", 7900, "Antrieb: Motor blockiert")]
    assert found.passed_over == ["row 6: 'quark' is the number of no parameter"]


@pytest.mark.parametrize(
    ("number", "access", "found"),
    [
        ("1120", "p", "p"),
        ("1120", "r/w", "p"),
        ("1120", "RW", "p"),
        ("1120", "Read / Write", "p"),
        ("1120", "W", "p"),
        ("21", "r", "r"),
        ("21", "R/O", "r"),
        ("21", "read-only", "r"),
        ("21", "只读", "r"),
        ("21", "", None),
        ("21", "rarely", None),
        ("r0021", "", "r"),
        ("r0021", "r/w", "r"),
        ("P1120", "r", "p"),
    ],
)
def test_what_may_be_written(tmp_path, number, access, found):
    path = write(tmp_path / "a.csv", f"number,name,access\n{number},A name,{access}\n")
    assert [row.access for row in lists.read(path).rows] == [found]


def test_columns_that_nobody_would_guess(tmp_path, capsys):
    path = write(tmp_path / "own.csv", "made by hand,,\nParam,What it is,in\n2900,Fixed value,%\n")
    assert main(["params", "import", str(path)]) == 3
    assert "--columns number=HEADING,name=HEADING" in capsys.readouterr().err
    columns = "number=Param,name=What it is,unit=in"
    assert main(["params", "import", str(path), "--columns", columns, "--name", "mine"]) == 0
    assert "imported as mine: 1 parameter, 0 faults and alarms" in capsys.readouterr().out
    assert main(["params", "import", str(path), "--columns", "Param"]) == 2
    assert main(["params", "import", str(path), "--columns", "price=Param"]) == 2


def test_a_workbook(tmp_path, capsys):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Only a title"])
    sheet = book.create_sheet("Parameter")
    sheet.append(["Parameter", "Parameter text", "Unit"])
    sheet.append(["p1120[0]", "Ramp-up time", "s"])
    sheet.append([2900, "Fixed value 1", "%"])
    book.save(tmp_path / "export.xlsx")
    found = lists.read(tmp_path / "export.xlsx", sheet="Parameter")
    assert found.rows == [
        ListedParameter(1120, "Ramp-up time", "p", "s"),
        ListedParameter(2900, "Fixed value 1", None, "%"),
    ]
    assert main(["params", "import", str(tmp_path / "export.xlsx"), "--sheet", "Params"]) == 3
    assert "no sheet 'Params'; there are: Sheet, Parameter" in capsys.readouterr().err
    write(tmp_path / "broken.xlsx", "no zip")
    assert main(["params", "import", str(tmp_path / "broken.xlsx")]) == 3
    assert "no workbook of Excel 2007 or later" in capsys.readouterr().err


TOML = """\
[list]
name = "Press"
vendor_id = 0x002A
device_ids = [0x0501]
firmware = "4.8"

[[parameter]]
number = "p1120"
name = "Ramp-up time"
unit = "s"
type = "Float32"

[[parameter]]
number = 700
name = "Source"
values = { 2 = "terminal", -1 = "none" }

[[message]]
number = "F7900"
text = "Motor blocked"
"""


def test_the_form_of_our_own(tmp_path):
    found = lists.read(write(tmp_path / "press.toml", TOML))
    assert (found.name, found.vendor_id, found.device_ids, found.firmware) == (
        "Press",
        0x2A,
        (0x501,),
        "4.8",
    )
    again = lists.read(write(tmp_path / "again.toml", lists.write(found)))
    assert again.rows == found.rows
    assert again.messages == found.messages
    assert again.source == "press.toml", "where it was from first"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[list", "no TOML"),
        ("list = 1", "[list] is not a table"),
        ("parameter = 1", "[[parameter]] is not a list of tables"),
        ('[[parameter]]\nnumber = "x"\nname = "y"', "[[parameter]] 1: wants number and name"),
        ("[[parameter]]\nnumber = 1", "wants number and name"),
        ('[[parameter]]\nnumber = 1\nname = "y"\naccess = "w"', "access is 'p' or 'r'"),
        ('[[parameter]]\nnumber = 1\nname = "y"\ntype = "Nibble"', "no type 'Nibble'"),
        ('[[parameter]]\nnumber = 1\nname = "y"\nvalues = ["a"]', "values is a table"),
        ('[[message]]\nnumber = "7900"\ntext = "y"', "wants number, such as F07900"),
        ("[list]\nvendor_id = 70000", "vendor_id is not a number of 16 bits"),
        ("[list]\ndevice_ids = 7", "device_ids is not a list of numbers"),
        ("", "no row has the number of a parameter or a fault"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, capsys, text, why):
    path = write(tmp_path / "list.toml", text)
    assert main(["params", "import", str(path)]) == 3
    error = capsys.readouterr().err
    assert error.startswith(f"ds47: error: {path}: ")
    assert why in error
    assert error.count("\n") == 1


def test_a_file_that_is_not_there(tmp_path, capsys):
    assert main(["params", "import", str(tmp_path / "none.csv")]) == 3
    assert "No such file" in capsys.readouterr().err


def test_taken_in_shown_listed_replaced_and_removed(tmp_path, capsys, folder):
    path = write(tmp_path / "g120.csv", GERMAN)
    assert main(["params", "import", str(path), "--vendor", "sinamics", "--firmware", "4.7"]) == 0
    assert (folder / "g120.toml").is_file()
    capsys.readouterr()
    assert main(["params", "import", str(path), "--vendor", "0x2A"]) == 0
    assert "replaced g120" in capsys.readouterr().out
    assert main(["params", "list", "-f", "json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)
    assert (told["name"], told["vendor_id"], told["parameters"], told["messages"]) == (
        "g120",
        0x2A,
        3,
        1,
    )
    assert main(["params", "show", "r0945", "-f", "json"]) == 0
    shipped, own = json.loads(capsys.readouterr().out)
    assert (shipped["name"], own["name"], own["letter"]) == ("Fault code", "Störcode", "r")
    assert main(["params", "show", "F7900"]) == 0
    assert capsys.readouterr().out.startswith("F07900  Antrieb: Motor blockiert\n")
    assert main(["params", "show", "blockiert"]) == 1
    assert main(["params", "show", "steuerungs"]) == 0
    assert "20 = Drehzahlregelung" in capsys.readouterr().out
    assert main(["params", "remove", "g121"]) == 1
    assert "there are: g120" in capsys.readouterr().err
    assert main(["params", "remove", "g120"]) == 0
    assert list(folder.iterdir()) == []
    assert main(["params", "list"]) == 0


@pytest.mark.parametrize("vendor", ["nobody", "70000", "-1"])
def test_a_vendor_that_is_none(tmp_path, vendor):
    path = write(tmp_path / "g120.csv", GERMAN)
    assert main(["params", "import", str(path), "--vendor", vendor]) == 2


def test_a_kept_list_that_somebody_broke_is_named(folder, capsys):
    folder.mkdir(parents=True)
    write(folder / "broken.toml", "[[")
    for command in (["show", "2900"], ["list"]):
        assert main(["params", *command]) == 3
        assert "broken.toml: no TOML" in capsys.readouterr().err


def of(name: str, text: str, **about: object) -> ParameterList:
    return ParameterList(name, rows=[ListedParameter(1120, text)], **about)  # type: ignore[arg-type]


def test_the_list_that_is_made_for_the_device_comes_first():
    catalogue = Catalogue([
        of("device", "of the device", vendor_id=0x2A, device_ids=(0x501,)),
        of("old", "old", vendor_id=0x2A, firmware="4.7 SP3"),
        of("new", "new", vendor_id=0x2A, firmware="4.7 SP13"),
        of("all", "for all"),
    ])  # fmt: skip
    told = {
        ids: entry.row.name if (entry := catalogue.row(1120, *ids)) else None
        for ids in ((0x2A, 0x501), (0x2A, 0x502), (0x2A, None), (0x1A, 0x501), (None, None))
    }
    assert list(told.values()) == ["of the device", "new", "new", "for all", "for all"]
    assert catalogue.row(1121, 0x2A, 0x501) is None
    assert Catalogue([of("one", "one"), of("two", "two")]).row(1120, None, None).row.name == "two"
    assert Catalogue().is_empty


@pytest.mark.parametrize(
    "name", ["CON", "a/b", "..", "  ", "Presse 1", "G120: 4.7", "nul.v2", "COM¹", "Aux.a.b"]
)
def test_names_of_files_that_every_system_takes(name):
    found = store.file_name(name)
    assert found
    assert not set(found) & set('<>:"/\\|?* ')
    assert found.split(".")[0].upper() not in ("CON", "AUX", "NUL", "COM¹")
    assert not found.startswith(".")


@pytest.mark.slow
@given(st.lists(st.lists(st.text(max_size=8), max_size=5), max_size=6))
def test_no_table_is_an_exception(table):
    told = "a list"
    try:
        lists._of_table("any", iter(table), {})
    except lists.ListError as problem:
        told = str(problem)
    assert len(told.splitlines()) == 1


@given(st.text(max_size=40))
def test_a_text_survives_its_file(text):
    name = " ".join(text.split()) or "x"
    kept = ParameterList(name, rows=[ListedParameter(1, name, values={1: name})])
    import tomllib

    document = tomllib.loads(lists.write(kept))
    assert document["parameter"][0]["values"]["1"] == name


OWN = """\
[list]
name = "own"
vendor_id = 0x002A

[[parameter]]
number = "p50076"
name = "Erregerstrom"
unit = "%"

[[parameter]]
number = "r0945"
name = "Störcode"
"""


@pytest.fixture
def own(tmp_path):
    return write(tmp_path / "own.toml", OWN)


def names(capsys, *arguments):
    main(["report", "-f", "json", *map(str, arguments)])
    document = json.loads(capsys.readouterr().out)
    parameters = [
        each for item in document["captures"][0]["transactions"] for each in item["parameters"]
    ]
    return {each["pnu"]: (each["name"], each["unit"]) for each in parameters}, document


def test_a_report_names_what_a_list_names(own, captures, capsys):
    tour = captures / "tour-machine.pcapng"
    found, document = names(capsys, "--params", own, tour)
    assert found[50076] == ("Erregerstrom", "%")
    assert found[945] == ("Störcode", None), "a list of the user comes before what is shipped"
    assert found[50303] == ("Ramp-function generator ramp-up time 1", "s")
    assert all("described_in" not in each for item in document["captures"][0]["transactions"]
               for each in item["parameters"])  # fmt: skip
    again = capture(document["captures"][0])
    assert [each.name for item in again.transactions for each in item.parameters] == [
        each["name"]
        for item in document["captures"][0]["transactions"]
        for each in item["parameters"]
    ]


def test_lists_that_were_taken_in_count_for_a_report_and_not_for_a_check(
    own, captures, capsys, tmp_path
):
    assert main(["params", "import", str(own)]) == 0
    tour = tmp_path / "tour.pcapng"
    shutil.copy(captures / "tour-machine.pcapng", tour)
    capsys.readouterr()
    found, _ = names(capsys, tour)
    assert found[50076] == ("Erregerstrom", "%")
    main(["report", str(tour)])
    assert "p50076[1] (Erregerstrom) := 100.0 %" in capsys.readouterr().out
    assert main(["baseline", str(tour)]) == 0
    assert "Erregerstrom" not in (tmp_path / "tour.ds47.json").read_text("utf-8")
    assert main(["report", "--params", str(tmp_path / "none.toml"), str(tour)]) == 2


def test_a_list_of_another_vendor_names_nothing(own, captures, capsys):
    write(own, OWN.replace("0x002A", "0x001A"))
    found, _ = names(capsys, "--params", own, captures / "tour-machine.pcapng")
    assert found[50076] == (None, None)
    assert found[945] == ("Fault code", None)


def test_what_a_drive_says_itself_comes_before_a_list(tmp_path, captures, capsys):
    described = captures / "format-description.pcapng"
    plain, _ = names(capsys, described)
    said = {pnu for pnu, (name, _) in plain.items() if name}
    path = write(
        tmp_path / "all.toml",
        "".join(
            f'[[parameter]]\nnumber = {pnu}\nname = "of the list"\nunit = "furlong"\n'
            for pnu in plain
        ),
    )
    found, document = names(capsys, "--params", path, described)
    by_drive = [each for item in document["captures"][0]["transactions"] for each in item["parameters"]
                if each.get("described_in")]  # fmt: skip
    for each in by_drive:
        assert each["unit"] != "furlong"
    assert found.keys() == plain.keys()
    assert said <= found.keys()


def test_explain_says_what_lists_have(tmp_path, capsys):
    assert main(["params", "import", str(write(tmp_path / "g120.csv", GERMAN))]) == 0
    capsys.readouterr()
    assert main(["explain", "F7900"]) == 0
    assert capsys.readouterr().out.startswith(
        "F07900  Antrieb: Motor blockiert\n      list g120: from g120.csv\nF07900: "
    )
    assert main(["explain", "r945"]) == 0
    assert capsys.readouterr().out.startswith("r0945  Störcode  (Unsigned16)\n")
    assert main(["explain", "p1300", "-f", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["lists"][0]["values"] == {
        "0": "U/f linear",
        "20": "Drehzahlregelung",
    }
    assert main(["explain", "7900"]) == 0  # what is in r0945, or the first word of PKW
    assert capsys.readouterr().out.startswith(
        "F07900  Antrieb: Motor blockiert\n      list g120: from g120.csv\nPKE 16#7900: "
    )
    assert main(["explain", "47", "-f", "json"]) == 0
    assert "lists" not in json.loads(capsys.readouterr().out)
    assert main(["explain", "F7901", "-f", "json"]) == 0
    assert "lists" not in json.loads(capsys.readouterr().out)
