"""Which file names belong to one ring buffer, in which order, and its name.

Nothing is opened here. Known are the names of dumpcap -b, NAME_00001_20240101120000.pcapng (also
with the time first), of tcpdump -C, NAME.pcap, NAME.pcap1, NAME.pcap2, with -W NAME.pcap00 ..., and
of tcpdump -G with the time at the end of the name, NAME_20240101120000.pcap.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from .names import ENDINGS, PACKED, SUFFIXES, is_capture

_LONGEST_FIRST = sorted(ENDINGS, key=len, reverse=True)
_ENDING = "(?P<ending>" + "|".join(map(re.escape, _LONGEST_FIRST)) + ")"
_TIME = r"(?P<time>\d{8}[-_T]?\d{6})"
_DUMPCAP = (
    re.compile(rf"(?P<stem>.+)_(?P<number>\d{{5,}})_{_TIME}{_ENDING}", re.IGNORECASE),
    re.compile(rf"(?P<stem>.+)_{_TIME}_(?P<number>\d{{5,}}){_ENDING}", re.IGNORECASE),
)
_SIZED = re.compile(
    rf"(?P<stem>.+(?:{'|'.join(map(re.escape, SUFFIXES))}))(?P<number>\d+)"
    rf"(?P<ending>{'|'.join(map(re.escape, PACKED))})",
    re.IGNORECASE,
)
_TIMED = re.compile(rf"(?P<stem>.+?)[-_.]?{_TIME}{_ENDING}", re.IGNORECASE)
_WRAP = 100_000
"""dumpcap counts from 1 and goes on with 0 after 99999; editcap counts from 0."""
_CLOCK = timedelta(hours=1, minutes=5)
"""A later file may have a time this much earlier: names have local time, and summer time ends."""


@dataclass(frozen=True, slots=True)
class Ring:
    """The files of one ring buffer in their order.

    `missing[n]` counts the missing files before the n-th; those before the first were overwritten.
    `cyclic`: the first in this order need not be the oldest.
    """

    names: tuple[str, ...]
    missing: tuple[int, ...]
    cyclic: bool = False


@dataclass(frozen=True, slots=True)
class _File:
    name: str
    kind: str
    group: tuple[str, str]
    number: int | None
    time: datetime | None
    digits: str = ""


def is_part(name: str) -> bool:
    """Whether a name is one that only tcpdump -C gives: `x.pcap1`."""
    return _SIZED.fullmatch(name) is not None


def may_be_part(name: str) -> bool:
    """Whether a file is read with --series: it is a capture, or has such a name."""
    return is_capture(name) or is_part(name)


def rings(names: Sequence[str]) -> list[Ring]:
    """The ring buffers among file names; other names are left out."""
    groups: dict[tuple[str, tuple[str, str]], list[_File]] = {}
    for name in names:
        file = _parsed(name)
        if file is not None:
            groups.setdefault((file.kind, file.group), []).append(file)
    found = []
    for (kind, (stem, ending)), files in groups.items():
        if kind == "dumpcap":
            found += [_ring(chain, 1) for chain in _chains(files)]
        elif kind == "sized":
            found.append(_sized(files, stem + ending, names))
        elif len(files) > 1:
            found.append(_ring(sorted(files, key=lambda file: (file.time, file.name)), None))
    return found


def own_name(first: str, names: Sequence[str]) -> str | None:
    """NAME of the series that begins with the file `first`: `ring` for `ring_00001_20240101120000.pcapng`.

    None if another series or capture among `names`, the files of the folder, has the same NAME.
    """
    name = common_name(first)
    near = [each for each in names if each.startswith(name)]
    series = rings(near)
    inside = {each for ring in series for each in ring.names}
    owners = [ring.names[0] for ring in series] + [each for each in near if each not in inside]
    return name if sum(common_name(each) == name for each in owners) <= 1 else None


def common_name(name: str) -> str:
    """NAME of the series of a file; for any other capture its name without the ending."""
    file = _parsed(name)
    stem = name if file is None else file.group[0]
    ending = next((each for each in _LONGEST_FIRST if stem.lower().endswith(each)), "")
    return stem[: len(stem) - len(ending)]


def _parsed(name: str) -> _File | None:
    for pattern in _DUMPCAP:
        match = pattern.fullmatch(name)
        if match and (time := _time(match["time"])):
            group = match["stem"], match["ending"]
            return _File(name, "dumpcap", group, int(match["number"]), time)
    if match := _SIZED.fullmatch(name):
        number = match["number"]
        return _File(name, "sized", (match["stem"], match["ending"]), int(number), None, number)
    if (match := _TIMED.fullmatch(name)) and (time := _time(match["time"])):
        return _File(name, "timed", (match["stem"], match["ending"]), None, time)
    return None


def _time(digits: str) -> datetime | None:
    try:
        return datetime.strptime(re.sub(r"\D", "", digits), "%Y%m%d%H%M%S")
    except ValueError:
        return None


def _chains(files: Iterable[_File]) -> list[list[_File]]:
    """Splits files of one name into runs of dumpcap: in each, numbers and times rise."""
    chains: list[list[_File]] = []
    for file in sorted(files, key=lambda each: (each.number, each.time)):
        before = [chain for chain in chains if _follows(chain[-1], file)]
        strict = [chain for chain in before if chain[-1].time <= file.time]  # type: ignore[operator]
        if before:
            max(strict or before, key=lambda chain: chain[-1].time or datetime.min).append(file)
        else:
            chains.append([file])
    return _joined(chains)


def _follows(last: _File, file: _File) -> bool:
    assert last.time is not None
    assert file.time is not None
    return last.number != file.number and last.time <= file.time + _CLOCK


def _joined(chains: list[list[_File]]) -> list[list[_File]]:
    """Rejoins a run that has counted beyond 99999."""
    for chain in chains:
        if chain[-1].number != _WRAP - 1:
            continue
        rest = [
            each
            for each in chains
            if each is not chain and each[0].number == 0 and _follows(chain[-1], each[0])
        ]
        if rest:
            following = min(rest, key=lambda each: each[0].time or datetime.max)
            chains.remove(following)
            chain += following
            return _joined(chains)
    return chains


def _ring(files: Sequence[_File], first: int | None) -> Ring:
    """`first` is the number of the very first file of such a ring; None without numbers."""
    missing = []
    expected = first
    if first is not None and files[0].number == 0:  # editcap -c and -i
        expected = 0
    for file in files:
        if file.number is None or expected is None:
            missing.append(0)
            continue
        missing.append(max(0, (file.number - expected) % _WRAP))
        expected = file.number + 1
    return Ring(tuple(file.name for file in files), tuple(missing))


def _sized(files: list[_File], base: str, names: Sequence[str]) -> Ring:
    """Tcpdump -C; with -W it starts over at the first file, which then has a number."""
    ordered = sorted(files, key=lambda file: file.number or 0)
    has_base = base in names
    cyclic = not has_base and ordered[0].digits.strip("0") == ""
    ring = _ring(ordered, None if cyclic else 1)
    if has_base:
        ring = Ring((base, *ring.names), (0, *ring.missing))
    return Ring(ring.names, ring.missing, cyclic)
