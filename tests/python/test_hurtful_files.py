"""Files that hurt: damaged lists, settings and logs, and what unpacks to more than anything has.

None of them ends a command with the status of a fault of ours (70); what is wrong is one line.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import random
import shutil
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ds47.capture import open_capture, stream
from ds47.cli import main
from ds47.spec import toml

HEAD = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
NESTED = "a = " + "[" * 20_000
LONG_KEY = ".".join(["a"] * 20_000) + " = 1"
LONG_NUMBER = "a = " + "1" * 5_000
HEX_NUMBER = "a = 0x" + "f" * 5_000
LOG = "Data;Time us;Dirn\n100302494E16;1;Request\n"

pytestmark = pytest.mark.usefixtures("own_lists")


@pytest.fixture
def own_lists(monkeypatch: Any, tmp_path: Path) -> Path:
    """The folder of imported lists."""
    monkeypatch.setenv("DS47_PARAMS", str(tmp_path / "lists"))
    return tmp_path / "lists"


@pytest.fixture
def said(capsys: Any) -> Callable[..., tuple[int, str]]:
    """Runs a command: its status, and the only line on stderr."""

    def run(*words: str | Path) -> tuple[int, str]:
        status = main([str(each) for each in words])
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) <= 1, lines
        return status, "".join(lines)

    return run


def log_in(folder: Path, text: str = LOG) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "bus.txt"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "head",
    ["Data;Time us", "Time us;Data", "Data;Dirn;Time us", "Time us;Dirn;Data", "Data;Dirn"],
)
def test_a_row_of_a_log_may_end_anywhere(tmp_path: Path, said: Any, head: str) -> None:
    cells = {"Data": "100302494E16", "Time us": "1", "Dirn": "Request"}
    whole = ";".join(cells[each] for each in head.split(";"))
    for end in range(len(whole) + 1):
        path = log_in(tmp_path, f"{head}\n{whole}\n{whole[:end]}\n{whole}\n")
        status, line = said("report", path)
        assert status in (0, 3)
        assert (status == 3) == ("cannot be read" in line)


def test_a_row_without_time_is_read(tmp_path: Path, said: Any) -> None:
    path = log_in(tmp_path, "Data;Time us\n100302494E16;1\nE5\n")
    assert said("report", path) == (0, "")
    with open_capture(path) as capture:
        assert [frame.data for frame in capture] == [bytes.fromhex("100302494E16"), b"\xe5"]


@pytest.mark.parametrize("text", [NESTED, LONG_KEY, LONG_NUMBER, HEX_NUMBER, "a = {b = " * 5_000])
def test_toml_that_nobody_means_is_refused(
    tmp_path: Path, own_lists: Path, said: Any, text: str
) -> None:
    with pytest.raises(ValueError):  # noqa: PT011 (tomllib's own, or ours)
        toml.parse(text)
    log = log_in(tmp_path / "captures")
    bad = tmp_path / "bad.toml"
    bad.write_text(text)
    for words in (["--params", bad], ["--expect", bad]):
        status, line = said("report", *words, log)
        assert (status, "bad.toml" in line) == (2, True)
    assert said("params", "import", bad)[0] == 3
    settings = log.with_name("ds47.toml")
    settings.write_text(text)
    for command, expected in (("report", 3), ("check", 2), ("baseline", 3)):
        status, line = said(command, log)
        assert (status, str(settings) in line) == (expected, True), command
    settings.unlink()
    own_lists.mkdir()
    bad.replace(own_lists / "bad.toml")
    assert said("report", log)[0] == 2
    assert said("params", "list")[0] == 3


def test_a_long_text_with_dots_is_no_key() -> None:
    assert toml.parse(f'text = "{"word. " * 500}"\na.b.c = 1\n')["a"] == {"b": {"c": 1}}


def test_lines_of_a_text_in_a_golden_list_may_be_anything(tmp_path: Path, said: Any) -> None:
    golden = tmp_path / "golden.toml"
    golden.write_text(f"p1120 = 1\np1121 = '''\n{NESTED}\n'''\n")
    assert said("report", "--expect", golden, log_in(tmp_path / "captures"))[0] in (0, 1)


def test_a_number_beyond_all_floats_is_none(tmp_path: Path, said: Any) -> None:
    golden = tmp_path / "golden.csv"
    golden.write_text(f"parameter,value,within\np1120,{'9' * 400},0.5\n")
    status, line = said("report", "--expect", golden, log_in(tmp_path / "captures"))
    assert (status, "golden.csv, line 2" in line) == (2, True)


# Workbooks


def workbook() -> bytes:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in (["Number", "Name", "Unit"], ["p1120", "Ramp-up time", "s"], ["r0945", "Fault", ""]):
        book.active.append(row)
    book.save(stored := io.BytesIO())
    return stored.getvalue()


def parts_of(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(parts: dict[str, bytes]) -> bytes:
    with zipfile.ZipFile(stored := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return stored.getvalue()


def test_a_damaged_workbook_is_one_line(tmp_path: Path, said: Any) -> None:
    """Each part cut, gone or with another byte; and the archive itself."""
    whole, path, chance = workbook(), tmp_path / "list.xlsx", random.Random(47)
    parts = parts_of(whole)
    damaged = [whole[: len(whole) // 2], b"", b"no zip"]
    for name, data in parts.items():
        damaged.append(packed({key: each for key, each in parts.items() if key != name}))
        for _ in range(4):
            at = chance.randrange(len(data))
            changed = data[:at] + bytes([chance.randrange(256)]) + data[at + 1 :]
            damaged += [packed(parts | {name: each}) for each in (data[:at], changed)]
    for data in damaged:
        path.write_bytes(data)
        status, line = said("params", "import", path)
        assert status == 0 or (status == 3 and "list.xlsx: " in line), line


def test_a_workbook_that_unpacks_to_far_more_is_refused(tmp_path: Path, said: Any) -> None:
    parts = parts_of(workbook())
    sheet = next(name for name in parts if name.endswith("sheet1.xml"))
    parts[sheet] = parts[sheet].replace(b"Ramp-up", b" " * (40 << 20))
    path = tmp_path / "list.xlsx"
    path.write_bytes(packed(parts))
    status, line = said("params", "import", path)
    assert (status, "unpacks from" in line) == (3, True)


# Packed captures


@pytest.mark.parametrize("packer", ["gzip", "zstd"])
def test_what_unpacks_to_more_than_any_recording_is_given_up(
    tmp_path: Path, monkeypatch: Any, packer: str
) -> None:
    monkeypatch.setattr(stream, "_PLENTY", 1 << 20)
    path = tmp_path / "a.pcap"
    path.write_bytes(pack(packer)(HEAD + bytes(8 << 20)))
    with open_capture(path) as capture:
        assert not list(capture)
        assert "unpacks to more than 500 times" in (capture.problem or "")
        assert capture.frames <= 2 << 16
    one = HEAD + struct.pack("<4I", 1, 0, 60, 60) + random.Random(47).randbytes(60)
    path.write_bytes(pack(packer)(one))
    with open_capture(path) as capture:
        assert (list(capture), capture.problem, capture.frames) == ([], None, 1)


@pytest.mark.parametrize("packer", ["gzip", "zstd"])
def test_members_without_content_are_passed_up_to_a_limit(tmp_path: Path, packer: str) -> None:
    path, empty = tmp_path / "a.pcap", pack(packer)(b"")
    frame = struct.pack("<4I", 1, 0, 60, 60) + random.Random(47).randbytes(60)
    path.write_bytes(pack(packer)(HEAD) + empty * 900 + pack(packer)(frame))
    with open_capture(path) as capture:
        assert (list(capture), capture.problem, capture.frames) == ([], None, 1)
    path.write_bytes(pack(packer)(HEAD + frame) + empty * 3_000)
    with open_capture(path) as capture:
        assert not list(capture)
        assert "members without content" in (capture.problem or "")
        assert capture.frames == 1


def test_a_small_member_costs_no_copy_of_all_that_follows(tmp_path: Path) -> None:
    """Each byte a member of its own: what a decoder leaves over is copied, so it gets little at first."""
    members = [gzip.compress(bytes([each])) for each in HEAD + bytes(16) * 500]
    path = tmp_path / "a.pcap"
    path.write_bytes(b"".join(members))
    sizes: list[int] = []
    decode = stream._Gzip.decompress

    def counted(self: Any, data: bytes, max_length: int = 0) -> bytes:
        sizes.append(len(data))
        return decode(self, data, max_length)

    stream._Gzip.decompress = counted  # type: ignore[method-assign]
    try:
        with open_capture(path) as capture:
            assert (list(capture), capture.problem, capture.frames) == ([], None, 500)
    finally:
        stream._Gzip.decompress = decode  # type: ignore[method-assign]
    assert max(sizes) <= 1 << 12


def pack(packer: str) -> Callable[[bytes], bytes]:
    if packer == "gzip":
        return gzip.compress
    return pytest.importorskip("backports.zstd").compress  # type: ignore[no-any-return]


# What is stored


def test_a_command_to_copy_is_one_command(
    tmp_path: Path, captures: Path, monkeypatch: Any, capsys: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(captures / "conversation-error.pcapng", "a;touch pwn;.pcapng")
    assert main(["check", "a;touch pwn;.pcapng"]) == 1
    assert "make one with: ds47 baseline 'a;touch pwn;.pcapng'" in capsys.readouterr().out


def test_a_stored_result_without_frames_is_told(tmp_path: Path, captures: Path, said: Any) -> None:
    capture = Path(shutil.copy(captures / "conversation-error.pcapng", tmp_path / "a.pcapng"))
    assert said("baseline", capture)[0] == 0
    stored = tmp_path / "a.ds47.json"
    document = json.loads(stored.read_text())
    del document["capture"]["transactions"][0]["frames"]["write_request"]
    stored.write_text(json.dumps(document))
    assert said("check", capture)[0] == 1
    status, line = said("accept", "--yes", capture)
    assert (status, "see transactions[0].frames.write_request" in line) == (1, True)


@pytest.mark.parametrize("damage", ["rows", "severity", "time", "transactions"])
def test_a_result_whose_digest_is_right_and_whose_content_is_none(
    tmp_path: Path, captures: Path, said: Any, damage: str
) -> None:
    capture = Path(shutil.copy(captures / "conversation-error.pcapng", tmp_path / "a.pcapng"))
    words = ("report", "-f", "text", "--resume", "--results", tmp_path / "r", capture)
    assert said(*words)[0] == 0
    path = tmp_path / "r" / "a.pcapng.json"
    text = path.read_text()
    if damage == "rows":
        text = text.replace('"row": {', '"row": {"colour": 1, ')
    elif damage == "severity":
        text = text.replace('"findings": {', '"findings": {"purple": 1, ')
    elif damage == "time":
        text = text.replace('"start": "', '"start": "x')
    else:
        text = text.replace('"transactions": [', '"transactions": [7, ')
    seal = text.split('"seal": "', 1)[1][:64]
    text = text.replace(seal, "0" * 64)
    path.write_text(text.replace("0" * 64, hashlib.sha256(text.encode()).hexdigest(), 1))
    status, line = said(*words)
    assert (status, f"{path}: damaged result; the next run makes it again" in line) == (3, True)
    assert said(*words) == (0, "")
