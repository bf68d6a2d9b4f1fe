"""What try_release.py says before it makes a root; the tries themselves are `make try-release`."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="mounts and namespaces")


def tried(repository: Path, dist: Path, *names: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(repository / "tools" / "release" / "try_release.py"), *names]
    environment = {**os.environ, "DS47_DIST": str(dist), "PATH": os.devnull}
    return subprocess.run(command, env=environment, capture_output=True, text=True)


def test_what_is_missing_is_said(repository: Path, tmp_path: Path) -> None:
    done = tried(repository, tmp_path, "python")
    assert (done.returncode, done.stderr) == (
        1,
        f"{tmp_path}: no ds47.pyz, or several; make release writes it\n",
    )


def test_a_file_that_is_not_what_its_checksum_says_is_not_tried(
    repository: Path, tmp_path: Path
) -> None:
    (tmp_path / "ds47.pyz").write_bytes(b"changed")
    digest = hashlib.sha256(b"released").hexdigest()
    (tmp_path / "SHA256SUMS").write_text(f"{digest}  ds47.pyz\n", "utf-8")
    done = tried(repository, tmp_path, "python")
    assert (done.returncode, done.stderr) == (
        1,
        f"{tmp_path / 'ds47.pyz'} is not what SHA256SUMS says\n",
    )


def test_a_name_that_nobody_knows_is_refused(repository: Path, tmp_path: Path) -> None:
    done = tried(repository, tmp_path, "ruby")
    assert (done.returncode, done.stderr) == (1, "no such thing to try: ruby\n")
