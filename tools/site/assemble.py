"""Puts together what mkdocs builds the site from: docs/, pages made from the code, and files that they link to.

    python -m tools.site.assemble FOLDER

Here: which files there are, and links that leave docs/. In the checkout such a link goes to a file of the
repository; in the site that file stands below files/, so that a copy of the site has it too. Not here: how a page
looks (mkdocs.yml).
"""

from __future__ import annotations

import posixpath
import re
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from .reference import PAGES

ROOT = Path(__file__).resolve().parents[2]
ALSO = {
    "CHANGELOG.md": "changelog.md",
    "captures/real-stacks/README.md": "captures-real-stacks.md",
    "captures/s7-stacks/README.md": "captures-s7-stacks.md",
    "captures/profibus/README.md": "captures-profibus.md",
}
"""Pages of the site that stand elsewhere in the checkout: by their place there, their place below docs/."""
SOONER = {
    "start/": 2, "tutorial": 2, "how-to/": 2, "diagnoses": 2, "reference/rules": 2,
    "changelog": 0.1, "captures-": 0.1,
}  # fmt: skip
"""What counts more or less than other pages where several have what was searched for, by how their names begin."""
_FENCE = re.compile(
    r"(^(?P<fence>```+|~~~+).*?^(?P=fence)\s*?$|`[^`\n]+`)", re.MULTILINE | re.DOTALL
)
_COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)
_LINK = re.compile(r"(\]\()([^()\s]+)(\))")
_RULE = re.compile(r"!?\[[^\]]*\]\([^)]*\)|^#.*$|(?<![\w/-])(DS[1-9]\d\d)(?![\w-])", re.MULTILINE)
"""The id of a rule in a sentence; links and headings, which are left alone, come first."""
_RULES = "reference/rules.md"
_CODE = re.compile(r"`[^`]+`")
_ITEM = re.compile(r"^(?:[*+-]|\d+\.) ")


def pages(root: Path = ROOT) -> dict[str, str]:
    """Every page of the site by its place below docs/, as it stands in the checkout, and the links from there."""
    found = {
        path.relative_to(root / "docs").as_posix(): path.read_text("utf-8")
        for path in sorted((root / "docs").rglob("*.md"))
    }
    found |= {name: make(root) for name, make in PAGES.items()}
    for source, name in ALSO.items():
        text = (root / source).read_text("utf-8")
        found[name] = _outside_code(
            text, lambda part, at=source, to=name: _moved(part, at, f"docs/{to}")
        )
    return found


def _moved(text: str, source: str, target: str) -> str:
    """The links of a page that stands at `source` as they are from `target`."""

    def turned(match: re.Match[str]) -> str:
        path, hash_, anchor = match[2].partition("#")
        if not path or ":" in path:
            return match[0]
        wanted = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        return f"{match[1]}{posixpath.relpath(wanted, posixpath.dirname(target))}{hash_}{anchor}{match[3]}"

    return _LINK.sub(turned, text)


def written(name: str, text: str, files: dict[str, str]) -> str:
    """A page as mkdocs gets it: without comments, its links within the site.

    Args:
        name: its place below docs/; ids of rules lead from there to the list of rules.
        text: as it stands in the checkout.
        files: gets the files of the checkout that it links to: by their place there, their place in the site.
    """
    text = _outside_code(text, lambda part: _within(_COMMENT.sub("", part), name, files))
    if name not in (_RULES, *ALSO.values()):
        rules = posixpath.relpath(_RULES, posixpath.dirname(name))
        text = _outside_code(text, lambda part: _RULE.sub(lambda match: _rule(match, rules), part))
    weight = next((SOONER[start] for start in SOONER if name.startswith(start)), 1)
    head = "" if weight == 1 else f"---\nsearch:\n  boost: {weight}\n---\n\n"
    return head + _spaced(text)


def _within(text: str, name: str, files: dict[str, str]) -> str:
    def turned(match: re.Match[str]) -> str:
        path, hash_, anchor = match[2].partition("#")
        if not path or ":" in path:
            return match[0]
        here = posixpath.dirname(f"docs/{name}")
        wanted = posixpath.normpath(posixpath.join(here, path))
        if wanted.startswith("docs/"):
            return match[0]
        place = ALSO.get(wanted) or files.setdefault(wanted, f"files/{wanted}")
        return f"{match[1]}{posixpath.relpath(f'docs/{place}', here)}{hash_}{anchor}{match[3]}"

    return _LINK.sub(turned, text)


def _rule(match: re.Match[str], rules: str) -> str:
    return f"[{match[1]}]({rules}#{match[1].lower()})" if match[1] else match[0]


def _outside_code(text: str, change: Callable[[str], str]) -> str:
    """A text with a change made wherever there is no code."""
    parts = _FENCE.split(text)
    # what matched stands behind each text, and behind that its fence
    return "".join(
        change(part) if at % 3 == 0 else part if at % 3 == 1 else ""
        for at, part in enumerate(parts)
        if part is not None
    )


def _spaced(text: str) -> str:
    """The text for the Markdown of mkdocs: a blank line before a list, in a table no escaped bar within code."""
    lines: list[str] = []
    fenced = False
    for line in text.splitlines():
        before = lines[-1] if lines else ""
        fenced ^= line.startswith("```")
        inside = not before or before.startswith((" ", "|", "#")) or _ITEM.match(before)
        if not fenced and _ITEM.match(line) and not inside and not _goes_on(lines):
            lines.append("")
        if not fenced and line.startswith("|"):
            line = _CODE.sub(lambda match: match[0].replace("\\|", "|"), line)
        lines.append(line)
    return "\n".join(lines) + "\n"


def _goes_on(lines: list[str]) -> bool:
    """Whether the last line is of an item, which may be several lines long."""
    for line in reversed(lines):
        if not line:
            return False
        if _ITEM.match(line):
            return True
    return False


def assemble(target: Path, root: Path = ROOT) -> Mapping[str, str]:
    """Writes all of it into a folder, which is emptied before. Returns the files of the checkout that are in it.

    Raises:
        FileNotFoundError: a page links to a file that is not there, or there is no Lua for the fields.
    """
    shutil.rmtree(target, ignore_errors=True)
    files: dict[str, str] = {}
    for name, text in pages(root).items():
        path = target / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(written(name, text, files), "utf-8", newline="\n")
    shutil.copytree(root / "docs" / "images", target / "images", dirs_exist_ok=True)
    shutil.copytree(Path(__file__).parent / "assets", target / "assets", dirs_exist_ok=True)
    for source, place in files.items():
        (target / place).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / source, target / place)
    return files


if __name__ == "__main__":
    try:
        assemble(Path(sys.argv[1]))
    except FileNotFoundError as problem:
        sys.exit(str(problem))
