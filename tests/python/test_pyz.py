"""The command in one file: it runs with a Python that knows nothing else, and says what the installed one says."""

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest
from report_formats import PRINTED

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pyz(repository, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pyz")
    command = [sys.executable, str(repository / "tools" / "release" / "make_pyz.py"), str(folder)]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "ds47.pyz"


@pytest.fixture
def run(pyz, tmp_path):
    """Runs it with the plain interpreter, without site packages, in an empty home."""
    plain = Path(sys.base_prefix) / "bin" / Path(sys.executable).resolve().name
    program = str(plain if plain.exists() else Path(sys.executable).resolve())

    def run(*arguments, cwd=tmp_path):
        environment = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], "TZ": "UTC"}
        return subprocess.run(
            [program, "-I", "-S", str(pyz), *arguments], cwd=cwd, env=environment, capture_output=True
        )  # fmt: skip

    return run


def installed(*arguments, cwd):
    environment = {**os.environ, "TZ": "UTC"}
    command = [sys.executable, "-m", "ds47", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, check=True).stdout


@pytest.mark.parametrize("kind", sorted({*PRINTED} - {"html"}))
def test_it_reports_what_the_command_reports(run, captures, kind):
    words = ["report", "-f", kind, "tour-machine.pcapng"]
    done = run(*words, cwd=captures)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout == installed(*words, cwd=captures)


def test_its_page_has_plots_and_equals_that_of_the_command(run, captures, tmp_path):
    for program, name in ((run, "one"), (installed, "two")):
        program(
            "report", "-f", "html", "-o", str(tmp_path / name), "tour-machine.pcapng", cwd=captures
        )
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert b'data-part="plots"' in (tmp_path / "one").read_bytes()


def test_processes_of_it_work_side_by_side(run, captures):
    words = ["report", "-j", "2", "-f", "json", "tour-machine.pcapng", "record-global.pcapng"]
    assert run(*words, cwd=captures).stdout == installed(*words, cwd=captures)


def test_every_stored_result_holds(run, captures):
    done = run("check", ".", cwd=captures)
    assert done.returncode == 0, done.stdout.decode()


def test_the_plugin_is_in_it(run, tmp_path):
    before = set(Path(tempfile.gettempdir()).glob("ds47-*"))
    done = run("plugin", "install", "--folder", str(tmp_path / "plugins"), "--no-profile")
    assert done.returncode == 0, done.stderr.decode()
    (written,) = (tmp_path / "plugins").rglob("ds47.lua")
    assert written.stat().st_size > 100_000
    left = set(Path(tempfile.gettempdir()).glob("ds47-*")) - before
    assert not [each for each in left if (each / "ds47").exists()], "what was unpacked is removed"


def test_equal_sources_give_equal_bytes(repository, pyz, tmp_path):
    command = [sys.executable, str(repository / "tools" / "release" / "make_pyz.py"), str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    assert (tmp_path / "ds47.pyz").read_bytes() == pyz.read_bytes()


def test_nothing_in_it_is_compiled_and_licences_are(pyz):
    names = zipfile.ZipFile(pyz).namelist()
    assert not [name for name in names if name.endswith((".so", ".pyd", ".pyc"))]
    projects = {name.split("-")[0] for name in names if ".dist-info/" in name}
    licensed = {
        name.split("-")[0] for name in names if ".dist-info/" in name and "licen" in name.lower()
    }
    assert projects == licensed


def test_an_old_python_is_told_so(pyz):
    source = zipfile.ZipFile(pyz).read("__main__.py").decode()
    told = source.replace("sys.version_info <", "(3, 9, 1) <").replace(
        "sys.version_info[", "(3, 9)["
    )
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("ds47 needs Python 3.11 or later; this is 3.9 (")
