"""Finding Wireshark's folders, and putting the plugin and the profile there and taking them away."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from fake_tshark import FakeTshark, real_tshark, stand_in

from ds47 import __version__
from ds47.cli import main
from ds47.wireshark import install, locate

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the program is a script")


@pytest.fixture
def shark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeTshark:
    fake = FakeTshark(tmp_path).save()
    monkeypatch.setenv("DS47_TSHARK", str(fake.program))
    stand_in(tmp_path, monkeypatch)
    return fake


def run(capsys, *arguments: object) -> tuple[int, str, str]:
    status = main(["plugin", *map(str, arguments)])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def tree(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


PLUGIN = {"ds47.lua", install.MARKER}
PROFILE = {"preferences", "colorfilters", "gone_in_2", install.MARKER}


# What Wireshark says of itself.


@pytest.mark.parametrize(
    ("text", "version", "lua"),
    [
        ("TShark (Wireshark) 3.4.10 (Git v3.4.10 packaged)\nwith Lua\n5.2.4,", (3, 4, 10), "5.2.4"),
        ("TShark (Wireshark) 4.4.18.\n with PCRE2, with Lua 5.4.7, with", (4, 4, 18), "5.4.7"),
        ("TShark (Wireshark) 4.6.9.\n With:\n  +Lua 5.4.9      +Zstandard 1.5.7", (4, 6, 9), "5.4.9"),
        ("Wireshark 4.2.0 (v4.2.0-0-g54eedfc63953).\n with Lua 5.2.4,", (4, 2, 0), "5.2.4"),
        ("TShark (Wireshark) 4.5.0rc0-12-g0. without Lua, with", (4, 5, 0), None),
        ("TShark (Wireshark) 4.6.0.\n Without:\n  -Lua    -zlib-ng", (4, 6, 0), None),
        ("TShark (Wireshark) 2.6.20, with Lua, with", (2, 6, 20), ""),
    ],
)  # fmt: skip
def test_version_and_lua_of_every_wording(text: str, version: tuple[int, ...], lua: str) -> None:
    assert locate.parse_version(text) == version
    assert locate.parse_lua(text) == lua


def test_no_version_is_no_wireshark() -> None:
    assert locate.parse_version("sh: wireshark: not found") is None


@pytest.mark.parametrize(
    "text",
    [
        "Personal configuration:\t/h/.config/wireshark\nPersonal Plugins:    \t/h/plugins/4.0\n"
        "Global Plugins:      \t/usr/plugins/4.0\nPersonal Lua Plugins:\t/h/plugins\n"
        "Global Lua Plugins:  \t/usr/plugins\nExtcap path:\t/usr/extcap\n",
        # Without a line for Lua the folder of binary plugins is below the one we want.
        "Personal configuration: /h/.config/wireshark\r\nPersonal Plugins: /h/plugins/2-6\r\n"
        "Global Plugins: /usr/plugins/2.6\r\nMIB/PIB path(s):\r\n",
    ],
)
def test_folders_of_every_wording(text: str) -> None:
    found = locate.parse_folders(text)
    assert found is not None
    assert found.personal_lua == Path("/h/plugins")
    assert found.global_lua == Path("/usr/plugins")
    assert found.profile("DS47") == Path("/h/.config/wireshark/profiles/DS47")


def test_folders_of_windows_keep_their_drive() -> None:
    text = (
        "Personal configuration:\tC:\\Users\\A B\\AppData\\Roaming\\Wireshark\\\n"
        "Personal Lua Plugins:\tC:\\Users\\A B\\AppData\\Roaming\\Wireshark\\plugins\n"
    )
    found = locate.parse_folders(text)
    assert found is not None
    assert str(found.personal_lua) == "C:\\Users\\A B\\AppData\\Roaming\\Wireshark\\plugins"


def test_no_folders_where_it_does_not_name_them() -> None:
    assert locate.parse_folders("tshark: option G needs something\nTemp:\t/var/tmp\n") is None


def test_usual_folders_of_windows() -> None:
    environment = {
        "ProgramFiles": "D:\\Programs",
        "ProgramFiles(x86)": "D:\\Programs (x86)",
        "LOCALAPPDATA": "D:\\A B\\Local",
        "USERPROFILE": "D:\\A B",
        "SystemDrive": "D:",
    }
    found = [each.as_posix() for each in locate.usual_folders(environment, "win32")]
    assert found[:3] == [
        "D:\\Programs/Wireshark",
        "D:\\Programs (x86)/Wireshark",
        "D:\\A B\\Local/Programs/Wireshark",
    ]
    assert "D:\\Program Files/Wireshark" in found


def test_usual_folders_of_macos() -> None:
    found = [each.as_posix() for each in locate.usual_folders({"HOME": "/Users/a b"}, "darwin")]
    assert found[0] == "/Applications/Wireshark.app/Contents/MacOS"
    assert "/Users/a b/Applications/Wireshark.app/Contents/MacOS" in found


def test_a_windows_program_is_found_without_path(tmp_path: Path) -> None:
    program = tmp_path / "Program Files" / "Wireshark" / "tshark.exe"
    program.parent.mkdir(parents=True)
    program.touch()
    environment = {"ProgramFiles": str(tmp_path / "Program Files"), "PATH": ""}
    assert list(locate.candidates(environment, "win32")) == [program]


def test_the_next_program_is_asked_when_one_does_not_answer(tmp_path, monkeypatch) -> None:
    fake = FakeTshark(tmp_path).save()
    broken = tmp_path / "tshark"
    broken.write_text("#!/bin/sh\necho no library >&2\nexit 127\n")
    broken.chmod(0o755)
    monkeypatch.setattr(locate, "candidates", lambda: iter([broken, fake.program]))
    assert locate.find().program == fake.program
    monkeypatch.setattr(locate, "candidates", lambda: iter([broken]))
    with pytest.raises(locate.NoWiresharkError, match="no library"):
        locate.find()


def test_the_tshark_that_is_here(tmp_path: Path, monkeypatch) -> None:
    program = real_tshark()
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("XDG_CONFIG_HOME", "WIRESHARK_CONFIG_DIR"):
        monkeypatch.delenv(name, raising=False)
    found = locate.find(program)
    assert found.version >= (3, 4)
    assert found.lua
    assert tmp_path in found.folders.personal_lua.parents
    assert tmp_path in found.folders.personal_configuration.parents


# Installing.


def test_install_writes_plugin_and_profile_and_says_where(shark, capsys) -> None:
    status, out, err = run(capsys, "install")
    assert (status, err) == (0, "")
    assert tree(shark.plugins) == {f"ds47/{name}" for name in PLUGIN}
    assert tree(shark.settings) == {f"profiles/DS47/{name}" for name in PROFILE}
    assert str(shark.plugins / "ds47") in out
    assert "start Wireshark again" in out
    assert len(out.splitlines()) <= 6
    content = json.loads((shark.plugins / "ds47" / install.MARKER).read_text("utf-8"))
    assert content["version"] == __version__
    assert set(content["files"]) == PLUGIN - {install.MARKER}


def test_the_folders_are_named(shark, capsys) -> None:
    assert main(["plugin", "path"]) == 0
    said = dict(line.split(":", 1) for line in capsys.readouterr().out.splitlines())
    told = {name: text.strip() for name, text in said.items()}
    assert told["tshark"] == str(shark.program)
    assert told["plugin"] == str(shark.plugins / "ds47")
    assert told["profile"] == str(shark.settings / "profiles" / "DS47")
    assert (Path(told["comes from"]) / "ds47.lua").is_file()


def test_no_profile(shark, capsys) -> None:
    status, out, _ = run(capsys, "install", "--no-profile")
    assert status == 0
    assert not shark.settings.exists()
    assert "profile DS47" not in out


def test_another_folder_needs_no_wireshark(shark, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("DS47_TSHARK")
    monkeypatch.setattr(locate, "candidates", lambda: iter([]))
    target = tmp_path / "of all users"
    status, _, err = run(capsys, "install", "--folder", target)
    assert status == 0
    assert "profile was not installed" in err
    assert tree(target / "ds47") == PLUGIN
    status, _, err = run(capsys, "install")
    assert status == 3
    assert "no tshark found" in err


def test_a_tshark_that_is_none_is_told(shark, capsys) -> None:
    status, _, err = run(capsys, "install", "--tshark", "no-such-program")
    assert status == 3
    assert "no-such-program" in err


def test_install_again_replaces_the_older_one(shark, capsys, tmp_path, monkeypatch) -> None:
    run(capsys, "install")
    plugin = shark.plugins / "ds47"
    (plugin / "mine.lua").write_text("-- mine")
    stand_in(tmp_path, monkeypatch, version=2)
    monkeypatch.setattr(install, "__version__", "9.9")
    status, out, _ = run(capsys, "install")
    assert status == 0
    assert f"{__version__} replaced" in out
    assert "mine.lua" in out
    assert tree(plugin) == PLUGIN | {"mine.lua"}
    assert "-- entry 2\n" in (plugin / "ds47.lua").read_text()
    assert tree(shark.settings / "profiles" / "DS47") == PROFILE - {"gone_in_2"}
    assert [path.name for path in shark.plugins.iterdir()] == ["ds47"]


@pytest.mark.parametrize("command", ["install", "uninstall"])
def test_what_others_made_is_not_touched(shark, capsys, command) -> None:
    by_hand = shark.plugins / "ds47"
    by_hand.mkdir(parents=True)
    (by_hand / "ds47.lua").write_text("-- by hand")
    own_profile = shark.settings / "profiles" / "DS47"
    own_profile.mkdir(parents=True)
    (own_profile / "preferences").write_text("# own")
    status, _, err = run(capsys, command)
    assert status == (1 if command == "install" else 0)
    assert tree(by_hand) == {"ds47.lua"}
    assert tree(own_profile) == {"preferences"}
    if command == "install":
        assert "--force" in err
        assert run(capsys, "install", "--force")[0] == 0
        assert "-- entry 1\n" in (by_hand / "ds47.lua").read_text()
        assert tree(own_profile) == PROFILE


def test_a_changed_plugin_file_is_not_lost(shark, capsys) -> None:
    run(capsys, "install")
    entry = shark.plugins / "ds47" / "ds47.lua"
    entry.write_text("-- changed")
    status, _, err = run(capsys, "install")
    assert status == 1
    assert "ds47.lua" in err
    assert entry.read_text() == "-- changed"
    assert run(capsys, "install", "--force")[0] == 0
    assert "-- entry 1\n" in entry.read_text()


def test_a_changed_profile_file_stays_and_the_rest_is_new(shark, capsys, tmp_path, monkeypatch):
    run(capsys, "install")
    profile = shark.settings / "profiles" / "DS47"
    (profile / "colorfilters").write_text("# my colours")
    (profile / "recent").write_text("# written by Wireshark")
    stand_in(tmp_path, monkeypatch, version=2)
    for _ in range(2):  # the second time it is still known to be changed
        status, out, _ = run(capsys, "install")
        assert status == 0
        assert "kept, because you changed them: colorfilters" in out
        assert (profile / "colorfilters").read_text() == "# my colours"
        assert (profile / "preferences").read_text() == "# preferences 2\n"
        assert (profile / "recent").exists()


MINE = "# ds47_s7 in a comment\n@m@ds47@[0,0,0]\nds47.s7: none\n"
GONE = (
    "@S7@ds47_s7 || s7comm@[0,0,0][1,1,1]",
    "!@x@ds47.s7.time@[0,0,0]",
    '"TRUE","S7","ds47_s7","x"',
    "ds47.s7_cpus: x",
)


def test_rows_of_what_the_plugin_no_longer_has_become_comments(shark, capsys) -> None:
    run(capsys, "install")
    profile = shark.settings / "profiles" / "DS47"
    older = MINE + "".join(f"{row}\n" for row in GONE)
    for name in ("colorfilters", "mine"):  # which is nobody's but the user's
        (profile / name).write_text(older)
    for _ in range(2):
        assert run(capsys, "install")[0] == 0
        mended = MINE + "".join(f"# {row}\n" for row in GONE)
        assert (profile / "colorfilters").read_text() == mended
    assert (profile / "mine").read_text() == older


def test_a_link_to_a_checkout_is_left_alone(shark, capsys, tmp_path) -> None:
    checkout = tmp_path / "checkout"
    checkout.mkdir()
    shark.plugins.mkdir(parents=True)
    (shark.plugins / "ds47").symlink_to(checkout)
    status, _, err = run(capsys, "install", "--force")
    assert status == 1
    assert "is a link" in err
    assert tree(checkout) == set()


def test_a_failed_install_leaves_the_old_one(shark, capsys, monkeypatch) -> None:
    run(capsys, "install")
    before = tree(shark.plugins)
    rename = Path.rename

    def fail(self: Path, target: Path) -> Path:
        if self.name.startswith(".ds47-new"):
            raise PermissionError(13, "in use", str(self))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail)
    status, _, err = run(capsys, "install")
    assert status == 1
    assert "in use" in err
    assert len(err.splitlines()) == 1
    assert tree(shark.plugins) == before


def test_leftovers_of_a_broken_install_go(shark, capsys) -> None:
    run(capsys, "install")
    (shark.plugins / "ds47").rename(shark.plugins / ".ds47-new-ds47-1")
    run(capsys, "install")
    assert [path.name for path in shark.plugins.iterdir()] == ["ds47"]


class PowerOff(BaseException):
    """Nothing runs after it."""


@pytest.mark.parametrize("then", ["install", "uninstall"])
def test_an_install_that_was_cut_off_loses_nothing_of_the_user(
    shark, capsys, monkeypatch, then
) -> None:
    """Between its two renames the old profile has another name, and there is no new one."""
    run(capsys, "install")
    profile = shark.settings / "profiles" / "DS47"
    (profile / "colorfilters").write_text("# my colours")
    rename = Path.rename

    def stop(self: Path, target: Path) -> Path:
        if self.name.startswith(".ds47-new-DS47"):
            raise PowerOff
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", stop)
        patch.setattr("shutil.rmtree", lambda *_, **__: None)
        with pytest.raises(PowerOff):
            run(capsys, "install")
    assert not profile.exists()
    status, out, _ = run(capsys, then)
    assert status == 0
    assert "colorfilters" in out
    assert (profile / "colorfilters").read_text() == "# my colours"
    assert tree(profile) == PROFILE
    if then == "install":
        assert [path.name for path in profile.parent.iterdir()] == ["DS47"]


def test_a_second_copy_is_told(shark, capsys) -> None:
    shark.plugins.mkdir(parents=True)
    (shark.plugins / "ds47-0.0.1 (1).lua").write_text("-- bundle")
    status, _, err = run(capsys, "install")
    assert status == 1
    assert "ds47-0.0.1 (1).lua" in err


# Removing.


def test_uninstall_removes_exactly_what_was_written(shark, capsys) -> None:
    shark.plugins.mkdir(parents=True)
    (shark.plugins / "other.lua").write_text("-- other")
    run(capsys, "install")
    (shark.settings / "profiles" / "DS47" / "recent").write_text("# written by Wireshark")
    (shark.plugins / "ds47" / "mine.lua").write_text("-- mine")
    status, out, _ = run(capsys, "uninstall")
    assert status == 0
    assert "mine.lua" in out
    assert tree(shark.plugins) == {"other.lua", "ds47/mine.lua"}
    assert tree(shark.settings) == set()
    assert not (shark.settings / "profiles" / "DS47").exists()
    assert "nothing there" in run(capsys, "uninstall")[1]


@pytest.mark.parametrize("change", ["preferences", "dfilter_buttons"])
def test_uninstall_keeps_a_changed_profile(shark, capsys, change) -> None:
    run(capsys, "install")
    profile = shark.settings / "profiles" / "DS47"
    (profile / change).write_text("# mine")
    status, out, _ = run(capsys, "uninstall")
    assert status == 0
    assert "kept" in out
    assert "--force" in out
    assert change in out
    assert tree(profile) == PROFILE | {change}
    assert not (shark.plugins / "ds47").exists()
    run(capsys, "uninstall", "--force")
    assert tree(shark.settings) == {"profiles/DS47/dfilter_buttons"} - (
        {"profiles/DS47/dfilter_buttons"} if change == "preferences" else set()
    )


def test_a_forged_list_reaches_nothing_outside(shark, capsys, tmp_path) -> None:
    run(capsys, "install", "--no-profile")
    (tmp_path / "victim").write_text("precious")
    marker = shark.plugins / "ds47" / install.MARKER
    content = json.loads(marker.read_text("utf-8"))
    content["files"]["../../../../victim"] = "00"
    marker.write_text(json.dumps(content))
    run(capsys, "uninstall")
    assert (tmp_path / "victim").read_text() == "precious"


def test_path_names_the_folders(shark, capsys) -> None:
    status, out, _ = run(capsys, "path")
    assert status == 0
    for each in (shark.program, shark.plugins / "ds47", shark.settings / "profiles" / "DS47"):
        assert str(each) in out


def test_wrong_use(shark, capsys) -> None:
    assert run(capsys, "install", "--no-such-option")[0] == 2
    assert run(capsys, "no-such-command")[0] == 2
