"""The tools that bring other versions of tshark and Python and run the tests on them.

Fetching packages is not tested here: it needs a mirror; `make matrix` and `make pythons` do it.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from lua_program import LUAS, QUICK, luas_of, runs_another
from shares import MANY, own, parts, share

posix = pytest.mark.skipif(os.name != "posix", reason="shell scripts")


@pytest.fixture(scope="module")
def matrix(repository: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("matrix", repository / "tools" / "matrix.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["matrix"] = module
    spec.loader.exec_module(module)
    return module


def script(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


def test_lines_of_the_roots_are_read(matrix: ModuleType) -> None:
    lines = "3.4 3.4.10 5.2.4 /a/b c/tshark\n4.6 4.6.9 5.4.9 /d/tshark\n"
    first, second = matrix.read_tsharks(lines)
    assert (first.series, first.version, first.lua) == ("3.4", "3.4.10", "5.2.4")
    assert first.program == "/a/b c/tshark"
    assert second.version == "4.6.9"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "passed", "failed", "skipped", "good"),
    [
        ("def test_a(): pass\ndef test_b(): pass", 2, 0, 0, True),
        ("def test_a(): pass\ndef test_b(): assert 0", 1, 1, 0, False),
        ("import pytest\ndef test_a(): pytest.skip('no')", 0, 0, 1, False),
        ("import nothing_of_this_name", 0, 1, 0, False),
        (None, 0, 1, 0, False),
    ],
    ids=["passes", "fails", "only skips", "cannot be imported", "is not there"],
)
def test_outcomes_are_counted(
    matrix: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    text: str | None,
    passed: int,
    failed: int,
    skipped: int,
    good: bool,
) -> None:
    if text is not None:
        (tmp_path / "test_wireshark_one.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(matrix, "TESTS", tmp_path)
    monkeypatch.setattr(matrix, "WORK", tmp_path / "work")
    outcome = matrix.run(matrix.Job("one", "5.4", "test_wireshark_*.py", "/no/tshark"), [])
    assert (outcome.passed, outcome.failed, outcome.skipped) == (passed, failed, skipped)
    assert outcome.good is good


@pytest.mark.slow
def test_tests_are_told_the_tshark(
    matrix: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "import os\ndef test_a(): assert os.environ['DS47_TSHARK'] == '/some/tshark'"
    (tmp_path / "test_wireshark_one.py").write_text(text, encoding="utf-8")
    monkeypatch.setattr(matrix, "TESTS", tmp_path)
    monkeypatch.setattr(matrix, "WORK", tmp_path / "work")
    job = matrix.Job("tshark 4.4", "5.4", "test_wireshark_*.py", "/some/tshark")
    outcome = matrix.run(job, [])
    assert outcome.good, outcome.output


def test_table_has_a_line_for_each_version(matrix: ModuleType) -> None:
    job = matrix.Job("tshark 4.4.18", "5.4.7", "test_wireshark_*.py")
    text = matrix.table([(job, matrix.Outcome(27, 1, 2, 4.25, ""))])
    assert text.splitlines()[1].split() == ["tshark", "4.4.18", "5.4.7", "27", "1", "2", "4.2"]


@posix
def test_root_runs_on_its_own_loader_and_libraries(repository: Path, tmp_path: Path) -> None:
    root = tmp_path / "a root"
    (root / "usr" / "lib" / "x86_64-linux-gnu").mkdir(parents=True)
    script(
        root / "lib64" / "ld-linux-x86-64.so.2", 'echo "$WIRESHARK_DATA_DIR"; printf "%s\\n" "$@"'
    )
    tool = repository / "tools" / "tshark-in-root.sh"
    as_user = {"PATH": f"{script(tmp_path / 'bin' / 'id', 'echo 1000').parent}:/usr/bin:/bin"}
    run = subprocess.run(
        [tool, root, "-r", "a b.pcap"], env=as_user, capture_output=True, text=True, check=True
    )
    libraries = f"{root}/usr/lib/x86_64-linux-gnu"
    assert run.stdout.splitlines() == [
        f"{root}/usr/share/wireshark",
        "--library-path",
        f"{libraries}:{libraries}/wireshark",
        f"{root}/usr/bin/tshark",
        "-r",
        "a b.pcap",
    ]


@posix
def test_root_becomes_an_ordinary_user(repository: Path, tmp_path: Path) -> None:
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("only root has somebody to become")
    script(tmp_path / "bin" / "tshark", "id -u; id -g; cat secret; touch made")
    (tmp_path / "secret").write_text("for root\n", encoding="utf-8")
    tmp_path.chmod(0o700)
    environment = {"PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}
    run = subprocess.run(
        [repository / "tools" / "tshark-in-root.sh", "/"],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split() == ["1000", "1000", "for", "root"]
    assert (tmp_path / "made").stat().st_uid == 1000


@posix
@pytest.mark.parametrize(
    ("command", "status"),
    [
        (["wireshark-roots.sh"], 77),
        (["pythons.sh"], 0),
        (["pythons.sh", "--must", "forky"], 1),
    ],
)
def test_without_root_it_says_so(
    repository: Path, tmp_path: Path, command: list[str], status: int
) -> None:
    environment = {"PATH": f"{script(tmp_path / 'bin' / 'id', 'echo 1000').parent}:/usr/bin:/bin"}
    run = subprocess.run(
        [repository / "tools" / command[0], *command[1:]],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == status
    assert "only as root" in run.stderr
    assert run.stdout == ""


@pytest.mark.parametrize("of", [1, 3, 4])
def test_the_parts_of_the_matrix_are_the_whole(monkeypatch: pytest.MonkeyPatch, of: int) -> None:
    items, found = list(range(10)), []
    for part in range(of):
        monkeypatch.setenv("DS47_SHARE", f"{part}/{of}")
        assert parts() == of
        found += share(items)
    assert sorted(found) == items


@dataclass(eq=False)
class Made:
    """A test as pytest has collected it, as far as `own` looks at it."""

    nodeid: str
    callspec: Any = None
    marks: tuple[str, ...] = ()

    def get_closest_marker(self, name: str) -> str | None:
        return name if name in self.marks else None


def test_tests_of_many_captures_are_divided_and_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    def tests(name: str, argument: str, count: int) -> list[Any]:
        return [
            Made(f"{name}[{at}]", SimpleNamespace(params={argument: at})) for at in range(count)
        ]

    many, few = tests("many", "name", MANY), tests("few", "name", MANY - 1)
    whole = [*tests("words", "word", 2 * MANY), *many, Made("one"), *few]
    marked = Made("marked", None, ("own",))
    several = []
    for part in range(3):
        monkeypatch.setenv("DS47_SHARE", f"{part}/3")
        several.append([item.nodeid for item in own([*whole, marked])])
    assert sorted(each for part in several for each in part if each.startswith("many")) == sorted(
        item.nodeid for item in many
    )
    for part in several:
        assert [each for each in part if not each.startswith("many")] == [
            item.nodeid for item in whole if item not in many
        ]


def test_marks_come_from_parameters_fixtures_and_names() -> None:
    def test(file: str, fixtures: tuple[str, ...] = (), **params: Any) -> Any:
        call = SimpleNamespace(params=params) if params else None
        return SimpleNamespace(path=Path(file), fixturenames=fixtures, callspec=call)

    assert [luas_of(test("test_a.py", lua=each)) for each in LUAS] == [{each} for each in LUAS]
    assert luas_of(test("test_a.py", version="5.4", number=5.2)) == {QUICK}
    assert luas_of(test("test_a.py", lang="en")) == luas_of(test("test_a.py")) == set()
    assert runs_another(test("test_a.py", lua="lua5.3"))
    assert runs_another(test("test_a.py", ("tmp_path", "tshark")))
    assert runs_another(test("test_lua_a.py"))
    assert runs_another(test("test_wireshark_a.py"))
    assert not runs_another(test("test_a.py", ("tmp_path",), lang="en"))


@pytest.mark.slow
def test_a_run_of_a_part_takes_its_tests(repository: Path) -> None:
    file = "tests/python/test_wireshark_packet_menu.py"
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "--collect-only",
        "-p",
        "no:cacheprovider",
        file,
    ]
    environment = os.environ | {"DS47_SHARE": "1/3", "DS47_EVERY": "1"}
    run = subprocess.run(
        command, cwd=repository, env=environment, capture_output=True, text=True, check=True
    )
    assert run.stdout.count("test_filters_show_what_they_say[") in (3, 4)
    assert " deselected" in run.stdout
