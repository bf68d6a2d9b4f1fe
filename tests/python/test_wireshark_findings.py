"""What a finding says where it stands, in a real tshark: in words, once, with what to do and what to send instead.

Also what stands beside the transactions: statuses in words, bytes at their place, copies of a mirror port, and
what one pass leaves out.
"""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import beside
import pytest
from test_wireshark_plugin import (
    CAPTURES,
    COMPLETE,
    PLUGIN,
    ROOT,
    Tshark,
    columns,
    make,
    program,
    rows,
    run,
    tshark,
)

from ds47.analysis import analyze
from ds47.capture import open_capture
from ds47.capture.writer import PcapngWriter
from ds47.diagnosis.suggest import corrected
from ds47.lab.client import Client
from ds47.report.sentences import advice, sentence
from ds47.report.wrap import wrap
from ds47.spec import rules
from ds47.spec.statuses import status_text

__all__ = ["make", "tshark"]  # fixtures

REFUSED = "diagnosis-index-and-count.pcapng"
COPIES = "transport-copies.pcapng"
HINT = "in one pass a transaction is shown as far as it has come"
BLIND = "with -2 alone a transaction is shown as far as it has come"


def tree(tshark: Tshark, name: str, *more: str) -> list[str]:
    """The lines of the trees of the plugin, without brackets and what is before them."""
    output = tshark("-r", CAPTURES[name], *COMPLETE, "-V", "-O", "ds47", *more)
    return [line.strip().removeprefix("[").removesuffix("]") for line in output.splitlines()]


def below(lines: list[str], title: str) -> list[str]:
    """The lines of a finding: up to the next one."""
    start = next(at for at, line in enumerate(lines) if line.startswith(title))
    ends = [
        at
        for at in range(start + 1, len(lines))
        if re.match(r"DS\d{3} \w+[:：]|Frame \d", lines[at])
    ]
    return lines[start : ends[0] if ends else len(lines)]


@pytest.mark.slow
def test_the_summary_of_an_expert_info_is_the_title_of_the_rule(tmp_path: Path) -> None:
    """The summary by which the dialog groups is the registered text of an expert info."""
    listed = fields_of(tmp_path)
    for rule in rules().values():
        wanted = None if rule.analyzer_only else f"{rule.id} {rule.title}"
        assert listed.get(f"ds47.expert.{rule.id.lower()}") == wanted


def fields_of(home: Path) -> dict[str, str]:
    """Name of each field of the plugin -> its label."""
    command = [*program(), "-G", "fields", "-X", f"lua_script:{PLUGIN}"]
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found = [line.split("\t") for line in done.stdout.splitlines() if line.startswith("F\t")]
    return {row[2]: row[1] for row in found if row[2].startswith("ds47.")}


@pytest.mark.parametrize(
    ("name", "rule", "severity", "group"),
    [
        (REFUSED, "DS410", "Note", "Response"),  # an error code that drives commonly give
        ("record-write-refused.pcapng", "DS203", "Warning", "Response"),
        ("transport-reject.pcapng", "DS104", "Warning", "Response"),
        ("message-missing-request.pcapng", "DS315", "Error", "Malformed"),
        ("conversation-superseded-read.pcapng", "DS413", "Warning", "Sequence"),
        ("record-polls-many.pcapng", "DS204", "Chat", "Sequence"),
        ("conversation-constant-reference.pcapng", "DS415", "Note", "Protocol"),
    ],
)
def test_an_expert_info_is_as_serious_as_wireshark_means_it(
    name: str, rule: str, severity: str, group: str, tshark: Tshark
) -> None:
    """Whatever the severity of the finding, which stands in its line."""
    shown, row = below(tree(tshark, name), f"{rule} "), rules()[rule]
    assert shown[0].startswith(f"{rule} {row.severity}: ")
    assert f"Expert Info ({severity}/{group}): {rule} {row.title}" in shown
    assert f"Severity level: {severity}" in shown
    assert f"Group: {group}" in shown


def test_only_what_is_malformed_is_an_error_in_wireshark() -> None:
    plugin = tomllib.loads((ROOT / "python/ds47/spec/wireshark.toml").read_text("utf-8"))
    ranks = plugin["experts"]
    groups = {name for name, rank in ranks.items() if "ERROR" in rank.values()}
    assert groups == {"malformed", "checksum"}
    assert {each.expert for each in rules().values() if not each.analyzer_only} < set(ranks)


def test_expert_infos_of_one_rule_are_counted_together(tshark: Tshark) -> None:
    name = "diagnosis-half-captured.pcapng"
    told = Counter(each.rule for each in analyze(CAPTURES[name]).findings)
    told = Counter({rule: count for rule, count in told.items() if not rules()[rule].analyzer_only})
    assert max(told.values()) > 5
    shown = tshark("-r", CAPTURES[name], *COMPLETE, "-q", "-z", "expert")
    found = re.findall(r"^ *(\d+) +\w+ +DS47 +(DS\d+) ", shown, re.MULTILINE)
    assert Counter({rule: int(count) for count, rule in found}) == told
    assert len(found) == len(told)


def test_a_finding_says_its_sentence_in_its_line_alone(tshark: Tshark) -> None:
    (found,) = [each for each in analyze(CAPTURES[REFUSED]).findings if each.rule == "DS717"]
    shown = below(tree(tshark, REFUSED), "DS717 ")
    assert shown[0] == f"DS717 error: {sentence(found)}"
    assert not [line for line in shown[1:] if "p2900[1] (" in line]
    filters = 'ds47.finding.message contains "p2900[1]"'
    assert tshark("-r", CAPTURES[REFUSED], "-2", "-Y", filters, *columns("frame.number")) == "4\n"


@pytest.mark.slow
def test_what_a_frame_said_once_it_refers_to(tshark: Tshark) -> None:
    """A response with four refused parameters: one cause, and what to do once for each error number."""
    row = rules()["DS410"]
    shown = tree(tshark, "o3_two_controllers.pcapng", "-Y", "frame.number == 390")
    assert len([line for line in shown if line.startswith("DS410 error")]) == 4
    assert shown.count(wrap(f"Cause: {row.cause}", 76, 4)[0]) == 1
    assert shown.count("Cause: as for DS410 p1437[0], above") == 3
    assert shown.count("What to do: as for DS410 p1938[0], above") == 2


def test_a_finding_says_its_cause_and_what_to_do(tshark: Tshark) -> None:
    shown, row = below(tree(tshark, REFUSED), "DS410 "), rules()["DS410"]
    for name, text in (("Cause", row.cause), ("What to do", advice(row, {"code": 0x03}))):
        lines = wrap(f"{name}: {text}", 76, 4)
        at = shown.index(lines[0])
        assert shown[at : at + len(lines)] == lines
    assert not [line for line in shown if "[truncated]" in line or "\u2026" in line]
    chinese = below(tree(tshark, REFUSED, "-o", "ds47.language:zh"), "DS410 ")
    (found,) = [each for each in analyze(CAPTURES[REFUSED]).findings if each.rule == "DS410"]
    assert chinese[0] == f"DS410 错误：{sentence(found, 'zh')}"
    assert wrap(f"原因：{row.cause_zh}", 76, 4)[0] in chinese
    assert f"Expert Info (Note/Response): DS410 {row.title_zh}" in chinese


def test_a_finding_has_the_corrected_request_of_the_report(tshark: Tshark) -> None:
    (told,) = [each for each in analyze(CAPTURES[REFUSED]).diagnoses if each.rule == "DS717"]
    assert told.corrected is not None
    better, shown = corrected(told.corrected), below(tree(tshark, REFUSED), "DS717 ")
    assert f"Send instead: {better.hex}" in shown
    assert f"In words: {' '.join(better.words)}" in shown
    assert f"Made by: {better.encode}" in shown
    filters = f"ds47.finding.instead == {told.corrected.hex(':')}"
    assert tshark("-r", CAPTURES[REFUSED], "-2", "-Y", filters, *columns("frame.number")) == "4\n"


@pytest.mark.slow
def test_what_was_refused_later_is_not_offered(tshark: Tshark, tmp_path: Path) -> None:
    """Of all captures, beside each other: a finding has a corrected request where its headline has one."""
    wanted = {}
    for name in sorted(CAPTURES):
        if name.startswith("diagnosis-"):
            told = analyze(CAPTURES[name]).diagnoses
            wanted[name] = {each.corrected.hex() for each in told if each.corrected is not None}
    captures = {name: CAPTURES[name].read_bytes() for name, told in wanted.items() if told}
    assert len(captures) > 5
    assert all(map(beside.fits, captures.values()))
    whole = beside.beside(captures)
    path = tmp_path / "beside.pcapng"
    path.write_bytes(whole.content)
    requests: dict[str, set[str]] = {name: set() for name in captures}
    asked = columns("frame.number", "ds47.finding.instead")
    for number, offered in rows(
        tshark("-r", path, *COMPLETE, "-Y", "ds47.finding.instead", *asked)
    ):
        name, _ = whole.owners[int(number) - 1]
        requests[name] |= {*offered.replace(":", "").split(",")}
    for name, found in requests.items():
        assert found >= wanted[name], name


@pytest.mark.parametrize(
    "name", ["transport-reject", "record-read-empty", "diagnosis-half-captured", "tour-machine"]
)
def test_from_every_finding_a_link_leads_to_its_request(name: str, tshark: Tshark) -> None:
    """By the finding, or by the tree of the transaction in which it stands."""
    path = CAPTURES[f"{name}.pcapng"]
    asked = columns(
        "frame.number", "ds47.request_in", "ds47.finding.request_in", "ds47.finding.frame"
    )
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.finding", *asked))
    result = analyze(path)
    requests = {each.id: each.frames.write_request for each in result.transactions}
    links = {row[0]: {each for cell in row for each in cell.split(",")} for row in found}
    told = [each for each in result.findings if each.transaction is not None]
    assert told
    for each in told:
        request = requests[each.transaction or 0]
        assert request is None or str(request) in links[str(each.frame)]


@pytest.mark.slow
def test_a_finding_names_its_parameter(tshark: Tshark) -> None:
    """A response may have the same finding for several."""
    name = "o3_two_controllers.pcapng"
    shown = tree(tshark, name, "-Y", "frame.number == 390")
    titles = [line for line in shown if line.startswith("DS410 error")]
    told = [each for each in analyze(CAPTURES[name]).findings if each.frame == 390]
    numbers = [each.args["pnu"] for each in told if each.rule == "DS410"]
    assert len(numbers) == 4
    for number, line in zip(numbers, titles, strict=True):
        assert re.match(rf"DS410 error: Parameter p{number}\[\d+\] ", line)


@pytest.mark.slow
def test_from_every_frame_links_lead_to_the_findings_of_its_transaction(tshark: Tshark) -> None:
    """Whoever looks at the response to a refused change is led to what to send instead, at its request."""
    name = "o3_two_controllers.pcapng"
    result = analyze(CAPTURES[name])
    asked = columns("frame.number", "ds47.finding.elsewhere")
    told = {
        int(row[0]): [int(each) for each in row[1].split(",") if each]
        for row in rows(tshark("-r", CAPTURES[name], *COMPLETE, "-Y", "ds47", *asked))
    }
    linked = 0
    for item in result.transactions:
        found = {(each.rule, each.frame) for each in result.findings if each.transaction == item.id}
        for frame in (item.frames.write_request, item.frames.read_response):
            others = sorted(where for _, where in found if where != frame)
            if frame is not None and frame in told:
                assert sorted(told[frame]) == others, frame
                linked += len(others)
    assert linked > 100
    lines = tree(tshark, name, "-Y", "frame.number == 390")
    title = rules()["DS714"].title
    assert f"In frame 387: DS714 error: {title}, with the request to send instead" in lines
    lines = tree(tshark, name, "-Y", "frame.number == 390", "-o", "ds47.language:zh")
    assert f"见帧 387：DS714 错误：{rules()['DS714'].title_zh}，附应改为发送的请求" in lines


def test_a_status_has_its_words(tshark: Tshark) -> None:
    name = "diagnosis-two-users-across.pcapng"
    (refused,) = {
        each.write_status
        for each in analyze(CAPTURES[name]).transactions
        if each.state == "refused"
    }
    assert refused
    wanted = f"Status of the Write: 0x{refused:08x} ({status_text(refused)})"
    assert wanted in tree(tshark, name)


@pytest.mark.slow
def test_messages_stand_at_their_bytes(tmp_path: Path) -> None:
    """In every frame that has a message: the field has the place of the bytes and is not generated."""
    for name in (REFUSED, "transport-rpc-fragments.pcapng", "conversation-wrong-reference.pcapng"):
        output = run(tmp_path, *COMPLETE, "-T", "pdml", "-r", CAPTURES[name])
        known = analyze(CAPTURES[name]).transactions
        found = {}
        for packet in ElementTree.fromstring(output).iter("packet"):
            for field in packet.iter("field"):
                if field.get("name") in ("ds47.bytes.request", "ds47.bytes.response"):
                    data = (field.get("show") or "").replace(":", "")
                    if int(field.get("size") or 0) == len(data) // 2:
                        found.setdefault(field.get("name"), set()).add(data)
        for each in known:
            assert each.request is None or each.request.hex() in found["ds47.bytes.request"]
            assert each.response is None or each.response.hex() in found["ds47.bytes.response"]


# Copies


def mirrored(path: Path, target: Path) -> Path:
    """A capture in which a mirror port gives each frame twice."""
    with target.open("wb") as file, PcapngWriter(file) as writer:
        for frame in open_capture(path):
            writer.write(frame.time_ns, frame.data)
            writer.write(frame.time_ns + 20_000, frame.data)
    return target


@pytest.mark.slow
@pytest.mark.parametrize("passes", [(), COMPLETE], ids=["one pass", "two passes"])
@pytest.mark.parametrize(
    "name",
    ["conversation-read-back.pcapng", "transport-ip-fragments.pcapng", "tour-machine.pcapng"],
)
def test_a_copy_names_its_original(
    name: str, passes: tuple[str, ...], tshark: Tshark, tmp_path: Path
) -> None:
    path = mirrored(CAPTURES[name], tmp_path / "mirrored.pcapng")
    shown = columns("frame.number", "ds47.duplicate_of", "ds47.transaction", "ds47")
    found = rows(tshark("-r", path, *passes, *shown))
    ours = {int(row[0]) for row in found if row[3]}
    copies = {int(row[0]): int(row[1]) for row in found if row[1]}
    # a lone finding belongs to no message, and the first copy of a fragment to no whole one
    assert set(copies.values()) <= ours
    assert all(copy == original + 1 for copy, original in copies.items())
    with_transaction = {int(row[0]) for row in found if row[2]}
    assert with_transaction <= set(copies.values())
    assert ours.isdisjoint(copies)
    count = len(rows(tshark("-r", CAPTURES[name], *passes, "-Y", "ds47.transaction")))
    assert len(with_transaction) == count > 0


@pytest.mark.slow
def test_a_copy_says_so_in_its_columns_and_its_tree(tshark: Tshark) -> None:
    (line,) = tshark("-r", CAPTURES[COPIES], "-Y", "frame.number == 2").splitlines()
    assert re.search(r" DS47 .* duplicate of frame 1$", line)
    assert "DS47 duplicate of frame 1" in tree(tshark, COPIES)
    chinese = tshark("-r", CAPTURES[COPIES], "-Y", "ds47.duplicate_of", "-o", "ds47.language:zh")
    assert chinese.splitlines()[0].endswith("帧 1 的副本")


def test_a_copy_of_another_record_call_is_none_of_ours(tshark: Tshark, tmp_path: Path) -> None:
    """Connect, and records that are no parameter channel, keep the tree of the built-in."""
    path = mirrored(CAPTURES["tour-machine.pcapng"], tmp_path / "mirrored.pcapng")
    found = rows(tshark("-r", path, *COMPLETE, "-Y", "ds47.duplicate_of", *columns("pn_io.index")))
    indices = {int(row[0].split(",")[0], 16) for row in found if row[0]}
    assert indices == {47}


# One pass


def stderr(home: Path, *arguments: str | Path) -> str:
    """What tshark with the plugin says beside its output, without its own words about superusers."""
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}
    command = [*program(), "-n", "-X", f"lua_script:{PLUGIN}", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return "".join(line for line in done.stderr.splitlines(True) if line.startswith("ds47:"))


@pytest.mark.parametrize(
    "more", [("-V",), ("-Y", 'ds47.state == "ok"'), columns("ds47.response_in")]
)
def test_one_pass_says_once_what_it_leaves_out(more: tuple[str, ...], tmp_path: Path) -> None:
    said = stderr(tmp_path, "-r", CAPTURES["tour-machine.pcapng"], *more)
    assert said.startswith(f"ds47: {HINT}")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    "more",
    [
        (),
        ("-Y", "ds47.pnu"),
        ("-Y", "ds47"),
        ("-q", "-z", "expert"),
        (*COMPLETE, "-V"),
        ("-2", "-Y", "ds47.state"),
        ("-q", "-X", "lua_script1:statistics"),
    ],
    ids=" ".join,
)
def test_nothing_is_said_where_nothing_is_missing(more: tuple[str, ...], tmp_path: Path) -> None:
    assert stderr(tmp_path, "-r", CAPTURES["tour-machine.pcapng"], *more) == ""


def test_two_passes_of_which_the_first_has_no_fields_are_one(tmp_path: Path) -> None:
    """-2 alone: the first pass has no tree, so the second one shows what one pass shows."""
    said = stderr(tmp_path, "-r", CAPTURES["tour-machine.pcapng"], "-2", "-V")
    assert said.startswith(f"ds47: {BLIND}")


def test_a_capture_in_which_nothing_is_open_says_nothing(
    make: Callable[[Callable[[Client], object]], Path], tmp_path: Path
) -> None:
    """No transaction at all: nothing may come later."""
    path = make(lambda client: client.connect("plc"))
    assert stderr(tmp_path, "-r", path, "-V") == ""


def test_the_tree_says_what_a_second_pass_knows(tshark: Tshark) -> None:
    asked = columns("frame.number", "ds47.second_pass", "ds47.state")
    found = rows(tshark("-r", CAPTURES[REFUSED], "-Y", "ds47", *asked))
    assert [row[0] for row in found if row[1]] == [row[0] for row in found if not row[2]]
    assert found[0][1].endswith("tshark -2 -R frame")
    complete = rows(tshark("-r", CAPTURES[REFUSED], *COMPLETE, "-Y", "ds47", *asked))
    assert not [row for row in complete if row[1]]
