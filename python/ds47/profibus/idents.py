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
    """The ident numbers of stations, as they stand in their GSD; the newest of each kind."""

    SERVICES: ClassVar = frozenset({dp.DIAGNOSIS, dp.PARAMETERS})

    def __init__(self) -> None:
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

    def sent(self, station: int) -> int | None:
        """The ident number that a station was parameterised with; None where no frame has said it yet."""
        return self._sent.get(station)

    def of(self, station: int) -> int | None:
        """The ident number of a station; None where no frame has said it yet."""
        return self._said.get(station, self._sent.get(station))

    def family(self, station: int) -> str | None:
        """The family of its parameters (spec/parameters.toml); None if unknown."""
        return profibus.family(self.of(station))
