"""What PROFIBUS adds to an analysis: its line, its stations, records over MS1 and MS2, and PPOs.

Created with the first frame of a line, because few captures have one. The steps are modules of their own; this one
only joins them, as `analysis` joins those of PROFINET.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ds47.acyclic.ms1_calls import Ms1Calls, StartUps
from ds47.acyclic.services import ServiceTracker
from ds47.cyclic.ppo import PpoFeed
from ds47.profibus.bus import BusTracker, ExchangeListener
from ds47.profibus.idents import Idents
from ds47.profibus.judge import LineJudge
from ds47.profibus.stations import LineStations
from ds47.profinet.completeness import STATION

if TYPE_CHECKING:
    from ds47.acyclic.pairing import Outcome, Pairing
    from ds47.acyclic.record_events import RecordEvents
    from ds47.capture import Frame
    from ds47.cyclic.channels import CyclicChannels
    from ds47.findings.remark import Remark
    from ds47.model import Bus
    from ds47.profibus.line import Exchange
    from ds47.spec.semantics import Limits


class ProfibusLine:
    """The line of a capture.

    Args:
        limits: numbers of spec/limits.toml.
        events: hears of records.
        pairing: hears of stations that start up.
        outcomes: gets findings about services, and answered Writes to an index that is not ours.
        cyclic: takes PPOs.
        ppos: station address -> number of its PPO, for captures without Chk_Cfg.
        vendor_id: of stations whose ident number does not tell it; None: nobody's.
    """

    def __init__(
        self,
        limits: Limits,
        events: RecordEvents,
        pairing: Pairing,
        outcomes: list[Outcome],
        cyclic: CyclicChannels,
        ppos: dict[int, int],
        vendor_id: int | None = None,
    ) -> None:
        self._judge = LineJudge(limits)
        self._stations = LineStations(self._judge.heard)
        idents = Idents(vendor_id)
        self._ms1 = Ms1Calls(events, outcomes, self._judge, idents)
        self._services = ServiceTracker()
        self._start_ups = StartUps(pairing.started)
        ppo = PpoFeed(cyclic, ppos, idents)
        listeners = (
            ExchangeListener(idents.take, Idents.SERVICES), ExchangeListener(self._stations.take),
            ExchangeListener(self._start_ups.take, StartUps.SERVICES),
            ExchangeListener(self._record, ServiceTracker.SERVICES), ExchangeListener(ppo.take, PpoFeed.SERVICES),
        )  # fmt: skip
        self._bus = BusTracker(listeners, self._stations.frame)
        self.line = self._bus.line

    def take(self, frame: Frame) -> None:
        """A frame of one of the link types of PROFIBUS."""
        cut = len(frame.data) < frame.original_length
        self._bus.take(frame.link_type, frame.data, frame.number, frame.time_ns, cut)

    def finish(self) -> None:
        """The capture is over."""
        self._bus.finish()
        self._stations.finish(self.line.paused())
        for became in self._services.finish():
            self._ms1.take(became)

    def _record(self, exchange: Exchange) -> None:
        for became in self._services.take(exchange):
            self._ms1.take(became)

    def remarks(self) -> Iterator[Remark]:
        """The findings about the line when the capture is over."""
        return self._judge.finish(self._stations)

    def result(self, timed: bool) -> Bus | None:
        """The line for the result; `timed`: whether the recording has times."""
        return self._stations.result(self.line.stray, self.line.echoes, timed)

    def unseen(self, device: str) -> int:
        """The newest frame after a possible gap in the traffic of a station; 0 for none."""
        return max(self.line.unsure, self.line.lost(int(device.removeprefix(STATION))))

    def was_never_written(self, device: str, index: int, frame: int) -> bool:
        """Whether the capture has the start-up of a station, and no Write to this index since."""
        seen = self._start_ups.seen(device, frame, self.unseen(device))
        return seen and not self._ms1.was_written(device, index, frame)
