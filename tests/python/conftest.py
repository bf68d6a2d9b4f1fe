"""Puts this folder on the path: tests import the helper modules beside them (frames.py).

And the scan twice, whatever is installed: plain and compiled.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from ds47.capture import scan

sys.path.insert(0, str(Path(__file__).resolve().parent))
import shares
from lua_program import QUICK, luas_of, runs_another

# Lists that whoever runs the tests took in name no parameter here.
os.environ["DS47_PARAMS"] = str(Path(__file__).with_name("no lists"))

SOURCE = Path(scan.__file__).with_name("scan.py")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Marks what only other programs decide, and leaves out what is not of this run's part (tools/matrix.py)."""
    for item in items:
        if luas_of(item) - {QUICK}:
            item.add_marker("slow")
        if runs_another(item):
            item.add_marker("plugin")
    kept = shares.own(items) if shares.parts() > 1 else items
    if len(kept) < len(items):
        config.hook.pytest_deselected(items=[item for item in items if item not in set(kept)])
        items[:] = kept


@pytest.fixture(scope="module")
def release_tools(repository: Path) -> Iterator[Path]:
    """tools/release, from which the tests of a module may import."""
    pytest.importorskip("packaging")
    tools = repository / "tools" / "release"
    sys.path.insert(0, str(tools))
    yield tools
    sys.path.remove(str(tools))


@pytest.fixture(scope="session")
def plain_scan() -> ModuleType:
    """scan.py as it stands, whatever `ds47.capture.scan` is."""
    return _load("plain_scan", SOURCE)


@pytest.fixture(scope="session")
def compiled_scan(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """scan.py compiled: as it is installed, or made here where there is a compiler."""
    if scan.COMPILED:
        return scan
    sources = (repository / "hatch_build.py", SOURCE, SOURCE.with_suffix(".pxd"))
    about = (
        f"{sysconfig.get_platform()} {sys.version} {os.environ.get('DS47_COMPILE_LEVEL')}".encode()
    )
    digest = hashlib.sha256(b"".join([about, *(each.read_bytes() for each in sources)])).hexdigest()
    kept = repository / "build" / "scan" / digest[:16]
    if not kept.exists():
        made = _compile(repository, tmp_path_factory.mktemp("compiled"))
        if not kept.exists():  # else another process was faster
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(made, kept)
    (library,) = (each for each in kept.iterdir() if each.suffix in (".so", ".pyd"))
    module = _load("ds47.capture.scan", library)
    assert module.COMPILED
    return module


def _compile(repository: Path, folder: Path) -> Path:
    """The folder with the library that is made of scan.py in `folder`; the test is skipped where there is none."""
    place = folder / "ds47" / "capture"
    place.mkdir(parents=True)
    for empty in (place.parent, place):
        (empty / "__init__.py").touch()
    for source in (SOURCE, SOURCE.with_suffix(".pxd")):
        shutil.copy(source, place)
    command = [sys.executable, str(repository / "hatch_build.py"), str(folder), "scan"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if not any(each.suffix in (".so", ".pyd") for each in place.iterdir()):
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"scan.py does not compile: {done.stderr[-2000:]}", pytrace=False)
        pytest.skip("no Cython or no C compiler")
    return place


def _load(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
