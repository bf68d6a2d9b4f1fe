"""Wireshark display filters: for frames, in the form that every version from 3.4 on takes, and for a rule."""

from __future__ import annotations

from collections.abc import Iterable

from ds47.spec import rules

RUNS_PER_FILTER = 60
"""Frames, or runs of frames that follow each other, that one filter names."""


def display_filter(frames: Iterable[int]) -> tuple[str, int]:
    """A display filter for these frames, and how many of them it had to leave out.

    Sets of one element only, joined by `or`: of `{1 2}` and `{1, 2}` Wireshark 3.4 knows the first and
    4.0 the second.
    """
    runs: list[list[int]] = []
    for number in sorted(set(frames)):
        if runs and runs[-1][1] == number - 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    left_out = sum(last - first + 1 for first, last in runs[RUNS_PER_FILTER:])
    terms = [
        f"frame.number == {first}" if first == last else f"frame.number in {{{first}..{last}}}"
        for first, last in runs[:RUNS_PER_FILTER]
    ]
    return " or ".join(terms), left_out


def plugin_filter(rule: str) -> str | None:
    """The filter of the plugin for all that a rule found, in every capture; None where the plugin has it not."""
    known = rules().get(rule)
    return None if known is not None and known.analyzer_only else f'ds47.finding == "{rule}"'
