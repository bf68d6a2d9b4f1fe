"""The life of an installation where something forbids it: each one line that says what to do.

As an ordinary user: root may do everything. No program is run, because the user may not be allowed to reach
this checkout: what Wireshark says of its folders is told to `locate`.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_tshark import stand_in

import ds47.cli.plugin  # loaded before the right to read it is gone
from ds47.cli import main
from ds47.wireshark import doctor, install, locate

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="rights are others there")
NOBODY = 65534
assert ds47.cli.plugin


@pytest.fixture
def home() -> Iterator[Path]:
    """A folder of an ordinary user, who runs the test."""
    folder = Path(tempfile.mkdtemp(prefix="ds47-life-"))
    root = os.geteuid() == 0
    if root:
        os.chown(folder, NOBODY, NOBODY)
        os.seteuid(NOBODY)
    try:
        yield folder
    finally:
        if root:
            os.seteuid(0)
        subprocess.run(["chmod", "-R", "u+rwX", folder], check=True)
        shutil.rmtree(folder)


@pytest.fixture
def shark(home: Path, monkeypatch: pytest.MonkeyPatch) -> locate.Wireshark:
    stand_in(home, monkeypatch)
    monkeypatch.setenv("HOME", str(home))
    folders = locate.Folders(home / "lib" / "plugins", home / "config")
    found = locate.Wireshark(home / "tshark", (4, 4, 0), "5.4", folders)
    monkeypatch.setattr(locate, "find", lambda _program=None: found)
    return found


@pytest.fixture
def plugins(shark: locate.Wireshark) -> Path:
    return shark.folders.personal_lua


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    capsys.readouterr()
    status = main(["plugin", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def one_line(text: str) -> str:
    """The only line of a text, which names no number of an error and no class of Python."""
    (line,) = text.splitlines()
    assert "Errno" not in line
    assert "Error" not in line
    return line


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def do(line: str) -> None:
    """Runs the command that a line gives: `... : chmod -R u+rwX FOLDER, then do this again`."""
    command = line.split(": ")[-1].split(", then ")[0]
    assert command.startswith("chmod")
    subprocess.run(shlex.split(command), check=True)


@pytest.mark.parametrize("mode", [0o555, 0o444, 0])
@pytest.mark.parametrize("exists", [True, False])
def test_an_unwritable_folder(shark, plugins, capsys, exists, mode) -> None:
    place = plugins if exists else plugins.parent
    place.mkdir(parents=True)
    place.chmod(mode)
    status, out, err = run(capsys, "install")
    assert (status, out) == (1, "")
    line = one_line(err)
    assert str(place) in line
    told = doctor.check_installed(doctor.Patient(shark))
    assert told.state == "wrong"
    assert f"no right to write into {place}" in told.text
    assert told.mend == f"chmod -R u+rwX {place}, then ds47 plugin install"
    do(line)
    assert run(capsys, "install")[0] == 0
    assert doctor.check_installed(doctor.Patient(shark)).state == "ok"


@pytest.mark.parametrize("arguments", [["install"], ["install", "--force"], ["uninstall"]])
def test_a_copy_that_may_not_be_removed(shark, plugins, capsys, arguments) -> None:
    """It would go on to be loaded, under another name."""
    run(capsys, "install")
    (plugins / "ds47").chmod(0o555)
    before = contents(plugins)
    status, _, err = run(capsys, *arguments)
    assert status == 1
    line = one_line(err)
    assert str(plugins / "ds47") in line
    assert contents(plugins) == before
    assert len(install.copies(plugins)) == 1
    (plugins / "ds47").chmod(0o755)
    (plugins / "ds47" / "ds47.lua").write_text("-- changed")
    (plugins / "ds47").chmod(0o555)
    told = doctor.check_current(doctor.Patient(shark))
    assert told.mend == f"chmod -R u+rwX {plugins / 'ds47'}, then ds47 plugin install --force"
    do(line)
    assert run(capsys, arguments[0], "--force")[0] == 0
    assert len(install.copies(plugins)) == (arguments[0] == "install")


def test_a_folder_by_hand_that_may_not_be_emptied(shark, plugins, capsys) -> None:
    inside = plugins / "ds47" / "ds47_ws"
    inside.mkdir(parents=True)
    (plugins / "ds47" / "ds47.lua").write_text("-- by hand")
    (inside / "tree.lua").write_text("-- by hand")
    inside.chmod(0o555)
    before = contents(plugins)
    status, _, err = run(capsys, "install", "--force")
    assert status == 1
    assert str(inside) in one_line(err)
    assert contents(plugins) == before
    assert not install.leftovers(plugins / "ds47")


def test_a_folder_of_somebody_else(plugins, capsys) -> None:
    if os.getuid() != 0:
        pytest.skip("only root makes a folder of somebody else")
    plugins.parent.mkdir()
    os.seteuid(0)
    try:
        plugins.mkdir()
    finally:
        os.seteuid(NOBODY)
    line = one_line(run(capsys, "install")[2])
    user = subprocess.run(["id", "-nu", str(NOBODY)], capture_output=True, text=True, check=True)
    assert f"sudo chown -R {user.stdout.strip()} {plugins}, then" in line


def test_what_cannot_be_removed_after_all_is_told(shark, plugins, capsys, monkeypatch) -> None:
    run(capsys, "install")
    with monkeypatch.context() as patch:
        patch.setattr("shutil.rmtree", lambda *_, **__: None)
        status, _, err = run(capsys, "install", "--no-profile")
    (left,) = install.leftovers(plugins / "ds47")
    assert status == 1
    assert one_line(err).endswith(f"could not be removed. Try: delete {left}")
    told = doctor.check_copies(doctor.Patient(shark))
    assert (told.state, told.mend) == ("wrong", f"delete {left}")
    left.chmod(0o555)
    told = doctor.check_copies(doctor.Patient(shark))
    assert told.mend == f"chmod -R u+rwX {left}, then delete {left}"
    status, _, err = run(capsys, "install")  # which would remove it
    assert status == 1
    do(one_line(err))
    assert run(capsys, "install")[0] == 0
    assert doctor.check_copies(doctor.Patient(shark)).state == "ok"


def test_a_left_profile_is_told(shark, capsys, monkeypatch) -> None:
    run(capsys, "install")
    with monkeypatch.context() as patch:
        patch.setattr("shutil.rmtree", lambda *_, **__: None)
        status, _, err = run(capsys, "install")
    profile = shark.folders.profile(install.PROFILE)
    (left,) = install.leftovers(profile)
    assert status == 1
    assert str(left) in err
    told = doctor.check_profile(doctor.Patient(shark))
    assert (told.state, told.mend) == ("warning", f"delete {left}")


def test_a_profile_that_wireshark_has_written_to(shark, capsys) -> None:
    run(capsys, "install")
    profile = shark.folders.profile(install.PROFILE)
    for name in ("decode_as_entries", "io_graphs", "recent", "preferences"):
        (profile / name).write_text("# This file was created by Wireshark.\n")
    status, out, _ = run(capsys, "uninstall")
    assert status == 0
    assert "kept, because" in out
    status, out, _ = run(capsys, "uninstall", "--force")
    assert status == 0
    (line,) = (each for each in out.splitlines() if "left there" in each)
    assert "decode_as_entries" in line
    assert line.endswith(f"delete {profile} if you do not need it")
    told = doctor.check_profile(doctor.Patient(shark))
    assert told.mend == "ds47 plugin install puts it there"
    (profile / "recent").write_text("# This file was created by Wireshark.\n")
    status, out, err = run(capsys, "install")
    assert (status, err) == (0, "")
    assert "left there, not of ds47: decode_as_entries" in out
    assert doctor.check_profile(doctor.Patient(shark)).state == "ok"


def test_a_profile_that_the_plugin_added(shark, capsys) -> None:
    profile = shark.folders.profile(install.PROFILE)
    profile.mkdir(parents=True)
    files = install.profile_files(doctor.Patient(shark).sources)
    for name, content in files.items():
        (profile / name).write_bytes(content)
    told = doctor.check_profile(doctor.Patient(shark))
    assert (told.state, told.text) == ("ok", f"{profile}; added by the plugin")
    assert run(capsys, "install")[0] == 0
    assert install.read_marker(profile) is not None
    assert doctor.check_profile(doctor.Patient(shark)).text == str(profile)


def test_a_profile_of_somebody_else_is_not_replaced(shark, capsys) -> None:
    profile = shark.folders.profile(install.PROFILE)
    profile.mkdir(parents=True)
    (profile / "preferences").write_text("# mine")
    status, _, err = run(capsys, "install")
    assert status == 1
    assert one_line(err).endswith("not of ds47 plugin install (--force replaces it)")
    assert contents(profile) == {"preferences": b"# mine"}
    assert (doctor.check_profile(doctor.Patient(shark)).mend or "").endswith("--force replaces it")


def test_what_is_beside_the_plugin_does_not_keep_it_out(plugins, capsys) -> None:
    run(capsys, "install")
    (plugins / "ds47" / "mine.lua").write_text("-- mine")
    assert run(capsys, "uninstall")[0] == 0
    assert set(contents(plugins)) == {"ds47/mine.lua"}
    assert run(capsys, "install")[0] == 0
    assert {"ds47/mine.lua", "ds47/ds47.lua"} < set(contents(plugins))
