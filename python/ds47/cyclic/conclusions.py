"""What only the whole capture shows of the cyclic channels: habits, operation, why a change was not accepted.

Gathers what `habits`, `operation` and `explanation` have to say, and of whom: tables and bits are those of one
maker, so that what is said of the drives of others is a note (docs/cyclic.md 5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from ds47.cyclic import judge
from ds47.cyclic.channels import CyclicChannels
from ds47.cyclic.explanation import explain, turned_down
from ds47.cyclic.habits import Habits
from ds47.cyclic.handshake import END, INCOMPLETE, PkwJob
from ds47.cyclic.relations import CyclicRelation
from ds47.findings.remark import Remark
from ds47.model import Transaction
from ds47.spec.semantics import Limits

_OF_ITS_MAKER = ("DS508",)
"""AK 11 to 14, which save, are an extension of the maker of these tables."""
DriveKey = tuple[str, str, int | None, int | None]


class Conclusions:
    """What is kept of transactions until the capture is over.

    Args:
        bounds: how much is too much.
        layout: of IND, by the address of a device.
        channels: those of the capture.
    """

    def __init__(
        self, bounds: Limits, layout: Callable[[str], str], channels: CyclicChannels
    ) -> None:
        self._bounds = bounds
        self._layout = layout
        self.channels = channels
        self._habits: dict[DriveKey, tuple[CyclicRelation, Habits]] = {}
        self._incomplete: dict[tuple[str, str, str], tuple[int, int]] = {}
        """By why, controller and device: how many requests may lack their responses, and the first frame."""

    def reported(self, relation: CyclicRelation, job: PkwJob) -> None:
        """A transaction of PKW that the report has is over: whether the capture lacks a part of it."""
        if job.state == INCOMPLETE:
            what, frame = "file_ends" if job.ends else "cyclic_gaps", job.request.at.frame
            who = what, relation.controller, relation.device
            count, first = self._incomplete.get(who, (0, frame))
            self._incomplete[who] = count + 1, min(first, frame)

    def exchanged(self, relation: CyclicRelation, job: PkwJob) -> list[Remark]:
        """A transaction of PKW that is over, and what is wrong with it."""
        layout = self._layout(relation.device)
        found = [*judge.remarks(relation, job, layout), *self._habits_of(relation).take(job)]
        if job.reason == END and job.is_ignored and job.stood >= self._bounds.pkw_cycles:
            found += judge.unanswered(relation, job, layout)
        return list(_about(relation, found))

    def transaction(self, item: Transaction) -> list[Remark]:
        """A transaction of any channel that is over: whether the state of its drive explains it."""
        found = turned_down(item)
        remark = found and explain(found, self.channels.drives())
        return [remark] if remark else []

    def finish(self) -> Iterator[Remark]:
        """Everything else."""
        for each in self.channels.mixed:
            args = {"device": each.device, "sender": each.sender, "frame_id": each.frame_id}
            yield Remark("DS515", each.frame, args)
        count, first = self.channels.late
        if count:
            yield Remark("DS725", first, {"what": "disorder", "count": count})
        for relation, job in self.channels.unanswered():
            self.reported(relation, job)
        for (what, controller, device), (count, first) in self._incomplete.items():
            who = {"controller": controller, "device": device}
            yield Remark("DS725", first, {"what": what, "count": count, **who})
        for drive in self.channels.drives():
            if drive.holes:
                who = {"controller": drive.relation.controller, "device": drive.relation.device}
                args = {"what": "cyclic_holes", "count": drive.holes, **who}
                yield Remark("DS725", drive.first_hole, args)
            yield from _about(drive.relation, drive.remarks())
        for relation, habits in self._habits.values():
            yield from _about(relation, habits.finish())
        for relation, job in self.channels.unanswered():
            if job.ends:
                continue
            ignored = judge.unanswered(relation, job, self._layout(relation.device))
            yield from _about(relation, ignored)
        for relation in self.channels.unused():
            if not relation.is_foreign and relation.frame is not None:
                where = {"device": relation.device, "slot": relation.slot}
                yield Remark("DS512", relation.frame, where)

    def _habits_of(self, relation: CyclicRelation) -> Habits:
        if relation.drive_key not in self._habits:
            where = {"device": relation.device, "slot": relation.slot, "family": relation.drives}
            layout = self._layout(relation.device)
            self._habits[relation.drive_key] = relation, Habits(where, self._bounds, layout)
        return self._habits[relation.drive_key][1]


def _about(relation: CyclicRelation, remarks: Iterable[Remark]) -> Iterator[Remark]:
    """Remarks with their drive; those based on the tables of a maker apply to its drives only."""
    for each in remarks:
        if each.rule not in _OF_ITS_MAKER or not relation.is_foreign:
            each.of = relation
            yield each
