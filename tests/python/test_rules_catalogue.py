"""The catalogue of findings (spec/rules.toml): complete, and in both languages.

That ids, names and arguments stay is held by test_stability.py. Whether a rule is reported at the right place is
tested with pairing, rules and codec, not here.
"""

from __future__ import annotations

import re
import string
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

SEVERITIES = {"error", "warning", "note"}
SCOPES = {"capture", "transport", "record", "message", "transaction"}
EXPERTS = {"refused", "response", "malformed", "sequence", "usual", "protocol"}
ANCHORS = {"frame", "request", "write_response", "read_response", "superseding_request"}
TEXTS = [
    "title", "message", "cause", "advice", "title_zh", "message_zh", "cause_zh", "advice_zh",
]  # fmt: skip
ORDER = [
    "id", "name", "title", "severity", "scope", "anchor", "expert", "analyzer_only", "changed", "group", "args",
    "message", "many", "brief", "cause", "advice", "title_zh", "message_zh", "many_zh", "brief_zh",
    "cause_zh", "advice_zh",
]  # fmt: skip
OPTIONAL = ("analyzer_only", "changed", "group", "args", "many", "many_zh", "brief", "brief_zh")
KEYS = [key for key in ORDER if key not in OPTIONAL]


def load() -> list[dict[str, Any]]:
    """The rules as the file has them, without the loader of ds47.spec in between."""
    text = (resources.files("ds47") / "spec" / "rules.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    assert set(document) == {"states", "otherwise", "rule"}
    rules: list[dict[str, Any]] = document["rule"]
    return rules


def placeholders(template: str) -> list[str]:
    """Names in braces, sorted; a format specification or a conversion is not allowed."""
    names = []
    for _, name, spec, conversion in string.Formatter().parse(template):
        if name is not None:
            assert name.isidentifier()
            assert not spec
            assert not conversion
            names.append(name)
    return sorted(names)


RULES = load()
EACH = pytest.mark.parametrize("rule", RULES, ids=[rule["id"] for rule in RULES])


def test_ids_are_unique_and_sorted() -> None:
    ids = [rule["id"] for rule in RULES]
    assert ids == sorted(set(ids))
    assert all(re.fullmatch(r"DS[1-9]\d\d", id_) for id_ in ids)


def test_what_1_0_0_had_not_says_which_version_brought_it(vectors: Path) -> None:
    known = (vectors / "stored" / "rules.1.0.0.txt").read_text("utf-8").split()
    ids = {rule["id"]: rule.get("changed") for rule in RULES}
    assert set(known) <= set(ids)
    assert [id_ for id_ in ids if id_ not in known and not ids[id_]] == []


def test_names_are_unique() -> None:
    names = [rule["name"] for rule in RULES]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", name) for name in names)


@EACH
def test_keys_and_vocabulary(rule: dict[str, Any]) -> None:
    keys = [key for key in ORDER if key in rule]
    assert list(rule) == keys
    assert {*KEYS} <= {*keys}
    assert "group" in rule or not rule["id"].startswith("DS7")
    assert rule.get("group", []) == sorted(
        set(rule.get("group", [])), key=rule.get("group", []).index
    )
    assert rule.get("analyzer_only", True) is True, "a rule that the plugin has says nothing"
    versions = [tuple(map(int, version.split("."))) for version in rule.get("changed", ())]
    assert versions == sorted({*versions}), "each version once, in their order"
    assert all(len(version) == 3 for version in versions)
    assert rule["severity"] in SEVERITIES
    assert rule["scope"] in SCOPES
    assert rule["anchor"] in ANCHORS
    assert rule["expert"] in EXPERTS


@EACH
def test_texts_are_there(rule: dict[str, Any]) -> None:
    for key in TEXTS:
        text = rule[key]
        assert isinstance(text, str)
        assert text == text.strip() != "", key
        assert "\n" not in text, key
        assert not text.endswith(("..", "。。", ".。", "。.")), key


@EACH
def test_messages_are_short_facts(rule: dict[str, Any]) -> None:
    for key in ("message", "message_zh"):
        assert len(rule[key]) <= 140
        assert not rule[key].endswith((".", "。"))
        assert "{parameter}" not in rule[key][1:], "`Parameter 1120[0]` begins a sentence"
    assert placeholders(rule["message"]) == placeholders(rule["message_zh"])
    assert {*placeholders(rule["message"])} <= {
        *rule.get("args", {}),
        "text",
        "error",
        "drive",
        "parameter",
        "item",
    }
    assert "{device} " not in rule["message"] or "{slot}" not in rule["message"], "that is {drive}"


def test_titles_tell_rules_apart() -> None:
    for key in ("title", "title_zh"):
        assert len({rule[key] for rule in RULES}) == len(RULES)
        assert all(placeholders(rule[key]) == [] for rule in RULES)
        assert not [rule[key] for rule in RULES if rule[key].endswith((".", "。"))]
    assert max(len(rule["title"]) for rule in RULES) <= 60
    assert all(rule["title"][0].isupper() for rule in RULES)


@EACH
def test_explanations_are_sentences_without_placeholders(rule: dict[str, Any]) -> None:
    for key, stop in (("cause", "."), ("advice", "."), ("cause_zh", "。"), ("advice_zh", "。")):
        assert placeholders(rule[key]) == []
        assert rule[key].endswith(stop)


@EACH
def test_chinese_is_chinese(rule: dict[str, Any]) -> None:
    for key in TEXTS:
        if rule[key] in ("{case}", "{what}"):
            continue  # all of it is words of diagnoses.toml
        assert bool(re.search("[\u4e00-\u9fff]", rule[key])) == key.endswith("_zh"), key
