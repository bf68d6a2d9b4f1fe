"""The compiled package gives the reports of the plain one, byte for byte.

Compiling takes a minute, so it is done where DS47_CI=1 or DS47_COMPILED=1, or where it is done already.
"""

from __future__ import annotations

import importlib.util
import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.slow
COMPILED = "import ds47.capture.scan as s, ds47.acyclic.pairing as p; print(s.COMPILED, p.__file__)"

TOLD = """
import ds47, inspect, json
told = {}
for name in ds47.__all__:
    thing = getattr(ds47, name)
    own = vars(thing).items() if isinstance(thing, type) else ()
    parts = {f"{name}.{key}": each for key, each in own if isinstance(each, property)}
    told |= {key: inspect.getdoc(each) for key, each in ({name: thing} | parts).items()}
    if callable(thing) and not {BaseException, dict} & set(getattr(thing, "__mro__", ())):
        told[f"{name}()"] = [
            (each.name, str(each.kind), each.default is each.empty)
            for each in inspect.signature(thing).parameters.values()
        ]
print(json.dumps(told, sort_keys=True, indent=1))
"""
"""Prints the docstrings and signatures of all that is public, a line for each."""


def hook(repository: Path) -> Any:
    spec = importlib.util.spec_from_file_location("hatch_build", repository / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def compiled(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the compiled package in it; of what the compilers do not read, as it is now."""
    build, work = hook(repository), repository / "build" / "compiled"
    sources = repository / "python" / "ds47"
    if shutil.which("cc") is None and shutil.which("cl") is None:
        pytest.skip("no C compiler")
    wanted = "1" in (os.environ.get("DS47_CI"), os.environ.get("DS47_COMPILED"))
    if not wanted and not (work / build.digest(sources)).exists():
        pytest.skip("not compiled yet: DS47_COMPILED=1 does it")
    work.mkdir(parents=True, exist_ok=True)
    folder = tmp_path_factory.mktemp("compiled")
    shutil.copytree(build.compiled(sources, work), folder, dirs_exist_ok=True)
    extensions = shutil.ignore_patterns("*.so", "*.pyd")
    shutil.copytree(sources, folder / "ds47", dirs_exist_ok=True, ignore=extensions)
    return folder


def run(package: Path, *arguments: str, stdin: bytes = b"") -> tuple[int, bytes, bytes]:
    environment = os.environ | {"PYTHONPATH": str(package)}
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, input=stdin, check=False
    )
    return done.returncode, done.stdout, done.stderr


def test_it_is_compiled(compiled: Path) -> None:
    status, out, error = run(compiled, "-c", COMPILED)
    assert status == 0, error
    assert out.startswith(b"True ")
    assert not out.rstrip().endswith(b".py")


def test_what_is_public_keeps_its_docstrings_and_signatures(
    compiled: Path, repository: Path
) -> None:
    plain = run(repository / "python", "-c", TOLD)
    assert plain[0] == 0, plain[2]
    assert b"From the Write request to the first Read response" in plain[1]
    assert run(compiled, "-c", TOLD) == plain


@pytest.fixture(scope="session")
def damaged(captures: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copies of stored captures with bytes overwritten: nothing of them is sound for sure."""
    folder, chance = tmp_path_factory.mktemp("damaged"), random.Random(47)
    for path in sorted(captures.glob("*.pcap*"))[::3]:
        for number in range(3):
            data = bytearray(path.read_bytes())
            for _ in range(3 * number + 1):
                data[chance.randrange(200, len(data))] = chance.randrange(256)
            (folder / f"{number}-{path.name}").write_bytes(data)
    return folder


@pytest.mark.parametrize("format_name", ["json", "ndjson", "text"])
def test_reports_are_the_same(
    compiled: Path, repository: Path, captures: Path, damaged: Path, format_name: str
) -> None:
    """JSON has all that is said; of the others, which only put it another way, the stored captures are enough."""
    shared = repository.parent / "shared" / "captures"
    wanted = (captures, damaged, shared) if format_name == "json" else (captures,)
    folders = [str(each) for each in wanted if each.is_dir()]
    shown = ["--all"] if format_name == "text" else []
    arguments = ("-m", "ds47", "report", *shown, "-f", format_name, *folders)
    plain = run(repository / "python", *arguments)
    assert plain[0] in (0, 3), plain[2]
    assert len(plain[1]) > 100_000
    assert run(compiled, *arguments) == plain


@pytest.mark.parametrize("format_name", ["ndjson", "text"])
def test_watching_is_the_same(
    compiled: Path, repository: Path, captures: Path, format_name: str
) -> None:
    arguments = ("-m", "ds47", "watch", "-", "-f", format_name)
    for name in ("tour-machine", "record-reread", "record-write-refused"):
        data = (captures / f"{name}.pcapng").read_bytes()
        plain = run(repository / "python", *arguments, stdin=data)
        assert plain[0] == 0, plain[2]
        assert run(compiled, *arguments, stdin=data) == plain


def test_a_folder_with_a_series_is_the_same(
    compiled: Path, repository: Path, captures: Path, tmp_path: Path
) -> None:
    for number, name in enumerate(("tour-machine", "format-change"), 1):
        shutil.copy(
            captures / f"{name}.pcapng", tmp_path / f"ring_{number:05}_20240101000000.pcapng"
        )
    arguments = ("-m", "ds47", "report", "--series", "-f", "json", str(tmp_path), "-j", "2")
    plain = run(repository / "python", *arguments, "--results", str(tmp_path / "plain"))
    assert plain[0] == 0, plain[2]
    assert run(compiled, *arguments, "--results", str(tmp_path / "compiled")) == plain
    for path in (tmp_path / "plain").iterdir():
        assert path.read_bytes() == (tmp_path / "compiled" / path.name).read_bytes()
