"""Which make the stations of a line are, by the ident numbers that the capture shows (docs/profibus.md 3).

Hears of the exchanges of a line. What a slave says of itself (Slave_Diag) counts more than what a master sends it
(Set_Prm): a project may name the wrong device. spec/profibus.toml lists the makers of ident numbers.
"""

from __future__ import annotations

from typing import ClassVar

from ds47.profibus import dp
from ds47.profibus.line import Exchange
from ds47.spec import profibus


class Idents:
    """The ident numbers of stations, as they stand in their GSD; the newest of each kind.

    Args:
        vendor_id: the assumed vendor of stations whose ident number does not tell it; None: no assumption.
    """

    SERVICES: ClassVar = frozenset({dp.DIAGNOSIS, dp.PARAMETERS})

    def __init__(self, vendor_id: int | None = None) -> None:
        self._vendor_id = vendor_id
        self._said: dict[int, int] = {}
        self._sent: dict[int, int] = {}

    def take(self, exchange: Exchange) -> None:
        """An exchange that is over; one without an answer, or that was refused, says nothing."""
        answer, station = exchange.answer, exchange.request.item.front.da
        if answer is None or station is None or dp.refuses(answer.item):
            return
        if exchange.request.item.front.service == dp.PARAMETERS:
            sent = dp.decode(exchange.request.item)
            if isinstance(sent, dp.Parameters) and sent.ident is not None:
                self._sent[station] = sent.ident
            return
        said = dp.decode(answer.item)
        if isinstance(said, dp.SlaveDiagnosis) and said.ident is not None:
            self._said[station] = said.ident

    def whose(self, station: int) -> tuple[int | None, str | None]:
        """Vendor id and family of parameters (parameters.toml): by the ident number, else the assumed vendor."""
        ident = self._said.get(station, self._sent.get(station))
        vendor_id = profibus.vendor(ident)
        if vendor_id is None:
            return self._vendor_id, None
        return vendor_id, profibus.family(ident)

    def agree(self, station: int) -> bool:
        """Whether master and station name the same ident number, and it is known."""
        sent = self._sent.get(station)
        return profibus.vendor(sent) is not None and self._said.get(station, sent) == sent
