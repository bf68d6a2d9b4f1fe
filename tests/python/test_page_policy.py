"""The policy of the analyzer as one page: its scripts run in it, those of the reports it shows, and no others."""

import re
from html import unescape
from pathlib import Path

import pytest

from ds47.cli import main
from ds47.report.html import embed

SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)
ALLOWED = re.compile(r"script-src ([^;]*)")
POLICY = re.compile(r'Content-Security-Policy" content="([^"]*)"')
CAPTURE = "tour-machine.pcapng"


@pytest.fixture(scope="module")
def page(release_tools: Path) -> str:
    """The page without Python in it."""
    import make_page

    return make_page.page({})


def allowed(page: str) -> set[str]:
    """What may run as a script."""
    (policy,) = POLICY.findall(page)
    (words,) = ALLOWED.findall(unescape(policy))
    return set(words.split())


def test_its_own_scripts_run_and_nothing_that_somebody_puts_in(page: str) -> None:
    own = [embed.source_of(each) for each in SCRIPT.findall(page)]
    assert len(own) == 2
    assert set(own) < allowed(page)
    assert "'unsafe-inline'" not in allowed(page)


@pytest.mark.parametrize(
    "command",
    [
        ["report", "-f", "html", CAPTURE],
        ["report", "-f", "html", "--summary", CAPTURE],
        ["diff", "-f", "html", CAPTURE, CAPTURE],
    ],
)
def test_the_script_of_each_page_that_it_shows_runs(
    page: str, command: list[str], captures: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(captures)
    main([*command, "-o", str(tmp_path / "made.html")])
    (script,) = SCRIPT.findall((tmp_path / "made.html").read_text("utf-8"))
    assert embed.source_of(script) in allowed(page)


def test_no_kind_of_page_is_forgotten(page: str, repository: Path) -> None:
    templates = repository / "python/ds47/report/templates"
    kinds = [each for each in templates.glob("*.html.j2") if "{{ policy }}" in each.read_text()]
    assert len([each for each in allowed(page) if each.startswith("'sha256-")]) == 2 + len(kinds)


def test_a_report_is_shown_in_a_sandbox_that_keeps_it_from_the_page(page: str) -> None:
    (fence,) = re.findall(r'<iframe [^>]*sandbox="([^"]*)"', page)
    assert "allow-scripts" in fence.split()
    assert "allow-same-origin" not in fence
