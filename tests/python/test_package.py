"""What is installed is complete, and what installs it is pinned."""

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from importlib.resources import files
from pathlib import Path

import pytest

import ds47
from ds47.spec.extras import install


def test_version_is_the_one_of_the_project(repository: Path) -> None:
    project = tomllib.loads((repository / "pyproject.toml").read_text("utf-8"))["project"]
    assert metadata.version("ds47") == project["version"]
    assert ds47.__version__ == project["version"]


def test_version_is_in_the_changelog_or_unreleased(repository: Path) -> None:
    text = (repository / "CHANGELOG.md").read_text("utf-8")
    assert re.search(rf"^## \[({re.escape(ds47.__version__)}|Unreleased)\]", text, re.MULTILINE)


def test_command_is_installed() -> None:
    (entry,) = metadata.entry_points(group="console_scripts", name="ds47")
    assert entry.value == "ds47.cli:main"
    assert callable(entry.load())


def test_data_is_installed_with_the_code() -> None:
    package = files("ds47")
    tables = {item.name for item in (package / "spec").iterdir() if item.name.endswith(".toml")}
    assert {"formats.toml", "ids.toml", "errors.toml", "status.toml", "rules.toml"} <= tables
    assert (package / "schema" / "report-2.schema.json").is_file()
    assert (package / "py.typed").is_file()


def test_everything_is_pinned_with_a_hash(repository: Path) -> None:
    text = (repository / "constraints.txt").read_text("utf-8")
    assert "://" not in text
    assert "index" not in text
    requirements = re.split(r"\n(?=[a-z])", text.replace("\\\n", " "))[1:]
    assert len(requirements) > 20
    for requirement in requirements:
        assert re.match(r"[a-z0-9._-]+==\S+ ", requirement), requirement[:60]
        assert "--hash=sha256:" in requirement, requirement[:60]


def test_every_dependency_is_in_the_constraints(repository: Path) -> None:
    pinned = set(re.findall(r"^([a-z0-9-]+)==", _read(repository, "constraints.txt"), re.MULTILINE))
    project = tomllib.loads(_read(repository, "pyproject.toml"))
    wanted = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    for extra in project["project"]["optional-dependencies"].values():
        wanted += extra
    names = {re.split(r"[\[<>=; ]", line)[0].lower().replace(".", "-") for line in wanted}
    assert names - {"ds47"} <= pinned


def test_hints_install_what_the_extras_have(repository: Path) -> None:
    extras = tomllib.loads(_read(repository, "pyproject.toml"))["project"]["optional-dependencies"]
    name = re.compile(r"[a-z]+")
    for extra in ("lab", "tshark", "parquet", "cluster"):
        hint = install(extra).partition(" -m pip install ")[2]
        assert [name.match(each)[0] for each in hint.split()] == [
            name.match(each)[0] for each in extras[extra]
        ]
        assert not re.search(r"[<>'\"\[]", hint)  # nothing that a shell takes for its own


def test_what_the_command_needs_is_pinned_to_the_same_versions(repository: Path) -> None:
    pins = re.compile(r"^([a-z0-9.-]+==[^ ]+)", re.MULTILINE)
    whole = set(pins.findall(_read(repository, "constraints.txt")))
    needed = set(pins.findall(_read(repository, "constraints-run.txt")))
    assert needed < whole
    assert {"click", "jinja2", "hatchling"} <= {pin.split("==")[0] for pin in needed}


def _read(repository: Path, name: str) -> str:
    return (repository / name).read_text("utf-8")


def _wheel(repository: Path, folder: Path, compiling: str) -> subprocess.CompletedProcess[str]:
    """What builds a wheel, where no compiler is on the PATH."""
    environment = {**os.environ, "DS47_COMPILE": compiling, "PATH": os.devnull, "CC": "no-compiler"}
    command = [
        sys.executable,
        "-m",
        "hatchling",
        "build",
        "--target",
        "wheel",
        "--directory",
        folder,
    ]
    return subprocess.run(command, cwd=repository, env=environment, capture_output=True, text=True)


def test_nothing_is_compiled_unless_it_is_asked_for(repository: Path, tmp_path: Path) -> None:
    done = _wheel(repository, tmp_path, "")
    assert done.returncode == 0, done.stderr
    assert "ds47: plain Python; DS47_COMPILE=1 compiles its hot path" in done.stderr
    assert [each.name for each in tmp_path.iterdir()] == [
        f"ds47-{ds47.__version__}-py3-none-any.whl"
    ]


@pytest.mark.slow
def test_what_was_asked_for_and_cannot_be_compiled_is_said(
    repository: Path, tmp_path: Path
) -> None:
    hook = importlib.util.spec_from_file_location("hatch_build", repository / "hatch_build.py")
    assert hook is not None
    assert hook.loader is not None
    module = importlib.util.module_from_spec(hook)
    hook.loader.exec_module(module)
    sources = tmp_path / "sources"
    (sources / "capture").mkdir(parents=True)
    (sources / "capture" / "scan.py").write_text("def broken(:\n", "utf-8")
    (tmp_path / "work").mkdir()
    with pytest.raises(
        RuntimeError,
        match=r"scan does not compile: .+\. Without DS47_COMPILE=1 nothing is compiled",
    ):
        module.compiled(sources, tmp_path / "work")
    assert not list((tmp_path / "work").iterdir())


def test_classifiers_are_known_and_name_the_pythons(repository: Path) -> None:
    trove = pytest.importorskip("trove_classifiers")
    project = tomllib.loads(_read(repository, "pyproject.toml"))["project"]
    assert set(project["classifiers"]) <= trove.classifiers
    named = {
        each.rpartition(" :: ")[2] for each in project["classifiers"] if ":: Python :: 3." in each
    }
    first = project["requires-python"].removeprefix(">=")
    assert min(named, key=lambda each: int(each[2:])) == first
    assert f"3.{sys.version_info.minor}" in named
    assert "urls" not in project, "until an owner names one"


def test_the_version_is_the_same_everywhere(repository: Path) -> None:
    places = {
        "lua/ds47/spec/tables.lua": r'^M\.version = "(.+)"$',
        "man/ds47.1": r'"ds47 ([^"]+)" "ds47"$',
        "docs/how-to/write-a-parameter.md": r"Generated by ds47 (\S+)\.$",
        "docs/wireshark.md": r"dist/ds47-(\w+)\.lua",
        "captures/tour-machine.ds47.json": r'"version": "([^"]+)"',
    }
    for name, pattern in places.items():
        (found, *others) = set(re.findall(pattern, _read(repository, name), re.MULTILINE))
        assert (found.replace("_", "."), others) == (ds47.__version__, []), name
    stored = {
        re.search(r'"name": "ds47",\s*"version": "([^"]+)"', path.read_text("utf-8"))[1]  # type: ignore[index]
        for path in (repository / "captures").rglob("*.ds47.json")
    }
    assert stored == {ds47.__version__}
