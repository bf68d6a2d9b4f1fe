"""What only the whole capture shows of the cyclic channels: habits, operation, why a change was not accepted.

Gathers what `habits`, `operation` and `explanation` have to say, and decides whom it is said of: tables and
bits are those of one maker, and of other drives nothing is said (docs/cyclic.md 7).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ds47.cyclic import judge
from ds47.cyclic.channels import CyclicChannels
from ds47.cyclic.explanation import explain, turned_down
from ds47.cyclic.habits import Habits
from ds47.cyclic.handshake import Job
from ds47.cyclic.relations import Relation
from ds47.findings.remark import Remark
from ds47.model import Transaction
from ds47.spec.semantics import Limits

Place = tuple[str, str, int | None, int | None]


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
        self._channels = channels
        self._habits: dict[Place, Habits] = {}

    def exchanged(self, relation: Relation, job: Job) -> list[Remark]:
        """A transaction of PKW that is over, and what is wrong with it."""
        if not relation.is_judged:
            return []
        found = list(judge.remarks(relation, job, self._layout(relation.device)))
        return [*found, *self._habits_of(relation).take(job)]

    def transaction(self, item: Transaction) -> list[Remark]:
        """A transaction of any channel that is over: whether the state of its drive explains it."""
        found = turned_down(item)
        remark = found and explain(found, self._channels.drives())
        return [remark] if remark else []

    def finish(self) -> Iterator[Remark]:
        """Everything else."""
        for drive in self._channels.drives():
            if drive.relation.is_judged:
                yield from drive.remarks()
        for habits in self._habits.values():
            yield from habits.finish()
        for relation, job in self._channels.unanswered():
            if relation.is_judged:
                yield from judge.unanswered(relation, job, self._layout(relation.device))
        for relation in self._channels.unused():
            if relation.is_judged and relation.frame is not None:
                where = {"device": relation.device, "slot": relation.slot}
                yield Remark("DS512", relation.frame, where)

    def _habits_of(self, relation: Relation) -> Habits:
        if relation.place not in self._habits:
            where = {"device": relation.device, "slot": relation.slot, "family": relation.drives}
            layout = self._layout(relation.device)
            self._habits[relation.place] = Habits(where, self._bounds, layout)
        return self._habits[relation.place]
