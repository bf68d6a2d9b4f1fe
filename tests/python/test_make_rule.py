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
    "tests/audit/claims.py", "tests/audit/causes.py",
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


@pytest.mark.parametrize(("rule", "changed"), [
    ("DS499", {0, 1, 3}), ("DS100", {0, 1, 3}), ("DS799", {0, 2, 4}),
    ("DS599", {0}), ("DS899", {0}), ("DS999", {0}),
])  # fmt: skip
def test_skeletons_stand_in_their_places(copy: Path, rule: str, changed: set[int]) -> None:
    told = make_rule.write(copy, rule)
    for number, name in enumerate(TOUCHED):
        text = (copy / name).read_text("utf-8")
        assert (rule in text) == (number in changed), name
        if name.endswith(".py"):
            ast.parse(text)
    rows = tomllib.loads((copy / TOUCHED[0]).read_text("utf-8"))["rule"]
    assert [row["id"] for row in rows] == sorted(row["id"] for row in rows)
    (row,) = (row for row in rows if row["id"] == rule)
    assert row.get("analyzer_only", False) == (rule in ("DS899", "DS999"))
    conditions = [line.partition(":")[0] for line in told if line.endswith("the condition")]
    assert len(conditions) == (1 if rule in ("DS899", "DS999") else 2)
    assert all((ROOT / path).is_file() for path in conditions)


def test_a_rule_that_is_there_already_stays_as_it_is(copy: Path) -> None:
    with pytest.raises(ValueError, match="DS415 is in"):
        make_rule.write(copy, "DS415")
    assert (copy / TOUCHED[0]).read_bytes() == (ROOT / TOUCHED[0]).read_bytes()
