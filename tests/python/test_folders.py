"""A run over a folder: stored results, going on, Ctrl-C, processes that die, memory, progress.

The runs that are interrupted or killed are processes of their own, with real signals.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from batch_products import Names
from handmade import finding
from report_formats import PRINTED

from ds47 import __version__, report
from ds47.analysis import AnalysisOptions, analyze
from ds47.batch.cores import useful_jobs
from ds47.batch.endings import Failed
from ds47.batch.local import Local
from ds47.batch.results import Results, StoredResult
from ds47.batch.runner import here
from ds47.batch.tasks import Source, Task, plan
from ds47.capture import CaptureError
from ds47.cli import main
from ds47.model import CaptureResult, Report
from ds47.report import json as contract
from ds47.report import load
from ds47.report.overview import CaptureRow, worst_first
from ds47.report.wrap import columns
from ds47.spec import units

DS47 = [sys.executable, "-m", "ds47"]
PATIENCE = 60


@pytest.fixture
def folder(tmp_path: Path, captures: Path) -> Path:
    """A tree of captures, some of them broken."""
    root = tmp_path / "plant"
    (root / "line 1" / "empty").mkdir(parents=True)
    for name in ("format-change", "tour-machine", "conversation-late-read"):
        shutil.copy(captures / f"{name}.pcapng", root / "line 1")
    data = (captures / "tour-machine.pcapng").read_bytes()
    (root / "cut.pcapng").write_bytes(data[: len(data) // 2])
    (root / "packed.pcapng.gz").write_bytes(gzip.compress(data))
    (root / "no.pcap").write_text("not a capture")
    return root


def run(capsys: Any, *arguments: str | Path) -> tuple[int, str, list[str]]:
    status = main(["report", *map(str, arguments)])
    shown = capsys.readouterr()
    return status, shown.out, shown.err.splitlines()


def stored(results: Path) -> dict[str, Any]:
    return {
        path.relative_to(results).as_posix(): json.loads(path.read_bytes())
        for path in sorted(results.rglob("*"))
        if path.is_file()
    }


def stamps(results: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in results.rglob("*.json")}


def test_each_capture_has_its_result_and_all_have_an_overview(
    capsys: Any, folder: Path, tmp_path: Path
) -> None:
    results = tmp_path / "results"
    status, text, problems = run(capsys, folder, "--results", results)
    assert status == 3
    assert len(problems) == 2, problems
    found = stored(results)
    assert list(found) == [
        "cut.pcapng.json",
        "line 1/conversation-late-read.pcapng.json",
        "line 1/format-change.pcapng.json",
        "line 1/tour-machine.pcapng.json",
        "overview.json",
        "packed.pcapng.gz.json",
    ]
    overview = found.pop("overview.json")
    jsonschema.Draft202012Validator(report.schema("overview-1")).validate(overview)
    check = jsonschema.Draft202012Validator(report.schema())
    for document in found.values():
        check.validate(document)
    assert [Path(row["path"]).name for row in overview["captures"][:1]] == ["no.pcap"]
    errors = [row["findings"].get("error", 0) for row in overview["captures"][1:]]
    assert errors == sorted(errors, reverse=True)
    assert overview["total"]["captures"] == 6
    assert overview["total"]["unreadable"] == overview["total"]["incomplete"] == 1
    transactions = sum(len(each["captures"][0]["transactions"]) for each in found.values())
    assert sum(overview["total"]["states"].values()) == transactions > 20
    assert "no.pcap  not readable: " in text
    assert "All 6 captures: " in text


def test_a_result_is_the_report_of_its_capture(capsys: Any, folder: Path, tmp_path: Path) -> None:
    run(capsys, folder, "--results", tmp_path / "r")
    for name in ("cut.pcapng", "line 1/tour-machine.pcapng"):
        _, alone, _ = run(capsys, folder / name, "-f", "json")
        document = json.loads((tmp_path / "r" / f"{name}.json").read_bytes())
        del document["run"]
        assert document == json.loads(alone)


@pytest.mark.parametrize("format_name", PRINTED)
def test_the_report_of_stored_results_is_the_report(
    capsys: Any, folder: Path, tmp_path: Path, format_name: str
) -> None:
    run(capsys, folder, "--results", tmp_path / "r")
    said = run(capsys, folder, "--results", tmp_path / "r", "--resume", "-f", format_name)
    if format_name in ("text", "overview", "json", "html", "markdown"):
        assert said == run(capsys, folder, "-f", format_name)
        return
    # what is written while it is analysed comes in another order: that of the ids here
    stream = io.StringIO()
    options = report.ReportOptions(fail_on="error", rules=_rules())
    writer = report.open_writer(format_name, stream, options)
    for task in plan([*map(str, sorted(folder.rglob("*.p*cap*")))], series=False):
        try:
            result = analyze(task.path)
        except CaptureError as problem:
            writer.unreadable(task.path, str(problem))
        else:
            report.write_one(writer, result)
    writer.close()
    assert _without_times(said[1]) == _without_times(stream.getvalue())


def _rules() -> Any:
    from ds47 import spec

    return spec.rules()


def _without_times(text: str) -> str:
    import re

    return re.sub(r' time="[^"]*"', "", text)


@pytest.mark.slow
def test_every_stored_capture_survives_the_way_through_json(captures: Path) -> None:
    corrected = 0
    for path in sorted(captures.glob("*.pcap*")):
        result = analyze(path)
        document = json.loads(json.dumps(contract.capture(result)))
        again = load.capture(document)
        again.problem, again.dropped = result.problem, result.dropped
        for transaction in result.transactions:
            transaction.position = 0
        for timeline in result.timelines:  # values are not stored
            timeline.setpoint, timeline.actual, timeline.end_ns = [], [], None
        assert again == result, path.name
        corrected += sum(each.corrected is not None for each in again.diagnoses)
    assert corrected > 5


@pytest.mark.parametrize("ns", [0, 1, -1, 10**18, -(10**19), 1 << 64, -62_135_596_800 * 10**9 - 1])
def test_a_timestamp_is_read_back_in_any_year(ns: int) -> None:
    assert units.nanoseconds(units.timestamp(ns)) == ns


def test_resume_does_again_what_changed_and_nothing_else(
    capsys: Any, folder: Path, tmp_path: Path
) -> None:
    results = tmp_path / "r"
    arguments = (folder, "--results", results, "--resume")
    first = run(capsys, *arguments)
    before = stamps(results)
    again = run(capsys, *arguments)
    assert again[:2] == first[:2]
    after = stamps(results)
    assert before.pop("overview.json") != after.pop("overview.json")
    assert after == before
    changed = folder / "line 1" / "tour-machine.pcapng"
    os.utime(changed, ns=(1, 1))
    (results / "cut.pcapng.json").write_text("{")
    (results / "line 1" / "format-change.pcapng.json").unlink()
    _, text, problems = run(capsys, *arguments)
    assert text == first[1]
    assert problems[:2] == [
        "ds47: 1 capture done again: changed",
        f"ds47: 1 capture done again: damaged result, {results / 'cut.pcapng.json'}",
    ]
    assert {name for name, stamp in stamps(results).items() if before.get(name) != stamp} == {
        "overview.json", "tour-machine.pcapng.json", "cut.pcapng.json", "format-change.pcapng.json",
    }  # fmt: skip


def reshaped(data: bytes) -> bytes:
    """Whole JSON, but the line of the overview has other keys."""
    document = json.loads(data)
    document["run"]["row"]["colour"] = document["run"]["row"].pop("frames")
    return json.dumps(document).encode()


def without_a_row(data: bytes) -> bytes:
    document = json.loads(data)
    document["run"] = []
    return json.dumps(document).encode()


@pytest.mark.slow
@pytest.mark.parametrize("format_name", ["overview", "text", "json", "csv"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:1500],
        lambda data: data[:-100] + b"x" * 100,
        lambda data: data.replace(b'"operation"', b'"operations"', 1),
        lambda data: data.replace(b'"frames": 37', b'"frames": 38'),
        lambda data: data.replace(b'"seal": "', b'"seal": "0'),
        lambda data: data.replace(b'"tool": {', b'"tool": {}, "t": {'),
        lambda data: data[:120] + b"[" * 100_000,
        lambda _: b"",
        reshaped,
        without_a_row,
    ],
)
def test_a_damaged_result_is_made_again(
    capsys: Any, folder: Path, tmp_path: Path, damage: Any, format_name: str
) -> None:
    results = tmp_path / "r"
    arguments = (folder / "line 1", "--results", results, "--resume", "-f", format_name)
    first = run(capsys, *arguments)
    assert first[0] == 0
    place = results / "tour-machine.pcapng.json"
    whole, before = place.read_bytes(), stamps(results)
    place.write_bytes(damage(whole))
    assert place.read_bytes() != whole
    status, text, problems = run(capsys, *arguments)
    assert problems == [f"ds47: 1 capture done again: damaged result, {place}"]
    assert (status, text) == first[:2]
    assert place.read_bytes() == whole
    after = stamps(results)
    assert {name for name in after if after[name] != before[name]} == {place.name, "overview.json"}


def test_the_result_that_a_reviewer_damaged_is_made_again(
    capsys: Any, captures: Path, tmp_path: Path
) -> None:
    damaged = captures.parent.parent / "shared" / "captures" / "reproducers" / "damaged-result.json"
    if not damaged.exists():
        pytest.skip("needs ../shared beside the checkout")
    shutil.copy(captures / "seed-g120-read.pcapng", tmp_path)
    (tmp_path / "r").mkdir()
    shutil.copy(damaged, tmp_path / "r" / "seed-g120-read.pcapng.json")
    capture = tmp_path / "seed-g120-read.pcapng"
    status, text, problems = run(capsys, capture, "--results", tmp_path / "r", "--resume")
    assert status == 0
    assert len(problems) == 1
    assert "1 capture done again: " in problems[0]
    assert "1 capture: " in text


def test_resume_does_again_what_other_options_or_another_version_made(
    capsys: Any, folder: Path, tmp_path: Path
) -> None:
    arguments = (folder / "line 1", "--results", tmp_path / "r", "--resume")
    _, english, _ = run(capsys, *arguments)
    _, _, problems = run(capsys, *arguments, "--ignore", "DS4", "--index", "0x30")
    assert problems == ["ds47: 3 captures done again: other options"]
    _, _, problems = run(capsys, *arguments, "--ignore", "DS4", "--index", "48")
    assert problems == []
    _, text, _ = run(capsys, *arguments)
    assert text == english
    for path in (tmp_path / "r").glob("t*.json"):
        path.write_text(path.read_text("utf-8").replace(f'"{__version__}"', '"0.0.1"', 1), "utf-8")
    _, _, problems = run(capsys, *arguments)
    assert problems == ["ds47: 1 capture done again: another version of ds47"]


def test_a_capture_that_cannot_be_read_any_more_has_no_result(
    capsys: Any, folder: Path, tmp_path: Path
) -> None:
    run(capsys, folder, "--results", tmp_path / "r")
    (folder / "packed.pcapng.gz").write_bytes(b"")
    status, text, _ = run(capsys, folder, "--results", tmp_path / "r", "--resume")
    assert status == 3
    assert "packed.pcapng.gz  not readable: the file is empty" in text
    assert not (tmp_path / "r" / "packed.pcapng.gz.json").exists()


def test_folders_do_not_mix(capsys: Any, folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(folder / "line 1", other)
    run(capsys, folder / "line 1", other, "--results", tmp_path / "r")
    assert {path.parent.name for path in (tmp_path / "r").glob("*/*.json")} == {"line 1", "other"}
    same = str(folder / "line 1" / "tour-machine.pcapng"), str(other / "tour-machine.pcapng")
    status, _, problems = run(capsys, *same, "--results", tmp_path / "s")
    assert status == 2
    assert "would have the same result tour-machine.pcapng.json" in problems[-1]


@pytest.mark.skipif(os.name == "nt", reason="no file can have such a name")
def test_a_file_name_leads_out_of_no_folder(capsys: Any, captures: Path, tmp_path: Path) -> None:
    """A backslash is a letter here: what it seems to lead to is neither written nor deleted."""
    (tmp_path / "in").mkdir()
    shutil.copy(captures / "tour-machine.pcapng", tmp_path / "in" / "..\\..\\good.pcapng")
    (tmp_path / "in" / "..\\..\\notes.pcap").write_text("not a capture")
    own = tmp_path / "notes.pcap.json"
    own.write_text("the user's")
    results = tmp_path / "r" / "r"
    status, _, problems = run(capsys, tmp_path / "in", "--results", results)
    assert (status, len(problems)) == (3, 1)
    assert own.read_text() == "the user's"
    assert {path.name for path in results.rglob("*")} == {
        "..\\..\\good.pcapng.json", "overview.json",
    }  # fmt: skip
    assert [path.name for path in (tmp_path / "r").iterdir()] == ["r"]
    assert run(capsys, tmp_path / "in", "--results", results, "--resume")[0] == 3


@pytest.mark.parametrize(
    ("sep", "path", "roots", "name"),
    [
        ("/", "s3://b/../../evil.pcap", ["s3://b"], "%2E%2E/%2E%2E/evil.pcap"),
        ("/", "s3://b/a/evil.pcap", ["s3://b"], "a/evil.pcap"),
        ("/", "zip:///etc/x.pcap", ["zip://"], "x.pcap"),
        ("/", "../../x.pcap", [".", "../../x.pcap"], "folder/%2E%2E/%2E%2E/x.pcap"),
        ("/", "../plant/x.pcap", ["../plant"], "x.pcap"),
        ("/", "plant/a:b\\c.pcap", ["plant"], "a:b\\c.pcap"),
        ("/", "s3://b/..\\x.pcap", ["s3://b"], "..\\x.pcap"),
        ("\\", "plant\\a\\x.pcap", ["plant"], "a/x.pcap"),
        ("\\", "s3://b/..\\..\\x.pcap", ["s3://b"], "%2E%2E/%2E%2E/x.pcap"),
        ("\\", "s3://b/C:/x.pcap", ["s3://b"], "C%3A/x.pcap"),
        ("\\", "C:\\x.pcap", ["C:\\", "D:\\"], "C%3A/x.pcap"),
        ("\\", "s3://b/aux/LPT1.2026.pcap", ["s3://b"], "%61ux/%4CPT1.2026.pcap"),
        ("\\", "s3://b/COM¹ .x/a?b*.pcap", ["s3://b"], "%43OM¹ .x/a%3Fb%2A.pcap"),
        ("\\", "s3://b/line 3. /x.pcap", ["s3://b"], "line 3.%20/x.pcap"),
        ("/", "s3://b/aux/a?b. /x.pcap", ["s3://b"], "aux/a?b. /x.pcap"),
    ],
)
def test_the_name_of_a_result_leads_nowhere_but_down(
    monkeypatch: Any, sep: str, path: str, roots: list[str], name: str
) -> None:
    """`sep` is what separates the parts of a path on this system."""
    results = Results(Path("r"), StoredResult(AnalysisOptions()))
    task = Task(path, ())
    with monkeypatch.context() as patch:
        patch.setattr(os, "sep", sep)
        results.name([task], roots)
    assert results.path_of(task) == Path("r", f"{name}.json")


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="other lengths there")
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_name_that_is_too_long_costs_only_its_capture(
    capsys: Any, folder: Path, tmp_path: Path, jobs: int
) -> None:
    long = f"{'a' * 242}.pcapng"
    shutil.copy(folder / "line 1" / "tour-machine.pcapng", folder / "line 1" / long)
    results = tmp_path / "r"
    for again in ([], ["--resume"]):
        status, text, problems = run(capsys, folder, "--results", results, "-j", jobs, *again)
        assert status == 3
        assert f"{long}: no result could be stored: File name too long" in "\n".join(problems)
        assert len(problems) == 3, problems
        assert f"{long}  not readable: no result could be stored" in text
        made = stored(results)
        assert "line 1/tour-machine.pcapng.json" in made
        assert len(made["overview.json"]["captures"]) == 7


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_full_disk_ends_the_run(tmp_path: Path, jobs: int) -> None:
    """What ails every result is said once, not once a capture."""
    make = Names(tmp_path)
    tasks = [Task(name, (Source(name, name),)) for name in ("full-disk", "fine")]
    place = {task.path: tmp_path / task.path for task in tasks}
    runner = here if jobs == 1 else partial(Local, jobs=jobs)
    with pytest.raises(OSError, match="No space left"), runner(
        tasks, make, lambda task: place[task.path]
    ) as outcomes:  # fmt: skip
        list(outcomes)


def test_a_folder_that_cannot_be_written_is_said_before_anything_is_analysed(
    capsys: Any, folder: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    def refuse(path: Path, *_: Any, **__: Any) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "touch", refuse)
    status, _, problems = run(capsys, folder, "--results", tmp_path / "r")
    assert (status, problems) == (
        2,
        [f"ds47: error: cannot write {tmp_path / 'r'}: Permission denied"],
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["x", "--resume"], "--results"),
        (["-", "--results", "r"], "stdin"),
        (["x", "--results", "r", "--engine", "both"], "--engine native"),
        (["x", "--scheduler", "tcp://localhost:1", "-j", "2"], "--jobs"),
    ],
)
def test_what_does_not_go_together(capsys: Any, arguments: list[str], words: str) -> None:
    status, _, problems = run(capsys, *arguments)
    assert status == 2
    assert words in problems[-1]


def test_fail_on_counts_what_was_done_before(capsys: Any, folder: Path, tmp_path: Path) -> None:
    arguments = (folder / "line 1", "--results", tmp_path / "r", "--resume", "--fail-on", "error")
    assert run(capsys, *arguments)[0] == run(capsys, *arguments)[0] == 1


def test_as_many_processes_as_pay() -> None:
    small = [Task("x", (Source("x", "x", 1000),))] * 50
    large = [Task("x", (Source("x", "x", 1 << 30),))] * 50
    assert useful_jobs([]) == useful_jobs(small) == 1
    assert useful_jobs(large) == useful_jobs(large * 2) >= 1
    assert useful_jobs(large[:1]) == 1


# -- processes ------------------------------------------------------------------------------------


def tasks(*names: str) -> list[Task]:
    return [Task(name, (Source(name, name),)) for name in names]


def outcomes(runner: Any) -> list[str]:
    found = []
    with runner as coming:
        for task, outcome in coming:
            if isinstance(outcome, CaptureError):
                found.append(f"{task.path}! {outcome}")
            else:
                found.append(outcome.read_text())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("others", [12, 60])
def test_a_process_that_dies_costs_its_task_a_second_try(tmp_path: Path, others: int) -> None:
    """Of 60 and more, eight go to a process together."""
    names = ["a", "dies-once", "b", "broken", "deadly", *(f"c{number}" for number in range(others))]
    make, out = Names(tmp_path), tmp_path / "out"
    found = outcomes(Local(tasks(*names), make, lambda task: out / task.path, 2))
    assert found[:4] == ["a", "dies-once", "b", "broken! broken: is broken"]
    assert found[4].startswith("deadly! the process that analysed it was killed, twice")
    assert found[5:] == names[5:]
    assert sorted(path.name for path in out.iterdir()) == sorted(
        name for name in names if name not in ("broken", "deadly")
    )
    safe = ["a", "broken", "b"]
    alone = outcomes(here(tasks(*safe), make, lambda task: out / task.path))
    assert alone == ["a", "broken! broken: is broken", "b"]


@pytest.mark.slow
def test_neighbours_that_kill_their_process_cost_nobody_else(tmp_path: Path) -> None:
    """Three of a share: no process has to stay alive for them, the others show that."""
    names = [f"deadly-{number}" if number in (5, 6, 7) else f"c{number}" for number in range(64)]
    found = outcomes(Local(tasks(*names), Names(tmp_path), lambda task: tmp_path / task.path, 2))
    assert [each.split("!")[0] for each in found] == names
    assert sum("killed, twice" in each for each in found) == 3


@pytest.mark.slow
def test_processes_that_never_live_end_the_run(tmp_path: Path) -> None:
    names = [f"deadly-{number}" for number in range(8)]
    with pytest.raises(Failed, match="-j 1"):
        outcomes(Local(tasks(*names), Names(tmp_path), lambda task: tmp_path / task.path, 2))


MANY = 110
"""Captures of a run that is interrupted: enough for a slow machine to be in time."""


@pytest.fixture
def many(tmp_path: Path, captures: Path) -> Path:
    """Captures that keep two processes busy for some seconds; links, so that they cost no room."""
    folder = tmp_path / "many"
    folder.mkdir()
    data = (captures / "tour-machine.pcapng").read_bytes()
    one = tmp_path / "one.pcapng"
    one.write_bytes(data * 60)  # a capture of 60 sections
    for number in range(MANY):
        os.link(one, folder / f"{number:04}.pcapng")
    return folder


@pytest.fixture
def started(many: Path, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A run over `many` in a process group of its own, as a shell starts it, that has some results."""
    results = tmp_path / "r"
    command = [*DS47, "report", str(many), "--results", str(results), "-j", "2"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        wait_until(lambda: len(list(results.glob("*.pcapng.json"))) > 5)
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def wait_until(condition: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


def children(process: subprocess.Popen[str]) -> list[Any]:
    import psutil

    return psutil.Process(process.pid).children(recursive=True)


def alive(processes: list[Any]) -> list[Any]:
    import psutil

    return [
        each for each in processes if each.is_running() and each.status() != psutil.STATUS_ZOMBIE
    ]


needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of a terminal")


@pytest.mark.slow
@needs_posix
def test_ctrl_c_leaves_whole_results_and_no_process(
    started: subprocess.Popen[str], many: Path, tmp_path: Path, capsys: Any
) -> None:
    workers = children(started)
    assert len(workers) >= 2
    os.killpg(started.pid, signal.SIGINT)  # to all of them, as a terminal does
    output, errors = started.communicate(timeout=PATIENCE)
    assert started.returncode == 130, errors
    assert "Traceback" not in errors
    assert output == ""
    wait_until(lambda: not alive(workers))
    files = list((tmp_path / "r").iterdir())
    assert {path.suffix for path in files} == {".json"}, "a draft is left"
    assert 5 < len(files) < MANY
    assert f"interrupted: {len(files)} of {MANY} results are in" in errors
    assert "--resume" in errors
    for path in files:
        assert len(json.loads(path.read_bytes())["captures"]) == 1
    before = stamps(tmp_path / "r")
    status, text, problems = run(capsys, many, "--results", tmp_path / "r", "--resume")
    assert (status, problems) == (0, [])
    assert f"All {MANY} captures" in text
    assert before.items() <= stamps(tmp_path / "r").items()


@pytest.mark.slow
@needs_posix
def test_a_killed_process_costs_nothing_but_time(
    started: subprocess.Popen[str], tmp_path: Path
) -> None:
    victims = [each for each in children(started) if "spawn_main" in " ".join(each.cmdline())]
    victims[0].kill()
    output, errors = started.communicate(timeout=PATIENCE)
    assert (started.returncode, errors) == (0, "")
    assert f"All {MANY} captures: 0" not in output
    names = {path.name for path in (tmp_path / "r").iterdir()}
    assert names == {f"{number:04}.pcapng.json" for number in range(MANY)} | {"overview.json"}


@needs_posix
def test_without_the_run_its_processes_end(started: subprocess.Popen[str]) -> None:
    workers = [each for each in children(started) if "spawn_main" in " ".join(each.cmdline())]
    started.kill()
    started.communicate()
    wait_until(lambda: not alive(workers))


# -- memory and progress --------------------------------------------------------------------------

PEAK = """
import resource, sys
from ds47.cli import main
status = main(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)
sys.exit(status)
"""


@pytest.mark.slow
@needs_posix
@pytest.mark.parametrize("format_name", ["overview", "text", "ndjson"])
def test_memory_does_not_grow_with_the_number_of_captures(
    captures: Path, tmp_path: Path, format_name: str
) -> None:
    def peak(number: int) -> int:
        folder = tmp_path / f"captures-{number}"
        folder.mkdir()
        for each in range(number):
            os.link(tmp_path / "one.pcapng", folder / f"{each:05}.pcapng")
        command = [sys.executable, "-c", PEAK, "report", str(folder), "-f", format_name]
        command += ["--results", str(tmp_path / "r"), "-o", os.devnull, "-j", "1"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
        return int(done.stderr)

    shutil.copy(captures / "seed-g120-read.pcapng", tmp_path / "one.pcapng")
    few, more = peak(100), peak(1600)
    assert (more - few) / 1500 < 4, "kB for each capture more"


@needs_posix
def test_progress_on_a_terminal(folder: Path, tmp_path: Path) -> None:
    import pty

    here, there = pty.openpty()
    command = [*DS47, "report", str(folder), "-o", str(tmp_path / "report.txt"), "-j", "1"]
    done = subprocess.run(command, stderr=there, stdout=subprocess.DEVNULL, timeout=PATIENCE)
    os.close(there)
    shown = os.read(here, 100_000).decode()
    os.close(here)
    assert done.returncode == 3
    assert "6 of 6, " in shown
    assert "B/s" in shown
    assert "100%" in shown
    assert "no.pcap: not a capture" in shown


def test_no_progress_where_there_is_no_terminal(folder: Path) -> None:
    done = subprocess.run(
        [*DS47, "report", str(folder), "-f", "overview"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert [line[:6] for line in done.stderr.splitlines()] == ["ds47: "] * 2


def test_an_overview_of_results_given_as_a_whole() -> None:
    stream = io.StringIO()
    writer = report.open_writer("overview", stream)
    report.write_all(
        writer, Report([CaptureResult("a"), CaptureResult("b", problem="cut", complete=False)])
    )
    lines = stream.getvalue().splitlines()
    assert lines[0] == "Captures, the worst first"
    assert lines[2].endswith("b  only partly read: cut")
    assert lines[-3] == "All 2 captures: 1 without problems, 1 only partly read"
    assert CaptureRow.loaded(CaptureRow.unreadable("x", "why").plain()) == CaptureRow.unreadable(
        "x", "why"
    )


def test_columns_of_the_overview_line_up_in_chinese() -> None:
    findings = [finding("DS410", "error", "x", 1)] * 12345
    bad = CaptureResult("b", problem="cut", complete=False, dropped=2, findings=findings)
    rows = [
        CaptureRow.of(CaptureResult("a", complete=False)),
        CaptureRow.of(bad),
        CaptureRow.unreadable("c", "why"),
    ]
    title, *lines, more = worst_first(rows, report.ReportOptions(lang="zh"), 2)
    assert title == "抓包，问题最严重的在前"
    head, worst, second = (line.split() for line in lines)
    assert head == ["错误", "警告", "提示", "非正常任务", "任务总数", "抓包"]
    assert worst == ["-"] * 5 + ["c", "无法读取：why"]
    assert second == ["12,345", "0", "0", "0", "0", "b", "仅部分读取：cut", "丢失", "2", "帧"]
    starts = [line.index(last) for line, last in zip(lines, ("抓包", "c", "b"), strict=True)]
    assert len({columns(line[:at]) for line, at in zip(lines, starts, strict=True)}) == 1
    assert more == "  另有 1 个抓包（-f overview）"
    assert worst_first(rows[:1], report.ReportOptions(lang="zh"))[-1].endswith(
        "a  仅部分读取：文件提前结束"
    )


def test_an_overview_of_one_capture_that_is_ill(capsys: Any, captures: Path) -> None:
    _, text, _ = run(capsys, captures / "tour-machine.pcapng", "-f", "overview")
    assert "1 capture" in text.splitlines()


def test_jobs_that_failed_are_to_be_looked_at_whatever_is_ignored(
    captures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [arg for rule in ("DS2", "DS4", "DS7") for arg in ("--ignore", rule)]
    _, text, _ = run(capsys, "-f", "overview", *arguments, captures / "tour-machine.pcapng")
    lines = text.splitlines()
    assert lines[2].split()[:5] == ["0", "0", "0", "4", "8"]
    assert "1 capture" in lines


# -- what to do over all captures -----------------------------------------------------------------


@pytest.fixture
def ill(captures: Path, tmp_path: Path) -> Path:
    """Captures with a diagnosis each, of all severities, and near misses without it."""
    root = tmp_path / "ill"
    root.mkdir()
    for name in ("request-length", "value-in-wrong-type", "read-too-early", "axis-byte-ignored",
                 "index-and-count"):  # fmt: skip
        for path in captures.glob(f"diagnosis-{name}*.pcapng"):
            shutil.copy(path, root)
    return root


def test_what_to_do_over_all_captures(capsys: Any, ill: Path, tmp_path: Path) -> None:
    _, text, _ = run(capsys, ill, "--results", tmp_path / "r")
    found = stored(tmp_path / "r")
    overview = found.pop("overview.json")
    jsonschema.Draft202012Validator(report.schema("overview-1")).validate(overview)
    expected: dict[str, dict[str, Any]] = {}
    for document in found.values():  # by their names: the order of the run
        jsonschema.Draft202012Validator(report.schema()).validate(document)
        (capture,) = document["captures"]
        for rule in {each["rule"] for each in capture["diagnoses"]}:
            frames = [each["frame"] for each in capture["findings"] if each["rule"] == rule]
            about = expected.setdefault(rule, {"captures": 0, "findings": 0, "first": {
                "path": capture["path"], "frame": min(frames), "file": None, "file_frame": None,
            }})  # fmt: skip
            about["captures"] += 1
            about["findings"] += len(frames)
    to_do = overview["total"]["to_do"]
    assert len(to_do) == len(expected) >= 5
    for each in to_do:
        assert {key: each[key] for key in ("captures", "findings", "first")} == expected[
            each["rule"]
        ]
    ranks = [("error", "warning", "note").index(each["severity"]) for each in to_do]
    assert ranks == sorted(ranks)
    assert set(ranks) == {0, 1, 2}
    errors = [(each["captures"], each["findings"]) for each in to_do if each["severity"] == "error"]
    assert errors == sorted(errors, reverse=True)

    lines = text.splitlines()
    heads = [line.split()[0] for line in lines if line.startswith("  DS7")]
    assert heads == [each["rule"] for each in to_do]
    first = to_do[0]
    at = next(at for at, line in enumerate(lines) if line.startswith(f"  {first['rule']} error "))
    assert lines[at].endswith(f" {first['findings']} times in {first['captures']} captures")
    assert lines[at + 1].startswith("    -> ")
    where = first["first"]
    assert f"    first in frame {where['frame']} of {where['path']}" in lines[at:]


def test_the_text_report_ends_with_what_to_do_and_the_verdict_over_all(
    capsys: Any, ill: Path
) -> None:
    _, text, _ = run(capsys, "--all", ill)
    _, overview, _ = run(capsys, ill, "-f", "overview")
    *_, end = text.split("\nCaptures, the worst first (times: local)\n")
    lines = end.splitlines()
    counted = [line for line in overview.splitlines() if line.startswith(("  DS7", "    first in"))]
    at = lines.index("What to do") + 1
    assert lines[at : at + len(counted)] == counted  # without the advice, which each capture has
    number = len(list(ill.iterdir()))
    at = lines.index(f"All {number} captures")
    assert lines[at + 1].startswith("  NOT OK: ")
    assert (
        text.count("\nCaptures, the worst first ") == text.count(f"\nAll {number} captures\n") == 1
    )


@pytest.mark.slow
@pytest.mark.parametrize("format_name", ["text", "json", "ndjson", "html"])
def test_diagnoses_come_from_processes_and_results_as_they_were(
    capsys: Any, ill: Path, tmp_path: Path, format_name: str
) -> None:
    here = run(capsys, ill, "-f", format_name, "-j", "1")
    assert run(capsys, ill, "-f", format_name, "-j", "2") == here
    run(capsys, ill, "--results", tmp_path / "r")
    again = run(capsys, ill, "--results", tmp_path / "r", "--resume", "-f", format_name)
    if format_name != "ndjson":
        assert again == here
        return
    ends = [
        [
            each["capture"]["diagnoses"]
            for each in map(json.loads, text.splitlines())
            if "capture" in each
        ]
        for text in (again[1], contract_lines(ill))
    ]
    assert ends[0] == ends[1]
    assert any(each["corrected"] for end in ends[0] for each in end)


def contract_lines(folder: Path) -> str:
    """NDJSON of results that are already complete."""
    stream = io.StringIO()
    writer = report.open_writer("ndjson", stream)
    for path in sorted(folder.iterdir()):
        report.write_one(writer, analyze(path))
    return stream.getvalue()
