"""The pytest plugin, in a pytest of its own; and the example of docs/regression.md."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from ringbuffer import recording

pytest_plugins = ["pytester"]

DOCS = Path(__file__).resolve().parents[2] / "docs" / "regression.md"


@pytest.fixture
def folder(pytester, captures):
    from ds47.cli import main

    place = pytester.path / "captures"
    place.mkdir()
    for name in ("seed-g120-read.pcapng", "conversation-error.pcapng", "record-polls.pcapng"):
        shutil.copy(captures / name, place / name)
    assert (
        main(["baseline", str(place / "seed-g120-read.pcapng"), str(place / "record-polls.pcapng")])
        == 0
    )
    return place


def test_captures_with_a_stored_result_are_tests(pytester, folder):
    pytester.runpytest_subprocess("--ds47", "captures").assert_outcomes(passed=2)
    result = pytester.runpytest_subprocess("captures")
    result.assert_outcomes()


def test_an_export_with_a_stored_result_is_one(pytester, folder):
    for name in ("record-polls.pcapng", "record-polls.ds47.json"):
        (folder / name).rename(folder / name.replace(".", ".ds47.", 1))
    pytester.runpytest_subprocess("--ds47", "captures").assert_outcomes(passed=2)


def test_a_failure_says_what_changed(pytester, folder):
    stored = folder / "seed-g120-read.ds47.json"
    stored.write_text(stored.read_text("utf-8").replace("[0.0]", "[12.0]"), "utf-8")
    result = pytester.runpytest_subprocess("--ds47", "captures")
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(
        ["*transaction 1: p2900?0? was 12.0, is 0.0", "*ds47 accept *seed-g120-read.pcapng"]
    )


def test_a_cut_capture_fails(pytester, folder):
    whole = (folder / "record-polls.pcapng").read_bytes()
    (folder / "record-polls.pcapng").write_bytes(whole[:-20])
    pytester.runpytest_subprocess("--ds47", "captures").assert_outcomes(passed=1, failed=1)


def test_the_fixture(pytester, folder):
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

        def test_error(ds47_capture):
            cap = ds47_capture("captures/conversation-error.pcapng", lang="zh")
            assert [each.rule for each in cap.findings("error")] == ["DS410"]
            assert cap.findings(rule="drive-error") == cap.findings(rule="DS410")
            assert cap.findings(rule="DS1") == []
        """
    )
    pytester.runpytest_subprocess().assert_outcomes(passed=2)


def test_the_example_of_the_documentation(pytester, folder):
    blocks = re.findall(r"```python\n(.*?)```", DOCS.read_text("utf-8"), re.DOTALL)
    example = next(block for block in blocks if "ds47_capture" in block)
    pytester.makepyfile(example)
    result = pytester.runpytest_subprocess()
    assert result.ret == 0, result.stdout.str()
    assert result.parseoutcomes().get("passed", 0) >= 2


def test_a_series_with_a_stored_result_is_one_test(pytester, captures):
    from ds47.cli import main

    folder = recording(pytester.path / "plant", captures)
    assert main(["baseline", "--series", str(folder)]) == 0
    pytester.runpytest_subprocess("--ds47", "--ds47-series", "plant").assert_outcomes(passed=1)
    pytester.runpytest_subprocess("--ds47", "plant").assert_outcomes()
    stored = folder / "ring.ds47.json"
    stored.write_text(stored.read_text("utf-8").replace("[60.0]", "[12.0]"), "utf-8")
    result = pytester.runpytest_subprocess("--ds47", "--ds47-series", "plant")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*p50304?0? was 12.0, is 60.0", "*ds47 accept --series *ring_00001_*.pcapng"]
    )


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
