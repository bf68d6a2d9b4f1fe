"""What a computer without internet installs from: its line works, and the files are what they say."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def house(repository, tmp_path_factory):
    """The unpacked wheelhouse."""
    folder = tmp_path_factory.mktemp("house")
    command = [
        sys.executable,
        str(repository / "tools" / "release" / "make_wheelhouse.py"),
        str(folder),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (archive,) = folder.glob("*.zip")
    zipfile.ZipFile(archive).extractall(folder)
    return folder / archive.stem


@pytest.fixture(scope="module")
def offline():
    """What a command begins with that shall have no network; nothing where this machine cannot do that."""
    command = ["unshare", "-rn"] if os.geteuid() else ["unshare", "-n"]
    works = (
        shutil.which("unshare")
        and subprocess.run([*command, "true"], capture_output=True).returncode == 0
    )
    if not works and os.environ.get("DS47_CI") == "1":
        pytest.fail("unshare -n does not work here", pytrace=False)
    return command if works else []


def install(house, offline, folder, line):
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    words = [str(folder / "bin" / "python"), *line.split()[1:]]
    uncompiled = os.environ | {"PIP_NO_COMPILE": "1"}  # what is imported is compiled then
    done = subprocess.run(
        [*offline, *words], cwd=house, capture_output=True, text=True, env=uncompiled
    )
    assert done.returncode == 0, done.stderr
    return folder / "bin" / "ds47"


def test_the_line_of_the_readme_installs_without_network(house, offline, captures, tmp_path):
    (line,) = re.findall(
        r"^ +(python3 -m pip .*)$", (house / "README.txt").read_text("utf-8"), re.MULTILINE
    )
    program = install(house, offline, tmp_path / "venv", line)
    environment = {"HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [*offline, str(program), "report", "-f", "html", "-o", str(tmp_path / "page.html"),
         str(captures / "tour-machine.pcapng")], env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert 'data-part="plots"' in (tmp_path / "page.html").read_text("utf-8")


def test_the_container_runs_the_same_line(house, offline, captures, tmp_path):
    """Its steps, done without a container: copied, installed without network, run by the entry point."""
    text = (house / "Containerfile").read_text("utf-8")
    copies = re.findall(r"^COPY (\S+) (\S+)$", text, re.MULTILINE)
    (run,) = re.findall(r"^RUN (.*)$", text, re.MULTILINE)
    (entry,) = re.findall(r'^ENTRYPOINT \["(.*)"\]$', text, re.MULTILINE)
    root = tmp_path / "root"
    for source, target in copies:
        place = root / target.strip("/")
        if (house / source).is_dir():
            shutil.copytree(house / source, place)
        else:
            shutil.copy(house / source, place)
    line, _, rest = run.partition(" && ")
    program = install(
        house, offline, tmp_path / "venv", line.replace("/wheels", str(root / "wheels"))
    )
    assert rest == "rm -r /wheels"
    assert program.name == entry
    done = subprocess.run(
        [program, "check", str(captures / "tour-machine.pcapng")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout


def test_every_file_is_listed_with_its_digest(house):
    listed = set(
        re.findall(r"--hash=sha256:([0-9a-f]{64})", (house / "requirements.txt").read_text("utf-8"))
    )
    there = {hashlib.sha256(each.read_bytes()).hexdigest() for each in (house / "wheels").iterdir()}
    assert listed == there


def test_the_libraries_are_those_of_the_constraints(house, repository):
    pinned = set(
        re.findall(
            r"--hash=sha256:([0-9a-f]{64})", Path(repository, "constraints.txt").read_text("utf-8")
        )
    )
    for each in (house / "wheels").iterdir():
        if not each.name.startswith("ds47-"):
            assert hashlib.sha256(each.read_bytes()).hexdigest() in pinned, each.name


def test_windows_and_macos_have_their_wheels(house):
    names = [each.name for each in (house / "wheels").iterdir()]
    for system in ("manylinux", "win_amd64", "macosx"):
        for minor in (11, 12, 13, 14):
            assert [
                each
                for each in names
                if each.startswith("markupsafe") and f"cp3{minor}" in each and system in each
            ]
