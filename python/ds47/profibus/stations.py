"""What the stations of a line did: counts, times, what Set_Prm, Chk_Cfg, Slave_Diag said (docs/profibus.md 7).

Hears of the frames and the exchanges of a line. What is wrong with it is the business of `judge`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ds47.model import Bus, BusStation, Span, StationDiagnosis
from ds47.profibus import dp
from ds47.profibus.line import CUT, Exchange, LineFrame
from ds47.profibus.telegram import SC, SD4
from ds47.spec import profibus

MOST_FRAMES = 60
"""Frames that are kept of what happens again and again."""
_CHECK = "check"


@dataclass(slots=True, eq=False)
class Counted:
    """How often something happened, and in which frames: the first ones."""

    count: int = 0
    frames: list[int] = field(default_factory=list)

    def add(self, frame: int, count: int = 1) -> None:
        """It happened again."""
        if len(self.frames) < MOST_FRAMES:
            self.frames.append(frame)
        self.count += count

    def leave_out(self, frame: int) -> None:
        """It may not have happened there; of more than are kept, the frame is not among them."""
        self.count -= 1
        if frame in self.frames:
            self.frames.remove(frame)


@dataclass(slots=True, eq=False)
class Times:
    """Times in nanoseconds, without keeping them."""

    count: int = 0
    least: int = 0
    total: int = 0
    most: int = 0

    def add(self, time_ns: int) -> None:
        """A time; a negative one, which a clock that was set back leaves, is none."""
        if time_ns < 0:
            return
        self.least = min(self.least, time_ns) if self.count else time_ns
        self.most = max(self.most, time_ns)
        self.count += 1
        self.total += time_ns

    def span(self) -> Span | None:
        """The least, the mean and the most; None without any."""
        return Span(self.least, self.total // self.count, self.most) if self.count else None


@dataclass(slots=True, eq=False)
class Wanting:
    """Answers in a row in which a station asks for Slave_Diag, until the master fetches it."""

    asked: int = 0
    """How often it began to ask,"""
    fetched: int = 0
    """how often the diagnosis was read after that,"""
    longest: Counted = field(default_factory=Counted)
    """and the longest row of answers that asked for it."""
    row: Counted = field(default_factory=Counted)

    def answered(self, wants: bool, frame: int) -> None:
        """An answer of data exchange."""
        if not wants:
            if self.row.count:
                self.row = Counted()
            return
        self.asked += not self.row.count
        self.row.add(frame)
        if self.row.count > self.longest.count:
            self.longest = self.row

    def read(self) -> None:
        """The diagnosis was read."""
        self.fetched += self.row.count > 0
        self.row = Counted()


@dataclass(slots=True, eq=False)
class LineStation:
    """A station of a line."""

    address: int
    asks: bool = False
    """Whether it is a master."""
    asked: int = 0
    """Requests to it that expect an answer, except FDL_Status to a missing station,"""
    silent: Counted = field(default_factory=Counted)
    """those without an answer, as the next request of its master shows,"""
    unheard: dict[int | None, LineFrame] = field(default_factory=dict)
    """the one of each master of which that is not known yet,"""
    missing: Counted = field(default_factory=Counted)
    """and those whose answer is not in the capture, though their master had it,"""
    gaps: Counted = field(default_factory=Counted)
    """and those before which an exchange is not, as their FCB shows;"""
    damaged: Counted = field(default_factory=Counted)
    """damaged frames in the place of answers, of which those are none,"""
    retries: Counted = field(default_factory=Counted)
    """and requests that repeat another one,"""
    paused: int = 0
    """of them the newest behind what was the longest pause until then."""
    copies: int = 0
    """How many repetitions are left where each frame stands there twice,"""
    copied: int = 0
    """and how many of the damaged frames are not."""
    answers: Times = field(default_factory=Times)
    """From request to answer,"""
    cycles: Times = field(default_factory=Times)
    """and from one data exchange to the next."""
    exchanges: int = 0
    lengths: tuple[int, int] | None = None
    """Bytes of the last data exchange, to it and from it."""
    last_exchange: LineFrame | None = None
    """Since its last Set_Prm."""
    last_asked: LineFrame | None = None
    """The same, of those that it refused, too."""
    wanting: Wanting = field(default_factory=Wanting)
    parameters: dp.Parameters | None = None
    parameters_frame: int | None = None
    parameters_master: int | None = None
    """The newest Set_Prm that was answered,"""
    configuration: dp.Configuration | None = None
    configuration_frame: int | None = None
    """Chk_Cfg,"""
    hole: int = 0
    """The last request before which something was not seen."""
    unsure: dict[str | None, int] = field(default_factory=dict)
    """Services with an unanswered newest request, by its frame: it is unknown whether it was accepted."""
    diagnosis: dp.SlaveDiagnosis | None = None
    diagnosis_frame: int | None = None
    """and answer to Slave_Diag."""

    def knows(self, service: str, frame: int | None) -> bool:
        """Whether its Set_Prm or Chk_Cfg in a frame is surely the newest one."""
        return frame is not None and service not in self.unsure and self.hole <= frame

    def settle(self, copied: bool, paused: int) -> None:
        """Once nothing more comes, it is known whether the recording has each frame twice, and the longest pause.

        `paused` is a request that may stand behind a hole, and then is no retry.
        """
        if copied:
            self.retries.count = self.copies
            self.damaged.count -= self.copied
        if paused and paused == self.paused:
            self.retries.leave_out(paused)

    def result(self, timed: bool) -> BusStation:
        """The station in the form of the report, with times if `timed`."""
        diagnosis, set_up, configured = self.diagnosis, self.parameters, self.configuration
        ident = set_up.ident if set_up else diagnosis.ident if diagnosis else None
        outputs, inputs = self.lengths or (None, None)
        return BusStation(
            self.address, "master" if self.asks else "slave", ident,
            None if configured is None else configured.ppo,
            None if set_up is None else set_up.watchdog_ms,
            self.asked, self.silent.count, self.damaged.count, self.retries.count,
            self.exchanges, outputs, inputs, self.cycles.span() if timed else None,
            self.answers.span() if timed else None,
            self.wanting.asked, self.wanting.fetched,
            self.parameters_frame, self.configuration_frame,
            None if diagnosis is None or self.diagnosis_frame is None else StationDiagnosis(
                self.diagnosis_frame, list(diagnosis.flags), diagnosis.master, diagnosis.ident,
                [each.data for each in diagnosis.blocks],
            ),
        )  # fmt: skip


class LineStations:
    """Takes the frames and the exchanges of a line.

    `heard`: gets each exchange with an answer, and its station before the exchange counts there.
    """

    def __init__(self, heard: Callable[[LineStation, Exchange, LineFrame], None]) -> None:
        self._heard = heard
        self._stations: dict[int, LineStation] = {}
        self.frames = 0
        self.tokens = 0
        self.check = Counted()
        """Frames with a wrong check byte,"""
        self.broken = Counted()
        """and those that are damaged otherwise."""
        self.doubled = 0
        """Answers that stand there twice: a recording of two places has everything twice,"""
        self.answers = 0
        """and how many there are."""
        self.cut = False
        """Whether the recording did not keep all of each frame."""
        self._answer: bytes | None = None

    @property
    def copied(self) -> bool:
        """Whether the line was recorded at two places: so many answers stand there twice."""
        return 0 < self.answers <= 3 * self.doubled

    def station(self, address: int) -> LineStation:
        """The station with this address."""
        found = self._stations.get(address)
        if found is None:
            found = self._stations[address] = LineStation(address)
        return found

    def all(self) -> list[LineStation]:
        """All that were seen, by address."""
        return [self._stations[address] for address in sorted(self._stations)]

    def finish(self, paused: int) -> None:
        """No frame comes any more; `paused` is the request behind the one long pause, 0 for none."""
        for station in self.all():
            station.settle(self.copied, paused)

    def result(self, stray: int, echoes: int, timed: bool) -> Bus | None:
        """The line in the form of the report; None without frames.

        Args:
            stray: answers without a request.
            echoes: stray answers directly after the same answer.
            timed: whether the recording has times.
        """
        if not self.frames:
            return None
        stations = [each.result(timed) for each in self.all() if each.asks or each.asked]
        damaged = self.check.count + self.broken.count
        stray -= echoes if self.copied else 0
        return Bus(self.frames, self.tokens, damaged, stray, stations)

    def frame(self, seen: LineFrame, cut: bool) -> None:
        """A frame, before what it belongs to is known.

        Args:
            seen: the frame.
            cut: whether the recording did not keep all of it; that is no fault of the line.
        """
        self.frames += 1
        self.cut = self.cut or cut
        item, front = seen.item, seen.item.front
        if item.flaws:
            kinds = {each.kind for each in item.flaws}
            if not (cut and CUT in kinds):
                (self.check if _CHECK in kinds else self.broken).add(seen.frame)
        elif front.kind == SD4 and front.sa is not None:
            self.tokens += 1
            self.station(front.sa).asks = True
        elif not front.request:
            self.answers += 1
            self.doubled += item.data == self._answer
        self._answer = None if front.request else item.data

    def take(self, exchange: Exchange) -> None:
        """An exchange that is over."""
        front = exchange.request.item.front
        if front.sa is None or front.da is None:
            return
        self.station(front.sa).asks = True
        if exchange.silent:
            return
        answer, probe = exchange.answer, profibus.probes(front.code)
        if not probe and front.da in self._stations:
            _settle(self._stations[front.da], exchange)
        if answer is None and (probe or exchange.unfinished):
            return
        station = self.station(front.da)
        _count(station, exchange)
        if answer is not None:
            self._heard(station, exchange, answer)
            _keep(station, exchange, answer)


def _keep(station: LineStation, exchange: Exchange, answer: LineFrame) -> None:
    """What an exchange with an answer says of the station."""
    name, item = exchange.request.item.front.service, answer.item
    station.unsure.pop(name, None)
    if dp.refuses(item):
        if name == dp.EXCHANGE:
            _cycle(station, exchange)
        return
    if name == dp.EXCHANGE:
        if item.front.exchanges or item.kind == SC:  # SC: of a station without inputs
            _exchanged(station, exchange, answer)
    elif name == dp.PARAMETERS:
        sent = dp.decode(exchange.request.item)
        assert isinstance(sent, dp.Parameters)
        station.parameters, station.parameters_frame = sent, exchange.request.frame
        station.parameters_master = exchange.request.item.sa
        station.last_exchange = station.last_asked = None
    elif name == dp.CONFIGURATION:
        station.configuration = dp.configuration(exchange.request.item.du)
        station.configuration_frame = exchange.request.frame
    elif name == dp.DIAGNOSIS and item.du:
        diagnosis = dp.decode(item)
        if isinstance(diagnosis, dp.SlaveDiagnosis):
            station.diagnosis, station.diagnosis_frame = diagnosis, answer.frame
            station.wanting.read()


def _settle(station: LineStation, exchange: Exchange) -> None:
    """What a request shows of the one before: a master turns the FCB round where it had the answer."""
    seen, front = exchange.request, exchange.request.item.front
    before = station.unheard.pop(seen.item.sa, None)
    if before is not None and front.fcv == 0:
        station.silent.add(before.frame)
    elif before is not None and front.fcb != before.item.front.fcb:
        station.missing.add(before.frame)
    if exchange.hole == seen.frame:
        station.gaps.add(seen.frame)
    if exchange.hole == seen.frame or (before is not None and front.fcv == 1):
        station.hole = seen.frame


def _count(station: LineStation, exchange: Exchange) -> None:
    seen, answer = exchange.request, exchange.answer
    station.asked += 1
    if exchange.again:
        station.retries.add(seen.frame)
    if exchange.retried:
        for each in exchange.retries:
            station.retries.add(each.frame)
        station.retries.count += exchange.retried - len(exchange.retries)
    station.copies += exchange.retried // 2 + exchange.again
    station.paused = exchange.paused or station.paused
    if exchange.damaged:
        station.damaged.add(exchange.damaged, exchange.spoiled)
        station.copied += exchange.copied
    elif answer is None and not exchange.cut:
        station.unheard[seen.item.sa] = seen
    if answer is None:
        station.unsure[seen.item.front.service] = seen.frame
    # With more retries than are kept, the time of the last one is unknown.
    if answer is not None and exchange.retried <= len(exchange.retries):
        last = exchange.retries[-1] if exchange.retries else seen
        station.answers.add(answer.time_ns - last.time_ns)


def _cycle(station: LineStation, exchange: Exchange) -> None:
    """Since the data exchange before, also where the station refuses this one: it may have waited too long."""
    seen, last = exchange.request, station.last_asked
    if last is not None and not exchange.again:
        station.cycles.add(seen.time_ns - last.time_ns)
    station.last_asked = seen


def _exchanged(station: LineStation, exchange: Exchange, answer: LineFrame) -> None:
    _cycle(station, exchange)
    station.last_exchange = exchange.request
    station.exchanges += 1
    station.lengths = len(exchange.request.item.du), len(answer.item.du)
    station.wanting.answered(answer.item.front.wants, answer.frame)
