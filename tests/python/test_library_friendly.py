"""The library takes what people type: lines as the command does, one text where several are possible."""

from __future__ import annotations

import csv
import inspect
import io
import json
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import pytest
from handmade import transaction

import ds47
from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.cli import main
from ds47.model import CaptureResult
from ds47.report.targets import Telegrams


@pytest.mark.parametrize(
    "line",
    ["change axis 3 p1120=5.0", "read ref 3 axis 2 p945[0..7]", "pkw read p1082", "change DO 2 p1121=1.5"],
)  # fmt: skip
def test_a_line_gives_the_bytes_of_the_command(
    line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["encode", line]) == 0
    assert ds47.encode(line) == bytes.fromhex(capsys.readouterr().out)


def test_a_text_is_one_of_several(captures: Path) -> None:
    path = captures / "tour-machine.pcapng"
    one = ds47.analyze(path, select="DS4", ignore="DS417", channels="ds47")
    several = ds47.analyze(path, select=["DS4"], ignore=["DS417"], channels=["ds47"])
    assert one.to_dict() == several.to_dict()
    assert {each.rule[:3] for each in one.findings} == {"DS4"}
    with pytest.raises(ValueError, match="no channel 'pk'"):
        ds47.analyze(path, channels="pk")
    with pytest.raises(TypeError, match="slow_ms is 'a': a number of milliseconds"):
        ds47.analyze(path, slow_ms="a")  # type: ignore[arg-type]


def test_one_base_for_what_is_raised_on_purpose() -> None:
    assert issubclass(ds47.CaptureError, ds47.Error)
    assert issubclass(ds47.NotReadyError, ds47.Error)
    with pytest.raises(ds47.Error, match="No such file"):
        ds47.analyze("/no/such.pcapng")


def test_what_a_person_reads(captures: Path) -> None:
    request = ds47.decode_request("01 01 02 01 10 01 03 A9 00 00")
    assert repr(request) == "<ds47 request: 01 01 02 01 10 01 03 a9 00 00>"
    result = ds47.analyze(captures / "tour-machine.pcapng")
    assert result.verdict().startswith("NOT OK: 192.168.133.2 writes while its own request is open")
    assert result.verdict("zh").startswith("不正常：")


def test_a_line_that_a_person_reads(captures: Path) -> None:
    result = ds47.analyze(captures / "tour-machine.pcapng")
    name = "p50303[0] (Ramp-function generator ramp-up time 1)"
    assert repr(result.transactions[0]) == (
        f"<ds47 transaction #1: read ok, 192.168.133.33 DO 2, {name} = 10.0 s, frames 2 to 5, 3.0 ms>"
    )
    assert repr(result.transactions[0].parameters) == f"[<ds47 parameter {name} = 10.0 s>]"
    assert repr(result.diagnoses[1]) == (
        "<ds47 diagnosis DS719 error, frame 29: p50076[1] cannot be changed now: "
        "0x6B No change access while the controller is enabled>"
    )
    refused = next(each for each in result.findings if each.rule == "DS203")
    assert repr(refused) == (
        "<ds47 finding DS203 error, frame 23, #5: "
        "Write refused with status DF80B500: write: access: state conflict>"
    )
    (wrong,) = (each.error for _, each in result.parameters if each.error and each.pnu == 50076)
    assert repr(wrong) == "<ds47 error 0x6B: No change access while the controller is enabled>"
    refused.rule = "DS000"  # as a test may make one by hand
    assert repr(refused).startswith("Finding(rule='DS000', severity='error', frame=23")


def test_what_a_line_has_of_many(captures: Path) -> None:
    """Every repr is one line, and no longer than a person reads."""
    for path in sorted(captures.glob("*-*.pcapng"))[::20]:
        result = ds47.analyze(path)
        things = [
            *result,
            *result.findings,
            *result.diagnoses,
            *(each for _, each in result.parameters),
        ]
        for each in things:
            assert repr(each).isprintable(), path
            assert len(repr(each)) < 600, path


def test_times_of_python(captures: Path) -> None:
    result = ds47.analyze(captures / "tour-machine.pcapng")
    begun = result.transactions[0].start_time
    assert begun == datetime(2026, 1, 1, 8, 0, 0, 1000, tzinfo=UTC)
    assert (result.start_time, result.end_time) == (
        datetime(2026, 1, 1, 8, tzinfo=UTC), datetime(2026, 1, 1, 8, 0, 13, 506000, tzinfo=UTC),
    )  # fmt: skip
    assert result.findings[0].frame_time == datetime(2026, 1, 1, 8, 0, 0, 255000, tzinfo=UTC)
    result.transactions[0].start_ns = 10**21  # the year 33658: captures may lie
    assert result.transactions[0].start_time is None
    assert result.transactions[0].start.startswith("33658-")


def test_a_table_of_arrow(captures: Path, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = captures / "cyclic-longer-ramp.pcapng"
    assert main(["report", "-f", "parquet", "-o", str(tmp_path / "all.parquet"), str(path)]) == 0
    stored = parquet.read_table(tmp_path / "all.parquet")
    table = ds47.analyze(path).to_arrow()
    assert table.drop_columns("telegram").equals(stored.drop_columns("telegram"))
    assert table.schema.equals(stored.schema, check_metadata=True)
    assert set(table.column("telegram").to_pylist()) == {1}
    assert set(stored.column("telegram").to_pylist()) == {None}, "nobody said it before a row"


def test_the_telegram_of_a_drive_object(captures: Path) -> None:
    by_lengths = ds47.analyze(captures / "cyclic-longer-ramp.pcapng")
    assert {by_lengths.telegram(each) for each in by_lengths} == {1}
    assert {each.telegram for each in by_lengths} == {1}
    assert not any(map(ds47.analyze(captures / "tour-machine.pcapng").telegram, by_lengths))


def test_every_format_of_data_has_the_telegram(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two drive objects say p0922; what is written at once knows it from then on."""
    path = str(captures / "real-stacks" / "o1_profinetpy062_be.pcapng")
    result = ds47.analyze(path)
    true = {each.id: each.telegram for each in result}
    assert Counter(true.values()) == {352: 75, 1: 6, None: 2}
    assert main(["report", "-f", "json", path]) == 0
    (capture,) = json.loads(capsys.readouterr().out)["captures"]
    assert {each["id"]: each["telegram"] for each in capture["transactions"]} == true
    assert main(["report", "-f", "ndjson", path]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    streamed = {each["transaction"]["id"]: each["transaction"]["telegram"] for each in lines[:-1]}
    assert main(["report", "-f", "csv", path]) == 0
    rows = csv.DictReader(io.StringIO(capsys.readouterr().out))
    assert {int(row["transaction"]): int(row["telegram"] or 0) or None for row in rows} == streamed
    known = {number: value for number, value in streamed.items() if value is not None}
    assert known.items() <= true.items()
    assert set(known.values()) == {1, 352}


def said_by(*numbers: tuple[int, ds47.State, int | str], family: str = "sinamics") -> CaptureResult:
    """A capture in which drive objects are asked for p0922: drive object, state, value."""
    transactions = [
        transaction(
            parameters=[ds47.Parameter(922, 0, "value", 0, values=[value], family=family)], id=at, axis=axis,
            state=state, index=0xB02F, device="192.168.0.9",
        )
        for at, (axis, state, value) in enumerate(numbers, 1)
    ]  # fmt: skip
    return CaptureResult("a.pcapng", transactions=transactions)


def test_what_the_drive_says_of_its_telegram() -> None:
    result = ds47.Result(
        said_by((3, "ok", 105), (4, "ok", 5), (3, "ok", 102), (5, "error", 7), (4, "ok", 0))
    )
    assert [result.telegram(each) for each in result] == [102, 5, 102, None, 5]
    words = Telegrams(said_by((3, "ok", 102), (4, "ok", 5))).words("192.168.0.9")
    assert words is not None
    assert words.en == "DO 3: telegram 102 without PKW; DO 4: telegram 5 without PKW"
    assert words.zh == "DO 3：报文 102，不带 PKW；DO 4：报文 5，不带 PKW"
    assert Telegrams(said_by((3, "ok", 102))).words("192.168.0.8") is None
    of_others = Telegrams(said_by((3, "ok", 102), (4, "ok", 5), family="profile"))
    words = of_others.words("192.168.0.9")
    assert words is not None
    assert words.en == "DO 3: telegram 102; DO 4: telegram 5 without PKW"


def test_the_telegram_stands_with_the_drive(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(captures / "cyclic-longer-ramp.pcapng")
    for detail in ([], ["--summary"], ["--all"]):
        assert main(["report", *detail, path]) == 0
        assert "  slot 2: lengths fit telegram 1 without PKW" in capsys.readouterr().out
    assert main(["report", "--lang", "zh", path]) == 0
    assert "  slot 2：长度同报文 1，不带 PKW" in capsys.readouterr().out
    for detail in ([], ["--summary"]):
        assert main(["report", "-f", "html", *detail, path]) == 0
        assert ">slot 2: lengths fit telegram 1 without PKW<" in capsys.readouterr().out
    assert main(["report", "-f", "markdown", path]) == 0
    assert "all done; slot 2: lengths fit telegram 1 without PKW |" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("profibus/pyprofibus_ppo1", "PPO1: lengths fit telegram 353 with PKW"),
        ("profibus-ppo3-and-records", "PPO3: lengths fit telegram 1 without PKW"),
        ("profibus-wrong-project", "PPO1: PKW"),
        (
            "real-stacks/o1_profinetpy062_be",
            "DO 1: telegram 352; DO 2, slot 2.1: telegram 1 without PKW",
        ),
        ("tour-machine", None),
    ],
)
def test_whether_a_drive_has_pkw(captures: Path, name: str, line: str | None) -> None:
    result = analyze(captures / f"{name}.pcapng")
    devices = {each.device for each in (*result.transactions, *result.relations)}
    found = filter(None, map(Telegrams(result).words, devices))
    assert [each.en for each in found] == ([] if line is None else [line])


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_many_captures(captures: Path, tmp_path: Path, jobs: int) -> None:
    """In order, each as `analyze` reads it; one that cannot be read does not end the others."""
    names = ["a.pcapng", "b.pcapng", "c.pcapng"]
    for name, source in zip(names, ("tour-machine", "", "record-global"), strict=True):
        data = (captures / f"{source}.pcapng").read_bytes() if source else b"no capture"
        (tmp_path / name).write_bytes(data)
    found = list(ds47.analyze_many([tmp_path, tmp_path / "a.pcapng"], jobs=jobs, select="DS4"))
    assert [Path(each.path).name for each in found] == names
    whole = ds47.analyze(tmp_path / "a.pcapng", select="DS4")
    assert found[0].to_dict() == whole.to_dict()
    assert [each.complete for each in found] == [True, False, True]
    assert "b.pcapng: not a capture" in (found[1].problem or "")
    assert (len(found[1]), found[1].summary) == (0, {"transactions": 0})
    assert "1 capture not read to its end" in found[1].verdict()


def test_many_that_there_cannot_be(captures: Path, tmp_path: Path) -> None:
    """Said at once, and not when the first one is asked for."""
    with pytest.raises(ds47.CaptureError, match="no capture in this folder"):
        ds47.analyze_many(tmp_path)
    with pytest.raises(TypeError, match="no choice 'selects': indices, slow_ms"):
        ds47.analyze_many(captures, selects="DS4")  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="no rule has the number or name 'DS99x'"):
        ds47.analyze_many(captures, select="DS99x")
    with pytest.raises(ValueError, match="the engine tshark takes one job, not 2"):
        ds47.analyze_many(captures, engine="tshark", jobs=2)
    assert list(ds47.analyze_many([])) == []


def test_frames_that_a_program_has(captures: Path) -> None:
    path = captures / "tour-machine.pcapng"
    with open_capture(path) as capture:
        frames = [(each.time_ns, each.data) for each in capture.everything()]
    result = ds47.analyze_frames((f"{at / 10**9:.6f}", data) for at, data in frames)
    whole = ds47.analyze(path).to_dict()["captures"][0]
    (told,) = result.to_dict()["captures"]
    assert told | {"path": ""} == whole | {"path": ""}
    with pytest.raises(ValueError, match="'noon' is not the time of a frame"):
        ds47.analyze_frames([("noon", b"")])
    near = ds47.analyze_frames([(1767254400.255, b"")]).start_time  # as near as a float has it
    assert near is not None
    assert abs((near - datetime(2026, 1, 1, 8, 0, 0, 255000, tzinfo=UTC)).total_seconds()) < 1e-6


def test_choices_are_those_of_analyze() -> None:
    own = {"path", "engine", "tshark", "digest", "expect"}
    assert set(inspect.signature(ds47.analyze).parameters) - own == set(
        ds47.Choices.__annotations__
    )
