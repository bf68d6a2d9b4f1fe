"""The skeletons of a new rule: they stand in their places, read well, and say what is to be filled in."""

from __future__ import annotations

import ast
import importlib.util
import shutil
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOUCHED = (
    "python/ds47/spec/rules.toml", "tests/vectors/sources/conversations.py", "tests/vectors/sources/diagnoses.py",
    "tests/audit/claims.py", "tests/audit/causes.py", "python/ds47/lab/transport.py", "python/ds47/lab/records.py",
    "python/ds47/lab/conversation.py", "python/ds47/lab/diagnoses.py",
)  # fmt: skip
SPEC = importlib.util.spec_from_file_location("make_rule", ROOT / "tools" / "make_rule.py")
assert SPEC is not None
assert SPEC.loader is not None
make_rule = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(make_rule)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for name in TOUCHED:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(("hundred", "changed"), [
    ("DS1", {1, 3, 5}), ("DS2", {1, 3, 6}), ("DS4", {1, 3, 7}), ("DS7", {2, 4, 8}),
    ("DS3", set()), ("DS5", set()), ("DS8", set()), ("DS9", set()),
])  # fmt: skip
def test_skeletons_stand_in_their_places(copy: Path, hundred: str, changed: set[int]) -> None:
    before = tomllib.loads((copy / TOUCHED[0]).read_text("utf-8"))["rule"]
    rule = make_rule.following([row["id"] for row in before], hundred)
    left = make_rule.write(copy, hundred)
    for number, name in enumerate(TOUCHED):
        text = (copy / name).read_text("utf-8")
        assert (rule in text) == (number in {0, *changed}), name
        if name.endswith(".py"):
            ast.parse(text)
    rows = tomllib.loads((copy / TOUCHED[0]).read_text("utf-8"))["rule"]
    assert [row["id"] for row in rows] == sorted(row["id"] for row in rows)
    (row,) = (row for row in rows if row["id"] == rule)
    assert row.get("analyzer_only", False) == (hundred in ("DS8", "DS9"))
    places = [line.partition(":")[0] for line in left if not line.startswith("then")]
    assert all((ROOT / path).is_file() for path in places)
    assert any(path.endswith(".lua") for path in places) != (hundred in ("DS8", "DS9"))


def test_an_auditor_stands_in_the_section_of_its_hundred(copy: Path) -> None:
    make_rule.write(copy, "DS2")
    text = (copy / "tests/audit/claims.py").read_text("utf-8")
    assert text.index("# Record calls") < text.index("TODO") < text.index("# Messages")


def test_the_next_number_is_told() -> None:
    ids = ["DS417", "DS418", "DS501", "DS502", "DS520"]
    assert make_rule.following(ids, "DS4") == make_rule.following(ids, "DS419") == "DS419"
    assert make_rule.following(ids, "DS503") == "DS503"
    with pytest.raises(ValueError, match="DS504 leaves a gap: the next is DS503 or DS521"):
        make_rule.following(ids, "DS504")


@pytest.mark.parametrize("name", TOUCHED)
def test_no_skeleton_is_left(name: str) -> None:
    assert "TODO" not in (ROOT / name).read_text("utf-8")


def test_a_rule_that_is_there_already_stays_as_it_is(copy: Path) -> None:
    with pytest.raises(ValueError, match="DS415 is in"):
        make_rule.write(copy, "DS415")
    assert (copy / TOUCHED[0]).read_bytes() == (ROOT / TOUCHED[0]).read_bytes()
