"""The skeletons of a new rule: they stand in their places, read well, and say what is to be filled in."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from lua_program import QUICK, lua_program

ROOT = Path(__file__).resolve().parents[2]
RULES = "python/ds47/spec/rules.toml"
AUDIT, LAB, SOURCES = "tests/audit/", "python/ds47/lab/", "tests/vectors/sources/"
TALKS, CAUSES = f"{SOURCES}conversations.py", f"{SOURCES}diagnoses.py"


def judges(*modules: str) -> set[str]:
    """Modules that have a twin in Lua."""
    both = (("python", "py"), ("lua", "lua"))
    return {f"{language}/ds47/{each}.{kind}" for each in modules for language, kind in both}


WRITTEN = {
    "DS1": judges("acyclic/record_calls") | {f"{LAB}transport.py", TALKS, f"{AUDIT}claims.py"},
    "DS2": judges("acyclic/judge") | {f"{LAB}records.py", TALKS, f"{AUDIT}claims.py"},
    "DS3": judges("profidrive/parameter") | {f"{AUDIT}claims.py"},
    "DS4": judges("acyclic/judge") | {f"{LAB}conversation.py", TALKS, f"{AUDIT}claims.py"},
    "DS51": judges("cyclic/judge") | {f"{AUDIT}pkw.py"},
    "DS5": judges("cyclic/operation") | {f"{AUDIT}pzd.py"},
    "DS7": judges("diagnosis/refusal") | {f"{LAB}diagnoses.py", CAUSES, f"{AUDIT}causes.py"},
    "DS8": {"python/ds47/profibus/judge.py", f"{AUDIT}stations.py"},
    "DS9": {"python/ds47/s7/judge.py", f"{AUDIT}s7.py"},
}
"""Hundreds -> where a rule has a skeleton, beside the catalogue."""
TOUCHED = sorted({RULES}.union(*WRITTEN.values()))
CAPTURES = (
    "tour-machine.pcapng", "cyclic-does-not-start.pcapng", "diagnosis-commissioning-state.pcapng",
    "profibus/pyprofibus_ppo1.pcapng", "s7-figure-1.pcapng",
)  # fmt: skip
SPEC = importlib.util.spec_from_file_location("make_rule", ROOT / "tools" / "make_rule.py")
assert SPEC is not None
assert SPEC.loader is not None
make_rule = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(make_rule)


@pytest.fixture(scope="module")
def nothing_begun() -> None:
    if any("TODO" in (ROOT / name).read_text("utf-8") for name in TOUCHED):
        pytest.skip("a rule is being written here")


@pytest.fixture
def copy(tmp_path: Path, nothing_begun: None) -> Path:
    for name in TOUCHED:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def next_of(hundred: str) -> str:
    """The next rule of a hundred, or of ten of one."""
    ids = make_rule.IDS.findall((ROOT / RULES).read_text("utf-8"))
    newest = max(each for each in ids if each.startswith(hundred))
    return hundred if len(hundred) == len("DS4") else f"DS{int(newest[2:]) + 1}"


@pytest.mark.parametrize("hundred", WRITTEN)
def test_skeletons_stand_in_their_places(copy: Path, hundred: str) -> None:
    before = {name: (copy / name).read_text("utf-8") for name in TOUCHED}
    left = make_rule.write(copy, next_of(hundred))
    after = {name: (copy / name).read_text("utf-8") for name in TOUCHED}
    changed = {name for name in TOUCHED if after[name] != before[name]}
    assert changed == {RULES, *WRITTEN[hundred]}
    assert all("TODO" in after[name] for name in changed)
    rows = tomllib.loads(after[RULES])["rule"]
    assert [row["id"] for row in rows] == sorted(row["id"] for row in rows)
    (row,) = (row for row in rows if f'"{row["id"]}"' not in before[RULES])
    assert all(row["id"] in after[name] for name in changed)
    assert row.get("analyzer_only", False) == (hundred in ("DS8", "DS9"))
    places = [line.partition(":")[0] for line in left if not line.startswith("then")]
    assert changed <= set(places)
    assert all((ROOT / path).is_file() for path in places)


def run(folder: Path, *command: str | Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(folder / "python")}
    told = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert told.returncode == 0, told.stdout + told.stderr


@pytest.mark.parametrize("hundred", WRITTEN)
def test_skeletons_pass_the_linters(copy: Path, hundred: str) -> None:
    make_rule.write(copy, next_of(hundred))
    for name in ("pyproject.toml", ".luacheckrc"):
        shutil.copy(ROOT / name, copy)
    ruff = (sys.executable, "-m", "ruff")
    run(copy, *ruff, "check", "--no-cache", "--ignore", "I001", ".")  # which other files decide
    run(copy, *ruff, "format", "--no-cache", "--check", ".")
    if luacheck := shutil.which("luacheck"):
        run(copy, luacheck, "--quiet", "lua" if (copy / "lua").exists() else ".")


@pytest.mark.slow
@pytest.mark.plugin
def test_skeletons_have_types_and_find_nothing_yet(tmp_path: Path, nothing_begun: None) -> None:
    """All at once, in a checkout of their own: what is stored of a capture is what is found."""
    for name in ("python", "lua", "tests/audit", "tests/lua", "tests/vectors"):
        shutil.copytree(ROOT / name, tmp_path / name)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for hundred in WRITTEN:
        make_rule.write(tmp_path, next_of(hundred))
    run(tmp_path, sys.executable, "-m", "mypy", "--strict", "python/ds47")
    captures = [ROOT / "captures" / name for name in CAPTURES]
    run(tmp_path, sys.executable, "-m", "ds47", "check", *captures)
    vectors = "tests/vectors/conversations.json"
    run(tmp_path, lua_program(QUICK), "tests/lua/conversations.lua", vectors)


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
    assert (copy / RULES).read_bytes() == (ROOT / RULES).read_bytes()
