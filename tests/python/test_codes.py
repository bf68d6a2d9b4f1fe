"""The numbers of words that fields of Wireshark have: what a filter was written with stays what it is.

That the Lua tables have the same numbers is in test_lua_tables.py.
"""

from __future__ import annotations

import pytest

from ds47.model import CHANNELS, OPERATIONS, SEVERITIES, STATES
from ds47.profibus import ms1
from ds47.spec import codes, cyclic, profibus, request_ids

FIXED = {
    "states": "ok partial error mismatch refused unanswered superseded orphan incomplete",
    "operations": "read change vendor unknown get put bsend usend",
    "channels": "ds47 pkw pzd s7",
    "severities": "note warning error",
    "drive_states": "S1,S2,S3,S4,S5,not ready",
    "drive_words": "STW1 ZSW1",
    "events": "on off1 off2 off3 enable-operation disable-operation ramp-generator-on ramp-generator-off"
    " ramp-generator-continued ramp-generator-frozen setpoint-enabled setpoint-blocked acknowledge jog-1 jog-1-end"
    " jog-2 jog-2-end reverse forward control no-control ready not-ready running stopped fault fault-cleared"
    " off2-active off2-inactive off3-active off3-inactive inhibited released alarm alarm-cleared control-requested"
    " local first output-lost output-back input-lost input-back",
    "profibus_services": "exchange resource alarm record extended_parameters address inputs outputs control"
    " get_configuration diagnosis parameters configuration ms2",
    "profibus_messages": "request poll answer taken refusal",
    "profibus_flaws": "start cut lengths length second check end_byte reserved address extension rest unproved"
    " data record_length more",
    "profibus_roles": "PKW PZD",
}
"""Every word in the order of its number, from 1 on. A line grows at its end; nothing else may change here."""

WORDS = {
    "states": STATES,
    "operations": OPERATIONS,
    "channels": CHANNELS,
    "severities": SEVERITIES,
    "drive_states": cyclic.state_ids(),
    "events": cyclic.event_ids(),
    "profibus_services": {*profibus.services(), "ms2"},
    "profibus_messages": (ms1.REQUEST, ms1.POLL, ms1.ANSWER, ms1.TAKEN, ms1.REFUSAL),
    "profibus_flaws": profibus.flaw_ids(),
}
"""All that the analysis can say."""


def test_every_table_is_fixed() -> None:
    assert set(codes.tables()) == FIXED.keys()


@pytest.mark.parametrize("table", FIXED)
def test_a_number_never_changes_its_meaning(table: str) -> None:
    words = FIXED[table].split("," if "," in FIXED[table] else None)
    assert dict(codes.codes(table)) == {word: code for code, word in enumerate(words, 1)}


@pytest.mark.parametrize("table", WORDS)
def test_every_word_has_a_number(table: str) -> None:
    assert codes.codes(table).keys() == set(WORDS[table])


def test_a_number_leads_back_to_its_word() -> None:
    assert codes.words("states")[5] == "refused"
    with pytest.raises(KeyError):
        codes.codes("no such table")


def test_read_and_change_have_the_number_of_their_request_id() -> None:
    for name in ("read", "change"):
        assert request_ids()[codes.codes("operations")[name]].operation == name


def test_what_only_the_analyzer_says_keeps_its_number_and_is_none_of_the_plugin() -> None:
    left_out = {name: codes.analyzer_only(name) for name in codes.tables()}
    assert {name: words for name, words in left_out.items() if words} == {
        "operations": ("get", "put", "bsend", "usend"),
        "channels": ("s7",),
    }
    for name, words in left_out.items():
        of_plugin = codes.of_plugin(name)
        assert {**of_plugin, **{word: codes.codes(name)[word] for word in words}} == codes.codes(
            name
        )
        assert not of_plugin.keys() & set(words)
