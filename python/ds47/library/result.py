"""One capture: its transactions, parameters and findings, and what a parameter held last."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, NamedTuple, get_args

from ds47.analysis import AnalysisOptions
from ds47.analysis import analyze as analyze_natively
from ds47.cyclic.named import pairs as name_pairs
from ds47.cyclic.named import parse as parse_name
from ds47.cyclic.named import parse_ppo
from ds47.model import (
    CHANNELS,
    CaptureFile,
    CaptureResult,
    Device,
    Diagnosis,
    Finding,
    Parameter,
    ParameterError,
    Relation,
    Report,
    Timeline,
    Transaction,
    Value,
)
from ds47.profidrive import Options
from ds47.report import contract, csv, json
from ds47.report import values as meanings
from ds47.report.filters import display_filter
from ds47.report.sentences import error_words, message, sentence
from ds47.report.targets import Targets
from ds47.report.verdict import VerdictCounts, verdict
from ds47.s7.choices import parse as parse_s7
from ds47.spec import extras, rule_prefix

if TYPE_CHECKING:
    import pandas

Engine = Literal["native", "tshark", "both"]
_KNOWN = ("ok", "partial")
"""States of a transaction of which a value is one of its parameter."""


class Element(NamedTuple):
    """One parameter of one drive object: what two transactions have in common that mean the same."""

    device: str
    """IP address."""
    drive_object: str
    """`DO 2`, `axis 0` where the capture does not prove which one it is, or a slot; empty
    for a parameter of the whole device."""
    pnu: int
    subindex: int


class Access(NamedTuple):
    """A parameter of a transaction."""

    transaction: Transaction
    parameter: Parameter


class LastValue(NamedTuple):
    """What an element held last, as far as the capture shows it."""

    value: Value
    format: str | None
    transaction: Transaction
    """The Read that brought it, or the change that was accepted."""


class Result:
    """All that one capture says. Attributes have the names and units of the JSON (docs/report.md)."""

    def __init__(self, capture: CaptureResult) -> None:
        self._capture = capture

    def __iter__(self) -> Iterator[Transaction]:
        return iter(self._capture.transactions)

    def __len__(self) -> int:
        return len(self._capture.transactions)

    def __repr__(self) -> str:
        return (
            f"<ds47 result of {self.path}: {len(self)} transactions, {len(self.findings)} findings>"
        )

    @property
    def path(self) -> str:
        """The file, or the first one of a series."""
        return self._capture.path

    @property
    def sha256(self) -> str | None:
        """Of the file, in hex; None unless `digest` asked for it."""
        return self._capture.sha256

    @property
    def files(self) -> list[CaptureFile]:
        """The files of a ring buffer; of any other capture empty."""
        return self._capture.files

    @property
    def frames(self) -> int:
        """How many frames there are."""
        return self._capture.frames

    @property
    def start(self) -> str | None:
        """Time of the first frame: ISO 8601 in UTC, nine digits."""
        return self._capture.start

    @property
    def end(self) -> str | None:
        """Time of the last frame: ISO 8601 in UTC, nine digits."""
        return self._capture.end

    @property
    def complete(self) -> bool:
        """Whether the file was read to its end; `problem` says why not."""
        return self._capture.complete

    @property
    def problem(self) -> str | None:
        """Why the file was not read to its end."""
        return self._capture.lacking

    @property
    def rpc(self) -> dict[str, int]:
        """How many RPC PDUs there are, by kind."""
        return self._capture.rpc

    @property
    def records(self) -> dict[str, dict[str, int]]:
        """How many record calls there are, by record index and by kind."""
        return self._capture.records

    @property
    def transactions(self) -> list[Transaction]:
        """In the order of their first frames."""
        return self._capture.transactions

    @property
    def findings(self) -> list[Finding]:
        """In the order of their frames; `message` words one."""
        return self._capture.findings

    @property
    def diagnoses(self) -> list[Diagnosis]:
        """The causes, worst first; `message` words one."""
        return self._capture.diagnoses

    @property
    def devices(self) -> list[Device]:
        """Who answered: IP and MAC address, name of station, vendor and device id."""
        return self._capture.devices

    @property
    def relations(self) -> list[Relation]:
        """The channels of drives in cyclic frames (docs/cyclic.md 5)."""
        return self._capture.relations

    @property
    def timelines(self) -> list[Timeline]:
        """What happened to the drives among them: events and sampled values (docs/cyclic.md 6)."""
        return self._capture.timelines

    @property
    def summary(self) -> dict[str, int]:
        """How many transactions there are, by state and by operation."""
        return self._capture.summary

    def verdict(self, lang: str = "en") -> str:
        """What the capture comes to, in a line: `NOT OK: dp3 refuses its parameters; 2 more causes`."""
        return verdict(VerdictCounts.of(self._capture)).text(lang)

    @property
    def parameters(self) -> Iterator[Access]:
        """Every parameter of every transaction, in their order."""
        for each in self._capture.transactions:
            for parameter in each.parameters:
                yield Access(each, parameter)

    def by_pnu(self, pnu: int, subindex: int | None = None) -> list[Access]:
        """The accesses to a parameter on whatever drive object, refused ones among them.

        Args:
            pnu: its number.
            subindex: one element, where not all are meant; one inside an array that was asked for counts.
        """
        return [
            each
            for each in self.parameters
            if each.parameter.pnu == pnu
            and (subindex is None or subindex in _subindices(each.parameter))
        ]

    def last_values(self) -> dict[Element, LastValue]:
        """What each element held last: read, or written and accepted.

        Which requests reach the same drive object is decided by what the capture proves (docs/pairing.md, P60).
        """
        targets = Targets(self._capture.transactions)
        labels = targets.labels(self._capture.transactions)
        found: dict[Any, tuple[Element, LastValue]] = {}
        for each, parameter in self.parameters:
            if each.state not in _KNOWN or each.operation not in ("read", "change"):
                continue
            if parameter.error is not None or parameter.attribute != "value":
                continue
            about = targets.identity(each, parameter.pnu)
            name = labels.get(about, "")
            for subindex, value in zip(_subindices(parameter), parameter.values, strict=False):
                key = Element(each.device, name, parameter.pnu or 0, subindex)
                last = LastValue(value, parameter.format, each)
                found[about, parameter.pnu, subindex] = key, last
        return dict(found.values())

    def message(self, item: Finding | Diagnosis | ParameterError, lang: str = "en") -> str:
        """What a finding, a diagnosis or an error of a parameter says: a line in "en" or "zh"."""
        if isinstance(item, ParameterError):
            return error_words(item, lang)
        return message(item, lang) if isinstance(item, Finding) else sentence(item, lang)

    def meaning(self, item: Parameter, lang: str = "en") -> str | None:
        """What the values of a parameter mean, where tables or lists say it: `F07900 Motor blocked`."""
        meant = meanings.meaning(item)
        return None if meant is None else meant.text(lang)

    def filter(self, item: Finding | Diagnosis) -> str:
        """A Wireshark display filter that shows the frames of a finding or a diagnosis."""
        return item.filter if isinstance(item, Finding) else display_filter(item.frames)[0]

    def to_dict(self) -> dict[str, Any]:
        """The document of `ds47 report -f json` (`ds47.report/2`)."""
        return json.document(Report([self._capture]))

    def to_frame(self) -> pandas.DataFrame:
        """A table with a row for each parameter and the columns of `ds47 report -f csv`.

        `values` and `scaled` are lists, `start` is a time of pandas in UTC. A transaction without parameters has
        one row.

        Raises:
            ModuleNotFoundError: pandas is not installed; the text says how to install it.
        """
        try:
            import pandas
        except ModuleNotFoundError as problem:
            hint = f"to_frame needs pandas: {extras.install('pandas')}"
            raise ModuleNotFoundError(hint, name="pandas") from problem
        table = pandas.DataFrame(list(_rows(self._capture)), columns=list(csv.COLUMNS))
        table["start"] = pandas.to_datetime(table["start"], utc=True, errors="coerce")
        return table


def analyze(
    path: str | Path | BinaryIO | Sequence[str | Path],
    *,
    engine: Engine = "native",
    tshark: str | None = None,
    indices: Iterable[int] = (),
    slow_ms: float | None = None,
    pkw_layouts: Mapping[str, str] | None = None,
    channels: str | Iterable[str] = ("ds47", "pkw", "pzd", "s7"),
    cyclic: Iterable[str] = (),
    ppos: Mapping[int, int] | None = None,
    s7_ports: Iterable[int] = (),
    s7_cpus: Mapping[str, str] | None = None,
    s7_blocks: Mapping[str, int] | None = None,
    s7_readback: bool = False,
    vendor_id: int | None = None,
    select: str | Iterable[str] = (),
    ignore: str | Iterable[str] = (),
    options: Options | None = None,
    digest: bool = False,
) -> Result:
    """Analyses one capture.

    Args:
        path: a pcap or pcapng file, gzipped or zstd too; a URL; "-" for standard input; a binary stream; or the
            files of a ring buffer, which are one capture.
        engine: "native", "tshark" (what the Wireshark plugin says), or "both" (DS601 where they differ).
        tshark: the program of the engines "tshark" and "both"; None for that of the environment variable
            DS47_TSHARK, else the one that is found.
        indices: further record indices that carry the parameter channel.
        slow_ms: from which share of the drive a transaction is slow (DS416); None for the shipped limit.
        pkw_layouts: the layout of IND in PKW, "cyclic" or "uss", by the IP address of the device; "" for all
            others.
        channels: what to report: "ds47" record calls, "pkw", "pzd", "s7"; one of them, or several.
        cyclic: channels in cyclic frames whose Connect is missing, two names for each, as in
            "00:1b:1b:11:22:33@8000:0:pkw"; docs/cyclic.md 5.
        ppos: numbers of PPO by the address of the station on PROFIBUS, where Chk_Cfg is missing; docs/profibus.md.
        s7_ports: TCP ports of S7 servers, beside 102.
        s7_cpus: the kind of CPU ("s7-400", docs/s7.md) by the IP address of a server; "" for all others.
        s7_blocks: likewise how many bytes it copies at once when others read and write its memory.
        s7_readback: whether to say where what is read is not what was written (DS916).
        vendor_id: PROFINET vendor id of devices of which the capture shows none, 0x2A for SINAMICS.
        select: rules to report, by id, beginning of an id, or name: one, or several; empty for all.
        ignore: rules to leave out.
        options: dialects of the parameter channel.
        digest: whether to compute the SHA-256 of the file, which reads every byte.

    Raises:
        CaptureError: nothing of the capture can be read.
        ValueError: there is no such rule, engine, channel, port or CPU, a name in `cyclic` is none, or the files
            are not those of one ring buffer.
        TypeError: `slow_ms` is no number.
        NotReadyError: the engine needs tshark or pyshark, and it is missing; the text says what to do.
    """
    wanted = _several(channels)
    if slow_ms is not None and not isinstance(slow_ms, (int, float)):
        raise TypeError(f"slow_ms is {slow_ms!r}: a number of milliseconds, or None")
    if unknown := set(wanted) - set(CHANNELS):
        raise ValueError(f"no channel {min(unknown)!r}: {', '.join(CHANNELS)}")
    chosen = AnalysisOptions(
        indices=frozenset(indices), slow_ms=slow_ms, select=_rules(_several(select)),
        ignore=_rules(_several(ignore)),
        codec=options or Options(), digest=digest, pkw_layouts=tuple((pkw_layouts or {}).items()),
        channels=wanted, cyclic=tuple(map(parse_name, cyclic)), ppos=_ppos(ppos or {}),
        s7=parse_s7(
            tuple(s7_ports), [f"{ip}={kind}" for ip, kind in (s7_cpus or {}).items()],
            [f"{ip}={size}" for ip, size in (s7_blocks or {}).items()], s7_readback,
        ),
        vendor_id=vendor_id,
    )  # fmt: skip
    name_pairs(chosen.cyclic)
    if engine not in get_args(Engine):
        raise ValueError(f"no engine {engine!r}: {', '.join(get_args(Engine))}")
    if isinstance(path, Sequence) and not isinstance(path, str):
        return Result(_series([str(each) for each in path], engine, chosen))
    if engine == "native":
        return Result(analyze_natively(path, chosen))
    from ds47.wireshark.engine import Engine as Tshark

    return Result(Tshark(engine, chosen, tshark or os.environ.get("DS47_TSHARK")).analyze(path))


def _series(paths: list[str], engine: Engine, options: AnalysisOptions) -> CaptureResult:
    from ds47.batch.tasks import plan, read

    tasks = plan(paths, series=True)
    if len(tasks) != 1 or engine != "native":
        raise ValueError(f"{paths}: not the files of one ring buffer, for the native engine")
    return read(tasks[0], options)


def _several(given: str | Iterable[str]) -> tuple[str, ...]:
    """A text where several are meant is one of them, not its letters."""
    return (given,) if isinstance(given, str) else tuple(given)


def _ppos(given: Mapping[int, int]) -> tuple[tuple[int, int], ...]:
    return tuple(parse_ppo(f"{station}=ppo{number}") for station, number in given.items())


def _rules(names: Iterable[str]) -> tuple[str, ...]:
    found = []
    for name in names:
        prefix = rule_prefix(name)
        if prefix is None:
            raise ValueError(f"no rule begins with {name!r} or is named so; see: ds47 rules")
        found.append(prefix)
    return tuple(found)


def _subindices(item: Parameter) -> range:
    """The elements of an access; a text is one, however long it is."""
    first = item.subindex or 0
    if len(item.values) == 1 and item.error is None:
        return range(first, first + 1)
    return range(first, first + max(item.element_count or 1, len(item.values)))


def _rows(capture: CaptureResult) -> Iterator[list[Any]]:
    for each in capture.transactions:
        left = [capture.path, *contract.transaction_cells()(each, "en")]
        for item, right in contract.rows(each):
            if item is None:
                yield left + [None] * len(csv.PARAMETER_COLUMNS) + right
                continue
            values, error = [item.values, item.scaled], contract.error_cells(item, "en")
            yield left + contract.head_cells(item, "en") + values + error + right
