"""The numbers, states and lists that decide: limits.toml, pairing.toml and diagnoses.toml as Python objects."""

from __future__ import annotations

from functools import cache
from typing import Any

from ds47.spec import _load
from ds47.spec.rows import Row

_MS = 1_000_000


class Limits(Row):
    """limits.toml; times in nanoseconds of capture time."""

    copy_ns: int
    call_expiry_ns: int
    transaction_expiry_ns: int
    fragment_expiry_ns: int
    unread_ns: int
    slow_ns: int
    polling_ns: int
    pkw_slow_ns: int
    not_running_ns: int
    inhibited_ns: int
    acknowledge_ns: int
    locked_ns: int
    off_asked_ns: int
    trip_ns: int
    deviation_ns: int
    disorder_ns: int
    s7_split_ns: int
    s7_writers_ns: int
    pkw_saved: int
    pkw_reads: int
    pkw_cycles: int
    deviation_percent: int
    polls: int
    bus_polls: int
    bus_diagnosis: int
    parameters: int
    elements: int
    ip_datagrams: int
    ip_fragments: int
    rpc_messages: int
    rpc_fragments: int
    fragment_bytes: int
    datagrams: int
    activities: int
    calls: int
    answered_calls: int
    channels: int
    relations: int
    events: int
    users: int
    pending_writes: int
    unanswered_writes: int
    reads: int
    waiting_calls: int
    waiting_ars: int
    proven_ars: int
    written_values: int
    described_parameters: int
    lone_findings: int
    frame_times: int
    longest_messages: int
    bus_remarks: int
    s7_connections: int
    s7_told: int
    s7_bytes: int
    s7_jobs: int
    s7_transfers: int
    s7_parts: int
    s7_accesses: int
    s7_memories: int
    s7_notes: int
    stations: int


@cache
def limits() -> Limits:
    """The limits as they are shipped."""
    table = _load("limits.toml")
    times = {f"{name}_ns": value * _MS for name, value in table["time"].items()}
    return Limits(**times, **table["count"], **table["memory"])


@cache
def phases() -> dict[str, dict[str, str]]:
    """The life of a job: phase -> event -> next phase."""
    return {name: dict(events) for name, events in _load("pairing.toml")["phase"].items()}


@cache
def reasons(lang: str) -> dict[str, str]:
    """Why a request has no response, in words ("en" or "zh")."""
    return {name: words[lang] for name, words in _load("pairing.toml")["reason"].items()}


class DriveKnowledge(Row):
    """What the diagnoses know about drives and programs: limits and numbers, named as in diagnoses.toml."""

    held: int
    held_jitter: int
    held_period: int
    storm_polls: int
    storm_jobs: int
    storm_total: int
    channel_bytes: int
    groups: int
    frames: int
    history: int
    of_pair: int
    plausible_digits: int
    plausible_least: int
    plausible_most: int
    source_most: int
    saving: frozenset[int]
    saving_all: int
    confused_indices: frozenset[int]
    running: frozenset[int]
    running_siemens: frozenset[int]
    index_errors: frozenset[int]
    type_errors: frozenset[int]
    connectors: frozenset[int]
    global_pnus: frozenset[int]
    recomputing: frozenset[int]
    axis_error: int
    too_long: int
    no_array: int
    connector_error: int
    commissioning: dict[int, str]


@cache
def known() -> DriveKnowledge:
    """The numbers and lists of the diagnoses as they are shipped."""
    table = _load("diagnoses.toml")
    numbers: dict[str, Any] = {
        name: frozenset(value) if isinstance(value, list) else value
        for name, value in table["numbers"].items()
    }
    states = {int(code): text for code, text in table["commissioning"].items()}
    return DriveKnowledge(**table["limits"], **numbers, commissioning=states)


@cache
def never_written() -> tuple[tuple[range, ...], frozenset[tuple[int, int]]]:
    """What a corrected request never writes: PNUs, and single values of a PNU."""
    table = _load("diagnoses.toml")["never_written"]
    pnus = tuple(range(first, last + 1) for first, last in table["ranges"])
    return pnus, frozenset((pnu, value) for pnu, value in table["values"])


@cache
def parts() -> dict[str, str]:
    """The parts of a message as the arguments of a finding name them -> their Chinese names."""
    return dict(_load("diagnoses.toml")["parts"])


@cache
def diagnosis_words(lang: str) -> dict[str, str]:
    """The words that fill the sentences of the diagnoses ("en" or "zh")."""
    return {
        **plugin_words(lang),
        **_load("diagnoses.toml")["analyzer"]["zh" if lang == "zh" else "en"],
    }


def plugin_words(lang: str) -> dict[str, str]:
    """The words that the rules of the plugin need, too."""
    return dict(_load("diagnoses.toml")["words"]["zh" if lang == "zh" else "en"])
