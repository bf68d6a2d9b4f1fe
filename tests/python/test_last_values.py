"""A CSV of last values as a side of `ds47 diff`: against itself, another one, a capture; and what is none."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from ds47.analysis import analyze
from ds47.cli import main
from ds47.regression.last_values import NoTableError, difference, read, table
from ds47.report.parameters import COLUMNS

CAPTURES = Path(__file__).parents[2] / "captures"
TOUR = CAPTURES / "tour-machine.pcapng"
MANY = sorted([*CAPTURES.glob("*.pcapng"), *CAPTURES.glob("real-stacks/*.pcapng")])


def written(folder: Path, capture: Path = TOUR) -> Path:
    path = folder / f"{capture.stem}.csv"
    main(["report", "-f", "parameters", "-o", str(path), str(capture)])
    return path


def changed(path: Path, name: str, **cells: str) -> Path:
    """The table with other cells in the first row of a parameter that has a value."""
    rows = list(csv.DictReader(io.StringIO(path.read_text("utf-8"))))
    next(row for row in rows if row["pnu"] == name and row["known"]).update(cells)
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    other = path.with_name("other.csv")
    other.write_text(text.getvalue(), "utf-8")
    return other


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    capsys.readouterr()
    try:
        status = main(["diff", *map(str, arguments)])
    except SystemExit as end:
        status = int(end.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


@pytest.mark.parametrize("path", MANY, ids=lambda path: path.name)
def test_a_capture_has_the_last_values_that_its_table_has(path: Path, tmp_path: Path) -> None:
    result = analyze(path)
    lines = table(result)
    found = difference(lines, read(written(tmp_path, path).read_text("utf-8")), ("a", "b"))
    assert len(found.rows) == len(lines)
    assert {row.result for row in found.rows} <= {"same", "open"}
    assert found.compared == sum(each.value is not None for each in lines)


def test_another_value_is_told_with_how_it_is_known(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = written(tmp_path)
    other = changed(path, "50303", value="19.5", certain="true")
    status, out, _ = run(capsys, other, TOUR, "--exit-code")
    assert status == 1
    lines = out.splitlines()
    assert lines[3].startswith("1 of ")
    assert "  press-1-drive DO 2: other last values: p50303[0] 19.5 s -> 10.0 s" in out
    (line,) = [each for each in lines if "p50303[0] last value" in each]
    assert line.endswith("A: 19.5 s, read; B: 10.0 s, read, may have changed since")
    assert run(capsys, path, TOUR)[1].splitlines()[3].startswith("None of the ")
    assert "states" not in out
    assert "duration" not in out


def test_what_one_side_did_not_ask_for_is_one_line(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = written(tmp_path)
    text = path.read_text("utf-8").splitlines(keepends=True)
    other = tmp_path / "fewer.csv"
    other.write_text("".join(text[:3]), "utf-8")
    out = run(capsys, other, path)[1]
    count = len(text) - 3
    assert out.count("requested in one capture only") == 1
    assert f"requested in one capture only: {count} elements in B" in out
    assert len(run(capsys, other, path, "--all")[1].splitlines()) > len(out.splitlines())


def test_json_page_and_chinese(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = written(tmp_path)
    other = changed(path, "50303", value="1999")
    told = json.loads(run(capsys, path, other, "-f", "json")[1])
    (row,) = [each for each in told["parameters"] if each["result"] == "different"]
    assert (row["operation"], row["pnu"], row["b"]["last"]) == ("last", 50303, 1999)
    assert [each["kind"] for each in told["conclusions"]] == ["last-values"]
    page = run(capsys, path, other, "-f", "html")[1]
    assert "other last values" in page
    assert "Median" not in page
    shown = run(capsys, path, other, "--lang", "zh")[1]
    assert "最后的值不同" in shown
    assert "读取" in shown


def test_a_stored_result_is_a_side(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    stored = TOUR.with_name("tour-machine.ds47.json")
    assert run(capsys, written(tmp_path), stored, "--exit-code")[0] == 0


@pytest.mark.parametrize("way", ["semicolons", "mark"])
def test_a_table_that_a_spreadsheet_saved_is_read(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, way: str
) -> None:
    path = written(tmp_path)
    text = path.read_text("utf-8")
    if way == "semicolons":
        rows = csv.reader(io.StringIO(text))
        stream = io.StringIO()
        csv.writer(stream, delimiter=";").writerows(rows)
        text = stream.getvalue()
    other = tmp_path / "saved.CSV"
    other.write_text(text, "utf-8-sig")
    status, out, _ = run(capsys, path, other, "--exit-code")
    assert (status, out.splitlines()[3][:12]) == (0, "None of the ")


REST = ",,,,,1,0,,,5,,,read,,,,,,"


@pytest.mark.parametrize(
    ("text", "about"),
    [
        ("", "its first line has no path, device, station"),
        ("a,b\n1,2\n", "no CSV of `ds47 report -f parameters`"),
        (",".join(COLUMNS) + "\n1,2\n", "row 2 has another number of cells"),
        (",".join(COLUMNS) + "\n" + "," * 18 + "x\n", "row 2: pnu is '', not a number"),
        (",".join(COLUMNS) + "\n" + ",,,,,1,0,,,5,,,guessed,,,,,,\n", "known is 'guessed'"),
        (",".join(COLUMNS) + "\na" + REST + "\nb" + REST + "\n", "a table of 2 captures"),
        ('"' + "x" * 200_000 + '"\n', "no CSV"),
    ],
)  # fmt: skip
def test_another_csv_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, text: str, about: str
) -> None:
    with pytest.raises(NoTableError, match=r"\w"):
        read(text)
    path = tmp_path / "other.csv"
    path.write_text(text, "utf-8")
    status, out, err = run(capsys, path, TOUR)
    assert (status, out) == (2, "")
    assert err.startswith("ds47: error: ")
    assert f"{path}: " in err
    assert about in err


def test_bytes_that_are_no_text_are_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "broken.csv"
    path.write_bytes(b"\xff\xfe\x00")
    status, _, err = run(capsys, path, TOUR)
    assert status == 2
    assert "codec" in err


ROW = {
    "path": "x",
    "device": "10.0.0.1",
    "known": "read",
    "certain": "true",
    "subindex": "0",
    "pnu": "100",
}


def made(*rows: dict[str, str]) -> str:
    lines = [
        ",".join(COLUMNS),
        *(",".join((ROW | row).get(name, "") for name in COLUMNS) for row in rows),
    ]
    return "\n".join(lines)


DO_2 = {"target": "DO 2", "drive_object": "2", "value": "6"}
SLOT = {"target": "slot 1.1 DO 2", "drive_object": "2", "value": "6"}
DO_3 = {"target": "DO 3", "drive_object": "3", "value": "6"}
TEXT = {"format": "VisibleString4"}


@pytest.mark.parametrize(
    ("a", "b", "results"),
    [
        ([SLOT], [DO_2], ["same"]),
        ([SLOT | {"value": "5"}], [DO_2], ["different"]),
        ([{"target": "axis 2", "value": "5"}], [DO_2], ["other way", "other way"]),
        ([DO_3], [DO_2], ["only", "only"]),
        (
            [{"value": "5", "format": "Integer16"}],
            [{"value": "5.0", "format": "Float32"}],
            ["same"],
        ),
        ([TEXT | {"value": "5"}], [TEXT | {"value": "5.0"}], ["different"]),
        ([{"known": "", "certain": ""}], [{"value": "5"}], ["open"]),
        ([SLOT | {"value": "5"}, DO_2], [DO_2], ["other way", "same"]),
    ],
)
def test_only_what_is_proved_to_be_the_same_place_is_compared(
    a: list[dict[str, str]], b: list[dict[str, str]], results: list[str]
) -> None:
    found = difference(read(made(*a)), read(made(*b)), ("a", "b"))
    assert sorted(row.result for row in found.rows) == results
