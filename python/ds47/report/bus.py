"""The stations of a line of PROFIBUS in words: a table, and what each said to Slave_Diag (docs/profibus.md 7).

Used by the text report and by the HTML page; what is wrong there are findings like all others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ds47.model import Bus, BusStation, Relation, Span, StationDiagnosis
from ds47.report.bilingual import Both, joined, say
from ds47.report.formatting import duration
from ds47.spec import profibus

COLUMNS = (
    "station", "role", "ident", "ppo", "watchdog", "requests", "unanswered", "damaged", "retries", "exchanges",
    "cycle", "answer", "diagnoses",
)  # fmt: skip
"""Of the table; their words are `bus_` and the name."""
_NOTHING = Both.same("")


def counts(bus: Bus) -> Both:
    """What the frames are, in one line."""
    return say(
        "bus_counts", frames=bus.frames, tokens=bus.tokens, damaged=bus.damaged, stray=bus.stray
    )


def head() -> list[Both]:
    """The names of the columns."""
    return [say(f"bus_{name}") for name in COLUMNS]


def rows(bus: Bus) -> Iterator[list[Both]]:
    """A row for each station; one that was never asked has only its role."""
    for each in bus.stations:
        cells = [Both.same(f"dp{each.address}"), say(f"bus_{each.role}")]
        yield [*cells, *(_cells(each) if each.requests else [_NOTHING] * (len(COLUMNS) - 2))]


def _cells(item: BusStation) -> list[Both]:
    wanted = f"{item.diagnoses_wanted} ({item.diagnoses_fetched})"
    same = (
        "" if item.ident is None else f"{item.ident:04X}",
        "" if item.ppo is None else f"PPO{item.ppo}",
    )
    after = (
        f"{item.requests:,}", f"{item.unanswered:,}", f"{item.damaged:,}", f"{item.retries:,}",
        f"{item.exchanges:,}", _span(item.cycle), _span(item.answer),
        wanted if item.diagnoses_wanted else "",
    )  # fmt: skip
    return [*map(Both.same, same), _watchdog(item), *map(Both.same, after)]


def _watchdog(item: BusStation) -> Both:
    """That of Set_Prm; nothing where that was not seen."""
    if item.parameters is None:
        return _NOTHING
    return say("bus_off") if item.watchdog_ms is None else Both.same(f"{item.watchdog_ms:,} ms")


def _span(item: Span | None) -> str:
    return "" if item is None else f"{duration(item.mean_ns)} ({duration(item.most_ns)})"


def diagnoses(bus: Bus) -> Iterator[Both]:
    """What stations said last to Slave_Diag, a line each."""
    for each in bus.stations:
        if each.diagnosis is not None:
            yield _diagnosis(each.address, each.diagnosis)


def hints(bus: Bus, relations: Sequence[Relation]) -> Iterator[Both]:
    """How to name the PPO of stations without a captured Chk_Cfg, if their data has the lengths of one.

    Args:
        bus: the stations.
        relations: channels that are known already, those of a PPO that was named among them.
    """
    known = {each.device for each in relations}
    for each in bus.stations:
        lengths = {each.outputs, each.inputs}
        fits = [row.number for row in profibus.ppos() if lengths == {sum(row.modules)}]
        if fits and each.configuration is None and f"dp{each.address}" not in known:
            options = " | ".join(f"--ppo {each.address}=ppo{number}" for number in fits)
            yield say("bus_hint", station=f"dp{each.address}", options=options)


def _diagnosis(address: int, item: StationDiagnosis) -> Both:
    known = {row.id: row for row in profibus.flags("diagnosis")}
    flags = [Both.of(known[each].text) for each in item.flags]
    shown = joined(flags, "; ", "；") if flags else say("bus_no_flags")
    ident = "?" if item.ident is None else f"{item.ident:04X}"
    master = say("bus_no_master") if item.master is None else Both.same(f"dp{item.master}")
    text = say(
        "bus_diagnosis", station=f"dp{address}", frame=str(item.frame), flags=shown, ident=ident,
        master=master,
    )  # fmt: skip
    if not item.blocks:
        return text
    blocks = " | ".join(each.hex(" ").upper() for each in item.blocks)
    return text.joined(say("bus_blocks", blocks=blocks), "; ", "；")
