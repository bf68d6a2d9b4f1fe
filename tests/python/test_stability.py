"""What 2.x promises to keep is there: the stored list against what this checkout has (docs/stability.md)."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest
from lua_program import lua_program


@pytest.fixture(scope="module")
def surface(repository: Path) -> ModuleType:
    lua_program("lua5.4")
    spec = importlib.util.spec_from_file_location("surface", repository / "tools/make_surface.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["surface"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def now(surface: ModuleType) -> set[str]:
    return surface.surface()  # type: ignore[no-any-return]


def complaint(gone: set[str]) -> str:
    lines = "\n".join(f"  {line}" for line in sorted(gone))
    return (
        f"gone:\n{lines}\nPrograms of others build on it (docs/stability.md): put it back. Until 2.0.0 is out "
        "it may go: then a line in CHANGELOG.md says what is gone, and what takes its place."
    )


def test_nothing_that_was_promised_is_gone(surface: ModuleType, now: set[str]) -> None:
    gone = surface.stored() - now
    assert not gone, complaint(gone)


def test_what_is_new_is_promised_from_now_on(surface: ModuleType, now: set[str]) -> None:
    new = sorted(now - surface.stored())
    assert not new, f"not in the list yet; make surface adds it: {new[:20]}"


@pytest.mark.parametrize(
    ("kind", "least"),
    [
        ("command ds47 report --", 60), ("rule DS", 300), ("wireshark field ds47.", 250),
        ("wireshark expert ", 80), ("json report-2 ", 250), ("json table-1 ", 20), ("python ds47.Result.", 20),
        ("python ds47.analyze(", 3), ("code states ", 8), ("pytest --ds47", 1), ("extra ", 4),
        ("environment DS47_", 3),
    ],
)  # fmt: skip
def test_every_kind_is_in_the_list(surface: ModuleType, kind: str, least: int) -> None:
    found = [line for line in surface.stored() if line.startswith(kind)]
    assert len(found) >= least


def test_a_removal_is_noticed(surface: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """An option, a rule and a name, each taken away."""
    import ds47
    from ds47 import spec
    from ds47.cli import report

    kept = [each for each in report.command.params if "--plc" not in each.opts]
    monkeypatch.setattr(report.command, "params", kept)
    rules = {name: rule for name, rule in spec.rules().items() if name != "DS410"}
    monkeypatch.setattr(spec, "rules", lambda: rules)
    monkeypatch.setattr(ds47, "__all__", [name for name in ds47.__all__ if name != "encode"])
    parts = (surface.commands(), surface.rules(), surface.names())
    kinds = ("command ", "rule ", "python ")
    before = {line for line in surface.stored() if line.startswith(kinds)}
    gone = before - {line for part in parts for line in part}
    assert {line for line in gone if not line.startswith("rule")} == {
        "command ds47 report --plc",
        "python ds47.encode",
        *(line for line in before if line.startswith("python ds47.encode(")),
    }
    assert {line.split()[1] for line in gone if line.startswith("rule")} == {"DS410"}
    assert "CHANGELOG.md says what is gone" in complaint(gone)
