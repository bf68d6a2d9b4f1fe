"""What fuzzing keeps (tests/fuzz): each input is refused in words or told of, here without atheris."""

from __future__ import annotations

import io
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import test_lua_analysis as both
from tests.fuzz import differential, targets

from ds47.capture import open_capture

KEPT = sorted(
    path for path in (Path(targets.__file__).parent / "kept").rglob("*") if path.is_file()
)


def test_every_target_has_inputs_to_begin_with() -> None:
    assert set(targets.SEEDS) == set(targets.TARGETS) >= {path.parent.name for path in KEPT}
    small = [path for path in KEPT if path.stat().st_size <= targets.LARGEST]
    assert small == KEPT
    for name, seeds in targets.SEEDS.items():
        assert next(seeds()), name


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_an_input_that_was_kept(path: Path) -> None:
    targets.TARGETS[path.parent.name](path.read_bytes())


@pytest.mark.parametrize("version", both.VERSIONS)
def test_lua_says_the_same_of_the_captures_that_were_kept(version: str, tmp_path: Path) -> None:
    kept = [path for path in KEPT if path.parent.name == "pairing"]
    sources = [both.Source(path.name, path.read_bytes(), look=True) for path in kept]
    both.compare(version, "en", sources, tmp_path)


def broken(*_: object, **__: object) -> int:
    raise IndexError("list index out of range")


@pytest.mark.parametrize(
    ("name", "place", "error"),
    [
        ("capture", "dissect", IndexError),
        ("calls", "rpc.from_frame", IndexError),
        ("codec", "decode_request", IndexError),
        ("telegrams", "dp.decode", IndexError),
        ("pairing", "analyze", IndexError),
        ("logs", "analyze", IndexError),
        ("loaders", "config._for_folder", AttributeError),
    ],
)
def test_a_fault_of_ours_ends_a_target(
    name: str, place: str, error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"tests.fuzz.targets.{place}", broken)
    with pytest.raises(error):
        targets.TARGETS[name](next(targets.SEEDS[name]()))


def test_status_70_and_another_answer_of_a_short_way_are_faults(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(targets, "main", lambda words: targets.OURS)
    with pytest.raises(targets.FaultError):
        targets.loaders(b"\0")
    monkeypatch.setattr(targets.rpc, "parse", lambda packet: None)
    with pytest.raises(targets.FaultError):
        targets.calls(next(targets.SEEDS["calls"]()))
    monkeypatch.setattr(targets, "shared_request", lambda data, options: None)
    with pytest.raises(targets.FaultError):
        targets.codec(next(targets.SEEDS["codec"]()))


def test_a_changed_capture_is_one_again() -> None:
    """So that fuzzing gets behind its headers."""
    seeds = list(targets.SEEDS["pairing"]())
    change: Callable[[bytes, int], bytes] = lambda data, most: bytes(reversed(data))[:most]  # noqa: E731
    readable = differs = 0
    for seed in range(60):
        before = random.Random(seed).choice(seeds)
        after = targets.other_frames(before, targets.LARGEST, seed, change)
        assert len(after) <= targets.LARGEST + 100
        differs += after != before
        try:
            with open_capture(io.BytesIO(after)) as capture:
                readable += bool(list(capture.everything()))
        except targets.CaptureError:
            pass
    assert (readable > 45, differs > 50) == (True, True)
    assert targets.other_frames(b"none", 100, 1, change) == b"enon"


def test_a_changed_capture_is_made_again_by_its_seed() -> None:
    first, second = (
        dict(each for each, _ in zip(differential.captures(start), range(6), strict=False))
        for start in (1, 3)
    )
    both = first.keys() & second.keys()
    assert len(both) >= 3
    assert all(first[name] == second[name] for name in both)


def test_what_lua_says_otherwise_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad: list[str] = []

    def alike(both: object, sources: list[Any], folder: Path) -> bool:
        bad[:] = bad or [sources[7].name]
        return not any(each.name == bad[0] for each in sources)

    monkeypatch.setattr(differential, "_alike", alike)
    made, different = differential.run(0.01, 1, tmp_path)
    assert made >= differential.TOGETHER
    assert [path.stem for path in different] == ["lua-" + bad[0].replace(" ", "-")]
    assert different[0].read_bytes()


def test_the_page_names_each_target_and_commands_that_are_there(repository: Path) -> None:
    page = (repository / "docs/reliability.md").read_text("utf-8")
    makefile = (repository / "Makefile").read_text("utf-8")
    named = set(re.findall(r"^    make ([a-z-]+)", page, re.MULTILINE))
    assert named == {"fuzz", "bench-hurtful"}
    assert all(re.search(rf"^{name}: ", makefile, re.MULTILINE) for name in named)
    table = page.partition("## Fuzzing")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `([a-z]+)` \|", table, re.MULTILINE)) == {*targets.TARGETS, "lua"}
