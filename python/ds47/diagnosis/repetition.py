"""Diagnoses of what a program does again and again: REQ held (DS723) and polling storms (DS724)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator

from ds47.acyclic.pairing import Job
from ds47.findings.remark import Remark
from ds47.profinet.records import NO_API, Half
from ds47.spec.semantics import known

_MS = 1_000_000
Channel = tuple[str, str, bytes, tuple[int, int, int, int]]
"""Controller, device, AR, and the place: API, slot, subslot and index."""
_GAPS = 256
"""Periods kept of one run: enough to say whether they are equal."""


def place_args(place: tuple[int, int, int, int]) -> dict[str, int | None]:
    """API, slot, subslot and index as an argument of a finding."""
    api, slot, subslot, index = place
    return {"slot": slot, "subslot": None if api == NO_API else subslot, "index": index}


class _Run:
    """The same change, as long as nothing else is written on its channel."""

    __slots__ = ("count", "data", "first", "gaps", "newest_ns")

    def __init__(self, data: bytes, frame: int, time_ns: int) -> None:
        self.data, self.first, self.newest_ns = data, frame, time_ns
        self.count, self.gaps = 1, list[int]()

    def add(self, time_ns: int) -> None:
        self.count += 1
        if len(self.gaps) < _GAPS:
            self.gaps.append(time_ns - self.newest_ns)
        self.newest_ns = time_ns

    def period_ns(self) -> int | None:
        """The period of two changes at least, if it is a fixed one."""
        middle = sorted(self.gaps)[(len(self.gaps) - 1) // 2]
        jitter = middle * known().held_jitter // 100
        if not 0 < middle <= known().held_period * _MS or any(
            abs(gap - middle) > jitter for gap in self.gaps
        ):
            return None
        return middle


class _Storm:
    """Transactions in a row that were polled many times."""

    __slots__ = ("first", "gaps", "gaps_ns", "jobs", "polls", "taken_ns", "total")

    def __init__(self) -> None:
        self.jobs = self.polls = self.taken_ns = self.first = self.total = 0
        self.gaps = self.gaps_ns = 0
        """Between the Reads: their number and their sum."""


class Repetition:
    """Looks at the changes and the polls of every channel."""

    def __init__(self) -> None:
        self._runs: OrderedDict[Channel, _Run] = OrderedDict()
        self.storms: OrderedDict[Channel, _Storm] = OrderedDict()
        """Those that the next job of a channel may end."""
        self._found: list[Remark] = []

    def asked(self, job: Job, place: tuple[int, int, int, int]) -> None:
        """The Write request of a change, in the order of the capture: jobs are not closed in that order."""
        asked = job.write_request
        if asked is not None:
            key = (job.peer.controller, job.peer.device, job.record.ar, place)
            self._change(key, asked.data, asked.frame, asked.time_ns)

    def closed(self, job: Job, place: tuple[int, int, int, int]) -> None:
        """A job that was asked is over."""
        key = (job.peer.controller, job.peer.device, job.record.ar, place)
        polls = job.not_ready
        if len(polls) < known().storm_polls:
            self.calm(key)
        else:
            self._polled(job, polls, key)

    def finish(self) -> Iterator[Remark]:
        """What was found, and what goes on to the end of the capture."""
        for key, run in self._runs.items():
            self._end_run(key, run)
        for key, storm in self.storms.items():
            self._end_storm(key, storm)
        yield from self._found

    def _change(self, key: Channel, request: bytes, frame: int, time_ns: int) -> None:
        run = self._runs.get(key)
        data = request[1:]
        if run is not None and run.data == data:
            run.add(time_ns)
            return
        if run is not None:
            self._end_run(key, run)
        self._runs[key] = _Run(data, frame, time_ns)
        if len(self._runs) > known().history:
            self._end_run(*self._runs.popitem(last=False))

    def _end_run(self, key: Channel, run: _Run) -> None:
        period = run.period_ns() if run.count >= known().held else None
        if period is not None and len(self._found) < known().history:
            args = {
                "count": run.count,
                "device": key[1],
                "period": period / _MS,
                "place": place_args(key[3]),
            }
            self._found.append(Remark("DS723", run.first, args))

    def calm(self, key: Channel) -> None:
        """A job on a channel that was not polled many times."""
        storm = self.storms.pop(key, None)
        if storm is not None:
            self._end_storm(key, storm)

    def _polled(self, job: Job, polls: list[tuple[Half | None, Half]], key: Channel) -> None:
        storm = self.storms.get(key)
        if storm is None:
            storm = self.storms[key] = _Storm()
            if len(self.storms) > known().history:
                self._end_storm(*self.storms.popitem(last=False))
        first, last = polls[0], polls[-1]
        began = (first[0] or first[1]).time_ns
        asked, read = job.write_request, job.read_response or last[1]
        storm.first = storm.first or (first[0] or first[1]).frame
        storm.jobs += 1
        storm.polls += len(polls)
        reads = [request or answer for request, answer in polls]
        if job.read_response is not None:
            reads.append(job.read_request or job.read_response)
        storm.gaps += len(reads) - 1
        storm.gaps_ns += max(0, reads[-1].time_ns - reads[0].time_ns)
        storm.taken_ns += max(0, read.time_ns - (asked.time_ns if asked else began))
        storm.total = max(storm.total, len(polls))

    def _end_storm(self, key: Channel, storm: _Storm) -> None:
        facts = known()
        enough = storm.jobs >= facts.storm_jobs or storm.total >= facts.storm_total
        if enough and len(self._found) < facts.history:
            args = {
                "count": storm.polls,
                "device": key[1],
                "period": storm.gaps_ns / storm.gaps / _MS,
                "time": storm.taken_ns / storm.jobs / _MS,
            }
            self._found.append(Remark("DS724", storm.first, args))
