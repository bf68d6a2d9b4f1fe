"""The catalogue of findings (spec/rules.toml): complete, in both languages, and pinned.

Whether a rule is reported at the right place is tested with pairing, rules and codec, not here.
"""

from __future__ import annotations

import re
import string
import tomllib
from importlib import resources
from typing import Any

import pytest

SEVERITIES = {"error", "warning", "note"}
SCOPES = {"capture", "transport", "record", "message", "transaction"}
EXPERTS = {"response", "malformed", "sequence", "protocol"}
ANCHORS = {"frame", "request", "write_response", "read_response", "superseding_request"}
TEXTS = [
    "title", "message", "cause", "advice", "title_zh", "message_zh", "cause_zh", "advice_zh",
]  # fmt: skip
ORDER = [
    "id", "name", "title", "severity", "scope", "anchor", "expert", "analyzer_only", "group", "args",
    "message", "many", "cause", "advice", "title_zh", "message_zh", "many_zh", "cause_zh", "advice_zh",
]  # fmt: skip
KEYS = [key for key in ORDER if key not in ("analyzer_only", "group", "args", "many", "many_zh")]

# An id never changes its meaning: severity, name and arguments are what others rely on. Only add.
PINNED = """
DS101 warning request-without-response operation
DS102 warning response-without-request operation
DS103 warning retransmission first operation
DS104 error rpc-fault fault kind
DS105 warning incomplete-fragments have kind
DS106 warning truncated-frame captured completed length original
DS107 note time-steps-back first milliseconds
DS108 warning empty-rpc-body
DS109 warning limit-reached count limit most
DS201 error read-refused status
DS202 warning record-length present stated
DS203 error write-refused status
DS204 note polled count
DS205 warning polled-long limit milliseconds
DS206 warning nothing-to-read status
DS207 warning read-without-data
DS208 error nested-write-multiple
DS301 warning reference-zero
DS302 error unknown-request-id id
DS303 error parameter-count-zero
DS304 warning parameter-count-high count limit
DS305 warning unknown-attribute attribute
DS306 warning pnu-zero
DS307 warning element-count-high count limit
DS308 warning subindex-overflow count subindex
DS309 error unknown-format format
DS310 warning value-count elements values
DS311 note pad-missing
DS312 warning pad-not-zero pad
DS313 warning bytes-left-over count
DS314 note zeros-left-over count
DS315 error bytes-missing need what
DS316 note message-long length limit
DS317 note size-ambiguous format size
DS318 note error-words count
DS319 error unknown-response-id id
DS401 warning read-unanswered dropped reason
DS402 note change-response-unread dropped reason
DS403 warning orphan-response case dropped
DS404 error reference-not-mirrored got sent
DS405 error response-id-mismatch got sent
DS406 error axis-not-mirrored got sent
DS407 warning count-not-mirrored got sent
DS408 warning fewer-values asked got pnu
DS409 note more-values asked got pnu
DS410 error drive-error code info pnu subindex vendor_id
DS411 warning positive-with-error
DS412 warning negative-without-error
DS413 warning read-superseded by request
DS414 note change-superseded by request
DS415 note reference-constant first reference
DS416 warning slow limit milliseconds
DS417 warning read-back-differs by pnu read subindex written
DS418 error request-not-supported id
DS501 error pkw-error code pnu subindex
DS502 error pkw-no-rights pnu subindex
DS503 warning pkw-without-response milliseconds pnu subindex
DS504 warning pkw-superseded by pnu request subindex
DS505 error pkw-mismatch request response
DS506 error pkw-written-in-parts pnu subindex
DS507 warning pkw-word-on-double-word pnu read subindex
DS508 warning pkw-saved-often count device limit pnu slot subindex
DS509 note pkw-same-read count device limit pnu slot subindex
DS510 warning pkw-other-layout count device layout other slot
DS511 note pkw-slow count device limit slot slowest
DS512 note pkw-unused device slot
DS513 warning pkw-word-in-wrong-place pnu pwe subindex
DS520 error fault-while-running code device slot what
DS521 error on-without-running device limit seconds slot what
DS522 error on-without-control device slot word
DS523 error on-without-edge device limit seconds slot
DS524 warning acknowledge-without-effect device limit seconds slot
DS525 warning setpoint-locked bits device limit seconds slot
DS526 warning speed-deviation device limit percent seconds slot
DS527 error control-lost device slot
DS528 error controller-stopped device slot what
DS529 warning off-by-drive device off slot
DS530 note change-in-operation pnu since subindex what
DS531 note change-not-in-operation pnu subindex what
DS601 error engines-differ difference
DS701 warning refusal-not-seen case code id polls vendor_id
DS702 warning read-too-early by frame
DS703 warning nothing-was-asked count device
DS704 warning old-answer case first frame write
DS705 error two-users ar case controller first frame other other_ar
DS706 error request-here-read-there device frame other place request
DS707 error wrong-record-index device index status
DS708 error wrong-slot device other place status
DS709 error wrong-drive-object axis device
DS710 note axis-byte-ignored axes device place
DS711 error request-length case count fits have need
DS712 error read-length asked need
DS713 error response-too-long limit number parameters pnu room subindex what
DS714 error value-in-wrong-type better better_code bits case code format meant pnu seen subindex values
DS715 error bytes-swapped meant what
DS716 error data-block-layout meant what
DS717 error index-and-count code elements pnu subindex vendor_id
DS718 error commissioning-state code pnu state subindex vendor_id
DS719 error drive-running code pnu subindex vendor_id
DS720 error connector-as-number case code format pnu source subindex value vendor_id
DS721 note lost-at-power-off case count device last more targets unknown
DS722 error connection-lost frame
DS723 warning request-held count device period place
DS724 warning polling-storm count device period time
DS725 warning half-captured count what
DS901 warning job-without-answer area controller device operation
DS902 error pdu-above-agreement agreed count device frame frames sender size
DS903 warning area-above-block area block bytes case controller count device frame frames name operation
DS904 note area-in-parts area controller count device frames jobs operation
DS905 error moments-mixed case controller device first first_value frames jobs second second_value write
DS906 note items-apart controller count device frames
DS907 warning two-writers byte controller count device frames other
DS908 error item-refused area code controller device operation
DS909 error job-refused area code controller device operation
DS910 error transfer-incomplete case controller device first r_id segments size total
DS911 warning segment-unacknowledged controller count device frames r_id segments
DS912 error transfer-id-in-use case code controller device frame r_id
DS913 warning areas-of-usend-differ before controller device first now r_id
DS914 warning jobs-above-agreement agreed controller count device frames most
DS915 note setup-not-seen controller count device frames
DS916 warning written-not-read by byte controller device read written
DS917 error connection-refused case code controller count device frames rack slot tsap
"""


def load() -> list[dict[str, Any]]:
    """The rules as the file has them, without the loader of ds47.spec in between."""
    text = (resources.files("ds47") / "spec" / "rules.toml").read_text(encoding="utf-8")
    document = tomllib.loads(text)
    assert set(document) == {"rule"}
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


def test_names_are_unique() -> None:
    names = [rule["name"] for rule in RULES]
    assert len(names) == len(set(names))
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", name) for name in names)


def test_meaning_is_pinned() -> None:
    """Severity and name stay, and so do the arguments; a rule may get more of them."""
    found = {rule["id"]: rule for rule in RULES}
    for line in PINNED.strip().splitlines():
        id_, severity, name, *args = line.split()
        assert (severity, name) == (found[id_]["severity"], found[id_]["name"])
        assert set(args) <= set(found[id_].get("args", {})), id_


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
    assert placeholders(rule["message"]) == placeholders(rule["message_zh"])
    assert {*placeholders(rule["message"])} <= {*rule.get("args", {}), "text", "error", "drive"}
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
        if rule[key] == "{case}":
            continue  # all of it is words of diagnoses.toml
        assert bool(re.search("[\u4e00-\u9fff]", rule[key])) == key.endswith("_zh"), key
