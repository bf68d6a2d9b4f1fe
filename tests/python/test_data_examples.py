"""docs/data.md: its tables are those of the schema, its examples run as they stand, and are right."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ds47 import cli
from ds47.report import parquet
from ds47.report.latency import percentile

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / "docs" / "data.md").read_text("utf-8")
NEEDED = ("pyarrow", "duckdb", "pandas")


def blocks() -> list[tuple[str, str, str]]:
    """Heading, language and text of every example, in order."""
    found, heading = [], ""
    for match in re.finditer(r"^(#+) ([^\n]*)$|^```(\w+)\n(.*?)^```$", PAGE, re.M | re.S):
        if match[1]:
            heading = match[2]
        else:
            found.append((heading, match[3], match[4]))
    return found


def query(code: str) -> list[tuple[Any, ...]]:
    """Rows of a query, from a process of its own: DuckDB complains at the end of one with pytest."""
    program = "import duckdb, json, sys; rows = duckdb.sql(sys.stdin.read()).fetchall()\n"
    program += "print(json.dumps(rows, default=str))"
    done = subprocess.run(
        [sys.executable, "-c", program],
        input=code,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [tuple(row) for row in json.loads(done.stdout)]


class Examples:
    """What the examples gave: rows of SQL by heading, the names that Python made."""

    def __init__(self) -> None:
        self.rows: dict[str, list[tuple[Any, ...]]] = {}
        self.names: dict[str, Any] = {}

    def run(self, heading: str, language: str, code: str) -> None:
        if language == "sh":
            for line in code.splitlines():
                program, *arguments = shlex.split(line)
                assert (program, cli.main(arguments)) == ("ds47", 0), line
        elif language == "sql":
            self.rows[heading] = query(code)
        else:
            assert language == "python", heading
            exec(compile(code, f"docs/data.md: {heading}", "exec"), self.names)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, captures: Path) -> Iterator[Path]:
    """A folder with the captures, the present one while the tests run."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing and os.environ.get("DS47_CI") == "1":
        pytest.fail(f"{missing} are missing, and DS47_CI=1 says that they must be there")
    elif missing:
        pytest.skip(f"{missing} are missing")
    folder = tmp_path_factory.mktemp("data")
    (folder / "captures").mkdir()
    (folder / "results").mkdir()
    for each in captures.glob("*.pcapng"):
        shutil.copy(each, folder / "captures")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder


@pytest.fixture(scope="module")
def examples(folder: Path) -> Examples:
    """Every example of the page, run."""
    result = Examples()
    for block in blocks():
        result.run(*block)
    return result


@pytest.fixture(scope="module")
def transactions(examples: Examples, folder: Path) -> list[tuple[str, dict[str, Any]]]:
    """All transactions with their capture, from ndjson."""
    with (folder / "captures.ndjson").open(encoding="utf-8") as lines:
        objects = [json.loads(line) for line in lines]
    return [(each["path"], each["transaction"]) for each in objects if "transaction" in each]


def expected_last(transactions: list[tuple[str, dict[str, Any]]]) -> dict[tuple[Any, ...], str]:
    last = {}
    for path, item in sorted(transactions, key=lambda each: each[1]["id"]):
        for each in item["parameters"]:
            asked = each["pnu"] is not None and each["attribute"] == "value"
            good = item["operation"] == "read" or item["state"] in ("ok", "partial")
            if asked and good and each["error"] is None:
                for step, value in enumerate(each["values"]):
                    place = (path, item["device"], item["slot"], item["axis"], each["pnu"])
                    shown = value if isinstance(value, str) else json.dumps(value)
                    last[(*place, each["subindex"] + step)] = shown
    return last


def expected_errors(transactions: list[tuple[str, dict[str, Any]]]) -> Counter[tuple[int, str]]:
    return Counter(
        (each["error"]["code"], each["error"]["text"])
        for _, item in transactions
        for each in item["parameters"]
        if each["error"]
    )


def test_the_columns_are_those_of_the_schema():
    csv, table = parquet.columns("csv"), parquet.columns("parquet")
    assert f"\nColumns: {', '.join(f'`{column}`' for column in csv)}.\n" in PAGE
    assert set(csv) - set(table) == {"values"}
    more = re.search(r"but for `values`; in its\nplace are (.*?)\. ", PAGE, re.DOTALL)
    assert more
    assert set(re.findall(r"`([\w.]+)`", more[1])) == set(table) - set(csv)


@pytest.mark.slow
def test_last_values(examples, transactions):
    expected = expected_last(transactions)
    assert len(expected) > 100
    assert {
        row[:6]: row[6] for row in examples.rows["Last value of each parameter, per drive"]
    } == (expected)
    series = examples.names["last_values"].items()
    assert {tuple(map(known, place)): value for place, value in series} == expected


def known(value: Any) -> Any:
    """NaN is what a data frame has for null: PKW has neither slot nor axis."""
    return value if value == value else None


@pytest.mark.slow
def test_errors_per_code(examples, transactions):
    expected = expected_errors(transactions)
    assert expected[(0, "Illegal parameter number: the parameter does not exist")] > 5
    assert {row[:2]: row[2] for row in examples.rows["Errors per code"]} == expected


def test_latency(examples, transactions):
    times: dict[tuple[str, str], list[float]] = {}
    for _, item in transactions:
        if item["duration_ms"] is not None and item["duration_ms"] >= 0:
            times.setdefault((item["device"], item["operation"]), []).append(item["duration_ms"])
    rows = examples.rows["Latency percentiles per device"]
    assert {row[:2]: row[2:] for row in rows} == {
        place: (len(each), *(percentile(sorted(each), at) for at in (50, 95, 100)))
        for place, each in times.items()
    }


def test_parameter_over_time(examples, transactions):
    expected = [
        (path, item["operation"], each["values"][0])
        for path, item in transactions
        for each in item["parameters"]
        if item["device"] == "192.168.133.33"
        and item["state"] in ("ok", "partial")
        and (each["pnu"], each["subindex"], each["attribute"]) == (1120, 0, "value")
        and each["values"]
    ]
    rows = examples.rows["A parameter over time"]
    assert len({row[2] for row in rows}) == 2
    assert sorted((path, operation, value) for path, _, operation, value in rows) == sorted(
        expected
    )


def test_captures_with_refusals(examples, transactions):
    rows = examples.rows["Captures with refusals in a folder"]
    assert [(row[0].rpartition("/")[2], *row[2:]) for row in rows] == [
        ("conversation-error.pcapng", 0, 1),
        ("record-write-refused.pcapng", 1, 0),
    ]
    refused = examples.names["refused"]
    assert len(refused) == sum(item["state"] == "refused" for _, item in transactions)
    assert refused["status.write"].dropna().str.fullmatch("[0-9A-F]{8}").all()


def test_findings_by_rule(examples, folder):
    counted: Counter[str] = Counter()
    for line in (folder / "captures.ndjson").read_text("utf-8").removesuffix("\n").split("\n"):
        item = json.loads(line)
        findings = item["findings"] if "findings" in item else item["capture"]["findings"]
        counted.update(each["rule"] for each in findings)
    assert {row[0]: row[2] for row in examples.rows["Findings by rule, from ndjson"]} == counted
    assert examples.names["found"]["rule"].value_counts().to_dict() == counted
