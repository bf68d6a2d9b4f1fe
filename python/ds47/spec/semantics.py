"""The numbers and the state table of pairing: limits.toml and pairing.toml as Python objects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from ds47.spec import _load

_MS = 1_000_000


@dataclass(frozen=True, slots=True)
class Limits:
    """limits.toml; times in nanoseconds of capture time."""

    copy_ns: int
    retransmission_ns: int
    call_expiry_ns: int
    transaction_expiry_ns: int
    fragment_expiry_ns: int
    slow_ns: int
    polling_ns: int
    polls: int
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
    pending_writes: int
    reads: int
    waiting_calls: int
    waiting_ars: int
    proven_ars: int
    written_values: int
    longest_messages: int
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
    """Why a request stayed without its response, in words ("en" or "zh")."""
    return {name: words[lang] for name, words in _load("pairing.toml")["reason"].items()}
