"""A report of a part of a capture shows what a naive filter of the whole JSON gives, and totals of that."""

import io
import json
import re
from collections import Counter
from datetime import datetime, timedelta

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from report_formats import PRINTED

from ds47.analysis import analyze
from ds47.cli import main

NAMES = (
    "tour-machine.pcapng", "real-stacks/o3_two_controllers.pcapng", "cyclic-longer-ramp.pcapng",
    "s7-stacks/multi_cpp_pure.pcapng", "diagnosis-axis-byte-ignored.pcapng",
)  # fmt: skip


def run(capsys, *arguments):
    status = main(["report", *map(str, arguments)])
    shown = capsys.readouterr()
    return status, shown.out, shown.err


@pytest.fixture(scope="module")
def wholes(captures):
    """JSON of whole captures, by path."""
    found = {}
    for name in NAMES:
        path = captures / name
        if path.exists():
            stream = io.StringIO()
            from ds47.analysis import analyze
            from ds47.model import Report
            from ds47.report import json as writer
            from ds47.report import write_all

            result = analyze(path)
            result.path = str(path)
            write_all(writer.Writer(stream), Report([result]))
            found[path] = json.loads(stream.getvalue())["captures"][0]
    assert len(found) >= 2
    return found


def nanoseconds(text):
    whole, digits = re.fullmatch(r"(.*)\.(\d{9})Z", text).groups()
    return int(
        (datetime.fromisoformat(whole) - datetime(1970, 1, 1)).total_seconds()
    ) * 10**9 + int(digits)


def options(data, whole):
    """Random options, and what they want of a transaction of the JSON with its findings."""
    jobs, devices = whole["transactions"], whole["devices"]
    first = nanoseconds(whole["start"])
    names = {each["ip"]: [each["ip"], each["station"], each["mac"]] for each in devices}
    words, tests = [], []

    def choose(name, values, test):
        values = sorted({value for value in values if value is not None})
        if values and data.draw(st.booleans(), label=name):
            some = data.draw(
                st.lists(st.sampled_from(values), min_size=1, max_size=2, unique=True), label=name
            )
            words.extend(part for each in some for part in (name, str(each)))
            tests.append(lambda job, own: test(job, own, some))

    choose("--state", [each["state"] for each in jobs], lambda job, _, some: job["state"] in some)
    choose(
        "--device", [name for each in jobs for name in names.get(each["device"], [each["device"]])],
        lambda job, _, some: any(each in some for each in names.get(job["device"], [job["device"]])),
    )  # fmt: skip
    choose(
        "--station", [each["controller"] for each in jobs], lambda job, _, some: job["controller"] in some
    )  # fmt: skip
    choose(
        "--pnu", [item["pnu"] for each in jobs for item in each["parameters"]],
        lambda job, _, some: any(item["pnu"] in some for item in job["parameters"]),
    )  # fmt: skip
    choose(
        "--rule", [each["rule"] for each in whole["findings"]],
        lambda _, own, some: any(each["rule"] in some for each in own),
    )  # fmt: skip
    choose("--transaction", [each["id"] for each in jobs], lambda job, _, some: job["id"] in some)
    if data.draw(st.booleans(), label="--from"):
        number = data.draw(st.integers(0, len(jobs) - 1))
        after = (nanoseconds(jobs[number]["start"]) - first) / 1e9
        words.extend(("--from", f"{after:.9f}"))
        start = first + round(after * 1e9)
        tests.append(lambda job, own: nanoseconds(job["start"]) >= start)
    return words, lambda job, own: all(test(job, own) for test in tests)


@pytest.mark.slow
@pytest.mark.parametrize("which", range(len(NAMES)))
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_shown_is_what_a_naive_filter_gives(which, wholes, capsys, data):
    paths = list(wholes)
    if which >= len(paths):
        pytest.skip("no such capture")
    path = paths[which]
    whole = wholes[path]
    words, wanted = options(data, whole)
    own = {}
    for each in whole["findings"]:
        own.setdefault(each["transaction"], []).append(each)
    expected = [each for each in whole["transactions"] if wanted(each, own.get(each["id"], []))]
    status, text, said = run(capsys, "-f", "json", *words, path)
    captures = json.loads(text)["captures"]
    if not words:
        assert captures == [whole]
        return
    if not captures:
        assert status == 1
        assert said.startswith("ds47: error: nothing matches --")
        assert expected == []
        return
    (part,) = captures
    assert part["transactions"] == expected
    ids = {each["id"] for each in expected}
    assert [each for each in part["findings"] if each["transaction"] is not None] == [
        each for each in whole["findings"] if each["transaction"] in ids
    ]
    counts = Counter(transactions=len(expected))
    for each in expected:
        counts[each["state"]] += 1
        counts[each["operation"]] += 1
    assert part["summary"] == dict(counts)
    told = Counter(each["rule"] for each in part["findings"] if each["rule"].startswith("DS7"))
    assert (
        Counter(dict.fromkeys(told, 0))
        | sum((Counter({each["rule"]: each["count"]}) for each in part["diagnoses"]), Counter())
        == told
    )
    assert part["narrowed"]["transactions"] == len(whole["transactions"])
    assert part["narrowed"]["findings"] == len(whole["findings"])
    _text_agrees(capsys, path, words, expected, part)


def _text_agrees(capsys, path, words, expected, part):
    _, text, _ = run(capsys, "--all", "--width", 140, *words, path)
    assert (
        " ".join(text.split()).count(
            f"narrowed by {part['narrowed']['criteria']}: {len(expected):,} of "
        )
        == 1
    )
    listed = [int(number) for number in re.findall(r"^#(\d+) ", text, re.MULTILINE)]
    s7 = {
        each["id"] for each in expected if each["channel"] == "s7"
    }  # listed where something is wrong
    assert [each for each in listed if each not in s7] == [
        each["id"] for each in expected if each["id"] not in s7
    ]


def test_only_a_drive_object_that_is_proved_is_shown_and_the_others_are_counted(capsys, captures):
    path = captures / "real-stacks" / "o3_two_controllers.pcapng"
    _, text, _ = run(capsys, "-f", "json", "--do", 3, path)
    (part,) = json.loads(text)["captures"]
    assert part["transactions"]
    for each in part["transactions"]:
        assert each["axis"] == 3 or each["index"] == 0xB02E, (
            "the axis byte, or a submodule that is one"
        )
    _, table, _ = run(capsys, "-f", "parameters", "--do", 3, path)
    assert {line.split(",")[4] for line in table.splitlines()[1:]} <= {"3", ""}
    if part["narrowed"]["unproved"]:
        _, words, _ = run(capsys, "--summary", "--do", 3, path)
        assert f"{part['narrowed']['unproved']} more may be of that drive object" in words


@pytest.mark.parametrize(
    ("start", "zone"),
    [("08:00:01", "UTC"), ("09:00:01", "+01:00"), ("2026-01-01T08:00:01", "UTC"),
     ("2026-01-01T09:00:01", "+01:00"), ("2026-01-01T08:00:01Z", "+05:00"), ("1.000", "UTC")],
)  # fmt: skip
def test_a_time_of_day_is_one_in_the_zone(capsys, captures, start, zone):
    path = captures / "tour-machine.pcapng"
    _, text, _ = run(capsys, "-f", "json", path)
    whole = json.loads(text)["captures"][0]
    first = nanoseconds(whole["start"])
    border = first + 10**9 if start == "1.000" else nanoseconds("2026-01-01T08:00:01.000000000Z")
    expected = [
        each["id"] for each in whole["transactions"] if nanoseconds(each["start"]) >= border
    ]
    assert 0 < len(expected) < len(whole["transactions"])
    _, text, _ = run(capsys, "-f", "json", "--tz", zone, "--from", start, path)
    assert [each["id"] for each in json.loads(text)["captures"][0]["transactions"]] == expected
    _, text, _ = run(capsys, "-f", "json", "--tz", zone, "--to", start, path)
    ids = [each["id"] for each in json.loads(text)["captures"][0]["transactions"]]
    assert ids == [
        each["id"] for each in whole["transactions"] if nanoseconds(each["start"]) <= border
    ]


def test_a_time_of_day_behind_midnight_is_that_of_the_next_day():
    from ds47.cli.selecting import chosen
    from ds47.report.zones import zone

    nothing = dict.fromkeys(
        ("transactions", "rules", "devices", "drive_objects", "pnus", "stations", "states"), ()
    )
    choice = chosen(zone("UTC"), **nothing, start="00:10", end=None)
    evening = int((datetime(2026, 3, 1, 23, 50) - datetime(1970, 1, 1)).total_seconds()) * 10**9
    morning = evening + int(timedelta(hours=2).total_seconds()) * 10**9
    assert choice.of(evening, morning).start == evening + 20 * 60 * 10**9
    assert choice.of(evening, evening + 1).start == evening - (23 * 60 + 40) * 60 * 10**9


def test_a_time_of_day_knows_summer_time():
    from ds47.cli.selecting import chosen
    from ds47.report.zones import zone

    nothing = dict.fromkeys(
        ("transactions", "rules", "devices", "drive_objects", "pnus", "stations", "states"), ()
    )
    begin = (
        int((datetime(2026, 3, 28, 23, 30) - datetime(1970, 1, 1)).total_seconds()) * 10**9
    )  # 00:30 in Berlin
    choice = chosen(zone("Europe/Berlin"), **nothing, start="08:00", end=None)
    six = int((datetime(2026, 3, 29, 6, 0) - datetime(1970, 1, 1)).total_seconds()) * 10**9
    assert choice.of(begin, begin + 10 * 3600 * 10**9).start == six


@pytest.mark.parametrize("text", ["25:00", "08:61", "yesterday", "2026-13-01", "-3"])
def test_a_time_that_is_none_is_said_to_be(capsys, captures, text):
    status, _, said = run(capsys, "--from", text, captures / "tour-machine.pcapng")
    assert status == 2
    assert (
        "is not a time: 08:15:00, 2026-01-01T08:00:00.5, or seconds as 12.5" in said
        or "No such option" in said
    )


def test_the_exit_status_is_that_of_what_is_shown(capsys, captures):
    path = captures / "tour-machine.pcapng"
    assert run(capsys, "--fail-on", "error", path)[0] == 1
    assert run(capsys, "--fail-on", "error", "--pnu", 50304, path)[0] == 0


def test_captures_without_anything_that_is_wanted_are_left_out(capsys, captures):
    paths = [captures / "tour-machine.pcapng", captures / "record-global.pcapng"]
    _, text, _ = run(capsys, "-f", "json", "--pnu", 50304, *paths)
    assert [each["path"] for each in json.loads(text)["captures"]] == [str(paths[0])]
    status, text, said = run(capsys, "--pnu", 54321, *paths)
    assert (status, text) == (1, "")
    assert said.startswith(
        "ds47: error: nothing matches --pnu 54321; read or changed here: p50076, "
    )


@pytest.mark.parametrize("kind", sorted({*PRINTED} - {"text", "json"}))
def test_every_format_can_be_narrowed(capsys, captures, kind):
    path = captures / "tour-machine.pcapng"
    _, whole, _ = run(capsys, "-f", kind, path)
    _, part, _ = run(capsys, "-f", kind, "--transaction", 2, path)
    assert part
    assert part != whole or kind == "events"
    assert len(part) <= len(whole) + 200
    if kind == "html":
        assert "narrowed by --transaction 2: 1 of 8 transactions" in part
        assert "已按 --transaction 2 筛选" in part


@pytest.mark.slow
def test_names_of_drive_objects_rest_on_the_whole_capture(capsys, captures):
    """That axis 2 is a drive object is shown by other transactions than the one that is left."""
    path = captures / "real-stacks" / "o3_two_controllers.pcapng"
    _, whole, _ = run(capsys, "--all", "--width", 140, path)
    lines = {}
    for line in whole.splitlines():
        if found := re.match(r"#(\d+) +\S+ +\S+ +\d+  (.*?)  ", line):
            lines[found[1]] = found[2]
    for number in list(lines)[::9]:
        _, part, _ = run(capsys, "--all", "--width", 140, "-t", number, path)
        (place,) = re.findall(r"DO \d+|axis \d+|slot \S+", lines[number])[-1:] or [""]
        assert place in part


def test_results_are_kept_whole(capsys, captures, tmp_path):
    status, _, said = run(
        capsys, "--results", tmp_path / "r", "--pnu", 1, captures / "tour-machine.pcapng"
    )
    assert status == 2
    assert "--results keeps whole results and takes no criteria" in said


def test_diff_refuses_a_narrowed_report(capsys, captures, tmp_path):
    path = captures / "tour-machine.pcapng"
    run(capsys, "-f", "json", "-o", tmp_path / "part.json", "--pnu", 50304, path)
    assert main(["diff", str(tmp_path / "part.json"), str(path)]) == 2
    assert "is narrowed by --pnu 50304" in capsys.readouterr().err


def test_a_narrowed_report_is_loaded_and_written_again(captures, capsys, tmp_path):
    from ds47.model import Report
    from ds47.report import json as writer
    from ds47.report import write_all
    from ds47.report.load import capture

    _, text, _ = run(capsys, "-f", "json", "--pnu", 50304, captures / "tour-machine.pcapng")
    stream = io.StringIO()
    write_all(
        writer.Writer(stream), Report([capture(each) for each in json.loads(text)["captures"]])
    )
    assert stream.getvalue() == text


# How long the text is


def test_a_long_capture_is_summed_up_unless_all_is_asked_for(capsys, captures):
    path = captures / "real-stacks" / "o3_two_controllers.pcapng"
    _, short, _ = run(capsys, path)
    _, long, _ = run(capsys, "--all", path)
    told = analyze(path)
    counts = f"{len(told.transactions)} transactions, {len(told.findings)} findings"
    assert f"Not listed: {counts}. --all lists them" in short
    assert "Not listed" not in long
    assert len(short.splitlines()) < 130 < 400 < len(long.splitlines())
    assert short.splitlines()[:40] == long.splitlines()[:40]
    assert short.splitlines()[-4:] == long.splitlines()[-4:]


def test_a_short_capture_is_told_whole_unless_a_summary_is_asked_for(capsys, captures):
    path = captures / "tour-machine.pcapng"
    _, usual, _ = run(capsys, path)
    _, long, _ = run(capsys, "--all", path)
    _, summary, _ = run(capsys, "--summary", path)
    assert usual == long
    assert len(summary.splitlines()) <= 12
    assert "\nTransactions\n" in usual
    assert "\nTransactions\n" not in summary


@pytest.mark.slow
def test_many_captures_are_a_screenful(capsys, captures):
    _, text, _ = run(capsys, captures)
    assert len(text.splitlines()) <= 60
    assert text.startswith("Captures, the worst first")
    assert text.splitlines()[-1] == "ds47 report NAME reports one capture, --all each of them."
    assert re.search(r"All \d+ captures", text)


def test_the_same_in_chinese(capsys, captures):
    _, text, _ = run(capsys, "--lang", "zh", "--pnu", 50304, captures / "tour-machine.pcapng")
    assert "已按 --pnu 50304 筛选：8 个任务中的 2 个，9 个结论中的 1 个" in text


def test_the_zone_may_stand_in_the_toml_beside_the_captures(capsys, captures, tmp_path):
    (tmp_path / "one.pcapng").write_bytes((captures / "tour-machine.pcapng").read_bytes())
    (tmp_path / "ds47.toml").write_text('[report]\ntz = "+03:00"\n', "utf-8")
    _, text, _ = run(capsys, tmp_path / "one.pcapng")
    assert "2026-01-01 11:00:00.000 +03:00 to" in text
    _, text, _ = run(capsys, "--tz", "UTC", tmp_path / "one.pcapng")
    assert "2026-01-01 08:00:00.000 +00:00 (UTC) to" in text
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "one.pcapng").write_bytes((captures / "tour-machine.pcapng").read_bytes())
    (tmp_path / "two" / "ds47.toml").write_text('[report]\ntz = "Nowhere/At_All"\n', "utf-8")
    status, _, said = run(capsys, tmp_path / "two" / "one.pcapng")
    assert status == 3
    assert "[report] tz: 'Nowhere/At_All' is not a time zone known here" in said
