"""The library takes what people type: lines as the command does, one text where several are possible."""

from __future__ import annotations

from pathlib import Path

import pytest

import ds47
from ds47.cli import main


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
