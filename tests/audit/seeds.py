"""Random conversations, audited one after the other or by all processors.

A seed stands for a share of them: the same plans each time.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from random import Random
from traceback import format_exc

from tests.audit import conversations, cuts, ends, holes, lines, lossy, machines, partners, run
from tests.audit.reading import Complaint

Plan = conversations.Plan | lines.Plan | lossy.Plan | partners.Plan | machines.Plan
"""Of a conversation on PROFINET, of a line of PROFIBUS, over a wire that loses and delays, of partners of S7, or of
machines in cyclic frames."""
Conversation = (
    conversations.Conversation
    | lines.Conversation
    | lossy.Conversation
    | partners.Conversation
    | machines.Conversation
)
SHARE = 100
"""So many conversations are audited by one process, in 10 s or so."""


OF_LINES = (
    "every 5th lost", "every 11th lost", "every 17th lost", "to devices", "from devices", "snapped", "middle",
    "3rd swapped", "7th swapped", "clock back", "doubled", "twice",
)  # fmt: skip
"""How a line is cut. Of whole exchanges that are missing two by two nothing tells."""
UNTOLD = ("DS5", "DS811")
"""Rules of which a line with holes is not judged.

Data that changes with each exchange is what no drive has, and so is an answer that comes twice, the second with other
data: where the first is lost, it is taken for the answer.
"""
PLANS = Path(__file__).with_name("plans.jsonl")
"""Conversations about which the report once said something untrue, one plan a line,"""
WITH_HOLES = PLANS.with_name("plans_with_holes.jsonl")
"""and those of which it did where they have holes."""
ON_WIRES = PLANS.with_name("plans_on_wires.json")
"""Conversations over wires of which version 999b3260 said something untrue: three plans of each kind."""


def plan(text: str) -> Plan:
    """A plan from its JSON."""
    known = json.loads(text)
    if "mtu" in known:
        return lossy.plan(known)
    if "servers" in known:
        return partners.plan(known)
    if "tags" in known:
        return machines.plan(known)
    return lines.plan(known) if "stations" in known else conversations.plan(known)


def play(planned: Plan) -> Conversation:
    """The conversation of a plan."""
    match planned:
        case lossy.Plan():
            return lossy.play(planned)
        case lines.Plan():
            return lines.play(planned)
        case partners.Plan():
            return partners.play(planned)
        case machines.Plan():
            return machines.play(planned)
    return conversations.play(planned)


def kept(path: Path = PLANS) -> list[Plan]:
    """The plans that once had a complaint."""
    return [plan(line) for line in path.read_text(encoding="utf-8").splitlines()]


def of_wires() -> dict[str, list[lossy.Plan]]:
    """The plans of each kind that once had a complaint."""
    kinds = json.loads(ON_WIRES.read_text(encoding="utf-8"))
    return {kind: [lossy.plan(each) for each in plans] for kind, plans in kinds.items()}


def planned(count: int, number: int, *, wires: bool = True) -> list[Plan]:
    """So many plans of a seed. Every third is a line of PROFIBUS, every twelfth a conversation of S7, or of machines.

    `wires`: every sixth is a conversation over a wire. Of what such a one loses nothing is the whole.
    """
    random, lossy_ones = Random(number), Random(f"wires {number}")
    of_s7, cyclic = Random(f"partners {number}"), Random(f"machines {number}")
    found = list[Plan]()
    for at in range(count):
        each: Plan = lines.planned(random) if at % 3 == 0 else conversations.planned(random)
        if wires and at % 6 == 5:
            each = lossy.planned(lossy_ones)
        elif at % 12 == 1:
            each = partners.planned(of_s7)
        elif at % 12 == 7:
            each = machines.planned(cyclic)
        found.append(each)
    return found


def of_plan(plan: Plan, folder: Path) -> list[Complaint]:
    """What is not so in the report of a conversation."""
    made = play(plan)
    path = folder / "conversation.pcap"
    made.tape.write(path)
    if isinstance(made, lossy.Conversation):
        return list(ends.of(made, folder))
    if isinstance(made, partners.Conversation):
        return list(partners.of(made, folder))
    if isinstance(made, machines.Conversation):
        return list(machines.of(made, folder))
    return run.audit(path, made.drives)


def whole(plan: Plan) -> Plan:
    """The same without what its capture loses, for that others cut it."""
    if isinstance(plan, lossy.Plan | machines.Plan):
        return plan
    if isinstance(plan, partners.Plan):
        return replace(plan, twice=0.0, late=0.0, tpdu=None)
    if isinstance(plan, lines.Plan):
        nothing = dict.fromkeys(("loss", "noise", "trouble"), 0.0)
        return replace(plan, snap=None, doubled=False, back=False, **nothing)
    return replace(plan, loss=0.0, copies=0.0, snap=None)


def of_cuts(plan: Plan, folder: Path) -> list[Complaint]:
    """What is not so in the reports of a conversation with holes of two kinds."""
    path = folder / "whole.pcap"
    play(whole(plan)).tape.write(path)
    if isinstance(plan, lines.Plan):
        found = holes.of(path, cuts.two(plan.seed, OF_LINES))
        return [each for each in found if not each.rule.startswith(UNTOLD)]
    other = folder / "other.pcap"
    play(replace(whole(plan), seed=plan.seed + 1)).tape.write(other)
    return [*holes.of(path, cuts.two(plan.seed)), *holes.merged(path, other)]


def over(plans: list[Plan], *, cut: bool = False) -> Iterator[tuple[Plan, list[Complaint]]]:
    """The complaints of each conversation that has any."""
    with tempfile.TemporaryDirectory() as folder:
        for plan in plans:
            try:
                found = (of_cuts if cut else of_plan)(plan, Path(folder))
            except Exception:  # noqa: BLE001 (the others are read all the same)
                found = [Complaint("crash", "", format_exc())]
            if found:
                yield whole(plan) if cut else plan, found


def everywhere(
    count: int, number: int, *, cut: bool = False
) -> Iterator[tuple[Plan, list[Complaint]]]:
    """The same by all processors. A worker ends after its share: analyses leave memory behind."""
    sizes = [min(SHARE, count - start) for start in range(0, count, SHARE)]
    with ProcessPoolExecutor(max_tasks_per_child=1) as pool:
        seeds = range(number, number + len(sizes))
        for found in pool.map(_share, sizes, seeds, repeat(cut)):
            yield from found


def _share(count: int, number: int, cut: bool) -> list[tuple[Plan, list[Complaint]]]:
    return list(over(planned(count, number, wires=not cut), cut=cut))
