"""The report of an anonymised export is that of the original, with other addresses and names."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_anonymise import EVERY, ONLY, UNASKED, UNREAD

from ds47.cli import main
from ds47.export import Replacements, Selection, export

CAPTURES = Path(__file__).resolve().parents[2] / "captures"
OF_OTHER_BYTES = UNASKED | UNREAD | {"DS725"}
"""Values without their request, unread bytes; frames that the capture file counts as dropped."""
SOME = [
    CAPTURES / f"{name}.pcapng"
    for name in (
        "tour-machine", "naming-all", "record-multiple", "transport-rpc-fragments", "transport-ip-fragments",
        "transport-big-endian", "conversation-superseded-change", "conversation-partial-change",
        "diagnosis-two-users", "diagnosis-wrong-slot-denied",
    )
]  # fmt: skip


def report(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """The JSON of one capture."""
    main(["report", "-f", "json", "--channels", "ds47", str(path)])
    return capsys.readouterr().out


def mapped(text: str, key: Replacements) -> str:
    """The text with the replacements of a key, each original as a whole word."""
    new = {a: b for kind in ("mac", "ip", "name", "uuid") for a, b in key._maps[kind].items()}
    every = "|".join(re.escape(each) for each in sorted(new, key=len, reverse=True))
    return re.sub(
        rf"(?<![\w.-])({every or '(?!)'})(?![\w-]|\.\w)", lambda found: new[found[1]], text
    )


def comparable(text: str) -> dict[str, Any]:
    """The document of the capture, without what says which file it is."""
    (document,) = json.loads(text)["captures"]
    del document["path"], document["sha256"]
    return dict(document)


def different(one: Any, other: Any, path: str) -> Iterator[str]:
    """Where two documents differ."""
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        for name in one:
            yield from different(one[name], other[name], f"{path}.{name}")
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for number, pair in enumerate(zip(one, other, strict=True)):
            yield from different(*pair, f"{path}[{number}]")
    elif one != other:
        yield f"{path}: {one} != {other}"


def of_same_frames(source: Path, frames: list[int], whole: int, folder: Path) -> Path:
    """The original; or, where frames of other protocols stand between, an export with all names in it."""
    if len(frames) == whole:
        return source
    plain = folder / "plain.pcapng"
    assert export(source, plain, Selection(), ONLY).frames == frames
    return plain


def is_the_same(source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Compares both reports."""
    target, key = tmp_path / "out.pcapng", Replacements()
    outcome = export(source, target, Selection(), ONLY, key=key)
    rules = {each.rule for each in outcome.result.findings}
    if not outcome.frames or outcome.left_out or not rules.isdisjoint(OF_OTHER_BYTES):
        pytest.skip("of this the export has other bytes: test_anonymise.py compares what is left")
    assert outcome.transactions == len(outcome.result.transactions)
    assert not outcome.leaks
    original = of_same_frames(source, outcome.frames, outcome.result.frames, tmp_path)
    before, after = mapped(report(original, capsys), key), report(target, capsys)
    differences = list(different(comparable(before), comparable(after), ""))
    assert differences == []


@pytest.mark.parametrize("source", SOME, ids=lambda path: path.stem)
def test_the_report_is_the_same(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    is_the_same(source, tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("source", EVERY, ids=lambda path: path.stem)
def test_every_report_is_the_same(
    source: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    is_the_same(source, tmp_path, capsys)
