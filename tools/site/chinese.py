"""A hook of mkdocs: words of Chinese text for the search, by a list of the words of this field.

The search of the theme looks for words, and Chinese is written without spaces; the theme asks a module for them
that splits any text and weighs 19 MB. Here are the words that people look for in these pages (chinese.txt); what
is between two of them stays together.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

from material.plugins.search import plugin

WORDS = frozenset(Path(__file__).with_name("chinese.txt").read_text("utf-8").split())
LONGEST = max(map(len, WORDS))


def cut(text: bytes) -> Iterator[str]:
    """The words of a run of Chinese characters, in their order, the longest first where several begin alike."""
    rest = text.decode("utf-8")
    between = ""
    while rest:
        found = next((rest[:n] for n in range(LONGEST, 1, -1) if rest[:n] in WORDS), None)
        if found is None:
            between, rest = between + rest[0], rest[1:]
            continue
        if between:
            yield between
            between = ""
        yield found
        rest = rest[len(found) :]
    if between:
        yield between


plugin.jieba = SimpleNamespace(cut=cut)
