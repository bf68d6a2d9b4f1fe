"""The documentation before it is a site: the navigation names every page, the reference everything that there is.

What a browser sees of the built site is in tests/browser/test_site.py.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import click
import hatch_build
import pytest
from tools.site import assemble, reference

import ds47
from ds47 import spec
from ds47.cli import COMMANDS, group

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "tools" / "site"
MKDOCS = (SITE / "mkdocs.yml").read_text("utf-8")
LINK = re.compile(r"\]\(([^)#:\s]+)(#[^)\s]*)?\)")
needs_lua = pytest.mark.skipif(
    not any(map(shutil.which, reference.fields.LUA)), reason="no Lua is installed"
)


@cache
def made(name: str) -> str:
    return reference.PAGES[f"reference/{name}.md"](ROOT)


def committed() -> dict[str, str]:
    """The pages that people write, by their place below docs/."""
    docs = ROOT / "docs"
    return {
        path.relative_to(docs).as_posix(): path.read_text("utf-8") for path in docs.rglob("*.md")
    }


def test_the_navigation_names_every_page_once() -> None:
    named = re.findall(
        r"^ +- (?:[^:\n]+: )?(\S+\.md)$", MKDOCS.partition("\nnav:\n")[2], re.MULTILINE
    )
    assert sorted(named) == sorted({*committed(), *reference.PAGES, *assemble.ALSO.values()})


def test_every_how_to_is_in_the_list_of_them() -> None:
    listed = set(LINK.findall(committed()["how-to/index.md"]))
    pages = {name.removeprefix("how-to/") for name in committed() if name.startswith("how-to/")}
    assert pages - {"index.md"} <= {name for name, _ in listed}


def test_every_command_is_there_with_each_of_its_options() -> None:
    chapters = dict(
        re.findall(r"^##+ (ds47 [^\n]+)\n(.*?)(?=^##|\Z)", made("commands"), re.M | re.S)
    )
    assert {name.split()[1] for name in chapters} == set(COMMANDS)
    for name, chapter in chapters.items():
        command: click.Command = group
        for word in name.split()[1:]:
            assert isinstance(command, click.Group)
            found = command.get_command(click.Context(command), word)
            assert found is not None
            command = found
        if isinstance(command, click.Group):
            assert all(f"{name} {word}" in chapters for word in command.commands)
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.hidden:
                assert all(option in chapter for option in parameter.opts), (name, parameter.opts)


def test_every_rule_is_there_in_both_languages() -> None:
    chapters = dict(re.findall(r"^### (DS\d+) (.*?)(?=^##|\Z)", made("rules"), re.M | re.S))
    assert list(chapters) == list(spec.rules())
    for rule in spec.rules().values():
        chapter = chapters[rule.id].replace("\\", "")
        for words in (
            rule.name,
            rule.title,
            rule.message,
            rule.advice,
            rule.title_zh,
            rule.advice_zh,
        ):
            assert " ".join(words.split()) in chapter, rule.id


def test_every_diagnosis_leads_to_its_picture() -> None:
    headings = re.findall(r"^### (DS7\d\d) (\S+) \((\w+)\)$", committed()["diagnoses.md"], re.M)
    linked = set(re.findall(r"diagnoses\.md#(\S+)\)", made("rules")))
    assert linked == {"-".join(each).lower() for each in headings}


@pytest.mark.slow
@needs_lua
def test_every_field_that_tshark_knows_is_there(tmp_path: Path) -> None:
    program = os.environ.get("DS47_TSHARK") or shutil.which("tshark")
    if program is None:
        pytest.skip("tshark is missing")
    command = [program, "-G", "fields", "-X", f"lua_script:{ROOT / 'dissector' / 'ds47.lua'}"]
    environment = {**os.environ, "HOME": str(tmp_path), "WIRESHARK_CONFIG_DIR": str(tmp_path)}
    told = subprocess.run(command, env=environment, capture_output=True, encoding="utf-8").stdout
    lines = [line.split("\t") for line in told.splitlines()]
    known = {line[2] for line in lines if line[0] == "F" and line[2].startswith("ds47.")}
    known -= {name for name in known if name.startswith("ds47.expert.")}
    if not known:
        pytest.skip("this tshark takes no script (Wireshark 4.4 and later as root)")
    shown = re.findall(r'^\| <span id="(ds47\.[\w.]+)">', made("fields"), re.MULTILINE)
    assert len(shown) == len(set(shown))
    assert known == set(shown)


@needs_lua
def test_every_field_says_what_it_is() -> None:
    without = [
        field.name
        for field in reference.fields.registered(ROOT)
        if field.name not in reference.fields.meanings(ROOT)
    ]
    assert without == []


def names_of_keys(schema: object) -> Iterator[str]:
    """The keys of every object in a schema."""
    inner = (
        schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    )
    if isinstance(schema, dict):
        yield from schema.get("properties", {})
    for each in inner:
        yield from names_of_keys(each)


def test_every_key_of_the_schemas_is_there() -> None:
    page = made("json")
    for name in reference.json_schema.CURRENT:
        keys = set(names_of_keys(reference.json_schema.load(ROOT, name)))
        assert keys
        assert {key for key in keys if f"`{key}`" not in page and f".{key}`" not in page} == set()
    for target in re.findall(r"\]\(#([\w-]+)\)", page):
        assert f"{{#{target}}}" in page or f'id="{target}"' in page, target


def test_every_error_number_and_status_is_there() -> None:
    page = made("codes")
    for errors in (spec.errors(), *(vendor.errors for vendor in spec.vendors())):
        assert all(f"| `{spec.error_hex(error.code)}`" in page for error in errors.values())
    for table in (spec.status().code, spec.status().access, spec.status().protocol):
        assert all(f"| `{number:02X}` |" in page for number in table)


def test_every_known_parameter_is_there() -> None:
    shown: set[int] = set()
    for first, last in re.findall(
        r"^\| [pr]?(\d+)(?: to [pr]?(\d+))? \|", made("known-parameters"), re.M
    ):
        shown.update(range(int(first), int(last or first) + 1))
    assert shown == set(spec.parameters())


def test_every_name_of_the_library_is_there() -> None:
    shown = re.findall(r"^      heading: ds47\.(\w+)$", made("python-names"), re.MULTILINE)
    assert sorted(shown) == sorted(name for name in ds47.__all__ if name != "__version__")


@needs_lua
def test_every_link_of_the_site_leads_to_a_page_or_a_file(tmp_path: Path) -> None:
    assemble.assemble(tmp_path)
    for page in tmp_path.rglob("*.md"):
        text = re.sub(r"```.*?```|`[^`\n]+`", "", page.read_text("utf-8"), flags=re.DOTALL)
        assert "<!--" not in text
        for target, _ in LINK.findall(text):
            assert (page.parent / target).is_file(), f"{page.relative_to(tmp_path)}: {target}"
    assert (tmp_path / "files" / "captures" / "tour-machine.pcapng").is_file()


def test_links_of_pages_from_elsewhere_are_turned_and_code_is_not() -> None:
    files: dict[str, str] = {}
    text = "[a](../captures/x.pcapng) [b](report.md#c) `[d](../e)`\n\n```\n[f](../g)\n```\n"
    turned = assemble.written("zh/x.md", text.replace("../cap", "../../cap"), files)
    assert turned == text.replace("../captures", "../files/captures")
    assert files == {"captures/x.pcapng": "files/captures/x.pcapng"}


def test_the_id_of_a_rule_leads_to_the_rule() -> None:
    text = "# DS410\n\nDS410, `DS410`, [DS410](a.md), DS4 and DS4xx; see DS101 to DS103.\n"
    linked = assemble.written("zh/x.md", text.replace("(a.md)", "(../a.md)"), {})
    assert re.findall(r"\[(DS\d+)\]\(\.\./reference/rules\.md#ds(\d+)\)", linked) == [
        ("DS410", "410"), ("DS101", "101"), ("DS103", "103"),
    ]  # fmt: skip
    assert linked.startswith("# DS410\n")
    assert "`DS410`, [DS410](../a.md), DS4 and DS4xx" in linked


def test_what_is_asked_most_is_found_first() -> None:
    assert assemble.written("how-to/x.md", "# x\n", {}) == "---\nsearch:\n  boost: 2\n---\n\n# x\n"
    for start in assemble.SOONER:
        assert any(
            name.startswith(start)
            for name in (*committed(), *assemble.ALSO.values(), *reference.PAGES)
        )


def test_a_list_gets_its_blank_line_and_a_bar_in_code_stays_one() -> None:
    text = "so:\n* a\n  b\n* c\n\n| `x \\| y` |\n\n```\nso:\n* a\n```\n"
    expected = "so:\n\n* a\n  b\n* c\n\n| `x | y` |\n\n```\nso:\n* a\n```\n"
    assert assemble.written("x.md", text, {}) == expected


def test_nothing_is_loaded_from_elsewhere() -> None:
    picture = re.compile(r"!\[[^\]]*\]\(\s*(?:https?:)?//|<(?:img|script|link|iframe)\b[^>]*//")
    for name, text in {**committed(), "mkdocs.yml": MKDOCS}.items():
        assert not picture.search(re.sub(r"```.*?```", "", text, flags=re.DOTALL)), name
    for path in [*(SITE / "assets").rglob("*"), *(SITE / "overrides").rglob("*.html")]:
        text = path.read_text("utf-8").replace("http://www.w3.org/2000/svg", "")
        assert "//" not in re.sub(r"^ *//.*$", "", text, flags=re.MULTILINE), path
    assert "font: false" in MKDOCS
    assert "polyfills: [assets/iframe-worker.js]" in MKDOCS


def test_what_builds_it_is_pinned_with_hashes() -> None:
    text = (SITE / "requirements.txt").read_text("utf-8")
    assert "://" not in text
    entries = re.split(r"\n(?=[a-z])", text.replace("\\\n", " "))[1:]
    assert len(entries) > 20
    assert all(re.match(r"[a-z0-9._-]+==\S+ .*--hash=sha256:", entry) for entry in entries)
    wanted = re.findall(
        r"^([a-z][\w-]*)", (SITE / "requirements.in").read_text("utf-8"), re.MULTILINE
    )
    assert set(wanted) <= {entry.partition("==")[0] for entry in entries}


def test_the_long_description_is_the_readme_without_what_leads_out_of_it() -> None:
    readme = (ROOT / "README.md").read_text("utf-8")
    text = hatch_build.long_description(readme)
    assert not re.search(r"!\[|\]\(|<!--", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    for pattern in (r"^#+ .*", r"^\$ .*", r"^\*\*[^*]+\*\*", r"^\| `\w+` \|"):
        assert re.findall(pattern, text, re.MULTILINE) == re.findall(pattern, readme, re.MULTILINE)
    for path in re.findall(r"[(\[](docs/[\w/.-]+)[)\]]", text):
        assert (ROOT / path).is_file()
    assert "[docs/tutorial.md]" in text
