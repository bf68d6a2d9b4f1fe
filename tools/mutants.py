"""Changes one thing in pairing, the rules, the totals or the statistics, and looks whether a test notices.

    .venv/bin/python tools/mutants.py --number 100 --seed 1      prints a line for each that lives, and the sums

A mutant is one change of one file: a comparison turned round, a number one more, `and` for `or`, a condition
never true, a statement left out. Each runs the tests that are about its file (`TESTS`), the quick ones first, in a
copy of the checkout. Which mutants there are depends on the seed and the files alone. Nothing is changed in the
checkout itself. Before the first one all these tests run as they are: one that fails anyway would kill everything.
What hypothesis finds it does not make smaller there: that takes minutes, and nobody reads it.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parent.parent
LEFT_OUT = shutil.ignore_patterns(
    ".git", ".venv", "build", "dist", "data", "__pycache__", ".*_cache", ".hypothesis", "images"
)
RULES = ("test_judge", "test_readback", "test_findings", "test_conversations", "test_real_stacks")
DIAGNOSES = (
    "test_conversations",
    "test_repair",
    "test_diagnoses",
    "test_told_truly",
    "test_real_stacks",
)
SAVING = ("test_saving", *DIAGNOSES)
REPORT = (
    "test_report_totals",
    "test_report_opening",
    "test_report_html",
    "test_report_formats",
    "test_audit",
)
LUA = ("test_lua_conversations", "test_lua_analysis")
LINES = "test_lua_analysis:5.4 and lines_of_profibus"
BUS = (
    "test_profibus_bus",
    "test_profibus_calls",
    "test_profibus_ppo",
    "test_s7_by_chance:lines",
    "test_audit_profibus",
)
PZD = "test_lua_pzd:5.4 and not zh"
CYCLIC = (
    "test_cyclic",
    "test_drive_story",
    "test_handshake",
    "test_cyclic_limits:not lua",
    "test_parameter_channels",
    "test_cyclic_scenes:not much_random",
    PZD,
    "test_profibus_ppo",
    "test_audit_profibus",
    "test_cyclic_scenes:much_random",
)
LUA_CYCLIC = ("test_cyclic_limits:5.4", PZD, "test_lua_cyclic", "test_lua_analysis:5.4 and ppo")
S7 = (
    "test_s7_judge",
    "test_s7_limits",
    "test_s7_near",
    "test_s7_audit",
    "test_s7_moments",
    "test_s7_scenes",
    "test_s7",
    "test_s7_by_chance",
)
WHOLE = ("test_conversations", "test_real_stacks", "test_stored_captures", "test_hostile")
TESTS: dict[str, tuple[str, ...]] = {
    "python/ds47/acyclic/pairing.py": (
        "test_pairing",
        "test_completeness",
        "test_profibus_calls",
        *WHOLE,
    ),
    "python/ds47/profinet/completeness.py": ("test_completeness", *WHOLE),
    "python/ds47/profinet/calls.py": ("test_calls", "test_completeness", *WHOLE),
    "python/ds47/profinet/rpc.py": ("test_rpc", "test_calls", "test_short_ways", *WHOLE),
    "python/ds47/acyclic/judge.py": RULES,
    "python/ds47/acyclic/readback.py": RULES,
    "python/ds47/profidrive/dictionary.py": ("test_dictionary", "test_learning"),
    "python/ds47/acyclic/learning.py": ("test_learning",),
    "python/ds47/profidrive/drive_objects.py": ("test_drive_objects", *RULES),
    "python/ds47/findings/collection.py": RULES,
    "python/ds47/acyclic/transactions.py": ("test_transactions", *RULES),
    "python/ds47/diagnosis/__init__.py": ("test_diagnosis", *DIAGNOSES),
    "python/ds47/diagnosis/capture.py": ("test_diagnosis_capture", *DIAGNOSES),
    "python/ds47/findings/grouping.py": ("test_headlines", *DIAGNOSES, "test_report_opening"),
    "python/ds47/diagnosis/length.py": ("test_length", *DIAGNOSES),
    "python/ds47/diagnosis/order.py": ("test_order", *DIAGNOSES),
    "python/ds47/diagnosis/refusal.py": ("test_refusal", *DIAGNOSES),
    "python/ds47/diagnosis/repair.py": DIAGNOSES,
    "python/ds47/diagnosis/repetition.py": ("test_repetition", *DIAGNOSES),
    "python/ds47/diagnosis/saving.py": SAVING,
    "python/ds47/diagnosis/suggest.py": DIAGNOSES,
    "python/ds47/diagnosis/targets.py": SAVING,
    "python/ds47/report/todo.py": REPORT,
    "python/ds47/report/verdict.py": REPORT,
    "python/ds47/report/latency.py": REPORT,
    "python/ds47/report/overview.py": (*REPORT, "test_folders"),
    "python/ds47/report/html/views/__init__.py": REPORT,
    "python/ds47/report/html/views/drives.py": REPORT,
    "python/ds47/report/html/views/elements.py": REPORT,
    "python/ds47/report/html/views/findings.py": REPORT,
    "python/ds47/report/html/views/problems.py": REPORT,
    "python/ds47/report/html/views/rows.py": REPORT,
    "python/ds47/report/bus.py": (
        "test_profibus_bus",
        "test_audit_profibus",
        "test_profibus_ppo",
        "test_profibus_command",
    ),
    "python/ds47/profibus/judge.py": BUS,
    "python/ds47/profibus/stations.py": BUS,
    "python/ds47/profibus/line.py": (*BUS, LINES),
    "python/ds47/cyclic/conclusions.py": CYCLIC,
    "python/ds47/cyclic/explanation.py": CYCLIC,
    "python/ds47/cyclic/habits.py": CYCLIC,
    "python/ds47/cyclic/judge.py": CYCLIC,
    "python/ds47/cyclic/operation.py": CYCLIC,
    "python/ds47/cyclic/trips.py": ("test_trips", *CYCLIC),
    "python/ds47/s7/judge.py": S7,
    "python/ds47/s7/consistency.py": ("test_s7_consistency", *S7),
    "python/ds47/s7/moments.py": ("test_s7_moments", *S7),
    "lua/ds47/profinet/completeness.lua": ("test_lua_completeness", *LUA),
    "lua/ds47/profibus/line.lua": ("test_lua_profibus", LINES, "test_lua_analysis:5.4 and auditor"),
    "lua/ds47/cyclic/conclusions.lua": LUA_CYCLIC,
    "lua/ds47/cyclic/explanation.lua": LUA_CYCLIC,
    "lua/ds47/cyclic/habits.lua": LUA_CYCLIC,
    "lua/ds47/cyclic/judge.lua": LUA_CYCLIC,
    "lua/ds47/cyclic/operation.lua": LUA_CYCLIC,
    "lua/ds47/cyclic/trips.lua": ("test_trips:5.4", *LUA_CYCLIC),
    "lua/ds47/acyclic/judge.lua": ("test_lua_judge", *LUA),
    "lua/ds47/acyclic/readback.lua": ("test_lua_judge", *LUA),
    "lua/ds47/profidrive/dictionary.lua": ("test_lua_dictionary:5.4",),
    "lua/ds47/profidrive/drive_objects.lua": ("test_lua_judge", *LUA),
    "lua/ds47/report/statistics.lua": ("test_lua_report", "test_wireshark_statistics"),
    "lua/ds47/report/text.lua": ("test_lua_report",),
}
LESS: dict[str, tuple[str, ...]] = {
    "test_lua_conversations": ("-k", "5.4"),
    "test_lua_judge": ("-k", "5.4"),
    "test_lua_report": ("-k", "5.4"),
    "test_lua_profibus": ("-k", "5.4"),
    "test_lua_pzd": ("-k", "5.4"),
    "test_lua_cyclic": ("-k", "5.4"),
    "test_lua_analysis": ("-k", "5.4"),
    "test_audit": ("-k", "stored or false"),
}
"""What a test file does for each Lua is enough once, and of the auditor what is quick; `name:tests` chooses."""
AT_ONCE = """
from hypothesis import Phase, settings

settings.register_profile("at once", phases=(Phase.explicit, Phase.generate))
settings.load_profile("at once")
"""
TIMEOUT = 300
"""Seconds; a mutant that never ends is noticed as well."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A file with one change; `what` says which, `line` where, `now` what stands there."""

    path: str
    line: int
    what: str
    now: str
    text: str


# Python


_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
_COUNTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.FloorDiv, ast.FloorDiv: ast.Mult,
}  # fmt: skip
_NAMED = {"min": "max", "max": "min", "any": "all", "all": "any"}


def _changed(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What a node may become, with a word for each."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        other = _COMPARED.get(type(node.ops[0]))
        if other is not None:
            yield "comparison", ast.Compare(node.left, [other()], node.comparators)
    elif isinstance(node, ast.BoolOp):
        op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "and/or", ast.BoolOp(op, node.values)
        for each in node.values:
            rest = [other for other in node.values if other is not each]
            yield "operand", ast.BoolOp(node.op, rest) if len(rest) > 1 else rest[0]
    elif isinstance(node, ast.Name) and node.id in _NAMED:
        yield "name", ast.Name(_NAMED[node.id])
    elif isinstance(node, ast.BinOp) and type(node.op) in _COUNTED:
        yield "operator", ast.BinOp(node.left, _COUNTED[type(node.op)](), node.right)
    elif isinstance(node, ast.Constant) and type(node.value) is int:
        yield "number", ast.Constant(node.value + 1)
    elif isinstance(node, ast.If):
        yield "condition", ast.If(ast.Constant(False), node.body, node.orelse)
        yield "condition", ast.If(ast.Constant(True), node.body, node.orelse)
    elif (
        isinstance(node, ast.AugAssign | ast.Delete)
        or (isinstance(node, ast.Expr) and not isinstance(node.value, ast.Constant))
        or (isinstance(node, ast.Assign) and not isinstance(node.targets[0], ast.Name))
    ):
        yield "left out", ast.Pass()


def of_python(path: str) -> Iterator[Mutant]:
    """Each change inside a function; the file is written out anew, so comments are gone."""
    source = (ROOT / path).read_text(encoding="utf-8")
    tree = ast.parse(source)
    inside = [
        node
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for statement in function.body
        for node in ast.walk(statement)
    ]
    for node in dict.fromkeys(inside):
        for what, other in _changed(node):
            kept = dict(vars(node)), type(node)
            line: int = node.lineno  # type: ignore[attr-defined]
            now = ast.unparse(other).partition("\n")[0]
            yield Mutant(path, line, what, now, _with(tree, node, other))
            assert (dict(vars(node)), type(node)) == kept


class _Put(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self._new if node is self._old else super().visit(node)


def _with(tree: ast.Module, node: ast.AST, other: ast.AST) -> str:
    """The source with one node changed; the tree stays as it is."""
    ast.copy_location(other, node)
    changed = _Put(node, other).visit(tree)
    text = ast.unparse(ast.fix_missing_locations(changed))
    _Put(other, node).visit(changed)
    return text


# Lua


_LUA = (
    (re.compile(r"(?<![<>=~])<(?![<=])"), "<=", "comparison"), (re.compile(r"<="), "<", "comparison"),
    (re.compile(r"(?<![<>=~-])>(?![>=])"), ">=", "comparison"), (re.compile(r">="), ">", "comparison"),
    (re.compile(r"=="), "~=", "comparison"), (re.compile(r"~="), "==", "comparison"),
    (re.compile(r"\band\b"), "or", "and/or"), (re.compile(r"\bor\b"), "and", "and/or"),
    (re.compile(r" \+ "), " - ", "operator"), (re.compile(r" - "), " + ", "operator"),
    (re.compile(r"\bif\b (?!false)"), "if false and ", "condition"),
    (re.compile(r"\bif\b (?!true)"), "if true or ", "condition"),
    (re.compile(r"\bmath\.max\b"), "math.min", "name"), (re.compile(r"\bmath\.min\b"), "math.max", "name"),
)  # fmt: skip
_NUMBER = re.compile(r"(?<![\w.\"'])(\d+)(?![\w.\"'])")


def of_lua(path: str) -> Iterator[Mutant]:
    """Each change of a line that is code inside a function."""
    lines = (ROOT / path).read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines):
        code = line.split("--")[0]
        if not code.startswith("  "):
            continue
        for pattern, other, what in _LUA:
            for found in pattern.finditer(code):
                yield _lua_mutant(path, lines, number, found, other, what)
        for found in _NUMBER.finditer(code):
            yield _lua_mutant(path, lines, number, found, str(int(found[1]) + 1), "number")


def _lua_mutant(
    path: str, lines: list[str], number: int, found: re.Match[str], other: str, what: str
) -> Mutant:
    line = lines[number]
    changed = line[: found.start()] + other + line[found.end() :]
    text = "\n".join([*lines[:number], changed, *lines[number + 1 :]])
    return Mutant(path, number + 1, what, changed.strip(), text)


# Running them


def chosen(number: int, seed: int, only: Sequence[str]) -> list[Mutant]:
    """So many of all, as many of each file as it has a share of them, and one at least."""
    chance = random.Random(seed)
    paths = [path for path in TESTS if any(each in path for each in only)]
    all_of = {path: list((of_lua if path.endswith(".lua") else of_python)(path)) for path in paths}
    total = sum(map(len, all_of.values()))
    picked = []
    for mutants in all_of.values():
        share = min(len(mutants), max(1, round(number * len(mutants) / max(1, total))))
        picked += chance.sample(mutants, share)
    return picked


def copied(folder: Path) -> Path:
    """The checkout without what the tests do not need, and what lies beside it."""
    copy = Path(shutil.copytree(ROOT, folder / "ds47", ignore=LEFT_OUT))
    with (copy / "tests" / "conftest.py").open("a", encoding="utf-8") as file:
        file.write(AT_ONCE)
    if (beside := ROOT.parent / "shared").exists():
        (folder / "shared").symlink_to(beside)
    return copy


def fails(entry: str, copy: Path) -> bool:
    """Whether a test file, or what is chosen of it, fails in a copy of the checkout, or never ends."""
    name, _, only = entry.partition(":")
    command = [sys.executable, "-m", "pytest", "-qx", "-p", "no:cacheprovider"]
    command += [str(copy / "tests/python" / f"{name}.py")]
    command += ("-k", only) if only else LESS.get(name, ())
    environment = {**os.environ, "PYTHONPATH": str(copy / "python"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        ended = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, timeout=TIMEOUT
        )
    except subprocess.TimeoutExpired:
        return True
    return ended.returncode != 0


def survives(mutant: Mutant, copy: Path) -> bool:
    """Whether all tests about its file pass in a copy of the checkout."""
    target = copy / mutant.path
    original = target.read_text(encoding="utf-8")
    target.write_text(mutant.text, encoding="utf-8")
    try:
        return not any(fails(entry, copy) for entry in TESTS[mutant.path])
    finally:
        target.write_text(original, encoding="utf-8")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--number", type=int, default=100, help="how many mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", help="only of files whose path holds this")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    mutants = chosen(options.number, options.seed, options.only or [""])
    copies: Queue[Path] = Queue()
    tried, lived = Counter[str](), Counter[str]()

    def run(mutant: Mutant) -> None:
        copy = copies.get()
        alive = survives(mutant, copy)
        copies.put(copy)
        tried[mutant.path] += 1
        if alive:
            lived[mutant.path] += 1
            print(f"lives: {mutant.path}:{mutant.line} {mutant.what}: {mutant.now}", flush=True)

    with tempfile.TemporaryDirectory(prefix="ds47-mutants-") as folder:
        for number in range(options.jobs):
            copies.put(copied(Path(folder, str(number))))
        entries = dict.fromkeys(entry for each in mutants for entry in TESTS[each.path])
        if failing := [entry for entry in entries if fails(entry, copies.queue[0])]:
            print(f"fail without any change: {', '.join(failing)}")
            return 1
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(run, mutants))
    for path in sorted(tried):
        print(f"{path}: {tried[path]} tried, {tried[path] - lived[path]} killed")
    killed = tried.total() - lived.total()
    print(f"{tried.total()} tried, {killed} killed, {100 * killed / max(1, tried.total()):.1f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
