"""S7 on the command line: reports in every format, decode, export, check, watch, options, and the page."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from s7_segments import Talk, bsend, capture, dt, entry, get, got, item, put, received, taken

import ds47
from ds47.batch import settings
from ds47.capture import CaptureError
from ds47.cli import main
from ds47.live import dumpcap
from ds47.s7 import choices
from ds47.s7.choices import Choices

READ = item(1, 0, 4)
Said = Callable[..., str]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    def run(*arguments: str, status: int = 0) -> str:
        assert main(list(arguments)) == status
        return capsys.readouterr().out

    return run


def talk() -> Talk:
    """Two reads, one of which fails in part, a write, a BSEND of two segments."""
    found = Talk().opened(pdu=480)
    found.ask(get(1, READ), got(1, entry(b"abcd")))
    found.ask(get(2, READ, item(9, 0, 2)), got(2, entry(b"efgh"), b"\x0a\0\0\4"))
    found.ask(put(3, READ, b"wxyz"), taken(3, 255))
    found.ask(bsend(4, 9, b"x" * 100, total=200, last=False), received(4, 1))
    return found.ask(bsend(5, 9, b"y" * 100, sequence=1, number=1), received(5, 1))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "talk.pcap"
    path.write_bytes(capture(talk()))
    return path


def test_the_text_sums_up_by_connection_and_lists_what_went_wrong(said: Said, file: Path) -> None:
    text = said("report", str(file))
    assert "NOT OK: 10.0.0.2 refuses an item: " in text
    assert "  1 S7 connection, 4 transactions, 3 ok, 1 partial" in text
    (row,) = [line for line in text.splitlines() if "10.0.0.1:49152 -> 10.0.0.2:102" in line]
    assert row.split("102  ")[1].split() == [
        "01.00", "->", "01.02", "PG,", "rack", "0", "slot", "2", "480", "x1", "4", "1", "0", "8", "4", "200",
        "1.50", "s", "(3.00", "s)",
    ]  # fmt: skip
    assert re.findall(r"^#(\d)", text, re.MULTILINE) == ["2"]
    assert "3 transactions without findings are not listed below" in text
    assert "DB9.DBB0..1 0x0A object does not exist" in text
    assert "\nDrives" not in text


def test_s7_alone_lists_every_job_in_both_languages(said: Said, file: Path) -> None:
    text = said("report", "--channels", "s7", str(file))
    assert re.findall(r"^#(\d) .*?\b(GET|PUT|BSEND|USEND)\b", text, re.MULTILINE) == [
        ("1", "GET"), ("2", "GET"), ("3", "PUT"), ("4", "BSEND"),
    ]  # fmt: skip
    assert "DB1.DBB0..3 := 77 78 79 7A" in text
    assert "R_ID 00000009 := 78 78 78" in text
    assert "(200 bytes) (2 segments)" in text
    chinese = said("report", "--channels", "s7", "--lang", "zh", str(file))
    assert "机架 0 插槽 2" in chinese
    assert "对象不存在" in chinese


def test_rows_are_items_in_csv_and_the_table(said: Said, file: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(said("report", "-f", "csv", str(file)))))
    assert [(row["transaction"], row["item.address"], row["item.value"], row["item.code"]) for row in rows] == [
        ("1", "DB1.DBB0..3", "61626364", "255"), ("2", "DB1.DBB0..3", "65666768", "255"),
        ("2", "DB9.DBB0..1", "", "10"), ("3", "DB1.DBB0..3", "7778797a", "255"),
        ("4", "", "78" * 100 + "79" * 100, ""),
    ]  # fmt: skip
    assert {row["connection"] for row in rows} == {"1"}
    assert (rows[-1]["r_id"], rows[-1]["item.length"]) == ("9", "200")
    pytest.importorskip("pandas")
    table = ds47.analyze(file).to_frame()
    assert list(table["item.address"].dropna()) == [row["item.address"] for row in rows[:-1]]


def test_ndjson_gives_each_job_and_the_connections(said: Said, file: Path) -> None:
    lines = [json.loads(line) for line in said("report", "-f", "ndjson", str(file)).splitlines()]
    assert [each["transaction"]["operation"] for each in lines[:-1]] == [
        "get",
        "get",
        "put",
        "bsend",
    ]
    assert [each["rule"] for each in lines[1]["findings"]] == ["DS908"]
    (connection,) = lines[-1]["capture"]["connections"]
    assert (connection["pdu_length"], connection["jobs"], connection["sent_bytes"]) == (480, 4, 200)


def test_the_page_has_connections_items_and_bars(said: Said, file: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    said("report", "-f", "html", "-o", str(page), str(file))
    text = page.read_text("utf-8")
    section = text[text.index('id="s7-1"') : text.index('id="transactions-1"')]
    assert "10.0.0.1:49152 -&gt; 10.0.0.2:102" in section
    assert section.count('class="area get') == 2
    assert section.count('class="area put') == 1
    assert '"s7_request"' in text
    rows = json.loads(
        re.findall(r'<script[^>]*id="data-1"[^>]*>(.*?)</script>', text, re.DOTALL)[0]
    )
    assert [row[0] for row in rows["addresses"]] == ["DB1.DBB0..3", "DB9.DBB0..1", "R_ID 00000009"]
    assert [error[0] for error in rows["errors"]] == ["0x0A"]
    assert rows["channels"] == [["10.0.0.1:49152 -> 10.0.0.2:102", None, None, None, "s7"]]


def test_an_export_has_every_segment_of_a_pdu(said: Said, tmp_path: Path) -> None:
    whole = talk().cut([20])
    source, target = tmp_path / "cut.pcap", tmp_path / "out.pcapng"
    source.write_bytes(capture(whole))
    job = ds47.analyze(source, channels=("s7",)).transactions[3]
    said("export", str(source), "-t", "4", "-o", str(target))
    (again,) = ds47.analyze(target).transactions
    assert (again.operation, again.state, again.items) == ("bsend", "ok", job.items)
    data = [shot for shot in whole.shots if shot.data and shot.time_ns >= talk().shots[-4].time_ns]
    from ds47.capture import open_capture

    with open_capture(target) as opened:
        assert len(list(opened.everything())) == len(data)
    said("export", str(source), "-d", "10.0.0.2", "-o", str(tmp_path / "all.pcapng"))
    with open_capture(tmp_path / "all.pcapng") as opened:
        assert len(list(opened.everything())) == len(whole.shots)


def test_check_compares_addresses_and_codes_and_not_values(said: Said, file: Path) -> None:
    assert main(["baseline", str(file)]) == 0
    said("check", str(file))
    again = talk()
    other = again.frames()
    values = [frame.replace(b"abcd", b"ABCD") for frame in other]
    from frames import pcap

    file.write_bytes(pcap(values))
    said("check", str(file))
    codes = [frame.replace(b"\x0a\0\0\4", b"\x05\0\0\4") for frame in other]
    file.write_bytes(pcap(codes))
    assert "code" in said("check", str(file), status=1)


def test_a_stored_result_that_does_not_know_s7_says_nothing_of_it(said: Said, file: Path) -> None:
    assert main(["baseline", str(file)]) == 0
    stored = file.with_name("talk.ds47.json")
    document = json.loads(stored.read_text("utf-8"))
    del document["capture"]["connections"]
    document["capture"]["transactions"], document["capture"]["findings"] = [], []
    stored.write_text(json.dumps(document), "utf-8")
    assert "1 as stored" in said("check", str(file), "--fail-on", "never")


# Decode


def test_decode_says_what_stands_where(said: Said) -> None:
    text = said("decode", "--as", "s7", dt(get(0x200, READ)).hex())
    assert text.splitlines()[0] == "S7 job, 31 bytes"
    assert "reference 512, parameter 14, data 0" in text
    assert text.splitlines()[-2].split("  ")[-1] == "DB1.DBB0..3"
    assert (
        said("decode", "--as", "s7", get(0x200, READ).hex()).splitlines()[0] == "S7 job, 24 bytes"
    )


@pytest.mark.parametrize(
    "pdu",
    [get(1, READ), got(1, entry(b"abc"), b"\x0a\0\0\0"), put(1, READ, b"abcd"), taken(1, 255, 5),
     bsend(1, 9, b"ab"), received(1, 3), b"\x32", b"\x72\x01", b"\0", bytes(40)],
)  # fmt: skip
def test_every_beginning_of_a_pdu_is_decoded(said: Said, pdu: bytes) -> None:
    whole = dt(pdu)
    for cut in range(1, len(whole) + 1):
        text = said("decode", "--as", "s7", "-f", "json", whole[:cut].hex())
        found: dict[str, Any] = json.loads(text)
        assert found["length"] == cut
        assert cut == len(whole) or found["flaws"] or pdu[0] != 0x32
        said("decode", "--as", "s7", "--lang", "zh", whole[:cut].hex())


# Options


def test_choices_from_words() -> None:
    found = choices.parse((1102,), ("s7-400", "10.0.0.2=s7-1500"), ("32", "10.0.0.3=462"), True)
    assert found == Choices(
        (1102,), (("", 32), ("10.0.0.3", 462)), (("", "s7-400"), ("10.0.0.2", "s7-1500")), True
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(["--s7-cpu", "s7-9"], "s7-300-old"), (["--s7-block", "x"], "a number of bytes"),
     (["--s7-block", "10.0.0.2=0"], "a number of bytes"), (["--s7-port", "0"], "1<=x<=65535"),
     ([each for port in range(200, 216) for each in ("--s7-port", str(port))], "15 ports")],
)  # fmt: skip
def test_wrong_choices_are_wrong_use(
    capsys: pytest.CaptureFixture[str], file: Path, arguments: list[str], words: str
) -> None:
    assert main(["report", str(file), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_choices_beside_the_captures(file: Path, said: Said) -> None:
    settings._nearest.cache_clear()
    toml = file.with_name("ds47.toml")
    toml.write_text('[s7]\nports = [1102]\ncpu = ["10.0.0.2=s7-400"]\n', "utf-8")
    file.write_bytes(capture(replace(talk(), server=("10.0.0.2", 1102))))
    assert "GET" in said("report", "--channels", "s7", str(file))
    settings._nearest.cache_clear()


@pytest.mark.parametrize(
    "table",
    ["port = 3", "ports = 1102", 'ports = ["1102"]', "readback = 1", 'cpu = ["x"]', "block = [32]"],
)
def test_wrong_choices_beside_the_captures(file: Path, table: str) -> None:
    settings._nearest.cache_clear()
    file.with_name("ds47.toml").write_text(f"[s7]\n{table}\n", "utf-8")
    with pytest.raises(CaptureError, match=r"\[s7\]"):
        settings.options_for(str(file), ds47.analysis.AnalysisOptions())
    settings._nearest.cache_clear()


def test_a_watch_captures_the_ports_of_s7() -> None:
    words = dumpcap.arguments(["eth0"], None, tcp_ports=(102, 1102))
    assert words[4].count("udp or tcp port 102 or tcp port 1102") == 2
    assert dumpcap.arguments(["any"], None, tcp_ports=(102,))[4] == "udp or tcp port 102"


def test_a_watch_shows_what_went_wrong(said: Said, file: Path) -> None:
    text = said("watch", "--no-follow", str(file), "--fail-on", "never")
    assert re.findall(r"^#(\d)", text, re.MULTILINE) == ["2"]
    assert "10.0.0.1:49152 -> 10.0.0.2:102" in text
    assert (
        len(
            re.findall(
                r"^#", said("watch", "--no-follow", "--channels", "s7", str(file)), re.MULTILINE
            )
        )
        == 4
    )


# Beside a drive


def test_jobs_of_the_controller_stand_on_the_axis_of_its_drive(
    captures: Path, tmp_path: Path
) -> None:
    """A read in two parts, with a write between them, while a drive runs."""
    from ds47.capture import open_capture
    from ds47.capture.writer import PcapngWriter
    from ds47.report.html.views.timelines import views

    source = next(
        path for path in sorted(captures.glob("*.pcapng")) if ds47.analyze(path).timelines
    )
    drive = ds47.analyze(source)
    relation = drive.relations[drive.timelines[0].relation - 1]
    begin = drive.timelines[0].events[0].time_ns
    plc = (relation.controller, 49152)
    reading, writing = Talk(client=plc).opened(), Talk(client=("10.9.9.9", 2000)).opened()
    old = bytes(222)
    first, second = item(1, 0, 222), item(1, 222 * 8, 222)
    reading.ask(get(1, first), got(1, entry(old))).ask(get(2, second), got(2, entry(old)))
    reading.ask(get(3, first), got(3, entry(old)))
    before = len(reading.shots)
    writing.ask(put(1, item(1, 0, 4), b"\1\1\1\1"), taken(1, 255))
    writing.ask(put(2, item(1, 222 * 8, 4), b"\1\1\1\1"), taken(2, 255))
    reading.ask(get(4, second), got(4, entry(b"\1\1\1\1" + bytes(218))))
    shots = [reading.frame(each) for each in reading.shots[:before]]
    shots += [writing.frame(each) for each in writing.shots]
    shots += [reading.frame(each) for each in reading.shots[before:]]
    target = tmp_path / "both.pcapng"
    with open_capture(source) as opened:
        frames = [(each.time_ns, each.data) for each in opened.everything()]
    frames += [(begin + 1000 * number, data) for number, data in enumerate(shots, 1)]
    with PcapngWriter(target, link_type=1) as writer:
        for time_ns, data in sorted(frames, key=lambda each: each[0]):
            writer.write(time_ns, data)
    result = ds47.analyze(target)
    assert [each.rule for each in result.findings if each.rule in ("DS904", "DS905")] == [
        "DS904",
        "DS905",
    ]
    view = next(each for each in views(result._capture) if each.device == relation.device)
    (lane,) = [each for each in view.drawings[0].lanes if each.name.startswith("S7 ")]
    assert lane.name == f"S7 {relation.controller}"
    assert [each.kind for each in lane.boxes] == ["split", "split", "mixed", "mixed"]
    assert lane.boxes[0].title.en.startswith("#")
