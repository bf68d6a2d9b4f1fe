"""The plugin as one file and the plugin in the wheel: the same plugin as in the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fake_tshark import real_tshark

from ds47 import __version__
from ds47.wireshark.bundle import FILE_NAME, plugin_sources
from ds47.wireshark.bundle import bundle as joined

CAPTURE = "format-mixed.pcapng"
LUAS = ("lua5.2", "lua5.3", "lua5.4")


@pytest.fixture(scope="module")
def bundle(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a bundle")
    tool = repository / "tools" / "make_bundle.py"
    subprocess.run([sys.executable, tool, folder], check=True, capture_output=True)
    (path,) = folder.iterdir()
    return path


@pytest.mark.parametrize(
    "name",
    ["Makefile", "docs/wireshark.md", "docs/developers/development.md", "tools/make_bundle.py"],
)
def test_the_file_has_the_name_that_the_documents_say(
    bundle: Path, repository: Path, name: str
) -> None:
    assert bundle.name == FILE_NAME
    assert f"dist/{FILE_NAME}" in (repository / name).read_text("utf-8")


@pytest.fixture
def pdml(tmp_path: Path):
    """A function that dissects a capture in an empty home and returns (PDML, stderr)."""
    program = real_tshark()

    def run(capture: Path, *arguments: str, home: str = "empty home") -> tuple[str, str]:
        folder = tmp_path / home
        folder.mkdir(exist_ok=True)
        environment = {"PATH": os.environ["PATH"], "HOME": str(folder), "LC_ALL": "C.UTF-8"}
        result = subprocess.run(
            [program, "-n", *arguments, "-r", capture, "-2", "-R", "frame", "-T", "pdml"],
            env=environment,
            capture_output=True,
            encoding="utf-8",
            timeout=120,
            check=True,
        )
        for text in (result.stdout, result.stderr):
            assert "Lua Error" not in text
            assert "Error during loading" not in text
        return result.stdout, result.stderr

    return run


def ours(pdml: str) -> list[str]:
    return [line for line in pdml.splitlines() if 'name="ds47' in line]


def test_every_file_is_taken(repository: Path) -> None:
    sources = plugin_sources()
    there = {path for name in ("dissector", "lua") for path in (repository / name).rglob("*.lua")}
    assert set(sources.modules.values()) == there
    assert {"preferences", "colorfilters", "dfilter_buttons"} <= set(sources.profile)
    assert sources.trial.is_file()


def test_the_bundle_names_version_and_licence(bundle: Path, repository: Path) -> None:
    assert bundle.name == f"ds47-{__version__.replace('.', '_')}.lua"
    text = bundle.read_text("utf-8")
    assert text.startswith(f"-- ds47 {__version__}: ")
    for line in (repository / "LICENSE").read_text("utf-8").splitlines():
        assert f"-- {line}".rstrip() in text


def test_the_same_sources_give_the_same_bytes(bundle: Path) -> None:
    assert joined(plugin_sources()).encode() == bundle.read_bytes()
    assert b"\r" not in bundle.read_bytes()


@pytest.mark.parametrize("lua", LUAS)
def test_the_bundle_loads_under_every_lua(bundle: Path, lua: str) -> None:
    """It parses, and gives every module without Wireshark; only the entry needs Wireshark."""
    if shutil.which(lua) is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"{lua} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"{lua} is missing")
    names = [name.removesuffix(".lua").replace("/", ".") for name in plugin_sources().modules]
    pure = [name for name in names if name.startswith("ds47.")]
    script = (
        "package.path = ''\npackage.cpath = ''\n"
        "local chunk = assert(loadfile(arg[1]))\npcall(chunk)\n"
        "for i = 2, #arg do assert(type(require(arg[i])) == 'table', arg[i]) end\n"
        "io.write(require('ds47.spec.tables').version)"
    )
    driver = bundle.parent.parent / "driver.lua"
    driver.write_text(script)
    result = subprocess.run([lua, driver, bundle, *pure], capture_output=True, encoding="utf-8")
    assert result.returncode == 0, result.stderr
    assert result.stdout == __version__


def test_the_bundle_has_the_profile(bundle: Path) -> None:
    sources = plugin_sources()
    script = (
        "pcall(assert(loadfile(arg[1])))\n"
        "for name, text in pairs(require('ds47_ws.profile_files')) do io.write(name, '\\0', text, '\\0') end"
    )
    driver = bundle.parent.parent / "profile.lua"
    driver.write_text(script)
    command = ["lua5.4", str(driver), str(bundle)]
    done = subprocess.run(command, capture_output=True, encoding="utf-8", check=True)
    parts = done.stdout.split("\0")
    assert dict(zip(parts[0:-1:2], parts[1:-1:2], strict=True)) == {
        name: path.read_text("utf-8") for name, path in sources.profile.items()
    }


def test_the_bundle_shows_what_the_checkout_shows(bundle, pdml, repository, captures) -> None:
    entry = repository / "dissector" / "ds47.lua"
    checkout, _ = pdml(captures / CAPTURE, "-X", f"lua_script:{entry}")
    alone, _ = pdml(captures / CAPTURE, "-X", f"lua_script:{bundle}")
    assert len(ours(checkout)) > 20
    assert ours(alone) == ours(checkout)


def test_the_bundle_alone_in_the_plugins_folder(bundle, pdml, repository, captures, tmp_path):
    entry = repository / "dissector" / "ds47.lua"
    checkout, _ = pdml(captures / CAPTURE, "-X", f"lua_script:{entry}")
    plugins = tmp_path / "with it" / ".local" / "lib" / "wireshark" / "plugins"
    plugins.mkdir(parents=True)
    shutil.copy(bundle, plugins)
    installed, errors = pdml(captures / CAPTURE, home="with it")
    assert "ds47" not in errors
    assert ours(installed) == ours(checkout)


def test_two_copies_are_told_in_one_line(bundle, pdml, captures, tmp_path):
    """A newer file beside an older one: that one is loaded first, and goes on working."""
    plugins = tmp_path / "two" / ".local" / "lib" / "wireshark" / "plugins"
    plugins.mkdir(parents=True)
    older, newer = plugins / "ds47-0_9_0.lua", plugins / bundle.name
    shutil.copy(bundle, older)
    shutil.copy(bundle, newer)
    shown, errors = pdml(captures / CAPTURE, home="two")
    assert len(ours(shown)) > 20
    lines = [line for line in errors.splitlines() if "two copies" in line]
    assert len(lines) == 1
    assert lines[0].count(str(older)) == lines[0].count(str(newer)) == 1
    older.unlink()
    assert "two copies" not in pdml(captures / CAPTURE, home="two")[1]
    shown, errors = pdml(captures / CAPTURE, "-X", f"lua_script:{bundle}", home="two")
    assert "two copies" not in errors


@pytest.mark.slow
def test_the_wheel_installs_the_plugin(bundle: Path, repository: Path, tmp_path: Path) -> None:
    """Built and unpacked as pip would, the command finds the plugin without the checkout."""
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path / "dist"]
    subprocess.run(build, cwd=repository, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    target = tmp_path / "some folder"
    code = "import sys; from ds47.cli import main; sys.exit(main(sys.argv[1:]))"
    arguments = ["plugin", "install", "--no-profile", "--folder", target]
    environment = os.environ | {"PYTHONPATH": str(tmp_path / "site"), "DS47_TSHARK": ""}
    environment |= {"HOME": str(tmp_path)}
    subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=environment,
        cwd=tmp_path,
        check=True,
        capture_output=True,
    )
    (installed,) = target.rglob("*.lua")
    assert installed.read_bytes() == bundle.read_bytes()
    assert (tmp_path / "site" / "ds47" / "wireshark" / "plugin" / "trial.pcapng").is_file()
