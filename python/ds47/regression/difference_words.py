"""The words about a difference between two captures: its verdict, its conclusions, and what each capture shows.

What differs is found in `ds47.regression.difference`; `difference_report` and `difference_page` put the words
together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from ds47 import spec
from ds47.profidrive.elements import is_whole
from ds47.profidrive.naming import spelling
from ds47.regression import difference as kinds
from ds47.regression.conclusions import KINDS, Conclusion, failures, shares
from ds47.regression.difference import Difference, ElementDifference, Faults, LatencyDifference
from ds47.regression.elements import Outcomes
from ds47.regression.places import Place
from ds47.report.bilingual import Both, joined, operation, say
from ds47.report.formatting import escape, values
from ds47.report.sentences import slot_number
from ds47.spec import error_hex

_DIFFERENT = {
    kinds.DIFFERENT: "diff_parameters", kinds.OTHER_REQUESTS: "diff_requests",
    kinds.SOMETIMES: "diff_sometimes",
}  # fmt: skip
_REST = {
    kinds.ONLY: "diff_only", kinds.OTHER_OPERATION: "diff_operation", kinds.OTHER_WAY: "diff_way",
    kinds.OPEN: "diff_open",
}  # fmt: skip
"""What differs, and what was not compared, with its heading."""
CONCLUSIONS = 12
"""Conclusions that text and page open with; the others are counted."""
_NAMED = 3
"""Parameters that a conclusion names, and drives of a side that has none of the other."""
_VALUES = {
    "read": ("diff_read", "diff_read_several"),
    "change": ("diff_change", "diff_change_several"),
}
"""How a side tells its values, and how where they were not always the same."""


class ElementRun(NamedTuple):
    """Rows of consecutive elements that differ only in their values."""

    rows: tuple[ElementDifference, ...]

    @property
    def first(self) -> ElementDifference:
        """The row of the first element."""
        return self.rows[0]


class Section(NamedTuple):
    """Runs under a heading."""

    title: Both
    runs: list[ElementRun]


def verdict(found: Difference) -> Both:
    """How many parameter elements differ, of how many."""
    if found.strangers:
        a, b = map(_first_names, found.strangers)
        return say("diff_strangers", a=a, b=b)
    if not found.compared:
        return say("diff_nothing")
    if not found.different:
        return say("diff_equal", n=found.compared)
    return say("diff_differ", n=found.different, total=f"{found.compared:,}")


def _first_names(names: list[str]) -> str:
    return ", ".join(map(escape, names[:_NAMED])) + ", ..." * (len(names) > _NAMED)


def conclusion_text(each: Conclusion, found: Difference) -> Both:
    """A conclusion in a line: `press-1 DO 2: a read that brought a value in A fails in B: p2900[0] (..)`."""
    if each.faults is not None:
        return say(
            KINDS[each.kind][1],
            place=_submodule(each.faults),
            counts=f"{each.faults.a:,} -> {each.faults.b:,}",
        )
    if each.latency is not None:
        was, now = each.latency.medians
        return say(
            KINDS[each.kind][1],
            place=escape(each.latency.device),
            operation=operation(each.latency.operation),
            medians=f"{was:.1f} -> {now:.1f}",
            p=f"{each.latency.probability:.2g}",
        )
    return say(
        KINDS[each.kind][1],
        place=place_text(each.place),
        operation=asked(each.rows[0].operation),
        parameters=_named(each, found),
    )


def _submodule(each: Faults) -> str:
    """`press-1 slot 1.1`; of a channel that was named by hand only the device is known."""
    device = escape(each.device)
    return device if each.slot is None else f"{device} slot {slot_number(each.slot, each.subslot)}"


def _named(each: Conclusion, found: Difference) -> Both:
    """The first of its parameters with what matters of them, and how many elements there are beside."""
    all_ = runs(each.rows, lambda row: (failures(row, each.kind), shares(row)))
    named = [_brief(run, each.kind, found) for run in all_[:_NAMED]]
    left = sum(len(run.rows) for run in all_[_NAMED:])
    return joined([*named, *([say("diff_elements_more", n=left)] if left else [])])


def _brief(run: ElementRun, kind: str, found: Difference) -> Both:
    """`p2900[0] 10.0 -> 12.0`, `p2900[0] (0x11 ...)`, `p2900[0..3] 1 of 27 -> 9 of 12`."""
    name = element_text(run)
    if kind in ("values", "last-values", "written", "changing"):
        sides = [_last(run, side) for side in ("a", "b")]
        return Both(*(f"{name} {was} -> {now}" for was, now in zip(*sides, strict=True)))
    if kind in ("more-fail", "fewer-fail"):
        return Both.same(f"{name} {' -> '.join(f'{n:,}/{of:,}' for n, of in shares(run.first))}")
    failed = (_failure(each, run, found) for each in failures(run.first, kind))
    return Both.same(f"{name} ({', '.join(failed)})")


def _failure(kind: object, run: ElementRun, found: Difference) -> str:
    """`0x11 not in this operating state`, `STATUS DF80B500`, `-` for a negative response without a number."""
    if isinstance(kind, int):
        return _error(kind, run.first.element.place.device, found)
    return "-" if kind is None else f"STATUS {escape(str(kind))}"


def sections(found: Difference) -> list[Section]:
    """What differs, asked for by the same requests and by others; where there is something."""
    return _sections(found, _DIFFERENT)


def rest(found: Difference) -> list[Section]:
    """What was not compared."""
    return _sections(found, _REST | ({kinds.OPEN: "diff_no_value"} if found.of_last_values else {}))


def _sections(found: Difference, headings: dict[str, str]) -> list[Section]:
    all_ = [Section(say(title), runs(found.of(kind))) for kind, title in headings.items()]
    return [section for section in all_ if section.runs]


def rest_text(section: Section) -> Both:
    """How much of it there is: `12 elements in A, 3 elements in B`."""
    rows = [row for run in section.runs for row in run.rows]
    sides = [
        {row.element for row in rows if row.a is not None},
        {row.element for row in rows if row.b is not None},
    ]
    if sides[0] == sides[1]:
        return say("diff_elements", n=len(sides[0]))
    counts = (("diff_in_a", len(sides[0])), ("diff_in_b", len(sides[1])))
    return joined([say(key, text=say("diff_elements", n=count)) for key, count in counts if count])


def notes(found: Difference) -> list[Both]:
    """What a capture does not show of its requests, where that limits what is said of "one capture only"."""
    if not found.of(kinds.ONLY, kinds.OTHER_OPERATION, kinds.OTHER_WAY):
        return []
    sides = zip("AB", found.unknown, strict=True)
    return [say("diff_unknown", capture=name, n=count) for name, count in sides if count]


def runs(
    rows: Iterable[ElementDifference], about: Callable[[ElementDifference], object] = lambda _: None
) -> list[ElementRun]:
    """Rows put together to runs, in the order of their parameters; in one run `about` gives the same for all."""
    found: list[list[ElementDifference]] = []
    ordered = sorted(
        rows, key=lambda row: (row.element.place.sort_key, row.element.pnu, row.operation)
    )
    for row in ordered:
        if found and _follows(found[-1][-1], row) and about(found[-1][-1]) == about(row):
            found[-1].append(row)
        else:
            found.append([row])
    return [ElementRun(tuple(each)) for each in found]


def _follows(one: ElementDifference, other: ElementDifference) -> bool:
    mine, theirs = one.element, other.element
    return (
        mine._replace(subindex=mine.subindex + 1) == theirs
        and (one.operation, one.result, one.unit) == (other.operation, other.result, other.unit)
        and _kind(one.a) == _kind(other.a)
        and _kind(one.b) == _kind(other.b)
        and _known(one) == _known(other)
    )


def _known(row: ElementDifference) -> list[object]:
    """Of last values how both are known; nothing of other rows."""
    sides = [row.a, row.b] if row.operation == kinds.LAST else []
    return [side and list(side.of_requests) for side in sides]


def _kind(side: Outcomes | None) -> tuple[object, ...] | None:
    """What a line says of one side, but for the last value."""
    if side is None:
        return None
    return side.asked, side.values, side.distinct, side.format, side.negative, side.refused


def place_text(place: Place) -> str:
    """A place in words, unique for each: `press-1-drive DO 2`, `192.168.0.1 slot 1.1 axis 2`."""
    words = [escape(place.device)]
    if place.drive_object is not None:
        words.append(f"DO {place.drive_object}")
    if place.slot is not None:
        words.append(f"slot {slot_number(place.slot, place.subslot)}")
    if place.axis is not None:
        words.append(f"axis {place.axis}")
    if place.local:
        words.append("(0xB02E)")
    return " ".join(words)


def parameter_text(run: ElementRun) -> str:
    """The parameter elements of a run: `192.168.0.1 DO 2 p2900[0]`, `.. p2902[2..5]`."""
    element = run.first.element
    return f"{place_text(element.place)} {element_text(run)}"


def element_text(run: ElementRun) -> str:
    """The same without the place: `p2900[0]`, `r2902[2..5]`."""
    first, last = (run.rows[place].element.subindex for place in (0, -1))
    index = f"{first}" if first == last else f"{first}..{last}"
    return f"{spelling(run.first.element.pnu, run.first.family)}[{index}]"


def side_text(run: ElementRun, side: str, found: Difference) -> Both:
    """What capture "a" or "b" shows of a run."""
    first: Outcomes | None = getattr(run.first, side)
    if first is None:
        return say("diff_absent")
    device = run.first.element.place.device
    parts = [_values(run, side)] if first.values else []
    parts += [
        say("diff_negative_bare", n=count)
        if code is None
        else say("diff_negative", n=count, error=_error(code, device, found))
        for code, count in sorted(first.negative.items(), key=lambda each: each[0] or 0)
    ]
    parts += [
        say("diff_refused", n=count, status=escape(status))
        for status, count in sorted(first.refused.items())
    ]
    parts += [say("diff_unseen", n=first.open)] if first.open else []
    return joined(parts)


def _error(code: int, device: str, found: Difference) -> str:
    return f"{error_hex(code)} {escape(found.texts.get((device, code), ''))}".strip()


def asked(word: str) -> Both:
    """The name of what a row compares: an operation, or the last value."""
    return say("diff_last_value") if word == kinds.LAST else operation(word)


def _values(run: ElementRun, side: str) -> Both:
    """How often there was a value, and the last one; of a last value how it is known."""
    first: Outcomes = getattr(run.first, side)
    if run.first.operation == kinds.LAST:
        ((how, certain),) = first.of_requests
        known = say("diff_last_read" if how == "read" else "diff_last_written")
        last = _last(run, side).joined(known, ", ", "，")
        return last if certain else last.joined(say("diff_last_unsure"), ", ", "，")
    once, often = _VALUES[run.first.operation]
    if first.distinct > 1:
        return say(often, n=first.values, values=str(first.distinct), value=_last(run, side))
    return say(once, n=first.values, value=_last(run, side))


def _last(run: ElementRun, side: str) -> Both:
    """The last values of a run in capture "a" or "b"; with the format where the other has another one."""
    row = run.first
    all_: list[Outcomes] = [getattr(each, side) for each in run.rows]
    first = all_[0]
    last = [each.last for each in all_]
    if is_whole(first.format):
        last = ["".join(map(str, last))]
    unit = f" {escape(row.unit)}" if row.unit else ""
    formats = {each.format for each in (row.a, row.b) if each is not None and each.values}
    kind = f" ({escape(str(first.format))})" if len(formats) > 1 else ""
    return Both(*(values(last, first.format, lang) + unit + kind for lang in ("en", "zh")))


def line(run: ElementRun, found: Difference) -> Both:
    """A run as a line: its parameters, and what both captures show of them."""
    return say(
        "diff_sides",
        parameter=parameter_text(run),
        operation=asked(run.first.operation),
        a=side_text(run, "a", found),
        b=side_text(run, "b", found),
    )


def changed(rows: list[tuple[str, int, int]]) -> list[tuple[str, int, int]]:
    """The counts that are not the same in both captures."""
    return [row for row in rows if row[1] != row[2]]


def finding_text(rule: str, was: int, now: int) -> Both:
    """How often a rule was found: `DS410 drive-error: 3 -> 5`."""
    known = spec.rules().get(rule)
    name = f"{escape(rule)} {known.name if known else ''}".strip()
    return count_text(Both.same(name), was, now)


def count_text(name: Both, was: int, now: int) -> Both:
    """How often there was something, in A and in B."""
    return say("diff_row", what=name, text=f"{was:,} -> {now:,}")


def shift_text(each: LatencyDifference) -> Both:
    """What became of the latency, in words that do not claim more than the numbers hold."""
    if each.probability is None:
        return say("diff_few")
    key = "diff_no_shift"
    if each.significant:
        key = "diff_slower" if each.is_slower else "diff_quicker"
    return say(key, p=f"{each.probability:.2g}")


def latency_text(each: LatencyDifference) -> Both:
    """Durations of one operation on one device as a line."""
    return say(
        "diff_latency",
        device=escape(each.device),
        operation=operation(each.operation),
        medians=f"{each.medians[0]:.1f} -> {each.medians[1]:.1f}",
        p95=f"{each.p95[0]:.1f} -> {each.p95[1]:.1f}",
        a=str(each.counts[0]),
        b=str(each.counts[1]),
        shift=shift_text(each),
    )
