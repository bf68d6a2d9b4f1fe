"""What changed between a stored result and the present one, in the words of people.

Pure: two capture objects of `ds47.report/1` or `/2` and a configuration in, changes out. Nothing is read or
written, and nothing decides whether a change is good.

The same file (equal SHA-256; of a series those of all files) must give the same result in every field.
Another recording of the same test repeats what was asked and answered, but not frames, times,
connections and bytes: those are not compared then (docs/regression.md).
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from math import isclose
from pathlib import Path
from typing import Any, NamedTuple

from ds47 import spec
from ds47.model import S7, SEVERITIES, CaptureFile
from ds47.profidrive.dictionary import family_of
from ds47.profidrive.naming import element, spelling
from ds47.regression.config import Config, ParameterTolerance
from ds47.regression.elements import vendor_of
from ds47.report import contract, load
from ds47.report.bilingual import LANGUAGES, Both, operation, say, state
from ds47.report.file_frames import FileFrames
from ds47.report.sentences import at_offset, error_words, sentence

KINDS = (
    "value", "error", "state", "timing", "field", "finding_new", "finding_gone",
    "transaction_new", "transaction_gone", "device", "count",
    "event",
)  # fmt: skip
"""What a change can be about."""

_FLOATS = ("Float32", "Float64")
_EVENT = ("name", "word", "before", "after", "state")
_SAID = (
    "operation",
    "request_reference",
    "axis",
    "controller",
    "device",
    "api",
    "slot",
    "subslot",
    "index",
)
_OTHERWISE = ("id", "state", "duration_ms", "parameters", "findings", *_SAID)
_RECORDED = tuple(
    key.name for key in contract.TRANSACTION.keys if not key.channel and key.name not in _OTHERWISE
)
"""Fields that only the same file repeats; the status of a refusal stands in its findings."""
_COUNTED = ("request_reference", "connection", "r_id", "error", "segments")
"""Likewise of S7, whose references count on from connection to connection."""
_COUNTS = ("frames", "complete", "rpc", "records", "connections")
_RULES_OF_S7 = "DS9"
_ADDRESS = ("attribute", "pnu", "subindex", "element_count")
_DESCRIBED = ("name", "unit")
"""What a description may have said; a result of a version that learned nothing has it otherwise."""

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is not as it was stored.

    Attributes:
        kind: one of KINDS.
        text: what changed, as people read it.
        stored, now: 0-based positions of the transaction in the two results; None where there is none.
        path: keys inside the transaction (or the capture object) that lead to what changed.
        was, is_now: the two values; None where there is none.
        pnu, subindex, device, rule: what it is about, for `ds47 accept --where`.
        version: the version of ds47 that alone causes it (`ds47.regression.versions`), else None.
        because: what changed in that version: a rule, a state, or a key of `otherwise` in spec/rules.toml.
    """

    kind: str
    text: str
    stored: int | None = None
    now: int | None = None
    path: tuple[str | int, ...] = ()
    was: Any = None
    is_now: Any = None
    pnu: int | None = None
    subindex: int | None = None
    device: str | None = None
    rule: str | None = None
    version: str | None = None
    because: str | None = None


def compare(
    stored: Json, now: Json, config: Config, capture: Path, lang: str = "en"
) -> list[Change]:
    """All changes, in the order of the transactions of the present result.

    Args:
        stored: the stored capture object.
        now: the present one.
        config: tolerances, masks and known findings.
        capture: the file, for the patterns of the configuration.
        lang: language of the texts, "en" or "zh".
    """
    return list(Comparison(stored, now, config, capture, lang).changes())


class Comparison:
    """Two results side by side: `pairs`, made once, and the `changes` between them.

    Attributes:
        pairs: which transaction of the stored result is which of the present one, as 0-based positions;
            one that was added or is missing stands alone, and does not disturb the others.
        same_file: whether both are of the same file, not of two recordings.
    """

    def __init__(
        self, stored: Json, now: Json, config: Config, capture: Path, lang: str = "en"
    ) -> None:
        self._old, self._new = stored, now
        self._lang = lang
        self._config, self._capture = config, capture
        self.same_file = _digests(stored) == _digests(now) and None not in _digests(now)
        self._with_args = all(
            "args" in each for result in (stored, now) for each in result.get("findings", [])
        )
        self._old_frames, self._new_frames = _file_frames(stored), _file_frames(now)
        self._vendors = {
            each["ip"]: vendor_of(each)
            for result in (stored, now)
            for each in result.get("devices", [])
        }
        self._knows_s7 = "connections" in stored or "connections" not in now
        """A stored result that does not know S7 communication says nothing of it."""
        self._olds: list[Json] = stored["transactions"]
        self._news: list[Json] = now["transactions"]
        self.pairs = self._align()

    def changes(self) -> Iterator[Change]:
        """Devices and counts first, then transaction by transaction, then findings."""
        yield from self._devices()
        if self.same_file:
            for key in _COUNTS if self._knows_s7 else _COUNTS[:-1]:
                if self._old.get(key) != self._new.get(key):
                    yield self._field("count", _Where("capture"), (key,), self._old, self._new)
        for old, new in self.pairs:
            if old is None and new is not None:
                if self._news[new].get("channel") == S7 and not self._knows_s7:
                    continue
                yield self._alone("transaction_new", None, new, self._news[new])
            elif new is None and old is not None:
                yield self._alone("transaction_gone", old, None, self._olds[old])
            elif old is not None and new is not None:
                yield from self._fields(old, new, self._olds[old], self._news[new])
        yield from self._events()
        yield from self._findings()

    # Which transaction is which

    def _align(self) -> list[tuple[int | None, int | None]]:
        """Equal ones from both ends, in between those of the same frames of one file, else the n-th of a kind.

        Linear in the number of transactions, however often one of them repeats.
        """
        olds, news = self._olds, self._news
        front = 0
        while front < min(len(olds), len(news)) and self._equal(olds[front], news[front]):
            front += 1
        back = 0
        while back < min(len(olds), len(news)) - front and self._equal(
            olds[-1 - back], news[-1 - back]
        ):
            back += 1
        there, here = range(front, len(olds) - back), range(front, len(news) - back)
        framed = self._of_same_frames(there, here) if self.same_file else {}
        taken = set(framed.values())
        waiting: defaultdict[Any, deque[int]] = defaultdict(deque)
        for at in there:
            if at not in taken:
                waiting[_kind(olds[at])].append(at)
        middle: list[tuple[int | None, int | None]] = []
        for at in here:
            same = waiting[_kind(news[at])] if at not in framed else None
            middle.append((same.popleft() if same else framed.get(at), at))
        middle += [(at, None) for left in waiting.values() for at in left]
        middle.sort(key=_order)
        ends = [(len(olds) - n, len(news) - n) for n in range(back, 0, -1)]
        return [(at, at) for at in range(front)] + middle + ends

    def _of_same_frames(self, there: range, here: range) -> dict[int, int]:
        """Which stored transaction of the same kind has the request of a present one, or else its response."""
        pairs: dict[int, int] = {}
        for name in ("write_request", "read_response"):
            taken = set(pairs.values())
            olds = {
                (frame, _kind(self._olds[at])): at for at in there
                if at not in taken and (frame := _frame(self._olds[at], name))
            }  # fmt: skip
            for at in here:
                frame = _frame(self._news[at], name) if at not in pairs else None
                old = olds.pop((frame, _kind(self._news[at])), None) if frame else None
                if old is not None:
                    pairs[at] = old
        return pairs

    def _equal(self, old: Json, new: Json) -> bool:
        return _kind(old) == _kind(new) and next(self._fields(0, 0, old, new), None) is None

    # One transaction

    def _fields(self, stored: int, now: int, old: Json, new: Json) -> Iterator[Change]:
        where = _Where("transaction", {"number": str(new["id"])})
        about = {"stored": stored, "now": now, "device": new["device"]}
        s7 = new.get("channel") == S7
        said = tuple(key for key in _SAID if key not in _COUNTED) if s7 else _SAID
        recorded = _RECORDED + (_COUNTED if s7 else ())
        for key in ("state", *said, *(recorded if self.same_file else ())):
            if key in old and old[key] != new.get(key):  # an older result has not all keys
                kind = "state" if key == "state" else "field"
                yield self._field(kind, where, (key,), old, new, **about)
        if not self._duration_fits(old.get("duration_ms"), new.get("duration_ms")):
            yield self._field("timing", where, ("duration_ms",), old, new, **about)
        if s7:
            yield from self._items(where, old.get("items", []), new.get("items", []), about)
        olds, news = old["parameters"], new["parameters"]
        if len(olds) != len(news):
            text = self._say("change_parameters", where, was=str(len(olds)), now=str(len(news)))
            yield Change(
                "field", text,
                path=("parameters",), was=olds, is_now=news, **about,
            )  # fmt: skip
            return
        for number, (before, after) in enumerate(zip(olds, news, strict=True)):
            yield from self._parameter(where, number, before, after, about)

    def _items(
        self, where: _Where, olds: list[Json], news: list[Json], about: Json
    ) -> Iterator[Change]:
        """The items of a job of S7; what programs read and write differs from recording to recording."""
        keys = ("address", "code", *(("length", "value") if self.same_file else ()))
        nothing: Json = {}
        for number, (before, after) in enumerate(zip_longest(olds, news, fillvalue=nothing)):
            for key in keys:
                was, now = before.get(key), after.get(key)
                if was != now:
                    name = after.get("address") or before.get("address") or str(number + 1)
                    text = self._say(
                        "change_field_of",
                        where,
                        field=key,
                        name=name,
                        was=_show(was),
                        now=_show(now),
                    )
                    yield Change(
                        "value" if key == "value" else "error" if key == "code" else "field", text,
                        path=("items", number, key), was=was, is_now=now, **about,
                    )  # fmt: skip

    def _duration_fits(self, old: float | None, new: float | None) -> bool:
        tolerance = self._config.tolerance
        if self.same_file:
            return old == new
        if tolerance.duration_relative is None and tolerance.duration_absolute_ms is None:
            return True
        if old is None or new is None:
            return old is new
        room = max(old * (tolerance.duration_relative or 0), tolerance.duration_absolute_ms or 0)
        return new - old <= room  # quicker is never a regression

    def _parameter(
        self, where: _Where, number: int, old: Json, new: Json, about: Json
    ) -> Iterator[Change]:
        pnu, first = new.get("pnu"), new.get("subindex") or 0
        about = about | {"pnu": pnu}
        family = family_of(self._vendors.get(about["device"]), new.get("family"))
        name = "value" if pnu is None else spelling(pnu, family)
        learned = ("described_in" in old) != ("described_in" in new)  # by one of two versions
        for key in (*_ADDRESS, "name", "unit", "format", "value_count"):
            if not (learned and key in _DESCRIBED) and _fact(key, old) != _fact(key, new):
                was, now = _show(old.get(key)), _show(new.get(key))
                text = self._say("change_field_of", where, field=key, name=name, was=was, now=now)
                yield Change("field", text, path=("parameters", number, key), was=old.get(key),
                             is_now=new.get(key), subindex=new.get("subindex"), **about)  # fmt: skip
        if _fact("error", old) != _fact("error", new):
            vendor_id = self._vendors.get(about["device"])
            text = self._say("change_outcome", where, name=f"{name}[{first}]",
                             was=_outcome(old, vendor_id), now=_outcome(new, vendor_id))  # fmt: skip
            yield Change("error", text, path=("parameters", number, "error"), was=old.get("error"),
                         is_now=new.get("error"), subindex=new.get("subindex"), **about)  # fmt: skip
        for key in ("values",) if learned else ("values", "scaled"):
            yield from self._values(where, name, (number, key), old, new, about)

    def _values(
        self, where: _Where, name: str, position: tuple[int, str], old: Json, new: Json, about: Json
    ) -> Iterator[Change]:
        number, key = position
        olds, news = old.get(key) or [], new.get(key) or []
        first, device = new.get("subindex") or 0, about["device"]
        if len(olds) != len(news):
            if bool(old.get("error")) == bool(new.get("error")):
                text = self._say("change_values", where, name=f"{name}[{first}]", field=key,
                                 was=str(len(olds)), now=str(len(news)))  # fmt: skip
                yield Change("value", text, path=("parameters", number, key), was=old.get(key),
                             is_now=new.get(key), subindex=first, **about)  # fmt: skip
            return
        for step, (was, is_now) in enumerate(zip(olds, news, strict=True)):
            subindex = first + step
            if self._value_fits(new, device, subindex, was, is_now):
                continue
            element = Both.same(f"{name}[{subindex}]")
            if key == "scaled":
                element = say("change_scaled", name=element)
            text = self._say("change_value", where, name=element,
                             was=_show(was), now=_show(is_now))  # fmt: skip
            yield Change("value", text, path=("parameters", number, key, step), was=was,
                         is_now=is_now, subindex=subindex, **about)  # fmt: skip

    def _value_fits(
        self, parameter: Json, device: str, subindex: int, was: Any, is_now: Any
    ) -> bool:
        if was == is_now and type(was) is type(is_now):
            return True
        pnu = parameter.get("pnu")
        if not self.same_file and self._config.masked(device, pnu, subindex, parameter.get("name")):
            return True
        if not _number(was) or not _number(is_now):
            return False
        own = self._own_tolerance(pnu, subindex)
        if own is not None:
            return isclose(was, is_now, rel_tol=own.relative, abs_tol=own.absolute)
        if parameter.get("format") not in _FLOATS:
            return bool(was == is_now)
        tolerance = self._config.tolerance
        return isclose(
            was, is_now, rel_tol=tolerance.float_relative, abs_tol=tolerance.float_absolute
        )

    def _own_tolerance(self, pnu: int | None, subindex: int) -> ParameterTolerance | None:
        for own in self._config.parameters:
            if own.pnu == pnu and own.subindex in (None, subindex):
                return own
        return None

    # What stands beside the transactions

    def _alone(self, kind: str, old: int | None, new: int | None, item: Json) -> Change:
        asked = ", ".join(
            [
                *(self._address(item, each) for each in item["parameters"][:3]),
                *(each["address"] or "?" for each in item.get("items", ())[:3]),
            ]
        )
        text = self._say(f"change_{kind}", number=str(item["id"]), operation=operation(item["operation"]),
                         asked=asked or "-", state=state(item["state"]))  # fmt: skip
        pnu = next((each["pnu"] for each in item["parameters"]), None)
        return Change(kind, text, stored=old, now=new, was=None if old is None else item,
                      is_now=None if new is None else item, pnu=pnu, device=item["device"])  # fmt: skip

    def _devices(self) -> Iterator[Change]:
        olds = {each["ip"]: each for each in self._old.get("devices", [])}
        news = {each["ip"]: each for each in self._new.get("devices", [])}
        for ip in sorted(olds.keys() | news.keys()):
            old, new = olds.get(ip), news.get(ip)
            if old == new:
                continue
            if old is None or new is None:
                text = self._say(f"change_device_{'new' if old is None else 'gone'}", ip=ip)
                yield Change("device", text, path=("devices", ip), was=old, is_now=new, device=ip)
                continue
            for key in sorted(old.keys() | new.keys()):
                if old.get(key) != new.get(key):
                    where = _Where("device", {"ip": ip})
                    yield self._field("device", where, ("devices", ip, key), old, new, device=ip)

    def _events(self) -> Iterator[Change]:
        """What happened to each drive, in its order; nothing where the stored result has no timeline."""
        olds, news = (_timelines(each, self.same_file) for each in (self._old, self._new))
        for drive in olds.keys() | news.keys() if olds else ():
            old, new = olds.get(drive, []), news.get(drive, [])
            if old == new:
                continue
            at = next(
                (n for n, (a, b) in enumerate(zip(old, new, strict=False)) if a != b),
                min(len(old), len(new)),
            )
            was, now = (_event(each[at] if at < len(each) else None) for each in (old, new))
            text = self._say("change_event", place=drive, number=str(at + 1), was=was, now=now)
            yield Change(
                "event", text, path=("timelines",), was=self._old.get("timelines"),
                is_now=self._new.get("timelines"), device=drive.split()[0],
            )  # fmt: skip

    def _findings(self) -> Iterator[Change]:
        """A finding is known by its rule and its transaction; in the same file by all it says."""
        stored_as = {new: old for old, new in self.pairs if new is not None}
        olds = Counter([key for key, _ in self._keyed(self._old, None)])
        for key, finding in self._keyed(self._new, stored_as):
            if olds[key] > 0:
                olds[key] -= 1
                continue
            if finding["rule"].startswith(_RULES_OF_S7) and not self._knows_s7:
                continue
            yield self._finding("finding_new", finding, self._news, self._new_frames)
        for key, finding in reversed(list(self._keyed(self._old, None))):
            if olds[key] > 0:
                olds[key] -= 1
                yield self._finding("finding_gone", finding, self._olds, self._old_frames)

    def _keyed(
        self, result: Json, stored_as: dict[int, int | None] | None
    ) -> Iterator[tuple[Any, Json]]:
        for finding in result.get("findings", []):
            number = finding.get("transaction")
            pnus = _pnus(result, number)
            if self._config.ignored(finding["rule"], self._capture, pnus):
                continue
            where = number
            if stored_as is not None and number is not None:
                old = stored_as.get(number - 1)
                where = f"new {number}" if old is None else old + 1
            yield (finding["rule"], where, *self._facts(finding)), finding

    def _facts(self, finding: Json) -> tuple[Any, ...]:
        """What else tells findings of the same file apart. Sentences never do: a better one is no change."""
        if not self.same_file:
            return ()
        args = _frozen(_compared(finding["args"])) if self._with_args else None
        return finding["frame"], args

    def _finding(
        self, kind: str, finding: Json, transactions: list[Json], file_frames: FileFrames
    ) -> Change:
        number = finding.get("transaction")
        item = transactions[number - 1] if number and 0 < number <= len(transactions) else None
        where = _Where("transaction", {"number": str(number)})
        if not number:
            where = _Where("frame", {"frame": file_frames.number(finding["frame"], self._lang)})
        severity = finding["severity"]
        text = self._say(
            f"change_{kind}", where, rule=finding["rule"],
            severity=say(f"severity_{severity}") if severity in SEVERITIES else severity,
            message=_sentence(finding, self._lang),
        )  # fmt: skip
        pnu = next((each["pnu"] for each in item["parameters"]), None) if item else None
        new = kind == "finding_new"
        return Change(kind, text, path=("findings",), was=None if new else finding,
                      is_now=finding if new else None, rule=finding["rule"], pnu=pnu,
                      device=item["device"] if item else None)  # fmt: skip

    # Words

    def _address(self, item: Json, parameter: Json) -> str:
        """`p2900[0]`; `p?` where no request names it."""
        pnu, subindex = parameter["pnu"], parameter["subindex"]
        family = family_of(self._vendors.get(item["device"]), parameter.get("family"))
        return "p?" if pnu is None else element(pnu, subindex, family)

    def _field(
        self, kind: str, where: _Where, path: tuple[str | int, ...], old: Json, new: Json,
        **about: Any,
    ) -> Change:  # fmt: skip
        """A change of the value at the last key of `path`."""
        key = str(path[-1])
        was, now = old.get(key), new.get(key)
        text = self._say("change_field", where, field=key, was=_show(was), now=_show(now))
        return Change(kind, text, path=path, was=was, is_now=now, **about)

    def _say(self, key: str, where: _Where | None = None, **values: str | Both) -> str:
        if where is not None:
            values["where"] = say(f"change_in_{where.what}", **where.values)
        return say(key, **values).text(self._lang)


def _timelines(result: Json, same_file: bool) -> dict[str, list[tuple[Any, ...]]]:
    """The events of each drive by device and slot; frames, telegrams and times are those of one recording."""
    relations = result.get("relations", [])
    found: dict[str, list[tuple[Any, ...]]] = {}
    for each in result.get("timelines", []):
        relation = relations[each["relation"] - 1]
        drive = f"{relation['device']} slot {relation['slot']}.{relation['subslot']}"
        telegrams = relation["telegrams"] if same_file else None
        found.setdefault(drive, []).extend(
            (*(event[key] for key in _EVENT), *((event["frame"], telegrams) if same_file else ()))
            for event in each["events"]
        )
    return found


def _event(event: tuple[Any, ...] | None) -> str:
    """`STW1 047E -> 047F on`: an event by its id, as JSON has it."""
    if event is None:
        return "-"
    name, word, before, after = event[:4]
    if word is None:
        return str(name)
    return f"{word} {'' if before is None else f'{before:04X} -> '}{after:04X} {name}"


class _Where(NamedTuple):
    """What a change is in. Its words are made where something changed: mostly nothing has."""

    what: str
    values: Mapping[str, str] = {}


def _digests(result: Json) -> list[str | None]:
    """What tells whether it is the same file; of a series the digest of each."""
    return [each.get("sha256") for each in result.get("files") or [result]]


def _file_frames(result: Json) -> FileFrames:
    files = result.get("files", ())
    return FileFrames(
        [CaptureFile(each["path"], each["first_frame"], each["frames"]) for each in files]
    )


def _kind(item: Json) -> tuple[Any, ...]:
    """What two transactions have in common that are the same request, whatever came of it."""
    asked = tuple(tuple(each.get(key) for key in _ADDRESS) for each in item["parameters"])
    access = tuple(item.get(key) for key in ("device", "slot", "subslot", "index", "axis"))
    items = tuple(each.get("address") for each in item.get("items", ()))
    return item["operation"], access, asked, items


def _frame(item: Json, name: str) -> int | None:
    frame: int | None = item["frames"][name]
    return frame


def _order(pair: tuple[int | None, int | None]) -> tuple[int, int]:
    """Reading order: by the present position; a gone one keeps its old position."""
    old, new = pair
    return (new if new is not None else old or 0, 0 if new is None else 1)


def _sentence(finding: Json, lang: str) -> str:
    """What a finding of a result says, now, whatever was said when it was stored.

    That only where the arguments are not those of a rule of this version.
    """
    try:
        item = load.finding(finding)
        text, offset = sentence(item, lang), item.offset
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        text, offset = load.message(finding["message"])
    return at_offset(offset, text, lang)


def _fact(key: str, parameter: Json) -> Any:
    """What is compared of a key of a parameter: never words, which may be those of the other language."""
    value = parameter.get(key)
    if key == "name":
        return value is not None
    return (value["code"], value.get("info")) if key == "error" and value else value


def _compared(args: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that are known, without those that older results lack and that only words need."""
    left = ("family", "among", "asked")
    return {key: value for key, value in args.items() if value is not None and key not in left}


def _frozen(item: Any) -> Any:
    """Something of JSON that can be counted; equal where it is equal."""
    if isinstance(item, dict):
        return tuple(sorted((key, _frozen(value)) for key, value in item.items()))
    return tuple(map(_frozen, item)) if isinstance(item, list) else item


def _outcome(parameter: Json, vendor_id: int | None) -> Both:
    if not parameter.get("error"):
        values = parameter.get("values") or []
        if len(values) == 1:
            return say("change_outcome_value", value=_show(values[0]))
        return say("change_outcome_answered")
    error = contract.error(parameter["error"], vendor_id)
    code = "-" if error.code is None else spec.error_hex(error.code)
    refusal = Both(*(f"{code} {error_words(error, lang)}" for lang in LANGUAGES))
    return say("change_outcome_refused", error=refusal)


def _show(value: Any) -> Both:
    if value is None:
        return say("change_nothing")
    text = str(value)
    return Both.same(text if len(text) <= 60 else text[:57] + "...")


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _pnus(result: Json, number: int | None) -> set[int]:
    transactions = result["transactions"]
    if not number or not 0 < number <= len(transactions):
        return set()
    return {
        each["pnu"] for each in transactions[number - 1]["parameters"] if each["pnu"] is not None
    }
