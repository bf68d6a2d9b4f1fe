"""The verdict names its reason, an empty capture says so, and `--require` makes it red.

The sentences of all stored captures are not held here one by one; what every rule may name is.
"""

from __future__ import annotations

import json
import string
import struct
from pathlib import Path

import pytest

from ds47.analysis import analyze
from ds47.cli import main
from ds47.report.html.shell import names
from ds47.report.verdict import VerdictCounts, inventory, verdict
from ds47.spec import rules
from ds47.spec.semantics import diagnosis_words

WORKED_OUT = {"device", "drive", "error", "parameter", "text"}
"""What a sentence may name that is no argument by itself."""


def frame(ether_type: int, payload: bytes) -> bytes:
    return bytes(6) + bytes.fromhex("020000000001") + struct.pack(">H", ether_type) + payload


def tcp(port: int) -> bytes:
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 40, 0, 0, 64, 6, 0, b"\x0a\0\0\x01", b"\x0a\0\0\x02")
    return frame(0x0800, ip + struct.pack(">HHIIHHHH", 50000, port, 0, 0, 0x5000, 0, 0, 0))


@pytest.fixture
def unplugged(tmp_path: Path) -> Path:
    """What a computer sees at a port that is not mirrored."""
    frames = [*[tcp(443)] * 18, frame(0x0806, bytes(28)), tcp(502)]
    return written(tmp_path / "unplugged.pcap", frames)


def written(path: Path, frames: list[bytes]) -> Path:
    """A capture with a frame each second."""
    path.write_bytes(
        struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
        + b"".join(struct.pack("<IIII", n, 0, len(each), len(each)) + each for n, each in enumerate(frames, 1))
    )  # fmt: skip
    return path


@pytest.mark.parametrize(
    ("name", "said", "there"),
    [
        (
            "profibus-wrong-project",
            "NOT OK: dp3 refuses its configuration; 4 more causes",
            "3 stations of PROFIBUS",
        ),
        (
            "cyclic-does-not-start",
            "NOT OK: 192.168.133.33 slot 2 waited for an edge of ON, until 08:00:06.706",
            "1 drive in cyclic frames",
        ),
        (
            "profibus-bad-line",
            "WARNING: frames have a wrong check byte; 3 more causes",
            "4 stations of PROFIBUS",
        ),
        (
            "diagnosis-half-captured-responses",
            "WARNING: the capture shows only a part",
            "1 drive, 3 transactions, 3 orphan",
        ),
        (
            "tour-machine",
            "NOT OK: 192.168.133.2 writes while its own request is open; 3 more causes; "
            "3 of 8 transactions failed, 1 outcome unknown",
            "1 drive, 8 transactions, 4 ok, 1 partial, 1 error, 1 refused, 1 unanswered",
        ),
    ],
)
def test_the_verdict_names_the_reason(captures: Path, name: str, said: str, there: str) -> None:
    counts = VerdictCounts.of(analyze(captures / f"{name}.pcapng"))
    assert verdict(counts).en == said
    exact = inventory(counts)
    assert exact is not None
    assert exact.en == there


@pytest.mark.parametrize("rule", rules().values(), ids=rules())
def test_a_brief_names_what_its_rule_carries(rule) -> None:  # type: ignore[no-untyped-def]
    def names(text: str) -> set[str]:
        return {name for _, name, _, _ in string.Formatter().parse(text) if name}

    assert names(rule.brief) <= {*rule.args, *WORKED_OUT}
    assert names(rule.brief) == names(rule.brief_zh)
    assert not rule.brief.endswith((".", "。"))
    assert len(rule.brief) <= 80


def test_whatever_can_lead_a_verdict_is_a_clause() -> None:
    assert not [
        name for name, rule in rules().items() if rule.severity != "note" and not rule.brief
    ]


def test_the_briefs_of_keys_are_there_in_both_languages() -> None:
    en, zh = (
        {key for key in diagnosis_words(lang) if key.endswith("_brief")} for lang in ("en", "zh")
    )
    assert en
    assert en == zh
    assert {key.removesuffix("_brief") for key in en} <= set(diagnosis_words("en"))


def test_an_empty_capture_is_an_answer(unplugged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(unplugged)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == (
        "EMPTY: 20 frames, none of PROFINET, PROFIBUS or S7 (TCP 18, ARP 1, Modbus TCP 1)"
    )
    assert lines[2].startswith("  Was it taken at a mirror port?")
    assert analyze(unplugged).others == {"TCP": 18, "ARP": 1, "Modbus TCP": 1}


def test_profinet_without_a_drive_is_not_said_to_be_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    discovery = frame(0x8892, bytes.fromhex("FEFE05000102030400010004FFFF0000").ljust(46, b"\0"))
    path = written(tmp_path / "discovery.pcap", [discovery] * 3)
    assert main(["report", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[1] == (
        "EMPTY: 3 frames, no record or cyclic data of PROFINET, no PROFIBUS or S7 (PROFINET 3)"
    )


def test_the_trail_of_an_empty_capture_says_why(
    unplugged: Path, captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["trail", str(unplugged)]) == 0
    err = capsys.readouterr().err
    assert "EMPTY: 20 frames, none of PROFINET, PROFIBUS or S7" in err
    assert "mirror port" in err
    assert main(["trail", str(captures / "seed-g120-read.pcapng")]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("command", ["report", "check"])
def test_what_is_required_and_missing_is_no_success(
    command: str, captures: Path, unplugged: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if command == "check":
        assert main(["baseline", str(unplugged)]) == 0
    assert main([command, str(unplugged)]) == 0
    assert main([command, "--require", "transactions", str(unplugged)]) == 1
    said = capsys.readouterr()
    if command == "check":
        *_, problem, total = said.out.splitlines()
        assert problem == f"FAILED   {unplugged}: no transaction in it (--require transactions)"
        assert total == "1 capture: 0 as stored, 1 not"
    else:
        problem = said.err.splitlines()[-1]
        assert problem == f"ds47: error: {unplugged}: no transaction in it (--require transactions)"
    full = captures / "seed-g120-read.pcapng"
    assert main([command, "--require", "transactions", str(full)]) == 0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("record-foreign", "没有 DS47 任务（RPC：请求 6，应答 6；数据记录调用：索引 47 读 3，索引 47 写 3）"),
        ("profibus-bad-line", "没有 DS47 任务（PROFIBUS 上也没有记录）"),
    ],
)  # fmt: skip
def test_what_is_there_instead_is_said_in_chinese(
    name: str, said: str, captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", "--lang", "zh", str(captures / f"{name}.pcapng")]) == 0
    assert f"  {said}\n" in capsys.readouterr().out


def test_no_finding_is_no_success_where_nothing_was_captured(
    captures: Path, unplugged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stored = ["--results", str(tmp_path / "results")]
    for more in ([], stored, [*stored, "--resume"]):
        assert main(["report", "--fail-on", "error", *more, str(unplugged)]) == 1
        problem = capsys.readouterr().err.splitlines()[-1]
        assert problem == f"ds47: error: {unplugged}: nothing of PROFINET, PROFIBUS or S7 in it"
    assert main(["report", "-f", "junit", str(unplugged)]) == 0
    assert 'errors="1"' in capsys.readouterr().out
    cyclic = captures / "profibus-ppo1-start.pcapng"
    assert main(["report", "--fail-on", "error", str(cyclic)]) == 0


def test_no_report_for_ci_is_green_where_the_port_is_unplugged(
    unplugged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["baseline", str(unplugged)]) == 0
    required, cases = ["--require", "transactions", str(unplugged)], tmp_path / "cases.xml"
    capsys.readouterr()
    assert main(["check", "-f", "markdown", "--junit", str(cases), *required]) == 1
    assert capsys.readouterr().out.startswith("## ❌ 1 capture: 0 as stored, 1 not")
    assert 'errors="1"' in cases.read_text(encoding="utf-8")
    assert main(["check", "-f", "json", *required]) == 1
    (capture,) = json.loads(capsys.readouterr().out)["captures"]
    assert capture["failed"]
    assert main(["report", "-f", "junit", *required]) == 1
    assert 'errors="1"' in capsys.readouterr().out


@pytest.mark.parametrize(
    ("paths", "called"),
    [
        (["/home/me/a/x.pcapng"], ["x.pcapng"]),
        (["/home/me/a/x.pcapng", "/home/me/b/y.pcapng"], ["x.pcapng", "y.pcapng"]),
        (
            ["/home/me/a/x.pcapng", "/home/me/b/x.pcapng", "z.pcap"],
            ["a/x.pcapng", "b/x.pcapng", "z.pcap"],
        ),
        (["s3://bucket/one/x.pcapng", "-"], ["x.pcapng", "-"]),
    ],
)
def test_a_page_names_no_folder_of_a_machine(paths: list[str], called: list[str]) -> None:
    assert list(names(paths).values()) == called
