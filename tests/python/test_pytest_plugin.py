"""The pytest plugin, in a pytest of its own; and the example of docs/regression.md."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from ringbuffer import recording

pytest_plugins = ["pytester"]

DOCS = Path(__file__).resolve().parents[2] / "docs" / "regression.md"


INSTALLED = "PYTEST_DISABLE_PLUGIN_AUTOLOAD", "PYTEST_PLUGINS"


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    """Plugins of others take longer to import than all that is looked at here."""
    for name, value in zip(INSTALLED, ("1", "ds47.regression.pytest_plugin"), strict=True):
        monkeypatch.setenv(name, value)


@pytest.fixture
def folder(pytester, captures):
    from ds47.cli import main

    place = pytester.path / "captures"
    place.mkdir()
    for name in ("seed-g120-read.pcapng", "record-polls.pcapng"):
        shutil.copy(captures / name, place / name)
    assert main(["baseline", str(place)]) == 0
    return place


@pytest.mark.slow
def test_captures_are_tests(pytester, folder, monkeypatch):
    """As it is installed: pytest finds the plugin itself."""
    for name in INSTALLED:
        monkeypatch.delenv(name)
    pytester.runpytest_subprocess("--ds47", "captures").assert_outcomes(passed=2)
    result = pytester.runpytest_subprocess("captures")
    result.assert_outcomes()


def without_result(folder, captures):
    shutil.copy(captures / "conversation-error.pcapng", folder)
    return 1


def without_capture(folder, captures):
    (folder / "record-polls.pcapng").unlink()
    return 1


def with_nothing_but_results(folder, captures):
    for path in folder.glob("*.pcapng"):
        path.unlink()
    return 2


def with_a_link_to_nothing(folder, captures):
    (folder / "record-polls.pcapng").unlink()
    (folder / "record-polls.pcapng").symlink_to("no-such-file")
    (folder / "other.pcapng").symlink_to("no-such-file")
    return 2


def with_an_export(folder, captures):
    for name in ("record-polls.pcapng", "record-polls.ds47.json"):
        (folder / name).rename(folder / name.replace(".", ".ds47.", 1))
    return 1


def with_a_series(folder, captures):
    from ds47.cli import main

    recording(folder / "below", captures)
    assert main(["baseline", "--series", str(folder / "below")]) == 0
    return 4


def with_a_series_of_other_names(folder, captures):
    from ds47.cli import main

    for number, path in enumerate(sorted(recording(folder / "below", captures).iterdir())):
        path.rename(folder / "below" / f"t.pcapng{number + 1}")
    assert main(["baseline", "--series", str(folder / "below")]) == 0
    return 1


def with_a_changed_one(folder, captures):
    stored = folder / "seed-g120-read.ds47.json"
    stored.write_text(stored.read_text("utf-8").replace("[0.0]", "[12.0]"), "utf-8")
    return 1


def with_an_unreadable_one(folder, captures):
    (folder / "record-polls.pcapng").write_text("no capture")
    (folder / "empty.pcapng").write_bytes(b"")
    return 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [without_result, without_capture, with_nothing_but_results, with_a_link_to_nothing,
     with_an_export, with_a_series, with_a_series_of_other_names, with_a_changed_one,
     with_an_unreadable_one],
)  # fmt: skip
def test_it_fails_where_check_fails_and_says_the_same(pytester, folder, captures, capsys, make):
    from ds47.cli import main

    failed = make(folder, captures)
    (folder / "test_own.py").write_text("def test_own():\n    pass\n")
    capsys.readouterr()
    assert main(["check", str(folder)]) != 0
    shown = capsys.readouterr().out.splitlines()
    said = [line.removeprefix("FAILED").strip() for line in shown if line.startswith("FAILED")]
    result = pytester.runpytest_subprocess("--ds47", "captures")
    assert result.parseoutcomes()["failed"] == failed
    for line in said:
        assert line in result.outlines


@pytest.mark.slow
def test_a_folder_without_captures_is_wrong_use(pytester, folder):
    (pytester.path / "empty" / "below").mkdir(parents=True)
    result = pytester.runpytest_subprocess("--ds47", "captures", "empty")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*--ds47: empty: no capture in this folder"])
    (pytester.path / "empty" / "test_x.py").write_text("def test_x():\n    pass\n")
    pytester.runpytest_subprocess("--ds47", "captures", "empty").assert_outcomes(passed=3)


@pytest.mark.slow
def test_an_export_that_is_named_is_looked_at(pytester, folder):
    with_an_export(folder, None)
    pytester.runpytest_subprocess("--ds47", "captures/record-polls.ds47.pcapng").assert_outcomes(
        passed=1
    )


@pytest.mark.slow
def test_a_wrong_configuration_is_one_line(pytester, folder):
    (folder / "ds47.toml").write_text("[check]\nfail_on = 'sometimes'\n")
    result = pytester.runpytest_subprocess("--ds47", "captures")
    result.assert_outcomes(failed=2)
    assert any(line.startswith(str(folder / "ds47.toml")) for line in result.outlines)
    assert "Traceback" not in result.stdout.str()


@pytest.mark.slow
def test_a_failure_says_what_changed(pytester, folder):
    stored = folder / "seed-g120-read.ds47.json"
    stored.write_text(stored.read_text("utf-8").replace("[0.0]", "[12.0]"), "utf-8")
    result = pytester.runpytest_subprocess("--ds47", "captures")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["*transaction 1: p2900?0? was 12.0, is 0.0", "*ds47 accept *seed-g120-read.pcapng"]
    )


@pytest.mark.slow
def test_what_comes_of_a_newer_version_alone_passes_and_is_said(pytester, folder):
    stored = folder / "record-polls.ds47.json"
    document = json.loads(stored.read_text("utf-8"))
    document["tool"]["version"] = "1.0.0"
    document["capture"]["findings"].append(
        {"rule": "DS401", "severity": "error", "message": "m", "args": {}, "frame": 1, "transaction": 1}
    )  # fmt: skip
    stored.write_text(json.dumps(document), "utf-8")
    result = pytester.runpytest_subprocess("--ds47", "captures", "-rA")
    result.assert_outcomes(passed=2)
    result.stdout.fnmatch_lines(["stored by ds47 1.0.0; 1 change comes from the newer ds47 alone*"])


@pytest.mark.slow
def test_a_cut_capture_fails(pytester, folder):
    whole = (folder / "record-polls.pcapng").read_bytes()
    (folder / "record-polls.pcapng").write_bytes(whole[:-20])
    pytester.runpytest_subprocess("--ds47", "captures").assert_outcomes(passed=1, failed=1)


@pytest.mark.slow
def test_the_fixture(pytester, folder, captures):
    shutil.copy(captures / "conversation-error.pcapng", folder)
    pytester.makepyfile(
        """
        import pytest

        def test_read(ds47_capture):
            cap = ds47_capture("captures/seed-g120-read.pcapng")
            assert not cap.findings("error")
            assert cap.last_value(2900) == 0.0
            assert cap.last_value(2902, 3) == 20.0
            assert cap.last_value(1) is None
            assert len(cap.transactions) == 1
            assert cap.parameters(2902)[0].values == [10.0, 20.0, 50.0, 100.0]
            with pytest.raises(ValueError):
                cap.findings("fatal")

        def test_missing(ds47_capture):
            ds47_capture("captures/none.pcapng")

        def test_error(ds47_capture):
            cap = ds47_capture("captures/conversation-error.pcapng")
            assert [each.rule for each in cap.findings("error")] == ["DS410"]
            assert cap.findings(rule="drive-error") == cap.findings(rule="DS410")
            assert cap.findings(rule="DS1") == []

        def test_none(ds47_capture):
            assert not ds47_capture("captures/conversation-error.pcapng").findings("error")
        """
    )
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(passed=2, failed=2)
    assert "assert not [<ds47 finding DS410 error, frame 4, #1: offset 4: " in result.stdout.str()
    assert (
        "captures/none.pcapng: cannot be opened: No such file or directory" in result.stdout.str()
    )
    assert "exception" not in result.stdout.str()


@pytest.mark.slow
def test_the_example_of_the_documentation(pytester, folder):
    blocks = re.findall(r"```python\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL)
    example = next(block for block in blocks if "ds47_capture" in block)
    pytester.makepyfile(example)
    result = pytester.runpytest_subprocess()
    assert result.ret == 0, result.stdout.str()
    assert result.parseoutcomes().get("passed", 0) >= 2


@pytest.mark.slow
def test_a_series_with_a_stored_result_is_one_test(pytester, captures):
    from ds47.cli import main

    folder = recording(pytester.path / "plant", captures)
    assert main(["baseline", "--series", str(folder)]) == 0
    pytester.runpytest_subprocess("--ds47", "--ds47-series", "plant").assert_outcomes(passed=1)
    pytester.runpytest_subprocess("--ds47", "plant").assert_outcomes(failed=4)
    named = "plant/" + sorted(path.name for path in folder.glob("*.pcapng"))[1]
    pytester.runpytest_subprocess("--ds47", "--ds47-series", named).assert_outcomes(passed=1)
    stored = folder / "ring.ds47.json"
    stored.write_text(stored.read_text("utf-8").replace("[60.0]", "[12.0]"), "utf-8")
    result = pytester.runpytest_subprocess("--ds47", "--ds47-series", "plant")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*p50304?0? was 12.0, is 60.0", "*ds47 accept --series *ring_00001_*.pcapng"]
    )


@pytest.mark.slow
def test_without_its_option_a_series_of_tcpdump_fails_and_says_so(pytester, captures):
    from ds47.cli import main

    folder = recording(pytester.path / "plant", captures)
    for number, path in enumerate(sorted(folder.iterdir())):
        path.rename(folder / f"t.pcapng{number or ''}")
    assert main(["baseline", "--series", str(folder)]) == 0
    result = pytester.runpytest_subprocess("--ds47", "plant")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*use --series (pytest: --ds47-series)"])
    pytester.runpytest_subprocess("--ds47", "--ds47-series", "plant").assert_outcomes(passed=1)
