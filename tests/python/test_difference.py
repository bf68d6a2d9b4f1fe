"""`ds47 diff`: what differs between two captures, and what the numbers allow to say."""

from __future__ import annotations

import io
import json
from copy import deepcopy

import pytest

from ds47.analysis import analyze
from ds47.regression import baseline
from ds47.regression.difference import difference, mann_whitney
from ds47.report.difference import lines, write


@pytest.fixture
def a(captures):
    return baseline.content(analyze(captures / "tour-machine.pcapng"))


def test_nothing_differs_from_itself(a):
    found = difference(a, deepcopy(a), ("a", "b"))
    assert found.parameters
    assert found.changed == []
    assert found.errors == []
    assert all(was == now for _, was, now in found.findings)


def test_a_value_and_a_refusal(a):
    b = deepcopy(a)
    read = next(
        item for item in b["transactions"] if item["state"] == "ok" and item["operation"] == "read"
    )
    parameter = read["parameters"][0]
    parameter["values"] = [77.5]
    b["transactions"] = [read]
    b["findings"] = []
    found = difference(a, b, ("a.pcap", "b.pcap"))
    text = "\n".join(lines(found))
    assert f"p{parameter['pnu']}[{parameter['subindex']}]" in text
    assert "-> 77.5" in text
    assert "gone: " in text
    assert "-> not asked" in text


def test_two_addresses_of_one_drive_are_one_drive(a):
    b = json.loads(
        json.dumps(a).replace("192.168.133.33", "10.0.0.7").replace("press-1-drive", "press-2")
    )
    assert difference(a, b, ("a", "b")).changed == []


def test_json_and_html(a):
    b = deepcopy(a)
    b["devices"][0]["station"] = '<script>alert("1")</script>'
    found = difference(a, b, ("a&b", '"<b>"'))
    stream = io.StringIO()
    write(found, "html", stream)
    page = stream.getvalue()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert "a&amp;b" in page
    stream = io.StringIO()
    write(found, "json", stream)
    document = json.loads(stream.getvalue())
    assert document["schema"] == "ds47.diff/1"
    assert len(document["parameters"]) == len(found.parameters)


def test_mann_whitney_against_published_values():
    # Values computed with R's wilcox.test(exact = FALSE), which uses the same corrections.
    assert mann_whitney([1.0] * 10, [1.0] * 10) == 1.0
    low, high = [float(n) for n in range(1, 11)], [float(n) for n in range(11, 21)]
    assert mann_whitney(low, high) == pytest.approx(0.0001826718, rel=1e-4)
    mixed = mann_whitney([1.0, 3, 5, 7, 9, 11, 13, 15], [2.0, 4, 6, 8, 10, 12, 14, 16])
    assert mixed == pytest.approx(0.7132, abs=2e-3)


def test_a_shift_is_called_real_only_where_it_is(a):
    item = next(item for item in a["transactions"] if item["duration_ms"])
    a["transactions"] = [deepcopy(item) | {"duration_ms": 10.0 + n / 10} for n in range(30)]
    b = deepcopy(a)
    (same,) = difference(a, b, ("a", "b")).latencies
    assert not same.significant
    for each in b["transactions"]:
        each["duration_ms"] += 5
    (slower,) = difference(a, b, ("a", "b")).latencies
    assert slower.significant
    assert slower.medians[1] - slower.medians[0] == pytest.approx(5)
    few = {**b, "transactions": b["transactions"][:3]}
    (unknown,) = difference(a, few, ("a", "b")).latencies
    assert unknown.probability is None
