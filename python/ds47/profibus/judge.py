"""What is wrong on a line: frames, stations, start-up and services to findings DS8xx (docs/profibus.md 8).

A repeated problem is one remark with a count; all are reported at the end of the capture. `stations` has the
stations and what is known about them. Problems of DS47 transactions are not here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from ds47.findings.remark import Remark
from ds47.profibus import dp
from ds47.profibus.line import Exchange, LineFrame
from ds47.profibus.stations import Counted, LineStation, LineStations
from ds47.spec.semantics import Limits
from ds47.spec.statuses import status_hex

_NOT_ENABLED: Final = 3
"""The code of an answer that says that the SAP is not enabled (RS)."""
_REFUSALS: Final = {1: "UE", 2: "RR", 3: "RS"}
"""The codes of answers that refuse a request, by their names."""
_OF_RECORDS = (dp.RECORD, dp.ALARM)
_FAULTS = {"prm_fault": "diag_prm_fault", "cfg_fault": "diag_cfg_fault"}


def name(address: int) -> str:
    """How the report names a station: `dp3`."""
    return f"dp{address}"


@dataclass(slots=True, eq=False)
class _Noted:
    """Something that is wrong, in the frame in which it shows first."""

    remark: Remark
    counted: Counted = field(default_factory=Counted)


def _set_up(station: LineStation) -> dp.Parameters | None:
    """The last Set_Prm, if it surely was."""
    sure = station.knows(dp.PARAMETERS, station.parameters_frame)
    return station.parameters if sure else None


def _remark(rule: str, counted: Counted, **args: Any) -> Remark:
    """Something that happened in these frames."""
    more = {"count": counted.count, "frames": counted.frames}
    return Remark(rule, counted.frames[0], args | more)


class LineJudge:
    """Hears what stations say, and what becomes of records.

    `bounds`: how much is too much, and how many things are kept apart.
    """

    def __init__(self, bounds: Limits) -> None:
        self._bounds = bounds
        self._noted: dict[tuple[Any, ...], _Noted] = {}
        self._series: dict[tuple[int, str], tuple[int | None, dict[str, Any]]] = {}
        """Of a station and a refusal the last data exchange before, and what is said of the first one since."""

    def heard(self, station: LineStation, exchange: Exchange, answer: LineFrame) -> None:
        """An exchange with an answer, before the station is what it makes of it."""
        item, at = exchange.request.item, exchange.request.frame
        service = item.front.service
        if answer.item.front.code == _NOT_ENABLED and item.dsap is not None:
            self._not_enabled(station, item.dsap, service, answer.frame)
        if dp.refuses(answer.item):
            if service == dp.EXCHANGE:
                self._exchange_refused(station, exchange.request, answer)
            elif answer.item.front.code != _NOT_ENABLED:
                self._service_refused(station, item.dsap, answer)
            return
        if service == dp.EXCHANGE:
            self._lengths(station, item.du, answer)
        elif service == dp.PARAMETERS:
            sent = dp.decode(item)
            if isinstance(sent, dp.Parameters):
                self._parameters(station, sent, at)
        elif service == dp.CONFIGURATION:
            self._configuration(station, dp.configuration(item.du), at)
        elif service == dp.DIAGNOSIS:
            found = dp.decode(answer.item)
            if isinstance(found, dp.SlaveDiagnosis):
                self._diagnosis(station, found, item.sa, answer.frame)

    def refused(
        self, station: int, write: bool, slot: int, index: int, status: int, frame: int
    ) -> None:
        """A record that is not of DS47 was refused (docs/profibus.md 4)."""
        what = {
            "operation": "DS_Write" if write else "DS_Read", "status": status_hex(status),
            "place": {"slot": slot, "subslot": None, "index": index},
        }  # fmt: skip
        self._note("DS806", station, frame, what, (write, slot, index, status))

    def answered(self, station: int, polls: int, frame: int) -> None:
        """An answer came after so many polls."""
        if polls > self._bounds.bus_polls:
            args = {"limit": self._bounds.bus_polls, "polls": polls}
            noted = self._note("DS807", station, frame, args)
            if noted is not None and noted.remark.args["polls"] < polls:
                noted.remark.args["polls"] = polls
                noted.remark.frame = frame

    def finish(self, stations: LineStations) -> Iterator[Remark]:
        """All that was wrong, when nothing more comes."""
        for rule, counted in (("DS801", stations.check), ("DS802", stations.broken)):
            if counted.count:
                yield _remark(rule, counted)
        asked = stations.cut or any(each.asks for each in stations.all())
        if stations.answers and not asked:
            yield Remark("DS725", 1, {"what": "bus_requests", "count": stations.answers})
        for station in stations.all():
            yield from self._counted(station, stations.copied)
        for noted in self._noted.values():
            noted.remark.args |= {"count": noted.counted.count, "frames": noted.counted.frames}
            yield noted.remark

    def _counted(self, station: LineStation, copied: bool) -> Iterator[Remark]:
        """What only counts show.

        The same request again is surely a repetition neither in a recording of two places nor where exchanges or
        answers are missing: there it may be a later one.
        """
        device, of = name(station.address), station.asked
        sure = not (copied or station.hole)
        for rule, counted in (("DS803", station.retries), ("DS804", station.silent)):
            if counted.count and (sure or rule != "DS803"):
                yield _remark(rule, counted, device=device, of=of)
        for what, counted in (("bus_answers", station.missing), ("bus_exchanges", station.gaps)):
            if counted.count:
                args = {"what": what, "count": counted.count, "device": device}
                yield Remark("DS725", counted.frames[0], args)
        if station.wanting.longest.count >= self._bounds.bus_diagnosis:
            yield _remark("DS812", station.wanting.longest, device=device)

    def _note(
        self, rule: str, station: int, frame: int, args: dict[str, Any], key: tuple[Any, ...] = ()
    ) -> _Noted | None:
        """Something is wrong; None where there is no room for one more."""
        about = (rule, station, *key)
        noted = self._noted.get(about)
        if noted is None and len(self._noted) < self._bounds.bus_remarks:
            remark = Remark(rule, frame, {"device": name(station)} | args)
            noted = self._noted[about] = _Noted(remark)
        if noted is not None:
            noted.counted.add(frame)
        return noted

    def _not_enabled(self, station: LineStation, sap: int, service: str | None, frame: int) -> None:
        set_up, set_up_in = _set_up(station), None
        if service not in _OF_RECORDS:
            case = "sap_other"
        elif set_up is None:
            case = "sap_unknown"
        else:
            case = "sap_dpv1" if "dpv1" in set_up.flags else "sap_no_dpv1"
            set_up_in = station.parameters_frame
        args = {"sap": sap, "case": case, "frame": set_up_in}
        self._note("DS805", station.address, frame, args, (sap, case, set_up_in))

    def _service_refused(self, station: LineStation, sap: int | None, answer: LineFrame) -> None:
        args = {"sap": sap, "answer": _REFUSALS[answer.item.front.code or 0]}
        self._note("DS817", station.address, answer.frame, args, tuple(args.values()))

    def _exchange_refused(
        self, station: LineStation, request: LineFrame, answer: LineFrame
    ) -> None:
        """Data exchange is over for the station; whether its watchdog may have ended it, the first time shows."""
        kind = _REFUSALS[answer.item.front.code or 0]
        last = None if station.last_exchange is None else station.last_exchange.frame
        since, args = self._series.get((station.address, kind), (-1, {}))
        if since != last:
            args = {"answer": kind} | self._before(station, request)
            self._series[station.address, kind] = last, args
        self._note("DS816", station.address, answer.frame, args, (kind, args["case"]))

    def _before(self, station: LineStation, request: LineFrame) -> dict[str, Any]:
        """What was before a data exchange that is refused."""
        last, set_up = station.last_exchange, _set_up(station)
        args: dict[str, Any] = {"case": "exchange_none"}
        if last is not None:
            args |= {"case": "exchange_since", "last": last.frame}
            gap_ns = request.time_ns - last.time_ns
            watchdog = None if set_up is None else set_up.watchdog_ms
            if watchdog and gap_ns > 0 and station.hole <= last.frame:
                late = gap_ns > watchdog * 1_000_000
                args["case"] = "exchange_late" if late else "exchange_in_time"
                args |= {
                    "gap": gap_ns / 1e6,
                    "watchdog": watchdog,
                    "frame": station.parameters_frame,
                }
        return args

    def _lengths(self, station: LineStation, outputs: bytes, answer: LineFrame) -> None:
        """Empty outputs are those of a master that holds its slaves safe; SC has no inputs."""
        configured = station.configuration
        if configured is None or configured.flaws or not answer.item.front.exchanges:
            return
        if not station.knows(dp.CONFIGURATION, station.configuration_frame):
            return
        want, there = (configured.output_length, configured.input_length), len(answer.item.du)
        if there != want[1] or (outputs and len(outputs) != want[0]):
            args = {
                "outputs": len(outputs), "inputs": there, "configured_outputs": want[0],
                "configured_inputs": want[1], "frame": station.configuration_frame,
            }  # fmt: skip
            self._note("DS811", station.address, answer.frame, args, tuple(args.values()))

    def _parameters(self, station: LineStation, parameters: dp.Parameters, frame: int) -> None:
        last, unsure = station.last_exchange, station.unsure.get(dp.PARAMETERS, 0)
        if last is not None and max(station.hole, unsure) <= last.frame:
            self._note("DS810", station.address, frame, {"last": last.frame})
        if "lock" in parameters.flags and "watchdog" not in parameters.flags:
            self._note("DS815", station.address, frame, {})

    def _configuration(self, station: LineStation, sent: dp.Configuration, frame: int) -> None:
        if sent.pkw_consistent is False:
            module = next(
                each for each, role in zip(sent.modules, sent.roles, strict=True) if role == dp.PKW
            )
            args = {"identifier": module.data.hex().upper()}
            self._note("DS813", station.address, frame, args, (module.data,))

    def _diagnosis(
        self, station: LineStation, diagnosis: dp.SlaveDiagnosis, asker: int | None, frame: int
    ) -> None:
        heard = {"prm_fault": station.parameters, "cfg_fault": station.configuration}
        for flag, case in _FAULTS.items():
            left = (
                diagnosis.master is None and heard[flag] is None
            )  # of a start-up before the capture
            if flag in diagnosis.flags and not left:
                self._note("DS814", station.address, frame, {"case": case}, (case,))
        set_up = _set_up(station)
        if set_up is None or station.parameters_master != asker:
            return
        if None not in (diagnosis.ident, set_up.ident) and diagnosis.ident != set_up.ident:
            args = {"case": "diag_ident", "ident": diagnosis.ident, "sent": set_up.ident}
            self._note("DS814", station.address, frame, args, tuple(args.values()))
        if diagnosis.master not in (None, asker):
            args = {"case": "diag_master", "master": diagnosis.master}
            self._note("DS814", station.address, frame, args, tuple(args.values()))
