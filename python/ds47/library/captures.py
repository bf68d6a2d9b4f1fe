"""Analysing captures: one, many, or frames that a program already has."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NoReturn, Unpack, get_args

from ds47.analysis import AnalysisOptions
from ds47.analysis import analyze as analyze_natively
from ds47.capture import CaptureError, PcapngWriter, open_capture
from ds47.capture.writer import nearest
from ds47.library.choices import Choices, Engine, chosen
from ds47.library.result import Result
from ds47.model import CaptureResult
from ds47.profidrive import Options

if TYPE_CHECKING:
    from decimal import Decimal

    from ds47.batch.tasks import Task
    from ds47.parameters.expected import Expectation

_ETHERNET = 1


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
    expect: str | Path | None = None,
) -> Result:
    """Analyses one capture.

    Args:
        path: a pcap or pcapng file, a hex dump of packets or a log of PROFIBUS, gzipped or zstd too; a URL; "-"
            for standard input; a binary stream; or the files of a ring buffer, which are one capture.
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
        expect: a file that says what parameters should be (DS602), TOML or CSV; docs/how-to/as-it-should-be.md.

    Raises:
        CaptureError: nothing of the capture can be read.
        ValueError: there is no such rule, engine, channel, port or CPU, a name in `cyclic` is none, the files
            are not those of one ring buffer, or `expect` is no list of parameters.
        TypeError: `slow_ms` is no number.
        NotReadyError: the engine needs tshark or pyshark, and it is missing; the text says what to do.
    """
    options_ = chosen(
        Choices(
            indices=indices, slow_ms=slow_ms, pkw_layouts=pkw_layouts, channels=channels, cyclic=cyclic,
            ppos=ppos, s7_ports=s7_ports, s7_cpus=s7_cpus, s7_blocks=s7_blocks, s7_readback=s7_readback,
            vendor_id=vendor_id, select=select, ignore=ignore, options=options,
        )
    )._replace(digest=digest)  # fmt: skip
    expected = _expected(expect)
    if isinstance(path, Sequence) and not isinstance(path, str):
        return Result(_series([str(each) for each in path], engine, options_, expected))
    return Result(_engine(engine, tshark, options_, expected)(path))


def analyze_many(
    paths: str | Path | Iterable[str | Path],
    *,
    jobs: int = 1,
    engine: Engine = "native",
    tshark: str | None = None,
    digest: bool = False,
    expect: str | Path | None = None,
    **choices: Unpack[Choices],
) -> Iterator[Result]:
    """Analyses captures, each by itself, and hands out their results in order, each when it is there.

    A capture that cannot be read does not end the others: its result has no frames, `complete` is false, and
    `problem` says why.

    Args:
        paths: captures, folders with all below them, URLs: one, or several. Each capture counts once.
        jobs: how many are analysed at once, in processes; 0 for as many as there are cores.
        engine: as for `analyze`, with `tshark`; others than "native" take no more than one job.
        tshark: as for `analyze`.
        digest: as for `analyze`.
        expect: as for `analyze`.
        choices: keywords of `analyze`.

    Raises:
        CaptureError: a folder has no capture, or cannot be read.
        ValueError: as for `analyze`, or this engine takes one job only.
        TypeError: as for `analyze`.
        NotReadyError: as for `analyze`.
    """
    from ds47.batch.captures import captures  # one capture needs nothing of this
    from ds47.batch.cores import cores
    from ds47.batch.tasks import plan

    options = chosen(choices)._replace(digest=digest)
    if engine != "native" and jobs != 1:
        raise ValueError(f"the engine {engine} takes one job, not {jobs}")
    names = [paths] if isinstance(paths, (str, Path)) else paths
    tasks = plan(list(captures([os.fspath(each) for each in names], _refuse)), series=False)
    read_one = partial(_read, _engine(engine, tshark, options, _expected(expect)))
    jobs = min(jobs or cores(), len(tasks))
    if jobs <= 1:
        return map(Result, map(read_one, tasks))
    from ds47.batch.local import in_order  # few programs start processes

    return map(Result, in_order(read_one, tasks, jobs, _unread))


def analyze_frames(
    frames: Iterable[tuple[float | Decimal | str, bytes]],
    *,
    link_type: int = _ETHERNET,
    **choices: Unpack[Choices],
) -> Result:
    """Analyses frames that a program already has, such as packets of scapy or pyshark.

    Frames are numbered from 1, in the order in which they come.

    Args:
        frames: when each was captured, in seconds since 1970, and its bytes.
        link_type: their LINKTYPE_ number; 1 is Ethernet.
        choices: keywords of `analyze`.

    Raises:
        ValueError: as for `analyze`, or a time is none.
        TypeError: as for `analyze`.
    """
    options, stream = chosen(choices), BytesIO()
    with PcapngWriter(stream, link_type) as writer:
        for time, data in frames:
            writer.write(_nanoseconds(time), bytes(data))
    stream.seek(0)
    with open_capture(stream, name="<frames>") as capture:
        return Result(analyze_natively(capture, options))


def _expected(name: str | Path | None) -> tuple[Expectation, ...]:
    if name is None:
        return ()
    from ds47.parameters import expected, lists

    try:
        return expected.read(Path(name))
    except lists.ListError as problem:
        raise ValueError(str(problem)) from problem


def _engine(
    engine: Engine,
    tshark: str | None,
    options: AnalysisOptions,
    expected: tuple[Expectation, ...],
) -> Callable[[str | Path | BinaryIO], CaptureResult]:
    """What analyses a capture in this process."""
    if engine not in get_args(Engine):
        raise ValueError(f"no engine {engine!r}: {', '.join(get_args(Engine))}")
    analyze_: Callable[[str | Path | BinaryIO], CaptureResult] = partial(_native, options)
    if engine != "native":
        from ds47.wireshark.engine import Engine as Tshark

        analyze_ = Tshark(engine, options, tshark or os.environ.get("DS47_TSHARK")).analyze
    return partial(_judged, analyze_, options, expected) if expected else analyze_


def _native(options: AnalysisOptions, path: str | Path | BinaryIO) -> CaptureResult:
    """A function of plain Python: one that is compiled need not be one that other processes can be sent."""
    return analyze_natively(path, options)


def _judged(
    analyze_: Callable[[str | Path | BinaryIO], CaptureResult],
    options: AnalysisOptions,
    expected: tuple[Expectation, ...],
    path: str | Path | BinaryIO,
) -> CaptureResult:
    from ds47.report.expected import judged

    return judged(analyze_(path), expected, options)


def _read(analyze_: Callable[[str], CaptureResult], task: Task) -> CaptureResult:
    try:
        return analyze_(task.path)
    except CaptureError as problem:
        return _unread(task, problem)


def _unread(task: Task, problem: CaptureError) -> CaptureResult:
    """What there is to say of a capture that cannot be read."""
    return CaptureResult(
        task.path, complete=False, problem=str(problem), summary={"transactions": 0}
    )


def _refuse(problem: str) -> NoReturn:
    raise CaptureError(problem)


def _nanoseconds(time: float | Decimal | str) -> int:
    from decimal import Decimal

    try:
        return nearest(round(Decimal(time).scaleb(9)))
    except (ArithmeticError, ValueError) as problem:
        raise ValueError(f"{time!r} is not the time of a frame: seconds since 1970") from problem


def _series(
    paths: list[str], engine: Engine, options: AnalysisOptions, expected: tuple[Expectation, ...]
) -> CaptureResult:
    from ds47.batch.tasks import plan, read

    tasks = plan(paths, series=True)
    if len(tasks) != 1 or engine != "native":
        raise ValueError(f"{paths}: not the files of one ring buffer, for the native engine")
    return read(tasks[0], options, expected=expected)
