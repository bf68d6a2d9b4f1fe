"""Puts this folder on the path: tests import the helper modules beside them (frames.py).

And the scan twice, whatever is installed: plain and compiled.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from ds47.capture import scan

sys.path.insert(0, str(Path(__file__).resolve().parent))
import shares

# Lists that whoever runs the tests took in name no parameter here.
os.environ["DS47_PARAMS"] = str(Path(__file__).with_name("no lists"))

SOURCE = Path(scan.__file__).with_name("scan.py")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where a run takes a part of the captures (tools/matrix.py), the tests of the others are left out."""
    kept = shares.own(items) if shares.parts() > 1 else items
    if len(kept) < len(items):
        config.hook.pytest_deselected(items=[item for item in items if item not in set(kept)])
        items[:] = kept


@pytest.fixture(scope="session")
def plain_scan() -> ModuleType:
    """scan.py as it stands, whatever `ds47.capture.scan` is."""
    return _load("plain_scan", SOURCE)


@pytest.fixture(scope="session")
def compiled_scan(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """scan.py compiled: as it is installed, or made here where there is a compiler."""
    if scan.COMPILED:
        return scan
    folder = tmp_path_factory.mktemp("compiled")
    (folder / "ds47" / "capture").mkdir(parents=True)
    for part in ("__init__.py", "capture/scan.py", "capture/scan.pxd"):
        content = (
            b""
            if part.endswith("__init__.py")
            else SOURCE.parent.parent.joinpath(part).read_bytes()
        )
        (folder / "ds47" / part).write_bytes(content)
    (folder / "ds47" / "capture" / "__init__.py").touch()
    command = [sys.executable, str(repository / "hatch_build.py"), str(folder), "scan"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    made = [
        each for each in (folder / "ds47" / "capture").iterdir() if each.suffix in (".so", ".pyd")
    ]
    if not made:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"scan.py does not compile: {done.stderr[-2000:]}", pytrace=False)
        pytest.skip("no Cython or no C compiler")
    module = _load("ds47.capture.scan", made[0])
    assert module.COMPILED
    return module


def _load(name: str, path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
