"""Findings by rule: cause, advice, frames, and the display filters that show them in Wireshark."""

from __future__ import annotations

from dataclasses import dataclass

from ds47.model import SEVERITIES, CaptureResult, Finding
from ds47.report.clock import Clock
from ds47.report.filters import display_filter, plugin_filter
from ds47.report.html import messages
from ds47.report.html.texts import Both
from ds47.report.html.views.links import FrameLink, Links
from ds47.report.html.views.times import FrameClock
from ds47.report.zones import UNIVERSAL

SHOWN = 100
"""The most findings listed for a rule; their number is always shown."""


@dataclass(frozen=True, slots=True)
class ShownFinding:
    """One finding of a group."""

    frame: int
    time: str
    """Of its frame; empty where no time of day is known,"""
    since: str
    """and the seconds since the first frame; empty where neither is."""
    transaction: int | None
    message: Both
    others: list[FrameLink]
    """The further frames that it is about."""


@dataclass(frozen=True, slots=True)
class Group:
    """All findings of one rule."""

    rule: str
    name: str
    severity: str
    count: int
    cause: Both
    advice: Both
    shown: list[ShownFinding]
    filter: str
    filter_left_out: int
    """Frames for which the filter has no room."""

    @property
    def left_out(self) -> int:
        """Findings that are not listed."""
        return self.count - len(self.shown)

    @property
    def plugin_filter(self) -> str | None:
        """The short filter of the plugin: all of them, in every capture. None where the plugin has none."""
        return plugin_filter(self.rule)


def groups(
    result: CaptureResult, moments: FrameClock | None = None, links: Links | None = None
) -> list[Group]:
    """The findings of a capture by rule, the serious rules first."""
    found: dict[str, list[Finding]] = {}
    for finding in result.findings:
        found.setdefault(finding.rule, []).append(finding)
    links = links or Links(result)
    moments = moments or FrameClock(result, Clock.of(result, UNIVERSAL))
    made = [_group(rule, items, links, moments) for rule, items in found.items()]
    return sorted(made, key=lambda group: (-SEVERITIES.index(group.severity), group.rule))


def _group(rule: str, items: list[Finding], links: Links, moments: FrameClock) -> Group:
    text, left_out = display_filter(frame for each in items for frame in each.counted)
    return Group(
        rule=rule,
        name=messages.rule_name(rule),
        severity=max((each.severity for each in items), key=SEVERITIES.index),
        count=len(items),
        cause=messages.cause(rule),
        advice=messages.advice(rule),
        shown=[_shown(each, links, moments) for each in items[:SHOWN]],
        filter=text,
        filter_left_out=left_out,
    )


def _shown(item: Finding, links: Links, moments: FrameClock) -> ShownFinding:
    others = links.of(frame for frame in item.frames if frame != item.frame)
    clock, known = moments.clock, item.time_ns
    time, since = ("", "") if known is None else (clock.at(known), f"{clock.since(known)} s")
    return ShownFinding(
        item.frame, time, since, item.transaction, messages.with_offset(item), others
    )
