"""The same run on a Dask cluster: real workers on the loopback interface, one of them killed.

Captures behind URLs too: a web server on loopback, and what fsspec calls memory and file.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from batch_products import Names
from report_formats import STREAMED

from ds47 import __version__
from ds47.analysis import analyze
from ds47.batch.cluster import Cluster as Runner
from ds47.batch.tasks import Source, Task
from ds47.capture import CaptureError, open_capture, remote
from ds47.cli import main

distributed = pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.slow,  # Dask alone takes seconds to load
    pytest.mark.skipif(sys.platform == "win32", reason="real signals"),
]

PATIENCE = 90
ENVIRONMENT = {
    **os.environ,
    "PYTHONUTF8": "1",
    "DASK_DISTRIBUTED__ADMIN__EVENT_LOOP": "asyncio",
    "DASK_DISTRIBUTED__WORKER__MEMORY__TERMINATE": "False",
}


def start(program: str, *arguments: str) -> subprocess.Popen[bytes]:
    """A part of Dask as a process of its own."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{program}", *arguments]
    return subprocess.Popen(
        command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip


class Cluster:
    """A scheduler and worker processes on loopback."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        file = folder / "scheduler.json"
        self._scheduler = start(
            "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show",
            "--scheduler-file", str(file),
        )  # fmt: skip
        self.workers: list[subprocess.Popen[bytes]] = []
        try:
            wait_until(lambda: file.exists() and file.read_text().rstrip().endswith("}"))
        except BaseException:
            self.end()
            raise
        self.address: str = json.loads(file.read_text())["address"]

    def add(self, number: int) -> None:
        """More workers, of one thread each."""
        before = len(self.workers)
        for each in range(before, before + number):
            self.workers.append(
                start(
                    "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
                    "--host", "127.0.0.1", "--name", f"w{each}",
                    "--local-directory", str(self._folder / f"w{each}"),
                )
            )  # fmt: skip
        with distributed.Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(before + number, timeout=PATIENCE)

    def end(self) -> None:
        for process in [*self.workers, self._scheduler]:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Three workers."""
    found = Cluster(tmp_path_factory.mktemp("dask"))
    try:
        found.add(3)
        yield found
    finally:
        found.end()


@pytest.fixture
def folder(tmp_path: Path, captures: Path) -> Path:
    root = tmp_path / "plant"
    root.mkdir()
    for name in ("format-change", "tour-machine", "conversation-late-read", "transport-copy"):
        for path in captures.glob(f"{name}*.pcapng"):
            shutil.copy(path, root)
    data = (captures / "tour-machine.pcapng").read_bytes()
    (root / "cut.pcapng").write_bytes(data[: len(data) // 2])
    (root / "no.pcap").write_text("not a capture")
    shutil.copy(captures / "seed-g120-read.pcapng", root / "r_00001_20240101000000.pcapng")
    shutil.copy(captures / "seed-g120-read.pcapng", root / "r_00003_20240101000100.pcapng")
    return root


def wait_until(condition: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def run(capsys: Any, *arguments: str | Path) -> tuple[int, str, list[str]]:
    status = main(["report", *map(str, arguments)])
    shown = capsys.readouterr()
    return status, shown.out, shown.err.splitlines()


@pytest.mark.parametrize("format_name", ["text", "json", "overview", *STREAMED])
def test_a_cluster_says_what_one_machine_says(
    capsys: Any, folder: Path, cluster: Cluster, monkeypatch: Any, format_name: str
) -> None:
    monkeypatch.chdir(folder.parent)  # the workers have another working directory
    arguments = ("plant", "-f", format_name, "--series", "--digest")
    alone = run(capsys, *arguments)
    assert alone[0] == 3
    assert run(capsys, *arguments, "--scheduler", cluster.address) == alone


def test_stored_results_are_the_same_bytes(
    capsys: Any, folder: Path, cluster: Cluster, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    alone = run(capsys, folder, "--results", here)
    assert run(capsys, folder, "--results", there, "--scheduler", cluster.address) == alone
    names = sorted(path.name for path in here.iterdir())
    assert names == sorted(path.name for path in there.iterdir())
    assert len(names) > 5
    for name in names:
        assert (here / name).read_bytes() == (there / name).read_bytes(), name
    again = (folder, "--results", there, "--resume", "--scheduler", cluster.address)
    assert run(capsys, *again) == alone


@pytest.mark.skipif(os.name == "nt", reason="other lengths there")
def test_a_name_that_is_too_long_costs_only_its_capture(
    capsys: Any, folder: Path, cluster: Cluster, tmp_path: Path
) -> None:
    long = folder / f"{'a' * 242}.pcapng"
    shutil.copy(next(folder.rglob("tour-machine.pcapng")), long)
    alone = run(capsys, folder, "--results", tmp_path / "here")
    assert f"{long}: no result could be stored: File name too long" in alone[2][-1] + alone[2][0]
    there = run(
        capsys, folder, "--results", tmp_path / "there", "--scheduler", cluster.address
    )  # fmt: skip
    assert there == alone


def test_a_lost_worker_costs_its_files_again_and_nothing_else(
    capsys: Any, captures: Path, tmp_path: Path
) -> None:
    many = tmp_path / "many"
    many.mkdir()
    one = tmp_path / "one.pcapng"
    one.write_bytes((captures / "tour-machine.pcapng").read_bytes() * 60)
    for number in range(80):
        os.link(one, many / f"{number:04}.pcapng")
    expected = run(capsys, many, "--results", tmp_path / "alone")
    cluster = Cluster(tmp_path)
    results = tmp_path / "r"
    try:
        cluster.add(3)
        command = [sys.executable, "-m", "ds47", "report", str(many)]
        command += ["--results", str(results), "--scheduler", cluster.address]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        wait_until(lambda: process.poll() or len(list(results.glob("*.pcapng.json"))) > 10)
        os.kill(cluster.workers[1].pid, signal.SIGKILL)
        assert len(list(results.glob("*.pcapng.json"))) < 70, "the kill comes in the middle"
        output, errors = process.communicate(timeout=PATIENCE)
    finally:
        cluster.end()
    assert (process.returncode, output, errors.splitlines()) == expected
    for path in (tmp_path / "alone").iterdir():
        assert path.read_bytes() == (results / path.name).read_bytes()


def test_ctrl_c_leaves_whole_results(captures: Path, cluster: Cluster, tmp_path: Path) -> None:
    many = tmp_path / "many"
    many.mkdir()
    one = tmp_path / "one.pcapng"
    one.write_bytes((captures / "tour-machine.pcapng").read_bytes() * 60)
    for number in range(150):
        os.link(one, many / f"{number:04}.pcapng")
    results = tmp_path / "r"
    command = [sys.executable, "-m", "ds47", "report", str(many), "--results", str(results)]
    process = subprocess.Popen(
        [*command, "--scheduler", cluster.address],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    wait_until(lambda: process.poll() or len(list(results.glob("*.pcapng.json"))) > 5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    found = list(results.iterdir())
    assert f"interrupted: {len(found)} of 150 results" in errors
    for path in found:
        json.loads(path.read_bytes())


@pytest.mark.parametrize("stored", [True, False])
def test_a_lost_scheduler_ends_the_run_and_says_how_to_go_on(
    captures: Path, tmp_path: Path, stored: bool
) -> None:
    many, results = tmp_path / "many", tmp_path / "r"
    many.mkdir()
    one = tmp_path / "one.pcapng"
    one.write_bytes((captures / "tour-machine.pcapng").read_bytes() * 60)
    for number in range(60):
        os.link(one, many / f"{number:04}.pcapng")
    (tmp_path / "dask").mkdir()
    cluster = Cluster(tmp_path / "dask")
    command = [sys.executable, "-m", "ds47", "report", str(many)]
    more = ["--results", str(results)] if stored else ["-f", "ndjson", "-o", str(tmp_path / "o")]
    try:
        cluster.add(1)
        process = subprocess.Popen(
            [*command, *more, "--scheduler", cluster.address],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        if stored:
            wait_until(lambda: process.poll() or len(list(results.glob("*.pcapng.json"))) > 2)
        else:
            wait_until(lambda: process.poll() or any(map(os.path.getsize, tmp_path.glob(".o.*"))))
    finally:
        cluster.end()
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 3, errors
    said = f"ds47: the Dask scheduler at {cluster.address} is gone: "
    if not stored:
        assert re.fullmatch(
            re.escape(said) + r"\d+ of 60 captures were reported; "
            r"a run with --results FOLDER can be resumed\n", errors,
        )  # fmt: skip
        return
    found = list(results.iterdir())
    assert errors == (
        f"{said}{len(found)} of 60 results are in {results}; "
        "to go on: the same command with --resume\n"
    )
    assert main([*command[3:], *more, "--resume"]) == 0
    assert len(list(results.iterdir())) == 61


def test_a_capture_that_kills_every_worker_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(ENVIRONMENT, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "1")
    monkeypatch.setitem(ENVIRONMENT, "PYTHONPATH", str(Path(__file__).parent))
    (tmp_path / "dask").mkdir()
    cluster = Cluster(tmp_path / "dask")

    def outcome(name: str) -> Any:
        task = Task(name, (Source(name, name),))
        make, place = Names(tmp_path), tmp_path.joinpath
        with Runner([task], make, lambda each: place(each.path), cluster.address) as outcomes:
            ((_, found),) = outcomes
        return found

    try:
        cluster.add(3)
        problem = outcome("deadly")
        assert isinstance(problem, CaptureError)
        assert "every worker that analysed it was lost" in problem.message
        assert outcome("a").read_text() == "a"
        assert [process.poll() for process in cluster.workers].count(9) == 2
    finally:
        cluster.end()


# -- what is wrong with a cluster -----------------------------------------------------------------


def test_nobody_answers(capsys: Any, folder: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr("ds47.batch.cluster._SECONDS_TO_CONNECT", 1)
    status, _, problems = run(capsys, folder, "--scheduler", "tcp://127.0.0.1:9")
    assert status == 2
    assert problems[0].startswith("ds47: error: no Dask scheduler answers at tcp://127.0.0.1:9")
    assert len(problems) == 1


def test_a_scheduler_without_workers(
    capsys: Any, folder: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setattr("ds47.batch.cluster._SECONDS_FOR_WORKERS", 1)
    empty = Cluster(tmp_path)
    try:
        status, _, problems = run(capsys, folder, "--scheduler", empty.address)
    finally:
        empty.end()
    assert status == 2
    assert problems == [f"ds47: error: the Dask scheduler at {empty.address} has no workers"]


def test_workers_of_another_version(
    capsys: Any, folder: Path, cluster: Cluster, monkeypatch: Any
) -> None:
    monkeypatch.setattr("ds47.batch.cluster.__version__", "99.0")
    status, _, problems = run(capsys, folder, "--scheduler", cluster.address)
    assert status == 2
    assert len(problems) == 1
    assert f"has ds47 {__version__}" in problems[0]
    assert "this is 99.0: install the same version there" in problems[0]


def test_a_worker_that_comes_later_with_another_version(
    capsys: Any, folder: Path, cluster: Cluster, monkeypatch: Any
) -> None:
    monkeypatch.setattr("ds47.batch.cluster.__version__", "99.0")
    monkeypatch.setattr("ds47.batch.cluster.Cluster._check_workers", lambda *_: None)
    status, _, problems = run(capsys, folder, "--scheduler", cluster.address)
    assert status == 2
    assert problems[-1].startswith(
        f"ds47: error: a Dask worker has no ds47 99.0: there is {__version__}"
    )


def test_without_dask(capsys: Any, folder: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    status, _, problems = run(capsys, folder, "--scheduler", "tcp://127.0.0.1:9")
    assert status == 2
    assert problems == [
        f"ds47: error: --scheduler needs Dask: {sys.executable} -m pip install dask distributed fsspec"
    ]


# -- URLs -----------------------------------------------------------------------------------------


@pytest.fixture
def web(folder: Path) -> Iterator[str]:
    """A web server on loopback that shows the folder."""

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.fixture
def memory(captures: Path) -> Iterator[str]:
    """A folder in what fsspec calls memory."""
    import fsspec

    system = fsspec.filesystem("memory")
    for name in ("tour-machine", "format-change"):
        system.pipe(f"/plant/{name}.pcapng", (captures / f"{name}.pcapng").read_bytes())
    system.pipe("/plant/readme.txt", b"no capture")
    yield "memory://plant"
    system.rm("/plant", recursive=True)


def test_a_folder_behind_a_url(
    capsys: Any, folder: Path, web: str, memory: str, captures: Path, tmp_path: Path
) -> None:
    local = run(capsys, folder, "--digest", "-f", "json", "--series")
    for url in (f"{web}/", f"file://{folder}"):
        status, text, problems = run(capsys, url, "--digest", "-f", "json", "--series")
        assert status == 3
        assert text.replace(url.rstrip("/"), str(folder)) == local[1]
        assert len(problems) == len(local[2])
    status, text, problems = run(capsys, memory, "-f", "overview", "--results", tmp_path / "r")
    assert (status, problems) == (0, [])
    assert "All 2 captures" in text
    assert {path.name for path in (tmp_path / "r").iterdir()} == {
        "tour-machine.pcapng.json", "format-change.pcapng.json", "overview.json",
    }  # fmt: skip


def test_a_cluster_opens_urls_itself(capsys: Any, web: str, cluster: Cluster) -> None:
    alone = run(capsys, f"{web}/", "-f", "json")
    assert len(alone[1]) > 1000
    assert run(capsys, f"{web}/", "-f", "json", "--scheduler", cluster.address) == alone


def test_resume_knows_whether_a_url_has_changed(
    capsys: Any, web: str, folder: Path, tmp_path: Path
) -> None:
    arguments = (f"{web}/", "--results", tmp_path / "r", "--resume")
    first = run(capsys, *arguments)
    assert run(capsys, *arguments) == first
    os.utime(folder / "cut.pcapng", (1, 1))
    assert "ds47: 1 capture done again: changed" in run(capsys, *arguments)[2]


@pytest.fixture
def bucket() -> Iterator[Any]:
    """A place for results in what fsspec calls memory."""
    import fsspec

    system = fsspec.filesystem("memory")
    system.makedirs("/out", exist_ok=True)
    yield system
    system.rm("/out", recursive=True)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_results_behind_a_url(
    capsys: Any, folder: Path, bucket: Any, tmp_path: Path, monkeypatch: Any, jobs: str
) -> None:
    monkeypatch.chdir(tmp_path)
    here = run(capsys, folder, "--results", tmp_path / "r", "-j", jobs)
    earlier = (tmp_path / "r" / "tour-machine.pcapng.json").read_bytes()
    bucket.pipe("/out/line 1/no.pcap.json", earlier)  # of a time when it could be read
    arguments = (folder, "--results", "memory://out/line 1", "-j", jobs)
    assert run(capsys, *arguments) == here
    names = {
        path.relative_to(tmp_path / "r").as_posix() for path in (tmp_path / "r").rglob("*.json")
    }
    assert len(names) > 4

    def there() -> dict[str, bytes]:
        prefix = "/out/line 1/"
        return {name.removeprefix(prefix): bucket.cat_file(name) for name in bucket.find(prefix)}

    assert there() == {name: (tmp_path / "r" / name).read_bytes() for name in names}
    assert not list(tmp_path.glob("memory*"))
    made = {name: bucket.created(f"/out/line 1/{name}") for name in names}
    cut = "/out/line 1/tour-machine.pcapng.json"
    bucket.pipe(cut, bucket.cat_file(cut)[:1500])
    bucket.rm("/out/line 1/format-change.pcapng.json")
    status, text, problems = run(capsys, *arguments, "--resume", "-f", "text")
    assert (
        "ds47: 1 capture done again: damaged result, memory://out/line 1/tour-machine"
        in problems[0]
    )
    assert text == run(capsys, folder, "-f", "text")[1]
    assert {name for name in names if bucket.created(f"/out/line 1/{name}") != made[name]} == {
        "tour-machine.pcapng.json", "format-change.pcapng.json", "overview.json",
    }  # fmt: skip
    assert there() == {name: (tmp_path / "r" / name).read_bytes() for name in names}
    assert status == here[0]


def test_results_in_a_folder_by_its_url(capsys: Any, memory: str, tmp_path: Path) -> None:
    assert run(capsys, memory, "--results", f"file://{tmp_path}/r")[0] == 0
    assert (tmp_path / "r" / "overview.json").exists()


@pytest.mark.parametrize(
    ("url", "words"),
    [("no-such-protocol://x/y", "Protocol not known"), ("http://127.0.0.1:9/x", "a web server")],
)
def test_results_that_cannot_be_written_are_said_first(
    capsys: Any, folder: Path, tmp_path: Path, monkeypatch: Any, url: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ds47.batch.runner.make_here", None)
    before = set(tmp_path.iterdir())
    status, _, problems = run(capsys, folder, "--results", url)
    assert status == 2
    assert len(problems) == 1
    assert words in problems[0]
    assert set(tmp_path.iterdir()) == before


def test_a_url_that_takes_no_more_results_ends_the_run(
    capsys: Any, folder: Path, bucket: Any, monkeypatch: Any
) -> None:
    put, room = bucket.put_file, [4]  # the first is the overview that tries it

    def put_file(*arguments: Any) -> None:
        room[0] -= 1
        if room[0] < 0:
            raise PermissionError("the token has expired")
        put(*arguments)

    arguments = (folder, "--results", "memory://out", "-j", "1")
    monkeypatch.setattr(type(bucket), "put_file", staticmethod(put_file))
    status, _, problems = run(capsys, *arguments)
    assert status == 3
    assert "cannot write memory://out/" in problems[-1]
    assert "the token has expired: 3 of 7 results are in memory://out; " in problems[-1]
    assert problems[-1].endswith("to go on: the same command with --resume")
    room[0] = 99
    assert run(capsys, *arguments, "--resume")[1] == run(capsys, folder, "-f", "overview")[1]


def test_ctrl_c_writes_what_is_finished_to_the_url(
    capsys: Any, folder: Path, bucket: Any, monkeypatch: Any
) -> None:
    put, calls = bucket.put_file, []

    def put_file(*arguments: Any) -> None:
        calls.append(arguments)
        if len(calls) == 4:
            raise KeyboardInterrupt
        put(*arguments)

    monkeypatch.setattr(type(bucket), "put_file", staticmethod(put_file))
    status, _, problems = run(capsys, folder, "--results", "memory://out", "-j", "1")
    assert status == 130
    said = "ds47: interrupted: 3 of 7 results are in memory://out; "
    assert any(line.startswith(said) for line in problems)
    assert len(bucket.find("/out")) == 3


@pytest.mark.parametrize("command", ["baseline", "check", "accept"])
def test_stored_results_stand_in_folders(
    capsys: Any, memory: str, tmp_path: Path, monkeypatch: Any, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([command, memory]) == 2
    shown = capsys.readouterr()
    assert f"{memory}: stored results are beside captures in a folder" in shown.err
    assert shown.out == ""
    assert not list(tmp_path.iterdir())


def test_a_single_url(web: str, captures: Path) -> None:
    there = analyze(f"{web}/tour-machine.pcapng")
    here = analyze(captures / "tour-machine.pcapng")
    assert there.transactions == here.transactions


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("memory://nowhere/x.pcapng", "cannot be opened: No such file"),
        ("no-such-protocol://x.pcap", "Protocol not known: no-such-protocol"),
        ("{web}/none.pcap", "cannot be opened: "),
        ("http://127.0.0.1:9/x.pcap", "cannot be opened: "),
    ],
)
def test_a_url_that_cannot_be_opened(capsys: Any, web: str, url: str, words: str) -> None:
    name = url.format(web=web)
    with pytest.raises(CaptureError, match=words):
        open_capture(name)
    status, _, problems = run(capsys, name)
    assert status == 3
    assert len(problems) == 1
    assert name in problems[0]


def test_a_folder_that_cannot_be_listed(capsys: Any) -> None:
    status, _, problems = run(capsys, "http://127.0.0.1:9/folder")
    assert status == 3
    assert len(problems) == 1
    assert "http://127.0.0.1:9/folder: " in problems[0]


def test_without_fsspec(monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(CaptureError, match=r"needs the package fsspec: .* -m pip install fsspec$"):
        open_capture("s3://bucket/x.pcap")
    assert remote.facts("s3://bucket/x.pcap") == (0, None)


def test_what_the_loop_of_dask_says_while_it_ends_is_not_shown() -> None:
    """A callback that fails after Ctrl-C is Tornado's to log; it would stand above our one line."""
    program = (
        "import logging; from ds47.batch import cluster; cluster._distributed();"
        "logging.getLogger('tornado.application').error('Exception in callback')"
    )
    run = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert run.stderr == ""
