"""PKW and PZD in the data exchange of PROFIBUS: what Chk_Cfg says of its modules, or a user, as relations.

Hears of the exchanges of a line. Which modules a configuration has is `ds47.profibus.dp`; what the words mean is
the business of `channels` and of those behind it, for PROFINET and PROFIBUS alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import ClassVar

from ds47.cyclic.channels import CyclicChannels
from ds47.cyclic.pkw import LENGTH
from ds47.cyclic.relations import CyclicRelation, CyclicSide, fitting_telegrams
from ds47.model import CONFIGURED, LENGTHS, NAMED, PKW, PZD
from ds47.profibus import dp
from ds47.profibus.idents import Idents
from ds47.profibus.line import Exchange
from ds47.spec import profibus

_WORD = 2


def source(sender: int, receiver: int) -> bytes:
    """What stands for a sender where frames have stations, and neither MAC address nor frame id."""
    return bytes((sender, receiver))


class PpoFeed:
    """Feeds channels with the data of stations with a captured configuration or a named PPO.

    Args:
        channels: takes the relations, and the data.
        named: the PPO of stations, for captures without their Chk_Cfg, which counts more.
        idents: knows the makers of stations; it must hear of each exchange first.
    """

    SERVICES: ClassVar = frozenset({dp.EXCHANGE, dp.CONFIGURATION})

    def __init__(self, channels: CyclicChannels, named: Mapping[int, int], idents: Idents) -> None:
        self._channels = channels
        self._named = {
            station: row for station, number in named.items() for row in profibus.ppos()
            if row.number == number
        }  # fmt: skip
        self._at_work: set[tuple[int, int]] = set()
        """Masters and stations of a PPO that is named."""
        self._idents = idents

    def take(self, exchange: Exchange) -> None:
        """An exchange that is over; one without an answer, or that was refused, says nothing."""
        item, answer = exchange.request.item, exchange.answer
        master, station = item.front.sa, item.front.da
        if answer is None or master is None or station is None or dp.refuses(answer.item):
            return
        name = item.front.service
        if name == dp.EXCHANGE:
            if station in self._named and not self._fits(master, station, item.du, answer.item.du):
                return
            seen = exchange.request
            self._channels.exchanged(item.front.way, item.du, seen.frame, seen.time_ns)
            self._channels.exchanged(item.front.back, answer.item.du, answer.frame, answer.time_ns)
        elif name == dp.CONFIGURATION:
            self._named.pop(station, None)
            found = self._relations(master, station, item.du, exchange.request.frame)
            sources = source(master, station), source(station, master)
            self._channels.configured(list(found), *sources, exchange.request.frame)

    def _fits(self, master: int, station: int, output: bytes, input_: bytes) -> bool:
        """Whether data has the length of the PPO named for its station; the channels begin with the first data."""
        row = self._named[station]
        if (master, station) not in self._at_work:
            self._at_work.add((master, station))
            found = self._relations(master, station, _identifiers(row), None)
            sources = source(master, station), source(station, master)
            self._channels.configured(list(found), *sources)
        return len(output) == len(input_) == sum(row.modules)

    def _relations(
        self, master: int, station: int, configuration: bytes, frame: int | None
    ) -> Iterator[CyclicRelation]:
        vendor_id, family = self._idents.whose(station)
        return relations(
            master, station, dp.configuration(configuration), vendor_id, frame, family,
            agreed=self._idents.agree(station),
        )  # fmt: skip


def _identifiers(row: profibus.PpoLayout) -> bytes:
    """The modules of a PPO as Chk_Cfg names them, in words and consistent."""
    return bytes(0xF0 | (length // _WORD - 1) for length in row.modules)


def relations(
    master: int,
    station: int,
    configuration: dp.Configuration,
    vendor_id: int | None,
    frame: int | None,
    family: str | None = None,
    *,
    agreed: bool = False,
) -> Iterator[CyclicRelation]:
    """The channels of a configuration; none where it is no PPO that is known.

    `frame` is that of Chk_Cfg, None where a user named the PPO; vendor and family are None where nothing says
    them. `agreed`: whether master and station name the same ident number, which is known. Then PKW is PKW; PZD is
    proved by its words.
    """
    proved = CONFIGURED if agreed else LENGTHS
    output = input_ = 0
    words = [
        (each.outputs.length, each.inputs.length)
        for each, role in zip(configuration.modules, configuration.roles, strict=True)
        if role == dp.PZD and each.outputs and each.inputs
    ]
    telegrams = fitting_telegrams(words, vendor_id, pkw=dp.PKW in configuration.roles)
    for module, role in zip(configuration.modules, configuration.roles, strict=True):
        lengths = [0 if area is None else area.length for area in (module.outputs, module.inputs)]
        if role is not None:
            sides = [
                CyclicSide(
                    source(*way), 0, offset, length, LENGTH if role == dp.PKW else _WORD,
                    iops=None, status=None, cycle_ns=0,
                )
                for way, offset, length in (
                    ((master, station), output, lengths[0]), ((station, master), input_, lengths[1]),
                )
            ]  # fmt: skip
            yield CyclicRelation(
                PKW if role == dp.PKW else PZD, f"dp{master}", f"dp{station}",
                vendor_id=vendor_id, family=family,
                ar=None, api=None, slot=None, subslot=None, telegrams=telegrams,
                output=sides[0], input=sides[1], frame=frame,
                certainty=NAMED if frame is None else proved if role == dp.PKW else LENGTHS,
            )  # fmt: skip
        output, input_ = output + lengths[0], input_ + lengths[1]
