"""What cannot be anonymised is refused in words, with status 2 and without a file; never dropped silently."""

from __future__ import annotations

from pathlib import Path

import pytest

from ds47.cli import main
from ds47.lab import captured
from ds47.lab.cyclic_scenes import BOOK

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
ELSE = "leave them out with --channels ds47, or export without --anonymise"


def refused(source: Path, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    """What is said of a capture that is refused."""
    target = source.parent / "out" / "out.pcapng"
    target.parent.mkdir()
    assert main(["export", str(source), "--anonymise", "-o", str(target), *options]) == 2
    assert not list(target.parent.iterdir())  # no key, either
    return capsys.readouterr().err


@pytest.fixture
def cyclic(tmp_path: Path) -> Path:
    """A capture of a start and a stop, with parameters in PKW and words in PZD."""
    path = tmp_path / "cyclic.pcapng"
    (scene,) = (each for each in BOOK.scenarios if each.name == "cyclic-start-and-stop")
    path.write_bytes(captured(scene.play()))
    return path


def test_cyclic_channels(cyclic: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"frames of PKW and PZD cannot be anonymised: {ELSE}" in refused(cyclic, capsys)


def test_a_transaction_of_pkw(cyclic: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert f"frames of PKW cannot be anonymised: {ELSE}" in refused(cyclic, capsys, "-t", "1")


def test_the_rest_is_anonymised(cyclic: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = cyclic.with_name("out.pcapng")
    options = ["--anonymise", "--channels", "ds47", "-o", str(target)]
    assert main(["export", str(cyclic), *options]) == 0
    assert target.exists()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("s7-figure-1", "S7"),
        ("profibus-ppo1-start", "PROFIBUS"),  # PKW
        ("profibus-healthy", "PROFIBUS"),
    ],
)
def test_where_there_is_nothing_else(
    name: str, channel: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "in.pcapng"
    source.write_bytes((CAPTURES / f"{name}.pcapng").read_bytes())
    told = refused(source, capsys)
    assert f"frames of {channel} cannot be anonymised: export without --anonymise" in told


def test_a_transaction_of_ds47_beside_them(tmp_path: Path) -> None:
    """What is chosen counts, not what else is in the capture."""
    source = CAPTURES / "cyclic-longer-ramp.pcapng"
    target = tmp_path / "out.pcapng"
    assert main(["export", str(source), "-t", "1", "--anonymise", "-o", str(target)]) == 0
    assert target.exists()
