"""`import ds47`: the examples of docs/python.md, and that the library says what the report says."""

from __future__ import annotations

import inspect
import io
import json
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, get_origin

import pytest

import ds47
from ds47 import cli, spec

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
REQUEST, RESPONSE = "03010201 1001C47F0000", "03010201 080141200000"


DIFFERENT = {"corrected", "message", "meaning"}
"""Keys of the JSON that are no attribute with that value: docs/python.md tells where else they are."""


def run(page: str, pyshark: bool = False) -> str:
    """What the examples of a page print, those with pyshark or the others.

    In a process of their own, as a user has it: DuckDB complains at the end of one with pytest.
    """
    examples = EXAMPLE.findall((ROOT / page).read_text("utf-8"))
    code = "import ds47\n" + "".join(each for each in examples if ("pyshark" in each) == pyshark)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env={**os.environ, "PYTHONUTF8": "1"},
        capture_output=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_of_the_readme_runs() -> None:
    assert run("README.md") == "192.168.133.33 2 [7900, 30002, 0, 0]\n"


def test_the_examples_of_the_first_pages_run() -> None:
    assert run("docs/how-to/go-on-with-the-data.md") == "192.168.133.33 2 [7900, 30002, 0, 0]\n"
    told = run("docs/start/developer.md").splitlines()
    assert told[0] == "1 read ok 3.0"
    assert told[-1] == "192.168.133.33 [7900, 30002, 0, 0]"


def test_the_examples_run_as_they_stand() -> None:
    for package in ("pandas", "pyarrow", "duckdb", "scapy"):
        if find_spec(package) is None:
            pytest.skip(f"no {package}")
    told = run("docs/python.md")
    assert "<ds47 result of <frames>: 8 transactions, 9 findings>" in told
    assert "captures/record-global.pcapng OK: " in told
    assert "<ds47 transaction #8: change unanswered, 192.168.133.33 DO 2, " in told
    assert "50303 Float32 [10.0]" in told
    assert "192.168.133.33 DO 2 p50303[0] 10.0" in told
    assert "03 01 02 01 10 08 03 b1 00 00" in told


@pytest.mark.plugin
def test_packets_of_pyshark() -> None:
    pytest.importorskip("pyshark")
    if shutil.which("tshark") is None:
        pytest.skip("no tshark")
    told = run("docs/python.md", pyshark=True)
    assert told == "<ds47 result of <frames>: 8 transactions, 9 findings>\n"


def test_an_error_is_worded_when_somebody_asks() -> None:
    result = ds47.analyze(ROOT / "captures" / "conversation-error.pcapng")
    (error,) = (item.error for _, item in result.parameters if item.error)
    vendor_id = result.devices[0].vendor_id
    assert error.text == result.message(error) == spec.error_text(error.code, "en", vendor_id)
    assert result.message(error, lang="zh") == spec.error_text(error.code, "zh", vendor_id)


def test_every_name_is_there_and_told() -> None:
    for name in ds47.__all__:
        thing = getattr(ds47, name)
        if name == "__version__" or get_origin(thing) is Literal:
            continue
        assert thing.__doc__, name
        if inspect.isfunction(thing):
            assert "Raises:" in thing.__doc__
            assert inspect.signature(thing).return_annotation
    assert set(ds47.__all__) <= set(dir(ds47))
    with pytest.raises(AttributeError, match="has no attribute 'analyse'"):
        ds47.analyse  # noqa: B018


def test_importing_it_loads_no_room() -> None:
    code = "import ds47, sys; print([name for name in sys.modules if name.startswith('ds47.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['ds47.version']"


@pytest.mark.parametrize("name", ["tour-machine", "record-global", "record-multiple"])
def test_it_says_what_the_report_says(
    captures: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(captures / f"{name}.pcapng")
    assert cli.main(["report", "-f", "json", path]) == 0
    told = json.loads(capsys.readouterr().out)
    result = ds47.analyze(path)
    assert result.to_dict() == told
    (capture,) = told["captures"]
    assert (result.path, result.frames, result.start) == (path, capture["frames"], capture["start"])
    assert [result.message(each) for each in result.findings] == [
        each["message"] for each in capture["findings"]
    ]
    for item, plain in zip(result, capture["transactions"], strict=True):
        assert item.start == plain["start"]
        assert item.duration_ms == plain["duration_ms"]
        assert item.status._asdict() == plain["status"]
        assert item.bytes._asdict() == plain["bytes"]
        told = [each.get("meaning") for each in plain["parameters"]]
        assert [result.meaning(each) for each in item.parameters] == told
        assert [each._asdict() for each in item.frames.polls] == plain["frames"]["polls"]


@pytest.mark.parametrize("name", ["tour-machine", "record-global", "record-reread"])
def test_attributes_have_the_names_of_the_json(captures: Path, name: str) -> None:
    result = ds47.analyze(captures / f"{name}.pcapng", digest=True)
    (capture,) = result.to_dict()["captures"]
    for item, plain in zip(result.diagnoses, capture["diagnoses"], strict=True):
        assert result.message(item) == plain["message"]
        assert result.filter(item) == plain.pop("filter")
    for finding, plain in zip(result.findings, capture["findings"], strict=True):
        assert result.filter(finding) == plain["filter"]
    same(result, capture)


def same(thing: Any, plain: Any) -> None:
    """Asserts that a value of the JSON is a value of the library, and its keys are attributes."""
    if isinstance(plain, dict) and not isinstance(thing, dict):
        for key in plain.keys() - DIFFERENT:
            same(getattr(thing, key), plain[key])
    elif isinstance(plain, list):
        for one, other in zip(thing, plain, strict=True):
            same(one, other)
    else:
        assert thing == plain


def test_a_table_without_pandas(captures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    result = ds47.analyze(captures / "tour-machine.pcapng")
    with pytest.raises(ds47.Error) as told:
        result.to_frame()
    assert str(told.value) == f"to_frame needs pandas: {sys.executable} -m pip install pandas"


def test_a_table_without_pyarrow(captures: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    result = ds47.analyze(captures / "tour-machine.pcapng")
    with pytest.raises(
        ds47.NotReadyError, match=r"to_arrow needs pyarrow: .* -m pip install pyarrow"
    ):
        result.to_arrow()


@pytest.mark.parametrize("by_argument", [True, False])
def test_the_tshark_that_is_asked(
    captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by_argument: bool
) -> None:
    pytest.importorskip("pyshark")
    program = str(tmp_path / "no tshark")
    monkeypatch.setenv("DS47_TSHARK", "another" if by_argument else program)
    with pytest.raises(ds47.NotReadyError, match=re.escape(program)):
        ds47.analyze(
            captures / "tour-machine.pcapng",
            engine="tshark",
            tshark=program if by_argument else None,
        )


def test_the_table_has_the_cells_of_the_csv(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pandas = pytest.importorskip("pandas")
    path = str(captures / "tour-machine.pcapng")
    table = ds47.analyze(path).to_frame()
    assert cli.main(["report", "-f", "csv", path]) == 0
    told = pandas.read_csv(io.StringIO(capsys.readouterr().out)).sort_values(
        "transaction", kind="stable", ignore_index=True
    )
    assert list(table.columns) == list(told.columns)
    for name in ("transaction", "pnu", "subindex", "state", "error.code", "duration_ms"):
        assert table[name].equals(told[name].astype(table[name].dtype)), name
    assert {name for name in table if table[name].dtype == object} == {"values", "scaled"}
    assert {str(table[name].dtype) for name in ("pnu", "frames.read_request", "station")} == {
        "Int64"
    }
    assert str(table["start"].dtype) == "datetime64[ns, UTC]"


def test_what_a_parameter_held_last(captures: Path) -> None:
    last = ds47.analyze(captures / "tour-machine.pcapng").last_values()
    key = ds47.Element("192.168.133.33", "DO 2", 50304, 0)
    assert last[key].value == 60.0
    assert last[key].transaction.frames.read_response == 17
    assert not any(each.pnu == 50999 for each in last)  # it has a negative response only


def test_an_element_inside_an_array_is_found(captures: Path) -> None:
    result = ds47.analyze(captures / "tour-machine.pcapng")
    assert len(result.by_pnu(945)) == len(result.by_pnu(945, 3)) > 0
    assert result.by_pnu(945, 4) == []


def test_choices_that_there_cannot_be(captures: Path, tmp_path: Path) -> None:
    path = captures / "tour-machine.pcapng"
    with pytest.raises(ValueError, match="no rule has the number or name 'DS99x'"):
        ds47.analyze(path, select=["DS99x"])
    with pytest.raises(ValueError, match="no engine 'wireshark'"):
        ds47.analyze(path, engine="wireshark")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="not the files of one ring buffer"):
        ds47.analyze([path, captures / "record-global.pcapng"])
    with pytest.raises(ds47.CaptureError, match="nowhere"):
        ds47.analyze(tmp_path / "nowhere.pcapng")


def test_rules_are_chosen_by_name_too(captures: Path) -> None:
    result = ds47.analyze(captures / "tour-machine.pcapng", select=["DS410"], ignore=["DS7"])
    assert {each.rule for each in result.findings} == {"DS410"}


def test_a_message_without_a_capture() -> None:
    request = ds47.decode_request(REQUEST)
    assert (request.kind, request.request_id, request.response_id) == ("request", 1, None)
    assert (request.request_reference, request.axis, request.parameter_count) == (3, 2, 1)
    alone = ds47.decode_response(bytes.fromhex(RESPONSE))
    assert [each.pnu for each in alone.parameters] == [None]
    (known,) = ds47.decode_response(RESPONSE, REQUEST).parameters
    assert (known.pnu, known.values) == (50303, [10.0])
    with pytest.raises(ValueError, match="cannot be a response"):
        ds47.decode_response(RESPONSE, alone)
    with pytest.raises(ValueError, match="no bytes"):
        ds47.decode_request(" ")


def test_broken_bytes_are_findings() -> None:
    broken = ds47.decode_request(REQUEST[:-4])
    (finding,) = broken.findings
    assert (finding.rule, finding.offset) == ("DS315", 8)
    assert broken.to_dict()["findings"][0]["message"] == finding.message


def test_a_line_that_cannot_be_understood() -> None:
    with pytest.raises(ValueError, match="fetch"):
        ds47.encode("fetch p945")
