"""What counts as a change, which transaction is which, and taking chosen changes over."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import pytest

from ds47.analysis import AnalysisOptions, analyze
from ds47.regression import baseline
from ds47.regression.accept import WhereError, chosen, merge, parse_where
from ds47.regression.compare import Change, Comparison, compare
from ds47.regression.config import Config, Ignore, Mask, ParameterTolerance, Tolerance
from ds47.regression.difference import difference
from ds47.regression.difference_report import lines
from ds47.regression.run import CheckOutcome, fails
from ds47.regression.shape import flaw
from ds47.regression.summary import Summary
from ds47.spec import error_text

CAPTURE = Path("fw/a.pcapng")


@pytest.fixture
def stored(captures):
    result = analyze(captures / "tour-machine.pcapng", AnalysisOptions(digest=True))
    return baseline.content(result)


@pytest.fixture
def now(stored):
    """The same test recorded again: another file, later, in other frames."""
    again = deepcopy(stored)
    again["sha256"] = "0" * 64
    again["frames"] += 5
    for item in again["transactions"]:
        item["start"] = "2030-01-01T00:00:00.000000000Z"
        item["ar"] = "11111111-0000-0000-0000-000000000000"
        item["duration_ms"] = item["duration_ms"] and item["duration_ms"] * 1.3
        for key in ("write_request", "write_response", "read_request", "read_response"):
            item["frames"][key] = item["frames"][key] and item["frames"][key] + 5
    for finding in again["findings"]:
        finding["frame"] += 5
    return again


def texts(stored, now, config=Config()):  # noqa: B008
    return [change.text for change in compare(stored, now, config, CAPTURE)]


def valued(capture):
    """A transaction that read one float."""
    return next(
        item
        for item in capture["transactions"]
        if item["state"] == "ok" and item["parameters"][0]["format"] == "Float32"
    )


def test_equal_is_equal(stored):
    assert texts(stored, deepcopy(stored)) == []


def test_another_recording_repeats_no_frames_and_no_times(stored, now):
    assert texts(stored, now) == []


def test_the_same_file_has_to_repeat_everything(stored, now):
    now["sha256"] = stored["sha256"]
    found = "\n".join(texts(stored, now))
    for word in ("frames was", "start was", "ar was", "duration_ms was"):
        assert word in found


def test_a_value(stored, now):
    item = valued(now)
    pnu, subindex = item["parameters"][0]["pnu"], item["parameters"][0]["subindex"]
    was = item["parameters"][0]["values"][0]
    item["parameters"][0]["values"][0] = 12.5
    (change,) = compare(stored, now, Config(), CAPTURE)
    assert change.text == f"transaction {item['id']}: p{pnu}[{subindex}] was {was}, is 12.5"
    assert (change.kind, change.pnu, change.subindex) == ("value", pnu, subindex)
    assert change.device == item["device"]
    assert fails(change, "never")


def test_tolerances(stored, now):
    item = valued(now)
    parameter = item["parameters"][0]
    parameter["values"][0] += 0.001
    assert len(texts(stored, now)) == 1
    assert texts(stored, now, Config(tolerance=Tolerance(float_absolute=0.01))) == []
    assert texts(stored, now, Config(tolerance=Tolerance(float_relative=0.1))) == []
    own = ParameterTolerance(parameter["pnu"], absolute=0.01)
    assert texts(stored, now, Config(parameters=(own,))) == []
    other = ParameterTolerance(parameter["pnu"], subindex=77, absolute=0.01)
    assert len(texts(stored, now, Config(parameters=(other,)))) == 1


def test_an_integer_has_no_float_tolerance(stored, now):
    for capture, value in ((stored, 100), (now, 101)):
        parameter = valued(capture)["parameters"][0]
        parameter["format"], parameter["values"] = "Unsigned16", [value]
    assert len(texts(stored, now, Config(tolerance=Tolerance(float_absolute=5)))) == 1


def test_durations_count_only_where_asked_and_only_when_longer(stored, now):
    slow = Config(tolerance=Tolerance(duration_relative=0.1))
    assert any("duration_ms was" in text for text in texts(stored, now, slow))
    assert texts(stored, now, Config(tolerance=Tolerance(duration_relative=0.5))) == []
    assert texts(now, {**stored, "sha256": "1"}, slow) == []


def test_masks(stored, now):
    parameter = valued(now)["parameters"][0]
    parameter["values"][0] = -1.0
    mask = Mask(parameter["pnu"], "moves by itself")
    assert texts(stored, now, Config(masks=(mask,))) == []
    parameter["format"] = "Float64"
    assert len(texts(stored, now, Config(masks=(mask,)))) == 1, "only values are masked"


def test_what_no_request_names_has_no_number(stored, now):
    """As in a report: a response whose request is not in the capture."""
    new = deepcopy(now["transactions"][1])
    new |= {"state": "orphan", "id": len(now["transactions"]) + 1}
    new["parameters"][0] |= dict.fromkeys(("pnu", "subindex", "attribute", "element_count"))
    now["transactions"].append(new)
    (text,) = texts(stored, now)
    assert "None" not in text
    assert f"{new['operation']} p?, orphan" in text
    (text,) = texts(now, stored)
    assert "None" not in text


@pytest.mark.parametrize("place", [0, 3, -1])
def test_a_transaction_more_is_one_change(stored, now, place):
    new = deepcopy(now["transactions"][1])
    new["parameters"][0]["pnu"] = 4711
    now["transactions"].insert(place if place >= 0 else len(now["transactions"]), new)
    for number, item in enumerate(now["transactions"], 1):
        item["id"] = number
    for finding in now["findings"]:
        old = finding["transaction"]
        if old and 0 <= place < old:
            finding["transaction"] += 1
    (text,) = texts(stored, now)
    assert "is new" in text
    assert "p4711" in text


def test_a_transaction_less_is_one_change_and_its_findings(stored, now):
    gone = now["transactions"].pop(0)
    now["findings"] = [each for each in now["findings"] if each["transaction"] != gone["id"]]
    for finding in now["findings"]:
        finding["transaction"] = finding["transaction"] and finding["transaction"] - 1
    for number, item in enumerate(now["transactions"], 1):
        item["id"] = number
    kinds = {change.kind for change in compare(stored, now, Config(), CAPTURE)}
    assert "transaction_gone" in kinds
    assert kinds <= {"transaction_gone", "finding_gone"}


def test_many_equal_transactions_stay_quick(stored):
    stored["transactions"] = [deepcopy(valued(stored)) for _ in range(4000)]
    for number, item in enumerate(stored["transactions"], 1):
        item["id"] = number
    stored["findings"] = []
    now = deepcopy(stored)
    del now["transactions"][2000]
    now["sha256"] = "0"
    assert len(compare(stored, now, Config(), CAPTURE)) == 1


def test_findings(stored, now):
    now["findings"].append(
        {"rule": "DS410", "severity": "error", "message": "m", "frame": 9, "transaction": 1,
         "filter": "frame.number == 9"}
    )  # fmt: skip
    (change,) = compare(stored, now, Config(), CAPTURE)
    assert (change.kind, change.rule) == ("finding_new", "DS410")
    assert fails(change, "error")
    assert not fails(change, "never")
    ignore = Ignore("DS410", "known", pnu=now["transactions"][0]["parameters"][0]["pnu"])
    assert texts(stored, now, Config(ignores=(ignore,))) == []


def test_a_note_that_is_new_fails_only_where_notes_do():
    change = Change("finding_new", "", is_now={"severity": "note"})
    assert fails(change, "note")
    assert not fails(change, "warning")
    assert not fails(Change("finding_gone", ""), "note")


def test_a_device(stored, now):
    now["devices"][0]["device_id"] = 7
    (change,) = compare(stored, now, Config(), CAPTURE)
    assert change.kind == "device"
    assert "device_id was" in change.text


def test_accepting_everything_in_parts_leaves_nothing(stored, now):
    parameter = valued(now)["parameters"][0]
    parameter["values"][0] = 1.25
    now["transactions"][0]["state"] = "partial"
    now["devices"][0]["device_id"] = 7
    changes = compare(stored, now, Config(), CAPTURE)
    assert len(changes) == 3
    which = Comparison(stored, now, Config(), CAPTURE).pairs
    some = [change for change in changes if change.kind == "value"]
    merged = merge(stored, now, which, some)
    left = compare(merged, now, Config(), CAPTURE)
    assert {change.kind for change in left} == {"state", "device"}
    merged = merge(merged, now, Comparison(merged, now, Config(), CAPTURE).pairs, left)
    assert compare(merged, now, Config(), CAPTURE) == []


def test_accepting_a_new_transaction_counts_the_others_on(stored, now):
    new = deepcopy(now["transactions"][1])
    new["parameters"][0]["pnu"] = 4711
    now["transactions"].insert(2, new)
    for number, item in enumerate(now["transactions"], 1):
        item["id"] = number
    for finding in now["findings"]:
        if finding["transaction"] and finding["transaction"] > 2:
            finding["transaction"] += 1
    which = Comparison(stored, now, Config(), CAPTURE).pairs
    merged = merge(stored, now, which, compare(stored, now, Config(), CAPTURE))
    assert [item["id"] for item in merged["transactions"]] == list(
        range(1, len(merged["transactions"]) + 1)
    )
    assert merged["summary"]["transactions"] == len(now["transactions"])
    assert compare(merged, now, Config(), CAPTURE) == []


def test_where():
    change = Change("value", "", pnu=964, subindex=1, device="10.0.0.1", rule=None)
    assert chosen(change, parse_where([]), CAPTURE)
    assert chosen(change, parse_where(["pnu=964", "subindex=1", "kind=value"]), CAPTURE)
    assert chosen(change, parse_where(["capture=fw/*", "device=10.*"]), CAPTURE)
    for wrong in ("pnu=965", "subindex=0", "kind=error", "rule=DS4", "capture=b*", "device=11.*"):
        assert not chosen(change, parse_where([wrong]), CAPTURE)
    finding = Change("finding_new", "", rule="DS410")
    for right in ("rule=DS410", "rule=ds4", "rule=DS*", "rule=drive-error"):
        assert chosen(finding, parse_where([right]), CAPTURE)
    assert not chosen(finding, parse_where(["rule=two-users"]), CAPTURE)


@pytest.mark.parametrize("text", ["pnu", "pnu=", "pnu=x", "what=1", "kind=colour"])
def test_a_where_that_means_nothing_is_wrong_use(text):
    with pytest.raises(WhereError, match="--where"):
        parse_where([text])


def _places(item, path=()):
    """Every place in an object, as keys that lead there."""
    for key, value in item.items() if isinstance(item, dict) else enumerate(item):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from _places(value, (*path, key))


@pytest.mark.parametrize("name", ["conversation-error", "tour-machine"])
def test_a_result_stored_in_another_language_is_no_change(captures, name):
    result = analyze(captures / f"{name}.pcapng")
    stored, now = baseline.content(result, "zh"), baseline.content(result)
    assert stored["transactions"] != now["transactions"]
    assert compare(stored, now, Config(), CAPTURE) == []


def test_an_error_number_is_worded_in_the_language_asked_for(captures):
    now = baseline.content(analyze(captures / "conversation-error.pcapng"))
    stored = deepcopy(now)
    (parameter, *_) = (each for item in stored["transactions"] for each in item["parameters"])
    error = parameter["error"]
    error["code"], error["text"] = 0x6B, error_text(0x6B, "en", 0x2A)
    (change,) = compare(stored, now, Config(), CAPTURE, "zh")
    assert change.kind == "error"
    assert error_text(0x6B, "zh", 0x2A) in change.text
    assert error["text"] not in change.text


_GONE = object()


@pytest.mark.parametrize(
    "other",
    [_GONE, None, "zz", -7, 1.5, [], {}, [None], {"code": "x"}],
    ids=lambda other: "gone" if other is _GONE else str(other),
)
def test_a_stored_result_is_refused_or_compared_but_breaks_nothing(captures, other):
    """Whatever stands anywhere in the file."""
    now = baseline.content(analyze(captures / "conversation-error.pcapng"))
    later = deepcopy(now)
    del later["transactions"][0]
    later["findings"] = later["diagnoses"] = []
    refused = 0
    for path in list(_places(now)):
        stored = deepcopy(now)
        place = stored
        for key in path[:-1]:
            place = place[key]
        if other is _GONE:
            del place[path[-1]]
        else:
            place[path[-1]] = other
        if flaw(stored) is not None:
            refused += 1
            continue
        for present in (now, later):
            comparison = Comparison(stored, present, Config(), CAPTURE)
            changes = list(comparison.changes())
            merge(stored, present, comparison.pairs, changes[::2])
            list(lines(difference(stored, present, ("a", "b"))))
            outcome = CheckOutcome("", CAPTURE, present, stored, None, changes, comparison.pairs)
            Summary().add(outcome)
    assert 0 < refused < len(list(_places(now)))


def test_the_file_is_stable_and_says_how_to_update_it(stored, tmp_path):
    path = tmp_path / "a.ds47.json"
    baseline.save(path, stored, "a.pcapng")
    text = path.read_bytes()
    first = text.split(b"\n")[0].decode()
    assert first.startswith('{"#": "stored result of a.pcapng')
    assert "ds47 accept" in first
    assert b"\r" not in text
    assert baseline.load(path).content == stored
    path.write_bytes(text.replace(b"\n", b"\r\n"))
    assert baseline.load(path).content == stored, "a checkout with CRLF is the same result"
    baseline.save(path, dict(reversed(stored.items())), "a.pcapng")
    assert path.read_bytes() == text


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"schema": "ds47.baseline/1", "capture": 1}', "[" * 9999]
)
def test_what_is_no_stored_result_says_so(tmp_path, content):
    path = tmp_path / "a.ds47.json"
    path.write_text(content)
    with pytest.raises(baseline.BaselineError) as problem:
        baseline.load(path)
    assert str(path) in str(problem.value)


def test_where_it_stands(tmp_path):
    for name in ("a.pcap", "b.pcapng", "b.pcap", "c.pcapng.gz", "d.cap"):
        (tmp_path / name).touch()
    names = {
        name: baseline.path_of(tmp_path / name).name
        for name in ("a.pcap", "b.pcapng", "b.pcap", "c.pcapng.gz")
    }
    assert names == {
        "a.pcap": "a.ds47.json",
        "b.pcapng": "b.pcapng.ds47.json",
        "b.pcap": "b.pcap.ds47.json",
        "c.pcapng.gz": "c.ds47.json",
    }
