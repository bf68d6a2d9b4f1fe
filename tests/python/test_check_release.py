"""What check_release.py says of a release that is not whole; that of a whole one is part of `make release`."""

from __future__ import annotations

import hashlib
import importlib.util
import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

import ds47


@pytest.fixture(scope="module")
def check(release_tools: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "check_release", release_tools / "check_release.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    import make_release

    module.release = make_release
    return module


@pytest.fixture
def folder(check: ModuleType, tmp_path: Path) -> Path:
    """Files of the right names and sizes, with nothing in them, and their checksums."""
    for pattern, most in check.MOST.items():
        middle = {"-cp*.whl": "-cp311-cp311-linux_x86_64.whl"}
        name = pattern.replace("ds47-*-cp*.whl", f"ds47-*{middle['-cp*.whl']}")
        name = name.replace("*", ds47.__version__)
        (tmp_path / name).write_bytes(b" " * (most // 10))
    seal(tmp_path)
    return tmp_path


def seal(folder: Path) -> None:
    files = [path for path in sorted(folder.iterdir()) if not path.name.startswith("SHA256SUMS")]
    lines = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)
    (folder / "SHA256SUMS").write_text("".join(lines), "utf-8")


def test_names_sizes_and_sums_of_a_whole_one_are_right(check: ModuleType, folder: Path) -> None:
    check.weigh(folder)
    check.sums(folder)


def test_what_belongs_to_no_release_is_told(check: ModuleType, folder: Path) -> None:
    (folder / "notes.txt").write_text("x", "utf-8")
    with pytest.raises(SystemExit, match=r"notes\.txt belongs to no release"):
        check.weigh(folder)


@pytest.mark.parametrize("name", ["ds47.html", "ds47.pyz"])
def test_what_is_missing_too_big_or_empty_is_told(
    check: ModuleType, folder: Path, name: str
) -> None:
    (folder / name).write_bytes(b" " * (check.MOST[name] + 1))
    with pytest.raises(SystemExit, match=rf"{name} has {check.MOST[name] + 1} bytes"):
        check.weigh(folder)
    (folder / name).write_bytes(b"")
    with pytest.raises(SystemExit, match=rf"{name} has 0 bytes"):
        check.weigh(folder)
    (folder / name).unlink()
    with pytest.raises(SystemExit, match=rf"0 files {name}"):
        check.weigh(folder)


def test_two_of_what_there_is_one_of_are_told(check: ModuleType, folder: Path) -> None:
    (folder / "ds47-0.0.1.tar.gz").write_bytes(b" " * 100_000)
    with pytest.raises(SystemExit, match=r"2 files ds47-\*\.tar\.gz"):
        check.weigh(folder)


def test_sums_that_are_wrong_are_told(check: ModuleType, folder: Path) -> None:
    (folder / "ds47.pyz").write_bytes(b"changed")
    with pytest.raises(SystemExit, match=r"ds47\.pyz is not what SHA256SUMS says"):
        check.sums(folder)
    seal(folder)
    (folder / "ds47.html").unlink()
    with pytest.raises(SystemExit, match=r"ds47\.html is listed in SHA256SUMS and not there"):
        check.sums(folder)


@pytest.fixture
def key(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A key without a passphrase."""
    if shutil.which("ssh-keygen") is None:
        pytest.skip("ssh-keygen is missing")
    path = tmp_path_factory.mktemp("key") / "key"
    words = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(path)]
    subprocess.run(words, check=True)
    return path


def test_sums_are_signed_where_there_is_a_key(check: ModuleType, folder: Path, key: Path) -> None:
    make = check.release
    (folder / "SHA256SUMS").unlink()
    assert make.seal(folder, None).endswith("is not signed: RELEASE_KEY names no key")
    assert not (folder / "SHA256SUMS.sig").exists()
    (folder / "SHA256SUMS").unlink()
    assert make.seal(folder, str(key)).endswith("which is signed")
    check.weigh(folder)
    check.sums(folder)
    (folder / "ds47.pyz").write_bytes(b" " * 50_000)
    seal(folder)
    with pytest.raises(SystemExit, match=r"SHA256SUMS\.sig is no signature of SHA256SUMS"):
        check.sums(folder)


def test_another_version_is_told(check: ModuleType, folder: Path) -> None:
    (folder / "ds47-0.0.1-py3-none-any.whl").write_bytes(b"")
    with pytest.raises(
        SystemExit, match=rf"0\.0\.1-py3-none-any\.whl is not of version {ds47.__version__}"
    ):
        check.versions(folder)
