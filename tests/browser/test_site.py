"""The built documentation (`make site`): whole, opened from a folder, with nothing asked of anybody."""

import json
import os
import re
import subprocess
import sys
import zipfile
from collections import Counter
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path

import pytest
from tools.site.pack import pack

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
BUILT = ROOT / "build" / "site"
LOADS = {
    "link": "href",
    "script": "src",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "video": "src",
}
"""What a browser loads by itself: elements with the attribute that says from where."""
FOUND = (
    "return [...document.querySelectorAll('.md-search-result__item')].map((each) => each.innerText)"
)

# In the environment that builds the site: as CommonMark and the tables of GitHub count a page.
COUNT = r"""
import collections, json, re, sys, comrak
tables = comrak.ExtensionOptions()
tables.table = True
raw = comrak.RenderOptions()
raw.unsafe_ = True
found = {}
for path in json.load(sys.stdin):
    text = re.sub(r"^---\n.*?\n---\n", "", open(path, encoding="utf-8").read(), flags=re.DOTALL)
    found[path] = comrak.render_markdown(text, extension_options=tables, render_options=raw)
json.dump(found, sys.stdout)
"""
RENDER = """
import sys
from readme_renderer import markdown
html = markdown.render(sys.stdin.read())
assert html
sys.stdout.write(html)
"""
ELEMENTS = re.compile(r"<(li|tr|td|th|pre|h[1-4]|img)\b")


@pytest.fixture(scope="module")
def site():
    """The folder of the built site."""
    if not (BUILT / "html" / "index.html").is_file():
        missing("the built site (make site)")
    return BUILT / "html"


def missing(what):
    if os.environ.get("DS47_CI") == "1":
        pytest.fail(f"{what} is missing, and DS47_CI=1 says that it must be there", pytrace=False)
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="module")
def pages(site):
    """Every page of it, but that which a server shows for one that is not there."""
    found = sorted(path for path in site.rglob("*.html") if path.name != "404.html")
    assert len(found) > 50
    return found


class Loads(HTMLParser):
    """What a page loads."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        if told.get("rel") not in ("prev", "next", "canonical", "alternate"):
            self.found.append(told.get(LOADS.get(tag, "")))


def test_no_page_has_an_asset_from_elsewhere(site, pages):
    for page in pages:
        loads = Loads()
        loads.feed(page.read_text("utf-8"))
        for target in filter(None, loads.found):
            assert not re.match(r"[a-z]+:|//", target), f"{page.name}: {target}"
            assert (page.parent / target.split("?")[0]).is_file(), f"{page.name}: {target}"
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(?:url\(|@import )[\"']?(?:https?:)?//", sheet.read_text("utf-8"))


def test_a_page_says_what_it_says_to_other_readers_of_markdown(site):
    """Lists, tables and code are those of CommonMark: nothing is swallowed, nothing becomes text."""
    names = [
        path.relative_to(BUILT / "pages")
        for path in sorted((BUILT / "pages").rglob("*.md"))
        # extensions of the site's own: cards, tabs, folded Chinese, what mkdocstrings fills in
        if str(path.relative_to(BUILT / "pages"))
        not in ("index.md", "zh/index.md", "reference/rules.md", "reference/python-names.md")
    ]
    paths = [str(BUILT / "pages" / name) for name in names]
    done = subprocess.run(
        [BUILT / "env" / "bin" / "python", "-c", COUNT],
        input=json.dumps(paths), capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    rendered = json.loads(done.stdout)
    for name, path in zip(names, paths, strict=True):
        article = re.search(
            r"<article.*?</article>",
            (site / name.with_suffix(".html")).read_text("utf-8"),
            re.DOTALL,
        )
        assert article
        assert counted(article[0]) == counted(rendered[path]), name


def counted(html):
    """How many of each element, code blocks being one, whatever is in them."""
    return Counter(ELEMENTS.findall(re.sub(r"<pre.*?</pre>", "<pre>", html, flags=re.DOTALL)))


def test_the_long_description_renders(site):
    command = [sys.executable, "-c", "import hatch_build, pathlib; print(hatch_build.long_description("
               "pathlib.Path('README.md').read_text('utf-8')))"]  # fmt: skip
    text = subprocess.run(
        command, cwd=ROOT, capture_output=True, encoding="utf-8", check=True
    ).stdout
    done = subprocess.run(
        [BUILT / "env" / "bin" / "python", "-c", RENDER],
        input=text, capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    assert done.stderr == ""
    assert "<img" not in done.stdout
    assert not re.search(r'href="(?!https?:)[^#]', done.stdout)
    assert done.stdout.count("<table") == text.count("\n|---")
    assert done.stdout.count("<pre") == text.count("\n```") / 2


def test_every_page_opens_from_a_folder_and_asks_nobody(pages, browser):
    for size, touch in (((1280, 820), False), ((390, 844), True)):
        browser.look(size, touch=touch)
        browser.problems()
        browser.requested()
        for page in pages:
            browser.driver.get(page.as_uri())
            assert browser.problems() == [], page.name
            asked = [
                each for each in browser.requested() if not each.startswith(("file:", "data:"))
            ]
            assert asked == [], page.name
            wide = browser.run("return document.documentElement.scrollWidth - innerWidth")
            assert wide <= 0, f"{page.name} is {wide} pixels wider than a window of {size[0]}"


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("two-users", "DS705"),
        ("0x6B", "No change access"),
        ("ds47.pnu", "Fields"),
        ("应答", "DS704"),
    ],
)
def test_the_search_works_in_a_folder(site, browser, query, words):
    browser.look()
    browser.driver.get((site / "index.html").as_uri() + f"?q={query}")
    browser.wait(FOUND.replace("return ", "return 0 < ") + ".length")
    assert any(words in each for each in browser.run(FOUND))
    asked = [each for each in browser.requested() if not each.startswith(("file:", "data:"))]
    assert asked == []


def test_the_search_works_in_firefox_too(site):
    import firefox

    if find_spec("websocket") is None or firefox.program() is None:
        missing("firefox-esr or websocket-client")
    with firefox.Firefox() as other:
        other.open(site / "index.html")
        other.run("(location.search = '?q=two-users')")
        count = FOUND.removeprefix("return ")
        other.wait(f"{count}.some((each) => each.includes('DS705'))")


def test_what_is_copied_of_a_console_is_the_command(site, browser):
    browser.driver.get((site / "tutorial.html").as_uri())
    assert set(browser.texts(".language-console .gp")) == {"$"}
    copied = browser.run(
        "const code = document.querySelector('.language-console code');"
        "code.setAttribute('data-md-copying', '');"
        "const text = code.innerText; code.removeAttribute('data-md-copying'); return text"
    )
    assert copied.strip() == "ds47 report captures/tour-machine.pcapng"


def test_the_chinese_page_is_chinese_throughout(site, browser):
    browser.driver.get((site / "zh" / "index.html").as_uri())
    assert browser.run("return document.documentElement.lang") == "zh"
    assert browser.run("return document.querySelector('[name=query]').placeholder") == "搜索"


def test_the_zip_is_the_site_and_always_the_same(site, pages, tmp_path):
    for name in ("one", "two"):
        pack(site, tmp_path / name / "ds47-docs.zip")
    one, two = (tmp_path / name / "ds47-docs.zip" for name in ("one", "two"))
    assert one.read_bytes() == two.read_bytes()
    with zipfile.ZipFile(one) as file:
        assert file.testzip() is None
        names = file.namelist()
    assert {name.split("/")[0] for name in names} == {"ds47-docs"}
    assert len([name for name in names if name.endswith(".html")]) == len(pages)
    assert not [name for name in names if name.endswith(".map")]
