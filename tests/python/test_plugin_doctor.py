"""The doctor: each thing that can be wrong, in a Wireshark that has it, and the real one."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from fake_tshark import ABOUT, FIELDS, FakeTshark, real_tshark, stand_in

from ds47.cli import main
from ds47.wireshark import doctor, install, locate

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the program is a script")
OTHER_FIELDS = "P\tEthernet\teth\nF\tSource\teth.src\tFT_ETHER\teth\t\t0x0\t\n"
GONE = (OTHER_FIELDS, "")


@pytest.fixture
def shark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> FakeTshark:
    """A Wireshark with the stand-in installed, where nothing is wrong."""
    fake = FakeTshark(tmp_path).save()
    monkeypatch.setenv("DS47_TSHARK", str(fake.program))
    monkeypatch.setenv("HOME", str(tmp_path / "a home"))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    stand_in(tmp_path, monkeypatch)
    assert main(["plugin", "install"]) == 0
    capsys.readouterr()
    return fake


def examine(shark: FakeTshark) -> dict[str, doctor.Check]:
    shark.save()
    return {check.name: check for check in doctor.examine(str(shark.program))[1]}


def wrong(shark: FakeTshark) -> set[str]:
    return {name for name, check in examine(shark).items() if check.state == "wrong"}


def test_all_well(shark, capsys) -> None:
    checks = examine(shark)
    assert {check.state for check in checks.values()} == {"ok"}
    assert list(checks) == [name for name, _ in doctor.CHECKS]
    assert main(["plugin", "doctor"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(doctor.CHECKS)


def test_what_is_wrong_always_has_a_mend(shark, tmp_path) -> None:
    install.uninstall(shark.plugins / "ds47", keep_changed=False)
    shark.version, shark.lua, shark.fields = "3.2.1", "without Lua", GONE
    checks = examine(shark)
    told = {name for name, check in checks.items() if check.state == "wrong"}
    assert told == {"version", "lua", "installed", "fields"}
    assert all(check.mend for check in checks.values() if check.state in ("wrong", "warning"))


def test_no_wireshark(monkeypatch, capsys) -> None:
    monkeypatch.delenv("DS47_TSHARK", raising=False)
    monkeypatch.setattr(locate, "candidates", lambda: iter([]))
    assert main(["plugin", "doctor", "-f", "json"]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is False
    assert told["wireshark"] is None
    assert "DS47_TSHARK" in told["checks"][0]["mend"]


def test_json(shark, capsys) -> None:
    assert main(["plugin", "doctor", "-f", "json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["ok"] is True
    assert told["wireshark"] == {"program": str(shark.program), "version": "4.2.5"}
    assert set(told["checks"][0]) == {"name", "state", "text", "mend"}


def test_exit_status_and_text_when_something_is_wrong(shark, capsys) -> None:
    shark.version = "2.6.20"
    shark.save()
    assert main(["plugin", "doctor"]) == 1
    out = capsys.readouterr().out
    assert "WRONG  version" in out
    assert "-> install Wireshark 3.4 or later" in out


@pytest.mark.parametrize(("version", "told"), [("3.2.18", {"version"}), ("3.4.0", set())])
def test_too_old(shark, version, told) -> None:
    shark.version = version
    assert wrong(shark) == told


def test_what_an_init_lua_prints_is_no_version(shark) -> None:
    about = "Loaded: Wireshark 2.0 helpers\n" + ABOUT.format(version="4.6.9", lua="+Lua 5.4.9")
    assert locate.parse_version(about) == (4, 6, 9)
    assert locate.parse_version("Wireshark 4.6.9.\n") == (4, 6, 9)
    assert locate.parse_version("TShark 1.12.1 (Git Rev Unknown)\n") is None


def test_without_lua(shark) -> None:
    shark.lua, shark.fields = "without Lua", GONE
    assert wrong(shark) == {"lua", "fields"}


@pytest.mark.slow
@pytest.mark.parametrize("line", ["enable_lua = false", "  disable_lua=true"])
@pytest.mark.parametrize("place", ["a home/config", "usr/share", "a home/lib/plugins"])
def test_switched_off(shark, tmp_path, line, place) -> None:
    (tmp_path / place).mkdir(parents=True, exist_ok=True)
    (tmp_path / place / "init.lua").write_text(f"-- enable_lua = false\n{line}\n")
    assert wrong(shark) == set()  # this version does not heed it: the plugin is there
    shark.fields = GONE
    checks = examine(shark)
    assert checks["switched on"].state == "wrong"
    assert str(tmp_path / place / "init.lua") in (checks["switched on"].mend or "")
    (tmp_path / place / "init.lua").write_text("-- enable_lua = false\nenable_lua = true\n")
    assert wrong(shark) == {"fields"}


def test_not_installed(shark) -> None:
    install.uninstall(shark.plugins / "ds47", keep_changed=False)
    shark.fields = GONE
    checks = examine(shark)
    assert checks["installed"].state == "wrong"
    assert checks["installed"].mend == "ds47 plugin install"
    assert checks["current"].state == "skipped"


@pytest.mark.parametrize("place", ["a home/config", "a home/.wireshark/plugins", "program files"])
def test_in_the_wrong_folder(shark, tmp_path, place) -> None:
    install.uninstall(shark.plugins / "ds47", keep_changed=False)
    shark.fields = GONE
    stray = tmp_path / place / "ds47-0.1.0.lua"
    stray.parent.mkdir(parents=True, exist_ok=True)
    stray.write_text("-- bundle")
    check = examine(shark)["installed"]
    assert check.state == "wrong"
    assert str(stray) in check.text


def test_by_hand_is_installed_too(shark) -> None:
    install.uninstall(shark.plugins / "ds47", keep_changed=False)
    (shark.plugins / "ds47-0_1_0.lua").write_text("-- bundle")
    checks = examine(shark)
    assert checks["installed"].state == "ok"
    assert wrong(shark) == set()


@pytest.mark.parametrize(("version", "state"), [("4.2.5", "ok"), ("4.4.0", "wrong")])
def test_a_dot_in_the_name(shark, version, state) -> None:
    install.uninstall(shark.plugins / "ds47", keep_changed=False)
    (shark.plugins / "ds47-0.1.0.lua").write_text("-- bundle")
    shark.version = version
    check = examine(shark)["installed"]
    assert check.state == state
    assert (check.mend == "rename it to ds47.lua") == (state == "wrong")


@pytest.mark.parametrize(
    "place", ["usr/plugins", "a home/config/plugins/sub", "a home/lib/plugins"]
)
def test_two_copies(shark, tmp_path, place) -> None:
    second = tmp_path / place / "ds47-0.1.0 (1).lua"
    second.parent.mkdir(parents=True, exist_ok=True)
    second.write_text("-- bundle")
    check = examine(shark)["one copy"]
    assert check.state == "wrong"
    assert check.mend == f"delete {second}"


def test_two_installed_copies(shark, capsys) -> None:
    assert main(["plugin", "install", "--folder", str(shark.all_users)]) == 0
    check = examine(shark)["one copy"]
    assert check.state == "wrong"
    assert check.mend == f"keep {shark.plugins / 'ds47'} and delete {shark.all_users / 'ds47'}"


def test_another_version(shark, monkeypatch) -> None:
    monkeypatch.setattr(doctor, "__version__", "9.9")
    assert wrong(shark) == {"current"}


def test_same_version_other_files(shark, tmp_path, monkeypatch) -> None:
    stand_in(tmp_path, monkeypatch, version=2)
    checks = examine(shark)
    assert checks["current"].state == "wrong"
    assert "ds47.lua" in checks["current"].text
    assert checks["profile"].state == "warning"


@pytest.mark.parametrize("gone", [True, False])
def test_a_file_changed_or_gone(shark, gone) -> None:
    path = shark.plugins / "ds47" / "ds47.lua"
    path.unlink() if gone else path.write_text("-- changed")
    check = examine(shark)["current"]
    assert check.state == "wrong"
    assert "ds47.lua" in check.text


def test_a_file_beside(shark) -> None:
    (shark.plugins / "ds47" / "mine.lua").write_text("-- mine")
    check = examine(shark)["current"]
    assert (check.state, "mine.lua" in check.text) == ("warning", True)


@pytest.mark.parametrize(
    ("version", "loaded", "state"),
    [("4.4.0", False, "wrong"), ("4.4.0", True, "ok"), ("4.2.9", False, "ok")],
)
def test_root(shark, monkeypatch, version, loaded, state) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    shark.version, shark.fields = version, (FIELDS, "") if loaded else GONE
    check = examine(shark)["not root"]
    assert check.state == state
    if state == "wrong":
        assert str(shark.all_users / "init.lua") in (check.mend or "")


@pytest.mark.parametrize(
    "text",
    [
        "tshark: Lua: Error during loading:\n/h/plugins/ds47/ds47.lua:1: boo\nstack traceback:\n",
        "tshark: Lua: syntax error: /h/plugins/ds47/ds47.lua:1: syntax error near 'x'\n",
    ],
)
def test_errors_at_the_start(shark, text) -> None:
    shark.fields = (FIELDS, text)
    check = examine(shark)["no Lua error"]
    assert check.state == "wrong"
    assert ".lua:1:" in check.text


def test_an_error_of_another_script(shark) -> None:
    shark.fields = (FIELDS, "tshark: Lua: Error during loading:\n/h/plugins/other.lua:1: boo\n")
    check = examine(shark)["no Lua error"]
    assert check.state == "warning"
    assert "other.lua:1: boo" in check.text


def test_an_error_while_dissecting(shark) -> None:
    shark.trial = ('<field showname="Lua Error: /h/plugins/ds47/ds47.lua:9: nil"/>\n', "")
    assert wrong(shark) == {"no Lua error", "trial"}


def test_the_protocol_is_disabled(shark) -> None:
    (shark.settings / "disabled_protos").write_text("# Do not edit\nh1\nds47\n")
    shark.trial = ("<packet/>", "")
    check = examine(shark)["trial"]
    assert check.state == "wrong"
    assert "Enabled Protocols" in (check.mend or "")


def test_profile(shark, capsys) -> None:
    profile = shark.settings / "profiles" / "DS47"
    (profile / "colorfilters").write_text("# mine")
    assert examine(shark)["profile"].state == "ok"
    assert "colorfilters" in examine(shark)["profile"].text
    (profile / "colorfilters").write_text("@S7@ds47_s7@[0,0,0][1,1,1]\n")
    check = examine(shark)["profile"]
    assert (check.state, check.mend) == ("warning", "ds47 plugin install")
    assert "no longer has: colorfilters" in check.text
    main(["plugin", "uninstall", "--force"])
    main(["plugin", "install", "--no-profile"])
    capsys.readouterr()
    checks = examine(shark)
    assert checks["profile"].state == "warning"
    assert wrong(shark) == set()


def test_a_program_that_stops_answering(shark) -> None:
    found = locate.find(str(shark.program))
    shark.program.unlink()
    checks = {check.name: check for check in doctor.examined(doctor.Patient(found))}
    assert checks["fields"].state == "wrong"
    assert str(shark.program) in checks["fields"].text


@pytest.fixture
def real(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, repository: Path) -> str:
    """The real tshark with an empty home whose name has a blank."""
    program = real_tshark()
    home = tmp_path / "a home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    for name in ("XDG_CONFIG_HOME", "WIRESHARK_CONFIG_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DS47_TSHARK", program)
    return program


@pytest.mark.slow
def test_installed_into_the_real_one(real, capsys) -> None:
    assert main(["plugin", "install"]) == 0
    status = main(["plugin", "doctor"])
    out = capsys.readouterr().out
    assert status == 0, out
    assert main(["plugin", "uninstall"]) == 0
    assert main(["plugin", "doctor"]) == 1
    out = capsys.readouterr().out
    assert "-> ds47 plugin install" in out


@pytest.mark.slow
def test_two_copies_in_the_real_one_are_told_and_do_no_harm(real, capsys, tmp_path) -> None:
    assert main(["plugin", "install"]) == 0
    found = locate.find(real)
    second = found.folders.personal_lua / "other"
    assert main(["plugin", "install", "--no-profile", "--folder", str(second)]) == 0
    capsys.readouterr()
    assert main(["plugin", "doctor", "-f", "json"]) == 1
    checks = {check["name"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    assert {name for name, check in checks.items() if check["state"] == "wrong"} == {"one copy"}


@pytest.mark.slow
def test_a_broken_script_in_the_real_one_is_told(real, capsys) -> None:
    assert main(["plugin", "install"]) == 0
    plugins = locate.find(real).folders.personal_lua
    (plugins / "ds47" / "ds47.lua").write_text("error('boo')")
    (plugins / "other.lua").write_text("this is not Lua")
    capsys.readouterr()
    assert main(["plugin", "doctor", "-f", "json"]) == 1
    checks = {check["name"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    assert checks["no Lua error"]["state"] == "wrong"
    assert "boo" in checks["no Lua error"]["text"]
