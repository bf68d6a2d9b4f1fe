"""What every test may ask for: the repository, the captures beside it, a tshark without settings.

Also what each test costs: the summary names those that are not marked slow and should be.

No test data lives here (``vectors/``) and no helper of a single module (its own test file).
"""

import gc
import os
import shutil
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

REPOSITORY = Path(__file__).resolve().parent.parent

# Wheels that tests build stay plain Python: compiling takes minutes, and CI does it once, without optimising.
os.environ.setdefault("DS47_COMPILE", "0")
os.environ.setdefault("DS47_COMPILE_LEVEL", "0")

# Times of day are those of this machine unless somebody asks for others: tests have one machine.
os.environ["TZ"] = "UTC"
if hasattr(time, "tzset"):
    time.tzset()

# A job that a shell starts in the background ignores Ctrl-C, and so does all that it starts: the tests of
# Ctrl-C want it as at a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


# How long an example takes is no fault of it: other processes have the machine as well.
settings.register_profile("ds47", deadline=None)
settings.load_profile("ds47")

gc.set_threshold(
    50_000
)  # what an analysis keeps has few cycles: looking for them often costs time alone


def pytest_runtest_teardown() -> None:
    """A command that ran in this process looks for garbage rarely, because it ends soon; tests go on."""
    if not gc.isenabled():
        gc.unfreeze()
        gc.enable()


LIMIT = 1.0
"""Seconds of CPU. A test that takes more is to be marked slow."""
_elsewhere = 0.0
"""CPU that counts for no test: what came before the present one, and what it made for all."""
_over: dict[str, float] = {}


def _cpu() -> float:
    """Of this process and those that it waited for. Unlike time, it does not depend on who else is at work."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    global _elsewhere
    _elsewhere = _cpu()
    return (yield)


class _MadeForMany:
    """What is made once for many tests does not count for the first of them.

    No function of this file: pytest asks one for the fixtures of a session only in the folder of its root.
    """

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef[object]
    ) -> Generator[None, object, object]:
        global _elsewhere
        start = _cpu()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                _elsewhere += _cpu() - start


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(_MadeForMany())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Up to the end of the call: what ends with the last test of a file, or of all, is not of that test."""
    report = yield
    if report.when == "call" and item.get_closest_marker("slow") is None:
        report.user_properties.append(("cpu", _cpu() - _elsewhere))
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    spent = dict(report.user_properties).get("cpu", 0.0)
    if spent > LIMIT:
        _over[report.nodeid] = spent


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """A report, which fails nothing: how fast the machine is decides as well."""
    if _over:
        terminalreporter.section(f"not marked slow, and more than {LIMIT:g} s of CPU")
    for name, spent in sorted(_over.items(), key=lambda each: -each[1]):
        terminalreporter.write_line(f"{spent:5.1f} s  {name}")


LONG = (
    "test_compiled.py", "test_lua_analysis.py", "test_wireshark_plugin.py", "test_profibus_master.py",
    "test_cluster.py", "test_folders.py", "test_audit.py", "test_engine.py", "test_readme.py",
    "test_lua_explain.py", "test_wheelhouse.py", "test_pytest_plugin.py", "test_one_page.py",
)  # fmt: skip
"""Files that take the longest, the longest first."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, then those of many tests: at the end no core waits for another's long file.

    With DS47_EVERY=3 of each test with parameters every third case, from the first one on.
    """
    every, seen = int(os.environ.get("DS47_EVERY", "1")), Counter[tuple[Path, str]]()

    def is_due(item: pytest.Item) -> bool:
        key = item.path, getattr(item, "originalname", item.name)
        seen[key] += 1
        if key[1].startswith("test_command_of"):  # it may need what one before it made
            return True
        return seen[key] % every == 1 % every

    items[:] = filter(is_due, items)
    many = Counter(item.path for item in items)

    def rank(item: pytest.Item) -> tuple[int, int]:
        name = item.path.name
        return (LONG.index(name) if name in LONG else len(LONG)), -many[item.path]

    items.sort(key=rank)


def _missing(what: str) -> None:
    """Skip the test, or fail it where DS47_CI says that everything has to be there."""
    if os.environ.get("DS47_CI") == "1":
        pytest.fail(f"{what} is missing, and DS47_CI=1 says that it must be there", pytrace=False)
    pytest.skip(f"{what} is missing")


@pytest.fixture(scope="session")
def repository() -> Path:
    """The root of the checkout."""
    return REPOSITORY


@pytest.fixture(scope="session")
def vectors() -> Path:
    """The folder of the vectors that both implementations have to pass."""
    return REPOSITORY / "tests" / "vectors"


@pytest.fixture(scope="session")
def captures() -> Path:
    """The stored captures of the lab."""
    return REPOSITORY / "captures"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder beside the checkout: reference vectors and captures of real stacks."""
    folder = REPOSITORY.parent / "shared"
    if not folder.is_dir():
        _missing("the folder ../shared")
    return folder


@pytest.fixture
def tshark(tmp_path: Path) -> Callable[..., str]:
    """A function that runs tshark with empty settings, in UTC, and returns what it printed."""
    program = os.environ.get("DS47_TSHARK") or shutil.which("tshark")
    if program is None:
        _missing("tshark")
    home = tmp_path / "tshark-home"
    home.mkdir()
    environment = {
        "PATH": os.environ.get("PATH", ""),
        "HOME": str(home),
        "XDG_CONFIG_HOME": str(home),
        "WIRESHARK_CONFIG_DIR": str(home),
        "LC_ALL": "C.UTF-8",
        "TZ": "UTC",
    }

    def run(*arguments: str | Path) -> str:
        result = subprocess.run(
            [str(program), "-n", *map(str, arguments)],
            env=environment,
            capture_output=True,
            encoding="utf-8",
            timeout=120,
            check=False,
        )
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run
