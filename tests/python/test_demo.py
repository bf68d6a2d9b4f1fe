"""The commands for the first half minute: the demo, and what a shell completes."""

import os
import shutil
import subprocess
import sys

import pytest

from ds47.cli import main


def test_the_demo_shows_a_report_and_writes_a_page(capsys, tmp_path, captures):
    assert main(["demo", "--no-browser", "-o", str(tmp_path / "tour")]) == 0
    out = capsys.readouterr().out
    assert "NOT OK: 192.168.133.2 writes while its own request is open" in out
    assert "What to do" in out
    assert f"open {tmp_path / 'tour' / 'report.html'} in a browser" in out
    assert out.splitlines()[-1].endswith(
        f"ds47 report --all {tmp_path / 'tour' / 'tour-machine.pcapng'}"
    )
    assert (tmp_path / "tour" / "report.html").read_text("utf-8").startswith("<!doctype html>")
    assert (tmp_path / "tour" / "tour-machine.pcapng").read_bytes() == (
        captures / "tour-machine.pcapng"
    ).read_bytes()


def test_the_demo_opens_the_page(capsys, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    assert main(["demo", "--lang", "zh", "-o", str(tmp_path)]) == 0
    assert opened == [(tmp_path / "report.html").as_uri()]
    assert f"完整报告已在浏览器中打开：{tmp_path / 'report.html'}" in capsys.readouterr().out


def test_the_demo_says_where_it_cannot_write(capsys, tmp_path):
    (tmp_path / "file").write_text("x")
    assert main(["demo", "--no-browser", "-o", str(tmp_path / "file" / "in")]) == 2
    assert "cannot write" in capsys.readouterr().err


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_what_a_shell_can_read(capsys, shell):
    assert main(["completion", shell]) == 0
    source = capsys.readouterr().out
    assert "_DS47_COMPLETE" in source
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=source, text=True, check=True)


@pytest.mark.parametrize(
    ("typed", "word", "offered"),
    [
        ("ds47 re", 1, "plain,report"),
        ("ds47 report --st", 2, "plain,--state"),
        ("ds47 report -f j", 3, "plain,json"),
    ],
)
def test_commands_options_and_values_are_completed(typed, word, offered):
    environment = {
        **os.environ,
        "_DS47_COMPLETE": "bash_complete",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(word),
    }
    code = "import sys; from ds47.cli import main; sys.exit(main([]))"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True
    )
    assert offered in done.stdout.splitlines()
